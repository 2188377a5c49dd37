//! HTML reports: a page of sections, which hold text, tables, charts and images to compare.
//!
//! [`write()`] makes a folder that is opened from disk, without network and server: `index.html`,
//! with styles and scripts inside, and pixels in `data/*.js`, which the page loads on demand.
//!
//! ```no_run
//! use skylit::report::{self, Page, Part, Row, Section, Table};
//!
//! let table = Table::new(&["frame", "RMSE"]).row(Row::new([("stairs").into(), 0.0123.into()]));
//! let page = Page {
//!     title: "Frames".into(),
//!     sections: vec![Section::new("All frames", vec![Part::Text("One frame was rendered.".into()), Part::Table(table)])],
//!     ..Page::default()
//! };
//! let index = report::write("report".as_ref(), &page)?;
//! println!("{}", report::address(&index));
//! # Ok::<(), skylit::Error>(())
//! ```

mod chart;
pub mod comparison;
mod images;
pub mod labels;
mod layout;
mod page;
pub mod pareto;
mod svg;
mod table;

pub use chart::{Axis, Chart, Mark, Point, Scale, Series};
pub use images::{ComparedImage, ImageComparison};
pub use page::{address, write};
pub use svg::{check_svg_name, write_svg};
pub use table::{Cell, Column, Row, Status, Table, format_number, thousands};

#[derive(Clone, Debug, Default)]
pub struct Page {
    pub title: String,
    /// A sentence or two under the title.
    pub summary: String,
    /// The command that made it, as it was typed; may be empty.
    pub command: String,
    /// Facts about all of it, name and value: device, driver, version.
    pub facts: Vec<(String, String)>,
    /// A sentence for each thing that must not be overlooked.
    pub warnings: Vec<String>,
    /// The sections, listed at the page's start where there are more than two.
    pub sections: Vec<Section>,
}

#[derive(Clone, Debug, Default)]
pub struct Section {
    pub title: String,
    /// The outcome of a check that the section is about, shown beside the title.
    pub status: Option<Status>,
    pub parts: Vec<Part>,
    /// Shows only the title until the reader opens it.
    pub folded: bool,
}

impl Section {
    /// A section that is open.
    pub fn new(title: impl Into<String>, parts: Vec<Part>) -> Self {
        Self { title: title.into(), parts, ..Self::default() }
    }
}

#[derive(Clone, Debug)]
pub enum Part {
    Text(String),
    Table(Table),
    Chart(Chart),
    /// Images side by side, with their differences.
    Images(ImageComparison),
}
