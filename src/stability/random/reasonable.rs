//! Whether a scene lies within what a user would do; the table stands at the head of `super`.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use crate::effects::TissueMaterial;
use crate::effects::cohesive::Law;
use crate::effects::mass_scaling::{FEWEST_PASSAGES, Loading, MOST_MACH};
use crate::effects::puncture::{MOST_PRESSURE_OVER_BULK, MOST_PRESSURE_OVER_YOUNG};
use crate::material::{Isochoric, Verdict};
use crate::model::Model;
use crate::needle::Tool;
use crate::scene::{Face, RegionShape, Scene};
use crate::simulation::advice::{COARSEST, MOST_JUMP, edge_jump, mean_edge, puncture_pressure};

/// Largest speed of a tool [m/s].
const MOST_SPEED: f64 = 0.2;
/// Largest Poisson's ratio.
const MOST_NU: f64 = 0.499;
/// Largest ratio of the moduli of two materials.
const MOST_CONTRAST: f64 = 30.0;
/// Least puncture force over section of the needle and Young's modulus.
const LEAST_PRESSURE: f64 = 0.5;
/// Toughness over shear modulus and radius of the needle, where it opens its path.
const TOUGHNESS: RangeInclusive<f64> = 0.5..=20.0;
/// Strain of a driven face: pressed, pulled, sheared; its twist [rad]; a load over Young's modulus.
const MOST_PRESSED: f64 = 0.35;
const MOST_PULLED: f64 = 0.5;
const MOST_TWIST: f64 = PI / 2.0;
const MOST_LOAD: f64 = 0.3;

/// Why a scene with the stable step `stable_dt` [s] is beyond what a user would do; empty: it is reasonable.
pub fn beyond(model: &Model, stable_dt: f64) -> Vec<String> {
    let scene = &model.scene;
    let mut why = Vec::new();
    let mut not = |holds: bool, text: String| {
        // A comparison with what is no number does not hold either.
        if !holds {
            why.push(text);
        }
    };
    let materials: Vec<&TissueMaterial> =
        std::iter::once(&scene.material).chain(scene.regions.iter().map(|r| &r.material)).collect();
    let scaling = model.mass_scaling();
    let wave =
        materials.iter().map(|m| (m.law.shear_modulus() / (m.density * scaling)).sqrt()).fold(f64::INFINITY, f64::min);
    let tool = scene.tool.is_some().then_some(&scene.motion);
    let loading = Loading::of(tool, &scene.faces, scene.tissue.size).with_loads(&scene.loads, scene.tissue.size);
    let (mach, passages) = (loading.mach(wave), loading.passages(wave));
    // What a scene is told before it runs, here with its softest material.
    not(mach <= MOST_MACH, format!("moves at {mach:.3} of the scaled shear wave speed"));
    not(
        passages >= FEWEST_PASSAGES,
        format!("moves or loads a face within {passages:.1} passages of a scaled shear wave"),
    );
    not(loading.tool_speed <= MOST_SPEED, format!("tool at {:.2} m/s", loading.tool_speed));
    let youngs: Vec<f64> = materials.iter().map(|m| m.law.youngs_modulus()).collect();
    let (softest, stiffest) = youngs.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), e| (a.min(*e), b.max(*e)));
    not(stiffest <= MOST_CONTRAST * softest, format!("moduli 1 : {:.0}", stiffest / softest));
    for material in &materials {
        let nu = material.law.poisson_ratio();
        not((0.0..=MOST_NU).contains(&nu), format!("nu {nu:.4}"));
        not(matches!(material.law.verdict(), Verdict::Stable), "law of limited stability".into());
        match material.law.isochoric {
            Isochoric::Ogden(law) => not((1.0..=10.0).contains(&law.alpha.abs()), format!("alpha {:.1}", law.alpha)),
            Isochoric::Demiray(law) => not(law.b <= 10.0, format!("b {:.1}", law.b)),
            Isochoric::Yeoh(law) => {
                not(law.c20.max(law.c30) <= 3.0 * law.c10, format!("c20/c10 {:.1}", law.c20.max(law.c30) / law.c10));
            }
            _ => {}
        }
    }
    cells(model, &mut not);
    needle(model, &materials, &mut not);
    indenter(scene, &mut not);
    faces(model, softest, &mut not);
    effects(model, &materials, softest, &mut not);
    let solver = &scene.solver;
    not((0.3..=0.9).contains(&solver.safety), format!("safety {:.2}", solver.safety));
    if let Some(step) = solver.time_step {
        not(step <= 0.9 * stable_dt, format!("own step {:.2} of the stable one", step / stable_dt));
    }
    not(solver.mass_damping <= 200.0, format!("damping {:.0} 1/s", solver.mass_damping));
    not((0.03..=1.0).contains(&solver.hourglass_stiffness), format!("hourglass {:.2}", solver.hourglass_stiffness));
    why
}

fn cells(model: &Model, not: &mut impl FnMut(bool, String)) {
    let scene = &model.scene;
    let h = scene.tissue.cell_size;
    match &scene.tool {
        Some(Tool::Needle(needle)) => {
            let across = h / (2.0 * needle.radius);
            not(across <= COARSEST, format!("cells of {across:.2} needle diameters"));
            not(h >= 0.25e-3, format!("cells of {:.2} mm", h * 1e3));
        }
        Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. }) => {
            not(*radius >= 1.5 * h, format!("indenter of {:.1} cells", radius / h));
        }
        None => not(scene.tissue.size.min_element() >= 3.0 * h, "fewer than 3 cells across".into()),
    }
    for region in &scene.regions {
        let thick = match &region.shape {
            RegionShape::Layer { top, bottom } => bottom - top,
            RegionShape::Sphere { radius, .. } | RegionShape::Cylinder { radius, .. } => 2.0 * radius,
            _ => f64::INFINITY,
        };
        not(thick >= 0.95 * h, format!("region `{}` of {:.1} cells", region.name, thick / h));
    }
}

fn needle(model: &Model, materials: &[&TissueMaterial], not: &mut impl FnMut(bool, String)) {
    let scene = &model.scene;
    let (Some(Tool::Needle(needle)), Some(puncture)) = (&scene.tool, &scene.effects.puncture) else { return };
    let h = scene.tissue.cell_size;
    let area = PI * needle.radius.powi(2);
    let mut hardest = 0.0_f64;
    let opened = model.puncture.as_ref().filter(|plan| plan.opening.is_some());
    for material in materials {
        let forces = material.cutting.map(|c| (c.puncture_force, c.cutting_force));
        let (force, cutting) = forces.unwrap_or((puncture.puncture_force, puncture.cutting_force));
        if opened.is_some() {
            let part = material.toughness.unwrap_or_default() / (material.law.shear_modulus() * needle.radius);
            not(TOUGHNESS.contains(&part), format!("toughness of {part:.1} mu R"));
            continue;
        }
        let pressure = force / (area * material.law.youngs_modulus());
        hardest = hardest.max(force);
        not(pressure >= LEAST_PRESSURE, format!("puncture force of {pressure:.1} E over the section"));
        not(cutting <= force, "cutting force above the puncture force".into());
        if let Some(energy) = material.membrane_energy {
            not(energy <= 2e-3 * force, format!("membrane of {:.2} mJ", energy * 1e3));
        }
    }
    if let Some(plan) = opened {
        hardest = plan.segments.iter().fold(0.0, |most, segment| segment.cutting.puncture_force.max(most));
    }
    let (over_young, over_bulk) = puncture_pressure(scene).unwrap_or_default();
    not(over_young <= MOST_PRESSURE_OVER_YOUNG, format!("puncture force of {over_young:.1} E over the section"));
    not(over_bulk <= MOST_PRESSURE_OVER_BULK, format!("puncture force of {over_bulk:.1} K over the section"));
    let motion = &scene.motion;
    let through = motion.deepest_point().z < -scene.tissue.size.z;
    not(through || motion.deepest_point().z >= 1.9 * h - scene.tissue.size.z, "ends beside the bottom".into());
    let half = 0.5 * scene.tissue.size;
    let margin = needle.radius + 1.9 * h;
    for sample in motion.samples(0.5e-3) {
        let beside = (half - sample.tip.abs()).truncate().min_element();
        if sample.depth > 0.0 && beside < margin {
            not(false, format!("passes {:.1} mm beside a side", beside * 1e3));
            break;
        }
    }
    if motion.is_free() {
        let (from, to) = motion.reach(scene.tissue.size.z);
        let sideways = (to - from).truncate().max_element();
        let moved = motion.phases.iter().any(|p| matches!(p, crate::needle::Phase::Move { .. }));
        not(!moved || sideways <= 2.0 * needle.radius + motion.deepest(), "dragged sideways".into());
    }
    not(motion.phases.len() <= 4, "many phases".into());
    let turned = motion.phases.iter().any(|p| match p {
        crate::needle::Phase::Turn { direction, .. } => direction.angle_between(motion.direction) > 10f64.to_radians(),
        _ => false,
    });
    not(!turned, "turned by more than 10 degrees in the tissue".into());
    if let Some(vibration) = motion.vibration {
        not(vibration.amplitude <= 0.5e-3, "large vibration".into());
    }
    not(
        (0.3e3..=10e3).contains(&puncture.tip_stiffness),
        format!("tip springs of {:.1} N/mm", puncture.tip_stiffness * 1e-3),
    );
    not((0.2e-3..=1.5e-3).contains(&puncture.transition_length), "unusual transition length".into());
    not((0.5..=5.0).contains(&puncture.contact_stiffness_factor), "unusual contact stiffness".into());
    not((0.01..=0.2).contains(&puncture.residual_stiffness), "unusual residual stiffness".into());
    not(puncture.contact_damping <= 0.6 && puncture.entry_fade >= 0.5e-3, "unusual contact".into());
    if let Some(beam) = &scene.effects.flexible_needle {
        let (outer, inner) = (beam.beam.section.outer_diameter, beam.beam.section.inner_diameter);
        let bending = beam.beam.youngs_modulus * PI * (outer.powi(4) - inner.powi(4)) / 64.0;
        let load = PI * PI * bending / (0.7 * beam.beam.length).powi(2);
        not(hardest <= 0.5 * load, format!("puncture at {:.1} of the buckling load", hardest / load));
    }
    if let Some(friction) = &scene.effects.friction {
        not(friction.coefficient <= 0.6, format!("friction {:.2}", friction.coefficient));
    }
    if let Some(adhesion) = &scene.effects.adhesion {
        not(adhesion.static_force <= hardest, "sticks more than it cuts".into());
    }
}

fn indenter(scene: &Scene, not: &mut impl FnMut(bool, String)) {
    let radius = match &scene.tool {
        Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. }) => *radius,
        _ => return,
    };
    let depth = scene.motion.deepest();
    not(depth <= 0.85 * radius, format!("indented by {:.1} radii", depth / radius));
    not(depth <= 0.25 * scene.tissue.size.z, format!("indented by {:.2} of the block", depth / scene.tissue.size.z));
    if let Some(indentation) = &scene.effects.indentation {
        not((0.2..=5.0).contains(&indentation.stiffness_factor), "unusual contact stiffness".into());
    }
}

fn faces(model: &Model, softest: f64, not: &mut impl FnMut(bool, String)) {
    let scene = &model.scene;
    let jump = edge_jump(scene).map_or(0.0, |(jump, ..)| jump / mean_edge(&model.mesh));
    not(jump <= MOST_JUMP, format!("a face moves by {jump:.1} cells against one that holds their edge"));
    for (face, condition) in Face::ALL.iter().zip(&scene.faces) {
        let length = scene.tissue.size[face.axis()];
        if let Some(drive) = condition.drive {
            let outwards = if face.is_max() { 1.0 } else { -1.0 };
            let along = drive.displacement[face.axis()] * outwards / length;
            not(
                (-MOST_PRESSED..=MOST_PULLED).contains(&along) && drive.displacement.length() <= MOST_PULLED * length,
                format!("face {} moves by {along:.2} of the block", face.key()),
            );
            not(drive.rotation.abs() <= MOST_TWIST, format!("twist of {:.0} deg", drive.rotation.to_degrees()));
        }
        if let Some(traction) = condition.traction {
            not(traction.length() <= MOST_LOAD * softest, format!("load of {:.2} E", traction.length() / softest));
            not(condition.traction_ramp > 0.0, "load that comes at once".into());
            let outwards = if face.is_max() { 1.0 } else { -1.0 };
            let pressure = -traction[face.axis()] * outwards;
            // A block without hold across an axis is a cantilever there: Euler's load P = pi^2 E I / (2 L)^2 with I/A = w^2/12.
            for across in (0..3).filter(|axis| *axis != face.axis()) {
                let is_free = |other: &Face| other.axis() != across || scene.faces[*other as usize].fixed == [false; 3];
                if Face::ALL.iter().all(is_free) {
                    let slenderness = length / scene.tissue.size[across];
                    let buckling = PI.powi(2) / 48.0 * softest / slenderness.powi(2);
                    not(
                        pressure <= 0.5 * buckling,
                        format!("pressed by {:.2} of its buckling load", pressure / buckling),
                    );
                    let bending = 6.0 * traction[across].abs() * slenderness / softest;
                    not(bending <= MOST_LOAD, format!("bends under a load to a strain of {bending:.2}"));
                }
            }
        }
    }
}

fn effects(model: &Model, materials: &[&TissueMaterial], softest: f64, not: &mut impl FnMut(bool, String)) {
    let scene = &model.scene;
    let height = scene.tissue.size.max_element();
    if let Some(gravity) = &scene.effects.gravity {
        let sag = scene.material.density * gravity.acceleration.length() * height / softest;
        not(sag <= 0.1, format!("weight of {sag:.2} E"));
        not(gravity.acceleration.length() <= 10.0, "more than one g".into());
    }
    for material in materials {
        let shear = material.law.shear_modulus();
        if let Some(flow) = scene.effects.plasticity.map(|p| material.plasticity.unwrap_or(p)) {
            let stress = flow.yield_stress / material.law.youngs_modulus();
            not(stress >= 0.1, format!("yields at {stress:.3} E"));
            not(
                flow.hardening <= 20.0 * material.law.youngs_modulus(),
                format!("hardens with {:.0} E", flow.hardening / material.law.youngs_modulus()),
            );
        }
        if let Some(fibres) = scene.effects.fibres.map(|p| material.fibres.unwrap_or(p)) {
            not(
                fibres.k1 <= 5.0 * shear && fibres.k2 <= 3.0,
                format!("fibres {:.1} mu, {:.1}", fibres.k1 / shear, fibres.k2),
            );
        }
    }
    if let Some(cohesive) = &scene.effects.cohesive {
        let law = Law::new(cohesive, scene.material.law.youngs_modulus(), scene.tissue.cell_size);
        for share in [0.0, 1.0] {
            let (onset, end) = law.openings(share);
            not(end >= 2.0 * onset, format!("bond that fails at {:.2} of its onset", end / onset));
        }
        let strength = cohesive.strength.max(cohesive.shear_strength) / scene.material.law.youngs_modulus();
        not((0.05..=6.0).contains(&strength), format!("bond of {strength:.2} E"));
        let hung = hung_load(scene, cohesive);
        not(hung <= 1.0, format!("a dead load of {hung:.1} of the bond that it hangs on"));
    }
}

/// Largest nominal stress of a dead load on a plane that may part, across the plane and bending included, over the strength of the bond:
/// beyond 1 what hangs on the bond flies away for as long as the run lasts.
fn hung_load(scene: &Scene, cohesive: &crate::effects::cohesive::Params) -> f64 {
    let centre = 0.5 * glam::DVec3::new(0.0, 0.0, -scene.tissue.size.z);
    let stress = |plane: &crate::effects::cohesive::Plane| {
        let on = Face::ALL.into_iter().filter(|f| f.axis() == plane.axis).filter_map(|face| {
            let load = scene.faces[face as usize].traction?;
            let half = if face.is_max() { 0.5 } else { -0.5 } * scene.tissue.size[plane.axis];
            let arm = (centre[plane.axis] + half - plane.at).abs();
            let bending = (0..3).filter(|a| *a != plane.axis).map(|a| 6.0 * load[a].abs() * arm / scene.tissue.size[a]);
            let outwards = if face.is_max() { load[plane.axis] } else { -load[plane.axis] };
            Some(
                (outwards.max(0.0) + bending.sum::<f64>())
                    .hypot(load.reject_from(glam::DVec3::AXES[plane.axis]).length()),
            )
        });
        on.fold(0.0, f64::max)
    };
    cohesive.planes.iter().map(stress).fold(0.0, f64::max) / cohesive.strength.min(cohesive.shear_strength)
}
