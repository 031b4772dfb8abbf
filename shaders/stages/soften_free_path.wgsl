// Stage soften_free_path: sample points that the tip of a free path has passed are marked; a cell keeps
// residual^(marked/64) of its stiffness, and the energy that it loses is booked. One thread per cell of the box.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/material_point
#import shared/hexahedron_energy
#import effects/puncture
#import effects/free_path

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;

// Marks of the samples number `first .. first + 32` that lie behind the tip within the softened radius.
fn samples_behind(low: vec3<f32>, size: vec3<f32>, first: u32) -> u32 {
    let T = free_tip.along.xyz;
    let a0 = puncture.softened_radius;
    var marks = 0u;
    for (var bit = first; bit < first + 32u; bit++) {
        let part = vec3<f32>(vec3<u32>(bit & 3u, (bit >> 2u) & 3u, bit >> 4u));
        let relative = low + (part + 0.5) / SAMPLES * size;
        let ahead = dot(relative, T);
        let square = dot(relative, relative) - ahead * ahead;
        let behind = ahead <= 0.0 && ahead > -MARKED_BEHIND * a0 && square < a0 * a0;
        marks |= select(0u, 1u, behind) << (bit & 31u);
    }
    return marks;
}

@compute @workgroup_size(64)
fn soften_free_path(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= puncture.path_cell_count) {
        return;
    }
    let low = free_cells[index].low.xyz - free_tip.place.xyz;
    let size = free_cells[index].size.xyz;
    let middle = low + 0.5 * size;
    let a0 = puncture.softened_radius;
    let reach = a0 * sqrt(1.0 + MARKED_BEHIND * MARKED_BEHIND) + 0.5 * length(size);
    let near = free_tip.advance > 0.0 && dot(middle, middle) <= reach * reach;
    // Loops that run once or not at all: software adapters skip them, where they would walk through an `if`.
    for (var once = select(1u, 0u, near); once == 0u; once++) {
        let marked_low = free_cells[index].marked_low | samples_behind(low, size, 0u);
        let marked_high = free_cells[index].marked_high | samples_behind(low, size, 32u);
        free_cells[index].marked_low = marked_low;
        free_cells[index].marked_high = marked_high;
        let fraction = f32(countOneBits(marked_low) + countOneBits(marked_high)) / 64.0;
        let number = free_cells[index].cell;
        let old = cell_stiffness[number];
        // A plane of samples is passed at once; the stiffness follows at a bounded rate.
        let slowly = old - SOFTENING_RATE * free_tip.advance / min(size.x, min(size.y, size.z));
        let remaining = max(pow(puncture.residual_stiffness, fraction), slowly);
        for (var again = select(1u, 0u, remaining < old); again == 0u; again++) {
            let layer = CELLS_X * CELLS_Y;
            let k = quotient(number, layer);
            let j = quotient(number - k * layer, CELLS_X);
            let cell = vec3<u32>(number - k * layer - j * CELLS_X, j, k);
            var u: array<vec3<f32>, 8>;
            for (var corner = 0u; corner < 8u; corner++) {
                let node = corner_node(cell, corner);
                // Half a step back: the mean over the step, as the leapfrog work has it.
                u[corner] = vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT
                    - node_velocity[node].xyz * (0.5 * params.dt);
            }
            let energy = cell_energy(cell, free_cells[index].material, 1.0, &u);
            // What Prony terms hold is booked with their work, which the softening does not touch.
            free_cells[index].dissipation += (old - remaining) * (energy.elastic - energy.held + energy.hourglass);
            cell_stiffness[number] = remaining;
        }
    }
}
