//! In which order the joints of an island are eliminated: the symbolic half of a block LDL^T, done once when joints come
//! or go. Both sides run the list of operations that it leaves.
//!
//! A node is a block of up to three rows of one joint; two nodes are neighbours when their joints share a body that
//! moves. Minimum degree (Tinney and Walker, 1967); of nodes with as few neighbours the one of the lowest level goes
//! first, so that chains are eliminated from both ends and many nodes at once. A node's level is one more than that of
//! the nodes that it takes something from: nodes of a level do not touch each other. The numbering is by level.

use std::collections::BTreeSet;

/// What factoring and solving do, in positions: the place of a node in the order of elimination.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Elimination {
    /// Node at each position.
    pub order: Vec<u32>,
    /// First position of each level, and the end.
    pub levels: Vec<u32>,
    /// Positions below the diagonal that column k of L reaches, ascending.
    pub columns: Vec<Vec<u32>>,
}

/// Most entries below the diagonal, a node, that an island may have on the mean.
pub const MOST_ENTRIES_A_NODE: usize = 16;

impl Elimination {
    /// Eliminates `neighbours.len()` nodes; `None` when that fills in more than pays.
    pub fn new(neighbours: &[BTreeSet<u32>]) -> Option<Self> {
        let count = neighbours.len();
        let mut left = neighbours.to_vec();
        let mut level = vec![0u32; count];
        let mut waiting: BTreeSet<(usize, u32, u32)> =
            (0..count).map(|node| (left[node].len(), 0, node as u32)).collect();
        let mut reached: Vec<Vec<u32>> = vec![Vec::new(); count];
        let mut first = Vec::with_capacity(count);
        let mut entries = 0;
        while let Some((_, _, node)) = waiting.pop_first() {
            let beside: Vec<u32> = std::mem::take(&mut left[node as usize]).into_iter().collect();
            entries += beside.len();
            if entries > MOST_ENTRIES_A_NODE * count {
                return None;
            }
            for &other in &beside {
                let o = other as usize;
                waiting.remove(&(left[o].len(), level[o], other));
                left[o].remove(&node);
                left[o].extend(beside.iter().filter(|&&third| third != other));
                level[o] = level[o].max(level[node as usize] + 1);
                waiting.insert((left[o].len(), level[o], other));
            }
            first.push(node);
            reached[node as usize] = beside;
        }
        let mut order = first;
        order.sort_by_key(|&node| level[node as usize]);
        let mut position = vec![0u32; count];
        order.iter().enumerate().for_each(|(place, &node)| position[node as usize] = place as u32);
        let columns = order
            .iter()
            .map(|&node| {
                let mut rows: Vec<u32> = reached[node as usize].iter().map(|&n| position[n as usize]).collect();
                rows.sort_unstable();
                rows
            })
            .collect();
        let mut levels: Vec<u32> = (0..count as u32)
            .filter(|&k| k == 0 || level[order[k as usize] as usize] != level[order[k as usize - 1] as usize])
            .collect();
        levels.push(count as u32);
        Some(Self { order, levels, columns })
    }
}
