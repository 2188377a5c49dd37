//! `--denoise`: which denoiser runs, what it is told, and what is said of it.

use std::cell::{Cell, RefCell};
use std::time::Instant;

use clap::ValueEnum;
use serde_json::{Value, json};

use crate::cli::args::RenderArgs;
use crate::denoise::{Denoiser, Features, GRID, Oidn, Shot};
use crate::error::Result;
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::output::{Channel, Samples};
use crate::terminal::interrupt;

/// What takes the noise away.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DenoiseChoice {
    /// Open Image Denoise where it is there, else the filter
    Auto,
    /// Intel Open Image Denoise: a neural network, on the CPU
    Oidn,
    /// The filter of ambient occlusion in real time, over radiance
    Filter,
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

/// Stops what is not worth finishing. With --keep-partial what there is is denoised, too.
struct Stop {
    keep_partial: bool,
}

impl Control for Stop {
    fn should_stop(&mut self) -> Result<bool> {
        if !self.keep_partial {
            interrupt::check()?;
        }
        Ok(false)
    }
}

/// Denoises films of one scene and camera.
pub struct Denoising<'a> {
    chosen: &'a Chosen,
    shot: Shot<'a>,
    keep_partial: bool,
    // those of the first film serve the next
    features: RefCell<Option<Features>>,
    seconds: Cell<f64>,
}

impl<'a> Denoising<'a> {
    pub fn new(chosen: &'a Chosen, shot: Shot<'a>, args: &RenderArgs) -> Self {
        Self { chosen, shot, keep_partial: args.keep_partial, features: RefCell::new(None), seconds: Cell::new(0.0) }
    }

    /// What the image is called by in its metadata.
    pub fn name(&self) -> &'static str {
        self.chosen.denoiser.name()
    }

    /// The channels of a denoised film in place of its means, which follow as `noisy.R`, `noisy.G`, `noisy.B` if `keep_noisy`.
    pub fn channels(&self, accumulated: &Accumulated, mut channels: Vec<Channel>, keep_noisy: bool) -> Result<Vec<Channel>> {
        let start = Instant::now();
        let mut stop = Stop { keep_partial: self.keep_partial };
        let features = match self.features.take() {
            Some(features) => features,
            None => Features::render(&self.shot, &mut stop)?,
        };
        let denoised = self.chosen.denoiser.denoise(&self.shot, &accumulated.film, &features, &mut stop)?;
        self.features.replace(Some(features));
        let mut noisy = Vec::new();
        for (c, name) in super::CHANNELS.iter().enumerate() {
            let Some(channel) = channels.iter_mut().find(|channel| channel.name == *name) else { continue };
            let plane = denoised.iter().skip(c).step_by(super::CHANNELS.len()).copied().collect();
            let mean = std::mem::replace(&mut channel.samples, Samples::F32(plane));
            noisy.push(Channel { name: format!("noisy.{name}"), samples: mean });
        }
        if keep_noisy {
            channels.extend(noisy);
        }
        self.seconds.set(self.seconds.get() + start.elapsed().as_secs_f64());
        Ok(channels)
    }

    /// What there is to say of it.
    pub fn tell(&self, writes_exr: bool) -> Told {
        let (name, why, seconds) = (self.name(), &self.chosen.why, self.seconds.get());
        let mean = if writes_exr { "; noisy.R, noisy.G and noisy.B are the mean without" } else { "" };
        Told {
            line: format!("denoised by {name} ({why}) in {seconds:.3} s: the image is biased{mean}"),
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
pub struct Told {
    /// A sentence.
    pub line: String,
    /// For `--explain`.
    pub explanation: String,
    /// A map.
    pub record: Value,
}
