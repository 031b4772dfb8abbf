// Where an anchor of the tip is in a mesh of tetrahedra: its line is cut into the pieces that lie in one of them each.

// Piece of the line of an anchor in one tetrahedron.
struct LinePiece {
    // Corners of the tetrahedron, their barycentric weights where the piece begins, and how these change along the line [1/m].
    nodes: vec4<u32>,
    weights: vec4<f32>,
    slopes: vec4<f32>,
    // Material coordinates at which it begins and ends [m]; z, w unused.
    range: vec4<f32>,
}

// Those of all anchors, of each in the order of its line; an anchor names the first and the end of its own.
@group(1) @binding(15) var<storage, read> line_pieces: array<LinePiece>;

struct AnchorPlace {
    // Nodes around it, and weights of the first three; that of the fourth is what they lack to 1.
    cell: vec4<u32>,
    local: vec3<f32>,
    // Distance of the tip plane beyond it, and its positive part inside the material [m]; d(x.t)/da.
    distance: f32,
    gap: f32,
    stretch: f32,
}

// The last piece that begins at or before `a`, of those from `first` on.
fn piece_at(a: f32, first: u32, end: u32) -> u32 {
    var low = first;
    var high = end;
    while (high - low > 1u) {
        let middle = (low + high) / 2u;
        if (line_pieces[middle].range.x <= a) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// Displacement of a node along `t` [m].
fn along_path(node: u32, t: vec3<f32>) -> f32 {
    return dot(vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT, t);
}

fn place_anchor(anchor: u32, a: f32) -> AnchorPlace {
    let t = step_input.direction.xyz;
    let pieces = tip_anchors[anchor].column;
    let piece = line_pieces[piece_at(a, pieces.x, pieces.y)];
    // Beyond an end of the line as at the end.
    let weights = piece.weights + piece.slopes * (clamp(a, piece.range.x, piece.range.y) - piece.range.x);
    let nodes = piece.nodes;
    let u = vec4<f32>(
        along_path(nodes.x, t), along_path(nodes.y, t), along_path(nodes.z, t), along_path(nodes.w, t),
    );
    var place: AnchorPlace;
    place.cell = nodes;
    place.local = weights.xyz;
    place.distance = step_input.depth - a - dot(weights, u);
    place.gap = select(0.0, max(0.0, place.distance), a < puncture.exit);
    place.stretch = 1.0 + dot(piece.slopes, u);
    return place;
}
