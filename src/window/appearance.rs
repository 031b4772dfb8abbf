//! How things are shown: colours of the scale, tissue that is seen through, targets, the ultrasound slice.

use super::probe::Probe;
use super::slider::named;
use crate::training::scene_words;
use crate::words::say;

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
    /// Bit i: the tissue of material number i is seen through.
    pub through: u32,
    /// How much of such tissue is drawn, 0..1.
    pub veil: f32,
    pub targets: bool,
    /// Parts in natural colours where the scene has labels, else a field.
    pub natural: bool,
    /// Their names in the view.
    pub names: bool,
    /// How much of the skin is drawn over them, 0..1.
    pub skin: f32,
    pub probe: Probe,
}

impl Default for Look {
    fn default() -> Self {
        Look {
            map: ColourMap::default(),
            opacity: 1.0,
            through: 0,
            veil: 0.25,
            targets: true,
            natural: true,
            names: true,
            skin: 0.4,
            probe: Probe::default(),
        }
    }
}

/// What else is shown. `targets`: the scene has some.
pub fn controls(ui: &mut egui::Ui, look: &mut Look, targets: bool) {
    if targets {
        ui.checkbox(&mut look.targets, say("targets"));
    }
    ui.checkbox(&mut look.probe.on, say("ultrasound"));
}

/// Colours of a field, and how much of the surface that has them is drawn.
pub fn colours(ui: &mut egui::Ui, look: &mut Look) {
    egui::ComboBox::from_label(say("colours")).width(80.0).selected_text(look.map.name()).show_ui(ui, |ui| {
        for map in ColourMap::ALL {
            ui.selectable_value(&mut look.map, map, map.name());
        }
    });
    named(ui, egui::Slider::new(&mut look.opacity, 0.0..=1.0), say("opacity"));
}

/// Whether parts are shown in natural colours, with their names, or a field; `parts`: names and colours, empty without labels.
pub fn parts(ui: &mut egui::Ui, look: &mut Look, parts: &[(String, [u8; 3])]) {
    if parts.is_empty() {
        return;
    }
    ui.horizontal_wrapped(|ui| {
        for (natural, name) in [(true, say("natural")), (false, say("field-colours"))] {
            ui.radio_value(&mut look.natural, natural, name);
        }
    });
    if look.natural {
        named(ui, egui::Slider::new(&mut look.skin, 0.0..=1.0), say("skin-shown"));
        ui.checkbox(&mut look.names, say("part-names"));
        ui.vertical(|ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            for (name, [r, g, b]) in parts {
                let colour = egui::Color32::from_rgb(*r, *g, *b);
                ui.horizontal(|ui| {
                    let (square, _) = ui.allocate_exact_size(egui::Vec2::splat(11.0), egui::Sense::hover());
                    ui.painter().rect_filled(square, 1.0, colour);
                    ui.small(scene_words::name(name));
                });
            }
        });
    }
}

/// Which layers are seen through; `names` by number of the material. True where that has changed.
pub fn layers<'a>(ui: &mut egui::Ui, look: &mut Look, names: impl Iterator<Item = &'a str>) -> bool {
    let before = look.through;
    egui::CollapsingHeader::new(say("layers")).show(ui, |ui| {
        for (number, name) in names.enumerate() {
            let mut through = look.through >> number & 1 == 1;
            if ui.checkbox(&mut through, name).changed() {
                look.through ^= 1 << number;
            }
        }
        named(ui, egui::Slider::new(&mut look.veil, 0.0..=1.0), say("veil"));
    });
    look.through != before
}

#[cfg(test)]
mod tests {
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    use super::*;

    #[test]
    fn a_layer_is_seen_through_and_solid_again() {
        let draw = |ui: &mut egui::Ui, (look, changed): &mut (Look, bool)| {
            *changed |= layers(ui, look, ["all the rest", "skin", "fat"].into_iter());
        };
        let mut harness = Harness::new_ui_state(draw, (Look::default(), false));
        harness.get_by_label(say("layers")).click();
        harness.run_steps(12);
        for (name, through) in [("fat", 0b100), ("all the rest", 0b101), ("fat", 0b001)] {
            harness.state_mut().1 = false;
            harness.get_by_label(name).click();
            harness.run_steps(2);
            assert_eq!((harness.state().0.through, harness.state().1), (through, true), "{name}");
        }
        harness.state_mut().1 = false;
        harness.run_steps(2);
        assert!(!harness.state().1, "nothing was clicked");
    }

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
