//! What several tests share.

use std::sync::OnceLock;

use tumble_gpu::Gpu;

/// The one device of a test program: making several at once has crashed drivers.
///
/// # Panics
/// When there is no adapter, saying what to install.
pub(crate) fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| {
        let gpu = Gpu::any().unwrap_or_else(|error| panic!("{error}"));
        eprintln!("adapter: {} ({:?}, {})", gpu.info.name, gpu.info.backend, gpu.info.driver_info);
        gpu
    })
}
