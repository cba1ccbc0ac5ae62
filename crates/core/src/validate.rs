//! Checks of the flat arrays between passes: what each pass may rely on. Each says in words what is wrong first.

use crate::layout::{BodyState, ConstraintHead, LAST_BATCH, NO_NODE, Pair, TreeNode, root_of};
use std::collections::HashMap;

/// Every pair has `a < b`, and the list rises strictly by (a, b).
pub fn sorted_pairs(pairs: &[Pair]) -> Result<(), String> {
    rises(pairs.iter().map(|pair| (pair.a, pair.b)))
}

/// The same of a list of collider slots (a, b), as broad phases leave it.
pub fn pairs(pairs: &[[u32; 2]]) -> Result<(), String> {
    rises(pairs.iter().map(|&[a, b]| (a, b)))
}

fn rises(pairs: impl Iterator<Item = (u32, u32)>) -> Result<(), String> {
    let mut before = None;
    for (i, pair) in pairs.enumerate() {
        if pair.0 >= pair.1 {
            return Err(format!("pair {i} is {pair:?}: a must be below b"));
        }
        if let Some(before) = before.filter(|before| *before >= pair) {
            return Err(format!("pair {i} is {pair:?} and does not come after {before:?}"));
        }
        before = Some(pair);
    }
    Ok(())
}

/// No two constraints of one batch share a body that moves, the last batch (index [`LAST_BATCH`]) excepted.
/// Batch k is `heads[batch_start[k]..batch_start[k + 1]]`; the starts begin at 0, never fall and end at
/// `heads.len()`, so hand over as many as are in use (`BATCHES + 1` of the array in `Control`). `moves` tells
/// whether the body of an index can be pushed.
pub fn batches(heads: &[ConstraintHead], batch_start: &[u32], moves: impl Fn(u32) -> bool) -> Result<(), String> {
    if batch_start.first() != Some(&0) {
        return Err(format!("the first batch starts at {:?}, not at 0", batch_start.first()));
    }
    if let Some(k) = batch_start.windows(2).position(|two| two[0] > two[1]) {
        return Err(format!("batch {k} starts at {} and ends at {}", batch_start[k], batch_start[k + 1]));
    }
    if batch_start.last().map(|&end| end as usize) != Some(heads.len()) {
        return Err(format!("the batches end at {:?} of {} constraints", batch_start.last(), heads.len()));
    }
    // Body -> the batch and the constraint that last touched it.
    let mut touched: HashMap<u32, (usize, usize)> = HashMap::new();
    for (batch, range) in batch_start.windows(2).enumerate() {
        let (start, end) = (range[0] as usize, range[1] as usize);
        for (i, head) in (start..).zip(&heads[start..end]) {
            if head.body_a == head.body_b {
                return Err(format!("constraint {i} holds body {} against itself", head.body_a));
            }
            if batch == LAST_BATCH as usize {
                continue;
            }
            for body in [head.body_a, head.body_b].into_iter().filter(|&body| moves(body)) {
                match touched.insert(body, (batch, i)) {
                    Some((before, other)) if before == batch => {
                        return Err(format!("batch {batch}: constraints {other} and {i} share body {body}"));
                    }
                    _ => {}
                }
            }
        }
    }
    Ok(())
}

/// Every float of every state is finite, empty slots included.
pub fn finite_states(states: &[BodyState]) -> Result<(), String> {
    for (i, state) in states.iter().enumerate() {
        let fields: [(&str, &[f32]); 6] = [
            ("position", &state.position),
            ("rotation", &state.rotation),
            ("linear_velocity", &state.linear_velocity),
            ("angular_velocity", &state.angular_velocity),
            ("force", &state.force),
            ("torque", &state.torque),
        ];
        for (field, values) in fields {
            if !values.iter().all(|x| x.is_finite()) {
                return Err(format!("state {i}: {field} is {values:?}"));
            }
        }
    }
    Ok(())
}

/// Where a collider belongs in a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Nowhere: it is no live collider, or has no end.
    None,
    /// In this cell of the table.
    Cell(usize),
    /// In the list of those larger than a cell.
    Large,
}

/// Cells of a grid: `start` rises from 0 to the number of entries, and each of `colliders` colliders stands exactly where
/// `place` says.
pub fn cells(
    start: &[u32],
    entries: &[u32],
    large: &[u32],
    colliders: u32,
    place: impl Fn(u32) -> Place,
) -> Result<(), String> {
    if start.first() != Some(&0) || start.last().map(|&end| end as usize) != Some(entries.len()) {
        return Err(format!("cells begin at {:?} and end at {:?} of {}", start.first(), start.last(), entries.len()));
    }
    if let Some(cell) = start.windows(2).position(|two| two[0] > two[1]) {
        return Err(format!("cell {cell} begins at {} and ends at {}", start[cell], start[cell + 1]));
    }
    let mut found = vec![Place::None; colliders as usize];
    let mut stand = |i: u32, at: Place| match found.get_mut(i as usize) {
        None => Err(format!("collider {i} of {colliders} is at {at:?}")),
        Some(seen) if *seen != Place::None => Err(format!("collider {i} is at {seen:?} and at {at:?}")),
        Some(seen) => {
            *seen = at;
            Ok(())
        }
    };
    for (cell, range) in start.windows(2).enumerate() {
        entries[range[0] as usize..range[1] as usize].iter().try_for_each(|&i| stand(i, Place::Cell(cell)))?;
    }
    large.iter().try_for_each(|&i| stand(i, Place::Large))?;
    match (0..colliders).find(|&i| found[i as usize] != place(i)) {
        Some(i) => Err(format!("collider {i} is at {:?} and belongs at {:?}", found[i as usize], place(i))),
        None => Ok(()),
    }
}

/// A tree over `count` leaves: from the root, each node comes once, children lie within their node's box, leaves have the
/// boxes that `leaf_box` (lower and upper corner by collider) gives, the last leaf's escape ends the walk, and walking
/// from left to right by escapes meets the leaves in order.
pub fn tree(nodes: &[TreeNode], count: u32, leaf_box: impl Fn(u32) -> [[f32; 3]; 2]) -> Result<(), String> {
    let root = root_of(count);
    if root == NO_NODE {
        return Ok(());
    }
    if nodes.len() < 2 * count as usize - usize::from(count > 0) {
        return Err(format!("{} nodes are too few for {count} leaves", nodes.len()));
    }
    let mut stack = vec![(root, NO_NODE)];
    let (mut next_leaf, mut seen) = (0, 0u32);
    while let Some((id, escape)) = stack.pop() {
        let node = nodes.get(id as usize).ok_or_else(|| format!("node {id} of {}", nodes.len()))?;
        seen += 1;
        if seen > 2 * count - 1 {
            return Err(format!("more than {} nodes hang on the root", 2 * count - 1));
        }
        if node.escape != escape {
            return Err(format!("node {id} escapes to {} and not to {escape}", node.escape));
        }
        if id % 2 == 0 {
            if id / 2 != next_leaf {
                return Err(format!("leaf {} comes where leaf {next_leaf} should", id / 2));
            }
            next_leaf += 1;
            let [min, max] = leaf_box(node.child);
            if (node.min, node.max) != (min, max) {
                return Err(format!("leaf {} (collider {}) has not the collider's box", id / 2, node.child));
            }
            continue;
        }
        let left = nodes.get(node.child as usize).ok_or_else(|| format!("node {id}: left child {}", node.child))?;
        let right = nodes.get(left.escape as usize).ok_or_else(|| format!("node {id}: right child {}", left.escape))?;
        for i in 0..3 {
            if node.min[i] != left.min[i].min(right.min[i]) || node.max[i] != left.max[i].max(right.max[i]) {
                return Err(format!("node {id} is not the union of its children along axis {i}"));
            }
        }
        stack.push((left.escape, escape));
        stack.push((node.child, left.escape));
    }
    match next_leaf == count {
        true => Ok(()),
        false => Err(format!("{next_leaf} of {count} leaves hang on the root")),
    }
}
