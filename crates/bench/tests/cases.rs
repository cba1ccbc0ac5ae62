//! The errors of the cases. Oracle: analysis, the exact end of each case with a formula, and known departures from it.

use glam::{DVec3, Vec3};
use std::collections::HashSet;
use tumble_bench::cases::{self, Case, Run};
use tumble_core::{Pose, Poses, Scene, Velocities, Velocity, measures};

fn case(name: &str) -> &'static Case {
    cases::ALL.iter().find(|case| case.name == name).unwrap_or_else(|| panic!("no case {name}"))
}

/// The scene with its first dynamic body at `place` with velocity `linear`, all others as they were.
fn moved(scene: &Scene, place: Vec3, linear: Vec3) -> (Poses, Velocities) {
    let (poses, velocities) = (measures::initial_poses(scene), measures::initial_velocities(scene));
    let first = cases::dynamic(scene).next().expect("a dynamic body");
    let pose = |b| if b == first { Pose { translation: place, ..poses[b] } } else { poses[b] };
    let velocity = |b| if b == first { Velocity { linear, ..velocities[b] } } else { velocities[b] };
    (
        Poses::collect(0, scene.bodies().map(|b| (b, pose(b)))),
        Velocities::collect(0, scene.bodies().map(|b| (b, velocity(b)))),
    )
}

fn headline(name: &str, place: DVec3, linear: DVec3, track: &[Vec3]) -> f64 {
    let case = case(name);
    let scene = (case.scene)(1);
    let (poses, velocities) = moved(&scene, place.as_vec3(), linear.as_vec3());
    let run = Run { scene: &scene, poses: &poses, velocities: &velocities, track, seconds: case.seconds };
    (case.errors[0].of)(&run)
}

/// f32 holds a place to some 6e-8 of itself.
const ROUNDING: f64 = 3e-7;

#[test]
fn formulas_have_no_error_at_their_exact_end_and_the_known_one_beside_it() {
    let v = DVec3::new(8.0, 12.0, -3.0);
    let exact = v - DVec3::Y * 0.5 * 9.81;
    assert!(headline("projectile", exact, DVec3::ZERO, &[]) < ROUNDING);
    assert!((headline("projectile", exact * 1.01, DVec3::ZERO, &[]) - 0.01).abs() < ROUNDING);

    let way = 36.0 / (2.0 * 0.4 * 9.81);
    let (sin, cos) = 35f64.to_radians().sin_cos();
    let end = DVec3::new(cos, 0.0, sin) * way;
    assert!(headline("sliding box", end, DVec3::ZERO, &[]) < ROUNDING);
    assert!((headline("sliding box", end * 0.9, DVec3::ZERO, &[]) - 0.1).abs() < ROUNDING);

    assert!(headline("slip to roll", DVec3::ZERO, DVec3::X * (25.0 / 7.0), &[]) < ROUNDING);
    assert!((headline("slip to roll", DVec3::ZERO, DVec3::X * 5.0, &[]) - 0.4).abs() < ROUNDING);
}

/// A ball that falls from 2 m and comes back with 0.8 of its speed, seen 60 times a second: the apex lies between two
/// sights, and the parabola through three of them finds it.
#[test]
fn the_bounce_is_measured_at_its_apex() {
    let bounce = |e: f64| {
        let (fall, speed) = ((4.0f64 / 9.81).sqrt(), (2.0f64 * 9.81 * 2.0).sqrt());
        let height = |t: f64| {
            let after = t - fall;
            if after < 0.0 { 2.0 - 4.905 * t * t } else { e * speed * after - 4.905 * after * after }
        };
        let track: Vec<_> = (1..=80).map(|i| Vec3::new(0.0, (0.5 + height(f64::from(i) / 60.0)) as f32, 0.0)).collect();
        headline("bounce", DVec3::ZERO, DVec3::ZERO, &track)
    };
    // Three heights of 1.8 m in f32 give the apex to about 1e-6.
    assert!(bounce(0.8) < 2e-6, "{}", bounce(0.8));
    assert!((bounce(0.72) - 0.19).abs() < 2e-6, "{}", bounce(0.72));
    assert_eq!(headline("bounce", DVec3::ZERO, DVec3::ZERO, &[Vec3::Y; 5]), 1.0, "one that never comes back");
}

/// What stands as it was built has no error in any of its measures, and neither has a heap before it falls.
#[test]
fn untouched_scenes_have_no_error() {
    for case in cases::ALL.iter().filter(|case| !case.vary_dt) {
        let scene = (case.scene)(1);
        let (poses, velocities) = (measures::initial_poses(&scene), measures::initial_velocities(&scene));
        let run = Run { scene: &scene, poses: &poses, velocities: &velocities, track: &[], seconds: 0.0 };
        for error in case.errors {
            let value = (error.of)(&run);
            // Heights of some 40 m are exact to 2e-6 in f32.
            assert!((0.0..4e-6).contains(&value), "{}, {}: {value:e}", case.name, error.name);
        }
    }
}

#[test]
fn conserved_quantities_tell_how_much_is_lost() {
    for (name, errors) in [("free box", [0.1, 0.19]), ("closed system", [0.1, f64::NAN])] {
        let case = case(name);
        let scene = (case.scene)(1);
        let (poses, before) = (measures::initial_poses(&scene), measures::initial_velocities(&scene));
        let slower = |b| Velocity { linear: before[b].linear * 0.9, angular: before[b].angular * 0.9 };
        let velocities = Velocities::collect(0, scene.bodies().map(|b| (b, slower(b))));
        let run = Run { scene: &scene, poses: &poses, velocities: &velocities, track: &[], seconds: 0.0 };
        let kept = Run { velocities: &before, ..run };
        let run = Run { velocities: &velocities, ..kept };
        for (error, expected) in case.errors.iter().zip(errors) {
            assert_eq!((error.of)(&kept), 0.0, "{name}, {}", error.name);
            let value = (error.of)(&run);
            assert!(expected.is_nan() || (value - expected).abs() < 1e-6, "{name}, {}: {value}", error.name);
        }
    }
}

#[test]
fn sinking_and_drifting_are_told_apart() {
    let case = case("column 10");
    let scene = (case.scene)(0);
    let (poses, velocities) = moved(&scene, Vec3::new(0.3, 0.4, 0.4), Vec3::ZERO);
    let run = Run { scene: &scene, poses: &poses, velocities: &velocities, track: &[], seconds: 0.0 };
    let of = |name: &str| (case.errors.iter().find(|error| error.name == name).expect("an error of it").of)(&run);
    assert!((of("sink") - 0.1).abs() < 1e-7 && (of("sideways drift") - 0.5).abs() < 1e-7);
    // The lowest box is 0.1 m in the floor; its neighbour above hangs free.
    assert!((of("deepest overlap") - 0.1).abs() < 1e-7);
}

#[test]
fn names_are_told_apart() {
    let names: HashSet<_> = cases::ALL.iter().map(|case| case.name).collect();
    assert_eq!(names.len(), cases::ALL.len());
    for case in cases::ALL {
        assert!(!case.errors.is_empty() && case.seconds > 0.0 && case.seeds > 0, "{}", case.name);
    }
}
