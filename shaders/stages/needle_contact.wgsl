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
#ifdef FRICTION
#import effects/friction
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;

// Share of the tip springs that acts on a grid node, along the insertion direction [N]. The loop is empty for nodes
// that no anchor can reach.
fn tip_share(grid: vec3<u32>, rest_axial: f32) -> f32 {
    var force = 0.0;
    let near = abs(rest_axial - tip_state.coordinate) <= puncture.anchor_reach;
    for (var anchor = select(ANCHOR_COUNT, 0u, near); anchor < ANCHOR_COUNT; anchor++) {
        let cell = tip_anchor_loads[anchor].cell.xyz;
        let local = tip_anchor_loads[anchor].local.xyz;
        let weight = select(vec3<f32>(0.0), 1.0 - local, grid == cell)
            + select(vec3<f32>(0.0), local, grid == cell + 1u);
        force += tip_anchor_loads[anchor].force * weight.x * weight.y * weight.z;
    }
    return force;
}

@compute @workgroup_size(64)
fn needle_contact(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= arrayLength(&contact_nodes)) {
        return;
    }
    let contact = contact_nodes[index];
    let lever = contact.rest.xyz + vec3<f32>(node_displacement[contact.node].xyz) * DISPLACEMENT_UNIT
        - step_input.tip.xyz;
    let tip = step_input.direction.xyz * tip_share(contact.grid.xyz, contact.rest_axial);
    let d = -step_input.direction.xyz;
    let s = dot(lever, d);
    let passed = contact.pushed == 1u && contact.rest_axial < tip_state.coordinate && s > 0.0;
    var normal = vec3<f32>(0.0);
    var tangential = vec3<f32>(0.0);
    var stored = 0.0;
    // Loops that run once or not at all: software adapters skip them, where they would walk through an `if`.
    for (var once = select(1u, 0u, passed); once == 0u; once++) {
        var memory = contact_memory[index];
        if (memory.touching == 0.0) {
            memory.touching = 1.0;
            memory.overlap = max(0.0, opened_path(lever, d, s, contact.rest_radius, vec2<f32>(0.0)).value);
            memory.axial_on = s;
        }
        // An overlap found at activation fades over `entry_fade` of travel, so that the needle does that work.
        let travel = (s - memory.axial_on) / puncture.entry_fade;
        let fading = select(0.0, -memory.overlap / puncture.entry_fade, travel > 0.0 && travel < 1.0);
        let less = vec2<f32>(memory.overlap * clamp(1.0 - travel, 0.0, 1.0), fading);
        let overlap = opened_path(lever, d, s, contact.rest_radius, less);
        let depth = overlap.value;
        let steep = length(overlap.gradient);
        let n = overlap.gradient * (-1.0 / steep);
        let v = node_velocity[contact.node].xyz - step_input.velocity.xyz;
        let vn = dot(v, n);
        let k = puncture.contact_stiffness;
        let elastic = k * depth * steep;
        let damping = 2.0 * puncture.contact_damping * sqrt(k * contact.mass);
        let pressure = select(0.0, max(0.0, elastic - damping * vn), depth > 0.0);
        normal = n * pressure;
        stored = select(0.0, 0.5 * k * depth * depth, depth > 0.0);
        contact_sums[index].shaft +=
            select(0.0, dot(normal, step_input.direction.xyz) * params.dt, s >= puncture.tip_length);
        contact_sums[index].damping_dissipation +=
            select(0.0, (elastic - pressure) * vn * params.dt, depth > 0.0);
#ifdef FRICTION
        let kt = friction.stiffness_ratio * k;
        let grown = clamp((s - puncture.tip_length) / friction.fade_length, 0.0, 1.0);
        let allowed = friction.coefficient * grown * pressure / kt;
        let trial = stick_trial(memory.stick.xyz, (v - n * vn) * params.dt, n);
        let stretch = stick_return(trial, allowed);
        memory.stick = vec4<f32>(stretch, 0.0);
        tangential = stretch * -kt;
        contact_sums[index].sliding_dissipation += kt * dot(stretch, trial - stretch);
        stored += 0.5 * kt * dot(stretch, stretch);
#endif
        contact_memory[index] = memory;
    }
    let total = tip + normal + tangential;
    for (var once = select(1u, 0u, dot(total, total) > 0.0); once == 0u; once++) {
        corner_force[contact.slot] += vec4<f32>(total, 0.0);
        book_contact(index, tip, normal, tangential, lever);
    }
    contact_sums[index].stored = stored;
    // A node that the needle has left forgets.
    for (var once = select(0u, 1u, passed); once == 0u && contact_memory[index].touching != 0.0; once++) {
        contact_memory[index] = ContactMemory();
    }
}
