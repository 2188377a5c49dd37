//! The numerical stress suite (`skylit stress`): its cheap sections hold on every tracer of the device, and a defect planted in each section is caught.

#[path = "common/mod.rs"]
mod common;

use common::{assert_validation_clean, device};
use glam::{DVec3, Vec3};
use skylit::film::SampleSettings;
use skylit::film::{Film, NoControl};
use skylit::measure::ray_sets::{leak_rays, random_rays};
use skylit::oracle::Oracle;
use skylit::realtime::{Filter, FilterKind, Settings};
use skylit::scene::builtin::{SceneTransform, analytic, by_name, shapes};
use skylit::scene::{Geometry, Scene, TriangleMesh};
use skylit::stress::{
    Check, Quiet, SECTIONS, Setup, StressSession, Verdict, Watch, contact, counters, degenerate, determinism,
    direct_light, display, hot_pixel, long_runs, sampling, scale, scene, transparency, watertight,
};
use skylit::tracer::TracerKind;

fn setup() -> Setup {
    Setup::new(device())
}

/// Runs a section; all of its checks must hold.
fn holds(name: &str, setup: Setup) -> Vec<Check> {
    let section = SECTIONS.iter().find(|s| s.name == name).unwrap();
    let mut quiet = Quiet;
    let mut session = StressSession::new(setup, &mut quiet);
    let checks = session.run(section).unwrap();
    for check in &checks {
        println!("{:?} {} {}: {}; {}", check.verdict, check.tracer_name(), check.name, check.figure(), check.sentence);
        assert_ne!(check.verdict, Verdict::Fails, "{check:?}");
    }
    assert!(checks.iter().any(|c| c.verdict == Verdict::Holds), "{name}: nothing was held");
    assert_validation_clean(&device());
    checks
}

fn fails(check: &Check) {
    assert_eq!(check.verdict, Verdict::Fails, "the defect was not caught: {check:?}");
}

fn triangles(geometry: &mut Geometry) -> &mut TriangleMesh {
    match geometry {
        Geometry::Triangles(mesh) => mesh,
        Geometry::Spheres(_) => panic!("spheres"),
    }
}

#[test]
fn gpu_stress_scale_holds() {
    // on one tracer: tests/ao has the others
    let checks = holds("scale", setup().with_tracer(TracerKind::Compute));
    assert!(checks.len() > 80, "{}", checks.len());
}

#[test]
fn gpu_stress_contact_holds() {
    holds("contact", setup());
}

#[test]
fn gpu_stress_lengths_hold() {
    // the hits of the compute tracer are its own; tests/ao has images of all tracers
    holds("lengths", setup().with_tracer(TracerKind::Compute));
}

#[test]
fn gpu_stress_display_holds() {
    holds("display", setup());
}

#[test]
fn gpu_stress_scenes_hold() {
    for name in ["stairs", "leaf-cards", "far-away"] {
        let checks = holds("scene", setup().with_scene(by_name(name).unwrap()));
        let edges = checks.iter().filter(|c| c.name == "rays at shared edges").count();
        assert_eq!(edges, common::tracers(&device()).len(), "{name}");
    }
}

/// A ray that meets one of 100,000 coincident triangles, or of as many triangles or instances in one plane around one another, meets them all: that is more
/// iterations of a loop than some drivers make.
#[test]
fn gpu_stress_surfaces_in_one_place_hold() {
    const COUNT: u32 = 100_000;
    let mut quiet = Quiet;
    for (what, scenes) in [
        ("same vertices", degenerate::coincident(COUNT, false)),
        ("vertices of their own", degenerate::coincident(COUNT, true)),
        ("triangles around one another", degenerate::overlapping(COUNT, false)),
        ("instances around one another", degenerate::overlapping(COUNT, true)),
    ] {
        let mut watch = Watch::new(&mut quiet);
        let check = degenerate::check_as_one(&setup(), TracerKind::Compute, what, COUNT, &scenes, &mut watch).unwrap();
        assert_eq!(check.verdict, Verdict::Holds, "{check:?}");
    }
}

/// Section 3: one of many triangles in a plane that lies a thousandth before it, the last that a ray would come to.
#[test]
fn gpu_stress_catches_a_triangle_that_is_passed_over() {
    const COUNT: u32 = 20_000;
    let mut quiet = Quiet;
    let mut compare_hits = |scenes: &[Scene; 2]| {
        let mut watch = Watch::new(&mut quiet);
        degenerate::check_as_one(&setup(), TracerKind::Compute, "moved", COUNT, scenes, &mut watch).unwrap()
    };
    let mut scenes = degenerate::overlapping(COUNT, false);
    assert_eq!(compare_hits(&scenes).verdict, Verdict::Holds);
    let mesh = triangles(&mut scenes[0].meshes[0].geometry);
    let last = mesh.indices[COUNT as usize - 1];
    last.into_iter().for_each(|i| mesh.positions[i as usize].z += 1e-3);
    fails(&compare_hits(&scenes));
}

/// Section 1: a sheet over a plane that should not occlude itself, a groove that is narrower than its closed form, and detail that positions do not hold.
#[test]
fn gpu_stress_catches_a_wrong_scale() {
    let (setup, mut quiet) = (setup(), Quiet);
    let mut watch = Watch::new(&mut quiet);
    let mut plane = analytic::plane(10.0, SceneTransform::default());
    let mut sheet = plane.instances[0].clone();
    sheet.object_to_world.translation.y = 5.0;
    plane.instances.push(sheet);
    fails(&scale::check_exact(&setup, TracerKind::Compute, "sheet", &plane, 1.0, &mut watch).unwrap());
    let mut forms = scale::closed_forms_at(SceneTransform::default());
    let groove = &mut forms[0];
    groove.scene.instances[0].object_to_world = glam::DAffine3::from_rotation_z(-0.03);
    fails(&scale::check_form(&setup, TracerKind::Compute, "narrow", groove, 256, &mut watch).unwrap());
    let coarse = scale::georeferenced_scene(true).unwrap();
    let step = scale::traced_step(&setup.tracer(TracerKind::Compute, &coarse).unwrap(), &coarse, &mut watch).unwrap();
    assert!((step - 1e-3).abs() > 5e-4, "{step}");
}

/// Section 1: a light that is a hundred-thousandth stronger than its closed form has it, and one that nested nodes turn.
#[test]
fn gpu_stress_catches_wrong_direct_light() {
    let (setup, mut quiet) = (setup(), Quiet);
    let options =
        skylit::integrators::path::PathOptions { samples: SampleSettings::new([16, 16], 16, 5), ..Default::default() };
    let mut check = |scene: &Scene, expected: f64| {
        let mut watch = Watch::new(&mut quiet);
        sampling::check_mean(&setup, TracerKind::Compute, "light", scene, &options, expected, 2e-6, &mut watch).unwrap()
    };
    let (_, floor, expected) = direct_light::lit_floors(1.0).into_iter().find(|f| f.0 == "directional light").unwrap();
    let nested = direct_light::nested(&floor).unwrap();
    assert_eq!((nested.lights.len(), check(&nested, expected).verdict), (1, Verdict::Holds));
    fails(&check(&nested, expected * (1.0 + 1e-5)));
    let mut moved = nested;
    moved.lights[0].direction = (moved.lights[0].direction + DVec3::X * 1e-4).normalize();
    fails(&check(&moved, expected));
}

/// Section 2: a body with a hole that is called closed.
#[test]
fn gpu_stress_catches_a_hole() {
    let mut body = analytic::closed_box(1.0, SceneTransform::default());
    body.meshes[0].geometry = shapes::icosphere(1.0, 3);
    let rays = leak_rays(&Oracle::new(&body, DVec3::ZERO), 20_000, 7);
    let (setup, mut quiet) = (setup(), Quiet);
    let mut watch = Watch::new(&mut quiet);
    let check = |scene: &Scene, watch: &mut Watch| {
        watertight::check(&setup.tracer(TracerKind::Compute, scene).unwrap(), "hole", &rays, watch).unwrap()
    };
    assert_eq!(check(&body, &mut watch).verdict, Verdict::Holds);
    triangles(&mut body.meshes[0].geometry).indices.pop();
    fails(&check(&body, &mut watch));
}

/// Section 3: one triangle of many lies elsewhere than the oracle has it, and a file is accepted that should not be.
#[test]
fn gpu_stress_catches_a_wrong_triangle() {
    let (setup, mut quiet) = (setup(), Quiet);
    let mut watch = Watch::new(&mut quiet);
    let (scene, _) = degenerate::without_area(60, 0);
    let oracle = Oracle::new(&scene, DVec3::ZERO);
    let rays = random_rays(&oracle, 20_000, 3);
    let truth = degenerate::trace_oracle(&oracle, &rays);
    let mut compare_hits = |scene: &Scene| {
        let tracer = setup.tracer(TracerKind::Compute, scene).unwrap();
        degenerate::parity_check(
            "moved",
            &degenerate::compare_hits(&tracer, &oracle, &rays, &truth, &mut watch).unwrap(),
        )
    };
    assert_eq!(compare_hits(&scene).verdict, Verdict::Holds);
    let mut moved = scene.clone();
    let mesh = triangles(&mut moved.meshes[0].geometry);
    let sound = mesh.indices[5];
    sound.into_iter().for_each(|i| mesh.positions[i as usize] += Vec3::splat(0.02));
    fails(&compare_hits(&moved));
    let file = degenerate::triangle_file(["0 0 0", "1 0 0", "0 1 0"]);
    fails(&degenerate::check_file(&setup, TracerKind::Compute, "file", file, true, &mut watch).unwrap());
}

/// Section 4: rays that start on the surface, or almost there, and sheets that single precision cannot tell apart.
#[test]
fn gpu_stress_catches_a_wrong_spawn_offset() {
    let setup = setup();
    let (_, scene, normal, point) =
        contact::slack_planes().into_iter().find(|p| p.0 == "tilted plane, scale 1e0").unwrap();
    let tracer = setup.tracer(TracerKind::Compute, &scene).unwrap();
    let slack = |by: f64| contact::slack(&tracer, &scene, normal, point, by, &mut NoControl).unwrap();
    let (right, wrong) = (slack(1.0), slack(0.0));
    println!("{right:?} {wrong:?}");
    assert!(right.self_hits == 0 && right.factor >= 1.0, "{right:?}");
    assert!(wrong.self_hits > 0, "{wrong:?}");
    let sheets = setup.tracer(TracerKind::Compute, &contact::sheets(1e-9)).unwrap();
    assert!(contact::wrong_sides(&sheets, 2000, &mut NoControl).unwrap() > 0);
}

/// Section 5: a layer too few, and an alpha on the wrong side of its cutoff.
#[test]
fn gpu_stress_catches_wrong_layers() {
    let (setup, mut quiet) = (setup(), Quiet);
    let mut watch = Watch::new(&mut quiet);
    let options =
        skylit::integrators::path::PathOptions { samples: SampleSettings::new([16, 16], 512, 3), ..Default::default() };
    let (scene, _) = transparency::layers(60, 0.02);
    let (_, expected) = transparency::layers(64, 0.02);
    fails(
        &sampling::check_mean(&setup, TracerKind::Compute, "layers", &scene, &options, expected, 1e-5, &mut watch)
            .unwrap(),
    );
    let hits = |alpha: f32| {
        transparency::cutout_hits(
            &setup.tracer(TracerKind::Compute, &transparency::cutout(alpha)).unwrap(),
            &mut NoControl,
        )
        .unwrap()
    };
    assert_eq!((hits(0.5), hits(0.5f32.next_down())), (100, 0));
}

/// Section 6: a film with a sample that is not finite, and one with a mean that is off.
#[test]
fn stress_catches_a_bad_film() {
    let film = |mean: f32, not_finite: u64| {
        let values = (0..16 * 16).flat_map(|k| [mean + 1e-3 * ((k * 37 % 16) as f32 - 7.5); 3]).collect();
        Film { mean: values, not_finite, ..Film::new(16, 16, 3) }
    };
    assert_eq!(sampling::held_mean("good", &film(1.0, 0), 1.0, 0.0).verdict, Verdict::Holds);
    fails(&sampling::held_mean("off", &film(1.01, 0), 1.0, 0.0));
    fails(&sampling::held_mean("not finite", &film(1.0, 1), 1.0, 0.0));
    let mut bad = film(1.0, 0);
    bad.mean[7] = f32::NAN;
    assert_eq!(sampling::not_finite(&bad), 1);
    fails(&sampling::held_mean("not a number", &bad, 1.0, 0.0));
}

/// Section 7: a film that has drifted, and one whose sums differ in a bit.
#[test]
fn stress_catches_drift() {
    use skylit::film::accumulate::Accumulated;
    use skylit::film::state::FilmState;
    let seen = |factor: f32| {
        let mean = (0..4).flat_map(|_| [0.1 * factor, 0.7 * factor, 3.3 * factor]).collect();
        let film = Film { mean, ..Film::new(2, 2, 3) };
        long_runs::drift(&Accumulated { film, spp: 1, ..Default::default() }).0
    };
    assert!(seen(1.0) < 1e-6 && seen(1.0 + 3e-6) > 1e-6, "{} {}", seen(1.0), seen(1.0 + 3e-6));
    let state = FilmState::new([8, 8], 1);
    let words = skylit::film::record_words(1);
    let mut planes: Vec<Vec<u32>> = (0..words).map(|k| state.plane(k)).collect();
    planes[0][3] ^= 1;
    let other = FilmState::from_planes([8, 8], 1, &planes, &state.samples_plane()).unwrap();
    assert_eq!((long_runs::different_words(&state, &state), long_runs::different_words(&state, &other)), (0, 1));
}

/// Section 7: a view that is said to be open and is closed, every second time.
#[test]
fn gpu_stress_catches_the_history_of_another_view() {
    let (scene, views) = long_runs::open_and_closed();
    let tracer = common::tracer(&device(), TracerKind::Compute, &scene);
    let settings = display::filters()[0].1;
    let off = |shift: usize| {
        let in_turn = |frame: u32| (views[frame as usize % 2].0.clone(), views[(frame as usize + shift) % 2].1);
        long_runs::views_off(&tracer, &scene, &settings, 8, in_turn).unwrap()
    };
    let (right, wrong) = (off(0), off(1));
    assert!(right.0 == 0 && right.1 > 0 && wrong.0 == wrong.1, "{right:?} {wrong:?}");
}

/// Section 7: a film that has added up in single precision, samples that repeat or come from elsewhere, and frames that stand still.
#[test]
fn gpu_stress_catches_a_counter_that_stops() {
    let (setup, mut quiet) = (setup(), Quiet);
    let (first, last) = ((1u32 << 24) - 8, (1 << 24) + 8);
    let mut drift = |factor: f32| {
        let film = counters::film_after(counters::SIZE, first, [0.1, 0.7, 3.3].map(|x| x * factor));
        counters::film_drift(&setup, TracerKind::Compute, film, last, &mut Watch::new(&mut quiet)).unwrap()
    };
    let (right, wrong) = (drift(1.0), drift(1.0 + 3e-6));
    assert!(right < 1e-6 && wrong > 1e-6, "{right} {wrong}");
    // samples 0 and 1 in turn, of 100 pixels
    let count = 64;
    let of = |share: f64, varied: bool| {
        let sum = share * f64::from(count);
        let squares = if varied { sum } else { sum * share };
        counters::Sampled::from_sums(&[sum; 100], &[squares; 100], count)
    };
    assert!(of(0.5, true).distance(&of(0.51, true)) < 4.5);
    assert!(of(0.5, true).distance(&of(0.6, true)) > 4.5);
    assert!(of(0.5, false).distance(&of(0.5, true)).is_nan());
    let frames = |level: f32, stands: bool| -> Vec<Vec<f32>> {
        (0..16).map(|k| vec![level + if stands { 0.0 } else { 0.01 * (k * 7 % 5) as f32 }; 4]).collect()
    };
    assert!(counters::frame_distance(&frames(0.5, false), &frames(0.501, false)) < 4.5);
    assert!(counters::frame_distance(&frames(0.5, false), &frames(0.6, false)) > 4.5);
    assert!(counters::frame_distance(&frames(0.5, true), &frames(0.5, false)).is_nan());
}

/// Section 8: what a filter may not make of a hot pixel, and a spot larger than the filter is said to reach.
#[test]
fn gpu_stress_catches_a_hot_pixel_that_spreads() {
    let mut image = vec![0.25f32; 3 * 49];
    image[3 * 24] = 7.0;
    let is_far = |k: usize| k < 7;
    let of = |image: &[f32]| hot_pixel::Spread::measure(image, 0.25, 10.0, is_far);
    assert_eq!((of(&image).unsound, of(&image).far), (0, 0));
    for (at, value, expected) in [(80, f32::NAN, (1, 0)), (80, 11.0, (1, 0)), (80, 0.2, (1, 0)), (3, 0.3, (0, 1))] {
        let mut bad = image.clone();
        bad[at] = value;
        let found = of(&bad);
        assert_eq!((found.unsound, found.far), expected, "{value}");
    }
    let settings = display::filters()[0].1;
    let spread = |hot: f32, said: f32| {
        let (mut scene, radius) = hot_pixel::spotlit(hot);
        scene.lights[0].intensity *= hot / said;
        hot_pixel::frames_of(&setup(), TracerKind::Compute, &scene, radius, &settings, said, 4).unwrap()
    };
    let (right, wrong) = (spread(100.0, 100.0), spread(100.0, 10.0));
    assert!(right.unsound == 0 && right.total > 0.0 && wrong.unsound > 0, "{right:?} {wrong:?}");
}

/// Section 8: pixels that know their radiance stay what they are beside a glint, if that is not of a single sample.
#[test]
fn gpu_stress_catches_a_glint_that_lights_quiet_pixels() {
    for filter in [FilterKind::Box, FilterKind::Atrous] {
        let moved = |hits: u32, detail: f32| {
            let mut watch = Quiet;
            let mut watch = Watch::new(&mut watch);
            hot_pixel::beside_glint(&setup(), TracerKind::Compute, filter, hits, detail, &mut watch).unwrap()
        };
        for detail in [0.0, hot_pixel::GLINT_DETAIL] {
            let check = hot_pixel::check_beside_glint("glint", moved(hot_pixel::GLINT_HITS, detail));
            assert_eq!(check.verdict, Verdict::Holds, "{filter} {detail} {check:?}");
            fails(&hot_pixel::check_beside_glint("glint", moved(1, detail)));
        }
    }
}

/// Section 8: pixels that rare light has not reached take part in the mean of those that it has, if these are not a few glints.
#[test]
fn gpu_stress_catches_a_filter_that_keeps_what_is_dark_by_chance() {
    for filter in [FilterKind::Box, FilterKind::Atrous] {
        let left = |noise: f32| {
            let mut quiet = Quiet;
            hot_pixel::rare_light(&setup(), TracerKind::Compute, filter, noise, &mut Watch::new(&mut quiet)).unwrap()
        };
        let check = hot_pixel::check_rare_light("rare light", left(1.0));
        assert_eq!(check.verdict, Verdict::Holds, "{filter} {check:?}");
        fails(&hot_pixel::check_rare_light("rare light", left(0.0)));
    }
}

/// Section 8: filters keep the mean of what few samples meet, in one step or several, and a sheet that is smaller than it is said to be does not.
#[test]
fn gpu_stress_catches_a_filter_that_loses_rare_occlusion() {
    let of = |settings: &Settings, side: f64| {
        hot_pixel::rare_occlusion(&setup(), TracerKind::Compute, settings, side, 8).unwrap()
    };
    let with = |settings: &Settings, kind| Settings { filter: Filter { kind, ..settings.filter }, ..*settings };
    for (what, settings) in display::filters() {
        let plain = of(&with(&settings, FilterKind::None), hot_pixel::SHEET);
        let check = hot_pixel::check_rare_occlusion(what, of(&settings, hot_pixel::SHEET), plain);
        assert_eq!(check.verdict, Verdict::Holds, "{check:?}");
        fails(&hot_pixel::check_rare_occlusion(what, of(&settings, 0.97 * hot_pixel::SHEET), plain));
    }
}

/// Section 8: curves that fall, or let NaN through, and a filter that darkens.
#[test]
fn gpu_stress_catches_a_bad_display() {
    assert_eq!(display::falls(f32::sqrt, 0.0), 0);
    assert!(display::falls(|x| (3.0 * x).sin(), 1e-6) > 0);
    assert!(display::bad_colours(|c| c) > 0);
    let plane = analytic::plane(20.0, SceneTransform::default());
    let device = device();
    let tracer = common::tracer(&device, TracerKind::Compute, &plane);
    let settings = display::filters()[0].1;
    let off = |value: f32| long_runs::frames_off(&tracer, &plane, &settings, 2, DVec3::ZERO, value).unwrap();
    let (right, wrong) = (off(1.0), off(1.0f32.next_down()));
    assert!(right.0 == 0 && right.1 > 0 && wrong.0 == wrong.1, "{right:?} {wrong:?}");
}

/// Section 9: an image that is off by one bit, or shifted by a pixel.
#[test]
fn stress_catches_what_is_not_determined() {
    let image: Vec<f32> = (0..100).map(|k| (k * 7 % 13) as f32 / 13.0).collect();
    let mut other = image.clone();
    assert_eq!(determinism::different_bits(&image, &other), 0);
    other[40] = other[40].next_up();
    assert_eq!(determinism::different_bits(&image, &other), 1);
    other.rotate_right(1);
    assert!(determinism::difference(&image, &other).0 > 0.5);
    assert_eq!(determinism::different_bits(&image, &other[1..]), 100);
}

/// A scene with everything that the suite looks for, each found as often as it is there.
#[test]
fn stress_finds_what_a_scene_has() {
    let mut flawed = analytic::plane(10.0, SceneTransform { scale: 1.0, offset: DVec3::ZERO });
    let mesh = triangles(&mut flawed.meshes[0].geometry);
    // two triangles of a square of positions that say where it is, at 4e6
    mesh.positions.iter_mut().for_each(|p| p.x += 4e6);
    mesh.indices.extend([mesh.indices[0], mesh.indices[0]]);
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([Vec3::new(4e6, 1.0, 0.0), Vec3::new(4e6, 1.0, 5.0), Vec3::new(4e6, 1.0001, 2.0)]);
    mesh.indices.push([first, first + 1, first + 2]);
    mesh.indices.push([first, first, first + 1]);
    mesh.normals = vec![Vec3::NEG_Y; mesh.positions.len()];
    mesh.normals[first as usize] = Vec3::ZERO;
    flawed.instances.push(flawed.instances[0].clone());
    let anatomy = scene::Anatomy::from_scene(&flawed);
    assert_eq!(anatomy.step.0, 0.25);
    assert_eq!((anatomy.coincident, anatomy.coincident_instances, anatomy.degenerate), (3, 2, 1));
    assert!(anatomy.worst_aspect > 1e4 && anatomy.aspects[4..].iter().sum::<u64>() == 1, "{anatomy:?}");
    assert!(anatomy.normals.1 >= 4 && anatomy.bad_normals == 1, "{anatomy:?}");
    let checks = scene::data(&flawed);
    let of = |name: &str| checks.iter().find(|c| c.name == name).unwrap();
    assert!(
        of("precision of positions").sentence.contains("of 24 bits at 4.00e6")
            || of("precision of positions").sentence.contains("of 24 bits"),
        "{:?}",
        of("precision of positions")
    );
    assert!(of("open edges").sentence.contains("AO leaks there by construction"));
    assert!(checks.iter().all(|c| c.verdict != Verdict::Fails), "what a file holds does not fail");
}

/// A leak of the user's own mesh, and rays that meet the triangle they left.
#[test]
fn gpu_stress_catches_a_leak_of_a_scene() {
    let whole = by_name("stairs").unwrap();
    let oracle = Oracle::new(&whole, whole.origin());
    let rays = scene::edge_rays(&whole, &oracle, 5000, 7);
    assert_eq!(rays.len(), 5000);
    let setup = setup();
    let leaks = |scene: &Scene| {
        scene::leaks(&setup.tracer(TracerKind::Compute, scene).unwrap(), &rays, &mut NoControl).unwrap()
    };
    let mut holed = whole.clone();
    for mesh in &mut holed.meshes {
        if let Geometry::Triangles(mesh) = &mut mesh.geometry {
            mesh.indices.pop();
        }
    }
    let (right, wrong) = (leaks(&whole), leaks(&holed));
    assert!(right == 0 && wrong > 0, "{right} {wrong}");
}
