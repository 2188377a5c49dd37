//! The statements of a `.brhan` file: `Key name[values] name[values] ...`, one a line, `#` starts a
//! comment.

use glam::{DVec3, Vec3};

use crate::scene::load::text;

/// One line: a key with its own values (`SaveIntervals[4]`) and named values.
#[derive(Debug)]
pub(super) struct Statement<'a> {
    /// Number of the line, from 1.
    pub line: usize,
    pub key: &'a str,
    /// Text in brackets right after the key.
    own: Option<&'a str>,
    fields: Vec<(&'a str, &'a str)>,
    /// Fields that the loader has read, to report unknown ones.
    seen: Vec<&'static str>,
}

/// The statements of a file.
///
/// # Errors
/// Line and what is wrong with it.
pub(super) fn statements(source: &str) -> Result<Vec<Statement<'_>>, String> {
    let mut all = Vec::new();
    for (number, line) in text::lines(source).enumerate() {
        if let Some(s) = statement(line, number + 1).map_err(|e| format!("line {}: {e}", number + 1))? {
            all.push(s);
        }
    }
    Ok(all)
}

fn statement(line: &str, number: usize) -> Result<Option<Statement<'_>>, String> {
    let mut rest = text::trim(line);
    let mut statement: Option<Statement> = None;
    while !rest.is_empty() && !rest.starts_with('#') {
        let end = rest.find(|c: char| c.is_whitespace() || c == '[' || c == '#').unwrap_or(rest.len());
        let word = &rest[..end];
        rest = rest[end..].trim_start();
        let mut values = None;
        if let Some(inside) = rest.strip_prefix('[') {
            let close = inside.find(']').ok_or_else(|| format!("`{word}[` is not closed"))?;
            values = Some(inside[..close].trim());
            rest = inside[close + 1..].trim_start();
        }
        if word.is_empty() {
            return Err("values in brackets without a name".to_owned());
        }
        match (&mut statement, values) {
            (None, own) => {
                statement = Some(Statement { line: number, key: word, own, fields: Vec::new(), seen: Vec::new() })
            }
            (Some(s), Some(values)) => s.fields.push((word, values)),
            (Some(_), None) => return Err(format!("`{word}` has no values in brackets")),
        }
    }
    Ok(statement)
}

impl<'a> Statement<'a> {
    fn error(&self, text: impl std::fmt::Display) -> String {
        format!("line {}: {}: {text}", self.line, self.key)
    }

    /// The values right after the key.
    pub(super) fn own(&self) -> Result<&'a str, String> {
        self.own.ok_or_else(|| self.error("needs a value in brackets"))
    }

    /// The text of a field.
    pub(super) fn text(&mut self, name: &'static str) -> Option<&'a str> {
        self.seen.push(name);
        self.fields.iter().find(|(n, _)| *n == name).map(|f| f.1)
    }

    /// The text of a required field.
    pub(super) fn need(&mut self, name: &'static str) -> Result<&'a str, String> {
        self.text(name).filter(|t| !t.is_empty()).ok_or_else(|| self.error(format!("{name}[] is missing")))
    }

    /// A field of `N` finite numbers.
    pub(super) fn numbers<const N: usize>(&mut self, name: &'static str) -> Result<Option<[f64; N]>, String> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let values: Option<Vec<f64>> =
            text.split_whitespace().map(|w| w.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        match values.and_then(|v| <[f64; N]>::try_from(v).ok()) {
            Some(values) => Ok(Some(values)),
            None => {
                let what = if N == 1 { "one number" } else { "three numbers" };
                Err(self.error(format!("{name}[{text}]: {what} expected")))
            }
        }
    }

    /// A field of one number.
    pub(super) fn number(&mut self, name: &'static str) -> Result<Option<f64>, String> {
        Ok(self.numbers::<1>(name)?.map(|[x]| x))
    }

    /// A field of three numbers.
    pub(super) fn vector(&mut self, name: &'static str) -> Result<Option<DVec3>, String> {
        Ok(self.numbers::<3>(name)?.map(DVec3::from))
    }

    /// A field of three numbers that are a colour.
    pub(super) fn color(&mut self, name: &'static str) -> Result<Option<Vec3>, String> {
        Ok(self.vector(name)?.map(|v| v.as_vec3()))
    }

    /// A field that is a whole number from `min` to a million.
    pub(super) fn count(&mut self, name: &'static str, min: u32) -> Result<Option<u32>, String> {
        let Some(x) = self.number(name)? else { return Ok(None) };
        self.whole(x, min).map(Some).map_err(|e| self.error(format!("{name}[{x}]: {e}")))
    }

    /// The values right after the key as whole numbers above zero.
    pub(super) fn own_counts(&self) -> Result<Vec<u32>, String> {
        let number =
            |w: &str| w.parse::<f64>().map_err(|_| format!("`{w}` is not a number")).and_then(|x| self.whole(x, 1));
        self.own()?.split_whitespace().map(|w| number(w).map_err(|e| self.error(e))).collect()
    }

    fn whole(&self, x: f64, min: u32) -> Result<u32, String> {
        if x.fract() == 0.0 && x >= f64::from(min) && x <= 1e6 {
            Ok(x as u32)
        } else {
            Err(format!("a whole number from {min} to 1000000 expected"))
        }
    }

    /// Fails for fields that the loader has not read.
    pub(super) fn done(&self) -> Result<(), String> {
        match self.fields.iter().find(|(n, _)| !self.seen.contains(n)) {
            Some((name, _)) => Err(self.error(format!("unknown field `{name}` ({} are known)", self.seen.join(", ")))),
            None => Ok(()),
        }
    }
}
