// Stage opening_dilatation: by how much an opened path makes the tetrahedra around it grow, added to their change of volume before nodes average
// it. One thread per cell that the map reaches. Equations: src/needle/opening.rs and CpuEngine::grown_beside.
#import shared/thread_index
#import shared/opening_cell
#import shared/averaged_dilatation

@compute @workgroup_size(64)
fn opening_dilatation(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= opening.counts.z) {
        return;
    }
    // Where nothing was ever cut the map does nothing. A loop, since software adapters walk through an `if`.
    let run = opening.counts.x + near_cells[index].stations.x;
    for (var once = select(1u, 0u, path_stations[run].place.y > 0.0); once == 0u; once++) {
        grow_cell(near_cells[index], path_stations[run]);
    }
}

// `path`: the mean of the sections in it.
fn grow_cell(cell: OpeningCell, path: OpeningStation) {
    let modes = cell_modes(cell.cell.xyz);
    let gradient = deformation_gradient(strain_at(modes, vec3<f32>(0.0), cell.inverse.xyz));
    let middle = across(cell.middle.xyz + modes.mean - path.centre.xyz) / opening.direction.w;
    let dilated = dilated_cell(cell, section_of(path), middle, lateral_edges(gradient, 1.0 / cell.inverse.xyz));
    // V/4 J, of which the buffer holds V/4 (J - 1).
    let share = 0.25 * tetrahedra[cell.cell.x].gradient_b_and_volume.w;
    cell_dilatation[cell.cell.x] += dilated.less_one * (share + cell_dilatation[cell.cell.x]);
}
