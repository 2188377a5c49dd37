//! Golden images: what a frame is compared with, and what is known of how it was made.

use std::path::{Path, PathBuf};

use super::manifest::{Frame, GoldenFormat};
use super::text::plural;
use crate::error::{Error, Result};
use crate::gpu::DeviceInfo;
use crate::measure::z_test::{Estimate, MIN_REPLICATES, Reference, Region, TILE, channels_with_variance};
use crate::output::exr::ExrOptions;
use crate::output::{self, Channel, Image, Samples, png_text};
use crate::renderer::{CHOSEN, RenderSettings, camera_numbers};
use crate::settings::{Capability, Length};
use crate::tracer::TracerKind;

/// Renders with seeds of their own that the golden image of a Z-test is the mean of.
pub const REPLICATES: u32 = 32;
/// Seed of the first of them, the others follow: far from those that people choose.
pub const FIRST_SEED: u32 = 0x5EED_0000;
/// Bits of the mantissa of stored means, whose error is a tenth of what counts as rounding.
const MEAN_BITS: u32 = 15;
/// Bits of the mantissa that variances are stored with.
const VARIANCE_BITS: u32 = 7;
/// Prefix of the channels with variances of tiles.
const TILE_PREFIX: &str = "tile_variance.";

/// Keys of the metadata.
mod key {
    pub const AO_RADIUS: &str = "ao.radius";
    pub const DEVICE: &str = "verify.device";
    pub const DRIVER: &str = "verify.driver";
    pub const RENDER: &str = "verify.render";
    pub const REPLICATES: &str = "verify.replicates";
    pub const SCENE: &str = "verify.scene";
    pub const TRACER: &str = "verify.tracer";
    pub const VERSION: &str = "verify.version";
    pub const WHOLE: &str = "verify.mean_variance";
}

#[derive(Clone, Debug)]
pub struct Golden {
    pub path: PathBuf,
    /// The channels and metadata; of a PNG, linear values.
    pub image: Image,
    /// The reference of a Z-test, of golden images that were made for one.
    pub reference: Option<Reference>,
}

/// The place where a golden image is made.
#[derive(Clone, Debug)]
pub struct Origin {
    pub device: String,
    pub driver: String,
    pub tracer: TracerKind,
}

impl Origin {
    pub fn new(info: &DeviceInfo, tracer: TracerKind) -> Self {
        Self { device: info.name.clone(), driver: info.driver.clone(), tracer }
    }
}

impl Golden {
    /// Reads a golden image.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be read.
    pub fn load(path: &Path) -> Result<Self> {
        let mut image = output::load(path)?;
        if output::ImageFormat::from_path(path)? == output::ImageFormat::Png {
            image.metadata.extend(png_text::read_metadata(path)?);
        }
        let reference = read_reference(&image).map_err(|message| Error::input(path, message))?;
        Ok(Self { path: path.to_owned(), image, reference })
    }

    /// A golden image from a single render.
    pub fn of_image(path: &Path, frame: &Frame, image: Image, origin: &Origin) -> Result<Self> {
        check_finite(&image)?;
        let mut image = match frame.format {
            GoldenFormat::Exr => image,
            GoldenFormat::Png => Image { metadata: image.metadata.clone(), ..shown_image(frame, &image) },
        };
        if !frame.tolerance.exact {
            // noise that nothing is compared with would fill most of the file
            image.channels.retain(|c| !c.name.starts_with("variance") && c.name != "samples");
        }
        sign(&mut image, frame, origin);
        Ok(Self { path: path.to_owned(), image, reference: None })
    }

    /// A golden image for a Z-test, from renders that differ by their seeds alone.
    ///
    /// # Errors
    /// [`Error::Usage`] for images without variances.
    pub fn of_replicates(path: &Path, frame: &Frame, images: &[Image], origin: &Origin) -> Result<Self> {
        images.iter().try_for_each(check_finite)?;
        let renders = images.iter().map(Estimate::from_image).collect::<Result<Vec<_>>>()?;
        let reference = Reference::new(&renders)?;
        let Some(first) = images.first() else {
            return Err(Error::Usage("a golden image needs renders".into()));
        };
        let mut image = Image { channels: channels_of(first, images, &reference), ..first.clone() };
        // of one of the renders
        image.metadata.retain(|(k, _)| k != "seed");
        let whole = reference.whole.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        image.metadata.push((key::WHOLE.into(), whole));
        image.metadata.push((key::REPLICATES.into(), reference.replicates.to_string()));
        sign(&mut image, frame, origin);
        // as a file will have it: rounded
        let reference = read_reference(&image).map_err(Error::Usage)?;
        Ok(Self { path: path.to_owned(), image, reference })
    }

    pub fn save(&self) -> Result<()> {
        match output::ImageFormat::from_path(&self.path)? {
            // what it is read for, and nothing for other programs
            output::ImageFormat::Exr => output::exr::write_with(
                &self.image,
                &self.path,
                &ExrOptions { grey_as_rgb: false, ..Default::default() },
            ),
            _ => png_text::write(&self.image, &self.path),
        }
    }

    /// The driver that it was made on, if it says so.
    pub fn driver(&self) -> Option<&str> {
        self.image.metadata(key::DRIVER)
    }

    /// The options that the scene decided (camera, AO radius, light); `None` if it names none.
    pub fn chosen(&self) -> Option<&str> {
        self.image.metadata(CHOSEN)
    }

    /// Puts the options that the scene decided into the settings of its frame. Images of earlier
    /// versions name camera and AO radius alone. `has_camera`: the scene's file has a camera.
    ///
    /// # Errors
    /// [`Error::Input`] for metadata that do not make sense.
    pub fn freeze(&self, settings: &mut RenderSettings, has_camera: bool) -> Result<()> {
        let broken = |what: &str| {
            Error::input(&self.path, format!("its metadata {what} cannot be read: make it again with --bless"))
        };
        let named = match self.chosen() {
            Some(words) => RenderSettings::from_words(words).map_err(|_| broken(CHOSEN))?,
            None => RenderSettings::default(),
        };
        // nothing else of what the file says
        let mut chosen = RenderSettings { camera: named.camera, lighting: named.lighting, ..RenderSettings::default() };
        chosen.integrators.ao.ao_radius = named.integrators.ao.ao_radius;
        chosen.image.size = named.image.size;
        let frames = &settings.frames;
        let is_moving = frames.orbit.is_some() || frames.camera_path.is_some();
        let is_open = !settings.camera.chooses() && !has_camera || settings.camera.view.is_some();
        if let (false, true, false, Some(pose)) =
            (chosen.camera.chooses(), is_open, is_moving, self.image.metadata(camera_numbers::POSE))
        {
            chosen.camera = camera_numbers::settings(pose).ok_or_else(|| broken(camera_numbers::POSE))?;
        }
        let has_occlusion = settings.integrator().get().capabilities().contains(&Capability::AmbientOcclusion);
        if let (None, true, Some(radius)) =
            (chosen.integrators.ao.ao_radius, has_occlusion, self.image.metadata(key::AO_RADIUS))
        {
            let radius = radius.parse::<f64>().ok().filter(|r| *r > 0.0).ok_or_else(|| broken(key::AO_RADIUS))?;
            chosen.integrators.ao.ao_radius = Some(Length::Units(radius));
        }
        // a camera is replaced as a whole, and planes are not chosen
        let clip = settings.camera.clip;
        *settings = settings.overridden_by(&chosen);
        settings.camera.clip = clip.or(settings.camera.clip);
        Ok(())
    }

    /// Why it is not what this frame is to be compared with, in a sentence; `None` if it is.
    pub fn misfit(&self, frame: &Frame) -> Option<String> {
        let expected = [(key::SCENE, frame.scene.clone()), (key::RENDER, frame.render_text())];
        for (key, now) in expected {
            match self.image.metadata(key) {
                Some(then) if then == now => {}
                Some(then) => {
                    return Some(format!("its golden image was made of {then:?}, and the manifest says {now:?}"));
                }
                None => return Some(format!("its golden image does not say how it was made (no {key})")),
            }
        }
        (frame.tolerance.z_test.is_some() && self.reference.is_none())
            .then(|| "its golden image was not made for a Z-test".to_owned())
    }
}

/// The picture of an image as the frame's settings show it, with linear values.
pub fn shown_image(frame: &Frame, image: &Image) -> Image {
    let settings = &frame.settings;
    if let Some(baked) = &frame.baked {
        return baked.shown_image(image);
    }
    match settings.realtime_setting() {
        // ambient visibility is shown as it is
        Some(_) if settings.integrator().can(Capability::AmbientVisibility) => {
            Image { channels: image.channels.iter().filter(|c| c.name == "Y").cloned().collect(), ..image.clone() }
        }
        _ => settings.integrator().get().picture(image, &settings.picture.options()),
    }
}

/// Refuses images with colours that are not finite: nothing could be compared with them.
fn check_finite(image: &Image) -> Result<()> {
    let is_colour = |c: &&Channel| ["R", "G", "B", "Y"].contains(&c.name.as_str());
    let broken = |c: &Channel| match &c.samples {
        Samples::F32(values) => values.iter().filter(|v| !v.is_finite()).count(),
        Samples::U32(_) => 0,
    };
    match image.channels.iter().filter(is_colour).map(broken).max() {
        Some(count) if count > 0 => Err(Error::CheckFailed(format!(
            "{} of the render are not finite: no golden image was made",
            plural(count, "value", "values")
        ))),
        _ => Ok(()),
    }
}

fn sign(image: &mut Image, frame: &Frame, origin: &Origin) {
    let entries = [
        (key::DEVICE, origin.device.clone()),
        (key::DRIVER, origin.driver.clone()),
        (key::RENDER, frame.render_text()),
        (key::SCENE, frame.scene.clone()),
        (key::TRACER, origin.tracer.name().to_owned()),
        (key::VERSION, env!("CARGO_PKG_VERSION").to_owned()),
    ];
    image.metadata.extend(entries.map(|(k, v)| (k.to_owned(), v)));
    image.metadata.sort();
}

/// The channels for a Z-test: means, coverage, variances of a sample, samples, and variances of
/// tiles at each of their pixels.
fn channels_of(first: &Image, images: &[Image], reference: &Reference) -> Vec<Channel> {
    let known = &reference.estimate;
    let names = channels_with_variance(first);
    let plane = |name: &str, bits: u32, value: &dyn Fn(usize) -> f64| Channel {
        name: name.to_owned(),
        samples: Samples::F32((0..first.pixel_count()).map(|p| shortened(value(p), bits)).collect()),
    };
    let tiles = Region::tiles(known.size, TILE);
    let mut tile_of = vec![0; first.pixel_count()];
    for (t, tile) in tiles.iter().enumerate() {
        tile.pixels(known.size[0]).for_each(|p| tile_of[p] = t);
    }
    let mut channels = Vec::new();
    for (c, (name, variance)) in names.iter().enumerate() {
        let at = |p: usize| known.channels * p + c;
        channels.push(plane(name, MEAN_BITS, &|p| known.mean[at(p)]));
        channels.push(plane(variance, VARIANCE_BITS, &|p| known.variance[at(p)]));
        channels.push(plane(&format!("{TILE_PREFIX}{name}"), VARIANCE_BITS, &|p| reference.tiles[at(tile_of[p])]));
    }
    let alpha: Vec<&[f32]> = images.iter().filter_map(|i| i.f32("A")).collect();
    let count = alpha.len().max(1) as f64;
    channels.push(plane("A", VARIANCE_BITS, &|p| alpha.iter().map(|a| f64::from(a[p])).sum::<f64>() / count));
    let samples = known.samples.iter().map(|n| *n as f32).collect();
    channels.push(Channel { name: "samples".into(), samples: Samples::F32(samples) });
    channels
}

/// A number with this many bits of its mantissa: what is left out would not compress.
fn shortened(value: f64, bits: u32) -> f32 {
    let value = value as f32;
    if !value.is_finite() {
        return value;
    }
    let dropped = f32::MANTISSA_DIGITS - 1 - bits;
    let rounded = value.to_bits().wrapping_add(1 << (dropped - 1)) & !((1 << dropped) - 1);
    f32::from_bits(rounded)
}

/// The reference of a Z-test, if the image holds it; a sentence if it is broken.
fn read_reference(image: &Image) -> std::result::Result<Option<Reference>, String> {
    let Some(replicates) = image.metadata(key::REPLICATES) else { return Ok(None) };
    let wrong = |what: &str| format!("{what}: not a golden image of this version; make it again with --bless");
    let replicates: u32 = replicates.parse().map_err(|_| wrong("verify.replicates is no number"))?;
    let estimate = Estimate::from_image(image).map_err(|_| wrong("it has no variances"))?;
    let whole: Vec<f64> =
        image.metadata(key::WHOLE).unwrap_or_default().split(',').filter_map(|v| v.parse().ok()).collect();
    let planes: Option<Vec<&[f32]>> =
        channels_with_variance(image).iter().map(|(name, _)| image.f32(&format!("{TILE_PREFIX}{name}"))).collect();
    let planes = planes.ok_or_else(|| wrong("it has no variances of tiles"))?;
    if whole.len() != estimate.channels || replicates < MIN_REPLICATES {
        return Err(wrong("its variances are incomplete"));
    }
    let first = |tile: &Region| tile.first[1] * estimate.size[0] + tile.first[0];
    let of_tile = |tile: &Region| planes.iter().map(|p| f64::from(p[first(tile)])).collect::<Vec<_>>();
    let tiles = Region::tiles(estimate.size, TILE).iter().flat_map(of_tile).collect();
    Ok(Some(Reference { estimate, replicates, tiles, whole }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortened_numbers_are_close() {
        for value in [0.0, 1.0, 0.3, 1e-9, 123_456.7, -2.5] {
            for bits in [MEAN_BITS, VARIANCE_BITS] {
                let short = shortened(value, bits);
                assert!(
                    (f64::from(short) - value).abs() <= value.abs() * 0.5f64.powi(bits as i32 + 1),
                    "{value} {bits}: {short}"
                );
                assert_eq!(shortened(f64::from(short), bits), short);
            }
        }
        assert!(shortened(f64::NAN, 7).is_nan());
    }
}
