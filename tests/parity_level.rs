//! Stage `level` alone: what islands want and what is counted, on the CPU and on the GPU in every order of invocations.
//! Oracle: the mirror; all must agree exactly.

#[path = "common/alone.rs"]
#[expect(dead_code, reason = "this program uses a part")]
mod alone;
mod common;
#[path = "common/frame.rs"]
mod frame;

use alone::Alone;
use bytemuck::Zeroable;
use frame::{Cpu, control_of, scene_of};
use tumble_core::layout::*;
use tumble_core::{JointSet, Scene, scenes};
use tumble_cpu::{island, level};

const PERMUTATIONS: [u32; 3] = [0, 1, 2];

/// Joints between any bodies: some slots are empty, some joints broken, and some have taken no part in a step.
fn joints(bodies: usize) -> (JointSet, Vec<JointState>) {
    let count = if bodies < 2 { 0 } else { bodies + bodies / 3 };
    let of = |i: usize| {
        let (body_a, body_b) = ((i * 5 % bodies) as u32, ((i * 11 + 1) % bodies) as u32);
        let flags = if i % 6 == 3 { 0 } else { joint_bits::ALIVE };
        let joint = Joint { body_a, body_b, flags, generation: i as u32 % 4, ..Joint::zeroed() };
        let tag = if i.is_multiple_of(9) { 0 } else { joint.generation + 1 };
        let separation = [0.0, 3e-6, 2e-4, 4e-5, 1e-6][i * 17 % 5];
        (joint, JointState { tag, broken: u32::from(i % 7 == 2), separation, ..JointState::zeroed() })
    };
    let (joints, states) = (0..count).map(of).unzip();
    (JointSet { joints, ..JointSet::default() }, states)
}

/// Bodies that want one thing and another, over contacts some of which overlap by too much, and with joints
/// some of which are too far apart.
fn check(what: &str, scene: &Scene, levels: u32, tolerance: f32, alone: &mut Alone) {
    let cpu = Cpu::after(scene, 40);
    let frame = cpu.plan(false);
    let (mut states, mut manifolds) = (frame.states.clone(), frame.manifolds.clone());
    for (i, state) in states.iter_mut().enumerate() {
        state.credit = [0, 0, 0, 5, 17, 33, 0, 63][i * 7 % 8];
    }
    let mut props = cpu.props.clone();
    for (i, props) in props.iter_mut().enumerate() {
        props.least_level = [0, 0, 0, 2, 0, 0, 0, 0, 0, 1, 0][i * 5 % 11];
    }
    for (i, manifold) in manifolds.iter_mut().enumerate() {
        let apart = [1e-3, -1e-6, -2e-4, 5e-3, -3e-3][i * 13 % 5];
        manifold.points.iter_mut().for_each(|point| point.separation = apart);
    }
    // A tenth of a millimetre between joints, and a millimetre of overlap.
    let step = StepParams { tolerance, joint_scale: 10.0, levels, substeps: 4, ..frame.step };
    let (set, kept) = joints(states.len());
    let labels = island::label(&states, &manifolds, &frame.ends, &[]);
    let mut control = control_of(&frame, false);

    alone.put("step", &[step]);
    alone.put("counters", &[control]);
    alone.put("work_states", &states);
    alone.put("props", &props);
    alone.put("next_pairs", &frame.matched.pairs);
    alone.put("manifolds", &manifolds);
    alone.put("aabbs", &frame.aabbs);
    alone.put("islands", &labels);
    alone.put("joints", &set.joints);
    alone.put("joint_states", &kept);
    alone.put("island_credits", &vec![77u32; states.len()]);
    alone.put("island_leasts", &vec![77u32; states.len()]);
    alone.put("island_overlaps", &vec![77u32; states.len()]);
    let groups = |count: usize| (count as u32).div_ceil(256) + 1;
    let (by_pair, by_body, by_joint) = (groups(manifolds.len()), groups(states.len()), groups(kept.len()));
    alone.run(|chain| {
        chain.pass("level", "begin", by_body);
        chain.pass("level", "ask", by_body);
        chain.pass("level", "measure", by_pair);
        chain.pass("level", "measure_joints", by_joint);
        chain.pass("level", "decide", by_body);
        chain.pass("level", "spend", by_pair);
        chain.pass("level", "spend_joints", by_joint);
    });

    let touching = level::Touching { manifolds: &manifolds, ends: &frame.ends };
    let held = level::Held { joints: &set, states: &kept };
    level::decide(&mut states, &props, &labels, &touching, &held, &step, &mut control);
    let gpu: Vec<BodyState> = alone.take("work_states");
    assert!(gpu.iter().map(|s| s.credit).eq(states.iter().map(|s| s.credit)), "{what}: credits");
    assert!(gpu == states, "{what}: nothing but credits changes");
    assert_eq!(alone.take::<Control>("counters")[0], control, "{what}: counters");
}

#[test]
fn islands_get_what_the_mirrors_get() {
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for bodies in [0, 1, 2, 255, 256, 257, 3000] {
            check(&format!("{bodies} bodies, order {permute}"), &scene_of(bodies), 0b0101, 1e-3, &mut alone);
            check(
                &format!("{bodies} bodies, no tolerance, order {permute}"),
                &scene_of(bodies),
                0b0101,
                -1.0,
                &mut alone,
            );
        }
        for levels in [0b0001, 0b1000, 0b1111] {
            let what = format!("pyramids, levels {levels:b}, order {permute}");
            check(&what, &scenes::many_pyramids(9, 5), levels, 1e-3, &mut alone);
        }
    }
}

/// The law of one island. Oracle: what it is told to do.
#[test]
fn credit_rises_at_once_and_falls_when_calm() {
    let tolerance = 1e-3;
    let next = |credit, overlap| level::next_credit(credit, overlap, tolerance);
    assert_eq!(next(0, 2e-3), 31, "up a level, with all calm steps to go");
    assert_eq!(next(16, 2e-3), 47, "and again, however many were left");
    assert_eq!(next(31, 2e-3), 47);
    assert_eq!(next(50, 2e-3), 63, "no higher than the highest");
    assert_eq!(next(63, 2e-3), 63);
    assert_eq!(next(40, 5e-4), 40, "neither calm nor over");
    assert_eq!(next(40, 1e-4), 39, "calm");
    assert_eq!(next(0, 1e-4), 0);
    assert_eq!(next(63, 0.0), 0, "no contact");
    assert_eq!(level::next_credit(40, 2e-3, -1.0), 0, "no tolerance");
}

/// Oracle: the law in words.
#[test]
fn a_level_that_does_not_run_is_rounded_up() {
    let used = |levels, wanted: u32| {
        let step =
            StepParams { levels, ..tumble_core::Params::default().step_params(1, tumble_core::glam::Vec3::ZERO) };
        step.level_of(wanted * LEVEL_HOLD + 3)
    };
    assert_eq!([0, 1, 2, 3].map(|wanted| used(0b1111, wanted)), [0, 1, 2, 3]);
    assert_eq!([0, 1, 2, 3].map(|wanted| used(0b0101, wanted)), [0, 2, 2, 2], "up, else the highest there is");
    assert_eq!([0, 1, 2, 3].map(|wanted| used(0b1000, wanted)), [3, 3, 3, 3]);
    assert_eq!([0, 1, 2, 3].map(|wanted| used(0b0001, wanted)), [0, 0, 0, 0]);
}
