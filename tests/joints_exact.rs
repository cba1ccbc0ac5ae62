//! Joints whose motion has a formula. Oracle: analysis. Each prints its rows; see them all with
//! `cargo test --release --test joints_exact -- --nocapture --test-threads 1`, and the table of all cases in
//! `docs/results/*/hard_cases.md`.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/jointed.rs"]
mod jointed;

use beside::Any;
use glam::DVec3;
use jointed::{BESIDE, JOINT_SUBSTEPS, all_held, energy, params, row};
use std::f32::consts::FRAC_PI_2;
use std::f64::consts::{PI, TAU};
use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};
use tumble_core::measures::{joint_coordinates, joint_error};
use tumble_core::scenes;

const G: f64 = 9.81;

/// Period of a rigid pendulum that was let go at `angle` (rad) from hanging: 4 sqrt(I / (m g d)) K(sin(angle / 2)), the
/// elliptic integral by the arithmetic-geometric mean.
fn pendulum_period(scene: &Scene, body: BodyHandle, arm: f64, angle: f64) -> f64 {
    let mass = scene.mass_properties(body).expect("living");
    let inertia = f64::from(mass.principal_inertia.max_element()) / f64::from(mass.mass) + arm * arm;
    let (mut a, mut b) = (1.0, (0.5 * angle).cos());
    for _ in 0..10 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    TAU * (inertia / (G * arm)).sqrt() / a
}

/// The mean time between every other zero of samples at 60 Hz, found by straight lines between them.
fn period(samples: &[f64]) -> f64 {
    let crosses = |(i, w): (usize, &[f64])| (w[0] * w[1] < 0.0).then(|| i as f64 + w[0] / (w[0] - w[1]));
    let zeros: Vec<f64> = samples.windows(2).enumerate().filter_map(crosses).collect();
    assert!(zeros.len() > 2, "{} zeros", zeros.len());
    2.0 * (zeros[zeros.len() - 1] - zeros[0]) / (zeros.len() - 1) as f64 / 60.0
}

/// Angles of a hinge and total energies over so many steps, those at the start included.
fn swing(scene: &Scene, joint: JointHandle, by: By, params: Params, steps: usize) -> (Vec<f64>, Vec<f64>) {
    let mut world = Any::new(by, scene, params);
    let look = |world: &mut Any| {
        let (poses, velocities) = world.state();
        let angle = joint_coordinates(scene, &poses, joint).expect("living")[3];
        (angle, energy(scene, &poses, &velocities).iter().sum::<f64>())
    };
    let first = look(&mut world);
    let others = (0..steps).map(|_| {
        world.steps(1);
        look(&mut world)
    });
    std::iter::once(first).chain(others).unzip()
}

/// The hard case's pendulum: 0.05 rad, and let go level; and one let go near its top. In 20 s. Within a swing the energy goes to
/// and fro by the square of the sub-step.
#[test]
fn a_pendulum_keeps_its_period_and_energy() {
    let mut held = Vec::new();
    for (name, angle) in [("0.05 rad", 0.05f32), ("level", FRAC_PI_2), ("150 degrees", 2.618)] {
        let case = Case::new("A11", &format!("hinge pendulum let go at {name}, 20 s"));
        let (scene, body, joint) = scenes::pendulum(1.0, angle);
        let exact = pendulum_period(&scene, body, 0.5, angle.into());
        let swing_energy =
            f64::from(scene.mass_properties(body).expect("living").mass) * G * 0.5 * (1.0 - f64::from(angle).cos());
        // A software GPU takes half a minute for each.
        let sides: &[By] = if name == "level" { BESIDE } else { &By::WITHOUT_GPU };
        for &by in sides {
            let (angles, energies) = swing(&scene, joint, by, params(JOINT_SUBSTEPS), 1200);
            let measured = period(&angles);
            let off = 100.0 * (measured / exact - 1.0).abs();
            held.push(row(&case, by, JOINT_SUBSTEPS, "period, off by", "%", off, Ask::AtMost(0.1)));
            let drift = energies.iter().map(|e| (e - energies[0]).abs()).fold(0.0, f64::max) / swing_energy;
            held.push(row(&case, by, JOINT_SUBSTEPS, "energy, swings by", "%", 100.0 * drift, Ask::AtMost(0.1)));
            let lost = (energies[0] - energies[1200]).abs() / swing_energy;
            held.push(row(
                &case,
                by,
                JOINT_SUBSTEPS,
                "energy, change in the end",
                "%",
                100.0 * lost,
                Ask::AtMost(0.05),
            ));
            if angle < 0.1 {
                let cosine = |step: usize| f64::from(angle) * (TAU / exact * step as f64 / 60.0).cos();
                let errors = angles.iter().enumerate().map(|(step, at)| (at - cosine(step)).abs());
                let worst = 100.0 * errors.fold(0.0, f64::max) / f64::from(angle);
                held.push(row(
                    &case,
                    by,
                    JOINT_SUBSTEPS,
                    "off cos(w t), of the amplitude",
                    "%",
                    worst,
                    Ask::AtMost(1.0),
                ));
            }
        }
    }
    all_held(held);
}

/// The error of the period falls by the square of the sub-step.
#[test]
fn a_pendulums_error_falls_with_time() {
    let case = Case::new("A12", "hinge pendulum let go level, 20 s, error over sub-steps");
    let (scene, body, joint) = scenes::pendulum(1.0, FRAC_PI_2);
    let exact = pendulum_period(&scene, body, 0.5, f64::from(FRAC_PI_2));
    let mut held = Vec::new();
    for &by in jointed::CPU {
        let errors = [1u32, 2, 4, 8].map(|n| {
            let (angles, _) = swing(&scene, joint, by, params(n), 1200);
            let off = 100.0 * (period(&angles) / exact - 1.0).abs();
            held.push(row(&case, by, n, &format!("period, off by, {n} sub-steps"), "%", off, Ask::Said));
            off
        });
        let slope = (errors[2] / errors[0]).log2() / 2.0;
        held.push(row(&case, by, 1, "slope from 1 to 4 sub-steps", "1", slope, Ask::AtMost(-1.5)));
    }
    all_held(held);
}

/// Slow root W of I1 W^2 cos(t) - I3 w W + M g d = 0, I1 about the pivot. At 60 rad/s it turns by a quarter in a sub-step, and
/// nods where it should not: 0.14 rad (rapier 0.48).
#[test]
fn a_heavy_top_goes_round_as_it_should() {
    let case = Case::new("A13", "heavy top, 60 rad/s, 5 s");
    let (arm, lean, spin) = (0.2f64, 0.5f64, 60.0f64);
    let (axial, across) = ((0.4f64 * 0.4 + 0.4 * 0.4) / 12.0, (0.4f64 * 0.4 + 0.1 * 0.1) / 12.0 + arm * arm);
    let (a, b, c) = (across * lean.cos(), axial * spin, G * arm);
    let slow = 2.0 * c / (b + (b * b - 4.0 * a * c).sqrt());
    let (scene, body) = scenes::heavy_top(arm as f32, lean as f32, spin as f32, slow as f32);
    let mut held = Vec::new();
    for &by in BESIDE {
        let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
        let (mut round, mut before, mut leans) = (0.0, 0.0, (lean, lean));
        for step in 0..=300 {
            let axis = world.state().0[body].rotation.as_dquat() * DVec3::Y;
            // About y, from -x: where it leans at the start.
            let at = axis.z.atan2(-axis.x);
            let turn: f64 = at - before;
            round += if step == 0 { 0.0 } else { turn - TAU * (turn / TAU).round() };
            before = at;
            let angle = axis.y.clamp(-1.0, 1.0).acos();
            leans = (leans.0.min(angle), leans.1.max(angle));
            world.steps(1);
        }
        let rate = round.abs() / 5.0;
        held.push(row(&case, by, JOINT_SUBSTEPS, "goes round with", "rad/s", rate, Ask::Near(slow, 0.05 * slow)));
        let nods = leans.1 - leans.0;
        held.push(row(&case, by, JOINT_SUBSTEPS, "nods by", "rad", nods, Ask::AtMost(0.2)));
    }
    all_held(held);
}

/// Freudenstein's equation, at every step of four turns.
#[test]
fn a_four_bar_linkage_obeys_freudenstein() {
    let case = Case::new("A14", "four-bar linkage, crank at 5 rad/s, 5 s");
    let [g, a, b, c] = scenes::FOUR_BAR.map(f64::from);
    let (k1, k2, k3) = (g / a, g / c, (a * a - b * b + c * c + g * g) / (2.0 * a * c));
    let (scene, linkage) = scenes::four_bar(5.0);
    let mut held = Vec::new();
    for &by in BESIDE {
        let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
        let (mut residual, mut apart, mut turned, mut before) = (0.0f64, 0.0f64, 0.0, 0.5 * PI);
        for _ in 0..300 {
            world.steps(1);
            let poses = world.state().0;
            let angle = |body: BodyHandle| {
                let x = poses[body].rotation.as_dquat() * DVec3::X;
                x.y.atan2(x.x)
            };
            let (crank, rocker) = (angle(linkage.crank), angle(linkage.rocker));
            residual = residual.max((k1 * rocker.cos() - k2 * crank.cos() + k3 - (crank - rocker).cos()).abs());
            apart = apart.max(1e3 * joint_error(&scene, &poses).max_m);
            let turn: f64 = crank - before;
            turned += turn - TAU * (turn / TAU).round();
            before = crank;
        }
        held.push(row(
            &case,
            by,
            JOINT_SUBSTEPS,
            "residual of Freudenstein's equation",
            "1",
            residual,
            Ask::AtMost(1e-3),
        ));
        held.push(row(&case, by, JOINT_SUBSTEPS, "separation", "mm", apart, Ask::AtMost(0.1)));
        held.push(row(&case, by, JOINT_SUBSTEPS, "crank turned by", "rad", turned, Ask::Near(25.0, 0.25)));
    }
    all_held(held);
}

/// tan b = tan a cos(bend), and w2 / w1 = cos(bend) / (1 - sin²(bend) sin²(a)), the first axis of the cross being square
/// to the plane of the shafts at a = 0.
#[test]
fn a_universal_joint_turns_as_a_cardan_does() {
    let bend = 0.6f64;
    let case = Case::new("A15", "universal joint bent by 0.6 rad, 4 rad/s, 4 s");
    let shafts = scenes::cardan(bend as f32, 4.0);
    let mut held = Vec::new();
    for &by in BESIDE {
        let mut world = Any::new(by, &shafts.scene, params(JOINT_SUBSTEPS));
        let (mut off, mut ratio_off): (f64, f64) = (0.0, 0.0);
        for _ in 0..240 {
            world.steps(1);
            let (poses, velocities) = world.state();
            let angle = |joint| joint_coordinates(&shafts.scene, &poses, joint).expect("living")[3];
            let (first, second) = (angle(shafts.first_hinge), angle(shafts.second_hinge));
            let exact = (first.sin() * bend.cos()).atan2(first.cos());
            let turn: f64 = second - exact;
            off = off.max((turn - TAU * (turn / TAU).round()).abs());
            let speed = |body: BodyHandle| f64::from(velocities[body].angular.length());
            let ratio = bend.cos() / (1.0 - (bend.sin() * first.sin()).powi(2));
            ratio_off = ratio_off.max((speed(shafts.second) / speed(shafts.first) / ratio - 1.0).abs());
        }
        held.push(row(&case, by, JOINT_SUBSTEPS, "angle of the second shaft, off by", "rad", off, Ask::AtMost(1e-3)));
        held.push(row(&case, by, JOINT_SUBSTEPS, "ratio of speeds, off by", "%", 100.0 * ratio_off, Ask::AtMost(0.5)));
    }
    all_held(held);
}
