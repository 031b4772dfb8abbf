// Stage integrate_nodes: gather the corner forces, add loads, damp, advance by central differences.
//
// v+ = ((1 - alpha dt/2) v + dt f/m) / (1 + alpha dt/2), u+ = u + dt v+; held and driven components are prescribed.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/gathered_force
#import shared/node_cures
#ifdef STEP_INPUT
#import shared/step_input
#endif
#ifdef MASS_SCALING
#import effects/mass_scaling
#endif
#ifdef GRAVITY
#import effects/gravity
#endif
#ifdef LOADED_FACES
#import shared/node_load
#endif
#ifdef DRIVEN_FACES
#import shared/driven_faces
#endif
#ifdef NODE_WORK
#import shared/node_work
#endif
#ifdef TIED
#import shared/tied_nodes
#endif
#ifdef EMPTY_CELLS
#import shared/busy_nodes
#endif

@group(1) @binding(1) var<storage, read> node_mass: array<f32>;
// u in fixed point; w: bits of the f32 mass of the last step over that at rest, 0 before the first.
@group(2) @binding(0) var<storage, read_write> node_displacement: array<vec4<i32>>;
// v at the half step [m/s]; w: energy that mass damping took in this frame [J].
@group(2) @binding(1) var<storage, read_write> node_velocity: array<vec4<f32>>;

@compute @workgroup_size(64)
fn integrate_nodes(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
#ifdef EMPTY_CELLS
    let thread = thread_index(id, groups);
    if (thread >= BUSY_NODE_COUNT) {
        return;
    }
    let node = busy_node(thread);
#else
    let node = thread_index(id, groups);
#endif
    if (node >= NODE_COUNT) {
        return;
    }
    let place = node_place(node);
#ifdef TIED
    // Every copy sums over all of them, in the same order, and books its share of the mass.
    let tied = tied_nodes[node];
    let copies = tied.copies;
    var sum = vec4<f32>(0.0);
    for (var copy = 0u; copy < 4u && copies[copy] != NO_NODE; copy++) {
        sum += gathered_force(node_place(copies[copy]));
    }
    let scaled_mass = tied.whole_mass;
    let share = tied.mass / scaled_mass;
#else
    let sum = gathered_force(place);
    let scaled_mass = node_mass[node];
#endif
    var force = sum.xyz;
    var mass = scaled_mass;
    var displacement = node_displacement[node];
    let last = node_velocity[node];
#ifdef MASS_SCALING
    mass = stable_mass(scaled_mass, sum.w);
    // A node whose mass rises keeps its kinetic energy: src/effects/mass_scaling.rs.
    let inertia = mass / scaled_mass;
    let inertia_before = max(bitcast<f32>(displacement.w), 1.0);
    displacement.w = bitcast<i32>(inertia);
    let slowed = select(1.0, sqrt(inertia_before / inertia), inertia > inertia_before);
#else
    let inertia_before = 1.0;
    let slowed = 1.0;
#endif
#ifdef GRAVITY
    force += gravity.acceleration.xyz * scaled_mass;
#endif
#ifdef LOADED_FACES
    var load = node_load[node].xyz * step_input.load_factor;
#ifdef TIED
    for (var copy = 0u; copy < 4u && copies[copy] != NO_NODE; copy++) {
        load += select(node_load[copies[copy]].xyz, vec3<f32>(0.0), copies[copy] == node) * step_input.load_factor;
    }
#endif
    force += load;
#endif
    let half = 0.5 * params.mass_damping * params.dt;
#ifdef EMPTY_CELLS
    let held = held_components(place) | standing_components(thread);
#else
    let held = held_components(place);
#endif
    let is_free = vec3<f32>((vec3<u32>(held) & vec3<u32>(1u, 2u, 4u)) == vec3<u32>(0u));
    let old = last.xyz * (1.0 - is_free + is_free * slowed);
    // A held component moves as prescribed, whatever its load: the limit concerns the free ones.
    var next = (old * (1.0 - half) + force * (params.dt / mass)) / (1.0 + half) * is_free;
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    let square = dot(next, next);
    let fast = square > params.speed_limit * params.speed_limit;
    var stopped = vec3<f32>(0.0);
    for (var once = select(1u, 0u, fast); once == 0u; once++) {
        stopped = next * (1.0 - params.speed_limit * inverseSqrt(square));
        next -= stopped;
    }
    var prescribed = vec3<f32>(0.0);
#ifdef DRIVEN_FACES
    prescribed = prescribed_velocity(place) * (1.0 - is_free);
#endif
#ifdef NODE_WORK
    // What the support adds so that the node moves as prescribed, times its velocity at mid step.
    let middle = 0.5 * (old + prescribed);
    let reaction = (mass / params.dt) * (prescribed - old) - force;
    var work = params.dt * dot(reaction * (1.0 - is_free), middle);
#endif
    next += prescribed;
#ifdef NODE_WORK
#ifdef LOADED_FACES
    work += params.dt * 0.5 * dot(load, old + next);
#endif
#ifdef TIED
    work *= share;
#endif
    node_work[node] += work;
#endif
    let mid = 0.5 * (old + next) * is_free;
    var taken = params.mass_damping * params.dt * mass * dot(mid, mid);
#ifdef TIED
    taken *= share;
#endif
    let ratio = sum.w * params.dt * params.dt / (4.0 * mass);
    for (var once = select(1u, 0u, mass > scaled_mass || inertia_before > 1.0 || fast || ratio > WATCHED_STEP_RATIO); once == 0u; once++) {
        // The kinetic energy is told with the mass at rest: what the rest of the mass gained in this step is not in it, nor what that lost
        // of its own, nor what the force did on the way that went.
        let lost = last.xyz - old;
        var raised = 0.5 * ((mass - scaled_mass) * (dot(next, next) - dot(old, old))
            + scaled_mass * dot(lost, last.xyz + old) + params.dt * dot(force, lost));
        // Work of the force that holds the node back.
        var clamped = mass * (1.0 + half) * dot(stopped, mid);
#ifdef TIED
        raised *= share;
        clamped *= share;
#endif
        let before = node_cures[node];
        let sums = bitcast<vec2<f32>>(before.xy) + vec2<f32>(raised, clamped);
        let steps = before.z + select(0u, 1u, mass > scaled_mass) + select(0u, 65536u, fast);
        let watched = max(bitcast<f32>(before.w), select(0.0, ratio, ratio > WATCHED_STEP_RATIO));
        node_cures[node] = vec4<u32>(bitcast<vec2<u32>>(sums), steps, bitcast<u32>(watched));
    }
    let damped = last.w + taken;
    node_velocity[node] = vec4<f32>(next, damped);
    let way = next * (params.dt * UNITS_PER_METRE);
    var units = round(way);
#ifdef DRIVEN_FACES
    // A constant speed would be rounded alike in every step, so that a slow face arrives at the wrong place (by 0.4 % at
    // 0.1 mm/s and 10 us): prescribed motion is rounded down and up in turn.
    units = select(floor(way + step_input.rounding), units, is_free == vec3<f32>(1.0));
#endif
    node_displacement[node] = vec4<i32>(displacement.xyz + vec3<i32>(units), displacement.w);
}
