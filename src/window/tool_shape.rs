//! The needle as triangles: rings around its centre-line from the tip to the hub.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::needle::lateral_axes;
use crate::scene::{NeedleShape, TipShape, Tool};

/// Corners around the shaft, and rings along its bent part.
const AROUND: usize = 24;
const ALONG: usize = 48;

/// How far a needle is drawn behind its tip [m].
const DRAWN_LENGTH: f64 = 60e-3;

/// A corner of the tool [m] and its normal.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ToolCorner {
    pub place: [f32; 3],
    pub normal: [f32; 3],
}

/// Where the tool is drawn.
#[derive(Clone, Copy)]
pub struct ToolPlace<'a> {
    pub tip: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// Lateral offset of the centre-line `s` behind the tip [m].
    pub offset: &'a dyn Fn(f64) -> DVec3,
}

/// Triangles of a tool, three corners each.
pub fn triangles(tool: &Tool, place: &ToolPlace) -> Vec<ToolCorner> {
    match tool {
        Tool::Needle(needle) => needle_triangles(needle, place),
        Tool::Sphere { radius } => {
            let profile: Vec<(f64, f64)> = (0..=12)
                .map(|n| std::f64::consts::PI * f64::from(n) / 12.0)
                .map(|a| (radius * (1.0 - a.cos()), radius * a.sin()))
                .collect();
            revolve(&profile, place, &|_, _| 0.0)
        }
        Tool::FlatPunch { radius, .. } => {
            revolve(&[(0.0, 0.0), (0.0, *radius), (4.0 * radius, *radius), (4.0 * radius, 0.0)], place, &|_, _| 0.0)
        }
    }
}

fn needle_triangles(needle: &NeedleShape, place: &ToolPlace) -> Vec<ToolCorner> {
    let length = needle.length.min(DRAWN_LENGTH);
    let shaft = |n: usize| needle.tip_length + (length - needle.tip_length) * n as f64 / ALONG as f64;
    match needle.tip {
        TipShape::Bevel { heading } => {
            // The ground face: at the angle phi from the heading the tube begins further back.
            let back = move |phi: f64, s: f64| {
                if s > 0.0 { 0.0 } else { 0.5 * needle.tip_length * (1.0 - (phi - heading).cos()) }
            };
            let mut profile = vec![(0.0, 0.0), (0.0, needle.radius)];
            profile.extend((0..=ALONG).map(|n| (shaft(n), needle.radius)));
            revolve(&profile, place, &back)
        }
        _ => {
            let mut profile = vec![(0.0, 0.0), (needle.tip_length, needle.radius)];
            profile.extend((1..=ALONG).map(|n| (shaft(n), needle.radius)));
            revolve(&profile, place, &|_, _| 0.0)
        }
    }
}

/// Turns a profile (distance behind the tip, radius) around the centre-line; `back(angle, s)`: how far a corner is set back.
fn revolve(profile: &[(f64, f64)], place: &ToolPlace, back: &dyn Fn(f64, f64) -> f64) -> Vec<ToolCorner> {
    let (first, second) = lateral_axes(place.direction);
    let corner = |(s, radius): (f64, f64), n: usize| {
        let phi = std::f64::consts::TAU * n as f64 / AROUND as f64;
        let out = first * phi.cos() + second * phi.sin();
        let s = s + back(phi, s) * if radius > 0.0 { 1.0 } else { 0.5 };
        (place.tip - place.direction * s + (place.offset)(s.max(0.0)) + out * radius, out)
    };
    let mut corners = Vec::with_capacity(6 * AROUND * profile.len());
    for pair in profile.windows(2) {
        // A flat or pointed ring looks ahead, a shaft sideways.
        let (run, rise) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
        let slope = run.hypot(rise).max(1e-12);
        for n in 0..AROUND {
            let (quad, outs): (Vec<DVec3>, Vec<DVec3>) =
                [corner(pair[0], n), corner(pair[0], n + 1), corner(pair[1], n + 1), corner(pair[1], n)]
                    .into_iter()
                    .unzip();
            for at in [0, 1, 2, 0, 2, 3] {
                let normal = outs[at] * (run / slope) + place.direction * (rise / slope);
                corners.push(ToolCorner { place: quad[at].as_vec3().into(), normal: normal.as_vec3().into() });
            }
        }
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cone_begins_at_its_tip_and_is_as_thick_as_its_shaft() {
        let needle = NeedleShape::cone("16G", 0.825e-3, 2.5e-3);
        let tip = DVec3::new(1e-3, 0.0, -5e-3);
        let place = ToolPlace { tip, direction: DVec3::NEG_Z, offset: &|_| DVec3::ZERO };
        let corners = triangles(&Tool::Needle(needle), &place);
        let lowest = corners.iter().map(|c| c.place[2]).fold(f32::INFINITY, f32::min);
        let widest =
            corners.iter().map(|c| (f64::from(c.place[0]) - tip.x).hypot(f64::from(c.place[1]))).fold(0.0, f64::max);
        assert!((f64::from(lowest) - tip.z).abs() < 1e-8 && (widest / 0.825e-3 - 1.0).abs() < 1e-3);
        assert!(corners.iter().all(|c| (DVec3::from(c.normal.map(f64::from)).length() - 1.0).abs() < 1e-5));
        assert_eq!(corners.len() % 3, 0);
    }
}
