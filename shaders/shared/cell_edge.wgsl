// One edge of the rectilinear grid: length d [m], d^(1/3) [m^(1/3)], 1/(4 d) [1/m].
struct CellEdge {
    length: f32,
    cube_root: f32,
    quarter_inverse: f32,
    _pad: f32,
}

// Edges along x, then y, then z, one vec4 each, and what a bent grid adds per column: loads member by member are slow on
// software adapters.
@group(1) @binding(0) var<storage, read> cell_edges: array<vec4<f32>>;

fn cell_edge(at: u32) -> CellEdge {
    let edge = cell_edges[at];
    return CellEdge(edge.x, edge.y, edge.z, edge.w);
}

fn layer_edge(k: u32) -> CellEdge {
    return cell_edge(CELLS_X + CELLS_Y + k);
}

// Floor of the squared size of a cell [m^2], so that a gap between two copies of a line, which has none, divides by no zero.
const SMALLEST_SQUARE: f32 = 1e-12;

#ifdef BORE
#import shared/bent_column
#else
#import shared/straight_column
#endif
