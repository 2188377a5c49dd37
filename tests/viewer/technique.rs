//! Techniques of views.

use skylit::realtime::Preset;
use skylit::renderer::RenderSettings;
use skylit::settings::Length;
use skylit::viewer::technique::{GROUPS, Technique};

#[test]
fn every_technique_can_be_rendered_whatever_is_set() {
    let mut base = RenderSettings::default();
    base.integrators.ao.ao_radius = Some(Length::Units(2.0));
    base.integrators.path.max_depth = Some(3);
    base.integrators.path.sky_albedo = Some(0.3);
    base.picture.exposure = Some(1.0);
    base.frames.rays_per_pixel = Some(2);
    base.frames.history = Some(16);
    base.frames.preset = Some(Preset::Larsen);
    let mut labels = Vec::new();
    for (group, technique) in Technique::all() {
        assert!(group < GROUPS.len());
        let settings = technique.settings(&base);
        settings.check().unwrap_or_else(|e| panic!("{technique:?}: {e}"));
        if settings.realtime_setting().is_some() {
            skylit::renderer::frames::frame_settings(&settings).unwrap_or_else(|e| panic!("{technique:?}: {e}"));
        }
        labels.push(technique.label());
    }
    let n = labels.len();
    labels.sort();
    labels.dedup();
    assert_eq!(labels.len(), n, "each has a name of its own");
    assert_eq!(Technique::Preset(Preset::Fast).settings(&base).integrators.ao.radius(), 2.0);
    let path = Technique::Still("path".parse().unwrap()).settings(&base);
    assert_eq!((path.integrators.ao.ao_radius, path.integrators.path.max_depth), (None, Some(3)));
}
