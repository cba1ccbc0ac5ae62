//! What a world refuses, and how: an error that names the field, limit or buffer, the value and what is allowed; never
//! a panic, and a world that was good stays good. Oracle: analysis, but where a test names another.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use std::process::Command;

use tumble::{Accuracy, Backend, World};
use tumble_core::glam::{Quat, Vec3};
use tumble_core::{
    Capacities, ColliderBuilder, Error, OnePass, Params, Pose, Result, RigidBodyBuilder, Scene, Soft, Solver, scenes,
};
use tumble_gpu::Gpu;
use worlds::{SIDES, hash, report, steps};

const NAN: f32 = f32::NAN;
const INF: f32 = f32::INFINITY;

/// The field that an error names, once its message was found to have all that it must.
#[track_caller]
fn field_of<T>(result: Result<T>) -> &'static str {
    let error = result.err().expect("an error");
    let message = error.to_string();
    let Error::Invalid { what, field, value, allowed } = error else { panic!("{message}") };
    for part in [what.as_str(), field, value.as_str(), allowed] {
        assert!(!part.is_empty() && message.contains(part), "{message} lacks {part}");
    }
    field
}

fn bad_params() -> Vec<(Params, &'static str)> {
    let good = Params::default();
    let room = good.capacities;
    let one = |law| Params { solver: Solver::OnePass(law), ..good };
    let soft = |law| Params { solver: Solver::Soft(law), ..good };
    let mut cases = vec![
        (Params { accuracy: Accuracy::Substeps(0), ..good }, "accuracy.substeps"),
        (Params { accuracy: Accuracy::Tolerance { penetration: 1e-3, joint: 1e-3, most: 7 }, ..good }, "accuracy.most"),
        (Params { threads: Some(0), ..good }, "threads"),
        (Params { capacities: Capacities { pairs: Some(0), ..room }, ..good }, "capacities.pairs"),
        (Params { capacities: Capacities { pairs: Some(1 << 26), ..room }, ..good }, "capacities.pairs"),
        (Params { capacities: Capacities { bodies: Some(0), ..room }, ..good }, "capacities.bodies"),
        (Params { capacities: Capacities { colliders: Some(0), ..room }, ..good }, "capacities.colliders"),
        (Params { capacities: Capacities { edits: Some(u32::MAX), ..room }, ..good }, "capacities.edits"),
        (Params { dt: 0.0, ..good }, "dt"),
        (one(OnePass { stiffness: 1.0, ..OnePass::default() }), "solver.stiffness"),
        (one(OnePass { leak: 0.0, ..OnePass::default() }), "solver.leak"),
        (soft(Soft { frequency: 0.0, ..Soft::default() }), "solver.frequency"),
        (soft(Soft { static_frequency: 0.0, ..Soft::default() }), "solver.static_frequency"),
        (soft(Soft { damping_ratio: 0.0, ..Soft::default() }), "solver.damping_ratio"),
    ];
    for bad in [-1.0, NAN, INF, -INF] {
        cases.extend([
            (Params { dt: bad, ..good }, "dt"),
            (one(OnePass { stiffness: bad, ..OnePass::default() }), "solver.stiffness"),
            (one(OnePass { leak: bad, ..OnePass::default() }), "solver.leak"),
            (soft(Soft { frequency: bad, ..Soft::default() }), "solver.frequency"),
            (soft(Soft { static_frequency: bad, ..Soft::default() }), "solver.static_frequency"),
            (soft(Soft { damping_ratio: bad, ..Soft::default() }), "solver.damping_ratio"),
            (Params { max_push_speed: bad, ..good }, "max_push_speed"),
            (Params { speculative_distance: bad, ..good }, "speculative_distance"),
            (Params { restitution_threshold: bad, ..good }, "restitution_threshold"),
        ]);
    }
    cases
}

/// At the start, and between steps, where the parameters in force stay.
#[test]
fn params() {
    for side in SIDES {
        let mut world = side.world(&scenes::pyramid(3), &Params::default());
        let mut undisturbed = side.world(&scenes::pyramid(3), &Params::default());
        steps(&mut world, 2);
        for (params, field) in bad_params() {
            assert_eq!(field_of(side.try_world(Scene::new(), params)), field);
            assert_eq!(field_of(world.set_params(params)), field);
            assert_eq!(*world.params(), Params::default());
        }
        steps(&mut world, 2);
        steps(&mut undisturbed, 4);
        assert_eq!(hash(&mut world), hash(&mut undisturbed), "{side:?}");
    }
}

/// Every kind of bad value in a scene is told of when the world is made, and when it comes in between steps.
#[test]
fn scenes_with_bad_values() {
    let dynamic = RigidBodyBuilder::dynamic;
    let ball = || ColliderBuilder::ball(1.0);
    let cases: [(RigidBodyBuilder, ColliderBuilder, &str); 14] = [
        (dynamic(), ColliderBuilder::ball(0.0), "ball.radius"),
        (dynamic(), ColliderBuilder::cuboid(1.0, -1.0, 1.0), "cuboid.half_extents"),
        (RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::ZERO), "halfspace.normal"),
        (dynamic(), ball().mass(0.0), "mass"),
        (dynamic(), ball().density(INF), "density"),
        (dynamic(), ColliderBuilder::halfspace(Vec3::Y), "mass"),
        (dynamic(), ball().friction(-0.1), "friction"),
        (dynamic(), ball().restitution(NAN), "restitution"),
        (dynamic().translation(Vec3::new(0.0, NAN, 0.0)), ball(), "translation"),
        (dynamic().rotation(Quat::from_array([0.0; 4])), ball(), "rotation"),
        (dynamic().linvel(Vec3::splat(INF)), ball(), "linvel"),
        (dynamic().angvel(Vec3::new(2e6, 0.0, 0.0)), ball(), "angvel"),
        (dynamic().gravity_scale(NAN), ball(), "gravity_scale"),
        (dynamic().linear_damping(-1.0), ball(), "linear_damping"),
    ];
    for (body, collider, field) in cases {
        let mut scene = scenes::column(2);
        scene.insert(body.clone(), collider.clone());
        for side in SIDES {
            assert_eq!(field_of(side.try_world(scene.clone(), Params::default())), field);
            let mut world = side.world(&scenes::column(2), &Params::default());
            assert_eq!(field_of(world.edit().insert(body.clone(), collider.clone())), field);
            world.step().unwrap();
            assert_eq!(report(&mut world).bodies, 3);
        }
        assert_eq!(field_of(World::new(scene, Params::default(), Backend::Cpu)), field);
    }
    for side in SIDES {
        let mut scene = scenes::column(2);
        scene.gravity = Vec3::new(0.0, -INF, 0.0);
        assert_eq!(field_of(side.try_world(scene, Params::default())), "gravity");
    }
}

/// Between steps: the edit is refused, the world goes on as if it had not been asked for.
#[test]
fn bad_edits() {
    for side in SIDES {
        let scene = scenes::pyramid(3);
        let body = scene.bodies().nth(2).unwrap();
        let [mut world, mut undisturbed] = [0, 1].map(|_| side.world(&scene, &Params::default()));
        let edit = world.edit();
        let nan = Vec3::new(0.0, NAN, 0.0);
        let tilt = Pose { translation: Vec3::ZERO, rotation: Quat::from_array([NAN; 4]) };
        for (refused, field) in [
            (edit.set_pose(body, nan.into()), "translation"),
            (edit.set_pose(body, tilt), "rotation"),
            (edit.set_velocity(body, Vec3::splat(2e6), Vec3::ZERO), "linear velocity"),
            (edit.set_velocity(body, Vec3::ZERO, nan), "angular velocity"),
            (edit.apply_impulse(body, nan), "impulse"),
            (edit.apply_torque_impulse(body, nan), "torque impulse"),
            (edit.apply_impulse_at_point(body, Vec3::X, nan), "impulse at a point"),
            (edit.add_force(body, nan), "force"),
            (edit.add_torque(body, nan), "torque"),
            (edit.add_force_at_point(body, nan, Vec3::X), "force at a point"),
            (edit.set_gravity(nan), "gravity"),
            (edit.attach(body, ColliderBuilder::ball(NAN)).map(drop), "ball.radius"),
        ] {
            assert_eq!(field_of(refused), field);
        }
        for world in [&mut world, &mut undisturbed] {
            steps(world, 3);
        }
        assert_eq!(hash(&mut world), hash(&mut undisturbed), "{side:?}");
    }
}

/// A device that checks everything and runs nothing, made with limits that are not the default ones.
fn limited(change: impl FnOnce(&mut wgpu::Limits)) -> Gpu {
    let mut required_limits = wgpu::Limits::default();
    change(&mut required_limits);
    let (device, queue) = wgpu::Device::noop(&wgpu::DeviceDescriptor { required_limits, ..Default::default() });
    Gpu::from_device(device, queue)
}

/// Oracle: wgpu, which would refuse a pass or a buffer beyond the limits.
#[test]
fn limits_that_are_too_small() {
    type Change = fn(&mut wgpu::Limits);
    let cases: [(&str, Change, u64); 13] = [
        ("max_buffer_size", |l| l.max_buffer_size = 10_000, 10_000),
        ("max_storage_buffer_binding_size", |l| l.max_storage_buffer_binding_size = 9_999, 9_999),
        ("max_storage_buffers_per_shader_stage", |l| l.max_storage_buffers_per_shader_stage = 7, 7),
        ("max_uniform_buffers_per_shader_stage", |l| l.max_uniform_buffers_per_shader_stage = 2, 2),
        ("max_uniform_buffer_binding_size", |l| l.max_uniform_buffer_binding_size = 256, 256),
        ("min_uniform_buffer_offset_alignment", |l| l.min_uniform_buffer_offset_alignment = 512, 512),
        ("max_bind_groups", |l| l.max_bind_groups = 0, 0),
        ("max_bindings_per_bind_group", |l| l.max_bindings_per_bind_group = 8, 8),
        ("max_compute_workgroup_storage_size", |l| l.max_compute_workgroup_storage_size = 8192, 8192),
        ("max_compute_invocations_per_workgroup", |l| l.max_compute_invocations_per_workgroup = 128, 128),
        ("max_compute_workgroup_size_x", |l| l.max_compute_workgroup_size_x = 64, 64),
        ("max_compute_workgroups_per_dimension", |l| l.max_compute_workgroups_per_dimension = 1000, 1000),
        ("max_storage_buffers_per_shader_stage", |l| *l = wgpu::Limits::downlevel_defaults(), 4),
    ];
    for (named, change, has) in cases {
        let error = tumble_gpu::World::with_gpu(limited(change), scenes::pile(600), Params::default()).err().unwrap();
        let message = error.to_string();
        let Error::Limits { adapter, limit, needed, available } = error else { panic!("{named}: {message}") };
        assert_eq!((limit, available), (named, has), "{message}");
        assert!(needed > available || named.starts_with("min"), "{message}");
        for part in [adapter, needed.to_string(), available.to_string(), named.into(), "make the scene smaller".into()]
        {
            assert!(message.contains(&part), "{message} lacks {part}");
        }
    }
    // The least that will do.
    let least = limited(|l| {
        *l = wgpu::Limits { max_buffer_size: 200_000, max_storage_buffer_binding_size: 200_000, ..l.clone() };
    });
    tumble_gpu::World::with_gpu(least, scenes::pyramid(3), Params::default()).unwrap();
}

/// More bodies than a binding holds: refused when they come, and those that were there stay.
#[test]
fn more_bodies_than_a_limit_holds() {
    let gpu = limited(|l| l.max_storage_buffer_binding_size = 500_000);
    let on_gpu = tumble_gpu::World::with_gpu(gpu, scenes::column(4), Params::default()).unwrap();
    let capacities = Capacities { max_array_bytes: 500_000, ..Capacities::default() };
    let on_cpu = tumble_cpu::World::new(scenes::column(4), Params { capacities, ..Params::default() }).unwrap();
    for mut world in [World::Gpu(Box::new(on_gpu)), World::Cpu(Box::new(on_cpu))] {
        world.step().unwrap();
        let before = world.poses().unwrap();
        for i in 0..6000 {
            let body = RigidBodyBuilder::dynamic().translation(Vec3::new(2.0 * i as f32, 50.0, 0.0));
            world.edit().insert(body, ColliderBuilder::ball(0.5)).unwrap();
        }
        for _ in 0..2 {
            let error = world.step().unwrap_err();
            let message = error.to_string();
            let Error::Capacity { needed, capacity, .. } = error else { panic!("{message}") };
            assert!(needed > capacity && message.contains("last good state"), "{message}");
        }
        assert_eq!(world.poses().unwrap(), before);
    }
}

/// A lost device is an error from every call; what was fetched before stays.
#[test]
fn a_lost_device() {
    let gpu = Gpu::noop();
    let mut world = tumble_gpu::World::with_gpu(gpu.clone(), scenes::column(3), Params::default()).unwrap();
    world.step().unwrap();
    assert_eq!(world.try_poses().unwrap(), None, "asked for, and not waited for");
    world.sync().unwrap();
    let fetched = world.try_poses().unwrap().expect("poses that have arrived by now");
    assert_eq!(fetched.iter().count(), 4);
    gpu.device.destroy();
    let _ = gpu.device.poll(wgpu::PollType::Poll);
    for _ in 0..2 {
        let errors = [
            world.step().unwrap_err(),
            world.sync().unwrap_err(),
            world.poses().unwrap_err(),
            world.velocities().unwrap_err(),
        ];
        for error in errors {
            assert!(matches!(error, Error::DeviceLost { .. }), "{error}");
            assert!(error.to_string().contains("build a new World"), "{error}");
        }
        assert_eq!(world.try_poses().unwrap(), Some(fetched.clone()));
    }
    assert_eq!(world.scene().len(), 4);
    let refused = tumble_gpu::World::with_gpu(gpu, scenes::column(3), Params::default()).err().unwrap();
    assert!(matches!(refused, Error::DeviceLost { .. }), "{refused}");
}

/// Nothing, and things that nothing moves, on both sides.
#[test]
fn worlds_with_little_in_them() {
    for side in SIDES {
        let mut world = side.world(&Scene::new(), &Params::default());
        assert_eq!(world.poses().unwrap().iter().count(), 0);
        steps(&mut world, 4);
        let empty = report(&mut world);
        assert_eq!((empty.step, empty.bodies, empty.pairs, empty.contacts, empty.lost), (4, 0, 0, 0, 0), "{empty}");
        assert!(empty.growths.is_empty() && world.poses().unwrap().iter().count() == 0);
        assert_eq!(world.velocities().unwrap().step(), 4);
        // It takes bodies, and can be emptied again.
        let body = RigidBodyBuilder::dynamic().linvel(Vec3::X * 6.0);
        let body = world.edit().insert(body, ColliderBuilder::ball(0.5)).unwrap().body;
        steps(&mut world, 10);
        assert!((world.poses().unwrap()[body].translation.x - 1.0).abs() < 1e-5, "{side:?}");
        world.edit().remove(body).unwrap();
        steps(&mut world, 2);
        assert_eq!((report(&mut world).bodies, world.poses().unwrap().iter().count()), (0, 0));

        // Fixed bodies that overlap: no pairs, and no motion, not even of those that claim to have a velocity.
        let mut scene = Scene::new();
        let fixed = |x: f32| RigidBodyBuilder::fixed().translation(Vec3::X * x).linvel(Vec3::Y).angvel(Vec3::Z);
        scene.insert(fixed(0.0), ColliderBuilder::halfspace(Vec3::Y));
        scene.insert(fixed(0.1), ColliderBuilder::ball(1.0));
        scene.insert(fixed(0.2), ColliderBuilder::cuboid(1.0, 1.0, 1.0));
        let mut world = side.world(&scene, &Params::default());
        let start = world.poses().unwrap();
        steps(&mut world, 5);
        assert!(world.poses().unwrap().iter().eq(start.iter()), "{side:?}");
        assert_eq!(report(&mut world).pairs, 0);

        // Kinematic bodies go through each other and everything fixed, at the velocity that they have.
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        let bodies = [1.0, -1.0].map(|way| {
            let at = RigidBodyBuilder::kinematic_velocity_based().translation(Vec3::X * -way);
            scene.insert(at.linvel(Vec3::X * way).angvel(Vec3::Y * way), ColliderBuilder::cuboid(0.5, 0.5, 0.5)).body
        });
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 120);
        let (poses, velocities) = (world.poses().unwrap(), world.velocities().unwrap());
        for (body, way) in bodies.into_iter().zip([1.0, -1.0]) {
            // 480 sums of 4 mm: 1e-6 m were measured. 2 rad in as many turns.
            assert!((poses[body].translation - Vec3::X * way).length() < 1e-5, "{side:?}: {:?}", poses[body]);
            let turn = Quat::from_rotation_y(2.0 * way);
            assert!((poses[body].rotation.dot(turn).abs() - 1.0).abs() < 1e-5, "{side:?}: {:?}", poses[body]);
            assert_eq!((velocities[body].linear, velocities[body].angular), (Vec3::X * way, Vec3::Y * way));
        }
        assert_eq!((report(&mut world).pairs, report(&mut world).quarantined), (0, 0));
    }
}

/// What a child process found, which is this test program with another environment.
fn child(test: &str, environment: &[(&str, &str)]) -> String {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", test, "--nocapture", "--test-threads=1"]).env("TUMBLE_CHILD", test);
    for (name, value) in environment {
        command.env(name, value);
    }
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    text
}

fn is_child(test: &str) -> bool {
    std::env::var("TUMBLE_CHILD").is_ok_and(|name| name == test)
}

/// Where no driver is: `Auto` takes the CPU and says so, `Gpu` says what to install.
#[test]
fn no_adapter() {
    if is_child("no_adapter") {
        let world = |backend| World::new(scenes::column(2), Params::default(), backend);
        let mut auto = world(Backend::Auto).unwrap();
        steps(&mut auto, 2);
        println!("auto: {}", report(&mut auto));
        let error = world(Backend::Gpu).err().unwrap();
        assert!(matches!(error, Error::NoAdapter { .. }), "{error}");
        println!("gpu: {error}");
        return;
    }
    let nowhere = "/nonexistent/icd.json";
    let text = child("no_adapter", &[("VK_ICD_FILENAMES", nowhere), ("VK_DRIVER_FILES", nowhere)]);
    assert!(text.contains("auto: step 2 on cpu ("), "{text}");
    let told = text.lines().find(|line| line.starts_with("gpu: ")).expect("what the GPU side said");
    for part in ["no GPU adapter was found", "mesa-vulkan-drivers", "Backend::Cpu"] {
        assert!(told.contains(part), "{told}");
    }
}

/// Software is no hardware: `Auto` never takes it, `Gpu` does, and the report names what ran. An adapter that is asked
/// for by name and is not there is an error that says which there are.
#[test]
fn the_backend_is_named() {
    if is_child("the_backend_is_named") {
        let world = |backend| World::new(scenes::column(2), Params::default(), backend);
        if std::env::var("WGPU_ADAPTER_NAME").is_ok() {
            println!("\nasked: {}", world(Backend::Gpu).err().unwrap());
            return;
        }
        for (name, backend) in [("cpu", Backend::Cpu), ("gpu", Backend::Gpu), ("auto", Backend::Auto)] {
            let mut world = world(backend).unwrap();
            steps(&mut world, 1);
            println!("{name}: {}", report(&mut world));
        }
        return;
    }
    let text = child("the_backend_is_named", &[]);
    let info = &common::gpu().info;
    let software = info.device_type == wgpu::DeviceType::Cpu;
    assert!(text.contains("cpu: step 1 on cpu ("), "{text}");
    assert!(text.contains(&format!("gpu: step 1 on gpu ({}", info.name)), "{text}");
    assert!(text.contains(if software { "auto: step 1 on cpu (" } else { "auto: step 1 on gpu (" }), "{text}");

    let text = child("the_backend_is_named", &[("WGPU_ADAPTER_NAME", "no such adapter")]);
    let told = text.lines().find(|line| line.starts_with("asked: ")).expect("what was said");
    assert!(told.contains("WGPU_ADAPTER_NAME=no such adapter") && told.contains(&info.name), "{told}");
}

/// wgpu's default limits, which every adapter has, carry 100,000 boxes. Oracle: the limits themselves (the backend that
/// runs nothing checks them).
#[test]
fn default_limits_carry_a_hundred_thousand_boxes() {
    let mut world = tumble_gpu::World::with_gpu(Gpu::noop(), scenes::pile(100_000), Params::default()).unwrap();
    world.step().unwrap();
}
