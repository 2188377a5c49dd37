//! `skylit diff`: do two images agree? Compares their colour, or the channels that are named, and
//! lists the other channels that both have.

use serde_json::json;

use super::args::DiffArgs;
use crate::error::{Error, Result};
use crate::measure::comparison::{self, CompareOptions, Comparison};
use crate::measure::flip::PIXELS_PER_DEGREE;
use crate::measure::mask::MaskOptions;
use crate::measure::metrics::ImagePair;
use crate::memory::Budget;
use crate::output::{self, Channel, Image, Samples};
use crate::terminal::console::Failure;

/// Difference of two channels of the same name, over the pixels of the mask where both are finite.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
struct ChannelDifference {
    /// Pixels compared.
    pixels: u64,
    /// Pixels whose values differ.
    differing: u64,
    /// Pixels where one image is finite and the other is not, or where they are not finite in
    /// different ways.
    broken: u64,
    /// The metrics of [`crate::measure::metrics`]; ids have none.
    #[serde(flatten)]
    metrics: Option<Metrics>,
}

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
struct Metrics {
    rmse: f64,
    bias: f64,
    max: f64,
    rel_mse: f64,
    psnr: f64,
    minimum_ratio: f64,
    tanimoto: f64,
}

/// Compares and prints; fails if the limit is given and exceeded.
pub fn run(args: &DiffArgs) -> Result<(), Failure> {
    let console = args.verbosity.console();
    let budget = Budget::default();
    let (a, b) = (output::load_within(&args.a, &budget)?, output::load_within(&args.b, &budget)?);
    comparison::check_size(&a, &b)?;
    let options = CompareOptions {
        channels: args.channels.clone(),
        mask: MaskOptions { covered: !args.all_pixels, ..Default::default() },
    };
    let compared = comparison::compare(&a, &b, &options)?;
    let mut records = Vec::new();
    for (x, y) in &pairs(&a, &b) {
        let d = compare(&x.samples, &y.samples, &compared.maps.mask)?;
        console.line(&format!("{:12} {}", x.name, difference_text(&d)))?;
        let mut record = json!(d);
        record["channel"] = json!(x.name);
        records.push(record);
    }
    console.line(&summary(&compared))?;
    let flip = compared.flip.map(|mean| {
        json!({ "channels": compared.channels, "pixels": compared.pixels, "mean": mean, "pixels_per_degree": PIXELS_PER_DEGREE })
    });
    let record = json!({
        "a": args.a,
        "b": args.b,
        "mask": compared.mask,
        "covered_pixels_only": !args.all_pixels && a.f32("A").is_some() && b.f32("A").is_some(),
        "channels": records,
        "flip": flip,
        "compared": compared,
    });
    console.close(&record, judge(&compared, args.max_rmse))
}

/// Fails if nothing can be compared, a pixel is broken, or a compared channel differs by more than
/// the limit, if there is one.
fn judge(compared: &Comparison, limit: Option<f64>) -> Result<()> {
    compared.check()?;
    let Some(limit) = limit else { return Ok(()) };
    // a limit that NaN is compared with does not hold
    if compared.channel_rmse.iter().all(|e| *e <= limit) {
        return Ok(());
    }
    let worst = compared.channel_rmse.iter().copied().fold(f64::NAN, f64::max);
    Err(Error::CheckFailed(format!("the images differ by an RMSE of {worst:.3e}, more than {limit:e}")))
}

/// How far a channel is from the reference's, in a line.
fn difference_text(d: &ChannelDifference) -> String {
    let mut text = match (d.metrics, d.differing) {
        _ if d.pixels == 0 => "no pixel to compare".into(),
        (_, 0) => format!("equal in all {} pixels", d.pixels),
        (None, n) => format!("differs in {n} of {} pixels", d.pixels),
        (Some(m), n) => format!(
            "rmse {:.3e}  bias {:+.3e}  max {:.3e}  psnr {:.1} dB  differs in {n} of {} pixels",
            m.rmse, m.bias, m.max, m.psnr, d.pixels
        ),
    };
    if d.broken > 0 {
        text += &format!("; NaN or infinite in one of the images: {} pixels", d.broken);
    }
    text
}

/// Returns a line that says which images were compared.
fn summary(c: &Comparison) -> String {
    if c.pixels == 0 {
        return format!("{}: no pixel to compare, over {}", c.channels.join(" "), c.mask);
    }
    let error = if c.bias_standard_error > 0.0 { format!(" +- {:.1e}", c.bias_standard_error) } else { String::new() };
    let mut parts = if c.rmse == 0.0 {
        vec!["rmse 0".to_owned()]
    } else {
        vec![format!("rmse {:.3e}", c.rmse), format!("bias {:+.3e}{error}", c.bias)]
    };
    parts.extend(c.ssim.map(|v| format!("ssim {v:.4}")));
    parts.extend(c.flip.map(|v| format!("flip {v:.4}")));
    parts.extend(c.flip_hdr.map(|v| format!("flip over exposures {v:.4}")));
    parts.extend(c.bad.outliers.map(|n| format!("outliers {n}")));
    parts.extend(c.reference_standard_error.map(|e| {
        if e < c.rmse {
            format!("standard error of the reference {e:.1e}")
        } else {
            // of which the RMSE is a part
            format!("standard error of the reference {e:.1e}, so that the true RMSE is at most about as large")
        }
    }));
    format!("{}: {}, over {}", c.channels.join(" "), parts.join(", "), c.mask)
}

/// Channels of the same name and type. The film state (`state.*`) is not compared.
fn pairs<'a>(a: &'a Image, b: &'a Image) -> Vec<(&'a Channel, &'a Channel)> {
    let same_type = |x: &Channel, y: &Channel| std::mem::discriminant(&x.samples) == std::mem::discriminant(&y.samples);
    let find = |name: &str| b.channels.iter().find(|c| c.name == name);
    let own = a.channels.iter().filter(|x| !x.name.starts_with("state."));
    own.filter_map(|x| find(&x.name).filter(|y| same_type(x, y)).map(|y| (x, y))).collect()
}

fn compare(a: &Samples, b: &Samples, mask: &[f32]) -> Result<ChannelDifference> {
    let inside = |i: usize| mask[i] > 0.0;
    let mut d = ChannelDifference { pixels: 0, differing: 0, broken: 0, metrics: None };
    match (a, b) {
        (Samples::F32(a), Samples::F32(b)) => {
            let finite: Vec<f32> =
                (0..a.len()).map(|i| f32::from(u8::from(inside(i) && a[i].is_finite() && b[i].is_finite()))).collect();
            for i in (0..a.len()).filter(|&i| inside(i)) {
                // equal infinities (background depth) and two NaNs count as equal
                let same = a[i] == b[i] || a[i].is_nan() && b[i].is_nan();
                if finite[i] > 0.0 { d.differing += u64::from(!same) } else { d.broken += u64::from(!same) }
            }
            let pair = ImagePair::new(a, b, 1, Some(&finite))?;
            d.pixels = pair.count();
            d.metrics = (d.pixels > 0).then(|| Metrics {
                rmse: pair.rmse(),
                bias: pair.bias(),
                max: pair.max_abs_difference(),
                rel_mse: pair.rel_mse(),
                psnr: pair.psnr(),
                minimum_ratio: pair.minimum_ratio(),
                tanimoto: pair.tanimoto(),
            });
        }
        (Samples::U32(a), Samples::U32(b)) => {
            for i in (0..a.len()).filter(|&i| inside(i)) {
                d.pixels += 1;
                d.differing += u64::from(a[i] != b[i]);
            }
        }
        _ => {}
    }
    Ok(d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_differences() {
        let inf = f32::INFINITY;
        let (a, b) =
            (Samples::F32(vec![1.0, 2.0, inf, inf, f32::NAN]), Samples::F32(vec![1.0, 4.0, inf, 1.0, f32::NAN]));
        let d = compare(&a, &b, &[1.0; 5]).unwrap();
        let n = d.metrics.unwrap();
        assert_eq!((d.pixels, d.differing, d.broken, n.max, n.bias), (2, 1, 1, 2.0, -1.0));
        assert!((n.rmse - 2f64.sqrt()).abs() < 1e-12);
        let masked = compare(&a, &b, &[1.0, 0.0, 1.0, 0.0, 1.0]).unwrap();
        assert_eq!((masked.pixels, masked.differing, masked.broken), (1, 0, 0));
        let ids = compare(&Samples::U32(vec![1, 2]), &Samples::U32(vec![1, 3]), &[1.0; 2]).unwrap();
        assert_eq!((ids.pixels, ids.differing, ids.metrics), (2, 1, None));
        assert_eq!(difference_text(&ids), "differs in 1 of 2 pixels");
        assert_eq!(difference_text(&masked), "equal in all 1 pixels");
        assert!(
            difference_text(&d).ends_with("differs in 1 of 2 pixels; NaN or infinite in one of the images: 1 pixels")
        );
        let none = compare(&a, &b, &[0.0; 5]).unwrap();
        assert_eq!(difference_text(&none), "no pixel to compare");
    }

    #[test]
    fn errors_are_said_as_they_are_meant() {
        let line = |rmse, reference_standard_error| {
            let channels = vec!["R".to_owned()];
            summary(&Comparison {
                rmse,
                reference_standard_error,
                channels,
                mask_pixels: 1,
                pixels: 1,
                ..Default::default()
            })
        };
        assert!(line(0.0, None).starts_with("R: rmse 0, over"), "{}", line(0.0, None));
        assert!(
            line(0.02, Some(1e-3))
                .contains("rmse 2.000e-2, bias +0.000e0, standard error of the reference 1.0e-3, over")
        );
        assert!(line(0.02, Some(3e-2)).contains("so that the true RMSE is at most about as large"));
    }

    #[test]
    fn limits_hold_for_each_channel_and_no_broken_pixel_passes() {
        let passes = |channel_rmse: Vec<f64>, nan| {
            let bad = comparison::BadPixels { nan, ..Default::default() };
            judge(&Comparison { channel_rmse, bad, mask_pixels: 1, pixels: 1, ..Default::default() }, Some(0.1)).is_ok()
        };
        assert!(passes(vec![0.1, 0.0], 0));
        assert!(
            !passes(vec![0.0, 0.11], 0)
                && !passes(vec![0.0], 1)
                && !passes(vec![f64::NAN], 0)
                && !passes(vec![0.0, f64::NAN], 0)
        );
        // without a limit differences are no failure, but a comparison of nothing is
        let pixels = |mask_pixels, pixels| judge(&Comparison { mask_pixels, pixels, ..Default::default() }, None);
        assert!(pixels(2, 1).is_ok());
        assert!(pixels(0, 0).unwrap_err().to_string().contains("have no pixel of the mask"));
        assert!(pixels(2, 0).unwrap_err().to_string().contains("no pixel of the mask () is finite"));
    }
}
