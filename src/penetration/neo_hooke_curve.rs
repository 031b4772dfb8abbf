//! The curve of the wedged crack for neo-Hooke and Mooney-Rivlin, which are one law in plane strain, `w = mu/2 (I - 3)`: a table, so that
//! the usual scene solves nothing. Beyond its smallest crack the exact limit holds: a hole of rest radius a/2.

use std::sync::LazyLock;

use super::slit_mesh::MeshSize;
use super::wedge_curve::{CurveEnd, WedgeCurve, WedgeOptions, WedgePoint};

/// How the table was made: cells of half the usual edge. Against 24 x 40 cells the tip force differs by 2e-5 or less.
pub fn options() -> WedgeOptions {
    let usual = WedgeOptions::default();
    WedgeOptions { mesh: MeshSize { radial: 18, along: 24, ..usual.mesh }, ..usual }
}

/// a/R, U/(mu R^2) and N/(mu R), by falling a/R. Written by
/// `cargo test --release --test physics -- --ignored --nocapture prints_the_table_of_neo_hooke`.
const POINTS: [[f64; 3]; 42] = [
    [4.00000000, 1.630832, 3.756914],
    [3.47503171, 1.703660, 3.952158],
    [3.01896135, 1.784312, 4.175610],
    [2.62274661, 1.874196, 4.425869],
    [2.27853191, 1.975049, 4.712414],
    [1.97949266, 2.088974, 5.040403],
    [1.71969995, 2.218441, 5.419579],
    [1.49400296, 2.366213, 5.854590],
    [1.29792692, 2.535344, 6.355051],
    [1.12758430, 2.728388, 6.919705],
    [0.97959780, 2.947678, 7.551703],
    [0.85103336, 3.195155, 8.256504],
    [0.73934198, 3.474021, 9.054466],
    [0.64230920, 3.790131, 9.972215],
    [0.55801121, 4.144476, 10.921736],
    [0.48477666, 4.527825, 11.862610],
    [0.42115357, 4.931894, 12.793468],
    [0.36588050, 5.350376, 13.714551],
    [0.31786159, 5.778603, 14.626942],
    [0.27614478, 6.213208, 15.532080],
    [0.23990296, 6.651834, 16.431443],
    [0.20841760, 7.092874, 17.326380],
    [0.18106444, 7.535270, 18.218026],
    [0.15730117, 7.978344, 19.107288],
    [0.13665664, 8.421686, 19.994858],
    [0.11872154, 8.865057, 20.881245],
    [0.10314028, 9.308328, 21.766820],
    [0.08960393, 9.751443, 22.651841],
    [0.07784413, 10.194385, 23.536491],
    [0.06762770, 10.637158, 24.420890],
    [0.05875210, 11.079779, 25.305119],
    [0.05104136, 11.522268, 26.189235],
    [0.04434258, 11.964646, 27.073278],
    [0.03852297, 12.406934, 27.957273],
    [0.03346714, 12.849147, 28.841228],
    [0.02907484, 13.291300, 29.725137],
    [0.02525900, 13.733402, 30.609002],
    [0.02194395, 14.175460, 31.492845],
    [0.01906398, 14.617484, 32.376679],
    [0.01656199, 15.059480, 33.260464],
    [0.01438836, 15.501441, 34.144091],
    [0.01250000, 15.943348, 35.027395],
];

/// The curve of the table, for mu = 1.
pub fn curve() -> &'static WedgeCurve {
    static CURVE: LazyLock<WedgeCurve> = LazyLock::new(|| {
        let point = |&[size, energy, normal_force]: &[f64; 3]| WedgePoint { size, energy, normal_force };
        WedgeCurve {
            points: POINTS.iter().map(point).collect(),
            end: CurveEnd::ToughnessReached,
            mu: 1.0,
            iterations: 0,
        }
    });
    &CURVE
}
