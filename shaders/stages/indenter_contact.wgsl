// Stage indenter_contact: penalty contact of the surface with a sphere or a flat punch; one thread per contact node.
// Equations: src/effects/indentation.rs and CpuEngine::indenter_contact.
#import shared/params
#import shared/thread_index
#import shared/step_input
#import shared/displacement
#import shared/corner_force
#import shared/contact_node
#import effects/indentation
#import shared/face_points
#ifdef FRICTION
#import effects/friction
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;

// What the points of all faces around a node do to the node.
struct PointForce {
    // Normal force [N] and its torque about the tip [N m].
    normal: vec3<f32>,
    torque: vec3<f32>,
    // The part of the damping in it [N].
    damping: vec3<f32>,
    // Sum of the normal forces of the points [N]; stored [J].
    pressing: f32,
    stored: f32,
}

#ifdef TETRAHEDRA
// On a surface of triangles the node itself touches, for its share of them.
fn pressed_points(index: u32) -> PointForce {
    var sum: PointForce;
    let contact = contact_at(index);
    let lever = lever_of(index);
    let penetration = tool_penetration(lever, step_input.direction.xyz, contact.rest_radius);
    let n = penetration.xyz;
    let vn = dot(node_velocity[contact.node].xyz - velocity_behind(), n);
    let k = indentation.face_stiffness * contact.share;
    let depth = max(penetration.w, 0.0);
    let elastic = k * depth;
    let normal = select(0.0, max(0.0, elastic - indentation.face_damping * k * vn), depth > 0.0);
    sum.normal = n * normal;
    sum.torque = cross(lever, sum.normal);
    sum.pressing = normal;
    sum.stored = 0.5 * k * depth * depth;
    sum.damping = n * (normal - elastic);
    return sum;
}
#else
fn pressed_points(index: u32) -> PointForce {
    var sum: PointForce;
    let contact = contact_at(index);
    let own = lever_of(index);
    for (var face = 0u; face < 4u; face++) {
        let i = face & 1u;
        let j = face >> 1u;
        let first = face_neighbour(contact, 2u * i + 3u);
        let second = face_neighbour(contact, 6u * j + 1u);
        let far = face_neighbour(contact, 2u * i + 6u * j);
        let levers = array<vec3<f32>, 3>(lever_of(first), lever_of(second), lever_of(far));
        let rest = array<vec2<f32>, 3>(
            contact_nodes[first].rest.xy,
            contact_nodes[second].rest.xy,
            contact_nodes[far].rest.xy,
        );
#ifdef EMPTY_CELLS
        // Skin is not level.
        let area = length(cross(contact_nodes[first].rest.xyz - contact.rest, contact_nodes[second].rest.xyz - contact.rest));
#else
        let edges = array<vec2<f32>, 2>(rest[0] - contact.rest.xy, rest[1] - contact.rest.xy);
        let area = abs(edges[0].x * edges[1].y - edges[0].y * edges[1].x);
#endif
        let k = indentation.face_stiffness * area / f32(FACE_POINTS * FACE_POINTS);
        let present = (contact.faces & (1u << face)) != 0u;
        for (var point = select(FACE_POINTS * FACE_POINTS, 0u, present); point < FACE_POINTS * FACE_POINTS; point++) {
            let w = face_weights(point);
            let lever = own * w.x + levers[0] * w.y + levers[1] * w.z + levers[2] * w.w;
            let place = contact.rest.xy * w.x + rest[0] * w.y + rest[1] * w.z + rest[2] * w.w;
            let penetration = tool_penetration(lever, step_input.direction.xyz, length(place - indentation.entry));
            let n = penetration.xyz;
            let v = node_velocity[contact.node].xyz * w.x + node_velocity[contact_nodes[first].numbers.x].xyz * w.y
                + node_velocity[contact_nodes[second].numbers.x].xyz * w.z
                + node_velocity[contact_nodes[far].numbers.x].xyz * w.w - velocity_behind();
            let vn = dot(v, n);
            let depth = max(penetration.w, 0.0);
            let elastic = k * depth;
            let normal = select(0.0, max(0.0, elastic - indentation.face_damping * k * vn), depth > 0.0);
            let force = n * (w.x * normal);
            sum.normal += force;
            sum.torque += cross(lever, force);
            sum.pressing += w.x * normal;
            sum.stored += w.x * 0.5 * k * depth * depth;
            sum.damping += n * (w.x * (normal - elastic));
        }
    }
    return sum;
}
#endif

@compute @workgroup_size(64)
fn indenter_contact(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= CONTACT_COUNT) {
        return;
    }
    let contact = contact_at(index);
    let lever = lever_of(index);
    let v = node_velocity[contact.node].xyz - velocity_behind();
    let k = indentation.face_stiffness * contact.share;
    var memory = remembered(index);
    var normal = vec3<f32>(0.0);
    var tangential = vec3<f32>(0.0);
    var sums = StepSums();
    if (indentation.bonded == 1u) {
        let penetration = tool_penetration(lever, step_input.direction.xyz, contact.rest_radius);
        let n = penetration.xyz;
        let depth = penetration.w;
        memory.touching = select(memory.touching, 1.0, depth > 0.0);
        if (memory.touching == 1.0) {
            let damping = v * (-indentation.face_damping * k);
            memory.stick += (v - n * dot(v, n)) * params.dt;
            normal = n * (k * depth) + damping - memory.stick * k;
            sums.damping_dissipation = damped(memory.damping, damping, v);
            memory.damping = damping;
            sums.stored = 0.5 * k * (depth * depth + dot(memory.stick, memory.stick));
        }
    } else {
        let points = pressed_points(index);
        normal = points.normal;
        sums.angular_impulse = (points.torque - cross(lever, normal)) * params.dt;
        sums.damping_dissipation = damped(memory.damping, points.damping, v);
        memory.damping = points.damping;
        sums.stored = points.stored;
        let touches = points.pressing > 0.0;
        memory.touching = select(0.0, 1.0, touches);
#ifdef FRICTION
        let n = normal * select(0.0, 1.0 / length(normal), touches);
        let kt = friction.stiffness_ratio * k;
        let trial = stick_trial(memory.stick, (v - n * dot(v, n)) * params.dt, n);
        let stretch = stick_return(trial, friction.coefficient * points.pressing / kt) * memory.touching;
        sums.sliding_dissipation = 0.5 * kt * dot(memory.stick + stretch, trial - stretch);
        memory.stick = stretch;
        tangential = stretch * -kt;
        sums.stored += 0.5 * kt * dot(stretch, stretch);
#endif
    }
    remember(index, memory);
    // Contact counts touching or not: a mass that came and went with it would make the node chatter.
    corner_force[contact.slot] += vec4<f32>(normal + tangential, 2.0 * k);
    book_contact(index, vec3<f32>(0.0), normal, tangential, lever, sums);
}
