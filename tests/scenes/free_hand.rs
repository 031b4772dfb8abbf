//! Motions that leave one straight line: the path is found while the tip moves.

use super::muscle_biopsy::{axial, curve_difference};
use super::*;
use stylet::needle::NeedleShape;
use stylet::needle::free_path::{END_FADE, faded_at_end};
use stylet::needle::gap::Profile;

const COARSE: &str = "tissue.cell_size_mm=1.0";
const DRAWN_OUT: &str = "motion.phase=[{kind = \"insert\", speed_mm_s = 2.0, depth_mm = 7.0}, \
                         {kind = \"move\", to_mm = [3.0, 0.0, -7.0], speed_mm_s = 2.0}, \
                         {kind = \"withdraw\", speed_mm_s = 2.0, depth_mm = -1.0}]";
const FREE: &str = "puncture.path=\"free\"";
const RING: &str = "puncture.scheme=\"ring\"";
/// Tissue that gives way before the shallow motions of these tests end.
const OPENED: [&str; 2] = ["puncture.scheme=\"opening\"", "material.toughness_j_m2=40.0"];

/// Finite forces, inverted cells reported in their frames, and the energy account.
fn check(name: &str, run: &Run, largest_imbalance: f64) {
    for r in &run.records {
        let f = &r.force;
        assert!(f.axial.is_finite() && f.lateral.is_finite() && f.torque.is_finite(), "{name} at {} s", r.time);
        assert!(f.axial.abs() < 10.0 && f.lateral.length() < 10.0, "{name} at {} s: {f:?}", r.time);
        assert_eq!(r.health.min_corner_j <= 0.0 || r.health.min_j <= 0.0, r.health.inverted_cells > 0, "{name}");
    }
    let lateral = run.records.iter().map(|r| r.force.lateral.length()).fold(0.0, f64::max);
    println!(
        "{name}: largest axial {:.3} N, lateral {lateral:.3} N, imbalance {:.2} %, {} clamped, {} inverted",
        run.figures.peak_force.unwrap(),
        100.0 * run.summary.energy_imbalance,
        run.summary.clamped_nodes,
        run.summary.inverted_cells
    );
    assert!(run.summary.energy_imbalance <= largest_imbalance, "{name}: {}", run.summary.energy_imbalance);
}

#[test]
fn free_motions_stay_finite_and_in_balance() {
    for (name, overrides, imbalance) in [
        ("entry_45", &["motion.phase.0.depth_mm=6.0"][..], 0.02),
        ("glancing_80", &["motion.phase.0.depth_mm=8.0"], 0.02),
        ("change_of_direction", &["motion.phase.2.depth_mm=7.0"], 0.02),
        ("two_tracks", &["motion.phase.0.depth_mm=4.0", "motion.phase.3.depth_mm=5.0"], 0.02),
        ("sideways", &[], 0.02),
        // The tissue snaps back off the tip, faster than the speed limit of the usual step lets it.
        ("sideways", &[DRAWN_OUT, "solver.safety=0.2"], 0.02),
        ("stab", &[FREE], 0.02),
        ("stab", &["motion.phase.0.depth_mm=8.0"], 0.02),
        ("creep", &[FREE, "motion.phase.0.depth_mm=3.0", "motion.phase.1.depth_mm=3.1"], 0.02),
        ("stop_and_go", &[FREE], 0.02),
    ] {
        for (scheme, bound) in [(&[RING][..], imbalance), (&OPENED, 0.01)] {
            let overrides: Vec<&str> = overrides.iter().chain(scheme).copied().chain([COARSE]).collect();
            let run = run(&format!("free_hand/{name}.toml"), &overrides, best_engine());
            check(&format!("{name}, {}", scheme[0]), &run, bound);
        }
    }
}

/// Mean of a part of the force between two depths of a phase [N].
fn mean_force(run: &Run, phase: usize, [from, to]: [f64; 2], part: fn(&FrameRecord) -> f64) -> f64 {
    let chosen = run.records.iter().filter(|r| r.phase == phase && r.depth > from && r.depth < to);
    let values: Vec<f64> = chosen.map(part).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

fn cutting(record: &FrameRecord) -> f64 {
    record.force.cutting
}

#[test]
fn a_track_is_open_until_its_end() {
    // A quarter of the usual step: folded surface cells that let go of the shaft are too fast for the usual one, which loses 6 % of the energy.
    let run = run("free_hand/reinsertion.toml", &[COARSE, RING, "solver.safety=0.2"], best_engine());
    check("reinsertion, ring", &run, 0.02);
    let shallow = [3.5e-3, 4.8e-3];
    let axial = |r: &FrameRecord| r.force.axial;
    let (first, again) = (mean_force(&run, 0, shallow, cutting), mean_force(&run, 2, shallow, cutting));
    let (push, push_again) = (mean_force(&run, 0, shallow, axial), mean_force(&run, 2, shallow, axial));
    let beyond = mean_force(&run, 2, [7.0e-3, 8.0e-3], cutting);
    let beside = mean_force(&run, 5, [4.0e-3, 6.0e-3], cutting);
    println!(
        "cutting {first:.3} N, again {again:.3} N; axial {push:.3} N, again {push_again:.3} N; cutting beyond the end"
    );
    println!("{beyond:.3} N, beside the track {beside:.3} N");
    assert!((first - 0.3).abs() < 0.01, "{first}");
    assert!(again < 0.05 * first && push_again < 0.6 * push, "{again} {push_again}");
    assert!((beyond - 0.3).abs() < 0.01 && (beside - 0.3).abs() < 0.02, "{beyond} {beside}");
}

/// Nothing is cut in the old track, whole tissue beyond it; a tip that is drawn aside just below the skin slips out of its track, dents the skin
/// beside it and cuts there as it did at first.
#[test]
fn an_opened_track_is_open_until_its_end_and_tissue_slides_off_a_tip_beside_it() {
    let mut engines = vec![EngineChoice::Cpu];
    if best_engine() == EngineChoice::Gpu {
        engines.push(EngineChoice::Gpu);
    }
    for engine in engines {
        let run = run("free_hand/reinsertion.toml", &[COARSE], engine);
        check("reinsertion, opened", &run, 0.01);
        assert_eq!(run.summary.inverted_cells, 0);
        assert_eq!(run.simulation.verdict().sentence(), None);
        let again = mean_force(&run, 2, [3.5e-3, 5.5e-3], cutting);
        let [first, beside] = [0, 5].map(|phase| mean_force(&run, phase, [5.4e-3, 6.0e-3], cutting));
        let beyond = mean_force(&run, 2, [7.0e-3, 8.0e-3], cutting);
        let of_phase = |phase: usize| run.records.iter().filter(move |r| r.phase == phase);
        let largest = |phase: usize| of_phase(phase).map(cutting).fold(0.0, f64::max);
        println!("first {first:.3} N, again {again:.4} N, beyond the end {beyond:.3} N, beside it {beside:.3} N");
        println!("puncture {:.3} N, beside the track {:.3} N", largest(0), largest(5));
        assert!(again.abs() < 1e-3, "{again}");
        assert!(beyond > 0.03, "{beyond}");
        assert_near("force of the tip beside the track [N]", beside, first, 0.15);
        assert_near("puncture beside the track [N]", largest(5), largest(0), 0.05);
        // What it felt while it was drawn aside was tissue that held on to it.
        let aside = of_phase(4).map(|r| r.force.lateral.x).fold(0.0, f64::max);
        let left = of_phase(4).next_back().unwrap().force.lateral.length();
        assert!(aside > 0.15 && left < 0.5 * aside, "{aside} {left}");
    }
}

#[test]
fn a_straight_motion_gives_the_force_of_the_planned_path() {
    let straight = "motion.phase=[{kind = \"insert\", speed_mm_s = 2.0, depth_mm = 6.0}, \
                    {kind = \"withdraw\", speed_mm_s = 2.0, depth_mm = 4.0}]";
    let cells = "tissue.cell_size_mm=0.8";
    for (scene, bound) in [("calibrated/muscle_biopsy.toml", 0.05), ("muscle_biopsy.toml", 1e-4)] {
        let planned = run(scene, &[straight, cells], best_engine());
        let free = run(scene, &[straight, cells, FREE], best_engine());
        let is_free = |run: &Run| run.simulation.model.puncture.as_ref().unwrap().free.is_some();
        // A line that is laid is planned for the tip, which goes along it.
        assert!(!is_free(&planned) && is_free(&free) != free.simulation.model.laid.is_some());
        assert_near("force at 6 mm [N]", free.force_at_depth(), planned.force_at_depth(), bound);
        let puncture = |r: &Run| r.figures.puncture_force.unwrap();
        assert_near("puncture force [N]", puncture(&free), puncture(&planned), bound);
        free.assert_sound();
    }
}

/// Planes that may part beside a free path change nothing about how the ring is pushed.
#[test]
fn both_engines_pass_planes_on_a_free_path() {
    let on = |engine| {
        let planes = [
            COARSE,
            FREE,
            RING,
            "effects=[\"puncture\", \"friction\", \"cohesive\", \"mass_scaling\"]",
            "cohesive={strength_kpa = 200.0, energy_j_m2 = 20.0, plane = [{axis = \"z\", at_mm = -3.0}]}",
            "motion.phase=[{kind = \"insert\", speed_mm_s = 5.0, depth_mm = 5.0}]",
        ];
        let run = run("free_hand/stop_and_go.toml", &planes, engine);
        check("planes", &run, 0.02);
        run
    };
    if best_engine() == EngineChoice::Cpu {
        return;
    }
    let (gpu, cpu) = (on(EngineChoice::Gpu), on(EngineChoice::Cpu));
    assert!(gpu.simulation.model.puncture.as_ref().unwrap().free.is_some() && gpu.simulation.model.cohesion.is_some());
    assert_near("force at 5 mm [N]", gpu.force_at_depth(), cpu.force_at_depth(), 1e-3);
}

#[test]
fn a_motion_decides_how_its_path_is_found() {
    let scene = load("free_hand/sideways.toml", &[COARSE]);
    assert!(scene.has_free_path());
    assert!(!load("free_hand/stop_and_go.toml", &[COARSE]).has_free_path());
    let simulation = Simulation::new(scene, EngineChoice::Cpu).unwrap();
    assert!(simulation.notices.iter().any(|n| n.contains("free path")), "{:?}", simulation.notices);
}

#[test]
fn both_engines_find_the_same_path() {
    if !has_gpu() {
        return;
    }
    let phases = "motion.phase=[{kind = \"insert\", speed_mm_s = 4.0, depth_mm = 4.0}, \
                  {kind = \"turn\", angle_deg = 12.0, rate_deg_s = 30.0, pivot_mm = [0.0, 0.0, 0.0]}, \
                  {kind = \"insert\", speed_mm_s = 4.0, depth_mm = 5.0}, \
                  {kind = \"withdraw\", speed_mm_s = 4.0, depth_mm = 3.5}, \
                  {kind = \"move\", to_mm = [1.5, 0.5, -3.5], speed_mm_s = 4.0, angle_deg = 5.0}, \
                  {kind = \"insert\", speed_mm_s = 4.0, depth_mm = 4.5}]";
    for tip in ["needle.tip_half_angle_deg=18.0", "needle={gauge = \"16G\", bevel_angle_deg = 25.0}"] {
        let on = |engine| {
            let run = run(
                "free_hand/change_of_direction.toml",
                &[COARSE, RING, "solver.mass_scaling=1000", phases, tip],
                engine,
            );
            check(tip, &run, 0.02);
            run
        };
        let (mut gpu, mut cpu) = (on(EngineChoice::Gpu), on(EngineChoice::Cpu));
        let (direct, shifted) = curve_difference(&axial(&gpu.records), &axial(&cpu.records));
        let (a, b) = (gpu.state(), cpu.state());
        println!(
            "{tip}: forces differ by {:.3} % of the largest, {:.3} % beside drops; tips by {:.1e} m",
            100.0 * direct,
            100.0 * shifted,
            a.tip.place.distance(b.tip.place)
        );
        assert!(shifted <= 0.02, "{shifted}");
        assert!(a.tip.place.distance(b.tip.place) < 5e-5 && a.tip.inside && b.tip.inside);
        let marked = |s: &State| s.cut_samples.iter().map(|m| m.count_ones()).sum::<u32>();
        assert!(marked(&a) > 100);
        assert_near("marked samples", marked(&a).into(), marked(&b).into(), 0.02);
    }
}

/// What a state tells is what a run goes on from.
#[test]
fn a_free_state_survives_the_device() {
    if !has_gpu() {
        return;
    }
    let mut run = run(
        "free_hand/stop_and_go.toml",
        &[COARSE, "motion.phase=[{kind = \"insert\", speed_mm_s = 10.0, depth_mm = 4.0}]", FREE, RING],
        EngineChoice::Gpu,
    );
    let state = run.state();
    assert!(state.tip.inside && state.contact.iter().any(|c| c.passed && c.rest_radius > 0.0));
    run.simulation.engine().write_state(&state).unwrap();
    assert_eq!(run.state(), state);
}

#[test]
fn the_faded_overlap_has_its_own_gradient() {
    let needle = NeedleShape::cone("test", 0.8e-3, 2.5e-3);
    let profile = Profile::new(&needle, DVec3::NEG_Z);
    let phi = |x: DVec3| {
        let overlap = profile.opened_path(x, DVec3::Z, 1.2e-3, (0.0, 0.0));
        faded_at_end(overlap, DVec3::Z, x.z, 0.0, END_FADE * needle.tip_length)
    };
    for i in 1..30 {
        let x = DVec3::new(0.9e-3, 0.3e-3, 0.041e-3 * f64::from(i));
        for axis in DVec3::AXES {
            let h = 1e-9;
            let rate = (phi(x + axis * h).value - phi(x - axis * h).value) / (2.0 * h);
            assert!((rate - phi(x).gradient.dot(axis)).abs() < 1e-5);
        }
    }
}
