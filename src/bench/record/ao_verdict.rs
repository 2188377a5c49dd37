//! What the numbers of a view say about the preset `balanced` beside the pipeline of the reference work.

use super::ao::{EqualTime, StillRecord, TechniqueRecord, Verdict, ViewRecord};

/// Preset that is compared.
pub const OURS: &str = "balanced";
/// Preset it is compared with.
pub const THEIRS: &str = "larsen";

impl Verdict {
    /// Greatest share of their rays that is aimed at.
    pub const RAYS_AIM: f64 = 0.1;
    /// Greatest share of their error at equal time.
    pub const EQUAL_TIME_AIM: f64 = 1.0 / 3.0;

    /// Of what was measured in a view; what needs measurements of its own (`equal_time`) is given.
    pub fn of(view: &ViewRecord, equal_time: Option<EqualTime>) -> Self {
        let find = |name: &str| view.results.iter().find(|r| r.preset == name);
        let filter_raises = view.results.iter().filter(|r| raises(r)).map(|r| r.preset.clone()).collect();
        let mut out = Self { equal_time, filter_raises, ..Default::default() };
        let (Some(ours), Some(theirs)) = (find(OURS), find(THEIRS)) else { return out };
        let ratio = |a: f64, b: f64| (b > 0.0).then(|| a / b);
        if let (Some(a), Some(b)) = (&ours.still, &theirs.still) {
            out.rays_ratio = ratio(a.cost.rays, b.cost.rays);
            out.rays_ratio_with_camera = ratio(a.cost.all_rays(), b.cost.all_rays());
            out.rays_ratio_moving = ratio(a.moving_cost.all_rays(), b.moving_cost.all_rays());
            if let (Some(x), Some(y)) = (a.settled(), b.settled()) {
                out.rmse_ratio = ratio(x.errors.rmse_corrected, y.errors.rmse_corrected);
                out.reach(a, y.errors.rmse, b.cost.rays);
            }
        }
        if let (Some(a), Some(b)) = (&ours.moving, &theirs.moving) {
            out.moving_rmse_ratio = ratio(a.errors.rmse_corrected, b.errors.rmse_corrected);
        }
        out
    }

    fn reach(&mut self, ours: &StillRecord, their_rmse: f64, their_rays: f64) {
        let Some(k) = ours.rmse.iter().position(|e| *e <= their_rmse) else { return };
        self.frames_to_reach = Some(k as u32 + 1);
        self.rays_to_reach = ours.rays.get(k).copied();
        self.rays_to_reach_ratio = self.rays_to_reach.filter(|_| their_rays > 0.0).map(|r| r as f64 / their_rays);
    }
}

/// Does its filter raise the settled error?
fn raises(r: &TechniqueRecord) -> bool {
    let settled = r.still.as_ref().and_then(StillRecord::settled);
    settled.and_then(|p| Some(p.errors.rmse > p.unfiltered?.rmse)).unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::ao::{ErrorPoint, ImageErrors};
    use crate::bench::record::cost::FrameCost;

    fn result(preset: &str, rays: f64, camera_rays: f64, rmse: &[f64], unfiltered: f64) -> TechniqueRecord {
        let cost = |camera_rays| FrameCost { rays, camera_rays, ..Default::default() };
        let errors = |rmse| ImageErrors { rmse, rmse_corrected: rmse, ..Default::default() };
        let last =
            ErrorPoint { errors: errors(rmse[rmse.len() - 1]), unfiltered: Some(errors(unfiltered)), ..Default::default() };
        let still = StillRecord {
            cost: cost(camera_rays),
            moving_cost: cost(100.0),
            curve: vec![last],
            rmse: rmse.to_vec(),
            rays: (1..=rmse.len() as u64).map(|k| k * rays as u64).collect(),
        };
        TechniqueRecord { preset: preset.into(), still: Some(still), ..Default::default() }
    }

    #[test]
    fn ratios_to_the_reference_work() {
        let ours = result("balanced", 100.0, 0.0, &[0.3, 0.05, 0.02, 0.01], 0.02);
        let theirs = result("larsen", 1600.0, 100.0, &[0.05, 0.04], 0.03);
        let view = ViewRecord { results: vec![ours, theirs], ..Default::default() };
        let v = Verdict::of(&view, None);
        assert_eq!(v.rays_ratio, Some(1.0 / 16.0));
        assert_eq!(v.rays_ratio_with_camera, Some(1.0 / 17.0));
        assert_eq!(v.rays_ratio_moving, Some(2.0 / 17.0));
        assert_eq!(v.rmse_ratio, Some(0.25));
        assert_eq!((v.frames_to_reach, v.rays_to_reach), (Some(3), Some(300)));
        assert_eq!(v.rays_to_reach_ratio, Some(300.0 / 1600.0));
        // theirs is worse with its box than without
        assert_eq!(v.filter_raises, ["larsen"]);
    }

    #[test]
    fn nothing_is_said_of_what_was_not_measured() {
        let view = ViewRecord { results: vec![result("balanced", 1.0, 0.0, &[0.1], 0.2)], ..Default::default() };
        assert_eq!(Verdict::of(&view, None), Verdict::default());
    }
}
