//! How many steps a frame owes.

/// Most steps a frame. Where a machine cannot keep up, the rest is dropped: the scene then runs slower than real time,
/// and frames still come.
pub(crate) const MOST_STEPS: u32 = 4;

/// Real time over which the pace is measured, s.
const SPAN: f64 = 0.5;

/// Turns the time that passes into steps of fixed length.
#[derive(Debug, Default)]
pub(crate) struct Clock {
    /// Time that passed and was not simulated, s.
    owed: f64,
    /// Real time and simulated time of the current span, s.
    real: f64,
    simulated: f64,
    slowness: Option<f64>,
}

impl Clock {
    /// Steps of `dt` to run now that `elapsed` has passed since the last call, both in s.
    pub(crate) fn steps(&mut self, elapsed: f64, dt: f64) -> u32 {
        self.owed += elapsed;
        let due = (self.owed / dt).floor();
        let steps = due.min(f64::from(MOST_STEPS));
        // What is beyond is dropped, or a stall would be followed by a rush.
        self.owed = if due > steps { 0.0 } else { self.owed - steps * dt };
        self.real += elapsed;
        self.simulated += steps * dt;
        if self.real >= SPAN.max(2.0 * dt) {
            self.slowness = Some(self.real / self.simulated.max(1e-9));
            (self.real, self.simulated) = (0.0, 0.0);
        }
        steps as u32
    }

    /// Forgets what is owed: time stood still.
    pub(crate) fn stop(&mut self) {
        *self = Self { slowness: self.slowness, ..Self::default() };
    }

    /// Real time by simulated time, of late: 1 at real time, above where the machine does not keep up.
    pub(crate) fn slowness(&self) -> Option<f64> {
        self.slowness
    }
}
