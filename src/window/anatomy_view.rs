//! Parts of the tissue in natural colours: smooth surfaces and a coloured cut that move with the tissue, drawn from the solver's own buffer.
//!
//! A corner lies in a cell and goes with the displacements of its eight nodes, which the device adds up. The triangles change only when
//! the plane is moved.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::scene_view::{DEPTH, filled, vertices};
use super::section::RestPlane;
use crate::anatomy::colours::Rgb;
use crate::gpu::{Bound, Gpu};
use crate::mesh::Mesh;
use crate::model::Model;
use crate::render::anatomy::{Anatomy, UNNAMED};
use crate::render::surfaces::{self, Detail, Embedding, Layer, Triangle};

/// What comes to the shader of the tissue.
pub const SHADER: &str = include_str!("../../shaders/render/anatomy.wgsl");

/// A corner in a cell, as `anatomy_corner` takes it.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PartCorner {
    /// At rest [m].
    pub place: [f32; 3],
    /// First node of its cell.
    pub node: u32,
    /// Weights of the cell's nodes, 255: 1.
    pub weights: [u8; 8],
    /// Unit vector, 127: 1.
    pub normal: [i8; 4],
    /// sRGB, the last one unused.
    pub colour: [u8; 4],
}

/// Drawn layers: the cut and solid parts, organs, skin; and the fragment stage of each.
const STAGES: [&str; 3] = ["part_colour", "organ_colour", "skin_colour"];

/// Name and colour of a part for the legend.
pub type Entry = (String, Rgb);

/// The drawing of the parts of one simulation.
pub struct AnatomyView {
    pipelines: [wgpu::RenderPipeline; 3],
    bindings: [wgpu::BindGroup; 3],
    /// At rest, as a whole.
    whole: Vec<Triangle>,
    detail: Detail,
    corners: wgpu::Buffer,
    triangles: wgpu::Buffer,
    /// Where the triangles of every layer end.
    ends: [u32; 3],
    /// Nodes from row to row, and from layer to layer.
    strides: [f32; 2],
    /// Names of parts and where they are written, at rest [m].
    anchors: Vec<(String, DVec3)>,
}

impl AnatomyView {
    /// For a block; none for a mesh, and where faces may part. `module`: the shader of the tissue with [`SHADER`] behind it.
    pub fn new(
        gpu: &Gpu,
        model: &Model,
        module: &wgpu::ShaderModule,
        format: wgpu::TextureFormat,
        (view, displacement): (&wgpu::Buffer, &Bound<'_>),
    ) -> Option<Self> {
        let Mesh::Block(block) = &model.mesh else { return None };
        if !model.separation.pairs.is_empty() {
            return None;
        }
        let anatomy = Anatomy::of_any(&model.scene)?;
        let pipelines = STAGES.map(|stage| pipeline(&gpu.device, module, stage, format));
        let bindings = bindings(gpu, &pipelines, view, displacement);
        let nodes = block.nodes();
        let detail = if gpu.is_software() { Detail::LOW } else { Detail::FULL };
        let mut whole = surfaces::surfaces(&model.scene, block, &anatomy, &detail);
        whole.extend(surfaces::border(block, &anatomy, model.scene.case.is_none(), &detail));
        Some(AnatomyView {
            pipelines,
            bindings,
            whole,
            detail,
            corners: vertices(gpu, &[] as &[PartCorner]).0,
            triangles: filled(gpu, &[] as &[u32], wgpu::BufferUsages::INDEX).0,
            ends: [0; 3],
            strides: [nodes[0] as f32, (nodes[0] * nodes[1]) as f32],
            anchors: Vec::new(),
        })
    }

    /// Draws from another engine of the same mesh.
    pub fn take_buffers(&mut self, gpu: &Gpu, view: &wgpu::Buffer, displacement: &Bound<'_>) {
        self.bindings = bindings(gpu, &self.pipelines, view, displacement);
    }

    /// Names of the parts that are seen, and where they are written, at rest [m].
    pub fn anchors(&self) -> &[(String, DVec3)] {
        &self.anchors
    }

    /// Nodes from row to row, and from layer to layer.
    pub fn strides(&self) -> [f32; 2] {
        self.strides
    }

    /// Takes away what lies beyond a plane, and colours what lies in it.
    pub fn cut(&mut self, gpu: &Gpu, model: &Model, plane: Option<RestPlane>) {
        let Mesh::Block(block) = &model.mesh else { return };
        let Some(anatomy) = Anatomy::of_any(&model.scene) else { return };
        let embedding = Embedding::new(block, &anatomy);
        let mut drawn = match plane {
            Some(plane) => surfaces::cut(&self.whole, plane.normal, plane.offset),
            None => self.whole.clone(),
        };
        if let Some(plane) = plane {
            surfaces::face(block, (plane.normal, plane.offset), (false, &self.detail), &anatomy, &mut drawn);
        }
        self.anchors = anchors(&drawn, plane, &anatomy);
        drawn.sort_by_key(|triangle| triangle.layer);
        let end = |layer: Layer| 3 * drawn.partition_point(|t| t.layer <= layer) as u32;
        self.ends = [end(Layer::Solid), end(Layer::Organ), end(Layer::Skin)];
        let (corners, numbers) = corners(&drawn, &embedding);
        self.corners = vertices(gpu, &corners).0;
        self.triangles = filled(gpu, &numbers, wgpu::BufferUsages::INDEX).0;
    }

    /// Draws all layers, what is seen through last.
    pub fn draw(&self, pass: &mut wgpu::RenderPass) {
        pass.set_vertex_buffer(0, self.corners.slice(..));
        pass.set_index_buffer(self.triangles.slice(..), wgpu::IndexFormat::Uint32);
        let mut begin = 0;
        for ((pipeline, bindings), end) in self.pipelines.iter().zip(&self.bindings).zip(self.ends) {
            if end > begin {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, bindings, &[]);
                pass.draw_indexed(begin..end, 0, 0..1);
            }
            begin = end;
        }
    }
}

/// Name and colour of the only part of a block whose faces may part: these are not drawn as surfaces in cells, and in more parts there is
/// no colour of the whole.
pub fn only_part(model: &Model) -> Option<Entry> {
    let anatomy = Anatomy::of_any(&model.scene)?;
    let [_, part] = anatomy.parts() else { return None };
    (!model.separation.pairs.is_empty()).then(|| (part.name.clone(), part.colour))
}

/// Parts that lie in the block, for the legend.
pub fn legend(model: &Model) -> Vec<Entry> {
    let (Some(anatomy), Mesh::Block(block)) = (Anatomy::of_any(&model.scene), &model.mesh) else { return Vec::new() };
    if !model.separation.pairs.is_empty() {
        return only_part(model).into_iter().collect();
    }
    let mut seen = vec![false; anatomy.parts().len()];
    for cell in 0..block.cell_count() {
        let nodes = block.cell_nodes(cell);
        let (low, high) = (block.rest_position(nodes[0]), block.rest_position(nodes[6]));
        // Layers are thinner than cells.
        for at in [DVec3::splat(0.5), DVec3::new(0.2, 0.2, 0.2), DVec3::new(0.8, 0.2, 0.8), DVec3::new(0.2, 0.8, 0.5)] {
            seen[anatomy.part_at(low + at * (high - low))] = true;
        }
    }
    let parts = anatomy.parts().iter().zip(seen).skip(1).filter(|(_, seen)| *seen);
    parts.map(|(part, _)| (part.name.clone(), part.colour)).collect()
}

/// Where the names of parts are written: in the cut, where they are in it, else on their surface, at the triangle next to their middle.
fn anchors(drawn: &[Triangle], plane: Option<RestPlane>, anatomy: &Anatomy) -> Vec<(String, DVec3)> {
    let middle = |t: &Triangle| t.corners.iter().map(|c| c.place).sum::<DVec3>() / 3.0;
    let area = |t: &Triangle| {
        let [a, b, c] = t.corners.map(|c| c.place);
        0.5 * (b - a).cross(c - a).length()
    };
    let in_cut =
        |t: &Triangle| plane.is_some_and(|p| t.corners.iter().all(|c| (p.normal.dot(c.place) - p.offset).abs() < 1e-7));
    // What is seen through, skin above all, is named in the cut only.
    let named = |t: &&Triangle| t.layer == Layer::Solid || in_cut(t);
    let mut by_colour: HashMap<Rgb, [Vec<&Triangle>; 2]> = HashMap::new();
    for triangle in drawn.iter().filter(named) {
        by_colour.entry(triangle.colour).or_default()[usize::from(in_cut(triangle))].push(triangle);
    }
    // That all around is tissue need not stand over what it hides.
    let parts = anatomy.parts().iter().skip(1).filter(|part| part.name != UNNAMED).filter_map(|part| {
        let [surface, cut] = by_colour.get(&part.colour)?;
        let of = if cut.is_empty() { surface } else { cut };
        let whole: f64 = of.iter().map(|t| area(t)).sum();
        let centre = of.iter().map(|t| middle(t) * area(t)).sum::<DVec3>() / whole.max(1e-30);
        let nearest = of.iter().min_by(|a, b| middle(a).distance(centre).total_cmp(&middle(b).distance(centre)))?;
        // A sliver needs no name.
        (whole > 4e-6).then(|| (part.name.clone(), middle(nearest)))
    });
    parts.collect()
}

/// Corners in their cells, every one once, and which of them the triangles have.
fn corners(triangles: &[Triangle], embedding: &Embedding) -> (Vec<PartCorner>, Vec<u32>) {
    let mut known: HashMap<([u32; 3], [i8; 4], Rgb), u32> = HashMap::new();
    let mut single = Vec::new();
    let mut numbers = Vec::with_capacity(3 * triangles.len());
    for triangle in triangles {
        for corner in &triangle.corners {
            let place = corner.place.as_vec3().to_array();
            let normal = corner.normal.extend(0.0).to_array().map(|x| (127.0 * x).round() as i8);
            let number = known.entry((place.map(f32::to_bits), normal, triangle.colour)).or_insert_with(|| {
                let (nodes, weights) = embedding.of(corner.place);
                let [r, g, b] = triangle.colour;
                single.push(PartCorner {
                    place,
                    node: nodes[0] as u32,
                    weights: weights.map(|weight| (255.0 * weight).round() as u8),
                    normal,
                    colour: [r, g, b, 255],
                });
                single.len() as u32 - 1
            });
            numbers.push(*number);
        }
    }
    (single, numbers)
}

fn bindings(
    gpu: &Gpu,
    pipelines: &[wgpu::RenderPipeline; 3],
    view: &wgpu::Buffer,
    displacement: &Bound<'_>,
) -> [wgpu::BindGroup; 3] {
    let group = |n: usize| {
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(STAGES[n]),
            layout: &pipelines[n].get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: view.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: displacement.resource() },
            ],
        })
    };
    std::array::from_fn(group)
}

fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    fragment: &str,
    format: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    // The faces of a cut close what it opens: no inside of a solid part is ever seen. Through the skin the far walls are.
    let cull = (fragment == STAGES[0]).then_some(wgpu::Face::Back);
    let attributes = wgpu::vertex_attr_array![
        0 => Float32x3, 1 => Uint32, 2 => Unorm8x4, 3 => Unorm8x4, 4 => Snorm8x4, 5 => Unorm8x4
    ];
    let buffers = [Some(wgpu::VertexBufferLayout {
        array_stride: size_of::<PartCorner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &attributes,
    })];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("anatomy_corner"),
            compilation_options: Default::default(),
            buffers: &buffers,
        },
        fragment: Some(wgpu::FragmentState {
            module,
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
}
