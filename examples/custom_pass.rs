//! A pass of one's own: how much of a day's sunlight each point of a scene gets, by rays traced to the sun's places.
//! `cargo run --release --example custom_pass -- [SCENE] [IMAGE]`

use std::path::Path;

use glam::{DVec3, Vec3};
use skylit::accel::flatten::FlatScene;
use skylit::film::NoControl;
use skylit::film::camera::CameraRecord;
use skylit::gpu::{Device, Options};
use skylit::integrators::aov;
use skylit::integrators::rays::{Mode, trace};
use skylit::output::picture::grey_image;
use skylit::ray::Ray;
use skylit::tracer::{Needs, Tracer, TracerKind};

/// Image size, pixels.
const SIZE: [u32; 2] = [320, 180];
/// Places of the sun in a day.
const HOURS: u32 = 12;

/// Saves an image that is white where the sun shines all day, and returns the mean of its pixels.
pub fn render(scene: &str, image: &Path) -> skylit::Result<f64> {
    // a device, a scene, and the tracer of that scene: the compute tracer runs everywhere
    let device = Device::open(&Options::default())?;
    let scene = skylit::scene::load::load(scene)?;
    let flat = FlatScene::new(&scene);
    let needs = Needs { normals: true, ..Needs::default() };
    let tracer = Tracer::new(&device, TracerKind::Compute, &flat, needs)?;

    // what the camera sees: a point and a normal for each pixel
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let camera = CameraRecord::new(&scene.cameras[0], flat.origin, aspect);
    let pixels = aov::render(&tracer, &camera, SIZE, &mut NoControl)?;

    // a ray from each point to each place of the sun above its surface; it starts off the surface,
    // on the side that the camera sees
    let eye = (scene.cameras[0].camera_to_world.translation - flat.origin).as_vec3();
    let (low, high) = scene.bounds().unwrap_or((DVec3::ZERO, DVec3::ONE));
    let offset = 1e-4 * (high - low).length() as f32;
    let (mut rays, mut pixel_of_ray) = (Vec::new(), Vec::new());
    for (k, pixel) in pixels.iter().enumerate().filter(|(_, pixel)| pixel.depth.is_finite()) {
        let (position, normal) = (Vec3::from(pixel.position), Vec3::from(pixel.ng));
        let normal = if normal.dot(eye - position) < 0.0 { -normal } else { normal };
        for hour in 0..HOURS {
            let angle = std::f32::consts::PI * (hour as f32 + 0.5) / HOURS as f32;
            let to_sun = Vec3::new(angle.cos(), angle.sin(), 0.4).normalize();
            if normal.dot(to_sun) > 0.0 {
                let origin = (position + offset * normal).to_array();
                rays.push(Ray { origin, tmin: 0.0, direction: to_sun.to_array(), tmax: f32::INFINITY });
                pixel_of_ray.push(k);
            }
        }
    }

    // all rays at once: those that hit nothing see the sun
    let (hits, _) = trace(&tracer, &rays, Mode::Any, 1, &mut NoControl)?;
    let mut sunlight = vec![0.0f32; pixels.len()];
    for (hit, k) in hits.iter().zip(pixel_of_ray) {
        if !hit.is_hit() {
            sunlight[k] += 1.0 / HOURS as f32;
        }
    }
    let mean = sunlight.iter().map(|&s| f64::from(s)).sum::<f64>() / sunlight.len() as f64;
    skylit::output::save(&grey_image(sunlight, SIZE), image)?;
    Ok(mean)
}

fn main() -> skylit::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "builtin:stairs".to_owned());
    let image = arguments.next().unwrap_or_else(|| "custom_pass.png".to_owned());
    let mean = render(&scene, Path::new(&image))?;
    println!("{image}: on average {:.0} % of the day in the sun", 100.0 * mean);
    Ok(())
}
