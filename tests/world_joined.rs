//! What joints do beside holding: bodies that they keep from colliding, and islands that sleep and wake by them. The joints
//! here are slack ropes where nothing else is said, so that nothing is to be solved. Oracles: analysis, and the run that
//! had room.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use tumble::prelude::*;
use tumble_core::{BodyHandle, JointAxis, JointBuilder, JointMotor, MotorModel, Sleep, StepReport};
use worlds::{SIDES, Side, hash, report, steps};

const SLEEP: Sleep = Sleep { distance: 2e-3, time: 0.5 };

fn sleeping() -> Params {
    Params { sleep: Some(SLEEP), ..Params::default() }
}

/// Never taut here.
fn slack() -> JointBuilder {
    JointBuilder::rope(100.0)
}

fn apart() -> JointBuilder {
    slack().contacts_enabled(false)
}

fn cuboid() -> ColliderBuilder {
    ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0)
}

fn at(position: Vec3) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(position)
}

/// Pairs of bodies between which there are contacts, lower slot first, each once.
fn touching(world: &mut World) -> Vec<[usize; 2]> {
    let contacts = world.contacts().unwrap();
    let pairs = contacts.all.iter().map(|contact| [contact.body_a.slot(), contact.body_b.slot()]);
    let mut pairs: Vec<_> = pairs.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    pairs.sort();
    pairs.dedup();
    pairs
}

/// Bodies asleep, islands awake, islands asleep.
fn counts(report: &StepReport) -> (u32, u32, u32) {
    assert_eq!(report.lost, 0, "{report}");
    (report.asleep, report.islands, report.islands_asleep)
}

/// Oracle: who was told not to collide. Three bodies overlap, one of several shapes; a joint keeps two of them apart, and
/// another, that does not, joins one of them with the third.
#[test]
fn bodies_that_a_joint_keeps_apart_have_no_contacts() {
    use Broadphase::{BruteForce, Grid, Lbvh, SlicedGrid, SweepAndPrune};
    for side in SIDES {
        for broadphase in [BruteForce, Grid, SlicedGrid, Lbvh, SweepAndPrune] {
            let mut scene = Scene::new();
            scene.gravity = Vec3::ZERO;
            let a = scene.insert(at(Vec3::ZERO), cuboid()).body;
            scene.attach(a, ColliderBuilder::ball(0.6).translation(Vec3::Z * 0.3)).unwrap();
            let b = scene.insert(at(Vec3::X * 0.8), ColliderBuilder::ball(0.5)).body;
            scene.attach(b, cuboid().translation(Vec3::X * 0.2)).unwrap();
            let c = scene.insert(at(Vec3::new(0.4, 0.8, 0.0)), cuboid()).body;
            scene.insert_joint(b, a, apart()).unwrap();
            scene.insert_joint(c, a, slack()).unwrap();
            let mut world = side.world(&scene, &Params { broadphase, ..Params::default() });
            world.step().unwrap();
            assert_eq!(touching(&mut world), [[0, 2], [1, 2]], "{side:?}, {broadphase}");
            let report = report(&mut world);
            // Four pairs of shapes are kept apart, four touch; all are found, and none is lost.
            assert_eq!((report.pairs, report.manifolds, report.lost), (8, 4, 0), "{side:?}, {broadphase}: {report}");
        }
    }
}

/// A box on a fixed one, whose top is at y = 0.
fn shelf() -> (Scene, BodyHandle, BodyHandle) {
    let mut scene = Scene::new();
    let support =
        scene.insert(RigidBodyBuilder::fixed().translation(Vec3::Y * -2.0), ColliderBuilder::cuboid(4.0, 2.0, 4.0));
    let item = scene.insert(at(Vec3::Y * 0.5), cuboid());
    (scene, support.body, item.body)
}

/// Oracle: analysis. While a joint keeps them apart the box falls through its support as if there were none, and
/// afterwards it is held as before; asleep or not.
#[test]
fn contacts_go_and_come_with_joints() {
    for side in SIDES {
        for sleep in [None, Some(SLEEP)] {
            let (scene, support, item) = shelf();
            let mut world = side.world(&scene, &Params { sleep, ..Params::default() });
            let what = format!("{side:?}, {sleep:?}");
            let height = |world: &mut World| world.poses().unwrap()[item].translation.y;
            steps(&mut world, 60);
            assert_eq!(touching(&mut world), [[0, 1]], "{what}");
            assert_eq!(report(&mut world).asleep, u32::from(sleep.is_some()), "{what}");

            let from = height(&mut world);
            let joint = world.edit().insert_joint(support, item, apart()).unwrap();
            world.step().unwrap();
            assert_eq!((touching(&mut world), report(&mut world).asleep), (vec![], 0), "{what}");
            steps(&mut world, 5);
            // g t² / 2 after 0.1 s, 49 mm; to a tenth of a millimetre, for what was left of the contact.
            assert!((from - height(&mut world) - 0.04905).abs() < 1e-4, "{what}: {}", from - height(&mut world));

            world.edit().set_joint(joint, slack()).unwrap();
            world.step().unwrap();
            assert_eq!(touching(&mut world), [[0, 1]], "{what}: back");
            steps(&mut world, 120);
            assert!((height(&mut world) - from).abs() < 1e-3, "{what}: {} m, from {from} m", height(&mut world));

            world.edit().set_joint(joint, apart()).unwrap();
            world.step().unwrap();
            assert_eq!(touching(&mut world), [[0usize; 2]; 0], "{what}: gone again");
            world.edit().remove_joint(joint).unwrap();
            world.step().unwrap();
            assert_eq!(touching(&mut world), [[0, 1]], "{what}: without the joint");
        }
    }
}

/// Oracle: analysis. A joint goes with its body: who gets the slot next collides.
#[test]
fn a_new_body_in_the_slot_of_one_kept_apart_collides() {
    for side in SIDES {
        let (mut scene, support, item) = shelf();
        scene.insert_joint(support, item, apart()).unwrap();
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 3);
        assert_eq!(touching(&mut world), [[0usize; 2]; 0], "{side:?}");
        world.edit().remove(item).unwrap();
        let next = world.edit().insert(at(Vec3::Y * 0.5), cuboid()).unwrap().body;
        assert_eq!(next.slot(), item.slot());
        world.step().unwrap();
        assert_eq!(touching(&mut world), [[0, 1]], "{side:?}");
    }
}

/// Oracle: analysis. What is fast goes through a fixed body that it does not collide with, all of its way.
#[test]
fn no_way_ends_at_what_does_not_collide() {
    for side in SIDES {
        let mut scene = Scene::new();
        scene.gravity = Vec3::ZERO;
        let wall = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(0.05, 5.0, 5.0)).body;
        let ball = scene.insert(at(Vec3::X * -2.0).linvel(Vec3::X * 120.0), ColliderBuilder::ball(0.1)).body;
        // Its anchors pass far from each other.
        scene.insert_joint(wall, ball, apart().local_anchor1(Vec3::Y * 50.0)).unwrap();
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 3);
        // Three times 2 m, to rounding.
        let x = world.poses().unwrap()[ball].translation.x;
        assert!((x - 4.0).abs() < 1e-5, "{side:?}: {x} m");
    }
}

/// Oracle: the run that had room from the start. Of steps in flight one finds too many pairs; it and those behind it, which
/// have another list of who does not collide, run again. (Adapters that finish a step while it is submitted, as llvmpipe
/// does, have none behind it.)
#[test]
fn steps_that_run_again_have_lists_of_their_own() {
    for side in SIDES {
        let run = |pairs: Option<u32>| {
            let (mut scene, support, item) = shelf();
            for x in 1..4 {
                let other = scene.insert(at(Vec3::new(1.0 * x as f32, 0.5, 2.0)), cuboid()).body;
                scene.insert_joint(support, other, slack()).unwrap();
            }
            let joint = scene.insert_joint(support, item, apart()).unwrap();
            let capacities = Capacities { pairs, ..Capacities::default() };
            let mut world = side.world(&scene, &Params { capacities, ..Params::default() });
            steps(&mut world, 3);
            world.sync().unwrap();
            // 28 pairs at once.
            for i in 0..8 {
                let position = Vec3::new(0.1 * i as f32, 5.0 + 0.02 * i as f32, -1.5);
                world.edit().insert(at(position), ColliderBuilder::ball(0.6)).unwrap();
            }
            world.step().unwrap();
            world.edit().set_joint(joint, slack()).unwrap();
            world.step().unwrap();
            world.edit().set_joint(joint, apart()).unwrap();
            steps(&mut world, 20);
            (report(&mut world).growths_of("pairs") > 0, hash(&mut world))
        };
        let (grown, expected) = run(None);
        assert!(!grown);
        assert_eq!(run(Some(12)), (true, expected), "{side:?}");
    }
}

/// Two boxes on a floor, 4 m apart.
fn two_boxes(joint: Option<JointBuilder>) -> (Scene, [BodyHandle; 2], Option<JointHandle>) {
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    let bodies = [-2.0, 2.0].map(|x| scene.insert(at(Vec3::new(x, 0.5, 0.0)), cuboid()).body);
    let joint = joint.map(|joint| scene.insert_joint(bodies[1], bodies[0], joint).unwrap());
    (scene, bodies, joint)
}

/// Oracle: analysis. Bodies that only a joint holds together sleep together, stay as they are, and wake together,
/// whatever is done to one of them or to the joint.
#[test]
fn what_is_joined_sleeps_and_wakes_as_one() {
    for side in SIDES {
        let mut world = side.world(&two_boxes(None).0, &sleeping());
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (2, 0, 2), "{side:?}: not joined");
        let (scene, bodies, joint) = two_boxes(Some(slack()));
        let joint = joint.unwrap();
        let mut world = side.world(&scene, &sleeping());
        world.step().unwrap();
        assert_eq!(counts(&report(&mut world)), (0, 1, 0), "{side:?}");
        type Cause<'a> = &'a dyn Fn(&mut World);
        let causes: [(&str, Cause); 5] = [
            ("impulse on the first", &|world| world.edit().apply_impulse(bodies[0], Vec3::Y).unwrap()),
            ("impulse on the second", &|world| world.edit().apply_impulse(bodies[1], Vec3::Y).unwrap()),
            ("limits", &|world| world.edit().set_joint(joint, JointBuilder::rope(90.0)).unwrap()),
            ("motor", &|world| {
                let (target_pos, target_vel, stiffness, damping) = (0.0, 0.0, 0.0, 1e-3);
                let model = MotorModel::ForceBased;
                let motor = JointMotor { target_pos, target_vel, stiffness, damping, max_force: 1e-3, model };
                world.edit().set_joint_motor(joint, JointAxis::LinX, Some(motor)).unwrap();
            }),
            ("removal", &|world| world.edit().remove_joint(joint).unwrap()),
        ];
        for (name, cause) in causes {
            steps(&mut world, 120);
            assert_eq!(counts(&report(&mut world)), (2, 0, 1), "{side:?}, before {name}");
            let before = hash(&mut world);
            steps(&mut world, 3);
            assert_eq!(hash(&mut world), before, "{side:?}, before {name}: as they fell asleep");
            cause(&mut world);
            world.step().unwrap();
            assert_eq!(report(&mut world).asleep, 0, "{side:?}, {name}");
        }
        steps(&mut world, 120);
        assert_eq!(counts(&report(&mut world)), (2, 0, 2), "{side:?}: no longer joined");
    }
}

/// Oracle: analysis. Who is joined to one that must not sleep, or goes on moving, does not sleep; a joint that is made wakes
/// both.
#[test]
fn nobody_sleeps_whose_partner_is_awake() {
    for side in SIDES {
        let (mut scene, [first, second], _) = two_boxes(None);
        let rolls = at(Vec3::new(0.0, 30.0, 0.0)).gravity_scale(0.0).linvel(Vec3::X);
        let flier = scene.insert(rolls, ColliderBuilder::ball(0.1)).body;
        let mut world = side.world(&scene, &sleeping());
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (2, 1, 2), "{side:?}: the flier goes on");
        let joint = world.edit().insert_joint(flier, first, slack()).unwrap();
        world.edit().insert_joint(first, second, slack()).unwrap();
        for _ in 0..60 {
            world.step().unwrap();
            assert_eq!(counts(&report(&mut world)), (0, 1, 0), "{side:?}");
        }
        world.edit().remove_joint(joint).unwrap();
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (2, 1, 1), "{side:?}");
    }
}

/// Oracle: analysis. A kinematic body that moves wakes what is joined to it, in the same step, and keeps it awake until it
/// stands; a fixed one that is put elsewhere wakes it once.
#[test]
fn what_is_driven_wakes_what_is_joined_to_it() {
    for side in SIDES {
        let (mut scene, [first, second], _) = two_boxes(Some(slack()));
        let far = Vec3::new(0.0, 20.0, 0.0);
        let drive = RigidBodyBuilder::kinematic_velocity_based().translation(far);
        let drive = scene.insert(drive, ColliderBuilder::ball(0.1)).body;
        let post = scene.insert(RigidBodyBuilder::fixed().translation(2.0 * far), ColliderBuilder::ball(0.1)).body;
        scene.insert_joint(second, drive, slack()).unwrap();
        scene.insert_joint(post, first, slack()).unwrap();
        let mut world = side.world(&scene, &sleeping());
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (2, 0, 1), "{side:?}: what stands lets sleep");
        world.edit().set_velocity(drive, Vec3::X * 0.1, Vec3::ZERO).unwrap();
        for _ in 0..60 {
            world.step().unwrap();
            assert_eq!(counts(&report(&mut world)), (0, 1, 0), "{side:?}: driven");
        }
        world.edit().set_velocity(drive, Vec3::ZERO, Vec3::ZERO).unwrap();
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (2, 0, 1), "{side:?}: it stands");
        world.edit().set_pose(post, (3.0 * far).into()).unwrap();
        world.step().unwrap();
        assert_eq!(report(&mut world).asleep, 0, "{side:?}: the post was moved");
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (2, 0, 1), "{side:?}: again");
    }
}

/// A chain of five links from a hook, and one of four beside it.
fn two_chains() -> (Scene, Vec<BodyHandle>) {
    let mut scene = Scene::new();
    let mut links = Vec::new();
    for (x, count) in [(0.0, 5), (3.0, 4)] {
        let mut above =
            scene.insert(RigidBodyBuilder::fixed().translation(Vec3::X * x), ColliderBuilder::ball(0.05)).body;
        let mut reach = 0.0;
        for i in 0..count {
            let link = at(Vec3::new(x, -0.5 - i as f32, 0.0)).linear_damping(2.0).angular_damping(5.0);
            let link = scene.insert(link, ColliderBuilder::cuboid(0.1, 0.5, 0.1).density(1000.0)).body;
            let joint = JointBuilder::spherical().local_anchor1(Vec3::Y * -reach).local_anchor2(Vec3::Y * 0.5);
            scene.insert_joint(above, link, joint.contacts_enabled(false)).unwrap();
            (above, reach) = (link, 0.5);
            links.push(link);
        }
    }
    (scene, links)
}

/// Oracle: analysis. Chains that hang at rest sleep, one by one, and hang as before by the bit; a blow at one's end moves
/// all of that chain and wakes no other.
#[test]
fn chains_hang_and_sleep() {
    // Ball joints were off by 2.4e-7 m when solved directly, and by 1.4e-4 m by Gauss-Seidel.
    let solvers = [(JointSolver::Direct, 1e-5), (JointSolver::GaussSeidel, 1e-3)];
    for (side, (joints, most)) in JOINT_SIDES.into_iter().flat_map(|side| solvers.map(|solver| (side, solver))) {
        let (scene, links) = two_chains();
        let mut world = side.world(&scene, &Params { joints, ..sleeping() });
        let mut off = 0.0f32;
        world.edit().apply_impulse(links[4], Vec3::X * 2.0).unwrap();
        let mut count = 0;
        while report(&mut world).islands_asleep < 2 && count < 1200 {
            steps(&mut world, 20);
            count += 20;
        }
        assert_eq!(counts(&report(&mut world)), (9, 0, 2), "{side:?}, {joints:?}, after {count} steps");
        let before = hash(&mut world);
        steps(&mut world, 5);
        assert_eq!(hash(&mut world), before, "{side:?}");
        world.edit().apply_impulse(links[4], Vec3::X * 20.0).unwrap();
        let asleep = world.poses().unwrap();
        steps(&mut world, 10);
        assert_eq!(counts(&report(&mut world)), (4, 1, 1), "{side:?}");
        let (awake, velocities) = (world.poses().unwrap(), world.velocities().unwrap());
        for (i, &link) in links.iter().enumerate() {
            let moved = awake[link].translation != asleep[link].translation;
            assert_eq!(moved, i < 5, "{side:?}, link {i}");
            assert!(awake[link].translation.is_finite() && velocities[link].linear.is_finite(), "{side:?}, link {i}");
            let above = if i == 0 || i == 5 { Vec3::X * [0.0, 3.0][i / 5] } else { foot(&awake[links[i - 1]]) };
            off = off.max((head(&awake[link]) - above).length());
        }
        println!("{side:?}, {joints:?}: {off} m");
        assert!(off < most, "{side:?}, {joints:?}: {off} m");
    }
}

fn head(pose: &Pose) -> Vec3 {
    pose.translation + pose.rotation * (Vec3::Y * 0.5)
}

fn foot(pose: &Pose) -> Vec3 {
    pose.translation - pose.rotation * (Vec3::Y * 0.5)
}

/// Sides that solve joints.
const JOINT_SIDES: [Side; 2] = SIDES;
