//! Textures: samplers, and images decoded in parallel.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use ::gltf::json::texture::{MagFilter, MinFilter, Sampler, WrappingMode};
use ::gltf::json::validation::Checked;
use ::gltf::json::{self, Index, Root};
use rayon::prelude::*;

use super::accessor::Reader;
use super::glossiness::RoughnessTexture;
use super::values::{text, valid};
use super::{container, uri};
use crate::scene::load::options::{LoadPart, LoadProgress, Loading};
use crate::scene::load::picture::{self, DecodedImage};
use crate::scene::{Filter, Material, Texture, Wrap};
use crate::stage;

/// Decodes the images that materials use, and turns the glTF textures in their slots into the
/// scene's.
///
/// A texture whose image is missing or broken leaves its slot, with a warning: for every slot that
/// is the same as a texture that changes nothing. So does every image if the options leave them
/// out; their number is returned, too. `made`: textures that are made of others, whose indices
/// follow those of the file's.
pub(super) fn resolve(
    reader: &Reader,
    path: &Path,
    materials: &mut [Material],
    made: &[RoughnessTexture],
    loading: Loading,
    warn: &mut dyn FnMut(String),
) -> (Vec<Texture>, usize) {
    let (document, options) = (reader.document, loading.options);

    // textures that materials use, and the images that these need
    let mut used: BTreeMap<usize, Option<usize>> = BTreeMap::new();
    for slot in materials.iter_mut().flat_map(Material::texture_slots_mut).flatten() {
        used.insert(slot.texture, None);
    }
    let count = document.textures.len();
    let made = |texture: usize| texture.checked_sub(count).and_then(|k| made.get(k));
    let of_file = |texture: usize| made(texture).map_or(texture, |m| m.texture);
    let image_of = |texture: usize| document.textures.get(of_file(texture)).and_then(source);
    let mut wanted: Vec<usize> = used.keys().filter_map(|&t| image_of(t)).collect();
    wanted.sort_unstable();
    wanted.dedup();

    // several images may name one file: the first of them is decoded
    let mut first_of = BTreeMap::new();
    let content =
        |i: usize| document.images.get(i).map(|image| (image.uri.as_deref(), image.buffer_view.map(|v| v.value())));
    let same: BTreeMap<usize, usize> =
        wanted.iter().map(|&i| (i, content(i).map_or(i, |c| *first_of.entry(c).or_insert(i)))).collect();
    wanted.retain(|i| same[i] == *i);

    // images in parallel
    let (count, done) = (wanted.len(), AtomicUsize::new(0));
    let decode = |i: usize| {
        let decoded = image(reader, path, loading, i);
        let done = 1 + done.fetch_add(1, Ordering::Relaxed);
        (options.progress)(LoadProgress { part: LoadPart::Images, done, of: Some(count) });
        (i, decoded)
    };
    let decoding = stage::begin("decoding images");
    let decoded: BTreeMap<usize, Result<DecodedImage, String>> =
        if options.textures { wanted.into_par_iter().map(decode).collect() } else { BTreeMap::new() };
    drop(decoding);
    let skipped = if options.textures { 0 } else { count };

    // textures of the images that could be decoded
    for (i, error) in decoded.iter().filter_map(|(i, r)| Some((i, r.as_ref().err()?))) {
        warn(format!("image {i} {error}: shown without it"));
    }
    let mut textures = Vec::new();
    for (&index, place) in &mut used {
        let Some(texture) = document.textures.get(of_file(index)) else {
            warn(format!("texture {index} does not exist: shown without it"));
            continue;
        };
        let Some(source) = source(texture) else {
            warn(format!("texture {index} has no image that skylit reads: shown without it"));
            continue;
        };
        let Some(Ok(picture)) = same.get(&source).and_then(|first| decoded.get(first)) else { continue };
        let (wrap, filter) = sampler(document, texture.sampler);
        let image = &document.images[source];
        let file = image.uri.as_deref().filter(|u| !uri::is_data(u)).unwrap_or_default();
        let name =
            [text(&texture.name), text(&image.name), file].into_iter().find(|n| !n.is_empty()).unwrap_or_default();
        *place = Some(textures.len());
        textures.push(Texture {
            name: name.to_owned(),
            width: picture.width,
            height: picture.height,
            texels: made(index).map_or_else(|| picture.texels.clone(), |m| m.make(picture)),
            wrap,
            filter,
        });
    }

    // materials refer to the new numbers; those of textures that are missing refer to none
    for slot in materials.iter_mut().flat_map(Material::texture_slots_mut) {
        if let Some(s) = slot {
            match used.get(&s.texture).copied().flatten() {
                Some(texture) => s.texture = texture,
                None => *slot = None,
            }
        }
    }
    (textures, skipped)
}

/// Extensions by which a texture has an image of another format than PNG and JPEG.
const SOURCES: &[(&str, bool)] = &[
    ("KHR_texture_basisu", cfg!(feature = "ktx2")),
    ("MSFT_texture_dds", cfg!(feature = "dds")),
    ("EXT_texture_webp", true),
];

/// Index of a texture's image. One of an extension comes first, as these want it: what stands
/// beside it is for programs without them.
fn source(texture: &json::Texture) -> Option<usize> {
    // the crate's stand-in for a texture without a source
    const NO_SOURCE: usize = u32::MAX as usize;
    let extensions = texture.extensions.as_ref().map(|e| &e.others);
    let of_extension = |name: &str| extensions?.get(name)?.get("source")?.as_u64()?.try_into().ok();
    let supported = SOURCES.iter().filter(|(_, is_supported)| *is_supported);
    supported
        .filter_map(|(name, _)| of_extension(name))
        .next()
        .or_else(|| Some(texture.source.value()).filter(|&s| s != NO_SOURCE))
}

/// Decodes an image of the document.
///
/// # Errors
/// What is wrong, in words that follow its name.
pub(super) fn image(reader: &Reader, path: &Path, loading: Loading, index: usize) -> Result<DecodedImage, String> {
    let image = reader.document.images.get(index).ok_or("does not exist")?;
    match (&image.uri, image.buffer_view) {
        (_, Some(view)) => picture::decode(reader.view(view)?.0, text(&image.name), reader.budget),
        (Some(file), None) => {
            let bytes = container::read_uri(file, path, loading).map_err(|e| format!("cannot be read ({e})"))?;
            let name = if uri::is_data(file) { text(&image.name) } else { file };
            picture::decode(&bytes, name, reader.budget)
        }
        (None, None) => Err("has neither a URI nor a buffer view".to_owned()),
    }
}

fn sampler(document: &Root, index: Option<Index<Sampler>>) -> ([Wrap; 2], Filter) {
    let default = Sampler::default();
    let sampler = index.and_then(|i| document.samplers.get(i.value())).unwrap_or(&default);
    let wrap = |mode: Checked<WrappingMode>| match valid(mode) {
        Some(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Some(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Some(WrappingMode::Repeat) | None => Wrap::Repeat,
    };
    // without mip maps one filter serves both ways; magnification says more about what the author
    // wants to see
    let nearest = match sampler.mag_filter {
        Some(filter) => valid(filter) == Some(MagFilter::Nearest),
        None => matches!(
            sampler.min_filter.and_then(valid),
            Some(MinFilter::Nearest | MinFilter::NearestMipmapNearest | MinFilter::NearestMipmapLinear)
        ),
    };
    ([wrap(sampler.wrap_s), wrap(sampler.wrap_t)], if nearest { Filter::Nearest } else { Filter::Linear })
}
