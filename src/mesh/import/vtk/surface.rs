//! Surfaces in VTK legacy files (`DATASET POLYDATA`), as 3D Slicer wrote its models for years.
//!
//! A list of polygons is laid out as the cells of a grid are. Points without polygons and lines are no surface; lines are counted, since
//! contours of a planning system are nothing else.

use glam::DVec3;

use super::VtkFile;
use crate::Result;

/// What a file of poly data holds.
#[derive(Debug, Default)]
pub(crate) struct PolyData {
    pub points: Vec<DVec3>,
    pub lists: Lists,
}

/// Polygons and triangle strips, each by the points it names.
#[derive(Debug, Default)]
pub(crate) struct Lists {
    pub polygons: Vec<Vec<u32>>,
    pub strips: Vec<Vec<u32>>,
    pub lines: usize,
}

/// Reads the bytes of a `.vtk` file that holds a surface.
pub(crate) fn read(name: &str, bytes: &[u8]) -> Result<PolyData> {
    let mut file = VtkFile::open(name, bytes, |kind| match kind.to_ascii_uppercase().as_slice() {
        b"POLYDATA" => Ok(()),
        b"UNSTRUCTURED_GRID" => Err(("a surface but a mesh", "take the mesh with `tissue.mesh` or `stylet import`")),
        b"STRUCTURED_POINTS" => Err(("a surface but an image", "save the segmentation as NRRD or NIfTI")),
        _ => Err(("a surface", "save the surface as poly data (DATASET POLYDATA), STL or OBJ")),
    })?;
    file.lists = Some(Lists::default());
    file.sections()?;
    Ok(PolyData { points: file.grid.points, lists: file.lists.unwrap_or_default() })
}

impl VtkFile<'_> {
    /// Reads a list of polygons, strips or lines; the points stand before it.
    pub(super) fn list(&mut self, at: usize, section: &[u8]) -> Result<()> {
        self.grid.offsets.clear();
        self.grid.connectivity.clear();
        self.cells(at)?;
        let points = self.grid.points.len();
        let mut found = Vec::new();
        for (cell, ends) in self.grid.offsets.windows(2).enumerate() {
            let span = usize::try_from(ends[0]).ok().zip(usize::try_from(ends[1]).ok());
            let Some(corners) = span.and_then(|(from, to)| self.grid.connectivity.get(from..to)) else {
                return Err(self
                    .source
                    .broken(at, format!("the offsets of cell {cell} do not rise to the list of points")));
            };
            let known = |n: &i64| u32::try_from(*n).ok().filter(|n| (*n as usize) < points);
            match corners.iter().map(known).collect::<Option<Vec<u32>>>() {
                Some(corners) => found.push(corners),
                None => {
                    let message = format!(
                        "cell {cell} names a point that is not in the file: points are 0 to {}",
                        points as i64 - 1
                    );
                    return Err(self.source.broken(at, message));
                }
            }
        }
        let Some(lists) = &mut self.lists else { return Ok(()) };
        match section {
            b"POLYGONS" => lists.polygons = found,
            b"TRIANGLE_STRIPS" => lists.strips = found,
            b"LINES" => lists.lines = found.len(),
            _ => {}
        }
        Ok(())
    }
}
