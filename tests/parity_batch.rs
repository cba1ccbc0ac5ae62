//! Stage `batch` alone: the GPU places every constraint exactly where the CPU does, in every way of batching and every
//! order of invocations. Oracles: the mirror; `validate::batches`, which asks whether a batch is one; and what each
//! way promises of a finished colouring.

#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/frame.rs"]
mod frame;

use alone::Alone;
use bytemuck::Zeroable;
use frame::{Cpu, control_of, scene_of};
use tumble_core::layout::*;
use tumble_core::{Params, limits, scenes, validate};
use tumble_cpu::batch::{self, Batches, Ends, NO_BODY};
use tumble_gpu::primitives::{Count, Sort, SortOptions};
use tumble_gpu::recorder::split;

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
const LAWS: [u32; 3] = [batching::WRITE_AND_VERIFY, batching::LOWEST_FREE, batching::PERSISTENT];
/// Every way of batching: a law, with contacts with what does not move last and without.
const WAYS: [u32; 6] = {
    let [a, b, c] = LAWS;
    [a, b, c, a | batching::STATIC_LAST, b | batching::STATIC_LAST, c | batching::STATIC_LAST]
};
/// Words of `Control` that the passes use: the number of pairs, and what the next step may keep.
const PAIR_COUNT: u32 = 8;
const NEXT_COLORED_AS: usize = 31;

/// What batching reads.
struct Graph {
    pairs: Vec<Pair>,
    manifolds: Vec<Manifold>,
    aabbs: Vec<Aabb>,
    ends: Vec<Ends>,
    kept: Vec<u32>,
    control: Control,
    step: StepParams,
}

/// What it leaves on the GPU.
struct Placed {
    of_pair: Vec<u32>,
    order: Vec<u32>,
    masks: Vec<u64>,
    control: Control,
    args: Vec<[u32; 4]>,
}

impl Graph {
    fn of(cpu: &Cpu, recolor: bool) -> Self {
        let frame = cpu.plan(recolor);
        let control = control_of(&frame, recolor);
        let kept = cpu.batch_of_slot.clone();
        let pairs = frame.matched.pairs;
        Self {
            pairs,
            manifolds: frame.manifolds,
            aabbs: frame.aabbs,
            ends: frame.ends,
            kept,
            control,
            step: frame.step,
        }
    }

    /// `pairs` random contacts among `bodies` bodies, every tenth of which does not move; a third do not touch.
    fn random(bodies: u32, pairs: u32, seed: u64) -> Self {
        let mut state = seed;
        let mut random = |below: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % u64::from(below)) as u32
        };
        let moving = |body: u32| body % 10 != 9;
        let aabb = |body: u32| {
            let flag = if moving(body) { aabb_body::DYNAMIC } else { 0 };
            Aabb { body: body | flag | aabb_body::LIVE, ..Aabb::zeroed() }
        };
        let (mut list, mut manifolds, mut ends, mut kept) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for slot in 0..pairs {
            let a = random(bodies);
            let b = (a + 1 + random(bodies - 1)) % bodies;
            let kind = pair_kind::BALL_BALL | if random(4) == 0 { pair_kind::FRESH } else { 0 };
            list.push(Pair { a, b, slot, kind });
            manifolds.push(Manifold { count: random(3), ..Manifold::zeroed() });
            let end = |body: u32| if moving(body) { body } else { NO_BODY };
            ends.push(Ends { a: end(a), b: end(b) });
            kept.push([UNBATCHED, LAST_BATCH][random(2) as usize]);
        }
        let mut step = Params::default().step_params(1, tumble_core::glam::Vec3::ZERO);
        (step.body_count, step.collider_count, step.pair_capacity) = (bodies, bodies, pairs);
        step.wide_batches = 16;
        let control = Control { pair_count: pairs, colored_as: step.batching, ..Control::zeroed() };
        Self { pairs: list, manifolds, aabbs: (0..bodies).map(aabb).collect(), ends, kept, control, step }
    }

    /// The same constraints in this way; a persistent one may use what is kept, unless `anew`.
    fn way(mut self, way: u32, anew: bool) -> Self {
        (self.step.batching, self.step.batch_rounds) = (way, limits::batch_rounds(way));
        let persists = way & batching::LAW == batching::PERSISTENT;
        self.control.colored_as = if persists && !anew { way } else { 0 };
        self
    }

    fn on_cpu(&self) -> Batches {
        let (recolor, bodies) = (self.control.colored_as != self.step.batching, self.step.body_count as usize);
        batch::place(&self.pairs, &self.manifolds, &self.ends, &self.kept, recolor, bodies, &self.step)
    }

    fn on_gpu(&self, alone: &mut Alone) -> Placed {
        let (pairs, bodies) = (self.pairs.len(), self.step.body_count as usize);
        alone.put("step", &[self.step]);
        alone.put("counters", &[self.control]);
        alone.put("next_pairs", &self.pairs);
        alone.put("manifolds", &self.manifolds);
        alone.put("aabbs", &self.aabbs);
        alone.put("batch_of_slot", &self.kept);
        alone.put("masks", &vec![0u32; 2 * bodies]);
        alone.put("claims", &vec![u32::MAX; bodies]);
        for name in ["pair_batch", "unplaced", "batch_keys", "batch_order"] {
            alone.put(name, &vec![0xdead_beef_u32; pairs]);
        }
        alone.put("dispatch_args", &[[7u32; 4]; 67]);
        let options = SortOptions { capacity: pairs as u32, count: Count::Word(PAIR_COUNT), bits: vec![8] };
        let sort = Sort::new(common::gpu(), &mut alone.pipelines, options).unwrap();
        let buffer = |name: &str| alone.buffers.buffer(name).unwrap().clone();
        let (keys, values, counts) = (buffer("batch_keys"), buffer("batch_order"), buffer("counters"));
        // A few workgroups too many, as an indirect dispatch may have.
        let (by_pair, by_body) = ((pairs as u32).div_ceil(256) + 1, (bodies as u32).div_ceil(256) + 1);
        alone.run(|chain| {
            chain.pass("batch", "begin", by_pair);
            for round in 0..limits::wide_rounds(self.step.batching) {
                chain.indexed("batch", "bid", ("round", round), by_pair);
                chain.indexed("batch", "place", ("round", round), by_pair);
            }
            chain.pass("batch", "compact", by_pair);
            if self.law() == batching::WRITE_AND_VERIFY {
                chain.pass("batch", "unclaim", by_body);
            }
            chain.pass("batch", "tail", 1);
            chain.pass("batch", "finish", by_pair);
            chain.pass("batch", "degree", by_body);
            sort.record(&mut chain.recorder, &keys, &values, Some(&counts)).unwrap();
            chain.pass("batch", "table", 1);
            chain.pass("batch", "gate", 1);
        });
        let words: Vec<u32> = alone.take("masks");
        Placed {
            of_pair: alone.take("pair_batch"),
            order: alone.take("batch_order"),
            masks: words.chunks_exact(2).map(|two| u64::from(two[0]) | u64::from(two[1]) << 32).collect(),
            control: alone.take("counters")[0],
            args: alone.take("dispatch_args"),
        }
    }

    /// Both sides, compared; and what the batches promise.
    fn check(&self, what: &str, alone: &mut Alone) -> Batches {
        let (cpu, gpu) = (self.on_cpu(), self.on_gpu(alone));
        let constraints = cpu.order.len();
        assert!(gpu.of_pair == cpu.of_pair, "{what}: batches");
        assert!(gpu.masks == cpu.masks, "{what}: masks");
        assert_eq!(gpu.control.batch_start[..65], cpu.start, "{what}");
        assert!(gpu.order[..constraints] == cpu.order, "{what}: order");
        let last_count = cpu.start[64] - cpu.start[63];
        let colored_as = batch::colored_as(&cpu, self.step.batching);
        let told = |c: &Control| [c.rounds, c.batch_count, c.max_degree, c.last_count, c.solved, c.unplaced];
        let (rounds, batch_count, max_degree) = (cpu.rounds, cpu.batch_count, cpu.max_degree);
        let expected = [rounds, batch_count, max_degree, last_count, constraints as u32, 0];
        assert_eq!(told(&gpu.control), expected, "{what}: rounds, batches, degree, last, solved, unplaced");
        assert_eq!(
            bytemuck::cast_ref::<_, [u32; size_of::<Control>() / 4]>(&gpu.control)[NEXT_COLORED_AS],
            colored_as,
            "{what}"
        );
        let stop = last_count > self.step.last_limit;
        let raised = [gpu.control.stop, gpu.control.overflow, gpu.control.needed];
        assert_eq!(raised, if stop { [1, overflow::LAST_BATCH, last_count] } else { [0; 3] }, "{what}");
        assert!(gpu.args == if stop { vec![[0; 4]; 67] } else { self.args(&cpu) }, "{what}: {:?}", gpu.args);

        let touching = (0..).zip(&self.manifolds).filter(|(_, m)| m.count > 0).map(|(i, _)| i);
        let mut ordered = cpu.order.clone();
        ordered.sort_unstable();
        assert!(touching.eq(ordered), "{what}: each constraint once");
        self.check_promises(what, &cpu);
        let head = |&pair: &u32| {
            let Pair { a, b, .. } = self.pairs[pair as usize];
            let body = |collider: u32| self.aabbs[collider as usize].body & aabb_body::INDEX;
            ConstraintHead { body_a: body(a), body_b: body(b), ..ConstraintHead::zeroed() }
        };
        let heads: Vec<_> = gpu.order[..constraints].iter().map(head).collect();
        let moving: Vec<_> = self.ends.iter().flat_map(|ends| [ends.a, ends.b]).collect();
        let moving: std::collections::HashSet<_> = moving.into_iter().collect();
        validate::batches(&heads, &gpu.control.batch_start[..65], |body| moving.contains(&body)).unwrap();
        cpu
    }

    /// Who keeps a batch stays there. Of those that took the lowest free batch, no lower one is free at the end, since
    /// batches only fill; nor a higher one, of those that come last. And no batch of write-and-verify is empty, since
    /// of all that wait the lowest hash wins.
    fn check_promises(&self, what: &str, cpu: &Batches) {
        let persists = self.control.colored_as == self.step.batching && self.law() == batching::PERSISTENT;
        let static_last = self.step.batching & batching::STATIC_LAST != 0;
        let (mut lowest, mut highest) = (0u64, 0u64);
        for (i, &batch) in cpu.of_pair.iter().enumerate().filter(|(_, batch)| **batch < LAST_BATCH) {
            let (pair, ends) = (self.pairs[i], self.ends[i]);
            let is_kept = persists && pair.kind & pair_kind::FRESH == 0 && self.kept[pair.slot as usize] < LAST_BATCH;
            let bodies = [ends.a, ends.b].into_iter().filter(|&body| body != NO_BODY);
            let taken = bodies.fold(0, |all, body| all | cpu.masks[body as usize]);
            let comes_last = static_last && (ends.a == NO_BODY || ends.b == NO_BODY);
            *if comes_last { &mut highest } else { &mut lowest } |= 1 << batch;
            let passed = if comes_last { (1 << LAST_BATCH) - (2 << batch) } else { (1 << batch) - 1 };
            if is_kept {
                assert_eq!(batch, self.kept[pair.slot as usize], "{what}: pair {i} stays");
            } else if self.law() != batching::WRITE_AND_VERIFY {
                assert_eq!(taken & passed, passed, "{what}: pair {i} in batch {batch} passed a free one");
            }
        }
        if self.law() == batching::WRITE_AND_VERIFY {
            let filled = lowest | highest.reverse_bits() >> 1;
            assert_eq!(filled.trailing_ones(), filled.count_ones(), "{what}: {lowest:b} and {highest:b}");
        }
    }

    fn law(&self) -> u32 {
        self.step.batching & batching::LAW
    }

    fn args(&self, cpu: &Batches) -> Vec<[u32; 4]> {
        let groups = |groups: u32| {
            let (x, y) = split(groups);
            [x, y, 1, 0]
        };
        let constraints = cpu.order.len() as u32;
        let mut args: Vec<_> = cpu.start.windows(2).map(|two| groups((two[1] - two[0]).div_ceil(64))).collect();
        args[63] = groups(u32::from(constraints > cpu.start[self.step.wide_batches as usize]));
        args.push(groups(constraints.div_ceil(256)));
        args.push(groups(self.control.pair_count.div_ceil(256)));
        args.push(groups(self.control.dead_count.max(self.control.new_count).div_ceil(256)));
        args
    }
}

#[test]
fn scenes_of_all_sizes_are_batched_alike() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    for bodies in [0, 1, 2, 255, 256, 257, 3000] {
        let mut cpu = Cpu::after(&scene_of(bodies), 40);
        let mut new_ones = 0;
        for _ in 0..3 {
            for (permute, alone) in alones.iter_mut().enumerate() {
                let what = format!("{bodies} bodies, step {}, permuted {permute}", cpu.number);
                let kept = Graph::of(&cpu, false).check(&what, alone);
                for way in WAYS {
                    let what = format!("{what}, anew in way {way}");
                    let anew = Graph::of(&cpu, false).way(way, true).check(&what, alone);
                    assert_eq!(bodies > 1, kept.rounds < anew.rounds, "{what}: most stay");
                }
                new_ones += kept.rounds;
            }
            let frame = cpu.plan(false);
            cpu.commit(&frame);
        }
        assert_eq!(bodies > 2, new_ones > 0, "{bodies} bodies: some come");
    }
}

#[test]
fn contacts_with_what_does_not_move_come_last() {
    let alone = &mut Alone::new(0);
    let cpu = Cpu::after(&scene_of(3000), 40);
    for law in LAWS {
        let first = Graph::of(&cpu, false).way(law, true).check("as they come", alone);
        let graph = Graph::of(&cpu, false).way(law | batching::STATIC_LAST, true);
        let last = graph.check("last", alone);
        let is_last = |&pair: &u32| {
            let ends = graph.ends[pair as usize];
            ends.a == NO_BODY || ends.b == NO_BODY
        };
        let count = last.order.iter().filter(|pair| is_last(pair)).count();
        assert!(count > 100 && last.start[63] == last.start[64], "{count} of law {law}, and no hub");
        assert!(last.order.is_sorted_by_key(is_last), "law {law}: in order");
        assert!(!first.order.is_sorted_by_key(is_last), "law {law}: it makes a difference");
        // A body is on no more than a few of them, and each takes at most one batch from the rest.
        assert!((first.batch_count..=first.batch_count + 4).contains(&last.batch_count), "law {law}: {last:?}");
    }
}

#[test]
fn a_hub_fills_its_batches_and_the_rest_goes_last() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut cpu = Cpu::new(&scenes::hub(500));
    for step in 0..3 {
        for (permute, alone) in alones.iter_mut().enumerate() {
            for way in WAYS {
                let what = format!("step {step}, permuted {permute}, way {way}");
                let found = Graph::of(&cpu, false).way(way, step == 0).check(&what, alone);
                if step == 0 {
                    let verifies = way & batching::LAW == batching::WRITE_AND_VERIFY;
                    let batches =
                        if verifies { 2 * limits::VERIFY_ROUNDS / limits::TRIES } else { limits::BATCH_ROUNDS };
                    // Write-and-verify fills others from above, where bodies of the hub do not move.
                    let most = if verifies && way & batching::STATIC_LAST != 0 { 63 } else { batches };
                    assert_eq!(found.rounds, limits::batch_rounds(way), "{what}");
                    assert!((batches..=most).contains(&found.batch_count), "{what}: {}", found.batch_count);
                    assert!(found.start[64] - found.start[63] > 400, "{what}");
                }
            }
        }
        let frame = cpu.plan(false);
        cpu.commit(&frame);
    }
}

#[test]
fn random_graphs_are_batched_alike() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    // The last one leaves so many to the one workgroup of the tail that it has fewer rounds for them.
    for (bodies, pairs) in [(2, 1), (300, 255), (300, 257), (3000, 40_000), (50_000, 20_000), (200, 200_000)] {
        for (permute, alone) in alones.iter_mut().enumerate() {
            // Large graphs take long: each way in one order.
            let ways = if pairs > 10_000 { &WAYS[2 * permute..][..2] } else { &WAYS };
            for &way in ways {
                let mut graph = Graph::random(bodies, pairs, 7).way(way, false);
                graph.step.last_limit = u32::MAX;
                let what = format!("{bodies} bodies, {pairs} pairs, permuted {permute}, way {way}");
                let cpu = graph.check(&what, alone);
                let cut = cpu.rounds < limits::batch_rounds(way) && cpu.start[63] < cpu.start[64];
                assert_eq!(pairs == 200_000, cut, "{what}");
                // And again, from the batches that those now have.
                let persists = way & batching::LAW == batching::PERSISTENT;
                if persists || pairs < 10_000 {
                    graph.kept = cpu.of_pair.clone();
                    let again = graph.check(&format!("{what}, kept"), alone);
                    assert!(persists || again.of_pair == cpu.of_pair, "{what}: nothing is kept");
                }
            }
        }
    }
}

#[test]
fn few_rounds_and_a_full_last_batch_stop_the_step() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    for (rounds, last_limit) in [(0, u32::MAX), (1, u32::MAX), (8, 100_000), (60, 100_000), (62, 100)] {
        for (permute, alone) in alones.iter_mut().enumerate() {
            for &way in &WAYS[2 * permute..][..2] {
                let mut graph = Graph::random(100, 20_000, 3).way(way, false);
                graph.step.batch_rounds = rounds;
                graph.step.last_limit = last_limit;
                graph.check(&format!("{rounds} rounds, permuted {permute}, way {way}"), alone);
            }
        }
    }
}

#[test]
fn what_was_kept_in_another_way_is_batched_anew() {
    let alone = &mut Alone::new(0);
    for way in WAYS {
        let fresh = Graph::random(300, 1000, 5).way(way, true).check("anew", alone).of_pair;
        for other in WAYS.into_iter().filter(|&other| other != way) {
            let mut graph = Graph::random(300, 1000, 5).way(way, true);
            graph.kept = Graph::random(300, 1000, 5).way(other, true).on_cpu().of_pair;
            graph.control.colored_as = other;
            assert!(graph.check(&format!("way {way} after {other}"), alone).of_pair == fresh, "{way} after {other}");
        }
    }
}

#[test]
fn waste_asks_for_new_colours() {
    // Pairs far apart keep batches of their own, so many that it takes one more to be a waste.
    let alone = &mut Alone::new(0);
    for (way, most) in [(batching::PERSISTENT, 2), (batching::PERSISTENT | batching::STATIC_LAST, 3)] {
        for count in [most, most + 1] {
            let mut graph = Graph::random(2 * count, count, 1).way(way, false);
            let pair = |i: u32| Pair { a: 2 * i, b: 2 * i + 1, slot: i, kind: pair_kind::BALL_BALL };
            graph.pairs = (0..count).map(pair).collect();
            graph.manifolds = vec![Manifold { count: 1, ..Manifold::zeroed() }; count as usize];
            graph.ends = graph.pairs.iter().map(|pair| Ends { a: pair.a, b: pair.b }).collect();
            graph.kept = (0..count).map(|i| 10 + 10 * i).collect();
            let cpu = graph.check("kept", alone);
            assert_eq!(cpu.batch_count, count, "batches that nobody is in are left out");
            assert_eq!(batch::wasteful(&cpu, way), count > most, "{count} batches");
            graph.control.colored_as = 0;
            let cpu = graph.check("anew", alone);
            assert_eq!(cpu.batch_count, 1);
        }
    }
}
