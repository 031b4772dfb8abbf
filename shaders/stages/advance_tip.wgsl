// Stage advance_tip: springs between the tip plane and material anchors, threshold, advance of the tip coordinate a.
// One workgroup. Equations: src/effects/puncture.rs and CpuEngine::advance_tip.
#import shared/params
#import shared/step_input
#import shared/displacement
#ifndef TETRAHEDRA
#import shared/grid_lines
#endif
#import effects/puncture
#import shared/tip_written
#ifdef ADHESION
#import effects/adhesion
#endif
#ifdef OPENING
#import shared/tip_contact
#import shared/path_sections
@group(3) @binding(23) var<storage, read> opening_record: OpeningRecord;
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

var<workgroup> gaps: array<f32, ANCHOR_COUNT>;
var<workgroup> stretches: array<f32, ANCHOR_COUNT>;
var<workgroup> losses: array<f32, ANCHOR_COUNT>;
var<workgroup> distances: array<f32, ANCHOR_COUNT>;
var<workgroup> coordinate: f32;
#ifdef OPENING
#ifdef WIDE
const LANES: u32 = 256u;
#else
const LANES: u32 = 64u;
#endif
// On all anchors alike; their mean distance and stretch before the advance [m], [-].
var<workgroup> mean_before: f32;
var<workgroup> stretch_before: f32;
var<workgroup> touch: SurfaceTouch;
#else
const LANES: u32 = 32u;
#endif
// Force of tissue that holds on to the tip [N] and the energy stored in it [J].
var<workgroup> bond_force: f32;
var<workgroup> bond_energy: f32;

#ifdef TETRAHEDRA
#import shared/tetrahedron_anchor
#else
struct AnchorPlace {
    cell: vec3<u32>,
    local: vec3<f32>,
    // Distance of the tip plane beyond it, and its positive part inside the material [m]; d(x.t)/da.
    distance: f32,
    gap: f32,
    stretch: f32,
}

// Where the anchor was when it was last looked for.
var<private> near_cell: vec3<u32>;

fn place_anchor(anchor: u32, a: f32) -> AnchorPlace {
    let t = step_input.direction.xyz;
#ifdef LAID
    // The needle may be turned against its path.
    let T = opening.direction.xyz;
    let along_needle = dot(T, t);
#else
    let T = t;
    let along_needle = 1.0;
#endif
    let X = tip_anchors[anchor].surface.xyz + T * a;
    let y0 = NODES_X;
    let z0 = NODES_X + NODES_Y;
#ifdef BORE
    let cell = vec3<u32>(tip_anchors[anchor].column.xy, find_cell_near(X.z, z0, NODES_Z, near_cell.z));
#else
    let cell = vec3<u32>(
        find_cell_near(X.x, 0u, NODES_X, near_cell.x),
        find_cell_near(X.y, y0, NODES_Y, near_cell.y),
        find_cell_near(X.z, z0, NODES_Z, near_cell.z),
    );
#endif
    near_cell = cell;
    let low = vec3<f32>(grid_lines[cell.x], grid_lines[y0 + cell.y], grid_lines[z0 + cell.z]);
    let high = vec3<f32>(grid_lines[cell.x + 1u], grid_lines[y0 + cell.y + 1u], grid_lines[z0 + cell.z + 1u]);
    let width = high - low;
    var local = clamp((X - low) / width, vec3<f32>(0.0), vec3<f32>(1.0));
#ifdef BORE
    local = vec3<f32>(tip_anchors[anchor].local.xy, local.z);
#endif
    let rate = T / width;
    var along = 0.0;
    var stretch = along_needle;
    for (var corner = 0u; corner < 8u; corner++) {
        let bit = vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let at = cell + bit;
        let node = (at.z * NODES_Y + at.y) * NODES_X + at.x;
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
    place.distance = step_input.depth - a * along_needle - along;
    place.gap = select(0.0, max(0.0, place.distance), a < puncture.exit);
    place.stretch = stretch;
    return place;
}
#endif

@compute @workgroup_size(LANES)
fn advance_tip(@builtin(local_invocation_index) lane: u32) {
    let anchor = min(lane, ANCHOR_COUNT - 1u);
    let spring = puncture.tip_stiffness / f32(ANCHOR_COUNT);
    let before = tip_state.coordinate;
    let speed = length(step_input.velocity.xyz);
    var resistance = 0.0;
#ifdef OPENING
    // The tissue that the tip opens as it advances is strained at once.
    resistance = opening_record.now.x;
    let spreading = Spreading(opening_record.now.z, opening_record.now.w, dimple_part(before) * tip_state.dimple);
#endif
    var threshold = tip_threshold(before, speed) + resistance;
#ifndef TETRAHEDRA
    near_cell = tip_anchor_loads[anchor].cell.xyz;
#endif
    var place = place_anchor(anchor, before);
    if (lane < ANCHOR_COUNT) {
        gaps[lane] = place.gap;
        stretches[lane] = place.stretch;
        distances[lane] = place.distance;
    }
    workgroupBarrier();
    var capped = false;
    if (lane == 0u) {
        var gap = 0.0;
        var stretch = 0.0;
        var distance = 0.0;
        var stretched = 0.0;
        for (var i = 0u; i < ANCHOR_COUNT; i++) {
            gap += gaps[i];
            stretched += select(0.0, 1.0, gaps[i] > 0.0);
            stretch += stretches[i];
            distance += distances[i];
        }
#ifdef OPENING
        let part = dimple_part(before);
        mean_before = distance / f32(ANCHOR_COUNT);
        stretch_before = stretch / f32(ANCHOR_COUNT);
        touch = surface_touch(select(0.0, mean_before, before < puncture.exit), part, spreading);
        threshold += dimple_closing(before) * touch.dimple * spreading.force;
        let excess = touch.force - threshold;
#else
        let excess = spring * gap - threshold;
#endif
        var advance = 0.0;
        if (excess > 0.0) {
            let lambda = clamp(stretch / f32(ANCHOR_COUNT), LEAST_STRETCH, MOST_STRETCH);
#ifdef OPENING
            let stretch_of_path = segment_at(before);
            let cap = max(opening.advances[stretch_of_path / 4u][stretch_of_path % 4u], LEAST_TRAVELS * speed * params.dt);
            let long = surface_gap(touch.force, part, spreading) - surface_gap(threshold, part, spreading);
            let closing = dimple_closing(before) * touch.dimple;
            advance = min(max(long, 0.0) / max(lambda - closing, LEAST_STRETCH), cap);
#else
            let cap = advance_limit(before == 0.0, speed * params.dt);
            // Springs that are not stretched have no force to lose.
            let tip_stiffness = puncture.tip_stiffness * (stretched / f32(ANCHOR_COUNT));
            advance = min(excess / (tip_stiffness * lambda), cap);
#endif
            capped = advance == cap;
        }
        coordinate = before + advance;
        bond_force = 0.0;
        bond_energy = 0.0;
#ifdef ADHESION
        let law = adhesion;
        // A tip outside the material, or drawn back by more than D, has no bond.
        let mean = distance / f32(ANCHOR_COUNT);
        let old = tip_state.bond_stretch;
        let motion = mean - tip_state.gap;
        let inside = before > 0.0 && before < puncture.exit && mean > -law.sliding_distance;
        let bond = select(vec2<f32>(0.0), advance_adhesion(law, old, tip_state.bond_slid, motion), inside);
        tip_state.bond_stretch = bond.x;
        tip_state.bond_slid = bond.y;
        bond_force = law.stiffness * bond.x;
        bond_energy = 0.5 * law.stiffness * bond.x * bond.x;
        // Mean force of both steps times the slip.
        tip_state.bond_dissipation += 0.5 * law.stiffness * (old + bond.x) * (old + motion - bond.x);
        tip_state.bond_impulse += bond_force * params.dt;
#endif
    }
    workgroupBarrier();
    let after = coordinate;
    let old = place;
    place = place_anchor(anchor, after);
#ifdef OPENING
    if (lane < ANCHOR_COUNT) {
        distances[lane] = place.distance;
    }
    workgroupBarrier();
    if (lane == 0u) {
        var distance = 0.0;
        for (var i = 0u; i < ANCHOR_COUNT; i++) {
            distance += distances[i];
        }
        touch = surface_touch(select(0.0, distance / f32(ANCHOR_COUNT), after < puncture.exit), dimple_part(after), spreading);
    }
    workgroupBarrier();
#endif
    if (lane < ANCHOR_COUNT) {
#ifdef OPENING
        let force = touch.force / f32(ANCHOR_COUNT);
        stretches[lane] = place.stretch;
#else
        let force = spring * place.gap;
        // Force after the advance times the loss of stretch (trapezoidal rule of the leapfrog work).
        losses[lane] = force * (old.gap - place.gap);
#endif
        gaps[lane] = place.gap;
        distances[lane] = place.distance;
#ifdef TETRAHEDRA
        tip_anchor_loads[lane].cell = place.cell;
#else
        tip_anchor_loads[lane].cell = vec4<u32>(place.cell, 0u);
#endif
        tip_anchor_loads[lane].load = vec4<f32>(place.local, force + bond_force / f32(ANCHOR_COUNT));
    }
    workgroupBarrier();
    if (lane == 0u) {
        var stored = bond_energy;
        var lost = 0.0;
        var force = 0.0;
        var distance = 0.0;
        for (var i = 0u; i < ANCHOR_COUNT; i++) {
            stored += 0.5 * spring * gaps[i] * gaps[i];
            lost += losses[i];
            force += spring * gaps[i];
            distance += distances[i];
        }
#ifdef OPENING
        var stretch = 0.0;
        for (var i = 0u; i < ANCHOR_COUNT; i++) {
            stretch += stretches[i];
        }
        // Mean force of both steps times the way, less what is held now; the new force works where the tip has come to.
        let way = mean_before - tip_state.gap;
        let stretched = (after - before) * (stretch_before - tip_state.touch_stretch);
        let held = touch_energy(touch);
        let was = SurfaceTouch(tip_state.touch_force, tip_state.dimple);
        let shifted = dimple_part(after) * touch.dimple - dimple_part(before) * was.dimple;
        lost = 0.5 * (was.force * way + touch.force * (way - stretched)) + spreading.force * shifted
            - (held - touch_energy(was));
        tip_state.touch_stretch = stretch / f32(ANCHOR_COUNT);
        stored = bond_energy + held;
        force = touch.force;
        tip_state.touch_force = touch.force;
        tip_state.advanced = after - before;
        tip_state.shifted = select(0.0, shifted, after > before);
        tip_state.dimple = touch.dimple;
#endif
        tip_state.coordinate = after;
        tip_state.spring_energy = stored;
        tip_state.gap = distance / f32(ANCHOR_COUNT);
        let lost_now = select(0.0, lost, after > before);
        let beyond = lost_now * select(0.0, share_beyond(force, threshold), capped);
        tip_state.dissipation += lost_now - beyond - resistance * (after - before);
        tip_state.cap_dissipation += beyond;
        tip_state.membrane_impulse += force * membrane_share(after) * params.dt;
    }
#ifdef OPENING
    place_sections(lane, after, dimple_part(after) * touch.dimple);
#endif
}
