// Stage measure_faces: what each face exerts on the tissue, 64 partial sums per face; the host adds them in f64.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/gathered_force
#ifndef TETRAHEDRA
#import shared/grid_lines
#endif

@group(2) @binding(0) var<storage, read_write> node_displacement: array<vec4<i32>>;
// x, y, z: force on the tissue [N]; w: its moment about the axis along the normal of the face through the centre of the tissue at
// rest [N m], right-handed about the coordinate axis. Faces in the order x-, x+, y-, y+, z-, z+.
@group(2) @binding(7) var<storage, read_write> face_sums: array<vec4<f32>, 384>;

// Force and moment of what holds a node: it balances the force of the cells on it. `arm`: place of the node at rest [m].
fn held(node: u32, place: NodePlace, arm: vec3<f32>, axis: u32) -> vec4<f32> {
    let force = -gathered_force(place).xyz;
    let x = arm + vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT;
    let normal = vec3<f32>(vec3<u32>(axis) == vec3<u32>(0u, 1u, 2u));
    return vec4<f32>(force, dot(cross(x, force), normal));
}

// Sum over every 64th node of the face.
#ifdef TETRAHEDRA
fn part_of_face(face: u32, part: u32) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    for (var node = part; node < NODE_COUNT; node += 64u) {
        let place = node_place(node);
        // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
        for (var once = 1u - ((place.flags >> (3u + face)) & 1u); once == 0u; once++) {
            sum += held(node, place, place.arm.xyz, face / 2u);
        }
    }
    return sum;
}
#else
fn part_of_face(face: u32, part: u32) -> vec4<f32> {
    let axis = face / 2u;
    let counts = vec3<u32>(NODES_X, NODES_Y, NODES_Z);
    // Where the lines of an axis begin, and the centre of the tissue.
    let y0 = NODES_X;
    let z0 = NODES_X + NODES_Y;
    let low = vec3<f32>(grid_lines[0], grid_lines[y0], grid_lines[z0]);
    let high = vec3<f32>(grid_lines[y0 - 1u], grid_lines[z0 - 1u], grid_lines[z0 + NODES_Z - 1u]);
    let centre = 0.5 * (low + high);
    // Nodes per row of the face, and of the face.
    let row = select(NODES_X, NODES_Y, axis == 0u);
    let count = row * select(NODES_Z, NODES_Y, axis == 2u);
    let last = (face & 1u) == 1u;
    var sum = vec4<f32>(0.0);
    for (var index = part; index < count; index += 64u) {
        let second = index / row;
        let first = index - second * row;
        var at = vec3<u32>(first, second, select(0u, counts.z - 1u, last));
        if (axis == 0u) {
            at = vec3<u32>(select(0u, counts.x - 1u, last), first, second);
        } else if (axis == 1u) {
            at = vec3<u32>(first, select(0u, counts.y - 1u, last), second);
        }
        let X = vec3<f32>(grid_lines[at.x], grid_lines[y0 + at.y], grid_lines[z0 + at.z]);
        sum += held((at.z * NODES_Y + at.y) * NODES_X + at.x, NodePlace(at.x, at.y, at.z), X - centre, axis);
    }
    return sum;
}
#endif

@compute @workgroup_size(64)
fn measure_faces(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
    if (thread >= 384u) {
        return;
    }
    face_sums[thread] = part_of_face(thread / 64u, thread % 64u);
}
