// Beside tissue.wgsl where faces may part: how far they have. A node lies on both sides in copies.

// The other copies of a node; itself where there are fewer than four.
@group(0) @binding(5) var<storage, read> node_copies: array<vec4<u32>>;

// Largest distance to another copy [m].
fn opening(node: u32) -> f32 {
    let copies = node_copies[node];
    let here = node_displacement[node].xyz;
    var largest = 0.0;
    for (var n = 0u; n < 4u; n++) {
        let way = vec3<f32>(node_displacement[copies[n]].xyz - here) * DISPLACEMENT_UNIT;
        largest = max(largest, length(way));
    }
    return largest;
}

@vertex
fn parted_corner(@location(0) nodes: vec2<u32>, @location(1) part: f32) -> TissueCorner {
    let lane = u32(view.range.z);
    if (lane < 4u) {
        return placed_corner(nodes, part, mix(node_field(nodes.x), node_field(nodes.y), part));
    }
    return placed_corner(nodes, part, mix(opening(nodes.x), opening(nodes.y), part));
}
