//! Joints of whole worlds, read in bulk: where they are, what they bear, when they break, and what accuracy on demand spends
//! on them. Oracles: analysis, and the mirror.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use tumble::prelude::*;
use tumble_core::{BodyHandle, JointHandle, Sleep, Spent};
use worlds::{SIDES, Side, report, steps};

const SOLVERS: [JointSolver; 2] = [JointSolver::Direct, JointSolver::GaussSeidel];
/// Of the balls below, kg.
const MASS: f32 = 2.0;
const G: f32 = 9.81;

fn each() -> impl Iterator<Item = (Side, JointSolver)> {
    SIDES.into_iter().flat_map(|side| SOLVERS.map(|joints| (side, joints)))
}

fn ball() -> ColliderBuilder {
    ColliderBuilder::ball(0.1).density(MASS / (4.0 / 3.0 * std::f32::consts::PI * 1e-3))
}

fn at(position: Vec3) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(position)
}

/// A hook far from others, and a ball at `arm` from it, joined by `joint` at the hook.
fn hang(scene: &mut Scene, hook: Vec3, arm: Vec3, joint: JointBuilder) -> (BodyHandle, JointHandle) {
    let post = scene.insert(RigidBodyBuilder::fixed().translation(hook), ColliderBuilder::ball(0.05)).body;
    let weight = scene.insert(at(hook + arm), ball()).body;
    let joint = scene.insert_joint(post, weight, joint.local_anchor2(-arm)).unwrap();
    (weight, joint)
}

/// One joint of each kind.
fn all_kinds() -> (Scene, Vec<(&'static str, JointHandle)>) {
    let (mut scene, mut joints) = (Scene::new(), Vec::new());
    let side = Vec3::new(0.5, 0.0, 0.0);
    let kinds = [
        ("fixed", JointBuilder::fixed()),
        ("ball", JointBuilder::spherical()),
        ("hinge", JointBuilder::revolute(Vec3::Z)),
        ("limited hinge", JointBuilder::revolute(Vec3::Z).limits(JointAxis::AngX, [-0.05, 0.05])),
        ("slider", JointBuilder::prismatic(Vec3::new(0.6, -0.8, 0.0))),
        ("universal", JointBuilder::universal(Vec3::Z, Vec3::X)),
        ("motor", JointBuilder::revolute(Vec3::Z).motor_velocity(JointAxis::AngX, 2.0, 30.0)),
        ("soft", JointBuilder::fixed().softness(5.0, 0.7)),
    ];
    for (i, (name, joint)) in kinds.into_iter().enumerate() {
        joints.push((name, hang(&mut scene, Vec3::Z * i as f32, side, joint).1));
    }
    let far = Vec3::X * 9.0;
    let post = scene.insert(RigidBodyBuilder::fixed().translation(far), ColliderBuilder::ball(0.05)).body;
    for (i, (name, joint)) in [
        ("rope", JointBuilder::rope(0.6)),
        ("rod", JointBuilder::distance(0.5)),
        ("spring", JointBuilder::spring(0.4, 200.0, 5.0)),
    ]
    .into_iter()
    .enumerate()
    {
        let weight = scene.insert(at(far + Vec3::new(0.5, 0.0, 2.0 * i as f32)), ball()).body;
        let anchor = Vec3::Z * 2.0 * i as f32;
        joints.push((name, scene.insert_joint(post, weight, joint.local_anchor1(anchor)).unwrap()));
    }
    (scene, joints)
}

/// Oracle: the mirror, joint by joint.
#[test]
fn both_sides_read_alike() {
    let (scene, joints) = all_kinds();
    for solver in SOLVERS {
        let mut worlds = SIDES.map(|side| side.world(&scene, &Params { joints: solver, ..Params::default() }));
        for world in &mut worlds {
            assert!(world.joints().unwrap().all.is_empty(), "none before the first step");
            steps(world, 20);
        }
        let [cpu, gpu] = worlds.each_mut().map(|world| world.joints().unwrap());
        assert_eq!((cpu.step, gpu.step, cpu.all.len()), (20, 20, joints.len()));
        for &(name, joint) in &joints {
            let (a, b) = (&cpu[joint], &gpu[joint]);
            assert_eq!((a.joint, a.bodies, a.broken), (b.joint, b.bodies, b.broken), "{name}");
            assert_eq!(a.bodies, scene.joined(joint).unwrap(), "{name}");
            let off = a.coordinates.iter().zip(b.coordinates).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let weight = MASS * G;
            let (force, torque) = ((a.force - b.force).length() / weight, (a.torque - b.torque).length() / weight);
            let apart = (a.separation - b.separation).abs().max((a.angle - b.angle).abs());
            println!("{name}, {solver:?}: {off:e}, {force:e}, {torque:e} of {a:?}");
            assert!(off < 1e-4 && apart < 1e-4 && force < 1e-2 && torque < 1e-2, "{name}, {solver:?}: {a:?} and {b:?}");
            assert!(a.force.length() > 0.1, "{name}: it bears something, {a:?}");
        }
    }
}

/// Oracle: statics. What hangs still pulls with its weight; a fixed joint bears the moment of its arm as well; a motor and a
/// limit bear it about their own axis.
#[test]
fn at_rest_joints_bear_the_weight() {
    let arm = Vec3::X * 0.5;
    let limited = JointBuilder::revolute(Vec3::Z).limits(JointAxis::AngX, [0.0, 1.0]);
    let held = JointBuilder::revolute(Vec3::Z).motor_position(JointAxis::AngX, 0.0, 1e4, 100.0);
    let held = held.motor_model(JointAxis::AngX, MotorModel::ForceBased);
    for (side, joints) in each() {
        let mut scene = Scene::new();
        let all = [
            hang(&mut scene, Vec3::ZERO, Vec3::Y * -0.5, JointBuilder::spherical()),
            hang(&mut scene, Vec3::Z * 1.0, arm, JointBuilder::fixed()),
            hang(&mut scene, Vec3::Z * 2.0, arm, limited.clone()),
            hang(&mut scene, Vec3::Z * 3.0, arm, held.clone()),
        ];
        let mut world = side.world(&scene, &Params { joints, ..Params::default() });
        steps(&mut world, 120);
        let read = world.joints().unwrap();
        // By Gauss-Seidel the arm is still at its limit by turns: 0.7 % off.
        let most = if joints == JointSolver::Direct { 1e-4 } else { 1e-2 } * MASS * G;
        // A stiff motor of a body on an arm, whose own inertia is a sixtieth of what it moves, is not stable by
        // Gauss-Seidel: its torque comes too late.
        let count = if joints == JointSolver::Direct { 4 } else { 3 };
        for (i, (_, joint)) in all.into_iter().enumerate().take(count) {
            let (force, torque) = (read[joint].force, read[joint].torque);
            // 10,000 N m a radian: the arm is down by a thousandth.
            let moment = if i == 0 { Vec3::ZERO } else { Vec3::Z * 0.5 * MASS * G };
            println!("{side:?}, {joints:?}, {i}: {force} N, {torque} N m");
            assert!((force - Vec3::Y * MASS * G).length() < most, "{side:?}, {joints:?}, {i}: {force} N");
            assert!((torque - moment).length() < most, "{side:?}, {joints:?}, {i}: {torque} N m");
        }
    }
}

/// Oracle: analysis. A ball that hangs is pulled down until its joint breaks; that is told once, and it falls freely from
/// there. With each solver, and with sub-steps of each island's own.
#[test]
fn a_joint_breaks_once_and_lets_go() {
    let on_demand = Accuracy::Tolerance { penetration: 1e-3, joint: 1e-3, most: 32 };
    for (side, joints) in each() {
        // New worlds have the most sub-steps, which are the shortest; by Gauss-Seidel no joint bears its weight so soon.
        let soon = if joints == JointSolver::Direct { 4 } else { 70 };
        for (accuracy, wait) in [(Accuracy::default(), 70), (on_demand, 70), (on_demand, soon)] {
            let what = format!("{side:?}, {joints:?}, {accuracy}, {wait} steps");
            let mut scene = Scene::new();
            hang(&mut scene, Vec3::X * 5.0, Vec3::Y * -0.5, JointBuilder::spherical());
            let arm = Vec3::Y * -0.5;
            let breakable = JointBuilder::spherical().breakable(2.0 * MASS * G, f32::INFINITY);
            let (weight, joint) = hang(&mut scene, Vec3::ZERO, arm, breakable.clone());
            let mut world = side.world(&scene, &Params { joints, accuracy, ..Params::default() });
            let told = |world: &mut World| {
                let report = report(world);
                (report.broken_joints, report.newly_broken)
            };
            for pull in [0.0, 0.9] {
                for _ in 0..wait {
                    world.edit().add_force(weight, Vec3::Y * -pull * MASS * G).unwrap();
                    world.step().unwrap();
                }
                assert_eq!(told(&mut world), (0, vec![]), "{what}: it bears {} times the weight", 1.0 + pull);
            }
            world.edit().add_force(weight, Vec3::Y * -1.1 * MASS * G).unwrap();
            world.step().unwrap();
            assert_eq!(told(&mut world), (1, vec![joint]), "{what}");
            let read = world.joints().unwrap();
            assert!(read[joint].broken, "{what}");
            assert!((read[joint].force.length() / (MASS * G) - 2.1).abs() < 0.01, "{what}: {:?}", read[joint]);
            let (from, speed) = (place(&mut world, weight), world.velocities().unwrap()[weight].linear);
            assert!((from - arm).length() < 1e-3, "{what}: {from}");
            for n in 1..=30 {
                world.step().unwrap();
                assert_eq!(told(&mut world), (1, vec![]), "{what}: told once");
                let t = n as f32 / 60.0;
                let free = from + speed * t - Vec3::Y * (0.5 * G * t * t);
                let off = (place(&mut world, weight) - free).length();
                // Measured: 4e-6 m.
                assert!(off < 2e-5, "{what}, step {n}: {off} m");
            }
            let read = world.joints().unwrap();
            assert_eq!((read[joint].force, read[joint].torque, read[joint].separation), (Vec3::ZERO, Vec3::ZERO, 0.0));
            world.edit().set_joint(joint, JointBuilder::fixed()).unwrap();
            world.step().unwrap();
            assert_eq!(told(&mut world), (1, vec![]), "{what}: described anew, it stays broken");
            // Another joint in its slot is whole.
            let post = world.scene().joined(joint).unwrap()[0];
            world.edit().remove_joint(joint).unwrap();
            let next = world.edit().insert_joint(post, weight, JointBuilder::rope(50.0)).unwrap();
            world.step().unwrap();
            assert_eq!(told(&mut world), (0, vec![]), "{what}: it is gone");
            let read = world.joints().unwrap();
            assert!(!read[next].broken && read.get(joint).is_err() && read.all.len() == 2, "{what}");
        }
    }
}

fn place(world: &mut World, body: BodyHandle) -> Vec3 {
    world.poses().unwrap()[body].translation
}

/// Oracle: analysis. Of twenty that break at once by the moment they bear, eight are named, of those that share a place the
/// highest; those that bear less hold. What is broken stays so while all sleep.
#[test]
fn all_that_break_are_counted_and_some_are_named() {
    for (side, joints) in each() {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        // 0.5 m times the weight.
        let moment = 0.5 * MASS * G;
        let mut broken = Vec::new();
        for i in 0..25 {
            let breaks = i % 5 != 3;
            // By Gauss-Seidel the moment rises beyond what it is at rest.
            let most = if breaks { 0.8 } else { 4.0 } * moment;
            let joint = JointBuilder::fixed().breakable(f32::INFINITY, most);
            let (_, joint) = hang(&mut scene, Vec3::new(0.0, 0.2, i as f32), Vec3::X * 0.5, joint);
            broken.extend(breaks.then_some(joint));
        }
        let highest = |k: &usize| broken.iter().rfind(|joint| joint.slot() % 8 == *k).copied();
        let mut named: Vec<_> = (0..8).filter_map(|k| highest(&k)).collect();
        named.sort_by_key(|joint| joint.slot());
        let sleep = Some(Sleep { distance: 2e-3, time: 0.5 });
        let mut world = side.world(&scene, &Params { joints, sleep, ..Params::default() });
        // By Gauss-Seidel what they bear takes some steps to rise.
        let first = (0..20).find_map(|_| {
            world.step().unwrap();
            let report = report(&mut world);
            (report.broken_joints > 0).then_some(report)
        });
        let first = first.unwrap();
        assert_eq!((first.broken_joints, first.newly_broken.clone()), (20, named), "{side:?}, {joints:?}");
        assert!(first.to_string().contains("20 joints broken (new: "), "{first}");
        let read = world.joints().unwrap();
        let all: Vec<_> = read.all.iter().filter(|joint| joint.broken).map(|joint| joint.joint).collect();
        assert_eq!(all, broken, "{side:?}, {joints:?}");
        world.step().unwrap();
        assert!(report(&mut world).newly_broken.is_empty(), "{side:?}, {joints:?}");
        let mut count = 0;
        while report(&mut world).asleep < 25 && count < 900 {
            steps(&mut world, 20);
            count += 20;
        }
        steps(&mut world, 8);
        let last = report(&mut world);
        assert_eq!((last.asleep, last.broken_joints), (25, 20), "{side:?}, {joints:?}: {last}");
        assert!(last.newly_broken.is_empty() && world.joints().unwrap()[broken[0]].broken, "{side:?}, {joints:?}");
    }
}

/// Oracle: analysis. The ends of a slack rope pass through each other as if there were none; taut, it holds.
#[test]
fn a_rope_does_not_hold_at_no_distance() {
    for (side, joints) in each() {
        let mut scene = Scene::new();
        scene.gravity = Vec3::ZERO;
        let x = [-0.5, 0.5].map(|x| scene.insert(at(Vec3::X * x).linvel(Vec3::X * -2.0 * x), ball()).body);
        let rope = scene.insert_joint(x[0], x[1], JointBuilder::rope(1.0).contacts_enabled(false)).unwrap();
        let mut world = side.world(&scene, &Params { joints, ..Params::default() });
        for n in 1..=50 {
            world.step().unwrap();
            let way = n as f32 / 60.0;
            let reading = world.joints().unwrap()[rope];
            let distance = (1.0 - 2.0 * way).abs();
            assert!((reading.coordinates[0] - distance).abs() < 1e-5, "{side:?}, {joints:?}, step {n}: {reading:?}");
            assert_eq!(reading.force, Vec3::ZERO, "{side:?}, {joints:?}, step {n}");
            assert!((place(&mut world, x[0]).x - (way - 0.5)).abs() < 1e-5, "{side:?}, {joints:?}, step {n}");
        }
        steps(&mut world, 30);
        let reading = world.joints().unwrap()[rope];
        assert!(reading.coordinates[0] < 1.001, "{side:?}, {joints:?}: {reading:?}");
    }
}

/// Fifteen links of 1 kg, and a weight of `ratio` kg at the end, held out sideways; and a pendulum that needs little.
fn chain(ratio: f32) -> Scene {
    const LINKS: usize = 15;
    let mut scene = Scene::new();
    let mut above = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.05)).body;
    let mut reach = 0.0;
    for i in 0..=LINKS {
        let is_weight = i == LINKS;
        let half = if is_weight { 0.5 } else { 0.2 };
        let middle = 0.4 * i as f32 + half;
        let (thick, mass) = if is_weight { (0.5, ratio) } else { (0.05, 1.0) };
        let shape = ColliderBuilder::cuboid(half, thick, thick).density(mass / (8.0 * half * thick * thick));
        let link = scene.insert(at(Vec3::X * middle), shape).body;
        let joint = JointBuilder::spherical().local_anchor1(Vec3::X * reach).local_anchor2(Vec3::X * -half);
        scene.insert_joint(above, link, joint.contacts_enabled(false)).unwrap();
        (above, reach) = (link, half);
    }
    hang(&mut scene, Vec3::Z * 30.0, Vec3::Y * -0.5, JointBuilder::spherical());
    scene
}

/// What a run of the chain spent and left.
#[derive(Debug)]
struct Run {
    /// Of what every step with all sub-steps for all would have.
    visits: f64,
    /// Of joints, at the end of any step, m.
    widest: f32,
    /// Steps that were told to have left more than the tolerance.
    steps_over: u32,
}

fn run_chain(side: Side, scene: &Scene, joints: JointSolver, tolerance: f32) -> Run {
    const MOST: u32 = 32;
    const STEPS: u32 = 180;
    let accuracy = Accuracy::Tolerance { penetration: 1e-3, joint: tolerance, most: MOST };
    let mut world = side.world(scene, &Params { accuracy, joints, ..Params::default() });
    let (mut visits, mut widest, mut before, mut steps_over) = (0u64, 0.0f32, 0.0f32, 0);
    for step in 1..=STEPS {
        world.step().unwrap();
        let spent: Spent = report(&mut world).accuracy.unwrap();
        visits += u64::from(spent.visits);
        steps_over += u32::from(spent.joint_residual_m > tolerance);
        // What is told is what is seen, to the rounding of positions some metres from the origin.
        let off = (spent.joint_residual_m - before).abs();
        assert!(off < 2e-6, "{side:?}, {joints:?}, step {step}: {spent:?}, and {before} m by poses");
        before = world.joints().unwrap().all.iter().map(|joint| joint.separation).fold(0.0, f32::max);
        widest = widest.max(before);
    }
    let most = u64::from(STEPS * MOST) * scene.joint_count() as u64;
    Run { visits: visits as f64 / most as f64, widest, steps_over }
}

/// Oracle: the tolerance as told, by poses. A chain with a hundred times a link's mass at its end that falls from the side
/// keeps within a tenth of a millimetre with few visits when solved directly; by Gauss-Seidel it takes what there is, tells
/// that it is not enough, and spends less where less is asked for.
#[test]
fn a_chain_gets_the_sub_steps_that_its_tolerance_asks_for() {
    let scene = chain(100.0);
    for side in SIDES {
        let direct = run_chain(side, &scene, JointSolver::Direct, 1e-4);
        println!("{side:?}, directly: {direct:?}");
        assert!(direct.widest < 1e-4 && direct.steps_over == 0 && direct.visits < 0.5, "{side:?}: {direct:?}");
        let [fine, coarse] = [1e-4, 3e-2].map(|most| run_chain(side, &scene, JointSolver::GaussSeidel, most));
        println!("{side:?}, by Gauss-Seidel: {fine:?}, {coarse:?}");
        assert!(fine.steps_over > 0 && fine.visits > 0.8, "{side:?}: {fine:?}");
        assert!(coarse.steps_over == 0 && coarse.widest < 3e-2 && coarse.visits < 0.5, "{side:?}: {coarse:?}");
    }
}

/// Oracle: counting. A chain of 20 joints is solved directly, or as told; a sheet of more than 1,024 blocks falls back.
#[test]
fn the_report_tells_how_joints_were_solved() {
    let (chain, sheet) = (tumble_core::scenes::chain(20, 1.0), tumble_core::scenes::joint_grid(24));
    let all = sheet.joint_count() as u32;
    assert!(all > 1024, "{all}");
    for side in SIDES {
        for (scene, joints, expected, text) in [
            (&chain, JointSolver::Auto, (20, 1, 0, 0), "joints: 20 directly in 1 islands, 0 by Gauss-Seidel"),
            (&chain, JointSolver::GaussSeidel, (0, 0, 20, 0), "joints: 0 directly in 0 islands, 20 by Gauss-Seidel"),
            (&sheet, JointSolver::Direct, (0, 0, all, 1), "(1 islands too large)"),
        ] {
            let mut world = side.world(scene, &Params { joints, ..Params::default() });
            steps(&mut world, 1);
            let report = report(&mut world);
            let told = report.joints;
            assert_eq!(
                (told.direct, told.islands, told.gauss_seidel, told.too_large),
                expected,
                "{side:?}, {joints:?}"
            );
            assert!(report.to_string().contains(text), "{report}");
        }
    }
}
