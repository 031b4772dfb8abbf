// Beside tissue.wgsl where a scene has labels: surfaces of parts, and a cut, in natural colours. Corners lie in cells.

struct AnatomyCorner {
    @builtin(position) clip: vec4<f32>,
    // At rest: light on what moves little needs no other.
    @location(0) normal: vec3<f32>,
    @location(1) @interpolate(flat) colour: vec3<f32>,
}

@vertex
fn anatomy_corner(
    // At rest [m].
    @location(0) place: vec3<f32>,
    // First node of its cell.
    @location(1) node: u32,
    // Weights of the cell's nodes, in the order of `BlockMesh::cell_nodes`.
    @location(2) lower: vec4<f32>,
    @location(3) upper: vec4<f32>,
    @location(4) normal: vec4<f32>,
    @location(5) colour: vec4<f32>,
) -> AnatomyCorner {
    let row = u32(view.surface.z);
    let layer = node + u32(view.surface.w);
    var moved = lower.x * vec3<f32>(node_displacement[node].xyz);
    moved += lower.y * vec3<f32>(node_displacement[node + 1u].xyz);
    moved += lower.z * vec3<f32>(node_displacement[node + row + 1u].xyz);
    moved += lower.w * vec3<f32>(node_displacement[node + row].xyz);
    moved += upper.x * vec3<f32>(node_displacement[layer].xyz);
    moved += upper.y * vec3<f32>(node_displacement[layer + 1u].xyz);
    moved += upper.z * vec3<f32>(node_displacement[layer + row + 1u].xyz);
    moved += upper.w * vec3<f32>(node_displacement[layer + row].xyz);
    // Weights are rounded to bytes.
    let sum = dot(lower, vec4<f32>(1.0)) + dot(upper, vec4<f32>(1.0));
    var out: AnatomyCorner;
    let at = seen_place(place + moved * (DISPLACEMENT_UNIT / max(sum, 0.01)));
    out.clip = view.view_projection * vec4<f32>(at, 1.0);
    out.normal = normal.xyz;
    out.colour = colour.rgb;
    return out;
}

// Soft light from the eye and a little from above.
fn lit(normal: vec3<f32>) -> f32 {
    let n = normal * inverseSqrt(max(dot(normal, normal), 1e-30));
    return 0.58 + 0.36 * abs(dot(n, view.towards.xyz)) + 0.08 * n.z;
}

@fragment
fn part_colour(corner: AnatomyCorner) -> @location(0) vec4<f32> {
    return vec4<f32>(corner.colour * lit(corner.normal), 1.0);
}

// Organs in which others lie, and where the block ends.
@fragment
fn organ_colour(corner: AnatomyCorner) -> @location(0) vec4<f32> {
    if (!is_drawn(corner.clip, 0.5 + 0.5 * view.surface.x)) {
        discard;
    }
    return vec4<f32>(corner.colour * lit(corner.normal), 1.0);
}

// The surface of the tissue.
@fragment
fn skin_colour(corner: AnatomyCorner) -> @location(0) vec4<f32> {
    if (!is_drawn(corner.clip, view.surface.x)) {
        discard;
    }
    return vec4<f32>(corner.colour * lit(corner.normal), 1.0);
}
