//! A window on a scene: `cargo run --release --example view -- pile --bodies 1000`.
//!
//! Each frame runs the steps that real time calls for, and draws the bodies where the world left them: on the GPU side
//! from the world's own buffer of poses, on the same device. H tells the keys.

mod args;
#[path = "../common/asked.rs"]
mod asked;
mod clock;
mod grab;
mod gui;
mod input;
mod log;
mod overlay;
mod panel;
mod screen;
mod simulation;
mod viewer;

use args::{Args, SCENE};
use asked::Failure;
use std::io::{self, Write};
use std::process::ExitCode;
use std::time::Instant;
use viewer::Viewer;
use winit::application::ApplicationHandler;
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::WindowId;

fn main() -> ExitCode {
    let (code, message) = match asked::parse().and_then(show) {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Argument(message)) => (2, message),
        Err(Failure::Run(message)) => (1, message),
    };
    // Unlike `eprintln!`, this does not panic when nobody can read it.
    let _ = writeln!(io::stderr(), "error: {message}");
    ExitCode::from(code)
}

fn show(args: Args) -> Result<(), Failure> {
    args.asked.params()?;
    args.asked.scene(Some(SCENE))?;
    let event_loop = EventLoop::new().map_err(|error| {
        // Without the place in winit's sources.
        let told = error.to_string();
        let reason = told.rsplit(": ").next().unwrap_or(&told).trim_end_matches('.');
        Failure::Run(format!(
            "no display was found ({reason}); set DISPLAY or WAYLAND_DISPLAY, or use the example `run`, which needs none"
        ))
    })?;
    let mut app = App { args, viewer: None, ended: Ok(()) };
    let ran = event_loop.run_app(&mut app).map_err(|error| Failure::Run(format!("the display failed: {error}")));
    app.ended.and(ran)
}

/// What winit calls.
struct App {
    args: Args,
    /// From the moment on when there may be windows.
    viewer: Option<Viewer>,
    ended: Result<(), Failure>,
}

impl App {
    fn end(&mut self, event_loop: &ActiveEventLoop, how: Result<(), Failure>) {
        if self.ended.is_ok() {
            self.ended = how;
        }
        event_loop.exit();
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.viewer.is_none() {
            match Viewer::open(event_loop, &self.args) {
                Ok(viewer) => self.viewer = Some(viewer),
                Err(failure) => self.end(event_loop, Err(failure)),
            }
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let (StartCause::ResumeTimeReached { .. }, Some(viewer)) = (cause, &self.viewer) {
            viewer.screen.window.request_redraw();
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(viewer) = &mut self.viewer else { return };
        match viewer.on_event(&event) {
            Ok(false) => {}
            Ok(true) => self.end(event_loop, Ok(())),
            Err(failure) => self.end(event_loop, Err(failure)),
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(viewer) = &self.viewer else { return };
        let flow = match viewer.next_frame() {
            Some(delay) if delay.is_zero() => {
                viewer.screen.window.request_redraw();
                ControlFlow::Wait
            }
            Some(delay) => Instant::now().checked_add(delay).map_or(ControlFlow::Wait, ControlFlow::WaitUntil),
            None => ControlFlow::Wait,
        };
        event_loop.set_control_flow(flow);
    }
}
