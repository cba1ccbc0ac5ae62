//! Contacts in bulk, on both sides. Oracles: analysis, parry and the other side; each test names its own.

mod common;
#[path = "common/floats.rs"]
mod floats;
#[expect(dead_code, reason = "no rays and no points")]
#[path = "common/parry.rs"]
mod parry;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use floats::Floats;
use parry::Oracle;
use parry3d::query::contact;
use random::Random;
use tumble::World;
use tumble_core::glam::Vec3;
use tumble_core::layout::{BATCHES, LAST_BATCH};
use tumble_core::{
    Accuracy, BodyHandle, Capacities, ColliderBuilder, Contact, Contacts, Error, Params, RigidBodyBuilder, Scene,
    Shape, scenes,
};
use worlds::{SIDES, Side, report, steps};

const G: f32 = 9.81;

fn mass(scene: &Scene, body: BodyHandle) -> f32 {
    scene.mass_properties(body).unwrap().mass
}

fn contacts(world: &mut World) -> Contacts {
    world.contacts().unwrap()
}

/// Contacts of this body, each with the force on it.
fn forces_on(contacts: &Contacts, body: BodyHandle) -> impl Iterator<Item = (&Contact, Vec3)> {
    contacts.all.iter().filter_map(move |contact| {
        let force = contact.impulse() / contacts.dt;
        (contact.body_b == body).then_some((contact, force)).or((contact.body_a == body).then_some((contact, -force)))
    })
}

/// Whatever is there agrees with the report, and with itself.
fn check_form(world: &mut World) -> Contacts {
    let (report, poses, contacts) = (report(world), world.poses().unwrap(), contacts(world));
    assert_eq!((contacts.step, poses.step()), (report.step, report.step));
    assert_eq!(contacts.all.len(), report.manifolds as usize);
    let points: usize = contacts.all.iter().map(|contact| contact.points().len()).sum();
    assert_eq!(points, report.contacts as usize);
    let last = contacts.all.iter().filter(|contact| contact.batch == LAST_BATCH).count();
    assert_eq!(last, report.last_batch as usize);
    let mut before = None;
    for contact in &contacts.all {
        let key = (contact.collider_a.slot(), contact.collider_b.slot());
        assert!(key.0 < key.1 && before < Some(key), "{before:?} {key:?}");
        before = Some(key);
        for (body, collider) in [(contact.body_a, contact.collider_a), (contact.body_b, contact.collider_b)] {
            assert!(world.scene().colliders_of(body).unwrap().iter().any(|(handle, _)| *handle == collider));
        }
        assert!((1..=4).contains(&contact.points().len()) && contact.batch < BATCHES);
        assert!((contact.normal.length() - 1.0).abs() < 1e-5, "{contact:?}");
        for point in contact.points() {
            // To a rounding in f32 of the tangents, friction is at right angles to the normal.
            let along = contact.normal.dot(point.friction_impulse).abs();
            assert!(point.normal_impulse >= 0.0 && along <= 1e-6 * point.friction_impulse.length(), "{point:?}");
        }
    }
    contacts
}

/// Each interface of a column at rest carries what is above it. Oracle: statics; off by 2.5e-5 of the weight at most (one
/// sub-step), else by 1.3e-6.
#[test]
fn a_column_weighs_what_it_weighs() {
    for side in SIDES {
        for substeps in [1, 4, 7] {
            let scene = scenes::column(4);
            let boxes: Vec<_> = scene.bodies().skip(1).collect();
            let mut world = side.world(&scene, &Params { accuracy: Accuracy::Substeps(substeps), ..Params::default() });
            steps(&mut world, 600);
            let contacts = check_form(&mut world);
            assert_eq!(contacts.all.len(), 4);
            let mut worst = 0f32;
            for (i, contact) in contacts.all.iter().enumerate() {
                // The floor has the lowest slot, and each box one less than the box on it.
                assert_eq!((contact.body_b, contact.points().len()), (boxes[i], 4));
                let weight: f32 = boxes[i..].iter().map(|body| mass(&scene, *body) * G).sum();
                let force: f32 = contact.points().iter().map(|p| p.normal_impulse / contacts.dt).sum();
                worst = worst.max((force / weight - 1.0).abs());
                // What is remembered leaves no overlap, but for 1.4e-6 m (six units in the last place of 3 m).
                assert!(contact.points().iter().all(|p| p.separation.abs() <= 3e-6 || substeps == 1), "{contact:?}");
            }
            eprintln!("{side:?}, {substeps} sub-steps: off by {worst:e} of the weight");
            assert!(worst <= 5e-5, "{side:?}, {substeps} sub-steps: {worst:e}");
        }
    }
}

/// A box that rests on a slope, a box that slides, and a ball that rolls down a slope: m g sin, mu m g, 2/7 m g sin.
/// Oracle: mechanics; boxes are off by 1e-7 of the weight, the ball by 1e-4, since it has turned within the step.
#[test]
fn friction_holds_what_it_must() {
    let angle = 0.3f32;
    let slope = Vec3::new(angle.cos(), -angle.sin(), 0.0);
    let (rest, rest_body) = scenes::ramp(0.6, angle);
    let (slide, slide_body) = scenes::sliding_box(0.3, Vec3::X * 9.0);
    let (mut roll, _) = scenes::ramp(0.6, angle);
    let above = Vec3::new(angle.sin(), angle.cos(), 0.0);
    let ball = RigidBodyBuilder::dynamic().translation(0.5 * above + 3.0 * Vec3::Z);
    let roll_body = roll.insert(ball, ColliderBuilder::ball(0.5).friction(0.6).density(1000.0)).body;
    let gravity = Vec3::NEG_Y * G;
    for side in SIDES {
        let cases = [
            ("rest", &rest, rest_body, gravity.dot(slope) * slope, 60),
            ("slide", &slide, slide_body, 0.3 * G * Vec3::X, 60),
            ("roll", &roll, roll_body, 2.0 / 7.0 * gravity.dot(slope) * slope, 15),
        ];
        for (name, scene, body, expected, count) in cases {
            // In later sub-steps the solver's arm on the ball has turned away from the slope, and it pushes less.
            let substeps = if name == "roll" { 1 } else { 4 };
            let mut world = side.world(scene, &Params { accuracy: Accuracy::Substeps(substeps), ..Params::default() });
            steps(&mut world, count);
            let contacts = check_form(&mut world);
            let weight = mass(scene, body) * G;
            let [(contact, _)] = forces_on(&contacts, body).collect::<Vec<_>>()[..] else { panic!("{contacts:?}") };
            assert_eq!(contact.body_b, body);
            let push: f32 = contact.points().iter().map(|p| p.normal_impulse).sum();
            let friction: Vec3 = contact.points().iter().map(|p| p.friction_impulse).sum();
            let normal_off = (push / contacts.dt - mass(scene, body) * -gravity.dot(contact.normal)).abs() / weight;
            let friction_off = (friction / contacts.dt + mass(scene, body) * expected).length() / weight;
            eprintln!("{side:?}, {name}: off by {normal_off:e} and {friction_off:e} of the weight");
            assert!(normal_off <= 1e-3 && friction_off <= 1e-3, "{side:?}, {name}: {contact:?}");
        }
    }
}

/// With one sub-step the impulses of all steps are the change of momentum, blows included: a ball that lands, one that
/// bounces, one that slides and rolls. Oracle: mechanics; the sums are off by 2e-7.
#[test]
fn pushes_add_up() {
    let cases = [scenes::bouncing_ball(0.0, 1.0), scenes::bouncing_ball(0.7, 1.0), scenes::slip_to_roll(0.6, 7.0)];
    for side in SIDES {
        for (scene, body) in &cases {
            let mut world = side.world(scene, &Params { accuracy: Accuracy::Substeps(1), ..Params::default() });
            let before = world.velocities().unwrap()[*body].linear;
            let mut sum = Vec3::ZERO;
            for _ in 0..100 {
                steps(&mut world, 1);
                let contacts = contacts(&mut world);
                sum += forces_on(&contacts, *body).map(|(_, force)| force * contacts.dt).sum::<Vec3>();
            }
            let change = world.velocities().unwrap()[*body].linear - before;
            let weight = mass(scene, *body) * G * 100.0 / 60.0;
            let off = (sum - mass(scene, *body) * change - weight * Vec3::Y).length() / weight;
            eprintln!("{side:?}: off by {off:e}");
            assert!(off <= 1e-5, "{side:?}: {sum}, {change}");
        }
    }
}

/// Under a ball that rolls fast the contact is where the ball is at the end of the step, and as deep. Oracle: geometry.
#[test]
fn a_rolling_ball_touches_below_its_middle() {
    for side in SIDES {
        let (mut scene, body) = scenes::slip_to_roll(0.6, 20.0);
        // And one whose middle turns about that of its body.
        let pair = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, 0.5, 4.0)).linvel(Vec3::X * 5.0);
        let pair = scene.insert(pair, ColliderBuilder::ball(0.5).density(1000.0));
        let arm = Vec3::new(1.0, 0.0, 0.0);
        scene.attach(pair.body, ColliderBuilder::ball(0.5).density(1000.0).translation(arm)).unwrap();
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 90);
        let (poses, contacts) = (world.poses().unwrap(), check_form(&mut world));
        for (of, offset) in [(body, Vec3::ZERO), (pair.body, Vec3::ZERO), (pair.body, arm)] {
            let middle = poses[of].translation + poses[of].rotation * offset;
            let near = |contact: &&Contact| {
                contact.body_b == of && {
                    let way = contact.points()[0].position - middle;
                    way.length() < 0.7
                }
            };
            let contact = contacts.all.iter().find(near).expect("a contact below");
            let point = contact.points()[0];
            let off = (point.position - Vec3::new(middle.x, 0.5 * (middle.y - 0.5), middle.z)).length();
            let deep = (point.separation - (middle.y - 0.5)).abs();
            eprintln!("{side:?}: {off:e} m aside, {deep:e} m");
            assert!(off <= 1e-5 && deep <= 1e-5, "{side:?}: {middle} {point:?}");
        }
    }
}

/// Balls among balls, boxes and half-spaces where one step of nearly no length leaves them: points, normals and gaps
/// of every pair. Oracle: parry; off by 1e-6 m, 2e-6 m and 6e-6.
#[test]
fn points_and_normals_are_where_parry_finds_them() {
    let mut random = Random::new(7);
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::new(0.2, 1.0, -0.1)));
    for i in 0..160 {
        let at = RigidBodyBuilder::dynamic().translation(random.vector(1.8)).rotation(random.rotation());
        let size = || 0.3 + 0.002 * i as f32;
        let collider =
            if i % 3 == 0 { ColliderBuilder::cuboid(size(), 0.4, 0.3) } else { ColliderBuilder::ball(size()) };
        let offset = if i % 2 == 0 { random.vector(0.3) } else { Vec3::ZERO };
        scene.insert(at, collider.translation(offset));
    }
    for side in SIDES {
        let mut world = side.world(&scene, &Params { dt: 1e-6, ..Params::default() });
        steps(&mut world, 1);
        let contacts = check_form(&mut world);
        let oracle = Oracle::new(&mut world);
        let (mut seen, mut worst) = (0, [0f32; 3]);
        for ours in &contacts.all {
            let (a, b) = (oracle.find(ours.collider_a), oracle.find(ours.collider_b));
            let is_ball = |shape: Shape| matches!(shape, Shape::Ball { .. });
            if !is_ball(a.own) && !is_ball(b.own) {
                // More points than parry's one; `oracle_parry` compares them.
                continue;
            }
            let theirs = contact(&a.pose, &*a.shape, &b.pose, &*b.shape, 0.1).unwrap().unwrap();
            let [point] = ours.points() else { panic!("{ours:?}") };
            // A ball whose middle is deep in a box may be as near to two faces.
            if theirs.dist < -0.25 {
                continue;
            }
            seen += 1;
            let off = [
                (point.separation - theirs.dist).abs(),
                (point.position - 0.5 * (theirs.point1 + theirs.point2)).length(),
                (ours.normal - theirs.normal1).length(),
            ];
            worst = std::array::from_fn(|i| worst[i].max(off[i]));
            assert!(off[0] <= 1e-5 && off[1] <= 1e-5 && off[2] <= 1e-4, "{side:?}: {off:?} {ours:?} {theirs:?}");
        }
        eprintln!("{side:?}: {seen} contacts; gap, place, normal off by {worst:?}");
        assert!(seen > 200);
    }
}

/// Where the two sides have not parted yet. Oracle: the other side. Measured: normals 9e-8, places 2e-6 and gaps 3e-6 apart,
/// impulses 2e-3 of the largest.
#[test]
fn both_sides_find_the_same() {
    let scenes = [
        ("pyramid", scenes::pyramid(12), 6),
        ("pile", scenes::pile(300), 17),
        ("balls", scenes::balls(300), 15),
        ("mixed", scenes::mixed(300), 18),
        ("hub", scenes::hub(200), 4),
    ];
    let mut floats = Floats::default();
    for (name, scene, count) in scenes {
        let (mut cpu, mut gpu) =
            (Side::Cpu.world(&scene, &Params::default()), Side::Gpu.world(&scene, &Params::default()));
        let mut pushes = 0;
        for step in 1..=count {
            steps(&mut cpu, 1);
            steps(&mut gpu, 1);
            let (cpu, gpu) = (check_form(&mut cpu), check_form(&mut gpu));
            let what = format!("{name}, step {step}");
            let integers = |contacts: &Contacts| -> Vec<_> {
                let of = |c: &Contact| (c.collider_a, c.collider_b, c.body_a, c.body_b, c.batch, c.points().len());
                contacts.all.iter().map(of).collect()
            };
            assert_eq!((cpu.step, cpu.dt), (gpu.step, gpu.dt));
            assert_eq!(integers(&cpu), integers(&gpu), "{what}");
            floats.check(&what, ("normal", 1e-6), (&cpu.all, &gpu.all), |c| c.normal.to_array());
            let points =
                |contacts: &Contacts| -> Vec<_> { contacts.all.iter().flat_map(Contact::points).copied().collect() };
            let (cpu, gpu) = (points(&cpu), points(&gpu));
            let both = (cpu.as_slice(), gpu.as_slice());
            floats.check(&what, ("position", 1e-5), both, |p| p.position.to_array());
            floats.check(&what, ("separation", 2e-5), both, |p| [p.separation]);
            // Of the largest push of the step: what holds a heap is shared among points in ways that hardly differ.
            let most = cpu.iter().fold(0.0, |most: f32, p| most.max(p.normal_impulse)).max(1e-3);
            floats.check(&what, ("impulse", 1e-2), both, |p| {
                let friction = p.friction_impulse / most;
                [p.normal_impulse / most, friction.x, friction.y, friction.z]
            });
            pushes += cpu.iter().filter(|p| p.normal_impulse > 0.0).count();
        }
        assert!(pushes > 100, "{name}: {pushes}");
    }
    eprint!("{floats}");
}

/// Nothing, before the first step, after removals and insertions, as steps go on. Oracle: what the report counts, and
/// who lives.
#[test]
fn worlds_that_change() {
    for side in SIDES {
        let mut world = side.world(&Scene::new(), &Params::default());
        assert_eq!(contacts(&mut world), Contacts::default());
        steps(&mut world, 2);
        assert_eq!((check_form(&mut world).all.len(), check_form(&mut world).step), (0, 2));

        let scene = scenes::column(3);
        let boxes: Vec<_> = scene.bodies().skip(1).collect();
        // Pairs have to grow, and the steps that found it to run again.
        let capacities = Capacities { pairs: Some(2), ..Capacities::default() };
        let mut world = side.world(&scene, &Params { capacities, ..Params::default() });
        assert_eq!(contacts(&mut world), Contacts::default());
        steps(&mut world, 5);
        assert_eq!(check_form(&mut world).all.len(), 3);

        // An edit is seen once a step has applied it.
        let before = contacts(&mut world);
        world.edit().remove(boxes[1]).unwrap();
        let at = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, 1.5, 0.0));
        let new = world.edit().insert(at, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(2000.0)).unwrap();
        assert_eq!(new.body.slot(), boxes[1].slot());
        world.set_params(Params { accuracy: Accuracy::Substeps(2), dt: 0.01, ..Params::default() }).unwrap();
        assert_eq!(contacts(&mut world), before);
        assert!(before.all.iter().any(|contact| contact.body_a == boxes[1]));
        steps(&mut world, 400);
        let after = check_form(&mut world);
        assert_eq!((after.all.len(), after.dt), (3, 0.01));
        let force: f32 = forces_on(&after, boxes[0]).map(|(_, force)| force.y.max(0.0)).sum();
        assert!((force / (4000.0 * G) - 1.0).abs() < 1e-3, "{side:?}: {force}");

        world.edit().remove(new.body).unwrap();
        steps(&mut world, 1);
        assert!(check_form(&mut world).all.iter().all(|c| c.body_a != new.body && c.body_b != new.body));
    }
}

/// A step that found no room is told of, as by a query. Oracle: the documentation.
#[test]
fn a_step_that_did_not_run() {
    for side in SIDES {
        let capacities = Capacities { pairs: Some(2), grow: false, ..Capacities::default() };
        let mut world = side.world(&scenes::column(5), &Params { capacities, ..Params::default() });
        let error = world.step().and_then(|()| world.contacts()).unwrap_err();
        assert!(matches!(error, Error::Capacity { buffer: "pairs", .. }), "{error}");
    }
}
