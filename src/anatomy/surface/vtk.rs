//! VTK legacy files of surfaces (`.vtk` with `DATASET POLYDATA`), with the reader of `.vtk` meshes.

use super::draft::Draft;
use super::stl::too_many;
use crate::Result;
use crate::mesh::import::vtk::surface;

/// Reads the bytes of a file; all polygons are one surface.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Draft> {
    let data = surface::read(name, bytes)?;
    if data.points.len() >= u32::MAX as usize {
        return Err(too_many(name));
    }
    let mut draft = Draft {
        points: data.points,
        parts: vec![(String::new(), Vec::new())],
        lines: data.lists.lines,
        ..Draft::default()
    };
    data.lists.polygons.iter().for_each(|corners| draft.add_polygon(corners));
    data.lists.strips.iter().for_each(|corners| draft.add_strip(corners));
    Ok(draft)
}
