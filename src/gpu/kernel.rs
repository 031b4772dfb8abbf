//! From a stage's name to a pipeline: compose, validate, find bindings by name.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::arrays::STEP_INPUT;
use super::compose::{Composed, Defines, compose};
use super::memory::Memory;
use super::texels::{Access, format_of, rewritten};
use crate::engine::Stage;
use crate::error::{Error, Result};

/// One resource of an entry point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Binding {
    /// Variable name in the shader, which is also the name of the buffer.
    pub name: String,
    pub group: u32,
    pub binding: u32,
    pub kind: BindingKind,
    pub writable: bool,
}

/// How a resource lies on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindingKind {
    Uniform,
    Storage,
    /// A texture, see [`super::texels`]: one that can be written, or one that is sampled.
    Texels,
    Sampled,
}

impl Binding {
    fn layout(&self) -> wgpu::BindingType {
        let ty = match self.kind {
            BindingKind::Uniform => wgpu::BufferBindingType::Uniform,
            BindingKind::Storage => wgpu::BufferBindingType::Storage { read_only: !self.writable },
            BindingKind::Sampled => {
                return wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Uint,
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                };
            }
            BindingKind::Texels => {
                let format = format_of(1);
                let access = match self.writable {
                    true => wgpu::StorageTextureAccess::ReadWrite,
                    false => wgpu::StorageTextureAccess::ReadOnly,
                };
                let view_dimension = wgpu::TextureViewDimension::D2;
                return wgpu::BindingType::StorageTexture { access, format, view_dimension };
            }
        };
        wgpu::BindingType::Buffer { ty, has_dynamic_offset: self.name == STEP_INPUT, min_binding_size: None }
    }
}

/// A stage composed and validated, without a device.
pub struct Reflected {
    pub stage: Stage,
    pub composed: Composed,
    pub module: naga::Module,
    pub bindings: Vec<Binding>,
    pub workgroup_size: u32,
}

/// Composes and validates a stage and lists the resources that its entry point uses; `texels`: with arrays in textures.
pub fn reflect(stage: Stage, defines: &Defines, texels: bool) -> Result<Reflected> {
    validated(stage, composed(stage, defines, texels)?)
}

fn composed(stage: Stage, defines: &Defines, texels: bool) -> Result<Composed> {
    let mut composed = compose(&format!("stages/{}", stage.name()), defines)?;
    if texels {
        composed.source = rewritten(&composed.source, Access::Storage);
    }
    Ok(composed)
}

fn validated(stage: Stage, composed: Composed) -> Result<Reflected> {
    let fail = |message: String| Error::Shader { stage: stage.name().into(), message };
    let module = naga::front::wgsl::parse_str(&composed.source).map_err(|e| {
        let line = e.location(&composed.source).map_or(0, |l| l.line_number as usize);
        fail(format!("{}\n{}", composed.place(line), e.emit_to_string(&composed.source)))
    })?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).map_err(|e| {
        let line = e.location(&composed.source).map_or(0, |l| l.line_number as usize);
        fail(format!("{}\n{}", composed.place(line), e.emit_to_string(&composed.source)))
    })?;
    let entry = module
        .entry_points
        .iter()
        .position(|e| e.name == stage.name())
        .ok_or_else(|| fail("no entry point of that name".into()))?;
    let used = info.get_entry_point(entry);
    let bindings = module
        .global_variables
        .iter()
        .filter(|(handle, _)| !used[*handle].is_empty())
        .filter_map(|(_, variable)| {
            let at = variable.binding.as_ref()?;
            let stores = |access: naga::StorageAccess| access.contains(naga::StorageAccess::STORE);
            let (kind, writable) = match (variable.space, &module.types[variable.ty].inner) {
                (naga::AddressSpace::Uniform, _) => (BindingKind::Uniform, false),
                (_, naga::TypeInner::Image { class: naga::ImageClass::Storage { access, .. }, .. }) => {
                    (BindingKind::Texels, stores(*access))
                }
                (_, naga::TypeInner::Image { .. }) => (BindingKind::Sampled, false),
                (naga::AddressSpace::Storage { access }, _) => (BindingKind::Storage, stores(access)),
                _ => return None,
            };
            let name = variable.name.clone().unwrap_or_default();
            Some(Binding { name, group: at.group, binding: at.binding, kind, writable })
        })
        .collect();
    let workgroup_size = module.entry_points[entry].workgroup_size.iter().product();
    Ok(Reflected { stage, composed, module, bindings, workgroup_size })
}

/// Values of the constants that a shader leaves open (`override`), by name: shaders/shared/mesh_numbers.wgsl.
pub type MeshNumbers = BTreeMap<&'static str, u32>;

/// A pipeline and what it binds; buffers and threads are those of an engine.
pub struct Compiled {
    pub stage: Stage,
    pub bindings: Vec<Binding>,
    workgroup_size: u32,
    group_layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Compiled {
    fn new(device: &wgpu::Device, reflected: Reflected, numbers: &MeshNumbers) -> Self {
        let Reflected { stage, mut module, bindings, workgroup_size, .. } = reflected;
        let label = Some(stage.name());
        // The groups of the source tell what a binding is for. On the device all bindings of a stage lie in one group:
        // one bind call per dispatch instead of four halves the time of recording.
        let mut unused = bindings.len() as u32;
        for (_, variable) in module.global_variables.iter_mut().filter(|(_, v)| v.binding.is_some()) {
            let place = bindings.iter().position(|b| Some(&b.name) == variable.name.as_ref());
            let binding = place.map_or(unused, |n| n as u32);
            unused += u32::from(place.is_none());
            variable.binding = Some(naga::ResourceBinding { group: 0, binding });
        }
        let entry = |(binding, b): (u32, &Binding)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: b.layout(),
            count: None,
        };
        let entries: Vec<wgpu::BindGroupLayoutEntry> = (0..).zip(&bindings).map(entry).collect();
        let group_layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&group_layout)],
            immediate_size: 0,
        });
        let constants: Vec<(&str, f64)> = module
            .overrides
            .iter()
            .filter_map(|(_, open)| numbers.get_key_value(open.name.as_deref()?))
            .map(|(name, value)| (*name, f64::from(*value)))
            .collect();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module)),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&layout),
            module: &module,
            entry_point: Some(stage.name()),
            // Zeroing of workgroup memory can take seconds on some drivers; the shaders initialise what they read.
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                constants: &constants,
            },
            cache: None,
        });
        Compiled { stage, bindings, workgroup_size, group_layout, pipeline }
    }
}

/// Name of a stage, its composed source, and what is put into it.
type KernelKey = (&'static str, String, MeshNumbers);

/// The kernels that a device has compiled, by their source and the numbers of the mesh: an engine
/// with other effects shares those that are the same.
#[derive(Clone, Default)]
pub struct KernelCache(Arc<Mutex<BTreeMap<KernelKey, Arc<Compiled>>>>);

impl KernelCache {
    /// The kernel of a stage with these defines, for a mesh with these numbers; `texels`: with arrays in textures.
    ///
    /// # Errors
    /// `Error::Shader` for a source that does not validate.
    pub fn compiled(
        &self,
        device: &wgpu::Device,
        stage: Stage,
        defines: &Defines,
        numbers: &MeshNumbers,
        texels: bool,
    ) -> Result<Arc<Compiled>> {
        let composed = composed(stage, defines, texels)?;
        let key = (stage.name(), composed.source.clone(), numbers.clone());
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().get(&key) {
            return Ok(known.clone());
        }
        let compiled = Arc::new(Compiled::new(device, validated(stage, composed)?, numbers));
        lock().insert(key, compiled.clone());
        Ok(compiled)
    }
}

/// A pipeline with its bind group.
pub struct Kernel {
    pub stage: Stage,
    compiled: Arc<Compiled>,
    group: wgpu::BindGroup,
    /// True where the group takes the dynamic offset of the step.
    dynamic: bool,
    threads: u32,
}

impl Kernel {
    /// A kernel that runs `threads` threads, with `buffers` bound by name.
    ///
    /// # Errors
    /// `Error::Shader` for a binding without a buffer.
    pub fn new(
        device: &wgpu::Device,
        compiled: Arc<Compiled>,
        buffers: &BTreeMap<&'static str, Memory>,
        step_input_size: u64,
        threads: u32,
    ) -> Result<Self> {
        let stage = compiled.stage;
        let mut bound = Vec::new();
        for b in &compiled.bindings {
            let memory = buffers.get(b.name.as_str()).ok_or_else(|| Error::Shader {
                stage: stage.name().into(),
                message: format!("no buffer for binding `{}`", b.name),
            })?;
            bound.push(memory.bound((b.name == STEP_INPUT).then_some(step_input_size)));
        }
        let entries: Vec<wgpu::BindGroupEntry> =
            (0..).zip(&bound).map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.resource() }).collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(stage.name()),
            layout: &compiled.group_layout,
            entries: &entries,
        });
        let dynamic = compiled.bindings.iter().any(|b| b.name == STEP_INPUT);
        Ok(Kernel { stage, compiled, group, dynamic, threads })
    }

    pub fn threads(&self) -> u32 {
        self.threads
    }

    /// Records the dispatch. `step_offset` is the byte offset of the step's input.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>, step_offset: u32) {
        pass.set_pipeline(&self.compiled.pipeline);
        let offsets: &[u32] = if self.dynamic { &[step_offset] } else { &[] };
        pass.set_bind_group(0, &self.group, offsets);
        // 65,535 workgroups per dimension are the portable limit; shaders undo the wrap with `thread_index`.
        let groups = self.threads.div_ceil(self.compiled.workgroup_size).max(1);
        let rows = groups.div_ceil(65_535);
        pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
    }
}
