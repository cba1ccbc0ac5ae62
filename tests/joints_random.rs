//! Random trees and loops of bodies on joints of all kinds, with limits, friction, masses of 1 : 1000 and wild starts: the
//! state stays finite, joints hold, no energy comes from anywhere. Oracle: analysis for the energy; bounds of separation
//! are what was measured, see each.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/jointed.rs"]
mod jointed;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;

use jointed::{BESIDE, JOINT_SUBSTEPS, Watched, all_held, gauss_seidel, params, row, watch};
use random::Random;
use rayon::prelude::*;
use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};

use JointAxis::{AngX, AngY, AngZ, LinX, LinY, LinZ};

/// What a random scene is made of.
#[derive(Debug, Clone, Copy)]
struct Recipe {
    /// Joints beyond those of a tree.
    loops: u32,
    /// Decades between the lightest and the heaviest body.
    decades: f32,
    /// Whether bodies start with velocities that joints do not allow.
    kicked: bool,
}

thread_local!{static COUNT: std::cell::Cell<u32> = const { std::cell::Cell::new(3) };}
/// A kind of joint between bodies `a` and `b`, free to be as it is at the start: `frame` is the joint's in the world.
fn kind(random: &mut Random, a: &RigidBodyBuilder, b: &RigidBodyBuilder, in_loop: bool) -> JointBuilder {
    // A place between the two, and somewhat off.
    let at = 0.5 * (a.translation + b.translation) + random.vector(0.15);
    let frame = random.rotation();
    let locked: &[JointAxis] = match random.below(if in_loop { 3 } else { 8 }) {
        0..=2 => &[LinX, LinY, LinZ],
        3 => &[LinX, LinY, LinZ, AngY, AngZ],
        4 => &[LinY, LinZ, AngX, AngY, AngZ],
        5 => &[LinX, LinY, LinZ, AngZ],
        6 => &JointAxis::ALL,
        _ => &[LinX, LinY],
    };
    let mut joint = JointBuilder::generic(locked)
        .local_anchor1(a.rotation.inverse() * (at - a.translation))
        .local_anchor2(b.rotation.inverse() * (at - b.translation))
        .local_rotation1(a.rotation.inverse() * frame)
        .local_rotation2(b.rotation.inverse() * frame);
    for axis in JointAxis::ALL.into_iter().filter(|axis| !locked.contains(axis)) {
        // What slides has an end: else it falls out of the world.
        let which = if (axis as usize) < 3 { 0 } else { random.below(4) };
        match which {
            0 => joint = joint.limits(axis, [-random.range(0.1, 1.0), random.range(0.1, 1.0)]),
            1 => joint = joint.friction(axis, random.range(0.0, 0.5)),
            _ => {}
        }
    }
    if in_loop && random.below(3) == 0 {
        // Between the middles instead: a rod, or a rope that is nearly taut.
        let distance = a.translation.distance(b.translation);
        let slack = random.range(1.0, 1.2);
        joint =
            if random.below(2) == 0 { JointBuilder::distance(distance) } else { JointBuilder::rope(slack * distance) };
    }
    joint.contacts_enabled(false)
}

/// 2 to 20 boxes and balls, each on a joint with one before it, the first with what stands still.
fn scene(seed: u64, recipe: Recipe) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let out_of_the_way = ColliderBuilder::ball(0.01).translation(Vec3::Y * 30.0);
    let mut bodies = vec![scene.insert(RigidBodyBuilder::fixed(), out_of_the_way).body];
    let mut places = vec![Vec3::ZERO];
    let count = COUNT.get();
    let insert = |scene: &mut Scene, a: BodyHandle, b: BodyHandle, joint: JointBuilder| {
        scene.insert_joint(a, b, joint).expect("a joint of two of the scene's bodies");
    };
    for _ in 0..count {
        let parent = random.below(bodies.len() as u32) as usize;
        // A free place of the lattice beside the parent's.
        let step = |random: &mut Random| {
            [Vec3::X, Vec3::Y, Vec3::Z][random.below(3) as usize] * if random.below(2) == 0 { 1.0 } else { -1.0 }
        };
        let mut place = places[parent] + step(&mut random);
        while places.contains(&place) {
            place += step(&mut random);
        }
        places.push(place);
        let mut body = RigidBodyBuilder::dynamic().translation(0.8 * place).rotation(random.rotation());
        if recipe.kicked {
            body = body.linvel(random.vector(3.0)).angvel(random.vector(5.0));
        }
        let mass = 10.0f32.powf(random.range(-0.5, 0.5) * recipe.decades);
        let mut size = || random.range(0.08, 0.2);
        let collider = if count % 2 == 0 {
            ColliderBuilder::cuboid(size(), size(), size())
        } else {
            ColliderBuilder::ball(size())
        };
        let body = scene.insert(body, collider.mass(mass)).body;
        let ends = [bodies[parent], body].map(|b| scene.body(b).expect("living").clone());
        insert(&mut scene, bodies[parent], body, kind(&mut random, &ends[0], &ends[1], false));
        bodies.push(body);
    }
    for _ in 0..recipe.loops {
        let a = random.below(count) as usize;
        let b = a + 1 + random.below(count - a as u32) as usize;
        let ends = [bodies[a], bodies[b]].map(|b| scene.body(b).expect("living").clone());
        insert(&mut scene, bodies[a], bodies[b], kind(&mut random, &ends[0], &ends[1], true));
    }
    scene
}

/// Scenes of each recipe.
const SCENES: u64 = 60;

#[test]
fn random_joints_stay_finite_and_gain_no_energy() {
    let mut missed = Vec::new();
    for (loops, decades, kicked) in
        [(0, 0.0, false), (0, 3.0, false), (0, 3.0, true), (3, 0.0, false), (3, 3.0, false), (3, 3.0, true)]
    {
        let recipe = Recipe { loops, decades, kicked };
        let ratio = 10.0f32.powf(decades);
        let start = if kicked { "kicked" } else { "let go" };
        let shape = if loops == 0 { "trees" } else { "loops" };
        let case = Case::new("C12", &format!("{SCENES} random {shape}, masses 1 : {ratio:>4}, {start}, 3 s"));
        for &by in BESIDE {
            let ways: &[(&str, Params)] = if by == By::Rapier {
                &[("", params(JOINT_SUBSTEPS))]
            } else {
                &[("", params(JOINT_SUBSTEPS)), (", Gauss-Seidel", gauss_seidel(JOINT_SUBSTEPS))]
            };
            for (how, params) in ways {
                let one = |seed: u64| (seed, watch(&scene(seed, recipe), by, *params, 180));
                let all: Vec<(u64, Watched)> = (0..SCENES).into_par_iter().map(one).collect();
                let over = |most: f64, of: fn(&Watched) -> f64| {
                    all.iter().filter(|(_, seen)| !(of(seen) <= most)).count() as f64
                };
                for (quantity, value, ask) in [
                    ("not finite", over(1e30, |seen| seen.apart), Ask::AtMost(0.0)),
                    ("apart by more than 5 mm", over(5.0, |seen| seen.apart), Ask::Said),
                    ("apart by more than 500 mm", over(500.0, |seen| seen.apart), Ask::Said),
                    ("gained more than 1 mm of height", over(1.0, |seen| seen.gained), Ask::Said),
                    ("gained more than 100 mm of height", over(100.0, |seen| seen.gained), Ask::Said),
                ] {
                    missed.push(row(&case, by, JOINT_SUBSTEPS, &format!("{quantity}{how}"), "scenes", value, ask));
                }
                let mut worst = all.clone();
                worst.sort_by(|a, b| b.1.gained.total_cmp(&a.1.gained));
                println!(
                    "WORST {:?}",
                    worst[..3].iter().map(|w| (w.0, w.1.apart, w.1.gained, w.1.angle)).collect::<Vec<_>>()
                );
            }
        }
    }
    all_held(missed);
}

#[test]
fn small() {
    for count in 1..5 {
        COUNT.set(count);
        let recipe = Recipe { loops: 0, decades: 0.0, kicked: false };
        let all: Vec<(u64, Watched)> = (0..400u64).map(|seed| (seed, watch(&scene(seed, recipe), By::Cpu, params(4), 180))).collect();
        let mut bad: Vec<_> = all.iter().filter(|w| !(w.1.gained < 10.0)).collect();
        println!("SMALL {count}: {} of 400", bad.len());
        bad.sort_by(|a, b| b.1.gained.total_cmp(&a.1.gained));
        for (seed, w) in bad.into_iter().take(8) {
            let scene = scene(*seed, recipe);
            println!("SMALL   seed {seed} gained {:.1} apart {:.3}", w.gained, w.apart);
            for j in scene.joints() { let b = scene.joint(j).unwrap(); 
                let text: String = (0..6).map(|i| if b.locked[i] { "L".into() } else if let Some(l) = b.limits[i] { format!("[{:.2},{:.2}]", l[0], l[1]) } else if b.friction[i] > 0.0 { format!("f{:.2}", b.friction[i]) } else { "-".into() }).collect::<Vec<_>>().join(" ");
                println!("SMALL     {:?} {text}", scene.joined(j).unwrap().map(|b| b.slot())); }
        }
    }
}
