//! The options of paths that are a number which shaders read. An option is an entry of this list, and its use in a shader: the rest is made of the list.

/// Calls the macro `$callback` with all options, an entry each:
///
/// ```text
/// /// Help text.
/// name: u32 as uint = 0, setting(...), feature(Name = "WITH_NAME", "label"), remark("...");
/// ```
///
/// - The setting `--name` takes the first type, `name` of `PathOptionsRecord` has the second one, which is GLSL's, and this value where the setting is not given:
///   src/integrators/path/settings.rs declares the setting, `name` of `PathOptions`, its metadata and its key of the JSON record.
/// - `setting`: arguments of the command line, what the setting applies to, and its level ([`crate::settings`]).
/// - `feature`, for an option that shaders need code for: the `PathFeature` that is enabled where the value is not the default, its `bool` in shaders, and its label.
/// - `remark`, for an option that makes images biased: what the user is told where the value is not the default; `{}` stands for it.
macro_rules! path_options {
    ($callback:ident) => {
        $callback! {
            /// Leave out paths of fewer bounces: 1 hides emitters and the environment behind the scene, 2 leaves indirect light alone [default: 0]
            min_depth: u32 as uint = 0,
                setting(option(value_name = "N"), applies(LIGHT), research),
                feature(MinDepth = "WITH_MIN_DEPTH", "minimum depth");
            /// Bounces before Russian roulette may end a path [default: 5]
            rr_depth: u32 as uint = 5,
                setting(option(value_name = "N"), applies(LIGHT), research);
            /// Clamp indirect radiance to X (reduces fireflies; biased) [default: off]
            firefly_clamp: f64 as float = f32::INFINITY,
                setting(option(value_name = "X", value_parser = parse_positive, allow_hyphen_values = true), applies(LIGHT)),
                feature(Clamp = "WITH_CLAMP", "radiance clamp"),
                remark("indirect radiance clamped to {}: biased, too dark");
            /// Scale factor of indirect light, of two bounces or more; biased but for 1 [default: 1]
            indirect_scale: f64 as float = 1.0,
                setting(option(value_name = "X", value_parser = parse_positive, allow_hyphen_values = true), applies(LIGHT), research),
                feature(IndirectScale = "WITH_INDIRECT_SCALE", "scaled indirect light"),
                remark("indirect light scaled by {}: biased");
        }
    };
}
pub(crate) use path_options;
