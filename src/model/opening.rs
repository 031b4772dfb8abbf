//! What the scheme `opening` of the effect `puncture` prepares: stations along the planned path, the points that carry the tissue beside
//! it, and the cells around it. Equations: src/needle/opening.rs and docs/opening.md.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat3, DVec3};

use super::opening_places::{Place, Places};
use crate::effects::puncture::LEAST_TRAVELS;
use crate::mesh::{CORNERS, Mesh};
use crate::needle::NeedleShape;
use crate::needle::lateral_axes;
use crate::needle::opening::{FADED, Growth, OpeningMap};
use crate::needle::path_line::PathLine;

/// Distance between stations, in needle radii.
const SPACING: f64 = 0.22;

/// Radius of the zone whose tissue is carried by points: twice the cell edge, but within these, in needle radii.
const NEAR: [f64; 2] = [1.2, 2.4];

/// Most points of one thread: more of them in a cell are shared out.
const CLUSTER: usize = 16;

/// Most that the tip advances in a step, in distances of stations.
const ADVANCE: f64 = 1.0;

/// Largest speed of a crack, in speeds of shear waves with the scaled mass: none overtakes surface waves (0.95 of them). With 0.3 of the waves
/// in the tissue around the path the force had not fallen 15 mm behind the puncture of soft organs of scaled mass; with 0.9 the skin snaps
/// back beyond the limit on the speed of nodes over fat.
const CRACK_SPEED: f64 = 0.6;

/// Tissue snaps back behind a crack as fast as that runs: a part of what nodes may move in a step.
const NODES_FOLLOW: f64 = 0.8;

/// A section whose middle lies this many needle radii, times the root of two, beside the axis of the needle is open by half: the needle is not in
/// it any more. A choice: with 1 a shaft that is dragged 3 mm aside at a depth of 8 mm slips off its whole path (2.4 N), and the less it is the
/// more of the energy goes into what snaps back; with 3 and more sections hang beside the tip again.
pub const LEAVES: f64 = 1.75;

/// Stiffness that holds a section on the needle, in shear moduli of the tissue there times the distance of stations, and of the stick spring of
/// friction before its factor, in p-wave moduli. Of the tissue where the section is: with those of muscle in lung, a hundredth as stiff, 2.6 % of
/// the work was lost while the crack ran; with those of bone ahead the guard stopped the run; with the mean along the path, four times those of
/// fat, it stopped 24 of 200 lumbar punctures. With 45 and 50 shear moduli skin that gives way under an oblique needle pulls a node or two to
/// the limit of their speed.
const GUIDE: f64 = 35.0;
/// See above.
const STICK: f64 = 2.0;

/// How far the stations go beyond the deepest place of the tip, in needle radii.
const BEYOND: f64 = 1.5;

/// Radii of the points of a station: nodes and weights of Gauss' rule of five points on -1..1, in the logarithm of the radius. What is
/// summed falls from one constant to another there: eight points change the force by 0.3 %.
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// Of the rings of a station those from this one on are smooth on the scale of cells: where these hold four stations or more, every second
/// station has one of them, in turn, for two.
const SMOOTH_RINGS: usize = 3;
/// See above.
const STATIONS_IN_CELL: f64 = 4.0;

/// Places of Gauss' rule in a cell, -1..1, are at the corners times this.
pub const VOLUME_PLACE: f64 = 0.577_350_269_189_625_8;

/// Four of the corners of a cell, no two on one edge, give its volume: to second order as good as all eight, and all four across a path
/// along an edge.
pub fn is_volume_place(corner: usize) -> bool {
    CORNERS[corner].iter().product::<f64>() < 0.0
}

/// A mean over nodes: their places in [`Station::nodes`] and weights.
pub type Mean = Vec<(u16, f64)>;

/// A point that carries tissue beside the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Index of the cell that it is in.
    pub cell: u32,
    /// The corners of that cell, as places in [`Station::nodes`]; their weights and gradients [1/m].
    pub corners: [u16; 8],
    pub weights: [f64; 8],
    pub gradients: [DVec3; 8],
    /// Rest volume that it stands for [m^3].
    pub volume: f64,
    /// Rest position [m], and place in the cell, 0..1.
    pub place: DVec3,
    pub local: DVec3,
}

/// A section of the path.
#[derive(Debug, Clone, PartialEq)]
pub struct OpeningStation {
    /// Material coordinate Z of its middle [m].
    pub depth: f64,
    /// Rest position of its middle [m], and direction of the path there (unit vector).
    pub middle: DVec3,
    pub direction: DVec3,
    /// All nodes that it acts on.
    pub nodes: Vec<u32>,
    /// Mean of the innermost ring: the middle of the path. Mean over the section of the needle: where it is along the needle.
    pub centre: Mean,
    pub disc: Mean,
    /// The same means of the rest positions [m].
    pub centre_at_rest: DVec3,
    pub disc_at_rest: DVec3,
    pub points: Vec<PathPoint>,
    /// Rest radius of the hole that the slit of the tip acts like [m], and how the tissue around it changes its volume.
    pub hole: f64,
    pub growth: Growth,
    /// Stiffness that holds its middle on the needle, and that of the stick spring of friction before its factor [N/m].
    pub guide: f64,
    pub stick: f64,
}

impl OpeningStation {
    /// rc over the radius of the needle: tissue at the rim of the hole comes to lie on the needle, `a^2 + rc^2 = R^2` on the shaft R.
    pub fn opened(&self, shaft: f64) -> f64 {
        (1.0 - (self.hole / shaft).powi(2)).max(0.0).sqrt()
    }
}

/// Points in one cell, all or some.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    pub cell: u32,
    /// Station and place among its points, in the order in which they are cut.
    pub points: Vec<(usize, usize)>,
}

/// A cell that the map reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearCell {
    pub cell: u32,
    /// Part of its volume that points do not carry, and the middle of that part, from the middle of the cell [m].
    pub share: f64,
    pub place: DVec3,
    /// By how much its volume grows around an open path, over rc^2: mean [1/m^2] and variance [1/m^4] in the cell.
    pub growth: [f64; 2],
    /// First station of those that lie in it, and their number.
    pub first: u16,
    pub count: u16,
}

/// What the scheme prepares.
#[derive(Debug, Clone, PartialEq)]
pub struct OpeningPlan {
    /// Radius R of the needle [m].
    pub shaft: f64,
    /// s0 of the map [m^2].
    pub least: f64,
    /// Length of the tip [m]; behind it the radius is that of the shaft.
    pub tip_length: f64,
    /// Distance between stations [m].
    pub spacing: f64,
    pub stations: Vec<OpeningStation>,
    /// Largest first: threads of a group wait for each other, so that many of the same size lie side by side.
    pub clusters: Vec<Cluster>,
    /// Those around the same stations side by side.
    pub cells: Vec<NearCell>,
    /// Most stations in a cell.
    pub longest_span: u16,
    /// All nodes that points, cells or stations act on.
    pub nodes: BTreeSet<u32>,
    /// Half of the length over which the normal force is averaged for friction, in stations.
    pub averaged: usize,
    /// Most that a crack runs in a step for the sake of the nodes behind it [m].
    pub nodes_follow: f64,
}

impl NearCell {
    /// True where it takes its part of the path from the same stations as another.
    pub fn is_beside_the_stations_of(&self, other: &NearCell) -> bool {
        (self.first, self.count) == (other.first, other.count)
    }
}

impl OpeningPlan {
    /// The map around a needle of this direction (unit vector).
    pub fn map(&self, direction: DVec3) -> OpeningMap {
        OpeningMap { direction, shaft: self.shaft, least: self.least }
    }

    /// Radius of the needle at `s` behind its tip [m], and its rate. The corner between tip and shaft is rounded over the distance of two
    /// stations: at a sharp one the force along the needle fell by what a station holds (12 % of the tip's force) as it passed.
    pub fn radius(&self, s: f64) -> (f64, f64) {
        let rate = self.shaft / self.tip_length;
        let left = self.tip_length + 0.5 * self.spacing - s;
        match s {
            s if s <= 0.0 => (0.0, 0.0),
            s if left > self.spacing => (rate * s, rate),
            _ => {
                let bend = left.max(0.0) / self.spacing;
                (self.shaft - 0.5 * rate * self.spacing * bend * bend, rate * bend)
            }
        }
    }

    /// What is left of the opening of a section whose middle lies beside the axis of the needle, by the square q of that distance [m^2], and its
    /// rate [1/m^2]: `1/(1 + x^2)` with `x = q/(2 (1.75 R)^2)`. A section that hangs beside a needle closes and leaves it. Held by its radius wherever it was,
    /// tissue 3 mm beside a needle that was drawn out was pressed down by it and snapped back, which gained 4 to 9 % of the work.
    pub fn left_beside(&self, square: f64) -> (f64, f64) {
        let over = 0.5 / (LEAVES * self.shaft).powi(2);
        let x = square * over;
        let left = 1.0 / (1.0 + x * x);
        (left, -2.0 * x * over * left * left)
    }

    /// Bound of the second derivative of [`OpeningPlan::left_beside`] by the distance [1/m^2].
    pub fn leaving_curvature(&self) -> f64 {
        1.2 / (LEAVES * self.shaft).powi(2)
    }

    /// By how much the force that spreads the path falls per length that the path is shifted on [N/m], at most, of what spreads its stations
    /// [N]: where each follows the one before it, the sum changes by what the last one holds when all move on by the spacing.
    pub fn shift_stiffness(&self, spreads: &[f64]) -> f64 {
        spreads.iter().fold(0.0, |most: f64, spread| most.max(*spread)) / self.spacing
    }

    /// How far the tip may advance in a step of `dt` [s] in which the needle travels `travel` [m], in tissue with shear waves of this speed
    /// [m/s]: no faster than a crack runs, than nodes can follow, and stations open one after the other. No node can be left inside of the
    /// needle here, so the speed of the needle is no limit.
    pub fn advance_limit(&self, shear_wave_speed: f64, travel: f64, dt: f64) -> f64 {
        (CRACK_SPEED * shear_wave_speed * dt)
            .min(ADVANCE * self.spacing)
            .min(self.nodes_follow)
            .max(LEAST_TRAVELS * travel)
    }

    /// True where neither a station nor any that shares a cell with it is cut by a tip at the material coordinate a.
    pub fn is_ahead(&self, station: &OpeningStation, a: f64) -> bool {
        station.depth > a + (f64::from(self.longest_span) + 2.0) * self.spacing
    }

    /// Part of a station that a tip at the material coordinate a has cut, and its rate [1/m]: 0 up to a spacing before it, 1 from a spacing
    /// behind it on, with a rate without steps. With a part that grew evenly, over one spacing, the resistance to the advance was a saw
    /// tooth, and a crack that ran by a third of a spacing in a step made 2 % of the energy.
    pub fn cut(&self, station: &OpeningStation, a: f64) -> (f64, f64) {
        let part = ((a - self.opens_at(station)) / self.spacing).clamp(-1.0, 1.0);
        let left = 1.0 - part.abs();
        (if part < 0.0 { 0.5 * left * left } else { 1.0 - 0.5 * left * left }, left / self.spacing)
    }

    /// Material coordinate of the tip at which half of a station is cut [m]. On an oblique path what lies before the surface point of the
    /// axis opens as what lies as far behind it.
    pub fn opens_at(&self, station: &OpeningStation) -> f64 {
        station.depth.abs().max(self.spacing)
    }
}

/// What the stations are made from.
pub struct OpeningInput<'a> {
    pub line: &'a PathLine,
    pub needle: &'a NeedleShape,
    /// Deepest material coordinate of the tip and the end of the material [m].
    pub deepest: f64,
    pub exit: f64,
    pub cell_size: f64,
    /// How far the path leans over, against the surface: tangent of the angle with its normal.
    pub tilt: f64,
    /// Shear modulus and p-wave modulus of the tissue at a material coordinate [m], `None` in what does not deform, and those of the scene's own
    /// material [Pa].
    pub moduli: &'a dyn Fn(f64) -> Option<[f64; 2]>,
    pub own_moduli: [f64; 2],
    /// Largest way of a node in a step [m].
    pub node_way: f64,
    /// Rest radius of the hole at a material coordinate [m], and how the tissue around it changes its volume.
    pub hole: &'a dyn Fn(f64) -> (f64, Growth),
}

/// Collects the nodes of a station.
#[derive(Default)]
struct Nodes {
    places: BTreeMap<u32, u16>,
    list: Vec<u32>,
}

impl Nodes {
    fn place(&mut self, node: usize) -> u16 {
        let next = self.list.len() as u16;
        *self.places.entry(node as u32).or_insert_with(|| {
            self.list.push(node as u32);
            next
        })
    }
}

impl OpeningPlan {
    /// Stations, points and cells of a path through a mesh.
    pub fn new(mesh: &Mesh, input: &OpeningInput) -> Self {
        let shaft = input.needle.radius;
        let spacing = SPACING * shaft;
        let near = (2.0 * input.cell_size).clamp(NEAR[0] * shaft, NEAR[1] * shaft);
        let places = &Places::new(mesh, input.line, FADED * shaft);
        // An oblique path reaches the surface at one side before its axis does.
        let first = -(near * input.tilt / spacing).ceil() as i32;
        let end = (input.deepest + BEYOND * shaft).min(input.exit);
        let count = (end / spacing).floor().max(2.0) as i32;
        let stations: Vec<OpeningStation> =
            (first..count).map(|i| station((mesh, places), input, i, spacing, near)).collect();
        // A volume at the wall of the hole grows by R^2 s0/a^4: by a thousandth.
        let least = 0.03 * stations.iter().map(|s| s.hole).fold(f64::INFINITY, f64::min).powi(2) / shaft;
        let average = (1.45 * shaft).max(1.5 * input.cell_size);
        let mut plan = OpeningPlan {
            shaft,
            least: least * least,
            tip_length: input.needle.tip_length,
            spacing,
            clusters: clusters_of(&stations),
            stations,
            cells: Vec::new(),
            longest_span: 0,
            nodes: BTreeSet::new(),
            averaged: ((average / spacing).round() as usize).max(1) / 2,
            nodes_follow: NODES_FOLLOW * input.node_way,
        };
        plan.cells = near_cells((mesh, places), input, &plan, near, f64::from(count) * spacing);
        plan.longest_span = plan.cells.iter().map(|near| near.count).max().unwrap_or(0);
        plan.nodes = plan.stations.iter().flat_map(|s| &s.nodes).copied().collect();
        for near in &plan.cells {
            plan.nodes.extend(mesh.cell_nodes(near.cell as usize).iter().map(|n| *n as u32));
        }
        plan
    }
}

fn station(
    (mesh, places): (&Mesh, &Places),
    input: &OpeningInput,
    number: i32,
    spacing: f64,
    near: f64,
) -> OpeningStation {
    let depth = (f64::from(number) + 0.5) * spacing;
    let direction = input.line.piece(depth).direction;
    let (e1, e2) = lateral_axes(direction);
    let (hole, growth) = (input.hole)(depth);
    let hole = hole.min(0.9 * near);
    let middle = input.line.point(depth);
    let at = |r: f64, part: f64| {
        let angle = std::f64::consts::TAU * part;
        middle + (e1 * angle.cos() + e2 * angle.sin()) * r
    };
    let mut nodes = Nodes::default();
    let mut mean = |radii: &[f64], directions: usize| -> Mean {
        let mut sums: BTreeMap<u16, f64> = BTreeMap::new();
        let mut count = 0.0;
        for r in radii {
            for i in 0..directions {
                let Place { corners, weights, .. } = places.place(at(*r, (i as f64 + 0.5) / directions as f64));
                count += 1.0;
                for (node, w) in corners.iter().zip(weights) {
                    *sums.entry(nodes.place(*node)).or_default() += w;
                }
            }
        }
        sums.into_iter().map(|(n, w)| (n, w / count)).collect()
    };
    let centre = mean(&[hole], 8);
    let shaft = input.needle.radius;
    let disc = mean(&[0.125, 0.375, 0.625, 0.875].map(|part: f64| shaft * part.sqrt()), 8);
    let at_rest = |mean: &Mean| {
        mean.iter().map(|(n, w)| mesh.rest_position(nodes.list[usize::from(*n)] as usize) * *w).sum::<DVec3>()
    };
    let [centre_at_rest, disc_at_rest] = [at_rest(&centre), at_rest(&disc)];
    let long = (near / hole).ln();
    let [shear, pressure] = (input.moduli)(depth).unwrap_or(input.own_moduli);
    let edge = places.edge(input.cell_size);
    let is_coarse = edge >= STATIONS_IN_CELL * spacing;
    let mut points = Vec::new();
    for (ring, (x, w)) in GAUSS.into_iter().enumerate() {
        let place = ring as i32 + number;
        let for_two = is_coarse && ring >= SMOOTH_RINGS;
        if for_two && place.rem_euclid(2) == 1 {
            continue;
        }
        let (row, length) = if for_two { (place.div_euclid(2), 2.0 * spacing) } else { (place, spacing) };
        let r = hole * (0.5 * long * (x + 1.0)).exp();
        // Neighbours along and across are turned against each other, and none lies on a plane of the grid.
        let turn = if row.rem_euclid(2) == 0 { 0.25 } else { 0.75 };
        // About one in every cell that a ring runs through.
        let angles = 4 * (std::f64::consts::TAU * r / edge / 4.0).ceil() as usize;
        let volume = 0.5 * long * w * r * r * std::f64::consts::TAU / angles as f64 * length;
        for i in 0..angles {
            let place = at(r, (i as f64 + turn) / angles as f64);
            let Place { cell, corners, weights, gradients, local, inside } = places.place(place);
            if !inside {
                continue;
            }
            points.push(PathPoint {
                cell: cell as u32,
                corners: corners.map(|n| nodes.place(n)),
                weights,
                gradients,
                volume,
                place,
                local,
            });
        }
    }
    OpeningStation {
        depth,
        middle,
        direction,
        nodes: nodes.list,
        centre,
        disc,
        centre_at_rest,
        disc_at_rest,
        points,
        hole,
        growth,
        guide: GUIDE * shear * spacing,
        stick: STICK * pressure * spacing,
    }
}

fn clusters_of(stations: &[OpeningStation]) -> Vec<Cluster> {
    let mut order: Vec<usize> = (0..stations.len()).collect();
    order.sort_by(|a, b| stations[*a].depth.abs().total_cmp(&stations[*b].depth.abs()));
    let mut by_cell: BTreeMap<u32, Vec<(usize, usize)>> = BTreeMap::new();
    for station in order {
        for (index, point) in stations[station].points.iter().enumerate() {
            by_cell.entry(point.cell).or_default().push((station, index));
        }
    }
    let parts = by_cell.iter().flat_map(|(cell, points)| points.chunks(CLUSTER).map(|part| (*cell, part.to_vec())));
    let mut all: Vec<Cluster> = parts.map(|(cell, points)| Cluster { cell, points }).collect();
    all.sort_by_key(|c| std::cmp::Reverse(c.points.len()));
    all
}

/// Cells that the map reaches, with the part of their volume outside of the zone of points.
fn near_cells(
    (mesh, places): (&Mesh, &Places),
    input: &OpeningInput,
    plan: &OpeningPlan,
    near: f64,
    end: f64,
) -> Vec<NearCell> {
    let faded = FADED * plan.shaft;
    let last = plan.stations.len() - 1;
    let first = plan.stations[0].depth - 0.5 * plan.spacing;
    let coordinates = |x: DVec3| input.line.coordinates(x);
    let of_cell = |cell: usize| {
        let (middle, reach) = places.middle(cell);
        let (r, s) = coordinates(middle);
        // No place of it is reached, where it is at rest.
        if r > faded + VOLUME_PLACE * reach || s > end + reach {
            return None;
        }
        let (share, place) = match r > near + reach {
            true => (1.0, DVec3::ZERO),
            false => places.part(cell, |x| {
                let (r0, s0) = coordinates(x);
                r0 > near || s0 > end || s0 < first
            }),
        };
        let half = places.half_along(cell, input.line.piece(s).direction);
        let index = |s: f64| (((s - first) / plan.spacing).round().max(0.0) as usize).min(last + 1);
        let (from, to) = (index(s - half), index(s + half));
        let nearest = (((s - first) / plan.spacing).max(0.0) as usize).min(last);
        let (from, to) = if to > from { (from, to) } else { (nearest, nearest + 1) };
        Some(NearCell {
            cell: cell as u32,
            share,
            place,
            growth: [0.0; 2],
            first: from as u16,
            count: (to - from) as u16,
        })
    };
    let mut cells: Vec<NearCell> = places.cells().into_iter().filter_map(of_cell).collect();
    cells.sort_by_key(|near| (near.first, near.count));
    let grown = growth_in_cells(&plan.stations);
    for near in &mut cells {
        let station = &plan.stations[usize::from(near.first + near.count / 2)];
        let cell = near.cell as usize;
        let rest = station.growth.rate(coordinates(places.middle(cell).0 + near.place).0.powi(2));
        let [first, second] = grown.get(&near.cell).copied().unwrap_or_default();
        let volume = mesh.cell_volume(cell);
        let mean = first / volume + near.share * rest;
        near.growth = [mean, (second / volume + near.share * rest * rest - mean * mean).max(0.0)];
    }
    cells
}

/// What the points in every cell say of its growth: sums of rates dm/ds and of their squares times volumes.
fn growth_in_cells(stations: &[OpeningStation]) -> BTreeMap<u32, [f64; 2]> {
    let mut sums: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
    for station in stations {
        for point in &station.points {
            let rate = station.growth.rate((point.place - station.middle).length_squared());
            let [first, second] = sums.entry(point.cell).or_default();
            *first += point.volume * rate;
            *second += point.volume * rate * rate;
        }
    }
    sums
}

/// Mean of a vector of every node.
pub fn mean_of(mean: &Mean, nodes: &[u32], values: &[DVec3]) -> DVec3 {
    mean.iter().map(|(place, w)| values[nodes[usize::from(*place)] as usize] * *w).sum()
}

impl PathPoint {
    /// y and the gradient of the displacement there, from the displacements of the nodes of its station.
    pub fn place_and_gradient(&self, u: &[DVec3]) -> (DVec3, DMat3) {
        let (mut y, mut h) = (self.place, DMat3::ZERO);
        for ((corner, w), g) in self.corners.iter().zip(self.weights).zip(self.gradients) {
            let u = u[*corner as usize];
            y += u * w;
            h += DMat3::from_cols(u * g.x, u * g.y, u * g.z);
        }
        (y, h)
    }
}
