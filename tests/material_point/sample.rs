//! The homogeneous sample: reference states, protocol, calibration of the defaults.

use stylet::effects::{damage, fibres, plasticity, viscoelastic};
use stylet::material::Mode;
use stylet::material_test::{Leg, Protocol, Row, Sample, peak, run};

use super::*;

const PROTOCOL: Protocol =
    Protocol { from: 1.0, to: 1.5, points: 11, rate: 0.01, hold: 0.0, cycles: 1, unload: true, cell_length: 1e-3 };

fn homogeneous_error(law: ElasticLaw) -> f64 {
    let file = reference("01_mr_homogeneous.json");
    let material = elastic(law);
    let (mut worst, mut count): (f64, usize) = (0.0, 0);
    for row in file["materials"]["A"]["rows"].as_array().unwrap() {
        let mode = match row["mode"].as_str().unwrap() {
            "uniaxial" => Mode::Uniaxial,
            "equibiaxial" => Mode::Equibiaxial,
            "planar" => Mode::Planar,
            "simple_shear" => Mode::Shear,
            _ => continue,
        };
        let mut sample = Sample::new(&material, 1e-3);
        // At once: the iteration has to find its way.
        sample.step(mode.displacement_gradient(number(row, "param")), mode.free_axes(), 1.0).unwrap();
        let (p, sigma) = (matrix(&row["P_Pa"]), matrix(&row["cauchy_Pa"]));
        let scale = largest(p).max(1.0);
        worst = worst.max(largest(sample.stress - p) / scale);
        worst = worst.max(largest(sample.cauchy() - sigma) / largest(sigma).max(1.0));
        worst = worst.max(largest(sample.displacement_gradient + DMat3::IDENTITY - matrix(&row["F"])));
        count += 1;
    }
    assert!(count > 50);
    worst
}

#[test]
fn free_stretches_meet_the_reference_states() {
    let (right, wrong) =
        (homogeneous_error(MATERIAL_A), homogeneous_error(ElasticLaw::mooney_rivlin(2300.0, 1001.0, 5.0e5)));
    println!("worst {right:.1e}, with c01 wrong by 1e-3: {wrong:.1e}");
    // The file has twelve digits.
    assert!(right < 1e-8 && wrong > 1e-4);
}

#[test]
fn legs_rows_and_times_are_those_of_the_protocol() {
    let material = Material { viscoelastic: Some(viscoelastic::Params::default()), ..elastic(MATERIAL_A) };
    let protocol = Protocol { points: 5, hold: 20.0, rate: 0.1, cycles: 2, ..PROTOCOL };
    let rows = run(&material, Mode::Uniaxial, &protocol).unwrap();
    let count = |leg: Leg, cycle| rows.iter().filter(|r| r.leg == leg && r.cycle == cycle).count();
    for cycle in 0..2 {
        assert_eq!([Leg::Loading, Leg::Holding, Leg::Unloading].map(|leg| count(leg, cycle)), [5, 4, 4]);
    }
    assert!(rows.windows(2).all(|w| w[1].time >= w[0].time));
    // Two cycles of 5 s up, 20 s hold, 5 s down.
    assert!((rows.last().unwrap().time - 60.0).abs() < 1e-9);
    let top: Vec<&Row> = rows.iter().filter(|r| r.cycle == 0 && r.leg == Leg::Holding).collect();
    assert!(top.windows(2).all(|w| w[1].nominal < w[0].nominal));
    for row in &rows {
        assert!((row.work - row.stored - row.dissipated).abs() < 1e-3 * rows[4].work);
    }
}

#[test]
fn a_slow_test_relaxes_and_a_fast_one_does_not() {
    let viscous = Material { viscoelastic: Some(viscoelastic::Params::default()), ..elastic(MATERIAL_A) };
    let at = |material: &Material, rate| {
        let protocol = Protocol { rate, unload: false, points: 3, to: 0.8, ..PROTOCOL };
        run(material, Mode::Planar, &protocol).unwrap().last().unwrap().nominal
    };
    let instantaneous = at(&elastic(MATERIAL_A), 1.0);
    assert!((at(&viscous, 1e4) / instantaneous - 1.0).abs() < 1e-3);
    // Half of the isochoric stress is left; the pressure follows the free side.
    assert!((at(&viscous, 1e-6) / instantaneous - 0.5).abs() < 0.01);
}

/// Rows of a test with the law `across-fibre` and the defaults of the effects.
fn muscle(direction: DVec3) -> Vec<Row> {
    let material = Material {
        plasticity: Some(plasticity::Params::default()),
        fibres: Some(fibres::Params { direction, ..Default::default() }),
        damage: Some(damage::Params::default()),
        ..elastic(ACROSS_FIBRE)
    };
    run(&material, Mode::Uniaxial, &Protocol { to: 2.0, points: 401, unload: false, ..PROTOCOL }).unwrap()
}

#[test]
fn the_defaults_give_the_published_strengths() {
    for (direction, strength, place) in [(DVec3::X, 85.0e3, 1.72), (DVec3::Y, 26.0e3, 1.68)] {
        let rows = muscle(direction);
        let (stretch, stress) = peak(&rows).expect("the stress falls after its peak");
        let end = rows.last().unwrap().nominal;
        println!("{direction}: {stress:.0} Pa at {stretch:.3}, at a stretch of 2: {end:.0} Pa");
        assert!((stress / strength - 1.0).abs() < 0.01 && (stretch - place).abs() < 0.01);
        assert!(end < 0.8 * stress);
    }
}

#[test]
fn fibres_across_are_slack_and_oblique_ones_lie_between() {
    let at = |angle: f64| {
        let fibres = fibres::Params {
            direction: DVec3::new(angle.to_radians().cos(), angle.to_radians().sin(), 0.0),
            ..Default::default()
        };
        let material = Material { fibres: Some(fibres), ..elastic(ACROSS_FIBRE) };
        let rows = run(&material, Mode::Uniaxial, &PROTOCOL).unwrap();
        *rows.iter().rfind(|r| r.leg == Leg::Loading).unwrap()
    };
    let (along, oblique, across) = (at(0.0), at(35.0), at(90.0));
    let plain = run(&elastic(ACROSS_FIBRE), Mode::Uniaxial, &PROTOCOL).unwrap()[10];
    assert!((across.nominal - plain.nominal).abs() < 1e-6 * plain.nominal);
    assert!(along.nominal > oblique.nominal && oblique.nominal > across.nominal);
    // Oblique fibres pull the side in their plane further in.
    assert!((along.lateral[0] - along.lateral[1]).abs() < 1e-9);
    assert!(oblique.lateral[0] < oblique.lateral[1] - 1e-3);
}

#[test]
fn a_test_that_leads_nowhere_says_where() {
    // Turned inside out no free side finds rest.
    let error = run(&elastic(MATERIAL_A), Mode::Uniaxial, &Protocol { to: -0.5, ..PROTOCOL }).unwrap_err().to_string();
    assert!(error.contains("uniaxial test at stretch") && error.contains("way out"), "{error}");
}
