//! Stage `batch` alone: the GPU places every constraint exactly where the CPU does, in every order of invocations.
//! Oracles: the mirror, and `validate::batches`, which asks whether a batch is one.

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
/// Words of `Control` that the passes use: the number of pairs, and whether the next step colours anew.
const PAIR_COUNT: u32 = 8;
const RECOLOR_NEXT: usize = 31;

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
        let control = Control { pair_count: pairs, ..Control::zeroed() };
        Self { pairs: list, manifolds, aabbs: (0..bodies).map(aabb).collect(), ends, kept, control, step }
    }

    fn on_cpu(&self) -> Batches {
        let (recolor, bodies) = (self.control.recolor != 0, self.step.body_count as usize);
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
            for round in 0..limits::WIDE_ROUNDS {
                chain.indexed("batch", "bid", ("round", round), by_pair);
                chain.indexed("batch", "place", ("round", round), by_pair);
            }
            chain.pass("batch", "compact", by_pair);
            chain.pass("batch", "tail", 1);
            chain.pass("batch", "finish", by_pair);
            chain.pass("batch", "degree", by_body);
            sort.record(&mut chain.recorder, &keys, &values, Some(&counts)).unwrap();
            chain.pass("batch", "table", by_pair);
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
        let recolor = u32::from(batch::wasteful(cpu.batch_count, cpu.max_degree));
        let told = |c: &Control| [c.rounds, c.batch_count, c.max_degree, c.last_count, c.solved, c.unplaced];
        let (rounds, batch_count, max_degree) = (cpu.rounds, cpu.batch_count, cpu.max_degree);
        let expected = [rounds, batch_count, max_degree, last_count, constraints as u32, 0];
        assert_eq!(told(&gpu.control), expected, "{what}: rounds, batches, degree, last, solved, unplaced");
        assert_eq!(bytemuck::cast_ref::<_, [u32; 120]>(&gpu.control)[RECOLOR_NEXT], recolor, "{what}");
        let stop = last_count > self.step.last_limit;
        let raised = [gpu.control.stop, gpu.control.overflow, gpu.control.needed];
        assert_eq!(raised, if stop { [1, overflow::LAST_BATCH, last_count] } else { [0; 3] }, "{what}");
        assert!(gpu.args == if stop { vec![[0; 4]; 67] } else { self.args(&cpu) }, "{what}: {:?}", gpu.args);

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
                let anew = Graph::of(&cpu, true).check(&format!("{what}, anew"), alone);
                assert_eq!(bodies > 1, kept.rounds < anew.rounds, "{what}: most stay");
                new_ones += kept.rounds;
            }
            let frame = cpu.plan(false);
            cpu.commit(&frame);
        }
        assert_eq!(bodies > 2, new_ones > 0, "{bodies} bodies: some come");
    }
}

#[test]
fn a_hub_fills_its_batches_and_the_rest_goes_last() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut cpu = Cpu::new(&scenes::hub(500));
    for step in 0..3 {
        for (permute, alone) in alones.iter_mut().enumerate() {
            let what = format!("step {step}, permuted {permute}");
            let cpu = Graph::of(&cpu, false).check(&what, alone);
            if step == 0 {
                assert_eq!((cpu.rounds, cpu.batch_count), (limits::BATCH_ROUNDS, limits::BATCH_ROUNDS), "{what}");
                assert!(cpu.start[64] - cpu.start[63] > 400, "{what}");
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
            let mut graph = Graph::random(bodies, pairs, 7);
            graph.step.last_limit = u32::MAX;
            let what = format!("{bodies} bodies, {pairs} pairs, permuted {permute}");
            let cpu = graph.check(&what, alone);
            assert_eq!(pairs == 200_000, cpu.rounds < limits::BATCH_ROUNDS && cpu.start[63] < cpu.start[64], "{what}");
            // And again, from the batches that those now have.
            graph.kept = cpu.of_pair;
            graph.check(&format!("{what}, kept"), alone);
        }
    }
}

#[test]
fn few_rounds_and_a_full_last_batch_stop_the_step() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    for (rounds, last_limit) in [(0, u32::MAX), (1, u32::MAX), (8, 100_000), (62, 100)] {
        for (permute, alone) in alones.iter_mut().enumerate() {
            let mut graph = Graph::random(100, 20_000, 3);
            graph.step.batch_rounds = rounds;
            graph.step.last_limit = last_limit;
            graph.check(&format!("{rounds} rounds, permuted {permute}"), alone);
        }
    }
}

#[test]
fn waste_asks_for_new_colours() {
    // Two far apart pairs keep batches 20 and 40.
    let mut graph = Graph::random(8, 2, 1);
    graph.pairs = vec![Pair { a: 0, b: 1, slot: 0, kind: 1 }, Pair { a: 2, b: 3, slot: 1, kind: 1 }];
    graph.manifolds = vec![Manifold { count: 1, ..Manifold::zeroed() }; 2];
    graph.ends = vec![Ends { a: 0, b: 1 }, Ends { a: 2, b: 3 }];
    graph.kept = vec![20, 40];
    let alone = &mut Alone::new(0);
    let cpu = graph.check("kept", alone);
    assert!(batch::wasteful(cpu.batch_count, cpu.max_degree));
    graph.control.recolor = 1;
    let cpu = graph.check("anew", alone);
    assert_eq!(cpu.batch_count, 1);
}
