//! The screen-space technique: what its formula must give, what it cannot know, and what it leaves alone.

use glam::{DAffine3, DVec3};
use skylit::film::camera::CameraRecord;
use skylit::integrators::ao::Occlusion;
use skylit::oracle::camera::camera_ray;
use skylit::oracle::{Oracle, OracleRay, ao as oracle_ao, closed_form as exact};
use skylit::realtime::{GtaoConstants, Preset, Settings, Technique};
use skylit::sampling::Sampler;
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::scene::{Camera, Projection, Scene};
use skylit::tracer::Tracer;

use crate::common::{assert_validation_clean, device, record, scene, tracer};
use crate::{NO_FILTER, SIZE, frames, mean, one_tracer, realtime, reference, traced};

/// With steps and slices as many; the presets have few.
fn dense() -> Settings {
    Settings {
        gtao: [4, 32],
        gtao_constants: GtaoConstants::FORMULA,
        technique: Technique::Gtao,
        filter: NO_FILTER,
        history: 16,
        ..traced(Preset::Balanced)
    }
}

fn sparse() -> Settings {
    Settings { gtao: Preset::Balanced.settings().gtao, ..dense() }
}

/// Ambient visibility over sixteen frames, and where something is.
fn image(tracer: &Tracer, settings: &Settings, camera: &CameraRecord) -> (Vec<f32>, Vec<f32>) {
    let mut realtime = realtime(tracer, SIZE, settings);
    frames(&mut realtime, tracer, camera, 16);
    (realtime.result().unwrap(), realtime.coverage().unwrap())
}

/// One tracer: none of this depends on which.
fn with_tracer(scene: &Scene, claim: impl Fn(&Tracer)) {
    let device = device();
    one_tracer(&device).into_iter().for_each(|kind| claim(&tracer(&device, kind, scene)));
    assert_validation_clean(&device);
}

/// The camera turned about its own axis.
fn rolled(camera: &Camera, degrees: f64) -> Camera {
    let turn = DAffine3::from_rotation_z(degrees.to_radians());
    Camera { camera_to_world: camera.camera_to_world * turn, ..camera.clone() }
}

#[test]
fn gpu_screen_space_a_plane_is_one() {
    let scene = analytic::plane(20.0, SceneTransform::default());
    with_tracer(&scene, |tracer| {
        let target = DVec3::ZERO;
        for (what, eye, fov) in [
            ("from above", DVec3::new(0.0, 8.0, 0.1), 1.2),
            ("aslant", DVec3::new(0.0, 5.0, 9.0), 0.8),
            ("along", DVec3::new(0.0, 1.2, 9.0), 0.8),
        ] {
            let seen = Camera::look_at(eye, target, DVec3::Y, fov);
            let parallel = Camera { projection: Projection::Orthographic { half_height: 4.0 }, ..seen.clone() };
            for camera in [seen.clone(), rolled(&seen, 35.0), parallel] {
                for settings in [sparse(), Settings { occlusion: Occlusion::new(2.0, 1.0), ..sparse() }] {
                    let (image, cover) = image(tracer, &settings, &record(&scene, &camera, SIZE));
                    let values: Vec<f64> =
                        (0..image.len()).filter(|&i| cover[i] > 0.0).map(|i| f64::from(image[i])).collect();
                    let least = values.iter().copied().fold(1.0, f64::min);
                    println!(
                        "{what}, {:?}: mean {:.4}, least {least:.4}",
                        camera.projection,
                        mean(values.iter().copied())
                    );
                    assert!(least > 0.99, "{what}: {least}");
                    assert!(
                        (0..image.len()).all(|i| cover[i] > 0.0 || image[i] == 0.0),
                        "{what}: background is touched"
                    );
                }
            }
        }
    });
}

/// Grooves that the image shows whole, turned about the view: directions and rows go the right way round. The short one fills the image's
/// width: what occludes is up to a whole width away.
#[test]
fn gpu_screen_space_a_groove_is_as_the_closed_form_says() {
    let (angle, length) = (std::f64::consts::FRAC_PI_2, 2.0);
    let far = Camera::look_at(DVec3::new(0.6, 9.0, 0.8), DVec3::new(0.0, 0.7, 0.0), DVec3::X, 1.1);
    let near = Camera::look_at(DVec3::new(0.05, 3.7, 0.02), DVec3::ZERO, DVec3::Z, 0.75);
    for (width, camera, turns) in [(8.0, far, &[0.0, 35.0, 90.0, 200.0][..]), (1.5, near, &[0.0, 180.0])] {
        let scene = analytic::v_groove(angle, length, width, SceneTransform::default());
        with_tracer(&scene, |tracer| {
            let oracle = Oracle::new(&scene, DVec3::ZERO);
            for degrees in turns {
                let camera = rolled(&camera, *degrees);
                for (what, settings, allowed) in [("dense", dense(), 0.015), ("as presets", sparse(), 0.1)] {
                    let (image, cover) = image(tracer, &settings, &record(&scene, &camera, SIZE));
                    let mut errors = Vec::new();
                    for i in (0..image.len()).filter(|&i| cover[i] > 0.0) {
                        let film = [i as u32 % SIZE[0], i as u32 / SIZE[0]].map(|v| f64::from(v) + 0.5);
                        let ray = camera_ray(&camera, DVec3::ZERO, SIZE, film);
                        let p = ray.at(oracle.closest(ray).t);
                        let distance = p.x.hypot(p.y);
                        // not at the bottom, where a pixel is not small
                        if distance > 0.3 && distance.is_finite() {
                            errors.push(
                                f64::from(image[i]) - exact::v_groove_finite(angle, distance, p.z, length, width),
                            );
                        }
                    }
                    let what = format!("{degrees} degrees, width {width}, {what}");
                    let (error, bias) = (mean(errors.iter().map(|e| e.abs())), mean(errors.iter().copied()));
                    println!("{what}: mean error {error:.4}, bias {bias:+.4} over {} pixels", errors.len());
                    // few steps miss the top of the other wall
                    assert!(errors.len() > 500 && error < allowed, "{what}: {error}");
                }
            }
        });
    }
}

/// From inside. What the image does not show, it takes for open; so it lies between what is traced and that with all hits left out that
/// the image does not show.
#[test]
fn gpu_screen_space_is_off_by_what_the_image_does_not_show() {
    let room = scene("cornell-box");
    let (lo, hi) = room.bounds().unwrap();
    let inside = |from: DVec3, to: DVec3| Camera::look_at(lo + (hi - lo) * from, lo + (hi - lo) * to, DVec3::Y, 1.2);
    let stairs = scene("stairs");
    for (what, scene, camera) in [
        ("cornell box", &room, room.cameras[0].clone()),
        ("from inside", &room, inside(DVec3::new(0.9, 0.6, 0.05), DVec3::new(0.2, 0.3, 0.9))),
        ("stairs", &stairs, stairs.cameras[0].clone()),
    ] {
        with_tracer(scene, |tracer| {
            let at = record(scene, &camera, SIZE);
            let oracle = Oracle::new(scene, scene.origin());
            let eye = camera.camera_to_world.translation - scene.origin();
            let far = (hi - lo).length();
            let (found, cover) = image(tracer, &dense(), &at);
            let few = image(tracer, &sparse(), &at).0;
            let want = reference(tracer, SIZE, &dense(), &at);
            let to_camera = camera.camera_to_world.inverse();
            // does the image show this point?
            let shown = |p: DVec3| {
                let c = to_camera.transform_point3(p + scene.origin());
                let view = at.view.map(f64::from);
                let within = c.z < 0.0 && (c.x / -c.z).abs() <= view[0] && (c.y / -c.z).abs() <= view[1];
                let to = p - eye;
                within && oracle.closest(toward(eye, to.normalize())).t >= to.length() - 1e-3 * far
            };
            let (mut hidden, mut got, mut few_got, mut traced) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
            let sampler = Sampler { seed: 3 };
            for i in (0..found.len()).filter(|&i| cover[i] > 0.0).step_by(7) {
                let pixel = [i as u32 % SIZE[0], i as u32 / SIZE[0]];
                let ray = camera_ray(&camera, oracle.origin(), SIZE, pixel.map(|v| f64::from(v) + 0.5));
                let hit = oracle.closest(ray);
                let normal = oracle.facing_normal(&ray, &hit);
                let from = ray.at(hit.t) + normal * (1e-6 * far);
                let unseen = |k: u32| {
                    let w = toward(from, oracle_ao::ao_direction(sampler, pixel, k, normal));
                    let hit = oracle.closest(w);
                    f64::from(hit.is_hit() && !shown(w.at(hit.t)))
                };
                hidden.push(mean((0..16).map(unseen)));
                got.push(f64::from(found[i]));
                few_got.push(f64::from(few[i]));
                traced.push(f64::from(want[i]));
            }
            let [hidden, got, few_got, traced] = [hidden, got, few_got, traced].map(mean);
            println!(
                "{what}: {got:.3} ({few_got:.3} with few steps), traced {traced:.3}, rays to what is not shown {hidden:.3}"
            );
            // what lies behind something seen it takes for solid
            assert!(got > traced - 0.03, "{what}: {got}, traced {traced}");
            assert!(got < traced + hidden + 0.03, "{what}: {got}, traced {traced}, unseen {hidden}");
            // six steps miss what is thin, and see less of what is far
            assert!((few_got - got).abs() < 0.2, "{what}: {few_got} with few steps, {got} with many");
        });
    }
}

fn toward(origin: DVec3, direction: DVec3) -> OracleRay {
    OracleRay { origin, direction, tmin: 0.0, tmax: f64::INFINITY }
}
