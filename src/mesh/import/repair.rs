//! Checks behind the reader, and the canonical form of a mesh. Whatever is changed is counted in a notice; what would
//! change the tissue is an error.
//!
//! 1. nodes of no tetrahedron are dropped, unit and placement are applied, the size is checked
//! 2. nodes at the same place become one
//! 3. flat tetrahedra are refused, inverted ones turned, overlapping ones refused
//! 4. nodes and tetrahedra are sorted along a Morton curve, regions numbered as they appear there
//!
//! Every step depends on coordinates alone, not on the order of the file: see `import`.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::raw::{RawMesh, RawTet};
use super::{ImportOptions, Imported, LengthUnit};
use crate::mesh::tets::TetMesh;
use crate::{Error, Result};

/// Nodes closer than this part of the diagonal of the bounding box are one node.
const MERGE_DISTANCE: f64 = 1e-9;
/// A tetrahedron below this volume, in cubes of its longest edge, is flat.
const FLAT_VOLUME: f64 = 1e-12;
/// A tetrahedron with a smallest altitude below this part of its longest edge is a sliver.
const SLIVER: f64 = 0.02;
/// Diagonal of the bounding box [m] within which a piece of tissue is expected.
const EXPECTED_SIZE: (f64, f64) = (1e-3, 1.0);
/// A size [m] in the middle of that range, to tell which unit was meant.
const USUAL_SIZE: f64 = 0.1;

/// Checks a mesh as read and brings it into its canonical form.
pub(super) fn repair(mut raw: RawMesh, options: ImportOptions) -> Result<Imported> {
    let mut notices = std::mem::take(&mut raw.notices);
    refuse_repeated_corners(&raw)?;
    drop_unused_nodes(&mut raw, &mut notices);
    let diagonal = apply_unit(&mut raw, options)?;
    merge_nodes(&mut raw, MERGE_DISTANCE * diagonal, &mut notices)?;
    turn_inverted(&mut raw, &mut notices)?;
    refuse_overlap(&raw)?;
    let mesh = canonical(raw);
    shape_notice(&mesh, &mut notices);
    connection_notices(&mesh, &mut notices);
    Ok(Imported { mesh, notices })
}

/// `element 17 (nodes 3, 5, 8, 9)`, by the ids of the file.
fn name_tet(raw: &RawMesh, tet: &RawTet) -> String {
    let ids = tet.nodes.map(|n| raw.nodes[n as usize].id.to_string()).join(", ");
    format!("{} {} ({}s {ids})", raw.words.element, tet.id, raw.words.node)
}

/// `1 node`, `2 nodes`.
fn count_of(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

fn has_repeated(nodes: &[u32; 4]) -> bool {
    (0..4).any(|i| nodes[..i].contains(&nodes[i]))
}

fn refuse_repeated_corners(raw: &RawMesh) -> Result<()> {
    match raw.tets.iter().find(|t| has_repeated(&t.nodes)) {
        None => Ok(()),
        Some(tet) => Err(Error::input(
            format!("{}: {} names a {} twice", raw.name, name_tet(raw, tet), raw.words.node),
            "remove it in the mesh generator or mesh the body again",
        )),
    }
}

/// Keeps the nodes for which `keep` holds an index, `u32::MAX` elsewhere.
fn renumber_nodes(raw: &mut RawMesh, index: &[u32]) {
    for tet in &mut raw.tets {
        tet.nodes = tet.nodes.map(|n| index[n as usize]);
    }
    for set in raw.node_sets.values_mut() {
        *set = set.iter().map(|n| index[*n as usize]).filter(|n| *n != u32::MAX).collect();
        set.sort_unstable();
        set.dedup();
    }
}

fn drop_unused_nodes(raw: &mut RawMesh, notices: &mut Vec<String>) {
    let mut index = vec![u32::MAX; raw.nodes.len()];
    for tet in &raw.tets {
        for node in tet.nodes {
            index[node as usize] = 0;
        }
    }
    let mut kept = Vec::new();
    for (node, index) in raw.nodes.iter().zip(&mut index) {
        if *index == 0 {
            *index = kept.len() as u32;
            kept.push(*node);
        }
    }
    let dropped = raw.nodes.len() - kept.len();
    if dropped == 0 {
        return;
    }
    raw.nodes = kept;
    renumber_nodes(raw, &index);
    notices.push(format!("{} of no tetrahedron dropped.", count_of(dropped, raw.words.node)));
    raw.node_sets.retain(|name, nodes| {
        if nodes.is_empty() {
            notices.push(format!("Node set `{name}` holds no node of a tetrahedron and is dropped."));
        }
        !nodes.is_empty()
    });
}

fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// Converts to metres, places the mesh and checks the size; returns the diagonal of the bounding box [m].
fn apply_unit(raw: &mut RawMesh, options: ImportOptions) -> Result<f64> {
    let in_file = bounds(raw.nodes.iter().map(|n| n.position));
    let length_in_file = (in_file.1 - in_file.0).length();
    let unit = options.unit;
    for node in &mut raw.nodes {
        // Adding zero turns -0 into 0, so that equal coordinates are equal bits.
        let metres = DVec3::from_array(node.position.to_array().map(|x| unit.to_metres(x)));
        node.position = options.placement.point(metres) + DVec3::ZERO;
    }
    let (low, high) = bounds(raw.nodes.iter().map(|n| n.position));
    let diagonal = (high - low).length();
    if !diagonal.is_finite() {
        return Err(Error::input(
            format!("{}: the mesh is {length_in_file:e} {unit} across, which no number can hold", raw.name),
            "correct the coordinates",
        ));
    }
    let fits = |size: f64| (EXPECTED_SIZE.0..=EXPECTED_SIZE.1).contains(&size);
    if options.accept_size || fits(diagonal) {
        return Ok(diagonal);
    }
    let scale = options.placement.scale;
    let across = |other: LengthUnit| scale * other.to_metres(length_in_file);
    let distance = |other: LengthUnit| (across(other) / USUAL_SIZE).ln().abs();
    // Inches are rare in anatomy: a guess is metric.
    let meant = LengthUnit::ALL
        .into_iter()
        .filter(|other| *other != LengthUnit::Inch && fits(across(*other)))
        .min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    let scaled = if scale == 1.0 { String::new() } else { format!(" and its scale {scale}") };
    let message = format!("{}: the mesh is {} across when its unit is {unit}{scaled}", raw.name, readable(diagonal));
    Err(match meant {
        Some(meant) => {
            let factor = diagonal / across(meant);
            let (factor, direction) = if factor > 1.0 { (factor, "large") } else { (1.0 / factor, "small") };
            let factor = if factor < 10.0 { format!("{factor:.1}") } else { format!("{factor:.0}") };
            Error::input(
                format!("{message}, {factor} times too {direction}: did you mean unit = \"{meant}\"?"),
                format!("write unit = \"{meant}\", or accept this size with accept_size = true"),
            )
        }
        None => Error::input(
            format!("{message}; tissue between 1 mm and 1 m is expected"),
            "correct the unit or scale the mesh, or accept this size with accept_size = true",
        ),
    })
}

/// A length in the unit in which it is read at a glance.
fn readable(metres: f64) -> String {
    match metres {
        m if m >= 1e6 => format!("{m:.1e} m"),
        m if m >= 1.0 => format!("{m:.1} m"),
        m if m >= 1e-3 => format!("{:.3} mm", m * 1e3),
        m if m >= 1e-6 => format!("{:.3} um", m * 1e6),
        m => format!("{m:.1e} m"),
    }
}

/// Sets of things that belong together.
struct Union {
    parent: Vec<u32>,
}

impl Union {
    fn new(count: usize) -> Self {
        Union { parent: (0..count as u32).collect() }
    }

    fn root(&mut self, mut item: u32) -> u32 {
        while self.parent[item as usize] != item {
            // Halve the path, so that later calls are short.
            let above = self.parent[self.parent[item as usize] as usize];
            self.parent[item as usize] = above;
            item = above;
        }
        item
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    fn count(&mut self) -> usize {
        (0..self.parent.len() as u32).filter(|&i| self.parent[i as usize] == i).count()
    }
}

/// Order of points by x, then y, then z.
fn by_coordinates(a: &DVec3, b: &DVec3) -> std::cmp::Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
}

/// Makes one node of those within `distance` [m] of each other; the first by coordinates stays.
fn merge_nodes(raw: &mut RawMesh, distance: f64, notices: &mut Vec<String>) -> Result<()> {
    if raw.nodes.is_empty() || distance <= 0.0 {
        return Ok(());
    }
    // Cells a few distances wide: a node looks into its own cell and into the few whose border it touches.
    let width = 4.0 * distance;
    let (low, _) = bounds(raw.nodes.iter().map(|n| n.position));
    let mut first_in_cell: HashMap<[i64; 3], u32> = HashMap::new();
    let mut next_in_cell = vec![u32::MAX; raw.nodes.len()];
    let mut union = Union::new(raw.nodes.len());
    for index in 0..raw.nodes.len() as u32 {
        let position = raw.nodes[index as usize].position;
        let range = |axis: usize| {
            let x = position[axis] - low[axis];
            (
                ((x - distance) / width).floor() as i64,
                (x / width).floor() as i64,
                ((x + distance) / width).floor() as i64,
            )
        };
        let [x, y, z] = [range(0), range(1), range(2)];
        let mut is_copy = false;
        for i in x.0..=x.2 {
            for j in y.0..=y.2 {
                for k in z.0..=z.2 {
                    let mut other = first_in_cell.get(&[i, j, k]).copied().unwrap_or(u32::MAX);
                    while other != u32::MAX {
                        let apart = (raw.nodes[other as usize].position - position).length();
                        if apart <= distance {
                            union.join(index, other);
                            is_copy |= apart == 0.0;
                        }
                        other = next_in_cell[other as usize];
                    }
                }
            }
        }
        // An exact copy finds nothing that its original does not find: leaving it out keeps the lists short.
        if !is_copy {
            let first = first_in_cell.entry([x.1, y.1, z.1]).or_insert(u32::MAX);
            next_in_cell[index as usize] = std::mem::replace(first, index);
        }
    }
    let merged = raw.nodes.len() - union.count();
    if merged == 0 {
        return Ok(());
    }
    let mut keeper: Vec<u32> = (0..raw.nodes.len() as u32).collect();
    for node in 0..raw.nodes.len() as u32 {
        let root = union.root(node) as usize;
        let positions = [keeper[root], node].map(|n| raw.nodes[n as usize].position);
        if by_coordinates(&positions[1], &positions[0]).is_lt() {
            keeper[root] = node;
        }
    }
    let mut index = vec![u32::MAX; raw.nodes.len()];
    let mut kept = Vec::new();
    for node in 0..raw.nodes.len() as u32 {
        if keeper[union.root(node) as usize] == node {
            index[node as usize] = kept.len() as u32;
            kept.push(raw.nodes[node as usize]);
        }
    }
    let index: Vec<u32> =
        (0..raw.nodes.len() as u32).map(|node| index[keeper[union.root(node) as usize] as usize]).collect();
    if let Some(tet) = raw.tets.iter().find(|t| has_repeated(&t.nodes.map(|n| index[n as usize]))) {
        return Err(Error::input(
            format!(
                "{}: {} collapses, because {}s of it stand at the same place (within {distance:.1e} m)",
                raw.name,
                name_tet(raw, tet),
                raw.words.node
            ),
            "remove it in the mesh generator or mesh the body again",
        ));
    }
    raw.nodes = kept;
    renumber_nodes(raw, &index);
    notices.push(format!(
        "{} merged with another at the same place; bodies that only touched there are now joined.",
        count_of(merged, raw.words.node)
    ));
    Ok(())
}

/// Six volumes of a tetrahedron, and the cube of its longest edge.
fn volume_and_edge(corners: [DVec3; 4]) -> (f64, f64) {
    let [a, b, c, d] = corners;
    let longest = [b - a, c - a, d - a, c - b, d - b, d - c].iter().map(|e| e.length()).fold(0.0, f64::max);
    ((b - a).cross(c - a).dot(d - a), longest.powi(3))
}

fn turn_inverted(raw: &mut RawMesh, notices: &mut Vec<String>) -> Result<()> {
    let mut turned = 0;
    for number in 0..raw.tets.len() {
        let tet = raw.tets[number];
        let (six_volumes, cube) = volume_and_edge(tet.nodes.map(|n| raw.nodes[n as usize].position));
        // Negated, so that a volume that is no number counts as flat.
        if !(six_volumes.abs() / 6.0 >= FLAT_VOLUME * cube && cube > 0.0) {
            return Err(Error::input(
                format!("{}: {} has no volume ({:.1e} m^3)", raw.name, name_tet(raw, &tet), six_volumes / 6.0),
                "optimise the mesh in the mesh generator (in Gmsh: Mesh > Optimize 3D) or mesh the body again",
            ));
        }
        if six_volumes < 0.0 {
            raw.tets[number].nodes.swap(2, 3);
            turned += 1;
        }
    }
    if turned > 0 {
        notices.push(format!(
            "{} inverted and turned.",
            if turned == 1 { "1 tetrahedron was".into() } else { format!("{turned} tetrahedra were") }
        ));
    }
    Ok(())
}

/// Faces of all tetrahedra with ascending nodes, sorted, each with its tetrahedron.
fn sorted_faces(tets: impl Iterator<Item = [u32; 4]>) -> Vec<([u32; 3], u32)> {
    let mut faces = Vec::new();
    for (tet, [a, b, c, d]) in (0..).zip(tets) {
        for mut face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
            face.sort_unstable();
            faces.push((face, tet));
        }
    }
    faces.sort_unstable();
    faces
}

/// Refuses tetrahedra that are listed twice or share a face by three.
fn refuse_overlap(raw: &RawMesh) -> Result<()> {
    let mut seen: HashMap<[u32; 4], usize> = HashMap::new();
    for (number, tet) in raw.tets.iter().enumerate() {
        let mut key = tet.nodes;
        key.sort_unstable();
        if let Some(first) = seen.insert(key, number) {
            return Err(Error::input(
                format!(
                    "{}: {} is the same tetrahedron as {} {}",
                    raw.name,
                    name_tet(raw, tet),
                    raw.words.element,
                    raw.tets[first].id
                ),
                "keep one of them; an element that is in several physical groups is saved once for each of them",
            ));
        }
    }
    for faces in sorted_faces(raw.tets.iter().map(|t| t.nodes)).windows(3) {
        if faces[0].0 == faces[2].0 {
            let ids = [0, 1, 2].map(|i| raw.tets[faces[i].1 as usize].id.to_string()).join(", ");
            return Err(Error::input(
                format!("{}: {}s {ids} share one face, so that two of them overlap", raw.name, raw.words.element),
                "mesh the body again so that no volume lies within another (in Gmsh: fragment the volumes first)",
            ));
        }
    }
    Ok(())
}

/// Place on a Morton curve through a cube at `low`, 2^21 steps of `step` wide.
fn morton(position: DVec3, low: DVec3, step: f64) -> u64 {
    // Every third bit.
    let spread = |x: f64| {
        let mut word = (x / step) as u64 & 0x1f_ffff;
        for (shift, mask) in [
            (32, 0x1f_0000_0000_ffff),
            (16, 0x1f_0000_ff00_00ff),
            (8, 0x100f_00f0_0f00_f00f),
            (4, 0x10c3_0c30_c30c_30c3),
            (2, 0x1249_2492_4924_9249),
        ] {
            word = (word | word << shift) & mask;
        }
        word
    };
    let [x, y, z] = (position - low).to_array();
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// Rotates the corners to the even permutation with the smallest index first and the next smaller second.
///
/// The rotations of a tetrahedron can bring any corner to the front and turn the other three; which of the remaining
/// two comes third is fixed by its orientation.
fn canonical_corners(nodes: [u32; 4]) -> [u32; 4] {
    let [a, b, c, d] = nodes;
    // Even permutations that bring each corner to the front.
    let mut front = [[a, b, c, d], [b, a, d, c], [c, d, a, b], [d, c, b, a]];
    front.sort_unstable_by_key(|n| n[0]);
    let [a, b, c, d] = front[0];
    if b < c && b < d {
        [a, b, c, d]
    } else if c < d {
        [a, c, d, b]
    } else {
        [a, d, b, c]
    }
}

/// Sorts nodes and tetrahedra along a Morton curve, ties by exact coordinates, and numbers the regions.
fn canonical(raw: RawMesh) -> TetMesh {
    let (low, high) = bounds(raw.nodes.iter().map(|n| n.position));
    let step = (high - low).max_element() / f64::from((1u32 << 21) - 1);

    let mut nodes: Vec<(u64, DVec3, u32)> =
        (0..).zip(&raw.nodes).map(|(index, n)| (morton(n.position, low, step), n.position, index)).collect();
    nodes.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(by_coordinates(&a.1, &b.1)));
    let mut index = vec![0; nodes.len()];
    for (new, node) in (0..).zip(&nodes) {
        index[node.2 as usize] = new;
    }
    let positions: Vec<DVec3> = nodes.iter().map(|n| n.1).collect();

    let mut tets: Vec<(u64, [u32; 4], [u32; 4], u32)> = raw
        .tets
        .iter()
        .map(|tet| {
            let corners = canonical_corners(tet.nodes.map(|n| index[n as usize]));
            let centroid = corners.iter().map(|n| positions[*n as usize]).sum::<DVec3>() / 4.0;
            let mut sorted = corners;
            sorted.sort_unstable();
            (morton(centroid, low, step), sorted, corners, tet.region)
        })
        .collect();
    tets.sort_unstable();

    // Formats that name regions and formats that number them agree on no order of regions; the first place does.
    let mut tag_of_region: HashMap<u32, u32> = HashMap::new();
    let mut regions = Vec::new();
    let mut tags = Vec::new();
    for tet in &tets {
        let tag = *tag_of_region.entry(tet.3).or_insert_with(|| {
            regions.push(raw.regions[tet.3 as usize].clone());
            regions.len() as u32 - 1
        });
        tags.push(tag);
    }
    let node_sets: BTreeMap<String, Vec<u32>> = raw
        .node_sets
        .into_iter()
        .map(|(name, set)| {
            let mut set: Vec<u32> = set.iter().map(|n| index[*n as usize]).collect();
            set.sort_unstable();
            set.dedup();
            (name, set)
        })
        .collect();
    TetMesh { positions, tets: tets.iter().map(|t| t.2).collect(), tags, regions, node_sets }
}

fn shape_notice(mesh: &TetMesh, notices: &mut Vec<String>) {
    let mut slivers = 0;
    let mut worst = (f64::INFINITY, 0);
    for tet in 0..mesh.tets.len() {
        let shape = mesh.smallest_altitude(tet) / mesh.longest_edge(tet);
        slivers += usize::from(shape < SLIVER);
        if shape < worst.0 {
            worst = (shape, tet);
        }
    }
    if slivers > 0 {
        let centre = mesh.corners(worst.1).iter().sum::<DVec3>() / 4.0 * 1e3;
        notices.push(format!(
            "{} of {} tetrahedra are slivers (smallest altitude below {SLIVER} of the longest edge), the worst with \
             {:.2e} near ({:.2}, {:.2}, {:.2}) mm: its altitude of {:.2e} mm bounds the time step. \
             Optimise the mesh for faster runs.",
            slivers,
            mesh.tets.len(),
            worst.0,
            centre.x,
            centre.y,
            centre.z,
            mesh.smallest_altitude(worst.1) * 1e3,
        ));
    }
}

fn connection_notices(mesh: &TetMesh, notices: &mut Vec<String>) {
    let mut by_nodes = Union::new(mesh.positions.len());
    for tet in &mesh.tets {
        for node in &tet[1..] {
            by_nodes.join(tet[0], *node);
        }
    }
    let mut by_faces = Union::new(mesh.tets.len());
    for faces in sorted_faces(mesh.tets.iter().copied()).windows(2) {
        if faces[0].0 == faces[1].0 {
            by_faces.join(faces[0].1, faces[1].1);
        }
    }
    let (pieces, rigid) = (by_nodes.count(), by_faces.count());
    if pieces > 1 {
        notices.push(format!("The mesh falls into {pieces} pieces that share no node; nothing holds them together."));
    }
    if rigid > pieces {
        notices.push(format!(
            "{rigid} parts of the mesh hang together by single nodes or edges only and can swing about them."
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn canonical_corners_keep_the_orientation() {
        let parity =
            |n: [u32; 4]| (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|(i, j)| n[*j] > n[*i]).count() % 2;
        let mut forms = [Vec::new(), Vec::new()];
        for code in 0..256u32 {
            let nodes = [0, 2, 4, 6].map(|shift| code >> shift & 3);
            if has_repeated(&nodes) {
                continue;
            }
            let form = canonical_corners(nodes);
            assert_eq!(parity(form), parity(nodes), "{nodes:?} became {form:?}");
            forms[parity(nodes)].push(form);
        }
        assert!(forms[0].len() == 12 && forms[0].iter().all(|f| *f == [0, 1, 2, 3]));
        assert!(forms[1].len() == 12 && forms[1].iter().all(|f| *f == [0, 1, 3, 2]));
    }

    #[test]
    fn morton_interleaves_bits() {
        let place = |x, y, z| morton(DVec3::new(x, y, z), DVec3::ZERO, 1.0);
        assert_eq!([place(1.0, 0.0, 0.0), place(0.0, 1.0, 0.0), place(0.0, 0.0, 1.0)], [1, 2, 4]);
        assert_eq!(place(2.0, 3.0, 1.0), 0b011_110);
        assert_eq!(place(2097151.0, 2097151.0, 2097151.0), (1 << 63) - 1);
    }
}
