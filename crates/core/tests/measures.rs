//! Measures against closed forms, against parry, and against all pairs without a sweep.

use parry3d::math::Pose as ParryPose;
use parry3d::shape::{Ball, Cuboid};
use tumble_core::glam::{DQuat, DVec3, Quat, Vec3};
use tumble_core::measures::*;
use tumble_core::{BodyHandle, ColliderBuilder, PackedScene, Pose, Poses, RigidBodyBuilder, Scene, scenes};

const HALF: DVec3 = DVec3::new(0.5, 1.0, 1.5);
/// A turn about no axis in particular.
const TURN: DQuat = DQuat::from_xyzw(0.3, -0.2, 0.4, 0.8);

fn at(translation: DVec3) -> DPose {
    DPose::new(translation, DQuat::IDENTITY)
}

/// Both poses moved and turned together by the same motion of the world.
fn moved(a: DPose, b: DPose) -> (DPose, DPose) {
    let turn = TURN.normalize();
    let go = |p: DPose| DPose::new(turn * p.translation + DVec3::new(3.0, -5.0, 7.0), turn * p.rotation);
    (go(a), go(b))
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12, "{found} is not {expected}");
}

/// Asserts the separation of two boxes, also with the world turned and the boxes swapped.
fn boxes(half_a: DVec3, a: DPose, half_b: DVec3, b: DPose, expected: f64) {
    near(cuboid_cuboid_separation(half_a, a, half_b, b), expected);
    near(cuboid_cuboid_separation(half_b, b, half_a, a), expected);
    let (a, b) = moved(a, b);
    near(cuboid_cuboid_separation(half_a, a, half_b, b), expected);
}

/// Oracle: analysis. Two boxes apart or overlapping by a known distance along each axis.
#[test]
fn boxes_along_each_axis() {
    for axis in 0..3 {
        for separation in [-0.4, -0.001, 0.0, 0.001, 2.0] {
            for side in [-1.0, 1.0] {
                let along = side * (HALF[axis] + 0.25 + separation);
                let b = at(DVec3::AXES[axis] * along + DVec3::splat(0.01) * (1.0 - DVec3::AXES[axis]));
                boxes(HALF, at(DVec3::ZERO), DVec3::splat(0.25), b, separation);
            }
        }
    }
}

/// Oracle: analysis. A cube on its edge, and on its corner, over a face.
#[test]
fn turned_cubes_over_a_face() {
    let cube = DVec3::splat(0.5);
    let on_edge = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
    let on_corner = DQuat::from_rotation_arc(DVec3::ONE.normalize(), DVec3::Y);
    for (turn, reach) in [(on_edge, 0.5f64.sqrt()), (on_corner, 0.75f64.sqrt())] {
        for separation in [-0.1, 0.0, 0.3] {
            let b = DPose::new(DVec3::new(0.1, 0.5 + reach + separation, -0.2), turn);
            boxes(DVec3::new(2.0, 0.5, 2.0), at(DVec3::ZERO), cube, b, separation);
        }
    }
}

/// Oracle: analysis. Two long boxes, each on an edge, cross at right angles: only an axis made of both edges shows
/// how deep.
#[test]
fn crossed_edges() {
    let quarter = std::f64::consts::FRAC_PI_4;
    let along_x = DQuat::from_rotation_x(quarter);
    let along_z = DQuat::from_rotation_z(quarter);
    let reach = 2.0 * 0.5 * 2.0f64.sqrt();
    for separation in [-0.2, -0.01, 0.0, 0.4] {
        let a = DPose::new(DVec3::ZERO, along_x);
        let b = DPose::new(DVec3::new(0.3, reach + separation, -0.2), along_z);
        boxes(DVec3::new(5.0, 0.5, 0.5), a, DVec3::new(0.5, 0.5, 5.0), b, separation);
    }
}

/// Oracle: analysis. Edges that are parallel but for 1e-9 rad add no false axis.
#[test]
fn nearly_parallel_edges() {
    for angle in [1e-12, 1e-9, 1e-7, 1e-5] {
        let b = DPose::new(DVec3::X * 0.9, DQuat::from_rotation_y(angle));
        let found = cuboid_cuboid_separation(DVec3::splat(0.5), at(DVec3::ZERO), DVec3::splat(0.5), b);
        assert!((found + 0.1).abs() < 2.0 * angle, "{angle}: {found}");
    }
}

/// Oracle: analysis. One box within another leaves through the nearest face.
#[test]
fn a_box_within_a_box() {
    boxes(DVec3::ONE, at(DVec3::ZERO), DVec3::splat(0.1), at(DVec3::new(0.2, -0.5, 0.1)), -0.6);
}

/// Oracle: analysis. A ball beyond a face, an edge and a corner, and with its centre inside.
#[test]
fn ball_and_box() {
    let pose = DPose::new(DVec3::new(1.0, 2.0, 3.0), TURN);
    let check = |local: DVec3, expected: f64| {
        near(ball_cuboid_separation(0.25, pose.translation + pose.rotation * local, HALF, pose), expected)
    };
    check(DVec3::new(1.0, 0.0, 0.0), 0.25);
    check(DVec3::new(0.6, 0.9, -1.4), -0.15);
    check(DVec3::new(0.8, -1.4, 0.0), 0.25);
    check(DVec3::new(0.5 + 2.0, 1.0 + 3.0, -1.5 - 6.0), 6.75);
    check(DVec3::new(0.5, 0.0, 0.0), -0.25);
    check(DVec3::new(0.4, 0.0, 0.0), -0.35);
    check(DVec3::new(0.0, 0.0, 0.0), -0.75);
    check(DVec3::new(0.0, 0.9, 1.45), -0.3);
}

/// Oracle: analysis.
#[test]
fn balls_and_half_spaces() {
    near(ball_ball_separation(0.5, DVec3::X, 0.25, DVec3::new(1.0, 3.0, 4.0)), 4.25);
    near(ball_ball_separation(0.5, DVec3::X, 0.25, DVec3::new(1.0, 0.3, 0.4)), -0.25);
    near(ball_ball_separation(0.5, DVec3::X, 0.25, DVec3::X), -0.75);
    let (normal, point) = (DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, 1.0, 5.0));
    near(ball_halfspace_separation(0.5, point + normal * 2.0 + DVec3::Z, normal, point), 1.5);
    near(ball_halfspace_separation(0.5, point - normal, normal, point), -1.5);
    let flat = DQuat::from_rotation_arc(DVec3::Y, normal);
    near(cuboid_halfspace_separation(HALF, DPose::new(point + normal * 0.7, flat), normal, point), -0.3);
    let on_corner = DQuat::from_rotation_arc(DVec3::ONE.normalize(), normal);
    let pose = DPose::new(point + normal, on_corner);
    near(cuboid_halfspace_separation(DVec3::splat(0.5), pose, normal, point), 1.0 - 0.75f64.sqrt());
}

/// SplitMix64, from 0 up to 1.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }
    fn vector(&mut self, low: f32, high: f32) -> Vec3 {
        let mut one = || low + (high - low) * self.unit();
        Vec3::new(one(), one(), one())
    }
    fn turn(&mut self) -> Quat {
        loop {
            let v = self.vector(-1.0, 1.0).extend(2.0 * self.unit() - 1.0);
            if (0.1..1.0).contains(&v.length()) {
                return Quat::from_vec4(v.normalize());
            }
        }
    }
}

fn dpose(translation: Vec3, rotation: Quat) -> DPose {
    DPose::new(translation.as_dvec3(), rotation.as_dquat())
}

/// Oracle: parry. Boxes overlap where parry says so, and no gap is wider than parry's distance.
#[test]
fn random_boxes_against_parry() {
    let mut random = Random(1);
    let (mut apart, mut overlapping) = (0, 0);
    for _ in 0..4000 {
        let (half_a, half_b) = (random.vector(0.1, 1.0), random.vector(0.1, 1.0));
        let (at_b, turn_a, turn_b) = (random.vector(-1.5, 1.5), random.turn(), random.turn());
        let found = cuboid_cuboid_separation(
            half_a.as_dvec3(),
            dpose(Vec3::ZERO, turn_a),
            half_b.as_dvec3(),
            dpose(at_b, turn_b),
        );
        let (a, b) = (Cuboid::new(half_a), Cuboid::new(half_b));
        let (pose_a, pose_b) = (ParryPose::from_parts(Vec3::ZERO, turn_a), ParryPose::from_parts(at_b, turn_b));
        let distance = f64::from(parry3d::query::distance(&pose_a, &a, &pose_b, &b).unwrap().distance);
        assert!(found <= distance + 1e-5, "a gap of {found} m in a distance of {distance} m");
        if found.abs() > 1e-5 {
            let hit = parry3d::query::intersection_test(&pose_a, &a, &pose_b, &b).unwrap().intersecting;
            assert_eq!(hit, found < 0.0, "{found}");
        }
        if found > 0.0 { apart += 1 } else { overlapping += 1 }
    }
    assert!(apart > 500 && overlapping > 500, "{apart} apart, {overlapping} overlapping");
}

/// Oracle: parry, with the centre of the ball outside and inside the box.
#[test]
fn random_balls_against_parry() {
    let mut random = Random(2);
    let (mut apart, mut overlapping, mut inside) = (0, 0, 0);
    for _ in 0..4000 {
        let (half, center, turn) = (random.vector(0.1, 1.0), random.vector(-1.0, 1.0), random.turn());
        let radius = 0.1 + 0.5 * random.unit();
        let found = ball_cuboid_separation(radius.into(), center.as_dvec3(), half.as_dvec3(), dpose(Vec3::ZERO, turn));
        let (pose_a, pose_b) = (ParryPose::from_parts(center, Quat::IDENTITY), ParryPose::from_parts(Vec3::ZERO, turn));
        let contact =
            parry3d::query::contact(&pose_a, &Ball::new(radius), &pose_b, &Cuboid::new(half), 10.0).unwrap().unwrap();
        assert!((found - f64::from(contact.dist)).abs() < 1e-5, "{found} is not {}", contact.dist);
        match found {
            s if s < -f64::from(radius) => inside += 1,
            s if s < 0.0 => overlapping += 1,
            _ => apart += 1,
        }
    }
    assert!(apart > 300 && overlapping > 300 && inside > 300, "{apart} {overlapping} {inside}");
}

/// Oracle: analysis. Two bodies of known overlap on a floor, one more overlap within a body, one between fixed bodies.
#[test]
fn penetration_counts_the_right_pairs() {
    let mut scene = Scene::new();
    let cube = || ColliderBuilder::cuboid(0.5, 0.5, 0.5);
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y * 3.0));
    assert_eq!(penetration(&scene, &initial_poses(&scene)), Default::default(), "no pairs: no mean of nothing");
    // Sunk by 1/8, and by 1/4 into one another (exact in f32).
    let a = scene.insert(RigidBodyBuilder::dynamic().translation(Vec3::Y * 0.375), cube()).body;
    scene.insert(RigidBodyBuilder::dynamic().translation(Vec3::new(0.75, 0.375, 0.0)), cube());
    // Nothing counts here: same body, and fixed in fixed.
    scene.attach(a, ColliderBuilder::ball(0.25)).unwrap();
    scene.insert(RigidBodyBuilder::fixed().translation(Vec3::Y * 10.0), cube());
    scene.insert(RigidBodyBuilder::fixed().translation(Vec3::Y * 10.0), cube());
    scene.insert(RigidBodyBuilder::kinematic_velocity_based().translation(Vec3::Y * 10.0), cube());
    let found = penetration(&scene, &initial_poses(&scene));
    near(found.max_m, 0.25);
    near(found.mean_m, (0.125 + 0.125 + 0.25) / 3.0);
}

/// Oracle: analysis. Poses count as they are; bodies without one, or with one that is not finite, do not.
#[test]
fn penetration_takes_the_poses_it_is_given() {
    let mut scene = Scene::new();
    let ball = |scene: &mut Scene| scene.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5)).body;
    let bodies = [(); 4].map(|()| ball(&mut scene));
    let place = |x: f32| Pose::from(Vec3::X * x);
    let three = [(bodies[0], place(0.0)), (bodies[1], place(0.75)), (bodies[2], place(f32::NAN))];
    let found = penetration(&scene, &Poses::collect(7, three.into_iter()));
    near(found.max_m, 0.25);
    near(found.mean_m, 0.25);
    assert_eq!(penetration(&scene, &Poses::collect(7, [].into_iter())), Default::default());
    let floor = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y)).body;
    let fallen = [(floor, place(0.0)), (bodies[0], Vec3::new(0.0, f32::NEG_INFINITY, 0.0).into())];
    assert_eq!(penetration(&scene, &Poses::collect(7, fallen.into_iter())), Default::default());
}

/// Oracle: all pairs without a sweep. Overlapping boxes, balls and compounds about a tilted half-space.
#[test]
fn penetration_against_all_pairs() {
    let mut random = Random(3);
    let mut scene = Scene::new();
    let (normal, point, tilt) = (Vec3::new(2.0, 5.0, -1.0), Vec3::new(0.3, -1.0, 0.2), random.turn());
    let plane = ColliderBuilder::halfspace(normal).translation(tilt.inverse() * point);
    scene.insert(RigidBodyBuilder::fixed().rotation(tilt), plane);
    let normal = tilt.as_dquat().normalize() * normal.as_dvec3().normalize();
    let mut placed: Vec<(BodyHandle, Option<f64>, DVec3, DPose)> = Vec::new();
    for i in 0..300 {
        let (at, turn) = (random.vector(-4.0, 4.0), random.turn());
        let body = RigidBodyBuilder::dynamic().translation(at).rotation(turn);
        let (half, radius, offset, own) =
            (random.vector(0.2, 1.2), 0.2 + random.unit(), random.vector(-1.0, 1.0), random.turn());
        let cuboid = ColliderBuilder::cuboid(half.x, half.y, half.z).translation(offset).rotation(own);
        let ball = ColliderBuilder::ball(radius);
        let body_pose = dpose(at, turn);
        let cuboid_pose = DPose::new(
            body_pose.translation + body_pose.rotation * offset.as_dvec3(),
            body_pose.rotation * own.as_dquat().normalize(),
        );
        let handle = scene.insert(body, if i % 2 == 0 { cuboid.clone() } else { ball.clone() }).body;
        if i % 3 == 0 {
            scene.attach(handle, if i % 2 == 0 { ball } else { cuboid }).unwrap();
        }
        if i % 2 == 0 || i % 3 == 0 {
            placed.push((handle, None, half.as_dvec3(), cuboid_pose));
        }
        if i % 2 == 1 || i % 3 == 0 {
            placed.push((handle, Some(radius.into()), DVec3::ZERO, body_pose));
        }
    }
    let mut depths = Vec::new();
    for (i, &(body_a, ball_a, half_a, a)) in placed.iter().enumerate() {
        let floor = match ball_a {
            Some(radius) => ball_halfspace_separation(radius, a.translation, normal, point.as_dvec3()),
            None => cuboid_halfspace_separation(half_a, a, normal, point.as_dvec3()),
        };
        depths.push(-floor);
        for &(body_b, ball_b, half_b, b) in placed[..i].iter().filter(|p| p.0 != body_a) {
            assert_ne!(body_a, body_b);
            depths.push(-match (ball_a, ball_b) {
                (Some(ra), Some(rb)) => ball_ball_separation(ra, a.translation, rb, b.translation),
                (Some(ra), None) => ball_cuboid_separation(ra, a.translation, half_b, b),
                (None, Some(rb)) => ball_cuboid_separation(rb, b.translation, half_a, a),
                (None, None) => cuboid_cuboid_separation(half_a, a, half_b, b),
            });
        }
    }
    depths.retain(|&d| d > 0.0);
    assert!(depths.len() > 500);
    let (max, mean) =
        (depths.iter().fold(0.0, |a: f64, &b| a.max(b)), depths.iter().sum::<f64>() / depths.len() as f64);
    let found = penetration(&scene, &initial_poses(&scene));
    // The plane's point and the bodies' frames pass through f32.
    assert!((found.max_m - max).abs() < 1e-6, "{} is not {max}", found.max_m);
    assert!((found.mean_m - mean).abs() < 1e-6, "{} is not {mean}", found.mean_m);
}

/// Oracle: analysis. A turned box of 1 x 2 x 3 m that flies, turns and hangs off its body's origin.
#[test]
fn energy_and_momentum_of_one_box() {
    let mut scene = Scene::new();
    scene.gravity = Vec3::new(1.0, -9.0, 2.0);
    let (at, turn, offset) = (Vec3::new(2.0, -1.0, 3.0), TURN.as_quat().normalize(), Vec3::new(0.5, 0.25, -1.0));
    let (v, w) = (Vec3::new(1.0, -2.0, 4.0), Vec3::new(3.0, 7.0, 2.0));
    let body = RigidBodyBuilder::dynamic().translation(at).rotation(turn).linvel(v).angvel(w).gravity_scale(0.5);
    scene.insert(body, ColliderBuilder::cuboid(0.5, 1.0, 1.5).density(10.0).translation(offset));
    // Neither fixed nor kinematic bodies count.
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(1.0));
    scene.insert(RigidBodyBuilder::kinematic_velocity_based().linvel(v), ColliderBuilder::ball(1.0));
    let (poses, velocities) = (initial_poses(&scene), initial_velocities(&scene));

    let (m, inertia) = (60.0, DVec3::new(13.0, 10.0, 5.0) * 5.0);
    let turn = turn.as_dquat().normalize();
    let center = at.as_dvec3() + turn * offset.as_dvec3();
    let (v, w) = (v.as_dvec3(), w.as_dvec3());
    let spin = turn * (inertia * (turn.inverse() * w));
    let relative = |found: f64, expected: f64| {
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} is not {expected}");
    };
    relative(kinetic_energy(&scene, &poses, &velocities), 0.5 * m * 21.0 + 0.5 * w.dot(spin));
    relative(potential_energy(&scene, &poses), -m * 0.5 * scene.gravity.as_dvec3().dot(center));
    assert!((linear_momentum(&scene, &velocities) - m * v).length() < 1e-6 * m * v.length());
    let expected = center.cross(m * v) + spin;
    let found = angular_momentum(&scene, &poses, &velocities);
    assert!((found - expected).length() < 1e-6 * expected.length(), "{found} is not {expected}");
}

/// Oracle: analysis. A compound turning about its centre of mass: two equal balls on a bar without mass.
#[test]
fn energy_of_a_dumbbell() {
    let mut scene = Scene::new();
    let spin = Vec3::new(0.0, 0.0, 2.0);
    let ball = |x: f32| ColliderBuilder::ball(0.5).mass(3.0).translation(Vec3::X * x);
    let body = scene.insert(RigidBodyBuilder::dynamic().angvel(spin), ball(1.0)).body;
    scene.attach(body, ball(5.0)).unwrap();
    let (poses, velocities) = (initial_poses(&scene), initial_velocities(&scene));
    let inertia = 2.0 * (0.4 * 3.0 * 0.25 + 3.0 * 4.0);
    let found = kinetic_energy(&scene, &poses, &velocities);
    assert!((found / (0.5 * inertia * 4.0) - 1.0).abs() < 1e-6, "{found}");
    let found = angular_momentum(&scene, &poses, &velocities);
    assert!((found - DVec3::Z * inertia * 2.0).length() < 1e-5, "{found}");
    assert!(linear_momentum(&scene, &velocities) == DVec3::ZERO, "it turns about its centre of mass");
}

/// Oracle: FNV-1a written out once more over bytes collected first; any bit of any body changes the hash.
#[test]
fn hash_of_the_state() {
    let scene = scenes::closed_system(9);
    let (poses, velocities) = (initial_poses(&scene), initial_velocities(&scene));
    let mut floats = Vec::new();
    for pose in poses.iter() {
        floats.extend(pose.translation.to_array().into_iter().chain(pose.rotation.to_array()));
    }
    for velocity in velocities.iter() {
        floats.extend(velocity.linear.to_array().into_iter().chain(velocity.angular.to_array()));
    }
    let mut expected = 14_695_981_039_346_656_037_u64;
    for byte in floats.iter().flat_map(|f| f.to_le_bytes()) {
        expected = (expected ^ u64::from(byte)).wrapping_mul(1_099_511_628_211);
    }
    let hash = state_hash(&poses, &velocities);
    assert_eq!(hash, expected);

    let packed = PackedScene::new(&scene).unwrap();
    for i in 0..9 {
        let mut states = packed.states.clone();
        let speed = &mut states[i].linear_velocity[1];
        *speed = f32::from_bits(speed.to_bits() ^ 1);
        let changed = tumble_core::Velocities::from_states(0, &states);
        assert_ne!(state_hash(&poses, &changed), hash, "body {i}");
    }
}

/// Oracle: the definition of the coordinates. Two cubes, the second one turned by 0.3 rad about z and shifted.
#[test]
fn joint_coordinates_and_error() {
    use tumble_core::{JointAxis, JointBuilder};
    let mut scene = Scene::new();
    let cube = || ColliderBuilder::cuboid(0.5, 0.5, 0.5);
    let a = scene.insert(RigidBodyBuilder::dynamic().rotation(Quat::from_rotation_z(0.2)), cube()).body;
    let place = Quat::from_rotation_z(0.2) * Vec3::new(1.0, 0.01, -0.02);
    let turned = RigidBodyBuilder::dynamic().translation(place).rotation(Quat::from_rotation_z(0.5));
    let b = scene.insert(turned, cube()).body;
    let joints = [
        JointBuilder::revolute(Vec3::Z),
        JointBuilder::fixed(),
        JointBuilder::rope(0.9),
        JointBuilder::prismatic(Vec3::X).limits(JointAxis::LinX, [-2.0, 2.0]),
        JointBuilder::universal(Vec3::Z, Vec3::X),
    ];
    let joints = joints.map(|joint| scene.insert_joint(a, b, joint).unwrap());
    let poses = initial_poses(&scene);
    let at = joints.map(|joint| joint_coordinates(&scene, &poses, joint).unwrap());
    let near = |found: f64, exact: f64| assert!((found - exact).abs() < 1e-6, "{found}, {exact}: {at:?}");
    let distance = (1.0f64 + 1e-4 + 4e-4).sqrt();
    // The hinge's axis x is z of the bodies.
    near(at[0][3], 0.3);
    near(at[0][0], -0.02);
    near(at[1][5], 0.3);
    [1.0, 0.01, -0.02].into_iter().enumerate().for_each(|(axis, exact)| near(at[1][axis], exact));
    near(at[2][0], distance);
    near(at[3][0], 1.0);
    near(at[4][3], 0.3);
    near(at[4][4], 0.0);
    let error = joint_error(&scene, &poses);
    near(error.max_m, distance);
    near(error.max_rad, 0.3);
    let means = [distance, distance, distance - 0.9, 0.01f64.hypot(0.02), distance];
    near(error.mean_m, means.iter().sum::<f64>() / 5.0);
    scene.remove_joint(joints[0]).unwrap();
    assert!(joint_coordinates(&scene, &poses, joints[0]).is_none());
}

/// Oracle: two cubes that overlap by 0.4 m, which a joint keeps apart or does not.
#[test]
fn what_a_joint_keeps_apart_does_not_overlap() {
    use tumble_core::JointBuilder;
    for (contacts, deepest) in [(true, 0.4), (false, 0.0)] {
        let mut scene = Scene::new();
        let [a, b] = [0.0, 0.6].map(|x| {
            let body = RigidBodyBuilder::dynamic().translation(Vec3::X * x);
            scene.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).body
        });
        scene.insert_joint(b, a, JointBuilder::fixed().contacts_enabled(contacts)).unwrap();
        assert!((penetration(&scene, &initial_poses(&scene)).max_m - deepest).abs() < 1e-6);
    }
}
