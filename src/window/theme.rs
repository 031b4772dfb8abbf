//! Dark and light: the looks of the panels, and colours that are read on both, by the colour-blind too (after Okabe and Ito 2008).

use egui::{Color32, Stroke, Visuals};

use super::settings::{Settings, Theme};

/// Least contrast of a line or a sign against what lies behind it: WCAG 2.2, success criterion 1.4.11.
const CONTRAST: f64 = 3.0;
/// Least contrast of a text: criterion 1.4.3.
const TEXT_CONTRAST: f64 = 4.5;

/// Size of the smallest texts [points].
const SMALL: f32 = 11.0;

/// What a colour says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tint {
    Good,
    Caution,
    Bad,
    /// The curve that matters.
    Main,
    /// What it is compared with.
    Beside,
    /// The keyboard is here.
    Focus,
}

impl Tint {
    fn plain(self, dark: bool) -> Color32 {
        match self {
            Tint::Good | Tint::Focus => Color32::from_rgb(86, 180, 233),
            Tint::Caution => Color32::from_rgb(230, 159, 0),
            Tint::Bad => Color32::from_rgb(213, 94, 0),
            Tint::Main if dark => Color32::WHITE,
            Tint::Main => Color32::BLACK,
            Tint::Beside => Color32::GRAY,
        }
    }

    /// As bytes, as it is on panels of this theme before its contrast is looked at.
    pub fn bytes(self, ui: &egui::Ui) -> [u8; 3] {
        let [r, g, b, _] = self.plain(ui.visuals().dark_mode).to_array();
        [r, g, b]
    }

    /// The colour on the panels as they are now.
    pub fn of(self, ui: &egui::Ui) -> Color32 {
        let visuals = ui.visuals();
        let least = if self == Tint::Beside { CONTRAST } else { TEXT_CONTRAST };
        legible(self.plain(visuals.dark_mode), visuals.panel_fill, least)
    }
}

/// A colour for a line on the panels.
pub fn line(ui: &egui::Ui, [r, g, b]: [u8; 3]) -> Color32 {
    legible(Color32::from_rgb(r, g, b), ui.visuals().extreme_bg_color, CONTRAST)
}

/// Relative luminance: WCAG 2.2.
fn luminance(colour: Color32) -> f64 {
    let linear = |byte: u8| {
        let s = f64::from(byte) / 255.0;
        if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
    };
    0.2126 * linear(colour.r()) + 0.7152 * linear(colour.g()) + 0.0722 * linear(colour.b())
}

fn contrast(a: Color32, b: Color32) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// The colour, darker or lighter until it has this contrast against the background; its hue stays.
fn legible(colour: Color32, background: Color32, least: f64) -> Color32 {
    let end = if luminance(background) < 0.18 { Color32::WHITE } else { Color32::BLACK };
    let steps = (0..=20).map(|n| colour.lerp_to_gamma(end, n as f32 / 20.0));
    steps.into_iter().find(|c| contrast(*c, background) >= least).unwrap_or(end)
}

/// Takes the theme as it is chosen.
pub fn apply(context: &egui::Context, settings: &Settings) {
    let wanted = match settings.theme {
        Theme::System => egui::ThemePreference::System,
        Theme::Dark => egui::ThemePreference::Dark,
        Theme::Light => egui::ThemePreference::Light,
    };
    if context.options(|options| options.theme_preference) != wanted {
        context.set_theme(wanted);
    }
}

/// Sets up both themes; once.
pub fn set_up(context: &egui::Context) {
    for (theme, visuals) in [(egui::Theme::Dark, Visuals::dark()), (egui::Theme::Light, Visuals::light())] {
        let focus = legible(Tint::Focus.plain(visuals.dark_mode), visuals.panel_fill, CONTRAST);
        let text = if visuals.dark_mode { Color32::from_gray(215) } else { Color32::from_gray(30) };
        context.style_mut_of(theme, |style| {
            style.visuals = visuals.clone();
            style.text_styles.insert(egui::TextStyle::Small, egui::FontId::proportional(SMALL));
            // The widget that has the keyboard is seen from afar.
            style.visuals.widgets.active.bg_stroke = Stroke::new(2.0, focus);
            style.visuals.widgets.noninteractive.fg_stroke.color = text;
            style.visuals.widgets.inactive.fg_stroke.color = text;
            style.visuals.hyperlink_color = legible(visuals.hyperlink_color, visuals.panel_fill, TEXT_CONTRAST);
            style.visuals.error_fg_color = legible(Tint::Bad.plain(true), visuals.panel_fill, TEXT_CONTRAST);
            style.visuals.warn_fg_color = legible(Tint::Caution.plain(true), visuals.panel_fill, TEXT_CONTRAST);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_on_white_has_the_contrast_of_the_standard() {
        assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-9);
        assert!((contrast(Color32::from_gray(119), Color32::WHITE) - 4.48).abs() < 0.01, "#777777");
    }

    #[test]
    fn every_tint_and_every_part_of_the_force_is_read_on_dark_and_light() {
        for visuals in [Visuals::dark(), Visuals::light()] {
            for tint in [Tint::Good, Tint::Caution, Tint::Bad, Tint::Main, Tint::Beside, Tint::Focus] {
                let colour = legible(tint.plain(visuals.dark_mode), visuals.panel_fill, TEXT_CONTRAST);
                assert!(contrast(colour, visuals.panel_fill) >= TEXT_CONTRAST, "{tint:?}");
            }
            for part in &crate::observables::ForceParts::PARTS {
                let [r, g, b] = part.colour;
                let colour = legible(Color32::from_rgb(r, g, b), visuals.extreme_bg_color, CONTRAST);
                assert!(contrast(colour, visuals.extreme_bg_color) >= CONTRAST, "{}", part.name);
            }
        }
    }
}
