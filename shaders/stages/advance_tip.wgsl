// Stage advance_tip: springs between the tip plane and material anchors, threshold, advance of the tip coordinate a.
// One workgroup. Equations: src/effects/puncture.rs and CpuEngine::advance_tip.
#import shared/params
#import shared/step_input
#import shared/displacement
#import shared/grid_lines
#import effects/puncture

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

var<workgroup> gaps: array<f32, ANCHOR_COUNT>;
var<workgroup> stretches: array<f32, ANCHOR_COUNT>;
var<workgroup> losses: array<f32, ANCHOR_COUNT>;
var<workgroup> coordinate: f32;

struct AnchorPlace {
    cell: vec3<u32>,
    local: vec3<f32>,
    // Gap to the tip plane [m], >= 0, and d(x.t)/da.
    gap: f32,
    stretch: f32,
}

fn place_anchor(anchor: u32, a: f32) -> AnchorPlace {
    let t = step_input.direction.xyz;
    let X = tip_anchors[anchor].surface.xyz + t * a;
    let y0 = params.nodes_x;
    let z0 = params.nodes_x + params.nodes_y;
#ifdef BORE
    let cell = vec3<u32>(tip_anchors[anchor].column.xy, find_cell(X.z, z0, params.nodes_z));
#else
    let cell = vec3<u32>(
        find_cell(X.x, 0u, params.nodes_x),
        find_cell(X.y, y0, params.nodes_y),
        find_cell(X.z, z0, params.nodes_z),
    );
#endif
    let low = vec3<f32>(grid_lines[cell.x], grid_lines[y0 + cell.y], grid_lines[z0 + cell.z]);
    let high = vec3<f32>(grid_lines[cell.x + 1u], grid_lines[y0 + cell.y + 1u], grid_lines[z0 + cell.z + 1u]);
    let width = high - low;
    var local = clamp((X - low) / width, vec3<f32>(0.0), vec3<f32>(1.0));
#ifdef BORE
    local = vec3<f32>(tip_anchors[anchor].local.xy, local.z);
#endif
    let rate = t / width;
    var along = 0.0;
    var stretch = 1.0;
    for (var corner = 0u; corner < 8u; corner++) {
        let bit = vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let at = cell + bit;
        let node = (at.z * params.nodes_y + at.y) * params.nodes_x + at.x;
        let upper = bit == vec3<u32>(1u);
        let n = select(1.0 - local, local, upper);
        let d = select(-rate, rate, upper);
        let u = dot(vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT, t);
        along += n.x * n.y * n.z * u;
        stretch += (d.x * n.y * n.z + n.x * d.y * n.z + n.x * n.y * d.z) * u;
    }
    var place: AnchorPlace;
    place.cell = cell;
    place.local = local;
    place.gap = max(0.0, step_input.depth - a - along);
    place.stretch = stretch;
    return place;
}

@compute @workgroup_size(32)
fn advance_tip(@builtin(local_invocation_index) lane: u32) {
    let anchor = min(lane, ANCHOR_COUNT - 1u);
    let spring = puncture.tip_stiffness / f32(ANCHOR_COUNT);
    let before = tip_state.coordinate;
    var place = place_anchor(anchor, before);
    if (lane < ANCHOR_COUNT) {
        gaps[lane] = place.gap;
        stretches[lane] = place.stretch;
    }
    workgroupBarrier();
    if (lane == 0u) {
        var gap = 0.0;
        var stretch = 0.0;
        for (var i = 0u; i < ANCHOR_COUNT; i++) {
            gap += gaps[i];
            stretch += stretches[i];
        }
        let excess = spring * gap - tip_threshold(before);
        var advance = 0.0;
        if (excess > 0.0) {
            // At most 5 um in the first step and 13 um later, and four times the speed of the needle: a faster tip
            // would leave nodes inside the needle. A stab travels more than that in one step.
            let travel = length(step_input.velocity.xyz) * params.dt;
            let cap = min(max(select(13e-6, 5e-6, before == 0.0), 1.25 * travel), 4.0 * travel);
            let lambda = clamp(stretch / f32(ANCHOR_COUNT), 0.2, 3.0);
            advance = min(excess / (puncture.tip_stiffness * lambda), cap);
        }
        coordinate = before + advance;
    }
    workgroupBarrier();
    let after = coordinate;
    let old_gap = place.gap;
    place = place_anchor(anchor, after);
    if (lane < ANCHOR_COUNT) {
        gaps[lane] = 0.5 * spring * place.gap * place.gap;
        // Force after the advance times the loss of stretch (trapezoidal rule of the leapfrog work).
        losses[lane] = spring * place.gap * (old_gap - place.gap);
        tip_anchor_loads[lane].cell = vec4<u32>(place.cell, 0u);
        tip_anchor_loads[lane].local = vec4<f32>(place.local, 0.0);
        tip_anchor_loads[lane].force = spring * place.gap;
    }
    workgroupBarrier();
    if (lane == 0u) {
        var stored = 0.0;
        var lost = 0.0;
        for (var i = 0u; i < ANCHOR_COUNT; i++) {
            stored += gaps[i];
            lost += losses[i];
        }
        tip_state.coordinate = after;
        tip_state.spring_energy = stored;
        tip_state.dissipation += select(0.0, lost, after > before);
    }
}
