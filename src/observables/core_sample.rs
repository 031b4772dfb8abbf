//! The core that a hollow needle holds: what lies in its bore, read off the axis of the core.

use serde::{Deserialize, Serialize};

use crate::engine::State;
use crate::model::Model;
use crate::needle::ToolPose;

/// Core in the bore at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CoreSample {
    /// Length along the needle as it lies in the bore [m].
    pub length: f64,
    /// Rest length of the same material [m].
    pub rest_length: f64,
    /// Its mass [kg], without mass scaling.
    pub mass: f64,
    /// True once it has torn off at its base.
    pub severed: bool,
}

impl CoreSample {
    /// Axial strain, length over rest length less one; 0 for an empty bore.
    pub fn strain(&self) -> f64 {
        if self.rest_length > 0.0 { self.length / self.rest_length - 1.0 } else { 0.0 }
    }

    /// The core of a state; `None` without a hollow needle. Tissue counts as core where it was above the cut (above the tip's
    /// material coordinate, after severing above the torn layer) and lies behind the tip, within the bore's length.
    pub fn of(model: &Model, state: &State, pose: &ToolPose) -> Option<CoreSample> {
        let block = model.mesh.as_block()?;
        let bore = block.bore?;
        let plan = model.puncture.as_ref()?;
        let torn = plan.cells.iter().filter(|c| state.stiffness.get(c.cell as usize) == Some(&0.0));
        let torn_at = torn.map(|c| c.axial_start).reduce(f64::min);
        let base = torn_at.unwrap_or(state.tip_coordinate).min(state.tip_coordinate);
        let line = |axis: usize| block.lines[axis].iter().position(|x| *x == bore.centre[axis]);
        let (i, j) = (line(0)?, line(1)?);
        // Down from the top face: rest coordinate along the path, and place behind the tip.
        let places: Vec<(f64, f64)> = (0..block.nodes()[2])
            .rev()
            .map(|k| {
                let node = block.node_index(i, j, k);
                let x = block.rest_position(node);
                (-x.z, (x + state.displacement[node] - pose.tip).dot(-pose.direction))
            })
            .collect();
        let mut core = CoreSample { severed: torn_at.is_some(), ..Default::default() };
        for pair in places.windows(2) {
            let ((upper, s_upper), (lower, s_lower)) = (pair[0], pair[1]);
            if lower <= upper {
                continue;
            }
            // The part of the segment above the base and behind the tip.
            let by_base = ((base - upper) / (lower - upper)).clamp(0.0, 1.0);
            let by_tip = if s_upper <= 0.0 {
                0.0
            } else if s_lower >= 0.0 {
                1.0
            } else {
                s_upper / (s_upper - s_lower)
            };
            let part = f64::min(by_base, by_tip);
            core.rest_length += part * (lower - upper);
            core.length += part * (s_upper - s_lower);
        }
        let column: f64 = plan.cells.iter().map(|c| model.mesh.cell_volume(c.cell as usize)).sum();
        let height = plan.cells.iter().map(|c| c.axial_end).fold(0.0, f64::max);
        core.mass = core.rest_length * column / height * model.scene.material.density;
        Some(core)
    }
}
