//! What sleep saves: `cargo bench --bench sleep`.
//!
//! Many small walls of boxes, 10,000 in all, are run to rest and timed while all are awake, while all sleep, and while all
//! but a few sleep; on the CPU in ms a step, on the GPU also in dispatches. `--quick` runs one iteration of everything on
//! a small scene, as a test; `--no-gpu` leaves the GPU out.

use std::time::Instant;
use tumble::prelude::*;
use tumble_core::scenes;

struct Settings {
    walls: usize,
    warm_up: usize,
    steps: usize,
    gpu: bool,
}

/// Who is awake.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Awake {
    All,
    /// One wall in a hundred, and no fewer than one.
    Few,
    None,
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// The walls, with boxes that must stay awake on top of some.
fn scene(walls: usize, awake: Awake) -> Scene {
    const BASE: usize = 10;
    let source = scenes::many_pyramids(walls, BASE);
    let bodies_a_wall = BASE * (BASE + 1) / 2;
    let mut scene = Scene::new();
    let mut boxes = 0;
    for body in source.bodies() {
        let builder = source.body(body).expect("it is there").clone();
        let (_, collider) = source.colliders_of(body).expect("it is there")[0];
        let dynamic = builder.body_type == RigidBodyType::Dynamic;
        boxes += usize::from(dynamic);
        let top = boxes % bodies_a_wall == 0 && (boxes / bodies_a_wall) % 100 == 1;
        scene.insert(builder.can_sleep(!(awake == Awake::Few && dynamic && top)), collider.clone());
    }
    scene
}

fn measure(settings: &Settings, backend: Backend, awake: Awake) -> f64 {
    let sleep = (awake != Awake::All).then(|| Sleep { time: 0.5, ..Sleep::default() });
    let params = Params { sleep, ..Params::default() };
    let mut world = World::new(scene(settings.walls, awake), params, backend).expect("the scene is valid");
    let step = |world: &mut World| {
        let begin = Instant::now();
        world.step().expect("step");
        world.sync().expect("sync");
        begin.elapsed().as_secs_f64() * 1e3
    };
    for _ in 0..settings.warm_up {
        step(&mut world);
    }
    let ms = median((0..settings.steps).map(|_| step(&mut world)).collect());
    let report = world.sync().expect("report");
    let dispatches = match &world {
        World::Gpu(world) => format!(", {} dispatches", world.dispatches()),
        World::Cpu(_) => String::new(),
    };
    println!("  {:5} of {:5} bodies asleep {ms:9.4} ms/step{dispatches}", report.asleep, report.bodies - 1);
    ms
}

fn main() {
    let has = |flag: &str| std::env::args().any(|argument| argument == flag);
    let settings = match has("--quick") {
        true => Settings { walls: 2, warm_up: 150, steps: 1, gpu: !has("--no-gpu") },
        false => Settings { walls: 182, warm_up: 300, steps: 60, gpu: !has("--no-gpu") },
    };
    let backends = [(Backend::Cpu, "cpu"), (Backend::Gpu, "gpu")];
    for (backend, name) in backends.into_iter().take(1 + usize::from(settings.gpu)) {
        println!("{name}: {} walls of 55 boxes", settings.walls);
        let [all, few, none] = [Awake::All, Awake::Few, Awake::None].map(|who| measure(&settings, backend, who));
        println!("  asleep all but a few {:.1} times as fast, all {:.1} times", all / few, all / none);
    }
}
