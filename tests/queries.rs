//! Rays, overlaps and nearest points on both sides. Oracles: parry's casts, projections, intersection tests and tree
//! over the poses that the same world reports; and, where a test says so, the other side, brute force or analysis.

mod common;
#[path = "common/parry.rs"]
mod parry;
#[path = "common/random.rs"]
mod random;
#[path = "common/worlds.rs"]
mod worlds;

use parry::Oracle;
use random::Random;
use tumble::World;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::{
    ColliderBuilder, NearestQuery, OverlapShape, Params, Pose, Ray, RigidBodyBuilder, RigidBodyType, Scene, scenes,
};
use worlds::{SIDES, Side, steps};

/// Balls, boxes and compounds of all kinds of bodies in a cube, `spread` octaves of sizes; three half-spaces around.
fn crowd(bodies: usize, octaves: f32, seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let side = 0.7 * (bodies as f32).cbrt();
    for (k, normal) in [Vec3::Y, Vec3::new(0.3, 1.0, -0.2), Vec3::NEG_X].into_iter().enumerate() {
        let at = RigidBodyBuilder::fixed().translation(-normal * (side + k as f32)).rotation(Quat::from_rotation_x(0.1));
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

/// Every scene that is asked about: name, scene, steps before.
fn cases() -> Vec<(String, Scene, usize)> {
    let mut cases = vec![
        ("crowd".into(), crowd(1500, 1.0, 1), 0),
        ("crowd of many sizes".into(), crowd(1500, 6.0, 2), 0),
        ("crowd that moved".into(), crowd(700, 2.0, 3), 12),
    ];
    for scene in scenes::ALL {
        cases.push((format!("{}, falling", scene.name), (scene.build)(400), 25));
    }
    for bodies in 0..3 {
        cases.push((format!("{bodies} bodies"), scenes::mixed(bodies), 3));
    }
    cases.push(("nothing".into(), Scene::new(), 1));
    cases.push(("one box".into(), scenes::free_box().0, 0));
    cases
}

/// Lower and upper corner around the bodies.
fn region(oracle: &Oracle) -> (Vec3, Vec3) {
    let places = oracle.entries.iter().map(|entry| entry.pose.translation);
    places.fold((Vec3::splat(-1.0), Vec3::splat(1.0)), |(low, high), p| (low.min(p - 1.0), high.max(p + 1.0)))
}

fn place_in(random: &mut Random, (low, high): (Vec3, Vec3)) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|i| random.range(low[i], high[i])))
}

/// Rays of all lengths and kinds: anywhere, along axes, from and to the middles of colliders, short ones, solid or not.
fn rays_in(oracle: &Oracle, count: usize, random: &mut Random) -> Vec<Ray> {
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
        Ray { origin, direction, max_time_of_impact, solid: i % 2 == 0 }
    };
    (0..count).map(&mut ray).collect()
}

/// What became of many comparisons.
#[derive(Debug, Default)]
struct Tally {
    asked: usize,
    answered: usize,
    /// Another collider, as near within the tolerance.
    ties: usize,
    /// Met or not, depending on the last digits.
    grazing: usize,
    worst: f32,
    worst_normal: f32,
}

impl Tally {
    fn add(&mut self, other: &Self) {
        self.asked += other.asked;
        self.answered += other.answered;
        self.ties += other.ties;
        self.grazing += other.grazing;
        self.worst = self.worst.max(other.worst);
        self.worst_normal = self.worst_normal.max(other.worst_normal);
    }
}

/// How far from a surface either side's hit may be, m: measured below.
const NEAR: f32 = 2e-5;

fn compare_rays(what: &str, world: &mut World, oracle: &Oracle, rays: &[Ray]) -> Tally {
    let hits = world.cast_rays(rays).unwrap();
    let any = world.cast_rays_any(rays).unwrap();
    assert_eq!(hits.len(), rays.len());
    let mut tally = Tally { asked: rays.len(), ..Tally::default() };
    for (i, ray) in rays.iter().enumerate() {
        assert_eq!(hits[i].is_some(), any[i], "{what}: ray {i}: {ray:?}: {:?}", hits[i]);
        let length = ray.direction.length();
        let theirs = oracle.cast(ray);
        let ours = hits[i].map(|hit| (oracle.find(hit.collider), hit));
        // Near the end of the ray, or of a collider, either may be right.
        let unsure = |entry: &parry::Entry, time: f32| {
            let at_the_end = (time - ray.max_time_of_impact).abs() * length <= 10.0 * NEAR;
            let inside = Ray { solid: !ray.solid, ..*ray };
            let both = [-NEAR, NEAR].map(|grown| oracle.time(entry, grown, ray));
            let begins_at_surface = [-NEAR, NEAR].map(|grown| oracle.time(entry, grown, &inside) == both[0]);
            let differ = match both {
                [Some(a), Some(b)] => (a - b).abs() * length > 100.0 * NEAR,
                [a, b] => a != b,
            };
            // Along a half-space's plane but for the rounding of its normal.
            let parallel = time * length > 1e6;
            parallel || at_the_end || differ || begins_at_surface[0] != begins_at_surface[1]
        };
        match (ours, theirs) {
            (None, None) => {}
            (Some((entry, hit)), Some((other, their))) => {
                tally.answered += 1;
                assert_eq!(entry.body, hit.body);
                assert!(hit.time_of_impact <= ray.max_time_of_impact, "{what}: ray {i}: {ray:?}: {hit:?}");
                let along = (their.normal.dot(ray.direction) / length).abs().max(if hit.time_of_impact == 0.0 { 1.0 } else { 1e-3 });
                let off = (hit.time_of_impact - their.time_of_impact).abs() * length * along
                    / (hit.time_of_impact * length).max(1.0);
                if off > NEAR {
                    let (first, time) = match hit.time_of_impact < their.time_of_impact {
                        true => (entry, hit.time_of_impact),
                        false => (other, their.time_of_impact),
                    };
                    assert!(unsure(first, time), "{what}: ray {i}: {ray:?}: {hit:?}, parry {:?} {their:?}", other.collider);
                    tally.grazing += 1;
                    continue;
                }
                tally.worst = tally.worst.max(off);
                if entry.collider != other.collider {
                    tally.ties += 1;
                } else if hit.time_of_impact > 0.0 && along > 0.05 {
                    tally.worst_normal = tally.worst_normal.max(hit.normal.distance(their.normal));
                } else if hit.time_of_impact == 0.0 && ray.solid {
                    assert!(hit.normal == Vec3::ZERO || hit.normal.is_normalized());
                }
            }
            (Some((entry, hit)), None) => {
                assert!(unsure(entry, hit.time_of_impact), "{what}: ray {i}: {ray:?}: {hit:?}, parry none");
                tally.grazing += 1;
            }
            (None, Some((entry, their))) => {
                assert!(unsure(entry, their.time_of_impact), "{what}: ray {i}: {ray:?}: none, parry {:?} {their:?}", entry.collider);
                tally.grazing += 1;
            }
        }
    }
    tally
}

/// Oracle: parry.
#[test]
fn rays_hit_what_parry_says() {
    for side in SIDES {
        let mut all = Tally::default();
        for (what, scene, before) in cases() {
            let mut world = side.world(&scene, &Params::default());
            steps(&mut world, before);
            let oracle = Oracle::new(&mut world);
            let rays = rays_in(&oracle, 3000, &mut Random::new(7));
            let tally = compare_rays(&format!("{side:?}, {what}"), &mut world, &oracle, &rays);
            eprintln!("{side:?}, {what}: {tally:?}");
            all.add(&tally);
        }
        eprintln!("{side:?}: {all:?}");
    }
}
