//! The CPU's broad phase against parry 0.31: which boxes overlap. The GPU is compared with the CPU elsewhere
//! (`parity_collide`, `parity_broadphase`).

#[path = "common/parry_shapes.rs"]
mod parry_shapes;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;

use parry_shapes::shape_of;
use parry3d::bounding_volume::{Aabb as ParryBox, BoundingVolume};
use parry3d::math::Pose as ParryPose;
use random::Random;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::layout::*;
use tumble_core::{ColliderBuilder, PackedScene, Params, RigidBodyBuilder, Scene, limits, scenes};
use tumble_cpu::bounds;
use tumble_cpu::broadphase::Boxes;
use tumble_cpu::broadphase::grid::{self, Large};

/// Where the bodies of a scene are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Spread {
    Uniform,
    Clustered,
    OnePoint,
    Line,
    Plane,
    Fast,
    FarAway,
    ManySizes,
}

const SPREADS: [Spread; 8] = [
    Spread::Uniform,
    Spread::Clustered,
    Spread::OnePoint,
    Spread::Line,
    Spread::Plane,
    Spread::Fast,
    Spread::FarAway,
    Spread::ManySizes,
];

/// Balls, boxes and lopsided compounds of about 1 m; `large`: also a box floor, a half-space and a ball of 100 m.
fn scene_of(spread: Spread, bodies: usize, large: bool, seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    scene.gravity = if spread == Spread::Fast { random.vector(30.0) } else { Vec3::ZERO };
    let middle = if spread == Spread::FarAway { Vec3::new(8000.0, -3.0, 50.0) } else { Vec3::ZERO };
    let side = 1.3 * (bodies as f32).cbrt();
    if large {
        let floor = RigidBodyBuilder::fixed().translation(middle - Vec3::Y * side);
        scene.insert(floor, ColliderBuilder::cuboid(50.0, 1.0, 50.0));
        let wall = RigidBodyBuilder::fixed().translation(middle + Vec3::X * 0.5 * side);
        scene.insert(wall, ColliderBuilder::halfspace(Vec3::X));
        let ball = RigidBodyBuilder::dynamic().translation(middle + Vec3::splat(100.0 / 3f32.sqrt()));
        scene.insert(ball, ColliderBuilder::ball(100.0));
    }
    for i in 0..bodies {
        let place = match spread {
            Spread::Uniform | Spread::Fast | Spread::FarAway | Spread::ManySizes => random.vector(side),
            Spread::Clustered => Vec3::splat(9.0 * (i % 7) as f32) + random.vector(0.5 * side),
            Spread::OnePoint => Vec3::ZERO,
            Spread::Line => Vec3::X * random.range(-0.5, 0.5) * bodies as f32,
            Spread::Plane => random.vector((bodies as f32).sqrt()) * Vec3::new(1.0, 0.0, 1.0),
        };
        let scale = if spread == Spread::ManySizes { 10f32.powf(random.range(-2.0, 1.0)) } else { 1.0 };
        let mut size = || scale * random.range(0.3, 0.6);
        let (a, b, c) = (size(), size(), size());
        let mut body = RigidBodyBuilder::dynamic().translation(middle + place).rotation(random.rotation());
        if i % 10 == 9 {
            body = RigidBodyBuilder { body_type: tumble_core::RigidBodyType::Fixed, ..body };
        }
        if spread == Spread::Fast {
            body = body.linvel(random.vector(120.0)).angvel(random.vector(10.0));
        }
        let inserted =
            scene.insert(body, if i % 2 == 0 { ColliderBuilder::ball(a) } else { ColliderBuilder::cuboid(a, b, c) });
        if i % 5 == 3 {
            let offset = scale * random.vector(0.5);
            scene.attach(inserted.body, ColliderBuilder::ball(b).translation(offset)).unwrap();
        }
    }
    scene
}

/// A scene as the broad phase sees it.
struct Packed {
    scene: PackedScene,
    step: StepParams,
    boxes: Vec<Aabb>,
}

impl Packed {
    fn new(scene: &Scene) -> Self {
        let scene = PackedScene::new(scene).unwrap();
        let mut step = Params::default().step_params(1, scene.gravity);
        (step.body_count, step.collider_count) = (scene.states.len() as u32, scene.colliders.len() as u32);
        step.cell_table_bits = limits::cell_table_bits(step.collider_count);
        step.large_limit = limits::large_limit(step.collider_count, false);
        let box_of = |c: &Collider| {
            bounds::collider_bounds(c, &scene.states[c.body as usize], &scene.props[c.body as usize], &step)
        };
        let boxes = scene.colliders.iter().map(box_of).collect();
        Self { scene, step, boxes }
    }

    fn grid_pairs(&self) -> Vec<[u32; 2]> {
        let boxes = Boxes::new(&self.boxes);
        let grid = grid::choose(&boxes, &self.step);
        grid::find_pairs(&grid, &grid::fill(&grid, &boxes, &self.step), &boxes, Large::List, u32::MAX).pairs
    }

    /// Every pair of colliders of different bodies, one of them dynamic, that `meets`.
    fn brute_force(&self, meets: impl Fn(usize, usize) -> bool) -> Vec<[u32; 2]> {
        let colliders = &self.scene.colliders;
        let dynamic = |i: usize| self.scene.states[colliders[i].body as usize].flags == body_flags::DYNAMIC;
        let count = colliders.len();
        let all = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        all.filter(|&(i, j)| colliders[i].body != colliders[j].body && (dynamic(i) || dynamic(j)) && meets(i, j))
            .map(|(i, j)| [i as u32, j as u32])
            .collect()
    }

    /// Parry's box of a ball or cuboid, moved on from the step's start by `share` of the step.
    fn parry_box(&self, i: usize, share: f32) -> Option<ParryBox> {
        let collider = &self.scene.colliders[i];
        let state = &self.scene.states[collider.body as usize];
        let time = f64::from(share * self.step.dt);
        let dynamic = f64::from(u8::from(state.flags == body_flags::DYNAMIC));
        let fall = Vec3::from_array(self.step.gravity).as_dvec3() * (0.5 * time * time * dynamic);
        let way = Vec3::from_array(state.linear_velocity).as_dvec3() * time + fall;
        let turn = Vec3::from_array(state.angular_velocity) * (share * self.step.dt);
        let rotation = Quat::from_scaled_axis(turn) * Quat::from_array(state.rotation);
        let center = Vec3::from_array(state.position).as_dvec3() + way;
        let at = center + (rotation * Vec3::from_array(collider.position)).as_dvec3();
        let pose = ParryPose::from_parts(at.as_vec3(), rotation * Quat::from_array(collider.rotation));
        shape_of(collider).filter(|_| collider.shape != shape_kind::HALFSPACE).map(|shape| shape.compute_aabb(&pose))
    }
}

/// How far apart two boxes are along the axis that shows it most; negative where they overlap.
fn gap(a: &ParryBox, b: &ParryBox) -> f32 {
    (a.mins - b.maxs).max(b.mins - a.maxs).max_element()
}

fn check(what: &str, scene: &Scene) -> usize {
    let packed = Packed::new(scene);
    let found = packed.grid_pairs();
    let own = |i: usize| {
        let Aabb { min, max, .. } = packed.boxes[i];
        ParryBox::new(min.into(), max.into())
    };
    // Boxes that share a face alone meet; parry has it so too.
    let brute = packed.brute_force(|i, j| own(i).intersects(&own(j)));
    assert_eq!(found, brute, "{what}: the grid and brute force over the same boxes");

    let weightless = scene.gravity == Vec3::ZERO;
    let at_rest = |state: &BodyState| {
        let still = state.linear_velocity == [0.0; 3] && state.angular_velocity == [0.0; 3];
        still && (weightless || state.flags == body_flags::FIXED)
    };
    // Over the whole step no shape leaves its box, and one at rest has parry's box and half the margin.
    let margin = 0.5 * packed.step.speculative_distance;
    for i in 0..packed.boxes.len() {
        let Some(start) = packed.parry_box(i, 0.0) else { continue };
        let largest = start.mins.abs().max(start.maxs.abs()).max_element();
        // Either side rounds a box's corner: by 2.05 in the last place of the largest coordinate at most, measured.
        let rounding = 4.0 * largest * f32::EPSILON;
        let state = &packed.scene.states[packed.scene.colliders[i].body as usize];
        for share in [0.0, 0.3, 0.7, 1.0] {
            let there = packed.parry_box(i, share).unwrap();
            let inside = own(i).loosened(rounding).contains(&there.loosened(margin));
            assert!(inside, "{what}: collider {i} after {share} of the step: {there:?} is not in {:?}", own(i));
        }
        if at_rest(state) {
            let (low, high) = (start.mins - margin - own(i).mins, own(i).maxs - start.maxs - margin);
            let off = low.abs().max(high.abs()).max_element();
            assert!(off <= rounding, "{what}: collider {i} at rest: {start:?}, {:?}: {off:e}", own(i));
        }
    }
    // Whatever parry's boxes say is that near, at either end of the step, is in the list; and nothing else, where all
    // are at rest. Ties within the rounding of two corners may go either way.
    let ends: Vec<_> = (0..packed.boxes.len())
        .map(|i| packed.parry_box(i, 0.0).map(|start| (start, packed.parry_box(i, 1.0).unwrap())))
        .collect();
    let nearer = |i: usize, j: usize, sign: f32| {
        let (Some((a0, a1)), Some((b0, b1))) = (&ends[i], &ends[j]) else { return sign > 0.0 };
        let largest = [a0.mins, a0.maxs, b0.mins, b0.maxs].map(|v| v.abs().max_element());
        let tie = 8.0 * largest.into_iter().fold(0.0, f32::max) * f32::EPSILON;
        gap(a0, b0).min(gap(a1, b1)) < 2.0 * margin + sign * tie
    };
    let near = packed.brute_force(|i, j| nearer(i, j, -1.0));
    let missed = near.iter().find(|pair| found.binary_search(pair).is_err());
    assert!(missed.is_none(), "{what}: {missed:?}");
    if packed.scene.states.iter().all(at_rest) {
        let far = found.iter().find(|pair| !nearer(pair[0] as usize, pair[1] as usize, 1.0));
        assert!(far.is_none(), "{what}: {far:?}");
    }
    found.len()
}

/// Oracle: brute force, and parry's boxes.
#[test]
fn the_grid_finds_every_pair() {
    for (k, spread) in SPREADS.into_iter().enumerate() {
        for large in [false, true] {
            for bodies in [700, 255, 256, 257] {
                let found =
                    check(&format!("{spread:?}, {bodies}, {large}"), &scene_of(spread, bodies, large, k as u64));
                assert!(found > bodies / 10, "{spread:?}: {found} pairs prove little");
            }
        }
    }
}

/// Oracle: brute force, and parry's boxes.
#[test]
fn the_grid_finds_the_pairs_of_a_few() {
    for spread in SPREADS {
        for (bodies, large) in (0..4).flat_map(|bodies| [(bodies, false), (bodies, true)]) {
            for seed in 0..20 {
                check(&format!("{spread:?}, {bodies}, {large}, {seed}"), &scene_of(spread, bodies, large, seed));
            }
        }
    }
}

/// Oracle: brute force, and parry's boxes. More bodies than a cell table of the least size tells apart, and every
/// standard scene.
#[test]
fn the_grid_finds_the_pairs_of_standard_scenes() {
    for scene in scenes::ALL {
        for bodies in [0, 1, 500] {
            check(&format!("{}, {bodies}", scene.name), &(scene.build)(bodies));
        }
    }
    check("overlap_cube", &scenes::overlap_cube().0);
    check("closed_system", &scenes::closed_system(300));
    check("bullet", &scenes::bullet().0);
}
