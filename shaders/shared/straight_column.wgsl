// A column of cells between straight grid lines. The same functions as in shared/bent_column.

struct StraightColumn {
    x: CellEdge,
    y: CellEdge,
}

alias Column = StraightColumn;

fn column_at(i: u32, j: u32) -> Column {
    return Column(cell_edge(i), cell_edge(CELLS_X + j));
}

// Area [m^2] and its cube root.
fn column_area(column: Column) -> f32 {
    return column.x.length * column.y.length;
}

fn column_cube_root(column: Column) -> f32 {
    return column.x.cube_root * column.y.cube_root;
}

// Derivatives of a displacement along x and y, from its sums over the corners with the signs of xi and of eta.
fn slope_x(column: Column, xi: vec3<f32>, eta: vec3<f32>) -> vec3<f32> {
    return xi * column.x.quarter_inverse;
}

fn slope_y(column: Column, xi: vec3<f32>, eta: vec3<f32>) -> vec3<f32> {
    return eta * column.y.quarter_inverse;
}

// Parts of a stress (its columns along x and y) that pull at the corners with the signs of xi and of eta.
fn pull_xi(column: Column, x: vec3<f32>, y: vec3<f32>) -> vec3<f32> {
    return x * column.x.quarter_inverse;
}

fn pull_eta(column: Column, x: vec3<f32>, y: vec3<f32>) -> vec3<f32> {
    return y * column.y.quarter_inverse;
}

// What a linear field has of the hourglass mode xi eta: nothing between straight lines.
fn tapered(column: Column, H: mat3x3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0);
}

// Pulls at xi and eta that belong to a pull at the mode xi eta.
fn taper_pull_xi(column: Column, q: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn taper_pull_eta(column: Column, q: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0);
}

// J at a corner with the signs `s`, from the differences of displacement along its three edges, the last per length.
fn corner_jacobian(column: Column, s: vec3<f32>, xi: vec3<f32>, eta: vec3<f32>, z: vec3<f32>) -> f32 {
    let x = xi * (4.0 * column.x.quarter_inverse) + vec3<f32>(1.0, 0.0, 0.0);
    let y = eta * (4.0 * column.y.quarter_inverse) + vec3<f32>(0.0, 1.0, 0.0);
    return dot(x, cross(y, z));
}
