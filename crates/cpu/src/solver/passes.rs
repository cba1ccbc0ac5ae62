//! The passes of a step over rows in groups side by side, by all threads inside one parallel section.
//!
//! A sweep is a stage a batch, since batches may share bodies. Batches too small to be cut lie one behind the other and
//! are worked off as one block: handing each to the next thread costs more than it gives.

use super::lanes::{BodyLanes, ConstraintLanes, Weights};
use super::simd::Lanes;
use super::{
    Bodies, Pass, Rows, Visit, gauss_seidel_lanes, jacobi_lanes, one_pass_lanes, penalty_lanes, soft_lanes, takes_part,
};
use crate::joint::Running;
use crate::shared::Shared;
use crate::workers::{block_of, blocks, run_stages};
use std::ops::Range;
use std::sync::Mutex;
use tumble_core::layout::{LAST_BATCH, StepParams};
use wide::f32x4;

/// Fewest groups of a block.
const GROUPS: usize = 8;
/// Fewest bodies of a block.
const BODIES: usize = 128;

/// Groups that are worked off together: of one batch, or of several and then in one block.
struct Part {
    groups: Range<usize>,
    blocks: u32,
    /// The last batch comes behind.
    last: bool,
}

/// The stages of one sweep.
fn parts(rows: &Rows) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    for batch in 0..LAST_BATCH as usize {
        let groups = rows.group_start[batch]..rows.group_start[batch + 1];
        if groups.is_empty() {
            continue;
        }
        let count = blocks(groups.len(), GROUPS);
        match parts.last_mut() {
            Some(part) if part.blocks == 1 && count == 1 => part.groups.end = groups.end,
            _ => parts.push(Part { groups, blocks: count, last: false }),
        }
    }
    if !rows.last.heads.is_empty() {
        match parts.last_mut() {
            Some(part) if part.blocks == 1 => part.last = true,
            _ => parts.push(Part { groups: 0..0, blocks: 1, last: true }),
        }
    }
    parts
}

/// Runs the passes.
pub(super) fn run(
    rows: &mut Rows,
    bodies: Bodies<'_>,
    joints: Option<&Running<'_>>,
    step: &StepParams,
    passes: &[Pass],
) {
    let parts = parts(rows);
    let Bodies { solver, states, props } = bodies;
    let all = 0..solver.len();
    let mut stages: Vec<(Pass, Option<&Part>, Range<usize>, u32)> = Vec::new();
    for &pass in passes {
        match pass {
            Pass::Bodies(_) => stages.push((pass, None, all.clone(), blocks(all.len(), BODIES))),
            Pass::Sweep(_) => stages.extend(parts.iter().map(|p| (pass, Some(p), p.groups.clone(), p.blocks))),
            Pass::Joints(part) => {
                let all = joints.map_or(Vec::new(), |joints| joints.stages(part));
                let some = all.into_iter().filter(|(range, _)| !range.is_empty());
                stages.extend(some.map(|(range, blocks)| (pass, None, range, blocks)));
            }
        }
    }
    let counts: Vec<u32> = stages.iter().map(|(.., blocks)| *blocks).collect();
    let groups = rows.groups.shared();
    let last = Mutex::new(&mut rows.last);
    let bodies = Shared::new(solver);
    run_stages(&counts, |stage, block| {
        let (pass, part, range, count) = &stages[stage];
        let range = block_of(range, block, *count);
        match (pass, part) {
            (Pass::Bodies(each), _) => {
                for i in range {
                    // SAFETY: blocks of a stage share no body.
                    let body = unsafe { &mut bodies.slice_mut(i..i + 1)[0] };
                    if takes_part(body, &states[i], step) {
                        each(body, &states[i], &props[i], step);
                    }
                }
            }
            (Pass::Joints(part), _) => {
                if let Some(joints) = joints {
                    joints.run(*part, range, &bodies, step);
                }
            }
            (Pass::Sweep(visit), Some(part)) => {
                // SAFETY: blocks of a stage share no group.
                unsafe { groups.sweep(range, &bodies.rows(), step, *visit) };
                if part.last {
                    // SAFETY: a part with the last batch has this block alone.
                    let bodies = unsafe { bodies.slice_mut(all.clone()) };
                    last.lock().expect("no other thread had it").sweep(bodies, step, *visit);
                }
            }
            (Pass::Sweep(_), None) => unreachable!("a sweep is over parts"),
        }
    });
}

/// One visit to each group, in order. The groups of one batch share no moving body (`batch`), so threads may have some
/// each.
pub(super) fn sweep<L: Lanes>(
    groups: &mut [ConstraintLanes<L>],
    bodies: &Shared<'_, f32x4>,
    step: &StepParams,
    visit: Visit,
) {
    L::run(
        #[inline(always)]
        || match visit {
            // The visit is a constant in each of these loops.
            Visit::WarmStart => visit_all(Visit::WarmStart, groups, bodies, step),
            Visit::Solve => visit_all(Visit::Solve, groups, bodies, step),
            Visit::Relax => visit_all(Visit::Relax, groups, bodies, step),
            Visit::Load => visit_all(Visit::Load, groups, bodies, step),
            Visit::Pass => visit_all(Visit::Pass, groups, bodies, step),
            Visit::GaussSeidel => visit_all(Visit::GaussSeidel, groups, bodies, step),
            Visit::LastGaussSeidel => visit_all(Visit::LastGaussSeidel, groups, bodies, step),
            Visit::Split => visit_all(Visit::Split, groups, bodies, step),
            Visit::Jacobi => visit_all(Visit::Jacobi, groups, bodies, step),
            Visit::LastJacobi => visit_all(Visit::LastJacobi, groups, bodies, step),
            Visit::Penalty => visit_all(Visit::Penalty, groups, bodies, step),
            Visit::Restitution => visit_all(Visit::Restitution, groups, bodies, step),
        },
    );
}

#[inline(always)]
fn visit_all<L: Lanes>(visit: Visit, groups: &mut [ConstraintLanes<L>], bodies: &Shared<'_, f32x4>, step: &StepParams) {
    for group in groups {
        visit_group(visit, group, bodies, step);
    }
}

#[inline(always)]
fn visit_group<L: Lanes>(visit: Visit, group: &mut ConstraintLanes<L>, bodies: &Shared<'_, f32x4>, step: &StepParams) {
    let moved = !matches!(visit, Visit::WarmStart | Visit::Split | Visit::Restitution);
    // SAFETY: no other thread moves these bodies meanwhile: constraints of one batch share none that moves, a part of
    // several batches is one block, and bodies that do not move are never written (`scatter`).
    let read = |i: usize| unsafe { bodies.get(i) };
    // SAFETY: as above.
    let body = |i: usize| unsafe { bodies.chunk(i) };
    let (ia, ib) = (group.head.body_a, group.head.body_b);
    let mut a = BodyLanes::gather(body, ia, moved);
    let mut b = BodyLanes::gather(body, ib, moved);
    match visit {
        Visit::WarmStart => group.warm_start(&mut a, &mut b),
        Visit::Solve | Visit::Relax => soft_lanes::visit(visit, group, &mut a, &mut b, step),
        Visit::Load => {
            let [more_a, more_b] = one_pass_lanes::load(group, &mut a, &mut b);
            // SAFETY: as above.
            unsafe { a.weigh(bodies, ia, more_a) };
            // SAFETY: as above.
            unsafe { b.weigh(bodies, ib, more_b) };
        }
        Visit::Pass => {
            let blows = one_pass_lanes::pass(group, &mut a, &mut b, step);
            for (point, push) in blows.into_iter().enumerate().filter_map(|(k, push)| Some((k, push?))) {
                let [ra, rb] = group.arms(point);
                // SAFETY: as above.
                unsafe { a.start_after(bodies, ia, -1.0, ra, push) };
                // SAFETY: as above.
                unsafe { b.start_after(bodies, ib, 1.0, rb, push) };
            }
        }
        Visit::GaussSeidel | Visit::LastGaussSeidel => {
            gauss_seidel_lanes::visit(visit == Visit::LastGaussSeidel, group, &mut a, &mut b, step);
        }
        Visit::Split => {
            let one = || Weights { weight: L::ONE, weighted: L::ZERO };
            // SAFETY: as above.
            unsafe { a.weigh(bodies, ia, one()) };
            // SAFETY: as above.
            unsafe { b.weigh(bodies, ib, one()) };
            return;
        }
        Visit::Jacobi | Visit::LastJacobi => {
            let parts = [jacobi_lanes::parts(read, ia), jacobi_lanes::parts(read, ib)];
            let [part_a, part_b] = jacobi_lanes::visit(visit == Visit::LastJacobi, group, [&a, &b], parts, step);
            // SAFETY: as above.
            unsafe { jacobi_lanes::add_change(&a, &part_a, parts[0], bodies, ia) };
            // SAFETY: as above.
            unsafe { jacobi_lanes::add_change(&b, &part_b, parts[1], bodies, ib) };
            return;
        }
        Visit::Penalty => {
            let [after_a, after_b] = penalty_lanes::visit(group, &a, &b);
            // SAFETY: as above.
            unsafe { jacobi_lanes::add_change(&a, &after_a, L::ONE, bodies, ia) };
            // SAFETY: as above.
            unsafe { jacobi_lanes::add_change(&b, &after_b, L::ONE, bodies, ib) };
            return;
        }
        Visit::Restitution => group.bounce(&mut a, &mut b, step),
    }
    // SAFETY: as above.
    unsafe { a.scatter(bodies, ia) };
    // SAFETY: as above.
    unsafe { b.scatter(bodies, ib) };
}
