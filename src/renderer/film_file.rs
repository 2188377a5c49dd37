//! Saves films in image files, and resumes them: their sums, and the metadata that must agree.

use std::path::Path;

use crate::error::{Error, Result};
use crate::film::record_words;
use crate::film::state::{FilmState, words};
use crate::output::{self, Channel, Image, Samples};

/// The EXR layer that holds a film's sums.
const LAYER: &str = "state";
/// Suffix of metadata keys whose value is a hash of the contents of what the key without it names.
const HASH: &str = ".hash";

/// Metadata in which an image and the render that resumes it must agree; `None`: no such key.
pub type Identity = Vec<(&'static str, Option<String>)>;

/// The tracer and the device that rendered an image.
pub type RenderedBy = [(&'static str, String); 2];

/// A film's sums as channels of an image; `names` are the names of its values.
pub fn state_channels(state: &FilmState, names: &[&str]) -> Vec<Channel> {
    let channel = |name: &str, samples| Channel { name: format!("{LAYER}.{name}"), samples };
    let mut out: Vec<Channel> = words(names)
        .iter()
        .enumerate()
        .map(|(k, word)| {
            let plane = state.plane(k);
            let samples = if word.float {
                Samples::F32(plane.into_iter().map(f32::from_bits).collect())
            } else {
                Samples::U32(plane)
            };
            channel(&word.name, samples)
        })
        .collect();
    out.push(channel("samples", Samples::U32(state.samples_plane())));
    out
}

/// A film that is resumed.
pub struct Resumed {
    /// The film's sums.
    pub state: FilmState,
    /// A warning for the user, if any.
    pub warning: Option<String>,
}

/// Reads the film from an image file, for an image of `size` pixels with `spp` samples in all,
/// whose values are called `names`. `identity` and `rendered_by` are those of this render.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read or has no film; [`Error::Usage`] for one of a
/// different render, naming the difference, or with more than `spp` samples.
pub fn resume(
    path: &Path,
    scene: &str,
    names: &[&str],
    size: [u32; 2],
    spp: u32,
    identity: &Identity,
    rendered_by: &RenderedBy,
) -> Result<Resumed> {
    let image = output::exr::read(path)?;
    let state = read_state(&image, names);
    if matches!(state, StoredState::None) {
        return Err(Error::input(path, "it has no film state to resume; render it with --resumable"));
    }

    // The image must be of the same render.
    let differs = |what: &str, its: &str, ours: &str| {
        Error::Usage(format!(
            "--resume {}: its {what} is {its}, this run's is {ours}; \
             all settings must be those of the render that is resumed",
            path.display()
        ))
    };
    if let Some((key, its, ours)) = difference(&image, identity, scene) {
        return Err(differs(&key, &its, &ours));
    }
    if [image.width, image.height] != size {
        let text = |[w, h]: [u32; 2]| format!("{w}x{h}");
        return Err(differs("size", &text([image.width, image.height]), &text(size)));
    }
    let StoredState::Intact(state) = state else {
        return Err(Error::input(path, "its film state is damaged; render it anew with --resumable"));
    };
    if state.max_samples() > spp {
        return Err(Error::Usage(format!(
            "--spp {spp}: {} has {} samples per pixel already; give at least as many",
            path.display(),
            state.max_samples()
        )));
    }

    // Another device or tracer does no harm, but rounds differently.
    let other = rendered_by.iter().find(|(key, ours)| image.metadata(key) != Some(ours.as_str()));
    let warning = other.map(|(key, ours)| {
        format!(
            "{} was started with {key} {}, and is resumed with {ours}: correct, \
             but not bit-identical to an uninterrupted render",
            path.display(),
            image.metadata(key).unwrap_or("unknown")
        )
    });
    Ok(Resumed { state, warning })
}

/// The first key that differs, with both values.
fn difference(image: &Image, identity: &Identity, scene: &str) -> Option<(String, String, String)> {
    let (key, ours) = identity.iter().find(|(key, ours)| image.metadata(key) != ours.as_deref())?;
    let its = image.metadata(key);
    let Some(named) = key.strip_suffix(HASH) else {
        let text = |value: Option<&str>| value.unwrap_or("none").to_owned();
        return Some((key.replace('_', " "), text(its), text(ours.as_deref())));
    };
    // the contents differ; the names may differ, too
    let ours_named = match named {
        "scene" => Some(scene),
        _ => identity.iter().find(|(key, _)| *key == named).and_then(|(_, v)| v.as_deref()),
    };
    let text = |name: Option<&str>, hash: Option<&str>| {
        let hash = hash.unwrap_or("none");
        format!("{} (contents {})", name.unwrap_or("unknown"), hash.get(..8).unwrap_or(hash))
    };
    Some((named.to_owned(), text(image.metadata(named), its), text(ours_named, ours.as_deref())))
}

/// The film state found in an image.
enum StoredState {
    None,
    Damaged,
    Intact(FilmState),
}

fn read_state(image: &Image, names: &[&str]) -> StoredState {
    if !image.channels.iter().any(|c| c.name.strip_prefix(LAYER).is_some_and(|rest| rest.starts_with('.'))) {
        return StoredState::None;
    }
    let find = |name: &str| image.channels.iter().find(|c| c.name == format!("{LAYER}.{name}")).map(|c| &c.samples);
    let mut planes = Vec::with_capacity(record_words(names.len()));
    for word in words(names) {
        match (find(&word.name), word.float) {
            (Some(Samples::F32(plane)), true) => planes.push(plane.iter().map(|v| v.to_bits()).collect()),
            (Some(Samples::U32(plane)), false) => planes.push(plane.clone()),
            _ => return StoredState::Damaged,
        }
    }
    let Some(Samples::U32(samples)) = find("samples") else { return StoredState::Damaged };
    let state = FilmState::from_planes([image.width, image.height], names.len(), &planes, samples);
    state.map_or(StoredState::Damaged, StoredState::Intact)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differing_metadata_is_named() {
        let metadata = [("seed", "1"), ("scene", "a.glb"), ("scene.hash", "0123456789abcdef"), ("rr_depth", "5")];
        let image =
            Image { metadata: metadata.map(|(k, v)| (k.to_owned(), v.to_owned())).to_vec(), ..Default::default() };
        let of = |identity: &[(&'static str, Option<&str>)]| {
            let identity = identity.iter().map(|(k, v)| (*k, v.map(str::to_owned))).collect();
            difference(&image, &identity, "b.glb").map(|(key, its, ours)| format!("{key}: {its}, {ours}"))
        };
        let same = [("seed", Some("1")), ("lens", None), ("scene.hash", Some("0123456789abcdef"))];
        assert_eq!(of(&same), None);
        assert_eq!(of(&[("seed", Some("2"))]).unwrap(), "seed: 1, 2");
        assert_eq!(of(&[("lens", Some("radius 1"))]).unwrap(), "lens: none, radius 1");
        assert_eq!(of(&[("rr_depth", None)]).unwrap(), "rr depth: 5, none");
        let scene = of(&[("scene.hash", Some("f123456789abcdef"))]).unwrap();
        assert_eq!(scene, "scene: a.glb (contents 01234567), b.glb (contents f1234567)");
    }
}
