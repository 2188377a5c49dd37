//! Skew: how much rays to a detailed model are turned from the averaged normals of a simple one to
//! the normals of its triangles.
//!
//! Averaged normals leave no gap at hard edges, but slant what is baked onto flat faces beside
//! them. A map of the skew turns rays there alone.

use std::collections::BTreeSet;
use std::path::Path;

use glam::Vec2;

use super::plan::PlannedTexture;
use crate::error::{Error, Result};
use crate::files;
use crate::output;
use crate::scene::load::load_texture;
use crate::scene::texture::{Filter, Wrap};
use crate::scene::{TexelData, Texture};

/// Extensions of images that may be maps.
pub const FORMATS: [&str; 10] = ["png", "jpg", "jpeg", "webp", "tga", "bmp", "ktx2", "dds", "hdr", "exr"];

/// Share of the geometric normal in the directions of rays, from 0 (those of the cage) to 1.
#[derive(Clone, Copy)]
pub enum Skew<'a> {
    /// The same everywhere.
    Uniform(f64),
    /// That of a map.
    Map(&'a SkewMap),
}

impl Default for Skew<'_> {
    fn default() -> Self {
        Self::Uniform(0.0)
    }
}

impl Skew<'_> {
    /// The share at a point by its texture coordinates.
    pub fn at(self, uv: impl FnOnce() -> Vec2) -> f64 {
        match self {
            Self::Uniform(share) => share,
            Self::Map(map) => map.look_up(uv()),
        }
    }
}

/// An image in the texture coordinates that are baked into, whose red channel is the share.
pub struct SkewMap {
    texture: Texture,
}

impl SkewMap {
    /// Reads a map of the textures that are planned. Values are taken as they are stored, so that
    /// half of the greatest one is 0.5.
    ///
    /// # Errors
    /// [`Error::Input`], and [`Error::Usage`] for textures that have no such map.
    pub fn load(path: &Path, planned: &[PlannedTexture]) -> Result<Self> {
        check(path, planned)?;
        let mut texture = if files::has_extension(path, "exr") { read_exr(path)? } else { load_texture(path)? };
        let wrap = if planned.iter().any(PlannedTexture::repeats) { Wrap::Repeat } else { Wrap::Clamp };
        (texture.wrap, texture.filter) = ([wrap; 2], Filter::Linear);
        Ok(Self { texture })
    }

    /// The share at texture coordinates, bilinear; values beyond 0 and 1 count as
    /// those, and what is not a number as 0.
    fn look_up(&self, uv: Vec2) -> f64 {
        let share = f64::from(self.texture.look_up(uv).x);
        if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
    }

    /// The image.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }
}

/// Checks that textures have one map: it is of one layout of texture coordinates, which is there.
fn check(path: &Path, planned: &[PlannedTexture]) -> Result<()> {
    let refused = |text: String| Err(Error::Usage(format!("--skew {}: {text}", path.display())));
    if let Some(made) = planned.iter().find(|texture| !texture.unwrapped.is_empty()) {
        return refused(format!(
            "material `{}` gets new texture coordinates, which no image shows yet: bake into a model first, and bake \
             that model with an image painted for it",
            made.name
        ));
    }
    let layouts: BTreeSet<_> = planned.iter().map(|t| (&t.name, t.tile.map(|tile| tile.to_array()))).collect();
    if layouts.len() > 1 {
        return refused(format!(
            "is an image of one texture, and {} are baked: choose one by --only-material, or give a number",
            layouts.len()
        ));
    }
    Ok(())
}

/// Reads the grey or the red channel of an EXR file.
fn read_exr(path: &Path) -> Result<Texture> {
    let image = output::load(path)?;
    let Some(grey) = ["Y", "R"].into_iter().find_map(|name| image.f32(name)) else {
        return Err(Error::input(path, "has neither a channel Y nor R: save the map as a grey image"));
    };
    let texels = TexelData::from(grey.iter().flat_map(|v| [*v, *v, *v, 1.0]).collect::<Vec<f32>>());
    let name = path.to_string_lossy().into_owned();
    Ok(Texture {
        name,
        width: image.width,
        height: image.height,
        texels,
        wrap: [Wrap::Clamp; 2],
        filter: Filter::Linear,
    })
}
