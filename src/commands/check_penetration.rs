//! What `stylet check` says of the needle in the tissue: slit, forces and slope that follow from toughness and law, beside the forces that
//! the scene has by calibration. Each number with its formula.

use crate::effects::TissueMaterial;
use crate::effects::puncture::{Cutting, Params, SchemeWord};
use crate::material::{ElasticLaw, describe_constants};
use crate::needle::{NeedleShape, TipShape, Tool};
use crate::penetration::steady::MOST_OPENED;
use crate::penetration::surface::Surface;
use crate::penetration::{Ring, Steady};
use crate::scene::Scene;
use crate::units::four_digits;

/// Step along the path in which layers are told apart [m].
const STEP: f64 = 1e-5;

/// The lines on a scene with a needle that punctures; none for others.
pub fn describe(scene: &Scene) -> Vec<String> {
    let (Some(Tool::Needle(needle)), Some(params)) = (&scene.tool, scene.effects.puncture) else { return Vec::new() };
    let regions = scene.regions.iter().map(|region| (format!("region {}", region.name), &region.material));
    let materials: Vec<_> = std::iter::once(("tissue".to_string(), &scene.material)).chain(regions).collect();
    if materials.iter().all(|(_, material)| material.toughness.is_none()) {
        return vec![
            "penetration  no toughness is known: nothing is predicted, and all tip forces are calibrated. Write toughness_j_m2 in \
             [material]"
                .into(),
        ];
    }
    let mut lines = vec![
        "penetration  what toughness, law and needle say by themselves (a slit wedged open, plane strain, no change of volume, steady):"
            .into(),
    ];
    let friction = scene.effects.friction.map_or(0.0, |p| p.coefficient);
    let depth = scene.motion.deepest();
    for (place, material) in materials {
        lines.push(format!("  {} ({place})", material.name));
        let mut of_material = describe_one(material, needle, &params, friction, depth);
        let series = scene.effects.viscoelastic.as_ref().map(|common| material.viscoelastic.as_ref().unwrap_or(common));
        if let Some(series) = series.filter(|_| params.scheme == SchemeWord::Opening && material.toughness.is_some()) {
            let lasting = 1.0 - series.terms.iter().map(|term| term.ratio).sum::<f64>();
            of_material.push(format!(
                "all this is tissue without time to relax; beside a needle that is held for long {} of what keeps the shape is left",
                four_digits(lasting)
            ));
        }
        lines.extend(of_material.into_iter().map(|text| format!("    {text}")));
    }
    if !scene.regions.is_empty() {
        lines.push(match through_layers(scene, needle, friction) {
            Some(force) => format!(
                "  through all layers at {} mm: {} N = F_tip of the last one + mu_f sum of N over the shaft",
                four_digits(depth * 1e3),
                four_digits(force)
            ),
            None => "  through all layers: no prediction, since one of them on the path has none".into(),
        });
    }
    lines
}

fn describe_one(
    material: &TissueMaterial,
    needle: &NeedleShape,
    params: &Params,
    friction: f64,
    depth: f64,
) -> Vec<String> {
    let steady = match material.steady(needle) {
        None => {
            let text = "toughness not known: no prediction; its tip forces are calibrated. Write toughness_j_m2 in its material";
            return vec![text.into()];
        }
        Some(Err(error)) => return vec![format!("no prediction: {error} ({})", describe_constants(&material.law))],
        Some(Ok(steady)) => steady,
    };
    let opened = (params.scheme == SchemeWord::Opening).then(|| steady.carried(&material.law.isochoric).ok()).flatten();
    let carried = opened.unwrap_or(steady);
    let mm = |length: f64| four_digits(length * 1e3);
    let n = |force: f64| four_digits(force);
    let slope = friction * steady.normal_force * 1e-3;
    let exponent = match needle.tip {
        TipShape::Cone => "n = 2 for a cone",
        TipShape::Bevel { .. } => "n = 2 for a bevel",
    };
    let [puncture, cutting] = in_scene(material, params);
    let mut lines = vec![
        format!(
            "toughness J_c {} J/m^2 over a slit of width 2a, J_c/(mu R) = {}",
            n(steady.resistance.toughness),
            n(steady.relative_toughness())
        ),
        format!(
            "slit a* = {} mm, where U + 2 a J_c is least; it presses like a round hole of radius {} mm",
            mm(steady.crack_half_length),
            mm(steady.hole_radius)
        ),
        format!(
            "steady tip force F_tip = U + 2 a J_c = {} + {} = {} N",
            n(steady.strain_energy),
            n(steady.tip_force - steady.strain_energy),
            n(steady.tip_force)
        ),
        format!(
            "normal force N = dU/dR = {} N/mm, friction slope mu_f N = {} x N = {} N/mm",
            n(steady.normal_force * 1e-3),
            n(friction),
            n(slope)
        ),
        change_of_volume(&carried, &material.law),
        format!("puncture force (n + 1) F_tip = {} N, {exponent}; {puncture}", n(steady.puncture_force)),
        format!(
            "depth of the tip at that force, on a half space: sqrt(F pi (1 - nu^2)/(2 c E tan(alpha))) = {} mm",
            mm(Surface::new(&material.law, needle).depth(steady.puncture_force))
        ),
        format!("cutting force of the tip springs F_tip - U of that hole = {} N; {cutting}", n(carried.cutting_force)),
        format!(
            "at {} mm: F_tip + mu_f N (depth - tip of {} mm) = {} N",
            mm(depth),
            mm(needle.tip_length),
            n(steady.force_at(depth, needle.tip_length, friction))
        ),
        wall(&steady),
    ];
    if steady.torn {
        lines[1] = format!(
            "slit a = pi R/(2 lambda_u) = {} mm; it presses like a round hole of radius {} mm",
            mm(steady.crack_half_length),
            mm(steady.hole_radius)
        );
    }
    if carried.hole_radius > steady.hole_radius {
        lines.insert(
            4,
            format!(
                "the scheme opening opens the path from a hole of {} mm, whose wall is stretched {MOST_OPENED} times: what lies within is \
                 left to the tip",
                mm(carried.hole_radius)
            ),
        );
    }
    if needle.bore.is_some()
        && let Ok(ring) = Ring::new(&material.law.isochoric, steady.resistance.toughness, needle.radius)
    {
        lines.push(format!(
            "ring instead of a slit: core of {} mm, where 2 pi c J_c + U is least, F_tip = {} N, N = {} N/mm",
            mm(ring.core_radius),
            n(ring.tip_force),
            n(ring.normal_force * 1e-3)
        ));
    }
    lines
}

/// What the compressibility of the law makes of it.
fn change_of_volume(steady: &Steady, law: &ElasticLaw) -> String {
    let nu = four_digits(law.poisson_ratio());
    match steady.with_change_of_volume(law) {
        Some((force, normal)) => format!(
            "tissue that changes its volume (nu {nu}) around that hole gives way: F_tip = {} N ({:+.1} %), N = {} N/mm ({:+.1} %)",
            four_digits(force),
            100.0 * (force / steady.tip_force - 1.0),
            four_digits(normal * 1e-3),
            100.0 * (normal / steady.normal_force - 1.0)
        ),
        None => format!("with the change of volume of nu {nu} no equilibrium was found"),
    }
}

/// What the run takes for the puncture and the cutting force.
fn in_scene(material: &TissueMaterial, params: &Params) -> [String; 2] {
    let said = |value: f64, whose: &str| format!("the run takes {} N ({whose})", four_digits(value));
    if let Some(Cutting { puncture_force, cutting_force }) = material.cutting {
        let puncture = match material.membrane_energy {
            Some(_) => "the run takes that of its membrane".into(),
            None => said(puncture_force, "calibrated, of this material"),
        };
        return [puncture, said(cutting_force, "calibrated, of this material")];
    }
    let opening = params.scheme == SchemeWord::Opening;
    let of = |value: f64, stated: bool| match (stated, opening) {
        (true, true) => said(value, "calibrated, beside the work that the scheme opening finds in the tissue itself"),
        (true, false) => said(value, "calibrated"),
        (false, true) => "the run takes this".into(),
        (false, false) => said(value, "calibrated, default"),
    };
    let mut puncture = of(params.puncture_force, params.puncture_stated);
    if opening && !params.puncture_stated {
        puncture += match material.membrane_energy {
            Some(_) => " and the force of its membrane at the surface; in an inner layer the crack is there already",
            None => " at the surface; in an inner layer the crack is there already",
        };
    }
    [puncture, of(params.cutting_force, params.cutting_stated)]
}

/// What the wall of the slit has to hold.
fn wall(steady: &Steady) -> String {
    let stretch = four_digits(steady.wall_stretch());
    match (steady.resistance.tear_stretch, steady.torn) {
        (Some(tear), true) => {
            let asked = steady.slit_stretch.map_or("more".into(), |s| four_digits(s).to_string());
            format!(
                "tears: the slit that the toughness alone makes would stretch its wall by {asked}, the tissue holds {}: it tears a wider \
                 one, with a larger F_tip and a smaller slope",
                four_digits(tear)
            )
        }
        (Some(tear), false) if tear < steady.wall_stretch() => format!(
            "wall stretch R over radius of that hole = {stretch}, above the tear stretch {}; along the slit it is pi R/(2 a*) = {}, \
             which the tissue holds",
            four_digits(tear),
            steady.slit_stretch.map_or(stretch, four_digits)
        ),
        (Some(tear), false) => format!("wall stretch {stretch}, below the tear stretch {}", four_digits(tear)),
        (None, _) => format!(
            "wall stretch R over radius of that hole = {stretch}: tissue that tears before has a wider slit, a larger F_tip and a \
             smaller slope; tear_stretch says when"
        ),
    }
}

/// Force at the deepest point with the materials that the path passes through [N]; `None` where one of them has no prediction.
fn through_layers(scene: &Scene, needle: &NeedleShape, friction: f64) -> Option<f64> {
    let steadies: Vec<Option<Steady>> = std::iter::once(&scene.material)
        .chain(scene.regions.iter().map(|region| &region.material))
        .map(|material| material.steady(needle).and_then(Result::ok))
        .collect();
    let at = |depth: f64| {
        let x = scene.motion.entry + scene.motion.direction * depth;
        steadies[scene.regions.iter().rposition(|r| r.shape.contains(x)).map_or(0, |i| i + 1)]
    };
    let depth = scene.motion.deepest();
    let mut force = at(depth - 0.5 * STEP)?.tip_force;
    let shaft = ((depth - needle.tip_length).max(0.0) / STEP).round() as usize;
    for i in 0..shaft {
        force += friction * at((i as f64 + 0.5) * STEP)?.normal_force * STEP;
    }
    Some(force)
}
