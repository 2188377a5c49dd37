//! What a scene's lights and a render's options require of paths: what they do not is not compiled.

use super::lights::Lights;
use super::{PathOptions, Strategy, media};
use crate::accel::flatten::FlatScene;
use crate::interface::{LightKinds, PathFeature, PathFeatures};
use crate::tracer::shading;

/// What is required. `map`: the environment is an image; `cones`: textures are read over ray cones.
pub(super) fn features(
    options: &PathOptions,
    flat: &FlatScene,
    lights: &Lights,
    map: bool,
    cones: bool,
) -> (PathFeatures, LightKinds) {
    let plain = options.white_sky.is_some() || options.view.is_some();
    let drawn = options.strategy.samples_lights() && !lights.records.is_empty();
    let features = [
        (PathFeature::LightTree, drawn && !lights.tree.is_empty()),
        (PathFeature::SurfaceLights, drawn && !lights.light_of.is_empty()),
        (PathFeature::LightChoice, drawn && lights.choices() > 1),
        (PathFeature::EnvironmentMap, map),
        (PathFeature::LightSamples, drawn),
        (PathFeature::Mis, drawn && options.strategy == Strategy::Mis),
        (PathFeature::RayCones, cones),
        (PathFeature::DistantDisks, lights.has_disks),
        (PathFeature::Media, !plain && media::matter(flat)),
        (PathFeature::ClearWalls, !plain && flat.scene.materials.iter().any(shading::has_clear_walls)),
    ];
    let all =
        features.into_iter().chain(options.features()).filter_map(|(feature, required)| required.then_some(feature)).collect();
    (all, if drawn { lights.kinds() } else { LightKinds::default() })
}
