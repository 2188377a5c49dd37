//! The laboratory of hierarchies: builders for rays of a known distribution (Falcone, "Ray
//! distribution aware heuristics for bounding volume hierarchies construction", 2024), local trees
//! of the places that such rays come from, and an analysis of finished trees in counts. What is
//! here runs on the host and for nobody who does not ask for it; docs/design/bvh.md has what it
//! found.

pub mod analysis;
pub mod body;
pub mod budget;
pub mod build;
pub mod builder;
pub mod cells;
pub mod heuristic;
pub mod hull;
pub mod influence;
pub mod local;
pub mod projection;
pub mod region;
pub mod streams;
pub mod traverse;

pub use body::{Body, LabRay, Shape};
pub use builder::Builder;
pub use heuristic::{AxisRule, CostConstants, CostRule, FacingRule, Heuristic, HeuristicChoice, StopRule};
pub use projection::{RayDistribution, View};
pub use region::Region;
pub use traverse::{Hierarchy, LabHit, Query, Visits};
