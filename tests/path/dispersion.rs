//! Dispersion against Snell's law: colours of a prism by quadrature over wavelengths, and furnaces that stay white.

use super::*;
use skylit::scene::TriangleMesh;
use skylit::scene::builtin::shapes;
use skylit::scene::material::Transmission;

/// Index of refraction at line d.
const IOR: f64 = 1.5;
/// 20 over the Abbe number: far beyond any glass, so that colours are far apart.
const DISPERSION: f64 = 2.0;
/// Ends of the wavelengths of paths, micrometres.
const ENDS: [f64; 2] = [0.438, 0.660];

/// A body that disperses and reflects as its index says.
fn body(roughness: f32, dispersion: f64) -> Material {
    Material {
        roughness,
        dispersion: dispersion as f32,
        ior: IOR as f32,
        transmission: Transmission { factor: 1.0, thickness: 1.0, ..Default::default() },
        ..Material::default()
    }
}

/// Index of refraction at a wavelength in micrometres, by Cauchy's equation and the Abbe number.
fn index(wavelength: f64) -> f64 {
    let [d, f, c] = [0.5876f64, 0.4861, 0.6563].map(|line| line.powi(-2));
    IOR + (IOR - 1.0) * DISPERSION / 20.0 * (wavelength.powi(-2) - d) / (f - c)
}

/// Share of unpolarized light that passes from one index into another, by the cosine before.
fn passes(cosine: f64, from: f64, to: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).sqrt() * from / to;
    if sine >= 1.0 {
        return 0.0;
    }
    let beyond = (1.0 - sine * sine).sqrt();
    let s = (from * cosine - to * beyond) / (from * cosine + to * beyond);
    let p = (from * beyond - to * cosine) / (from * beyond + to * cosine);
    1.0 - 0.5 * (s * s + p * p)
}

/// A wedge whose front faces the camera and whose back leans by 30 degrees, before a wall that shines above the height at which light leaves downwards or up.
fn wedge(edge: f64) -> Scene {
    // a prism of which the camera sees the middle: front at z = 0, back from z = -1 at y = 0 with normal (0, sin 30, -cos 30)
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let back = |y: f64| -1.0 + y * sin / cos;
    let corner = |x: f64, y: f64, z: f64| Vec3::new(x as f32, y as f32, z as f32);
    let side =
        |x: f64| [corner(x, 1.0, 0.0), corner(x, -1.0, 0.0), corner(x, -1.0, back(-1.0)), corner(x, 1.0, back(1.0))];
    let positions = [side(-1.0), side(1.0)].concat();
    let quad = |a: u32, b: u32, c: u32, d: u32| [[a, b, c], [a, c, d]];
    // outwards: front, bottom, back, top, and the two ends
    let faces =
        [quad(0, 1, 5, 4), quad(1, 2, 6, 5), quad(2, 3, 7, 6), quad(3, 0, 4, 7), quad(3, 2, 1, 0), quad(4, 5, 6, 7)];
    let mesh = TriangleMesh { positions, indices: faces.concat(), ..TriangleMesh::default() };
    let wall = shapes::rectangle(DVec3::new(0.0, edge - 20.0, -11.0), DVec3::X * 40.0, DVec3::Y * 40.0);
    let light = Material { emissive: Vec3::ONE, double_sided: true, base_color: glam::Vec4::W, ..matte(0.0) };
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y, 1e-5);
    scene_of(vec![(Geometry::Triangles(mesh), body(0.0, DISPERSION)), (wall, light)], camera)
}

/// What the camera sees of the wall, by quadrature.
fn seen(edge: f64) -> DVec3 {
    let n = 20_000;
    let (sin, cos) = 30f64.to_radians().sin_cos();
    (0..n)
        .map(|k| {
            let x = (f64::from(k) + 0.5) / f64::from(n);
            let n_glass = index(ENDS[0] + x * (ENDS[1] - ENDS[0]));
            let passed = passes(1.0, 1.0, n_glass) * passes(cos, n_glass, 1.0);
            // the ray along -z meets the back under 30 degrees and leaves it under a larger angle, bent towards the thick end
            let sine = n_glass * sin;
            if sine >= 1.0 {
                return DVec3::ZERO;
            }
            let bent = sine.asin() - 30f64.to_radians();
            let y = -10.0 * bent.tan();
            let (blue, red) = ((1.5 - 3.0 * x).clamp(0.0, 1.0), (3.0 * x - 1.5).clamp(0.0, 1.0));
            let lit = if y < edge { 3.0 * passed } else { 0.0 };
            DVec3::new(red, 1.0 - red - blue, blue) * lit / f64::from(n)
        })
        .sum()
}

#[test]
fn gpu_a_prism_parts_colours() {
    let device = device();
    let height = |wavelength: f64| -10.0 * ((index(wavelength) * 0.5).asin() - 30f64.to_radians()).tan();
    // all of the light, none, and what lies below the middle of three colours
    let edges = [height(0.438) + 1.0, height(0.438) - 1.0, height(0.475), height(0.549), height(0.6)];
    let mut colors = Vec::new();
    for edge in edges {
        let (scene, expected) = (wedge(edge), seen(edge));
        let flat = FlatScene::for_paths(&scene);
        let samples = SampleSettings::new([8, 8], 512, 5);
        let options = PathOptions { samples, max_depth: 2, ..Default::default() };
        for kind in picked(&device) {
            let film = render(&tracer(&device, kind, &flat), &flat, &options).image.film;
            let mean = DVec3::from_array([0, 1, 2].map(|c| {
                let plane = film.plane(c);
                plane.iter().map(|&v| f64::from(v)).sum::<f64>() / plane.len() as f64
            }));
            println!("edge {edge:.3}, {kind}: {mean:.4}, expected {expected:.4}");
            assert!((mean - expected).abs().max_element() < 4e-3, "edge {edge}, {kind}: {mean}, expected {expected}");
            colors.push(expected);
        }
    }
    // an edge between parts them: blue alone is bent far enough
    let blue = colors.iter().any(|c| c.z > 0.2 && c.x < 0.01);
    assert!(blue, "{colors:?}");
}

/// What disperses loses no light and gains none, in any colour.
#[test]
fn gpu_dispersion_keeps_white_white() {
    let device = device();
    for roughness in [0.0, 0.4] {
        let mut scene = furnace::furnace(body(roughness, 0.0));
        let options = furnace::options(256, Strategy::Mis);
        let images = [0.0, DISPERSION].map(|dispersion| {
            scene.materials[0].dispersion = dispersion as f32;
            let flat = FlatScene::for_paths(&scene);
            let film = render(&tracer(&device, picked(&device)[0], &flat), &flat, &options).image.film;
            [0, 1, 2].map(|c| {
                let (plane, variance) = (film.plane(c), film.variance_plane(c));
                let n = plane.len() as f64;
                let mean = plane.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
                let error = (variance.iter().map(|&v| f64::from(v)).sum::<f64>() / n / (n * 256.0)).sqrt();
                [mean, error]
            })
        });
        let [without, with] = images;
        for (c, ([plain, _], [dispersed, error])) in without.into_iter().zip(with).enumerate() {
            println!("roughness {roughness}, channel {c}: {plain:.4} without, {dispersed:.4} +- {error:.4} with");
            assert!(error < 4e-3, "{error} says nothing");
            // indices at the ends differ, and with them what rough microfacets of one bounce lose
            assert!((dispersed - plain).abs() < 4.5 * error + 6e-3, "{roughness}: {dispersed} beside {plain}");
        }
    }
}
