//! `display`: a buffer of the frame as it is shown: RGBA words in device memory, which a window takes as they are and files without alpha.

use crate::colour::srgb_byte;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, ComputePipeline, Recorder};
pub use crate::interface::Shown;
use crate::interface::records::display::DisplayParams;
use crate::output::png::Colour;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage, Uses};
use crate::realtime::resources::{Resource, Resources};
use crate::realtime::settings::{Settings, Technique};
use crate::shaders;
use crate::tracer::Tracer;

impl Shown {
    /// What a file without alpha needs for it.
    pub fn colour(self) -> Colour {
        match self {
            Shown::Normal | Shown::Position | Shown::Bent | Shown::Nodes => Colour::Rgb,
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
            Shown::Bent if !settings.bent => Err(bent_is_off()),
            Shown::Samples | Shown::Variance if settings.technique == Technique::Larsen => {
                wrong("the reference work's pipeline counts no samples: show something else")
            }
            _ => Ok(()),
        }
    }
}

/// The settings have no bent normals.
pub fn bent_is_off() -> Error {
    Error::Usage("bent normals are made only where the settings ask for them".into())
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

struct DisplayPass {
    pipeline: ComputePipeline,
    params: Params<DisplayParams>,
    thresholds: Buffer,
}

/// The pass over all pixels, after all others.
pub fn stage(tracer: &Tracer, pixels: u32) -> Result<Stage> {
    let device = tracer.device();
    let pass = DisplayPass {
        pipeline: shaders::DISPLAY.pipeline(device)?,
        params: Params::new(device, "parameters of the display")?,
        thresholds: Buffer::from_slice(device, "thresholds of sRGB", &thresholds())?,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

impl Pass for DisplayPass {
    fn uses(&self, display: Option<&Display>) -> Uses {
        use Resource::{BentResult, DisplaySettings, Guide, History, Result, Surface, Words};
        let uses = Uses::new(&[DisplaySettings], &[Words]);
        let Some(display) = display else { return uses };
        match display.shown {
            Shown::Accessibility => uses.and_reads(&[Result]),
            // where there is no history, the result stands for it
            Shown::Unfiltered => uses.and_reads(&[Guide, History, Result]),
            Shown::Samples | Shown::Variance => uses.and_reads(&[Guide, History]),
            Shown::Depth => uses.and_reads(&[Guide]),
            Shown::Normal | Shown::Position => uses.and_reads(&[Guide, Surface]),
            Shown::Bent => uses.and_reads(&[Guide, BentResult]),
            // the pass `nodes` shows them
            Shown::Nodes => uses,
        }
    }

    fn is_enabled(&self, display: Option<&Display>) -> bool {
        display.is_some_and(|d| d.shown != Shown::Nodes)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let Some(display) = frame.display else { return Ok(()) };
        self.params.write(&DisplayParams {
            frame: frame.params,
            thresholds: self.thresholds.address(),
            words: resources.address(Resource::Words),
            result: resources.address(Resource::Result),
            history: resources.address(Resource::History),
            bent: resources.address(Resource::BentResult),
            shown: display.shown as u32,
            gain: display.exposure.exp2(),
            unit: display.unit,
            has_history: (frame.settings.technique != Technique::Larsen).into(),
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "display", &self.pipeline, frame, range);
        Ok(())
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
