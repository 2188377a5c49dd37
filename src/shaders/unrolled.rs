//! A rule of the shaders that no compiler checks: no `precise` arithmetic in loops that the
//! optimizer unrolls. spirv-opt copies the body of such a loop without its decorations
//! `NoContraction`, so that in all copies but the first products are fused into sums: on GPUs,
//! where Mesa's CPU driver fuses none.

use std::collections::{BTreeMap, BTreeSet};

/// Functions and macros by name, with their bodies.
type Definitions = BTreeMap<String, String>;

fn without_comments(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("/*") {
        out += &rest[..at];
        rest = rest[at..].split_once("*/").map_or("", |(_, after)| after);
    }
    out += rest;
    out.lines().map(|l| l.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n").replace("\\\n", " ")
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c| !is_word(c)).filter(|w| !w.is_empty())
}

/// Names that are called, and the word `precise`.
fn called(text: &str) -> impl Iterator<Item = &str> {
    let calls = text.split('(').filter_map(|before| {
        let end = before.trim_end();
        let name = &end[end.rfind(|c| !is_word(c)).map_or(0, |at| at + 1)..];
        (!name.is_empty()).then_some(name)
    });
    calls.chain(words(text).filter(|w| *w == "precise"))
}

/// The text that the first bracket in `text` encloses, and the rest.
fn enclosed(text: &str, [open, close]: [char; 2]) -> (&str, &str) {
    let start = text.find(open).map_or(text.len(), |at| at + 1);
    let mut depth = 1;
    for (at, c) in text[start..].char_indices() {
        depth += i32::from(c == open) - i32::from(c == close);
        if depth == 0 {
            return (&text[start..start + at], &text[start + at + 1..]);
        }
    }
    (&text[start..], "")
}

/// Adds the functions and macros of a file.
fn define(text: &str, definitions: &mut Definitions) {
    let (mut code, mut add) =
        (String::new(), |name: &str, body: &str| *definitions.entry(name.to_owned()).or_default() += body);
    for line in text.lines() {
        match line.trim_start().strip_prefix("#define ") {
            Some(macro_) => add(words(macro_).next().unwrap_or_default(), macro_),
            None if line.trim_start().starts_with('#') => (),
            None => code = code + line + "\n",
        }
    }
    let mut rest = code.as_str();
    while let Some(at) = rest.find('{') {
        let head = rest[..at].rsplit([';', '}']).next().unwrap_or_default();
        let (body, after) = enclosed(rest, ['{', '}']);
        if let Some((before, _)) = head.split_once('(') {
            add(words(before).last().unwrap_or_default(), body);
        }
        rest = after;
    }
}

/// Names of what computes precisely, by itself or through what it calls; but for whole numbers
/// (common/integers.glsl), which are sums alone, and for the streams' callback `any`, which is
/// named like a function of GLSL.
fn precise_names(definitions: &Definitions) -> BTreeSet<&str> {
    let mut precise = BTreeSet::from(["precise"]);
    loop {
        let more = |(name, body): &(&String, &String)| {
            !["main", "to_int", "divide", "any"].contains(&name.as_str()) && called(body).any(|w| precise.contains(w))
        };
        let now: BTreeSet<_> =
            definitions.iter().filter(more).map(|(name, _)| name.as_str()).chain(["precise"]).collect();
        if now.len() == precise.len() {
            return precise;
        }
        precise = now;
    }
}

/// Precise names in the bodies of loops that are unrolled.
fn found(text: &str, definitions: &Definitions) -> Vec<String> {
    let precise = precise_names(definitions);
    let loops: Vec<_> = definitions.iter().filter(|(_, body)| body.contains("[[unroll]] for")).collect();
    let mut text = text.to_owned();
    // macros that begin a loop, and nothing else, are written out
    for (name, body) in loops.iter().filter(|(_, body)| body.trim_end().ends_with(')')) {
        let header = &body[body.find("[[unroll]]").unwrap_or_default()..];
        text = text.replace(&format!("{name} "), &format!("{header} "));
    }
    let mut found = Vec::new();
    for after in text.split("[[unroll]] for").skip(1) {
        let (_, body) = enclosed(after, ['(', ')']);
        let body = if body.trim_start().starts_with('{') {
            enclosed(body, ['{', '}']).0
        } else {
            body.split(';').next().unwrap_or_default()
        };
        found.extend(called(body).filter(|w| precise.contains(w)).map(str::to_owned));
    }
    found
}

#[test]
fn precise_arithmetic_is_in_no_loop_that_is_unrolled() {
    let (mut texts, mut folders) = (Vec::new(), vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders")]);
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else {
                let text = without_comments(&std::fs::read_to_string(&path).unwrap());
                texts.push((path, text));
            }
        }
    }
    let mut definitions = Definitions::new();
    texts.iter().for_each(|(_, text)| define(text, &mut definitions));
    let precise = precise_names(&definitions);
    for name in ["edge", "make_corner", "meets_triangle", "kahan_add"] {
        assert!(precise.contains(name), "{name} is precise");
    }
    for (path, text) in &texts {
        assert_eq!(
            found(text, &definitions),
            [""; 0],
            "{}: precise arithmetic in a loop that is unrolled",
            path.display()
        );
    }
    // one that breaks the rule
    let bad = "#define FOR_RAYS [[unroll]] for (int j = 0; j < 2; j++)\nvoid main() { FOR_RAYS { float e = edge(a[j], b[j]); } FOR_RAYS x[j] = 1.0; }";
    define(bad, &mut definitions);
    assert_eq!(found(bad, &definitions), ["edge"]);
}
