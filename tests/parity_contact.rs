//! Stage `contact` alone, over steps in which pairs and colliders come and go: the GPU hands out the same slots as the
//! CPU and keeps the same things in them, in every order of invocations. Oracle: the mirror.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/alone.rs"]
mod alone;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;

use alone::{Alone, Chain};
use bytemuck::Zeroable;
use random::{Random, step_of};
use std::collections::BTreeSet;
use tumble_core::layout::*;
use tumble_cpu::contact::{self, Matched, NO_FEATURE};
use tumble_gpu::primitives::{Count, Scan, ScanOptions};

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
/// Pairs of each step.
const SIZES: [usize; 16] = [0, 1, 2, 255, 256, 257, 3000, 3000, 2800, 257, 256, 255, 2, 1, 0, 700];
const CAPACITY: usize = 3100;
const COLLIDERS: u32 = 400;
const GARBAGE: u32 = 0xdead_beef;
/// Words of `Control`: counts of pairs, and what the step leaves for the next one.
const OLD_PAIR_COUNT: u32 = 4;
const PAIR_COUNT: u32 = 8;
const NEW_COUNT: u32 = 10;
const DEAD_COUNT: u32 = 11;
const NEXT_COLORED_AS: usize = 31;
const NEXT_FROZEN: usize = 108;

/// What lives from step to step, on the CPU.
struct Kept {
    pairs: Vec<Pair>,
    free: Vec<u32>,
    batch_of_slot: Vec<u32>,
    impulses: Vec<Impulse>,
    found: Vec<FoundManifold>,
    colliders: Vec<Collider>,
    states: Vec<BodyState>,
    /// Bodies that do not collide.
    apart: Vec<[u32; 2]>,
}

/// What a step brings.
struct Input {
    step: StepParams,
    keys: Vec<[u32; 2]>,
    manifolds: Vec<Manifold>,
    batches: Vec<u32>,
}

impl Kept {
    fn new(random: &mut Random) -> Self {
        use shape_kind::{BALL, CUBOID, HALFSPACE, NONE};
        let colliders = (0..COLLIDERS).map(|i| {
            let shape = [BALL, CUBOID, HALFSPACE, NONE][[0, 0, 0, 1, 1, 1, 1, 2, 2, 3][random.below(10) as usize]];
            random.collider(shape, i)
        });
        Self {
            colliders: colliders.collect(),
            states: (0..COLLIDERS).map(|_| random.state(body_flags::DYNAMIC, 5.0)).collect(),
            apart: Vec::new(),
            pairs: Vec::new(),
            free: (0..CAPACITY as u32).rev().collect(),
            batch_of_slot: vec![UNBATCHED; CAPACITY],
            impulses: vec![Impulse { normal: 1.0, tangent: [2.0; 2], feature: NO_FEATURE }; 4 * CAPACITY],
            found: vec![FoundManifold::zeroed(); CAPACITY],
        }
    }

    /// `count` pairs, most of them of the last step; some colliders are new, and bodies have moved.
    fn next(&mut self, number: u32, count: usize, random: &mut Random) -> Input {
        let mut step = step_of(COLLIDERS);
        (step.step, step.pair_capacity) = (number, CAPACITY as u32);
        step.drop_pair = random.below(count as u32 + 3);
        self.colliders.iter_mut().filter(|_| random.below(100) == 0).for_each(|c| c.born = number);
        self.states.iter_mut().for_each(|state| *state = random.state(body_flags::DYNAMIC, 5.0));
        let stay = self.pairs.iter().filter(|_| random.below(10) > 0).map(|pair| [pair.a, pair.b]);
        let mut keys: BTreeSet<[u32; 2]> = stay.collect();
        while keys.len() > count {
            let at = random.below(keys.len() as u32) as usize;
            let key = *keys.iter().nth(at).unwrap();
            keys.remove(&key);
        }
        while keys.len() < count {
            let (a, b) = (random.below(COLLIDERS), random.below(COLLIDERS));
            if a != b {
                keys.insert([a.min(b), a.max(b)]);
            }
        }
        // An eighth of the pairs, as many others, in steps with joints.
        let eighth = keys.iter().step_by(8).chain(&[[0, COLLIDERS - 1]]).flat_map(|&[a, b]| [[a, b], [a, a + 1]]);
        self.apart =
            if number.is_multiple_of(3) { Vec::new() } else { BTreeSet::from_iter(eighth).into_iter().collect() };
        let manifold = |_: &[u32; 2]| Manifold {
            normal: random.vector(1.0).to_array(),
            count: random.below(5),
            features: [random.next(), 1, 2, 3],
            recycled: random.below(2),
            ..Manifold::zeroed()
        };
        let manifolds: Vec<_> = keys.iter().map(manifold).collect();
        let batch = |m: &Manifold| if m.count == 0 { UNBATCHED } else { m.features[0] % 64 };
        let batches = manifolds.iter().map(batch).collect();
        Input { step, keys: keys.into_iter().collect(), manifolds, batches }
    }

    fn commit(&mut self, matched: &Matched, input: &Input) {
        contact::commit_free(&mut self.free, matched);
        for (i, pair) in matched.pairs.iter().enumerate() {
            let (slot, manifold) = (pair.slot as usize, &input.manifolds[i]);
            let impulses = &mut self.impulses[4 * slot..][..4];
            contact::commit_pair(manifold, input.batches[i], &mut self.batch_of_slot[slot], impulses);
            if manifold.recycled == 0 {
                let rotation = |c: u32| self.states[self.colliders[c as usize].body as usize].rotation;
                let (rotation_a, rotation_b) = (rotation(pair.a), rotation(pair.b));
                self.found[slot] = FoundManifold { rotation_a, rotation_b, manifold: *manifold };
            }
        }
        self.pairs = matched.pairs.clone();
    }

    /// Everything that the GPU keeps is the same there.
    fn check(&self, alone: &Alone, what: &str) {
        let control: Control = alone.take("counters")[0];
        let counts = [control.old_pair_count as usize, control.free_count as usize];
        assert_eq!(counts, [self.pairs.len(), self.free.len()], "{what}");
        assert!(alone.take::<Pair>("pairs")[..self.pairs.len()] == self.pairs, "{what}: pairs");
        assert!(alone.take::<u32>("free_slots")[..self.free.len()] == self.free, "{what}: free slots");
        assert!(alone.take::<u32>("batch_of_slot") == self.batch_of_slot, "{what}: batches");
        assert!(alone.take::<Impulse>("slot_impulses") == self.impulses, "{what}: impulses");
        assert!(alone.take::<FoundManifold>("found_manifolds") == self.found, "{what}: manifolds");
    }
}

/// Fills in what a GPU that has run no step keeps.
fn begin(alone: &mut Alone, kept: &Kept) {
    alone.put("counters", &[Control { free_count: CAPACITY as u32, ..Control::zeroed() }]);
    alone.put("pairs", &vec![Pair::zeroed(); CAPACITY]);
    alone.put("next_pairs", &vec![Pair::zeroed(); CAPACITY]);
    alone.put("free_slots", &kept.free);
    alone.put("batch_of_slot", &kept.batch_of_slot);
    alone.put("slot_impulses", &kept.impulses);
    alone.put("found_manifolds", &kept.found);
    for name in ["dead_rank", "dead_slots", "fresh_rank", "pair_batch"] {
        alone.put(name, &vec![GARBAGE; CAPACITY]);
    }
    alone.put("manifolds", &vec![[GARBAGE; 28]; CAPACITY]);
    alone.put("pair_keys", &vec![[GARBAGE; 2]; CAPACITY]);
}

/// Writes the first elements of a buffer that stays as long as it is.
fn overwrite<T: bytemuck::Pod>(alone: &Alone, name: &str, data: &[T]) {
    common::gpu().queue.write_buffer(alone.buffers.buffer(name).unwrap(), 0, bytemuck::cast_slice(data));
}

fn find(alone: &mut Alone, scans: &[Scan; 2]) {
    let buffer = |name: &str| alone.buffers.buffer(name).unwrap().clone();
    let [dead, fresh, counters] = ["dead_rank", "fresh_rank", "counters"].map(buffer);
    let groups = CAPACITY.div_ceil(256) as u32;
    alone.run(|chain| {
        chain.pass("contact", "find_old", groups);
        scans[0].record(&mut chain.recorder, &dead, Some(&counters)).unwrap();
        chain.pass("contact", "find_new", groups);
        scans[1].record(&mut chain.recorder, &fresh, Some(&counters)).unwrap();
        chain.pass("contact", "list_dead", groups);
        chain.pass("contact", "assign", groups);
    });
}

fn commit(chain: &mut Chain) {
    for entry in ["commit_pairs", "commit_found", "commit_free"] {
        chain.pass("contact", entry, CAPACITY.div_ceil(256) as u32);
    }
    chain.pass("contact", "commit_counts", 1);
}

fn set_control(alone: &mut Alone, change: impl FnOnce(&mut [u32; size_of::<Control>() / 4])) {
    let mut words = bytemuck::cast(alone.take::<Control>("counters")[0]);
    change(&mut words);
    alone.put("counters", &[bytemuck::cast::<_, Control>(words)]);
}

#[test]
fn pairs_keep_their_slots_over_steps() {
    let (mut stayed, mut came, mut went, mut held) = (0, 0, 0, 0);
    for permute in PERMUTATIONS {
        let random = &mut Random::new(11);
        let (mut kept, mut alone) = (Kept::new(random), Alone::new(permute));
        begin(&mut alone, &kept);
        let scan =
            |(count, total)| ScanOptions { capacity: CAPACITY as u32, count: Count::Word(count), total: Some(total) };
        let scans = [(OLD_PAIR_COUNT, DEAD_COUNT), (PAIR_COUNT, NEW_COUNT)]
            .map(|words| Scan::new(common::gpu(), &mut alone.pipelines, scan(words)).unwrap());
        for (number, count) in (1..).zip(SIZES) {
            let what = format!("step {number}, {count} pairs, permuted {permute}");
            let input = kept.next(number, count, random);
            let matched =
                contact::match_pairs(&kept.pairs, &input.keys, &kept.colliders, &kept.apart, &kept.free, number);
            held += matched.pairs.iter().filter(|pair| kept.apart.contains(&[pair.a, pair.b])).count();
            alone.put("step", &[input.step]);
            alone.put("colliders", &kept.colliders);
            let mut apart = vec![[kept.apart.len() as u32, 0]];
            apart.extend(&kept.apart);
            // An earlier list was longer.
            apart.push([0, 0]);
            alone.put("apart", &apart);
            alone.put("work_states", &kept.states);
            overwrite(&alone, "pair_keys", &input.keys);

            // A step that stopped in the broad phase finds nothing new and nothing gone.
            set_control(&mut alone, |words| {
                words[8..].fill(0);
                words[0] = 1;
            });
            find(&mut alone, &scans);
            let stopped: Control = alone.take("counters")[0];
            assert_eq!([stopped.new_count, stopped.dead_count, stopped.processed], [0; 3], "{what}");

            set_control(&mut alone, |words| (words[0], words[PAIR_COUNT as usize]) = (0, count as u32));
            find(&mut alone, &scans);
            let control: Control = alone.take("counters")[0];
            let dead = matched.dead_slots.len();
            assert_eq!([control.new_count, control.dead_count], [matched.new_count, dead as u32], "{what}");
            assert!(alone.take::<Pair>("next_pairs")[..count] == matched.pairs, "{what}: new pairs");
            assert!(alone.take::<u32>("dead_slots")[..dead] == matched.dead_slots, "{what}: dead slots");
            assert!(alone.take::<Manifold>("manifolds")[..count].iter().all(|m| *m == Manifold::zeroed()), "{what}");
            let nobodys = |(i, pair): &(usize, &Pair)| {
                pair.kind & pair_kind::MASK == pair_kind::NONE && *i as u32 != input.step.drop_pair
            };
            assert_eq!(control.processed as usize, matched.pairs.iter().enumerate().filter(nobodys).count(), "{what}");
            let fresh = matched.new_count as usize;
            (stayed, came, went) = (stayed + count - fresh, came + fresh, went + dead);

            overwrite(&alone, "manifolds", &input.manifolds);
            overwrite(&alone, "pair_batch", &input.batches);
            set_control(&mut alone, |words| {
                (words[0], words[NEXT_COLORED_AS], words[NEXT_FROZEN]) = (1, number % 2, 10 * number);
            });
            alone.run(commit);
            kept.check(&alone, &format!("{what}, stopped"));
            set_control(&mut alone, |words| words[0] = 0);
            alone.run(commit);
            kept.commit(&matched, &input);
            kept.check(&alone, &what);
            let control: Control = alone.take("counters")[0];
            let told = [control.step, control.colored_as, control.frozen_count];
            assert_eq!(told, [number, number % 2, 10 * number], "{what}");
        }
    }
    println!("{stayed} pairs stayed, {came} came, {went} went; {held} were kept apart");
    assert!(stayed.min(came).min(went) > 3000 && held > 1000);
}
