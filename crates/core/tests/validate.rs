//! The validators find what they should. Oracle: analysis (one flaw put into a sound list).

use bytemuck::Zeroable;
use tumble_core::layout::{BATCHES, BodyState, ConstraintHead, LAST_BATCH, NO_NODE, Pair, TreeNode};
use tumble_core::validate::{self, Place, batches, finite_states, sorted_pairs};

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

#[test]
fn lists_of_a_broad_phase() {
    validate::pairs(&[]).unwrap();
    validate::pairs(&[[0, 1], [0, 2], [1, 2], [3, 4]]).unwrap();
    for flawed in [&[[1, 1]][..], &[[2, 1]], &[[0, 1], [0, 1]], &[[0, 2], [0, 1]], &[[1, 2], [0, 9]]] {
        validate::pairs(flawed).expect_err("flawed");
    }
    assert!(validate::pairs(&[[0, 1], [2, 3], [1, 5]]).unwrap_err().contains("pair 2 is (1, 5)"));
}

/// Colliders 0 to 5: two in cell 0, one in cell 2, one large, two nowhere.
fn place(i: u32) -> Place {
    [Place::Cell(0), Place::None, Place::Large, Place::Cell(2), Place::Cell(0), Place::None][i as usize]
}

#[test]
fn cells_of_a_grid() {
    validate::cells(&[0, 0, 0], &[], &[], 0, |_| Place::None).unwrap();
    validate::cells(&[0, 2, 2, 3], &[0, 4, 3], &[2], 6, place).unwrap();
    for (start, entries, large, says) in [
        (&[][..], &[0, 4, 3][..], &[2][..], "begin at None"),
        (&[1, 2, 2, 3], &[0, 4, 3], &[2], "begin at Some(1)"),
        (&[0, 2, 2, 2], &[0, 4, 3], &[2], "end at Some(2) of 3"),
        (&[0, 2, 1, 3], &[0, 4, 3], &[2], "cell 1 begins at 2 and ends at 1"),
        (&[0, 2, 2, 3], &[0, 4, 4], &[2], "collider 4 is at Cell(0) and at Cell(2)"),
        (&[0, 2, 2, 3], &[0, 4, 3], &[3], "collider 3 is at Cell(2) and at Large"),
        (&[0, 2, 2, 3], &[0, 4, 9], &[2], "collider 9 of 6 is at Cell(2)"),
        (&[0, 2, 2, 3], &[0, 4, 3], &[7], "collider 7 of 6 is at Large"),
        (&[0, 1, 2, 3], &[0, 4, 3], &[2], "collider 4 is at Cell(1) and belongs at Cell(0)"),
        (&[0, 2, 2, 3], &[0, 4, 3], &[], "collider 2 is at None and belongs at Large"),
        (&[0, 2, 2, 3], &[0, 4, 3], &[2, 5], "collider 5 is at Large and belongs at None"),
        (&[0, 2, 2, 2], &[0, 4], &[2], "collider 3 is at None and belongs at Cell(2)"),
    ] {
        let error = validate::cells(start, entries, large, 6, place).unwrap_err();
        assert!(error.contains(says), "{error}");
    }
}

/// Box of collider i: from i to i + 1 along each axis.
fn leaf_box(i: u32) -> [[f32; 3]; 2] {
    [[i as f32; 3], [i as f32 + 1.0; 3]]
}

/// Colliders 2, 0, 1 in this order: leaves 0, 2, 4; node 3 over the first two, node 1 over all.
fn sound_tree() -> Vec<TreeNode> {
    let node = |low: f32, high: f32, child, escape| TreeNode { min: [low; 3], child, max: [high; 3], escape };
    vec![
        node(2.0, 3.0, 2, 2),
        node(0.0, 3.0, 3, NO_NODE),
        node(0.0, 1.0, 0, 4),
        node(0.0, 3.0, 0, 4),
        node(1.0, 2.0, 1, NO_NODE),
    ]
}

#[test]
fn trees() {
    validate::tree(&[], 0, leaf_box).unwrap();
    validate::tree(&[TreeNode { child: 5, escape: NO_NODE, min: [5.0; 3], max: [6.0; 3] }], 1, leaf_box).unwrap();
    validate::tree(&sound_tree(), 3, leaf_box).unwrap();
    type Flaw = fn(&mut Vec<TreeNode>);
    let flaws: [(Flaw, &str); 12] = [
        (|t| t.truncate(4), "4 nodes are too few for 3 leaves"),
        (|t| t[1].escape = 4, "node 1 escapes to 4"),
        (|t| t[4].escape = 0, "node 4 escapes to 0"),
        (|t| t[0].escape = 4, "node 3 is not the union"),
        (
            |t| [1, 3].into_iter().for_each(|i| t[i].max[1] = 2.5),
            "node 3 is not the union of its children along axis 1",
        ),
        (|t| t[1].min[2] = -0.5, "node 1 is not the union of its children along axis 2"),
        (|t| t[2].max[0] = 0.5, "leaf 1 (collider 0) has not the collider's box"),
        (|t| t[4].child = 3, "leaf 2 (collider 3) has not the collider's box"),
        (|t| t[3].child = 77, "node 3: left child 77"),
        (|t| t[3].escape = 77, "node 1: right child 77"),
        (|t| t[3].child = 3, "more than 5 nodes hang on the root"),
        (|t| (t[3].child, t[2].escape, t[0].escape) = (2, 0, 4), "leaf 1 comes where leaf 0 should"),
    ];
    for (flaw, says) in flaws {
        let mut tree = sound_tree();
        flaw(&mut tree);
        let error = validate::tree(&tree, 3, leaf_box).expect_err(says);
        println!("{error}");
        assert!(error.contains(says), "{error}, and not {says}");
    }
    let mut longer = sound_tree();
    longer.extend([TreeNode::zeroed(); 2]);
    assert!(validate::tree(&longer, 4, leaf_box).unwrap_err().contains("3 of 4 leaves hang on the root"));
}
