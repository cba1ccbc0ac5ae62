//! The inertia of the bodies of batches, several at a time: [`stiffen`](super::batches::stiffen).

use super::inertia::STIFFENING;
use super::joined_lanes::{Symmetric, axes, choose, normalized, product, rotate};
use crate::shared::Shared;
use crate::solver::lanes::{BodyRows, NO_BODY, Places, START};
use crate::solver::simd::{Lanes, V3};
use tumble_core::layout::{BodyProps, BodyState, Joint, StepParams};
use wide::f32x4;

/// Bodies, and where their joints lie.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BodyGroup<L: Lanes> {
    /// [`NO_BODY`] where there is none.
    pub(super) slots: L::Indices,
    pub(super) first_end: u32,
    pub(super) end_count: u32,
}

/// One joint of each.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct EndLanes<L: Lanes> {
    /// From the centre of mass, in the body's frame; zero where there is no joint.
    anchor: V3<L>,
    /// Where its impulse lies.
    seats: L::Indices,
    /// -1 for the first body of a joint.
    sign: L,
}

impl<L: Lanes> EndLanes<L> {
    pub(super) fn set(&mut self, lane: usize, second: bool, joint: &Joint, seat: u32) {
        self.anchor.set(lane, if second { joint.anchor_b } else { joint.anchor_a });
        self.seats.as_mut()[lane] = seat;
        self.sign.as_mut_array()[lane] = if second { 1.0 } else { -1.0 };
    }
}

impl<L: Lanes> BodyGroup<L> {
    /// The inertia of each body of the step's level that has no locked axis.
    ///
    /// # Safety
    /// No other thread touches these bodies meanwhile, nor writes impulses.
    #[inline(always)]
    pub(super) unsafe fn stiffen(
        &self,
        ends: &[EndLanes<L>],
        impulses: &Shared<'_, f32x4>,
        bodies: &Shared<'_, f32x4>,
        (states, props): (&[BodyState], &[BodyProps]),
        step: &StepParams,
    ) {
        // SAFETY: the caller's promise.
        let places = Places::new::<L>(|i| unsafe { bodies.chunk(i) }, self.slots);
        let (mut rotations, mut inverses, mut moments) = (L::Rows::default(), L::Rows::default(), L::Rows::default());
        for (lane, &slot) in self.slots.as_ref().iter().enumerate().filter(|(_, slot)| **slot != NO_BODY) {
            let (state, props) = (&states[slot as usize], &props[slot as usize]);
            rotations.as_mut()[lane] = f32x4::new(state.rotation);
            let [x, y, z] = props.inverse_inertia;
            inverses.as_mut()[lane] = f32x4::new([x, y, z, if props.locked == 0 { 1.0 } else { 0.0 }]);
            let [x, y, z] = props.inertia;
            moments.as_mut()[lane] = f32x4::new([x, y, z, 0.0]);
        }
        let rotation = normalized(product(places.columns(3), L::columns(rotations)));
        let more = self.stiffening(ends, rotation, impulses, step);
        let axes = axes(rotation);
        let ([ix, iy, iz, is_free], [mx, my, mz, _]) = (L::columns(inverses), L::columns(moments));
        let turns = (ix + iy + iz).simd_gt(L::ZERO);
        let stiff = turns & (more.diagonal.x + more.diagonal.y + more.diagonal.z).simd_gt(L::ZERO);
        let mut inverse = if stiff.any() {
            Symmetric::of_axes(axes, V3::new(mx, my, mz)).plus(more).inverse()
        } else {
            Symmetric::default()
        };
        if (!stiff).any() {
            inverse = inverse.where_set(stiff, Symmetric::of_axes(axes, V3::new(ix, iy, iz)));
        }
        let [_, _, _, inverse_mass]: [L; 4] = places.columns(0);
        let [wx, wy, wz, _]: [L; 4] = places.columns(1);
        let [dx, dy, dz, level]: [L; 4] = places.columns(4);
        let [ox, oy, oz, parts]: [L; 4] = places.columns(5);
        let [sx, sy, sz, weighted]: [L; 4] = places.columns(START + 1);
        let mine = is_free * inverse_mass;
        // What contacts will add again goes with the new inertia.
        let (angular, start) = (V3::new(wx, wy, wz), V3::new(sx, sy, sz));
        let carried = angular - start;
        let before = Symmetric { diagonal: V3::new(dx, dy, dz), off: V3::new(ox, oy, oz) };
        let (torque, has_one) = before.solve(carried);
        let start = choose(has_one, angular - inverse.times(torque), start);
        let Symmetric { diagonal: d, off: o } = inverse;
        let (diagonal, off) = (L::rows([d.x, d.y, d.z, level]), L::rows([o.x, o.y, o.z, parts]));
        let start = L::rows([start.x, start.y, start.z, weighted]);
        for (lane, &slot) in self.slots.as_ref().iter().enumerate() {
            let is_of_level = level.as_array()[lane].to_bits() == step.level;
            if is_of_level && mine.as_array()[lane] > 0.0 {
                // SAFETY: the caller's promise.
                let rows: &mut BodyRows = unsafe { bodies.chunk_mut(slot as usize) };
                (rows[4], rows[5], rows[START + 1]) =
                    (diagonal.as_ref()[lane], off.as_ref()[lane], start.as_ref()[lane]);
            }
        }
    }

    #[inline(always)]
    fn stiffening(
        &self,
        ends: &[EndLanes<L>],
        rotation: [L; 4],
        impulses: &Shared<'_, f32x4>,
        step: &StepParams,
    ) -> Symmetric<L> {
        let mut more = Symmetric::default();
        for end in ends {
            // SAFETY: no impulse is written in this stage.
            let [x, y, z, _] = seat_columns(|seat| unsafe { impulses.get(seat) }, end.seats);
            let arm = rotate(rotation, end.anchor);
            let (pull, square) = (end.sign * arm.dot(V3::new(x, y, z)), arm.dot(arm));
            let holds = pull.simd_gt(L::ZERO) & square.simd_gt(L::ZERO);
            let size = holds & (L::splat(STIFFENING * step.h) * pull);
            let outer = holds & (size / square);
            let V3 { x, y, z } = arm;
            let along = outer * arm;
            let diagonal = V3::new(size - along.x * x, size - along.y * y, size - along.z * z);
            let off = V3::default() - V3::new(along.x * y, along.x * z, along.y * z);
            more = more.plus(Symmetric { diagonal, off });
        }
        more
    }
}

#[inline(always)]
fn seat_columns<L: Lanes>(read: impl Fn(usize) -> f32x4, seats: L::Indices) -> [L; 4] {
    let mut rows = L::Rows::default();
    rows.as_mut().iter_mut().zip(seats.as_ref()).for_each(|(row, &seat)| *row = read(seat as usize));
    L::columns(rows)
}
