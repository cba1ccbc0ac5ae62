//! stub
#[cfg(feature = "cpu")]
pub use tumble_cpu as cpu;
pub mod prelude {
    pub use tumble_core::*;
    pub enum Backend {
        Gpu,
    }
    pub struct World;
    impl World {
        pub fn new(_: Scene, _: Params, _: Backend) -> Result<Self> {
            Ok(World)
        }
        pub fn step(&mut self) -> Result<()> {
            Ok(())
        }
        pub fn sync(&mut self) -> Result<()> {
            Ok(())
        }
        pub fn poses(&mut self) -> Result<Poses> {
            todo!()
        }
    }
}
