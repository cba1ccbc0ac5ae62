//! Stage `motion`, each pass alone: the GPU computes what the CPU does, in every order of invocations. Oracle: the
//! mirror, which makes the inputs too.
//!
//! Tolerances are shares of the largest number of a field in its element, or of 1.

#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/floats.rs"]
mod floats;
#[expect(dead_code, reason = "a part of a frame is enough here")]
#[path = "common/frame.rs"]
mod frame;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/stage.rs"]
mod stage;

use alone::Alone;
use floats::Floats;
use stage::{PERMUTATIONS, Stage, still};
use tumble_core::layout::*;
use tumble_cpu::motion;

/// First word of the names of bodies in quarantine, and the scratch word of their count.
const QUARANTINED: usize = 100;
const FROZEN_COUNT: usize = 108;

/// What each field may be off: (name, tolerance), with the largest error that was measured on llvmpipe beside it.
mod off {
    type Field = (&'static str, f32);
    pub(crate) const VELOCITY: Field = ("velocity", 1e-6); // 0
    pub(crate) const WAY: Field = ("translation", 1e-6); // 0
    pub(crate) const TURN: Field = ("turn", 1e-5); // 1.2e-6
    pub(crate) const TURNED: Field = ("turned velocity", 1e-5); // 8.9e-7
    pub(crate) const EIGENVALUE: Field = ("eigenvalue", 1e-4);
    pub(crate) const SHARE: Field = ("share", 1e-5);
    pub(crate) const ROTATION: Field = ("rotation", 1e-6); // 1.2e-7
    pub(crate) const POSE: Field = ("pose", 1e-6); // 1.2e-7
}

/// The passes of one pass, and what they do on the CPU.
type BodyPass = fn(&mut SolverBody, &BodyState, &BodyProps, &StepParams);
const ONE_PASS: [(&str, BodyPass); 3] = [
    ("first_substep", motion::first_substep),
    ("next_substep", motion::next_substep),
    ("last_substep", motion::last_substep),
];

#[test]
fn bodies_are_integrated_alike() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut floats = Floats::default();
    for (what, mut stage) in Stage::all() {
        stage.advance();
        let calm = stage.bodies.clone();
        // Turns of some radians a sub-step, of too many, and of no number at all.
        for (i, body) in stage.bodies.iter_mut().enumerate() {
            match i % 32 {
                3 => body.angular_velocity = [900.0, 1.0, -700.0],
                10 => body.angular_velocity = [3e4, 2e5, 1e3],
                17 => body.angular_velocity = [f32::NAN, 0.0, 1.0],
                24 => body.linear_velocity = [0.0, f32::INFINITY, 0.0],
                _ => {}
            }
        }
        for (permute, alone) in alones.iter_mut().enumerate() {
            let what = format!("{what}, permuted {permute}");
            let (cpu, frame) = (&stage.cpu, &stage.frame);
            stage.put(alone, 8);
            let mut bodies = stage.bodies.clone();
            for (i, body) in bodies.iter_mut().enumerate() {
                motion::integrate_velocity(body, &frame.states[i], &cpu.props[i], &frame.step);
            }
            alone.run(|chain| chain.pass("motion", "integrate_velocities", stage.by_body()));
            let gpu: Vec<SolverBody> = alone.take("solver_bodies");
            floats.check(&what, off::VELOCITY, (&bodies, &gpu), |b| b.linear_velocity);
            floats.check(&what, off::VELOCITY, (&bodies, &gpu), |b| b.angular_velocity);
            assert!(gpu.iter().map(still).eq(stage.bodies.iter().map(still)), "{what}");

            alone.put("solver_bodies", &bodies);
            for (i, body) in bodies.iter_mut().enumerate() {
                motion::integrate_position(body, &frame.states[i], &cpu.props[i], &frame.step);
            }
            alone.run(|chain| chain.pass("motion", "integrate_positions", stage.by_body()));
            let gpu: Vec<SolverBody> = alone.take("solver_bodies");
            floats.check(&what, off::WAY, (&bodies, &gpu), |b| b.translation);
            floats.check(&what, off::TURN, (&bodies, &gpu), |b| b.delta);
            floats.check(&what, off::TURNED, (&bodies, &gpu), |b| b.angular_velocity);

            for (entry, pass) in ONE_PASS {
                let mut bodies = calm.clone();
                alone.put("solver_bodies", &bodies);
                for (i, body) in bodies.iter_mut().enumerate() {
                    pass(body, &frame.states[i], &cpu.props[i], &frame.step);
                }
                alone.run(|chain| chain.pass("motion", entry, stage.by_body()));
                let gpu: Vec<SolverBody> = alone.take("solver_bodies");
                let what = format!("{what}, {entry}");
                floats.check(&what, off::VELOCITY, (&bodies, &gpu), |b| b.linear_velocity);
                floats.check(&what, off::TURNED, (&bodies, &gpu), |b| b.angular_velocity);
                floats.check(&what, off::VELOCITY, (&bodies, &gpu), |b| b.linear_start);
                floats.check(&what, off::TURNED, (&bodies, &gpu), |b| b.angular_start);
                floats.check(&what, off::WAY, (&bodies, &gpu), |b| b.translation);
                floats.check(&what, off::TURN, (&bodies, &gpu), |b| b.delta);
                floats.check(&what, off::EIGENVALUE, (&bodies, &gpu), |b| [b.eigenvalue]);
            }
        }
    }
    eprintln!("motion\n{floats}");
}

#[test]
fn the_result_becomes_the_state() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut floats = Floats::default();
    for (what, mut stage) in Stage::all() {
        stage.advance();
        for (i, body) in stage.bodies.iter_mut().enumerate() {
            match i % 64 {
                9 => body.angular_velocity[1] = f32::NAN,
                23 => body.translation[0] = f32::NEG_INFINITY,
                37 => body.delta[3] = f32::NAN,
                51 => body.linear_velocity[2] = 2e9,
                _ => {}
            }
        }
        for (permute, alone) in alones.iter_mut().enumerate() {
            let what = format!("{what}, permuted {permute}");
            stage.put(alone, 8);
            let shares: Vec<f32> = (0..stage.bodies.len()).map(|i| if i % 5 == 2 { 0.25 } else { 1.0 }).collect();
            alone.put("shares", &shares);
            let groups = stage.by_body();
            alone.run(|chain| {
                chain.pass("motion", "commit", groups);
                chain.pass("motion", "write_poses", groups);
            });
            let gpu: Vec<BodyState> = alone.take("states");
            let mut counters: Vec<u32> = bytemuck::cast_slice(&[stage.control]).to_vec();
            let mut states = Vec::new();
            for (i, (body, state)) in stage.bodies.iter().zip(&stage.frame.states).enumerate() {
                let (state, bad) = motion::commit(body, state, shares[i], &stage.frame.step);
                let frozen = state.flags & body_flags::FROZEN != 0 && state.flags & body_flags::KIND != 0;
                counters[FROZEN_COUNT] += u32::from(frozen);
                if bad {
                    let name = &mut counters[QUARANTINED + i % QUARANTINE_NAMES];
                    *name = (*name).max(i as u32 + 1);
                }
                states.push(state);
            }
            assert_eq!(alone.take::<u32>("counters"), counters, "{what}");
            assert_eq!(counters[QUARANTINED..FROZEN_COUNT].iter().any(|name| *name != 0), states.len() > 60, "{what}");
            let plain = |s: &BodyState| BodyState { rotation: [0.0; 4], ..*s };
            assert!(gpu.iter().map(plain).eq(states.iter().map(plain)), "{what}: states");
            floats.check(&what, off::ROTATION, (&states, &gpu), |s| s.rotation);

            let poses: Vec<_> = gpu.iter().zip(&stage.cpu.props).map(|(s, p)| PoseRecord::of(s, p)).collect();
            let gpu: Vec<PoseRecord> = alone.take("poses");
            assert!(gpu.iter().map(|p| p.tag).eq(poses.iter().map(|p| p.tag)), "{what}: tags");
            floats.check(&what, off::POSE, (&poses, &gpu), |p| p.translation);
            floats.check(&what, off::POSE, (&poses, &gpu), |p| p.rotation);
        }
    }
    eprintln!("commit\n{floats}");
}

/// Which ways are cut short, and where. Oracle: the mirror.
#[test]
fn ways_are_cut_short_alike() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut floats = Floats::default();
    let mut cut = 0;
    for (what, mut stage) in Stage::all() {
        stage.advance();
        // So far that many come to a wall.
        for (i, body) in stage.bodies.iter_mut().enumerate() {
            let far = [0.0, 0.3, 2.0, 40.0, f32::NAN, f32::INFINITY][i % 6];
            body.translation = [far, -1.3 * far, 0.4 * far * if i % 2 == 0 { 1.0 } else { -1.0 }];
        }
        let shares = stage.cpu.shares(&stage.frame, &stage.bodies);
        cut += shares.iter().filter(|share| **share < 1.0).count();
        for (permute, alone) in alones.iter_mut().enumerate() {
            stage.put(alone, 8);
            alone.put("shares", &vec![1f32; shares.len()]);
            alone.run(|chain| chain.pass("continuous", "shorten", stage.control.pair_count.div_ceil(256) + 1));
            let gpu: Vec<f32> = alone.take("shares");
            floats.check(&format!("{what}, permuted {permute}"), off::SHARE, (&shares, &gpu), |share| [*share]);
        }
    }
    eprintln!("continuous\n{floats}");
    assert!(cut > 100, "{cut}");
}
