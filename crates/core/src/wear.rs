//! When a tree that is only refitted is due for a new build.

use std::collections::VecDeque;

/// Turns that walks take for each leaf in the time by which a build takes longer than a refit: what a build must save to pay
/// for itself. 2 to 28, mostly 8 to 16, on a CPU of two cores (`docs/broadphase.md`).
const BUILD_TURNS: u64 = 15;

/// Adds up the turns that walking a tree takes beyond those right after it was built; when they would have paid for a new
/// build, one is due. At worst this costs twice what knowing the future would.
#[derive(Debug, Clone, Default)]
pub struct Wear {
    /// Turns of the step in which it was built.
    fresh: Option<u32>,
    extra: u64,
    /// Turns by step, for those that look back.
    seen: VecDeque<(u32, u32)>,
    built: u32,
}

impl Wear {
    /// The tree is built anew in this step.
    pub fn built(&mut self, step: u32) {
        *self = Self { built: step, ..Self::default() };
    }

    /// Walking took so many turns in this step; steps come in order. Those before the build are of another tree.
    pub fn walked(&mut self, step: u32, turns: u32) {
        if step >= self.built {
            self.seen.push_back((step, turns));
        }
    }

    /// Whether a build is due for a tree of so many leaves, by what was seen up to step `until` alone.
    pub fn is_due(&mut self, until: u32, leaves: u32) -> bool {
        while let Some(&(_, turns)) = self.seen.front().filter(|(step, _)| *step <= until) {
            self.seen.pop_front();
            let fresh = *self.fresh.get_or_insert(turns);
            self.extra += u64::from(turns.saturating_sub(fresh));
        }
        self.extra > BUILD_TURNS * u64::from(leaves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_build_is_due_when_the_extra_turns_would_have_paid_for_it() {
        let mut wear = Wear::default();
        wear.built(5);
        wear.walked(4, 90_000); // the tree before
        wear.walked(5, 1000);
        assert!(!wear.is_due(5, 10));
        wear.walked(6, 1000 + 100);
        wear.walked(7, 1000 + 51);
        assert!(!wear.is_due(6, 10), "100 of 150 turns");
        assert!(wear.is_due(7, 10), "151 of 150 turns");
        wear.built(8);
        wear.walked(8, 90_000);
        wear.walked(9, 10);
        assert!(!wear.is_due(9, 10), "faster than when it was built");
    }
}
