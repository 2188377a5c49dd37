//! Section 6, sampling: furnaces over roughness, extreme environment maps and lights. No sample may
//! be NaN or infinite: the film counts those and rejects them, in every render.

use glam::{DAffine3, DVec3, Vec3};

use super::{Check, Effort, Section, Setup, StressSession, Watch};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::Film;
use crate::film::SampleSettings;
use crate::film::camera::CameraRecord;
use crate::integrators::path::{self, PathOptions, PathResult};
use crate::oracle::camera::camera_ray;
use crate::scene::builtin::shapes;
use crate::scene::material::MaterialKind;
use crate::scene::{Camera, Environment, EnvironmentMap, Geometry, Instance, Light, LightKind, Material, Mesh, Scene};
use crate::tracer::{Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "sampling",
    title: "Sampling",
    about: "furnaces over roughness, maps with one texel of 1e6, black and 1x1 maps, lights without size or power, and 100,000 of them",
    of_scene: false,
    run,
};

/// A scene of shapes with a material each.
pub fn scene_of(parts: Vec<(Geometry, Material)>, camera: Camera) -> Scene {
    let mut scene = Scene { cameras: vec![camera], ..Scene::default() };
    parts.into_iter().for_each(|(geometry, material)| add(&mut scene, geometry, material));
    scene
}

/// Adds a shape with a material of its own.
pub fn add(scene: &mut Scene, geometry: Geometry, material: Material) {
    let k = scene.meshes.len();
    scene.meshes.push(Mesh { name: format!("mesh {k}"), geometry, material: scene.materials.len(), source: None });
    scene.materials.push(material);
    scene.instances.push(Instance { name: format!("mesh {k}"), mesh: k, object_to_world: DAffine3::IDENTITY });
}

/// Diffuse, without emission.
pub fn matte(albedo: f32) -> Material {
    Material { kind: MaterialKind::Matte, base_color: Vec3::splat(albedo).extend(1.0), ..Material::default() }
}

/// Emits, and reflects nothing.
pub fn emitter(radiance: f32) -> Material {
    Material { emissive: Vec3::splat(radiance), ..matte(0.0) }
}

/// Glass that absorbs nothing.
pub fn glass(roughness: f32, ior: f32) -> Material {
    let (specular_color, transmittance) = (Vec3::ONE, Vec3::ONE);
    Material { kind: MaterialKind::Glass, specular_color, transmittance, roughness, ior, ..Material::default() }
}

/// A sphere of `scale` units that fills the view, in an environment of radiance 1.
pub fn furnace(scale: f64, material: Material) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 2.0 * scale), DVec3::ZERO, DVec3::Y, 0.9);
    Scene {
        environment: Environment::Uniform(Vec3::ONE),
        ..scene_of(vec![(shapes::sphere(DVec3::ZERO, scale), material)], camera)
    }
}

/// Mean over all pixels and channels, and its standard error from independent pixels.
pub fn mean_of(film: &Film) -> (f64, f64) {
    let means: Vec<f64> = film.mean.chunks(3).map(|p| p.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0).collect();
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Path-traces a scene through its first camera.
pub fn render(tracer: &Tracer, flat: &FlatScene, options: &PathOptions, watch: &mut Watch) -> Result<PathResult> {
    let aspect = f64::from(options.samples.size[0]) / f64::from(options.samples.size[1]);
    path::render(tracer, flat, &CameraRecord::new(&flat.scene.cameras[0], flat.origin, aspect), options, watch)
}

/// Standard errors within which noise alone leaves an image's mean.
const ERRORS: f64 = 4.5;

/// The check of an image of known mean, within noise and a relative `rounding`, of finite samples.
#[expect(clippy::too_many_arguments, reason = "a case is all of these")]
pub fn check_mean(
    setup: &Setup,
    kind: TracerKind,
    name: &str,
    scene: &Scene,
    options: &PathOptions,
    expected: f64,
    rounding: f64,
    watch: &mut Watch,
) -> Result<Check> {
    let flat = FlatScene::for_paths(scene);
    let film = render(&super::scale::path_tracer(setup, kind, &flat)?, &flat, options, watch)?.image.film;
    Ok(held_mean(name, &film, expected, rounding))
}

/// See [`check_mean`].
pub fn held_mean(name: &str, film: &Film, expected: f64, rounding: f64) -> Check {
    let (mean, error) = mean_of(film);
    let value = if film.not_finite > 0 { f64::NAN } else { (mean - expected).abs() };
    let bound = ERRORS * error + rounding * expected.abs();
    let lost =
        if film.not_finite > 0 { format!("; {} samples are not finite", film.not_finite) } else { String::new() };
    Check::at_most(name, value, "of radiance", bound)
        .says(format!("mean {mean:.6}, expected {expected:.6}, standard error {error:.1e}{lost}"))
}

/// Samples of a film that are not finite, and values of it that are not numbers.
pub fn not_finite(film: &Film) -> u64 {
    let bad = |values: &[f32]| values.iter().filter(|v| !v.is_finite()).count() as u64;
    film.not_finite + bad(&film.mean) + bad(&film.variance) + bad(&film.coverage)
}

/// An equirectangular map; `texel(x, y)` is the radiance of a texel.
pub fn map(width: u32, height: u32, texel: impl Fn(u32, u32) -> f32) -> Environment {
    let radiance = (0..width * height).map(|k| Vec3::splat(texel(k % width, k / width))).collect();
    Environment::Map(EnvironmentMap::new("map", [width, height], radiance))
}

/// Mean radiance of [`furnace`] with white plastic as smooth as a mirror, in `size` by `size`
/// pixels, by quadrature in f64 (glTF 2.0, appendix B). The model gains at grazing angles.
pub fn smooth_plastic_furnace(size: u32) -> f64 {
    let fresnel = |cos: f64| 0.04 + 0.96 * (1.0 - cos).powi(5);
    let albedo = |cos_o: f64| {
        let (sin_o, n) = ((1.0 - cos_o * cos_o).max(0.0).sqrt(), 32);
        let mut base = 0.0;
        for i in 0..n {
            for j in 0..n {
                let (u, v) = ((f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n));
                let (cos_i, sin_i) = ((1.0 - u).sqrt(), u.sqrt());
                let between = sin_i * (std::f64::consts::TAU * v).cos() * sin_o + cos_i * cos_o;
                base += (1.0 - fresnel(((1.0 + between) * 0.5).max(0.0).sqrt())) / f64::from(n * n);
            }
        }
        fresnel(cos_o) + base
    };
    let scene = furnace(1.0, Material::default());
    let pixels = (0..size * size).map(|k| [f64::from(k % size) + 0.5, f64::from(k / size) + 0.5]);
    let seen = pixels.map(|film| {
        let ray = camera_ray(&scene.cameras[0], DVec3::ZERO, [size, size], film);
        let (d, b) = (ray.direction.normalize(), ray.origin.dot(ray.direction.normalize()));
        let discriminant = b * b - ray.origin.length_squared() + 1.0;
        if discriminant < 0.0 { 1.0 } else { albedo(-(ray.origin - d * (b + discriminant.sqrt())).dot(d)) }
    });
    seen.sum::<f64>() / f64::from(size * size)
}

fn run(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().shading_tracers(), session.setup().effort());
    let options = |spp: u32| PathOptions { samples: SampleSettings::new([16, 16], spp, 3), ..Default::default() };
    let (few, many) = (effort.pick(16, 1024), effort.pick(64, 16_384));

    // Mirrors and glass conserve energy.
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::ONE, ..Material::default() };
    let mut exact = vec![("mirror".to_owned(), mirror, few)];
    exact.extend([1.33, 1.5, 2.4].map(|ior| (format!("glass, index {ior}"), glass(0.0, ior), many)));
    for (what, material, spp) in exact {
        let (name, scene) = (format!("furnace, {what}"), furnace(1.0, material));
        session.measure_each(&name, &kinds, |s, kind, w| {
            check_mean(s, kind, &name, &scene, &options(spp), 1.0, 2e-6, w)
        })?;
    }

    // Nearly smooth plastic has a closed form.
    let smooth = smooth_plastic_furnace(16);
    for roughness in [1e-4f32, 1e-3, 1e-2] {
        let name = format!("furnace, plastic of roughness {roughness:e}");
        let scene = furnace(1.0, Material { roughness, ..Material::default() });
        session.measure_each(&name, &kinds, |s, kind, w| {
            check_mean(s, kind, &name, &scene, &options(many), smooth, 1e-3, w)
        })?;
    }

    // Rough metal loses light between microfacets; glTF's coated plastic gains at grazing angles.
    for roughness in [1e-4f32, 1e-3, 1e-2, 0.1, 0.5, 1.0] {
        for (metal, metallic, most) in [("metal", 1.0f32, 1.0), ("plastic", 0.0, smooth)] {
            if metallic == 0.0 && roughness < 0.1 {
                continue;
            }
            let name = format!("furnace, {metal} of roughness {roughness:e}");
            let scene = furnace(1.0, Material { metallic, roughness, ..Material::default() });
            session.measure_each(&name, &kinds, |s, kind, w| {
                let flat = FlatScene::for_paths(&scene);
                let film = render(&super::scale::path_tracer(s, kind, &flat)?, &flat, &options(many), w)?.image.film;
                let (mean, error) = mean_of(&film);
                let value = if not_finite(&film) > 0 { f64::NAN } else { mean };
                Ok(Check::at_most(name.as_str(), value, "of radiance", most + ERRORS * error + 2e-6)
                    .says(format!("standard error {error:.1e}: nothing is gained")))
            })?;
        }
    }
    environments(session, &kinds, &options(few))?;
    lights(session, &kinds, &options(few))
}

fn environments(session: &mut StressSession, kinds: &[TracerKind], options: &PathOptions) -> Result<()> {
    let lit = |environment: Environment| Scene { environment, ..furnace(1.0, matte(1.0)) };
    let full = session.setup().effort().pick(1024, 16_384);
    let mut cases = vec![
        ("a black map", lit(map(8, 4, |_, _| 0.0)), 0.0),
        ("a map of one texel", lit(map(1, 1, |_, _| 1.0)), 1.0),
        ("a map of two rows, very wide", lit(map(full, 2, |_, _| 1.0)), 1.0),
    ];
    if session.setup().effort() == Effort::Full {
        // the largest that is read; columns differ, so that light samples have a choice
        cases.push(("a map of 16384x8192", lit(map(16_384, 8192, |x, _| if x % 2 == 0 { 0.5 } else { 1.5 })), 1.0));
    }
    for (what, scene, expected) in &cases {
        let name = format!("furnace in {what}");
        session
            .measure_each(&name, kinds, |s, kind, w| check_mean(s, kind, &name, scene, options, *expected, 1e-5, w))?;
    }
    // one texel of 1e6 in a map of 1: two seeds find the same light, and nothing overflows
    for (what, x, y) in [("at the pole", 3, 0), ("at the horizon", 17, 16)] {
        let name = format!("a map with one texel of 1e6, {what}");
        let scene = lit(map(64, 32, |i, j| if (i, j) == (x, y) { 1e6 } else { 1.0 }));
        session.measure_each(&name, kinds, |s, kind, w| {
            let flat = FlatScene::for_paths(&scene);
            let tracer = super::scale::path_tracer(s, kind, &flat)?;
            let film = render(&tracer, &flat, options, w)?.image.film;
            let other = render(&tracer, &flat, &options.clone().with_samples(|s| s.seed = 8), w)?.image.film;
            let ((a, e), (b, f)) = (mean_of(&film), mean_of(&other));
            let value = if not_finite(&film) + not_finite(&other) > 0 { f64::NAN } else { (a - b).abs() };
            let bound = ERRORS * e.hypot(f) + 2e-6 * a;
            Ok(Check::at_most(name.as_str(), value, "of radiance", bound)
                .says(format!("between two seeds; means {a:.3} and {b:.3}")))
        })?;
    }
    Ok(())
}

fn lights(session: &mut StressSession, kinds: &[TracerKind], options: &PathOptions) -> Result<()> {
    let [albedo, reflected] = [0.6f64, 0.6 / std::f64::consts::PI];
    let floor = |lights: Vec<Light>| {
        let camera = Camera::look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
        Scene { lights, ..scene_of(vec![(shapes::floor(DVec3::ZERO, 10.0), matte(albedo as f32))], camera) }
    };
    let at = DVec3::new(0.6, 0.8, 0.0);
    let point = |position: DVec3, intensity: f64| Light {
        name: String::new(),
        kind: LightKind::Point,
        intensity: Vec3::splat(intensity as f32),
        position,
        direction: DVec3::NEG_Y,
        range: f64::INFINITY,
    };
    let count = 100_000;
    let many = (0..count).map(|_| point(at, 3.0 / f64::from(count))).collect();
    let cases = [
        ("a light without power", floor(vec![point(at, 0.0)]), 0.0),
        ("100,000 lights in one place", floor(many), reflected * 3.0 * 0.8),
        ("a light of 1e-30", floor(vec![point(at, 1e-30)]), reflected * 1e-30 * 0.8),
        ("a light of 1e30", floor(vec![point(at, 1e30)]), reflected * 1e30 * 0.8),
    ];
    for (what, scene, expected) in &cases {
        session
            .measure_each(what, kinds, |s, kind, w| check_mean(s, kind, what, scene, options, *expected, 1e-5, w))?;
    }
    // what is near or small is counted alone: the camera's pixels do not see the same everywhere
    let mut dot = floor(Vec::new());
    add(&mut dot, shapes::sphere(at, 1e-20), emitter(1e6));
    let near = floor(vec![point(DVec3::new(1e-4, 1e-6, 0.0), 1.0)]);
    for (what, scene) in [("an emitting sphere of radius 1e-20", dot), ("a light 1e-6 over the floor", near)] {
        session.measure_each(what, kinds, |s, kind, w| {
            let flat = FlatScene::for_paths(&scene);
            let film = render(&super::scale::path_tracer(s, kind, &flat)?, &flat, options, w)?.image.film;
            Ok(Check::at_most(what, not_finite(&film) as f64, "values", 0.0).says("that are not finite"))
        })?;
    }
    Ok(())
}
