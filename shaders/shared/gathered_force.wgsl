// Sum of the corner forces at a node: x, y, z force [N], w stiffness bound [N/m].
#import shared/node_place
#ifdef TETRAHEDRA
// Forces of cells on their corners, those of one node side by side, filled up with zeros to fours.
@group(2) @binding(2) var<storage, read_write> corner_force: array<vec4<f32>>;

fn gathered_force(place: NodePlace) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    for (var slot = 4u * place.first_four; slot < 4u * place.end_four; slot += 4u) {
        sum += (corner_force[slot] + corner_force[slot + 1u]) + (corner_force[slot + 2u] + corner_force[slot + 3u]);
    }
    return sum;
}
#else
#import shared/corner_force

fn gathered_force(place: NodePlace) -> vec4<f32> {
    // One strip, or two where the node lies on the plane between them.
    let k = place.k;
    let above = quotient(k, STRIP_LAYERS);
    let last = min(above, STRIP_COUNT - 1u);
    let first = select(last, above - 1u, k > 0u && above * STRIP_LAYERS == k);
    let stride = PADDED_COLUMNS;
    let row = CELLS_X + 2u;
    let column = padded_column(place.i, place.j);
    var sum = vec4<f32>(0.0);
    for (var strip = first; strip <= last; strip++) {
        let slot = corner_slot(strip, k - strip * STRIP_LAYERS, 0u, column);
        sum += corner_force[slot] + corner_force[slot + stride - 1u]
            + corner_force[slot + 2u * stride - row] + corner_force[slot + 3u * stride - row - 1u];
    }
    return sum;
}
#endif
