//! The needle as triangles: rings around its centre-line from the tip to the hub.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::needle::centre_line::CentreLine;
use crate::needle::{NeedleShape, TipShape, Tool, lateral_axes};

/// Corners around the shaft, and rings along its bent part.
const AROUND: usize = 24;
const ALONG: usize = 48;

/// How far a needle is drawn behind its tip [m].
const DRAWN_LENGTH: f64 = 60e-3;

/// Steel, and what lies in a bore; sRGB and how much of it is drawn.
pub const STEEL: [u8; 4] = [178, 184, 194, 255];
const CORE: [u8; 4] = [204, 121, 167, 255];
/// How much of the needle is drawn where it holds a core.
const SEEN_THROUGH: u8 = 70;

/// A corner of the tool [m], its normal and its colour.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ToolCorner {
    pub place: [f32; 3],
    pub normal: [f32; 3],
    /// sRGB, and how much of it is drawn.
    pub colour: [u8; 4],
}

/// Where the tool is drawn.
#[derive(Debug, Clone, Copy)]
pub struct ToolPlace {
    pub tip: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// How a needle bends.
    pub line: Option<CentreLine>,
    /// Length of the core behind the tip of a hollow needle [m].
    pub core: f64,
}

impl ToolPlace {
    /// A tool that does not bend and holds nothing.
    pub fn straight(tip: DVec3, direction: DVec3) -> Self {
        ToolPlace { tip, direction, line: None, core: 0.0 }
    }

    /// The centre-line `s` behind the tip [m].
    pub fn axis(&self, s: f64) -> DVec3 {
        let aside = self.line.as_ref().map_or(DVec3::ZERO, |line| line.at(s.max(0.0), 0.0).offset);
        self.tip - self.direction * s + aside
    }
}

/// Triangles of a tool and of what it holds, three corners each.
pub fn triangles(tool: &Tool, place: &ToolPlace) -> Vec<ToolCorner> {
    match tool {
        Tool::Needle(needle) => needle_triangles(needle, place),
        Tool::Sphere { radius } => {
            let profile: Vec<(f64, f64)> = (0..=12)
                .map(|n| std::f64::consts::PI * f64::from(n) / 12.0)
                .map(|a| (radius * (1.0 - a.cos()), radius * a.sin()))
                .collect();
            revolve(&profile, place, &|_, _| 0.0, &|_| STEEL)
        }
        Tool::FlatPunch { radius, .. } => {
            let profile = [(0.0, 0.0), (0.0, *radius), (4.0 * radius, *radius), (4.0 * radius, 0.0)];
            revolve(&profile, place, &|_, _| 0.0, &|_| STEEL)
        }
    }
}

fn needle_triangles(needle: &NeedleShape, place: &ToolPlace) -> Vec<ToolCorner> {
    let length = needle.length.min(DRAWN_LENGTH);
    let shaft = |n: usize| needle.tip_length + (length - needle.tip_length) * n as f64 / ALONG as f64;
    if let Some(bore) = needle.bore {
        // The needle is open where it holds a core: outer wall, bore, core.
        let core = place.core.clamp(0.0, length);
        let glass = |s: f64| if s < core { [STEEL[0], STEEL[1], STEEL[2], SEEN_THROUGH] } else { STEEL };
        let wall = |radius: f64| -> Vec<(f64, f64)> {
            let mut profile = vec![(0.0, bore.edge), (needle.tip_length, radius)];
            profile.extend((1..=ALONG).map(|n| (shaft(n), radius)));
            profile
        };
        let mut corners = revolve(&wall(needle.radius), place, &|_, _| 0.0, &glass);
        corners.extend(revolve(&wall(bore.radius), place, &|_, _| 0.0, &glass));
        if core > 0.0 {
            // A little thinner than the bore, so that the wall stays before it.
            let radius = 0.97 * bore.radius;
            let along = (0..=ALONG).map(|n| (core * n as f64 / ALONG as f64, radius));
            let profile: Vec<(f64, f64)> = [(0.0, 0.0)].into_iter().chain(along).chain([(core, 0.0)]).collect();
            corners.extend(revolve(&profile, place, &|_, _| 0.0, &|_| CORE));
        }
        return corners;
    }
    // A straight shaft has no rings between its ends.
    let between = if place.line.is_none() { ALONG } else { 1 };
    match needle.tip {
        TipShape::Bevel { heading } => {
            // The ground face: at the angle phi from the heading the tube begins further back.
            let back = move |phi: f64, s: f64| {
                if s > 0.0 { 0.0 } else { 0.5 * needle.tip_length * (1.0 - (phi - heading).cos()) }
            };
            let mut profile = vec![(0.0, 0.0), (0.0, needle.radius)];
            profile.extend((0..=ALONG).step_by(between).map(|n| (shaft(n), needle.radius)));
            revolve(&profile, place, &back, &|_| STEEL)
        }
        _ => {
            let mut profile = vec![(0.0, 0.0), (needle.tip_length, needle.radius)];
            profile.extend((0..=ALONG).step_by(between).skip(1).map(|n| (shaft(n), needle.radius)));
            revolve(&profile, place, &|_, _| 0.0, &|_| STEEL)
        }
    }
}

/// Turns a profile (distance behind the tip, radius) around the centre-line; `back(angle, s)`: how far a corner is set back;
/// `colour(s)`: of the part that ends at s.
fn revolve(
    profile: &[(f64, f64)],
    place: &ToolPlace,
    back: &dyn Fn(f64, f64) -> f64,
    colour: &dyn Fn(f64) -> [u8; 4],
) -> Vec<ToolCorner> {
    let (first, second) = lateral_axes(place.direction);
    let corner = |(s, radius): (f64, f64), n: usize| {
        let phi = std::f64::consts::TAU * n as f64 / AROUND as f64;
        let out = first * phi.cos() + second * phi.sin();
        let s = s + back(phi, s) * if radius > 0.0 { 1.0 } else { 0.5 };
        (place.axis(s) + out * radius, out)
    };
    let mut corners = Vec::with_capacity(6 * AROUND * profile.len());
    for pair in profile.windows(2) {
        // A flat or pointed ring looks ahead, a shaft sideways.
        let (run, rise) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
        let slope = run.hypot(rise).max(1e-12);
        let colour = colour(pair[1].0);
        for n in 0..AROUND {
            let (quad, outs): (Vec<DVec3>, Vec<DVec3>) =
                [corner(pair[0], n), corner(pair[0], n + 1), corner(pair[1], n + 1), corner(pair[1], n)]
                    .into_iter()
                    .unzip();
            for at in [0, 1, 2, 0, 2, 3] {
                let normal = outs[at] * (run / slope) + place.direction * (rise / slope);
                corners.push(ToolCorner { place: quad[at].as_vec3().into(), normal: normal.as_vec3().into(), colour });
            }
        }
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::needle::BoreShape;

    #[test]
    fn a_cone_begins_at_its_tip_and_is_as_thick_as_its_shaft() {
        let needle = NeedleShape::cone("16G", 0.825e-3, 2.5e-3);
        let tip = DVec3::new(1e-3, 0.0, -5e-3);
        let place = ToolPlace::straight(tip, DVec3::NEG_Z);
        let corners = triangles(&Tool::Needle(needle), &place);
        let lowest = corners.iter().map(|c| c.place[2]).fold(f32::INFINITY, f32::min);
        let widest =
            corners.iter().map(|c| (f64::from(c.place[0]) - tip.x).hypot(f64::from(c.place[1]))).fold(0.0, f64::max);
        assert!((f64::from(lowest) - tip.z).abs() < 1e-8 && (widest / 0.825e-3 - 1.0).abs() < 1e-3);
        assert!(corners.iter().all(|c| (DVec3::from(c.normal.map(f64::from)).length() - 1.0).abs() < 1e-5));
        assert_eq!(corners.len() % 3, 0);
    }

    #[test]
    fn a_core_lies_in_the_bore_behind_the_tip() {
        let bore = BoreShape { radius: 0.6e-3, edge: 0.65e-3, friction: 0.0 };
        let needle = NeedleShape { bore: Some(bore), ..NeedleShape::cone("16G", 0.825e-3, 1e-3) };
        let place = ToolPlace { core: 5e-3, ..ToolPlace::straight(DVec3::new(0.0, 0.0, -8e-3), DVec3::NEG_Z) };
        let corners = triangles(&Tool::Needle(needle.clone()), &place);
        let core: Vec<_> = corners.iter().filter(|c| c.colour == CORE).collect();
        let heights = core.iter().map(|c| c.place[2]);
        assert!((heights.clone().fold(f32::INFINITY, f32::min) + 8e-3).abs() < 1e-8);
        assert!((heights.fold(f32::NEG_INFINITY, f32::max) + 3e-3).abs() < 1e-8);
        assert!(core.iter().all(|c| c.place[0].hypot(c.place[1]) < 0.6e-3));
        // The wall before it is seen through, that above it is not; an empty needle is whole.
        let glass = corners.iter().filter(|c| c.colour[3] < 255);
        assert!(glass.clone().count() > 0 && glass.clone().all(|c| c.place[2] < -2.9e-3));
        let empty = triangles(&Tool::Needle(needle), &ToolPlace { core: 0.0, ..place });
        assert!(empty.iter().all(|c| c.colour == STEEL));
    }
}
