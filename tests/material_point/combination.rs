//! All effects together along a random smooth path: the energy balance, and what may only grow.

use stylet::effects::{damage, fibres, plasticity, viscoelastic};
use stylet::material::{Demiray, Isochoric, Ogden, Yeoh};
use stylet::material_test::Sample;

use super::*;

fn everything(law: ElasticLaw, deletion: bool) -> Material {
    // Short enough that the path deletes the cell.
    let failure_displacement = if deletion { 2.0e-4 } else { 1.5e-3 };
    Material {
        plasticity: Some(plasticity::Params { yield_stress: 3000.0, hardening: 9000.0 }),
        fibres: Some(fibres::Params { direction: DVec3::new(2.0, 1.0, -1.0).normalize(), k1: 6.0e3, k2: 0.5 }),
        viscoelastic: Some(viscoelastic::Params::default()),
        damage: Some(damage::Params { onset: 0.1, failure_displacement, largest: 0.95, deletion }),
        ..Material::elastic(law, 1060.0)
    }
}

/// Energy that is missing at the end over the largest work, and the sample.
fn follow(material: &Material, seed: u64, steps: u32) -> (f64, PointState, f64) {
    let mut random = Random(seed);
    let waves: Vec<(DMat3, f64, f64)> =
        (0..4).map(|_| (random.tensor() * 0.18, 1.0 + 4.0 * random.signed().abs(), 3.0 * random.signed())).collect();
    let path = |t: f64| waves.iter().fold(DMat3::ZERO, |h, (a, w, p)| h + *a * ((w * t + p).sin() - p.sin()));
    let mut sample = Sample::new(material, 1e-3);
    let duration = 3.0;
    let mut gross = 0.0f64;
    let mut last = PointState::default();
    for i in 1..=steps {
        let t = duration * f64::from(i) / f64::from(steps);
        sample.step(path(t), &[], duration / f64::from(steps)).unwrap();
        let state = &sample.state;
        assert!(state.plastic_dissipation >= last.plastic_dissipation);
        assert!(state.damage_dissipation >= last.damage_dissipation - 1e-9 * gross);
        last = state.clone();
        gross = gross.max(sample.work.abs());
    }
    ((sample.work - sample.energy().stored - sample.dissipated()) / gross, last, sample.damage())
}

#[test]
fn all_effects_together_keep_the_energy() {
    let with = |isochoric| ElasticLaw { isochoric, bulk_modulus: 1.0e5 };
    let laws = [
        ElasticLaw::mooney_rivlin(2300.0, 1000.0, 1.0e5),
        with(Isochoric::Yeoh(Yeoh { c10: 2000.0, c20: 500.0, c30: 100.0 })),
        with(Isochoric::Ogden(Ogden { mu: 5000.0, alpha: 4.0 })),
        with(Isochoric::Demiray(Demiray { mu: 4000.0, b: 0.8 })),
    ];
    for (i, law) in laws.into_iter().enumerate() {
        for deletion in [false, true] {
            let material = everything(law, deletion);
            let (balance, state, d) = follow(&material, 11 + i as u64, 20_000);
            println!(
                "{} deletion {deletion}: balance {balance:.1e}, alpha {:.3}, d {d:.2}, plastic {:.0}, damage {:.0}, viscous {:.0} J/m^3",
                law.isochoric.key(),
                state.plastic.alpha,
                state.plastic_dissipation,
                state.damage_dissipation,
                state.viscous_work
            );
            assert!(balance.abs() < 1e-3, "{balance}");
            assert!(state.plastic.alpha > 0.1 && state.plastic_dissipation > 0.0);
            assert!(state.damage_dissipation > 0.0 && if deletion { d == 1.0 } else { (0.1..0.95).contains(&d) });
        }
    }
}

#[test]
fn the_balance_notices_a_wrong_weight() {
    // Booked without the weight 1 - d the flow dissipates more than the work that is put in.
    let law = ElasticLaw::mooney_rivlin(2300.0, 1000.0, 1.0e5);
    let (_, state, d) = follow(&everything(law, false), 11, 20_000);
    let alpha = state.plastic.alpha;
    let unweighted = 3000.0 * alpha + 4500.0 * alpha * alpha;
    assert!(d > 0.1 && unweighted > 1.01 * state.plastic_dissipation);
}
