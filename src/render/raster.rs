//! Draws a picture on the processor, for machines without an adapter. Same four samples per pixel, same blending in
//! linear light as on the device; adapters may place samples and round otherwise, so edges differ slightly.

use super::picture::{Picture, Vertex, encode_srgb};

/// Sample positions within a pixel, those of Vulkan's and Direct3D's standard pattern.
const SAMPLES: [[f32; 2]; 4] = [
    [0.375, 0.125],
    [0.875, 0.375],
    [0.125, 0.625],
    [0.625, 0.875],
];

/// Rows that are drawn together; bounds the memory for large pictures.
const BAND: usize = 64;

/// Four bytes per pixel (sRGB), rows from the top.
pub fn render_on_processor(picture: &Picture) -> Vec<u8> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let mut bytes = Vec::with_capacity(4 * width * height);
    let background = [
        picture.background[0],
        picture.background[1],
        picture.background[2],
    ];
    for top in (0..height).step_by(BAND) {
        let rows = BAND.min(height - top);
        let mut band = vec![[background; SAMPLES.len()]; width * rows];
        for triangle in picture.vertices.chunks_exact(3) {
            fill(&mut band, picture, triangle, top, rows, width);
        }
        for pixel in band {
            for channel in 0..3 {
                let sum: f32 = pixel.iter().map(|sample| sample[channel]).sum();
                bytes.push(encode_srgb(sum / SAMPLES.len() as f32));
            }
            bytes.push(255);
        }
    }
    bytes
}

/// Twice the signed area of a, b, p.
fn edge(a: [f32; 2], b: [f32; 2], p: [f32; 2]) -> f32 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// Draws one triangle into a band of rows.
fn fill(
    band: &mut [[[f32; 3]; 4]],
    picture: &Picture,
    triangle: &[Vertex],
    top: usize,
    rows: usize,
    width: usize,
) {
    let [mut a, b, mut c] = [triangle[0], triangle[1], triangle[2]];
    let (left, right) = span([a, b, c].map(|v| v.position[0]));
    let (upper, lower) = span([a, b, c].map(|v| v.position[1]));
    if lower < top as f32 || upper > (top + rows) as f32 {
        return;
    }
    let mut area = edge(a.position, b.position, c.position);
    if area < 0.0 {
        std::mem::swap(&mut a, &mut c);
        area = -area;
    }
    // Written so that NaN counts as empty.
    if !(area > 0.0) {
        return;
    }
    let first_row = (upper.floor().max(0.0) as usize).max(top);
    let last_row = (lower.ceil().max(0.0) as usize).min(top + rows);
    let first_column = left.floor().max(0.0) as usize;
    let last_column = (right.ceil().max(0.0) as usize).min(width);
    // A sample exactly on an edge belongs to the triangle whose edge is a top or left one: shared edges are drawn once.
    let counts_on_edge = |from: Vertex, to: Vertex| {
        let (dx, dy) = (
            to.position[0] - from.position[0],
            to.position[1] - from.position[1],
        );
        dy < 0.0 || (dy == 0.0 && dx > 0.0)
    };
    let on_edge = [
        counts_on_edge(b, c),
        counts_on_edge(c, a),
        counts_on_edge(a, b),
    ];
    for row in first_row..last_row {
        for column in first_column..last_column {
            let pixel = &mut band[(row - top) * width + column];
            for (sample, offset) in pixel.iter_mut().zip(SAMPLES) {
                let p = [column as f32 + offset[0], row as f32 + offset[1]];
                let weight = [
                    edge(b.position, c.position, p),
                    edge(c.position, a.position, p),
                    edge(a.position, b.position, p),
                ];
                let inside = (0..3).all(|i| weight[i] > 0.0 || (weight[i] == 0.0 && on_edge[i]));
                if !inside {
                    continue;
                }
                let mean = |value: fn(&Vertex) -> f32| {
                    (weight[0] * value(&a) + weight[1] * value(&b) + weight[2] * value(&c)) / area
                };
                let field = picture.table_colour(mean(|v| v.field_value));
                let share = mean(|v| v.field_weight);
                let colour: [f32; 4] = [
                    mean(|v| v.colour[0]),
                    mean(|v| v.colour[1]),
                    mean(|v| v.colour[2]),
                    mean(|v| v.colour[3]),
                ];
                let alpha = colour[3] + share * (field[3] - colour[3]);
                for channel in 0..3 {
                    let source = colour[channel] + share * (field[channel] - colour[channel]);
                    sample[channel] += alpha * (source - sample[channel]);
                }
            }
        }
    }
}

fn span(values: [f32; 3]) -> (f32, f32) {
    (
        values[0].min(values[1]).min(values[2]),
        values[0].max(values[1]).max(values[2]),
    )
}
