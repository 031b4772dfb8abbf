//! Damage: onset, dissipation independent of the cell, deletion.

use stylet::effects::{damage, plasticity};
use stylet::material_test::Sample;

use super::*;

/// The bar of the reference: flow stress 5 kPa, no hardening, u_f 4 mm.
fn softening(onset: f64, deletion: bool) -> Material {
    let file = reference("07_damage_bar.json");
    Material {
        plasticity: Some(plasticity::Params { yield_stress: number(&file, "sigma_u_Pa"), hardening: 0.0 }),
        damage: Some(damage::Params {
            onset,
            failure_displacement: number(&file, "uf_m"),
            largest: number(&file, "d_max"),
            deletion,
        }),
        ..elastic(MATERIAL_A)
    }
}

#[test]
fn nothing_fails_before_the_onset_or_without_flow() {
    let material = softening(0.1, false);
    let undamaged = Material { damage: None, ..material.clone() };
    let (mut a, mut b) = (Sample::new(&material, 1e-2), Sample::new(&undamaged, 1e-2));
    let mut begun = false;
    for i in 1..=1000 {
        let h = stretched(1.0 + 1e-3 * f64::from(i));
        a.step(h, &LATERAL, 0.0).unwrap();
        b.step(h, &LATERAL, 0.0).unwrap();
        let alpha = a.state.plastic.alpha;
        if alpha <= 0.1 {
            assert_eq!((a.damage(), a.stress), (0.0, b.stress));
        } else {
            begun = true;
            let d = (alpha - 0.1) * 1e-2 / 4e-3;
            assert!((a.damage() - d.min(0.95)).abs() < 1e-12);
            // The flow does not know the damage; what is left is the part 1 - d.
            assert!((alpha - b.state.plastic.alpha).abs() < 1e-9);
            assert!(largest(a.stress - b.stress * (1.0 - a.damage())) < 1e-5);
        }
    }
    assert!(begun);
    let without = Material { plasticity: None, ..softening(0.0, true) };
    let mut sample = Sample::new(&without, 1e-2);
    sample.step(stretched(3.0), &LATERAL, 0.0).unwrap();
    assert_eq!(sample.damage(), 0.0);
}

/// Energy that the flow of a failing cell of edge `length` dissipates per area after onset [J/m^2].
fn dissipation_per_area(length: f64, onset: f64) -> f64 {
    let material = softening(onset, true);
    let mut sample = Sample::new(&material, length);
    let mut shear = 0.0;
    let mut before = 0.0;
    // Small parts of d and of alpha, which grows by about shear/sqrt(3): the weight 1 - d is that before the step, and a
    // step books half of the stress by which it overshoots the yield surface.
    let step = 4e-4 * (4e-3 / length).min(1.0);
    while sample.damage() < 1.0 {
        if sample.state.plastic.alpha <= onset {
            before = sample.state.plastic_dissipation;
        }
        shear += step;
        sample.step(sheared(shear), &[], 0.0).unwrap();
        assert!(shear < 100.0);
    }
    let balance = (sample.work - sample.energy().stored - sample.dissipated()) / sample.work;
    println!("length {length}, onset {onset}: balance {balance:.1e}");
    // Deleted: nothing is stored, everything is booked. The last step loses what the cell held at d_max at once.
    assert_eq!((sample.stress, sample.energy().stored), (DMat3::ZERO, 0.0));
    assert!(balance.abs() < 2e-3, "{balance}");
    (sample.state.plastic_dissipation - before) * length
}

#[test]
fn the_dissipation_does_not_depend_on_the_cell() {
    let file = reference("07_damage_bar.json");
    // Bars of 1, 5 and 20 cells; one of them fails.
    for bar in file["plastic_displacement"].as_array().unwrap() {
        let expected = number(bar, "plastic_plus_damage_dissipation_J") / number(&file, "A_m2");
        let material = softening(0.0, true);
        let law = material.damage.unwrap().dissipation_per_area(5000.0);
        assert!((law / expected - 1.0).abs() < 1e-12);
        for onset in [0.0, 0.2] {
            let found = dissipation_per_area(number(bar, "Le_m"), onset);
            println!("cell {} m: {:.2e}", number(bar, "Le_m"), found / expected - 1.0);
            assert!((found / expected - 1.0).abs() < 1e-3);
            // The whole G_f, without the cap, is 0.25 % more.
            assert!((found / number(&file, "Gf_J_m2") - 1.0).abs() > 1e-3);
        }
    }
}
