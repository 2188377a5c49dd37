//! Compares two tracers' hits of the same rays without an oracle over the whole scene.
//!
//! Where the answers differ, a double-precision oracle over only those primitives that either of
//! them names decides: the difference is a tie when rounding allows both answers
//! ([`super::parity`]), unexplained otherwise. Hits that both miss are not detected;
//! `tests/tracer/parity.rs` tests those. This suits benchmarks: scenes of 10^7 triangles with
//! differences in a few rays.

use std::collections::{HashMap, HashSet};

use super::parity::{self, ParityReport};
use rayon::prelude::*;

use crate::oracle::rounding::Rounding;
use crate::oracle::{Oracle, OracleRay};
use crate::ray::{Hit, Ray};
use crate::scene::{Geometry, Mesh, Scene, TriangleMesh};

/// Same primitive and a parameter within this many units of the last place: agreement without
/// consulting the oracle. It is well below the bound of [`Rounding`].
const SAME_T_ULPS: f32 = 4.0;

/// Are two closest hits equal within [`SAME_T_ULPS`]?
fn same(a: &Hit, b: &Hit) -> bool {
    match (a.is_hit(), b.is_hit()) {
        (false, false) => !a.t.is_nan() && !b.t.is_nan(),
        (true, true) => {
            a.instance == b.instance
                && a.primitive == b.primitive
                && (a.t - b.t).abs() <= SAME_T_ULPS * f32::EPSILON * a.t.abs().max(b.t.abs())
        }
        _ => false,
    }
}

/// Result of a comparison.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agreement {
    /// How many rays agree, and what the others are.
    pub report: ParityReport,
    /// Unexplained rays where the reference's answer is one that rounding does not allow.
    pub reference_unexplained: u64,
}

/// Compares closest hits; `hits` are judged against `reference`. Rays are relative to
/// `scene.origin()`. Surplus entries of the longer slices are ignored.
pub fn compare_closest(scene: &Scene, rays: &[Ray], hits: &[Hit], reference: &[Hit]) -> Agreement {
    let n = rays.len().min(hits.len()).min(reference.len());
    let differing: Vec<usize> = (0..n).filter(|&i| !same(&hits[i], &reference[i])).collect();
    let mut report = agreeing(n, &differing, reference);
    report.worst_dt = (0..n)
        .filter(|&i| hits[i].is_hit() && same(&hits[i], &reference[i]) && reference[i].t > 0.0)
        .map(|i| f64::from((hits[i].t - reference[i].t).abs() / reference[i].t))
        .fold(0.0, f64::max);
    if differing.is_empty() {
        return Agreement { report, reference_unexplained: 0 };
    }
    let pick = |from: &[Hit]| differing.iter().map(|&i| from[i]).collect::<Vec<_>>();
    let (mut a, mut b) = (pick(hits), pick(reference));
    let rays: Vec<Ray> = differing.iter().map(|&i| rays[i]).collect();
    let small = Reduced::new(scene, a.iter().chain(&b));
    a.iter_mut().chain(&mut b).for_each(|h| small.rename(h));
    let judged = parity::judge_pair(&small.oracle, &rays, &a, &b, Rounding::default());
    let wrong = |k: &usize| {
        let one = *k..*k + 1;
        // what agrees within rounding is no fault of either
        parity::judge_pair(&small.oracle, &rays[one.clone()], &a[one.clone()], &b[one], Rounding::default()).unexplained
            > 0
            && parity::is_admissible(&small.oracle, &OracleRay::from(&rays[*k]), &b[*k], Rounding::default()).is_err()
    };
    let any = judged.unexplained > 0;
    let reference_unexplained = if any { (0..rays.len()).into_par_iter().filter(wrong).count() as u64 } else { 0 };
    Agreement { report: report.merge(restore(judged, &differing, &small)), reference_unexplained }
}

/// Compares answers to "is anything in the way?". `named` are closest hits of the rays in question,
/// from either tracer or both: called with the indices of the rays that differ, it says which
/// primitives could decide.
///
/// # Errors
/// Those of `named`.
pub fn compare_any<E>(
    scene: &Scene,
    rays: &[Ray],
    hits: &[Hit],
    reference: &[Hit],
    named: impl FnOnce(&[Ray]) -> Result<Vec<Hit>, E>,
) -> Result<Agreement, E> {
    let n = rays.len().min(hits.len()).min(reference.len());
    let differing: Vec<usize> = (0..n).filter(|&i| hits[i].is_hit() != reference[i].is_hit()).collect();
    let mut report = agreeing(n, &differing, reference);
    if differing.is_empty() {
        return Ok(Agreement { report, reference_unexplained: 0 });
    }
    let rays: Vec<Ray> = differing.iter().map(|&i| rays[i]).collect();
    let small = Reduced::new(scene, named(&rays)?.iter());
    let pick = |from: &[Hit]| differing.iter().map(|&i| from[i].is_hit()).collect::<Vec<_>>();
    let (a, b) = (pick(hits), pick(reference));
    // the answers differ, so one of them is not the oracle's own: a tie needs both to be admissible
    let truth = small.oracle.trace_any(&rays);
    let of_a = parity::judge_any(&small.oracle, &rays, &a, &truth, Rounding::default());
    let of_b = parity::judge_any(&small.oracle, &rays, &b, &truth, Rounding::default());
    report.unexplained += of_a.unexplained + of_b.unexplained;
    report.ties += differing.len() as u64 - of_a.unexplained - of_b.unexplained;
    report.rays += differing.len() as u64;
    report.hits += b.iter().filter(|&&h| h).count() as u64;
    let reference_unexplained = of_b.unexplained;
    report.examples = restore(of_a.merge(of_b), &differing, &small).examples;
    Ok(Agreement { report, reference_unexplained })
}

/// The report of the rays that do not differ.
fn agreeing(n: usize, differing: &[usize], reference: &[Hit]) -> ParityReport {
    let hits = reference[..n].iter().filter(|h| h.is_hit()).count()
        - differing.iter().filter(|&&i| reference[i].is_hit()).count();
    let rays = (n - differing.len()) as u64;
    ParityReport { rays, hits: hits as u64, agree: rays, ..Default::default() }
}

/// Indices and ids of the examples as they are in the whole set and scene.
fn restore(mut report: ParityReport, differing: &[usize], small: &Reduced) -> ParityReport {
    for e in &mut report.examples {
        e.index = differing.get(e.index).copied().unwrap_or(e.index);
        e.answer.primitive = small.original(e.answer.instance, e.answer.primitive);
        e.reference.primitive = small.original(e.reference.instance, e.reference.primitive);
    }
    report
}

/// An oracle over the named primitives only.
struct Reduced {
    oracle: Oracle,
    /// Mesh of each instance.
    meshes: Vec<usize>,
    /// Primitives that are left of each mesh, in order.
    kept: HashMap<usize, Vec<u32>>,
}

impl Reduced {
    fn new<'a>(scene: &Scene, hits: impl Iterator<Item = &'a Hit>) -> Self {
        let meshes: Vec<usize> = scene.instances.iter().map(|i| i.mesh).collect();

        // primitives that some hit names
        let mut sets: HashMap<usize, HashSet<u32>> = HashMap::new();
        for h in hits {
            if let Some(&mesh) = meshes.get(h.instance as usize) {
                sets.entry(mesh).or_default().insert(h.primitive);
            }
        }
        let kept: HashMap<usize, Vec<u32>> = sets
            .into_iter()
            .map(|(mesh, set)| {
                let count = scene.meshes[mesh].geometry.primitive_count();
                let mut list: Vec<u32> = set.into_iter().filter(|&p| (p as usize) < count).collect();
                list.sort_unstable();
                (mesh, list)
            })
            .collect();

        // a scene of these alone: the oracle is quick, and its answers are the same
        let mut small = Scene {
            instances: scene.instances.clone(),
            materials: scene.materials.clone(),
            textures: scene.textures.clone(),
            ..Scene::default()
        };
        small.meshes = (0..scene.meshes.len())
            .map(|k| {
                let mesh = &scene.meshes[k];
                let list = kept.get(&k).map_or(&[][..], Vec::as_slice);
                let geometry = match &mesh.geometry {
                    Geometry::Spheres(s) => Geometry::Spheres(list.iter().map(|&p| s[p as usize]).collect()),
                    // not even its vertices
                    Geometry::Triangles(_) if list.is_empty() => Geometry::Triangles(TriangleMesh::default()),
                    Geometry::Triangles(t) => {
                        let indices = list.iter().map(|&p| t.indices[p as usize]).collect();
                        Geometry::Triangles(TriangleMesh { indices, ..t.clone() })
                    }
                };
                Mesh { name: String::new(), geometry, material: mesh.material, source: None }
            })
            .collect();
        Self { oracle: Oracle::new(&small, scene.origin()), meshes, kept }
    }

    /// A hit of the whole scene in the numbering of the reduced one.
    fn rename(&self, hit: &mut Hit) {
        let list = self.meshes.get(hit.instance as usize).and_then(|m| self.kept.get(m));
        if let Some(k) = list.and_then(|l| l.binary_search(&hit.primitive).ok()) {
            hit.primitive = k as u32;
        }
    }

    fn original(&self, instance: u32, primitive: u32) -> u32 {
        let list = self.meshes.get(instance as usize).and_then(|m| self.kept.get(m));
        list.and_then(|l| l.get(primitive as usize)).copied().unwrap_or(primitive)
    }
}
