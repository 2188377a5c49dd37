//! Specialization constants, fixed before the driver compiles a shader. This file assigns their
//! ids.

/// A specialization constant of 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Constant {
    /// `constant_id`.
    pub id: u32,
}

/// A constant, as its GLSL declaration is generated from it.
pub(super) struct Declaration {
    pub name: &'static str,
    pub kind: &'static str,
    /// Value when the host does not specialize it.
    pub default: &'static str,
    pub doc: &'static str,
}

macro_rules! constants {
    ($(#[doc = $doc:literal] $name:ident: $kind:ident = $default:literal;)*) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "it counts, and has the names of what it counts")]
        enum Number {
            $($name,)*
        }
        $(
            #[doc = $doc]
            pub const $name: Constant = Constant { id: Number::$name as u32 };
        )*
        pub(super) const ALL: &[Declaration] = &[
            $(Declaration {
                name: stringify!($name),
                kind: stringify!($kind),
                default: stringify!($default),
                doc: $doc,
            },)*
        ];
    };
}

constants! {
    #[doc = "Some surfaces have alpha on both sides of their cutoff, so hits are alpha tested."]
    HAS_ALPHA: bool = true;
    #[doc = "The scene has analytic spheres."]
    HAS_SPHERES: bool = true;
    #[doc = "All geometry is in one BLAS without a transform: there is no TLAS."]
    SINGLE_LEVEL: bool = false;
    #[doc = "Some surfaces have stochastic alpha: a hit counts with a probability of its alpha."]
    HAS_COVERAGE: bool = true;
    #[doc = "Some textures have more than 8 bits per channel."]
    HAS_DEEP_TEXELS: bool = true;
    #[doc = "Some material has textures on more than two sets of texture coordinates."]
    HAS_MANY_TEXCOORDS: bool = true;
    #[doc = "Entries of the traversal stack."]
    STACK_SIZE: uint = 64;
    #[doc = "Rays per invocation in the kernel that traces single rays."]
    RAYS_PER_LANE: uint = 1;
    #[doc = "Children are visited in the order of the ray's direction on the split axis, not by distance."]
    BY_DIRECTION: bool = false;
    #[doc = "Watertight intersection: no ray passes between triangles that share an edge."]
    WATERTIGHT: bool = true;
    #[doc = "Subgroup size, a power of two."]
    SUBGROUP_SIZE: uint = 8;
    #[doc = "An invocation that has made this many iterations fetches no further ray; 0: no limit."]
    MAX_ITERATIONS: uint = 0;
    #[doc = "Influence areas have trees of their own, in the binary kernels."]
    HAS_AREAS: bool = false;
    #[doc = "Another pass has traced the rays of the stream."]
    HITS_ARE_KNOWN: bool = false;
    #[doc = "The rays of the stream are in a queue, and not those that its shader would generate."]
    RAYS_ARE_QUEUED: bool = false;
    #[doc = "Bent normals are computed."]
    BENT_NORMALS: bool = false;
    #[doc = "Steps of the filter have strides: pixels between taps are left out."]
    FILTER_STRIDES: bool = false;
    #[doc = "Images show a ground that catches shadows; those of paths have a feature besides."]
    HAS_CATCHER: bool = false;
}
