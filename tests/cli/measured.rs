//! Looks results up in the JSON records of benchmarks.
use serde_json::Value;

/// The median of repeated measurements, or the value; NaN for one that is null.
pub fn middle(m: &Value) -> f64 {
    let values = &m["values"];
    if values.is_object() { values["median"].as_f64().unwrap() } else { values.as_f64().unwrap_or(f64::NAN) }
}

/// All results of a scene's part; of all scenes for an empty name.
pub fn of_part<'a>(record: &'a Value, scene: &str, part: &str) -> Vec<&'a Value> {
    let all = record["measurements"].as_array().unwrap().iter();
    all.filter(|m| (scene.is_empty() || m["scene"] == scene) && m["part"] == part).collect()
}

/// Contestants of a scene's part, in their order.
pub fn contestants<'a>(record: &'a Value, scene: &str, part: &str) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for name in of_part(record, scene, part).iter().map(|m| m["contestant"].as_str().unwrap()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// A result that stands alone: no place along an axis but that of the scene's size.
pub fn find<'a>(record: &'a Value, [scene, part, contestant, quantity]: [&str; 4]) -> Option<&'a Value> {
    let is_single = |m: &Value| m["at"].is_null() || m["at"]["axis"] == "triangles and spheres";
    let found = of_part(record, scene, part).into_iter();
    found.filter(|m| m["contestant"] == contestant && m["quantity"] == quantity).find(|m| is_single(m))
}

/// Its value.
pub fn value(record: &Value, names: [&str; 4]) -> f64 {
    middle(find(record, names).unwrap_or_else(|| panic!("{names:?} in {record:#}")))
}

/// Places along an axis and the values there.
pub fn curve(record: &Value, [scene, part, contestant, quantity]: [&str; 4]) -> Vec<(f64, f64)> {
    let found = of_part(record, scene, part).into_iter();
    let own = found.filter(|m| m["contestant"] == contestant && m["quantity"] == quantity && m["at"].is_object());
    own.map(|m| (m["at"]["value"].as_f64().unwrap(), middle(m))).collect()
}

/// Names of the scenes.
pub fn scenes(record: &Value) -> Vec<&str> {
    record["scenes"].as_array().unwrap().iter().map(|s| s["scene"].as_str().unwrap()).collect()
}
