// Points of one station in one cell, as both the stage of their forces and that of their energies read them.
#import shared/opened_point
#import shared/displacement

struct OpeningCluster {
    // Cell, w: index of its material.
    cell: vec4<u32>,
    // First point, end, station; w unused.
    points: vec4<u32>,
    // Low corner of the cell from the entry of the path [m]; its edges [m]. w unused.
    low: vec4<f32>,
    width: vec4<f32>,
}

@group(1) @binding(10) var<storage, read> path_clusters: array<OpeningCluster>;
// Place in the cell, 0..1; w: rest volume [m^3].
@group(1) @binding(11) var<storage, read> path_points: array<vec4<f32>>;
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

// Corners of a cell: displacement of the first one [m] and of all from it.
struct CornerDisplacements {
    first: vec3<f32>,
    from_first: array<vec3<f32>, 8>,
}

fn corner_displacements(cell: vec3<u32>) -> CornerDisplacements {
    var out: CornerDisplacements;
    // In integers: differences stay exact.
    let origin = node_displacement[(cell.z * NODES_Y + cell.y) * NODES_X + cell.x].xyz;
    out.first = vec3<f32>(origin) * DISPLACEMENT_UNIT;
    for (var corner = 0u; corner < 8u; corner++) {
        let at = cell + vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let node = (at.z * NODES_Y + at.y) * NODES_X + at.x;
        out.from_first[corner] = vec3<f32>(node_displacement[node].xyz - origin) * DISPLACEMENT_UNIT;
    }
    return out;
}

// Weight of a corner at a place of the cell, and its gradient [1/m].
struct CornerWeight {
    value: f32,
    gradient: vec3<f32>,
}

fn corner_weight(corner: u32, local: vec3<f32>, width: vec3<f32>) -> CornerWeight {
    let upper = vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u) == vec3<u32>(1u);
    let n = select(1.0 - local, local, upper);
    let d = select(-1.0 / width, 1.0 / width, upper);
    return CornerWeight(n.x * n.y * n.z, d * vec3<f32>(n.y * n.z, n.z * n.x, n.x * n.y));
}
