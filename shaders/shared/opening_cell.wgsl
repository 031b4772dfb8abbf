// A cell that the map reaches, as both the stage of its forces and that of its energies read it.
#import shared/opening_cluster

struct OpeningCell {
    // Cell, w: index of its material.
    cell: vec4<u32>,
    // First station in it and their number; places at which it is taken, first and end: octants, or its middle (8).
    stations: vec4<u32>,
    // Middle of the cell from the entry of the path [m]; one over its edges [1/m]. w unused.
    middle: vec4<f32>,
    inverse: vec4<f32>,
    // Parts of its octants that points do not carry, in the order of the corners.
    lower: vec4<f32>,
    upper: vec4<f32>,
}

@group(1) @binding(23) var<storage, read> near_cells: array<OpeningCell>;
@group(3) @binding(20) var<storage, read> path_stations: array<OpeningStation>;

// Mean of the stations in a cell; w of the middle: radius [m].
struct OpeningMean {
    middle: vec4<f32>,
    rate: vec4<f32>,
}

fn mean_of_stations(first: u32, count: u32) -> OpeningMean {
    var mean = OpeningMean(vec4<f32>(0.0), vec4<f32>(0.0));
    for (var i = first; i < first + count; i++) {
        mean.middle += path_stations[i].centre;
        mean.rate += path_stations[i].centre_rate;
    }
    let by = 1.0 / f32(count);
    return OpeningMean(mean.middle * by, mean.rate * by);
}

// Place of Gauss' rule in octant `at` from the middle of the cell, -1/2..1/2; the middle beyond the eight.
fn gauss_place(at: u32) -> vec3<f32> {
    let signs = vec3<f32>(vec3<u32>(at & 1u, (at >> 1u) & 1u, at >> 2u)) * 2.0 - 1.0;
    return select(signs * 0.28867513, vec3<f32>(0.0), at > 7u);
}

fn share_of(cell: OpeningCell, at: u32) -> f32 {
    return select(cell.upper[at & 3u], cell.lower[at & 3u], at < 4u);
}
