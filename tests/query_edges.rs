//! Queries at the edges: edits that no step has taken, worlds that grow, shrink or stand still, bad values, bounds of
//! loops. Oracle: analysis, but where a test names another.

mod common;
#[expect(dead_code, reason = "only its shapes and casts are asked for")]
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
use queries::rays_in;
use random::Random;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::limits::{TURN_LIMIT, UNBOUNDED_LIMIT};
use tumble_core::{
    Capacities, ColliderBuilder, Error, NearestQuery, OverlapShape, Params, Ray, Result, RigidBodyBuilder, Scene,
    scenes,
};
use worlds::{SIDES, report, steps};

const NAN: f32 = f32::NAN;
const INF: f32 = f32::INFINITY;

fn down(x: f32) -> Ray {
    Ray::new(Vec3::new(x, 100.0, 0.0), -Vec3::Y)
}

/// Fixed balls of radius 1 along the x axis, 10 m apart.
fn row(count: usize) -> Scene {
    let mut scene = Scene::new();
    for i in 0..count {
        let at = RigidBodyBuilder::fixed().translation(Vec3::X * (10.0 * i as f32));
        scene.insert(at, ColliderBuilder::ball(1.0));
    }
    scene
}

#[test]
fn edits_are_seen_once_a_step_has_applied_them() {
    for side in SIDES {
        let mut scene = row(3);
        let extra = scene.insert(RigidBodyBuilder::fixed().translation(Vec3::Y * 5.0), ColliderBuilder::ball(1.0));
        let mut world = side.world(&scene, &Params::default());
        let bodies: Vec<_> = scene.bodies().collect();
        let looks = |x: f32| [down(x)];
        // Gone, replaced in the same slot, and moved: nothing of it before the step.
        world.edit().remove(extra.body).unwrap();
        let new = RigidBodyBuilder::fixed().translation(Vec3::new(70.0, 0.0, 0.0));
        let new = world.edit().insert(new, ColliderBuilder::cuboid(1.0, 2.0, 1.0)).unwrap();
        let further = RigidBodyBuilder::fixed().translation(Vec3::new(80.0, 0.0, 0.0));
        let further = world.edit().insert(further, ColliderBuilder::ball(3.0)).unwrap();
        let attached = world.edit().attach(bodies[1], ColliderBuilder::ball(1.0).translation(Vec3::Y * 4.0)).unwrap();
        world.edit().set_pose(bodies[2], Vec3::new(20.0, 50.0, 0.0).into()).unwrap();
        assert_eq!(new.collider.slot(), extra.collider.slot(), "the slot is taken again");
        let hit = |world: &mut tumble::World, x: f32| world.cast_rays(&looks(x)).unwrap()[0];
        for _ in 0..2 {
            let seen = hit(&mut world, 0.0).unwrap();
            assert_eq!((seen.collider, seen.body, seen.time_of_impact), (extra.collider, extra.body, 94.0), "{side:?}");
            assert_eq!(hit(&mut world, 70.0), None, "{side:?}");
            assert_eq!(hit(&mut world, 80.0), None, "{side:?}");
            assert_eq!(hit(&mut world, 10.0).unwrap().time_of_impact, 99.0, "{side:?}");
            assert_eq!(hit(&mut world, 20.0).unwrap().time_of_impact, 99.0, "{side:?}");
        }
        steps(&mut world, 1);
        let seen = hit(&mut world, 0.0).unwrap();
        assert_eq!((seen.body, seen.time_of_impact), (bodies[0], 99.0), "{side:?}");
        let seen = hit(&mut world, 70.0).unwrap();
        assert_eq!((seen.collider, seen.body, seen.time_of_impact), (new.collider, new.body, 98.0), "{side:?}");
        let seen = hit(&mut world, 80.0).unwrap();
        assert_eq!((seen.collider, seen.time_of_impact), (further.collider, 97.0), "{side:?}");
        let seen = hit(&mut world, 10.0).unwrap();
        assert_eq!((seen.collider, seen.body, seen.time_of_impact), (attached, bodies[1], 95.0), "{side:?}");
        assert_eq!(hit(&mut world, 20.0).unwrap().time_of_impact, 49.0, "{side:?}");
        // Nothing grows, and the state is another one.
        world.edit().set_pose(bodies[2], Vec3::new(20.0, 30.0, 0.0).into()).unwrap();
        steps(&mut world, 1);
        assert_eq!(hit(&mut world, 20.0).unwrap().time_of_impact, 69.0, "{side:?}");
    }
}

/// Oracle: parry, after the world has grown past the room that it had at the first query, and after it has shrunk.
#[test]
fn worlds_that_grow_and_shrink_are_asked() {
    for side in SIDES {
        let mut world = side.world(&row(4), &Params::default());
        assert!(world.cast_rays(&[down(30.0)]).unwrap()[0].is_some());
        let mut random = Random::new(5);
        for i in 0..2500 {
            let at = RigidBodyBuilder::dynamic().translation(random.vector(12.0)).rotation(random.rotation());
            let collider = if i % 2 == 0 { ColliderBuilder::ball(0.4) } else { ColliderBuilder::cuboid(0.3, 0.4, 0.5) };
            world.edit().insert(at, collider).unwrap();
        }
        let mut check = |world: &mut tumble::World, least: usize| {
            let oracle = Oracle::new(world);
            let rays = rays_in(&oracle, 1000, &mut random);
            let hits = world.cast_rays(&rays).unwrap();
            let near = |i: &usize| {
                let ray = &rays[*i];
                let (ours, theirs) =
                    (hits[*i].map(|hit| hit.time_of_impact), oracle.cast(ray).map(|hit| hit.1.time_of_impact));
                let off = ours.zip(theirs).map(|(a, b)| (a - b).abs() * ray.direction.length());
                off.map_or(ours == theirs, |off| off < 1e-3)
            };
            let agree = (0..rays.len()).filter(near).count();
            // What grazes is looked at in `queries`: it is less than one in a hundred there.
            assert!(agree >= 990, "{side:?}: {agree}");
            let hit = hits.iter().flatten().count();
            assert!(hit >= least, "{side:?}: {hit}");
        };
        steps(&mut world, 2);
        check(&mut world, 500);
        let bodies: Vec<_> = world.scene().bodies().skip(4).collect();
        for body in bodies {
            world.edit().remove(body).unwrap();
        }
        steps(&mut world, 1);
        check(&mut world, 50);
        let all: Vec<_> = world.scene().bodies().collect();
        all.into_iter().for_each(|body| world.edit().remove(body).unwrap());
        steps(&mut world, 1);
        assert_eq!(world.cast_rays(&[down(30.0)]).unwrap(), [None]);
        assert_eq!(world.nearest(&[NearestQuery::new(Vec3::ZERO)]).unwrap(), [None]);
        assert!(world.overlaps(&[OverlapShape::Ball { center: Vec3::ZERO, radius: 1e7 }]).unwrap()[0].is_empty());
    }
}

/// No query is fine, and so are more than one dispatch takes.
#[test]
fn batches_of_any_size() {
    for side in SIDES {
        let mut world = side.world(&row(5), &Params::default());
        assert!(world.cast_rays(&[]).unwrap().is_empty());
        assert!(world.cast_rays_any(&[]).unwrap().is_empty());
        assert!(world.overlaps(&[]).unwrap().is_empty());
        assert!(world.nearest(&[]).unwrap().is_empty());
        let bodies: Vec<_> = world.scene().bodies().collect();
        let count = 140_000;
        let x = |i: usize| 10.0 * (i % 7) as f32;
        let body = |i: usize| bodies.get(i % 7).copied();
        let hits = world.cast_rays(&(0..count).map(|i| down(x(i))).collect::<Vec<_>>()).unwrap();
        let any = world.cast_rays_any(&(0..count).map(|i| down(x(i))).collect::<Vec<_>>()).unwrap();
        let balls = |i: usize| OverlapShape::Ball { center: Vec3::X * x(i), radius: 0.5 };
        let overlaps = world.overlaps(&(0..count).map(balls).collect::<Vec<_>>()).unwrap();
        let points = |i: usize| NearestQuery { point: Vec3::new(x(i), 3.0, 0.0), max_distance: 2.5 };
        let nearest = world.nearest(&(0..count).map(points).collect::<Vec<_>>()).unwrap();
        for i in 0..count {
            assert_eq!(hits[i].map(|hit| hit.body), body(i), "{side:?}: {i}");
            assert_eq!(any[i], body(i).is_some(), "{side:?}: {i}");
            assert_eq!(overlaps[i].first().map(|overlap| overlap.body), body(i), "{side:?}: {i}");
            assert_eq!(nearest[i].map(|nearest| nearest.body), body(i), "{side:?}: {i}");
        }
    }
}

/// Where two answer as well, the lower slot does; and what lies on the bound counts.
#[test]
fn ties_and_bounds() {
    for side in SIDES {
        let mut scene = Scene::new();
        for _ in 0..50 {
            scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(1.0, 1.0, 1.0));
            scene.insert(RigidBodyBuilder::fixed().translation(Vec3::X * 4.0), ColliderBuilder::ball(1.0));
        }
        let mut world = side.world(&scene, &Params::default());
        let first: Vec<_> = scene.bodies().collect();
        let ray =
            |x: f32, most: f32| Ray { max_time_of_impact: most, ..Ray::new(Vec3::new(x, 3.0, 0.0), -2.0 * Vec3::Y) };
        let hits = world.cast_rays(&[ray(0.0, INF), ray(4.0, INF), ray(0.0, 1.0), ray(0.0, 0.99)]).unwrap();
        assert_eq!(hits[0].map(|hit| (hit.body, hit.time_of_impact, hit.normal)), Some((first[0], 1.0, Vec3::Y)));
        assert_eq!(hits[1].map(|hit| (hit.body, hit.time_of_impact, hit.normal)), Some((first[1], 1.0, Vec3::Y)));
        assert_eq!(hits[2], hits[0], "{side:?}");
        assert_eq!(hits[3], None, "{side:?}");
        let inside = Ray { solid: false, ..Ray::new(Vec3::ZERO, Vec3::X) };
        let hits = world.cast_rays(&[inside, Ray { solid: true, ..inside }]).unwrap();
        assert_eq!(hits[0].map(|hit| (hit.body, hit.time_of_impact, hit.normal)), Some((first[0], 1.0, -Vec3::X)));
        assert_eq!(hits[1].map(|hit| (hit.body, hit.time_of_impact, hit.normal)), Some((first[0], 0.0, Vec3::ZERO)));
        let nearest = |x: f32, max_distance: f32| NearestQuery { point: Vec3::X * x, max_distance };
        let near =
            world.nearest(&[nearest(2.0, 1.0), nearest(2.0, 0.99), nearest(4.5, 0.0), nearest(-3.0, INF)]).unwrap();
        assert_eq!(near[0].map(|near| (near.body, near.point, near.distance)), Some((first[0], Vec3::X, 1.0)));
        assert_eq!(near[1], None, "{side:?}");
        assert_eq!(near[2].map(|near| (near.body, near.point, near.distance)), Some((first[1], Vec3::X * 4.5, 0.0)));
        assert_eq!(near[3].map(|near| (near.body, near.point, near.distance)), Some((first[0], -Vec3::X, 2.0)));
        // Shapes that touch overlap; all 50, in the order of their slots.
        let half_extents = Vec3::new(1.0, 0.5, 0.0);
        let touching = OverlapShape::Cuboid { center: Vec3::X * 2.0, half_extents, rotation: Quat::IDENTITY };
        let list: Vec<_> = world.overlaps(&[touching]).unwrap()[0].iter().map(|overlap| overlap.body).collect();
        assert_eq!(list, first, "{side:?}");
    }
}

#[track_caller]
fn refused<T>(result: Result<T>) -> (String, &'static str) {
    let error = result.err().expect("an error");
    let message = error.to_string();
    let Error::Invalid { what, field, value, allowed } = error else { panic!("{message}") };
    for part in [what.as_str(), field, value.as_str(), allowed] {
        assert!(!part.is_empty() && message.contains(part), "{message} lacks {part}");
    }
    (what, field)
}

#[test]
fn bad_values_are_named() {
    for side in SIDES {
        let mut world = side.world(&row(2), &Params::default());
        let good = down(0.0);
        let mut rays = vec![(Ray { direction: Vec3::ZERO, ..good }, "direction")];
        let ball = |center, radius| OverlapShape::Ball { center, radius };
        let cuboid = |half_extents, rotation| OverlapShape::Cuboid { center: Vec3::ZERO, half_extents, rotation };
        let mut shapes = vec![
            (ball(Vec3::ZERO, -1.0), "radius"),
            (cuboid(Vec3::new(1.0, -1e-9, 1.0), Quat::IDENTITY), "half_extents"),
            (cuboid(Vec3::ONE, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)), "rotation"),
        ];
        let mut points = Vec::new();
        for bad in [NAN, INF, -INF] {
            rays.push((Ray { origin: Vec3::X * bad, ..good }, "origin"));
            rays.push((Ray { direction: Vec3::new(1.0, bad, 0.0), ..good }, "direction"));
            shapes.push((ball(Vec3::new(0.0, bad, 0.0), 1.0), "center"));
            shapes.push((ball(Vec3::ZERO, bad), "radius"));
            shapes.push((cuboid(Vec3::new(1.0, 1.0, bad), Quat::IDENTITY), "half_extents"));
            shapes.push((cuboid(Vec3::ONE, Quat::from_xyzw(bad, 0.0, 0.0, 1.0)), "rotation"));
            points.push((NearestQuery::new(Vec3::new(0.0, 0.0, bad)), "point"));
        }
        for bad in [NAN, -1.0, -INF] {
            rays.push((Ray { max_time_of_impact: bad, ..good }, "max_time_of_impact"));
            points.push((NearestQuery { max_distance: bad, ..NearestQuery::new(Vec3::ZERO) }, "max_distance"));
        }
        for (ray, field) in rays {
            assert_eq!(refused(world.cast_rays(&[good, good, ray])), ("ray 2".into(), field));
            assert_eq!(refused(world.cast_rays_any(&[ray, good])), ("ray 0".into(), field));
        }
        for (shape, field) in shapes {
            assert_eq!(refused(world.overlaps(&[ball(Vec3::ZERO, 0.0), shape])), ("overlap shape 1".into(), field));
        }
        for (point, field) in points {
            let result = world.nearest(&[NearestQuery::new(Vec3::ZERO), point]);
            assert_eq!(refused(result), ("nearest query 1".into(), field));
        }
        assert!(world.cast_rays(&[good]).unwrap()[0].is_some(), "the world stays good");
        // Short, long and far, and fine.
        let odd = [1e-9, 1e9].map(|length| Ray { direction: -Vec3::Y * length, ..good });
        let times = world.cast_rays(&odd).unwrap().into_iter().map(|hit| hit.unwrap().time_of_impact);
        times.zip([99e9, 99e-9]).for_each(|(time, expected)| assert!((time / expected - 1.0).abs() < 1e-6));
    }
}

/// A query that a shader's loop cannot finish is an error on both sides, and the next one is answered. One that just can is
/// answered in full: the drivers' own bound is not met (llvmpipe ends loops in silence).
#[test]
fn loops_have_bounds() {
    for side in SIDES {
        let mut scene = Scene::new();
        for i in 0..TURN_LIMIT as usize / 2 + 100 {
            let at = Vec3::new((i % 160) as f32, (i / 160) as f32, 0.0);
            scene.insert(RigidBodyBuilder::fixed().translation(at), ColliderBuilder::ball(0.4));
        }
        let mut world = side.world(&scene, &Params::default());
        let over = |radius| OverlapShape::Ball { center: Vec3::new(80.0, 80.0, 0.0), radius };
        let most = u64::from(TURN_LIMIT);
        let too_many = Error::Capacity { buffer: "query", needed: most + 1, capacity: most };
        let error = world.overlaps(&[over(1.0), over(1000.0), over(2.0)]).map(|lists| lists.all().len()).unwrap_err();
        assert_eq!(error, too_many, "{side:?}");
        assert!(error.to_string().contains("smaller"), "{error}");
        let fewer = world.overlaps(&[over(70.0)]).unwrap();
        assert!((fewer[0].len() as f32 / (70.4f32 * 70.4 * std::f32::consts::PI) - 1.0).abs() < 0.01, "{side:?}");

        // All in one place, so that none is nearer than another.
        let half = TURN_LIMIT as usize / 2;
        for (count, fits) in [(half - 10, true), (half + 10, false)] {
            let mut scene = Scene::new();
            (0..count).for_each(|_| _ = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.4)));
            let first = scene.bodies().next();
            let mut world = side.world(&scene, &Params::default());
            let hit = world.cast_rays(&[down(9.0), down(0.0), down(9.0)]);
            let near = world.nearest(&[NearestQuery::new(Vec3::X)]);
            let list =
                world.overlaps(&[OverlapShape::Ball { center: Vec3::X, radius: 1.0 }]).map(|lists| lists[0].len());
            if fits {
                assert_eq!(
                    hit.unwrap().iter().map(|hit| hit.map(|hit| hit.body)).collect::<Vec<_>>(),
                    [None, first, None]
                );
                assert_eq!(near.unwrap()[0].map(|near| near.body), first, "{side:?}");
                assert_eq!(list, Ok(count), "{side:?}");
            } else {
                assert_eq!(hit.unwrap_err(), too_many, "{side:?}");
                assert_eq!(near.unwrap_err(), too_many, "{side:?}");
                assert_eq!(list, Err(too_many.clone()), "{side:?}");
            }
            assert!(world.cast_rays_any(&[down(0.0)]).unwrap()[0], "{side:?}");
        }

        let (mut scene, most) = (Scene::new(), u64::from(UNBOUNDED_LIMIT));
        for _ in 0..=UNBOUNDED_LIMIT {
            scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        }
        let mut world = side.world(&scene, &Params::default());
        let too_many = Error::Capacity { buffer: "half-spaces", needed: most + 1, capacity: most };
        assert_eq!(world.cast_rays(&[down(0.0)]).unwrap_err(), too_many, "{side:?}");
        assert_eq!(world.nearest(&[NearestQuery::new(Vec3::ZERO)]).unwrap_err(), too_many, "{side:?}");
    }
}

/// Oracle: the host's constants.
#[test]
fn shaders_have_the_same_bounds() {
    for stem in ["query/closest", "query/overlap"] {
        let source = tumble_shaders::compose(stem).unwrap().source;
        for (name, value) in [("TURN_LIMIT", TURN_LIMIT), ("UNBOUNDED_LIMIT", UNBOUNDED_LIMIT)] {
            assert!(source.contains(&format!("const {name}: u32 = {value}u;")), "{stem}: {name}");
        }
    }
}

/// While a step waits for room, so do queries: its edits are half applied. They are answered once it has run.
#[test]
fn a_step_without_room_is_told() {
    for side in SIDES {
        let capacities = Capacities { pairs: Some(8), grow: false, ..Capacities::default() };
        let params = Params { capacities, ..Params::default() };
        let mut world = side.world(&scenes::pyramid(10), &params);
        let before = world.cast_rays(&[down(0.3)]).unwrap();
        // On a GPU the error comes with a later call.
        _ = world.step();
        for _ in 0..2 {
            match world.cast_rays(&[down(0.3)]) {
                Err(Error::Capacity { buffer: "pairs", .. }) => {}
                other => panic!("{side:?}: {other:?}, and {before:?} before"),
            }
        }
        world.set_params(Params::default()).unwrap();
        steps(&mut world, 1);
        assert!(world.cast_rays(&[down(0.3)]).unwrap()[0].is_some(), "{side:?}");
    }
}

/// A world that is never asked has no buffer for it.
#[test]
fn who_does_not_ask_does_not_pay() {
    for side in SIDES {
        let mut world = side.world(&scenes::pile(200), &Params::default());
        steps(&mut world, 1);
        let before = report(&mut world).memory_bytes;
        assert!(world.cast_rays_any(&[down(0.0)]).unwrap()[0]);
        steps(&mut world, 1);
        let after = report(&mut world).memory_bytes;
        assert!(after > before + 200 * 100, "{side:?}: {before} and {after}");
    }
}

/// Queries leave the motion alone. Oracle: the same world, never asked.
#[test]
fn queries_do_not_disturb() {
    for side in SIDES {
        let [mut asked, mut left] = [0, 1].map(|_| side.world(&scenes::mixed(150), &Params::default()));
        for _ in 0..10 {
            steps(&mut asked, 1);
            asked.cast_rays(&[down(0.0)]).unwrap();
            asked.overlaps(&[OverlapShape::Ball { center: Vec3::Y, radius: 3.0 }]).unwrap();
        }
        steps(&mut left, 10);
        assert_eq!(worlds::hash(&mut asked), worlds::hash(&mut left), "{side:?}");
    }
}

/// README.md shows what the documentation tests run. Oracle: the documentation.
#[test]
fn the_readme_agrees() {
    let (readme, world) = (include_str!("../README.md"), include_str!("../src/world.rs"));
    let begin = "let hits = world.cast_rays(";
    let shown = &readme[readme.find(begin).expect("the example")..];
    let shown = &shown[..shown.find("```").expect("its end")];
    let documented: Vec<_> = world.lines().filter_map(|line| line.strip_prefix("    /// ")).collect();
    assert!(documented.join("\n").contains(shown.trim_end()), "{shown}");
}
