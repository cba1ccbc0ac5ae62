//! Structures that stand by friction and balance, on both sides and in rapier, same dt, friction and shapes, sleep off, in
//! one run. Oracle: rapier, and that what is stable stands. See the rows with
//! `cargo test --release --test structures -- --nocapture --test-threads 1`.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;

use beside::{
    Any, DEEPEST, DRIFT, FASTEST, Held, ON_DEMAND, Plan, SINK, SUBSTEPS, USUAL, all_hold, compare, named, params, run,
    substeps, told,
};
use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};
use tumble_core::{Accuracy, scenes};

/// It is watched for 10 s. What must stand sinks by at most a fifth of what it does in rapier, and overlaps by a tenth.
fn watch(row: &str, name: &str, scene: Scene, accuracy: Accuracy, limit: f64, stands: bool) -> Vec<String> {
    let scenes = [scene];
    let plan = Plan { scenes: &scenes, params: params(accuracy), steps: 600, limit, by: &By::ALL, stands };
    let held = [Held(SINK, 0.2, 0.0), told(DRIFT), Held(DEEPEST, 0.1, 0.1), told(FASTEST)];
    compare(&Case::new(row, &format!("{name}, {}, 10 s", named(accuracy))), &plan, &held)
}

/// Two levels stand at the usual 8 sub-steps, three with 16. Five stand in rapier; here they fall with 24, and with 32 on
/// one side.
#[test]
fn a_card_house_stands() {
    let house = |levels: usize, accuracy, stands| {
        watch("B06", &format!("card house of {levels} levels"), scenes::card_house(levels), accuracy, 0.1, stands)
    };
    all_hold([
        house(2, USUAL, true),
        house(3, Accuracy::Substeps(16), true),
        house(5, USUAL, false),
        house(5, ON_DEMAND, false),
    ]);
}

/// Ten layers stand at the usual 8 sub-steps. Thirty do in rapier, 9 cm lower; here they fall, and stand with 12 and more.
#[test]
fn jenga_stands() {
    let tower = |layers: usize, accuracy, stands| {
        watch("B07", &format!("Jenga, {layers} layers"), scenes::jenga(layers), accuracy, 0.2, stands)
    };
    all_hold([
        tower(10, USUAL, true),
        tower(30, USUAL, false),
        tower(30, Accuracy::Substeps(16), true),
        tower(30, ON_DEMAND, false),
    ]);
}

/// Oracle: each domino hits the next, so that the last but one lies on the last, or beyond where it stood: some body has
/// sunk by nearly 20 mm, half a domino's height less half its width.
#[test]
fn dominoes_fall_to_the_last() {
    let scene = scenes::dominoes(30);
    let case = Case::new("B08", "30 dominoes, 4 s");
    for by in By::ALL {
        let n = substeps(by, SUBSTEPS);
        let end = run(&scene, by, params(USUAL), 240, f64::INFINITY);
        assert!(case.row(by, n, "sink of one that fell", "mm", end.sink, Ask::AtLeast(19.0)), "{by:?}: {end:?}");
        case.row(by, n, "deepest overlap", "mm", end.deepest, Ask::Beside(0.1));
        case.row(by, n, "fastest body", "mm/s", end.fastest, Ask::Beside(1.0));
        let last = last_lean(&scene, by);
        assert!(case.row(by, n, "lean of the last", "rad", last, Ask::AtLeast(1.0)), "{by:?}: {last}");
    }
}

/// How far the last body has turned from upright, rad.
fn last_lean(scene: &Scene, by: By) -> f64 {
    let mut world = Any::new(by, scene, params(USUAL));
    world.steps(240);
    let last = scene.bodies().last().expect("a domino");
    f64::from((world.state().0[last].rotation * Vec3::Y).dot(Vec3::Y)).acos()
}

/// What stands nowhere: planks of 8 mm, less than half the distance at which contacts are kept. Said, not asserted.
#[test]
fn planks_are_told() {
    all_hold(
        [USUAL, ON_DEMAND]
            .map(|accuracy| watch("B09", "Kapla tower, 10 layers", scenes::plank_tower(10), accuracy, 0.04, false)),
    );
}
