//! Plots as files: PNG and SVG.
//!
//! Drawn with the fonts that this program carries, so that it needs neither a display nor fonts on the machine. Text of an SVG is text, in the reader's font.

use std::io::Write;
use std::path::Path;
use std::sync::OnceLock;

use plotters::prelude::*;
use plotters::style::register_font;

use super::draw;
use super::layout::Layout;
use super::panel::Plot;
use crate::error::{Error, Result};
use crate::terminal::console::visible;
use crate::{files, output};

/// Pixels of a PNG for each unit of the layout.
const SCALE: u32 = 2;

/// Formats of plots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlotFormat {
    /// Pixels.
    Png,
    /// Vectors.
    Svg,
}

impl PlotFormat {
    /// The format by the end of a file's name.
    ///
    /// # Errors
    /// [`Error::Usage`] for any other.
    pub fn of(path: &Path) -> Result<Self> {
        let is = |name: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(name));
        match () {
            () if is("png") => Ok(Self::Png),
            () if is("svg") => Ok(Self::Svg),
            () => Err(Error::Usage(format!("--plot {}: the name must end in .png or .svg", path.display()))),
        }
    }
}

/// Writes a plot to a file, in the format of its name.
///
/// # Errors
/// [`Error::Usage`] for a name of another format and for a plot without panels; [`Error::Output`].
pub fn write(path: &Path, plot: &Plot) -> Result<()> {
    match PlotFormat::of(path)? {
        PlotFormat::Png => {
            let picture = rasterize(plot)?;
            output::png::write_rgb(path, &picture.rgb, picture.width, picture.height)
        }
        PlotFormat::Svg => {
            let text = svg(plot)?;
            files::write_atomically(path, |file| file.write_all(text.as_bytes()))
        }
    }
}

/// A picture of 8-bit RGB.
pub struct Picture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Rows from the top, three bytes a pixel.
    pub rgb: Vec<u8>,
}

/// Draws a plot in pixels.
///
/// # Errors
/// [`Error::Usage`] when there is nothing to draw.
pub fn rasterize(plot: &Plot) -> Result<Picture> {
    register_fonts()?;
    let layout = Layout::new(plot, SCALE)?;
    let [width, height] = layout.size();
    let mut rgb = vec![255u8; 3 * (width * height) as usize];
    let area = BitMapBackend::with_buffer(&mut rgb, (width, height)).into_drawing_area();
    draw::plot(plot, &layout, &area)?;
    drop(area);
    Ok(Picture { width, height, rgb })
}

/// Draws a plot as the text of an SVG.
///
/// # Errors
/// [`Error::Usage`] when there is nothing to draw.
pub fn svg(plot: &Plot) -> Result<String> {
    register_fonts()?;
    let layout = Layout::new(plot, 1)?;
    let [width, height] = layout.size();
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, (width, height)).into_drawing_area();
    draw::plot(plot, &layout, &area)?;
    drop(area);
    // XML has no place for control characters, not even as references
    Ok(visible(&text, &['\n', '\t']))
}

fn register_fonts() -> Result<()> {
    // registration is global; it happens once
    static DONE: OnceLock<bool> = OnceLock::new();
    let done = *DONE.get_or_init(|| register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).is_ok());
    if done { Ok(()) } else { Err(draw::failed("the font is broken")) }
}

#[cfg(test)]
mod tests {
    use super::super::panel::{Mark, Panel, Point, Series};
    use super::*;

    /// A colour that is nobody else's: the first of the list.
    const FIRST: [u8; 3] = [0, 114, 178];

    fn plot(panels: Vec<Panel>) -> Plot {
        Plot { title: "A <title>".into(), subtitle: "subtitle".into(), groups: vec![panels] }
    }

    fn panel(points: &[(f64, f64)], mark: Mark) -> Panel {
        let points = points.iter().map(|p| Point::from(*p)).collect();
        let series = vec![Series { name: "a".into(), mark, points }];
        Panel { title: "panel".into(), x: "x".into(), y: "y".into(), series, ..Panel::default() }
    }

    /// Pixels of the first colour, the legend's included.
    fn colored(points: &[(f64, f64)], mark: Mark) -> usize {
        let picture = rasterize(&plot(vec![panel(points, mark)])).unwrap();
        assert_eq!(picture.rgb.len(), 3 * (picture.width * picture.height) as usize);
        picture.rgb.chunks(3).filter(|c| *c == FIRST).count()
    }

    #[test]
    fn lines_are_drawn_and_what_has_no_place_is_not() {
        let one = colored(&[(1.0, 2.0), (5.0, 0.0), (f64::NAN, 1.0)], Mark::Discs);
        let joined = colored(&[(1.0, 2.0), (100.0, 0.001)], Mark::Discs);
        let apart = colored(&[(1.0, 2.0), (100.0, 0.001)], Mark::Labelled);
        assert!(one > 50 && apart > one && joined > apart + 500, "{one} {apart} {joined}");
        // no point has a place: no line, and no legend either
        assert_eq!(colored(&[(1.0, 0.0)], Mark::Discs), 0);
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        assert_eq!(rasterize(&Plot::default()).map(drop).unwrap_err().exit_code(), 64);
        assert_eq!(svg(&Plot { groups: vec![Vec::new()], ..Plot::default() }).unwrap_err().exit_code(), 64);
        assert_eq!(PlotFormat::of("a.pdf".as_ref()).unwrap_err().exit_code(), 64);
        assert_eq!(PlotFormat::of("a.SVG".as_ref()).unwrap(), PlotFormat::Svg);
    }

    #[test]
    fn text_of_an_svg_is_text() {
        let mut evil = panel(&[(1.0, 2.0), (2.0, 3.0)], Mark::Discs);
        evil.title = "a\x1b[31m\u{9b}b\x00".into();
        let text = svg(&plot(vec![evil])).unwrap();
        assert!(!text.chars().any(|c| c.is_control() && c != '\n'), "{text}");
        let text = svg(&plot(vec![panel(&[(1.0, 2.0), (100.0, 0.001)], Mark::Discs)])).unwrap();
        assert!(text.contains("A &lt;title&gt;") && text.contains("<text") && text.ends_with("</svg>\n"), "{text}");
        // no number is written beside an axis twice
        let mut numbers: Vec<&str> =
            text.lines().map(str::trim).filter(|l| l.starts_with(|c: char| c.is_ascii_digit())).collect();
        let count = numbers.len();
        numbers.sort_unstable();
        numbers.dedup();
        assert!(numbers.len() >= 5 && count <= numbers.len() + 3, "{numbers:?}");
    }

    #[test]
    fn text_is_drawn() {
        let picture = rasterize(&plot(vec![panel(&[(1.0, 2.0)], Mark::Discs)])).unwrap();
        let head = 3 * (60 * SCALE * picture.width) as usize;
        let dark = picture.rgb[..head].chunks(3).filter(|c| c[0] < 100).count();
        assert!(dark > 600, "{dark} dark pixels in the title");
    }
}
