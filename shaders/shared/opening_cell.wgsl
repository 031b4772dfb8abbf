// A cell that the map reaches, as both the stage of its forces and that of its energies read it.
#import shared/opening_cluster

struct OpeningCell {
    // Cell, of tetrahedra its number; w: index of its material.
    cell: vec4<u32>,
    // Run of cells that it is of; the others unused.
    stations: vec4<u32>,
    // Middle of the cell from the entry of the path [m]; one over its edges [1/m]. w: mean and variance of the growth, over rc^2 [R].
    middle: vec4<f32>,
    inverse: vec4<f32>,
    // Middle of what points do not carry, from the middle of the cell in edges; w: part of the volume.
    place: vec4<f32>,
}

@group(1) @binding(23) var<storage, read> near_cells: array<OpeningCell>;

// What an opened path makes of the volume of a cell, over that with the closed path, less one; derivatives by place and radius, and the moment of
// the former about the middle of the cell, in edges.
struct Dilated {
    less_one: f32,
    rates: vec4<f32>,
    moments: mat3x3<f32>,
}

// `middle`: of the cell from that of the path, across it [R]; `lateral`: by what that changes along the edges of the cell [R].
fn dilated_cell(cell: OpeningCell, section: PathSection, middle: vec3<f32>, lateral: mat3x3<f32>) -> Dilated {
    var out: Dilated;
    for (var i = 0u; i < 4u; i++) {
        let p = volume_place(cell.cell.xyz, i);
        let eta = middle + lateral * p;
        let d = dilation(section, dot(eta, eta));
        let by_place = eta * (2.0 * d.y);
        out.less_one += 0.25 * (d.x - 1.0);
        out.rates += vec4<f32>(by_place, d.z);
        out.moments += outer(by_place, p);
    }
    // What grows near the path.
    out.less_one += section.radius * section.radius * cell.middle.w;
    return out;
}

// By what a place across the path changes along the edges of a cell [R].
fn lateral_edges(gradient: mat3x3<f32>, width: vec3<f32>) -> mat3x3<f32> {
    let scale = 1.0 / opening.direction.w;
    return mat3x3<f32>(
        across(gradient[0]) * (width.x * scale),
        across(gradient[1]) * (width.y * scale),
        across(gradient[2]) * (width.z * scale),
    );
}
