//! The axisymmetric solution of a tip on a surface against closed forms, and the run on coarse cells against it.

use std::f64::consts::PI;
use std::path::Path;

use stylet::penetration::indentation::{
    ContactLaw, CurveLimit, Domain, IndentationCurve, IndentationOptions, IndentationPoint, indentation_curve,
};
use stylet::penetration::surface::Surface;
use stylet::{EngineChoice, Scene, Simulation};

use crate::common::*;

fn sneddon(options: &IndentationOptions, depth: f64) -> f64 {
    2.0 / PI * options.contact_modulus() * depth * depth * options.half_angle.tan()
}

fn tip(degrees: f64, bulk_over_mu: f64, contact: ContactLaw, core: f64) -> IndentationOptions {
    IndentationOptions { contact, core, growth: 0.15, ..IndentationOptions::tip(degrees.to_radians(), bulk_over_mu) }
}

#[test]
fn blunt_cone_at_small_strain_agrees_with_sneddon() {
    for bulk in [5.0, 18.0, 1000.0] {
        let options = tip(87.0, bulk, ContactLaw::Sliding, 0.02);
        let curve = indentation_curve(&options, &CurveLimit { depth: 0.02, force: 1.0 });
        let last = curve.points[curve.points.len() - 1];
        assert_eq!((curve.failure, last.depth), (None, 0.02));
        let ratio = last.force / sneddon(&options, last.depth);
        assert!((ratio - 1.0).abs() < 0.02, "K/mu {bulk}: {ratio}");
        // contact radius 2/pi depth tan(alpha), to one cell
        let radius = 2.0 / PI * last.depth * options.half_angle.tan();
        assert!((last.contact_radius / radius - 1.0).abs() < 0.15, "{}", last.contact_radius / radius);
    }
}

#[test]
fn force_of_a_cone_grows_with_the_square_of_depth() {
    for (contact, expected) in [(ContactLaw::Sliding, 0.934), (ContactLaw::Sticking, 1.03)] {
        let options = tip(30.0, 18.0, contact, 0.1);
        let curve = indentation_curve(&options, &CurveLimit { depth: 1.2, force: 50.0 });
        let ratio = |depth| curve.force_at(depth).map_or(0.0, |f| f / sneddon(&options, depth));
        for depth in [0.8, 1.2] {
            assert!((ratio(depth) / expected - 1.0).abs() < 0.01, "{contact:?} {depth}: {}", ratio(depth));
        }
    }
}

#[test]
fn stored_energy_is_the_work_of_the_force() {
    let curve = indentation_curve(&tip(22.5, 18.0, ContactLaw::Sticking, 0.2), &CurveLimit { depth: 3.0, force: 50.0 });
    assert_eq!(curve.failure, None);
    let steps = 200;
    let force = |k: usize| curve.force_at(3.0 * k as f64 / steps as f64).unwrap_or(f64::NAN);
    let work: f64 = (0..steps).map(|k| 0.5 * (force(k) + force(k + 1)) * 3.0 / steps as f64).sum();
    let energy = curve.energy_at(3.0).unwrap_or(f64::NAN);
    assert!((work / energy - 1.0).abs() < 0.005, "{work} {energy}");
}

#[test]
fn even_load_on_a_disc_agrees_with_love() {
    for bulk in [5.0, 18.0, 1000.0] {
        let options = IndentationOptions::even_load(2.0, bulk);
        let curve = indentation_curve(&options, &CurveLimit { depth: 1.0, force: 0.01 });
        let last = curve.points[curve.points.len() - 1];
        let expected = 16.0 * last.force / (3.0 * PI * PI * options.contact_modulus() * 2.0);
        assert!((last.depth / expected - 1.0).abs() < 0.01, "K/mu {bulk}: {}", last.depth / expected);
    }
}

#[test]
fn a_large_cylinder_is_a_half_space() {
    let half_space = tip(30.0, 18.0, ContactLaw::Sticking, 0.2);
    let domain = Domain::Cylinder { radius: 60.0, height: 60.0, side_fixed: true };
    let limit = CurveLimit { depth: 2.0, force: 60.0 };
    let force = |o: &IndentationOptions| indentation_curve(o, &limit).force_at(2.0).unwrap_or(f64::NAN);
    let (a, b) = (force(&half_space), force(&IndentationOptions { domain, ..half_space }));
    assert!(b > a && b < 1.04 * a, "{a} {b}");
}

#[test]
fn interpolation_reproduces_a_parabola() {
    let point = |k: usize| IndentationPoint { depth: k as f64, force: (k * k) as f64, ..Default::default() };
    let curve = IndentationCurve { points: (0..7).map(point).collect(), failure: None };
    assert!(curve.depth_at(6.25).is_some_and(|d| (d - 2.5).abs() < 1e-12));
    assert!(curve.force_at(5.5).is_some_and(|f| (f - 30.25).abs() < 1e-12));
    assert_eq!(curve.depth_at(40.0), None);
}

/// What a run takes for the surface of a tissue with K = 18 mu, lengths in R and forces in mu R^2.
fn surface(degrees: f64) -> Surface {
    Surface { shear_modulus: 1.0, bulk_modulus: 18.0, radius: 1.0, half_angle: degrees.to_radians() }
}

#[test]
fn the_surface_of_a_run_is_the_fine_solution() {
    for degrees in [22.5, 45.0] {
        let curve =
            indentation_curve(&tip(degrees, 18.0, ContactLaw::Sliding, 0.1), &CurveLimit { depth: 2.5, force: 50.0 });
        // The cone of 45 degrees is as long as R, and reaches its shoulder soon after.
        for depth in [1.0, 1.4] {
            let force = curve.force_at(depth).unwrap_or(f64::NAN);
            close(&format!("depth under a cone of {degrees} degrees"), surface(degrees).depth(force), depth, 0.02);
        }
    }
    let load = IndentationOptions { growth: 0.3, ..IndentationOptions::even_load(3.0, 18.0) };
    let disc = indentation_curve(&load, &CurveLimit { depth: 3.0, force: 21.0 });
    for force in [1.0, 9.0, 20.0] {
        let depth = disc.depth_at(force).unwrap_or(f64::NAN);
        close("sinking of the disc", surface(18.0).disc_depth(force), depth, 0.03);
    }
    // The disc sinks less than the tip, for every angle that a needle has.
    for degrees in [10.0, 14.0, 18.0, 22.5, 30.0, 45.0] {
        let depths: Vec<f64> = (0..40).map(|f| surface(degrees).unresolved(f64::from(f))).collect();
        let up_to = if degrees > 30.0 { 20 } else { 32 };
        assert!(depths[..up_to].windows(2).all(|d| d[1] > d[0]), "{degrees} degrees: {depths:?}");
    }
}

/// A 16G cone on a block of 40 x 40 x 32 mm with free sides.
const BLOCK: &str = r#"
effects = ["puncture", "mass_scaling"]
[tissue]
size_mm = [40.0, 40.0, 32.0]
cell_size_mm = 0.8
growth = 1.45
[material]
preset = "across-fibre"
[boundaries]
x_min = "free"
x_max = "free"
y_min = "free"
y_max = "free"
z_min = "fixed"
z_max = "free"
[needle]
gauge = "16G"
tip_half_angle_deg = 18.0
[motion]
entry_mm = [0.0, 0.0]
[[motion.phase]]
kind = "insert"
speed_mm_s = 1.0
depth_mm = 1.3
[puncture]
scheme = "opening"
"#;

#[test]
fn coarse_cells_under_a_cone_meet_the_fine_axisymmetric_solution() {
    let run = |cell: &str| -> Vec<(f64, f64)> {
        let scene = Scene::parse(Path::new("block.toml"), BLOCK, &[format!("tissue.cell_size_mm={cell}")]).unwrap();
        let engine = if gpu().is_some() { EngineChoice::Gpu } else { EngineChoice::Cpu };
        let mut simulation = Simulation::new(scene, engine).unwrap();
        let mut all = Vec::new();
        while let Some(frame) = simulation.next_frame().unwrap() {
            all.push((frame.depth, frame.force.axial));
        }
        all
    };
    let [coarse, fine] = ["0.8", "0.4"].map(run);
    let scene = Scene::parse(Path::new("block.toml"), BLOCK, &[]).unwrap();
    let (law, radius) = (&scene.material.law, scene.needle().unwrap().radius);
    let unit = law.shear_modulus() * radius * radius;
    // The round block of the same volume.
    let domain = Domain::Cylinder { radius: 0.04 / PI.sqrt() / radius, height: 0.032 / radius, side_fixed: false };
    let options =
        IndentationOptions { domain, ..tip(18.0, law.bulk_modulus / law.shear_modulus(), ContactLaw::Sliding, 0.02) };
    let reference = indentation_curve(&options, &CurveLimit { depth: 1.3e-3 / radius, force: 50.0 });
    let at = |frames: &[(f64, f64)], depth: f64| -> f64 {
        let near: Vec<f64> = frames.iter().filter(|f| (f.0 - depth).abs() < 0.03e-3).map(|f| f.1).collect();
        near.iter().sum::<f64>() / near.len() as f64
    };
    for depth in [0.4e-3, 0.6e-3, 0.8e-3, 1.0e-3, 1.2e-3] {
        let expected = reference.force_at(depth / radius).unwrap_or(f64::NAN) * unit;
        let (a, b) = (at(&coarse, depth), at(&fine, depth));
        println!("{:.1} mm: {expected:.5} N, cells of 0.8 mm {a:.5} N, 0.4 mm {b:.5} N", depth * 1e3);
        close("cells of 0.8 mm against the fine solution", a, expected, 0.1);
        close("cells of 0.4 mm against the fine solution", b, expected, 0.1);
        close("cells of 0.8 mm against those of 0.4 mm", a, b, 0.05);
    }
}
