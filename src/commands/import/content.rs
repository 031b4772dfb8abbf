//! What a file is, recognised by its content, and what it holds in words.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::line::shown;
use super::{materials, text, voxels};
use crate::anatomy::surface::check::Report;
use crate::anatomy::surface::{self, TriangleSurface};
use crate::anatomy::{self, LabelMap};
use crate::error::{Error, Result};
use crate::mesh::import::{self, ImportOptions, LengthUnit};
use crate::mesh::{Placement, TetMesh};
use crate::reading::{self, most};
use crate::units::four_digits;

/// Bytes that tell what a file is.
const HEAD: u64 = 4096;
/// Most rows of a table.
const MOST_ROWS: usize = 150;
/// Diagonal of what is expected [m]; else the unit is probably another one.
const EXPECTED: (f64, f64) = (1e-3, 2.0);
/// Diagonal below which parts of a patient are few [m]: the numbers of the file may be cm.
const SMALL: f64 = 20e-3;
/// Layer of nothing around surfaces in their label map, in voxels.
const MARGIN: f64 = 2.0;

/// A file that was read.
#[derive(Debug)]
pub struct Content {
    file: PathBuf,
    /// What it is, e.g. "label map (NRRD)".
    title: &'static str,
    what: What,
    /// Whether names of labels come from elsewhere than the file.
    renamed: bool,
    /// Where it was put.
    placement: Placement,
    /// Plain sentences on what was found and assumed.
    notices: Vec<String>,
}

#[derive(Debug)]
enum What {
    Labels(Arc<LabelMap>),
    Surfaces(Vec<(TriangleSurface, Report)>),
    Mesh(TetMesh),
}

/// A label map that a scene can be made of.
#[derive(Debug, Clone)]
pub struct Labels {
    pub map: Arc<LabelMap>,
    /// Whether the file itself is the map.
    pub in_file: bool,
    /// Whether names of labels come from elsewhere than the file, so that a scene must say numbers.
    pub renamed: bool,
    /// How the file has to be placed to be this map; none of a map that was made from it.
    pub placement: Placement,
    /// Plain sentences on how it was made.
    pub notices: Vec<String>,
}

/// The kinds of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Labels,
    Surface,
    Mesh,
}

/// The kind of a file that begins so and what to call it.
fn kind_of(head: &[u8]) -> (Kind, &'static str) {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let holds = |word: &[u8]| text.windows(word.len()).any(|w| w.eq_ignore_ascii_case(word));
    let begins = |word: &[u8]| text.len() >= word.len() && text[..word.len()].eq_ignore_ascii_case(word);
    let size = head.first_chunk::<4>().map_or(0, |bytes| i32::from_le_bytes(*bytes));
    if begins(b"NRRD") {
        return (Kind::Labels, "label map (NRRD)");
    }
    if head.starts_with(&[0x1f, 0x8b]) || [348, 540].contains(&size) || [348, 540].contains(&size.swap_bytes()) {
        return (Kind::Labels, "label map (NIfTI)");
    }
    if !head.contains(&0) && holds(b"DimSize") || begins(b"ObjectType") || begins(b"NDims") {
        return (Kind::Labels, "label map (MetaImage)");
    }
    if head.get(128..132) == Some(b"DICM") || begins(b"{") || begins(b"# Markups") {
        // Its reader says what is to be done with them.
        return (Kind::Labels, "label map");
    }
    if begins(b"$") {
        return (Kind::Mesh, "tetrahedral mesh (Gmsh)");
    }
    if begins(b"*") {
        return (Kind::Mesh, "tetrahedral mesh (Abaqus)");
    }
    if begins(b"# vtk") && holds(b"DATASET POLYDATA") {
        return (Kind::Surface, "surface (VTK)");
    }
    if begins(b"# vtk") {
        return (Kind::Mesh, "tetrahedral mesh (VTK)");
    }
    if begins(b"<") && holds(b"UnstructuredGrid") {
        return (Kind::Mesh, "tetrahedral mesh (VTK XML)");
    }
    let title = if begins(b"ply\n") || begins(b"ply\r") {
        "surface (PLY)"
    } else if begins(b"<") {
        "surface (VTK XML)"
    } else if begins(b"solid") || head.contains(&0) {
        "surface (STL)"
    } else {
        "surface (OBJ)"
    };
    (Kind::Surface, title)
}

impl Content {
    /// Reads a file whose coordinates, where it states no unit, are in `unit`, and places it; `names` go before those of a label map.
    ///
    /// # Errors
    /// Where it cannot be read or is of no kind that is read here.
    pub fn read(
        file: &Path,
        unit: LengthUnit,
        placement: &Placement,
        names: Option<BTreeMap<u16, String>>,
    ) -> Result<Content> {
        let unread = |unread: reading::Unread| unread.of(file, "check the name, and that you may read the file");
        let head = reading::head(file, most::VOLUME, HEAD).map_err(unread)?;
        let (kind, title) = kind_of(&head);
        if names.is_some() && kind != Kind::Labels {
            return Err(Error::input(
                format!("{}: this is a {title}, and --names is for label maps", file.display()),
                "leave --names away: surfaces and regions have the names of the file",
            ));
        }
        let mut renamed = names.is_some();
        let mut notices = Vec::new();
        let what = match kind {
            Kind::Labels => {
                let mut read = anatomy::read(file)?;
                notices.extend(read.notices);
                read.map.names.extend(names.unwrap_or_default());
                renamed |= name_by_file(&mut read.map, file, &mut notices);
                What::Labels(Arc::new(read.map.placed(placement)))
            }
            Kind::Surface => {
                notices.push(format!("Coordinates are taken in {unit} (--unit)."));
                let read = surface::read(file, unit.to_metres(1.0))?;
                notices.extend(read.notices);
                let is_lps = head.windows(9).any(|w| w == b"SPACE=LPS");
                if is_lps {
                    notices.push("The file says SPACE=LPS: x and y are turned to RAS.".into());
                } else {
                    notices.push("Coordinates are taken as RAS: the file does not say SPACE=LPS.".into());
                }
                let mut surfaces = read.surfaces;
                if let [only] = surfaces.as_mut_slice() {
                    name_as_file(only, file, &mut notices);
                }
                let place = |surface| checked(surface, is_lps, placement, &mut notices);
                What::Surfaces(surfaces.into_iter().map(place).collect())
            }
            Kind::Mesh => {
                notices.push(format!("Coordinates are taken in {unit} (--unit), and as RAS."));
                let mut read =
                    import::read_with(file, ImportOptions { unit, accept_size: true, placement: *placement })?;
                notices.extend(read.notices);
                if let [only] = read.mesh.regions.as_mut_slice()
                    && only.starts_with("region-")
                {
                    let stem = super::scene::stem(file);
                    notices.push(format!("Its one region, `{only}`, is called `{stem}` as the file is."));
                    *only = stem;
                }
                What::Mesh(read.mesh)
            }
        };
        if !placement.is_none() {
            notices.push(format!("It was {}; all places are behind that.", placement.text()));
        }
        let mut content = Content { file: file.to_path_buf(), title, what, renamed, placement: *placement, notices };
        content.notice_size();
        Ok(content)
    }

    fn bounds(&self) -> Option<(DVec3, DVec3)> {
        match &self.what {
            What::Labels(map) => map.bounds(),
            What::Mesh(mesh) => Some(mesh.bounds()),
            What::Surfaces(surfaces) => {
                let all = surfaces.iter().filter_map(|(surface, _)| surface.bounds());
                all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            }
        }
    }

    fn notice_size(&mut self) {
        let is_mesh = matches!(self.what, What::Mesh(_));
        let states_none = !matches!(self.what, What::Labels(_));
        let Some((low, high)) = self.bounds().filter(|_| states_none) else { return };
        let size = low.distance(high);
        let mm = four_digits(size * 1e3);
        if !(EXPECTED.0..=EXPECTED.1).contains(&size) {
            let further = if is_mesh { "; a scene with this mesh needs accept_size = true" } else { "" };
            self.notices.push(format!(
                "It is {mm} mm across, where 1 mm to 2 m are expected: --unit is probably another one{further}."
            ));
        } else if size < SMALL {
            self.notices.push(format!(
                "It is {mm} mm across. If that is too small, --unit is another one: cm makes it ten times as large."
            ));
        }
    }

    /// What it is and what it holds, in lines of at most 100 characters.
    pub fn text(&self) -> String {
        let mut all = format!("{}: {}\n", self.file.display(), self.title);
        all += &match &self.what {
            What::Labels(map) => labels_text(map),
            What::Surfaces(surfaces) => surfaces_text(surfaces),
            What::Mesh(mesh) => mesh_text(mesh),
        };
        all + &text::list("noticed:", &self.notices)
    }

    /// The label map that it is or that it is made into, with voxels of this edge [m] where it has none of its own.
    ///
    /// # Errors
    /// Where that is too large.
    pub fn labels(&self, voxel: Option<f64>) -> Result<Labels> {
        if let What::Labels(map) = &self.what {
            let (map, notices) = (map.clone(), Vec::new());
            return Ok(Labels { map, in_file: true, renamed: self.renamed, placement: self.placement, notices });
        }
        let size = self.bounds().map_or(0.0, |(low, high)| (high - low).max_element());
        // Steps of 0.05 mm.
        let edge = voxel.unwrap_or_else(|| ((size / 200.0).clamp(0.3e-3, 2e-3) / 0.05e-3).round() * 0.05e-3);
        let (map, mut notices) = match &self.what {
            What::Surfaces(surfaces) => {
                let all: Vec<TriangleSurface> = surfaces.iter().map(|(surface, _)| surface.clone()).collect();
                let mut made = surface::voxels::label_map(&all, edge, MARGIN * edge)?;
                made.map.names.values_mut().for_each(|name| *name = short(name));
                (made.map, made.notices)
            }
            What::Mesh(mesh) => (voxels::of_mesh(mesh, edge)?, Vec::new()),
            What::Labels(_) => unreachable!("returned above"),
        };
        let [i, j, k] = map.size;
        notices.insert(0, format!("{i} x {j} x {k} voxels of {} mm (--voxel).", four_digits(edge * 1e3)));
        Ok(Labels { map: Arc::new(map), in_file: false, renamed: false, placement: Placement::NONE, notices })
    }
}

/// Names for a map without any: one label has that of the file. Whether one was given; what is missing is told.
fn name_by_file(map: &mut LabelMap, file: &Path, notices: &mut Vec<String>) -> bool {
    /// Labels without names of which an image has more, and a segmentation seldom.
    const MANY: usize = 100;
    if !map.names.is_empty() {
        return false;
    }
    let labels: Vec<u16> = map.volumes().keys().copied().collect();
    if let [label] = labels.as_slice() {
        let stem = super::scene::stem(file);
        notices.push(format!("The file gives its one label no name; it is called `{stem}` as the file is."));
        map.names.insert(*label, stem);
        return true;
    }
    let labels = labels.len();
    notices.push(format!(
        "The file gives its labels no names; a scene takes what has none for muscle. --names FILE gives them names.{}",
        if labels > MANY {
            format!(" {labels} labels without names: this may be an image, not a segmentation.")
        } else {
            String::new()
        }
    ));
    false
}

/// The only surface of a file is called as the file is, where its own name says nothing (`Mesh1`) and that of the file something.
fn name_as_file(only: &mut TriangleSurface, file: &Path, notices: &mut Vec<String>) {
    let is_known = |name: &str| materials::of_label(Some(name)).kind != materials::Kind::Unknown;
    let stem = super::scene::stem(file);
    let own = short(&only.name);
    if own != stem && !is_known(&own) && is_known(&stem) {
        notices.push(format!("Its one surface, `{}`, is called `{stem}` as the file is.", text::name(&own, 40)));
        only.name = stem;
    }
}

/// A surface looked over, in RAS and where it is put.
fn checked(
    mut surface: TriangleSurface,
    is_lps: bool,
    placement: &Placement,
    notices: &mut Vec<String>,
) -> (TriangleSurface, Report) {
    if is_lps {
        // Two axes turned: a rotation, so triangles stay counterclockwise.
        surface.points.iter_mut().for_each(|x| *x = DVec3::new(-x.x, -x.y, x.z));
    }
    surface.points.iter_mut().for_each(|x| *x = placement.point(*x));
    let report = surface::check::check(&mut surface);
    notices.extend(report.notices.iter().cloned());
    (surface, report)
}

fn extent_text(bounds: Option<(DVec3, DVec3)>) -> String {
    match bounds {
        // Of something small more digits are told.
        Some((low, high)) if low.distance(high) < 10e-3 => {
            let place = |x: DVec3| (x * 1e3).to_array().map(|x| (four_digits(x) + 0.0).to_string()).join(", ");
            format!("  extent: ({}) to ({}) mm RAS\n", place(low), place(high))
        }
        Some((low, high)) => format!("  extent: ({}) to ({}) mm RAS\n", shown(low), shown(high)),
        None => "  extent: none\n".into(),
    }
}

fn mm3(x: DVec3) -> String {
    x.to_array().map(|x| four_digits(x * 1e3).to_string()).join(" x ")
}

/// A volume in millilitres.
fn ml(volume: f64) -> String {
    let ml = volume * 1e6;
    match ml {
        ..0.1 => format!("{:.3e}", ml),
        ..10.0 => format!("{ml:.3}"),
        _ => format!("{ml:.1}"),
    }
}

fn labels_text(map: &LabelMap) -> String {
    let [i, j, k] = map.size;
    let mut all =
        format!("  {i} x {j} x {k} voxels of {} mm; i, j, k run to {}\n", mm3(map.spacing()), map.orientation());
    all += &extent_text(map.bounds());
    let volumes = map.volumes();
    let mut rows = vec![["label", "name", "voxels", "ml", "in a scene"].map(String::from).to_vec()];
    for (label, (voxels, volume)) in volumes.iter().take(MOST_ROWS) {
        let name = map.names.get(label).map(String::as_str);
        let shown = name.map_or("-".into(), |name| text::name(name, 40));
        rows.push(vec![label.to_string(), shown, voxels.to_string(), ml(*volume), materials::of_label(name).text()]);
    }
    all += &text::table(&rows, &[true, false, true, true, false]);
    all + &left_out(volumes.len(), "labels")
}

fn left_out(count: usize, what: &str) -> String {
    match count.checked_sub(MOST_ROWS) {
        Some(more) if more > 0 => format!("  ... and {more} more {what}\n"),
        _ => String::new(),
    }
}

fn surfaces_text(surfaces: &[(TriangleSurface, Report)]) -> String {
    let all = surfaces.iter().filter_map(|(surface, _)| surface.bounds());
    let mut text = extent_text(all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))));
    let mut rows = vec![["surface", "triangles", "closed", "size mm", "ml", "in a scene"].map(String::from).to_vec()];
    for (surface, report) in surfaces.iter().take(MOST_ROWS) {
        let closed = match report.is_closed() {
            true => "yes".into(),
            false if report.holes > 0 => format!("{} holes", report.holes),
            false => "no".into(),
        };
        let size = surface.bounds().map_or(String::new(), |(low, high)| {
            (high - low).to_array().map(|x| crate::units::significant(x * 1e3, 3).to_string()).join(" x ")
        });
        rows.push(vec![
            super::text::name(&short(&surface.name), 24),
            surface.triangles.len().to_string(),
            closed,
            size,
            ml(report.volume),
            materials::of_label(Some(&short(&surface.name))).text(),
        ]);
    }
    text += &super::text::table(&rows, &[false, true, false, false, true, false]);
    text + &left_out(surfaces.len(), "surfaces")
}

/// A surface without a name of its own has that of its file: its stem.
pub fn short(name: &str) -> String {
    let path = Path::new(name);
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("stl" | "obj" | "ply" | "vtp" | "vtk") => {
            path.file_stem().map_or_else(|| name.to_string(), |stem| stem.to_string_lossy().into_owned())
        }
        _ => name.to_string(),
    }
}

fn mesh_text(mesh: &TetMesh) -> String {
    let (low, high) = mesh.bounds();
    let cells = mesh.tets.len();
    let mut all = extent_text(Some((low, high)));
    let edges: Vec<f64> = (0..cells).map(|tet| mesh.longest_edge(tet)).collect();
    let shapes = (0..cells).map(|tet| mesh.smallest_altitude(tet) / edges[tet]);
    let (worst, sum) = shapes.fold((f64::INFINITY, 0.0), |(worst, sum), shape| (shape.min(worst), sum + shape));
    let longest = edges.iter().copied().fold(0.0, f64::max);
    let lowest = (0..cells).map(|tet| mesh.smallest_altitude(tet)).fold(f64::INFINITY, f64::min);
    all += &format!(
        "  {cells} tetrahedra, {} nodes, {} mm; longest edge {} mm, smallest altitude {} mm\n",
        mesh.positions.len(),
        mm3(high - low),
        four_digits(longest * 1e3),
        four_digits(lowest * 1e3)
    );
    all += &format!(
        "  altitude over longest edge: {:.3} at worst, {:.3} on average (0.816 is regular)\n",
        worst,
        sum / cells.max(1) as f64
    );
    let mut rows = vec![["region", "cells", "ml", "in a scene"].map(String::from).to_vec()];
    for (tag, name) in mesh.regions.iter().enumerate().take(MOST_ROWS) {
        let count = mesh.tags.iter().filter(|t| **t as usize == tag).count();
        let material = materials::of_label(Some(name)).text();
        rows.push(vec![text::name(name, 40), count.to_string(), ml(mesh.region_volume(tag)), material]);
    }
    all += &text::table(&rows, &[false, true, true, false]);
    all += &left_out(mesh.regions.len(), "regions");
    if !mesh.node_sets.is_empty() {
        let sets = mesh.node_sets.iter().map(|(name, nodes)| format!("{} ({})", text::name(name, 40), nodes.len()));
        let sets: Vec<String> = sets.take(MOST_ROWS).collect();
        all += &format!("  {}\n", text::wrapped(&format!("node sets (nodes): {}", sets.join(", ")), 4));
    }
    all
}

/// Refuses a name that would not fit into a scene.
pub fn utf8(path: &Path) -> Result<String> {
    path.to_str().map(str::to_string).ok_or_else(|| {
        Error::input(
            format!("{}: this path is no UTF-8", path.display()),
            "rename the file, so that a scene can name it",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_their_content() {
        let title = |head: &[u8]| kind_of(head).1;
        assert_eq!(title(b"NRRD0005\n"), "label map (NRRD)");
        assert_eq!(title(&[0x1f, 0x8b, 8]), "label map (NIfTI)");
        assert_eq!(title(&[0, 0, 1, 92, 0]), "label map (NIfTI)");
        assert_eq!(title(b"ObjectType = Image\nNDims = 3\n"), "label map (MetaImage)");
        assert_eq!(title(b"$MeshFormat\n4.1 0 8\n"), "tetrahedral mesh (Gmsh)");
        assert_eq!(title(b"** by hand\n*NODE\n"), "tetrahedral mesh (Abaqus)");
        assert_eq!(title(b"# vtk DataFile Version 3.0\n"), "tetrahedral mesh (VTK)");
        assert_eq!(title(b"# vtk DataFile Version 3.0\nmodel\nASCII\nDATASET POLYDATA\n"), "surface (VTK)");
        assert_eq!(title(b"<?xml?><VTKFile type=\"UnstructuredGrid\">"), "tetrahedral mesh (VTK XML)");
        assert_eq!(title(b"<?xml?><VTKFile type=\"PolyData\">"), "surface (VTK XML)");
        assert_eq!(title(b"ply\nformat ascii 1.0\n"), "surface (PLY)");
        assert_eq!(title(b"solid liver\n"), "surface (STL)");
        assert_eq!(title(b"# made by\nv 0 0 0\n"), "surface (OBJ)");
        assert_eq!(title(b""), "surface (OBJ)");
    }

    #[test]
    fn a_surface_without_a_name_has_that_of_its_file() {
        assert_eq!(short("/a/b/liver.STL"), "liver");
        assert_eq!(short("left kidney"), "left kidney");
    }
}
