//! Textures: samplers, and images decoded in parallel.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;

use super::accessor::Reader;
use super::container;
use super::schema::{Document, Sampler};
use crate::scene::load::picture::{self, Picture};
use crate::scene::{Filter, Material, Texture, Wrap};

/// Decodes the images that materials use, and turns the glTF textures in their slots into the scene's.
///
/// A texture whose image is missing or broken leaves its slot, with a warning: for every slot that is the same as a
/// texture that changes nothing.
pub(super) fn resolve(reader: &Reader, path: &Path, materials: &mut [Material], warn: &mut dyn FnMut(String)) -> Vec<Texture> {
    let document = reader.document;
    let mut used: BTreeMap<usize, Option<usize>> = BTreeMap::new();
    for slot in materials.iter_mut().flat_map(Material::texture_slots_mut).flatten() {
        used.insert(slot.texture, None);
    }
    let image_of = |texture: usize| document.textures.get(texture).and_then(|t| t.source);
    let mut wanted: Vec<usize> = used.keys().filter_map(|&t| image_of(t)).collect();
    wanted.sort_unstable();
    wanted.dedup();
    let decoded: BTreeMap<usize, Result<Picture, String>> =
        wanted.into_par_iter().map(|i| (i, image(reader, path, i))).collect();

    for (i, error) in decoded.iter().filter_map(|(i, r)| Some((i, r.as_ref().err()?))) {
        warn(format!("image {i} {error}: shown without it"));
    }
    let mut textures = Vec::new();
    for (&index, place) in &mut used {
        let Some(texture) = document.textures.get(index) else {
            warn(format!("texture {index} does not exist: shown without it"));
            continue;
        };
        let Some(source) = texture.source else {
            warn(format!("texture {index} has no PNG or JPEG image: shown without it"));
            continue;
        };
        let Some(Ok(picture)) = decoded.get(&source) else { continue };
        let (wrap, filter) = sampler(document, texture.sampler);
        let image = &document.images[source];
        let name = [&texture.name, &image.name].into_iter().find(|n| !n.is_empty()).cloned();
        let name = name.or_else(|| image.uri.clone().filter(|u| !u.starts_with("data:"))).unwrap_or_default();
        *place = Some(textures.len());
        textures.push(Texture {
            name,
            width: picture.width,
            height: picture.height,
            rgba8: picture.rgba8.clone(),
            wrap,
            filter,
        });
    }
    for slot in materials.iter_mut().flat_map(Material::texture_slots_mut) {
        if let Some(s) = slot {
            match used.get(&s.texture).copied().flatten() {
                Some(texture) => s.texture = texture,
                None => *slot = None,
            }
        }
    }
    textures
}

fn image(reader: &Reader, path: &Path, index: usize) -> Result<Picture, String> {
    let image = reader.document.images.get(index).ok_or("does not exist")?;
    match (&image.uri, image.buffer_view) {
        (_, Some(view)) => picture::decode(reader.view(view)?.0, &image.name),
        (Some(uri), None) => {
            let bytes = container::read_uri(uri, path).map_err(|e| format!("cannot be read ({e})"))?;
            let name = if uri.starts_with("data:") { &image.name } else { uri };
            picture::decode(&bytes, name)
        }
        (None, None) => Err("has neither a URI nor a buffer view".to_owned()),
    }
}

fn sampler(document: &Document, index: Option<usize>) -> ([Wrap; 2], Filter) {
    let default = Sampler::default();
    let sampler = index.and_then(|i| document.samplers.get(i)).unwrap_or(&default);
    let wrap = |code: Option<u32>| match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    // without mip maps one filter serves both ways; magnification says more about what the author wants to see
    let filter = match sampler.mag_filter.or(sampler.min_filter) {
        Some(9728 | 9984 | 9986) => Filter::Nearest,
        _ => Filter::Linear,
    };
    ([wrap(sampler.wrap_s), wrap(sampler.wrap_t)], filter)
}
