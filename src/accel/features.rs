//! What a scene needs, found once at load: the rest is not compiled into shaders, not recorded and not traced.

use super::flatten::FlatScene;
use crate::interface::ShadingFeatures;
use crate::scene::{AlphaMode, Geometry, Material, Scene, TexelData};

/// What alpha means for the visibility of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlphaClass {
    /// There everywhere: no test.
    Opaque,
    /// There in places: ask at every hit.
    Tested,
    /// There nowhere: nothing to trace.
    Absent,
}

/// Alpha below this is absent. BLEND surfaces count as there from one half on in streams that only know there or not.
pub fn alpha_cutoff(material: &Material) -> Option<f32> {
    match material.alpha_mode {
        AlphaMode::Opaque => None,
        AlphaMode::Mask { cutoff } => Some(cutoff),
        AlphaMode::Blend => Some(0.5),
    }
}

/// What [`AlphaMode::Blend`] means for rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blend {
    /// There from an alpha of one half on: what streams ask that only know there or not.
    #[default]
    Masked,
    /// There with a probability of alpha, drawn anew for each ray: what paths ask. Spheres, which have no coordinates to draw by, are masked.
    Covered,
}

/// Class of each mesh of the scene, from the range of alpha that its material and vertices can reach.
pub fn alpha_classes(scene: &Scene, blend: Blend) -> Vec<AlphaClass> {
    // range of alpha of each texture, looked at once and only where an alpha mode asks
    let mut ranges: Vec<Option<(f32, f32)>> = vec![None; scene.textures.len()];
    scene
        .meshes
        .iter()
        .map(|mesh| {
            let material = &scene.materials[mesh.material];
            let Some(cutoff) = alpha_cutoff(material) else { return AlphaClass::Opaque };
            let (mut lo, mut hi) = (material.base_color.w, material.base_color.w);
            if let Geometry::Triangles(t) = &mesh.geometry {
                if let Some(slot) = &material.base_color_texture {
                    let (a, b) = *ranges[slot.texture].get_or_insert_with(|| alpha_range(&scene.textures[slot.texture].texels));
                    (lo, hi) = (lo * a, hi * b);
                }
                if !t.colors.is_empty() {
                    let (a, b) = t.colors.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), c| (a.min(c.w), b.max(c.w)));
                    (lo, hi) = (lo * a, hi * b);
                }
            }
            // interpolation rounds: a range that just reaches the cutoff is tested
            let margin = 1e-5;
            let covered = blend == Blend::Covered && material.alpha_mode == AlphaMode::Blend;
            if covered && matches!(mesh.geometry, Geometry::Triangles(_)) {
                return match (lo >= 1.0 - margin, hi <= 0.0) {
                    (true, _) => AlphaClass::Opaque,
                    (_, true) => AlphaClass::Absent,
                    _ => AlphaClass::Tested,
                };
            }
            if lo >= cutoff + margin || cutoff <= 0.0 {
                AlphaClass::Opaque
            } else if hi < cutoff - margin {
                AlphaClass::Absent
            } else if matches!(mesh.geometry, Geometry::Spheres(_)) {
                // spheres have no coordinates: their alpha is one number
                if lo >= cutoff { AlphaClass::Opaque } else { AlphaClass::Absent }
            } else if lo == hi && lo >= cutoff {
                AlphaClass::Opaque
            } else {
                AlphaClass::Tested
            }
        })
        .collect()
}

fn alpha_range(texels: &TexelData) -> (f32, f32) {
    texels.iter().fold((f32::INFINITY, 0.0), |(lo, hi), [_, _, _, alpha]| (alpha.min(lo), alpha.max(hi)))
}

/// What the scene needs, as the specialisation of shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneFeatures {
    /// Some triangles are alpha tested.
    pub alpha: bool,
    /// Some of them are there for a part of the rays ([`Blend::Covered`]).
    pub coverage: bool,
    /// Some textures have more than 8 bits a channel.
    pub deep_texels: bool,
    /// There are analytic spheres.
    pub spheres: bool,
    /// One top-level entry with an identity transform.
    pub single_level: bool,
    /// What materials require of the path tracer; `None` where nothing is shaded.
    pub shading: Option<ShadingFeatures>,
}

impl SceneFeatures {
    /// Of a flattened scene.
    pub fn of(flat: &FlatScene) -> Self {
        Self {
            alpha: flat.has_alpha(),
            coverage: flat.has_coverage(),
            deep_texels: flat.scene.textures.iter().any(|t| !matches!(t.texels, TexelData::Unorm8(_))),
            spheres: flat.has_spheres(),
            single_level: flat.is_single_level(),
            shading: None,
        }
    }

    /// One line for each thing that is skipped, and what that saves.
    pub fn explain(&self, flat: &FlatScene) -> Vec<String> {
        let mut lines = Vec::new();
        if !self.alpha {
            lines.push(
                "no alpha test: no primitive is partly transparent; geometry is opaque, any-hit code is not compiled"
                    .to_owned(),
            );
        } else {
            let (all, opaque) = flat.groups.iter().fold((0, 0), |(a, o), g| (a + g.primitive_count, o + g.opaque_count));
            lines.push(format!("alpha test on {} of {all} primitives only", all - opaque));
        }
        if !self.spheres {
            lines.push("no spheres: their intersection code is not compiled".to_owned());
        }
        if self.single_level {
            let n = flat.groups.first().map_or(0, |g| g.submeshes.len());
            lines.push(format!(
                "one level: {n} mesh{} baked into world space, the top level is skipped",
                if n == 1 { "" } else { "es" }
            ));
        } else {
            lines.push(format!("two levels: {} groups, {} entries in the top level", flat.groups.len(), flat.instances.len()));
        }
        if flat.absent_primitives > 0 {
            lines.push(format!("{} primitives are transparent everywhere and left out", flat.absent_primitives));
        }
        lines
    }
}
