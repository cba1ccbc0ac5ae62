//! Boxes that broad phases find hard.

use tumble_core::glam::Vec3;
use tumble_core::layout::*;
use tumble_cpu::bounds::{FAR, size_class};
use tumble_cpu::broadphase::Boxes;

use crate::random::{Crowd, Random};

const SIZES: [usize; 8] = [0, 1, 2, 3, 255, 256, 257, 3000];

/// An integer that is larger when the float is.
pub(crate) fn to_ordered(x: f32) -> u32 {
    if x.to_bits() >> 31 == 0 { x.to_bits() | 1 << 31 } else { !x.to_bits() }
}

/// What `bounds` leaves in the counters for broad phases.
pub(crate) fn counted(boxes: &Boxes, control: &Control) -> Control {
    let (mut center_min, mut center_max) = ([u32::MAX; 3], [0; 3]);
    if boxes.low[0] <= boxes.high[0] {
        (center_min, center_max) = (boxes.low.map(to_ordered), boxes.high.map(to_ordered));
    }
    Control { center_min, center_max, large_count: boxes.unbounded.len() as u32, ..*control }
}

/// A box of a moving body.
pub(crate) fn boxed(center: Vec3, half: Vec3, body: u32) -> Aabb {
    let (min, max) = (center - half, center + half);
    let body = body | aabb_body::LIVE | aabb_body::DYNAMIC;
    Aabb { min: min.to_array(), body, max: max.to_array(), class: size_class((max - min).max_element()) }
}

/// Boxes of scenes, and such as a grid finds hard.
pub(crate) fn crowds() -> Vec<(String, Vec<Aabb>)> {
    let mut random = Random::new(8);
    let by_size = |bodies| (format!("{bodies} bodies"), Crowd::new(bodies, 7).boxes());
    let mut all: Vec<_> = SIZES.into_iter().map(by_size).collect();
    let mut add = |name: &str, count: u32, place: &mut dyn FnMut(&mut Random, u32) -> (Vec3, Vec3)| {
        let boxes = (0..count).map(|i| {
            let (center, half) = place(&mut random, i);
            boxed(center, half, i)
        });
        all.push((name.to_owned(), boxes.collect()));
    };
    add("one point", 400, &mut |_, _| (Vec3::splat(-3.0), Vec3::splat(0.5)));
    add("a line", 2000, &mut |_, i| (Vec3::new(0.9 * i as f32 - 700.0, 0.0, 0.0), Vec3::splat(0.5)));
    add("a plane", 2000, &mut |r, _| (r.vector(30.0).with_y(-1e-30), Vec3::splat(0.5)));
    add("cell edges", 1000, &mut |r, _| ((r.vector(8.0) * 2.0).round() * 0.5, Vec3::splat(0.25)));
    add("far away", 1000, &mut |r, _| (r.vector(4.0) + Vec3::new(1e6, -3e6, 1e7), Vec3::splat(0.5)));
    add("past all cells", 1000, &mut |r, _| (1e9 * r.vector(1.0).round() + r.vector(300.0), Vec3::splat(40.0)));
    add("many sizes", 2000, &mut |r, _| (r.vector(50.0), Vec3::splat(10f32.powf(r.range(-3.0, 1.5)))));
    add("as many large ones as may be", 500, &mut |r, i| (r.vector(9.0), Vec3::splat(if i < 8 { 3.0 } else { 0.3 })));
    add("fixed ones", 900, &mut |r, _| (r.vector(5.0), Vec3::splat(r.range(0.1, 0.5))));
    add("two far groups", 800, &mut |r, i| {
        (r.vector(3.0) + Vec3::X * if i % 2 == 0 { 0.0 } else { 4e5 }, Vec3::splat(0.4))
    });
    add("tiny", 1000, &mut |r, _| (r.vector(1e-3), Vec3::splat(1e-4)));
    for aabb in &mut all.iter_mut().find(|(name, _)| name == "a plane").unwrap().1[..60] {
        (aabb.min, aabb.max, aabb.class) = ([-FAR; 3], [FAR, 0.2, FAR], size_class(FAR));
    }
    for (i, aabb) in all.iter_mut().find(|(name, _)| name == "fixed ones").unwrap().1.iter_mut().enumerate() {
        match i % 5 {
            0 => aabb.body = aabb.body & !aabb_body::DYNAMIC | aabb_body::FIXED,
            1 => aabb.body &= !aabb_body::DYNAMIC,
            2 if i % 3 == 0 => *aabb = Aabb { min: [FAR; 3], body: 0, max: [-FAR; 3], class: 0 },
            _ => {}
        }
    }
    all
}
