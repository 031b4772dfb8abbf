#import shared/params
#import shared/step_input
// What lies in the buffers are vectors: a software adapter pays for every access, hardly for its width.

// A node that the tool may touch, as it lies in the buffer; see `Contact`.
struct ContactNode {
    rest: vec4<f32>,
    grid: vec4<u32>,
    surface: vec4<f32>,
    // node, slot, pushed, faces
    numbers: vec4<u32>,
    // rest_radius, rest_axial, mass, share
    sizes: vec4<f32>,
    ring_low: vec4<u32>,
    ring_high: vec4<u32>,
}

// A node that the tool may touch: what is known before the run.
struct Contact {
    // Rest position X [m].
    rest: vec3<f32>,
    // Grid coordinates of the node.
    grid: vec3<u32>,
    // Of a surface that separates: side to which a slit face is pushed (unit vector); w: 1 at the outer wall of a hollow
    // needle, -1 at its bore.
    surface: vec4<f32>,
    node: u32,
    // Slot of `corner_force` that takes the force on this node.
    slot: u32,
    // 1: pushed by the tool; 0: only carries forces of the tip.
    pushed: u32,
    // On a slit: faces around the node (bits: lower and higher along the first way, those again higher along the second), and the
    // contact nodes around, row by row without the node itself.
    faces: u32,
    ring_low: vec4<u32>,
    ring_high: vec4<u32>,
    // Rest distance from the axis r0 and coordinate s0 along the path [m].
    rest_radius: f32,
    rest_axial: f32,
    // Nodal mass [kg].
    mass: f32,
    // What the node stands for: on a slit a quarter of the areas of its faces [m^2], else its rest volume [m^3].
    share: f32,
}

// What a contact node remembers, as it lies in the buffer, see `Memory`; and what it sums over the steps of a frame, see `ContactSums`.
struct ContactRecord {
    // w: damping.x
    stick: vec4<f32>,
    // overlap, axial_on, touching, on_shaft
    touch: vec4<f32>,
    // passed, rest_radius, damping.y, damping.z
    path: vec4<f32>,
    impulse: vec4<f32>,
    angular_impulse: vec4<f32>,
    parts: vec4<f32>,
    energies: vec4<f32>,
}

// What a contact node remembers.
struct Memory {
    // Stretch of the stick spring [m].
    stick: vec3<f32>,
    // Overlap found at activation [m], axial position there [m], 1 while touching.
    overlap: f32,
    axial_on: f32,
    touching: f32,
    // 1 while pressed by the full shaft.
    on_shaft: f32,
    // On a free path: 1 where the tip has passed, and the distance from the axis there [m].
    passed: f32,
    rest_radius: f32,
    // Force of the contact damping [N].
    damping: vec3<f32>,
}

// Sums over the steps of a frame; forces on the tissue.
struct ContactSums {
    // Whole impulse [N s] and angular impulse about the tip [N m s]. In the record of a node, w: work of the tool in the step that was booked
    // last, with the velocity ahead [J], and that step, modulo 65536. In the sums, w of the impulse: that work in the last step of the frame [J].
    impulse: vec4<f32>,
    angular_impulse: vec4<f32>,
    // Parts along the insertion direction [N s]: cutting, spreading, sliding, and the part of spreading on the shaft of a needle.
    parts: vec4<f32>,
    // Work of the tool [J], dissipated by sliding and by damping [J], stored in the springs of this node at the last step [J].
    energies: vec4<f32>,
}

// What one step adds to the sums beside the forces: parts of angular impulse and work that forces at the node do not have.
struct StepSums {
    angular_impulse: vec3<f32>,
    shaft: f32,
    work: f32,
    sliding_dissipation: f32,
    damping_dissipation: f32,
    stored: f32,
}

// How many there are.
override CONTACT_COUNT: u32 = 1u;
@group(1) @binding(4) var<storage, read> contact_nodes: array<ContactNode>;
@group(3) @binding(4) var<storage, read_write> contact_records: array<ContactRecord>;

fn contact_at(index: u32) -> Contact {
    let c = contact_nodes[index];
    return Contact(
        c.rest.xyz,
        c.grid.xyz,
        c.surface,
        c.numbers.x,
        c.numbers.y,
        c.numbers.z,
        c.numbers.w,
        c.ring_low,
        c.ring_high,
        c.sizes.x,
        c.sizes.y,
        c.sizes.z,
        c.sizes.w,
    );
}

fn remembered(index: u32) -> Memory {
    let m = contact_records[index];
    let damping = vec3<f32>(m.stick.w, m.path.zw);
    return Memory(m.stick.xyz, m.touch.x, m.touch.y, m.touch.z, m.touch.w, m.path.x, m.path.y, damping);
}

fn remember(index: u32, m: Memory) {
    contact_records[index].stick = vec4<f32>(m.stick, m.damping.x);
    contact_records[index].touch = vec4<f32>(m.overlap, m.axial_on, m.touching, m.on_shaft);
    contact_records[index].path = vec4<f32>(m.passed, m.rest_radius, m.damping.yz);
}

// Dissipated by contact damping in the last step [J]: mean of its forces before and after, times the velocity `v` past the tool between.
fn damped(before: vec3<f32>, after: vec3<f32>, v: vec3<f32>) -> f32 {
    return -0.5 * params.dt * dot(before + after, v);
}

// The present step as a float that holds it.
fn step_mark() -> f32 {
    return f32(step_input.step & 0xffffu);
}

// Books one step of contact node `index`: tip, normal and tangential force, lever about the tip, and what else there is.
fn book_contact(
    index: u32,
    tip: vec3<f32>,
    normal: vec3<f32>,
    tangential: vec3<f32>,
    lever: vec3<f32>,
    more: StepSums,
) {
    let total = tip + normal + tangential;
    let d = step_input.direction.xyz * params.dt;
    let torque = cross(lever, total);
    var power = dot(total, step_input.velocity.xyz);
    var power_ahead = dot(total, step_input.velocity_ahead.xyz);
#ifdef TURNS
    power += dot(torque, angular_velocity());
    power_ahead += dot(torque, step_input.angular_velocity_ahead.xyz);
#endif
    let work = power * params.dt + more.work;
    let impulse = contact_records[index].impulse.xyz + total * params.dt;
    contact_records[index].impulse = vec4<f32>(impulse, power_ahead * params.dt + more.work);
    let angular_impulse = contact_records[index].angular_impulse.xyz + torque * params.dt + more.angular_impulse;
    contact_records[index].angular_impulse = vec4<f32>(angular_impulse, step_mark());
    contact_records[index].parts += vec4<f32>(dot(tip, d), dot(normal, d), dot(tangential, d), more.shaft);
    let before = contact_records[index].energies.xyz;
    let taken = vec3<f32>(work, more.sliding_dissipation, more.damping_dissipation);
    contact_records[index].energies = vec4<f32>(before + taken, more.stored);
}
