//! The panels without a window: every switch and slider is found, and says to the run what it shows.
#![cfg(feature = "window")]

use std::path::Path;

use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use stylet::effects::EFFECTS;
use stylet::scene::Scene;
use stylet::simulation::{Purpose, Simulation};
use stylet::window::accuracy::Accuracy;
use stylet::window::effects_panel;
use stylet::window::practice::Timing;
use stylet::window::source::Source;
use stylet::window::tuning::{Taken, Tuning};

use crate::common;
use crate::layout::english;

struct Panel {
    scene: Scene,
    tuning: Tuning,
    accuracy: Accuracy,
    name: String,
}

/// Not every effect goes with an opened path.
const RING: &str = "puncture.scheme=\"ring\"";

fn panel(overrides: &[&str]) -> Panel {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/hit_target.toml");
    let overrides = overrides.iter().map(|s| s.to_string()).collect();
    let (source, scene) = Source::read(path, overrides).unwrap_or_else(|e| panic!("{e}"));
    Panel { accuracy: Accuracy::new(&scene), tuning: Tuning::new(source), scene, name: String::new() }
}

/// The panel as the window draws it, with all its sliders open.
fn harness(panel: Panel) -> Harness<'static, Panel> {
    let mut harness = Harness::builder().with_size([400.0, 3000.0]).build_ui_state(
        |ui, panel: &mut Panel| {
            effects_panel::effects(ui, &panel.scene, &mut panel.tuning);
            effects_panel::saving(ui, &mut panel.tuning, &mut panel.name);
        },
        panel,
    );
    harness.run_steps(2);
    // From below: what opens shifts only what lies under it.
    for index in (0..harness.get_all_by_label("numbers").count()).rev() {
        harness.get_all_by_label("numbers").nth(index).expect("a header").click();
        harness.run_steps(12);
    }
    harness
}

#[test]
fn every_effect_has_a_switch_and_every_number_a_slider() {
    let _english = english();
    const EVERYTHING: &str = r#"effects=["mass_scaling", "gravity", "plasticity", "fibres", "viscoelastic", "damage", "puncture", "adhesion", "friction", "flexible_needle"]"#;
    let panel = panel(&[EVERYTHING, "damage.failure_displacement_mm=0.6", RING, "puncture.path=\"auto\""]);
    let scene = panel.scene.clone();
    let harness = harness(panel);
    let mut sliders = 0;
    for effect in &EFFECTS {
        assert!(harness.query_by_label(&effect.key.replace('_', " ")).is_some(), "no switch for {}", effect.key);
        for parameter in effect.parameters {
            let count = parameter.values(&scene.numbers()).len();
            assert!(
                harness.query_all_by_label(parameter.name).count() >= count,
                "no slider for each of {} numbers of {}",
                count,
                parameter.key
            );
            sliders += count;
        }
    }
    assert!(sliders > 30, "{sliders}");
}

#[test]
fn a_switch_asks_for_its_effect_and_a_slider_for_its_number() {
    let _english = english();
    let mut harness = harness(panel(&[]));
    harness.get_by_label("gravity").click();
    harness.run_steps(3);
    let asked = &harness.state().tuning.coming().overrides;
    assert_eq!(asked, &[r#"effects=["mass_scaling", "gravity", "puncture", "friction"]"#.to_string()]);
    let slider = harness
        .get_all_by_label("friction coefficient")
        .find(|node| node.accesskit_node().role() == egui::accesskit::Role::Slider)
        .expect("a slider with the name of its number");
    slider.set_value_accesskit(0.62);
    harness.run_steps(3);
    let asked = harness.state().tuning.coming().overrides.clone();
    assert!(asked.iter().any(|text| text == "friction.coefficient=0.62"), "{asked:?}");
}

/// From the click to the force of a tissue that has it.
#[test]
fn what_was_clicked_runs_in_the_next_frame() {
    let _english = english();
    let Some(gpu) = common::gpu() else { return };
    let coarse = ["tissue.cell_size_mm=1.2", "tissue.size_mm=[14, 14, 12]"];
    let mut harness = harness(panel(&coarse));
    let purpose = Purpose { led: true, drawn: true, lanes: false };
    let scene = harness.state().scene.clone();
    let mut simulation = Simulation::for_purpose(scene, Some(gpu.clone()), purpose).unwrap_or_else(|e| panic!("{e}"));
    let slider = harness
        .get_all_by_label("friction coefficient")
        .find(|node| node.accesskit_node().role() == egui::accesskit::Role::Slider)
        .expect("a slider");
    slider.set_value_accesskit(0.8);
    harness.run_steps(3);
    let taken = harness.state_mut().tuning.take(&mut simulation, &gpu, purpose).unwrap_or_else(|e| panic!("{e}"));
    assert!(matches!(taken, Taken::Constants), "no other engine is needed");
    assert_eq!(simulation.model.effects.friction.map(|f| f.coefficient), Some(0.8));
    // An effect is made ready beside the run.
    harness.get_by_label("gravity").click();
    harness.run_steps(3);
    let begin = std::time::Instant::now();
    loop {
        match harness.state_mut().tuning.take(&mut simulation, &gpu, purpose).unwrap_or_else(|e| panic!("{e}")) {
            Taken::Engine => break,
            Taken::Nothing => std::thread::sleep(std::time::Duration::from_millis(5)),
            _ => panic!("an effect is another engine"),
        }
        assert!(begin.elapsed().as_secs() < 60, "the change never came");
    }
    assert!(simulation.model.effects.gravity.is_some());
    println!("the effect came after {:.0} ms", begin.elapsed().as_secs_f64() * 1e3);
    // What cannot be is said, and the run goes on as it was.
    harness.state_mut().tuning.wish(&["friction.coefficient=-1".to_string()]);
    let taken = harness.state_mut().tuning.take(&mut simulation, &gpu, purpose).unwrap_or_else(|e| panic!("{e}"));
    assert!(matches!(taken, Taken::Nothing));
    harness.run_steps(3);
    let refusal = harness.state().tuning.refusal.clone().expect("a refusal");
    assert!(
        refusal.contains("friction.coefficient") && harness.query_by_label_contains("friction.coefficient").is_some()
    );
}

#[test]
fn a_scene_is_saved_as_it_runs_and_never_over_another() {
    let _english = english();
    let folder = tempfile::tempdir().unwrap();
    let mut panel = panel(&["friction.coefficient=0.5"]);
    panel.name = folder.path().join("mine.toml").display().to_string();
    let mut harness = harness(panel);
    harness.get_by_label("save as scene").click();
    harness.run_steps(3);
    let saved = Scene::load(&folder.path().join("mine.toml"), &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(saved.effects.friction.map(|f| f.coefficient), Some(0.5));
    harness.get_by_label("save as scene").click();
    harness.run_steps(3);
    assert!(harness.state().tuning.refusal.as_deref().is_some_and(|text| text.contains("is there already")));
}

#[test]
fn the_price_of_a_finer_mesh_is_told_before_it_is_paid() {
    let _english = english();
    let panel = panel(&["tissue.cell_size_mm=0.68"]);
    let timing = Timing { simulated: 1.0 / 60.0, physics: 0.010, ..Default::default() };
    let mut harness = Harness::builder().with_size([400.0, 600.0]).build_ui_state(
        move |ui, panel: &mut Panel| panel.accuracy.show(ui, &panel.scene, &mut panel.tuning, &timing, (4950, 8)),
        panel,
    );
    harness.run_steps(3);
    let told = |harness: &Harness<Panel>| -> f64 {
        let label = harness.get_by_label_contains("real-time factor");
        let text = label.accesskit_node().label().or(label.value()).expect("a text");
        text.rsplit(' ').next().and_then(|word| word.parse().ok()).expect("a number at its end")
    };
    let as_it_is = told(&harness);
    assert!((as_it_is - 1.67).abs() < 0.1, "10 ms for 16.7 ms: {as_it_is}");
    let slider =
        harness.get_all_by_label("cell edge").find(|n| n.accesskit_node().role() == egui::accesskit::Role::Slider);
    slider.expect("a slider").set_value_accesskit(0.4);
    harness.run_steps(3);
    // 1.5 times finer: more cells, and shorter steps.
    assert!(told(&harness) < 0.6 * as_it_is, "{}", told(&harness));
    harness.get_by_label("apply (begins anew)").click();
    harness.run_steps(3);
    assert!(harness.state().tuning.coming().overrides.iter().any(|text| text == "tissue.cell_size_mm=0.4"));
}
