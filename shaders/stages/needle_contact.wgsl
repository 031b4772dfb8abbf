// Stage needle_contact: nodes around the opened path are kept outside the needle, the shaft rubs, the tip pushes.
// One thread per contact node; adds to the corner-force slot that this node owns, so nothing is scattered.
// Equations: src/effects/puncture.rs and CpuEngine::needle_contact.
#import shared/params
#import shared/thread_index
#import shared/step_input
#import shared/displacement
#import shared/corner_force
#import shared/contact_node
#import effects/puncture
#import shared/tip_read
#ifdef FRICTION
#import effects/friction
#endif
#ifdef SLIT
#import shared/slit_contact
#endif
#ifdef FLEXIBLE_NEEDLE
#import effects/flexible_needle
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;

#ifdef FREE_PATH
// Share of the tip springs that acts on a grid node [N], and of how many springs; nothing for nodes that no anchor can reach.
fn tip_share(grid: vec3<u32>, rest: vec3<f32>) -> vec4<f32> {
    var share = vec4<f32>(0.0);
    let away = rest - free_tip.place.xyz;
    let near = free_tip.inside == 1.0 && dot(away, away) <= puncture.anchor_reach * puncture.anchor_reach;
    for (var anchor = select(ANCHOR_COUNT, 0u, near); anchor < ANCHOR_COUNT; anchor++) {
        let cell = tip_anchor_loads[anchor].cell.xyz;
        let local = tip_anchor_loads[anchor].local.xyz;
        let weight = select(vec3<f32>(0.0), 1.0 - local, grid == cell)
            + select(vec3<f32>(0.0), local, grid == cell + 1u);
        let axial = step_input.direction.xyz * tip_anchor_loads[anchor].force;
        share += vec4<f32>(axial + free_tip.sway.xyz, 1.0) * (weight.x * weight.y * weight.z);
    }
    return share;
}

struct FreeContact {
    // Whether the node is to be kept out of the needle, its r0 [m], the weight of its contact stiffness, and the front end of
    // what it touches [m].
    touches: bool,
    rest_radius: f32,
    weight: f32,
    end: f32,
    // Part of that stiffness that counts in the step: it grows steadily towards the shaft, for a mass that jumped at a distance
    // would pump energy into a node that swings there.
    nearness: f32,
}

// Brings what node `index` knows of the tip to this step.
fn free_contact(index: u32, rest: vec3<f32>, lever: vec3<f32>, s: f32) -> FreeContact {
    let T = free_tip.along.xyz;
    let relative = rest - free_tip.place.xyz;
    let ahead = dot(relative, T);
    let radius = length(relative - T * ahead);
    let ring = puncture.ring_radius;
    let known = contact_records[index].path;
    let old = known.x == 1.0;
    // The dimple before the puncture is no opened path.
    let passes = free_tip.coordinate > 0.0 && ahead <= 0.0 && ahead > -ring && radius < ring;
    let passed = free_tip.inside == 1.0 && s > -PASSED_MARGIN && (old || passes);
    var rest_radius = known.y;
    for (var once = select(1u, 0u, passed != old); once == 0u; once++) {
        var fresh = Memory();
        fresh.passed = select(0.0, 1.0, passed);
        fresh.rest_radius = select(0.0, radius, passed);
        rest_radius = fresh.rest_radius;
        remember(index, fresh);
    }
    // The shaft alone: a node just before the tip is not passed yet, and is no obstacle to the cone.
    let reach = WATCHED * puncture.needle_radius;
    let square = dot(lever, lever) - s * s;
    let met = free_tip.inside == 1.0 && !passed && s > puncture.tip_length && square < reach * reach;
    let in_ring = passed && s > 0.0 && rest_radius > puncture.softened_radius;
    let weight = select(ring_weight(rest_radius), 1.0, met);
    let beside = (reach - sqrt(max(square, 0.0))) / (reach - puncture.needle_radius);
    let behind = (s - puncture.tip_length) / (END_FADE * puncture.tip_length);
    let nearness = select(1.0, clamp(beside, 0.0, 1.0) * clamp(behind, 0.0, 1.0), met);
    return FreeContact(met || in_ring, rest_radius, weight, select(0.0, puncture.tip_length, met), nearness);
}
#else
// Share of the tip springs that acts on a grid node, along the insertion direction [N], and of how many stretched springs.
// The loop is empty for nodes that no anchor can reach.
fn tip_share(grid: vec3<u32>, rest_axial: f32) -> vec2<f32> {
    var share = vec2<f32>(0.0);
    let near = abs(rest_axial - tip_state.coordinate) <= puncture.anchor_reach;
    for (var anchor = select(ANCHOR_COUNT, 0u, near); anchor < ANCHOR_COUNT; anchor++) {
        let cell = tip_anchor_loads[anchor].cell.xyz;
        let local = tip_anchor_loads[anchor].local.xyz;
        let weight = select(vec3<f32>(0.0), 1.0 - local, grid == cell)
            + select(vec3<f32>(0.0), local, grid == cell + 1u);
        let force = tip_anchor_loads[anchor].force;
        share += vec2<f32>(force, select(0.0, 1.0, force != 0.0)) * (weight.x * weight.y * weight.z);
    }
    return share;
}
#endif

// How deep the node lies in the needle; `less`: what fades out after the entry.
fn overlap_of(
    surface: vec4<f32>,
    rest_radius: f32,
    lever: vec3<f32>,
    d: vec3<f32>,
    s: f32,
    less: vec2<f32>,
) -> Overlap {
#ifdef BORE
    return tube_wall(lever, d, s, surface.w, less);
#else
    return opened_path(lever, d, s, rest_radius, less);
#endif
}

@compute @workgroup_size(64)
fn needle_contact(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= CONTACT_COUNT) {
        return;
    }
    let contact = contact_at(index);
    let lever = contact.rest + vec3<f32>(node_displacement[contact.node].xyz) * DISPLACEMENT_UNIT
        - step_input.tip.xyz;
    let d = -step_input.direction.xyz;
    let s = dot(lever, d);
#ifdef FLEXIBLE_NEEDLE
    let bend = bend_at(s);
    let from_axis = lever - bend.offset;
    let needle_velocity = step_input.velocity.xyz + bend.rate;
#else
    let from_axis = lever;
    let needle_velocity = step_input.velocity.xyz;
#endif
#ifdef FREE_PATH
    let share = tip_share(contact.grid, contact.rest);
    let tip = share.xyz;
    let springs = share.w;
    let met = free_contact(index, contact.rest, from_axis, s);
    let passed = met.touches;
    let rest_radius = met.rest_radius;
#else
    let share = tip_share(contact.grid, contact.rest_axial);
    let tip = step_input.direction.xyz * share.x;
    let springs = share.y;
    var passed = contact.pushed == 1u && contact.rest_axial < tip_state.coordinate && s > 0.0;
#ifdef SLIT
    // Its faces may touch where the node does not.
    passed = contact.faces != 0u;
#endif
    let rest_radius = contact.rest_radius;
#endif
    var normal = vec3<f32>(0.0);
    var tangential = vec3<f32>(0.0);
    var sums = StepSums();
    // Stiffness that contact and tip springs add at the node [N/m].
    var bound = 0.0;
    // Loops that run once or not at all: software adapters skip them, where they would walk through an `if`.
    for (var once = select(1u, 0u, passed); once == 0u; once++) {
        var memory = remembered(index);
        var v = node_velocity[contact.node].xyz - needle_velocity;
#ifdef SLIT
        let points = slit_force(index);
        normal = points.normal;
        bound = points.bound;
        sums.stored = points.stored;
        sums.angular_impulse = (points.torque - cross(lever, normal)) * params.dt;
        sums.shaft = dot(points.on_shaft, step_input.direction.xyz) * params.dt;
        let damping_force = points.damping;
#ifdef FLEXIBLE_NEEDLE
        sums.work = (points.bend_power - dot(normal, bend.rate)) * params.dt;
#endif
        let pressing = length(normal);
        let n = normal * select(0.0, 1.0 / pressing, pressing > 0.0);
        let vn = dot(v, n);
        let k = puncture.face_stiffness * contact.share;
        let rubbing = points.rubbing;
        memory.touching = select(0.0, 1.0, pressing > 0.0);
        memory.on_shaft = select(0.0, 1.0, dot(points.on_shaft, points.on_shaft) > 0.0 && s >= puncture.tip_length);
#else
        if (memory.touching == 0.0) {
            memory.touching = 1.0;
            memory.overlap = max(0.0, overlap_of(contact.surface, rest_radius, from_axis, d, s, vec2<f32>(0.0)).value);
            memory.axial_on = s;
        }
        // An overlap found at activation fades over `entry_fade` of travel, so that the needle does that work.
        let travel = (s - memory.axial_on) / puncture.entry_fade;
        let fading = select(0.0, -memory.overlap / puncture.entry_fade, travel > 0.0 && travel < 1.0);
        let less = vec2<f32>(memory.overlap * clamp(1.0 - travel, 0.0, 1.0), fading);
        var overlap = overlap_of(contact.surface, rest_radius, from_axis, d, s, less);
#ifdef FREE_PATH
        overlap = faded_at_end(overlap, d, s, met.end);
#endif
#ifdef FLEXIBLE_NEEDLE
        overlap.gradient -= d * dot(overlap.gradient, bend.slope);
#endif
        let depth = overlap.value;
        let steep = length(overlap.gradient);
        let n = overlap.gradient * (-1.0 / steep);
#ifdef FREE_PATH
        v -= cross(angular_velocity(), lever);
#endif
        let vn = dot(v, n);
#ifdef BORE
        // Only the walls of the tube are pushed.
        let k = puncture.contact_stiffness;
#else
#ifdef FREE_PATH
        let k = puncture.ring_stiffness * contact.share * met.weight;
#else
        let k = puncture.ring_stiffness * contact.share * ring_weight(rest_radius);
#endif
#endif
        let elastic = k * depth * steep;
        let damping = 2.0 * puncture.contact_damping * sqrt(k * contact.mass);
        let pressure = select(0.0, max(0.0, elastic - damping * vn), depth > 0.0);
        normal = n * pressure;
        sums.stored = select(0.0, 0.5 * k * depth * depth, depth > 0.0);
        sums.shaft = select(0.0, dot(normal, step_input.direction.xyz) * params.dt, s >= puncture.tip_length);
        let damping_force = select(vec3<f32>(0.0), n * (pressure - elastic), depth > 0.0);
        // Whether it touches or not: a mass that came and went with the contact would make the node chatter.
        bound = 2.0 * k * steep * steep;
#ifdef FREE_PATH
        bound *= met.nearness;
#endif
#ifdef COHESIVE
        memory.on_shaft = select(0.0, 1.0, depth > 0.0 && s >= puncture.tip_length);
#endif
#ifdef FRICTION
        let rubbing = pressure * clamp((s - puncture.tip_length) / friction.fade_length, 0.0, 1.0);
#endif
#endif
        sums.damping_dissipation = damped(memory.damping, damping_force, v);
        memory.damping = damping_force;
#ifdef FRICTION
        let kt = friction.stiffness_ratio * k;
        var coefficient = friction.coefficient;
#ifdef BORE
        coefficient = select(puncture.bore_grip, coefficient, contact.surface.w > 0.0);
#endif
        let allowed = coefficient * rubbing / kt;
        let trial = stick_trial(memory.stick, (v - n * vn) * params.dt, n);
        let stretch = stick_return(trial, allowed);
        sums.sliding_dissipation = 0.5 * kt * dot(memory.stick + stretch, trial - stretch);
        memory.stick = stretch;
        tangential = stretch * -kt;
        sums.stored += 0.5 * kt * dot(stretch, stretch);
#endif
        remember(index, memory);
    }
    bound += springs * (puncture.tip_stiffness / f32(ANCHOR_COUNT));
    let total = tip + normal + tangential;
#ifdef FLEXIBLE_NEEDLE
    sums.work += dot(total, bend.rate) * params.dt;
#endif
    for (var once = select(1u, 0u, dot(total, total) > 0.0 || bound > 0.0); once == 0u; once++) {
        corner_force[contact.slot] += vec4<f32>(total, bound);
    }
    for (var once = select(1u, 0u, passed || dot(total, total) > 0.0); once == 0u; once++) {
        book_contact(index, tip, normal, tangential, lever, sums);
    }
    // A node that the needle has left forgets.
    for (var once = select(0u, 1u, passed); once == 0u && contact_records[index].touch.z != 0.0; once++) {
        var left = Memory();
#ifdef FREE_PATH
        left.passed = contact_records[index].path.x;
        left.rest_radius = contact_records[index].path.y;
#endif
        remember(index, left);
        // What its springs held goes with the contact.
        let booked = contact_records[index].energies;
        contact_records[index].energies = vec4<f32>(booked.x, booked.y, booked.z + booked.w, 0.0);
    }
}
