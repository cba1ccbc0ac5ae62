//! Stages `edit` and `bounds`, each pass alone: the GPU computes what the CPU does, in every order
//! of invocations. Oracle: the mirror, which makes the inputs too.
//!
//! Tolerances are shares of the largest number of a field in one element, or of 1; beside each is the largest error
//! that was measured (llvmpipe).

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/alone.rs"]
mod alone;
mod common;
#[expect(dead_code, reason = "only what bounds leaves is looked at")]
#[path = "common/crowds.rs"]
mod crowds;
#[path = "common/floats.rs"]
mod floats;
#[expect(dead_code, reason = "a part of a frame is enough here")]
#[path = "common/frame.rs"]
mod frame;
#[path = "common/random.rs"]
mod random;

use alone::Alone;
use bytemuck::Zeroable;
use crowds::counted;
use floats::Floats;
use frame::scene_of;
use random::{Crowd, Random, step_of};
use tumble_core::edit::EditBatch;
use tumble_core::layout::*;
use tumble_core::{ColliderBuilder, Editor, JointSolver, PackedScene, Pose, RigidBodyBuilder};
use tumble_cpu::bounds::{self, FAR, STATE_LIMIT, size_class};
use tumble_cpu::broadphase::{Boxes, CLASSES};
use tumble_cpu::edit;

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
const SIZES: [usize; 7] = [0, 1, 2, 255, 256, 257, 3000];
const GARBAGE: u32 = 0xdead_beef;
/// First of the words of `Control` that begin as the highest number.
const CENTER_MIN: usize = 24;

const EDITED: [(&str, f32); 6] = [
    ("edited position", 1e-6),         // 9.5e-8
    ("edited rotation", 1e-6),         // 1.2e-7
    ("edited linear velocity", 5e-6),  // 1.4e-6
    ("edited angular velocity", 1e-6), // 1.9e-7
    ("edited force", 1e-6),            // 0
    ("edited torque", 1e-6),           // 1.7e-7
];
const BOX: (&str, f32) = ("box", 1e-6); // 2.2e-7

fn control_words(alone: &Alone) -> Vec<u32> {
    alone.take("counters")
}

fn groups(count: usize) -> u32 {
    (count as u32).div_ceil(256) + 1
}

#[test]
fn begin_copies_states_and_clears_counters() {
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for bodies in SIZES {
            let mut crowd = Crowd::new(bodies, 1);
            crowd.states.iter_mut().step_by(3).for_each(|state| state.flags |= body_flags::POSED);
            alone.put("step", &[crowd.step]);
            alone.put("states", &crowd.states);
            alone.put("work_states", &vec![[GARBAGE; 24]; bodies]);
            alone.put("masks", &vec![GARBAGE; 2 * bodies]);
            alone.put("claims", &vec![GARBAGE; bodies]);
            alone.put("class_histogram", &[GARBAGE; CLASSES]);
            alone.put("counters", &[GARBAGE; size_of::<Control>() / 4]);
            alone.run(|chain| chain.pass("edit", "begin", (bodies.max(CLASSES) as u32).div_ceil(256)));
            let begun: Vec<BodyState> = crowd.states.iter().map(edit::begin).collect();
            assert!(alone.take::<BodyState>("work_states") == begun, "{bodies} bodies");
            assert!(alone.take::<u32>("masks").iter().all(|&word| word == 0));
            assert!(alone.take::<u32>("claims").iter().all(|&claim| claim == u32::MAX));
            assert!(alone.take::<u32>("class_histogram").iter().all(|&count| count == 0));
            for (word, value) in control_words(&alone).into_iter().enumerate() {
                let expected = match word {
                    0..8 => GARBAGE,
                    24..27 => u32::MAX,
                    _ => 0,
                };
                assert_eq!(value, expected, "word {word}");
            }
        }
    }
}

/// One step's edits of a scene: every kind, some bodies with several, some with numbers that are none.
fn edits_of(bodies: usize, seed: u64) -> (PackedScene, EditBatch, Editor) {
    let mut random = Random::new(seed);
    let (mut editor, mut packed) = Editor::new(scene_of(bodies)).unwrap();
    packed.props.iter_mut().enumerate().step_by(2).for_each(|(i, props)| props.locked = i as u32 / 15 % 64);
    let handles: Vec<_> = editor.scene().bodies().collect();
    for (i, &body) in handles.iter().enumerate() {
        let (a, b, q) = (random.vector(9.0), random.vector(9.0), random.rotation());
        match i % 15 {
            0 => editor.remove(body),
            1 => editor.set_pose(body, Pose { translation: a, rotation: q }),
            2 => editor.set_velocity(body, a, b),
            3 => editor.apply_impulse(body, a),
            4 => editor.apply_torque_impulse(body, a),
            5 => editor.apply_impulse_at_point(body, a, b),
            6 => editor.add_force(body, a),
            7 => editor.add_torque(body, a),
            8 => editor.add_force_at_point(body, a, b),
            9 => editor.freeze(body),
            10 => editor.poison(body, a.with_y(f32::NAN), b.with_x(f32::INFINITY)),
            11 => editor.attach(body, ColliderBuilder::cuboid(0.2, 0.5, 0.3).translation(0.1 * a)).map(drop),
            12 => (editor.set_pose(body, Pose { translation: a, rotation: q }))
                .and_then(|()| editor.set_velocity(body, b, a))
                .and_then(|()| editor.attach(body, ColliderBuilder::ball(0.4).translation(0.1 * b)).map(drop))
                .and_then(|()| editor.apply_impulse_at_point(body, b, a))
                .and_then(|()| editor.add_force_at_point(body, a, b))
                .and_then(|()| editor.add_force_at_point(body, b, a)),
            _ => Ok(()),
        }
        .unwrap();
    }
    for i in 0..bodies / 10 {
        let body = RigidBodyBuilder::dynamic().translation(random.vector(9.0)).rotation(random.rotation());
        let offset = random.vector(0.3);
        let shape = if i % 2 == 0 { ColliderBuilder::ball(0.3) } else { ColliderBuilder::cuboid(0.2, 0.3, 0.4) };
        editor.insert(body.linvel(offset), shape.translation(offset)).unwrap();
    }
    let mut batch = editor.take(JointSolver::default());
    for record in batch.records.iter_mut().filter(|r| r.op == edit_op::POSE).skip(1).step_by(5) {
        record.op = edit_op::NEXT_POSE;
    }
    for record in batch.records.iter_mut().filter(|r| r.op == edit_op::POSE).step_by(5) {
        record.data[1][2] = f32::NAN.to_bits();
    }
    (packed, batch, editor)
}

#[test]
fn edits_change_the_same_things() {
    let mut floats = Floats::default();
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for bodies in SIZES {
            let (packed, batch, editor) = edits_of(bodies, 3);
            let mut step = step_of(bodies as u32);
            step.body_count = editor.body_slots() as u32;
            step.collider_count = editor.collider_slots() as u32;
            step.edit_ranges = batch.ranges.len() as u32;
            let (mut states, mut props, mut colliders) = (packed.states, packed.props, packed.colliders);
            states.resize(editor.body_slots(), BodyState::zeroed());
            props.resize(editor.body_slots(), BodyProps::zeroed());
            colliders.resize(editor.collider_slots(), Collider::zeroed());
            for stop in [1, 0] {
                alone.put("step", &[step]);
                alone.put("counters", &[Control { stop, ..Control::zeroed() }]);
                alone.put("edit_records", &batch.records);
                alone.put("edit_ranges", &batch.ranges);
                alone.put("work_states", &states);
                alone.put("props", &props);
                alone.put("colliders", &colliders);
                alone.run(|chain| chain.pass("edit", "apply", groups(batch.ranges.len())));
                if stop == 0 {
                    let targets =
                        &mut edit::Targets { states: &mut states, props: &mut props, colliders: &mut colliders };
                    batch.ranges.iter().for_each(|range| edit::apply(*range, &batch.records, &step, targets));
                }
                assert!(alone.take::<BodyProps>("props") == props, "{bodies} bodies, stop {stop}");
                assert!(alone.take::<Collider>("colliders") == colliders, "{bodies} bodies, stop {stop}");
                let gpu = alone.take::<BodyState>("work_states");
                let whole = |s: &BodyState| (s.flags, s.generation);
                assert!(gpu.iter().map(whole).eq(states.iter().map(whole)), "{bodies} bodies, stop {stop}");
                let (what, both) = (format!("{bodies} bodies, stop {stop}"), (&states[..], &gpu[..]));
                floats.check(&what, EDITED[0], both, |s| s.position);
                floats.check(&what, EDITED[1], both, |s| s.rotation);
                floats.check(&what, EDITED[2], both, |s| s.linear_velocity);
                floats.check(&what, EDITED[3], both, |s| s.angular_velocity);
                floats.check(&what, EDITED[4], both, |s| s.force);
                floats.check(&what, EDITED[5], both, |s| s.torque);
            }
        }
    }
    print!("{floats}");
}

#[test]
fn quarantine_takes_the_same_bodies() {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.1 * STATE_LIMIT, -1.1 * STATE_LIMIT, STATE_LIMIT];
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        // Small ones too, since the names of large ones hide each other.
        for (seed, bodies) in SIZES.into_iter().chain([8; 40]).enumerate() {
            let mut random = Random::new(seed as u64);
            let crowd = Crowd::new(bodies, 100 + seed as u64);
            let mut states = crowd.states.clone();
            for state in &mut states {
                let value = bad[random.below(6) as usize];
                let axis = random.below(3) as usize;
                match random.below(10) {
                    1 => state.position[axis] = value,
                    2 => state.rotation[axis + 1] = value,
                    3 => state.linear_velocity[axis] = value,
                    4 => state.angular_velocity[axis] = value,
                    5 => state.force[axis] = value,
                    6 => state.torque[axis] = value,
                    7 => state.flags |= body_flags::FROZEN,
                    8 => state.generation += 1, // another body in the slot of one that may be frozen
                    _ => {}
                }
            }
            alone.put("step", &[crowd.step]);
            alone.put("counters", &[Control::zeroed()]);
            alone.put("states", &crowd.states);
            alone.put("work_states", &states);
            alone.run(|chain| chain.pass("bounds", "quarantine", groups(bodies)));
            let mut names = [0; QUARANTINE_NAMES];
            for (i, (state, last)) in states.iter_mut().zip(&crowd.states).enumerate() {
                if bounds::quarantine(state, last) {
                    names[i % QUARANTINE_NAMES] = i as u32 + 1;
                }
            }
            let bits = |states: &[BodyState]| bytemuck::cast_slice::<_, u32>(states).to_vec();
            assert!(bits(&alone.take("work_states")) == bits(&states), "{bodies} bodies");
            assert_eq!(alone.take::<Control>("counters")[0].quarantined, names, "{bodies} bodies");
        }
    }
}

#[test]
fn boxes_are_the_same_and_counted() {
    let mut floats = Floats::default();
    let (mut other_class, mut all) = (0, 0);
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for bodies in SIZES {
            let crowd = Crowd::new(bodies, 6);
            let mut control = [0; size_of::<Control>() / 4];
            control[CENTER_MIN..CENTER_MIN + 3].fill(u32::MAX);
            alone.put("step", &[crowd.step]);
            alone.put("counters", &control);
            alone.put("class_histogram", &[0u32; CLASSES]);
            alone.put("work_states", &crowd.states);
            alone.put("props", &crowd.props);
            alone.put("colliders", &crowd.colliders);
            alone.put("aabbs", &vec![[GARBAGE; 8]; bodies]);
            alone.put("large_list", &vec![GARBAGE; bodies]);
            alone.run(|chain| chain.pass("bounds", "collider_bounds", groups(bodies)));
            let cpu = crowd.boxes();
            let gpu: Vec<Aabb> = alone.take("aabbs");
            for (i, (cpu, gpu)) in cpu.iter().zip(&gpu).enumerate() {
                let what = format!("{bodies} bodies, collider {i}");
                assert_eq!(cpu.body, gpu.body, "{what}");
                let far = |aabb: &Aabb| [aabb.min, aabb.max].map(|corner| corner.map(|x| x.abs() == FAR));
                assert_eq!(far(cpu), far(gpu), "{what}");
                let longest = (0..3).map(|i| gpu.max[i] - gpu.min[i]).fold(0.0, f32::max);
                if far(cpu) == [[false; 3]; 2] {
                    assert_eq!(gpu.class, size_class(longest), "{what}");
                    other_class += usize::from(cpu.class != gpu.class);
                    all += 1;
                } else {
                    assert_eq!(gpu.class, cpu.class, "{what}");
                }
            }
            let near = |corner: [f32; 3]| corner.map(|x| if x.abs() == FAR { 0.0 } else { x });
            let what = format!("{bodies} bodies");
            floats.check(&what, BOX, (&cpu, &gpu), |aabb| near(aabb.min));
            floats.check(&what, BOX, (&cpu, &gpu), |aabb| near(aabb.max));
            let boxes = Boxes::new(&gpu);
            assert_eq!(alone.take::<u32>("class_histogram"), boxes.classes, "{what}");
            let control = alone.take::<Control>("counters")[0];
            let expected = counted(&boxes, &Control::zeroed());
            assert_eq!(control.center_min, expected.center_min, "{what}");
            assert_eq!(control.center_max, expected.center_max, "{what}");
            let mut list: Vec<u32> = alone.take("large_list");
            list.truncate(control.large_count as usize);
            list.sort_unstable();
            assert_eq!(list, boxes.unbounded, "{what}");
        }
    }
    print!("{floats}");
    println!("{other_class} of {all} boxes have another size class");
    assert!(100 * other_class <= all);
}
