//! One step on the CPU, pass by pass, so that a test can take what any pass reads and what it should write.

use bytemuck::Zeroable;
use tumble_core::glam::Vec3;
use tumble_core::layout::*;
use tumble_core::{PackedScene, Params, Scene, Solver, limits, scenes};
use tumble_cpu::batch::{self, Batches, Ends};
use tumble_cpu::broadphase::{Boxes, brute_force};
use tumble_cpu::contact::{self, Matched, NO_FEATURE};
use tumble_cpu::solver::prepare::{Contact, prepare_body, prepare_constraint, scale};
use tumble_cpu::solver::{Bodies, PlainRows, solve_plain, split, store};
use tumble_cpu::{bounds, continuous, motion, narrowphase};

/// What lives from step to step.
pub(crate) struct Cpu {
    pub(crate) params: Params,
    pub(crate) number: u32,
    pub(crate) gravity: Vec3,
    pub(crate) states: Vec<BodyState>,
    pub(crate) props: Vec<BodyProps>,
    pub(crate) colliders: Vec<Collider>,
    pub(crate) pairs: Vec<Pair>,
    free: Vec<u32>,
    /// By slot.
    pub(crate) batch_of_slot: Vec<u32>,
    /// Four a slot.
    pub(crate) impulses: Vec<Impulse>,
    /// By slot.
    pub(crate) memory: Vec<ManifoldMemory>,
    pub(crate) found: Vec<FoundManifold>,
}

/// What one step makes before anything is solved.
pub(crate) struct Frame {
    pub(crate) step: StepParams,
    pub(crate) states: Vec<BodyState>,
    pub(crate) aabbs: Vec<Aabb>,
    pub(crate) matched: Matched,
    pub(crate) manifolds: Vec<Manifold>,
    pub(crate) ends: Vec<Ends>,
    pub(crate) batches: Batches,
}

impl Frame {
    /// Whether the last batch is solved by mass splitting.
    pub(crate) fn splits_last(&self) -> bool {
        self.step.batching & batching::SPLIT_LAST != 0
    }

    /// Its constraints.
    pub(crate) fn last_batch(&self) -> std::ops::Range<usize> {
        let last = LAST_BATCH as usize;
        self.batches.start[last] as usize..self.batches.start[last + 1] as usize
    }
}

/// A scene of so many bodies in all, some of them fixed.
pub(crate) fn scene_of(bodies: usize) -> Scene {
    let fixed = scenes::mixed(0).len();
    match bodies {
        0 => Scene::new(),
        1 => scenes::free_box().0,
        2 => scenes::column(1),
        _ => scenes::mixed(bodies - fixed),
    }
}

impl Cpu {
    /// The scene, and in it something of everything: forces, damping, bounces, resistance, belts, locked axes, kinematic
    /// and frozen bodies.
    pub(crate) fn new(scene: &Scene) -> Self {
        let packed = PackedScene::new(scene).unwrap();
        let mut cpu = Self {
            params: Params::default(),
            number: 0,
            gravity: packed.gravity,
            states: packed.states,
            props: packed.props,
            colliders: packed.colliders,
            pairs: Vec::new(),
            free: Vec::new(),
            batch_of_slot: Vec::new(),
            impulses: Vec::new(),
            memory: Vec::new(),
            found: Vec::new(),
        };
        let room = limits::initial_pairs(&cpu.params.capacities, cpu.colliders.len() as u32);
        cpu.free = (0..room).rev().collect();
        cpu.batch_of_slot = vec![UNBATCHED; room as usize];
        cpu.found = vec![FoundManifold::zeroed(); room as usize];
        cpu.memory = vec![ManifoldMemory::default(); room as usize];
        cpu.impulses = vec![Impulse { normal: 0.0, tangent: [0.0; 2], feature: NO_FEATURE }; 4 * room as usize];
        for (i, (state, props)) in cpu.states.iter_mut().zip(&mut cpu.props).enumerate() {
            if state.flags != body_flags::DYNAMIC {
                continue;
            }
            props.linear_damping = if i % 11 == 5 { 0.3 } else { 0.0 };
            props.angular_damping = if i % 7 == 2 { 0.8 } else { 0.0 };
            props.locked = if i % 6 == 4 { (i / 6) as u32 % 64 } else { 0 };
            if i % 41 == 20 {
                state.flags = body_flags::KINEMATIC;
                state.linear_velocity = [0.1, 0.02, -0.1];
                state.angular_velocity = [0.3, 1.0, 0.2];
            } else if i % 53 == 30 {
                state.flags |= body_flags::FROZEN;
                state.linear_velocity = [0.0; 3];
            }
        }
        for (i, collider) in cpu.colliders.iter_mut().enumerate() {
            collider.restitution = [0.0, 0.6, 0.0, 0.3][i % 4];
            collider.combine = (i as u32 / 2) % 16;
            collider.rolling_resistance = [0.0, 0.1, 0.0, 0.0, 0.4][i % 5];
            collider.twisting_resistance = [0.0, 0.0, 0.2, 0.0][i % 4];
            collider.surface_velocity = [[0.0; 3], [0.0; 3], [0.6, 0.1, -0.3]][i % 3];
        }
        cpu
    }

    /// The scene after so many steps.
    pub(crate) fn after(scene: &Scene, steps: u32) -> Self {
        Self::after_by(Solver::default(), scene, steps)
    }

    /// The same by this solver.
    pub(crate) fn after_by(solver: Solver, scene: &Scene, steps: u32) -> Self {
        Self::after_with(Params { solver, ..Params::default() }, scene, steps)
    }

    /// The same with these parameters.
    pub(crate) fn after_with(params: Params, scene: &Scene, steps: u32) -> Self {
        let mut cpu = Self::new(scene);
        cpu.params = params;
        for _ in 0..steps {
            let frame = cpu.plan(false);
            cpu.commit(&frame);
        }
        cpu
    }

    /// The next step's plan phase.
    pub(crate) fn plan(&self, recolor: bool) -> Frame {
        let mut step = self.params.step_params(self.number + 1, self.gravity);
        step.body_count = self.states.len() as u32;
        step.collider_count = self.colliders.len() as u32;
        step.cell_table_bits = limits::cell_table_bits(step.collider_count);
        step.large_limit = limits::large_limit(step.collider_count, false);
        step.pair_capacity = self.batch_of_slot.len() as u32;
        step.wide_batches = 8;
        let mut states = self.states.clone();
        for (i, state) in states.iter_mut().enumerate().filter(|(i, s)| i % 9 == 7 && bounds::moves(s.flags)) {
            state.force = [3.0 * (i % 5) as f32, -1.5, 200.0];
            state.torque = [10.0, 0.5 * (i % 3) as f32, -20.0];
        }
        let body = |collider: u32| self.colliders[collider as usize].body;
        let aabbs: Vec<_> = self
            .colliders
            .iter()
            .map(|c| bounds::collider_bounds(c, &states[c.body as usize], &self.props[c.body as usize], &step))
            .collect();
        let found = brute_force::find_pairs(&Boxes::new(&aabbs), u32::MAX);
        let matched = contact::match_pairs(&self.pairs, &found.pairs, &self.colliders, &[], &self.free, step.step);
        let collide =
            |pair: &Pair| narrowphase::collide(pair, &self.colliders, &states, &self.found[pair.slot as usize], &step);
        let manifolds: Vec<_> = matched.pairs.iter().map(collide).collect();
        let ends: Vec<_> = matched.pairs.iter().map(|pair| batch::ends(pair, &body, &states)).collect();
        let kept = &self.batch_of_slot;
        let batches = batch::place(&matched.pairs, &manifolds, &ends, kept, recolor, states.len(), &step);
        Frame { step, states, aabbs, matched, manifolds, ends, batches }
    }

    pub(crate) fn bodies(&self, frame: &Frame) -> Vec<SolverBody> {
        let bodies = frame.states.iter().zip(&self.props).zip(&frame.batches.masks);
        let mut bodies: Vec<_> =
            bodies.map(|((state, props), mask)| prepare_body(state, props, *mask, &frame.step)).collect();
        if frame.splits_last() {
            let ends = frame.last_batch().map(|c| {
                let pair = &frame.matched.pairs[frame.batches.order[c] as usize];
                [pair.a, pair.b].map(|collider| self.colliders[collider as usize].body as usize)
            });
            split::count_parts(&mut bodies, ends);
        }
        bodies
    }

    pub(crate) fn rows(&self, frame: &Frame, bodies: &[SolverBody]) -> PlainRows {
        let mut rows = PlainRows::build(0..frame.batches.order.len(), |c| {
            prepare_constraint(&self.contact(frame, c), &self.colliders, bodies, &frame.states, &frame.step)
        });
        if frame.splits_last() {
            rows.split_last(frame.last_batch().len(), bodies);
        }
        rows
    }

    /// What constraint c of the frame is made of.
    pub(crate) fn contact<'a>(&'a self, frame: &'a Frame, c: usize) -> Contact<'a> {
        let index = frame.batches.order[c] as usize;
        let pair = &frame.matched.pairs[index];
        let stored = &self.impulses[4 * pair.slot as usize..][..4];
        let memory = &self.memory[pair.slot as usize];
        let [a, b] = [pair.a, pair.b].map(|c| &frame.states[self.colliders[c as usize].body as usize]);
        let split = frame.splits_last() && frame.last_batch().contains(&c);
        Contact { pair, manifold: &frame.manifolds[index], stored, memory, scale: scale(a, b, frame.step.h), split }
    }

    /// Impulses by slot as they are after `rows` were solved; slots without a constraint stay as they are.
    pub(crate) fn stored(&self, frame: &Frame, rows: &PlainRows) -> Vec<Impulse> {
        let mut impulses = self.impulses.clone();
        for (c, &index) in frame.batches.order.iter().enumerate() {
            let slot = frame.matched.pairs[index as usize].slot as usize;
            for point in 0..4 {
                impulses[4 * slot + point] = store::store(&frame.manifolds[index as usize], point, &rows.solved(c));
            }
        }
        impulses
    }

    /// The same of what slots remember of manifolds.
    pub(crate) fn remembered(&self, frame: &Frame, rows: &PlainRows) -> Vec<ManifoldMemory> {
        let mut memory = self.memory.clone();
        for (c, &index) in frame.batches.order.iter().enumerate() {
            let slot = frame.matched.pairs[index as usize].slot as usize;
            memory[slot] = store::store_memory(&frame.manifolds[index as usize], &rows.solved(c));
        }
        memory
    }

    /// The share of its way that each body may go.
    pub(crate) fn shares(&self, frame: &Frame, bodies: &[SolverBody]) -> Vec<f32> {
        let mut shares = vec![1f32; bodies.len()];
        let short = |pair| continuous::share(pair, &self.colliders, &frame.states, bodies);
        for (body, share) in frame.matched.pairs.iter().filter_map(short) {
            shares[body as usize] = shares[body as usize].min(share);
        }
        shares
    }

    /// Solves the step and keeps its result.
    pub(crate) fn commit(&mut self, frame: &Frame) {
        let mut bodies = self.bodies(frame);
        let mut rows = self.rows(frame, &bodies);
        let moving = Bodies { solver: &mut bodies, states: &frame.states, props: &self.props };
        solve_plain(&mut rows, moving, &frame.step, true);
        contact::commit_free(&mut self.free, &frame.matched);
        for ((pair, manifold), batch) in frame.matched.pairs.iter().zip(&frame.manifolds).zip(&frame.batches.of_pair) {
            let slot = pair.slot as usize;
            if manifold.recycled == 0 {
                let rotation = |c: u32| frame.states[self.colliders[c as usize].body as usize].rotation;
                let (rotation_a, rotation_b) = (rotation(pair.a), rotation(pair.b));
                self.found[slot] = FoundManifold { rotation_a, rotation_b, manifold: *manifold };
            }
            let impulses = &mut self.impulses[4 * slot..][..4];
            contact::commit_pair(manifold, *batch, &mut self.batch_of_slot[slot], impulses);
        }
        self.impulses = self.stored(frame, &rows);
        self.memory = self.remembered(frame, &rows);
        let shares = self.shares(frame, &bodies);
        let ends = bodies.iter().zip(&frame.states).zip(&shares);
        self.states = ends.map(|((body, state), share)| motion::commit(body, state, *share, &frame.step).0).collect();
        self.pairs = frame.matched.pairs.clone();
        self.number += 1;
    }
}

/// A control block with what the passes after the narrow phase read.
pub(crate) fn control_of(frame: &Frame, recolor: bool) -> Control {
    let colored_as = if recolor { 0 } else { frame.step.batching };
    let mut control = Control { colored_as, ..Control::zeroed() };
    control.pair_count = frame.matched.pairs.len() as u32;
    control.new_count = frame.matched.new_count;
    control.dead_count = frame.matched.dead_slots.len() as u32;
    control
}
