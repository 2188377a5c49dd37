//! `frames.toml`: which frames there are, how they are rendered, and what may differ.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use super::baked::BakedFrame;
use super::tolerance::Tolerance;
use crate::error::{Error, Result};
use crate::files::plan::FilePlan;
use crate::integrators::lighting::LightingSettings;
use crate::renderer::RenderSettings;
use crate::scene::builtin;
use crate::scene::load::{Confine, GeometryOptions, LoadOptions, Projection, UpAxis, confine};
use crate::tracer::TracerKind;

/// Name of the manifest in its folder.
pub const NAME: &str = "frames.toml";
/// A manifest of one frame, in a line.
const EXAMPLE: &str =
    r#"frame = [{ name = "hall", scene = "hall.glb", render = "ao --size 96x64 --spp 64", tolerance = "z_test" }]"#;
/// Maximum of frames rendered for one comparison: a stranger's manifest is not to run for years.
const MAX_FRAMES: u64 = 10_000;
/// The prefix of scenes that are no files.
const BUILTIN: &str = "builtin:";

/// The manifest of a folder of frames.
#[derive(Clone, Debug)]
pub struct Manifest {
    /// The folder: golden images lie there.
    pub folder: PathBuf,
    /// Drivers of golden images: beginnings of `DRIVER` as `skylit doctor` prints it.
    pub pinned: Vec<String>,
    /// The frames, in the order of the file.
    pub frames: Vec<Frame>,
    /// The folder without links that all files have to lie below; `None`: they may lie anywhere.
    pub confine: Option<PathBuf>,
}

#[derive(Clone, Debug)]
pub struct Frame {
    /// The name of its golden image without the extension.
    pub name: String,
    /// The scene: `builtin:NAME`, or a path from the folder.
    pub scene: String,
    /// Which scene of a glTF file, by its name or number; `None`: the one that the file names.
    pub gltf_scene: Option<String>,
    /// Normals and texture coordinates that are not the file's.
    pub geometry: GeometryOptions,
    pub settings_file: Option<PathBuf>,
    /// The settings; files are paths from the folder. [`Manifest::settings`] has them as they are.
    pub settings: RenderSettings,
    /// The map that is baked in place of a render, if it is one.
    pub baked: Option<BakedFrame>,
    pub tracers: Tracers,
    /// The differences that are allowed.
    pub tolerance: Tolerance,
    pub format: GoldenFormat,
    /// Drivers on which it is rendered, as in [`Manifest::pinned`]; all if empty.
    pub drivers: Vec<String>,
    /// Line of the manifest at which it begins.
    pub line: usize,
    /// Why it cannot be rendered, with the line in the manifest; other fields are then incomplete.
    pub problem: Option<String>,
}

/// Which tracers render a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tracers {
    /// The one that suits the device.
    Auto,
    /// All that the device supports.
    All,
    /// These, as far as the device supports them.
    Some(Vec<TracerKind>),
}

/// Format of a golden image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GoldenFormat {
    /// OpenEXR: linear values, and what a Z-test needs to know of noise.
    #[default]
    Exr,
    /// PNG: the picture, tone mapped, 8 bits.
    Png,
}

impl GoldenFormat {
    /// The extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Png => "png",
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    drivers: Drivers,
    #[serde(default)]
    defaults: Defaults,
    #[serde(default)]
    frame: Vec<Spanned<Entry>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Drivers {
    #[serde(default)]
    pinned: Vec<String>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Defaults {
    render: Option<Spanned<String>>,
    tracers: Option<Spanned<Vec<String>>>,
    tolerance: Option<Tolerance>,
    golden: Option<GoldenFormat>,
    drivers: Option<Vec<String>>,
}

/// The value of `normals`: a word, or an angle in degrees.
#[derive(Deserialize)]
#[serde(untagged)]
enum Normals {
    Word(String),
    Angle(f64),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Spanned<String>,
    scene: Spanned<String>,
    gltf_scene: Option<Spanned<String>>,
    normals: Option<Spanned<Normals>>,
    uv: Option<Spanned<String>>,
    up_axis: Option<Spanned<String>>,
    render: Option<Spanned<String>>,
    bake: Option<Spanned<String>>,
    settings: Option<Spanned<PathBuf>>,
    tracers: Option<Spanned<Vec<String>>>,
    tolerance: Option<Tolerance>,
    golden: Option<GoldenFormat>,
    drivers: Option<Vec<String>>,
}

/// A manifest's text and where it is, for messages that name a line.
struct Source<'a> {
    path: &'a Path,
    line_ends: Vec<usize>,
    /// Settings by the words that they were parsed from: most frames have the same.
    parsed: RefCell<BTreeMap<String, RenderSettings>>,
    /// [`Manifest::confine`].
    confine: Option<&'a Path>,
}

impl<'a> Source<'a> {
    fn new(path: &'a Path, text: &str, confine: Option<&'a Path>) -> Self {
        let line_ends = text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(at, _)| at).collect();
        Self { path, line_ends, parsed: RefCell::default(), confine }
    }

    fn line(&self, at: usize) -> usize {
        1 + self.line_ends.partition_point(|end| *end < at)
    }

    /// Parses options of `skylit render`.
    fn parse(&self, words: &Spanned<String>) -> Result<RenderSettings> {
        if let Some(settings) = self.parsed.borrow().get(words.get_ref()) {
            return Ok(settings.clone());
        }
        let settings = RenderSettings::from_words(words.get_ref()).map_err(|e| self.error(words.span(), e))?;
        self.parsed.borrow_mut().insert(words.get_ref().clone(), settings.clone());
        Ok(settings)
    }

    fn error(&self, span: Range<usize>, message: impl std::fmt::Display) -> Error {
        Error::input(self.path, format!("line {}: {message}", self.line(span.start)))
    }

    /// Checks that a file that the manifest names lies where it has to.
    fn check_confined(&self, span: Range<usize>, path: &Path) -> Result<()> {
        let Some(folder) = self.confine else { return Ok(()) };
        confine::check(folder, self.path, path).map_err(|e| match e {
            Error::Input { message, .. } => self.error(span, message),
            other => other,
        })
    }
}

impl Manifest {
    /// Reads the manifest of a folder. A mistake in one frame is a problem of that frame alone.
    ///
    /// # Errors
    /// [`Error::Input`], naming the line, for a file that cannot be read or is no manifest.
    pub fn load(folder: &Path) -> Result<Self> {
        Self::load_with(folder, false)
    }

    /// As [`Manifest::load`]. `confine`: frames with files outside of the folder are not read,
    /// which is their problem.
    ///
    /// # Errors
    /// As [`Manifest::load`], and for a manifest that lies elsewhere.
    pub fn load_with(folder: &Path, confine: bool) -> Result<Self> {
        let path = folder.join(NAME);
        let confine =
            if confine { Some(std::fs::canonicalize(folder).map_err(|e| Error::read(folder, &e))?) } else { None };
        if let Some(confine) = &confine {
            confine::check(confine, &path, &path)?;
        }
        let text = crate::files::read_regular_text(&path).map_err(|e| match e.kind() {
            ErrorKind::NotFound => {
                Error::input(&path, format!("no such file: it lists the frames, such as {EXAMPLE} (docs/guide/ci.md)"))
            }
            _ => Error::read(&path, &e),
        })?;
        if let Some(message) = crate::files::placeholder(text.as_bytes()).filter(|_| !text.is_empty()) {
            return Err(Error::input(&path, message));
        }
        let source = Source::new(&path, &text, confine.as_deref());
        let file: File = toml::from_str(&text).map_err(|e| match e.span() {
            Some(span) => source.error(span, e.message()),
            None => Error::input(&path, e.message()),
        })?;
        let defaults = &file.defaults;
        let mut frames: Vec<Frame> = file.frame.iter().map(|entry| frame(&source, folder, defaults, entry)).collect();
        if frames.is_empty() {
            return Err(Error::input(
                &path,
                "it has no frames: add a [[frame]] with name, scene, render and tolerance",
            ));
        }
        let mut names = BTreeSet::new();
        for (frame, entry) in frames.iter_mut().zip(&file.frame) {
            // file systems that ignore case keep one of two such images
            if !names.insert(frame.name.to_lowercase()) {
                let span = entry.get_ref().name.span();
                let message = format!("two frames are called {}: the first one is rendered", frame.name);
                frame.problem = Some(source.error(span, message).to_string());
            }
        }
        Ok(Self { folder: folder.to_owned(), pinned: file.drivers.pinned, frames, confine })
    }

    /// The file of a frame's golden image.
    pub fn golden(&self, frame: &Frame) -> PathBuf {
        self.folder.join(format!("{}.{}", frame.name, frame.format.extension()))
    }

    /// Checks that no link leads a golden image outside of the folder, where it would be written.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the link.
    pub fn check_golden(&self, frame: &Frame) -> Result<()> {
        let path = self.golden(frame);
        if !path.is_symlink() {
            return Ok(());
        }
        let folder = std::fs::canonicalize(&self.folder).map_err(|e| Error::read(&self.folder, &e))?;
        let target = crate::files::link_target(&path).map_err(|e| Error::write(&path, &e))?;
        // of a file that does not exist yet, where it would be
        let place = std::fs::canonicalize(&target).or_else(|_| std::fs::canonicalize(crate::files::folder_of(&target)));
        if place.is_ok_and(|place| place.starts_with(&folder)) {
            Ok(())
        } else {
            Err(Error::Usage(format!(
                "{}: is a link to {}, outside of the manifest's folder, where no golden image is written: remove the link",
                path.display(),
                target.display()
            )))
        }
    }

    /// The files that frames are rendered from, and with `goldens` their golden images.
    pub fn add_inputs(&self, plan: &mut FilePlan, goldens: bool) {
        plan.reads("the manifest", self.folder.join(NAME));
        for frame in &self.frames {
            let settings = self.settings(frame);
            let baked = self.baked(frame);
            let of_light_map = baked.as_ref().and_then(|baked| baked.options.lighting.environment_file());
            of_light_map.iter().for_each(|path| plan.reads_images("an environment", path));
            if !frame.scene.starts_with(BUILTIN) {
                plan.reads("a scene", self.scene(frame));
            }
            frame.settings_file.iter().for_each(|path| plan.reads("a file of settings", path));
            settings.lighting.environment_file().iter().for_each(|path| plan.reads_images("an environment", path));
            settings.frames.camera_path.iter().for_each(|path| plan.reads("a camera path", path));
            if goldens {
                plan.reads("a golden image", self.golden(frame));
            }
        }
    }

    /// The scene of a frame, as [`crate::Renderer::open`] takes it.
    pub fn scene(&self, frame: &Frame) -> String {
        if frame.scene.starts_with(BUILTIN) {
            frame.scene.clone()
        } else {
            self.folder.join(&frame.scene).to_string_lossy().into_owned()
        }
    }

    /// The settings of a frame, with files that it names found from the folder.
    pub fn settings(&self, frame: &Frame) -> RenderSettings {
        let mut settings = frame.settings.clone();
        self.find_environment(&mut settings.lighting);
        if let Some(path) = &mut settings.frames.camera_path {
            *path = self.folder.join(&*path);
        }
        settings
    }

    /// The map that a frame is, with files that it names found from the folder.
    pub fn baked(&self, frame: &Frame) -> Option<BakedFrame> {
        let mut baked = frame.baked.clone()?;
        self.find_environment(&mut baked.options.lighting);
        Some(baked)
    }

    /// Has an environment's file be found from the folder.
    fn find_environment(&self, lighting: &mut LightingSettings) {
        let environment = lighting.environment_file().map(|path| self.folder.join(path));
        if let Some(path) = environment.filter(|path| path.exists()) {
            lighting.environment = Some(path.to_string_lossy().into_owned());
        }
    }

    /// Images in the folder that are no frame's.
    pub fn orphans(&self) -> Vec<PathBuf> {
        let known: BTreeSet<PathBuf> = self.frames.iter().map(|f| self.golden(f)).collect();
        let is_image = |p: &PathBuf| p.extension().is_some_and(|e| e == "exr" || e == "png");
        let files = std::fs::read_dir(&self.folder).into_iter().flatten().flatten().map(|f| f.path());
        let mut orphans: Vec<_> = files.filter(|p| is_image(p) && !known.contains(p)).collect();
        orphans.sort();
        orphans
    }
}

impl Frame {
    /// The command that makes it: `skylit render` or `skylit bake`.
    pub fn command(&self) -> &'static str {
        if self.baked.is_some() { "bake" } else { "render" }
    }

    /// The settings as options of that command; the seed is left out where any will do.
    pub fn render_text(&self) -> String {
        let mut settings = self.settings.clone();
        if self.tolerance.allows_other_seeds() {
            settings.image.seed = None;
        }
        let load = self.load_options(Confine::Nowhere).flags();
        let quoted = |word: String| shlex::try_quote(&word).map_or_else(|_| word.clone(), |quoted| quoted.into_owned());
        let own = match &self.baked {
            Some(baked) => vec![baked.words.clone()],
            None => settings.flags(),
        };
        load.into_iter().map(quoted).chain(own).collect::<Vec<_>>().join(" ")
    }

    /// How its scene is loaded. `confine`: where the files must lie that it refers to.
    pub fn load_options<'a>(&'a self, confine: Confine<'a>) -> LoadOptions<'a> {
        let (scene, geometry) = (self.gltf_scene.as_deref(), self.geometry);
        LoadOptions { confine, scene, geometry, ..LoadOptions::default() }
    }

    /// Whether it is rendered on this driver.
    pub fn is_for(&self, driver: &str) -> bool {
        self.drivers.is_empty() || names_driver(&self.drivers, driver)
    }
}

/// Does one of these beginnings name the driver? `llvmpipe Mesa 25.0` names `llvmpipe Mesa 25.0.7`,
/// and not `llvmpipe Mesa 25.01`.
pub fn names_driver(beginnings: &[String], driver: &str) -> bool {
    let names = |beginning: &String| {
        driver
            .strip_prefix(beginning.as_str())
            .is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_alphanumeric()))
    };
    beginnings.iter().any(names)
}

fn frame(source: &Source, folder: &Path, defaults: &Defaults, entry: &Spanned<Entry>) -> Frame {
    let (span, entry) = (entry.span(), entry.get_ref());
    let mut frame = Frame {
        name: one_line(entry.name.get_ref()),
        scene: entry.scene.get_ref().clone(),
        gltf_scene: entry.gltf_scene.as_ref().map(|scene| scene.get_ref().clone()),
        geometry: GeometryOptions::default(),
        settings_file: entry.settings.as_ref().map(|file| folder.join(file.get_ref())),
        settings: RenderSettings::default(),
        baked: None,
        tracers: Tracers::Auto,
        tolerance: entry.tolerance.or(defaults.tolerance).unwrap_or_default(),
        format: entry.golden.or(defaults.golden).unwrap_or_default(),
        drivers: entry.drivers.clone().or_else(|| defaults.drivers.clone()).unwrap_or_default(),
        line: source.line(span.start),
        problem: None,
    };
    if let Err(e) = complete(&mut frame, source, folder, defaults, (span, entry)) {
        frame.problem = Some(e.to_string());
    }
    frame
}

/// The normals and texture coordinates that an entry asks for.
fn geometry(source: &Source, entry: &Entry) -> Result<GeometryOptions> {
    let mut geometry = GeometryOptions::default();
    if let Some(normals) = &entry.normals {
        let text = match normals.get_ref() {
            Normals::Word(word) => word.clone(),
            Normals::Angle(degrees) => degrees.to_string(),
        };
        geometry.normals = text.parse().map_err(|e| source.error(normals.span(), format!("normals = {text}: {e}")))?;
    }
    if let Some(uv) = &entry.uv {
        let projection = Projection::ALL.into_iter().find(|p| p.name() == uv.get_ref());
        let names = || Projection::ALL.map(Projection::name).join(", ");
        let unknown = || source.error(uv.span(), format!("uv = {}: one of {} expected", uv.get_ref(), names()));
        geometry.uv = Some(projection.ok_or_else(unknown)?);
    }
    if let Some(up) = &entry.up_axis {
        let axis = UpAxis::ALL.into_iter().find(|axis| axis.name() == up.get_ref());
        let unknown = || source.error(up.span(), format!("up_axis = {}: y or z expected", up.get_ref()));
        geometry.up = axis.ok_or_else(unknown)?;
    }
    Ok(geometry)
}

/// Reads what may be wrong with a frame.
fn complete(
    frame: &mut Frame,
    source: &Source,
    folder: &Path,
    defaults: &Defaults,
    (span, entry): (Range<usize>, &Entry),
) -> Result<()> {
    let name = entry.name.get_ref();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    if name.is_empty() || name.len() > 100 || name.starts_with('.') || !name.chars().all(is_plain) {
        let message = format!("the name {name:?} is no file name: use up to 100 letters, digits, - and _");
        return Err(source.error(entry.name.span(), message));
    }
    check_scene(source, folder, &entry.scene)?;
    if let Some(chosen) = entry.gltf_scene.as_ref().filter(|_| !is_gltf(&frame.scene)) {
        return Err(
            source.error(chosen.span(), format!("gltf_scene: {} is no glTF file, which may have several", frame.scene))
        );
    }
    frame.geometry = geometry(source, entry)?;
    match &entry.bake {
        Some(words) => frame.baked = Some(baked(source, entry, words)?),
        None => frame.settings = settings(source, folder, defaults, entry)?,
    }
    let golden = folder.join(format!("{}.{}", frame.name, frame.format.extension()));
    let lighting = frame.baked.as_ref().map_or(&frame.settings.lighting, |baked| &baked.options.lighting);
    let environment = lighting.environment_file();
    let named = environment.iter().chain(&frame.settings.frames.camera_path).map(|path| folder.join(path));
    named.chain([golden]).try_for_each(|path| source.check_confined(span.clone(), &path))?;
    let tracers = entry.tracers.as_ref().or(defaults.tracers.as_ref());
    if let Some(names) = tracers {
        frame.tracers = parse_tracers(names.get_ref()).map_err(|e| source.error(names.span(), e))?;
    }
    if entry.tolerance.or(defaults.tolerance).is_none() {
        let message =
            format!("{name} has no tolerance: add one, such as tolerance = \"z_test\", to it or to [defaults]");
        return Err(source.error(span, message));
    }
    check(frame).map_err(|message| source.error(span, format!("{name}: {message}")))
}

/// Whether a scene is a glTF file, by its name.
fn is_gltf(scene: &str) -> bool {
    let extension = Path::new(scene).extension();
    extension.is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"))
}

/// A name with spaces in place of what would break a line.
fn one_line(name: &str) -> String {
    name.replace(char::is_control, " ")
}

fn check_scene(source: &Source, folder: &Path, name: &Spanned<String>) -> Result<()> {
    if let Some(builtin) = name.get_ref().strip_prefix(BUILTIN) {
        return if builtin::exists(builtin) {
            Ok(())
        } else {
            Err(source.error(name.span(), format!("no built-in scene {builtin} (`skylit scenes` lists them)")))
        };
    }
    let path = folder.join(name.get_ref());
    source.check_confined(name.span(), &path)?;
    if path.is_file() {
        Ok(())
    } else {
        Err(source.error(name.span(), format!("no scene {}: paths begin at the manifest's folder", path.display())))
    }
}

/// The settings of a frame: a file's, replaced by words of `[defaults]`, and those by the frame's.
fn settings(source: &Source, folder: &Path, defaults: &Defaults, entry: &Entry) -> Result<RenderSettings> {
    let mut settings = RenderSettings::default();
    if let Some(file) = &entry.settings {
        source.check_confined(file.span(), &folder.join(file.get_ref()))?;
        let load = RenderSettings::load(&folder.join(file.get_ref()));
        settings = load.map_err(|e| source.error(file.span(), e))?;
    }
    for words in [&defaults.render, &entry.render].into_iter().flatten() {
        settings = settings.overridden_by(&source.parse(words)?);
    }
    let span = entry.render.as_ref().map_or(entry.name.span(), Spanned::span);
    settings.check().map_err(|e| source.error(span, e))?;
    Ok(settings)
}

/// The map that a frame is in place of a render.
fn baked(source: &Source, entry: &Entry, words: &Spanned<String>) -> Result<BakedFrame> {
    if entry.render.is_some() || entry.settings.is_some() {
        let message = "bake: a frame is baked or rendered: leave render and settings out, or bake";
        return Err(source.error(words.span(), message));
    }
    BakedFrame::parse(words.get_ref()).map_err(|e| source.error(words.span(), e))
}

/// Parses names of tracers: `auto`, `all`, or some of them.
///
/// # Errors
/// A sentence for a name that is none.
pub fn parse_tracers<T: AsRef<str>>(names: &[T]) -> std::result::Result<Tracers, String> {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names[..] {
        ["auto"] => return Ok(Tracers::Auto),
        ["all"] => return Ok(Tracers::All),
        [] => return Err("no tracer: choose auto, all, or some of pipeline, query, compute".into()),
        _ => {}
    }
    let kind = |name: &&str| TracerKind::ALL.into_iter().find(|k| k.name() == *name).ok_or_else(|| (*name).to_owned());
    let kinds = names.iter().map(kind).collect::<std::result::Result<Vec<_>, _>>();
    kinds
        .map(Tracers::Some)
        .map_err(|name| format!("unknown tracer {name}: choose auto, all, or some of pipeline, query, compute"))
}

/// Conditions on more than one key.
fn check(frame: &Frame) -> std::result::Result<(), String> {
    let (tolerance, settings) = (&frame.tolerance, &frame.settings);
    let wrong = |text: &str| Err(text.to_owned());
    if settings.image.time_limit.is_some() {
        return wrong("--time-limit makes a different image on each machine: use --spp");
    }
    if settings.film.resume.is_some() || settings.film.keeps_state() {
        return wrong("--resume, --resumable and --intervals are for long renders: leave them out");
    }
    if settings.frames.show.is_some() {
        return wrong("--show has no effect here: a frame's ambient visibility is compared");
    }
    let frames = settings.frames.frames.map_or(1, |range| u64::from(range.end - range.first));
    if frames + u64::from(settings.frames.warm_up.unwrap_or(0)) + u64::from(settings.frames.lead_in.unwrap_or(0))
        > MAX_FRAMES
    {
        return Err(format!(
            "the last of its frames is compared, and up to {MAX_FRAMES} are rendered for it: use fewer --frames or less --warm-up"
        ));
    }

    // a Z-test needs to know the noise
    if tolerance.z_test.is_none() {
        return Ok(());
    }
    if frame.format == GoldenFormat::Png {
        return wrong("a PNG has no variances, which a Z-test needs: leave golden = \"png\" out, or use flip");
    }
    if let Some(fault) = frame.baked.as_ref().and_then(BakedFrame::fault_of_z_test) {
        return wrong(fault);
    }
    if let Some(setting) = settings.realtime_setting() {
        return Err(format!(
            "{} selects frames in real time, which have no variances for a Z-test: use flip",
            setting.option()
        ));
    }
    if settings.image.denoise.is_some() {
        return wrong("the noise of a denoised image is unknown to a Z-test: use flip");
    }
    if settings.image.spp.is_some_and(|n| n < 2) {
        return wrong("a Z-test needs at least 2 samples per pixel, to know their variance");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_is_a_manifest() {
        let dir = tempfile::tempdir().unwrap();
        let error = Manifest::load(dir.path()).map(drop).unwrap_err().to_string();
        assert!(error.contains(EXAMPLE), "{error}");
        std::fs::write(dir.path().join(NAME), EXAMPLE.replace("hall.glb", "builtin:plane")).unwrap();
        let frames = Manifest::load(dir.path()).unwrap().frames;
        assert!(frames.len() == 1 && frames[0].tolerance.z_test.is_some(), "{frames:?}");
    }

    /// Normals and texture coordinates are keys of a frame, and options of its command.
    #[test]
    fn normals_and_texture_coordinates_are_chosen() {
        let dir = tempfile::tempdir().unwrap();
        let frame = |keys: &str| {
            let text = EXAMPLE.replace("scene = \"hall.glb\"", &format!("scene = \"builtin:plane\", {keys}"));
            std::fs::write(dir.path().join(NAME), text).unwrap();
            Manifest::load(dir.path()).map(|manifest| manifest.frames[0].clone())
        };
        for (keys, options) in [
            ("normals = \"flat\"", "--normals flat "),
            ("normals = \"smooth\", uv = \"box\"", "--normals smooth --uv box "),
            ("up_axis = \"z\"", "--up-axis z "),
            ("normals = 30", "--normals 30 "),
            ("normals = 30.5", "--normals 30.5 "),
            ("normals = \"file\"", "--integrator ao "),
        ] {
            let frame = frame(keys).unwrap();
            assert!(frame.problem.is_none() && frame.render_text().starts_with(options), "{keys}: {frame:?}");
        }
        for (keys, why) in [
            ("normals = \"round\"", "line 1: normals = round: file, flat, smooth or an angle from 0 to 180 degrees"),
            ("normals = 181", "line 1: normals = 181: file, flat"),
            ("up_axis = \"x\"", "line 1: up_axis = x: y or z expected"),
            ("uv = \"planar\"", "line 1: uv = planar: one of spherical, cylindrical, box expected"),
        ] {
            let problem = frame(keys).unwrap().problem.unwrap();
            assert!(problem.contains(why), "{keys}: {problem}");
        }
        assert!(frame("uv = true").unwrap_err().to_string().contains("line 1"));
    }

    /// A frame may be baked in place of rendered, by options of its own.
    #[test]
    fn baked_maps_are_frames() {
        let dir = tempfile::tempdir().unwrap();
        let frame = |keys: &str| {
            let text = format!("frame = [{{ name = \"a\", scene = \"builtin:plane\", {keys} }}]");
            std::fs::write(dir.path().join(NAME), text).unwrap();
            Manifest::load(dir.path()).unwrap().frames[0].clone()
        };
        let sound = frame("bake = \"--map ao  --size 64\", uv = \"box\", tolerance = \"z_test\"");
        assert_eq!((sound.problem.as_ref(), sound.command()), (None, "bake"));
        assert_eq!(sound.render_text(), "--uv box --map ao --size 64");
        for (keys, why) in [
            ("bake = \"\", render = \"ao\"", "line 1: bake: a frame is baked or rendered"),
            ("bake = \"--map lights\"", "line 1: \"--map lights\": "),
            ("bake = \"--map light\", tolerance = \"z_test\"", "only ao and thickness have variances"),
            ("bake = \"\", golden = \"png\", tolerance = \"z_test\"", "a PNG has no variances"),
            ("bake = \"\"", "a has no tolerance"),
        ] {
            let problem = frame(keys).problem.unwrap();
            assert!(problem.contains(why), "{keys}: {problem}");
        }
    }

    #[test]
    fn a_scene_of_a_gltf_file_is_chosen() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("hall.glb"), "").unwrap();
        let text = EXAMPLE.replace("scene = \"hall.glb\"", "scene = \"hall.glb\", gltf_scene = \"at night\"");
        std::fs::write(dir.path().join(NAME), text.replace("--spp 64", "--spp 64 --variant red")).unwrap();
        let frames = Manifest::load(dir.path()).unwrap().frames;
        assert_eq!((frames[0].problem.as_ref(), frames[0].gltf_scene.as_deref()), (None, Some("at night")));
        let render = frames[0].render_text();
        assert!(render.starts_with("--gltf-scene 'at night' ") && render.contains("--variant red"), "{render}");

        // no other format has several
        std::fs::write(dir.path().join(NAME), text.replace("hall.glb", "builtin:plane")).unwrap();
        let problem = Manifest::load(dir.path()).unwrap().frames[0].problem.clone().unwrap();
        assert!(problem.contains("line 1: gltf_scene: builtin:plane is no glTF file"), "{problem}");
    }
}
