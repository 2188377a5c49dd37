//! A convex body in a room where the same light comes from everywhere: what reflects all light disappears.

use super::*;
use skylit::scene::builtin::shapes;
use skylit::scene::material::{Anisotropy, Transmission};

/// A sphere that fills the view, in an environment of radiance 1.
pub fn furnace(material: Material) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO, DVec3::Y, 0.9);
    Scene {
        environment: Environment::Uniform(Vec3::ONE),
        ..scene_of(vec![(shapes::sphere(DVec3::ZERO, 1.0), material)], camera)
    }
}

pub fn options(spp: u32, strategy: Strategy) -> PathOptions {
    PathOptions { samples: SampleSettings::new([24, 24], spp, 3), strategy, ..Default::default() }
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
        let flat_plane = plane(material, 0.8);
        let surface = Surface { roughness: roughness.into(), metallic: metallic.into(), ..WHITE };
        let expected = surface.albedo(0.8);
        let what = format!("roughness {roughness}, metallic {metallic}");
        assert!(expected < 1.001, "{what}: {expected} is more than there was");
        for strategy in [Strategy::Mis, Strategy::Bsdf, Strategy::Light, Strategy::Uniform] {
            let spp = if strategy == Strategy::Uniform || strategy == Strategy::Light { 512 } else { 128 };
            holds(&device, &what, &flat_plane, &options(spp, strategy), expected, 2e-2);
        }
    }
}

/// A plane that fills the view, seen under one angle all over, from far away; light comes from everywhere.
pub fn plane(material: Material, cos_o: f64) -> Scene {
    let eye = DVec3::new((1.0 - cos_o * cos_o).sqrt(), cos_o, 0.0) * 50.0;
    let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.002);
    Scene {
        environment: Environment::Uniform(Vec3::ONE),
        ..scene_of(vec![(shapes::floor(DVec3::ZERO, 10.0), material)], camera)
    }
}

/// The specification's mix of a dielectric and a metal: half of the light that the dielectric part lets through is there whatever the metal
/// reflects.
#[test]
fn gpu_half_metals_are_mixed_as_specified() {
    let device = device();
    let base = [0.9f32, 0.6, 0.3];
    let material =
        Material { base_color: Vec3::from(base).extend(1.0), metallic: 0.5, roughness: 0.5, ..Material::default() };
    let cos_o = 0.75f64.sqrt();
    let surface = |base: f32| Surface { roughness: 0.5, metallic: 0.5, base: base.into(), ..WHITE };
    let expected = base.map(|c| surface(c).albedo(cos_o));
    println!("white sky, 30 degrees: {expected:.4?}");
    // as Blender Cycles 4.4 has it, too
    for (ours, known) in expected.iter().zip([0.857, 0.578, 0.298]) {
        assert!((ours - known).abs() < 2e-3, "{expected:?}");
    }
    let scene = plane(material.clone(), cos_o);
    holds(&device, "half metal", &scene, &options(256, Strategy::Mis), expected.iter().sum::<f64>() / 3.0, 5e-3);
    let flat = FlatScene::for_paths(&scene);
    let film = render(&tracer(&device, TracerKind::Compute, &flat), &flat, &options(256, Strategy::Mis)).image.film;
    for (channel, expected) in expected.into_iter().enumerate() {
        let mean = film.mean.iter().skip(channel).step_by(3).map(|&c| f64::from(c)).sum::<f64>() / (24.0 * 24.0);
        assert!((mean - expected).abs() < 2e-3, "channel {channel}: {mean}, expected {expected}");
    }
    // thin walls, of which a part transmits
    let transmission = Transmission { factor: 0.6, ..Default::default() };
    let walls = plane(Material { transmission, ..material }, cos_o);
    let expected = base.map(|c| Surface { transmission: 0.6, ..surface(c) }.albedo(cos_o)).iter().sum::<f64>() / 3.0;
    holds(&device, "half metal, thin walls", &walls, &options(256, Strategy::Mis), expected, 5e-3);
}

/// KHR_materials_ior: 0 is a Fresnel term of 1, which the specular colour and factor scale; what is below 1 otherwise is no index.
#[test]
fn gpu_an_index_of_zero_reflects_by_the_specular_colour() {
    let device = device();
    let dir = tempfile::tempdir().unwrap();
    let corners: [[f32; 3]; 4] = [[-5.0, 0.0, -5.0], [-5.0, 0.0, 5.0], [5.0, 0.0, 5.0], [5.0, 0.0, -5.0]];
    let indices = [0u32, 1, 2, 0, 2, 3];
    let bytes: Vec<u8> = [bytemuck::cast_slice::<_, u8>(&corners), bytemuck::cast_slice(&indices)].concat();
    std::fs::write(dir.path().join("floor.bin"), bytes).unwrap();
    let load = |base: f64, roughness: f64, ior: f64, extensions: &str| {
        let file = dir.path().join("floor.gltf");
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[-5,0,-5],"max":[5,0,5]}},
            {{"bufferView":1,"componentType":5125,"count":6,"type":"SCALAR"}}],
            "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}}],
            "buffers":[{{"uri":"floor.bin","byteLength":72}}],
            "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[{base},{base},{base},1],"metallicFactor":0,"roughnessFactor":{roughness}}},
            "extensions":{{"KHR_materials_ior":{{"ior":{ior}}}{extensions}}}}}]}}"#
        );
        std::fs::write(&file, text).unwrap();
        let mut loaded = skylit::scene::load::load(file.to_str().unwrap()).unwrap();
        let view = plane(Material::default(), 0.6);
        loaded.cameras = view.cameras;
        loaded.environment = view.environment;
        loaded
    };
    let all = load(0.2, 0.0, 0.0, "");
    assert_eq!(all.materials[0].ior, 0.0);
    holds(&device, "all is reflected", &all, &options(16, Strategy::Mis), 1.0, 1e-3);
    let specular = |factor: f64, color: f64| {
        format!(
            r#","KHR_materials_specular":{{"specularFactor":{factor},"specularColorFactor":[{color},{color},{color}]}}"#
        )
    };
    let some = Surface { roughness: 0.4, base: 0.7, f0: 0.8 * 0.3, f90: 0.8, ..WHITE };
    let scene = load(0.7, 0.4, 0.0, &specular(0.8, 0.3));
    holds(&device, "specular colour", &scene, &options(256, Strategy::Mis), some.albedo(0.6), 5e-3);
    // a body of it transmits as thin walls do
    let through =
        r#","KHR_materials_transmission":{"transmissionFactor":0.5},"KHR_materials_volume":{"thicknessFactor":1}"#;
    let scene = load(0.7, 0.4, 0.0, &(specular(0.8, 0.3) + through));
    let expected = Surface { transmission: 0.5, ..some }.albedo(0.6);
    holds(&device, "a body", &scene, &options(256, Strategy::Mis), expected, 5e-3);
    // what is no index at all
    for (ior, taken, warnings) in [(0.5, 1.0, 1), (1.0, 1.0, 0), (1.2, 1.2, 0), (-1.0, 1.0, 1)] {
        let scene = load(0.7, 0.4, ior, "");
        assert_eq!((scene.materials[0].ior, scene.report.warnings.len()), (taken, warnings), "{ior}");
    }
}

/// KHR_materials_unlit: the base colour is all that shows.
#[test]
fn gpu_unlit_materials_do_not_emit() {
    let device = device();
    let material =
        Material { base_color: Vec3::splat(0.2).extend(1.0), emissive: Vec3::ONE, unlit: true, ..Material::default() };
    holds(&device, "unlit", &plane(material, 0.8), &options(16, Strategy::Mis), 0.2, 1e-3);
}

/// With energy compensation whatever is white disappears, by every tracer: from steep to grazing angles, or as a body that light may cross.
#[test]
fn gpu_compensated_white_disappears() {
    let device = device();
    let gltf = |metallic, roughness| Material { metallic, roughness, ..Material::default() };
    let through = |factor, thickness, roughness| Material {
        transmission: Transmission { factor, thickness, ..Default::default() },
        ..gltf(0.0, roughness)
    };
    let planes = [
        ("smooth plastic", gltf(0.0, 0.0)),
        ("plastic 0.5", gltf(0.0, 0.5)),
        ("metal 0.5", gltf(1.0, 0.5)),
        ("half metal 0.5", gltf(0.5, 0.5)),
        ("smooth thin walls", through(1.0, 0.0, 0.0)),
        ("thin walls 0.5", through(1.0, 0.0, 0.5)),
        ("thin walls 1", through(1.0, 0.0, 1.0)),
        ("half thin walls 0.5", through(0.5, 0.0, 0.5)),
    ];
    let bodies = [("volume 0.2", through(1.0, 1.0, 0.2)), ("volume 1", through(1.0, 1.0, 1.0))];
    // 87 degrees
    let scenes = planes
        .into_iter()
        .map(|(name, m)| (format!("{name} at 87 degrees"), plane(m, 0.05234), 64))
        .chain(bodies.into_iter().map(|(name, m)| (name.to_owned(), furnace(m), 256)));
    let needs = Needs { shading: true, compensation: true, ..Default::default() };
    for (what, scene, spp) in scenes {
        let flat = FlatScene::for_paths(&scene);
        // light that goes round and round in a body: without roulette there is less noise
        let options = PathOptions { rr_depth: 256, max_depth: 256, ..options(spp, Strategy::Mis) };
        for kind in picked(&device) {
            let tracer = Tracer::new(&device, kind, &flat, needs).unwrap();
            let (mean, error) = mean_of(&render(&tracer, &flat, &options).image.film);
            println!("{what}, {kind}: {mean:.5} +- {error:.5}");
            assert!(error <= 3e-3 && (mean - 1.0).abs() <= 1e-2, "{what}, {kind}: {mean} +- {error}");
        }
    }
    assert_validation_clean(&device);
}

/// Lobes that are nearly mirrors, down to the least roughness that is not one.
#[test]
fn gpu_narrow_lobes_lose_nothing() {
    let device = device();
    for (roughness, cos_o) in [(0.0032f32, 0.8), (0.0032, 0.2), (0.01, 0.2), (0.03, 0.2)] {
        let metal = Material { metallic: 1.0, roughness, ..Material::default() };
        let expected = Surface { roughness: roughness.into(), metallic: 1.0, ..WHITE }.albedo(cos_o);
        let what = format!("roughness {roughness}, cosine {cos_o}");
        assert!((expected - 1.0).abs() < 1e-3, "{what}: {expected}");
        holds_but_for(1e-3, &device, &what, &plane(metal, cos_o), &options(64, Strategy::Mis), 1.0, 1e-3);
    }
    // stretched along one direction, and a mirror across it
    let anisotropy = Anisotropy { strength: 0.3, ..Default::default() };
    let brushed = Material { metallic: 1.0, roughness: 0.0, anisotropy, ..Material::default() };
    holds_but_for(1e-2, &device, "brushed", &plane(brushed, 0.8), &options(64, Strategy::Mis), 1.0, 1e-3);
}

/// glTF's metallic-roughness material, in one channel.
#[derive(Clone, Copy)]
struct Surface {
    roughness: f64,
    metallic: f64,
    base: f64,
    /// Through thin walls.
    transmission: f64,
    /// Of the dielectric part.
    f0: f64,
    f90: f64,
}

const WHITE: Surface = Surface { roughness: 1.0, metallic: 0.0, base: 1.0, transmission: 0.0, f0: 0.04, f90: 1.0 };

impl Surface {
    /// Directional albedo, by the midpoint rule over the half vector's hemisphere: the specification's mix(dielectric, metal, metallic).
    fn albedo(&self, cos_o: f64) -> f64 {
        use std::f64::consts::PI;
        let alpha = self.roughness * self.roughness;
        let wo = DVec3::new((1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o);
        let schlick = |c: f64, f0: f64, f90: f64| f0 + (f90 - f0) * (1.0 - c).powi(5);
        let dielectric = |c: f64| schlick(c, self.f0, self.f90);
        let fresnel = |c: f64| (1.0 - self.metallic) * dielectric(c) + self.metallic * schlick(c, self.base, 1.0);
        let below = (1.0 - self.metallic) * self.base;
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
                // what goes through thin walls goes by the lobe of what they reflect
                let lobe = fresnel(c) + below * self.transmission * (1.0 - dielectric(c));
                sum += lobe * c / (cos_o * cos_m * (1.0 + lambda(cos_o) + lambda(wi.z)));
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
                under += below * (1.0 - self.transmission) * (1.0 - dielectric(wo.dot((wo + wi).normalize())));
            }
        }
        specular + under / (n * (n / 4)) as f64
    }
}
