//! Poses that lie on the host, on their way to the device.

use crate::scoped;
use bytemuck::Zeroable;
use tumble_core::layout::{PoseRecord, body_flags, pose_tag};
use tumble_core::{Error, Poses, Result, RigidBodyType, Scene};
use wgpu::{Buffer, BufferUsages, Device, Queue};

/// A buffer of poses as a world on the GPU keeps one, filled from the host.
#[derive(Debug)]
pub struct PoseUpload {
    device: Device,
    queue: Queue,
    buffer: Option<Buffer>,
}

impl PoseUpload {
    /// Nothing is made yet.
    pub fn new(device: &Device, queue: &Queue) -> Self {
        Self { device: device.clone(), queue: queue.clone(), buffer: None }
    }

    /// Writes the poses of the scene's bodies, a [`PoseRecord`] a body slot, and returns the buffer that holds them. A
    /// body of the scene that has no pose yet is not drawn.
    ///
    /// # Errors
    /// [`Error::Limits`] when the device has no buffer that large, [`Error::Gpu`] when it refuses.
    pub fn write(&mut self, scene: &Scene, poses: &Poses) -> Result<&Buffer> {
        let records = records(scene, poses);
        let bytes: &[u8] = bytemuck::cast_slice(&records);
        let fits = self.buffer.as_ref().is_some_and(|buffer| buffer.size() >= bytes.len() as u64);
        if !fits {
            let limits = self.device.limits();
            let available = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
            if bytes.len() as u64 > available {
                let (adapter, needed) = (self.device.adapter_info().name, bytes.len() as u64);
                let limit = "max_storage_buffer_binding_size";
                return Err(Error::Limits { adapter, limit, needed, available });
            }
            let size = (bytes.len().next_power_of_two() as u64).min(available);
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
            let descriptor =
                wgpu::BufferDescriptor { label: Some("drawn poses"), size, usage, mapped_at_creation: false };
            self.buffer =
                Some(scoped(&self.device, "the buffer of poses to draw", || self.device.create_buffer(&descriptor))?);
        }
        match &self.buffer {
            Some(buffer) => {
                self.queue.write_buffer(buffer, 0, bytes);
                Ok(buffer)
            }
            None => Err(Error::Gpu { what: "the buffer of poses to draw".into(), message: "there is none".into() }),
        }
    }
}

/// By slot; at least one, since no binding may be empty.
fn records(scene: &Scene, poses: &Poses) -> Vec<PoseRecord> {
    let slots = scene.bodies().map(|body| body.slot() + 1).max().unwrap_or(1);
    let mut records = vec![PoseRecord::zeroed(); slots];
    for body in scene.bodies() {
        let (Ok(pose), Ok(builder)) = (poses.get(body), scene.body(body)) else { continue };
        let kind = match builder.body_type {
            RigidBodyType::Fixed => body_flags::FIXED,
            RigidBodyType::KinematicVelocityBased | RigidBodyType::KinematicPositionBased => body_flags::KINEMATIC,
            RigidBodyType::Dynamic => body_flags::DYNAMIC,
        };
        records[body.slot()] = PoseRecord {
            translation: pose.translation.to_array(),
            tag: pose_tag(kind, body.generation()),
            rotation: pose.rotation.to_array(),
        };
    }
    records
}
