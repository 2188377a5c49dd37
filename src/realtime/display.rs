//! A buffer of the frame as it is shown: RGBA words in device memory, which a window takes as they are and files without alpha.

use crate::shaders::{self, LANES};

use super::settings::{Settings, Technique};
use crate::colour::srgb_byte;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, ComputePipeline, Memory, Recorder};
pub use crate::interface::Shown;
use crate::interface::records::display::DisplayParams;
use crate::output::png::Colour;

use crate::tracer::{Push, Tracer};

impl Shown {
    /// What a file without alpha needs for it.
    pub fn colour(self) -> Colour {
        match self {
            Shown::Normal | Shown::Position | Shown::Bent => Colour::Rgb,
            _ => Colour::Grey,
        }
    }

    /// Is it there with these settings?
    ///
    /// # Errors
    /// [`Error::Usage`], saying what it takes.
    pub fn check(self, settings: &Settings) -> Result<()> {
        let wrong = |what: &str| Err(Error::Usage(what.to_owned()));
        match self {
            Shown::Bent if !settings.bent => Err(super::bent::not_asked_for()),
            Shown::Samples | Shown::Variance if settings.technique == Technique::Larsen => {
                wrong("the reference work's pipeline counts no samples: show something else")
            }
            _ => Ok(()),
        }
    }
}

/// What is shown, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// What.
    pub shown: Shown,
    /// Stops: 0 as it is, 1 twice as bright.
    pub exposure: f32,
    /// World units: what depths and positions are measured in.
    pub unit: f32,
}

/// The pass and its memory.
pub(super) struct DisplayPass {
    pipeline: ComputePipeline,
    params: Buffer,
    thresholds: Buffer,
    /// A word a pixel.
    pub words: Buffer,
}

impl DisplayPass {
    pub fn new(tracer: &Tracer, pixels: u64) -> Result<Self> {
        let device = tracer.device();
        Ok(Self {
            pipeline: shaders::DISPLAY.pipeline(device)?,
            params: Buffer::new(device, "parameters of the display", size_of::<DisplayParams>() as u64, Memory::Upload)?,
            thresholds: Buffer::from_slice(device, "thresholds of sRGB", &thresholds())?,
            words: Buffer::new(device, "display", 4 * pixels, Memory::Device)?,
        })
    }

    /// What the next frames record.
    pub fn set(&mut self, display: &Display, settings: &Settings, frame_params: u64) -> Result<()> {
        let params = DisplayParams {
            frame: frame_params,
            thresholds: self.thresholds.address(),
            words: self.words.address(),
            shown: display.shown as u32,
            gain: display.exposure.exp2(),
            unit: display.unit,
            has_history: (settings.technique != Technique::Larsen).into(),
        };
        self.params.write(0, bytemuck::bytes_of(&params))
    }

    /// After everything else of a frame.
    pub fn record(&self, r: &mut Recorder, pixels: u32) {
        let push = Push { pass: self.params.address(), count: pixels, ..Default::default() };
        r.barrier();
        r.timed("display", |r| r.dispatch(&self.pipeline, &push, pixels.div_ceil(LANES)));
    }
}

/// Of each byte: the smallest value that [`srgb_byte`] encodes as this byte or a larger one.
fn thresholds() -> [f32; 256] {
    std::array::from_fn(|byte| {
        // bits of floats that are not negative are in the order of the floats
        let (mut lo, mut hi) = (0, 1f32.to_bits());
        while lo < hi {
            let middle = lo + (hi - lo) / 2;
            if usize::from(srgb_byte(f32::from_bits(middle))) >= byte { hi = middle } else { lo = middle + 1 }
        }
        f32::from_bits(hi)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the shader does with a perfect guess, around each place where a byte changes.
    #[test]
    fn thresholds_are_those_of_the_encoding() {
        let table = thresholds();
        assert!(table[0] == 0.0 && table.windows(2).all(|w| w[0] < w[1]) && table[255] < 1.0);
        for &t in &table[1..] {
            for step in -2000..2000 {
                let x = f32::from_bits(t.to_bits().wrapping_add_signed(step));
                assert_eq!(table.partition_point(|t| *t <= x) - 1, usize::from(srgb_byte(x)), "{x:e}");
            }
        }
    }
}
