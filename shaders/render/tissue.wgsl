// The tissue in the window: corners are points on mesh edges, taken where the solver has just left the nodes.
struct View {
    view_projection: mat4x4<f32>,
    // Direction from the middle of the view to the eye; w unused.
    towards: vec4<f32>,
    // Low and high end of the field, its lane, 1 where the scale is logarithmic.
    range: vec4<f32>,
    // How much of the tissue's surface, and of layers that are seen through, is drawn, 0..1; nodes from
    // row to row and from layer to layer of a block with labels.
    surface: vec4<f32>,
    // Its path is opened beside it.
    needle: DrawnNeedle,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> colour_table: array<vec4<f32>, 256>;
// Displacement in fixed point, 2^-36 m; rest position [m]; von Mises stress, pressure [Pa], stretch, stiffness left.
@group(0) @binding(2) var<storage, read> node_displacement: array<vec4<i32>>;
@group(0) @binding(3) var<storage, read> node_rest: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> drawn_nodes: array<vec4<f32>>;

const DISPLACEMENT_UNIT: f32 = 1.4551915228366852e-11;

struct TissueCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec3<f32>,
    // Place on the colour scale, 0..1.
    @location(1) field: f32,
}

fn node_place(node: u32) -> vec3<f32> {
    return node_rest[node].xyz + vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT;
}

// Where tissue is seen that is at `y` with its path closed [m].
fn seen_place(y: vec3<f32>) -> vec3<f32> {
    return y + pushed_aside(view.needle, beside_axis(view.needle, y));
}

// 0..1 on the colour scale.
fn on_scale(value: f32) -> f32 {
    let low = view.range.x;
    let high = view.range.y;
    let linear = (value - low) / max(high - low, 1e-30);
    let logarithmic = log(max(value, low) / low) / log(high / low);
    return clamp(select(linear, logarithmic, view.range.w > 0.5), 0.0, 1.0);
}

// The field that is shown, at a node. The last lane is what of the stiffness is left; damage is what is gone.
fn node_field(node: u32) -> f32 {
    let lane = u32(view.range.z);
    let value = drawn_nodes[node][lane];
    return select(value, 1.0 - value, lane == 3u);
}

fn placed_corner(nodes: vec2<u32>, part: f32, value: f32) -> TissueCorner {
    var out: TissueCorner;
    out.place = seen_place(mix(node_place(nodes.x), node_place(nodes.y), part));
    out.clip = view.view_projection * vec4<f32>(out.place, 1.0);
    // On the scale already here: a software adapter pays for every pixel.
    out.field = on_scale(value);
    return out;
}

@vertex
fn tissue_corner(@location(0) nodes: vec2<u32>, @location(1) part: f32) -> TissueCorner {
    return placed_corner(nodes, part, mix(node_field(nodes.x), node_field(nodes.y), part));
}

// Light from the direction of the eye, on both sides of a face; a factor on bytes as the target keeps them (sRGB), which spares every
// pixel three powers. `normal` of any length.
fn shade(normal: vec3<f32>) -> f32 {
    return 0.35 + 0.65 * abs(dot(normal, view.towards.xyz)) * inverseSqrt(max(dot(normal, normal), 1e-30));
}

@fragment
fn tissue_colour(corner: TissueCorner) -> @location(0) vec4<f32> {
    let colour = colour_table[u32(corner.field * 255.0 + 0.5)];
    let normal = cross(dpdx(corner.place), dpdy(corner.place));
    return vec4<f32>(colour.rgb * shade(normal), 1.0);
}

// Whether a pixel of a surface is drawn of which `part` is to be seen: a screen door of 4 x 4 pixels [Bayer1973]. Nothing has to be
// sorted, and what is seen through is sharp.
fn is_drawn(clip: vec4<f32>, part: f32) -> bool {
    let at = vec2<u32>(clip.xy) & vec2<u32>(3u);
    let mixed = at.x ^ at.y;
    let rank = ((mixed & 1u) << 3u) | ((at.y & 1u) << 2u) | (mixed & 2u) | (at.y >> 1u);
    return (f32(rank) + 0.5) / 16.0 < part;
}

fn veiled(corner: TissueCorner, part: f32) -> vec4<f32> {
    let normal = cross(dpdx(corner.place), dpdy(corner.place));
    if (!is_drawn(corner.clip, part)) {
        discard;
    }
    let colour = colour_table[u32(corner.field * 255.0 + 0.5)];
    return vec4<f32>(colour.rgb * shade(normal), 1.0);
}

// The surface where it is seen through; the faces of a cut stay whole.
@fragment
fn veil_colour(corner: TissueCorner) -> @location(0) vec4<f32> {
    return veiled(corner, view.surface.x);
}

// A layer that is seen through, its cut faces too.
@fragment
fn layer_colour(corner: TissueCorner) -> @location(0) vec4<f32> {
    return veiled(corner, view.surface.y);
}

// Behind everything, three corners that cover the view.
@vertex
fn backdrop_corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 1.0, 1.0);
}

@fragment
fn backdrop_colour() -> @location(0) vec4<f32> {
    return vec4<f32>(0.12, 0.13, 0.15, 1.0);
}

struct ToolCorner {
    @builtin(position) clip: vec4<f32>,
    @location(1) normal: vec3<f32>,
    // In w how much of it is drawn.
    @location(2) colour: vec4<f32>,
}

@vertex
fn tool_corner(
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) colour: vec4<f32>,
) -> ToolCorner {
    return ToolCorner(view.view_projection * vec4<f32>(place, 1.0), normal, colour);
}

@fragment
fn tool_colour(corner: ToolCorner) -> @location(0) vec4<f32> {
    if (!is_drawn(corner.clip, corner.colour.w)) {
        discard;
    }
    return vec4<f32>(corner.colour.rgb * shade(corner.normal), 1.0);
}
