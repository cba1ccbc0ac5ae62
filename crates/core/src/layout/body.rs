use bytemuck::{Pod, Zeroable};
use glam::{Quat, Vec3};

/// Bits of [`BodyState::flags`].
pub mod body_flags {
    /// The slot is empty.
    pub const NONE: u32 = 0;
    /// Never moves.
    pub const FIXED: u32 = 1;
    /// Moves with the velocity that the user sets, or to the poses that the user gives it, pushed by nothing.
    pub const KINEMATIC: u32 = 2;
    /// Moved by forces and contacts.
    pub const DYNAMIC: u32 = 3;
    /// Masks the kind out of the flags.
    pub const KIND: u32 = 3;
    /// Quarantined: its state stopped being finite; it stands still at its last finite pose, as if fixed.
    pub const FROZEN: u32 = 4;
    /// Asleep, with its island: it stands still, and acts on nothing, until something wakes it.
    pub const ASLEEP: u32 = 8;
    /// Never to be put to sleep.
    pub const STAYS_AWAKE: u32 = 16;
    /// Kinematic, and moved by poses: it has no velocity but that of the step in which it is given one.
    pub const POSED: u32 = 32;
}

/// Bits of [`BodyProps::locked`]: the world's axes along and about which a body does not move.
pub mod locks {
    /// Bits of translations: x, y, z from the lowest.
    pub const TRANSLATIONS: u32 = 7;
    /// Bits of rotations: about x, y, z from the lowest.
    pub const ROTATIONS: u32 = 56;
    /// The lowest bit of those is so many bits up.
    pub const FIRST_ROTATION: u32 = 3;
}

/// Bits of [`SolverBody::touched`].
pub mod touched {
    /// A contact, or a joint that is solved by Gauss-Seidel: the body moves by the velocity that these were solved for.
    pub const CONTACT: u32 = 1;
    /// Joints that are solved directly: gravity comes in two half kicks.
    pub const JOINED: u32 = 2;
    /// Either.
    pub const ANY: u32 = 3;
    /// Not what touches it: the [`locks`](super::locks) of translations stand so many bits up. Read as floats, each alone
    /// is a number.
    pub const FIRST_LOCK: u32 = 28;
}

/// What lasts of a body from step to step. 96 bytes. Position is that of the centre of mass; the body frame
/// is the principal frame of inertia. Written only when a step commits.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BodyState {
    /// Centre of mass in the world, m.
    pub position: [f32; 3],
    /// [`body_flags`].
    pub flags: u32,
    /// Principal frame to world, unit quaternion x y z w.
    pub rotation: [f32; 4],
    /// m/s.
    pub linear_velocity: [f32; 3],
    /// Generation of the handle.
    pub generation: u32,
    /// rad/s, world frame.
    pub angular_velocity: [f32; 3],
    /// Accuracy on demand: the level of sub-steps that the body's island wants, times [`LEVEL_HOLD`](super::LEVEL_HOLD),
    /// plus how many calm steps are left before it wants a lower one.
    pub credit: u32,
    /// Force of the coming step, N; cleared when it commits.
    pub force: [f32; 3],
    /// Length of the sub-steps that the last step took for it, s: impulses that carry over are those of one of them. 0
    /// before its first step.
    pub h: f32,
    /// Torque of the coming step about the centre of mass, N m, world frame.
    pub torque: [f32; 3],
    /// Estimate of how fast the impulses that the body bears can change: the smallest eigenvalue of the scaled contact
    /// matrix, for the load as it is. From step to step; see `solver/one_pass`.
    pub eigenvalue: f32,
}

/// What a body is made of; changes only by edits. 80 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BodyProps {
    /// 1 / principal moments, 1/(kg m²); zero for what does not turn.
    pub inverse_inertia: [f32; 3],
    /// 1/kg; zero for fixed and kinematic bodies.
    pub inverse_mass: f32,
    /// Principal moments of inertia, kg m².
    pub inertia: [f32; 3],
    /// Factor on gravity.
    pub gravity_scale: f32,
    /// Centre of mass in the body's own frame, m.
    pub center_of_mass: [f32; 3],
    /// 1/s.
    pub linear_damping: f32,
    /// Principal frame to the body's own frame.
    pub frame: [f32; 4],
    /// 1/s.
    pub angular_damping: f32,
    /// No point of a collider's surface is farther from the centre of mass, m.
    pub reach: f32,
    /// [`locks`], of what can be pushed.
    pub locked: u32,
    /// Level of sub-steps that its island gets at least, of what can be pushed.
    pub least_level: u32,
}

/// Where a body came to rest, and for how long it has stayed there. 48 bytes. Lasts from step to step, where bodies may
/// sleep.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Rest {
    /// Centre of mass in the world when it came there, m.
    pub position: [f32; 3],
    /// How long no point of its surface has been farther from its place then than allowed, s.
    pub time: f32,
    /// Principal frame to world, when it came there.
    pub rotation: [f32; 4],
    /// Lowest slot of the bodies that sleep with it, while it sleeps.
    pub island: u32,
    /// Unused.
    pub pad_a: u32,
    /// Unused.
    pub pad_b: u32,
    /// Unused.
    pub pad_c: u32,
}

/// Hot state of a body within one step; built by `solver/prepare`, thrown away after the commit. 128 bytes, at multiples of 16.
#[repr(C, align(16))]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SolverBody {
    /// m/s.
    pub linear_velocity: [f32; 3],
    /// 1/kg; zero when nothing may push the body. Pushes have no effect along locked axes ([`touched`]).
    pub inverse_mass: f32,
    /// rad/s, world frame.
    pub angular_velocity: [f32; 3],
    /// What holds the body in this step, see [`touched`].
    pub touched: u32,
    /// Change of position since the step began, m.
    pub translation: [f32; 3],
    /// [`BodyState::eigenvalue`].
    pub eigenvalue: f32,
    /// Change of rotation since the step began, world frame: rotation = delta * start.
    pub delta: [f32; 4],
    /// xx, yy, zz of the inverse inertia in the world frame at the start of the step, 1/(kg m²); zero where locked.
    pub inverse_inertia_diagonal: [f32; 3],
    /// Level of sub-steps that it is solved at, see [`StepParams::levels`](super::StepParams::levels).
    pub level: u32,
    /// xy, xz, yz of the same.
    pub inverse_inertia_off: [f32; 3],
    /// Mass splitting: its constraints in the last batch, and so the parts that it is split into there; else 0.
    pub parts: u32,
    /// One pass: the velocity with which the sub-step began, before impulses, m/s. What the velocity has more, carries
    /// over. Jacobi and penalty: the velocity with which the iteration ends, a sum.
    pub linear_start: [f32; 3],
    /// Sum over the body's contacts of impulse² / mass, J: what the eigenvalue is weighed with. Jacobi: their number.
    pub weight: f32,
    /// The same of the angular velocity, rad/s.
    pub angular_start: [f32; 3],
    /// Sum over the contacts of their weight times the eigenvalue of the body on the other side, J.
    pub weighted: f32,
}

/// A pose as a user or renderer sees it: the body's own frame, by handle slot. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PoseRecord {
    /// Origin of the body's own frame in the world, m.
    pub translation: [f32; 3],
    /// [`body_flags`] in the low eight bits, zero when the slot is empty; the handle's generation above.
    pub tag: u32,
    /// Body's own frame to world, unit quaternion x y z w.
    pub rotation: [f32; 4],
}

/// The tag of a pose: flags and generation.
pub const fn pose_tag(flags: u32, generation: u32) -> u32 {
    flags | generation << 8
}

impl PoseRecord {
    /// The body's own frame, from its principal frame at the centre of mass.
    pub fn of(state: &BodyState, props: &BodyProps) -> Self {
        let rotation = (Quat::from_array(state.rotation) * Quat::from_array(props.frame).conjugate()).normalize();
        let translation = Vec3::from_array(state.position) - rotate(rotation, Vec3::from_array(props.center_of_mass));
        let tag = pose_tag(state.flags, state.generation);
        Self { translation: translation.to_array(), tag, rotation: rotation.to_array() }
    }
}

/// Rotates `v` by `q`, in the order of the shaders.
fn rotate(q: Quat, v: Vec3) -> Vec3 {
    let b = Vec3::new(q.x, q.y, q.z);
    let t = 2.0 * b.cross(v);
    v + q.w * t + b.cross(t)
}
