//! Standard scenes as data: what benchmarks, examples and tests run.
//!
//! Unless a function says otherwise: gravity 9.81 m/s² along -y, density 1,000 kg/m³, friction 0.6 on everything,
//! no restitution, a fixed half-space as the floor at y = 0. Angles are in radians. The same call gives the same
//! bits every time.

mod crowds;
mod heaps;
mod materials;
mod motion;
mod random;
mod stacks;
mod structures;

pub use crowds::{Crowd, crowd};
pub use heaps::{balls, balls_seeded, mixed, mixed_seeded, pile, pile_seeded};
pub use materials::{ball_column, ball_on_slope, conveyor, rolling_ball, spinning};
pub use motion::{
    bouncing_ball, bullet, closed_system, cradle, free_box, free_fall, pulled_box, ramp, sliding_box, slip_to_roll,
    t_handle, tumbling_box,
};
pub use stacks::{
    column, hub, large_on_small, many_pyramids, mass_ratio, overlap_cube, pyramid, topped_pyramid, wide_pyramid,
};

pub use structures::{card_house, dominoes, jenga, plank_tower, tiny_pyramid};

use crate::builder::{ColliderBuilder, RigidBodyBuilder};
use crate::handle::BodyHandle;
use crate::scene::Scene;
use glam::Vec3;

/// Coulomb coefficient of the standard scenes.
pub const FRICTION: f32 = 0.6;
/// Density of the standard scenes, kg/m³.
pub const DENSITY: f32 = 1000.0;

/// A scene that benchmarks and tools know by name.
#[derive(Debug, Clone, Copy)]
pub struct StandardScene {
    /// Short, lower case.
    pub name: &'static str,
    /// One line on what it shows.
    pub about: &'static str,
    /// Dynamic bodies, unless asked otherwise.
    pub default_bodies: usize,
    /// Builds it with as near to this many dynamic bodies as its form allows, never more.
    pub build: fn(bodies: usize) -> Scene,
}

/// The standard scenes.
pub const ALL: &[StandardScene] = &[
    StandardScene { name: "pile", about: "boxes dropped into a pit", default_bodies: 4000, build: pile },
    StandardScene {
        name: "pyramid",
        about: "a standing wall of boxes, each layer half a box over the one below",
        default_bodies: 5050,
        build: |bodies| pyramid(pyramid_base(bodies)),
    },
    StandardScene {
        name: "many_pyramids",
        about: "rows of standing walls of 55 boxes each",
        default_bodies: 10_780,
        build: |bodies| if bodies < 55 { pyramid(pyramid_base(bodies)) } else { many_pyramids(bodies / 55, 10) },
    },
    StandardScene { name: "balls", about: "balls dropped into a pit", default_bodies: 4000, build: balls },
    StandardScene {
        name: "mixed",
        about: "boxes, balls and compounds of many sizes dropped into a pit",
        default_bodies: 4000,
        build: mixed,
    },
    StandardScene { name: "column", about: "boxes stacked one on one", default_bodies: 20, build: column },
    StandardScene {
        name: "hub",
        about: "one plate that carries all the others: more contacts on a body than there are batches",
        default_bodies: 501,
        build: |bodies| if bodies == 0 { floor_only() } else { hub(bodies - 1) },
    },
];

/// The standard scene of this name.
pub fn find(name: &str) -> Option<&'static StandardScene> {
    ALL.iter().find(|scene| scene.name == name)
}

/// The largest base with no more than `bodies` boxes in all.
fn pyramid_base(bodies: usize) -> usize {
    (bodies.saturating_mul(8).saturating_add(1).isqrt() - 1) / 2
}

fn floor_only() -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    scene
}

/// The half-space y < 0.
fn add_floor(scene: &mut Scene, friction: f32, restitution: f32) -> BodyHandle {
    let collider = ColliderBuilder::halfspace(Vec3::Y).friction(friction).restitution(restitution);
    scene.insert(RigidBodyBuilder::fixed(), collider).body
}

/// A box of half extents `half` with the standard density and friction.
fn cuboid(half: Vec3) -> ColliderBuilder {
    ColliderBuilder::cuboid(half.x, half.y, half.z).density(DENSITY).friction(FRICTION)
}

/// A ball with the standard density and friction.
fn ball(radius: f32) -> ColliderBuilder {
    ColliderBuilder::ball(radius).density(DENSITY).friction(FRICTION)
}

/// A dynamic body at `translation`.
fn dynamic(translation: Vec3) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(translation)
}
