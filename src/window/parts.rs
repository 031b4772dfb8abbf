//! Parts of a patient as the ultrasound slice hears them: a texture of their numbers at rest, with what bone and air take of the beam.
//!
//! The beam goes down in the scene. What lies in the shadow is counted along columns of the tissue at rest: bone does not move, and tissue
//! little to the side.

use glam::DVec3;
use rayon::prelude::*;
use wgpu::util::DeviceExt;

use crate::gpu::Gpu;
use crate::mesh::Mesh;
use crate::render::anatomy::Anatomy;
use crate::render::surfaces::Embedding;
use crate::scene::Scene;

/// Edge of a texel [m], and most of them along an axis; of more, texels are larger.
const TEXEL: f64 = 0.5e-3;
const MOST_TEXELS: f64 = 192.0;
/// Brightness below white [dB] of nothing, above the skin.
const NOTHING_LEVEL: f32 = 90.0;
/// Brightness below white [dB] by words of a name, the first that fits; what is unknown looks like muscle.
const LEVELS: [(&str, f32); 20] = [
    ("lesion", 42.0),
    ("tumo", 42.0),
    ("marrow", 30.0),
    ("fat", 40.0),
    ("skin", 18.0),
    ("cartilage", 46.0),
    ("disc", 30.0),
    ("bone", 12.0),
    ("vertebra", 12.0),
    ("rib", 12.0),
    ("fluid", 66.0),
    ("csf", 66.0),
    ("vein", 62.0),
    ("arter", 62.0),
    ("vessel", 62.0),
    ("ligament", 21.0),
    ("dura", 16.0),
    ("membrane", 18.0),
    ("liver", 28.0),
    ("airway", 14.0),
];
const OTHER_LEVEL: f32 = 31.0;
/// What throws a shadow.
const OPAQUE: [&str; 7] = ["bone", "vertebra", "rib", "airway", "trachea", "lung", "marrow"];

/// Numbers of parts at rest in a box around the block.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Low corner of the first texel, and edge [m].
    pub low: [f32; 4],
    /// Texels along x, y, z.
    pub size: [usize; 3],
    /// Number of the part, and how many texels of bone or air lie above it up to 255; x fastest.
    pub texels: Vec<[u8; 2]>,
    /// Brightness of every part below white [dB].
    pub levels: Vec<f32>,
    /// Nodes that move with the tissue or belong to bone; those of air stand still beside tissue that moves.
    known: Vec<bool>,
}

impl Parts {
    /// Whether a cell is drawn: cells of air are not, that stand still beside the skin.
    pub fn is_heard(&self, mesh: &Mesh, cell: usize) -> bool {
        !mesh.is_gap(cell) && mesh.cell_nodes(cell).iter().all(|node| self.known[*node])
    }

    /// Of a scene with a label map.
    pub fn of(scene: &Scene, mesh: &Mesh) -> Option<Self> {
        scene.case.as_ref()?;
        let Mesh::Block(block) = mesh else { return None };
        let anatomy = Anatomy::of_scene(scene)?;
        let (low, high) = mesh.bounds();
        let edge = TEXEL.max((high - low).max_element() / MOST_TEXELS);
        let size = ((high - low) / edge).ceil().max(DVec3::ONE).to_array().map(|n| n as usize);
        let [nx, ny, nz] = size;
        let levels = anatomy.parts().iter().enumerate();
        let levels: Vec<f32> = levels.map(|(n, part)| if n == 0 { NOTHING_LEVEL } else { level(&part.name) }).collect();
        let opaque: Vec<bool> = anatomy.parts().iter().map(|part| holds(&part.name, &OPAQUE)).collect();
        // A number is a byte; a body with more parts than that in one block is none.
        let number = |part: usize| part.min(191) as u8;
        let parts: Vec<u8> = (0..nx * ny * nz)
            .into_par_iter()
            .map(|n| {
                let at = DVec3::new((n % nx) as f64, (n / nx % ny) as f64, (n / (nx * ny)) as f64);
                number(anatomy.part_at(low + (at + 0.5) * edge))
            })
            .collect();
        let mut above = vec![0u8; nx * ny];
        let mut texels = vec![[0; 2]; parts.len()];
        for k in (0..nz).rev() {
            for (column, above) in above.iter_mut().enumerate() {
                let at = k * nx * ny + column;
                texels[at] = [parts[at], *above];
                *above = above.saturating_add(u8::from(opaque[usize::from(parts[at])]));
            }
        }
        let low = low.as_vec3();
        let known = Embedding::new(block, &anatomy).known().to_vec();
        Some(Parts { low: [low.x, low.y, low.z, edge as f32], size, texels, levels, known })
    }
}

fn holds(name: &str, words: &[&str]) -> bool {
    let name = name.to_lowercase();
    // `rib` is not in `fibrous`.
    words
        .iter()
        .any(|word| name.starts_with(word) || name.contains(&format!(" {word}")) || name.contains(&format!("_{word}")))
}

fn level(name: &str) -> f32 {
    let long = |word: &str| word.len() > 4 && name.to_lowercase().contains(word);
    let found = LEVELS.iter().find(|(word, _)| holds(name, &[word]) || long(word));
    found.map_or(OTHER_LEVEL, |(_, level)| *level)
}

/// The texture of the parts; one texel without a label map.
pub fn texture(gpu: &Gpu, parts: Option<&Parts>) -> wgpu::TextureView {
    let single = [[0u8; 2]];
    let (size, texels) = parts.map_or(([1; 3], single.as_slice()), |parts| (parts.size, parts.texels.as_slice()));
    let [width, height, depth_or_array_layers] = size.map(|n| n as u32);
    let texture = gpu.device.create_texture_with_data(
        &gpu.queue,
        &wgpu::TextureDescriptor {
            label: Some("parts"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format: wgpu::TextureFormat::Rg8Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        bytemuck::cast_slice(texels),
    );
    texture.create_view(&Default::default())
}
