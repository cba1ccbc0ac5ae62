//! What changes between steps leave behind: slots that are used again, handles that are stale, passes that come late, and
//! the pose buffer, on both sides.

#[path = "common/analysis.rs"]
mod analysis;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use analysis::{PATH, ROTATION, WAY, assert_near, compound, turn};
use bytemuck::pod_collect_to_vec;
use tumble::World;
use tumble_core::glam::{DVec3, Quat, Vec3};
use tumble_core::layout::{PoseRecord, body_flags, pair_kind};
use tumble_core::{ColliderBuilder, Error, Params, Pose, RigidBodyBuilder, Scene};
use tumble_gpu::readback::read_now;
use worlds::{SIDES, hash, report, steps};

/// A box rests on the floor; in one step it goes and a heavier one comes to the same place in the same slots. Nothing
/// of the old contact is left: it is as in a world that begins with the new box. Oracle: that world.
#[test]
fn a_slot_reused_in_one_step() {
    let heavy = || {
        (
            RigidBodyBuilder::dynamic().translation(Vec3::Y * 0.49),
            ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(9000.0),
        )
    };
    for side in SIDES {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        let mut fresh = scene.clone();
        let at = RigidBodyBuilder::dynamic().translation(Vec3::Y * 0.5).linvel(Vec3::X);
        let light = scene.insert(at, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).body;
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 30);
        assert_eq!(report(&mut world).contacts, 4);
        world.edit().remove(light).unwrap();
        let (body, collider) = heavy();
        let new = world.edit().insert(body, collider).unwrap();
        assert_eq!((new.body.slot(), new.body.generation(), new.collider.slot()), (1, 1, 1));
        let (body, collider) = heavy();
        fresh.insert(body, collider);
        let mut fresh = side.world(&fresh, &Params::default());
        for step in 0..30 {
            world.step().unwrap();
            fresh.step().unwrap();
            assert_eq!(hash(&mut world), hash(&mut fresh), "{side:?}, {step} steps later");
        }
    }
}

/// The same in a heap: one body goes and another comes far away. Where it was, the others close in; where it is, it
/// falls freely. Oracle: analysis.
#[test]
fn a_removed_body_is_gone() {
    for side in SIDES {
        let mut scene = Scene::new();
        scene.gravity = Vec3::new(0.0, -10.0, 0.0);
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        let boxes = [0.5, 1.5, 2.5].map(|y| {
            let body = RigidBodyBuilder::dynamic().translation(Vec3::Y * y);
            scene.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).body
        });
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 60);
        assert_eq!(report(&mut world).contacts, 12);
        world.edit().remove(boxes[1]).unwrap();
        let away = RigidBodyBuilder::dynamic().translation(Vec3::new(50.0, 20.0, 0.0));
        let new = world.edit().insert(away, ColliderBuilder::ball(1.0)).unwrap().body;
        assert_eq!(new.slot(), boxes[1].slot());
        steps(&mut world, 24);
        let poses = world.poses().unwrap();
        // 0.4 s: 0.8 m. Soft contacts had let the column sink a little: by 1.9 mm, measured.
        assert!((poses[boxes[2]].translation.y - 1.7).abs() < 1e-2, "{side:?}: {:?}", poses[boxes[2]]);
        assert_near("falls", poses[new].translation.as_dvec3(), DVec3::new(50.0, 19.2, 0.0), PATH);
        assert_eq!(poses.get(boxes[1]), Err(Error::StaleBody(boxes[1])));
        let report = report(&mut world);
        assert_eq!((report.contacts, report.bodies), (4, 4), "{side:?}: {report}");
        steps(&mut world, 60);
        assert!((world.poses().unwrap()[boxes[2]].translation.y - 1.5).abs() < 1e-2, "{side:?}: it landed");
    }
}

/// A handle of a body that is gone is refused by every edit and every result, also when its slot is another's.
#[test]
fn stale_handles() {
    for side in SIDES {
        let (scene, body) = compound(Vec3::ZERO, Vec3::ZERO);
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 1);
        let kept = world.poses().unwrap();
        world.edit().remove(body).unwrap();
        let new = world.edit().insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5)).unwrap().body;
        assert_eq!(new.slot(), body.slot());
        steps(&mut world, 2);
        let stale = Err(Error::StaleBody(body));
        let edit = world.edit();
        assert_eq!(edit.remove(body), stale);
        assert_eq!(edit.attach(body, ColliderBuilder::ball(1.0)).map(drop), stale);
        assert_eq!(edit.set_pose(body, Vec3::ZERO.into()), stale);
        assert_eq!(edit.set_velocity(body, Vec3::ZERO, Vec3::ZERO), stale);
        assert_eq!(edit.apply_impulse(body, Vec3::X), stale);
        assert_eq!(edit.apply_torque_impulse(body, Vec3::X), stale);
        assert_eq!(edit.apply_impulse_at_point(body, Vec3::X, Vec3::X), stale);
        assert_eq!(edit.add_force(body, Vec3::X), stale);
        assert_eq!(edit.add_torque(body, Vec3::X), stale);
        assert_eq!(edit.add_force_at_point(body, Vec3::X, Vec3::X), stale);
        let message = stale.clone().unwrap_err().to_string();
        assert!(message.contains("body 0 (generation 0)") && message.contains("removed"), "{message}");
        assert_eq!(world.scene().body(body).map(drop), stale);
        assert_eq!(world.poses().unwrap().get(body).map(drop), stale);
        assert_eq!(world.velocities().unwrap().get(body).map(drop), stale);
        assert!(world.poses().unwrap().get(new).is_ok());
        assert!(kept.get(body).is_ok() && kept.get(new).is_err(), "results are of their step");
        // Nothing of it was noted: without gravity the new body stays where it is.
        let before = hash(&mut world);
        steps(&mut world, 1);
        assert_eq!(hash(&mut world), before, "{side:?}");
    }
}

/// Shapes and bounces that the scene did not have: the passes for them are made when they come, and the bits are those
/// of a world that had them from the start, far away. Oracle: that world.
#[test]
fn the_plan_widens() {
    for side in SIDES {
        let [mut narrow, mut wide] = [false, true].map(|wide| {
            let mut scene = Scene::new();
            scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
            for i in 0..24 {
                let place = Vec3::new((i % 3) as f32 * 1.02, 0.6 + (i / 9) as f32 * 1.1, (i / 3 % 3) as f32 * 1.01);
                let body = RigidBodyBuilder::dynamic().translation(place);
                scene.insert(body, ColliderBuilder::ball(0.5).density(1000.0));
            }
            for i in 0..2 {
                let far = RigidBodyBuilder::fixed().translation(Vec3::new(500.0, 9.0, 50.0 * i as f32));
                let cuboid = ColliderBuilder::cuboid(0.5, 0.5, 0.5).restitution(0.8);
                scene.insert(far, if wide { cuboid } else { ColliderBuilder::ball(0.5) });
            }
            side.world(&scene, &Params::default())
        });
        let kinds = |world: &mut World| (1..pair_kind::COUNT).filter(|&kind| world.edit().plan().has(kind)).count();
        assert_eq!((kinds(&mut narrow), narrow.edit().plan().restitution), (2, false));
        assert_eq!((kinds(&mut wide), wide.edit().plan().restitution), (5, true));
        for step in 0..60 {
            for world in [&mut wide, &mut narrow] {
                if step == 12 || step == 14 {
                    let place = RigidBodyBuilder::dynamic().translation(Vec3::new(0.8, 4.0, 0.7));
                    let body = place.linvel(Vec3::NEG_Y * 4.0).angvel(Vec3::new(1.0, 2.0, 0.0));
                    let collider = ColliderBuilder::cuboid(0.4, 0.5, 0.3).density(1000.0);
                    let restitution = if step == 12 { 0.0 } else { 0.8 };
                    world.edit().insert(body, collider.restitution(restitution)).unwrap();
                }
                world.step().unwrap();
            }
            if step % 4 == 3 {
                assert_eq!(hash(&mut wide), hash(&mut narrow), "{side:?}, step {step}");
            }
        }
        assert_eq!(narrow.edit().plan(), wide.edit().plan());
        assert!(report(&mut narrow).contacts > 20, "{}", report(&mut narrow));
    }
}

/// What a renderer binds: the own frame of each body by its handle's slot; another buffer, and another number, once the
/// world has grown. Oracle: analysis, and the poses that the world hands out.
#[test]
fn the_pose_buffer() {
    let (mut scene, body) = compound(Vec3::new(0.5, 1.0, 0.0), Vec3::new(2.0, 1.0, -3.0));
    let gone = scene.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5)).body;
    let kinematic = RigidBodyBuilder::kinematic_velocity_based().translation(Vec3::X * 9.0).linvel(Vec3::Z * 3.0);
    let slab = ColliderBuilder::cuboid(1.0, 0.1, 1.0).translation(Vec3::Y * 5.0);
    let kinematic = scene.insert(kinematic, slab).body;
    let mut world = tumble_gpu::World::with_gpu(common::gpu().clone(), scene.clone(), Params::default()).unwrap();
    let records = |world: &tumble_gpu::World| {
        let (buffer, generation) = world.pose_buffer().unwrap();
        assert!(buffer.usage().contains(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::VERTEX));
        let bytes = read_now(world.gpu(), buffer, 0, buffer.size()).unwrap();
        (pod_collect_to_vec::<u8, PoseRecord>(&bytes), generation)
    };
    let own = |record: &PoseRecord| Pose {
        translation: Vec3::from_array(record.translation),
        rotation: Quat::from_array(record.rotation),
    };
    // Before any step.
    let (first, generation) = records(&world);
    assert_eq!(first.len(), 3);
    let start = scene.body(body).unwrap();
    assert_near("own frame", own(&first[body.slot()]).translation.as_dvec3(), start.translation.as_dvec3(), PATH);
    assert!(turn(own(&first[body.slot()]).rotation, start.rotation) < ROTATION);

    // The centre of mass flies straight; the own frame is about it where the spin has brought it.
    let mass = scene.mass_properties(body).unwrap();
    let center = |pose: Pose| pose.translation + pose.rotation * mass.center_of_mass;
    let from = center(own(&first[body.slot()]));
    world.edit().remove(gone).unwrap();
    for _ in 0..30 {
        world.step().unwrap();
    }
    let poses = world.poses().unwrap();
    let (now, same) = records(&world);
    assert_eq!(same, generation);
    for handle in [body, kinematic] {
        assert_eq!(own(&now[handle.slot()]), poses[handle], "to the bit");
    }
    let at = center(own(&now[body.slot()]));
    assert_near("straight", (at - from).as_dvec3(), DVec3::new(0.25, 0.5, 0.0), WAY);
    assert!(turn(own(&now[body.slot()]).rotation, start.rotation) > 0.5);
    let pushed = own(&now[kinematic.slot()]).translation.as_dvec3();
    assert_near("kinematic", pushed, DVec3::new(9.0, 0.0, 1.5), PATH);
    let tags = [body_flags::DYNAMIC, 0, body_flags::KINEMATIC];
    assert_eq!(now.iter().map(|record| record.tag & 0xff).collect::<Vec<_>>(), tags);

    // The slot's next holder has the next generation; with it and more, the world grows.
    let new = world.edit().insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.5)).unwrap().body;
    world.step().unwrap();
    world.sync().unwrap();
    let (now, same) = records(&world);
    assert_eq!((now[new.slot()].tag, same), (body_flags::FIXED | 1 << 8, generation));
    for i in 0..5 {
        let place = RigidBodyBuilder::fixed().translation(Vec3::X * (20 + i) as f32);
        world.edit().insert(place, ColliderBuilder::ball(0.5)).unwrap();
    }
    world.step().unwrap();
    let (grown, other) = records(&world);
    assert!(other != generation && grown.len() > now.len());
    assert_eq!(world.sync().unwrap().growths_of("bodies"), 1);
    let (poses, last) = (world.poses().unwrap(), world.scene().bodies().last().unwrap());
    assert_eq!(own(&grown[last.slot()]), poses[last]);
    assert_eq!(own(&grown[last.slot()]).translation, Vec3::X * 24.0);
    assert_eq!(own(&grown[body.slot()]), poses[body]);
}
