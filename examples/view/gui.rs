//! The panel's way onto the screen: egui between winit and wgpu.

use crate::screen::Screen;
use egui::{Context, Rect, ViewportId};
use egui_wgpu::{RendererOptions, ScreenDescriptor};
use std::time::Duration;
use winit::event::WindowEvent;
use winit::window::Window;

/// What egui keeps.
pub(crate) struct Gui {
    context: Context,
    state: egui_winit::State,
    renderer: egui_wgpu::Renderer,
    textures: egui::TexturesDelta,
    jobs: Vec<egui::ClippedPrimitive>,
    pixels_per_point: f32,
    /// When it wants to be drawn again, though nothing happens.
    pub(crate) repaint_in: Duration,
}

impl Gui {
    pub(crate) fn new(screen: &Screen) -> Self {
        let context = Context::default();
        context.set_theme(egui::Theme::Dark);
        let most = screen.device.limits().max_texture_dimension_2d as usize;
        let state = egui_winit::State::new(context.clone(), ViewportId::ROOT, &screen.window, None, None, Some(most));
        Self {
            state,
            renderer: egui_wgpu::Renderer::new(&screen.device, screen.format(), RendererOptions::default()),
            context,
            textures: egui::TexturesDelta::default(),
            jobs: Vec::new(),
            pixels_per_point: 1.0,
            repaint_in: Duration::MAX,
        }
    }

    /// Whether the event is the panel's alone, and whether it wants to be drawn anew.
    pub(crate) fn on_event(&mut self, window: &Window, event: &WindowEvent) -> (bool, bool) {
        let response = self.state.on_window_event(window, event);
        (response.consumed, response.repaint)
    }

    /// Lays out a frame.
    pub(crate) fn run<T>(&mut self, window: &Window, show: impl Fn(&Context) -> T) -> Option<T> {
        let input = self.state.take_egui_input(window);
        let mut shown = None;
        let output = self.context.run_ui(input, |ui| shown = Some(show(ui.ctx())));
        self.state.handle_platform_output(window, output.platform_output);
        self.repaint_in =
            output.viewport_output.get(&ViewportId::ROOT).map_or(Duration::MAX, |view| view.repaint_delay);
        self.textures.append(output.textures_delta);
        self.pixels_per_point = output.pixels_per_point;
        self.jobs = self.context.tessellate(output.shapes, output.pixels_per_point);
        shown
    }

    /// Draws the frame over what is in `view`.
    pub(crate) fn paint(&mut self, screen: &Screen, encoder: &mut wgpu::CommandEncoder, view: &wgpu::TextureView) {
        let (width, height) = screen.size();
        let descriptor = ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point: self.pixels_per_point };
        for (id, deltas) in self.textures.set.drain() {
            for delta in &deltas {
                self.renderer.update_texture(&screen.device, &screen.queue, id, delta);
            }
        }
        // Commands of paint callbacks, of which the panel has none.
        let _ = self.renderer.update_buffers(&screen.device, &screen.queue, encoder, &self.jobs, &descriptor);
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("panel"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        self.renderer.render(&mut pass.forget_lifetime(), &self.jobs, &descriptor);
        for id in self.textures.free.drain() {
            self.renderer.free_texture(&id);
        }
    }

    /// In pixels: left, top, right, bottom.
    pub(crate) fn pixels(&self, rect: Rect) -> [f32; 4] {
        [rect.min.x, rect.min.y, rect.max.x, rect.max.y].map(|x| x * self.pixels_per_point)
    }
}
