//! What a picture shows besides the bodies, and in which colours.

use glam::Vec3;

/// How a picture is drawn. Colours are sRGB: red, green, blue, and how much of it covers what is below (0 to 255).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style<'a> {
    /// A colour a body slot, laid over the body's own as far as its fourth part says; bodies behind the end keep theirs.
    pub colors: &'a [[u8; 4]],
    /// Dots.
    pub markers: &'a [Marker],
    /// Lines.
    pub lines: &'a [Line],
    /// Whether bodies cast shadows.
    pub shadows: bool,
    /// Whether fixed boxes that stand between the camera and what it looks at are drawn as glass. They would hide it.
    pub see_through: bool,
}

impl Default for Style<'_> {
    /// Bodies in their own colours, with shadows, seen through walls, and nothing else.
    fn default() -> Self {
        Self { colors: &[], markers: &[], lines: &[], shadows: true, see_through: true }
    }
}

/// A dot in the world that faces the camera. Where a body hides it, it shows faintly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// m, world.
    pub position: Vec3,
    /// See [`Style`].
    pub color: [u8; 4],
    /// m; drawn at least two pixels wide.
    pub radius: f32,
}

/// A thin line in the world, two pixels wide. Where a body hides it, it shows faintly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// m, world.
    pub from: Vec3,
    /// m, world.
    pub to: Vec3,
    /// See [`Style`].
    pub color: [u8; 4],
}
