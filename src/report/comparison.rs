//! Sections about compared images: the images, metrics, a histogram of differences, worst regions.

use super::{
    Axis, Cell, Chart, Column, ComparedImage, ImageComparison, Mark, Part, Point, Row, Scale, Section, Series, Table,
    format_number,
};
use crate::error::{Error, Result};
use crate::measure::comparison::Comparison;
use crate::output::Image;

/// Bins of the histogram: an odd number, so that 0 is in the middle of one.
const BINS: usize = 81;
/// Regions along each side of the image.
const GRID: u32 = 4;
/// Regions that are listed.
const WORST: usize = 8;

/// An image, as a section names it.
#[derive(Clone, Copy, Debug)]
pub struct NamedImage<'a> {
    /// A short name.
    pub name: &'a str,
    /// More about it, a line; may be empty.
    pub description: &'a str,
    pub image: &'a Image,
    /// The linear colour that it is shown on, by its alpha; measurements are of the image alone.
    pub background: Option<[f32; 3]>,
    /// How it differs from the reference; `None` for the reference itself.
    pub comparison: Option<&'a Comparison>,
}

#[derive(Clone, Debug)]
pub struct Metric {
    pub name: &'static str,
    /// An explanation, with range and unit.
    pub help: &'static str,
    /// `None` where it is not defined.
    pub value: Option<f64>,
    /// The value as it is shown, with its unit; `-` for none.
    pub text: String,
}

/// All metrics of a comparison, always the same ones in the same order.
pub fn metrics(c: &Comparison) -> Vec<Metric> {
    let metric = |name, help, value: Option<f64>| Metric {
        name,
        help,
        value,
        text: value.map_or_else(|| "-".to_owned(), format_number),
    };
    let error = |name, help, value| metric(name, help, Some(value));
    let count = |name, help, value: Option<u64>| Metric {
        name,
        help,
        value: value.map(|n| n as f64),
        text: value.map_or_else(|| "-".to_owned(), |n| n.to_string()),
    };

    // The sign and the standard error of the bias belong to its value.
    let bias_text = format!(
        "{}{} ± {}",
        if c.bias > 0.0 { "+" } else { "" },
        format_number(c.bias),
        format_number(c.bias_standard_error)
    );
    vec![
        error("RMSE", "Root of the mean squared error over all channels; 0 for equal images", c.rmse),
        error("MAE", "Mean absolute error; 0 for equal images", c.mae),
        error(
            "Relative MSE",
            "Mean of the squared error over the squared reference plus 0.01; 0 for equal images",
            c.rel_mse,
        ),
        error("PSNR, dB", "Peak signal-to-noise ratio for a peak of 1; infinite for equal images", c.psnr),
        metric("SSIM", "Structural similarity of what a display shows; 1 for equal images", c.ssim),
        metric("FLIP", "Mean perceived difference of what a display shows, 0 (looks the same) to 1", c.flip),
        metric(
            "FLIP over exposures",
            "Mean perceived difference at the exposure that shows it most (HDR-FLIP), 0 to 1",
            c.flip_hdr,
        ),
        error("Tanimoto", "Tanimoto coefficient; 1 for equal images", c.tanimoto),
        error("Minimum ratio", "Mean of the smaller over the larger value; 1 for equal images", c.minimum_ratio),
        Metric {
            name: "Bias",
            help: "Mean of image - reference, and its standard error were pixels independent",
            value: Some(c.bias),
            text: bias_text,
        },
        error("Maximum", "Greatest absolute difference", c.max),
        error("Median", "Half of the absolute differences are smaller", c.percentiles.p50),
        error("95th percentile", "95 % of the absolute differences are smaller", c.percentiles.p95),
        error("99th percentile", "99 % of the absolute differences are smaller", c.percentiles.p99),
        count(
            "NaN pixels",
            "Pixels where one image is not a number, or both are none",
            Some(c.bad.nan + c.bad.nan_in_both),
        ),
        count("Infinite pixels", "Pixels where one image is infinite and the other is not", Some(c.bad.infinite)),
        count(
            "Outliers",
            "Pixels that differ by more than noise explains: six standard errors, where the reference has variances",
            c.bad.outliers,
        ),
        count("Pixels that differ", "Compared pixels whose values are not the same", Some(c.differing)),
        count("Pixels compared", "Pixels of the mask that are finite in both images", Some(c.pixels)),
        Metric {
            name: "Error of the reference",
            help: "Root mean square of the standard errors of its pixels, were their samples independent: its own noise is at most that, and mostly less, for samples are stratified",
            value: c.reference_standard_error,
            text: c
                .reference_standard_error
                .map_or_else(|| "-".to_owned(), |e| format!("at most {}", format_number(e))),
        },
    ]
}

/// A section of `images` and all measurements; number `reference` is compared with the others.
///
/// # Errors
/// [`Error::Usage`] where the images do not fit together or nothing was compared.
pub fn section(title: &str, images: &[NamedImage], reference: usize) -> Result<Section> {
    let parts = vec![
        Part::Images(image_comparison(images, reference)?),
        Part::Table(metrics_table(images)),
        Part::Chart(histogram(images)),
        Part::Table(region_table(images)),
    ];
    Ok(Section::new(title, parts))
}

/// The images, for a page to show.
///
/// # Errors
/// [`Error::Usage`] where nothing was compared.
pub fn image_comparison(images: &[NamedImage], reference: usize) -> Result<ImageComparison> {
    let widest = images.iter().filter_map(|i| i.comparison).max_by_key(|c| c.channels.len());
    let Some(widest) = widest else {
        return Err(Error::Usage("the report has no image that was compared with another".into()));
    };
    let channels = &widest.channels;
    let first = images[0].image;
    // pixels that no comparison has counted
    let comparisons: Vec<_> = images.iter().filter_map(|i| i.comparison).collect();
    let counts = |k: usize| comparisons.iter().any(|c| c.maps.compared[k] > 0.0);
    let mask: Vec<bool> = (0..first.pixel_count()).map(counts).collect();
    let shown = images.iter().map(|i| {
        let flip = i.comparison.map(|c| c.maps.flip.clone()).filter(|f| !f.is_empty());
        let values = interleaved(i.image, channels, i.background);
        ComparedImage { name: i.name.to_owned(), description: i.description.to_owned(), values, flip }
    });
    Ok(ImageComparison {
        size: [first.width, first.height],
        channels: channels.clone(),
        images: shown.collect(),
        reference,
        mask: mask.contains(&false).then_some(mask),
    })
}

/// Values of the named channels, those of a pixel side by side. A grey image has the same value in
/// all of them; a channel that it lacks otherwise is NaN. What alpha leaves open shows the
/// background.
fn interleaved(image: &Image, channels: &[String], background: Option<[f32; 3]>) -> Vec<f32> {
    let grey = ["Y", "R"].iter().find_map(|name| image.f32(name));
    let behind = |name: &str| match (background, name) {
        (None, _) => 0.0,
        (Some([r, _, _]), "R") => r,
        (Some([_, g, _]), "G") => g,
        (Some([_, _, b]), "B") => b,
        (Some([r, g, b]), _) => 0.2126 * r + 0.7152 * g + 0.0722 * b,
    };
    let planes: Vec<_> = channels.iter().map(|name| (image.f32(name).or(grey), behind(name))).collect();
    let alpha = image.f32("A");
    let open = |k: usize| alpha.map_or(0.0, |alpha| 1.0 - alpha[k].clamp(0.0, 1.0));
    let value = |k: usize, (plane, behind): &(Option<&[f32]>, f32)| match plane {
        None => f32::NAN,
        // to the bit
        Some(plane) if *behind == 0.0 => plane[k],
        Some(plane) => plane[k] + open(k) * behind,
    };
    (0..image.pixel_count()).flat_map(|k| planes.iter().map(move |plane| value(k, plane))).collect()
}

/// Metrics, a row each, and images, a column each.
pub fn metrics_table(images: &[NamedImage]) -> Table {
    let judged: Vec<_> = images.iter().filter_map(|i| Some((i, metrics(i.comparison?)))).collect();
    let mut table = Table::new(&["Metric"]).titled("Metrics");
    table
        .columns
        .extend(judged.iter().map(|(i, _)| Column { title: i.name.to_owned(), help: i.description.to_owned() }));
    for k in 0..judged.first().map_or(0, |(_, m)| m.len()) {
        let name =
            Cell { text: judged[0].1[k].name.to_owned(), help: judged[0].1[k].help.to_owned(), ..Cell::default() };
        let cells = judged.iter().map(|(_, m)| Cell { text: m[k].text.clone(), value: m[k].value, ..Cell::default() });
        table.rows.push(Row::new(std::iter::once(name).chain(cells)));
    }
    table
}

/// Share of values by their difference, of all images that were compared.
pub fn histogram(images: &[NamedImage]) -> Chart {
    let differences: Vec<(&str, Vec<f64>)> =
        images.iter().filter_map(|i| Some((i.name, differences(i.comparison?)))).collect();
    let mut sizes: Vec<f64> = differences.iter().flat_map(|(_, d)| d.iter().map(|d| d.abs())).collect();
    sizes.sort_by(f64::total_cmp);
    // a few values far out must not squeeze all others into one bin
    let high = sizes.get((sizes.len() as f64 * 0.998) as usize).or(sizes.last()).copied().unwrap_or(0.0);
    let end = if high > 0.0 { high * 1.05 } else { 1e-3 };
    let series = differences.iter().map(|(name, differences)| {
        let mut counts = [0u64; BINS];
        for d in differences {
            let bin = (d / end + 1.0) * 0.5 * BINS as f64;
            counts[(bin.max(0.0) as usize).min(BINS - 1)] += 1;
        }
        let edge = |k: usize| end * (2.0 * k as f64 / BINS as f64 - 1.0);
        let share = |n: u64| 100.0 * n as f64 / differences.len().max(1) as f64;
        let point = |k: usize| Point {
            label: format!(
                "{name}: {:.3} % from {} to {}",
                share(counts[k]),
                format_number(edge(k)),
                format_number(edge(k + 1))
            ),
            ..Point::from((edge(k), share(counts[k])))
        };
        let last = Point { label: (*name).to_owned(), ..Point::from((end, share(counts[BINS - 1]))) };
        Series { name: (*name).to_owned(), mark: Mark::Steps, points: (0..BINS).map(point).chain([last]).collect() }
    });
    Chart {
        title: "Histogram of the differences".into(),
        caption:
            "Image minus reference: left of 0 the image is darker. Values beyond the ends are counted in the outermost bins."
                .into(),
        x: Axis { label: "difference".into(), scale: Scale::Linear, range: Some([-end, end]) },
        y: Axis::logarithmic("share of values, %"),
        series: series.collect(),
    }
}

/// All differences that count.
fn differences(c: &Comparison) -> Vec<f64> {
    let n = c.channels.len().max(1);
    let counted = c.maps.difference.iter().enumerate().filter(|(k, d)| c.maps.compared[k / n] > 0.0 && d.is_finite());
    counted.map(|(_, d)| f64::from(*d)).collect()
}

struct RegionErrors {
    rmse: f64,
    bias: f64,
    flip: Option<f64>,
}

/// Errors of a region: x, y, width, height; `None` where no pixel of it counts.
fn region_errors(c: &Comparison, width: u32, [x, y, w, h]: [u32; 4]) -> Option<RegionErrors> {
    let n = c.channels.len();
    let (mut squares, mut sum, mut flip, mut pixels) = (0.0, 0.0, 0.0, 0u64);
    for row in y..y + h {
        for column in x..x + w {
            let k = row as usize * width as usize + column as usize;
            if c.maps.compared[k] <= 0.0 {
                continue;
            }
            pixels += 1;
            for d in &c.maps.difference[k * n..(k + 1) * n] {
                squares += f64::from(*d) * f64::from(*d);
                sum += f64::from(*d);
            }
            flip += c.maps.flip.get(k).copied().map_or(0.0, f64::from);
        }
    }
    let values = pixels as f64 * n as f64;
    let flip = (!c.maps.flip.is_empty()).then_some(flip / pixels as f64);
    (pixels > 0).then(|| RegionErrors { rmse: (squares / values).sqrt(), bias: sum / values, flip })
}

/// Errors of the parts of the image that differ most, the worst of the first image first.
pub fn region_table(images: &[NamedImage]) -> Table {
    let judged: Vec<_> = images.iter().filter_map(|i| Some((i.name, i.image, i.comparison?))).collect();
    let mut table = Table::new(&["Region"]).titled("Regions that differ most");
    for (name, _, comparison) in &judged {
        let names = ["RMSE", "Bias"].into_iter().chain((!comparison.maps.flip.is_empty()).then_some("FLIP"));
        let title = |m: &str| if judged.len() > 1 { format!("{m} of {name}") } else { m.to_owned() };
        table.columns.extend(names.map(|m| Column { title: title(m), help: String::new() }));
    }
    let Some((_, image, _)) = judged.first() else { return table };
    let mut rows = Vec::new();
    for region in regions([image.width, image.height]) {
        let errors: Vec<_> = judged.iter().map(|(_, _, c)| region_errors(c, image.width, region)).collect();
        let Some(Some(worst)) = errors.first().map(|e| e.as_ref().map(|e| e.rmse)) else { continue };
        let [x, y, w, h] = region;
        let mut cells = vec![Cell::from(format!("{w}x{h} at {x},{y}"))];
        for (errors, (_, _, comparison)) in errors.iter().zip(&judged) {
            let values = errors.as_ref().map_or([None; 3], |e| [Some(e.rmse), Some(e.bias), e.flip]);
            let count = if comparison.maps.flip.is_empty() { 2 } else { 3 };
            cells.extend(values[..count].iter().map(|v| v.map_or_else(|| Cell::from("-"), Cell::from)));
        }
        rows.push((worst, Row::new(cells).of_region(region)));
    }
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    table.rows = rows.into_iter().take(WORST).map(|(_, row)| row).collect();
    table
}

/// The image in [`GRID`] x [`GRID`] parts of about one size; fewer of images with fewer pixels.
fn regions([width, height]: [u32; 2]) -> Vec<[u32; 4]> {
    let parts = |size: u32| {
        let count = GRID.min(size);
        let edge = move |k: u32| (u64::from(size) * u64::from(k) / u64::from(count)) as u32;
        (0..count).map(move |k| [edge(k), edge(k + 1) - edge(k)])
    };
    parts(height).flat_map(|[y, h]| parts(width).map(move |[x, w]| [x, y, w, h])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::comparison::{CompareOptions, compare};
    use crate::output::{Channel, Samples};

    /// A grey image of 8 x 4 pixels.
    fn image(value: impl Fn(usize) -> f32) -> Image {
        let channels = vec![Channel { name: "Y".into(), samples: Samples::F32((0..32).map(value).collect()) }];
        Image { width: 8, height: 4, channels, metadata: Vec::new() }
    }

    #[test]
    fn regions_cover_the_image_once() {
        for size in [[8, 4], [3, 1], [101, 7], [1, 1]] {
            let mut seen = vec![0; (size[0] * size[1]) as usize];
            for [x, y, w, h] in regions(size) {
                for row in y..y + h {
                    (x..x + w).for_each(|column| seen[(row * size[0] + column) as usize] += 1);
                }
            }
            assert!(seen.iter().all(|n| *n == 1), "{size:?}");
        }
    }

    #[test]
    fn a_section_has_the_numbers_of_the_comparison() {
        let (a, b) = (image(|k| if k == 9 { 0.7 } else { 0.5 }), image(|_| 0.5));
        let c = compare(&a, &b, &CompareOptions::default()).unwrap();
        let named = |name, image, comparison| NamedImage { name, description: "", image, background: None, comparison };
        let images = [named("a", &a, Some(&c)), named("b", &b, None)];
        let section = section("Images", &images, 1).unwrap();
        let [Part::Images(shown), Part::Table(metrics), Part::Chart(chart), Part::Table(regions)] = &section.parts[..]
        else {
            panic!("{section:?}")
        };
        assert_eq!((shown.size, shown.reference, shown.images[0].values[9]), ([8, 4], 1, 0.7));
        assert!(shown.mask.is_none() && shown.images[0].flip.is_some() && shown.images[1].flip.is_none());
        assert_eq!((&*metrics.rows[0].cells[0].text, metrics.rows[0].cells[1].value), ("RMSE", Some(c.rmse)));
        // pixel 9 is the second of row 1
        assert_eq!(regions.rows[0].region, Some([0, 1, 2, 1]));
        assert!((regions.rows[0].cells[1].value.unwrap() - 0.2 / 2f64.sqrt()).abs() < 1e-6);
        assert_eq!(regions.rows.len(), WORST);
        let shares: f64 = chart.series[0].points[..BINS].iter().map(|p| p.y).sum();
        assert!((shares - 100.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_compared_is_an_error() {
        let a = image(|_| 0.5);
        let named = NamedImage { name: "a", description: "", image: &a, background: None, comparison: None };
        assert!(section("", &[named], 0).is_err());
    }

    /// The colour shows where alpha leaves it open, also of grey images. Without a colour values
    /// are the image's, to the bit.
    #[test]
    fn images_are_shown_on_their_background() {
        let channel = |name: &str, values: &[f32]| Channel::from_floats(name, values.to_vec());
        let plane = |value: f32| [value, 0.5 * value, 0.0, f32::NAN];
        let colour = [("R", 0.2), ("G", 0.4), ("B", 0.8)].map(|(name, value)| channel(name, &plane(value)));
        let alpha = channel("A", &[1.0, 0.5, 0.0, f32::NAN]);
        let image =
            Image { width: 4, height: 1, channels: colour.into_iter().chain([alpha]).collect(), ..Image::default() };
        let names = ["R", "G", "B"].map(String::from);
        let shown = interleaved(&image, &names, Some([1.0, 0.0, 0.5]));
        let expected = [0.2, 0.4, 0.8, 0.6, 0.2, 0.65, 1.0, 0.0, 0.5];
        assert!(shown.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6), "{shown:?}");
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let own: Vec<f32> = (0..4).flat_map(|k| [0.2, 0.4, 0.8].map(|value| plane(value)[k])).collect();
        assert_eq!(bits(&interleaved(&image, &names, None)), bits(&own));
        let grey = Image { channels: vec![channel("Y", &[0.5, 0.0]), channel("A", &[1.0, 0.0])], width: 2, ..image };
        assert_eq!(interleaved(&grey, &["Y".into()], Some([1.0; 3])), [0.5, 1.0]);
    }
}
