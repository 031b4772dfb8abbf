// The tissue in the window: corners are points on mesh edges, taken where the solver has just left the nodes.
struct View {
    view_projection: mat4x4<f32>,
    // Where the eye is [m].
    eye: vec4<f32>,
    // Low and high end of the field, its lane, 1 where the scale is logarithmic.
    range: vec4<f32>,
    // Colour of what has no field.
    plain: vec4<f32>,
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
    @location(1) field: f32,
}

fn node_place(node: u32) -> vec3<f32> {
    return node_rest[node].xyz + vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT;
}

@vertex
fn tissue_corner(@location(0) nodes: vec2<u32>, @location(1) part: f32) -> TissueCorner {
    var out: TissueCorner;
    out.place = mix(node_place(nodes.x), node_place(nodes.y), part);
    out.clip = view.view_projection * vec4<f32>(out.place, 1.0);
    let lane = u32(view.range.z);
    out.field = mix(drawn_nodes[nodes.x][lane], drawn_nodes[nodes.y][lane], part);
    return out;
}

// 0..1 on the colour scale.
fn on_scale(value: f32) -> f32 {
    let low = view.range.x;
    let high = view.range.y;
    let linear = (value - low) / max(high - low, 1e-30);
    let logarithmic = log(max(value, low) / low) / log(high / low);
    return clamp(select(linear, logarithmic, view.range.w > 0.5), 0.0, 1.0);
}

// The target keeps bytes as they are (the panels blend in them): light to sRGB.
fn encoded(light: vec3<f32>) -> vec4<f32> {
    let low = light * 12.92;
    let high = 1.055 * pow(max(light, vec3<f32>(0.0)), vec3<f32>(1.0 / 2.4)) - 0.055;
    return vec4<f32>(select(high, low, light <= vec3<f32>(0.0031308)), 1.0);
}

// Light from the eye, on both sides of a face.
fn shade(place: vec3<f32>, normal: vec3<f32>) -> f32 {
    let towards = normalize(view.eye.xyz - place);
    return 0.35 + 0.65 * abs(dot(normal, towards));
}

@fragment
fn tissue_colour(corner: TissueCorner) -> @location(0) vec4<f32> {
    let at = on_scale(corner.field) * 255.0;
    let low = u32(at);
    let colour = mix(colour_table[low], colour_table[min(low + 1u, 255u)], at - f32(low));
    let normal = normalize(cross(dpdx(corner.place), dpdy(corner.place)));
    return encoded(colour.rgb * shade(corner.place, normal));
}

struct ToolCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
}

@vertex
fn tool_corner(@location(0) place: vec3<f32>, @location(1) normal: vec3<f32>) -> ToolCorner {
    return ToolCorner(view.view_projection * vec4<f32>(place, 1.0), place, normal);
}

@fragment
fn tool_colour(corner: ToolCorner) -> @location(0) vec4<f32> {
    return encoded(view.plain.rgb * shade(corner.place, normalize(corner.normal)));
}
