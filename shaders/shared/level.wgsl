// Levels of sub-steps. Numbers: crates/core/src/layout/level.rs.

const LEVELS: u32 = 4u;
const LEVEL_HOLD: u32 = 16u;
const LEVEL_CALM: u32 = 8u;
const MOST_CREDIT: u32 = 63u;

// The level that a body of this credit is solved at: the lowest of `levels`, those that run, that is no lower than what it
// wants; else the highest that runs.
fn level_of(levels: u32, credit: u32) -> u32 {
    let wanted = min(credit / LEVEL_HOLD, LEVELS - 1u);
    let above = levels >> wanted;
    if above == 0u {
        return firstLeadingBit(max(levels, 1u));
    }
    return wanted + firstTrailingBit(above);
}

// Length of the sub-steps of a level, that of the lowest being h, s.
fn h_of(h: f32, level: u32) -> f32 {
    return h * bitcast<f32>((127u - level) << 23u);
}
