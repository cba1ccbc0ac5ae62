//! Rays, overlaps and nearest points on both sides. Oracles: parry's casts, projections, intersection tests and tree
//! over the poses that the same world reports; and, where a test says so, the other side, brute force or analysis.

mod common;
#[path = "common/parry.rs"]
mod parry;
#[expect(dead_code, reason = "it asks its own questions")]
#[path = "common/queries.rs"]
mod queries;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use parry::Oracle;
use queries::{crowd, place_in, rays_in, region, shapes_in};
use random::Random;
use tumble::World;
use tumble_core::glam::Vec3;
use tumble_core::{NearestQuery, Params, Ray, Scene, scenes};
use worlds::{Side, steps};

/// Every scene that is asked about: name, scene, steps before.
fn cases() -> Vec<(String, Scene, usize)> {
    let mut cases = vec![
        ("crowd".into(), crowd(1500, 1.0, 1), 0),
        ("crowd of many sizes".into(), crowd(1500, 6.0, 2), 0),
        ("crowd that moved".into(), crowd(700, 2.0, 3), 12),
    ];
    // Without chains and nets: of 400 small balls they are 200 m long, and parry's own rounding shows.
    for scene in scenes::ALL.iter().filter(|scene| (scene.build)(20).joint_count() == 0) {
        cases.push((format!("{}, falling", scene.name), (scene.build)(400), 25));
    }
    for bodies in 0..3 {
        cases.push((format!("{bodies} bodies"), scenes::mixed(bodies), 3));
    }
    cases.push(("nothing".into(), Scene::new(), 1));
    cases.push(("one box".into(), scenes::free_box().0, 0));
    cases
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
                let along = (their.normal.dot(ray.direction) / length).abs().max(if hit.time_of_impact == 0.0 {
                    1.0
                } else {
                    1e-3
                });
                let off = (hit.time_of_impact - their.time_of_impact).abs() * length * along
                    / (hit.time_of_impact * length).max(1.0);
                if off > NEAR {
                    let (first, time) = match hit.time_of_impact < their.time_of_impact {
                        true => (entry, hit.time_of_impact),
                        false => (other, their.time_of_impact),
                    };
                    assert!(
                        unsure(first, time),
                        "{what}: ray {i}: {ray:?}: {hit:?}, parry {:?} {their:?}",
                        other.collider
                    );
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
                assert!(
                    unsure(entry, their.time_of_impact),
                    "{what}: ray {i}: {ray:?}: none, parry {:?} {their:?}",
                    entry.collider
                );
                tally.grazing += 1;
            }
        }
    }
    tally
}

/// A collider that is listed overlaps the shape grown by `NEAR`, one that is not does not overlap the shape shrunk by as
/// much.
fn compare_overlaps(what: &str, world: &mut World, oracle: &Oracle, random: &mut Random) -> Tally {
    let mut tally = Tally::default();
    let shapes = shapes_in(oracle, 1000, random);
    let overlaps = world.overlaps(&shapes).unwrap();
    assert_eq!((overlaps.len(), overlaps.iter().count()), (shapes.len(), shapes.len()));
    assert_eq!(overlaps.iter().map(<[_]>::len).sum::<usize>(), overlaps.all().len());
    for (i, shape) in shapes.iter().enumerate() {
        let list = &overlaps[i];
        assert!(list.is_sorted_by_key(|overlap| overlap.collider.slot()), "{what}: shape {i}: {list:?}");
        let mut ours: Vec<_> = list.iter().map(|overlap| overlap.collider).collect();
        tally.answered += ours.len();
        for entry in oracle.candidates(shape) {
            let place = ours.iter().position(|&collider| collider == entry.collider);
            let grown = if place.is_some() { NEAR } else { -NEAR };
            let meets = oracle.meets(entry, shape, grown);
            let what = format!("{what}: shape {i}: {shape:?} and {:?}", entry.collider);
            assert_eq!(meets, place.is_some(), "{what}, {:?}", entry.own);
            tally.grazing += usize::from(oracle.meets(entry, shape, 0.0) != place.is_some());
            if let Some(place) = place {
                assert_eq!(list.iter().find(|o| o.collider == entry.collider).unwrap().body, entry.body);
                ours.remove(place);
            }
        }
        assert!(ours.is_empty(), "{what}: shape {i}: {shape:?} is far from {ours:?}");
    }
    tally.asked = shapes.len();
    tally
}

fn compare_nearest(what: &str, world: &mut World, oracle: &Oracle, random: &mut Random) -> Tally {
    let region = region(oracle);
    let mut query = |i: usize| {
        let point = place_in(random, region) * if i % 10 == 1 { 5.0 } else { 1.0 };
        let max_distance = if i.is_multiple_of(3) { random.range(0.0, 2.0) } else { f32::INFINITY };
        NearestQuery { point, max_distance }
    };
    let queries: Vec<_> = (0..2000).map(&mut query).collect();
    let answers = world.nearest(&queries).unwrap();
    let mut tally = Tally { asked: queries.len(), ..Tally::default() };
    for (i, (query, ours)) in queries.iter().zip(&answers).enumerate() {
        let what = format!("{what}: point {i}: {query:?}: {ours:?}");
        match (ours, oracle.nearest(query)) {
            (None, None) => {}
            (Some(ours), Some((entry, point, distance))) => {
                tally.answered += 1;
                assert_eq!(ours.body, oracle.find(ours.collider).body);
                let scale = query.point.abs().max_element().max(1.0);
                let off = (ours.distance - distance).abs() / scale;
                assert!(off < NEAR, "{what}, parry {:?} {point} {distance}", entry.collider);
                assert!((ours.point.distance(query.point) - ours.distance).abs() < NEAR * scale, "{what}");
                tally.worst = tally.worst.max(off);
                if ours.collider == entry.collider {
                    tally.worst_normal = tally.worst_normal.max(ours.point.distance(point) / scale);
                } else {
                    tally.ties += 1;
                }
            }
            (ours, theirs) => {
                let distance = ours.map_or_else(|| theirs.unwrap().2, |ours| ours.distance);
                assert!((distance - query.max_distance).abs() < NEAR, "{what}: {distance}");
                tally.grazing += 1;
            }
        }
    }
    tally
}

/// Every kind of query in every scene.
fn agrees_with_parry(side: Side) {
    let (mut rays, mut overlaps, mut nearest) = (Tally::default(), Tally::default(), Tally::default());
    for (name, scene, before) in cases() {
        let what = format!("{side:?}, {name}");
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, before);
        let oracle = Oracle::new(&mut world);
        let mut random = Random::new(7);
        rays.add(&compare_rays(&what, &mut world, &oracle, &rays_in(&oracle, 3000, &mut random)));
        overlaps.add(&compare_overlaps(&what, &mut world, &oracle, &mut random));
        nearest.add(&compare_nearest(&what, &mut world, &oracle, &mut random));
    }
    eprintln!("{side:?}: rays {rays:?}\noverlaps {overlaps:?}\nnearest {nearest:?}");
    // Rays: 4.1e-6 in the crowds, 6.2e-6 over the hub's large plate, 2.5e-7 where all are boxes: parry's cast at a ball
    // takes the difference of squares. Ties are rays that begin inside several solids.
    assert!(rays.worst < NEAR && rays.worst_normal < 3e-3, "{rays:?}");
    assert!(rays.answered > 30_000 && rays.ties < 1000 && rays.grazing < 100, "{rays:?}");
    // No list of 75,000 overlaps was another one than parry's.
    assert!(overlaps.answered > 30_000 && overlaps.grazing < 10, "{overlaps:?}");
    // 4.6e-7 of the largest coordinate.
    assert!(nearest.answered > 20_000 && nearest.worst_normal < NEAR && nearest.grazing < 10, "{nearest:?}");
}

/// Oracle: parry.
#[test]
fn the_cpu_agrees_with_parry() {
    agrees_with_parry(Side::Cpu);
}

/// Oracle: parry.
#[test]
fn the_gpu_agrees_with_parry() {
    agrees_with_parry(Side::Gpu);
}
