//! Images as they are displayed, by which they are compared: lamps and the sun, hundreds of times as bright as all else, would be all that an error of radiance says.

use crate::bench::record::frames::{Flicker, FrameErrors};
use crate::bench::record::without_reference;
use crate::colour::srgb_encode;
use crate::error::Result;
use crate::measure::flip::{PIXELS_PER_DEGREE, flip};
use crate::measure::metrics::ImagePair;
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
    /// Converts ambient visibility (1 channel), or radiance (3). What is not finite stays so: broken pixels must not be averaged away.
    pub fn new(values: &[f32], channels: usize) -> Self {
        let linear: Vec<f32> = match channels {
            3 => values
                .chunks_exact(3)
                .flat_map(|c| match c.iter().all(|v| v.is_finite()) {
                    true => ToneMap::default().map([c[0], c[1], c[2]]).map(|v| v.clamp(0.0, 1.0)),
                    false => [f32::NAN; 3],
                })
                .collect(),
            _ => values.iter().map(|v| v.clamp(0.0, 1.0)).collect(),
        };
        let coded = linear.iter().map(|v| srgb_encode(*v)).collect();
        Self { linear, coded }
    }
}

/// A converged image, and how well it is known.
pub struct FrameReference {
    values: Vec<f32>,
    /// As it is displayed.
    pub displayed: Displayed,
    /// Standard error of what is displayed.
    pub rmse: f64,
    channels: usize,
    width: usize,
}

impl FrameReference {
    /// The mean of two independent halves.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for halves of different sizes.
    pub fn new(halves: [&[f32]; 2], channels: usize, width: usize) -> Result<Self> {
        let [a, b] = halves.map(|half| Displayed::new(half, channels));
        let rmse = 0.5 * ImagePair::new(&a.coded, &b.coded, channels, None)?.rmse();
        let values: Vec<f32> = halves[0].iter().zip(halves[1]).map(|(a, b)| 0.5 * (a + b)).collect();
        Ok(Self { displayed: Displayed::new(&values, channels), values, rmse, channels, width })
    }

    /// Errors of an image, of linear values.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for another size.
    pub fn errors_of(&self, image: &[f32]) -> Result<FrameErrors> {
        let displayed = Displayed::new(image, self.channels);
        let rmse = self.rmse_over(&displayed, None)?;
        let values = ImagePair::new(image, &self.values, self.channels, None)?;
        let looks = ImagePair::new(&displayed.linear, &self.displayed.linear, self.channels, None)?;
        let shown = &self.displayed.linear;
        let mean = shown.iter().map(|v| f64::from(*v)).sum::<f64>() / shown.len().max(1) as f64;
        Ok(FrameErrors {
            rmse,
            rmse_corrected: without_reference(rmse, self.rmse),
            rel_mse: values.rel_mse(),
            bias: looks.bias() / mean,
            flip: flip(&looks, self.width, PIXELS_PER_DEGREE)?.mean,
        })
    }

    /// RMSE of what is displayed, over the pixels whose `mask` is above 0 (`None`: all).
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for another size.
    pub fn rmse_over(&self, displayed: &Displayed, mask: Option<&[f32]>) -> Result<f64> {
        Ok(ImagePair::new(&displayed.coded, &self.displayed.coded, self.channels, mask)?.rmse())
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
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when sizes differ.
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

    /// What was found; `None` for too few frames.
    pub fn result(&self) -> Option<Flicker> {
        let squares: f64 = self.pairs.iter().map(|p| p * p).sum();
        let greatest = self.pairs.iter().fold(0.0, |most: f64, p| if p.is_nan() { f64::NAN } else { most.max(*p) });
        let rms = (squares / self.pairs.len() as f64).sqrt();
        (!self.pairs.is_empty()).then_some(Flicker { after: self.after, rms, greatest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_are_as_bright_as_the_display() {
        let lamp = Displayed::new(&[0.0, 0.5, 50.0], 3);
        assert_eq!(lamp.linear, [0.0, 0.5, 1.0]);
        assert!((lamp.coded[1] - 0.7354).abs() < 1e-4 && (lamp.coded[2] - 1.0).abs() < 1e-6);
        assert_eq!(Displayed::new(&[1.5], 1).linear, [1.0]);
        assert!(Displayed::new(&[0.0, f32::NAN, 1.0], 3).coded.iter().all(|v| v.is_nan()));
    }

    #[test]
    fn errors_of_displayed_images() {
        let (a, b) = ([0.25f32; 48], [0.75f32; 48]);
        let reference = FrameReference::new([&a, &b], 3, 4).unwrap();
        let expected = 0.5 * f64::from(srgb_encode(0.75) - srgb_encode(0.25));
        assert!((reference.rmse - expected).abs() < 1e-6);
        // what is right is better than the reference knows
        let exact = reference.errors_of(&[0.5; 48]).unwrap();
        assert_eq!((exact.rmse, exact.rmse_corrected, exact.flip, exact.bias), (0.0, 0.0, 0.0, 0.0));
        let bright = reference.errors_of(&[1.0; 48]).unwrap();
        assert!((bright.bias - 1.0).abs() < 1e-6 && bright.flip > 0.1);
        assert!((bright.rel_mse - 0.25 / 0.26).abs() < 1e-6);
        let rmse = f64::from(1.0 - srgb_encode(0.5));
        assert!((bright.rmse - rmse).abs() < 1e-6 && bright.rmse_corrected < bright.rmse);
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
}
