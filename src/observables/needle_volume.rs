//! Tissue in the volume of the needle: where a contact lets it through, cells come to lie inside.

use glam::DVec3;

use crate::engine::State;
use crate::model::Model;
use crate::needle::ToolPose;
use crate::needle::centre_line::CentreLine;
use crate::needle::gap::Profile;

/// Cells whose centre lies within the wall of the needle: inside its outer surface and, of a hollow one, outside its bore.
/// Cells that the path has softened by more than half are the opened path itself and do not count. `line`: the centre-line of a
/// bent needle.
pub fn cells_in_needle(model: &Model, state: &State, pose: &ToolPose, line: Option<&CentreLine>) -> usize {
    let Some(plan) = &model.puncture else { return 0 };
    let profile = Profile::new(&plan.needle, pose.direction);
    let d = -pose.direction;
    let inside = |centre: DVec3| {
        let s = (centre - pose.tip).dot(d);
        let lever = centre - pose.tip - line.map_or(DVec3::ZERO, |l| l.at(s, 0.0).offset);
        match profile.bore {
            Some(_) => {
                let wall = |bore: bool| profile.tube_wall(lever, d, bore, (0.0, 0.0)).value;
                s > 0.0 && wall(false) > 0.0 && wall(true) > 0.0
            }
            None => {
                let (rc, _) = profile.section(s);
                s > 0.0 && (lever - d * s - profile.shift * rc).length() < rc
            }
        }
    };
    (0..model.mesh.cell_count())
        .filter(|cell| model.mesh.is_tissue(*cell) && state.stiffness.get(*cell).is_none_or(|s| *s > 0.5))
        .filter(|cell| {
            let nodes = model.mesh.cell_nodes(*cell);
            let place = |n: &usize| model.mesh.rest_position(*n) + state.displacement[*n];
            inside(nodes.iter().map(place).sum::<DVec3>() / nodes.len() as f64)
        })
        .count()
}
