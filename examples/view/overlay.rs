//! What is drawn over the bodies: their load, their contacts, the line to what is held.

use crate::args::Coloring;
use crate::grab::Grab;
use crate::simulation::Simulation;
use tumble::core::glam::Vec3;
use tumble::core::layout::LAST_BATCH;
use tumble::{Contact, Contacts, Result, RigidBodyType, Scene};
use tumble_draw::{Line, Marker, Style};

/// Load from which on a body has the ramp's last colour, in its own weights; one weight is its first.
const FULL_LOAD: f32 = 16.0;
/// From least to most.
const RAMP: [[u8; 3]; 5] = [[58, 110, 165], [86, 160, 150], [222, 196, 98], [226, 128, 68], [190, 48, 48]];
const UNTOUCHED: [u8; 4] = [214, 219, 224, 255];
const DOT: [u8; 4] = [26, 30, 36, 255];
/// Thin, since those within a heap show through it.
const NORMAL: [u8; 4] = [24, 28, 36, 140];
const SEQUENTIAL: [u8; 4] = [255, 0, 200, 255];
const HELD: [u8; 4] = [255, 210, 60, 255];

/// Kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Overlay {
    colors: Vec<[u8; 4]>,
    markers: Vec<Marker>,
    lines: Vec<Line>,
    /// N, by body slot; zero for what does not move. Those of the scene's revision.
    weights: Vec<f32>,
    revision: Option<u64>,
}

impl Overlay {
    /// Takes the state after the last step.
    pub(crate) fn update(
        &mut self,
        simulation: &mut Simulation,
        coloring: Coloring,
        held: Option<(Grab, Vec3)>,
    ) -> Result<()> {
        self.colors.clear();
        self.markers.clear();
        self.lines.clear();
        // After an error the world has none to give.
        if coloring != Coloring::Body && simulation.error.is_none() {
            if self.revision != Some(simulation.revision) {
                self.weights = weights(simulation.world.scene());
                self.revision = Some(simulation.revision);
            }
            let contacts = simulation.world.contacts()?;
            match coloring {
                Coloring::Contacts => self.add_contacts(&contacts, simulation.size),
                _ => self.add_batches(&contacts, simulation.size),
            }
        }
        if let Some((grab, target)) = held {
            let from = grab.point(&mut simulation.world)?;
            let radius = 0.06 * simulation.size;
            self.lines.push(Line { from, to: target, color: HELD });
            self.markers.extend([from, target].map(|position| Marker { position, color: HELD, radius }));
        }
        Ok(())
    }

    /// A picture with all that.
    pub(crate) fn style(&self) -> Style<'_> {
        Style { colors: &self.colors, markers: &self.markers, lines: &self.lines, ..Style::default() }
    }

    fn add_contacts(&mut self, contacts: &Contacts, size: f32) {
        let mut loads = vec![0.0; self.weights.len()];
        let mean = mean_above_zero(&self.weights).max(f32::MIN_POSITIVE);
        for contact in &contacts.all {
            for point in contact.points() {
                let force = point.normal_impulse / contacts.dt;
                self.markers.push(Marker { position: point.position, color: DOT, radius: 0.045 * size });
                // One body's size for one body's weight.
                let length = size * (force / mean).min(4.0);
                if length > 0.02 * size {
                    let to = point.position + contact.normal * length;
                    self.lines.push(Line { from: point.position, to, color: NORMAL });
                }
                for body in [contact.body_a, contact.body_b] {
                    if let Some(load) = loads.get_mut(body.slot()) {
                        // Above zero for all that touch.
                        *load += force.max(f32::MIN_POSITIVE);
                    }
                }
            }
        }
        let color = |(load, weight): (f32, f32)| match (weight > 0.0, load > 0.0) {
            (false, _) => [0; 4],
            (true, false) => UNTOUCHED,
            (true, true) => ramp((load / weight).max(1.0).log2() / FULL_LOAD.log2()),
        };
        self.colors.extend(loads.into_iter().zip(self.weights.iter().copied()).map(color));
    }

    fn add_batches(&mut self, contacts: &Contacts, size: f32) {
        let gray = |weight: &f32| if *weight > 0.0 { [150, 155, 160, 235] } else { [0; 4] };
        self.colors.extend(self.weights.iter().map(gray));
        let markers = |contact: &Contact| {
            let (color, points) = (batch_color(contact.batch), contact.points().to_vec());
            points.into_iter().map(move |point| Marker { position: point.position, color, radius: 0.11 * size })
        };
        self.markers.extend(contacts.all.iter().flat_map(markers));
    }
}

/// A hue a batch, neighbours far from each other; the one that is solved in sequence stands out.
pub(crate) fn batch_color(batch: u32) -> [u8; 4] {
    if batch >= LAST_BATCH {
        return SEQUENTIAL;
    }
    // By the golden ratio, no two of the first dozens look alike.
    let hue = 6.0 * (batch as f32 * 0.618_034).fract();
    let channel = |shift: f32| {
        let distance = ((hue + shift).rem_euclid(6.0) - 3.0).abs();
        (60.0 + 185.0 * (distance - 1.0).clamp(0.0, 1.0)) as u8
    };
    [channel(0.0), channel(4.0), channel(2.0), 255]
}

/// A colour of the ramp, from 0 to 1.
pub(crate) fn ramp(share: f32) -> [u8; 4] {
    let at = share.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    let first = (at as usize).min(RAMP.len() - 2);
    let mix = |i: usize| {
        let (from, to) = (f32::from(RAMP[first][i]), f32::from(RAMP[first + 1][i]));
        (from + (to - from) * (at - first as f32)).round() as u8
    };
    [mix(0), mix(1), mix(2), 255]
}

fn weights(scene: &Scene) -> Vec<f32> {
    // Where nothing falls, by the Earth's gravity.
    let gravity = if scene.gravity.length() > 0.0 { scene.gravity.length() } else { 9.81 };
    let mut weights = Vec::new();
    for body in scene.bodies() {
        weights.resize(weights.len().max(body.slot() + 1), 0.0);
        if scene.body(body).is_ok_and(|b| b.body_type == RigidBodyType::Dynamic) {
            weights[body.slot()] = scene.mass_properties(body).map_or(0.0, |mass| mass.mass * gravity);
        }
    }
    weights
}

fn mean_above_zero(values: &[f32]) -> f32 {
    let (sum, count) =
        values.iter().filter(|v| **v > 0.0).fold((0.0, 0u32), |(sum, count), v| (sum + f64::from(*v), count + 1));
    (sum / f64::from(count.max(1))) as f32
}
