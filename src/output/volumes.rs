//! What a run means for the images of a patient: the displacement as a field of vectors, the label map deformed by it, and the needle
//! and the targets as markups. 3D Slicer and ITK open all of them.
//!
//! Both keep transforms as they resample images: from a point y of the new image to the point X of the old one that lies there now
//! (3D Slicer, developer guide, "Transforms"; `itk::DisplacementFieldTransform`). The field here is therefore d(y) = X(y) - y with
//! X + u(X) = y and u the displacement of the tissue, found by fixed-point iteration X <- y - u(X). Loaded as a transform it moves
//! images, surfaces and points of the patient as the needle has moved the tissue. Beside an opened path that is where the tissue is seen; a
//! place within the needle leads to the middle of the path. Vectors and places are LPS in mm in the files.

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::folder::{OutputFolder, PictureMoment};
use crate::anatomy::write_nrrd::{self, VectorVolume};
use crate::anatomy::{Case, LabelMap};
use crate::mesh::{BlockMesh, Mesh, trilinear};
use crate::model::Model;
use crate::observables::{FieldSnapshot, OpenedPath};
use crate::{Result, whole_file};

/// Most steps of the inversion, with each of its factors.
const MOST_STEPS: usize = 40;
/// Factors on a step, the first that comes to rest counts: where the tissue is folded, shorter steps still find a place.
const FACTORS: [f64; 3] = [1.0, 0.5, 0.2];
/// Miss at which an inversion is done, and up to which it counts as found, in voxels.
const DONE: f64 = 1e-3;
const FOUND: f64 = 0.1;

/// Most steps that find the section of an opened path beside a place.
const MOST_SECTIONS: usize = 8;

/// The displacement of a block at any point, continued beyond its tissue.
pub struct Deformation<'a> {
    block: &'a BlockMesh,
    /// Path beside which tissue is pushed aside further.
    opened: Option<&'a OpenedPath>,
    /// Per node [m].
    displacement: Vec<DVec3>,
}

impl<'a> Deformation<'a> {
    /// From displacements per node [m]. Nodes in the air have none of their own: they get that of the tissue next to them, so that
    /// the air goes with the skin. `rigid`: cells that stand still; no entries: there are none.
    pub fn new(block: &'a BlockMesh, displacement: &[DVec3], rigid: &[bool], opened: Option<&'a OpenedPath>) -> Self {
        let mut displacement = displacement.to_vec();
        let mut known = vec![block.empty.is_empty(); block.node_count()];
        for cell in (0..block.cell_count()).filter(|_| !block.empty.is_empty()) {
            if !block.is_empty(cell) || rigid.get(cell).is_some_and(|rigid| *rigid) {
                block.cell_nodes(cell).iter().for_each(|node| known[*node] = true);
            }
        }
        let mut rim: Vec<usize> = (0..known.len()).filter(|node| known[*node]).collect();
        let size = block.nodes();
        let strides = [1, size[0], size[0] * size[1]];
        while !rim.is_empty() {
            // The mean of the known neighbours, layer by layer.
            let mut sums = std::collections::BTreeMap::<usize, (DVec3, f64)>::new();
            for node in rim {
                let place = block.node_coordinates(node);
                for axis in 0..3 {
                    let below = (place[axis] > 0).then(|| node - strides[axis]);
                    let above = (place[axis] + 1 < size[axis]).then(|| node + strides[axis]);
                    for other in [below, above].into_iter().flatten().filter(|other| !known[*other]) {
                        let sum = sums.entry(other).or_default();
                        *sum = (sum.0 + displacement[node], sum.1 + 1.0);
                    }
                }
            }
            rim = sums.keys().copied().collect();
            for (node, (sum, count)) in sums {
                displacement[node] = sum / count;
                known[node] = true;
            }
        }
        Deformation { block, opened, displacement }
    }

    /// Displacement of what rests at X, with an opened path closed [m]; beyond the block that of the nearest point of it.
    pub fn at(&self, x: DVec3) -> DVec3 {
        let ([i, j, k], local) = self.block.locate(x);
        let (weights, _) = trilinear(local, DVec3::ONE);
        let nodes = self.block.cell_nodes(self.block.cell_index(i, j, k));
        nodes.iter().zip(weights).map(|(node, weight)| self.displacement[*node] * weight).sum()
    }

    /// What is seen at x now: where it rests, and by how far that misses [m].
    pub fn rest_of(&self, x: DVec3, done: f64) -> (DVec3, f64) {
        let mut found = self.closed_rest_of(x, done);
        let Some(path) = self.opened else { return found };
        let mut closed = x;
        for _ in 0..MOST_SECTIONS {
            // The section beside it hangs on where it rests.
            let next = path.closed_place(found.0, x);
            if next.distance(closed) <= done {
                break;
            }
            closed = next;
            found = self.closed_rest_of(closed, done);
        }
        found
    }

    /// What is at y with the path closed: where it rests, and by how far that misses [m].
    fn closed_rest_of(&self, y: DVec3, done: f64) -> (DVec3, f64) {
        let mut best = (y, self.at(y).length());
        for factor in FACTORS {
            let mut x = best.0;
            for _ in 0..MOST_STEPS {
                let miss = x + self.at(x) - y;
                let length = miss.length();
                if length < best.1 {
                    best = (x, length);
                }
                if length <= done {
                    return best;
                }
                x -= miss * factor;
            }
        }
        best
    }
}

/// A part of a label map: every `stride`-th voxel of a box.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    first: [usize; 3],
    size: [usize; 3],
    stride: usize,
}

impl Part {
    /// The voxels around the block, a voxel more on each side.
    fn around(block: &BlockMesh, case: &Case, stride: usize) -> Option<Part> {
        let (low, high) = Mesh::Block(block.clone()).bounds();
        let (mut first, mut last) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in 0..8 {
            let x = DVec3::from_array(std::array::from_fn(|a| if corner >> a & 1 == 1 { high[a] } else { low[a] }));
            let at = case.map.index_of(case.frame.to_patient(x));
            (first, last) = (first.min(at), last.max(at));
        }
        let stride = stride.max(1);
        let first: [usize; 3] = std::array::from_fn(|a| (first[a].floor() - 1.0).max(0.0) as usize);
        let size: [usize; 3] = std::array::from_fn(|a| {
            let end = ((last[a].ceil() + 2.0).max(0.0) as usize).min(case.map.size[a]);
            end.saturating_sub(first[a]).div_ceil(stride)
        });
        size.iter().all(|n| *n > 0).then_some(Part { first, size, stride })
    }

    fn origin(&self, map: &LabelMap) -> DVec3 {
        let [i, j, k] = self.first;
        map.position(i, j, k)
    }
}

/// Displacement field and deformed labels of one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Volumes {
    /// X(y) - y per voxel.
    pub field: VectorVolume,
    /// The label map as it is now.
    pub labels: LabelMap,
    /// Voxels for which no place at rest was found within a tenth of a voxel: there the tissue is folded.
    pub folded: usize,
}

/// What a deformation means for a label map, in every `stride`-th of its voxels around the block; `None` where they do not meet.
pub fn volumes(deformation: &Deformation, case: &Case, stride: usize) -> Option<Volumes> {
    let part = Part::around(deformation.block, case, stride)?;
    let map = &case.map;
    let steps = map.steps * part.stride as f64;
    let origin = part.origin(map);
    let [ni, nj, _] = part.size;
    let voxel = map.spacing().min_element();
    let sampler = map.sampler();
    let folded = AtomicUsize::new(0);
    let one = |n: usize| {
        let at = DVec3::new((n % ni) as f64, (n / ni % nj) as f64, (n / ni / nj) as f64);
        let y = origin + steps * at;
        let (rest, miss) = deformation.rest_of(case.frame.to_scene(y), DONE * voxel);
        if miss > FOUND * voxel {
            folded.fetch_add(1, Ordering::Relaxed);
        }
        let rest = case.frame.to_patient(rest);
        (rest - y, sampler.label_at(rest))
    };
    let all: Vec<(DVec3, u16)> = (0..part.size.iter().product()).into_par_iter().map(one).collect();
    let (vectors, labels) = all.into_iter().unzip();
    Some(Volumes {
        field: VectorVolume { size: part.size, steps, origin, vectors },
        labels: LabelMap { size: part.size, steps, origin, labels, names: map.names.clone() },
        folded: folded.into_inner(),
    })
}

/// Writes the files of one moment of a scene with a label map; their paths.
///
/// # Errors
/// Where a file cannot be written.
pub fn write(
    output: &OutputFolder,
    model: &Model,
    snapshot: &FieldSnapshot,
    moment: PictureMoment,
    stride: usize,
) -> Result<Vec<PathBuf>> {
    let (Some(case), Mesh::Block(block)) = (&model.scene.case, &model.mesh) else { return Ok(Vec::new()) };
    let deformation =
        Deformation::new(block, &snapshot.displacement, &model.composition.rigid, snapshot.opened.as_ref());
    let mut written = Vec::new();
    let mut keep = |name: &str, bytes: &[u8]| -> Result<()> {
        let path = output.file(name);
        whole_file::write(&path, bytes)?;
        written.push(path);
        Ok(())
    };
    let tag = moment.tag();
    if let Some(volumes) = volumes(&deformation, case, stride) {
        let when = format!("Stylet: {} at {:.4} s", model.scene.name, snapshot.time);
        let field = [
            when.clone(),
            "displacement field as ITK and 3D Slicer resample: from a point of the deformed patient to the point at rest, LPS, mm".into(),
            format!("inverted by fixed-point iteration; {} voxels in folded tissue are approximate", volumes.folded),
        ];
        keep(&format!("displacement_{tag}.nrrd"), &write_nrrd::vectors(&volumes.field, &field))?;
        let labels = [when, "label map deformed by the displacement of the tissue".into()];
        keep(&format!("labels_{tag}.nrrd"), &write_nrrd::label_map(&volumes.labels, &labels))?;
    }
    if let Some((tip, direction)) = snapshot.tool_pose.filter(|_| snapshot.depth > 0.0) {
        // The depth of a frame is a mean over it; a planned path begins where it was planned.
        let motion = &model.scene.motion;
        let entry = if motion.is_free() { tip - direction * snapshot.depth } else { motion.entry };
        keep(&format!("needle_{tag}.mrk.json"), &needle(case, snapshot, (entry, tip), direction))?;
    }
    if !snapshot.targets.is_empty() {
        let names = model.scene.targets.iter().map(|target| target.name.as_str());
        let points: Vec<(&str, DVec3)> = names.zip(snapshot.targets.iter().copied()).collect();
        keep(&format!("targets_{tag}.mrk.json"), &markup(case, "Fiducial", &points))?;
    }
    Ok(written)
}

/// The needle from the skin to its tip: a line, or a curve where it is bent.
fn needle(case: &Case, snapshot: &FieldSnapshot, (entry, tip): (DVec3, DVec3), direction: DVec3) -> Vec<u8> {
    let Some(line) = &snapshot.centre_line else {
        return markup(case, "Line", &[("entry", entry), ("tip", tip)]);
    };
    const PARTS: u32 = 12;
    let at = |n: u32| {
        let s = entry.distance(tip) * f64::from(PARTS - n) / f64::from(PARTS);
        tip - direction * s + line.at(s, 0.0).offset
    };
    let names: Vec<String> = (0..=PARTS)
        .map(|n| match n {
            0 => "entry".into(),
            PARTS => "tip".into(),
            n => format!("shaft {n}"),
        })
        .collect();
    let points: Vec<(&str, DVec3)> = names.iter().map(String::as_str).zip((0..=PARTS).map(at)).collect();
    markup(case, "Curve", &points)
}

/// Points of a scene [m] as a markups file of 3D Slicer.
fn markup(case: &Case, kind: &str, points: &[(&str, DVec3)]) -> Vec<u8> {
    let one = |(number, (name, x)): (usize, &(&str, DVec3))| -> Value {
        let ras = case.frame.to_patient(*x) * 1e3;
        // Micrometres are enough, and no minus before a zero.
        let lps = [-ras.x, -ras.y, ras.z].map(|x| (x * 1e3).round() / 1e3 + 0.0);
        json!({"id": (number + 1).to_string(), "label": name, "position": lps, "positionStatus": "defined"})
    };
    let schema = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";
    let file = json!({
        "@schema": schema,
        "markups": [{
            "type": kind,
            "coordinateSystem": "LPS",
            "coordinateUnits": "mm",
            "controlPoints": points.iter().enumerate().map(one).collect::<Vec<_>>(),
        }],
    });
    format!("{file:#}\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use glam::DMat3;

    use super::*;
    use crate::anatomy::{Frame, markups};

    fn block(cells: usize) -> BlockMesh {
        let line = |from: f64| (0..=cells).map(|i| from + 20e-3 * i as f64 / cells as f64).collect();
        BlockMesh::new([line(-10e-3), line(-10e-3), line(-20e-3)])
    }

    /// A smooth push downwards around the axis, zero at the sides.
    fn push(x: DVec3) -> DVec3 {
        let part = (1.0 - (x.x / 10e-3).powi(2)) * (1.0 - (x.y / 10e-3).powi(2)) * (x.z / 20e-3 + 1.0);
        DVec3::new(0.5e-3, 0.2e-3, -2e-3) * part
    }

    fn case() -> Case {
        // Voxels of 0.8 mm along turned axes; layers of labels along z.
        let (c, s) = (0.96, 0.28);
        let steps = DMat3::from_cols(DVec3::new(-c, s, 0.0), DVec3::new(s, c, 0.0), DVec3::Z) * 0.8e-3;
        let size = [40, 40, 40];
        let labels = (0..64_000).map(|n| if n / 1600 < 30 { 1 + (n / 1600 / 5) as u16 } else { 0 }).collect();
        let names = BTreeMap::from([(1, "deep".to_string())]);
        let origin = DVec3::new(0.1, 0.2, 0.3);
        let map = LabelMap { size, steps, origin, labels, names };
        let entry = map.position(20, 20, 29) + DVec3::Z * 0.4e-3;
        Case::new(Arc::new(map), Frame::of_patient(entry))
    }

    #[test]
    fn the_inverse_leads_back() {
        let block = block(10);
        let u: Vec<DVec3> = (0..block.node_count()).map(|n| push(block.rest_position(n))).collect();
        let deformation = Deformation::new(&block, &u, &[], None);
        for n in 0..500 {
            let part = |m: usize| (n * m % 97) as f64 / 97.0;
            let x = DVec3::new(part(1) * 18e-3 - 9e-3, part(5) * 18e-3 - 9e-3, part(11) * -19e-3);
            let (rest, miss) = deformation.rest_of(x + deformation.at(x), 1e-9);
            assert!(rest.distance(x) < 1e-8 && miss < 1e-9, "{x}: {rest}");
        }
    }

    #[test]
    fn the_field_leads_from_now_to_rest() {
        let (block, case) = (block(10), case());
        let u: Vec<DVec3> = (0..block.node_count()).map(|n| push(block.rest_position(n))).collect();
        let deformation = Deformation::new(&block, &u, &[], None);
        let volumes = volumes(&deformation, &case, 1).unwrap();
        assert_eq!(volumes.folded, 0);
        // The middle of the axis: the tissue there came from above.
        let y = DVec3::new(0.0, 0.0, -6e-3);
        let at = (volumes.field.steps.inverse() * (case.frame.to_patient(y) - volumes.field.origin)).round();
        let n = at.x as usize + volumes.field.size[0] * (at.y as usize + volumes.field.size[1] * at.z as usize);
        let place = volumes.field.origin + volumes.field.steps * at;
        let rest = place + volumes.field.vectors[n];
        let moved = case.frame.to_patient(case.frame.to_scene(rest) + deformation.at(case.frame.to_scene(rest)));
        assert!(moved.distance(place) < 1e-6, "{moved} {place}");
        assert!(volumes.field.vectors[n].z > 1e-3, "{}", volumes.field.vectors[n]);
        assert_eq!(volumes.labels.labels[n], case.map.label_at(rest));
        // Every second voxel is the same field.
        let half = super::volumes(&deformation, &case, 2).unwrap();
        assert_eq!(half.field.vectors[0], volumes.field.vectors[0]);
        assert_eq!(half.field.size, volumes.field.size.map(|n| n.div_ceil(2)));
    }

    #[test]
    fn without_motion_nothing_changes() {
        let (block, case) = (block(4), case());
        let deformation = Deformation::new(&block, &vec![DVec3::ZERO; block.node_count()], &[], None);
        let volumes = volumes(&deformation, &case, 1).unwrap();
        assert!(volumes.field.vectors.iter().all(|v| v.length() < 1e-15));
        let [ni, nj, _] = volumes.labels.size;
        for (n, label) in volumes.labels.labels.iter().enumerate() {
            let x = volumes.labels.position(n % ni, n / ni % nj, n / ni / nj);
            assert_eq!(*label, case.map.label_at(x));
        }
    }

    #[test]
    fn the_air_goes_with_the_skin() {
        let mut block = block(4);
        // The upper half is empty.
        block.empty = (0..block.cell_count()).map(|cell| block.cell_coordinates(cell)[2] >= 2).collect();
        let u: Vec<DVec3> = (0..block.node_count())
            .map(|node| if block.node_coordinates(node)[2] <= 2 { DVec3::NEG_Z * 1e-3 } else { DVec3::ZERO })
            .collect();
        let deformation = Deformation::new(&block, &u, &[], None);
        assert!(deformation.at(DVec3::new(1e-3, 2e-3, -1e-3)).distance(DVec3::NEG_Z * 1e-3) < 1e-15);
        // What is rigid stands still.
        let rigid: Vec<bool> = block.empty.clone();
        let deformation = Deformation::new(&block, &u, &rigid, None);
        assert_eq!(deformation.at(DVec3::new(1e-3, 2e-3, 0.0)), DVec3::ZERO);
    }

    #[test]
    fn markups_are_read_back_where_they_were() {
        let case = case();
        let points = [("entry", DVec3::ZERO), ("tip", DVec3::new(1e-3, 2e-3, -12e-3))];
        let read = markups::parse("needle.mrk.json", &markup(&case, "Line", &points)).unwrap();
        for (point, (name, x)) in read.iter().zip(points) {
            assert_eq!(point.label, name);
            assert!(point.position.distance(case.frame.to_patient(x)) < 1e-6);
        }
    }
}
