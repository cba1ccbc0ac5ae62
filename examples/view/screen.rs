//! The window, and the device that draws into it.

use crate::asked::Failure;
use std::sync::{Arc, Mutex, PoisonError};
use tumble::Error;
use wgpu::{Backends, CurrentSurfaceTexture, DeviceType, Features, InstanceFlags, Limits, TextureFormat};
use winit::dpi::PhysicalSize;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

/// A window, its surface, and a device that can present to it.
pub(crate) struct Screen {
    pub(crate) window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) info: wgpu::AdapterInfo,
    /// The first thing that went wrong and that nobody caught.
    failure: Arc<Mutex<Option<String>>>,
}

impl Screen {
    /// # Errors
    /// Where there is no window to be had, or no adapter that presents to it.
    pub(crate) fn open(event_loop: &ActiveEventLoop, title: &str, size: (u32, u32)) -> Result<Self, Failure> {
        let size = PhysicalSize::new(size.0, size.1);
        let attributes = Window::default_attributes().with_title(title).with_inner_size(size);
        let window = event_loop.create_window(attributes);
        let window = Arc::new(window.map_err(|error| Failure::Run(format!("no window can be opened: {error}")))?);

        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = Backends::VULKAN | Backends::METAL;
        // Twice as fast for a world on the same device, see `tumble::gpu::Gpu::from_device`.
        descriptor.flags = InstanceFlags::default() - InstanceFlags::VALIDATION_INDIRECT_CALL;
        if cfg!(windows) {
            descriptor.backends = Backends::VULKAN | Backends::DX12;
            descriptor.flags = InstanceFlags::default();
        }
        let backends = descriptor.backends;
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance
            .create_surface(Arc::clone(&window))
            .map_err(|error| no_adapter(&format!("the window's surface: {error}")))?;
        let adapters = pollster::block_on(instance.enumerate_adapters(backends));
        let adapter = best(adapters, &surface)?;
        let (device, queue) = pollster::block_on(adapter.request_device(&wanted(&adapter)))
            .map_err(|error| no_adapter(&format!("{}: {error}", adapter.get_info().name)))?;
        let failure = note_failures(&device);

        let inner = window.inner_size();
        let config = surface.get_default_config(&adapter, inner.width.max(1), inner.height.max(1));
        let mut config = config.ok_or_else(|| no_adapter("the adapter does not present to the window"))?;
        // One that converts, so that what is seen through is mixed as light.
        let formats = surface.get_capabilities(&adapter).formats;
        let converts =
            |format: &&TextureFormat| matches!(format, TextureFormat::Bgra8UnormSrgb | TextureFormat::Rgba8UnormSrgb);
        config.format = formats.iter().find(converts).copied().unwrap_or(config.format);
        config.present_mode = wgpu::PresentMode::AutoVsync;
        surface.configure(&device, &config);
        Ok(Self { window, surface, config, info: adapter.get_info(), device, queue, failure })
    }

    pub(crate) fn format(&self) -> TextureFormat {
        self.config.format
    }

    /// Width and height, pixels.
    pub(crate) fn size(&self) -> (u32, u32) {
        (self.config.width, self.config.height)
    }

    pub(crate) fn resize(&mut self, size: PhysicalSize<u32>) {
        let most = self.device.limits().max_texture_dimension_2d;
        if size.width > 0 && size.height > 0 {
            (self.config.width, self.config.height) = (size.width.min(most), size.height.min(most));
            self.surface.configure(&self.device, &self.config);
        }
    }

    /// What to draw into, if there is something now.
    pub(crate) fn acquire(&mut self) -> Option<wgpu::SurfaceTexture> {
        match self.surface.get_current_texture() {
            CurrentSurfaceTexture::Success(texture) | CurrentSurfaceTexture::Suboptimal(texture) => Some(texture),
            CurrentSurfaceTexture::Outdated | CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.device, &self.config);
                None
            }
            _ => None,
        }
    }

    pub(crate) fn present(&self, texture: wgpu::SurfaceTexture) {
        self.window.pre_present_notify();
        self.queue.present(texture);
    }

    /// What went wrong on the device since the last call.
    pub(crate) fn take_failure(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

fn no_adapter(detail: &str) -> Failure {
    Failure::Run(Error::NoAdapter { detail: detail.to_owned() }.to_string())
}

/// The best adapter that presents to the surface, hardware before software. Heeds `WGPU_ADAPTER_NAME`, as the library.
fn best(adapters: Vec<wgpu::Adapter>, surface: &wgpu::Surface) -> Result<wgpu::Adapter, Failure> {
    let wanted = std::env::var("WGPU_ADAPTER_NAME").unwrap_or_default().to_lowercase();
    let names: Vec<_> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
    let fits = |adapter: &wgpu::Adapter| {
        adapter.is_surface_supported(surface) && adapter.get_info().name.to_lowercase().contains(&wanted)
    };
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    };
    adapters.into_iter().filter(fits).min_by_key(rank).ok_or_else(|| match names.is_empty() {
        true => no_adapter("there is none at all"),
        false => no_adapter(&format!("none of {} presents to the window", names.join(", "))),
    })
}

/// What a world asks of a device, as far as the adapter has it.
fn wanted(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    let available = adapter.limits();
    let required_limits = Limits {
        max_buffer_size: available.max_buffer_size,
        max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
        max_texture_dimension_2d: available.max_texture_dimension_2d,
        ..Limits::default().or_worse_values_from(&available)
    };
    let required_features = adapter.features() & (Features::TIMESTAMP_QUERY | Features::SUBGROUP);
    wgpu::DeviceDescriptor { label: Some("view"), required_features, required_limits, ..Default::default() }
}

/// Without handlers, wgpu ends the process.
fn note_failures(device: &wgpu::Device) -> Arc<Mutex<Option<String>>> {
    let failure = Arc::new(Mutex::new(None::<String>));
    let note = |failure: &Mutex<Option<String>>, text: String| {
        failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(text);
    };
    let noted = Arc::clone(&failure);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&noted, error.to_string())));
    let noted = Arc::clone(&failure);
    device.set_device_lost_callback(move |reason, message| {
        if reason != wgpu::DeviceLostReason::Destroyed {
            note(&noted, format!("the GPU device was lost ({reason:?}: {message})"));
        }
    });
    failure
}
