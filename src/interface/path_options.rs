//! The options of paths that are numbers in shaders, and the features that paths require.

use super::constants::Constant;
use super::features::{Declaration, PATH_FIRST, feature_set};

records! {
    "path_options";

    /// Options of paths, each of which the list in src/interface/path_options.rs declares.
    PathOptionsRecord: Structure {
        /// Leave out paths of fewer bounces: 1 hides emitters and the environment behind the scene,
        /// 2 leaves indirect light alone [default: 0]
        min_depth: uint,
        /// Bounces before Russian roulette may end a path [default: 5]
        rr_depth: uint,
        /// Clamp indirect radiance to X (reduces fireflies; biased) [default: off]
        firefly_clamp: float,
        /// Scale factor of indirect light, of two bounces or more; biased but for 1 [default: 1]
        indirect_scale: float,
        /// Padding to a multiple of 16 bytes.
        reserved: uint[4],
    }
}

feature_set! {
    /// Features that the lights of a scene and the options of a render require of paths.
    PathFeatures of /// A feature that lights and options may require of paths.
    PathFeature: "path_features", from PATH_FIRST, full false, indexed false, PATH;
    LightTree = "WITH_LIGHT_TREE", "light tree";
    LightGroups = "WITH_LIGHT_GROUPS", "placed and distant lights";
    LightSplit = "WITH_LIGHT_SPLIT", "a light sample of each group at first vertices";
    SurfaceLights = "WITH_SURFACE_LIGHTS", "surfaces that light samples find";
    LightChoice = "WITH_LIGHT_CHOICE", "a choice among distant lights";
    EnvironmentMap = "WITH_ENVIRONMENT_MAP", "environment map";
    LightSamples = "WITH_LIGHT_SAMPLES", "light samples";
    Mis = "WITH_MIS", "multiple importance sampling";
    CosineSampling = "WITH_COSINE_SAMPLING", "cosine hemisphere sampling";
    UniformSampling = "WITH_UNIFORM_SAMPLING", "uniform hemisphere sampling";
    ConstantAlbedo = "WITH_CONSTANT_ALBEDO", "constant albedo";
    View = "WITH_VIEW", "auxiliary view";
    Lens = "WITH_LENS", "thin lens";
    PixelFilter = "WITH_PIXEL_FILTER", "pixel filter";
    RayCones = "WITH_RAY_CONES", "ray cones";
    DistantDisks = "WITH_DISTANT_DISKS", "directional lights of angular diameter above 0";
    Media = "WITH_MEDIA", "volumes that absorb or nest";
    ClearWalls = "WITH_CLEAR_WALLS", "thin walls that light passes straight";
    SpecularOnly = "WITH_SPECULAR_ONLY", "paths of delta lobes only";
    Ambient = "WITH_AMBIENT", "ambient light";
    BackgroundOnly = "WITH_BACKGROUND_ONLY", "an environment that lights no surface";
    HiddenBackground = "WITH_HIDDEN_BACKGROUND", "an environment that camera rays do not show";
    BlurredBackground = "WITH_BLURRED_BACKGROUND", "an environment that camera rays show blurred";
    Catcher = "WITH_CATCHER", "a ground that catches shadows";
    OccludedLight = "WITH_OCCLUDED_LIGHT", "direct light darkened by ambient occlusion";
    SurfacePoints = "WITH_SURFACE_POINTS", "paths that begin at given points of surfaces";
    Signal = "WITH_SIGNAL", "diffuse reflection apart from the rest, for frames in real time";
    MinDepth = "WITH_MIN_DEPTH", "minimum depth";
    Clamp = "WITH_CLAMP", "radiance clamp";
    IndirectScale = "WITH_INDIRECT_SCALE", "scaled indirect light";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_behind_the_options_are_aligned() {
        assert_eq!(size_of::<PathOptionsRecord>() % 16, 0, "`reserved` fills up the record, with a word at least");
    }
}
