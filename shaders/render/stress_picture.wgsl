// Draws the triangles of a picture: a plain colour, a value looked up in the colour table, or a mixture of both.
// All colours are linear; the sRGB target encodes them.

struct Viewport {
    // Width and height of the picture [px].
    size: vec2<f32>,
    _pad: vec2<f32>,
}

@group(0) @binding(0) var<uniform> viewport: Viewport;
@group(0) @binding(1) var<uniform> colour_table: array<vec4<f32>, 256>;

struct Corner {
    @builtin(position) clip_position: vec4<f32>,
    @location(0) colour: vec4<f32>,
    // Position in the colour table, 0..1.
    @location(1) field_value: f32,
    // Share of the table's colour, 0..1.
    @location(2) field_weight: f32,
}

@vertex
fn place_corner(
    @location(0) position: vec2<f32>,
    @location(1) field_value: f32,
    @location(2) field_weight: f32,
    @location(3) colour: vec4<f32>,
) -> Corner {
    let unit = position / viewport.size;
    var corner: Corner;
    corner.clip_position = vec4<f32>(2.0 * unit.x - 1.0, 1.0 - 2.0 * unit.y, 0.0, 1.0);
    corner.colour = colour;
    corner.field_value = field_value;
    corner.field_weight = field_weight;
    return corner;
}

fn table_colour(value: f32) -> vec4<f32> {
    let at = clamp(value, 0.0, 1.0) * 255.0;
    let low = u32(at);
    let high = min(low + 1u, 255u);
    return mix(colour_table[low], colour_table[high], at - f32(low));
}

@fragment
fn colour_pixel(corner: Corner) -> @location(0) vec4<f32> {
    return mix(corner.colour, table_colour(corner.field_value), corner.field_weight);
}
