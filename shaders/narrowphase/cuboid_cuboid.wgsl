// Cuboid against cuboid: separating axes, then clipping. One thread a pair; reads and writes: shared/narrowphase.wgsl.
// Twin of crates/cpu/src/narrowphase/cuboid_cuboid.rs.
//
// Of the 15 axes (Gottschalk, Lin and Manocha, "OBBTree", 1996) the one with the largest gap is kept; faces are
// preferred to edges, and a's to b's, by a small margin, so that a contact at rest keeps its kind. On a face axis the
// other box's facing side is clipped by the sides of the reference face; on an edge axis the nearest points of the two
// edges are the contact.
//
// The clip rectangle is 1 % wider than the face, and what lies on the rim is put back onto the face: corners of equal
// boxes that stand exactly on each other are then inside, whatever the last bit says, and keep their features.

//#import shared/clip.wgsl
//#import shared/narrowphase.wgsl

// Edge axes shorter than this (the sine between the edges) are left out: a face axis is as good there.
const PARALLEL: f32 = 0.02;
// How much wider than the face the clip rectangle is.
const RIM: f32 = 1.01;
// Feature numbers: corners of the incident face, crossings of its edges, corners of the reference face, edge pairs;
// plus the reference and incident face times FACE.
const CROSSING: u32 = 4u;
const REFERENCE_CORNER: u32 = 12u;
const FACE: u32 = 16u;
const EDGES: u32 = 65536u;
const NO_AXIS: u32 = 15u;

// The axis with the largest gap so far.
struct Axis {
    gap: f32,
    index: u32, // 0..3 faces of a, 3..6 faces of b, 6..15 edges, NO_AXIS when the boxes are too far apart
    normal: vec3<f32>, // in the frame of a, from a to b; edges only
}

// A face contact's frame: the reference face's box and the other one in it.
struct Reference {
    axis: u32, // of the reference box that the face belongs to
    side: f32,
    size: vec3<f32>, // half extents of the reference box
    other: mat3x3<f32>, // columns: axes of the incident box in the reference frame
    center: vec3<f32>, // of the incident box, in the reference frame
    other_size: vec3<f32>, // half extents of the incident box
}

// What turns a point of the reference frame into one of the manifold.
struct Frame {
    origin: vec3<f32>,
    rotation: vec4<f32>,
    outward: vec3<f32>, // normal of the reference face
    normal: vec3<f32>, // from a to b
    spare: f32, // how much farther points are kept, that may come to touch while the manifold is recycled
    first_feature: u32,
}

@compute @workgroup_size(256)
fn collide(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let mine = is_mine(i, PAIR_CUBOID_CUBOID);
    var manifold: Manifold;
    if mine {
        let couple = couple_of(i);
        manifold = recycled(i, couple);
        if manifold.count == 0u {
            manifold = manifold_of(couple);
            manifold.between = couple.b.center;
        }
    }
    finish(i, local_index(lid), mine, manifold);
}

// Up to four points.
fn manifold_of(couple: Couple) -> Manifold {
    let a = couple.a;
    let b = couple.b;
    let d = rotate_back(a.rotation, b.position - a.position);
    // Columns of c: axes of b in the frame of a.
    let c = mat3_from_quat(multiply(conjugate(a.rotation), b.rotation));
    let smallest = min(min_element(a.size), min_element(b.size));
    let margin = min(0.1 * couple.distance, 0.02 * smallest);
    let axis = best_axis(a.size, b.size, d, c, farthest(couple), margin);
    if axis.index == NO_AXIS {
        return Manifold();
    }
    if axis.index >= 6u {
        return edge_contact(couple, axis, d, c);
    }
    let on_a = axis.index < 3u;
    var r: Reference;
    var frame: Frame;
    if on_a {
        r = Reference(axis.index, sign_of(d[axis.index]), a.size, c, d, b.size);
        frame.origin = a.position;
        frame.rotation = a.rotation;
    } else {
        let t = transpose(c);
        let center = -times(t, d);
        r = Reference(axis.index - 3u, sign_of(center[axis.index - 3u]), b.size, t, center, a.size);
        frame.origin = b.position;
        frame.rotation = b.rotation;
    }
    var outward = vec3<f32>();
    outward[r.axis] = r.side;
    frame.outward = rotate(frame.rotation, outward);
    frame.normal = select(-frame.outward, frame.outward, on_a);
    frame.spare = recycle_distance(couple);
    frame.first_feature = FACE * 8u * axis.index;
    var candidates: Candidates;
    clip_faces(&candidates, r, frame, couple);
    return reduce(&candidates, frame.normal, 0.25 * couple.distance);
}

fn sign_of(x: f32) -> f32 {
    return select(1.0, -1.0, x < 0.0);
}

// m * v, summed in the order of the columns.
fn times(m: mat3x3<f32>, v: vec3<f32>) -> vec3<f32> {
    return m[0] * v.x + m[1] * v.y + m[2] * v.z;
}

// The axis with the largest gap; none when some gap is wider than `most`.
fn best_axis(ha: vec3<f32>, hb: vec3<f32>, d: vec3<f32>, c: mat3x3<f32>, most: f32, margin: f32) -> Axis {
    let none = Axis(0.0, NO_AXIS, vec3<f32>());
    var columns = c;
    let t = transpose(c);
    let db = times(t, d);
    let reach_b = vec3<f32>(dot(abs(t[0]), hb), dot(abs(t[1]), hb), dot(abs(t[2]), hb));
    let reach_a = vec3<f32>(dot(abs(c[0]), ha), dot(abs(c[1]), ha), dot(abs(c[2]), ha));
    var best = Axis(-3.4e38, 0u, vec3<f32>());
    for (var i = 0u; i < 3u; i++) {
        let gap = abs(d[i]) - ha[i] - reach_b[i];
        if gap > best.gap {
            best = Axis(gap, i, vec3<f32>());
        }
    }
    let face_a = best.gap;
    for (var i = 0u; i < 3u; i++) {
        let gap = abs(db[i]) - hb[i] - reach_a[i];
        if gap > best.gap && gap > face_a + margin {
            best = Axis(gap, 3u + i, vec3<f32>());
        }
    }
    if best.gap > most {
        return none;
    }
    let face = best.gap;
    for (var i = 0u; i < 3u; i++) {
        for (var j = 0u; j < 3u; j++) {
            // Unit axis i of a times axis j of b.
            let w = columns[j];
            let k = (i + 1u) % 3u;
            let l = (i + 2u) % 3u;
            let edge = sqrt(w[k] * w[k] + w[l] * w[l]);
            if edge < PARALLEL {
                continue;
            }
            var n = vec3<f32>();
            n[k] = -w[l] / edge;
            n[l] = w[k] / edge;
            let along = dot(n, d);
            let nb = times(t, n);
            let gap = abs(along) - dot(ha, abs(n)) - dot(hb, abs(nb));
            if gap > most {
                return none;
            }
            if gap > best.gap && gap > face + margin {
                best = Axis(gap, 6u + 3u * i + j, n * sign_of(along));
            }
        }
    }
    return best;
}

// One point, midway between the nearest points of the two edges.
fn edge_contact(couple: Couple, axis: Axis, d: vec3<f32>, c: mat3x3<f32>) -> Manifold {
    let ha = couple.a.size;
    let hb = couple.b.size;
    let i = (axis.index - 6u) / 3u;
    let j = (axis.index - 6u) % 3u;
    let n = axis.normal;
    let nb = times(transpose(c), n);
    // The middle of the edge of a that lies farthest along n, and of the edge of b farthest against it.
    var on_a = vec3<f32>(sign_of(n.x), sign_of(n.y), sign_of(n.z)) * ha;
    on_a[i] = 0.0;
    var on_b = -vec3<f32>(sign_of(nb.x), sign_of(nb.y), sign_of(nb.z)) * hb;
    on_b[j] = 0.0;
    var along_a = vec3<f32>();
    along_a[i] = 1.0;
    var columns = c;
    let along_b = columns[j];
    let between = d + times(c, on_b) - on_a;
    let cosine = dot(along_a, along_b);
    let pa = dot(along_a, between);
    let pb = dot(along_b, between);
    let s = (pa - cosine * pb) / (1.0 - cosine * cosine);
    let point = on_a + along_a * clamp(s, -ha[i], ha[i]) + n * (0.5 * axis.gap);
    let normal = rotate(couple.a.rotation, n);
    var manifold = single(couple, normal, couple.a.position + rotate(couple.a.rotation, point), axis.gap);
    manifold.features[0] = EDGES + axis.index;
    return manifold;
}

// Pushes every corner of the incident face clipped by the sides of the reference face: its place on the incident face
// in the reference frame, its height above the reference face, its feature.
fn clip_faces(candidates: ptr<function, Candidates>, r: Reference, frame: Frame, couple: Couple) {
    let k = r.axis;
    let u = (k + 1u) % 3u;
    let v = (k + 2u) % 3u;
    var columns = r.other;
    // The incident face is the one whose outward normal points most against the reference face's.
    let facing = vec3<f32>(columns[0][k], columns[1][k], columns[2][k]) * r.side;
    let size = abs(facing);
    var m = 2u;
    if size.x >= size.y && size.x >= size.z {
        m = 0u;
    } else if size.y >= size.z {
        m = 1u;
    }
    let e1 = (m + 1u) % 3u;
    let e2 = (m + 2u) % 3u;
    let middle = r.center - columns[m] * (r.other_size[m] * sign_of(facing[m]));
    let edge1 = columns[e1] * r.other_size[e1];
    let edge2 = columns[e2] * r.other_size[e2];
    let face = FACE * (2u * m + select(0u, 1u, facing[m] < 0.0));
    var corners = array<vec3<f32>, 4>(
        middle - edge1 - edge2,
        middle + edge1 - edge2,
        middle + edge1 + edge2,
        middle - edge1 + edge2,
    );
    let hu = r.size[u];
    let hv = r.size[v];
    for (var edge = 0u; edge < 4u; edge++) {
        let start = corners[edge];
        let way = corners[(edge + 1u) % 4u] - start;
        // Liang and Barsky's line clipping against the widened rectangle.
        var enter = 0.0;
        var leave = 1.0;
        for (var side = 0u; side < 2u; side++) {
            let axis = select(v, u, side == 0u);
            let half = RIM * select(hv, hu, side == 0u);
            if abs(way[axis]) > 1e-9 {
                let t0 = (-half - start[axis]) / way[axis];
                let t1 = (half - start[axis]) / way[axis];
                enter = max(enter, min(t0, t1));
                leave = min(leave, max(t0, t1));
            } else if abs(start[axis]) > half {
                leave = -1.0;
            }
        }
        if enter > leave {
            continue;
        }
        if enter == 0.0 {
            give(candidates, r, frame, couple, start, face + edge);
        } else {
            give(candidates, r, frame, couple, start + way * enter, face + CROSSING + 2u * edge);
        }
        if leave < 1.0 {
            give(candidates, r, frame, couple, start + way * leave, face + CROSSING + 2u * edge + 1u);
        }
    }
    // Corners of the reference face inside the incident one.
    let det = edge1[u] * edge2[v] - edge1[v] * edge2[u];
    for (var corner = 0u; corner < 4u; corner++) {
        let pu = select(-hu, hu, corner == 1u || corner == 2u);
        let pv = select(-hv, hv, corner >= 2u);
        let du = pu - middle[u];
        let dv = pv - middle[v];
        let s = (du * edge2[v] - dv * edge2[u]) / det;
        let t = (edge1[u] * dv - edge1[v] * du) / det;
        if abs(s) < 2.0 - RIM && abs(t) < 2.0 - RIM {
            var p = middle + edge1 * s + edge2 * t;
            p[u] = pu;
            p[v] = pv;
            give(candidates, r, frame, couple, p, face + REFERENCE_CORNER + corner);
        }
    }
}

// Pushes p, put onto the reference face, if it is near enough.
fn give(
    candidates: ptr<function, Candidates>,
    r: Reference,
    frame: Frame,
    couple: Couple,
    p: vec3<f32>,
    feature: u32,
) {
    let k = r.axis;
    let u = (k + 1u) % 3u;
    let v = (k + 2u) % 3u;
    var q = p;
    q[u] = clamp(q[u], -r.size[u], r.size[u]);
    q[v] = clamp(q[v], -r.size[v], r.size[v]);
    let separation = p[k] * r.side - r.size[k];
    let point = frame.origin + rotate(frame.rotation, q) - frame.outward * (0.5 * separation);
    if separation <= reach(couple, point, frame.normal) + frame.spare {
        push(candidates, point, separation, frame.first_feature + feature);
    }
}
