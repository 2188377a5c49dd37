//! At an edge in depth no pixel of one side takes anything of the other, neither from its neighbours nor from its history.
//!
//! Two walls of one mesh, parallel, one in front of the other. The shading normals of one side at a time are tilted, which changes what
//! its hemispheres see and nothing else: walls are closed bodies, so the rays below a surface end inside its own. Whatever then changes
//! on the other side has crept over the edge; the bits must be the same.

use glam::{DVec3, Vec3};
use skylit::integrators::ao::{Hemisphere, Occlusion};
use skylit::oracle::Oracle;
use skylit::oracle::camera::camera_ray;
use skylit::realtime::{Filter, FilterKind, Preset, Resolution, Settings};
use skylit::scene::builtin::shapes;
use skylit::scene::{Camera, Scene, TriangleMesh};

use crate::common::{assert_validation_clean, device, record, tracer, tracers};
use crate::{SIZE, bits, realtime, scene_of, traced};

const EYE: f64 = 5.0;

/// Which sides are tilted: the near wall fills all that is left of x = 0, the far one stands `gap` behind it, in a pit.
fn walls(gap: f64, tilted: [bool; 2]) -> Scene {
    let mut all = TriangleMesh::default();
    let mut add = |lo: [f64; 3], hi: [f64; 3], tilted: bool| {
        let body = crate::triangles(shapes::cuboid(lo.into(), hi.into()));
        let first = all.positions.len() as u32;
        let normal = if tilted { Vec3::new(0.3, 0.9, 0.2).normalize() } else { Vec3::Z };
        all.indices.extend(body.indices.iter().map(|t| t.map(|i| i + first)));
        all.normals.extend(vec![normal; body.positions.len()]);
        all.positions.extend(body.positions);
    };
    add([-20.0, -20.0, -20.0], [0.0, 20.0, 0.0], tilted[0]);
    // its face does not lie in one plane with anything, and its sides do not touch
    add([0.01, -20.0, -20.0], [20.0, 20.0, -gap], tilted[1]);
    scene_of(vec![all], Camera::look_at(DVec3::new(0.0, 0.0, EYE), DVec3::ZERO, DVec3::Y, 0.8))
}

/// What a pixel shows: which wall, and its face or another side.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DisplayMode {
    near: bool,
    face: bool,
}

fn shown(oracle: &Oracle, camera: &Camera) -> Vec<DisplayMode> {
    let of = |i: u32| {
        let ray = camera_ray(camera, DVec3::ZERO, SIZE, [i % SIZE[0], i / SIZE[0]].map(|v| f64::from(v) + 0.5));
        let hit = oracle.closest(ray);
        // a wall has twelve triangles
        DisplayMode { near: hit.primitive < 12, face: oracle.facing_normal(&ray, &hit).z > 0.5 }
    };
    (0..SIZE[0] * SIZE[1]).map(of).collect()
}

#[test]
fn gpu_nothing_crosses_an_edge_in_depth() {
    let device = device();
    let base = Settings {
        occlusion: Occlusion { hemisphere: Hemisphere::Shading, ..Default::default() },
        ..traced(Preset::Balanced)
    };
    let wide = |kind| Filter { kind, radius: 7, samples: 4096.0 };
    // what is filtered does not depend on the tracer
    for kind in tracers(&device).into_iter().take(1) {
        // 0.3 is four pixels' footprints
        for (gap, settings) in [
            (3.0, Settings { filter: wide(FilterKind::Box), ..base }),
            (0.3, base),
            (0.3, Settings { filter: wide(FilterKind::Atrous), ..base }),
            (0.3, Settings { filter: wide(FilterKind::Box), resolution: Resolution::Half, ..base }),
        ] {
            let mut images = Vec::new();
            for tilted in [[false, false], [true, false], [false, true]] {
                let scene = walls(gap, tilted);
                let tracer = tracer(&device, kind, &scene);
                let oracle = Oracle::new(&scene, DVec3::ZERO);
                let mut realtime = realtime(&tracer, SIZE, &settings);
                let mut seen = Vec::new();
                for frame in 0..12 {
                    // two from one place, then to the side, up and nearer, by parts of a pixel and by several
                    let step = f64::from(u32::saturating_sub(frame, 1));
                    let eye = DVec3::new(0.043 * step - 0.2, 0.03 * step, EYE - 0.05 * step * f64::from(frame % 2));
                    let camera = Camera::look_at(eye, eye - DVec3::Z, DVec3::Y, 0.8);
                    realtime.frame(&tracer, &record(&scene, &camera, SIZE), &[]).unwrap();
                    seen.push((shown(&oracle, &camera), realtime.result().unwrap(), realtime.unfiltered().unwrap()));
                }
                images.push(seen);
            }
            let what = format!("{kind}, gap {gap}, {:?}", settings.filter.kind);
            let (mut changed, mut partial) = ([0; 2], 0);
            let [plain, near_tilted, far_tilted] = [0, 1, 2].map(|k: usize| images[k].iter());
            for (frame, ((plain, near_tilted), far_tilted)) in plain.zip(near_tilted).zip(far_tilted).enumerate() {
                for i in 0..plain.0.len() {
                    let DisplayMode { near, face } = plain.0[i];
                    // as narrow as the other sides are seen, a pixel may be the only one of one, and guesses until it has had its turn
                    if !face && settings.resolution != Resolution::Full {
                        continue;
                    }
                    let (same, other) = if near { (far_tilted, near_tilted) } else { (near_tilted, far_tilted) };
                    let values = |image: &(Vec<DisplayMode>, Vec<f32>, Vec<f32>)| bits(&[image.1[i], image.2[i]]);
                    assert_eq!(
                        values(plain),
                        values(same),
                        "{what}, frame {frame}, pixel {i}: the other side's change is seen"
                    );
                    changed[usize::from(near)] += usize::from(values(plain) != values(other));
                    // nothing lies before the near wall's face
                    assert!(!near || !face || plain.1[i] == 1.0, "{what}, frame {frame}, pixel {i}: {}", plain.1[i]);
                    partial += usize::from(!near && plain.1[i] < 0.95);
                }
            }
            // there is something to see: the tilt changes a side, and the far wall is darker
            let pixels = images[0].len() * (SIZE[0] * SIZE[1]) as usize;
            assert!(changed.iter().all(|c| *c > pixels / 4), "{what}: {changed:?} of {pixels}");
            assert!(partial > pixels / 100, "{what}: {partial} of {pixels}");
        }
    }
    assert_validation_clean(&device);
}
