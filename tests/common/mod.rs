//! What the tests share: one device with the validation layer, the tracers to run, scenes and rays by name, and the program from outside.
#![allow(dead_code, reason = "each test binary uses its part of this module")]

// it runs the program
#[cfg(feature = "cli")]
pub mod command;

use std::sync::{Arc, OnceLock};

use skylit::Error;
use skylit::accel::flatten::FlatScene;
use skylit::film::camera::CameraRecord;
use skylit::film::{Control, NoControl};
use skylit::gpu::{Device, Options};
use skylit::integrators::rays::{Mode, trace};
use skylit::ray::{Hit, Ray};
use skylit::scene::builtin::by_name;
use skylit::scene::{Camera, Scene};
use skylit::tracer::{Tracer, TracerKind};

/// Pipelines that the shared device of a process keeps ([`Options::keep_pipelines`]): gigabytes at most.
pub const KEPT: usize = 256;

/// Is `SKYLIT_FULL` set, as by `./scripts/test.sh --full`? Tests then leave nothing out that would take long.
pub fn is_full() -> bool {
    std::env::var_os("SKYLIT_FULL").is_some()
}

/// What numbers of rays are divided by: 10 on the floor driver, where a ray takes ten times as long and a tenth of them shows what the driver's
/// rounding does, else 1; always 1 with `./scripts/test.sh --full`.
pub fn divisor() -> u32 {
    if std::env::var_os("SKYLIT_REQUIRE_DRIVER").is_some() && !is_full() { 10 } else { 1 }
}

/// The default device with the validation layer; a machine without Vulkan fails the tests: software drivers exist. All tests of a process
/// have the same one, and compile a pipeline once between them: compiling is most of what small images cost on a CPU driver.
pub fn device() -> Arc<Device> {
    static DEVICE: OnceLock<Arc<Device>> = OnceLock::new();
    DEVICE.get_or_init(|| open(Options { keep_pipelines: KEPT, ..validated() })).clone()
}

/// A device of one's own, for tests of what devices do.
pub fn new_device() -> Arc<Device> {
    open(validated())
}

/// With the validation layer; `SKYLIT_VALIDATION=off` does without where there is none, and only there should it be set.
pub fn validated() -> Options {
    Options { validation: std::env::var("SKYLIT_VALIDATION").as_deref() != Ok("off"), ..Options::default() }
}

pub fn open(options: Options) -> Arc<Device> {
    match Device::open(&options) {
        // the floor run means one driver and no other
        Ok(device) if std::env::var("SKYLIT_REQUIRE_DRIVER").is_ok_and(|d| !device.info.driver.contains(&d)) => {
            panic!("SKYLIT_REQUIRE_DRIVER is not what runs here: {}", device.info.driver)
        }
        Ok(device) => device,
        Err(Error::Device(m)) if m.contains("validation") => panic!("{m}: run ./scripts/setup.sh"),
        Err(e) => panic!("{e}"),
    }
}

/// The tracers that this device runs. `SKYLIT_EXPECT_TRACERS=pipeline,query,compute` makes a missing one a failure.
pub fn tracers(device: &Device) -> Vec<TracerKind> {
    let there: Vec<_> = TracerKind::ALL.into_iter().filter(|&k| k.is_supported_by(&device.info)).collect();
    if let Ok(expected) = std::env::var("SKYLIT_EXPECT_TRACERS") {
        for name in expected.split(',').filter(|n| !n.is_empty()) {
            assert!(
                there.iter().any(|k| k.name() == name),
                "tracer '{name}' is expected here, but '{}' ({}) has only {there:?}",
                device.info.name,
                device.info.driver
            );
        }
    }
    there
}

/// The tracer of a test, which its name picks. With `SKYLIT_FULL` set, all of them.
///
/// Tracers share the code that shades, filters and accumulates, and what compares them asks for all ([`tracers`]). Images of tests are small, and
/// compiling the kernels of a scene's features is what they cost on a CPU driver, for each tracer anew.
pub fn picked(device: &Device) -> Vec<TracerKind> {
    let all = tracers(device);
    if is_full() {
        return all;
    }
    // a test is a thread of its name
    let name: usize = std::thread::current().name().map_or(0, |n| n.bytes().map(usize::from).sum());
    vec![all[name % all.len()]]
}

/// What tracers of tests are asked for: normals and albedo.
pub use skylit::stress::degenerate::NEEDS as ALL;

pub fn tracer(device: &Arc<Device>, kind: TracerKind, scene: &Scene) -> Tracer {
    let flat = FlatScene::new(scene);
    Tracer::new(device, kind, &flat, ALL).unwrap_or_else(|e| panic!("{kind}: {e}"))
}

/// A built-in scene.
pub fn scene(name: &str) -> Scene {
    by_name(name).unwrap_or_else(|| panic!("no built-in scene {name}"))
}

/// A camera of a scene as passes take it, for images of this size.
pub fn record(scene: &Scene, camera: &Camera, size: [u32; 2]) -> CameraRecord {
    CameraRecord::new(camera, scene.origin(), f64::from(size[0]) / f64::from(size[1]))
}

pub fn hits(tracer: &Tracer, rays: &[Ray], mode: Mode) -> Vec<Hit> {
    trace(tracer, rays, mode, 1, &mut NoControl).unwrap_or_else(|e| panic!("{}: {e}", tracer.kind())).0
}

pub fn closest(tracer: &Tracer, rays: &[Ray]) -> Vec<Hit> {
    hits(tracer, rays, Mode::Closest)
}

/// Interrupts when it is asked for the `at`-th time, from 1; 0: never.
#[derive(Default)]
pub struct InterruptAt {
    pub at: u32,
    pub asked: u32,
}

impl Control for InterruptAt {
    fn should_stop(&mut self) -> skylit::Result<bool> {
        self.asked += 1;
        if self.asked == self.at { Err(Error::Interrupted) } else { Ok(false) }
    }
}

/// Frames that rest, move, and are interrupted at every launch of a long one: what is shown in motion is, bit for bit, what it is without interruptions. Returns the number
/// of launches. `make` makes a pipeline, `cameras` has where it rests and two places beside that.
pub fn assert_interruptions_leave_histories(
    tracer: &Tracer,
    cameras: &[CameraRecord; 3],
    make: &dyn Fn() -> skylit::realtime::Realtime,
) -> u32 {
    const AT_REST: u32 = 6;
    let rest = |frames: &mut skylit::realtime::Realtime| {
        (0..AT_REST).for_each(|_| drop(frames.frame(tracer, &cameras[0], &[]).unwrap()));
    };
    let mut counted = make();
    rest(&mut counted);
    let mut never = InterruptAt::default();
    counted.frame_with(tracer, &cameras[0], &[], Some(&mut never)).unwrap();
    let launches = never.asked;
    let (mut without, mut with) = (make(), make());
    for at in 1..=launches {
        let images = [false, true].map(|is_interrupted| {
            let frames = if is_interrupted { &mut with } else { &mut without };
            let interrupt = |frames: &mut skylit::realtime::Realtime, camera: usize, at: u32| {
                let outcome = frames.frame_with(tracer, &cameras[camera], &[], Some(&mut InterruptAt { at, asked: 0 }));
                assert!(matches!(outcome, Err(Error::Interrupted)), "{}, launch {at}", tracer.kind());
            };
            rest(frames);
            if is_interrupted {
                interrupt(frames, 0, at);
                // again, in motion
                interrupt(frames, 2, 2);
            }
            frames.frame(tracer, &cameras[1], &[]).unwrap();
            let first = frames.result().unwrap();
            frames.frame(tracer, &cameras[2], &[]).unwrap();
            [first, frames.result().unwrap()].map(|image| image.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
        });
        assert!(images[0][0] != images[0][1], "nothing moves");
        assert!(
            images[0] == images[1],
            "{}: interrupted at launch {at} of {launches}, frames in motion differ",
            tracer.kind()
        );
    }
    launches
}

/// The validation layer had nothing to say.
pub fn assert_validation_clean(device: &Device) {
    let messages = device.validation_messages();
    assert!(messages.is_empty(), "{} validation messages, the first: {}", messages.len(), messages[0]);
}

/// Folder with scenes of others, or `None` (said on stdout).
pub fn shared_scenes() -> Option<std::path::PathBuf> {
    let given = std::env::var_os("SKYLIT_SHARED_SCENES").map(std::path::PathBuf::from);
    let path = given.unwrap_or_else(|| std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes"));
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: no shared scenes");
    None
}
