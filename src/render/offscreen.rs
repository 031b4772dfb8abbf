//! Draws a picture on the device into a texture and reads it back.

use bytemuck::{Pod, Zeroable};
use wgpu::util::DeviceExt;

use super::picture::{Picture, Vertex};
use crate::{Error, Result};

const SHADER: &str = include_str!("../../shaders/render/stress_picture.wgsl");
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// Samples per pixel; the one count besides 1 that every adapter offers.
const SAMPLES: u32 = 4;
/// Vertices per buffer: far below the smallest buffer that adapters must offer (256 MiB), and whole triangles.
const VERTICES_PER_BUFFER: usize = 3 << 19;

/// Host side of `Viewport` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Viewport {
    size: [f32; 2],
    _pad: [f32; 2],
}

/// Four bytes per pixel (sRGB), rows from the top.
pub fn render_on_device(device: &wgpu::Device, queue: &wgpu::Queue, picture: &Picture) -> Result<Vec<u8>> {
    let largest = device.limits().max_texture_dimension_2d;
    if picture.width > largest || picture.height > largest {
        return Err(Error::input(
            format!(
                "a picture of {} x {} pixels is larger than the device draws ({largest})",
                picture.width, picture.height
            ),
            "give a smaller picture width",
        ));
    }
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let bytes = draw(device, queue, picture);
    if let Some(reason) = pollster::block_on(scope.pop()) {
        return Err(Error::Device(format!("stress picture: {reason}")));
    }
    bytes
}

fn draw(device: &wgpu::Device, queue: &wgpu::Queue, picture: &Picture) -> Result<Vec<u8>> {
    let size = wgpu::Extent3d { width: picture.width, height: picture.height, depth_or_array_layers: 1 };
    let texture = |label, sample_count, usage| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size,
            mip_level_count: 1,
            sample_count,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage,
            view_formats: &[],
        })
    };
    let samples = texture("stress_picture samples", SAMPLES, wgpu::TextureUsages::RENDER_ATTACHMENT);
    let target = texture("stress_picture", 1, wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC);
    let row_bytes = 4 * picture.width;
    let padded_row = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let readback = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("stress_picture readback"),
        size: u64::from(padded_row) * u64::from(picture.height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });

    let shader = parsed_shader()?;
    let pipeline = pipeline(device);
    let viewport = Viewport { size: [picture.width as f32, picture.height as f32], _pad: [0.0; 2] };
    let uniform = |label, contents: &[u8]| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage: wgpu::BufferUsages::UNIFORM,
        })
    };
    let viewport = uniform("viewport", bytemuck::bytes_of(&viewport));
    let table = uniform("colour_table", bytemuck::cast_slice(&picture.colour_table));
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("stress_picture"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: binding(&shader, "viewport")?, resource: viewport.as_entire_binding() },
            wgpu::BindGroupEntry { binding: binding(&shader, "colour_table")?, resource: table.as_entire_binding() },
        ],
    });
    let vertices: Vec<(wgpu::Buffer, u32)> = picture
        .vertices
        .chunks(VERTICES_PER_BUFFER)
        .map(|chunk| {
            let buffer = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("stress_picture vertices"),
                contents: bytemuck::cast_slice(chunk),
                usage: wgpu::BufferUsages::VERTEX,
            });
            (buffer, chunk.len() as u32)
        })
        .collect();

    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("stress_picture") });
    {
        let [r, g, b, a] = picture.background.map(f64::from);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("stress_picture"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &samples.create_view(&Default::default()),
                depth_slice: None,
                resolve_target: Some(&target.create_view(&Default::default())),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                    store: wgpu::StoreOp::Discard,
                },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        for (buffer, count) in &vertices {
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..*count, 0..1);
        }
    }
    encoder.copy_texture_to_buffer(
        target.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &readback,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded_row), rows_per_image: None },
        },
        size,
    );
    queue.submit([encoder.finish()]);

    let (sender, receiver) = std::sync::mpsc::channel();
    readback.map_async(wgpu::MapMode::Read, .., move |mapped| {
        // The receiver is gone only if this function has returned with another error.
        let _ = sender.send(mapped);
    });
    let failed = |reason: &dyn std::fmt::Display| Error::Device(format!("stress picture, read-back: {reason}"));
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|reason| failed(&reason))?;
    receiver.recv().map_err(|reason| failed(&reason))?.map_err(|reason| failed(&reason))?;
    let mapped = readback.get_mapped_range(..).map_err(|reason| failed(&reason))?;
    Ok(mapped.chunks(padded_row as usize).flat_map(|row| &row[..row_bytes as usize]).copied().collect())
}

fn shader_error(message: String) -> Error {
    Error::Shader { stage: "stress_picture".into(), message }
}

fn parsed_shader() -> Result<naga::Module> {
    naga::front::wgsl::parse_str(SHADER).map_err(|reason| shader_error(reason.emit_to_string(SHADER)))
}

/// Binding number of a variable of the shader, by its name.
fn binding(shader: &naga::Module, name: &str) -> Result<u32> {
    shader
        .global_variables
        .iter()
        .find(|(_, variable)| variable.name.as_deref() == Some(name))
        .and_then(|(_, variable)| variable.binding.as_ref())
        .map(|place| place.binding)
        .ok_or_else(|| shader_error(format!("there is no bound variable {name}")))
}

fn pipeline(device: &wgpu::Device) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("stress_picture"),
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("stress_picture"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("place_corner"),
            compilation_options: Default::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Vertex>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![
                    0 => Float32x2, 1 => Float32, 2 => Float32, 3 => Float32x4
                ],
            })],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState { count: SAMPLES, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("colour_pixel"),
            compilation_options: Default::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: FORMAT,
                blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    #[test]
    fn host_and_shader_agree_on_the_viewport() {
        let shader = parsed_shader().unwrap();
        let (_, viewport) = shader
            .types
            .iter()
            .find(|(_, kind)| kind.name.as_deref() == Some("Viewport"))
            .expect("struct Viewport in the shader");
        let naga::TypeInner::Struct { members, span } = &viewport.inner else {
            panic!("Viewport is no struct");
        };
        let found: Vec<(&str, usize)> =
            members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
        assert_eq!(found, [("size", offset_of!(Viewport, size)), ("_pad", offset_of!(Viewport, _pad)),]);
        assert_eq!(*span as usize, size_of::<Viewport>());
    }

    #[test]
    fn vertices_are_laid_out_as_the_pipeline_reads_them() {
        assert_eq!(offset_of!(Vertex, field_value), 8);
        assert_eq!(offset_of!(Vertex, field_weight), 12);
        assert_eq!(offset_of!(Vertex, colour), 16);
        assert_eq!(size_of::<Vertex>(), 32);
    }

    #[test]
    fn a_missing_variable_is_named() {
        let shader = parsed_shader().unwrap();
        assert!(binding(&shader, "colour_table").is_ok());
        let error = binding(&shader, "colour_tabel").unwrap_err();
        assert!(error.to_string().contains("colour_tabel"), "{error}");
    }
}
