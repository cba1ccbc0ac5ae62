//! What keys and the pointer mean.

use crate::args::Coloring;
use crate::grab::Grab;
use crate::simulation::Projectile;
use tumble::core::glam::Vec2;
use tumble_draw::OrbitCamera;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta};
use winit::keyboard::{Key, NamedKey};

/// What the user may ask for, by key or in the panel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Action {
    Pause,
    Step,
    Reset,
    Frame,
    Throw(Projectile),
    Color(Coloring),
    Substeps(u32),
    Profile(bool),
    Help,
    Panel,
    Quit,
}

/// All keys, as the help tells them.
pub(crate) const KEYS: &[(&str, &str)] = &[
    ("drag a body", "pull it"),
    ("drag elsewhere, or right", "turn the view"),
    ("middle or Shift drag", "move the view"),
    ("wheel", "nearer, farther"),
    ("F", "the whole scene"),
    ("Space", "pause"),
    ("N or .", "one step"),
    ("R", "begin anew"),
    ("B, M", "throw a box, a ball at the cursor"),
    ("1", "colours: bodies"),
    ("2", "colours: load, contacts"),
    ("3", "colours: batches"),
    ("P", "panel"),
    ("H", "this help"),
    ("Esc", "end"),
];

/// Turn of the camera for a drag over the window's height, rad.
const TURN: f32 = 4.0;
/// Factor on the distance for a notch of the wheel.
const ZOOM: f32 = 0.88;
/// Pixels that touchpads scroll for a notch.
const NOTCH: f32 = 60.0;

/// What a key does.
pub(crate) fn action(event: &KeyEvent) -> Option<Action> {
    if event.state != ElementState::Pressed {
        return None;
    }
    let action = match &event.logical_key {
        Key::Named(NamedKey::Space) => Action::Pause,
        Key::Named(NamedKey::Escape) => Action::Quit,
        Key::Named(NamedKey::F1) => Action::Help,
        Key::Character(text) => match text.to_lowercase().as_str() {
            "n" | "." => Action::Step,
            "r" => Action::Reset,
            "f" => Action::Frame,
            "b" => Action::Throw(Projectile::Cuboid),
            "m" => Action::Throw(Projectile::Ball),
            "1" => Action::Color(Coloring::Body),
            "2" => Action::Color(Coloring::Contacts),
            "3" => Action::Color(Coloring::Batches),
            "p" => Action::Panel,
            "h" | "?" => Action::Help,
            _ => return None,
        },
        _ => return None,
    };
    // A key that is held down steps on, and throws on.
    (!event.repeat || matches!(action, Action::Step | Action::Throw(_))).then_some(action)
}

/// What the pointer does while a button is down.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Drag {
    /// Turns the camera.
    Turn,
    /// Moves it.
    Pan,
    /// Pulls a body.
    Pull(Grab),
}

/// What is dragged, and by which button.
#[derive(Debug, Default)]
pub(crate) struct Pointer {
    /// Pixels from the upper left corner.
    pub(crate) at: Vec2,
    pub(crate) drag: Option<(MouseButton, Drag)>,
}

impl Pointer {
    /// To a place in a window of this height; moves the camera when it is dragged.
    pub(crate) fn go(&mut self, to: Vec2, height: u32, camera: &mut OrbitCamera) {
        let by = (to - self.at) / height.max(1) as f32;
        self.at = to;
        match self.drag {
            Some((_, Drag::Turn)) => camera.turn(-TURN * by.x, TURN * by.y),
            Some((_, Drag::Pan)) => camera.pan(-by.x, by.y),
            Some((_, Drag::Pull(_))) | None => {}
        }
    }

    /// The body that is held.
    pub(crate) fn held(&self) -> Option<Grab> {
        match self.drag {
            Some((_, Drag::Pull(grab))) => Some(grab),
            _ => None,
        }
    }
}

/// The factor on the camera's distance.
pub(crate) fn zoom(delta: &MouseScrollDelta) -> f32 {
    let notches = match delta {
        MouseScrollDelta::LineDelta(_, y) => *y,
        MouseScrollDelta::PixelDelta(by) => by.y as f32 / NOTCH,
    };
    ZOOM.powf(notches.clamp(-10.0, 10.0))
}
