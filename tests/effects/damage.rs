//! Damage through the whole step: dissipation on any mesh, the softening bar, deletion, neutral parameters.

use std::sync::Arc;

use glam::DVec3;
use stylet::effects::{damage, plasticity};
use stylet::material::ElasticLaw;
use stylet::model::Model;
use stylet::scene::{Face, FaceCondition, FaceDrive, Region, RegionShape, Scene};

use crate::common::*;

/// Yield stress of the weak cell over that of the others.
const WEAK: f64 = 0.9;

/// A column of `count` cubic cells of edge `cell_mm` with a slightly weaker one in the middle, sheared by `slip_mm` in 1 s.
///
/// Only the displacement along x is free. A column that is pulled would be no bar of one dimension: a weak cell that flows
/// grows thinner, its neighbours hinder it through the common nodes, and it carries many times its strength.
fn column(count: usize, cell_mm: f64, slip_mm: f64, yield_stress: f64, params: damage::Params) -> Scene {
    let length = cell_mm * count as f64;
    let mut scene = block([cell_mm, cell_mm, length], cell_mm);
    for face in [Face::XMin, Face::XMax, Face::YMin, Face::YMax] {
        scene.faces[face as usize] = held(false, true, true);
    }
    scene.faces[Face::ZMin as usize] = held(true, true, true);
    scene.faces[Face::ZMax as usize] = FaceCondition {
        drive: Some(FaceDrive { displacement: DVec3::X * slip_mm * 1e-3, rotation: 0.0, duration: 1.0, cycles: 0 }),
        ..held(true, true, true)
    };
    scene.effects.plasticity = Some(plasticity::Params { yield_stress, hardening: 0.0 });
    scene.effects.damage = Some(params);
    scene.solver.mass_damping = 300.0;
    let mut weak = scene.material.clone();
    weak.name = "weak".into();
    weak.plasticity = Some(plasticity::Params { yield_stress: WEAK * yield_stress, hardening: 0.0 });
    let middle = (count / 2) as f64 * cell_mm * 1e-3;
    scene.regions.push(Region {
        name: "weak".into(),
        shape: RegionShape::Layer { top: middle, bottom: middle + cell_mm * 1e-3 },
        material: weak,
    });
    scene
}

fn run(model: &Arc<Model>, dt: f64, frames: usize, steps: usize) -> Vec<(&'static str, Vec<Sample>)> {
    let mut engines = engines(model, dt, steps);
    engines.iter_mut().map(|(name, e)| (*name, pull(e.as_mut(), model, dt, frames, steps))).collect()
}

#[test]
fn the_dissipation_does_not_depend_on_the_mesh() {
    let yield_stress = 200.0;
    let params = damage::Params { onset: 0.0, failure_displacement: 0.5e-3, largest: 0.95, deletion: false };
    for count in [1usize, 5, 20] {
        // A plastic strain of 0.475 is a slip of 0.82 mm; the rest gives a little elastically.
        let model = model(column(count, 1.0, 0.95 + 0.02 * count as f64, yield_stress / WEAK, params));
        let (dt, steps) = (1.0e-5, 500);
        for (name, samples) in run(&model, dt, 200, steps) {
            let area = 1e-6;
            // Plastic work between onset and d_max.
            let end = 0.95 * params.failure_displacement / 1e-3;
            let found = interpolated(&samples, |s| s.alpha, end, |s| s.plastic) / area;
            let expected = params.dissipation_per_area(yield_stress);
            close(&format!("{name}, {count} cells: dissipation [J/m^2]"), found, expected, 1e-2);
            let last = samples.last().unwrap();
            assert!((last.damage - 0.95).abs() < 1e-5, "{name}: damage {}", last.damage);
            let s = &last.sums;
            let accounted = s.energy.elastic
                + s.energy.hourglass
                + s.energy.kinetic
                + s.energy.half_step
                + last.plastic
                + last.degradation
                + last.damping;
            at_most(&format!("{name}: imbalance"), (last.work - accounted).abs() / last.work, 1e-2);
            assert_eq!(s.health.return_failures, 0);
        }
    }
}

#[test]
fn the_softening_cell_of_the_reference() {
    // The file is a small-strain bar without lateral contraction. One pulled cell comes close to that limit where strains
    // and stresses are a small part of its own; columns of several cells are compared by their dissipation.
    let file = reference("07_damage_bar.json");
    let case = &file["plastic_displacement"][0];
    assert_eq!(number(&case["N"]), 1.0);
    for (engine, scale, tolerance) in [("cpu", 1e-4, 2e-3), ("gpu", 1e-3, 1.2e-2)] {
        let list = |key: &str| case[key].as_array().unwrap().iter().map(|x| number(x) * scale).collect::<Vec<f64>>();
        let (u, force) = (list("u_total_m"), list("force_N"));
        let yield_stress = number(&file["sigma_u_Pa"]) * scale;
        let failure_displacement = number(&file["uf_m"]) * scale;
        let mut scene = pulled([10.0; 3], 10.0, u[u.len() - 1] / 0.01, 1.0);
        scene.effects.plasticity = Some(plasticity::Params { yield_stress, hardening: 0.0 });
        scene.effects.damage =
            Some(damage::Params { onset: 0.0, failure_displacement, largest: 0.95, deletion: false });
        // E 20 kPa as in the file, compressible for the digits of f32.
        let (e, nu) = (number(&file["E_Pa"]), 0.3);
        scene.material.law = ElasticLaw::from_moduli(e / 2.6, e / (3.0 * (1.0 - 2.0 * nu)), 0.7);
        // Light, so that the start of the pull is no blow.
        scene.material.density = 10.0;
        scene.solver.mass_damping = 300.0;
        let model = model(scene);
        let dt = 0.6 * stylet::engine::stable_dt::wave_speed_bound(&model);
        let steps = (1.0 / dt / 400.0).ceil() as usize;
        let mut engines = engines(&model, dt, steps);
        let Some((_, e)) = engines.iter_mut().find(|e| e.0 == engine) else { continue };
        let samples = pull(e.as_mut(), &model, dt, 399, steps);
        let area = number(&file["A_m2"]);
        let mut worst: f64 = 0.0;
        // The kink at the yield point lies between two frames.
        for (u, force) in u.iter().zip(&force).skip(2).take(u.len() - 3) {
            let found = interpolated(&samples, |s| (s.stretch - 1.0) * 0.01, *u, |s| s.nominal) * area;
            worst = worst.max((found - force).abs() / (yield_stress * area));
        }
        at_most(&format!("{engine}: force over the strength, strains of {scale}"), worst, tolerance);
    }
}

#[test]
fn a_deleted_cell_carries_nothing_and_keeps_its_mass() {
    let params = damage::Params { onset: 0.0, failure_displacement: 0.2e-3, largest: 0.9, deletion: true };
    let model = model(column(3, 1.0, 0.6, 200.0, params));
    let mass: f64 = model.node_mass.iter().sum();
    close("mass", mass, 1060.0 * 3e-9, 1e-12);
    for (name, samples) in run(&model, 1e-5, 200, 500) {
        let last = samples.last().unwrap();
        assert_eq!(last.sums.health.deleted_cells, 1, "{name}");
        let stress = last.sums.reactions[Face::ZMax as usize].x / 1e-6;
        assert!(stress.abs() < 2.0, "{name}: {stress} Pa");
        let s = &last.sums;
        let accounted = s.energy.elastic
            + s.energy.hourglass
            + s.energy.kinetic
            + s.energy.half_step
            + last.plastic
            + last.degradation
            + last.damping;
        at_most(&format!("{name}: imbalance"), (last.work - accounted).abs() / last.work, 1e-2);
        assert_eq!(s.health.inverted_cells, 0, "{name}");
    }
}

#[test]
fn damage_out_of_reach_changes_nothing() {
    let dt = 1e-5;
    let never = damage::Params { onset: 10.0, failure_displacement: 1e-3, largest: 0.95, deletion: false };
    let with = model(column(2, 1.0, 0.4, 500.0, never));
    let mut scene = column(2, 1.0, 0.4, 500.0, never);
    scene.effects.damage = None;
    let without = model(scene);
    for ((name, a), (_, b)) in run(&with, dt, 10, 500).iter().zip(run(&without, dt, 10, 500)) {
        close(
            name,
            a.last().unwrap().sums.reactions[Face::ZMax as usize].x,
            b.last().unwrap().sums.reactions[Face::ZMax as usize].x,
            if *name == "gpu" { 1e-6 } else { 1e-12 },
        );
    }
}
