//! `force_parts.svg`: the parts of the axial force on top of one another, with their sum as a line.

use std::path::Path;

use plotters::prelude::*;

use super::chart::{Curve, FINER, rgb};
use super::plot::{Area, Plot};
use crate::observables::{ForceParts, FrameRecord};
use crate::whole_file;
use crate::{Error, Result};

/// Of the areas, so that the grid shines through.
const OPACITY: f64 = 0.8;

/// Parts of the force over depth or time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ForceStack {
    /// Depth of the tip [mm] or time [s].
    pub abscissa: Vec<f64>,
    /// True where the abscissa is the depth.
    pub over_depth: bool,
    /// Axial force [N].
    pub total: Vec<f64>,
    /// Values of every part of [`ForceParts::PARTS`] [N].
    pub parts: Vec<Vec<f64>>,
}

impl ForceStack {
    /// Over the depth as long as the tool only goes in, else over time.
    pub fn from_records(records: &[FrameRecord]) -> Self {
        let finite = |r: &&FrameRecord| {
            let parts = ForceParts::PARTS.iter().all(|part| (part.of)(&r.force).is_finite());
            r.depth.is_finite() && r.time.is_finite() && r.force.axial.is_finite() && parts
        };
        let records: Vec<&FrameRecord> = records.iter().filter(finite).collect();
        let over_depth = records.len() > 1 && records.windows(2).all(|pair| pair[1].depth > pair[0].depth);
        Self {
            abscissa: records.iter().map(|r| if over_depth { r.depth * 1e3 } else { r.time }).collect(),
            over_depth,
            total: records.iter().map(|r| r.force.axial).collect(),
            parts: ForceParts::PARTS.map(|part| records.iter().map(|r| (part.of)(&r.force)).collect()).to_vec(),
        }
    }

    /// Which parts act at all; the others are left out of charts, legends and reports.
    pub fn acting(&self) -> Vec<bool> {
        self.parts.iter().map(|values| values.iter().any(|v| *v != 0.0)).collect()
    }

    /// The chart: parts that push the tissue along the insertion above zero, those against it below.
    pub(super) fn plot(&self) -> Plot {
        let mut above = vec![0.0; self.abscissa.len()];
        let mut below = above.clone();
        let mut areas = Vec::new();
        for ((part, values), acting) in ForceParts::PARTS.iter().zip(&self.parts).zip(self.acting()) {
            if !acting {
                continue;
            }
            let mut near = Vec::with_capacity(values.len());
            let mut far = Vec::with_capacity(values.len());
            for (i, &value) in values.iter().enumerate() {
                let end = if value >= 0.0 { &mut above[i] } else { &mut below[i] };
                near.push((self.abscissa[i], *end));
                *end += value;
                far.push((self.abscissa[i], *end));
            }
            near.extend(far.into_iter().rev());
            areas.push(Area { label: part.name, colour: rgb(part.colour), opacity: OPACITY, corners: near });
        }
        let total = Curve {
            label: "axial, their sum",
            colour: BLACK,
            width: 2 * FINER,
            dash: None,
            points: self.abscissa.iter().copied().zip(self.total.iter().copied()).collect(),
        };
        Plot {
            x_label: if self.over_depth { "depth of the tip [mm]" } else { "time [s]" },
            y_label: "force on the tissue [N]",
            areas,
            curves: vec![total],
            marks: Vec::new(),
        }
    }
}

/// Writes the chart, whole or not at all.
pub fn write_parts_chart(path: &Path, title: &str, records: &[FrameRecord]) -> Result<()> {
    let text = ForceStack::from_records(records)
        .plot()
        .file(title)
        .map_err(|reason| Error::file(path, std::io::Error::other(format!("chart: {reason}"))))?;
    whole_file::write(path, text.as_bytes())
}
