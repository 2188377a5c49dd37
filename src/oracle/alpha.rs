//! Alpha of a surface, as the shaders compute it: base colour alpha x texture alpha x vertex colour
//! alpha, against a cutoff.

use crate::scene::{AlphaMode, Filter, Geometry, Mesh, Scene, TexelData, Texture, Wrap};
use glam::{Affine2, DVec2, Vec2};

/// Alpha cutoff of BLEND materials in occlusion and visibility.
pub const BLEND_CUTOFF: f32 = 0.5;

/// The alpha test of one mesh.
#[derive(Clone, Debug)]
pub struct AlphaTest {
    cutoff: f64,
    base: f64,
    texture: Option<(Texture, Affine2)>,
    indices: Vec<[u32; 3]>,
    /// Texture coordinates; empty without a texture.
    texcoords: Vec<Vec2>,
    /// Alpha of the vertex colours; empty without them.
    vertex_alpha: Vec<f32>,
}

/// Uncertainty of an alpha lookup.
#[derive(Clone, Copy, Debug, Default)]
pub struct AlphaUncertainty {
    /// Error of the barycentric weights of the three corners.
    pub barycentric: [f64; 3],
    /// Error of the texture unit in texels, besides that of the coordinates themselves.
    pub texels: f64,
    /// Error of the interpolated value.
    pub value: f64,
}

impl AlphaTest {
    /// The alpha test of `mesh`; `None` for opaque materials.
    pub fn new(scene: &Scene, mesh: &Mesh) -> Option<Self> {
        let material = scene.materials.get(mesh.material)?;
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque => return None,
            AlphaMode::Mask { cutoff } => cutoff,
            AlphaMode::Blend => BLEND_CUTOFF,
        };
        let mut test = Self {
            cutoff: cutoff as f64,
            base: material.base_color.w as f64,
            texture: None,
            indices: Vec::new(),
            texcoords: Vec::new(),
            vertex_alpha: Vec::new(),
        };
        // spheres have neither texture coordinates nor vertex colours
        if let Geometry::Triangles(t) = &mesh.geometry {
            if let Some(slot) = material.base_color_texture {
                test.texture = scene.textures.get(slot.texture).map(|x| (x.clone(), slot.transform));
                test.texcoords = t.texcoord_set(slot.texcoord).to_vec();
            }
            test.vertex_alpha = t.colors.iter().map(|c| c.w).collect();
            test.indices = t.indices.clone();
        }
        Some(test)
    }

    /// Is the surface opaque at this point of the triangle? `barycentrics` weigh the second and
    /// third corner.
    pub fn is_present(&self, primitive: u32, barycentrics: [f64; 2]) -> bool {
        self.alpha(primitive, barycentrics) >= self.cutoff
    }

    /// Alpha at this point of the triangle. Missing texture coordinates are (0, 0), missing vertex
    /// colours opaque.
    pub fn alpha(&self, primitive: u32, barycentrics: [f64; 2]) -> f64 {
        let (vertex, uv) = self.interpolate(primitive, barycentrics);
        let texture = self.texture.as_ref().map_or(1.0, |(t, _)| texture_alpha(t, texels(t, uv)));
        self.base * vertex * texture
    }

    /// Result of the test within the uncertainty: `(opaque everywhere, opaque somewhere)`.
    pub fn presence(&self, primitive: u32, barycentrics: [f64; 2], error: &AlphaUncertainty) -> (bool, bool) {
        let (vertex, uv) = self.interpolate(primitive, barycentrics);
        let corners = self.indices.get(primitive as usize).copied().unwrap_or_default();
        let (mut lo, mut hi) = (1.0f64, 1.0f64);
        if let Some((texture, transform)) = &self.texture {
            let size = DVec2::new(texture.width as f64, texture.height as f64);
            // coordinates are f32: a few roundings of their own size, and the weights' errors times
            // the corners' differences
            let at = |k: usize| transform.transform_point2(self.texcoord(corners[k])).as_dvec2();
            let mut reach = uv.abs() * 8.0 * f32::EPSILON as f64;
            for (k, e) in error.barycentric.iter().enumerate() {
                reach += (at(k) - uv).abs() * *e;
            }
            let reach = reach * size + error.texels;
            let center = texels(texture, uv);
            (lo, hi) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..9 {
                let offset = reach * DVec2::new((k % 3) as f64 - 1.0, (k / 3) as f64 - 1.0);
                let value = texture_alpha(texture, center + offset);
                (lo, hi) = (lo.min(value), hi.max(value));
            }
        }
        let weights: f64 = error.barycentric.iter().sum();
        let scale = self.base * vertex;
        let slack = error.value + weights * self.base;
        (scale * lo - slack >= self.cutoff, scale * hi + slack >= self.cutoff)
    }

    fn texcoord(&self, corner: u32) -> Vec2 {
        self.texcoords.get(corner as usize).copied().unwrap_or_default()
    }

    /// Vertex alpha and transformed texture coordinates.
    fn interpolate(&self, primitive: u32, [v, w]: [f64; 2]) -> (f64, DVec2) {
        let corners = self.indices.get(primitive as usize).copied().unwrap_or_default();
        let weights = [1.0 - v - w, v, w];
        let mut uv = DVec2::ZERO;
        let mut vertex = 0.0;
        for (corner, weight) in corners.into_iter().zip(weights) {
            uv += self.texcoord(corner).as_dvec2() * weight;
            vertex += self.vertex_alpha.get(corner as usize).copied().unwrap_or(1.0) as f64 * weight;
        }
        let transform = self.texture.as_ref().map_or(Affine2::IDENTITY, |(_, t)| *t);
        let m = transform.matrix2.as_dmat2();
        (vertex, m * uv + transform.translation.as_dvec2())
    }
}

/// Texture coordinates in texels; texel centres lie at halves.
fn texels(texture: &Texture, uv: DVec2) -> DVec2 {
    uv * DVec2::new(texture.width as f64, texture.height as f64)
}

/// Alpha in 0 to 1 at a point given in texels.
pub fn texture_alpha(texture: &Texture, at: DVec2) -> f64 {
    let fetch = |x: f64, y: f64| {
        let (x, y) = (wrap(x, texture.width, texture.wrap[0]), wrap(y, texture.height, texture.wrap[1]));
        let index = 4 * (y as usize * texture.width as usize + x as usize) + 3;
        let alpha = match &texture.texels {
            TexelData::Unorm8(rgba) => rgba.get(index).map(|a| f64::from(*a) / 255.0),
            TexelData::Unorm16(rgba) => rgba.get(index).map(|a| f64::from(*a) / 65535.0),
            TexelData::Float(rgba) => rgba.get(index).map(|a| f64::from(*a)),
        };
        alpha.unwrap_or(1.0)
    };
    match texture.filter {
        Filter::Nearest => fetch(at.x.floor(), at.y.floor()),
        Filter::Linear => {
            let corner = (at - 0.5).floor();
            let f = at - 0.5 - corner;
            let row = |y: f64| fetch(corner.x, y) * (1.0 - f.x) + fetch(corner.x + 1.0, y) * f.x;
            row(corner.y) * (1.0 - f.y) + row(corner.y + 1.0) * f.y
        }
    }
}

/// The texel that stands for index `i` outside the image.
fn wrap(i: f64, n: u32, mode: Wrap) -> u32 {
    // the cast saturates; NaN becomes 0
    let (i, n) = (i as i64, n.max(1) as i64);
    let inside = match mode {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let m = i.rem_euclid(2 * n);
            if m < n { m } else { 2 * n - 1 - m }
        }
    };
    inside as u32
}
