//! The elastic law: derivative of its energy, homogeneous reference states on both engines.

use glam::DMat3;
use stylet::engine::Engine;
use stylet::material::ElasticLaw;
use stylet::material::kinematics::{J_CONTINUATION, cofactor};

use crate::common::*;

/// P by central differences of the energy density.
fn stress_from_energy(law: &ElasticLaw, h: DMat3) -> DMat3 {
    // 1e-6 balances truncation (step^2) and cancellation (1e-16 W / step).
    let step = 1e-6;
    let mut p = DMat3::ZERO;
    for column in 0..3 {
        for row in 0..3 {
            let mut e = DMat3::ZERO;
            e.col_mut(column)[row] = step;
            p.col_mut(column)[row] = (law.energy_density(h + e) - law.energy_density(h - e)) / (2.0 * step);
        }
    }
    p
}

/// A random F with the given determinant.
fn with_jacobian(random: &mut Random, j: f64) -> DMat3 {
    loop {
        let f = DMat3::IDENTITY + random.tensor() * 0.7;
        let d = f.determinant();
        // Scaling of one column reaches any determinant, negative ones included.
        if d.abs() > 0.2 {
            return DMat3::from_cols(f.x_axis, f.y_axis, f.z_axis * (j / d));
        }
    }
}

#[test]
fn the_stress_is_the_derivative_of_the_energy() {
    let mut random = Random(1);
    let mut worst: f64 = 0.0;
    for law in [MATERIAL_A, MATERIAL_N, ElasticLaw::mooney_rivlin(500.0, 2500.0, 2.0e5)] {
        for j in [1.0, 1.4, 0.9, 0.6, 0.31, 0.3, 0.29, 0.2, 0.05, 0.0, -0.1, -0.7, -1.5] {
            for _ in 0..20 {
                let h = with_jacobian(&mut random, j) - DMat3::IDENTITY;
                let p = law.first_piola_kirchhoff(h);
                let expected = stress_from_energy(&law, h);
                worst = worst.max(largest_entry(p - expected) / largest_entry(expected));
            }
        }
    }
    // The third derivative of the energy limits a central difference of 1e-6 to about 1e-7 of the largest entry.
    at_most("P against dW/dF, relative to the largest entry", worst, 1e-6);
}

#[test]
fn a_wrong_coefficient_does_not_pass_the_derivative_test() {
    let wrong = ElasticLaw::mooney_rivlin(2300.0, 1010.0, 5.0e5);
    let h = with_jacobian(&mut Random(2), 1.0) - DMat3::IDENTITY;
    let expected = stress_from_energy(&MATERIAL_A, h);
    assert!(largest_entry(wrong.first_piola_kirchhoff(h) - expected) / largest_entry(expected) > 1e-6);
}

#[test]
fn energy_and_stress_are_continuous_where_the_continuation_begins() {
    let mut random = Random(3);
    for _ in 0..50 {
        let [above, below] = [1.0 + 1e-9, 1.0 - 1e-9].map(|s| {
            let f = with_jacobian(&mut Random(random.0), J_CONTINUATION * s);
            f - DMat3::IDENTITY
        });
        random.signed();
        let (p, q) = (MATERIAL_A.first_piola_kirchhoff(above), MATERIAL_A.first_piola_kirchhoff(below));
        assert!(largest_entry(p - q) < 1e-7 * largest_entry(p));
        let (w, v) = (MATERIAL_A.energy_density(above), MATERIAL_A.energy_density(below));
        assert!((w - v).abs() < 1e-7 * w.abs());
    }
}

#[test]
fn a_rotation_alone_costs_nothing() {
    let mut random = Random(4);
    for _ in 0..50 {
        let r = DMat3::from_axis_angle(random.vector().normalize(), 3.0 * random.signed());
        let h = r - DMat3::IDENTITY;
        assert!(largest_entry(MATERIAL_A.first_piola_kirchhoff(h)) < 1e-8 * MATERIAL_A.bulk_modulus);
        assert!(MATERIAL_A.energy_density(h).abs() < 1e-8 * MATERIAL_A.bulk_modulus);
    }
}

/// Material, F, and the rows' W, P, Cauchy stress.
struct Row {
    law: ElasticLaw,
    label: String,
    f: DMat3,
    energy: f64,
    p: DMat3,
    cauchy: DMat3,
}

fn rows() -> Vec<Row> {
    let file = reference("01_mr_homogeneous.json");
    let mut rows = Vec::new();
    for (name, law) in [("A", MATERIAL_A), ("N", MATERIAL_N)] {
        for row in file["materials"][name]["rows"].as_array().unwrap() {
            rows.push(Row {
                law,
                label: format!("{name} {} {}", row["mode"], row["param"]),
                f: tensor(&row["F"]),
                energy: number(&row["W_J_m3"]),
                p: tensor(&row["P_Pa"]),
                cauchy: tensor(&row["cauchy_Pa"]),
            });
        }
    }
    assert_eq!(rows.len(), 164);
    rows
}

#[test]
fn homogeneous_states_in_f64() {
    let mut worst: f64 = 0.0;
    for row in rows() {
        let h = row.f - DMat3::IDENTITY;
        // The file prints 12 digits of F; what half a unit of the last one can change comes on top.
        let at_print = row.law.first_piola_kirchhoff(h);
        let mut digits = 0.0;
        for (entry, value) in row.f.to_cols_array().iter().enumerate().filter(|e| *e.1 != 0.0) {
            let mut moved = h.to_cols_array();
            moved[entry] += 0.5 * 10f64.powf(value.abs().log10().floor() - 11.0);
            digits += largest_entry(row.law.first_piola_kirchhoff(DMat3::from_cols_array(&moved)) - at_print);
        }
        let excess = |found: DMat3, expected: DMat3| {
            let difference = (largest_entry(found - expected) - digits).max(0.0);
            if difference == 0.0 { 0.0 } else { difference / largest_entry(expected) }
        };
        let p = excess(row.law.first_piola_kirchhoff(h), row.p);
        let cauchy = excess(row.law.cauchy(h), row.cauchy);
        let energy = (row.law.energy_density(h) - row.energy).abs() / row.energy.max(1e-3);
        let error = p.max(cauchy).max(energy);
        assert!(error <= 1e-9, "{}: {error:e}", row.label);
        worst = worst.max(error);
    }
    at_most("164 homogeneous states in f64", worst, 1e-9);
}

/// First Piola-Kirchhoff stress of a homogeneous state, from the nodal forces of a whole block: sum f (x) X / V.
fn stress_of_a_block(engine: &mut dyn Engine, model: &stylet::model::Model, f: DMat3) -> DMat3 {
    displaced(engine, model, |x| (f - DMat3::IDENTITY) * x);
    let forces = engine.internal_forces().unwrap();
    let mut p = DMat3::ZERO;
    let mut volume = 0.0;
    for (node, force) in forces.iter().enumerate() {
        p += outer(*force, model.mesh.rest_position(node));
        volume += model.mesh.block().node_volume(node);
    }
    p * (1.0 / volume)
}

#[test]
fn homogeneous_states_through_the_element_stage() {
    // Cells of 2 mm: the kernel sums four edges in integers of +-31 mm, so H times the edge must stay below 7.8 mm.
    let models = [MATERIAL_A, MATERIAL_N].map(|law| {
        let mut scene = block([4.0, 4.0, 4.0], 2.0);
        scene.material.law = law;
        model(scene)
    });
    let mut engines = models.clone().map(|m| engines(&m, 1e-6, 1));
    let (mut worst, mut worst_zero) = ([0.0f64; 3], [0.0f64; 3]);
    for row in rows() {
        let which = usize::from(row.law == MATERIAL_N);
        for (kind, (name, engine)) in engines[which].iter_mut().enumerate() {
            let p = stress_of_a_block(engine.as_mut(), &models[which], row.f);
            let scale = largest_entry(row.p);
            if scale == 0.0 || row.f == DMat3::IDENTITY {
                // Rest: nothing may push beyond the rounding of the deviatoric terms, which cancel each other.
                let allowed = if *name == "cpu" { 1e-12 } else { 1e-6 };
                assert!(largest_entry(p) < allowed * row.law.shear_modulus(), "{name} {}: {p}", row.label);
                continue;
            }
            // kappa (J - 1) cof F is known no better than J - 1: one unit of the last place of f32 of its terms, which
            // are of order |H|, and the fixed point of u: 7.3 pm at both ends of 2 mm, three times. Free faces feel this as they are
            // stress-free by cancellation, small shears because their normal stress is of second order.
            let h = largest_entry(row.f - DMat3::IDENTITY);
            let jacobian = 1.2e-7 * h * h.powi(2).max(1.0) + 2.2e-8;
            let noise = row.law.bulk_modulus * largest_entry(cofactor(row.f)) * jacobian;
            let (part, zero, noise) = if *name == "cpu" { (1e-6, 1e-5, 0.0) } else { (1e-3, 1e-5, noise) };
            for (found, expected) in p.to_cols_array().iter().zip(row.p.to_cols_array()) {
                let difference = (found - expected).abs();
                let is_zero = expected.abs() <= 1e-6 * scale;
                let allowed = if is_zero { zero * scale } else { part * expected.abs() } + noise;
                let measure = if is_zero { &mut worst_zero } else { &mut worst };
                // Told are the entries that count: large ones, of states beyond small strain.
                if h > 0.01 && (is_zero || expected.abs() > 0.1 * scale) {
                    measure[kind] = measure[kind].max(difference / scale);
                }
                assert!(difference <= allowed, "{name} {}: {found} instead of {expected} of {scale}", row.label);
            }
        }
    }
    for (kind, name) in ["cpu", "gpu", "lanes"].iter().enumerate() {
        println!(
            "homogeneous states, {name}: strains above 1 %: large entries off by {:.1e}, zeros by {:.1e}",
            worst[kind], worst_zero[kind]
        );
    }
}

#[test]
fn material_points_of_extreme_squeeze_agree_on_both_engines() {
    let model = model(block([2.0, 2.0, 2.0], 1.0));
    let Some(mut gpu) = gpu_engine(&model, 1e-6, 1) else {
        return;
    };
    let mut random = Random(5);
    let mut worst: f64 = 0.0;
    for j in [0.5, 0.3, 0.29, 0.1, 0.0, -0.3, -1.0] {
        for _ in 0..10 {
            let f = with_jacobian(&mut random, j);
            let p = stress_of_a_block(&mut gpu, &model, f);
            let expected = MATERIAL_A.first_piola_kirchhoff(f - DMat3::IDENTITY);
            worst = worst.max(largest_entry(p - expected) / largest_entry(expected));
        }
    }
    at_most("P of squeezed and inverted states on the GPU", worst, 2e-5);
}
