//! What is done for an island that is solved directly, with indices of its own: worked out when joints come or go. Islands
//! of one plan can be solved side by side (`island_lanes`).

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use tumble_core::layout::{JointEntry, JointIsland, NO_BODY};
use tumble_core::{JointSet, Topology};

/// The joints, bodies and blocks of an island, and in which order its system is eliminated.
#[derive(Debug, Default, PartialEq, Eq, Hash)]
pub struct Plan {
    /// Axes and flags of each joint.
    pub kinds: Vec<[u32; 2]>,
    /// Bodies of each joint: first those that joints move, then others that they hold.
    pub ends: Vec<[usize; 2]>,
    /// Where in `joints_at` each body that moves begins, and the end.
    pub first_joint: Vec<usize>,
    /// The joints at those bodies: twice the joint, plus one for its second body.
    pub joints_at: Vec<usize>,
    /// Blocks of the diagonal in the order of elimination.
    pub blocks: Vec<PlanBlock>,
    /// Blocks below it, by column.
    pub entries: Vec<PlanEntry>,
    /// What is taken from a block: pairs of entries, row and column.
    pub terms: Vec<[usize; 2]>,
    /// Entries of each row, and the blocks of their columns.
    pub rows: Vec<[usize; 2]>,
}

/// A block on the diagonal.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct PlanBlock {
    /// Its joint.
    pub joint: usize,
    /// 0 for its rows along, 1 for those about.
    pub which: usize,
    /// Entries below it.
    pub entries: Range<usize>,
    /// Terms taken from it.
    pub terms: Range<usize>,
    /// Entries left of it, in `rows`.
    pub rows: Range<usize>,
}

/// A block below the diagonal.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct PlanEntry {
    /// Block of its row.
    pub row: usize,
    /// Block of its column.
    pub column: usize,
    /// Bodies that both joints hold.
    pub shared: Vec<SharedBody>,
    /// Terms taken from it.
    pub terms: Range<usize>,
}

/// A body that two joints hold.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct SharedBody {
    /// Which.
    pub body: usize,
    /// Whether it is the second one of the row's joint, and of the column's.
    pub second: [bool; 2],
}

impl Plan {
    /// The plan of an island, and the slots of its bodies.
    fn of(set: &JointSet, info: &JointIsland) -> (Self, Vec<u32>) {
        let topology = &*set.topology;
        let first = info.first_joint as usize;
        let joints = &topology.joints[first..][..info.joint_count as usize];
        let own = &topology.bodies[info.first_body as usize..][..info.body_count as usize];
        let mut slots: Vec<u32> = own.iter().map(|body| body.body).collect();
        let mut plan = Self { first_joint: vec![0], ..Self::default() };
        for body in own {
            let at = &topology.ends[body.first_end as usize..][..body.end_count as usize];
            plan.joints_at.extend(at.iter().map(|&end| end as usize - 2 * first));
            plan.first_joint.push(plan.joints_at.len());
        }
        for &slot in joints {
            let joint = &set.joints[slot as usize];
            plan.kinds.push([joint.axes, joint.flags]);
            plan.ends.push([joint.body_a, joint.body_b].map(|body| {
                own.binary_search_by_key(&body, |b| b.body).unwrap_or_else(|_| {
                    slots.push(body);
                    slots.len() - 1
                })
            }));
        }
        plan.push_blocks(topology, info, &slots);
        (plan, slots)
    }

    fn push_blocks(&mut self, topology: &Topology, info: &JointIsland, slots: &[u32]) {
        let blocks = &topology.blocks[info.first_block as usize..][..info.block_count as usize];
        let first_entry = blocks.first().map_or(0, |block| block.first_entry) as usize;
        for block in blocks {
            let row = block.row as usize - 2 * info.first_joint as usize;
            let terms = self.push_terms(topology, first_entry, block.first_term, block.term_count);
            let first_row = self.rows.len();
            for [entry, column] in &topology.rows[block.first_row as usize..][..block.row_count as usize] {
                self.rows.push([*entry as usize - first_entry, (column - info.first_block) as usize]);
            }
            let rows = first_row..self.rows.len();
            let entry = block.first_entry as usize - first_entry;
            let entries = entry..entry + block.entry_count as usize;
            self.blocks.push(PlanBlock { joint: row / 2, which: row % 2, entries, terms, rows });
        }
        let count = self.blocks.iter().map(|block| block.entries.len()).sum();
        for entry in &topology.entries[first_entry..][..count] {
            let [row, column] = [entry.row, entry.column].map(|block| (block - info.first_block) as usize);
            let shared = self.shared_by(entry, row, column, slots);
            let terms = self.push_terms(topology, first_entry, entry.first_term, entry.term_count);
            self.entries.push(PlanEntry { row, column, shared, terms });
        }
    }

    fn push_terms(&mut self, topology: &Topology, first_entry: usize, first: u32, count: u32) -> Range<usize> {
        let start = self.terms.len();
        let terms = &topology.terms[first as usize..][..count as usize];
        self.terms.extend(terms.iter().map(|term| term.map(|entry| entry as usize - first_entry)));
        start..self.terms.len()
    }

    fn shared_by(&self, entry: &JointEntry, row: usize, column: usize, slots: &[u32]) -> Vec<SharedBody> {
        let [i, j] = [row, column].map(|block| self.ends[self.blocks[block].joint]);
        let held = entry.shared_bodies.into_iter().filter(|&slot| slot != NO_BODY);
        held.map(|slot| {
            let [first_i, first_j] = [i, j].map(|ends| slots[ends[0]] == slot);
            SharedBody { body: i[usize::from(!first_i)], second: [!first_i, !first_j] }
        })
        .collect()
    }

    /// How many bodies joints move.
    pub fn moved(&self) -> usize {
        self.first_joint.len() - 1
    }

    /// The joints at a body.
    pub fn at(&self, body: usize) -> &[usize] {
        &self.joints_at[self.first_joint[body]..self.first_joint[body + 1]]
    }
}

/// Islands of one plan.
#[derive(Debug)]
pub struct Alike {
    /// What is done for each.
    pub plan: Arc<Plan>,
    /// Their places in the topology.
    pub islands: Vec<usize>,
    /// The slots of the bodies of each.
    pub slots: Vec<Vec<u32>>,
}

/// The plans of all islands, in the order of the first island of each.
pub fn plans(set: &JointSet) -> Vec<Alike> {
    let mut all: Vec<Alike> = Vec::new();
    let mut known: HashMap<Arc<Plan>, usize> = HashMap::new();
    for (island, info) in set.topology.islands.iter().enumerate() {
        let (plan, slots) = Plan::of(set, info);
        let plan = Arc::new(plan);
        let place = *known.entry(Arc::clone(&plan)).or_insert_with(|| {
            all.push(Alike { plan, islands: Vec::new(), slots: Vec::new() });
            all.len() - 1
        });
        all[place].islands.push(island);
        all[place].slots.push(slots);
    }
    all
}
