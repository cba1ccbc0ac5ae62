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

use jointed::{JOINT_SUBSTEPS, SIDES, gauss_seidel, params, watch};
use random::Random;
use rayon::prelude::*;
use tumble::prelude::*;
use tumble_bench::hard_cases::By;

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
        match random.below(4) {
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
    let count = 2 + random.below(19);
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

#[test]
fn explore() {
    for recipe in [
        Recipe { loops: 0, decades: 0.0, kicked: false },
        Recipe { loops: 0, decades: 3.0, kicked: false },
        Recipe { loops: 0, decades: 3.0, kicked: true },
        Recipe { loops: 3, decades: 0.0, kicked: false },
        Recipe { loops: 3, decades: 3.0, kicked: false },
        Recipe { loops: 3, decades: 3.0, kicked: true },
    ] {
        for (how, by, params) in [
            ("direct 4", By::Cpu, params(4)),
            ("direct 8", By::Cpu, params(8)),
            ("GS 4", By::Cpu, gauss_seidel(4)),
            ("rapier", By::Rapier, params(4)),
        ] {
            let mut all: Vec<_> = (0..100u64)
                .into_par_iter()
                .map(|seed| (seed, std::panic::catch_unwind(|| watch(&scene(seed, recipe), by, params, 300)).ok()))
                .collect();
            let bad = all.iter().filter(|w| w.1.is_none()).count();
            let over = |mm: f64| all.iter().filter(|w| w.1.is_some_and(|w| w.apart > mm)).count();
            let counts = [0.1, 1.0, 5.0, 50.0, 500.0].map(over);
            let gain = [0.1, 1.0, 10.0].map(|p| all.iter().filter(|w| w.1.is_some_and(|w| w.gained > p)).count());
            let angle = [0.01, 0.1].map(|p| all.iter().filter(|w| w.1.is_some_and(|w| w.angle > p)).count());
            println!(
                "{recipe:?} {how}: not finite {bad}; over 0.1, 1, 5, 50, 500 mm: {counts:?}; gained 0.1 1 10 %: {gain:?}; angle {angle:?}"
            );
            if by == By::Cpu {
                all.sort_by(|a, b| b.1.map_or(1e30, |w| w.apart).total_cmp(&a.1.map_or(1e30, |w| w.apart)));
                for (seed, w) in &all[..3] {
                    println!("   {seed} {:?}", w.map(|w| (w.apart, w.late, w.angle, w.gained, w.lost)));
                }
                all.sort_by(|a, b| b.1.map_or(1e30, |w| w.gained).total_cmp(&a.1.map_or(1e30, |w| w.gained)));
                for (seed, w) in &all[..2] {
                    println!("   gain {seed} {:?}", w.map(|w| (w.apart, w.late, w.angle, w.gained, w.lost)));
                }
            }
        }
    }
}
