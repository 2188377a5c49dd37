//! Frames that are baked maps: textures, compared as other images are.

use crate::bake::map::BakedMap;
use crate::bake::options::{BakeOptions, CompleteOptions};
use crate::bake::plan::plan;
use crate::bake::session::BakeSession;
use crate::bake::{BakeSettings, Map, SeamTreatment, picture};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::output::{Channel, Image, Samples};
use crate::renderer::Renderer;
use crate::scene::SceneSettings;
use crate::settings::Length;
use crate::settings::parse::{parse_args, usage_message};
use crate::tracer::DeviceSettings;

/// Metadata with the radius of occlusion, scene units.
const RADIUS: &str = "ao.radius";

/// A frame's options of `skylit bake`.
#[derive(Clone, Debug)]
pub struct BakedFrame {
    /// The options as the manifest has them.
    pub words: String,
    /// The options.
    pub options: BakeOptions,
}

impl BakedFrame {
    /// Parses options of `skylit bake`.
    ///
    /// # Errors
    /// [`Error::Usage`] with what is wrong.
    pub fn parse(line: &str) -> Result<Self> {
        let wrong = |what: &str| Error::Usage(format!("\"{line}\": {what}"));
        let words = shlex::split(line).ok_or_else(|| wrong("a quotation mark is not closed"))?;
        let options: BakeOptions = parse_args(&words).map_err(|e| wrong(&usage_message(&e)))?;
        options.check()?;
        Ok(Self { words: words.join(" "), options })
    }

    /// Why no Z-test can be made of it, in a sentence; `None` if one can.
    pub fn fault_of_z_test(&self) -> Option<&'static str> {
        let BakeOptions { map, denoise, seams, target_error, .. } = self.options;
        if !matches!(map, Map::Ao | Map::Thickness) {
            Some("of baked maps only ao and thickness have variances for a Z-test: use flip")
        } else if denoise || seams == SeamTreatment::Match {
            Some("the noise of a texture that is filtered or matched at seams is unknown to a Z-test: use flip")
        } else if target_error.is_some() {
            Some("a Z-test needs as many samples with each seed: leave --target-error out, or use flip")
        } else {
            None
        }
    }

    /// The image as it is shown: directions as colours, positions within their bounds.
    pub fn shown_image(&self, image: &Image) -> Image {
        let shown = |values: &[f32]| -> Vec<f32> {
            let (low, high) =
                values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            let unit = |value: &f32| match self.options.map {
                Map::BentNormal | Map::Normal => 0.5 * value + 0.5,
                Map::Position => (value - low) / (high - low).max(f32::MIN_POSITIVE),
                _ => *value,
            };
            values.iter().map(unit).collect()
        };
        let colours = image.channels.iter().filter(|c| ["Y", "R", "G", "B"].contains(&c.name.as_str()));
        let channel = |c: &Channel| match &c.samples {
            Samples::F32(values) => Channel::from_floats(c.name.clone(), shown(values)),
            Samples::U32(_) => c.clone(),
        };
        Image { channels: colours.map(channel).collect(), ..image.clone() }
    }
}

/// Bakes the texture of a renderer's scene. `kept`: metadata of an image with which it is compared,
/// whose radius it has where the options leave that open.
///
/// # Errors
/// Those of baking, and [`Error::Usage`] for a scene with several textures.
pub fn bake(
    renderer: &mut Renderer,
    tracing: &DeviceSettings,
    options: &BakeOptions,
    kept: Option<&Image>,
    control: &mut dyn Control,
) -> Result<Image> {
    let radius = kept.and_then(|image| image.metadata(RADIUS)).and_then(|radius| radius.parse().ok());
    let open = BakeOptions { ao_radius: options.ao_radius.or(radius.map(Length::Units)), ..options.clone() };
    let CompleteOptions { mut settings, lighting, .. } = open.complete(renderer, &SceneSettings::default())?;
    settings.has_noise = true;
    let mut scene = renderer.scene().clone();

    // one texture, by coordinates that the scene has
    let planned = plan(&scene, None, &settings, control)?;
    if planned.len() > 1 {
        return Err(Error::Usage(format!(
            "{} has {} textures, and a frame is one image: add --atlas or --only-material NAME to bake",
            scene.name,
            planned.len()
        )));
    }
    lighting.apply(&mut scene)?;
    let device = renderer.device().clone();
    let session =
        BakeSession { scene: &scene, device: &device, tracing, settings: &settings, detailed: None, occluding: &[] };
    let maps = session.bake_textures(&planned, control)?;
    Ok(maps.first().map(|map| image_of_map(map, &settings)).unwrap_or_default())
}

/// The image of a map, with the variance of a sample where that is known.
fn image_of_map(map: &BakedMap, settings: &BakeSettings) -> Image {
    let mut image = picture::image(map, settings);
    if matches!(settings.map, Map::Ao | Map::Thickness) {
        image.channels.push(Channel::from_floats("variance", map.variances.clone()));
        image.channels.push(Channel::from_floats("samples", map.samples.iter().map(|n| *n as f32).collect()));
    }
    if settings.map.is_sampled() && settings.map != Map::Light {
        image.metadata.push((RADIUS.to_owned(), settings.occlusion.radius.to_string()));
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_those_of_bake() {
        let frame = BakedFrame::parse("--map light --size 32  --environment 1,1,1").unwrap();
        assert_eq!((frame.options.map, frame.options.size), (Map::Light, [32; 2]));
        assert_eq!(frame.words, "--map light --size 32 --environment 1,1,1");
        for (line, part) in [
            ("--map lights", "lights"),
            ("--size", "--size"),
            ("--resumable", "--resumable"),
            ("--environment 1,1,1", "for --map light"),
            ("--map 'ao", "quotation mark"),
            ("--help", "--help"),
        ] {
            let text = BakedFrame::parse(line).unwrap_err().to_string();
            assert!(text.contains(part), "{line}: {text}");
        }
        let fault = |line: &str| BakedFrame::parse(line).unwrap().fault_of_z_test();
        assert!(fault("--map ao").is_none() && fault("--map thickness --ao-radius 1").is_none());
        for line in ["--map light", "--map normal", "--denoise", "--seams match", "--target-error 0.1"] {
            assert!(fault(line).is_some(), "{line}");
        }
    }

    #[test]
    fn directions_are_shown_as_colours() {
        let plane = |name: &str, values: [f32; 2]| Channel::from_floats(name, values.to_vec());
        let channels = vec![plane("R", [-1.0, 1.0]), plane("G", [0.0, 3.0]), plane("variance", [7.0; 2])];
        let image = Image { width: 2, height: 1, channels, ..Image::default() };
        let shown = |map: &str| BakedFrame::parse(&format!("--map {map}")).unwrap().shown_image(&image);
        assert_eq!(shown("normal").f32("R"), Some(&[0.0, 1.0][..]));
        assert_eq!(shown("position").f32("G"), Some(&[0.0, 1.0][..]));
        assert_eq!(shown("light").f32("G"), Some(&[0.0, 3.0][..]));
        assert!(shown("ao").f32("variance").is_none());
    }
}
