// Stage measure_cells: energies, Jacobians and inverted cells; every thread sums over many cells, the host over threads, or over
// workgroups where the adapter has many lanes.
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

#ifdef WIDE
var<workgroup> gathered: array<CellSums, 64>;

fn both(a: CellSums, b: CellSums) -> CellSums {
    return CellSums(
        a.elastic + b.elastic,
        a.hourglass + b.hourglass,
        min(a.min_jacobian, b.min_jacobian),
        min(a.min_corner_jacobian, b.min_corner_jacobian),
        a.inverted_cells + b.inverted_cells,
        select(a.inverted_cell, b.inverted_cell, b.inverted_cells > 0u),
        a.overstretched_cells + b.overstretched_cells,
        a.deleted_cells + b.deleted_cells,
        a.flow + b.flow,
        a.degradation + b.degradation,
        a.relaxation + b.relaxation,
        min(a.least_intact, b.least_intact),
        a.failures + b.failures,
        a.folded_cells + b.folded_cells,
        0u,
        0u,
    );
}
#endif

@compute @workgroup_size(64)
fn measure_cells(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
#ifndef WIDE
    if (thread >= MEASURE_THREADS) {
        return;
    }
#endif
    var sums: CellSums;
    sums.min_jacobian = 1e30;
    sums.min_corner_jacobian = 1e30;
    sums.least_intact = 1.0;
#ifdef OWN
    var own_sum = vec4<f32>(0.0);
#endif
    // A wrapped dispatch may have more threads.
    for (var index = thread; index < CELL_COUNT && thread < MEASURE_THREADS; index += MEASURE_THREADS) {
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
        cell_sums[thread / 64u] = gathered[0];
    }
#else
    cell_sums[thread] = sums;
#endif
#ifdef OWN
    if (thread < MEASURE_THREADS) {
        tell_own_supply(thread, own_sum);
    }
#endif
}
