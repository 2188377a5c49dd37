//! Oren-Nayar's rough diffuse reflection: it loses no energy, agrees with an implementation of its own on the host, and files can ask for it.

use std::f64::consts::PI;

use super::furnace::{furnace, options, plane};
use super::*;

fn rough(albedo: f32, sigma: f32) -> Material {
    Material { parameters: [("sigma".to_owned(), sigma)].into(), ..matte(albedo) }
}

#[test]
fn gpu_rough_white_surfaces_disappear() {
    let device = device();
    for sigma in [0.2, 0.6, 1.0] {
        let what = format!("sigma {sigma}");
        holds(&device, &what, &furnace(rough(1.0, sigma)), &options(128, Strategy::Mis), 1.0, 2e-3);
        holds(&device, &what, &furnace(rough(1.0, sigma)), &options(512, Strategy::Uniform), 1.0, 3e-3);
    }
}

/// Fujii's form of the model with one bounce, exactly integrated, and the bounces that follow: what the paper derives before it approximates. Directional albedo.
struct Exact {
    r: f64,
}

impl Exact {
    /// Value of one bounce between white facets times pi; `phi` between the azimuths.
    fn single(&self, cos_i: f64, cos_o: f64, phi: f64) -> f64 {
        let sines = ((1.0 - cos_i * cos_i) * (1.0 - cos_o * cos_o)).sqrt();
        let s = sines * phi.cos();
        let t = if s > 0.0 { cos_i.max(cos_o) } else { 1.0 };
        (1.0 + self.r * s / t) / (1.0 + (0.5 - 2.0 / (3.0 * PI)) * self.r)
    }

    /// Share of light that one bounce between white facets returns.
    fn albedo(&self, cos_o: f64) -> f64 {
        const N: u32 = 256;
        let mut sum = 0.0;
        for i in 0..N {
            // uniformly in the square of the cosine: that is its weight
            let cos_i = ((f64::from(i) + 0.5) / f64::from(N)).sqrt();
            sum +=
                (0..N).map(|k| self.single(cos_i, cos_o, 2.0 * PI * (f64::from(k) + 0.5) / f64::from(N))).sum::<f64>();
        }
        sum / f64::from(N * N)
    }

    /// Mean of that over directions.
    fn mean_albedo(&self) -> f64 {
        const N: u32 = 64;
        (0..N).map(|k| self.albedo(((f64::from(k) + 0.5) / f64::from(N)).sqrt())).sum::<f64>() / f64::from(N)
    }

    /// Of a surface with this albedo of its facets, all bounces: those beyond the first leave a surface as the first lets them.
    fn with_albedo(&self, rho: f64, cos_o: f64) -> f64 {
        let (one, mean) = (self.albedo(cos_o), self.mean_albedo());
        rho * one + rho * rho * mean * (1.0 - one) / (1.0 - rho * (1.0 - mean))
    }
}

#[test]
fn gpu_rough_surfaces_reflect_as_a_second_implementation_says() {
    let device = device();
    for (albedo, sigma, cos_o) in [(0.5, 0.5, 0.9), (0.8, 1.0, 0.25), (0.2, 1.0, 0.6)] {
        let expected = Exact { r: f64::from(sigma) }.with_albedo(f64::from(albedo), cos_o);
        let what = format!("albedo {albedo}, sigma {sigma}, cosine {cos_o}: {expected:.4}");
        assert!((expected - f64::from(albedo)).abs() > 1e-3, "{what}: as smooth as Lambert");
        let (scene, options) = (plane(rough(albedo, sigma), cos_o), options(512, Strategy::Mis));
        // the paper's polynomial for the directional albedo is exact to 0.1 %
        holds_with(&tracers(&device), 1e-3, &device, &what, &scene, &options, expected, 3e-3);
    }
}

#[test]
fn files_ask_for_rough_surfaces() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    write("a.mtl", "newmtl clay\nKd 0.5 0.4 0.3\nsigma 0.7\n");
    let obj = write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl clay\nf 1 2 3\n");
    let scene = skylit::scene::load::load(obj.to_str().unwrap()).unwrap();
    assert!(scene.materials.iter().any(|m| m.parameter("sigma") == Some(0.7)), "{:?}", scene.materials);
    // as glTF extras, there and back
    let glb = dir.path().join("a.glb");
    skylit::scene::export::export_gltf(&scene, &glb).unwrap();
    let again = skylit::scene::load::load(glb.to_str().unwrap()).unwrap();
    assert!(again.materials.iter().any(|m| m.parameter("sigma") == Some(0.7)), "{:?}", again.materials);
}
