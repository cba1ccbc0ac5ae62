//! spike
use std::sync::Arc;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::window::{Window, WindowId};
#[derive(Default)]
struct App { w: Option<(Arc<Window>, wgpu::Surface<'static>, wgpu::Device, wgpu::Queue, wgpu::SurfaceConfiguration)>, n: u32 }
impl ApplicationHandler for App {
    fn resumed(&mut self, el: &ActiveEventLoop) {
        let w = Arc::new(el.create_window(Window::default_attributes().with_inner_size(winit::dpi::PhysicalSize::new(1280, 720))).unwrap());
        let mut d = wgpu::InstanceDescriptor::new_without_display_handle();
        d.backends = wgpu::Backends::VULKAN;
        let inst = wgpu::Instance::new(d);
        let s = inst.create_surface(w.clone()).unwrap();
        for a in pollster::block_on(inst.enumerate_adapters(wgpu::Backends::VULKAN)) {
            println!("{:?} {}", a.get_info(), a.is_surface_supported(&s));
            println!("{:?}", s.get_capabilities(&a));
            let (dev, q) = pollster::block_on(a.request_device(&Default::default())).unwrap();
            let c = s.get_default_config(&a, 1280, 720).unwrap();
            s.configure(&dev, &c);
            println!("{c:?}");
            self.w = Some((w.clone(), s, dev, q, c));
            break;
        }
        w.request_redraw();
    }
    fn window_event(&mut self, el: &ActiveEventLoop, _: WindowId, e: WindowEvent) {
        match e {
            WindowEvent::CloseRequested => el.exit(),
            WindowEvent::RedrawRequested => {
                let (w, s, dev, q, _) = self.w.as_ref().unwrap();
                let t = s.get_current_texture();
                let wgpu::CurrentSurfaceTexture::Success(t) = t else { println!("{t:?}"); return };
                let v = t.texture.create_view(&Default::default());
                let mut enc = dev.create_command_encoder(&Default::default());
                enc.begin_render_pass(&wgpu::RenderPassDescriptor { color_attachments: &[Some(wgpu::RenderPassColorAttachment { view: &v, depth_slice: None, resolve_target: None, ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color { r: 0.1, g: 0.5, b: 0.9, a: 1.0 }), store: wgpu::StoreOp::Store } })], ..Default::default() });
                q.submit([enc.finish()]);
                w.pre_present_notify();
                q.present(t);
                self.n += 1;
                println!("presented {}", self.n);
                w.request_redraw();
            }
            _ => {}
        }
    }
}
fn main() { EventLoop::new().unwrap().run_app(&mut App::default()).unwrap(); }
