//! Queries on both sides, in any order of work, and against a look at every collider. The GPU runs with what it has: the
//! committed states. Oracles are named with each test; parry's are in `queries`.

mod common;
#[expect(dead_code, reason = "only its shapes are asked for")]
#[path = "common/parry.rs"]
mod parry;
#[path = "common/queries.rs"]
mod queries;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use queries::{ask_all, crowd, questions};
use tumble::World;
use tumble_core::glam::Vec3;
use tumble_core::layout::{NO_COLLIDER, NO_NODE, QueryAnswer, TreeNode};
use tumble_core::{ColliderBuilder, MortonBits, PackedScene, Params, RigidBodyBuilder, Scene, query};
use tumble_cpu::query::Snapshot;
use tumble_gpu::Pipelines;
use worlds::{SIDES, Side};

/// How far two answers may be apart, m.
const NEAR: f32 = 2e-5;

/// Balls along the three axes at distances that halve and halve, and some at the origin: each split leaves one aside, so
/// that trees are as deep as codes are long.
fn deep() -> Scene {
    let mut scene = Scene::new();
    let mut ball = |at: Vec3, radius: f32| {
        scene.insert(RigidBodyBuilder::fixed().translation(at), ColliderBuilder::ball(radius));
    };
    for k in 0..21 {
        let far = 1000.0 * 2f32.powi(-k);
        [Vec3::X, Vec3::Y, Vec3::Z].into_iter().for_each(|axis| ball(far * axis, 0.3 * far));
    }
    (0..20).for_each(|_| ball(Vec3::ZERO, 1e-4));
    scene
}

/// Oracle: the other side. Both hold the same states, since no step has run: they name the same colliders but where two are
/// as near to a few units in the last place.
#[test]
fn the_sides_agree() {
    for (seed, scene) in [(21, crowd(3000, 1.0, 21)), (22, crowd(3000, 5.0, 22)), (23, deep())] {
        let params = Params { morton_bits: MortonBits::Bits63, ..Params::default() };
        let mut worlds = SIDES.map(|side| side.world(&scene, &params));
        let (rays, shapes, points) = questions(&mut worlds[0], 6000, seed);
        let [cpu, gpu] = worlds.each_mut().map(|world| ask_all(world, &rays, &shapes, &points));
        let (mut others, mut worst) = (0, 0f32);
        for (i, (a, b)) in cpu.hits.iter().zip(&gpu.hits).enumerate() {
            match (a, b) {
                (Some(a), Some(b)) => {
                    let length = rays[i].direction.length();
                    // Along the surface's normal: a ray that runs along a surface meets it anywhere.
                    let along = (a.normal.dot(rays[i].direction) / length).abs();
                    let off = (a.time_of_impact - b.time_of_impact).abs() * length * along;
                    let off = off / (a.time_of_impact * length).max(1.0);
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
    for (scene, bits) in
        [(crowd(600, 4.0, 42), MortonBits::Bits30), (deep(), MortonBits::Bits63), (deep(), MortonBits::Bits30)]
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
