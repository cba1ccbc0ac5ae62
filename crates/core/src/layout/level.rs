use super::StepParams;
use crate::solver::memory_pace;

/// Levels of sub-steps that islands may have; each has twice the sub-steps of the one below.
pub const LEVELS: u32 = 4;
/// Calm steps after which an island falls to the level below: [`BodyState::credit`](super::BodyState::credit) is the
/// level times this, plus those that are left.
pub const LEVEL_HOLD: u32 = 16;
/// Credit of the highest level with all calm steps to go: that of the bodies of a new world.
pub const MOST_CREDIT: u32 = LEVELS * LEVEL_HOLD - 1;
/// A step is calm below the tolerance over this. One level fewer is four times the error.
pub const LEVEL_CALM: u32 = 8;

impl StepParams {
    /// What the passes of this level of sub-steps are told. Lengths and stiffness scale with a power of two, which rounds
    /// nothing.
    pub fn at_level(&self, level: u32) -> Self {
        let (more, less) = ((1 << level) as f32, 1.0 / (1 << level) as f32);
        let pace = memory_pace(self.h_of(level)) / memory_pace(self.h);
        Self {
            h: self.h_of(level),
            inverse_h: self.inverse_h * more,
            substeps: self.substeps << level,
            bias_rate: self.bias_rate * more,
            static_bias_rate: self.static_bias_rate * more,
            memory_gain: self.memory_gain * pace,
            memory_limit: self.memory_limit * pace,
            memory_band: self.memory_band * less,
            level,
            ..*self
        }
    }

    /// Whether islands may be at different levels.
    pub fn is_leveled(&self) -> bool {
        self.tolerance >= 0.0 || self.levels != 1
    }

    /// Length of this level's sub-steps, s.
    pub fn h_of(&self, level: u32) -> f32 {
        self.h * (1.0 / (1 << level) as f32)
    }

    /// The level that a body of this credit is solved at: the lowest of those that run and are no lower than what it
    /// wants, else the highest that runs.
    pub fn level_of(&self, credit: u32) -> u32 {
        let wanted = (credit / LEVEL_HOLD).min(LEVELS - 1);
        match self.levels >> wanted {
            0 => self.levels.checked_ilog2().unwrap_or(0),
            above => wanted + above.trailing_zeros(),
        }
    }

    /// The levels that run, lowest first, as their passes are told.
    pub fn by_level(&self) -> impl Iterator<Item = Self> + '_ {
        (0..LEVELS).filter(|level| self.levels >> level & 1 != 0).map(|level| self.at_level(level))
    }
}
