//! Numbered alternatives that records hold.

/// What the shaders' side is made of.
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

/// `from N` numbers the alternatives from N on, `default A` makes one the default.
macro_rules! enumerations {
    ($(
        $(#[doc = $about:literal])*
        $name:ident: $file:literal $(from $from:literal)? $(default $default:ident)? {
            $(#[doc = $first_about:literal])* $first:ident = $first_glsl:literal,
            $($(#[doc = $variant_about:literal])* $variant:ident = $glsl:literal,)*
        }
    )*) => {
        $(
            shared_enumeration! {
                $(#[doc = $about])*
                #[repr(u32)]
                #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
                pub enum $name {
                    $(#[doc = $first_about])* $first = first_number!($($from)?),
                    $($(#[doc = $variant_about])* $variant,)*
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
                ($first_glsl, $name::$first as u32, concat!($($first_about),*)),
                $(($glsl, $name::$variant as u32, concat!($($variant_about),*)),)*
            ],
        },)*];
    };
}

enumerations! {
    /// How light goes through a material.
    Walls: "walls" {
        /// It does not.
        Opaque = "WALLS_NONE",
        /// Straight on, through surfaces without thickness.
        Thin = "WALLS_THIN",
        /// Refracted, into a volume.
        Volume = "WALLS_VOLUME",
    }

    /// What a texture looks up outside [0, 1].
    Wrap: "wrap" default Repeat {
        /// Tile (glTF's default).
        Repeat = "WRAP_REPEAT",
        /// Tile, every second tile mirrored.
        Mirror = "WRAP_MIRROR",
        /// Extend the border.
        Clamp = "WRAP_CLAMP",
    }

    /// How texels are stored, four channels each.
    TexelFormat: "texel_format" {
        /// 8 bits a channel, a `uint` each.
        Unorm8 = "FORMAT_UNORM8",
        /// 16 bits a channel, a `uvec2` each.
        Unorm16 = "FORMAT_UNORM16",
        /// Single precision, a `vec4` each: linear, whatever the use.
        Float = "FORMAT_FLOAT",
    }

    /// What a texture's colours are, and so how they are averaged. All levels hold linear values: a texture that is used in two ways has two sets of them.
    Texels: "texels" {
        /// Numbers; of normal maps vectors, whose mean is shorter the more they differ. Shaders normalize that away.
        Linear = "TEXELS_LINEAR",
        /// sRGB: averaged as light.
        Srgb = "TEXELS_SRGB",
        /// sRGB of a surface that is there as alpha says. What is not there counts nothing: colours are multiplied by alpha, and stay so.
        Covered = "TEXELS_COVERED",
    }

    /// What a camera ray sees of a surface, instead of light, which is number 0.
    View: "view" from 1 {
        /// Unit shading normals, world, on the viewer's side; normal maps included.
        Normals = "VIEW_NORMALS",
        /// Base colours, linear; of mirrors, glass and conductors what they reflect at normal incidence.
        Albedo = "VIEW_ALBEDO",
        /// Distance along the ray, world units.
        Depth = "VIEW_DEPTH",
        /// Occlusion that is baked into the material's texture; 1 where there is none.
        BakedOcclusion = "VIEW_BAKED_OCCLUSION",
    }

    /// Rounds of the pass that gives each pixel its rays of a frame's budget.
    BudgetStage: "budget_stage" {
        /// What each pixel wants.
        DesiredSamples = "STAGE_DESIRED_SAMPLES",
        /// Sums at levels far apart.
        Coarse = "STAGE_COARSE",
        /// Sums at levels between two of them.
        Fine = "STAGE_FINE",
        /// The rays.
        Rays = "STAGE_RAYS",
    }
}

/// Alternatives that are settings, too: each with its name on the command line and its name in shaders.
macro_rules! choices {
    ($(
        $(#[doc = $about:literal])*
        $name:ident: $file:literal $(default $default:ident)? {
            $($(#[doc = $variant_about:literal])+ $variant:ident = $setting:literal, $glsl:literal;)+
        }
    )*) => {
        $(
            shared_choice! {
                $(#[doc = $about])*
                #[repr(u32)]
                pub enum $name $((default $default))? {
                    $($(#[doc = $variant_about])+ $variant = $setting,)+
                }
            }
        )*
        pub(super) const CHOICES: &[Declaration] = &[$(Declaration {
            name: $file,
            variants: &[$(($glsl, $name::$variant as u32, concat!($($variant_about),*)),)*],
        },)*];
    };
}

choices! {
    /// Reconstruction filter of pixels, by importance sampling: positions are sampled in proportion to the filter, and count alike (Ernst, Stamminger, Greiner,
    /// "Filter Importance Sampling", 2006).
    PixelFilter: "pixel_filter" {
        /// Box filter of one pixel
        Box = "box", "FILTER_BOX";
        /// Tent filter of radius 1
        Tent = "tent", "FILTER_TENT";
        /// Blackman-Harris filter of radius 1.5
        BlackmanHarris = "blackman-harris", "FILTER_BLACKMAN_HARRIS";
    }

    /// A sequence of points in the unit square, for each pixel and frame.
    ///
    /// `Stratified`: sixteen samples in a row, over a pixel's frames, visit each cell of the grid once. `Sobol`: each pixel has a sequence of its own, which
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

    /// Which pixels are sampled in a frame.
    Resolution: "pattern" {
        /// Every pixel in every frame
        Full = "full", "PATTERN_FULL";
        /// Half of the pixels per frame, alternating
        Checkerboard = "checkerboard", "PATTERN_CHECKER";
        /// A quarter of the pixels per frame: half the resolution per axis
        Half = "half", "PATTERN_QUARTER";
    }

    /// What is shown of a frame: numbers as grey up to `Depth`, colours from `Normal` on (shaders/display.glsl compares).
    Shown: "shown" {
        /// The filtered result
        Accessibility = "accessibility", "SHOWN_ACCESSIBILITY";
        /// The input of the spatial filter
        Unfiltered = "unfiltered", "SHOWN_UNFILTERED";
        /// Accumulated samples; white: maximum history length
        Samples = "samples", "SHOWN_SAMPLES";
        /// Variance of one sample; white: 0.25
        Variance = "variance", "SHOWN_VARIANCE";
        /// Depth along the view; white is near
        Depth = "depth", "SHOWN_DEPTH";
        /// Geometric normal, -1 to 1 mapped to 0 to 1
        Normal = "normal", "SHOWN_NORMAL";
        /// World position, repeating every quarter of the scene
        Position = "position", "SHOWN_POSITION";
        /// Bent normal, -1 to 1 mapped to 0 to 1
        Bent = "bent", "SHOWN_BENT";
        /// BVH nodes that camera rays visit, as a heat map; needs `--tracer compute`
        Nodes = "nodes", "SHOWN_NODES";
    }
}
