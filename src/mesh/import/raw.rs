//! A mesh as a file states it: file ids, file unit, nothing checked beyond the syntax.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use crate::{Error, Result};

/// What a reader hands to `repair`.
#[derive(Debug)]
pub(super) struct RawMesh {
    /// The file in messages.
    pub name: String,
    /// How the format calls its nodes and elements, to name them by their ids.
    pub words: Words,
    pub nodes: Vec<RawNode>,
    pub tets: Vec<RawTet>,
    /// Names of the regions; `RawTet::region` points here.
    pub regions: Vec<String>,
    /// Indices into `nodes`, in any order, possibly repeated.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    pub notices: Vec<String>,
    /// Ten-node tetrahedra among `tets`, of which the corners are kept.
    pub ten_node: u64,
    /// Elements other than tetrahedra that are kept.
    others: BTreeMap<(ElementClass, String), u64>,
    region_index: HashMap<String, u32>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Words {
    pub node: &'static str,
    pub element: &'static str,
    /// How to get first-order elements out of the program that writes this format.
    pub first_order: &'static str,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct RawNode {
    pub id: u64,
    /// Position in the unit of the file, finite.
    pub position: DVec3,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct RawTet {
    pub id: u64,
    /// Indices into `RawMesh::nodes`.
    pub nodes: [u32; 4],
    /// Index into `RawMesh::regions`.
    pub region: u32,
}

/// What an element other than a four-node tetrahedron means for the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum ElementClass {
    /// A tetrahedron with nodes on its edges and faces, of third order or more.
    HighOrderTet,
    /// A volume that would be missing.
    Volume,
    /// Points, lines and surfaces, which carry no tissue.
    Lower,
}

/// Most nodes, and most elements of all kinds: several times what a device takes.
pub(super) const MOST_ENTITIES: u64 = 4 << 20;
/// Way out where there are more.
pub(super) const COARSER: &str = "write a coarser mesh, and no more of it than the needle meets";

/// Most sets that a node or element may be in on average: a short file could otherwise name all of them again and again.
pub(super) const MOST_SETS: usize = 64;

impl RawMesh {
    pub fn new(name: &str, words: Words) -> Self {
        RawMesh {
            name: name.to_string(),
            words,
            nodes: Vec::new(),
            tets: Vec::new(),
            regions: Vec::new(),
            node_sets: BTreeMap::new(),
            notices: Vec::new(),
            ten_node: 0,
            others: BTreeMap::new(),
            region_index: HashMap::new(),
        }
    }

    /// Index of the region of this name.
    pub fn region(&mut self, name: &str) -> u32 {
        if let Some(&region) = self.region_index.get(name) {
            return region;
        }
        let region = self.regions.len() as u32;
        self.regions.push(name.to_string());
        self.region_index.insert(name.to_string(), region);
        region
    }

    /// Counts elements that are not kept; `kind` is a plural ("hexahedra").
    pub fn count_other(&mut self, class: ElementClass, kind: &str, count: u64) {
        *self.others.entry((class, kind.to_string())).or_default() += count;
    }

    /// Refuses a file whose volume is not made of tetrahedra of first or second order alone.
    pub fn refuse_other_volumes(&mut self) -> Result<()> {
        let list = |class: ElementClass| -> String {
            let kinds: Vec<String> = self
                .others
                .iter()
                .filter(|((c, _), _)| *c == class)
                .map(|((_, kind), n)| format!("{n} {kind}"))
                .collect();
            kinds.join(", ")
        };
        let [high, volumes, lower] = [ElementClass::HighOrderTet, ElementClass::Volume, ElementClass::Lower].map(list);
        let (name, tets) = (&self.name, self.tets.len());
        if !high.is_empty() {
            return Err(Error::input(
                format!("{name}: the file holds {high}; only tetrahedra with four or ten nodes are read"),
                self.words.first_order,
            ));
        }
        if !volumes.is_empty() {
            let message = if tets == 0 {
                format!("{name}: the file holds no tetrahedra, but {volumes}")
            } else {
                format!(
                    "{name}: the file mixes {tets} tetrahedra with {volumes}, which would leave holes in the tissue"
                )
            };
            return Err(Error::input(
                message,
                "mesh the whole body with four-node tetrahedra; a structured block is made by [tissue], without a file",
            ));
        }
        if tets == 0 {
            let only = if lower.is_empty() { "no elements at all".to_string() } else { format!("only {lower}") };
            return Err(Error::input(
                format!("{name}: the file holds no tetrahedra, {only}"),
                "fill the body with tetrahedra in the mesh generator and save the volume mesh, not only its surface",
            ));
        }
        if self.ten_node > 0 {
            self.notices.push(format!(
                "{} ten-node tetrahedra are taken by their four corners: their edges become straight.",
                self.ten_node
            ));
        }
        if !lower.is_empty() {
            self.notices.push(format!("{lower} carry no tissue and are left out."));
        }
        Ok(())
    }
}
