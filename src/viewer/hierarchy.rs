//! The hierarchy that is drawn over the image: boxes level by level, boxes that a ray visits, and
//! influence areas, as `skylit bvh` derives them.

use std::cell::RefCell;
use std::fmt;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use obvhs::bvh2::Bvh2;

use super::request::Request;
use crate::accel::Aabb;
use crate::accel::flatten::FlatScene;
use crate::accel::lab::influence::areas_of_scene;
use crate::accel::lab::{Hierarchy, LabRay, Query, Visits, hull};
use crate::film::camera::{self, Choice};
use crate::scene::{Scene, SceneSettings};
use crate::tracer::{BuildMethod, DeviceSettings};

/// Most primitives, over all instances, of a scene whose hierarchy is shown: more take seconds to
/// build on the thread that renders.
pub const MAX_PRIMITIVES: u64 = 2_000_000;
/// Most boxes that are drawn at once.
pub const MAX_BOXES: usize = 2000;
/// Boxes that are drawn at once unless another number is chosen.
const DEFAULT_BOXES: usize = 300;

/// Boxes of the hierarchy that are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShownBoxes {
    /// None.
    #[default]
    None,
    /// Boxes of a level.
    Level,
    /// Boxes that the ray of the pixel visits that was clicked on last.
    Ray,
}

impl ShownBoxes {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Level, Self::Ray];

    /// Name in lists.
    pub fn label(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Level => "of a level",
            Self::Ray => "that a ray visits",
        }
    }
}

/// Choices of the panel, and what the renderer found for them.
#[derive(Debug)]
pub struct HierarchyState {
    /// Which boxes are drawn.
    pub boxes: ShownBoxes,
    /// The level whose boxes are drawn, inner nodes above them.
    pub level: usize,
    /// Number of boxes that are drawn at most, up to [`MAX_BOXES`].
    pub most: usize,
    /// Whether influence areas are drawn.
    pub shows_areas: bool,
    /// Origin and unit direction, in world space, of the ray of the pixel that was clicked on last.
    pub ray: Option<(DVec3, DVec3)>,
    /// The last answer of the renderer.
    pub found: Option<FoundHierarchy>,
    /// Visits of the last ray, with the tree that it was traced in.
    visited: Option<(Arc<SceneHierarchy>, Arc<RayVisits>)>,
}

impl Default for HierarchyState {
    fn default() -> Self {
        Self {
            boxes: ShownBoxes::None,
            level: 4,
            most: DEFAULT_BOXES,
            shows_areas: false,
            ray: None,
            found: None,
            visited: None,
        }
    }
}

impl HierarchyState {
    /// Whether anything of it is drawn.
    pub fn is_shown(&self) -> bool {
        self.boxes != ShownBoxes::None || self.shows_areas
    }

    /// Visits of the ray that was clicked on last, traced once for each ray and tree.
    pub fn visits(&mut self, tree: &Arc<SceneHierarchy>) -> Option<Arc<RayVisits>> {
        let ray = self.ray?;
        let is_known =
            |(of, visits): &(Arc<SceneHierarchy>, Arc<RayVisits>)| Arc::ptr_eq(of, tree) && visits.ray == ray;
        if !self.visited.as_ref().is_some_and(is_known) {
            self.visited = Some((tree.clone(), Arc::new(tree.visits(ray))));
        }
        self.visited.as_ref().map(|(_, visits)| visits.clone())
    }
}

/// Everything that a scene's hierarchy depends on: the one of another key is out of date.
#[derive(Clone, Debug, PartialEq)]
pub struct HierarchyKey {
    load: u64,
    meaning: SceneSettings,
    build: (BuildMethod, Option<DVec3>, Option<DVec3>, bool),
    animation: Option<usize>,
}

impl HierarchyKey {
    /// The key of what is requested.
    pub fn of_request(request: &Request) -> Self {
        let device = &request.device;
        Self {
            load: request.load,
            // materials are edited without building anything anew
            meaning: SceneSettings { material: Vec::new(), ..request.meaning.clone() },
            build: (device.build(), device.build_direction, device.build_eye, device.build_areas.is_some()),
            animation: request.animation,
        }
    }
}

/// Hierarchy and influence areas of a scene.
#[derive(Clone, Debug)]
pub struct FoundHierarchy {
    /// Everything that it depends on.
    pub key: HierarchyKey,
    /// The hierarchy; or why there is none, in a sentence.
    pub tree: Result<Arc<SceneHierarchy>, String>,
    /// Influence areas of lights and of the scene's camera.
    pub areas: Vec<AreaFrame>,
}

/// The outline of an influence area.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaFrame {
    /// The light or camera that it is of.
    pub name: String,
    /// Corners in world space, numbered as those of a box.
    pub corners: [DVec3; 8],
}

/// The influence areas of a scene's lights, and of the camera that `skylit bvh` would choose.
pub fn areas(scene: &Scene, aspect: f64) -> Vec<AreaFrame> {
    let cameras: Vec<_> = camera::choose(scene, &Choice::Auto, aspect).into_iter().collect();
    let origin = scene.origin();
    let areas = areas_of_scene(scene, &cameras, origin);
    areas.into_iter().map(|a| AreaFrame { corners: a.region.corners().map(|c| c + origin), name: a.name }).collect()
}

/// A box of the hierarchy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeBox {
    bounds: Aabb,
    /// The instance whose group it is in; none at the top, or where there is only one.
    instance: Option<u32>,
    /// Inner nodes above it.
    pub level: usize,
    /// Whether primitives are beneath it, rather than boxes.
    pub is_leaf: bool,
}

/// The boxes of a level.
#[derive(Clone, Debug, Default)]
pub struct LevelBoxes {
    /// How many there are.
    pub count: usize,
    /// How many of them are leaves.
    pub leaves: usize,
    /// The largest by surface area, the largest first, up to [`MAX_BOXES`].
    pub largest: Vec<TreeBox>,
}

/// Boxes and counts of a ray.
#[derive(Debug)]
pub struct RayVisits {
    /// Origin and unit direction, in world space.
    pub ray: (DVec3, DVec3),
    /// Counts to its closest hit.
    pub counts: Visits,
    /// Distance of the hit, scene units.
    pub distance: Option<f64>,
    /// Boxes of the nodes that it visits, in this order.
    pub boxes: Vec<TreeBox>,
}

/// The trees that the compute tracer traverses, as the laboratory builds them: binary, of which its
/// wider nodes are made.
pub struct SceneHierarchy {
    tree: Hierarchy,
    origin: DVec3,
    /// Inner nodes above each node of each group, and of the top level.
    depths: (Vec<Vec<u8>>, Vec<u8>),
    /// Inner nodes above the root of each instance.
    instance_levels: Vec<usize>,
    /// The boxes level by level, from the root.
    pub levels: Vec<LevelBoxes>,
    /// Number of primitives over all instances.
    pub primitives: u64,
}

impl fmt::Debug for SceneHierarchy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SceneHierarchy").field("levels", &self.levels.len()).finish_non_exhaustive()
    }
}

impl SceneHierarchy {
    /// Builds the trees of a scene by the options of a device. An error says in a sentence why
    /// there is nothing to show.
    pub fn build(scene: &Scene, settings: &DeviceSettings) -> Result<Self, String> {
        let primitives = scene.triangle_count() + scene.sphere_count();
        if primitives > MAX_PRIMITIVES {
            return Err(format!(
                "The hierarchy is not shown: the scene has {primitives} primitives over all instances, and up to {MAX_PRIMITIVES} are shown."
            ));
        }
        let flat = FlatScene::new(scene);
        let tree = Hierarchy::build(&flat, &settings.builder(flat.origin));
        if tree.root_tree().is_none_or(|root| root.nodes.is_empty()) {
            return Err("The hierarchy is not shown: the scene has no surfaces.".into());
        }
        let groups = tree.groups.iter().map(|(tree, _)| depths(tree)).collect();
        let top = tree.top.as_ref().map_or_else(Vec::new, |(top, _)| depths(top));
        let mut out = Self {
            instance_levels: instance_levels(&tree, &top),
            depths: (groups, top),
            tree,
            origin: flat.origin,
            levels: Vec::new(),
            primitives,
        };
        out.levels = out.all_levels();
        Ok(out)
    }

    /// The tree of an instance's group, or the one that traversal begins with.
    fn tree_of(&self, instance: Option<u32>) -> Option<&Bvh2> {
        match instance {
            Some(k) => Some(&self.tree.groups[self.tree.instances[k as usize].0].0),
            None => self.tree.root_tree(),
        }
    }

    /// Whether the leaves of the tree that traversal begins with are instances.
    fn has_top(&self) -> bool {
        self.tree.top.is_some()
    }

    fn tree_box(&self, instance: Option<u32>, node: usize) -> Option<TreeBox> {
        let at = self.tree_of(instance)?.nodes.get(node)?;
        let (depths, above) = match instance {
            Some(k) => {
                let group = self.tree.instances[k as usize].0;
                (&self.depths.0[group], self.instance_levels[k as usize])
            }
            None if self.has_top() => (&self.depths.1, 0),
            None => (self.depths.0.first()?, 0),
        };
        Some(TreeBox {
            bounds: Aabb { min: at.min, max: at.max },
            instance,
            level: above + usize::from(depths[node]),
            is_leaf: at.is_leaf() && !(instance.is_none() && self.has_top()),
        })
    }

    /// The boxes of all levels: those of instances come beneath the leaves of the top level.
    fn all_levels(&self) -> Vec<LevelBoxes> {
        let mut levels = Vec::new();
        let mut work = vec![(None, 0usize)];
        while !work.is_empty() {
            // this level, its largest boxes first
            let boxes = work.iter().filter_map(|&(instance, node)| self.tree_box(instance, node));
            let mut sized: Vec<(f64, TreeBox)> = boxes.map(|b| (self.area(&b), b)).collect();
            sized.sort_by(|a, b| b.0.total_cmp(&a.0));
            let leaves = sized.iter().filter(|(_, b)| b.is_leaf).count();
            let largest = sized.iter().take(MAX_BOXES).map(|(_, b)| *b).collect();
            levels.push(LevelBoxes { count: sized.len(), leaves, largest });

            // what is beneath it
            let mut next = Vec::new();
            for &(instance, node) in &work {
                let Some(tree) = self.tree_of(instance) else { continue };
                let at = &tree.nodes[node];
                let first = at.first_index as usize;
                if !at.is_leaf() {
                    next.extend([(instance, first), (instance, first + 1)]);
                } else if instance.is_none() && self.has_top() {
                    let below = &tree.primitive_indices[first..first + at.prim_count as usize];
                    let has_nodes = |k: &u32| self.tree_of(Some(*k)).is_some_and(|t| !t.nodes.is_empty());
                    next.extend(below.iter().copied().filter(has_nodes).map(|k| (Some(k), 0)));
                }
            }
            work = next;
        }
        levels
    }

    /// Corners of a box in world space.
    pub fn corners(&self, b: &TreeBox) -> [DVec3; 8] {
        let to_world = b.instance.map_or(DAffine3::IDENTITY, |k| self.tree.instances[k as usize].1.inverse());
        std::array::from_fn(|k| to_world.transform_point3(hull::corner(&b.bounds, k as u8)) + self.origin)
    }

    /// Half of a box's surface area in world space.
    fn area(&self, b: &TreeBox) -> f64 {
        let corners = self.corners(b);
        let [x, y, z] = [1, 2, 4].map(|k| corners[k] - corners[0]);
        x.cross(y).length() + y.cross(z).length() + z.cross(x).length()
    }

    /// Traces a ray of world space to its closest hit, and notes what it visits on the way.
    pub fn visits(&self, ray: (DVec3, DVec3)) -> RayVisits {
        let traced = LabRay::new(ray.0 - self.origin, ray.1, 0.0, f64::INFINITY);
        let (mut counts, seen) = (Visits::default(), RefCell::new(Vec::new()));
        let note = |instance: Option<u32>, node: usize| seen.borrow_mut().push((instance, node));
        let hit = self.tree.trace_seen(&traced, Query::Closest, &mut counts, &note);
        let boxes = seen.into_inner().into_iter().filter_map(|(instance, node)| self.tree_box(instance, node));
        RayVisits { ray, boxes: boxes.collect(), counts, distance: hit.map(|hit| hit.t) }
    }
}

/// Inner nodes above each node of a tree.
fn depths(tree: &Bvh2) -> Vec<u8> {
    let mut out = vec![0u8; tree.nodes.len()];
    let mut work: Vec<usize> = (0..tree.nodes.len().min(1)).collect();
    while let Some(at) = work.pop() {
        let node = &tree.nodes[at];
        if !node.is_leaf() {
            for child in [0, 1].map(|k| node.first_index as usize + k) {
                // trees are bounded in depth
                out[child] = out[at].saturating_add(1);
                work.push(child);
            }
        }
    }
    out
}

/// Inner nodes above the root of each instance: those above its leaf of the top level, and one for
/// the leaf.
fn instance_levels(tree: &Hierarchy, depths: &[u8]) -> Vec<usize> {
    let mut out = vec![0; tree.instances.len()];
    let Some((top, _)) = &tree.top else { return out };
    for (node, depth) in top.nodes.iter().zip(depths).filter(|(node, _)| node.is_leaf()) {
        let first = node.first_index as usize;
        for &instance in &top.primitive_indices[first..first + node.prim_count as usize] {
            out[instance as usize] = usize::from(*depth) + 1;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::survey::rays::camera_ray;
    use crate::scene::builtin;

    fn built(name: &str) -> (Scene, SceneHierarchy) {
        let scene = builtin::by_name(name).unwrap();
        let tree = SceneHierarchy::build(&scene, &DeviceSettings::default()).unwrap();
        (scene, tree)
    }

    /// One level and two, a scene far from the origin, and spheres.
    #[test]
    fn levels_have_the_boxes_of_the_trees() {
        for name in ["cornell-box", "grid:3", "spheres:200", "far-away"] {
            let (scene, tree) = built(name);
            let (lo, hi) = scene.bounds().unwrap();
            let size = (hi - lo).length();
            assert_eq!(tree.levels[0].count, 1);
            for (k, level) in tree.levels.iter().enumerate() {
                assert!(level.count > 0 && level.largest.len() == level.count.min(MAX_BOXES), "{name} {k}");
                let areas: Vec<f64> = level.largest.iter().map(|b| tree.area(b)).collect();
                assert!(areas.is_sorted_by(|a, b| a >= b), "{name} {k}");
                for b in &level.largest {
                    assert_eq!(b.level, k, "{name}");
                    let corners = tree.corners(b);
                    let margin = 1e-3 * size;
                    // boxes around turned boxes stick out of the bounds
                    let is_turned = tree.has_top();
                    let is_inside = |c: &DVec3| c.cmpge(lo - margin).all() && c.cmple(hi + margin).all();
                    assert!(is_turned || corners.iter().all(is_inside), "{name} {k}: {corners:?}");
                }
            }
            // leaves have up to four primitives
            let leaves = tree.levels.iter().map(|l| l.leaves).sum::<usize>() as u64;
            assert!(leaves <= tree.primitives && 4 * leaves >= tree.primitives, "{name}: {leaves}");
        }
        // of a single level children are two for each inner node
        let (_, tree) = built("cornell-box");
        for pair in tree.levels.windows(2) {
            assert_eq!(2 * (pair[0].count - pair[0].leaves), pair[1].count);
        }
    }

    /// The boxes are as many as the nodes that the counts name, from the root down, and the ray
    /// passes through each.
    #[test]
    fn a_ray_visits_boxes_that_it_meets() {
        for name in ["stairs", "grid:3", "far-away"] {
            let (scene, tree) = built(name);
            let mut hits = 0;
            for k in 0..60 {
                let at = [f64::from(k % 10) / 9.0, f64::from(k / 10) / 5.0];
                let ray = camera_ray(&scene.cameras[0], at, 1.5);
                let visits = tree.visits(ray);
                if visits.boxes.is_empty() {
                    assert_eq!((visits.counts.nodes, visits.distance), (0, None));
                    continue;
                }
                hits += usize::from(visits.distance.is_some());
                assert_eq!(visits.boxes[0].level, 0);
                let leaves = visits.boxes.iter().filter(|b| b.is_leaf).count() as u64;
                assert!(visits.counts.nodes + leaves <= visits.boxes.len() as u64);
                assert!(leaves <= visits.counts.primitives && visits.counts.boxes > visits.counts.nodes);
                let reach = (ray.0 - tree.origin).length() + tree.area(&visits.boxes[0]).sqrt();
                for b in &visits.boxes {
                    assert!(passes(&tree.corners(b), ray, 1e-5 * reach), "{name} {k}: {b:?}");
                }
            }
            assert!(hits > 10, "{name}");
        }
    }

    /// Whether a ray passes through a parallelepiped: it does so if it is within all three pairs of
    /// faces at once.
    fn passes(corners: &[DVec3; 8], (from, direction): (DVec3, DVec3), slack: f64) -> bool {
        let axes = [1, 2, 4].map(|k| corners[k] - corners[0]);
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        for k in 0..3 {
            // a flat box has a normal, too
            let n = axes[(k + 1) % 3].cross(axes[(k + 2) % 3]);
            let Some(n) = n.try_normalize() else { continue };
            let (lo, hi) = (n.dot(corners[0]), n.dot(corners[7]));
            let (lo, hi) = (lo.min(hi) - slack, lo.max(hi) + slack);
            let [a, b] = [lo, hi].map(|d| (d - n.dot(from)) / n.dot(direction));
            if n.dot(direction).abs() > 1e-12 {
                (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
            } else if !(lo..=hi).contains(&n.dot(from)) {
                return false;
            }
        }
        near <= far
    }

    #[test]
    fn scenes_that_are_not_shown_say_why() {
        let none = DeviceSettings::default();
        let large = builtin::by_name("instances:3000000").unwrap();
        let e = SceneHierarchy::build(&large, &none).unwrap_err();
        assert!(e.contains("primitives over all instances") && e.contains("2000000"), "{e}");
        let e = SceneHierarchy::build(&Scene::default(), &none).unwrap_err();
        assert!(e.contains("no surfaces"), "{e}");
    }

    /// The trees are those of the chosen build, and areas are those of `skylit bvh`.
    #[test]
    fn builds_and_areas_are_those_of_the_settings() {
        let scene = builtin::by_name("atrium").unwrap();
        let settings = |build| DeviceSettings { build: Some(build), ..Default::default() };
        let count = |build| SceneHierarchy::build(&scene, &settings(build)).unwrap().levels.len();
        assert_ne!(count(BuildMethod::SahLongest), count(BuildMethod::Default));
        let mut lit = builtin::by_name("stairs").unwrap();
        crate::scene::light_spec::parse("sun direction=-1,-2,-1 irradiance=3").unwrap().add(&mut lit);
        let names: Vec<String> = areas(&lit, 1.5).into_iter().map(|a| a.name).collect();
        assert_eq!(names.len(), 2, "{names:?}");
        assert!(names[0].contains("light") && names[1].contains("camera"), "{names:?}");
    }
}
