//! The needle as triangles: rings around its centre-line from the tip to the hub, with a mark every centimetre and the hub in the colour
//! of its diameter (ISO 6009).

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::needle::centre_line::CentreLine;
use crate::needle::{NeedleShape, TipShape, Tool, lateral_axes};

/// Corners around the shaft, and rings along its bent part.
const AROUND: usize = 24;
const ALONG: usize = 48;

/// How far a needle is drawn behind its tip [m].
const DRAWN_LENGTH: f64 = 100e-3;

/// Distance of the depth marks, and their width [m]; every fifth is as wide again.
const MARK_EVERY: f64 = 10e-3;
const MARK_WIDTH: f64 = 0.6e-3;
const MARK: [u8; 4] = [32, 34, 40, 255];

/// Radius and length of the hub [m].
const HUB_RADIUS: f64 = 2.1e-3;
const HUB_LENGTH: f64 = 14e-3;

/// Outer diameters [m] and the colours of their hubs, sRGB. Source: ISO 6009:2016; the standard gives names of colours, these stand for
/// them.
const HUBS: [(f64, [u8; 3]); 17] = [
    (0.3e-3, [240, 205, 40]),
    (0.33e-3, [205, 40, 40]),
    (0.36e-3, [40, 140, 135]),
    (0.4e-3, [145, 148, 150]),
    (0.45e-3, [125, 75, 40]),
    (0.5e-3, [235, 125, 30]),
    (0.55e-3, [130, 85, 160]),
    (0.6e-3, [30, 70, 160]),
    (0.7e-3, [45, 45, 48]),
    (0.8e-3, [20, 100, 60]),
    (0.9e-3, [240, 205, 40]),
    (1.1e-3, [240, 230, 200]),
    (1.2e-3, [240, 150, 175]),
    (1.4e-3, [170, 50, 110]),
    (1.6e-3, [240, 240, 240]),
    (1.8e-3, [125, 145, 165]),
    (2.1e-3, [150, 205, 150]),
];

/// Colour of the hub of a needle.
fn hub_colour(needle: &NeedleShape) -> [u8; 4] {
    let off = |d: f64| (d - 2.0 * needle.radius).abs();
    let nearest = HUBS.into_iter().reduce(|best, next| if off(next.0) < off(best.0) { next } else { best });
    let [r, g, b] = nearest.map_or([STEEL[0], STEEL[1], STEEL[2]], |(_, colour)| colour);
    [r, g, b, 255]
}

/// The marks on a shaft: begin and end behind the tip [m].
fn marks(needle: &NeedleShape, length: f64) -> Vec<(f64, f64)> {
    let count = (length / MARK_EVERY).floor() as usize;
    (1..=count)
        .map(|n| (n as f64 * MARK_EVERY, if n.is_multiple_of(5) { 2.0 * MARK_WIDTH } else { MARK_WIDTH }))
        .map(|(s, width)| (s - 0.5 * width, s + 0.5 * width))
        .filter(|(begin, end)| *begin > needle.tip_length && *end < length)
        .collect()
}

/// Distances behind the tip where a shaft has rings [m]: at its ends, between them where it bends, at its marks.
fn shaft_rings(needle: &NeedleShape, length: f64, is_bent: bool) -> Vec<f64> {
    let between = if is_bent { 1 } else { ALONG };
    let even = (0..=ALONG).step_by(between);
    let mut rings: Vec<f64> =
        even.map(|n| needle.tip_length + (length - needle.tip_length) * n as f64 / ALONG as f64).collect();
    rings.extend(marks(needle, length).into_iter().flat_map(|(begin, end)| [begin, end]));
    rings.sort_by(f64::total_cmp);
    rings
}

/// The hub behind a shaft.
fn hub(needle: &NeedleShape, length: f64, place: &ToolPlace) -> Vec<ToolCorner> {
    let colour = hub_colour(needle);
    let profile = [
        (length, 0.0),
        (length, 0.6 * HUB_RADIUS),
        (length + 0.35 * HUB_LENGTH, HUB_RADIUS),
        (length + HUB_LENGTH, HUB_RADIUS),
        (length + HUB_LENGTH, 0.0),
    ];
    revolve(&profile, place, &|_, _| 0.0, &|_| colour)
}

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
    let marked = marks(needle, length);
    let steel = |s: f64| if marked.iter().any(|(_, end)| *end == s) { MARK } else { STEEL };
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
        corners.extend(hub(needle, length, place));
        return corners;
    }
    let rings = shaft_rings(needle, length, place.line.is_some());
    let mut corners = match needle.tip {
        TipShape::Bevel { heading } => {
            // The ground face: at the angle phi from the heading the tube begins further back.
            let back = move |phi: f64, s: f64| {
                if s > 0.0 { 0.0 } else { 0.5 * needle.tip_length * (1.0 - (phi - heading).cos()) }
            };
            let mut profile = vec![(0.0, 0.0), (0.0, needle.radius)];
            profile.extend(rings.into_iter().map(|s| (s, needle.radius)));
            revolve(&profile, place, &back, &steel)
        }
        _ => {
            let mut profile = vec![(0.0, 0.0), (needle.tip_length, needle.radius)];
            profile.extend(rings.into_iter().skip(1).map(|s| (s, needle.radius)));
            revolve(&profile, place, &|_, _| 0.0, &steel)
        }
    };
    corners.extend(hub(needle, length, place));
    corners
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
        let shaft = |c: &&ToolCorner| f64::from(c.place[2]) < tip.z + 0.099;
        let widest = corners
            .iter()
            .filter(shaft)
            .map(|c| (f64::from(c.place[0]) - tip.x).hypot(f64::from(c.place[1])))
            .fold(0.0, f64::max);
        assert!((f64::from(lowest) - tip.z).abs() < 1e-8 && (widest / 0.825e-3 - 1.0).abs() < 1e-3);
        assert!(corners.iter().all(|c| (DVec3::from(c.normal.map(f64::from)).length() - 1.0).abs() < 1e-5));
        assert_eq!(corners.len() % 3, 0);
        // A mark every centimetre, ten of them but the one at the hub; the hub of 16G is white.
        let mut marks: Vec<i64> = corners
            .iter()
            .filter(|c| c.colour == MARK)
            .map(|c| ((f64::from(c.place[2]) - tip.z) * 100.0).round() as i64)
            .collect();
        marks.sort_unstable();
        marks.dedup();
        assert_eq!(marks, (1..=9).collect::<Vec<i64>>());
        assert!(corners.iter().any(|c| c.colour == [240, 240, 240, 255]));
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
        assert!(empty.iter().all(|c| c.colour == STEEL || c.place[2] > 0.091));
    }
}
