//! Options of loading, and the count of loads in progress.

use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::confine::Confine;
use crate::memory::Budget;
use crate::settings::choices;

choices! {
    /// Projections that give meshes without texture coordinates some. Axes are those of the mesh: y
    /// up, z to the front.
    pub enum Projection {
        /// From the centre of the mesh's bounds, as a map of the world: u around the y axis, v from the top down
        Spherical = "spherical",
        /// Around the y axis through the centre of the mesh's bounds; v over their height
        Cylindrical = "cylindrical",
        /// Each triangle on the side of a cube that it faces, whose sides are as long as the longest of the mesh's bounds
        Box = "box",
    }
}

choices! {
    /// The axis of a file that points up. It becomes y, which is up everywhere else.
    pub enum UpAxis (default Y) {
        /// As in glTF
        Y = "y",
        /// As in files of CAD programs, robots and maps
        Z = "z",
    }
}

/// Where the shading normals of meshes come from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NormalSource {
    /// The file: its normals, or its smoothing groups; flat where it has neither.
    #[default]
    File,
    /// The triangles: every mesh is flat.
    Flat,
    /// The triangles around a vertex, across edges at which a surface bends by this angle or less,
    /// in degrees from 0 to 180.
    Smooth(f64),
}

impl fmt::Display for NormalSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => f.write_str("file"),
            Self::Flat => f.write_str("flat"),
            Self::Smooth(degrees) if *degrees == 180.0 => f.write_str("smooth"),
            Self::Smooth(degrees) => write!(f, "{degrees}"),
        }
    }
}

impl FromStr for NormalSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "file" => Ok(Self::File),
            "flat" => Ok(Self::Flat),
            "smooth" => Ok(Self::Smooth(180.0)),
            number => match number.parse() {
                Ok(degrees) if (0.0..=180.0).contains(&degrees) => Ok(Self::Smooth(degrees)),
                _ => Err("file, flat, smooth or an angle from 0 to 180 degrees expected".to_owned()),
            },
        }
    }
}

/// How the geometry of a file is understood, and attributes of vertices that replace the file's, or
/// that it lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GeometryOptions {
    /// Shading normals.
    pub normals: NormalSource,
    /// Texture coordinates of meshes that have none and whose material has textures; `None`: zero,
    /// with a warning.
    pub uv: Option<Projection>,
    /// The axis that points up.
    pub up: UpAxis,
}

impl GeometryOptions {
    /// The options as words of the command line: `--normals`, `flat`, ...; none of the defaults.
    pub fn flags(&self) -> Vec<String> {
        let normals = Some(self.normals).filter(|n| *n != NormalSource::File);
        let normals = normals.map(|normals| ["--normals".to_owned(), normals.to_string()]);
        let uv = self.uv.map(|projection| ["--uv".to_owned(), projection.to_string()]);
        let up = Some(self.up).filter(|up| *up != UpAxis::Y).map(|up| ["--up-axis".to_owned(), up.to_string()]);
        normals.into_iter().chain(uv).chain(up).flatten().collect()
    }
}

/// Options of loading a scene.
#[derive(Clone, Copy)]
pub struct LoadOptions<'a> {
    /// Whether images are decoded. Without them materials have no textures, and
    /// [`crate::scene::LoadReport::skipped_images`] says what was left out.
    pub textures: bool,
    /// Called after each part that was decoded, from several threads.
    pub progress: &'a (dyn Fn(LoadProgress) + Sync),
    /// Where the files that a scene refers to have to lie. Those elsewhere are an error, and are
    /// not opened.
    pub confine: Confine<'a>,
    /// Scene of a glTF file, by its name or, where none is called that, its number; `None`: the one
    /// that the file names, or else its first.
    pub scene: Option<&'a str>,
    /// Normals and texture coordinates, also of built-in scenes.
    pub geometry: GeometryOptions,
}

impl LoadOptions<'_> {
    /// The options that decide what is loaded, as words of the command line: `--gltf-scene`,
    /// `--normals`, `--uv`, `--up-axis`; none of the defaults.
    pub fn flags(&self) -> Vec<String> {
        let scene = self.scene.map(|scene| ["--gltf-scene".to_owned(), scene.to_owned()]);
        scene.into_iter().flatten().chain(self.geometry.flags()).collect()
    }
}

/// A kind of parts that are decoded while a scene is loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadPart {
    /// Compressed geometry: views and primitives.
    Geometry,
    /// Images.
    Images,
}

/// How much of a scene is decoded so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadProgress {
    /// Kind of the parts that are counted.
    pub part: LoadPart,
    /// Number of those that are decoded.
    pub done: usize,
    /// Number of all; `None` for images of an .obj, which is not known before.
    pub of: Option<usize>,
}

impl Default for LoadOptions<'_> {
    fn default() -> Self {
        Self {
            textures: true,
            progress: &|_| (),
            confine: Confine::Nowhere,
            scene: None,
            geometry: GeometryOptions::default(),
        }
    }
}

/// The inputs that all readers of a scene and its files share.
#[derive(Clone, Copy)]
pub(super) struct Loading<'a> {
    pub options: LoadOptions<'a>,
    pub budget: &'a Budget,
}

/// Number of files that are being loaded.
static IN_PROGRESS: AtomicUsize = AtomicUsize::new(0);

/// Returns true while a scene or an environment is being loaded, in any thread. A load does not ask
/// whether it is to stop: it writes nothing, and whoever wants to stop may end the process.
pub fn is_in_progress() -> bool {
    IN_PROGRESS.load(Ordering::Relaxed) > 0
}

/// A guard that counts a load as long as it lasts.
pub(super) struct InProgress;

impl InProgress {
    pub fn begin() -> Self {
        IN_PROGRESS.fetch_add(1, Ordering::Relaxed);
        Self
    }
}

impl Drop for InProgress {
    fn drop(&mut self) {
        IN_PROGRESS.fetch_sub(1, Ordering::Relaxed);
    }
}
