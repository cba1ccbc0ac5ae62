//! The validators find what they should. Oracle: analysis (one flaw put into a sound list).

use bytemuck::Zeroable;
use tumble_core::layout::{BATCHES, BodyState, ConstraintHead, LAST_BATCH, Pair};
use tumble_core::validate::{batches, finite_states, sorted_pairs};

fn pairs(list: &[(u32, u32)]) -> Vec<Pair> {
    list.iter().map(|&(a, b)| Pair { a, b, ..Pair::zeroed() }).collect()
}

#[test]
fn pair_lists() {
    sorted_pairs(&[]).unwrap();
    sorted_pairs(&pairs(&[(0, 1), (0, 2), (1, 2), (1, 9), (3, 4)])).unwrap();
    for flawed in [&[(1, 1)][..], &[(2, 1)], &[(0, 1), (0, 1)], &[(0, 2), (0, 1)], &[(1, 2), (0, 9)]] {
        sorted_pairs(&pairs(flawed)).expect_err("flawed");
    }
    assert!(sorted_pairs(&pairs(&[(0, 1), (2, 3), (1, 5)])).unwrap_err().contains("pair 2 is (1, 5)"));
}

fn heads(list: &[(u32, u32)]) -> Vec<ConstraintHead> {
    list.iter().map(|&(body_a, body_b)| ConstraintHead { body_a, body_b, ..ConstraintHead::zeroed() }).collect()
}

/// Body 0 is the floor.
fn moves(body: u32) -> bool {
    body != 0
}

#[test]
fn batch_lists() {
    batches(&[], &[0], moves).unwrap();
    let sound = heads(&[(0, 1), (0, 2), (3, 4), (1, 2), (1, 3)]);
    batches(&sound, &[0, 3, 4, 5], moves).unwrap();
    batches(&sound, &[0, 3, 3, 4, 5], moves).unwrap();
    let error = batches(&sound, &[0, 4, 5], moves).unwrap_err();
    assert!(error.contains("batch 0") && error.contains("share body 1"), "{error}");
    batches(&sound, &[0, 3, 5], moves).expect_err("body 1 twice in batch 1");
    batches(&sound, &[0, 3, 4, 5], |_| true).expect_err("body 0 moves too");
    batches(&heads(&[(3, 3)]), &[0, 1], moves).expect_err("a body against itself");
    for (starts, says) in [
        (&[][..], "first batch starts at None"),
        (&[1, 5], "first batch starts at Some(1)"),
        (&[0, 3, 2, 5], "batch 1 starts at 3 and ends at 2"),
        (&[0, 3], "end at Some(3) of 5"),
        (&[0, 3, 4, 6], "end at Some(6) of 5"),
    ] {
        let error = batches(&sound, starts, moves).unwrap_err();
        assert!(error.contains(says), "{error}");
    }
}

/// The last batch is solved in sequence, so bodies may be shared in it, and in no other.
#[test]
fn only_the_last_batch_may_share_bodies() {
    let hub = heads(&[(1, 2), (1, 3), (1, 4)]);
    let mut starts = vec![0; BATCHES as usize + 1];
    starts[BATCHES as usize] = 3;
    batches(&hub, &starts, moves).unwrap();
    starts[LAST_BATCH as usize] = 3;
    batches(&hub, &starts, moves).expect_err("all in the batch before");
}

#[test]
fn states() {
    finite_states(&[]).unwrap();
    let sound = vec![BodyState::zeroed(); 3];
    finite_states(&sound).unwrap();
    type Flaw = fn(&mut BodyState, f32);
    let flaws: [(&str, Flaw); 6] = [
        ("position", |s, x| s.position[2] = x),
        ("rotation", |s, x| s.rotation[3] = x),
        ("linear_velocity", |s, x| s.linear_velocity[0] = x),
        ("angular_velocity", |s, x| s.angular_velocity[1] = x),
        ("force", |s, x| s.force[0] = x),
        ("torque", |s, x| s.torque[2] = x),
    ];
    for (field, flaw) in flaws {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut states = sound.clone();
            flaw(&mut states[1], bad);
            let error = finite_states(&states).expect_err(field);
            assert!(error.starts_with(&format!("state 1: {field} is ")), "{error}");
        }
    }
}
