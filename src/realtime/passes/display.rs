//! `display`: converts a buffer of the frame to 8-bit RGBA in device memory.

use super::debug_view;
use crate::colour::srgb_byte;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, ComputePipeline, Recorder};
use crate::interface::DisplayMode;
use crate::interface::records::display::{DISPLAY_RADIANCE, DisplayParams};
use crate::output::png::Colour;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::{Settings, Technique};
use crate::shaders;
use crate::tracer::Tracer;

impl DisplayMode {
    /// Colour type of files without alpha that store it.
    pub fn colour(self) -> Colour {
        match self {
            Self::Result | Self::Unfiltered | Self::Samples | Self::Variance | Self::Depth | Self::Rays => Colour::Grey,
            _ => Colour::Rgb,
        }
    }

    /// Checks that frames of radiance have the buffer.
    ///
    /// # Errors
    /// [`Error::Usage`], naming those that they have.
    pub fn check_radiance(self) -> Result<()> {
        use DisplayMode::{Depth, Ids, Motion, Normal, Position};
        let is_there = |m: &DisplayMode| {
            debug_view(*m).is_some() || [Self::Result, Depth, Normal, Position, Ids, Motion].contains(m)
        };
        if is_there(&self) {
            return Ok(());
        }
        let names = DisplayMode::ALL.into_iter().filter(is_there).map(DisplayMode::name).collect::<Vec<_>>().join(", ");
        Err(Error::Usage(format!("--show {self} is for ambient occlusion; frames of radiance have {names}")))
    }

    /// Checks that the buffer exists with these settings.
    ///
    /// # Errors
    /// [`Error::Usage`], saying what it takes.
    pub fn check(self, settings: &Settings) -> Result<()> {
        let wrong = |what: &str| Err(Error::Usage(what.to_owned()));
        match self {
            DisplayMode::Bent if !settings.bent => Err(bent_normals_disabled()),
            DisplayMode::Samples | DisplayMode::Variance if settings.technique == Technique::Larsen => {
                wrong("--preset larsen counts no samples: choose another --show")
            }
            DisplayMode::Rays if settings.technique != Technique::Traced => wrong(
                "--show rays shows how many rays each pixel gets, which --preset larsen and --technique gtao do not distribute",
            ),
            _ => debug_view(self).map_or(Ok(()), |(view, _)| (view.check)(settings)),
        }
    }
}

/// The error that bent normals are disabled.
pub fn bent_normals_disabled() -> Error {
    Error::Usage("bent normals are not computed: enable them in the settings".into())
}

struct DisplayPass {
    shows_rays: bool,
    pipeline: ComputePipeline,
    params: Params<DisplayParams>,
    thresholds: Buffer,
}

/// The pass over all pixels, after all others; for [`DisplayMode::Rays`] alone if `shows_rays`.
pub fn stage(tracer: &Tracer, pixels: u32, shows_rays: bool) -> Result<Stage> {
    let device = tracer.device();
    let pass = DisplayPass {
        shows_rays,
        pipeline: shaders::DISPLAY.pipeline(device)?,
        params: Params::new(device, "parameters of the display")?,
        thresholds: Buffer::from_slice(device, "thresholds of sRGB", &thresholds())?,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

impl Pass for DisplayPass {
    fn uses(&self, display: Option<&Display>) -> ResourceUse {
        use Resource::{
            BentResult, Camera, Current, DisplayImage, DisplaySettings, FrameNumber, Guide, History, Normals,
            PreviousPosition, Resolved, Result, Surface,
        };
        let uses = ResourceUse::new(&[DisplaySettings], &[DisplayImage]);
        if self.shows_rays {
            return uses.and_reads(&[Guide, Current]);
        }
        let Some(display) = display else { return uses };
        match display.shown {
            DisplayMode::Result => uses.and_reads(&[Result, Resolved]),
            // without a history the result is read in its place
            DisplayMode::Unfiltered => uses.and_reads(&[Guide, History, Result]),
            DisplayMode::Samples | DisplayMode::Variance => uses.and_reads(&[Guide, History]),
            DisplayMode::Depth | DisplayMode::Ids => uses.and_reads(&[Guide]),
            // what moved in the previous frame rests in this one
            DisplayMode::Motion => uses.and_reads(&[Camera, FrameNumber, Guide, Surface, PreviousPosition]),
            DisplayMode::Normal => uses.and_reads(&[Guide, Normals]),
            DisplayMode::Position => uses.and_reads(&[Guide, Surface]),
            DisplayMode::Bent => uses.and_reads(&[Guide, BentResult]),
            // another pass writes the image
            _ => uses,
        }
    }

    fn is_enabled(&self, display: Option<&Display>) -> bool {
        display.is_some_and(|d| debug_view(d.shown).is_none() && (d.shown == DisplayMode::Rays) == self.shows_rays)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let Some(display) = frame.display else { return Ok(()) };
        self.params.write(&DisplayParams {
            frame: frame.params,
            thresholds: self.thresholds.address(),
            words: resources.address(Resource::DisplayImage),
            result: resources.address(Resource::Result),
            resolved: resources.address(Resource::Resolved),
            history: resources.address(Resource::History),
            current: if self.shows_rays { resources.address(Resource::Current) } else { 0 },
            bent: resources.address(Resource::BentResult),
            shown: display.shown as u32,
            gain: display.exposure.exp2(),
            unit: display.unit,
            has_history: (frame.settings.technique != Technique::Larsen).into(),
            rays_per_pixel: frame.settings.rays_per_pixel as f32,
            flags: if resources.buffer(Resource::Composed).is_some() { DISPLAY_RADIANCE } else { 0 },
            tone_map: display.tone_map as u32,
            reserved: 0,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "display", &self.pipeline, frame, range);
        Ok(())
    }
}

/// For each byte the smallest value that [`srgb_byte`] encodes as this byte or a larger one.
fn thresholds() -> [f32; 256] {
    std::array::from_fn(|byte| {
        // the bits of non-negative floats are ordered as the floats are
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

    /// The shader's result for a perfect guess, around each position where a byte changes.
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
