//! Edits between steps: the order and grouping of the records, and what each carries. Oracle: analysis throughout.

use tumble_core::edit::EditBatch;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::layout::{BodyProps, Collider, EditRange, EditRecord, body_flags, edit_op, pair_kind, shape_kind};
use tumble_core::{ColliderBuilder, Editor, Error, Inserted, JointSolver, PackedScene, Pose, RigidBodyBuilder, Scene};

/// Four balls, apart.
fn editor() -> (Editor, [Inserted; 4]) {
    let mut scene = Scene::new();
    let bodies = [0.0, 2.0, 4.0, 6.0].map(|x| {
        scene.insert(RigidBodyBuilder::dynamic().translation(Vec3::X * x), ColliderBuilder::ball(0.5).density(1000.0))
    });
    (Editor::new(scene).unwrap().0, bodies)
}

/// (is of a collider, target) of a record.
fn target(record: &EditRecord) -> (bool, u32) {
    (record.op >= edit_op::COLLIDER, record.target)
}

/// Operations and targets, in order.
fn ops(batch: &EditBatch) -> Vec<(u32, u32)> {
    batch.records.iter().map(|r| (r.op, r.target)).collect()
}

/// One range for each target, in rising order, and together they are the records.
fn assert_grouped(batch: &EditBatch) {
    let mut next = 0;
    let mut before = None;
    for &EditRange { first, count } in &batch.ranges {
        assert_eq!(first, next, "ranges leave no gap");
        assert!(count > 0);
        let records = &batch.records[first as usize..(first + count) as usize];
        let own = target(&records[0]);
        assert!(records.iter().all(|r| target(r) == own), "a range has one target");
        assert!(before < Some(own), "bodies first, then colliders, each target once");
        before = Some(own);
        next = first + count;
    }
    assert_eq!(next as usize, batch.records.len(), "every record is in a range");
}

/// The first bytes of a record's data as what they stand for.
fn data<T: bytemuck::AnyBitPattern>(record: &EditRecord) -> T {
    *bytemuck::from_bytes(&bytemuck::bytes_of(&record.data)[..size_of::<T>()])
}

fn vector(record: &EditRecord, i: usize) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|k| f32::from_bits(record.data[i][k])))
}

#[test]
fn records_are_grouped_by_target_in_the_order_of_the_calls() {
    let (mut editor, [a, b, c, _]) = editor();
    editor.apply_impulse(c.body, Vec3::X).unwrap();
    editor.set_velocity(a.body, Vec3::Y, Vec3::Z).unwrap();
    editor.add_force(c.body, Vec3::Y * 2.0).unwrap();
    editor.set_pose(a.body, Vec3::ONE.into()).unwrap();
    editor.apply_torque_impulse(c.body, Vec3::Z * 3.0).unwrap();
    editor.set_velocity(a.body, Vec3::NEG_Y, Vec3::ZERO).unwrap();
    editor.add_torque(b.body, Vec3::X * 4.0).unwrap();
    let batch = editor.take(JointSolver::Auto);
    assert_grouped(&batch);
    let (sa, sb, sc) = (a.body.slot() as u32, b.body.slot() as u32, c.body.slot() as u32);
    assert_eq!(
        ops(&batch),
        [
            (edit_op::VELOCITY, sa),
            (edit_op::POSE, sa),
            (edit_op::VELOCITY, sa),
            (edit_op::FORCE, sb),
            (edit_op::IMPULSE, sc),
            (edit_op::FORCE, sc),
            (edit_op::IMPULSE, sc),
        ]
    );
    assert_eq!(batch.ranges.len(), 3);
    assert_eq!((vector(&batch.records[0], 0), vector(&batch.records[0], 1)), (Vec3::Y, Vec3::Z));
    assert_eq!(vector(&batch.records[1], 0), Vec3::ONE);
    assert_eq!(vector(&batch.records[2], 0), Vec3::NEG_Y, "the last velocity comes last");
    assert_eq!((vector(&batch.records[3], 0), vector(&batch.records[3], 1)), (Vec3::ZERO, Vec3::X * 4.0));
    assert_eq!((vector(&batch.records[4], 0), vector(&batch.records[4], 1)), (Vec3::X, Vec3::ZERO));
    assert_eq!((vector(&batch.records[6], 0), vector(&batch.records[6], 1)), (Vec3::ZERO, Vec3::Z * 3.0));
}

#[test]
fn taking_leaves_nothing() {
    let (mut editor, [a, ..]) = editor();
    assert_eq!(editor.take(JointSolver::Auto), EditBatch::default());
    editor.apply_impulse_at_point(a.body, Vec3::X, Vec3::Y).unwrap();
    let batch = editor.take(JointSolver::Auto);
    assert_eq!(ops(&batch), [(edit_op::IMPULSE_AT, 0)]);
    assert_eq!((vector(&batch.records[0], 0), vector(&batch.records[0], 1)), (Vec3::X, Vec3::Y));
    assert_eq!(editor.take(JointSolver::Auto), EditBatch::default());
}

/// An inserted body's records hold what packing a scene with it gives.
#[test]
fn insert_carries_the_packed_body() {
    let (mut editor, _) = editor();
    let turn = Quat::from_xyzw(0.1, 0.2, 0.3, 0.9);
    let body = RigidBodyBuilder::dynamic()
        .translation(Vec3::new(8.0, 1.0, 2.0))
        .rotation(turn)
        .linvel(Vec3::X)
        .angvel(Vec3::Y)
        .gravity_scale(0.5);
    let collider = ColliderBuilder::cuboid(0.1, 0.2, 0.3).density(500.0).translation(Vec3::Z).friction(0.9);
    let new = editor.insert(body, collider).unwrap();
    assert_eq!((new.body.slot(), editor.body_slots(), editor.collider_slots()), (4, 5, 5));

    let packed = PackedScene::new(editor.scene()).unwrap();
    let batch = editor.take(JointSolver::Auto);
    assert!(editor.plan().has(pair_kind::BALL_CUBOID), "the plan is wider now");
    assert_grouped(&batch);
    let expected = [(edit_op::SPAWN, 4), (edit_op::POSE, 4), (edit_op::VELOCITY, 4), (edit_op::COLLIDER, 4)];
    assert_eq!(ops(&batch), expected);
    let [spawn, pose, velocity, collider] = &batch.records[..] else { panic!("{batch:?}") };
    assert_eq!((spawn.kind, spawn.generation), (body_flags::DYNAMIC, 0));
    assert_eq!(data::<BodyProps>(spawn), packed.props[4]);
    assert_eq!(vector(pose, 0), Vec3::new(8.0, 1.0, 2.0), "the body's own frame, not the centre of mass");
    assert_eq!(pose.data[1].map(f32::from_bits), turn.normalize().to_array());
    assert_eq!((vector(velocity, 0), vector(velocity, 1)), (Vec3::X, Vec3::Y));
    assert_eq!(data::<Collider>(collider), packed.colliders[4]);
}

/// What one step removes and inserts in the same slot stays in order: first the end of the old, then the new.
#[test]
fn a_slot_reused_within_one_step() {
    let (mut editor, [_, b, ..]) = editor();
    editor.apply_impulse(b.body, Vec3::X).unwrap();
    editor.remove(b.body).unwrap();
    let new = editor.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(1.0, 1.0, 1.0)).unwrap();
    assert_eq!((new.body.slot(), new.body.generation()), (b.body.slot(), 1));
    let batch = editor.take(JointSolver::Auto);
    assert_grouped(&batch);
    let expected = [
        (edit_op::IMPULSE, 1),
        (edit_op::REMOVE, 1),
        (edit_op::SPAWN, 1),
        (edit_op::POSE, 1),
        (edit_op::VELOCITY, 1),
        (edit_op::COLLIDER_REMOVE, 1),
        (edit_op::COLLIDER, 1),
    ];
    assert_eq!(ops(&batch), expected);
    let spawn = &batch.records[2];
    assert_eq!((spawn.kind, spawn.generation), (body_flags::FIXED, 1));
    let gone: Collider = data(&batch.records[5]);
    assert_eq!(gone.shape, shape_kind::NONE);
}

/// A further collider rewrites the body's properties and moves its other colliders to the new centre of mass.
#[test]
fn attach_moves_the_other_colliders() {
    let (mut editor, [a, ..]) = editor();
    let handle = editor.attach(a.body, ColliderBuilder::ball(0.5).density(1000.0).translation(Vec3::Y)).unwrap();
    assert_eq!((handle.slot(), editor.collider_slots()), (4, 5));
    let packed = PackedScene::new(editor.scene()).unwrap();
    let batch = editor.take(JointSolver::Auto);
    assert_grouped(&batch);
    let expected = [(edit_op::PROPS, 0), (edit_op::COLLIDER, 0), (edit_op::COLLIDER, 4)];
    assert_eq!(ops(&batch), expected);
    let props: BodyProps = data(&batch.records[0]);
    assert_eq!(props, packed.props[0]);
    assert!((Vec3::from_array(props.center_of_mass) - Vec3::Y * 0.5).length() < 1e-6);
    assert_eq!(vector(&batch.records[0], 5), Vec3::ZERO, "the old centre of mass comes along");
    assert_eq!(batch.records[0].data[6].map(f32::from_bits), Quat::IDENTITY.to_array(), "and the old frame");
    for (record, slot) in [(&batch.records[1], 0), (&batch.records[2], 4)] {
        assert_eq!(data::<Collider>(record), packed.colliders[slot]);
    }
}

/// An edit that is refused leaves no record and no trace in the scene.
#[test]
fn refused_edits_leave_nothing() {
    let (mut editor, [a, b, ..]) = editor();
    editor.remove(b.body).unwrap();
    editor.take(JointSolver::Auto);
    let (nan, far) = (Vec3::splat(f32::NAN), Vec3::splat(1e8));
    let no_turn = Pose { translation: Vec3::ZERO, rotation: Quat::from_array([0.0; 4]) };
    let refused = [
        (editor.set_pose(a.body, nan.into()), "translation"),
        (editor.set_pose(a.body, far.into()), "translation"),
        (editor.set_pose(a.body, no_turn), "rotation"),
        (editor.set_velocity(a.body, far, Vec3::ZERO), "linear velocity"),
        (editor.set_velocity(a.body, Vec3::ZERO, nan), "angular velocity"),
        (editor.apply_impulse(a.body, nan), "impulse"),
        (editor.apply_torque_impulse(a.body, nan), "torque impulse"),
        (editor.apply_impulse_at_point(a.body, Vec3::X, nan), "impulse at a point"),
        (editor.add_force(a.body, nan), "force"),
        (editor.add_torque(a.body, nan), "torque"),
        (editor.add_force_at_point(a.body, nan, Vec3::X), "force at a point"),
        (editor.set_gravity(nan), "gravity"),
        (editor.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.0)).map(|_| ()), "ball.radius"),
        (editor.attach(a.body, ColliderBuilder::ball(-1.0)).map(|_| ()), "ball.radius"),
    ];
    for (result, field) in refused {
        let error = result.expect_err(field);
        assert!(matches!(&error, Error::Invalid { field: named, .. } if *named == field), "{field}: {error}");
    }
    let stale = Err(Error::StaleBody(b.body));
    assert_eq!(editor.set_pose(b.body, Vec3::ZERO.into()), stale);
    assert_eq!(editor.set_velocity(b.body, Vec3::ZERO, Vec3::ZERO), stale);
    assert_eq!(editor.apply_impulse(b.body, Vec3::ZERO), stale);
    assert_eq!(editor.remove(b.body), stale);
    assert_eq!(editor.freeze(b.body), stale);
    assert_eq!(editor.attach(b.body, ColliderBuilder::ball(1.0)).map(|_| ()), stale);
    assert_eq!(editor.take(JointSolver::Auto), EditBatch::default());
    assert_eq!((editor.scene().len(), editor.scene().collider_count()), (3, 3));
    assert_eq!(editor.scene().gravity, Vec3::new(0.0, -9.81, 0.0));
}

/// One loop of a shader applies the pushes on a body, so their number has a bound.
#[test]
fn too_many_pushes_on_one_body_are_refused() {
    let (mut editor, [a, b, ..]) = editor();
    for _ in 0..49_000 {
        editor.apply_impulse(a.body, Vec3::X).unwrap();
    }
    let error = editor.apply_impulse(a.body, Vec3::X).unwrap_err();
    assert!(error.to_string().contains("impulse is 49001"), "{error}");
    editor.apply_impulse(b.body, Vec3::X).unwrap();
    editor.take(JointSolver::Auto);
    editor.apply_impulse(a.body, Vec3::X).unwrap();
}
