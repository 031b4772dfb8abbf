//! How things are shown: colours of the scale, tissue that is seen through, targets, the ultrasound slice, size of the texts.

use super::probe::Probe;
use super::texts;

/// Smallest and largest size of the texts, against that of the desktop.
const ZOOM: std::ops::RangeInclusive<f32> = 0.6..=2.5;

/// Perceptually uniform colours from dark to bright, whose order the colour-blind see too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColourMap {
    #[default]
    Viridis,
    /// The same to the eye with and without colour-blindness.
    Cividis,
    Magma,
}

impl ColourMap {
    pub const ALL: [ColourMap; 3] = [ColourMap::Viridis, ColourMap::Cividis, ColourMap::Magma];

    pub fn name(self) -> &'static str {
        match self {
            ColourMap::Viridis => "viridis",
            ColourMap::Cividis => "cividis",
            ColourMap::Magma => "magma",
        }
    }

    /// The colour at 0..1 as bytes (sRGB).
    pub fn colour(self, at: f64) -> [u8; 3] {
        let gradient = match self {
            ColourMap::Viridis => colorous::VIRIDIS,
            ColourMap::Cividis => colorous::CIVIDIS,
            ColourMap::Magma => colorous::MAGMA,
        };
        let c = gradient.eval_continuous(at.clamp(0.0, 1.0));
        [c.r, c.g, c.b]
    }
}

/// What the user has chosen of all that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    pub map: ColourMap,
    /// How much of the tissue's surface is drawn, 0..1; the faces of a cut stay whole.
    pub opacity: f32,
    pub targets: bool,
    pub probe: Probe,
    /// Size of the texts while its slider is held.
    zoom: Option<f32>,
}

impl Default for Look {
    fn default() -> Self {
        Look { map: ColourMap::default(), opacity: 1.0, targets: true, probe: Probe::default(), zoom: None }
    }
}

/// The choices on the left. `targets`: the scene has some.
pub fn controls(ui: &mut egui::Ui, look: &mut Look, targets: bool) {
    egui::ComboBox::from_label(texts::COLOURS).selected_text(look.map.name()).show_ui(ui, |ui| {
        for map in ColourMap::ALL {
            ui.selectable_value(&mut look.map, map, map.name());
        }
    });
    ui.add(egui::Slider::new(&mut look.opacity, 0.0..=1.0).text(texts::OPACITY));
    if targets {
        ui.checkbox(&mut look.targets, texts::TARGETS);
    }
    ui.checkbox(&mut look.probe.on, texts::ULTRASOUND);
    // A slider that changes its own size under the mouse runs away: it counts when it is let go.
    let mut zoom = look.zoom.unwrap_or(ui.ctx().zoom_factor());
    let slider = ui.add(egui::Slider::new(&mut zoom, ZOOM).step_by(0.05).text(texts::ZOOM));
    look.zoom = slider.dragged().then_some(zoom);
    if (slider.changed() && !slider.dragged()) || slider.drag_stopped() {
        ui.ctx().set_zoom_factor(zoom);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lightness grows along every map, so that it is read without its hues.
    #[test]
    fn the_maps_grow_brighter_from_end_to_end() {
        let linear = |byte: u8| (f64::from(byte) / 255.0).powf(2.2);
        for map in ColourMap::ALL {
            let light = |n: i32| {
                let [r, g, b] = map.colour(f64::from(n) / 20.0);
                0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
            };
            assert!((0..20).all(|n| light(n + 1) > light(n)), "{}", map.name());
        }
    }
}
