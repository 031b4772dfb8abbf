//! What stands in the view beside tissue and tool: the targets where they are now, the planned entry, and the frame of an ultrasound slice.

use glam::DVec3;

use super::probe::ProbePlane;
use super::tool_shape::ToolCorner;
use super::ultrasound::Window;
use crate::model::Model;

/// Rings of a sphere from pole to pole, and corners around it.
const RINGS: usize = 16;
const AROUND: usize = 24;

/// Of the scale's colours none is vermilion (Okabe and Ito 2008); white bands tell a target also to those who see no red.
const TARGET: [u8; 4] = [213, 94, 0, 255];
const BAND: [u8; 4] = [255, 255, 255, 255];
const FRAME: [u8; 4] = [86, 180, 233, 255];
/// Edge of the bars of the frame [m].
const BAR: f64 = 0.2e-3;

/// A sphere around `centre`, three corners a triangle; every fourth ring is a band.
pub fn target(centre: DVec3, radius: f64) -> Vec<ToolCorner> {
    let out = |ring: usize, n: usize| {
        let theta = std::f64::consts::PI * ring as f64 / RINGS as f64;
        let phi = std::f64::consts::TAU * n as f64 / AROUND as f64;
        DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    let mut corners = Vec::with_capacity(6 * RINGS * AROUND);
    for ring in 0..RINGS {
        let colour = if ring % 4 == 1 { BAND } else { TARGET };
        for n in 0..AROUND {
            let quad = [out(ring, n), out(ring + 1, n), out(ring + 1, n + 1), out(ring, n + 1)];
            corners.extend([0, 1, 2, 0, 2, 3].map(|at| corner(centre + quad[at] * radius, quad[at], colour)));
        }
    }
    corners
}

/// Radius and width of the ring around the planned entry [m], how high it stands over the skin, and its colour.
const RING: f64 = 2.5e-3;
const RING_WIDTH: f64 = 0.45e-3;
const OVER_SKIN: f64 = 0.25e-3;
const ENTRY: [u8; 4] = [0, 114, 178, 255];
/// Dashes of the planned direction before the skin: how many, length and gap [m].
const DASHES: usize = 5;
const DASH: f64 = 2.0e-3;
const GAP: f64 = 1.5e-3;

/// The planned entry: a ring with a cross on the skin, whose unit normal is `normal`, and dashes along the planned `direction` above it.
pub fn entry(at: DVec3, normal: DVec3, direction: DVec3) -> Vec<ToolCorner> {
    let (u, v) = crate::needle::lateral_axes(-normal);
    let middle = at + normal * OVER_SKIN;
    let around = |n: usize, radius: f64| {
        let phi = std::f64::consts::TAU * n as f64 / AROUND as f64;
        middle + (u * phi.cos() + v * phi.sin()) * radius
    };
    let mut corners = Vec::new();
    for n in 0..AROUND {
        let (inner, outer) = (RING - RING_WIDTH, RING);
        let quad = [around(n, inner), around(n, outer), around(n + 1, outer), around(n + 1, inner)];
        corners.extend([0, 1, 2, 0, 2, 3].map(|at| corner(quad[at], normal, ENTRY)));
    }
    for axis in [u, v] {
        for side in [-1.0, 1.0] {
            let (from, to) = (middle + axis * (side * 0.25 * RING), middle + axis * (side * 0.75 * RING));
            corners.extend(bar(from, to, normal, ENTRY));
        }
    }
    let aside = crate::needle::lateral_axes(direction).0;
    for n in 0..DASHES {
        let from = at - direction * (GAP + n as f64 * (DASH + GAP));
        corners.extend(bar(from, from - direction * DASH, aside, ENTRY));
    }
    corners
}

/// The planned entry of a scene where a hand chooses its own; nothing where the path is planned, and without tissue below.
pub fn planned_entry(model: &Model) -> Vec<ToolCorner> {
    let motion = &model.scene.motion;
    let skin = |x: DVec3| model.skin_at(x).map(|z| DVec3 { z, ..x });
    // Where the line through the planned entry meets the skin is the entry itself, to within the lattice of heights.
    let Some(at) = skin(motion.entry) else { return Vec::new() };
    let way = 1e-3;
    let slope = |axis: DVec3| {
        let (a, b) = (skin(at - axis * way), skin(at + axis * way));
        a.zip(b).map_or(0.0, |(a, b)| (b.z - a.z) / (2.0 * way))
    };
    let normal = DVec3::new(-slope(DVec3::X), -slope(DVec3::Y), 1.0).normalize();
    entry(at, normal, motion.direction)
}

/// The edges of what a slice shows, as bars.
pub fn frame(plane: &ProbePlane, window: &Window) -> Vec<ToolCorner> {
    let at = |x: f64, y: f64| {
        let place = window.corner + window.size * glam::DVec2::new(x, y);
        plane.origin + plane.lateral * place.x + plane.depth * place.y
    };
    let round = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
    (0..4).flat_map(|n| bar(round[n], round[(n + 1) % 4], plane.normal, FRAME)).collect()
}

/// A bar of square section; one pair of its sides looks along `normal`.
fn bar(from: DVec3, to: DVec3, normal: DVec3, colour: [u8; 4]) -> Vec<ToolCorner> {
    let aside = normal.cross(to - from).normalize();
    let mut corners = Vec::with_capacity(24);
    for (out, width) in [(normal, aside), (-normal, aside), (aside, normal), (-aside, normal)] {
        let (out_by, half) = (out * (0.5 * BAR), width * (0.5 * BAR));
        let quad = [from + out_by - half, to + out_by - half, to + out_by + half, from + out_by + half];
        corners.extend([0, 1, 2, 0, 2, 3].map(|n| corner(quad[n], out, colour)));
    }
    corners
}

fn corner(place: DVec3, normal: DVec3, colour: [u8; 4]) -> ToolCorner {
    ToolCorner { place: place.as_vec3().into(), normal: normal.as_vec3().into(), colour }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_a_sphere_in_two_colours() {
        let centre = DVec3::new(1e-3, 2e-3, -9e-3);
        let corners = target(centre, 0.75e-3);
        for c in &corners {
            let way = DVec3::from(c.place.map(f64::from)) - centre;
            assert!((way.length() / 0.75e-3 - 1.0).abs() < 1e-4);
        }
        let bands = corners.iter().filter(|c| c.colour == BAND).count();
        assert_eq!(bands * 4, corners.len());
    }
}
