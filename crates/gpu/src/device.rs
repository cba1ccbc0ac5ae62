//! A device, where it comes from, and how its failures become errors.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tumble_core::{Error, Result};
use wgpu::{Backends, DeviceType, ErrorFilter, Features, InstanceFlags, Limits};

/// Creating two devices at once has crashed drivers: one at a time.
static CREATION: Mutex<()> = Mutex::new(());

/// A device with its queue. Clones are handles to the same device.
#[derive(Debug, Clone)]
pub struct Gpu {
    /// The device, for creating things; prefer [`Gpu::scoped`] around that.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Name, driver, backend and kind of the adapter.
    pub info: wgpu::AdapterInfo,
    failures: Arc<Mutex<Failures>>,
}

#[derive(Debug, Default)]
struct Failures {
    /// Why the device was lost. Stays.
    lost: Option<String>,
    /// The first error that no scope caught since the last [`Gpu::check`].
    uncaught: Option<String>,
}

impl Gpu {
    /// The best adapter that is hardware, or `None` where there is none. Heeds `WGPU_ADAPTER_NAME`, part of the
    /// adapter's name.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] when there is one and it gives no device.
    pub fn hardware() -> Result<Option<Self>> {
        let found: Vec<_> = adapters()
            .into_iter()
            .filter(|adapter| adapter.get_info().device_type != DeviceType::Cpu && is_wanted(adapter))
            .collect();
        if found.is_empty() { Ok(None) } else { first_that_opens("a hardware adapter", &found).map(Some) }
    }

    /// The best adapter of any kind, hardware before software. Heeds `WGPU_ADAPTER_NAME`, part of the adapter's name.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] when there is none of that name, or none gives a device.
    pub fn any() -> Result<Self> {
        let all = adapters();
        let (found, others): (Vec<_>, Vec<_>) = all.into_iter().partition(is_wanted);
        let asked = match wanted_name() {
            Some(name) => format!("WGPU_ADAPTER_NAME={name}"),
            None => "any adapter".to_owned(),
        };
        if found.is_empty() && !others.is_empty() {
            let names: Vec<_> = others.iter().map(|adapter| adapter.get_info().name).collect();
            return Err(Error::NoAdapter { detail: format!("asked for {asked}, there is {}", names.join(", ")) });
        }
        first_that_opens(&asked, &found)
    }

    /// wgpu's backend that checks everything and runs nothing, with the default limits and sub-group operations.
    #[cfg(feature = "noop")]
    pub fn noop() -> Self {
        // Its adapter reports unlimited limits; the default ones are what every adapter has.
        let (required_features, required_limits) = (Features::SUBGROUP, Limits::default());
        let descriptor = wgpu::DeviceDescriptor { required_features, required_limits, ..Default::default() };
        let (device, queue) = wgpu::Device::noop(&descriptor);
        Self::own(device, queue)
    }

    /// A device that the user made, and may use for other things too: its handlers stay as they are, so that a lost
    /// device shows as failed reads only. Indirect dispatches are slow (21 to 55 µs each, not 16 to 27) unless the
    /// instance was made without `InstanceFlags::VALIDATION_INDIRECT_CALL`; on DirectX 12 that flag must stay.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let info = device.adapter_info();
        Self { device, queue, info, failures: Arc::default() }
    }

    /// A device of our own, whose handlers note what goes wrong instead of ending the process.
    fn own(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let gpu = Self::from_device(device, queue);
        let failures = Arc::clone(&gpu.failures);
        gpu.device.set_device_lost_callback(move |reason, message| {
            lock(&failures).lost.get_or_insert(format!("{reason:?}: {message}"));
        });
        let failures = Arc::clone(&gpu.failures);
        gpu.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            lock(&failures).uncaught.get_or_insert(error.to_string());
        }));
        gpu
    }

    /// Whether time can be measured on the device, see [`Timer`](crate::Timer).
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(Features::TIMESTAMP_QUERY)
    }

    /// Whether shaders may use sub-group operations, see [`Ranking`](crate::primitives::Ranking).
    pub fn has_subgroups(&self) -> bool {
        self.device.features().contains(Features::SUBGROUP)
    }

    /// What went wrong since the last call, outside of any scope. Devices of our own only.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] once the device is lost, from then on; [`Error::Gpu`] for anything else, once.
    pub fn check(&self) -> Result<()> {
        self.check_lost()?;
        match lock(&self.failures).uncaught.take() {
            Some(message) => Err(Error::Gpu { what: "a command".into(), message }),
            None => Ok(()),
        }
    }

    fn check_lost(&self) -> Result<()> {
        match &lock(&self.failures).lost {
            Some(reason) => Err(Error::DeviceLost { reason: reason.clone() }),
            None => Ok(()),
        }
    }

    /// Runs `f`, which creates or submits `what`, with every error of the device caught.
    ///
    /// # Errors
    /// [`Error::Gpu`] when the device refused, [`Error::DeviceLost`] when it is gone.
    pub fn scoped<T>(&self, what: &str, f: impl FnOnce() -> T) -> Result<T> {
        let (value, error) = self.caught(f);
        match error {
            Some(error) => Err(Error::Gpu { what: what.to_owned(), message: error.to_string() }),
            None => self.check_lost().map(|()| value),
        }
    }

    /// Whether the device can run a step at all: the shaders need WebGPU's default limits, which a user's own device may
    /// have been made without. (How large the arrays may be, [`Gpu::create_buffer`] tells.)
    ///
    /// # Errors
    /// [`Error::Limits`] names the first limit that is too small, or the first alignment that is too large.
    pub fn check_limits(&self) -> Result<()> {
        let (have, default) = (self.device.limits(), Limits::default());
        let needed = [
            ("max_bind_groups", 1, have.max_bind_groups),
            ("max_bindings_per_bind_group", 32, have.max_bindings_per_bind_group),
            (
                "max_storage_buffers_per_shader_stage",
                default.max_storage_buffers_per_shader_stage,
                have.max_storage_buffers_per_shader_stage,
            ),
            ("max_uniform_buffers_per_shader_stage", 4, have.max_uniform_buffers_per_shader_stage),
            (
                "max_compute_workgroup_storage_size",
                default.max_compute_workgroup_storage_size,
                have.max_compute_workgroup_storage_size,
            ),
            ("max_compute_invocations_per_workgroup", 256, have.max_compute_invocations_per_workgroup),
            ("max_compute_workgroup_size_x", 256, have.max_compute_workgroup_size_x),
            (
                "max_compute_workgroups_per_dimension",
                default.max_compute_workgroups_per_dimension,
                have.max_compute_workgroups_per_dimension,
            ),
        ];
        for (limit, needed, available) in needed {
            if available < needed {
                return Err(self.limit(limit, needed.into(), available.into()));
            }
        }
        let uniform = 1024;
        if have.max_uniform_buffer_binding_size < uniform {
            return Err(self.limit("max_uniform_buffer_binding_size", uniform, have.max_uniform_buffer_binding_size));
        }
        let (limit, step) = ("min_uniform_buffer_offset_alignment", 256);
        if have.min_uniform_buffer_offset_alignment > step {
            return Err(self.limit(limit, step.into(), have.min_uniform_buffer_offset_alignment.into()));
        }
        Ok(())
    }

    /// A buffer of this size in bytes, zeroed, never empty; the size is rounded up to a multiple of 4.
    ///
    /// # Errors
    /// [`Error::Limits`] when no buffer may be so large, [`Error::OutOfMemory`] when there is no room for it,
    /// [`Error::Gpu`] and [`Error::DeviceLost`] as for [`Gpu::scoped`].
    pub fn create_buffer(&self, name: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let size = bytes.max(4).next_multiple_of(4);
        let limits = self.device.limits();
        if size > limits.max_buffer_size {
            return Err(self.limit("max_buffer_size", size, limits.max_buffer_size));
        }
        if usage.contains(wgpu::BufferUsages::STORAGE) && size > limits.max_storage_buffer_binding_size {
            return Err(self.limit("max_storage_buffer_binding_size", size, limits.max_storage_buffer_binding_size));
        }
        let descriptor = wgpu::BufferDescriptor { label: Some(name), size, usage, mapped_at_creation: false };
        let (buffer, error) = self.caught(|| self.device.create_buffer(&descriptor));
        match error {
            Some(wgpu::Error::OutOfMemory { .. }) => Err(Error::OutOfMemory { buffer: name.to_owned(), bytes: size }),
            Some(error) => Err(Error::Gpu { what: format!("buffer `{name}`"), message: error.to_string() }),
            None => self.check_lost().map(|()| buffer),
        }
    }

    fn limit(&self, limit: &'static str, needed: u64, available: u64) -> Error {
        Error::Limits { adapter: self.info.name.clone(), limit, needed, available }
    }

    /// Runs `f` and returns the first error that the device raised meanwhile on this thread.
    fn caught<T>(&self, f: impl FnOnce() -> T) -> (T, Option<wgpu::Error>) {
        let internal = self.device.push_error_scope(ErrorFilter::Internal);
        let validation = self.device.push_error_scope(ErrorFilter::Validation);
        let memory = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let value = f();
        // Last in, first out; no memory is the root of what is refused after it.
        let memory = pollster::block_on(memory.pop());
        let validation = pollster::block_on(validation.pop());
        let internal = pollster::block_on(internal.pop());
        (value, memory.or(validation).or(internal))
    }

    /// Waits until everything submitted so far has run.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] and [`Error::Gpu`] when that cannot be waited for.
    pub fn wait(&self) -> Result<()> {
        self.poll(wgpu::PollType::wait_indefinitely())
    }

    pub(crate) fn poll(&self, how: wgpu::PollType) -> Result<()> {
        let polled = self.device.poll(how);
        self.check_lost()?;
        polled.map(|_| ()).map_err(|error| Error::Gpu { what: "waiting".into(), message: error.to_string() })
    }
}

fn lock(failures: &Mutex<Failures>) -> MutexGuard<'_, Failures> {
    failures.lock().unwrap_or_else(PoisonError::into_inner)
}

fn wanted_name() -> Option<String> {
    std::env::var("WGPU_ADAPTER_NAME").ok().filter(|name| !name.is_empty())
}

fn is_wanted(adapter: &wgpu::Adapter) -> bool {
    let name = adapter.get_info().name.to_lowercase();
    wanted_name().is_none_or(|wanted| name.contains(&wanted.to_lowercase()))
}

/// Every adapter, the best kind first.
fn adapters() -> Vec<wgpu::Adapter> {
    let _one_at_a_time = CREATION.lock().unwrap_or_else(PoisonError::into_inner);
    // Checking the arguments of every indirect dispatch doubles its cost, and ours are bounded where they are written.
    let unchecked = InstanceFlags::default() - InstanceFlags::VALIDATION_INDIRECT_CALL;
    let mut all = enumerate(Backends::VULKAN | Backends::METAL, unchecked);
    if cfg!(windows) {
        // There that check is also what tells an indirect dispatch its number of workgroups.
        all.extend(enumerate(Backends::DX12, InstanceFlags::default()));
    }
    all.sort_by_key(|adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    });
    all
}

fn enumerate(backends: Backends, flags: InstanceFlags) -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = backends;
    descriptor.flags = flags;
    pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends))
}

/// A device of the first adapter that gives one.
fn first_that_opens(asked: &str, adapters: &[wgpu::Adapter]) -> Result<Gpu> {
    let _one_at_a_time = CREATION.lock().unwrap_or_else(PoisonError::into_inner);
    let mut detail = format!("asked for {asked}");
    for adapter in adapters {
        let available = adapter.limits();
        let required_limits = Limits {
            max_buffer_size: available.max_buffer_size,
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            ..Limits::default().or_worse_values_from(&available)
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("tumble"),
            required_features: adapter.features() & (Features::TIMESTAMP_QUERY | Features::SUBGROUP),
            required_limits,
            ..Default::default()
        };
        match pollster::block_on(adapter.request_device(&descriptor)) {
            Ok((device, queue)) => return Ok(Gpu::own(device, queue)),
            Err(error) => detail.push_str(&format!("; {}: {error}", adapter.get_info().name)),
        }
    }
    Err(Error::NoAdapter { detail })
}
