//! Images rendered on the spot: settings from lines of words, and settings that all share.

use crate::error::{Error, Result};
use crate::film::Control;
use crate::integrators;
use crate::integrators::aov::Aov;
use crate::output::Image;
use crate::renderer::frames::frame_settings;
use crate::renderer::{RenderSettings, Renderer};
use crate::settings::GivenSetting;

/// The settings of renders: lines of words, like `ao --ao-radius 2 --spp 64`, over those shared
/// settings that have an effect on them.
///
/// # Errors
/// [`Error::Usage`] for words that are no settings, contradictions, and settings without effect.
pub fn settings(words: &[&str], shared: &RenderSettings) -> Result<Vec<RenderSettings>> {
    let own = words.iter().map(|w| RenderSettings::from_words(w)).collect::<Result<Vec<_>>>()?;
    let given = shared.given();
    let mut is_used = vec![own.is_empty(); given.len()];
    let mut all = Vec::new();
    for (settings, words) in own.iter().zip(words) {
        let wrong = |e: String| Error::Usage(format!("\"{words}\": {e}"));
        let mut unused: Vec<&'static str> = Vec::new();
        for (setting, is_used) in given.iter().zip(&mut is_used) {
            let applies = applies(setting, settings);
            *is_used |= applies;
            if !applies {
                unused.push(setting.name);
            }
        }
        let mut kept = shared.clone();
        kept.retain(&|name| !unused.contains(&name));
        let merged = kept.overridden_by(settings);
        if let (None, Some(made)) = (settings.realtime_setting(), merged.realtime_setting()) {
            let option = made.option();
            return Err(wrong(format!(
                "{option} makes a still of each frame: say with --spp how many samples each has"
            )));
        }
        merged.check().map_err(|e| wrong(e.to_string()))?;
        all.push(merged);
    }
    match given.iter().zip(&is_used).find(|(_, used)| !**used) {
        Some((setting, _)) => {
            Err(Error::Usage(format!("{} has no effect on any of the renders: leave it out", setting.option())))
        }
        None => Ok(all),
    }
}

/// Does a setting have an effect on what these settings render?
fn applies(setting: &GivenSetting, settings: &RenderSettings) -> bool {
    let frames = settings.realtime_setting();
    // what only frames in real time have does not make a still one of them
    (setting.applies.stills || frames.is_some())
        && integrators::check(std::slice::from_ref(setting), settings.integrator(), frames.as_ref()).is_ok()
}

/// The settings of the first frame, where settings show the last of many frames in real time, as
/// many as fill histories. `None` where settings say which frame, and for stills.
pub fn first_frame(settings: &RenderSettings) -> Option<RenderSettings> {
    settings.realtime_setting()?;
    let mut first = settings.clone();
    let is_open = settings.frames.frames.is_none() && settings.frames.warm_up.is_none();
    first.frames.warm_up = Some(0);
    is_open.then_some(first)
}

/// A render, and what there is to say of it.
pub struct Rendered {
    pub image: Image,
    /// Which frame it is, of frames in real time.
    pub frame: Option<String>,
    /// A sentence for each setting that was left open and the scene decided.
    pub choices: Vec<String>,
    /// A sentence about given settings that the image hardly depends on, and what helps.
    pub without_effect: Option<String>,
}

/// Renders a still, the last one of a time line, or the last of frames in real time.
///
/// # Errors
/// Those of [`Renderer::still`] and [`Renderer::frames`].
pub fn render(renderer: &mut Renderer, settings: &RenderSettings, control: &mut dyn Control) -> Result<Rendered> {
    if settings.is_still_sequence() {
        let mut stills = renderer.still_sequence(settings)?;
        let (last, choices) = (stills.range().end - 1, stills.choices().to_vec());
        let image = stills.render(last, control)?.image;
        return Ok(Rendered { image, frame: Some(format!("frame {last}")), choices, without_effect: None });
    }
    if settings.realtime_setting().is_none() {
        let still = renderer.still(settings, control)?;
        return Ok(Rendered {
            image: still.image,
            frame: None,
            choices: still.report.setup.choices,
            without_effect: None,
        });
    }

    // Renders all frames in real time, of which the last is shown.
    let converges = frame_settings(settings)?.converges();
    let mut frames = renderer.frames(settings, false, control)?;
    let (mut done, count) = (0u32, frames.count());
    let mut number = 0;
    while let Some(frame) = frames.advance()? {
        (done, number) = (done + 1, frame.number);
        control.progress(u64::from(done), u64::from(count));
        if control.should_stop()? {
            return Err(Error::Interrupted);
        }
    }
    let image = frames.image(control)?;
    let choices = frames.report().setup.choices;
    // the frames before are identical to it
    let is_at_rest = settings.frames.range().end - settings.frames.range().first == 1;
    let frame = match (count, is_at_rest) {
        (1, _) => "the first frame".to_owned(),
        (_, true) => format!("frame {count}, at rest"),
        (_, false) => format!("frame {number}, after {} others", count - 1),
    };

    // Warns of filters that have done their work before the last frame.
    let has_converged = is_at_rest && converges && count > CONVERGED_FRAMES;
    let idle: Vec<String> = settings
        .frames
        .given()
        .iter()
        .filter(|s| has_converged && ["filter", "filter_radius"].contains(&s.name))
        .map(GivenSetting::option)
        .collect();
    let without_effect = (!idle.is_empty()).then(|| {
        format!(
            "{} next to no effect on {frame}, which has all but converged: compare the first frame (--warm-up 0), frames in motion (--frames 0..8 --orbit 120), or an image that keeps its history (--at-rest hold)",
            match &idle[..] {
                [one] => format!("{one} has"),
                all => format!("{} have", all.join(" and ")),
            }
        )
    });
    Ok(Rendered { image, frame: Some(frame), choices, without_effect })
}

/// Frames at rest after which spatial filters of a converging image reach no farther than a pixel.
const CONVERGED_FRAMES: u32 = 16;

/// Adds the ids of pixels to what is rendered, for masks by instance.
pub fn add_ids(settings: &mut RenderSettings) {
    if !Aov::Ids.is_in(&settings.image.aov) {
        settings.image.aov.push(Aov::Ids);
    }
}
