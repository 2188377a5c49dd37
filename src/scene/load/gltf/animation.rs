//! Reading of animations.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::sync::Arc;

use ::gltf::json::Index;
use ::gltf::json::accessor::Type;
use serde::Deserialize;

use super::accessor::Reader;
use crate::scene::animation::{self, Channel, Interpolation, LocalTransform, Node, Property, Sampler};

/// An animation in the file. Nothing is required here: what is missing leaves out a channel, and
/// not the whole scene.
#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct Animation {
    name: Option<String>,
    channels: Vec<ChannelJson>,
    samplers: Vec<SamplerJson>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct ChannelJson {
    sampler: Option<usize>,
    target: TargetJson,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct TargetJson {
    node: Option<usize>,
    path: String,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct SamplerJson {
    input: Option<u32>,
    output: Option<u32>,
    interpolation: Option<String>,
}

/// The nodes of the file whose translation, rotation or scale a channel changes.
pub(super) fn transformed(animations: &[Animation]) -> BTreeSet<usize> {
    let transforms =
        |channel: &&ChannelJson| matches!(channel.target.path.as_str(), "translation" | "rotation" | "scale");
    animations.iter().flat_map(|a| &a.channels).filter(transforms).filter_map(|channel| channel.target.node).collect()
}

/// All animations, whose channels refer to `nodes`; `index` has the index there of each node of the
/// file. Invalid channels are left out, with a warning each.
pub(super) fn read(
    reader: &Reader,
    animations: &[Animation],
    nodes: &[Node],
    index: &[Option<usize>],
    warn: &mut dyn FnMut(String),
) -> Vec<animation::Animation> {
    // exporters let channels share their times
    let mut times = BTreeMap::new();
    let mut out = Vec::new();
    for (a, animation) in animations.iter().enumerate() {
        let name = animation.name.clone().unwrap_or_default();
        let mut channels: Vec<Channel> = Vec::new();
        let mut targets = HashSet::new();
        for (c, channel) in animation.channels.iter().enumerate() {
            let mut repairs = Vec::new();
            let channel = read_channel(reader, animation, channel, nodes, index, &mut times, &mut repairs);
            for said in repairs {
                warn(format!("animation {a} `{name}`, channel {c}: {said}"));
            }
            let mut leave_out = |e: String| warn(format!("animation {a} `{name}`, channel {c}: {e}: left out"));
            match channel {
                Ok(Some(channel)) if !targets.insert((channel.node, channel.property)) => {
                    leave_out("another channel has the same target".to_owned());
                }
                Ok(channel) => channels.extend(channel),
                Err(e) => leave_out(e),
            }
        }
        let duration = channels.iter().map(|c| c.sampler.end()).fold(0.0, f64::max);
        out.push(animation::Animation { name, duration, channels });
    }
    out
}

/// `None` for a channel of a node that is not in the scene. `repairs`: what was wrong with it and
/// could be mended.
fn read_channel(
    reader: &Reader,
    animation: &Animation,
    channel: &ChannelJson,
    nodes: &[Node],
    index: &[Option<usize>],
    times: &mut BTreeMap<u32, Arc<[f32]>>,
    repairs: &mut Vec<String>,
) -> Result<Option<Channel>, String> {
    let target = channel.target.node.ok_or_else(|| format!("names no node (its path is `{}`)", channel.target.path))?;
    let Some(node) = *index.get(target).ok_or_else(|| format!("node {target} does not exist"))? else {
        return Ok(None);
    };

    // the property, and how many numbers it has
    let (property, shape) = match channel.target.path.as_str() {
        "translation" => (Property::Translation, Type::Vec3),
        "rotation" => (Property::Rotation, Type::Vec4),
        "scale" => (Property::Scale, Type::Vec3),
        "weights" => (Property::Weights, Type::Scalar),
        other => return Err(format!("the path `{other}` is unknown")),
    };
    let width = match (property, nodes[node].local) {
        (Property::Weights, _) if nodes[node].weights.is_empty() => {
            return Err(format!("node {target} has no mesh with morph targets"));
        }
        (Property::Weights, _) => nodes[node].weights.len(),
        (_, LocalTransform::Matrix(_)) => {
            return Err(format!("node {target} has a matrix that shears, which cannot be animated"));
        }
        (Property::Rotation, _) => 4,
        _ => 3,
    };

    // the sampler
    let number = channel.sampler.ok_or("names no sampler")?;
    let sampler = animation.samplers.get(number).ok_or_else(|| format!("sampler {number} does not exist"))?;
    let within = |e: String| format!("sampler {number}: {e}");
    let interpolation = match sampler.interpolation.as_deref().unwrap_or("LINEAR") {
        "STEP" => Interpolation::Step,
        "LINEAR" => Interpolation::Linear,
        "CUBICSPLINE" => Interpolation::CubicSpline,
        other => return Err(within(format!("the interpolation `{other}` is unknown"))),
    };
    let (Some(input), Some(output)) = (sampler.input, sampler.output) else {
        return Err(within("lacks an accessor".to_owned()));
    };

    // channels may share their times
    let times = match times.get(&input) {
        Some(known) => known.clone(),
        None => {
            let read: Arc<[f32]> =
                reader.floats(Index::new(input), Type::Scalar, |[t]: [f32; 1]| t).map_err(within)?.into();
            times.insert(input, read.clone());
            read
        }
    };

    let output = Index::new(output);
    let values = match shape {
        Type::Scalar => reader.floats(output, shape, |v: [f32; 1]| v).map(|v| v.as_flattened().to_vec()),
        Type::Vec3 => reader.floats(output, shape, |v: [f32; 3]| v).map(|v| v.as_flattened().to_vec()),
        _ => reader.floats(output, shape, |v: [f32; 4]| v).map(|v| v.as_flattened().to_vec()),
    };

    let mut sampler = Sampler { interpolation, times, values: values.map_err(within)? };
    for said in sampler.repair(width) {
        repairs.push(within(said));
    }
    sampler.check(width).map_err(within)?;
    Ok(Some(Channel { node, property, sampler }))
}
