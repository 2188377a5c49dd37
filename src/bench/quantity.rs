//! Quantities that benchmarks measure, each with its unit and which values are better.

use serde::{Deserialize, Serialize};

/// Which values of a quantity are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    Less,
    More,
    /// Neither: it is not compared with a baseline.
    Neither,
}

/// A quantity with its unit.
#[derive(Clone, Copy, Debug)]
pub struct Quantity<'a> {
    pub name: &'a str,
    pub unit: &'a str,
    pub better: Better,
}

/// A quantity of which less is better.
const fn less<'a>(name: &'a str, unit: &'a str) -> Quantity<'a> {
    Quantity { name, unit, better: Better::Less }
}

/// A quantity of which more is better.
const fn more<'a>(name: &'a str, unit: &'a str) -> Quantity<'a> {
    Quantity { name, unit, better: Better::More }
}

/// A quantity that is not compared with a baseline.
pub const fn plain<'a>(name: &'a str, unit: &'a str) -> Quantity<'a> {
    Quantity { name, unit, better: Better::Neither }
}

impl Quantity<'_> {
    /// The quantity without a comparison with baselines.
    pub const fn not_compared(self) -> Self {
        Self { better: Better::Neither, ..self }
    }
}

pub const FRAME_TIME: Quantity = less("time", "ms");
pub const IMAGE_TIME: Quantity = less("time", "s");
/// Time to bring a structure up to date.
pub const UPDATE_TIME: Quantity = less("update", "ms");
/// Root mean squared error, the reference's own included.
pub const RMSE: Quantity = less("RMSE", "");
/// Root mean squared error without the reference's.
pub const CORRECTED: Quantity = plain("corrected RMSE", "");
/// Root mean squared error of plain accumulation in the same time.
pub const PLAIN_RMSE: Quantity = plain("plain RMSE", "");
/// The same without the reference's.
pub const PLAIN_CORRECTED: Quantity = plain("corrected plain RMSE", "");
/// Error before the filter.
pub const UNFILTERED: Quantity = plain("unfiltered RMSE", "");
pub const RATE: Quantity = more("rate", "Mrays/s");
pub const RAYS: Quantity = plain("rays", "");
pub const CAMERA_RAYS: Quantity = plain("camera rays", "");
/// Differences of consecutive frames.
pub const FLICKER: Quantity = less("flicker", "");
pub const BYTES: Quantity = less("bytes a primitive", "");
/// Cost of a ray by its visits: 2.0 an inner node, 1.2 a primitive.
pub const RAY_COST: Quantity = less("cost", "");
pub const NODES: Quantity = less("nodes a ray", "");
