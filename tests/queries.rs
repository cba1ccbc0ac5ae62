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
use tumble_core::layout::{NO_COLLIDER, NO_NODE, QueryAnswer, TreeNode};
use tumble_core::{
    ColliderBuilder, MortonBits, Nearest, NearestQuery, OverlapShape, Overlaps, PackedScene, Params, Ray, RayHit,
    RigidBodyBuilder, RigidBodyType, Scene, query, scenes,
};
use tumble_cpu::query::Snapshot;
use tumble_gpu::Pipelines;
use worlds::{SIDES, Side, steps};

/// Balls, boxes and compounds of all kinds of bodies in a cube, `spread` octaves of sizes; three half-spaces around.
fn crowd(bodies: usize, octaves: f32, seed: u64) -> Scene {
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
        // 4.1e-6 in the crowds, 6.2e-6 over the hub's large plate, 2.5e-7 where all are boxes: parry's cast at a ball
        // takes the difference of squares. Ties are rays that begin inside several solids.
        assert!(all.worst < NEAR && all.worst_normal < 3e-3, "{side:?}: {all:?}");
        assert!(all.answered > 30_000 && all.ties < 1000 && all.grazing < 100, "{side:?}: {all:?}");
    }
}

fn shapes_in(oracle: &Oracle, count: usize, random: &mut Random) -> Vec<OverlapShape> {
    let region = region(oracle);
    let mut shape = |i: usize| {
        let center = place_in(random, region);
        let scale = 4f32.powf(random.range(-2.0, 1.5));
        let rotation = if i % 4 < 2 { random.rotation() } else { Quat::IDENTITY };
        match i % 2 {
            0 => OverlapShape::Ball { center, radius: if i % 10 == 0 { 0.0 } else { scale * random.range(0.1, 1.0) } },
            _ => {
                let half_extents = scale * Vec3::from_array(std::array::from_fn(|_| random.range(0.0, 1.0)));
                OverlapShape::Cuboid { center, half_extents, rotation: rotation * 1.5 }
            }
        }
    };
    (0..count).map(&mut shape).collect()
}

/// Oracle: parry. A collider that is listed overlaps the shape grown by `NEAR`, one that is not does not overlap the shape
/// shrunk by as much: so near none of the cases comes that another tolerance would be needed.
#[test]
fn overlaps_are_those_that_parry_finds() {
    for side in SIDES {
        let (mut found, mut unsure) = (0, 0);
        for (what, scene, before) in cases() {
            let mut world = side.world(&scene, &Params::default());
            steps(&mut world, before);
            let oracle = Oracle::new(&mut world);
            let shapes = shapes_in(&oracle, 1000, &mut Random::new(11));
            let overlaps = world.overlaps(&shapes).unwrap();
            assert_eq!((overlaps.len(), overlaps.iter().count()), (shapes.len(), shapes.len()));
            assert_eq!(overlaps.iter().map(<[_]>::len).sum::<usize>(), overlaps.all().len());
            for (i, shape) in shapes.iter().enumerate() {
                let list = &overlaps[i];
                assert!(
                    list.is_sorted_by_key(|overlap| overlap.collider.slot()),
                    "{side:?}, {what}: shape {i}: {list:?}"
                );
                let mut ours: Vec<_> = list.iter().map(|overlap| overlap.collider).collect();
                found += ours.len();
                for entry in oracle.candidates(shape) {
                    let place = ours.iter().position(|&collider| collider == entry.collider);
                    let grown = if place.is_some() { NEAR } else { -NEAR };
                    let meets = oracle.meets(entry, shape, grown);
                    let what = format!("{side:?}, {what}: shape {i}: {shape:?} and {:?}", entry.collider);
                    assert_eq!(meets, place.is_some(), "{what}, {:?}", entry.own);
                    unsure += usize::from(oracle.meets(entry, shape, 0.0) != place.is_some());
                    if let Some(place) = place {
                        assert_eq!(list.iter().find(|o| o.collider == entry.collider).unwrap().body, entry.body);
                        ours.remove(place);
                    }
                }
                assert!(ours.is_empty(), "{side:?}, {what}: shape {i}: {shape:?} is far from {ours:?}");
            }
        }
        eprintln!("{side:?}: {found} overlaps, {unsure} otherwise than parry");
        assert!(found > 30_000 && unsure < 10, "{side:?}: {found}, {unsure}");
    }
}

/// Oracle: parry.
#[test]
fn the_nearest_is_what_parry_says() {
    for side in SIDES {
        let mut all = Tally::default();
        for (what, scene, before) in cases() {
            let mut world = side.world(&scene, &Params::default());
            steps(&mut world, before);
            let oracle = Oracle::new(&mut world);
            let mut random = Random::new(13);
            let region = region(&oracle);
            let mut query = |i: usize| {
                let point = place_in(&mut random, region) * if i % 10 == 1 { 5.0 } else { 1.0 };
                let max_distance = if i % 3 == 0 { random.range(0.0, 2.0) } else { f32::INFINITY };
                NearestQuery { point, max_distance }
            };
            let queries: Vec<_> = (0..2000).map(&mut query).collect();
            let answers = world.nearest(&queries).unwrap();
            let mut tally = Tally { asked: queries.len(), ..Tally::default() };
            for (i, (query, ours)) in queries.iter().zip(&answers).enumerate() {
                let what = format!("{side:?}, {what}: point {i}: {query:?}: {ours:?}");
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
            eprintln!("{side:?}, {what}: {tally:?}");
            all.add(&tally);
        }
        eprintln!("{side:?}: {all:?}");
        assert!(all.worst_normal < NEAR && all.answered > 20_000 && all.grazing < 10, "{side:?}: {all:?}");
    }
}

/// Answers of all kinds, by slot.
fn ask_all(world: &mut World, rays: &[Ray], shapes: &[OverlapShape], points: &[NearestQuery]) -> Answers {
    Answers {
        hits: world.cast_rays(rays).unwrap(),
        any: world.cast_rays_any(rays).unwrap(),
        overlaps: world.overlaps(shapes).unwrap(),
        nearest: world.nearest(points).unwrap(),
    }
}

#[derive(Debug, PartialEq)]
struct Answers {
    hits: Vec<Option<RayHit>>,
    any: Vec<bool>,
    overlaps: Overlaps,
    nearest: Vec<Option<Nearest>>,
}

/// Rays, shapes and points around what a world holds.
fn questions(world: &mut World, count: usize, seed: u64) -> (Vec<Ray>, Vec<OverlapShape>, Vec<NearestQuery>) {
    let (oracle, mut random) = (Oracle::new(world), Random::new(seed));
    let region = region(&oracle);
    let rays = rays_in(&oracle, count, &mut random);
    let shapes = shapes_in(&oracle, count, &mut random);
    let points = (0..count).map(|_| NearestQuery::new(place_in(&mut random, region))).collect();
    (rays, shapes, points)
}

/// Oracle: the other side. Both hold the same states, since no step has run: they name the same colliders but where two are
/// as near to a few units in the last place.
#[test]
fn the_sides_agree() {
    for (seed, octaves) in [(21, 1.0), (22, 5.0)] {
        let scene = crowd(3000, octaves, seed);
        let mut worlds = SIDES.map(|side| side.world(&scene, &Params::default()));
        let (rays, shapes, points) = questions(&mut worlds[0], 6000, seed);
        let [cpu, gpu] = worlds.each_mut().map(|world| ask_all(world, &rays, &shapes, &points));
        let (mut others, mut worst) = (0, 0f32);
        for (i, (a, b)) in cpu.hits.iter().zip(&gpu.hits).enumerate() {
            match (a, b) {
                (Some(a), Some(b)) => {
                    let length = rays[i].direction.length();
                    let off =
                        (a.time_of_impact - b.time_of_impact).abs() * length / (a.time_of_impact * length).max(1.0);
                    worst = worst.max(off);
                    others += usize::from(a.collider != b.collider);
                }
                (a, b) => others += usize::from(a.is_some() != b.is_some()),
            }
        }
        for (a, b) in cpu.nearest.iter().zip(&gpu.nearest) {
            let (a, b) = (a.unwrap(), b.unwrap());
            worst = worst.max((a.distance - b.distance).abs());
            others += usize::from(a.collider != b.collider);
        }
        let lists = cpu.overlaps.iter().zip(gpu.overlaps.iter()).filter(|(a, b)| a != b).count();
        let met = cpu.any.iter().zip(&gpu.any).filter(|(a, b)| a != b).count();
        eprintln!("{others} other colliders, {lists} other lists, {met} other any, worst {worst:e}");
        // Of 12,000 answers and 6,000 lists none was another one, on llvmpipe.
        assert!(others + lists + met < 5 && worst < NEAR, "{others}, {lists}, {met}, {worst:e}");
    }
}

/// Oracle: the same world with another number of threads, or with passes in another order.
#[test]
fn answers_do_not_hang_on_the_order_of_work() {
    let scene = crowd(1200, 2.0, 31);
    let mut first = Side::Cpu.world(&scene, &Params::default());
    let (rays, shapes, points) = questions(&mut first, 1500, 32);
    let expected = ask_all(&mut first, &rays, &shapes, &points);
    for threads in [1, 3] {
        let params = Params { threads: Some(threads), morton_bits: MortonBits::Bits63, ..Params::default() };
        assert!(
            ask_all(&mut Side::Cpu.world(&scene, &params), &rays, &shapes, &points) == expected,
            "{threads} threads"
        );
    }
    let mut expected = None;
    for permute in 0..3 {
        for morton_bits in [MortonBits::Bits30, MortonBits::Bits63] {
            let params = Params { morton_bits, ..Params::default() };
            let pipelines = Pipelines::permuted(permute);
            let world = tumble_gpu::World::with_pipelines(common::gpu().clone(), pipelines, scene.clone(), params);
            let answers = ask_all(&mut World::Gpu(Box::new(world.unwrap())), &rays, &shapes, &points);
            assert!(
                *expected.get_or_insert_with(|| ask_all(
                    &mut Side::Gpu.world(&scene, &params),
                    &rays,
                    &shapes,
                    &points
                )) == answers,
                "order {permute}, {morton_bits:?}"
            );
        }
    }
}

/// Oracle: brute force over every leaf, bit for bit; in trees so deep that the stack of a walk has no room.
#[test]
fn a_walk_finds_what_a_look_at_all_leaves_does() {
    let mut random = Random::new(41);
    let mut deep = Scene::new();
    for i in 0..400 {
        // Sizes and distances from one corner halve and halve: each split leaves one body aside.
        let scale = 2f32.powf(-(i % 60) as f32 / 3.0) * 1000.0;
        let at = RigidBodyBuilder::fixed().translation(scale * (Vec3::ONE + 0.2 * random.vector(1.0)));
        deep.insert(at, ColliderBuilder::ball(2.0 * scale));
    }
    for (scene, bits) in
        [(crowd(600, 4.0, 42), MortonBits::Bits30), (deep.clone(), MortonBits::Bits63), (deep, MortonBits::Bits30)]
    {
        let packed = PackedScene::new(&scene).unwrap();
        let with_tree = Snapshot::new(&packed.colliders, &packed.states, bits);
        let mut world = Side::Cpu.world(&scene, &Params::default());
        let (rays, shapes, points) = questions(&mut world, 800, 43);
        let leaves = with_tree.tree.nodes.iter().step_by(2).copied().collect::<Vec<_>>();
        // One leaf at a time.
        let alone = |leaf: &TreeNode| {
            let mut one = Snapshot { placed: with_tree.placed.clone(), unbounded: Vec::new(), ..Snapshot::default() };
            one.tree.members = vec![leaf.child];
            one.tree.nodes = vec![TreeNode { escape: NO_NODE, ..*leaf }];
            one
        };
        let mut each: Vec<Snapshot> = leaves.iter().map(alone).collect();
        each.push(Snapshot { tree: Default::default(), ..with_tree.clone() });
        for ray in query::pack_rays(&rays).unwrap() {
            let nearer = |a: QueryAnswer, b: QueryAnswer| match (a.distance, a.collider) < (b.distance, b.collider) {
                true => a,
                false => b,
            };
            let best = each.iter().map(|one| one.closest(&ray).0).reduce(nearer).unwrap();
            assert_eq!(with_tree.closest(&ray).0, best);
            assert_eq!(with_tree.any(&ray).0, best.collider != NO_COLLIDER);
        }
        for point in query::pack_points(&points).unwrap() {
            // Roots of squares are compared here, so that squares a unit apart may look the same.
            let best = each.iter().map(|one| one.nearest(&point).0).filter(|answer| answer.collider != NO_COLLIDER);
            let best = best.map(|answer| answer.distance).fold(f32::INFINITY, f32::min);
            assert_eq!(with_tree.nearest(&point).0.distance, best);
        }
        for volume in query::pack_shapes(&shapes).unwrap() {
            let (mut all, mut found) = (Vec::new(), Vec::new());
            each.iter().for_each(|one| _ = one.overlaps(&volume, &mut all));
            with_tree.overlaps(&volume, &mut found);
            all.sort_unstable();
            found.sort_unstable();
            assert_eq!(found, all);
        }
    }
}
