//! Write and verify as in the talk (Harada, "Parallelizing the Physics Pipeline", GDC 2009), where of those who write
//! to a body at once the last one wins: timing decides, here played by random numbers. It shows what the deterministic
//! form costs and what it saves; the product has no such pass. There are as many batches here as it takes.

use tumble::{RigidBodyType, cpu};
use tumble_core::limits::TRIES;

/// The constraints, each with the moving bodies that it is on.
pub(crate) struct Graph {
    ends: Vec<Vec<usize>>,
    bodies: usize,
}

/// How one run ended.
pub(crate) struct Batched {
    pub(crate) batches: usize,
    pub(crate) rounds: usize,
    of: Vec<usize>,
}

impl Graph {
    pub(crate) fn of(world: &mut cpu::World) -> Self {
        let contacts = world.contacts().expect("contacts");
        let scene = world.scene();
        let handles: Vec<_> = scene.bodies().collect();
        let place: std::collections::HashMap<_, _> = handles.iter().enumerate().map(|(i, body)| (*body, i)).collect();
        let moving = |body| scene.body(body).is_ok_and(|body| body.body_type == RigidBodyType::Dynamic);
        let ends = |c: &tumble::Contact| {
            [c.body_a, c.body_b].into_iter().filter(|&body| moving(body)).map(|body| place[&body]).collect()
        };
        Self { ends: contacts.all.iter().map(ends).collect(), bodies: handles.len() }
    }

    pub(crate) fn len(&self) -> usize {
        self.ends.len()
    }

    /// Batch after batch, each in a few rounds: all that wait write themselves to their bodies in any order, and join
    /// if they find themselves there.
    pub(crate) fn batch(&self, seed: u64) -> Batched {
        let mut random = seed;
        let mut of = vec![usize::MAX; self.len()];
        let mut waiting: Vec<usize> = (0..self.len()).collect();
        let mut written = vec![usize::MAX; self.bodies];
        let (mut batches, mut rounds) = (0, 0);
        while !waiting.is_empty() {
            let mut taken = vec![false; self.bodies];
            for _ in 0..TRIES {
                // Who writes last.
                for i in (1..waiting.len()).rev() {
                    random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    waiting.swap(i, (random >> 33) as usize % (i + 1));
                }
                let is_free = |taken: &[bool], i: usize| self.ends[i].iter().all(|&body| !taken[body]);
                for &i in waiting.iter().filter(|&&i| is_free(&taken, i)) {
                    self.ends[i].iter().for_each(|&body| written[body] = i);
                }
                waiting.retain(|&i| {
                    let won = is_free(&taken, i) && self.ends[i].iter().all(|&body| written[body] == i);
                    if won {
                        self.ends[i].iter().for_each(|&body| taken[body] = true);
                        of[i] = batches;
                    }
                    !won
                });
                rounds += 1;
                if waiting.is_empty() {
                    break;
                }
            }
            batches += 1;
        }
        Batched { batches, rounds, of }
    }
}

/// Share of the constraints that a run puts into another batch than the run before it.
pub(crate) fn share_elsewhere(runs: &[Batched]) -> f64 {
    let (mut elsewhere, mut all) = (0, 0);
    for two in runs.windows(2) {
        elsewhere += two[0].of.iter().zip(&two[1].of).filter(|(a, b)| a != b).count();
        all += two[0].of.len();
    }
    elsewhere as f64 / all.max(1) as f64
}
