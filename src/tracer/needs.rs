//! The parts of a scene that passes require in device memory.

/// The parts of a scene that the passes require; the rest is not uploaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Shading normals.
    pub normals: bool,
    /// Base colours of all surfaces, not only of alpha-tested ones.
    pub albedo: bool,
    /// Materials and emission, for path tracing. Implies `normals`, and `albedo` unless `white`.
    pub shading: bool,
    /// With `shading`: white-furnace mode, in which every surface has one constant albedo and no
    /// other material data.
    pub white: bool,
    /// With `shading`: compensation for energy lost to multiple scattering between microfacets.
    pub compensation: bool,
    /// With `shading`: baked occlusion textures, for the AOV of that name.
    pub baked_occlusion: bool,
    /// With `shading`: mip levels of textures, for ray cones
    /// ([`crate::integrators::path::TextureFilter::RayCone`]).
    pub mip_levels: bool,
}

impl Needs {
    /// The parts that both need together.
    pub fn union(self, other: Self) -> Self {
        let Self { normals, albedo, shading, white, compensation, baked_occlusion, mip_levels } = other;
        Self {
            normals: self.normals || normals,
            albedo: self.albedo || albedo,
            shading: self.shading || shading,
            white: self.white || white,
            compensation: self.compensation || compensation,
            baked_occlusion: self.baked_occlusion || baked_occlusion,
            mip_levels: self.mip_levels || mip_levels,
        }
    }

    /// Returns true if one scene can serve both: materials look the same to both, if both need
    /// them.
    pub fn is_compatible(self, other: Self) -> bool {
        let materials = |n: Self| (n.white, n.compensation, n.mip_levels, n.baked_occlusion);
        !self.shading || !other.shading || materials(self) == materials(other)
    }

    /// Returns true if nothing of `other` is missing.
    pub fn covers(self, other: Self) -> bool {
        self.union(other) == self
    }
}
