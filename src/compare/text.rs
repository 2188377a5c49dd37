//! The comparison as lines of text and as a JSON record.

use serde_json::{Value, json};

use super::{Entry, ImageSet, letter};
use crate::error::{Error, Result};
use crate::measure::comparison::Comparison;
use crate::renderer::CHOSEN;
use crate::report::comparison::metrics;

/// Characters between two columns.
const GAP: usize = 2;

impl ImageSet {
    /// The images, then a table: a row for each metric, a column for each image that was compared.
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for (k, entry) in self.entries.iter().enumerate() {
            let role = if k == self.reference { " (reference)" } else { "" };
            let description =
                if entry.description.is_empty() { String::new() } else { format!(", {}", entry.description) };
            lines.push(format!("{}{role}: {}{description}", letter(k), entry.name));
        }
        lines.extend(self.choices());
        let judged: Vec<_> = self.judged().map(|(k, _, c)| (k, c, metrics(c))).collect();
        if let Some((_, c, _)) = judged.first() {
            let [width, height] = [self.entries[0].image.width, self.entries[0].image.height];
            let is_one = judged.iter().all(|(_, other, _)| other.mask == c.mask);
            let of_each =
                || judged.iter().map(|(k, c, _)| format!("{}: {}", letter(*k), c.mask)).collect::<Vec<_>>().join(", ");
            let mask = if is_one { c.mask.clone() } else { of_each() };
            lines.push(format!("channels {} of {width}x{height} pixels, over {mask}", c.channels.join(" ")));
        }
        let widest = |texts: &mut dyn Iterator<Item = &str>| texts.map(|t| t.chars().count()).max().unwrap_or(0) + GAP;
        let all = || judged.iter().flat_map(|(.., m)| m);
        let (first, column) = (widest(&mut all().map(|m| m.name)), widest(&mut all().map(|m| &*m.text)));
        let padded =
            |text: &str, width: usize| format!("{text}{}", " ".repeat(width.saturating_sub(text.chars().count())));
        let mut head = padded("", first);
        judged.iter().for_each(|(k, ..)| head += &padded(&letter(*k).to_string(), column));
        lines.push(head.trim_end().to_owned());
        for row in 0..judged.first().map_or(0, |(.., m)| m.len()) {
            // what no image has is not worth a line
            if judged.iter().all(|(.., m)| m[row].value.is_none()) {
                continue;
            }
            let mut line = padded(judged[0].2[row].name, first);
            judged.iter().for_each(|(.., m)| line += &padded(&m[row].text, column));
            lines.push(line.trim_end().to_owned());
        }
        lines
    }

    /// A line for each choice that the scene made, with the images that it is about.
    fn choices(&self) -> Vec<String> {
        let mut choices: Vec<(&str, String)> = Vec::new();
        for (k, entry) in self.entries.iter().enumerate() {
            for choice in &entry.choices {
                match choices.iter_mut().find(|(text, _)| text == choice) {
                    Some((_, letters)) => *letters += &format!(", {}", letter(k)),
                    None => choices.push((choice, letter(k).to_string())),
                }
            }
        }
        choices.into_iter().map(|(text, letters)| format!("{letters}: {text}")).collect()
    }

    /// All metrics as CSV: a head, and a row for each image that was compared with the reference.
    ///
    /// # Errors
    /// None.
    pub fn csv(&self) -> Result<Vec<u8>> {
        let reference = letter(self.reference).to_string();
        let row = |(k, entry, comparison): (usize, &Entry, &Comparison)| {
            let mut row = vec![
                ("image".to_owned(), letter(k).to_string()),
                ("name".to_owned(), entry.name.clone()),
                ("description".to_owned(), entry.description.clone()),
                ("reference".to_owned(), reference.clone()),
            ];
            flatten("", &json!(comparison), &mut row);
            row
        };
        let rows: Vec<Vec<(String, String)>> = self.judged().map(row).collect();
        let wrong = |e: String| Error::CheckFailed(format!("cannot express the result as CSV: {e}"));
        let mut csv = csv::Writer::from_writer(Vec::new());
        let head = || rows.first().into_iter().flatten().map(|(name, _)| name);
        csv.write_record(head()).map_err(|e| wrong(e.to_string()))?;
        for row in &rows {
            let cell = |name: &String| row.iter().find(|(n, _)| n == name).map_or("", |(_, value)| value.as_str());
            csv.write_record(head().map(cell)).map_err(|e| wrong(e.to_string()))?;
        }
        csv.into_inner().map_err(|e| wrong(e.to_string()))
    }

    /// The images and all metrics, as a JSON object.
    pub fn record(&self) -> Value {
        let images = self.entries.iter().zip(&self.comparisons).enumerate().map(|(k, (entry, comparison))| {
            json!({
                "letter": letter(k).to_string(),
                "name": entry.name,
                "description": entry.description,
                "choices": entry.choices,
                "chosen": entry.image.metadata(CHOSEN),
                "is_reference": k == self.reference,
                "metrics": comparison,
            })
        });
        let size = [self.entries[0].image.width, self.entries[0].image.height];
        json!({ "size": size, "reference": letter(self.reference).to_string(), "images": images.collect::<Vec<_>>() })
    }
}

/// The values of an object as columns: those of objects within it have a dot in their names.
fn flatten(name: &str, value: &Value, row: &mut Vec<(String, String)>) {
    let text = |value: &Value| match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    match value {
        Value::Object(all) => all.iter().for_each(|(key, value)| {
            flatten(&if name.is_empty() { key.clone() } else { format!("{name}.{key}") }, value, row);
        }),
        Value::Array(all) => row.push((name.to_owned(), all.iter().map(text).collect::<Vec<_>>().join(" "))),
        value => row.push((name.to_owned(), text(value))),
    }
}
