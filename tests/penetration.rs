//! Penetration: round holes and ring cracks against closed forms, the wedged crack against an independent solver and exact limits, and what
//! follows for a material and a needle.

use std::f64::consts::{FRAC_PI_2, PI};

use stylet::material::{Demiray, Isochoric, MooneyRivlin, NeoHookean, Ogden, Yeoh};
use stylet::penetration::cavity::{energy, equivalent_radius, normal_force, pressure, ring_crack};
use stylet::penetration::law::{EnergyJet, PlaneStrainLaw};
use stylet::penetration::neo_hooke_curve;
use stylet::penetration::steady::{Indenter, MOST_OPENED, Resistance};
use stylet::penetration::wedge_curve::{CurveEnd, OutOfCurve, WedgeCurve, WedgeOptions};
use stylet::penetration::wedged_crack::WedgedCrack;
use stylet::penetration::{Ring, Steady, Unsolved};

fn neo_hooke(mu: f64) -> Isochoric {
    Isochoric::NeoHookean(NeoHookean { c10: 0.5 * mu })
}

fn ogden(mu: f64, alpha: f64) -> Isochoric {
    Isochoric::Ogden(Ogden { mu, alpha })
}

fn demiray(mu: f64, b: f64) -> Isochoric {
    Isochoric::Demiray(Demiray { mu, b })
}

fn yeoh(c10: f64, c20: f64, c30: f64) -> Isochoric {
    Isochoric::Yeoh(Yeoh { c10, c20, c30 })
}

/// Gent's law of modulus one (Gent 1996), which no stretch passes: `w = -Jm/2 ln(1 - (I - 3)/Jm)`.
fn gent(jm: f64) -> impl PlaneStrainLaw {
    move |i1: f64| {
        let room = 1.0 - (i1 - 3.0) / jm;
        let inside = if room > 0.0 { 1.0 } else { f64::NAN };
        EnergyJet { w: -0.5 * jm * room.ln() * inside, dw: 0.5 / room * inside, d2w: 0.5 / (jm * room * room) * inside }
    }
}

fn curve(law: &dyn PlaneStrainLaw) -> WedgeCurve {
    WedgeCurve::compute(law, &WedgeOptions::default()).expect("a curve")
}

fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance * b.abs(), "{a} against {b}");
}

#[test]
fn laws_have_their_own_energies_and_slopes() {
    let laws: [&dyn PlaneStrainLaw; 7] = [
        &neo_hooke(1.3),
        &ogden(1.0, 9.0),
        &ogden(1.0, -3.0),
        &ogden(1.0, 1.3),
        &yeoh(0.483, 3.44, 0.2),
        &demiray(1.2, 6.6),
        &gent(30.0),
    ];
    for law in laws {
        for i1 in [3.001, 3.0099, 3.02, 3.5, 6.0] {
            let h = 1e-4 * (i1 - 3.0_f64);
            let (low, mid, high) = (law.jet(i1 - h), law.jet(i1), law.jet(i1 + h));
            close(mid.dw, (high.w - low.w) / (2.0 * h), 1e-6);
            assert!((mid.d2w - (high.dw - low.dw) / (2.0 * h)).abs() < 1e-5 * (mid.d2w.abs() + mid.dw));
        }
    }
    // The two-parameter laws as they are in the cells: a planar stretch without volume change.
    let mooney = Isochoric::MooneyRivlin(MooneyRivlin { c10: 0.7, c01: 0.4 });
    for law in [mooney, ogden(1.0, -3.0), ogden(2.0, 5.0), yeoh(0.483, 0.2, 0.1), demiray(1.2, 0.6)] {
        let l = 1.7_f64;
        let h = glam::DMat3::from_diagonal(glam::DVec3::new(l - 1.0, 0.0, 1.0 / l - 1.0));
        let cell = stylet::material::ElasticLaw { isochoric: law, bulk_modulus: 1.0 }.isochoric_energy(h);
        close(law.jet(l * l + 1.0 / (l * l) + 1.0).w, cell, 1e-12);
        close(PlaneStrainLaw::shear_modulus(&law), law.shear_modulus(), 1e-12);
    }
}

#[test]
fn neo_hooke_hole_is_the_closed_form() {
    for law in [neo_hooke(3.0), ogden(3.0, 2.0)] {
        for stretch in [1.0001_f64, 1.25, 2.0, 10.0, 1000.0] {
            let p = 3.0 * (stretch.ln() + 0.5 * (1.0 - stretch.powi(-2)));
            close(pressure(&law, stretch), p, 1e-10);
            let u = 3.0 * PI / 2.0 * (stretch * stretch - 1.0) * (stretch * stretch).ln();
            close(energy(&law, 1.0, stretch), u, 1e-9);
        }
    }
}

#[test]
fn ogden_hole_is_its_elementary_integral() {
    // alpha 4: (2/4)(l^4 - l^-4)/(l (l^2 - 1)) = (l^4 + 1)(l^2 + 1)/(2 l^5), integrated from 1.
    for l in [1.5_f64, 3.0, 10.0] {
        let primitive = |l: f64| 0.5 * (0.5 * l * l + l.ln() - 0.5 * l.powi(-2) - 0.25 * l.powi(-4));
        close(pressure(&ogden(1.0, 4.0), l), primitive(l) - primitive(1.0), 1e-10);
    }
}

#[test]
fn normal_force_of_a_hole_is_the_slope_of_its_energy_and_tells_the_hole() {
    let laws: [&dyn PlaneStrainLaw; 4] = [&ogden(1.0, 5.0), &yeoh(0.483, 3.44, 0.0), &demiray(1.2, 0.6), &gent(30.0)];
    for law in laws {
        let (r, h) = (1.6, 1e-4);
        let slope = (energy(law, 1.0, r + h) - energy(law, 1.0, r - h)) / (2.0 * h);
        close(normal_force(law, 1.0, r), slope, 1e-5);
        for a in [0.25, 0.5, 0.9] {
            let n = normal_force(law, a * 0.8, 0.8);
            close(equivalent_radius(law, n, 0.8).expect("in reach"), a * 0.8, 1e-9);
        }
    }
    assert!(equivalent_radius(&neo_hooke(1.0), f64::NAN, 1.0).is_none());
    assert!(equivalent_radius(&neo_hooke(1.0), 1e9, 1.0).is_none());
}

#[test]
fn ring_crack_of_neo_hooke_is_the_closed_form() {
    // J^ = (x ln(1/x^2) + (1 - x^2)/x)/2, x = c/R, from the least of 2 pi x J^ + (pi/2)(1 - x^2) ln(1/x^2).
    for x in [0.95_f64, 0.75, 0.5, 0.13, 0.0167] {
        let log = -2.0 * x.ln();
        let toughness = 0.5 * (x * log + (1.0 - x * x) / x);
        let ring = ring_crack(&neo_hooke(1.0), toughness).expect("in reach");
        close(ring.core_over_r, x, 1e-9);
        close(ring.energy, FRAC_PI_2 * (1.0 - x * x) * log, 1e-9);
        close(ring.normal_force, ring.energy + ring.force, 1e-9);
        let of_needle = Ring::new(&neo_hooke(2e4), toughness * 2e4 * 1e-3, 1e-3).expect("in reach");
        close(of_needle.core_radius, x * 1e-3, 1e-9);
        close(of_needle.tip_force, ring.force * 2e4 * 1e-6, 1e-9);
    }
}

/// J/(mu R), F_tip/(mu R^2), N/(mu R) of an independent solver (bilinear quadrilaterals, augmented Lagrange, J by differences of the energy;
/// Ogden's law of this exponent). Its mesh acts like a shift of the tip: as functions of J its forces hold to 1.6 % in F, 0.4 % in N; in tough
/// neo-Hooke to 2.2 % in F. Its sizes of deep cracks do not hold and are not here.
const INDEPENDENT: [(f64, [[f64; 3]; 3]); 4] = [
    (2.0, [[0.5, 3.8356, 6.3564], [2.0, 6.3779, 10.253], [8.0, 10.634, 17.73]]),
    (3.0, [[0.5, 3.912, 6.435], [4.0, 9.5535, 14.38], [16.0, 19.134, 28.692]]),
    (5.0, [[0.5, 4.0862, 6.5986], [4.0, 11.354, 15.831], [30.0, 42.47, 56.083]]),
    (9.0, [[0.5, 4.4786, 7.0498], [4.0, 13.935, 18.516], [30.0, 62.587, 75.536]]),
];

#[test]
fn forces_at_given_toughness_are_those_of_an_independent_solver() {
    for (alpha, rows) in INDEPENDENT {
        let c = curve(&ogden(1.0, alpha));
        for [toughness, f, n] in rows {
            let p = c.at_toughness(toughness).expect("on the curve");
            close(p.tip_force(), f, if alpha == 2.0 && toughness > 4.0 { 0.022 } else { 0.016 });
            close(p.normal_force, n, 4e-3);
        }
    }
}

#[test]
fn contact_force_is_the_slope_of_the_energy() {
    for alpha in [2.0, 5.0] {
        let law = ogden(1.0, alpha);
        let mut crack = WedgedCrack::new(&law, &WedgeOptions::default().mesh);
        let mut state = crack.initial_state(0.08);
        for radius in [0.08, 0.11, 0.15, 0.2, 0.27, 0.36, 0.5, 0.65, 0.85, 1.1, 1.5] {
            state.radius = radius;
            crack.solve(&mut state, None).expect("equilibrium");
            let mut slope = 0.0;
            let h = 2e-3 * radius;
            for sign in [-1.0, 1.0] {
                let mut near = state.clone();
                near.radius = radius + sign * h;
                crack.solve(&mut near, None).expect("equilibrium");
                slope += sign * crack.energy(&near) / (2.0 * h);
            }
            close(crack.normal_force(&state), slope, 2e-3);
        }
    }
}

#[test]
fn deep_slits_are_holes() {
    // R >> a: U -> pi mu R^2 ln(R/k), k = a/2 exactly in neo-Hooke (the polar angle of the face is the harmonic function eta).
    let c = curve(&neo_hooke(1.0));
    for size in [0.2_f64, 0.1, 0.05] {
        let p = c.at_size(size).expect("on the curve");
        let l = (2.0 / size).ln();
        close(p.energy, PI * l, 0.5 * size * size + 1e-3);
        close(p.normal_force, PI * (1.0 + 2.0 * l), 0.5 * size * size + 1e-3);
    }
    // Ogden: the angle minimises int |grad phi|^alpha; trial fields phi(eta) and psi(xi) bracket the hole of equal energy, k/a.
    for (alpha, size, low, high) in
        [(3.0, 0.05, 0.4928, 0.5134), (5.0, 0.1, 0.5117, 0.5405), (9.0, 0.2, 0.5479, 0.5687)]
    {
        let law = ogden(1.0, alpha);
        let options = WedgeOptions { size_min: size, toughness_max: 1e30, ..WedgeOptions::default() };
        let c = WedgeCurve::compute(&law, &options).expect("a curve");
        assert_eq!(c.end, CurveEnd::SizeReached);
        let n = c.at_size(size).expect("its end").normal_force;
        let k = equivalent_radius(&law, n, 1.0).expect("in reach") / size;
        assert!(k > low && k < high, "alpha {alpha}: {k}");
    }
}

#[test]
fn a_toughness_makes_the_crack_of_least_force() {
    let c = curve(&neo_hooke(2.0));
    for toughness in [0.4, 1.0, 4.0, 16.0, 60.0, 200.0] {
        let p = c.at_toughness(toughness).expect("on the curve");
        close(p.toughness(), toughness, 1e-6);
        close(p.tip_force(), p.energy + 2.0 * p.size * toughness, 1e-9);
        for factor in [0.9, 1.1] {
            if let Ok(q) = c.at_size(p.size * factor) {
                assert!(q.energy + 2.0 * q.size * toughness > p.tip_force());
            }
        }
    }
    assert!(matches!(c.at_toughness(1e5), Err(OutOfCurve::BelowSmallest(_))));
    assert!(matches!(c.at_toughness(1e-3), Err(OutOfCurve::AboveLargest(_))));
}

#[test]
fn laws_of_all_kinds_end_in_bounds() {
    let stiffening: [&dyn PlaneStrainLaw; 5] =
        [&ogden(1.0, 2.5), &ogden(1.0, 20.0), &yeoh(0.483, 3.44, 0.0), &demiray(1.2, 6.6), &gent(100.0)];
    for law in stiffening {
        let c = curve(law);
        assert_eq!(c.end, CurveEnd::ToughnessReached);
        assert!(c.points.windows(2).all(|w| w[1].toughness() > w[0].toughness()));
    }
    // Limiting stretch: no slit shorter than pi R/(2 lambda_max) can be wedged.
    let limited = curve(&gent(5.0));
    let last = limited.points[limited.points.len() - 1];
    assert!(matches!(limited.end, CurveEnd::Failed(_)) && last.size > 0.6 && last.size < 0.7);
    // No law at all, a law that loses ellipticity, a law without stiffness.
    let nan = |_: f64| EnergyJet { w: f64::NAN, dw: f64::NAN, d2w: f64::NAN };
    let usual = WedgeOptions::default();
    assert!(WedgeCurve::compute(&nan, &usual).is_err());
    assert!(WedgeCurve::compute(&yeoh(1.0, -0.2, 0.0), &usual).is_err());
    assert!(WedgeCurve::compute(&neo_hooke(0.0), &usual).is_err());
}

#[test]
fn the_table_of_neo_hooke_is_what_the_solver_finds() {
    let table = neo_hooke_curve::curve();
    let solved = WedgeCurve::compute(&neo_hooke(1.0), &neo_hooke_curve::options()).expect("a curve");
    assert_eq!(table.points.len(), solved.points.len());
    for (row, point) in table.points.iter().zip(&solved.points) {
        close(row.size, point.size, 1e-6);
        close(row.energy, point.energy, 1e-6);
        close(row.normal_force, point.normal_force, 1e-6);
    }
    for toughness in [0.1, 0.7, 3.0, 12.0, 90.0] {
        let (a, b) = (table.at_toughness(toughness).expect("in it"), solved.at_toughness(toughness).expect("in it"));
        close(a.tip_force(), b.tip_force(), 1e-6);
        close(a.size, b.size, 1e-4);
    }
}

#[test]
#[ignore = "prints the rows of src/penetration/neo_hooke_curve.rs"]
fn prints_the_table_of_neo_hooke() {
    let solved = WedgeCurve::compute(&neo_hooke(1.0), &neo_hooke_curve::options()).expect("a curve");
    for point in solved.points {
        println!("    [{:.8}, {:.6}, {:.6}],", point.size, point.energy, point.normal_force);
    }
}

/// A 16G needle.
const RADIUS: f64 = 0.8255e-3;
/// Muscle across its fibres.
const MU: f64 = 27.3e3;

fn tough(toughness: f64) -> Resistance {
    Resistance { toughness, tear_stretch: None }
}

fn torn(toughness: f64, stretch: f64) -> Resistance {
    Resistance { toughness, tear_stretch: Some(stretch) }
}

#[test]
fn a_16g_needle_in_muscle_as_tough_as_liver() {
    let mooney = Isochoric::MooneyRivlin(MooneyRivlin { c10: 9.52e3, c01: 4.13e3 });
    for law in [neo_hooke(MU), mooney] {
        let s = Steady::new(&law, tough(164.0), RADIUS, Indenter::Pointed).expect("in range");
        close(s.relative_toughness(), 7.277, 1e-3);
        close(s.crack_half_length, 0.178e-3, 0.01);
        assert!(s.tip_force > 0.187 && s.tip_force < 0.193, "{}", s.tip_force);
        let slope = 0.3 * s.normal_force * 1e-3;
        assert!(slope > 0.115 && slope < 0.119, "{slope}");
        close(s.puncture_force, 3.0 * s.tip_force, 1e-12);
        close(s.force_at(12e-3, 2.54e-3, 0.3), s.tip_force + 0.3 * s.normal_force * 9.46e-3, 1e-12);
        // z - z0 of 8.65 mm: cone, fade and lag of the README's scene.
        close(s.tip_force + slope * 8.65, 1.2, 0.02);
        // The closed forms of the tough limit.
        let l = (4.0 * s.relative_toughness() / PI).ln();
        close(s.tip_force, PI * MU * RADIUS * RADIUS * (1.0 + l), 2e-3);
        close(s.normal_force, PI * MU * RADIUS * (1.0 + 2.0 * l), 2e-3);
        close(s.crack_half_length, FRAC_PI_2 * RADIUS / s.relative_toughness(), 3e-3);
        close(s.hole_radius, 0.5 * s.crack_half_length, 0.01);
        // The hole stores (a/2R)^2 less than the slit.
        close(s.cutting_force, 2.0 * s.crack_half_length * 164.0, 0.025);
        close(s.tip_force - s.cutting_force, energy(&law, s.hole_radius, RADIUS), 1e-9);
        close(s.normal_force * RADIUS, s.tip_force + s.strain_energy, 2e-4);
        assert!(!s.torn);
    }
}

#[test]
fn toughness_beyond_the_table_follows_the_exact_limit() {
    let force = |j: f64| Steady::new(&neo_hooke(1.0), tough(j), 1.0, Indenter::Pointed).expect("a limit");
    for j in [120.0, 130.0, 1e4] {
        close(force(j).tip_force, PI * (1.0 + (4.0 * j / PI).ln()), 1e-4);
    }
    let round = Steady::new(&neo_hooke(1.0), tough(3.0), 1.0, Indenter::Round).expect("in range");
    close(round.puncture_force, 2.5 * round.tip_force, 1e-12);
    let flat = Steady::new(&neo_hooke(1.0), tough(3.0), 1.0, Indenter::Flat).expect("in range");
    close(flat.puncture_force, 2.0 * flat.tip_force, 1e-12);
}

#[test]
fn a_tear_stretch_widens_the_slit() {
    let free = Steady::new(&neo_hooke(MU), tough(164.0), RADIUS, Indenter::Pointed).expect("in range");
    let (mut force, mut slope) = (free.tip_force, free.normal_force);
    // F_tip and mu_f N [N], [N/mm] of the independent solver above, whose N of a given size is up to 4 % high.
    for (stretch, f, n) in [(5.0, 0.195, 0.103), (3.0, 0.223, 0.078), (2.0, 0.275, 0.059), (1.65, 0.314, 0.052)] {
        let s = Steady::new(&neo_hooke(MU), torn(164.0, stretch), RADIUS, Indenter::Pointed).expect("in range");
        assert!(s.torn && s.tip_force > force && s.normal_force < slope);
        close(s.crack_half_length, FRAC_PI_2 * RADIUS / stretch, 1e-12);
        close(s.tip_force, s.strain_energy + 2.0 * s.crack_half_length * 164.0, 1e-9);
        close(s.tip_force, f, 0.02);
        close(0.3 * s.normal_force * 1e-3, n, 0.04);
        (force, slope) = (s.tip_force, s.normal_force);
    }
    // A tissue that holds more than the slit asks of it.
    let strong = Steady::new(&neo_hooke(MU), torn(164.0, 50.0), RADIUS, Indenter::Pointed).expect("in range");
    assert_eq!((strong.tip_force, strong.torn), (free.tip_force, false));
}

#[test]
fn laws_that_differ_in_their_modulus_alone_have_one_answer() {
    for build in [ogden as fn(f64, f64) -> Isochoric, demiray] {
        let small = Steady::new(&build(1.0, 3.0), tough(5.0), 1.0, Indenter::Pointed).expect("in range");
        let large = Steady::new(&build(6e3, 3.0), tough(30.0), 1e-3, Indenter::Pointed).expect("in range");
        close(large.tip_force, small.tip_force * 6e-3, 1e-12);
        close(large.hole_radius, small.hole_radius * 1e-3, 1e-12);
        close(large.normal_force, small.normal_force * 6.0, 1e-12);
    }
}

#[test]
fn what_has_no_answer_is_an_error_with_the_range() {
    let ask = |law: Isochoric, resistance| Steady::new(&law, resistance, 1.0, Indenter::Pointed).unwrap_err();
    let brittle = ask(neo_hooke(1.0), tough(1e-3));
    assert!(matches!(brittle, Unsolved::TooBrittle { least, .. } if (0.05..0.08).contains(&least)), "{brittle:?}");
    assert!(brittle.to_string().contains("from 0.0"), "{brittle}");
    let hard = ask(ogden(1.0, 5.0), tough(1e4));
    assert!(matches!(hard, Unsolved::TooTough { most, law_ends: false, .. } if most > 100.0), "{hard:?}");
    assert!(hard.to_string().contains("computed up to 1"), "{hard}");
    assert_eq!(ask(yeoh(1.0, -0.2, 0.0), tough(1.0)), Unsolved::Law);
    for numbers in [tough(0.0), tough(f64::NAN), torn(1.0, 1.0), torn(1.0, f64::NAN)] {
        assert_eq!(ask(neo_hooke(1.0), numbers), Unsolved::Numbers);
    }
    assert_eq!(ask(neo_hooke(-1.0), tough(1.0)), Unsolved::Numbers);
}

/// A path is opened 100 times at most; the tip takes what the tissue within would hold, pi mu R^2 ln(stretch/100) of neo-Hooke.
#[test]
fn a_narrow_slit_is_carried_as_a_wider_one_with_the_same_force() {
    let law = neo_hooke(1.0);
    let steady = |j: f64| Steady::new(&law, tough(j), 1.0, Indenter::Pointed).expect("in range");
    let narrow = steady(264.0);
    let carried = narrow.carried(&law).expect("a curve");
    assert!((carried.wall_stretch() - MOST_OPENED).abs() < 1e-9, "{}", carried.wall_stretch());
    assert_eq!((carried.tip_force, carried.normal_force), (narrow.tip_force, narrow.normal_force));
    let more = PI * (narrow.wall_stretch() / MOST_OPENED).ln();
    let found = carried.cutting_force - narrow.cutting_force;
    assert!((found / more - 1.0).abs() < 1e-3, "{found} {more}");
    let wide = steady(60.0);
    assert!(wide.wall_stretch() < MOST_OPENED);
    assert_eq!(wide.carried(&law).expect("a curve"), wide);
}
