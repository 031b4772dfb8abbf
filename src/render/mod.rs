//! The picture of a run: a cut through tissue and tool with the von Mises stress as colour.
//!
//! [`slice`] cuts the deformed mesh, [`picture`] composes one list of coloured triangles, [`offscreen`] draws it on the
//! device and [`raster`] on the processor. Both draw the same list with the same four samples per pixel. [`anatomy`] tells what lies where
//! in a scene with labels or regions, and [`contour`] where it ends.

use std::path::Path;

use crate::mesh::Mesh;
use crate::observables::FieldSnapshot;
use crate::scene::Scene;
use crate::whole_file;
use crate::{Error, Result};

pub mod anatomy;
pub mod body;
pub mod contour;
pub mod offscreen;
pub mod picture;
pub mod raster;
pub mod slice;
pub mod stroke_font;
pub mod surfaces;

pub use picture::Picture;
pub use picture::anatomy::AnatomyPicture;

/// A finished picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels.
    pub width: u32,
    pub height: u32,
    /// Four bytes per pixel (red, green, blue, alpha; sRGB), rows from the top.
    pub rgba: Vec<u8>,
}

impl Image {
    /// Red, green, blue, alpha of one pixel.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        let at = 4 * (y as usize * self.width as usize + x as usize);
        self.rgba[at..at + 4].try_into().expect("a slice of four bytes")
    }

    /// Writes the picture, whole or not at all.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        write_png(path, &self.rgba, self.width, self.height)
    }
}

/// Draws the state of a run; with a device on it, without on the processor.
pub fn draw(
    scene: &Scene,
    mesh: &Mesh,
    snapshot: &FieldSnapshot,
    device: Option<(&wgpu::Device, &wgpu::Queue)>,
) -> Result<Image> {
    rendered(&Picture::compose(scene, mesh, snapshot), device)
}

/// Draws what lies where, in natural colours with names; none for a scene without labels and regions.
pub fn draw_anatomy(
    scene: &Scene,
    mesh: &Mesh,
    snapshot: &FieldSnapshot,
    device: Option<(&wgpu::Device, &wgpu::Queue)>,
) -> Result<Option<Image>> {
    AnatomyPicture::compose(scene, mesh, snapshot).map(|found| rendered(&found.picture, device)).transpose()
}

fn rendered(picture: &Picture, device: Option<(&wgpu::Device, &wgpu::Queue)>) -> Result<Image> {
    let rgba = match device {
        Some((device, queue)) => offscreen::render_on_device(device, queue, picture)?,
        None => raster::render_on_processor(picture),
    };
    Ok(Image { width: picture.width, height: picture.height, rgba })
}

/// Writes four bytes per pixel (sRGB) as a PNG file, whole or not at all.
pub fn write_png(path: &Path, rgba: &[u8], width: u32, height: u32) -> Result<()> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder
        .write_header()
        .and_then(|mut writer| {
            writer.write_image_data(rgba)?;
            writer.finish()
        })
        .map_err(|reason| Error::file(path, std::io::Error::other(reason)))?;
    whole_file::write(path, &bytes)
}
