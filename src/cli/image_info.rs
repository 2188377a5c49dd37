//! `skylit info IMAGE`: the channels of an image, their values, and how it was made.

use std::path::Path;

use serde_json::json;

use crate::error::Result;
use crate::memory::Budget;
use crate::output::{self, Channel, Image, Samples};
use crate::terminal::console::{Console, Failure};

/// Extensions of images. Those of scenes are others.
const EXTENSIONS: [&str; 6] = ["exr", "hdr", "png", "jpg", "jpeg", "webp"];

/// Whether a file's name is that of an image.
pub(super) fn is_image(path: &str) -> bool {
    let extension = Path::new(path).extension().map(|e| e.to_string_lossy().to_lowercase());
    extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str()))
}

/// Values of a channel.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
struct ChannelInfo {
    name: String,
    /// `float` or `uint`, as they are in memory.
    kind: &'static str,
    /// Least, greatest and mean finite value; absent where none is finite.
    #[serde(flatten)]
    values: Option<Values>,
    /// Pixels that are NaN, and that are infinite.
    nan: u64,
    infinite: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
struct Values {
    min: f64,
    max: f64,
    mean: f64,
}

/// Reads an image and describes it.
pub(super) fn run(path: &str, console: &Console) -> Result<(), Failure> {
    let image = output::load_within(path.as_ref(), &Budget::default())?;
    let channels: Vec<ChannelInfo> = image.channels.iter().map(channel_info).collect();
    lines(path, &image, &channels).iter().try_for_each(|line| console.line(line))?;
    let metadata: serde_json::Map<_, _> = image.metadata.iter().map(|(k, v)| (k.clone(), json!(v))).collect();
    Ok(console.record(&json!({
        "image": path,
        "size": [image.width, image.height],
        "channels": channels,
        "metadata": metadata,
    }))?)
}

fn channel_info(channel: &Channel) -> ChannelInfo {
    let (kind, samples): (_, Box<dyn Iterator<Item = f64>>) = match &channel.samples {
        Samples::F32(values) => ("float", Box::new(values.iter().map(|v| f64::from(*v)))),
        Samples::U32(numbers) => ("uint", Box::new(numbers.iter().map(|n| f64::from(*n)))),
    };
    let (mut nan, mut infinite, mut finite) = (0, 0, 0u64);
    let (mut min, mut max, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
    for value in samples {
        if value.is_finite() {
            (min, max, sum, finite) = (value.min(min), value.max(max), sum + value, finite + 1);
        } else if value.is_nan() {
            nan += 1;
        } else {
            infinite += 1;
        }
    }
    let values = (finite > 0).then(|| Values { min, max, mean: sum / finite as f64 });
    ChannelInfo { name: channel.name.clone(), kind, values, nan, infinite }
}

fn lines(path: &str, image: &Image, channels: &[ChannelInfo]) -> Vec<String> {
    let count = channels.len();
    let mut lines = vec![format!(
        "{path}: {} x {} pixels, {count} channel{}",
        image.width,
        image.height,
        if count == 1 { "" } else { "s" }
    )];
    let name_width = channels.iter().map(|c| c.name.len()).max().unwrap_or(0).min(24);
    for c in channels {
        let mut line = format!("  {:name_width$}  {:5}", c.name, c.kind);
        match c.values {
            Some(v) => line += &format!("  {} to {}, mean {}", short(v.min), short(v.max), short(v.mean)),
            None => line += "  no finite value",
        }
        for (number, what) in [(c.nan, "NaN"), (c.infinite, "infinite")] {
            if number > 0 {
                line += &format!(", {number} {what}");
            }
        }
        lines.push(line);
    }
    lines.extend(image.metadata.iter().map(|(key, value)| format!("  {key}: {value}")));
    lines
}

/// A number in four digits.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        1e-3..1e6 => format!("{}", (value * 1e4).round() / 1e4),
        _ => format!("{value:.3e}"),
    }
}
