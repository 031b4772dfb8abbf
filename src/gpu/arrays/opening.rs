//! The path of the scheme `opening`: sections, points beside it, cells around it.

use std::collections::BTreeMap;

use bytemuck::Zeroable;
use glam::DVec3;

use super::super::structs::{
    OpeningCell, OpeningCluster, OpeningEntry, OpeningNode, OpeningParams, OpeningRecord, OpeningStation, OpeningSum,
    OpeningTotals,
};
use super::{Array, Sums, bytes_of, read_all, to_bytes, vec4, vector, zeros};
use crate::gpu::layout::Layout;
use crate::mesh::{BlockMesh, CORNERS};
use crate::model::Model;
use crate::model::opening::{Cluster, OpeningPlan};

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("opening", |s| bytes_of(&[params(s.model, s.dt)])),
    Array::constant("path_clusters", |s| bytes_of(&not_empty(&s.opening().clusters))),
    Array::constant("path_points", |s| bytes_of(&not_empty(&s.opening().points))),
    Array::constant("near_cells", |s| bytes_of(&not_empty(&s.opening().cells))),
    Array::constant("path_entries", |s| bytes_of(&not_empty(&s.opening().entries))),
    Array::constant("path_nodes", |s| bytes_of(&not_empty(&s.opening().nodes))),
    Array::state("path_stations", |s| bytes_of(&not_empty(&s.opening().stations))).exchanged(
        |bytes, _, state| state.stations = read_all::<OpeningStation>(bytes).map(|s| s.rubbing[2].into()).collect(),
        |s, state| {
            let mut stations = s.opening().stations.clone();
            for (station, stretch) in stations.iter_mut().zip(&state.stations) {
                station.rubbing[2] = *stretch as f32;
            }
            to_bytes(&not_empty(&stations))
        },
    ),
    Array::state("opening_corners", |s| zeros(8 * slot_count(s.model).max(1), 16)),
    Array::state("opening_sums", |s| zeros(slot_count(s.model).max(1), size_of::<OpeningSum>())),
    Array::state("opening_record", |_| zeros(1, size_of::<OpeningRecord>())).exchanged(
        |bytes, _, state| {
            for record in read_all::<OpeningRecord>(bytes) {
                state.opening_resistance = record.now[0].into();
                state.opening_spreading = record.now[2].into();
            }
        },
        |_, state| {
            let now = [state.opening_resistance as f32, 0.0, state.opening_spreading as f32, 0.0];
            to_bytes(&[OpeningRecord { now, ..OpeningRecord::zeroed() }])
        },
    ),
    Array::result("opening_totals", |_| zeros(1, size_of::<OpeningTotals>()), add_totals),
];

fn add_totals(bytes: &[u8], out: &mut Sums) {
    let sums = &mut out.sums;
    for s in read_all::<OpeningTotals>(bytes) {
        sums.energy.elastic += s.elastic.iter().flatten().map(|e| f64::from(*e)).sum::<f64>();
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
        sums.energy.tip += f64::from(s.record.late[0]);
        sums.energy.contact_stored += f64::from(s.record.now[1]);
    }
}

/// All tables, which name each other.
#[derive(Default)]
pub struct Tables {
    stations: Vec<OpeningStation>,
    clusters: Vec<OpeningCluster>,
    points: Vec<[f32; 4]>,
    cells: Vec<OpeningCell>,
    entries: Vec<OpeningEntry>,
    nodes: Vec<OpeningNode>,
}

fn not_empty<T: Zeroable + Clone>(values: &[T]) -> Vec<T> {
    if values.is_empty() { vec![T::zeroed()] } else { values.to_vec() }
}

/// Number of a corner in the shaders: a bit per axis.
fn bits(signs: [f64; 3]) -> usize {
    (0..3).map(|a| usize::from(signs[a] > 0.0) << a).sum()
}

/// Numbers of clusters and cells.
fn slot_count(model: &Model) -> u64 {
    model.opening().map_or(0, |o| (o.clusters.len() + o.cells.len()) as u64)
}

/// Clusters, cells and nodes: threads of the stages.
pub fn opening_counts(model: &Model) -> [u32; 3] {
    model.opening().map_or([0; 3], |o| [o.clusters.len(), o.cells.len(), o.nodes.len()].map(|n| n as u32))
}

fn params(model: &Model, dt: f64) -> OpeningParams {
    let (Some(opening), Some(plan)) = (model.opening(), &model.puncture) else { return OpeningParams::zeroed() };
    let Some(contact) = &plan.contact else { return OpeningParams::zeroed() };
    let friction = model.effects.friction.unwrap_or_default();
    let shaft = opening.map.shaft;
    let [x, y, z, _] = vec4(opening.map.direction);
    let [ex, ey, ez, _] = vec4(plan.path.entry);
    let stick = friction.stiffness_ratio * opening.stick;
    let [clusters, cells, nodes] = opening_counts(model);
    OpeningParams {
        direction: [x, y, z, shaft as f32],
        entry: [ex, ey, ez, opening.tip_length as f32],
        numbers: [
            opening.spacing as f32,
            opening.guide as f32,
            (opening.map.least / (shaft * shaft)) as f32,
            opening.advance_limit(0.0, dt) as f32,
        ],
        friction: [friction.coefficient as f32, stick as f32, friction.fade_length.max(1e-9) as f32, 0.0],
        counts: [opening.stations.len() as u32, clusters, cells, nodes],
        averaged: [opening.averaged as u32, 0, 0, 0],
        surface: [
            contact.length as f32,
            plan.profile.shift.x as f32,
            plan.profile.shift.y as f32,
            plan.profile.shift.z as f32,
        ],
        dimple: contact.knots.map(|k| [k.root, k.depth, k.slope, k.stored].map(|x| x as f32)),
    }
}

/// Place of a cell in the grid with its material, its middle from the entry of the path, one over its edges.
fn cell_of(model: &Model, mesh: &BlockMesh, entry: DVec3, cell: usize) -> ([u32; 4], [f32; 4], [f32; 4]) {
    let [i, j, k] = mesh.cell_coordinates(cell).map(|c| c as u32);
    let middle = model.mesh.cell_centre(cell) - entry;
    ([i, j, k, model.material_index(cell) as u32], vec4(middle), vec4(1.0 / mesh.cell_size(cell)))
}

/// What the slots tell: those of a station with their weights, and the corners of a node.
struct Told {
    stations: Vec<Vec<(u32, f32)>>,
    corners: BTreeMap<u32, Vec<u32>>,
}

pub(super) fn tables_of(model: &Model, layout: &Layout) -> Tables {
    let mut tables = Tables::default();
    let (Some(opening), Some(plan), Some(mesh)) = (model.opening(), &model.puncture, model.mesh.as_block()) else {
        return tables;
    };
    let told = slots(&mut tables, model, opening, mesh, plan.path.entry);
    lists(&mut tables, opening, mesh, layout, &told);
    tables
}

/// Clusters and cells, one slot each.
fn slots(tables: &mut Tables, model: &Model, opening: &OpeningPlan, mesh: &BlockMesh, entry: DVec3) -> Told {
    let mut told: Vec<Vec<(u32, f32)>> = vec![Vec::new(); opening.stations.len()];
    let mut corners: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut slot = 0u32;
    let mut corners_of = |cell: usize, slot: u32| {
        for (node, signs) in mesh.cell_nodes(cell).iter().zip(CORNERS) {
            corners.entry(*node as u32).or_default().push(8 * slot + bits(signs) as u32);
        }
    };
    for Cluster { station, cell, points } in &opening.clusters {
        let (station, cell) = (*station, *cell);
        let (place, middle, inverse) = cell_of(model, mesh, entry, cell as usize);
        let first = tables.points.len() as u32;
        for index in points {
            let point = &opening.stations[station].points[*index];
            let local = point.local - 0.5;
            tables.points.push([local.x as f32, local.y as f32, local.z as f32, point.volume as f32]);
        }
        let end = tables.points.len() as u32;
        tables.clusters.push(OpeningCluster { cell: place, points: [first, end, station as u32, 0], middle, inverse });
        told[station].push((slot, 1.0));
        corners_of(cell as usize, slot);
        slot += 1;
    }
    for near in &opening.cells {
        let (place, middle, inverse) = cell_of(model, mesh, entry, near.cell as usize);
        let mut shares = [0.0; 8];
        CORNERS.iter().zip(near.shares).for_each(|(signs, share)| shares[bits(*signs)] = share as f32);
        let (first, count, places) = (u32::from(near.first), u32::from(near.count), near.places());
        tables.cells.push(OpeningCell {
            cell: place,
            stations: [first, count, places.start, places.end],
            middle,
            inverse,
            lower: [shares[0], shares[1], shares[2], shares[3]],
            upper: [shares[4], shares[5], shares[6], shares[7]],
        });
        for station in first..first + count {
            told[station as usize].push((slot, 1.0 / count as f32));
        }
        corners_of(near.cell as usize, slot);
        slot += 1;
    }
    Told { stations: told, corners }
}

/// Stations and nodes, with the lists of what they are made of.
fn lists(tables: &mut Tables, opening: &OpeningPlan, mesh: &BlockMesh, layout: &Layout, told: &Told) {
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
        let cut_from = station.depth.abs().max(0.5 * opening.spacing);
        tables.stations.push(OpeningStation {
            depth: [station.depth as f32, cut_from as f32, station.opened(opening.map.shaft) as f32, 0.0],
            lists: [first, middle, middle, end],
            ..OpeningStation::zeroed()
        });
    }
    for node in opening.nodes.iter().copied() {
        let grid = mesh.node_coordinates(node as usize);
        let owned = layout.strips().owned_slot(grid, mesh.cells());
        let first = tables.entries.len() as u32;
        let corners = told.corners.get(&node).into_iter().flatten();
        tables.entries.extend(corners.map(|c| OpeningEntry { index: *c, ..OpeningEntry::zeroed() }));
        let middle = tables.entries.len() as u32;
        let sections = sections.get(&node).into_iter().flatten();
        tables.entries.extend(sections.map(|(s, first, second)| OpeningEntry {
            index: *s,
            first: *first,
            second: *second,
            _pad: 0.0,
        }));
        let end = tables.entries.len() as u32;
        tables.nodes.push(OpeningNode { numbers: [owned, first, middle, middle], more: [end, 0, 0, 0] });
    }
}
