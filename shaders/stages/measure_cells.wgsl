// Stage measure_cells: energies, Jacobians and inverted cells; every thread sums over many cells, the host over threads.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/material_point
#import shared/cell_sums
#ifdef TETRAHEDRA
#import shared/measured_tetrahedron
#else
#import shared/measured_hexahedron
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

#ifdef HISTORY
// Adds what the cell reported in this frame and clears it. The work of relaxation is kept: it belongs to the state.
fn book_history(sums: ptr<function, CellSums>, cell: u32, volume: f32, held: f32) {
    let history = read_history(cell);
    (*sums).flow += volume * history.flow;
    (*sums).degradation += volume * history.degradation;
    (*sums).relaxation += volume * history.relaxation_work - held;
    (*sums).failures += history.failures;
    write_history(cell, PointHistory(0.0, 0.0, history.relaxation_work, 0.0));
}
#endif

@compute @workgroup_size(64)
fn measure_cells(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
    if (thread >= MEASURE_THREADS) {
        return;
    }
    var sums: CellSums;
    sums.min_jacobian = 1e30;
    sums.min_corner_jacobian = 1e30;
    sums.least_intact = 1.0;
#ifdef OWN
    var own_sum = vec4<f32>(0.0);
#endif
    for (var index = thread; index < CELL_COUNT; index += MEASURE_THREADS) {
        let cell = measured_cell(index);
        let energy = cell.energy;
        sums.elastic += energy.elastic;
        sums.hourglass += energy.hourglass;
#ifdef HISTORY
        book_history(&sums, index, cell.volume, energy.held);
#endif
#ifdef OWN
        own_sum += cell.volume * take_own_supply(index);
#endif
        sums.least_intact = min(sums.least_intact, select(1.0, energy.intact / cell.kept, cell.kept > 0.0));
        // What has been deleted may be turned inside out; a gap between two copies of a line is no tissue.
        let tissue = cell.volume > 0.0;
        let present = tissue && energy.intact > 0.0;
        sums.overstretched_cells += select(0u, 1u, cell.apart > LARGEST_DIFFERENCE && present);
        sums.deleted_cells += select(0u, 1u, tissue && !present);
        sums.min_jacobian = select(sums.min_jacobian, min(sums.min_jacobian, energy.jacobian), present);
        let smallest = min(sums.min_corner_jacobian, energy.corner_jacobian);
        sums.min_corner_jacobian = select(sums.min_corner_jacobian, smallest, present);
        if (present && !(energy.jacobian > 0.0 && energy.corner_jacobian > 0.0)) {
            sums.inverted_cells += 1u;
            sums.folded_cells += select(0u, 1u, energy.jacobian > 0.0);
            sums.inverted_cell = index;
        }
    }
    cell_sums[thread] = sums;
#ifdef OWN
    tell_own_supply(thread, own_sum);
#endif
}
