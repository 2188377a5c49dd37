//! MTL materials to the scene's.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{Vec3, Vec4};

use super::mtl::{self, Map, MtlMaterial};
use crate::error::{Error, Result};
use crate::scene::load::find;
use crate::scene::load::picture::{self, DecodedImage};
use crate::scene::load::{ImagesDecoded, LoadOptions};
use crate::scene::material::{AlphaMode, Material, MaterialKind, TextureSlot, Transmission};
use crate::scene::{Filter, LoadReport, Scene, TexelData, Texture, Wrap};

/// What faces without a (known) material look like: matte, a little darker than white.
pub(super) fn grey(name: String) -> Material {
    Material { name, base_color: Vec4::new(0.8, 0.8, 0.8, 1.0), ..Material::default() }
}

/// The materials of all libraries of a file, by name.
pub(super) struct MaterialLibrary<'a> {
    options: LoadOptions<'a>,
    /// Indices into [`Scene::materials`].
    pub index: HashMap<String, usize>,
    pictures: HashMap<PathBuf, Option<DecodedImage>>,
    textures: HashMap<(PathBuf, Option<PathBuf>, bool), usize>,
}

impl<'a> MaterialLibrary<'a> {
    /// No material yet.
    pub(super) fn new(options: LoadOptions<'a>) -> Self {
        Self { options, index: HashMap::new(), pictures: HashMap::new(), textures: HashMap::new() }
    }

    /// Reads the library `mtl` of the model `obj` and appends its materials and textures to `scene`.
    pub(super) fn read(&mut self, mtl: &Path, obj: &Path, scene: &mut Scene) -> Result<()> {
        let bytes = std::fs::read(mtl).map_err(|e| Error::read(mtl, &e))?;
        let file = mtl.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let warnings = &mut scene.report.warnings;
        for parsed in mtl::parse(&String::from_utf8_lossy(&bytes), &mut |w| warnings.push(format!("{file}, {w}"))) {
            let material = self.convert(&parsed, [mtl, obj], scene);
            self.index.insert(parsed.name, scene.materials.len());
            scene.materials.push(material);
        }
        Ok(())
    }

    fn convert(&mut self, m: &MtlMaterial, beside: [&Path; 2], scene: &mut Scene) -> Material {
        let diffuse = m.diffuse.unwrap_or(Vec3::splat(0.8));
        let specular = m.specular.unwrap_or(Vec3::ZERO);
        let filter = m.transmission_filter.unwrap_or(Vec3::ONE);
        let kind = kind(m, diffuse, specular);
        let mut out = Material {
            name: m.name.clone(),
            kind,
            base_color: diffuse.extend(1.0),
            metallic: m.metallic.unwrap_or(0.0).clamp(0.0, 1.0),
            roughness: m.roughness.unwrap_or_else(|| roughness(m.shininess, specular)).clamp(0.0, 1.0),
            emissive: m.emissive.unwrap_or(Vec3::ZERO),
            ior: m.ior.filter(|&i| i >= 1.0).unwrap_or(1.5),
            specular_color: specular,
            double_sided: true,
            parameters: m.parameters.clone(),
            ..Material::default()
        };
        if kind == MaterialKind::Glass {
            out.transmittance = filter;
            out.transmission = Transmission { factor: 1.0, ..Default::default() };
        }
        let map = |lib: &mut Self, map: &Option<Map>, alpha: &Option<Map>, scene: &mut Scene| {
            (map.is_some() || alpha.is_some()).then(|| lib.slot(map.as_ref(), alpha.as_ref(), beside, scene)).flatten()
        };
        out.base_color_texture = map(self, &m.map_diffuse, &m.map_dissolve, scene);
        out.emissive_texture = map(self, &m.map_emissive, &None, scene);
        out.normal_texture = map(self, &m.map_normal, &None, scene);
        out.normal_scale = m.map_normal.as_ref().map_or(1.0, |n| n.multiplier);
        if m.map_dissolve.is_some() && out.base_color_texture.is_some() {
            out.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        }
        // Kd is often left black where map_Kd says it all
        if m.map_diffuse.is_some() && out.base_color_texture.is_some() && diffuse == Vec3::ZERO {
            out.base_color = Vec4::ONE;
        }
        out
    }

    /// The texture of `color`, with its alpha from `alpha`. `None`, with a warning, if it cannot be read.
    fn slot(&mut self, color: Option<&Map>, alpha: Option<&Map>, beside: [&Path; 2], scene: &mut Scene) -> Option<TextureSlot> {
        let options = color.or(alpha)?;
        let mut get = |map: Option<&Map>| map.and_then(|m| self.picture(m, beside, &mut scene.report));
        let (color, alpha) = (get(color), get(alpha));
        let path = color.as_ref().or(alpha.as_ref())?.0.clone();
        let key = (path.clone(), alpha.as_ref().map(|a| a.0.clone()), options.clamp);
        if let Some(&texture) = self.textures.get(&key) {
            return Some(TextureSlot { texture, texcoord: 0, transform: options.transform });
        }
        let picture = match (color, alpha) {
            (Some((same, p)), Some((also, a))) if same == also && has_alpha(&a) => p,
            (color, Some((_, alpha))) => with_alpha(color.map(|c| c.1), &alpha),
            // alpha of a diffuse map means nothing in MTL
            (color, None) => color?.1,
        };
        let wrap = [if options.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let DecodedImage { width, height, texels } = picture;
        let texture = scene.textures.len();
        scene.textures.push(Texture { name, width, height, texels, wrap, filter: Filter::Linear });
        self.textures.insert(key, texture);
        Some(TextureSlot { texture, texcoord: 0, transform: options.transform })
    }

    fn picture(&mut self, map: &Map, beside: [&Path; 2], report: &mut LoadReport) -> Option<(PathBuf, DecodedImage)> {
        let warnings = &mut report.warnings;
        let path = match find::find(&map.file, &beside) {
            Ok(path) => path,
            Err(searched) => {
                let text = format!("the texture {} was not found in {}", map.file, find::list(&searched));
                if !warnings.contains(&text) {
                    warnings.push(text);
                }
                return None;
            }
        };
        let (options, done) = (self.options, self.pictures.len() + 1);
        let picture = self.pictures.entry(path.clone()).or_insert_with(|| {
            report.files.push(path.clone());
            if !options.textures {
                report.skipped_images += 1;
                return None;
            }
            let bytes = std::fs::read(&path).map_err(|e| Error::read(&path, &e).to_string());
            let name = path.to_string_lossy();
            let decoded = bytes.and_then(|b| picture::decode(&b, &name).map_err(|e| format!("{name} {e}")));
            (options.progress)(ImagesDecoded { done, of: None });
            decoded.map_err(|e| warnings.push(format!("{e}: shown without it"))).ok()
        });
        picture.clone().map(|p| (path, p))
    }
}

/// MTL says in several ways, none of them binding, that a material is glass or a mirror.
///
/// `d` is how opaque it is; `Tr` should be 1 - d but is also found as a copy of d, so it only counts where `d` is absent,
/// and 1, which would make the thing vanish, does not count at all. With a `map_d` the texture decides instead.
fn kind(m: &MtlMaterial, diffuse: Vec3, specular: Vec3) -> MaterialKind {
    let opacity = m.dissolve.or(m.transparency.filter(|&t| t < 1.0).map(|t| 1.0 - t)).unwrap_or(1.0);
    let dark = diffuse.max_element() <= 0.05 && m.map_diffuse.is_none();
    match m.illum {
        _ if m.map_dissolve.is_some() => MaterialKind::MetallicRoughness,
        Some(4 | 6 | 7 | 9) => MaterialKind::Glass,
        _ if opacity < 1.0 => MaterialKind::Glass,
        Some(3 | 5 | 8) if dark && specular.max_element() > 0.0 => MaterialKind::Mirror,
        _ => MaterialKind::MetallicRoughness,
    }
}

/// Perceptual roughness of a Blinn-Phong exponent (alpha^2 = 2 / (n + 2), roughness = sqrt(alpha)).
fn roughness(shininess: Option<f32>, specular: Vec3) -> f32 {
    match shininess {
        Some(n) if specular.max_element() > 0.0 => (2.0 / (n.max(0.0) + 2.0)).powf(0.25),
        _ => 1.0,
    }
}

fn has_alpha(picture: &DecodedImage) -> bool {
    picture.texels.iter().any(|[_, _, _, alpha]| alpha < 1.0)
}

/// `color` (or white) with the alpha of `alpha`, or its red where it is opaque; the size is that of the larger one.
fn with_alpha(color: Option<DecodedImage>, alpha: &DecodedImage) -> DecodedImage {
    let channel = if has_alpha(alpha) { 3 } else { 0 };
    let color = color.unwrap_or_else(|| DecodedImage { width: 1, height: 1, texels: vec![255u8; 4].into() });
    let (width, height) = (color.width.max(alpha.width), color.height.max(alpha.height));
    let texel = |p: &DecodedImage, x: u32, y: u32| {
        let x = u64::from(x) * u64::from(p.width) / u64::from(width);
        let y = u64::from(y) * u64::from(p.height) / u64::from(height);
        p.texels.get((y * u64::from(p.width) + x) as usize)
    };
    let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| {
        let [r, g, b, _] = texel(&color, x, y);
        [r, g, b, texel(alpha, x, y)[channel]]
    });
    let texels = match (&color.texels, &alpha.texels) {
        (TexelData::Float(_), _) => all.collect::<Vec<f32>>().into(),
        (TexelData::Unorm8(_), TexelData::Unorm8(_)) => all.map(|v| (v * 255.0).round() as u8).collect::<Vec<u8>>().into(),
        _ => all.map(|v| (v * 65535.0).round() as u16).collect::<Vec<u16>>().into(),
    };
    DecodedImage { width, height, texels }
}
