//! The keys of the present screen, by topic: F1 opens and closes them, so does Esc.

use egui::{Key, Modal};

use crate::words::say;

/// A topic: key of its title, then pairs of what is pressed and what it does, as keys of words.
pub type Topic = (&'static str, &'static [(&'static str, &'static str)]);

/// Topics by screen; a line `x` has its texts under `help-x-keys` and `help-x`.
pub const EVERYWHERE: Topic = (
    "help-everywhere",
    &[
        ("help-f1-keys", "help-f1"),
        ("help-tab-keys", "help-tab"),
        ("help-enter-keys", "help-enter"),
        ("help-quit-keys", "help-quit"),
    ],
);
pub const START: Topic = ("help-start", &[("help-task-keys", "help-task"), ("help-drop-keys", "help-drop")]);
pub const NEEDLE: Topic = (
    "help-needle",
    &[
        ("help-advance-keys", "help-advance"),
        ("help-mouse-keys", "help-mouse"),
        ("help-wheel-keys", "help-wheel"),
        ("help-tilt-keys", "help-tilt"),
        ("help-entry-keys", "help-entry"),
    ],
);
pub const RUN: Topic = (
    "help-run",
    &[
        ("help-space-keys", "help-space"),
        ("help-again-keys", "help-again"),
        ("help-finish-keys", "help-finish"),
        ("help-leave-keys", "help-leave"),
    ],
);
/// Behind an attempt.
pub const AFTER: Topic = (
    "help-after",
    &[
        ("help-again-keys", "help-again"),
        ("help-next-keys", "help-next"),
        ("help-leave-keys", "help-leave"),
        ("help-attempt-keys", "help-attempt"),
    ],
);
pub const VIEW: Topic = (
    "help-view",
    &[
        ("help-turn-keys", "help-turn"),
        ("help-shift-keys", "help-shift"),
        ("help-zoom-keys", "help-zoom"),
        ("help-fold-keys", "help-fold"),
        ("help-free-keys", "help-free"),
    ],
);

/// Whether the keys are shown.
#[derive(Debug, Default)]
pub struct Help {
    pub open: bool,
}

impl Help {
    /// Draws them over the screen where they are open.
    pub fn show(&mut self, context: &egui::Context, topics: &[Topic]) {
        if context.input(|input| input.key_pressed(Key::F1)) {
            self.open = !self.open;
        }
        if !self.open {
            return;
        }
        let room = context.content_rect().size();
        let modal = Modal::new(egui::Id::unique("help")).show(context, |ui| {
            ui.set_width((0.8 * room.x).min(620.0));
            ui.heading(say("help"));
            egui::ScrollArea::vertical().max_height((room.y - 120.0).max(120.0)).show(ui, |ui| {
                // No widget in it takes the keyboard.
                let down = |key| ui.input(|input| if input.key_pressed(key) { 48.0 } else { 0.0 });
                ui.scroll_with_delta(egui::vec2(0.0, down(Key::ArrowUp) - down(Key::ArrowDown)));
                // Beside the bar.
                ui.set_max_width(ui.available_width() - 16.0);
                for (title, lines) in topics {
                    ui.add_space(6.0);
                    ui.strong(say(title));
                    egui::Grid::new(title)
                        .num_columns(2)
                        .striped(true)
                        .max_col_width(0.48 * ui.available_width())
                        .show(ui, |ui| {
                            for (keys, what) in *lines {
                                ui.add(egui::Label::new(egui::RichText::new(say(keys)).monospace()).wrap());
                                ui.add(egui::Label::new(say(what)).wrap());
                                ui.end_row();
                            }
                        });
                }
            });
            ui.add_space(6.0);
            ui.button(say("help-close")).clicked()
        });
        if modal.inner || modal.should_close() {
            self.open = false;
        }
    }
}
