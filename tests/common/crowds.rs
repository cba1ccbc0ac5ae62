//! Boxes of colliders, such as broad phases find easy and hard.
#![allow(dead_code, reason = "each test program uses a part")]

use tumble_core::glam::Vec3;
use tumble_core::layout::{Aabb, aabb_body};
use tumble_cpu::bounds::{FAR, size_class};

use crate::random::{Crowd, Random};

/// Bodies of the scenes.
pub(crate) const SIZES: [usize; 7] = [0, 1, 2, 255, 256, 257, 3000];

/// A box of a collider of this dynamic body.
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
    add("tiny", 1000, &mut |r, _| (r.vector(1e-3), Vec3::splat(1e-4)));
    for aabb in &mut all.iter_mut().find(|(name, _)| name == "a plane").unwrap().1[..300] {
        (aabb.min, aabb.max, aabb.class) = ([-FAR; 3], [FAR, 0.2, FAR], size_class(FAR));
    }
    all
}
