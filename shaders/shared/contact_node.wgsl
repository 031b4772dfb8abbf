#import shared/params
#import shared/step_input

// A node that the tool may touch: what is known before the run.
struct ContactNode {
    // Rest position X [m], w unused.
    rest: vec4<f32>,
    // Grid coordinates of the node, w unused.
    grid: vec4<u32>,
    // Of a surface that separates: side to which a slit face is pushed (unit vector); w: 1 at the outer wall of a hollow
    // needle, -1 at its bore.
    surface: vec4<f32>,
    node: u32,
    // Slot of `corner_force` that takes the force on this node.
    slot: u32,
    // 1: pushed by the tool; 0: only carries forces of the tip.
    pushed: u32,
    // Rest distance from the axis r0 and coordinate s0 along the path [m].
    rest_radius: f32,
    rest_axial: f32,
    // Nodal mass [kg].
    mass: f32,
    // On a slit: faces around the node (bits: lower and higher along the first way, those again higher along the second), and the
    // contact nodes around, row by row without the node itself.
    faces: u32,
    // What the node stands for: on a slit a quarter of the areas of its faces [m^2], else its rest volume [m^3].
    share: f32,
    ring_low: vec4<u32>,
    ring_high: vec4<u32>,
}

// What a contact node remembers.
struct ContactMemory {
    // Stretch of the stick spring [m], w unused.
    stick: vec4<f32>,
    // Overlap found at activation [m], axial position there [m], 1 while touching.
    overlap: f32,
    axial_on: f32,
    touching: f32,
    // 1 while pressed by the full shaft.
    on_shaft: f32,
    // On a free path: 1 where the tip has passed, and the distance from the axis there [m].
    passed: f32,
    rest_radius: f32,
    _pad0: f32,
    _pad1: f32,
}

// Sums over the steps of a frame; forces on the tissue.
struct ContactSums {
    // Whole impulse [N s] and angular impulse about the tip [N m s], w unused.
    impulse: vec4<f32>,
    angular_impulse: vec4<f32>,
    // Parts along the insertion direction [N s].
    cutting: f32,
    spreading: f32,
    sliding: f32,
    // Work of the tool [J].
    work: f32,
    // Dissipated by sliding and by damping [J].
    sliding_dissipation: f32,
    damping_dissipation: f32,
    // Stored in the springs of this node at the last step [J].
    stored: f32,
    // The part of `spreading` on the shaft of a needle [N s].
    shaft: f32,
}

@group(1) @binding(4) var<storage, read> contact_nodes: array<ContactNode>;
@group(3) @binding(4) var<storage, read_write> contact_memory: array<ContactMemory>;
@group(3) @binding(5) var<storage, read_write> contact_sums: array<ContactSums>;

// Books the forces of one step on contact node `index`: tip, normal and tangential force, lever about the tip.
fn book_contact(index: u32, tip: vec3<f32>, normal: vec3<f32>, tangential: vec3<f32>, lever: vec3<f32>) {
    let total = tip + normal + tangential;
    let d = step_input.direction.xyz * params.dt;
    contact_sums[index].impulse += vec4<f32>(total * params.dt, 0.0);
    contact_sums[index].angular_impulse += vec4<f32>(cross(lever, total) * params.dt, 0.0);
    contact_sums[index].cutting += dot(tip, d);
    contact_sums[index].spreading += dot(normal, d);
    contact_sums[index].sliding += dot(tangential, d);
    contact_sums[index].work += dot(total, step_input.velocity.xyz) * params.dt;
#ifdef FREE_PATH
    contact_sums[index].work += dot(cross(lever, total), angular_velocity()) * params.dt;
#endif
}
