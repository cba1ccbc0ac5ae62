//! Model only what a scene needs: which passes a scene can ever use.

use crate::builder::RigidBodyType;
use crate::layout::pair_kind;
use crate::params::Params;
use crate::scene::Scene;
use crate::shape::Shape;
use std::fmt;

/// What may occur in a scene; a pass that the plan leaves out is not built, bound or dispatched. Edits widen it,
/// nothing narrows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Plan {
    /// Bit k: pairs of kind k (see [`pair_kind`]) can occur.
    pub pair_kinds: u32,
    /// Some collider bounces.
    pub restitution: bool,
    /// Room for balls and cuboids on fixed bodies, which have a tree of their own: their number, rounded up to a power of
    /// two, so that it seldom widens.
    pub fixed: u32,
    /// Bodies may sleep.
    pub sleep: bool,
    /// Islands have sub-steps of their own.
    pub levels: bool,
    /// Bit l where some body asks for level l of sub-steps, the lowest excepted.
    pub asked_levels: u32,
    /// The last batch is solved by mass splitting.
    pub split: bool,
    /// Bodies are joined.
    pub joints: bool,
}

impl Plan {
    /// What `scene` needs.
    pub fn of(scene: &Scene) -> Self {
        let (mut balls, mut cuboids, mut halfspaces) = (0u32, 0u32, 0u32);
        let (mut restitution, mut fixed) = (false, 0u32);
        for (_, _, collider) in scene.colliders.iter() {
            let ends = !matches!(collider.builder.shape, Shape::HalfSpace { .. });
            let on_fixed = scene.body(collider.body).is_ok_and(|body| body.body_type == RigidBodyType::Fixed);
            fixed += u32::from(ends && on_fixed);
            match collider.builder.shape {
                Shape::Ball { .. } => balls += 1,
                Shape::Cuboid { .. } => cuboids += 1,
                Shape::HalfSpace { .. } => halfspaces += 1,
            }
            restitution |= collider.builder.restitution > 0.0;
        }
        let mut pair_kinds = 0;
        let mut allow = |ok: bool, kind: u32| pair_kinds |= u32::from(ok) << kind;
        allow(balls > 1, pair_kind::BALL_BALL);
        allow(balls > 0 && cuboids > 0, pair_kind::BALL_CUBOID);
        allow(cuboids > 1, pair_kind::CUBOID_CUBOID);
        allow(balls > 0 && halfspaces > 0, pair_kind::BALL_HALFSPACE);
        allow(cuboids > 0 && halfspaces > 0, pair_kind::CUBOID_HALFSPACE);
        let levels = scene.bodies.iter().map(|(_, _, body)| body.builder.least_level()).filter(|&level| level > 0);
        let asked_levels = levels.fold(0, |asked, level| asked | 1 << level);
        let fixed = if fixed > 0 { fixed.next_power_of_two() } else { 0 };
        Self {
            pair_kinds,
            restitution,
            fixed,
            sleep: false,
            levels: asked_levels != 0,
            asked_levels,
            split: false,
            joints: scene.joint_count() > 0,
        }
    }

    /// Adds what `other` needs; true when that was anything new.
    pub fn widen(&mut self, other: &Plan) -> bool {
        let before = *self;
        self.pair_kinds |= other.pair_kinds;
        self.restitution |= other.restitution;
        self.fixed = self.fixed.max(other.fixed);
        self.sleep |= other.sleep;
        self.levels |= other.levels;
        self.asked_levels |= other.asked_levels;
        self.split |= other.split;
        self.joints |= other.joints;
        *self != before
    }

    /// The plan with what these parameters need.
    pub fn with(self, params: &Params) -> Self {
        let levels = self.levels || params.accuracy.is_by_island();
        let split = self.split || params.splits_last();
        Self { sleep: self.sleep || params.sleep.is_some(), levels, split, ..self }
    }

    /// Whether something asks which bodies hang together by contacts and joints.
    pub fn islands(&self) -> bool {
        self.sleep || self.levels
    }

    /// Whether pairs of this kind can occur.
    pub fn has(&self, kind: u32) -> bool {
        self.pair_kinds >> kind & 1 != 0
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NAMES: [&str; pair_kind::COUNT as usize] =
            ["", "ball-ball", "ball-cuboid", "cuboid-cuboid", "ball-halfspace", "cuboid-halfspace"];
        let kinds: Vec<_> = (1..pair_kind::COUNT).filter(|&k| self.has(k)).map(|k| NAMES[k as usize]).collect();
        write!(
            f,
            "pairs: {}; restitution: {}; fixed: {}; joints: {}; islands: {}",
            if kinds.is_empty() { "none".into() } else { kinds.join(", ") },
            self.restitution,
            self.fixed,
            self.joints,
            self.islands()
        )
    }
}
