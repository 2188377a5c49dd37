//! Section 3, degenerate geometry through every tracer, against brute force in double precision.

use std::fmt::Write as _;
use std::time::Instant;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::{Check, Section, Setup, StressSession, Watch};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::camera::CameraRecord;
use crate::film::{Control, SampleSettings};
use crate::integrators::ao::{self, AoOptions, Occlusion};
use crate::integrators::aov;
use crate::integrators::rays::{Mode, trace};
use crate::measure::parity::{ParityReport, judge_any, judge_closest};
use crate::measure::ray_sets::{leak_rays, random_rays};
use crate::oracle::rounding::Rounding;
use crate::oracle::{Oracle, OracleHit};
use crate::ray::{Hit, Ray};
use crate::sampling::sobol::hash_combine;
use crate::sampling::to_unit;
use crate::scene::builtin::{self, SceneTransform, analytic, shapes};
use crate::scene::{Camera, Geometry, Instance, Material, Mesh, Scene, Sphere, TriangleMesh, load};
use crate::tracer::{Needs, Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "degenerate",
    title: "Degenerate geometry",
    about: "zero area, needles, duplicates, NaN and 1e38, a million instances in one place: the right answer or a named error, in bounded time",
    of_scene: false,
    run,
};

/// A scene of meshes, each in some places, with one material.
pub fn scene_of(parts: Vec<(Geometry, Vec<DAffine3>)>) -> Scene {
    let mut scene = Scene { materials: vec![Material::default()], ..Scene::default() };
    for (geometry, places) in parts {
        scene.meshes.push(Mesh { name: String::new(), geometry, material: 0, source: None });
        let mesh = scene.meshes.len() - 1;
        scene.instances.extend(places.into_iter().map(|object_to_world| Instance {
            name: String::new(),
            mesh,
            object_to_world,
        }));
    }
    scene
}

/// A mesh of triangles that share no vertices.
pub fn triangles(corners: impl IntoIterator<Item = [DVec3; 3]>) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for corner in corners {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corner.map(|p| p.as_vec3()));
        mesh.indices.push([first, first + 1, first + 2]);
    }
    Geometry::Triangles(mesh)
}

/// Uniform in [0, 1): number `k` of `i`.
pub fn random(i: u32, k: u32) -> f64 {
    to_unit(hash_combine(hash_combine(42, i), k)) as f64
}

/// Uniform in [-1, 1)^3.
pub fn random_point(i: u32, k: u32) -> DVec3 {
    DVec3::new(random(i, k), random(i, k + 1), random(i, k + 2)) * 2.0 - 1.0
}

pub fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Ray::new(origin, direction, [0.0, f64::INFINITY])
}

/// Rays at corners of the triangles, at points of their edges, and along their edges.
pub fn rays_at_edges(oracle: &Oracle) -> Vec<Ray> {
    let mut rays = Vec::new();
    for (i, t) in (0u32..).zip(oracle.triangles()) {
        let from = random_point(i, 20) * 2.0;
        for target in [t.v[0], t.v[0].lerp(t.v[1], random(i, 30))] {
            rays.push(ray(from, target - from));
        }
        if t.v[0] != t.v[1] {
            rays.push(ray(t.v[0] * 2.0 - t.v[1], t.v[1] - t.v[0]));
        }
    }
    rays
}

fn instance_at_origin(geometry: Geometry) -> Scene {
    scene_of(vec![(geometry, vec![DAffine3::IDENTITY])])
}

fn oracle_of(scene: &Scene) -> Oracle {
    Oracle::new(scene, scene.origin())
}

/// `count` triangles, half of them without area, slivers and sound ones among them.
pub fn without_area(count: u32, rays: usize) -> (Scene, Vec<Ray>) {
    let corners = (0..count).map(|i| {
        let [a, b, c] = [random_point(i, 0), random_point(i, 3), random_point(i, 6)];
        match i % 6 {
            0 => [a, a, a],
            1 => [a, a, b],
            2 => [a, b, a],
            3 => [a, b, a.lerp(b, 0.6) + c * 2e-2],
            _ => [a, a + b * 0.1, a + c * 0.1],
        }
    });
    let scene = instance_at_origin(triangles(corners));
    let oracle = oracle_of(&scene);
    let mut set = random_rays(&oracle, rays, 2);
    set.extend(rays_at_edges(&oracle));
    (scene, set)
}

/// `count` triangles from 1e-6 to 1e6 in one mesh, around points that are as far apart.
pub fn scales_together(count: u32, rays: usize) -> (Scene, Vec<Ray>) {
    let corners = (0..count).map(|i| {
        let at = random_point(i, 0) * 10f64.powf(random(i, 3) * 12.0 - 6.0);
        let size = 10f64.powf(random(i, 4) * 12.0 - 6.0);
        [at, at + random_point(i, 5) * size, at + random_point(i, 8) * size]
    });
    let scene = instance_at_origin(triangles(corners));
    let oracle = oracle_of(&scene);
    let mut set = random_rays(&oracle, rays, 3);
    for (i, t) in oracle.triangles().iter().enumerate() {
        // at its middle, from as far as it is large, and from as far as the scene is large
        let (i, middle) = (i as u32, (t.v[0] + t.v[1] + t.v[2]) / 3.0);
        for reach in [(t.v[1] - t.v[0]).length(), 1e6] {
            let from = middle + random_point(i, 20) * reach;
            set.push(ray(from, (middle - from) / reach));
        }
    }
    (scene, set)
}

/// `count` triangles as large as the loader lets in, and rays along the axes.
pub fn largest_coordinates(count: u32, rays: usize) -> (Scene, Vec<Ray>) {
    let corners = (0..count).map(|i| {
        let at = random_point(i, 0) * 0.9e12;
        [at, at + random_point(i, 3) * 1e11, at + random_point(i, 6) * 1e11]
    });
    let scene = instance_at_origin(triangles(corners));
    let oracle = oracle_of(&scene);
    let mut set = random_rays(&oracle, rays, 3);
    for (i, t) in oracle.triangles().iter().enumerate() {
        let middle = (t.v[0] + t.v[1] + t.v[2]) / 3.0;
        let along = [DVec3::X, DVec3::Y, DVec3::Z][i % 3] * if i % 2 == 0 { 1.0 } else { -1.0 };
        set.push(ray(middle - along * 4e12, along));
    }
    (scene, set)
}

/// Triangles each of which is a fraction of the one that holds it, around one point, down to where
/// single precision ends; and a second, steeper nest: a deep tree. `gentle` and `steep` choose.
pub fn nested(gentle: bool, steep: bool, rays: usize) -> (Scene, Vec<Ray>) {
    let shape = [DVec3::new(-1.0, -0.6, 0.0), DVec3::new(1.0, -0.6, 0.2), DVec3::new(0.0, 1.0, -0.1)];
    // apart in z by more than rounding, so that there is one answer
    let chain = (0..if gentle { 200 } else { 0 }).map(|k| {
        let size = 0.5f64.powf(k as f64 * 0.25);
        shape.map(|p| p * size + DVec3::Z * (0.6 * size))
    });
    // sizes fall by half per level, to the end of the exponent's range where products underflow
    let falling = (0..if steep { 60 } else { 0 })
        .map(|k| shape.map(|p| p * 0.5f64.powi(k) + DVec3::X * 3.0 + DVec3::Z * (0.6 * 0.5f64.powi(k))));
    let scene = instance_at_origin(triangles(chain.chain(falling)));
    let mut set = random_rays(&oracle_of(&scene), rays, 5);
    for i in 0..rays as u32 / 5 {
        // at a point near the common one, nearer by many scales
        let center = if i % 2 == 0 { DVec3::ZERO } else { DVec3::X * 3.0 };
        let target = center + random_point(i, 0) * 0.5f64.powf(50.0 * random(i, 3));
        let from = center + random_point(i, 4) + DVec3::Z * if i % 4 < 2 { 3.0 } else { -3.0 };
        set.push(ray(from, target - from));
    }
    (scene, set)
}

/// Many nested spheres, and many of the same place and size.
pub fn nested_spheres(rays: usize) -> (Scene, Vec<Ray>) {
    let balls =
        (0..500)
            .map(|k| Sphere { center: Vec3::new(0.1, 0.2, 0.3), radius: if k < 300 { 0.97f32.powi(k) } else { 0.5 } })
            .chain((0..100).map(|i| Sphere {
                center: random_point(i, 0).as_vec3() * 2.0,
                radius: 1e-5 + 1e-3 * random(i, 3) as f32,
            }));
    let scene = instance_at_origin(Geometry::Spheres(balls.collect()));
    let oracle = oracle_of(&scene);
    let mut set = random_rays(&oracle, rays, 6);
    for (i, s) in oracle.spheres().iter().enumerate() {
        let from = random_point(i as u32, 20) * 3.0;
        set.push(ray(from, s.center - from));
        // from inside
        set.push(ray(s.center, random_point(i as u32, 24)));
    }
    (scene, set)
}

/// A box around coordinates so large that neighbours of a float are a thousandth of its size apart,
/// held there by a triangle at the origin, and rays at its shared edges.
pub fn coarse_coordinates(rays: usize) -> (Scene, Vec<Ray>) {
    let place = SceneTransform { scale: 100.0, offset: DVec3::new(1e6, -2e6, 3e6) };
    let mut scene = builtin::bake(&analytic::closed_box(1.0, place));
    let far = instance_at_origin(triangles([[DVec3::ZERO, DVec3::X, DVec3::Y]]));
    scene.meshes.extend(far.meshes);
    scene.instances.push(Instance { name: String::new(), mesh: 1, object_to_world: DAffine3::IDENTITY });
    let oracle = oracle_of(&scene);
    let mut set = leak_rays(&oracle, rays, 7);
    set.extend(random_rays(&oracle, rays / 4, 8));
    (scene, set)
}

/// `count` times one triangle, of the same vertices or its own. The second scene has it once.
pub fn coincident(count: u32, own_vertices: bool) -> [Scene; 2] {
    let corners = [DVec3::new(-1.0, -0.5, 0.1), DVec3::new(1.0, -0.4, -0.2), DVec3::new(0.1, 1.0, 0.3)];
    let once = triangles([corners]);
    let mut many = once.clone();
    match &mut many {
        _ if own_vertices => many = triangles(std::iter::repeat_n(corners, count as usize)),
        Geometry::Triangles(mesh) => mesh.indices = vec![[0, 1, 2]; count as usize],
        Geometry::Spheres(_) => {}
    }
    [instance_at_origin(many), instance_at_origin(once)]
}

/// `count` triangles in one plane, each a little larger than the one before, in one mesh or as
/// instances: the smallest is tested with all others. The second scene has the largest alone.
pub fn overlapping(count: u32, as_instances: bool) -> [Scene; 2] {
    let corners = [DVec3::new(-0.5, -0.25, 0.0), DVec3::new(0.5, -0.3, 0.0), DVec3::new(0.05, 0.5, 0.0)];
    let size = |k: u32| 1.0 + f64::from(k) / f64::from(count);
    let sized = |k: u32| triangles([corners.map(|c| c * size(k))]);
    let many = if as_instances {
        let places = (0..count).map(|k| DAffine3::from_scale(DVec3::new(size(k), size(k), 1.0)));
        scene_of(vec![(triangles([corners]), places.collect())])
    } else {
        instance_at_origin(triangles((0..count).map(|k| corners.map(|c| c * size(k)))))
    };
    [many, instance_at_origin(sized(count - 1))]
}

/// Answers of the oracle that tests every primitive.
pub fn trace_oracle(oracle: &Oracle, rays: &[Ray]) -> Vec<OracleHit> {
    rays.par_iter().map(|r| oracle.brute_force_closest(r)).collect()
}

/// A tracer's answers, closest hits and any hits, against the truth.
pub fn compare_hits(
    tracer: &Tracer,
    oracle: &Oracle,
    rays: &[Ray],
    truth: &[OracleHit],
    control: &mut dyn Control,
) -> Result<[ParityReport; 2]> {
    let closest = trace(tracer, rays, Mode::Closest, 1, control)?.0;
    let any: Vec<bool> = trace(tracer, rays, Mode::Any, 1, control)?.0.iter().map(Hit::is_hit).collect();
    let occluded: Vec<bool> = truth.iter().map(OracleHit::is_hit).collect();
    let rounding = Rounding::default();
    Ok([judge_closest(oracle, rays, &closest, truth, rounding), judge_any(oracle, rays, &any, &occluded, rounding)])
}

/// The check that goes with [`compare_hits`]: no answer that rounding does not explain.
pub fn parity_check(name: &str, reports: &[ParityReport; 2]) -> Check {
    let [closest, any] = reports;
    let mut sentence =
        format!("of {} rays; {} ties, worst |dt|/t {:.1e}", closest.rays, closest.ties + any.ties, closest.worst_dt);
    if let Some(example) = closest.examples.first().or(any.examples.first()) {
        // writing to a string does not fail
        let _ = write!(sentence, "; ray {} {}: {:?}", example.index, example.reason, example.ray);
    }
    Check::at_most(name, (closest.unexplained + any.unexplained) as f64, "unexplained", 0.0).says(sentence)
}

/// Counts values of ambient occlusion images and auxiliary outputs that are NaN or out of range.
pub fn unsound_values(tracer: &Tracer, scene: &Scene, control: &mut dyn Control) -> Result<usize> {
    let (lo, hi) = scene.bounds().unwrap_or((DVec3::ZERO, DVec3::ONE));
    let camera = CameraRecord::new(&Camera::framing(lo, hi, 1.0), scene.origin(), 1.0);
    let mut bad = 0;
    for falloff in [1.0, 4.0] {
        let options = AoOptions {
            samples: SampleSettings::new([16, 16], 2, 0),
            occlusion: Occlusion::new(f64::INFINITY, falloff),
            ..Default::default()
        };
        let image = ao::render(tracer, &camera, &options, control)?;
        let all = image.image.film.mean.iter().chain(&image.image.film.variance);
        bad += all.filter(|x| !(0.0..=1.0).contains(*x)).count();
    }
    for pixel in aov::render(tracer, &camera, [16, 16], control)? {
        let numbers = [pixel.position, pixel.ng, pixel.ns, [pixel.red, pixel.green, pixel.blue]];
        bad += numbers.as_flattened().iter().filter(|x| !x.is_finite()).count() + usize::from(pixel.depth.is_nan());
    }
    Ok(bad)
}

/// The needs of normals and albedo.
pub const NEEDS: Needs = Needs {
    normals: true,
    albedo: true,
    shading: false,
    white: false,
    compensation: false,
    baked_occlusion: false,
    mip_levels: false,
};

fn full_tracer(setup: &Setup, kind: TracerKind, scene: &Scene) -> Result<Tracer> {
    Tracer::new(setup.device(), kind, &FlatScene::new(scene), NEEDS)
}

fn run(session: &mut StressSession) -> Result<()> {
    let effort = session.setup().effort();
    let kinds = session.setup().tracers();
    let (count, rays) = effort.pick((600, 3000), (4000, 200_000));

    // Every scene comes with rays that are hard for it.
    let empty = Geometry::Triangles(TriangleMesh::default());
    let cases: Vec<(&str, (Scene, Vec<Ray>))> = vec![
        ("triangles without area", without_area(count, rays)),
        ("sizes from 1e-6 to 1e6 in one mesh", scales_together(count, rays)),
        ("coordinates of 1e12", largest_coordinates(count, rays)),
        ("twenty decades of nested triangles", nested(true, true, rays)),
        ("nested and coincident spheres", nested_spheres(rays)),
        ("coordinates as coarse as a thousandth of a box", coarse_coordinates(rays)),
        ("one triangle", {
            let one = instance_at_origin(triangles([[
                DVec3::new(-1.0, 0.0, 0.2),
                DVec3::new(1.0, 0.1, 0.0),
                DVec3::new(0.3, 0.9, -0.4),
            ]]));
            let set = random_rays(&oracle_of(&one), rays, 1);
            (one, set)
        }),
        (
            "an empty mesh",
            (instance_at_origin(empty), (0..1000).map(|i| ray(random_point(i, 0), random_point(i, 3))).collect()),
        ),
    ];

    // Hits agree with the oracle, and images are numbers.
    for (name, (scene, set)) in &cases {
        let oracle = oracle_of(scene);
        let (truth, images) = (trace_oracle(&oracle, set), format!("images: {name}"));
        for kind in &kinds {
            session.measure_these(&[name, &images], Some(*kind), |s, w| {
                let tracer = full_tracer(s, *kind, scene)?;
                let parity = parity_check(name, &compare_hits(&tracer, &oracle, set, &truth, w)?);
                let unsound = unsound_values(&tracer, scene, w)?;
                let values = Check::at_most(images.as_str(), unsound as f64, "values", 0.0);
                Ok(vec![parity, values.says("that are no numbers, or out of range")])
            })?;
        }
    }

    // Needles, coincident triangles and broken files have checks of their own.
    needles(session)?;
    coincident_triangles(session)?;
    one_place(session)?;
    files(session)
}

/// Most samples of a body's image that may see the body itself, if it is convex: none.
pub fn self_occluded(
    tracer: &Tracer,
    scene: &Scene,
    size: u32,
    spp: u32,
    control: &mut dyn Control,
) -> Result<(f64, f64)> {
    let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene("no geometry".into()))?;
    let middle = (lo + hi) * 0.5;
    let camera = Camera::look_at(middle + DVec3::new(0.5, 0.3, 2.0), middle, DVec3::Y, 1.5);
    let options = super::closed_forms::options(size, spp, 1.0, f64::INFINITY);
    let image = super::closed_forms::render(tracer, scene, &camera, &options, control)?;
    Ok(super::closed_forms::samples_off(&image.image.film, image.image.spp, 1.0))
}

/// Thin cylinders, whose triangles are needles, turned. They do not occlude themselves.
pub fn needle_bodies() -> Vec<(String, Scene)> {
    let bodies = [
        ("a thin cylinder", shapes::cylinder(0.035, 4.0, 20)),
        ("a thick cylinder of many faces", shapes::cylinder(0.4, 4.0, 500)),
    ];
    let turned = |(what, geometry): (&str, Geometry)| {
        [0.0, 0.4, 1.2].map(|turn| {
            let place = DAffine3::from_rotation_z(turn) * DAffine3::from_translation(DVec3::new(0.7, 0.3, 0.2));
            (format!("{what}, turned {turn}"), scene_of(vec![(geometry.clone(), vec![place])]))
        })
    };
    bodies.into_iter().flat_map(turned).collect()
}

fn needles(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().tracers(), session.setup().effort());
    for (what, scene) in needle_bodies() {
        let name = format!("needles do not meet themselves: {what}");
        session.measure_each(&name, &kinds, |s, kind, w| {
            let (covered, off) =
                self_occluded(&s.tracer(kind, &scene)?, &scene, effort.pick(64, 256), effort.pick(8, 64), w)?;
            Ok(Check::at_most(name.as_str(), off, "samples", 0.0).says(format!("of {covered}")))
        })?;
    }
    Ok(())
}

/// Seconds that a hard scene may take, to build and to trace, with the compiling of its shaders.
const SECONDS: f64 = 60.0;

/// Bytes of device memory that a primitive or an instance of a hard scene may take.
const BYTES: u64 = 1024;

/// The check of `count` surfaces in one place, by [`coincident`] or [`overlapping`]: hits are those
/// of the second scene, in bounded time and memory.
pub fn check_as_one(
    setup: &Setup,
    kind: TracerKind,
    name: &str,
    count: u32,
    [many, one]: &[Scene; 2],
    watch: &mut Watch,
) -> Result<Check> {
    let start = Instant::now();
    let oracle = Oracle::new(one, DVec3::ZERO);
    // few: a ray that meets one meets them all
    let (most, tests) = setup.effort().pick((500, 20_000_000), (2000, 300_000_000));
    let rays = random_rays(&oracle, most.min(tests / count as usize), 4);
    let truth = oracle.trace_closest(&rays);
    let tracer = setup.tracer(kind, many)?;
    let mut hits = trace(&tracer, &rays, Mode::Closest, 1, watch)?.0;
    // which of them is met is not said: as if all had the first's number
    for h in hits.iter_mut().filter(|h| h.is_hit() && h.primitive < count && h.instance < count) {
        (h.instance, h.primitive) = (0, 0);
    }
    let any: Vec<bool> = trace(&tracer, &rays, Mode::Any, 1, watch)?.0.iter().map(Hit::is_hit).collect();
    let occluded: Vec<bool> = truth.iter().map(OracleHit::is_hit).collect();
    let rounding = Rounding::default();
    let closest = judge_closest(&oracle, &rays, &hits, &truth, rounding);
    let any = judge_any(&oracle, &rays, &any, &occluded, rounding);
    let (seconds, stats) = (start.elapsed().as_secs_f64(), tracer.stats());
    let bytes = (stats.structure_bytes + stats.scene_bytes) / u64::from(count);
    let met = occluded.iter().filter(|&&hit| hit).count();
    let is_bounded = seconds <= SECONDS && bytes <= BYTES && met > 0;
    let value = if is_bounded { (closest.unexplained + any.unexplained) as f64 } else { f64::NAN };
    let sentence = format!(
        "of {} rays, {met} of which meet them; a stack of {}, {bytes} bytes each, {seconds:.1} s",
        closest.rays, stats.stack_entries
    );
    Ok(Check::at_most(name, value, "unexplained", 0.0).says(sentence))
}

fn coincident_triangles(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().tracers(), session.setup().effort());
    for kind in kinds {
        // drivers test them all
        let most = if kind == TracerKind::Compute { 100_000 } else { effort.pick(10_000, 100_000) };
        for count in [3000, most] {
            for (own_vertices, suffix) in [(false, ""), (true, ", vertices of their own")] {
                let name = format!("{count} coincident triangles{suffix}");
                session.measure(&name, Some(kind), |s, w| {
                    check_as_one(s, kind, &name, count, &coincident(count, own_vertices), w)
                })?;
            }
        }
        let name = format!("{most} triangles around one another in a plane");
        session.measure(&name, Some(kind), |s, w| check_as_one(s, kind, &name, most, &overlapping(most, false), w))?;
    }
    Ok(())
}

/// Instances in one place, of a triangle: all alike, and each of its own size.
fn one_place(session: &mut StressSession) -> Result<()> {
    let kinds = session.setup().shading_tracers();
    let count = session.setup().effort().pick(10_000, 1_000_000);
    let one = triangles([[DVec3::new(-1.0, -0.5, 0.1), DVec3::new(1.0, -0.4, -0.2), DVec3::new(0.1, 1.0, 0.3)]]);
    let place = DAffine3::from_scale(DVec3::splat(1.5));
    let scenes = [scene_of(vec![(one.clone(), vec![place; count as usize])]), scene_of(vec![(one, vec![place])])];
    let name = format!("{count} instances in one place");
    session.measure_each(&name, &kinds, |s, kind, w| check_as_one(s, kind, &name, count, &scenes, w))?;
    // as many as a quick run has triangles in one place
    let count = count.max(100_000);
    let name = format!("{count} instances around one another in a plane");
    session.measure_each(&name, &kinds, |s, kind, w| check_as_one(s, kind, &name, count, &overlapping(count, true), w))
}

/// Loads a Wavefront OBJ file of one triangle with these corners.
pub fn triangle_file(corners: [&str; 3]) -> Result<Scene> {
    let dir = tempfile::tempdir().map_err(|e| Error::write("a temporary folder", &e))?;
    let file = dir.path().join("triangle.obj");
    let vertices: String = corners.iter().map(|c| format!("v {c}\n")).collect();
    std::fs::write(&file, vertices + "f 1 2 3\n").map_err(|e| Error::write(&file, &e))?;
    load::load(&file.to_string_lossy())
}

/// Files with extreme corners, and whether they must be refused.
pub const FILES: &[(&str, [&str; 3], bool)] = &[
    ("NaN", ["nan 0 0", "1 0 0", "0 1 0"], true),
    ("infinity", ["inf 0 0", "1 0 0", "0 1 0"], true),
    ("1e38", ["1e38 0 0", "0 1e38 0", "0 0 1e38"], true),
    ("1e39, which overflows", ["1e39 0 0", "0 1 0", "0 0 1"], true),
    ("1e12", ["1e12 0 0", "0 1e12 0", "0 0 1e12"], false),
    ("2e-12", ["2e-12 0 0", "0 2e-12 0", "0 0 2e-12"], false),
    ("1e-30", ["1e-30 0 0", "0 1e-30 0", "0 0 1e-30"], true),
    ("denormal 1e-40", ["1e-40 0 0", "0 1e-40 0", "0 0 1e-40"], true),
];

/// The right answer, or an error that names the file: files that load must render to numbers.
pub fn check_file(
    setup: &Setup,
    kind: TracerKind,
    name: &str,
    file: Result<Scene>,
    must_fail: bool,
    watch: &mut Watch,
) -> Result<Check> {
    let bad = match file {
        Err(e @ (Error::Input { .. } | Error::Scene(_))) => {
            return Ok(Check::at_most(name, 0.0, "values", 0.0).says(format!("refused: {e}")));
        }
        Err(e) => return Err(e),
        Ok(_) if must_fail => return Ok(Check::failed(name, "loaded, and should have been refused")),
        Ok(scene) => unsound_values(&full_tracer(setup, kind, &scene)?, &scene, watch)?,
    };
    Ok(Check::none_of(name, bad as u64, "values", true).says("loaded; values of its images that are no numbers"))
}

fn files(session: &mut StressSession) -> Result<()> {
    let kinds = session.setup().tracers();
    for &(what, corners, must_fail) in FILES {
        let name = format!("a file with coordinates of {what}");
        let one = if must_fail { &kinds[..1] } else { &kinds[..] };
        for kind in one {
            session.measure(&name, Some(*kind), |s, w| {
                // the message names a temporary file
                let check = check_file(s, *kind, &name, triangle_file(corners), must_fail, w)?;
                let sentence = match check.sentence.split_once("triangle.obj: ") {
                    Some((_, why)) if check.sentence.starts_with("refused") => format!("refused: {why}"),
                    _ => check.sentence.clone(),
                };
                Ok(check.says(sentence))
            })?;
        }
    }
    Ok(())
}
