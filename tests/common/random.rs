//! Random bodies and colliders, the same on every machine.

use bytemuck::Zeroable;
use tumble_core::Params;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::layout::*;
use tumble_cpu::bounds::collider_bounds;

/// SplitMix64 (Steele, Lea and Flood 2014).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 32) as u32
    }

    pub(crate) fn below(&mut self, count: u32) -> u32 {
        self.next() % count.max(1)
    }

    /// From `low` up to `high`.
    pub(crate) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * ((self.next() >> 8) as f32 / (1 << 24) as f32)
    }

    /// Each component from `-reach` up to `reach`.
    pub(crate) fn vector(&mut self, reach: f32) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| self.range(-reach, reach)))
    }

    pub(crate) fn rotation(&mut self) -> Quat {
        Quat::from_vec4(self.vector(1.0).extend(self.range(-1.0, 1.0)) + 1e-3).normalize()
    }

    pub(crate) fn state(&mut self, flags: u32, reach: f32) -> BodyState {
        BodyState {
            position: self.vector(reach).to_array(),
            flags,
            rotation: self.rotation().to_array(),
            linear_velocity: self.vector(5.0).to_array(),
            generation: self.below(3),
            angular_velocity: self.vector(4.0).to_array(),
            force: self.vector(30.0).to_array(),
            torque: self.vector(30.0).to_array(),
            ..BodyState::zeroed()
        }
    }

    pub(crate) fn props(&mut self) -> BodyProps {
        BodyProps {
            inverse_inertia: [0.5, 1.5, 3.0],
            inverse_mass: self.range(0.1, 2.0),
            gravity_scale: self.range(-1.0, 2.0),
            center_of_mass: self.vector(0.3).to_array(),
            frame: self.rotation().to_array(),
            ..BodyProps::zeroed()
        }
    }

    /// A shape off its body's centre of mass; a half-space's normal is an axis or slanted.
    pub(crate) fn collider(&mut self, shape: u32, body: u32) -> Collider {
        const AXES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let size = match shape {
            shape_kind::BALL => [self.range(0.1, 0.6), 0.0, 0.0],
            shape_kind::CUBOID => std::array::from_fn(|_| self.range(0.1, 0.6)),
            _ => [0.0; 3],
        };
        let kind = self.below(8) as usize;
        let rotation = match shape {
            shape_kind::HALFSPACE if kind < 6 => Quat::from_rotation_arc(Vec3::Y, AXES[kind]),
            _ => self.rotation(),
        };
        let combine = self.below(16);
        let (friction, restitution) = (self.range(0.0, 1.0), self.range(0.0, 1.0));
        let position = self.vector(0.2).to_array();
        let rotation = rotation.to_array();
        let rest = Collider::zeroed();
        Collider { size, shape, position, body, rotation, friction, restitution, combine, ..rest }
    }
}

/// Bodies with one collider each: of all kinds, some frozen or gone, every fiftieth a fixed half-space.
pub(crate) struct Crowd {
    pub(crate) states: Vec<BodyState>,
    pub(crate) props: Vec<BodyProps>,
    pub(crate) colliders: Vec<Collider>,
    pub(crate) step: StepParams,
}

impl Crowd {
    /// So many bodies in a cube in which each has some neighbours.
    pub(crate) fn new(count: usize, seed: u64) -> Self {
        use body_flags::{DYNAMIC, FIXED, FROZEN, KINEMATIC, NONE};
        const FLAGS: [u32; 8] = [DYNAMIC, DYNAMIC, FIXED, DYNAMIC, KINEMATIC, DYNAMIC, DYNAMIC | FROZEN, DYNAMIC];
        let mut random = Random::new(seed);
        let reach = 0.5 * (count as f32).cbrt();
        let mut crowd =
            Self { states: Vec::new(), props: Vec::new(), colliders: Vec::new(), step: step_of(count as u32) };
        for i in 0..count {
            let halfspace = i % 50 == 10;
            let flags = if i % 31 == 3 { NONE } else { FLAGS[random.below(8) as usize] };
            let mut state = random.state(if halfspace { FIXED } else { flags }, reach);
            if halfspace {
                state.rotation = Quat::IDENTITY.to_array();
            }
            if i % 20 == 6 {
                // Turns by more than two radians in a step.
                state.angular_velocity = random.vector(300.0).to_array();
            }
            let shape = match random.below(20) {
                _ if halfspace => shape_kind::HALFSPACE,
                0 => shape_kind::NONE,
                n if n < 10 => shape_kind::BALL,
                _ => shape_kind::CUBOID,
            };
            crowd.states.push(state);
            crowd.props.push(random.props());
            crowd.colliders.push(random.collider(shape, i as u32));
        }
        crowd
    }

    /// The box of each collider.
    pub(crate) fn boxes(&self) -> Vec<Aabb> {
        let box_of = |c: &Collider| {
            let body = c.body as usize;
            collider_bounds(c, &self.states[body], &self.props[body], &self.step)
        };
        self.colliders.iter().map(box_of).collect()
    }
}

/// Parameters of a step of so many bodies, with a collider each.
pub(crate) fn step_of(bodies: u32) -> StepParams {
    let mut step = Params::default().step_params(7, Vec3::new(0.3, -9.81, 0.1));
    (step.body_count, step.collider_count) = (bodies, bodies);
    step.cell_table_bits = tumble_core::limits::cell_table_bits(bodies);
    step.large_limit = tumble_core::limits::large_limit(bodies, false);
    step
}
