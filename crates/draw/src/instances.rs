//! A scene's colliders as instances to draw, one list a shape.

use bytemuck::{Pod, Zeroable};
use glam::{Quat, Vec3};
use tumble_core::{RigidBodyType, Scene, Shape};

/// Of bodies that move, by slot in turn.
const PALETTE: [[u8; 3]; 8] = [
    [42, 157, 143],
    [233, 196, 106],
    [231, 111, 81],
    [95, 168, 211],
    [244, 162, 97],
    [61, 111, 165],
    [181, 210, 173],
    [240, 230, 210],
];
const FIXED: [u8; 3] = [190, 194, 199];
const GROUND: [u8; 3] = [214, 216, 219];
const KINEMATIC: [u8; 3] = [122, 104, 150];

/// A collider as the shaders read it; see `frame.wgsl`. 52 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(crate) struct Instance {
    /// In the body's own frame, m.
    translation: [f32; 3],
    /// Slot.
    body: u32,
    rotation: [f32; 4],
    /// Half extents, or a radius in the first, m.
    size: [f32; 3],
    /// Of the body's handle, as far as a pose holds it.
    generation: u32,
    /// sRGB.
    color: [u8; 4],
}

/// A list a shape. Those of bodies that are not dynamic come first in it.
#[derive(Debug, Default)]
pub(crate) struct Instances {
    pub(crate) cuboids: Vec<Instance>,
    pub(crate) balls: Vec<Instance>,
    pub(crate) halfspaces: Vec<Instance>,
    /// How many of the cuboids belong to bodies that are not dynamic.
    pub(crate) walls: usize,
}

impl Instances {
    pub(crate) fn of(scene: &Scene) -> Self {
        let mut all = Self::default();
        for is_dynamic in [false, true] {
            for body in scene.bodies() {
                let (Ok(builder), Ok(colliders)) = (scene.body(body), scene.colliders_of(body)) else { continue };
                if (builder.body_type == RigidBodyType::Dynamic) != is_dynamic {
                    continue;
                }
                let own_color = color(builder.body_type, body.slot());
                for (_, collider) in colliders {
                    let (list, size, own) = match collider.shape {
                        Shape::Ball { radius } => (&mut all.balls, Vec3::splat(radius), Quat::IDENTITY),
                        Shape::Cuboid { half_extents } => (&mut all.cuboids, half_extents, Quat::IDENTITY),
                        Shape::HalfSpace { normal } => {
                            let turn = Quat::from_rotation_arc(Vec3::Y, normal.normalize_or(Vec3::Y));
                            (&mut all.halfspaces, Vec3::ZERO, turn)
                        }
                        // A shape newer than this crate.
                        _ => continue,
                    };
                    let is_ground = matches!(collider.shape, Shape::HalfSpace { .. });
                    let [r, g, b] = if is_ground { GROUND } else { own_color };
                    list.push(Instance {
                        translation: collider.translation.to_array(),
                        body: body.slot() as u32,
                        rotation: (collider.rotation.normalize() * own).normalize().to_array(),
                        size: size.to_array(),
                        generation: body.generation() & 0x00ff_ffff,
                        color: [r, g, b, 255],
                    });
                }
            }
            if !is_dynamic {
                all.walls = all.cuboids.len();
            }
        }
        all
    }
}

/// Of a body's own.
fn color(kind: RigidBodyType, slot: usize) -> [u8; 3] {
    match kind {
        RigidBodyType::Fixed => FIXED,
        RigidBodyType::KinematicVelocityBased | RigidBodyType::KinematicPositionBased => KINEMATIC,
        RigidBodyType::Dynamic => {
            let hash = mix(slot as u32);
            let light = 0.92 + 0.08 * ((hash & 255) as f32 / 255.0);
            PALETTE[(hash >> 29) as usize].map(|part| (f32::from(part) * light) as u8)
        }
    }
}

/// The same word for the same slot, and no pattern among neighbours, which often lie side by side (murmur3's last step).
fn mix(slot: u32) -> u32 {
    let mut x = slot ^ slot >> 16;
    x = x.wrapping_mul(0x85eb_ca6b);
    x ^= x >> 13;
    x = x.wrapping_mul(0xc2b2_ae35);
    x ^ x >> 16
}
