//! Occlusion, roughness and metalness in one texture: red, green and blue, as glTF lets materials
//! share it.

use glam::{Affine2, Vec2, Vec3};
use image::ExtendedColorType;

use super::map::BakedMap;
use super::picture;
use super::plan::PlannedTexture;
use crate::error::Result;
use crate::scene::{Material, Scene, Texture};

/// The texture of roughness and metalness that a baked one can share, or why there is none, in
/// words.
pub fn partner<'s>(scene: &'s Scene, texture: &PlannedTexture) -> Result<&'s Texture, String> {
    let mesh = &scene.meshes[texture.surfaces[0].mesh];
    let material: &Material = &scene.materials[mesh.material];
    let name = &texture.name;
    let slot = material
        .metallic_roughness_texture
        .ok_or_else(|| format!("material `{name}` has no texture of roughness and metalness: nothing is packed"))?;
    let set = mesh.source.as_ref().and_then(|source| source.texcoord_sets.get(slot.texcoord).copied());
    if !texture.unwrapped.is_empty() || set != Some(texture.texcoord) || slot.transform != Affine2::IDENTITY {
        return Err(format!("material `{name}`: its roughness lies by other texture coordinates, and is not packed"));
    }
    Ok(&scene.textures[slot.texture])
}

/// A PNG file with the map in red, and green and blue of the partner, as large as the larger of
/// both.
///
/// # Errors
/// Those of the encoder.
pub fn png(map: &BakedMap, partner: &Texture) -> Result<Vec<u8>> {
    let size = [map.size[0].max(partner.width), map.size[1].max(partner.height)];
    let occlusion = |at: usize| map.values[at];
    let other = |at: usize| {
        let [r, g, b, _] = partner.texels.get(at);
        Vec3::new(r, g, b)
    };
    let mut bytes = Vec::with_capacity(3 * size[0] as usize * size[1] as usize);
    for y in 0..size[1] {
        for x in 0..size[0] {
            let uv = (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(size[0] as f32, size[1] as f32);
            let red = bilinear(map.size, uv, occlusion).x;
            let packed = bilinear([partner.width, partner.height], uv, other);
            bytes.extend([red, packed.y, packed.z].map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8));
        }
    }
    picture::encode(&bytes, size, ExtendedColorType::Rgb8)
}

/// The value at a point of an image, whose borders repeat.
fn bilinear([width, height]: [u32; 2], uv: Vec2, texel: impl Fn(usize) -> Vec3) -> Vec3 {
    let at = uv * Vec2::new(width as f32, height as f32) - 0.5;
    let (corner, part) = (at.floor(), at - at.floor());
    let value = |dx: i64, dy: i64| {
        let x = (corner.x as i64 + dx).rem_euclid(width.into());
        let y = (corner.y as i64 + dy).rem_euclid(height.into());
        texel((y * i64::from(width) + x) as usize)
    };
    let row = |dy| value(0, dy).lerp(value(1, dy), part.x);
    row(0).lerp(row(1), part.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stay_in_their_channels() {
        let map = BakedMap {
            size: [2, 1],
            values: vec![Vec3::X * 0.2, Vec3::X * 0.6],
            covered: vec![true; 2],
            ..BakedMap::default()
        };
        let texels: Vec<u8> = (0..8).flat_map(|k| [9, 10 * k, 100, 255]).collect();
        let partner = Texture {
            name: String::new(),
            width: 4,
            height: 2,
            texels: texels.into(),
            wrap: Default::default(),
            filter: Default::default(),
        };
        let packed = image::load_from_memory(&png(&map, &partner).unwrap()).unwrap().into_rgb8();
        assert_eq!(packed.dimensions(), (4, 2));
        for (k, pixel) in packed.pixels().enumerate() {
            assert_eq!((pixel[1], pixel[2]), (10 * k as u8, 100));
        }
        // the occlusion is interpolated over the larger texture
        assert!(packed.pixels().all(|p| (51..=153).contains(&p[0])));
        assert_eq!(packed.get_pixel(1, 0)[0], 77);
    }
}
