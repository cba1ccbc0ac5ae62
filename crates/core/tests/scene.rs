//! Building scenes: handles, slots, removal, packing.

use tumble_core::glam::{Quat, Vec3};
use tumble_core::layout::{body_flags, pair_kind, shape_kind};
use tumble_core::{ColliderBuilder, CombineRule, Error, PackedScene, Plan, RigidBodyBuilder, Scene, measures};

fn ball_at(x: f32) -> (RigidBodyBuilder, ColliderBuilder) {
    (RigidBodyBuilder::dynamic().translation(Vec3::X * x), ColliderBuilder::ball(0.5))
}

fn insert_ball(scene: &mut Scene, x: f32) -> tumble_core::Inserted {
    let (body, collider) = ball_at(x);
    scene.insert(body, collider)
}

/// Oracle: analysis (slots are given in order).
#[test]
fn bodies_come_in_slot_order() {
    let mut scene = Scene::new();
    assert!(scene.is_empty());
    let handles: Vec<_> = (0..5).map(|i| insert_ball(&mut scene, 2.0 * i as f32).body).collect();
    assert_eq!(scene.len(), 5);
    assert_eq!(scene.collider_count(), 5);
    assert_eq!(scene.bodies().collect::<Vec<_>>(), handles);
    assert!(handles.iter().enumerate().all(|(i, h)| h.slot() == i && h.generation() == 0));
}

/// Oracle: analysis. A removed body's handle stays an error after its slot is taken by another.
#[test]
fn stale_handles_are_errors() {
    let mut scene = Scene::new();
    let first = insert_ball(&mut scene, 0.0);
    let other = insert_ball(&mut scene, 3.0);
    scene.remove(first.body).unwrap();
    assert_eq!((scene.len(), scene.collider_count()), (1, 1));
    assert_eq!(scene.remove(first.body), Err(Error::StaleBody(first.body)));

    let second = insert_ball(&mut scene, 6.0);
    assert_eq!(second.body.slot(), first.body.slot());
    assert_ne!(second.body, first.body);
    assert_ne!(second.collider, first.collider);
    assert_eq!(scene.body(first.body).unwrap_err(), Error::StaleBody(first.body));
    assert_eq!(scene.colliders_of(first.body).unwrap_err(), Error::StaleBody(first.body));
    assert_eq!(scene.mass_properties(first.body).unwrap_err(), Error::StaleBody(first.body));
    assert_eq!(scene.attach(first.body, ColliderBuilder::ball(1.0)).unwrap_err(), Error::StaleBody(first.body));
    assert!(scene.body(second.body).is_ok() && scene.body(other.body).is_ok());

    let poses = measures::initial_poses(&scene);
    let velocities = measures::initial_velocities(&scene);
    assert_eq!(poses.get(first.body).unwrap_err(), Error::StaleBody(first.body));
    assert_eq!(velocities.get(first.body).unwrap_err(), Error::StaleBody(first.body));
    assert_eq!(poses[second.body].translation, Vec3::X * 6.0);
    assert!(Error::StaleBody(first.body).to_string().contains("body 0 (generation 0)"));
}

/// Oracle: analysis. A handle of a larger scene names nothing in a smaller one.
#[test]
fn handles_of_another_scene_are_errors() {
    let (mut large, small) = (Scene::new(), Scene::new());
    let body = insert_ball(&mut large, 0.0).body;
    assert_eq!(small.body(body).unwrap_err(), Error::StaleBody(body));
}

/// Oracle: analysis. Removing a compound removes all its colliders; freed slots are zero when packed.
#[test]
fn removal_takes_every_collider() {
    let mut scene = Scene::new();
    let compound = insert_ball(&mut scene, 0.0);
    scene.attach(compound.body, ColliderBuilder::ball(0.2).translation(Vec3::Y)).unwrap();
    let kept = insert_ball(&mut scene, 5.0);
    assert_eq!(scene.colliders_of(compound.body).unwrap().len(), 2);
    scene.remove(compound.body).unwrap();
    assert_eq!(scene.collider_count(), 1);

    let packed = PackedScene::new(&scene).unwrap();
    assert_eq!((packed.states.len(), packed.colliders.len()), (2, 3));
    assert_eq!(packed.states[compound.body.slot()].flags, body_flags::NONE);
    assert_eq!(packed.states[kept.body.slot()].flags, body_flags::DYNAMIC);
    let shapes: Vec<_> = packed.colliders.iter().map(|c| c.shape).collect();
    assert_eq!(shapes, [shape_kind::NONE, shape_kind::NONE, shape_kind::BALL]);
}

/// Oracle: analysis (the plane's normal is the y axis of the packed collider's frame).
#[test]
fn packing_keeps_what_was_described() {
    let mut scene = Scene::new();
    let normal = Vec3::new(1.0, 2.0, -2.0);
    let floor = scene.insert(
        RigidBodyBuilder::fixed().linvel(Vec3::ONE).angvel(Vec3::ONE),
        ColliderBuilder::halfspace(normal).friction(0.3).friction_combine_rule(CombineRule::Max),
    );
    let kinematic = scene.insert(
        RigidBodyBuilder::kinematic_velocity_based().linvel(Vec3::X),
        ColliderBuilder::cuboid(1.0, 2.0, 3.0).restitution(0.7).restitution_combine_rule(CombineRule::Min),
    );
    let turn = Quat::from_xyzw(0.1, 0.2, 0.3, 0.9);
    let dynamic = scene.insert(
        RigidBodyBuilder::dynamic().translation(Vec3::Z).rotation(turn * 1.5).gravity_scale(0.5).linear_damping(0.1),
        ColliderBuilder::ball(0.5).density(6.0).friction(0.25),
    );
    let packed = PackedScene::new(&scene).unwrap();

    let plane = packed.colliders[floor.collider.slot()];
    let up = Quat::from_array(plane.rotation) * Vec3::Y;
    assert!((up - normal / 3.0).length() < 1e-6);
    assert_eq!((plane.friction, plane.combine), (0.3, CombineRule::Max as u32));
    let state = packed.states[floor.body.slot()];
    assert_eq!((state.linear_velocity, state.angular_velocity), ([0.0; 3], [0.0; 3]), "a fixed body stands still");

    let state = packed.states[kinematic.body.slot()];
    assert_eq!((state.flags, state.linear_velocity), (body_flags::KINEMATIC, [1.0, 0.0, 0.0]));
    assert_eq!(packed.props[kinematic.body.slot()].inverse_mass, 0.0);
    let slab = packed.colliders[kinematic.collider.slot()];
    assert_eq!((slab.size, slab.restitution), ([1.0, 2.0, 3.0], 0.7));
    assert_eq!(slab.combine, (CombineRule::Min as u32) << 2);

    let state = packed.states[dynamic.body.slot()];
    assert_eq!(state.position, [0.0, 0.0, 1.0]);
    assert!((Quat::from_array(state.rotation).length() - 1.0).abs() < 1e-6, "rotations are normalised");
    let props = packed.props[dynamic.body.slot()];
    assert!((1.0 / props.inverse_mass - std::f32::consts::PI).abs() < 1e-5, "6 pi d³ / 6 for d = 1 m");
    assert_eq!((props.gravity_scale, props.linear_damping, props.angular_damping), (0.5, 0.1, 0.0));
}

/// Oracle: analysis. A lopsided compound is packed about its centre of mass, and every collider still lies where it
/// was put.
#[test]
fn packing_moves_no_collider() {
    let mut scene = Scene::new();
    let turn = Quat::from_xyzw(0.3, -0.2, 0.4, 0.8).normalize();
    let origin = Vec3::new(3.0, -2.0, 5.0);
    let beam = ColliderBuilder::cuboid(0.4, 0.2, 0.3).rotation(turn.inverse());
    let body = scene.insert(RigidBodyBuilder::dynamic().translation(origin).rotation(turn), beam).body;
    let offset = Vec3::new(1.0, 0.5, -0.25);
    scene.attach(body, ColliderBuilder::ball(0.5).translation(offset)).unwrap();
    let packed = PackedScene::new(&scene).unwrap();
    let state = packed.states[body.slot()];
    let (position, rotation) = (Vec3::from_array(state.position), Quat::from_array(state.rotation));
    assert!((position - origin).length() > 0.1, "the centre of mass is not the origin of the body's frame");
    for (collider, place, frame) in
        [(&packed.colliders[0], origin, Quat::IDENTITY), (&packed.colliders[1], origin + turn * offset, turn)]
    {
        let found = position + rotation * Vec3::from_array(collider.position);
        assert!((found - place).length() < 1e-5, "{found} is not {place}");
        let found = rotation * Quat::from_array(collider.rotation);
        assert!(found.dot(frame).abs() > 1.0 - 1e-6, "{found} is not {frame}");
    }
}

/// Oracle: analysis. The plan holds the kinds that can occur, and widening keeps what was there.
#[test]
fn plan_names_the_pairs_that_can_occur() {
    let mut scene = Scene::new();
    assert_eq!(Plan::of(&scene), Plan::default());
    insert_ball(&mut scene, 0.0);
    assert_eq!(Plan::of(&scene).pair_kinds, 0, "one ball meets nothing");
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    let mut plan = Plan::of(&scene);
    assert_eq!(plan.pair_kinds, 1 << pair_kind::BALL_HALFSPACE);
    assert_eq!(plan.to_string(), "pairs: ball-halfspace; restitution: false; fixed: 0; joints: false; islands: false");

    let mut boxes = Scene::new();
    boxes.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(1.0, 1.0, 1.0).restitution(0.1));
    boxes.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(1.0, 1.0, 1.0));
    let other = Plan::of(&boxes);
    assert!(plan.widen(&other) && !plan.widen(&other));
    assert!(plan.has(pair_kind::BALL_HALFSPACE) && plan.has(pair_kind::CUBOID_CUBOID) && plan.restitution);
    assert!(!plan.has(pair_kind::BALL_CUBOID));
}
