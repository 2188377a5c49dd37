//! Validation of a rig against its scene.

use super::MaterialProperty as Number;
use super::{Animation, Channel, Deformation, LocalTransform, Property, RigParts, SLOTS, Skin, Target, ValueChannel};
use crate::scene::{Geometry, Scene};

/// Fails with a message that names the invalid part.
pub(super) fn check(scene: &Scene, parts: &RigParts) -> Result<(), String> {
    let nodes = parts.nodes.len();

    // nodes: after their parents, and finite
    for (i, node) in parts.nodes.iter().enumerate() {
        let name = &node.name;
        if node.parent.is_some_and(|p| p >= i) {
            return Err(format!("node {i} `{name}` comes before its parent"));
        }
        if !node.local.affine().is_finite() {
            return Err(format!("node {i} `{name}` has a transform that is not finite"));
        }
        if node.weights.iter().any(|w| !w.is_finite()) {
            return Err(format!("node {i} `{name}` has a morph weight that is not finite"));
        }
    }

    // skins, deformations and channels refer to them
    for (i, skin) in parts.skins.iter().enumerate() {
        check_skin(skin, nodes).map_err(|e| format!("skin {i} `{}`: {e}", skin.name))?;
    }
    let mut seen = vec![false; scene.meshes.len()];
    for (i, deformation) in parts.deformations.iter().enumerate() {
        let mesh = deformation.mesh;
        match seen.get_mut(mesh) {
            None => {
                return Err(format!(
                    "deformation {i}: mesh {mesh} does not exist (the scene has {})",
                    scene.meshes.len()
                ));
            }
            Some(true) => return Err(format!("mesh {mesh} deforms in two ways")),
            Some(seen) => *seen = true,
        }
        check_deformation(deformation, scene, parts)
            .map_err(|e| format!("mesh {mesh} `{}`: {e}", scene.meshes[mesh].name))?;
    }
    for (i, animation) in parts.animations.iter().enumerate() {
        check_animation(animation, parts).map_err(|e| format!("animation {i} `{}`, {e}", animation.name))?;
    }

    // what nodes carry
    let on = |what: &str, carried: &[Option<usize>], there: usize| {
        // lights are added to scenes that have a rig
        if carried.len() != there && (what != "lights" || carried.len() > there) {
            return Err(format!("{} {what} are on nodes, the scene has {there}", carried.len()));
        }
        match carried.iter().flatten().find(|&&n| n >= nodes) {
            Some(n) => Err(format!("{what} are on node {n}, of only {nodes}")),
            None => Ok(()),
        }
    };
    // what animations hide
    let switched = [
        ("instance", &parts.switched_instances, scene.instances.len()),
        ("light", &parts.switched_lights, scene.lights.len()),
    ];
    for (what, switched, there) in switched {
        if let Some((i, node)) = switched.iter().find(|(i, node)| *i >= there || *node >= nodes) {
            return Err(format!("{what} {i} of {there} is shown by node {node}, of {nodes}"));
        }
    }
    on("instances", &parts.instances, scene.instances.len())?;
    on("cameras", &parts.cameras, scene.cameras.len())?;
    on("lights", &parts.lights, scene.lights.len())
}

fn check_skin(skin: &Skin, nodes: usize) -> Result<(), String> {
    if skin.joints.is_empty() || skin.joints.len() != skin.inverse_bind.len() {
        return Err(format!("has {} joints and {} inverse bind matrices", skin.joints.len(), skin.inverse_bind.len()));
    }
    if let Some(j) = skin.joints.iter().find(|&&j| j >= nodes) {
        return Err(format!("joint node {j} does not exist (there are {nodes})"));
    }
    match skin.inverse_bind.iter().position(|m| !m.is_finite()) {
        Some(i) => Err(format!("inverse bind matrix {i} is not finite")),
        None => Ok(()),
    }
}

fn check_deformation(deformation: &Deformation, scene: &Scene, parts: &RigParts) -> Result<(), String> {
    let Geometry::Triangles(triangles) = &scene.meshes[deformation.mesh].geometry else {
        return Err("holds spheres, which cannot deform".to_owned());
    };
    let vertices = triangles.positions.len();
    let node = parts.nodes.get(deformation.node).ok_or_else(|| format!("node {} does not exist", deformation.node))?;

    // joints and weights: as many as vertices, of joints that exist
    let joints = match deformation.skin {
        None if deformation.influences.is_empty() => 0,
        None => return Err("has joints and weights, but no skin".to_owned()),
        Some(s) if !(1..=2).contains(&deformation.influences.len()) => {
            return Err(format!(
                "has skin {s} and {} sets of joints; one or two are read",
                deformation.influences.len()
            ));
        }
        Some(s) => parts.skins.get(s).ok_or_else(|| format!("skin {s} does not exist"))?.joints.len(),
    };
    for set in &deformation.influences {
        if (set.joints.len(), set.weights.len()) != (vertices, vertices) {
            return Err(format!(
                "has joints or weights for {} of {vertices} vertices",
                set.joints.len().min(set.weights.len())
            ));
        }
        for (v, (joint, weight)) in set.joints.iter().zip(&set.weights).enumerate() {
            if weight.iter().any(|w| !(w.is_finite() && *w >= 0.0)) {
                return Err(format!("a joint weight of vertex {v} is not finite, or below zero"));
            }
            if let Some((j, _)) = joint.iter().zip(weight).find(|&(&j, &w)| w > 0.0 && usize::from(j) >= joints) {
                return Err(format!("vertex {v} is bound to joint {j} of only {joints}"));
            }
        }
    }

    // morph targets: as many as weights, of the mesh's size
    if !deformation.targets.is_empty() && node.weights.len() != deformation.targets.len() {
        let (targets, weights) = (deformation.targets.len(), node.weights.len());
        return Err(format!("has {targets} morph targets, its node {} {weights} weights", deformation.node));
    }
    for (t, target) in deformation.targets.iter().enumerate() {
        for (what, deltas) in [("positions", &target.positions), ("normals", &target.normals)] {
            if !deltas.is_empty() && deltas.len() != vertices {
                return Err(format!("morph target {t} has {} {what} for {vertices} vertices", deltas.len()));
            }
            if let Some(v) = deltas.iter().position(|d| !d.is_finite()) {
                return Err(format!("morph target {t} is not finite at vertex {v} ({what})"));
            }
        }
    }
    Ok(())
}

fn check_animation(animation: &Animation, parts: &RigParts) -> Result<(), String> {
    if !(animation.duration.is_finite() && animation.duration >= 0.0) {
        return Err(format!("a duration of {} s", animation.duration));
    }
    for (i, channel) in animation.channels.iter().enumerate() {
        check_channel(channel, parts).map_err(|e| format!("channel {i}: {e}"))?;
    }
    for (i, channel) in animation.values.iter().enumerate() {
        check_values(channel, parts).map_err(|e| format!("channel {i} of values: {e}"))?;
    }
    Ok(())
}

fn check_values(channel: &ValueChannel, parts: &RigParts) -> Result<(), String> {
    let (what, index, count) = match channel.target {
        Target::Material(
            _,
            Number::TextureOffset(slot) | Number::TextureRotation(slot) | Number::TextureScale(slot),
        ) if slot >= SLOTS => ("texture", slot, SLOTS),
        Target::Material(k, _) => ("animated material", k, parts.materials.len()),
        Target::Light(k, _) => ("animated light", k, parts.animated_lights.len()),
        Target::Camera(k, _) => ("animated camera", k, parts.animated_cameras.len()),
        Target::Visibility(n) => ("node", n, parts.nodes.len()),
    };
    if index >= count {
        return Err(format!("{what} {index} does not exist (there are {count})"));
    }
    channel.sampler.check(channel.target.width())
}

fn check_channel(channel: &Channel, parts: &RigParts) -> Result<(), String> {
    let n = channel.node;
    let node = parts.nodes.get(n).ok_or_else(|| format!("node {n} does not exist"))?;
    match (channel.property, node.local) {
        (Property::Weights, _) if node.weights.is_empty() => return Err(format!("node {n} has no morph targets")),
        (Property::Weights, _) | (_, LocalTransform::Trs { .. }) => {}
        (_, LocalTransform::Matrix(_)) => return Err(format!("node {n} has a matrix, which cannot be animated")),
    }
    channel.sampler.check(channel.width(node))
}
