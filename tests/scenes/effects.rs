//! The smallest scene of every effect.

use super::*;

#[test]
fn gravity_is_carried_by_the_base() {
    let mut run = run("effects/gravity.toml", &[], best_engine());
    run.assert_sound();
    let (base, _) = run.reaction(Face::ZMin);
    // The nodes of the base hang on their support directly: their weight does not pass through the tissue.
    let carried: f64 = {
        let held = run.face(Face::ZMin);
        let mass = &run.simulation.model.node_mass;
        9.81 * (mass.iter().sum::<f64>() - held.iter().map(|&n| mass[n]).sum::<f64>())
    };
    assert_near("force of the base [N]", base.z, carried, 0.01);
    let state = run.state();
    let sink = run.face(Face::ZMax).iter().map(|&n| state.displacement[n].z).fold(0.0, f64::min);
    // A free bar under its weight sinks by rho g H^2 / (2 E); the bonded base makes it a little stiffer.
    let law = run.simulation.model.scene.material.law;
    let bar = 1060.0 * 9.81 * 1e-4 / (2.0 * law.youngs_modulus());
    println!("the top sinks by {:.3} um, a free bar by {:.3} um", -sink * 1e6, bar * 1e6);
    assert!((0.6 * bar..1.05 * bar).contains(&-sink), "{sink} m");
}

#[test]
fn mass_scaling_leaves_the_force_and_saves_steps() {
    let mut scaled = run("effects/mass_scaling.toml", &[], best_engine());
    let mut plain = run("effects/mass_scaling.toml", &["effects=[]"], best_engine());
    scaled.assert_sound();
    plain.assert_sound();
    let (a, b) = (scaled.reaction(Face::ZMax).0.z, plain.reaction(Face::ZMax).0.z);
    assert_near("force with scaled mass [N]", a, b, 0.02);
    let saved = plain.simulation.total_steps() as f64 / scaled.simulation.total_steps() as f64;
    println!("mass scaling {}: {saved:.1} times fewer steps", scaled.simulation.model.mass_scaling());
    assert!(saved > 0.8 * scaled.simulation.model.mass_scaling().sqrt());
}

#[test]
fn friction_is_what_it_adds_to_puncture() {
    let smooth = run("effects/puncture.toml", &[], best_engine());
    let rough = run("effects/friction.toml", &[], best_engine());
    println!("{:?}\n{:?}", smooth.figures, rough.figures);
    for run in [&smooth, &rough] {
        run.assert_sound();
        assert!(run.figures.puncture_force.is_some());
    }
    assert!(smooth.records.iter().all(|r| r.force.friction == 0.0));
    assert_eq!(smooth.last().energy.friction, 0.0);
    assert!(rough.last().energy.friction > 0.0);
    let friction = rough.records.iter().rev().take(3).map(|r| r.force.friction).sum::<f64>() / 3.0;
    let added = rough.force_at_depth() - smooth.force_at_depth();
    println!("friction {friction:.4} N, difference of the forces {added:.4} N");
    assert!(friction > 0.0 && added > 0.0);
    // Friction drags tissue along, which changes the other parts too, but not by more than friction itself.
    assert!((added - friction).abs() < friction, "{added} {friction}");
}

#[test]
fn indentation_comes_back_to_zero() {
    let run = run("effects/indentation.toml", &[], best_engine());
    run.assert_sound();
    // Linear between frames, which are 0.17 mm apart.
    let force = |phase: usize, depth: f64| {
        let part: Vec<&FrameRecord> = run.records.iter().filter(|r| r.phase == phase).collect();
        let pair = part.windows(2).find(|w| (w[0].depth - depth) * (w[1].depth - depth) <= 0.0).unwrap();
        let share = (depth - pair[0].depth) / (pair[1].depth - pair[0].depth);
        pair[0].force.axial + share * (pair[1].force.axial - pair[0].force.axial)
    };
    let (half, whole, back) = (force(0, 1e-3), force(0, 1.9e-3), force(1, 1e-3));
    println!("force at 1 mm {half:.4} N, at 1.9 mm {whole:.4} N, at 1 mm on the way back {back:.4} N");
    // Hertz: 1.9^1.5 = 2.62; more on a thin block (10 mm under a sphere of 5 mm).
    assert!((2.4..4.0).contains(&(whole / half)), "{}", whole / half);
    assert!((back / half - 1.0).abs() < 0.15, "elastic: {back} N, {half} N");
    let largest = run.records.iter().map(|r| r.force.axial).fold(0.0, f64::max);
    assert!(run.last().depth < 0.0);
    assert!(run.last().force.axial.abs() < 0.01 * largest, "{} N outside", run.last().force.axial);
}

#[test]
fn the_constitutive_scenes_run_soundly() {
    for (name, overrides) in [
        ("effects/plasticity.toml", &[][..]),
        ("effects/fibres.toml", &[]),
        ("effects/viscoelastic.toml", &["solver.duration_s=0.6", "outputs.pictures_at_s=[]"]),
        ("effects/damage.toml", &[]),
    ] {
        let run = run(name, overrides, best_engine());
        run.assert_sound();
        let (energy, health) = (run.last().energy, run.last().health);
        match name {
            "effects/plasticity.toml" => assert!(energy.plastic > 0.1 * energy.external_max, "{energy:?}"),
            "effects/viscoelastic.toml" => assert!(energy.viscous > 0.05 * energy.external_max, "{energy:?}"),
            "effects/damage.toml" => {
                assert!((health.largest_damage - 0.95).abs() < 1e-3, "damage {}", health.largest_damage);
                assert_eq!(health.return_failures, 0);
                assert!(run.summary.hourglass_to_internal < 0.02);
                // Flow before the onset, softening, and a little at a twentieth of the strength.
                let expected = (0.05 * 4800.0 * 1e-3 + 0.9975 * 0.5 * 4800.0 * 0.4e-3) * 16e-6;
                assert_near("energy of the failed layer [J]", energy.plastic, expected, 0.1);
            }
            // Slanted fibres pull sideways on a face that moves straight up.
            _ => {
                let force = run.last().reactions[Face::ZMax as usize];
                assert!(force.x.abs() > 0.05 * force.z, "{force}");
            }
        }
    }
}

#[test]
fn an_insertion_with_every_effect_keeps_its_energy() {
    let all = "effects=[\"mass_scaling\",\"gravity\",\"plasticity\",\"fibres\",\"viscoelastic\",\"damage\",\"puncture\",\"friction\"]";
    let overrides =
        [all, "damage.failure_displacement_mm=0.5", "motion.phase.0.depth_mm=4.0", "motion.phase.2.depth_mm=3.0"];
    let run = run("calibrated/muscle_biopsy.toml", &overrides, best_engine());
    run.assert_sound();
    let energy = run.last().energy;
    assert!(energy.plastic > 0.0 && energy.viscous > 0.0, "{energy:?}");
    assert_eq!(run.records.iter().map(|r| r.health.return_failures).sum::<u32>(), 0);
}

#[test]
fn tissue_that_sticks_makes_the_force_saw() {
    let run = run("effects/adhesion.toml", &[], best_engine());
    run.assert_sound();
    let adhesion: Vec<f64> = run.records.iter().filter(|r| r.tip_coordinate > 2e-3).map(|r| r.force.adhesion).collect();
    let (low, high) = adhesion.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), f| (a.min(*f), b.max(*f)));
    println!("adhesion from {low:.3} to {high:.3} N, {:.3e} J", run.last().energy.adhesion);
    assert!(low > 0.04 && low < 0.15 && high > 0.18 && high < 0.26);
    assert!(run.last().energy.adhesion > 0.0);
}
