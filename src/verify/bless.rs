//! Makes golden images, and says what changed.

use super::golden::{FIRST_SEED, Golden, Origin, REPLICATES};
use super::manifest::{Frame, Manifest, names_driver};
use super::session::VerifySession;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::DeviceInfo;
use crate::measure::comparison::{CompareOptions, compare};
use crate::measure::z_test::{Estimate, ZTest};
use crate::output::Samples;
use crate::report::format_number;
use crate::tracer::TracerKind;

#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "lowercase", tag = "change")]
pub enum Change {
    /// There was none.
    New,
    Unchanged,
    /// It is another now.
    Changed {
        /// A line about the differences.
        text: String,
    },
}

/// Refuses drivers on which golden images are not to be made.
///
/// # Errors
/// [`Error::Usage`], with the line to add to the manifest.
pub fn check_driver(manifest: &Manifest, info: &DeviceInfo) -> Result<()> {
    let remedy = format!(
        "add it to [drivers] pinned in {}, or use --force",
        manifest.folder.join(super::manifest::NAME).display()
    );
    let refuse = |why: String| Err(Error::Usage(format!("golden images are not made on {why}: {remedy}")));
    // a driver without a version cannot be told from the next one
    if !info.driver.contains(|c: char| c.is_ascii_digit()) {
        return refuse(format!("{:?}, a driver that does not say its version", info.driver));
    }
    if manifest.pinned.is_empty() {
        return refuse(format!("{:?}, because no driver is pinned", info.driver));
    }
    if !names_driver(&manifest.pinned, &info.driver) {
        return refuse(format!("{:?}, which is not pinned (pinned: {})", info.driver, manifest.pinned.join(", ")));
    }
    Ok(())
}

/// The tracer of a frame's golden image: the device's own choice, if the frame is rendered with it.
pub fn tracer(session: &VerifySession, frame: &Frame) -> Result<TracerKind> {
    let kinds: Vec<_> = session.tracers(&frame.tracers).into_iter().filter(|k| k.1).map(|k| k.0).collect();
    let (auto, _) = TracerKind::auto(session.info());
    let chosen = kinds.iter().copied().find(|k| *k == auto).or(kinds.first().copied());
    chosen.ok_or_else(|| Error::Device(format!("{} has none of the frame's tracers", session.info().name)))
}

/// Renders a frame's golden image.
///
/// # Errors
/// Errors of the renderer; [`Error::CheckFailed`] for an image too noisy for the bias to be found.
pub fn render(
    session: &mut VerifySession,
    manifest: &Manifest,
    frame: &Frame,
    kind: TracerKind,
    control: &mut dyn Control,
) -> Result<Golden> {
    let (path, origin) = (manifest.golden(frame), Origin::new(session.info(), kind));
    let Some(limit) = &frame.tolerance.z_test else {
        return Golden::of_image(&path, frame, session.render(frame, kind, None, None, control)?, &origin);
    };
    let seeds = FIRST_SEED..FIRST_SEED + REPLICATES;
    let images =
        seeds.map(|seed| session.render(frame, kind, Some(seed), None, control)).collect::<Result<Vec<_>>>()?;
    let golden = Golden::of_replicates(&path, frame, &images, &origin)?;
    if let (Some(bias), Some(reference)) = (limit.bias, &golden.reference) {
        let verdict =
            ZTest { false_alarms: limit.false_alarms }.compare(&Estimate::from_image(&images[0])?, reference)?;
        let found = verdict.detectable_bias;
        if found > bias {
            let [found, bias] = [found, bias].map(|b| 100.0 * b);
            return Err(Error::CheckFailed(format!(
                "too noisy to find a bias of {bias} % of the mean: the least that is found is {found:.2} %; raise --spp or --size"
            )));
        }
    }
    Ok(golden)
}

/// Writes a golden image where it is another than before.
pub fn update(golden: &Golden) -> Result<Change> {
    if !golden.path.exists() {
        golden.save()?;
        return Ok(Change::New);
    }
    let before = Golden::load(&golden.path);
    let after = as_read(golden)?;
    let text = match &before {
        Ok(before) if Contents::from_golden(before) == Contents::from_golden(&after) => return Ok(Change::Unchanged),
        Ok(before) => changes(before, &after)?,
        Err(e) => format!("the golden image before could not be read ({e})"),
    };
    golden.save()?;
    Ok(Change::Changed { text })
}

/// A golden image as its file will say it: a PNG rounds.
fn as_read(golden: &Golden) -> Result<Golden> {
    let dir = tempfile::tempdir().map_err(|e| Error::write(&golden.path, &e))?;
    let path = dir.path().join(golden.path.file_name().unwrap_or_default());
    Golden { path: path.clone(), ..golden.clone() }.save()?;
    Golden::load(&path)
}

/// Everything that makes two golden images the same.
#[derive(PartialEq)]
struct Contents {
    /// Names and bits of channels, by name.
    channels: Vec<(String, Vec<u32>)>,
    metadata: Vec<(String, String)>,
}

impl Contents {
    fn from_golden(golden: &Golden) -> Self {
        let bits = |samples: &Samples| match samples {
            Samples::F32(s) => s.iter().map(|v| v.to_bits()).collect(),
            Samples::U32(s) => s.clone(),
        };
        let mut channels: Vec<_> = golden.image.channels.iter().map(|c| (c.name.clone(), bits(&c.samples))).collect();
        channels.sort();
        let mut metadata = golden.image.metadata.clone();
        metadata.sort();
        Self { channels, metadata }
    }
}

/// The differences, in a line.
fn changes(before: &Golden, after: &Golden) -> Result<String> {
    let mut parts = Vec::new();
    let [old, new] = [before, after].map(|g| [g.image.width, g.image.height]);
    let colours = |g: &Golden| ["R", "G", "B", "Y"].map(|n| g.image.f32(n).is_some());
    if old != new {
        parts.push(format!("{}x{} pixels in place of {}x{}", new[0], new[1], old[0], old[1]));
    } else if colours(before) != colours(after) {
        parts.push("other channels of colour".to_owned());
    } else {
        let c = compare(&after.image, &before.image, &CompareOptions::default())?;
        // where no pixel shows anything, in either image
        if c.max == 0.0 || c.mask_pixels == 0 {
            parts.push("the same colours".to_owned())
        } else {
            let flip = c.flip.map(|f| format!(", FLIP {f:.4}")).unwrap_or_default();
            let sign = if c.bias > 0.0 { "+" } else { "" };
            let [rmse, bias, max] = [c.rmse, c.bias, c.max].map(format_number);
            let text = format!("rmse {rmse}, bias {sign}{bias}, largest difference {max}{flip}");
            parts.push(text);
        }
    }
    let driver = |g: &Golden| g.driver().unwrap_or("an unknown driver").to_owned();
    if driver(before) != driver(after) {
        parts.push(format!("{} in place of {}", driver(after), driver(before)));
    }
    let entries = |g: &Golden| g.image.metadata("verify.render").unwrap_or("other settings").to_owned();
    if entries(before) != entries(after) {
        parts.push(format!("{:?} in place of {:?}", entries(after), entries(before)));
    }
    let chosen = |g: &Golden| g.chosen().unwrap_or("nothing").to_owned();
    if chosen(before) != chosen(after) {
        parts.push(format!("chosen by the scene: {:?} in place of {:?}", chosen(after), chosen(before)));
    }
    Ok(parts.join("; "))
}
