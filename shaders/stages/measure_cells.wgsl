// Stage measure_cells: energies, Jacobians and inverted cells; every thread sums over many cells, the host over threads.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/cell_edge
#import shared/mooney_rivlin
#import shared/cell_energy
#import shared/cell_sums
#ifdef PUNCTURE
#import effects/puncture
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

@compute @workgroup_size(64)
fn measure_cells(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
    if (thread >= params.measure_threads) {
        return;
    }
    let layer = params.cells_x * params.cells_y;
    let count = layer * params.cells_z;
    var sums: CellSums;
    sums.min_jacobian = 1e30;
    sums.min_corner_jacobian = 1e30;
    for (var index = thread; index < count; index += params.measure_threads) {
        let k = quotient(index, layer);
        let j = quotient(index - k * layer, params.cells_x);
        let cell = vec3<u32>(index - k * layer - j * params.cells_x, j, k);
        var u: array<vec3<f32>, 8>;
        // Relative to the first corner in integers: differences stay exact.
        let origin = node_displacement[corner_node(cell, 0u)].xyz;
        for (var corner = 0u; corner < 8u; corner++) {
            u[corner] = vec3<f32>(node_displacement[corner_node(cell, corner)].xyz - origin) * DISPLACEMENT_UNIT;
        }
        var apart = vec3<f32>(0.0);
        for (var corner = 1u; corner < 8u; corner++) {
            apart = max(apart, abs(u[corner]));
        }
        sums.overstretched_cells += select(0u, 1u, max(apart.x, max(apart.y, apart.z)) > LARGEST_DIFFERENCE);
        var energy = cell_energy(cell, &u);
#ifdef PUNCTURE
        energy.elastic *= cell_stiffness[index];
        energy.hourglass *= cell_stiffness[index];
#endif
        sums.elastic += energy.elastic;
        sums.hourglass += energy.hourglass;
        sums.min_jacobian = min(sums.min_jacobian, energy.jacobian);
        sums.min_corner_jacobian = min(sums.min_corner_jacobian, energy.corner_jacobian);
        if (!(energy.jacobian > 0.0 && energy.corner_jacobian > 0.0)) {
            sums.inverted_cells += 1u;
            sums.inverted_cell = index;
        }
    }
    cell_sums[thread] = sums;
}
