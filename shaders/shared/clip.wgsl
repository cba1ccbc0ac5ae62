// Candidate points and their reduction to four. No pass, no binding. Twin of crates/cpu/src/narrowphase/clip.rs.

//#import shared/manifold.wgsl

const MOST_CANDIDATES: u32 = 8u;

// Up to eight points of one contact.
struct Candidates {
    count: u32,
    points: array<vec3<f32>, 8>,
    separations: array<f32, 8>,
    features: array<u32, 8>,
}

// Keeps the point; a ninth is left out (a rectangle clipped by four planes has eight corners at most).
fn push(candidates: ptr<function, Candidates>, point: vec3<f32>, separation: f32, feature: u32) {
    let at = (*candidates).count;
    if at < MOST_CANDIDATES {
        (*candidates).points[at] = point;
        (*candidates).separations[at] = separation;
        (*candidates).features[at] = feature;
        (*candidates).count = at + 1u;
    }
}

// Four points that hold the body as all do: the deepest, the one farthest from it, and the farthest to either side of
// the line between them. With four or fewer, all. In candidate order, so that features stay in place.
//
// Depths that differ by less than `level` count as equal, so that a face at rest keeps its points.
fn reduce(candidates: ptr<function, Candidates>, normal: vec3<f32>, level: f32) -> Manifold {
    let count = (*candidates).count;
    var chosen = 0xffu; // a bit a candidate
    if count > 4u {
        var scores: array<f32, 8>;
        for (var i = 0u; i < count; i++) {
            scores[i] = -(*candidates).separations[i];
        }
        let deepest = best(&scores, count, level);
        let base = (*candidates).points[deepest];
        for (var i = 0u; i < count; i++) {
            let way = (*candidates).points[i] - base;
            scores[i] = dot(way, way);
        }
        let most = best(&scores, count, 0.0);
        let line = cross((*candidates).points[most] - base, normal);
        for (var i = 0u; i < count; i++) {
            scores[i] = dot(line, (*candidates).points[i] - base);
        }
        let left = best(&scores, count, 0.0);
        for (var i = 0u; i < count; i++) {
            scores[i] = -scores[i];
        }
        let right = best(&scores, count, 0.0);
        chosen = (1u << deepest) | (1u << most) | (1u << left) | (1u << right);
    }
    var manifold: Manifold;
    manifold.normal = normal;
    for (var i = 0u; i < count; i++) {
        if (chosen & (1u << i)) != 0u {
            let at = manifold.count;
            manifold.points[at] = ManifoldPoint((*candidates).points[i], (*candidates).separations[i]);
            manifold.features[at] = (*candidates).features[i];
            manifold.count = at + 1u;
        }
    }
    return manifold;
}

// Index of the highest score; the first of those that differ by less than `level` and a thousandth.
fn best(scores: ptr<function, array<f32, 8>>, count: u32, level: f32) -> u32 {
    var at = 0u;
    var high = (*scores)[0];
    for (var i = 1u; i < count; i++) {
        let s = (*scores)[i];
        if s > high + level + 1e-3 * abs(high) {
            at = i;
            high = s;
        }
    }
    return at;
}
