// Boxes of colliders: whether two meet, and how sizes and places of boxes become integers. No pass, no binding.

//#import shared/collider.wgsl

// Stands for infinity in the box of a half-space.
const FAR: f32 = 1e30;

// Size classes that a float's exponent and two mantissa bits can tell apart.
const CLASSES: u32 = 1024u;

// Whether two boxes overlap and a contact between them could push anything.
fn meets(a: Aabb, b: Aabb) -> bool {
    return !(any(a.min > b.max) || any(b.min > a.max)) && matter(a.body, b.body);
}

// Whether a contact between colliders of these bodies could push anything, or could if it were awake.
fn matter(a: u32, b: u32) -> bool {
    let both = (a & b & AABB_LIVE) != 0u;
    let one_moves = ((a | b) & (AABB_DYNAMIC | AABB_ASLEEP)) != 0u;
    return both && one_moves && ((a ^ b) & AABB_INDEX) != 0u;
}

// Four classes an octave: exponent and two leading mantissa bits, plus one.
fn size_class(extent: f32) -> u32 {
    return (bitcast<u32>(extent) >> 21u) + 1u;
}

// Whether the collider counts for the choice of the grid: it lives and has an end.
fn bounded(aabb: Aabb) -> bool {
    return (aabb.body & AABB_LIVE) != 0u && aabb.size_class < size_class(FAR);
}

fn center(aabb: Aabb) -> vec3<f32> {
    return 0.5 * (aabb.min + aabb.max);
}

// An integer that is larger when the float is.
fn to_ordered(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

fn from_ordered(x: u32) -> f32 {
    return bitcast<f32>(select(~x, x & 0x7fffffffu, (x & 0x80000000u) != 0u));
}
