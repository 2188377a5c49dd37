//! `skylit compare`: images, or renders made on the spot, against a reference.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum, ValueHint};
use serde_json::json;

use super::args::LoadArgs;
use super::compare_ao::{self, AoVsPathArgs};
use crate::compare::picture::{self, PictureKind};
use crate::compare::render::{self, Rendered};
use crate::compare::{Entry, ImageSet, MAX_IMAGES, check_count, letter, page, parse_letter, short_names};
use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::film::Control;
use crate::integrators::IntegratorSettings;
use crate::integrators::lighting::LightingSettings;
use crate::measure::comparison::{CompareOptions, Comparison};
use crate::measure::mask::MaskOptions;
use crate::memory::Budget;
use crate::output::{self, Image};
use crate::realtime::frame_settings::FrameSettings;
use crate::renderer::RenderSettings;
use crate::renderer::settings::{CameraSettings, ImageSettings};
use crate::report;
use crate::scene::SceneSettings;
use crate::settings::parse::Parsed;
use crate::terminal::console::{Console, Failure, Verbosity, command_line, one_line};
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::terminal::warnings::Warnings;
use crate::tracer::DeviceSettings;

/// Which pixels are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Mask {
    /// Those that at least one of the two images covers, where both have the channel A
    Covered,
    /// All
    All,
}

const EXAMPLES: &str = "\
Examples:
  skylit compare ao.exr path.exr
  skylit compare --scene scene.glb --a \"ao --spp 16\" --b \"ao-sky --spp 256\" --size 640x360 --html report
  skylit compare ao-vs-path scene.glb
  skylit compare golden.exr --scene scene.glb --a balanced --flip flip.png";

/// Comparisons that are not of images by letters.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum OtherComparison {
    /// Find the radius, falloff and colour with which ambient occlusion is closest to path tracing
    ///
    /// It also says how far apart the two still are.
    AoVsPath(Box<AoVsPathArgs>),
}

/// `skylit compare`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES, args_conflicts_with_subcommands = true)]
pub struct CompareArgs {
    /// Another kind of comparison.
    #[command(subcommand)]
    pub comparison: Option<OtherComparison>,
    /// Images (.exr, .png, .jpg, .webp): A, which is judged, then B, the reference
    ///
    /// C and more are judged, too. Images of --a, --b and --c take their letters first.
    #[arg(value_name = "IMAGE", value_hint = ValueHint::FilePath)]
    pub images: Vec<PathBuf>,
    /// Scene to render: a .gltf, .glb, .obj or .brhan file, or builtin:NAME
    ///
    /// Options of `skylit render` beside it apply to each render that they have an effect on.
    #[arg(long, value_name = "SCENE", value_hint = ValueHint::FilePath)]
    pub scene: Option<String>,
    /// Render image A of --scene: an integrator or a preset, then options of `skylit render`
    ///
    /// Examples are "ao --ao-radius 2" and "balanced --history 16". A preset of frames in real time
    /// alone is shown at rest, when histories are full, and its first frame besides, as another
    /// image.
    #[arg(long, value_name = "RENDER", requires = "scene", allow_hyphen_values = true)]
    pub a: Option<String>,
    /// Render image B, like --a
    #[arg(long, value_name = "RENDER", requires = "scene", allow_hyphen_values = true)]
    pub b: Option<String>,
    /// Render another image, C and so on, like --a; may be repeated
    #[arg(long, value_name = "RENDER", requires = "scene", allow_hyphen_values = true)]
    pub c: Vec<String>,
    /// The image that the others are compared with, by its letter
    #[arg(long, value_name = "LETTER", value_parser = parse_letter_argument, default_value = "B")]
    pub reference: usize,
    /// Pixels to compare
    #[arg(long, value_enum, hide_short_help = true, default_value = "covered")]
    pub mask: Mask,
    /// Compare only pixels of this rectangle: left, top, width and height in pixels
    #[arg(long, value_name = "X,Y,W,H", hide_short_help = true, value_parser = parse_rectangle)]
    pub rectangle: Option<[u32; 4]>,
    /// Compare only pixels that show this instance, by its number
    ///
    /// It is the channel id.instance of the reference, or of the image; renders get it.
    #[arg(long, value_name = "N", hide_short_help = true)]
    pub instance: Option<u32>,
    /// Channels to compare, separated by commas: depth.Z,Ng.X [default: the colour channels]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub channels: Vec<String>,
    /// Write the signed difference from the reference as a picture with a legend
    ///
    /// Of several images it writes NAME.a.png, NAME.c.png.
    #[arg(long, value_name = "FILE.png", value_hint = ValueHint::FilePath)]
    pub difference: Option<PathBuf>,
    /// Write the FLIP map as a picture with a legend, named as those of --difference
    #[arg(long, value_name = "FILE.png", value_hint = ValueHint::FilePath)]
    pub flip: Option<PathBuf>,
    /// Write a report into this folder: a page that needs no network
    ///
    /// It has all images, differences and numbers.
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub html: Option<PathBuf>,
    /// Write all numbers into a table, a row for each image that is compared with the reference
    #[arg(long, value_name = "FILE.csv", value_hint = ValueHint::FilePath)]
    pub csv: Option<PathBuf>,
    /// Save the renders into this folder, as a.exr, b.exr, ...
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, requires = "scene")]
    pub save: Option<PathBuf>,
    /// The image.
    #[command(flatten)]
    pub image: ImageSettings,
    /// Files of the scene.
    #[command(flatten)]
    pub load: LoadArgs,
    /// Meaning of the scene's file.
    #[command(flatten)]
    pub meaning: SceneSettings,
    /// The camera.
    #[command(flatten)]
    pub camera: CameraSettings,
    /// Settings of integrators.
    #[command(flatten)]
    pub integrators: IntegratorSettings,
    /// Light besides the scene's.
    #[command(flatten)]
    pub lighting: LightingSettings,
    /// Settings of real-time frames.
    #[command(flatten)]
    pub frames: FrameSettings,
    /// Device and tracer
    #[command(flatten)]
    pub device: DeviceSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

fn parse_letter_argument(text: &str) -> Parsed<usize> {
    parse_letter(text)
}

fn parse_rectangle(text: &str) -> Parsed<[u32; 4]> {
    let expected = || "expected X,Y,WIDTH,HEIGHT in pixels, like 10,20,64,48".to_owned();
    let numbers = text.split(',').map(|n| n.trim().parse().map_err(|_| expected())).collect::<Result<Vec<u32>, _>>()?;
    let rectangle: [u32; 4] = numbers.try_into().map_err(|_| expected())?;
    if rectangle[2] == 0 || rectangle[3] == 0 {
        Err("a rectangle has at least one pixel".into())
    } else {
        Ok(rectangle)
    }
}

/// Where an image comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Source {
    File(PathBuf),
    /// Words that say what is rendered.
    Render(String),
}

impl CompareArgs {
    /// The images in order: A and B, which `--a` and `--b` or the first files are, then the other
    /// files, then those of `--c`.
    fn sources(&self) -> Vec<Source> {
        let mut files = self.images.iter().cloned().map(Source::File);
        let first = [&self.a, &self.b].map(|words| words.clone().map(Source::Render).or_else(|| files.next()));
        first.into_iter().flatten().chain(files).chain(self.c.iter().cloned().map(Source::Render)).collect()
    }

    fn options(&self) -> CompareOptions {
        let mask =
            MaskOptions { covered: self.mask == Mask::Covered, rectangle: self.rectangle, instance: self.instance };
        CompareOptions { channels: self.channels.clone(), mask }
    }

    /// The settings that renders share.
    fn shared(&self) -> RenderSettings {
        RenderSettings {
            image: self.image.clone(),
            scene: self.meaning.clone(),
            camera: self.camera.clone(),
            integrators: self.integrators.clone(),
            lighting: self.lighting.clone(),
            frames: self.frames.clone(),
            ..RenderSettings::default()
        }
    }

    /// Checks what can be checked before anything is loaded or rendered, and returns the settings
    /// of the renders, and which files are read and written. Adds first frames to the sources.
    fn check(&self, sources: &mut Vec<Source>) -> Result<(Vec<RenderSettings>, FilePlan)> {
        // `--c` or `--b` alone would otherwise move up
        if self.b.is_some() && sources.len() == 1 {
            return Err(Error::Usage("--b: image A is missing: name a file, or render it with --a".into()));
        }
        check_count(sources.len(), self.reference)?;
        let words: Vec<&str> =
            sources.iter().filter_map(|s| if let Source::Render(w) = s { Some(&**w) } else { None }).collect();
        if words.is_empty() && self.scene.is_some() {
            return Err(Error::Usage("--scene: nothing is rendered: say what with --a, --b or --c".into()));
        }
        let shared = self.shared();
        if let (true, Some(setting)) = (words.is_empty(), shared.given().first()) {
            return Err(Error::Usage(format!(
                "{} is for renders, and all images are files: leave it out",
                setting.option()
            )));
        }
        self.device.check_with_files()?;
        let mut settings = render::settings(&words, &shared)?;
        if self.instance.is_some() {
            settings.iter_mut().for_each(render::add_ids);
        }
        self.add_first_frames(sources, &mut settings);
        let mut plan = self.plan(sources, &settings)?;
        plan.check()?;
        for path in self.difference.iter().chain(&self.flip) {
            picture::paths(sources.len(), self.reference, path)?.iter().try_for_each(|p| files::check_writable(p))?;
        }
        self.html.iter().chain(&self.save).try_for_each(|folder| plan.make_folder(folder))?;
        self.csv.iter().try_for_each(|path| files::check_writable(path))?;
        Ok((settings, plan))
    }

    /// The files that are read, as far as the command line tells, and those that will be written.
    fn plan(&self, sources: &[Source], settings: &[RenderSettings]) -> Result<FilePlan> {
        let mut plan = FilePlan::default();

        // what is read
        self.scene.iter().for_each(|scene| plan.reads("the scene", scene));
        for settings in settings {
            settings.lighting.environment_file().iter().for_each(|path| plan.reads_images("--environment", path));
            settings.frames.camera_path.iter().for_each(|path| plan.reads("--camera-path", path));
        }

        // what is written
        for (option, path) in [("--difference", &self.difference), ("--flip", &self.flip)] {
            if let Some(path) = path {
                picture::paths(sources.len(), self.reference, path)?.iter().for_each(|p| plan.writes(option, p));
            }
        }
        self.csv.iter().for_each(|path| plan.writes("--csv", path));
        self.html.iter().for_each(|folder| plan.writes_report("--html", folder));
        for (k, source) in sources.iter().enumerate() {
            match (source, &self.save) {
                (Source::File(path), _) => plan.reads(&format!("image {}", letter(k)), path),
                (Source::Render(_), Some(folder)) => plan.writes("--save", saved_file(folder, k)),
                _ => {}
            }
        }
        Ok(plan)
    }

    /// Adds the first frame of each preset that is judged at rest: what filters and histories do
    /// shows there.
    fn add_first_frames(&self, sources: &mut Vec<Source>, settings: &mut Vec<RenderSettings>) {
        let renders =
            sources.iter().enumerate().filter_map(|(k, s)| if let Source::Render(w) = s { Some((k, w)) } else { None });
        let firsts: Vec<(String, RenderSettings)> = renders
            .zip(settings.iter())
            .filter(|((k, _), _)| *k != self.reference)
            .filter_map(|((_, words), settings)| Some((format!("{words} --warm-up 0"), render::first_frame(settings)?)))
            .take(MAX_IMAGES.saturating_sub(sources.len()))
            .collect();
        for (words, first) in firsts {
            if !settings.contains(&first) {
                sources.push(Source::Render(words));
                settings.push(first);
            }
        }
    }
}

/// Loads and renders, compares, prints, writes.
pub fn run(args: &CompareArgs, start: Instant) -> Result<(), Failure> {
    if let Some(OtherComparison::AoVsPath(args)) = &args.comparison {
        return Ok(compare_ao::run(args, start)?);
    }
    let mut sources = args.sources();
    let (settings, plan) = args.check(&mut sources)?;
    let console = args.verbosity.console();
    let mut warnings = Warnings::new(console);
    let entries = entries(args, &sources, settings, &plan, console, &mut warnings)?;
    let mut set = ImageSet::new(entries, args.reference, &args.options())?;
    set.warnings.iter().for_each(|w| warnings.add(w));
    set.warnings.clone_from(&warnings.list);
    for line in set.lines() {
        console.line(&line)?;
    }
    if let Some(path) = &args.csv {
        let table = set.csv()?;
        files::write_atomically(path, |file| file.write_all(&table))?;
    }
    let mut pictures = Vec::new();
    for (kind, path) in [(PictureKind::Difference, &args.difference), (PictureKind::Flip, &args.flip)] {
        if let Some(path) = path {
            pictures.extend(picture::write(&set, kind, path)?);
        }
    }
    let index = args.html.as_ref().map(|dir| report::write(dir, &page::page(&set, &command_line())?)).transpose()?;
    if let Some(index) = &index {
        console.line(&format!("report: {}", report::address(index)))?;
    }
    let mut record = set.record();
    record["pictures"] = json!(files::lossy(&pictures));
    record["report"] = json!(index.as_ref().map(|path| path.to_string_lossy()));
    record["warnings"] = json!(warnings.list);
    let check = |(k, _, comparison): (usize, _, &Comparison)| {
        let name = |e: Error| Error::CheckFailed(format!("{} and {}: {e}", letter(k), letter(args.reference)));
        comparison.check().map_err(name)
    };
    console.close(&record, set.judged().try_for_each(check))
}

/// The file that a render is saved in.
fn saved_file(folder: &Path, index: usize) -> PathBuf {
    folder.join(format!("{}.exr", letter(index).to_ascii_lowercase()))
}

/// Loads or renders all images.
fn entries(
    args: &CompareArgs,
    sources: &[Source],
    settings: Vec<RenderSettings>,
    plan: &FilePlan,
    console: Console,
    warnings: &mut Warnings,
) -> Result<Vec<Entry>> {
    let files: Vec<&Path> =
        sources.iter().filter_map(|s| if let Source::File(p) = s { Some(&**p) } else { None }).collect();
    // a file that is missing is noticed before anything is rendered
    let budget = Budget::default();
    let loaded = files.iter().map(|p| output::load_within(p, &budget)).collect::<Result<Vec<_>>>()?;
    let mut loaded = loaded.into_iter().zip(files.iter().zip(short_names(&files)));

    // the scene is opened once for all renders
    let mut renderer = match (&args.scene, settings.is_empty()) {
        (Some(scene), false) => {
            interrupt::install();
            let renderer = args.load.open(scene, &args.device, &console)?;
            plan.check_scene(&renderer.scene().report.files)?;
            Some(renderer)
        }
        _ => None,
    };

    // entries in the order of the command line
    let mut settings = settings.into_iter();
    let mut entries: Vec<Entry> = Vec::new();
    let mut rendered: Vec<(usize, RenderSettings)> = Vec::new();
    for (k, source) in sources.iter().enumerate() {
        entries.push(match (source, &mut renderer) {
            (Source::Render(words), Some(renderer)) => {
                let settings = settings.next().unwrap_or_default();
                let label = format!("rendering {} ({words})", letter(k));
                let mut control = RenderControl {
                    progress: ProgressControl { progress: Progress::new(label, &console), keep_partial: false },
                    warnings,
                };
                let Rendered { image, frame, choices, without_effect } =
                    render::render(renderer, &settings, &mut control)?;
                drop(control);
                if let Some(folder) = &args.save {
                    output::save(&image, &saved_file(folder, k))?;
                }
                if let Some(what) = without_effect {
                    warnings.add(&format!("{} ({words}): {what}", letter(k)));
                }
                let background = settings.backdrop().colour();
                rendered.push((k, settings));
                let description =
                    [Some(renderer.name().to_owned()), frame].into_iter().flatten().collect::<Vec<_>>().join(", ");
                Entry { name: words.clone(), description, choices, image, background }
            }
            _ => {
                let Some((image, (path, name))) = loaded.next() else { continue };
                let description = path.display().to_string();
                let description = if description == name { String::new() } else { description };
                Entry { description, name, image, ..Entry::default() }
            }
        });
    }

    // renders that are equal in every bit are likely a mistake
    for (n, (k, ours)) in rendered.iter().enumerate() {
        let twin =
            rendered[..n].iter().find(|(j, theirs)| ours != theirs && is_same(&entries[*k].image, &entries[*j].image));
        if let Some((j, _)) = twin {
            warnings.add(&format!(
                "{} and {} are the same in every bit: the options in which they differ have no effect on this image",
                letter(*j),
                letter(*k)
            ));
        }
    }
    Ok(entries)
}

/// Returns true if two images have the same colours, bit for bit.
fn is_same(a: &Image, b: &Image) -> bool {
    let bits = |image: &Image, name: &str| image.f32(name).map(|v| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
    ["R", "G", "B", "Y", "A"].iter().all(|name| bits(a, name) == bits(b, name))
}

/// Progress bar and interruption by Ctrl-C of a render; warnings are printed once.
struct RenderControl<'a> {
    progress: ProgressControl,
    warnings: &'a mut Warnings,
}

impl Control for RenderControl<'_> {
    fn progress(&mut self, done: u64, total: u64) {
        self.progress.progress(done, total);
    }

    fn warning(&mut self, text: &str) {
        // all renders are of one scene, which has the same to say each time
        if !self.warnings.list.contains(&one_line(text)) {
            let Self { progress, warnings } = self;
            progress.progress.suspend(|| warnings.add(text));
        }
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.progress.should_stop()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::parse::parse_args;

    fn parse(line: &str) -> CompareArgs {
        parse_args(&line.split(' ').skip(1).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn renders_take_their_letters_and_files_the_others() {
        let names = |line: &str| -> Vec<String> {
            let name = |s| match s {
                Source::File(path) => path.display().to_string(),
                Source::Render(words) => format!("<{words}>"),
            };
            parse(line).sources().into_iter().map(name).collect()
        };
        assert_eq!(names("compare x.exr y.exr z.exr"), ["x.exr", "y.exr", "z.exr"]);
        assert_eq!(names("compare --scene s --b path --a ao"), ["<ao>", "<path>"]);
        assert_eq!(names("compare x.exr --scene s --a ao"), ["<ao>", "x.exr"]);
        assert_eq!(
            names("compare x.exr y.exr --scene s --b path --c ao --c lit"),
            ["x.exr", "<path>", "y.exr", "<ao>", "<lit>"]
        );
    }

    #[test]
    fn rectangles() {
        assert_eq!(parse_rectangle("1, 2,3,4"), Ok([1, 2, 3, 4]));
        for bad in ["1,2,3", "1,2,3,4,5", "a,b,c,d", "-1,0,2,2", "0,0,0,4"] {
            assert!(parse_rectangle(bad).is_err(), "{bad}");
        }
        assert_eq!(parse("compare x.exr y.exr --reference a").reference, 0);
    }
}
