//! Where the answer is the same everywhere it comes out exactly, in every frame.

use glam::DVec3;
use skylit::integrators::ao::Occlusion;
use skylit::realtime::{Filter, FilterKind, Preset, Settings};
use skylit::scene::Scene;
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::tracer::TracerKind;

use crate::common::{assert_validation_clean, device, tracer, tracers};
use crate::{realtime, stepped, traced};

/// All that trace, and the filter that no preset has.
fn pipelines(falloff: f64) -> Vec<(String, Settings)> {
    let occlusion = Occlusion::new(f64::INFINITY, falloff);
    let presets = Preset::ALL.into_iter().filter(|p| *p != Preset::Larsen);
    let mut all: Vec<_> = presets.map(|p| (p.name().to_owned(), Settings { occlusion, ..traced(p) })).collect();
    let base = traced(Preset::Balanced);
    let filter = Filter { kind: FilterKind::Atrous, radius: 7, ..base.filter };
    // the first frames rest on few samples: all of the box is in use
    all.push((filter.kind.name().to_owned(), Settings { filter, occlusion, ..base }));
    all
}

/// Three frames from one place, then three from others; `allowed`: pixels that may be off, of all frames together.
fn check(scene: &Scene, falloff: f64, step: f64, value: f32, allowed: impl Fn(TracerKind) -> usize) {
    let device = device();
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, scene);
        // tracers differ in what they trace, not in what is done with it
        let mut all = pipelines(falloff);
        all.truncate(if kind == TracerKind::Compute { all.len() } else { 2 });
        for (name, settings) in all {
            // 1024 rays a pixel are as many in a smaller image
            let size = if settings.rays_per_pixel > 64 { [16, 9] } else { [64, 36] };
            let mut realtime = realtime(&tracer, size, &settings);
            let (mut off, mut covered) = (0, 0);
            for frame in 0..6 {
                let moved = f64::from(u32::saturating_sub(frame, 2));
                let camera = stepped(scene, size, DVec3::new(0.7, 0.3, -0.4) * step * moved);
                realtime.frame(&tracer, &camera, &[]).unwrap();
                let (result, coverage) = (realtime.result().unwrap(), realtime.coverage().unwrap());
                let seen = result.iter().zip(&coverage).filter(|(_, c)| **c > 0.0);
                covered += seen.clone().count();
                off += seen.filter(|(v, _)| **v != value).count();
                let beside = result.iter().zip(&coverage).filter(|(v, c)| **c == 0.0 && **v != 0.0).count();
                assert_eq!(beside, 0, "{kind} {name}, frame {frame}: background that is not 0");
            }
            assert!(covered > 6 * (size[0] * size[1] / 4) as usize, "{kind} {name}: hardly anything is seen");
            assert!(off <= allowed(kind), "{kind} {name}: {off} of {covered} pixels are not {value}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_a_plane_is_one_in_every_frame() {
    let plane = analytic::plane(20.0, SceneTransform::default());
    check(&plane, 1.0, 0.05, 1.0, |_| 0);
    // nearest hits
    check(&plane, 4.0, 0.05, 1.0, |_| 0);
}

/// The hardware tracers' watertightness is their driver's affair (tests/ao/closed_forms.rs): a ray of a hundred thousand may get out, and
/// then the filter shows it in up to 15 x 15 pixels of the frames that follow.
#[test]
fn gpu_a_closed_box_is_zero_in_every_frame() {
    let spare = |kind| if kind == TracerKind::Compute { 0 } else { 225 };
    check(&analytic::closed_box(2.0, SceneTransform::default()), 1.0, 0.01, 0.0, spare);
}
