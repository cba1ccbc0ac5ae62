//! Joints that lock the same thing twice: doors on two hinges, plates on two bolts. Oracle: analysis.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/jointed.rs"]
mod jointed;

use jointed::{JOINT_SUBSTEPS, all_held, gauss_seidel, params, row, watch};
use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};

/// A row of three plates out from a post, each on the one before by two joints of a kind, `apart` (m) from each other along
/// `along`; the last has `ratio` times the mass of the others.
fn plates(joint: &JointBuilder, sides: &[f32], along: Vec3, count: usize, ratio: f32) -> Scene {
    let mut scene = Scene::new();
    let mut before = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.01)).body;
    for i in 0..count {
        let body = RigidBodyBuilder::dynamic().translation(Vec3::X * (0.2 + 0.4 * i as f32));
        let mass = if i + 1 == count { ratio } else { 1.0 };
        let plate = scene.insert(body, ColliderBuilder::cuboid(0.2, 0.03, 0.2).mass(mass)).body;
        let arm = if i == 0 { Vec3::ZERO } else { Vec3::X * 0.2 };
        for &side in sides {
            let joint = joint.clone().local_anchor1(arm + along * side).local_anchor2(Vec3::X * -0.2 + along * side);
            scene.insert_joint(before, plate, joint.contacts_enabled(false)).unwrap();
        }
        before = plate;
    }
    scene
}

#[test]
fn joints_that_lock_the_same_twice_hold() {
    let mut held = Vec::new();
    for (name, joint) in [
        ("bolts", JointBuilder::fixed()),
        ("hinges", JointBuilder::revolute(Vec3::Z)),
        ("balls", JointBuilder::spherical()),
        ("sliders", JointBuilder::prismatic(Vec3::new(0.8, -0.6, 0.0)).limits(JointAxis::LinX, [-0.1, 0.1])),
    ] {
        for (count, ratio) in [(1, 1.0), (2, 1.0), (2, 100.0), (2, 0.01), (3, 1.0), (3, 100.0)] {
            let case = Case::new("C13", &format!("{count} plates on two {name} each, last {ratio}, 3 s"));
            for sides in [&[0.0][..], &[-0.15, 0.15], &[0.0, 0.0], &[-0.15, 0.0, 0.15]] {
                for along in [Vec3::Z, Vec3::Y * 0.1] {
                    if along.y != 0.0 && name == "hinges" {
                        continue;
                    }
                    let scene = plates(&joint, sides, along, count, ratio);
                    for by in [By::Cpu] {
                        for (how, params) in
                            [("", params(JOINT_SUBSTEPS)), (", Gauss-Seidel", gauss_seidel(JOINT_SUBSTEPS))]
                        {
                            let seen = watch(&scene, by, params, 180);
                            println!(
                                "QQ {name} {count} {ratio} {sides:?} {along}{how}: {:.3} {:.3} {:.3}",
                                seen.apart, seen.gained, seen.angle
                            );
                            for (quantity, unit, value) in [
                                ("apart", "mm", seen.apart),
                                ("gained", "mm", seen.gained),
                                ("angle", "rad", seen.angle),
                            ] {
                                held.push(row(
                                    &case,
                                    by,
                                    JOINT_SUBSTEPS,
                                    &format!("{quantity}{how}"),
                                    unit,
                                    value,
                                    Ask::Said,
                                ));
                            }
                        }
                    }
                }
            }
        }
    }
    all_held(held);
}
