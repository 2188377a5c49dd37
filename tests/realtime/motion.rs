//! Histories while the camera moves, while things move, and while they change their shape.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, Mat4, Vec2, Vec3, Vec4};
use skylit::accel::flatten::FlatScene;
use skylit::colour::srgb_byte;
use skylit::film::NoControl;
use skylit::film::camera::CameraRecord;
use skylit::gpu::Device;
use skylit::integrators::ao::Occlusion;
use skylit::integrators::aov;
use skylit::measure::temporal::{Residual, recovery};
use skylit::oracle::{Oracle, OracleRay};
use skylit::output::tone_map::ToneMap;
use skylit::realtime::display::{Display, DisplayMode};
use skylit::realtime::{Preset, Realtime, Resolution, Settings};
use skylit::sampling::Sequence;
use skylit::scene::animation::{Playback, Pose};
use skylit::scene::builtin::shapes;
use skylit::scene::{Camera, Motion, Scene};
use skylit::tracer::{Changes, Tracer, TracerKind};

use crate::common::{ALL, assert_validation_clean, device, picked, record, scene, tracer, tracers};
use crate::{
    NO_FILTER, SIZE, frames, mean, one_tracer, realtime, reference, rmse, scene_of, stepped, traced, triangles,
};

#[test]
fn gpu_a_moving_camera_is_hardly_worse_than_a_still_one() {
    let device = device();
    let scene = scene("stairs");
    let end = stepped(&scene, SIZE, DVec3::ZERO);
    for kind in one_tracer(&device) {
        let tracer = tracer(&device, kind, &scene);
        // about places, not about evenness, which a still pixel's own Sobol sequence has more of than what is interpolated from several
        let blue = Settings { sequence: Sequence::Blue, ..traced(Preset::Fast) };
        for settings in [blue, Settings { filter: NO_FILTER, ..blue }] {
            let want = reference(&tracer, SIZE, &settings, &end);
            let error = |realtime: &Realtime| rmse(&realtime.result().unwrap(), &want, &realtime.coverage().unwrap());
            let mut still = realtime(&tracer, SIZE, &settings);
            frames(&mut still, &tracer, &end, 40);
            let mut moving = realtime(&tracer, SIZE, &settings);
            // by up to two pixels a frame, to the side and nearer
            for frame in (0..40).rev() {
                let camera = stepped(&scene, SIZE, DVec3::new(0.02, 0.007, 0.015) * f64::from(frame));
                moving.frame(&tracer, &camera, &[]).unwrap();
            }
            let (a, b) = (error(&still), error(&moving));
            let kept = mean(moving.samples().unwrap().into_iter().filter(|n| *n > 0.0).map(f64::from));
            println!("{kind}, {:?}: still {a:.4}, moving {b:.4}; {kept:.1} samples", settings.filter.kind);
            // what is interpolated in each of 32 frames is blurred, which in an image of so few pixels is as much again; a place that is half a
            // pixel off makes it more than four times as much
            assert!(b <= 2.5 * a, "{kind}: {b} after {a}");
            assert!(kept > 20.0, "{kind}: {kept} samples of 32 are left");
        }
    }
    assert_validation_clean(&device);
}

/// Pixels whose surface is well behind what the camera before saw in its place and next to it, or outside its image.
fn hidden_before(scene: &Scene, before: &CameraRecord, now: &CameraRecord) -> Vec<bool> {
    let oracle = Oracle::new(scene, scene.origin());
    let place = |c: &CameraRecord| {
        let rows = c.camera_to_world.map(|r| r.map(f64::from));
        DAffine3::from_cols_array_2d(&std::array::from_fn(|k| rows.map(|r| r[k])))
    };
    let look = |c: &CameraRecord, plane: [f64; 2]| {
        let p = place(c);
        let direction = p.transform_vector3(DVec3::new(plane[0], plane[1], -1.0));
        OracleRay { origin: p.translation, direction, tmin: 0.0, tmax: f64::INFINITY }
    };
    let view = now.view.map(f64::from);
    (0..SIZE[0] * SIZE[1])
        .map(|i| {
            let [x, y] =
                [(i % SIZE[0], SIZE[0]), (i / SIZE[0], SIZE[1])].map(|(v, n)| (2 * v + 1) as f64 / f64::from(n) - 1.0);
            let ray = look(now, [x * view[0], -y * view[1]]);
            let hit = oracle.closest(ray);
            if !hit.is_hit() {
                return false;
            }
            let c = place(before).inverse().transform_point3(ray.at(hit.t));
            let plane = [c.x / -c.z, c.y / -c.z];
            let inside = (0..2).all(|k| plane[k].abs() < view[k] * 1.05);
            // so that none of the four pixels around shows it; t is the view depth: directions have length 1 along the view
            let behind = |k: usize| {
                let around =
                    [0, 1].map(|axis| [-2.0, 0.0, 2.0][[k % 3, k / 3][axis]] * view[axis] / f64::from(SIZE[axis]));
                oracle.closest(look(before, [plane[0] + around[0], plane[1] + around[1]])).t < -c.z * 0.9
            };
            c.z < 0.0 && (!inside || (0..9).all(behind))
        })
        .collect()
}

#[test]
fn gpu_what_comes_into_sight_recovers() {
    let device = device();
    let scene = scene("stairs");
    let [from, to] = [0.6, 0.0].map(|x| stepped(&scene, SIZE, DVec3::X * x));
    let settings = Settings { filter: NO_FILTER, ..traced(Preset::Fast) };
    for kind in one_tracer(&device) {
        let tracer = tracer(&device, kind, &scene);
        let want = reference(&tracer, SIZE, &settings, &to);
        let mut realtime = realtime(&tracer, SIZE, &settings);
        frames(&mut realtime, &tracer, &from, 32);
        frames(&mut realtime, &tracer, &to, 1);
        let (samples, cover) = (realtime.samples().unwrap(), realtime.coverage().unwrap());
        // what was hidden behind something else, or out of the image by some pixels: nobody knew anything of it
        let hidden = hidden_before(&scene, &from, &to);
        let known = (0..samples.len()).filter(|&i| hidden[i] && samples[i] > 1.0).count();
        let count = hidden.iter().filter(|h| **h).count();
        println!("{kind}: {count} pixels were hidden, {known} of them claim to be known");
        assert!(count > 100 && known == 0, "{kind}: {known} of {count}");
        let new: Vec<f32> = samples.iter().map(|n| if *n == 1.0 { 1.0 } else { 0.0 }).collect();
        let share = mean(new.iter().map(|n| f64::from(*n))) / mean(cover.iter().map(|n| f64::from(*n)));
        assert!((0.02..0.6).contains(&share), "{kind}: {share} of what is seen is new");
        let own = realtime.unfiltered().unwrap();
        assert!(
            (0..own.len()).all(|i| new[i] == 0.0 || own[i] == 0.0 || own[i] == 1.0),
            "{kind}: a new pixel knows of the past"
        );
        let mut errors = vec![rmse(&own, &want, &new)];
        for _ in 1..36 {
            frames(&mut realtime, &tracer, &to, 1);
            errors.push(rmse(&realtime.result().unwrap(), &want, &new));
        }
        // what all pixels have in the end, and a pixel that starts afresh has after as many frames as its history counts
        let settled = rmse(&realtime.result().unwrap(), &want, &cover);
        let frame = recovery(&errors, settled, 1.3);
        println!("{kind}: {share:.3} new; errors {:.3?}, settled {settled:.4}, recovered in {frame:?}", &errors[..9]);
        assert!(errors[0] > 4.0 * settled && errors[8] < 0.5 * errors[0], "{kind}: {errors:?}");
        assert!(frame.is_some_and(|f| f <= 31), "{kind}: {errors:?}, settled {settled}");
    }
    assert_validation_clean(&device);
}

/// A floor and a block on it, seen from above; the block, instance 1, may move.
fn block_on_a_floor() -> Scene {
    let floor = triangles(shapes::floor(DVec3::ZERO, 12.0));
    let block = triangles(shapes::cuboid(DVec3::new(-0.5, 0.001, -0.5), DVec3::new(0.5, 1.2, 0.5)));
    scene_of(vec![floor, block], Camera::look_at(DVec3::new(0.0, 4.5, 4.0), DVec3::ZERO, DVec3::Y, 0.8))
}

/// What of a scene may move.
fn moving(device: &Arc<Device>, kind: TracerKind, scene: &Scene, instances: Vec<usize>) -> Tracer {
    let flat = FlatScene::with_motion(scene, Motion { instances, meshes: Vec::new(), ..Motion::default() }).unwrap();
    Tracer::new(device, kind, &flat, ALL).unwrap()
}

fn at(place: DAffine3) -> Changes<'static> {
    Changes { instances: vec![(1, place)], ..Changes::default() }
}

fn instances(tracer: &Tracer, camera: &CameraRecord) -> Vec<u32> {
    aov::render(tracer, camera, SIZE, &mut NoControl).unwrap().iter().map(|p| p.instance).collect()
}

/// Why pixels have no history, against where their surfaces were in the frame before: all of them in the first frame, the floor that a moving block uncovers,
/// and what a step of the camera brings into the image.
#[test]
fn gpu_displayed_reasons_of_rejected_histories() {
    const BACKGROUND: [u8; 3] = [0; 3];
    const KEPT: [u8; 3] = [0x40; 3];
    const NO_PAST: [u8; 3] = [255; 3];
    const OFF_SCREEN: [u8; 3] = [0x30, 0x60, 0xff];
    const INSTANCE: [u8; 3] = [0xe0, 0x30, 0x30];
    let device = device();
    let scene = block_on_a_floor();
    let [camera, shifted] = [0.0, 0.6].map(|x| stepped(&scene, SIZE, DVec3::new(x, 0.0, 0.0)));
    let display = Display { shown: DisplayMode::Rejected, exposure: 0.0, unit: 1.0, tone_map: ToneMap::Linear };
    let settings = Settings { antialias: false, resolution: Resolution::Full, ..traced(Preset::Fast) };
    for kind in picked(&device) {
        let mut tracer = moving(&device, kind, &scene, vec![1]);
        let [mut realtime, mut plain] = [(); 2].map(|()| realtime(&tracer, SIZE, &settings));
        realtime.display(&tracer, Some(display)).unwrap();
        let words = |realtime: &Realtime| -> Vec<[u8; 3]> {
            let bytes = realtime.displayed().unwrap().read(0, 4 * u64::from(SIZE[0] * SIZE[1])).unwrap();
            bytes.chunks_exact(4).map(|w| [w[0], w[1], w[2]]).collect()
        };
        let before = instances(&tracer, &camera);
        for colour in [NO_PAST, KEPT] {
            frames(&mut realtime, &tracer, &camera, 1);
            frames(&mut plain, &tracer, &camera, 1);
            let surfaces = realtime.surfaces().unwrap();
            for (word, surface) in words(&realtime).into_iter().zip(&surfaces) {
                assert_eq!(word, if surface.is_some() { colour } else { BACKGROUND }, "{kind}");
            }
        }
        // the floor is where it was: pixels that show it have a history, or showed the block
        let moved = tracer.update(&at(DAffine3::from_translation(DVec3::X * 0.3))).unwrap().moved;
        realtime.frame(&tracer, &camera, &moved).unwrap();
        plain.frame(&tracer, &camera, &moved).unwrap();
        assert_eq!(realtime.result().unwrap(), plain.result().unwrap(), "{kind}: what is shown changes nothing else");
        let (shown, now) = (words(&realtime), instances(&tracer, &camera));
        let (mut uncovered, mut covered, mut kept) = (0, 0, 0);
        for k in 0..now.len() {
            match (before[k], now[k]) {
                (0, 0) => assert_eq!(shown[k], KEPT, "{kind}: pixel {k}"),
                (1, 0) => {
                    assert_eq!(shown[k], INSTANCE, "{kind}: pixel {k}");
                    uncovered += 1;
                }
                (_, 1) => {
                    covered += 1;
                    kept += u32::from(shown[k] == KEPT);
                }
                _ => {}
            }
        }
        // the block moves with its history; one face of it comes into view, and edges are lost
        assert!(uncovered > 20 && kept * 4 > covered * 3, "{kind}: {uncovered} uncovered, {kept} of {covered} kept");
        let moved = tracer.update(&at(DAffine3::from_translation(DVec3::X * 0.3))).unwrap().moved;
        realtime.frame(&tracer, &shifted, &moved).unwrap();
        let shown = words(&realtime);
        let mut outside = 0;
        for (k, surface) in realtime.surfaces().unwrap().into_iter().enumerate() {
            let Some(surface) = surface else { continue };
            // in pixels beyond the image, negative inside
            let x = pixel_of(&camera, Vec3::from_array(surface.before)).x;
            let beyond = (-x).max(x - SIZE[0] as f32);
            outside += u32::from(beyond > 1.0);
            let expected = beyond > 1.0;
            assert!(
                beyond.abs() <= 1.0 || (shown[k] == OFF_SCREEN) == expected,
                "{kind}: {:?}, {beyond} outside",
                shown[k]
            );
        }
        assert!(outside > 50, "{kind}: {outside}");
    }
    assert_validation_clean(&device);
}

/// Motion vectors against what surface points say of themselves, and instances against a ray's hit.
#[test]
fn gpu_displayed_motion_and_ids() {
    let device = device();
    let scene = block_on_a_floor();
    let [camera, shifted] = [0.0, 0.11].map(|x| stepped(&scene, SIZE, DVec3::new(x, 0.0, -0.5 * x)));
    let display = |shown| Some(Display { shown, exposure: 0.0, unit: 1.0, tone_map: ToneMap::Linear });
    let grey = srgb_byte(0.5);
    for kind in one_tracer(&device) {
        let mut tracer = moving(&device, kind, &scene, vec![1]);
        let mut realtime = realtime(&tracer, SIZE, &traced(Preset::Fast));
        let words = |realtime: &Realtime| -> Vec<[u8; 3]> {
            let bytes = realtime.displayed().unwrap().read(0, 4 * u64::from(SIZE[0] * SIZE[1])).unwrap();
            bytes.chunks_exact(4).map(|w| [w[0], w[1], w[2]]).collect()
        };
        realtime.display(&tracer, display(DisplayMode::Ids)).unwrap();
        frames(&mut realtime, &tracer, &camera, 1);
        let colours: BTreeSet<_> = words(&realtime).into_iter().zip(instances(&tracer, &camera)).collect();
        let ids: BTreeSet<u32> = colours.iter().map(|c| c.1).collect();
        assert!(
            colours.len() == 3 && ids.len() == 3,
            "{kind}: a colour for the floor, the block and the background: {colours:?}"
        );
        realtime.display(&tracer, display(DisplayMode::Motion)).unwrap();
        frames(&mut realtime, &tracer, &camera, 1);
        assert!(words(&realtime).iter().all(|w| *w == [grey; 3] || *w == [0; 3]), "{kind}: nothing has moved");
        // the block alone, the camera alone, both
        let mut previous = camera;
        for (block, now) in [(0.09, camera), (0.09, shifted), (-0.04, camera)] {
            let moved = tracer.update(&at(DAffine3::from_translation(DVec3::X * block))).unwrap().moved;
            realtime.frame(&tracer, &now, &moved).unwrap();
            let shown = words(&realtime);
            let mut fastest = 0f32;
            for (k, surface) in realtime.surfaces().unwrap().into_iter().enumerate() {
                let Some(surface) = surface else { continue };
                let pixel = Vec2::new((k as u32 % SIZE[0]) as f32, (k as u32 / SIZE[0]) as f32) + 0.5;
                let motion = pixel - pixel_of(&previous, Vec3::from_array(surface.before));
                fastest = fastest.max(motion.length());
                let colour = |m: f32| srgb_byte(0.5 + 0.5 * m / (m.abs() + 8.0));
                let want = [colour(motion.x), colour(motion.y), grey];
                assert!(
                    (0..3).all(|c| shown[k][c].abs_diff(want[c]) <= 2),
                    "{kind}: {:?} for {motion}, not {want:?}",
                    shown[k]
                );
            }
            assert!(fastest > 1.0, "{kind}: at most {fastest} pixels");
            frames(&mut realtime, &tracer, &now, 1);
            assert!(words(&realtime).iter().all(|w| *w == [grey; 3] || *w == [0; 3]), "{kind}: it rests again");
            previous = now;
        }
    }
    assert_validation_clean(&device);
}

/// Where a point lies in the image of a perspective camera, in pixels from the upper left corner.
fn pixel_of(camera: &CameraRecord, point: Vec3) -> Vec2 {
    let rows = camera.camera_to_world.map(Vec4::from_array);
    let to_world = Mat4::from_cols(
        Vec4::new(rows[0].x, rows[1].x, rows[2].x, 0.0),
        Vec4::new(rows[0].y, rows[1].y, rows[2].y, 0.0),
        Vec4::new(rows[0].z, rows[1].z, rows[2].z, 0.0),
        Vec4::new(rows[0].w, rows[1].w, rows[2].w, 1.0),
    );
    let p = to_world.inverse().transform_point3(point);
    let ndc = Vec2::new(p.x / -p.z / camera.view[0], p.y / p.z / camera.view[1]);
    (0.5 * ndc + 0.5) * Vec2::new(SIZE[0] as f32, SIZE[1] as f32)
}

#[test]
fn gpu_what_has_moved_leaves_no_ghost() {
    let device = device();
    let scene = block_on_a_floor();
    let camera = record(&scene, &scene.cameras[0], SIZE);
    let settings = traced(Preset::Balanced);
    let places = [-1.2, 1.3].map(|x| DAffine3::from_translation(DVec3::X * x));
    for kind in one_tracer(&device) {
        let mut tracer = moving(&device, kind, &scene, vec![1]);
        tracer.update(&at(places[1])).unwrap();
        let truth = reference(&tracer, SIZE, &settings, &camera);
        let after = instances(&tracer, &camera);
        tracer.update(&at(places[0])).unwrap();
        let wrong = reference(&tracer, SIZE, &settings, &camera);
        let before = instances(&tracer, &camera);
        // floor, before and after: its history is there
        let floor: Vec<f32> =
            before.iter().zip(&after).map(|(a, b)| if (*a, *b) == (0, 0) { 1.0 } else { 0.0 }).collect();
        let mut realtime = realtime(&tracer, SIZE, &settings);
        frames(&mut realtime, &tracer, &camera, 64);
        let image = realtime.result().unwrap();
        let stale = Residual::from_images(&image, &truth, &wrong, Some(&floor)).unwrap();
        assert!((stale.share - 1.0).abs() < 0.05, "{kind}: before the move all is as it was: {stale:?}");
        let moved = tracer.update(&at(places[1])).unwrap().moved;
        assert_eq!(moved.len(), 1);
        let mut shares = Vec::new();
        for frame in 0..8 {
            realtime.frame(&tracer, &camera, if frame == 0 { &moved } else { &[] }).unwrap();
            shares.push(Residual::from_images(&realtime.result().unwrap(), &truth, &wrong, Some(&floor)).unwrap());
        }
        // one that knows nothing of the past
        let mut fresh = crate::realtime(&tracer, SIZE, &settings);
        frames(&mut fresh, &tracer, &camera, 8);
        let [a, b] = [&realtime, &fresh].map(|r| rmse(&r.result().unwrap(), &truth, &floor));
        let last = shares[7];
        println!(
            "{kind}: ghost {:.3?}; error {a:.4}, afresh {b:.4}",
            shares.iter().map(|r| r.share).collect::<Vec<_>>()
        );
        // noise that the filter spreads over 7x7 pixels has up to seven times the standard error
        assert!(last.share < 0.05 + 7.0 * last.standard_error && last.share < 0.15, "{kind}: {last:?}");
        assert!(a <= 1.25 * b + 0.005, "{kind}: error {a}, afresh {b}");
    }
    assert_validation_clean(&device);
}

/// What a thin pole uncovers shows nothing of the pole, neither at once nor some frames later.
#[test]
fn gpu_what_a_thin_pole_uncovers_is_what_is_there() {
    const FRAMES: u32 = 20;
    let device = device();
    let floor = triangles(shapes::floor(DVec3::ZERO, 12.0));
    let pole = triangles(shapes::cuboid(DVec3::new(-0.1, 0.001, -0.1), DVec3::new(0.1, 2.0, 0.1)));
    let camera = Camera::look_at(DVec3::new(0.0, 3.0, 5.0), DVec3::new(0.0, 0.5, 0.0), DVec3::Y, 0.8);
    let scene = scene_of(vec![floor, pole], camera);
    let camera = record(&scene, &scene.cameras[0], SIZE);
    let place = |frame: u32| at(DAffine3::from_translation(DVec3::X * (0.2 * f64::from(frame) - 2.0)));
    for (preset, kind) in [Preset::Fast, Preset::Balanced, Preset::Quality].into_iter().zip(tracers(&device)) {
        let settings = Settings { antialias: true, converge: true, ..traced(preset) };
        let mut tracer = moving(&device, kind, &scene, vec![1]);
        let mut poses = Vec::new();
        for frame in FRAMES - 6..FRAMES {
            tracer.update(&place(frame)).unwrap();
            poses.push((reference(&tracer, SIZE, &settings, &camera), instances(&tracer, &camera)));
        }
        let (truth, now) = poses.pop().unwrap();
        let mut realtime = realtime(&tracer, SIZE, &settings);
        for frame in 0..FRAMES {
            let moved = tracer.update(&place(frame)).unwrap().moved;
            realtime.frame(&tracer, &camera, &moved).unwrap();
        }
        let image = realtime.result().unwrap();
        let interior =
            |ids: &[u32], k: usize, id: u32| [0, 1, usize::MAX].into_iter().all(|step| ids[k.wrapping_add(step)] == id);
        for (frames, (before, covered)) in poses.iter().rev().enumerate() {
            let inside = 1..now.len() - 1;
            let is_uncovered = |k: usize| inside.contains(&k) && interior(covered, k, 1) && interior(&now, k, 0);
            let mask: Vec<f32> = (0..now.len()).map(|k| if is_uncovered(k) { 1.0 } else { 0.0 }).collect();
            let left = Residual::from_images(&image, &truth, before, Some(&mask)).unwrap();
            println!("{kind}, {preset}: {frames} frames after: {left:?}");
            assert!(
                left.share.abs() < 0.05 + 3.0 * left.standard_error,
                "{kind}, {preset}, {frames} frames after: {left:?}"
            );
        }
    }
    assert_validation_clean(&device);
}

/// A camera that jumps to other surfaces begins anew, and one that is told to: the frames are those of an image that begins there.
#[test]
fn gpu_after_a_cut_frames_are_those_of_a_fresh_start() {
    let device = device();
    let scene = block_on_a_floor();
    let view = |eye: DVec3, target: DVec3| record(&scene, &Camera::look_at(eye, target, DVec3::Y, 0.6), SIZE);
    let eye = DVec3::new(0.0, 2.0, 3.0);
    let [block, step] = [0.0, 0.02].map(|x| view(eye, DVec3::new(x, 0.5, 0.0)));
    let elsewhere = view(eye, DVec3::new(3.0, 0.0, 4.0));
    for (preset, kind) in [Preset::Balanced, Preset::Quality].into_iter().zip(tracers(&device)) {
        let settings = Settings { antialias: true, converge: true, ..traced(preset) };
        let tracer = tracer(&device, kind, &scene);
        let shown = |realtime: &mut Realtime, camera: &CameraRecord| -> Vec<Vec<f32>> {
            let one = |_| {
                frames(realtime, &tracer, camera, 1);
                realtime.result().unwrap()
            };
            (0..3).map(one).collect()
        };
        let after_block = |is_declared: bool, camera: &CameraRecord| {
            let mut realtime = realtime(&tracer, SIZE, &settings);
            frames(&mut realtime, &tracer, &block, 6);
            if is_declared {
                realtime.rewind();
            }
            shown(&mut realtime, camera)
        };
        let fresh = |camera: &CameraRecord| shown(&mut realtime(&tracer, SIZE, &settings), camera);
        assert!(after_block(true, &step) == fresh(&step), "{kind}, {preset}: a cut that is declared");
        assert!(after_block(false, &elsewhere) == fresh(&elsewhere), "{kind}, {preset}: a jump to other surfaces");
        assert!(after_block(false, &step) != fresh(&step), "{kind}, {preset}: a step is no cut");
    }
    assert_validation_clean(&device);
}

/// What moves behind the camera, farther off than rays reach: histories stay as they are.
#[test]
fn gpu_what_moves_far_away_costs_no_history() {
    let device = device();
    let scene = block_on_a_floor();
    let camera = record(&scene, &scene.cameras[0], SIZE);
    let settings = Settings { occlusion: Occlusion::new(1.0, 1.0), filter: NO_FILTER, ..traced(Preset::Balanced) };
    for kind in one_tracer(&device) {
        let mut tracer = moving(&device, kind, &scene, vec![1]);
        let mut realtime = realtime(&tracer, SIZE, &settings);
        for frame in 0..16 {
            let place = DAffine3::from_translation(DVec3::new(0.4 * f64::from(frame) - 3.0, 3.0, 8.0));
            let moved = tracer.update(&at(place)).unwrap().moved;
            realtime.frame(&tracer, &camera, &moved).unwrap();
        }
        let (samples, cover) = (realtime.samples().unwrap(), realtime.coverage().unwrap());
        assert!(samples.iter().zip(&cover).all(|(n, c)| *n == 16.0 * c), "{kind}: history was lost");
    }
    assert_validation_clean(&device);
}

/// A block that comes nearer, to the side and turns: its points are found where they were. Weights of motion are left out: this is about
/// positions alone. Nothing is near but its own sides.
#[test]
fn gpu_a_surface_keeps_its_history_as_it_moves() {
    let device = device();
    let mut scene = block_on_a_floor();
    scene.meshes[0].geometry = shapes::floor(DVec3::Y * -50.0, 0.5);
    let camera = record(&scene, &scene.cameras[0], SIZE);
    let settings = Settings { filter: NO_FILTER, moved_weight: 0.0, ..traced(Preset::Balanced) };
    let place = |frame: u32| {
        let k = f64::from(frame);
        // a good tenth of a unit: two footprints along the view, and a turn of two degrees
        DAffine3::from_translation(DVec3::new(0.02 * k, 0.09 * k, 0.08 * k) - DVec3::Y)
            * DAffine3::from_quat(DQuat::from_rotation_y(0.035 * k))
    };
    let count = 12;
    for kind in picked(&device) {
        let mut tracer = moving(&device, kind, &scene, vec![1]);
        tracer.update(&at(place(0))).unwrap();
        let mut realtime = realtime(&tracer, SIZE, &settings);
        for frame in 0..count {
            let moved = tracer.update(&at(place(frame))).unwrap().moved;
            assert_eq!(moved.len(), usize::from(frame > 0));
            realtime.frame(&tracer, &camera, &moved).unwrap();
        }
        let (samples, shown) = (realtime.samples().unwrap(), instances(&tracer, &camera));
        let block: Vec<f32> = (0..samples.len()).filter(|&i| shown[i] == 1).map(|i| samples[i]).collect();
        let full = block.iter().filter(|n| **n > count as f32 - 0.5).count() as f64 / block.len() as f64;
        println!("{kind}: {full:.3} of {} pixels have all {count} samples", block.len());
        // those at its silhouette have seen less
        assert!(block.len() > 200 && full > 0.8, "{kind}: {full} of {}", block.len());
    }
    assert_validation_clean(&device);
}

/// With the weights of motion as presets have them, what moves slowly keeps some of its history: more than a frame's own sample.
#[test]
fn gpu_what_moves_slowly_is_more_than_noise() {
    let device = device();
    let scene = block_on_a_floor();
    let camera = record(&scene, &scene.cameras[0], SIZE);
    for kind in one_tracer(&device) {
        let mut tracer = moving(&device, kind, &scene, vec![1]);
        let mut realtime = realtime(&tracer, SIZE, &traced(Preset::Balanced));
        for frame in 0..24 {
            let moved =
                tracer.update(&at(DAffine3::from_translation(DVec3::X * 0.004 * f64::from(frame)))).unwrap().moved;
            realtime.frame(&tracer, &camera, &moved).unwrap();
        }
        let (samples, shown) = (realtime.samples().unwrap(), instances(&tracer, &camera));
        let of = |id: u32| mean((0..samples.len()).filter(|&i| shown[i] == id).map(|i| f64::from(samples[i])));
        println!("{kind}: {:.1} samples on the block, {:.1} on the floor, of 24", of(1), of(0));
        assert!(of(1) > 3.0 && of(0) > 10.0, "{kind}: {} {}", of(1), of(0));
    }
    assert_validation_clean(&device);
}

/// Blocks, a rotor, a column that bends and a ball that changes its shape: where they were is known, vertex by vertex.
#[test]
fn gpu_an_animation_keeps_its_histories() {
    let device = device();
    let scene = scene("parade");
    let rig = scene.rig.as_ref().unwrap();
    let settings = Settings { filter: NO_FILTER, moved_weight: 0.0, ..traced(Preset::Balanced) };
    let motion = rig.motion(0).unwrap();
    let camera = record(&scene, &scene.cameras[0], SIZE);
    for kind in picked(&device) {
        let mut tracer =
            Tracer::new(&device, kind, &FlatScene::with_motion(&scene, motion.clone()).unwrap(), ALL).unwrap();
        let mut realtime = realtime(&tracer, SIZE, &settings);
        let mut pose = Pose::default();
        let count = 10;
        for frame in 0..count {
            rig.pose(0, 0.4 + f64::from(frame) / 60.0, Playback::Loop, &mut pose).unwrap();
            let moved = tracer.update(&pose.changes()).unwrap().moved;
            assert!(!moved.is_empty());
            realtime.frame(&tracer, &camera, &moved).unwrap();
        }
        let (samples, shown) = (realtime.samples().unwrap(), instances(&tracer, &camera));
        let mut told = 0;
        for (id, instance) in scene.instances.iter().enumerate() {
            let own: Vec<f64> =
                (0..samples.len()).filter(|&i| shown[i] == id as u32).map(|i| f64::from(samples[i])).collect();
            if own.len() < 15 {
                continue;
            }
            let kept = mean(own.iter().copied()) / f64::from(count);
            println!("{kind}: {} ({} pixels): {kept:.2} of its history", instance.name, own.len());
            // at most a third is lost at silhouettes, which these small things mostly are
            assert!(kept > 0.65, "{kind}: {} keeps {kept} of its history", instance.name);
            told += usize::from(motion.instances.contains(&id) || motion.meshes.contains(&instance.mesh));
        }
        assert!(told >= 4, "{kind}: only {told} of what moves is seen");
    }
    assert_validation_clean(&device);
}
