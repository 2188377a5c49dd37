//! Parameters that the passes of a frame share: [`FrameParams`], and records of moved objects.

pub use crate::interface::records::frame::{FrameParams, MovedRecord};
use crate::tracer::MovedBounds;

/// Maximum number of boxes of moved objects, each of which is tested for every pixel.
pub const MAX_MOVED: usize = 16;

/// Records of the moved objects: one each for the largest, and one box around the others.
pub fn moved_records(moved: &[MovedBounds]) -> Vec<MovedRecord> {
    let mut all: Vec<&MovedBounds> = moved.iter().filter(|m| m.share > 0.0).collect();
    let size = |m: &MovedBounds| m.share * m.bounds.half_area();
    all.sort_by(|a, b| size(b).total_cmp(&size(a)));
    let single = if all.len() > MAX_MOVED { MAX_MOVED - 1 } else { all.len() };
    let record = |m: &MovedBounds| MovedRecord {
        lower: m.bounds.min.to_array(),
        share: m.share.min(1.0),
        upper: m.bounds.max.to_array(),
        reserved: 0.0,
    };
    let mut out: Vec<_> = all[..single].iter().map(|m| record(m)).collect();
    let rest = all[single..].iter().fold(None, |sum: Option<MovedBounds>, m| match sum {
        None => Some(**m),
        Some(s) => Some(MovedBounds { bounds: s.bounds.union(m.bounds), share: s.share.max(m.share) }),
    });
    out.extend(rest.as_ref().map(record));
    out
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
                MovedBounds { bounds: Aabb { min: at, max: at + 1.0 + k as f32 * 0.1 }, share: 0.5 }
            })
            .collect();
        let records = moved_records(&moved);
        assert_eq!(records.len(), MAX_MOVED);
        for m in &moved {
            let inside = |r: &MovedRecord| {
                (0..3).all(|k| r.lower[k] <= m.bounds.min[k] && m.bounds.max[k] <= r.upper[k]) && r.share >= m.share
            };
            assert!(records.iter().any(inside), "{m:?}");
        }
        assert_eq!(moved_records(&moved[..3]).len(), 3);
        assert!(moved_records(&[MovedBounds { share: 0.0, ..moved[0] }]).is_empty());
    }
}
