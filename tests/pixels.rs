//! What the panels look like, pixel by pixel: a rasteriser of egui's triangles without any adapter, and the comparison with kept pictures.
//!
//! Vertices are rounded to parts of a pixel and all blending is done in bytes, so that every machine draws the same.
#![cfg(feature = "window")]

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use egui::epaint::{ClippedPrimitive, Primitive, Vertex};
use egui::{ColorImage, ImageData, TextureFilter, TextureId, TexturesDelta};
use egui_kittest::TestRenderer;

/// Parts of a pixel to which vertices are rounded, as adapters do.
const SUBPIXELS: i64 = 256;
/// Vertices farther out than this are moved there [px]; keeps the products of an edge within 64 bits.
const FARTHEST: f32 = 1e6;

/// Steps of a channel, out of 255, up to which two pixels count as equal.
const TOLERANCE: u8 = 24;
/// Pixels of a picture that may differ. Two runs differ in none; the smallest change that is to be found, another digit in a picture
/// that was reduced, in 5.
const MOST_DIFFERENT: usize = 3;

/// Writes the pictures anew.
const UPDATE: &str = "UPDATE_PICTURES";

/// Three bytes per pixel, rows from the top.
#[derive(Clone, PartialEq)]
pub struct Pixels {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<[u8; 3]>,
}

type Texture = (ColorImage, TextureFilter);

/// The textures of a harness: letters, and pictures that panels show.
#[derive(Clone, Default)]
pub struct Textures(Arc<Mutex<HashMap<TextureId, Texture>>>);

impl TestRenderer for Textures {
    fn handle_delta(&mut self, delta: &mut TexturesDelta) {
        let mut textures = self.0.lock().unwrap();
        for (id, changes) in delta.set.drain() {
            for change in changes {
                let ImageData::Color(image) = &change.image;
                let Some([left, top]) = change.pos else {
                    textures.insert(id, (ColorImage::clone(image), change.options.magnification));
                    continue;
                };
                let (whole, _) = textures.get_mut(&id).expect("a part of a texture comes behind the whole");
                let (width, part) = (whole.width(), image.width());
                for (row, pixels) in image.pixels.chunks_exact(part).enumerate() {
                    whole.pixels[(top + row) * width + left..][..part].copy_from_slice(pixels);
                }
            }
        }
        delta.clear();
    }
}

/// A place in the picture [subpixels].
type Point = [i64; 2];

/// Twice the signed area of a, b, p.
fn edge(a: Point, b: Point, p: Point) -> i64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// A pixel whose centre lies exactly on an edge belongs to the triangle for which this holds: triangles that share an edge run through it
/// in opposite directions, and nothing is blended twice.
fn counts_on_edge(from: Point, to: Point) -> bool {
    to[1] < from[1] || (to[1] == from[1] && to[0] > from[0])
}

/// Colour of a texture, premultiplied; between its pixels where it is drawn smoothly.
fn texel((image, filter): &Texture, u: f32, v: f32) -> [f32; 4] {
    let at = |x: f32, y: f32| {
        let inside = |value: f32, size: usize| value.clamp(0.0, (size - 1) as f32) as usize;
        image.pixels[inside(y, image.height()) * image.width() + inside(x, image.width())].to_array().map(f32::from)
    };
    let (x, y) = (u * image.width() as f32, v * image.height() as f32);
    if *filter == TextureFilter::Nearest {
        return at(x.floor(), y.floor());
    }
    let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
    let (across, down) = (x - 0.5 - left, y - 0.5 - top);
    let mix = |a: [f32; 4], b: [f32; 4], t: f32| std::array::from_fn(|n| a[n] + (b[n] - a[n]) * t);
    let row = |y: f32| mix(at(left, y), at(left + 1.0, y), across);
    mix(row(top), row(top + 1.0), down)
}

impl Pixels {
    /// A picture of one colour.
    fn plain([width, height]: [usize; 2], colour: [u8; 3]) -> Self {
        Pixels { width, height, rgb: vec![colour; width * height] }
    }

    /// Draws what a harness shows now.
    pub fn of<S>(harness: &egui_kittest::Harness<'_, S>, textures: &Textures, size: [usize; 2]) -> Self {
        let scale = harness.ctx.pixels_per_point();
        let [r, g, b, _] = harness.ctx.global_style().visuals.panel_fill.to_array();
        let mut pixels = Pixels::plain(size, [r, g, b]);
        let textures = textures.0.lock().unwrap();
        for ClippedPrimitive { clip_rect, primitive } in harness.ctx.tessellate(harness.output().shapes.clone(), scale)
        {
            let Primitive::Mesh(mesh) = primitive else { continue };
            let clip = [clip_rect.min.x, clip_rect.min.y, clip_rect.max.x, clip_rect.max.y]
                .map(|x| (x * scale).round() as i64);
            for corners in mesh.indices.chunks_exact(3) {
                let corners = [0, 1, 2].map(|n| mesh.vertices[corners[n] as usize]);
                pixels.fill(clip, corners, scale, &textures[&mesh.texture_id]);
            }
        }
        pixels
    }

    fn fill(&mut self, clip: [i64; 4], mut corners: [Vertex; 3], scale: f32, texture: &Texture) {
        let place = |v: &Vertex| {
            [v.pos.x, v.pos.y].map(|x| ((x * scale).clamp(-FARTHEST, FARTHEST) * SUBPIXELS as f32).round() as i64)
        };
        let [a, b, c] = corners.each_ref().map(place);
        if edge(a, b, c) < 0 {
            corners.swap(1, 2);
        }
        let [a, b, c] = corners.each_ref().map(place);
        let area = edge(a, b, c);
        if area == 0 {
            return;
        }
        let edges = [(b, c), (c, a), (a, b)].map(|(from, to)| (from, to, counts_on_edge(from, to)));
        let ends = |axis: usize, size: usize| {
            let (low, high) = (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
            let (low, high) = (low.div_euclid(SUBPIXELS), high.div_euclid(SUBPIXELS) + 1);
            low.max(clip[axis]).max(0)..high.min(clip[axis + 2]).min(size as i64)
        };
        let colours = corners.each_ref().map(|v| v.color.to_array().map(f32::from));
        for y in ends(1, self.height) {
            for x in ends(0, self.width) {
                let centre = [x * SUBPIXELS + SUBPIXELS / 2, y * SUBPIXELS + SUBPIXELS / 2];
                let weights = edges.map(|(from, to, counts)| {
                    let weight = edge(from, to, centre);
                    if weight == 0 && !counts { -1 } else { weight }
                });
                if weights.iter().any(|weight| *weight < 0) {
                    continue;
                }
                let part = weights.map(|weight| weight as f32 / area as f32);
                let mixed = |values: [f32; 3]| part[0] * values[0] + part[1] * values[1] + part[2] * values[2];
                let [u, v] = [corners.map(|c| c.uv.x), corners.map(|c| c.uv.y)].map(mixed);
                let texel = texel(texture, u, v);
                let source: [f32; 4] = std::array::from_fn(|n| mixed(colours.map(|c| c[n])) * texel[n] / 255.0);
                // As egui does it: premultiplied colours, blended as they are coded.
                let pixel = &mut self.rgb[y as usize * self.width + x as usize];
                *pixel = std::array::from_fn(|n| {
                    let under = f32::from(pixel[n]) * (1.0 - source[3] / 255.0);
                    (source[n] + under).round().clamp(0.0, 255.0) as u8
                });
            }
        }
    }

    /// Means of `factor` x `factor` pixels.
    pub fn downsampled(&self, factor: usize) -> Self {
        let (width, height) = (self.width / factor, self.height / factor);
        let mean = |n: usize| {
            let (left, top) = (n % width * factor, n / width * factor);
            std::array::from_fn(|channel| {
                let rows = (top..top + factor).map(|y| &self.rgb[y * self.width + left..][..factor]);
                let sum: usize = rows.flatten().map(|pixel| usize::from(pixel[channel])).sum();
                (sum / (factor * factor)) as u8
            })
        };
        Pixels { width, height, rgb: (0..width * height).map(mean).collect() }
    }

    fn read(path: &Path) -> Option<Self> {
        let file = std::io::BufReader::new(std::fs::File::open(path).ok()?);
        let mut reader = png::Decoder::new(file).read_info().ok()?;
        let mut bytes = vec![0; reader.output_buffer_size()?];
        let info = reader.next_frame(&mut bytes).ok()?;
        let rgb = bytes.as_chunks::<3>().0.to_vec();
        Some(Pixels { width: info.width as usize, height: info.height as usize, rgb })
    }

    pub fn write(&self, path: &Path) {
        std::fs::create_dir_all(path.parent().expect("a file in a folder")).unwrap();
        let file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
        let mut encoder = png::Encoder::new(file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        // Texts on plain colours: a filter makes the file an eighth larger.
        encoder.set_filter(png::Filter::NoFilter);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(self.rgb.as_flattened()).unwrap();
        writer.finish().unwrap();
    }

    /// Indices of the pixels of `other` that differ; all where the sizes do.
    pub fn different_pixels(&self, other: &Pixels) -> Vec<usize> {
        if (self.width, self.height) != (other.width, other.height) {
            return (0..other.rgb.len()).collect();
        }
        let differs = |n: &usize| (0..3).any(|c| self.rgb[*n][c].abs_diff(other.rgb[*n][c]) > TOLERANCE);
        (0..self.rgb.len()).filter(differs).collect()
    }

    /// Whether a comparison tells the two apart.
    pub fn differs(&self, other: &Pixels) -> bool {
        self.different_pixels(other).len() > MOST_DIFFERENT
    }
}

/// Compares with the kept picture of this name, or keeps it where that is asked for. What is wrong, for people.
pub fn compare(name: &str, found: &Pixels) -> Result<(), String> {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures").join(format!("{name}.png"));
    if std::env::var(UPDATE).is_ok_and(|value| value == "1") {
        found.write(&kept);
    }
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder");
    compare_files(&kept, &target.join("pictures"), found)
}

/// Compares with a file. Where they differ, a file of the same name in `folder` has what was found, and one beside it the difference.
pub fn compare_files(kept: &Path, folder: &Path, found: &Pixels) -> Result<(), String> {
    let new = folder.join(kept.file_name().expect("the name of a picture"));
    let difference = new.with_extension("difference.png");
    // One that is not there differs in its size.
    let expected = Pixels::read(kept).unwrap_or_else(|| Pixels::plain([0, 0], [0; 3]));
    let different = expected.different_pixels(found);
    println!("{}: {} of {} pixels differ", kept.display(), different.len(), found.rgb.len());
    if !expected.differs(found) {
        return Ok(());
    }
    found.write(&new);
    // Pale, with what differs in red.
    let mut marked = found.clone();
    marked.rgb.iter_mut().for_each(|pixel| *pixel = pixel.map(|x| 160 + x / 4));
    different.iter().for_each(|n| marked.rgb[*n] = [220, 0, 0]);
    marked.write(&difference);
    let (columns, rows): (Vec<usize>, Vec<usize>) =
        different.iter().map(|n| (n % found.width, n / found.width)).unzip();
    let ends = |all: &[usize]| format!("{}..{}", all.iter().min().unwrap(), all.iter().max().unwrap());
    Err(format!(
        "{}: {} pixels differ, columns {}, rows {}\n  new: {}\n  difference: {}\n  to accept it: \
         {UPDATE}=1 cargo test --release --features window,link --test window pictures",
        kept.display(),
        different.len(),
        ends(&columns),
        ends(&rows),
        new.display(),
        difference.display()
    ))
}
