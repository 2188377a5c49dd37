//! Per-ray parity: does a single-precision tracer give the same hits as the double-precision
//! oracle?
//!
//! Each ray is sorted into one of three classes.
//!
//! - **agree**: both miss, or both name the same instance and primitive and the tracer's `t` lies
//!   within the error bound of [`crate::oracle::rounding`] around the true one.
//! - **tie**: the answers differ, but the tracer's is one that exact arithmetic gives for data
//!   displaced by no more than rounding. For a *closest hit*: the primitive it names is possibly
//!   hit at that `t`, and nothing is certainly hit before. For a *miss* (and "not occluded"):
//!   nothing is certainly hit. For "occluded": something is possibly hit. That covers coincident
//!   surfaces, shared edges and vertices, grazing rays, hits at `tmin` or `tmax`, and alpha at its
//!   cutoff.
//! - **unexplained**: anything else. A defect of a tracer, or of this test.
//!
//! A tie is allowed to miss a closed mesh at a shared edge; [`super::ray_sets::leak_rays`] is the
//! test that is not.

use crate::oracle::rounding::Rounding;
use crate::oracle::{Oracle, OracleHit, OracleRay};
use crate::ray::{Hit, Ray};
use rayon::prelude::*;

/// How many unexplained rays a report keeps.
pub const MAX_EXAMPLES: usize = 8;

/// Class of one ray; see the module's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayVerdict {
    /// Both gave the same answer.
    Agree,
    /// Another answer that is within rounding.
    Tie,
    /// Another answer, for this reason.
    Unexplained(&'static str),
}

/// An unexplained ray with both answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Example {
    /// Index of the ray.
    pub index: usize,
    /// The ray.
    pub ray: Ray,
    /// The answer under judgement; for any-hit streams `t` is 0 for "occluded" and infinite
    /// otherwise.
    pub answer: Hit,
    /// The answer it is compared with.
    pub reference: OracleHit,
    /// Why rounding does not explain the difference.
    pub reason: &'static str,
}

/// The result over a set of rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParityReport {
    /// Rays judged.
    pub rays: u64,
    /// Rays of these that met something according to the reference.
    pub hits: u64,
    /// Rays with the same answer.
    pub agree: u64,
    /// Rays with another answer that is within rounding.
    pub ties: u64,
    /// All other rays.
    pub unexplained: u64,
    /// Greatest `|dt| / t` of the rays that agree.
    pub worst_dt: f64,
    /// The first of the unexplained.
    pub examples: Vec<Example>,
}

impl ParityReport {
    /// Share of the rays that is unexplained; 0 for no rays.
    pub fn unexplained_fraction(&self) -> f64 {
        self.unexplained as f64 / self.rays.max(1) as f64
    }

    /// Adds another report's rays to this one.
    pub fn merge(mut self, other: ParityReport) -> ParityReport {
        self.rays += other.rays;
        self.hits += other.hits;
        self.agree += other.agree;
        self.ties += other.ties;
        self.unexplained += other.unexplained;
        self.worst_dt = self.worst_dt.max(other.worst_dt);
        self.examples.extend(other.examples);
        self.examples.truncate(MAX_EXAMPLES);
        self
    }
}

impl std::fmt::Display for ParityReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} rays ({} hits): {} agree, {} ties, {} unexplained ({:.1e}); worst |dt|/t {:.1e}",
            self.rays,
            self.hits,
            self.agree,
            self.ties,
            self.unexplained,
            self.unexplained_fraction(),
            self.worst_dt
        )?;
        for e in &self.examples {
            let Ray { origin: o, tmin, direction: d, tmax } = e.ray;
            write!(f, "\n  ray {}: {} | o {o:?} d {d:?} t {tmin:?}..{tmax:?}", e.index, e.reason)?;
            let (a, r) = (e.answer, e.reference);
            write!(
                f,
                " | answer {} t {:?} ({:?}, {:?}) | reference {} t {:?} {:?}",
                id(a.instance, a.primitive),
                a.t,
                a.u,
                a.v,
                id(r.instance, r.primitive),
                r.t,
                r.barycentrics
            )?;
        }
        Ok(())
    }
}

fn id(instance: u32, primitive: u32) -> String {
    if instance == u32::MAX { "none".to_owned() } else { format!("{instance}/{primitive}") }
}

/// Does rounding allow this closest hit? `Err` has the reason why not.
pub fn is_admissible(oracle: &Oracle, ray: &OracleRay, hit: &Hit, rounding: Rounding) -> Result<(), &'static str> {
    let certain = oracle.certain_before(ray, rounding);
    // NaN is not a hit
    if !hit.is_hit() {
        return match (certain.is_finite(), hit.t.is_nan()) {
            (_, true) => Err("t is not a number"),
            (true, _) => Err("misses a primitive that it certainly hits"),
            _ => Ok(()),
        };
    }
    let t = hit.t as f64;
    let mut named = oracle.candidates(ray, hit.instance, hit.primitive, rounding).peekable();
    if named.peek().is_none() {
        return Err("names a primitive that it certainly misses");
    }
    if !named.any(|c| c.lo <= t && t <= c.hi) {
        return Err("names a primitive at a distance where it is not");
    }
    if certain < t { Err("misses a nearer primitive that it certainly hits") } else { Ok(()) }
}

/// Judges one closest hit against the true one.
pub fn judge_closest_ray(oracle: &Oracle, ray: &Ray, hit: &Hit, truth: &OracleHit, rounding: Rounding) -> RayVerdict {
    let wide = OracleRay::from(ray);
    let same = hit.instance == truth.instance && hit.primitive == truth.primitive;
    if !hit.is_hit() && !truth.is_hit() && !hit.t.is_nan() {
        return RayVerdict::Agree;
    }
    // equal to a few roundings of t needs no error bound; else the bound around the true parameter
    // decides
    let t = hit.t as f64;
    if same && hit.is_hit() && truth.is_hit() {
        let holds = |x: f64, lo: f64, hi: f64| lo <= x && x <= hi;
        if (t - truth.t).abs() <= 2.0 * f32::EPSILON as f64 * truth.t.abs()
            || oracle
                .candidates(&wide, hit.instance, hit.primitive, rounding)
                .any(|c| holds(t, c.lo, c.hi) && holds(truth.t, c.lo, c.hi))
        {
            return RayVerdict::Agree;
        }
    }
    match is_admissible(oracle, &wide, hit, rounding) {
        Ok(()) => RayVerdict::Tie,
        Err(reason) => RayVerdict::Unexplained(reason),
    }
}

/// Judges a tracer's closest hits. `truth` are the oracle's for the same rays
/// ([`Oracle::trace_closest`]). Surplus entries of the longer slices are ignored.
pub fn judge_closest(
    oracle: &Oracle,
    rays: &[Ray],
    hits: &[Hit],
    truth: &[OracleHit],
    rounding: Rounding,
) -> ParityReport {
    report(rays.len().min(hits.len()).min(truth.len()), |i| {
        let verdict = judge_closest_ray(oracle, &rays[i], &hits[i], &truth[i], rounding);
        (verdict, relative_difference(hits[i].t as f64, truth[i].t), Example::from_ray(i, rays, hits[i], truth[i]))
    })
}

/// Judges two tracers' closest hits against each other: answers that differ are ties when the
/// oracle admits both.
pub fn judge_pair(oracle: &Oracle, rays: &[Ray], hits: &[Hit], others: &[Hit], rounding: Rounding) -> ParityReport {
    report(rays.len().min(hits.len()).min(others.len()), |i| {
        let (a, b) = (hits[i], others[i]);
        let other = OracleHit {
            t: b.t as f64,
            instance: b.instance,
            primitive: b.primitive,
            barycentrics: [b.u as f64, b.v as f64],
        };
        let verdict = match judge_closest_ray(oracle, &rays[i], &a, &other, rounding) {
            // a tie only says that `a` is admissible
            RayVerdict::Tie => match is_admissible(oracle, &OracleRay::from(&rays[i]), &b, rounding) {
                Ok(()) => RayVerdict::Tie,
                Err(_) => RayVerdict::Unexplained("the second tracer's answer is not admissible"),
            },
            verdict => verdict,
        };
        (verdict, relative_difference(a.t as f64, other.t), Example::from_ray(i, rays, a, other))
    })
}

/// Judges a tracer's answers to "is anything in the way?". `truth` are the oracle's
/// ([`Oracle::trace_any`]).
pub fn judge_any(oracle: &Oracle, rays: &[Ray], occluded: &[bool], truth: &[bool], rounding: Rounding) -> ParityReport {
    report(rays.len().min(occluded.len()).min(truth.len()), |i| {
        let verdict = if occluded[i] == truth[i] {
            RayVerdict::Agree
        } else {
            let ray = OracleRay::from(&rays[i]);
            if occluded[i] {
                if oracle.possibly_any(&ray, rounding) {
                    RayVerdict::Tie
                } else {
                    RayVerdict::Unexplained("occluded where nothing is near")
                }
            } else if oracle.certain_before(&ray, rounding).is_finite() {
                RayVerdict::Unexplained("misses a primitive that it certainly hits")
            } else {
                RayVerdict::Tie
            }
        };
        let answer = if occluded[i] { Hit { t: 0.0, ..Hit::MISS } } else { Hit::MISS };
        let reference = if truth[i] { OracleHit { t: 0.0, ..OracleHit::MISS } } else { OracleHit::MISS };
        (verdict, 0.0, Example::from_ray(i, rays, answer, reference))
    })
}

/// Judges the barycentric weights of a tracer's closest hits: they are those of the point where the
/// ray meets the triangle that is named, or off by rounding. Rays that miss, and spheres, agree.
pub fn judge_weights(oracle: &Oracle, rays: &[Ray], hits: &[Hit], rounding: Rounding) -> ParityReport {
    report(rays.len().min(hits.len()), |i| {
        let hit = hits[i];
        let ray = OracleRay::from(&rays[i]);
        let mut reference = OracleHit { instance: hit.instance, primitive: hit.primitive, ..OracleHit::MISS };
        let mut verdict = RayVerdict::Agree;
        if hit.is_hit() {
            reference.t = hit.t as f64;
            if let Some((weights, errors)) = oracle.weights(&ray, hit.instance, hit.primitive, rounding) {
                reference.barycentrics = [weights[1], weights[2]];
                let got = [1.0 - hit.u as f64 - hit.v as f64, hit.u as f64, hit.v as f64];
                // what is not a number is near nothing
                let near = (0..3).all(|k| (got[k] - weights[k]).abs() <= errors[k]);
                if !near {
                    verdict = RayVerdict::Unexplained("has the weights of another point");
                }
            }
        }
        (verdict, 0.0, Example::from_ray(i, rays, hit, reference))
    })
}

fn relative_difference(t: f64, truth: f64) -> f64 {
    if t == truth { 0.0 } else { (t - truth).abs() / truth.abs() }
}

impl Example {
    fn from_ray(index: usize, rays: &[Ray], answer: Hit, reference: OracleHit) -> Self {
        Self { index, ray: rays[index], answer, reference, reason: "" }
    }
}

fn report(count: usize, judge: impl Fn(usize) -> (RayVerdict, f64, Example) + Sync) -> ParityReport {
    (0..count)
        .into_par_iter()
        .with_min_len(256)
        .fold(ParityReport::default, |mut report, i| {
            let (verdict, dt, example) = judge(i);
            report.rays += 1;
            report.hits += example.reference.is_hit() as u64;
            match verdict {
                RayVerdict::Agree => {
                    report.agree += 1;
                    report.worst_dt = report.worst_dt.max(dt);
                }
                RayVerdict::Tie => report.ties += 1,
                RayVerdict::Unexplained(reason) => {
                    report.unexplained += 1;
                    if report.examples.len() < MAX_EXAMPLES {
                        report.examples.push(Example { reason, ..example });
                    }
                }
            }
            report
        })
        .reduce(ParityReport::default, ParityReport::merge)
}
