// Stage measure_faces: what each face exerts on the tissue, 64 partial sums per face; the host adds them in f64.
#import shared/params
#import shared/thread_index
#import shared/gathered_force

// Force on the tissue [N], w unused; faces in the order x-, x+, y-, y+, z-, z+.
@group(2) @binding(7) var<storage, read_write> face_sums: array<vec4<f32>, 384>;

// Sum over every 64th node of the face. What holds a node balances the force of the cells on it.
#ifdef TETRAHEDRA
fn part_of_face(face: u32, part: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var node = part; node < NODE_COUNT; node += 64u) {
        let place = node_place(node);
        // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
        for (var once = 1u - ((place.flags >> (3u + face)) & 1u); once == 0u; once++) {
            sum -= gathered_force(place).xyz;
        }
    }
    return sum;
}
#else
fn part_of_face(face: u32, part: u32) -> vec3<f32> {
    let axis = face / 2u;
    let counts = vec3<u32>(NODES_X, NODES_Y, NODES_Z);
    // Nodes per row of the face, and of the face.
    let row = select(NODES_X, NODES_Y, axis == 0u);
    let count = row * select(NODES_Z, NODES_Y, axis == 2u);
    let last = (face & 1u) == 1u;
    var sum = vec3<f32>(0.0);
    for (var index = part; index < count; index += 64u) {
        let second = index / row;
        let first = index - second * row;
        var at = vec3<u32>(first, second, select(0u, counts.z - 1u, last));
        if (axis == 0u) {
            at = vec3<u32>(select(0u, counts.x - 1u, last), first, second);
        } else if (axis == 1u) {
            at = vec3<u32>(first, select(0u, counts.y - 1u, last), second);
        }
        sum -= gathered_force(NodePlace(at.x, at.y, at.z)).xyz;
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
    let face = thread / 64u;
    face_sums[thread] = vec4<f32>(part_of_face(face, thread % 64u), 0.0);
}
