//! Pages to files, by the templates.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use minijinja::{Environment, context};
use serde::Serialize;

use super::images::ImagesContext;
use super::layout::{COLORS, ChartLayout};
use super::table::{Status, Table};
use super::{Page, Part};
use crate::error::{Error, Result};
use crate::files::write_atomically;
use crate::output::palette;

/// Templates by the names that they call each other.
const TEMPLATES: [(&str, &str); 7] = [
    ("page.html", include_str!("templates/page.html")),
    ("table.html", include_str!("templates/table.html")),
    ("chart.html", include_str!("templates/chart.html")),
    ("marks.xml", include_str!("templates/marks.xml")),
    ("plot.xml", include_str!("templates/plot.xml")),
    ("images.html", include_str!("templates/images.html")),
    ("data.js", include_str!("templates/data.js")),
];

const STYLES: [&str; 2] = [include_str!("templates/page.css"), include_str!("templates/images.css")];

/// Scripts, in the order in which they run.
const SCRIPTS: [&str; 6] = [
    include_str!("templates/page.js"),
    include_str!("templates/pixels.js"),
    include_str!("templates/colours.js"),
    include_str!("templates/view.js"),
    include_str!("templates/comparison.js"),
    include_str!("templates/controls.js"),
];

#[derive(Serialize)]
struct SectionContext {
    title: String,
    status: Option<Status>,
    folded: bool,
    parts: Vec<PartContext>,
}

/// A part of a section; charts that follow each other are one, side by side where there is room.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum PartContext {
    Text { text: String },
    Table { table: Table },
    Charts { charts: Vec<ChartLayout> },
    Images { images: ImagesContext },
}

/// Writes a page into the folder `dir`, in place of a former one, and returns the path of its file.
///
/// # Errors
/// [`Error::Output`]; [`Error::Usage`] for images that do not fit together.
pub fn write(dir: &Path, page: &Page) -> Result<PathBuf> {
    let environment = templates()?;
    let data = dir.join("data");
    fs::create_dir_all(&data).map_err(|e| Error::write(&data, &e))?;

    // Lays out the sections, and writes pixels into files beside the page.
    let mut colors = HashMap::new();
    let mut images = 0;
    let mut sections = Vec::new();
    for section in &page.sections {
        let mut parts = Vec::new();
        for part in &section.parts {
            let part = match part {
                Part::Text(text) => PartContext::Text { text: text.clone() },
                Part::Table(table) => PartContext::Table { table: table.clone() },
                Part::Chart(chart) => {
                    let mut color = |name: &str| {
                        let next = colors.len() % COLORS;
                        *colors.entry(name.to_owned()).or_insert(next)
                    };
                    let layout = ChartLayout::new(chart, &mut color);
                    if let Some(PartContext::Charts { charts }) = parts.last_mut() {
                        charts.push(layout);
                        continue;
                    }
                    PartContext::Charts { charts: vec![layout] }
                }
                Part::Images(comparison) => {
                    let context = comparison.context(images)?;
                    images += 1;
                    let pixels = comparison.data()?;
                    let template = environment.get_template("data.js").map_err(broken)?;
                    let text = template.render(context! { key => context.key(), pixels }).map_err(broken)?;
                    write_text(&dir.join(context.source()), &text)?;
                    PartContext::Images { images: context }
                }
            };
            parts.push(part);
        }
        sections.push(SectionContext {
            title: section.title.clone(),
            status: section.status,
            folded: section.folded,
            parts,
        });
    }
    remove_data_after(&data, images);

    // Renders the page, with everything but pixels inside.
    let text = environment.get_template("page.html").and_then(|t| {
        t.render(context! {
            title => page.title,
            summary => page.summary,
            command => page.command,
            facts => page.facts,
            warnings => page.warnings,
            sections,
            has_images => images > 0,
            heat => palette::HEAT,
            signed => palette::SIGNED,
            styles => STYLES,
            scripts => SCRIPTS,
            version => env!("CARGO_PKG_VERSION"),
        })
    });
    let index = dir.join("index.html");
    write_text(&index, &text.map_err(broken)?)?;
    Ok(index)
}

/// The templates, compiled.
///
/// # Errors
/// [`Error::CheckFailed`] for one that is broken, which is a bug.
pub(super) fn templates() -> Result<Environment<'static>> {
    let mut environment = Environment::new();
    for (name, source) in TEMPLATES {
        environment.add_template(name, source).map_err(broken)?;
    }
    Ok(environment)
}

/// The address of a file, as a browser takes it: `file:///home/me/report/index.html`.
pub fn address(path: &Path) -> String {
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let mut address = String::from("file://");
    for byte in path.to_string_lossy().bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'_' | b'.' | b'~' => {
                address.push(char::from(byte))
            }
            // writing to a string does not fail
            _ => drop(write!(address, "%{byte:02X}")),
        }
    }
    address
}

/// Removes pixels of a former report with more images, which nobody reads; failing is harmless.
fn remove_data_after(data: &Path, images: usize) {
    for k in images + 1.. {
        if fs::remove_file(data.join(format!("images-{k}.js"))).is_err() {
            break;
        }
    }
    // only where it is empty
    let _ = fs::remove_dir(data);
}

pub(super) fn write_text(path: &Path, text: &str) -> Result<()> {
    write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// A template that does not work is a bug of the program, and tests render all of them.
pub(super) fn broken(error: minijinja::Error) -> Error {
    Error::CheckFailed(format!("a template of the report is broken: {error:#}"))
}

#[cfg(test)]
mod tests {
    use super::super::{Cell, Chart, ComparedImage, ImageComparison, Row, Section, Series};
    use super::*;

    fn images() -> Part {
        let image = |v: f32| ComparedImage { name: format!("<{v}>"), values: vec![v; 4], ..Default::default() };
        let images = vec![image(0.25), image(0.5)];
        Part::Images(ImageComparison { size: [2, 2], channels: vec!["Y".into()], images, ..Default::default() })
    }

    fn page(parts: Vec<Part>) -> Page {
        Page { title: "A <title> & more".into(), sections: vec![Section::new("First", parts)], ..Page::default() }
    }

    #[test]
    fn every_part_is_written_and_text_is_no_markup() {
        let dir = tempfile::tempdir().unwrap();
        let table = Table::new(&["a", "b"])
            .row(Row::new(["<i>x</i>".into(), 0.5.into()]).of_region([0, 0, 1, 1]))
            .row(Row::new([Cell::from("c").to_section(0), Cell::from(2.0).with_status(Status::Bad)]));
        let series =
            Series { name: "</svg>".into(), points: vec![(1.0, 2.0).into(), (2.0, 3.0).into()], ..Series::default() };
        let chart = Chart { title: "chart".into(), series: vec![series], ..Chart::default() };
        let parts = vec![Part::Text("1 < 2".into()), Part::Table(table), Part::Chart(chart), images()];
        let page = Page {
            command: "skylit compare a.exr b.exr --html 'a b'".into(),
            facts: vec![("device".into(), "a & b".into())],
            warnings: vec!["the cameras differ".into()],
            ..page(parts)
        };
        let index = write(dir.path(), &page).unwrap();
        let text = fs::read_to_string(&index).unwrap();
        for part in [
            "A &lt;title&gt; &amp; more",
            "1 &lt; 2",
            "&lt;i&gt;x&lt;",
            "&lt;&#x2f;svg&gt;",
            "a &amp; b",
            "\"\\u003c0.25\\u003e\"",
        ] {
            assert!(text.contains(part), "{part}");
        }
        assert!(!text.contains("<i>x") && !text.contains("http://") && !text.contains("https://"));
        assert!(text.contains("src=\"data/images-1.js\"") || text.contains("data/images-1.js"));
        let data = fs::read_to_string(dir.path().join("data/images-1.js")).unwrap();
        assert!(data.contains("images-1") && data.contains("\"values\""), "{data}");
    }

    /// Templates have the elements that scripts look for; a browser tests the rest.
    #[test]
    fn scripts_know_the_templates() {
        let names = |text: &str| -> Vec<String> {
            let rest = text.split("data-").skip(1);
            rest.map(|r| r.chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect()).collect()
        };
        let known: Vec<String> = TEMPLATES.iter().flat_map(|(_, t)| names(t)).collect();
        let used: Vec<String> = SCRIPTS.iter().flat_map(|s| names(s)).filter(|n| !n.ends_with('-')).collect();
        assert!(used.len() > 15 && known.len() > 15);
        for name in used {
            assert!(known.contains(&name), "data-{name} is in no template");
        }
        for script in SCRIPTS {
            for [open, close] in [['(', ')'], ['{', '}'], ['[', ']']] {
                let count = |c: char| script.chars().filter(|x| *x == c).count();
                // the keys for exposure are brackets in quotes
                assert!(count(open).abs_diff(count(close)) <= 1, "{open} and {close} of {}", &script[..60]);
            }
        }
    }

    #[test]
    fn a_smaller_report_leaves_no_pixels_behind() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &page(vec![images(), images()])).unwrap();
        assert!(dir.path().join("data/images-2.js").exists());
        write(dir.path(), &page(vec![images()])).unwrap();
        assert!(dir.path().join("data/images-1.js").exists() && !dir.path().join("data/images-2.js").exists());
        write(dir.path(), &page(Vec::new())).unwrap();
        assert!(!dir.path().join("data").exists());
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        fs::write(&file, "").unwrap();
        assert_eq!(write(&file, &page(Vec::new())).unwrap_err().exit_code(), 4);
    }

    #[test]
    fn addresses_are_those_of_browsers() {
        assert_eq!(address("/no such/ä.html".as_ref()), "file:///no%20such/%C3%A4.html");
    }
}
