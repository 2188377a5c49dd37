//! Numbered alternatives that records hold.

/// What the shaders' side is made of.
pub(super) struct Declaration {
    /// Its file in interface/.
    pub name: &'static str,
    /// Names in the shaders, and what they mean; numbered from 0.
    pub variants: &'static [(&'static str, &'static str)],
}

macro_rules! enumerations {
    ($(
        $(#[doc = $about:literal])*
        $name:ident: $file:literal { $(#[doc = $variant_about:literal] $variant:ident = $glsl:literal,)* }
    )*) => {
        $(
            $(#[doc = $about])*
            #[repr(u32)]
            #[derive(Clone, Copy, Debug, PartialEq, Eq)]
            pub enum $name {
                $(#[doc = $variant_about] $variant,)*
            }

            impl $name {
                /// All of them, in the order of their numbers.
                pub const ALL: &'static [Self] = &[$(Self::$variant,)*];
            }
        )*
        pub(super) const ALL: &[Declaration] =
            &[$(Declaration { name: $file, variants: &[$(($glsl, $variant_about),)*] },)*];
    };
}

enumerations! {
    /// What a light is.
    LightKind: "light_kind" {
        #[doc = "At a position, the same in all directions."]
        Point = "LIGHT_POINT",
        #[doc = "At a position, in a cone."]
        Spot = "LIGHT_SPOT",
        #[doc = "Parallel, or with an angular diameter: a distant disk."]
        Directional = "LIGHT_DIRECTIONAL",
        #[doc = "A triangle that emits."]
        Triangle = "LIGHT_TRIANGLE",
        #[doc = "A sphere that emits."]
        Sphere = "LIGHT_SPHERE",
        #[doc = "All around."]
        Environment = "LIGHT_ENVIRONMENT",
        #[doc = "All lights that have a position: the tree chooses one of them."]
        Tree = "LIGHT_TREE",
        #[doc = "Two triangles that make a rectangle."]
        Rectangle = "LIGHT_RECTANGLE",
    }

    /// Which reflection model a material has.
    MaterialModel: "material_model" {
        #[doc = "glTF's metallic-roughness with its extensions."]
        Gltf = "MODEL_GLTF",
        #[doc = "Lambert."]
        Matte = "MODEL_MATTE",
        #[doc = "A perfect mirror."]
        Mirror = "MODEL_MIRROR",
        #[doc = "A dielectric that light goes through."]
        Glass = "MODEL_GLASS",
        #[doc = "A metal by its measured index of refraction."]
        Conductor = "MODEL_CONDUCTOR",
        #[doc = "Shows its colour whatever the light, and reflects none."]
        Unlit = "MODEL_UNLIT",
    }

    /// How light goes through a material.
    Walls: "walls" {
        #[doc = "It does not."]
        Opaque = "WALLS_NONE",
        #[doc = "Straight on, through surfaces without thickness."]
        Thin = "WALLS_THIN",
        #[doc = "Refracted, into a volume."]
        Volume = "WALLS_VOLUME",
    }
}
