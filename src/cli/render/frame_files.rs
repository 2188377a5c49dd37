//! Output of frames: numbered files, or an animation.

use std::path::PathBuf;

use crate::error::Result;
use crate::gpu::Buffer;
use crate::output::animation::{Animation, AnimationWriter};
use crate::output::png::Colour;
use crate::output::settings::Background;
use crate::output::{FileSettings, Image, ImageFormat, Picture, exr, frames, is_animation, picture};

/// The files that frames are written to.
pub struct FrameFiles {
    images: Vec<PathBuf>,
    pictures: Vec<PathBuf>,
    animations: Vec<AnimationWriter>,
    colour: Colour,
    settings: FileSettings,
    background: Option<Background>,
}

/// Images of a frame that are written. Those that no file needs are `None`.
pub struct FrameContents<'a> {
    /// Channels of the frame.
    pub image: Option<&'a Image>,
    /// Values as pictures show them, linear: for pictures of more than 8 bits.
    pub deep: Option<Image>,
    /// Display of the frame ([`crate::renderer::Frames::displayed`]).
    pub shown: Option<&'a Buffer>,
    /// Coverage of the pixels, 0 to 1.
    pub coverage: Option<Vec<f32>>,
}

impl FrameFiles {
    /// Starts the animations, which appear when [`FrameFiles::finish`] is called. `colour`: colour
    /// type of what is displayed.
    pub fn create(
        outputs: &[PathBuf],
        size: [u32; 2],
        frames: u32,
        fps: f64,
        colour: Colour,
        settings: &FileSettings,
        background: Option<Background>,
    ) -> Result<Self> {
        let (animations, files): (Vec<_>, Vec<_>) = outputs.iter().cloned().partition(|p| is_animation(p));
        let (mut images, mut pictures) = (Vec::new(), Vec::new());
        for path in files {
            if ImageFormat::from_path(&path)?.is_picture() { pictures.push(path) } else { images.push(path) }
        }
        let animation = Animation { size, colour: on_background(colour, background), frames, fps };
        let start = |p: &PathBuf| AnimationWriter::create(p, animation);
        let animations = animations.iter().map(start).collect::<Result<_>>()?;
        Ok(Self { images, pictures, animations, colour, settings: settings.clone(), background })
    }

    /// Writes a frame: its channels to .exr files and to .png files that 8 bits do not suffice for,
    /// and its display to other files and animations.
    pub fn add(&mut self, number: u32, size: [u32; 2], contents: &FrameContents) -> Result<()> {
        let number = u64::from(number);
        if let Some(image) = contents.image {
            for path in &self.images {
                exr::write_with(image, &frames::numbered(path, number)?, &(&self.settings).into())?;
            }
        }
        let Some(shown) = contents.shown else { return Ok(()) };
        let mut bytes = Vec::new();
        let channels = self.colour.channels();
        shown.read_with(0, 4 * u64::from(size[0]) * u64::from(size[1]), 4, |_, words| {
            bytes.extend(words.chunks_exact(4).flat_map(|word| &word[..channels]));
        })?;
        let mut displayed = Picture::of_bytes(bytes, size, self.colour)?;
        if let (Some(background), Some(coverage)) = (self.background, &contents.coverage) {
            displayed = displayed.on(background, coverage)?;
        }
        for path in &self.pictures {
            let path = frames::numbered(path, number)?;
            let deep = contents.deep.as_ref().filter(|_| {
                self.settings.has_deep_png() && ImageFormat::from_path(&path).is_ok_and(|f| f == ImageFormat::Png)
            });
            match deep {
                Some(image) => {
                    let image = if self.background.is_some() { &picture::unassociated(image) } else { image };
                    Picture::new(image, self.background, &self.settings, &path)?
                        .save(&path, self.settings.jpeg_quality())?;
                }
                None => displayed.save(&path, self.settings.jpeg_quality())?,
            }
        }
        self.animations.iter_mut().try_for_each(|animation| animation.add_bytes(&displayed.bytes))
    }

    /// Finishes the animations.
    pub fn finish(self) -> Result<()> {
        self.animations.into_iter().try_for_each(AnimationWriter::finish)
    }
}

/// The colour type of a picture once it is on a background, as [`Picture::on`] makes it.
fn on_background(colour: Colour, background: Option<Background>) -> Colour {
    match background {
        Some(Background::Transparent) => colour.with_alpha(),
        Some(Background::Colour([r, g, b])) if r != g || g != b => Colour::Rgb,
        _ => colour,
    }
}
