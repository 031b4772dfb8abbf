//! Whether a surface is closed, turned outwards, free of crossings and of a likely size.
//!
//! Triangles that cross: an edge of one goes through the other, by the signs of five volumes (Segura, Feito, "Algorithms to test
//! ray-triangle intersection", WSCG 2001), for pairs whose boxes meet in a tree. What merely touches does not cross. Parts of a surface
//! that are closed by themselves may run inwards, as the walls of a cavity do: only the surface as a whole is turned outwards.

use glam::DVec3;
use rayon::prelude::*;

use super::TriangleSurface;
use super::draft::root;
use super::tree::Tree;

/// Size of what is expected: a vessel to a body [m].
pub const EXPECTED_SIZE: (f64, f64) = (1e-3, 2.0);

/// Triangles that are tested for crossings; of more, as many are picked evenly.
const MOST_TESTED: usize = 300_000;

/// Most neighbours and most boxes that one triangle is tested with.
const MOST_NEIGHBOURS: usize = 200;
const MOST_BOXES: usize = 2000;

/// Most boxes for all triangles together: seconds.
const MOST_BOXES_IN_ALL: usize = 50_000_000;

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Edges that triangles leave open.
    pub open_edges: usize,
    /// Holes that they bound; a crack counts as one.
    pub holes: usize,
    /// Middle of the rim of the largest hole [m] and its length [m].
    pub largest_hole: Option<(DVec3, f64)>,
    /// Edges with more than two triangles.
    pub crowded_edges: usize,
    /// Triangles that were turned round.
    pub turned: usize,
    /// Whether some triangles cannot be turned to agree with all their neighbours, as in a Moebius strip.
    pub one_sided: bool,
    /// Pairs of triangles that cross, among those tested.
    pub crossings: usize,
    /// Where the first of them cross [m].
    pub first_crossing: Option<DVec3>,
    /// Share of the triangles that were tested for crossings.
    pub tested: f64,
    /// Volume inside [m^3], from the turned triangles.
    pub volume: f64,
    /// Plain sentences on all of it; empty for a surface that needs nothing.
    pub notices: Vec<String>,
}

impl Report {
    /// Whether the surface has an inside without any doubt.
    pub fn is_closed(&self) -> bool {
        self.open_edges == 0 && self.crowded_edges == 0 && !self.one_sided
    }
}

/// Looks a surface over and turns its triangles outwards where they do not run so.
pub fn check(surface: &mut TriangleSurface) -> Report {
    let mut report = Report { tested: 1.0, ..Report::default() };
    let name = surface.name.clone();
    let edges = Edges::of(surface);
    size(surface, &mut report.notices);
    holes(surface, &edges, &mut report);
    if report.crowded_edges > 0 {
        report.notices.push(format!(
            "{name}: {} edges belong to more than two triangles; inside and outside may be unclear there.",
            report.crowded_edges
        ));
    }
    turn(surface, &edges, &mut report);
    crossings(surface, &mut report);
    report
}

/// Half edges, sorted so that those of an edge stand beside each other.
struct Edges {
    /// Lower point, higher point, three times the triangle plus the corner at which it begins.
    halves: Vec<(u32, u32, u32)>,
}

impl Edges {
    fn of(surface: &TriangleSurface) -> Edges {
        let triangles = surface.triangles.iter().enumerate();
        let mut halves: Vec<(u32, u32, u32)> = triangles
            .flat_map(|(t, corners)| {
                (0..3).map(move |n| {
                    let (a, b) = (corners[n], corners[(n + 1) % 3]);
                    (a.min(b), a.max(b), (3 * t + n) as u32)
                })
            })
            .collect();
        halves.par_sort_unstable();
        Edges { halves }
    }

    /// The half edges of each edge.
    fn groups(&self) -> impl Iterator<Item = &[(u32, u32, u32)]> {
        self.halves.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
    }
}

fn millimetres(x: DVec3) -> String {
    let DVec3 { x, y, z } = 1e3 * x;
    format!("({x:.2}, {y:.2}, {z:.2}) mm")
}

fn size(surface: &TriangleSurface, notices: &mut Vec<String>) {
    let Some((low, high)) = surface.bounds() else { return };
    let size = (high - low).length();
    if !(EXPECTED_SIZE.0..=EXPECTED_SIZE.1).contains(&size) {
        notices.push(format!(
            "{}: it is {:.3e} mm across, where 1 mm to 2 m is expected: the unit is probably another one.",
            surface.name,
            1e3 * size
        ));
    }
}

fn holes(surface: &TriangleSurface, edges: &Edges, report: &mut Report) {
    let mut rim: Vec<u32> = (0..surface.points.len() as u32).collect();
    let mut open = Vec::new();
    for group in edges.groups() {
        match *group {
            [(a, b, _)] => {
                open.push((a, b));
                let (a, b) = (root(&mut rim, a), root(&mut rim, b));
                rim[a.max(b) as usize] = a.min(b);
            }
            [_, _] => {}
            _ => report.crowded_edges += 1,
        }
    }
    report.open_edges = open.len();
    // Length and the sum of middles by length, for the first point of each rim.
    let mut rims = std::collections::BTreeMap::<u32, (f64, DVec3)>::new();
    for (a, b) in &open {
        let (x, y) = (surface.points[*a as usize], surface.points[*b as usize]);
        let length = x.distance(y);
        let sum = rims.entry(root(&mut rim, *a)).or_default();
        *sum = (sum.0 + length, sum.1 + length * 0.5 * (x + y));
    }
    report.holes = rims.len();
    let largest = rims.values().filter(|(length, _)| *length > 0.0).max_by(|a, b| a.0.total_cmp(&b.0));
    report.largest_hole = largest.map(|(length, sum)| (*sum / *length, *length));
    if let Some((middle, length)) = report.largest_hole {
        report.notices.push(format!(
            "{}: the surface is open at {} edges, in {}; the largest hole is around {}, with a rim of {:.2} mm.",
            surface.name,
            report.open_edges,
            if report.holes == 1 { "one hole".into() } else { format!("{} holes", report.holes) },
            millimetres(middle),
            1e3 * length
        ));
    }
}

/// Turns triangles to agree with their neighbours, the smaller part of those that are joined, and all where the volume is negative.
fn turn(surface: &mut TriangleSurface, edges: &Edges, report: &mut Report) {
    const NONE: u32 = u32::MAX;
    let count = surface.triangles.len();
    // The half edge on the other side of each, where there is exactly one.
    let mut beside = vec![NONE; 3 * count];
    for group in edges.groups() {
        if let [(_, _, a), (_, _, b)] = *group {
            (beside[a as usize], beside[b as usize]) = (b, a);
        }
    }
    let begin = |triangles: &[[u32; 3]], half: u32| triangles[half as usize / 3][half as usize % 3];
    // Whether a triangle is to be turned; unknown before it is reached.
    let mut turned: Vec<Option<bool>> = vec![None; count];
    let mut joined = Vec::new();
    for seed in 0..count {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        joined.clear();
        joined.push(seed as u32);
        let mut next = 0;
        while let Some(t) = joined.get(next).copied() {
            next += 1;
            for half in 3 * t..3 * t + 3 {
                let other = beside[half as usize];
                if other == NONE {
                    continue;
                }
                // Neighbours that agree go along their edge in opposite directions.
                let agrees = begin(&surface.triangles, half) != begin(&surface.triangles, other);
                let wanted = turned[t as usize].map(|own| own == agrees);
                let at = other / 3;
                match turned[at as usize] {
                    None => {
                        turned[at as usize] = wanted;
                        joined.push(at);
                    }
                    found => report.one_sided |= found != wanted,
                }
            }
        }
        let is_turned = |t: &&u32| turned[**t as usize] == Some(true);
        if 2 * joined.iter().filter(is_turned).count() > joined.len() {
            for t in &joined {
                turned[*t as usize] = turned[*t as usize].map(|own| !own);
            }
        }
    }
    for (triangle, _) in surface.triangles.iter_mut().zip(&turned).filter(|(_, turned)| **turned == Some(true)) {
        triangle.swap(1, 2);
        report.turned += 1;
    }
    let name = &surface.name;
    if report.turned > 0 {
        report.notices.push(format!(
            "{name}: {} of {count} triangles ran against their neighbours and were turned round.",
            report.turned
        ));
    }
    if report.one_sided {
        report.notices.push(format!("{name}: the surface has no two sides, as a Moebius strip; it bounds nothing."));
    }
    report.volume = surface.volume();
    if report.volume < 0.0 {
        surface.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        report.volume = -report.volume;
        report.turned = count - report.turned;
        report
            .notices
            .push(format!("{name}: the triangles ran clockwise seen from outside and were all turned round."));
    }
}

/// What a triangle crosses.
#[derive(Default)]
struct Crossed {
    pairs: usize,
    first: Option<DVec3>,
    given_up: bool,
    /// Boxes that were looked at.
    boxes: usize,
}

fn crossings(surface: &TriangleSurface, report: &mut Report) {
    let count = surface.triangles.len();
    let tree = Tree::new(surface);
    let every = count.div_ceil(MOST_TESTED).max(1);
    let tested: Vec<usize> = (0..count).step_by(every).collect();
    let mut found: Vec<Crossed> = Vec::new();
    for some in tested.chunks(10_000) {
        found.par_extend(some.par_iter().map(|t| crossed(surface, &tree, *t, every)));
        if found.iter().map(|c| c.boxes).sum::<usize>() > MOST_BOXES_IN_ALL {
            break;
        }
    }
    report.crossings = found.iter().map(|c| c.pairs).sum();
    report.first_crossing = found.iter().find_map(|c| c.first);
    let whole = found.iter().filter(|c| !c.given_up).count();
    report.tested = if count == 0 { 1.0 } else { whole as f64 / count as f64 };
    let name = &surface.name;
    if let Some(place) = report.first_crossing {
        report.notices.push(format!(
            "{name}: the surface crosses itself: {} pairs of triangles{}, the first at {}.",
            report.crossings,
            if whole < count { " among those tested" } else { "" },
            millimetres(place)
        ));
    }
    if whole < count {
        report.notices.push(format!(
            "{name}: {:.1} % of its {count} triangles were tested for crossings, more would take too long.",
            100.0 * report.tested
        ));
    }
}

/// Crossings of one triangle with all others; pairs of two that are tested count once.
fn crossed(surface: &TriangleSurface, tree: &Tree, t: usize, every: usize) -> Crossed {
    let mut found = Crossed::default();
    let own = surface.triangles[t];
    let corners = surface.corners(t);
    let [low, high] = bounds(&corners);
    let mut neighbours = 0;
    let mut open = vec![0_u32];
    while let Some(at) = open.pop() {
        let branch = &tree.branches[at as usize];
        found.boxes += 1;
        if found.boxes > MOST_BOXES || neighbours > MOST_NEIGHBOURS {
            found.given_up = true;
            break;
        }
        if !meet((low, high), (branch.low, branch.high)) {
            continue;
        }
        if branch.second != 0 {
            open.extend([branch.second, at + 1]);
            continue;
        }
        for other in &tree.order[branch.triangles.start as usize..branch.triangles.end as usize] {
            let other = *other as usize;
            if other == t || (other < t && other.is_multiple_of(every)) {
                continue;
            }
            let theirs = surface.triangles[other];
            let shared = own.iter().filter(|n| theirs.contains(n)).count();
            let others = surface.corners(other);
            let [other_low, other_high] = bounds(&others);
            if shared > 1 || !meet((low, high), (other_low, other_high)) {
                continue;
            }
            neighbours += 1;
            let place = through(&corners, &own, &others, &theirs).or_else(|| through(&others, &theirs, &corners, &own));
            if let Some(place) = place {
                found.pairs += 1;
                found.first.get_or_insert(place);
            }
        }
    }
    found
}

fn bounds(corners: &[DVec3; 3]) -> [DVec3; 2] {
    let [a, b, c] = *corners;
    [a.min(b).min(c), a.max(b).max(c)]
}

fn meet(one: (DVec3, DVec3), other: (DVec3, DVec3)) -> bool {
    one.0.cmple(other.1).all() && other.0.cmple(one.1).all()
}

/// Where an edge of the first triangle goes through the second one, but for edges with a corner in common.
fn through(edges: &[DVec3; 3], own: &[u32; 3], corners: &[DVec3; 3], theirs: &[u32; 3]) -> Option<DVec3> {
    let [a, b, c] = *corners;
    let extent = [a - b, a - c, edges[0] - a, edges[1] - a, edges[2] - a];
    let length = extent.iter().map(|x| x.length_squared()).fold(0.0, f64::max).sqrt();
    // Less is rounding: both lie in one plane.
    let flat = 1e-12 * length * length * length;
    // Six times the volume of a tetrahedron.
    let side = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| {
        let six = (b - a).cross(c - a).dot(d - a);
        if six.abs() > flat { six } else { 0.0 }
    };
    (0..3).find_map(|n| {
        let m = (n + 1) % 3;
        if theirs.contains(&own[n]) || theirs.contains(&own[m]) {
            return None;
        }
        let (p, q) = (edges[n], edges[m]);
        let (above, below) = (side(a, b, c, p), side(a, b, c, q));
        if above * below >= 0.0 {
            return None;
        }
        let sides = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
        let inside = sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0);
        inside.then(|| p.lerp(q, above / (above - below)))
    })
}
