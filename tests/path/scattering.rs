//! Volumes that scatter, against closed forms: what a thick one reflects (Chandrasekhar, "Radiative Transfer", 1950), what a thin one scatters back, and
//! furnaces in which nothing is lost.

use super::*;
use skylit::scene::builtin::shapes;
use skylit::scene::material::{DiffuseTransmission, Specular, Transmission, VolumeScatter};

/// A volume of an index of refraction, which attenuates light by `density` per unit and scatters to a colour.
fn volume(ior: f32, density: f64, color: Vec3, anisotropy: f32) -> Material {
    let transmission = Transmission {
        factor: 1.0,
        thickness: 1.0,
        attenuation_color: Vec3::splat(0.5),
        attenuation_distance: (0.5f64.ln() / -density) as f32,
        ..Default::default()
    };
    let volume_scatter = VolumeScatter { color, anisotropy };
    Material { roughness: 0.0, ior, transmission, volume_scatter, ..Material::default() }
}

/// The albedo of one scattering by that of many (Kulla and Conty 2017).
fn single(many: f64) -> f64 {
    1.0 - (4.09712 + 4.20863 * many - (9.59217 + 41.6808 * many + 17.7126 * many * many).sqrt()).powi(2)
}

/// Chandrasekhar's function H of isotropic scattering, at a cosine.
fn h_function(albedo: f64, cosine: f64) -> f64 {
    let n = 400;
    let at = |k: usize| (k as f64 + 0.5) / n as f64;
    let mut h = vec![1.0; n];
    let next = |h: &[f64], mu: f64| {
        // in the form that converges for all albedos (III, equation 14)
        let sum: f64 = (0..n).map(|k| at(k) * h[k] / (mu + at(k))).sum::<f64>() / n as f64;
        1.0 / ((1.0 - albedo).sqrt() + 0.5 * albedo * sum)
    };
    for _ in 0..300 {
        h = (0..n).map(|k| next(&h, at(k))).collect();
    }
    next(&h, cosine)
}

#[test]
fn gpu_thick_volumes_reflect_as_chandrasekhar_says() {
    let device = device();
    let color = Vec3::new(0.8, 0.5, 0.2);
    for cosine in [1.0, 0.5f64] {
        let away = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine) * 4.0;
        let camera = Camera::look_at(away + DVec3::Z, DVec3::Z, DVec3::Y, 0.01);
        let cube = shapes::cuboid(DVec3::splat(-1.0), DVec3::ONE);
        let scene = Scene {
            environment: Environment::Uniform(Vec3::ONE),
            ..scene_of(vec![(cube, volume(1.0, 200.0, color, 0.0))], camera)
        };
        let flat = FlatScene::for_paths(&scene);
        let options = PathOptions { samples: SampleSettings::new([16, 16], 96, 5), ..Default::default() };
        for kind in picked(&device) {
            let film = render(&tracer(&device, kind, &flat), &flat, &options).image.film;
            for c in 0..3 {
                let albedo = single(color[c].into());
                let expected = 1.0 - h_function(albedo, cosine) * (1.0 - albedo).sqrt();
                let (plane, variance) = (film.plane(c), film.variance_plane(c));
                let n = plane.len() as f64;
                let mean = plane.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
                let error = (variance.iter().map(|&v| f64::from(v)).sum::<f64>() / n / (n * 96.0)).sqrt();
                println!("cosine {cosine}, channel {c}, {kind}: {mean:.5} +- {error:.5}, expected {expected:.5}");
                assert!(error < 0.015 * expected, "{error} says nothing about {expected}");
                assert!((mean - expected).abs() < 4.5 * error + 1e-3 * expected, "{kind}: {mean}, expected {expected}");
            }
        }
    }
}

/// A thin slab before a black background, lit from the side of the camera alone: it scatters back what its phase function sends there.
#[test]
fn gpu_thin_volumes_scatter_by_their_anisotropy() {
    let device = device();
    let (depth, density, many) = (0.1, 0.2, 0.02);
    for g in [-0.6, 0.3f64] {
        let slab = shapes::cuboid(DVec3::new(-50.0, -50.0, -depth), DVec3::new(50.0, 50.0, 0.0));
        let sky = shapes::rectangle(DVec3::new(0.0, 0.0, 10.0), DVec3::X * 10_000.0, DVec3::Y * 10_000.0);
        let light = Material { emissive: Vec3::ONE, double_sided: true, ..matte(0.0) };
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.01);
        let body = volume(1.0, density, Vec3::splat(many as f32), g as f32);
        let scene = scene_of(vec![(slab, body), (sky, light)], camera);

        // one scattering by quadrature, backwards by a cosine; of what is scattered a tenth is scattered again, if it meets a particle at all
        let phase = |mu: f64| 0.5 * (1.0 - g * g) / (1.0 + g * g - 2.0 * g * mu).powf(1.5);
        let (n, mut expected) = (400, 0.0);
        for i in 0..n {
            let s = depth * (f64::from(i) + 0.5) / f64::from(n);
            for j in 0..n {
                let mu = (f64::from(j) + 0.5) / f64::from(n);
                expected += phase(-mu) * (-density * (s + s / mu)).exp();
            }
        }
        expected *= single(many) * density * depth / f64::from(n * n);
        let options = PathOptions { samples: SampleSettings::new([16, 16], 4096, 5), ..Default::default() };
        holds_but_for(1e-2, &device, &format!("g {g}"), &scene, &options, expected, 0.03);
    }
}

/// What scatters all light disappears where light comes from everywhere: however dense, in whatever direction it scatters, by glass around it or by a surface
/// that transmits diffusely.
#[test]
fn gpu_white_volumes_disappear() {
    let device = device();
    let options = furnace::options(64, Strategy::Mis);
    for (ior, density, anisotropy) in [(1.0, 3.0, 0.0), (1.5, 2.0, 0.8), (1.33, 8.0, -0.4)] {
        let what = format!("index {ior}, {density} per unit, anisotropy {anisotropy}");
        let scene = furnace::furnace(volume(ior, density, Vec3::ONE, anisotropy));
        holds_but_for(3e-3, &device, &what, &scene, &options, 1.0, 5e-3);
    }
    // light that a Lambertian surface lets in and out; without an index, beyond whose critical angle rough microfacets of one bounce lose some
    let wax = |ior, color| Material {
        transmission: Transmission { factor: 0.0, ..volume(ior, 10.0, color, 0.0).transmission },
        diffuse_transmission: DiffuseTransmission { factor: 1.0, ..Default::default() },
        specular: Specular { factor: 0.0, ..Default::default() },
        roughness: 1.0,
        ..volume(ior, 10.0, color, 0.0)
    };
    holds_but_for(3e-3, &device, "wax", &furnace::furnace(wax(1.0, Vec3::ONE)), &options, 1.0, 5e-3);
    // and colour
    let scene = furnace::furnace(wax(1.5, Vec3::new(0.8, 0.5, 0.2)));
    let flat = FlatScene::for_paths(&scene);
    let film = render(&tracer(&device, picked(&device)[0], &flat), &flat, &options).image.film;
    let [r, g, b] = [0, 1, 2].map(|c| film.plane(c).iter().sum::<f32>() / film.plane(c).len() as f32);
    assert!(r > g + 0.05 && g > b + 0.05 && b > 0.05 && r < 0.97, "wax has no colour: {r} {g} {b}");
}
