//! Settings of the renders that a comparison makes on the spot.

use skylit::compare::render::{add_ids, first_frame, settings};
use skylit::renderer::RenderSettings;

#[test]
fn shared_settings_go_where_they_have_an_effect() {
    let shared = RenderSettings::from_words("--size 20x10 --spp 3 --environment 1,1,1 --fov-y 30").unwrap();
    let [ao, path, frames] = &settings(&["ao --ao-radius 2", "path --spp 9", "balanced"], &shared).unwrap()[..] else {
        panic!()
    };
    assert_eq!((ao.image.size, ao.image.spp, ao.lighting.environment.as_deref()), (Some([20, 10]), Some(3), None));
    assert_eq!((path.image.spp, path.lighting.environment.as_deref()), (Some(9), Some("1,1,1")));
    assert_eq!((frames.image.spp, frames.camera.fov_y, frames.image.size), (None, Some(30.0), Some([20, 10])));
}

#[test]
fn what_has_no_effect_is_an_error() {
    let shared = RenderSettings::from_words("--environment 1,1,1").unwrap();
    let error = |words: &[&str], shared: &RenderSettings| settings(words, shared).unwrap_err().to_string();
    assert!(error(&["ao", "ao-sky"], &shared).contains("--environment has no effect on any of the renders"));
    assert!(
        error(&["ao --max-depth 3"], &RenderSettings::default())
            .contains("\"ao --max-depth 3\": --max-depth has no effect")
    );
    assert!(error(&["oa"], &RenderSettings::default()).contains("oa"));
}

#[test]
fn frames_have_what_is_for_frames_and_stills_a_time() {
    let shared = RenderSettings::from_words("--ao-radius 2 --frames 0..8 --orbit 120 --at-rest hold --spp 4").unwrap();
    let [frames, still] = &settings(&["balanced", "ao"], &shared).unwrap()[..] else { panic!() };
    assert_eq!((frames.integrators.ao.radius(), still.integrators.ao.radius()), (2.0, 2.0));
    assert!(frames.frames.at_rest.is_some() && frames.realtime_setting().is_some() && frames.image.spp.is_none());
    assert!(still.is_still_sequence() && still.frames.orbit == Some(120) && still.frames.at_rest.is_none());
    let shared = RenderSettings::from_words("--frames 0..8").unwrap();
    assert!(settings(&["balanced", "ao"], &shared).unwrap_err().to_string().contains("\"ao\": --frames makes a still"));
}

#[test]
fn a_preset_alone_has_a_first_frame() {
    let of = |words: &str| first_frame(&RenderSettings::from_words(words).unwrap());
    assert_eq!(of("balanced --filter none").unwrap().frames.warm_up, Some(0));
    for words in ["ao --spp 4", "balanced --warm-up 0", "balanced --frames 0..8", "ao --spp 4 --frames 0..2"] {
        assert!(of(words).is_none(), "{words}");
    }
}

#[test]
fn ids_are_added_once() {
    let mut settings = RenderSettings::from_words("ao --aov depth").unwrap();
    add_ids(&mut settings);
    add_ids(&mut settings);
    assert_eq!(settings.image.aov.len(), 2);
}
