// How far the middle of a section of the path lies beside the axis of the needle, and what is left of its opening there.
// Equations: OpeningPlan::left_beside.
#import effects/opening
#ifdef LAID
#import shared/swing
#endif
#ifdef FLEXIBLE_NEEDLE
#import shared/bent_axis
#else
#import shared/straight_axis
#endif

// A section this many radii, times the root of two, beside the axis is open by half.
const LEAVES: f32 = 1.75;

struct BesideNeedle {
    axis: Axis,
    // From the tip across the needle, and from the axis [m].
    lever: vec3<f32>,
    offset: vec3<f32>,
    // By which the axis of a bevel lies aside, per rc of the needle there.
    shift: vec3<f32>,
}

// `centre`, `behind` and `full` as in OpeningStation; `opened`: rc over the radius of the needle.
fn beside_needle(centre: vec3<f32>, behind: f32, full: f32, opened: f32) -> BesideNeedle {
    let axis = axis_at(behind);
    let lever = across(opening.entry.xyz + centre - step_input.tip.xyz);
    var shift = opening.surface.yzw / opened;
#ifdef LAID
    shift = swing(puncture.reference.xyz, needle_direction(), shift);
#endif
    return BesideNeedle(axis, lever, off_axis(axis, lever) - shift * full, shift);
}

// Part that is left of the opening, and its rate with the square of the distance [1/m^2].
fn left_beside(offset: vec3<f32>) -> vec2<f32> {
    let unit = LEAVES * opening.direction.w;
    let by = offset / unit;
    let x = 0.5 * dot(by, by);
    let left = 1.0 / (1.0 + x * x);
    return vec2<f32>(left, -x * left * left / (unit * unit));
}

// Bound of the second derivative of that part by the distance [1/m^2].
fn leaving_curvature() -> f32 {
    let unit = LEAVES * opening.direction.w;
    return 1.2 / (unit * unit);
}
