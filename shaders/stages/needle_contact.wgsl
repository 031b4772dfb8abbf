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
// Path, axis and surface of the needle: which of the files, by the scene.
#ifdef FREE_PATH
#import shared/free_touch
#else
#import shared/planned_touch
#endif
#ifdef FLEXIBLE_NEEDLE
#import shared/bent_axis
#else
#import shared/straight_axis
#endif
#ifdef SLIT
#import shared/slit_pressing
#else
#import shared/surface_pressing
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;

@compute @workgroup_size(64)
fn needle_contact(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= CONTACT_COUNT) {
        return;
    }
#ifdef OPENING
    // No node is pushed, and the tip reaches few: of the others nothing more is read. A loop, since software adapters walk through an `if`.
    let reached = abs(contact_nodes[index].sizes.y - tip_state.coordinate) <= puncture.anchor_reach;
    for (var once = select(1u, 0u, reached); once == 0u; once++) {
        advance_contact(index);
    }
#else
    advance_contact(index);
#endif
}

fn advance_contact(index: u32) {
    let contact = contact_at(index);
    let lever = contact.rest + vec3<f32>(node_displacement[contact.node].xyz) * DISPLACEMENT_UNIT
        - step_input.tip.xyz;
    let s = dot(lever, -step_input.direction.xyz);
    let axis = axis_at(s);
    let share = tip_share(contact);
    let tip = share.xyz;
    let touch = touch_at(index, contact, off_axis(axis, lever), s);
    let pressed = is_pressed(contact, touch);
    var normal = vec3<f32>(0.0);
    var tangential = vec3<f32>(0.0);
    var sums = StepSums();
    // Stiffness that contact and tip springs add at the node [N/m].
    var bound = 0.0;
    // Loops that run once or not at all: software adapters skip them, where they would walk through an `if`.
    for (var once = select(1u, 0u, pressed); once == 0u; once++) {
        var memory = remembered(index);
        let now = pressing(index, contact, touch, axis, lever, s, &memory, &sums);
        normal = now.normal;
        bound = now.bound;
        sums.damping_dissipation = damped(memory.damping, now.damping, now.v);
        memory.damping = now.damping;
#ifdef FRICTION
        let kt = friction.stiffness_ratio * now.stiffness;
        let allowed = surface_coefficient(contact, friction.coefficient) * now.rubbing / kt;
        let trial = stick_trial(memory.stick, (now.v - now.n * dot(now.v, now.n)) * params.dt, now.n);
        let stretch = stick_return(trial, allowed);
        sums.sliding_dissipation = 0.5 * kt * dot(memory.stick + stretch, trial - stretch);
        memory.stick = stretch;
        tangential = stretch * -kt;
        sums.stored += 0.5 * kt * dot(stretch, stretch);
#endif
        remember(index, memory);
    }
    bound += share.w * (puncture.tip_stiffness / f32(ANCHOR_COUNT));
    let total = tip + normal + tangential;
    sums.work += axis_power(axis, total) * params.dt;
    for (var once = select(1u, 0u, dot(total, total) > 0.0 || bound > 0.0); once == 0u; once++) {
        corner_force[contact.slot] += vec4<f32>(total, bound);
    }
    for (var once = select(1u, 0u, pressed || dot(total, total) > 0.0); once == 0u; once++) {
        book_contact(index, tip, normal, tangential, lever, sums);
    }
    // A node that the needle has left forgets.
    for (var once = select(0u, 1u, pressed); once == 0u && contact_records[index].touch.z != 0.0; once++) {
        remember(index, left_memory(index));
        // What its springs held goes with the contact.
        let booked = contact_records[index].energies;
        contact_records[index].energies = vec4<f32>(booked.x, booked.y, booked.z + booked.w, 0.0);
    }
}
