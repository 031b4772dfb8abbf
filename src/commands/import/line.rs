//! The planned line of a needle, and what it crosses.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::materials;
use super::text;
use crate::anatomy::{Case, Frame, LabelMap, markups};
use crate::error::{Error, Result};

/// Step at which the line is asked for its label [m].
const STEP: f64 = 0.05e-3;
/// Shortest line, as in scenes [m].
const SHORTEST: f64 = 0.5e-3;
/// Farthest coordinate of a patient [mm].
const FARTHEST: f64 = 10_000.0;

/// Entry and target in the patient, RAS [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    pub entry: DVec3,
    pub target: DVec3,
}

/// A stretch of the line within one label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// 0: nothing is there.
    pub label: u16,
    /// Where it begins and ends, from the skin [m].
    pub from: f64,
    pub to: f64,
}

/// The line in a label map.
#[derive(Debug, Clone)]
pub struct Course {
    pub line: Line,
    /// The volume seen along the needle: the origin is where the line meets the skin, z points against the needle.
    pub case: Case,
    /// From entry to skin, along the needle [m].
    pub skin: f64,
    /// From skin to target [m].
    pub length: f64,
    /// From the skin to the target without a gap.
    pub crossings: Vec<Crossing>,
}

impl Line {
    /// The line that the command names; none where it names none.
    ///
    /// # Errors
    /// Where it is no line.
    pub fn asked(entry: Option<&str>, target: Option<&str>, file: Option<&Path>) -> Result<Option<Line>> {
        let (entry, target) = match (entry, target, file) {
            (Some(entry), Some(target), _) => (point("--entry", entry)?, point("--target", target)?),
            (_, _, Some(file)) => {
                let points = markups::read(file)?;
                let [entry, target, ..] = points.as_slice() else {
                    return Err(Error::input(
                        format!("{}: {} points, a line needs two: entry and target", file.display(), points.len()),
                        "place two points or a line in 3D Slicer, and save them again",
                    ));
                };
                (entry.position, target.position)
            }
            _ => return Ok(None),
        };
        let length = entry.distance(target);
        if length < SHORTEST {
            return Err(Error::input(
                format!("entry and target are {:.3} mm apart", length * 1e3),
                format!("choose points at least {} mm apart", SHORTEST * 1e3),
            ));
        }
        Ok(Some(Line { entry, target }))
    }

    /// What the line crosses in a label map; `file` names it in messages.
    ///
    /// # Errors
    /// Where it meets nothing near its entry, or nothing before its target.
    pub fn course(self, map: &Arc<LabelMap>, file: &Path) -> Result<Course> {
        let way = self.target - self.entry;
        let at_entry = Frame::of_needle(self.entry, way);
        let case = Case::new(map.clone(), at_entry);
        let ends = format!("the line from ({}) to ({}) mm", shown(self.entry), shown(self.target));
        let Some(skin) = case.skin_along(DVec3::ZERO, DVec3::NEG_Z) else {
            let extent = match map.bounds() {
                Some((low, high)) => format!("the labels lie within ({}) to ({}) mm RAS", shown(low), shown(high)),
                None => "it has no label but 0".into(),
            };
            return Err(Error::input(
                format!("{}: {ends} meets nothing within 60 mm of its entry", file.display()),
                format!("{extent}; are the points RAS, in mm? 3D Slicer shows them so"),
            ));
        };
        let length = way.length() - skin;
        if length < SHORTEST {
            return Err(Error::input(
                format!(
                    "{}: {ends} ends before it meets anything: the skin is {:.1} mm behind its entry",
                    file.display(),
                    skin * 1e3
                ),
                "choose a target within the tissue; entry and target may be mixed up",
            ));
        }
        let frame = Frame { origin: self.entry + way.normalize() * skin, ..at_entry };
        let case = Case::new(map.clone(), frame);
        let crossings = crossings(&case, length);
        Ok(Course { line: self, case, skin, length, crossings })
    }
}

/// The stretches of the vertical line below the origin of a case.
fn crossings(case: &Case, length: f64) -> Vec<Crossing> {
    let steps = (length / STEP).ceil().max(1.0) as usize;
    let mut found: Vec<Crossing> = Vec::new();
    for step in 0..steps {
        let (from, to) = (step as f64 * STEP, ((step + 1) as f64 * STEP).min(length));
        let label = case.label_at(DVec3::NEG_Z * (0.5 * (from + to)));
        match found.last_mut().filter(|last| last.label == label) {
            Some(last) => last.to = to,
            None => found.push(Crossing { label, from, to }),
        }
    }
    found
}

impl Course {
    /// A label in a table: its name, else its number.
    pub fn label_name(&self, label: u16) -> String {
        match (label, self.case.map.names.get(&label)) {
            (0, _) => "nothing (label 0)".into(),
            (_, Some(name)) => text::name(name, 40),
            (label, None) => format!("label {label}"),
        }
    }

    /// The crossings as a table, with warnings.
    pub fn text(&self) -> String {
        let Line { entry, target } = self.line;
        let mut all = format!(
            "line from ({}) to ({}) mm RAS, {:.1} mm\n",
            shown(entry),
            shown(target),
            1e3 * entry.distance(target)
        );
        if self.skin.abs() > 0.05e-3 {
            let side = if self.skin > 0.0 { "behind" } else { "before" };
            all += &format!(
                "  the skin is met {:.1} mm {side} the entry; depths count from there\n",
                1e3 * self.skin.abs()
            );
        }
        let mut rows = vec![["from mm", "to mm", "label"].map(String::from).to_vec()];
        for crossing in &self.crossings {
            let mm = |depth: f64| format!("{:.1}", depth * 1e3);
            rows.push(vec![mm(crossing.from), mm(crossing.to), self.label_name(crossing.label)]);
        }
        all += &text::table(&rows, &[true, true, false]);
        for warning in self.warnings() {
            all += &text::wrapped(&format!("warning: {warning}"), 4);
            all.push('\n');
        }
        all
    }

    /// Bone and air on the line.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for crossing in &self.crossings {
            let name = self.label_name(crossing.label);
            let place = format!("{:.1} to {:.1} mm below the skin", crossing.from * 1e3, crossing.to * 1e3);
            if crossing.label == 0 {
                warnings.push(format!("the line leaves the tissue {place}; a scene refuses a gap of 0.3 mm and more"));
                continue;
            }
            let material = materials::of_label(self.case.map.names.get(&crossing.label).map(String::as_str));
            if material.is_rigid() {
                warnings.push(format!("{name} is bone, {place}: the needle stops there"));
            } else if material.kind == materials::Kind::Air {
                warnings.push(format!("{name} is air, {place}"));
            }
        }
        warnings
    }
}

/// A point of the command line, RAS [m].
fn point(option: &str, text: &str) -> Result<DVec3> {
    let numbers: Vec<Option<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers.as_slice() {
        [Some(x), Some(y), Some(z)] if [x, y, z].iter().all(|x| x.abs() <= FARTHEST) => {
            Ok(DVec3::new(*x, *y, *z) * 1e-3)
        }
        _ => Err(Error::input(
            format!("{option} {text}: this is no point of a patient"),
            "write x,y,z in RAS mm (x to the right, y to the front, z to the head) without blanks, e.g. 12.5,-40,8",
        )),
    }
}

/// A place in mm.
pub fn shown(x: DVec3) -> String {
    // No minus before a zero.
    let [x, y, z] = (x * 1e3).to_array().map(|x| (x * 10.0).round() / 10.0 + 0.0);
    format!("{x:.1}, {y:.1}, {z:.1}")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::DMat3;

    use super::*;

    /// 20 x 20 x 20 voxels of a millimetre: label 1 below z = 15 mm, 2 below 10 mm, 3 (bone) below 4 mm.
    fn layers() -> Arc<LabelMap> {
        let label = |n: usize| match n / 400 {
            16.. => 0,
            11.. => 1,
            5.. => 2,
            _ => 3,
        };
        let names = [(1, "skin"), (2, "fat"), (3, "femur")].map(|(label, name)| (label, name.to_string()));
        Arc::new(LabelMap {
            size: [20; 3],
            steps: DMat3::from_diagonal(DVec3::splat(1e-3)),
            origin: DVec3::ZERO,
            labels: (0..8000).map(label).collect(),
            names: BTreeMap::from(names),
        })
    }

    #[test]
    fn layers_are_crossed_at_their_depths() {
        let line = Line::asked(Some("10,10,18"), Some("10,10,3"), None).unwrap().unwrap();
        let course = line.course(&layers(), Path::new("layers.nrrd")).unwrap();
        // Between two layers of voxels: the surface is at 15.5 mm.
        assert!((course.skin - 2.5e-3).abs() < 1e-6 && (course.length - 12.5e-3).abs() < 1e-6);
        let expected = [(1, 0.0, 5.0), (2, 5.0, 11.0), (3, 11.0, 12.5)];
        assert_eq!(course.crossings.len(), 3);
        for (found, (label, from, to)) in course.crossings.iter().zip(expected) {
            assert_eq!(found.label, label);
            assert!((found.from * 1e3 - from).abs() < 0.06 && (found.to * 1e3 - to).abs() < 0.06, "{found:?}");
        }
        let text = course.text();
        assert!(text.contains("2.5 mm behind the entry") && text.contains("femur is bone, 11.0 to 12.5 mm"), "{text}");
    }

    #[test]
    fn lines_that_are_none() {
        let refused = |entry, target| Line::asked(Some(entry), Some(target), None).unwrap_err().to_string();
        for entry in ["1,2", "1,2,x", "1,2,3,4", "", "nan,0,0", "1e9,0,0"] {
            assert!(refused(entry, "0,0,0").contains("no point of a patient"), "{entry}");
        }
        assert!(refused("0,0,0", "0,0,0.1").contains("0.100 mm apart"));
        let outside = Line::asked(Some("500,0,0"), Some("500,0,9"), None).unwrap().unwrap();
        assert!(outside.course(&layers(), Path::new("l")).unwrap_err().to_string().contains("labels lie within"));
        let above = Line::asked(Some("10,10,30"), Some("10,10,20"), None).unwrap().unwrap();
        assert!(above.course(&layers(), Path::new("l")).unwrap_err().to_string().contains("ends before"));
    }
}
