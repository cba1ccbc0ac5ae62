//! Stage `broadphase/sweep`: the CPU finds what brute force finds, and the GPU computes what the CPU does, pass by pass,
//! in every order of invocations. Oracles: brute force, and the mirror.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/crowds.rs"]
mod crowds;
#[path = "common/random.rs"]
mod random;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use alone::Alone;
use bytemuck::Zeroable;
use crowds::{boxed, counted, crowds, to_ordered};
use random::{Random, step_of};
use tumble_core::glam::Vec3;
use tumble_core::layout::*;
use tumble_core::limits::{SWEEP_CHUNK, SWEEP_ITEM_LIMIT};
use tumble_core::{Broadphase, Capacities, ColliderBuilder, Error, Params, RigidBodyBuilder, Scene, scenes};
use tumble_cpu::bounds::{FAR, size_class};
use tumble_cpu::broadphase::sweep::{self, Items, Sorted};
use tumble_cpu::broadphase::{Boxes, TooMany, brute_force, too_many};
use tumble_gpu::primitives::{Count, Scan, ScanOptions, Sort, SortOptions};
use worlds::{SIDES, hash, report, steps};

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
const GARBAGE: u32 = 0xdead_beef;
/// Word of `Control`.
const PAIR_COUNT: u32 = 8;

/// The crowds of all broad phases, and such as a sweep finds hard.
fn hard_crowds() -> Vec<(String, Vec<Aabb>)> {
    let mut random = Random::new(21);
    let mut all = crowds();
    let mut add = |name: &str, count: u32, place: &mut dyn FnMut(&mut Random, u32) -> (Vec3, Vec3)| {
        let boxes = (0..count).map(|i| {
            let (center, half) = place(&mut random, i);
            boxed(center, half, i)
        });
        all.push((name.to_owned(), boxes.collect()));
    };
    add("along y", 2000, &mut |r, _| (r.vector(1.0) * Vec3::new(2.0, 500.0, 2.0), Vec3::splat(0.5)));
    add("along z", 2000, &mut |r, _| (r.vector(1.0) * Vec3::new(-2.0, 3.0, 400.0), Vec3::splat(0.4)));
    // One over all the others, some over a few hundred.
    add("long ones over short ones", 3000, &mut |r, i| match i {
        1000 => (Vec3::X, Vec3::new(600.0, 0.5, 0.5)),
        _ if i % 100 == 7 => (r.vector(500.0).with_y(0.0), Vec3::new(60.0, 0.5, 5.0)),
        _ => (r.vector(500.0) * Vec3::new(1.0, 0.01, 0.01), Vec3::splat(0.5)),
    });
    // As many candidates as an item takes, one less, one more, and the same for two items.
    for candidates in [SWEEP_CHUNK - 1, SWEEP_CHUNK, SWEEP_CHUNK + 1, 2 * SWEEP_CHUNK, 2 * SWEEP_CHUNK + 1] {
        add(&format!("{candidates} candidates"), candidates + 1, &mut |_, i| {
            let middle = if i == 0 { 0.5 * candidates as f32 } else { i as f32 };
            (Vec3::new(middle, 0.0, 0.0), Vec3::new(if i == 0 { middle } else { 0.1 }, 0.5, 0.5))
        });
    }
    // Boxes that touch where a float's zero has two signs, and below the normal floats.
    let mut zeros = Vec::new();
    for (i, x) in [0.0, -0.0, 1e-40, -1e-40, f32::MIN_POSITIVE, -f32::MIN_POSITIVE].into_iter().enumerate() {
        for (j, (min, max)) in [(x, 1.0), (-1.0, x), (x, x)].into_iter().enumerate() {
            let (min, max) = ([min, 0.0, 0.0], [max, 0.1, 0.1]);
            zeros.push(Aabb { min, max, ..boxed(Vec3::ZERO, Vec3::ONE, (3 * i + j) as u32) });
        }
    }
    all.push(("zeros".to_owned(), zeros));
    // Many without end, on both sides of an axis, among dead ones.
    let mut endless: Vec<_> = (0..600).map(|i| boxed(random.vector(6.0), Vec3::splat(0.5), i)).collect();
    for (i, aabb) in endless.iter_mut().enumerate() {
        match i % 10 {
            2 => (aabb.min, aabb.max, aabb.class) = ([-FAR; 3], [0.5, FAR, FAR], size_class(FAR)),
            5 => (aabb.min, aabb.max, aabb.class) = ([FAR, 1.0, FAR].map(|x| -x), [FAR; 3], size_class(FAR)),
            8 => (aabb.min, aabb.body, aabb.max, aabb.class) = ([FAR; 3], 0, [-FAR; 3], 0),
            _ => {}
        }
    }
    all.push(("half-spaces and holes".to_owned(), endless));
    let mut few: Vec<_> = (0..700).map(|i| boxed(random.vector(2.0), Vec3::splat(0.5), i)).collect();
    few[3..]
        .iter_mut()
        .for_each(|aabb| (aabb.min, aabb.max, aabb.class) = ([-FAR; 3], [0.5, FAR, FAR], size_class(FAR)));
    all.push(("half-spaces above all".to_owned(), few));
    all
}

/// Passes of the sweep on the CPU.
fn passes(boxes: &Boxes) -> (usize, Sorted, Vec<u32>, Items) {
    let axis = sweep::axis(boxes);
    let sorted = sweep::sort(boxes, axis);
    let ends = sweep::ends(&sorted, axis);
    let items = sweep::items(&ends);
    (axis, sorted, ends, items)
}

#[test]
fn the_cpu_finds_what_brute_force_finds() {
    for (name, aabbs) in hard_crowds() {
        let boxes = Boxes::new(&aabbs);
        let expected = brute_force::find_pairs(&boxes, u32::MAX);
        let found = sweep::find_pairs(&boxes, u32::MAX);
        assert!(found.pairs == expected.pairs, "{name}: {} pairs, not {}", found.count, expected.count);
        found.assert_well_formed();
        assert_eq!(too_many(&boxes, &found), None, "{name}");
        if expected.count > 0 {
            let fewer = sweep::find_pairs(&boxes, expected.count as u32 - 1);
            assert_eq!((fewer.count, fewer.pairs.len()), (expected.count, 0), "{name}: counted and not kept");
        }
    }
}

#[test]
fn every_candidate_has_one_item_and_no_item_many() {
    for (name, aabbs) in hard_crowds() {
        let (_, sorted, ends, items) = passes(&Boxes::new(&aabbs));
        let mut next: Vec<usize> = (1..=sorted.boxes.len()).collect();
        for item in 0..items.count as usize {
            let (place, candidates) = items.candidates(&ends, item);
            assert!(candidates.len() <= SWEEP_CHUNK as usize, "{name}: item {item}");
            assert_eq!(candidates.start, next[place], "{name}: item {item} of place {place}");
            next[place] = candidates.end;
        }
        assert!(next.iter().zip(&ends).all(|(next, end)| *next == *end as usize), "{name}: some are left out");
    }
}

#[test]
fn it_sweeps_along_the_axis_of_largest_variance() {
    // Variance in f64; where two axes are close, the 64ths may decide otherwise.
    let mut decided = [0; 3];
    for (name, aabbs) in hard_crowds() {
        let boxes = Boxes::new(&aabbs);
        let middles: Vec<[f64; 3]> = (aabbs.iter().filter(|a| tumble_cpu::broadphase::bounded(a)))
            .map(|a| std::array::from_fn(|i| 0.5 * (f64::from(a.min[i]) + f64::from(a.max[i]))))
            .collect();
        let variance: [f64; 3] = std::array::from_fn(|i| {
            let mean = middles.iter().map(|m| m[i]).sum::<f64>() / middles.len() as f64;
            middles.iter().map(|m| (m[i] - mean).powi(2)).sum()
        });
        let axis = sweep::axis(&boxes);
        let others = variance.iter().enumerate().filter(|(i, _)| *i != axis).map(|(_, v)| *v).fold(0.0, f64::max);
        assert!(middles.is_empty() || variance[axis] >= 0.8 * others, "{name}: {variance:?}, axis {axis}");
        decided[axis] += usize::from(variance[axis] > 2.0 * others);
    }
    assert!(decided.iter().all(|&crowds| crowds > 0), "{decided:?}");
}

#[test]
fn more_work_than_may_be_is_refused() {
    // All over one point: n (n - 1) / 512 items.
    let crowd = vec![boxed(Vec3::ZERO, Vec3::splat(0.5), 0); 372_000];
    let boxes = Boxes::new(&crowd);
    let found = sweep::find_pairs(&boxes, 10);
    assert!(found.items > SWEEP_ITEM_LIMIT.into());
    assert_eq!(too_many(&boxes, &found), Some(TooMany::Items(found.items)));
}

/// Fills in what the passes bind, and makes the sort and the scan between them.
fn prepare(alone: &mut Alone, boxes: &Boxes, step: &StepParams, control: &Control) -> (Sort, Scan) {
    let count = boxes.aabbs.len();
    alone.put("step", &[*step]);
    alone.put("counters", &[counted(boxes, control)]);
    alone.put("aabbs", boxes.aabbs);
    alone.put("sweep_state", &[GARBAGE; 16]);
    for name in ["sweep_keys", "sweep_order", "sweep_offsets"] {
        alone.put(name, &vec![GARBAGE; count]);
    }
    alone.put("sweep_places", &vec![[GARBAGE; 2]; count]);
    alone.put("sweep_sides", &vec![[GARBAGE; 4]; count]);
    alone.put("sweep_args", &[GARBAGE; 4]);
    alone.put("large_list", &[&boxes.unbounded[..], &vec![GARBAGE; count - boxes.unbounded.len()]].concat());
    alone.put("pair_keys", &vec![[GARBAGE; 2]; step.pair_capacity as usize]);
    alone.put("pair_values", &vec![GARBAGE; step.pair_capacity as usize]);
    let gpu = common::gpu();
    let by_place = SortOptions { capacity: count as u32, count: Count::Host(count as u32), bits: vec![32] };
    let offsets = ScanOptions { capacity: count as u32, count: Count::Host(count as u32), total: None };
    (Sort::new(gpu, &mut alone.pipelines, by_place).unwrap(), Scan::new(gpu, &mut alone.pipelines, offsets).unwrap())
}

/// All passes of the sweep, one after the other, then the gate and the sort behind every broad phase.
fn run_sweep(alone: &mut Alone, boxes: &Boxes, step: &StepParams, control: &Control) -> Control {
    let (sort, scan) = prepare(alone, boxes, step, control);
    let bits = vec![32 - step.collider_count.leading_zeros(); 2];
    let by_pair = SortOptions { capacity: step.pair_capacity, count: Count::Word(PAIR_COUNT), bits };
    let sort_pairs = Sort::new(common::gpu(), &mut alone.pipelines, by_pair).unwrap();
    let buffer = |name: &str| alone.buffers.buffer(name).unwrap().clone();
    let [keys, order, offsets] = ["sweep_keys", "sweep_order", "sweep_offsets"].map(buffer);
    let [pair_keys, pair_values, counters] = ["pair_keys", "pair_values", "counters"].map(buffer);
    let (sweep, args) =
        (alone.pipelines.pass(common::gpu(), "broadphase/sweep", "sweep").unwrap(), buffer("sweep_args"));
    let by_collider = (boxes.aabbs.len() as u32).div_ceil(256) + 1;
    alone.run(|chain| {
        let stem = "broadphase/sweep";
        chain.pass(stem, "begin", 1);
        chain.pass(stem, "spread", by_collider);
        chain.pass(stem, "keys", by_collider);
        sort.record(&mut chain.recorder, &keys, &order, None).unwrap();
        chain.pass(stem, "ends", by_collider);
        scan.record(&mut chain.recorder, &offsets, None).unwrap();
        chain.pass(stem, "deal", 1);
        chain.recorder.dispatch_indirect(&sweep, &[], &args, 0).unwrap();
        chain.pass("broadphase/pairs", "gate", 1);
        sort_pairs.record(&mut chain.recorder, &pair_keys, &pair_values, Some(&counters)).unwrap();
    });
    alone.take("counters")[0]
}

#[test]
fn the_gpu_sweeps_as_the_cpu_does() {
    let crowds = hard_crowds();
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for (name, aabbs) in &crowds {
            let boxes = Boxes::new(aabbs);
            let (axis, sorted, ends, items) = passes(&boxes);
            let found = sweep::find_pairs(&boxes, u32::MAX);
            let step = StepParams { pair_capacity: found.count as u32 + 3, ..step_of(aabbs.len() as u32) };
            let control = run_sweep(&mut alone, &boxes, &step, &Control::zeroed());
            let what = format!("{name}, permuted {permute}");
            let held = ends.len();
            let state: Vec<u32> = alone.take("sweep_state");
            let axis_there = if aabbs.is_empty() { 0 } else { state[1] };
            assert_eq!((state[0], axis_there), (held as u32, axis as u32), "{what}");
            assert_eq!([state[2], state[3]], [items.count as u32, 0], "{what}: items");
            assert!(alone.take::<u32>("sweep_keys")[..held] == sorted.keys, "{what}: keys");
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let places: Vec<_> = sorted.boxes.iter().zip(&ends).map(|(aabb, end)| [aabb.class, *end]).collect();
            assert!(alone.take::<[u32; 2]>("sweep_places")[..held] == places, "{what}: places");
            let sides = |aabb: &Aabb| [aabb.min[u], aabb.max[u], aabb.min[v], aabb.max[v]];
            let sides: Vec<_> = sorted.boxes.iter().map(sides).collect();
            assert!(alone.take::<[f32; 4]>("sweep_sides")[..held] == sides, "{what}: sides");
            assert!(alone.take::<u32>("sweep_offsets")[..held] == items.offsets, "{what}: offsets");
            let threads = items.count.max(boxes.unbounded.len() as u64);
            assert_eq!(alone.take::<u32>("sweep_args")[..3], [threads.div_ceil(256) as u32, 1, 1], "{what}");
            assert_eq!([control.pair_count, control.turns], [found.count as u32, found.turns], "{what}");
            let pairs: Vec<[u32; 2]> = alone.take("pair_keys");
            assert!(pairs[..found.pairs.len()] == found.pairs, "{what}: pairs");
            assert!(pairs[found.pairs.len()..].iter().all(|key| *key == [GARBAGE; 2]), "{what}");
            assert_eq!([control.stop, control.overflow, control.needed], [0; 3], "{what}");
        }
    }
}

#[test]
fn sums_do_not_wrap() {
    // Nine of ten at the upper end along x, half of them along y: the squares along x pass 2^32.
    let place = |i: u32| 0.4995 * Vec3::new((i % 10).min(1) as f32, (i % 2) as f32, 0.0) * 2.0;
    let crowd: Vec<_> = (0..1_400_000).map(|i| boxed(place(i), Vec3::splat(0.1), i)).collect();
    let boxes = Boxes::new(&crowd);
    assert_eq!(sweep::axis(&boxes), 1);
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        prepare(&mut alone, &boxes, &step_of(crowd.len() as u32), &Control::zeroed());
        alone.run(|chain| {
            let groups = (crowd.len() as u32).div_ceil(256);
            chain.pass("broadphase/sweep", "begin", 1);
            chain.pass("broadphase/sweep", "spread", groups);
            chain.pass("broadphase/sweep", "keys", groups);
        });
        let state: Vec<u32> = alone.take("sweep_state");
        let squares = 63 * 63 * 1_260_000u64;
        assert_eq!(u64::from(state[8]) | u64::from(state[12]) << 32, squares);
        assert_eq!(state[..2], [1_400_000, 1]);
    }
}

#[test]
fn the_gpu_refuses_as_much_work_as_the_cpu_does() {
    let raised = |c: &Control| [c.stop, c.overflow, c.needed, c.pair_count];
    let crowd = vec![boxed(Vec3::ZERO, Vec3::splat(0.5), 0); 372_000];
    let boxes = Boxes::new(&crowd);
    let items = sweep::find_pairs(&boxes, 10).items as u32;
    let step = StepParams { pair_capacity: 10, ..step_of(crowd.len() as u32) };
    let mut alone = Alone::new(0);
    let control = run_sweep(&mut alone, &boxes, &step, &Control::zeroed());
    assert_eq!(raised(&control), [1, overflow::SWEEP, items, 0]);
    assert_eq!(alone.take::<u32>("sweep_args")[..3], [0, 1, 1]);
    // A step after one that stopped changes nothing of what that one said.
    let before = Control { stop: 1, overflow: overflow::LAST_BATCH, needed: 77, ..Control::zeroed() };
    let control = run_sweep(&mut alone, &boxes, &step, &before);
    assert_eq!(raised(&control), [1, overflow::LAST_BATCH, 77, 0]);
    assert_eq!(alone.take::<u32>("sweep_args")[..3], [0, 1, 1]);
    // More than a word counts: half of the square of their number, by 256.
    let count = 1_500_000;
    let crowd = vec![crowd[0]; count];
    let step = StepParams { pair_capacity: 10, ..step_of(count as u32) };
    let boxes = Boxes::new(&crowd);
    prepare(&mut alone, &boxes, &step, &Control::zeroed());
    let mut state = [0; 16];
    state[0] = count as u32;
    alone.put("sweep_state", &state);
    alone.put("sweep_keys", &vec![to_ordered(-0.5); count]);
    alone.put("sweep_order", &(0..count as u32).collect::<Vec<_>>());
    alone.run(|chain| {
        chain.pass("broadphase/sweep", "ends", (count as u32).div_ceil(256));
        chain.pass("broadphase/sweep", "deal", 1);
    });
    let state: Vec<u32> = alone.take("sweep_state");
    assert_eq!(u64::from(state[2]) | u64::from(state[3]) << 32, sweep::find_pairs(&boxes, 10).items);
    assert_eq!(raised(&alone.take("counters")[0]), [0, overflow::SWEEP, u32::MAX, 0]);
}

#[test]
fn too_many_pairs_stop_the_step() {
    let raised = |c: &Control| [c.stop, c.overflow, c.needed, c.pair_count];
    let crowd = crowds().swap_remove(7).1;
    let boxes = Boxes::new(&crowd);
    let pairs = sweep::find_pairs(&boxes, u32::MAX).count as u32;
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        let mut step = StepParams { pair_capacity: pairs - 1, ..step_of(crowd.len() as u32) };
        let control = run_sweep(&mut alone, &boxes, &step, &Control::zeroed());
        assert_eq!(raised(&control), [1, overflow::PAIRS, pairs, 0]);
        step.pair_capacity = pairs;
        let control = run_sweep(&mut alone, &boxes, &step, &Control::zeroed());
        assert_eq!(raised(&control), [0, 0, 0, pairs]);
        let keys: Vec<[u32; 2]> = alone.take("pair_keys");
        assert!(keys == sweep::find_pairs(&boxes, u32::MAX).pairs);
    }
}

/// Worlds that grow their buffers and get bodies on the way. Oracle: brute force, bit for bit.
#[test]
fn worlds_are_the_same_as_with_brute_force() {
    for side in SIDES {
        let run = |broadphase| {
            let capacities = Capacities { pairs: Some(10), ..Capacities::default() };
            let params = Params { broadphase, capacities, ..Params::default() };
            let mut world = side.world(&scenes::mixed(200), &params);
            let mut hashes = Vec::new();
            for _ in 0..5 {
                steps(&mut world, 6);
                for k in 0..40 {
                    let body = RigidBodyBuilder::dynamic().translation(Vec3::new(0.3 * k as f32, 6.0, 0.0));
                    world.edit().insert(body, ColliderBuilder::ball(0.2)).unwrap();
                }
                hashes.push(hash(&mut world));
            }
            let report = report(&mut world);
            assert_eq!((report.broadphase, report.lost), (broadphase, 0), "{side:?}");
            assert!(report.growths_of("pairs") > 0 && report.growths_of("colliders") > 0, "{side:?}: {report}");
            (hashes, report.pairs, report.broadphase_bytes)
        };
        let [by_sweep, expected] = [Broadphase::SweepAndPrune, Broadphase::BruteForce].map(run);
        assert_eq!((&by_sweep.0, by_sweep.1), (&expected.0, expected.1), "{side:?}");
        assert!(by_sweep.2 > 36 * 400, "{side:?}: {} bytes", by_sweep.2);
    }
}

#[test]
fn worlds_refuse_more_work_than_may_be() {
    let mut scene = Scene::new();
    for _ in 0..372_000 {
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1));
    }
    let items = sweep::find_pairs(&Boxes::new(&vec![boxed(Vec3::ZERO, Vec3::ONE, 0); 372_000]), 10).items;
    let capacities = Capacities { pairs: Some(1000), ..Capacities::default() };
    let params = Params { broadphase: Broadphase::SweepAndPrune, capacities, ..Params::default() };
    for side in SIDES {
        let mut world = side.world(&scene, &params);
        let error = world.step().and_then(|()| world.sync().map(drop)).unwrap_err();
        assert_eq!(error, Error::Capacity { buffer: "sweep", needed: items, capacity: SWEEP_ITEM_LIMIT.into() });
    }
}
