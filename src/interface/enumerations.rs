//! Enumerations whose numbers records hold.

use crate::settings::choices;

/// An enumeration, as its GLSL constants are generated from it.
pub(super) struct Declaration {
    /// Name of the file in interface/.
    pub name: &'static str,
    /// Names in the shaders, their numbers, and what they mean.
    pub variants: Vec<(&'static str, u32, &'static str)>,
}

impl Declaration {
    /// A choice, whose help texts say what the variants mean.
    fn from_choice<T: Copy>(
        name: &'static str,
        all: &[T],
        variant: fn(T) -> (&'static str, u32, &'static str),
    ) -> Self {
        Self { name, variants: all.iter().map(|&v| variant(v)).collect() }
    }
}

/// All enumerations.
pub(super) fn declarations() -> Vec<Declaration> {
    let mut all = numbered();
    all.extend([
        Declaration::from_choice("pixel_filter", &PixelFilter::ALL, |v| (v.glsl_name(), v as u32, v.help())),
        Declaration::from_choice("sequence", &Sequence::ALL, |v| (v.glsl_name(), v as u32, v.help())),
        Declaration::from_choice("pattern", &Resolution::ALL, |v| (v.glsl_name(), v as u32, v.help())),
        Declaration::from_choice("tone_map", &ToneMap::ALL, |v| (v.glsl_name(), v as u32, v.help())),
        Declaration::from_choice("shown", &DisplayMode::ALL, |v| (v.glsl_name(), v as u32, v.help())),
    ]);
    all
}

/// Declares enumerations that are no settings: the name of the file in interface/, and for each
/// variant its number and its name in shaders.
macro_rules! enumerations {
    ($(
        $(#[doc = $doc:literal])*
        pub enum $name:ident in $file:literal {
            $($(#[doc = $variant_doc:literal])+ $variant:ident = $number:literal, $glsl:literal;)+
        }
    )*) => {
        $(
            $(#[doc = $doc])*
            #[repr(u32)]
            #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
            #[cfg_attr(library, derive(serde::Serialize), serde(rename_all = "kebab-case"))]
            pub enum $name {
                $($(#[doc = $variant_doc])+ $variant = $number,)+
            }

            impl $name {
                /// All of them, in the order of their numbers.
                pub const ALL: [Self; [$($glsl),+].len()] = [$(Self::$variant),+];
            }
        )*

        /// The enumerations that are no settings.
        fn numbered() -> Vec<Declaration> {
            vec![$(Declaration {
                name: $file,
                variants: vec![$(($glsl, $number, concat!($($variant_doc),+).trim()),)+],
            },)*]
        }
    };
}

enumerations! {
    /// Transmission mode of a material.
    pub enum TransmissionMode in "walls" {
        /// No transmission.
        Opaque = 0, "WALLS_NONE";
        /// Straight through thin walls, without refraction.
        Thin = 1, "WALLS_THIN";
        /// Refraction into a volume.
        Volume = 2, "WALLS_VOLUME";
    }

    /// Wrap mode of texture coordinates outside [0, 1].
    pub enum Wrap in "wrap" {
        /// Tile (glTF's default).
        Repeat = 0, "WRAP_REPEAT";
        /// Tile, every second tile mirrored.
        Mirror = 1, "WRAP_MIRROR";
        /// Clamp to the edge.
        Clamp = 2, "WRAP_CLAMP";
    }

    /// Storage of texels, four channels each.
    pub enum TexelFormat in "texel_format" {
        /// 8 bits per channel, a `uint` per texel.
        Unorm8 = 0, "FORMAT_UNORM8";
        /// 16 bits per channel, a `uvec2` per texel.
        Unorm16 = 1, "FORMAT_UNORM16";
        /// 32-bit floats, a `vec4` per texel: linear, whatever the use.
        Float = 2, "FORMAT_FLOAT";
    }

    /// The meaning of a texture's values, which decides how mip levels average them. All levels
    /// hold linear values: a texture that is used in two ways has two sets of levels.
    pub enum Texels in "texels" {
        /// Linear data. The mean of normals is shorter the more they differ; shaders normalize it.
        Linear = 0, "TEXELS_LINEAR";
        /// sRGB colours, averaged as linear light.
        Srgb = 1, "TEXELS_SRGB";
        /// sRGB colours with alpha: levels are premultiplied, so texels of alpha 0 add nothing.
        Covered = 2, "TEXELS_COVERED";
    }

    /// Surface property that a camera ray returns in place of radiance, which is number 0.
    pub enum View in "view" {
        /// Unit shading normals, world space, on the viewer's side; normal maps included.
        Normals = 1, "VIEW_NORMALS";
        /// Linear base colours; of mirrors, glass and conductors reflectance at normal incidence.
        Albedo = 2, "VIEW_ALBEDO";
        /// Distance along the ray, scene units.
        Depth = 3, "VIEW_DEPTH";
        /// Occlusion texture of the material; 1 without one.
        BakedOcclusion = 4, "VIEW_BAKED_OCCLUSION";
    }
}

#[allow(clippy::derivable_impls, reason = "the macro passes on no attribute of a variant")]
impl Default for Wrap {
    fn default() -> Self {
        Self::Repeat
    }
}

choices! {
    /// Reconstruction filter of pixels, by importance sampling: positions are sampled in proportion
    /// to the filter, and samples have equal weights (Ernst, Stamminger, Greiner, "Filter
    /// Importance Sampling", 2006).
    #[repr(u32)]
    pub enum PixelFilter {
        /// Box filter of one pixel
        Box = "box",
        /// Tent filter of radius 1
        Tent = "tent",
        /// Blackman-Harris filter of radius 1.5
        BlackmanHarris = "blackman-harris",
        /// No filter: every sample at the centre of the pixel, as of frames in real time
        Centre = "centre",
    }
}

impl PixelFilter {
    /// The name of its constant in shaders.
    const fn glsl_name(self) -> &'static str {
        match self {
            Self::Box => "FILTER_BOX",
            Self::Tent => "FILTER_TENT",
            Self::BlackmanHarris => "FILTER_BLACKMAN_HARRIS",
            Self::Centre => "FILTER_CENTRE",
        }
    }
}

choices! {
    /// Sampler of ray directions: a sequence of points in the unit square for each pixel, continued
    /// from frame to frame.
    ///
    /// `Sobol`: each pixel has its own sequence, which frames continue (Burley 2020). `Blue`: one
    /// sequence over the image, in the order of a shuffled Morton curve: the samples of an aligned
    /// square of pixels are a net, so that filtering it leaves little error (Ahmed and Wonka,
    /// "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering
    /// of Pixels", ACM TOG 39(6), 2020); from frame to frame all points are shifted by Roberts' R2
    /// sequence ("The Unreasonable Effectiveness of Quasirandom Sequences", 2018).
    #[repr(u32)]
    pub enum Sequence (default Blue) {
        /// Owen-scrambled Sobol, one sequence per pixel
        Sobol = "sobol",
        /// Owen-scrambled Sobol over the image: blue-noise error
        Blue = "blue",
    }
}

impl Sequence {
    /// The name of its constant in shaders.
    const fn glsl_name(self) -> &'static str {
        match self {
            Self::Sobol => "SEQUENCE_SOBOL",
            Self::Blue => "SEQUENCE_BLUE",
        }
    }
}

choices! {
    /// Pattern of the pixels that are sampled in a frame.
    #[repr(u32)]
    pub enum Resolution {
        /// Every pixel in every frame
        Full = "full",
        /// Half of the pixels per frame, alternating
        Checkerboard = "checkerboard",
        /// A quarter of the pixels per frame: half the resolution per axis
        Half = "half",
    }
}

impl Resolution {
    /// The name of its constant in shaders.
    const fn glsl_name(self) -> &'static str {
        match self {
            Self::Full => "PATTERN_FULL",
            Self::Checkerboard => "PATTERN_CHECKER",
            Self::Half => "PATTERN_QUARTER",
        }
    }
}

choices! {
    /// Tone mapping operator. Values are linear with sRGB primaries, before and after.
    #[repr(u32)]
    pub enum ToneMap (default Linear) {
        /// Clamp at 1
        Linear = "linear",
        /// Exponential, 1 - e^-x per channel
        Exponential = "exp",
        /// Reinhard et al. (2002), by luminance
        Reinhard = "reinhard",
        /// Khronos PBR Neutral (2024)
        Neutral = "neutral",
        /// AgX (Sobotka 2022, curve by Wrensch 2023)
        Agx = "agx",
    }
}

impl ToneMap {
    /// The name of its constant in shaders.
    const fn glsl_name(self) -> &'static str {
        match self {
            Self::Linear => "TONE_MAP_LINEAR",
            Self::Exponential => "TONE_MAP_EXPONENTIAL",
            Self::Reinhard => "TONE_MAP_REINHARD",
            Self::Neutral => "TONE_MAP_NEUTRAL",
            Self::Agx => "TONE_MAP_AGX",
        }
    }
}

choices! {
    /// Buffer of a frame that is displayed: scalars as grey up to `Rays`, colours from `Normal` on
    /// (shaders/display.glsl compares).
    #[repr(u32)]
    pub enum DisplayMode {
        /// The final image: ambient visibility, or radiance
        Result = "result",
        /// The input of the spatial filter
        Unfiltered = "unfiltered",
        /// Accumulated samples; white: maximum history length
        Samples = "samples",
        /// Variance of one sample; white: 0.25
        Variance = "variance",
        /// Depth along the view; white is near
        Depth = "depth",
        /// Occlusion rays traced in this frame; white: the most that a pixel can have
        Rays = "rays",
        /// Geometric normal, -1 to 1 mapped to 0 to 1
        Normal = "normal",
        /// World position, repeating every quarter of the scene
        Position = "position",
        /// Bent normal, -1 to 1 mapped to 0 to 1
        Bent = "bent",
        /// A colour for each instance
        Ids = "ids",
        /// Motion vectors since the previous frame, grey where nothing moves: more red to the
        /// right, more green downwards, 8 pixels halfway
        Motion = "motion",
        /// BVH nodes that camera rays visit, as a heat map; needs `--tracer compute`
        Nodes = "nodes",
        /// Why pixels have no history: blue was off screen, red another instance, green another
        /// depth, yellow another normal; grey has one
        Rejected = "rejected",
    }
}

impl DisplayMode {
    /// The name of its constant in shaders.
    const fn glsl_name(self) -> &'static str {
        match self {
            Self::Result => "SHOWN_RESULT",
            Self::Unfiltered => "SHOWN_UNFILTERED",
            Self::Samples => "SHOWN_SAMPLES",
            Self::Variance => "SHOWN_VARIANCE",
            Self::Depth => "SHOWN_DEPTH",
            Self::Rays => "SHOWN_RAYS",
            Self::Normal => "SHOWN_NORMAL",
            Self::Position => "SHOWN_POSITION",
            Self::Bent => "SHOWN_BENT",
            Self::Ids => "SHOWN_IDS",
            Self::Motion => "SHOWN_MOTION",
            Self::Nodes => "SHOWN_NODES",
            Self::Rejected => "SHOWN_REJECTED",
        }
    }
}

impl PixelFilter {
    /// Returns true if samples lie within their pixel, so that it sees nothing beyond its area.
    pub fn is_within_pixel(self) -> bool {
        matches!(self, Self::Box | Self::Centre)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// No compiler finds variants that shaders cannot tell apart: their files are included apart.
    #[test]
    fn names_and_numbers_tell_variants_apart() {
        let all = declarations();
        let names: BTreeSet<&str> = all.iter().flat_map(|d| &d.variants).map(|v| v.0).collect();
        assert_eq!(names.len(), all.iter().map(|d| d.variants.len()).sum::<usize>());
        for declaration in &all {
            let first = declaration.variants[0].1;
            let numbers: Vec<u32> = declaration.variants.iter().map(|v| v.1).collect();
            let consecutive: Vec<u32> = (first..).take(numbers.len()).collect();
            assert_eq!(numbers, consecutive, "{}", declaration.name);
        }
        let files: BTreeSet<&str> = all.iter().map(|d| d.name).collect();
        assert_eq!(files.len(), all.len());
    }
}
