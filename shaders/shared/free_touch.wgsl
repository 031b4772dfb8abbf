// How the needle on a free path meets a contact node. The same functions as in shared/planned_touch.
// Equations: src/needle/free_path.rs.
#import shared/contact_node
#import effects/puncture
#import effects/free_path
#import shared/tip_read

struct FreeTouch {
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

alias Touch = FreeTouch;

// w: of all springs, for they hold the tip sideways too.
fn tip_share(contact: Contact) -> vec4<f32> {
    var share = vec4<f32>(0.0);
    let away = contact.rest - free_tip.place.xyz;
    let near = free_tip.inside == 1.0 && dot(away, away) <= puncture.anchor_reach * puncture.anchor_reach;
    for (var anchor = select(ANCHOR_COUNT, 0u, near); anchor < ANCHOR_COUNT; anchor++) {
        let cell = tip_anchor_loads[anchor].cell.xyz;
        let load = tip_anchor_loads[anchor].load;
        let weight = select(vec3<f32>(0.0), 1.0 - load.xyz, contact.grid == cell)
            + select(vec3<f32>(0.0), load.xyz, contact.grid == cell + 1u);
        let axial = step_input.direction.xyz * load.w;
        share += vec4<f32>(axial + free_tip.sway.xyz, 1.0) * (weight.x * weight.y * weight.z);
    }
    return share;
}

// Brings what the node knows of the tip to this step.
fn touch_at(index: u32, contact: Contact, from_axis: vec3<f32>, s: f32) -> Touch {
    let T = free_tip.along.xyz;
    let relative = contact.rest - free_tip.place.xyz;
    let ahead = dot(relative, T);
    let radius = length(relative - T * ahead);
    let ring = puncture.ring_radius;
    let known = contact_records[index].path;
    let old = known.x == 1.0;
    // The dimple before the puncture is no opened path.
    let passes = free_tip.coordinate > 0.0 && ahead <= 0.0 && ahead > -ring && radius < ring;
    let passed = free_tip.inside == 1.0 && contact.pushed == 1u && s > -PASSED_MARGIN && (old || passes);
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
    let square = dot(from_axis, from_axis) - s * s;
    let met = free_tip.inside == 1.0 && contact.pushed == 1u && !passed && s > puncture.tip_length && square < reach * reach;
    let in_ring = passed && s > 0.0 && rest_radius > puncture.softened_radius;
    let weight = select(ring_weight(rest_radius), 1.0, met);
    let beside = (reach - sqrt(max(square, 0.0))) / (reach - puncture.needle_radius);
    let behind = (s - puncture.tip_length) / (END_FADE * puncture.tip_length);
    let nearness = select(1.0, clamp(beside, 0.0, 1.0) * clamp(behind, 0.0, 1.0), met);
    return Touch(met || in_ring, rest_radius, weight, select(0.0, puncture.tip_length, met), nearness);
}

fn touch_weight(touch: Touch) -> f32 {
    return touch.weight;
}

fn past_needle(v: vec3<f32>, lever: vec3<f32>) -> vec3<f32> {
    return v - cross(angular_velocity_behind(), lever);
}

fn at_end(touch: Touch, overlap: Overlap, d: vec3<f32>, s: f32) -> Overlap {
    return faded_at_end(overlap, d, s, touch.end);
}

fn counted_bound(touch: Touch, bound: f32) -> f32 {
    return bound * touch.nearness;
}

// Whether the tip has passed it stays known.
fn left_memory(index: u32) -> Memory {
    var left = Memory();
    left.passed = contact_records[index].path.x;
    left.rest_radius = contact_records[index].path.y;
    return left;
}
