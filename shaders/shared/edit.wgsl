// Edits as records of the log. Fields and arguments: crates/core/src/layout/edit.rs.
// (`target` is a word that WGSL keeps for itself: the field is `target_slot` here.)

const EDIT_SPAWN: u32 = 1u;
const EDIT_PROPS: u32 = 2u;
const EDIT_REMOVE: u32 = 3u;
const EDIT_POSE: u32 = 4u;
const EDIT_VELOCITY: u32 = 5u;
const EDIT_IMPULSE: u32 = 6u;
const EDIT_IMPULSE_AT: u32 = 7u;
const EDIT_FORCE: u32 = 8u;
const EDIT_FORCE_AT: u32 = 9u;
const EDIT_FREEZE: u32 = 10u;
const EDIT_WAKE: u32 = 11u;
const EDIT_NEXT_POSE: u32 = 12u;
const EDIT_COLLIDER: u32 = 13u;
const EDIT_COLLIDER_REMOVE: u32 = 14u;

struct EditRecord {
    op: u32,
    target_slot: u32,
    kind: u32,
    generation: u32,
    data: array<vec4<u32>, 7>,
}

struct EditRange {
    first: u32,
    count: u32,
}
