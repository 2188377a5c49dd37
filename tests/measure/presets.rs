//! Presets of frames in real time, and the steps of their filters.

use skylit::realtime::settings::{Filter, FilterKind, Preset, Settings};

#[test]
fn steps_reach_to_the_radius() {
    for kind in FilterKind::ALL {
        for radius in [0, 1, 3, 7, 15] {
            let steps = Filter { kind, radius, samples: 64.0 }.steps();
            let reach: u32 = steps.iter().map(|s| s.radius * s.stride).sum();
            let wanted = if kind == FilterKind::None { 0 } else { radius };
            assert_eq!(reach, wanted, "{kind:?} {radius}");
        }
    }
}

#[test]
fn presets_are_sound() {
    for preset in Preset::ALL {
        preset.settings().check().unwrap();
    }
    let wrong = Settings { rays_per_pixel: 0, ..Settings::default() };
    assert_eq!(wrong.check().unwrap_err().exit_code(), 64);
}
