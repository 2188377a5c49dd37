//! `skylit convert`: an image in other formats, exposed and tone mapped, or one of its layers.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use serde_json::json;

use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::memory::Budget;
use crate::output::settings::Background;
use crate::output::{self, Channel, FileSettings, Image, ImageFormat, Picture, Samples, picture};
use crate::renderer::brightness;
use crate::settings::parse::parse_number;
use crate::terminal::console::{Failure, Verbosity};

pub use crate::interface::ToneMap;

const EXAMPLES: &str = "Examples:
  skylit convert image.exr image.png --tone-map agx --exposure 1
  skylit convert image.exr normals.png --layer Ns
  skylit convert image.exr depth.png --layer depth --range 2,20 --png-bits 16
  skylit convert studio.hdr studio.exr --exr-half";

/// `skylit convert`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct ConvertArgs {
    /// Image: .exr, .hdr, .png, .jpg or .webp
    #[arg(value_hint = ValueHint::FilePath)]
    pub input: PathBuf,
    /// Files to write: .exr keeps all channels and the metadata, .png, .jpg and .webp show the colours
    #[arg(required = true, value_hint = ValueHint::FilePath)]
    pub outputs: Vec<PathBuf>,
    /// Layer to show in place of the colours: `albedo`, `Ns`, `depth`, or a channel such as `Ng.X`
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Values that become 0 and 1; `auto` is the least and the greatest [default: auto for a layer of one channel, -1,1 for directions, else 0,1]
    #[arg(long, value_name = "LEAST,GREATEST|auto", value_parser = Range::parse, allow_hyphen_values = true)]
    pub range: Option<Range>,
    /// Tone mapping operator of pictures; an .exr stays linear [default: linear]
    #[arg(long, value_name = "OPERATOR")]
    pub tone_map: Option<ToneMap>,
    /// Exposure of pictures in stops; `auto` makes surfaces middle grey [default: 0]
    #[arg(long, value_name = "EV|auto", value_parser = Exposure::parse, allow_hyphen_values = true)]
    pub exposure: Option<Exposure>,
    /// How image files are written
    #[command(flatten)]
    pub files: FileSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

/// The values that are shown as 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// The least and the greatest finite values of pixels that surfaces cover.
    Auto,
    /// These two, which differ.
    Values(f32, f32),
}

impl Range {
    fn parse(text: &str) -> Result<Self, String> {
        if text.trim() == "auto" {
            return Ok(Self::Auto);
        }
        let expected = || "expected `auto`, or two different numbers LEAST,GREATEST".to_owned();
        let values: Vec<f32> = text.split(',').map_while(|v| parse_number(v.trim()).ok()).map(|v| v as f32).collect();
        match values[..] {
            [least, greatest] if text.split(',').count() == 2 && (greatest - least).is_normal() => {
                Ok(Self::Values(least, greatest))
            }
            _ => Err(expected()),
        }
    }
}

/// The exposure of pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// That at which surfaces are middle grey.
    Auto,
    /// Stops.
    Stops(f64),
}

impl Exposure {
    fn parse(text: &str) -> Result<Self, String> {
        if text.trim() == "auto" { Ok(Self::Auto) } else { parse_number(text).map(Self::Stops) }
    }
}

/// Reads, converts and writes.
pub fn run(args: &ConvertArgs) -> Result<(), Failure> {
    let console = args.verbosity.console();
    check(args)?;

    // the image, or a layer of it as one
    let image = output::load_within(&args.input, &Budget::default())?;
    let (image, channels) = match &args.layer {
        Some(name) => layer(&image, name, &args.input)?,
        None => {
            let names = image.channels.iter().map(|c| c.name.clone()).collect();
            (image, names)
        }
    };
    let range = range_of(args, &image, &channels);
    let image = range.map_or(image.clone(), |range| stretched(image, range));

    // what pictures show of it
    let has_picture = args.outputs.iter().any(|path| ImageFormat::from_path(path).is_ok_and(ImageFormat::is_picture));
    let exposure = if has_picture { exposure_of(args, &image)? } else { 0.0 };
    for path in &args.outputs {
        write(args, &image, exposure, path)?;
        let shown = range.map_or(String::new(), |[a, b]| format!(", {a} to {b} as 0 to 1"));
        let stops = if exposure != 0.0 { format!(", {exposure:+} stops") } else { String::new() };
        console.line(&format!("{}: {}x{}{shown}{stops}", path.display(), image.width, image.height))?;
    }
    Ok(console.record(&json!({
        "input": args.input,
        "outputs": args.outputs,
        "size": [image.width, image.height],
        "channels": channels,
        "range": range,
        "exposure": exposure,
        "tone_map": args.tone_map.unwrap_or_default().to_string(),
    }))?)
}

/// Checks what can be known before the image is read.
fn check(args: &ConvertArgs) -> Result<()> {
    let mut plan = FilePlan::default();
    plan.reads("the input", &args.input);
    for path in &args.outputs {
        ImageFormat::from_path(path)?;
        plan.writes("an output", path);
    }
    plan.check()?;
    args.files.check(&args.outputs, None)?;
    let has_picture = args.outputs.iter().any(|path| ImageFormat::from_path(path).is_ok_and(ImageFormat::is_picture));
    for (option, is_given) in [("--tone-map", args.tone_map.is_some()), ("--exposure", args.exposure.is_some())] {
        if is_given && !has_picture {
            return Err(Error::Usage(format!("{option} is for pictures, and none is written: an .exr stays linear")));
        }
    }
    args.outputs.iter().try_for_each(|path| files::check_writable(path))
}

/// The layer of a channel: what precedes the last dot of its name, or nothing.
fn layer_of(channel: &str) -> &str {
    channel.rsplit_once('.').map_or("", |(layer, _)| layer)
}

/// A layer or channel as an image of its own: `R`, `G`, `B` of three channels, `Y` of one; with the
/// alpha of the image. And the names that its channels had.
fn layer(image: &Image, name: &str, path: &Path) -> Result<(Image, Vec<String>)> {
    let named = |channel: &&Channel| channel.name == name || layer_of(&channel.name) == name;
    let found: Vec<&Channel> = image.channels.iter().filter(named).collect();
    if found.is_empty() {
        let mut layers: Vec<&str> = image
            .channels
            .iter()
            .map(|c| if layer_of(&c.name).is_empty() { c.name.as_str() } else { layer_of(&c.name) })
            .collect();
        layers.dedup();
        let layers = layers.join(", ");
        return Err(Error::Usage(format!("{}: has no layer {name:?}: it has {layers}", path.display())));
    }

    // in the order in which people count them, which is not that of a file
    let mut found: Vec<&Channel> = found;
    let place = |c: &Channel| "RXUGYVBZW".find(c.name.rsplit('.').next().unwrap_or_default()).unwrap_or(usize::MAX);
    found.sort_by_key(|c| place(c));
    let names: Vec<String> = found.iter().map(|c| c.name.clone()).collect();
    let new_names: &[&str] = match found.len() {
        1 => &["Y"],
        3 => &["R", "G", "B"],
        n => {
            return Err(Error::Usage(format!(
                "{}: layer {name:?} has {n} channels, and an image has 1 or 3: name one of {}",
                path.display(),
                names.join(", ")
            )));
        }
    };
    let mut channels = Vec::with_capacity(4);
    for (channel, new_name) in found.iter().zip(new_names) {
        let samples = match &channel.samples {
            Samples::F32(values) => values.clone(),
            Samples::U32(numbers) => numbers.iter().map(|n| *n as f32).collect(),
        };
        channels.push(Channel::from_floats(*new_name, samples));
    }
    channels.extend(image.f32("A").map(|alpha| Channel::from_floats("A", alpha.to_vec())));
    Ok((Image { channels, metadata: image.metadata.clone(), ..*image }, names))
}

/// The values that become 0 and 1; `None` where values stay.
fn range_of(args: &ConvertArgs, image: &Image, channels: &[String]) -> Option<[f32; 2]> {
    let is_direction = channels.len() == 3 && ["Ng", "Ns", "bent"].contains(&layer_of(&channels[0]));
    let is_number = args.layer.is_some() && channels.len() == 1 && !["R", "G", "B", "A", "Y"].contains(&&*channels[0]);
    match args.range {
        Some(Range::Values(least, greatest)) => Some([least, greatest]),
        None if is_direction => Some([-1.0, 1.0]),
        None if !is_number => None,
        Some(Range::Auto) | None => Some(extremes(image)),
    }
}

/// The least and the greatest finite value of the colours, of covered pixels where there are some.
/// They differ.
fn extremes(image: &Image) -> [f32; 2] {
    let alpha = image.f32("A").filter(|alpha| alpha.iter().any(|a| *a > 0.0));
    let mut found = [f32::INFINITY, f32::NEG_INFINITY];
    for values in colours(image) {
        for (k, value) in values.iter().enumerate() {
            if value.is_finite() && alpha.is_none_or(|alpha| alpha[k] > 0.0) {
                found = [found[0].min(*value), found[1].max(*value)];
            }
        }
    }
    match found {
        [least, greatest] if least < greatest => found,
        [least, _] if least.is_finite() => [least, least + 1.0],
        _ => [0.0, 1.0],
    }
}

fn colours(image: &Image) -> impl Iterator<Item = &[f32]> {
    ["R", "G", "B", "Y"].into_iter().filter_map(|name| image.f32(name))
}

/// The image with its colours stretched so that these values become 0 and 1.
fn stretched(mut image: Image, [least, greatest]: [f32; 2]) -> Image {
    for channel in image.channels.iter_mut().filter(|c| ["R", "G", "B", "Y"].contains(&&*c.name)) {
        if let Samples::F32(values) = &mut channel.samples {
            values.iter_mut().for_each(|v| *v = (*v - least) / (greatest - least));
        }
    }
    image
}

/// The exposure of pictures, stops.
fn exposure_of(args: &ConvertArgs, image: &Image) -> Result<f64> {
    match args.exposure {
        None => Ok(0.0),
        Some(Exposure::Stops(stops)) => Ok(stops),
        Some(Exposure::Auto) => {
            let planes = colour_planes(image)
                .ok_or_else(|| Error::Usage(format!("{}: has no colour to expose by", args.input.display())))?;
            let rgb: Vec<f32> = (0..image.pixel_count()).flat_map(|k| planes.map(|plane| plane[k])).collect();
            let opaque = vec![1.0; if image.f32("A").is_none() { image.pixel_count() } else { 0 }];
            Ok(brightness::exposure(&rgb, image.f32("A").unwrap_or(&opaque)).unwrap_or(0.0))
        }
    }
}

/// Red, green and blue; three times the same of a grey image.
fn colour_planes(image: &Image) -> Option<[&[f32]; 3]> {
    match (image.f32("R"), image.f32("G"), image.f32("B")) {
        (Some(r), Some(g), Some(b)) => Some([r, g, b]),
        _ => image.f32("Y").map(|y| [y; 3]),
    }
}

fn write(args: &ConvertArgs, image: &Image, exposure: f64, path: &Path) -> Result<()> {
    let format = ImageFormat::from_path(path)?;
    if format == ImageFormat::Exr {
        return output::exr::write_with(image, path, &(&args.files).into());
    }

    // Displayed colours are not in proportion to linear ones: with a background alpha goes first.
    let background: Option<Background> = args.files.background;
    let mut shown = if background.is_some() { picture::unassociated(image) } else { image.clone() };
    if args.tone_map.is_some() || exposure != 0.0 {
        let planes = colour_planes(&shown).map(|planes| planes.map(<[f32]>::to_vec));
        let Some(planes) = planes else { return Err(no_colour(args, image)) };
        let names = ["R", "G", "B"].into_iter().zip(planes);
        let colours = names.map(|(name, plane)| Channel::from_floats(name, plane)).collect();
        let linear = Image { channels: colours, metadata: Vec::new(), ..shown };
        shown.channels.retain(|c| c.name == "A");
        shown.channels.extend(args.tone_map.unwrap_or_default().apply(&linear, exposure as f32).channels);
    } else if shown.f32("Y").is_some() {
        // grey: the same value may be there as three channels, too
        shown.channels.retain(|c| ["Y", "A"].contains(&&*c.name));
    }
    if colour_planes(&shown).is_none() {
        return Err(no_colour(args, image));
    }
    let of_others = FileSettings { background, ..FileSettings::default() };
    let settings = if format == ImageFormat::Png { &args.files } else { &of_others };
    Picture::new(&shown, background, settings, path)?.save(path, args.files.jpeg_quality())
}

fn no_colour(args: &ConvertArgs, image: &Image) -> Error {
    let names: Vec<&str> = image.channels.iter().map(|c| c.name.as_str()).collect();
    let (path, names) = (args.input.display(), names.join(", "));
    Error::Usage(format!("{path}: has no colours (R, G and B, or Y): choose one of its channels with --layer: {names}"))
}
