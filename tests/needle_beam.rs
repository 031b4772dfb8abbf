//! The flexible needle alone: cantilever, weight, buckling, frequency, elastica, elastic foundation, energy account.

use crate::common;

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DMat3, DVec3};
use serde_json::Value;
use stylet::needle::beam::{Beam, BeamParams, BeamStep, HubPose, NodeSpring, Section, TimeRule};

use common::*;

const LATERAL: DVec3 = DVec3::X;
const AXIS: DVec3 = DVec3::NEG_Z;

fn hub() -> HubPose {
    HubPose { position: DVec3::new(0.01, -0.02, 0.1), direction: AXIS, velocity: DVec3::ZERO }
}

/// Densities of the file's materials: its f1 and EI give rho A = EI (1.875^2/L^2)^2/(2 pi f1)^2.
fn needle(row: &Value, elements: usize) -> Beam {
    let value = |key: &str| number(&row[key]);
    let length = value("L_m");
    let beta = 1.875_104_068_711_96 / length;
    let line_mass = value("EI_Nm2") * beta.powi(4) / (2.0 * PI * value("f1_Hz")).powi(2);
    let params = BeamParams {
        length,
        elements,
        section: Section { outer_diameter: value("OD_m"), inner_diameter: value("ID_m") },
        youngs_modulus: value("E_Pa"),
        density: line_mass / value("A_m2"),
    };
    Beam::straight(params, hub())
}

fn rows() -> Vec<Value> {
    reference("13_needle_beam.json")["cantilever"].as_array().unwrap().clone()
}

fn name(row: &Value) -> String {
    format!("{} {}", row["needle"].as_str().unwrap(), row["material"].as_str().unwrap())
}

fn settled(beam: &mut Beam, loads: &stylet::needle::beam::Loads) -> BeamStep {
    let step = beam.settle(hub(), loads);
    assert!(step.converged, "not converged after {} iterations", step.iterations);
    step
}

#[test]
fn section_and_stiffness_match_the_file() {
    for row in rows() {
        let beam = needle(&row, 20);
        close(&name(&row), beam.params.bending_stiffness(), number(&row["EI_Nm2"]), 1e-9);
        close("area", beam.params.section.area(), number(&row["A_m2"]), 1e-9);
    }
}

/// Tip load and uniform load in the small-deflection limit (a ten-thousandth of the file's load), and what bends stores.
#[test]
fn cantilever_deflects_as_in_the_file() {
    let part = 1e-4;
    for row in rows() {
        let mut beam = needle(&row, 20);
        let mut loads = beam.loads();
        let length = beam.params.length;
        let force = part * number(&row["tip_load_N"]);
        beam.add_force(&mut loads, length, LATERAL * force);
        let step = settled(&mut beam, &loads);
        let deflection = beam.tip_deflection().dot(LATERAL);
        close(&format!("{}: tip deflection", name(&row)), deflection, part * number(&row["tip_deflection_m"]), 1e-5);
        close("slope", beam.tip_slope(), part * number(&row["tip_slope"]), 1e-5);
        close("bending energy", beam.energy().bending, 0.5 * force * deflection, 1e-4);
        // The hub holds against the force and its moment; rounding of the axial stiffness shows at a load this small.
        close("hub force", -step.hub_force.dot(LATERAL), force, 1e-4);
        close("hub moment", step.hub_moment.length(), force * length, 1e-5);

        let mut beam = needle(&row, 20);
        let mut loads = beam.loads();
        beam.add_line_force(&mut loads, LATERAL * (part * number(&row["uniform_load_N_m"])));
        settled(&mut beam, &loads);
        let deflection = beam.tip_deflection().dot(LATERAL);
        close("uniform load", deflection, part * number(&row["uniform_tip_m"]), 1e-5);
    }
}

/// The file's own tip load bends the thinnest needles by a third of their length: there the linear formula overrates, and
/// the beam must stay below it.
#[test]
fn full_tip_load_stays_below_the_linear_answer() {
    for row in rows() {
        let mut beam = needle(&row, 20);
        let mut loads = beam.loads();
        beam.add_force(&mut loads, beam.params.length, LATERAL * number(&row["tip_load_N"]));
        settled(&mut beam, &loads);
        let linear = number(&row["tip_deflection_m"]);
        let found = beam.tip_deflection().dot(LATERAL);
        let slope = number(&row["tip_slope"]);
        // Next term of the elastica: 1 - (16/35) slope^2/... stays within slope^2.
        println!("{}: {found:.6e} m, linear {linear:.6e} m", name(&row));
        assert!(found < linear && found > linear * (1.0 - slope * slope));
    }
}

#[test]
fn weight_bends_as_in_the_file() {
    for row in rows() {
        let mut beam = needle(&row, 20);
        let mut loads = beam.loads();
        loads.gravity = LATERAL * 9.81;
        let step = settled(&mut beam, &loads);
        let sag = beam.tip_deflection().dot(LATERAL);
        close(&format!("{}: sag", name(&row)), sag, number(&row["gravity_tip_sag_m"]), 1e-3);
        close("weight on the hub", -step.hub_force.dot(LATERAL), beam.params.line_mass() * 0.1 * 9.81, 1e-6);
    }
}

#[test]
fn first_frequency_matches_the_file() {
    // The masses sit at the nodes: off by 0.46 (h/L)^2 at the free end.
    for (elements, tolerance) in [(20, 2e-3), (40, 5e-4)] {
        for row in rows() {
            let beam = needle(&row, elements);
            let f = beam.first_frequency(&beam.loads());
            close(&format!("{}, {elements} elements: f1", name(&row)), f, number(&row["f1_Hz"]), tolerance);
        }
    }
}

/// Released from a bent state, the tip swings with the first frequency.
#[test]
fn released_needle_swings_with_its_first_frequency() {
    let row = &rows()[0];
    let mut beam = needle(row, 40);
    let f1 = number(&row["f1_Hz"]);
    let mut loads = beam.loads();
    beam.add_force(&mut loads, beam.params.length, LATERAL * 1e-3);
    settled(&mut beam, &loads);
    let free = beam.loads();
    let dt = 1.0 / f1 / 400.0;
    let (mut last, mut crossings) = (beam.tip_deflection().dot(LATERAL), Vec::new());
    for n in 0..4400 {
        assert!(beam.advance(hub(), &free, dt, TimeRule::Trapezoidal).converged);
        let now = beam.tip_deflection().dot(LATERAL);
        if last > 0.0 && now <= 0.0 {
            crossings.push((n as f64 + last / (last - now)) * dt);
        }
        last = now;
    }
    let periods = (crossings.len() - 1) as f64;
    let found = periods / (crossings[crossings.len() - 1] - crossings[0]);
    // Higher modes in the released shape shift single crossings; over ten periods that is below a thousandth.
    close("frequency of the swing", found, f1, 2e-3);
}

/// Load at which the straight needle loses its stability: the smallest eigenvalue of the tangent stiffness crosses zero.
fn critical_load(row: &Value, elements: usize, pinned: bool, above: f64) -> f64 {
    let (mut low, mut high) = (0.0, above);
    while high - low > 1e-6 * above {
        let load = 0.5 * (low + high);
        let mut beam = needle(row, elements);
        let mut loads = beam.loads();
        if pinned {
            // Ten thousand times the tip stiffness of the cantilever.
            let k = 1e4 * 3.0 * beam.params.bending_stiffness() / beam.params.length.powi(3);
            let tip = beam.tip();
            *loads.springs.last_mut().unwrap() = Some(NodeSpring::lateral(k, AXIS, tip));
        }
        beam.add_force(&mut loads, beam.params.length, AXIS * -load);
        // The straight needle, shortened: 1e-5 of its length at these loads.
        let strain = load / beam.params.axial_stiffness();
        let top = beam.position[0];
        for x in &mut beam.position {
            *x = top + (*x - top) * (1.0 - strain);
        }
        if beam.unstable_modes(&loads) > 0 { high = load } else { low = load }
    }
    0.5 * (low + high)
}

#[test]
fn buckling_loads_match_the_file() {
    for row in rows() {
        for (key, pinned) in [("buckling_fixed_free_N", false), ("buckling_fixed_pinned_N", true)] {
            let expected = number(&row[key]);
            let found = critical_load(&row, 20, pinned, 2.0 * expected);
            close(&format!("{}: {key}", name(&row)), found, expected, 1e-3);
        }
    }
}

/// Complete and incomplete elliptic integrals of the first and second kind from `from` to pi/2, by the midpoint rule.
fn elliptic(k: f64, from: f64) -> (f64, f64) {
    let count = 200_000;
    let width = (FRAC_PI_2 - from) / count as f64;
    (0..count).fold((0.0, 0.0), |(f, e), i| {
        let root = (1.0 - (k * (from + (i as f64 + 0.5) * width).sin()).powi(2)).sqrt();
        (f + width / root, e + width * root)
    })
}

/// Elastica under a transverse dead load at the tip: with the tip angle phi, `k^2 = (1 + sin phi)/2`,
/// `sin theta = 1/(k sqrt 2)`: `alpha = K - F(theta)`, deflection `1 - 2 (E - E(theta))/alpha`, height
/// `sqrt(2 sin phi)/alpha` in lengths, `alpha^2 = P L^2/EI` [Bisshopp1945].
#[test]
fn large_deflection_follows_the_elastica() {
    let row = &rows()[0];
    for degrees in [10.0_f64, 40.0, 60.0, 80.0] {
        let phi = degrees.to_radians();
        let k = (0.5 * (1.0 + phi.sin())).sqrt();
        let (f, e) = elliptic(k, (1.0 / (k * 2.0_f64.sqrt())).asin());
        let (alpha, deflection, height) = (f, 1.0 - 2.0 * e / f, (2.0 * phi.sin()).sqrt() / f);
        for (elements, tolerance) in [(20, 2e-3), (40, 5e-4)] {
            let mut beam = needle(row, elements);
            let mut loads = beam.loads();
            let length = beam.params.length;
            let force = alpha * alpha * beam.params.bending_stiffness() / (length * length);
            beam.add_force(&mut loads, length, LATERAL * force);
            let step = settled(&mut beam, &loads);
            let what = format!("{degrees} degrees, {elements} elements, {} iterations", step.iterations);
            let tip = beam.tip() - hub().position;
            close(&format!("{what}: deflection"), tip.dot(LATERAL) / length, deflection, tolerance);
            close(&format!("{what}: height"), tip.dot(AXIS) / length, height, tolerance);
            close(&format!("{what}: slope"), beam.tip_slope(), phi, tolerance);
        }
    }
}

/// Pushed along its axis above the critical load, the straight needle finds the bent elastica: with the tip angle phi and
/// `k = sin(phi/2)`, `P L^2/EI = K^2`, height `2 E/K - 1`, deflection `2 k/K` in lengths [Timoshenko1961].
#[test]
fn pushed_needle_buckles_into_the_elastica() {
    for row in rows() {
        for degrees in [20.0_f64, 60.0, 120.0] {
            let phi = degrees.to_radians();
            let k = (0.5 * phi).sin();
            let (f, e) = elliptic(k, 0.0);
            let mut beam = needle(&row, 20);
            let mut loads = beam.loads();
            let length = beam.params.length;
            let force = f * f * beam.params.bending_stiffness() / (length * length);
            beam.add_force(&mut loads, length, AXIS * -force);
            let step = settled(&mut beam, &loads);
            assert!(step.buckled);
            let what = format!("{}, {degrees} degrees, {} iterations", name(&row), step.iterations);
            let tip = beam.tip() - hub().position;
            close(&format!("{what}: height"), tip.dot(AXIS) / length, 2.0 * e / f - 1.0, 1e-2);
            close(&format!("{what}: deflection"), tip.reject_from(AXIS).length() / length, 2.0 * k / f, 1e-2);
        }
    }
}

/// Below the critical load nothing moves aside; far above it the state stays finite.
#[test]
fn axial_load_below_and_far_above_the_critical_one() {
    let row = &rows()[9];
    let critical = number(&row["buckling_fixed_free_N"]);
    for factor in [0.5, 0.99, 1.5, 5.0, 30.0] {
        let mut beam = needle(row, 20);
        let mut loads = beam.loads();
        beam.add_force(&mut loads, beam.params.length, AXIS * -(factor * critical));
        let step = settled(&mut beam, &loads);
        println!("{factor} of the critical load: tip at {:?}, {} iterations", beam.tip_deflection(), step.iterations);
        assert_eq!(step.buckled, factor > 1.0);
        assert!(beam.position.iter().all(|x| x.is_finite() && x.distance(hub().position) < 0.101));
    }
    // Between a clamp that goes down by 2 mm and a tip that is held in place: every mode is there to be found.
    let mut beam = needle(row, 20);
    let mut loads = beam.loads();
    *loads.springs.last_mut().unwrap() = Some(NodeSpring::isotropic(1e6, beam.tip()));
    for n in 1..=20 {
        let at = HubPose { position: hub().position + AXIS * (1e-4 * n as f64), ..hub() };
        let step = beam.settle(at, &loads);
        assert!(step.converged);
    }
    let push = -beam.axial_forces()[10];
    // Just past the bifurcation the load stays near the critical one and grows slowly.
    close("fixed-pinned load past the bifurcation", push, number(&row["buckling_fixed_pinned_N"]), 0.05);
    assert_eq!(beam.unstable_modes(&loads), 0);
}

/// Tip load on a beam with a foundation of `k` [N/m^2] per length: `w = 2 P b/k (sinh cosh - sin cos)/(cosh^2 + cos^2)` at
/// `b L`, `b^4 = k/4EI` [Hetenyi1946].
#[test]
fn foundation_of_springs() {
    let row = &rows()[0];
    for line_stiffness in [1e2, 1e4, 1e6] {
        let mut beam = needle(row, 40);
        let mut loads = beam.loads();
        let (ei, length, h) = (beam.params.bending_stiffness(), beam.params.length, beam.element_length());
        for n in 0..beam.node_count() {
            let share = if n == 0 || n == 40 { 0.5 } else { 1.0 };
            loads.springs[n] = Some(NodeSpring::isotropic(line_stiffness * h * share, beam.position[n]));
        }
        let force = 1e-4;
        beam.add_force(&mut loads, length, LATERAL * force);
        settled(&mut beam, &loads);
        let b = (line_stiffness / (4.0 * ei)).powf(0.25);
        let x = b * length;
        let form = (x.sinh() * x.cosh() - x.sin() * x.cos()) / (x.cosh().powi(2) + x.cos().powi(2));
        let expected = 2.0 * force * b / line_stiffness * form;
        let found = beam.tip_deflection().dot(LATERAL);
        // The springs sit at the nodes: off by (b h)^2/3.
        let tolerance = 1e-4 + (b * h).powi(2) / 2.0;
        close(&format!("foundation of {line_stiffness:e} N/m^2, b L = {x:.2}"), found, expected, tolerance);
    }
}

/// A force between the nodes and a moment at the tip: textbook answers.
#[test]
fn force_anywhere_and_moment() {
    let row = &rows()[0];
    let mut beam = needle(row, 20);
    let (ei, length) = (beam.params.bending_stiffness(), beam.params.length);
    let (force, at) = (1e-4, 0.0333);
    let mut loads = beam.loads();
    beam.add_force(&mut loads, at, LATERAL * force);
    settled(&mut beam, &loads);
    let expected = force * at * at * (3.0 * length - at) / (6.0 * ei);
    close("force at a third", beam.tip_deflection().dot(LATERAL), expected, 1e-5);

    let mut beam = needle(row, 20);
    let mut loads = beam.loads();
    let moment = 1e-5;
    beam.add_moment(&mut loads, 20, AXIS.cross(LATERAL) * moment);
    settled(&mut beam, &loads);
    close("moment at the tip", beam.tip_deflection().dot(LATERAL), moment * length * length / (2.0 * ei), 1e-5);
}

/// A hub that turns and travels carries the needle along without any energy.
#[test]
fn rigid_motion_stores_nothing() {
    let mut beam = needle(&rows()[0], 20);
    let loads = beam.loads();
    for n in 1..=40 {
        let angle = 0.1 * n as f64;
        let direction = DVec3::new(angle.sin(), 0.3 * angle.sin(), -angle.cos()).normalize();
        let at = HubPose { position: DVec3::new(angle, 0.0, -angle) * 0.01, direction, velocity: DVec3::ZERO };
        assert!(beam.settle(at, &loads).converged);
        let tip = at.position + direction * 0.1;
        assert!(beam.tip().distance(tip) < 1e-12, "tip at {} instead of {tip}", beam.tip());
    }
    // Against bending by a thousandth of a radian.
    at_most("energy [J]", beam.energy().total(), 1e-15);
}

/// The same loads in a turned frame give the same needle, turned.
#[test]
fn answers_turn_with_the_frame() {
    let row = &rows()[9];
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    let bend = |frame: DMat3| {
        let at = HubPose { position: DVec3::ZERO, direction: frame * AXIS, velocity: DVec3::ZERO };
        let mut beam = Beam::straight(needle(row, 20).params, at);
        let mut loads = beam.loads();
        beam.add_force(&mut loads, 0.1, frame * DVec3::new(0.3, 0.1, 0.05));
        beam.add_force(&mut loads, 0.047, frame * DVec3::new(-0.2, 0.4, 0.0));
        assert!(beam.settle(at, &loads).converged);
        (beam.tip(), beam.energy().bending)
    };
    let (straight, turned) = (bend(DMat3::IDENTITY), bend(turn));
    at_most("turned tip [m]", (turn * straight.0).distance(turned.0), 1e-9);
    close("turned energy", turned.1, straight.1, 1e-8);
    assert!(straight.0.distance(AXIS * 0.1) > 0.01, "the load must bend the needle far");
}

/// A bent needle let go, and one shaken by its hub: what goes in is stored, in motion or booked as damping of the rule.
#[test]
fn energy_closes_over_a_dynamic_run() {
    let row = &rows()[9];
    let f1 = number(&row["f1_Hz"]);
    let run = |rule: TimeRule, steps_per_period: f64| {
        let mut beam = needle(row, 20);
        let mut loads = beam.loads();
        beam.add_force(&mut loads, beam.params.length, LATERAL * 0.05);
        settled(&mut beam, &loads);
        let start = beam.energy().total();
        let (mut sum, mut damped, mut least) = (0.0, 0.0, 0.0_f64);
        let free = beam.loads();
        let dt = 1.0 / f1 / steps_per_period;
        for _ in 0..(5.0 * steps_per_period) as usize {
            let step = beam.advance(hub(), &free, dt, rule);
            assert!(step.converged);
            sum += step.hub_work + step.load_work;
            damped += step.dissipated;
            least = least.min(step.dissipated);
        }
        assert!((start + sum - damped - beam.energy().total()).abs() < 1e-9 * start);
        (damped / start, least / start)
    };
    let (coarse, least) = run(TimeRule::BackwardEuler, 100.0);
    println!("backward Euler, 100 steps per period: {coarse:.4} of the energy damped in five periods");
    assert!(least > -1e-9, "backward Euler made energy: {least:e}");
    // 1 - exp(-omega^2 dt per unit of time): over n periods 1 - exp(-(2 pi)^2 n/100).
    close("damping of backward Euler", coarse, 1.0 - (-(4.0 * PI * PI) * 5.0 / 100.0_f64).exp(), 0.05);
    let (fine, _) = run(TimeRule::Trapezoidal, 100.0);
    at_most("trapezoidal rule, 100 steps per period: part damped", fine.abs(), 5e-3);

    // A hub that starts, shakes and stops: its work against the change of the needle's energy.
    let mut beam = needle(row, 20);
    let free = beam.loads();
    let (amplitude, omega) = (0.5e-3, 2.0 * PI * 20.0);
    let dt = 1e-4;
    let (mut work, mut damped, mut largest) = (0.0, 0.0, 0.0_f64);
    for n in 1..=2000 {
        let time = n as f64 * dt;
        let at = HubPose {
            position: hub().position + LATERAL * (amplitude * (omega * time).sin()),
            velocity: LATERAL * (amplitude * omega * (omega * time).cos()),
            ..hub()
        };
        let step = beam.advance(at, &free, dt, TimeRule::BackwardEuler);
        work += step.hub_work;
        damped += step.dissipated;
        largest = largest.max(beam.energy().total());
    }
    println!("shaken hub: work {work:.4e} J, damped {damped:.4e} J, largest energy {largest:.4e} J");
    assert!((work - damped - beam.energy().total()).abs() < 1e-9 * largest);
    assert!(damped > 0.0);
}

/// Robin springs that follow the needle from step to step damp it, and hold nothing back in the end.
#[test]
fn following_springs_only_delay() {
    let row = &rows()[9];
    let mut beam = needle(row, 20);
    let mut loads = beam.loads();
    beam.add_force(&mut loads, beam.params.length, LATERAL * 1e-3);
    let mut steps = 0;
    loop {
        for n in 1..beam.node_count() {
            loads.springs[n] = Some(NodeSpring::lateral(5.0, AXIS, beam.position[n]));
        }
        let before = beam.tip();
        assert!(beam.settle(hub(), &loads).converged);
        steps += 1;
        if beam.tip().distance(before) < 1e-10 || steps > 2000 {
            break;
        }
    }
    println!("{steps} steps");
    close("tip", beam.tip_deflection().dot(LATERAL), 1e-2 * number(&row["tip_deflection_m"]), 1e-3);
}
