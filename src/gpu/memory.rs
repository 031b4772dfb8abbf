//! An array on the device, in a buffer or in a texture.

use super::texels::Texels;

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
