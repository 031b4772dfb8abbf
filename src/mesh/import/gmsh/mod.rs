//! Gmsh meshes, MSH 1, 2.x and 4.1, the latter two as text and binary.
//!
//! Source: Gmsh reference manual, "MSH file format", "MSH file format version 1 (Legacy)" and "version 2 (Legacy)". A binary file holds the
//! records of the text as `int` (4 bytes), `double` and, in version 4.1, `size_t` (its width stands in the header).
//! Regions are physical volumes; physical surfaces, curves and points become node sets.

mod records;
mod shape;

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec3;

use super::raw::{ElementClass, MOST_SETS, RawMesh, RawNode, RawTet, Words};
use super::source::{Source, WRITE_AGAIN, excerpt};
use crate::{Error, Result};
use records::{Binary, Records};
use shape::Shape;

const WORDS: Words = Words {
    node: "node",
    element: "element",
    first_order: "write a mesh of first order: in Gmsh, set Mesh.ElementOrder = 1, mesh and save again",
};

const SAVE_41: &str = "save the mesh as version 4.1 or 2.2: in Gmsh, set Mesh.MshFileVersion = 4.1 and save again";

/// Reads the bytes of a `.msh` file.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<RawMesh> {
    let mut file = GmshFile {
        records: Records { source: Source::new(name, bytes), width: None },
        raw: RawMesh::new(name, WORDS),
        version: Version::V2,
        physical_names: BTreeMap::new(),
        entity_groups: HashMap::new(),
        node_index: HashMap::new(),
        groups: Vec::new(),
        group_index: HashMap::new(),
        lower_groups: BTreeMap::new(),
        shared_entities: BTreeSet::new(),
        found_elements: false,
    };
    file.sections()?;
    file.name_groups();
    file.raw.refuse_other_volumes()?;
    Ok(file.raw)
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Version {
    /// `$NOD` and `$ELM` without a header; always text.
    V1,
    V2,
    V41,
}

/// Where an element belongs: its physical group, 0 without one, and its geometric entity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Group {
    physical: u64,
    entity: i64,
}

struct GmshFile<'a> {
    records: Records<'a>,
    raw: RawMesh,
    version: Version,
    /// Names by dimension and tag.
    physical_names: BTreeMap<(i64, u64), String>,
    /// Physical tags by dimension and tag of an entity (version 4.1).
    entity_groups: HashMap<(i64, i64), Vec<u64>>,
    /// Index of a node by its id.
    node_index: HashMap<u64, u32>,
    /// Groups of tetrahedra; until the names are known, `RawTet::region` points here.
    groups: Vec<Group>,
    group_index: HashMap<Group, u32>,
    /// Nodes of physical groups of surfaces, curves and points by dimension and tag.
    lower_groups: BTreeMap<(i64, u64), Vec<u32>>,
    /// Volumes that belong to several physical groups.
    shared_entities: BTreeSet<i64>,
    found_elements: bool,
}

impl GmshFile<'_> {
    fn sections(&mut self) -> Result<()> {
        let mut found_format = false;
        let mut found_nodes = false;
        while !self.records.source.is_done() {
            let at = self.records.source.at();
            let line = self.records.source.line().unwrap_or_default().trim_ascii();
            let title = excerpt(line);
            let Some(section) = title.strip_prefix('$') else {
                return Err(self
                    .records
                    .source
                    .broken(at, format!("`{title}` stands where a section ($...) should start")));
            };
            if !found_format && section == "NOD" {
                self.version = Version::V1;
                found_format = true;
            }
            if !found_format && section != "MeshFormat" && section != "Comments" {
                return Err(self.records.source.fail(at, format!("${section} stands before $MeshFormat"), SAVE_41));
            }
            let first = self.version == Version::V1;
            match section {
                "NOD" if first => {
                    self.read_nodes_2()?;
                    found_nodes = true;
                }
                "ELM" if first && found_nodes => {
                    self.read_elements_1()?;
                    self.found_elements = true;
                }
                _ if first => {
                    return Err(self.records.source.broken(
                        at,
                        format!("${section} stands in a file of version 1, which has $NOD and $ELM alone"),
                    ));
                }
                "MeshFormat" => {
                    self.header()?;
                    found_format = true;
                }
                "PhysicalNames" => self.read_physical_names()?,
                "Entities" if self.version == Version::V41 && !self.found_elements => self.read_entities()?,
                "PartitionedEntities" => {
                    return Err(self.records.source.fail(
                        at,
                        "the mesh is cut into partitions",
                        "save the whole mesh without partitions",
                    ));
                }
                "Nodes" => {
                    match self.version {
                        Version::V1 | Version::V2 => self.read_nodes_2()?,
                        Version::V41 => self.read_nodes_41()?,
                    }
                    found_nodes = true;
                }
                "Elements" if !found_nodes => {
                    return Err(self.records.source.broken(at, "$Elements stands before $Nodes"));
                }
                "Elements" => {
                    match self.version {
                        Version::V1 | Version::V2 => self.read_elements_2()?,
                        Version::V41 => self.read_elements_41()?,
                    }
                    self.found_elements = true;
                }
                _ => {
                    self.skip_section(at, section)?;
                    continue;
                }
            }
            self.end_section(section)?;
        }
        let end = self.records.source.at();
        let [nodes, elements] = if self.version == Version::V1 { ["$NOD", "$ELM"] } else { ["$Nodes", "$Elements"] };
        for (found, section) in [(found_format, "$MeshFormat"), (found_nodes, nodes), (self.found_elements, elements)] {
            if !found {
                return Err(self.records.source.broken(end, format!("the file ends without {section}")));
            }
        }
        Ok(())
    }

    fn end_section(&mut self, section: &str) -> Result<()> {
        self.records.source.skip_space();
        let at = self.records.source.at();
        let line = self.records.source.line().unwrap_or_default().trim_ascii();
        let end = if self.version == Version::V1 { "$END" } else { "$End" };
        if line.strip_prefix(end.as_bytes()) == Some(section.as_bytes()) {
            return Ok(());
        }
        let found = if line.is_empty() { "the file ends".to_string() } else { format!("`{}` stands", excerpt(line)) };
        Err(self.records.source.broken(
            at,
            format!(
                "{found} where {end}{section} should stand: the file is cut short or the count of the section is wrong"
            ),
        ))
    }

    /// Sections without bearing on the mesh: fields, periodicity, comments.
    fn skip_section(&mut self, at: usize, section: &str) -> Result<()> {
        let mark = format!("$End{section}");
        let rest = self.records.source.rest();
        match rest.windows(mark.len()).position(|w| w == mark.as_bytes()) {
            Some(offset) => {
                let end = self.records.source.at() + offset + mark.len();
                self.records.source.seek(end);
                Ok(())
            }
            None => Err(self.records.source.broken(at, format!("${section} has no end: {mark} is missing"))),
        }
    }

    fn header(&mut self) -> Result<()> {
        let source = &mut self.records.source;
        let (at, version) = source.field("the version")?;
        self.version = match version {
            b"2" | b"2.0" | b"2.1" | b"2.2" => Version::V2,
            b"4.1" => Version::V41,
            _ => {
                let message = format!("MSH version {} is not read here, only 1, 2.2 and 4.1", excerpt(version));
                return Err(source.fail(at, message, SAVE_41));
            }
        };
        let at = source.at();
        let kind: u64 = source.number_in_line("the file type")?;
        if kind > 1 {
            return Err(source.broken(at, format!("file type {kind} is neither 0 (text) nor 1 (binary)")));
        }
        let at = source.at();
        let size: u64 = source.number_in_line("the size of a number")?;
        if size != 8 && (size != 4 || self.version == Version::V2) {
            return Err(source.broken(at, format!("numbers of {size} bytes cannot be read, only of 8")));
        }
        if kind == 0 {
            source.refuse_zeros()?;
            return source.end_line();
        }
        source.line();
        source.binary = true;
        let at = source.at();
        let one = source.take(4, "the integer 1 that shows the byte order")?;
        let big_endian = match one {
            [1, 0, 0, 0] => false,
            [0, 0, 0, 1] => true,
            _ => return Err(source.broken(at, "the integer that shows the byte order is not 1")),
        };
        self.records.width = Some(Binary { big_endian, size });
        Ok(())
    }

    /// Names are text in binary files, too.
    fn read_physical_names(&mut self) -> Result<()> {
        let source = &mut self.records.source;
        let count: u64 = source.number_in_line("the number of physical names")?;
        source.end_line()?;
        for _ in 0..count {
            let dimension: i64 = source.number_in_line("the dimension of a physical group")?;
            let tag: i64 = source.number_in_line("the tag of a physical group")?;
            let at = source.at();
            let line = String::from_utf8_lossy(source.line().unwrap_or_default()).trim().to_string();
            let Some(name) = line.strip_prefix('"').and_then(|l| l.strip_suffix('"')) else {
                return Err(source.broken(at, "the name of a physical group must stand in quotes"));
            };
            if !name.trim().is_empty() {
                self.physical_names.insert((dimension, tag.unsigned_abs()), name.trim().to_string());
            }
        }
        Ok(())
    }

    fn read_entities(&mut self) -> Result<()> {
        let records = &mut self.records;
        let mut counts = [0; 4];
        for (count, what) in counts.iter_mut().zip(["points", "curves", "surfaces", "volumes"]) {
            *count = records.size(&format!("the number of {what}"))?;
        }
        records.end()?;
        for (dimension, count) in (0..).zip(counts) {
            for _ in 0..count {
                let tag = records.int("the tag of an entity")?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    records.float("the bounds of an entity")?;
                }
                let mut groups = Vec::new();
                let at = records.source.at();
                let count = records.size("the number of physical groups")?;
                if count > MOST_SETS as u64 {
                    return Err(records.source.fail(
                        at,
                        format!("an entity is in {count} physical groups, at most {MOST_SETS} are read"),
                        "name the parts of the body by few physical groups and save again",
                    ));
                }
                for _ in 0..count {
                    let group = records.int("the tag of a physical group")?.unsigned_abs();
                    if group != 0 {
                        groups.push(group);
                    }
                }
                if dimension > 0 {
                    for _ in 0..records.size("the number of bounding entities")? {
                        records.int("the tag of a bounding entity")?;
                    }
                }
                records.end()?;
                self.entity_groups.insert((dimension, tag), groups);
            }
        }
        Ok(())
    }

    fn add_node(&mut self, at: usize, id: u64, position: DVec3) -> Result<()> {
        let index = u32::try_from(self.raw.nodes.len()).map_err(|_| too_many(&self.records.source, at))?;
        if self.node_index.insert(id, index).is_some() {
            return Err(self.records.source.broken(at, format!("node {id} stands in the file twice")));
        }
        self.raw.nodes.push(RawNode { id, position });
        Ok(())
    }

    fn read_nodes_2(&mut self) -> Result<()> {
        // The count is text in binary files, too.
        let count: u64 = self.records.source.number_in_line("the number of nodes")?;
        self.end_text_line()?;
        for _ in 0..count {
            let at = self.records.source.at();
            self.expect_record(at, "a node", "the end of the section")?;
            let id = self.records.id("the id of a node")?;
            let position = self.records.position(id)?;
            self.records.end()?;
            self.add_node(at, id, position)?;
        }
        Ok(())
    }

    /// Ends a line of text before what may be binary data, whose first bytes may look like space.
    fn end_text_line(&mut self) -> Result<()> {
        if self.records.width.is_none() {
            return self.records.source.end_line();
        }
        let at = self.records.source.at();
        match self.records.source.line() {
            Some(rest) if rest.trim_ascii().is_empty() => Ok(()),
            _ => Err(self.records.source.broken(at, "the line should end here")),
        }
    }

    /// A clearer word than "`$EndNodes` is not a number" where the count promises more than there is.
    fn expect_record(&self, at: usize, what: &str, end_mark: &str) -> Result<()> {
        if self.records.width.is_none() && self.records.source.rest().starts_with(b"$") {
            return Err(self.records.source.broken(
                at,
                format!(
                    "the section ends where {what} should stand: its count is larger than what follows up to {end_mark}"
                ),
            ));
        }
        Ok(())
    }

    fn read_nodes_41(&mut self) -> Result<()> {
        let blocks = self.records.size("the number of node blocks")?;
        for what in ["the number of nodes", "the smallest node id", "the largest node id"] {
            self.records.size(what)?;
        }
        self.records.end()?;
        for _ in 0..blocks {
            let at = self.records.source.at();
            self.expect_record(at, "a node block", "$EndNodes")?;
            let dimension = self.records.int("the dimension of an entity")?;
            self.records.int("the tag of an entity")?;
            let parametric = self.records.int("the mark of parametric nodes")?;
            let count = self.records.size("the number of nodes in a block")?;
            self.records.end()?;
            if !(0..=3).contains(&dimension) || !(0..=1).contains(&parametric) {
                return Err(self.records.source.broken(at, "this is not the head of a node block"));
            }
            let mut ids = Vec::new();
            for _ in 0..count {
                let at = self.records.source.at();
                self.expect_record(at, "a node", "$EndNodes")?;
                ids.push(self.records.size("the id of a node")?);
                self.records.end()?;
            }
            for id in ids {
                let at = self.records.source.at();
                self.expect_record(at, "a node", "$EndNodes")?;
                let position = self.records.position(id)?;
                for _ in 0..parametric * dimension {
                    self.records.float("a parametric coordinate")?;
                }
                self.records.end()?;
                self.add_node(at, id, position)?;
            }
        }
        Ok(())
    }

    /// A line of version 1: id, type, physical group, entity, number of nodes, nodes.
    fn read_elements_1(&mut self) -> Result<()> {
        let count: u64 = self.records.source.number_in_line("the number of elements")?;
        self.end_text_line()?;
        for _ in 0..count {
            let at = self.records.source.at();
            self.expect_record(at, "an element", "$ENDELM")?;
            let id = self.records.id("the id of an element")?;
            let shape = self.shape(at)?;
            let group = Group {
                physical: self.records.int("the physical group")?.unsigned_abs(),
                entity: self.records.int("the geometric entity")?,
            };
            let nodes = self.records.id("the number of nodes")?;
            if nodes != u64::from(shape.nodes) {
                let message =
                    format!("element {id} has {nodes} nodes; {} of its type have {}", shape.kind, shape.nodes);
                return Err(self.records.source.broken(at, message));
            }
            self.read_corners(at, id, shape, group)?;
            self.records.end()?;
        }
        Ok(())
    }

    fn read_elements_2(&mut self) -> Result<()> {
        let count: u64 = self.records.source.number_in_line("the number of elements")?;
        self.end_text_line()?;
        if self.records.width.is_none() {
            for _ in 0..count {
                let at = self.records.source.at();
                self.expect_record(at, "an element", "$EndElements")?;
                let id = self.records.id("the id of an element")?;
                let shape = self.shape(at)?;
                let tags = self.records.id("the number of tags")?;
                self.read_element_2(at, id, shape, tags)?;
                self.records.end()?;
            }
            return Ok(());
        }
        let mut read = 0;
        while read < count {
            let at = self.records.source.at();
            let shape = self.shape(at)?;
            let in_block = self.records.id("the number of elements in a block")?;
            let tags = self.records.id("the number of tags")?;
            if in_block == 0 || in_block > count - read {
                let message = format!("a block of {in_block} elements where {} are left", count - read);
                return Err(self.records.source.broken(at, message));
            }
            for _ in 0..in_block {
                let at = self.records.source.at();
                let id = self.records.id("the id of an element")?;
                self.read_element_2(at, id, shape, tags)?;
            }
            read += in_block;
        }
        Ok(())
    }

    /// Tags and nodes of an element of version 2.
    fn read_element_2(&mut self, at: usize, id: u64, shape: Shape, tags: u64) -> Result<()> {
        let mut group = Group { physical: 0, entity: 0 };
        for number in 0..tags {
            let tag = self.records.int("a tag")?;
            match number {
                0 => group.physical = tag.unsigned_abs(),
                1 => group.entity = tag,
                _ => {}
            }
        }
        self.read_corners(at, id, shape, group)
    }

    /// The nodes of an element of version 1 or 2, which ends with them.
    fn read_corners(&mut self, at: usize, id: u64, shape: Shape, group: Group) -> Result<()> {
        let mut nodes = [0; 4];
        for corner in 0..shape.nodes {
            let node = self.records.id("a node of an element")?;
            if shape.kept() {
                let index = self.index_of(at, id, node)?;
                if let Some(kept) = nodes.get_mut(corner as usize).filter(|_| corner < shape.corners) {
                    *kept = index;
                }
            }
        }
        self.add_element(at, id, shape, &nodes, &[group.physical], group.entity)
    }

    fn read_elements_41(&mut self) -> Result<()> {
        let blocks = self.records.size("the number of element blocks")?;
        for what in ["the number of elements", "the smallest element id", "the largest element id"] {
            self.records.size(what)?;
        }
        self.records.end()?;
        for _ in 0..blocks {
            let at = self.records.source.at();
            self.expect_record(at, "an element block", "$EndElements")?;
            let dimension = self.records.int("the dimension of an entity")?;
            let entity = self.records.int("the tag of an entity")?;
            let shape = self.shape(at)?;
            let count = self.records.size("the number of elements in a block")?;
            self.records.end()?;
            if !(0..=3).contains(&dimension) {
                return Err(self.records.source.broken(at, "this is not the head of an element block"));
            }
            let groups = self.entity_groups.get(&(dimension, entity)).cloned().unwrap_or_default();
            for _ in 0..count {
                let at = self.records.source.at();
                self.expect_record(at, "an element", "$EndElements")?;
                let id = self.records.size("the id of an element")?;
                let mut nodes = [0; 4];
                for corner in 0..shape.nodes {
                    let node = self.records.size("a node of an element")?;
                    if shape.kept() {
                        let index = self.index_of(at, id, node)?;
                        if let Some(kept) = nodes.get_mut(corner as usize).filter(|_| corner < shape.corners) {
                            *kept = index;
                        }
                    }
                }
                self.records.end()?;
                self.add_element(at, id, shape, &nodes, &groups, entity)?;
            }
        }
        Ok(())
    }

    /// The shape whose number is read next.
    fn shape(&mut self, at: usize) -> Result<Shape> {
        let number = self.records.int("the type of an element")?;
        Shape::of_number(number).ok_or_else(|| {
            self.records.source.fail(
                at,
                format!("element type {number} is not known here"),
                "save the mesh with tetrahedra of four nodes (type 4) only",
            )
        })
    }

    fn index_of(&self, at: usize, element: u64, node: u64) -> Result<u32> {
        self.node_index.get(&node).copied().ok_or_else(|| {
            self.records.source.broken(at, format!("element {element} names node {node}, which is not in the file"))
        })
    }

    fn add_element(
        &mut self,
        at: usize,
        id: u64,
        shape: Shape,
        nodes: &[u32; 4],
        physicals: &[u64],
        entity: i64,
    ) -> Result<()> {
        match shape.class {
            None => {
                if physicals.len() > 1 {
                    self.shared_entities.insert(entity);
                }
                let group = Group { physical: physicals.last().copied().unwrap_or(0), entity };
                let next = u32::try_from(self.groups.len()).map_err(|_| too_many(&self.records.source, at))?;
                let region = *self.group_index.entry(group).or_insert(next);
                if region == next {
                    self.groups.push(group);
                }
                self.raw.ten_node += u64::from(shape.nodes == 10);
                self.raw.tets.push(RawTet { id, nodes: *nodes, region });
            }
            Some(class) => {
                let in_group = shape.kept() && physicals.iter().any(|p| *p != 0);
                for physical in physicals.iter().filter(|p| **p != 0 && in_group) {
                    let set = self.lower_groups.entry((shape.dimension, *physical)).or_default();
                    set.extend(&nodes[..shape.corners as usize]);
                }
                if !in_group {
                    self.raw.count_other(class, shape.kind, 1);
                }
            }
        }
        Ok(())
    }

    /// Gives groups their names once the whole file is read.
    fn name_groups(&mut self) {
        let any_physical = self.groups.iter().any(|g| g.physical != 0);
        let mut regions = Vec::new();
        for group in std::mem::take(&mut self.groups) {
            let name = match self.physical_names.get(&(3, group.physical)) {
                Some(name) => name.clone(),
                None if group.physical != 0 => format!("region-{}", group.physical),
                None if !any_physical => format!("region-{}", group.entity),
                None => format!("volume-{}", group.entity),
            };
            regions.push(self.raw.region(&name));
        }
        for tet in &mut self.raw.tets {
            tet.region = regions[tet.region as usize];
        }
        if !any_physical && !self.raw.tets.is_empty() {
            self.raw
                .notices
                .push("No physical volumes: every volume of the geometry is a region by its number.".into());
        }
        for entity in &self.shared_entities {
            self.raw
                .notices
                .push(format!("Volume {entity} is in several physical groups; the one listed last is its region."));
        }
        for ((dimension, tag), nodes) in std::mem::take(&mut self.lower_groups) {
            let name = self.physical_names.get(&(dimension, tag)).cloned().unwrap_or_else(|| {
                let word = ["point", "curve", "surface"][dimension as usize];
                format!("{word}-{tag}")
            });
            self.raw.node_sets.entry(name).or_default().extend(nodes);
        }
    }
}

fn too_many(source: &Source, at: usize) -> Error {
    source.fail(at, "more than 2^32 nodes or groups", WRITE_AGAIN)
}
