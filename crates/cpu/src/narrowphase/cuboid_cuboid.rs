//! Cuboid against cuboid: separating axes, then clipping. Twin of `shaders/narrowphase/cuboid_cuboid.wgsl`.
//!
//! Of the 15 axes (Gottschalk, Lin and Manocha, "OBBTree", 1996) the one with the largest gap is kept; faces are
//! preferred to edges, and a's to b's, by a small margin, so that a contact at rest keeps its kind. On a face axis the
//! other box's facing side is clipped by the sides of the reference face; on an edge axis the nearest points of the
//! two edges are the contact.
//!
//! The clip rectangle is 1 % wider than the face, and what lies on the rim is put back onto the face: corners of equal
//! boxes that stand exactly on each other are then inside, whatever the last bit says, and keep their features.

use super::clip::{Candidates, reduce};
use super::{Couple, EMPTY};
use crate::math::{rotate, rotate_back};
use glam::{Mat3, Vec3};
use tumble_core::layout::Manifold;

/// Edge axes shorter than this (the sine between the edges) are left out: a face axis is as good there.
const PARALLEL: f32 = 0.02;
/// How much wider than the face the clip rectangle is.
const RIM: f32 = 1.01;
/// Feature numbers: corners of the incident face, crossings of its edges, corners of the reference face, edge pairs;
/// plus the reference and incident face times `FACE`.
const CROSSING: u32 = 4;
const REFERENCE_CORNER: u32 = 12;
const FACE: u32 = 16;
const EDGES: u32 = 1 << 16;

/// The axis with the largest gap so far.
#[derive(Clone, Copy)]
struct Axis {
    gap: f32,
    /// 0..3 faces of a, 3..6 faces of b, 6..15 edges.
    index: usize,
    /// In the frame of a, from a to b.
    normal: Vec3,
}

/// A face contact's frame: the reference face's box and the other one in it.
struct Reference {
    /// Axis of the reference box that the face belongs to, and its side.
    axis: usize,
    side: f32,
    /// Half extents of the reference box.
    size: Vec3,
    /// Columns: axes of the incident box in the reference frame.
    other: Mat3,
    /// Centre of the incident box in the reference frame.
    center: Vec3,
    /// Half extents of the incident box.
    other_size: Vec3,
}

/// Up to four points.
pub fn collide(couple: &Couple) -> Manifold {
    let (a, b) = (&couple.a, &couple.b);
    let d = rotate_back(a.rotation, b.position - a.position);
    // Columns of c: axes of b in the frame of a.
    let c = Mat3::from_quat(a.rotation.conjugate() * b.rotation);
    let farthest = couple.farthest();
    let smallest = a.size.min_element().min(b.size.min_element());
    let margin = (0.1 * couple.distance).min(0.02 * smallest);
    let Some(axis) = best_axis(a.size, b.size, d, &c, farthest, margin) else {
        return EMPTY;
    };
    if axis.index >= 6 {
        return edge_contact(couple, &axis, d, &c);
    }
    let on_a = axis.index < 3;
    let (frame, origin) = if on_a { (a.rotation, a.position) } else { (b.rotation, b.position) };
    let reference = if on_a {
        Reference { axis: axis.index, side: sign(d[axis.index]), size: a.size, other: c, center: d, other_size: b.size }
    } else {
        let i = axis.index - 3;
        let center = -(c.transpose() * d);
        Reference { axis: i, side: sign(center[i]), size: b.size, other: c.transpose(), center, other_size: a.size }
    };
    let mut outward = Vec3::ZERO;
    outward[reference.axis] = reference.side;
    let outward = rotate(frame, outward);
    let normal = if on_a { outward } else { -outward };
    // Points that may come to touch while the manifold is recycled.
    let spare = couple.recycle_distance();
    let mut points = Candidates::default();
    clip_faces(&reference, |local, separation, feature| {
        let point = origin + rotate(frame, local) - outward * (0.5 * separation);
        if separation <= couple.reach(point, normal) + spare {
            points.push(point, separation, feature + FACE * 8 * axis.index as u32);
        }
    });
    reduce(&points, normal, 0.25 * couple.distance)
}

fn sign(x: f32) -> f32 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

/// The axis with the largest gap; none when some gap is wider than `farthest`.
fn best_axis(ha: Vec3, hb: Vec3, d: Vec3, c: &Mat3, farthest: f32, margin: f32) -> Option<Axis> {
    let t = c.transpose();
    let db = t * d;
    let reach_b = Vec3::new(t.x_axis.abs().dot(hb), t.y_axis.abs().dot(hb), t.z_axis.abs().dot(hb));
    let reach_a = Vec3::new(c.x_axis.abs().dot(ha), c.y_axis.abs().dot(ha), c.z_axis.abs().dot(ha));
    let mut best = Axis { gap: f32::MIN, index: 0, normal: Vec3::ZERO };
    for i in 0..3 {
        let gap = d[i].abs() - ha[i] - reach_b[i];
        if gap > best.gap {
            best = Axis { gap, index: i, normal: Vec3::ZERO };
        }
    }
    let face_a = best.gap;
    for i in 0..3 {
        let gap = db[i].abs() - hb[i] - reach_a[i];
        if gap > best.gap && gap > face_a + margin {
            best = Axis { gap, index: 3 + i, normal: Vec3::ZERO };
        }
    }
    if best.gap > farthest {
        return None;
    }
    let face = best.gap;
    for i in 0..3 {
        for j in 0..3 {
            // Unit axis i of a times axis j of b.
            let w = c.col(j);
            let (k, l) = ((i + 1) % 3, (i + 2) % 3);
            let length = (w[k] * w[k] + w[l] * w[l]).sqrt();
            if length < PARALLEL {
                continue;
            }
            let mut n = Vec3::ZERO;
            n[k] = -w[l] / length;
            n[l] = w[k] / length;
            let along = n.dot(d);
            let nb = t * n;
            let gap = along.abs() - ha.dot(n.abs()) - hb.dot(nb.abs());
            if gap > farthest {
                return None;
            }
            if gap > best.gap && gap > face + margin {
                best = Axis { gap, index: 6 + 3 * i + j, normal: n * sign(along) };
            }
        }
    }
    Some(best)
}

/// One point, midway between the nearest points of the two edges.
fn edge_contact(couple: &Couple, axis: &Axis, d: Vec3, c: &Mat3) -> Manifold {
    let (ha, hb) = (couple.a.size, couple.b.size);
    let (i, j) = ((axis.index - 6) / 3, (axis.index - 6) % 3);
    let n = axis.normal;
    let nb = c.transpose() * n;
    // The middle of the edge of a that lies farthest along n, and of the edge of b farthest against it.
    let mut on_a = Vec3::new(sign(n.x), sign(n.y), sign(n.z)) * ha;
    on_a[i] = 0.0;
    let mut on_b = -Vec3::new(sign(nb.x), sign(nb.y), sign(nb.z)) * hb;
    on_b[j] = 0.0;
    let mut along_a = Vec3::ZERO;
    along_a[i] = 1.0;
    let along_b = c.col(j);
    let between = d + *c * on_b - on_a;
    let cosine = along_a.dot(along_b);
    let (pa, pb) = (along_a.dot(between), along_b.dot(between));
    let s = (pa - cosine * pb) / (1.0 - cosine * cosine);
    let point = on_a + along_a * s.clamp(-ha[i], ha[i]) + n * (0.5 * axis.gap);
    let normal = rotate(couple.a.rotation, n);
    let mut manifold = couple.single(normal, couple.a.position + rotate(couple.a.rotation, point), axis.gap);
    manifold.features[0] = EDGES + axis.index as u32;
    manifold
}

/// Offers every corner of the incident face clipped by the sides of the reference face: its place on the incident
/// face in the reference frame, its height above the reference face, its feature.
fn clip_faces(r: &Reference, mut offer: impl FnMut(Vec3, f32, u32)) {
    let k = r.axis;
    let (u, v) = ((k + 1) % 3, (k + 2) % 3);
    // The incident face is the one whose outward normal points most against the reference face's.
    let facing = Vec3::new(r.other.x_axis[k], r.other.y_axis[k], r.other.z_axis[k]) * r.side;
    let size = facing.abs();
    let m = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let (e1, e2) = ((m + 1) % 3, (m + 2) % 3);
    let middle = r.center - r.other.col(m) * (r.other_size[m] * sign(facing[m]));
    let edge1 = r.other.col(e1) * r.other_size[e1];
    let edge2 = r.other.col(e2) * r.other_size[e2];
    let face = FACE * (2 * m as u32 + u32::from(facing[m] < 0.0));
    let corners = [middle - edge1 - edge2, middle + edge1 - edge2, middle + edge1 + edge2, middle - edge1 + edge2];
    let (hu, hv) = (r.size[u], r.size[v]);
    let mut give = |p: Vec3, feature: u32| {
        let mut q = p;
        q[u] = q[u].clamp(-hu, hu);
        q[v] = q[v].clamp(-hv, hv);
        offer(q, p[k] * r.side - r.size[k], face + feature);
    };
    for edge in 0..4 {
        let from = corners[edge];
        let way = corners[(edge + 1) % 4] - from;
        // Liang and Barsky's line clipping against the widened rectangle.
        let (mut enter, mut leave) = (0.0f32, 1.0f32);
        for (axis, half) in [(u, RIM * hu), (v, RIM * hv)] {
            if way[axis].abs() > 1e-9 {
                let t0 = (-half - from[axis]) / way[axis];
                let t1 = (half - from[axis]) / way[axis];
                enter = enter.max(t0.min(t1));
                leave = leave.min(t0.max(t1));
            } else if from[axis].abs() > half {
                leave = -1.0;
            }
        }
        if enter > leave {
            continue;
        }
        if enter == 0.0 {
            give(from, edge as u32);
        } else {
            give(from + way * enter, CROSSING + 2 * edge as u32);
        }
        if leave < 1.0 {
            give(from + way * leave, CROSSING + 2 * edge as u32 + 1);
        }
    }
    // Corners of the reference face inside the incident one.
    let det = edge1[u] * edge2[v] - edge1[v] * edge2[u];
    for corner in 0..4 {
        let pu = if corner == 1 || corner == 2 { hu } else { -hu };
        let pv = if corner >= 2 { hv } else { -hv };
        let (du, dv) = (pu - middle[u], pv - middle[v]);
        let s = (du * edge2[v] - dv * edge2[u]) / det;
        let t = (edge1[u] * dv - edge1[v] * du) / det;
        if s.abs() < 2.0 - RIM && t.abs() < 2.0 - RIM {
            let mut p = middle + edge1 * s + edge2 * t;
            p[u] = pu;
            p[v] = pv;
            give(p, REFERENCE_CORNER + corner as u32);
        }
    }
}
