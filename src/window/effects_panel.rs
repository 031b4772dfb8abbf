//! Effects with a switch each, and a slider for every number of those that are on.

use super::tuning::{Pace, Tuning};
use crate::effects::parameter::{COUNT, Parameter};
use crate::effects::{EFFECTS, Effect, switched};
use crate::scene::Scene;
use crate::simulation::change::Reach;
use crate::words::say;

/// Width of a slider, in points.
const SLIDER: f32 = 96.0;

/// Draws the switches and sliders of `scene`, which runs; what the user wants goes to `tuning`.
pub fn effects(ui: &mut egui::Ui, scene: &Scene, tuning: &mut Tuning) {
    ui.spacing_mut().slider_width = SLIDER;
    let on = scene.effects.keys();
    let mut wishes = Vec::new();
    // A switch shows what runs; until a change has come there is no other to make.
    ui.add_enabled_ui(!tuning.is_busy(), |ui| {
        for effect in &EFFECTS {
            let was = on.contains(&effect.key);
            let mut is = was;
            ui.checkbox(&mut is, effect.key.replace('_', " ")).on_hover_text(told(effect));
            if is != was {
                wishes.push(switched(&on, effect.key, is));
            }
            if was && !effect.parameters.is_empty() {
                egui::CollapsingHeader::new(say("numbers")).id_salt(effect.key).show(ui, |ui| {
                    for parameter in effect.parameters {
                        sliders(ui, scene, parameter, &mut wishes);
                    }
                });
            }
        }
    });
    if !wishes.is_empty() {
        tuning.wish(&wishes);
    }
    if let Some(refusal) = &tuning.refusal {
        ui.colored_label(ui.visuals().error_fg_color, refusal);
    }
    ui.small(match (tuning.is_busy(), tuning.paces.last()) {
        (true, _) => say("changing").into(),
        (false, Some(pace)) => paced(*pace),
        (false, None) => say("unchanged").to_string(),
    });
}

/// Saves the scene that runs under a name, and goes back to the one that was opened.
pub fn saving(ui: &mut egui::Ui, tuning: &mut Tuning, name: &mut String) {
    if name.is_empty() {
        *name = tuning.source.path.with_extension("tuned.toml").display().to_string();
    }
    ui.add(egui::TextEdit::singleline(name).hint_text(say("save-scene")).desired_width(f32::INFINITY));
    ui.horizontal(|ui| {
        if ui.button(say("save-scene")).clicked() {
            tuning.save(std::path::Path::new(name.as_str()));
        }
        if ui.add_enabled(tuning.is_changed() && !tuning.is_busy(), egui::Button::new(say("as-in-file"))).clicked() {
            tuning.go_back();
        }
    });
    if let Some(saved) = &tuning.saved {
        ui.small(format!("{} {}", say("saved"), saved.display()));
    }
}

/// One slider per component.
fn sliders(ui: &mut egui::Ui, scene: &Scene, parameter: &Parameter, wishes: &mut Vec<String>) {
    let [low, high] = parameter.range;
    for (index, value) in parameter.values(&scene.numbers()).into_iter().enumerate() {
        let mut wanted = value;
        let unit = if parameter.unit == "-" { String::new() } else { format!(" {}", parameter.unit) };
        let slider = egui::Slider::new(&mut wanted, low..=high)
            .logarithmic(parameter.logarithmic)
            .clamping(egui::SliderClamping::Never)
            .max_decimals(4)
            .suffix(unit);
        let slider = if parameter.unit == COUNT { slider.integer() } else { slider };
        let name = ui.small(parameter.name).id;
        if ui.add(slider).labelled_by(name).on_hover_text(format!("{}\n{}", parameter.key, parameter.source)).changed()
        {
            wishes.extend(parameter.overrides(&scene.numbers(), index, wanted));
        }
    }
}

fn told(effect: &Effect) -> String {
    format!("{}\n{}\n{}", effect.summary, effect.source, effect.cost)
}

fn paced(pace: Pace) -> String {
    let what = match pace.reach {
        Reach::Constants => say("changed-numbers"),
        Reach::Kernels => say("changed-effects"),
        Reach::Start => say("changed-start"),
    };
    format!(
        "{what} {:.0} ms ({} {:.0} ms)",
        1e3 * pace.whole.as_secs_f64(),
        say("halted"),
        1e3 * pace.halted.as_secs_f64()
    )
}
