//! Islands of one plan side by side: `island` in lanes, bit for bit. Heaps of figures, fleets of cars and rows of bridges
//! take a fraction of the time by it.

use super::frame_lanes::PoseLanes;
use super::island::{CHOICES, HALF, Scene, regularization};
use super::lanes::{M3, Q, inverse_inertia, is_some, masked, select, stiffening};
use super::plan::Plan;
use super::rows::breaks;
use super::rows_lanes::{BodyLanes, WorkLanes};
use super::units::Unit;
use super::{Part, begun, level_of};
use crate::math::vec3;
use crate::shared::Shared;
use crate::solver::lanes::{ROWS, START, columns};
use crate::solver::simd::{Lanes, V3};
use std::sync::Arc;
use tumble_core::layout::{JointIsland, JointState, SolverBody, StepParams};
use wide::f32x4;

/// Up to as many islands as there are lanes.
#[derive(Debug)]
pub(super) struct IslandLanes<L: Lanes> {
    plan: Arc<Plan>,
    /// The island of each lane.
    infos: Vec<JointIsland>,
    /// See [`Island`](super::island::Island). Lanes without an island have the bodies of the first one, and leave them.
    slots: Vec<L::Indices>,
    works: Vec<WorkLanes<L>>,
    bodies: Vec<BodyLanes<L>>,
    /// Rotation of each body when the step began, its inertia, and its inverse inertia.
    made_of: Vec<(Q<L>, [V3<L>; 2])>,
    diagonal: Vec<M3<L>>,
    upper: Vec<M3<L>>,
    lower: Vec<M3<L>>,
    values: Vec<V3<L>>,
    next: Vec<PoseLanes<L>>,
    remainders: Vec<[V3<L>; 2]>,
    /// The lanes that are solved at the level of sub-steps that runs.
    runs: L,
}

impl<L: Lanes> Unit for IslandLanes<L> {
    fn run(
        &mut self,
        part: Part,
        scene: &Scene<'_>,
        states: &[JointState],
        bodies: &Shared<'_, SolverBody>,
        step: &StepParams,
    ) {
        if part == Part::Begin {
            self.runs = L::ZERO;
            for (lane, info) in self.infos.iter().enumerate() {
                let runs = level_of(scene, info, bodies) == Some(step.level);
                self.runs.as_mut_array()[lane] = f32::from_bits(if runs { u32::MAX } else { 0 });
            }
        }
        if self.runs.as_array().iter().all(|runs| runs.to_bits() == 0) {
            return;
        }
        if part == Part::Begin {
            self.load(scene, states, step);
        }
        let rows = bodies.rows();
        L::run(
            #[inline(always)]
            || match part {
                Part::Begin => self.begin(&rows, step),
                Part::Solve => self.solve(&rows, step),
                _ => self.relax(&rows, step),
            },
        );
    }

    fn store(&mut self, scene: &Scene<'_>, states: &[JointState], step: &StepParams) -> Vec<(u32, JointState)> {
        let lanes: Vec<usize> =
            (0..self.infos.len()).filter(|&lane| self.runs.as_array()[lane].to_bits() != 0).collect();
        if lanes.is_empty() {
            return Vec::new();
        }
        let mut off = vec![[L::ZERO; 2]; self.works.len()];
        L::run(
            #[inline(always)]
            || {
                for (index, work) in self.works.iter_mut().enumerate() {
                    let [a, b] = self.plan.ends[index];
                    work.look(&self.bodies[a], &self.bodies[b]);
                    off[index] = work.off_by();
                }
            },
        );
        let mut all = Vec::with_capacity(lanes.len() * self.works.len());
        for lane in lanes {
            let first = self.infos[lane].first_joint as usize;
            for (index, work) in self.works.iter().enumerate() {
                let slot = scene.set.topology.joints[first + index];
                let joint = &scene.set.joints[slot as usize];
                let mut new = work.lasting(lane, off[index], begun(joint, states[slot as usize], step.h));
                new.broken |= u32::from(breaks(joint, &new));
                all.push((slot, new));
            }
        }
        all
    }
}

impl<L: Lanes> IslandLanes<L> {
    /// These islands, which are solved by this plan, and the slots of their bodies; no more than there are lanes.
    pub(super) fn new(plan: &Arc<Plan>, infos: Vec<JointIsland>, slots: &[Vec<u32>]) -> Self {
        let of_body = |body: usize| {
            let mut index = L::Indices::default();
            for (lane, to) in index.as_mut().iter_mut().enumerate() {
                *to = slots.get(lane).unwrap_or(&slots[0])[body];
            }
            index
        };
        let count = slots[0].len();
        Self {
            infos,
            slots: (0..count).map(of_body).collect(),
            works: Vec::new(),
            bodies: vec![BodyLanes::default(); count],
            made_of: vec![Default::default(); count],
            diagonal: vec![M3::default(); plan.blocks.len()],
            upper: vec![M3::default(); plan.entries.len()],
            lower: vec![M3::default(); plan.entries.len()],
            values: vec![V3::default(); plan.blocks.len()],
            next: vec![PoseLanes::default(); count],
            remainders: vec![Default::default(); plan.kinds.len()],
            runs: L::ZERO,
            plan: Arc::clone(plan),
        }
    }

    /// Puts joints and what bodies are made of into lanes.
    fn load(&mut self, scene: &Scene<'_>, states: &[JointState], step: &StepParams) {
        self.works.clear();
        self.works.extend(self.plan.kinds.iter().map(|&kind| WorkLanes::new(kind)));
        for lane in 0..L::COUNT {
            let first = self.infos.get(lane).unwrap_or(&self.infos[0]).first_joint as usize;
            for (index, work) in self.works.iter_mut().enumerate() {
                let slot = scene.set.topology.joints[first + index] as usize;
                let joint = &scene.set.joints[slot];
                let [a, b] = [joint.body_a, joint.body_b].map(|body| vec3(scene.states[body as usize].position));
                work.set(lane, joint, &begun(joint, states[slot], step.h), (b - a).to_array());
            }
        }
        for (index, made_of) in self.slots.iter().zip(&mut self.made_of) {
            for (lane, &slot) in index.as_ref().iter().enumerate() {
                let (state, props) = (&scene.states[slot as usize], &scene.props[slot as usize]);
                made_of.0.set(lane, state.rotation);
                made_of.1[0].set(lane, props.inertia);
                made_of.1[1].set(lane, props.inverse_inertia);
            }
        }
    }

    #[inline(always)]
    fn read(&mut self, rows: &Shared<'_, f32x4>) {
        // SAFETY: islands share no body that moves, and others are not written.
        let read = |i: usize| unsafe { rows.get(i) };
        for (k, body) in self.bodies.iter_mut().enumerate() {
            let index = self.slots[k];
            let [vx, vy, vz, inverse_mass] = columns::<L>(&read, index, 0);
            let [wx, wy, wz, _] = columns::<L>(&read, index, 1);
            let [x, y, z, _] = columns::<L>(&read, index, 2);
            let delta = Q::new(columns::<L>(&read, index, 3));
            let ([xx, yy, zz, _], [xy, xz, yz, _]) = (columns::<L>(&read, index, 4), columns::<L>(&read, index, 5));
            body.linear = V3::new(vx, vy, vz);
            body.angular = V3::new(wx, wy, wz);
            body.inverse_mass = inverse_mass;
            body.inverse_inertia = M3::symmetric(V3::new(xx, yy, zz), V3::new(xy, xz, yz));
            body.pose.translation = V3::new(x, y, z);
            body.pose.rotation = delta.times(self.made_of[k].0).normalized();
        }
    }

    /// Puts bodies back: velocities where `moves` is set, inertia and poses where `turns` is.
    #[inline(always)]
    fn write(&self, rows: &Shared<'_, f32x4>, moves: bool, inertia: bool, poses: bool) {
        // SAFETY: islands share no body that moves, and others are not written.
        let read = |i: usize| unsafe { rows.get(i) };
        for (k, body) in self.bodies[..self.plan.moved()].iter().enumerate() {
            let index = self.slots[k];
            let writes = self.runs & body.inverse_mass.simd_gt(L::ZERO);
            let [vx, vy, vz, _] = columns::<L>(&read, index, 0);
            let [wx, wy, wz, touched] = columns::<L>(&read, index, 1);
            let [lx, ly, lz, weight] = columns::<L>(&read, index, START);
            let [ax, ay, az, weighted] = columns::<L>(&read, index, START + 1);
            let linear = V3::new(lx, ly, lz) + (body.linear - V3::new(vx, vy, vz));
            let mut angular = V3::new(ax, ay, az) + (body.angular - V3::new(wx, wy, wz));
            let (v, w) = (body.linear, body.angular);
            if moves {
                put(rows, index, writes, 0, [v.x, v.y, v.z, body.inverse_mass]);
                put(rows, index, writes, 1, [w.x, w.y, w.z, touched]);
                put(rows, index, writes, START, [linear.x, linear.y, linear.z, weight]);
            }
            if inertia {
                let ([xx, yy, zz, level], [xy, xz, yz, parts]) =
                    (columns::<L>(&read, index, 4), columns::<L>(&read, index, 5));
                let before = M3::symmetric(V3::new(xx, yy, zz), V3::new(xy, xz, yz));
                let carried = w - angular;
                let turned = w - body.inverse_inertia.times(before.inverse().times(carried));
                angular = select(before.determinant().simd_gt(L::ZERO) & is_some(carried), turned, angular);
                let [x, y, z] = body.inverse_inertia.0;
                put(rows, index, writes, 4, [x.x, y.y, z.z, level]);
                put(rows, index, writes, 5, [x.y, x.z, y.z, parts]);
            }
            put(rows, index, writes, START + 1, [angular.x, angular.y, angular.z, weighted]);
            if poses {
                let [.., eigenvalue] = columns::<L>(&read, index, 2);
                let at = body.pose.translation;
                put(rows, index, writes, 2, [at.x, at.y, at.z, eigenvalue]);
                let delta = body.pose.rotation.times(self.made_of[k].0.conjugate()).normalized();
                put(rows, index, writes, 3, [delta.imaginary.x, delta.imaginary.y, delta.imaginary.z, delta.w]);
            }
        }
    }

    #[inline(always)]
    fn begin(&mut self, rows: &Shared<'_, f32x4>, step: &StepParams) {
        self.read(rows);
        self.stiffen(step.h);
        for (index, work) in self.works.iter_mut().enumerate() {
            let [a, b] = self.plan.ends[index];
            let [a, b] = [&self.bodies[a], &self.bodies[b]];
            work.refresh(a, b);
            work.carry_impulses(HALF);
            work.choose(a, b, step.h, HALF);
            work.rebuild(a, b);
        }
        self.factor();
        self.write(rows, false, true, false);
    }

    #[inline(always)]
    fn solve(&mut self, rows: &Shared<'_, f32x4>, step: &StepParams) {
        self.read(rows);
        for (next, body) in self.next.iter_mut().zip(&self.bodies) {
            *next = body.predicted(step.h);
        }
        let mut changed = L::ZERO;
        for (index, work) in self.works.iter_mut().enumerate() {
            let [a, b] = self.plan.ends[index];
            let next = [&self.next[a], &self.next[b]];
            let [a, b] = [&self.bodies[a], &self.bodies[b]];
            work.look(a, b);
            changed = changed | work.choose(a, b, step.h, HALF);
            work.forget_impulses();
            self.remainders[index] = work.remainders([a, b], next, step.h);
        }
        let mut goes_on = self.runs;
        for choice in 0..CHOICES {
            if (changed & goes_on).any() {
                for (index, work) in self.works.iter_mut().enumerate() {
                    let [a, b] = self.plan.ends[index];
                    let [a, b] = [&self.bodies[a], &self.bodies[b]];
                    work.rebuild(a, b);
                }
                // In lanes where nothing changed, it gives what was there.
                self.factor();
            }
            self.push_fixed(goes_on);
            self.solve_rows(false, goes_on);
            changed = L::ZERO;
            if choice + 1 < CHOICES {
                for (index, work) in self.works.iter_mut().enumerate() {
                    let [a, b] = self.plan.ends[index];
                    let [a, b] = [&self.bodies[a], &self.bodies[b]];
                    changed = changed | work.choose(a, b, step.h, HALF);
                }
            }
            goes_on = goes_on & changed;
            if !goes_on.any() {
                break;
            }
        }
        self.write(rows, true, false, false);
    }

    #[inline(always)]
    fn relax(&mut self, rows: &Shared<'_, f32x4>, step: &StepParams) {
        self.read(rows);
        for work in &mut self.works {
            work.keep_impulses();
            work.forget_impulses();
        }
        self.stiffen(step.h);
        for (index, work) in self.works.iter_mut().enumerate() {
            let [a, b] = self.plan.ends[index];
            let [a, b] = [&self.bodies[a], &self.bodies[b]];
            work.refresh(a, b);
        }
        self.factor();
        self.project();
        self.push_fixed(self.runs);
        self.solve_rows(true, self.runs);
        for work in &mut self.works {
            work.add_impulses();
        }
        self.write(rows, true, true, true);
    }

    #[inline(always)]
    fn stiffen(&mut self, h: f32) {
        for (k, body) in self.bodies[..self.plan.moved()].iter_mut().enumerate() {
            let mut more = M3::default();
            for &end in self.plan.at(k) {
                let work = &self.works[end / 2];
                let arm = body.pose.rotation.rotate(work.anchor(end & 1));
                let impulse = if end & 1 == 1 { work.impulse } else { L::splat(-1.0) * work.impulse };
                more = more.plus(stiffening(arm, impulse, h));
            }
            let new = inverse_inertia(&body.pose.rotation.matrix(), &self.made_of[k].1, more);
            let pushed = body.inverse_mass.simd_eq(L::ZERO);
            for (to, new) in body.inverse_inertia.0.iter_mut().zip(new.0) {
                *to = select(pushed, *to, new);
            }
        }
    }

    #[inline(always)]
    fn factor(&mut self) {
        let plan = &*self.plan;
        for (k, block) in plan.blocks.iter().enumerate() {
            let [a, b] = plan.ends[block.joint];
            let [a, b] = [&self.bodies[a], &self.bodies[b]];
            let more = regularization(plan.kinds[block.joint][1]);
            let own = &self.works[block.joint].blocks[block.which];
            let mut diagonal = own.diagonal(block.which, a, b, more);
            for &[row, column] in &plan.terms[block.terms.clone()] {
                diagonal = diagonal.minus(self.lower[row].matrix(self.upper[column].transpose()));
            }
            let inverse = diagonal.inverse();
            self.diagonal[k] = inverse;
            for index in block.entries.clone() {
                let entry = &plan.entries[index];
                let row = &plan.blocks[entry.row];
                let mut value = M3::default();
                for shared in &entry.shared {
                    let to = &self.works[row.joint].blocks[row.which];
                    let inverse_mass = self.bodies[shared.body].inverse_mass;
                    value = value.plus(to.coupling(own, [row.which, block.which], shared.second, inverse_mass));
                }
                for &[row, column] in &plan.terms[entry.terms.clone()] {
                    value = value.minus(self.lower[row].matrix(self.upper[column].transpose()));
                }
                self.upper[index] = value;
                self.lower[index] = value.matrix(inverse);
            }
        }
    }

    /// Forward and back substitution of what is in `values`.
    #[inline(always)]
    fn substitute(&mut self) {
        let plan = &*self.plan;
        for (k, block) in plan.blocks.iter().enumerate() {
            let mut value = self.values[k];
            for &[entry, column] in &plan.rows[block.rows.clone()] {
                value = value - self.lower[entry].times(self.values[column]);
            }
            self.values[k] = value;
        }
        for (k, block) in plan.blocks.iter().enumerate().rev() {
            let mut value = self.diagonal[k].times(self.values[k]);
            for entry in block.entries.clone() {
                value = value - self.lower[entry].back(self.values[plan.entries[entry].row]);
            }
            self.values[k] = value;
        }
    }

    #[inline(always)]
    fn solve_rows(&mut self, relax: bool, goes_on: L) {
        for (k, block) in self.plan.blocks.iter().enumerate() {
            let [a, b] = self.plan.ends[block.joint];
            let [a, b] = [&self.bodies[a], &self.bodies[b]];
            let lack = self.works[block.joint].lack(block.which, a, b, relax);
            self.values[k] = if relax { lack } else { lack - self.remainders[block.joint][block.which] };
        }
        self.substitute();
        for (block, &value) in self.plan.blocks.iter().zip(&self.values) {
            let block = &mut self.works[block.joint].blocks[block.which];
            block.push = masked(goes_on, value);
            block.impulse = block.impulse + block.push;
        }
        for (k, body) in self.bodies[..self.plan.moved()].iter_mut().enumerate() {
            for &end in self.plan.at(k) {
                self.works[end / 2].push(end & 1 == 1, body.inverse_mass, &mut body.linear, &mut body.angular);
            }
        }
    }

    #[inline(always)]
    fn push_fixed(&mut self, goes_on: L) {
        for work in &mut self.works {
            work.fix(goes_on);
        }
        for (k, body) in self.bodies[..self.plan.moved()].iter_mut().enumerate() {
            for &end in self.plan.at(k) {
                if self.works[end / 2].fixes() {
                    self.works[end / 2].push_fixed(end & 1 == 1, body);
                }
            }
        }
    }

    #[inline(always)]
    fn project(&mut self) {
        for (k, block) in self.plan.blocks.iter().enumerate() {
            let off = self.works[block.joint].off(block.which);
            self.values[k] = V3::new(-off.x, -off.y, -off.z);
        }
        self.substitute();
        for (block, &value) in self.plan.blocks.iter().zip(&self.values) {
            self.works[block.joint].blocks[block.which].push = value;
        }
        for (k, body) in self.bodies[..self.plan.moved()].iter_mut().enumerate() {
            let (mut way, mut turn) = (V3::default(), V3::default());
            for &end in self.plan.at(k) {
                self.works[end / 2].push(end & 1 == 1, body.inverse_mass, &mut way, &mut turn);
            }
            let (moved, was, moves) = (body.pose.moved(way, turn), body.pose, body.inverse_mass.simd_gt(L::ZERO));
            body.pose.translation = select(moves, moved.translation, was.translation);
            body.pose.rotation.imaginary = select(moves, moved.rotation.imaginary, was.rotation.imaginary);
            body.pose.rotation.w = moves.bitselect(moved.rotation.w, was.rotation.w);
        }
    }
}

/// Puts a row of bodies back in the lanes that are set.
#[inline(always)]
fn put<L: Lanes>(rows: &Shared<'_, f32x4>, index: L::Indices, writes: L, row: usize, columns: [L; 4]) {
    let all = L::rows(columns);
    for (lane, &slot) in index.as_ref().iter().enumerate() {
        if writes.as_array()[lane].to_bits() != 0 {
            // SAFETY: islands share no body that moves.
            unsafe { rows.set(ROWS * slot as usize + row, all.as_ref()[lane]) };
        }
    }
}
