//! `skylit info`: what a scene is made of, and how to begin with it. Images are described by
//! `image_info.rs`.

use clap::{Args, ValueHint};
use serde_json::json;

use super::args::LoadArgs;
use super::image_info;
use crate::error::{Error, Result};
use crate::film::{Control, NoControl};
use crate::output::parse_size;
use crate::renderer::interactive::camera_settings;
use crate::renderer::memory_estimate::MemoryEstimate;
use crate::renderer::report::milliseconds;
use crate::renderer::settings::options_text;
use crate::renderer::{RenderSettings, Renderer};
use crate::scene::inventory::Inventory;
use crate::scene::{Scene, SceneSettings};
use crate::settings::Length;
use crate::terminal::console::Failure;
use crate::terminal::interrupt::{self, Abandonable, SilentControl};
use crate::terminal::progress::Progress;
use crate::terminal::warnings::Warnings;
use crate::tracer::DeviceSettings;

/// Frames by which the time of a frame is estimated, and their size.
const FRAMES: u32 = 4;
const FRAME_SIZE: [u32; 2] = [1280, 720];
/// Size and samples per pixel of the images by which brightness is estimated.
const SKETCH_SIZE: [u32; 2] = [96, 54];
const SKETCH_SPP: u32 = 8;
/// Mean radiance of surfaces in a well exposed image.
const MIDDLE_GREY: f64 = 0.2;
/// Triangles and spheres of the largest scene through which rays are traced without --measure: a
/// larger one takes seconds to build a BVH for.
const MEASURED: u64 = 4_000_000;
/// Names of objects, of nodes and of materials that text shows; `--json` has all.
const SHOWN_NAMES: usize = 8;

/// `skylit info`.
#[derive(Clone, Debug, Args)]
#[command(
    before_help = "Examples:\n  skylit info scene.glb\n  skylit info scene.glb --no-device --json\n  skylit info image.exr"
)]
pub struct InfoArgs {
    /// Scene file (.gltf, .glb, .obj, .brhan), builtin:NAME, or an image (.exr, .hdr, .png, .jpg, .webp)
    #[arg(value_hint = ValueHint::FilePath)]
    pub scene: String,
    /// Describe the file alone: no device is opened, and nothing is rendered
    #[arg(long)]
    pub no_device: bool,
    /// Trace rays through a scene of more than 4 million triangles, too
    ///
    /// Suggestions and the time of a frame come from rays, for which a BVH is built. In a larger
    /// scene that takes as long as in `skylit render`, and is left out by default.
    #[arg(long, conflicts_with = "no_device")]
    pub measure: bool,
    /// Files of the scene
    #[command(flatten)]
    pub load: LoadArgs,
    /// Meaning of the file
    #[command(flatten)]
    pub meaning: SceneSettings,
    /// Image size in pixels that suggestions are for [default: the scene's, or 1280x720]
    ///
    /// A camera, an AO radius and light are suggested.
    #[arg(long, value_name = "WxH", value_parser = parse_size, conflicts_with = "no_device")]
    pub size: Option<[u32; 2]>,
    /// Device and tracer
    #[command(flatten)]
    pub device: DeviceSettings,
    /// Print one JSON record on stdout instead of text
    #[arg(long)]
    pub json: bool,
}

/// How to begin with a scene.
#[derive(Clone, Debug, serde::Serialize)]
struct Suggestions {
    /// Size of the images that the rest is about, pixels.
    size: [u32; 2],
    /// Options of `skylit render` that choose the camera that it chooses by itself.
    camera: String,
    /// Options of `skylit render --integrator path` that light the scene as it does by itself;
    /// absent for a scene that has light.
    light: Option<String>,
    /// Share of occlusion rays of surfaces in view that get out of the scene.
    ao_mean: Option<f64>,
    /// Radius that `--ao-radius auto` stands for, scene units; absent for no limit.
    ao_radius: Option<f64>,
    /// Exposure of path-traced images, stops.
    exposure: Option<f64>,
    /// Choices of `skylit render` for images of this size where options leave them open: a sentence
    /// each, and the options that choose the same.
    choices: Vec<String>,
}

/// The scene on a device.
#[derive(Clone, Debug, serde::Serialize)]
struct OnDevice {
    device: String,
    tracer: String,
    /// Bytes of the acceleration structures, and of the rest of the scene.
    structure_bytes: u64,
    scene_bytes: u64,
    /// Median time of a frame of the preset `balanced` at 1280x720, milliseconds.
    frame_ms: f64,
}

/// Loads a scene and describes it.
pub fn run(args: &InfoArgs) -> Result<(), Failure> {
    interrupt::install();
    let console = crate::terminal::console::Console { json: args.json, quiet: false };
    let _abandonable = Abandonable::begin(args.json);
    if image_info::is_image(&args.scene) {
        if args.size.is_some() {
            return Err(Error::Usage(format!("--size is for scenes, and {} is an image", args.scene)).into());
        }
        return image_info::run(&args.scene, &console);
    }
    args.device.check_with_files()?;
    let mut scene = args.load.load(&args.scene, &console)?;
    args.meaning.apply(&mut scene)?;
    let mut warnings = Warnings::new(console);
    scene.report.all_warnings().iter().for_each(|w| warnings.add(w));

    // what the file has
    let counting = Progress::of_silent_work("counting", &console);
    let inventory = Inventory::from_scene(&scene);
    drop(counting);
    let format = format_of(&args.scene);
    let extensions = scene.report.extensions.clone();
    let memory = MemoryEstimate::from_scene(&scene);
    describe(&inventory, &scene, format).iter().try_for_each(|line| console.line(line))?;
    console.line(&memory_line(&memory))?;
    let mut record = json!({
        "scene": args.scene,
        "format": format,
        "unit": unit(format),
        "metadata": scene.report.metadata,
        "scenes": scene.report.scenes,
        "extensions": extensions,
        "files": scene.report.files,
        "normals_computed": scene.report.normals_computed,
        "normals_replaced": scene.report.normals_replaced,
        "tangents_computed": scene.report.tangents_computed,
        "texcoords_projected": scene.report.texcoords_projected,
        "inventory": inventory,
        "memory": memory,
    });
    record["memory"]["peak"] = json!(memory.peak());

    // what a render of it would be like
    let is_large = inventory.unique_triangles + inventory.spheres > MEASURED;
    if !args.no_device && is_large && !args.measure {
        console.line(&format!(
            "{:<12}camera, AO radius and time are not suggested for so large a scene: --measure traces rays for them",
            "rays"
        ))?;
    } else if !args.no_device {
        let mut progress = Progress::new("looking at the scene", &console);
        match on_device(args, scene, &mut progress) {
            Ok((suggestions, on_device)) => {
                suggestions
                    .lines(&args.scene)
                    .iter()
                    .chain(&on_device.lines())
                    .try_for_each(|line| console.line(line))?;
                record["suggestions"] = json!(suggestions);
                record["device"] = json!(on_device);
            }
            // the file has been described, which needs none
            Err(e @ Error::Device(_)) => {
                warnings.add(&format!("no camera, memory and time are suggested: {e}"));
            }
            Err(e) => return Err(e.into()),
        }
    }
    record["warnings"] = json!(warnings.list);
    Ok(console.record(&record)?)
}

fn format_of(source: &str) -> &'static str {
    if source.starts_with("builtin:") {
        return "built-in";
    }
    let lower = source.to_ascii_lowercase();
    match lower.rsplit('.').next() {
        Some("glb") => "glTF 2.0, binary",
        Some("gltf") => "glTF 2.0",
        Some("obj") => "Wavefront OBJ",
        Some("brhan") => "brhan",
        _ => "built-in",
    }
}

/// Unit of lengths.
fn unit(format: &str) -> &'static str {
    if format.starts_with("glTF") { "metre" } else { "not said by the file" }
}

fn describe(i: &Inventory, scene: &Scene, format: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let mut add = |name: &str, text: String| lines.push(format!("{name:<12}{text}"));

    // extent
    add("scene", format!("{}, {format}; unit of lengths: {}", scene.name, unit(format)));
    if let Some([lo, hi]) = i.bounds {
        let corner = |c: [f64; 3]| c.map(significant).join(", ");
        add("bounds", format!("{} to {}, diagonal {}", corner(lo), corner(hi), significant(i.diagonal)));
    }

    if scene.report.scenes.len() > 1 {
        let names = scene.report.scenes.iter().enumerate().map(|(k, name)| format!("{k} `{name}`"));
        add("scenes", format!("{} (--scene)", names.collect::<Vec<_>>().join(", ")));
    }
    for (name, text) in &scene.report.metadata {
        add("metadata", format!("{name}: {text}"));
    }

    // geometry and surfaces
    add("geometry", geometry_text(i));
    if !i.objects.is_empty() {
        add("objects", format!("{} (--hide, --only)", first_names(&i.objects)));
    }
    if !i.nodes.is_empty() {
        add("nodes", format!("{} (--hide, --only: with all below)", first_names(&i.nodes)));
    }
    add("surfaces", surfaces_text(i));
    scene.report.remarks().into_iter().for_each(|remark| add("vertices", remark));

    // materials and textures
    let named = |name: &String| if name.is_empty() { "without a name".to_owned() } else { name.clone() };
    let joined = |all: &mut dyn Iterator<Item = (String, usize)>| {
        all.map(|(name, n)| format!("{n} {name}")).collect::<Vec<_>>().join(", ")
    };
    let kinds = joined(&mut i.materials.iter().map(|(k, n)| (k.clone(), *n)));
    add(
        "materials",
        if i.material_names.is_empty() {
            kinds
        } else {
            format!("{kinds}: {} (--material)", first_names(&i.material_names))
        },
    );
    if !i.variants.is_empty() {
        let names = i.variants.iter().map(named).collect::<Vec<_>>().join(", ");
        add("variants", format!("{names} (--variant)"));
    }
    if i.textures.count > 0 {
        let t = &i.textures;
        add(
            "textures",
            format!(
                "{} of {} images, {} decoded, the largest {}x{}",
                t.count,
                t.images,
                bytes_text(t.bytes),
                t.largest[0],
                t.largest[1]
            ),
        );
    }

    // cameras, lights and animations
    add(
        "cameras",
        if i.cameras.is_empty() { "none".into() } else { i.cameras.iter().map(named).collect::<Vec<_>>().join(", ") },
    );
    let lights = joined(&mut i.lights.iter().map(|(k, n)| ((*k).to_owned(), *n)));
    add("lights", format!("{}; environment: {}", if lights.is_empty() { "none" } else { &lights }, i.environment));
    if !i.animations.is_empty() || !i.skins.is_empty() {
        let animation = |(name, seconds): &(String, f64)| format!("{} ({seconds:.2} s)", named(name));
        let animations = i.animations.iter().map(animation).collect::<Vec<_>>().join(", ");
        let skins = i.skins.iter().map(|joints| format!("{joints} joints")).collect::<Vec<_>>().join(", ");
        let skins = if skins.is_empty() { String::new() } else { format!("; skins: {skins}") };
        let targets = if i.morph_targets > 0 { format!("; {} morph targets", i.morph_targets) } else { String::new() };
        add("animations", format!("{}{skins}{targets}", if animations.is_empty() { "none" } else { &animations }));
    }

    // what the file requires of programs
    let extensions = &scene.report.extensions;
    if !extensions.is_empty() {
        let noted = |e: &crate::scene::FileExtension| {
            let notes: Vec<&str> =
                [(e.required, "required"), (e.ignored, "ignored")].into_iter().filter(|n| n.0).map(|n| n.1).collect();
            if notes.is_empty() { e.name.clone() } else { format!("{} ({})", e.name, notes.join(", ")) }
        };
        add("extensions", extensions.iter().map(noted).collect::<Vec<_>>().join(", "));
    }
    lines
}

/// The memory that a render is estimated to take.
fn memory_line(m: &MemoryEstimate) -> String {
    format!(
        "{:<12}a render takes about {}: the program {}, the scene {}, building its BVH {}, in device memory {}",
        "memory",
        bytes_text(m.peak()),
        bytes_text(m.program),
        bytes_text(m.scene),
        bytes_text(m.build),
        bytes_text(m.device)
    )
}

/// The first names of a list, and how many more there are.
fn first_names(names: &[String]) -> String {
    let shown = names.iter().take(SHOWN_NAMES).map(String::as_str).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(SHOWN_NAMES) {
        0 => shown,
        more => format!("{shown}, and {more} more"),
    }
}

/// Numbers of primitives, and how they are instanced.
fn geometry_text(i: &Inventory) -> String {
    let mut primitives = counted(i.triangles, "triangle", "triangles");
    if i.triangles != i.unique_triangles {
        primitives += &format!(" ({} unique)", grouped(i.unique_triangles));
    }
    if i.spheres > 0 {
        primitives += &format!(", {}", counted(i.spheres, "sphere", "spheres"));
    }
    let instances = counted(i.instances as u64, "instance", "instances");
    format!("{primitives}; {instances} of {}", counted(i.meshes as u64, "mesh", "meshes"))
}

/// Where surfaces end, and triangles that were dropped.
fn surfaces_text(i: &Inventory) -> String {
    let mut text = "no open edges".to_owned();
    if i.open_edges > 0 {
        let edges = counted(i.open_edges, "open edge, where a surface ends", "open edges, where surfaces end");
        text = format!("{edges}; {} of {} meshes are closed", i.closed_meshes, i.meshes);
    }
    if i.degenerate_triangles > 0 {
        let dropped = counted(i.degenerate_triangles as u64, "degenerate triangle was", "degenerate triangles were");
        text += &format!("; {dropped} dropped");
    }
    text
}

fn on_device(args: &InfoArgs, scene: Scene, progress: &mut Progress) -> Result<(Suggestions, OnDevice)> {
    let device = crate::gpu::Device::open(&args.device.options())?;
    let mut renderer = Renderer::new(device, scene, &args.device)?.with_name(&args.scene);
    let mut control = SilentControl;
    let mut requested = RenderSettings { scene: args.meaning.clone(), ..Default::default() };
    requested.image.size = args.size;

    // what is chosen for images of this size
    let by_itself = renderer.complete(&requested, None)?;
    let size = by_itself.settings.size(renderer.scene());

    let mut settings =
        RenderSettings { scene: args.meaning.clone(), camera: by_itself.chosen.camera.clone(), ..Default::default() };
    if !settings.camera.chooses() {
        settings.camera = camera_settings(&renderer.scene().cameras, &by_itself.camera);
    }
    let camera = options_text(&settings);
    let mut auto = requested.clone();
    auto.integrators.ao.ao_radius = Some(Length::Auto);
    let auto_radius = renderer.complete(&auto, None)?.settings.integrators.ao.radius();
    let lit = renderer.complete(&RenderSettings { integrator: Some("path".parse()?), ..requested.clone() }, None)?;
    let light = options_text(&RenderSettings { lighting: lit.chosen.lighting.clone(), ..Default::default() });
    progress.set(1, 4);

    // sketches of the same view
    settings.image.size = Some(sketch_size(size));
    settings.image.spp = Some(SKETCH_SPP);
    let mut open = settings.clone();
    open.integrators.ao.ao_radius = Some(Length::Units(f64::INFINITY));
    let ao_mean = renderer.still(&open, &mut Quiet(&mut control))?.report.surface_mean;
    progress.set(2, 4);
    let mut path = RenderSettings { lighting: lit.chosen.lighting, ..settings.clone() };
    path.integrator = Some("path".parse()?);
    let path = renderer.still(&path, &mut Quiet(&mut control))?.report;
    // less than two stops are a matter of taste
    let stops =
        |mean: f64| Some((MIDDLE_GREY / mean).log2().round() + 0.0).filter(|s: &f64| s.abs() >= 2.0).unwrap_or(0.0);
    let exposure = path.surface_mean.filter(|m| *m > 0.0).map(stops);
    let mut choices = by_itself.choices;
    choices.extend(lit.choices.into_iter().filter(|c| c.starts_with("light")));

    // a few frames, to say how long one takes
    progress.set(3, 4);
    let mut frames =
        RenderSettings { scene: args.meaning.clone(), camera: settings.camera.clone(), ..Default::default() };
    frames.image.size = Some(FRAME_SIZE);
    frames.frames.preset = Some(crate::realtime::Preset::Balanced);
    frames.frames.warm_up = Some(1);
    frames.frames.frames = Some(crate::realtime::frame_settings::FrameRange { first: 0, end: FRAMES });
    let mut frames = renderer.frames(&frames, false, &mut NoControl)?;
    while frames.advance()?.is_some() {
        control.should_stop()?;
    }
    let report = frames.report();

    let on_device = OnDevice {
        device: report.setup.device.clone(),
        tracer: report.setup.tracer.to_string(),
        structure_bytes: report.setup.stats.structure_bytes,
        scene_bytes: path.setup.stats.scene_bytes,
        frame_ms: report.frame_ms().0,
    };
    let ao_radius = Some(auto_radius).filter(|r| r.is_finite());
    let light = Some(light).filter(|text| !text.is_empty());
    Ok((Suggestions { size, camera, light, ao_mean, ao_radius, exposure, choices }, on_device))
}

/// Size of a sketch of images of this size: as many pixels as [`SKETCH_SIZE`] has.
fn sketch_size(size: [u32; 2]) -> [u32; 2] {
    let pixels = f64::from(SKETCH_SIZE[0] * SKETCH_SIZE[1]);
    let scale = (pixels / (f64::from(size[0]) * f64::from(size[1]).max(1.0))).sqrt();
    size.map(|n| (f64::from(n) * scale).round().clamp(1.0, pixels) as u32)
}

/// Interruption without progress and warnings: what is rendered here is not the user's image.
struct Quiet<'a>(&'a mut SilentControl);

impl Control for Quiet<'_> {
    fn should_stop(&mut self) -> Result<bool> {
        self.0.should_stop()
    }
}

impl Suggestions {
    fn lines(&self, scene: &str) -> Vec<String> {
        let [width, height] = self.size;
        let mut lines = vec![format!("{:<12}{} for {width}x{height} pixels", "camera", self.camera)];
        lines.extend(self.light.iter().map(|light| format!("{:<12}{light}", "light")));
        let radius = match self.ao_radius {
            Some(radius) => format!("--ao-radius {radius}"),
            None => "no AO radius is needed".into(),
        };
        if let Some(mean) = self.ao_mean {
            lines.push(format!(
                "{:<12}{radius}; without a radius surfaces in view are {:.0} % open",
                "occlusion",
                100.0 * mean
            ));
        }
        match self.exposure {
            Some(0.0) => lines.push(format!("{:<12}path-traced images need none", "exposure")),
            Some(stops) => lines.push(format!("{:<12}--exposure {stops} for path tracing", "exposure")),
            None => {
                lines.push(format!("{:<12}path-traced images are black: no light reaches what is in view", "exposure"))
            }
        }
        lines.extend(self.choices.iter().map(|c| format!("{:<12}{c}", "by itself")));
        lines.push(format!("{:<12}skylit render {scene} -o ao.png --preset balanced", "try"));
        lines
    }
}

impl OnDevice {
    fn lines(&self) -> Vec<String> {
        vec![
            format!("{:<12}{}, tracer {}", "device", self.device, self.tracer),
            format!(
                "{:<12}{}: acceleration structures {}, the rest of the scene {} (with materials and textures)",
                "on device",
                bytes_text(self.structure_bytes + self.scene_bytes),
                bytes_text(self.structure_bytes),
                bytes_text(self.scene_bytes)
            ),
            format!("{:<12}{} a frame of the preset balanced at 1280x720", "time", milliseconds(self.frame_ms)),
        ]
    }
}

/// Bytes in the unit that suits them.
fn bytes_text(bytes: u64) -> String {
    match bytes {
        b if b < 1 << 10 => format!("{b} bytes"),
        b if b < 1 << 20 => format!("{:.1} KiB", b as f64 / 1024.0),
        b => format!("{:.1} MiB", b as f64 / (1u64 << 20) as f64),
    }
}

/// A number with four significant digits, without noise.
fn significant(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    // no negative zero
    (rounded + 0.0).to_string()
}

/// One, or several of something.
fn counted(count: u64, one: &str, several: &str) -> String {
    format!("{} {}", grouped(count), if count == 1 { one } else { several })
}

/// 1,234,567.
fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let digit = |(k, c): (usize, char)| {
        let comma = k > 0 && (digits.len() - k).is_multiple_of(3);
        comma.then_some(',').into_iter().chain([c])
    };
    digits.chars().enumerate().flat_map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!([0, 12, 1234, 1_234_567].map(grouped), ["0", "12", "1,234", "1,234,567"]);
        assert_eq!([12, 2048, 3 << 20].map(bytes_text), ["12 bytes", "2.0 KiB", "3.0 MiB"]);
        assert_eq!([0.123456, -0.0, 12345.678, -1e-9].map(significant), ["0.1235", "0", "12350", "-0.000000001"]);
        assert_eq!(
            ["a/b.GLB", "x.gltf", "builtin:stairs", "stairs"].map(format_of)[..3],
            ["glTF 2.0, binary", "glTF 2.0", "built-in"]
        );
    }
}
