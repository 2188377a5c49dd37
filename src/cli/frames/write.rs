//! Where frames go: files by number, or one animation.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::cli::args::RenderArgs;
use crate::cli::render::aov_channels;
use crate::error::Result;
use crate::output::apng::{self, Animation, ApngWriter, Delay};
use crate::output::{self, Channel, Image, Samples, frames, png};
use crate::render::aov::AovPixel;
use crate::render::realtime::Realtime;

/// Exposure of pictures, stops.
const EXPOSURE: f32 = 0.0;

/// Everything that frames are written to.
pub struct Writer {
    files: Vec<PathBuf>,
    animations: Vec<ApngWriter>,
}

impl Writer {
    /// Starts the animations. They appear when [`Writer::finish`] is called.
    pub fn create(outputs: &[PathBuf], size: [u32; 2], frames: u32, fps: f64) -> Result<Self> {
        let (animations, files): (Vec<_>, Vec<_>) = outputs.iter().cloned().partition(|p| apng::is_apng(p));
        let delay = Delay::of_rate(fps)?;
        let start = |p: &PathBuf| ApngWriter::create(p, Animation { size, colour: png::Colour::Grey, frames, delay });
        Ok(Self { files, animations: animations.iter().map(start).collect::<Result<_>>()? })
    }

    /// Writes a frame.
    pub fn add(&mut self, number: u32, image: &Image) -> Result<()> {
        for path in &self.files {
            output::save(image, &frames::numbered(path, u64::from(number))?)?;
        }
        if !self.animations.is_empty() {
            let (bytes, _) = png::bytes_of(image, EXPOSURE, Path::new("frame"))?;
            for animation in &mut self.animations {
                animation.add_bytes(&bytes)?;
            }
        }
        Ok(())
    }

    /// Closes the animations.
    pub fn finish(self) -> Result<()> {
        self.animations.into_iter().try_for_each(ApngWriter::finish)
    }
}

/// The last frame as an image: `Y` accessibility, `A` 1 where something is, `samples` behind each pixel, and what `--aov` adds.
pub fn image(
    args: &RenderArgs,
    realtime: &Realtime,
    size: [u32; 2],
    pixels: &[AovPixel],
    origin: DVec3,
    metadata: Vec<(String, String)>,
) -> Result<Image> {
    let f32s = |name: &str, samples| Channel { name: name.into(), samples: Samples::F32(samples) };
    let mut channels = vec![f32s("Y", realtime.result()?), f32s("A", realtime.coverage()?)];
    if args.writes_exr() {
        channels.push(f32s("samples", realtime.samples()?));
        channels.extend(aov_channels(args, pixels, origin));
    }
    Ok(Image { width: size[0], height: size[1], channels, metadata })
}
