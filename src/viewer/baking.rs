//! The numbers of the dialog *Bake*, `skylit bake`'s arguments that say them, and how a model that
//! was baked is shown.

use crate::settings::{Length, choices};

choices! {
    /// A place for what is baked.
    pub enum BakePlace {
        /// An occlusion texture for each material of the model
        Texture = "texture",
        /// Colours of the model's vertices, which need no texture
        Vertices = "vertices",
        /// An image of each material's map, without the model
        Image = "image",
    }
}

impl BakePlace {
    /// Name in the dialog.
    pub fn label(self) -> &'static str {
        match self {
            Self::Texture => "a texture in the model",
            Self::Vertices => "vertices of the model",
            Self::Image => "an image",
        }
    }
}

choices! {
    /// A property of surfaces, by the names of `skylit bake --map`.
    pub enum BakedMap {
        /// The unoccluded share of the hemisphere
        Ao = "ao",
        /// Mean direction of the unoccluded hemisphere, as RGB
        BentNormal = "bent-normal",
        /// Mean length of rays into the surface, as a share of their greatest length
        Thickness = "thickness",
        /// Open share of the sphere around a point: above one half on edges, below in creases
        Curvature = "curvature",
        /// Position within the bounds, as RGB
        Position = "position",
        /// Shading normal, as RGB
        Normal = "normal",
        /// Light that arrives, as RGB: irradiance divided by pi (a light map), with the view's light
        Light = "light",
    }
}

impl BakedMap {
    /// Name in the list.
    pub fn label(self) -> String {
        if self == Self::Ao { "ambient occlusion".into() } else { self.name().replace('-', " ") }
    }

    /// Whether rays sample it.
    pub fn has_samples(self) -> bool {
        !matches!(self, Self::Position | Self::Normal)
    }

    /// Whether it has the radius of ambient occlusion.
    pub fn has_radius(self) -> bool {
        matches!(self, Self::Ao | Self::BentNormal)
    }

    /// Length of its rays as a share of the scene's diagonal, where that is no matter of the view.
    pub fn default_share(self) -> Option<f64> {
        match self {
            Self::Thickness => Some(0.1),
            Self::Curvature => Some(0.01),
            _ => None,
        }
    }
}

/// Numbers that `skylit bake` is asked for. Of each place and map it has those that apply to it.
#[derive(Clone, Debug, PartialEq)]
pub struct BakeWanted {
    /// Where the values go.
    pub place: BakePlace,
    /// The map of an image; models hold ambient occlusion.
    pub image_map: BakedMap,
    /// Width and height of a texture, texels.
    pub size: u32,
    /// Samples per texel, or per corner of a triangle.
    pub spp: u32,
    /// AO radius, scene units; infinite: none.
    pub radius: f64,
    /// Length of the rays of thickness and curvature, as a share of the diagonal; `None`: that of
    /// the map.
    pub share: Option<f64>,
    /// All materials share one texture.
    pub is_atlas: bool,
    /// Noise is filtered.
    pub is_denoised: bool,
    /// A plane under the scene occludes, too.
    pub has_ground: bool,
    /// Once it is baked, the model is shown, beside traced ambient occlusion.
    pub is_shown: bool,
}

impl BakeWanted {
    /// The map that is baked.
    pub fn map(&self) -> BakedMap {
        if self.place == BakePlace::Image { self.image_map } else { BakedMap::Ao }
    }

    /// Most samples that `skylit bake` takes.
    pub fn most_samples(&self) -> u32 {
        if self.place == BakePlace::Vertices { 1024 } else { 4096 }
    }

    /// Whether noise can be filtered: vertices are means of their triangles.
    pub fn can_denoise(&self) -> bool {
        self.place != BakePlace::Vertices && self.map().has_samples()
    }

    /// The name of a file unless another is typed. `stem`: of the scene's file, which is `source`.
    pub fn file_name(&self, stem: &str, source: &str) -> String {
        let is_in_parts = source.to_lowercase().ends_with(".gltf");
        match self.place {
            BakePlace::Texture if is_in_parts => format!("{stem}-ao.gltf"),
            BakePlace::Texture => format!("{stem}-ao.glb"),
            BakePlace::Vertices if is_in_parts => format!("{stem}-ao-vertices.gltf"),
            BakePlace::Vertices => format!("{stem}-ao-vertices.glb"),
            BakePlace::Image => format!("{stem}-{}.png", self.image_map.name()),
        }
    }

    /// The length that `--ao-radius` is given, if the map has one.
    pub fn length(&self) -> Option<Length> {
        let map = self.map();
        let share = map.default_share().map(|share| Length::OfDiagonal(self.share.unwrap_or(share)));
        share.or_else(|| map.has_radius().then_some(Length::Units(self.radius)))
    }

    /// The options that render settings do not have.
    pub fn flags(&self) -> Vec<String> {
        let place = if self.place == BakePlace::Vertices { BakePlace::Vertices } else { BakePlace::Texture };
        let mut flags = ["--map", self.map().name(), "--to", place.name()].map(str::to_owned).to_vec();
        if self.place != BakePlace::Vertices {
            flags.extend(["--size".to_owned(), self.size.to_string()]);
        }
        if self.map().has_samples() {
            flags.extend(["--spp".to_owned(), self.spp.min(self.most_samples()).to_string()]);
        }
        if self.place == BakePlace::Texture && self.is_atlas {
            flags.push("--atlas".to_owned());
        }
        if self.can_denoise() && self.is_denoised {
            flags.push("--denoise".to_owned());
        }
        if self.map().has_samples() && self.has_ground {
            flags.push("--ground".to_owned());
        }
        flags
    }
}

/// A model that is baked, and how it is shown then.
#[derive(Clone, Debug, PartialEq)]
pub struct BakedModel {
    /// The scene that it is made of.
    pub source: String,
    /// The file.
    pub output: String,
    /// Where the values are: in a texture or at vertices.
    pub place: BakePlace,
    /// Radius and falloff of its ambient occlusion.
    pub ao: (Length, Option<f64>),
    /// The number of its [`crate::viewer::request::Request::load`], once it is opened.
    pub load: u64,
}

impl BakedModel {
    /// Whether it is the file of the scene with something added, and not made of it as it was
    /// shown.
    pub fn is_amended(&self) -> bool {
        let source = self.source.to_lowercase();
        source.ends_with(".gltf") || source.ends_with(".glb")
    }

    /// The integrator that shows what was baked.
    pub fn integrator(&self) -> &'static str {
        if self.place == BakePlace::Vertices { "albedo" } else { "baked-occlusion" }
    }
}
