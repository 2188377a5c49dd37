//! Films that are put down and taken up again, saved on their way, and stopped where they are good enough.

pub mod args;
mod report;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

pub use report::{Told, tell};

use super::args::RenderArgs;
use crate::error::{Error, Result};
use crate::files;
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::film::record_words;
use crate::film::schedule::FilmOptions;
use crate::film::state::{FilmState, words};
use crate::output::{self, Channel, Image, Samples};
use crate::scene::RenderHints;
use crate::terminal::interrupt::ProgressControl;

/// The layer that holds a film's sums.
const LAYER: &str = "state";
/// Ends the keys of metadata that stand for the contents of what the key without it names.
const HASH: &str = ".hash";

/// What of an image has to agree with what it was begun with: keys of the metadata and their values, none where the image does not have it.
pub type Identity = Vec<(&'static str, Option<String>)>;

/// What made an image: its tracer and its device.
pub type Maker = [(&'static str, String); 2];

/// Text attributes of an image. Nothing in it differs between two runs of the same command.
pub fn metadata(args: &RenderArgs, spp: String, maker: &Maker, identity: &Identity) -> Vec<(String, String)> {
    let mut out = vec![("scene", args.scene.clone()), ("spp", spp)];
    out.extend(maker.iter().cloned());
    out.extend(identity.iter().filter_map(|(key, value)| Some((*key, value.clone()?))));
    if let Some(target) = args.film.target_rmse {
        out.push(("target_rmse", target.to_string()));
    }
    out.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}

/// Samples per pixel: the fewest and the most.
pub fn spp_text(least: u32, most: u32) -> String {
    if least == most { most.to_string() } else { format!("{least} to {most}") }
}

/// What a film is to do, as the options say, with a film that it starts from. A scene names samples of its own at which it wants to be saved.
pub fn options(args: &RenderArgs, hints: &RenderHints, spp: u32, start: Option<FilmState>) -> FilmOptions {
    let mut intervals: Vec<u32> = match args.film.intervals {
        true => (0..u32::BITS).map(|k| 1 << k).chain(hints.save_intervals.iter().copied()).collect(),
        false => Vec::new(),
    };
    intervals.retain(|&n| n > 0 && n < spp);
    intervals.sort_unstable();
    intervals.dedup();
    FilmOptions {
        start: start.map(Into::into),
        keep_state: args.film.keeps_state() && args.writes_exr(),
        intervals,
        target_rmse: args.film.target_rmse,
    }
}

/// Can all that is saved on the way be written? Asked before long work starts.
///
/// # Errors
/// [`Error::Output`], naming the file.
pub fn check_writable(args: &RenderArgs, options: &FilmOptions) -> Result<()> {
    let check = |path: &Path| options.intervals.iter().try_for_each(|&n| files::check_writable(&interval_path(path, n)));
    args.output.iter().try_for_each(|path| check(path))
}

/// NAME.0016.exr: the name of an output once it has `samples` samples.
pub fn interval_path(path: &Path, samples: u32) -> PathBuf {
    let mut name = OsString::from(path.file_stem().unwrap_or_default());
    name.push(format!(".{samples:04}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// A film's sums as channels of an image; `names` are those of its values.
pub fn state_channels(state: &FilmState, names: &[&str]) -> Vec<Channel> {
    let channel = |name: &str, samples| Channel { name: format!("{LAYER}.{name}"), samples };
    let mut out: Vec<Channel> = words(names)
        .iter()
        .enumerate()
        .map(|(k, word)| {
            let plane = state.plane(k);
            channel(
                &word.name,
                match word.float {
                    true => Samples::F32(plane.into_iter().map(f32::from_bits).collect()),
                    false => Samples::U32(plane),
                },
            )
        })
        .collect();
    out.push(channel("samples", Samples::U32(state.samples_plane())));
    out
}

/// A film that is gone on with.
pub struct Resumed {
    /// Its sums.
    pub state: FilmState,
    /// Something to know that is no failure.
    pub warning: Option<String>,
}

/// Reads the film that `--resume` names, if it does, for an image of `size` pixels, whose values are called `names`, with `spp` samples in all.
/// `identity` is that of this run, `maker` its tracer and its device.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read or has no film; [`Error::Usage`], naming what differs, for one that another run
/// has begun, and for one that has more samples already.
pub fn resume(
    args: &RenderArgs,
    names: &[&str],
    size: [u32; 2],
    spp: u32,
    identity: &Identity,
    maker: &Maker,
) -> Result<Option<Resumed>> {
    let Some(path) = &args.film.resume else { return Ok(None) };
    let image = output::exr::read(path)?;
    let state = read_state(&image, names);
    if matches!(state, Read::Nothing) {
        return Err(Error::input(path, "there is no film in it to go on with; render it with --resumable"));
    }
    let differs = |what: &str, its: &str, ours: &str| {
        Error::Usage(format!(
            "--resume {}: its {what} is {its}, this run's is {ours}; a film goes on only as it was begun",
            path.display()
        ))
    };
    if let Some((key, its, ours)) = difference(&image, identity, &args.scene) {
        return Err(differs(&key, &its, &ours));
    }
    if [image.width, image.height] != size {
        let text = |[w, h]: [u32; 2]| format!("{w}x{h}");
        return Err(differs("size", &text([image.width, image.height]), &text(size)));
    }
    let Read::State(state) = state else {
        return Err(Error::input(path, "its film is damaged; render it anew with --resumable"));
    };
    if state.most_samples() > spp {
        return Err(Error::Usage(format!(
            "--spp {spp}: {} has {} samples per pixel already; ask for as many at least",
            path.display(),
            state.most_samples()
        )));
    }
    let other = maker.iter().find(|(key, ours)| image.metadata(key) != Some(ours.as_str()));
    let warning = other.map(|(key, ours)| {
        format!(
            "{} was begun with {key} {}, and goes on with {ours}: as right as any, but not bit for bit what one run would give",
            path.display(),
            image.metadata(key).unwrap_or("unknown")
        )
    });
    Ok(Some(Resumed { state, warning }))
}

/// The first key that differs, and both values.
fn difference(image: &Image, identity: &Identity, scene: &str) -> Option<(String, String, String)> {
    let (key, ours) = identity.iter().find(|(key, ours)| image.metadata(key) != ours.as_deref())?;
    let its = image.metadata(key);
    let Some(named) = key.strip_suffix(HASH) else {
        let text = |value: Option<&str>| value.unwrap_or("none").to_owned();
        return Some((key.replace('_', " "), text(its), text(ours.as_deref())));
    };
    // the contents differ; the names may, too
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

/// What there is of a film in an image.
enum Read {
    Nothing,
    Damaged,
    State(FilmState),
}

fn read_state(image: &Image, names: &[&str]) -> Read {
    if !image.channels.iter().any(|c| c.name.strip_prefix(LAYER).is_some_and(|rest| rest.starts_with('.'))) {
        return Read::Nothing;
    }
    let find = |name: &str| image.channels.iter().find(|c| c.name == format!("{LAYER}.{name}")).map(|c| &c.samples);
    let mut planes = Vec::with_capacity(record_words(names.len()));
    for word in words(names) {
        match (find(&word.name), word.float) {
            (Some(Samples::F32(plane)), true) => planes.push(plane.iter().map(|v| v.to_bits()).collect()),
            (Some(Samples::U32(plane)), false) => planes.push(plane.clone()),
            _ => return Read::Damaged,
        }
    }
    let Some(Samples::U32(samples)) = find("samples") else { return Read::Damaged };
    let state = FilmState::from_planes([image.width, image.height], names.len(), &planes, samples);
    state.map_or(Read::Damaged, Read::State)
}

/// Connects long work to the keyboard, and saves it on its way.
pub struct Saver<'a> {
    /// Where progress is shown, and who may stop it.
    pub keyboard: ProgressControl,
    /// Writes an image that is not finished.
    pub save: &'a mut dyn FnMut(&Accumulated) -> Result<()>,
}

impl Control for Saver<'_> {
    fn progress(&mut self, done: u64, total: u64) {
        self.keyboard.progress(done, total);
    }

    fn interval(&mut self, image: &Accumulated) -> Result<()> {
        (self.save)(image)
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.keyboard.should_stop()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_intervals() {
        let of = |path: &str, n: u32| interval_path(path.as_ref(), n).to_string_lossy().into_owned();
        assert_eq!(of("out/a.exr", 16), "out/a.0016.exr");
        assert_eq!(of("a.b.png", 65536), "a.b.65536.png");
    }

    #[test]
    fn what_differs_is_named() {
        let metadata = [("seed", "1"), ("scene", "a.glb"), ("scene.hash", "0123456789abcdef"), ("rr_depth", "5")];
        let image = Image { metadata: metadata.map(|(k, v)| (k.to_owned(), v.to_owned())).to_vec(), ..Default::default() };
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
