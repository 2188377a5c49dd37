//! The comparison as a page of a report.

use std::borrow::Cow;
use std::path::Path;

use super::report::significant;
use super::{AoVersusPath, ChoiceRecord, FitRecord, Report};
use crate::compare::{Entry, ImageSet};
use crate::error::Result;
use crate::integrators::path::ambient::EnvironmentLight;
use crate::measure::comparison::CompareOptions;
use crate::output::{Channel, Image, Samples};
use crate::report::comparison::{self, NamedImage};
use crate::report::{Axis, Cell, Chart, Mark, Page, Part, Point, Row, Section, Series, Table};

/// A page with the best image beside direct light and path tracing, and the rest that each
/// approximation leaves. `command`: the command line that was typed.
pub fn page(found: &AoVersusPath, command: &str, warnings: &[String]) -> Result<Page> {
    let report = &found.report;
    let mut sections = vec![images(found)?];
    sections.extend(report.path.iter().chain(&report.sky).map(section));
    Ok(Page {
        title: format!("{}: ambient occlusion against path tracing", scene_name(&report.scene)),
        summary: summary(report),
        command: command.to_owned(),
        facts: facts(report),
        warnings: warnings.to_vec(),
        sections,
    })
}

/// The target of a fit, in words.
pub fn title(fit: &FitRecord) -> &'static str {
    match fit.environment_light {
        Some(EnvironmentLight::Ambient) => {
            "Against path tracing, ambient light in place of the environment and of bounces"
        }
        Some(EnvironmentLight::Traced) => "Against path tracing, ambient light in place of bounces",
        None => "Ambient visibility against ao-sky",
    }
}

/// A scene's name without its folder.
pub fn scene_name(scene: &str) -> Cow<'_, str> {
    Path::new(scene).file_name().map_or(scene.into(), |n| n.to_string_lossy())
}

/// A layer of the image as an image of its own; `counted`: which pixels metrics count.
fn layer(image: &Image, prefix: &str, counted: &[f32]) -> Image {
    let of = |name: &str| {
        let full = format!("{prefix}{name}");
        image
            .channels
            .iter()
            .find(|c| c.name == full)
            .map(|c| Channel { name: name.to_owned(), samples: c.samples.clone() })
    };
    let alpha = Channel { name: "A".into(), samples: Samples::F32(counted.to_vec()) };
    Image { channels: ["R", "G", "B"].into_iter().filter_map(of).chain([alpha]).collect(), ..image.clone() }
}

fn images(found: &AoVersusPath) -> Result<Section> {
    let entry = |name: &str, prefix: &str| Entry {
        name: name.into(),
        image: layer(&found.image, prefix, &found.counted),
        ..Entry::default()
    };
    let entries = vec![entry("lit, best fit", ""), entry("direct light", "direct."), entry("path tracing", "path.")];
    let set = ImageSet::new(entries, 2, &CompareOptions::default())?;
    let images: Vec<NamedImage> = (set.entries.iter().zip(&set.comparisons))
        .map(|(e, c)| NamedImage {
            name: &e.name,
            description: &e.description,
            image: &e.image,
            background: None,
            comparison: c.as_ref(),
        })
        .collect();
    let mut section = comparison::section("Images", &images, 2)?;
    section.parts.push(Part::Text("Metrics count the pixels that show nothing but surfaces that reflect ambient light: visible lamps would outweigh all else.".into()));
    Ok(section)
}

fn percent(x: f64) -> String {
    format!("{:.0} %", 100.0 * x)
}

fn explained(fit: &FitRecord, name: &str) -> f64 {
    fit.rows.iter().find(|r| r.name == name).map_or(0.0, |r| r.explained)
}

fn summary(report: &Report) -> String {
    let Some(fit) = report.path.first() else { return String::new() };
    let best = 1.0 - (fit.best.rmse / fit.target_rms.max(f64::MIN_POSITIVE)).powi(2);
    let flat = explained(fit, "ambient light without occlusion");
    format!(
        "{} of the light comes after two bounces or more. Ambient light with {} accounts for {} of what it stands for, by its mean square; without occlusion it is {}.",
        percent(report.light.bounces),
        choice(&fit.best),
        percent(best),
        percent(flat)
    )
}

fn choice(choice: &ChoiceRecord) -> String {
    let radius = choice.radius.map(|r| format!("an AO radius of {}", significant(r)));
    let half = choice.half_distance.map(|h| format!("occlusion that halves every {}", significant(h)));
    match (radius, half) {
        (Some(radius), Some(half)) => format!("{radius} and {half}"),
        (Some(text), None) | (None, Some(text)) => text,
        (None, None) => "AO without radius or falloff".into(),
    }
}

fn facts(report: &Report) -> Vec<(String, String)> {
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let mut facts = vec![
        fact("size", format!("{}x{} pixels", report.size[0], report.size[1])),
        fact("paths per pixel", report.spp.to_string()),
        fact("occlusion rays per pixel", report.ao_samples.to_string()),
        fact("mean radiance", significant(report.light.mean)),
        fact("lights and emitters", percent(report.light.lights)),
        fact("environment, directly", percent(report.light.environment)),
        fact("two bounces or more", percent(report.light.bounces)),
        fact("diagonal", format!("{} scene units", significant(report.diagonal))),
    ];
    facts.extend(report.choices.iter().map(|c| fact("chosen", c.clone())));
    facts.extend(report.commands.iter().map(|c| fact("to render it", c.clone())));
    facts
}

fn section(fit: &FitRecord) -> Section {
    let mut parts = vec![Part::Text(format!(
        "Best: {}, ambient radiance {}. The target has a root mean square of {}, and is known to a standard error of {}.",
        choice(&fit.best),
        fit.best.color(),
        significant(fit.target_rms),
        significant(fit.target_standard_error)
    ))];
    let mut table = Table::new(&["Approximation", "RMSE", "Explained", "Ambient radiance"]).titled("Approximations");
    for row in &fit.rows {
        let ambient = row.ambient.iter().map(|c| significant(*c)).collect::<Vec<_>>().join(", ");
        table = table.row(Row::new([
            Cell::from(row.name),
            Cell::number(row.rmse, significant(row.rmse)),
            Cell::number(row.explained, format!("{:.1} %", 100.0 * row.explained)),
            Cell::from(ambient),
        ]));
    }
    parts.push(Part::Table(table));
    // none of a sum that noise makes negative
    if let Some((p, all)) = fit.parts.as_ref().map(|p| (p, p.transport + p.occlusion + p.cross)).filter(|p| p.1 > 0.0) {
        parts.push(Part::Text(format!(
            "Of the mean squared error of the best, {} is left with ao-sky in place of AO: light that no ambient radiance describes. {} is the difference of AO from ao-sky, and {} both together, where they add up or compensate each other.",
            percent(p.transport / all),
            percent(p.occlusion / all),
            percent(p.cross / all)
        )));
    }
    parts.push(Part::Chart(chart(fit)));
    Section::new(title(fit), parts)
}

/// Errors over the radius, a series for each falloff. An infinite radius has no place among them.
pub fn error_curves(fit: &FitRecord, mark: Mark) -> Vec<Series> {
    let series = fit.curves.iter().map(|curve| Series {
        name: curve.half_distance.map_or_else(|| "binary".into(), |half| format!("halves every {}", significant(half))),
        mark,
        points: curve.radii.iter().zip(&curve.rmse).filter_map(|(r, e)| Some(Point::from(((*r)?, *e)))).collect(),
    });
    series.collect()
}

fn chart(fit: &FitRecord) -> Chart {
    Chart {
        title: "Error over radius".into(),
        caption: "Root mean squared error with the best ambient radiance for each radius and falloff.".into(),
        x: Axis::logarithmic("AO radius, scene units"),
        y: Axis::linear("RMSE"),
        series: error_curves(fit, Mark::Line),
    }
}
