//! What moves and holds a single axis: motors, friction, limits, ropes, springs, softness, breaking. A cube of 0.2 m and 2 kg
//! on a joint with what stands still. Oracle: analysis. Each prints its rows; see them all with
//! `cargo test --release --test joints_axes -- --nocapture --test-threads 1`.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/jointed.rs"]
mod jointed;

use beside::Any;
use jointed::{BESIDE, CPU, JOINT_SUBSTEPS, SIDES, all_held, energy, params, row};
use std::f64::consts::TAU;
use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};
use tumble_core::measures::joint_coordinates;
use tumble_core::scenes;

const G: f64 = 9.81;
const MASS: f64 = scenes::CUBE_MASS as f64;

/// The cube at rest where the joint lies, a joint of its own, without gravity.
fn floating(joint: JointBuilder, body: RigidBodyBuilder) -> (Scene, BodyHandle, JointHandle) {
    let (mut scene, body, joint) = scenes::on_joint(joint, body).expect("a joint that is allowed");
    scene.gravity = Vec3::ZERO;
    (scene, body, joint)
}

/// Coordinate of an axis and its rate at each of so many steps, times those at 60 Hz.
fn track(
    scene: &Scene,
    at: (BodyHandle, JointHandle, JointAxis),
    by: By,
    params: Params,
    steps: usize,
) -> Vec<[f64; 2]> {
    let (body, joint, axis) = at;
    let mut world = Any::new(by, scene, params);
    let look = |world: &mut Any| {
        let (poses, velocities) = world.state();
        let v = &velocities[body];
        // These tests' axes are x.
        let rate = if (axis as usize) < 3 { v.linear.x } else { v.angular.x };
        [joint_coordinates(scene, &poses, joint).expect("living")[axis as usize], rate.into()]
    };
    let mut all = vec![look(&mut world)];
    for _ in 0..steps {
        world.steps(1);
        all.push(look(&mut world));
    }
    all
}

/// A slider and a hinge along and about x, and the mass or moment of inertia that they move.
fn axes() -> [(&'static str, JointBuilder, JointAxis, f64); 2] {
    [
        ("slider", JointBuilder::prismatic(Vec3::X), JointAxis::LinX, MASS),
        ("hinge", JointBuilder::revolute(Vec3::X), JointAxis::AngX, scenes::CUBE_INERTIA.into()),
    ]
}

/// v(t) = v_t (1 - exp(-c t)), c the factor, over the mass where it is one of a force; a motor at its largest force F gains
/// F t / m.
#[test]
fn a_velocity_motor_follows_its_step_response() {
    let mut held = Vec::new();
    for (name, joint, axis, mass) in axes() {
        let case = Case::new("A16", &format!("{name}, velocity motor to 3 /s, factor 5 /s"));
        for (model, factor) in [(MotorModel::AccelerationBased, 5.0), (MotorModel::ForceBased, 5.0 * mass)] {
            let motor = joint.clone().motor_velocity(axis, 3.0, factor as f32).motor_model(axis, model);
            let (scene, body, handle) = floating(motor, RigidBodyBuilder::dynamic());
            for &by in BESIDE {
                let rates = track(&scene, (body, handle, axis), by, params(JOINT_SUBSTEPS), 60);
                let exact = |step: usize| 3.0 * (1.0 - (-5.0 * step as f64 / 60.0).exp());
                let off = rates.iter().enumerate().map(|(step, now)| (now[1] - exact(step)).abs()).fold(0.0, f64::max);
                // An implicit damper is late by half of its step, which is half a sub-step: 15 * 5 / 960 / e.
                let quantity = format!("{model:?}: speed, off by, of 3");
                held.push(row(&case, by, JOINT_SUBSTEPS, &quantity, "1/s", off, Ask::AtMost(0.01)));
            }
        }
        let weak = joint.motor_velocity(axis, 3.0, 1e4).motor_max_force(axis, 2.0 * mass as f32);
        let (scene, body, handle) = floating(weak, RigidBodyBuilder::dynamic());
        for &by in BESIDE {
            let rates = track(&scene, (body, handle, axis), by, params(JOINT_SUBSTEPS), 120);
            let (half, end) = (rates[60][1], rates[120][1]);
            held.push(row(&case, by, JOINT_SUBSTEPS, "speed after 1 s at 2 /s²", "1/s", half, Ask::Near(2.0, 0.01)));
            held.push(row(&case, by, JOINT_SUBSTEPS, "and after 2 s", "1/s", end, Ask::Near(3.0, 0.01)));
        }
    }
    all_held(held);
}

/// x'' = -k (x - x0) - c x', from rest at 0: a damped oscillation about x0. Implicit springs lose w² h / 4 a second of their
/// amplitude: the error falls with the sub-step.
#[test]
fn a_position_motor_follows_its_step_response() {
    let mut held = Vec::new();
    let (goal, stiffness, damping) = (0.5f64, 100.0f64, 4.0f64);
    let decay = 0.5 * damping;
    let omega = (stiffness - decay * decay).sqrt();
    let exact = |t: f64| goal * (1.0 - (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin()));
    for (name, joint, axis, mass) in axes() {
        let case = Case::new("A17", &format!("{name}, position motor to 0.5, 100 /s², 4 /s"));
        for (model, scale) in [(MotorModel::AccelerationBased, 1.0), (MotorModel::ForceBased, mass)] {
            let motor = joint
                .clone()
                .motor_position(axis, goal as f32, (scale * stiffness) as f32, (scale * damping) as f32)
                .motor_model(axis, model);
            let (scene, body, handle) = floating(motor, RigidBodyBuilder::dynamic());
            let off = |by: By, params: Params| {
                let all = track(&scene, (body, handle, axis), by, params, 60);
                let errors = all.iter().enumerate().map(|(step, now)| (now[0] - exact(step as f64 / 60.0)).abs());
                errors.fold(0.0, f64::max)
            };
            for &by in BESIDE {
                let quantity = format!("{model:?}: off by, of 0.5");
                held.push(row(
                    &case,
                    by,
                    JOINT_SUBSTEPS,
                    &quantity,
                    "m or rad",
                    off(by, params(JOINT_SUBSTEPS)),
                    Ask::AtMost(0.015),
                ));
            }
            for &by in CPU {
                let fine = off(by, params(32));
                let quantity = format!("{model:?}: off by with 32 sub-steps");
                held.push(row(&case, by, 32, &quantity, "m or rad", fine, Ask::AtMost(0.002)));
            }
        }
    }
    all_held(held);
}

/// x = (g sin(a) - F / m) t² / 2; it stays where F is larger than m g sin(a).
#[test]
fn a_slider_on_a_slope_slides_as_it_should() {
    let case = Case::new("A18", "slider on a slope of 0.5 rad, 2 s");
    let pull = G * 0.5f64.sin();
    let mut held = Vec::new();
    for (name, share) in [("no friction", 0.0), ("half of what holds", 0.5), ("1 % more than holds", 1.01)] {
        let (scene, _, joint) = scenes::slider_on_slope(0.5, (share * MASS * pull) as f32);
        let exact = 0.5 * pull * (1.0 - share).max(0.0) * 4.0;
        for &by in BESIDE {
            let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
            world.steps(120);
            let at = joint_coordinates(&scene, &world.state().0, joint).expect("living");
            let ask = if share > 1.0 { Ask::Near(0.0, 1e-4) } else { Ask::Near(exact, 1e-4 * exact) };
            held.push(row(&case, by, JOINT_SUBSTEPS, &format!("way, {name}"), "m", at[0], ask));
            let aside = at[1].hypot(at[2]);
            held.push(row(
                &case,
                by,
                JOINT_SUBSTEPS,
                &format!("off its line, {name}"),
                "mm",
                1e3 * aside,
                Ask::AtMost(0.01),
            ));
        }
    }
    all_held(held);
}

/// A limit that is hit stops what hits it: no way beyond, no way back, no energy.
#[test]
fn a_limit_that_is_hit_at_speed_holds() {
    let mut held = Vec::new();
    for (name, joint, axis, _) in axes() {
        for (how, speed) in [("10 /s", 10.0f32), ("100 /s", 100.0)] {
            let case = Case::new("A19", &format!("{name}, limit hit at {how}"));
            let (linear, angular) = if axis == JointAxis::LinX { (speed, 0.0) } else { (0.0, speed) };
            let start = RigidBodyBuilder::dynamic().linvel(Vec3::X * linear).angvel(Vec3::X * angular);
            let (scene, body, handle) = floating(joint.clone().limits(axis, [-1.0, 1.0]), start);
            for &by in BESIDE {
                let all = track(&scene, (body, handle, axis), by, params(JOINT_SUBSTEPS), 60);
                let beyond = all.iter().map(|now| now[0].abs() - 1.0).fold(0.0, f64::max);
                held.push(row(&case, by, JOINT_SUBSTEPS, "beyond by", "m or rad", beyond, Ask::AtMost(1e-4)));
                let back = all.iter().map(|now| -now[1]).fold(0.0, f64::max);
                held.push(row(&case, by, JOINT_SUBSTEPS, "comes back with", "1/s", back, Ask::AtMost(0.01)));
                let end = all[60][0];
                held.push(row(&case, by, JOINT_SUBSTEPS, "ends at", "m or rad", end, Ask::Near(1.0, 1e-3)));
            }
        }
    }
    all_held(held);
}

/// Let go 0.5 m below, a cube on a rope of 1 m falls freely until the rope is taut, and then hangs.
#[test]
fn a_rope_is_slack_and_then_taut() {
    let case = Case::new("A20", "cube on a rope of 1 m, let go 0.5 m below");
    let body = RigidBodyBuilder::dynamic().translation(Vec3::Y * -0.5);
    let (scene, body, joint) = scenes::on_joint(JointBuilder::rope(1.0), body).expect("allowed");
    let mut held = Vec::new();
    for &by in BESIDE {
        let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
        world.steps(18);
        let fallen = -0.5 - f64::from(world.state().0[body].translation.y);
        let exact = 0.5 * G * 0.3 * 0.3;
        held.push(row(&case, by, JOINT_SUBSTEPS, "fallen in 0.3 s", "m", fallen, Ask::Near(exact, 1e-3 * exact)));
        let mut longest = 0.0f64;
        for _ in 0..102 {
            world.steps(1);
            longest = longest.max(joint_coordinates(&scene, &world.state().0, joint).expect("living")[0]);
        }
        held.push(row(&case, by, JOINT_SUBSTEPS, "longer than 1 m by", "mm", 1e3 * (longest - 1.0), Ask::AtMost(0.1)));
        let height = f64::from(world.state().0[body].translation.y);
        held.push(row(&case, by, JOINT_SUBSTEPS, "hangs in the end at", "m", height, Ask::Near(-1.0, 1e-4)));
    }
    all_held(held);
}

/// A rope and a rod swing as a pendulum: its energy stays.
#[test]
fn rods_and_ropes_swing_without_loss() {
    let mut held = Vec::new();
    for (name, joint) in [("rope", JointBuilder::rope(1.0)), ("rod", JointBuilder::distance(1.0))] {
        let case = Case::new("A21", &format!("cube on a {name} of 1 m let go level, 5 s"));
        let (scene, ..) = scenes::on_joint(joint, RigidBodyBuilder::dynamic().translation(Vec3::X)).expect("allowed");
        for &by in BESIDE {
            let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
            let total = |world: &mut Any| {
                let (poses, velocities) = world.state();
                energy(&scene, &poses, &velocities).iter().sum::<f64>()
            };
            let (start, mut change) = (total(&mut world), 0.0f64);
            for _ in 0..300 {
                world.steps(1);
                change = change.max((total(&mut world) - start).abs());
            }
            let share = 100.0 * change / (MASS * G);
            held.push(row(&case, by, JOINT_SUBSTEPS, "energy, change at most", "%", share, Ask::AtMost(0.05)));
        }
    }
    all_held(held);
}

/// Period 2 pi sqrt(m / k), and rest at m g / k below its own length.
#[test]
fn a_spring_has_its_period_and_its_rest() {
    let case = Case::new("A22", "cube on a spring of 1 m and 200 N/m");
    let mut held = Vec::new();
    let start = RigidBodyBuilder::dynamic().translation(Vec3::X * 1.2);
    let (scene, body, joint) = floating(JointBuilder::spring(1.0, 200.0, 0.0), start);
    for &by in BESIDE {
        let all = track(&scene, (body, joint, JointAxis::LinX), by, params(JOINT_SUBSTEPS), 150);
        let lengths: Vec<f64> = all.iter().map(|now| now[0] - 1.0).collect();
        let crosses = |(i, w): (usize, &[f64])| (w[0] * w[1] < 0.0).then(|| i as f64 + w[0] / (w[0] - w[1]));
        let zeros: Vec<f64> = lengths.windows(2).enumerate().filter_map(crosses).collect();
        let period = 2.0 * (zeros[zeros.len() - 1] - zeros[0]) / (zeros.len() - 1) as f64 / 60.0;
        let exact = TAU * (MASS / 200.0).sqrt();
        held.push(row(&case, by, JOINT_SUBSTEPS, "period", "s", period, Ask::Near(exact, 5e-3 * exact)));
    }
    let start = RigidBodyBuilder::dynamic().translation(Vec3::Y * -1.0);
    let (scene, _, joint) = scenes::on_joint(JointBuilder::spring(1.0, 200.0, 20.0), start).expect("allowed");
    for &by in BESIDE {
        let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
        world.steps(180);
        let sag = joint_coordinates(&scene, &world.state().0, joint).expect("living")[0] - 1.0;
        let exact = MASS * G / 200.0;
        held.push(row(&case, by, JOINT_SUBSTEPS, "sag", "m", sag, Ask::Near(exact, 1e-3 * exact)));
    }
    all_held(held);
}

/// Sags by m g / k = g / (2 pi f)².
#[test]
fn a_soft_joint_sags_by_its_stiffness() {
    let mut held = Vec::new();
    for (name, joint) in [("fixed", JointBuilder::fixed()), ("ball", JointBuilder::spherical())] {
        let case = Case::new("A23", &format!("cube on a soft {name} joint, 1.5 s"));
        for hertz in [5.0f64, 20.0] {
            let soft = joint.clone().softness(hertz as f32, 1.0);
            let (scene, _, joint) = scenes::on_joint(soft, RigidBodyBuilder::dynamic()).expect("allowed");
            let exact = 1e3 * G / (TAU * hertz).powi(2);
            for &by in BESIDE {
                let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
                world.steps(90);
                let sag = -1e3 * joint_coordinates(&scene, &world.state().0, joint).expect("living")[1];
                let quantity = format!("sag at {hertz} Hz");
                held.push(row(&case, by, JOINT_SUBSTEPS, &quantity, "mm", sag, Ask::Near(exact, 1e-3 * exact)));
            }
        }
    }
    all_held(held);
}

/// A joint breaks when it bears more than it can, and not before: the cube's weight is 19.62 N, and on an arm of 0.5 m its
/// torque 9.81 N m.
#[test]
fn a_joint_breaks_at_its_force_and_torque() {
    let case = Case::new("A24", "cube on a breakable joint, 1 s");
    let mut held = Vec::new();
    let arm = JointBuilder::fixed().local_anchor2(Vec3::X * -0.5);
    let (force, torque) = (MASS * G, MASS * G * 0.5);
    for (name, joint, at) in [("force", JointBuilder::spherical(), 0.0), ("torque", arm, 0.5)] {
        for (share, falls) in [(1.03, false), (0.97, true)] {
            let most = |limit: f64, named: &str| if name == named { (limit * share) as f32 } else { f32::INFINITY };
            let joint = joint.clone().breakable(most(force, "force"), most(torque, "torque"));
            let start = RigidBodyBuilder::dynamic().translation(Vec3::X * at);
            let (scene, body, _) = scenes::on_joint(joint, start).expect("allowed");
            for &by in SIDES {
                let mut world = Any::new(by, &scene, params(JOINT_SUBSTEPS));
                world.steps(60);
                let fallen = -f64::from(world.state().0[body].translation.y);
                // It falls from the end of the first step on.
                let exact = if falls { 0.5 * G * (59.0f64 / 60.0).powi(2) } else { 0.0 };
                let ask = Ask::Near(exact, 0.01 * exact + 1e-4);
                held.push(row(&case, by, JOINT_SUBSTEPS, &format!("fallen, {share} of its {name}"), "m", fallen, ask));
            }
        }
    }
    all_held(held);
}
