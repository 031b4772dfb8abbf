//! Draws a picture on the processor, for machines without an adapter. Same four samples per pixel, same blending in
//! linear light as on the device; adapters may place samples and round otherwise, so edges differ slightly.

use super::picture::{Picture, Vertex, encode_srgb};

/// Parts of a pixel to which corners are rounded, as adapters do. Edges are then exact integers, and triangles that
/// share one leave no gap.
const PARTS: i64 = 256;

/// Sample positions within a pixel [parts], those of Vulkan's and Direct3D's standard pattern.
const SAMPLES: [Point; 4] = [[96, 32], [224, 96], [32, 160], [160, 224]];

/// Rows that are drawn together; bounds the memory for large pictures.
const BAND: usize = 64;

/// Four bytes per pixel (sRGB), rows from the top.
pub fn render_on_processor(picture: &Picture) -> Vec<u8> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let mut bytes = Vec::with_capacity(4 * width * height);
    let background = [picture.background[0], picture.background[1], picture.background[2]];
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

/// Corners farther out than this are not drawn [px]; keeps the products of an edge within 64 bits.
const FARTHEST: f32 = 1e6;

/// A place in the picture [parts].
type Point = [i64; 2];

fn rounded(position: [f32; 2]) -> Point {
    position.map(|x| (x * PARTS as f32).round() as i64)
}

/// Twice the signed area of a, b, p.
fn edge(a: Point, b: Point, p: Point) -> i64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// A sample exactly on an edge belongs to the triangle for which this holds: shared edges, which two triangles run
/// through in opposite directions, are drawn once.
fn counts_on_edge(from: Point, to: Point) -> bool {
    to[1] < from[1] || (to[1] == from[1] && to[0] > from[0])
}

/// Draws one triangle into a band of rows.
fn fill(band: &mut [[[f32; 3]; 4]], picture: &Picture, triangle: &[Vertex], top: usize, rows: usize, width: usize) {
    let near = |v: &Vertex| v.position.iter().all(|x| x.abs() <= FARTHEST);
    if !triangle.iter().all(near) {
        return;
    }
    let mut corner = [triangle[0], triangle[1], triangle[2]];
    let columns = pixels(corner.map(|v| v.position[0]), 0, width);
    let lines = pixels(corner.map(|v| v.position[1]), top, top + rows);
    if columns.is_empty() || lines.is_empty() {
        return;
    }
    let mut at = corner.map(|v| rounded(v.position));
    let mut area = edge(at[0], at[1], at[2]);
    if area < 0 {
        corner.swap(0, 2);
        at.swap(0, 2);
        area = -area;
    }
    if area == 0 {
        return;
    }
    let [a, b, c] = at;
    let on_edge = [counts_on_edge(b, c), counts_on_edge(c, a), counts_on_edge(a, b)];
    // An edge function changes by at most this much from the middle of a pixel to its rim.
    let half = PARTS / 2;
    let reach = [(b, c), (c, a), (a, b)].map(|(from, to)| half * ((to[0] - from[0]).abs() + (to[1] - from[1]).abs()));
    let single = single_colour(&corner);
    for row in lines {
        for column in columns.clone() {
            let corner_of_pixel = [column, row].map(|at| at as i64 * PARTS);
            let middle = corner_of_pixel.map(|at| at + half);
            if edge(b, c, middle) < -reach[0] || edge(c, a, middle) < -reach[1] || edge(a, b, middle) < -reach[2] {
                continue;
            }
            let pixel = &mut band[(row - top) * width + column];
            for (sample, offset) in pixel.iter_mut().zip(SAMPLES) {
                let p = [corner_of_pixel[0] + offset[0], corner_of_pixel[1] + offset[1]];
                let weight = [edge(b, c, p), edge(c, a, p), edge(a, b, p)];
                if (0..3).all(|i| weight[i] > 0 || (weight[i] == 0 && on_edge[i])) {
                    let colour = single.unwrap_or_else(|| {
                        let share = weight.map(|w| w as f32 / area as f32);
                        mixed_colour(picture, &corner, share)
                    });
                    for channel in 0..3 {
                        sample[channel] += colour[3] * (colour[channel] - sample[channel]);
                    }
                }
            }
        }
    }
}

/// Pixels within bounds that three coordinates span.
fn pixels(values: [f32; 3], from: usize, to: usize) -> std::ops::Range<usize> {
    let low = values.into_iter().fold(f32::INFINITY, f32::min);
    let high = values.into_iter().fold(f32::NEG_INFINITY, f32::max);
    // One more on each side: rounding may carry a corner over a pixel's edge.
    let first = (low.floor().max(1.0) as usize - 1).max(from);
    let last = ((high.ceil().max(0.0) as usize).saturating_add(1)).min(to);
    first..last
}

/// The colour of a triangle that has only one.
fn single_colour(corner: &[Vertex; 3]) -> Option<[f32; 4]> {
    let plain = corner.iter().all(|v| v.field_weight == 0.0);
    let equal = corner.iter().all(|v| v.colour == corner[0].colour);
    (plain && equal).then_some(corner[0].colour)
}

/// Colour at a point with the given weights of the corners. The same formula as in the shader.
fn mixed_colour(picture: &Picture, corner: &[Vertex; 3], share: [f32; 3]) -> [f32; 4] {
    let [a, b, c] = corner;
    let mean = |values: [f32; 3]| share[0] * values[0] + share[1] * values[1] + share[2] * values[2];
    let field = picture.table_colour(mean([a.field_value, b.field_value, c.field_value]));
    let weight = mean([a.field_weight, b.field_weight, c.field_weight]);
    std::array::from_fn(|i| {
        let plain = mean([a.colour[i], b.colour[i], c.colour[i]]);
        plain + weight * (field[i] - plain)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half-transparent triangles around a point, in both orientations: each sample of their union is drawn once.
    #[test]
    fn shared_edges_are_drawn_once() {
        let vertex = |x: f32, y: f32| Vertex {
            position: [x, y],
            field_value: 0.0,
            field_weight: 0.0,
            colour: [1.0, 1.0, 1.0, 0.5],
        };
        let rim = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (7.3, 20.0), (0.0, 20.0)];
        for (x, y) in [(10.0, 10.0), (3.7, 11.125), (10.375, 0.125), (19.9, 19.9)] {
            let mut vertices = Vec::new();
            for i in 0..rim.len() {
                let (a, b) = (rim[i], rim[(i + 1) % rim.len()]);
                let mut triangle = [vertex(x, y), vertex(a.0, a.1), vertex(b.0, b.1)];
                if i % 2 == 0 {
                    triangle.reverse();
                }
                vertices.extend(triangle);
            }
            let picture = Picture {
                width: 20,
                height: 20,
                background: [0.0, 0.0, 0.0, 1.0],
                colour_table: [[0.0; 4]; 256],
                vertices,
            };
            let once = encode_srgb(0.5);
            for pixel in render_on_processor(&picture).chunks(4) {
                assert_eq!(pixel, [once, once, once, 255], "around {x}, {y}");
            }
        }
    }
}
