//! Stage `broadphase/sweep`: the CPU finds what brute force finds, and the GPU computes what the CPU does, pass by pass,
//! in every order of invocations. Oracles: brute force, and the mirror.

mod common;
#[path = "common/crowds.rs"]
mod crowds;
#[path = "common/random.rs"]
mod random;

use crowds::{boxed, crowds};
use random::Random;
use tumble_core::glam::Vec3;
use tumble_core::layout::*;
use tumble_core::limits::{SWEEP_CHUNK, SWEEP_ITEM_LIMIT};
use tumble_cpu::bounds::{FAR, size_class};
use tumble_cpu::broadphase::sweep::{self, Items, Sorted};
use tumble_cpu::broadphase::{Boxes, TooMany, brute_force, too_many};

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
