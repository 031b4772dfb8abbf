//! Language, light or dark, size of texts, sound: the menu of what is chosen for good.

use super::settings::{Settings, TEXT_SIZES, Theme};
use crate::words::{LANGUAGES, language, say, say_with};

/// Sizes of texts that are offered [%].
const SIZES: [u32; 8] = [80, 90, 100, 115, 130, 150, 175, 200];

/// A button that opens the menu.
pub fn menu(ui: &mut egui::Ui, settings: &mut Settings) {
    ui.menu_button(say("settings"), |ui| {
        ui.strong(say("language"));
        for other in &LANGUAGES {
            if ui.radio(language().code == other.code, other.name).clicked() {
                settings.language = Some(other.code.into());
                settings.speak();
            }
        }
        ui.separator();
        ui.strong(say("settings-theme"));
        for (theme, name) in [
            (Theme::System, say("settings-system")),
            (Theme::Dark, say("settings-dark")),
            (Theme::Light, say("settings-light")),
        ] {
            ui.radio_value(&mut settings.theme, theme, name);
        }
        ui.separator();
        ui.strong(say("settings-text-size"));
        ui.horizontal_wrapped(|ui| {
            ui.set_max_width(180.0);
            for size in SIZES {
                let value = size as f32 * 0.01;
                debug_assert!(TEXT_SIZES.contains(&value));
                let chosen = (ui.ctx().zoom_factor() - value).abs() < 1e-3;
                if ui.selectable_label(chosen, say_with("settings-percent", &[("n", size.into())])).clicked() {
                    settings.text_size = Some(value);
                }
            }
        });
        ui.separator();
        ui.checkbox(&mut settings.sound, say("settings-sound"));
    });
}
