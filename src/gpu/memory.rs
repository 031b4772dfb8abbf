//! An array on the device, in a buffer or in a texture.

use super::arrays::Contents;
use super::device::Gpu;
use super::kernel::BindingKind;
use super::texels::{Texels, texel_numbers};
use crate::error::{Error, Result};

/// An array on the device.
#[derive(Debug, Clone)]
pub enum Memory {
    Buffer(wgpu::Buffer),
    Texels(Texels),
}

/// What a bind group takes of it.
pub enum Bound<'a> {
    Buffer(wgpu::BufferBinding<'a>),
    View(wgpu::TextureView),
}

impl Bound<'_> {
    pub fn resource(&self) -> wgpu::BindingResource<'_> {
        match self {
            Bound::Buffer(binding) => wgpu::BindingResource::Buffer(binding.clone()),
            Bound::View(view) => wgpu::BindingResource::TextureView(view),
        }
    }
}

impl Memory {
    /// Length of the array [bytes].
    pub fn size(&self) -> u64 {
        match self {
            Memory::Buffer(buffer) => buffer.size(),
            Memory::Texels(texels) => texels.size(),
        }
    }

    /// What it takes on the device [bytes].
    pub fn device_bytes(&self) -> u64 {
        match self {
            Memory::Buffer(buffer) => buffer.size(),
            Memory::Texels(texels) => texels.device_bytes(),
        }
    }

    /// The buffer, where it lies in one.
    pub fn buffer(&self) -> Option<&wgpu::Buffer> {
        match self {
            Memory::Buffer(buffer) => Some(buffer),
            Memory::Texels(_) => None,
        }
    }

    /// For a bind group; of a buffer the first `size` bytes, or all.
    pub fn bound(&self, size: Option<u64>) -> Bound<'_> {
        match self {
            Memory::Buffer(buffer) => {
                Bound::Buffer(wgpu::BufferBinding { buffer, offset: 0, size: size.and_then(wgpu::BufferSize::new) })
            }
            Memory::Texels(texels) => Bound::View(texels.view()),
        }
    }

    /// Writes the array from its beginning.
    pub fn write(&self, queue: &wgpu::Queue, bytes: &[u8]) {
        match self {
            Memory::Buffer(buffer) => queue.write_buffer(buffer, 0, bytes),
            Memory::Texels(texels) => texels.write(queue, bytes),
        }
    }

    /// Copies `size` bytes from byte `from` on into a buffer; all three are multiples of four.
    pub fn encode_copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (from, size): (u64, u64),
        (target, offset): (&wgpu::Buffer, u64),
    ) {
        match self {
            Memory::Buffer(buffer) => encoder.copy_buffer_to_buffer(buffer, from, target, offset, size),
            Memory::Texels(texels) => texels.encode_copy(encoder, (from, size), (target, offset)),
        }
    }
}

/// An array on the device with what it holds at the start, for all the ways in which stages bind it.
///
/// # Errors
/// `Error::Input` where a portable device binds no array of this size.
pub fn allocate(gpu: &Gpu, name: &str, contents: &Contents, kinds: &[BindingKind]) -> Result<Memory> {
    let size = match contents {
        Contents::Bytes(bytes) => bytes.len() as u64,
        Contents::Zeros(size) => *size,
    }
    .next_multiple_of(4)
    .max(4);
    let limit = gpu.device.limits().max_storage_buffer_binding_size.min(Texels::LARGEST);
    if size > limit {
        return Err(Error::input(
            format!(
                "the mesh is too fine: buffer `{name}` would need {:.0} MiB, a portable device binds {:.0} MiB",
                size as f64 / 1048576.0,
                limit as f64 / 1048576.0
            ),
            "choose a larger cell_size_mm or a smaller block, or --engine cpu",
        ));
    }
    let memory = if kinds.iter().any(|kind| matches!(kind, BindingKind::Texels | BindingKind::Sampled)) {
        Memory::Texels(Texels::new(&gpu.device, name, size, texel_numbers(name)))
    } else {
        let usage = |kind: &BindingKind| match kind {
            BindingKind::Uniform => wgpu::BufferUsages::UNIFORM,
            _ => wgpu::BufferUsages::STORAGE,
        };
        let copied = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Memory::Buffer(gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size,
            usage: kinds.iter().map(usage).fold(copied, |all, usage| all | usage),
            mapped_at_creation: false,
        }))
    };
    if let Contents::Bytes(bytes) = contents {
        memory.write(&gpu.queue, bytes);
    }
    Ok(memory)
}
