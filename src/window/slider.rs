//! A slider with its name behind it, which goes on in the next line where a narrow panel has no room.

use egui::{Response, Slider, Ui};

/// Draws it; its name is that of screen readers too.
pub fn named(ui: &mut Ui, slider: Slider<'_>, name: &str) -> Response {
    let drawn = ui.horizontal_wrapped(|ui| {
        let slider = ui.add(slider);
        let label = ui.label(name).id;
        slider.labelled_by(label)
    });
    drawn.inner
}
