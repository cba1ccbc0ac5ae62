//! Candidate points and their reduction to four. Twin of `shaders/shared/clip.wgsl`.

use super::EMPTY;
use glam::Vec3;
use tumble_core::layout::{Manifold, ManifoldPoint};

/// Up to eight points of one contact.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Candidates {
    pub(crate) count: usize,
    pub(crate) points: [Vec3; 8],
    pub(crate) separations: [f32; 8],
    pub(crate) features: [u32; 8],
}

impl Candidates {
    /// Keeps the point; a ninth is left out (a rectangle clipped by four planes has eight corners at most).
    pub(crate) fn push(&mut self, point: Vec3, separation: f32, feature: u32) {
        if self.count < 8 {
            self.points[self.count] = point;
            self.separations[self.count] = separation;
            self.features[self.count] = feature;
            self.count += 1;
        }
    }
}

/// Four points that hold the body as all do: the deepest, the one farthest from it, and the farthest to either side
/// of the line between them. With four or fewer, all. In candidate order, so that features stay in place.
///
/// Depths that differ by less than `level` count as equal, so that a face at rest keeps its points.
pub(crate) fn reduce(candidates: &Candidates, normal: Vec3, level: f32) -> Manifold {
    let mut chosen = [true; 8];
    if candidates.count > 4 {
        chosen = [false; 8];
        let points = &candidates.points[..candidates.count];
        let deepest = best(points.len(), level, |i| -candidates.separations[i]);
        let from = points[deepest];
        let farthest = best(points.len(), 0.0, |i| (points[i] - from).length_squared());
        let line = (points[farthest] - from).cross(normal);
        chosen[deepest] = true;
        chosen[farthest] = true;
        let left = best(points.len(), 0.0, |i| line.dot(points[i] - from));
        let right = best(points.len(), 0.0, |i| -line.dot(points[i] - from));
        chosen[left] = true;
        chosen[right] = true;
    }
    let mut manifold = Manifold { normal: normal.to_array(), ..EMPTY };
    for i in (0..candidates.count).filter(|&i| chosen[i]) {
        let at = manifold.count as usize;
        manifold.points[at] =
            ManifoldPoint { anchor: candidates.points[i].to_array(), separation: candidates.separations[i] };
        manifold.features[at] = candidates.features[i];
        manifold.count += 1;
    }
    manifold
}

/// Index of the highest score; the first of those that differ by less than `level` and a thousandth.
fn best(count: usize, level: f32, score: impl Fn(usize) -> f32) -> usize {
    let mut at = 0;
    let mut high = score(0);
    for i in 1..count {
        let s = score(i);
        if s > high + level + 1e-3 * high.abs() {
            at = i;
            high = s;
        }
    }
    at
}
