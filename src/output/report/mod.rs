//! Reports: finished runs beside the numbers of a publication, as one page.

pub mod lv2022;
pub mod predictions;
mod words;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::folder::{CORE_TABLE, FORCE_TABLE, PictureMoment, SUMMARY};
use super::parts_chart::ForceStack;
use super::summary::Summary;
use crate::observables::ForceParts;
use crate::reading;
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
    pub force: Columns,
    /// With a hollow needle.
    pub core: Option<Columns>,
}

/// Way out where a file of a run is not there.
const NO_RESULT: &str = "make the run again, for a report with --force";

/// A table of numbers by the name of its columns; an empty cell is NaN.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns(BTreeMap<String, Vec<f64>>);

impl Columns {
    fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &reading::bytes(path, reading::most::TABLE).map_err(|unread| unread.of(path, NO_RESULT))?)
    }

    /// Reads a table from the bytes of a file; `path` stands for it in messages.
    ///
    /// # Errors
    /// `Error::Input` where it is no table of numbers.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut reader = csv::Reader::from_reader(bytes);
        let names: Vec<String> =
            reader.headers().map_err(|reason| broken(path, &reason))?.iter().map(str::to_string).collect();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
        for row in reader.records() {
            let row = row.map_err(|reason| broken(path, &reason))?;
            for ((name, column), field) in names.iter().zip(&mut columns).zip(row.iter()) {
                let value = if field.is_empty() { Ok(f64::NAN) } else { field.parse() };
                column.push(value.map_err(|_| broken(path, &format!("`{field}` in the column {name}")))?);
            }
        }
        Ok(Self(names.into_iter().zip(columns).collect()))
    }

    /// A column; nothing where the table has none of that name.
    pub fn column(&self, name: &str) -> &[f64] {
        self.0.get(name).map_or(&[], Vec::as_slice)
    }

    /// Rows deeper than every row before them.
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
    pub fn curve(&self, name: &str) -> Vec<(f64, f64)> {
        let (depth, value) = (self.column("depth_m"), self.column(name));
        self.way_in().into_iter().filter_map(|row| Some((depth[row], *value.get(row)?))).collect()
    }
}

fn broken(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    Error::input(
        format!("{} is not what a run of this version writes: {reason}", path.display()),
        "make the run again, for a report with --force",
    )
}

impl CaseResults {
    /// Reads the folder of a run. The error tells the file and what is wrong with it.
    pub fn read(name: &str, scene: Scene, folder: &Path, finished: &str) -> Result<Self> {
        let path = folder.join(SUMMARY);
        let text = reading::text(&path, reading::most::OWN).map_err(|unread| unread.of(&path, NO_RESULT))?;
        let summary: Summary = serde_json::from_str(&text).map_err(|reason| broken(&path, &reason))?;
        let all: serde_json::Map<String, serde_json::Value> =
            serde_json::from_str(&text).map_err(|reason| broken(&path, &reason))?;
        let mut figures: Vec<(String, serde_json::Value)> = all.into_iter().collect();
        figures.sort_by_key(|(key, _)| text.find(&format!("\"{key}\":")));

        let path = folder.join(FORCE_TABLE);
        let force = Columns::read(&path)?;
        let needed = ["time_s", "depth_m", "axial_force_n"];
        let missing = needed.into_iter().chain(ForceParts::PARTS.map(|p| p.column)).find(|c| !force.0.contains_key(*c));
        if let Some(column) = missing {
            return Err(broken(&path, &format!("the column {column} is missing")));
        }
        let path = folder.join(CORE_TABLE);
        let core = path.exists().then(|| Columns::read(&path)).transpose()?;
        let (name, folder, finished) = (name.into(), folder.into(), finished.into());
        Ok(Self { name, scene, folder, finished, summary, figures, force, core })
    }

    /// Depth [m] and a column of the force table on the way in.
    pub fn curve(&self, column: &str) -> Vec<(f64, f64)> {
        self.force.curve(column)
    }

    /// Parts of the force over the depth on the way in.
    pub fn stack(&self) -> ForceStack {
        let rows = self.force.way_in();
        let at = |column: &str, scale: f64| -> Vec<f64> {
            let column = self.force.column(column);
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
        reading::bytes(&self.folder.join(name), reading::most::OWN).ok()
    }

    /// Largest speed of the tool [mm/s].
    pub fn speed(&self) -> f64 {
        self.scene.motion.largest_speed() * 1e3
    }
}
