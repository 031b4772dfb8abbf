// Contact of the needle at the points of the faces of a slit. Equations: src/needle/slit.rs.
#import shared/displacement
#import shared/contact_node
#import shared/face_points
#import effects/puncture
#ifdef FLEXIBLE_NEEDLE
#import effects/flexible_needle
#endif

// What the points of all faces around a node do to the node.
struct SlitForce {
    // Normal force and its part on the shaft [N].
    normal: vec3<f32>,
    on_shaft: vec3<f32>,
    // Torque about the tip [N m].
    torque: vec3<f32>,
    // Sum of the normal forces, each times the part of the friction that is there [N].
    rubbing: f32,
    // Force of the contact damping in it [N].
    damping: vec3<f32>,
    // Stored [J]; power beside that of the motion of the needle as a whole [W].
    stored: f32,
    axis_power: f32,
    // Bound of the stiffness at the node [N/m].
    bound: f32,
}

fn slit_force(index: u32) -> SlitForce {
    var sum: SlitForce;
    let contact = contact_at(index);
    let d = -step_input.direction.xyz;
    let own = lever_of(index);
    let own_velocity = node_velocity[contact.node].xyz;
    for (var face = 0u; face < 4u; face++) {
        let i = face & 1u;
        let j = face >> 1u;
        let first = face_neighbour(contact, 2u * i + 3u);
        let second = face_neighbour(contact, 6u * j + 1u);
        let far = face_neighbour(contact, 2u * i + 6u * j);
        let levers = array<vec3<f32>, 3>(lever_of(first), lever_of(second), lever_of(far));
        let rest_axial = vec4<f32>(
            contact.rest_axial,
            contact_nodes[first].sizes.y,
            contact_nodes[second].sizes.y,
            contact_nodes[far].sizes.y,
        );
        let s = vec4<f32>(dot(own, d), dot(levers[0], d), dot(levers[1], d), dot(levers[2], d));
        let near = (contact.faces & (1u << face)) != 0u
            && any(rest_axial < vec4<f32>(tip_state.coordinate)) && any(s > vec4<f32>(0.0));
        let edges = array<vec3<f32>, 2>(
            contact_nodes[first].rest.xyz - contact.rest,
            contact_nodes[second].rest.xyz - contact.rest,
        );
        let k = puncture.face_stiffness * length(cross(edges[0], edges[1])) / f32(FACE_POINTS * FACE_POINTS);
        for (var point = select(FACE_POINTS * FACE_POINTS, 0u, near); point < FACE_POINTS * FACE_POINTS; point++) {
            let w = face_weights(point);
            let lever = own * w.x + levers[0] * w.y + levers[1] * w.z + levers[2] * w.w;
            let s = dot(s, w);
            var from_axis = lever;
            var v = own_velocity * w.x + node_velocity[contact_nodes[first].numbers.x].xyz * w.y
                + node_velocity[contact_nodes[second].numbers.x].xyz * w.z
                + node_velocity[contact_nodes[far].numbers.x].xyz * w.w - velocity_behind();
#ifdef FLEXIBLE_NEEDLE
            let bend = bend_at(s);
            from_axis -= bend.offset;
            v -= bend.rate;
#endif
            let overlap = slit_face(from_axis, d, s, contact.surface.xyz, vec2<f32>(0.0));
            var gradient = overlap.gradient;
#ifdef FLEXIBLE_NEEDLE
            gradient -= d * dot(gradient, bend.slope);
#endif
            let touches = dot(rest_axial, w) < tip_state.coordinate && s > 0.0 && overlap.value > 0.0;
            let depth = select(0.0, overlap.value, touches);
            let steep = length(gradient);
            let n = gradient * (-1.0 / steep);
            let vn = dot(v, n);
            let elastic = k * depth * steep;
            let normal = select(0.0, max(0.0, elastic - puncture.face_damping * k * vn), touches);
            let force = n * (w.x * normal);
            let on_shaft = s >= puncture.tip_length;
            sum.normal += force;
            sum.on_shaft += select(vec3<f32>(0.0), force, on_shaft);
            sum.torque += cross(lever, force);
#ifdef FRICTION
            sum.rubbing += w.x * normal * clamp((s - puncture.tip_length) / friction.fade_length, 0.0, 1.0);
#endif
            sum.stored += w.x * 0.5 * k * depth * depth;
            sum.damping += select(vec3<f32>(0.0), n * (w.x * (normal - elastic)), touches);
#ifdef FLEXIBLE_NEEDLE
            sum.axis_power += dot(force, bend.rate);
#endif
            sum.bound += select(0.0, 2.0 * w.x * k * steep * steep, touches);
        }
    }
    return sum;
}
