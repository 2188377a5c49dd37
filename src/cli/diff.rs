//! `skylit diff`: compares two images by metrics, channel by channel.

use serde_json::json;

use super::args::DiffArgs;
use crate::error::{Error, Result};
use crate::measure::flip::{PIXELS_PER_DEGREE, flip};
use crate::measure::metrics::ImagePair;
use crate::output::{self, Channel, Image, Samples};
use crate::terminal::console::Failure;

/// ChannelDifference of two channels, over the pixels where both are finite and at least one image has coverage.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
struct ChannelDifference {
    /// Pixels compared.
    pixels: u64,
    /// Pixels whose values differ.
    differing: u64,
    /// Pixels where one image is finite and the other is not, or where they are not finite in different ways.
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

/// Perceived difference of the colours (FLIP), over the pixels where all channels are finite and at least one image has coverage.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
struct FlipDifference {
    /// Colour channels: `R`, `G` and `B`, or a single grey one.
    channels: Vec<String>,
    /// Pixels compared.
    pixels: u64,
    /// Mean FLIP, 0 to 1.
    mean: f64,
    /// Assumed angular resolution of the display, pixels per degree.
    pixels_per_degree: f64,
}

/// Compares and prints; fails if the limit is given and exceeded.
pub fn run(args: &DiffArgs) -> Result<(), Failure> {
    let console = args.verbosity.console();
    let (a, b) = (output::load(&args.a)?, output::load(&args.b)?);
    if (a.width, a.height) != (b.width, b.height) {
        let (a, b) = ([a.width, a.height], [b.width, b.height]);
        return Err(Error::Usage(format!("the images differ in size: {}x{} and {}x{}", a[0], a[1], b[0], b[1])).into());
    }
    let mask = coverage(&a, &b);
    let mut worst = 0f64;
    let mut records = Vec::new();
    let pairs = pairs(&a, &b);
    for (x, y) in &pairs {
        let d = compare(&x.samples, &y.samples, mask.as_deref())?;
        let mut line = format!("{:12} ", x.name);
        if let Some(n) = &d.metrics {
            // a pixel that is not finite in one image only always exceeds the limit
            worst = worst.max(if d.broken > 0 { f64::INFINITY } else { n.rmse });
            line += &format!("rmse {:.3e}  bias {:+.3e}  max {:.3e}  psnr {:.1} dB  ", n.rmse, n.bias, n.max, n.psnr);
        }
        console.line(&format!("{line}differing {} of {}, broken {}", d.differing, d.pixels, d.broken))?;
        let mut record = json!(d);
        record["channel"] = json!(x.name);
        records.push(record);
    }
    if records.is_empty() {
        return Err(Error::Usage("the images have no channel in common".into()).into());
    }
    let look = flip_difference(&pairs, a.width as usize, mask.as_deref())?;
    if let Some(l) = &look {
        console.line(&format!(
            "{:12} flip {:.4} ({:.0} pixels per degree)",
            l.channels.join(" "),
            l.mean,
            l.pixels_per_degree
        ))?;
    }
    let covered = mask.is_some();
    let verdict = match args.max_rmse {
        Some(limit) if worst > limit => {
            Err(Error::CheckFailed(format!("the images differ by an RMSE of {worst:.3e}, more than {limit:e}")))
        }
        _ => Ok(()),
    };
    let record = json!({ "a": args.a, "b": args.b, "covered_pixels_only": covered, "channels": records, "flip": look });
    console.close(&record, verdict)
}

/// Channels of the same name and type; a grey image (`Y`) is also compared with one that names its channel `R`. The film state (`state.*`) is not compared.
fn pairs<'a>(a: &'a Image, b: &'a Image) -> Vec<(&'a Channel, &'a Channel)> {
    let same_type = |x: &Channel, y: &Channel| std::mem::discriminant(&x.samples) == std::mem::discriminant(&y.samples);
    let find = |image: &'a Image, name: &str| image.channels.iter().find(|c| c.name == name);
    let mut found: Vec<_> = a
        .channels
        .iter()
        .filter(|x| !x.name.starts_with("state."))
        .filter_map(|x| find(b, &x.name).filter(|y| same_type(x, y)).map(|y| (x, y)))
        .collect();
    if found.is_empty() {
        for (p, q) in [("Y", "R"), ("R", "Y")] {
            found.extend(find(a, p).zip(find(b, q)));
        }
    }
    found
}

/// 1 for pixels that at least one image covers, if both have an alpha channel: equal background would flatter every mean.
fn coverage(a: &Image, b: &Image) -> Option<Vec<f32>> {
    let (a, b) = (a.f32("A")?, b.f32("A")?);
    Some(a.iter().zip(b).map(|(x, y)| x.max(*y)).collect())
}

/// FLIP of the colour channels that the images have in common, if any.
fn flip_difference(pairs: &[(&Channel, &Channel)], width: usize, mask: Option<&[f32]>) -> Result<Option<FlipDifference>> {
    let find = |name: &str| {
        pairs.iter().find(|(x, _)| x.name == name).and_then(|(x, y)| match (&x.samples, &y.samples) {
            (Samples::F32(a), Samples::F32(b)) => Some((&x.name, [a, b])),
            _ => None,
        })
    };
    let found: Vec<_> = match ["R", "G", "B"].map(find) {
        [Some(r), Some(g), Some(b)] => vec![r, g, b],
        [red, ..] => find("Y").or(red).into_iter().collect(),
    };
    let (channels, planes): (Vec<String>, Vec<_>) = found.into_iter().map(|(name, planes)| (name.clone(), planes)).unzip();
    let Some(count) = planes.first().map(|[a, _]| a.len()) else { return Ok(None) };
    let counts = |i: usize| mask.is_none_or(|m| m[i] > 0.0) && planes.iter().flatten().all(|p| p[i].is_finite());
    let counted: Vec<f32> = (0..count).map(|i| f32::from(u8::from(counts(i)))).collect();
    let pixels = counted.iter().filter(|c| **c > 0.0).count() as u64;
    if pixels == 0 {
        return Ok(None);
    }
    let [image, reference] = [0, 1].map(|k| (0..count).flat_map(|i| planes.iter().map(move |p| p[k][i])).collect::<Vec<_>>());
    let pair = ImagePair::new(&image, &reference, channels.len(), Some(&counted))?;
    let mean = flip(&pair, width, PIXELS_PER_DEGREE)?.mean;
    Ok(Some(FlipDifference { channels, pixels, mean, pixels_per_degree: PIXELS_PER_DEGREE }))
}

fn compare(a: &Samples, b: &Samples, mask: Option<&[f32]>) -> Result<ChannelDifference> {
    let inside = |i: usize| mask.is_none_or(|m| m[i] > 0.0);
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
    // no comparable pixel, but some that are not finite in one image: the limit must be exceeded
    if d.metrics.is_none() && d.broken > 0 {
        let nan = f64::NAN;
        d.metrics =
            Some(Metrics { rmse: nan, bias: nan, max: nan, rel_mse: nan, psnr: nan, minimum_ratio: nan, tanimoto: nan });
    }
    Ok(d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_differences() {
        let inf = f32::INFINITY;
        let (a, b) = (Samples::F32(vec![1.0, 2.0, inf, inf, f32::NAN]), Samples::F32(vec![1.0, 4.0, inf, 1.0, f32::NAN]));
        let d = compare(&a, &b, None).unwrap();
        let n = d.metrics.unwrap();
        assert_eq!((d.pixels, d.differing, d.broken, n.max, n.bias), (2, 1, 1, 2.0, -1.0));
        assert!((n.rmse - 2f64.sqrt()).abs() < 1e-12);
        let masked = compare(&a, &b, Some(&[1.0, 0.0, 1.0, 0.0, 1.0])).unwrap();
        assert_eq!((masked.pixels, masked.differing, masked.broken), (1, 0, 0));
        let ids = compare(&Samples::U32(vec![1, 2]), &Samples::U32(vec![1, 3]), None).unwrap();
        assert_eq!((ids.pixels, ids.differing, ids.metrics), (2, 1, None));
    }

    #[test]
    fn flip_needs_colour_channels() {
        let channel = |name: &str, values: &[f32]| Channel { name: name.into(), samples: Samples::F32(values.to_vec()) };
        let [black, white, broken] = [[0.0; 4], [1.0; 4], [f32::NAN, 1.0, 1.0, 1.0]].map(|v| channel("Y", &v));
        let of = |x: &Channel, y: &Channel, mask: Option<&[f32]>| flip_difference(&[(x, y)], 2, mask).unwrap();
        let far = of(&black, &white, None).unwrap();
        assert_eq!((&far.channels[..], far.pixels), (&["Y".to_owned()][..], 4));
        assert!((far.mean - 0.967).abs() < 1e-3);
        assert_eq!(of(&broken, &broken, None).unwrap().pixels, 3);
        assert_eq!(
            of(&white, &white, Some(&[1.0, 0.0, 0.0, 0.0])).unwrap(),
            FlipDifference { mean: 0.0, pixels: 1, ..far.clone() }
        );
        assert_eq!(of(&white, &white, Some(&[0.0; 4])), None);
        assert_eq!(of(&channel("depth.Z", &[0.0; 4]), &channel("depth.Z", &[1.0; 4]), None), None);
        let planes = |v: f32| ["B", "G", "R"].map(|name| channel(name, &[v; 4]));
        let (a, b) = (planes(0.2), planes(0.3));
        let colour = flip_difference(&a.iter().zip(&b).collect::<Vec<_>>(), 2, None).unwrap().unwrap();
        assert!(colour.channels == ["R", "G", "B"] && colour.mean > 0.01, "{colour:?}");
    }
}
