//! Passes from shaders: a pass binds its buffers by the names that they have in the WGSL.
//!
//! Each shader is composed, parsed and validated once, and told apart by entry point: which globals an entry point
//! uses makes its bind group layout, so nothing about bindings is written down twice.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tumble_core::{Error, Result};
use tumble_shaders::Composed;
use wgpu::naga::{self, AddressSpace, StorageAccess};

use crate::device::Gpu;

/// One buffer that an entry point uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Binding {
    /// Its `@binding` in group 0.
    pub binding: u32,
    /// The global's name in the shader.
    pub name: String,
    /// Uniform, storage to read, storage to read and write.
    pub ty: wgpu::BufferBindingType,
    /// The smallest buffer that does, bytes; one element for an array.
    pub min_bytes: u64,
}

/// A shader that was parsed and found valid.
#[derive(Debug, Clone)]
pub struct Shader {
    stem: String,
    text: String,
    module: naga::Module,
    info: naga::valid::ModuleInfo,
}

impl Shader {
    /// Parses and validates a composed shader. No device is needed.
    ///
    /// # Errors
    /// [`Error::Gpu`], naming the file and line, when it is not valid WGSL.
    pub fn parse(composed: &Composed) -> Result<Self> {
        let error = |line: Option<u32>, message: String| {
            let (stem, line) = line.map_or(("", 0), |line| composed.locate(line));
            let place = if line == 0 { composed.stem.clone() } else { format!("{stem}.wgsl:{line}") };
            Error::Gpu { what: format!("shader shaders/{place}"), message }
        };
        let module = naga::front::wgsl::parse_str(&composed.source).map_err(|parse| {
            error(parse.location(&composed.source).map(|place| place.line_number), parse.message().to_owned())
        })?;
        // What a device must have besides, it refuses itself where it has not.
        let capabilities = naga::valid::Capabilities::default() | naga::valid::Capabilities::SUBGROUP;
        let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
        let info = validator.validate(&module).map_err(|invalid| {
            let line = invalid.location(&composed.source).map(|place| place.line_number);
            error(line, causes(invalid.as_inner()))
        })?;
        Ok(Self { stem: composed.stem.clone(), text: composed.source.clone(), module, info })
    }

    /// The module, for translating it.
    pub fn module(&self) -> (&naga::Module, &naga::valid::ModuleInfo) {
        (&self.module, &self.info)
    }

    /// Names of its entry points, in the order of the text.
    pub fn entries(&self) -> impl Iterator<Item = &str> {
        self.module.entry_points.iter().map(|entry| entry.name.as_str())
    }

    /// The buffers that this entry point uses, by binding number.
    ///
    /// # Errors
    /// [`Error::Gpu`] when there is no such entry point, or it uses something that is no buffer of group 0.
    pub fn bindings(&self, entry: &str) -> Result<Vec<Binding>> {
        let refuse = |message: String| Error::Gpu { what: format!("shader {}, entry {entry}", self.stem), message };
        let index = self
            .module
            .entry_points
            .iter()
            .position(|point| point.name == entry)
            .ok_or_else(|| refuse("no such entry point".into()))?;
        let uses = self.info.get_entry_point(index);
        let mut bindings = Vec::new();
        for (handle, global) in self.module.global_variables.iter() {
            let Some(place) = &global.binding else { continue };
            if uses[handle].is_empty() {
                continue;
            }
            let name = global.name.clone().unwrap_or_default();
            let ty = match global.space {
                AddressSpace::Uniform => wgpu::BufferBindingType::Uniform,
                AddressSpace::Storage { access } => {
                    wgpu::BufferBindingType::Storage { read_only: !access.contains(StorageAccess::STORE) }
                }
                _ => return Err(refuse(format!("`{name}` is no buffer"))),
            };
            if place.group != 0 {
                return Err(refuse(format!("`{name}` is in group {}, not 0", place.group)));
            }
            let min_bytes = u64::from(self.module.types[global.ty].inner.size(self.module.to_ctx()));
            bindings.push(Binding { binding: place.binding, name, ty, min_bytes });
        }
        bindings.sort_by_key(|binding| binding.binding);
        Ok(bindings)
    }

    fn has_override(&self, name: &str) -> bool {
        self.module.overrides.iter().any(|(_, constant)| constant.name.as_deref() == Some(name))
    }
}

/// The error and all that caused it, in one line.
fn causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text.push_str(&format!(": {error}"));
        source = error.source();
    }
    text
}

/// An entry point, ready to be dispatched by a [`Recorder`](crate::Recorder).
#[derive(Debug)]
pub struct Pass {
    /// `stem:entry`, as in `primitives/scan:reduce`.
    pub label: String,
    /// The pipeline.
    pub pipeline: wgpu::ComputePipeline,
    /// Layout of group 0, the only one.
    pub layout: wgpu::BindGroupLayout,
    /// What is bound there, by number.
    pub bindings: Vec<Binding>,
    /// Different for every pass in the process.
    pub(crate) id: u64,
}

static NEXT_PASS: AtomicU64 = AtomicU64::new(0);

/// Makes passes, each once, and parses each shader once.
#[derive(Debug, Default)]
pub struct Pipelines {
    permute: u32,
    shaders: HashMap<String, Loaded>,
    passes: HashMap<(String, String), Arc<Pass>>,
}

#[derive(Debug)]
struct Loaded {
    shader: Shader,
    module: wgpu::ShaderModule,
}

impl Pipelines {
    /// None yet; they are made when asked for.
    pub fn new() -> Self {
        Self::default()
    }

    /// For tests: every pass takes its invocations and workgroups in another order, 1 reversed, 2 shuffled.
    pub fn permuted(permute: u32) -> Self {
        Self { permute, ..Self::default() }
    }

    /// The pass of entry point `entry` of the shader `stem`, made when first asked for.
    ///
    /// # Errors
    /// [`Error::Gpu`] when there is no such shader or entry point, when the shader is invalid (with file and line),
    /// or when the device refuses it.
    pub fn pass(&mut self, gpu: &Gpu, stem: &str, entry: &str) -> Result<Arc<Pass>> {
        let key = (stem.to_owned(), entry.to_owned());
        if let Some(pass) = self.passes.get(&key) {
            return Ok(Arc::clone(pass));
        }
        let loaded = match self.shaders.entry(stem.to_owned()) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                let refuse = |message| Error::Gpu { what: format!("shader {stem}"), message };
                let composed = tumble_shaders::compose(stem).map_err(|error| refuse(error.to_string()))?;
                entry.insert(load(gpu, Shader::parse(&composed)?)?)
            }
        };
        let pass = Arc::new(build(gpu, loaded, entry, self.permute)?);
        self.passes.insert(key, Arc::clone(&pass));
        Ok(pass)
    }
}

fn load(gpu: &Gpu, shader: Shader) -> Result<Loaded> {
    let source = wgpu::ShaderSource::Wgsl(shader.text.as_str().into());
    let descriptor = wgpu::ShaderModuleDescriptor { label: Some(&shader.stem), source };
    let module = gpu.scoped(&format!("shader {}", shader.stem), || gpu.device.create_shader_module(descriptor))?;
    Ok(Loaded { shader, module })
}

/// Builds one pass of a shader that is in no table, with this order of invocations (see [`Pipelines::permuted`]).
///
/// # Errors
/// As for [`Pipelines::pass`].
pub fn build_pass(gpu: &Gpu, shader: Shader, entry: &str, permute: u32) -> Result<Pass> {
    build(gpu, &load(gpu, shader)?, entry, permute)
}

fn build(gpu: &Gpu, Loaded { shader, module }: &Loaded, entry: &str, permute: u32) -> Result<Pass> {
    let label = format!("{}:{entry}", shader.stem);
    let bindings = shader.bindings(entry)?;
    let entries: Vec<_> = bindings
        .iter()
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding: binding.binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: binding.ty,
                has_dynamic_offset: false,
                min_binding_size: NonZeroU64::new(binding.min_bytes),
            },
            count: None,
        })
        .collect();
    let constants: &[(&str, f64)] =
        if shader.has_override("PERMUTE") { &[("PERMUTE", f64::from(permute))] } else { &[] };
    let (pipeline, layout) = gpu.scoped(&format!("pass {label}"), || {
        let layout = gpu
            .device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(&label), entries: &entries });
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(&label),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&label),
            layout: Some(&pipeline_layout),
            module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
            cache: None,
        });
        (pipeline, layout)
    })?;
    Ok(Pass { label, pipeline, layout, bindings, id: NEXT_PASS.fetch_add(1, Ordering::Relaxed) })
}
