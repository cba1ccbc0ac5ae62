//! Joints read in bulk, from poses set by hand. Oracle: analysis.

use tumble_core::glam::{Quat, Vec3};
use tumble_core::layout::{BodyState, JointState};
use tumble_core::{
    BodyHandle, ColliderBuilder, Editor, Error, JointAxis, JointBuilder, JointHandle, JointReading, JointSolver,
    Joints, RigidBodyBuilder, Scene,
};

/// Two cubes, whose principal frames are their own, with a joint between them; the second one is where `place` says, as
/// seen from the first, which lies somewhere.
struct Two {
    editor: Editor,
    states: Vec<BodyState>,
    bodies: [BodyHandle; 2],
    joint: JointHandle,
}

impl Two {
    fn new(joint: JointBuilder, place: Vec3, turn: Quat) -> Self {
        let mut scene = Scene::new();
        let (origin, stance) = (Vec3::new(3.0, -2.0, 5.0), Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1));
        let mut insert = |position, rotation| {
            let body = RigidBodyBuilder::dynamic().translation(position).rotation(rotation);
            scene.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).body
        };
        let bodies = [insert(origin, stance), insert(origin + stance * place, stance * turn)];
        let joint = scene.insert_joint(bodies[0], bodies[1], joint).unwrap();
        let (editor, packed) = Editor::new(scene).unwrap();
        Self { editor, states: packed.states, bodies, joint }
    }

    fn read(&mut self, states: &[JointState]) -> Joints {
        let set = self.editor.take(JointSolver::Auto).joints;
        Joints::read(7, &set, &self.states, states)
    }

    fn reading(&mut self) -> JointReading {
        let joints = self.read(&[]);
        assert_eq!((joints.step, joints.all.len()), (7, 1));
        joints[self.joint]
    }
}

/// Poses are floats: 5 m and 1 rad to some 1e-6.
const CLOSE: f32 = 3e-6;

fn assert_coordinates(what: &str, reading: &JointReading, expected: [f32; 6]) {
    for (axis, expected) in JointAxis::ALL.into_iter().zip(expected) {
        let found = reading.coordinate(axis);
        assert!((found - expected).abs() < CLOSE, "{what}, {axis:?}: {found}, not {expected}");
    }
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() < CLOSE
}

#[test]
fn coordinates_are_where_the_second_frame_is() {
    let arm = Vec3::Y * 0.5;
    for angle in [0.0, 0.3, -2.0, 3.1, -3.1] {
        // Turned about z, the joint's x axis, and 1 mm off along the body's x, which is none of the joint's own axes.
        let hinge = JointBuilder::revolute(Vec3::Z).local_anchor1(arm).local_anchor2(-arm);
        let turn = Quat::from_rotation_z(angle);
        let reading = Two::new(hinge, arm + turn * arm + Vec3::Z * 1e-3, turn).reading();
        assert_coordinates("hinge", &reading, [1e-3, 0.0, 0.0, angle, 0.0, 0.0]);
        assert!(close(reading.separation, 1e-3) && close(reading.angle, 0.0), "{reading:?}");
        // Tilted by 0.01 rad about the joint's y and z axes too: the sines of that.
        let tilt = Quat::from_axis_angle(Vec3::X, 0.01);
        let hinge = JointBuilder::revolute(Vec3::Z);
        let reading = Two::new(hinge, Vec3::ZERO, tilt * turn).reading();
        assert!(close(reading.angle, 0.01f32.sin()), "{reading:?}");
        assert!(close(reading.coordinate(JointAxis::AngX), angle), "{reading:?}");
    }
    let slider = JointBuilder::prismatic(Vec3::X).limits(JointAxis::LinX, [-1.0, 1.0]);
    let reading = Two::new(slider, Vec3::new(0.7, 2e-3, -1e-3), Quat::from_rotation_x(0.02)).reading();
    assert_coordinates("slider", &reading, [0.7, 2e-3, -1e-3, 0.02, 0.0, 0.0]);
    assert!(close(reading.separation, 5.0f32.sqrt() * 1e-3) && close(reading.angle, 0.02), "{reading:?}");

    let vector = Vec3::new(0.4, -0.9, 1.2);
    let turn = Quat::from_scaled_axis(vector);
    let reading = Two::new(JointBuilder::spherical(), Vec3::ZERO, turn).reading();
    assert_coordinates("ball", &reading, [0.0, 0.0, 0.0, vector.x, vector.y, vector.z]);
    assert!(close(reading.separation, 0.0) && reading.angle == 0.0, "free angles are not off: {reading:?}");
    // The same rotation by the other sign.
    let reading = Two::new(JointBuilder::spherical(), Vec3::ZERO, -turn).reading();
    assert_coordinates("ball", &reading, [0.0, 0.0, 0.0, vector.x, vector.y, vector.z]);

    let reading = Two::new(JointBuilder::fixed(), Vec3::Y * 0.1, turn).reading();
    assert_coordinates("fixed", &reading, [0.0, 0.1, 0.0, vector.x, vector.y, vector.z]);
    assert!(close(reading.separation, 0.1) && close(reading.angle, vector.length()), "{reading:?}");

    for [first, second] in [[0.4, -1.1], [-2.5, 1.3], [0.0, 0.0]] {
        // First about x of the first body, then about y of the second one.
        let turn = Quat::from_rotation_x(first) * Quat::from_rotation_y(second);
        let reading = Two::new(JointBuilder::universal(Vec3::X, Vec3::Y), Vec3::ZERO, turn).reading();
        assert_coordinates("universal", &reading, [0.0, 0.0, 0.0, first, second, 0.0]);
        assert!(close(reading.angle, 0.0), "{reading:?}");
    }

    let (away, from) = (Vec3::new(2.0, -3.0, 6.0), Vec3::new(0.1, 0.2, 0.3));
    let reading = Two::new(JointBuilder::rope(8.0).local_anchor1(from), away + from, turn).reading();
    assert_coordinates("rope", &reading, [7.0, 0.0, 0.0, vector.x, vector.y, vector.z]);
    assert!(reading.separation == 0.0 && reading.angle == 0.0, "no axis is locked: {reading:?}");
    let reading = Two::new(JointBuilder::distance(7.5), away, Quat::IDENTITY).reading();
    assert!(close(reading.separation, 0.5) && close(reading.coordinates[0], 7.0), "{reading:?}");
}

/// Oracle: impulse over time, and the rules for slots that others have had.
#[test]
fn forces_are_those_of_the_last_sub_step_of_this_joint() {
    let mut two = Two::new(JointBuilder::spherical(), Vec3::Y * 0.01, Quat::IDENTITY);
    let state = JointState {
        impulse: [1.0, -2.0, 3.0],
        torque: [0.5, 0.0, -0.25],
        tag: 1,
        h: 0.125,
        ..bytemuck::Zeroable::zeroed()
    };
    let reading = two.read(&[state])[two.joint];
    assert_eq!((reading.force, reading.torque), (Vec3::new(8.0, -16.0, 24.0), Vec3::new(4.0, 0.0, -2.0)));
    assert_eq!((reading.bodies, reading.broken), (two.bodies, false));
    let broken = two.read(&[JointState { broken: 1, ..state }])[two.joint];
    assert_eq!((broken.broken, broken.separation, broken.force), (true, 0.0, reading.force));
    let another = two.read(&[JointState { tag: 2, broken: 1, ..state }])[two.joint];
    assert_eq!((another.broken, another.force), (false, Vec3::ZERO));

    let old = two.joint;
    two.editor.remove_joint(old).unwrap();
    assert!(matches!(two.read(&[state]).get(old), Err(Error::StaleJoint(joint)) if joint == old));
    let [a, b] = two.bodies;
    let new = two.editor.insert_joint(a, b, JointBuilder::fixed()).unwrap();
    let joints = two.read(&[state]);
    assert!(joints.get(old).is_err() && joints[new].force == Vec3::ZERO, "the slot is another joint's");
}
