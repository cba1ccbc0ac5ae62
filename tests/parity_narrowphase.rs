//! Stage `narrowphase`, each pass alone: the GPU finds the manifolds that the CPU finds, in every order of invocations.
//! Oracle: the mirror, which makes the inputs too.
//!
//! Which axis separates two boxes best, and which corners are near enough, is decided by comparing floats: where two
//! are as good as each other, either side may take either. Such pairs, for which the CPU decides otherwise when the
//! bodies are moved by a few micrometres, are left out and counted. Tolerances are shares of the largest number of a
//! field in one manifold or point, or of 1; beside each is the largest error that was measured (llvmpipe).

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/floats.rs"]
mod floats;
#[expect(dead_code, reason = "a part of a frame is enough here")]
#[path = "common/frame.rs"]
mod frame;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;

use alone::Alone;
use bytemuck::Zeroable;
use floats::Floats;
use frame::{Cpu, scene_of};
use random::{Random, step_of};
use tumble_core::glam::{Quat, Vec3};
use tumble_core::layout::*;
use tumble_core::scenes;
use tumble_cpu::narrowphase;

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
const SIZES: [usize; 7] = [0, 1, 2, 255, 256, 257, 3000];
const KINDS: [(&str, u32, [u32; 2]); 5] = [
    ("narrowphase/ball_ball", pair_kind::BALL_BALL, [shape_kind::BALL, shape_kind::BALL]),
    ("narrowphase/ball_cuboid", pair_kind::BALL_CUBOID, [shape_kind::BALL, shape_kind::CUBOID]),
    ("narrowphase/cuboid_cuboid", pair_kind::CUBOID_CUBOID, [shape_kind::CUBOID, shape_kind::CUBOID]),
    ("narrowphase/ball_halfspace", pair_kind::BALL_HALFSPACE, [shape_kind::BALL, shape_kind::HALFSPACE]),
    ("narrowphase/cuboid_halfspace", pair_kind::CUBOID_HALFSPACE, [shape_kind::CUBOID, shape_kind::HALFSPACE]),
];
/// How far bodies are moved to see whether a decision stays, m and rad.
const JITTER: f32 = 3e-6;

const NORMAL: (&str, f32) = ("normal", 2e-5); // 4.3e-6
const ANCHOR: (&str, f32) = ("anchor", 5e-5); // 6.7e-6
const SEPARATION: (&str, f32) = ("separation", 1e-5); // 1.1e-6
const BETWEEN: (&str, f32) = ("between", 1e-6); // 0

/// What the passes read.
struct Contacts {
    step: StepParams,
    pairs: Vec<Pair>,
    colliders: Vec<Collider>,
    states: Vec<BodyState>,
    /// By slot.
    found: Vec<FoundManifold>,
}

/// By up to about twice `reach` about each axis, rad.
fn small_turn(random: &mut Random, reach: f32) -> Quat {
    Quat::from_vec4(random.vector(reach).extend(1.0)).normalize()
}

/// How the comparison went.
#[derive(Default)]
struct Tally {
    floats: Floats,
    compared: usize,
    touching: usize,
    recycled: usize,
    undecided: usize,
}

impl Contacts {
    /// So many pairs of a kind, in either order, near each other or a little apart; two thirds were there before, and
    /// have moved little or much since.
    fn random(kind: usize, count: usize, seed: u64) -> Self {
        let random = &mut Random::new(seed);
        let (_, kind, shapes) = KINDS[kind];
        let mut contacts = Self {
            step: step_of(2 * count as u32),
            pairs: Vec::new(),
            colliders: Vec::new(),
            states: Vec::new(),
            found: Vec::new(),
        };
        for i in 0..count as u32 {
            let (a, b) = (2 * i, 2 * i + 1);
            let [first, second] = if i % 2 == 0 { shapes } else { [shapes[1], shapes[0]] };
            contacts.colliders.extend([random.collider(first, a), random.collider(second, b)]);
            let place = random.vector(300.0);
            let flags = body_flags::DYNAMIC;
            let mut both = [random.state(flags, 0.45), random.state(flags, 0.45)];
            // Face on face, as in a stack, and edges that are almost parallel.
            let aligned = match i % 4 {
                1 => Some(Quat::IDENTITY),
                3 => Some(Quat::from_rotation_y(random.range(0.0, 3.0)) * small_turn(random, 0.02)),
                _ => None,
            };
            if let Some(turn) = aligned {
                both = both.map(|state| BodyState { rotation: Quat::IDENTITY.to_array(), ..state });
                let same = Quat::from_array(contacts.colliders[a as usize].rotation);
                contacts.colliders[b as usize].rotation = (same * turn).to_array();
            }
            both.iter_mut().for_each(|s| s.position = (Vec3::from_array(s.position) + place).to_array());
            contacts.states.extend(both);
            contacts.pairs.push(Pair { a, b, slot: count as u32 - 1 - i, kind: kind | pair_kind::FRESH });
        }
        // What the slots remember is where the bodies were before.
        contacts.found = vec![FoundManifold::zeroed(); count];
        for pair in &mut contacts.pairs {
            let [rotation_a, rotation_b] = [pair.a, pair.b].map(|body| contacts.states[body as usize].rotation);
            let none = &FoundManifold::zeroed();
            let manifold = narrowphase::collide(pair, &contacts.colliders, &contacts.states, none, &contacts.step);
            contacts.found[pair.slot as usize] = FoundManifold { rotation_a, rotation_b, manifold };
            if random.below(3) > 0 {
                pair.kind = kind;
                let reach = [0.0, 2e-3, 2e-2][random.below(3) as usize];
                let [a, b] = &mut contacts.states[pair.a as usize..=pair.b as usize] else { unreachable!() };
                if random.below(2) > 0 {
                    // Both as one.
                    let turn = small_turn(random, 0.1);
                    let between = turn * (Vec3::from_array(b.position) - Vec3::from_array(a.position));
                    b.position = (Vec3::from_array(a.position) + between).to_array();
                    [&mut *a, b]
                        .into_iter()
                        .for_each(|s| s.rotation = (turn * Quat::from_array(s.rotation)).to_array());
                }
                for state in [a, b] {
                    state.position = (Vec3::from_array(state.position) + random.vector(reach)).to_array();
                    let turn = small_turn(random, reach);
                    state.rotation = (turn * Quat::from_array(state.rotation)).normalize().to_array();
                }
            }
        }
        contacts
    }

    /// The plan phase of a scene's next step.
    fn of(cpu: &Cpu) -> Self {
        let frame = cpu.plan(false);
        let (colliders, found) = (cpu.colliders.clone(), cpu.found.clone());
        Self { step: frame.step, pairs: frame.matched.pairs, colliders, states: frame.states, found }
    }

    fn on_cpu(&self) -> Vec<Manifold> {
        let collide = |(i, pair): (usize, &Pair)| match i as u32 == self.step.drop_pair {
            true => narrowphase::EMPTY,
            false => {
                let found = &self.found[pair.slot as usize];
                narrowphase::collide(pair, &self.colliders, &self.states, found, &self.step)
            }
        };
        self.pairs.iter().enumerate().map(collide).collect()
    }

    fn on_gpu(&self, alone: &mut Alone, stems: &[&str]) -> (Vec<Manifold>, Control) {
        alone.put("step", &[self.step]);
        alone.put("counters", &[Control { pair_count: self.pairs.len() as u32, ..Control::zeroed() }]);
        alone.put("next_pairs", &self.pairs);
        alone.put("colliders", &self.colliders);
        alone.put("work_states", &self.states);
        alone.put("found_manifolds", &self.found);
        alone.put("manifolds", &vec![narrowphase::EMPTY; self.pairs.len()]);
        let groups = (self.pairs.len() as u32).div_ceil(256) + 1;
        alone.run(|chain| stems.iter().for_each(|stem| chain.pass(stem, "collide", groups)));
        (alone.take("manifolds"), alone.take("counters")[0])
    }

    /// Whether the CPU decides otherwise for this pair when its bodies are moved a little.
    fn is_undecided(&self, pair: &Pair, manifold: &Manifold) -> bool {
        let random = &mut Random::new(17);
        let ends = [pair.a, pair.b].map(|c| self.colliders[c as usize]);
        let [a, b] = ends.map(|c| self.states[c.body as usize]);
        // At the origin, where floats tell so small a way.
        let between = Vec3::from_array(b.position) - Vec3::from_array(a.position);
        let near = Pair { a: 0, b: 1, ..*pair };
        let colliders = [Collider { body: 0, ..ends[0] }, Collider { body: 1, ..ends[1] }];
        let found = &self.found[pair.slot as usize];
        (0..50).any(|_| {
            let rotation = (small_turn(random, JITTER) * Quat::from_array(b.rotation)).to_array();
            let position = (between + random.vector(JITTER)).to_array();
            let states = [BodyState { position: [0.0; 3], ..a }, BodyState { position, rotation, ..b }];
            decided(&narrowphase::collide(&near, &colliders, &states, found, &self.step)) != decided(manifold)
        })
    }

    fn check(&self, what: &str, alone: &mut Alone, stems: &[&str], tally: &mut Tally) {
        let (cpu, (gpu, control)) = (self.on_cpu(), self.on_gpu(alone, stems));
        let counts = |all: &[Manifold]| {
            let touching = all.iter().filter(|m| m.count > 0).count();
            [touching as u32, all.iter().map(|m| m.count).sum()]
        };
        assert_eq!([control.constraint_count, control.point_count], counts(&gpu), "{what}");
        let dropped = u32::from(self.step.drop_pair < self.pairs.len() as u32);
        assert_eq!(control.processed, self.pairs.len() as u32 - dropped, "{what}");
        let (mut on_cpu, mut on_gpu) = (Vec::new(), Vec::new());
        for (i, (cpu, gpu)) in cpu.iter().zip(&gpu).enumerate() {
            tally.recycled += cpu.recycled as usize;
            tally.touching += usize::from(cpu.count > 0);
            tally.compared += 1;
            if decided(cpu) != decided(gpu) {
                assert!(self.is_undecided(&self.pairs[i], cpu), "{what}, pair {i}: {cpu:?} and {gpu:?}");
                tally.undecided += 1;
            } else if cpu.count == 0 {
                assert_eq!(*gpu, narrowphase::EMPTY, "{what}, pair {i}");
            } else {
                on_cpu.push(*cpu);
                on_gpu.push(*gpu);
            }
        }
        let floats = &mut tally.floats;
        floats.check(what, NORMAL, (&on_cpu, &on_gpu), |m| m.normal);
        floats.check(what, BETWEEN, (&on_cpu, &on_gpu), |m| m.between);
        let points = |all: &[Manifold]| all.iter().flat_map(|m| m.points).collect::<Vec<_>>();
        let (on_cpu, on_gpu) = (points(&on_cpu), points(&on_gpu));
        floats.check(what, ANCHOR, (&on_cpu, &on_gpu), |p| p.anchor);
        floats.check(what, SEPARATION, (&on_cpu, &on_gpu), |p| [p.separation]);
    }
}

/// What a manifold decides: how many points, which features, old or new.
fn decided(m: &Manifold) -> (u32, u32, &[u32]) {
    (m.count, m.recycled, &m.features[..m.count as usize])
}

impl Tally {
    fn done(&self) {
        let Self { floats, compared, touching, recycled, undecided } = self;
        print!("{floats}");
        println!("{compared} pairs: {touching} touch, {recycled} recycled, {undecided} left out");
        assert!(100 * undecided <= *compared);
        assert!(3 * touching > *compared, "most should touch");
    }
}

#[test]
fn pairs_of_every_kind_touch_alike() {
    for (kind, (stem, _, _)) in KINDS.into_iter().enumerate() {
        let mut tally = Tally::default();
        for permute in PERMUTATIONS {
            let mut alone = Alone::new(permute);
            for count in SIZES {
                let mut contacts = Contacts::random(kind, count, 13);
                for drop_pair in [u32::MAX, count as u32 / 2] {
                    contacts.step.drop_pair = drop_pair;
                    let what = format!("{stem}, {count} pairs, permuted {permute}");
                    contacts.check(&what, &mut alone, &[stem], &mut tally);
                }
            }
        }
        println!("{stem}");
        tally.done();
    }
}

#[test]
fn scenes_touch_alike() {
    let mut tally = Tally::default();
    let stems = KINDS.map(|(stem, _, _)| stem);
    let scenes = SIZES.map(|bodies| (format!("{bodies} bodies"), scene_of(bodies), 45));
    let stacks = [("pyramid".to_owned(), scenes::pyramid(12), 20), ("hub".to_owned(), scenes::hub(300), 3)];
    for (name, scene, steps) in scenes.into_iter().chain(stacks) {
        let mut cpu = Cpu::after(&scene, steps);
        for _ in 0..2 {
            let contacts = Contacts::of(&cpu);
            for permute in PERMUTATIONS {
                let what = format!("{name}, step {}, permuted {permute}", cpu.number);
                contacts.check(&what, &mut Alone::new(permute), &stems, &mut tally);
            }
            let frame = cpu.plan(false);
            cpu.commit(&frame);
        }
    }
    tally.done();
}
