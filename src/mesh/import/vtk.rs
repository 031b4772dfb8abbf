//! VTK legacy files (`.vtk`), text and binary (big-endian), versions 1 to 5.1: grids of tetrahedra, and in [`surface`] poly data.
//!
//! Source: "VTK File Formats" of the VTK documentation. Version 5 replaces the list of cells, each preceded by its
//! length, by two arrays OFFSETS and CONNECTIVITY. Points and the region of each cell are kept; every other attribute
//! is stepped over.

pub(crate) mod surface;

use glam::DVec3;

use super::raw::{COARSER, ElementClass, MOST_ENTITIES, RawMesh, RawNode, RawTet, Words};
use super::source::{Source, WRITE_AGAIN, excerpt};
use crate::{Error, Result};

pub(super) const WORDS: Words =
    Words { node: "point", element: "cell", first_order: "write a mesh of first order: cells of type 10 or 24" };

/// Cell arrays that name regions, the first found in this order is taken.
const REGION_ARRAYS: [&str; 5] = ["region", "tag", "material", "gmsh:physical", "cellentityids"];

/// Rank of a cell array that names regions.
pub(super) fn region_rank(name: &str) -> Option<usize> {
    let name = name.to_lowercase();
    REGION_ARRAYS.iter().position(|known| *known == name)
}

/// An unstructured grid as both VTK formats state it.
#[derive(Debug, Default)]
pub(super) struct Grid {
    pub points: Vec<DVec3>,
    pub connectivity: Vec<i64>,
    /// Start of each cell in `connectivity`, and the end of the last.
    pub offsets: Vec<i64>,
    pub types: Vec<i64>,
    /// Region per cell.
    pub tags: Option<Tags>,
    /// Arrays that could name regions, too.
    pub unused_tags: Vec<String>,
}

#[derive(Debug)]
pub(super) struct Tags {
    pub name: String,
    pub values: Vec<f64>,
}

/// The array of a grid in which a value is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum GridArray {
    Connectivity,
    Offsets,
    Types,
    Tags,
}

impl Grid {
    /// Adds the tetrahedra of this grid, whose first cell has the number `first_cell`; `fail` makes an error at value
    /// `index` of an array.
    pub fn add_to(
        self,
        raw: &mut RawMesh,
        first_cell: u64,
        fail: impl Fn(GridArray, usize, String) -> Error,
    ) -> Result<()> {
        let (cells, points) = (self.types.len(), self.points.len());
        if self.offsets.len() != cells + 1 {
            let message = format!("{} cells, but {cells} cell types", self.offsets.len().saturating_sub(1));
            return Err(fail(GridArray::Types, 0, message));
        }
        if let Some(tags) = &self.tags
            && tags.values.len() != cells
        {
            let message = format!("array `{}` has {} values for {cells} cells", tags.name, tags.values.len());
            return Err(fail(GridArray::Tags, 0, message));
        }
        if let Some(tags) = &self.tags
            && !self.unused_tags.is_empty()
        {
            let unused = self.unused_tags.join("`, `");
            let notice = format!("Regions are taken from cell array `{}`; `{unused}` is not used.", tags.name);
            // Said once for a file of several pieces.
            if !raw.notices.contains(&notice) {
                raw.notices.push(notice);
            }
        }
        let first_node = raw.nodes.len();
        if u32::try_from(first_node + points).is_err() {
            return Err(fail(GridArray::Connectivity, 0, "more than 2^32 points".into()));
        }
        for (index, &position) in self.points.iter().enumerate() {
            raw.nodes.push(RawNode { id: (first_node + index) as u64, position });
        }
        for cell in 0..cells {
            let (start, end) = (self.offsets[cell], self.offsets[cell + 1]);
            let (Ok(start), Ok(end)) = (usize::try_from(start), usize::try_from(end)) else {
                return Err(fail(GridArray::Offsets, cell, format!("cell {cell} has a negative offset")));
            };
            let Some(nodes) = self.connectivity.get(start..end) else {
                let message = format!(
                    "cell {cell} should take values {start}..{end} of a connectivity of {}",
                    self.connectivity.len()
                );
                return Err(fail(GridArray::Offsets, cell, message));
            };
            if let Some((class, kind)) = cell_class(self.types[cell]) {
                raw.count_other(class, kind, 1);
                continue;
            }
            let wanted = if self.types[cell] == QUADRATIC { 10 } else { 4 };
            if nodes.len() != wanted {
                let message = format!("cell {cell} is a tetrahedron with {} points instead of {wanted}", nodes.len());
                return Err(fail(GridArray::Offsets, cell, message));
            }
            raw.ten_node += u64::from(wanted == 10);
            let mut corners = [0; 4];
            for (corner, node) in corners.iter_mut().zip(nodes.iter().copied()) {
                *corner = match usize::try_from(node) {
                    Ok(node) if node < points => (first_node + node) as u32,
                    _ => {
                        let message = format!(
                            "cell {cell} names point {node}, which is not in the file: points are 0 to {}",
                            points as i64 - 1
                        );
                        return Err(fail(GridArray::Connectivity, start, message));
                    }
                };
            }
            let region = match &self.tags {
                None => raw.region("region-0"),
                Some(tags) => {
                    let tag = tags.values[cell];
                    if tag.fract() != 0.0 || tag.abs() > 2f64.powi(53) {
                        let message =
                            format!("region `{}` of cell {cell} is {tag}, which is no whole number", tags.name);
                        return Err(fail(GridArray::Tags, cell, message));
                    }
                    raw.region(&format!("region-{}", tag as i64))
                }
            };
            raw.tets.push(RawTet { id: first_cell + cell as u64, nodes: corners, region });
        }
        Ok(())
    }
}

/// Type of the ten-node tetrahedron, whose corners come first.
const QUADRATIC: i64 = 24;

/// What a cell type means; `None` for tetrahedra of four and ten nodes.
fn cell_class(kind: i64) -> Option<(ElementClass, &'static str)> {
    use ElementClass::{HighOrderTet, Lower, Volume};
    Some(match kind {
        10 | QUADRATIC => return None,
        0 => (Lower, "empty cells"),
        1 | 2 => (Lower, "points"),
        3 | 4 | 21 | 35 | 68 | 75 => (Lower, "lines"),
        5 | 6 | 22 | 34 | 69 | 76 => (Lower, "triangles"),
        7 | 36 => (Lower, "polygons"),
        8 | 9 | 23 | 28 | 30 | 70 | 77 => (Lower, "quadrangles"),
        11 | 12 => (Volume, "hexahedra"),
        13 => (Volume, "prisms"),
        14 => (Volume, "pyramids"),
        71 | 78 => (HighOrderTet, "tetrahedra of higher order"),
        25 | 29 | 33 | 72 | 79 => (Volume, "hexahedra of higher order"),
        26 | 31 | 32 | 73 | 80 => (Volume, "prisms of higher order"),
        27 | 37 | 74 | 81 => (Volume, "pyramids of higher order"),
        15 | 16 | 41 | 42 => (Volume, "polyhedra"),
        _ => (Volume, "cells of an unknown type"),
    })
}

/// Reads the bytes of a `.vtk` file.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<RawMesh> {
    let mut file = VtkFile::open(name, bytes, |kind| match kind.eq_ignore_ascii_case(b"UNSTRUCTURED_GRID") {
        true => Ok(()),
        false => Err(("an unstructured grid", GRID_WANTED)),
    })?;
    file.sections()?;
    file.finish()
}

const GRID_WANTED: &str = "save the mesh as an unstructured grid of tetrahedra (DATASET UNSTRUCTURED_GRID)";

impl<'a> VtkFile<'a> {
    /// Reads the head of a file whose kind of data set is `wanted`.
    fn open(
        name: &str,
        bytes: &'a [u8],
        wanted: impl FnOnce(&[u8]) -> std::result::Result<(), (&'static str, &'static str)>,
    ) -> Result<VtkFile<'a>> {
        let mut source = Source::new(name, bytes);
        let at = source.at();
        let version = source.line().unwrap_or_default().trim_ascii();
        if version.len() < 22 || !version[..22].eq_ignore_ascii_case(b"# vtk DataFile Version") {
            return Err(source.broken(at, "the first line should be `# vtk DataFile Version ...`"));
        }
        // A free title.
        source.line();
        let at = source.at();
        let encoding = source.line().unwrap_or_default().trim_ascii().to_ascii_uppercase();
        let binary = match encoding.as_slice() {
            b"ASCII" => false,
            b"BINARY" => true,
            other => return Err(source.broken(at, format!("`{}` stands where ASCII or BINARY should", excerpt(other)))),
        };
        let (at, word) = source.word("DATASET")?;
        let (_, kind) = source.field("the kind of data set")?;
        if !word.eq_ignore_ascii_case(b"DATASET") {
            return Err(source.broken(at, format!("`{}` stands where DATASET should", excerpt(word))));
        }
        if let Err((what, way_out)) = wanted(kind) {
            let message = format!("`{} {}` is not {what}", excerpt(word), excerpt(kind));
            return Err(source.fail(at, message, way_out));
        }
        source.line();
        source.binary = binary;
        if !binary {
            source.refuse_zeros()?;
        }
        Ok(VtkFile { source, binary, grid: Grid::default(), lists: None, starts: [None; 4], attribute_of: None })
    }
}

struct VtkFile<'a> {
    source: Source<'a>,
    binary: bool,
    grid: Grid,
    /// Polygons and strips of poly data; `None` for a grid.
    lists: Option<surface::Lists>,
    /// Where the values of `GridArray` start, and the bytes per value.
    starts: [Option<(usize, u64)>; 4],
    /// What the attributes now read belong to.
    attribute_of: Option<(Owner, u64)>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Owner {
    Cells,
    Points,
}

/// Data types of the format.
#[derive(Debug, Clone, Copy, PartialEq)]
enum DataType {
    Bit,
    Signed(u64),
    Unsigned(u64),
    Float,
    Double,
}

impl DataType {
    fn of_word(word: &[u8]) -> Option<DataType> {
        Some(match word.to_ascii_lowercase().as_slice() {
            b"bit" => DataType::Bit,
            b"char" | b"signed_char" => DataType::Signed(1),
            b"unsigned_char" => DataType::Unsigned(1),
            b"short" => DataType::Signed(2),
            b"unsigned_short" => DataType::Unsigned(2),
            // The legacy writer stores ids as int, whatever the width in memory.
            b"int" | b"vtkidtype" => DataType::Signed(4),
            b"unsigned_int" => DataType::Unsigned(4),
            b"long" | b"long_long" | b"vtktypeint64" => DataType::Signed(8),
            b"unsigned_long" | b"unsigned_long_long" | b"vtktypeuint64" => DataType::Unsigned(8),
            b"float" => DataType::Float,
            b"double" => DataType::Double,
            _ => return None,
        })
    }

    fn bytes(self) -> u64 {
        match self {
            DataType::Bit => 0,
            DataType::Signed(n) | DataType::Unsigned(n) => n,
            DataType::Float => 4,
            DataType::Double => 8,
        }
    }
}

impl VtkFile<'_> {
    fn sections(&mut self) -> Result<()> {
        while !self.source.is_done() {
            let (at, word) = self.source.word("a section")?;
            match word.to_ascii_uppercase().as_slice() {
                b"POINTS" => self.points(at)?,
                b"CELLS" => self.cells(at)?,
                section @ (b"POLYGONS" | b"TRIANGLE_STRIPS" | b"LINES" | b"VERTICES") if self.lists.is_some() => {
                    self.list(at, section)?;
                }
                b"CELL_TYPES" => {
                    let count = self.count_on_line("the number of cell types")?;
                    self.end_head()?;
                    self.grid.types = self.integers(GridArray::Types, count, DataType::Signed(4), "a cell type")?;
                }
                b"CELL_DATA" => {
                    let count = self.count_on_line("the number of cells")?;
                    self.end_head()?;
                    self.attribute_of = Some((Owner::Cells, count));
                }
                b"POINT_DATA" => {
                    let count = self.count_on_line("the number of points")?;
                    self.end_head()?;
                    self.attribute_of = Some((Owner::Points, count));
                }
                b"METADATA" => self.skip_metadata(),
                b"FIELD" => self.field_data()?,
                b"SCALARS" => self.scalars(at)?,
                b"VECTORS" | b"NORMALS" => self.attribute(at, 3)?,
                b"TENSORS" => self.attribute(at, 9)?,
                b"TENSORS6" => self.attribute(at, 6)?,
                b"GLOBAL_IDS" | b"PEDIGREE_IDS" => self.attribute(at, 1)?,
                b"TEXTURE_COORDINATES" => {
                    self.source.field("the name of an array")?;
                    let components = self.count_on_line("the number of components")?;
                    let kind = self.data_type()?;
                    self.end_head()?;
                    self.skip_values(at, components, kind)?;
                }
                b"COLOR_SCALARS" => {
                    self.source.field("the name of an array")?;
                    let components = self.count_on_line("the number of components")?;
                    self.end_head()?;
                    self.skip_values(at, components, DataType::Unsigned(1))?;
                }
                b"LOOKUP_TABLE" => {
                    self.source.field("the name of a table")?;
                    let size = self.count_on_line("the size of a table")?;
                    self.end_head()?;
                    let count = self.product(at, size, 4)?;
                    self.skip(count, DataType::Unsigned(1), "a colour")?;
                }
                _ => {
                    return Err(self.source.broken(at, format!("`{}` is not a section of this format", excerpt(word))));
                }
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<RawMesh> {
        let source = self.source;
        let missing = [
            (self.grid.points.is_empty(), "POINTS"),
            (self.starts[GridArray::Offsets as usize].is_none(), "CELLS"),
            (self.starts[GridArray::Types as usize].is_none(), "CELL_TYPES"),
        ];
        if let Some((_, section)) = missing.iter().find(|(missing, _)| *missing) {
            return Err(source.broken(source.at(), format!("the file ends without {section}")));
        }
        let mut raw = RawMesh::new(source.name(), WORDS);
        let starts = self.starts;
        self.grid.add_to(&mut raw, 0, |array, index, message| {
            let at = match starts[array as usize] {
                Some((start, bytes)) if source.binary => start + index * bytes as usize,
                Some((start, _)) => source.place_of_word(start, index),
                None => source.at(),
            };
            source.broken(at, message)
        })?;
        raw.refuse_other_volumes()?;
        Ok(raw)
    }

    fn count_on_line(&mut self, what: &str) -> Result<u64> {
        self.source.number_in_line(what)
    }

    fn product(&self, at: usize, a: u64, b: u64) -> Result<u64> {
        a.checked_mul(b).ok_or_else(|| self.source.broken(at, format!("{a} times {b} values cannot be in a file")))
    }

    /// Ends the head line of an array; what follows may be binary.
    fn end_head(&mut self) -> Result<()> {
        let at = self.source.at();
        match self.source.line() {
            Some(rest) if !rest.trim_ascii().is_empty() => Err(self
                .source
                .broken(at, format!("`{}` is more than this line should hold", excerpt(rest.trim_ascii())))),
            _ => Ok(()),
        }
    }

    fn data_type(&mut self) -> Result<DataType> {
        let (at, word) = self.source.field("a data type")?;
        DataType::of_word(word).ok_or_else(|| {
            self.source.fail(
                at,
                format!("data type `{}` is not read here", excerpt(word)),
                "save the mesh without this array, or as int or double",
            )
        })
    }

    /// Refuses numbers that no engine takes before anything is made of them.
    fn few_enough(&self, at: usize, count: u64, what: &str) -> Result<()> {
        match count > MOST_ENTITIES {
            true => Err(self.source.fail(at, format!("{count} {what}; at most {MOST_ENTITIES} are read"), COARSER)),
            false => Ok(()),
        }
    }

    fn points(&mut self, at: usize) -> Result<()> {
        let count = self.count_on_line("the number of points")?;
        self.few_enough(at, count, "points")?;
        let kind = self.data_type()?;
        self.end_head()?;
        let start = self.source.at();
        let count = self.product(at, count, 3)?;
        let values = self.values(count, kind, "a coordinate")?;
        for (number, point) in values.chunks_exact(3).enumerate() {
            let position = DVec3::new(point[0], point[1], point[2]);
            if !position.is_finite() {
                let at = if self.binary {
                    start + 3 * number * kind.bytes() as usize
                } else {
                    self.source.place_of_word(start, 3 * number)
                };
                let message =
                    format!("point {number} stands at ({}, {}, {}), which is not finite", point[0], point[1], point[2]);
                return Err(self.source.broken(at, message));
            }
            self.grid.points.push(position);
        }
        Ok(())
    }

    fn cells(&mut self, at: usize) -> Result<()> {
        let count = self.count_on_line("the number of cells")?;
        self.few_enough(at, count, "cells")?;
        let size = self.count_on_line("the length of the cell list")?;
        self.end_head()?;
        // Binary data of the older layout never spells OFFSETS: its first four bytes are a small number.
        if self.next_is(b"OFFSETS") {
            self.source.word("OFFSETS")?;
            let kind = self.data_type()?;
            self.end_head()?;
            self.grid.offsets = self.integers(GridArray::Offsets, count, kind, "an offset")?;
            let (at, word) = self.source.word("CONNECTIVITY")?;
            if !word.eq_ignore_ascii_case(b"CONNECTIVITY") {
                let message = format!("`{}` stands where CONNECTIVITY should", excerpt(word));
                return Err(self.source.broken(at, message));
            }
            let kind = self.data_type()?;
            self.end_head()?;
            self.grid.connectivity = self.integers(GridArray::Connectivity, size, kind, "a point of a cell")?;
            return Ok(());
        }
        let list = self.integers(GridArray::Connectivity, size, DataType::Signed(4), "a point of a cell")?;
        self.starts[GridArray::Offsets as usize] = self.starts[GridArray::Connectivity as usize];
        let mut read = 0;
        self.grid.offsets.push(0);
        for cell in 0..count {
            let nodes = list.get(read).and_then(|&n| usize::try_from(n).ok());
            let Some(nodes) = nodes.and_then(|n| list.get(read + 1..(read + 1).checked_add(n)?)) else {
                let message =
                    format!("the list of {size} values ends in cell {cell} of {count}, or a length in it is wrong");
                return Err(self.source.broken(at, message));
            };
            self.grid.connectivity.extend(nodes);
            self.grid.offsets.push(self.grid.connectivity.len() as i64);
            read += 1 + nodes.len();
        }
        if read != list.len() {
            let message = format!("CELLS promises {size} values, but {count} cells take {read}");
            return Err(self.source.broken(at, message));
        }
        Ok(())
    }

    fn next_is(&mut self, word: &[u8]) -> bool {
        if self.binary {
            return self.source.rest().len() >= word.len()
                && self.source.rest()[..word.len()].eq_ignore_ascii_case(word);
        }
        self.source.peek_word().eq_ignore_ascii_case(word)
    }

    /// `SCALARS name type [components]`, `LOOKUP_TABLE name`, values.
    fn scalars(&mut self, at: usize) -> Result<()> {
        let (_, name) = self.source.field("the name of an array")?;
        let name = excerpt(name);
        let kind = self.data_type()?;
        let at_rest = self.source.at();
        let rest = self.source.line().unwrap_or_default().trim_ascii();
        let components =
            if rest.is_empty() { 1 } else { self.source.parse((at_rest, rest), "the number of components")? };
        if self.next_is(b"LOOKUP_TABLE") {
            self.source.line();
        }
        let (owner, count) = self.owner(at)?;
        let values = self.product(at, count, components)?;
        self.array(owner, &name, components, values, kind)
    }

    fn owner(&self, at: usize) -> Result<(Owner, u64)> {
        self.attribute_of.ok_or_else(|| self.source.broken(at, "an attribute stands before CELL_DATA and POINT_DATA"))
    }

    /// `KIND name type`, values.
    fn attribute(&mut self, at: usize, components: u64) -> Result<()> {
        self.source.field("the name of an array")?;
        let kind = self.data_type()?;
        self.end_head()?;
        self.skip_values(at, components, kind)
    }

    fn skip_values(&mut self, at: usize, components: u64, kind: DataType) -> Result<()> {
        let (_, count) = self.owner(at)?;
        let count = self.product(at, count, components)?;
        self.skip(count, kind, "a value of an attribute")
    }

    /// `FIELD name arrays`, then `name components tuples type` and values for each array.
    fn field_data(&mut self) -> Result<()> {
        self.source.field("the name of a field")?;
        let arrays = self.count_on_line("the number of arrays")?;
        self.end_head()?;
        for _ in 0..arrays {
            while self.source.peek_word().eq_ignore_ascii_case(b"METADATA") {
                self.source.word("METADATA")?;
                self.skip_metadata();
            }
            let (at, name) = self.source.word("the name of an array")?;
            if name.eq_ignore_ascii_case(b"NULL_ARRAY") {
                continue;
            }
            let name = excerpt(name);
            let components = self.count_on_line("the number of components")?;
            let tuples = self.count_on_line("the number of tuples")?;
            let kind = self.data_type()?;
            self.end_head()?;
            let count = self.product(at, components, tuples)?;
            // Fields before any CELL_DATA belong to the data set as a whole.
            let owner = self.attribute_of.map_or(Owner::Points, |(owner, _)| owner);
            self.array(owner, &name, components, count, kind)?;
        }
        Ok(())
    }

    /// Keeps an array that names the regions of cells, steps over any other.
    fn array(&mut self, owner: Owner, name: &str, components: u64, count: u64, kind: DataType) -> Result<()> {
        let rank = region_rank(name).filter(|_| owner == Owner::Cells && components == 1 && kind != DataType::Bit);
        let known = self.grid.tags.as_ref().and_then(|t| region_rank(&t.name));
        if rank.is_some() && (known.is_none() || rank < known) {
            self.mark(GridArray::Tags, kind);
            let values = self.values(count, kind, "a region")?;
            let former = self.grid.tags.replace(Tags { name: name.to_string(), values });
            self.grid.unused_tags.extend(former.map(|t| t.name));
            return Ok(());
        }
        if rank.is_some() {
            self.grid.unused_tags.push(name.to_string());
        }
        self.skip(count, kind, "a value of an attribute")
    }

    /// A block of information keys, ended by an empty line.
    fn skip_metadata(&mut self) {
        self.source.line();
        while let Some(line) = self.source.line() {
            if line.trim_ascii().is_empty() {
                return;
            }
        }
    }

    fn mark(&mut self, array: GridArray, kind: DataType) {
        let mut source = self.source.clone();
        if !self.binary {
            source.skip_space();
        }
        self.starts[array as usize] = Some((source.at(), kind.bytes()));
    }

    fn skip(&mut self, count: u64, kind: DataType, what: &str) -> Result<()> {
        if self.binary {
            let bytes = if kind == DataType::Bit {
                count.div_ceil(8)
            } else {
                self.product(self.source.at(), count, kind.bytes())?
            };
            self.source.take(bytes, what)?;
            return Ok(());
        }
        for _ in 0..count {
            self.source.number::<f64>(what)?;
        }
        Ok(())
    }

    fn values(&mut self, count: u64, kind: DataType, what: &str) -> Result<Vec<f64>> {
        match kind {
            DataType::Float | DataType::Double if self.binary => {
                let bytes = self.source.take(self.product(self.source.at(), count, kind.bytes())?, what)?;
                Ok(bytes
                    .chunks_exact(kind.bytes() as usize)
                    .map(|b| match *b {
                        [a, b, c, d] => f64::from(f32::from_be_bytes([a, b, c, d])),
                        _ => f64::from_bits(b.iter().fold(0, |word, &byte| word << 8 | u64::from(byte))),
                    })
                    .collect())
            }
            _ if self.binary => Ok(self.binary_integers(count, kind, what)?.into_iter().map(|v| v as f64).collect()),
            _ => {
                let mut values = Vec::new();
                for _ in 0..count {
                    values.push(self.source.number::<f64>(what)?);
                }
                Ok(values)
            }
        }
    }

    fn integers(&mut self, array: GridArray, count: u64, kind: DataType, what: &str) -> Result<Vec<i64>> {
        self.mark(array, kind);
        if self.binary {
            return self.binary_integers(count, kind, what);
        }
        let mut values = Vec::new();
        for _ in 0..count {
            values.push(self.source.number::<i64>(what)?);
        }
        Ok(values)
    }

    fn binary_integers(&mut self, count: u64, kind: DataType, what: &str) -> Result<Vec<i64>> {
        let at = self.source.at();
        let (DataType::Signed(width) | DataType::Unsigned(width)) = kind else {
            return Err(self.source.fail(at, format!("{what} should be a whole number, not {kind:?}"), WRITE_AGAIN));
        };
        let bytes = self.source.take(self.product(at, count, width)?, what)?;
        Ok(bytes
            .chunks_exact(width as usize)
            .map(|b| {
                let word = b.iter().fold(0u64, |word, &byte| word << 8 | u64::from(byte));
                let spare = 64 - 8 * width;
                if matches!(kind, DataType::Signed(_)) { (word << spare) as i64 >> spare } else { word as i64 }
            })
            .collect())
    }
}
