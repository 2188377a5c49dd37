//! Ambient occlusion against path tracing: what must be found where it is known, and a search by rendering every image.

#[path = "common/mod.rs"]
mod common;

use common::assert_validation_clean;
use glam::{DVec3, Vec3};
use skylit::Renderer;
use skylit::compare::ao_versus_path::{self, AoVersusPath, AoVersusPathSettings, FitRecord};
use skylit::film::NoControl;
use skylit::integrators::path::ambient::EnvironmentLight;
use skylit::renderer::RenderSettings;
use skylit::scene::builtin::{self, SceneTransform, analytic};
use skylit::scene::material::MaterialKind;
use skylit::scene::{Environment, Scene};
use skylit::settings::Length;
use skylit::tracer::DeviceSettings;

fn renderer(scene: Scene) -> Renderer {
    let device = common::device();
    Renderer::new(device, scene, &DeviceSettings::default()).unwrap()
}

fn compare(renderer: &mut Renderer, settings: &AoVersusPathSettings) -> AoVersusPath {
    ao_versus_path::run(renderer, settings, &mut NoControl).unwrap()
}

fn explained(fit: &FitRecord, name: &str) -> f64 {
    fit.rows.iter().find(|r| r.name == name).unwrap_or_else(|| panic!("no row {name}")).explained
}

/// Dark surfaces under a sky of one colour: light arrives after one bounce, and ambient occlusion without a limit is the truth.
#[test]
fn gpu_ambient_occlusion_of_dark_surfaces_is_the_truth() {
    let sky = Vec3::new(0.3, 0.6, 0.9);
    let mut scene = analytic::sphere_over_plane(1.0, 1.25, 60.0, SceneTransform::default());
    scene.environment = Environment::Uniform(sky);
    for material in &mut scene.materials {
        (material.kind, material.base_color) = (MaterialKind::Matte, Vec3::splat(0.002).extend(1.0));
    }
    let mut renderer = renderer(scene);
    let settings =
        AoVersusPathSettings { size: [64, 48], spp: 64, ao_samples: 64, sky_albedo: Some(0.002), ..Default::default() };
    let found = compare(&mut renderer, &settings).report;
    let fit = &found.path[0];
    println!("{:#?}", fit.rows);
    assert_eq!(fit.environment_light, Some(EnvironmentLight::Ambient));
    assert!(explained(fit, "AO without radius or falloff") > 0.9995);
    // the sphere of radius 1 is the only occluder: beyond a distance of ten it hides less than a hundredth of the hemisphere
    assert!(fit.best.radius.is_none_or(|r| r > 10.0) && fit.best.falloff < 1.01, "{:?}", fit.best);
    for (found, known) in fit.best.ambient.iter().zip(sky.to_array()) {
        assert!((found / f64::from(known) - 1.0).abs() < 0.01, "{:?}", fit.best);
    }
    // the floor under the sphere is darker, and no ambient colour makes up for that
    assert!(explained(fit, "ambient light without occlusion") < 0.999);
    let sky = found.sky.unwrap();
    assert!(explained(&sky, "AO without radius or falloff, as it is") > 0.9995, "{:#?}", sky.rows);
    assert!((found.light.environment - 1.0).abs() < 0.02 && found.light.lights == 0.0, "{:?}", found.light);
    assert_validation_clean(renderer.device());
}

/// The figures of a scene with everything: parts add up, what is allowed more is not worse, and the best image is what the integrator `lit` renders.
#[test]
fn gpu_figures_fit_together() {
    let mut renderer = renderer(builtin::by_name("cornell-box").unwrap());
    let settings = AoVersusPathSettings { size: [64, 64], spp: 64, ao_samples: 128, ..Default::default() };
    let AoVersusPath { report, image, .. } = compare(&mut renderer, &settings);
    assert_eq!(report.path.len(), 1, "there is no environment");
    for fit in report.path.iter().chain(&report.sky) {
        println!("{:?}: {:#?}\n{:?}", fit.environment_light, fit.rows, fit.best);
        let least = fit.binary.rmse.min(fit.falloff.rmse);
        assert!(fit.both.rmse <= least * (1.0 + 1e-9), "{:?}", fit.both);
        let flat = if fit.parts.is_some() { "ambient light without occlusion" } else { "the same everywhere" };
        assert!(explained(fit, "AO with the best radius") >= explained(fit, flat) - 1e-9);
        assert!(fit.curves[0].rmse.iter().all(|e| *e >= 0.999 * fit.binary.rmse), "{:?}", fit.curves[0]);
        if let Some(parts) = &fit.parts {
            let sum = parts.transport + parts.occlusion + parts.cross;
            assert!((sum - fit.best.rmse.powi(2)).abs() < 1e-3 * sum, "{parts:?}, {}", fit.best.rmse);
        }
    }
    // bounces in a white room light it evenly: some ambient light explains most of it
    let fit = &report.path[0];
    assert!(explained(fit, "AO with the best radius and falloff") > 0.5);
    assert!(report.light.bounces > 0.1 && (report.light.lights + report.light.bounces - 1.0).abs() < 1e-9);
    let mut lit = RenderSettings { integrator: Some("lit".parse().unwrap()), ..Default::default() };
    (lit.image.size, lit.image.spp, lit.image.seed) = (Some([64, 64]), Some(128), Some(77));
    (lit.integrators.ao.ao_radius, lit.integrators.ao.ao_falloff) =
        (Some(Length::Units(fit.best.radius.unwrap_or(f64::INFINITY))), Some(fit.best.falloff));
    lit.integrators.path.ambient = Some(DVec3::from_slice(&fit.best.ambient));
    let rendered = renderer.still(&lit, &mut NoControl).unwrap().image;
    for name in ["R", "G", "B"] {
        let (a, b) = (image.f32(name).unwrap(), rendered.f32(name).unwrap());
        let mean = |v: &[f32]| v.iter().map(|v| f64::from(*v)).sum::<f64>() / v.len() as f64;
        assert!((mean(a) / mean(b) - 1.0).abs() < 0.01, "{name}: {} and {}", mean(a), mean(b));
        let apart = a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 0.1 * **b + 0.05).count();
        assert!(apart * 20 < a.len(), "{name}: {apart} of {} pixels", a.len());
    }
    assert_validation_clean(renderer.device());
}

/// The best radius of a search that renders an image for each radius, with the same samples.
fn dense_search(renderer: &mut Renderer, compared: &AoVersusPathSettings, radii: &[f64]) -> f64 {
    let mut render = |name: &str, half: u32, samples: u32, change: &dyn Fn(&mut RenderSettings)| -> Vec<f32> {
        let mut settings = RenderSettings { integrator: Some(name.parse().unwrap()), ..Default::default() };
        (settings.camera, settings.lighting) = (compared.camera.clone(), compared.lighting.clone());
        settings.image.size = Some(compared.size);
        (settings.image.spp, settings.image.seed) = (Some(samples), Some(2 * compared.seed + half));
        change(&mut settings);
        let image = renderer.still(&settings, &mut NoControl).unwrap().image;
        let planes = ["R", "G", "B"].map(|c| image.f32(c).unwrap().to_vec());
        let covered = image.f32("A").unwrap();
        (0..covered.len()).flat_map(|p| [0, 1, 2].map(|c| if covered[p] > 0.0 { planes[c][p] } else { 0.0 })).collect()
    };
    let minus = |a: Vec<f32>, b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a - b)).collect::<Vec<f64>>();
    let lit = |ambient: f64, radius: f64| {
        move |s: &mut RenderSettings| {
            s.integrators.path.ambient = Some(DVec3::splat(ambient));
            s.integrators.path.environment_light = Some(EnvironmentLight::Ambient);
            s.integrators.ao.ao_radius = Some(Length::Units(radius));
        }
    };
    let target = [0, 1].map(|half| {
        let path = render("path", half, compared.spp / 2, &|_| {});
        minus(path, &render("lit", half, compared.spp / 2, &lit(0.0, f64::INFINITY)))
    });
    let none = [0, 1].map(|half| render("lit", half, compared.ao_samples / 2, &lit(0.0, f64::INFINITY)));
    let mut explained = |radius: f64| -> f64 {
        let signal = [0usize, 1]
            .map(|half| minus(render("lit", half as u32, compared.ao_samples / 2, &lit(1.0, radius)), &none[half]));
        let sum = |c: usize, a: &[f64], b: &[f64]| a.iter().zip(b).skip(c).step_by(3).map(|(a, b)| a * b).sum::<f64>();
        (0..3)
            .map(|c| {
                let xg = 0.5 * (sum(c, &signal[0], &target[1]) + sum(c, &signal[1], &target[0]));
                xg * xg / sum(c, &signal[0], &signal[1])
            })
            .sum()
    };
    let found: Vec<f64> = radii.iter().map(|r| explained(*r)).collect();
    let best = (0..radii.len()).max_by(|&a, &b| found[a].total_cmp(&found[b])).unwrap();
    radii[best]
}

/// From a fortieth of the diagonal to all of it, and 2 % apart near the radius that was found.
fn dense_radii(found: f64, diagonal: f64) -> Vec<f64> {
    let wide = (0..11).map(|k| diagonal / 40.0 * 40f64.powf(f64::from(k) / 10.0));
    let near = (-20..=20).map(|k| found * 1.02f64.powi(k));
    let mut all: Vec<f64> = wide.chain(near).collect();
    all.sort_by(f64::total_cmp);
    all
}

fn holds_against_dense_search(scene: Scene, settings: &AoVersusPathSettings) {
    let mut renderer = renderer(scene);
    let report = compare(&mut renderer, settings).report;
    let fit = &report.path[0];
    let found = fit.binary.radius.expect("a best radius");
    let dense = dense_search(&mut renderer, settings, &dense_radii(found, report.diagonal));
    println!(
        "{}: radius {found:.4}, dense search {dense:.4}; standard error {:?}",
        report.scene, fit.binary.standard_error
    );
    assert!((found / dense - 1.0).abs() < 0.05, "{found}, {dense} by dense search");
    assert_validation_clean(renderer.device());
}

#[test]
fn gpu_the_best_radius_is_that_of_a_dense_search() {
    // a scene with a sharp minimum: where the error hardly depends on the radius, two searches that are both right find different ones
    let mut grid = builtin::by_name("grid").unwrap();
    grid.environment = Environment::Uniform(Vec3::ONE);
    let settings = AoVersusPathSettings { size: [96, 54], spp: 64, ao_samples: 32, ..Default::default() };
    holds_against_dense_search(grid, &settings);
}

/// With `SKYLIT_FULL` set, where the scene is: minutes on a CPU driver.
#[test]
fn gpu_the_best_radius_in_sponza_is_that_of_a_dense_search() {
    if !common::is_full() {
        println!("skipped: SKYLIT_FULL is not set");
        return;
    }
    let Some(scenes) = common::shared_scenes() else { return };
    let mut sponza = skylit::scene::load::load(&scenes.join("sponza/sponza.glb").to_string_lossy()).unwrap();
    sponza.environment = Environment::Uniform(Vec3::ONE);
    let settings = AoVersusPathSettings { size: [160, 90], spp: 64, ao_samples: 32, ..Default::default() };
    holds_against_dense_search(sponza, &settings);
}
