//! The panel: what the world does, and the switches.

use crate::args::Coloring;
use crate::input::{Action, KEYS};
use crate::overlay::{batch_color, ramp};
use crate::simulation::Projectile;
use egui::{Align2, Button, Color32, Context, Frame, Grid, Rect, RichText, Slider, Ui, Window};
use tumble::core::layout::LAST_BATCH;
use tumble::{Params, StepReport};

const PANEL: Color32 = Color32::from_rgb(19, 22, 27);
const VALUE: Color32 = Color32::from_rgb(236, 239, 243);
const BAD: Color32 = Color32::from_rgb(255, 92, 88);
const SLOW: Color32 = Color32::from_rgb(250, 190, 80);
const WIDTH: f32 = 244.0;

/// What the panel tells.
pub(crate) struct Facts<'a> {
    pub(crate) scene: &'a str,
    pub(crate) report: &'a StepReport,
    pub(crate) params: &'a Params,
    /// Of the window.
    pub(crate) adapter: &'a str,
    pub(crate) is_gpu: bool,
    /// Bodies in the scene, the edits of the coming step included.
    pub(crate) bodies: usize,
    /// 1/s.
    pub(crate) frames: Option<f64>,
    /// A step.
    pub(crate) milliseconds: Option<f64>,
    pub(crate) slowness: Option<f64>,
    /// J.
    pub(crate) energy: Option<f64>,
    pub(crate) is_paused: bool,
    pub(crate) error: Option<&'a str>,
    pub(crate) coloring: Coloring,
    pub(crate) shows_panel: bool,
    pub(crate) shows_help: bool,
}

/// What the user did in it, and where it is.
pub(crate) struct Answer {
    pub(crate) actions: Vec<Action>,
    /// Points; `None` when it is hidden.
    pub(crate) rect: Option<Rect>,
}

/// Shows all windows.
pub(crate) fn show(context: &Context, facts: &Facts) -> Answer {
    let mut actions = Vec::new();
    let frame = Frame::window(&context.global_style()).fill(PANEL).corner_radius(6).inner_margin(10);
    let mut rect = None;
    if facts.shows_panel {
        let window = Window::new("tumble").title_bar(false).resizable(false).movable(false).frame(frame);
        let shown = window.anchor(Align2::LEFT_TOP, [12.0, 12.0]).show(context, |ui| {
            ui.set_width(WIDTH);
            ui.spacing_mut().item_spacing.y = 4.0;
            heading(ui, facts);
            statistics(ui, facts);
            ui.separator();
            switches(ui, facts, &mut actions);
            ui.separator();
            coloring(ui, facts, &mut actions);
            stages(ui, facts, &mut actions);
            ui.add_space(4.0);
            ui.weak("H: all keys");
        });
        rect = shown.map(|shown| shown.response.rect);
    }
    if let Some(error) = facts.error {
        let window = Window::new("error").title_bar(false).resizable(false).movable(false).frame(frame);
        window.anchor(Align2::CENTER_BOTTOM, [0.0, -16.0]).show(context, |ui| {
            ui.set_max_width(560.0);
            ui.label(RichText::new("The simulation stopped").color(BAD).strong());
            ui.label(RichText::new(error).color(VALUE));
            ui.weak("What is shown is the last good state. R begins anew, Space tries again.");
        });
    }
    if facts.shows_help {
        let window = Window::new("keys").title_bar(false).resizable(false).movable(false).frame(frame);
        window.anchor(Align2::RIGHT_TOP, [-12.0, 12.0]).show(context, |ui| {
            Grid::new("keys").num_columns(2).spacing([18.0, 4.0]).show(ui, |ui| {
                for (keys, does) in KEYS {
                    ui.label(RichText::new(*keys).color(VALUE).strong());
                    ui.label(*does);
                    ui.end_row();
                }
            });
        });
    }
    Answer { actions, rect }
}

fn heading(ui: &mut Ui, facts: &Facts) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("tumble").color(VALUE).strong().size(17.0));
        ui.label(RichText::new(facts.scene).size(17.0));
    });
    let state = match (facts.error, facts.is_paused, facts.slowness) {
        (Some(_), ..) => RichText::new("stopped by an error").color(BAD),
        (None, true, _) => RichText::new("paused").color(SLOW),
        (None, false, Some(x)) if x > 1.05 => RichText::new(format!("slower than real time {x:.1} x")).color(SLOW),
        _ => RichText::new("real time").color(Color32::from_rgb(128, 200, 140)),
    };
    ui.label(state);
    ui.add_space(2.0);
}

fn statistics(ui: &mut Ui, facts: &Facts) {
    let report = facts.report;
    let number = |value: Option<f64>, digits: usize| value.map_or("–".to_owned(), |x| format!("{x:.digits$}"));
    Grid::new("statistics").num_columns(2).spacing([14.0, 3.0]).min_col_width(92.0).show(ui, |ui| {
        row(ui, "frames a second", &number(facts.frames.filter(|_| !facts.is_paused), 0), VALUE);
        row(ui, "ms a step", &number(facts.milliseconds, 2), VALUE);
        row(ui, "step", &grouped(report.step), VALUE);
        row(ui, "runs on", if facts.is_gpu { "GPU" } else { "CPU" }, VALUE);
        row(ui, "bodies", &grouped(facts.bodies as u64), VALUE);
        row(ui, "pairs", &grouped(report.pairs.into()), VALUE);
        row(ui, "contacts", &grouped(report.contacts.into()), VALUE);
        let batches = match report.last_batch {
            0 => report.batches.to_string(),
            more => format!("{} + {more} in turn", report.batches),
        };
        row(ui, "batches", &batches, VALUE);
        row(ui, "broad phase", &report.broadphase.to_string(), VALUE);
        if facts.energy.is_some() {
            row(ui, "kinetic energy", &facts.energy.map_or(String::new(), joules), VALUE);
        }
        let bad = |count: u64| if count == 0 { VALUE } else { BAD };
        row(ui, "lost", &grouped(report.lost), bad(report.lost));
        row(ui, "quarantined", &grouped(report.quarantined.into()), bad(report.quarantined.into()));
    });
    let side = if facts.is_gpu { "simulated and drawn on" } else { "drawn on" };
    ui.add_space(2.0);
    ui.small(format!("{side} {}", facts.adapter));
}

fn switches(ui: &mut Ui, facts: &Facts, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        let pause = if facts.is_paused { "Run" } else { "Pause" };
        let buttons =
            [(pause, Action::Pause), ("Step", Action::Step), ("Reset", Action::Reset), ("Frame", Action::Frame)];
        for (text, action) in buttons {
            if ui.add(Button::new(text)).clicked() {
                actions.push(action);
            }
        }
    });
    ui.horizontal(|ui| {
        let boxes = [("Throw box", Projectile::Cuboid), ("Throw ball", Projectile::Ball)];
        for (text, what) in boxes {
            if ui.button(text).clicked() {
                actions.push(Action::Throw(what));
            }
        }
    });
    let mut substeps = facts.params.accuracy.most();
    let most = substeps.max(16);
    if ui.add(Slider::new(&mut substeps, 1..=most).text("sub-steps")).changed() {
        actions.push(Action::Substeps(substeps));
    }
}

fn coloring(ui: &mut Ui, facts: &Facts, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.label("colours");
        for (text, value) in
            [("bodies", Coloring::Body), ("contacts", Coloring::Contacts), ("batches", Coloring::Batches)]
        {
            if ui.selectable_label(facts.coloring == value, text).clicked() {
                actions.push(Action::Color(value));
            }
        }
    });
    match facts.coloring {
        Coloring::Body => {}
        Coloring::Contacts => {
            ui.horizontal(|ui| {
                ui.small("load: 1 weight");
                let count = 24;
                strip(ui, count, 72.0, |i| ramp(i as f32 / (count - 1) as f32));
                ui.small("16");
            });
            ui.small("dots: contacts; lines: their force, the mean\nweight of a body as long as half a body");
        }
        Coloring::Batches => {
            let count = facts.report.batches.clamp(1, LAST_BATCH) as usize;
            ui.horizontal(|ui| {
                ui.small("1");
                strip(ui, count, 120.0, |i| batch_color(i as u32));
                ui.small(format!("{count}"));
                if facts.report.last_batch > 0 {
                    strip(ui, 1, 8.0, |_| batch_color(LAST_BATCH));
                    ui.small("in turn");
                }
            });
        }
    }
}

/// Cells of colour side by side.
fn strip(ui: &mut Ui, count: usize, width: f32, color: impl Fn(usize) -> [u8; 4]) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(width, 9.0), egui::Sense::hover());
    let step = width / count as f32;
    for i in 0..count {
        let [r, g, b, _] = color(i);
        let min = rect.min + egui::vec2(step * i as f32, 0.0);
        ui.painter().rect_filled(Rect::from_min_size(min, egui::vec2(step, 9.0)), 0, Color32::from_rgb(r, g, b));
    }
}

fn stages(ui: &mut Ui, facts: &Facts, actions: &mut Vec<Action>) {
    let mut profile = facts.params.profile;
    if ui.checkbox(&mut profile, "time the stages").changed() {
        actions.push(Action::Profile(profile));
    }
    if !profile {
        return;
    }
    // A stage may run in several parts.
    let mut stages: Vec<(&str, Option<f64>)> = Vec::new();
    for time in &facts.report.stages {
        match stages.iter_mut().find(|(stage, _)| *stage == time.stage) {
            Some((_, sum)) => *sum = sum.zip(time.milliseconds).map(|(a, b)| a + b),
            None => stages.push((time.stage, time.milliseconds)),
        }
    }
    if stages.is_empty() {
        ui.small(if facts.report.step == 0 { "after the next step" } else { "n/a: this adapter has no clock" });
    }
    Grid::new("stages").num_columns(2).spacing([14.0, 0.0]).min_row_height(14.0).show(ui, |ui| {
        for (stage, milliseconds) in stages {
            let told = milliseconds.map_or("n/a".to_owned(), |ms| format!("{ms:.3} ms"));
            ui.small(stage);
            ui.label(RichText::new(told).color(VALUE).monospace().small());
            ui.end_row();
        }
    });
}

fn row(ui: &mut Ui, name: &str, value: &str, color: Color32) {
    ui.label(name);
    ui.label(RichText::new(value).color(color).monospace());
    ui.end_row();
}

/// With a comma every three digits.
fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn joules(energy: f64) -> String {
    match energy {
        e if e >= 1e6 => format!("{:.2} MJ", e * 1e-6),
        e if e >= 1e3 => format!("{:.2} kJ", e * 1e-3),
        e => format!("{e:.2} J"),
    }
}
