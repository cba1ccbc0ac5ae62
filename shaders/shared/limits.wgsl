// Bounds of loops and of lists, as the host has them: crates/core/src/limits.rs says what for. No pass, no binding.

const TURN_LIMIT: u32 = 50000u;
const UNBOUNDED_LIMIT: u32 = 4096u;
const SWEEP_CHUNK: u32 = 256u;
const SWEEP_ITEM_LIMIT: u32 = 268435456u;
