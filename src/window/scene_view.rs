//! Draws tissue and needle from the solver's own buffers, on the solver's own device.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use wgpu::util::DeviceExt;

use super::anatomy_view::{self, AnatomyView};
use super::appearance::{ColourMap, Look};
use super::camera::Camera;
use super::section::{self, Outline, RestPlane, TissueCorner};
use super::tool_shape::ToolCorner;
use crate::anatomy::colours::Rgb;
use crate::gpu::structs::DrawnNeedle;
use crate::gpu::{Bound, Gpu, GpuEngine};
use crate::model::Model;
use crate::observables::field::Field;
use crate::{Error, Result};

const SHADER: &str = concat!(
    include_str!("../../shaders/shared/needle_in_tissue.wgsl"),
    include_str!("../../shaders/render/tissue.wgsl")
);
/// What comes to it where faces may part.
const PARTED: &str = include_str!("../../shaders/render/parted.wgsl");
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The colour scale: ends in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    pub field: &'static Field,
    pub low: f64,
    pub high: f64,
    pub logarithmic: bool,
}

/// Host side of `View` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct View {
    view_projection: [[f32; 4]; 4],
    towards: [f32; 4],
    range: [f32; 4],
    surface: [f32; 4],
    needle: DrawnNeedle,
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
    veil: wgpu::RenderPipeline,
    layer_veil: wgpu::RenderPipeline,
    tool: wgpu::RenderPipeline,
    tissue_bindings: wgpu::BindGroup,
    veil_bindings: wgpu::BindGroup,
    layer_bindings: wgpu::BindGroup,
    tool_bindings: wgpu::BindGroup,
    view: wgpu::Buffer,
    table: wgpu::Buffer,
    rest: wgpu::Buffer,
    /// Other copies of every node, where faces may separate.
    copies: Option<wgpu::Buffer>,
    /// The needle in the tissue, which is drawn beside it.
    pub needle: DrawnNeedle,
    /// What the table holds.
    colours: Colours,
    /// Natural colour of a block of one part whose faces may part.
    plain: Option<Rgb>,
    corners: wgpu::Buffer,
    /// The corners of the triangles, and how many.
    triangles: (wgpu::Buffer, u32),
    /// So many of them belong to the surface of solid tissue, and so many to solid tissue in all; the rest is seen through.
    surface: u32,
    solid: u32,
    tool_corners: (wgpu::Buffer, u32),
    outline: Outline,
    /// Materials that are seen through there, as in [`Look::through`].
    through: u32,
    depth: Option<(wgpu::Extent3d, wgpu::TextureView)>,
    /// Parts in natural colours, of a block whose faces do not part.
    anatomy: Option<AnatomyView>,
}

/// What colours the tissue.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Colours {
    /// A field.
    Map(ColourMap),
    /// Nothing: it has one colour.
    Plain(Rgb),
}

/// Colours of the scale from 0 to 1, sRGB.
fn colour_table(colours: Colours) -> Vec<[f32; 4]> {
    let part = |byte: u8| f32::from(byte) / 255.0;
    let colour = |n: i32| match colours {
        Colours::Map(map) => map.colour(f64::from(n) / 255.0),
        Colours::Plain(colour) => colour,
    };
    (0..256).map(colour).map(|[r, g, b]| [part(r), part(g), part(b), 1.0]).collect()
}

impl SceneView {
    /// For an engine that was made to be drawn; `format` of the targets, whose bytes are sRGB as they are.
    ///
    /// # Errors
    /// `Error::Device` where the device refuses a pipeline, or the engine holds no fields.
    pub fn new(gpu: &Gpu, engine: &GpuEngine, model: &Model, format: wgpu::TextureFormat) -> Result<Self> {
        let (device, mesh) = (&gpu.device, &model.mesh);
        let parts = !model.separation.pairs.is_empty();
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("tissue"),
            source: wgpu::ShaderSource::Wgsl(gpu.drawing(&if parts {
                format!("{SHADER}{PARTED}")
            } else {
                SHADER.into()
            })),
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
                    // What lies behind everything is drawn first: no pixel of it asks for its depth.
                    depth_write_enabled: Some(!attributes.is_empty()),
                    depth_compare: Some(match attributes.is_empty() {
                        true => wgpu::CompareFunction::Always,
                        false => wgpu::CompareFunction::LessEqual,
                    }),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: Default::default(),
                multiview_mask: None,
                cache: None,
            })
        };
        let backdrop = pipeline("backdrop_corner", "backdrop_colour", 0, &[], None);
        let tissue_vertex = if parts { "parted_corner" } else { "tissue_corner" };
        let of_tissue = |fragment| {
            let attributes = wgpu::vertex_attr_array![0 => Uint32x2, 1 => Float32];
            // The tissue is closed, its faces look outwards.
            pipeline(tissue_vertex, fragment, size_of::<TissueCorner>(), &attributes, Some(wgpu::Face::Back))
        };
        let [tissue, veil, layer_veil] = ["tissue_colour", "veil_colour", "layer_colour"].map(of_tissue);
        let tool = pipeline(
            "tool_corner",
            "tool_colour",
            size_of::<ToolCorner>(),
            &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4],
            None,
        );
        let filled = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let view = filled("view", bytemuck::bytes_of(&View::zeroed()), uniform);
        let colours = Colours::Map(ColourMap::default());
        let table = filled("colour_table", bytemuck::cast_slice(&colour_table(colours)), uniform);
        let (rest, copies) = mesh_buffers(device, model);
        let drawn = drawn_arrays(engine)?;
        let resources = tissue_resources(&view, &table, &drawn, &rest, copies.as_ref());
        let tissue_bindings = bindings(device, &tissue, &resources);
        let veil_bindings = bindings(device, &veil, &resources);
        let layer_bindings = bindings(device, &layer_veil, &resources);
        let tool_bindings = bindings(device, &tool, &[view.as_entire_binding()]);
        let anatomy = {
            let source = format!("{SHADER}{}", anatomy_view::SHADER);
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("anatomy"),
                source: wgpu::ShaderSource::Wgsl(gpu.drawing(&source)),
            });
            AnatomyView::new(gpu, model, &module, format, (&view, &drawn[0]))
        };
        let nothing = || {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: 16,
                usage: wgpu::BufferUsages::VERTEX,
                mapped_at_creation: false,
            })
        };
        let mut drawing = SceneView {
            corners: nothing(),
            triangles: (nothing(), 0),
            surface: 0,
            solid: 0,
            tool_corners: (nothing(), 0),
            outline: Outline::of(mesh, |_| false),
            through: 0,
            depth: None,
            anatomy,
            backdrop,
            tissue,
            veil,
            layer_veil,
            tool,
            tissue_bindings,
            veil_bindings,
            layer_bindings,
            tool_bindings,
            view,
            table,
            rest,
            copies,
            colours,
            needle: DrawnNeedle::default(),
            plain: anatomy_view::only_part(model).map(|(_, colour)| colour),
        };
        drawing.cut(gpu, model, None, 0);
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(Error::Device(format!("drawing of the tissue: {error}")));
        }
        Ok(drawing)
    }

    /// Draws another model from now on, with the same pipelines. False where it needs others; nothing has changed then.
    ///
    /// # Errors
    /// As [`SceneView::new`].
    pub fn take_model(&mut self, gpu: &Gpu, engine: &GpuEngine, model: &Model) -> Result<bool> {
        // Another cell edge or another patient: the surfaces lie in other cells.
        if self.copies.is_some() == model.separation.pairs.is_empty() || self.anatomy.is_some() {
            return Ok(false);
        }
        (self.rest, self.copies) = mesh_buffers(&gpu.device, model);
        self.plain = anatomy_view::only_part(model).map(|(_, colour)| colour);
        self.outline = Outline::of(&model.mesh, |_| false);
        self.through = 0;
        self.take_buffers(gpu, engine)?;
        self.cut(gpu, model, None, 0);
        Ok(true)
    }

    /// Draws from another engine of the same mesh.
    ///
    /// # Errors
    /// `Error::Device` where it was not made to be drawn.
    pub fn take_buffers(&mut self, gpu: &Gpu, engine: &GpuEngine) -> Result<()> {
        let drawn = drawn_arrays(engine)?;
        let resources = tissue_resources(&self.view, &self.table, &drawn, &self.rest, self.copies.as_ref());
        self.tissue_bindings = bindings(&gpu.device, &self.tissue, &resources);
        self.veil_bindings = bindings(&gpu.device, &self.veil, &resources);
        self.layer_bindings = bindings(&gpu.device, &self.layer_veil, &resources);
        if let Some(anatomy) = &mut self.anatomy {
            anatomy.take_buffers(gpu, &self.view, &drawn[0]);
        }
        Ok(())
    }

    /// Takes away what lies beyond a plane; `through` as in [`Look::through`].
    pub fn cut(&mut self, gpu: &Gpu, model: &Model, plane: Option<RestPlane>, through: u32) {
        if through != self.through {
            self.outline = Outline::of(&model.mesh, |cell| through >> model.region_index(cell) & 1 == 1);
            self.through = through;
        }
        let cut = self.outline.cut(&model.mesh, plane);
        let (corners, numbers) = section::indexed(&cut.corners);
        self.corners = vertices(gpu, &corners).0;
        self.triangles = filled(gpu, &numbers, wgpu::BufferUsages::INDEX);
        (self.surface, self.solid) = (cut.surface as u32, cut.solid as u32);
        if let Some(anatomy) = &mut self.anatomy {
            anatomy.cut(gpu, model, plane);
        }
    }

    /// True where the tissue has natural colours.
    pub fn has_natural(&self) -> bool {
        self.anatomy.is_some() || self.plain.is_some()
    }

    /// Names of parts in natural colours, and where they are written, at rest [m].
    pub fn anchors(&self) -> &[(String, DVec3)] {
        self.anatomy.as_ref().map_or(&[], AnatomyView::anchors)
    }

    /// Puts the tool, and what else stands in the view, to its place.
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
        (camera, scale, look): (&Camera, &Scale, &Look),
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
        let anatomy = self.anatomy.as_ref().filter(|_| look.natural);
        let [row, layer] = self.anatomy.as_ref().map_or([0.0; 2], AnatomyView::strides);
        let plain = self.plain.filter(|_| look.natural);
        let opacity = match (anatomy, plain) {
            (Some(_), _) => look.skin,
            // As much as where any other block ends.
            (None, Some(_)) => 0.5 + 0.5 * look.skin,
            (None, None) => look.opacity,
        };
        let towards = (camera.eye() - camera.centre).normalize_or_zero();
        let view = View {
            view_projection: camera.view_projection(area.width / area.height.max(1.0)).to_cols_array_2d(),
            towards: [towards.x, towards.y, towards.z, 0.0],
            range: [
                scale.low as f32,
                scale.high as f32,
                scale.field.lane.number().unwrap_or(0) as f32,
                f32::from(u8::from(scale.logarithmic)),
            ],
            surface: [opacity, look.veil, row, layer],
            needle: self.needle,
        };
        gpu.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        let colours = plain.map_or(Colours::Map(look.map), Colours::Plain);
        if self.colours != colours {
            gpu.queue.write_buffer(&self.table, 0, bytemuck::cast_slice(&colour_table(colours)));
            self.colours = colours;
        }
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
        match anatomy {
            Some(anatomy) => anatomy.draw(&mut pass),
            None => self.draw_field(&mut pass, opacity),
        }
        let (corners, count) = &self.tool_corners;
        if *count > 0 {
            pass.set_pipeline(&self.tool);
            pass.set_bind_group(0, &self.tool_bindings, &[]);
            pass.set_vertex_buffer(0, corners.slice(..));
            pass.draw(0..*count, 0..1);
        }
    }

    /// Draws the tissue in the colours of its field.
    fn draw_field(&self, pass: &mut wgpu::RenderPass, opacity: f32) {
        // Discarding pixels keeps an adapter from leaving out hidden ones early: only where the surface is seen through.
        let whole = opacity >= 1.0;
        let (surface, surface_bindings) =
            if whole { (&self.tissue, &self.tissue_bindings) } else { (&self.veil, &self.veil_bindings) };
        let (triangles, count) = &self.triangles;
        pass.set_vertex_buffer(0, self.corners.slice(..));
        pass.set_index_buffer(triangles.slice(..), wgpu::IndexFormat::Uint32);
        for (pipeline, bindings, range) in [
            (surface, surface_bindings, 0..self.surface),
            (&self.tissue, &self.tissue_bindings, self.surface..self.solid),
            (&self.layer_veil, &self.layer_bindings, self.solid..*count),
        ] {
            if !range.is_empty() {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, bindings, &[]);
                pass.draw_indexed(range, 0, 0..1);
            }
        }
    }
}

/// Displacements and fields of an engine that was made to be drawn.
fn drawn_arrays(engine: &GpuEngine) -> Result<[Bound<'_>; 2]> {
    let of_engine = |name: &str| {
        let memory = engine.memory(name).map(|memory| memory.bound(None));
        memory.ok_or_else(|| Error::Device(format!("the engine was not made to be drawn: no {name}")))
    };
    Ok([of_engine("node_displacement")?, of_engine("drawn_nodes")?])
}

/// What the tissue is drawn from, in the order of the shader.
fn tissue_resources<'a>(
    view: &'a wgpu::Buffer,
    table: &'a wgpu::Buffer,
    [displacement, fields]: &'a [Bound<'_>; 2],
    rest: &'a wgpu::Buffer,
    copies: Option<&'a wgpu::Buffer>,
) -> Vec<wgpu::BindingResource<'a>> {
    let own = |buffer: &'a wgpu::Buffer| buffer.as_entire_binding();
    let first = [own(view), own(table), displacement.resource(), own(rest), fields.resource()];
    first.into_iter().chain(copies.map(own)).collect()
}

/// Binds resources in the order of the shader.
pub(super) fn bindings(
    device: &wgpu::Device,
    pipeline: &wgpu::RenderPipeline,
    resources: &[wgpu::BindingResource],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry> = (0..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
}

/// Where the nodes are at rest [m], and where faces may part the other copies of every node.
fn mesh_buffers(device: &wgpu::Device, model: &Model) -> (wgpu::Buffer, Option<wgpu::Buffer>) {
    let filled = |label, contents: &[u8]| {
        let usage = wgpu::BufferUsages::STORAGE;
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
    };
    let place = |node| {
        let x = model.mesh.rest_position(node).as_vec3();
        [x.x, x.y, x.z, 0.0]
    };
    let rest: Vec<[f32; 4]> = (0..model.mesh.node_count()).map(place).collect();
    let parts = !model.separation.pairs.is_empty();
    let copies = parts.then(|| filled("node_copies", bytemuck::cast_slice(&node_copies(model))));
    (filled("node_rest", bytemuck::cast_slice(&rest)), copies)
}

/// The other copies of every node, itself where there are fewer than four.
fn node_copies(model: &Model) -> Vec<[u32; 4]> {
    let mut copies: Vec<[u32; 4]> = (0..model.mesh.node_count() as u32).map(|node| [node; 4]).collect();
    for pair in &model.separation.pairs {
        let [a, b] = pair.nodes;
        for (from, to) in [(a, b), (b, a)] {
            let known = &mut copies[from as usize];
            if !known.contains(&to)
                && let Some(free) = known.iter_mut().find(|n| **n == from)
            {
                *free = to;
            }
        }
    }
    copies
}

/// Corners in a buffer of the device, and how many.
pub(super) fn vertices<T: Pod>(gpu: &Gpu, corners: &[T]) -> (wgpu::Buffer, u32) {
    filled(gpu, corners, wgpu::BufferUsages::VERTEX)
}

pub(super) fn filled<T: Pod>(gpu: &Gpu, entries: &[T], usage: wgpu::BufferUsages) -> (wgpu::Buffer, u32) {
    let buffer = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("corners"),
        // A buffer of no bytes cannot be bound.
        contents: if entries.is_empty() { &[0; 16] } else { bytemuck::cast_slice(entries) },
        usage,
    });
    (buffer, entries.len() as u32)
}
