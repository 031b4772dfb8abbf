//! Abaqus input files (`.inp`): nodes, C3D4 and C3D10 elements and sets of a single part, in one file or in several (`include`).
//!
//! Source: Abaqus Keywords Reference, *NODE, *ELEMENT, *ELSET, *NSET. Keywords and labels do not mind upper and lower
//! case; the spelling first met is kept for names. Only what defines the mesh is read, the model data are stepped over.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use glam::DVec3;

use super::raw::{ElementClass, MOST_SETS, RawMesh, RawNode, RawTet, Words};
use super::source::{Piece, Source, excerpt};
use crate::{Error, Result};

const WORDS: Words = Words {
    node: "node",
    element: "element",
    first_order: "mesh the part with linear elements (C3D4) and write the input file again",
};

/// Region of elements that are in no set.
const NO_SET: &str = "region-0";

/// Reads the bytes of an `.inp` file; `pieces`: where they come from, if from several files.
pub(super) fn read(name: &str, bytes: &[u8], pieces: Vec<Piece>) -> Result<RawMesh> {
    let mut file = AbaqusFile {
        source: Source::of_pieces(name, bytes, pieces),
        raw: RawMesh::new(name, WORDS),
        node_index: HashMap::new(),
        elements: Vec::new(),
        element_index: HashMap::new(),
        other_elements: HashSet::new(),
        element_sets: Sets::default(),
        node_sets: Sets::default(),
        surfaces: Vec::new(),
        parts: 0,
        instances: 0,
    };
    file.source.refuse_zeros()?;
    file.keywords()?;
    file.add_elements()?;
    file.raw.refuse_other_volumes()?;
    file.add_regions()?;
    file.add_node_sets()?;
    file.add_surfaces()?;
    Ok(file.raw)
}

struct AbaqusFile<'a> {
    source: Source<'a>,
    raw: RawMesh,
    node_index: HashMap<u64, u32>,
    elements: Vec<Element>,
    /// Index into `elements` by id.
    element_index: HashMap<u64, usize>,
    /// Ids of elements that are left out; sets may name them.
    other_elements: HashSet<u64>,
    element_sets: Sets,
    node_sets: Sets,
    surfaces: Vec<Surface>,
    parts: u32,
    instances: u32,
}

/// Nodes or elements that a small file counts as having more, so that sets of sets fit.
const FEW: usize = 100;

struct Element {
    id: u64,
    nodes: [u64; 4],
    at: usize,
}

/// A surface: sides of elements, or nodes.
struct Surface {
    name: String,
    of: SetKind,
    /// Where a line stands, an element, a node or a set of them, and which side of the elements.
    lines: Vec<(usize, Members, Option<usize>)>,
}

/// Corners of the sides S1 to S4 of a tetrahedron.
const SIDES: [[usize; 3]; 4] = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];

/// Sets in the order in which they are listed last, by their name in capitals.
#[derive(Default)]
struct Sets {
    sets: BTreeMap<String, Set>,
    listed: usize,
}

struct Set {
    /// The name as it was first spelt.
    name: String,
    /// Rank of the last keyword that names the set.
    listed: usize,
    /// Made by the program that wrote the file.
    is_internal: bool,
    members: Vec<Member>,
}

struct Member {
    at: usize,
    what: Members,
}

enum Members {
    Id(u64),
    Range { first: u64, last: u64, step: u64 },
    Set(String),
}

impl Sets {
    /// The set of this name, now listed last.
    fn open(&mut self, name: &str) -> &mut Set {
        self.listed += 1;
        let key = name.to_uppercase();
        let set = self.sets.entry(key).or_insert_with(|| Set {
            name: name.to_string(),
            listed: 0,
            is_internal: false,
            members: Vec::new(),
        });
        set.listed = self.listed;
        set
    }

    /// Ids of a set, with those of the sets that it names. `left`: how many ids may still be named in all sets together.
    fn resolve(
        &self,
        source: &Source,
        key: &str,
        known: &BTreeSet<u64>,
        what: &str,
        left: &mut usize,
    ) -> Result<BTreeSet<u64>> {
        let mut ids = BTreeSet::new();
        let mut open = vec![key.to_string()];
        let mut seen: HashSet<String> = open.iter().cloned().collect();
        while let Some(key) = open.pop() {
            let set = &self.sets[&key];
            for member in &set.members {
                let missing = |id: u64| {
                    let message = format!("set {} names {what} {id}, which is not in the file", set.name);
                    source.fail(member.at, message, "correct the set or write the input file again")
                };
                let mut named = || {
                    *left = left.checked_sub(1).ok_or_else(|| {
                        source.fail(
                            member.at,
                            format!("the sets name the {what}s more than {MOST_SETS} times each on average"),
                            "remove sets that say the same",
                        )
                    })?;
                    Ok(())
                };
                named()?;
                match &member.what {
                    Members::Id(id) if known.contains(id) => {
                        ids.insert(*id);
                    }
                    Members::Id(id) => return Err(missing(*id)),
                    Members::Range { first, last, step } => {
                        // The first id that is missing ends the loop, so that a range can be no longer than the file.
                        for id in (*first..=*last).step_by(usize::try_from(*step).unwrap_or(usize::MAX)) {
                            if !known.contains(&id) {
                                return Err(missing(id));
                            }
                            named()?;
                            ids.insert(id);
                        }
                    }
                    Members::Set(other) => {
                        if !self.sets.contains_key(other) {
                            let message = format!("set {} names set {other}, which is not in the file", set.name);
                            return Err(source.fail(
                                member.at,
                                message,
                                "correct the set or write the input file again",
                            ));
                        }
                        if seen.insert(other.clone()) {
                            open.push(other.clone());
                        }
                    }
                }
            }
        }
        Ok(ids)
    }
}

/// A keyword line with its parameters, names in capitals.
struct Keyword {
    at: usize,
    name: String,
    parameters: Vec<(String, String)>,
}

impl Keyword {
    fn parameter(&self, name: &str) -> Option<&str> {
        self.parameters.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

impl AbaqusFile<'_> {
    /// The next line that is no comment and not empty, without moving on.
    fn peek_line(&mut self) -> Option<(usize, String)> {
        loop {
            let at = self.source.at();
            let line = self.source.line()?.trim_ascii();
            if !line.is_empty() && !line.starts_with(b"**") {
                let text = String::from_utf8_lossy(line).into_owned();
                self.source.seek(at);
                return Some((at, text));
            }
        }
    }

    fn next_line(&mut self) -> Option<(usize, String)> {
        let line = self.peek_line()?;
        self.source.line();
        Some(line)
    }

    /// The next data line; `None` before a keyword and at the end.
    fn next_data(&mut self) -> Option<(usize, String)> {
        match self.peek_line() {
            Some((_, line)) if !line.starts_with('*') => self.next_line(),
            _ => None,
        }
    }

    /// Fields of the next data line and of those that continue it behind a comma at the end.
    fn next_record(&mut self) -> Option<(usize, Vec<String>)> {
        let (at, mut line) = self.next_data()?;
        while line.ends_with(',') {
            match self.next_data() {
                Some((_, more)) => line += &more,
                None => break,
            }
        }
        Some((at, fields(&line)))
    }

    /// A keyword line; it goes on behind a comma at its end.
    fn keyword(&mut self, at: usize, first: String) -> Result<Keyword> {
        let mut text = first;
        while text.ends_with(',') {
            match self.next_data() {
                Some((_, more)) => text += &more,
                None => return Err(self.source.broken(at, "the keyword line ends in a comma, but nothing follows")),
            }
        }
        let mut parts = split_quoted(&text[1..]).into_iter();
        let name = parts.next().unwrap_or_default().to_uppercase().split_whitespace().collect::<Vec<_>>().join(" ");
        let parameters = parts
            .filter(|part| !part.is_empty())
            .map(|part| {
                let (key, value) = part.split_once('=').unwrap_or((&part, ""));
                (key.trim().to_uppercase(), value.trim().trim_matches('"').trim().to_string())
            })
            .collect();
        Ok(Keyword { at, name, parameters })
    }

    fn keywords(&mut self) -> Result<()> {
        while let Some((at, line)) = self.next_line() {
            if !line.starts_with('*') {
                // Data of a keyword that does not concern the mesh.
                continue;
            }
            let keyword = self.keyword(at, line)?;
            match keyword.name.as_str() {
                "NODE" => self.nodes(&keyword)?,
                "ELEMENT" => self.elements(&keyword)?,
                "ELSET" => self.set(&keyword, SetKind::Elements)?,
                "NSET" => self.set(&keyword, SetKind::Nodes)?,
                "SURFACE" => self.surface(&keyword),
                "INCLUDE" => {
                    return Err(self.source.fail(
                        at,
                        format!(
                            "*INCLUDE, INPUT={}: other files are not read",
                            keyword.parameter("INPUT").unwrap_or("?")
                        ),
                        "put the text of that file in place of this line",
                    ));
                }
                "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY" | "SYSTEM" => {
                    return Err(self.source.fail(
                        at,
                        format!("*{} makes or moves nodes or elements by rule, which is not done here", keyword.name),
                        "write the input file with every node and element listed",
                    ));
                }
                "PART" => {
                    self.parts += 1;
                    self.refuse_second(at, self.parts, "part")?;
                }
                "INSTANCE" => {
                    self.instances += 1;
                    self.refuse_second(at, self.instances, "instance")?;
                    self.refuse_placement()?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn refuse_second(&self, at: usize, count: u32, what: &str) -> Result<()> {
        if count < 2 {
            return Ok(());
        }
        Err(self.source.fail(
            at,
            format!("a second {what}: only a file with a single {what} is read"),
            "merge the parts into one orphan mesh and write the input file again",
        ))
    }

    /// An instance may stand only where its part was made.
    fn refuse_placement(&mut self) -> Result<()> {
        while let Some((at, fields)) = self.next_record() {
            for (number, field) in fields.iter().enumerate() {
                // The first line shifts; the second one turns about an axis by an angle.
                if self.float(at, field, "the placement of an instance")? != 0.0 && (fields.len() < 7 || number == 6) {
                    return Err(self.source.fail(
                        at,
                        "the instance is shifted or turned against its part, which is not done here",
                        "write the mesh of the assembly as one part",
                    ));
                }
            }
        }
        Ok(())
    }

    fn float(&self, at: usize, text: &str, what: &str) -> Result<f64> {
        // Fortran writes double precision with a D.
        let plain = text.replace(['d', 'D'], "e");
        match plain.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(value) => Err(self.source.broken(at, format!("{what}: {value} is not finite"))),
            Err(_) => Err(self.source.broken(at, format!("{what}: `{}` is not a number", excerpt(text.as_bytes())))),
        }
    }

    fn id(&self, at: usize, text: &str, what: &str) -> Result<u64> {
        text.parse().map_err(|_| {
            self.source.broken(at, format!("{what}: `{}` is not a whole number without sign", excerpt(text.as_bytes())))
        })
    }

    fn nodes(&mut self, keyword: &Keyword) -> Result<()> {
        if keyword.parameter("SYSTEM").is_some_and(|s| !s.eq_ignore_ascii_case("R")) {
            return Err(self.source.fail(
                keyword.at,
                "*NODE with cylindrical or spherical coordinates is not read",
                "write the nodes in rectangular coordinates",
            ));
        }
        self.refuse_parameter(keyword, "INPUT")?;
        let mut ids = Vec::new();
        while let Some((at, line)) = self.next_data() {
            let fields = fields(&line);
            let id = self.id(at, &fields[0], "the id of a node")?;
            if fields.len() < 4 {
                let message = format!("node {id} has {} coordinates instead of 3", fields.len() - 1);
                return Err(self.source.broken(at, message));
            }
            let mut position = [0.0; 3];
            for (x, field) in position.iter_mut().zip(&fields[1..4]) {
                *x = self.float(at, field, &format!("a coordinate of node {id}"))?;
            }
            let index =
                u32::try_from(self.raw.nodes.len()).map_err(|_| self.source.broken(at, "more than 2^32 nodes"))?;
            if self.node_index.insert(id, index).is_some() {
                return Err(self.source.broken(at, format!("node {id} stands in the file twice")));
            }
            self.raw.nodes.push(RawNode { id, position: DVec3::from_array(position) });
            ids.push(Member { at, what: Members::Id(id) });
        }
        if let Some(name) = keyword.parameter("NSET") {
            self.node_sets.open(name).members.extend(ids);
        }
        Ok(())
    }

    fn refuse_parameter(&self, keyword: &Keyword, parameter: &str) -> Result<()> {
        match keyword.parameter(parameter) {
            None => Ok(()),
            Some(file) => Err(self.source.fail(
                keyword.at,
                format!("*{}, {parameter}={file}: other files are not read", keyword.name),
                "put the lines of that file below this keyword",
            )),
        }
    }

    fn elements(&mut self, keyword: &Keyword) -> Result<()> {
        self.refuse_parameter(keyword, "INPUT")?;
        let Some(kind) = keyword.parameter("TYPE").map(str::to_uppercase) else {
            return Err(self.source.broken(keyword.at, "*ELEMENT tells no TYPE"));
        };
        let class = element_class(&kind);
        let mut ids = Vec::new();
        while let Some((at, fields)) = self.next_record() {
            let id = self.id(at, &fields[0], "the id of an element")?;
            ids.push(Member { at, what: Members::Id(id) });
            if let Some(class) = class {
                self.raw.count_other(class, &format!("elements of type {kind}"), 1);
                self.other_elements.insert(id);
                continue;
            }
            let count = fields.len() - 1;
            let wanted = if is_quadratic(&kind) { 10 } else { 4 };
            if count != wanted {
                return Err(self
                    .source
                    .broken(at, format!("element {id} of type {kind} has {count} nodes instead of {wanted}")));
            }
            self.raw.ten_node += u64::from(wanted == 10);
            let mut nodes = [0; 4];
            for (node, field) in nodes.iter_mut().zip(&fields[1..]) {
                *node = self.id(at, field, &format!("a node of element {id}"))?;
            }
            if self.element_index.insert(id, self.elements.len()).is_some() {
                return Err(self.source.broken(at, format!("element {id} stands in the file twice")));
            }
            self.elements.push(Element { id, nodes, at });
        }
        if let Some(name) = keyword.parameter("ELSET") {
            self.element_sets.open(name).members.extend(ids);
        }
        Ok(())
    }

    fn set(&mut self, keyword: &Keyword, kind: SetKind) -> Result<()> {
        let parameter = match kind {
            SetKind::Elements => "ELSET",
            SetKind::Nodes => "NSET",
        };
        let Some(name) = keyword.parameter(parameter).filter(|n| !n.is_empty()) else {
            return Err(self.source.broken(keyword.at, format!("*{parameter} tells no name ({parameter}=...)")));
        };
        if kind == SetKind::Nodes && keyword.parameter("ELSET").is_some() {
            return Err(self.source.fail(
                keyword.at,
                "a node set made of the nodes of an element set is not read",
                "list the nodes of the set",
            ));
        }
        let generate = keyword.parameter("GENERATE").is_some();
        let mut members = Vec::new();
        while let Some((at, line)) = self.next_data() {
            let fields = fields(&line);
            if generate {
                let what = "a generated set (first, last, step)";
                if !(2..=3).contains(&fields.len()) {
                    return Err(self.source.broken(at, format!("{what} needs 2 or 3 numbers, not {}", fields.len())));
                }
                let (first, last) = (self.id(at, &fields[0], what)?, self.id(at, &fields[1], what)?);
                let step = fields.get(2).map_or(Ok(1), |f| self.id(at, f, what))?;
                if step == 0 || last < first {
                    return Err(self
                        .source
                        .broken(at, format!("{what}: {first}, {last}, {step} never ends or is empty")));
                }
                members.push(Member { at, what: Members::Range { first, last, step } });
                continue;
            }
            for field in fields.iter().filter(|f| !f.is_empty()) {
                // Behind the name of an instance stands what it names.
                let label = field.rsplit('.').next().unwrap_or(field).trim_matches('"');
                let what = match label.parse() {
                    Ok(id) => Members::Id(id),
                    Err(_) => Members::Set(label.to_uppercase()),
                };
                members.push(Member { at, what });
            }
        }
        let sets = if kind == SetKind::Elements { &mut self.element_sets } else { &mut self.node_sets };
        let set = sets.open(name);
        set.members.extend(members);
        set.is_internal |= keyword.parameter("INTERNAL").is_some();
        Ok(())
    }

    /// Keeps a surface of sides of elements (S1 to S4) or of nodes; one of another kind is told and left out.
    fn surface(&mut self, keyword: &Keyword) {
        let name = keyword.parameter("NAME").unwrap_or_default().to_string();
        let of = match keyword.parameter("TYPE").map(str::to_uppercase).as_deref() {
            None | Some("ELEMENT") => SetKind::Elements,
            Some("NODE") => SetKind::Nodes,
            Some(_) => return self.left_out(&name),
        };
        let mut lines = Vec::new();
        while let Some((at, line)) = self.next_data() {
            let fields = fields(&line);
            let label = fields[0].rsplit('.').next().unwrap_or_default().trim_matches('"');
            let what = label.parse().map_or_else(|_| Members::Set(label.to_uppercase()), Members::Id);
            let side = fields
                .get(1)
                .and_then(|side| ["S1", "S2", "S3", "S4"].iter().position(|s| side.eq_ignore_ascii_case(s)));
            if label.is_empty() || of == SetKind::Elements && side.is_none() {
                return self.left_out(&name);
            }
            lines.push((at, what, side));
        }
        if !name.is_empty() && !lines.is_empty() {
            self.surfaces.push(Surface { name, of, lines });
        }
    }

    fn left_out(&mut self, name: &str) {
        self.raw
            .notices
            .push(format!("Surface `{name}` names no sides S1 to S4 of elements and no nodes; it is left out."));
    }

    /// Surfaces as sets of their nodes.
    fn add_surfaces(&mut self) -> Result<()> {
        let nodes: BTreeSet<u64> = self.raw.nodes.iter().map(|n| n.id).collect();
        let mut elements: BTreeSet<u64> = self.elements.iter().map(|e| e.id).collect();
        elements.extend(&self.other_elements);
        let mut left = MOST_SETS * (nodes.len() + elements.len() + FEW);
        for surface in std::mem::take(&mut self.surfaces) {
            let (sets, known, word) = match surface.of {
                SetKind::Elements => (&self.element_sets, &elements, "element"),
                SetKind::Nodes => (&self.node_sets, &nodes, "node"),
            };
            let mut found: Vec<u32> = Vec::new();
            for (at, what, side) in &surface.lines {
                let ids = match what {
                    Members::Set(key) if sets.sets.contains_key(key) => {
                        sets.resolve(&self.source, key, known, word, &mut left)?
                    }
                    Members::Id(id) if known.contains(id) => BTreeSet::from([*id]),
                    _ => {
                        return Err(self.source.fail(
                            *at,
                            format!("surface {} names a set or {word} that is not in the file", surface.name),
                            "correct the surface or write the input file again",
                        ));
                    }
                };
                match side.filter(|_| surface.of == SetKind::Elements) {
                    None => found.extend(ids.iter().map(|id| self.node_index[id])),
                    Some(side) => {
                        let tets = ids.iter().filter_map(|id| self.element_index.get(id));
                        let corners = tets.flat_map(|tet| SIDES[side].map(|corner| self.elements[*tet].nodes[corner]));
                        found.extend(corners.map(|id| self.node_index[&id]));
                    }
                }
            }
            self.raw.node_sets.entry(surface.name).or_default().extend(found);
        }
        Ok(())
    }

    fn add_elements(&mut self) -> Result<()> {
        for element in &self.elements {
            let mut nodes = [0; 4];
            for (index, node) in nodes.iter_mut().zip(element.nodes) {
                *index = *self.node_index.get(&node).ok_or_else(|| missing_node(&self.source, element, node))?;
            }
            self.raw.tets.push(RawTet { id: element.id, nodes, region: u32::MAX });
        }
        Ok(())
    }

    fn add_regions(&mut self) -> Result<()> {
        let mut known: BTreeSet<u64> = self.elements.iter().map(|e| e.id).collect();
        known.extend(&self.other_elements);
        // Sets that the writing program made for a surface are no tissue of their own.
        let of_surfaces: HashSet<&String> = (self.surfaces.iter().flat_map(|surface| &surface.lines))
            .filter_map(|(_, what, _)| if let Members::Set(key) = what { Some(key) } else { None })
            .collect();
        let is_region = |key: &String, set: &Set| !(set.is_internal && of_surfaces.contains(key));
        let mut order: Vec<(&String, &Set)> =
            self.element_sets.sets.iter().filter(|(key, set)| is_region(key, set)).collect();
        order.sort_by_key(|(_, set)| set.listed);
        let mut left = MOST_SETS * (known.len() + FEW);
        let mut shared = 0;
        let mut in_several = vec![false; self.elements.len()];
        for (key, set) in order {
            let region = self.raw.region(&set.name);
            for id in self.element_sets.resolve(&self.source, key, &known, "element", &mut left)? {
                let Some(&index) = self.element_index.get(&id) else { continue };
                let tet = &mut self.raw.tets[index];
                if tet.region != u32::MAX && !std::mem::replace(&mut in_several[index], true) {
                    shared += 1;
                }
                tet.region = region;
            }
        }
        if shared > 0 {
            self.raw
                .notices
                .push(format!("{shared} elements are in several sets; the set listed last is their region."));
        }
        let without = self.raw.tets.iter().filter(|t| t.region == u32::MAX).count();
        if without > 0 {
            let region = self.raw.region(NO_SET);
            self.raw.tets.iter_mut().filter(|t| t.region == u32::MAX).for_each(|t| t.region = region);
            self.raw.notices.push(format!("{without} elements are in no element set; their region is `{NO_SET}`."));
        }
        Ok(())
    }

    fn add_node_sets(&mut self) -> Result<()> {
        let known: BTreeSet<u64> = self.raw.nodes.iter().map(|n| n.id).collect();
        let mut left = MOST_SETS * (known.len() + FEW);
        for (key, set) in &self.node_sets.sets {
            let ids = self.node_sets.resolve(&self.source, key, &known, "node", &mut left)?;
            let nodes = ids.iter().map(|id| self.node_index[id]).collect();
            self.raw.node_sets.insert(set.name.clone(), nodes);
        }
        Ok(())
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum SetKind {
    Elements,
    Nodes,
}

fn missing_node(source: &Source, element: &Element, node: u64) -> Error {
    source.broken(element.at, format!("element {} names node {node}, which is not in the file", element.id))
}

/// Whether a type is the base or one of its formulations (C3D4, C3D4H, ...), not one with more nodes (C3D40).
fn is_of(kind: &str, base: &str) -> bool {
    kind.strip_prefix(base).is_some_and(|s| !s.starts_with(|c: char| c.is_ascii_digit()))
}

/// Whether a type is the ten-node tetrahedron, whose corners come first.
fn is_quadratic(kind: &str) -> bool {
    is_of(kind, "C3D10")
}

/// What an element type means; `None` for tetrahedra of four and ten nodes in all their formulations.
fn element_class(kind: &str) -> Option<ElementClass> {
    if is_of(kind, "C3D4") || is_quadratic(kind) {
        return None;
    }
    let volume = ["C3D", "DC3D", "AC3D", "SC", "CSS", "COH3D", "CIN3D", "EC3D", "Q3D"];
    Some(if volume.iter().any(|v| kind.strip_prefix(v).is_some_and(|s| s.starts_with(|c: char| c.is_ascii_digit()))) {
        ElementClass::Volume
    } else {
        ElementClass::Lower
    })
}

/// Fields of a data line, trimmed; a comma at the end adds none.
fn fields(line: &str) -> Vec<String> {
    let line = line.trim().strip_suffix(',').unwrap_or(line.trim());
    line.split(',').map(|f| f.trim().to_string()).collect()
}

/// Splits at commas outside quotes, trimmed.
fn split_quoted(text: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    let mut quoted = false;
    for c in text.chars() {
        quoted ^= c == '"';
        match parts.last_mut() {
            Some(part) if quoted || c != ',' => part.push(c),
            _ => parts.push(String::new()),
        }
    }
    parts.iter().map(|p| p.trim().to_string()).collect()
}
