//! The comparison as a page of a report.

use super::{ImageSet, differing_metadata, letter};
use crate::error::Result;
use crate::measure::comparison::Comparison;
use crate::report::comparison::{self, NamedImage};
use crate::report::{Cell, Column, Page, Part, Row, Section, Table, format_number};

/// A page with the images, their differences and metrics, and metadata in which they differ.
/// `command`: the command line that was typed.
pub fn page(set: &ImageSet, command: &str) -> Result<Page> {
    let names: Vec<String> =
        set.entries.iter().enumerate().map(|(k, e)| format!("{}: {}", letter(k), e.name)).collect();
    let images: Vec<NamedImage> = (set.entries.iter().zip(&names).zip(&set.comparisons))
        .map(|((entry, name), comparison)| NamedImage {
            name,
            description: &entry.description,
            image: &entry.image,
            background: entry.background,
            comparison: comparison.as_ref(),
        })
        .collect();
    let mut sections = vec![comparison::section("Images", &images, set.reference)?];
    // metrics have a section of their own: they are what one comes back for
    let rest = sections[0].parts.split_off(1);
    for (title, part) in ["Metrics", "Differences", "Regions"].into_iter().zip(rest) {
        match part {
            // its buttons are about the images
            Part::Table(table) if title == "Regions" => sections[0].parts.push(Part::Table(table)),
            part => sections.push(Section::new(title, vec![part])),
        }
    }
    sections.extend(metadata(set, &names));
    Ok(Page {
        title: title(set, &names),
        summary: summary(set),
        command: command.to_owned(),
        facts: facts(set),
        warnings: set.warnings.clone(),
        sections,
    })
}

fn title(set: &ImageSet, names: &[String]) -> String {
    let judged: Vec<&str> = set.judged().map(|(k, ..)| &*names[k]).collect();
    format!("{} against {}", judged.join(", "), names[set.reference])
}

/// The first numbers that one wants to know, in words.
fn summary(set: &ImageSet) -> String {
    let sentence = |(k, _, c): (usize, _, &Comparison)| {
        let flip = c.flip.map_or_else(String::new, |f| format!(", a mean FLIP of {}", format_number(f)));
        let tone = match c.bias {
            b if b > 2.0 * c.bias_standard_error => format!("brighter by {} on average", format_number(b)),
            b if -b > 2.0 * c.bias_standard_error => format!("darker by {} on average", format_number(-b)),
            _ => "neither brighter nor darker on average".to_owned(),
        };
        format!("{} has an RMSE of {}{flip}, and is {tone}.", letter(k), format_number(c.rmse))
    };
    set.judged().map(sentence).collect::<Vec<_>>().join(" ")
}

/// The facts that all images have in common.
fn facts(set: &ImageSet) -> Vec<(String, String)> {
    let first = &set.entries[0].image;
    let mut facts = vec![("size".to_owned(), format!("{}x{} pixels", first.width, first.height))];
    if let Some((_, _, c)) = set.judged().next() {
        facts.push(("channels".into(), c.channels.join(" ")));
        let is_one = set.judged().all(|(_, _, other)| (other.pixels, &other.mask) == (c.pixels, &c.mask));
        let text = |c: &Comparison| format!("{} pixels ({})", c.pixels, c.mask);
        let of_each =
            || set.judged().map(|(k, _, c)| format!("{}: {}", letter(k), text(c))).collect::<Vec<_>>().join(", ");
        facts.push(("compared".into(), if is_one { text(c) } else { of_each() }));
    }
    for key in ["scene", "device", "tracer", "version"] {
        let value = first.metadata(key).filter(|v| set.entries.iter().all(|e| e.image.metadata(key) == Some(v)));
        facts.extend(value.map(|v| (key.to_owned(), v.to_owned())));
    }
    facts
}

/// The metadata in which the images differ, if any.
fn metadata(set: &ImageSet, names: &[String]) -> Option<Section> {
    let entries = differing_metadata(set);
    let columns = std::iter::once("entry").chain(names.iter().map(String::as_str));
    let mut table = Table {
        columns: columns.map(|c| Column { title: c.to_owned(), help: String::new() }).collect(),
        ..Table::default()
    };
    for entry in &entries {
        let cells = entry.values.iter().map(|v| Cell::from(v.as_deref().unwrap_or("-")));
        table.rows.push(Row::new(std::iter::once(Cell::from(&*entry.key)).chain(cells)));
    }
    (!entries.is_empty()).then(|| Section::new("How the images were made, where it differs", vec![Part::Table(table)]))
}

#[cfg(test)]
mod tests {
    use super::super::Entry;
    use super::*;
    use crate::measure::comparison::CompareOptions;
    use crate::output::{Channel, Image, Samples};

    #[test]
    fn the_page_has_what_was_measured() {
        let entry = |name: &str, value: f32| {
            let samples = Samples::F32(vec![value, value, value, 0.5]);
            let metadata = vec![("scene".into(), "s".into()), ("integrator".into(), name.into())];
            let image = Image { width: 2, height: 2, channels: vec![Channel { name: "Y".into(), samples }], metadata };
            Entry { name: name.into(), image, ..Entry::default() }
        };
        let set = ImageSet::new(vec![entry("ao", 0.25), entry("path", 0.5)], 1, &CompareOptions::default()).unwrap();
        let page = page(&set, "skylit compare").unwrap();
        assert_eq!(page.title, "A: ao against B: path");
        assert!(
            page.summary.starts_with("A has an RMSE of 0.2165, a mean FLIP of ")
                && page.summary.contains("darker by 0.1875"),
            "{}",
            page.summary
        );
        assert!(
            page.facts.contains(&("scene".into(), "s".into()))
                && page.facts.contains(&("size".into(), "2x2 pixels".into()))
        );
        let titles: Vec<_> = page.sections.iter().map(|s| &*s.title).collect();
        assert_eq!(titles, ["Images", "Metrics", "Differences", "How the images were made, where it differs"]);
        assert!(matches!(page.sections[0].parts[..], [Part::Images(_), Part::Table(_)]));
    }
}
