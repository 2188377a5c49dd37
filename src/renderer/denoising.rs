//! Denoising of stills: which denoiser runs, what it is told, and what is said of it.

use std::cell::{Cell, RefCell};
use std::time::Instant;

use serde_json::{Value, json};

use crate::denoise::{DenoiseInput, Denoiser, Features, GRID, Oidn};
use crate::error::Result;
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::integrators::path::settings::DenoiseChoice;
use crate::output::{Channel, Samples};

/// The channels that are denoised.
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Interruptions are errors where work is to be given up, and nothing where what there is is kept: it is denoised to its end.
struct Unstoppable<'a>(&'a mut dyn Control);

impl Control for Unstoppable<'_> {
    fn should_stop(&mut self) -> Result<bool> {
        self.0.should_stop().map(|_| false)
    }
}

/// A denoiser, and why it is that one.
pub struct Chosen {
    denoiser: Denoiser,
    why: String,
}

/// The denoiser that is asked for, if one is.
///
/// # Errors
/// [`crate::Error::Device`] for one that is not there, and what helps.
pub fn choose(choice: Option<DenoiseChoice>) -> Result<Option<Chosen>> {
    let Some(choice) = choice else { return Ok(None) };
    let filter = || Denoiser::Filter(Default::default());
    let oidn = |oidn: Oidn| {
        let why = format!("Open Image Denoise {}", oidn.version());
        Chosen { denoiser: Denoiser::Oidn(oidn), why }
    };
    Ok(Some(match choice {
        DenoiseChoice::Filter => Chosen { denoiser: filter(), why: "asked for".into() },
        DenoiseChoice::Oidn => oidn(Oidn::open()?),
        DenoiseChoice::Auto => match Oidn::open() {
            Ok(library) => oidn(library),
            Err(e) => Chosen { denoiser: filter(), why: e.to_string() },
        },
    }))
}

/// Denoises films of one scene and camera.
pub struct Denoising<'a> {
    chosen: &'a Chosen,
    shot: DenoiseInput<'a>,
    // those of the first film serve the next
    features: RefCell<Option<Features>>,
    seconds: Cell<f64>,
}

impl<'a> Denoising<'a> {
    pub fn new(chosen: &'a Chosen, shot: DenoiseInput<'a>) -> Self {
        Self { chosen, shot, features: RefCell::new(None), seconds: Cell::new(0.0) }
    }

    /// What the image is called by in its metadata.
    pub fn name(&self) -> &'static str {
        self.chosen.denoiser.name()
    }

    /// The channels of a denoised film in place of its means, which follow as `noisy.R`, `noisy.G`, `noisy.B`. An interruption ends it, unless `control`
    /// wants what there is: then that is denoised, too.
    pub fn channels(
        &self,
        accumulated: &Accumulated,
        mut channels: Vec<Channel>,
        control: &mut dyn Control,
    ) -> Result<Vec<Channel>> {
        let start = Instant::now();
        let mut stop = Unstoppable(control);
        let features = match self.features.take() {
            Some(features) => features,
            None => Features::render(&self.shot, &mut stop)?,
        };
        let denoised = self.chosen.denoiser.denoise(&self.shot, &accumulated.film, &features, &mut stop)?;
        self.features.replace(Some(features));
        let mut noisy = Vec::new();
        for (c, name) in CHANNELS.iter().enumerate() {
            let Some(channel) = channels.iter_mut().find(|channel| channel.name == *name) else { continue };
            let plane = denoised.iter().skip(c).step_by(CHANNELS.len()).copied().collect();
            let mean = std::mem::replace(&mut channel.samples, Samples::F32(plane));
            noisy.push(Channel { name: format!("noisy.{name}"), samples: mean });
        }
        channels.extend(noisy);
        self.seconds.set(self.seconds.get() + start.elapsed().as_secs_f64());
        Ok(channels)
    }

    /// What there is to say of it.
    pub fn report(&self) -> DenoiseReport {
        let (name, why, seconds) = (self.name(), &self.chosen.why, self.seconds.get());
        DenoiseReport {
            line: format!(
                "denoised by {name} ({why}) in {seconds:.3} s: the image is biased; noisy.R, noisy.G and noisy.B of an .exr are the mean without"
            ),
            explanation: format!(
                "denoiser {name}: {why}; it knows surfaces by {} camera rays a pixel{}",
                GRID * GRID + 1,
                match self.chosen.denoiser {
                    Denoiser::Filter(_) => "",
                    Denoiser::Oidn(_) => ", and takes them for noisy",
                }
            ),
            record: json!({ "denoiser": name, "reason": why, "seconds": seconds, "biased": true }),
        }
    }
}

/// The same for people and for programs.
#[derive(Clone, Debug)]
pub struct DenoiseReport {
    /// A sentence.
    pub line: String,
    /// For `--explain`.
    pub explanation: String,
    /// A map.
    pub record: Value,
}
