//! Baking: ambient occlusion, and other properties of surfaces, as textures of a model or as
//! colours of its vertices.
//!
//! [`plan`] decides which textures there are, one a material or one for all, and where surfaces lie
//! in them: by texture coordinates that a file has, if no two places share a texel, else by
//! coordinates that are made for it ([`unwrap`]). [`texels`] finds the points of surfaces that each
//! texel shows, [`trace`] samples the hemispheres over them by the renderer's tracers, [`kept`]
//! keeps the sums in a file, [`map`] turns them into values, [`fill`] extends those beyond the
//! borders of charts, and [`seams`] compares them there. [`vertices`] does the same for vertices.
//! [`document`] writes the results into the model's own file, of which all else stays.

pub mod agreement;
mod backfaces;
pub mod cage;
pub mod document;
pub mod fill;
mod frames;
pub mod kept;
pub mod light;
pub mod map;
#[cfg(feature = "cli")]
pub mod options;
pub mod pack;
pub mod picture;
pub mod plan;
pub mod seams;
pub mod session;
pub mod skew;
pub mod smooth;
pub mod texels;
pub mod trace;
pub mod udim;
pub mod unwrap;
pub mod vertices;

use std::str::FromStr;

use crate::integrators::IntegratorName;
use crate::integrators::ao::Occlusion;
use crate::settings::choices;

choices! {
    /// A property of surfaces.
    pub enum Map {
        /// Ambient visibility: the unoccluded share of the hemisphere
        Ao = "ao",
        /// Mean direction of the unoccluded hemisphere, as RGB
        BentNormal = "bent-normal",
        /// Mean length of rays into the surface, as a share of the radius
        Thickness = "thickness",
        /// Open share of the sphere around a point: above one half on edges, below in creases
        Curvature = "curvature",
        /// Position within the bounds, as RGB
        Position = "position",
        /// Shading normal, as RGB
        Normal = "normal",
        /// Light that arrives, as RGB: irradiance divided by pi (a light map)
        Light = "light",
    }
}

impl Map {
    /// Returns true if its values are directions or positions.
    pub fn is_vector(self) -> bool {
        matches!(self, Map::BentNormal | Map::Position | Map::Normal)
    }

    /// Returns true if it has three channels, else one.
    pub fn is_rgb(self) -> bool {
        self.is_vector() || self == Map::Light
    }

    /// Returns true if rays sample it.
    pub fn is_sampled(self) -> bool {
        !matches!(self, Map::Position | Map::Normal)
    }

    /// Radius where none is given, as a share of the scene's diagonal; `None`: that of ambient
    /// occlusion.
    pub fn default_radius(self) -> Option<f64> {
        match self {
            Map::Thickness => Some(0.1),
            Map::Curvature => Some(0.01),
            _ => None,
        }
    }
}

choices! {
    /// Coordinates of directions and positions.
    pub enum Space {
        /// The scene's
        World = "world",
        /// Those of the mesh
        Object = "object",
        /// Those of the surface, as normal maps have them (MikkTSpace)
        Tangent = "tangent",
    }
}

choices! {
    /// What occludes a surface.
    pub enum Occluders {
        /// Everything in the scene
        Scene = "scene",
        /// The meshes of its own material
        Material = "material",
    }
}

choices! {
    /// How edges are treated whose two sides lie apart in the texture.
    pub enum SeamTreatment {
        /// As sampled
        Leave = "leave",
        /// Texels along them are changed until both sides agree
        Match = "match",
    }
}

choices! {
    /// Where results go in a model.
    pub enum Target {
        /// Textures
        Texture = "texture",
        /// Colours of vertices
        Vertices = "vertices",
    }
}

/// Which texture coordinates show a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TexcoordChoice {
    /// Set 1 if it is unique, else set 0, else new ones.
    #[default]
    Auto,
    /// This set.
    Set(u32),
    /// New ones.
    Unwrap,
}

impl FromStr for TexcoordChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "unwrap" => Ok(Self::Unwrap),
            number => {
                number.parse().map(Self::Set).map_err(|_| "auto, unwrap or the number of a set expected".to_owned())
            }
        }
    }
}

/// The light that arrives at surfaces.
#[derive(Clone, Debug, Default)]
pub struct LightSettings {
    /// The integrator, one of paths without ambient occlusion; `None`: `path`.
    pub integrator: Option<IntegratorName>,
    /// Maximum number of bounces; 1 is direct light. `None`: the scene's, or no limit.
    pub max_depth: Option<u32>,
}

/// Settings of baking.
#[derive(Clone, Debug)]
pub struct BakeSettings {
    /// The property.
    pub map: Map,
    /// Width and height of textures, texels.
    pub size: [u32; 2],
    /// Samples of a texel; rounded up to the points of a texel times a power of two.
    pub spp: u32,
    /// Standard error of a texel's value down to which it gets more samples, 64 times as many at
    /// most.
    pub target_error: Option<f64>,
    /// Seed of the sampler.
    pub seed: u32,
    /// Which hits occlude, and how much; its radius is also that of thickness and curvature.
    pub occlusion: Occlusion,
    /// The surfaces that occlude.
    pub occluders: Occluders,
    /// A plane under the scene occludes, too.
    pub has_ground: bool,
    /// Texture coordinates.
    pub texcoords: TexcoordChoice,
    /// Texels around charts that get the value of the nearest covered one; infinite: all.
    pub padding: f64,
    /// Noise is filtered in the texture, which puts a bias in its place.
    pub is_smoothed: bool,
    /// Edges whose two sides lie apart in the texture.
    pub seams: SeamTreatment,
    /// Coordinates of directions and positions.
    pub space: Space,
    /// Values are the mean over all instances of a mesh, not those of the first.
    pub averages_instances: bool,
    /// Each instance of a mesh has a texture of its own.
    pub has_unique_instances: bool,
    /// All materials share one texture.
    pub is_atlas: bool,
    /// Maps have the variance and the number of samples of each texel.
    pub has_noise: bool,
    /// Names of the materials that are baked; none: all.
    pub materials: Vec<String>,
    /// The light of [`Map::Light`].
    pub light: LightSettings,
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self {
            map: Map::default(),
            size: [1024; 2],
            spp: 64,
            target_error: None,
            seed: 0,
            occlusion: Occlusion::default(),
            occluders: Occluders::default(),
            has_ground: false,
            texcoords: TexcoordChoice::default(),
            padding: f64::INFINITY,
            is_smoothed: false,
            seams: SeamTreatment::default(),
            space: Space::default(),
            averages_instances: false,
            has_unique_instances: false,
            is_atlas: false,
            has_noise: false,
            materials: Vec::new(),
            light: LightSettings::default(),
        }
    }
}

impl BakeSettings {
    /// Base 2 logarithm of the samples of each of `points` points that share a texel's samples.
    fn sample_bits(&self, points: usize) -> u32 {
        self.spp.div_ceil(points as u32).next_power_of_two().ilog2().min(10)
    }
}
