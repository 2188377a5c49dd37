//! Reading of animations.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::sync::Arc;

use ::gltf::json::accessor::Type;
use ::gltf::json::{Index, Root};
use serde::Deserialize;
use serde_json::Value;

use super::accessor::Reader;
use super::pointer::Pointer;
use crate::scene::animation::{
    self, Channel, Interpolation, LocalTransform, Node, Property, Sampler, Target, ValueChannel,
};

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
    extensions: Value,
}

impl TargetJson {
    /// The JSON pointer of KHR_animation_pointer.
    fn pointer(&self) -> Option<&str> {
        let extension = self.extensions.get("KHR_animation_pointer").filter(|_| self.path == "pointer");
        extension?.get("pointer")?.as_str()
    }

    /// The node and the path of a channel that transforms or morphs it, with a pointer or without.
    fn of_node(&self) -> Option<(usize, &str)> {
        match self.pointer().and_then(Pointer::parse) {
            Some(Pointer::Node(node, path)) => Some((node, path)),
            _ => Some((self.node?, &self.path)),
        }
    }
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
    let nodes = animations.iter().flat_map(|a| &a.channels).filter_map(|channel| channel.target.of_node());
    nodes.filter(|(_, path)| matches!(*path, "translation" | "rotation" | "scale")).map(|(node, _)| node).collect()
}

/// All JSON pointers of channels.
pub(super) fn pointers(animations: &[Animation]) -> impl Iterator<Item = &str> {
    animations.iter().flat_map(|a| &a.channels).filter_map(|channel| channel.target.pointer())
}

/// A channel that has been read.
enum ReadChannel {
    Node(Channel),
    /// A channel whose target is a material, light or camera of the file, or a placed node.
    Value(ValueChannel),
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
        let mut values: Vec<ValueChannel> = Vec::new();
        let (mut targets, mut value_targets) = (HashSet::new(), HashSet::new());
        for (c, channel) in animation.channels.iter().enumerate() {
            let mut repairs = Vec::new();
            let channel = read_channel(reader, animation, channel, nodes, index, &mut times, &mut repairs);
            for said in repairs {
                warn(format!("animation {a} `{name}`, channel {c}: {said}"));
            }
            let mut leave_out = |e: String| warn(format!("animation {a} `{name}`, channel {c}: {e}: left out"));
            match channel {
                Ok(Some(ReadChannel::Node(channel))) if targets.insert((channel.node, channel.property)) => {
                    channels.push(channel);
                }
                Ok(Some(ReadChannel::Value(channel))) if value_targets.insert(channel.target) => values.push(channel),
                Ok(Some(_)) => leave_out("another channel has the same target".to_owned()),
                Ok(None) => {}
                Err(e) => leave_out(e),
            }
        }
        let samplers = channels.iter().map(|c| &c.sampler).chain(values.iter().map(|c| &c.sampler));
        let duration = samplers.map(Sampler::end).fold(0.0, f64::max);
        out.push(animation::Animation { name, duration, channels, values });
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
) -> Result<Option<ReadChannel>, String> {
    if let Some(pointer) = channel.target.pointer() {
        let known = Pointer::parse(pointer);
        let known = known.ok_or_else(|| format!("the pointer `{pointer}` names nothing that skylit animates"))?;
        match value_target(reader.document, known, index)? {
            PointerTarget::Value(target) => {
                let sampler = read_sampler(reader, animation, channel, target.width(), times, repairs)?;
                if matches!(target, Target::Visibility(_)) && sampler.interpolation != Interpolation::Step {
                    return Err(format!("the pointer `{pointer}` needs the interpolation STEP"));
                }
                return Ok(Some(ReadChannel::Value(ValueChannel { target, sampler })));
            }
            PointerTarget::Nothing => return Ok(None),
            PointerTarget::Node => {}
        }
    }

    let of_node = channel.target.of_node();
    let (target, path) = of_node.ok_or_else(|| format!("names no node (its path is `{}`)", channel.target.path))?;
    let Some(node) = *index.get(target).ok_or_else(|| format!("node {target} does not exist"))? else {
        return Ok(None);
    };

    // the property, and how many numbers it has
    let property = match path {
        "translation" => Property::Translation,
        "rotation" => Property::Rotation,
        "scale" => Property::Scale,
        "weights" => Property::Weights,
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

    let sampler = match property {
        // as many scalars as there are targets
        Property::Weights => read_keys(reader, animation, channel, (Type::Scalar, width), times, repairs),
        _ => read_sampler(reader, animation, channel, width, times, repairs),
    };
    Ok(Some(ReadChannel::Node(Channel { node, property, sampler: sampler? })))
}

/// The target of a channel with a pointer.
enum PointerTarget {
    Value(Target),
    /// A node, as without a pointer.
    Node,
    /// Nothing that is in the scene or changes its image.
    Nothing,
}

/// The target of a pointer, which has to exist in the document.
fn value_target(document: &Root, pointer: Pointer, index: &[Option<usize>]) -> Result<PointerTarget, String> {
    let lights =
        document.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()).map_or(0, |l| l.lights.len());
    let (what, number, count, target) = match pointer {
        Pointer::Node(..) => return Ok(PointerTarget::Node),
        Pointer::Nothing => return Ok(PointerTarget::Nothing),
        Pointer::Material(k, property) => ("material", k, document.materials.len(), Target::Material(k, property)),
        Pointer::Light(k, property) => ("light", k, lights, Target::Light(k, property)),
        Pointer::Camera(k, property) => ("camera", k, document.cameras.len(), Target::Camera(k, property)),
        Pointer::Visibility(node) => match index.get(node) {
            Some(Some(at)) => return Ok(PointerTarget::Value(Target::Visibility(*at))),
            Some(None) => return Ok(PointerTarget::Nothing),
            None => ("node", node, index.len(), Target::Visibility(node)),
        },
    };
    if number < count {
        Ok(PointerTarget::Value(target))
    } else {
        Err(format!("{what} {number} does not exist (the file has {count})"))
    }
}

/// The sampler of a channel whose values are vectors of `width` numbers.
fn read_sampler(
    reader: &Reader,
    animation: &Animation,
    channel: &ChannelJson,
    width: usize,
    times: &mut BTreeMap<u32, Arc<[f32]>>,
    repairs: &mut Vec<String>,
) -> Result<Sampler, String> {
    let shape = match width {
        1 => Type::Scalar,
        2 => Type::Vec2,
        3 => Type::Vec3,
        _ => Type::Vec4,
    };
    read_keys(reader, animation, channel, (shape, width), times, repairs)
}

/// The keys of a channel. `shape`: the type of its output, and how many numbers a value has.
fn read_keys(
    reader: &Reader,
    animation: &Animation,
    channel: &ChannelJson,
    (shape, width): (Type, usize),
    times: &mut BTreeMap<u32, Arc<[f32]>>,
    repairs: &mut Vec<String>,
) -> Result<Sampler, String> {
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
        Type::Vec2 => reader.floats(output, shape, |v: [f32; 2]| v).map(|v| v.as_flattened().to_vec()),
        Type::Vec3 => reader.floats(output, shape, |v: [f32; 3]| v).map(|v| v.as_flattened().to_vec()),
        _ => reader.floats(output, shape, |v: [f32; 4]| v).map(|v| v.as_flattened().to_vec()),
    };

    let mut sampler = Sampler { interpolation, times, values: values.map_err(within)? };
    for said in sampler.repair(width) {
        repairs.push(within(said));
    }
    sampler.check(width).map_err(within)?;
    Ok(sampler)
}
