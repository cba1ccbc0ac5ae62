//! Which joints are solved together, and in what order: built on the host when joints come or go, the same for both sides.

use crate::elimination::Elimination;
use crate::layout::{Joint, JointBlock, JointBody, JointEntry, JointIsland, JointTables, NO_BODY, joint_bits};
use std::collections::{BTreeMap, BTreeSet};

/// How joints are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum JointSolver {
    /// Directly where that pays, else by Gauss-Seidel: each island by itself.
    #[default]
    Auto,
    /// Directly, but for islands of more than 1024 blocks of rows (a ball joint has one, other joints two) or whose
    /// factors would have more than 16 entries a block; those by Gauss-Seidel.
    Direct,
    /// By Gauss-Seidel.
    GaussSeidel,
}

/// Most blocks of an island that is solved directly: a shader walks through them in loops.
pub const MOST_BLOCKS: usize = 1024;

/// Fewest joints of a batch that has a dispatch of its own; the others are solved by one workgroup, batch after batch.
pub const WIDE_JOINTS: u32 = 256;

/// Most batches that have a dispatch of their own.
const MOST_WIDE: usize = 64;

/// The joints of a world as its solver visits them. Flat arrays; indices are absolute.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Topology {
    /// Islands that are solved directly.
    pub islands: Vec<JointIsland>,
    /// Their blocks in the order of elimination.
    pub blocks: Vec<JointBlock>,
    /// First block of each level of each island, and the end.
    pub levels: Vec<u32>,
    /// Blocks of the factor below the diagonal, by column.
    pub entries: Vec<JointEntry>,
    /// What is taken from an entry: pairs of entries, row and column.
    pub terms: Vec<[u32; 2]>,
    /// Entries of each row and the blocks of their columns.
    pub rows: Vec<[u32; 2]>,
    /// Slots of the joints: first those of the direct islands, island by island, then those of the batches.
    pub joints: Vec<u32>,
    /// Bodies that joints move: first those of the direct islands, island by island.
    pub bodies: Vec<JointBody>,
    /// Joints at those bodies: twice the place in `joints`, plus one for the second body.
    pub ends: Vec<u32>,
    /// Where in `joints` each batch of Gauss-Seidel begins, and the end. No two joints of one share a body that moves.
    pub batches: Vec<u32>,
    /// Pairs of bodies that do not collide, lower slot first, ascending.
    pub apart: Vec<[u32; 2]>,
    /// Pairs of bodies with a joint between them, broken or not, lower slot first, ascending.
    pub joined: Vec<[u32; 2]>,
    /// Islands of joints, direct or not.
    pub island_count: u32,
    /// Islands that were to be solved directly, and are too large.
    pub too_large: u32,
}

impl Topology {
    /// How `joints` (by slot) are solved between bodies of which `moves` can be moved, and `held` are held by the world along
    /// or about some axes. Marks joints on cycles, those of which a pair has several, and those
    /// that may lock what is locked already.
    pub fn new(
        joints: &mut [Joint],
        moves: &impl Fn(u32) -> bool,
        held: &impl Fn(u32) -> bool,
        solver: JointSolver,
    ) -> Self {
        let mut topology = Self::default();
        let alive: Vec<u32> =
            (0..joints.len() as u32).filter(|&j| joints[j as usize].flags & joint_bits::ALIVE != 0).collect();
        let mut large = Vec::new();
        for island in islands(joints, &alive, moves) {
            topology.island_count += 1;
            mark_cycles(joints, &island, moves, held);
            mark_overlocked(joints, &island, moves);
            let direct = match solver {
                JointSolver::GaussSeidel => None,
                JointSolver::Auto | JointSolver::Direct => order(joints, &island, moves),
            };
            match direct {
                Some((nodes, elimination)) => topology.push_direct(joints, &island, moves, &nodes, &elimination),
                None => large.push(island),
            }
        }
        topology.too_large = if solver == JointSolver::GaussSeidel { 0 } else { large.len() as u32 };
        topology.push_batches(joints, &large, moves);
        topology.apart = pairs(joints, &alive, joint_bits::APART);
        topology.joined = pairs(joints, &alive, joint_bits::ALIVE);
        topology
    }

    fn push_direct(
        &mut self,
        joints: &[Joint],
        island: &[u32],
        moves: &impl Fn(u32) -> bool,
        nodes: &[u32],
        elimination: &Elimination,
    ) {
        let (first_block, first_level) = (self.blocks.len() as u32, self.levels.len() as u32);
        self.levels.extend(elimination.levels.iter().map(|k| k + first_block));
        let first_entry = self.entries.len() as u32;
        let first_joint = self.joints.len() as u32;
        let row_of = |position: u32| nodes[elimination.order[position as usize] as usize];
        // Places are in the order of the island, which ascends.
        let place_of = |slot: u32| first_joint + island.partition_point(|&j| j < slot) as u32;
        // Entries by column, and where each lies.
        let mut places: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for (k, column) in elimination.columns.iter().enumerate() {
            for &i in column {
                places.insert((i, k as u32), first_entry + places.len() as u32);
            }
        }
        let mut by_column: Vec<(u32, u32)> = places.keys().copied().collect();
        by_column.sort_unstable_by_key(|&(i, k)| (k, i));
        // What each place takes from earlier columns.
        let mut terms: BTreeMap<(u32, u32), Vec<[u32; 2]>> = BTreeMap::new();
        let mut rows: Vec<Vec<[u32; 2]>> = vec![Vec::new(); nodes.len()];
        for (j, column) in elimination.columns.iter().enumerate() {
            for (x, &i) in column.iter().enumerate() {
                rows[i as usize].push([places[&(i, j as u32)], first_block + j as u32]);
                for &k in &column[..=x] {
                    terms.entry((i, k)).or_default().push([places[&(i, j as u32)], places[&(k, j as u32)]]);
                }
            }
        }
        let mut push_terms = |place: (u32, u32), all: &mut Vec<[u32; 2]>| {
            let own = terms.remove(&place).unwrap_or_default();
            let first = all.len() as u32;
            all.extend(&own);
            [first, own.len() as u32]
        };
        let mut entry = first_entry;
        for (k, column) in elimination.columns.iter().enumerate() {
            let [first_term, term_count] = push_terms((k as u32, k as u32), &mut self.terms);
            let row = row_of(k as u32);
            let first_row = self.rows.len() as u32;
            self.rows.append(&mut rows[k]);
            self.blocks.push(JointBlock {
                row: 2 * place_of(row / 2) + row % 2,
                first_entry: entry,
                entry_count: column.len() as u32,
                first_term,
                term_count,
                first_row,
                row_count: self.rows.len() as u32 - first_row,
                pad_a: 0,
            });
            entry += column.len() as u32;
        }
        for (i, k) in by_column {
            let [first_term, term_count] = push_terms((i, k), &mut self.terms);
            let shared_bodies = shared(joints, row_of(i) / 2, row_of(k) / 2, moves);
            self.entries.push(JointEntry {
                row: first_block + i,
                column: first_block + k,
                first_term,
                term_count,
                shared_bodies,
                pad_a: [0; 2],
            });
        }
        let first_body = self.bodies.len() as u32;
        self.joints.extend(island);
        self.push_bodies(joints, first_joint, moves, 1);
        self.islands.push(JointIsland {
            first_block,
            block_count: nodes.len() as u32,
            first_level,
            level_count: elimination.levels.len() as u32 - 1,
            first_joint,
            joint_count: island.len() as u32,
            first_body,
            body_count: self.bodies.len() as u32 - first_body,
        });
    }

    /// The bodies of the joints from place `first` on.
    fn push_bodies(&mut self, joints: &[Joint], first: u32, moves: &impl Fn(u32) -> bool, direct: u32) {
        let mut at: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for place in first..self.joints.len() as u32 {
            let joint = &joints[self.joints[place as usize] as usize];
            for (end, body) in [joint.body_a, joint.body_b].into_iter().enumerate().filter(|&(_, body)| moves(body)) {
                at.entry(body).or_default().push(2 * place + end as u32);
            }
        }
        for (body, ends) in at {
            self.bodies.push(JointBody {
                body,
                first_end: self.ends.len() as u32,
                end_count: ends.len() as u32,
                direct,
            });
            self.ends.extend(ends);
        }
    }

    /// Colours the joints of large islands: each takes the lowest batch that neither of its bodies is in.
    fn push_batches(&mut self, joints: &[Joint], large: &[Vec<u32>], moves: &impl Fn(u32) -> bool) {
        let mut batches: Vec<Vec<u32>> = Vec::new();
        let mut taken: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
        for island in large {
            for &j in island {
                let joint = &joints[j as usize];
                let ends: Vec<u32> = [joint.body_a, joint.body_b].into_iter().filter(|&body| moves(body)).collect();
                let is_free = |batch: usize| ends.iter().all(|b| !taken.get(b).is_some_and(|t| t.contains(&batch)));
                let batch = (0..).find(|&batch| is_free(batch)).unwrap_or(0);
                if batch == batches.len() {
                    batches.push(Vec::new());
                }
                batches[batch].push(j);
                ends.iter().for_each(|&body| _ = taken.entry(body).or_default().insert(batch));
            }
        }
        batches.sort_by_key(|batch| std::cmp::Reverse(batch.len()));
        self.batches = vec![self.joints.len() as u32];
        for batch in batches {
            self.joints.extend(batch);
            self.batches.push(self.joints.len() as u32);
        }
        self.push_bodies(joints, self.batches[0], moves, 0);
    }

    /// Number of joints that are solved directly.
    pub fn direct_joints(&self) -> u32 {
        self.batches.first().copied().unwrap_or(0)
    }

    /// Number of joints.
    pub fn joint_count(&self) -> u32 {
        self.joints.len() as u32
    }

    /// Bodies of islands that are solved directly; the others follow.
    pub fn direct_bodies(&self) -> u32 {
        self.islands.last().map_or(0, |island| island.first_body + island.body_count)
    }

    /// All tables as words, one behind the other, and where each begins.
    pub fn pack(&self) -> (JointTables, Vec<u32>) {
        let mut words: Vec<u32> = Vec::new();
        let mut push = |table: &[u32]| {
            let first = words.len() as u32;
            words.extend_from_slice(table);
            first
        };
        let wide = self.batches.windows(2).take_while(|batch| batch[1] - batch[0] >= WIDE_JOINTS);
        let tables = JointTables {
            islands: push(bytemuck::cast_slice(&self.islands)),
            blocks: push(bytemuck::cast_slice(&self.blocks)),
            levels: push(&self.levels),
            entries: push(bytemuck::cast_slice(&self.entries)),
            terms: push(bytemuck::cast_slice(&self.terms)),
            rows: push(bytemuck::cast_slice(&self.rows)),
            joints: push(&self.joints),
            bodies: push(bytemuck::cast_slice(&self.bodies)),
            ends: push(&self.ends),
            batches: push(&self.batches),
            island_count: self.islands.len() as u32,
            block_count: self.blocks.len() as u32,
            entry_count: self.entries.len() as u32,
            joint_count: self.joint_count(),
            direct_joints: self.direct_joints(),
            body_count: self.bodies.len() as u32,
            direct_bodies: self.direct_bodies(),
            batch_count: self.batches.len().saturating_sub(1) as u32,
            wide_batches: wide.count().min(MOST_WIDE) as u32,
            pad_a: 0,
        };
        (tables, words)
    }

    /// Whether these two bodies are kept from colliding by a joint.
    pub fn keeps_apart(&self, a: u32, b: u32) -> bool {
        self.apart.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }
}

/// The rows of a joint: twice its slot for those along, plus one for those about. Only those that something may act on.
fn rows_of(joint: &Joint, slot: u32) -> impl Iterator<Item = u32> {
    let used = joint.axes >> joint_bits::LOCKED | joint.axes >> joint_bits::DRIVEN;
    let (along, about) = (used & 7 != 0, used >> 3 & 7 != 0);
    [along.then_some(2 * slot), about.then_some(2 * slot + 1)].into_iter().flatten()
}

/// Nodes of the island and their order, or none when it is too large for that.
fn order(joints: &[Joint], island: &[u32], moves: &impl Fn(u32) -> bool) -> Option<(Vec<u32>, Elimination)> {
    let nodes: Vec<u32> = island.iter().flat_map(|&j| rows_of(&joints[j as usize], j)).collect();
    if nodes.len() > MOST_BLOCKS {
        return None;
    }
    let mut at: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (node, row) in nodes.iter().enumerate() {
        let joint = &joints[*row as usize / 2];
        for body in [joint.body_a, joint.body_b].into_iter().filter(|&body| moves(body)) {
            at.entry(body).or_default().push(node as u32);
        }
    }
    let mut neighbours = vec![BTreeSet::new(); nodes.len()];
    for beside in at.values() {
        for &x in beside {
            neighbours[x as usize].extend(beside.iter().copied().filter(|&y| y != x));
        }
    }
    Elimination::new(&neighbours).map(|elimination| (nodes, elimination))
}

/// Bodies that move and that both joints hold.
fn shared(joints: &[Joint], a: u32, b: u32, moves: &impl Fn(u32) -> bool) -> [u32; 2] {
    let (a, b) = (&joints[a as usize], &joints[b as usize]);
    let held = |body: u32| if moves(body) && [b.body_a, b.body_b].contains(&body) { body } else { NO_BODY };
    [held(a.body_a), held(a.body_b)]
}

/// Joints that hang together by bodies that move, ascending.
fn islands(joints: &[Joint], alive: &[u32], moves: &impl Fn(u32) -> bool) -> Vec<Vec<u32>> {
    let mut above: BTreeMap<u32, u32> = BTreeMap::new();
    fn root(above: &mut BTreeMap<u32, u32>, body: u32) -> u32 {
        let mut at = body;
        while let Some(&next) = above.get(&at).filter(|&&next| next != at) {
            let after = above.get(&next).copied().unwrap_or(next);
            above.insert(at, after);
            at = next;
        }
        at
    }
    for &j in alive {
        let joint = &joints[j as usize];
        if moves(joint.body_a) && moves(joint.body_b) {
            let (a, b) = (root(&mut above, joint.body_a), root(&mut above, joint.body_b));
            above.insert(a.max(b), a.min(b));
        }
    }
    let mut islands: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &j in alive {
        let joint = &joints[j as usize];
        let body = if moves(joint.body_a) { joint.body_a } else { joint.body_b };
        islands.entry(root(&mut above, body)).or_default().push(j);
    }
    islands.into_values().collect()
}

/// Marks the joints of an island without which the bodies would still hang together, what does not move being one body:
/// all edges but the bridges (Tarjan, 1974). What the world holds is joined to what does not move.
fn mark_cycles(joints: &mut [Joint], island: &[u32], moves: &impl Fn(u32) -> bool, held: &impl Fn(u32) -> bool) {
    let node = |body: u32| if moves(body) { body } else { NO_BODY };
    let mut at: BTreeMap<u32, Vec<(u32, u32)>> = BTreeMap::new();
    for &j in island {
        let (a, b) = (node(joints[j as usize].body_a), node(joints[j as usize].body_b));
        at.entry(a).or_default().push((j, b));
        at.entry(b).or_default().push((j, a));
        joints[j as usize].flags |= joint_bits::IN_CYCLE;
    }
    let by_world: Vec<u32> = at.keys().copied().filter(|&body| body != NO_BODY && held(body)).collect();
    for (edge, body) in (joints.len() as u32..).zip(by_world) {
        at.entry(body).or_default().push((edge, NO_BODY));
        at.entry(NO_BODY).or_default().push((edge, body));
    }
    let Some((&start, _)) = at.first_key_value() else { return };
    let mut found: BTreeMap<u32, u32> = BTreeMap::from([(start, 0)]);
    let mut low = found.clone();
    // Body, joint that led to it, next of its joints.
    let mut path = vec![(start, u32::MAX, 0usize)];
    while let Some(&mut (body, by, ref mut next)) = path.last_mut() {
        if let Some(&(j, other)) = at[&body].get(*next) {
            *next += 1;
            if let Some(&seen) = found.get(&other) {
                if j != by {
                    let lowest = seen.min(low[&body]);
                    low.insert(body, lowest);
                }
            } else {
                let number = found.len() as u32;
                found.insert(other, number);
                low.insert(other, number);
                path.push((other, j, 0));
            }
            continue;
        }
        path.pop();
        if let Some(&(parent, ..)) = path.last() {
            let lowest = low[&body].min(low[&parent]);
            low.insert(parent, lowest);
            if low[&body] > found[&parent]
                && let Some(joint) = joints.get_mut(by as usize)
            {
                joint.flags &= !joint_bits::IN_CYCLE;
            }
        }
    }
}

/// Marks the joints of an island whose bodies have others between them, what does not move being one body, and those on
/// cycles that may lock what is locked already: all but ball joints, which are each the only one between bodies that the world
/// does not hold.
fn mark_overlocked(joints: &mut [Joint], island: &[u32], moves: &impl Fn(u32) -> bool) {
    let node = |body: u32| if moves(body) { body } else { NO_BODY };
    let pair = |joint: &Joint| {
        let [a, b] = [joint.body_a, joint.body_b].map(node);
        [a.min(b), a.max(b)]
    };
    let mut counts: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    island.iter().for_each(|&j| *counts.entry(pair(&joints[j as usize])).or_default() += 1);
    for &j in island {
        let joint = &mut joints[j as usize];
        let twice = counts[&pair(joint)] > 1;
        let held = joint.flags & joint_bits::HELD != 0;
        let ball = joint.axes == 7 << joint_bits::LOCKED;
        let overlocked = joint.flags & joint_bits::IN_CYCLE != 0 && (twice || held || !ball);
        joint.flags &= !(joint_bits::TWICE | joint_bits::OVERLOCKED);
        joint.flags |= if twice { joint_bits::TWICE } else { 0 } | if overlocked { joint_bits::OVERLOCKED } else { 0 };
    }
}

/// Pairs of bodies with a joint of this flag between them.
fn pairs(joints: &[Joint], alive: &[u32], flag: u32) -> Vec<[u32; 2]> {
    let of = |&j: &u32| {
        let joint = &joints[j as usize];
        let pair = [joint.body_a.min(joint.body_b), joint.body_a.max(joint.body_b)];
        (joint.flags & flag != 0).then_some(pair)
    };
    alive.iter().filter_map(of).collect::<BTreeSet<_>>().into_iter().collect()
}
