// What a surface of the needle does to a node of its own. The same functions as in shared/slit_pressing.
// Equations: src/effects/puncture.rs, src/needle/gap.rs.
#import shared/pressing
#ifdef BORE
#import shared/tube_surface
#else
#import shared/path_surface
#endif

// Whether something may press on the node.
fn is_pressed(contact: Contact, touch: Touch) -> bool {
    return touch.touches;
}

// What presses on a node `lever` from the tip, `s` behind it; changes what it remembers and adds to the sums of the step.
fn pressing(
    index: u32,
    contact: Contact,
    touch: Touch,
    axis: Axis,
    lever: vec3<f32>,
    s: f32,
    memory: ptr<function, Memory>,
    sums: ptr<function, StepSums>,
) -> Pressing {
    let d = -step_input.direction.xyz;
    let from_axis = off_axis(axis, lever);
    if ((*memory).touching == 0.0) {
        (*memory).touching = 1.0;
        (*memory).overlap = max(0.0, overlap_of(contact, touch, from_axis, d, s, vec2<f32>(0.0)).value);
        (*memory).axial_on = s;
    }
    // An overlap found at activation fades over `entry_fade` of travel, so that the needle does that work.
    let travel = (s - (*memory).axial_on) / puncture.entry_fade;
    let fading = select(0.0, -(*memory).overlap / puncture.entry_fade, travel > 0.0 && travel < 1.0);
    let less = vec2<f32>((*memory).overlap * clamp(1.0 - travel, 0.0, 1.0), fading);
    let overlap = at_end(touch, overlap_of(contact, touch, from_axis, d, s, less), d, s);
    let gradient = along_axis(axis, overlap.gradient, d);
    let depth = overlap.value;
    let steep = length(gradient);
    let n = gradient * (-1.0 / steep);
    let v = past_needle(node_velocity[contact.node].xyz - axis.velocity, lever);
    let vn = dot(v, n);
    let k = surface_stiffness(contact, touch);
    let elastic = k * depth * steep;
    let damping = 2.0 * puncture.contact_damping * sqrt(k * contact.mass);
    let pressure = select(0.0, max(0.0, elastic - damping * vn), depth > 0.0);
    let normal = n * pressure;
    (*sums).stored = select(0.0, 0.5 * k * depth * depth, depth > 0.0);
    (*sums).shaft = select(0.0, dot(normal, step_input.direction.xyz) * params.dt, s >= puncture.tip_length);
    let damping_force = select(vec3<f32>(0.0), n * (pressure - elastic), depth > 0.0);
#ifdef COHESIVE
    (*memory).on_shaft = select(0.0, 1.0, depth > 0.0 && s >= puncture.tip_length);
#endif
    var rubbing = 0.0;
#ifdef FRICTION
    rubbing = pressure * clamp((s - puncture.tip_length) / friction.fade_length, 0.0, 1.0);
#endif
    // Whether it touches or not: a mass that came and went with the contact would make the node chatter.
    let bound = counted_bound(touch, 2.0 * k * steep * steep);
    return Pressing(normal, n, v, damping_force, rubbing, k, bound);
}
