//! Benchmarks as plots: a series a contestant, a panel a scene, a stream of rays, or a number that is varied.
//!
//! `ao`, `frames`, `path` and `rays` say what is shown of a record, as data (`panel`); `picture` draws it as PNG or SVG, on logarithmic axes (`axis`), with labels that
//! keep clear of each other (`report::labels`). What is quicker and more exact than others is found by `pareto`.

pub mod ao;
pub mod axis;
mod draw;
pub mod frames;
mod layout;
pub mod panel;
mod pareto;
pub mod path;
pub mod picture;
pub mod rays;

use self::panel::Plot;
use crate::bench::record::HostInfo;
use crate::bench::record::saved::SavedRecord;
use crate::bench::report::ReportedRecord;

/// A record as a plot.
fn of(record: &SavedRecord) -> Plot {
    match record {
        SavedRecord::Rays(r) => rays::plot(r),
        SavedRecord::Ao(r) => ao::plot(r),
        SavedRecord::Path(r) => path::plot(r),
        SavedRecord::Frames(r) => frames::plot(r),
    }
}

/// Records in one plot: their groups of panels one after the other.
pub fn of_all(records: &[ReportedRecord]) -> Plot {
    let mut plots: Vec<Plot> = records.iter().map(|r| of(&r.record)).collect();
    if plots.len() == 1 {
        return plots.remove(0);
    }
    let mut hosts: Vec<String> = records.iter().map(|r| host_line(r.record.host())).collect();
    hosts.dedup();
    let groups = plots.into_iter().flat_map(|p| p.groups).collect();
    Plot { title: "Benchmarks of skylit".into(), subtitle: hosts.join("; "), groups }
}

/// A host, as plots and pages say it.
pub fn host_line(host: &HostInfo) -> String {
    let cpu = if host.cpu.is_empty() { String::new() } else { format!("{}, ", host.cpu) };
    format!("{} ({}), {cpu}{} threads", host.device, host.driver, host.threads)
}
