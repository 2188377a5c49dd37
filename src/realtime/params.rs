//! What the passes of a frame share: mirrors shaders/common/frame.glsl.

use bytemuck::{Pod, Zeroable};

use crate::tracer::Moved;

/// `FrameParams` of shaders/common/frame.glsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct FrameParams {
    /// Three rows, relative to the scene's origin.
    pub camera_to_world: [[f32; 4]; 3],
    /// Its inverse.
    pub world_to_camera: [[f32; 4]; 3],
    /// Of the previous frame.
    pub previous_world_to_camera: [[f32; 4]; 3],
    /// Half extents of the view.
    pub view: [f32; 2],
    /// Of the previous frame.
    pub previous_view: [f32; 2],
    /// 1: parallel rays.
    pub orthographic: u32,
    /// Of the previous frame.
    pub previous_orthographic: u32,
    /// Pixels.
    pub size: [u32; 2],
    /// Tiles in a row.
    pub tiles_x: u32,
    /// Counts up.
    pub frame: u32,
    /// Of the sequence.
    pub seed: u32,
    /// Of a pixel that is sampled.
    pub rays_per_pixel: u32,
    /// `Resolution`.
    pub pattern: u32,
    /// `Sequence`.
    pub sequence: u32,
    /// World units.
    pub reach: f32,
    /// Exponent per world unit.
    pub falloff_log2: f32,
    /// Of a history.
    pub most_samples: f32,
    /// Pixels' footprints.
    pub depth_tolerance: f32,
    /// Cosine.
    pub normal_tolerance: f32,
    /// 1: nothing has moved since the previous frame.
    pub still: u32,
    /// 1: the histories hold something.
    pub has_history: u32,
    /// Records at `moved`.
    pub moved_count: u32,
    /// Standard errors.
    pub clamp_width: f32,
    /// Factor.
    pub moved_weight: f32,
    /// Of a filtered pixel.
    pub filter_samples: f32,
    /// 1: nothing moves, and pixels with a full history rest.
    pub rest: u32,
    /// Of gtao.
    pub slices: u32,
    /// Of gtao, on each side.
    pub steps: u32,
    /// The variance of the mean of n samples falls as n to the power of minus 1 and this.
    pub evenness: f32,
    /// Of a pixel in a frame with a budget.
    pub most_rays: u32,
    /// Surfaces.
    pub surface: u64,
    /// Axes of the hemispheres, or 0.
    pub axes: u64,
    /// For edge tests.
    pub guide: u64,
    /// Of the previous frame.
    pub previous_guide: u64,
    /// Estimates.
    pub history: u64,
    /// Of the previous frame.
    pub previous_history: u64,
    /// This frame's samples.
    pub current: u64,
    /// Samples of a launch.
    pub samples: u64,
    /// Where surfaces were, or 0.
    pub previous_position: u64,
    /// Accessibility.
    pub result: u64,
    /// What has moved.
    pub moved: u64,
    /// Number of occlusion rays.
    pub ray_count: u64,
    /// Mean direction of this frame's samples, or 0.
    pub current_bent: u64,
    /// Bent normals of the previous frame, or 0.
    pub previous_bent_history: u64,
    /// Of this one: history, two between the steps of the filter, filtered; or 0.
    pub bent: [u64; 4],
    /// Rays of each pixel, or 0: all have as many.
    pub plan: u64,
    /// Those rays, or 0.
    pub list: u64,
    /// Rays that pixels have had, or 0.
    pub taken: u64,
    /// Deviations and samples, or 0.
    pub desired_samples: u64,
    /// Sums of desired samples, or 0.
    pub budget_sums: u64,
}

/// `MovedRecord` of shaders/temporal.glsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MovedRecord {
    lower: [f32; 3],
    share: f32,
    upper: [f32; 3],
    reserved: f32,
}

/// Boxes that a frame's passes look at, each for every pixel.
pub const MAX_MOVED: usize = 16;

impl MovedRecord {
    /// Of what an update moved: the largest each by itself, the others in one box.
    pub fn of(moved: &[Moved]) -> Vec<Self> {
        let mut all: Vec<&Moved> = moved.iter().filter(|m| m.share > 0.0).collect();
        let size = |m: &Moved| m.share * m.bounds.half_area();
        all.sort_by(|a, b| size(b).total_cmp(&size(a)));
        let single = if all.len() > MAX_MOVED { MAX_MOVED - 1 } else { all.len() };
        let record = |m: &Moved| Self {
            lower: m.bounds.min.to_array(),
            share: m.share.min(1.0),
            upper: m.bounds.max.to_array(),
            reserved: 0.0,
        };
        let mut out: Vec<_> = all[..single].iter().map(|m| record(m)).collect();
        let rest = all[single..].iter().fold(None, |sum: Option<Moved>, m| match sum {
            None => Some(**m),
            Some(s) => Some(Moved { bounds: s.bounds.union(m.bounds), share: s.share.max(m.share) }),
        });
        out.extend(rest.as_ref().map(record));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Aabb;
    use glam::Vec3;

    #[test]
    fn what_moves_is_never_left_out() {
        let moved: Vec<_> = (0..40)
            .map(|k| {
                let at = Vec3::splat(k as f32);
                Moved { bounds: Aabb { min: at, max: at + 1.0 + k as f32 * 0.1 }, share: 0.5 }
            })
            .collect();
        let records = MovedRecord::of(&moved);
        assert_eq!(records.len(), MAX_MOVED);
        for m in &moved {
            let inside = |r: &MovedRecord| {
                (0..3).all(|k| r.lower[k] <= m.bounds.min[k] && m.bounds.max[k] <= r.upper[k]) && r.share >= m.share
            };
            assert!(records.iter().any(inside), "{m:?}");
        }
        assert_eq!(MovedRecord::of(&moved[..3]).len(), 3);
        assert!(MovedRecord::of(&[Moved { share: 0.0, ..moved[0] }]).is_empty());
    }
}
