//! Means over images, with and without filter, against closed forms and against many rays.

use glam::DVec3;
use skylit::integrators::ao::Occlusion;
use skylit::oracle::closed_form as exact;
use skylit::realtime::{Filter, FilterKind, Preset, Resolution, Settings};
use skylit::sampling::Sequence;
use skylit::scene::Camera;
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::tracer::Tracer;

use crate::common::{assert_validation_clean, device, record, scene, tracer, tracers};
use crate::{NO_FILTER, SIZE, frames, mean, one_tracer, realtime, reference, traced};

/// Mean error of images of several seeds, and its standard error. Seeds are independent of each other, whatever the sequence.
fn error(
    tracer: &Tracer,
    settings: &Settings,
    camera: &skylit::film::camera::CameraRecord,
    want: &[f32],
    seeds: u32,
) -> (f64, f64) {
    let errors: Vec<f64> = (0..seeds)
        .map(|seed| {
            let settings = Settings { seed, ..*settings };
            let mut realtime = realtime(tracer, SIZE, &settings);
            let count = 16 * settings.resolution.period() / settings.rays_per_pixel.min(8);
            frames(&mut realtime, tracer, camera, count);
            let (got, seen) = (realtime.result().unwrap(), realtime.coverage().unwrap());
            mean((0..got.len()).filter(|&i| seen[i] > 0.0).map(|i| f64::from(got[i] - want[i])))
        })
        .collect();
    let bias = mean(errors.iter().copied());
    let variance = errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / f64::from(seeds - 1);
    (bias, (variance / f64::from(seeds)).sqrt())
}

const SEEDS: u32 = 5;

/// Independent samples of 0 and 1 would make it 7e-4.
const PRECISION: f64 = 1.2e-3;

/// Within five standard errors, beyond which five seeds are by chance in one of 130 cases (Student's t, four degrees of freedom); seeds are
/// fixed, so a case that passes does so always. `floor`: the standard error of what it is compared with.
fn judge(what: &str, (bias, error): (f64, f64), floor: f64) {
    println!("{what}: bias {bias:+.1e}, standard error {error:.1e}");
    assert!(error < PRECISION, "{what}: a standard error of {error} says little");
    assert!(bias.abs() <= 5.0 * error.hypot(floor) + 1e-5, "{what}: bias {bias}, standard error {error}");
}

#[test]
fn gpu_no_sequence_resolution_or_filter_is_biased_in_a_groove() {
    let device = device();
    let angle = 75f64.to_radians();
    let (sin, cos) = (angle * 0.5).sin_cos();
    let (up, normal) = (DVec3::new(sin, cos, 0.0), DVec3::new(-cos, sin, 0.0));
    // so long that it is the same wherever on the wall
    let scene = analytic::v_groove(angle, 1e4, 3e4, SceneTransform::default());
    let camera = record(&scene, &Camera::look_at(up + normal * 0.5, up, DVec3::Z, 0.6), SIZE);
    let want = vec![exact::v_groove(angle) as f32; (SIZE[0] * SIZE[1]) as usize];
    let base = traced(Preset::Balanced);
    let mut cases: Vec<Settings> =
        Sequence::ALL.map(|sequence| Settings { sequence, filter: NO_FILTER, ..base }).to_vec();
    cases.extend(
        [FilterKind::Box, FilterKind::Atrous]
            .map(|kind| Settings { filter: Filter { kind, radius: 3, samples: 256.0 }, ..base }),
    );
    cases.extend([Resolution::Checkerboard, Resolution::Half].map(|resolution| Settings { resolution, ..base }));
    cases.push(Settings { rays_per_pixel: 7, ..base });
    let kinds = tracers(&device);
    for &kind in &kinds {
        let tracer = tracer(&device, kind, &scene);
        // one tracer takes all of it, the others one case: their rays are the same
        let cases = if kind == kinds[0] { &cases[..] } else { &cases[1..2] };
        for s in cases {
            let what =
                format!("{kind}, {:?}, {:?}, {:?}, {} rays", s.sequence, s.resolution, s.filter.kind, s.rays_per_pixel);
            judge(&what, error(&tracer, s, &camera, &want, SEEDS), 0.0);
        }
    }
    assert_validation_clean(&device);
}

/// Where there is detail: contact shadows, edges, a curved surface. Histories have no bias; what filters have, which average over less
/// where a surface ends, is below a step of eight bits.
#[test]
fn gpu_filters_keep_the_mean_where_there_is_detail() {
    let device = device();
    let kind = one_tracer(&device)[0];
    for (name, falloff) in [("sphere-over-plane", 1.0), ("stairs", 4.0)] {
        let scene = scene(name);
        let tracer = tracer(&device, kind, &scene);
        let camera = record(&scene, &scene.cameras[0], SIZE);
        let base = Settings { occlusion: Occlusion::new(f64::INFINITY, falloff), ..traced(Preset::Balanced) };
        let want = reference(&tracer, SIZE, &base, &camera);
        // 256 well distributed rays in each of 5184 pixels: below that of independent ones
        let floor = 0.5 / (256.0 * f64::from(SIZE[0] * SIZE[1])).sqrt();
        for filter in [NO_FILTER, base.filter, Filter { kind: FilterKind::Atrous, ..base.filter }] {
            let settings = Settings { filter, ..base };
            let found = error(&tracer, &settings, &camera, &want, SEEDS);
            let what = format!("{name}, falloff {falloff}, {:?}", filter.kind);
            match filter.kind {
                FilterKind::None => judge(&what, found, floor),
                _ => {
                    println!("{what}: bias {:+.1e}, standard error {:.1e}", found.0, found.1);
                    assert!(found.1 < PRECISION && found.0.abs() <= 3e-3, "{what}: {found:?}");
                }
            }
        }
    }
    assert_validation_clean(&device);
}
