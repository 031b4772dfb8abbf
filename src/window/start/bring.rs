//! What is brought into the window by a path or by drag and drop: a scene is opened, of a volume or a surface is told what it holds, and a
//! scene is made from it along a line from skin to target, as `stylet import` does.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

use crate::commands::import::{self, ImportArgs};
use crate::scene::needles;
use crate::words::say;
use crate::{Error, Result};

/// Gauge that a needle begins with.
const GAUGE: &str = "18G";

/// A file of a patient that was brought.
pub struct Brought {
    file: PathBuf,
    reading: Option<Receiver<Result<String>>>,
    /// What the file holds, once it is read.
    content: Option<String>,
    making: Option<Receiver<Result<PathBuf>>>,
    refusal: Option<String>,
    entry: String,
    target: String,
    gauge: String,
    /// Where the scene is written.
    scene: String,
}

/// True for the path of a scene; everything else is a file of a patient.
pub fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("toml"))
}

/// Has a thread do something that takes its time.
fn beside<T: Send + 'static>(work: impl FnOnce() -> Result<T> + Send + 'static) -> Receiver<Result<T>> {
    let (sender, done) = channel();
    std::thread::spawn(move || {
        // Nobody waits any more where the screen was left.
        let _ = sender.send(work());
    });
    done
}

/// What a thread has done; `None` while it works, or where there is none.
fn taken<T>(work: &mut Option<Receiver<Result<T>>>) -> Option<Result<T>> {
    let done = match work.as_ref()?.try_recv() {
        Err(TryRecvError::Empty) => return None,
        Err(TryRecvError::Disconnected) => Err(Error::Device("the file could not be worked on".into())),
        Ok(done) => done,
    };
    *work = None;
    Some(done)
}

impl Brought {
    pub fn new(file: PathBuf) -> Self {
        let read = file.clone();
        Brought {
            reading: Some(beside(move || import::told(&read))),
            content: None,
            making: None,
            refusal: None,
            entry: String::new(),
            target: String::new(),
            gauge: GAUGE.into(),
            scene: file.with_extension("toml").display().to_string(),
            file,
        }
    }

    /// Draws it; the scene that was made, once it is, and true where it is left.
    pub fn show(&mut self, ui: &mut egui::Ui) -> (Option<PathBuf>, bool) {
        let (mut made, mut left) = (None, false);
        match taken(&mut self.reading) {
            Some(Ok(content)) => self.content = Some(content),
            Some(Err(error)) => self.refusal = Some(error.to_string()),
            None => {}
        }
        match taken(&mut self.making) {
            Some(Ok(path)) => made = Some(path),
            Some(Err(error)) => self.refusal = Some(error.to_string()),
            None => {}
        }
        ui.group(|ui| {
            ui.horizontal_wrapped(|ui| {
                ui.strong(self.file.display().to_string());
                left = ui.button(say("start-cancel")).clicked();
            });
            if let Some(content) = &self.content {
                let area = egui::ScrollArea::both().max_height(180.0).id_salt("bring");
                area.show(ui, |ui| ui.monospace(content.trim_end()));
            }
            if self.reading.is_some() || self.making.is_some() {
                ui.label(say("bring-working"));
                ui.ctx().request_repaint_after_secs(0.2);
            } else if self.content.is_some() {
                self.line(ui);
            }
            if let Some(refusal) = &self.refusal {
                ui.colored_label(ui.visuals().error_fg_color, refusal);
            }
        });
        (made, left)
    }

    /// The line of the needle, and the button that makes the scene.
    fn line(&mut self, ui: &mut egui::Ui) {
        ui.label(say("bring-line"));
        egui::Grid::new("bring-line").num_columns(2).show(ui, |ui| {
            for (name, value) in [
                (say("bring-entry"), &mut self.entry),
                (say("bring-target"), &mut self.target),
                (say("bring-scene"), &mut self.scene),
            ] {
                let label = ui.label(name).id;
                ui.text_edit_singleline(value).labelled_by(label);
                ui.end_row();
            }
            let label = ui.label(say("bring-needle")).id;
            let list = egui::ComboBox::from_id_salt("gauge").selected_text(self.gauge.clone()).show_ui(ui, |ui| {
                for needle in needles::needles() {
                    ui.selectable_value(&mut self.gauge, needle.gauge.clone(), &needle.gauge);
                }
            });
            list.response.labelled_by(label);
            ui.end_row();
        });
        let ready = [&self.entry, &self.target, &self.scene].iter().all(|text| !text.trim().is_empty());
        if ui.add_enabled(ready, egui::Button::new(say("bring-make"))).clicked() {
            let path = PathBuf::from(self.scene.trim());
            let args = ImportArgs {
                file: self.file.clone(),
                entry: Some(self.entry.trim().into()),
                target: Some(self.target.trim().into()),
                gauge: self.gauge.clone(),
                unit: "mm".into(),
                scene: Some(path.clone()),
                ..ImportArgs::default()
            };
            self.refusal = None;
            self.making = Some(beside(move || import::execute(&args, Instant::now()).map(|_| path)));
        }
    }
}
