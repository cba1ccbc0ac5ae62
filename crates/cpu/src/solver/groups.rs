//! The groups of a step's constraints, as wide as the processor takes them.

#[cfg(target_arch = "x86_64")]
use super::avx2::{self, F32x8};
use super::lanes::{BodyRows, ConstraintLanes};
use super::prepare::{self, Contact};
use super::simd::Lanes;
use super::store::Solved;
use super::{Visit, passes, prepare_lanes};
use crate::shared::Shared;
use rayon::prelude::*;
use std::ops::Range;
use tumble_core::layout::{BodyState, Collider, ConstraintHead, SolverBody, StepParams};
use wide::f32x4;

/// Groups of constraints side by side.
pub(super) enum Groups {
    Four(Vec<ConstraintLanes<f32x4>>),
    /// Only where the processor has AVX2.
    #[cfg(target_arch = "x86_64")]
    Eight(Vec<ConstraintLanes<F32x8>>),
}

/// The same, for threads that write different ones.
pub(super) enum SharedGroups<'a> {
    Four(Shared<'a, ConstraintLanes<f32x4>>),
    #[cfg(target_arch = "x86_64")]
    Eight(Shared<'a, ConstraintLanes<F32x8>>),
}

impl Default for Groups {
    /// As wide as can be.
    fn default() -> Self {
        Self::with_lanes(8).unwrap_or(Self::Four(Vec::new()))
    }
}

impl Groups {
    /// None if the processor does not take so many at once.
    pub(super) fn with_lanes(lanes: usize) -> Option<Self> {
        match lanes {
            4 => Some(Self::Four(Vec::new())),
            #[cfg(target_arch = "x86_64")]
            8 if avx2::is_there() => Some(Self::Eight(Vec::new())),
            _ => None,
        }
    }

    /// Constraints in a group.
    pub(super) fn lanes(&self) -> usize {
        match self {
            Self::Four(_) => f32x4::COUNT,
            #[cfg(target_arch = "x86_64")]
            Self::Eight(_) => F32x8::COUNT,
        }
    }

    /// Builds a group for each of `members`, which has its first constraint and how many there are.
    pub(super) fn build<'c>(
        &mut self,
        members: &[(u32, u32)],
        colliders: &[Collider],
        bodies: &[SolverBody],
        states: &[BodyState],
        step: &StepParams,
        contact: &(impl Fn(usize) -> Contact<'c> + Sync),
    ) {
        let head = |contact: &Contact<'_>| prepare::prepare_head(contact, colliders, bodies, states, step);
        match self {
            Self::Four(groups) => build(groups, members, bodies, contact, head),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(groups) => build(groups, members, bodies, contact, head),
        }
    }

    /// Calls `take(c, solved)` for every constraint, from many threads at once.
    pub(super) fn for_each_constraint(&self, members: &[(u32, u32)], take: &(impl Fn(usize, &Solved) + Sync)) {
        match self {
            Self::Four(groups) => for_each_constraint(groups, members, take),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(groups) => for_each_constraint(groups, members, take),
        }
    }

    /// For the threads of one parallel pass.
    pub(super) fn shared(&mut self) -> SharedGroups<'_> {
        match self {
            Self::Four(groups) => SharedGroups::Four(Shared::new(groups)),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(groups) => SharedGroups::Eight(Shared::new(groups)),
        }
    }

    /// Bytes that they hold.
    pub(super) fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Four(groups) => groups.capacity() * size_of::<ConstraintLanes<f32x4>>(),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(groups) => groups.capacity() * size_of::<ConstraintLanes<F32x8>>(),
        };
        bytes as u64
    }
}

impl SharedGroups<'_> {
    /// One visit to each of some groups, in order.
    ///
    /// # Safety
    /// No other thread touches these groups meanwhile, nor what moves of their bodies.
    pub(super) unsafe fn sweep(
        &self,
        range: Range<usize>,
        bodies: &Shared<'_, f32x4>,
        step: &StepParams,
        visit: Visit,
    ) {
        match self {
            // SAFETY: the caller's promise.
            Self::Four(groups) => passes::sweep(unsafe { groups.slice_mut(range) }, bodies, step, visit),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the caller's promise.
            Self::Eight(groups) => passes::sweep(unsafe { groups.slice_mut(range) }, bodies, step, visit),
        }
    }
}

fn build<'c, L: Lanes>(
    groups: &mut Vec<ConstraintLanes<L>>,
    members: &[(u32, u32)],
    bodies: &[SolverBody],
    contact: &(impl Fn(usize) -> Contact<'c> + Sync),
    head: impl Fn(&Contact<'_>) -> ConstraintHead + Sync,
) {
    groups.resize(members.len(), ConstraintLanes::empty());
    let rows = bytemuck::cast_slice::<SolverBody, BodyRows>(bodies);
    groups.par_iter_mut().zip(members).with_min_len(128 / L::COUNT).for_each(|(group, &(first, count))| {
        *group = ConstraintLanes::empty();
        for lane in 0..count as usize {
            let contact = contact(first as usize + lane);
            let manifold = contact.manifold;
            group.set_head(lane, &head(&contact), manifold.between);
            for point in 0..manifold.count as usize {
                group.set_point(lane, point, &manifold.points[point], prepare::carry(&contact, point));
            }
        }
        L::run(
            #[inline(always)]
            || prepare_lanes::prepare(group, rows),
        );
    });
}

fn for_each_constraint<L: Lanes>(
    groups: &[ConstraintLanes<L>],
    members: &[(u32, u32)],
    take: &(impl Fn(usize, &Solved) + Sync),
) {
    groups.par_iter().zip(members).with_min_len(256 / L::COUNT).for_each(|(group, &(first, count))| {
        for lane in 0..count as usize {
            take(first as usize + lane, &group.solved(lane));
        }
    });
}
