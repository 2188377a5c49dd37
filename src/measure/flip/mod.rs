//! FLIP: how large the difference between two images looks to someone who flips between them.
//!
//! After Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference
//! Evaluator for Alternating Images" (HPG 2020), the variant for images that a display shows as
//! they are: linear RGB in [0, 1], what lies beyond is clamped; [`flip_hdr`] is the one for any
//! values. Written from the papers. Colours are blurred as the eye blurs them, told apart in a
//! perceptually even space, and the result is raised where one image has an edge or a point that
//! the other lacks.

mod colour;
mod filters;
mod hdr;

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use self::colour::{Space, hyab, lightness};
use self::filters::{Filters, Plane};
use super::metrics::ImagePair;
use crate::{Error, Result};

pub use self::hdr::{HdrFlip, flip_hdr};

/// The paper's viewing conditions: a display of 3840 pixels over 0.7 m, seen from 0.7 m; about 67
/// pixels a degree.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;

/// Exponent of colour differences (qc).
const COLOUR_EXPONENT: f32 = 0.7;
/// Share of the greatest colour difference (pc) that is mapped to [`BELOW`] of the range of errors.
const KNEE: f32 = 0.4;
/// Where the knee lies in the range of errors (pt).
const BELOW: f32 = 0.95;
/// Exponent of feature differences (qf).
const FEATURE_EXPONENT: f32 = 0.5;

/// Rows worked on at a time: filters see beyond them, so few rows waste work, many rows memory.
const BAND: usize = 64;

/// Pixels a degree of visual angle, of a display `width` metres and `pixels` pixels wide, seen from
/// `distance` metres.
pub fn pixels_per_degree(distance: f64, width: f64, pixels: f64) -> f64 {
    distance * (pixels / width) * std::f64::consts::PI / 180.0
}

/// How different two images look.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// The error of each pixel, covered or not, in [0, 1]: 0 looks the same. NaN where a value is
    /// not finite.
    pub map: Vec<f32>,
    /// Mean over the pixels that count; NaN for none, or when one of them is broken.
    pub mean: f64,
}

/// Compares images of 1 channel (grey) or 3 (RGB), linear, in rows of `width` pixels. What coverage
/// leaves out is not counted, but is seen by the eye beside what is; values that are not finite are
/// seen as black. `pixels_per_degree` is in [1, 10000], commonly [`PIXELS_PER_DEGREE`].
///
/// # Errors
/// [`Error::Usage`] for other numbers of channels, a width that does not divide the image, or
/// pixels per degree out of range.
pub fn flip(pair: &ImagePair, width: usize, pixels_per_degree: f64) -> Result<Flip> {
    let wrong = |what: &str| Err(Error::Usage(format!("cannot compute FLIP: {what}")));
    let (channels, pixels) = (pair.channels, pair.image.len() / pair.channels);
    if channels != 1 && channels != 3 {
        return wrong("it is defined for images of 1 or 3 channels");
    }
    if width == 0 || !pixels.is_multiple_of(width) {
        return wrong("the width does not divide the number of pixels");
    }
    if !(1.0..=10_000.0).contains(&pixels_per_degree) {
        return wrong("pixels per degree must be between 1 and 10000 (67 is usual)");
    }
    let eye =
        Eye { filters: Filters::new(pixels_per_degree), space: Space::new(), width, height: pixels / width, channels };
    let greatest = eye.greatest_difference();
    let mut map = vec![0.0; pixels];
    map.par_chunks_mut(width * BAND).enumerate().for_each(|(band, errors)| {
        let rows = band * BAND..band * BAND + errors.len() / width;
        let (a, b) = (eye.see(pair.image, rows.clone()), eye.see(pair.reference, rows.clone()));
        for (i, error) in errors.iter_mut().enumerate() {
            let k = (rows.start * width + i) * channels;
            let finite = |values: &[f32]| values[k..k + channels].iter().all(|v| v.is_finite());
            let whole = finite(pair.image) && finite(pair.reference);
            *error =
                if whole { combined(a.difference(&b, i), a.feature_difference(&b, i), greatest) } else { f32::NAN };
        }
    });
    let mean = pair.mean_of(&map);
    Ok(Flip { map, mean })
}

/// Section 4.3 of the paper: the error of a pixel from the HyAB distance and the difference of its
/// features.
fn combined(difference: f32, feature: f32, greatest: f32) -> f32 {
    let (d, knee) = (difference.powf(COLOUR_EXPONENT), KNEE * greatest);
    // large differences are squeezed into what is left above the knee
    let colour = if d < knee { BELOW / knee * d } else { BELOW + (d - knee) / (greatest - knee) * (1.0 - BELOW) };
    let feature = (feature * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT).min(1.0);
    colour.min(1.0).powf(1.0 - feature)
}

/// Who looks at images of one size.
struct Eye {
    filters: Filters,
    space: Space,
    width: usize,
    height: usize,
    channels: usize,
}

impl Eye {
    /// The greatest colour difference of a display, green against blue, with its exponent.
    fn greatest_difference(&self) -> f32 {
        hyab(self.space.lab(Vec3::Y), self.space.lab(Vec3::Z)).powf(COLOUR_EXPONENT)
    }

    /// Filters the given rows as the eye does, into colours and features.
    fn see(&self, image: &[f32], rows: Range<usize>) -> Seen {
        let (f, margin) = (&self.filters, self.filters.reach());
        let planes = self.opponent(image, rows, margin);

        let [across, edge, point] = [&f.across, &f.edge, &f.point].map(|kernel| planes[0].along_x(kernel, margin));
        let length = |x: Plane, y: Plane| x.values.iter().zip(&y.values).map(|(x, y)| (x * x + y * y).sqrt()).collect();
        let edge = length(edge.along_y(&f.across, margin), across.along_y(&f.edge, margin));
        let point = length(point.along_y(&f.across, margin), across.along_y(&f.point, margin));

        let luminance = planes[0].along_x(&f.achromatic, margin).along_y(&f.achromatic, margin).values;
        let colours = if let [_, red_green, blue_yellow] = &planes[..] {
            let red_green = red_green.along_x(&f.red_green, margin).along_y(&f.red_green, margin).values;
            let mut sum = Plane::new(self.width, luminance.len() / self.width);
            for (kernel, share) in &f.blue_yellow {
                blue_yellow.along_x(kernel, margin).add_along_y(kernel, margin, *share, &mut sum);
            }
            let opponents = luminance.iter().zip(&red_green).zip(&sum.values);
            opponents.map(|((&y, &rg), &by)| self.space.lab_of_opponent(Vec3::new(y, rg, by))).collect()
        } else {
            luminance.iter().map(|&y| Vec3::new(lightness(y.clamp(0.0, 1.0)), 0.0, 0.0)).collect()
        };
        Seen { colours, edge, point }
    }

    /// Opponent colours of some rows (luminance alone of a grey image), with `margin` more pixels
    /// on every side: the image's own where it has some, else its outermost.
    fn opponent(&self, image: &[f32], rows: Range<usize>, margin: usize) -> Vec<Plane> {
        let shown = |v: f32| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.0 };
        let (width, count) = (self.width + 2 * margin, rows.len() + 2 * margin);
        let mut planes = vec![Plane::new(width, count); self.channels];
        for y in 0..count {
            let from = (rows.start + y).saturating_sub(margin).min(self.height - 1) * self.width;
            for x in 0..self.width {
                let (k, at) = ((from + x) * self.channels, y * width + margin + x);
                if let [red, green, blue] = image[k..k + self.channels] {
                    let c = self.space.opponent(Vec3::new(shown(red), shown(green), shown(blue)));
                    for (plane, value) in planes.iter_mut().zip(c.to_array()) {
                        plane.values[at] = value;
                    }
                } else {
                    planes[0].values[at] = shown(image[k]);
                }
            }
            for plane in &mut planes {
                let row = &mut plane.values[y * width..(y + 1) * width];
                let (first, last) = (row[margin], row[margin + self.width - 1]);
                row[..margin].fill(first);
                row[margin + self.width..].fill(last);
            }
        }
        planes
    }
}

/// Colours and features that are seen of some rows: one entry a pixel.
struct Seen {
    /// L\*a\*b\*, adjusted.
    colours: Vec<Vec3>,
    /// How much of an edge it is.
    edge: Vec<f32>,
    /// How much of a point or line.
    point: Vec<f32>,
}

impl Seen {
    fn difference(&self, other: &Self, i: usize) -> f32 {
        hyab(self.colours[i], other.colours[i])
    }

    fn feature_difference(&self, other: &Self, i: usize) -> f32 {
        (self.edge[i] - other.edge[i]).abs().max((self.point[i] - other.point[i]).abs())
    }
}
