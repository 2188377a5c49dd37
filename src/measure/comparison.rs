//! Two images by all metrics: which of their channels are compared, over which pixels, and how they
//! differ.

use super::flip::{PIXELS_PER_DEGREE, flip, flip_hdr};
use super::mask::{Mask, MaskOptions};
use super::metrics::ImagePair;
use super::ssim::ssim;
use crate::colour::srgb_encode;
use crate::error::{Error, Result};
use crate::output::{Image, Samples, exr, png};

/// A pixel is an outlier if its difference is more than this many standard errors of the two
/// images.
pub const OUTLIER_ERRORS: f64 = 6.0;
/// An outlier's difference is also more than this: half a step of an 8-bit image.
pub const OUTLIER_LEAST: f64 = 0.5 / 255.0;

/// Channels and pixels that are compared.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CompareOptions {
    /// Names of channels, which both images have; empty: the colour channels.
    pub channels: Vec<String>,
    /// Conditions that pixels meet.
    pub mask: MaskOptions,
}

/// How an image differs from a reference, over the pixels of the mask that are finite in both.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// Channels compared: `R`, `G`, `B`, or `Y` where both images are grey, or those that were
    /// asked for. A grey image has three equal channels where the other one has colours.
    pub channels: Vec<String>,
    /// The mask in words. All metrics are over its pixels that are finite in both images.
    pub mask: String,
    /// Pixels of the mask.
    pub mask_pixels: u64,
    /// Pixels compared: those of the mask that are finite in both images.
    pub pixels: u64,
    /// Pixels compared that differ.
    pub differing: u64,
    /// Root of the mean squared error over all channels.
    pub rmse: f64,
    /// Root of the mean squared error of each channel.
    pub channel_rmse: Vec<f64>,
    /// Mean absolute error.
    pub mae: f64,
    /// Relative mean squared error: [`ImagePair::rel_mse`].
    pub rel_mse: f64,
    /// Peak signal-to-noise ratio, dB, for a peak of 1; infinite for equal images.
    pub psnr: f64,
    /// SSIM of what a display shows (0 to 1, sRGB); `None` for channels that are no colours, and
    /// where no pixel is 5 pixels from the border.
    pub ssim: Option<f64>,
    /// Mean FLIP of what a display shows, 0 to 1; `None` for channels that are no colours.
    pub flip: Option<f64>,
    /// Mean FLIP over exposures; `None` for channels that are no colours, and where no value
    /// exceeds 1: FLIP says all then.
    pub flip_hdr: Option<f64>,
    /// Tanimoto coefficient, 1 for equal images.
    pub tanimoto: f64,
    /// Mean of the minimum ratio, 1 for equal images.
    pub minimum_ratio: f64,
    /// Mean of image - reference.
    pub bias: f64,
    /// Standard error of the bias, were pixels independent.
    pub bias_standard_error: f64,
    /// Greatest absolute difference.
    pub max: f64,
    /// Percentiles of the absolute difference.
    pub percentiles: Percentiles,
    /// Pixels that no mean can show.
    pub bad: BadPixels,
    /// Root mean square of the standard errors of the reference's pixels; `None` if it has no
    /// variance.
    pub reference_standard_error: Option<f64>,
    /// Differences pixel by pixel.
    #[serde(skip)]
    pub maps: Maps,
}

/// Percentiles of the absolute difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: f64,
    /// 95 % of values differ by less.
    pub p95: f64,
    /// 99 % of values differ by less.
    pub p99: f64,
}

/// Pixels of the mask that are wrong, each for itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct BadPixels {
    /// Pixels where one image is not a number, and the other is one.
    pub nan: u64,
    /// Pixels where neither image is a number.
    pub nan_in_both: u64,
    /// Pixels where one image is infinite and the other is finite, or infinite of the other sign.
    pub infinite: u64,
    /// Pixels whose difference is more than [`OUTLIER_ERRORS`] standard errors and
    /// [`OUTLIER_LEAST`]; `None` if the reference has no variance.
    pub outliers: Option<u64>,
}

impl Comparison {
    /// Whether the metrics say anything: pixels were compared, and none is broken.
    ///
    /// # Errors
    /// [`Error::CheckFailed`] where no pixel was compared, and where a pixel of the mask is not a
    /// number, or infinite in one image only.
    pub fn check(&self) -> Result<()> {
        let failed = |what: String| Err(Error::CheckFailed(what));
        let count = |n: u64| if n == 1 { "1 pixel is".to_owned() } else { format!("{n} pixels are") };
        let BadPixels { nan, nan_in_both, infinite, .. } = self.bad;
        if nan > 0 {
            failed(format!("the images differ: {} not a number (NaN) in one of them only", count(nan)))
        } else if nan_in_both > 0 {
            failed(format!(
                "the images cannot be compared everywhere: {} not a number (NaN) in both",
                count(nan_in_both)
            ))
        } else if infinite > 0 {
            failed(format!("the images differ: {} infinite in one of them only", count(infinite)))
        } else if self.mask_pixels == 0 {
            failed(format!("nothing was compared: the images have no pixel of the mask ({})", self.mask))
        } else if self.pixels == 0 {
            failed(format!("nothing was compared: no pixel of the mask ({}) is finite", self.mask))
        } else {
            Ok(())
        }
    }
}

/// Differences pixel by pixel, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Maps {
    /// Image - reference, as many values a pixel as channels; NaN where one is not finite.
    pub difference: Vec<f32>,
    /// FLIP of each pixel, or FLIP over exposures if there is one; empty for channels that are no
    /// colours.
    pub flip: Vec<f32>,
    /// 1 for pixels that are compared, else 0.
    pub compared: Vec<f32>,
    /// 1 for pixels of the mask, else 0.
    pub mask: Vec<f32>,
}

impl BadPixels {
    /// Pixels where exactly one image is finite, or both are infinite or not a number in different
    /// ways.
    pub fn not_finite(&self) -> u64 {
        self.nan + self.infinite
    }
}

/// Compares an image with a reference.
///
/// # Errors
/// [`Error::CheckFailed`] for images of different size, [`Error::Usage`] for channels that one of
/// them lacks, for images without colour if no channels are named, for an 8-bit image and one with
/// values that 8 bits cannot hold, and for masks that do not fit.
pub fn compare(image: &Image, reference: &Image, options: &CompareOptions) -> Result<Comparison> {
    check_size(image, reference)?;
    let (channels, planes) = select(image, reference, &options.channels)?;
    check_encoding(image, reference, &planes)?;
    let width = image.width as usize;
    let are_colours = channels.iter().all(|c| is_colour(c)) && matches!(channels.len(), 1 | 3);
    let colours: Vec<&[f32]> = planes.iter().flatten().copied().filter(|_| are_colours).collect();
    let Mask { name: mask_name, counted: mask } = options.mask.select(image, reference, &colours)?;

    // pixels that have a number in all channels of both; the others are counted by kind
    let [a, b] = [0, 1].map(|k| interleaved(&planes.iter().map(|p| p[k]).collect::<Vec<_>>()));
    let n = channels.len();
    let mut bad = BadPixels::default();
    let compared: Vec<f32> = (0..mask.len())
        .map(|i| {
            let pairs = || (i * n..(i + 1) * n).map(|k| (a[k], b[k]));
            let finite = pairs().all(|(x, y)| x.is_finite() && y.is_finite());
            if mask[i] > 0.0 && !finite {
                let is_nan_in_one = pairs().any(|(x, y)| x.is_nan() != y.is_nan());
                bad.nan += u64::from(is_nan_in_one);
                bad.nan_in_both += u64::from(!is_nan_in_one && pairs().any(|(x, y)| x.is_nan() && y.is_nan()));
                let differ =
                    |(x, y): (f32, f32)| !x.is_nan() && !y.is_nan() && x != y && (x.is_infinite() || y.is_infinite());
                bad.infinite += u64::from(pairs().all(|(x, y)| x.is_nan() == y.is_nan()) && pairs().any(differ));
            }
            f32::from(u8::from(mask[i] > 0.0 && finite))
        })
        .collect();
    let pair = ImagePair::new(&a, &b, n, Some(&compared))?;

    // how different it looks: what is not compared is alike in both, so that its differences do not
    // reach into the windows of pixels that are
    let counts = |k: usize| compared[k / n] > 0.0;
    let known = |k: usize| if counts(k) || b[k].is_finite() { b[k] } else { 0.0 };
    let seen: [Vec<f32>; 2] =
        [(0..a.len()).map(|k| if counts(k) { a[k] } else { known(k) }).collect(), (0..b.len()).map(known).collect()];
    let seen_pair = ImagePair::new(&seen[0], &seen[1], n, Some(&compared))?;
    let flips = if are_colours { Some(flip(&seen_pair, width, PIXELS_PER_DEGREE)?) } else { None };
    let exceeds = pair.values().any(|(x, y)| x > 1.0 || y > 1.0);
    let hdr = if are_colours && exceeds { flip_hdr(&seen_pair, width, PIXELS_PER_DEGREE)? } else { None };
    let shown = |values: &[f32]| -> Vec<f32> { values.iter().map(|v| srgb_encode(v.clamp(0.0, 1.0))).collect() };
    let ssim = if are_colours {
        ssim(&ImagePair::new(&shown(&seen[0]), &shown(&seen[1]), n, Some(&compared))?, width)?
    } else {
        None
    };

    // counts, and what noise explains
    let errors = [image, reference].map(|image| squared_errors(image, &channels));
    bad.outliers = errors[1].is_some().then(|| outliers(&pair, &errors));
    let [p50, p95, p99] = pair.percentiles([0.5, 0.95, 0.99]);
    let pixels = compared.iter().filter(|c| **c > 0.0).count() as u64;
    let differing =
        (0..compared.len()).filter(|&i| compared[i] > 0.0 && a[i * n..][..n] != b[i * n..][..n]).count() as u64;
    let mean_of_errors = |e: &Vec<f32>| {
        let sum: f64 = (0..e.len()).filter(|k| compared[k / n] > 0.0).map(|k| f64::from(e[k])).sum();
        (sum / (pixels * n as u64) as f64).sqrt()
    };
    let channel_rmse = |p: &[&[f32]; 2]| Ok(ImagePair::new(p[0], p[1], 1, Some(&compared))?.rmse());
    Ok(Comparison {
        mask: mask_name,
        mask_pixels: mask.iter().filter(|m| **m > 0.0).count() as u64,
        pixels,
        differing,
        rmse: pair.rmse(),
        channel_rmse: planes.iter().map(channel_rmse).collect::<Result<_>>()?,
        mae: pair.mae(),
        rel_mse: pair.rel_mse(),
        psnr: pair.psnr(),
        ssim,
        flip: flips.as_ref().map(|f| f.mean),
        flip_hdr: hdr.as_ref().map(|f| f.mean),
        tanimoto: pair.tanimoto(),
        minimum_ratio: pair.minimum_ratio(),
        bias: pair.bias(),
        bias_standard_error: pair.bias_standard_error(),
        max: pair.max_abs_difference(),
        percentiles: Percentiles { p50, p95, p99 },
        bad,
        reference_standard_error: errors[1].as_ref().map(mean_of_errors),
        maps: Maps {
            difference: a
                .iter()
                .zip(&b)
                .map(|(a, b)| if a.is_finite() && b.is_finite() { a - b } else { f32::NAN })
                .collect(),
            flip: hdr.map(|f| f.map).or(flips.map(|f| f.map)).unwrap_or_default(),
            compared: compared.clone(),
            mask,
        },
        channels,
    })
}

/// Refuses images of different size, and those that show different parts of a plane: display
/// windows of EXR files at different places.
///
/// # Errors
/// [`Error::CheckFailed`].
pub fn check_size(image: &Image, reference: &Image) -> Result<()> {
    let [a, b] = [image, reference].map(|i| (i.width, i.height));
    if a == b {
        let [a, b] = [image, reference].map(|i| i.metadata(exr::DISPLAY_ORIGIN).unwrap_or("0,0"));
        if a == b {
            return Ok(());
        }
        return Err(Error::CheckFailed(format!(
            "the images show different places: their display windows begin at {a} and {b}"
        )));
    }
    Err(Error::CheckFailed(format!("the images differ in size: {}x{} and {}x{} pixels", a.0, a.1, b.0, b.1)))
}

/// Do these samples show a colour? `R`, `G`, `B` and `Y`, also of a layer (`albedo.R`).
fn is_colour(channel: &str) -> bool {
    matches!(channel.rsplit('.').next(), Some("R" | "G" | "B" | "Y")) && !channel.starts_with("position.") && {
        let layer = channel.rsplit_once('.').map_or("", |(layer, _)| layer);
        matches!(layer, "" | "noisy" | "albedo")
    }
}

/// The colour channels of an image: three, or a grey one.
fn colours(image: &Image) -> Option<Vec<(&'static str, &[f32])>> {
    let channel = |name: &'static str| image.f32(name).map(|samples| (name, samples));
    match (channel("R"), channel("G"), channel("B")) {
        (Some(r), Some(g), Some(b)) => Some(vec![r, g, b]),
        // a single channel called R is grey, as for PNG files
        (red, ..) => channel("Y").or(red).map(|grey| vec![grey]),
    }
}

/// The channels that are compared, and their samples in both images.
type Selection<'a> = (Vec<String>, Vec<[&'a [f32]; 2]>);

fn select<'a>(image: &'a Image, reference: &'a Image, names: &[String]) -> Result<Selection<'a>> {
    if !names.is_empty() {
        let plane = |image: &'a Image, which: &str, name: &str| {
            image.f32(name).ok_or_else(|| {
                let has: Vec<_> =
                    image.channels.iter().filter(|c| matches!(c.samples, Samples::F32(_))).map(|c| &*c.name).collect();
                Error::Usage(format!("{which} has no channel {name} of numbers; it has {}", has.join(", ")))
            })
        };
        let planes = names.iter().map(|n| Ok([plane(image, "the image", n)?, plane(reference, "the reference", n)?]));
        return Ok((names.to_vec(), planes.collect::<Result<_>>()?));
    }
    let chosen = |image: &'a Image, which: &str| {
        colours(image).ok_or_else(|| {
            let has: Vec<_> = image.channels.iter().map(|c| &*c.name).filter(|n| !n.starts_with("state.")).collect();
            Error::Usage(format!(
                "{which} has no colour (channels R, G and B, or Y), but {}: name the channels to compare with --channels",
                has.join(", ")
            ))
        })
    };
    let (a, b) = (chosen(image, "the image")?, chosen(reference, "the reference")?);
    let names = if a.len() >= b.len() { &a } else { &b };
    let at = |of: &[(&str, &'a [f32])], k: usize| of[k.min(of.len() - 1)].1;
    Ok((names.iter().map(|c| c.0.to_owned()).collect(), (0..names.len()).map(|k| [at(&a, k), at(&b, k)]).collect()))
}

/// Refuses an 8-bit image and one whose values 8 bits cannot hold: one of them is tone mapped, or
/// clamped.
fn check_encoding(image: &Image, reference: &Image, planes: &[[&[f32]; 2]]) -> Result<()> {
    let encodings = [image, reference].map(|i| i.metadata(png::ENCODING));
    for (k, which) in ["the image", "the reference"].iter().enumerate() {
        let (Some(encoding), None) = (encodings[k], encodings[1 - k]) else { continue };
        let greatest = planes.iter().flat_map(|p| p[1 - k]).copied().filter(|v| v.is_finite()).fold(0.0, f32::max);
        if greatest > 1.0 {
            let other = ["the reference", "the image"][k];
            return Err(Error::Usage(format!(
                "the images differ in encoding: {which} is {encoding}, and {other} has linear values up to {greatest}: compare two .exr, or two .png of equal exposure and tone mapping"
            )));
        }
    }
    Ok(())
}

fn interleaved(planes: &[&[f32]]) -> Vec<f32> {
    let count = planes.first().map_or(0, |p| p.len());
    (0..count).flat_map(|i| planes.iter().map(move |p| p[i])).collect()
}

/// Squares of the standard errors of an image's values, interleaved; `None` if the image has no
/// variances, or not of these channels.
fn squared_errors(image: &Image, channels: &[String]) -> Option<Vec<f32>> {
    // a count of stills, of frames in real time the length of a history
    let samples: Vec<f32> = image.channels.iter().find(|c| c.name == "samples").map(|c| match &c.samples {
        Samples::F32(n) => n.clone(),
        Samples::U32(n) => n.iter().map(|n| *n as f32).collect(),
    })?;
    let variance = |name: &String| image.f32(&format!("variance.{name}")).or_else(|| image.f32("variance"));
    let planes: Vec<_> = channels.iter().map(|c| is_colour(c).then(|| variance(c)).flatten()).collect::<Option<_>>()?;
    let error = |(v, n): (&f32, &f32)| if *n > 0.0 { v / n } else { 0.0 };
    let planes: Vec<Vec<f32>> = planes.iter().map(|plane| plane.iter().zip(&samples).map(error).collect()).collect();
    Some(interleaved(&planes.iter().map(Vec::as_slice).collect::<Vec<_>>()))
}

/// Compared pixels with a value whose difference noise does not explain.
fn outliers(pair: &ImagePair, errors: &[Option<Vec<f32>>; 2]) -> u64 {
    let n = pair.channels;
    let is_outlier = |k: usize| {
        let difference = (f64::from(pair.image[k]) - f64::from(pair.reference[k])).abs();
        let variance: f64 = errors.iter().flatten().map(|e| f64::from(e[k])).sum();
        difference > OUTLIER_LEAST && difference > OUTLIER_ERRORS * variance.sqrt()
    };
    let counted = |i: &usize| pair.coverage.is_none_or(|c| c[*i] > 0.0);
    (0..pair.image.len() / n).filter(counted).filter(|i| (i * n..(i + 1) * n).any(is_outlier)).count() as u64
}
