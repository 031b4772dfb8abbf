//! Outline of the indenter of [`super`]: a cone with a sharp apex and a cylinder of radius 1, with a
//! rounded shoulder between them so that the surface can slide over it node by node.

/// Largest distance between the rounded shoulder and the corner it replaces [R].
const SHOULDER_CUT: f64 = 0.02;

/// Gap between a point and the indenter.
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// Distance from the outline, positive outside [R].
    pub value: f64,
    /// Gradient (r, z).
    pub normal: [f64; 2],
    /// Second derivative across the normal [1/R].
    pub curvature: f64,
}

/// Outline of the indenter.
#[derive(Clone, Copy, Debug)]
pub struct Outline {
    sin: f64,
    cos: f64,
    /// Radius of the rounded shoulder [R].
    shoulder: f64,
    /// Height of the centre of the shoulder's arc above the apex [R].
    height: f64,
}

impl Outline {
    /// Outline for the angle between axis and flank [rad].
    pub fn new(half_angle: f64) -> Self {
        let (sin, cos) = half_angle.sin_cos();
        let shoulder = SHOULDER_CUT / (1.0 / (0.5 * half_angle).cos() - 1.0);
        Self { sin, cos, shoulder, height: ((1.0 - shoulder) * cos + shoulder) / sin }
    }

    /// Distance from the outline of a point at radius `r` and height `h` above the apex.
    pub fn gap(&self, r: f64, h: f64) -> Gap {
        let v = [r - 1.0 + self.shoulder, h - self.height];
        if v[1] > 0.0 {
            return Gap { value: r - 1.0, normal: [1.0, 0.0], curvature: 0.0 };
        }
        if v[0] * self.sin + v[1] * self.cos <= 0.0 {
            return Gap { value: r * self.cos - h * self.sin, normal: [self.cos, -self.sin], curvature: 0.0 };
        }
        let distance = v[0].hypot(v[1]).max(1e-9);
        Gap { value: distance - self.shoulder, normal: [v[0] / distance, v[1] / distance], curvature: 1.0 / distance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outline_is_smooth_and_close_to_cone_and_cylinder() {
        for degrees in [10.0_f64, 18.0, 45.0, 80.0] {
            let angle = degrees.to_radians();
            let outline = Outline::new(angle);
            let length = 1.0 / angle.tan();
            assert!(outline.gap(0.1 * angle.tan() * length, 0.1 * length).value.abs() < 1e-12);
            assert!((outline.gap(1.3, 3.0 * length).value - 0.3).abs() < 1e-12);
            assert!((outline.gap(1.0, length).value - SHOULDER_CUT).abs() < 1e-9);
            let mut before = outline.gap(1.05, 0.5 * length);
            for k in 1..=2000 {
                let now = outline.gap(1.05, length * (0.5 + 5e-4 * k as f64));
                let h = 5e-4 * length;
                assert!(
                    (now.value - before.value - 0.5 * h * (now.normal[1] + before.normal[1])).abs()
                        < 1e-4 * h.max(1e-3)
                );
                before = now;
            }
        }
    }
}
