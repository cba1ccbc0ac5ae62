//! Pictures of scenes, and what can be told of their pixels.

use crate::common::gpu;
use glam::{Vec2, Vec3};
use tumble::prelude::*;
use tumble_core::measures;
use tumble_draw::{Camera, Offscreen, PoseUpload, Renderer, Style};

pub(crate) const SIZE: (u32, u32) = (320, 240);
/// Bodies alone.
pub(crate) const PLAIN: Style = Style { colors: &[], markers: &[], lines: &[], shadows: false, see_through: false };

/// A picture, a row after the other.
#[derive(PartialEq)]
pub(crate) struct Picture(pub(crate) Vec<[u8; 4]>);

impl Picture {
    pub(crate) fn of(pixels: &[u8]) -> Self {
        assert_eq!(pixels.len(), (4 * SIZE.0 * SIZE.1) as usize);
        let pixels: Vec<[u8; 4]> = pixels.as_chunks().0.to_vec();
        assert!(pixels.iter().all(|pixel| pixel[3] == 255), "pictures have no holes");
        Self(pixels)
    }

    /// Of the scene as it was described.
    pub(crate) fn first(scene: &Scene, camera: &Camera, style: &Style) -> Self {
        Self::taken(scene, &measures::initial_poses(scene), camera, style)
    }

    pub(crate) fn taken(scene: &Scene, poses: &Poses, camera: &Camera, style: &Style) -> Self {
        let (device, queue) = (&gpu().device, &gpu().queue);
        let mut upload = PoseUpload::new(device, queue);
        let poses = upload.write(scene, poses).unwrap();
        Self::drawn(&mut Renderer::new(device, Offscreen::FORMAT, scene).unwrap(), camera, poses, style)
    }

    pub(crate) fn drawn(renderer: &mut Renderer, camera: &Camera, poses: &wgpu::Buffer, style: &Style) -> Self {
        let offscreen = Offscreen::new(&gpu().device, &gpu().queue, SIZE.0, SIZE.1).unwrap();
        Self::of(&offscreen.picture(renderer, camera, poses, style).unwrap())
    }

    pub(crate) fn at(&self, place: Vec2) -> [u8; 4] {
        self.0[(place.y as u32 * SIZE.0 + place.x as u32) as usize]
    }

    /// The largest difference of a channel.
    pub(crate) fn difference(a: [u8; 4], b: [u8; 4]) -> u8 {
        (0..4).map(|i| a[i].abs_diff(b[i])).max().unwrap()
    }

    /// Middles of the pixels in which two pictures differ by more than this.
    pub(crate) fn changed(&self, other: &Self, more_than: u8) -> Vec<Vec2> {
        let differs = |i: &usize| Self::difference(self.0[*i], other.0[*i]) > more_than;
        let middle = |i: usize| Vec2::new((i as u32 % SIZE.0) as f32 + 0.5, (i as u32 / SIZE.0) as f32 + 0.5);
        (0..self.0.len()).filter(differs).map(middle).collect()
    }
}

pub(crate) fn brightness(pixel: [u8; 4]) -> u32 {
    pixel[..3].iter().map(|&part| u32::from(part)).sum()
}

pub(crate) fn camera(eye: Vec3, look_at: Vec3) -> Camera {
    Camera { eye, look_at, up: Vec3::Y, fov_y: 0.8, near: 0.01 }
}

pub(crate) fn dynamic(place: Vec3) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(place)
}

/// The light that a stored part stands for, nearly.
pub(crate) fn light(part: u8) -> f32 {
    (f32::from(part) / 255.0).powf(2.2)
}

/// Which of red, green and blue are strong, as bits; 7 for greys.
pub(crate) fn hue(pixel: [u8; 4]) -> u32 {
    // Light, not its code: what shines has white on top of its colour.
    let most = light(pixel[..3].iter().copied().max().unwrap_or(0));
    (0..3).filter(|&i| light(pixel[i]) > 0.5 * most).map(|i| 1 << i).sum()
}

/// A strong colour for each hue from 1 to 6.
pub(crate) fn color(hue: u32) -> [u8; 4] {
    let part = |bit: u32| if hue >> bit & 1 == 1 { 255 } else { 0 };
    [part(0), part(1), part(2), 255]
}
