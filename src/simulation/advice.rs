//! What a scene is told before it runs: what in it will make the answer worse than its numbers look, from the scene and the mesh
//! alone. Each bound has a reason of its own; random scenes that keep all of them are the reasonable ones
//! ([`crate::stability::random`]).

use std::collections::BTreeSet;

use glam::DVec3;

use crate::effects::TissueMaterial;
use crate::effects::mass_scaling::{AUTO_MACH, AUTO_PASSAGES, FEWEST_PASSAGES, Loading, MOST_MACH};
use crate::effects::puncture::{MOST_PRESSURE_OVER_BULK, MOST_PRESSURE_OVER_YOUNG, SchemeWord};
use crate::mesh::Mesh;
use crate::model::Model;
use crate::scene::{Face, Scene};

/// Cells over the diameter of a needle beyond which a scene is told that they are coarse: there hourglass shapes held a fifth of the
/// internal energy.
pub const COARSEST: f64 = 0.7;

/// The same where the path is opened by its map, [needle diameters]: 0.88 and 0.55 of them differ by 1 % in the puncture force and 8 % in the
/// friction (a needle of 20G in the neck), 0.77 and 0.50 by 0.6 and 2 % (forearm).
const COARSEST_OPENED: f64 = 0.9;

/// The same for tetrahedra that are too fine: with 0.34 some turned inside out, with 0.41 none.
pub const FINEST_TETRAHEDRA: f64 = 0.4;

/// Largest jump of prescribed motion at an edge of the tissue, in cells: an edge of one cell length turns over at 1, and the cell beside
/// it, whose other nodes are free, at a little more than half of that.
pub const MOST_JUMP: f64 = 0.5;

/// All that is told, one sentence each.
pub fn advice(model: &Model) -> Vec<String> {
    let parts = [inertia_that_shows, unfit_cells, deep_dimple, torn_edge];
    parts.iter().filter_map(|part| part(model)).collect()
}

/// Largest tool speed over the shear wave speed at the scaled density; `None` without a tool.
pub fn tool_mach(model: &Model) -> Option<f64> {
    let wave = (model.scene.material.law.shear_modulus() / model.scaled_density()).sqrt();
    model.kinematics.is_some().then(|| model.scene.motion.largest_speed() / wave)
}

/// What will make the scaled inertia show in the force, if anything.
fn inertia_that_shows(model: &Model) -> Option<String> {
    let scene = &model.scene;
    let loading = Loading::of(model.kinematics.is_some().then_some(&scene.motion), &scene.faces, scene.tissue.size)
        .with_loads(&scene.loads, scene.tissue.size);
    let wave = (scene.material.law.shear_modulus() / model.scaled_density()).sqrt();
    let (mach, passages) = (loading.mach(wave), loading.passages(wave));
    let what = match (mach > MOST_MACH, passages < FEWEST_PASSAGES && model.mass_scaling() > 1.0) {
        (true, _) => format!("the tool moves at {mach:.2} of the scaled shear wave speed"),
        (false, true) => {
            format!(
                "a face moves or a load grows within {passages:.1} passages of a scaled shear wave through the tissue"
            )
        }
        (false, false) => return None,
    };
    Some(format!(
        "{what}: inertia will show in the force; lower solver.mass_scaling (\"auto\" keeps to {AUTO_MACH} and {AUTO_PASSAGES} passages)"
    ))
}

/// Whether the cells are coarse against the needle, or tetrahedra too fine.
fn unfit_cells(model: &Model) -> Option<String> {
    let plan = model.puncture.as_ref()?;
    // Cells of a mesh are as large as those on the path are on the mean, as edges of regular tetrahedra.
    let edge = match &model.mesh {
        Mesh::Block(_) => model.scene.tissue.cell_size,
        Mesh::Tets(mesh) => {
            let on_path: BTreeSet<u32> = match &plan.opening {
                Some(opening) => opening.clusters.iter().map(|cluster| cluster.cell).collect(),
                None => plan.cells.iter().map(|path| path.cell).collect(),
            };
            let volume: f64 = on_path.iter().map(|cell| mesh.volume(*cell as usize)).sum();
            (6.0 * std::f64::consts::SQRT_2 * volume / on_path.len().max(1) as f64).cbrt()
        }
    };
    let across = edge / (2.0 * plan.needle.radius);
    if across < FINEST_TETRAHEDRA && model.mesh.as_tets().is_some() && plan.opening.is_none() {
        return Some(format!(
            "tetrahedra of {across:.2} needle diameters on the path: under a tip so fine ones turn inside out, since its springs pull at \
             single nodes; a mesh with edges of {FINEST_TETRAHEDRA} to {COARSEST} diameters there is advised"
        ));
    }
    if plan.opening.is_some() {
        return (across > COARSEST_OPENED).then(|| {
            format!(
                "cells of {across:.2} needle diameters: the opened path was compared on cells of up to {COARSEST_OPENED}; finer ones are advised"
            )
        });
    }
    (across > COARSEST).then(|| {
        format!(
            "cells of {across:.2} needle diameters: the tip bends them rather than parting them, and the force depends on the mesh; \
             {} of half a diameter or less is advised",
            if model.mesh.as_tets().is_some() { "a mesh with cells" } else { "tissue.cell_size_mm" }
        )
    })
}

/// Largest puncture force over the section of the needle, as parts of Young's modulus and of the bulk modulus of the material that holds
/// it, with the rate of the fastest motion; `None` without a needle that punctures, and where it opens its path.
pub fn puncture_pressure(scene: &Scene) -> Option<(f64, f64)> {
    let (needle, puncture) = (scene.needle()?, scene.effects.puncture.as_ref()?);
    // There the theory says what the tissue bears.
    if puncture.scheme == SchemeWord::Opening {
        return None;
    }
    let section = std::f64::consts::PI * needle.radius.powi(2);
    let rate = puncture.rate_factor(scene.motion.largest_speed());
    let materials = std::iter::once(&scene.material).chain(scene.regions.iter().map(|r| &r.material));
    let parts = materials.map(|material: &TissueMaterial| {
        let force = material.cutting.map_or(puncture.puncture_force, |c| c.puncture_force);
        let pressure = rate * force / section;
        (pressure / material.law.youngs_modulus(), pressure / material.law.bulk_modulus)
    });
    Some(parts.fold((0.0, 0.0), |most, part| (f64::max(most.0, part.0), f64::max(most.1, part.1))))
}

/// Whether a surface holds the tip for longer than tissue does.
fn deep_dimple(model: &Model) -> Option<String> {
    let (over_young, over_bulk) = puncture_pressure(&model.scene)?;
    let what = if over_young > MOST_PRESSURE_OVER_YOUNG {
        format!(
            "{over_young:.1} times Young's modulus (tissue gives way at {MOST_PRESSURE_OVER_YOUNG} at most, by the theory of sharp penetration)"
        )
    } else if over_bulk > MOST_PRESSURE_OVER_BULK {
        format!(
            "{over_bulk:.1} times the bulk modulus (the law holds no more than one; soft tissue has a poisson_ratio of 0.45 to 0.499)"
        )
    } else {
        return None;
    };
    Some(format!(
        "the puncture force over the section of the needle is {what}: the tip will press cells flat before they give way; lower \
         puncture_force_n or take a thicker needle"
    ))
}

/// Largest jump of the prescribed motion at an edge that two faces share [m], and the faces; `None` where no face moves against another.
///
/// Components that both faces prescribe: what a moved face wants, less what its neighbour holds or wants, at the ends and in the middle
/// of their edge.
pub fn edge_jump(scene: &Scene) -> Option<(f64, Face, Face)> {
    let half = 0.5 * scene.tissue.size;
    // From the centre of the block.
    let normal = |face: Face| {
        let mut out = DVec3::ZERO;
        out[face.axis()] = if face.is_max() { half[face.axis()] } else { -half[face.axis()] };
        out
    };
    let wanted = |face: Face, at: DVec3| {
        let Some(drive) = scene.faces[face as usize].drive else { return DVec3::ZERO };
        let mut axis = DVec3::ZERO;
        axis[face.axis()] = 1.0;
        let arm = at - normal(face);
        let (sine, cosine) = drive.rotation.sin_cos();
        drive.displacement + axis.cross(arm) * sine - (arm - axis * axis.dot(arm)) * (1.0 - cosine)
    };
    let mut worst: Option<(f64, Face, Face)> = None;
    for moved in Face::ALL.into_iter().filter(|f| scene.faces[*f as usize].drive.is_some()) {
        for other in Face::ALL.into_iter().filter(|f| f.axis() != moved.axis()) {
            let along = 3 - moved.axis() - other.axis();
            for place in [-1.0, 0.0, 1.0] {
                let mut at = normal(moved) + normal(other);
                at[along] = place * half[along];
                let mut jump = wanted(moved, at) - wanted(other, at);
                for axis in 0..3 {
                    if !scene.faces[moved as usize].fixed[axis] || !scene.faces[other as usize].fixed[axis] {
                        jump[axis] = 0.0;
                    }
                }
                if jump.length() > worst.map_or(0.0, |w| w.0) {
                    worst = Some((jump.length(), moved, other));
                }
            }
        }
    }
    worst
}

/// Edge of a cell of this mesh [m]: of a cube of its mean volume, six tetrahedra to a cube.
pub fn mean_edge(mesh: &Mesh) -> f64 {
    let volume: f64 = (0..mesh.cell_count()).map(|cell| mesh.cell_volume(cell)).sum();
    let cubes = match mesh {
        Mesh::Block(_) => mesh.cell_count() as f64,
        Mesh::Tets(_) => mesh.cell_count() as f64 / 6.0,
    };
    (volume / cubes.max(1.0)).cbrt()
}

/// Whether a face moves against another one that holds their common edge.
fn torn_edge(model: &Model) -> Option<String> {
    let (jump, moved, other) = edge_jump(&model.scene)?;
    let cells = jump / mean_edge(&model.mesh);
    (cells > MOST_JUMP).then(|| {
        format!(
            "{moved} moves by {:.3} mm ({cells:.1} cells) against {other}, which prescribes their common edge, too: the cells there fold \
             whatever their size; boundaries.{other} = \"free\", or \"roller\" where it moves along, does not hold it",
            jump * 1e3,
            moved = moved.key(),
            other = other.key()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::scene::FaceDrive;

    fn scene(text: &str) -> Scene {
        Scene::parse(std::path::Path::new("test.toml"), text, &[]).unwrap()
    }

    fn model(scene: Scene) -> Model {
        let mesh = Mesh::of_scene(&scene);
        Model::new(scene, mesh)
    }

    const MAIN: &str = "effects = [\"puncture\"]\n[tissue]\nsize_mm = [12.0, 12.0, 8.0]\ncell_size_mm = 0.8\n[material]\n\
        law = \"neo_hookean\"\nyoungs_modulus_kpa = 30.0\npoisson_ratio = 0.47\n[needle]\ngauge = \"16G\"\ntip_half_angle_deg = 18\n\
        [[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = 2.0\ndepth_mm = 4.0\n";

    #[test]
    fn a_surface_that_tissue_has_not_is_told() {
        let told = |force: f64, nu: f64| {
            let text = MAIN.replace("0.47", &nu.to_string());
            let scene = scene(&format!("{text}[puncture]\npuncture_force_n = {force}\ncutting_force_n = 0.1\n"));
            advice(&model(scene)).into_iter().find(|a| a.contains("section of the needle"))
        };
        // 16G: 2.138 mm2; 30 kPa times that is 64 mN.
        assert_eq!(told(0.4, 0.47), None);
        assert!(told(0.5, 0.47).is_some_and(|t| t.contains("7.8 times Young's modulus")), "{:?}", told(0.5, 0.47));
        assert!(told(0.4, 0.2).is_some_and(|t| t.contains("11.2 times the bulk modulus")), "{:?}", told(0.4, 0.2));
    }

    #[test]
    fn a_face_that_moves_against_a_held_one_is_told() {
        let text = "effects = []\n[tissue]\nsize_mm = [4.0, 4.0, 4.0]\ncell_size_mm = 1.0\n[material]\nlaw = \"neo_hookean\"\n\
            youngs_modulus_kpa = 30.0\npoisson_ratio = 0.4\n[boundaries]\nx_min = \"SIDE\"\nx_max = \"free\"\ny_min = \"free\"\n\
            y_max = \"free\"\nz_max = { fixed = [\"x\", \"y\", \"z\"], displacement_mm = [0.0, 0.0, -0.8], duration_s = 1.0 }\n\
            [solver]\nduration_s = 1.0\n";
        let held = scene(&text.replace("SIDE", "fixed"));
        let (jump, moved, other) = edge_jump(&held).unwrap();
        assert!((jump - 0.8e-3).abs() < 1e-9);
        assert_eq!((moved, other), (Face::ZMax, Face::XMin));
        let told = advice(&model(held));
        assert!(told.iter().any(|t| t.contains("z_max moves by 0.800 mm (0.8 cells) against x_min")), "{told:?}");
        for side in ["free", "roller"] {
            assert_eq!(edge_jump(&scene(&text.replace("SIDE", side))), None, "{side}");
        }
        // A quarter turn moves a corner of the top by twice its arm's share of 45 degrees.
        let mut turned = scene(&text.replace("SIDE", "fixed"));
        turned.faces[Face::ZMax as usize].drive = Some(FaceDrive {
            displacement: DVec3::ZERO,
            rotation: std::f64::consts::FRAC_PI_2,
            duration: 1.0,
            cycles: 0,
        });
        let corner = 2e-3 * 2f64.sqrt() * 2.0 * (std::f64::consts::FRAC_PI_4).sin();
        assert!((edge_jump(&turned).unwrap().0 - corner).abs() < 1e-12);
    }
}
