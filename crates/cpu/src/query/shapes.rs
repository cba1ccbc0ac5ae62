//! One shape against a ray, another shape or a point. Twins: `shaders/shared/{cast,project}.wgsl` and
//! `shaders/query/overlap.wgsl`.
//!
//! The ball after Haines, Günther and Akenine-Möller, "Precision Improvements for Ray/Sphere Intersection" (Ray Tracing
//! Gems, 2019); two boxes by the fifteen separating axes of Gottschalk, Lin and Manocha (SIGGRAPH 1996) with the
//! allowance for parallel edges of Ericson, *Real-Time Collision Detection* (2005), 4.4.1.

use crate::math::{quat, rotate, rotate_back, vec3};
use glam::{Mat3, Vec3};
use tumble_core::layout::{PlacedShape, QueryRay, shape_kind};

/// Stands for the inverse of a component that is nothing.
const STEEP: f32 = 1e20;
/// Added to the cosines between the axes of two boxes.
const PARALLEL: f32 = 1e-6;

/// Where a ray meets a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// m.
    pub distance: f32,
    /// Against the ray; zero where it begins inside a solid shape.
    pub normal: Vec3,
}

/// Where the ray meets the shape, however far.
pub fn cast(shape: &PlacedShape, ray: &QueryRay) -> Option<Hit> {
    let (position, rotation) = (vec3(shape.position), quat(shape.rotation));
    let from = vec3(ray.origin) - position;
    let direction = vec3(ray.direction);
    let solid = ray.solid != 0;
    match shape.shape {
        shape_kind::BALL => cast_ball(shape.size[0], from, direction, solid),
        shape_kind::CUBOID => {
            let local =
                cast_cuboid(vec3(shape.size), rotate_back(rotation, from), rotate_back(rotation, direction), solid);
            local.map(|hit| Hit { normal: rotate(rotation, hit.normal), ..hit })
        }
        _ => cast_halfspace(rotate(rotation, Vec3::Y), from, direction, solid),
    }
}

fn cast_ball(radius: f32, from: Vec3, direction: Vec3, solid: bool) -> Option<Hit> {
    // The point of the ray's line that is nearest to the middle, and how far the surface is from there.
    let middle = -from.dot(direction);
    let aside = from + middle * direction;
    let square = radius * radius - aside.dot(aside);
    let inside = from.dot(from) <= radius * radius;
    if inside && solid {
        return Some(Hit { distance: 0.0, normal: Vec3::ZERO });
    }
    if square < 0.0 || (!inside && middle < 0.0) {
        return None;
    }
    let half = square.sqrt();
    let distance = (if inside { middle + half } else { middle - half }).max(0.0);
    let out = (from + distance * direction) / radius;
    Some(Hit { distance, normal: if inside { -out } else { out } })
}

/// In the cuboid's frame.
fn cast_cuboid(size: Vec3, from: Vec3, direction: Vec3, solid: bool) -> Option<Hit> {
    let inverse = Vec3::from_array(direction.to_array().map(steep));
    let (low, high) = ((-size - from) * inverse, (size - from) * inverse);
    let (into, out) = (low.min(high), low.max(high));
    let (near, far) = (into.max_element(), out.min_element());
    if near > far || far < 0.0 {
        return None;
    }
    if near >= 0.0 {
        return Some(Hit { distance: near, normal: against(direction, first(into, near)) });
    }
    if solid {
        return Some(Hit { distance: 0.0, normal: Vec3::ZERO });
    }
    Some(Hit { distance: far, normal: against(direction, first(out, far)) })
}

fn steep(x: f32) -> f32 {
    if x.abs() > 1.0 / STEEP {
        1.0 / x
    } else if x < 0.0 {
        -STEEP
    } else {
        STEEP
    }
}

/// The first axis along which `v` is `value`, as a unit vector.
fn first(v: Vec3, value: f32) -> Vec3 {
    if v.x == value {
        Vec3::X
    } else if v.y == value {
        Vec3::Y
    } else {
        Vec3::Z
    }
}

fn against(direction: Vec3, axis: Vec3) -> Vec3 {
    if direction.dot(axis) > 0.0 { -axis } else { axis }
}

fn cast_halfspace(normal: Vec3, from: Vec3, direction: Vec3, solid: bool) -> Option<Hit> {
    let height = normal.dot(from);
    let climb = normal.dot(direction);
    if height < 0.0 && solid {
        return Some(Hit { distance: 0.0, normal: Vec3::ZERO });
    }
    if climb.abs() <= 1.0 / STEEP {
        return None;
    }
    let distance = -height / climb;
    if distance < 0.0 {
        return None;
    }
    Some(Hit { distance, normal: if height < 0.0 { -normal } else { normal } })
}

/// Whether a ball or cuboid overlaps or touches any shape.
pub fn overlaps(a: &PlacedShape, b: &PlacedShape) -> bool {
    let between = vec3(a.position) - vec3(b.position);
    if b.shape == shape_kind::HALFSPACE {
        let normal = rotate(quat(b.rotation), Vec3::Y);
        return normal.dot(between) <= extent(a, normal);
    }
    match (a.shape, b.shape) {
        (shape_kind::BALL, shape_kind::BALL) => {
            let reach = a.size[0] + b.size[0];
            between.dot(between) <= reach * reach
        }
        (shape_kind::BALL, _) => ball_overlaps_cuboid(a, b),
        (_, shape_kind::BALL) => ball_overlaps_cuboid(b, a),
        _ => cuboids_overlap(a, b),
    }
}

/// How far the shape reaches along a unit vector.
fn extent(shape: &PlacedShape, normal: Vec3) -> f32 {
    if shape.shape == shape_kind::BALL {
        return shape.size[0];
    }
    rotate_back(quat(shape.rotation), normal).abs().dot(vec3(shape.size))
}

fn ball_overlaps_cuboid(ball: &PlacedShape, cuboid: &PlacedShape) -> bool {
    let local = rotate_back(quat(cuboid.rotation), vec3(ball.position) - vec3(cuboid.position));
    let size = vec3(cuboid.size);
    let out = local - local.max(-size).min(size);
    out.dot(out) <= ball.size[0] * ball.size[0]
}

fn cuboids_overlap(a: &PlacedShape, b: &PlacedShape) -> bool {
    let (size_a, size_b) = (vec3(a.size), vec3(b.size));
    let to_a = Mat3::from_quat(quat(a.rotation)).transpose();
    let between = to_a * (vec3(b.position) - vec3(a.position));
    // Axes of b in a's frame, and those of a in b's.
    let axes = to_a * Mat3::from_quat(quat(b.rotation));
    let rows = axes.transpose();
    let [row_x, row_y, row_z] = [rows.x_axis, rows.y_axis, rows.z_axis];
    let [x, y, z] = [row_x, row_y, row_z].map(|row| row.abs() + PARALLEL);
    let along_a = Vec3::new(x.dot(size_b), y.dot(size_b), z.dot(size_b)) + size_a;
    let along_b = x * size_a.x + y * size_a.y + z * size_a.z + size_b;
    let between_in_b = row_x * between.x + row_y * between.y + row_z * between.z;
    if between.abs().cmpgt(along_a).any() || between_in_b.abs().cmpgt(along_b).any() {
        return false;
    }
    // An axis of a across each of b.
    let apart_x = (between.z * row_y - between.y * row_z).abs();
    let apart_y = (between.x * row_z - between.z * row_x).abs();
    let apart_z = (between.y * row_x - between.x * row_y).abs();
    !apart_x.cmpgt(size_a.y * z + size_a.z * y + across(size_b, x)).any()
        && !apart_y.cmpgt(size_a.z * x + size_a.x * z + across(size_b, y)).any()
        && !apart_z.cmpgt(size_a.x * y + size_a.y * x + across(size_b, z)).any()
}

/// How far a box reaches across an axis and each of its own, from the cosines between that axis and its own.
fn across(size: Vec3, cosines: Vec3) -> Vec3 {
    let turned = |v: Vec3| Vec3::new(v.y, v.z, v.x);
    turned(size) * turned(turned(cosines)) + turned(turned(size)) * turned(cosines)
}

/// The point of a solid shape that is nearest to `point`, and the square of its distance.
pub fn project(shape: &PlacedShape, point: Vec3) -> (Vec3, f32) {
    let (position, rotation) = (vec3(shape.position), quat(shape.rotation));
    let from = point - position;
    match shape.shape {
        shape_kind::BALL => {
            let far = from.length();
            let gap = far - shape.size[0];
            if gap <= 0.0 {
                return (point, 0.0);
            }
            (position + from * (shape.size[0] / far), gap * gap)
        }
        shape_kind::CUBOID => {
            let size = vec3(shape.size);
            let local = rotate_back(rotation, from);
            let nearest = local.max(-size).min(size);
            let out = local - nearest;
            let square = out.dot(out);
            if square == 0.0 {
                return (point, 0.0);
            }
            (position + rotate(rotation, nearest), square)
        }
        _ => {
            let normal = rotate(rotation, Vec3::Y);
            let height = normal.dot(from);
            if height <= 0.0 {
                return (point, 0.0);
            }
            (point - normal * height, height * height)
        }
    }
}
