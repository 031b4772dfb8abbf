// Points on the faces around a contact node, at which a tool touches; see NodeFaces of the host.
#import shared/displacement
#import shared/contact_node

// Points of a face along each of its edges.
const FACE_POINTS: u32 = 3u;

// Contact node `place` (row by row, 4 is the node itself) of the 3 x 3 block around a node.
fn face_neighbour(contact: Contact, place: u32) -> u32 {
    let at = select(place, place - 1u, place > 4u);
    return select(contact.ring_low[at & 3u], contact.ring_high[at & 3u], at > 3u);
}

fn lever_of(contact: u32) -> vec3<f32> {
    return contact_nodes[contact].rest.xyz - step_input.tip.xyz
        + vec3<f32>(node_displacement[contact_nodes[contact].numbers.x].xyz) * DISPLACEMENT_UNIT;
}

// Bilinear weights of a point as seen from one corner: of this corner, of the one along the first way, along the second, and of
// the far one.
fn face_weights(point: u32) -> vec4<f32> {
    let t = (f32(point % FACE_POINTS) + 0.5) / f32(FACE_POINTS);
    let u = (f32(point / FACE_POINTS) + 0.5) / f32(FACE_POINTS);
    return vec4<f32>((1.0 - t) * (1.0 - u), t * (1.0 - u), (1.0 - t) * u, t * u);
}
