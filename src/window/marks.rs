//! What stands in the view beside tissue and tool: the targets where they are now, and the frame of an ultrasound slice.

use glam::DVec3;

use super::probe::ProbePlane;
use super::tool_shape::ToolCorner;
use super::ultrasound::Window;

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

/// The edges of what a slice shows, as bars.
pub fn frame(plane: &ProbePlane, window: &Window) -> Vec<ToolCorner> {
    let at = |x: f64, y: f64| {
        let place = window.corner + window.size * glam::DVec2::new(x, y);
        plane.origin + plane.lateral * place.x + plane.depth * place.y
    };
    let round = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
    (0..4).flat_map(|n| bar(round[n], round[(n + 1) % 4], plane.normal)).collect()
}

/// A bar of square section; one pair of its sides looks along `normal`.
fn bar(from: DVec3, to: DVec3, normal: DVec3) -> Vec<ToolCorner> {
    let aside = normal.cross(to - from).normalize();
    let mut corners = Vec::with_capacity(24);
    for (out, width) in [(normal, aside), (-normal, aside), (aside, normal), (-aside, normal)] {
        let (out_by, half) = (out * (0.5 * BAR), width * (0.5 * BAR));
        let quad = [from + out_by - half, to + out_by - half, to + out_by + half, from + out_by + half];
        corners.extend([0, 1, 2, 0, 2, 3].map(|n| corner(quad[n], out, FRAME)));
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
