//! `skylit bake`: ambient occlusion and other properties of surfaces, as textures of a model or
//! colours of its vertices.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

use clap::{Args, ValueHint};
use serde_json::json;

use super::args::LoadArgs;
use crate::bake::cage::{Cage, Detailed, check as check_cage};
use crate::bake::document::TextureImages;
use crate::bake::kept::KeptParts;
use crate::bake::map::BakedMap;
use crate::bake::options::{BakeOptions, CompleteOptions};
use crate::bake::picture::{self, Bits};
use crate::bake::plan::{PlannedTexture, plan};
use crate::bake::seams::Seams;
use crate::bake::session::BakeSession;
use crate::bake::skew::{self, Skew, SkewMap};
use crate::bake::{Map, Occluders, SeamTreatment, Target, agreement, document, pack, udim};
use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::scene::export::{AmendedFile, export_gltf};
use crate::scene::load::{LoadOptions, is_scene_file, load_with};
use crate::scene::{LoadReport, Scene, SceneSettings};
use crate::settings::Length;
use crate::terminal::console::Verbosity;
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::terminal::warnings::Warnings;
use crate::tracer::DeviceSettings;

const EXAMPLES: &str = "Examples:
  skylit bake model.glb -o model-ao.glb                        an occlusion texture for each material, all else kept
  skylit bake model.glb -o model-ao.glb --atlas                one texture for all materials
  skylit bake model.glb -o model-vc.glb --to vertices          colours of vertices instead
  skylit bake model.glb -o bent.png --map bent-normal --space tangent --size 2048
  skylit bake low.glb -o normals.png --from high.glb --map normal --space tangent
  skylit bake model.obj -o thickness.exr --map thickness --ao-radius 10%
  skylit bake room.glb -o light.exr --map light --environment sky --denoise";

/// Largest number of samples of a triangle's corner.
const MAX_CORNER_SPP: u32 = 1024;
/// Distance of the cage where none is given, as a share of the scene's diagonal.
const DEFAULT_CAGE: f64 = 0.02;

/// `skylit bake`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BakeArgs {
    /// Model (.gltf, .glb, .obj, .brhan) or builtin:NAME
    #[arg(value_hint = ValueHint::FilePath)]
    pub scene: String,
    /// File to write: the model with the results in it (.glb, .gltf), or an image of a map (.png, .exr)
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub output: PathBuf,
    /// Where the results go in a model
    #[arg(long, value_enum, default_value = "texture")]
    pub to: Target,
    /// What occludes: the scene, the meshes of the surface's material, or also a model
    ///
    /// `scene` or `material` and any number of models (.gltf, .glb, .obj, .brhan) may be given. A model occludes besides, where its file places it, and is not baked.
    #[arg(long, value_name = "scene|material|MODEL", value_parser = str::parse::<OccludersArg>)]
    #[arg(default_value = "scene")]
    pub occluders: Vec<OccludersArg>,
    /// Detailed model whose surfaces are baked onto this one (high to low)
    ///
    /// Maps show what lies within --cage of a texel along its normal.
    #[arg(long, value_name = "MODEL", value_hint = ValueHint::FilePath)]
    pub from: Option<String>,
    /// Distance from the surface at which rays to --from start, or a model as cage [default: 2%]
    ///
    /// The model is an inflated copy of this one, with the same triangles in the same order. Rays start at its surface, go through that of this one, and end behind it as --cage-behind says.
    #[arg(long, value_name = "D|PERCENT%|MODEL", value_parser = str::parse::<CageArg>, requires = "from")]
    pub cage: Option<CageArg>,
    /// Distance behind the surface at which rays to --from end [default: as far as in front of it]
    #[arg(long, value_name = "D|PERCENT%", value_parser = str::parse::<Length>, requires = "from")]
    pub cage_behind: Option<Length>,
    /// How straight rays to --from are: 0 along the cage, 1 along the triangles' normals [default: 0]
    ///
    /// A number, or a grey image in the texture coordinates that are baked into: black is 0, white is 1. Along a distance as cage rays follow shading normals, which slant details on flat faces beside hard edges.
    #[arg(long, value_name = "0..1|IMAGE", value_parser = str::parse::<SkewArg>, requires = "from")]
    pub skew: Option<SkewArg>,
    /// Bake a texture for each instance of a mesh
    ///
    /// In a model each instance after the first gets a copy of the mesh, which shares its vertices, and of its materials. Images are NAME-1.png, NAME-2.png: the first shows the first instance of each mesh, the second the second of those that have one, and so on.
    #[arg(long, conflicts_with = "average_instances")]
    pub unique_instances: bool,
    /// Bits of a channel of PNG files and of textures in a model
    #[arg(long, value_name = "8|16", default_value = "8", value_parser = parse_bits)]
    pub bits: Bits,
    /// Pack occlusion, roughness and metalness into one texture
    ///
    /// It is done where a material has them by the same coordinates.
    #[arg(long, value_name = "orm", value_parser = ["orm"])]
    pub pack: Option<String>,
    /// Keep finished parts beside the output until it is written: the same command goes on with them
    ///
    /// They are in NAME.parts. The result has the bits of a bake that was not interrupted.
    #[arg(long)]
    pub resumable: bool,
    /// Render the model with baked and with traced ambient occlusion, and report their difference
    #[arg(long)]
    pub verify: bool,
    /// What is baked, and at last its light, whose heading would hold what follows
    #[command(flatten)]
    pub what: BakeOptions,
    /// Files of the scene
    #[command(flatten)]
    pub load: LoadArgs,
    /// Meaning of the file
    #[command(flatten)]
    pub meaning: SceneSettings,
    /// Device and tracer
    #[command(flatten)]
    pub device: DeviceSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

/// The value of `--occluders`.
#[derive(Clone, Debug, PartialEq)]
pub enum OccludersArg {
    /// Surfaces of the scene.
    Scene(Occluders),
    /// A model besides.
    Model(String),
}

impl FromStr for OccludersArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match Occluders::ALL.into_iter().find(|choice| choice.name() == text) {
            Some(choice) => Ok(Self::Scene(choice)),
            None if is_model(text) => Ok(Self::Model(text.to_owned())),
            None => Err("expected scene, material or a model (.gltf, .glb, .obj, .brhan)".to_owned()),
        }
    }
}

/// The value of `--cage`: where a detailed model is looked for.
#[derive(Clone, Debug)]
pub enum CageArg {
    /// Within this distance of the surface.
    Distance(Length),
    /// From the surface of this model.
    Model(String),
}

impl FromStr for CageArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(length) => Ok(Self::Distance(length)),
            Err(_) if is_model(text) => Ok(Self::Model(text.to_owned())),
            Err(_) => Err("expected a length, a share such as 2%, or a model (.gltf, .glb, .obj, .brhan)".to_owned()),
        }
    }
}

/// The value of `--skew`.
#[derive(Clone, Debug, PartialEq)]
pub enum SkewArg {
    /// The same everywhere, from 0 to 1.
    Uniform(f64),
    /// That of an image.
    Image(PathBuf),
}

impl FromStr for SkewArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_image = || skew::FORMATS.iter().any(|format| files::has_extension(Path::new(text), format));
        match text.parse::<f64>() {
            Ok(share) if (0.0..=1.0).contains(&share) => Ok(Self::Uniform(share)),
            Err(_) if is_image() => Ok(Self::Image(text.into())),
            _ => Err("expected a number from 0 to 1, or an image (.png, .jpg, .tga, .exr and others)".to_owned()),
        }
    }
}

/// Whether a text names a model, by its extension.
fn is_model(text: &str) -> bool {
    is_scene_file(text) || text.starts_with("builtin:")
}

impl BakeArgs {
    /// Surfaces of the scene that occlude.
    fn own_occluders(&self) -> Occluders {
        let own = self.occluders.iter().find_map(|o| if let OccludersArg::Scene(own) = o { Some(*own) } else { None });
        own.unwrap_or_default()
    }

    /// Models that occlude besides.
    fn occluding_models(&self) -> impl Iterator<Item = &str> {
        self.occluders.iter().filter_map(|o| if let OccludersArg::Model(path) = o { Some(path.as_str()) } else { None })
    }

    /// The model that is the cage.
    fn cage_model(&self) -> Option<&str> {
        match &self.cage {
            Some(CageArg::Model(path)) => Some(path),
            _ => None,
        }
    }

    /// The image of the skew.
    fn skew_image(&self) -> Option<&Path> {
        match &self.skew {
            Some(SkewArg::Image(path)) => Some(path),
            _ => None,
        }
    }
}

fn parse_bits(text: &str) -> Result<Bits, String> {
    match text {
        "8" => Ok(Bits::Eight),
        "16" => Ok(Bits::Sixteen),
        _ => Err("expected 8 or 16".to_owned()),
    }
}

/// The kind of file that is written.
#[derive(Clone, Copy, PartialEq)]
enum Output {
    /// A model with the results in it.
    Model,
    /// An image of each material's map.
    Image,
}

/// Checks what can be known before the scene is read.
fn check(args: &BakeArgs) -> Result<Output> {
    args.device.check_with_files()?;
    let extension = args.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let output = match extension.as_str() {
        "glb" | "gltf" => Output::Model,
        "png" | "exr" => Output::Image,
        _ => {
            let path = args.output.display();
            return Err(Error::Usage(format!(
                "{path}: unknown format: the file name must end in .glb or .gltf for a model, .png or .exr for an image"
            )));
        }
    };

    // options that do not go together, and the remedy
    let (is_image, to_vertices) = (output == Output::Image, args.to == Target::Vertices);
    let is_packed = args.pack.is_some();
    let is_light = args.what.map == Map::Light;
    let refusals = [
        (
            !is_image && args.what.map != Map::Ao,
            "--map: a model holds ambient occlusion alone; write an image, .png or .exr",
        ),
        (is_image && to_vertices, "--to vertices: an image has no vertices; write a model, .glb or .gltf"),
        (
            args.from.is_some() && args.occluders != [OccludersArg::Scene(Occluders::Scene)],
            "--occluders: what --from names occludes, and nothing else",
        ),
        (
            args.occluders.iter().filter(|o| matches!(o, OccludersArg::Scene(_))).count() > 1,
            "--occluders: scene or material, not both, and any number of models",
        ),
        (args.unique_instances && to_vertices, "--unique-instances is for textures: instances share their vertices"),
        (
            matches!(args.cage, Some(CageArg::Distance(length)) if !is_finite(length)),
            "--cage: a length or a share is expected",
        ),
        (args.cage_behind == Some(Length::Auto), "--cage-behind: a length or a share is expected"),
        (
            to_vertices && args.skew_image().is_some(),
            "--skew: an image is for textures: give a number from 0 to 1 with --to vertices",
        ),
        (
            args.what.target_error.is_some() && to_vertices,
            "--target-error is for textures of what rays sample, but for light",
        ),
        (
            is_light && args.own_occluders() != Occluders::Scene,
            "--occluders material: light comes from the whole scene with --map light",
        ),
        (args.what.denoise && to_vertices, "--denoise is for textures: vertices are the means of their triangles"),
        (
            args.what.seams == SeamTreatment::Match && to_vertices,
            "--seams match is for textures: vertices at one place have one value",
        ),
        (args.what.atlas && to_vertices, "--atlas is for textures: colours of vertices need none"),
        (args.what.atlas && args.unique_instances, "--atlas: instances that have a texture each do not share one"),
        (
            args.what.atlas && is_packed,
            "--pack orm: roughness of several materials lies in several textures, not in an atlas",
        ),
        (args.resumable && to_vertices, "--resumable is for textures: vertices are baked at once"),
        (is_packed && (is_image || to_vertices), "--pack orm is for textures of a model"),
        (is_packed && args.bits == Bits::Sixteen, "--pack orm: packed textures have 8 bits a channel"),
        (is_image && args.verify, "--verify renders the written model: write one, .glb or .gltf"),
        (to_vertices && args.what.spp > MAX_CORNER_SPP, "--spp: corners of triangles have at most 1024 samples"),
        (args.verify && to_vertices, "--verify is for textures: colours of vertices are not rendered apart"),
    ];
    match refusals.into_iter().find(|(is_refused, _)| *is_refused) {
        Some((_, reason)) => Err(Error::Usage(reason.to_owned())),
        None => args.what.check().map(|()| output),
    }
}

/// Bakes and writes.
pub fn run(args: &BakeArgs) -> Result<()> {
    let start = Instant::now();
    let console = args.verbosity.console();
    let output = check(args)?;
    interrupt::install();
    let mut files_plan = FilePlan::default();
    files_plan.reads("the scene", &args.scene);
    if let Some(from) = &args.from {
        files_plan.reads("--from", from);
    }
    args.occluding_models().for_each(|model| files_plan.reads("--occluders", model));
    args.cage_model().iter().for_each(|cage| files_plan.reads("--cage", cage));
    args.skew_image().iter().for_each(|image| files_plan.reads("--skew", image));
    files_plan.writes("the output", &args.output);
    if args.resumable {
        files_plan.writes("its finished parts", parts_path(&args.output));
    }
    files_plan.check()?;
    files::check_writable(&args.output)?;

    // the scene, and where results are written into it the file that has it
    let mut renderer = args.load.open(&args.scene, &args.device, &console)?;
    let mut warnings = Warnings::new(console);
    renderer.scene().report.all_warnings().iter().for_each(|w| warnings.add(w));
    files_plan.check_scene(&renderer.scene().report.files)?;
    let CompleteOptions { mut settings, remarks, lighting } = args.what.complete(&mut renderer, &args.meaning)?;
    settings.occluders = args.own_occluders();
    settings.has_unique_instances = args.unique_instances;
    let device = renderer.device().clone();
    let mut scene = renderer.into_scene();
    let model = ModelFile::open(args, output, &mut scene)?;

    // what is traced
    let planned = match args.to {
        Target::Texture => {
            let mut control = ProgressControl { progress: Progress::new("unwrapping", &console), keep_partial: false };
            plan(&scene, model.as_ref().map(|m| m.file.source()), &settings, &mut control)?
        }
        Target::Vertices => Vec::new(),
    };
    let paths = image_paths(args, output, &planned);
    paths.iter().filter(|path| **path != args.output).for_each(|path| files_plan.writes("a map", path));
    document::texture_companions(&args.output, &planned)
        .iter()
        .filter(|_| output == Output::Model)
        .for_each(|path| files_plan.writes("a file beside the output", path));
    files_plan.check()?;
    files_plan.check_scene(&scene.report.files)?;
    for line in remarks.iter().chain(planned.iter().flat_map(|t| &t.remarks)) {
        console.line(line)?;
    }

    // other models: a detailed one and its cage, and what occludes besides
    let mut load = |path: &str| {
        let scene = args.load.load(path, &console)?;
        files_plan.check_scene(&scene.report.files)?;
        scene.report.all_warnings().iter().for_each(|w| warnings.add(w));
        Ok::<_, Error>(scene)
    };
    let mut detailed = args.from.as_deref().map(&mut load).transpose()?;
    let occluding = args.occluding_models().map(&mut load).collect::<Result<Vec<_>>>()?;
    let mut cage_model = args.cage_model().map(&mut load).transpose()?;
    if let Some(cage_model) = &mut cage_model {
        // a scene that became a glTF file is compared as such
        let _folder = model.as_ref().is_some_and(|m| m.folder.is_some()).then(|| as_gltf(cage_model)).transpose()?;
        check_cage(&scene, cage_model)?;
    }
    let skew_map = args.skew_image().map(|image| SkewMap::load(image, &planned)).transpose()?;

    // lights may be meshes, which have no textures
    lighting.apply(&mut scene)?;
    if let Some(detailed) = &mut detailed {
        // it is traced in place of the scene
        lighting.apply(detailed)?;
    }
    let unpacked = planned.iter().filter(|_| args.pack.is_some()).filter_map(|t| pack::partner(&scene, t).err());
    unpacked.for_each(|reason| warnings.add(&reason));
    let copied = model.as_ref().map_or_else(Vec::new, |m| document::remarks_on_copies(&m.file, &planned));
    copied.iter().for_each(|remark| warnings.add(remark));

    // the maps, or the values of vertices
    let detailed = detailed.as_ref().map(|detailed| detailed_of(args, &scene, detailed, &cage_model, &skew_map));
    let session = BakeSession {
        scene: &scene,
        device: &device,
        tracing: &args.device,
        settings: &settings,
        detailed,
        occluding: &occluding,
    };
    let mut control = ProgressControl { progress: Progress::new("baking", &console), keep_partial: false };
    let mut record = json!({
        "scene": args.scene, "map": args.what.map.name(), "to": args.to.name(),
        "ao_radius": settings.occlusion.radius, "spp": settings.spp,
    });
    if args.what.map == Map::Light {
        record["integrator"] = json!(settings.light.integrator()?.name());
        record["max_depth"] = json!(args.what.max_depth);
    }
    let (written, what, rays) = bake_and_write(args, &session, model, planned, paths, &mut record, &mut control)?;
    drop(control);
    device.check_validation()?;
    device.save_pipeline_cache();

    // the result
    let seconds = start.elapsed().as_secs_f64();
    let names: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
    console.line(&format!("{}: {what}; {:.1} million rays, {seconds:.1} s", names.join(", "), rays as f64 / 1e6))?;
    record["files"] = json!(files::lossy(&written));
    record["rays"] = json!(rays);
    record["seconds"] = json!(seconds);
    if args.verify {
        let mut control = ProgressControl { progress: Progress::new("comparing", &console), keep_partial: false };
        let found = agreement::measure(&args.output, &args.device, &settings, &mut control)?;
        console.line(&format!(
            "baked against traced ambient visibility over {} pixels: RMSE {:.4}, mean difference {:+.4}",
            found.pixels, found.rmse, found.bias
        ))?;
        record["verify"] = json!({ "pixels": found.pixels, "rmse": found.rmse, "bias": found.bias });
    }
    record["warnings"] = json!(warnings.list);
    console.record(&record)
}

/// Bakes, and writes the results; returns the files, a sentence on what they have, and the number
/// of rays.
fn bake_and_write(
    args: &BakeArgs,
    session: &BakeSession,
    model: Option<ModelFile>,
    planned: Vec<PlannedTexture>,
    paths: Vec<PathBuf>,
    record: &mut serde_json::Value,
    control: &mut ProgressControl,
) -> Result<(Vec<PathBuf>, String, u64)> {
    match (args.to, model) {
        (Target::Vertices, None) => Err(Error::Usage("--to vertices needs a model".to_owned())),
        (Target::Vertices, Some(model)) => {
            let (baked, rays) = session.bake_vertices(model.file.source(), control)?;
            let count: usize = baked.iter().map(|b| b.values.len()).sum();
            record["vertices"] = json!(count);
            Ok((document::save_vertices(model.file, &baked, &args.output)?, format!("{count} vertices"), rays))
        }

        // the maps, of which some parts may be there
        (Target::Texture, model) => {
            let mut kept = args.resumable.then(|| parts_of(args, session, &planned)).transpose()?;
            let maps = session.bake_textures_in_parts(&planned, kept.as_mut(), control);
            let maps = maps.map_err(|e| if let Some(kept) = &kept { kept.explain(e) } else { e })?;
            let rays = maps.iter().map(|m| m.rays).sum();
            record["textures"] = planned.iter().zip(&maps).map(|(t, m)| texture_record(t, m)).collect();
            let what = describe(&maps);
            let baked = planned.into_iter().zip(maps).collect::<Vec<_>>();
            let written = match model {
                Some(model) => {
                    let images = TextureImages { bits: args.bits, are_packed: args.pack.is_some() };
                    document::save_textures(model.file, session.scene, &baked, session.settings, images, &args.output)?
                }
                None => {
                    for ((_, map), path) in baked.iter().zip(&paths) {
                        picture::save(map, session.settings, args.bits, path)?;
                    }
                    paths
                }
            };
            kept.map(KeptParts::remove).transpose()?;
            Ok((written, what, rays))
        }
    }
}

/// The file of finished parts, beside the output.
fn parts_path(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".parts");
    output.with_file_name(name)
}

/// Opens the file of finished parts, and says so where it has some.
fn parts_of(args: &BakeArgs, session: &BakeSession, planned: &[PlannedTexture]) -> Result<KeptParts> {
    let path = parts_path(&args.output);
    let kept = KeptParts::open(&path, &session.fingerprint(planned), session.settings.is_smoothed)?;
    if kept.is_continued() {
        args.verbosity.console().line(&format!("goes on with the finished parts in {}", path.display()))?;
    }
    Ok(kept)
}

/// The file that a model is written into.
struct ModelFile {
    file: AmendedFile,
    /// Where the file is that a scene of another format became.
    folder: Option<tempfile::TempDir>,
}

impl ModelFile {
    /// Opens the file of the scene; `None` if an image is written. A scene that is no glTF file
    /// becomes one, which is loaded in its place.
    fn open(args: &BakeArgs, output: Output, scene: &mut Scene) -> Result<Option<Self>> {
        if output == Output::Image {
            return Ok(None);
        }
        let path = Path::new(&args.scene);
        if ["gltf", "glb"].iter().any(|extension| files::has_extension(path, extension)) {
            return Ok(Some(Self { file: AmendedFile::open(path)?, folder: None }));
        }
        if !files::has_extension(&args.output, "glb") {
            let output = args.output.display();
            return Err(Error::Usage(format!(
                "{output}: a model that is no glTF file becomes a .glb: choose that name"
            )));
        }
        let (folder, path) = as_gltf(scene)?;
        Ok(Some(Self { file: AmendedFile::open(&path)?, folder: Some(folder) }))
    }
}

/// Writes a scene as a glTF file, which is loaded in its place; returns its folder and its path.
fn as_gltf(scene: &mut Scene) -> Result<(tempfile::TempDir, PathBuf)> {
    let folder = tempfile::tempdir().map_err(|e| Error::Output {
        path: std::env::temp_dir(),
        message: format!("no folder can be made for the model: {e}"),
    })?;
    let path = folder.path().join("model.glb");
    export_gltf(scene, &path)?;
    let (name, report) = (scene.name.clone(), scene.report.clone());
    *scene = load_with(&path.to_string_lossy(), &LoadOptions::default())?;
    let instance_nodes = std::mem::take(&mut scene.report.instance_nodes);
    (scene.name, scene.report) = (name, LoadReport { instance_nodes, ..report });
    Ok((folder, path))
}

/// Whether a length is a number of scene units once the scene is known.
fn is_finite(length: Length) -> bool {
    length.units(1.0).is_some_and(f64::is_finite)
}

/// How the surfaces of a detailed model are looked for from those of the scene.
fn detailed_of<'a>(
    args: &BakeArgs,
    scene: &Scene,
    detailed: &'a Scene,
    cage_model: &'a Option<Scene>,
    skew_map: &'a Option<SkewMap>,
) -> Detailed<'a> {
    let diagonal = scene.bounds().map_or(1.0, |(low, high)| (high - low).length());
    let cage = match (cage_model, &args.cage) {
        (Some(cage_model), _) => Cage::Model(cage_model),
        (None, Some(CageArg::Distance(length))) => Cage::Distance(length.units(diagonal).unwrap_or_default()),
        (None, _) => Cage::Distance(DEFAULT_CAGE * diagonal),
    };
    let behind = args.cage_behind.and_then(|length| length.units(diagonal));
    let skew = match (skew_map, &args.skew) {
        (Some(map), _) => Skew::Map(map),
        (None, Some(SkewArg::Uniform(share))) => Skew::Uniform(*share),
        (None, _) => Skew::default(),
    };
    Detailed { scene: detailed, cage, behind, skew }
}

/// The images that are written: one of the output's name, or with several textures one a material,
/// instance and tile.
fn image_paths(args: &BakeArgs, output: Output, planned: &[PlannedTexture]) -> Vec<PathBuf> {
    if output == Output::Model {
        return Vec::new();
    }
    if planned.len() == 1 {
        return vec![args.output.clone()];
    }
    let stem = args.output.file_stem().unwrap_or_default().to_string_lossy();
    let extension = args.output.extension().unwrap_or_default().to_string_lossy();
    let has_materials = planned.iter().any(|texture| texture.name != planned[0].name);
    let path = |texture: &PlannedTexture| {
        let material = if has_materials { format!("-{}", files::portable_name(&texture.name)) } else { String::new() };
        let placement = texture.placement.map_or_else(String::new, |k| format!("-{}", k + 1));
        let tile = texture.tile.and_then(udim::number).map_or_else(String::new, |n| format!(".{n}"));
        args.output.with_file_name(format!("{stem}{material}{placement}{tile}.{extension}"))
    };
    planned.iter().map(path).collect()
}

/// A sentence on the textures that were baked.
fn describe(maps: &[BakedMap]) -> String {
    let sizes: std::collections::BTreeSet<String> =
        maps.iter().map(|m| format!("{}x{}", m.size[0], m.size[1])).collect();
    let sizes = sizes.into_iter().collect::<Vec<_>>().join(" and ");
    let count = if maps.len() == 1 { "1 texture".to_owned() } else { format!("{} textures", maps.len()) };
    let hidden: usize = maps.iter().map(|m| m.hidden).sum();
    let hidden = if hidden > 0 { format!(", {hidden} texels inside of other geometry filled") } else { String::new() };
    let error = maps.iter().map(|m| m.error).fold(0.0, f64::max);
    let error = if error > 0.0 { format!(", standard error at most {error:.4}") } else { String::new() };
    let seams = maps.iter().filter_map(|m| m.seams);
    let worst =
        seams.reduce(|a, b| Seams { edges: a.edges + b.edges, rmse: a.rmse.max(b.rmse), max: a.max.max(b.max) });
    let seams = match worst {
        Some(s) => {
            format!(", {} edges at seams (RMSE at most {:.4}, largest difference {:.4})", s.edges, s.rmse, s.max)
        }
        None => String::new(),
    };
    format!("{count} of {sizes}{error}{seams}{hidden}")
}

/// A texture in the JSON record.
fn texture_record(texture: &PlannedTexture, map: &BakedMap) -> serde_json::Value {
    let covered = map.covered.iter().filter(|c| **c).count();
    json!({
        "material": texture.name,
        "materials": texture.materials.iter().map(|m| &m.name).collect::<Vec<_>>(),
        "size": map.size,
        "texcoord": texture.texcoord,
        "tile": texture.tile.and_then(udim::number),
        "instances": texture.placement.map(|_| texture.surfaces.iter().flat_map(|s| &s.instances).collect::<Vec<_>>()),
        "unwrapped": !texture.unwrapped.is_empty(),
        "covered": covered as f64 / map.covered.len().max(1) as f64,
        "hidden_texels": map.hidden,
        "standard_error": map.error,
        "seam_edges": map.seams.map_or(0, |s| s.edges),
        "seam_rmse": map.seams.map(|s| s.rmse),
        "seam_max": map.seams.map(|s| s.max),
        "bounds": [map.bounds.0.to_array(), map.bounds.1.to_array()],
        "rays": map.rays,
    })
}
