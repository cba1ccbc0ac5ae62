//! From where a picture is taken.

use crate::Bounds;
use glam::{Mat4, Vec2, Vec3};

/// What a picture shows around the framed box, as a share of the distance.
const MARGIN: f32 = 1.04;
/// Steepest pitch of an [`OrbitCamera`], rad: straight down has no up.
const STEEPEST: f32 = 1.55;

/// A pinhole camera in the world's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where it is, m.
    pub eye: Vec3,
    /// What lies in the middle of the picture, m. Shadows are sharpest around it.
    pub look_at: Vec3,
    /// What is up in the picture; of any length, not along the view.
    pub up: Vec3,
    /// Angle between the lower and upper edge of the picture, rad.
    pub fov_y: f32,
    /// What is nearer than this is not drawn, m. There is no far end.
    pub near: f32,
}

impl Camera {
    /// Sees the whole box in a picture of width / height = `aspect`. `yaw` turns about +y (0 looks along -z, from +z),
    /// `pitch` lifts the camera, `fov_y` is the picture's height; rad.
    pub fn framing(bounds: &Bounds, yaw: f32, pitch: f32, fov_y: f32, aspect: f32) -> Self {
        OrbitCamera::framing(bounds, yaw, pitch, fov_y, aspect).camera()
    }

    /// Unit vectors of the picture in the world: right, up, and into it.
    pub fn axes(&self) -> [Vec3; 3] {
        let forward = (self.look_at - self.eye).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(self.up);
        // An up along the view says nothing: take any.
        let right = right.try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        [right, right.cross(forward), forward]
    }

    /// World to clip space of a picture of width / height = `aspect`: x and y from -1 to 1, depth 1 at `near` and 0
    /// without end.
    pub fn view_projection(&self, aspect: f32) -> Mat4 {
        let [right, up, forward] = self.axes();
        let high = 1.0 / (0.5 * self.fov_y).tan();
        let (x, y) = (right * (high / aspect), up * high);
        let rows = [x.extend(-x.dot(self.eye)), y.extend(-y.dot(self.eye)), Vec3::ZERO.extend(self.near)];
        Mat4::from_cols(rows[0], rows[1], rows[2], forward.extend(-forward.dot(self.eye))).transpose()
    }

    /// The ray through a place of a picture of `width` times `height` pixels: the eye, and a unit vector. `x` and `y`
    /// count pixels from the upper left corner; the middle of the first pixel is at 0.5.
    pub fn ray(&self, x: f32, y: f32, width: u32, height: u32) -> (Vec3, Vec3) {
        let [right, up, forward] = self.axes();
        let tan = (0.5 * self.fov_y).tan();
        let (width, height) = (width.max(1) as f32, height.max(1) as f32);
        // Pixels are square, so the height's scale holds for both.
        let (across, above) = (tan * (2.0 * x - width) / height, tan * (height - 2.0 * y) / height);
        (self.eye, (forward + right * across + up * above).normalize())
    }

    /// Where a point of the world is in such a picture, pixels; `None` if it is not before the camera.
    pub fn project(&self, point: Vec3, width: u32, height: u32) -> Option<Vec2> {
        let [right, up, forward] = self.axes();
        let (width, height) = (width.max(1) as f32, height.max(1) as f32);
        let (from, tan) = (point - self.eye, (0.5 * self.fov_y).tan());
        let depth = from.dot(forward);
        let half = Vec2::new(width, height) * 0.5;
        let shift = Vec2::new(from.dot(right), -from.dot(up)) * (0.5 * height / (tan * depth));
        (depth >= self.near).then(|| half + shift)
    }
}

/// A camera that turns around a point; +y is up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitCamera {
    /// What it turns around, m.
    pub focus: Vec3,
    /// From there to the eye, m.
    pub distance: f32,
    /// About +y, rad; at 0 the eye is at +z.
    pub yaw: f32,
    /// Above the horizon, rad; kept within 1.55 to both sides.
    pub pitch: f32,
    /// See [`Camera::fov_y`].
    pub fov_y: f32,
}

impl OrbitCamera {
    /// As [`Camera::framing`].
    pub fn framing(bounds: &Bounds, yaw: f32, pitch: f32, fov_y: f32, aspect: f32) -> Self {
        let mut orbit = Self { focus: bounds.middle(), distance: 1.0, yaw, pitch, fov_y };
        let [right, up, forward] = orbit.camera().axes();
        let high = (0.5 * fov_y).tan();
        let half = bounds.half_extents();
        // A corner is seen if its distance across the view is below tan * (distance + its depth behind the focus).
        let needed = |corner: u32| {
            let sign = |axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
            let corner = half * Vec3::new(sign(0), sign(1), sign(2));
            let across = (corner.dot(right).abs() / (high * aspect)).max(corner.dot(up).abs() / high);
            across - corner.dot(forward)
        };
        orbit.distance = (0..8).map(needed).fold(1e-3, f32::max) * MARGIN;
        orbit
    }

    /// The camera that it is.
    pub fn camera(&self) -> Camera {
        let (sin, cos) = self.pitch.clamp(-STEEPEST, STEEPEST).sin_cos();
        let back = Vec3::new(self.yaw.sin() * cos, sin, self.yaw.cos() * cos);
        Camera {
            eye: self.focus + back * self.distance,
            look_at: self.focus,
            up: Vec3::Y,
            fov_y: self.fov_y,
            near: 2e-3 * self.distance,
        }
    }

    /// Turns by these angles, rad.
    pub fn turn(&mut self, yaw: f32, pitch: f32) {
        self.yaw = (self.yaw + yaw).rem_euclid(std::f32::consts::TAU);
        self.pitch = (self.pitch + pitch).clamp(-STEEPEST, STEEPEST);
    }

    /// Multiplies the distance; below one comes nearer.
    pub fn zoom(&mut self, factor: f32) {
        self.distance = (self.distance * factor).clamp(1e-4, 1e7);
    }

    /// Moves the focus to the right and up in the picture, by parts of the picture's height.
    pub fn pan(&mut self, right: f32, up: f32) {
        let axes = self.camera().axes();
        self.focus += (axes[0] * right + axes[1] * up) * (2.0 * self.distance * (0.5 * self.fov_y).tan());
    }
}
