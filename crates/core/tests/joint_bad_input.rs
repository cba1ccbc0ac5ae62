//! Joints that are refused, with an error that names the field, and handles of what is no more. Oracle: analysis throughout
//! (the documented range of each field).

use tumble_core::glam::{Quat, Vec3};
use tumble_core::{
    BodyHandle, ColliderBuilder, Editor, Error, JointAxis, JointBuilder, JointHandle, JointSolver, PackedScene,
    RigidBodyBuilder, Scene, scenes,
};

const NAN: f32 = f32::NAN;
const INF: f32 = f32::INFINITY;

/// A fixed body, a kinematic one and two dynamic ones.
fn bodies() -> (Scene, [BodyHandle; 4]) {
    let mut scene = Scene::new();
    let kinds = [
        RigidBodyBuilder::fixed(),
        RigidBodyBuilder::kinematic_velocity_based(),
        RigidBodyBuilder::dynamic(),
        RigidBodyBuilder::dynamic(),
    ];
    let mut x = 0.0;
    let bodies = kinds.map(|body| {
        x += 1.0;
        scene.insert(body.translation(Vec3::X * x), ColliderBuilder::ball(0.1)).body
    });
    (scene, bodies)
}

/// Asserts that the error names the field, the value and what is allowed.
#[track_caller]
fn names(error: &Error, field: &str) {
    let Error::Invalid { field: named, .. } = error else { panic!("{field}: {error:?}") };
    let text = error.to_string();
    assert!(*named == field && text.contains("joint") && text.contains("allowed: "), "{field}: {text}");
}

/// Asserts that the joint is refused between two bodies that could be joined: when it is made, and when another joint is to
/// become it; and that nothing is left of it.
#[track_caller]
fn refused(joint: JointBuilder, field: &str) {
    let (mut scene, [fixed, _, a, b]) = bodies();
    for pair in [[fixed, a], [a, b]] {
        names(&scene.insert_joint(pair[0], pair[1], joint.clone()).expect_err(field), field);
    }
    assert_eq!(scene.joint_count(), 0);
    assert!(scene.joints_of(a).unwrap().is_empty());
    let good = scene.insert_joint(a, b, JointBuilder::spherical()).unwrap();
    names(&scene.set_joint(good, joint.clone()).expect_err(field), field);
    assert_eq!(scene.joint(good).unwrap(), &JointBuilder::spherical(), "what was there stays");
    let (mut editor, _) = Editor::new(scene).unwrap();
    names(&editor.insert_joint(a, b, joint.clone()).expect_err(field), field);
    names(&editor.set_joint(good, joint).expect_err(field), field);
    PackedScene::new(editor.scene()).unwrap();
}

#[test]
fn bodies_that_no_joint_moves() {
    let (mut scene, [fixed, kinematic, a, b]) = bodies();
    let other = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1)).body;
    for pair in [[a, a], [fixed, fixed], [fixed, kinematic], [kinematic, fixed], [fixed, other]] {
        let error = scene.insert_joint(pair[0], pair[1], JointBuilder::spherical()).unwrap_err();
        names(&error, "bodies");
    }
    let text = scene.insert_joint(fixed, other, JointBuilder::fixed()).unwrap_err().to_string();
    assert!(text.contains(&fixed.to_string()) && text.contains(&other.to_string()), "{text}");
    assert_eq!(scene.joint_count(), 0);
    for pair in [[fixed, a], [a, fixed], [kinematic, a], [a, b], [b, a]] {
        scene.insert_joint(pair[0], pair[1], JointBuilder::spherical()).unwrap();
    }
    assert_eq!((scene.joint_count(), scene.joints_of(a).unwrap().len()), (5, 5));
}

#[test]
fn anchors_and_axes() {
    let ball = JointBuilder::spherical;
    for bad in [NAN, INF, -INF, 2e7] {
        for bad in [Vec3::new(bad, 0.0, 0.0), Vec3::new(0.0, bad, 0.0), Vec3::new(0.0, 0.0, bad)] {
            refused(ball().local_anchor1(bad), "local_anchor1");
            refused(ball().local_anchor2(bad), "local_anchor2");
        }
    }
    for bad in [Vec3::ZERO, Vec3::splat(NAN), Vec3::X * INF] {
        refused(JointBuilder::revolute(bad), "local_axis1");
        refused(JointBuilder::prismatic(bad), "local_axis1");
        refused(ball().local_axis1(bad), "local_axis1");
        refused(ball().local_axis2(bad), "local_axis2");
        refused(JointBuilder::universal(bad, Vec3::Y), "local_axis1");
        refused(JointBuilder::universal(Vec3::X, bad), "local_axis1");
    }
    refused(JointBuilder::universal(Vec3::Y, Vec3::Y * -2.0), "local_axis1");
    for bad in [[0.0; 4], [NAN, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 3.0]] {
        refused(ball().local_rotation1(Quat::from_array(bad)), "local_axis1");
        refused(ball().local_rotation2(Quat::from_array(bad)), "local_axis2");
    }
    // The length of an axis does not matter.
    let (mut scene, [.., a, b]) = bodies();
    scene.insert_joint(a, b, JointBuilder::revolute(Vec3::splat(1e-3))).unwrap();
    scene.insert_joint(a, b, JointBuilder::universal(Vec3::X * 9.0, Vec3::Z * 0.1)).unwrap();
}

#[test]
fn limits() {
    for axis in JointAxis::ALL {
        let joint = |limits| JointBuilder::generic(&[]).limits(axis, limits);
        for bad in [[0.1, -0.1], [NAN, 0.0], [0.0, NAN], [-INF, 0.0], [0.0, INF], [2e7, 3e7]] {
            refused(joint(bad), "limits");
        }
        let (mut scene, [.., a, b]) = bodies();
        for good in [[-1.0, 1.0], [0.5, 0.5], [-3.0, -2.0]] {
            scene.insert_joint(a, b, joint(good)).unwrap();
        }
    }
    for axis in [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ] {
        refused(JointBuilder::spherical().limits(axis, [-3.2, 0.0]), "limits");
        refused(JointBuilder::spherical().limits(axis, [0.0, 6.0]), "limits");
    }
    refused(JointBuilder::rope(-1.0), "limits");
    refused(JointBuilder::rope(NAN), "limits");
    refused(JointBuilder::distance(INF), "limits");
}

#[test]
fn motors_and_friction() {
    for axis in JointAxis::ALL {
        let motor = |values: [f32; 5]| {
            let [position, velocity, stiffness, damping, force] = values;
            JointBuilder::generic(&[])
                .set_motor(axis, position, velocity, stiffness, damping)
                .motor_max_force(axis, force)
        };
        for place in 0..5 {
            let mut values = [0.5, 1.0, 10.0, 1.0, 5.0];
            for bad in [NAN, -INF, if place < 2 { 2e6 } else { -1.0 }] {
                values[place] = bad;
                refused(motor(values), "motor");
            }
        }
        refused(motor([0.0, INF, 0.0, 1.0, 5.0]), "motor");
        refused(motor([0.0, 0.0, INF, 1.0, 5.0]), "motor");
        for bad in [NAN, INF, -0.1] {
            let joint = JointBuilder::spherical().friction(axis, bad);
            refused(joint, "friction");
        }
        let (mut scene, [.., a, b]) = bodies();
        let joint = scene.insert_joint(a, b, motor([0.5, 1.0, 10.0, 1.0, INF])).unwrap();
        let (mut editor, _) = Editor::new(scene).unwrap();
        let mut bad = editor.scene().joint(joint).unwrap().motors[axis as usize].unwrap();
        bad.target_vel = NAN;
        names(&editor.set_joint_motor(joint, axis, Some(bad)).unwrap_err(), "motor");
        assert_eq!(editor.scene().joint(joint).unwrap().motors[axis as usize].unwrap().target_vel, 1.0);
        // Without its motor nothing is left that acts.
        names(&editor.set_joint_motor(joint, axis, None).unwrap_err(), "axes");
    }
    refused(JointBuilder::spring(NAN, 10.0, 1.0), "motor");
    refused(JointBuilder::spring(1.0, -10.0, 1.0), "motor");
}

#[test]
fn softness_breaking_and_joints_that_hold_nothing() {
    for bad in [NAN, INF, 0.0, -1.0] {
        refused(JointBuilder::fixed().softness(bad, 1.0), "softness.frequency");
    }
    for bad in [NAN, INF, -1.0] {
        refused(JointBuilder::fixed().softness(5.0, bad), "softness.damping_ratio");
    }
    for bad in [NAN, 0.0, -1.0] {
        refused(JointBuilder::fixed().breakable(bad, 1.0), "break_force");
        refused(JointBuilder::fixed().breakable(1.0, bad), "break_torque");
    }
    refused(JointBuilder::generic(&[]), "axes");
    refused(JointBuilder::rope(1.0).locked_axes(&[JointAxis::LinY]), "coupled axes");
    refused(JointBuilder::rope(1.0).limits(JointAxis::LinZ, [0.0, 1.0]), "coupled axes");
}

/// What is no more is told as such, by every function that takes its handle.
#[test]
fn handles_of_what_is_no_more() {
    let (mut scene, [fixed, _, a, b]) = bodies();
    let joints =
        [[fixed, a], [a, b], [b, fixed]].map(|[x, y]| scene.insert_joint(x, y, JointBuilder::spherical()).unwrap());
    scene.remove_joint(joints[0]).unwrap();
    // The slot is taken again, and the handle names nobody.
    let again = scene.insert_joint(fixed, a, JointBuilder::fixed()).unwrap();
    assert_eq!((again.slot(), again.generation()), (joints[0].slot(), 1));
    let stale = |scene: &mut Scene, joint: JointHandle| {
        let error = Error::StaleJoint(joint);
        assert_eq!(scene.joint(joint).unwrap_err(), error);
        assert_eq!(scene.joined(joint).unwrap_err(), error);
        assert_eq!(scene.remove_joint(joint).unwrap_err(), error);
        assert_eq!(scene.set_joint(joint, JointBuilder::fixed()).unwrap_err(), error);
        assert!(error.to_string().contains(&joint.to_string()), "{error}");
    };
    stale(&mut scene, joints[0]);
    // Joints go with their bodies.
    scene.remove(b).unwrap();
    stale(&mut scene, joints[1]);
    stale(&mut scene, joints[2]);
    assert_eq!((scene.joint_count(), scene.joints_of(a).unwrap()), (1, &[again][..]));
    for pair in [[a, b], [b, a]] {
        assert_eq!(scene.insert_joint(pair[0], pair[1], JointBuilder::fixed()).unwrap_err(), Error::StaleBody(b));
    }
    assert_eq!(scene.joints_of(b).unwrap_err(), Error::StaleBody(b));
    // In an editor likewise, and the joints of the coming step are those that live.
    let (mut editor, _) = Editor::new(scene).unwrap();
    assert_eq!(editor.take(JointSolver::Auto).joints.topology.joint_count(), 1);
    editor.remove(a).unwrap();
    for error in [
        editor.remove_joint(again).unwrap_err(),
        editor.set_joint(again, JointBuilder::fixed()).unwrap_err(),
        editor.set_joint_motor(again, JointAxis::AngX, None).unwrap_err(),
    ] {
        assert_eq!(error, Error::StaleJoint(again));
    }
    assert_eq!(editor.insert_joint(a, fixed, JointBuilder::fixed()).unwrap_err(), Error::StaleBody(a));
    assert_eq!(editor.take(JointSolver::Auto).joints.topology.joint_count(), 0);
}

/// An island too large for the direct solve is solved by Gauss-Seidel, and said to be.
#[test]
fn an_island_too_large_is_told() {
    let topology = |scene: Scene, solver| {
        let (mut editor, _) = Editor::new(scene).unwrap();
        editor.take(solver).joints.topology.clone()
    };
    // A ball joint has one block of rows.
    for (links, large) in [(1024, 0), (1025, 1)] {
        for solver in [JointSolver::Auto, JointSolver::Direct] {
            let topology = topology(scenes::chain(links, 1.0), solver);
            assert_eq!((topology.too_large, topology.island_count), (large, 1), "{links} links, {solver:?}");
            assert_eq!(topology.direct_joints(), links as u32 * (1 - large));
            assert_eq!(topology.joint_count(), links as u32);
        }
    }
    let forced = topology(scenes::chain(20, 1.0), JointSolver::GaussSeidel);
    assert_eq!((forced.direct_joints(), forced.too_large, forced.joint_count()), (0, 0, 20));
}
