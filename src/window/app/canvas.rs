//! What the window shows: the tissue, with the panels around it where they are drawn anew; and a picture of it as a file.

use std::path::Path;
use std::time::Instant;

use egui_wgpu::ScreenDescriptor;
use glam::DVec3;

use super::pointer::look;
use super::{Debriefing, Open};
use crate::Result;
use crate::gpu::Gpu;
use crate::window::panels::{self, ReferenceCurve, Wishes};
use crate::window::scene_view::Area;
use crate::window::tool_shape::{self, ToolPlace};
use crate::window::{marks, scan};

/// Time between two drawings of the panels on a software adapter that has better things to do [s].
const PANELS_EVERY: f64 = 0.35;
/// Drawings of the panels of which one shows all of them, the others what lies beside the view on the right.
const WHOLE_EVERY: u64 = 4;

/// The panels as triangles.
pub(super) struct Panels {
    triangles: Vec<egui::ClippedPrimitive>,
    textures: egui::TexturesDelta,
}

impl Open {
    /// Filling the panels takes a software adapter longer than drawing the tissue.
    pub(super) fn panels_are_due(&self) -> bool {
        // A pointer that only wanders over the view says nothing to them.
        let wanders = |event: &egui::Event| matches!(event, egui::Event::PointerMoved(at) if self.area.contains(*at));
        let spoken = self.egui.egui_input().events.iter().any(|event| !wanders(event));
        let input = spoken || self.egui.is_any_pointer_button_down();
        let waited = self.panelled.is_none_or(|at| at.elapsed().as_secs_f64() >= PANELS_EVERY);
        !self.gpu.is_software() || self.stale || input || waited
    }

    /// Asks the panels what they show and what was clicked.
    pub(super) fn run_panels(&mut self, reference: &[ReferenceCurve], wishes: &mut Wishes) -> Panels {
        // The canvas keeps what is not drawn: without input the left side changes little.
        let still = self.gpu.is_software() && !self.stale && self.egui.egui_input().events.is_empty();
        self.panel_count += 1;
        let part = still && !self.panel_count.is_multiple_of(WHOLE_EVERY);
        self.panelled = Some(Instant::now());
        let input = self.egui.take_egui_input(&self.window);
        let context = self.egui.egui_ctx().clone();
        let mut turned = false;
        let output = context.run_ui(input, |ui| {
            if let Some(Debriefing { score, before }) = &self.debriefing
                && !panels::debriefing(ui.ctx(), score, before)
            {
                self.debriefing = None;
            }
            egui::Panel::left("controls").default_size(250.0).show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    let (practice, choices) = (&mut self.practice, &mut self.choices);
                    *wishes = panels::controls(ui, practice, choices, &mut self.camera, &mut self.desk);
                    self.devices.show(ui, &self.practice);
                });
            });
            egui::Panel::right("readings").default_size(330.0).show(ui, |ui| {
                panels::readings(ui, &self.practice, &mut self.choices, reference, self.devices.timing());
            });
            if self.choices.look.probe.on {
                egui::Panel::bottom("ultrasound").default_size(270.0).resizable(true).show(ui, |ui| {
                    let (scene, mesh) = (self.practice.scene(), &self.practice.simulation.model.mesh);
                    turned = self.scan.panel(ui, &mut self.choices.look.probe, scene, mesh);
                });
            }
            egui::CentralPanel::no_frame().show(ui, |ui| {
                self.area = ui.available_rect_before_wrap();
                let response = ui.allocate_rect(self.area, egui::Sense::click_and_drag());
                look(&response, ui, &mut self.camera, &mut self.desk, (self.practice.tool_place(), &mut self.grip));
            });
        });
        self.scale = output.pixels_per_point;
        // What moves goes on moving on the next picture.
        self.stale = output.viewport_output.values().any(|v| v.repaint_delay.is_zero())
            || egui::Popup::is_any_open(&context)
            || turned
            || self.debriefing.is_some();
        self.egui.handle_platform_output(&self.window, output.platform_output);
        if wishes.recut {
            self.cut();
        }
        let mut triangles = context.tessellate(output.shapes, self.scale);
        if part {
            triangles.retain(|shape| shape.clip_rect.right() > self.area.left());
        }
        Panels { triangles, textures: output.textures_delta }
    }

    /// Draws the tissue on the canvas, and the panels where they were asked.
    pub(super) fn draw(&mut self, encoder: &mut wgpu::CommandEncoder, panels: Option<Panels>) -> Result<()> {
        let place = self.place_tool();
        if let Some(engine) = self.practice.simulation.on_device() {
            engine.encode_fields(encoder);
        }
        let (size, view) = (self.canvas.size(), self.canvas.create_view(&Default::default()));
        let pixels = Area {
            x: self.area.left() * self.scale,
            y: self.area.top() * self.scale,
            width: self.area.width() * self.scale,
            height: self.area.height() * self.scale,
        };
        let look = &self.choices.look;
        self.view.draw(&self.gpu, encoder, (&view, size), pixels, (&self.camera, &self.choices.scale, look));
        let Some(mut panels) = panels else { return Ok(()) };
        let probe = (&look.probe, place.as_ref());
        self.scan.draw(&self.gpu, &mut self.painter, encoder, &mut self.practice, probe)?;
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        for (id, mut deltas) in panels.textures.set.drain() {
            for delta in &mut deltas {
                if self.gpu.is_software() {
                    // Letters lie on pixels: mixing four texels takes a software adapter longer, and changes nothing.
                    delta.options = egui::TextureOptions::NEAREST;
                }
                self.painter.update_texture(device, queue, id, delta);
            }
        }
        let screen = ScreenDescriptor { size_in_pixels: [size.width, size.height], pixels_per_point: self.scale };
        let more = self.painter.update_buffers(device, queue, encoder, &panels.triangles, &screen);
        // Only paint callbacks ask for buffers of their own, and there are none.
        debug_assert!(more.is_empty());
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("panels"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        self.painter.render(&mut pass.forget_lifetime(), &panels.triangles, &screen);
        for id in panels.textures.free.drain() {
            self.painter.free_texture(&id);
        }
        Ok(())
    }

    /// Puts tool, targets and the frame of the slice to their places; the tool's place is returned.
    fn place_tool(&mut self) -> Option<ToolPlace> {
        let (scene, look) = (self.practice.scene(), &self.choices.look);
        let last = self.practice.records.last();
        let line = self.practice.simulation.centre_line();
        let core = last.and_then(|r| r.core).map_or(0.0, |core| core.length);
        let place = self.practice.tool_place().map(|(tip, direction)| ToolPlace { tip, direction, line, core });
        let mut corners = scan::frame(&look.probe, scene, &self.practice.simulation.model.mesh);
        if let Some((tool, place)) = scene.tool.as_ref().zip(place.as_ref()) {
            corners.extend(tool_shape::triangles(tool, place));
        }
        for (n, target) in scene.targets.iter().enumerate().filter(|_| look.targets) {
            let moved = last.and_then(|r| r.targets.get(n)).map_or(DVec3::ZERO, |t| t.displacement);
            corners.extend(marks::target(target.position + moved, target.radius));
        }
        self.view.place_tool(&self.gpu, &corners);
        place
    }

    /// Draws the canvas once more, and writes it.
    pub(super) fn screenshot(&mut self, reference: &[ReferenceCurve], path: &Path) -> Result<()> {
        let size = self.canvas.size();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let panels = self.run_panels(reference, &mut Wishes::default());
        self.draw(&mut encoder, Some(panels))?;
        let row = (4 * size.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("screenshot"),
            size: u64::from(row) * u64::from(size.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        encoder.copy_texture_to_buffer(
            self.canvas.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            size,
        );
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read_back(&buffer)?;
        let swapped =
            matches!(self.config.format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Bgra8UnormSrgb);
        let mut pixels = Vec::with_capacity(4 * (size.width * size.height) as usize);
        for line in bytes.chunks_exact(row as usize) {
            for pixel in line[..4 * size.width as usize].chunks_exact(4) {
                let [a, g, c] = [pixel[0], pixel[1], pixel[2]];
                pixels.extend(if swapped { [c, g, a, 255] } else { [a, g, c, 255] });
            }
        }
        crate::render::write_png(path, &pixels, size.width, size.height)
    }
}

/// A texture as large as the window.
pub(super) fn canvas(gpu: &Gpu, config: &wgpu::SurfaceConfiguration) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("canvas"),
        size: wgpu::Extent3d { width: config.width, height: config.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: config.format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}
