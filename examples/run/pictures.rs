//! Pictures of a run: `--png` and `--frames`.

use crate::asked::Failure;
use std::fs;
use std::path::{Path, PathBuf};
use tumble::{Error, Poses, World};
use tumble_draw::{Bounds, Camera, Offscreen, PoseUpload, Renderer, Style};
use tumble_gpu::Gpu;

/// Where the camera stands: yaw, pitch and height of the picture, rad.
const VIEW: (f32, f32, f32) = (0.5, 0.36, 0.6);
/// Pictures a second of simulated time.
const RATE: f64 = 30.0;

/// Draws a world's state, on the world's own device or on one made for it.
pub(crate) struct Pictures {
    renderer: Renderer,
    offscreen: Offscreen,
    /// Of poses that lie on the host.
    upload: PoseUpload,
}

impl Pictures {
    /// Everything that can be refused is refused here, before the run.
    pub(crate) fn new(world: &World, (width, height): (u32, u32)) -> Result<Self, Failure> {
        let gpu = match world {
            #[cfg(feature = "gpu")]
            World::Gpu(world) => world.gpu().clone(),
            #[cfg(feature = "cpu")]
            World::Cpu(_) => Gpu::any().map_err(no_adapter)?,
        };
        let (device, queue) = (&gpu.device, &gpu.queue);
        Ok(Self {
            renderer: Renderer::new(device, Offscreen::FORMAT, world.scene())?,
            offscreen: Offscreen::new(device, queue, width, height)?,
            upload: PoseUpload::new(device, queue),
        })
    }

    /// A camera that sees all that moves.
    pub(crate) fn camera(&self, world: &World, poses: &Poses) -> Camera {
        let (width, height) = self.offscreen.size();
        let (yaw, pitch, fov) = VIEW;
        Camera::framing(&Bounds::of(world.scene(), poses), yaw, pitch, fov, width as f32 / height as f32)
    }

    /// The state after the last step, as a PNG file's bytes.
    pub(crate) fn png(&mut self, world: &mut World, camera: &Camera) -> Result<Vec<u8>, Failure> {
        let style = Style::default();
        let pixels = match world {
            #[cfg(feature = "gpu")]
            World::Gpu(world) => {
                let (poses, _) = world.pose_buffer()?;
                self.offscreen.picture(&mut self.renderer, camera, poses, &style)?
            }
            #[cfg(feature = "cpu")]
            World::Cpu(world) => {
                let host = world.poses()?;
                let poses = self.upload.write(world.scene(), &host)?;
                self.offscreen.picture(&mut self.renderer, camera, poses, &style)?
            }
        };
        encode(&pixels, self.offscreen.size()).map_err(|error| Failure::Run(format!("cannot make a PNG: {error}")))
    }
}

fn no_adapter(error: Error) -> Failure {
    match error {
        Error::NoAdapter { detail } => Failure::Run(format!(
            "pictures are drawn by a graphics adapter, and none was found ({detail}); install a Vulkan driver (Debian: \
             `apt-get install mesa-vulkan-drivers` for the software one), or leave --png and --frames out"
        )),
        error => error.into(),
    }
}

fn encode(pixels: &[u8], (width, height): (u32, u32)) -> Result<Vec<u8>, png::EncodingError> {
    // Every pixel is opaque: red, green and blue are enough.
    let colors: Vec<u8> = pixels.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&colors)?;
    writer.finish()?;
    Ok(file)
}

/// A folder of pictures, one every 1/30 s of simulated time, and at most one a step.
pub(crate) struct Frames {
    folder: PathBuf,
    camera: Camera,
    written: u32,
    /// The thirtieth of a second of simulated time from which on the next picture is due.
    due: f64,
}

impl Frames {
    /// Draws the first one, of the state before the first step. The camera stays where it is.
    pub(crate) fn begin(folder: &Path, pictures: &mut Pictures, world: &mut World) -> Result<Self, Failure> {
        let poses = world.poses()?;
        let camera = pictures.camera(world, &poses);
        let mut frames = Self { folder: folder.to_owned(), camera, written: 0, due: 0.0 };
        frames.take(0.0, pictures, world)?;
        Ok(frames)
    }

    /// Draws one if it is due at this simulated time, s.
    pub(crate) fn take(&mut self, time: f64, pictures: &mut Pictures, world: &mut World) -> Result<(), Failure> {
        // A step's length is a rounded number: what is nearly due is due.
        let thirtieths = time * RATE + 1e-3;
        if thirtieths < self.due {
            return Ok(());
        }
        self.due = thirtieths.floor() + 1.0;
        let png = pictures.png(world, &self.camera)?;
        let path = self.folder.join(format!("frame_{:04}.png", self.written));
        fs::write(&path, png).map_err(|error| crate::cannot_write(&path, &error))?;
        self.written += 1;
        Ok(())
    }
}

/// Makes the folder where there is none.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Failure> {
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::Run(format!(
            "cannot write pictures into {}: it is a file, and no folder",
            folder.display()
        )));
    }
    fs::create_dir_all(folder).map_err(|error| crate::cannot_write(folder, &error))
}
