//! The tool in a picture: rods, tubes and spheres, lit from the left.

use glam::{DVec2, DVec3};

use super::super::slice::Plane;
use super::{Canvas, Colour, INK, Layout};
use crate::needle::centre_line::{CentreLine, ENTRY_COUNT};
use crate::needle::gap::Profile;
use crate::needle::{NeedleShape, Tool};
use crate::observables::FieldSnapshot;
use crate::scene::Scene;

/// The tool in the plane of the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct ToolDrawing {
    /// Foremost point [m].
    tip: DVec2,
    /// Unit vector from the tip back along the axis.
    back: DVec2,
    /// Centre-line of a bent needle, and the direction in space in which `back.perp()` lies.
    line: Option<CentreLine>,
    sideways: DVec3,
    shape: ToolShape,
}

#[derive(Debug, Clone, Copy)]
enum ToolShape {
    /// Cylinder behind a tip of the given length (0 for a flat end) [m], its axis beside the line of the apex [m]
    /// (positive towards `back.perp()`; 0 for a cone).
    Rod { radius: f64, cone: f64, beside: f64 },
    /// Tube whose walls grow from the cutting edge to the outer and the inner radius over `ground` behind the tip [m].
    Tube { outer: f64, inner: f64, edge: f64, ground: f64 },
    /// Sphere on a thin rod [m].
    Sphere { radius: f64 },
}

impl ToolDrawing {
    pub(super) fn new(scene: &Scene, snapshot: &FieldSnapshot, plane: &Plane) -> Option<Self> {
        let (tip, direction) = snapshot.tool_pose?;
        let in_plane = |v: DVec3| DVec2::new(v.dot(plane.right), v.dot(plane.up));
        let back = (-in_plane(direction)).try_normalize().unwrap_or(DVec2::Y);
        let shape = match scene.tool.as_ref()? {
            Tool::Needle(NeedleShape { radius, tip_length, bore: Some(bore), .. }) => {
                ToolShape::Tube { outer: *radius, inner: bore.radius, edge: bore.edge, ground: *tip_length }
            }
            Tool::Needle(needle) => {
                let shift = Profile::new(needle, direction).shift;
                let beside = needle.radius * in_plane(shift).dot(back.perp());
                ToolShape::Rod { radius: needle.radius, cone: needle.tip_length, beside }
            }
            Tool::FlatPunch { radius, .. } => ToolShape::Rod { radius: *radius, cone: 0.0, beside: 0.0 },
            Tool::Sphere { radius } => ToolShape::Sphere { radius: *radius },
        };
        let tip = plane.project(tip);
        let sideways = plane.right * back.perp().x + plane.up * back.perp().y;
        tip.is_finite().then_some(Self { tip, back, line: snapshot.centre_line, sideways, shape })
    }

    /// How far the axis lies beside its straight line at `along` behind the tip [m].
    fn bend(&self, along: f64) -> f64 {
        self.line.map_or(0.0, |line| line.at(along, 0.0).offset.dot(self.sideways))
    }

    /// Where the outline needs corners, from `start` to `end` behind the tip [m].
    fn stations(&self, start: f64, end: f64) -> Vec<f64> {
        let between = self.line.iter().flat_map(|line| (1..ENTRY_COUNT).map(|i| line.spacing * i as f64));
        let inner = between.filter(|s| *s > start && *s < end);
        std::iter::once(start).chain(inner).chain([end]).collect()
    }

    /// True where the tool covers a point of the plane [m].
    pub(super) fn covers(&self, point: DVec2) -> bool {
        let p = point - self.tip;
        let along = p.dot(self.back);
        let across = p.dot(self.back.perp()) - self.bend(along);
        match self.shape {
            ToolShape::Rod { radius, cone, beside } => {
                let grown = if along < cone { along / cone } else { 1.0 };
                along >= 0.0 && (across - beside * grown).abs() <= radius * grown
            }
            ToolShape::Tube { outer, inner, edge, ground } => {
                let grown = (along / ground).clamp(0.0, 1.0);
                let walls = (edge + (inner - edge) * grown)..=(edge + (outer - edge) * grown);
                along >= 0.0 && walls.contains(&across.abs())
            }
            ToolShape::Sphere { radius } => (p - radius * self.back).length() <= radius,
        }
    }

    pub(super) fn draw(&self, canvas: &mut Canvas, layout: &Layout) {
        // Longer than the picture: the frame covers what is too much.
        let length = 4.0 * f64::from(layout.size.0 + layout.size.1) / layout.pixels_per_metre;
        match self.shape {
            ToolShape::Rod { .. } => self.draw_rod(canvas, layout, self.shape, length),
            ToolShape::Tube { outer, inner, edge, ground } => {
                for side in [-1.0, 1.0] {
                    let at = |along: f64, across: f64| {
                        let across = side * across + self.bend(along);
                        layout.place(self.tip + along * self.back + across * self.back.perp())
                    };
                    let [light, dark] = [steel(-0.2), steel(0.6)];
                    let tip = at(0.0, edge);
                    canvas.patch([tip, tip, at(ground, inner), at(ground, outer)], [light, light, dark, light]);
                    let stations = self.stations(ground, length);
                    for ends in stations.windows(2) {
                        let [low, high] = [ends[0], ends[1]];
                        canvas.patch(
                            [at(low, outer), at(low, inner), at(high, inner), at(high, outer)],
                            [light, dark, dark, light],
                        );
                    }
                    for wall in [inner, outer] {
                        canvas.round_line([tip, at(ground, wall)], 1.6 * layout.unit, INK);
                        for ends in stations.windows(2) {
                            canvas.round_line([at(ends[0], wall), at(ends[1], wall)], 1.6 * layout.unit, INK);
                        }
                    }
                }
            }
            ToolShape::Sphere { radius } => {
                let stem = Self { tip: self.tip + radius * self.back, ..*self };
                let rod = ToolShape::Rod { radius: 0.25 * radius, cone: 0.0, beside: 0.0 };
                stem.draw_rod(canvas, layout, rod, length);
                let centre = layout.place(self.tip + radius * self.back);
                draw_ball(canvas, centre, radius * layout.pixels_per_metre, layout.unit);
            }
        }
    }

    fn draw_rod(&self, canvas: &mut Canvas, layout: &Layout, rod: ToolShape, length: f64) {
        const STRIPS: usize = 16;
        let ToolShape::Rod { radius, cone, beside } = rod else { return };
        let side = self.back.perp();
        let at = |t: f64, along: f64, width: f64| {
            let across = if along < cone || (along == 0.0 && width == 0.0) { 0.0 } else { beside };
            layout.place(self.tip + along * self.back + (self.bend(along) + across + t * width) * side)
        };
        let stations = self.stations(cone, length);
        // Shading runs from the left side of the rod in the picture to its right one.
        let left_is = if side.x > 0.0 { -1.0 } else { 1.0 };
        for strip in 0..STRIPS {
            let t = [strip, strip + 1].map(|i| 2.0 * i as f64 / STRIPS as f64 - 1.0);
            let [a, b] = t.map(|t| steel(-left_is * t));
            for ends in stations.windows(2) {
                let [low, high] = [ends[0], ends[1]];
                canvas.patch(
                    [at(t[0], low, radius), at(t[1], low, radius), at(t[1], high, radius), at(t[0], high, radius)],
                    [a, b, b, a],
                );
            }
            if cone > 0.0 {
                canvas.patch(
                    [at(0.0, 0.0, radius), at(0.0, 0.0, radius), at(t[1], cone, radius), at(t[0], cone, radius)],
                    [a, b, b, a],
                );
            }
        }
        let left = stations.iter().rev().map(|s| at(-1.0, *s, radius));
        let right = stations.iter().map(|s| at(1.0, *s, radius));
        let outline: Vec<DVec2> = left.chain([at(0.0, 0.0, radius)]).chain(right).collect();
        for ends in outline.windows(2) {
            canvas.round_line([ends[0], ends[1]], 1.6 * layout.unit, INK);
        }
    }
}

/// Grey of a cylinder at -1..1 across it, lit from the left.
fn steel(t: f64) -> [f32; 4] {
    let facing = (1.0 - t * t).max(0.0).sqrt();
    let lit = (0.55 * facing - 0.45 * t).max(0.0);
    let glint = (-((t + 0.4) / 0.16).powi(2)).exp();
    grey(0.30 + 0.55 * lit + 0.22 * glint)
}

fn grey(level: f64) -> [f32; 4] {
    let byte = |factor: f64| (255.0 * (factor * level).clamp(0.0, 1.0)) as u8;
    Colour(byte(0.98), byte(1.0), byte(1.02)).linear(1.0)
}

fn draw_ball(canvas: &mut Canvas, centre: DVec2, radius: f64, unit: f64) {
    const SECTORS: usize = 64;
    const RINGS: usize = 12;
    let light = DVec3::new(-0.5, 0.6, 0.62).normalize();
    let shade = |p: DVec2| {
        let normal = DVec3::new(p.x, -p.y, (1.0 - p.length_squared()).max(0.0).sqrt());
        let lit = normal.dot(light).max(0.0);
        grey(0.28 + 0.5 * lit + 0.25 * lit.powi(24))
    };
    let point = |ring: usize, sector: usize| {
        let angle = std::f64::consts::TAU * sector as f64 / SECTORS as f64;
        ring as f64 / RINGS as f64 * DVec2::from_angle(angle)
    };
    for sector in 0..SECTORS {
        for ring in 0..RINGS {
            let corners =
                [point(ring, sector), point(ring, sector + 1), point(ring + 1, sector + 1), point(ring + 1, sector)];
            canvas.patch(corners.map(|p| centre + radius * p), corners.map(shade));
        }
        let rim = [point(RINGS, sector), point(RINGS, sector + 1)];
        canvas.round_line(rim.map(|p| centre + radius * p), 1.6 * unit, INK);
    }
}
