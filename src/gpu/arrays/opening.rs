//! The path of the scheme `opening`: sections, points beside it, cells around it.

use std::collections::BTreeMap;

use bytemuck::Zeroable;
use glam::DVec3;

use super::super::structs::{
    OpeningCell, OpeningCluster, OpeningEntry, OpeningNode, OpeningParams, OpeningPoint, OpeningRecord, OpeningStation,
    OpeningSum, OpeningTotals,
};
use super::{Array, Source, Sums, bytes_of, read_all, to_bytes, vec4, vector, zeros};
use crate::effects::viscoelastic::SectionRelaxation;
use crate::gpu::grain::Grain;
use crate::gpu::layout::Layout;
use crate::mesh::{CORNERS, Mesh};
use crate::model::Model;
use crate::model::opening::{Cluster, NearCell, OpeningPlan};
use crate::needle::opening::{Growth, GrowthIn, Station};

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("opening", |s| bytes_of(&[params(s)])),
    Array::constant("path_clusters", |s| bytes_of(&not_empty(&s.opening().clusters))),
    Array::constant("path_points", |s| bytes_of(&not_empty(&s.opening().points))),
    Array::constant("near_cells", |s| bytes_of(&not_empty(&s.opening().cells))),
    Array::constant("path_entries", |s| bytes_of(&not_empty(&s.opening().entries))),
    Array::constant("path_corners", |s| bytes_of(&not_empty(&s.opening().corners))),
    Array::constant("path_nodes", |s| bytes_of(&not_empty(&s.opening().nodes))),
    Array::state("path_stations", |s| bytes_of(&not_empty(&s.opening().stations))).exchanged(
        |bytes, model, state| {
            let count = model.opening().map_or(0, |o| o.stations.len());
            state.stations = read_all::<OpeningStation>(bytes).take(count).map(|s| s.rubbing[2].into()).collect();
            let relaxing = read_all::<OpeningStation>(bytes).take(model.relaxing_stations());
            state.relaxation = relaxing.map(|s| relaxation_of(&s)).collect();
        },
        |s, state| {
            let mut stations = s.opening().stations.clone();
            for (station, stretch) in stations.iter_mut().zip(&state.stations) {
                station.rubbing[2] = *stretch as f32;
            }
            for (station, relaxation) in stations.iter_mut().zip(&state.relaxation) {
                relax(station, relaxation);
            }
            let count = s.model.opening().map_or(0, |o| o.stations.len());
            let (own, runs) = stations.split_at_mut(count);
            for run in runs {
                let within = &own[run.lists[0] as usize..run.lists[1] as usize];
                run.relaxation[0] = within.iter().map(|s| s.relaxation[0]).sum::<f32>() / within.len() as f32;
            }
            to_bytes(&not_empty(&stations))
        },
    ),
    Array::state("opening_corners", |s| zeros(corner_count(s.model) * slot_count(s.model).max(1), 16)),
    Array::state("opening_sums", |s| zeros(sum_count(s.model, s.grain).max(1), size_of::<OpeningSum>())),
    Array::state("opening_record", |_| zeros(1, size_of::<OpeningRecord>())).exchanged(
        |bytes, _, state| {
            for record in read_all::<OpeningRecord>(bytes) {
                state.opening_resistance = record.now[0].into();
                state.opening_spreading = record.now[2].into();
                state.opening_stiffness = record.now[3].into();
            }
        },
        |_, state| {
            let [resistance, spreading, stiffness] =
                [state.opening_resistance, state.opening_spreading, state.opening_stiffness].map(|v| v as f32);
            let now = [resistance, 0.0, spreading, stiffness];
            to_bytes(&[OpeningRecord { now, ..OpeningRecord::zeroed() }])
        },
    ),
    Array::result("opening_totals", |_| zeros(1, size_of::<OpeningTotals>()), add_totals),
];

fn add_totals(bytes: &[u8], out: &mut Sums) {
    let sums = &mut out.sums;
    for s in read_all::<OpeningTotals>(bytes) {
        sums.energy.elastic += s.elastic.as_flattened().iter().flatten().map(|e| f64::from(*e)).sum::<f64>();
        sums.impulse += vector(s.record.impulse);
        // As the work of other contact, see `contact_totals`.
        sums.energy.half_step += out.has_steps * 0.5 * f64::from(s.record.impulse[3]);
        sums.angular_impulse += vector(s.record.angular_impulse);
        let [spreading, friction, work, rubbed] = s.record.parts.map(f64::from);
        sums.spreading_impulse += spreading;
        sums.friction_impulse += friction;
        sums.shaft_normal_impulse += f64::from(s.record.angular_impulse[3]);
        sums.tool_work += work;
        sums.energy.friction += rubbed;
        let [tip, relaxed, lately, _] = s.record.late.map(f64::from);
        sums.energy.tip += tip;
        sums.energy.viscous += relaxed;
        // What is measured is what the next frame begins with.
        sums.energy.elastic -= lately;
        sums.energy.contact_stored += f64::from(s.record.now[1]);
    }
}

fn relaxation_of(station: &OpeningStation) -> SectionRelaxation {
    let mut relaxation = SectionRelaxation {
        left: station.relaxation[0].into(),
        dissipated: station.relaxation[3].into(),
        ..SectionRelaxation::default()
    };
    for (opened, value) in relaxation.opened.iter_mut().zip(station.opened.as_flattened()) {
        *opened = f64::from(*value);
    }
    relaxation
}

fn relax(station: &mut OpeningStation, relaxation: &SectionRelaxation) {
    station.relaxation = [relaxation.left as f32, 0.0, 0.0, relaxation.dissipated as f32];
    for (value, opened) in station.opened.as_flattened_mut().iter_mut().zip(relaxation.opened) {
        *value = opened as f32;
    }
}

/// All tables, which name each other.
#[derive(Default)]
pub struct Tables {
    stations: Vec<OpeningStation>,
    clusters: Vec<OpeningCluster>,
    points: Vec<OpeningPoint>,
    cells: Vec<OpeningCell>,
    entries: Vec<OpeningEntry>,
    corners: Vec<u32>,
    nodes: Vec<OpeningNode>,
}

fn not_empty<T: Zeroable + Clone>(values: &[T]) -> Vec<T> {
    if values.is_empty() { vec![T::zeroed()] } else { values.to_vec() }
}

/// Number of a corner in the shaders: a bit per axis.
fn bits(signs: [f64; 3]) -> usize {
    (0..3).map(|a| usize::from(signs[a] > 0.0) << a).sum()
}

/// True where a sum ends with point `i` of a cluster: at the last one of a station, and of those that a thread has.
fn sum_ends(cluster: &Cluster, i: usize, grain: Grain) -> bool {
    let (count, pieces) = (cluster.points.len(), grain.pieces());
    let piece_of = |i: usize| (0..pieces).take_while(|p| count * p / pieces <= i).count();
    let next = cluster.points.get(i + 1);
    next.is_none_or(|next| next.0 != cluster.points[i].0) || piece_of(i) != piece_of(i + 1)
}

/// Sums that clusters tell.
fn point_sums(opening: &OpeningPlan, grain: Grain) -> usize {
    let of = |c: &Cluster| (0..c.points.len()).filter(|i| sum_ends(c, *i, grain)).count();
    opening.clusters.iter().map(of).sum()
}

/// Sums of points, of cells, and of runs of cells.
fn sum_count(model: &Model, grain: Grain) -> u64 {
    let count = |o: &OpeningPlan| point_sums(o, grain) + o.cells.len() + runs_of(model).len();
    model.opening().map_or(0, |o| count(o) as u64)
}

/// Corners of a cell.
fn corner_count(model: &Model) -> u64 {
    if model.mesh.as_block().is_some() { 8 } else { 4 }
}

/// Numbers of clusters and cells: slots of forces on corners.
fn slot_count(model: &Model) -> u64 {
    model.opening().map_or(0, |o| (o.clusters.len() + o.cells.len()) as u64)
}

/// Cells side by side that lie around the same stations: first, end. A station reads their sum instead of each of them.
fn runs_of(model: &Model) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    let Some(opening) = model.opening() else { return runs };
    for (index, cell) in opening.cells.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if opening.cells[run.0].is_beside_the_stations_of(cell) => run.1 = index + 1,
            _ => runs.push((index, index + 1)),
        }
    }
    runs
}

/// Clusters, cells and nodes: threads of the stages.
pub fn opening_counts(model: &Model) -> [u32; 3] {
    model.opening().map_or([0; 3], |o| [o.clusters.len(), o.cells.len(), o.nodes.len()].map(|n| n as u32))
}

fn params(source: &Source) -> OpeningParams {
    let Source { model, dt, grain, .. } = *source;
    let (Some(opening), Some(plan)) = (model.opening(), &model.puncture) else { return OpeningParams::zeroed() };
    let Some(contact) = &plan.contact else { return OpeningParams::zeroed() };
    let friction = model.effects.friction.unwrap_or_default();
    let shaft = opening.shaft;
    let [x, y, z, _] = vec4(plan.path.direction);
    let [ex, ey, ez, _] = vec4(plan.path.entry);
    let [clusters, cells, nodes] = opening_counts(model);
    let advance = |segment: usize| {
        let segment = plan.segments[segment.min(plan.segments.len() - 1)];
        opening.advance_limit(segment.shear_wave_speed, 0.0, dt)
    };
    OpeningParams {
        direction: [x, y, z, shaft as f32],
        entry: [ex, ey, ez, opening.tip_length as f32],
        numbers: [
            opening.spacing as f32,
            (opening.least / (shaft * shaft)) as f32,
            friction.coefficient as f32,
            friction.fade_length.max(1e-9) as f32,
        ],
        counts: [opening.stations.len() as u32, clusters, cells, nodes],
        sums: [
            opening.averaged as u32,
            runs_of(model).len() as u32,
            (point_sums(opening, grain) + opening.cells.len()) as u32,
            point_sums(opening, grain) as u32,
        ],
        surface: [
            contact.length as f32,
            plan.profile.shift.x as f32,
            plan.profile.shift.y as f32,
            plan.profile.shift.z as f32,
        ],
        dimple: contact.knots.map(|k| [k.root, k.depth, k.slope, k.stored].map(|x| x as f32)),
        advances: std::array::from_fn(|i| std::array::from_fn(|j| advance(4 * i + j) as f32)),
    }
}

/// Stations, and runs of cells.
pub fn section_counts(model: &Model) -> [u32; 2] {
    model.opening().map_or([0; 2], |o| [o.stations.len(), runs_of(model).len()].map(|n| n as u32))
}

/// Place of a cell in the grid (of a tetrahedron its number) with its material, its middle from the entry of the path, one over its edges.
fn cell_of(model: &Model, entry: DVec3, cell: usize) -> ([u32; 4], [f32; 4], [f32; 4]) {
    let middle = model.mesh.cell_centre(cell) - entry;
    let [i, j, k] = match &model.mesh {
        Mesh::Block(block) => block.cell_coordinates(cell).map(|c| c as u32),
        Mesh::Tets(_) => [cell as u32, 0, 0],
    };
    ([i, j, k, model.material_index(cell) as u32], vec4(middle), vec4(1.0 / edges_of(&model.mesh, cell)))
}

/// Edges of a hexahedron; of a tetrahedron those of the cube of its volume [m].
fn edges_of(mesh: &Mesh, cell: usize) -> DVec3 {
    match mesh {
        Mesh::Block(block) => block.cell_size(cell),
        Mesh::Tets(tets) => DVec3::splat(tets.volume(cell).cbrt()),
    }
}

/// Nodes of a cell, and its corners as the shaders count them.
fn corners_of(mesh: &Mesh, cell: usize) -> impl Iterator<Item = (u32, usize)> {
    let (nodes, is_block) = (mesh.cell_nodes(cell), mesh.as_block().is_some());
    (0..nodes.len()).map(move |i| (nodes[i] as u32, if is_block { bits(CORNERS[i]) } else { i }))
}

/// What the slots tell: those of a station with their weights, and the corners of a node.
struct Told {
    stations: Vec<Vec<(u32, f32)>>,
    corners: BTreeMap<u32, Vec<u32>>,
    /// Material coordinate of the tip at which anything near a node begins to be cut [m].
    cut_from: BTreeMap<u32, f64>,
}

pub(super) fn tables_of(model: &Model, layout: &Layout, grain: Grain) -> Tables {
    let mut tables = Tables::default();
    let (Some(opening), Some(plan)) = (model.opening(), &model.puncture) else {
        return tables;
    };
    let runs = runs_of(model);
    // First, so that a run has the place of its number.
    tables.entries = runs.iter().map(|run| run_entry(point_sums(opening, grain), *run)).collect();
    let told = slots(&mut tables, model, opening, (plan.path.entry, &runs), grain);
    lists(&mut tables, model, opening, layout, (plan.path.entry, &told));
    // Behind the stations, the means of those in a run of cells.
    tables.stations.extend(runs.iter().map(|(first, _)| {
        let NearCell { first, count, .. } = opening.cells[*first];
        let within = &opening.stations[usize::from(first)..][..usize::from(count)];
        let mean: Vec<Station> = within
            .iter()
            .map(|s| Station { rest_direction: s.direction, growth: s.growth, ..Station::default() })
            .collect();
        let Station { rest_direction, growth, .. } = Station::mean(&mean);
        with_growth(
            OpeningStation {
                lists: [first.into(), (first + count).into(), 0, 0],
                rest_direction: vec4(rest_direction),
                relaxation: [1.0, 0.0, 0.0, 0.0],
                ..OpeningStation::zeroed()
            },
            &growth,
            opening.shaft,
        )
    }));
    tables
}

/// A section with the growth of the tissue beside it, lengths in radii of the needle.
fn with_growth(mut section: OpeningStation, growth: &Growth, shaft: f64) -> OpeningStation {
    let GrowthIn { most, fall, reach } = growth.in_lengths(0.0, shaft);
    [section.depth[3], section.rest[3], section.rest_direction[3]] = [most, fall, reach].map(|x| x as f32);
    section
}

/// Sums of a run, of which points have `before`: the first, and their number.
fn run_entry(before: usize, (first, end): (usize, usize)) -> OpeningEntry {
    OpeningEntry { index: (before + first) as u32, first: (end - first) as f32, ..OpeningEntry::zeroed() }
}

/// Clusters and cells, one slot each, and runs of cells.
fn slots(
    tables: &mut Tables,
    model: &Model,
    opening: &OpeningPlan,
    (entry, runs): (DVec3, &[(usize, usize)]),
    grain: Grain,
) -> Told {
    let mut told: Vec<Vec<(u32, f32)>> = vec![Vec::new(); opening.stations.len()];
    let mut corners: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut cut_from: BTreeMap<u32, f64> = BTreeMap::new();
    let mut slot = 0u32;
    let count = corner_count(model) as u32;
    let mut tell_corners = |cell: usize, slot: u32, depth: f64| {
        for (node, corner) in corners_of(&model.mesh, cell) {
            let first = cut_from.entry(node).or_insert(depth);
            *first = first.min(depth);
            corners.entry(node).or_default().push(count * slot + corner as u32);
        }
    };
    let mut sum_slot = 0u32;
    for cluster in &opening.clusters {
        let Cluster { cell, points } = cluster;
        let (place, middle, inverse) = cell_of(model, entry, *cell as usize);
        let first = tables.points.len() as u32;
        for (i, (station, index)) in points.iter().enumerate() {
            let point = &opening.stations[*station].points[*index];
            let edges = edges_of(&model.mesh, *cell as usize);
            let local = match &model.mesh {
                Mesh::Block(_) => point.local - 0.5,
                Mesh::Tets(_) => (point.place - model.mesh.cell_centre(*cell as usize)) / edges,
            };
            let ends = sum_ends(cluster, i, grain);
            tables.points.push(OpeningPoint {
                place: [local.x as f32, local.y as f32, local.z as f32, point.volume as f32],
                numbers: [*station as u32, sum_slot, u32::from(ends), 0],
            });
            if ends {
                told[*station].push((sum_slot, 1.0));
                sum_slot += 1;
            }
        }
        let end = tables.points.len() as u32;
        tables.clusters.push(OpeningCluster { cell: place, points: [first, end, 0, 0], middle, inverse });
        tell_corners(*cell as usize, slot, opening.stations[points[0].0].depth.abs());
        slot += 1;
    }
    sum_slot += opening.cells.len() as u32;
    let run_of = |cell: usize| runs.partition_point(|run| run.1 <= cell) as u32;
    for (index, near) in opening.cells.iter().enumerate() {
        let (number, middle, inverse) = cell_of(model, entry, near.cell as usize);
        let area = opening.shaft * opening.shaft;
        let [mean, variance] = near.growth;
        // In edges of the cell.
        let place = near.place / edges_of(&model.mesh, near.cell as usize);
        tables.cells.push(OpeningCell {
            cell: number,
            stations: [run_of(index), 0, 0, 0],
            middle: [middle[0], middle[1], middle[2], (mean * area) as f32],
            inverse: [inverse[0], inverse[1], inverse[2], (variance * area * area) as f32],
            place: [place.x as f32, place.y as f32, place.z as f32, near.share as f32],
        });
        let stations = &opening.stations[usize::from(near.first)..][..usize::from(near.count)];
        tell_corners(near.cell as usize, slot, stations.iter().map(|s| s.depth.abs()).fold(f64::INFINITY, f64::min));
        slot += 1;
    }
    for (first, _) in runs {
        let NearCell { first, count, .. } = opening.cells[*first];
        for station in first..first + count {
            told[usize::from(station)].push((sum_slot, 1.0 / f32::from(count)));
        }
        sum_slot += 1;
    }
    for station in &opening.stations {
        for node in &station.nodes {
            let first = cut_from.entry(*node).or_insert(f64::INFINITY);
            *first = first.min(station.depth.abs());
        }
    }
    Told { stations: told, corners, cut_from }
}

/// Stations and nodes, with the lists of what they are made of.
fn lists(tables: &mut Tables, model: &Model, opening: &OpeningPlan, layout: &Layout, (entry, told): (DVec3, &Told)) {
    let mut sections: BTreeMap<u32, Vec<(u32, f32, f32)>> = BTreeMap::new();
    for (index, station) in opening.stations.iter().enumerate() {
        let mut weights: BTreeMap<u32, (f32, f32)> = BTreeMap::new();
        for (place, w) in &station.centre {
            weights.entry(station.nodes[usize::from(*place)]).or_default().0 += *w as f32;
        }
        for (place, w) in &station.disc {
            weights.entry(station.nodes[usize::from(*place)]).or_default().1 += *w as f32;
        }
        let first = tables.entries.len() as u32;
        for (node, (centre, disc)) in weights {
            tables.entries.push(OpeningEntry { index: node, first: centre, second: disc, _pad: 0.0 });
            sections.entry(node).or_default().push((index as u32, centre, disc));
        }
        let middle = tables.entries.len() as u32;
        tables.entries.extend(told.stations[index].iter().map(|(slot, w)| OpeningEntry {
            index: *slot,
            first: *w,
            second: 0.0,
            _pad: 0.0,
        }));
        let end = tables.entries.len() as u32;
        let cut_from = opening.opens_at(station);
        let friction = model.effects.friction.unwrap_or_default();
        let mut own = OpeningStation {
            depth: [station.depth as f32, cut_from as f32, station.opened(opening.shaft) as f32, 0.0],
            springs: [
                (station.guide / opening.shaft) as f32,
                (friction.stiffness_ratio * station.stick) as f32,
                0.0,
                0.0,
            ],
            lists: [first, middle, middle, end],
            rest: vec4(station.middle - entry),
            rest_direction: vec4(station.direction),
            ..OpeningStation::zeroed()
        };
        relax(&mut own, &SectionRelaxation::default());
        let (shares, rates) = (own.shares.as_flattened_mut(), own.rates.as_flattened_mut());
        for ((share, rate), term) in shares.iter_mut().zip(rates).zip(model.terms_at(station)) {
            (*share, *rate) = (term.ratio as f32, (1.0 / term.time) as f32);
        }
        tables.stations.push(with_growth(own, &station.growth, opening.shaft));
    }
    for node in opening.nodes.iter().copied() {
        let owned = match &model.mesh {
            Mesh::Block(block) => layout.strips().owned_slot(block.node_coordinates(node as usize), block.cells()),
            Mesh::Tets(_) => 4 * layout.fours().first[node as usize],
        };
        let first = tables.corners.len() as u32;
        tables.corners.extend(told.corners.get(&node).into_iter().flatten());
        let corners_end = tables.corners.len() as u32;
        let sections_first = tables.entries.len() as u32;
        let sections = sections.get(&node).into_iter().flatten();
        tables.entries.extend(sections.map(|(s, first, second)| OpeningEntry {
            index: *s,
            first: *first,
            second: *second,
            _pad: 0.0,
        }));
        let end = tables.entries.len() as u32;
        // A section begins to open a spacing before it, and its neighbours feel that.
        let open_from = (told.cut_from.get(&node).copied().unwrap_or(0.0) - 3.0 * opening.spacing) as f32;
        tables.nodes.push(OpeningNode {
            numbers: [owned, first, corners_end, sections_first],
            more: [end, open_from.to_bits(), 0, 0],
        });
    }
    // Threads of a group wait for each other: many of the same length lie side by side.
    let length = |n: &OpeningNode| (n.more[0] - n.numbers[3]) + (n.numbers[2] - n.numbers[1]);
    tables.nodes.sort_by_key(|n| std::cmp::Reverse(length(n)));
}
