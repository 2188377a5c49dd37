//! Environments from images in equirectangular projection (Radiance HDR, OpenEXR, and pictures of 8
//! or 16 bits), or the six faces of a cube.

mod cube;

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::picture;
use crate::error::{Error, Result};
use crate::files;
use crate::memory::Budget;
use crate::output::{Image, exr, png, radiance};
use crate::scene::EnvironmentMap;

/// Largest width and height.
const MAX_SIDE: u32 = 16384;
/// Bytes of a pixel on the device and in the tables for sampling it.
const DEVICE_BYTES: u64 = 28;
/// Radiance that stands in for infinity: the largest value of a 16-bit float, beyond which files
/// have infinity.
const INFINITE_RADIANCE: f32 = 65504.0;

/// Rows from the top, linear.
struct Pixels {
    width: u32,
    height: u32,
    /// Radiance that a map shares, so that nothing is copied: a map of 16384x8192 has 1.6 GB.
    radiance: Arc<[Vec3]>,
    /// A sentence that says which values were replaced.
    warning: Option<String>,
}

/// Reads an environment: an equirectangular image, or a folder that holds the faces of a cube as
/// `px`, `nx`, `py`, `ny`, `pz`, `nz`. Images are Radiance HDR, OpenEXR, PNG, JPEG or WebP,
/// whichever their first bytes show. Colours are linear with sRGB primaries (those of PNG, JPEG and
/// WebP are decoded); values that are negative or not a number count as 0, infinite ones as 65504.
///
/// # Errors
/// [`Error::Input`] naming the file when it cannot be read or decoded.
pub fn load_environment(path: &Path) -> Result<EnvironmentMap> {
    load_environment_with(path, &mut |_| ())
}

/// As [`load_environment`]; `warn` gets a sentence for each image with values that were replaced.
///
/// # Errors
/// Those of [`load_environment`].
pub fn load_environment_with(path: &Path, warn: &mut dyn FnMut(String)) -> Result<EnvironmentMap> {
    let _in_progress = super::options::InProgress::begin();
    let budget = Budget::default();
    let Pixels { width, height, radiance, warning } =
        if path.is_dir() { cube::read(path, &budget)? } else { read(path, &budget)? };
    warning.into_iter().for_each(warn);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(EnvironmentMap::new(name, [width, height], radiance))
}

/// An environment map of the faces of a cube, each `side` texels along an edge, in the order of
/// [`load_environment`]: rows from the top of each, as OpenGL has faces (OpenGL 4.6, table 8.19).
///
/// # Errors
/// Where a file may not take the memory for it, in words.
pub(super) fn of_faces(
    name: &str,
    side: u32,
    faces: [Vec<Vec3>; 6],
    budget: &Budget,
) -> std::result::Result<EnvironmentMap, String> {
    let pixel_count = 8 * u64::from(side) * u64::from(side);
    budget.take(pixel_count * DEVICE_BYTES, || format!("a cube of {side}x{side} texels"))?;
    let pixels = |radiance: Vec<Vec3>| {
        let radiance = radiance.into_iter().map(|c| Vec3::from_array(c.to_array().map(admissible))).collect();
        Pixels { width: side, height: side, radiance, warning: None }
    };
    let Pixels { width, height, radiance, .. } = cube::resample(&faces.map(pixels));
    Ok(EnvironmentMap::new(name, [width, height], radiance))
}

/// One image, of the kind that its first bytes show.
fn read(path: &Path, budget: &Budget) -> Result<Pixels> {
    let start = files::read_start(path)?;
    let is = |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    let mut pixels = if start.starts_with(&exr::MAGIC) || is("exr") {
        read_exr(path, budget)?
    } else if image::guess_format(&start).is_ok_and(|format| format != image::ImageFormat::Hdr) {
        read_picture(path, budget)?
    } else if radiance::is_radiance(&start) || ["hdr", "pic", "rgbe"].into_iter().any(is) {
        read_hdr(path, budget)?
    } else {
        return Err(Error::input(
            path,
            "is not an environment: .hdr, .exr, .png, .jpg, .webp and folders of a cube's faces are",
        ));
    };
    // texels on the device, and the table by which they are sampled
    let pixel_count = u64::from(pixels.width) * u64::from(pixels.height);
    let what = || format!("an environment of {}x{} pixels", pixels.width, pixels.height);
    budget.take(pixel_count * DEVICE_BYTES, what).or_else(|_| budget.check().map_err(|e| e.in_file(path)))?;
    if let Some(replaced) = Replaced::count(&pixels.radiance) {
        pixels.radiance = pixels.radiance.iter().map(|c| Vec3::from_array(c.to_array().map(admissible))).collect();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        pixels.warning = replaced.text().map(|text| format!("{name}: {text}"));
    }
    Ok(pixels)
}

/// A value that a map may have, in place of one of a file.
fn admissible(value: f32) -> f32 {
    // NaN counts as 0
    if value == f32::INFINITY { INFINITE_RADIANCE } else { value.max(0.0) }
}

/// Numbers of pixels of a file with values that a map cannot have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Replaced {
    negative: usize,
    infinite: usize,
    not_a_number: usize,
}

impl Replaced {
    /// `None` if all values are finite and not negative.
    fn count(radiance: &[Vec3]) -> Option<Self> {
        let is_admissible = |c: &Vec3| c.is_finite() && c.min_element() >= 0.0;
        if radiance.iter().all(is_admissible) {
            return None;
        }
        let number = |is: &dyn Fn(f32) -> bool| radiance.iter().filter(|c| c.to_array().into_iter().any(is)).count();
        Some(Self {
            negative: number(&|v| v < 0.0),
            infinite: number(&|v| v == f32::INFINITY),
            not_a_number: number(&f32::is_nan),
        })
    }

    /// Says which values were replaced by which; not negative ones, which filters of images leave.
    fn text(self) -> Option<String> {
        let text = |n: usize, what: &str, value: f32| match n {
            1 => format!("1 pixel is {what} and counts as {value}"),
            _ => format!("{n} pixels are {what} and count as {value}"),
        };
        let infinite = text(self.infinite, "infinite", INFINITE_RADIANCE);
        let not_a_number = text(self.not_a_number, "not a number", 0.0);
        match (self.infinite, self.not_a_number) {
            (0, 0) => None,
            (_, 0) => Some(infinite),
            (0, _) => Some(not_a_number),
            _ => Some(format!("{infinite}, {not_a_number}")),
        }
    }
}

fn read_hdr(path: &Path, budget: &Budget) -> Result<Pixels> {
    let image = radiance::read_file(path, MAX_SIDE, budget)?;
    let radiance = image.rgb.into_iter().map(Vec3::from_array).collect();
    Ok(Pixels { width: image.width, height: image.height, radiance, warning: None })
}

/// A picture of 8 or 16 bits, whose values are decoded; its alpha is ignored.
fn read_picture(path: &Path, budget: &Budget) -> Result<Pixels> {
    let bytes = files::read(path)?;
    budget.read(bytes.len());
    let p = picture::decode(&bytes, &path.to_string_lossy(), budget);
    budget.check().map_err(|e| e.in_file(path))?;
    let p = p.map_err(|e| Error::input(path, e))?;
    let is_linear = png::is_linear(&bytes[..]);
    let linear = |i| {
        let [r, g, b, _] = if is_linear { p.texels.get(i) } else { p.texels.decode_srgb(i) };
        Vec3::new(r, g, b)
    };
    let radiance = (0..p.texels.len()).into_par_iter().with_min_len(4096).map(linear).collect();
    Ok(Pixels { width: p.width, height: p.height, radiance, warning: None })
}

fn read_exr(path: &Path, budget: &Budget) -> Result<Pixels> {
    let image = exr::read_within(path, budget)?;
    if image.width > MAX_SIDE || image.height > MAX_SIDE {
        return Err(Error::input(path, format!("is larger than {MAX_SIDE} pixels")));
    }
    let radiance = match colour(&image).map_err(|e| Error::input(path, e))? {
        Colour::Rgb([r, g, b]) => (0..r.len()).map(|k| Vec3::new(r[k], g[k], b[k])).collect(),
        Colour::Grey(y) => y.iter().map(|v| Vec3::splat(*v)).collect(),
    };
    Ok(Pixels { width: image.width, height: image.height, radiance, warning: None })
}

/// The samples of an image's colour.
enum Colour<'a> {
    Rgb([&'a [f32]; 3]),
    Grey(&'a [f32]),
}

/// The colour channels of an image: `R`, `G`, `B` or `Y`, in either case of letters, without a
/// layer or else of the layer `Combined` (`ViewLayer.Combined.R`), or of the only layer that has
/// colour.
///
/// # Errors
/// What is missing, as the end of a sentence.
fn colour(image: &Image) -> std::result::Result<Colour<'_>, String> {
    let layer_of = |name: &str| name.rsplit_once('.').map_or("", |(layer, _)| layer).to_owned();
    let mut layers: Vec<String> = image.channels.iter().map(|c| layer_of(&c.name)).collect();
    layers.sort();
    layers.dedup();
    let of_layer = |layer: &String| {
        let channel = |component: &str| {
            let is = |name: &str| {
                layer_of(name) == **layer && name.rsplit('.').next().is_some_and(|c| c.eq_ignore_ascii_case(component))
            };
            image.channels.iter().find(|c| is(&c.name)).and_then(|c| image.f32(&c.name))
        };
        let rgb = channel("R").zip(channel("G")).zip(channel("B")).map(|((r, g), b)| Colour::Rgb([r, g, b]));
        // the luminance of a colour image is not its colour
        let is_grey = channel("RY").is_none() && channel("BY").is_none();
        rgb.or_else(|| channel("Y").filter(|_| is_grey).map(Colour::Grey))
    };
    let is_combined = |layer: &&String| layer.rsplit('.').next().is_some_and(|l| l.eq_ignore_ascii_case("Combined"));
    let own = layers.iter().filter(|l| l.is_empty()).find_map(of_layer);
    let combined = || layers.iter().filter(is_combined).find_map(of_layer);
    let only = || {
        let mut found = layers.iter().filter_map(of_layer);
        found.next().filter(|_| found.next().is_none())
    };
    own.or_else(combined).or_else(only).ok_or_else(|| {
        let has: Vec<_> = image.channels.iter().map(|c| c.name.as_str()).take(12).collect();
        let more = if image.channels.len() > has.len() { ", ..." } else { "" };
        format!("has no colour: channels R, G and B, or Y, of floats are needed, and it has {}{more}", has.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{Channel, Samples};

    /// An image of a pixel whose channels are numbered from 0.
    fn image(names: &[&str]) -> Image {
        let channel =
            |(k, name): (usize, &&str)| Channel { name: (*name).into(), samples: Samples::F32(vec![k as f32]) };
        Image { width: 1, height: 1, channels: names.iter().enumerate().map(channel).collect(), metadata: Vec::new() }
    }

    #[test]
    fn colours_have_several_names() {
        let picked = |names: &[&str]| match colour(&image(names)) {
            Ok(Colour::Rgb(planes)) => planes.iter().map(|p| p[0]).collect(),
            Ok(Colour::Grey(y)) => vec![y[0]],
            Err(_) => Vec::new(),
        };
        assert_eq!(picked(&["A", "B", "G", "R"]), [3.0, 2.0, 1.0]);
        assert_eq!(picked(&["r", "g", "b"]), [0.0, 1.0, 2.0]);
        assert_eq!(picked(&["Y"]), [0.0]);
        assert_eq!(picked(&["A", "y", "depth.Z"]), [1.0]);
        assert_eq!(picked(&["Combined.A", "Combined.B", "Combined.G", "Combined.R"]), [3.0, 2.0, 1.0]);
        let layers = [
            "View.Combined.B",
            "View.Combined.G",
            "View.Combined.R",
            "View.Diffuse.B",
            "View.Diffuse.G",
            "View.Diffuse.R",
        ];
        assert_eq!(picked(&layers), [2.0, 1.0, 0.0]);
        assert_eq!(picked(&layers[3..]), [2.0, 1.0, 0.0]);
        // without a layer before all others
        assert_eq!(picked(&["B", "Combined.B", "Combined.G", "Combined.R", "G", "R"]), [5.0, 4.0, 0.0]);
        // two layers that have the same right, luminance without its colour, no colour
        for names in [&["a.B", "a.G", "a.R", "b.B", "b.G", "b.R"][..], &["BY", "RY", "Y"], &["A", "Z"], &["R", "G"]] {
            assert!(colour(&image(names)).is_err(), "{names:?}");
        }
    }

    #[test]
    fn values_that_no_map_has_are_counted() {
        let (nan, infinity) = (f32::NAN, f32::INFINITY);
        assert_eq!(Replaced::count(&[Vec3::ONE, Vec3::ZERO]), None);
        let replaced = |values: &[Vec3]| Replaced::count(values).unwrap().text();
        assert_eq!(replaced(&[Vec3::ONE, Vec3::NEG_ONE]), None);
        assert_eq!(replaced(&[Vec3::splat(infinity)]).unwrap(), "1 pixel is infinite and counts as 65504");
        let both =
            replaced(&[Vec3::new(infinity, nan, 1.0), Vec3::new(1.0, nan, 0.0), Vec3::splat(-infinity)]).unwrap();
        assert_eq!(both, "1 pixel is infinite and counts as 65504, 2 pixels are not a number and count as 0");
        let expected = [infinity, nan, -infinity, -1.0, 1e20].map(admissible);
        assert_eq!(expected, [65504.0, 0.0, 0.0, 0.0, 1e20]);
    }
}
