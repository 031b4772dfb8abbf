// A cell that the map reaches, as both the stage of its forces and that of its energies read it.
#import shared/opening_cluster

struct OpeningCell {
    // Cell, w: index of its material.
    cell: vec4<u32>,
    // First station in it and their number; 1 where points carry no part of it; w unused.
    stations: vec4<u32>,
    // Low corner of the cell from the entry of the path [m]; its edges [m]. w unused.
    low: vec4<f32>,
    width: vec4<f32>,
    // Parts of its octants that points do not carry, in the order of the corners.
    lower: vec4<f32>,
    upper: vec4<f32>,
}

@group(1) @binding(13) var<storage, read> near_cells: array<OpeningCell>;
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

// Gradient of y less the identity at the middle of a cell.
fn middle_gradient(corners: CornerDisplacements, width: vec3<f32>) -> mat3x3<f32> {
    var H = mat3x3<f32>(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    for (var c = 0u; c < 8u; c++) {
        let b = corner_weight(c, vec3<f32>(0.5), width).gradient;
        let u = corners.from_first[c];
        H += mat3x3<f32>(u * b.x, u * b.y, u * b.z);
    }
    return H;
}

// Place of Gauss' rule in octant `at`, 0..1; the middle of the cell beyond the eight.
fn gauss_place(at: u32) -> vec3<f32> {
    let upper = vec3<f32>(vec3<u32>(at & 1u, (at >> 1u) & 1u, at >> 2u)) - 0.5;
    return select(vec3<f32>(0.5) + upper * 0.57735027, vec3<f32>(0.5), at > 7u);
}

// y at a place of the cell, from the middle of the path [m]; `origin`: the first corner.
fn place_in_cell(corners: CornerDisplacements, origin: vec3<f32>, local: vec3<f32>, width: vec3<f32>) -> vec3<f32> {
    var y = origin + local * width;
    for (var c = 0u; c < 8u; c++) {
        y += corners.from_first[c] * corner_weight(c, local, width).value;
    }
    return y;
}

fn share_of(cell: OpeningCell, at: u32) -> f32 {
    return select(cell.upper[at & 3u], cell.lower[at & 3u], at < 4u);
}
