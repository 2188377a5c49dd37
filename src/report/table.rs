//! Tables of a report.

use serde::Serialize;

/// A table. A reader sorts it by clicking on the title of a column.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Table {
    /// A title of a few words; may be empty.
    pub title: String,
    pub columns: Vec<Column>,
    /// The rows, each with a cell for every column.
    pub rows: Vec<Row>,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Column {
    pub title: String,
    /// The meaning of its numbers and their unit, shown over the title; may be empty.
    pub help: String,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    pub cells: Vec<Cell>,
    /// The part of the images that the row is about (x, y, width, height), behind a button.
    pub region: Option<[u32; 4]>,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Cell {
    pub text: String,
    /// The number to sort by, if it is one. Numbers are set to the right.
    pub value: Option<f64>,
    /// The outcome of a check.
    pub status: Option<Status>,
    /// Index of the section of the page to which the cell leads.
    pub section: Option<usize>,
    /// Explains the cell when a pointer rests on it; may be empty.
    pub help: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    Good,
    Bad,
}

impl Table {
    /// An empty table with columns of these titles.
    pub fn new(columns: &[&str]) -> Self {
        let columns = columns.iter().map(|c| Column { title: (*c).to_owned(), help: String::new() }).collect();
        Self { columns, ..Self::default() }
    }

    pub fn row(mut self, row: Row) -> Self {
        self.rows.push(row);
        self
    }

    /// The table as lines of text: the first column to the left, the others to the right.
    pub fn lines(&self) -> Vec<String> {
        let titles: Vec<&str> = self.columns.iter().map(|c| c.title.as_str()).collect();
        let rows: Vec<Vec<&str>> =
            self.rows.iter().map(|r| r.cells.iter().map(|c| c.text.as_str()).collect()).collect();
        let all: Vec<&Vec<&str>> = std::iter::once(&titles).chain(&rows).collect();
        let width =
            |c: usize| all.iter().filter_map(|row| row.get(c)).map(|text| text.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..titles.len()).map(width).collect();
        let cell = |(c, text): (usize, &&str)| {
            let w = widths.get(c).copied().unwrap_or(0);
            if c == 0 { format!("{text:w$}") } else { format!("{text:>w$}") }
        };
        let line =
            |row: &&Vec<&str>| row.iter().enumerate().map(cell).collect::<Vec<_>>().join("  ").trim_end().to_owned();
        all.iter().map(line).collect()
    }

    pub fn titled(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }
}

impl Row {
    pub fn new(cells: impl IntoIterator<Item = Cell>) -> Self {
        Self { cells: cells.into_iter().collect(), region: None }
    }

    /// The row with the part of the images that it is about.
    pub fn of_region(mut self, region: [u32; 4]) -> Self {
        self.region = Some(region);
        self
    }
}

impl Cell {
    /// A number that is shown as `text`.
    pub fn number(value: f64, text: impl Into<String>) -> Self {
        Self { text: text.into(), value: Some(value), ..Self::default() }
    }

    pub fn with_status(mut self, status: Status) -> Self {
        self.status = Some(status);
        self
    }

    /// The cell as a link to a section of the page, by its index.
    pub fn to_section(mut self, section: usize) -> Self {
        self.section = Some(section);
        self
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self { text, ..Self::default() }
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::number(value, format_number(value))
    }
}

/// A number with four significant digits: `0.01234`, `12.34`, `1.234e-7`, `12345`, `inf`, `NaN`.
pub fn format_number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { value.to_string() };
    }
    let scientific = format!("{value:.3e}");
    // of the rounded number: 0.09999999 has the digits of 0.1
    let exponent = scientific.split_once('e').and_then(|(_, e)| e.parse::<i32>().ok()).unwrap_or(0);
    match exponent {
        -4..=3 => format!("{value:.*}", (3 - exponent) as usize),
        4..=8 => format!("{value:.0}"),
        _ => scientific,
    }
}

/// A number with separators between thousands.
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
