//! Triangles whose radiance a texture says. Each is sampled as many lights, its *parts*, so that
//! samples go where the picture is bright: the light tree chooses among parts as among other
//! lights, and shaders find the part that a ray hits by its barycentrics (`part_at` of
//! shaders/lights/triangle.glsl).

use glam::{DVec2, Vec3};

use super::brightness;
use crate::interface::records::lights::{LIGHT_COLUMN_AT, LIGHT_ROW_AT, LIGHT_SIDE_AT, LIGHT_TURNED};
use crate::scene::{Geometry, Mesh, Scene, Texture, TextureSlot, TriangleMesh};

/// Most parts along an edge of a triangle. Its number has five bits.
const MAX_SIDE: u32 = 16;
/// Most parts of all triangles of a scene, where each has four and more.
const MAX_PARTS: usize = 4096;
/// Points along an edge of a part at which the texture is looked up; an estimate suffices.
const POINTS: u32 = 4;
/// Radiance that a part counts with at least, as a fraction of its triangle's mean: interpolation
/// of texels may bring light to where the points are dark.
const LEAST: f64 = 0.05;
/// A triangle stays whole where its parts differ by less from their mean, as a fraction of it (root
/// mean square).
const EVEN: f64 = 0.2;

/// A part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    /// Barycentrics of its corner in the triangle.
    pub corner: DVec2,
    /// Length of its edges, as a fraction of those of the triangle; negative: it is turned around.
    pub scale: f64,
    /// Bits of it in [`LightRecord::flags`](crate::interface::records::lights::LightRecord::flags).
    pub flags: u32,
    /// Brightness of its mean radiance ([`brightness`]).
    pub brightness: f64,
}

impl Part {
    /// Barycentrics in the triangle of a point of the part. `in_whole` of
    /// shaders/lights/triangle.glsl.
    fn in_whole(&self, at: DVec2) -> DVec2 {
        self.corner + self.scale * at
    }
}

/// Number of triangles at rest whose radiance a texture says. `moves`: for each instance, it moves
/// or deforms.
pub(super) fn count_triangles(scene: &Scene, moves: &[bool]) -> usize {
    let has_picture = |mesh: &Mesh| {
        let material = &scene.materials[mesh.material];
        material.emissive != Vec3::ZERO && material.emissive_texture.is_some()
    };
    let at_rest = scene.instances.iter().zip(moves).filter(|(_, moves)| !**moves).map(|(i, _)| &scene.meshes[i.mesh]);
    let triangles = |mesh: &Mesh| if let Geometry::Triangles(t) = &mesh.geometry { t.indices.len() } else { 0 };
    at_rest.filter(|mesh| has_picture(mesh)).map(triangles).sum()
}

/// Parts along an edge of each triangle of a scene that has so many with a picture.
pub(super) fn side(triangles: usize) -> u32 {
    let fits = |side: &u32| triangles.saturating_mul((side * side) as usize) <= MAX_PARTS;
    [MAX_SIDE, 8, 4, 2].into_iter().find(fits).unwrap_or(1)
}

/// The parts of a triangle with `side` of them along each edge, in the order of their numbers: rows
/// along the second edge, in each the parts of its cells, a turned one after one that lies as the
/// triangle does.
fn grid(side: u32) -> impl Iterator<Item = Part> {
    let scale = 1.0 / f64::from(side);
    let cells = (0..side).flat_map(move |row| (0..side - row).map(move |column| (row, column)));
    cells.flat_map(move |(row, column)| {
        let corner = DVec2::new(f64::from(row), f64::from(column)) * scale;
        let flags = side << LIGHT_SIDE_AT | row << LIGHT_ROW_AT | column << LIGHT_COLUMN_AT;
        let upright = Part { corner, scale, flags, brightness: 0.0 };
        let turned = Part { corner: corner + scale, scale: -scale, flags: flags | LIGHT_TURNED, brightness: 0.0 };
        [Some(upright), (row + column + 1 < side).then_some(turned)].into_iter().flatten()
    })
}

/// The picture that a texture shows on the triangles of a mesh.
pub(super) struct Picture<'s> {
    mesh: &'s TriangleMesh,
    texture: &'s Texture,
    slot: TextureSlot,
    /// Radiance where the texture is white, linear RGB.
    emissive: Vec3,
}

impl<'s> Picture<'s> {
    /// The picture that the texture of `slot` shows on `mesh`. `emissive`: radiance where it is
    /// white, linear RGB.
    pub fn new(scene: &'s Scene, mesh: &'s TriangleMesh, slot: TextureSlot, emissive: Vec3) -> Self {
        Self { mesh, texture: &scene.textures[slot.texture], slot, emissive }
    }

    /// The parts of each triangle ([`Picture::parts`]).
    pub fn all_parts(&self, side: u32, whole: f64) -> Vec<Vec<Part>> {
        (0..self.mesh.indices.len()).map(|k| self.parts(k, side, whole)).collect()
    }

    /// The parts of a triangle, or none if it had better be sampled as a whole. `whole`: brightness
    /// of the mean radiance of all triangles.
    fn parts(&self, triangle: usize, side: u32, whole: f64) -> Vec<Part> {
        let coordinates = Some(self.mesh.texcoord_set(self.slot.texcoord)).filter(|c| !c.is_empty());
        let Some(coordinates) = coordinates.filter(|_| side > 1 && !self.texture.texels.is_empty()) else {
            return Vec::new();
        };
        let [a, b, c] =
            self.mesh.indices[triangle].map(|k| self.slot.transform.transform_point2(coordinates[k as usize]));
        let mut parts: Vec<Part> = grid(side).collect();
        for part in &mut parts {
            let mut sum = Vec3::ZERO;
            // the middles of the part's own parts
            let points = grid(POINTS).map(|p| p.in_whole(DVec2::splat(1.0 / 3.0)));
            for at in points {
                let at = part.in_whole(at).as_vec2();
                sum += self.texture.look_up_srgb(a + at.x * (b - a) + at.y * (c - a)).truncate();
            }
            part.brightness = brightness(self.emissive * sum / (POINTS * POINTS) as f32);
        }

        // a triangle that is dark, or all of which is alike, needs no parts
        let count = parts.len() as f64;
        let mean = parts.iter().map(|p| p.brightness).sum::<f64>() / count;
        if mean == 0.0 {
            return grid(1).map(|part| Part { brightness: LEAST * LEAST * whole, ..part }).collect();
        }
        let deviation = (parts.iter().map(|p| (p.brightness - mean).powi(2)).sum::<f64>() / count).sqrt();
        if deviation < EVEN * mean {
            return Vec::new();
        }
        let least = LEAST * mean.max(LEAST * whole);
        parts.iter_mut().for_each(|p| p.brightness = p.brightness.max(least));
        parts
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::scene::{Filter, Wrap};

    /// The number of the part that has a point, as shaders compute it.
    fn part_at(side: u32, b: Vec2) -> usize {
        let s = b * side as f32;
        let row = (s.x as u32).min(side - 1);
        let column = (s.y as u32).min(side - 1 - row);
        let turned = s.x - row as f32 + s.y - column as f32 > 1.0 && row + column + 1 < side;
        (side * side - (side - row) * (side - row) + 2 * column + u32::from(turned)) as usize
    }

    #[test]
    fn parts_are_found_by_their_points() {
        for side in [1, 2, 4, 8, 16] {
            let parts: Vec<Part> = grid(side).collect();
            assert_eq!(parts.len(), (side * side) as usize);
            for (k, part) in parts.iter().enumerate() {
                for at in [[0.2, 0.2], [0.7, 0.1], [0.1, 0.7], [0.34, 0.33]] {
                    let at = part.in_whole(DVec2::from(at)).as_vec2();
                    assert!(at.min_element() > 0.0 && at.x + at.y < 1.0, "{side}, {k}: {at}");
                    assert_eq!(part_at(side, at), k, "{side}: {at}");
                }
            }
        }
        assert_eq!([1, 2, 16, 17, 64, 65, 1024, 1025].map(side), [16, 16, 16, 8, 8, 4, 2, 1]);
    }

    /// One bright texel of a square of 4x4: its parts are bright, the others have little.
    #[test]
    fn parts_are_as_bright_as_the_picture() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![[0, 1, 2]],
            texcoords: [vec![Vec2::ZERO, Vec2::X, Vec2::Y], Vec::new()],
            ..TriangleMesh::default()
        };
        let mut rgba = vec![0u8; 64];
        // column 1, row 0
        rgba[4..8].fill(255);
        let texture = |rgba: Vec<u8>| Texture {
            name: String::new(),
            width: 4,
            height: 4,
            texels: rgba.into(),
            wrap: [Wrap::Clamp; 2],
            filter: Filter::Nearest,
        };
        let slot = TextureSlot { texture: 0, texcoord: 0, transform: glam::Affine2::IDENTITY };
        let (dark, white) = (texture(rgba), texture(vec![255; 64]));
        let of = |texture| Picture { mesh: &mesh, texture, slot, emissive: Vec3::splat(3.0) };
        let parts = of(&dark).parts(0, 4, 1.0);
        let bright: Vec<usize> = (0..parts.len()).filter(|&k| parts[k].brightness > 2.9).collect();
        // the cell of that texel: its two parts, in the second row
        assert_eq!(bright, [7, 8]);
        let mean = 3.0 / 8.0;
        assert!(
            parts.iter().enumerate().all(|(k, p)| bright.contains(&k) || (p.brightness - LEAST * mean).abs() < 1e-9)
        );
        assert!(of(&white).parts(0, 4, 1.0).is_empty() && of(&dark).parts(0, 1, 1.0).is_empty());
    }
}
