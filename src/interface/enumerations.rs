//! Enumerations whose numbers records hold.

use super::debug_views::debug_views;

/// An enumeration, as its GLSL constants are generated from it.
pub(super) struct Declaration {
    /// Its file in interface/.
    pub name: &'static str,
    /// Names in the shaders, their numbers, and what they mean.
    pub variants: &'static [(&'static str, u32, &'static str)],
}

macro_rules! first_number {
    () => {
        0
    };
    ($first:literal) => {
        $first
    };
}

/// Declares enumerations: `from N` numbers the variants from N on, `default A` makes one the default.
macro_rules! enumerations {
    ($(
        $(#[doc = $doc:literal])*
        $name:ident: $file:literal $(from $from:literal)? $(default $default:ident)? {
            $(#[doc = $first_doc:literal])* $first:ident = $first_glsl:literal,
            $($(#[doc = $variant_doc:literal])* $variant:ident = $glsl:literal,)*
        }
    )*) => {
        $(
            shared_enumeration! {
                $(#[doc = $doc])*
                #[repr(u32)]
                #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
                pub enum $name {
                    $(#[doc = $first_doc])* $first = first_number!($($from)?),
                    $($(#[doc = $variant_doc])* $variant,)*
                }
            }

            impl $name {
                /// All of them, in the order of their numbers.
                pub const ALL: [Self; [$name::$first, $($name::$variant,)*].len()] = [Self::$first, $(Self::$variant,)*];
            }

            $(
                #[allow(clippy::derivable_impls, reason = "whether there is one is said beside the name")]
                impl Default for $name {
                    fn default() -> Self {
                        Self::$default
                    }
                }
            )?
        )*
        pub(super) const ALL: &[Declaration] = &[$(Declaration {
            name: $file,
            variants: &[
                ($first_glsl, $name::$first as u32, concat!($($first_doc),*)),
                $(($glsl, $name::$variant as u32, concat!($($variant_doc),*)),)*
            ],
        },)*];
    };
}

enumerations! {
    /// Transmission mode of a material.
    TransmissionMode: "walls" {
        /// No transmission.
        Opaque = "WALLS_NONE",
        /// Straight through thin walls, without refraction.
        Thin = "WALLS_THIN",
        /// Refraction into a volume.
        Volume = "WALLS_VOLUME",
    }

    /// Wrap mode of texture coordinates outside [0, 1].
    Wrap: "wrap" default Repeat {
        /// Tile (glTF's default).
        Repeat = "WRAP_REPEAT",
        /// Tile, every second tile mirrored.
        Mirror = "WRAP_MIRROR",
        /// Clamp to the edge.
        Clamp = "WRAP_CLAMP",
    }

    /// Storage of texels, four channels each.
    TexelFormat: "texel_format" {
        /// 8 bits per channel, a `uint` per texel.
        Unorm8 = "FORMAT_UNORM8",
        /// 16 bits per channel, a `uvec2` per texel.
        Unorm16 = "FORMAT_UNORM16",
        /// 32-bit floats, a `vec4` per texel: linear, whatever the use.
        Float = "FORMAT_FLOAT",
    }

    /// The meaning of a texture's values, which decides how mip levels average them. All levels hold linear values: a texture that is used in two ways has two
    /// sets of levels.
    Texels: "texels" {
        /// Linear data. The mean of a normal map's vectors is shorter the more they differ; shaders normalize it.
        Linear = "TEXELS_LINEAR",
        /// sRGB colours, averaged as linear light.
        Srgb = "TEXELS_SRGB",
        /// sRGB colours with alpha: levels are premultiplied, so that texels of alpha 0 do not contribute.
        Covered = "TEXELS_COVERED",
    }

    /// Surface property that a camera ray returns in place of radiance, which is number 0.
    View: "view" from 1 {
        /// Unit shading normals, world space, on the viewer's side; normal maps included.
        Normals = "VIEW_NORMALS",
        /// Base colours, linear; for mirrors, glass and conductors the reflectance at normal incidence.
        Albedo = "VIEW_ALBEDO",
        /// Distance along the ray, scene units.
        Depth = "VIEW_DEPTH",
        /// Occlusion texture of the material; 1 without one.
        BakedOcclusion = "VIEW_BAKED_OCCLUSION",
    }

    /// Stages of the pass that distributes a frame's ray budget over pixels.
    BudgetStage: "budget_stage" {
        /// The number of samples that each pixel desires.
        DesiredSamples = "STAGE_DESIRED_SAMPLES",
        /// Sums of desired samples at widely spaced levels.
        Coarse = "STAGE_COARSE",
        /// Sums of desired samples at levels between two coarse ones.
        Fine = "STAGE_FINE",
        /// The list of rays.
        Rays = "STAGE_RAYS",
    }
}

/// Declares enumerations that are also settings, and the table of them: each variant has a name on the command line and a name in shaders.
macro_rules! choices {
    ($table:ident; $(
        $(#[doc = $doc:literal])*
        $name:ident: $file:literal $(default $default:ident)? {
            $($(#[doc = $variant_doc:literal])+ $variant:ident = $setting:literal, $glsl:literal;)+
        }
    )*) => {
        $(
            shared_choice! {
                $(#[doc = $doc])*
                #[repr(u32)]
                pub enum $name $((default $default))? {
                    $($(#[doc = $variant_doc])+ $variant = $setting,)+
                }
            }
        )*
        pub(super) const $table: &[Declaration] = &[$(Declaration {
            name: $file,
            variants: &[$(($glsl, $name::$variant as u32, concat!($($variant_doc),*)),)*],
        },)*];
    };
}

choices! {
    CHOICES;

    /// Reconstruction filter of pixels, by importance sampling: positions are sampled in proportion to the filter, and samples have equal weights (Ernst,
    /// Stamminger, Greiner, "Filter Importance Sampling", 2006).
    PixelFilter: "pixel_filter" {
        /// Box filter of one pixel
        Box = "box", "FILTER_BOX";
        /// Tent filter of radius 1
        Tent = "tent", "FILTER_TENT";
        /// Blackman-Harris filter of radius 1.5
        BlackmanHarris = "blackman-harris", "FILTER_BLACKMAN_HARRIS";
        /// No filter: every sample at the centre of the pixel, as of frames in real time
        Centre = "centre", "FILTER_CENTRE";
    }

    /// Sampler of ray directions: a sequence of points in the unit square for each pixel, continued from frame to frame.
    ///
    /// `Stratified`: sixteen consecutive samples of a pixel, over its frames, visit each cell of a 4x4 grid once. `Sobol`: each pixel has its own sequence, which
    /// frames continue (Burley 2020). `Blue`: one sequence over the image, in the order of a shuffled Morton curve: the samples of an aligned
    /// square of pixels are a net, so that filtering it leaves little error (Ahmed and Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo
    /// Sampling Error via Hierarchical Ordering of Pixels", ACM TOG 39(6), 2020); from frame to frame all points are shifted by Roberts' R2 sequence ("The
    /// Unreasonable Effectiveness of Quasirandom Sequences", 2018).
    Sequence: "sequence" default Blue {
        /// Independent random numbers
        White = "white", "SEQUENCE_WHITE";
        /// Jittered on a 4x4 grid
        Stratified = "stratified", "SEQUENCE_STRATIFIED";
        /// Owen-scrambled Sobol, one sequence per pixel
        Sobol = "sobol", "SEQUENCE_SOBOL";
        /// Owen-scrambled Sobol over the image: blue-noise error
        Blue = "blue", "SEQUENCE_BLUE";
        /// R2 sequence (Roberts), Cranley-Patterson rotation per pixel
        R2 = "r2", "SEQUENCE_R2";
    }

    /// Pattern of the pixels that are sampled in a frame.
    Resolution: "pattern" {
        /// Every pixel in every frame
        Full = "full", "PATTERN_FULL";
        /// Half of the pixels per frame, alternating
        Checkerboard = "checkerboard", "PATTERN_CHECKER";
        /// A quarter of the pixels per frame: half the resolution per axis
        Half = "half", "PATTERN_QUARTER";
    }

    /// Tone mapping operator. Values are linear with sRGB primaries, before and after.
    ToneMap: "tone_map" default Linear {
        /// Clamp at 1
        Linear = "linear", "TONE_MAP_LINEAR";
        /// Exponential, 1 - e^-x per channel
        Exponential = "exp", "TONE_MAP_EXPONENTIAL";
        /// Reinhard et al. (2002), by luminance
        Reinhard = "reinhard", "TONE_MAP_REINHARD";
        /// Khronos PBR Neutral (2024)
        Neutral = "neutral", "TONE_MAP_NEUTRAL";
        /// AgX (Sobotka 2022, curve by Wrensch 2023)
        Agx = "agx", "TONE_MAP_AGX";
    }
}

macro_rules! display_mode {
    ($($(#[doc = $doc:literal])+ $view:ident = $name:literal, $glsl:literal, mod $module:ident, shader $shader:ident;)*) => {
        choices! {
            DISPLAY_MODES;

            /// Buffer of a frame that is displayed: scalars as grey up to `Rays`, colours from `Normal` on (shaders/display.glsl compares).
            DisplayMode: "shown" {
                /// The final image: ambient visibility, or radiance
                Result = "result", "SHOWN_RESULT";
                /// The input of the spatial filter
                Unfiltered = "unfiltered", "SHOWN_UNFILTERED";
                /// Accumulated samples; white: maximum history length
                Samples = "samples", "SHOWN_SAMPLES";
                /// Variance of one sample; white: 0.25
                Variance = "variance", "SHOWN_VARIANCE";
                /// Depth along the view; white is near
                Depth = "depth", "SHOWN_DEPTH";
                /// Occlusion rays traced in this frame; white: the most that a pixel can have
                Rays = "rays", "SHOWN_RAYS";
                /// Geometric normal, -1 to 1 mapped to 0 to 1
                Normal = "normal", "SHOWN_NORMAL";
                /// World position, repeating every quarter of the scene
                Position = "position", "SHOWN_POSITION";
                /// Bent normal, -1 to 1 mapped to 0 to 1
                Bent = "bent", "SHOWN_BENT";
                /// A colour for each instance
                Ids = "ids", "SHOWN_IDS";
                /// Motion vectors since the previous frame, grey where nothing moves: more red to the right, more green downwards, 8 pixels halfway
                Motion = "motion", "SHOWN_MOTION";
                $($(#[doc = $doc])+ $view = $name, $glsl;)*
            }
        }
    };
}
debug_views!(display_mode);

impl PixelFilter {
    /// Returns true if samples lie within their pixel, so that it sees only what projects into its area.
    pub fn is_within_pixel(self) -> bool {
        matches!(self, Self::Box | Self::Centre)
    }
}
