//! MTL materials to the scene's.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{Vec3, Vec4};

use super::mtl::{self, MtlMaterial, unused};
use super::texture::{Textures, is_cut_out, is_normal_map, roughness};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::scene::load::options::Loading;
use crate::scene::load::text::{self, unquoted, without_comment};
use crate::scene::material::{AlphaMode, Material, MaterialKind};
use crate::scene::settings::MtlDissolve;

/// Roughness of fibres: MTL has a number for how much sheen there is, and none for this.
const SHEEN_ROUGHNESS: f32 = 0.5;

/// Material of faces without a (known) one: matte, a little darker than white.
pub(super) fn grey(name: String) -> Material {
    Material { name, base_color: Vec4::new(0.8, 0.8, 0.8, 1.0), ..Material::default() }
}

/// The materials of all libraries of a file, by name.
pub(super) struct MaterialLibrary<'a> {
    /// Indices into [`Scene::materials`], by names as they are written.
    exact: HashMap<String, usize>,
    /// Index of each material by its [`loose`] name.
    loose: HashMap<String, usize>,
    textures: Textures<'a>,
}

/// A name without what exporters disagree on: comments, quotation marks, white space and the case
/// of letters.
fn loose(name: &str) -> String {
    unquoted(without_comment(name)).split_ascii_whitespace().collect::<Vec<_>>().join(" ").to_ascii_lowercase()
}

impl<'a> MaterialLibrary<'a> {
    /// No material yet.
    pub(super) fn new(loading: Loading<'a>) -> Self {
        Self { exact: HashMap::new(), loose: HashMap::new(), textures: Textures::new(loading) }
    }

    /// The file that the model `obj` refers to as one of `names`.
    ///
    /// # Errors
    /// The folders that were searched.
    pub(super) fn find(&mut self, names: &[&str], obj: &Path) -> Result<PathBuf, Vec<PathBuf>> {
        self.textures.finder.find(names, &[obj])
    }

    /// Fails if a name leads out of the folder that files have to lie below
    /// ([`LoadOptions::confine`]).
    ///
    /// # Errors
    /// [`Error::Input`].
    pub(super) fn check(&self, obj: &Path) -> Result<()> {
        self.textures.finder.check(obj)
    }

    /// The material that a model calls `name`: the one of just that name if there is one.
    pub(super) fn get(&self, name: &str) -> Option<usize> {
        let exact = text::uncommented(name).find_map(|name| self.exact.get(name));
        exact.or_else(|| self.loose.get(&loose(name))).copied()
    }

    /// Reads the library `mtl` of the model `obj` and appends its materials and textures to
    /// `scene`. What libraries before it have defined stays.
    pub(super) fn read(&mut self, mtl: &Path, obj: &Path, scene: &mut Scene) -> Result<()> {
        let bytes = crate::files::read_regular(mtl).map_err(|e| Error::read(mtl, &e))?;
        if let Some(message) = crate::files::placeholder(&bytes).filter(|_| !bytes.is_empty()) {
            return Err(Error::input(mtl, message));
        }
        let file = mtl.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let warnings = &mut scene.report.warnings;
        let mut parsed = mtl::parse(&text::decode(&bytes), &mut |w| warnings.push(format!("{file}, {w}")));
        if vanishes(&parsed) {
            warnings.push(format!("{file}: `d 0` or `Tr 1` would hide every material: they are shown as opaque"));
            parsed.iter_mut().for_each(|m| (m.dissolve, m.transparency) = (None, None));
        }
        self.textures.decode_ahead(parsed.iter().flat_map(MtlMaterial::colour_and_surface_maps), [mtl, obj]);

        // of two with one name in a file the last counts, in two files the first
        let mut own: HashMap<String, usize> = HashMap::new();
        for material in parsed {
            let converted = self.convert(&material, &file, [mtl, obj], scene);
            own.insert(material.name, scene.materials.len());
            scene.materials.push(converted);
        }
        let mut own: Vec<_> = own.into_iter().collect();
        own.sort_by_key(|(_, index)| *index);
        for (name, index) in own {
            self.loose.entry(loose(&name)).or_insert(index);
            self.exact.entry(name).or_insert(index);
        }
        Ok(())
    }

    /// `file`: the library's name in warnings.
    fn convert(&mut self, m: &MtlMaterial, file: &str, beside: [&Path; 2], scene: &mut Scene) -> Material {
        // numbers
        let diffuse = m.diffuse.unwrap_or(Vec3::splat(0.8));
        let specular = m.specular.unwrap_or(Vec3::ZERO);
        let kind = kind(m, diffuse, specular);
        let shines = specular.max_element() > 0.0 || m.map_specular.is_some();
        let of_exponent = || m.shininess.filter(|_| shines).map_or(1.0, roughness);
        let mut out = Material {
            name: text::shown(&m.name),
            kind,
            base_color: diffuse.extend(1.0),
            metallic: m.metallic.unwrap_or(0.0).clamp(0.0, 1.0),
            roughness: m.roughness.unwrap_or_else(of_exponent).clamp(0.0, 1.0),
            emissive: m.emissive.unwrap_or(Vec3::ZERO),
            ior: m.ior.filter(|&i| i >= 1.0).unwrap_or(1.5),
            specular_color: specular,
            double_sided: true,
            parameters: m.parameters.clone(),
            ..Material::default()
        };
        layers(&mut out);

        // textures; a factor is often left black where a map says it all
        out.base_color_texture = self.textures.color(m.map_diffuse.as_ref(), m.map_dissolve.as_ref(), beside, scene);
        out.emissive_texture = self.textures.color(m.map_emissive.as_ref(), None, beside, scene);
        if m.map_diffuse.is_some() && out.base_color_texture.is_some() && diffuse == Vec3::ZERO {
            out.base_color = Vec4::ONE;
        }
        if out.emissive_texture.is_some() && out.emissive == Vec3::ZERO {
            out.emissive = Vec3::ONE;
        }
        self.normal_map(&mut out, m, beside, scene);
        self.surface_maps(&mut out, m, file, beside, scene);
        self.layer_maps(&mut out, m, file, beside, scene);
        if let Some(ambient) = &m.map_ambient
            && m.map_diffuse.as_ref().is_none_or(|d| d.file != ambient.file)
        {
            scene.report.warnings.push(format!("{file}: {}", unused("map_Ka")));
        }

        // glass, or alpha: what dissolves is blended, and a map of holes is a mask
        let opacity = opacity(m);
        if kind == MaterialKind::Glass {
            out.transmittance = m.transmission_filter.unwrap_or(Vec3::ONE);
            out.transmission.factor = 1.0;
        } else if m.map_dissolve.is_some() {
            let texels = out.base_color_texture.map(|slot| &scene.textures[slot.texture].texels);
            out.base_color.w = opacity;
            out.alpha_mode = match texels {
                Some(texels) if opacity == 1.0 && is_cut_out(texels) => AlphaMode::Mask { cutoff: 0.5 },
                None if opacity == 1.0 => AlphaMode::Opaque,
                _ => AlphaMode::Blend,
            };
        } else if opacity < 1.0 && kind == MaterialKind::MetallicRoughness {
            out.mtl_dissolve = Some(opacity);
            out.transmittance = m.transmission_filter.unwrap_or(Vec3::ONE);
            MtlDissolve::Alpha.apply_to(&mut out);
        } else if opacity < 1.0 {
            (out.base_color.w, out.alpha_mode) = (opacity, AlphaMode::Blend);
        }
        out
    }

    /// The normal map: `norm`, or what is called a bump map and holds normals, as Blender writes
    /// it, or heights, as the format says.
    fn normal_map(&mut self, out: &mut Material, m: &MtlMaterial, beside: [&Path; 2], scene: &mut Scene) {
        let bump = m.map_bump.as_ref().filter(|_| m.map_normal.is_none());
        let holds_heights = bump.is_some_and(|bump| {
            let picture = self.textures.picture(bump, beside, &mut scene.report);
            picture.is_some_and(|picture| !is_normal_map(&picture.texels))
        });
        let Some(map) = m.map_normal.as_ref().or(bump) else { return };
        out.normal_texture = if holds_heights {
            self.textures.heights(Some(map), beside, scene)
        } else {
            self.textures.color(Some(map), None, beside, scene)
        };
        out.normal_scale = map.multiplier;
    }

    /// Maps of the specular colour, sheen, clearcoat and anisotropy. As with colours, a factor that
    /// is missing or zero leaves it to the map.
    fn layer_maps(&mut self, out: &mut Material, m: &MtlMaterial, file: &str, beside: [&Path; 2], scene: &mut Scene) {
        let maps = [
            ("map_Ks", &m.map_specular),
            ("map_Ps", &m.map_sheen),
            ("map_Pc", &m.map_clearcoat),
            ("map_Pcr", &m.map_clearcoat_roughness),
            ("map_aniso", &m.map_anisotropy),
        ];
        if out.kind != MaterialKind::MetallicRoughness {
            for (key, _) in maps.iter().filter(|(_, map)| map.is_some()) {
                scene.report.warnings.push(format!("{file}: {key} of a mirror or glass is not used"));
            }
            return;
        }
        let textures = &mut self.textures;
        out.specular.color_texture = textures.color(m.map_specular.as_ref(), None, beside, scene);
        out.sheen.color_texture = textures.encoded_grey(m.map_sheen.as_ref(), beside, scene);
        if out.sheen.color_texture.is_some() && out.sheen.color == Vec3::ZERO {
            (out.sheen.color, out.sheen.roughness) = (Vec3::ONE, SHEEN_ROUGHNESS);
        }
        out.clearcoat.texture = textures.grey(m.map_clearcoat.as_ref(), beside, scene);
        if out.clearcoat.texture.is_some() && out.clearcoat.factor == 0.0 {
            out.clearcoat.factor = 1.0;
        }
        out.clearcoat.roughness_texture = textures.grey(m.map_clearcoat_roughness.as_ref(), beside, scene);
        if out.clearcoat.roughness_texture.is_some() && out.clearcoat.roughness == 0.0 {
            out.clearcoat.roughness = 1.0;
        }
        out.anisotropy.texture = textures.anisotropy(m.map_anisotropy.as_ref(), beside, scene);
        if out.anisotropy.texture.is_some() && out.anisotropy.strength == 0.0 {
            out.anisotropy.strength = 1.0;
        }
    }

    /// Roughness and metalness by maps: `map_Pr`, or the exponents of `map_Ns`, and `map_Pm`.
    fn surface_maps(&mut self, out: &mut Material, m: &MtlMaterial, file: &str, beside: [&Path; 2], scene: &mut Scene) {
        // exponents are of no use without a highlight, or beside a roughness
        let shines = m.specular.is_some_and(|s| s.max_element() > 0.0) || m.map_specular.is_some();
        let shininess = m.shininess.filter(|_| shines && m.roughness.is_none() && m.map_roughness.is_none());
        let exponents = m.map_shininess.as_ref().filter(|_| shininess.is_some());
        if m.map_shininess.is_some() && exponents.is_none() {
            scene.report.warnings.push(format!("{file}: {}", unused("map_Ns")));
        }
        let maps = [m.map_roughness.as_ref().or(exponents), m.map_metallic.as_ref()];
        let shininess = shininess.filter(|_| exponents.is_some());
        out.metallic_roughness_texture = self.textures.surface(maps, shininess, beside, scene);
        if out.metallic_roughness_texture.is_none() {
            return;
        }
        // as with colours: a factor that is missing or zero leaves it to the map
        if exponents.is_some() || m.map_roughness.is_some() && m.roughness.is_none_or(|r| r == 0.0) {
            out.roughness = 1.0;
        }
        if m.map_metallic.is_some() && m.metallic.is_none_or(|x| x == 0.0) {
            out.metallic = 1.0;
        }
    }
}

/// Clearcoat, sheen and anisotropy, by the names that programs have agreed on: `Pc`, `Pcr`, `Ps`,
/// `aniso` and `anisor`, a share of a turn.
fn layers(out: &mut Material) {
    let share = |name: &str| out.parameters.get(name).map(|value| value.clamp(0.0, 1.0));
    let (clearcoat, clearcoat_roughness) = (share("Pc"), share("Pcr"));
    let (sheen, anisotropy) = (share("Ps"), share("aniso"));
    let turn = out.parameters.get("anisor").copied();
    out.clearcoat.factor = clearcoat.unwrap_or(0.0);
    out.clearcoat.roughness = clearcoat_roughness.unwrap_or(0.0);
    if let Some(sheen) = sheen.filter(|s| *s > 0.0) {
        out.sheen.color = Vec3::splat(sheen);
        out.sheen.roughness = SHEEN_ROUGHNESS;
    }
    out.anisotropy.strength = anisotropy.unwrap_or(0.0);
    out.anisotropy.rotation = turn.map_or(0.0, |turn| turn * std::f32::consts::TAU);
}

/// How opaque a material is: `d`, or 1 - `Tr`.
fn opacity(m: &MtlMaterial) -> f32 {
    m.dissolve.or(m.transparency.map(|t| 1.0 - t)).unwrap_or(1.0).clamp(0.0, 1.0)
}

/// Whether a library hides all its materials: `Tr` is 1 - d, but some exporters write d, and others
/// write `d 0` of a model whose alpha they do not know.
fn vanishes(materials: &[MtlMaterial]) -> bool {
    let is_hidden = |m: &MtlMaterial| opacity(m) == 0.0 && m.map_dissolve.is_none();
    !materials.is_empty() && materials.iter().all(is_hidden)
}

/// MTL says in several ways, none of them binding, that a material is glass or a mirror. `d` alone
/// is none of them: it is coverage, and so is a `map_d`, which excludes glass.
fn kind(m: &MtlMaterial, diffuse: Vec3, specular: Vec3) -> MaterialKind {
    let dark = diffuse.max_element() <= 0.05 && m.map_diffuse.is_none();
    match m.illum {
        _ if m.map_dissolve.is_some() => MaterialKind::MetallicRoughness,
        Some(4 | 6 | 7 | 9) if !is_unrefracting(m) => MaterialKind::Glass,
        _ if is_filter(m) => MaterialKind::Glass,
        Some(3 | 5 | 8) if dark && specular.max_element() > 0.0 => MaterialKind::Mirror,
        _ => MaterialKind::MetallicRoughness,
    }
}

/// Whether glass would be nothing at all: it does not refract and filters nothing. Maya writes so
/// of every matte surface: `illum 4`, `Tf 1 1 1`, `Ni 1`.
fn is_unrefracting(m: &MtlMaterial) -> bool {
    m.ior == Some(1.0) && m.transmission_filter.is_none_or(|f| f == Vec3::ONE)
}

/// Whether `Tf` says that light goes through and `Ni` how it is refracted. 3ds Max writes both of
/// every material, with `Tf` a copy of `d`: white for what is opaque.
fn is_filter(m: &MtlMaterial) -> bool {
    let Some(filter) = m.transmission_filter.filter(|f| f.max_element() > 0.0) else { return false };
    let is_copy = |f: Vec3| (f - Vec3::splat(opacity(m))).abs().max_element() < 1e-3;
    let says_opacity = m.dissolve.is_some() || m.transparency.is_some();
    m.ior.is_some_and(|n| n > 1.0) && !(says_opacity && is_copy(filter))
}
