// Stage soften_path: a cell that the tip passes keeps 1 - ramp(a) (1 - left) of its stiffness; the energy that
// it loses is booked. One thread per path cell.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/material_point
#ifdef TETRAHEDRA
#import shared/softened_tetrahedron
#else
#import shared/hexahedron_energy
#endif
#import effects/puncture
#import shared/tip_read

#ifndef TETRAHEDRA
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;
#endif

@compute @workgroup_size(64)
fn soften_path(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= puncture.path_cell_count) {
        return;
    }
    let path = path_cells[index];
    let ramp = clamp((tip_state.coordinate - path.axial_start) / max(path.axial_end - path.axial_start, 1e-9), 0.0, 1.0);
    let old = cell_stiffness[path.cell];
#ifdef BORE
    // The core tears off where the tip has cut to.
    let here = tip_state.coordinate >= path.axial_start && tip_state.coordinate < path.axial_end;
    let remaining = select(old, 0.0, here && core_tears(tip_state.coordinate, tip_state.gap));
#else
    let remaining = 1.0 - ramp * (1.0 - path.left);
#endif
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, remaining < old); once == 0u; once++) {
#ifdef TETRAHEDRA
        let energy = softened_energy(path.cell, path.material);
#else
        let layer = CELLS_X * CELLS_Y;
        let k = quotient(path.cell, layer);
        let j = quotient(path.cell - k * layer, CELLS_X);
        let cell = vec3<u32>(path.cell - k * layer - j * CELLS_X, j, k);
        var u: array<vec3<f32>, 8>;
        for (var corner = 0u; corner < 8u; corner++) {
            let node = corner_node(cell, corner);
            // Half a step back: the mean over the step, as the leapfrog work has it.
            u[corner] = vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT
                - node_velocity[node].xyz * (0.5 * params.dt);
        }
        let energy = cell_energy(cell, path.material, 1.0, &u);
#endif
        // What Prony terms hold is booked with their work, which the softening does not touch.
        path_cells[index].dissipation += (old - remaining) * (energy.elastic - energy.held + energy.hourglass);
        cell_stiffness[path.cell] = remaining;
    }
}
