// Stage measure_nodes: kinetic energy, dissipation, speeds and counters; resets what is summed per frame.
//
// Velocities belong to the middle of the last step, stored energies to its beginning, where the other measuring stages ran. With the
// forces f there, the trapezoidal rule has stored energies at the middle: E - dt/2 f v. The sum of kinetic energy, this and work is exact
// for linear tissue, whatever moves within a step.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/node_sums
#import shared/node_cures
#import shared/gathered_force
#ifdef NODE_WORK
#import shared/node_work
#endif

@group(1) @binding(1) var<storage, read> node_mass: array<f32>;
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read_write> node_velocity: array<vec4<f32>>;

// True where a float has the exponent of Inf or NaN.
fn not_finite(v: vec3<f32>) -> bool {
    return any((bitcast<vec3<u32>>(v) & vec3<u32>(0x7f800000u)) == vec3<u32>(0x7f800000u));
}

#ifdef WIDE
var<workgroup> gathered: array<NodeSums, 64>;

fn both(a: NodeSums, b: NodeSums) -> NodeSums {
    return NodeSums(
        a.kinetic + b.kinetic,
        a.damping + b.damping,
        a.work + b.work,
        a.moment_x + b.moment_x,
        a.moment_y + b.moment_y,
        a.moment_z + b.moment_z,
        max(a.max_speed, b.max_speed),
        a.raised_mass + b.raised_mass,
        a.out_of_range + b.out_of_range,
        a.clamped_nodes + b.clamped_nodes,
        a.raised_energy + b.raised_energy,
        a.clamped_energy + b.clamped_energy,
        max(a.step_ratio, b.step_ratio),
        a.half_step + b.half_step,
        0u,
        0u,
    );
}
#endif

@compute @workgroup_size(64)
fn measure_nodes(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
#ifndef WIDE
    if (thread >= MEASURE_THREADS) {
        return;
    }
#endif
    var sums: NodeSums;
    // A wrapped dispatch may have more threads.
    for (var node = thread; node < NODE_COUNT && thread < MEASURE_THREADS; node += MEASURE_THREADS) {
        let u = node_displacement[node];
        let v = node_velocity[node];
        let mass = node_mass[node];
        sums.kinetic += 0.5 * mass * dot(v.xyz, v.xyz);
        sums.half_step -= 0.5 * params.dt * dot(gathered_force(node_place(node)).xyz, v.xyz);
        sums.damping += v.w;
        // Half a step ago, as the work of every other load is booked with the mean of the old and the new velocity.
        let moment = (vec3<f32>(u.xyz) * DISPLACEMENT_UNIT - v.xyz * (0.5 * params.dt)) * mass;
        sums.moment_x += moment.x;
        sums.moment_y += moment.y;
        sums.moment_z += moment.z;
        sums.max_speed = max(sums.max_speed, length(v.xyz));
        let cures = node_cures[node];
        let taken = bitcast<vec2<f32>>(cures.xy);
        sums.raised_energy += taken.x;
        sums.clamped_energy += taken.y;
        sums.raised_mass += cures.z & 0xffffu;
        sums.clamped_nodes += cures.z >> 16u;
        sums.step_ratio = max(sums.step_ratio, bitcast<f32>(cures.w));
        node_cures[node] = vec4<u32>(0u);
        // +-30 mm of the +-31 mm that the fixed point holds.
        let far = any(abs(u.xyz) > vec3<i32>(2061584302));
        sums.out_of_range += select(0u, 1u, far || not_finite(v.xyz));
#ifdef NODE_WORK
        sums.work += node_work[node];
        node_work[node] = 0.0;
#endif
        node_velocity[node] = vec4<f32>(v.xyz, 0.0);
    }
#ifdef WIDE
    let lane = thread % 64u;
    gathered[lane] = sums;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if (lane < half) {
            gathered[lane] = both(gathered[lane], gathered[lane + half]);
        }
        workgroupBarrier();
    }
    if (lane == 0u && thread < MEASURE_THREADS) {
        node_sums[thread / 64u] = gathered[0];
    }
#else
    node_sums[thread] = sums;
#endif
}
