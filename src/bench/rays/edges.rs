//! `skylit bench rays --edges`: rays at shared edges and vertices of closed meshes, through all
//! tracers. None may get through, and hits are held against the double-precision oracle.

use super::args::RaySession;
use super::contestant::Contestant;
use crate::accel::flatten::FlatScene;
use crate::bench::peers::process::PeerError;
use crate::bench::record::{Record, plain};
use crate::error::{Error, Result};
use crate::integrators::rays::Mode;
use crate::measure::parity::judge_closest;
use crate::measure::ray_sets::{hard_leak_scenes, leak_rays, leak_scenes};
use crate::oracle::rounding::Rounding;
use crate::oracle::{Oracle, OracleHit};
use crate::ray::{Hit, Ray};
use crate::scene::Scene;
use crate::terminal::interrupt;
use crate::tracer::TracerKind;

/// Seed of the rays.
const SEED: u32 = 7;
/// On a CPU, drivers' own tracers get one in this many rays.
const SLOW: usize = 16;
/// Examples of answers that nothing explains, by contestant.
const MAX_EXAMPLES: usize = 4;
/// Levels of the round body and segments of the disk, of many triangles each.
const HARD: (u32, u32) = (7, 1000);

/// Scene and part of these results in the record.
const SCENE: &str = "closed meshes";
const PART: &str = "rays at edges";

/// The fates of a contestant's rays at shared edges and vertices of closed meshes: misses of any
/// and of closest hits; closest hits that are the oracle's, that rounding allows, and neither.
const COUNTS: [&str; 7] = ["meshes", "rays", "leaks, any", "leaks, closest", "agree", "ties", "unexplained"];

/// Counts of a contestant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EdgeCounts {
    contestant: String,
    counts: [u64; 7],
    /// Whether leaks and unexplained answers are a failure: those of the compute tracer are.
    is_watertight: bool,
    /// The first of the unexplained.
    examples: Vec<String>,
}

impl EdgeCounts {
    fn fails(&self) -> bool {
        let [_, _, any, closest, _, _, unexplained] = self.counts;
        self.is_watertight && any + closest + unexplained > 0
    }

    fn add_to(&self, record: &mut Record) {
        let mut row = record.row(SCENE, PART, &self.contestant);
        for (name, count) in COUNTS.into_iter().zip(self.counts) {
            row.exact(plain(name, ""), count as f64);
        }
    }
}

impl RaySession<'_> {
    /// Sends the rays, and adds what became of them to `found` and to the record.
    pub(super) fn edges(&mut self, found: &mut Vec<EdgeCounts>) -> Result<()> {
        let mut scenes = leak_scenes();
        scenes.extend(hard_leak_scenes(HARD.0, HARD.1));
        let each = (self.args.edge_rays() / scenes.len()).max(1);
        self.expect_jobs(scenes.len());
        let sent = scenes
            .iter()
            .try_for_each(|(name, scene)| self.job(name, |session| session.edges_of(name, scene, each, found)));
        // what there is, also where it failed
        found.iter().for_each(|counts| counts.add_to(&mut self.record));
        sent.and(self.show_scene(SCENE))
    }

    fn edges_of(&mut self, name: &str, scene: &Scene, count: usize, found: &mut Vec<EdgeCounts>) -> Result<()> {
        let flat = FlatScene::new(scene);
        let contestants = self.contestants(name, &flat)?;
        self.phase(format!("{name}: rays and what they meet in double precision"));
        let oracle = Oracle::new(scene, scene.origin());
        let rays = leak_rays(&oracle, count, SEED);
        let truth = oracle.trace_closest(&rays);
        // double precision is no exact arithmetic: at a vertex it may miss, too
        let missed = truth.iter().filter(|h| !h.is_hit()).count();
        if missed > 0 {
            self.note(format!("{name}: the oracle itself misses {missed} of {} rays", rays.len()));
        }
        for (done, contestant) in contestants.iter().enumerate() {
            self.phase(format!("{name}: '{}'", contestant.name));
            let counts = self.edges_by(contestant, &oracle, &rays, &truth);
            let counts = self.unless_peer_fails(&format!("{name}: '{}' left out", contestant.name), counts)?;
            counts.into_iter().for_each(|counts| add_counts(found, counts));
            interrupt::check()?;
            self.advance((done + 1) as f64 / contestants.len() as f64);
        }
        Ok(())
    }

    fn edges_by(
        &mut self,
        contestant: &Contestant,
        oracle: &Oracle,
        rays: &[Ray],
        truth: &[OracleHit],
    ) -> Result<EdgeCounts, PeerError> {
        let own = contestant.tracer();
        let is_watertight = own.is_some_and(|t| t.kind() == TracerKind::Compute);
        let is_slow = own.is_some() && !is_watertight && self.device.info.is_cpu();
        let count = if is_slow { rays.len().div_ceil(SLOW) } else { rays.len() };
        let (rays, truth) = (&rays[..count], &truth[..count]);
        let missed = |hits: &[Hit]| hits.iter().filter(|h| !h.is_hit()).count() as u64;
        let any = contestant.hits(&mut self.peers, rays, Mode::Any, &mut self.control)?;
        let closest = contestant.hits(&mut self.peers, rays, Mode::Closest, &mut self.control)?;
        let report = judge_closest(oracle, rays, &closest, truth, Rounding::default());
        let examples = report.to_string().lines().skip(1).take(MAX_EXAMPLES).map(|l| l.trim().to_owned()).collect();
        let counts = [1, report.rays, missed(&any), missed(&closest), report.agree, report.ties, report.unexplained];
        Ok(EdgeCounts { contestant: contestant.name.clone(), counts, is_watertight, examples })
    }
}

/// Adds the counts of a mesh to those that the contestant has already.
fn add_counts(all: &mut Vec<EdgeCounts>, found: EdgeCounts) {
    match all.iter_mut().find(|e| e.contestant == found.contestant) {
        None => all.push(found),
        Some(sum) => {
            sum.counts.iter_mut().zip(found.counts).for_each(|(sum, count)| *sum += count);
            sum.examples.extend(found.examples);
            sum.examples.truncate(MAX_EXAMPLES);
        }
    }
}

/// Leaks of the compute tracer, and answers of it that nothing explains, are a failure.
pub(super) fn verdict(edges: &[EdgeCounts]) -> Result<()> {
    match edges.iter().find(|e| e.fails()) {
        None => Ok(()),
        Some(e) => Err(Error::CheckFailed(format!(
            "'{}': of {} rays at edges of closed meshes {} leave them asked for any hit, {} asked for the closest, and {} meet what rounding does not explain ({})",
            e.contestant,
            e.counts[1],
            e.counts[2],
            e.counts[3],
            e.counts[6],
            e.examples.first().map_or("no example", String::as_str)
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_fails_at_edges() {
        let counts = |is_watertight, leaks, unexplained| EdgeCounts {
            is_watertight,
            counts: [1, 9, leaks, 0, 0, 0, unexplained],
            ..EdgeCounts::default()
        };
        assert!(verdict(&[counts(true, 0, 0), counts(false, 7, 3)]).is_ok());
        assert!(counts(true, 1, 0).fails() && verdict(&[counts(true, 0, 1)]).is_err());
        let mut all = vec![counts(true, 1, 0)];
        add_counts(&mut all, counts(true, 2, 5));
        assert_eq!((all.len(), all[0].counts), (1, [2, 18, 3, 0, 0, 0, 5]));
    }
}
