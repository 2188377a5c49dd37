//! The integrator `lit`: direct light plus ambient light times ambient occlusion and albedo.

use super::*;
use skylit::integrators::ao::{self, AoOptions, Occlusion};
use skylit::integrators::path::ambient::{self, Ambient, AmbientSample, OccludedLight};
use skylit::scene::builtin::{self, SceneTransform, analytic, shapes};
use skylit::scene::material::Transmission;

const SIZE: [u32; 2] = [32, 24];

fn ambient(color: Vec3, radius: f64, falloff: f64) -> Ambient {
    Ambient { color, occlusion: Occlusion::new(radius, falloff), occluded: OccludedLight::Ambient }
}

/// What the integrator makes of these settings.
fn lit(spp: u32, ambient: Ambient) -> PathOptions {
    PathOptions {
        samples: SampleSettings::new(SIZE, spp, 5),
        max_depth: 1,
        ambient: Some(ambient),
        ..Default::default()
    }
}

/// A floor that fills the view, without any light.
fn floor(material: Material) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 4.0, 1.0), DVec3::ZERO, DVec3::Y, 0.6);
    Scene { environment: Environment::Black, ..scene_of(vec![(shapes::floor(DVec3::ZERO, 40.0), material)], camera) }
}

fn on_all_tracers(scene: &Scene, claim: impl Fn(TracerKind, &Tracer, &FlatScene)) {
    let device = device();
    let flat = FlatScene::for_paths(scene);
    for kind in tracers(&device) {
        claim(kind, &tracer(&device, kind, &flat), &flat);
    }
    assert_validation_clean(&device);
}

fn assert_everywhere(what: &str, mean: &[f32], expected: Vec3) {
    for (k, v) in mean.iter().enumerate() {
        let wanted = expected[k % 3];
        assert!((v - wanted).abs() <= 2e-6 * wanted.abs(), "{what}: value {k} is {v}, not {wanted}");
    }
}

#[test]
fn gpu_lit_an_open_plane_reflects_its_albedo() {
    let colour = Vec3::new(1.0, 0.5, 0.25);
    for (albedo, settings) in [(1.0, ambient(Vec3::ONE, f64::INFINITY, 1.0)), (0.6, ambient(colour, 2.0, 3.0))] {
        on_all_tracers(&floor(matte(albedo)), |kind, tracer, flat| {
            let film = render(tracer, flat, &lit(8, settings)).image.film;
            assert_everywhere(&kind.to_string(), &film.mean, albedo * settings.color);
        });
    }
}

/// The same bits.
#[test]
fn gpu_lit_without_ambient_light_is_direct_light() {
    on_all_tracers(&builtin::by_name("cornell-box").unwrap(), |kind, tracer, flat| {
        let options = lit(8, ambient(Vec3::ZERO, f64::INFINITY, 1.0));
        let direct = PathOptions { ambient: None, ..options.clone() };
        let [ours, theirs] = [options, direct].map(|o| render(tracer, flat, &o).image.film.mean);
        assert!(ours == theirs, "{kind}");
    });
}

/// Larsen's (2019) shading times (1 - AO): direct light, darkened by the ambient visibility of the same point.
#[test]
fn gpu_lit_occlusion_can_darken_all_light() {
    on_all_tracers(&builtin::by_name("cornell-box").unwrap(), |kind, tracer, flat| {
        let dark = ambient(Vec3::ZERO, 0.3, 1.0);
        // at pixel centres both are constant over a pixel, and samples of both are independent
        let options = lit(1024, dark).with_samples(|s| s.pixel_filter = path::PixelFilter::Centre);
        let all = PathOptions { ambient: Some(Ambient { occluded: OccludedLight::All, ..dark }), ..options.clone() };
        let [all, direct] = [all, options].map(|o| render(tracer, flat, &o).image.film.mean);
        let record = CameraRecord::new(&flat.scene.cameras[0], flat.origin, f64::from(SIZE[0]) / f64::from(SIZE[1]));
        let ao = AoOptions {
            samples: SampleSettings { pixel_filter: path::PixelFilter::Centre, ..SampleSettings::new(SIZE, 1024, 6) },
            occlusion: Occlusion::new(0.3, 1.0),
            ..Default::default()
        };
        let visible = ao::render(tracer, &record, &ao, &mut NoControl).unwrap().image.film.mean;
        let (mut darkened, mut sum) = (0, 0.0);
        for (k, (all, direct)) in all.iter().zip(&direct).enumerate() {
            let v = visible[k / 3];
            assert!(
                (all - v * direct).abs() <= 0.08 * direct + 1e-4,
                "{kind}: value {k} is {all}, not {v} of {direct}"
            );
            darkened += usize::from(v < 0.9 && *direct > 0.0);
            sum += f64::from(all - v * direct);
        }
        assert!(darkened > 100 && sum.abs() < 0.1, "{kind}: {darkened} values darkened, {sum}");
    });
}

/// In a scene of one albedo without light: what the integrator `ao` renders, sample by sample where occlusion is binary, on average where it falls off.
#[test]
fn gpu_lit_without_lights_is_ao_times_albedo_times_ambient() {
    let mut groove = analytic::v_groove(1.2, 3.0, 8.0, SceneTransform::default());
    groove.environment = Environment::Black;
    groove.materials.iter_mut().for_each(|m| *m = matte(0.5));
    let colour = Vec3::new(2.0, 1.0, 0.5);
    on_all_tracers(&groove, |kind, tracer, flat| {
        let record = CameraRecord::new(&flat.scene.cameras[0], flat.origin, f64::from(SIZE[0]) / f64::from(SIZE[1]));
        for (radius, falloff) in [(f64::INFINITY, 1.0), (1.5, 1.0), (f64::INFINITY, 2.0), (2.0, 1.5)] {
            let spp = if falloff > 1.0 { 64 } else { 8 };
            let options = AoOptions {
                samples: SampleSettings::new(SIZE, spp, 5),
                occlusion: Occlusion::new(radius, falloff),
                ..Default::default()
            };
            let visibility = ao::render(tracer, &record, &options, &mut NoControl).unwrap().image.film;
            let result = render(tracer, flat, &lit(spp, ambient(colour, radius, falloff)));
            let film = result.image.film;
            assert!(result.ambient_rays > 0 && result.shadow_rays == 0, "{kind}: {}", result.ambient_rays);
            let what = format!("{kind}, radius {radius}, falloff {falloff}");
            let expected = |k: usize| 0.5 * colour[k % 3] * visibility.mean[k / 3];
            if falloff == 1.0 {
                for (k, v) in film.mean.iter().enumerate() {
                    assert!((v - expected(k)).abs() < 1e-5, "{what}: {v}, {} expected", expected(k));
                }
            } else {
                let n = film.mean.len() as f64;
                let mean = film.mean.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
                let wanted = (0..film.mean.len()).map(|k| f64::from(expected(k))).sum::<f64>() / n;
                let (_, error) = film.mean_and_error();
                // the three channels of a sample have one ray
                assert!(
                    (mean - wanted).abs() < 4.5 * 3f64.sqrt() * error,
                    "{what}: {mean} +- {error}, {wanted} expected"
                );
                assert!(error < 0.01 * wanted, "{what}: {error} says nothing");
            }
        }
    });
}

/// Emitters add what they reflect; mirrors and glass show no ambient light, and a surface that transmits half of what it does not reflect shows half.
#[test]
fn gpu_lit_surfaces_that_do_not_scatter_show_no_ambient_light() {
    let white = ambient(Vec3::ONE, f64::INFINITY, 1.0);
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::ONE, ..Material::default() };
    let glass = Material {
        kind: MaterialKind::Glass,
        specular_color: Vec3::ONE,
        transmittance: Vec3::ONE,
        ..Material::default()
    };
    let glowing = Material { emissive: Vec3::splat(3.0), ..matte(0.25) };
    let unlit = Material { unlit: true, ..matte(0.25) };
    let transmission = Transmission { factor: 0.5, ..Default::default() };
    let wall =
        Material { roughness: 1.0, base_color: Vec3::splat(0.8).extend(1.0), transmission, ..Material::default() };
    for (what, material, expected) in [
        ("mirror", mirror, 0.0),
        ("glass", glass, 0.0),
        ("emitter", glowing, 3.25),
        ("unlit", unlit, 0.25),
        ("thin wall", wall, 0.4),
    ] {
        let scene = floor(material);
        let flat = FlatScene::for_paths(&scene);
        for kind in picked(&device()) {
            let film = render(&tracer(&device(), kind, &flat), &flat, &lit(4, white)).image.film;
            assert_everywhere(&format!("{what}, {kind}"), &film.mean, Vec3::splat(expected));
        }
    }
    assert_validation_clean(&device());
}

/// The environment as background: it is seen, and lights nothing.
#[test]
fn gpu_lit_an_environment_can_be_background_only() {
    let camera = Camera::look_at(DVec3::new(0.0, 1.0, 4.0), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, 1.2);
    let mut scene = scene_of(vec![(shapes::floor(DVec3::ZERO, 1000.0), matte(0.5))], camera);
    scene.environment = Environment::Uniform(Vec3::splat(2.0));
    on_all_tracers(&scene, |kind, tracer, flat| {
        for (background_only, expected) in [(true, 0.75), (false, 1.75)] {
            let options = PathOptions { background_only, ..lit(64, ambient(Vec3::splat(1.5), f64::INFINITY, 1.0)) };
            let film = render(tracer, flat, &options).image.film;
            let row = |y: usize| film.mean[3 * SIZE[0] as usize * y];
            let what = format!("{kind}, background only {background_only}");
            assert!(row(0) == 2.0, "{what}: background {}", row(0));
            assert!((row(SIZE[1] as usize - 1) - expected).abs() < 1e-3, "{what}: floor {}", row(SIZE[1] as usize - 1));
        }
    });
}

/// Tracers make one image of it; scenes with alpha, mirrors and glass included.
#[test]
fn gpu_lit_tracers_agree() {
    for name in ["cornell-glass-sphere", "leaf-cards", "stairs"] {
        let scene = builtin::by_name(name).unwrap();
        let images = std::cell::RefCell::new(Vec::new());
        on_all_tracers(&scene, |kind, tracer, flat| {
            let (lo, hi) = scene.bounds().unwrap();
            let options = lit(16, ambient(Vec3::ONE, 0.2 * (hi - lo).length(), 1.0));
            images.borrow_mut().push((kind, render(tracer, flat, &options).image.film.mean));
        });
        let images = images.into_inner();
        for (kind, image) in &images[1..] {
            let apart = image.iter().zip(&images[0].1).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
            assert!(
                apart * 100 <= image.len(),
                "{name}: {kind} and {} differ in {apart} of {} values",
                images[0].0,
                image.len()
            );
        }
        assert!(images[0].1.iter().any(|v| *v > 0.05), "{name}: black");
    }
}

/// Distances of occlusion rays say what an image of any radius and falloff would be.
#[test]
fn gpu_lit_distances_make_the_image() {
    let names = ["leaf-cards", "cornell-box"];
    for &name in if common::is_full() { &names[..] } else { &names[..1] } {
        let mut scene = builtin::by_name(name).unwrap();
        // no light but the ambient one
        scene.environment = Environment::Black;
        scene.lights.clear();
        scene.materials.iter_mut().for_each(|m| m.emissive = Vec3::ZERO);
        let (lo, hi) = scene.bounds().unwrap();
        let radius = 0.15 * (hi - lo).length();
        on_all_tracers(&scene, |kind, tracer, flat| {
            let record = CameraRecord::new(&scene.cameras[0], flat.origin, f64::from(SIZE[0]) / f64::from(SIZE[1]));
            let settings = ambient(Vec3::ONE, radius, 1.0);
            let options = lit(20, settings);
            let film = render(tracer, flat, &options).image.film;
            let mut samples = vec![Vec::<AmbientSample>::new(); (SIZE[0] * SIZE[1]) as usize];
            ambient::trace(tracer, flat, &record, &options, &mut NoControl, &mut |at, of| samples[at].extend(of))
                .unwrap();
            assert!(samples.iter().all(|s| s.len() == 20), "{kind}");
            assert!(
                samples.iter().flatten().any(|s| f64::from(s.distance) > 2.0 * radius && s.distance.is_finite()),
                "{kind}"
            );
            let mut apart = 0;
            for (k, v) in film.mean.iter().enumerate() {
                let open = |s: &&AmbientSample| f64::from(s.distance) >= radius;
                let sum: f32 = samples[k / 3].iter().filter(open).map(|s| s.reflectance[k % 3]).sum();
                apart += u32::from((v - sum / 20.0).abs() > 1e-5);
            }
            // rays that end at the radius or go on are different rays to a tracer: rounding at edges
            assert!(apart * 200 <= film.mean.len() as u32, "{name}, {kind}: {apart} of {} values", film.mean.len());
        });
    }
}
