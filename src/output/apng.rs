//! APNG, animated PNG for previews: 8-bit sRGB, written frame by frame, in an endless loop.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use ::png::{BitDepth, Compression, Encoder, EncodingError, Writer};

use super::png::{self, Colour, bytes_of};
use super::settings::PngEncoding;
use super::{Image, check_size};
use crate::error::{Error, Result};
use crate::files::AtomicFile;

/// How long a frame is shown: `numerator` / `denominator` seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delay {
    /// At least 0; 0 is as fast as the viewer can.
    pub numerator: u16,
    /// At least 1.
    pub denominator: u16,
}

impl Delay {
    /// The simplest delay for a frame rate in [0.001, 1000] Hz, or the nearest one representable.
    pub fn of_rate(frames_per_second: f64) -> Result<Self> {
        if !(0.001..=1000.0).contains(&frames_per_second) {
            return Err(Error::Usage(format!("{frames_per_second} frames a second: must be between 0.001 and 1000")));
        }
        let mut best = (f64::INFINITY, Self { numerator: 1, denominator: 1 });
        for numerator in 1..=u16::MAX {
            let denominator = (frames_per_second * f64::from(numerator)).round();
            if denominator > f64::from(u16::MAX) {
                break;
            }
            let error = (denominator / (frames_per_second * f64::from(numerator)) - 1.0).abs();
            if denominator >= 1.0 && error < best.0 {
                best = (error, Self { numerator, denominator: denominator as u16 });
            }
            if best.0 < 1e-6 {
                break;
            }
        }
        Ok(best.1)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Animation {
    pub size: [u32; 2],
    pub colour: Colour,
    /// The number of frames, at least 1.
    pub frames: u32,
    pub delay: Delay,
}

/// Does the name of `path` end in `.apng`, in either case of letters?
pub fn is_apng(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("apng"))
}

/// An animation being written. [`ApngWriter::finish`] makes the file; dropped before, none is left.
pub struct ApngWriter {
    // declared before the file, so that it is dropped first and can still flush to it
    encoder: Writer<BufWriter<File>>,
    file: AtomicFile,
    path: PathBuf,
    animation: Animation,
    added: u32,
}

impl ApngWriter {
    /// Starts an animation that will be `path`.
    ///
    /// # Errors
    /// [`Error::Usage`] for no frames, no or too many pixels, or a delay over 0; [`Error::Output`].
    pub fn create(path: &Path, animation: Animation) -> Result<Self> {
        let Animation { size: [width, height], colour, frames, delay } = animation;
        check_size(width, height)?;
        if frames == 0 || delay.denominator == 0 {
            let what = format!(
                "{}: an animation needs at least one frame, and a delay with a denominator above 0",
                path.display()
            );
            return Err(Error::Usage(what));
        }
        let mut file = AtomicFile::create(path)?;
        let out = BufWriter::with_capacity(1 << 16, file.handle()?);
        let start = || {
            let mut encoder = Encoder::new(out, width, height);
            encoder.set_color(colour.png());
            encoder.set_depth(BitDepth::Eight);
            png::set_encoding(&mut encoder, PngEncoding::Srgb);
            encoder.set_compression(Compression::Fast);
            const FOR_EVER: u32 = 0;
            encoder.set_animated(frames, FOR_EVER)?;
            encoder.set_frame_delay(delay.numerator, delay.denominator)?;
            encoder.write_header()
        };
        let encoder = start().map_err(|e| file.failed(&reason(e)))?;
        Ok(Self { encoder, file, path: path.to_owned(), animation, added: 0 })
    }

    /// Adds the colour channels of an image as the next frame, brightened by `exposure` stops.
    ///
    /// # Errors
    /// [`Error::Usage`] for a frame too many, or of another size or colour; [`Error::Output`].
    pub fn add(&mut self, image: &Image, exposure: f32) -> Result<()> {
        let (bytes, colour) = bytes_of(image, exposure, &self.path)?;
        if ([image.width, image.height], colour) != (self.animation.size, self.animation.colour) {
            let [width, height] = self.animation.size;
            return Err(self.wrong(&format!("a frame that is not {width}x{height} {:?}", self.animation.colour)));
        }
        self.add_bytes(&bytes)
    }

    /// Adds a frame of 8-bit sRGB values, rows from the top. Errors as [`ApngWriter::add`].
    pub fn add_bytes(&mut self, bytes: &[u8]) -> Result<()> {
        let Animation { size: [width, height], colour, frames, .. } = self.animation;
        if bytes.len() as u64 != u64::from(width) * u64::from(height) * colour.channels() as u64 {
            return Err(
                self.wrong(&format!("a frame of {} values for {width}x{height} {colour:?} pixels", bytes.len()))
            );
        }
        if self.added == frames {
            return Err(self.wrong(&format!("one frame more than the {frames} it was to have")));
        }
        self.encoder.write_image_data(bytes).map_err(|e| self.file.failed(&reason(e)))?;
        self.added += 1;
        Ok(())
    }

    /// Frames so far.
    pub fn added(&self) -> u32 {
        self.added
    }

    /// Finishes the animation and moves the file to its path.
    ///
    /// # Errors
    /// [`Error::Usage`] when frames are missing, [`Error::Output`]; then there is no file.
    pub fn finish(self) -> Result<()> {
        if self.added < self.animation.frames {
            return Err(self.wrong(&format!("{} of {} frames were written", self.added, self.animation.frames)));
        }
        let Self { encoder, file, .. } = self;
        encoder.finish().map_err(|e| file.failed(&reason(e)))?;
        file.commit()
    }

    fn wrong(&self, what: &str) -> Error {
        Error::Usage(format!("{}: the animation cannot be written: {what}", self.path.display()))
    }
}

pub(super) fn reason(error: EncodingError) -> io::Error {
    match error {
        EncodingError::IoError(e) => e,
        e => io::Error::other(e.to_string()),
    }
}
