//! A scene of the user's: what its data will do to single precision, and what tracers make of it.
//!
//! A file's contents are reported, and results of skylit with them held against bounds. [`Anatomy`]
//! has, beside the counts of [`crate::scene::inventory`], what numerics depends on.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::closed_forms::{self, options};
use super::degenerate::{compare_hits, parity_check};
use super::overlaps::Overlaps;
use super::sampling::{mean_of, not_finite, render};
use super::{Check, Section, Setup, StressSession, Watch, number};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::SampleSettings;
use crate::film::{Control, camera};
use crate::integrators::path::PathOptions;
use crate::integrators::rays::{Mode, trace};
use crate::measure::ray_sets::mixed_rays;
use crate::oracle::Oracle;
use crate::ray::Ray;
use crate::sampling::sobol::hash_combine;
use crate::scene::inventory::Inventory;
use crate::scene::{AlphaMode, Camera, Environment, Geometry, Scene, TexelData, TriangleMesh};
use crate::tracer::{Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "scene",
    title: "The scene",
    about: "what the scene's data does to single precision, and what tracers make of it",
    of_scene: true,
    run,
};

/// Digits of single precision, bits.
const DIGITS: f64 = 24.0;
/// Aspect (longest edge over height) from which a triangle is called a needle.
const NEEDLE: f64 = 1e3;
/// Primitives up to which a scene is held against the oracle in a quick run.
const QUICK_PRIMITIVES: usize = 1_000_000;

/// Properties of a scene that numerics depends on.
#[derive(Clone, Debug, Default)]
pub struct Anatomy {
    /// Largest step between neighbouring positions of a mesh, scene units; and its coordinate.
    pub step: (f64, f64),
    /// The step over the size of its mesh: how much of a detail is lost.
    pub relative_step: f64,
    /// Bits of positions that say where the mesh is and not how it looks, of 24.
    pub spent_bits: f64,
    /// Triangles by the decade of their aspect: below 10, below 100, and so on; from 1e7 on.
    pub aspects: [u64; 8],
    /// Largest aspect of a triangle that has an area.
    pub worst_aspect: f64,
    /// Triangles without an area that are left.
    pub degenerate: u64,
    /// Edges of more than two triangles.
    pub crowded_edges: u64,
    /// Triangles that lie exactly where another one lies.
    pub coincident: u64,
    /// Instances of a mesh where another instance of it lies.
    pub coincident_instances: u64,
    /// Triangles with normals, and of these the ones whose normals point to the other side.
    pub normals: (u64, u64),
    /// Normals that are zero or not finite.
    pub bad_normals: u64,
    /// Longest edge over shortest, over all meshes as they are in the world.
    pub scale_ratio: f64,
    /// Largest ratio of the axes of an instance's transform, and how many mirror.
    pub stretch: (f64, usize),
    /// Texels and radiances that are NaN, infinite or negative.
    pub bad_texels: u64,
}

impl Anatomy {
    /// Looks at all of a scene.
    pub fn from_scene(scene: &Scene) -> Self {
        let mut out = Self::default();
        let meshes: Vec<(Self, [f64; 2])> = scene.meshes.par_iter().map(|m| Self::of_mesh(&m.geometry)).collect();
        for (mesh, _) in &meshes {
            out.aspects.iter_mut().zip(mesh.aspects).for_each(|(a, b)| *a += b);
            out.worst_aspect = out.worst_aspect.max(mesh.worst_aspect);
            out.degenerate += mesh.degenerate;
            out.crowded_edges += mesh.crowded_edges;
            out.coincident += mesh.coincident;
            out.normals = (out.normals.0 + mesh.normals.0, out.normals.1 + mesh.normals.1);
            out.bad_normals += mesh.bad_normals;
        }

        // Instances stretch meshes, and may coincide.
        let (mut shortest, mut longest) = (f64::INFINITY, 0.0f64);
        let mut places: HashMap<(usize, [u64; 12]), u64> = HashMap::new();
        for instance in &scene.instances {
            let m = &instance.object_to_world;
            let axes = m.matrix3.to_cols_array_2d().map(|c| DVec3::from(c).length());
            let (least, most) = (axes[0].min(axes[1]).min(axes[2]), axes[0].max(axes[1]).max(axes[2]));
            out.stretch.0 = out.stretch.0.max(if least > 0.0 { most / least } else { f64::INFINITY });
            out.stretch.1 += usize::from(m.matrix3.determinant() < 0.0);
            let (mesh, edges) = &meshes[instance.mesh];
            if edges[0] > 0.0 {
                shortest = shortest.min(edges[0] * least);
                longest = longest.max(edges[1] * most);
            }
            if mesh.step.0 * most > out.step.0 {
                out.step = (mesh.step.0 * most, mesh.step.1);
            }
            if mesh.relative_step > out.relative_step {
                (out.relative_step, out.spent_bits) = (mesh.relative_step, mesh.spent_bits);
            }
            *places.entry((instance.mesh, m.to_cols_array().map(f64::to_bits))).or_default() += 1;
        }
        out.coincident_instances = places.values().filter(|n| **n > 1).sum();
        out.scale_ratio = if shortest > 0.0 && shortest.is_finite() { longest / shortest } else { 1.0 };
        out.bad_texels = scene.textures.iter().map(|t| bad_texels(&t.texels)).sum();
        if let Environment::Map(map) = &scene.environment {
            out.bad_texels += map.radiance.iter().filter(|c| !c.is_finite() || c.min_element() < 0.0).count() as u64;
        }
        out
    }

    /// The anatomy of a mesh in its own space, and its shortest and longest edge.
    fn of_mesh(geometry: &Geometry) -> (Self, [f64; 2]) {
        let mut out = Self::default();
        if let Some((lo, hi)) = geometry.bounds() {
            let (reach, size) = (lo.abs().max(hi.abs()).max_element(), (hi - lo).max_element());
            let step = step_at(reach);
            out.step = (step, reach);
            if size > 0.0 {
                out.relative_step = step / size;
                out.spent_bits = (reach / size).log2().clamp(0.0, DIGITS);
            }
        }
        let Geometry::Triangles(mesh) = geometry else { return (out, [0.0; 2]) };
        let (mut shortest, mut longest) = (f64::INFINITY, 0.0f64);
        for triangle in &mesh.indices {
            let v = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
            let edges = [v[1] - v[0], v[2] - v[1], v[0] - v[2]].map(DVec3::length);
            let normal = (v[1] - v[0]).cross(v[2] - v[0]);
            let most = edges[0].max(edges[1]).max(edges[2]);
            edges.into_iter().filter(|e| *e > 0.0).for_each(|e| shortest = shortest.min(e));
            longest = longest.max(most);
            if normal == DVec3::ZERO {
                out.degenerate += 1;
                continue;
            }
            let aspect = most * most / normal.length();
            out.aspects[(aspect.log10().max(0.0) as usize).min(7)] += 1;
            out.worst_aspect = out.worst_aspect.max(aspect);
            if !mesh.normals.is_empty() {
                let shading: DVec3 = triangle.map(|i| mesh.normals[i as usize].as_dvec3()).into_iter().sum();
                out.normals.0 += 1;
                out.normals.1 += u64::from(shading.dot(normal) < 0.0);
            }
        }
        out.bad_normals = mesh.normals.iter().filter(|n| !n.is_finite() || n.length_squared() < 1e-12).count() as u64;
        let places = places(mesh);
        out.crowded_edges = crowded_edges(mesh, &places);
        out.coincident = coincident(mesh, &places);
        (out, [if shortest.is_finite() { shortest } else { 0.0 }, longest])
    }
}

/// Distance of neighbouring numbers of single precision at a coordinate.
pub fn step_at(coordinate: f64) -> f64 {
    let x = coordinate.abs() as f32;
    f64::from(x.next_up() - x)
}

/// A number for each vertex, the same for vertices at the same place.
fn places(mesh: &TriangleMesh) -> Vec<u32> {
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    // 0 and -0 are one place
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    mesh.positions
        .iter()
        .map(|p| {
            let next = known.len() as u32;
            *known.entry(key(*p)).or_insert(next)
        })
        .collect()
}

fn crowded_edges(mesh: &TriangleMesh, places: &[u32]) -> u64 {
    let mut edges: Vec<(u32, u32)> = mesh
        .indices
        .iter()
        .flat_map(|t| [0, 1, 2].map(|k| (places[t[k] as usize], places[t[(k + 1) % 3] as usize])))
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() > 2).count() as u64
}

fn coincident(mesh: &TriangleMesh, places: &[u32]) -> u64 {
    let mut all: Vec<[u32; 3]> = mesh
        .indices
        .iter()
        .map(|t| {
            let mut key = t.map(|i| places[i as usize]);
            key.sort_unstable();
            key
        })
        .collect();
    all.sort_unstable();
    all.chunk_by(|a, b| a == b).filter(|same| same.len() > 1).map(|same| same.len() as u64).sum()
}

fn bad_texels(texels: &TexelData) -> u64 {
    match texels {
        TexelData::Float(values) => values.iter().filter(|v| !v.is_finite() || **v < 0.0).count() as u64,
        // integers are from 0 to 1
        _ => 0,
    }
}

fn run(session: &mut StressSession) -> Result<()> {
    if session.setup().scene().is_none() {
        let name = "the scene";
        return session.measure(name, None, |_, _| Ok(Check::not_applicable(name, "no scene was named")));
    }
    session.measure_all("the scene's data", None, |s, _| Ok(data(scene_of(s)?)))?;
    let kinds = session.setup().tracers();
    rays(session, &kinds)?;
    images(session, &kinds)
}

fn scene_of(setup: &Setup) -> Result<&Scene> {
    setup.scene().ok_or_else(|| Error::Usage("no scene was named".into()))
}

/// The expected effects of the scene's data, a check each.
pub fn data(scene: &Scene) -> Vec<Check> {
    let (inventory, anatomy) = (Inventory::from_scene(scene), Anatomy::from_scene(scene));
    let mut out = positions(scene, &anatomy);

    // Triangles may have hardly any area.
    let dropped = inventory.degenerate_triangles as f64;
    let sentence = if dropped > 0.0 { "dropped" } else { "none was dropped" };
    out.push(Check::reported("degenerate triangles", dropped, "triangles").says(sentence));
    out.push(
        Check::none_of("degenerate triangles that are left", anatomy.degenerate, "triangles", false)
            .says("they have no area in f64 and are never hit"),
    );
    let needles: u64 = anatomy.aspects[3..].iter().sum();
    let histogram: Vec<String> =
        (0i32..).zip(anatomy.aspects).filter(|(_, n)| *n > 0).map(|(k, n)| format!("1e{k}: {n}")).collect();
    // the aspect spoils barycentrics, but not t, which rounds with coordinates
    let lost = anatomy.worst_aspect * f64::from(f32::EPSILON);
    out.push(Check::reported("needles", needles as f64, "triangles").says(format!(
        "of aspect {NEEDLE:e} and more; the worst has {}, where barycentrics are good to {}; by aspect from {}",
        number(anatomy.worst_aspect),
        number(lost.min(1.0)),
        histogram.join(", ")
    )));

    // Meshes may be open or lie on one another.
    let open = inventory.open_edges as f64;
    let sentence = match inventory.open_edges {
        0 => format!("all {} meshes are closed", inventory.closed_meshes),
        n => format!(
            "{n} open edges: AO leaks there by construction; {} of {} meshes are closed",
            inventory.closed_meshes, inventory.meshes
        ),
    };
    out.push(Check::reported("open edges", open, "edges").says(sentence));
    out.push(Check::reported("edges of more than two triangles", anatomy.crowded_edges as f64, "edges"));
    out.push(Check::reported("coincident triangles", anatomy.coincident as f64, "triangles").says(
        match anatomy.coincident {
            0 => "no ties",
            _ => "ties: which one a ray meets is not said",
        },
    ));
    out.push(Check::reported("coincident instances", anatomy.coincident_instances as f64, "instances"));

    // Normals, transforms and texels may be wrong.
    let (with, against) = anatomy.normals;
    let percent = 100.0 * against as f64 / with.max(1) as f64;
    out.push(Check::reported("normals that disagree with winding", percent, "%").says(match with {
        0 => "no mesh has normals of its own".to_owned(),
        _ => format!("{against} of {with} triangles"),
    }));
    out.push(Check::reported("normals that are zero or not finite", anatomy.bad_normals as f64, "normals"));
    let (stretch, mirrored) = anatomy.stretch;
    out.push(
        Check::reported("stretch of transforms", stretch, "")
            .says(format!("longest axis over shortest; {mirrored} instances are mirrored")),
    );
    // decoders let no such texel in
    out.push(Check::at_most("texels that are NaN, infinite or negative", anatomy.bad_texels as f64, "texels", 0.0));
    out
}

/// The expected effects of where a scene is and how large its parts are: positions have a limited
/// number of bits.
fn positions(scene: &Scene, anatomy: &Anatomy) -> Vec<Check> {
    let mut out = Vec::new();
    let mut report = |name: &str, value: f64, unit: &'static str, sentence: String| {
        out.push(Check::reported(name, value, unit).says(sentence));
    };

    // Where meshes are takes bits from what they are.
    let (step, at) = anatomy.step;
    let bits = anatomy.spent_bits.floor();
    report(
        "precision of positions",
        step,
        "units",
        match bits {
            // scenes of which the origin is in a corner have as much
            b if b < 4.0 => {
                format!("steps at coordinates of {}; positions have {} of 24 bits for detail", number(at), DIGITS - b)
            }
            _ => format!(
                "positions use {bits} of 24 bits at {} to say where the mesh is: expect steps of {}; put the distance into a node's translation",
                number(at),
                number(step)
            ),
        },
    );

    // The scene is moved to its origin, which mends its distance and not its size.
    if let Some((lo, hi)) = scene.bounds() {
        let (origin, size) = (scene.origin(), (hi - lo).max_element());
        let before = step_at(lo.abs().max(hi.abs()).max_element());
        let after = step_at((lo - origin).abs().max((hi - origin).abs()).max_element());
        let sentence = if origin == DVec3::ZERO {
            "the origin is left where it is".to_owned()
        } else {
            format!("the origin was moved to {origin}: a step was {}, and is {} now", number(before), number(after))
        };
        report("step of the scene for tracers", after, "units", sentence);
        // what moving cannot mend: a scene that is large and detailed
        let (distance, ratio) = ((lo + hi).length() * 0.5, anatomy.scale_ratio);
        report("distance from the origin", distance, "units", format!("of a scene {} units large", number(size)));
        let lost = if ratio > 1e7 { "; the shortest are below a rounding of the longest" } else { "" };
        report(
            "longest edge over shortest",
            ratio,
            "",
            format!("edges differ by {:.0} decades{lost}", ratio.log10().max(0.0)),
        );
    }
    out
}

/// Rays at edges between two triangles that both face their origin, so that no rounding makes them
/// pass: every miss is a leak. Triangles almost without height, and cut-out and blended surfaces,
/// are left out. Empty where a scene has no such edge.
pub fn edge_rays(scene: &Scene, oracle: &Oracle, count: usize, seed: u32) -> Vec<Ray> {
    let opaque = |instance: u32| {
        let mesh = &scene.meshes[scene.instances[instance as usize].mesh];
        scene.materials[mesh.material].alpha_mode == AlphaMode::Opaque
    };

    // Leaves out triangles that are close to a rounding.
    let Some((lo, hi)) = oracle.bounds() else { return Vec::new() };
    let reach = lo.abs().max(hi.abs()).max_element();
    let rounding = reach * f64::from(f32::EPSILON);
    let sound: Vec<([DVec3; 3], u32)> = oracle
        .triangles()
        .iter()
        .filter(|t| opaque(t.instance))
        .filter(|t| {
            let normal = (t.v[1] - t.v[0]).cross(t.v[2] - t.v[0]);
            let longest = (0..3).map(|k| (t.v[(k + 1) % 3] - t.v[k]).length()).fold(0.0, f64::max);
            normal.length() > 1e3 * rounding * longest
        })
        .map(|t| (t.v, t.instance))
        .collect();

    // Finds edges of exactly two triangles, and the normals of both.
    let key = |p: DVec3| (p + DVec3::ZERO).to_array().map(f64::to_bits);
    // by instance and ends: how many triangles, and the corners of the first two beside the edge
    type Edge = (u32, [[u64; 3]; 2]);
    let mut edges: HashMap<Edge, (u32, [DVec3; 2])> = HashMap::new();
    for (v, instance) in &sound {
        for k in 0..3 {
            let (a, b, beside) = (key(v[k]), key(v[(k + 1) % 3]), v[(k + 2) % 3]);
            let (count, corners) = edges.entry((*instance, [a.min(b), a.max(b)])).or_insert((0, [beside; 2]));
            *count += 1;
            if *count == 2 {
                corners[1] = beside;
            }
        }
    }
    let mut pairs: Vec<([DVec3; 2], DVec3, DVec3)> = edges
        .into_iter()
        .filter(|(_, (count, _))| *count == 2)
        .map(|((_, ends), (_, corners))| {
            let [a, b] = ends.map(|e| DVec3::from(e.map(f64::from_bits)));
            let along = (b - a).normalize();
            // normals on one side of both, whatever their winding; opposite ones for folds
            let [p, q] = corners.map(|c| ((c - a) - along * (c - a).dot(along)).normalize());
            ([a, b], along.cross(p), q.cross(along))
        })
        // neighbours that fold back are seen by no ray both from the front
        .filter(|(_, m, n)| m.dot(*n) > -0.4)
        .collect();
    // hashing has an order of its own in every process
    pairs.sort_unstable_by_key(|(ends, ..)| ends.map(key));
    if pairs.is_empty() {
        return Vec::new();
    }

    // Aims rays at points of edges, from directions that both triangles face.
    (0..count)
        .into_par_iter()
        .map(|i| {
            let unit = |k: u32| f64::from(hash_combine(hash_combine(seed, i as u32), k)) / 4_294_967_296.0;
            let ([a, b], m, n) = pairs[((unit(0) * pairs.len() as f64) as usize).min(pairs.len() - 1)];
            let along = [0.5, 0.25, unit(1), unit(2)][(unit(3) * 4.0) as usize % 4];
            let target = a + (b - a) * (0.05 + 0.9 * along);
            let side = if unit(4) < 0.5 { 1.0 } else { -1.0 };
            let aside = DVec3::new(unit(5), unit(6), unit(7)) * 2.0 - 1.0;
            let out = ((m + n).normalize() + aside * 0.1).normalize() * side;
            let distance = (hi - lo).length() * (unit(8) * 8.0 - 9.0).exp2();
            let origin = (target + out * distance).as_vec3();
            Ray {
                origin: origin.to_array(),
                tmin: 0.0,
                direction: (target - origin.as_dvec3()).as_vec3().to_array(),
                tmax: f32::INFINITY,
            }
        })
        .collect()
}

/// Counts those of [`edge_rays`] that meet nothing up to their edge, which is at t = 1.
pub fn leaks(tracer: &Tracer, rays: &[Ray], control: &mut dyn Control) -> Result<usize> {
    Ok(trace(tracer, rays, Mode::Closest, 1, control)?.0.iter().filter(|h| h.t.is_nan() || h.t > 1.01).count())
}

/// Spawned rays of an image that meet the triangle from which they start, and all of them; `None`
/// if the tracer's camera rays and spawned rays do not correspond.
pub fn self_hits(
    tracer: &Tracer,
    scene: &Scene,
    view: &Camera,
    size: u32,
    control: &mut dyn Control,
) -> Result<Option<(usize, usize)>> {
    let options = options(size, 1, 1.0, f64::INFINITY).with_samples(|s| s.keep_rays = true);
    let image = closed_forms::render(tracer, scene, view, &options, control)?;
    let first = trace(tracer, &image.kept_primary, Mode::Closest, 1, control)?.0;
    let from: Vec<_> = first.iter().filter(|h| h.is_hit()).collect();
    if from.len() != image.kept_occlusion.len() {
        return Ok(None);
    }
    let spawned = trace(tracer, &image.kept_occlusion, Mode::Closest, 1, control)?.0;
    let is_flat = |instance: u32| {
        let geometry = scene.instances.get(instance as usize).map(|i| &scene.meshes[i.mesh].geometry);
        matches!(geometry, Some(Geometry::Triangles(_)))
    };
    let same = from
        .iter()
        .zip(&spawned)
        .filter(|(a, b)| b.is_hit() && (a.instance, a.primitive) == (b.instance, b.primitive) && is_flat(a.instance));
    Ok(Some((same.count(), spawned.len())))
}

const OVERLAP: &str = "surfaces on one another";

/// Which part of the surface lies on another one.
fn overlap(scene: &Scene, oracle: &Oracle, points: u32) -> Check {
    let found = Overlaps::measure(oracle, points, 3);
    let percent = 100.0 * found.covered as f64 / found.points.max(1) as f64;
    let sentence = match found.example {
        None => "no triangle lies on another in the same plane".to_owned(),
        Some(pair) => {
            let [a, b] = pair.map(|(instance, primitive)| {
                let at = &scene.instances[instance as usize];
                let name = if at.name.is_empty() { &scene.meshes[at.mesh].name } else { &at.name };
                format!("triangle {primitive} of {}", name_or_number(name, instance))
            });
            format!(
                "{} of {} points lie within a rounding of another triangle in their plane, as {a} and {b} do: which one a ray meets is not said",
                found.covered, found.points
            )
        }
    };
    Check::reported(OVERLAP, percent, "% of the area").says(sentence)
}

fn name_or_number(name: &str, number: u32) -> String {
    if name.is_empty() { format!("instance {number}") } else { format!("`{name}`") }
}

fn rays(session: &mut StressSession, kinds: &[TracerKind]) -> Result<()> {
    let effort = session.setup().effort();
    let parity_name = "hits against the f64 oracle";
    let leak_name = "rays at shared edges";
    let self_name = "spawned rays that meet their own triangle";
    let scene = scene_of(session.setup())?.clone();
    let count = (scene.triangle_count() + scene.sphere_count()) as usize;
    let view = match camera::choose(&scene, &camera::Choice::Auto, 1.0) {
        Ok(view) => view,
        Err(e) => {
            return session.measure(parity_name, None, |_, _| Ok(Check::not_applicable(parity_name, e.to_string())));
        }
    };

    // Compares hits with the oracle, and looks for leaks at shared edges.
    if count > effort.pick(QUICK_PRIMITIVES, usize::MAX) {
        let why = format!("{count} primitives are more than {QUICK_PRIMITIVES}: use --full");
        session.measure(parity_name, None, |_, _| Ok(Check::not_applicable(parity_name, why)))?;
    } else {
        let oracle = Oracle::new(&scene, scene.origin());
        session.measure(OVERLAP, None, |s, _| Ok(overlap(&scene, &oracle, s.effort().pick(50_000, 10_000_000))))?;
        let set = mixed_rays(&oracle, &view, effort.pick(30_000, 10_000_000), 1);
        let truth = oracle.trace_closest(&set);
        session.measure_each(parity_name, kinds, |s, kind, w| {
            let reports = compare_hits(&s.tracer(kind, &scene)?, &oracle, &set, &truth, w)?;
            let check = parity_check(parity_name, &reports);
            // as the gate of tests/tracer
            let bound = (1e-5 * (reports[0].rays + reports[1].rays) as f64).ceil();
            Ok(Check::at_most(parity_name, check.value, "unexplained", bound).says(check.sentence))
        })?;
        let set = edge_rays(&scene, &oracle, effort.pick(50_000, 10_000_000), 7);
        session.measure_each(leak_name, kinds, |s, kind, w| {
            if set.is_empty() {
                return Ok(Check::not_applicable(
                    leak_name,
                    "no two opaque triangles share an edge that rays can be aimed at",
                ));
            }
            let leaks = leaks(&s.tracer(kind, &scene)?, &set, w)?;
            let is_ours = kind == TracerKind::Compute;
            Ok(Check::none_of(leak_name, leaks as u64, "leaks", is_ours).says(format!("of {}", set.len())))
        })?;
    }

    // Spawned rays leave their triangle.
    session.measure_each(self_name, kinds, |s, kind, w| {
        Ok(match self_hits(&s.tracer(kind, &scene)?, &scene, &view, effort.pick(128, 1024), w)? {
            Some((hits, of)) => Check::at_most(self_name, hits as f64, "rays", 0.0).says(format!("of {of}")),
            None => Check::not_applicable(
                self_name,
                "a camera ray meets an edge where its two kernels differ: no rays can be assigned",
            ),
        })
    })
}

fn images(session: &mut StressSession, kinds: &[TracerKind]) -> Result<()> {
    let (effort, shading) = (session.setup().effort(), session.setup().shading_tracers());
    let name = "ambient occlusion image";
    session.measure_each(name, kinds, |s, kind, w| {
        let scene = scene_of(s)?;
        let view = camera::choose(scene, &camera::Choice::Auto, 1.0)?;
        let options = options(effort.pick(96, 512), effort.pick(4, 64), 1.0, f64::INFINITY);
        let film = closed_forms::render(&s.tracer(kind, scene)?, scene, &view, &options, w)?.image.film;
        let bad = film.mean.iter().chain(&film.variance).filter(|v| !(0.0..=1.0).contains(*v)).count();
        let (mean, _) = film.mean_and_error();
        Ok(Check::at_most(name, bad as f64, "values", 0.0)
            .says(format!("that are no numbers or out of range; mean ambient visibility {mean:.3}")))
    })?;
    let name = "path-traced image";
    session.measure_each(name, &shading, |s, kind, w| path_image(s, kind, name, w))
}

fn path_image(setup: &Setup, kind: TracerKind, name: &str, watch: &mut Watch) -> Result<Check> {
    let mut scene = scene_of(setup)?.clone();
    let view = camera::choose(&scene, &camera::Choice::Auto, 1.0)?;
    let is_dark = scene.is_dark();
    if is_dark {
        scene.environment = Environment::Uniform(Vec3::ONE);
    }
    scene.cameras = vec![view];
    let flat = FlatScene::for_paths(&scene);
    let effort = setup.effort();
    let options = PathOptions {
        samples: SampleSettings::new([effort.pick(48, 256); 2], effort.pick(4, 256), 0),
        max_depth: 8,
        ..Default::default()
    };
    let film = render(&super::scale::path_tracer(setup, kind, &flat)?, &flat, &options, watch)?.image.film;
    let (mean, error) = mean_of(&film);
    let light = if is_dark { ", in a white sky, as it has no light" } else { "" };
    let sentence = format!(
        "of the film or its samples are not finite; mean radiance {} +- {}{light}",
        number(mean),
        number(error)
    );
    Ok(Check::at_most(name, not_finite(&film) as f64, "values", 0.0).says(sentence))
}
