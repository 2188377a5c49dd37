//! Tables, for the terminal and for pages.

/// A part of what a benchmark says.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A line of its own; an empty one is a gap in the terminal.
    Line(String),
    /// A table whose first row has the titles, with so many columns to the left and the others to the right.
    Table {
        /// What it shows; pages have it above the table, the terminal does not.
        title: &'static str,
        /// All rows.
        rows: Vec<Vec<String>>,
        /// Columns to the left.
        left: usize,
    },
}

impl Block {
    /// A line.
    pub fn line(text: impl Into<String>) -> Self {
        Self::Line(text.into())
    }

    /// A gap.
    pub fn gap() -> Self {
        Self::Line(String::new())
    }
}

/// Blocks as lines of text.
pub fn lines(blocks: &[Block]) -> Vec<String> {
    let of = |block: &Block| match block {
        Block::Line(text) => vec![text.clone()],
        Block::Table { rows, left, .. } => indented(rows, *left).collect(),
    };
    blocks.iter().flat_map(of).collect()
}

/// Lines of a table: the first `left` columns to the left, the others to the right.
fn align(rows: &[Vec<String>], left: usize) -> Vec<String> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width: Vec<usize> =
        (0..columns).map(|c| rows.iter().filter_map(|r| r.get(c)).map(|t| t.chars().count()).max().unwrap_or(0)).collect();
    let cell = |(c, text): (usize, &String)| {
        let w = width[c];
        if c < left { format!("{text:w$}") } else { format!("{text:>w$}") }
    };
    rows.iter().map(|r| r.iter().enumerate().map(cell).collect::<Vec<_>>().join("  ").trim_end().to_owned()).collect()
}

/// The same, two spaces to the right.
fn indented(rows: &[Vec<String>], left: usize) -> impl Iterator<Item = String> {
    align(rows, left).into_iter().map(|line| format!("  {line}"))
}

/// A row of column titles.
pub fn header(titles: &[&str]) -> Vec<String> {
    titles.iter().map(|t| (*t).to_owned()).collect()
}

/// What is known, or a dash.
pub fn optional<T>(x: Option<T>, show: impl Fn(T) -> String) -> String {
    x.map_or_else(|| "-".to_owned(), show)
}

/// Three significant digits; no more than are before the point.
pub fn number(x: f64) -> String {
    match x {
        x if x >= 100.0 => format!("{x:.0}"),
        x if x >= 10.0 => format!("{x:.1}"),
        x => format!("{x:.2}"),
    }
}

/// With separators between thousands.
pub fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (k, c) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let row = |a: &str, b: &str| vec![a.to_owned(), b.to_owned()];
        assert_eq!(align(&[row("name", "n"), row("a", "1000")], 1), ["name     n", "a     1000"]);
    }

    #[test]
    fn thousands_are_apart() {
        assert_eq!([0, 999, 1000, 25_000_000].map(thousands), ["0", "999", "1,000", "25,000,000"]);
    }
}
