//! `skylit bvh`: what the hierarchy of a scene is like, and what rays cost in it. Everything is
//! counted on the host; no device is opened.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueHint};
use glam::DVec3;
use serde_json::json;

use super::args::LoadArgs;
use super::rays::read_rays;
use crate::accel::flatten::FlatScene;
use crate::accel::lab::analysis::{TreeAnalysis, TreeCost, analyse};
use crate::accel::lab::budget::{IMAGE_RAYS, LightBudget, Whole, light_budget};
use crate::accel::lab::builder::MAX_LEAF;
use crate::accel::lab::influence::{
    InfluenceArea, Placement, areas_of_rays, areas_of_scene, distribution_of, light_name,
};
use crate::accel::lab::local::{FallbackStart, LocalTrees, TopLevelKind};
use crate::accel::lab::streams::{
    RayStream, camera_rays, corners, image_streams, parallel_rays, point_rays, surfaces, usual_lights,
};
use crate::accel::lab::{Body, Builder, Heuristic, HeuristicChoice, Hierarchy, LabRay, Query, RayDistribution, Visits};
use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::film::camera::{self, Choice};
use crate::integrators::rays;
use crate::ray::{Ray, translate};
use crate::scene::{Camera, Light, Scene, SceneSettings};
use crate::settings::parse::parse_vector;
use crate::terminal::console::{Failure, Verbosity};
use crate::terminal::interrupt;
use crate::terminal::warnings::Warnings;
use crate::tracer::BuildMethod;
use crate::tracer::visits::VisitCounter;

const EXAMPLES: &str = "\
Examples:
  skylit bvh scene.glb                                     what is the hierarchy like, and what do rays cost?
  skylit bvh scene.glb --build pah-spfh --direction 0,-1,0 built for rays from straight above
  skylit bvh scene.glb --rays set.ao.bin --json            counts of recorded rays
  skylit bvh scene.glb --html report                       level by level, with the worst subtrees";

/// Image whose rays are counted where none are given.
const IMAGE: [u32; 2] = [128, 72];
/// Length of occlusion rays, as a share of the diagonal of the bounds.
const AO_RADIUS: f64 = 0.1;
/// Rays of a direction or a point.
const RAYS: usize = 10_000;
/// Recorded rays that are counted at most: evenly spaced ones of a larger set.
const MAX_RAYS: usize = 100_000;
/// Lights whose budgets are counted.
const MAX_LIGHTS: usize = 16;
/// Primitives, over all instances, up to which budgets of lights are counted: each light's trees
/// are built over all of them.
const MAX_BUDGET_PRIMITIVES: u64 = 2_000_000;
/// Trees of groups that text and pages show; JSON has all.
const SHOWN_TREES: usize = 5;

/// `skylit bvh`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BvhArgs {
    /// Scene file (.gltf, .glb, .obj, .brhan) or builtin:NAME
    #[arg(value_hint = ValueHint::FilePath)]
    pub scene: String,
    /// How the trees are built
    #[arg(long, value_enum, default_value = "default")]
    pub build: BuildMethod,
    /// Recorded rays to measure with, as `render --dump-rays` writes them
    ///
    /// Each is f32 origin[3], tmin, direction[3], tmax.
    #[arg(long, value_name = "RAYS.bin", value_hint = ValueHint::FilePath, conflicts_with_all = ["direction", "eye"])]
    pub rays: Option<PathBuf>,
    /// Direction of parallel rays to measure with
    ///
    /// The tree is built for them by --build sah-spfh and pah..., and judged by them.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, conflicts_with = "eye")]
    pub direction: Option<DVec3>,
    /// Rays through this point in place of parallel ones
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub eye: Option<DVec3>,
    /// Also measure local trees of influence areas: of a JSON file, `scene` or `rays`
    ///
    /// `scene` takes those of the scene's lights and cameras, `rays` that of the recorded rays.
    #[arg(long, value_name = "FILE.json|scene|rays", value_hint = ValueHint::FilePath)]
    pub areas: Option<String>,
    /// Also say of each light whether a tree of its own would pay
    ///
    /// Trees of each light are built twice over all primitives, which takes a while. It is for the
    /// rays of an image, which --rays, --direction and --eye replace.
    #[arg(long, conflicts_with_all = ["rays", "direction", "eye"])]
    pub light_trees: bool,
    /// Bins between which split planes lie, for the rules of the laboratory
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(2..=Heuristic::MAX_BINS as i64), hide_short_help = true)]
    pub bins: u32,
    /// Primitives at or below which the laboratory makes a leaf
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=4), hide_short_help = true)]
    pub leaf: u32,
    /// Also count nodes and leaves of the seven-wide kernel's hierarchy
    ///
    /// It is for scenes of one level without spheres and alpha.
    #[arg(long)]
    pub wide: bool,
    /// Write the trees themselves: corners, children and primitives of each node
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    pub tree: Option<PathBuf>,
    /// Write a report, an HTML page that needs no network, into this folder
    #[cfg(feature = "report")]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub html: Option<PathBuf>,
    /// Files of the scene
    #[command(flatten)]
    pub load: LoadArgs,
    /// Meaning of the file
    #[command(flatten)]
    pub meaning: SceneSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

/// One of the trees, with its analysis.
#[derive(Clone, Debug, serde::Serialize)]
pub struct NamedTree {
    /// `top level`, or the group's mesh.
    pub name: String,
    /// Number of instances of the group.
    pub instances: u64,
    /// Figures of the tree.
    #[serde(flatten)]
    pub analysis: TreeAnalysis,
}

/// Counts of a stream of rays, means over its rays.
#[derive(Clone, Debug, serde::Serialize)]
pub struct StreamCounts {
    /// Name of the stream.
    pub name: String,
    /// `closest`, `any`, or `exhaustive`: no early out, the count that areas predict.
    pub query: &'static str,
    /// `nearest`, the binary kernel; `wide`; or `local trees`.
    pub kernel: &'static str,
    /// Number of rays.
    pub rays: usize,
    /// Share of them that hits something.
    pub hits: f64,
    /// Inner nodes visited a ray.
    pub nodes: f64,
    /// Boxes tested a ray.
    pub boxes: Option<f64>,
    /// Primitives tested a ray (leaves of one or two triangles in the wide hierarchy).
    pub primitives: f64,
    /// 2.0 an inner node and 1.2 a primitive.
    pub cost: f64,
}

impl StreamCounts {
    fn new(stream: &RayStream, query: Query, kernel: &'static str, (visits, hits): (Visits, u64)) -> Self {
        let rays = stream.rays.len();
        let mean = |n: u64| n as f64 / rays.max(1) as f64;
        Self {
            name: stream.name.clone(),
            query: query_name(query),
            kernel,
            rays,
            hits: mean(hits),
            nodes: mean(visits.nodes),
            boxes: Some(mean(visits.boxes)),
            primitives: mean(visits.primitives),
            cost: visits.cost() / rays.max(1) as f64,
        }
    }
}

/// Everything that text, JSON and the page show.
pub struct BvhReport {
    /// The scene, as it was named.
    pub scene: String,
    /// Name of the build.
    pub build: &'static str,
    /// The rays that the tree is judged by.
    pub rays: Option<RayDistribution>,
    /// Seconds to build.
    pub build_seconds: f64,
    /// The top level first, then groups by their number of primitives.
    pub trees: Vec<NamedTree>,
    /// Expected cost of a ray that meets the scene's bounds, over both levels, by surface area.
    pub predicted: TreeCost,
    /// Counts of rays.
    pub streams: Vec<StreamCounts>,
    /// Whether a local tree would pay, light by light.
    pub lights: Vec<LightBudget>,
    /// Names of influence areas, and the primitives in their trees.
    pub areas: Vec<(String, u64)>,
    /// Names of meshes and their materials, by the index of the mesh.
    pub meshes: Vec<[String; 2]>,
    /// Sentences about what is left out.
    pub warnings: Vec<String>,
}

/// Builds, analyses, measures and reports.
pub fn run(args: &BvhArgs) -> Result<(), Failure> {
    interrupt::install();
    let start = Instant::now();
    let console = args.verbosity.console();
    // it keeps the folder of the page, which is removed with it while it is empty
    let plan = args.check()?;
    let areas_file = args.areas.as_deref().filter(|a| !["scene", "rays"].contains(a));
    let placements = areas_file.map(|f| Placement::read_list(f.as_ref())).transpose()?;

    // the scene, and rays around the same origin
    let mut scene = args.load.load(&args.scene, &console)?;
    args.meaning.apply(&mut scene)?;
    plan.check_scene(&scene.report.files)?;
    let mut warnings = Warnings::new(console);
    scene.report.all_warnings().iter().for_each(|w| warnings.add(w));
    let flat = FlatScene::new(&scene);
    if flat.has_alpha() {
        warnings.add("alpha masks are ignored: rays hit what is cut out of surfaces, too");
    }
    let recorded = args.rays.as_deref().map(|path| -> Result<Vec<LabRay>> {
        let mut set = read_rays(path)?;
        rays::check(&set)?;
        translate(&mut set, -flat.origin);
        let step = set.len().div_ceil(MAX_RAYS);
        Ok(set.iter().step_by(step).map(LabRay::from).collect())
    });
    let recorded = recorded.transpose()?;
    let bounds = corners(&scene, flat.origin)
        .filter(|_| flat.primitive_count() > 0)
        .ok_or_else(|| Error::Scene(format!("{}: has no surfaces, and so no hierarchy", args.scene)))?;

    // the hierarchy, built and looked at
    let distribution = args.distribution(flat.origin, recorded.as_deref(), &bounds)?;
    let builder = args.builder(distribution.unwrap_or_default());
    let building = Instant::now();
    let hierarchy = Hierarchy::build(&flat, &builder);
    let build_seconds = building.elapsed().as_secs_f64();
    let trees = analyses(&flat, &hierarchy, distribution.as_ref());
    let predicted = predicted(&flat, &hierarchy, &trees);

    // rays
    let streams = args.streams(&flat, &hierarchy, recorded.clone(), &bounds)?;
    let mut counts: Vec<StreamCounts> = streams.iter().flat_map(|s| count(&hierarchy, s)).collect();
    if args.wide {
        match VisitCounter::new(&flat) {
            Some(counter) => counts.extend(streams.iter().map(|s| count_wide(&counter, s))),
            None => warnings.add("--wide is left out: it is for scenes of one level without spheres and alpha"),
        }
    }

    // whether local trees would pay: for the lights of an image
    let lights = if args.light_trees {
        budgets(args, &flat, &hierarchy, &builder, &bounds).unwrap_or_else(|e| {
            warnings.add(&format!("no light is asked whether a local tree would pay: {e}"));
            Vec::new()
        })
    } else {
        Vec::new()
    };
    if args.light_trees && scene.lights.len() > MAX_LIGHTS {
        warnings.add(&format!("of {} lights the first {MAX_LIGHTS} are asked whether a tree pays", scene.lights.len()));
    }

    // local trees
    let mut areas = Vec::new();
    if let Some(chosen) = &args.areas {
        let found = match (placements, recorded.as_deref()) {
            (Some(list), _) => list.iter().map(|p| p.area(flat.origin)).collect(),
            (None, Some(rays)) if chosen == "rays" => areas_of_rays("recorded rays", rays, &bounds),
            _ => areas_of_scene(&scene, &[image_camera(&scene)?], flat.origin),
        };
        if found.is_empty() {
            warnings.add("--areas: the rays have neither a direction nor a point in common, so there is no area");
        } else {
            areas = count_local(&flat, found, &args.local_heuristic(), &streams, &mut counts)?;
        }
    }
    let mut report = BvhReport {
        scene: args.scene.clone(),
        build: args.build.name(),
        rays: distribution,
        build_seconds,
        trees,
        predicted,
        streams: counts,
        lights,
        areas,
        meshes: mesh_names(&scene),
        warnings: Vec::new(),
    };

    // text, files and the record
    text(&report).iter().try_for_each(|line| console.line(line))?;
    if let Some(path) = &args.tree {
        write_trees(path, &hierarchy)?;
    }
    report.warnings = warnings.list.clone();
    let mut record = record(&report);
    #[cfg(feature = "report")]
    if let Some(dir) = &args.html {
        let index = super::bvh_page::write(&report, dir)?;
        console.line(&format!("report: {}", crate::report::address(&index)))?;
        record["report"] = json!(index);
    }
    record["seconds"] = json!(start.elapsed().as_secs_f64());
    Ok(console.record(&record)?)
}

impl BvhArgs {
    /// Checks options and files before anything is loaded.
    fn check(&self) -> Result<FilePlan> {
        let mut plan = FilePlan::default();
        plan.reads("the scene", &self.scene);
        self.rays.iter().for_each(|path| plan.reads("--rays", path));
        let areas = self.areas.iter().filter(|a| *a != "scene" && *a != "rays");
        areas.for_each(|path| plan.reads("--areas", path));
        self.tree.iter().for_each(|path| plan.writes("--tree", path));
        #[cfg(feature = "report")]
        self.html.iter().for_each(|folder| plan.writes_report("--html", folder));
        plan.check()?;
        self.tree.as_deref().map_or(Ok(()), files::check_writable)?;
        if self.direction == Some(DVec3::ZERO) {
            return Err(Error::Usage("--direction 0,0,0 is no direction: give another".into()));
        }
        if self.areas.as_deref() == Some("rays") && self.rays.is_none() {
            return Err(Error::Usage("--areas rays: add --rays RAYS.bin, or use --areas scene".into()));
        }
        if self.build == BuildMethod::Device {
            return Err(Error::Usage("--build device makes wide nodes for a tracer, and none of these trees".into()));
        }
        let is_given = self.direction.is_some() || self.eye.is_some() || self.rays.is_some();
        if self.build.heuristic().is_some_and(HeuristicChoice::needs_rays) && !is_given {
            return Err(Error::Usage(format!(
                "--build {} is for rays that are known: add --direction X,Y,Z, --eye X,Y,Z or --rays RAYS.bin",
                self.build
            )));
        }
        #[cfg(feature = "report")]
        self.html.as_ref().map_or(Ok(()), |folder| plan.make_folder(folder))?;
        Ok(plan)
    }

    /// The rays that the tree is built for and judged by.
    fn distribution(
        &self,
        origin: DVec3,
        recorded: Option<&[LabRay]>,
        bounds: &[DVec3; 8],
    ) -> Result<Option<RayDistribution>> {
        let given =
            self.direction.map(RayDistribution::Parallel).or(self.eye.map(|e| RayDistribution::Point(e - origin)));
        let Some(rays) = recorded.filter(|_| given.is_none()) else { return Ok(given) };
        let found = distribution_of(&areas_of_rays("recorded rays", rays, bounds));
        if found.is_none() && self.build.heuristic().is_some_and(HeuristicChoice::needs_rays) {
            let path = self.rays.clone().unwrap_or_default();
            let why = format!(
                "the rays have neither a direction nor a point in common, which --build {} needs: use --build sah",
                self.build
            );
            return Err(Error::input(path, why));
        }
        Ok(found)
    }

    /// The rays that are counted: those that are given, or those of an image.
    fn streams(
        &self,
        flat: &FlatScene,
        hierarchy: &Hierarchy,
        recorded: Option<Vec<LabRay>>,
        bounds: &[DVec3; 8],
    ) -> Result<Vec<RayStream>> {
        let given = match (recorded, self.direction, self.eye) {
            (Some(rays), ..) => ("recorded", rays),
            (_, Some(direction), _) => ("parallel", parallel_rays(direction, bounds, RAYS)),
            (.., Some(eye)) => ("from the eye", point_rays(eye - flat.origin, bounds, RAYS)),
            _ => {
                let radius = AO_RADIUS * bounds[0].distance(bounds[7]);
                let camera = image_camera(flat.scene)?;
                return Ok(image_streams(hierarchy, flat.scene, &camera, flat.origin, IMAGE, radius));
            }
        };
        Ok(vec![RayStream { name: given.0.into(), query: Query::Closest, rays: given.1 }])
    }

    fn builder(&self, rays: RayDistribution) -> Builder {
        match self.build.builder(rays) {
            Builder::Heuristic(h) => Builder::Heuristic(self.with_constants(h)),
            preset => preset,
        }
    }

    /// The rules of local trees: those of --build, or Falcone's.
    fn local_heuristic(&self) -> Heuristic {
        let choice = self.build.heuristic().unwrap_or(HeuristicChoice::PahSpfh);
        self.with_constants(choice.heuristic(RayDistribution::Uniform))
    }

    fn with_constants(&self, mut h: Heuristic) -> Heuristic {
        h.bins = self.bins as usize;
        h.stop.at_most = self.leaf;
        h
    }
}

/// The analyses of all trees, the top level first, then the largest groups.
fn analyses(flat: &FlatScene, hierarchy: &Hierarchy, rays: Option<&RayDistribution>) -> Vec<NamedTree> {
    let mut out = Vec::new();
    for (k, (tree, body)) in hierarchy.groups.iter().enumerate() {
        let instances: Vec<_> = flat.instances.iter().filter(|i| i.group == k).collect();
        let own = match instances[..] {
            [only] => rays.map(|r| r.transformed(&only.to_world.inverse())),
            _ => None,
        };
        let parts = &flat.groups[k].submeshes;
        let name = match parts.as_slice() {
            [one] => named(&flat.scene.meshes[one.mesh].name, one.mesh),
            _ => format!("{} meshes of one instance", parts.len()),
        };
        let analysis = analyse(tree, Some(body), own.as_ref());
        out.push(NamedTree { name, instances: instances.len() as u64, analysis });
    }
    out.sort_by_key(|t| std::cmp::Reverse(t.analysis.primitives));
    if let Some((top, _)) = &hierarchy.top {
        let analysis = analyse(top, None, rays);
        out.insert(0, NamedTree { name: "top level".into(), instances: 1, analysis });
    }
    out
}

/// The expected cost over both levels: a leaf of the top level costs what its group's tree does.
fn predicted(flat: &FlatScene, hierarchy: &Hierarchy, trees: &[NamedTree]) -> TreeCost {
    let Some((top, _)) = &hierarchy.top else { return trees.first().map_or_else(Default::default, |t| t.analysis.sah) };
    let costs: Vec<TreeCost> = hierarchy.groups.iter().map(|(tree, _)| analyse(tree, None, None).sah).collect();
    let area = |n: &obvhs::bvh2::node::Bvh2Node| {
        RayDistribution::Uniform.measure(&crate::accel::Aabb { min: n.min, max: n.max })
    };
    let whole = top.nodes.first().map_or(1.0, area).max(f64::MIN_POSITIVE);
    let top_nodes = trees.first().map_or(0.0, |t| t.analysis.sah.nodes);
    let mut sum = [top_nodes, 0.0];
    for node in top.nodes.iter().filter(|n| n.is_leaf()) {
        let first = node.first_index as usize;
        for &instance in &top.primitive_indices[first..first + node.prim_count as usize] {
            let cost = costs[flat.instances[instance as usize].group];
            let p = area(node) / whole;
            sum = [sum[0] + p * cost.nodes, sum[1] + p * cost.primitives];
        }
    }
    TreeCost::new(sum[0], sum[1])
}

fn query_name(query: Query) -> &'static str {
    match query {
        Query::Closest => "closest",
        Query::Any => "any",
        Query::Exhaustive => "exhaustive",
    }
}

/// Counts of a stream to the closest hit, to any, and without an early out.
fn count(hierarchy: &Hierarchy, stream: &RayStream) -> Vec<StreamCounts> {
    let each = |query| {
        let (visits, hits) = hierarchy.visits(&stream.rays, query);
        StreamCounts::new(stream, query, "nearest", (visits, hits))
    };
    [Query::Closest, Query::Any, Query::Exhaustive].map(each).to_vec()
}

/// Counts of a stream in the wide hierarchy.
fn count_wide(counter: &VisitCounter, stream: &RayStream) -> StreamCounts {
    let rays: Vec<Ray> = stream.rays.iter().map(|r| Ray::new(r.origin, r.direction, [r.tmin, r.tmax])).collect();
    let visits = counter.mean(&rays, stream.query == Query::Any);
    StreamCounts {
        name: stream.name.clone(),
        query: query_name(stream.query),
        kernel: "wide",
        rays: rays.len(),
        hits: f64::NAN,
        nodes: visits.nodes,
        boxes: None,
        primitives: visits.leaves,
        cost: 2.0 * visits.nodes + 1.2 * visits.leaves,
    }
}

/// Adds counts of each stream with local trees of some areas; returns the areas with the primitives
/// in their trees.
fn count_local(
    flat: &FlatScene,
    areas: Vec<InfluenceArea>,
    heuristic: &Heuristic,
    streams: &[RayStream],
    counts: &mut Vec<StreamCounts>,
) -> Result<Vec<(String, u64)>> {
    let body = Body::from_scene(flat)?;
    let whole = Builder::Heuristic(HeuristicChoice::Sah.heuristic(RayDistribution::Uniform)).tree(&body.boxes(), 2);
    let trees = LocalTrees::build(&body, &whole, areas, *heuristic, (TopLevelKind::Octree, FallbackStart::Exit));
    for stream in streams {
        for query in [Query::Closest, Query::Any] {
            let v = trees.visits(&stream.rays, query);
            let both = v.local.plus(v.whole);
            // the top level is boxes alone
            let visits = Visits { boxes: both.boxes + v.top, ..both };
            counts.push(StreamCounts::new(stream, query, "local trees", (visits, v.hits)));
        }
    }
    Ok(trees.locals().iter().map(|l| (l.area.name.clone(), l.tree.primitive_indices.len() as u64)).collect())
}

/// The camera of the image whose rays are counted.
fn image_camera(scene: &Scene) -> Result<Camera> {
    camera::choose(scene, &Choice::Auto, f64::from(IMAGE[0]) / f64::from(IMAGE[1]))
}

/// Whether a local tree would pay for the shadow rays of each light of an image.
fn budgets(
    args: &BvhArgs,
    flat: &FlatScene,
    hierarchy: &Hierarchy,
    builder: &Builder,
    bounds: &[DVec3; 8],
) -> Result<Vec<LightBudget>> {
    if flat.scene.triangle_count() + flat.scene.sphere_count() > MAX_BUDGET_PRIMITIVES {
        let why = format!("the scene has more than {MAX_BUDGET_PRIMITIVES} primitives over all instances");
        return Err(Error::Scene(why));
    }

    // a tree over all primitives: there is one where the scene has a single level
    let (own_body, own_tree);
    let whole = match (&hierarchy.top, hierarchy.groups.first()) {
        (None, Some((tree, body))) => Whole { body, tree },
        _ => {
            own_body = Body::from_scene(flat)?;
            own_tree = builder.tree(&own_body.boxes(), MAX_LEAF);
            Whole { body: &own_body, tree: &own_tree }
        }
    };

    // lights with their names
    let numbered = flat.scene.lights.iter().take(MAX_LIGHTS).enumerate();
    let mut lights: Vec<(String, Light)> = numbered.map(|(k, l)| (light_name(l, k), l.clone())).collect();
    if lights.is_empty() {
        lights = usual_lights(flat.scene).map(|l| (format!("{} (the scene has no light)", l.name), l)).into();
    }
    let seen = surfaces(hierarchy, &camera_rays(&image_camera(flat.scene)?, flat.origin, IMAGE));
    let rules = |choice: HeuristicChoice| args.with_constants(choice.heuristic(RayDistribution::Uniform));
    let budget = |(name, light): &(String, Light)| {
        light_budget(hierarchy, &whole, (name, light), &seen, (bounds, flat.origin), rules)
    };
    Ok(lights.iter().filter_map(budget).collect())
}

/// A name; the number of what has none.
fn named(name: &str, number: usize) -> String {
    if name.is_empty() { format!("#{number}") } else { name.to_owned() }
}

fn mesh_names(scene: &Scene) -> Vec<[String; 2]> {
    let mesh = |(k, m): (usize, &crate::scene::Mesh)| {
        [named(&m.name, k), named(&scene.materials[m.material].name, m.material)]
    };
    scene.meshes.iter().enumerate().map(mesh).collect()
}

impl BvhReport {
    /// Sum over all trees.
    fn sum(&self, of: impl Fn(&TreeAnalysis) -> u64) -> u64 {
        self.trees.iter().map(|t| of(&t.analysis)).sum()
    }

    /// The trees that text and pages show.
    pub fn shown(&self) -> &[NamedTree] {
        &self.trees[..self.trees.len().min(SHOWN_TREES)]
    }

    /// Meshes of a subtree with their materials, in words.
    pub fn named_meshes(&self, meshes: &[(u32, u64)]) -> String {
        let each = meshes.iter().map(|&(mesh, n)| {
            let [mesh, material] = &self.meshes[mesh as usize];
            format!("{mesh} ({material}, {n})")
        });
        each.collect::<Vec<_>>().join(", ")
    }

    /// How it is decided whether a local tree pays; `None` where no light was asked.
    pub fn budget(&self) -> Option<String> {
        let ns = self.lights.iter().map(|l| l.box_test_ns).fold(f64::INFINITY, f64::min);
        (!self.lights.is_empty()).then(|| {
            format!(
                "A tree pays if it saves its build within the {:.0} million shadow rays of an image of 1280x720 with 64 samples a pixel; a box test takes {ns:.1} ns here.",
                IMAGE_RAYS * 1e-6
            )
        })
    }

    /// The figures of the whole, name and value.
    pub fn facts(&self) -> Vec<(String, String)> {
        let cost = |c: &TreeCost| {
            let counts = format!("{:.1} nodes and {:.1} primitives a ray", c.nodes, c.primitives);
            format!("{:.1} ({:.1} with constants swapped): {counts} expected", c.falcone, c.swapped)
        };
        let primitives =
            self.trees.iter().filter(|t| t.name != "top level").map(|t| t.analysis.primitives).sum::<u64>();
        let mut out = vec![
            ("build", format!("{}, {:.3} s", self.build, self.build_seconds)),
            ("primitives", format!("{primitives} in {} trees", self.trees.len())),
            ("nodes", format!("{} inner, {} leaves", self.sum(|a| a.inner_nodes), self.sum(|a| a.leaves))),
            ("memory", format!("{} bytes in the binary kernel", self.sum(|a| a.bytes))),
            ("SAH cost", cost(&self.predicted)),
        ];
        if let Some(rays) = &self.rays {
            out.push(("rays", rays.describe()));
            if let Some(pah) = self.trees.first().and_then(|t| t.analysis.pah) {
                out.push(("PAH cost", cost(&pah)));
            }
        }
        out.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }
}

/// The report in lines.
fn text(report: &BvhReport) -> Vec<String> {
    let mut lines: Vec<String> = report.facts().iter().map(|(k, v)| format!("{k:<12}{v}")).collect();

    // trees
    for t in report.shown() {
        let a = &t.analysis;
        lines.push(format!(
            "{:<12}{}: {} primitives, depth {}, siblings share {:.1} % of volume and {:.1} % of area, {:.1} % empty",
            "tree",
            t.name,
            a.primitives,
            a.depth,
            100.0 * a.overlap_volume,
            100.0 * a.overlap_area,
            100.0 * a.empty
        ));
    }
    if report.trees.len() > SHOWN_TREES {
        lines.push(format!("{:<12}{} more, which --json has", "", report.trees.len() - SHOWN_TREES));
    }

    // the subtrees that cost most
    if let Some(tree) = report.trees.iter().find(|t| !t.analysis.worst.is_empty()) {
        for s in tree.analysis.worst.iter().take(5) {
            lines.push(format!(
                "{:<12}{:.1} % of the cost, {} primitives at level {}: {}",
                "costly",
                100.0 * s.share,
                s.primitives,
                s.level,
                report.named_meshes(&s.meshes)
            ));
        }
    }
    lines.extend(report.areas.iter().map(|(name, n)| format!("{:<12}{name}: {n} references", "area")));

    // lights
    lines.extend(report.lights.iter().map(|l| format!("{:<12}{}", "light", l.describe())));
    lines.extend(report.budget().map(|text| format!("{:<12}{text}", "")));

    // rays
    let title = format!(
        "{:<12}{:<18} {:<11} {:<11} {:>7} {:>6} {:>8} {:>8} {:>10} {:>8}",
        "rays", "stream", "query", "kernel", "rays", "hit", "nodes", "boxes", "primitives", "cost"
    );
    lines.push(title);
    for s in &report.streams {
        let number = |x: f64| if x.is_finite() { format!("{x:.2}") } else { "-".into() };
        let boxes = s.boxes.map_or("-".into(), number);
        lines.push(format!(
            "{:<12}{:<18} {:<11} {:<11} {:>7} {:>6} {:>8} {:>8} {:>10} {:>8}",
            "",
            s.name,
            s.query,
            s.kernel,
            s.rays,
            number(s.hits),
            number(s.nodes),
            boxes,
            number(s.primitives),
            number(s.cost)
        ));
    }
    lines
}

/// The report as a record.
fn record(report: &BvhReport) -> serde_json::Value {
    let mesh = |mesh: &u32| {
        let [name, material] = &report.meshes[*mesh as usize];
        json!({ "mesh": name, "material": material })
    };
    let named: std::collections::BTreeMap<String, serde_json::Value> = report
        .trees
        .iter()
        .flat_map(|t| t.analysis.worst.iter().flat_map(|s| s.meshes.iter().map(|(k, _)| k)))
        .map(|k| (k.to_string(), mesh(k)))
        .collect();
    json!({
        "scene": report.scene,
        "build": report.build,
        "rays": report.rays.map(|r| r.describe()),
        "build_seconds": report.build_seconds,
        "inner_nodes": report.sum(|a| a.inner_nodes),
        "leaves": report.sum(|a| a.leaves),
        "bytes": report.sum(|a| a.bytes),
        "predicted": report.predicted,
        "trees": report.trees,
        "meshes": named,
        "streams": report.streams,
        "lights": report.lights,
        "areas": report.areas.iter().map(|(name, n)| json!({ "name": name, "references": n })).collect::<Vec<_>>(),
        "warnings": report.warnings,
    })
}

/// Writes the nodes of all trees: the top level is the last one.
fn write_trees(path: &std::path::Path, hierarchy: &Hierarchy) -> Result<()> {
    let all = hierarchy.groups.iter().map(|(tree, _)| tree).chain(hierarchy.top.iter().map(|(tree, _)| tree));
    let trees: Vec<serde_json::Value> = all
        .map(|tree| {
            let node = |n: &obvhs::bvh2::node::Bvh2Node| {
                let (lo, hi) = (n.min.to_array(), n.max.to_array());
                let first = n.first_index as usize;
                if n.is_leaf() {
                    let primitives = &tree.primitive_indices[first..first + n.prim_count as usize];
                    json!({ "min": lo, "max": hi, "primitives": primitives })
                } else {
                    json!({ "min": lo, "max": hi, "children": [first, first + 1] })
                }
            };
            json!({ "nodes": tree.nodes.iter().map(node).collect::<Vec<_>>() })
        })
        .collect();
    let record = json!({ "trees": trees });
    files::write_atomically(path, |file| {
        serde_json::to_writer(&mut *file, &record)?;
        file.write_all(b"\n")
    })
}
