//! Features that lights and options require of paths' shaders; others are specialized out.

use super::lights::Lights;
use super::{PathOptions, Strategy, media};
use crate::accel::flatten::FlatScene;
use crate::interface::{LightKinds, PathFeature, PathFeatures};
use crate::tracer::shading;

/// The required features. `map`: the environment is a map; `cones`: ray cones filter textures.
pub(super) fn features(
    options: &PathOptions,
    flat: &FlatScene,
    lights: &Lights,
    map: bool,
    cones: bool,
) -> (PathFeatures, LightKinds) {
    let plain = options.white_sky.is_some() || options.view.is_some();
    let mut states = (0..flat.scene.materials.len()).flat_map(|k| flat.motion.states(flat.scene, k));
    let clear_walls = !plain && states.any(shading::has_clear_walls);
    let samples_lights = options.strategy.samples_lights() && !lights.records.is_empty();
    let features = [
        (PathFeature::LightTree, samples_lights && lights.placed > 1),
        (PathFeature::LightGroups, samples_lights && lights.has_both_groups()),
        (PathFeature::LightSplit, samples_lights && lights.has_both_groups() && !clear_walls),
        (PathFeature::SurfaceLights, samples_lights && !lights.light_of.is_empty()),
        (PathFeature::LightChoice, samples_lights && lights.distant() > 1),
        (PathFeature::EnvironmentMap, map),
        (PathFeature::LightSamples, samples_lights),
        (PathFeature::Mis, samples_lights && options.strategy == Strategy::Mis),
        (PathFeature::RayCones, cones),
        (PathFeature::DistantDisks, lights.has_disks),
        (PathFeature::Media, !plain && media::need_tracking(flat)),
        (PathFeature::ClearWalls, clear_walls),
    ];
    let all = features
        .into_iter()
        .chain(options.features())
        .filter_map(|(feature, required)| required.then_some(feature))
        .collect();
    (all, if samples_lights { lights.kinds() } else { LightKinds::default() })
}
