//! Stage `broadphase/brute_force`: every bounded collider against every other. Twin of
//! `shaders/broadphase/brute_force.wgsl`. For tiny worlds, where anything cleverer costs more than it saves, and the
//! oracle of all the others.

use super::{Boxes, Found, bounded, collect, meets};

/// All pairs; beyond `most` they are counted and not kept.
pub fn find_pairs(boxes: &Boxes, most: u32) -> Found {
    let aabbs = boxes.aabbs;
    collect(boxes, &boxes.unbounded, aabbs.len(), most, |range, sink| {
        for i in range.filter(|&i| bounded(&aabbs[i])) {
            sink.with_list(boxes, &boxes.unbounded, i as u32);
            for j in i + 1..aabbs.len() {
                if bounded(&aabbs[j]) && meets(&aabbs[i], &aabbs[j]) {
                    sink.push(i as u32, j as u32);
                }
            }
        }
    })
}
