//! The same scene with another edge of its cells.

use super::Scene;
use crate::error::{Error, Result};
use crate::units::trimmed;

const MM: f64 = 1e-3;

impl Scene {
    /// Overrides that give the same scene with cells `factor` times as wide. The inertia of the tissue stays what it is here, also where the scene
    /// has it chosen by the cells.
    ///
    /// # Errors
    /// `Error::Input` where the cells have no edge that can be chosen.
    pub fn wider_cells(&self, factor: f64) -> Result<Vec<String>> {
        if self.mesh.is_some() {
            return Err(Error::input(
                format!("the tissue of the scene {} is a mesh from a file: its cells cannot be chosen", self.name),
                "compare it with a coarser mesh of your own, or take a scene with tissue.cell_size_mm",
            ));
        }
        let cells = format!("tissue.cell_size_mm={}", trimmed(self.tissue.cell_size * factor / MM));
        let inertia = self.effects.mass_scaling.map(|p| format!("solver.mass_scaling={:?}", p.factor));
        Ok([cells].into_iter().chain(inertia).collect())
    }
}
