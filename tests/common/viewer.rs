//! The program `examples/view`, run by a test that reads the events it tells.

use crate::program::program;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};
use tumble_core::glam::Vec3;
use tumble_draw::OrbitCamera;

/// No event or picture is waited for any longer. Only a test that fails takes so long.
pub(crate) const LONGEST: Duration = Duration::from_secs(120);

/// The program while it runs; ended with it.
pub(crate) struct Viewer {
    child: Child,
    events: Receiver<Value>,
}

/// A frame that is on its way to the screen.
#[derive(Debug, Clone)]
pub(crate) struct Presented {
    pub(crate) step: u64,
    pub(crate) camera: OrbitCamera,
    /// Left, top, right, bottom, pixels.
    pub(crate) panel: Option<[f32; 4]>,
}

impl Viewer {
    /// Runs it on this display.
    pub(crate) fn start(display: &str, arguments: &[&str]) -> Self {
        let mut command = Command::new(program("view"));
        command.args(arguments).arg("--log-events").env("DISPLAY", display);
        command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let (sender, events) = mpsc::channel();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let event = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
                if sender.send(event).is_err() {
                    break;
                }
            }
        });
        Self { child, events }
    }

    /// The next event for which `wanted` has an answer; those before it are passed over.
    pub(crate) fn wait<T>(&self, what: &str, mut wanted: impl FnMut(&Value) -> Option<T>) -> T {
        let deadline = Instant::now() + LONGEST;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let event = self.events.recv_timeout(left).unwrap_or_else(|error| panic!("no {what}: {error}"));
            if let Some(found) = wanted(&event) {
                return found;
            }
        }
    }

    /// The next event of this name.
    pub(crate) fn event(&self, name: &str) -> Value {
        self.wait(name, |event| (event["event"] == name).then(|| event.clone()))
    }

    /// The next frame for which this holds.
    pub(crate) fn frame(&self, what: &str, wanted: impl Fn(&Presented) -> bool) -> Presented {
        self.wait(what, |event| (event["event"] == "presented").then(|| presented(event)).filter(&wanted))
    }

    /// Waits for the end.
    pub(crate) fn end(mut self) -> ExitStatus {
        // Its events end with it.
        self.wait_for_silence();
        self.child.wait().unwrap()
    }

    fn wait_for_silence(&self) {
        let deadline = Instant::now() + LONGEST;
        while let Ok(event) = self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            drop(event);
        }
        assert!(Instant::now() < deadline, "the program does not end");
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn presented(event: &Value) -> Presented {
    let camera = &event["camera"];
    let number = |value: &Value| value.as_f64().unwrap() as f32;
    let focus = &camera["focus"];
    let panel = &event["panel"];
    Presented {
        step: event["step"].as_u64().unwrap(),
        camera: OrbitCamera {
            focus: Vec3::new(number(&focus[0]), number(&focus[1]), number(&focus[2])),
            distance: number(&camera["distance"]),
            yaw: number(&camera["yaw"]),
            pitch: number(&camera["pitch"]),
            fov_y: number(&camera["fov_y"]),
        },
        panel: panel.is_array().then(|| std::array::from_fn(|i| number(&panel[i]))),
    }
}

/// What a run that ends by itself says on standard error, drivers apart, and its exit code.
pub(crate) fn failing(command: &mut Command) -> (Option<i32>, String) {
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut told = String::new();
    child.stderr.take().unwrap().read_to_string(&mut told).unwrap();
    let lines: Vec<_> = told.lines().filter(|line| !line.contains("XDG_RUNTIME_DIR")).collect();
    assert_eq!(lines.len(), 1, "{lines:?}");
    assert!(lines[0].starts_with("error: ") && !lines[0].contains("panicked"), "{lines:?}");
    (child.wait().unwrap().code(), lines[0].to_owned())
}
