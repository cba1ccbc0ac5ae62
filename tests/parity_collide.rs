//! Stages `edit`, `bounds` and `broadphase/grid`, each pass alone: the GPU computes what the CPU does, in every order
//! of invocations. Oracle: the mirror, which makes the inputs too.
//!
//! Tolerances are shares of the largest number of a field in one element, or of 1; beside each is the largest error
//! that was measured (llvmpipe).

#[allow(dead_code, reason = "some passes want an index")]
#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/crowds.rs"]
mod crowds;
#[path = "common/floats.rs"]
mod floats;
#[path = "common/frame.rs"]
mod frame;
#[path = "common/random.rs"]
mod random;

use alone::Alone;
use bytemuck::Zeroable;
use crowds::{SIZES, boxed, crowds};
use floats::Floats;
use frame::scene_of;
use random::{Crowd, Random, step_of};
use tumble_core::edit::EditBatch;
use tumble_core::glam::Vec3;
use tumble_core::layout::*;
use tumble_core::{ColliderBuilder, Editor, PackedScene, Pose, RigidBodyBuilder, limits};
use tumble_cpu::bounds::{self, FAR, STATE_LIMIT, size_class};
use tumble_cpu::broadphase::grid::{self, CLASSES};
use tumble_cpu::edit;
use tumble_gpu::primitives::{Count, Scan, ScanOptions, Sort, SortOptions};

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
const GARBAGE: u32 = 0xdead_beef;
/// Words of `Control`.
const PAIR_COUNT: u32 = 8;
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
            let crowd = Crowd::new(bodies, 1);
            alone.put("step", &[crowd.step]);
            alone.put("states", &crowd.states);
            alone.put("work_states", &vec![[GARBAGE; 24]; bodies]);
            alone.put("masks", &vec![GARBAGE; 2 * bodies]);
            alone.put("claims", &vec![GARBAGE; bodies]);
            alone.put("class_histogram", &[GARBAGE; CLASSES]);
            alone.put("counters", &[GARBAGE; 112]);
            alone.run(|chain| chain.pass("edit", "begin", (bodies.max(CLASSES) as u32).div_ceil(256)));
            assert!(alone.take::<BodyState>("work_states") == crowd.states, "{bodies} bodies");
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
    let (mut editor, packed) = Editor::new(scene_of(bodies)).unwrap();
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
    let mut batch = editor.take();
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
                    batch.ranges.iter().for_each(|range| edit::apply(*range, &batch.records, step.step, targets));
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

fn to_ordered(x: f32) -> u32 {
    if x.to_bits() >> 31 == 0 { x.to_bits() | 1 << 31 } else { !x.to_bits() }
}

/// What `bounds` leaves for the grid: how many boxes of each class, and the range of their middles.
fn counted(aabbs: &[Aabb]) -> (Vec<u32>, [u32; 3], [u32; 3]) {
    let (mut histogram, mut low, mut high) = (vec![0; CLASSES], [u32::MAX; 3], [0; 3]);
    for aabb in aabbs.iter().filter(|a| a.body & aabb_body::LIVE != 0 && a.class < size_class(FAR)) {
        histogram[aabb.class as usize] += 1;
        for i in 0..3 {
            let middle = to_ordered(0.5 * (aabb.min[i] + aabb.max[i]));
            (low[i], high[i]) = (low[i].min(middle), high[i].max(middle));
        }
    }
    (histogram, low, high)
}

#[test]
fn boxes_are_the_same_and_counted() {
    let mut floats = Floats::default();
    let (mut other_class, mut all) = (0, 0);
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for bodies in SIZES {
            let crowd = Crowd::new(bodies, 6);
            let mut control = [0; 112];
            control[CENTER_MIN..CENTER_MIN + 3].fill(u32::MAX);
            alone.put("step", &[crowd.step]);
            alone.put("counters", &control);
            alone.put("class_histogram", &[0u32; CLASSES]);
            alone.put("work_states", &crowd.states);
            alone.put("props", &crowd.props);
            alone.put("colliders", &crowd.colliders);
            alone.put("aabbs", &vec![[GARBAGE; 8]; bodies]);
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
            let (histogram, low, high) = counted(&gpu);
            assert_eq!(alone.take::<u32>("class_histogram"), histogram, "{what}");
            let control = alone.take::<Control>("counters")[0];
            assert_eq!((control.center_min, control.center_max), (low, high), "{what}");
        }
    }
    print!("{floats}");
    println!("{other_class} of {all} boxes have another size class");
    assert!(100 * other_class <= all);
}

/// Fills in what the grid's passes bind, and makes the scans and the sort between them.
fn prepare(alone: &mut Alone, aabbs: &[Aabb], step: &StepParams, control: &Control) -> (Scan, Scan, Sort) {
    let cells = (1 << step.cell_table_bits) + 1;
    let (histogram, center_min, center_max) = counted(aabbs);
    alone.put("step", &[*step]);
    alone.put("counters", &[Control { center_min, center_max, ..*control }]);
    alone.put("class_histogram", &histogram);
    alone.put("aabbs", aabbs);
    alone.put("cell_start", &vec![GARBAGE; cells]);
    alone.put("cell_cursor", &vec![GARBAGE; cells]);
    for name in ["cell_entries", "large_list", "partner_offset"] {
        alone.put(name, &vec![GARBAGE; aabbs.len()]);
    }
    alone.put("pair_keys", &vec![[GARBAGE; 2]; step.pair_capacity as usize]);
    alone.put("pair_values", &vec![GARBAGE; step.pair_capacity as usize]);
    let gpu = common::gpu();
    let host = |count: u32, total| ScanOptions { capacity: count, count: Count::Host(count), total };
    let by_pair = SortOptions { capacity: step.pair_capacity, count: Count::Word(PAIR_COUNT), bits: vec![32; 2] };
    (
        Scan::new(gpu, &mut alone.pipelines, host(cells as u32, None)).unwrap(),
        Scan::new(gpu, &mut alone.pipelines, host(aabbs.len() as u32, Some(PAIR_COUNT))).unwrap(),
        Sort::new(gpu, &mut alone.pipelines, by_pair).unwrap(),
    )
}

/// All passes of the grid, one after the other.
fn run_grid(alone: &mut Alone, aabbs: &[Aabb], step: &StepParams, control: &Control) -> Control {
    let (scan_cells, scan_pairs, sort) = prepare(alone, aabbs, step, control);
    let buffer = |name: &str| alone.buffers.buffer(name).unwrap().clone();
    let [start, offset, keys, values, counters] =
        ["cell_start", "partner_offset", "pair_keys", "pair_values", "counters"].map(buffer);
    let by_collider = groups(aabbs.len());
    alone.run(|chain| {
        let stem = "broadphase/grid";
        chain.pass(stem, "choose", 1);
        chain.pass(stem, "clear", groups((1 << step.cell_table_bits) + 1));
        chain.pass(stem, "count", by_collider);
        scan_cells.record(&mut chain.recorder, &start, None).unwrap();
        chain.pass(stem, "scatter", by_collider);
        chain.pass(stem, "pair_count", by_collider);
        scan_pairs.record(&mut chain.recorder, &offset, Some(&counters)).unwrap();
        chain.pass(stem, "gate", 1);
        chain.pass(stem, "pair_fill", by_collider);
        sort.record(&mut chain.recorder, &keys, &values, Some(&counters)).unwrap();
    });
    alone.take("counters")[0]
}

#[test]
fn the_grid_and_its_pairs_are_the_same() {
    for (name, aabbs) in crowds() {
        let mut step = step_of(aabbs.len() as u32);
        let chosen = grid::choose(&aabbs, &step);
        let cells = grid::fill(&chosen, &aabbs, &step);
        let found = grid::find_pairs(&chosen, &cells, &aabbs);
        step.pair_capacity = found.pairs.len() as u32 + 3;
        for permute in PERMUTATIONS {
            let mut alone = Alone::new(permute);
            let control = run_grid(&mut alone, &aabbs, &step, &Control::zeroed());
            let what = format!("{name}, permuted {permute}");
            let [x, y, z] = chosen.bits;
            assert_eq!(
                (control.cell_class, control.inverse_cell, control.cell_bits),
                (chosen.cell_class, chosen.inverse_cell.to_bits(), x | y << 8 | z << 16),
                "{what}"
            );
            assert!(alone.take::<u32>("cell_start") == cells.start, "{what}: cells");
            let mut entries: Vec<u32> = alone.take("cell_entries");
            cells.start.windows(2).for_each(|two| entries[two[0] as usize..two[1] as usize].sort_unstable());
            assert!(entries[..cells.entries.len()] == cells.entries, "{what}: entries");
            let mut large: Vec<u32> = alone.take("large_list");
            large.truncate(control.large_count as usize);
            large.sort_unstable();
            assert!(large == cells.large, "{what}: large ones");
            assert_eq!(control.pair_count as usize, found.pairs.len(), "{what}");
            let keys: Vec<[u32; 2]> = alone.take("pair_keys");
            assert!(keys[..found.pairs.len()] == found.pairs, "{what}: pairs");
            assert!(keys[found.pairs.len()..].iter().all(|key| *key == [GARBAGE; 2]), "{what}");
            assert_eq!([control.stop, control.overflow, control.needed], [0; 3], "{what}");
        }
    }
}

#[test]
fn too_many_pairs_or_candidates_stop_the_step() {
    let raised = |c: &Control| [c.stop, c.overflow, c.needed, c.pair_count];
    let crowd = crowds().swap_remove(6).1;
    let mut step = step_of(crowd.len() as u32);
    let chosen = grid::choose(&crowd, &step);
    let pairs = grid::find_pairs(&chosen, &grid::fill(&chosen, &crowd, &step), &crowd).pairs.len() as u32;
    // All in one cell, or all outside of every cell, and of one body, so that the CPU need not look at 2.5e9 pairs.
    let crowded = vec![boxed(Vec3::ZERO, Vec3::splat(0.5), 0); limits::CELL_LOOP_LIMIT as usize + 1];
    let mut endless = vec![boxed(Vec3::ZERO, Vec3::splat(0.5), 0); limits::LARGE_LOOP_LIMIT as usize + 1];
    endless.iter_mut().for_each(|aabb| (aabb.min, aabb.max, aabb.class) = ([-FAR; 3], [FAR; 3], size_class(FAR)));
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        step.pair_capacity = pairs - 1;
        let control = run_grid(&mut alone, &crowd, &step, &Control::zeroed());
        assert_eq!(raised(&control), [1, overflow::PAIRS, pairs, 0]);
        assert!(alone.take::<u32>("pair_keys").iter().all(|&key| key == GARBAGE), "nothing is written");
        // A step after one that stopped changes nothing of what that one said.
        let before = Control { stop: 1, overflow: overflow::LAST_BATCH, needed: 77, ..Control::zeroed() };
        assert_eq!(raised(&run_grid(&mut alone, &crowd, &step, &before)), [1, overflow::LAST_BATCH, 77, 0]);
        for many in [&crowded, &endless] {
            let step = StepParams { pair_capacity: 10, ..step_of(many.len() as u32) };
            let control = run_grid(&mut alone, many, &step, &Control::zeroed());
            assert_eq!(raised(&control), [1, overflow::CELL, many.len() as u32, 0]);
        }
    }
    let step = StepParams { pair_capacity: 10, ..step_of(limits::LARGE_LOOP_LIMIT) };
    let control = run_grid(&mut Alone::new(0), &endless[1..], &step, &Control::zeroed());
    assert_eq!(raised(&control), [0; 4], "as many as may be");
}
