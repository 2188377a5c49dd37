//! The node hierarchy: world transforms in f64, placed meshes, cameras and lights.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use ::gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use ::gltf::json::{Index, Node, Root};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde_json::Value;

use super::values::{text, valid};
use crate::scene::animation::LocalTransform;
use crate::scene::camera::rigid;
use crate::scene::{Camera, ClipPlanes, Light, LightKind, Projection};

/// Transforms and cameras in double precision: the crate rounds them to single precision, which is
/// too coarse for far-away scenes and would not survive a round trip through our exporter.
#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct Doubles {
    nodes: Vec<Transform>,
    cameras: Vec<CameraJson>,
    /// Read by us because the crate refuses channels without a node (KHR_animation_pointer).
    pub animations: Vec<super::animation::Animation>,
    /// Extensions of the asset, which the crate leaves out.
    pub asset: Asset,
    /// For the same reason: what the crate refuses is read again without them.
    pub skins: Vec<super::skin::Skin>,
}

/// The part of a document that describes it.
#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct Asset {
    pub extensions: Value,
}

#[derive(Deserialize)]
struct Transform {
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct CameraJson {
    perspective: Option<Perspective>,
    orthographic: Option<Orthographic>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Perspective {
    yfov: f64,
    aspect_ratio: Option<f64>,
    znear: Option<f64>,
    zfar: Option<f64>,
}

#[derive(Deserialize)]
struct Orthographic {
    xmag: f64,
    ymag: f64,
    znear: Option<f64>,
    zfar: Option<f64>,
}

/// A node of the hierarchy with its world transform.
pub(super) struct PlacedNode {
    pub node: usize,
    /// Index into the list of placed nodes.
    pub parent: Option<usize>,
    /// Number of nodes above it.
    pub level: usize,
    pub local: LocalTransform,
    pub to_world: DAffine3,
    /// Whether the node belongs to the scene that is loaded.
    pub shown: bool,
    /// Whether neither it nor a node above it is hidden (`KHR_node_visibility`), which its mesh
    /// and light are then.
    pub visible: bool,
}

/// Index of the scene that is loaded; `None` in a file without scenes. `wanted`: its name or, where
/// none is called that, its number.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn choose_scene(document: &Root, wanted: Option<&str>) -> Result<Option<usize>, String> {
    let scenes = &document.scenes;
    let Some(wanted) = wanted else {
        return match document.scene.map(|s| s.value()) {
            Some(s) if s >= scenes.len() && !scenes.is_empty() => Err(format!("the default scene {s} does not exist")),
            s => Ok((!scenes.is_empty()).then(|| s.unwrap_or(0))),
        };
    };
    let number = || wanted.parse().ok().filter(|n| *n < scenes.len());
    let found = scenes.iter().position(|s| text(&s.name) == wanted).or_else(number);
    found.map(Some).ok_or_else(|| {
        let name = |(k, s): (usize, &::gltf::json::Scene)| format!("{k} `{}`", text(&s.name));
        let all = scenes.iter().enumerate().map(name).collect::<Vec<_>>().join(", ");
        format!("--gltf-scene {wanted}: no such scene, but {}", if all.is_empty() { "none has a name" } else { &all })
    })
}

/// Every node of a scene with its world transform, parents before children, in the order of the
/// file; of everything without one. With `all` the nodes outside of the scene follow, whose
/// transforms the joints of skins may want.
///
/// # Errors
/// What is wrong, in words: indices out of range, nodes reached twice.
pub(super) fn place(
    document: &Root,
    doubles: &Doubles,
    scene: Option<usize>,
    all: bool,
) -> Result<Vec<PlacedNode>, String> {
    let nodes = &document.nodes;
    let mut parents = vec![0u32; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in children(node) {
            *parents
                .get_mut(child)
                .ok_or_else(|| format!("node {i} has the child {child}, which does not exist"))? += 1;
        }
    }

    // a node under two parents is no tree; a few of them in a row would mean exponentially many
    // instances
    if let Some(i) = parents.iter().position(|&p| p > 1) {
        return Err(format!("node {i} is the child of more than one node"));
    }

    // roots of the scene, or of everything where there is none
    let roots: Vec<usize> = match scene {
        Some(scene) => document.scenes[scene].nodes.iter().map(Index::value).collect(),
        None => (0..nodes.len()).filter(|&i| parents[i] == 0).collect(),
    };

    // nodes from their roots down
    let mut placed = Vec::new();
    let mut seen = vec![false; nodes.len()];
    let outside = (0..nodes.len()).filter(|&i| all && parents[i] == 0);
    let trees = roots.into_iter().map(|r| (r, true)).chain(outside.map(|r| (r, false)));
    for (root, shown) in trees {
        if !shown && seen[root] {
            continue;
        }
        // a stack and no recursion: files may nest deeper than the call stack
        let mut stack: Vec<(usize, Option<usize>)> = vec![(root, None)];
        while let Some((i, parent)) = stack.pop() {
            let node = nodes.get(i).ok_or_else(|| format!("the scene names node {i}, which does not exist"))?;
            if std::mem::replace(&mut seen[i], true) {
                if !shown {
                    continue;
                }
                return Err(format!("node {i} is its own ancestor, or the scene lists it twice"));
            }
            let local = doubles.nodes.get(i).map_or(Ok(LocalTransform::default()), |t| local(t, i))?;
            let above: Option<&PlacedNode> = parent.and_then(|p| placed.get(p));
            let to_world = above.map_or(local.affine(), |p| p.to_world * local.affine());
            if !to_world.is_finite() {
                return Err(format!("node {i} has a transform that is not finite"));
            }
            let index = placed.len();
            let visible = above.is_none_or(|p| p.visible) && !is_hidden(node);
            let level = above.map_or(0, |p| p.level + 1);
            placed.push(PlacedNode { node: i, parent, level, local, to_world, shown, visible });
            stack.extend(children(node).rev().map(|c| (c, Some(index))));
        }
    }

    // without a scene a circle has no root, so that no node of it was placed
    if scene.is_none()
        && let Some(i) = seen.iter().position(|s| !s)
    {
        return Err(format!("node {i} is its own ancestor"));
    }
    Ok(placed)
}

/// Returns true if a node says that it and all below it are not to be seen.
pub(super) fn is_hidden(node: &Node) -> bool {
    let visibility = node.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
    visibility.and_then(|v| v.get("visible")?.as_bool()) == Some(false)
}

fn children(node: &Node) -> impl DoubleEndedIterator<Item = usize> {
    node.children.iter().flatten().map(Index::value)
}

fn local(node: &Transform, index: usize) -> Result<LocalTransform, String> {
    if let Some(m) = node.matrix {
        let m = DMat4::from_cols_array(&m);
        // affine by the specification; a perspective matrix would silently lose its last row
        if (m.row(3) - glam::DVec4::W).abs().max_element() > 1e-6 {
            return Err(format!("node {index} has a matrix that is not affine"));
        }
        return Ok(LocalTransform::Matrix(DAffine3::from_mat4(m)));
    }
    let rotation = node.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    let squared = rotation.length_squared();
    Ok(LocalTransform::Trs {
        translation: node.translation.map_or(DVec3::ZERO, DVec3::from_array),
        rotation: match squared {
            // what we wrote comes back bit by bit
            _ if (squared - 1.0).abs() < 1e-14 => rotation,
            // exporters round; and a zero quaternion stands for no rotation
            _ if squared > 1e-30 => rotation.normalize(),
            _ => DQuat::IDENTITY,
        },
        scale: node.scale.map_or(DVec3::ONE, DVec3::from_array),
    })
}

/// The clipping planes of a camera; numbers that bound nothing count as absent.
fn clip_planes(near: Option<f64>, far: Option<f64>, warn: &mut dyn FnMut(String)) -> ClipPlanes {
    let near = near.filter(|near| near.is_finite() && *near > 0.0).unwrap_or(0.0);
    let far = far.filter(|far| *far > 0.0).unwrap_or(f64::INFINITY);
    if far > near {
        return ClipPlanes { near, far };
    }
    warn(format!("has its far plane ({far}) before its near plane ({near}): nothing is clipped"));
    ClipPlanes::NONE
}

/// The camera of a node.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn camera(
    document: &Root,
    doubles: &Doubles,
    placed: &PlacedNode,
    index: usize,
    warn: &mut dyn FnMut(String),
) -> Result<Camera, String> {
    let (Some(camera), Some(lens)) = (document.cameras.get(index), doubles.cameras.get(index)) else {
        return Err(format!("camera {index} does not exist"));
    };
    let positive = |x: f64| Some(x.abs()).filter(|x| x.is_finite() && *x > 0.0);
    let (projection, aspect) = match (&lens.perspective, &lens.orthographic) {
        (Some(p), _) if p.yfov > 0.0 && p.yfov < std::f64::consts::PI => {
            (Projection::Perspective { fov_y: p.yfov }, p.aspect_ratio.and_then(positive))
        }
        (Some(p), _) => return Err(format!("camera {index} has a field of view of {} radians", p.yfov)),
        (None, Some(o)) => match (positive(o.xmag), positive(o.ymag)) {
            (x, Some(y)) => (Projection::Orthographic { half_height: y }, x.map(|x| x / y)),
            _ => return Err(format!("camera {index} has a height of {}", o.ymag)),
        },
        (None, None) => return Err(format!("camera {index} is neither perspective nor orthographic")),
    };
    let (near, far) = match (&lens.perspective, &lens.orthographic) {
        (Some(p), _) => (p.znear, p.zfar),
        (None, Some(o)) => (o.znear, o.zfar),
        (None, None) => (None, None),
    };
    let clip = clip_planes(near, far, &mut |text| warn(format!("camera {index} {text}")));
    let node = &document.nodes[placed.node];
    // the node tells apart the uses of one camera
    let name = [&node.name, &camera.name].map(text).into_iter().find(|n| !n.is_empty()).unwrap_or_default();
    Ok(Camera { name: name.to_owned(), camera_to_world: rigid(&placed.to_world), projection, aspect, clip })
}

/// The punctual light of a node.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn light(document: &Root, placed: &PlacedNode, index: usize) -> Result<Light, String> {
    let lights =
        document.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()).map_or(&[][..], |l| &l.lights);
    let light = lights.get(index).ok_or_else(|| format!("light {index} does not exist"))?;
    let kind = match valid(light.type_) {
        Some(LightType::Point) => LightKind::Point,
        Some(LightType::Directional) => LightKind::Directional { angle: 0.0 },
        Some(LightType::Spot) => {
            // not the crate's default for lights without `spot`, whose outer angle is zero
            let (inner, outer) =
                light.spot.as_ref().map_or((0.0, FRAC_PI_4), |s| (s.inner_cone_angle, s.outer_cone_angle));
            let outer = outer.clamp(0.0, FRAC_PI_2);
            LightKind::Spot { inner_angle: inner.clamp(0.0, outer), outer_angle: outer }
        }
        None => return Err(format!("light {index} is of an unknown type")),
    };
    let intensity = glam::Vec3::from(light.color) * light.intensity;
    if !intensity.is_finite() {
        return Err(format!("light {index} has an intensity that is not finite"));
    }
    let node = &document.nodes[placed.node];
    Ok(Light {
        name: [&light.name, &node.name].map(text).into_iter().find(|n| !n.is_empty()).unwrap_or_default().to_owned(),
        kind,
        intensity,
        position: placed.to_world.translation,
        direction: -rigid(&placed.to_world).matrix3.z_axis,
        range: light.range.filter(|&r| r > 0.0).map_or(f64::INFINITY, f64::from),
    })
}
