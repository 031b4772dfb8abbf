//! A section of the tissue as an ultrasound scanner might show it, drawn from the solver's own buffers.
//!
//! An illustration from geometry: no wave is computed. What the picture takes from scanners is the look of speckle - Rayleigh
//! distributed envelopes [Burckhardt1978], [Wagner1983], compressed logarithmically - fixed in the material, so that it moves with
//! the tissue; boundaries that answer where the beam meets them square; a beam with a width, in which a needle beside the slice
//! fades; a shadow and repeated echoes below the needle. Brightness of tissues: choices of this project, in the order in which usual
//! pictures show them. The slice is a plane of the material; what moves out of it is seen where it lies along the picture's axes.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3};
use wgpu::util::DeviceExt;

use super::parts::{self, Parts};
use super::probe::{ATTENUATION, Orientation, Probe, ProbePlane, in_slice};
use super::scene_view::{bindings, vertices};
use super::section::{self, TissueCorner};
use super::tool_shape::ToolPlace;
use crate::gpu::{Gpu, GpuEngine};
use crate::mesh::Mesh;
use crate::needle::motion::Motion;
use crate::needle::{NeedleShape, TipShape, lateral_axes};
use crate::scene::{RegionShape, Scene};
use crate::{Error, Result};

const SHADER: &str = include_str!("../../shaders/render/ultrasound.wgsl");
/// The bytes are sRGB as they are.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Size of the picture [px].
pub const SIZE: [u32; 2] = [320, 256];
/// What is shown above the top face, and beside the tissue [m].
const ABOVE: f64 = 1.5e-3;
const BESIDE: f64 = 0.5e-3;
/// Largest part of the tissue that is shown, width and depth [m].
const LARGEST: DVec2 = DVec2::new(40e-3, 40e-3);
/// Edges of the speckle cell: across the beam and along it [m].
const SPECKLE: [f64; 2] = [0.34e-3, 0.17e-3];
/// From black to white [dB].
pub const DYNAMIC_RANGE: f64 = 60.0;
/// Entries of `echoes` in the shader.
const MOST_ECHOES: usize = 256;
/// What tissue under the needle loses [dB].
const SHADOW: f64 = 14.0;
/// Columns of the shadow, and points of the needle on which it rests.
const COLUMNS: usize = 160;
const SHADOW_POINTS: usize = 600;
/// Columns over which the edge of the shadow is soft.
const SOFT: usize = 5;
/// Points along the drawn needle; how far behind the tip it is drawn [m].
const ALONG: usize = 48;
const DRAWN_LENGTH: f64 = 60e-3;
/// Echoes that go to and fro in the needle and are drawn below it.
const REPEATED: f64 = 4.0;

/// Mean brightness below white [dB] of a material by its name; what is unknown looks like muscle.
fn level(material: &str) -> f64 {
    const LEVELS: [(&str, f64); 5] =
        [("skin", 18.0), ("fat", 40.0), ("vessel", 62.0), ("tumour", 42.0), ("bone", 12.0)];
    LEVELS.iter().find(|(name, _)| material.contains(name)).map_or(31.0, |(_, level)| *level)
}

/// Depth of the line that the probe's face leaves on the top face [m].
const SKIN: f64 = 0.06e-3;
/// Neighbours of one material are told apart by this much [dB].
const LEVEL_STEP: f64 = 4.0;
/// Mean brightness of a target below white [dB].
const TARGET_LEVEL: f64 = 45.0;

/// Host side of `Slice` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Slice {
    lateral: [f32; 4],
    depth: [f32; 4],
    window: [f32; 4],
    grain: [f32; 4],
    scan: [f32; 4],
    echo_count: u32,
    first_part: u32,
    part_count: u32,
    _pad: u32,
    parts_low: [f32; 4],
}

/// Host side of `Echo` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Echo {
    first: [f32; 4],
    second: [f32; 4],
    kind: u32,
    level: f32,
    edge: f32,
    edge_aside: f32,
}

/// What of the slice is shown: upper left corner and size in the picture's axes [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    pub corner: DVec2,
    pub size: DVec2,
}

impl Window {
    /// The part of the slice through a block that fits the picture; pixels are square.
    pub fn of(plane: &ProbePlane, (low, high): (DVec3, DVec3)) -> Self {
        let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for n in 0..8 {
            let corner = DVec3::select(glam::BVec3::new(n & 1 > 0, n & 2 > 0, n & 4 > 0), high, low);
            let (place, _) = plane.project(corner);
            (least, most) = (least.min(place), most.max(place));
        }
        let least = DVec2::new((least.x - BESIDE).max(-0.5 * LARGEST.x), least.y - ABOVE);
        let most = DVec2::new((most.x + BESIDE).min(0.5 * LARGEST.x), (most.y + BESIDE).min(LARGEST.y));
        let pixel = ((most - least) / DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]))).max_element();
        let size = pixel * DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
        Window { corner: DVec2::new(0.5 * (least.x + most.x - size.x), least.y), size }
    }

    /// Edge of a pixel [m].
    fn pixel(&self) -> f64 {
        self.size.x / f64::from(SIZE[0])
    }
}

/// What reflects in a scene: the tissue outside all regions, the regions, the targets. Parts of a mesh that are known by their cells
/// alone have no boundary to be drawn.
fn echoes(scene: &Scene) -> Vec<Echo> {
    let of = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
    let echo = |kind: u32, first: [f32; 4], second: [f32; 4], level: f64, edge: f32, edge_aside: f32| Echo {
        first,
        second,
        kind,
        level: -level as f32,
        edge,
        edge_aside,
    };
    // Without an end below: the bottom of the block is no boundary of the tissue.
    let slab = |top: f64, bottom: f64| [top as f32, bottom as f32, 0.0, 0.0];
    let none = [0.0; 4];
    // The skin line lies a line's width inside: half of one on the very edge would be cut off.
    let mut echoes = vec![echo(0, slab(SKIN, 1.0), none, level(&scene.material.name), 0.3, 0.2)];
    // Labels tell where the tissue is.
    if scene.case.is_some() {
        echoes.clear();
    }
    let mut known = vec![scene.material.name.as_str()];
    for region in &scene.regions {
        let name = region.material.name.as_str();
        let again = known.iter().filter(|n| **n == name).count();
        known.push(name);
        let level = level(name) + LEVEL_STEP * again as f64;
        let (kind, first, second) = match &region.shape {
            RegionShape::Layer { top, bottom } => (0, slab(*top, *bottom), none),
            RegionShape::Box { low, high } => (1, of(*low, 0.0), of(*high, 0.0)),
            RegionShape::Sphere { centre, radius } => (2, of(*centre, *radius), none),
            RegionShape::Cylinder { from, to, radius } => (3, of(*from, *radius), of(*to, 0.0)),
            // Labels are drawn from a texture of their own.
            RegionShape::MeshTag(_) | RegionShape::Labels { .. } => continue,
        };
        // A membrane is thin and bright.
        let edge = if region.material.membrane_energy.is_some() { 0.3 } else { 0.16 };
        echoes.push(echo(kind, first, second, level, edge, 0.06));
    }
    for target in &scene.targets {
        echoes.push(echo(2, of(target.position, target.radius), none, TARGET_LEVEL, 0.1, 0.5));
    }
    echoes.truncate(MOST_SHAPES);
    echoes
}

/// Entries of `echoes` that are shapes; behind them stand the parts of a label map.
const MOST_SHAPES: usize = 64;

/// A corner of the needle in the picture, as `needle_corner` takes it.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct NeedleCorner {
    /// [m]
    pub place: [f32; 2],
    /// From the axis towards the probe, where both edges are, and radius of the bore [m].
    pub across: f32,
    pub edges: [f32; 3],
    /// Seen and square to the beam, 0..1; distance between repeated echoes [m].
    pub look: [f32; 3],
}

/// A corner of the shadow: place [m], loss [dB].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ShadowCorner {
    pub place: [f32; 2],
    pub loss: f32,
}

/// The axis of a needle in the picture.
struct Axis<'a> {
    plane: &'a ProbePlane,
    needle: &'a NeedleShape,
    place: &'a ToolPlace,
    /// In the picture, from the axis towards the probe.
    up: DVec2,
}

impl<'a> Axis<'a> {
    fn new(plane: &'a ProbePlane, needle: &'a NeedleShape, place: &'a ToolPlace) -> Self {
        let along = plane.direction(place.direction);
        // Of the two normals the one that looks up, or to the right of a vertical needle.
        let normal = DVec2::new(along.y, -along.x);
        Axis { plane, needle, place, up: if normal.y > 1e-9 { -normal } else { normal } }
    }

    /// Place in the picture and distance from the slice `s` behind the tip [m].
    fn at(&self, s: f64) -> (DVec2, f64) {
        self.plane.project(self.place.axis(s))
    }

    /// Normal of the axis in the picture, on the side of `up`.
    fn normal(&self, s: f64) -> DVec2 {
        let step = 0.1e-3;
        let way = self.at((s - step).max(0.0)).0 - self.at(s + step).0;
        let way = way.try_normalize().unwrap_or(DVec2::Y);
        let normal = DVec2::new(way.y, -way.x);
        if normal.dot(self.up) < 0.0 { -normal } else { normal }
    }

    /// Radius of the bore, 0 without one [m]; at the tip it is that of the cutting edge.
    fn bore(&self, s: f64) -> f64 {
        let full = (s / self.needle.tip_length).clamp(0.0, 1.0);
        self.needle.bore.map_or(0.0, |bore| bore.edge + (bore.radius - bore.edge) * full)
    }

    /// Where the edges are, from the axis towards `up` [m].
    fn edges(&self, s: f64) -> [f64; 2] {
        let radius = self.needle.radius;
        let full = (s / self.needle.tip_length).clamp(0.0, 1.0);
        if let Some(bore) = self.needle.bore {
            let half = bore.edge + (radius - bore.edge) * full;
            return [half, -half];
        }
        let lean = match self.needle.tip {
            TipShape::Cone => 0.0,
            TipShape::Bevel { heading } => {
                let (first, second) = lateral_axes(self.place.direction);
                let apex = first * heading.cos() + second * heading.sin();
                DVec2::new(apex.dot(self.plane.lateral), apex.dot(self.plane.depth)).dot(self.up)
            }
        };
        [radius * (full + (1.0 - full) * lean), radius * (-full + (1.0 - full) * lean)]
    }
}

/// The needle in the picture, triangles.
pub fn needle_triangles(
    plane: &ProbePlane,
    beam_width: f64,
    needle: &NeedleShape,
    place: &ToolPlace,
) -> Vec<NeedleCorner> {
    let axis = Axis::new(plane, needle, place);
    let length = needle.length.min(DRAWN_LENGTH);
    // The ends of the tip, and the shaft behind it.
    let rest = (1..=ALONG).map(|n| needle.tip_length + (length - needle.tip_length) * n as f64 / ALONG as f64);
    let points: Vec<f64> = [0.0, 0.5 * needle.tip_length, needle.tip_length].into_iter().chain(rest).collect();
    let spacing = 2.0 * needle.radius;
    let ends = [needle.radius + 0.4e-3, -needle.radius - REPEATED * spacing];
    let row = |s: f64| -> [NeedleCorner; 2] {
        let ((at, distance), normal) = (axis.at(s), axis.normal(s));
        let seen = in_slice(distance, needle.radius, beam_width);
        let [near, far] = axis.edges(s);
        ends.map(|across| NeedleCorner {
            place: (at + normal * across).as_vec2().into(),
            across: across as f32,
            edges: [near, far, axis.bore(s)].map(|edge| edge as f32),
            look: [seen as f32, normal.y.abs() as f32, spacing as f32],
        })
    };
    let rows: Vec<[NeedleCorner; 2]> = points.into_iter().map(row).collect();
    rows.windows(2).flat_map(|w| [w[0][0], w[0][1], w[1][1], w[0][0], w[1][1], w[1][0]]).collect()
}

/// The shadow of the needle: columns of the picture from the deepest point of the needle in them down to the end of the window.
pub fn shadow_triangles(
    plane: &ProbePlane,
    window: &Window,
    beam_width: f64,
    needle: &NeedleShape,
    place: &ToolPlace,
) -> Vec<ShadowCorner> {
    let axis = Axis::new(plane, needle, place);
    let length = needle.length.min(DRAWN_LENGTH);
    let width = window.size.x / COLUMNS as f64;
    // Depth of the needle's underside and how much of it the beam meets.
    let mut columns: Vec<(f64, f64)> = vec![(f64::NEG_INFINITY, 0.0); COLUMNS];
    for n in 0..=SHADOW_POINTS {
        let s = length * n as f64 / SHADOW_POINTS as f64;
        let ((at, distance), normal) = (axis.at(s), axis.normal(s));
        // What is above the tissue throws no shadow: the probe stands there.
        if at.y < 0.0 {
            continue;
        }
        let seen = in_slice(distance, needle.radius, beam_width);
        let [near, far] = axis.edges(s);
        let sides = [near, far].map(|edge| at + normal * edge);
        let (left, right) = (sides[0].x.min(sides[1].x), sides[0].x.max(sides[1].x));
        if right < window.corner.x || left > window.corner.x + window.size.x {
            continue;
        }
        let column = |x: f64| (((x - window.corner.x) / width).max(0.0) as usize).min(COLUMNS - 1);
        let deepest = sides[0].y.max(sides[1].y);
        for (top, most) in &mut columns[column(left)..=column(right)] {
            *top = top.max(deepest);
            *most = most.max(seen);
        }
    }
    let bottom = window.corner.y + window.size.y;
    let mut corners = Vec::new();
    for c in 0..COLUMNS {
        // The beam is as wide as several columns.
        let around = &columns[c.saturating_sub(SOFT)..(c + SOFT + 1).min(COLUMNS)];
        let seen = around.iter().map(|(_, seen)| seen).sum::<f64>() / around.len() as f64;
        let top = around.iter().map(|(top, _)| *top).fold(f64::NEG_INFINITY, f64::max);
        if seen < 0.01 || top >= bottom {
            continue;
        }
        let left = window.corner.x + width * c as f64;
        let corner = |x: f64, y: f64| ShadowCorner { place: [x as f32, y as f32], loss: (SHADOW * seen) as f32 };
        let quad = [corner(left, top), corner(left, bottom), corner(left + width, bottom), corner(left + width, top)];
        corners.extend([0, 1, 2, 0, 2, 3].map(|n| quad[n]));
    }
    corners
}

/// The slice of one simulation on its device.
pub struct Ultrasound {
    tissue: wgpu::RenderPipeline,
    parts: Option<Parts>,
    shadow: wgpu::RenderPipeline,
    needle: wgpu::RenderPipeline,
    /// In the order of the pipelines.
    bindings: [wgpu::BindGroup; 3],
    slice: wgpu::Buffer,
    corners: (wgpu::Buffer, u32),
    pub texture: wgpu::Texture,
    echo_count: u32,
    motion: Motion,
    cell_size: f64,
    bounds: (DVec3, DVec3),
    /// Where the corners were cut.
    cut_at: Option<(Orientation, f64)>,
}

impl Ultrasound {
    /// For an engine on a device; it needs no fields of a window.
    ///
    /// # Errors
    /// `Error::Device` where the device refuses a pipeline.
    pub fn new(gpu: &Gpu, engine: &GpuEngine, mesh: &Mesh, scene: &Scene) -> Result<Self> {
        let device = &gpu.device;
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("ultrasound"),
            source: wgpu::ShaderSource::Wgsl(gpu.drawing(SHADER)),
        });
        let pipeline = |[vertex, fragment]: [&str; 2], stride: usize, attributes: &[wgpu::VertexAttribute], blend| {
            let buffers = [Some(wgpu::VertexBufferLayout {
                array_stride: stride as u64,
                step_mode: Default::default(),
                attributes,
            })];
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(vertex),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers: &buffers,
                },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &[Some(wgpu::ColorTargetState {
                        format: FORMAT,
                        blend,
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                primitive: Default::default(),
                depth_stencil: None,
                multisample: Default::default(),
                multiview_mask: None,
                cache: None,
            })
        };
        let tissue = pipeline(
            ["slice_corner", "slice_colour"],
            size_of::<TissueCorner>(),
            &wgpu::vertex_attr_array![0 => Uint32x2, 1 => Float32],
            None,
        );
        // Decibels are taken off on the logarithmic scale, which the picture already has.
        let less = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::ReverseSubtract,
        };
        let shadow = pipeline(
            ["shadow_corner", "shadow_colour"],
            size_of::<ShadowCorner>(),
            &wgpu::vertex_attr_array![0 => Float32x2, 1 => Float32],
            Some(wgpu::BlendState { color: less, alpha: less }),
        );
        let needle = pipeline(
            ["needle_corner", "needle_colour"],
            size_of::<NeedleCorner>(),
            &wgpu::vertex_attr_array![0 => Float32x2, 1 => Float32, 2 => Float32x3, 3 => Float32x3],
            Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        );
        let filled = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let slice = filled("slice", bytemuck::bytes_of(&Slice::zeroed()), uniform);
        let mut table = echoes(scene);
        let echo_count = table.len() as u32;
        let parts = Parts::of(scene, mesh);
        if let Some(parts) = &parts {
            let levels = parts.levels.iter().take(MOST_ECHOES - table.len());
            table.extend(levels.map(|level| Echo { level: -level, ..Echo::zeroed() }));
        }
        table.resize(MOST_ECHOES, Echo::zeroed());
        let table = filled("echoes", bytemuck::cast_slice(&table), uniform);
        let rest: Vec<[f32; 4]> =
            (0..mesh.node_count()).map(|node| mesh.rest_position(node).as_vec3().extend(0.0).into()).collect();
        let rest = filled("node_rest", bytemuck::cast_slice(&rest), wgpu::BufferUsages::STORAGE);
        let displacement = engine
            .memory("node_displacement")
            .map(|memory| memory.bound(None))
            .ok_or_else(|| Error::Device("the engine has no buffer node_displacement".into()))?;
        let [of_slice, of_table, of_rest] = [&slice, &table, &rest].map(wgpu::Buffer::as_entire_binding);
        let bindings = [
            {
                let texture = parts::texture(gpu, parts.as_ref());
                let parts = wgpu::BindingResource::TextureView(&texture);
                bindings(device, &tissue, &[of_slice.clone(), of_table, displacement.resource(), of_rest, parts])
            },
            bindings(device, &shadow, std::slice::from_ref(&of_slice)),
            bindings(device, &needle, std::slice::from_ref(&of_slice)),
        ];
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("ultrasound"),
            size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let ultrasound = Ultrasound {
            tissue,
            parts,
            shadow,
            needle,
            bindings,
            slice,
            corners: vertices(gpu, &[] as &[TissueCorner]),
            texture,
            echo_count,
            motion: scene.motion.clone(),
            cell_size: scene.tissue.cell_size,
            bounds: mesh.bounds(),
            cut_at: None,
        };
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(Error::Device(format!("drawing of the slice: {error}"))),
            None => Ok(ultrasound),
        }
    }

    /// Draws the slice as the tissue lies now, with the needle where it is in it.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &Mesh,
        probe: &Probe,
        needle: Option<(&NeedleShape, &ToolPlace)>,
    ) {
        let plane = ProbePlane::new(&self.motion, probe, self.cell_size);
        let window = Window::of(&plane, self.bounds);
        // The material plane changes only when the probe is moved.
        let place = (probe.orientation, probe.offset);
        if self.cut_at != Some(place) {
            let rest = plane.rest_plane();
            self.corners = vertices(
                gpu,
                &match &self.parts {
                    Some(parts) => section::slice_of(mesh, rest, |cell| parts.is_heard(mesh, cell)),
                    None => section::slice(mesh, rest),
                },
            );
            self.cut_at = Some(place);
        }
        let axis = |v: DVec3| v.extend(v.dot(plane.origin)).as_vec4().into();
        let slice = Slice {
            lateral: axis(plane.lateral),
            depth: axis(plane.depth),
            window: [window.corner.x, window.corner.y, window.size.x, window.size.y].map(|x| x as f32),
            grain: [SPECKLE[0], SPECKLE[1], probe.offset / probe.beam_width, window.pixel()].map(|x| x as f32),
            scan: [probe.gain, ATTENUATION - probe.time_gain, DYNAMIC_RANGE, 0.0].map(|x| x as f32),
            echo_count: self.echo_count,
            first_part: self.echo_count,
            part_count: self.parts.as_ref().map_or(0, |parts| parts.levels.len() as u32),
            _pad: 0,
            parts_low: self.parts.as_ref().map_or([0.0; 4], |parts| parts.low),
        };
        gpu.queue.write_buffer(&self.slice, 0, bytemuck::bytes_of(&slice));
        let (shadow, needle) = match needle {
            None => Default::default(),
            Some((needle, place)) => (
                shadow_triangles(&plane, &window, probe.beam_width, needle, place),
                needle_triangles(&plane, probe.beam_width, needle, place),
            ),
        };
        let (shadow, needle) = (vertices(gpu, &shadow), vertices(gpu, &needle));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("ultrasound"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.texture.create_view(&Default::default()),
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        for (pipeline, bindings, (buffer, count)) in [
            (&self.tissue, &self.bindings[0], &self.corners),
            (&self.shadow, &self.bindings[1], &shadow),
            (&self.needle, &self.bindings[2], &needle),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn upright() -> (ProbePlane, Window) {
        let motion = Motion { direction: DVec3::NEG_Z, ..Default::default() };
        let plane = ProbePlane::new(&motion, &Probe::default(), 0.0);
        (plane, Window::of(&plane, (DVec3::new(-10e-3, -10e-3, -16e-3), DVec3::new(10e-3, 10e-3, 0.0))))
    }

    #[test]
    fn the_window_holds_the_block_with_square_pixels() {
        let (_, window) = upright();
        let end = window.corner + window.size;
        assert!(window.corner.x <= -10e-3 && end.x >= 10e-3 && window.corner.y < 0.0 && end.y >= 16e-3);
        let pixels = window.size / DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
        assert!((pixels.x / pixels.y - 1.0).abs() < 1e-12);
        // In the middle across the beam.
        assert!((window.corner.x + end.x).abs() < 1e-12);
    }

    #[test]
    fn the_needle_has_its_width_and_fades_beside_the_slice() {
        let (plane, _) = upright();
        let needle = NeedleShape::cone("16G", 0.825e-3, 2.5e-3);
        let at = |y: f64| ToolPlace::straight(DVec3::new(0.0, y, -8e-3), DVec3::NEG_Z);
        let corners = needle_triangles(&plane, 1.5e-3, &needle, &at(0.0));
        assert!(corners.iter().all(|c| c.look[0] == 1.0));
        let deepest = corners.iter().map(|c| c.place[1]).fold(0.0, f32::max);
        assert!((deepest - 8e-3).abs() < 1e-6);
        let widest = corners.iter().map(|c| c.edges[0] - c.edges[1]).fold(0.0, f32::max);
        assert!((widest - 1.65e-3).abs() < 1e-8);
        let beside = needle_triangles(&plane, 1.5e-3, &needle, &at(0.825e-3 + 0.75e-3));
        assert!(beside.iter().all(|c| (c.look[0] - 0.5).abs() < 1e-5));
    }

    /// Below a vertical needle it is dark under its tip only, below a slanted one under all of it.
    #[test]
    fn the_shadow_lies_under_the_needle() {
        let (plane, window) = upright();
        let needle = NeedleShape::cone("16G", 0.825e-3, 2.5e-3);
        let bottom = (window.corner.y + window.size.y) as f32;
        for (direction, least, most) in [
            (DVec3::NEG_Z, -0.825e-3, 0.825e-3),
            // The part that is inside: from the entry, 8 mm beside the tip.
            (DVec3::new(1.0, 0.0, -1.0).normalize(), -8e-3 - 0.8e-3, 0.1e-3),
        ] {
            let place = ToolPlace::straight(DVec3::new(0.0, 0.0, -8e-3), direction);
            let corners = shadow_triangles(&plane, &window, 1.5e-3, &needle, &place);
            let soft = window.size.x / COLUMNS as f64 * (SOFT + 1) as f64;
            for corner in &corners {
                let [x, y] = corner.place.map(f64::from);
                assert!(x > least - soft && x < most + soft, "{x}");
                assert!(y > 0.0 && corner.place[1] <= bottom && corner.loss > 0.0);
            }
            let (left, right) =
                corners.iter().map(|c| f64::from(c.place[0])).fold((1.0f64, -1.0f64), |(l, r), x| (l.min(x), r.max(x)));
            assert!(right - left > 0.8 * (most - least), "{left}..{right}");
        }
        // Beside the slice there is none.
        let place = ToolPlace::straight(DVec3::new(0.0, 6e-3, -8e-3), DVec3::NEG_Z);
        assert!(shadow_triangles(&plane, &window, 1.5e-3, &needle, &place).is_empty());
    }
}
