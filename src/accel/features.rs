//! Features that a scene uses, found once at load. Unused features are specialized out of the
//! shaders, not recorded and not traced.

use super::flatten::FlatScene;
use crate::interface::ShadingFeatures;
use crate::scene::{AlphaMode, Geometry, Material, Mesh, Motion, Scene, TexelData};

/// Visibility class of a mesh by its alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlphaClass {
    /// Opaque everywhere: no alpha test.
    Opaque,
    /// Opaque in some places: alpha is tested at every hit.
    Tested,
    /// Fully transparent: not traced.
    Absent,
}

/// Alpha below this counts as transparent; `None` for opaque materials. Streams with binary
/// visibility treat BLEND as MASK with a cutoff of 0.5.
pub fn alpha_cutoff(material: &Material) -> Option<f32> {
    match material.alpha_mode {
        AlphaMode::Opaque => None,
        AlphaMode::Mask { cutoff } => Some(cutoff),
        AlphaMode::Blend => Some(0.5),
    }
}

/// How rays interpret [`AlphaMode::Blend`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blend {
    /// As a mask with a cutoff of 0.5, for streams with binary visibility.
    #[default]
    Masked,
    /// Stochastic alpha, for path tracing: a hit is accepted with a probability of alpha, sampled
    /// anew for each ray. Spheres, which have no texture coordinates to seed the sample with, are
    /// masked.
    Stochastic,
}

/// Class of each mesh of the scene, from the range of alpha that its material and vertices can
/// reach; a mesh whose material changes between classes is tested.
pub fn alpha_classes(scene: &Scene, motion: &Motion, blend: Blend) -> Vec<AlphaClass> {
    // range of alpha of each texture, computed once and only where an alpha mode needs it
    let mut ranges: Vec<Option<(f32, f32)>> = vec![None; scene.textures.len()];
    let class = |mesh: &Mesh| {
        let mut classes = motion.states(scene, mesh.material).map(|m| alpha_class(scene, mesh, m, blend, &mut ranges));
        let first = classes.next().unwrap_or(AlphaClass::Opaque);
        if classes.all(|class| class == first) { first } else { AlphaClass::Tested }
    };
    scene.meshes.iter().map(class).collect()
}

/// Class of a mesh with this material. `ranges`: alpha of textures, as far as it is known.
fn alpha_class(
    scene: &Scene,
    mesh: &Mesh,
    material: &Material,
    blend: Blend,
    ranges: &mut [Option<(f32, f32)>],
) -> AlphaClass {
    let Some(cutoff) = alpha_cutoff(material) else { return AlphaClass::Opaque };

    // the range that alpha has on the mesh: the factor by texture and vertex colours
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

    // stochastic alpha is opaque from 1 on, and absent at 0
    let covered = blend == Blend::Stochastic && material.alpha_mode == AlphaMode::Blend;
    if covered && matches!(mesh.geometry, Geometry::Triangles(_)) {
        return match (lo >= 1.0 - margin, hi <= 0.0) {
            (true, _) => AlphaClass::Opaque,
            (_, true) => AlphaClass::Absent,
            _ => AlphaClass::Tested,
        };
    }

    // a mask compares with the cutoff
    if lo >= cutoff + margin || cutoff <= 0.0 {
        AlphaClass::Opaque
    } else if hi < cutoff - margin {
        AlphaClass::Absent
    } else if matches!(mesh.geometry, Geometry::Spheres(_)) {
        // spheres have no texture coordinates: their alpha is constant
        if lo >= cutoff { AlphaClass::Opaque } else { AlphaClass::Absent }
    } else if lo == hi && lo >= cutoff {
        AlphaClass::Opaque
    } else {
        AlphaClass::Tested
    }
}

fn alpha_range(texels: &TexelData) -> (f32, f32) {
    texels.iter().fold((f32::INFINITY, 0.0), |(lo, hi), [_, _, _, alpha]| (alpha.min(lo), alpha.max(hi)))
}

/// Features that a scene uses: the specialization of its shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneFeatures {
    /// Some triangles need an alpha test.
    pub alpha: bool,
    /// Some of them have stochastic alpha ([`Blend::Stochastic`]).
    pub stochastic_alpha: bool,
    /// Some textures have more than 8 bits a channel.
    pub deep_texels: bool,
    /// Some mesh has more than two sets of texture coordinates.
    pub many_texcoords: bool,
    /// The scene has analytic spheres.
    pub spheres: bool,
    /// A single TLAS instance with an identity transform: the top level is skipped.
    pub single_level: bool,
    /// Shading features that the materials require; `None` for tracers that do not shade.
    pub shading: Option<ShadingFeatures>,
}

impl SceneFeatures {
    /// Finds the features of a flattened scene.
    pub fn from_flat(flat: &FlatScene) -> Self {
        Self {
            alpha: flat.has_alpha(),
            stochastic_alpha: flat.has_stochastic_alpha(),
            deep_texels: flat.scene.textures.iter().any(|t| !matches!(t.texels, TexelData::Unorm8(_))),
            many_texcoords: flat
                .scene
                .meshes
                .iter()
                .any(|m| matches!(&m.geometry, Geometry::Triangles(t) if !t.more_texcoords.is_empty())),
            spheres: flat.has_spheres(),
            single_level: flat.is_single_level(),
            shading: None,
        }
    }

    /// Describes, a line each, which features are specialized out.
    pub fn explain(&self, flat: &FlatScene) -> Vec<String> {
        let mut lines = Vec::new();
        if !self.alpha {
            lines.push(
                "no alpha test: no primitive is partly transparent; geometry is opaque, any-hit code is not compiled"
                    .to_owned(),
            );
        } else {
            let (all, opaque) =
                flat.groups.iter().fold((0, 0), |(a, o), g| (a + g.primitive_count, o + g.opaque_count));
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
            lines.push(format!(
                "two levels: {} bottom-level structures, {} instances in the top level",
                flat.groups.len(),
                flat.instances.len()
            ));
        }
        if flat.absent_primitives > 0 {
            lines.push(format!("dropped {} fully transparent primitives", flat.absent_primitives));
        }
        lines
    }
}
