//! Whether an image is that of its golden image, within the frame's tolerance.

use serde::Serialize;
use serde_json::{Value, json};

use super::golden::{Golden, shown_image};
use super::manifest::{Frame, GoldenFormat};
use super::text::plural;
use super::tolerance::{FlipLimit, ZTestLimit};
use crate::colour::srgb_decode;
use crate::error::Result;
use crate::measure::flip::{PIXELS_PER_DEGREE, flip};
use crate::measure::metrics::ImagePair;
use crate::measure::stats::percentile;
use crate::measure::z_test::{Estimate, Scale, TILE, ZTest, ZTestVerdict};
use crate::output::{Image, Samples, png};
use crate::report::format_number;

/// Difference of a shown value, of 255, beyond which a pixel is bad.
pub const BAD_DIFFERENCE: u8 = 25;

/// A condition, and whether it holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The manifest's name for it, or `size`, `channels` and `finite`, which hold for every frame.
    pub condition: &'static str,
    pub holds: bool,
    /// The finding, in a few words.
    pub text: String,
    /// The finding, in numbers.
    pub values: Value,
}

impl Check {
    fn new(condition: &'static str, holds: bool, text: impl Into<String>, values: Value) -> Self {
        Self { condition, holds, text: text.into(), values }
    }
}

/// The conditions on a frame, one after another.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Judgement {
    pub checks: Vec<Check>,
}

impl Judgement {
    pub fn holds(&self) -> bool {
        self.checks.iter().all(|c| c.holds)
    }

    /// The findings of conditions that do not hold, or of all if all hold.
    pub fn text(&self) -> String {
        let holds = self.holds();
        let texts = self.checks.iter().filter(|c| c.holds == holds && !c.text.is_empty()).map(|c| c.text.as_str());
        texts.collect::<Vec<_>>().join("; ")
    }
}

/// Judges an image.
///
/// # Errors
/// [`crate::Error::Usage`] for an image that lacks what the tolerance is about.
pub fn judge(frame: &Frame, image: &Image, golden: &Golden) -> Result<Judgement> {
    let [size, golden_size] = [image, &golden.image].map(|i| [i.width, i.height]);
    if size != golden_size {
        let text = |s: [u32; 2]| format!("{}x{}", s[0], s[1]);
        let text = format!("the image is {} pixels, the golden image {}", text(size), text(golden_size));
        return Ok(Judgement {
            checks: vec![Check::new("size", false, text, json!({ "image": size, "golden": golden_size }))],
        });
    }

    // Everything else asks for finite values.
    let tolerance = &frame.tolerance;
    let broken = broken_pixels(frame, image, golden);
    let text = if broken == 0 {
        String::new()
    } else {
        format!("{} with values that are not finite", plural(broken as usize, "pixel", "pixels"))
    };
    let mut checks = vec![Check::new("finite", broken == 0, text, json!({ "pixels": broken }))];
    if tolerance.exact {
        checks.push(check_exact(frame, image, golden)?);
        return Ok(Judgement { checks });
    }
    let (shown, expected) = (Shown::from_image(&shown_image(frame, image), golden)?, Shown::golden(frame, golden)?);
    if shown.channels != expected.channels {
        let text =
            format!("the image has {} channels of colour, the golden image {}", shown.channels, expected.channels);
        checks.push(Check::new(
            "channels",
            false,
            text,
            json!({ "image": shown.channels, "golden": expected.channels }),
        ));
        return Ok(Judgement { checks });
    }

    // Applies every condition of the tolerance, so that the reader sees all that differ.
    if let Some(limit) = &tolerance.flip {
        checks.push(check_flip(limit, &shown, &expected)?);
    }
    if let Some(cap) = tolerance.bad_pixels {
        let far = |(a, b): (&[u8], &[u8])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > BAD_DIFFERENCE);
        let pairs = shown.bytes.chunks(shown.channels).zip(expected.bytes.chunks(shown.channels));
        let bad = pairs.filter(|p| far(*p)).count() as u64;
        let values = json!({ "pixels": bad, "max": cap });
        checks.push(Check::new("bad_pixels", bad <= cap, format!("{bad} bad pixels of at most {cap}"), values));
    }
    if let (Some(limit), Some(reference)) = (&tolerance.z_test, &golden.reference) {
        let test = ZTest { false_alarms: limit.false_alarms };
        let verdict = test.compare(&Estimate::from_image(image)?, reference)?;
        checks.push(check_noise(limit, test.holds(&verdict), &verdict));
    }
    Ok(Judgement { checks })
}

/// Counts pixels that are NaN, finite in one image alone, or lack samples that were not finite.
fn broken_pixels(frame: &Frame, image: &Image, golden: &Golden) -> u64 {
    let pixels = image.pixel_count();
    let mut broken = vec![false; pixels];
    for channel in &image.channels {
        if let (Samples::F32(values), Some(expected)) = (&channel.samples, golden.image.f32(&channel.name)) {
            // distances to the background are infinite in both
            let is_broken = |a: f32, b: f32| a.is_nan() || b.is_nan() || a.is_finite() != b.is_finite();
            (0..pixels).for_each(|p| broken[p] |= is_broken(values[p], expected[p]));
        }
    }
    // all pixels of a still get the same samples, but where they stop once they are good enough
    let samples = image.channels.iter().find(|c| c.name == "samples").map(|c| &c.samples);
    let is_still = frame.settings.realtime_setting().is_none() && frame.baked.is_none();
    let film = &frame.settings.film;
    let is_even = is_still && film.target_rmse.is_none() && film.quality.is_none();
    if let (Some(Samples::F32(samples)), true) = (samples, is_even) {
        let most = samples.iter().copied().fold(0.0, f32::max);
        samples.iter().zip(&mut broken).for_each(|(n, broken)| *broken |= *n < most);
    }
    broken.iter().filter(|b| **b).count() as u64
}

/// Bit for bit, every channel that the golden image has.
fn check_exact(frame: &Frame, image: &Image, golden: &Golden) -> Result<Check> {
    let (mut differing, mut largest, mut worst) = (vec![false; image.pixel_count()], 0.0f64, String::new());
    if frame.format == GoldenFormat::Png {
        let (shown, expected) = (Shown::from_image(&shown_image(frame, image), golden)?, Shown::golden(frame, golden)?);
        if shown.channels != expected.channels {
            return Ok(Check::new("exact", false, "one image is grey, the other has colour", Value::Null));
        }
        for (k, (a, b)) in shown.bytes.iter().zip(&expected.bytes).enumerate() {
            differing[k / shown.channels] |= a != b;
            largest = largest.max(f64::from(a.abs_diff(*b)) / 255.0);
        }
    } else {
        for expected in &golden.image.channels {
            let Some(channel) = image.channels.iter().find(|c| c.name == expected.name) else {
                let text = format!("the image has no channel {}", expected.name);
                return Ok(Check::new("exact", false, text, json!({ "channel": expected.name })));
            };
            let differs = |p: usize| match (&channel.samples, &expected.samples) {
                (Samples::F32(a), Samples::F32(b)) => {
                    a[p].to_bits() != b[p].to_bits() && !(a[p].is_nan() && b[p].is_nan())
                }
                (Samples::U32(a), Samples::U32(b)) => a[p] != b[p],
                _ => true,
            };
            let by = |p: usize| match (&channel.samples, &expected.samples) {
                (Samples::F32(a), Samples::F32(b)) => f64::from((a[p] - b[p]).abs()),
                _ => 0.0,
            };
            for p in (0..differing.len()).filter(|&p| differs(p)) {
                differing[p] = true;
                if by(p) > largest || worst.is_empty() {
                    (largest, worst) = (by(p).max(largest), expected.name.clone());
                }
            }
        }
    }

    // Describes the differences, and where the golden image is from.
    let pixels = differing.iter().filter(|d| **d).count();
    let values = json!({ "pixels": pixels, "max": largest, "channel": worst });
    if pixels == 0 {
        return Ok(Check::new("exact", true, "bit for bit", values));
    }
    let channel = if worst.is_empty() { String::new() } else { format!(" ({worst})") };
    let mut text = format!(
        "{pixels} of {} pixels are not the same, by up to {}{channel}",
        differing.len(),
        format_number(largest)
    );
    if let Some(driver) = golden.driver() {
        text += &format!("; the golden image was made on {driver}");
    }
    Ok(Check::new("exact", false, text, values))
}

/// An image as it is shown: 8-bit sRGB, channels interleaved.
struct Shown {
    channels: usize,
    width: usize,
    bytes: Vec<u8>,
}

impl Shown {
    fn from_image(image: &Image, golden: &Golden) -> Result<Self> {
        let (bytes, colour) = png::bytes_of(image, 0.0, &golden.path)?;
        Ok(Self { channels: colour.channels(), width: image.width as usize, bytes })
    }

    fn golden(frame: &Frame, golden: &Golden) -> Result<Self> {
        match frame.format {
            // a picture already
            GoldenFormat::Png => Self::from_image(&golden.image, golden),
            GoldenFormat::Exr => Self::from_image(&shown_image(frame, &golden.image), golden),
        }
    }

    fn linear(&self) -> Vec<f32> {
        self.bytes.iter().map(|b| srgb_decode(f32::from(*b) / 255.0)).collect()
    }
}

/// A percentile of FLIP.
fn check_flip(limit: &FlipLimit, shown: &Shown, expected: &Shown) -> Result<Check> {
    let (a, b) = (shown.linear(), expected.linear());
    let flip = flip(&ImagePair::new(&a, &b, shown.channels, None)?, shown.width, PIXELS_PER_DEGREE)?;
    let errors: Vec<f64> = flip.map.iter().map(|e| f64::from(*e)).collect();
    let found = percentile(&errors, limit.percentile / 100.0).unwrap_or(f64::NAN);
    let (percentile, max) = (limit.percentile, limit.max);
    let holds = found <= max;
    let text = format!("FLIP {found:.4} at the {percentile}th percentile, at most {max}");
    Ok(Check::new(
        "flip",
        holds,
        text,
        json!({ "percentile": percentile, "value": found, "max": max, "mean": flip.mean }),
    ))
}

fn check_noise(limit: &ZTestLimit, holds: bool, verdict: &ZTestVerdict) -> Check {
    let percent = |x: f64| 100.0 * x;
    let bias = format!("bias {:+.3} % +- {:.3} %", percent(verdict.bias), percent(verdict.bias_error));
    let p = if verdict.p < 1e-3 { format!("{:.1e}", verdict.p) } else { format!("{:.3}", verdict.p) };
    let mut text = format!("p {p}, {bias}");
    if !holds {
        let worst = verdict.extremes.iter().min_by(|a, b| a.p.total_cmp(&b.p)).unwrap_or(&verdict.extremes[0]);
        let [x, y] = worst.at;
        let what = match worst.scale {
            Scale::Pixel => format!("pixel {x}, {y}"),
            Scale::Tile => format!("the mean over the {TILE}x{TILE} pixels at {x}, {y}"),
            Scale::Mean => "the image's mean".to_owned(),
        };
        let now = worst.reference + worst.difference;
        text += &format!("; {what} is {now:.4}, not {:.4}: {:.1} standard errors", worst.reference, worst.score.abs());
    }
    let mut values = json!(verdict);
    values["false_alarms"] = json!(limit.false_alarms);
    Check::new("z_test", holds, text, values)
}
