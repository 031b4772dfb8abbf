// Stage measure_relaxation: energy beside the path where nothing has relaxed, sum by sum: stage relax_path reads what belongs to a section.
#import shared/thread_index
#import shared/opened_energy

@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;

// One thread per cluster, then one per cell.
@compute @workgroup_size(64)
fn measure_relaxation(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
    if (thread < opening.counts.y) {
        let cluster = path_clusters[thread];
        let modes = cell_modes(cluster.cell.xyz);
        var told = 0.0;
        for (var i = cluster.points.x; i < opened_end(cluster.points.xy); i++) {
            let point = path_points[i];
            told += energy_of_point(cluster, modes, point);
            for (var once = select(0u, 1u, point.numbers.z == 0u); once == 0u; once++) {
                opening_sums[point.numbers.y].by_moment.w = told;
                told = 0.0;
            }
        }
    } else if (thread < opening.counts.y + opening.counts.z) {
        let index = thread - opening.counts.y;
        let cell = near_cells[index];
        let mean = path_stations[opening.counts.x + cell.stations.x];
        var energy = 0.0;
        for (var once = select(1u, 0u, mean.centre.w > 0.0); once == 0u; once++) {
            let modes = cell_modes(cell.cell.xyz);
            energy = energy_of_shape(cell, mean, modes, strain_at(modes, vec3<f32>(0.0), cell.inverse.xyz));
        }
        opening_sums[opening.sums.w + index].by_moment.w = energy;
    }
}
