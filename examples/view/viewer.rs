//! A scene in a window: what happens in a frame, and what events do.

use crate::args::{Args, Coloring, SCENE};
use crate::asked::Failure;
use crate::grab::Grab;
use crate::gui::Gui;
use crate::input::{self, Action, Drag, Pointer};
use crate::log::Log;
use crate::overlay::Overlay;
use crate::panel::{self, Facts};
use crate::screen::Screen;
use crate::simulation::{Projectile, Simulation};
use serde_json::json;
use std::time::{Duration, Instant};
use tumble::core::glam::{Vec2, Vec3};
use tumble::{Backend, Error, World};
use tumble_draw::{Bounds, OrbitCamera, Renderer};
use wgpu::DeviceType;
use winit::event::{ElementState, MouseButton, WindowEvent};
use winit::event_loop::ActiveEventLoop;

/// Where the camera stands at first: turn and height, rad, and its field of view.
const YAW: f32 = 0.6;
const PITCH: f32 = 0.42;
const FOV_Y: f32 = 0.75;
/// A thrown body is there after so many seconds, at what the camera turns around.
const FLIGHT: f32 = 0.6;
/// Fastest throw, m/s.
const FASTEST_THROW: f32 = 80.0;

/// All that is shown.
pub(crate) struct Viewer {
    pub(crate) screen: Screen,
    gui: Gui,
    renderer: Renderer,
    drawn_revision: u64,
    simulation: Simulation,
    overlay: Overlay,
    camera: OrbitCamera,
    pointer: Pointer,
    shift_is_down: bool,
    coloring: Coloring,
    shows_panel: bool,
    shows_help: bool,
    log: Log,
    told_error: Option<String>,
    frames: u32,
    most_frames: Option<u32>,
    last_frame: Option<Instant>,
    /// 1/s, a running mean.
    frame_rate: Option<f64>,
    /// Something changed that is not drawn yet.
    is_stale: bool,
}

impl Viewer {
    /// # Errors
    /// What is wrong with the arguments, the window or the device.
    pub(crate) fn open(event_loop: &ActiveEventLoop, args: &Args) -> Result<Self, Failure> {
        let (standard, bodies) = args.asked.scene(Some(SCENE))?;
        let screen = Screen::open(event_loop, &format!("tumble – {}", standard.name), args.size)?;
        let backend = match args.asked.backend() {
            Backend::Auto if screen.info.device_type == DeviceType::Cpu => Backend::Cpu,
            Backend::Auto => Backend::Gpu,
            side => side,
        };
        let mut simulation =
            Simulation::new((standard, bodies), args.asked.params()?, backend, &screen.device, &screen.queue)?;
        simulation.is_paused = args.paused;
        let renderer = Renderer::new(&screen.device, screen.format(), simulation.world.scene())?;
        let log = Log::new(args.log_events);
        let side = if matches!(simulation.world, World::Gpu(_)) { "gpu" } else { "cpu" };
        log.tell(|| json!({"event": "opened", "scene": standard.name, "backend": side, "adapter": screen.info.name}));
        let mut viewer = Self {
            gui: Gui::new(&screen),
            camera: OrbitCamera { focus: Vec3::ZERO, distance: 1.0, yaw: YAW, pitch: PITCH, fov_y: FOV_Y },
            screen,
            renderer,
            drawn_revision: simulation.revision,
            simulation,
            overlay: Overlay::default(),
            pointer: Pointer::default(),
            shift_is_down: false,
            coloring: args.colors,
            shows_panel: true,
            shows_help: false,
            log,
            told_error: None,
            frames: 0,
            most_frames: args.frames,
            last_frame: None,
            frame_rate: None,
            is_stale: true,
        };
        viewer.frame_all()?;
        Ok(viewer)
    }

    /// When to draw next: at once, after a while, or when something happens.
    pub(crate) fn next_frame(&self) -> Option<Duration> {
        let is_busy = self.is_stale || !self.simulation.is_paused || self.most_frames.is_some();
        if is_busy { Some(Duration::ZERO) } else { Some(self.gui.repaint_in).filter(|delay| *delay < Duration::MAX) }
    }

    /// Whether as many frames were shown as were asked for.
    pub(crate) fn is_done(&self) -> bool {
        self.most_frames.is_some_and(|most| self.frames >= most)
    }

    /// Runs the steps that are due, and shows the state after them.
    ///
    /// # Errors
    /// When there is no drawing on. What the world refuses is shown instead.
    pub(crate) fn frame(&mut self) -> Result<(), Failure> {
        let elapsed = self.last_frame.replace(Instant::now()).map_or(0.0, |last| last.elapsed().as_secs_f64());
        if elapsed > 0.0 && !self.simulation.is_paused {
            let rate = 1.0 / elapsed;
            self.frame_rate = Some(self.frame_rate.map_or(rate, |mean| mean + 0.1 * (rate - mean)));
        }
        let held = self.held();
        self.simulation.advance(elapsed, held);
        if let Some(failure) = self.screen.take_failure() {
            self.simulation.fail(&failure);
        }
        let Some(texture) = self.screen.acquire() else { return Ok(()) };
        self.is_stale = false;
        if let Err(error) = self.overlay.update(&mut self.simulation, self.coloring, held) {
            self.pointer.drag = None;
            self.simulation.fail(&error);
        }
        let panel = self.lay_out();
        if self.drawn_revision != self.simulation.revision {
            self.renderer.set_scene(self.simulation.world.scene())?;
            self.drawn_revision = self.simulation.revision;
        }
        let poses = self.simulation.poses()?;
        let view = texture.texture.create_view(&Default::default());
        let mut encoder = self.screen.device.create_command_encoder(&Default::default());
        let (camera, style) = (self.camera.camera(), self.overlay.style());
        self.renderer.draw(&mut encoder, &view, self.screen.size(), &camera, &poses, &style)?;
        self.gui.paint(&self.screen, &mut encoder, &view);
        self.screen.queue.submit([encoder.finish()]);
        self.screen.present(texture);
        self.frames = self.frames.saturating_add(1);
        self.tell_frame(panel);
        Ok(())
    }

    /// Lays out the panel and does what was asked in it; the panel's place in pixels.
    fn lay_out(&mut self) -> Option<[f32; 4]> {
        let energy = self.simulation.energy();
        let facts = Facts {
            scene: self.simulation.standard.name,
            report: &self.simulation.report,
            params: self.simulation.world.params(),
            adapter: &self.screen.info.name,
            is_gpu: matches!(self.simulation.world, World::Gpu(_)),
            bodies: self.simulation.world.scene().len(),
            frames: self.frame_rate,
            milliseconds: self.simulation.milliseconds,
            slowness: self.simulation.slowness(),
            energy,
            is_paused: self.simulation.is_paused,
            error: self.simulation.error.as_deref(),
            coloring: self.coloring,
            shows_panel: self.shows_panel,
            shows_help: self.shows_help,
        };
        let answer = self.gui.run(&self.screen.window, |context| panel::show(context, &facts))?;
        for action in answer.actions {
            self.perform(action);
        }
        answer.rect.map(|rect| self.gui.pixels(rect))
    }

    fn tell_frame(&mut self, panel: Option<[f32; 4]>) {
        if self.simulation.error != self.told_error {
            self.told_error = self.simulation.error.clone();
            if let Some(error) = &self.told_error {
                self.log.tell(|| json!({"event": "error", "message": error}));
            }
        }
        let OrbitCamera { focus, distance, yaw, pitch, fov_y } = self.camera;
        self.log.tell(|| {
            json!({
                "event": "presented",
                "frame": self.frames,
                "step": self.simulation.report.step,
                "camera": {"focus": focus.to_array(), "distance": distance, "yaw": yaw, "pitch": pitch, "fov_y": fov_y},
                "panel": panel,
            })
        });
    }

    /// What an event of the window does; whether the program ends.
    ///
    /// # Errors
    /// As for [`frame`](Self::frame).
    pub(crate) fn on_event(&mut self, event: &WindowEvent) -> Result<bool, Failure> {
        let (is_panels, wants_frame) = self.gui.on_event(&self.screen.window, event);
        self.is_stale |= wants_frame && !matches!(event, WindowEvent::RedrawRequested);
        match event {
            WindowEvent::CloseRequested => return Ok(true),
            WindowEvent::RedrawRequested => self.frame()?,
            WindowEvent::Resized(size) => {
                self.screen.resize(*size);
                self.is_stale = true;
            }
            WindowEvent::ModifiersChanged(modifiers) => self.shift_is_down = modifiers.state().shift_key(),
            WindowEvent::KeyboardInput { event, .. } if !is_panels => {
                if let Some(action) = input::action(event) {
                    if action == Action::Quit {
                        return Ok(true);
                    }
                    self.perform(action);
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                let to = Vec2::new(position.x as f32, position.y as f32);
                self.pointer.go(to, self.screen.size().1, &mut self.camera);
                self.is_stale |= self.pointer.drag.is_some();
            }
            WindowEvent::MouseInput { state: ElementState::Pressed, button, .. } if !is_panels => self.press(*button),
            WindowEvent::MouseInput { state: ElementState::Released, button, .. } => self.release(*button),
            WindowEvent::MouseWheel { delta, .. } if !is_panels => {
                self.camera.zoom(input::zoom(delta));
                self.is_stale = true;
            }
            _ => {}
        }
        Ok(self.is_done())
    }

    fn perform(&mut self, action: Action) {
        self.is_stale = true;
        let log = self.log;
        match action {
            Action::Pause => {
                self.simulation.is_paused = !self.simulation.is_paused;
                let is_paused = self.simulation.is_paused;
                log.tell(|| json!({"event": "paused", "paused": is_paused}));
            }
            Action::Step => {
                self.simulation.is_paused = true;
                self.simulation.single_steps = (self.simulation.single_steps + 1).min(crate::clock::MOST_STEPS);
            }
            Action::Reset => {
                self.pointer.drag = None;
                self.simulation.reset();
                log.tell(|| json!({"event": "reset"}));
            }
            Action::Frame => {
                if let Err(error) = self.frame_all() {
                    self.simulation.fail(&error);
                }
            }
            Action::Throw(what) => self.throw(what),
            Action::Color(coloring) => {
                self.coloring = coloring;
                log.tell(|| json!({"event": "colors", "by": format!("{coloring:?}").to_lowercase()}));
            }
            Action::Substeps(substeps) => {
                let params = tumble::Params {
                    accuracy: tumble::Accuracy::Substeps(substeps),
                    ..*self.simulation.world.params()
                };
                self.set_params(params);
            }
            Action::Profile(profile) => {
                let params = tumble::Params { profile, ..*self.simulation.world.params() };
                self.set_params(params);
            }
            Action::Help => self.shows_help = !self.shows_help,
            Action::Panel => self.shows_panel = !self.shows_panel,
            Action::Quit => {}
        }
    }

    fn set_params(&mut self, params: tumble::Params) {
        if let Err(error) = self.simulation.world.set_params(params) {
            self.simulation.fail(&error);
        }
    }

    fn frame_all(&mut self) -> Result<(), Error> {
        let poses = self.simulation.world.poses()?;
        let bounds = Bounds::of(self.simulation.world.scene(), &poses);
        let (width, height) = self.screen.size();
        let aspect = width as f32 / height.max(1) as f32;
        self.camera = OrbitCamera::framing(&bounds, self.camera.yaw, self.camera.pitch, FOV_Y, aspect);
        Ok(())
    }

    /// The ray under the pointer, and the camera's view.
    fn ray(&self) -> (Vec3, Vec3, Vec3) {
        let (width, height) = self.screen.size();
        let camera = self.camera.camera();
        let (origin, direction) = camera.ray(self.pointer.at.x, self.pointer.at.y, width, height);
        (origin, direction, camera.axes()[2])
    }

    /// What is held, and where it is to go.
    fn held(&self) -> Option<(Grab, Vec3)> {
        let (origin, direction, forward) = self.ray();
        self.pointer.held().map(|grab| (grab, grab.target(origin, direction, forward)))
    }

    fn press(&mut self, button: MouseButton) {
        if self.pointer.drag.is_some() {
            return;
        }
        let drag = match button {
            MouseButton::Middle => Drag::Pan,
            MouseButton::Left | MouseButton::Right if self.shift_is_down => Drag::Pan,
            MouseButton::Right => Drag::Turn,
            MouseButton::Left => self.pick(),
            _ => return,
        };
        self.pointer.drag = Some((button, drag));
        self.is_stale = true;
    }

    /// A body under the pointer is pulled; elsewhere the view turns.
    fn pick(&mut self) -> Drag {
        let (origin, direction, forward) = self.ray();
        match Grab::pick(&mut self.simulation.world, origin, direction, forward) {
            Ok(Some(grab)) => {
                self.log.tell(|| json!({"event": "grabbed", "body": grab.body.slot()}));
                Drag::Pull(grab)
            }
            Ok(None) => Drag::Turn,
            Err(error) => {
                self.simulation.fail(&error);
                Drag::Turn
            }
        }
    }

    fn release(&mut self, button: MouseButton) {
        if let Some((_, drag)) = self.pointer.drag.take_if(|(by, _)| *by == button) {
            self.is_stale = true;
            if let Drag::Pull(grab) = drag {
                let point = grab.point(&mut self.simulation.world).ok().map(|point| point.to_array());
                self.log.tell(|| json!({"event": "released", "body": grab.body.slot(), "point": point}));
            }
        }
    }

    /// From the camera along the ray under the pointer, so fast that it soon is where the camera looks.
    fn throw(&mut self, what: Projectile) {
        let (origin, direction, _) = self.ray();
        let size = self.simulation.size;
        let from = origin + direction * (4.0 * size).min(0.5 * self.camera.distance);
        let speed = (self.camera.distance / FLIGHT).min(FASTEST_THROW);
        match self.simulation.throw(what, from, direction * speed) {
            Ok(body) => self.log.tell(|| json!({"event": "thrown", "body": body.slot()})),
            Err(error) => self.simulation.fail(&error),
        }
    }
}
