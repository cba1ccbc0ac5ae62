//! Stage `broadphase`, pass by pass: the GPU computes what the CPU does, in every order of invocations. Oracle: the
//! mirror; for the pairs, every box against every other.

#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/crowds.rs"]
mod crowds;
#[path = "common/random.rs"]
mod random;

use alone::{Alone, Chain};
use bytemuck::Zeroable;
use crowds::{boxed, counted, crowds};
use random::step_of;
use tumble_core::glam::Vec3;
use tumble_core::layout::*;
use tumble_core::{MortonBits, Traversal, limits};
use tumble_cpu::bounds::{FAR, size_class};
use tumble_cpu::broadphase::grid::{self, Grid, Large};
use tumble_cpu::broadphase::{Boxes, brute_force, lbvh};
use tumble_gpu::primitives::{Count, Scan, ScanOptions, Sort, SortOptions};

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
const GARBAGE: u32 = 0xdead_beef;
/// Words of `Control`.
const PAIR_COUNT: u32 = 8;
/// Bit of `Control::cell_bits` that tells that the grid lies in slices, and the first of those of their axis.
const SLICED: u32 = 1 << 26;
const SLICE_AXIS: u32 = 24;
const WALKS: [(Traversal, &str, &str); 3] = [
    (Traversal::Escape, "pairs_by_escapes", "across_by_escapes"),
    (Traversal::History, "pairs_by_history", "across_by_history"),
    (Traversal::Stack, "pairs_with_stack", "across_with_stack"),
];

fn groups(count: usize) -> u32 {
    (count as u32).div_ceil(256) + 1
}

/// Fills in what all broad phases bind.
fn prepare(alone: &mut Alone, boxes: &Boxes, step: &StepParams, control: &Control) {
    let mut list = boxes.unbounded.clone();
    list.resize(boxes.aabbs.len(), GARBAGE);
    alone.put("step", &[*step]);
    alone.put("counters", &[counted(boxes, control)]);
    alone.put("class_histogram", &boxes.classes);
    alone.put("aabbs", boxes.aabbs);
    alone.put("large_list", &list);
    alone.put("pair_keys", &vec![[GARBAGE; 2]; step.pair_capacity as usize]);
    alone.put("pair_values", &vec![GARBAGE; step.pair_capacity as usize]);
}

/// The gate and the sort behind every broad phase.
fn finish(alone: &mut Alone, step: &StepParams) -> Control {
    let bits = vec![32 - step.collider_count.leading_zeros(); 2];
    let options = SortOptions { capacity: step.pair_capacity, count: Count::Word(PAIR_COUNT), bits };
    let sort = Sort::new(common::gpu(), &mut alone.pipelines, options).unwrap();
    let [keys, values, counters] =
        ["pair_keys", "pair_values", "counters"].map(|name| alone.buffers.buffer(name).unwrap().clone());
    alone.run(|chain| {
        chain.pass("broadphase/pairs", "gate", 1);
        sort.record(&mut chain.recorder, &keys, &values, Some(&counters)).unwrap();
    });
    alone.take("counters")[0]
}

/// The pairs are those of `expected`, and nothing is behind them.
fn check_pairs(alone: &Alone, control: &Control, expected: &[[u32; 2]], what: &str) {
    assert_eq!(control.pair_count as usize, expected.len(), "{what}");
    let keys: Vec<[u32; 2]> = alone.take("pair_keys");
    assert!(keys[..expected.len()] == *expected, "{what}: pairs");
    assert!(keys[expected.len()..].iter().all(|key| *key == [GARBAGE; 2]), "{what}");
    assert_eq!([control.stop, control.overflow, control.needed], [0; 3], "{what}");
}

#[test]
fn brute_force_finds_the_same() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    for (name, aabbs) in crowds() {
        let boxes = Boxes::new(&aabbs);
        let expected = brute_force::find_pairs(&boxes, u32::MAX);
        let mut step = step_of(aabbs.len() as u32);
        step.pair_capacity = expected.pairs.len() as u32 + 3;
        for (permute, alone) in alones.iter_mut().enumerate() {
            prepare(alone, &boxes, &step, &Control::zeroed());
            let tiles = aabbs.len() * aabbs.len().div_ceil(256);
            alone.run(|chain| chain.pass("broadphase/brute_force", "pairs", groups(tiles)));
            let control = finish(alone, &step);
            check_pairs(alone, &control, &expected.pairs, &format!("{name}, permuted {permute}"));
        }
    }
}

/// All passes of the grid, one after the other; `slices` is the room for these.
fn run_grid(alone: &mut Alone, boxes: &Boxes, step: &StepParams, slices: u32, large_tree: bool) {
    let cells = (1 << step.cell_table_bits) + 1;
    let by_collider = groups(boxes.aabbs.len());
    alone.put("cells", &vec![GARBAGE; cells]);
    alone.put("cell_boxes", &vec![[GARBAGE; 8]; boxes.aabbs.len()]);
    alone.put("slice_bounds", &vec![[GARBAGE; 4]; slices as usize]);
    alone.put("slice_start", &vec![GARBAGE; slices as usize]);
    alone.put("grid_options", &[slices, u32::from(large_tree), 0, 0]);
    let host = |count| ScanOptions { capacity: count, count: Count::Host(count), total: None };
    let scan_cells = Scan::new(common::gpu(), &mut alone.pipelines, host(cells as u32)).unwrap();
    let scan_slices = Scan::new(common::gpu(), &mut alone.pipelines, host(slices)).unwrap();
    let [table, start] = ["cells", "slice_start"].map(|name| alone.buffers.buffer(name).unwrap().clone());
    alone.run(|chain| {
        let stem = "broadphase/grid";
        chain.pass(stem, "choose", 1);
        chain.pass(stem, "clear", groups(cells));
        if slices > 0 {
            chain.pass(stem, "bound_slices", by_collider);
            chain.pass(stem, "size_slices", groups(slices as usize));
            scan_slices.record(&mut chain.recorder, &start, None).unwrap();
        }
        chain.pass(stem, "count", by_collider);
        scan_cells.record(&mut chain.recorder, &table, None).unwrap();
        chain.pass(stem, "scatter", by_collider);
        chain.pass(stem, "pairs", by_collider);
    });
}

/// The grid on the GPU is `expected`, with its cells.
fn check_grid(alone: &Alone, boxes: &Boxes, expected: &Grid, step: &StepParams, what: &str) {
    let control = alone.take::<Control>("counters")[0];
    let [x, y, z] = expected.bits;
    assert_eq!(control.cell_class, expected.cell_class, "{what}");
    assert_eq!(control.inverse_cell, expected.inverse_cell.to_bits(), "{what}");
    assert_eq!(control.cell_bits & 0xff_ffff, x | y << 8 | z << 16, "{what}");
    if let Some(slices) = &expected.slices {
        assert_eq!(control.cell_bits >> SLICE_AXIS, SLICED >> SLICE_AXIS | slices.axis as u32, "{what}");
        let start: Vec<u32> = alone.take("slice_start");
        assert!(start[..slices.bounds.len()] == slices.start[..slices.bounds.len()], "{what}: slices");
        let bounds: Vec<[i32; 4]> = alone.take("slice_bounds");
        for (slice, (gpu, cpu)) in
            bounds.iter().zip(&slices.bounds).enumerate().filter(|(_, (_, b))| b.low[0] <= b.high[0])
        {
            assert_eq!(*gpu, [cpu.low[0], cpu.low[1], cpu.high[0], cpu.high[1]], "{what}: slice {slice}");
        }
    }
    // Cells hold their ends once all are scattered.
    let cells = grid::fill(expected, boxes, step);
    cells.assert_well_formed(expected, boxes);
    let ends: Vec<u32> = alone.take("cells");
    assert!(ends[..cells.start.len() - 1] == cells.start[1..], "{what}: cells");
    let mut entries: Vec<Aabb> = alone.take("cell_boxes");
    entries.truncate(cells.entries.len());
    cells.start.windows(2).for_each(|two| entries[two[0] as usize..two[1] as usize].sort_unstable_by_key(|e| e.class));
    assert!(entries == cells.entries, "{what}: entries");
}

#[test]
fn grids_and_their_pairs_are_the_same() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let (mut sliced, mut listed) = (0, 0);
    for (name, aabbs) in crowds() {
        let boxes = Boxes::new(&aabbs);
        let mut step = step_of(aabbs.len() as u32);
        let chosen = grid::choose(&boxes, &step);
        let expected = brute_force::find_pairs(&boxes, u32::MAX);
        step.pair_capacity = expected.pairs.len() as u32 + 3;
        let room = (1 << step.cell_table_bits).min(limits::SLICE_LIMIT);
        for (grid, slices) in [(grid::slice(&chosen, &boxes, &step), room), (chosen, 0)] {
            let cells = grid::fill(&grid, &boxes, &step);
            let found = grid::find_pairs(&grid, &cells, &boxes, Large::List, u32::MAX);
            assert!(found.pairs == expected.pairs, "{name}");
            sliced += usize::from(grid.slices.is_some());
            listed += cells.large.len();
            for (permute, alone) in alones.iter_mut().enumerate() {
                let what = format!("{name}, permuted {permute}, room for {slices} slices");
                prepare(alone, &boxes, &step, &Control::zeroed());
                run_grid(alone, &boxes, &step, slices, false);
                check_grid(alone, &boxes, &grid, &step, &what);
                let control = finish(alone, &step);
                assert_eq!(control.large_count as usize, boxes.unbounded.len() + cells.large.len(), "{what}");
                check_pairs(alone, &control, &expected.pairs, &what);
                // Which of two in one cell looks at the other depends on the order within the cell.
                assert_eq!(control.turns, found.turns, "{what}");
            }
        }
    }
    assert!(sliced > 10 && listed > 50, "{sliced} in slices, {listed} large");
}

/// A tree on the GPU: its buffers filled, and what its passes dispatch.
struct TreeOf {
    count: usize,
    words: usize,
    members: u32,
}

impl TreeOf {
    fn put(&self, alone: &mut Alone) {
        let capacity = self.count.next_power_of_two().max(1);
        let info = TreeInfo {
            slots: self.count as u32,
            members: self.members,
            words: self.words as u32,
            capacity: capacity as u32,
        };
        alone.put("tree", &[info]);
        alone.put("keys", &vec![GARBAGE; self.count * self.words]);
        alone.put("members", &vec![GARBAGE; self.count]);
        alone.put("nodes", &vec![[GARBAGE; 8]; 2 * self.count]);
        alone.put("ends", &vec![GARBAGE; self.count]);
        alone.put("parents_of", &vec![GARBAGE; 2 * self.count]);
        alone.put("pyramid", &vec![[GARBAGE; 6]; capacity]);
        alone.put("leaf_count", &[GARBAGE]);
    }

    fn build(&self, alone: &mut Alone) {
        let bits = if self.words == 2 { vec![32, 32] } else { vec![31] };
        let options = SortOptions { capacity: self.count as u32, count: Count::Host(self.count as u32), bits };
        let sort = Sort::new(common::gpu(), &mut alone.pipelines, options).unwrap();
        let [keys, members] = ["keys", "members"].map(|name| alone.buffers.buffer(name).unwrap().clone());
        let by_slot = groups(self.count);
        alone.run(|chain| {
            chain.pass("broadphase/lbvh/build", "codes", by_slot);
            sort.record(&mut chain.recorder, &keys, &members, None).unwrap();
            chain.pass("broadphase/lbvh/build", "hierarchy", by_slot);
            chain.pass("broadphase/lbvh/build", "parents", by_slot);
        });
    }

    fn refit(&self, alone: &mut Alone) {
        alone.run(|chain: &mut Chain| {
            chain.pass("broadphase/lbvh/build", "leaves", groups(self.count));
            for level in [8, 16] {
                chain.indexed("broadphase/lbvh/build", "pyramid_up", ("level", level), groups(self.count >> level));
            }
            chain.pass("broadphase/lbvh/build", "boxes", groups(self.count));
        });
    }
}

/// The tree on the GPU is `expected`, bit for bit.
fn check_tree(alone: &Alone, expected: &lbvh::Tree, words: usize, what: &str) {
    let count = expected.members.len();
    assert_eq!(alone.take::<u32>("leaf_count"), [count as u32], "{what}");
    let keys: Vec<u32> = alone.take("keys");
    let code = |key: &[u32]| key.iter().fold(0u64, |code, word| code << 32 | u64::from(*word));
    assert!(keys.chunks_exact(words).take(count).map(code).eq(expected.codes.iter().copied()), "{what}: codes");
    assert!(alone.take::<u32>("members")[..count] == expected.members, "{what}: members");
    assert!(alone.take::<u32>("ends")[..count.max(1) - 1] == expected.ends, "{what}: ends");
    let nodes: Vec<TreeNode> = alone.take("nodes");
    let last = (2 * count).max(1) - 1;
    for (node, (gpu, cpu)) in nodes.iter().zip(&expected.nodes[..last.min(expected.nodes.len())]).enumerate() {
        assert_eq!(gpu, cpu, "{what}: node {node}");
    }
    let parents: Vec<u32> = alone.take("parents_of");
    for (node, (gpu, cpu)) in parents.iter().zip(&expected.parents).enumerate().filter(|(_, (_, cpu))| **cpu != NO_NODE)
    {
        assert_eq!(gpu, cpu, "{what}: parent of {node}");
    }
}

#[test]
fn trees_and_their_pairs_are_the_same() {
    let mut alones = PERMUTATIONS.map(|permute| [Alone::new(permute), Alone::new(permute)]);
    for (name, aabbs) in crowds() {
        let boxes = Boxes::new(&aabbs);
        let mut step = step_of(aabbs.len() as u32);
        let expected = brute_force::find_pairs(&boxes, u32::MAX);
        step.pair_capacity = expected.pairs.len() as u32 + 3;
        // The same colliders elsewhere, as they were when the trees were built.
        let before: Vec<Aabb> = aabbs.iter().map(|aabb| shifted(aabb, aabbs.len())).collect();
        let old = Boxes::new(&before);
        for (bits, words) in [(MortonBits::Bits30, 1), (MortonBits::Bits63, 2)] {
            for permute in PERMUTATIONS.into_iter().filter(|permute| words == 1 || *permute == 1) {
                let what = format!("{name}, {bits:?}, permuted {permute}");
                let alones = &mut alones[permute as usize];
                let mut mirrors = Vec::new();
                for (members, alone) in [tree_members::MOVING, tree_members::FIXED].into_iter().zip(&mut *alones) {
                    let tree = TreeOf { count: aabbs.len(), words, members };
                    tree.put(alone);
                    prepare(alone, &old, &step, &Control::zeroed());
                    tree.build(alone);
                    tree.refit(alone);
                    let mut mirror = lbvh::Tree::new(&old, bits, members);
                    mirror.link_parents();
                    mirror.assert_well_formed(&old);
                    check_tree(alone, &mirror, words, &format!("{what}, members {members}"));
                    // As they are now.
                    alone.put("aabbs", &aabbs);
                    tree.refit(alone);
                    mirror.refit(&boxes);
                    mirror.assert_well_formed(&boxes);
                    check_tree(alone, &mirror, words, &format!("{what}, members {members}, refitted"));
                    mirrors.push(mirror);
                }
                for (traversal, pairs, across) in WALKS {
                    let what = format!("{what}, {traversal:?}");
                    let found = lbvh::find_pairs(&mirrors[0], &mirrors[1], &boxes, traversal, u32::MAX);
                    assert!(found.pairs == expected.pairs, "{what}: mirror");
                    let groups = groups(aabbs.len());
                    let [moving, fixed] = &mut *alones;
                    prepare(moving, &boxes, &step, &Control::zeroed());
                    moving.run(|chain| chain.pass("broadphase/lbvh/walk", pairs, groups));
                    // What the first tree found goes on in the second one's buffers.
                    let (control, keys) = (moving.take::<Control>("counters")[0], moving.take::<u32>("pair_keys"));
                    prepare(fixed, &boxes, &step, &Control::zeroed());
                    fixed.put("counters", &[control]);
                    fixed.put("pair_keys", &keys);
                    fixed.run(|chain| chain.pass("broadphase/lbvh/walk", across, groups));
                    let control = finish(fixed, &step);
                    check_pairs(fixed, &control, &expected.pairs, &what);
                    assert_eq!(control.turns, found.turns, "{what}");
                }
            }
        }
    }
}

/// A box that ends is moved a little, each elsewhere.
fn shifted(aabb: &Aabb, salt: usize) -> Aabb {
    if aabb.class >= size_class(FAR) || aabb.body & aabb_body::LIVE == 0 {
        return *aabb;
    }
    let by = |x: f32, i: usize| x + ((aabb.body as usize * 7 + i * 3 + salt) % 11) as f32 * 0.2;
    let (min, max): ([f32; 3], [f32; 3]) =
        (std::array::from_fn(|i| by(aabb.min[i], i)), std::array::from_fn(|i| by(aabb.max[i], i)));
    let class = size_class((0..3).map(|i| max[i] - min[i]).fold(0.0, f32::max));
    Aabb { min, body: aabb.body, max, class }
}

#[test]
fn a_tree_of_the_large_ones_goes_with_a_grid() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut in_trees = 0;
    for (name, aabbs) in crowds() {
        let boxes = Boxes::new(&aabbs);
        let mut step = step_of(aabbs.len() as u32);
        step.large_limit = limits::large_limit(aabbs.len() as u32, true);
        let expected = brute_force::find_pairs(&boxes, u32::MAX);
        step.pair_capacity = expected.pairs.len() as u32 + 3;
        let chosen = grid::choose(&boxes, &step);
        let cells = grid::fill(&chosen, &boxes, &step);
        in_trees += cells.large.len();
        for ((traversal, pairs, across), alone) in WALKS.into_iter().zip(&mut alones) {
            let what = format!("{name}, {traversal:?}");
            let found = grid::find_pairs(&chosen, &cells, &boxes, Large::Tree(traversal), u32::MAX);
            assert!(found.pairs == expected.pairs, "{what}: mirror");
            let tree = TreeOf { count: aabbs.len(), words: 1, members: tree_members::LARGE };
            tree.put(alone);
            prepare(alone, &boxes, &step, &Control::zeroed());
            run_grid(alone, &boxes, &step, 0, true);
            tree.build(alone);
            tree.refit(alone);
            alone.run(|chain| {
                chain.pass("broadphase/lbvh/walk", pairs, groups(aabbs.len()));
                chain.pass("broadphase/lbvh/walk", across, groups(aabbs.len()));
            });
            let control = finish(alone, &step);
            check_pairs(alone, &control, &expected.pairs, &what);
            assert_eq!(control.turns, found.turns, "{what}");
        }
    }
    assert!(in_trees > 500, "{in_trees}");
}

#[test]
fn too_many_pairs_or_turns_stop_the_step() {
    let raised = |c: &Control| [c.stop, c.overflow, c.needed, c.pair_count];
    let crowd = crowds().swap_remove(7).1;
    let boxes = Boxes::new(&crowd);
    let mut step = step_of(crowd.len() as u32);
    let pairs = brute_force::find_pairs(&boxes, u32::MAX).pairs.len() as u32;
    // All in one cell, or all without end, and of one body, so that the CPU need not look at 2.5e9 pairs.
    let crowded = vec![boxed(Vec3::ZERO, Vec3::splat(0.5), 0); limits::TURN_LIMIT as usize + 2];
    let mut endless = vec![boxed(Vec3::ZERO, Vec3::splat(0.5), 0); limits::UNBOUNDED_LIMIT as usize + 1];
    endless.iter_mut().for_each(|aabb| (aabb.min, aabb.max, aabb.class) = ([-FAR; 3], [FAR; 3], size_class(FAR)));
    let run = |alone: &mut Alone, boxes: &Boxes, step: &StepParams, before: &Control| {
        prepare(alone, boxes, step, before);
        run_grid(alone, boxes, step, 0, false);
        finish(alone, step)
    };
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        step.pair_capacity = pairs - 1;
        assert_eq!(raised(&run(&mut alone, &boxes, &step, &Control::zeroed())), [1, overflow::PAIRS, pairs, 0]);
        // A step after one that stopped changes nothing of what that one said.
        let before = Control { stop: 1, overflow: overflow::LAST_BATCH, needed: 77, ..Control::zeroed() };
        assert_eq!(raised(&run(&mut alone, &boxes, &step, &before)), [1, overflow::LAST_BATCH, 77, 0]);
        // The crowded cell takes 1.25e9 tests: once is enough.
        let hard = usize::from(permute > 0);
        for (many, bound, needed) in
            [(&crowded, overflow::TURNS, 50_001), (&endless, overflow::UNBOUNDED, 4097)].into_iter().skip(hard)
        {
            let step = StepParams { pair_capacity: 10, ..step_of(many.len() as u32) };
            let control = run(&mut alone, &Boxes::new(many), &step, &Control::zeroed());
            assert_eq!(raised(&control), [1, bound, needed, 0]);
        }
    }
    let step = StepParams { pair_capacity: 10, ..step_of(limits::UNBOUNDED_LIMIT) };
    let control = run(&mut Alone::new(0), &Boxes::new(&endless[1..]), &step, &Control::zeroed());
    assert_eq!(raised(&control), [0; 4], "as many as may be");
}

/// Nearly as many turns as there may be: llvmpipe ends loops early, without a word, where their turns add up to more than
/// 65,535. Only the very last candidate makes a pair. Oracle: analysis.
#[test]
fn long_searches_are_not_cut_short() {
    let mut alone = Alone::new(0);
    for ((traversal, pairs, _), count) in WALKS.into_iter().zip([24_900, 16_000, 24_900]) {
        // A box as large as all, first along the curve, and specks apart from each other, of the same body but the last.
        let mut aabbs = vec![boxed(Vec3::ZERO, Vec3::splat(1e3), 0)];
        aabbs.extend((1..count).map(|i| {
            let place = Vec3::new((i % 30) as f32, (i / 30 % 30) as f32, (i / 900) as f32) + 1.0;
            boxed(place, Vec3::splat(0.1), 0)
        }));
        let mut moving = lbvh::Tree::new(&Boxes::new(&aabbs), MortonBits::Bits30, tree_members::MOVING);
        let last = moving.members[count - 1];
        aabbs[last as usize].body += 1;
        let boxes = Boxes::new(&aabbs);
        moving.link_parents();
        let none = lbvh::Tree::default();
        let found = lbvh::find_pairs(&moving, &none, &boxes, traversal, u32::MAX);
        assert_eq!(found.pairs, [[0, last]], "{traversal:?}: mirror");
        let most = found.most_turns;
        assert!((45_000..=limits::TURN_LIMIT).contains(&most), "{traversal:?}: {most} turns");
        let step = StepParams { pair_capacity: 8, ..step_of(count as u32) };
        let tree = TreeOf { count, words: 1, members: tree_members::MOVING };
        tree.put(&mut alone);
        prepare(&mut alone, &boxes, &step, &Control::zeroed());
        tree.build(&mut alone);
        tree.refit(&mut alone);
        alone.run(|chain| chain.pass("broadphase/lbvh/walk", pairs, groups(count)));
        let control = finish(&mut alone, &step);
        check_pairs(&alone, &control, &found.pairs, &format!("{traversal:?}"));
        assert_eq!(control.turns, found.turns, "{traversal:?}");
    }
    // One cell with them all.
    let count = 40_000;
    let mut aabbs = vec![boxed(Vec3::ONE, Vec3::splat(0.5), 0); count];
    aabbs[count - 1].body += 1;
    let expected: Vec<_> = (0..count as u32 - 1).map(|i| [i, count as u32 - 1]).collect();
    let step = StepParams { pair_capacity: count as u32, ..step_of(count as u32) };
    let boxes = Boxes::new(&aabbs);
    prepare(&mut alone, &boxes, &step, &Control::zeroed());
    run_grid(&mut alone, &boxes, &step, 0, false);
    let control = finish(&mut alone, &step);
    check_pairs(&alone, &control, &expected, "one cell");
}
