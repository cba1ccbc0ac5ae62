//! Explore.
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/jointed.rs"]
mod jointed;
use jointed::*;
use tumble::prelude::*;
use tumble_bench::hard_cases::By;
use tumble_core::scenes;

#[test]
fn explore() {
    let which = std::env::var("CASE").unwrap_or_default();
    let cases: Vec<(&str, Scene, usize)> = vec![
        ("chain14x20", scenes::chain(14, 20.0), 600),
        ("chain15x10", scenes::chain(15, 10.0), 600),
        ("chain15x100", scenes::chain(15, 100.0), 600),
        ("chain15x1000", scenes::chain(15, 1000.0), 600),
        ("chain20x1000", scenes::chain(20, 1000.0), 600),
        ("cable20", scenes::cable(20, 1.0), 600),
        ("cable20x100", scenes::cable(20, 100.0), 600),
        ("bridge20", scenes::rope_bridge(20), 600),
        ("bridge40", scenes::rope_bridge(40), 600),
        ("closed1", scenes::closed_chain(1.0), 600),
        ("closed100", scenes::closed_chain(100.0), 600),
        ("net10", scenes::net(10, 1.0), 600),
        ("net10x100", scenes::net(10, 100.0), 600),
        ("grid12", scenes::joint_grid(12), 600),
        ("grid32", scenes::joint_grid(32), 600),
        ("falling20", scenes::falling_chain(20), 600),
        ("wrecking15", scenes::wrecking_ball(15, 200.0), 600),
        ("ragdoll", scenes::ragdoll(), 600),
        ("ragdolls20", scenes::ragdolls(20), 600),
        ("ragdolls100", scenes::ragdolls(100), 600),
        ("pendulum", scenes::pendulum(1.0, 1.5708).0, 1200),
        ("fourbars", scenes::four_bars(4), 600),
        ("car", scenes::car().0, 600),
        ("cardan", scenes::cardan(0.5, 5.0).scene, 600),
    ];
    for (name, scene, steps) in
        cases.into_iter().filter(|c| which.is_empty() || which.split(',').any(|w| c.0.starts_with(w)))
    {
        for by in [By::Cpu, By::Rapier] {
            let t = std::time::Instant::now();
            let w = std::panic::catch_unwind(|| watch(&scene, by, params(4), steps));
            println!("{name:14} {by:?} {w:?} {:?}", t.elapsed());
        }
    }
}

fn bars(n: u32, short: f32, thick: f32, speed: f32, damping: f32, start: bool, z: bool) {
    let mut scene = Scene::new();
    let fixed = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.01).translation(Vec3::Y * 10.0)).body;
    let [ground, a, b, c] = [1.0f32, 0.3, 0.9, 0.7];
    let (tip, foot) = (Vec3::Y * a, Vec3::X * ground);
    let way = foot - tip;
    let distance = way.length();
    let along = (b * b - c * c + distance * distance) / (2.0 * distance);
    let up = (b * b - along * along).sqrt();
    let unit = way / distance;
    let knee = tip + unit * along + Vec3::new(-unit.y, unit.x, 0.0) * up;
    let mut bar = |from: Vec3, to: Vec3, w: f32| {
        let way = to - from;
        let half = Vec3::new(0.5 * way.length() - short, thick, thick);
        let turn = Quat::from_rotation_arc(Vec3::X, way.normalize());
        let v = Vec3::Z.cross(0.5 * way) * w;
        scene
            .insert(
                RigidBodyBuilder::dynamic().translation(0.5 * (from + to)).rotation(turn).angvel(Vec3::Z * w).linvel(v),
                ColliderBuilder::cuboid(half.x, half.y, half.z).density(1000.0),
            )
            .body
    };
    let [crank, coupler, rocker] =
        [bar(Vec3::ZERO, tip, if start { speed } else { 0.0 }), bar(tip, knee, 0.0), bar(foot, knee, 0.0)];
    let mut joints = vec![];
    let mut join = |a, b, joint: JointBuilder, at: Vec3| {
        let local = |body| {
            let x = scene.body(body).unwrap();
            x.rotation.inverse() * (at - x.translation)
        };
        let joint = joint.local_anchor1(local(a)).local_anchor2(local(b));
        let j = scene.insert_joint(a, b, joint).unwrap();
        joints.push(j);
    };
    let hinge = JointBuilder::revolute(Vec3::Z);
    let driven =
        if damping > 0.0 { hinge.clone().motor_velocity(JointAxis::AngX, speed, damping) } else { hinge.clone() };
    join(fixed, crank, driven, Vec3::ZERO);
    join(crank, coupler, if z { JointBuilder::spherical() } else { hinge.clone() }, tip);
    join(coupler, rocker, if z { JointBuilder::spherical() } else { hinge.clone() }, knee);
    join(fixed, rocker, hinge, foot);
    let mut world = World::new(scene.clone(), params(n), Backend::Cpu).unwrap();
    let mut worst: f64 = 0.0;
    let mut when = 0;
    for step in 1..=600 {
        world.step().unwrap();
        let e = tumble_core::measures::joint_error(&scene, &world.poses().unwrap());
        if e.max_m > worst {
            worst = e.max_m;
            when = step;
        }
    }
    println!(
        "n {n} short {short} thick {thick} speed {speed} damping {damping} start {start} balls {z}: worst {worst} at {when}"
    );
}

#[test]
fn trouble() {
    for n in [4, 8, 16] {
        for (short, thick) in [(0.03, 0.02), (0.1, 0.02), (0.14, 0.02)] {
            for (speed, damping, start, z) in [
                (5.0, 1e4, false, false),
                (5.0, 1e4, true, false),
                (5.0, 1e4, true, true),
                (5.0, 100.0, true, false),
                (1.0, 1e4, true, false),
                (1.0, 0.0, true, false),
            ] {
                bars(n, short, thick, speed, damping, start, z);
            }
        }
    }
    for (name, half) in [("deep", 0.08f32), ("touch", 0.099)] {
        for joint in [JointBuilder::spherical(), JointBuilder::fixed(), JointBuilder::revolute(Vec3::Z)] {
            let mut scene = Scene::new();
            let a = scene.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(0.1, 0.1, 0.1)).body;
            let b = scene
                .insert(
                    RigidBodyBuilder::dynamic().translation(Vec3::X * 2.0 * half),
                    ColliderBuilder::cuboid(0.1, 0.1, 0.1),
                )
                .body;
            let locked = joint.locked;
            scene.insert_joint(a, b, joint.local_anchor1(Vec3::X * half).local_anchor2(Vec3::X * -half)).unwrap();
            for n in [4, 8] {
                println!("{name} {locked:?} {n} {:?}", watch(&scene, By::Cpu, params(n), 120));
            }
        }
    }
}
