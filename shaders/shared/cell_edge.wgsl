// One edge of the rectilinear grid: length d [m], d^(1/3) [m^(1/3)], 1/(4 d) [1/m].
struct CellEdge {
    length: f32,
    cube_root: f32,
    quarter_inverse: f32,
    _pad: f32,
}

// Floor of the squared size of a cell [m^2], so that a gap between two copies of a line, which has none, divides by no zero.
const SMALLEST_SQUARE: f32 = 1e-12;

#ifdef BORE
#import shared/bent_column
#else
#import shared/straight_column
#endif
