//! `skylit diff`: two images in numbers, channel by channel.

use serde_json::json;

use super::args::DiffArgs;
use crate::error::{Error, Result};
use crate::output::{self, Channel, Image, Samples};

/// How far apart two channels are, over the pixels where both are finite and at least one image has something.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
struct Difference {
    /// Pixels compared.
    pixels: usize,
    /// Root of the mean squared difference.
    rmse: f64,
    /// Mean of a - b.
    bias: f64,
    /// Largest absolute difference.
    max: f64,
    /// Pixels whose values are not the same.
    differing: usize,
    /// Pixels where one image is finite and the other is not, or both are infinite in different ways.
    broken: usize,
}

/// Compares and prints; fails when a limit was given and is passed.
pub fn run(args: &DiffArgs) -> Result<()> {
    let console = args.verbosity.console();
    let (a, b) = (output::load(&args.a)?, output::load(&args.b)?);
    if (a.width, a.height) != (b.width, b.height) {
        return Err(Error::Usage(format!("the images differ in size: {}x{} and {}x{}", a.width, a.height, b.width, b.height)));
    }
    let mask = coverage(&a, &b);
    let mut worst = 0f64;
    let mut records = Vec::new();
    for (x, y) in pairs(&a, &b) {
        let d = compare(&x.samples, &y.samples, mask.as_deref());
        // a pixel that is broken in one image only is no small difference
        worst = worst.max(if d.broken > 0 { f64::INFINITY } else { d.rmse });
        console.line(&format!(
            "{:12} rmse {:.3e}  bias {:+.3e}  max {:.3e}  differing {} of {}  broken {}",
            x.name, d.rmse, d.bias, d.max, d.differing, d.pixels, d.broken,
        ))?;
        let mut record = json!(d);
        record["channel"] = json!(x.name);
        records.push(record);
    }
    if records.is_empty() {
        return Err(Error::Usage("the images have no channel in common".into()));
    }
    let covered = mask.is_some();
    console.record(&json!({ "a": args.a, "b": args.b, "covered_pixels_only": covered, "channels": records }))?;
    match args.max_rmse {
        Some(limit) if worst > limit => {
            Err(Error::CheckFailed(format!("the images differ by an RMSE of {worst:.3e}, more than {limit:e}")))
        }
        _ => Ok(()),
    }
}

/// Channels of the same name and type; a grey image (`Y`) also goes with one that calls it `R`.
fn pairs<'a>(a: &'a Image, b: &'a Image) -> Vec<(&'a Channel, &'a Channel)> {
    let same_type = |x: &Channel, y: &Channel| std::mem::discriminant(&x.samples) == std::mem::discriminant(&y.samples);
    let find = |image: &'a Image, name: &str| image.channels.iter().find(|c| c.name == name);
    let mut found: Vec<_> =
        a.channels.iter().filter_map(|x| find(b, &x.name).filter(|y| same_type(x, y)).map(|y| (x, y))).collect();
    if found.is_empty() {
        for (p, q) in [("Y", "R"), ("R", "Y")] {
            found.extend(find(a, p).zip(find(b, q)));
        }
    }
    found
}

/// Pixels that at least one image covers, when both know their coverage: background flatters every mean.
fn coverage(a: &Image, b: &Image) -> Option<Vec<bool>> {
    let (a, b) = (a.f32("A")?, b.f32("A")?);
    Some(a.iter().zip(b).map(|(x, y)| *x > 0.0 || *y > 0.0).collect())
}

fn compare(a: &Samples, b: &Samples, mask: Option<&[bool]>) -> Difference {
    let inside = |i: usize| mask.is_none_or(|m| m[i]);
    let mut d = Difference::default();
    let (mut sum, mut squares) = (0.0, 0.0);
    let mut add = |x: f64, y: f64| {
        if !(x.is_finite() && y.is_finite()) {
            // both infinite alike (background depth), or both NaN: nothing differs
            d.broken += usize::from(!(x == y || x.is_nan() && y.is_nan()));
            return;
        }
        let e = x - y;
        d.pixels += 1;
        d.differing += usize::from(e != 0.0);
        d.max = d.max.max(e.abs());
        sum += e;
        squares += e * e;
    };
    match (a, b) {
        (Samples::F32(a), Samples::F32(b)) => {
            a.iter().zip(b).enumerate().filter(|p| inside(p.0)).for_each(|(_, (&x, &y))| add(x.into(), y.into()));
        }
        (Samples::U32(a), Samples::U32(b)) => {
            a.iter().zip(b).enumerate().filter(|p| inside(p.0)).for_each(|(_, (&x, &y))| add(x.into(), y.into()));
        }
        _ => {}
    }
    let n = d.pixels.max(1) as f64;
    d.rmse = (squares / n).sqrt();
    d.bias = sum / n;
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_differences() {
        let inf = f32::INFINITY;
        let (a, b) = (Samples::F32(vec![1.0, 2.0, inf, inf, f32::NAN]), Samples::F32(vec![1.0, 4.0, inf, 1.0, f32::NAN]));
        let d = compare(&a, &b, None);
        assert_eq!((d.pixels, d.differing, d.broken, d.max, d.bias), (2, 1, 1, 2.0, -1.0));
        assert!((d.rmse - 2f64.sqrt()).abs() < 1e-12);
        let masked = compare(&a, &b, Some(&[true, false, true, false, true]));
        assert_eq!((masked.pixels, masked.differing, masked.broken), (1, 0, 0));
    }
}
