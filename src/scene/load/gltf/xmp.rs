//! `KHR_xmp_json_ld`: what a file says of itself, such as its title, creator and licence.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_xmp_json_ld>

use ::gltf::json::Root;
use serde_json::{Map, Value};

use super::node::Asset;

const NAME: &str = "KHR_xmp_json_ld";

/// Names and texts of the metadata of the whole file, in its order; values that are no text are
/// written as JSON. Empty without the extension, and where it is broken: nothing depends on it.
pub(super) fn read(document: &Root, asset: &Asset) -> Vec<(String, String)> {
    let packets = document.extensions.as_ref().and_then(|e| e.others.get(NAME)?.get("packets")?.as_array());
    let chosen = asset.extensions.get(NAME).and_then(|e| e.get("packet")?.as_u64());
    let packet = packets.and_then(|packets| packets.get(chosen? as usize)?.as_object());
    packet.map_or_else(Vec::new, |packet| {
        let is_shown = |key: &str| !key.starts_with('@');
        packet.iter().filter(|(key, _)| is_shown(key)).map(|(key, value)| (key.clone(), text(value))).collect()
    })
}

/// A value of JSON-LD as text: a list by its members, alternatives of languages by the first.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(text).collect::<Vec<_>>().join(", "),
        Value::Object(object) => contents(object).map_or_else(|| value.to_string(), text),
        other => other.to_string(),
    }
}

/// The contents of a container of JSON-LD; of alternatives (`rdf:Alt`) the first.
fn contents(object: &Map<String, Value>) -> Option<&Value> {
    if object.get("@type").is_some_and(|t| t == "rdf:Alt") {
        return object.get("rdf:_1");
    }
    ["@value", "@list", "@set"].iter().find_map(|key| object.get(*key))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn values_are_read_as_text() {
        for (value, expected) in [
            (json!("a"), "a"),
            (json!(3), "3"),
            (json!({ "@list": ["a", { "@value": "b" }] }), "a, b"),
            (json!({ "@set": ["x"] }), "x"),
            (json!({ "@type": "rdf:Alt", "rdf:_1": { "@language": "en", "@value": "Title" } }), "Title"),
            (json!({ "other": 1 }), "{\"other\":1}"),
        ] {
            assert_eq!(text(&value), expected);
        }
    }
}
