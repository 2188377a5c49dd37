//! Layers of an image: channels whose names have the same part before the last dot.

use super::{Channel, Image, Samples};

/// Channels that are colours, and not a layer of numbers.
const COLOURS: [&str; 4] = ["R", "G", "B", "Y"];

/// The layer of a channel: what precedes the last dot of its name, or nothing.
fn layer_of(channel: &str) -> &str {
    channel.rsplit_once('.').map_or("", |(layer, _)| layer)
}

/// Lists the layers of an image besides its colours, and channels without a layer.
pub fn names(image: &Image) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for channel in &image.channels {
        let layer = layer_of(&channel.name);
        let name = if layer.is_empty() { channel.name.as_str() } else { layer };
        if !names.contains(&name) && !COLOURS.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// The channels of a layer, or the channel of that name, in the order in which people count them:
/// red before green, x before y.
pub fn channels<'a>(image: &'a Image, name: &str) -> Vec<&'a Channel> {
    let is_named = |channel: &&Channel| channel.name == name || layer_of(&channel.name) == name;
    let place = |c: &Channel| "RXUGYVBZW".find(c.name.rsplit('.').next().unwrap_or_default()).unwrap_or(usize::MAX);
    let mut found: Vec<&Channel> = image.channels.iter().filter(is_named).collect();
    found.sort_by_key(|c| place(c));
    found
}

/// A layer or channel as an image of its own: `R`, `G`, `B` of three channels, `Y` of one; with the
/// alpha of the image. And the names that its channels had.
///
/// # Errors
/// Why there is none of that name, as the end of a sentence.
pub fn layer(image: &Image, name: &str) -> Result<(Image, Vec<String>), String> {
    let found = channels(image, name);
    if found.is_empty() {
        return Err(format!("has no layer {name:?}: it has {}", names(image).join(", ")));
    }
    let old_names: Vec<String> = found.iter().map(|c| c.name.clone()).collect();
    let new_names: &[&str] = match found.len() {
        1 => &["Y"],
        3 => &["R", "G", "B"],
        n => {
            return Err(format!(
                "layer {name:?} has {n} channels, and an image has 1 or 3: name one of {}",
                old_names.join(", ")
            ));
        }
    };
    let mut channels = Vec::with_capacity(4);
    for (channel, new_name) in found.iter().zip(new_names) {
        let samples = match &channel.samples {
            Samples::F32(values) => values.clone(),
            Samples::U32(numbers) => numbers.iter().map(|n| *n as f32).collect(),
        };
        channels.push(Channel::from_floats(*new_name, samples));
    }
    channels.extend(image.f32("A").map(|alpha| Channel::from_floats("A", alpha.to_vec())));
    Ok((Image { channels, metadata: image.metadata.clone(), ..*image }, old_names))
}

/// The values of a [`layer`] that are shown as 0 and 1 if nothing else is said: those of
/// directions are -1 and 1, of a single number the extremes; `None` where values stay.
pub fn default_range(layer: &Image, old_names: &[String]) -> Option<[f32; 2]> {
    match old_names {
        [name, _, _] if ["Ng", "Ns", "bent"].contains(&layer_of(name)) => Some([-1.0, 1.0]),
        // the largest integer is the number of no object
        [name] if layer_of(name) == "id" => Some(extremes_below(layer, u32::MAX as f32)),
        [name] if name != "A" && !COLOURS.contains(&&**name) => Some(extremes(layer)),
        _ => None,
    }
}

/// The least and the greatest finite value of the colours, of covered pixels where there are some.
/// They differ.
pub fn extremes(image: &Image) -> [f32; 2] {
    extremes_below(image, f32::INFINITY)
}

/// The same of values below `limit`.
fn extremes_below(image: &Image, limit: f32) -> [f32; 2] {
    let alpha = image.f32("A").filter(|alpha| alpha.iter().any(|a| *a > 0.0));
    let mut found = [f32::INFINITY, f32::NEG_INFINITY];
    for values in COLOURS.into_iter().filter_map(|name| image.f32(name)) {
        for (k, value) in values.iter().enumerate() {
            if value.is_finite() && *value < limit && alpha.is_none_or(|alpha| alpha[k] > 0.0) {
                found = [found[0].min(*value), found[1].max(*value)];
            }
        }
    }
    match found {
        [least, greatest] if least < greatest => found,
        [least, _] if least.is_finite() => [least, least + 1.0],
        _ => [0.0, 1.0],
    }
}

/// The image with its colours stretched so that these values become 0 and 1.
pub fn stretched(mut image: Image, [least, greatest]: [f32; 2]) -> Image {
    for channel in image.channels.iter_mut().filter(|c| COLOURS.contains(&&*c.name)) {
        if let Samples::F32(values) = &mut channel.samples {
            values.iter_mut().for_each(|v| *v = (*v - least) / (greatest - least));
        }
    }
    image
}

/// Red, green and blue; three times the same of a grey image.
pub fn colour_planes(image: &Image) -> Option<[&[f32]; 3]> {
    match (image.f32("R"), image.f32("G"), image.f32("B")) {
        (Some(r), Some(g), Some(b)) => Some([r, g, b]),
        _ => image.f32("Y").map(|y| [y; 3]),
    }
}
