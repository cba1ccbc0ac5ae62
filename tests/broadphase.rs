//! All broad phases find the same pairs, whatever the crowd looks like and whether trees are new or refitted. Oracles:
//! brute force up to 2,000 bodies and for one crowd of 100,000; parry's tree for the other large ones.

#[path = "common/cloud.rs"]
mod cloud;

use cloud::Cloud;
use parry3d::bounding_volume;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use tumble_core::layout::{Aabb, StepParams, aabb_body, tree_members};
use tumble_core::scenes::{Crowd, crowd};
use tumble_core::{MortonBits, Traversal, limits};
use tumble_cpu::bounds::{FAR, size_class};
use tumble_cpu::broadphase::{Boxes, Found, bounded, brute_force, grid, lbvh, matter};

const COUNTS: [usize; 6] = [0, 1, 2, 3, 257, 2000];
const TRAVERSALS: [Traversal; 3] = [Traversal::Escape, Traversal::History, Traversal::Stack];
const BITS: [MortonBits; 2] = [MortonBits::Bits30, MortonBits::Bits63];

fn all_kinds() -> impl Iterator<Item = Crowd> {
    Crowd::ALL.into_iter()
}

/// What the grids find, wrapped and in slices, with `larges` for what is larger than a cell.
fn grids(boxes: &Boxes, step: &StepParams, larges: &[grid::Large], most: u32) -> Vec<(String, Found)> {
    let mut all = Vec::new();
    for tree in [false, true] {
        let step = StepParams { large_limit: limits::large_limit(boxes.aabbs.len() as u32, tree), ..*step };
        let wrapped = grid::choose(boxes, &step);
        for grid in [grid::slice(&wrapped, boxes, &step), wrapped] {
            let cells = grid::fill(&grid, boxes, &step);
            cells.assert_well_formed(&grid, boxes);
            assert!(cells.large.len() <= step.large_limit as usize);
            for &large in larges {
                let sliced = grid.slices.is_some();
                let what = format!("grid, sliced {sliced}, {} large in {large:?}", cells.large.len());
                all.push((what, grid::find_pairs(&grid, &cells, boxes, large, most)));
            }
        }
    }
    all
}

fn trees(boxes: &Boxes, bits: MortonBits) -> [lbvh::Tree; 2] {
    [tree_members::MOVING, tree_members::FIXED].map(|members| lbvh::Tree::new(boxes, bits, members))
}

/// What walks of the trees find, once these are refitted to the boxes.
fn walks(trees: &[lbvh::Tree; 2], boxes: &Boxes, most: u32) -> Vec<(String, Found)> {
    let [mut moving, mut fixed] = trees.clone();
    for tree in [&mut moving, &mut fixed] {
        tree.refit(boxes);
        tree.assert_well_formed(boxes);
        tree.link_parents();
    }
    let walk = |traversal| (format!("lbvh, {traversal:?}"), lbvh::find_pairs(&moving, &fixed, boxes, traversal, most));
    TRAVERSALS.map(walk).into()
}

fn every_broad_phase(boxes: &Boxes, step: &StepParams, most: u32) -> Vec<(String, Found)> {
    let larges: Vec<_> = TRAVERSALS.into_iter().map(grid::Large::Tree).chain([grid::Large::List]).collect();
    let mut all = grids(boxes, step, &larges, most);
    for bits in BITS {
        all.extend(walks(&trees(boxes, bits), boxes, most));
    }
    all
}

#[track_caller]
fn same(crowd: &str, found: &[(String, Found)], pairs: &[[u32; 2]]) {
    for (what, found) in found {
        found.assert_well_formed();
        assert_eq!(found.count as usize, pairs.len(), "{crowd}: {what}");
        assert!(found.pairs == pairs, "{crowd}: {what}: other pairs");
    }
}

/// Oracle: brute force, as plain as can be and not the one that is tested.
fn pairs_of(aabbs: &[Aabb]) -> Vec<[u32; 2]> {
    let apart = |a: &Aabb, b: &Aabb| (0..3).any(|i| a.min[i] > b.max[i] || b.min[i] > a.max[i]);
    let index = |a: &Aabb| a.body & aabb_body::INDEX;
    let mut pairs = Vec::new();
    for (i, a) in aabbs.iter().enumerate() {
        for (j, b) in aabbs.iter().enumerate().skip(i + 1) {
            let live = a.body & aabb_body::LIVE != 0 && b.body & aabb_body::LIVE != 0;
            let pushes = a.body & aabb_body::DYNAMIC != 0 || b.body & aabb_body::DYNAMIC != 0;
            if live && pushes && index(a) != index(b) && !apart(a, b) {
                pairs.push([i as u32, j as u32]);
            }
        }
    }
    pairs
}

#[test]
fn all_find_what_brute_force_finds() {
    for kind in all_kinds() {
        for count in COUNTS {
            let cloud = Cloud::new(&crowd(kind, count));
            let aabbs = cloud.boxes();
            let boxes = Boxes::new(&aabbs);
            let (what, pairs) = (format!("{kind} of {count}"), pairs_of(&aabbs));
            assert!(count < 257 || !pairs.is_empty());
            same(&what, &[("brute force".into(), brute_force::find_pairs(&boxes, u32::MAX))], &pairs);
            same(&what, &every_broad_phase(&boxes, &cloud.step, u32::MAX), &pairs);
        }
    }
}

/// Half-spaces, empty slots, colliders of one body, boxes that only touch. Oracle: brute force.
#[test]
fn what_is_no_plain_box_is_no_trouble() {
    for (n, kind) in all_kinds().enumerate() {
        let cloud = Cloud::new(&crowd(kind, 600));
        let mut aabbs = cloud.boxes();
        for i in 0..600 {
            match (i + n) % 23 {
                0 => aabbs[i] = Aabb { min: [FAR; 3], body: 0, max: [-FAR; 3], class: 0 },
                1 => {
                    // No dynamic body carries one.
                    let (max, body) = ([FAR, aabbs[i].max[1], FAR], aabbs[i].body & !aabb_body::DYNAMIC);
                    aabbs[i] = Aabb { min: [-FAR; 3], body, max, class: size_class(FAR) };
                }
                2 | 3 => aabbs[i].body = (aabbs[i].body & !aabb_body::INDEX) | (i as u32 / 50),
                4 if i > 0 && aabbs[i - 1].class < size_class(FAR) => {
                    let size = aabbs[i].max[0] - aabbs[i].min[0];
                    aabbs[i].min[0] = aabbs[i - 1].max[0];
                    aabbs[i].max[0] = aabbs[i].min[0] + size;
                }
                _ => {}
            }
        }
        let (boxes, pairs) = (Boxes::new(&aabbs), pairs_of(&aabbs));
        assert!(boxes.unbounded.len() > 20 && pairs.iter().any(|p| p.contains(&boxes.unbounded[3])));
        same(&kind.to_string(), &every_broad_phase(&boxes, &cloud.step, u32::MAX), &pairs);
    }
}

/// Trees built for other places of the same boxes, refitted. Oracle: brute force.
#[test]
fn refitted_trees_find_the_same() {
    for kind in all_kinds() {
        for count in COUNTS {
            let mut cloud = Cloud::new(&crowd(kind, count));
            let before = cloud.boxes();
            let trees = BITS.map(|bits| trees(&Boxes::new(&before), bits));
            // Some stay about where they are, those of one kind go far.
            cloud.fly(30.0);
            let mut aabbs = cloud.boxes();
            for aabb in aabbs.iter_mut().skip(11).step_by(29) {
                // Removed: an empty box.
                *aabb = Aabb { min: [FAR; 3], body: 0, max: [-FAR; 3], class: 0 };
            }
            let (boxes, pairs) = (Boxes::new(&aabbs), pairs_of(&aabbs));
            for trees in trees {
                same(&format!("{kind} of {count}"), &walks(&trees, &boxes, u32::MAX), &pairs);
            }
        }
    }
}

/// Beyond the most that was asked for, pairs are counted all the same.
#[test]
fn too_many_pairs_are_counted() {
    for kind in [Crowd::Uniform, Crowd::Ratio(1000.0), Crowd::OnePoint] {
        let cloud = Cloud::new(&crowd(kind, 2000));
        let aabbs = cloud.boxes();
        let boxes = Boxes::new(&aabbs);
        let pairs = pairs_of(&aabbs);
        for most in [0, 1, pairs.len() as u32 - 1] {
            let mut all = every_broad_phase(&boxes, &cloud.step, most);
            all.push(("brute force".into(), brute_force::find_pairs(&boxes, most)));
            for (what, found) in all {
                assert_eq!(found.count as usize, pairs.len(), "{kind}: {what}");
            }
        }
        same("just enough", &every_broad_phase(&boxes, &cloud.step, pairs.len() as u32), &pairs);
    }
}

/// Oracle: parry's tree.
fn pairs_by_parry(aabbs: &[Aabb]) -> Vec<[u32; 2]> {
    let leaf = |a: &Aabb| bounding_volume::Aabb::new(a.min.into(), a.max.into());
    let leaves = aabbs.iter().enumerate().filter(|(_, a)| bounded(a)).map(|(i, a)| (i, leaf(a)));
    let tree = Bvh::from_iter(BvhBuildStrategy::Binned, leaves.collect::<Vec<_>>());
    let mut pairs: Vec<[u32; 2]> = tree
        .traverse_bvtt_single_tree_parallel::<false>()
        .into_iter()
        .filter(|&(a, b)| matter(aabbs[a as usize].body, aabbs[b as usize].body))
        .map(|(a, b)| [a.min(b), a.max(b)])
        .collect();
    pairs.sort_unstable();
    pairs
}

/// Oracle: parry's tree, and for one crowd brute force, which takes 5 s.
#[test]
fn a_hundred_thousand_bodies() {
    for kind in all_kinds().filter(|kind| *kind != Crowd::OnePoint) {
        let cloud = Cloud::new(&crowd(kind, 100_000));
        let aabbs = cloud.boxes();
        let (boxes, pairs) = (Boxes::new(&aabbs), pairs_by_parry(&aabbs));
        let what = kind.to_string();
        // A list of large ones that all small ones are tested against takes seconds where sizes differ much.
        let larges = [grid::Large::Tree(Traversal::Escape)];
        same(&what, &grids(&boxes, &cloud.step, &larges, u32::MAX), &pairs);
        for bits in BITS {
            same(&what, &walks(&trees(&boxes, bits), &boxes, u32::MAX), &pairs);
        }
        if kind == Crowd::Uniform {
            same(&what, &[("brute force".into(), brute_force::find_pairs(&boxes, u32::MAX))], &pairs);
            same(&what, &grids(&boxes, &cloud.step, &[grid::Large::List], u32::MAX), &pairs);
        }
    }
}
