//! Specialization constants: what a scene, a device or an option decides before a driver compiles a shader. Their numbers are given out here.

/// A specialization constant of 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Constant {
    /// `constant_id`.
    pub id: u32,
}

/// What the shaders' side is made of.
pub(super) struct Declaration {
    pub name: &'static str,
    pub kind: &'static str,
    /// Where nobody sets it.
    pub default: &'static str,
    pub about: &'static str,
}

macro_rules! constants {
    ($(#[doc = $about:literal] $name:ident: $kind:ident = $default:literal;)*) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "it counts, and has the names of what it counts")]
        enum Number {
            $($name,)*
        }
        $(
            #[doc = $about]
            pub const $name: Constant = Constant { id: Number::$name as u32 };
        )*
        pub(super) const ALL: &[Declaration] = &[
            $(Declaration {
                name: stringify!($name),
                kind: stringify!($kind),
                default: stringify!($default),
                about: $about,
            },)*
        ];
    };
}

constants! {
    #[doc = "Some surfaces have alpha on both sides of their cutoff: hits ask their material."]
    HAS_ALPHA: bool = true;
    #[doc = "There are analytic spheres."]
    HAS_SPHERES: bool = true;
    #[doc = "All geometry is one group without a transform: there is no top level."]
    SINGLE_LEVEL: bool = false;
    #[doc = "Some surfaces are there with a probability of their alpha."]
    HAS_COVERAGE: bool = true;
    #[doc = "Some textures have more than 8 bits a channel."]
    HAS_DEEP_TEXELS: bool = true;
    #[doc = "Entries of a traversal's stack."]
    STACK_SIZE: uint = 64;
    #[doc = "Rays of each lane of the kernel that traces rays one by one."]
    RAYS_PER_LANE: uint = 1;
    #[doc = "Children are visited in the order of the ray's direction on the split axis, not by distance."]
    BY_DIRECTION: bool = false;
    #[doc = "No ray slips between triangles that share an edge."]
    WATERTIGHT: bool = true;
    #[doc = "Lanes of a subgroup, a power of two."]
    SUBGROUP_SIZE: uint = 8;
    #[doc = "A lane that has made so many iterations takes no further ray; 0: no limit."]
    MAX_ITERATIONS: uint = 0;
    #[doc = "Frames have bent normals."]
    BENT_NORMALS: bool = false;
}
