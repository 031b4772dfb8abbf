//! Parts of the force, membranes, exit.

use super::*;
use stylet::observables::ForceParts;
use stylet::output::major_drops;

/// Every row: the axial force is the sum of its parts.
fn assert_parts(run: &Run) {
    let largest = run.records.iter().map(|r| r.force.axial.abs()).fold(0.0, f64::max);
    for r in &run.records {
        let sum: f64 = ForceParts::PARTS.iter().map(|part| (part.of)(&r.force)).sum();
        // Sums of f32 over the contact nodes in another order.
        assert!((r.force.axial - sum).abs() < 1e-5 * largest, "frame {}: {} N, parts {sum} N", r.frame, r.force.axial);
    }
}

#[test]
fn through_a_phantom_the_force_drops_twice() {
    let run = run("phantom_through.toml", &["outputs.pictures_at_depth_mm=[]"], best_engine());
    assert_parts(&run);
    assert!(run.summary.energy_imbalance <= 0.02, "{}", run.summary.energy_imbalance);
    assert_eq!(run.summary.inverted_cells, 0);
    let drops = major_drops(&run.records);
    println!("{drops:?}");
    assert_eq!(drops.len(), 2, "{drops:?}");
    assert_eq!(drops, run.summary.drops);
    // Entry: within the transition length of the surface. Exit: within the length over which the tip force fades, and
    // farther on the needle's axis, by the dimple of the entry and the tent under the block.
    assert!(drops[0].tip_coordinate_m < 0.6e-3 && drops[0].depth_m > 2e-3);
    assert!((9.4e-3..=10.0e-3).contains(&drops[1].tip_coordinate_m) && drops[1].depth_m > 10.5e-3);
    // Outside, nothing but the shaft rubs.
    let force = run.last().force;
    assert_eq!((force.cutting, force.tip_spreading), (0.0, 0.0), "{force:?}");
    assert!(force.friction > 0.2);
}

#[test]
fn every_membrane_has_its_drop_at_its_depth() {
    let run = run("membranes.toml", &["outputs.pictures_at_depth_mm=[]"], best_engine());
    run.assert_sound();
    assert_parts(&run);
    let drops = major_drops(&run.records);
    println!("{drops:?}");
    assert_eq!(drops.len(), 3, "{drops:?}");
    for (drop, top) in drops.iter().zip([0.0, 4e-3, 8e-3]) {
        assert!((drop.tip_coordinate_m - top).abs() < 0.5e-3, "{drop:?} at {top}");
        assert!(drop.depth_m > top + 1e-3, "the surface follows the tip: {drop:?}");
    }
    // The tip is in a membrane or it is not: one of the two parts is the force of the tip, but for a frame in between.
    assert!(run.records.iter().any(|r| r.force.membrane > 0.5));
    assert!(run.records.iter().any(|r| r.force.cutting > 0.2 && r.force.membrane == 0.0));
    let between = |r: &FrameRecord| (5.0e-3..8.0e-3).contains(&r.tip_coordinate);
    let frames: Vec<_> = run.records.windows(2).filter(|pair| pair.iter().all(between)).map(|pair| &pair[1]).collect();
    assert!(frames.len() > 10, "{} frames between two membranes", frames.len());
    for r in frames {
        assert!(r.force.membrane.abs() < 1e-9 && r.force.cutting > 0.2, "{:?}", r.force);
    }
}

#[test]
fn the_hand_feels_the_inertia_of_the_needle() {
    let run = run(
        "effects/puncture.toml",
        &["motion.phase.0.depth_mm=0.5", "outputs.pictures_at_depth_mm=[]"],
        best_engine(),
    );
    assert_parts(&run);
    // 100 mm of steel, 2 mm thick, set to 10 mm/s within a frame of 1/60 s: 24.8 g/m.
    let mass = std::f64::consts::PI * 1e-6 * 0.1 * 7900.0;
    assert_near("force of the first frame [N]", run.records[0].force.inertia, mass * 10e-3 * 60.0, 0.01);
    assert!(run.records[2..run.records.len() - 2].iter().all(|r| r.force.inertia == 0.0));
    assert!(run.last().force.inertia < 0.0);
}
