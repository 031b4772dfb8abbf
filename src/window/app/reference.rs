//! A run that the attempt is seen beside: its force curve and its scores.

use std::path::Path;

use crate::reading;
use crate::training::score::Score;
use crate::window::panels::ReferenceCurve;
use crate::{Error, Result};

/// The scores of an attempt, where its folder holds some.
pub(super) fn read_score(folder: &Path) -> Option<Result<Score>> {
    let path = folder.join("score.json");
    let text = reading::text(&path, reading::most::OWN).ok()?;
    let wrong = |e: serde_json::Error| {
        Error::input(
            format!("{}: no scores: {e}", path.display()),
            "give the folder of an attempt, or take the file away",
        )
    };
    Some(serde_json::from_str(&text).map_err(wrong))
}

/// The force curve of a run.
pub(super) fn read_curve(folder: &Path) -> Result<ReferenceCurve> {
    let path = if folder.is_dir() { folder.join("force.csv") } else { folder.to_path_buf() };
    let bytes = reading::bytes(&path, reading::most::TABLE).map_err(|e| e.of(&path, "give the folder of a run"))?;
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let wrong = |reason: String| Error::input(format!("{}: {reason}", path.display()), "give the folder of a run");
    let headers = reader.headers().map_err(|e| wrong(e.to_string()))?.clone();
    let column = |name: &str| headers.iter().position(|h| h == name).ok_or_else(|| wrong(format!("no column {name}")));
    let (depth, force) = (column("depth_m")?, column("axial_force_n")?);
    let mut points = Vec::new();
    for row in reader.records() {
        let row = row.map_err(|e| wrong(e.to_string()))?;
        let number = |n: usize| row.get(n).and_then(|text| text.parse::<f64>().ok());
        match (number(depth), number(force)) {
            (Some(depth), Some(force)) => points.push([depth * 1e3, force]),
            _ => return Err(wrong(format!("row {} holds no numbers", points.len() + 1))),
        }
    }
    let name = path.parent().and_then(Path::file_name).map_or("reference".into(), |n| n.to_string_lossy().into_owned());
    Ok(ReferenceCurve { name, points })
}
