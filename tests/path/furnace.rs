//! A convex body in a room where the same light comes from everywhere: what reflects all light disappears.

use super::*;
use skylit::scene::builtin::shapes;

/// A sphere that fills the view, in an environment of radiance 1.
fn furnace(material: Material) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO, DVec3::Y, 0.9);
    Scene {
        environment: Environment::Uniform(Vec3::ONE),
        ..scene_of(vec![(shapes::sphere(DVec3::ZERO, 1.0), material)], camera)
    }
}

fn options(spp: u32, strategy: Strategy) -> PathOptions {
    PathOptions { size: [24, 24], spp, seed: 3, strategy, ..Default::default() }
}

#[test]
fn gpu_what_conserves_energy_disappears() {
    let device = device();
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::ONE, ..Material::default() };
    let glass = |roughness: f32, ior: f32| Material {
        kind: MaterialKind::Glass,
        specular_color: Vec3::ONE,
        transmittance: Vec3::ONE,
        roughness,
        ior,
        ..Material::default()
    };
    holds(&device, "matte", &furnace(matte(1.0)), &options(64, Strategy::Mis), 1.0, 1e-3);
    holds(&device, "matte", &furnace(matte(1.0)), &options(512, Strategy::Uniform), 1.0, 2e-3);
    holds(&device, "mirror", &furnace(mirror), &options(16, Strategy::Mis), 1.0, 1e-3);
    for ior in [1.33, 1.5, 2.4] {
        // paths end by roulette, and the rest make up for them
        holds(&device, "glass", &furnace(glass(0.0, ior)), &options(128, Strategy::Mis), 1.0, 2e-3);
    }
}

/// Models with one bounce between microfacets lose what bounces twice. How much, a second implementation tells: the same integral by brute
/// force on the host.
#[test]
fn gpu_what_loses_energy_loses_so_much() {
    let device = device();
    for (roughness, metallic) in [(0.3f32, 1.0f32), (1.0, 1.0), (0.5, 0.0), (0.25, 0.5)] {
        let material = Material { metallic, roughness, ..Material::default() };
        let flat_plane = {
            // seen under one angle all over, from far away
            let eye = DVec3::new(0.6, 0.8, 0.0) * 50.0;
            let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.002);
            Scene {
                environment: Environment::Uniform(Vec3::ONE),
                ..scene_of(vec![(shapes::floor(DVec3::ZERO, 10.0), material)], camera)
            }
        };
        let expected = albedo(f64::from(roughness), f64::from(metallic), 0.8);
        let what = format!("roughness {roughness}, metallic {metallic}");
        assert!(expected < 1.001, "{what}: {expected} is more than there was");
        for strategy in [Strategy::Mis, Strategy::Bsdf, Strategy::Light, Strategy::Uniform] {
            let spp = if strategy == Strategy::Uniform || strategy == Strategy::Light { 512 } else { 128 };
            holds(&device, &what, &flat_plane, &options(spp, strategy), expected, 2e-2);
        }
    }
}

/// Directional albedo of glTF's metallic-roughness model with a white base colour, by the midpoint rule over the half vector's hemisphere.
fn albedo(roughness: f64, metallic: f64, cos_o: f64) -> f64 {
    use std::f64::consts::PI;
    let alpha = roughness * roughness;
    let wo = DVec3::new((1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o);
    let (f0, diffuse) = (0.04 + (1.0 - 0.04) * metallic, 1.0 - metallic);
    let fresnel = |c: f64| f0 + (1.0 - f0) * (1.0 - c).powi(5);
    let lambda = |c: f64| 0.5 * ((1.0 + alpha * alpha * (1.0 - c * c) / (c * c)).sqrt() - 1.0);
    let n = 1500;
    let mut sum = 0.0;
    for i in 0..n {
        // evenly over tan^2 of what GGX makes of the number: the peak is resolved
        let u = (i as f64 + 0.5) / n as f64;
        let tan2 = alpha * alpha * u / (1.0 - u);
        let cos_m = 1.0 / (1.0 + tan2).sqrt();
        for j in 0..n / 4 {
            let phi = 2.0 * PI * (j as f64 + 0.5) / (n / 4) as f64;
            let s = (1.0 - cos_m * cos_m).sqrt();
            let m = DVec3::new(s * phi.cos(), s * phi.sin(), cos_m);
            let c = wo.dot(m);
            let wi = 2.0 * c * m - wo;
            if c <= 0.0 || wi.z <= 0.0 {
                continue;
            }
            // half vectors have density d cos_m; directions that over 4 c
            sum += fresnel(c) * c / (cos_o * cos_m * (1.0 + lambda(cos_o) + lambda(wi.z)));
        }
    }
    let specular = sum / (n * (n / 4)) as f64;
    let mut under = 0.0;
    for i in 0..n {
        // cosine-distributed directions
        let u = (i as f64 + 0.5) / n as f64;
        for j in 0..n / 4 {
            let phi = 2.0 * PI * (j as f64 + 0.5) / (n / 4) as f64;
            let wi = DVec3::new(u.sqrt() * phi.cos(), u.sqrt() * phi.sin(), (1.0 - u).sqrt());
            under += diffuse * (1.0 - fresnel(wo.dot((wo + wi).normalize())));
        }
    }
    specular + under / (n * (n / 4)) as f64
}
