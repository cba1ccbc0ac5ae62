//! Stage `island` alone: labels of islands over contacts and joints, on the CPU, on the GPU in every order of invocations,
//! and by a flood fill.
//! Oracles: the flood fill (analysis) and the mirror; all three must agree exactly.

#[path = "common/alone.rs"]
#[expect(dead_code, reason = "this program uses a part")]
mod alone;
mod common;
#[path = "common/frame.rs"]
mod frame;

use std::collections::VecDeque;

use alone::Alone;
use bytemuck::Zeroable;
use frame::{Cpu, control_of, scene_of};
use tumble_core::layout::*;
use tumble_core::{Params, scenes};
use tumble_cpu::batch::{Ends, NO_BODY};
use tumble_cpu::bounds::moves;
use tumble_cpu::island::{self, NO_ISLAND};

const PERMUTATIONS: [u32; 3] = [0, 1, 2];

/// What the stage reads.
struct Graph {
    states: Vec<BodyState>,
    pairs: Vec<Pair>,
    manifolds: Vec<Manifold>,
    aabbs: Vec<Aabb>,
    ends: Vec<Ends>,
    /// Bodies with joints between them.
    joined: Vec<[u32; 2]>,
    control: Control,
    step: StepParams,
}

/// Numbers without pattern.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % u64::from(end)) as u32
    }

    fn shuffle<T>(&mut self, list: &mut [T]) {
        (1..list.len()).rev().for_each(|i| list.swap(i, self.below(i as u32 + 1) as usize));
    }
}

impl Graph {
    fn of(cpu: &Cpu) -> Self {
        let frame = cpu.plan(false);
        let control = control_of(&frame, false);
        let (states, pairs, manifolds) = (frame.states, frame.matched.pairs, frame.manifolds);
        let (aabbs, ends, joined) = (frame.aabbs, frame.ends, Vec::new());
        Self { states, pairs, manifolds, aabbs, ends, joined, control, step: frame.step }
    }

    /// Bodies that all move but those for which `still` says no, joined by `edges`, which touch.
    fn joined(bodies: u32, edges: &[[u32; 2]], still: impl Fn(u32) -> bool) -> Self {
        let flags = |body| if still(body) { body_flags::FIXED } else { body_flags::DYNAMIC };
        let state = |body| BodyState { flags: flags(body), ..BodyState::zeroed() };
        let flag = |body| aabb_body::LIVE | if still(body) { aabb_body::FIXED } else { aabb_body::DYNAMIC };
        let aabb = |body| Aabb { body: body | flag(body), ..Aabb::zeroed() };
        let end = |body| if still(body) { NO_BODY } else { body };
        let mut step = Params::default().step_params(1, tumble_core::glam::Vec3::ZERO);
        step.body_count = bodies;
        step.pair_capacity = edges.len() as u32;
        let pair = |(slot, &[a, b]): (usize, &[u32; 2])| Pair { a, b, slot: slot as u32, kind: pair_kind::BALL_BALL };
        Self {
            states: (0..bodies).map(state).collect(),
            pairs: edges.iter().enumerate().map(pair).collect(),
            manifolds: vec![Manifold { count: 1, ..Manifold::zeroed() }; edges.len()],
            aabbs: (0..bodies).map(aabb).collect(),
            ends: edges.iter().map(|&[a, b]| Ends { a: end(a), b: end(b) }).collect(),
            joined: Vec::new(),
            control: Control { pair_count: edges.len() as u32, ..Control::zeroed() },
            step,
        }
    }

    /// The same with a joint for every edge from `first` on, and no contact.
    fn with_joints(mut self, first: usize) -> Self {
        self.joined = self.pairs.split_off(first).iter().map(|pair| [pair.a, pair.b]).collect();
        self.manifolds.truncate(first);
        self.ends.truncate(first);
        self.control.pair_count = first as u32;
        self
    }

    /// `pairs` random pairs among `bodies` bodies, every tenth of which does not move; of the first half a third do not
    /// touch, the others are joints.
    fn random(bodies: u32, pairs: u32, seed: u64) -> Self {
        let mut random = Random(seed);
        let edge = |random: &mut Random| {
            let a = random.below(bodies);
            [a, (a + 1 + random.below(bodies - 1)) % bodies]
        };
        let edges: Vec<_> = (0..pairs).map(|_| edge(&mut random)).collect();
        let mut graph = Self::joined(bodies, &edges, |body| body % 10 == 9);
        graph.manifolds.iter_mut().for_each(|manifold| manifold.count = random.below(3));
        graph.with_joints(pairs as usize / 2)
    }

    fn on_gpu(&self, alone: &mut Alone) -> (Vec<u32>, Control) {
        alone.put("step", &[self.step]);
        alone.put("counters", &[self.control]);
        alone.put("work_states", &self.states);
        alone.put("next_pairs", &self.pairs);
        alone.put("manifolds", &self.manifolds);
        alone.put("aabbs", &self.aabbs);
        let mut joined = vec![[self.joined.len() as u32, 0]];
        joined.extend(&self.joined);
        // What an earlier, longer list left.
        joined.extend((!self.states.is_empty()).then(|| [0, self.states.len() as u32 - 1]));
        alone.put("joined", &joined);
        alone.put("islands", &vec![0xdead_beef_u32; self.states.len()]);
        // A few workgroups too many, as an indirect dispatch may have.
        let groups = |count: usize| (count as u32).div_ceil(256) + 1;
        let (by_pair, by_body) = (groups(self.pairs.len()), groups(self.states.len()));
        let by_joined = groups(self.joined.len());
        alone.run(|chain| {
            chain.pass("island", "begin", by_body);
            chain.pass("island", "hook", by_pair);
            chain.pass("island", "hook_joined", by_joined);
            chain.pass("island", "flatten", by_body);
            chain.pass("island", "count", by_body);
        });
        (alone.take("islands"), alone.take("counters")[0])
    }

    /// Labels by a flood from each body, the lowest first.
    fn flood(&self) -> Vec<u32> {
        let mut neighbours = vec![Vec::new(); self.states.len()];
        for (pair, _) in self.pairs.iter().zip(&self.manifolds).filter(|(_, manifold)| manifold.count > 0) {
            let [a, b] = [pair.a, pair.b].map(|c| self.aabbs[c as usize].body & aabb_body::INDEX);
            neighbours[a as usize].push(b);
            neighbours[b as usize].push(a);
        }
        for &[a, b] in &self.joined {
            neighbours[a as usize].push(b);
            neighbours[b as usize].push(a);
        }
        let mut labels = vec![NO_ISLAND; self.states.len()];
        for first in 0..labels.len() {
            let mut queue = VecDeque::from([first]);
            while let Some(body) = queue.pop_front() {
                if moves(self.states[body].flags) && labels[body] == NO_ISLAND {
                    labels[body] = first as u32;
                    queue.extend(neighbours[body].iter().map(|&next| next as usize));
                }
            }
        }
        labels
    }

    fn check(&self, what: &str, alone: &mut Alone) {
        let expected = self.flood();
        let cpu = island::label(&self.states, &self.manifolds, &self.ends, &self.joined);
        assert!(cpu == expected, "{what}: the CPU's labels differ");
        let (gpu, control) = self.on_gpu(alone);
        assert_eq!(control.islands_open, 0, "{what}: turns sufficed");
        assert!(gpu == expected, "{what}: the GPU's labels differ");
        let count = expected.iter().enumerate().filter(|(i, label)| **label == *i as u32).count();
        assert_eq!((control.islands, island::count(&cpu)), (count as u32, count as u32), "{what}: number of islands");
    }
}

#[test]
fn labels_of_scenes_are_the_flood_fills() {
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for bodies in [0, 1, 2, 255, 256, 257, 3000] {
            Graph::of(&Cpu::after(&scene_of(bodies), 40)).check(&format!("{bodies} bodies, {permute}"), &mut alone);
        }
        for (name, scene) in [("hub", scenes::hub(500)), ("pyramids", scenes::many_pyramids(5, 8))] {
            Graph::of(&Cpu::after(&scene, 2)).check(&format!("{name}, {permute}"), &mut alone);
        }
    }
}

#[test]
fn labels_of_random_graphs_are_the_flood_fills() {
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        // Around the threshold where one island swallows most (half a contact a body), below and above.
        for (seed, (bodies, pairs)) in
            [(2, 1), (10, 9), (1000, 400), (1000, 900), (1000, 5000), (20_000, 18_000)].into_iter().enumerate()
        {
            let what = format!("{bodies} bodies, {pairs} pairs, order {permute}");
            Graph::random(bodies, pairs, seed as u64 + 7).check(&what, &mut alone);
        }
    }
}

#[test]
fn long_and_wide_graphs_are_one_island_in_any_order() {
    const COUNT: u32 = 20_000;
    let side = 141;
    let rising: Vec<_> = (1..COUNT).map(|i| [i - 1, i]).collect();
    let falling: Vec<_> = rising.iter().rev().copied().collect();
    let star: Vec<_> = (0..COUNT - 1).map(|i| [i, COUNT - 1]).collect();
    let sheet: Vec<_> = (0..side * side)
        .flat_map(|i| [(i % side + 1 < side).then_some([i, i + 1]), (i + side < side * side).then_some([i, i + side])])
        .flatten()
        .collect();
    let mut random = Random(5);
    let mut names: Vec<u32> = (0..COUNT).collect();
    random.shuffle(&mut names);
    let renamed = |edges: &[[u32; 2]]| -> Vec<_> { edges.iter().map(|e| e.map(|i| names[i as usize])).collect() };
    let mut shuffled = renamed(&rising);
    random.shuffle(&mut shuffled);
    let lists = [
        ("a chain, rising", rising.clone()),
        ("a chain, falling", falling),
        ("a chain, bodies shuffled", renamed(&rising)),
        ("a chain, all shuffled", shuffled),
        ("a star", star),
        ("a sheet, bodies shuffled", renamed(&sheet)),
    ];
    for permute in PERMUTATIONS {
        let mut alone = Alone::new(permute);
        for (name, edges) in &lists {
            let all = || Graph::joined(COUNT, edges, |_| false);
            all().check(&format!("{name}, order {permute}"), &mut alone);
            all().with_joints(edges.len() / 3).check(&format!("{name}, joints too, order {permute}"), &mut alone);
        }
        // A body that does not move joins nothing.
        for joints in [rising.len(), 0] {
            let gap = Graph::joined(COUNT, &rising, |body| body == COUNT / 2).with_joints(joints);
            gap.check("a chain with a gap", &mut alone);
        }
    }
}
