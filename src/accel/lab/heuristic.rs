//! The rules of the top-down builder, each a small type: what a split costs, along which axes
//! planes are tried, when a node becomes a leaf, and what happens where no plane is good.
//!
//! Falcone's two heuristics (2024) are a cost and a choice of axes: the projected area in place of
//! the surface area (PAH), and planes that the rays lie in before planes that they cross (SPFH).

use glam::DVec3;

use super::projection::RayDistribution;
use crate::settings::choices;

/// Probability of meeting a box that the builder reckons with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CostRule {
    /// By the surface area (SAH).
    #[default]
    SurfaceArea,
    /// By the area that the box projects along the rays (PAH). Where a node's projection is empty,
    /// which no ray of the distribution meets, its surface area decides.
    ProjectedArea,
}

/// Axes across which split planes are tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisRule {
    /// The longest axis of the node.
    Longest,
    /// All three, of which the cheapest plane is taken.
    All,
    /// Axes in the order in which their planes face away from the rays (SPFH).
    Facing(FacingRule),
}

/// When the search over axes that face away from the rays ends. The quality of an axis k is
/// (1 - |v_k| / (|v_x| + |v_y| + |v_z|))^2 for rays of direction v: 1 for planes that the rays lie
/// in. (Falcone's chapter 4 calls a high quotient good and his algorithm 5.1 a low one; his results
/// are those of the algorithm.) The ratio of a plane is (p_left + p_right) / p_node: 1 where
/// children do not overlap along the rays, 2 where both look as large as their parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacingRule {
    /// Ratio at which the search ends at once.
    pub excellent: f64,
    /// Ratio below which the best plane is taken at the end.
    pub acceptable: f64,
    /// Quality below which an axis is not tried.
    pub quality: f64,
    /// The longest axis by surface area is taken where no plane is acceptable. Without, it is the
    /// best plane that was found.
    pub falls_back: bool,
}

/// The values of Falcone's 256 runs.
impl Default for FacingRule {
    fn default() -> Self {
        Self { excellent: 0.9, acceptable: 1.3, quality: 0.4, falls_back: true }
    }
}

/// When a node becomes a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopRule {
    /// Primitives at or below which a node is a leaf.
    pub at_most: u32,
    /// Primitives at or below which a node is a leaf where no split is cheaper by the cost rule.
    /// As many as `at_most` or fewer switch this off.
    pub by_cost: u32,
}

/// Falcone's: leaves of two triangles in all of his runs.
impl Default for StopRule {
    fn default() -> Self {
        Self { at_most: 2, by_cost: 0 }
    }
}

/// Costs of a traversal step and a primitive test, in the unit of the tree's cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostConstants {
    /// Cost of the test of one child's box: an inner node has two.
    pub node: f64,
    /// Cost of the test of one primitive.
    pub primitive: f64,
}

impl CostConstants {
    /// The constants of Falcone's section 1.3.3, and of his measured costs.
    pub const FALCONE: Self = Self { node: 1.0, primitive: 1.2 };
    /// The constants of his section 5.1.2, which has them the other way round.
    pub const SWAPPED: Self = Self { node: 1.2, primitive: 1.0 };
}

/// A builder: rules, constants, and the rays that it is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heuristic {
    /// Cost of a split.
    pub cost: CostRule,
    /// Axes of the planes.
    pub axes: AxisRule,
    /// When to stop.
    pub stop: StopRule,
    /// Constants of the costs, where `stop` compares them.
    pub constants: CostConstants,
    /// Number of bins between which planes lie, 2 to [`Heuristic::MAX_BINS`].
    pub bins: usize,
    /// The rays that projected areas and facing planes are of.
    pub rays: RayDistribution,
}

choices! {
    /// A top-down builder of the laboratory.
    pub enum HeuristicChoice {
        /// Surface area, planes across the longest axis
        SahLongest = "sah-longest",
        /// Surface area, planes across all axes
        Sah = "sah",
        /// Surface area, planes along the rays first
        SahSpfh = "sah-spfh",
        /// Projected area, planes across the longest axis
        PahLongest = "pah-longest",
        /// Projected area, planes across all axes
        Pah = "pah",
        /// Projected area, planes along the rays first
        PahSpfh = "pah-spfh",
    }
}

impl HeuristicChoice {
    /// Whether it asks for the rays.
    pub fn needs_rays(self) -> bool {
        !matches!(self, Self::SahLongest | Self::Sah)
    }

    /// The builder for rays, with Falcone's constants.
    pub fn heuristic(self, rays: RayDistribution) -> Heuristic {
        let facing = AxisRule::Facing(FacingRule::default());
        let (cost, axes) = match self {
            Self::SahLongest => (CostRule::SurfaceArea, AxisRule::Longest),
            Self::Sah => (CostRule::SurfaceArea, AxisRule::All),
            Self::SahSpfh => (CostRule::SurfaceArea, facing),
            Self::PahLongest => (CostRule::ProjectedArea, AxisRule::Longest),
            Self::Pah => (CostRule::ProjectedArea, AxisRule::All),
            Self::PahSpfh => (CostRule::ProjectedArea, facing),
        };
        Heuristic { cost, axes, rays, ..Heuristic::default() }
    }
}

impl Default for Heuristic {
    fn default() -> Self {
        Self {
            cost: CostRule::SurfaceArea,
            axes: AxisRule::All,
            stop: StopRule::default(),
            constants: CostConstants::FALCONE,
            bins: 40,
            rays: RayDistribution::Uniform,
        }
    }
}

impl Heuristic {
    /// Greatest number of bins.
    pub const MAX_BINS: usize = 64;

    /// The measure that its cost rule reckons with.
    pub fn measured_rays(&self) -> RayDistribution {
        match self.cost {
            CostRule::SurfaceArea => RayDistribution::Uniform,
            CostRule::ProjectedArea => self.rays,
        }
    }

    /// The same rules for other rays.
    pub fn for_rays(self, rays: RayDistribution) -> Self {
        Self { rays, ..self }
    }
}

/// Axes and their quality for rays of a direction, the best first: how little planes across them
/// face the rays.
pub(super) fn facing_axes(direction: DVec3) -> [(usize, f64); 3] {
    let sum = direction.abs().element_sum();
    let quality = |a: usize| (1.0 - direction[a].abs() / sum).powi(2);
    let mut axes = [0, 1, 2].map(|a| (a, quality(a)));
    axes.sort_by(|a, b| b.1.total_cmp(&a.1));
    axes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_that_rays_lie_in_come_first() {
        let axes = facing_axes(DVec3::new(-1.0, 0.0, 0.0));
        assert_eq!(axes[2], (0, 0.0));
        assert_eq!([axes[0].1, axes[1].1], [1.0, 1.0]);
        let axes = facing_axes(DVec3::new(1.0, -3.0, 2.0));
        assert_eq!(axes.map(|a| a.0), [0, 2, 1]);
        assert!((axes[0].1 - (5.0f64 / 6.0).powi(2)).abs() < 1e-15 && (axes[2].1 - 0.25).abs() < 1e-15);
    }
}
