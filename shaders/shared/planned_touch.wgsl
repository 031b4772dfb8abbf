// How the needle on a planned path meets a contact node. The same functions as in shared/free_touch.
#import shared/contact_node
#import effects/puncture
#import shared/tip_read

struct PlannedTouch {
    // Whether the node is to be kept out of the needle, and its r0 [m].
    touches: bool,
    rest_radius: f32,
}

alias Touch = PlannedTouch;

// Share of the tip springs that acts on a grid node [N]; w: of how many stretched springs. The loop is empty for nodes that no
// anchor can reach.
fn tip_share(contact: Contact) -> vec4<f32> {
    var share = vec2<f32>(0.0);
    let near = abs(contact.rest_axial - tip_state.coordinate) <= puncture.anchor_reach;
    for (var anchor = select(ANCHOR_COUNT, 0u, near); anchor < ANCHOR_COUNT; anchor++) {
#ifdef TETRAHEDRA
        let nodes = tip_anchor_loads[anchor].cell;
        let load = tip_anchor_loads[anchor].load;
        let weights = vec4<f32>(load.xyz, 1.0 - load.x - load.y - load.z);
        let weight = dot(select(vec4<f32>(0.0), weights, nodes == vec4<u32>(contact.node)), vec4<f32>(1.0));
        share += vec2<f32>(load.w, select(0.0, 1.0, load.w != 0.0)) * weight;
#else
        let cell = tip_anchor_loads[anchor].cell.xyz;
        let load = tip_anchor_loads[anchor].load;
        let weight = select(vec3<f32>(0.0), 1.0 - load.xyz, contact.grid == cell)
            + select(vec3<f32>(0.0), load.xyz, contact.grid == cell + 1u);
        share += vec2<f32>(load.w, select(0.0, 1.0, load.w != 0.0)) * (weight.x * weight.y * weight.z);
#endif
    }
    return vec4<f32>(step_input.direction.xyz * share.x, share.y);
}

// Of contact node `index`, `from_axis` from the axis and `s` behind the tip.
fn touch_at(index: u32, contact: Contact, from_axis: vec3<f32>, s: f32) -> Touch {
    let passed = contact.pushed == 1u && contact.rest_axial < tip_state.coordinate && s > 0.0;
    return Touch(passed, contact.rest_radius);
}

// Weight of its contact stiffness.
fn touch_weight(touch: Touch) -> f32 {
    return ring_weight(touch.rest_radius);
}

// Velocity past the needle, from that past its tip [m/s].
fn past_needle(v: vec3<f32>, lever: vec3<f32>) -> vec3<f32> {
    return v;
}

// Its overlap as it lets go of the end of what it touches; `d`: the gradient of s.
fn at_end(touch: Touch, overlap: Overlap, d: vec3<f32>, s: f32) -> Overlap {
    return overlap;
}

// What of the stiffness at the node counts in the step [N/m].
fn counted_bound(touch: Touch, bound: f32) -> f32 {
    return bound;
}

// What a node remembers that the needle has left.
fn left_memory(index: u32) -> Memory {
    return Memory();
}
