//! Draws tissue and needle from the solver's own buffers, on the solver's own device.

use bytemuck::{Pod, Zeroable};
use wgpu::util::DeviceExt;

use super::camera::Camera;
use super::section::{Outline, RestPlane, TissueCorner};
use super::tool_shape::ToolCorner;
use crate::gpu::{Gpu, GpuEngine};
use crate::mesh::Mesh;
use crate::{Error, Result};

const SHADER: &str = include_str!("../../shaders/render/tissue.wgsl");
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Steel, sRGB.
const STEEL: [f32; 4] = [0.70, 0.72, 0.76, 1.0];

/// A field that can be shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    VonMises,
    Pressure,
    Stretch,
    /// Part of the stiffness that damage and the needle's path have taken.
    StiffnessLost,
}

impl Field {
    pub const ALL: [Field; 4] = [Field::VonMises, Field::Pressure, Field::Stretch, Field::StiffnessLost];

    /// For people, with the unit of [`Field::unit`].
    pub fn name(self) -> &'static str {
        match self {
            Field::VonMises => "von Mises stress",
            Field::Pressure => "pressure",
            Field::Stretch => "largest stretch",
            Field::StiffnessLost => "stiffness left",
        }
    }

    /// Unit, and its size in SI.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Field::VonMises | Field::Pressure => ("kPa", 1e3),
            Field::Stretch | Field::StiffnessLost => ("-", 1.0),
        }
    }

    /// Its place in the fields of a node.
    fn lane(self) -> usize {
        self as usize
    }
}

/// The colour scale: ends in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    pub field: Field,
    pub low: f64,
    pub high: f64,
    pub logarithmic: bool,
}

/// Host side of `View` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct View {
    view_projection: [[f32; 4]; 4],
    eye: [f32; 4],
    range: [f32; 4],
    plain: [f32; 4],
}

/// Rectangle of the target that is drawn into [px].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    pub x: f32,
    pub y: f32,
    pub width: f32,
    pub height: f32,
}

/// The drawing of one simulation.
pub struct SceneView {
    backdrop: wgpu::RenderPipeline,
    tissue: wgpu::RenderPipeline,
    tool: wgpu::RenderPipeline,
    tissue_bindings: wgpu::BindGroup,
    tool_bindings: wgpu::BindGroup,
    view: wgpu::Buffer,
    table: wgpu::Buffer,
    rest: wgpu::Buffer,
    corners: (wgpu::Buffer, u32),
    tool_corners: (wgpu::Buffer, u32),
    outline: Outline,
    depth: Option<(wgpu::Extent3d, wgpu::TextureView)>,
}

/// Colours of the scale from 0 to 1, sRGB: perceptually uniform, from dark to bright, apart for the colour-blind.
pub fn colour_table() -> Vec<[f32; 4]> {
    let part = |byte: u8| f32::from(byte) / 255.0;
    (0..256).map(|n| colour_bytes(f64::from(n) / 255.0)).map(|[r, g, b]| [part(r), part(g), part(b), 1.0]).collect()
}

/// The colour at 0..1 as bytes (sRGB).
pub fn colour_bytes(at: f64) -> [u8; 3] {
    let c = colorous::VIRIDIS.eval_continuous(at.clamp(0.0, 1.0));
    [c.r, c.g, c.b]
}

impl SceneView {
    /// For an engine that was made to be drawn; `format` of the targets, whose bytes are sRGB as they are.
    ///
    /// # Errors
    /// `Error::Device` where the device refuses a pipeline, or the engine holds no fields.
    pub fn new(gpu: &Gpu, engine: &GpuEngine, mesh: &Mesh, format: wgpu::TextureFormat) -> Result<Self> {
        let device = &gpu.device;
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("tissue"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let pipeline = |vertex: &str, fragment: &str, stride: usize, attributes: &[wgpu::VertexAttribute], cull| {
            let buffers = [Some(wgpu::VertexBufferLayout {
                array_stride: stride as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes,
            })];
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(vertex),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers: if attributes.is_empty() { &[] } else { &buffers },
                },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &[Some(format.into())],
                }),
                primitive: wgpu::PrimitiveState { cull_mode: cull, ..Default::default() },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::LessEqual),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: Default::default(),
                multiview_mask: None,
                cache: None,
            })
        };
        let backdrop = pipeline("backdrop_corner", "backdrop_colour", 0, &[], None);
        let tissue = pipeline(
            "tissue_corner",
            "tissue_colour",
            size_of::<TissueCorner>(),
            &wgpu::vertex_attr_array![0 => Uint32x2, 1 => Float32],
            // The tissue is closed, its faces look outwards.
            Some(wgpu::Face::Back),
        );
        let tool = pipeline(
            "tool_corner",
            "tool_colour",
            size_of::<ToolCorner>(),
            &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3],
            None,
        );
        let filled = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let view = filled("view", bytemuck::bytes_of(&View::zeroed()), uniform);
        let table = filled("colour_table", bytemuck::cast_slice(&colour_table()), uniform);
        let rest: Vec<[f32; 4]> = (0..mesh.node_count())
            .map(|node| {
                let x = mesh.rest_position(node).as_vec3();
                [x.x, x.y, x.z, 0.0]
            })
            .collect();
        let rest = filled("node_rest", bytemuck::cast_slice(&rest), wgpu::BufferUsages::STORAGE);
        let [displacement, fields] = drawn_buffers(engine)?;
        let tissue_bindings = bindings(device, &tissue, &[&view, &table, displacement, &rest, fields]);
        let tool_bindings = bindings(device, &tool, &[&view]);
        let nothing = || {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: 16,
                usage: wgpu::BufferUsages::VERTEX,
                mapped_at_creation: false,
            })
        };
        let mut drawing = SceneView {
            corners: (nothing(), 0),
            tool_corners: (nothing(), 0),
            outline: Outline::of(mesh),
            depth: None,
            backdrop,
            tissue,
            tool,
            tissue_bindings,
            tool_bindings,
            view,
            table,
            rest,
        };
        drawing.cut(gpu, mesh, None);
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(Error::Device(format!("drawing of the tissue: {error}")));
        }
        Ok(drawing)
    }

    /// Draws from another engine of the same mesh.
    ///
    /// # Errors
    /// `Error::Device` where it was not made to be drawn.
    pub fn take_buffers(&mut self, gpu: &Gpu, engine: &GpuEngine) -> Result<()> {
        let [displacement, fields] = drawn_buffers(engine)?;
        let buffers = [&self.view, &self.table, displacement, &self.rest, fields];
        self.tissue_bindings = bindings(&gpu.device, &self.tissue, &buffers);
        Ok(())
    }

    /// Takes away what lies beyond a plane.
    pub fn cut(&mut self, gpu: &Gpu, mesh: &Mesh, plane: Option<RestPlane>) {
        self.corners = vertices(gpu, &self.outline.cut(mesh, plane));
    }

    /// Puts the tool to its place.
    pub fn place_tool(&mut self, gpu: &Gpu, corners: &[ToolCorner]) {
        self.tool_corners = vertices(gpu, corners);
    }

    /// Draws into `area` of a target of the size `size`, and leaves the rest of it as it is.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        (target, size): (&wgpu::TextureView, wgpu::Extent3d),
        area: Area,
        (camera, scale): (&Camera, &Scale),
    ) {
        if self.depth.as_ref().is_none_or(|(known, _)| *known != size) {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("depth"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: DEPTH,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            self.depth = Some((size, texture.create_view(&Default::default())));
        }
        let Some((_, depth)) = &self.depth else { return };
        let eye = camera.eye();
        let view = View {
            view_projection: camera.view_projection(area.width / area.height.max(1.0)).to_cols_array_2d(),
            eye: [eye.x, eye.y, eye.z, 0.0],
            range: [
                scale.low as f32,
                scale.high as f32,
                scale.field.lane() as f32,
                f32::from(u8::from(scale.logarithmic)),
            ],
            plain: STEEL,
        };
        gpu.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("tissue"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        // A window may be smaller than its panels.
        let (width, height) = (size.width as f32 - area.x, size.height as f32 - area.y);
        let (width, height) = (area.width.min(width), area.height.min(height));
        if width < 1.0 || height < 1.0 {
            return;
        }
        pass.set_viewport(area.x, area.y, width, height, 0.0, 1.0);
        pass.set_scissor_rect(area.x as u32, area.y as u32, width as u32, height as u32);
        pass.set_pipeline(&self.backdrop);
        pass.draw(0..3, 0..1);
        for (pipeline, bindings, (buffer, count)) in [
            (&self.tissue, &self.tissue_bindings, &self.corners),
            (&self.tool, &self.tool_bindings, &self.tool_corners),
        ] {
            if *count > 0 {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, bindings, &[]);
                pass.set_vertex_buffer(0, buffer.slice(..));
                pass.draw(0..*count, 0..1);
            }
        }
    }
}

/// Displacements and fields of an engine that was made to be drawn.
fn drawn_buffers(engine: &GpuEngine) -> Result<[&wgpu::Buffer; 2]> {
    let of_engine = |name: &str| {
        engine.buffer(name).ok_or_else(|| Error::Device(format!("the engine was not made to be drawn: no {name}")))
    };
    Ok([of_engine("node_displacement")?, of_engine("drawn_nodes")?])
}

/// Binds buffers in the order of the shader.
fn bindings(device: &wgpu::Device, pipeline: &wgpu::RenderPipeline, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
}

/// Corners in a buffer of the device, and how many.
fn vertices<T: Pod>(gpu: &Gpu, corners: &[T]) -> (wgpu::Buffer, u32) {
    let buffer = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("corners"),
        // A buffer of no bytes cannot be bound.
        contents: if corners.is_empty() { &[0; 16] } else { bytemuck::cast_slice(corners) },
        usage: wgpu::BufferUsages::VERTEX,
    });
    (buffer, corners.len() as u32)
}
