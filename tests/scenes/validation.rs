//! Scenes with an answer that is known from outside.

use super::*;
use glam::DMat3;
use stylet::material::{Isochoric, MooneyRivlin};

/// Uniaxial nominal stress [Pa] of W = c10 (I1bar - 3) + c01 (I2bar - 3) + K/2 (J - 1)^2 at stretch `axial`, with the
/// lateral stretch for which the sides are free of stress.
fn uniaxial(c10: f64, c01: f64, bulk: f64, axial: f64) -> (f64, f64) {
    // Cauchy stress: 2/J [c10 (b - I1/3) - c01 (1/b - I2/3)] + K (J - 1), with b = J^(-2/3) lambda^2.
    let cauchy = |lateral: f64| {
        let j = axial * lateral * lateral;
        let b = [axial, lateral, lateral].map(|l| l * l * j.powf(-2.0 / 3.0));
        let (i1, i2) = (b.iter().sum::<f64>(), b.iter().map(|b| 1.0 / b).sum::<f64>());
        b.map(|b| 2.0 / j * (c10 * (b - i1 / 3.0) - c01 * (1.0 / b - i2 / 3.0)) + bulk * (j - 1.0))
    };
    let (mut low, mut high) = (0.5, 1.5);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if cauchy(middle)[1] > 0.0 { high = middle } else { low = middle }
    }
    (cauchy(low)[0] * low * low, low)
}

#[test]
fn uniaxial_stretch() {
    let mut run = run("validation/uniaxial.toml", &[], best_engine());
    run.assert_sound();
    let law = run.simulation.model.scene.material.law;
    let Isochoric::MooneyRivlin(MooneyRivlin { c10, c01 }) = law.isochoric else { panic!("another law") };
    let (stress, lateral) = uniaxial(c10, c01, law.bulk_modulus, 1.3);
    // The incompressible closed form of the scene's comment, about 1 % above.
    let incompressible = 2.0 * (1.3 - 1.3f64.powi(-2)) * (c10 + c01 / 1.3);
    assert_near("incompressible closed form [Pa]", incompressible, 4348.0, 1e-3);
    assert!(stress < incompressible && stress > 0.98 * incompressible, "{stress} {incompressible}");
    let (force, _) = run.reaction(Face::ZMax);
    assert_near("force on the top [N]", force.z, stress * 400e-6, 0.003);
    // Homogeneous: every node moves with the same stretches.
    let state = run.state();
    let mesh = &run.simulation.model.mesh;
    let corner = mesh.rest_position(0);
    let worst = (0..mesh.node_count())
        .map(|n| {
            let x = mesh.rest_position(n) - corner;
            let u = DVec3::new((lateral - 1.0) * x.x, (lateral - 1.0) * x.y, 0.3 * x.z);
            (state.displacement[n] - u).length()
        })
        .fold(0.0, f64::max);
    println!("largest deviation from the homogeneous field {:.3} um of 6 mm", worst * 1e6);
    assert!(worst < 0.002 * 6e-3, "{worst} m");
}

#[test]
fn patch() {
    let mut run = run("validation/patch.toml", &[], best_engine());
    run.assert_sound();
    let last = run.last().clone();
    let fields = run.simulation.snapshot(&last).unwrap();
    let worst = fields.jacobian.iter().map(|j| (j - 0.95).abs()).fold(0.0, f64::max);
    let state = run.state();
    let mesh = &run.simulation.model.mesh;
    let height = -mesh.rest_position(0).z;
    let shift = (0..mesh.node_count())
        .map(|n| {
            let x = mesh.rest_position(n);
            (state.displacement[n] - DVec3::new(0.0, 0.0, -0.05 * (x.z + height))).length()
        })
        .fold(0.0, f64::max);
    println!("largest |J - 0.95| {worst:.2e}, largest deviation from the affine field {:.4} um of 1 mm", shift * 1e6);
    // Single precision and what is left of the vibration: 1e-4 of the strain.
    assert!(worst < 1e-5, "{worst}");
    assert!(shift < 1e-4 * 1e-3, "{shift} m");
    assert!(run.last().energy.hourglass < 1e-6 * run.last().energy.elastic);
}

#[test]
fn compression_of_a_bonded_cube() {
    let mut bonded = run("validation/compression_30.toml", &[], best_engine());
    let (summary, health) = (&bonded.summary, bonded.last().health);
    assert!(summary.energy_imbalance <= 0.02 && summary.clamped_nodes == 0);
    println!("smallest J {:.3}, at cell corners {:.3}", health.min_j, health.min_corner_j);
    assert_eq!(summary.inverted_cells, 0);
    let ((top, _), (bottom, _)) = (bonded.reaction(Face::ZMax), bonded.reaction(Face::ZMin));
    println!("reactions {top:.4?} N, {bottom:.4?} N");
    assert_near("converged reaction [N]", -top.z, 4.65, 0.05);
    assert!((top + bottom).length() < 0.005 * top.length(), "the block is at rest");
    assert!(top.truncate().length() < 0.005 * top.length());
    // The linear hourglass force alone: the value of the reference trial.
    let mut linear = run("validation/compression_30.toml", &["solver.hourglass_quartic=0"], best_engine());
    assert_near("reaction with the linear hourglass force [N]", -linear.reaction(Face::ZMax).0.z, 4.51, 0.01);
}

#[test]
fn twisted_cube() {
    let mut run = run("validation/twist.toml", &[], best_engine());
    run.assert_sound();
    let ((top, turn), (bottom, held)) = (run.reaction(Face::ZMax), run.reaction(Face::ZMin));
    println!("forces {top:.5?}, {bottom:.5?} N; moments {turn:.6?}, {held:.6?} N m");
    assert!(turn.z > 0.0, "the moment turns the way the face does");
    assert_near("moment at the bottom over that at the top", -held.z / turn.z, 1.0, 0.005);
    assert!(top.truncate().length() < 0.005 * top.z.abs());
    assert!(top.z < 0.0, "Poynting: a twisted block pushes its ends apart");
    assert_near("axial force at the bottom over that at the top", -bottom.z / top.z, 1.0, 0.01);
}

#[test]
fn sphere_on_a_block() {
    let run = run("validation/sphere_indentation.toml", &[], best_engine());
    run.assert_sound();
    let law = run.simulation.model.scene.material.law;
    let (e, nu): (f64, f64) = (law.youngs_modulus(), law.poisson_ratio());
    let hertz = 4.0 / 3.0 * e / (1.0 - nu * nu) * 10e-3f64.sqrt() * 1e-3f64.powf(1.5);
    assert_near("Hertz [N]", hertz, 0.110, 0.01);
    // Finite thickness, bonded base, incompressible: Dimitriadis et al. 2002, Eq. 13, chi = sqrt(R d) / h.
    let chi = (10e-3f64 * 1e-3).sqrt() / 40e-3;
    let thick = hertz * (1.0 + 1.133 * chi + 1.283 * chi.powi(2) + 0.769 * chi.powi(3) + 0.0975 * chi.powi(4));
    let held: Vec<f64> = run.records.iter().rev().take(5).map(|r| r.force.axial).collect();
    let force = held.iter().sum::<f64>() / held.len() as f64;
    println!("force at 1 mm: {:+.2} % of Hertz", 100.0 * (force / hertz - 1.0));
    assert!(force > hertz, "a finite block is stiffer than a half space");
    assert_near("force at 1 mm against the block of finite thickness [N]", force, thick, 0.10);
}

#[test]
fn free_vibration_of_a_column() {
    // 20 frames per period, so that a window of whole periods holds harmonics that are orthogonal.
    const PER_PERIOD: usize = 20;
    let scene = load("validation/free_vibration.toml", &["solver.frame_rate_hz=5477.2256"]);
    let mut simulation = Simulation::new(scene, best_engine()).unwrap();
    for frame in 0..simulation.frame_count() {
        simulation.stop_after(frame);
    }
    let mesh = simulation.model.mesh.clone();
    let top: Vec<usize> = (0..mesh.node_count())
        .filter(|&n| mesh.block().node_coordinates(n)[2] == mesh.block().nodes()[2] - 1)
        .collect();
    let mut curve = vec![(0.0, 0.0)];
    let mut damped = 0.0;
    while let Some(record) = simulation.next_frame().unwrap() {
        damped = record.energy.damping;
        let state = simulation.engine().read_state().unwrap();
        let mean = top.iter().map(|&n| state.displacement[n].z).sum::<f64>() / top.len() as f64;
        curve.push((record.time, mean));
    }
    let law = simulation.model.scene.material.law;
    let modulus = law.p_wave_modulus();
    let speed = (modulus / 1060.0).sqrt();
    assert_near("P-wave speed [m/s]", speed, 21.909, 1e-3);
    let (period, rest) = (4.0 * 20e-3 / speed, 10.0 * 20e-3 / modulus);
    let peak = curve.iter().map(|p| p.1).fold(0.0, f64::max);
    assert_near("largest displacement of the top [m]", peak, 2.0 * rest, 0.02);
    // The top passes its static place upwards at T/4, 5T/4, ...
    let crossings: Vec<f64> = curve
        .windows(2)
        .filter(|w| w[0].1 < rest && w[1].1 >= rest)
        .map(|w| w[0].0 + (w[1].0 - w[0].0) * (rest - w[0].1) / (w[1].1 - w[0].1))
        .collect();
    println!("upward crossings {crossings:.6?} s");
    assert_near("first crossing [s]", crossings[0], 0.25 * period, 0.01);
    let measured = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
    assert_near("period [s]", measured, period, 0.005);
    // No decay. The corners of the triangular swing become round, because the mesh lets the high harmonics lag; the
    // first harmonic keeps its amplitude. Least squares over two periods at either end.
    let amplitude = |from: usize| {
        let omega = std::f64::consts::TAU / period;
        // Normal equations of a + b cos + c sin.
        let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for (time, value) in &curve[from..from + 2 * PER_PERIOD] {
            let row = DVec3::new(1.0, (omega * time).cos(), (omega * time).sin());
            matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            right += row * *value;
        }
        let fit = matrix.inverse() * right;
        fit.y.hypot(fit.z)
    };
    // The first point is the start, the last frame may be shorter than the others.
    let (first, last) = (amplitude(1), amplitude(curve.len() - 1 - 2 * PER_PERIOD));
    // A triangular wave of height s0 H / M has the first harmonic 8/pi^2 of it.
    assert_near("first harmonic [m]", first, 8.0 / std::f64::consts::PI.powi(2) * rest, 0.02);
    assert_near("last over first amplitude", last / first, 1.0, 0.02);
    assert_eq!(damped, 0.0, "damping is off");
}
