//! Pixels of images as a display has them, and the part of them that a window shows.

use egui::Vec2;
use rayon::prelude::*;

use super::{Content, Look};
use crate::colour::srgb_byte;
use crate::measure::comparison::Comparison;
use crate::output::{self, Channel, Image, palette};
use crate::renderer::interactive::ViewPicture;

/// Colour around an image.
const AROUND: [u8; 4] = [16, 16, 16, 255];

/// Where an image is in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Physical pixels of the part of the window for it.
    pub size: [u32; 2],
    /// Physical pixels per pixel of the image.
    pub zoom: f32,
    /// Point of the image in the middle.
    pub middle: Vec2,
}

/// Colours of all pixels of an image, 8-bit sRGB.
pub(super) struct Display {
    size: [u32; 2],
    rgb: Vec<[u8; 3]>,
}

impl Display {
    /// Colours of an image or a layer of it, exposed and tone mapped.
    ///
    /// # Errors
    /// Why there is nothing to show, in words.
    pub fn from_image(image: &Image, look: &Look) -> Result<Self, String> {
        let stretched;
        let image = if look.layer.is_empty() {
            image
        } else {
            let (layer, names) = output::layers::layer(image, &look.layer)?;
            let range = output::layers::default_range(&layer, &names);
            stretched = match range {
                Some(range) => output::layers::stretched(layer, range),
                None => layer,
            };
            &stretched
        };
        let planes = output::layers::colour_planes(image).ok_or("the image has no colours")?;
        let names = ["R", "G", "B"].into_iter().zip(planes);
        let channels = names.map(|(name, plane)| Channel::from_floats(name, plane.to_vec())).collect();
        let linear = Image { width: image.width, height: image.height, channels, metadata: Vec::new() };
        let mapped = look.tone_map.apply(&linear, look.exposure);
        let planes = output::layers::colour_planes(&mapped).ok_or("the image has no colours")?;
        let colour = |k: usize| planes.map(|plane| srgb_byte(plane[k]));
        Ok(Self {
            size: [image.width, image.height],
            rgb: (0..image.pixel_count()).into_par_iter().map(colour).collect(),
        })
    }

    /// Colours of a comparison: its difference times two to the power of `exposure`, or FLIP.
    pub fn from_comparison(comparison: &Comparison, size: [u32; 2], content: Content, exposure: f32) -> Self {
        let maps = &comparison.maps;
        let channels = comparison.channels.len().max(1);
        let largest =
            |values: &[f32]| values.iter().fold(0.0f32, |most, v| if v.is_nan() { *v } else { most.max(v.abs()) });
        let rgb = if content == Content::Flip && !maps.flip.is_empty() {
            maps.flip.par_iter().map(|error| palette::heat(*error)).collect()
        } else {
            let gain = exposure.exp2();
            maps.difference.par_chunks(channels).map(|values| palette::heat(largest(values) * gain)).collect()
        };
        Self { size, rgb }
    }

    /// The part of it that a window shows: pixels as squares where they are enlarged, means where
    /// they are reduced.
    pub fn view(&self, place: &Place) -> ViewPicture {
        let [width, height] = place.size.map(|n| n as usize);
        let mut rgba = vec![0; 4 * width * height];
        let step = 1.0 / place.zoom;
        let first = place.middle - Vec2::new(width as f32, height as f32) * 0.5 * step;
        rgba.par_chunks_mut((4 * width).max(1)).enumerate().for_each(|(y, row)| {
            let rows = covered(first.y + y as f32 * step, step, self.size[1]);
            for (x, pixel) in row.chunks_exact_mut(4).enumerate() {
                let columns = covered(first.x + x as f32 * step, step, self.size[0]);
                pixel.copy_from_slice(&self.mean(columns, rows.clone()).unwrap_or(AROUND));
            }
        });
        ViewPicture { size: place.size, rgba }
    }

    /// The mean colour of pixels; `None` of none.
    fn mean(&self, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) -> Option<[u8; 4]> {
        let count = (columns.len() * rows.len()) as u32;
        if count == 0 {
            return None;
        }
        let mut sum = [0u32; 3];
        for row in rows {
            for pixel in &self.rgb[row * self.size[0] as usize..][columns.clone()] {
                sum = std::array::from_fn(|c| sum[c] + u32::from(pixel[c]));
            }
        }
        let [r, g, b] = sum.map(|s| ((s + count / 2) / count) as u8);
        Some([r, g, b, 255])
    }
}

/// The pixels along an axis of `most` that a pixel of the screen covers: the one that it lies in,
/// or all whose middle it covers.
fn covered(start: f32, length: f32, most: u32) -> std::ops::Range<usize> {
    let inside = |x: f32| x.clamp(0.0, most as f32) as usize;
    if length <= 1.0 {
        let at = (start + 0.5 * length).floor();
        return if at < 0.0 || at >= most as f32 { 0..0 } else { at as usize..at as usize + 1 };
    }
    inside((start + 0.5).floor())..inside((start + length + 0.5).floor())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn display() -> Display {
        // red counts columns, green rows
        let rgb = (0..3u8).flat_map(|y| (0..4u8).map(move |x| [10 * x, 20 * y, 7])).collect();
        Display { size: [4, 3], rgb }
    }

    #[test]
    fn pixels_are_squares_means_or_nothing() {
        let middle = Vec2::new(2.0, 1.5);
        let same = display().view(&Place { size: [4, 3], zoom: 1.0, middle });
        assert_eq!(same.rgba.chunks(4).map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>(), display().rgb);
        let large = display().view(&Place { size: [12, 9], zoom: 3.0, middle });
        for (k, p) in large.rgba.chunks(4).enumerate() {
            assert_eq!([p[0], p[1]], [10 * (k % 12 / 3) as u8, 20 * (k / 12 / 3) as u8], "{k}");
        }
        let half = display().view(&Place { size: [2, 1], zoom: 0.5, middle: Vec2::new(2.0, 1.0) });
        assert_eq!(half.rgba, [5, 10, 7, 255, 25, 10, 7, 255]);
        // beside the image there is none
        let beside = display().view(&Place { size: [6, 3], zoom: 1.0, middle });
        assert_eq!([&beside.rgba[..4], &beside.rgba[4..8]], [&AROUND[..], &[0, 0, 7, 255]]);
    }
}
