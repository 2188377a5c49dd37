//! Generates the GLSL side of the declarations.

use std::fmt::Write as _;

use super::enumerations::Texels;
use super::features::TextureFeature;
use super::layout::{Field, File, Form, Number, Record};
use super::{constants, enumerations, features, records};

/// Files that shaders include: names and texts.
pub fn files() -> Vec<(String, String)> {
    let mut files = vec![file("constants", &constants())];
    files.extend(features::SETS.iter().map(|set| file(set.name, &feature_set(set))));
    files.push(file("bsdf_dispatch", &bsdf_dispatch()));
    files.push(file("light_dispatch", &light_dispatch()));
    files.extend(enumerations::declarations().iter().map(|e| file(e.name, &enumeration(e))));
    files.extend(records::FILES.iter().map(|f| {
        let includes: String = f.includes.iter().map(|name| format!("#include \"interface/{name}.glsl\"\n")).collect();
        let loads: String = f.records.iter().filter_map(load).collect();
        file(f.name, &(includes + &record_file(f) + &loads))
    }));
    files
}

/// A compute shader that declares every record: build.rs reads their layout from its SPIR-V.
pub fn check_shader() -> String {
    let mut text = "#version 460\n#extension GL_EXT_buffer_reference : require\n\
         #extension GL_EXT_buffer_reference_uvec2 : require\nlayout(local_size_x = 1) in;\n"
        .to_owned();
    records::FILES.iter().for_each(|f| text += &record_file(f));
    for (binding, record) in records::FILES.iter().flat_map(|f| f.records).enumerate() {
        let member = match record.form {
            Form::Structure | Form::Array { .. } => "v[]",
            Form::Block { .. } => "v",
            // declared with a variable already; not laid out by the compiler
            Form::Push | Form::Words => continue,
        };
        let _ = writeln!(
            text,
            "layout(std430, binding = {binding}) buffer Check{0} {{ {0} {member}; }} check{binding};",
            record.name
        );
    }
    text + "void main() {}\n"
}

fn file(name: &str, text: &str) -> (String, String) {
    let guard = format!("INTERFACE_{}", name.to_uppercase());
    (
        format!("interface/{name}.glsl"),
        format!(
            "// Generated from the declarations in src/interface.\n#ifndef {guard}\n#define {guard}\n{text}#endif\n"
        ),
    )
}

fn constants() -> String {
    let mut text = String::new();
    for (id, c) in constants::ALL.iter().enumerate() {
        let suffix = if c.kind == "uint" { "u" } else { "" };
        let _ = writeln!(
            text,
            "layout(constant_id = {id}) const {} {} = {}{suffix};  //{}",
            c.kind, c.name, c.default, c.doc
        );
    }
    text
}

fn feature_set(set: &features::Declaration) -> String {
    let mut text = String::new();
    if set.name == features::BSDF.name {
        let _ = writeln!(text, "const uint BSDF_NONE = 0u;  // absorbs everything");
        for (number, (name, doc)) in (1..).zip(set.features) {
            let _ = writeln!(text, "const uint BSDF_{} = {number}u;  // {doc}", name.trim_start_matches("HAS_"));
        }
    }
    if set.name == features::LIGHTS.name {
        for (number, (name, doc)) in set.features.iter().enumerate() {
            let name = name.trim_start_matches("HAS_").trim_end_matches("_LIGHTS");
            let _ = writeln!(text, "const uint LIGHT_{name} = {number}u;  // {doc}");
        }
    }
    let (words, all) = (set.name.to_uppercase(), if set.is_full { "0xffffffffu" } else { "0u" });
    for word in 0..set.features.len().div_ceil(32) {
        let _ =
            writeln!(text, "layout(constant_id = {}) const uint {words}_{word} = {all};", set.first_id as usize + word);
    }
    let _ = writeln!(text, "const uint {words}_COUNT = {}u;", set.features.len());
    if set.name == features::TEXTURE.name {
        let is_srgb = |f: &&TextureFeature| f.texels() == Texels::Srgb;
        let srgb = TextureFeature::ALL.iter().filter(is_srgb).fold(0, |mask, &f| mask | 1u32 << f as u32);
        let _ = writeln!(text, "const uint SRGB_TEXTURES = 0x{srgb:x}u;  // those whose texels are sRGB");
    }
    for (k, (name, doc)) in set.features.iter().enumerate() {
        if set.is_indexed {
            let _ = writeln!(text, "const uint {name} = {k}u;  // {doc}");
            continue;
        }
        let _ = writeln!(text, "const bool {name} = ({words}_{} & 0x{:x}u) != 0u;  // {doc}", k / 32, 1u32 << (k % 32));
    }
    text
}

/// Generates the numbers of reflection models, and functions that dispatch to those in use.
fn bsdf_dispatch() -> String {
    // HAS_NAME
    let names: Vec<_> =
        features::BSDF.features.iter().map(|(name, _)| name.trim_start_matches("HAS_").to_owned()).collect();
    let mut text: String =
        names.iter().map(|name| format!("#include \"bsdf/{}.glsl\"\n", name.to_lowercase())).collect();
    let mut function = |head: &str, call: &str, otherwise: &str| {
        let _ = writeln!(text, "{head} {{");
        for name in &names {
            let call = call.replace("NAME", &name.to_lowercase());
            let _ = writeln!(text, "    if (is_bsdf(b, BSDF_{name}, HAS_{name})) {call}");
        }
        let _ = writeln!(text, "    {otherwise}\n}}");
    };
    function("void bsdf_setup(inout Bsdf b, inout MaterialPoint point)", "{ NAME_setup(b, point); return; }", "");
    function("bool has_smooth_part(Bsdf b)", "return NAME_has_smooth_part(b);", "return false;");
    function("bool has_rough_part(Bsdf b)", "return NAME_has_rough_part(b);", "return false;");
    function("BsdfValue bsdf_eval(Bsdf b, vec3 wo, vec3 wi)", "return NAME_eval(b, wo, wi);", "return NO_VALUE;");
    function("vec3 bsdf_diffuse(Bsdf b, vec3 wo, vec3 wi)", "return NAME_diffuse(b, wo, wi);", "return vec3(0.0);");
    function(
        "BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec2 u, float v)",
        "return NAME_sample(b, wo, u, v);",
        "return NO_SAMPLE;",
    );
    text
}

/// Generates the functions that dispatch to kinds of lights in use; one alone needs no branch.
fn light_dispatch() -> String {
    let names: Vec<_> = features::LIGHTS
        .features
        .iter()
        .map(|(name, _)| name.trim_start_matches("HAS_").trim_end_matches("_LIGHTS").to_owned())
        .collect();
    let mut text: String =
        names.iter().map(|name| format!("#include \"lights/{}.glsl\"\n", name.to_lowercase())).collect();
    let mut function = |head: &str, call: &str, otherwise: &str| {
        let _ = writeln!(text, "{head} {{");
        for name in &names {
            let _ = writeln!(text, "    if (is_kind(light, LIGHT_{name})) return {}{call};", name.to_lowercase());
        }
        let _ = writeln!(text, "    return {otherwise};\n}}");
    };
    function(
        "LightSample light_sample(PathParams p, LightRecord light, vec3 from, Shading m, vec2 u)",
        "_sample(p, light, from, m, u)",
        "NO_LIGHT_SAMPLE",
    );
    function(
        "float light_pdf(LightRecord light, vec3 from, vec3 wi, float distance)",
        "_pdf(light, from, wi, distance)",
        "0.0",
    );
    text
}

fn enumeration(e: &enumerations::Declaration) -> String {
    let mut text = String::new();
    for (name, number, doc) in &e.variants {
        let _ = writeln!(text, "const uint {name} = {number}u;  // {doc}");
    }
    let _ = writeln!(text, "const uint {}_COUNT = {}u;", e.name.to_uppercase(), e.variants.len());
    text
}

fn record_file(file: &File) -> String {
    let mut text = String::new();
    for value in file.values {
        let (kind, number) = match value.number {
            Number::uint(n) => ("uint", format!("{n}u")),
            Number::float(x) => ("float", format!("{x:?}")),
        };
        let _ = writeln!(text, "const {kind} {} = {number};  //{}", value.name, value.doc.concat());
    }
    file.records.iter().for_each(|r| text += &record(r));
    text
}

/// Declares a record, and constants of its size.
fn record(record: &Record) -> String {
    let (name, constant) = (record.name, constant_name(record.name));
    let mut text: String = record.doc.iter().map(|line| format!("//{line}\n")).collect();
    let buffer = |access: &str, align: usize| {
        let access = if access.is_empty() { String::new() } else { format!("{access} ") };
        format!("layout(buffer_reference, std430, buffer_reference_align = {align}) {access}buffer")
    };
    let members: String = record.fields.iter().map(member).collect();
    let _ = match record.form {
        Form::Structure => writeln!(text, "struct {name} {{\n{members}}};"),
        Form::Array { buffer: array, access, align } => {
            writeln!(text, "struct {name} {{\n{members}}};\n{} {array} {{ {name} v[]; }};", buffer(access, align))
        }
        Form::Block { access, align } => writeln!(text, "{} {name} {{\n{members}}};", buffer(access, align)),
        Form::Push => writeln!(text, "layout(push_constant) uniform {name} {{\n{members}}} push;"),
        Form::Words => {
            record.fields.iter().for_each(|f| text += &word_macros(&constant, f));
            writeln!(text, "const uint {constant}_PAIRS = {}u;", record.size / 8)
        }
    };
    let _ = writeln!(text, "const uint {constant}_BYTES = {}u;", record.size);
    text
}

/// Declares a function that loads a record of an array by pairs of words, if it contains no other:
/// a CPU driver gathers 64 bits at the cost of 32, and unused ones are not loaded.
fn load(record: &Record) -> Option<String> {
    let Form::Array { align, access: "readonly", .. } = record.form else { return None };
    if align < 8 || !record.size.is_multiple_of(8) {
        return None;
    }
    let values: Option<Vec<String>> = record.fields.iter().map(loaded).collect();
    let (name, pairs) = (record.name, record.size / 8);
    let mut text = format!("{name} load_{}(uvec2 base, uint k) {{\n", constant_name(name).to_lowercase());
    for pair in 0..pairs {
        let _ = writeln!(text, "    uvec2 w{pair} = LOAD_PAIR(base, {pairs}u * k + {pair}u);");
    }
    let _ = writeln!(text, "    return {name}({});\n}}", values?.join(", "));
    Some(text)
}

/// The value of a field, from pairs of words `w0`, `w1`, ...; none for another record.
fn loaded(field: &Field) -> Option<String> {
    let elements: usize = field.counts.iter().product();
    let words = field.size / 4 / elements;
    let (kind, is_float) = match field.kind {
        "address" | "bytes8" | "uvec2" => ("uvec2", false),
        "uint" | "uvec3" | "uvec4" => (field.kind, false),
        "float" | "vec2" | "vec3" | "vec4" => (field.kind, true),
        _ => return None,
    };
    let value = |element: usize| {
        let first = field.offset / 4 + element * words;
        let parts = (first..first + words).map(|word| format!("w{}.{}", word / 2, ["x", "y"][word % 2]));
        let parts = parts.map(|part| if is_float { format!("uintBitsToFloat({part})") } else { part });
        format!("{kind}({})", parts.collect::<Vec<_>>().join(", "))
    };
    let values: Vec<String> = (0..elements).map(value).collect();
    match &field.counts {
        [] => values.into_iter().next(),
        [_] => Some(format!("{kind}[]({})", values.join(", "))),
        _ => None,
    }
}

fn member(field: &Field) -> String {
    let kind = match field.kind {
        "address" | "bytes8" => "uvec2",
        kind => kind,
    };
    let counts: String = field.counts.iter().map(|n| format!("[{n}]")).collect();
    format!("    {kind} {}{counts};  //{}\n", field.name, field.doc.concat())
}

/// Generates macros for the words of a field, one for each element of an array, numbered. Macros of
/// over two words, or of two in different pairs, are given their vector's constructor.
fn word_macros(record: &str, field: &Field) -> String {
    let elements: usize = field.counts.iter().product();
    let words = field.size / 4 / elements;
    let mut text = String::new();
    for element in 0..elements {
        let first = field.offset / 4 + element * words;
        let mut parts = Vec::new();
        let mut word = first;
        while word < first + words {
            let pair = word.is_multiple_of(2) && word + 1 < first + words;
            parts.push(format!("w{}{}", word / 2, if pair { "" } else { [".x", ".y"][word % 2] }));
            word += 1 + usize::from(pair);
        }
        let mut name = format!("{record}_{}", field.name.to_uppercase());
        if !field.counts.is_empty() {
            let _ = write!(name, "_{element}");
        }
        let _ = match parts.as_slice() {
            [one] => writeln!(text, "#define {name} {one}  //{}", field.doc.concat()),
            several => writeln!(text, "#define {name}(T) T({})  //{}", several.join(", "), field.doc.concat()),
        };
    }
    text
}

/// `QueueRecord` as `QUEUE_RECORD`.
fn constant_name(name: &str) -> String {
    let mut out = String::new();
    for (k, c) in name.char_indices() {
        if k > 0 && c.is_uppercase() {
            out.push('_');
        }
        out.extend(c.to_uppercase());
    }
    out
}
