//! The shaders' text, each complete with what it shares; public so that tests can translate them.

/// Cuboids and balls.
pub const BODIES: &str = concat!(include_str!("frame.wgsl"), include_str!("bodies.wgsl"));
/// Half-spaces and the sky.
pub const GROUND: &str = concat!(include_str!("frame.wgsl"), include_str!("ground.wgsl"));
/// Markers and lines.
pub const OVERLAY: &str = concat!(include_str!("frame.wgsl"), include_str!("overlay.wgsl"));

/// All of them, by name.
pub const ALL: [(&str, &str); 3] = [("bodies", BODIES), ("ground", GROUND), ("overlay", OVERLAY)];
