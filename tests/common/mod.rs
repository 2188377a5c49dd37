//! What the device tests share: one device with the validation layer, and the list of tracers to run.
#![allow(dead_code, reason = "each test file uses its part of this module")]

use std::sync::Arc;

use skylit::Error;
use skylit::accel::flatten::FlatScene;
use skylit::gpu::{Device, Options};
use skylit::scene::Scene;
use skylit::tracer::{Needs, Tracer, TracerKind};

/// Opens the default device with the validation layer. A machine without Vulkan fails the tests: software drivers exist.
pub fn device() -> Arc<Device> {
    open(Options { validation: true, ..Default::default() })
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

/// Everything that a pass may ask for.
pub const ALL: Needs = Needs {
    normals: true,
    albedo: true,
    shading: false,
    white: false,
    compensation: false,
    baked_occlusion: false,
    mip_levels: false,
};

pub fn tracer(device: &Arc<Device>, kind: TracerKind, scene: &Scene) -> Tracer {
    let flat = FlatScene::new(scene);
    Tracer::new(device, kind, &flat, ALL).unwrap_or_else(|e| panic!("{kind}: {e}"))
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
