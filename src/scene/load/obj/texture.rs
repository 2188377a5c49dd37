//! Maps of MTL materials to the scene's textures.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::mtl::{Map, MapChannel};
use crate::colour::srgb_encode;
use crate::error::Error;
use crate::scene::load::find::{self, Finder};
use crate::scene::load::options::{LoadPart, LoadProgress, Loading};
use crate::scene::load::picture::{self, DecodedImage};
use crate::scene::load::text;
use crate::scene::material::TextureSlot;
use crate::scene::{Filter, LoadReport, Scene, TexelData, Texture, Wrap};

/// Source of a texture's texels, so that no two textures are alike.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Texels {
    /// Colour of the first map, alpha of the second.
    ColorAndAlpha,
    /// Roughness of the first map (green), metalness of the second (blue).
    Surface,
    /// A surface's roughness and metalness, with Blinn-Phong exponents in the first map: bits of
    /// the largest one.
    SurfaceOfExponents(u32),
    /// Numbers of the first map, as grey.
    Grey,
    /// Numbers of the first map, as grey that is encoded as sRGB.
    EncodedGrey,
    /// Strengths of anisotropy of the first map, all along the tangent.
    Anisotropy,
    /// Normals of the heights of the first map.
    Heights,
}

/// Identity of a file of a texture: its path, the bits of its `-mm`, and its `-imfchan`.
type FileKey = (PathBuf, [u32; 2], Option<MapChannel>);

/// Identity of a texture: its texels, its files, and whether it is clamped.
type TextureKey = (Texels, [Option<FileKey>; 2], bool);

/// The pictures and textures of a model's materials.
pub(super) struct Textures<'a> {
    loading: Loading<'a>,
    pub finder: Finder,
    pictures: HashMap<PathBuf, Option<DecodedImage>>,
    /// Pictures that were decoded before a material asks for them.
    ahead: HashMap<PathBuf, Result<DecodedImage, String>>,
    /// Number of pictures that were decoded.
    decoded: AtomicUsize,
    textures: HashMap<TextureKey, usize>,
    /// Names that were not found.
    missing: HashSet<String>,
}

impl<'a> Textures<'a> {
    /// No texture yet.
    pub(super) fn new(loading: Loading<'a>) -> Self {
        Self {
            loading,
            finder: Finder::new(&loading.options),
            pictures: HashMap::new(),
            ahead: HashMap::new(),
            decoded: AtomicUsize::new(0),
            textures: HashMap::new(),
            missing: HashSet::new(),
        }
    }

    /// Decodes the pictures of maps on all cores, as far as they are found; materials take them
    /// then, in their order, and say what is wrong with them.
    pub(super) fn decode_ahead<'m>(&mut self, maps: impl Iterator<Item = &'m Map>, beside: [&Path; 2]) {
        if !self.loading.options.textures {
            return;
        }
        let mut paths: Vec<PathBuf> = maps.filter_map(|map| self.finder.find(&map.names(), &beside).ok()).collect();
        paths.sort();
        paths.dedup();
        paths.retain(|path| !self.pictures.contains_key(path));
        let decoded: Vec<_> = paths.par_iter().map(|path| self.decode_file(path)).collect();
        self.ahead.extend(paths.into_iter().zip(decoded));
    }

    /// The texture of `color`, with its alpha from `alpha`. `None`, with a warning, if neither can
    /// be read.
    pub(super) fn color(
        &mut self,
        color: Option<&Map>,
        alpha: Option<&Map>,
        beside: [&Path; 2],
        scene: &mut Scene,
    ) -> Option<TextureSlot> {
        self.slot([color, alpha], Texels::ColorAndAlpha, beside, scene, |[color, alpha]| match (color, alpha) {
            // alpha of a diffuse map means nothing in MTL
            (Some((map, picture)), None) if map.range == [0.0, 1.0] => picture.clone(),
            (Some((map, picture)), Some((alpha, same)))
                if map.range == alpha.range && map.range == [0.0, 1.0] && map.file == alpha.file && has_alpha(same) =>
            {
                picture.clone()
            }
            (color, alpha) => {
                let own = if alpha.is_some_and(|(_, p)| has_alpha(p)) { MapChannel::Alpha } else { MapChannel::Red };
                let channel = alpha.and_then(|(map, _)| map.channel).unwrap_or(own);
                combined([color, alpha].map(|p| p.map(|(_, picture)| picture)), |[c, a]| {
                    let [r, g, b, _] = c.zip(color).map_or([1.0; 4], |(texel, (map, _))| texel.map(|v| ranged(map, v)));
                    [r, g, b, a.zip(alpha).map_or(1.0, |(texel, (map, _))| ranged(map, channel.value(texel)))]
                })
            }
        })
    }

    /// The texture of roughness and metalness. `shininess`: the first map holds shares of this
    /// Blinn-Phong exponent.
    pub(super) fn surface(
        &mut self,
        [rough, metal]: [Option<&Map>; 2],
        shininess: Option<f32>,
        beside: [&Path; 2],
        scene: &mut Scene,
    ) -> Option<TextureSlot> {
        let texels = shininess.map_or(Texels::Surface, |n| Texels::SurfaceOfExponents(n.to_bits()));
        self.slot([rough, metal], texels, beside, scene, |[rough, metal]| {
            combined([rough, metal].map(|p| p.map(|(_, picture)| picture)), |[r, m]| {
                let channel = |texel: Option<[f32; 4]>, p: Option<(&Map, &DecodedImage)>| {
                    texel.zip(p).map_or(1.0, |(texel, (map, _))| number(map, texel))
                };
                let rough = channel(r, rough);
                let rough = shininess.filter(|_| r.is_some()).map_or(rough, |n| roughness(n * rough));
                [1.0, rough, channel(m, metal), 1.0]
            })
        })
    }

    /// The texture of a map of numbers, as grey.
    pub(super) fn grey(&mut self, map: Option<&Map>, beside: [&Path; 2], scene: &mut Scene) -> Option<TextureSlot> {
        self.numbers(map, Texels::Grey, beside, scene, |x| [x, x, x, 1.0])
    }

    /// The texture of a map of numbers, as grey where textures of colours are read as sRGB.
    pub(super) fn encoded_grey(
        &mut self,
        map: Option<&Map>,
        beside: [&Path; 2],
        scene: &mut Scene,
    ) -> Option<TextureSlot> {
        self.slot([map, None], Texels::EncodedGrey, beside, scene, |[p, _]| {
            // floats are linear, whatever they are of
            let is_float = p.is_some_and(|(_, p)| matches!(p.texels, TexelData::Float(_)));
            let encode = |x: f32| if is_float { x } else { srgb_encode(x.clamp(0.0, 1.0)) };
            combined([p.map(|(_, p)| p), None], |[texel, _]| {
                let x = p.zip(texel).map_or(1.0, |((map, _), texel)| encode(number(map, texel)));
                [x, x, x, 1.0]
            })
        })
    }

    /// The texture of a map of strengths of anisotropy.
    pub(super) fn anisotropy(
        &mut self,
        map: Option<&Map>,
        beside: [&Path; 2],
        scene: &mut Scene,
    ) -> Option<TextureSlot> {
        self.numbers(map, Texels::Anisotropy, beside, scene, |x| [1.0, 0.5, x, 1.0])
    }

    /// The normal map of a map of heights, for a height of 1 that is as high as a texel is wide
    /// ([`normals_of_heights`]).
    pub(super) fn heights(&mut self, map: Option<&Map>, beside: [&Path; 2], scene: &mut Scene) -> Option<TextureSlot> {
        self.slot([map, None], Texels::Heights, beside, scene, |[first, _]| match first {
            Some((map, picture)) => normals_of_heights(map, picture),
            None => combined([None, None], |_| [0.5, 0.5, 1.0, 1.0]),
        })
    }

    /// The texture whose texels `texel` makes of a map's numbers.
    fn numbers(
        &mut self,
        map: Option<&Map>,
        texels: Texels,
        beside: [&Path; 2],
        scene: &mut Scene,
        texel: impl Fn(f32) -> [f32; 4],
    ) -> Option<TextureSlot> {
        self.slot([map, None], texels, beside, scene, |[p, _]| {
            combined([p.map(|(_, p)| p), None], |[at, _]| {
                texel(p.zip(at).map_or(1.0, |((map, _), at)| number(map, at)))
            })
        })
    }

    /// The texture that `make` makes of the maps that can be read, with the options of the first.
    fn slot(
        &mut self,
        maps: [Option<&Map>; 2],
        texels: Texels,
        beside: [&Path; 2],
        scene: &mut Scene,
        make: impl Fn([Option<(&Map, &DecodedImage)>; 2]) -> DecodedImage,
    ) -> Option<TextureSlot> {
        let options = maps[0].or(maps[1])?;
        let files = maps.map(|map| map.and_then(|map| Some((map, self.path(map, beside, &mut scene.report)?))));
        let key = files.clone().map(|file| file.map(|(map, path)| (path, map.range.map(f32::to_bits), map.channel)));
        let key = (texels, key, options.clamp);
        if let Some(&texture) = self.textures.get(&key) {
            return Some(TextureSlot { texture, texcoord: 0, transform: options.transform });
        }
        for (_, path) in files.iter().flatten() {
            self.decode(path, &mut scene.report);
        }
        let pictures = files.each_ref().map(|file| {
            let (map, path) = file.as_ref()?;
            Some((*map, self.pictures.get(path)?.as_ref()?))
        });
        let named = files.iter().zip(&pictures).find_map(|(file, picture)| file.as_ref().filter(|_| picture.is_some()));
        let name = named?.1.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // what two maps are combined to has a texel for each of the larger one; normals of heights
        // have 16 bits
        let bytes = if texels == Texels::Heights { 8 } else { 4 };
        let count = pictures.iter().flatten().map(|(_, p)| u64::from(p.width) * u64::from(p.height)).max().unwrap_or(0);
        self.loading.budget.take(bytes * count, || format!("the texture {name}")).ok()?;
        let DecodedImage { width, height, texels } = make(pictures);
        let wrap = [if options.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
        let texture = scene.textures.len();
        scene.textures.push(Texture { name, width, height, texels, wrap, filter: Filter::Linear });
        self.textures.insert(key, texture);
        Some(TextureSlot { texture, texcoord: 0, transform: options.transform })
    }

    /// The picture of a map as it is in its file, if it can be read.
    pub(super) fn picture(&mut self, map: &Map, beside: [&Path; 2], report: &mut LoadReport) -> Option<&DecodedImage> {
        let path = self.path(map, beside, report)?;
        self.decode(&path, report);
        self.pictures.get(&path)?.as_ref()
    }

    /// The file of a map.
    fn path(&mut self, map: &Map, beside: [&Path; 2], report: &mut LoadReport) -> Option<PathBuf> {
        match self.finder.find(&map.names(), &beside) {
            Ok(path) => Some(path),
            Err(searched) => {
                if self.missing.insert(map.file.clone()) {
                    let (name, searched) = (text::shown(&map.file), find::list(&searched));
                    report.warnings.push(format!("the texture `{name}` was not found in {searched}"));
                }
                None
            }
        }
    }

    /// Decodes a picture, once.
    fn decode(&mut self, path: &Path, report: &mut LoadReport) {
        if self.pictures.contains_key(path) {
            return;
        }
        report.files.push(path.to_owned());
        let picture = if self.loading.options.textures {
            let decoded = self.ahead.remove(path).unwrap_or_else(|| self.decode_file(path));
            decoded.map_err(|e| report.warnings.push(format!("{e}: shown without it"))).ok()
        } else {
            report.skipped_images += 1;
            None
        };
        self.pictures.insert(path.to_owned(), picture);
    }

    fn decode_file(&self, path: &Path) -> Result<DecodedImage, String> {
        let bytes = crate::files::read_regular(path).map_err(|e| Error::read(path, &e).to_string());
        let name = path.to_string_lossy();
        let budget = self.loading.budget;
        let decoded = bytes.and_then(|b| {
            budget.read(b.len());
            picture::decode(&b, &name, budget).map_err(|e| format!("{name} {e}"))
        });
        let done = 1 + self.decoded.fetch_add(1, Ordering::Relaxed);
        (self.loading.options.progress)(LoadProgress { part: LoadPart::Images, done, of: None });
        decoded
    }
}

/// Perceptual roughness of a Blinn-Phong exponent (alpha^2 = 2 / (n + 2), roughness = sqrt(alpha)).
pub(super) fn roughness(shininess: f32) -> f32 {
    (2.0 / (shininess.max(0.0) + 2.0)).powf(0.25)
}

/// A texel's value in the range that `-mm` gives.
fn ranged(map: &Map, value: f32) -> f32 {
    let [base, gain] = map.range;
    if map.range == [0.0, 1.0] { value } else { (base + gain * value).clamp(0.0, 1.0) }
}

/// The number that a map has in a texel: in the channel of `-imfchan`, or else in red.
fn number(map: &Map, texel: [f32; 4]) -> f32 {
    ranged(map, map.channel.unwrap_or(MapChannel::Red).value(texel))
}

/// The tangent-space normal map of a map of heights, by central differences: a height of 1 is as
/// high as a texel is wide. `-bm` is not in it: that is the scale of the normal map's x and y,
/// which multiplies slopes. Differences go on at the other side where the map repeats; at the
/// border of one that is clamped they are one-sided. It has 16 bits, for the slopes of 8-bit
/// heights are smaller than the steps of an 8-bit normal map.
fn normals_of_heights(map: &Map, picture: &DecodedImage) -> DecodedImage {
    let (width, height) = (picture.width.max(1), picture.height.max(1));
    // the format's channel of bumps is luminance
    let channel = map.channel.unwrap_or(MapChannel::Luminance);
    let at = |x: u32, y: u32| {
        let texel = picture.texels.get((u64::from(y) * u64::from(width) + u64::from(x)) as usize);
        ranged(map, channel.value(texel))
    };
    let neighbours = |i: u32, size: u32| {
        if map.clamp { (i.saturating_sub(1), (i + 1).min(size - 1)) } else { ((i + size - 1) % size, (i + 1) % size) }
    };
    let slope = |before: f32, after: f32, is_one_sided: bool| (after - before) * if is_one_sided { 1.0 } else { 0.5 };
    let mut texels: Vec<u16> = Vec::with_capacity(4 * width as usize * height as usize);
    for y in 0..height {
        let (above, below) = neighbours(y, height);
        for x in 0..width {
            let (left, right) = neighbours(x, width);
            let along = slope(at(left, y), at(right, y), map.clamp && right - left == 1);
            // the image's rows go down, and the bitangent up
            let up = slope(at(x, below), at(x, above), map.clamp && below - above == 1);
            let normal = Vec3::new(-along, -up, 1.0).normalize();
            let encoded = (0.5 * normal + 0.5).to_array().map(|v| (65535.0 * v).round() as u16);
            texels.extend(encoded.into_iter().chain([u16::MAX]));
        }
    }
    DecodedImage { width, height, texels: texels.into() }
}

fn has_alpha(picture: &DecodedImage) -> bool {
    picture.texels.iter().any(|[_, _, _, alpha]| alpha < 1.0)
}

/// Whether alpha is a matter of yes or no: at most a tenth of the texels, those along edges, are
/// between.
pub(super) fn is_cut_out(texels: &TexelData) -> bool {
    let (between, all) = texels
        .iter()
        .fold((0, 0), |(between, all), [_, _, _, alpha]| (between + usize::from(alpha > 0.1 && alpha < 0.9), all + 1));
    between * 10 <= all
}

/// Whether texels are directions, most of them outwards, and not heights, which are grey.
pub(super) fn is_normal_map(texels: &TexelData) -> bool {
    let (mut length_error, mut outwards, mut spread, mut count) = (0.0, 0.0, 0.0, 0.0_f32);
    for [r, g, b, _] in texels.iter() {
        let [x, y, z] = [r, g, b].map(|v| 2.0 * v - 1.0);
        length_error += ((x * x + y * y + z * z).sqrt() - 1.0).abs();
        outwards += z;
        spread += r.max(g).max(b) - r.min(g).min(b);
        count += 1.0;
    }
    length_error < 0.15 * count && outwards > 0.4 * count && spread > 0.1 * count
}

/// A picture of the size of the larger one, each of whose texels `f` makes of those at the same
/// place.
fn combined(pictures: [Option<&DecodedImage>; 2], f: impl Fn([Option<[f32; 4]>; 2]) -> [f32; 4]) -> DecodedImage {
    let size = |side: fn(&DecodedImage) -> u32| pictures.iter().flatten().map(|p| side(p)).max().unwrap_or(1);
    let (width, height) = (size(|p| p.width), size(|p| p.height));
    let texel = |p: &DecodedImage, x: u32, y: u32| {
        let x = u64::from(x) * u64::from(p.width) / u64::from(width);
        let y = u64::from(y) * u64::from(p.height) / u64::from(height);
        p.texels.get((y * u64::from(p.width) + x) as usize)
    };
    let all = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .flat_map(|(x, y)| f(pictures.map(|p| p.map(|p| texel(p, x, y)))));
    let formats = |kind: fn(&TexelData) -> bool| pictures.iter().flatten().map(move |p| kind(&p.texels));
    let texels = if formats(|t| matches!(t, TexelData::Float(_))).any(|is| is) {
        all.collect::<Vec<f32>>().into()
    } else if formats(|t| matches!(t, TexelData::Unorm8(_))).all(|is| is) {
        all.map(|v| (v * 255.0).round() as u8).collect::<Vec<u8>>().into()
    } else {
        all.map(|v| (v * 65535.0).round() as u16).collect::<Vec<u16>>().into()
    };
    DecodedImage { width, height, texels }
}
