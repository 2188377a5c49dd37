//! The Cornell box, after the measured data of the Cornell Program of Computer Graphics
//! (<https://www.graphics.cornell.edu/online/box/data.html>). One unit is 100 mm.
//!
//! Two changes: the light hangs 0.8 mm below the ceiling, since coplanar surfaces have no defined
//! order, and reflectances are linear RGB as renderers customarily use them.

use super::shapes;
use crate::scene::material::{MaterialKind, Transmission};
use crate::scene::{Environment, Geometry, Material, Scene};
use glam::{DAffine3, DVec3, Vec3};

/// Data in millimetres.
const UNITS_PER_MM: f64 = 0.01;

const WHITE: Vec3 = Vec3::new(0.725, 0.71, 0.68);
const RED: Vec3 = Vec3::new(0.63, 0.065, 0.05);
const GREEN: Vec3 = Vec3::new(0.14, 0.45, 0.091);
const LIGHT: Vec3 = Vec3::new(17.0, 12.0, 4.0);

/// Tops of the blocks, counter-clockwise from above in x (to the left) and z (into the box), and
/// their heights.
const SHORT: ([[f64; 2]; 4], f64) = ([[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]], 165.0);
const TALL: ([[f64; 2]; 4], f64) = ([[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]], 330.0);

fn mm(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z) * UNITS_PER_MM
}

/// A block without its bottom, which would coincide with the floor.
fn block((base, height): ([[f64; 2]; 4], f64)) -> Geometry {
    let at = |k: usize, y: f64| mm(base[k % 4][0], y, base[k % 4][1]);
    let mut faces = vec![[at(0, height), at(1, height), at(2, height), at(3, height)]];
    faces.extend((0..4).map(|k| [at(k, 0.0), at(k + 1, 0.0), at(k + 1, height), at(k, height)]));
    shapes::quads(&faces)
}

/// A block with its bottom, a millimetre above the floor.
fn closed_block((base, height): ([[f64; 2]; 4], f64)) -> Geometry {
    let at = |k: usize, y: f64| mm(base[k % 4][0], y, base[k % 4][1]);
    let [top, bottom] = [height, 1.0];
    let mut faces = vec![
        [at(0, top), at(1, top), at(2, top), at(3, top)],
        [at(3, bottom), at(2, bottom), at(1, bottom), at(0, bottom)],
    ];
    faces.extend((0..4).map(|k| [at(k, bottom), at(k + 1, bottom), at(k + 1, top), at(k, top)]));
    shapes::quads(&faces)
}

/// A sphere that stands on the floor.
fn ball(x: f64, z: f64, radius: f64) -> Geometry {
    shapes::sphere(mm(x, radius, z), radius * UNITS_PER_MM)
}

fn mirror() -> Material {
    Material {
        name: "mirror".to_owned(),
        kind: MaterialKind::Mirror,
        base_color: Vec3::splat(0.95).extend(1.0),
        metallic: 1.0,
        roughness: 0.0,
        specular_color: Vec3::splat(0.95),
        ..Material::default()
    }
}

fn glass() -> Material {
    Material {
        name: "glass".to_owned(),
        kind: MaterialKind::Glass,
        roughness: 0.0,
        ior: 1.5,
        specular_color: Vec3::ONE,
        transmittance: Vec3::ONE,
        transmission: Transmission { factor: 1.0, thickness: 1.0, ..Transmission::default() },
        ..Material::default()
    }
}

/// The empty box with its light and camera. Material 0 is the white.
fn walls(name: &str) -> Scene {
    let mut scene = Scene { name: name.to_owned(), ..Scene::default() };
    let white = scene.add_matte("white", WHITE);
    let red = scene.add_matte("red", RED);
    let green = scene.add_matte("green", GREEN);
    let light = scene.add_material(Material {
        name: "light".to_owned(),
        base_color: Vec3::splat(0.78).extend(1.0),
        emissive: LIGHT,
        ..Material::default()
    });
    let parts = [
        ("floor", white, [mm(552.8, 0.0, 0.0), mm(0.0, 0.0, 0.0), mm(0.0, 0.0, 559.2), mm(549.6, 0.0, 559.2)]),
        (
            "ceiling",
            white,
            [mm(556.0, 548.8, 0.0), mm(556.0, 548.8, 559.2), mm(0.0, 548.8, 559.2), mm(0.0, 548.8, 0.0)],
        ),
        ("back", white, [mm(549.6, 0.0, 559.2), mm(0.0, 0.0, 559.2), mm(0.0, 548.8, 559.2), mm(556.0, 548.8, 559.2)]),
        ("right", green, [mm(0.0, 0.0, 559.2), mm(0.0, 0.0, 0.0), mm(0.0, 548.8, 0.0), mm(0.0, 548.8, 559.2)]),
        ("left", red, [mm(552.8, 0.0, 0.0), mm(549.6, 0.0, 559.2), mm(556.0, 548.8, 559.2), mm(556.0, 548.8, 0.0)]),
        (
            "light",
            light,
            [mm(343.0, 548.0, 227.0), mm(343.0, 548.0, 332.0), mm(213.0, 548.0, 332.0), mm(213.0, 548.0, 227.0)],
        ),
    ];
    for (part, material, corners) in parts {
        scene.add_object(part, shapes::quads(&[corners]), material, DAffine3::IDENTITY);
    }
    // 35 mm focal length over 25 mm of film
    let fov_y = 2.0 * (0.5 * 25.0f64 / 35.0).atan().to_degrees();
    scene.add_camera(mm(278.0, 273.0, -800.0), mm(278.0, 273.0, 0.0), fov_y);
    if let Some(camera) = scene.cameras.last_mut() {
        camera.aspect = Some(1.0);
    }
    scene
}

/// The box with its two blocks.
pub fn cornell_box() -> Scene {
    let mut scene = walls("cornell-box");
    scene.add_object("short block", block(SHORT), 0, DAffine3::IDENTITY);
    scene.add_object("tall block", block(TALL), 0, DAffine3::IDENTITY);
    scene
}

/// The boxes of Coello (2024), open to the camera, under a white sky: (1) empty and matte; (2)
/// matte, its tall block of metal; (3) glossy, its back wall of metal.
pub fn coello(number: u32) -> Scene {
    let mut scene = walls("coello");
    scene.environment = Environment::Uniform(Vec3::ONE);
    // the sky is the only light
    scene.instances.retain(|i| i.name != "light");
    let kind = if number == 3 { MaterialKind::MetallicRoughness } else { MaterialKind::Matte };
    scene.materials.iter_mut().for_each(|m| (m.kind, m.roughness, m.emissive) = (kind, 0.3, Vec3::ZERO));
    let metal = scene.add_material(Material {
        name: "metal".to_owned(),
        kind: MaterialKind::MetallicRoughness,
        base_color: Vec3::new(0.91, 0.92, 0.92).extend(1.0),
        metallic: 1.0,
        roughness: 0.2,
        ..Material::default()
    });
    if number == 3 {
        let back = scene.instances.iter().find(|i| i.name == "back").map(|i| i.mesh);
        back.into_iter().for_each(|mesh| scene.meshes[mesh].material = metal);
    }
    if number > 1 {
        scene.add_object("short block", closed_block(SHORT), 0, DAffine3::IDENTITY);
        let tall = if number == 2 { metal } else { 0 };
        scene.add_object("tall block", closed_block(TALL), tall, DAffine3::IDENTITY);
    }
    scene
}

/// The box without blocks.
pub fn cornell_empty() -> Scene {
    walls("cornell-empty")
}

/// The box with its tall block a mirror.
pub fn cornell_mirror() -> Scene {
    let mut scene = walls("cornell-mirror");
    let mirror = scene.add_material(mirror());
    scene.add_object("short block", block(SHORT), 0, DAffine3::IDENTITY);
    scene.add_object("tall block", block(TALL), mirror, DAffine3::IDENTITY);
    scene
}

/// The box with a sphere of glass in place of the short block.
pub fn cornell_glass_sphere() -> Scene {
    let mut scene = walls("cornell-glass-sphere");
    let glass = scene.add_material(glass());
    scene.add_object("sphere", ball(186.0, 168.0, 95.0), glass, DAffine3::IDENTITY);
    scene.add_object("tall block", block(TALL), 0, DAffine3::IDENTITY);
    scene
}

/// The box with three spheres: mirror, glass and matte.
pub fn cornell_spheres() -> Scene {
    let mut scene = walls("cornell-spheres");
    let mirror = scene.add_material(mirror());
    let glass = scene.add_material(glass());
    scene.add_object("mirror sphere", ball(395.0, 365.0, 110.0), mirror, DAffine3::IDENTITY);
    scene.add_object("glass sphere", ball(165.0, 190.0, 95.0), glass, DAffine3::IDENTITY);
    scene.add_object("matte sphere", ball(330.0, 130.0, 50.0), 0, DAffine3::IDENTITY);
    scene
}
