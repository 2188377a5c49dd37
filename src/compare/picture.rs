//! Pictures of differences, with a legend: the signed difference, and the FLIP map.
//!
//! The program's own fonts are used, so that neither a display nor fonts are needed.

use std::path::{Path, PathBuf};

use plotters::prelude::*;
use plotters::style::register_font;

use super::{ImageSet, letter};
use crate::error::{Error, Result};
use crate::measure::comparison::Comparison;
use crate::output::{ImageFormat, palette, png};

/// Height of the strip below the image, pixels.
const STRIP: u32 = 76;
/// Least width of a picture, pixels: what the legend needs.
const MIN_WIDTH: u32 = 420;
/// Left, top, right (from the right border) and bottom of the bar of colours in the strip.
const BAR: [u32; 4] = [14, 30, 14, 44];
/// Colour of pixels that are not compared, and of the strip.
const PAPER: [u8; 3] = [255; 3];

/// The subject of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// Image minus reference; of three channels the difference of their luminances.
    Difference,
    Flip,
}

/// Writes a picture for each image but the reference: to `path`, or where there are several to
/// `NAME.a.png`, `NAME.c.png`. Returns their paths.
///
/// # Errors
/// [`Error::Usage`] for a name not in .png, and FLIP of channels without colour; [`Error::Output`].
pub fn write(set: &ImageSet, kind: PictureKind, path: &Path) -> Result<Vec<PathBuf>> {
    let paths = paths(set.entries.len(), set.reference, path)?;
    for ((k, entry, comparison), path) in set.judged().zip(&paths) {
        let [name, reference] = [k, set.reference].map(|k| set.title(k));
        let picture = match kind {
            PictureKind::Difference => difference(comparison, entry.image.width, &format!("{name} minus {reference}"))?,
            PictureKind::Flip => flip(comparison, entry.image.width, &format!("FLIP of {name} against {reference}"))?,
        };
        png::write_rgb(path, &picture.rgb, picture.width, picture.height)?;
    }
    Ok(paths)
}

/// The files that [`write()`] makes for so many images.
///
/// # Errors
/// [`Error::Usage`] for a name that does not end in .png.
pub fn paths(images: usize, reference: usize, path: &Path) -> Result<Vec<PathBuf>> {
    if ImageFormat::from_path(path)? != ImageFormat::Png {
        return Err(Error::Usage(format!("{}: a picture of differences is a .png", path.display())));
    }
    let judged: Vec<usize> = (0..images).filter(|k| *k != reference).collect();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let named = |k: &usize| path.with_file_name(format!("{stem}.{}.png", letter(*k).to_ascii_lowercase()));
    Ok(if judged.len() > 1 { judged.iter().map(named).collect() } else { vec![path.to_owned()] })
}

/// A picture of 8-bit sRGB, rows from the top.
struct Picture {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

/// The signed difference. Full colour is at what 99 % of differences stay below, rounded up.
fn difference(c: &Comparison, width: u32, caption: &str) -> Result<Picture> {
    let n = c.channels.len();
    let weights: &[f32] = if n == 3 { &[0.2126, 0.7152, 0.0722] } else { &[1.0] };
    let value = |k: usize| c.maps.difference[k * n..].iter().zip(weights).map(|(d, w)| d * w).sum::<f32>();
    let values: Vec<f32> = (0..c.maps.compared.len()).map(value).collect();
    let end = scale(&values, &c.maps.compared);
    let pixels = values.iter().zip(&c.maps.compared);
    let pixels =
        pixels.map(|(v, compared)| if *compared > 0.0 || v.is_nan() { palette::signed(v / end) } else { PAPER });
    let labels = [format!("-{end}: darker"), "0".into(), format!("+{end}: brighter")];
    with_legend(pixels.collect(), width, caption, &labels, |t| palette::signed(2.0 * t - 1.0))
}

fn flip(c: &Comparison, width: u32, caption: &str) -> Result<Picture> {
    if c.maps.flip.is_empty() {
        return Err(Error::Usage(format!(
            "--flip: FLIP is for colours, and {} are compared: leave it out",
            c.channels.join(", ")
        )));
    }
    let pixels = c.maps.flip.iter().zip(&c.maps.compared);
    let pixels = pixels.map(|(v, compared)| if *compared > 0.0 || v.is_nan() { palette::heat(*v) } else { PAPER });
    let labels = ["0: looks the same".to_owned(), "0.5".to_owned(), "1".to_owned()];
    with_legend(pixels.collect(), width, caption, &labels, palette::heat)
}

/// A number that 99 % of the absolute values stay below: 1, 2 or 5 times a power of ten.
fn scale(values: &[f32], compared: &[f32]) -> f32 {
    let counted = values.iter().zip(compared).filter(|(v, c)| **c > 0.0 && v.is_finite());
    let mut sizes: Vec<f32> = counted.map(|(v, _)| v.abs()).collect();
    sizes.sort_by(f32::total_cmp);
    let high = sizes.get((sizes.len().saturating_sub(1)) * 99 / 100).copied().unwrap_or(0.0);
    if high <= 1e-9 {
        return 0.01;
    }
    let exponent = high.log10().floor() as i32;
    let steps = [1, 2, 5, 10].map(|m| format!("{m}e{exponent}").parse::<f32>().unwrap_or(1.0));
    steps.into_iter().find(|s| *s >= high * (1.0 - 1e-6)).unwrap_or(steps[3])
}

/// The image over a strip with a caption and a bar of colours.
fn with_legend(
    pixels: Vec<[u8; 3]>,
    width: u32,
    caption: &str,
    labels: &[String; 3],
    color: impl Fn(f32) -> [u8; 3],
) -> Result<Picture> {
    let rows = pixels.len() as u32 / width;
    let full = width.max(MIN_WIDTH);
    let height = rows + STRIP;
    let mut rgb = PAPER.repeat(full as usize * height as usize);
    for (row, line) in pixels.chunks(width as usize).enumerate() {
        let start = 3 * row * full as usize;
        rgb[start..start + 3 * line.len()].copy_from_slice(line.as_flattened());
    }

    // Draws the bar of colours.
    let [left, top, right, bottom] = BAR;
    for x in left..full - right {
        let c = color((x - left) as f32 / (full - right - left - 1) as f32);
        for y in rows + top..rows + bottom {
            let k = 3 * (y * full + x) as usize;
            rgb[k..k + 3].copy_from_slice(&c);
        }
    }

    // Writes the caption and the labels below the bar.
    register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_| failed("the font is broken"))?;
    let root = BitMapBackend::with_buffer(&mut rgb, (full, height)).into_drawing_area();
    let text = |size: f64| ("sans-serif", size).into_font().color(&BLACK);
    let at = |x: u32, y: u32| (x as i32, (rows + y) as i32);
    // plotters sets spaces too narrow
    let spaced = |text: &str| text.replace(' ', "  ");
    root.draw(&Text::new(spaced(&shortened(caption, full)), at(left, 7), text(16.0))).map_err(failed)?;
    for (k, label) in labels.iter().map(|l| spaced(l)).enumerate() {
        let style = text(15.0);
        let size = root.estimate_text_size(&label, &style).map_err(failed)?.0;
        let x = left + (full - right - left) * k as u32 / 2 - size * k as u32 / 2;
        root.draw(&Text::new(label, at(x, bottom + 6), style)).map_err(failed)?;
    }
    root.present().map_err(failed)?;
    drop(root);
    Ok(Picture { width: full, height, rgb })
}

/// A caption that is not wider than the picture.
fn shortened(caption: &str, width: u32) -> String {
    let most = (width / 8) as usize;
    match caption.chars().count() {
        n if n <= most => caption.to_owned(),
        _ => format!("{}...", caption.chars().take(most.saturating_sub(3)).collect::<String>()),
    }
}

fn failed(why: impl std::fmt::Display) -> Error {
    Error::CheckFailed(format!("cannot draw the legend: {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::comparison::Maps;

    fn comparison(difference: Vec<f32>, flip: Vec<f32>) -> Comparison {
        let compared = vec![1.0, 1.0, 1.0, 0.0];
        let maps = Maps { difference, flip, mask: compared.clone(), compared };
        Comparison { channels: vec!["Y".into()], maps, ..Comparison::default() }
    }

    fn pixel(p: &Picture, x: u32, y: u32) -> [u8; 3] {
        [0, 1, 2].map(|c| p.rgb[3 * (y * p.width + x) as usize + c])
    }

    #[test]
    fn pixels_have_the_colours_of_the_legend() {
        let p = difference(&comparison(vec![-0.02, 0.0, 0.02, 9.0], Vec::new()), 2, "a minus b").unwrap();
        assert_eq!((p.width, p.height), (MIN_WIDTH, 2 + STRIP));
        assert_eq!(
            [pixel(&p, 0, 0), pixel(&p, 1, 0), pixel(&p, 0, 1), pixel(&p, 1, 1)],
            [palette::signed(-1.0), palette::signed(0.0), palette::signed(1.0), PAPER]
        );
        let y = 2 + BAR[1] + 3;
        assert_eq!(
            [pixel(&p, BAR[0], y), pixel(&p, p.width - BAR[2] - 1, y)],
            [palette::signed(-1.0), palette::signed(1.0)]
        );
        // there is a caption
        assert!((2..2 + BAR[1]).any(|y| (0..p.width).any(|x| pixel(&p, x, y) != PAPER)));
        let p = flip(&comparison(vec![0.0; 4], vec![0.0, 1.0, f32::NAN, 0.5]), 2, "FLIP").unwrap();
        assert_eq!(
            [pixel(&p, 0, 0), pixel(&p, 1, 0), pixel(&p, 1, 1)],
            [palette::heat(0.0), palette::heat(1.0), PAPER]
        );
        assert!(flip(&comparison(vec![0.0; 4], Vec::new()), 2, "").is_err());
    }

    #[test]
    fn scales_are_round() {
        let of = |v: f32| scale(&[v], &[1.0]);
        assert_eq!([0.0, 0.013, 0.02, 0.6, 3.0].map(of), [0.01, 0.02, 0.02, 1.0, 5.0]);
    }

    #[test]
    fn several_images_have_a_picture_each() {
        let names = |n, reference| paths(n, reference, "x/d.png".as_ref()).unwrap();
        assert_eq!(names(2, 1), [PathBuf::from("x/d.png")]);
        assert_eq!(names(3, 1), [PathBuf::from("x/d.a.png"), PathBuf::from("x/d.c.png")]);
        assert!(paths(2, 1, "d.exr".as_ref()).is_err());
    }
}
