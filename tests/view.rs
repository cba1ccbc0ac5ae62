//! The program `examples/view` in a window on a real X server, used as a user does: what it shows, what the pointer and
//! keys do, how it ends. Oracles: the same state drawn off screen, the same world run here, the camera's geometry.
#![cfg(target_os = "linux")]

mod common;
#[path = "common/program.rs"]
mod program;
#[path = "common/viewer.rs"]
mod viewer;
#[path = "common/xvfb.rs"]
mod xvfb;

use program::program;
use std::process::Command;
use std::time::Instant;
use tumble::core::glam::Vec2;
use tumble::core::scenes;
use tumble::prelude::*;
use tumble_draw::{Offscreen, OrbitCamera, PoseUpload, Renderer, Style};
use viewer::{LONGEST, Presented, Viewer, failing};
use xvfb::{LEFT, RIGHT, Screen, WHEEL_DOWN, WHEEL_UP};

const WIDTH: u32 = 800;
const HEIGHT: u32 = 600;
/// Coarse tiles in which pictures are compared.
const TILES: (usize, usize) = (16, 12);
/// How far the mean of a tile's channel may be off: on one adapter the shaders round to one of 255 either way.
const SAME: f64 = 1.5;
/// The panel's shadow reaches so far beyond it, pixels.
const SHADOW: f32 = 40.0;

fn screen() -> Screen {
    Screen::start(WIDTH as u16, HEIGHT as u16)
}

/// Runs it over the whole screen.
fn open(screen: &Screen, arguments: &[&str]) -> Viewer {
    Viewer::start(&screen.name, &[arguments, &["--size", "800x600"]].concat())
}

/// A world here, drawn off screen.
struct Drawn {
    world: World,
    renderer: Renderer,
    upload: PoseUpload,
    target: Offscreen,
}

impl Drawn {
    fn new(scene: Scene, backend: Backend) -> Self {
        let gpu = common::gpu();
        let renderer = Renderer::new(&gpu.device, Offscreen::FORMAT, &scene).unwrap();
        let params = Params::default();
        let world = match backend {
            Backend::Gpu => World::Gpu(Box::new(tumble::gpu::World::with_gpu(gpu.clone(), scene, params).unwrap())),
            _ => World::new(scene, params, Backend::Cpu).unwrap(),
        };
        let target = Offscreen::new(&gpu.device, &gpu.queue, WIDTH, HEIGHT).unwrap();
        Self { world, renderer, upload: PoseUpload::new(&gpu.device, &gpu.queue), target }
    }

    fn step_to(&mut self, step: u64) {
        while self.world.poses().unwrap().step() < step {
            self.world.step().unwrap();
        }
    }

    /// Red, green, blue a pixel.
    fn picture(&mut self, camera: &OrbitCamera) -> Vec<u8> {
        let poses = self.world.poses().unwrap();
        let poses = self.upload.write(self.world.scene(), &poses).unwrap();
        let style = Style::default();
        let rgba = self.target.picture(&mut self.renderer, &camera.camera(), poses, &style).unwrap();
        rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
    }
}

/// Mean of each channel in each tile that the panel and its shadow leave free.
fn tiles(picture: &[u8], panel: Option<[f32; 4]>) -> Vec<[f64; 3]> {
    let (across, down) = (WIDTH as usize / TILES.0, HEIGHT as usize / TILES.1);
    let is_free = |(x, y): (usize, usize)| {
        panel.is_none_or(|[left, top, right, bottom]| {
            let (x0, y0) = ((x * across) as f32, (y * down) as f32);
            x0 > right + SHADOW
                || y0 > bottom + SHADOW
                || x0 + (across as f32) < left - SHADOW
                || y0 + (down as f32) < top - SHADOW
        })
    };
    let places = (0..TILES.1).flat_map(|y| (0..TILES.0).map(move |x| (x, y))).filter(|place| is_free(*place));
    places.map(|(x, y)| mean(picture, x * across, y * down, across, down)).collect()
}

fn mean(picture: &[u8], left: usize, top: usize, width: usize, height: usize) -> [f64; 3] {
    let mut sum = [0u64; 3];
    for y in top..top + height {
        for x in left..left + width {
            let at = 3 * (y * WIDTH as usize + x);
            (0..3).for_each(|i| sum[i] += u64::from(picture[at + i]));
        }
    }
    sum.map(|sum| sum as f64 / (width * height) as f64)
}

/// The largest difference of a tile's channel, out of 255.
fn difference(a: &[u8], b: &[u8], panel: Option<[f32; 4]>) -> f64 {
    let (a, b) = (tiles(a, panel), tiles(b, panel));
    assert!(a.len() >= TILES.0 * TILES.1 / 3, "the panel leaves {} tiles", a.len());
    let each = a.iter().zip(&b).flat_map(|(a, b)| (0..3).map(move |i| (a[i] - b[i]).abs()));
    each.fold(0.0, f64::max)
}

/// Looks at the screen until it shows `expected` beside the panel: what a program presents comes when the server gets to
/// it. Returns the screen.
fn until_shown(screen: &Screen, expected: &[u8], panel: Option<[f32; 4]>) -> Vec<u8> {
    let begin = Instant::now();
    loop {
        let seen = screen.grab();
        let off = difference(&seen, expected, panel);
        if off < SAME {
            eprintln!("off by {off:.3} of 255 at most");
            return seen;
        }
        assert!(begin.elapsed() < LONGEST, "the screen is off by {off:.1} of 255");
    }
}

/// A frame with the panel; from then on the window has the keys.
fn opened(screen: &Screen, viewer: &Viewer) -> Presented {
    let frame = viewer.frame("frame with a panel", |frame| frame.panel.is_some());
    screen.focus();
    frame
}

/// The first frame with the panel in its place, and what the screen then shows.
fn first_frame(screen: &Screen, viewer: &Viewer, drawn: &mut Drawn) -> (Presented, Vec<u8>) {
    let frame = opened(screen, viewer);
    let picture = drawn.picture(&frame.camera);
    let seen = until_shown(screen, &picture, frame.panel);
    (frame, seen)
}

#[test]
fn the_window_shows_what_is_drawn_off_screen_and_the_panel() {
    let screen = screen();
    let viewer = open(&screen, &["pile", "--bodies", "60", "--backend", "cpu", "--paused"]);
    assert_eq!(viewer.event("opened")["backend"], "cpu");
    let mut drawn = Drawn::new(scenes::pile(60), Backend::Cpu);
    let (frame, mut seen) = first_frame(&screen, &viewer, &mut drawn);
    assert_eq!(frame.step, 0);

    // The panel is dark, has bright letters, and covers the scene. It may come some frames after its place.
    let [left, top, right, bottom] = frame.panel.unwrap().map(|x| x as usize);
    let (width, height) = (right - left, bottom.min(HEIGHT as usize) - top);
    let looks_right = |seen: &[u8]| {
        let color = mean(seen, left, top, width, height);
        let is_bright = |x: usize, y: usize| (0..3).all(|i| seen[3 * (y * WIDTH as usize + x) + i] > 200);
        let places = (top..top + height).flat_map(|y| (left..right).map(move |x| (x, y)));
        let bright = places.filter(|(x, y)| is_bright(*x, *y)).count() as f64 / (width * height) as f64;
        (color.iter().all(|channel| *channel < 80.0) && (0.003..0.2).contains(&bright), color, bright)
    };
    let begin = Instant::now();
    while !looks_right(&seen).0 {
        assert!(begin.elapsed() < LONGEST, "colour and share of bright pixels: {:?}", looks_right(&seen));
        seen = screen.grab();
    }

    // Without it, the whole picture is the scene.
    screen.point(500.0, 300.0);
    screen.key('p');
    let frame = viewer.frame("frame without a panel", |frame| frame.panel.is_none());
    until_shown(&screen, &drawn.picture(&frame.camera), None);
}

#[test]
fn steps_on_the_gpu_are_drawn_from_its_own_buffer() {
    let screen = screen();
    let viewer = open(&screen, &["pile", "--bodies", "60", "--backend", "gpu", "--paused"]);
    assert_eq!(viewer.event("opened")["backend"], "gpu");
    let mut drawn = Drawn::new(scenes::pile(60), Backend::Gpu);
    let (_, before) = first_frame(&screen, &viewer, &mut drawn);
    screen.point(500.0, 300.0);
    for step in 1..=30 {
        screen.key(if step % 2 == 0 { 'n' } else { '.' });
        viewer.frame("step", |frame| frame.step == step);
    }
    drawn.step_to(30);
    let frame = viewer.frame("step", |_| true);
    let after = until_shown(&screen, &drawn.picture(&frame.camera), frame.panel);
    assert!(difference(&before, &after, frame.panel) > 10.0, "bodies fell");
}

#[test]
fn dragging_turns_and_the_wheel_zooms() {
    let screen = screen();
    let viewer = open(&screen, &["mixed", "--bodies", "40", "--backend", "cpu", "--paused"]);
    let mut drawn = Drawn::new(scenes::mixed(40), Backend::Cpu);
    let (first, before) = first_frame(&screen, &viewer, &mut drawn);

    // The right button turns anywhere, bodies or not: across by a quarter of the height, 1 rad.
    screen.point(450.0, 300.0);
    screen.press(RIGHT);
    screen.point(600.0, 300.0);
    let turned = |frame: &Presented| frame.camera.yaw != first.camera.yaw;
    let frame = viewer.frame("turned frame", turned);
    screen.release(RIGHT);
    let by = (first.camera.yaw - frame.camera.yaw).rem_euclid(std::f32::consts::TAU);
    assert!((by - 1.0).abs() < 1e-4, "{by}");
    let after = until_shown(&screen, &drawn.picture(&frame.camera), frame.panel);
    assert!(difference(&before, &after, frame.panel) > 10.0);

    // The left button turns where there is no body: in the sky.
    screen.point(500.0, 20.0);
    screen.press(LEFT);
    screen.point(500.0, 80.0);
    let pitch = frame.camera.pitch;
    let frame = viewer.frame("tilted frame", |frame| frame.camera.pitch != pitch);
    screen.release(LEFT);
    assert!((frame.camera.pitch - pitch - 0.4).abs() < 1e-4, "{}", frame.camera.pitch);

    screen.press(WHEEL_UP);
    screen.release(WHEEL_UP);
    let frame = viewer.frame("nearer frame", |frame| frame.camera.distance < first.camera.distance);
    let nearer = frame.camera.distance / first.camera.distance;
    // Where the wheel is a button, winit tells its press and its release as a notch each.
    assert!([0.88, 0.88f32.powi(2)].iter().any(|notches| (nearer - notches).abs() < 1e-5), "{nearer}");
    until_shown(&screen, &drawn.picture(&frame.camera), frame.panel);

    screen.key('f');
    let frame = viewer.frame("whole scene", |framed| framed.camera.distance != frame.camera.distance);
    until_shown(&screen, &drawn.picture(&frame.camera), frame.panel);
}

#[test]
fn space_pauses_and_reset_begins_anew() {
    const SPACE: u32 = 0x20;
    let screen = screen();
    let viewer = open(&screen, &["balls", "--bodies", "30", "--backend", "cpu"]);
    let mut drawn = Drawn::new(scenes::balls(30), Backend::Cpu);
    opened(&screen, &viewer);
    viewer.frame("step", |frame| frame.step >= 20);
    screen.point(500.0, 300.0);
    screen.key(SPACE);
    assert_eq!(viewer.event("paused")["paused"], true);
    let paused = viewer.frame("frame", |_| true);
    drawn.step_to(paused.step);
    // What is shown is that step, exactly, and stays, though the pointer moves and frames are drawn.
    let expected = drawn.picture(&paused.camera);
    let seen = until_shown(&screen, &expected, paused.panel);
    screen.point(540.0, 340.0);
    screen.key('h');
    screen.key('h');
    let frame = viewer.frame("two more frames", |_| true);
    assert_eq!(frame.step, paused.step);
    let again = until_shown(&screen, &expected, frame.panel);
    assert!(difference(&seen, &again, frame.panel) < 0.01);

    screen.key(SPACE);
    assert_eq!(viewer.event("paused")["paused"], false);
    viewer.frame("step", |frame| frame.step > paused.step + 10);
    screen.key(SPACE);
    viewer.event("paused");
    screen.key('r');
    viewer.event("reset");
    let frame = viewer.frame("first state", |frame| frame.step == 0);
    let mut drawn = Drawn::new(scenes::balls(30), Backend::Cpu);
    let first = until_shown(&screen, &drawn.picture(&frame.camera), frame.panel);
    assert!(difference(&first, &seen, frame.panel) > 10.0);
}

#[test]
fn a_body_follows_the_cursor() {
    for backend in ["cpu", "gpu"] {
        let screen = screen();
        let viewer = open(&screen, &["column", "--bodies", "3", "--backend", backend]);
        opened(&screen, &viewer);
        // From afar, so that it can be pulled clear of the others.
        screen.point(500.0, 300.0);
        for _ in 0..8 {
            screen.press(WHEEL_DOWN);
            screen.release(WHEEL_DOWN);
        }
        // What comes after them comes after all of them.
        screen.key('1');
        viewer.event("colors");
        let first = viewer.frame("frame from afar", |_| true);
        assert!(first.camera.distance > 12.0);
        let camera = first.camera.camera();
        // The uppermost box of the column, where it stands.
        let world = World::new(scenes::column(3), Params::default(), Backend::Cpu).unwrap();
        let height = |body: &BodyHandle| world.scene().body(*body).unwrap().translation.y;
        let top = world.scene().bodies().max_by(|a, b| height(a).total_cmp(&height(b))).unwrap();
        let middle = world.scene().body(top).unwrap().translation;
        let at = camera.project(middle, WIDTH, HEIGHT).unwrap();

        screen.point(at.x, at.y);
        screen.press(LEFT);
        assert_eq!(viewer.event("grabbed")["body"], top.slot());
        // Up and aside.
        let to = at + Vec2::new(150.0, -150.0);
        screen.point(to.x, to.y);
        let pulled = viewer.frame("frame", |_| true);
        viewer.frame("a second more", |frame| frame.step >= pulled.step + 60);
        screen.release(LEFT);
        let released = viewer.event("released");
        assert_eq!(released["body"], top.slot());
        let point: Vec<_> = released["point"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect();
        let seen = camera.project(Vec3::from_slice(&point), WIDTH, HEIGHT).unwrap();
        eprintln!("{backend}: {:.2} px from the cursor", seen.distance(to));
        // Measured: 0.3 px, of which the pointer's whole pixels are up to 0.7.
        assert!(seen.distance(to) < 1.5, "{backend}: pulled to {seen}, the cursor is at {to}");
        let last = viewer.frame("frame", |_| true);
        assert_eq!(last.camera, first.camera, "the view stays");
    }
}

#[test]
fn thrown_bodies_appear() {
    for backend in ["cpu", "gpu"] {
        let screen = screen();
        let viewer = open(&screen, &["column", "--bodies", "2", "--backend", backend, "--paused"]);
        let side = if backend == "gpu" { Backend::Gpu } else { Backend::Cpu };
        let mut drawn = Drawn::new(scenes::column(2), side);
        let (first, _) = first_frame(&screen, &viewer, &mut drawn);
        // Past the column; so many that the buffers grow.
        let slots = drawn.world.scene().len();
        screen.point(620.0, 200.0);
        for i in 0..6 {
            screen.key(if i % 2 == 0 { 'b' } else { 'm' });
            assert_eq!(viewer.event("thrown")["body"], slots + i);
        }
        screen.key('n');
        let frame = viewer.frame("step", |frame| frame.step == 1);
        let begin = Instant::now();
        // Large before the camera, around the cursor, where there was nothing.
        let without = drawn.picture(&first.camera);
        while difference(&screen.grab(), &without, frame.panel) < 30.0 {
            assert!(begin.elapsed() < LONGEST, "{backend}: nothing is to be seen of what was thrown");
        }
    }
}

#[test]
fn colours_are_chosen_by_key_and_option() {
    let screen = screen();
    let viewer = open(&screen, &["pyramid", "--bodies", "15", "--backend", "gpu", "--paused", "--colors", "batches"]);
    let mut drawn = Drawn::new(scenes::find("pyramid").map(|s| (s.build)(15)).unwrap(), Backend::Gpu);
    opened(&screen, &viewer);
    screen.point(500.0, 40.0);
    screen.key('n');
    let frame = viewer.frame("step", |frame| frame.step == 1);
    drawn.step_to(1);
    let plain = drawn.picture(&frame.camera);
    let differs = |what: &str| {
        let begin = Instant::now();
        loop {
            let seen = screen.grab();
            // Bodies are recoloured.
            if difference(&seen, &plain, frame.panel) > 15.0 {
                return seen;
            }
            assert!(begin.elapsed() < LONGEST, "{what} look like bodies");
        }
    };
    let batches = differs("batches");
    screen.key('2');
    assert_eq!(viewer.event("colors")["by"], "contacts");
    viewer.frame("frame", |_| true);
    let begin = Instant::now();
    while difference(&screen.grab(), &batches, frame.panel) < 15.0 {
        assert!(begin.elapsed() < LONGEST, "contacts look like batches");
    }
    differs("contacts");
    screen.key('1');
    assert_eq!(viewer.event("colors")["by"], "body");
    until_shown(&screen, &plain, frame.panel);
}

#[test]
fn it_ends_cleanly() {
    const ESCAPE: u32 = 0xff1b;
    let screen = screen();
    let arguments = ["column", "--bodies", "2", "--backend", "cpu"];
    let viewer = open(&screen, &arguments);
    opened(&screen, &viewer);
    screen.close_window();
    assert_eq!(viewer.end().code(), Some(0), "closed");

    let viewer = open(&screen, &arguments);
    opened(&screen, &viewer);
    screen.point(500.0, 300.0);
    screen.key(ESCAPE);
    assert_eq!(viewer.end().code(), Some(0), "Escape");

    let viewer = open(&screen, &[&arguments[..], &["--paused", "--frames", "3"]].concat());
    assert_eq!(viewer.end().code(), Some(0), "as many frames as asked for");
}

/// More contacts on one body than the solver takes in turn: the world refuses the step.
#[test]
fn an_error_of_the_world_is_shown_and_survived() {
    const ESCAPE: u32 = 0xff1b;
    let screen = screen();
    let viewer = open(&screen, &["hub", "--bodies", "40000", "--backend", "cpu"]);
    opened(&screen, &viewer);
    let error = viewer.event("error");
    assert!(error["message"].as_str().unwrap().contains("`last batch`"), "{error}");
    let frame = viewer.frame("frame after it", |_| true);
    assert_eq!(frame.step, 0, "the last good state");
    screen.point(500.0, 300.0);
    screen.key(ESCAPE);
    assert_eq!(viewer.end().code(), Some(0));
}

#[test]
fn what_is_missing_is_told_in_one_line() {
    let run = |display: Option<&str>| {
        let mut command = Command::new(program("view"));
        command.args(["column", "--frames", "1"]);
        for variable in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(variable);
        }
        display.map(|display| command.env("DISPLAY", display));
        command
    };
    let (code, line) = failing(&mut run(None));
    assert!(code == Some(1) && line.contains("no display") && line.contains("set DISPLAY"), "{code:?}: {line}");
    let (code, line) = failing(&mut run(Some(":59999")));
    assert!(code == Some(1) && line.contains("no display"), "{code:?}: {line}");

    let screen = screen();
    let mut command = run(Some(&screen.name));
    for variable in ["VK_ICD_FILENAMES", "VK_DRIVER_FILES"] {
        command.env(variable, "/nonexistent");
    }
    let (code, line) = failing(&mut command);
    assert_eq!(code, Some(1), "{line}");
    assert!(line.contains("no GPU adapter was found") && line.contains("mesa-vulkan-drivers"), "{line}");
}

#[test]
fn bad_arguments_are_refused_in_one_line() {
    let cases: [(&[&str], &[&str]); 9] = [
        (&["pyramd"], &["'pyramd'", "pile", "hub", "'pyramid'"]),
        (&["--bodies", "0"], &["'0'", "--bodies", "1 to 5000000"]),
        (&["--size", "1280"], &["'1280'", "--size", "1280x720"]),
        (&["--size", "0x720"], &["'0x720'", "64 to 8192"]),
        (&["--size", "-5x9"], &["'-5x9'", "64 to 8192"]),
        (&["--dt", "NaN"], &["dt is NaN", "1e-6 to 1 s"]),
        (&["--substeps", "257"], &["'257'", "1 to 256"]),
        (&["--frames", "0"], &["'0'", "--frames"]),
        (&["--colors", "rainbow"], &["'rainbow'", "body", "contacts", "batches"]),
    ];
    for (arguments, told) in cases {
        // Without a display: arguments come first.
        let mut command = Command::new(program("view"));
        command.args(arguments).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        let (code, line) = failing(&mut command);
        assert_eq!(code, Some(2), "{arguments:?}: {line}");
        assert!(told.iter().all(|word| line.contains(word)), "{arguments:?}: {line}");
    }
}
