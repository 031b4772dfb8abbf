//! The ultrasound slice in the window: made when it is asked for, with its scale and the settings of the probe beside it.

use glam::DVec3;

use super::marks;
use super::practice::Practice;
use super::probe::{ATTENUATION, Orientation, Probe, ProbePlane};
use super::slider::named;
use super::tool_shape::{ToolCorner, ToolPlace};
use super::ultrasound::{SIZE, Ultrasound, Window};
use crate::Result;
use crate::gpu::Gpu;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::words::say;

/// Largest gain and time gain of the sliders [dB], [dB/cm].
const GAIN: f64 = 20.0;
const TIME_GAIN: f64 = 15.0;
/// Room for the scale beside the picture, in points.
const SCALE_WIDTH: f32 = 34.0;
/// Room for the settings.
const SETTINGS_WIDTH: f32 = 230.0;

/// The slice of the simulation that is shown; nothing of it is there before it is first asked for.
#[derive(Default)]
pub struct Scan {
    open: Option<(Ultrasound, egui::TextureId)>,
}

impl Scan {
    /// After a restart: the buffers are new.
    pub fn close(&mut self, painter: &mut egui_wgpu::Renderer) {
        if let Some((_, id)) = self.open.take() {
            painter.free_texture(&id);
        }
    }

    /// Draws the slice where it is asked for.
    ///
    /// # Errors
    /// As [`Ultrasound::new`].
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        painter: &mut egui_wgpu::Renderer,
        encoder: &mut wgpu::CommandEncoder,
        practice: &mut Practice,
        (probe, place): (&Probe, Option<&ToolPlace>),
    ) -> Result<()> {
        if !probe.on {
            return Ok(());
        }
        let model = practice.simulation.model.clone();
        if self.open.is_none() {
            let Some(engine) = practice.simulation.on_device() else { return Ok(()) };
            let ultrasound = Ultrasound::new(gpu, engine, &model.mesh, &model.scene)?;
            let view = ultrasound.texture.create_view(&Default::default());
            let id = painter.register_native_texture(&gpu.device, &view, wgpu::FilterMode::Linear);
            self.open = Some((ultrasound, id));
        }
        if let Some((ultrasound, _)) = &mut self.open {
            ultrasound.draw(gpu, encoder, &model.mesh, probe, model.scene.needle().zip(place));
        }
        Ok(())
    }

    /// Picture, scale and settings. True where something was changed.
    pub fn panel(&self, ui: &mut egui::Ui, probe: &mut Probe, scene: &Scene, mesh: &Mesh) -> bool {
        let before = *probe;
        ui.horizontal_top(|ui| {
            // In a narrow view the settings have no more than half of it, and scroll.
            let beside = SETTINGS_WIDTH.min(0.5 * ui.available_width());
            let room = ui.available_size() - egui::vec2(beside + SCALE_WIDTH, 0.0);
            let size = egui::vec2(SIZE[0] as f32, SIZE[1] as f32);
            let size = size * (room.x / size.x).min(room.y / size.y).max(0.1);
            let (rect, _) = ui.allocate_exact_size(size + egui::vec2(SCALE_WIDTH, 0.0), egui::Sense::hover());
            let picture = egui::Rect::from_min_size(rect.min, size);
            ui.painter().rect_filled(picture, 0.0, egui::Color32::BLACK);
            if let Some((_, id)) = &self.open {
                let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
                ui.painter().image(*id, picture, whole, egui::Color32::WHITE);
            }
            let plane = ProbePlane::new(&scene.motion, probe, scene.tissue.cell_size);
            depth_scale(ui.painter(), picture, &Window::of(&plane, mesh.bounds()));
            let scroll = egui::ScrollArea::vertical().id_salt("probe");
            scroll.show(ui, |ui| ui.vertical(|ui| settings(ui, probe, scene, mesh)));
        });
        *probe != before
    }
}

/// Ticks of a millimetre beside the picture, with a number at every fifth.
fn depth_scale(painter: &egui::Painter, picture: egui::Rect, window: &Window) {
    let colour = egui::Color32::GRAY;
    let bottom = ((window.corner.y + window.size.y) * 1e3).floor() as i32;
    for depth in 0..=bottom {
        let part = (f64::from(depth) * 1e-3 - window.corner.y) / window.size.y;
        let y = picture.top() + picture.height() * part as f32;
        let long = depth % 5 == 0;
        let (from, to) = (picture.right() + 2.0, picture.right() + if long { 10.0 } else { 6.0 });
        painter.hline(from..=to, y, egui::Stroke::new(1.0, colour));
        if long {
            let text = if depth == 0 { say("millimetres").to_string() } else { depth.to_string() };
            let at = egui::pos2(to + 2.0, y);
            painter.text(at, egui::Align2::LEFT_CENTER, text, egui::FontId::proportional(11.0), colour);
        }
    }
}

fn settings(ui: &mut egui::Ui, probe: &mut Probe, scene: &Scene, mesh: &Mesh) {
    ui.spacing_mut().slider_width = (0.4 * ui.available_width()).clamp(40.0, 90.0);
    ui.strong(say("ultrasound"));
    ui.horizontal_wrapped(|ui| {
        for (orientation, name) in [(Orientation::Along, say("along")), (Orientation::Across, say("across"))] {
            if ui.radio(probe.orientation == orientation, name).clicked() {
                (probe.orientation, probe.offset) = (orientation, 0.0);
            }
        }
    });
    let [low, high] = reach(probe, scene, mesh).map(|offset| offset * 1e3);
    let mut offset = probe.offset * 1e3;
    named(ui, egui::Slider::new(&mut offset, low..=high).fixed_decimals(1), say("slice-offset"));
    probe.offset = offset * 1e-3;
    named(ui, egui::Slider::new(&mut probe.gain, -GAIN..=GAIN).fixed_decimals(0), say("gain"));
    let mut time_gain = probe.time_gain * 1e-2;
    named(ui, egui::Slider::new(&mut time_gain, 0.0..=TIME_GAIN).fixed_decimals(1), say("time-gain"));
    // The slider's steps must not move the value that it begins with.
    probe.time_gain = if (time_gain * 1e2 - ATTENUATION).abs() < 1.0 { ATTENUATION } else { time_gain * 1e2 };
    ui.add(egui::Label::new(egui::RichText::new(say("illustration")).weak()).wrap());
}

/// How far the slice can be moved and still be in the tissue [m].
fn reach(probe: &Probe, scene: &Scene, mesh: &Mesh) -> [f64; 2] {
    let plane = ProbePlane::new(&scene.motion, &Probe { offset: 0.0, ..*probe }, scene.tissue.cell_size);
    let (low, high) = mesh.bounds();
    let corners = [low, high, DVec3::new(low.x, high.y, low.z), DVec3::new(high.x, low.y, low.z)];
    let distances = corners.map(|corner| plane.project(corner).1);
    let inside = 0.98;
    [inside * distances.into_iter().fold(0.0, f64::min), inside * distances.into_iter().fold(0.0, f64::max)]
}

/// Where the slice stands, for the view.
pub fn frame(probe: &Probe, scene: &Scene, mesh: &Mesh) -> Vec<ToolCorner> {
    if !probe.on {
        return Vec::new();
    }
    let plane = ProbePlane::new(&scene.motion, probe, scene.tissue.cell_size);
    marks::frame(&plane, &Window::of(&plane, mesh.bounds()))
}
