//! Explore.
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/jointed.rs"]
mod jointed;
use jointed::*;
use tumble::prelude::*;
use tumble_bench::hard_cases::By;
use tumble_core::scenes;

#[test]
fn explore() {
    let which = std::env::var("CASE").unwrap_or_default();
    let cases: Vec<(&str, Scene, usize)> = vec![
        ("chain14x20", scenes::chain(14, 20.0), 600),
        ("chain15x10", scenes::chain(15, 10.0), 600),
        ("chain15x100", scenes::chain(15, 100.0), 600),
        ("chain15x1000", scenes::chain(15, 1000.0), 600),
        ("chain20x1000", scenes::chain(20, 1000.0), 600),
        ("cable20", scenes::cable(20, 1.0), 600),
        ("cable20x100", scenes::cable(20, 100.0), 600),
        ("bridge20", scenes::rope_bridge(20), 600),
        ("bridge40", scenes::rope_bridge(40), 600),
        ("closed1", scenes::closed_chain(1.0), 600),
        ("closed100", scenes::closed_chain(100.0), 600),
        ("net10", scenes::net(10, 1.0), 600),
        ("net10x100", scenes::net(10, 100.0), 600),
        ("grid12", scenes::joint_grid(12), 600),
        ("grid32", scenes::joint_grid(32), 600),
        ("falling20", scenes::falling_chain(20), 600),
        ("wrecking15", scenes::wrecking_ball(15, 200.0), 600),
        ("ragdoll", scenes::ragdoll(), 600),
        ("ragdolls20", scenes::ragdolls(20), 600),
        ("ragdolls100", scenes::ragdolls(100), 600),
        ("pendulum", scenes::pendulum(1.0, 1.5708).0, 1200),
        ("fourbars", scenes::four_bars(4), 600),
        ("car", scenes::car().0, 600),
        ("cardan", scenes::cardan(0.5, 5.0).scene, 600),
    ];
    for (name, scene, steps) in cases.into_iter().filter(|c| which.is_empty() || which.split(',').any(|w| c.0.starts_with(w))) {
        for by in [By::Cpu, By::Rapier] {
            let t = std::time::Instant::now();
            let w = std::panic::catch_unwind(|| watch(&scene, by, params(4), steps));
            println!("{name:14} {by:?} {w:?} {:?}", t.elapsed());
        }
    }
}
