//! Standard scenes as data: what benchmarks, examples and tests run.
//!
//! Unless a function says otherwise: gravity 9.81 m/s² along -y, density 1,000 kg/m³, friction 0.6 on everything,
//! no restitution, a fixed half-space as the floor at y = 0. Angles are in radians. The same call gives the same
//! bits every time.

mod crowds;
mod heaps;
mod joints;
mod materials;
mod mechanisms;
mod motion;
mod ragdolls;
mod random;
mod stacks;
mod structures;

pub use crowds::{Crowd, crowd};
pub use heaps::{balls, balls_seeded, mixed, mixed_seeded, pile, pile_seeded};
pub use joints::{cable, chain, closed_chain, falling_chain, joint_grid, net, rope_bridge, wrecking_ball};
pub use materials::{ball_column, ball_on_slope, conveyor, rolling_ball, spinning};
pub use mechanisms::{
    CAR_BODIES, CUBE_INERTIA, CUBE_MASS, Cardan, FOUR_BAR, FourBar, car, cardan, cars, four_bar, four_bars, heavy_top,
    on_joint, pendulum, slider_on_slope,
};
pub use motion::{
    bouncing_ball, bullet, closed_system, cradle, free_box, free_fall, pulled_box, ramp, sliding_box, slip_to_roll,
    t_handle, tumbling_box,
};
pub use ragdolls::{RAGDOLL_BODIES, ragdoll, ragdolls, ragdolls_seeded};
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
    StandardScene {
        name: "chain",
        about: "a chain let go level, its last link 100 times as heavy",
        default_bodies: 20,
        build: |bodies| chain(bodies, 100.0),
    },
    StandardScene {
        name: "falling_chain",
        about: "a chain of boxes that falls onto the floor",
        default_bodies: 40,
        build: falling_chain,
    },
    StandardScene {
        name: "wrecking_ball",
        about: "a chain of boxes with a ball 200 times as heavy as a link, that lands",
        default_bodies: 16,
        build: |bodies| if bodies == 0 { floor_only() } else { wrecking_ball(bodies - 1, 200.0) },
    },
    StandardScene {
        name: "rope_bridge",
        about: "planks tied to each other at both ends, hung between fixed ends",
        default_bodies: 30,
        build: rope_bridge,
    },
    StandardScene {
        name: "net",
        about: "a square net of balls, let go level and held by one corner",
        default_bodies: 100,
        build: |bodies| net(bodies.isqrt(), 1.0),
    },
    StandardScene {
        name: "joint_grid",
        about: "a large sheet of balls that hangs from every fourth ball of one edge",
        default_bodies: 10_000,
        build: |bodies| joint_grid(bodies.isqrt()),
    },
    StandardScene {
        name: "ragdolls",
        about: "figures of eleven boxes dropped into a pit",
        default_bodies: 1100,
        build: |bodies| ragdolls(bodies / RAGDOLL_BODIES),
    },
    StandardScene {
        name: "four_bars",
        about: "linkages of a crank that a motor turns, a coupler and a rocker",
        default_bodies: 12,
        build: |bodies| four_bars(bodies / 3),
    },
    StandardScene {
        name: "cars",
        about: "cars with springs and motors that drive over bumps",
        default_bodies: 9,
        build: |bodies| cars(bodies / CAR_BODIES),
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
