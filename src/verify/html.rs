//! The results as a page: a table of all frames, and the images of each that differs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::golden::shown_image;
use super::manifest::{Frame, GoldenFormat};
use super::text::plural;
use super::{FrameResult, Outcome, Summary};
use crate::error::Result;
use crate::measure::comparison::{CompareOptions, compare};
use crate::output::{Image, Samples};
use crate::report::comparison::{NamedImage, section};
use crate::report::{self, Cell, Page, Part, Row, Section, Status, Table};

/// Writes the page into a folder and returns its path. `command`: the command that was typed.
pub fn write(summary: &Summary, frames: &[Frame], folder: &Path, command: &str, dir: &Path) -> Result<PathBuf> {
    let frames: BTreeMap<&str, &Frame> = frames.iter().rev().map(|f| (f.name.as_str(), f)).collect();
    let mut sections = vec![Section::default()];
    let mut table = Table::new(&["frame", "tracer", "result", "seconds", "what was found"]);
    for result in &summary.frames {
        let (word, status, text) = words(result);
        let mut name = Cell::from(result.frame.as_str());
        if let Outcome::Differs(_) = result.outcome {
            sections.push(difference(result, frames.get(result.frame.as_str()).copied(), &text)?);
            name = name.to_section(sections.len() - 1);
        }
        let mut verdict = Cell::from(word);
        if let Some(status) = status {
            verdict = verdict.with_status(status);
        }
        let tracer = result.tracer.map(|t| t.name()).unwrap_or_default();
        table = table.row(Row::new([name, tracer.into(), verdict, result.seconds.into(), text.as_str().into()]));
    }
    sections[0] = Section::new("All frames", vec![Part::Table(table)]);

    // the page, which says in a sentence how it went
    let differ = summary.count(|o| matches!(o, Outcome::Differs(_)));
    let failed = summary.count(|o| matches!(o, Outcome::Failed(_)));
    let all = plural(summary.frames.len(), "render", "renders");
    let page = Page {
        title: format!("Reference frames of {}", folder.display()),
        summary: match (differ, failed) {
            (0, 0) => format!("{all}: none differs from its golden image."),
            (0, failed) => format!("{all}: none differs from its golden image; {failed} could not be judged."),
            (differ, 0) => format!("{all}: {} from golden images.", plural(differ, "differs", "differ")),
            (differ, failed) => {
                format!(
                    "{all}: {} from golden images; {failed} could not be judged.",
                    plural(differ, "differs", "differ")
                )
            }
        },
        command: command.to_owned(),
        facts: [("Device", &summary.device), ("Driver", &summary.driver)]
            .map(|(k, v)| (k.to_owned(), v.clone()))
            .to_vec(),
        sections,
        ..Page::default()
    };
    report::write(dir, &page)
}

/// An outcome in a word, with its colour, and what was found.
fn words(result: &FrameResult) -> (&'static str, Option<Status>, String) {
    let note = result.note.as_ref().map_or_else(String::new, |note| format!("; {note}"));
    match &result.outcome {
        Outcome::Holds(judgement) => ("holds", Some(Status::Good), judgement.text() + &note),
        Outcome::Differs(judgement) => ("differs", Some(Status::Bad), judgement.text() + &note),
        Outcome::Failed(why) => ("failed", Some(Status::Bad), why.clone()),
        Outcome::Skipped(why) => ("skipped", None, why.clone()),
        Outcome::Blessed(_) => ("blessed", None, String::new()),
    }
}

/// The section of a frame that differs.
fn difference(result: &FrameResult, frame: Option<&Frame>, text: &str) -> Result<Section> {
    let title = match result.tracer {
        Some(tracer) => format!("{} ({})", result.frame, tracer.name()),
        None => result.frame.clone(),
    };
    let (Some(images), Some(frame)) = (&result.images, frame) else {
        return Ok(with_text(Section::new(title, Vec::new()), text, frame, result));
    };
    let (image, golden) = (&images.0, &images.1);
    // a picture is compared with a picture
    let image = match frame.format {
        GoldenFormat::Exr => image.clone(),
        GoldenFormat::Png => clamped(shown_image(frame, image)),
    };
    let made = golden.driver().map(|d| format!("made on {d}")).unwrap_or_default();
    let section = match compare(&image, &golden.image, &CompareOptions::default()) {
        Ok(comparison) => {
            // pictures of golden images are without alpha, so on black both
            let has_alpha = [&image, &golden.image].iter().all(|image| image.f32("A").is_some());
            let background = frame.settings.backdrop().colour().filter(|_| has_alpha);
            let named =
                |name, description, image, comparison| NamedImage { name, description, image, background, comparison };
            let now = named("image", "rendered now", &image, Some(&comparison));
            let then = named("golden", &made, &golden.image, None);
            section(&title, &[now, then], 1)?
        }
        // of different sizes, say: the text has it
        Err(e) => Section::new(title, vec![Part::Text(format!("The images are not shown: {e}."))]),
    };
    Ok(with_text(section, text, Some(frame), result))
}

/// An image with values as 8 bits hold them, 0 to 1.
fn clamped(mut image: Image) -> Image {
    for channel in &mut image.channels {
        if let Samples::F32(values) = &mut channel.samples {
            values.iter_mut().for_each(|v| *v = v.clamp(0.0, 1.0));
        }
    }
    image
}

fn with_text(mut section: Section, text: &str, frame: Option<&Frame>, result: &FrameResult) -> Section {
    section.status = Some(Status::Bad);
    section.parts.insert(0, Part::Text(text.to_owned()));
    if let Some(frame) = frame {
        let chosen = result.chosen.as_ref().map_or_else(String::new, |options| format!(" {options}"));
        let text = format!("skylit {} {} {}{chosen}", frame.command(), frame.scene, frame.render_text());
        section.parts.insert(1, Part::Text(text));
    }
    section
}
