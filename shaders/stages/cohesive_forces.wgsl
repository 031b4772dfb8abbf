// Stage cohesive_forces: traction of every pair of copies; damage by opening, by the tip and by the shaft. One thread per
// pair; adds to the corner-force slots that its copies own for its axis, so nothing is scattered.
// Equations: src/effects/cohesive.rs and CpuEngine::cohesive_forces.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/corner_force
#import effects/cohesive
#ifdef PUNCTURE
#import shared/contact_node
#import effects/puncture
#import shared/tip_read
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;

// Way from one node to another, less what it was at rest.
fn way(nodes: vec2<u32>) -> vec3<f32> {
    return vec3<f32>(node_displacement[nodes.y].xyz - node_displacement[nodes.x].xyz) * DISPLACEMENT_UNIT;
}

@compute @workgroup_size(64)
fn cohesive_forces(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= cohesive.pair_count) {
        return;
    }
    let pair = face_pairs[index];
    var state = pair_states[index];
    let opening = way(pair.nodes.xy);
    let before = opening - (node_velocity[pair.nodes.y].xyz - node_velocity[pair.nodes.x].xyz) * params.dt;
    let n = normalize(cross(
        pair.first_way_and_area.xyz + way(pair.ring.xy),
        pair.second_way_and_start.xyz + way(pair.ring.zw),
    ));
    let normal_opening = dot(opening, n);
    let shear = opening - n * normal_opening;
    var damage = max(state.damage, opening_damage(normal_opening, length(shear)));
#ifdef PUNCTURE
    damage = max(damage, clamp((tip_state.coordinate - pair.second_way_and_start.w) * cohesive.inverse_ramp, 0.0, 1.0));
#ifdef BORE
    // The core tears off as a whole: no bond is left above its base.
    let above = pair.second_way_and_start.w < tip_state.coordinate;
    damage = max(damage, select(0.0, 1.0, above && core_tears(tip_state.coordinate, tip_state.gap)));
#endif
    // Where both copies lie on the full shaft the bond is gone.
    damage = max(damage, contact_records[pair.contacts.x].touch.w * contact_records[pair.contacts.y].touch.w);
#endif
    let k = cohesive.penalty * pair.first_way_and_area.w;
    // A closed face keeps the normal stiffness that damage takes, as far as the faces still meet.
    let closed = select(0.0, 1.0, normal_opening < 0.0);
    let across = normal_opening * dot(before, n);
    let met = torn_contact(across, dot(opening, before) - across);
    state.dissipation += k * (damage - state.damage) * (0.5 * dot(opening, before) - closed * met.stored);
    state.damage = damage;
    let contact = torn_contact(normal_opening * normal_opening, dot(shear, shear));
    let pull = n * (normal_opening * contact.normal) + shear * contact.slip;
    let force = k * (opening * (1.0 - damage) + pull * (closed * damage));
    state.stored = k * (0.5 * (1.0 - damage) * dot(opening, opening) + closed * damage * contact.stored);
    pair_states[index] = state;
    corner_force[pair.nodes.z] += vec4<f32>(force, 2.0 * k);
    corner_force[pair.nodes.w] += vec4<f32>(-force, 2.0 * k);
}
