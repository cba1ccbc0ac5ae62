//! Stage `sleep` alone: how long bodies have rested, which islands fall asleep, and what joints wake, on both sides. Oracle: the mirror;
//! displacements lie a tenth of the allowance and more off it, so that rounding decides nothing.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/alone.rs"]
mod alone;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;

use alone::Alone;
use bytemuck::Zeroable;
use random::Random;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::layout::*;
use tumble_core::{Params, Sleep};
use tumble_cpu::bounds::moves;
use tumble_cpu::island::NO_ISLAND;
use tumble_cpu::sleep;

const SLEEP: Sleep = Sleep { distance: 1e-2, time: 0.5 };
const STIRRED: u32 = 1;
const EDITED: u32 = 2;
const DRIVEN: u32 = 4;
const MARKED: u32 = 8;

/// Bodies that have strayed by 0 to 0.9 or 1.1 to 5 of the allowance, in islands of neighbours.
struct Crowd {
    step: StepParams,
    states: Vec<BodyState>,
    props: Vec<BodyProps>,
    rests: Vec<Rest>,
    stirs: Vec<u32>,
    islands: Vec<u32>,
}

impl Crowd {
    fn new(bodies: usize, seed: u64) -> Self {
        use body_flags::{ASLEEP, DYNAMIC, FIXED, FROZEN, KINEMATIC, STAYS_AWAKE};
        let mut random = Random::new(seed);
        let mut crowd = Self {
            step: Params { sleep: Some(SLEEP), ..Params::default() }.step_params(7, Vec3::ZERO),
            states: Vec::new(),
            props: Vec::new(),
            rests: Vec::new(),
            stirs: vec![0; bodies],
            islands: vec![NO_ISLAND; bodies],
        };
        crowd.step.body_count = bodies as u32;
        let mut label = 0;
        for i in 0..bodies {
            let flags = match random.below(24) {
                0 => FIXED,
                1 => KINEMATIC,
                2 => DYNAMIC | FROZEN,
                3 => DYNAMIC | ASLEEP,
                4 => DYNAMIC | STAYS_AWAKE,
                _ => DYNAMIC,
            };
            let mut state = random.state(flags, 20.0);
            if sleep::sleeps(flags) || i % 3 == 0 {
                (state.linear_velocity, state.angular_velocity) = ([0.0; 3], [0.0; 3]);
            }
            let share = if random.below(12) > 0 { random.range(0.0, 0.9) } else { random.range(1.1, 5.0) };
            let strayed = share * SLEEP.distance;
            let reach = random.range(0.2, 2.0);
            // Half of the way by turning.
            let turn = Quat::from_axis_angle(random.vector(1.0).normalize(), 2.0 * (0.25 * strayed / reach).asin());
            let way = random.vector(1.0).normalize() * 0.5 * strayed;
            let rest = Rest {
                position: (Vec3::from_array(state.position) + way).to_array(),
                rotation: (turn * Quat::from_array(state.rotation)).to_array(),
                time: if random.below(12) > 0 { random.range(0.6, 2.0) } else { random.range(0.0, 0.4) },
                ..Rest::zeroed()
            };
            crowd.props.push(BodyProps { reach, ..BodyProps::zeroed() });
            crowd.stirs[i] = if random.below(20) == 0 { [STIRRED, DRIVEN][random.below(2) as usize] } else { 0 };
            if random.below(4) == 0 {
                label = i as u32;
            }
            // The label is a body of the island.
            if moves(flags) {
                crowd.islands[i] =
                    if label == i as u32 || moves(crowd.states[label as usize].flags) { label } else { i as u32 };
            }
            crowd.states.push(state);
            crowd.rests.push(Rest { island: if sleep::sleeps(flags) { i as u32 } else { 0 }, ..rest });
        }
        crowd
    }

    /// What is left on the CPU, and how many sleep, are awake, islands fell asleep.
    fn on_cpu(&self) -> (Vec<BodyState>, Vec<Rest>, [u32; 3]) {
        let (mut states, mut rests) = (self.states.clone(), self.rests.clone());
        let mut busy = vec![false; states.len()];
        for i in 0..states.len() {
            if moves(states[i].flags) {
                rests[i] = match self.stirs[i] & STIRRED {
                    0 => sleep::rest(&rests[i], &states[i], &self.props[i], &SLEEP, self.step.dt),
                    _ => sleep::begin(&states[i]),
                };
            }
            if self.islands[i] != NO_ISLAND {
                let rested = sleep::rested(&rests[i], &states[i], &SLEEP) && self.stirs[i] & DRIVEN == 0;
                busy[self.islands[i] as usize] |= !rested;
            }
        }
        let mut islands = 0;
        for i in (0..states.len()).filter(|&i| self.islands[i] != NO_ISLAND && !busy[self.islands[i] as usize]) {
            sleep::put_to_sleep(&mut states[i]);
            rests[i].island = self.islands[i];
            islands += u32::from(self.islands[i] == i as u32);
        }
        let asleep = states.iter().filter(|state| sleep::sleeps(state.flags)).count() as u32;
        let awake = states.iter().filter(|state| moves(state.flags) || sleep::drives(state)).count() as u32;
        (states, rests, [asleep, awake, islands])
    }
}

#[test]
fn the_same_bodies_rest_and_sleep() {
    let mut seen = [0; 3];
    for order in [0, 1, 2] {
        let mut alone = Alone::new(order);
        for (seed, bodies) in [1, 2, 255, 256, 257, 3000].into_iter().enumerate() {
            let crowd = Crowd::new(bodies, seed as u64 + 3);
            alone.put("step", &[crowd.step]);
            // As many islands as will fall asleep are taken off.
            alone.put("counters", &[Control { islands: 5000, ..Control::zeroed() }]);
            alone.put("states", &crowd.states);
            alone.put("props", &crowd.props);
            alone.put("rests", &crowd.rests);
            alone.put("stirs", &crowd.stirs);
            alone.put("islands", &crowd.islands);
            let groups = (bodies as u32).div_ceil(256) + 1;
            alone.run(|chain| {
                chain.pass("sleep", "rest", groups);
                chain.pass("sleep", "settle", groups);
            });
            let (states, rests, [asleep, awake, islands]) = crowd.on_cpu();
            let what = format!("{bodies} bodies, order {order}");
            assert!(alone.take::<BodyState>("states") == states, "{what}: states");
            assert!(alone.take::<Rest>("rests") == rests, "{what}: rests");
            let control: Control = alone.take("counters")[0];
            assert_eq!([control.asleep, control.awake, 5000 - control.islands], [asleep, awake, islands], "{what}");
            // Nothing is written once the step has stopped.
            alone.put("counters", &[Control { stop: 1, ..Control::zeroed() }]);
            alone.put("states", &crowd.states);
            alone.put("rests", &crowd.rests);
            alone.run(|chain| {
                chain.pass("sleep", "rest", groups);
                chain.pass("sleep", "settle", groups);
            });
            assert!(alone.take::<BodyState>("states") == crowd.states && alone.take::<Rest>("rests") == crowd.rests);
            seen = [seen[0] + asleep, seen[1] + awake, seen[2] + islands];
        }
    }
    assert!(seen.iter().all(|&count| count > 300), "a trial that tries nothing: {seen:?}");
}

#[test]
fn joints_pull_the_same() {
    let mut seen = [0; 2];
    for order in [0, 1, 2] {
        let mut alone = Alone::new(order);
        for (seed, bodies) in [2, 255, 256, 257, 3000u32].into_iter().enumerate() {
            let mut crowd = Crowd::new(bodies as usize, seed as u64 + 40);
            let mut random = Random::new(seed as u64 + 50);
            crowd.stirs.iter_mut().for_each(|stirs| *stirs = if random.below(9) == 0 { EDITED } else { 0 });
            // A few among those that do not move, which wake nobody.
            let other = |a: u32, random: &mut Random| (a + 1 + random.below(bodies - 1)) % bodies;
            let joined: Vec<[u32; 2]> = (0..bodies).step_by(3).map(|a| [a, other(a, &mut random)]).collect();
            alone.put("step", &[crowd.step]);
            alone.put("work_states", &crowd.states);
            alone.put("rests", &crowd.rests);
            alone.put("stirs", &crowd.stirs);
            let mut listed = vec![[joined.len() as u32, 0]];
            listed.extend(&joined);
            // What an earlier list left.
            listed.extend(&joined);
            alone.put("joined", &listed);
            alone.run(|chain| chain.pass("sleep", "pull", bodies.div_ceil(256)));

            let mut expected = crowd.stirs.clone();
            for (body, partner) in
                joined.iter().flat_map(|&[a, b]| [(a as usize, b as usize), (b as usize, a as usize)])
            {
                let (own, other) = (crowd.states[body].flags, &crowd.states[partner]);
                if !moves(own & !body_flags::ASLEEP) {
                    continue;
                }
                if sleep::drives(other) {
                    expected[body] |= DRIVEN;
                    seen[0] += 1;
                }
                if sleep::sleeps(own) && sleep::pulls(other, crowd.stirs[partner] & EDITED != 0) {
                    expected[crowd.rests[body].island as usize] |= MARKED;
                    seen[1] += 1;
                }
            }
            assert!(alone.take::<u32>("stirs") == expected, "{bodies} bodies, order {order}");
        }
    }
    assert!(seen[0] > 50 && seen[1] > 50, "{seen:?}");
}
