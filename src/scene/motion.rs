//! The declaration of what may change in a scene.

use std::collections::BTreeMap;

use super::{Geometry, Material, Scene};
use crate::error::{Error, Result};

/// The instances and meshes of a scene that may change after its upload. The default is a static
/// scene, for which tracers keep no state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Instances that may move, or be hidden and shown, as indices into [`Scene::instances`].
    pub instances: Vec<usize>,
    /// Triangle meshes whose vertices may move, as indices into [`Scene::meshes`].
    pub meshes: Vec<usize>,
    /// Materials that may change, as indices into [`Scene::materials`], each with others that
    /// between them need all of shaders that it ever needs.
    pub materials: BTreeMap<usize, Vec<Material>>,
    /// Lights that may become dark and bright again, as indices into [`Scene::lights`].
    pub lights: Vec<usize>,
}

impl Motion {
    /// Whether the geometry of the scene is static.
    pub fn is_none(&self) -> bool {
        self.instances.is_empty() && self.meshes.is_empty()
    }

    /// The states that say what a material of the scene may need: itself, and what it may become.
    pub fn states<'a>(&'a self, scene: &'a Scene, material: usize) -> impl Iterator<Item = &'a Material> {
        std::iter::once(&scene.materials[material]).chain(self.materials.get(&material).into_iter().flatten())
    }

    /// Fails for instances and meshes that the scene does not have, and for spheres, which do not
    /// deform.
    pub(crate) fn check(&self, scene: &Scene) -> Result<()> {
        if let Some(i) = self.instances.iter().find(|&&i| i >= scene.instances.len()) {
            return Err(Error::Usage(format!("instance {i} cannot move: the scene has {}", scene.instances.len())));
        }
        for &m in &self.meshes {
            match scene.meshes.get(m).map(|mesh| &mesh.geometry) {
                Some(Geometry::Triangles(_)) => (),
                Some(Geometry::Spheres(_)) => {
                    return Err(Error::Usage(format!(
                        "mesh {m} cannot deform: it holds spheres; move its instances instead"
                    )));
                }
                None => {
                    return Err(Error::Usage(format!("mesh {m} cannot deform: the scene has {}", scene.meshes.len())));
                }
            }
        }
        Ok(())
    }
}
