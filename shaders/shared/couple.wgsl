// Two colliders placed in the world, and the manifolds that any pair kind needs. No pass, no binding. Twin of
// crates/cpu/src/narrowphase/mod.rs.

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/manifold.wgsl
//#import shared/math.wgsl

// Share of the smaller collider's least half extent that the two may move against each other.
const RECYCLE_SHARE: f32 = 0.05;

// A collider where it is, relative to the centre of mass of the pair's first body.
struct Placed {
    size: vec3<f32>, // radius or half extents
    position: vec3<f32>,
    rotation: vec4<f32>, // collider frame to world
    center: vec3<f32>, // centre of mass of its body
    linear: vec3<f32>, // velocity of the centre of mass
    angular: vec3<f32>,
    body_rotation: vec4<f32>, // of the body's principal frame
}

// Two placed colliders and how far ahead to look.
struct Couple {
    a: Placed, // its body's centre of mass is the origin
    b: Placed,
    distance: f32, // gap below which a contact at rest is kept
    dt: f32, // length of the step
}

fn placed(c: Collider, s: BodyState, center: vec3<f32>) -> Placed {
    return Placed(
        c.size,
        center + rotate(s.rotation, c.position),
        multiply(s.rotation, c.rotation),
        center,
        s.linear_velocity,
        s.angular_velocity,
        s.rotation,
    );
}

// Places the colliders of a pair relative to the first body, which keeps digits far from the world's origin.
fn place(ca: Collider, sa: BodyState, cb: Collider, sb: BodyState, distance: f32, dt: f32) -> Couple {
    let between = sb.position - sa.position;
    return Couple(placed(ca, sa, vec3<f32>()), placed(cb, sb, between), distance, dt);
}

// The same two with their roles exchanged.
fn swap(couple: Couple) -> Couple {
    return Couple(couple.b, couple.a, couple.distance, couple.dt);
}

fn smallest(p: Placed) -> f32 {
    return select(3.4e38, min_element(p.size), p.size.x > 0.0);
}

// How far the two may move against each other before their contact is found anew.
fn recycle_distance(couple: Couple) -> f32 {
    return RECYCLE_SHARE * min(smallest(couple.a), smallest(couple.b));
}

// How far apart the two may be at a point and still need a contact in this step.
fn reach(couple: Couple, point: vec3<f32>, normal: vec3<f32>) -> f32 {
    let at_a = couple.a.linear + cross(couple.a.angular, point - couple.a.center);
    let at_b = couple.b.linear + cross(couple.b.angular, point - couple.b.center);
    return couple.distance + max(-dot(normal, at_b - at_a), 0.0) * couple.dt;
}

fn arc(p: Placed) -> f32 {
    return length(p.angular) * (length(p.position - p.center) + length(p.size));
}

// An upper bound of `reach` over all points and normals.
fn farthest(couple: Couple) -> f32 {
    let closing = length(couple.b.linear - couple.a.linear) + arc(couple.a) + arc(couple.b);
    return couple.distance + closing * couple.dt;
}

// A manifold of one point, if it is near enough. `normal` points from a to b.
fn single(couple: Couple, normal: vec3<f32>, point: vec3<f32>, separation: f32) -> Manifold {
    var manifold: Manifold;
    if separation <= reach(couple, point, normal) {
        manifold.normal = normal;
        manifold.count = 1u;
        manifold.points[0] = ManifoldPoint(point, separation);
    }
    return manifold;
}

// Turns a manifold of (b, a) into that of (a, b). Anchors are relative to the first body of the pair either way.
fn flip(manifold: Manifold) -> Manifold {
    var flipped = manifold;
    flipped.normal = -manifold.normal;
    return flipped;
}
