//! Checks of the flat arrays between passes: what each pass may rely on. Each says in words what is wrong first.

use crate::layout::{BodyState, ConstraintHead, LAST_BATCH, Pair};
use std::collections::HashMap;

/// Every pair has `a < b`, and the list rises strictly by (a, b).
pub fn sorted_pairs(pairs: &[Pair]) -> Result<(), String> {
    for (i, pair) in pairs.iter().enumerate() {
        if pair.a >= pair.b {
            return Err(format!("pair {i} is ({}, {}): a must be below b", pair.a, pair.b));
        }
    }
    for (i, two) in pairs.windows(2).enumerate() {
        if (two[0].a, two[0].b) >= (two[1].a, two[1].b) {
            let (before, after) = ((two[0].a, two[0].b), (two[1].a, two[1].b));
            return Err(format!("pair {} is {after:?} and does not come after {before:?}", i + 1));
        }
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
