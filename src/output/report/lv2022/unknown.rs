//! What the paper leaves open, and what this model does not show.

use super::force::largest_difference;
use super::{Report, Role, predicts, rate_free};
use crate::needle::{TipShape, Tool};
use crate::output::page::{escape, table, words};
use crate::output::report::words::and;
use crate::scene::Scene;
use crate::units::trimmed;

/// What is not known, what the paper prints of it, and what is taken here.
#[derive(Default)]
struct Rows(Vec<Vec<String>>);

impl Rows {
    fn add(&mut self, what: &str, paper: &str, here: String) {
        self.0.push(vec![escape(what), escape(paper), escape(&here)]);
    }
}

impl Report {
    pub(super) fn unknown(&self) -> String {
        let Some(case) = self.speeds().first().copied() else {
            return String::new();
        };
        let scene = &case.scene;
        let mut rows = Rows::default();
        of_needle(scene, &mut rows);
        of_tissue(scene, &mut rows);
        let scalings: Vec<String> = self.speeds().iter().map(|c| format!("{:.0}", c.summary.mass_scaling)).collect();
        rows.add("time step and mass scaling", "not printed", format!("mass scaling {}", and(&scalings)));
        rows.add("number of experiments behind Fig. 12, their scatter", "not printed", "one run per speed".into());
        let friction = scene.effects.friction.map_or("no friction".into(), |f| {
            format!("friction {} on the shaft, none on the tip", trimmed(f.coefficient))
        });
        table("words", "", &[words("what"), words("the paper"), words("here")], &rows.0)
            + &format!(
                "<p>As in the paper: the three speeds, the depths, insertion straight down, {}.</p>\n",
                escape(&friction)
            )
    }

    pub(super) fn missing(&self) -> String {
        let speeds = self.speeds();
        let Some(case) = speeds.first() else {
            return String::new();
        };
        let on = |key: &str| case.summary.effects.iter().any(|e| e == key);
        let mut items = Vec::new();
        if rate_free(&case.scene) {
            let measured = largest_difference(&speeds).map_or(String::new(), |d| {
                format!(" The force at one depth differs by at most {d:.3} N between them.")
            });
            items.push(format!(
                "A rate effect. No law of these scenes contains a rate; what differs between the speeds is the little \
                 inertia and damping that is left.{measured}"
            ));
        }
        if !on("adhesion") {
            items.push(
                "The paper's many drops. Nothing sticks to the tip here, so no \"built-up edge\" grows and breaks off, and \
                 their number cannot rise with speed."
                    .into(),
            );
        }
        let materials = std::iter::once(&case.scene.material).chain(case.scene.regions.iter().map(|r| &r.material));
        if materials.into_iter().all(|material| material.membrane_energy.is_none()) {
            items.push(
                match predicts(&case.scene) {
                    true => {
                        "An outer membrane (\"biological valve\"). The surface opens at three times the steady force of the tip, as \
                         the same tissue does under a cone that has not entered it."
                    }
                    false => {
                        "An outer membrane (\"biological valve\"). The larger force that opens the surface stands for it."
                    }
                }
                .into(),
            );
        }
        let path = match predicts(&case.scene) {
            true => "tissue that lies on the needle",
            false => "softened cells and a ring of nodes that the needle pushes aside",
        };
        items.push(format!(
            "Separated faces. The opened path is {path}; a gap between tissue and needle that widens with speed (Fig. 11) \
             cannot appear."
        ));
        if !on("flexible_needle") {
            items.push(
                "A flexible needle, its weight and the vibration of the platform, by which the paper explains its region Z."
                    .into(),
            );
        }
        if self.of(Role::Hollow).next().is_none() {
            items.push("The hollow needle, its core and the biopsy itself.".into());
        }
        let list: String = items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
        format!("<ul>\n{list}</ul>\n")
    }
}

/// Rows on the needle.
fn of_needle(scene: &Scene, rows: &mut Rows) {
    if let Some(Tool::Needle(needle)) = &scene.tool {
        rows.add(
            "needle",
            "diameter and wall not printed; drawn hollow",
            format!("{}, diameter {:.3} mm, solid", needle.name, 2e3 * needle.radius),
        );
        let tip = match needle.tip {
            TipShape::Cone => {
                format!("cone with a half angle of {:.1} deg", needle.tip_slope().atan().to_degrees())
            }
            TipShape::Bevel { .. } => format!("bevel of {} mm", trimmed(needle.tip_length * 1e3)),
        };
        rows.add("tip", "shape not printed", tip);
    }
    rows.add(
        "material of the needle",
        "E 640000 MPa, 1.48e-8 g/mm^3 (lighter than air), nu 0.22",
        "rigid: none of the three is used".into(),
    );
}

/// Rows on the tissue and its separation.
fn of_tissue(scene: &Scene, rows: &mut Rows) {
    let effects = &scene.effects;
    let size = scene.tissue.size * 1e3;
    rows.add(
        "block of tissue",
        "size not printed; \"fixed coupling\"",
        format!("{} x {} x {} mm; {}", trimmed(size.x), trimmed(size.y), trimmed(size.z), held(scene)),
    );
    let law = &scene.material.law;
    rows.add(
        "elastic constants",
        "Table 1: C10 4.75, C01 -4.91, no unit. Their sum is negative: the tissue at rest is unstable in any unit",
        format!(
            "preset {}: {}, E {:.1} kPa, nu {:.3}; {}",
            scene.material.name,
            crate::material::describe_constants(law),
            law.youngs_modulus() * 1e-3,
            law.poisson_ratio(),
            scene.material.source
        ),
    );
    rows.add(
        "strains at yield and at failure",
        "only drawn (Fig. 2); printed are the strengths, 85 kPa along and 26 kPa across the fibres",
        match (effects.plasticity.is_some(), effects.damage.is_some()) {
            (false, false) => "not used: no plastic flow and no damage of the bulk in these runs".into(),
            _ => "from the preset; the strains are assumed".into(),
        },
    );
    rows.add(
        "failure displacement",
        "4e-6, no unit; as m or mm it dissipates almost nothing",
        match effects.damage {
            None => "not used".into(),
            Some(_) => "of the effect damage".into(),
        },
    );
    if let (Some(p), Some(Tool::Needle(needle))) = (&effects.puncture, &scene.tool) {
        let calibrated = || {
            format!(
                "the tip needs {} N to open the surface and {} N to cut on ({:.0} J/m^2 over the diameter), falling \
                 over {} mm; cells within {} mm of its path keep {} % of their stiffness",
                trimmed(p.puncture_force),
                trimmed(p.cutting_force),
                p.cutting_force / (2.0 * needle.radius),
                trimmed(p.transition_length * 1e3),
                trimmed(p.softened_radius * 1e3),
                trimmed(p.residual_stiffness * 100.0)
            )
        };
        let law = match scene.material.toughness {
            Some(toughness) if predicts(scene) => {
                format!(
                    "a slit that costs {} J/m^2, as long as makes the force of the tip least; the surface opens at three \
                     times that force",
                    trimmed(toughness)
                )
            }
            _ => calibrated(),
        };
        rows.add("separation law", "\"bilinear cohesion model\" without strength, stiffness or energy", law);
    }
    rows.add("density of the tissue", "not printed", format!("{} kg/m^3", trimmed(scene.material.density)));
    rows.add(
        "stress relaxation",
        "said to be measured; no number printed",
        if effects.viscoelastic.is_some() { "Prony series of the scene" } else { "none" }.into(),
    );
}

/// What holds the block, in words.
fn held(scene: &Scene) -> String {
    let held: Vec<&str> = scene
        .faces
        .iter()
        .zip(crate::scene::Face::ALL)
        .filter(|(condition, _)| condition.fixed == [true; 3])
        .map(|(_, face)| face.key())
        .collect();
    match held[..] {
        ["x_min", "x_max", "y_min", "y_max", "z_min"] => "sides and bottom held, top free".into(),
        [] => "no face held".into(),
        _ => format!("held: {}", held.join(", ")),
    }
}
