//! Queries a second: `cargo bench --bench query`.
//!
//! Rays, nearest points and overlaps in a pile, on the CPU with one thread and with all, on the GPU with upload and
//! download, and by parry's BVH over the same colliders, all in one run and by turns. Beside the walk from near to far
//! the plain one from left to right by escapes. `--quick` asks little, as a test; `--no-gpu` leaves out the GPU.

use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose as ParryPose;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::Ray as ParryRay;
use parry3d::shape::{Ball, Cuboid, HalfSpace, Shape as ParryShape};
use rayon::prelude::*;
use std::time::Instant;
use tumble::{Error, NearestQuery, OverlapShape, Params, Ray, Result, Scene, Shape, World};
use tumble_core::glam::Vec3;
use tumble_core::layout::{NO_NODE, QueryRay, root_of};
use tumble_core::{MortonBits, PackedScene, query, scenes};
use tumble_cpu::query::{Snapshot, shapes};

/// SplitMix64: the same numbers everywhere.
struct Random(u64);

impl Random {
    /// From -1 up to 1.
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

type Placed = (Box<dyn ParryShape>, ParryPose);

/// Parry's tree over the colliders of a scene, and its half-spaces.
struct Parry {
    colliders: Vec<Placed>,
    endless: Vec<u32>,
    bvh: Bvh,
}

impl Parry {
    fn new(scene: &Scene) -> Result<Self> {
        let (mut colliders, mut endless, mut boxes) = (Vec::<Placed>::new(), Vec::new(), Vec::<(usize, Aabb)>::new());
        for body in scene.bodies() {
            let at = scene.body(body)?.clone();
            for (_, builder) in scene.colliders_of(body)? {
                let position = at.translation + at.rotation * builder.translation;
                let pose = ParryPose::from_parts(position, at.rotation * builder.rotation);
                let shape: Box<dyn ParryShape> = match builder.shape {
                    Shape::Ball { radius } => Box::new(Ball::new(radius)),
                    Shape::Cuboid { half_extents } => Box::new(Cuboid::new(half_extents)),
                    Shape::HalfSpace { normal } => Box::new(HalfSpace::new(normal)),
                    _ => continue,
                };
                match builder.shape {
                    Shape::HalfSpace { .. } => endless.push(colliders.len() as u32),
                    _ => boxes.push((colliders.len(), shape.compute_aabb(&pose))),
                }
                colliders.push((shape, pose));
            }
        }
        Ok(Self { colliders, endless, bvh: Bvh::from_iter(BvhBuildStrategy::Binned, boxes) })
    }

    fn cast(&self, ray: &Ray) -> Option<(u32, f32)> {
        let own = ParryRay::new(ray.origin, ray.direction);
        let cast = |i: u32, most: f32| {
            let (shape, pose) = &self.colliders[i as usize];
            shape.cast_ray(pose, &own, most, ray.solid)
        };
        let mut best = self.bvh.cast_ray(&own, f32::MAX, cast);
        for &i in &self.endless {
            best = cast(i, best.map_or(f32::MAX, |best| best.1)).map(|time| (i, time)).or(best);
        }
        let (i, _) = best?;
        let (shape, pose) = &self.colliders[i as usize];
        shape.cast_ray_and_get_normal(pose, &own, f32::MAX, ray.solid).map(|hit| (i, hit.time_of_impact))
    }

    fn nearest(&self, point: Vec3) -> Option<(u32, f32)> {
        let project = |i: u32, _: f32| {
            let (shape, pose) = &self.colliders[i as usize];
            Some(shape.project_point(pose, point, true))
        };
        let found = self.bvh.project_point(point, f32::MAX, project).map(|(i, (distance, _))| (i, distance));
        let planes = self.endless.iter().map(|&i| {
            let (shape, pose) = &self.colliders[i as usize];
            (i, shape.project_point(pose, point, true).point.distance(point))
        });
        planes.chain(found).min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// The closest hit by a walk from left to right: its distance.
fn by_escapes(snapshot: &Snapshot, ray: &QueryRay) -> f32 {
    let (origin, inverse) = (Vec3::from(ray.origin), Vec3::from(ray.inverse));
    let mut best = ray.max_distance;
    let offer = |i: u32, key: f32, best: &mut f32| {
        if let Some(hit) = shapes::cast(&snapshot.placed[i as usize], ray) {
            *best = best.min(hit.distance.max(key));
        }
    };
    snapshot.unbounded.iter().for_each(|&i| offer(i, 0.0, &mut best));
    let mut next = root_of(snapshot.tree.count());
    while next != NO_NODE {
        let node = &snapshot.tree.nodes[next as usize];
        let (low, high) = ((Vec3::from(node.min) - origin) * inverse, (Vec3::from(node.max) - origin) * inverse);
        let near = low.min(high).max_element().max(0.0);
        if near > low.max(high).min_element() || near > best {
            next = node.escape;
        } else if next.is_multiple_of(2) {
            offer(node.child, near, &mut best);
            next = node.escape;
        } else {
            next = node.child;
        }
    }
    best
}

fn main() -> Result<()> {
    let has = |flag: &str| std::env::args().any(|argument| argument == flag);
    let (bodies, count, rounds) = if has("--quick") { (500, 1000, 1) } else { (50_000, 100_000, 5) };
    let scene = scenes::pile(bodies);
    let packed = PackedScene::new(&scene)?;
    let params = |threads| Params { threads, ..Params::default() };
    let cpu = |threads| Ok::<_, Error>(World::Cpu(Box::new(tumble::cpu::World::new(scene.clone(), params(threads))?)));
    let (mut one, mut all) = (cpu(Some(1))?, cpu(None)?);
    let mut gpu = match has("--no-gpu") {
        true => None,
        false => Some(World::Gpu(Box::new(tumble::gpu::World::new(scene.clone(), params(None))?))),
    };
    let threads = rayon::current_num_threads();

    // Around the pile, from somewhere to somewhere.
    let places = scene.bodies().filter_map(|body| scene.body(body).ok()).map(|body| body.translation);
    let (low, high) = places.fold((Vec3::MAX, Vec3::MIN), |(low, high), at| (low.min(at), high.max(at)));
    let (middle, half) = (0.5 * (low + high), 0.55 * (high - low));
    let mut random = Random(1);
    let rays: Vec<Ray> = (0..count)
        .map(|_| {
            let (from, to) = (middle + 2.0 * half * random.vector(), middle + half * random.vector());
            Ray::new(from, to - from)
        })
        .collect();
    let points: Vec<NearestQuery> = (0..count).map(|_| NearestQuery::new(middle + half * random.vector())).collect();
    let radius = 1.0;
    let balls: Vec<OverlapShape> =
        (0..count).map(|_| OverlapShape::Ball { center: middle + half * random.vector(), radius }).collect();

    let packed_rays = query::pack_rays(&rays)?;
    let mut rows: Vec<(&str, String, Vec<f64>)> = Vec::new();
    let mut note = |what: &'static str, how: &str, begin: Instant| {
        let seconds = begin.elapsed().as_secs_f64();
        match rows.iter_mut().find(|row| row.0 == what && row.1 == how) {
            Some(row) => row.2.push(seconds),
            None => rows.push((what, how.into(), vec![seconds])),
        }
    };
    let several = format!("{threads} threads");
    for _ in 0..rounds {
        let begin = Instant::now();
        let snapshot = Snapshot::new(&packed.colliders, &packed.states, MortonBits::Bits30);
        note("tree", &format!("tumble, {several}"), begin);
        let begin = Instant::now();
        let parry = Parry::new(&scene)?;
        note("tree", "parry, 1 thread", begin);
        one.cast_rays(&rays[..1])?;
        all.cast_rays(&rays[..1])?;

        let begin = Instant::now();
        let ours = one.cast_rays(&rays)?;
        note("closest hit", "tumble, 1 thread", begin);
        let begin = Instant::now();
        let theirs: Vec<_> = rays.iter().map(|ray| parry.cast(ray)).collect();
        note("closest hit", "parry, 1 thread", begin);
        let begin = Instant::now();
        let far = packed_rays.iter().map(|ray| by_escapes(&snapshot, ray)).filter(|distance| *distance < 1e15).count();
        note("closest hit", "tumble, 1 thread, left to right", begin);
        let begin = Instant::now();
        all.cast_rays(&rays)?;
        note("closest hit", &format!("tumble, {several}"), begin);
        let begin = Instant::now();
        let _: Vec<_> = rays.par_iter().map(|ray| parry.cast(ray)).collect();
        note("closest hit", &format!("parry, {several}"), begin);
        let hits = ours.iter().flatten().count();
        let same = ours.iter().zip(&theirs).filter(|(a, b)| {
            a.map(|hit| hit.time_of_impact).zip(b.map(|hit| hit.1)).is_some_and(|(a, b)| (a - b).abs() < 1e-4)
        });
        assert!(far == hits && same.count() as f64 > 0.999 * hits as f64, "the answers differ");

        let begin = Instant::now();
        one.cast_rays_any(&rays)?;
        note("any hit", "tumble, 1 thread", begin);
        let begin = Instant::now();
        one.nearest(&points)?;
        note("nearest", "tumble, 1 thread", begin);
        let begin = Instant::now();
        let _: Vec<_> = points.iter().map(|query| parry.nearest(query.point)).collect();
        note("nearest", "parry, 1 thread", begin);
        let begin = Instant::now();
        one.overlaps(&balls)?;
        note("ball overlaps", "tumble, 1 thread", begin);

        if let Some(gpu) = &mut gpu {
            gpu.cast_rays(&rays[..1])?;
            let begin = Instant::now();
            gpu.cast_rays(&rays)?;
            note("closest hit", "tumble, GPU", begin);
            let begin = Instant::now();
            gpu.cast_rays_any(&rays)?;
            note("any hit", "tumble, GPU", begin);
            let begin = Instant::now();
            gpu.nearest(&points)?;
            note("nearest", "tumble, GPU", begin);
            let begin = Instant::now();
            gpu.overlaps(&balls)?;
            note("ball overlaps", "tumble, GPU", begin);
        }
    }
    rows.sort_by_key(|row| {
        ["tree", "closest hit", "any hit", "nearest", "ball overlaps"].iter().position(|what| *what == row.0)
    });
    if let Some(gpu) = &mut gpu {
        println!("GPU: {}", gpu.sync()?.adapter);
    }
    println!("pile of {bodies} boxes, {count} queries, median of {rounds} rounds");
    for (what, how, mut times) in rows {
        times.sort_by(f64::total_cmp);
        let seconds = times[times.len() / 2];
        match what {
            "tree" => println!("{what:>14}  {how:<32} {:9.2} ms", 1e3 * seconds),
            _ => println!("{what:>14}  {how:<32} {:9.3} million a second", 1e-6 * count as f64 / seconds),
        }
    }
    Ok(())
}
