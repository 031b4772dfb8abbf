// Where tissue beside a needle is seen whose path is opened: the map of src/needle/opening.rs, for a path whose middle is on the axis of the
// needle. For what is drawn; forces have the sections of the path.
struct DrawnNeedle {
    // Tip [m]; w: radius R of the shaft [m], 0 where nothing is open.
    tip: vec4<f32>,
    // Direction of the insertion; w: length of the tip [m].
    direction: vec4<f32>,
    // x: radius of the hole over that of the needle; y: entries of `bend` per length behind the tip [1/m]; the others unused.
    opened: vec4<f32>,
    // Where the middle of a section lies aside of the axis for its bevel, over its radius.
    bevel: vec4<f32>,
    // Middle of the box around a mesh of tetrahedra, from which its nodes are told [m].
    middle: vec4<f32>,
    // How the axis bends, from the tip on [m].
    bend: array<vec4<f32>, 32>,
}

// Where a place lies beside the axis, xyz [m], and the radius rc of the hole there, w [m].
fn beside_axis(needle: DrawnNeedle, y: vec3<f32>) -> vec4<f32> {
    let from_tip = y - needle.tip.xyz;
    let behind = -dot(from_tip, needle.direction.xyz);
    let radius = needle.tip.w * clamp(behind / max(needle.direction.w, 1e-9), 0.0, 1.0);
    let along = clamp(behind * needle.opened.y, 0.0, 31.0);
    let entry = min(u32(along), 30u);
    let bend = mix(needle.bend[entry].xyz, needle.bend[entry + 1u].xyz, along - f32(entry));
    let aside = from_tip + needle.direction.xyz * behind - bend - needle.bevel.xyz * radius;
    return vec4<f32>(aside, radius * needle.opened.x);
}

// By how much the needle pushes a place aside [m]; `beside`: of beside_axis. Exact up to two radii, nothing beyond four.
fn pushed_aside(needle: DrawnNeedle, beside: vec4<f32>) -> vec3<f32> {
    let shaft = max(needle.tip.w, 1e-9);
    let square = dot(beside.xyz, beside.xyz);
    let x = clamp(0.5 * sqrt(square) / shaft - 1.0, 0.0, 1.0);
    let left = 1.0 - x * x * x * (10.0 - x * (15.0 - 6.0 * x));
    let least = 1e-3 * shaft;
    return beside.xyz * (sqrt(1.0 + beside.w * beside.w * left / (square + least * least)) - 1.0);
}

// F - I of a cell that the path runs through, by the map at its middle; `beside`: of beside_axis there.
fn strain_on_path(needle: DrawnNeedle, H: mat3x3<f32>, beside: vec4<f32>) -> mat3x3<f32> {
    var out = H;
    if (beside.w > 0.0) {
        let distance = length(beside.xyz);
        let away = beside.xyz / max(distance, 1e-9);
        let rho = max(distance, 0.5 * needle.tip.w);
        let g = sqrt(1.0 + beside.w * beside.w / (rho * rho));
        let t = needle.direction.xyz;
        for (var a = 0u; a < 3u; a++) {
            var column = H[a];
            column[a] += 1.0;
            out[a] += (column - t * dot(t, column)) * (g - 1.0) + away * (dot(away, column) * (1.0 / g - g));
        }
    }
    return out;
}
