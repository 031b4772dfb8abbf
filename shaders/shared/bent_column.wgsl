// A column of cells between lines that are bent around a bore: prisms, bilinear in the plane,
// X = centre + xi E_xi + eta E_eta + xi eta taper. The same functions as in shared/straight_column.

struct BentColumn {
    // An eighth of the gradients of xi (x, y) and of eta (x, y) at the centre [1/m]; zero for a gap.
    gradients: vec4<f32>,
    // [m]
    taper: vec2<f32>,
    // Area [m^2] and its cube root.
    area: f32,
    cube_root: f32,
}

alias Column = BentColumn;

fn column_at(i: u32, j: u32) -> Column {
    // Two vectors per column behind the edges.
    let at = CELLS_X + CELLS_Y + CELLS_Z + 2u * (j * CELLS_X + i);
    let shape = cell_edges[at + 1u];
    return Column(cell_edges[at], shape.xy, shape.z, shape.w);
}

fn column_area(column: Column) -> f32 {
    return column.area;
}

fn column_cube_root(column: Column) -> f32 {
    return column.cube_root;
}

fn slope_x(column: Column, xi: vec3<f32>, eta: vec3<f32>) -> vec3<f32> {
    return xi * column.gradients.x + eta * column.gradients.z;
}

fn slope_y(column: Column, xi: vec3<f32>, eta: vec3<f32>) -> vec3<f32> {
    return xi * column.gradients.y + eta * column.gradients.w;
}

fn pull_xi(column: Column, x: vec3<f32>, y: vec3<f32>) -> vec3<f32> {
    return x * column.gradients.x + y * column.gradients.y;
}

fn pull_eta(column: Column, x: vec3<f32>, y: vec3<f32>) -> vec3<f32> {
    return x * column.gradients.z + y * column.gradients.w;
}

fn tapered(column: Column, H: mat3x3<f32>) -> vec3<f32> {
    return H[0] * column.taper.x + H[1] * column.taper.y;
}

fn taper_pull_xi(column: Column, q: vec3<f32>) -> vec3<f32> {
    return q * (8.0 * dot(column.gradients.xy, column.taper));
}

fn taper_pull_eta(column: Column, q: vec3<f32>) -> vec3<f32> {
    return q * (8.0 * dot(column.gradients.zw, column.taper));
}

fn corner_jacobian(column: Column, s: vec3<f32>, xi: vec3<f32>, eta: vec3<f32>, z: vec3<f32>) -> f32 {
    // Half edges through the centre: the inverse of eight times the gradients.
    let g = column.gradients * 8.0;
    let det = g.x * g.w - g.y * g.z;
    let inverse = select(0.0, 1.0 / det, det != 0.0);
    let edge_xi = vec2<f32>(g.w, -g.z) * inverse + column.taper * s.y;
    let edge_eta = vec2<f32>(-g.y, g.x) * inverse + column.taper * s.x;
    let rest = 4.0 * (edge_xi.x * edge_eta.y - edge_xi.y * edge_eta.x);
    let x = vec3<f32>(2.0 * edge_xi, 0.0) + xi;
    let y = vec3<f32>(2.0 * edge_eta, 0.0) + eta;
    return select(1.0, dot(x, cross(y, z)) / rest, det != 0.0);
}
