//! What a world keeps of those asleep, apart from what the passes of a step look at: their pairs stay as they are in a
//! list of their own, with slots, impulses and batches in the store, and their boxes in a tree that only what moves looks
//! into. A step in which nothing is awake does nothing.
//!
//! Who wakes is known before anything is solved: by edits before boxes are made, by touch after the narrow phase; the
//! pairs of those woken then join the step's.

use super::kept::Kept;
use crate::batch::Ends;
use crate::bounds::{self, NOWHERE, moves};
use crate::broadphase::lbvh::Tree;
use crate::broadphase::{Boxes, Found, collect};
use crate::island::{self, NO_ISLAND};
use crate::sleep::{self, drives, pulls, sleeps};
use bytemuck::Zeroable;
use rayon::prelude::*;
use tumble_core::edit::EditBatch;
use tumble_core::layout::{
    Aabb, BodyState, Collider, Control, FoundManifold, Manifold, Pair, PoseRecord, Rest, StepParams, aabb_body,
    body_flags, edit_op, pair_kind, tree_members,
};
use tumble_core::{MortonBits, Sleep};

/// Written only when a step commits, the tree excepted, which follows from the boxes.
#[derive(Default)]
pub(super) struct Asleep {
    /// How many bodies sleep.
    bodies: u32,
    islands: u32,
    /// By body slot.
    rests: Vec<Rest>,
    /// Pairs of which no end is awake, sorted by (a, b).
    pub(super) pairs: Vec<Pair>,
    sums: Sums,
    /// By collider slot; [`NOWHERE`] for those awake when somebody fell asleep last.
    boxes: Vec<Aabb>,
    tree: Tree,
    tree_is_stale: bool,
    /// Somebody fell asleep or was woken in the last step, so that trees over those awake lack colliders.
    pub(super) changed: bool,
    /// Nothing is awake.
    idle: bool,
    /// Gravity and speculative distance of the last step, as bits.
    told: [u32; 4],
}

/// Of a list of pairs.
#[derive(Clone, Copy, Default)]
struct Sums {
    pairs: u32,
    manifolds: u32,
    points: u32,
}

impl Sums {
    fn of(pairs: &[Pair], found: &[FoundManifold]) -> Self {
        let counts = pairs.iter().map(|pair| found[pair.slot as usize].manifold.count);
        counts.fold(Self { pairs: pairs.len() as u32, ..Self::default() }, |sums, points| Self {
            manifolds: sums.manifolds + u32::from(points > 0),
            points: sums.points + points,
            ..sums
        })
    }

    fn add_to(&self, control: &mut Control) {
        control.pair_count += self.pairs;
        control.processed += self.pairs;
        control.manifolds_asleep += self.manifolds;
        control.point_count += self.points;
    }
}

/// Who wakes in a step. Lists by body slot are empty when they would say no for all.
#[derive(Default)]
pub(super) struct Waking {
    edited: Vec<bool>,
    woken: Vec<bool>,
    /// Pairs that sleep on, where some wake.
    still: Option<Vec<Pair>>,
}

impl Waking {
    fn is_edited(&self, body: u32) -> bool {
        self.edited.get(body as usize).is_some_and(|&edited| edited)
    }

    fn is_woken(&self, body: u32) -> bool {
        self.woken.get(body as usize).is_some_and(|&woken| woken)
    }

    /// Whether anybody wakes.
    pub(super) fn any(&self) -> bool {
        self.still.is_some()
    }
}

/// What a committed step leaves to be looked at for sleep.
pub(super) struct Outcome<'a> {
    /// From [`Kept::labels`]; empty where nothing may sleep.
    pub(super) labels: Vec<u32>,
    pub(super) manifolds: &'a [Manifold],
    pub(super) ends: &'a [Ends],
    /// Pairs of bodies with joints between them.
    pub(super) joined: &'a [[u32; 2]],
    pub(super) waking: Waking,
}

fn told(step: &StepParams) -> [u32; 4] {
    let [x, y, z] = step.gravity;
    [x, y, z, step.speculative_distance].map(f32::to_bits)
}

/// When bodies are put to sleep, if they are.
fn may_sleep(step: &StepParams) -> Option<Sleep> {
    let (distance, time) = (step.sleep_distance, step.sleep_time);
    (distance >= 0.0).then_some(Sleep { distance, time })
}

impl Asleep {
    /// Pairs that have slots, but are not on the list of those awake.
    pub(super) fn pairs_after(&self, waking: &Waking) -> u32 {
        waking.still.as_ref().unwrap_or(&self.pairs).len() as u32
    }

    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> u64 {
        let lists = self.rests.len() * size_of::<Rest>() + self.pairs.len() * size_of::<Pair>();
        (lists + self.boxes.len() * size_of::<Aabb>()) as u64 + self.tree.bytes()
    }

    /// Wakes the islands whose labels are marked: clears their flags in `states`. Returns their pairs.
    fn rouse(
        &self,
        marked: &[bool],
        colliders: &[Collider],
        states: &mut [BodyState],
        waking: &mut Waking,
    ) -> Vec<Pair> {
        waking.woken.resize(states.len(), false);
        for (slot, rest) in self.rests.iter().enumerate() {
            if sleeps(states[slot].flags) && marked[rest.island as usize] {
                states[slot].flags &= !body_flags::ASLEEP;
                waking.woken[slot] = true;
            }
        }
        let body = |collider: u32| colliders[collider as usize].body;
        let pairs = waking.still.take().unwrap_or_else(|| self.pairs.clone());
        // Those that were removed are edited, and no longer there to be woken.
        let stirs = |body: u32| waking.is_woken(body) || waking.is_edited(body);
        let wakes = |pair: &Pair| stirs(body(pair.a)) || stirs(body(pair.b));
        let (woken, still) = pairs.into_iter().partition(wakes);
        waking.still = Some(still);
        woken
    }
}

impl Kept {
    /// Whether a step would change nothing but its number.
    pub(super) fn is_idle(&self, edits: &EditBatch, step: &StepParams) -> bool {
        let asleep = &self.asleep;
        asleep.idle && may_sleep(step).is_some() && edits.records.is_empty() && asleep.told == told(step)
    }

    /// A step of a world that [is idle](Self::is_idle).
    pub(super) fn pass_time(&mut self, step: &StepParams) {
        let Control { colored_as, free_count, old_pair_count, frozen_count, broken_joints, .. } = self.control;
        let Control { asleep, islands_asleep, .. } = self.control;
        self.control = Control { step: step.step, colored_as, free_count, old_pair_count, ..Control::zeroed() };
        self.control = Control { frozen_count, broken_joints, asleep, islands_asleep, ..self.control };
        self.asleep.changed = false;
        self.asleep.sums.add_to(&mut self.control);
    }

    /// Who wakes before the step looks at anything: whose body is edited, or lies beside one that is, or is joined to one
    /// that is or moves; or all. `states` are edited. With them come the pairs that they had.
    pub(super) fn wake_by_edits(
        &self,
        edits: &EditBatch,
        step: &StepParams,
        states: &mut [BodyState],
    ) -> (Waking, Vec<Pair>) {
        let (asleep, mut waking) = (&self.asleep, Waking::default());
        let may_sleep = may_sleep(step).is_some();
        if may_sleep && !edits.records.is_empty() {
            waking.edited = vec![false; states.len()];
            let bodies = edits.records.iter().filter(|record| record.op < edit_op::COLLIDER);
            bodies.for_each(|record| waking.edited[record.target as usize] = true);
        }
        let all = !may_sleep || asleep.told != told(step);
        let joined = &edits.joints.topology.joined;
        if asleep.bodies == 0 || (!all && waking.edited.is_empty() && joined.is_empty()) {
            return (waking, Vec::new());
        }
        let mut marked = vec![all; states.len()];
        // The working copy has forgotten those that were removed.
        let mut mark = |body: u32| {
            if self.states.get(body as usize).is_some_and(|state| sleeps(state.flags)) {
                marked[asleep.rests[body as usize].island as usize] = true;
            }
        };
        (0..waking.edited.len() as u32).filter(|&body| waking.is_edited(body)).for_each(&mut mark);
        for &[a, b] in joined {
            for (body, partner) in [(a, b), (b, a)] {
                if pulls(&states[partner as usize], waking.is_edited(partner)) {
                    mark(body);
                }
            }
        }
        let mut beside = false;
        for pair in asleep.pairs.iter().filter(|_| !waking.edited.is_empty()) {
            let [a, b] = [pair.a, pair.b].map(|collider| self.colliders[collider as usize].body);
            if waking.is_edited(a) || waking.is_edited(b) {
                mark(a);
                mark(b);
                beside = true;
            }
        }
        if !marked.contains(&true) && !beside {
            return (waking, Vec::new());
        }
        let pairs = asleep.rouse(&marked, &self.colliders, states, &mut waking);
        (waking, pairs)
    }

    /// Adds to `found` the pairs of what moves, or was edited, with those asleep.
    pub(super) fn find_sleepers(
        &mut self,
        boxes: &Boxes,
        states: &[BodyState],
        waking: &Waking,
        most: u32,
        found: &mut Found,
    ) {
        let asleep = &mut self.asleep;
        if asleep.bodies == 0 {
            return;
        }
        if std::mem::take(&mut asleep.tree_is_stale) {
            asleep.tree = Tree::new(&Boxes::new(&asleep.boxes), MortonBits::Bits30, tree_members::ALL);
        }
        let body = |collider: u32| self.colliders[collider as usize].body;
        let looks = |&i: &u32| {
            let aabb = &boxes.aabbs[i as usize];
            let moving = aabb.body & aabb_body::DYNAMIC != 0 || drives(&states[body(i) as usize]);
            aabb.body & aabb_body::LIVE != 0 && (moving || waking.is_edited(body(i)))
        };
        let lookers: Vec<u32> =
            (0..boxes.aabbs.len() as u32).into_par_iter().with_min_len(4096).filter(looks).collect();
        let tree = &self.asleep.tree;
        let more = collect(boxes, &[], lookers.len(), most, |range, sink| {
            for &i in &lookers[range] {
                let turns = tree.overlapping(&boxes.aabbs[i as usize], &mut |j| {
                    if sleeps(states[body(j) as usize].flags) {
                        sink.push(i, j);
                    }
                });
                sink.took(turns);
            }
        });
        found.count += more.count;
        found.most_turns = found.most_turns.max(more.most_turns);
        found.turns = found.turns.wrapping_add(more.turns);
        found.pairs = merge_by(&found.pairs, &more.pairs, |pair| *pair);
    }

    /// Wakes those that are touched: every pair with one that sleeps is one with something that moves. Returns the pairs
    /// of their islands.
    pub(super) fn wake_by_touch(
        &self,
        pairs: &[Pair],
        manifolds: &[Manifold],
        states: &mut [BodyState],
        waking: &mut Waking,
    ) -> Vec<Pair> {
        if self.asleep.bodies == 0 {
            return Vec::new();
        }
        let mut marked = vec![false; states.len()];
        let mut any = false;
        for (pair, _) in pairs.iter().zip(manifolds).filter(|(_, manifold)| manifold.count > 0) {
            for body in [pair.a, pair.b].map(|collider| self.colliders[collider as usize].body as usize) {
                if sleeps(states[body].flags) {
                    marked[self.asleep.rests[body].island as usize] = true;
                    any = true;
                }
            }
        }
        if any { self.asleep.rouse(&marked, &self.colliders, states, waking) } else { Vec::new() }
    }

    /// Labels of the step's islands, where bodies may sleep; `states` as the passes of the step read them.
    pub(super) fn labels(
        &self,
        states: &[BodyState],
        manifolds: &[Manifold],
        ends: &[Ends],
        joined: &[[u32; 2]],
        step: &StepParams,
    ) -> Vec<u32> {
        match may_sleep(step).is_some() || step.is_leveled() {
            true => island::label(states, manifolds, ends, joined),
            false => Vec::new(),
        }
    }

    /// Looks who has rested long enough, and puts whole islands to sleep. `self.states` are those after the step, and
    /// `self.pairs` all that were looked at.
    pub(super) fn settle(&mut self, outcome: Outcome, step: &StepParams, control: &mut Control) {
        let Outcome { ref labels, ref waking, .. } = outcome;
        let woken = waking.any();
        let asleep = &mut self.asleep;
        if let Some(still) = waking.still.as_ref() {
            asleep.pairs.clone_from(still);
            asleep.sums = Sums::of(&asleep.pairs, &self.found);
        }
        asleep.sums.add_to(control);
        asleep.told = told(step);
        let Some(sleep) = &may_sleep(step) else {
            if !asleep.rests.is_empty() {
                *asleep = Asleep { changed: woken, ..Asleep::default() };
            }
            return;
        };
        let known = asleep.rests.len();
        asleep.rests.resize(self.states.len(), Rest::zeroed());
        let bodies = self.states.par_iter().zip(&self.props).zip(&mut asleep.rests);
        bodies.enumerate().with_min_len(512).filter(|(_, ((state, _), _))| moves(state.flags)).for_each(
            |(slot, ((state, props), rest))| {
                let anew = slot >= known || waking.is_edited(slot as u32) || waking.is_woken(slot as u32);
                *rest = if anew { sleep::begin(state) } else { sleep::rest(rest, state, props, sleep, step.dt) };
            },
        );
        let busy = self.busy(&outcome, sleep);
        let mut slept = false;
        for (slot, &label) in labels.iter().enumerate().filter(|(_, label)| **label != NO_ISLAND) {
            if !busy[label as usize] {
                sleep::put_to_sleep(&mut self.states[slot]);
                self.poses[slot] = PoseRecord::of(&self.states[slot], &self.props[slot]);
                self.asleep.rests[slot].island = label;
                slept = true;
            }
        }
        self.asleep.changed = woken || slept;
        if self.asleep.changed {
            self.recount();
        }
        if slept {
            self.lay_down(step);
        }
        let awake = |(slot, label): &(usize, &u32)| **label == *slot as u32 && busy[*slot];
        control.islands = labels.iter().enumerate().filter(awake).count() as u32;
        (control.asleep, control.islands_asleep) = (self.asleep.bodies, self.asleep.islands);
        self.asleep.idle = !self.states.par_iter().with_min_len(4096).any(|s| moves(s.flags) || drives(s));
    }

    /// By label, whether something keeps the island awake.
    fn busy(&self, outcome: &Outcome, sleep: &Sleep) -> Vec<bool> {
        let Outcome { labels, manifolds, ends, joined, .. } = outcome;
        let mut busy = vec![false; labels.len()];
        for ((&label, state), rest) in labels.iter().zip(&self.states).zip(&self.asleep.rests) {
            if label != NO_ISLAND && !sleep::rested(rest, state, sleep) {
                busy[label as usize] = true;
            }
        }
        let driven = self.states.iter().any(drives);
        for ((pair, ends), _) in self.pairs.iter().zip(*ends).zip(*manifolds).filter(|(_, m)| driven && m.count > 0) {
            let drives = |collider: u32| drives(&self.states[self.colliders[collider as usize].body as usize]);
            if drives(pair.a) || drives(pair.b) {
                for label in [ends.a, ends.b].iter().filter_map(|&body| labels.get(body as usize)) {
                    busy[*label as usize] = true;
                }
            }
        }
        for &[a, b] in joined.iter().filter(|_| driven) {
            for (body, partner) in [(a, b), (b, a)] {
                if labels[body as usize] != NO_ISLAND && drives(&self.states[partner as usize]) {
                    busy[labels[body as usize] as usize] = true;
                }
            }
        }
        busy
    }

    fn recount(&mut self) {
        let asleep = self.states.iter().enumerate().filter(|(_, state)| sleeps(state.flags));
        let rests = &self.asleep.rests;
        let (mut bodies, mut islands) = (0, 0);
        for (slot, _) in asleep {
            bodies += 1;
            islands += u32::from(rests[slot].island == slot as u32);
        }
        (self.asleep.bodies, self.asleep.islands) = (bodies, islands);
    }

    /// Takes the pairs and boxes of those that sleep now out of what the next steps look at.
    fn lay_down(&mut self, step: &StepParams) {
        let state = |collider: u32| &self.states[self.colliders[collider as usize].body as usize];
        let active = |pair: &Pair| {
            let [a, b] = [state(pair.a), state(pair.b)];
            moves(a.flags) || moves(b.flags) || drives(a) || drives(b)
        };
        let (awake, mut resting): (Vec<Pair>, Vec<Pair>) = self.pairs.iter().partition(|pair| active(pair));
        resting.iter_mut().for_each(|pair| pair.kind &= pair_kind::MASK);
        let asleep = &mut self.asleep;
        asleep.pairs = merged(&asleep.pairs, &resting);
        asleep.sums = Sums::of(&asleep.pairs, &self.found);
        self.pairs = awake;
        let (states, props) = (&self.states, &self.props);
        let boxes = self.colliders.par_iter().with_min_len(256).map(|collider| {
            let body = collider.body as usize;
            match sleeps(states[body].flags) {
                true => bounds::collider_bounds(collider, &states[body], &props[body], step),
                false => NOWHERE,
            }
        });
        asleep.boxes = boxes.collect();
        asleep.tree_is_stale = true;
    }
}

/// Both lists, sorted by (a, b), as one.
pub(super) fn merged(one: &[Pair], other: &[Pair]) -> Vec<Pair> {
    merge_by(one, other, |pair| [pair.a, pair.b])
}

fn merge_by<T: Copy>(one: &[T], other: &[T], key: impl Fn(&T) -> [u32; 2]) -> Vec<T> {
    let mut all = Vec::with_capacity(one.len() + other.len());
    let mut next = 0;
    for item in one {
        while next < other.len() && key(&other[next]) < key(item) {
            all.push(other[next]);
            next += 1;
        }
        all.push(*item);
    }
    all.extend_from_slice(&other[next..]);
    all
}

/// Adds pairs to a step's, in order; `manifolds` likewise.
pub(super) fn join(pairs: &mut Vec<Pair>, manifolds: &mut Vec<Manifold>, more: &[Pair], theirs: &[Manifold]) {
    let own: Vec<(Pair, Manifold)> = pairs.iter().copied().zip(manifolds.iter().copied()).collect();
    let more: Vec<(Pair, Manifold)> = more.iter().copied().zip(theirs.iter().copied()).collect();
    (*pairs, *manifolds) = merge_by(&own, &more, |(pair, _)| [pair.a, pair.b]).into_iter().unzip();
}
