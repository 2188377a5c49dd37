//! The shaders' side of the declarations.

use std::fmt::Write as _;

use super::{constants, enumerations, features};

/// Files that shaders include: names and texts.
pub fn files() -> Vec<(String, String)> {
    let mut files = vec![file("constants", &constants())];
    files.extend(features::SETS.iter().map(|set| file(set.name, &feature_set(set))));
    files.extend(enumerations::ALL.iter().map(|e| file(e.name, &enumeration(e))));
    files
}

fn file(name: &str, text: &str) -> (String, String) {
    let guard = format!("INTERFACE_{}", name.to_uppercase());
    (
        format!("interface/{name}.glsl"),
        format!("// Made of the declarations in src/interface.\n#ifndef {guard}\n#define {guard}\n{text}#endif\n"),
    )
}

fn constants() -> String {
    let mut text = String::new();
    for (id, c) in constants::ALL.iter().enumerate() {
        let suffix = if c.kind == "uint" { "u" } else { "" };
        let _ =
            writeln!(text, "layout(constant_id = {id}) const {} {} = {}{suffix};  //{}", c.kind, c.name, c.default, c.about);
    }
    text
}

fn feature_set(set: &features::Declaration) -> String {
    let mut text = String::new();
    let (words, all) = (set.name.to_uppercase(), if set.is_full { "0xffffffffu" } else { "0u" });
    for word in 0..set.features.len().div_ceil(32) {
        let _ = writeln!(text, "layout(constant_id = {}) const uint {words}_{word} = {all};", set.first_id as usize + word);
    }
    let _ = writeln!(text, "const uint {words}_COUNT = {}u;", set.features.len());
    for (k, (name, about)) in set.features.iter().enumerate() {
        if set.is_indexed {
            let _ = writeln!(text, "const uint {name} = {k}u;  // {about}");
            continue;
        }
        let _ = writeln!(text, "const bool {name} = ({words}_{} & 0x{:x}u) != 0u;  // {about}", k / 32, 1u32 << (k % 32));
    }
    text
}

fn enumeration(e: &enumerations::Declaration) -> String {
    let mut text = String::new();
    for (number, (name, about)) in e.variants.iter().enumerate() {
        let _ = writeln!(text, "const uint {name} = {number}u;  //{about}");
    }
    let _ = writeln!(text, "const uint {}_COUNT = {}u;", e.name.to_uppercase(), e.variants.len());
    text
}
