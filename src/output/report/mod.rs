//! Reports: finished runs beside the numbers of a publication, as one page.

pub mod lv2022;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::folder::{FORCE_TABLE, PictureMoment, SUMMARY};
use super::parts_chart::ForceStack;
use super::summary::Summary;
use crate::observables::ForceParts;
use crate::scene::Scene;
use crate::{Error, Result};

/// One run of a report, as its folder holds it.
#[derive(Debug, Clone)]
pub struct CaseResults {
    /// File stem of the scene.
    pub name: String,
    pub scene: Scene,
    pub folder: PathBuf,
    /// Moment at which the run was finished, in words.
    pub finished: String,
    pub summary: Summary,
    /// Everything that the summary file holds, keys that this version does not know included, in the order of the file.
    pub figures: Vec<(String, serde_json::Value)>,
    /// Columns of the force table by name; an empty cell is NaN.
    pub force: BTreeMap<String, Vec<f64>>,
}

impl CaseResults {
    /// Reads the folder of a run. The error tells the file and what is wrong with it.
    pub fn read(name: &str, scene: Scene, folder: &Path, finished: &str) -> Result<Self> {
        let path = folder.join(SUMMARY);
        let broken = |path: &Path, reason: &dyn std::fmt::Display| {
            Error::file(path, std::io::Error::other(format!("not what a run of this version writes: {reason}")))
        };
        let text = std::fs::read_to_string(&path).map_err(|reason| Error::file(&path, reason))?;
        let summary: Summary = serde_json::from_str(&text).map_err(|reason| broken(&path, &reason))?;
        let all: serde_json::Map<String, serde_json::Value> =
            serde_json::from_str(&text).map_err(|reason| broken(&path, &reason))?;
        let mut figures: Vec<(String, serde_json::Value)> = all.into_iter().collect();
        figures.sort_by_key(|(key, _)| text.find(&format!("\"{key}\":")));

        let path = folder.join(FORCE_TABLE);
        let mut reader = csv::Reader::from_path(&path).map_err(|reason| Error::file(&path, reason.into()))?;
        let names: Vec<String> =
            reader.headers().map_err(|reason| broken(&path, &reason))?.iter().map(str::to_string).collect();
        let mut force: BTreeMap<String, Vec<f64>> = names.iter().map(|name| (name.clone(), Vec::new())).collect();
        for row in reader.records() {
            let row = row.map_err(|reason| broken(&path, &reason))?;
            for (name, field) in names.iter().zip(row.iter()) {
                let value = if field.is_empty() { Ok(f64::NAN) } else { field.parse() };
                let value = value.map_err(|_| broken(&path, &format!("`{field}` in the column {name}")))?;
                force.entry(name.clone()).or_default().push(value);
            }
        }
        let needed = ["time_s", "depth_m", "axial_force_n"];
        let missing = needed.into_iter().chain(ForceParts::PARTS.map(|p| p.column)).find(|c| !force.contains_key(*c));
        if let Some(column) = missing {
            return Err(broken(&path, &format!("the column {column} is missing")));
        }
        let (name, folder, finished) = (name.into(), folder.into(), finished.into());
        Ok(Self { name, scene, folder, finished, summary, figures, force })
    }

    /// A column of the force table; nothing where the run has none of that name.
    pub fn column(&self, name: &str) -> &[f64] {
        self.force.get(name).map_or(&[], Vec::as_slice)
    }

    /// Rows of the force table deeper than every row before them.
    pub fn way_in(&self) -> Vec<usize> {
        let mut deepest = f64::NEG_INFINITY;
        let mut rows = Vec::new();
        for (row, &depth) in self.column("depth_m").iter().enumerate() {
            if depth > deepest {
                deepest = depth;
                rows.push(row);
            }
        }
        rows
    }

    /// Depth [m] and the value of a column on the way in.
    pub fn curve(&self, column: &str) -> Vec<(f64, f64)> {
        let (depth, value) = (self.column("depth_m"), self.column(column));
        self.way_in().into_iter().filter_map(|row| Some((depth[row], *value.get(row)?))).collect()
    }

    /// Parts of the force over the depth on the way in.
    pub fn stack(&self) -> ForceStack {
        let rows = self.way_in();
        let at = |column: &str, scale: f64| -> Vec<f64> {
            let column = self.column(column);
            rows.iter().map(|&row| column[row] * scale).collect()
        };
        ForceStack {
            abscissa: at("depth_m", 1e3),
            over_depth: true,
            total: at("axial_force_n", 1.0),
            parts: ForceParts::PARTS.map(|part| at(part.column, 1.0)).to_vec(),
        }
    }

    /// The stress picture at a depth [m], where the run drew one.
    pub fn picture(&self, depth: f64) -> Option<Vec<u8>> {
        let name = format!("{}.png", PictureMoment::Depth(depth).picture_stem());
        std::fs::read(self.folder.join(name)).ok()
    }

    /// Largest speed of the tool [mm/s].
    pub fn speed(&self) -> f64 {
        self.scene.motion.largest_speed() * 1e3
    }
}
