//! The cases: one table of scenes, each with the errors that it is judged by (against formulas,
//! conserved quantities, overlap). A case more is a line more in [`ALL`].

use glam::{DVec3, Vec3};
use tumble_core::{BodyHandle, Poses, RigidBodyType, Scene, Velocities, measures, scenes};

/// A scene, how long it runs, and what it is judged by.
#[derive(Clone, Copy)]
pub struct Case {
    /// Short, lower case.
    pub name: &'static str,
    /// What it shows and what is exact, one line.
    pub about: &'static str,
    /// The scene of a seed.
    pub scene: fn(seed: u64) -> Scene,
    /// How many seeds: more than one where the course is chaotic.
    pub seeds: u64,
    /// Simulated time, s.
    pub seconds: f64,
    /// Whether dt is varied too, and not only the number of sub-steps: where a formula tells the exact value.
    pub vary_dt: bool,
    /// Whether the path of the first dynamic body is recorded, step by step.
    pub track: bool,
    /// What it is judged by; the first is the headline.
    pub errors: &'static [Error],
    /// Whether what should stand has fallen, so that only the headline still means something.
    pub fell: fn(&Run) -> bool,
}

/// A number that is zero in a perfect simulation.
#[derive(Clone, Copy)]
pub struct Error {
    /// As in the table.
    pub name: &'static str,
    /// Its unit; `1` for a ratio.
    pub unit: &'static str,
    /// Measures it.
    pub of: fn(&Run) -> f64,
}

/// What a run left.
pub struct Run<'a> {
    /// The scene as it was given.
    pub scene: &'a Scene,
    /// Poses at the end.
    pub poses: &'a Poses,
    /// Velocities at the end.
    pub velocities: &'a Velocities,
    /// Places of the first dynamic body after each step, m, where the case asks for them.
    pub track: &'a [Vec3],
    /// Simulated time, s.
    pub seconds: f64,
}

impl Run<'_> {
    fn dynamic(&self) -> impl Iterator<Item = BodyHandle> {
        dynamic(self.scene)
    }

    /// The first dynamic body's place and velocity at the end.
    fn first(&self) -> (DVec3, DVec3) {
        let body = self.dynamic().next();
        body.map_or((DVec3::NAN, DVec3::NAN), |b| {
            (self.poses[b].translation.as_dvec3(), self.velocities[b].linear.as_dvec3())
        })
    }

    /// How far each dynamic body came from where the scene put it, m.
    fn moves(&self) -> impl Iterator<Item = DVec3> {
        self.dynamic().map(|b| {
            let from = self.scene.body(b).map(|body| body.translation).unwrap_or_default();
            self.poses[b].translation.as_dvec3() - from.as_dvec3()
        })
    }

    fn mass(&self) -> f64 {
        self.dynamic().filter_map(|b| self.scene.mass_properties(b).ok()).map(|m| f64::from(m.mass)).sum()
    }
}

/// The dynamic bodies of a scene, in its order.
pub fn dynamic(scene: &Scene) -> impl Iterator<Item = BodyHandle> {
    scene.bodies().filter(|&b| scene.body(b).is_ok_and(|body| body.body_type == RigidBodyType::Dynamic))
}

const G: f64 = 9.81;

/// Deepest overlap of any pair.
const DEEPEST: Error =
    Error { name: "deepest overlap", unit: "m", of: |run| measures::penetration(run.scene, run.poses).max_m };
/// Mean over the pairs that overlap.
const MEAN: Error =
    Error { name: "mean overlap", unit: "m", of: |run| measures::penetration(run.scene, run.poses).mean_m };
/// How far the body sank that sank most, from where the scene stacked it exactly touching.
const SINK: Error = Error { name: "sink", unit: "m", of: |run| run.moves().map(|way| -way.y).fold(0.0, f64::max) };
/// How far the body came that went most to the side.
const DRIFT: Error = Error {
    name: "sideways drift",
    unit: "m",
    of: |run| run.moves().map(|way| way.x.hypot(way.z)).fold(0.0, f64::max),
};
/// What should be at rest is not.
const RESIDUAL: Error = Error {
    name: "residual energy",
    unit: "J/kg",
    of: |run| measures::kinetic_energy(run.scene, run.poses, run.velocities) / run.mass(),
};
const STANDING: &[Error] = &[SINK, DRIFT, DEEPEST, RESIDUAL];
const HEAP: &[Error] = &[MEAN, DEEPEST, RESIDUAL];

/// Farthest that any joint is from where it belongs, at the end.
const SEPARATION: Error =
    Error { name: "joint separation", unit: "m", of: |run| measures::joint_error(run.scene, run.poses).max_m };
/// Its mean over the joints.
const MEAN_SEPARATION: Error =
    Error { name: "mean separation", unit: "m", of: |run| measures::joint_error(run.scene, run.poses).mean_m };
const JOINED: &[Error] = &[SEPARATION, MEAN_SEPARATION];

/// What a closed system must keep, of its beginning.
fn angular_momentum_lost(run: &Run) -> f64 {
    let (poses, velocities) = (measures::initial_poses(run.scene), measures::initial_velocities(run.scene));
    let before = measures::angular_momentum(run.scene, &poses, &velocities);
    (measures::angular_momentum(run.scene, run.poses, run.velocities) - before).length() / before.length()
}

fn linear_momentum_lost(run: &Run) -> f64 {
    let velocities = measures::initial_velocities(run.scene);
    let change =
        measures::linear_momentum(run.scene, run.velocities) - measures::linear_momentum(run.scene, &velocities);
    let sum: f64 = run
        .dynamic()
        .filter_map(|b| {
            Some(f64::from(run.scene.mass_properties(b).ok()?.mass) * f64::from(velocities[b].linear.length()))
        })
        .sum();
    change.length() / sum
}

fn energy_changed(run: &Run) -> f64 {
    let (poses, velocities) = (measures::initial_poses(run.scene), measures::initial_velocities(run.scene));
    let before = measures::kinetic_energy(run.scene, &poses, &velocities);
    (measures::kinetic_energy(run.scene, run.poses, run.velocities) / before - 1.0).abs()
}

/// The height to which the ball of the bounce comes back, against e² h. The apex lies between steps: a parabola through
/// the three highest places after the first bounce finds it.
fn bounce(run: &Run) -> f64 {
    const EXACT: f64 = 0.8 * 0.8 * BOUNCE_FROM as f64;
    let heights: Vec<f64> = run.track.iter().map(|place| f64::from(place.y) - 0.5).collect();
    let Some(bounce) = heights.windows(2).position(|pair| pair[1] > pair[0]) else { return 1.0 };
    let rising = &heights[bounce..];
    let Some(top) =
        (1..rising.len().saturating_sub(1)).find(|&i| rising[i] >= rising[i - 1] && rising[i] >= rising[i + 1])
    else {
        return f64::NAN;
    };
    let (a, b, c) = (rising[top - 1], rising[top], rising[top + 1]);
    let bend = a - 2.0 * b + c;
    let apex = if bend < 0.0 { b - (a - c).powi(2) / (8.0 * bend) } else { b };
    (apex / EXACT - 1.0).abs()
}

const BOUNCE_FROM: f32 = 2.0;
const THROW: Vec3 = Vec3::new(8.0, 12.0, -3.0);
/// 35 degrees off an axis, so that a friction pyramid shows.
const SLIDE: Vec3 = Vec3::new(4.914_912, 0.0, 3.441_459);
const SLIDE_MU: f32 = 0.4;
const ROLL_SPEED: f32 = 5.0;

/// What all cases have in common, unless they say otherwise.
const CASE: Case = Case {
    name: "",
    about: "",
    scene: |_| Scene::new(),
    seeds: 1,
    seconds: 5.0,
    vary_dt: false,
    track: false,
    errors: STANDING,
    // Half a box.
    fell: |run| (SINK.of)(run) > 0.5,
};

/// All cases, from those with a formula to the largest heap.
pub const ALL: &[Case] = &[
    Case {
        name: "projectile",
        about: "a ball thrown for 1 s; exact: x = v t + g t^2 / 2",
        scene: |_| scenes::free_fall(THROW).0,
        seconds: 1.0,
        vary_dt: true,
        errors: &[Error {
            name: "off its path",
            unit: "1",
            of: |run| {
                let exact = THROW.as_dvec3() * run.seconds - DVec3::Y * (0.5 * G * run.seconds * run.seconds);
                (run.first().0 - exact).length() / exact.length()
            },
        }],
        fell: |_| false,
        ..CASE
    },
    Case {
        name: "sliding box",
        about: "a box at 6 m/s, mu 0.4; exact: it stops after v^2 / (2 mu g)",
        scene: |_| scenes::sliding_box(SLIDE_MU, SLIDE).0,
        seconds: 2.5,
        vary_dt: true,
        errors: &[Error {
            name: "stopping distance",
            unit: "1",
            of: |run| {
                let exact = f64::from(SLIDE.length_squared()) / (2.0 * f64::from(SLIDE_MU) * G);
                let end = run.first().0;
                (end.x.hypot(end.z) / exact - 1.0).abs()
            },
        }],
        fell: |_| false,
        ..CASE
    },
    Case {
        name: "slip to roll",
        about: "a ball set sliding, mu 0.3; exact: it ends rolling with 5/7 of its speed",
        scene: |_| scenes::slip_to_roll(0.3, ROLL_SPEED).0,
        seconds: 2.0,
        vary_dt: true,
        errors: &[Error {
            name: "rolling speed",
            unit: "1",
            of: |run| (run.first().1.length() / (f64::from(ROLL_SPEED) * 5.0 / 7.0) - 1.0).abs(),
        }],
        fell: |_| false,
        ..CASE
    },
    Case {
        name: "bounce",
        about: "a ball dropped from 2 m, restitution 0.8; exact: it comes back to 1.28 m",
        scene: |_| scenes::bouncing_ball(0.8, BOUNCE_FROM).0,
        seconds: 1.4,
        vary_dt: true,
        track: true,
        errors: &[Error { name: "height of return", unit: "1", of: bounce }],
        fell: |_| false,
        ..CASE
    },
    Case {
        name: "free box",
        about: "a box of 1 x 2 x 3 m turning freely for 10 s; exact: angular momentum and energy stay",
        scene: |_| scenes::free_box().0,
        seconds: 10.0,
        vary_dt: true,
        errors: &[
            Error { name: "angular momentum lost", unit: "1", of: angular_momentum_lost },
            Error { name: "energy changed", unit: "1", of: energy_changed },
        ],
        fell: |_| false,
        ..CASE
    },
    Case {
        name: "closed system",
        about: "120 mixed bodies colliding without gravity for 3 s; exact: momentum stays",
        scene: |_| scenes::closed_system(120),
        seconds: 3.0,
        vary_dt: true,
        errors: &[
            Error { name: "angular momentum lost", unit: "1", of: angular_momentum_lost },
            Error { name: "linear momentum lost", unit: "1", of: linear_momentum_lost },
        ],
        fell: |_| false,
        ..CASE
    },
    Case { name: "column 10", about: "10 boxes stacked", scene: |_| scenes::column(10), ..CASE },
    Case { name: "column 20", about: "20 boxes stacked", scene: |_| scenes::column(20), ..CASE },
    Case { name: "column 40", about: "40 boxes stacked", scene: |_| scenes::column(40), ..CASE },
    Case { name: "ratio 100", about: "a box on one 100 times lighter", scene: |_| scenes::mass_ratio(100.0).0, ..CASE },
    Case {
        name: "ratio 1000",
        about: "a box on one 1,000 times lighter",
        scene: |_| scenes::mass_ratio(1000.0).0,
        ..CASE
    },
    Case {
        name: "large on small",
        about: "a cube of 20 m on two of 1 m: 8,000 times as heavy",
        scene: |_| scenes::large_on_small(),
        ..CASE
    },
    Case { name: "pyramid 20", about: "a wall of 210 boxes", scene: |_| scenes::pyramid(20), ..CASE },
    Case {
        name: "topped pyramid",
        about: "a wall of 55 boxes under a top 300 times as heavy",
        scene: |_| scenes::topped_pyramid(10, 300.0),
        ..CASE
    },
    Case { name: "wide pyramid", about: "1,240 boxes in 15 layers", scene: |_| scenes::wide_pyramid(15), ..CASE },
    Case { name: "pyramid 100", about: "a wall of 5,050 boxes", scene: |_| scenes::pyramid(100), seconds: 4.0, ..CASE },
    Case {
        name: "many pyramids",
        about: "196 walls of 55 boxes: 10,780",
        scene: |_| scenes::many_pyramids(196, 10),
        seconds: 2.0,
        ..CASE
    },
    Case {
        name: "chain 20",
        about: "14 links swing, the last 20 times as heavy",
        scene: |_| scenes::chain(14, 20.0),
        seconds: 2.0,
        errors: JOINED,
        fell: |run| (SEPARATION.of)(run) > 0.5,
        ..CASE
    },
    Case {
        name: "chain 100",
        about: "15 links swing, the last 100 times as heavy",
        scene: |_| scenes::chain(15, 100.0),
        seconds: 2.0,
        errors: JOINED,
        fell: |run| (SEPARATION.of)(run) > 0.5,
        ..CASE
    },
    Case {
        name: "chain 1000",
        about: "15 links swing, the last 1,000 times as heavy",
        scene: |_| scenes::chain(15, 1000.0),
        seconds: 2.0,
        errors: JOINED,
        fell: |run| (SEPARATION.of)(run) > 0.5,
        ..CASE
    },
    Case {
        name: "rope bridge",
        about: "20 planks between two fixed ends",
        scene: |_| scenes::rope_bridge(20),
        errors: JOINED,
        fell: |run| (SEPARATION.of)(run) > 0.5,
        ..CASE
    },
    Case {
        name: "net",
        about: "10 x 10 balls, each joined to its neighbours, that hang by a corner",
        scene: |_| scenes::net(10, 1.0),
        seconds: 2.0,
        errors: JOINED,
        fell: |run| (SEPARATION.of)(run) > 1.0,
        ..CASE
    },
    Case {
        name: "ragdolls 100",
        about: "100 ragdolls dropped into a pit",
        scene: |seed| scenes::ragdolls_seeded(100, seed),
        seconds: 5.0,
        errors: &[SEPARATION, MEAN_SEPARATION, DEEPEST, MEAN, RESIDUAL],
        fell: |run| (SEPARATION.of)(run) > 1.0,
        ..CASE
    },
    Case {
        name: "joint grid",
        about: "100 x 100 balls, each joined to its neighbours: 10,000 bodies, 19,800 joints",
        scene: |_| scenes::joint_grid(100),
        seconds: 2.0,
        errors: JOINED,
        fell: |run| (SEPARATION.of)(run) > 1.0,
        ..CASE
    },
    Case {
        name: "pile 1000",
        about: "1,000 boxes dropped into a pit",
        scene: |seed| scenes::pile_seeded(1000, seed),
        seeds: 3,
        seconds: 8.0,
        errors: HEAP,
        fell: |_| false,
        ..CASE
    },
    Case {
        name: "balls 1000",
        about: "1,000 balls dropped into a pit",
        scene: |seed| scenes::balls_seeded(1000, seed),
        seeds: 3,
        seconds: 8.0,
        errors: HEAP,
        fell: |_| false,
        ..CASE
    },
    Case {
        name: "mixed 1000",
        about: "1,000 boxes, balls and compounds of many sizes dropped into a pit",
        scene: |seed| scenes::mixed_seeded(1000, seed),
        seeds: 3,
        seconds: 8.0,
        errors: HEAP,
        fell: |_| false,
        ..CASE
    },
];
