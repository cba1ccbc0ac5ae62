//! Scenes to ask about, and questions.

use tumble::World;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::{
    ColliderBuilder, Nearest, NearestQuery, OverlapShape, Overlaps, Ray, RayHit, RigidBodyBuilder, RigidBodyType, Scene,
};

use crate::parry::Oracle;
use crate::random::Random;

/// Balls, boxes and compounds of all kinds of bodies in a cube, `spread` octaves of sizes; three half-spaces around.
pub(crate) fn crowd(bodies: usize, octaves: f32, seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let side = 0.7 * (bodies as f32).cbrt();
    for (k, normal) in [Vec3::Y, Vec3::new(0.3, 1.0, -0.2), Vec3::NEG_X].into_iter().enumerate() {
        let at =
            RigidBodyBuilder::fixed().translation(-normal * (side + k as f32)).rotation(Quat::from_rotation_x(0.1));
        scene.insert(at, ColliderBuilder::halfspace(normal));
    }
    for i in 0..bodies {
        let body = RigidBodyBuilder {
            body_type: match i % 7 {
                3 => RigidBodyType::Fixed,
                5 => RigidBodyType::KinematicVelocityBased,
                _ => RigidBodyType::Dynamic,
            },
            ..RigidBodyBuilder::dynamic().translation(random.vector(side)).rotation(random.rotation())
        };
        let scale = 2f32.powf(octaves * random.range(-1.0, 0.3));
        let mut size = || scale * random.range(0.2, 0.6);
        let (a, b, c) = (size(), size(), size());
        // Some boxes stand along the axes, where rays along them run in faces' planes.
        let body = if i % 4 == 1 { body.rotation(Quat::IDENTITY) } else { body };
        let inserted =
            scene.insert(body, if i % 2 == 0 { ColliderBuilder::ball(a) } else { ColliderBuilder::cuboid(a, b, c) });
        if i % 5 == 3 {
            let at = ColliderBuilder::cuboid(c, a, b).translation(scale * random.vector(0.5));
            scene.attach(inserted.body, at.rotation(random.rotation())).unwrap();
        }
    }
    scene
}

/// Lower and upper corner around the bodies.
pub(crate) fn region(oracle: &Oracle) -> (Vec3, Vec3) {
    let places = oracle.entries.iter().map(|entry| entry.pose.translation);
    places.fold((Vec3::splat(-1.0), Vec3::splat(1.0)), |(low, high), p| (low.min(p - 1.0), high.max(p + 1.0)))
}

pub(crate) fn place_in(random: &mut Random, (low, high): (Vec3, Vec3)) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|i| random.range(low[i], high[i])))
}

/// Rays of all lengths and kinds: anywhere, along axes, from and to the middles of colliders, short ones, solid or not.
pub(crate) fn rays_in(oracle: &Oracle, count: usize, random: &mut Random) -> Vec<Ray> {
    let region = region(oracle);
    let middle = |random: &mut Random| match oracle.entries.len() {
        0 => Vec3::ZERO,
        count => oracle.entries[random.below(count as u32) as usize].pose.translation,
    };
    let mut ray = |i: usize| {
        let origin = match i % 5 {
            1 => middle(random),
            2 => middle(random) + random.vector(0.3),
            _ => place_in(random, region),
        };
        let direction = match i % 4 {
            0 => middle(random) + random.vector(0.3) - origin,
            1 => [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][random.below(6) as usize],
            _ => random.vector(1.0),
        };
        let scale = 10f32.powf(random.range(-2.0, 2.0));
        let direction = if direction.length() > 1e-3 { scale * direction } else { Vec3::X };
        let max_time_of_impact = match i % 3 {
            0 => random.range(0.0, 5.0) / direction.length(),
            _ => f32::INFINITY,
        };
        Ray { origin, direction, max_time_of_impact, solid: i.is_multiple_of(2) }
    };
    (0..count).map(&mut ray).collect()
}

pub(crate) fn shapes_in(oracle: &Oracle, count: usize, random: &mut Random) -> Vec<OverlapShape> {
    let region = region(oracle);
    let mut shape = |i: usize| {
        let center = place_in(random, region);
        let scale = 4f32.powf(random.range(-2.0, 1.5));
        let rotation = if i % 4 < 2 { random.rotation() } else { Quat::IDENTITY };
        match i % 2 {
            0 => OverlapShape::Ball {
                center,
                radius: if i.is_multiple_of(10) { 0.0 } else { scale * random.range(0.1, 1.0) },
            },
            _ => {
                let half_extents = scale * Vec3::from_array(std::array::from_fn(|_| random.range(0.0, 1.0)));
                OverlapShape::Cuboid { center, half_extents, rotation: rotation * 1.5 }
            }
        }
    };
    (0..count).map(&mut shape).collect()
}

/// Rays, shapes and points around what a world holds.
pub(crate) fn questions(
    world: &mut World,
    count: usize,
    seed: u64,
) -> (Vec<Ray>, Vec<OverlapShape>, Vec<NearestQuery>) {
    let (oracle, mut random) = (Oracle::new(world), Random::new(seed));
    let region = region(&oracle);
    let rays = rays_in(&oracle, count, &mut random);
    let shapes = shapes_in(&oracle, count, &mut random);
    // Every eighth around the lowest corner.
    let point = |i: usize| match i % 8 {
        0 => region.0 + random.vector(0.9),
        _ => place_in(&mut random, region),
    };
    let points = (0..count).map(point).map(NearestQuery::new).collect();
    (rays, shapes, points)
}

/// Answers of all kinds, by slot.
pub(crate) fn ask_all(world: &mut World, rays: &[Ray], shapes: &[OverlapShape], points: &[NearestQuery]) -> Answers {
    Answers {
        hits: world.cast_rays(rays).unwrap(),
        any: world.cast_rays_any(rays).unwrap(),
        overlaps: world.overlaps(shapes).unwrap(),
        nearest: world.nearest(points).unwrap(),
    }
}

#[derive(Debug, PartialEq)]
pub(crate) struct Answers {
    pub(crate) hits: Vec<Option<RayHit>>,
    pub(crate) any: Vec<bool>,
    pub(crate) overlaps: Overlaps,
    pub(crate) nearest: Vec<Option<Nearest>>,
}
