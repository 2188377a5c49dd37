//! `skylit convert`: an image in other formats, exposed and tone mapped, or one of its layers.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use serde_json::json;

use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::interface::ToneMap;
use crate::memory::Budget;
use crate::output::settings::{Background, check_alpha};
use crate::output::{self, Channel, FileSettings, Image, ImageFormat, Picture, layers, picture};
use crate::renderer::brightness;
use crate::settings::parse::parse_number;
use crate::terminal::console::{Failure, Verbosity};

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
    /// Values that become 0 and 1; `auto` is the least and the greatest [default: by the layer]
    ///
    /// In pictures the default is `auto` for a layer of one channel, -1,1 for directions, and else
    /// 0,1.
    #[arg(long, value_name = "LEAST,GREATEST|auto", value_parser = Range::parse, allow_hyphen_values = true)]
    pub range: Option<Range>,
    /// Tone mapping operator of pictures; an .exr stays linear [default: linear]
    #[arg(long, value_name = "OPERATOR")]
    pub tone_map: Option<ToneMap>,
    /// Exposure of pictures in stops; `auto` makes surfaces middle grey [default: 0]
    #[arg(long, value_name = "EV|auto", value_parser = Exposure::parse, allow_hyphen_values = true)]
    pub exposure: Option<Exposure>,
    /// Background of pictures: a linear colour from 0 to 1, or `transparent` [default: 0,0,0]
    ///
    /// It is for .png, .webp and .jpg outputs. `transparent` keeps alpha, which a .jpg cannot have.
    #[arg(long, value_name = "R,G,B|transparent", alias = "backdrop", help_heading = "Files", hide_short_help = true)]
    pub background: Option<Background>,
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
        Some(name) => {
            let found = layers::layer(&image, name);
            found.map_err(|e| Error::Usage(format!("{}: {e}", args.input.display())))?
        }
        None => {
            let names = image.channels.iter().map(|c| c.name.clone()).collect();
            (image, names)
        }
    };
    let range = match args.range {
        Some(Range::Values(least, greatest)) => Some([least, greatest]),
        Some(Range::Auto) => Some(layers::extremes(&image)),
        None if args.layer.is_some() => layers::default_range(&image, &channels),
        None => None,
    };

    // an .exr holds any value: it keeps those that no option changes
    let is_picture = |path: &PathBuf| ImageFormat::from_path(path).is_ok_and(ImageFormat::is_picture);
    if args.range.is_none() {
        for path in args.outputs.iter().filter(|path| !is_picture(path)) {
            write(args, &image, 0.0, path)?;
        }
    }
    let image = match range {
        Some(range) => layers::stretched(image, range),
        None => image,
    };

    // what pictures show of it
    let has_picture = args.outputs.iter().any(is_picture);
    let exposure = if has_picture { exposure_of(args, &image)? } else { 0.0 };
    for path in &args.outputs {
        let is_kept = !is_picture(path) && args.range.is_none();
        if !is_kept {
            write(args, &image, exposure, path)?;
        }
        let shown = range.filter(|_| !is_kept).map_or(String::new(), |[a, b]| format!(", {a} to {b} as 0 to 1"));
        let has_stops = exposure != 0.0 && is_picture(path);
        let stops = if has_stops { format!(", {exposure:+} stops") } else { String::new() };
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
    let of_pictures = [
        ("--tone-map", args.tone_map.is_some()),
        ("--exposure", args.exposure.is_some()),
        ("--background", args.background.is_some()),
    ];
    for (option, is_given) in of_pictures {
        if is_given && !has_picture {
            return Err(Error::Usage(format!("{option} is for pictures, and none is written: an .exr stays linear")));
        }
    }
    check_alpha(args.background, &args.outputs)?;
    args.outputs.iter().try_for_each(|path| files::check_writable(path))
}

/// The exposure of pictures, stops.
fn exposure_of(args: &ConvertArgs, image: &Image) -> Result<f64> {
    match args.exposure {
        None => Ok(0.0),
        Some(Exposure::Stops(stops)) => Ok(stops),
        Some(Exposure::Auto) => {
            let planes = layers::colour_planes(image)
                .ok_or_else(|| Error::Usage(format!("{}: has no colour to expose by", args.input.display())))?;
            let rgb: Vec<f32> = (0..image.pixel_count()).flat_map(|k| planes.map(|plane| plane[k])).collect();
            let opaque = vec![1.0; if image.f32("A").is_none() { image.pixel_count() } else { 0 }];
            Ok(brightness::exposure(&rgb, image.f32("A").unwrap_or(&opaque)).unwrap_or(0.0))
        }
    }
}

fn write(args: &ConvertArgs, image: &Image, exposure: f64, path: &Path) -> Result<()> {
    let format = ImageFormat::from_path(path)?;
    if format == ImageFormat::Exr {
        return output::exr::write_with(image, path, &(&args.files).into());
    }

    // Displayed colours are not in proportion to linear ones: with a background alpha goes first.
    let background = args.background;
    let mut shown = if background.is_some() { picture::unassociated(image) } else { image.clone() };
    if args.tone_map.is_some() || exposure != 0.0 {
        let planes = layers::colour_planes(&shown).map(|planes| planes.map(<[f32]>::to_vec));
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
    if layers::colour_planes(&shown).is_none() {
        return Err(no_colour(args, image));
    }
    let of_others = FileSettings::default();
    let settings = if format == ImageFormat::Png { &args.files } else { &of_others };
    Picture::new(&shown, background, settings, path)?.save(path, args.files.jpeg_quality())
}

fn no_colour(args: &ConvertArgs, image: &Image) -> Error {
    let names: Vec<&str> = image.channels.iter().map(|c| c.name.as_str()).collect();
    let (path, names) = (args.input.display(), names.join(", "));
    Error::Usage(format!("{path}: has no colours (R, G and B, or Y): choose one of its channels with --layer: {names}"))
}
