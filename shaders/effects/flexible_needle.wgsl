// Flexible needle: centre-line of the bent needle during one display frame. Equations: src/effects/flexible_needle.rs.
struct CentreLine {
    // Entries per length behind the tip [1/m]; the first one is the tip.
    per_length: f32,
    // Step at which the frame begins.
    first_step: u32,
    _pad0: u32,
    _pad1: u32,
    // Lateral offset from the straight axis at the beginning of the frame [m], w unused.
    offset: array<vec4<f32>, 32>,
    // Rate during the frame [m/s], w unused.
    rate: array<vec4<f32>, 32>,
}

@group(0) @binding(13) var<uniform> centre_line: CentreLine;

const LAST_ENTRY: f32 = 31.0;

// The centre-line at one place and time: offset [m], its derivative by s, its rate [m/s].
struct Bend {
    offset: vec3<f32>,
    slope: vec3<f32>,
    rate: vec3<f32>,
}

// Place in the table of the distance `s` behind the tip.
fn centre_line_entry(s: f32) -> f32 {
    return clamp(s * centre_line.per_length, 0.0, LAST_ENTRY);
}

fn bend_at(s: f32) -> Bend {
    let at = centre_line_entry(s);
    let entry = min(u32(at), 30u);
    let part = at - f32(entry);
    let time = f32(step_input.step - centre_line.first_step) * params.dt;
    let rate0 = centre_line.rate[entry].xyz;
    let rate1 = centre_line.rate[entry + 1u].xyz;
    let here = centre_line.offset[entry].xyz + rate0 * time;
    let there = centre_line.offset[entry + 1u].xyz + rate1 * time;
    return Bend(mix(here, there, part), (there - here) * centre_line.per_length, mix(rate0, rate1, part));
}
