//! Images as they are displayed, by which they are compared: lamps and the sun, hundreds of times
//! as bright as all else, would be all that an error of radiance says.

use super::flip::{PIXELS_PER_DEGREE, flip};
use super::metrics::ImagePair;
use crate::colour::srgb_encode;
use crate::error::Result;
use crate::output::tone_map::ToneMap;

/// An image as it is displayed: tone mapped by default, from 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Displayed {
    /// Linear.
    pub linear: Vec<f32>,
    /// sRGB.
    pub coded: Vec<f32>,
}

impl Displayed {
    /// Converts ambient visibility (1 channel), which is compared as it is, or radiance (3). What
    /// is not finite stays so: broken pixels must not be averaged away.
    pub fn new(values: &[f32], channels: usize) -> Self {
        if channels == 1 {
            let linear: Vec<f32> = values.iter().map(|v| v.clamp(0.0, 1.0)).collect();
            return Self { coded: linear.clone(), linear };
        }
        let display = |c: &[f32]| {
            let is_whole = c.iter().all(|v| v.is_finite());
            if is_whole { ToneMap::default().map([c[0], c[1], c[2]]).map(|v| v.clamp(0.0, 1.0)) } else { [f32::NAN; 3] }
        };
        let linear: Vec<f32> = values.chunks_exact(3).flat_map(display).collect();
        let coded = linear.iter().map(|v| srgb_encode(*v)).collect();
        Self { linear, coded }
    }
}

/// How far an image is from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageErrors {
    /// Root of the mean squared error, as measured: the reference's own error is in it.
    pub rmse: f64,
    /// Without the reference's: `sqrt(max(0, rmse^2 - reference^2))`.
    pub corrected: f64,
    /// Mean of image - reference, of ambient visibility; of radiance, of linear values as
    /// displayed, over the mean of the reference.
    pub bias: f64,
    /// How different they look, 0 to 1.
    pub flip: f64,
    /// Mean of (image - reference)^2 / (reference^2 + 0.01) of linear values.
    pub rel_mse: f64,
    /// Larsen's similarities of ambient visibility, of the images as vectors and pixel by pixel.
    pub similarity: Option<[f64; 2]>,
}

impl ImageErrors {
    /// Mean of each metric; `None` for an empty slice.
    pub fn mean(all: &[Self]) -> Option<Self> {
        let n = all.len() as f64;
        let mean = |metric: fn(&Self) -> f64| all.iter().map(metric).sum::<f64>() / n;
        let similarity = |k: usize| all.iter().filter_map(|e| e.similarity).map(|s| s[k]).sum::<f64>() / n;
        (!all.is_empty()).then(|| Self {
            rmse: mean(|e| e.rmse),
            corrected: mean(|e| e.corrected),
            bias: mean(|e| e.bias),
            flip: mean(|e| e.flip),
            rel_mse: mean(|e| e.rel_mse),
            similarity: all[0].similarity.map(|_| [similarity(0), similarity(1)]),
        })
    }

    /// Error over that of plain accumulation. `None` where the references' own errors are all there
    /// is.
    pub fn over(&self, plain: &Self) -> Option<f64> {
        (plain.corrected > 0.0).then(|| self.corrected / plain.corrected)
    }
}

/// A converged image, and how well it is known.
pub struct FrameReference {
    values: Vec<f32>,
    /// As it is displayed.
    pub displayed: Displayed,
    /// Standard error of what is displayed.
    pub rmse: f64,
    /// 1 where errors count; `None`: everywhere.
    pub mask: Option<Vec<f32>>,
    channels: usize,
    width: usize,
}

impl FrameReference {
    /// The mean of two independent halves; errors are over the pixels whose `mask` is above 0
    /// (`None`: all).
    pub fn new(halves: [&[f32]; 2], channels: usize, width: usize, mask: Option<Vec<f32>>) -> Result<Self> {
        let [a, b] = halves.map(|half| Displayed::new(half, channels));
        let rmse = 0.5 * ImagePair::new(&a.coded, &b.coded, channels, mask.as_deref())?.rmse();
        let values: Vec<f32> = halves[0].iter().zip(halves[1]).map(|(a, b)| 0.5 * (a + b)).collect();
        Ok(Self { displayed: Displayed::new(&values, channels), values, rmse, mask, channels, width })
    }

    /// Errors of an image, of linear values.
    pub fn errors_of(&self, image: &[f32]) -> Result<ImageErrors> {
        let (displayed, mask) = (Displayed::new(image, self.channels), self.mask.as_deref());
        let rmse = self.rmse_over(&displayed, mask)?;
        let values = ImagePair::new(image, &self.values, self.channels, mask)?;
        let looks = ImagePair::new(&displayed.linear, &self.displayed.linear, self.channels, mask)?;
        let is_visibility = self.channels == 1;
        let shown = &self.displayed.linear;
        let mean = shown.iter().map(|v| f64::from(*v)).sum::<f64>() / shown.len().max(1) as f64;
        Ok(ImageErrors {
            rmse,
            corrected: without_reference(rmse, self.rmse),
            bias: if is_visibility { looks.bias() } else { looks.bias() / mean },
            flip: flip(&looks, self.width, PIXELS_PER_DEGREE)?.mean,
            rel_mse: values.rel_mse(),
            similarity: is_visibility.then(|| [looks.tanimoto(), looks.minimum_ratio()]),
        })
    }

    /// RMSE of what is displayed, over the pixels whose `mask` is above 0 (`None`: all).
    pub fn rmse_over(&self, displayed: &Displayed, mask: Option<&[f32]>) -> Result<f64> {
        Ok(ImagePair::new(&displayed.coded, &self.displayed.coded, self.channels, mask)?.rmse())
    }
}

/// Differences between consecutive frames of a camera that stands still.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flicker {
    /// Frames before the first difference.
    pub after: u32,
    /// Root mean square over pixels and pairs of frames.
    pub rms: f64,
    /// Greatest root mean square over the pixels of a pair of frames.
    pub greatest: f64,
}

impl Flicker {
    /// Frames after which no image may flicker any more.
    const SETTLED: u32 = 64;
    /// A step of an 8-bit image.
    pub const LIMIT: f64 = 1.0 / 255.0;

    /// Is it less than a step of an 8-bit image, in each pair of frames? `None` of a run that was
    /// too short to tell.
    pub fn is_invisible(&self) -> Option<bool> {
        (self.after >= Self::SETTLED).then_some(self.greatest < Self::LIMIT)
    }
}

/// Differences between consecutive images of a camera that stands still.
pub struct FlickerMeter {
    after: u32,
    frames: u32,
    last: Option<Vec<f32>>,
    /// Root mean square of each pair.
    pairs: Vec<f64>,
}

impl FlickerMeter {
    /// For a run of so many frames: after the 64th, or the first two thirds of a shorter run.
    pub fn new(frames: u32) -> Self {
        Self { after: Flicker::SETTLED.min(frames * 2 / 3), frames: 0, last: None, pairs: Vec::new() }
    }

    /// Adds the next frame.
    pub fn add(&mut self, displayed: &Displayed) -> Result<()> {
        self.frames += 1;
        if self.frames < self.after {
            return Ok(());
        }
        if let Some(last) = &self.last {
            self.pairs.push(ImagePair::new(&displayed.coded, last, 1, None)?.rmse());
        }
        self.last = Some(displayed.coded.clone());
        Ok(())
    }

    /// The results; `None` for too few frames.
    pub fn result(&self) -> Option<Flicker> {
        let squares: f64 = self.pairs.iter().map(|p| p * p).sum();
        let greatest = self.pairs.iter().fold(0.0, |most: f64, p| if p.is_nan() { f64::NAN } else { most.max(*p) });
        let rms = (squares / self.pairs.len() as f64).sqrt();
        (!self.pairs.is_empty()).then_some(Flicker { after: self.after, rms, greatest })
    }
}

/// The root of a mean squared error without the error of the reference that it was measured
/// against, which is independent of it; 0 where nothing is left. NaN stays what it is.
pub fn without_reference(rmse: f64, reference_rmse: f64) -> f64 {
    let squares = rmse * rmse - reference_rmse * reference_rmse;
    if squares < 0.0 { 0.0 } else { squares.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_are_as_bright_as_the_display() {
        let lamp = Displayed::new(&[0.0, 0.5, 50.0], 3);
        assert_eq!(lamp.linear, [0.0, 0.5, 1.0]);
        assert!((lamp.coded[1] - 0.7354).abs() < 1e-4 && (lamp.coded[2] - 1.0).abs() < 1e-6);
        assert_eq!(Displayed::new(&[1.5, 0.25], 1).coded, [1.0, 0.25]);
        assert!(Displayed::new(&[0.0, f32::NAN, 1.0], 3).coded.iter().all(|v| v.is_nan()));
    }

    #[test]
    fn errors_of_displayed_images() {
        let (a, b) = ([0.25f32; 48], [0.75f32; 48]);
        let reference = FrameReference::new([&a, &b], 3, 4, None).unwrap();
        let expected = 0.5 * f64::from(srgb_encode(0.75) - srgb_encode(0.25));
        assert!((reference.rmse - expected).abs() < 1e-6);
        // what is right is better than the reference knows
        let exact = reference.errors_of(&[0.5; 48]).unwrap();
        assert_eq!((exact.rmse, exact.corrected, exact.flip, exact.bias), (0.0, 0.0, 0.0, 0.0));
        let bright = reference.errors_of(&[1.0; 48]).unwrap();
        assert!((bright.bias - 1.0).abs() < 1e-6 && bright.flip > 0.1);
        assert!((bright.rel_mse - 0.25 / 0.26).abs() < 1e-6);
        let rmse = f64::from(1.0 - srgb_encode(0.5));
        assert!((bright.rmse - rmse).abs() < 1e-6 && bright.corrected < bright.rmse);
    }

    #[test]
    fn errors_of_visibility_are_over_what_shows_something() {
        let mask = Some(vec![1.0, 0.0, 1.0, 0.0]);
        let reference = FrameReference::new([&[0.5; 4], &[0.5; 4]], 1, 4, mask).unwrap();
        let errors = reference.errors_of(&[0.75, 0.0, 0.75, 0.0]).unwrap();
        assert_eq!((errors.rmse, errors.bias), (0.25, 0.25));
        let [tanimoto, ratio] = errors.similarity.unwrap();
        assert!(tanimoto > 0.8 && tanimoto < 1.0 && (ratio - 2.0 / 3.0).abs() < 1e-6, "{tanimoto} {ratio}");
        let mean = ImageErrors::mean(&[errors, ImageErrors { similarity: Some([1.0, 1.0]), ..errors }]).unwrap();
        assert!((mean.similarity.unwrap()[0] - 0.5 * (1.0 + tanimoto)).abs() < 1e-12);
        assert_eq!((errors.over(&errors), errors.over(&ImageErrors::default())), (Some(1.0), None));
    }

    #[test]
    fn flicker_is_between_late_frames() {
        let frame = |v: f32| Displayed { linear: vec![v; 4], coded: vec![v; 4] };
        let mut meter = FlickerMeter::new(6);
        // the first three do not count
        for v in [0.0, 1.0, 0.0, 0.5, 0.6, 0.6] {
            meter.add(&frame(v)).unwrap();
        }
        let flicker = meter.result().unwrap();
        assert_eq!(flicker.after, 4);
        assert!((flicker.greatest - 0.1).abs() < 1e-6 && (flicker.rms - 0.1 / 2f64.sqrt()).abs() < 1e-6);
        // too soon to tell
        assert_eq!(flicker.is_invisible(), None);
        assert_eq!(Flicker { after: 64, ..flicker }.is_invisible(), Some(false));
        assert!(FlickerMeter::new(96).result().is_none());
        assert_eq!(FlickerMeter::new(96).after, 64);
    }

    #[test]
    fn the_references_own_error_is_taken_off() {
        assert!((without_reference(0.5, 0.3) - 0.4).abs() < 1e-12);
        assert_eq!(without_reference(0.1, 0.2), 0.0);
        assert!(without_reference(f64::NAN, 0.1).is_nan());
    }
}
