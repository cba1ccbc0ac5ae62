//! The boxes of a scene's colliders, as it stands and as its bodies fly on.

use tumble_core::layout::{Aabb, BodyProps, BodyState, Collider, StepParams};
use tumble_core::{PackedScene, Params, Scene, limits};
use tumble_cpu::bounds::{collider_bounds, moves};

/// A scene packed, and the parameters of a step of it.
pub(crate) struct Cloud {
    pub(crate) states: Vec<BodyState>,
    props: Vec<BodyProps>,
    colliders: Vec<Collider>,
    pub(crate) step: StepParams,
}

impl Cloud {
    pub(crate) fn new(scene: &Scene) -> Self {
        let packed = PackedScene::new(scene).expect("a scene that packs");
        let mut step = Params::default().step_params(1, packed.gravity);
        (step.body_count, step.collider_count) = (packed.states.len() as u32, packed.colliders.len() as u32);
        step.cell_table_bits = limits::cell_table_bits(step.collider_count);
        step.large_limit = limits::large_limit(step.collider_count, false);
        Self { states: packed.states, props: packed.props, colliders: packed.colliders, step }
    }

    /// Box of every collider over the coming step.
    pub(crate) fn boxes(&self) -> Vec<Aabb> {
        let bounds =
            |c: &Collider| collider_bounds(c, &self.states[c.body as usize], &self.props[c.body as usize], &self.step);
        self.colliders.iter().map(bounds).collect()
    }

    /// Bodies fly on by so many steps.
    pub(crate) fn fly(&mut self, steps: f32) {
        for state in self.states.iter_mut().filter(|state| moves(state.flags)) {
            for (x, v) in state.position.iter_mut().zip(state.linear_velocity) {
                *x += steps * self.step.dt * v;
            }
        }
    }
}
