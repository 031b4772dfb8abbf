// Stage indenter_contact: penalty contact of the top face with a sphere or a flat punch; one thread per contact node.
// Equations: src/effects/indentation.rs and CpuEngine::indenter_contact.
#import shared/params
#import shared/thread_index
#import shared/step_input
#import shared/displacement
#import shared/corner_force
#import shared/contact_node
#import effects/indentation
#ifdef FRICTION
#import effects/friction
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;

@compute @workgroup_size(64)
fn indenter_contact(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= CONTACT_COUNT) {
        return;
    }
    let contact = contact_at(index);
    let x = contact.rest + vec3<f32>(node_displacement[contact.node].xyz) * DISPLACEMENT_UNIT;
    let lever = x - step_input.tip.xyz;
    let penetration = tool_penetration(lever, step_input.direction.xyz, contact.rest_radius);
    let n = penetration.xyz;
    let depth = penetration.w;
    let v = node_velocity[contact.node].xyz - step_input.velocity.xyz;
    let vn = dot(v, n);
    let k = indentation.contact_stiffness;
    let damping = 2.0 * indentation.contact_damping * sqrt(k * contact.mass);
    var memory = remembered(index);
    var normal = vec3<f32>(0.0);
    var tangential = vec3<f32>(0.0);
    var sums = StepSums();
    if (indentation.bonded == 1u && (memory.touching == 1.0 || depth > 0.0)) {
        memory.touching = 1.0;
        memory.stick += (v - n * vn) * params.dt;
        normal = n * (k * depth) - v * damping - memory.stick * k;
        sums.damping_dissipation = damping * dot(v, v) * params.dt;
        sums.stored = 0.5 * k * (depth * depth + dot(memory.stick, memory.stick));
    } else if (depth > 0.0) {
        memory.touching = 1.0;
        let pressure = max(0.0, k * depth - damping * vn);
        normal = n * pressure;
        sums.damping_dissipation = (k * depth - pressure) * vn * params.dt;
        sums.stored = 0.5 * k * depth * depth;
#ifdef FRICTION
        let kt = friction.stiffness_ratio * k;
        let trial = stick_trial(memory.stick, (v - n * vn) * params.dt, n);
        let stretch = stick_return(trial, friction.coefficient * pressure / kt);
        memory.stick = stretch;
        tangential = stretch * -kt;
        sums.sliding_dissipation = kt * dot(stretch, trial - stretch);
        sums.stored += 0.5 * kt * dot(stretch, stretch);
#endif
    } else {
        memory.stick = vec3<f32>(0.0);
        memory.touching = 0.0;
    }
    remember(index, memory);
    corner_force[contact.slot] += vec4<f32>(normal + tangential, 0.0);
    book_contact(index, vec3<f32>(0.0), normal, tangential, lever, sums);
}
