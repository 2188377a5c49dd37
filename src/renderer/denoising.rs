//! Denoising of stills: choice of the denoiser, its inputs, and its report.

use std::cell::{Cell, RefCell};
use std::time::Instant;

use serde_json::{Value, json};

use crate::denoise::{DenoiseChoice, DenoiseInput, Denoiser, Features, GRID, Oidn};
use crate::error::Result;
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::output::{Channel, Samples};

/// A control that does not stop denoising when the image so far is kept; errors end it.
struct UninterruptedControl<'a>(&'a mut dyn Control);

impl Control for UninterruptedControl<'_> {
    fn should_stop(&mut self) -> Result<bool> {
        self.0.should_stop().map(|_| false)
    }
}

/// A denoiser, and the reason why it was chosen.
pub struct SelectedDenoiser {
    denoiser: Denoiser,
    /// In full.
    why: String,
    /// The same in a few words.
    summary: String,
}

/// Chooses the denoiser that is requested, if any.
///
/// # Errors
/// [`crate::Error::Device`] if it is not available, with the remedy.
pub fn choose(choice: Option<DenoiseChoice>) -> Result<Option<SelectedDenoiser>> {
    let Some(choice) = choice else { return Ok(None) };
    let filter = || Denoiser::Filter(Default::default());
    let oidn = |oidn: Oidn| {
        let why = format!("Open Image Denoise {}", oidn.version());
        SelectedDenoiser { denoiser: Denoiser::Oidn(oidn), summary: why.clone(), why }
    };
    Ok(Some(match choice {
        DenoiseChoice::Filter => {
            SelectedDenoiser { denoiser: filter(), why: "requested".into(), summary: "requested".into() }
        }
        DenoiseChoice::Oidn => oidn(Oidn::open()?),
        DenoiseChoice::Auto => match Oidn::open() {
            Ok(library) => oidn(library),
            // why not, and what to do about it, is for `--explain`: this is no fault of the image
            Err(e) => {
                let summary = "without Open Image Denoise".into();
                SelectedDenoiser { denoiser: filter(), why: e.to_string(), summary }
            }
        },
    }))
}

/// Denoises films of one scene and camera.
pub struct Denoising<'a> {
    chosen: &'a SelectedDenoiser,
    shot: DenoiseInput<'a>,
    /// Names of the channels that are denoised.
    names: &'static [&'static str],
    // those of the first film serve the next
    features: RefCell<Option<Features>>,
    seconds: Cell<f64>,
}

impl<'a> Denoising<'a> {
    pub fn new(chosen: &'a SelectedDenoiser, shot: DenoiseInput<'a>, names: &'static [&'static str]) -> Self {
        Self { chosen, shot, names, features: RefCell::new(None), seconds: Cell::new(0.0) }
    }

    /// Name of the denoiser in the image's metadata.
    pub fn name(&self) -> &'static str {
        self.chosen.denoiser.name()
    }

    /// Replaces the means of a film's channels by denoised ones, and adds the means as `noisy.R`
    /// and so on. An interruption ends it, unless `control` keeps the image so far, denoised, too.
    pub fn channels(
        &self,
        accumulated: &Accumulated,
        mut channels: Vec<Channel>,
        control: &mut dyn Control,
    ) -> Result<Vec<Channel>> {
        let start = Instant::now();
        let mut stop = UninterruptedControl(control);
        let features = match self.features.take() {
            Some(features) => features,
            None => Features::render(&self.shot, &mut stop)?,
        };
        let denoised = self.chosen.denoiser.denoise(&self.shot, &accumulated.film, &features, &mut stop)?;
        self.features.replace(Some(features));
        let mut noisy = Vec::new();
        for (c, name) in self.names.iter().enumerate() {
            let Some(channel) = channels.iter_mut().find(|channel| channel.name == *name) else { continue };
            let plane = denoised.iter().skip(c).step_by(self.names.len()).copied().collect();
            let mean = std::mem::replace(&mut channel.samples, Samples::F32(plane));
            noisy.push(Channel { name: format!("noisy.{name}"), samples: mean });
        }
        channels.extend(noisy);
        self.seconds.set(self.seconds.get() + start.elapsed().as_secs_f64());
        Ok(channels)
    }

    /// The report of the denoiser.
    pub fn report(&self) -> DenoiseReport {
        let (name, why, seconds) = (self.name(), &self.chosen.why, self.seconds.get());
        DenoiseReport {
            name: name.to_string(),
            line: format!(
                "denoised by {name} ({}): the image is biased; an .exr keeps the noisy image as {}",
                self.chosen.summary,
                self.names.iter().map(|n| format!("noisy.{n}")).collect::<Vec<_>>().join(", ")
            ),
            explanation: format!(
                "denoiser {name}: {why}; feature images with {} camera rays per pixel{}",
                GRID * GRID + 1,
                match self.chosen.denoiser {
                    Denoiser::Filter(_) => "",
                    Denoiser::Oidn(_) => ", treated as noisy",
                }
            ),
            record: json!({ "denoiser": name, "reason": why, "seconds": seconds, "biased": true }),
        }
    }
}

/// The report of a denoiser, for people and for programs.
#[derive(Clone, Debug)]
pub struct DenoiseReport {
    /// Name of the denoiser.
    pub name: String,
    /// A line for people.
    pub line: String,
    /// A line for `--explain`.
    pub explanation: String,
    /// The JSON record, a map.
    pub record: Value,
}
