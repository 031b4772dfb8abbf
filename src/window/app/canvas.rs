//! What the practice screen shows: the tissue, with the panels around it where they are drawn anew.

use std::time::Instant;

use glam::DVec3;

use super::pointer::look;
use super::practice_screen::PracticeScreen;
use super::stage::{Panels, Stage};
use crate::Result;
use crate::window::help::{self, Topic};
use crate::window::overlay::Overlay;
use crate::window::panels::{self, Wishes};
use crate::window::scene_view::Area;
use crate::window::settings::{Fold, Settings};
use crate::window::tool_shape::{self, ToolPlace};
use crate::window::{marks, scan};

/// Time between two drawings of the panels on a software adapter that has better things to do [s].
const PANELS_EVERY: f64 = 0.35;
/// Drawings of the panels of which one shows all of them, the others what lies beside the view on the right.
const WHOLE_EVERY: u64 = 4;

/// Width of the smallest view that is written over [points].
const LEAST_WRITTEN_OVER: f32 = 330.0;

/// The part of the view that is written over: a little less than the view, which tells it from the panels.
fn over(area: egui::Rect) -> egui::Rect {
    area.shrink(0.5)
}
/// Keys of this screen.
const TOPICS: [Topic; 5] = [help::RUN, help::NEEDLE, help::VIEW, help::AFTER, help::EVERYWHERE];

impl PracticeScreen {
    /// Filling the panels takes a software adapter longer than drawing the tissue.
    pub(super) fn panels_are_due(&self, stage: &Stage) -> bool {
        // A pointer that only wanders over the view says nothing to them.
        let wanders = |event: &egui::Event| matches!(event, egui::Event::PointerMoved(at) if self.area.contains(*at));
        let spoken = stage.egui.egui_input().events.iter().any(|event| !wanders(event));
        let input = spoken || stage.egui.is_any_pointer_button_down();
        let waited = self.panelled.is_none_or(|at| at.elapsed().as_secs_f64() >= PANELS_EVERY);
        !stage.gpu.is_software() || stage.stale || input || waited
    }

    /// Asks the panels what they show and what was clicked.
    pub(super) fn run_panels(&mut self, stage: &mut Stage, settings: &mut Settings, wishes: &mut Wishes) -> Panels {
        // The canvas keeps what is not drawn: without input the left side changes little.
        let still = stage.gpu.is_software() && !stage.stale && stage.egui.egui_input().events.is_empty();
        self.panel_count += 1;
        let part = still && !self.panel_count.is_multiple_of(WHOLE_EVERY);
        self.panelled = Some(Instant::now());
        let (mut turned, mut help) = (false, false);
        let mut panels = stage.lay_out(settings, &TOPICS, |ui, settings| {
            let mut asked = Wishes::default();
            egui::Panel::top("bar").show(ui, |ui| {
                panels::bar(ui, &self.practice.scene().title, settings, &mut asked, &mut help);
            });
            if self.after.covers() {
                let answer = self.after.show(ui);
                *wishes = Wishes { next: asked.next, answer, ..Wishes::default() };
                return;
            }
            let [left, right] = panels::widths(ui.available_width());
            if !settings.is_folded(Fold::Left) {
                egui::Panel::left("controls").exact_size(left).resizable(false).show(ui, |ui| {
                    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                        let (practice, choices) = (&mut self.practice, &mut self.choices);
                        *wishes = panels::controls(ui, practice, choices, &mut self.camera, &mut self.desk);
                        self.devices.show(ui, &self.practice);
                    });
                });
            }
            wishes.next = asked.next;
            if !settings.is_folded(Fold::Right) {
                egui::Panel::right("readings").exact_size(right).resizable(false).show(ui, |ui| {
                    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                        let timing = self.devices.timing();
                        self.lesson.panel(ui, &mut settings.guided, &mut settings.sound);
                        ui.separator();
                        panels::readings(ui, &self.practice, &mut self.choices, &self.reference, timing);
                    });
                });
            }
            if self.choices.look.probe.on {
                let height = (0.34 * ui.available_height()).clamp(130.0, 270.0);
                egui::Panel::bottom("ultrasound").default_size(height).resizable(true).show(ui, |ui| {
                    let (scene, mesh) = (self.practice.scene(), &self.practice.simulation.model.mesh);
                    turned = self.scan.panel(ui, &mut self.choices.look.probe, scene, mesh);
                });
            }
            egui::Panel::top("lesson strip").show(ui, |ui| self.lesson.strip(ui));
            if self.practice.is_replay() {
                egui::Panel::top("replay bar").show(ui, |ui| self.after.bar(ui, &self.practice));
            }
            egui::CentralPanel::no_frame().show(ui, |ui| {
                self.area = ui.available_rect_before_wrap();
                // No stop of the Tab key: its keys lead the needle.
                let response = ui.allocate_rect(self.area, egui::Sense::CLICK | egui::Sense::DRAG);
                look(&response, ui, &mut self.camera, &mut self.desk, (self.practice.tool_place(), &mut self.grip));
                self.write_over(&ui.painter_at(over(self.area)));
            });
        });
        stage.help.open |= help;
        stage.stale |= turned || help || self.after.moves();
        if wishes.recut {
            self.cut(stage);
        }
        // Pictures without panels draw it again, over the tissue.
        let clip = over(self.area);
        self.overlay = panels.triangles.iter().filter(|shape| shape.clip_rect == clip).cloned().collect();
        if part {
            panels.triangles.retain(|shape| shape.clip_rect.right() > self.area.left());
        }
        panels
    }

    /// What is written over the view.
    fn write_over(&self, painter: &egui::Painter) {
        // In a view as small as that of a card it would cover the tissue.
        if self.area.width() < LEAST_WRITTEN_OVER {
            return;
        }
        let scene = self.practice.scene();
        let overlay = Overlay { painter, area: self.area, camera: &self.camera };
        overlay.ruler();
        overlay.axes(scene.case.as_ref().map(|case| &case.frame));
        if self.choices.look.natural && self.choices.look.names {
            overlay.names(self.view.anchors());
        }
    }

    /// Draws the tissue on the canvas, and the panels where they were asked.
    pub(super) fn draw(
        &mut self,
        stage: &mut Stage,
        encoder: &mut wgpu::CommandEncoder,
        panels: Option<Panels>,
    ) -> Result<()> {
        // A path that was laid anew, or a shorter step, may have taken another engine.
        let engines = self.practice.simulation.replaced_engines();
        if std::mem::replace(&mut self.engines, engines) != engines {
            self.take_buffers(stage)?;
        }
        let place = self.place_tool(stage);
        // Stress is computed where it is looked at.
        let fields = self.shows_fields();
        self.practice.simulation.show(fields)?;
        self.view.needle = self.practice.simulation.show_needle(self.practice.records.last());
        if fields && let Some(engine) = self.practice.simulation.on_device() {
            engine.encode_fields(encoder);
        }
        let (size, view) = (stage.canvas.size(), stage.canvas.create_view(&Default::default()));
        let pixels = Area {
            x: self.area.left() * stage.scale,
            y: self.area.top() * stage.scale,
            width: self.area.width() * stage.scale,
            height: self.area.height() * stage.scale,
        };
        let look = &self.choices.look;
        if !self.after.covers() {
            self.view.draw(&stage.gpu, encoder, (&view, size), pixels, (&self.camera, &self.choices.scale, look));
        }
        let Some(panels) = panels else {
            if !self.overlay.is_empty() && !self.after.covers() {
                stage.paint_again(encoder, self.overlay.clone());
            }
            return Ok(());
        };
        let probe = (&look.probe, place.as_ref());
        self.scan.draw(&stage.gpu, &mut stage.painter, encoder, &mut self.practice, probe)?;
        stage.paint(encoder, panels, wgpu::LoadOp::Load);
        Ok(())
    }

    /// True where the view shows a field of the tissue: in natural colours it does not, where there are any.
    pub(super) fn shows_fields(&self) -> bool {
        !(self.choices.look.natural && self.view.has_natural())
    }

    /// Puts tool, targets and the frame of the slice to their places; the tool's place is returned.
    fn place_tool(&mut self, stage: &Stage) -> Option<ToolPlace> {
        let (scene, look) = (self.practice.scene(), &self.choices.look);
        let last = self.practice.records.last();
        let line = self.practice.simulation.centre_line();
        let core = last.and_then(|r| r.core).map_or(0.0, |core| core.length);
        let place = self.practice.tool_place().map(|(tip, direction)| ToolPlace { tip, direction, line, core });
        let mut corners = scan::frame(&look.probe, scene, &self.practice.simulation.model.mesh);
        if let Some((tool, place)) = scene.tool.as_ref().zip(place.as_ref()) {
            corners.extend(tool_shape::triangles(tool, place));
        }
        let outside = last.is_none_or(|record| record.tip_coordinate == 0.0);
        if look.targets && outside && scene.task.is_some() {
            corners.extend(marks::planned_entry(&self.practice.simulation.model));
        }
        for (n, target) in scene.targets.iter().enumerate().filter(|_| look.targets) {
            let moved = last.and_then(|r| r.targets.get(n)).map_or(DVec3::ZERO, |t| t.displacement);
            corners.extend(marks::target(target.position + moved, target.radius));
        }
        self.view.place_tool(&stage.gpu, &corners);
        place
    }

    /// Draws the canvas once more.
    ///
    /// # Errors
    /// `Error::Device`.
    pub(super) fn redraw(&mut self, stage: &mut Stage, settings: &mut Settings) -> Result<()> {
        let panels = self.run_panels(stage, settings, &mut Wishes::default());
        let mut encoder = stage.gpu.device.create_command_encoder(&Default::default());
        self.draw(stage, &mut encoder, Some(panels))?;
        stage.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}
