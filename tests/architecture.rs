//! Who may use whom: imports between the rooms of src/ point downwards, folders have no circles, and none holds too much.
//!
//! ARCHITECTURE.md draws the same layers under "Layers". `cargo test --test architecture -- --nocapture` prints which rooms each room uses.

#[path = "architecture/circles.rs"]
mod circles;
#[path = "architecture/voice.rs"]
mod voice;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, ItemUse, Macro, UseTree};

/// Rooms of src/ (folders, and files beside lib.rs) from the bottom up. A room uses rooms of lower layers only, none of its own layer.
const LAYERS: &[&[&str]] = &[
    &["error"],
    &["memory", "stage"],
    &["colour", "files"],
    &["settings"],
    &["interface"],
    &["output", "ray", "sampling"],
    &["scene", "shaders"],
    &["accel", "gpu"],
    &["oracle", "tracer"],
    &["film", "measure"],
    &["raster"],
    &["integrators"],
    &["realtime"],
    &["denoise"],
    &["renderer"],
    &["terminal"],
    &["report"],
    &["bake"],
    &["bench", "compare", "stress", "verify", "viewer"],
    &["cli"],
];

/// No circle of files has more of them than this.
const MAX_CIRCLE: usize = 4;

/// More macros are not declared: rustfmt does not see what they are given, and no search finds it.
const MAX_MACROS: usize = 20;

/// No folder holds this share of all lines.
const MAX_SHARE: f64 = 0.15;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All files under a folder of the repository whose name ends in one of `extensions`.
fn files(folder: &str, extensions: &[&str]) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![root().join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()) {
            if entry.is_dir() {
                folders.push(entry);
            } else if entry.extension().is_some_and(|e| extensions.iter().any(|x| e == *x)) {
                files.push(entry);
            }
        }
    }
    files.sort();
    files
}

/// A path from the crate's root that a file names outside of documentation and of what only tests compile.
struct Import {
    file: PathBuf,
    /// Of the module that names it: `["scene", "load"]`.
    from: Vec<String>,
    to: Vec<String>,
}

/// Modules of a file: `src/scene/load/mod.rs` is `["scene", "load"]`; none of lib.rs and main.rs.
fn module_of(file: &Path) -> Vec<String> {
    let path = file.strip_prefix(root().join("src")).unwrap().with_extension("");
    let mut names: Vec<String> = path.iter().map(|n| n.to_string_lossy().into_owned()).collect();
    if matches!(names.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        names.pop();
    }
    names
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("test")
            || a.path().is_ident("cfg") && matches!(&a.meta, syn::Meta::List(l) if l.tokens.to_string() == "test")
    })
}

struct Imports<'a> {
    file: &'a Path,
    module: Vec<String>,
    found: Vec<Import>,
}

impl Imports<'_> {
    /// A path as written; kept if it starts with `crate` or `super`.
    fn add(&mut self, path: &[String]) {
        let up = path.iter().take_while(|n| *n == "super").count();
        let to = match path.first().map(String::as_str) {
            Some("crate") => path[1..].to_vec(),
            Some("super") => {
                let above = &self.module[..self.module.len().saturating_sub(up)];
                above.iter().chain(&path[up..]).cloned().collect()
            }
            _ => return,
        };
        self.found.push(Import { file: self.file.to_owned(), from: self.module.clone(), to });
    }

    fn add_tree(&mut self, tree: &UseTree, path: &mut Vec<String>) {
        let mut end = |this: &mut Self, name: &syn::Ident, below: Option<&UseTree>| {
            path.push(name.to_string());
            match below {
                Some(below) => this.add_tree(below, path),
                None => this.add(path),
            }
            path.pop();
        };
        match tree {
            UseTree::Path(p) => end(self, &p.ident, Some(&p.tree)),
            UseTree::Name(n) => end(self, &n.ident, None),
            UseTree::Rename(r) => end(self, &r.ident, None),
            UseTree::Glob(_) => self.add(path),
            UseTree::Group(g) => g.items.iter().for_each(|t| self.add_tree(t, path)),
        }
    }

    /// Paths in the text that a macro is given.
    fn add_tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        // `a::b`: names that follow each other but for two colons
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(name) => {
                    if colons != 2 {
                        self.add(&path);
                        path.clear();
                    }
                    path.push(name.to_string());
                    colons = 0;
                }
                TokenTree::Punct(p) if p.as_char() == ':' => colons += 1,
                TokenTree::Group(g) => {
                    self.add_tokens(g.stream());
                    colons = 0;
                }
                _ => colons = 0,
            }
        }
        self.add(&path);
    }
}

impl<'ast> Visit<'ast> for Imports<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        let attributes: &[Attribute] = match item {
            Item::Fn(i) => &i.attrs,
            Item::Impl(i) => &i.attrs,
            Item::Mod(i) => &i.attrs,
            Item::Use(i) => &i.attrs,
            _ => &[],
        };
        if !is_for_tests(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        self.module.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.add_tree(&item.tree, &mut Vec::new());
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        self.add(&names);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast Macro) {
        self.add_tokens(item.tokens.clone());
    }

    // documentation names what it likes
    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}

fn imports_of(file: &Path, text: &str) -> Vec<Import> {
    let parsed = syn::parse_file(text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut imports = Imports { file, module: module_of(file), found: Vec::new() };
    imports.visit_file(&parsed);
    imports.found
}

/// Of all files of src/ but lib.rs and main.rs.
fn imports() -> Vec<Import> {
    let files = files("src", &["rs"]);
    let read = |f: &PathBuf| imports_of(f, &std::fs::read_to_string(f).unwrap());
    files.iter().filter(|f| !module_of(f).is_empty()).flat_map(read).collect()
}

fn layer(room: &str) -> usize {
    LAYERS.iter().position(|l| l.contains(&room)).unwrap_or_else(|| {
        panic!(
            "src/{room} has no layer: add it to LAYERS in tests/architecture.rs and to the drawing in ARCHITECTURE.md"
        )
    })
}

/// Folders of src/ and the files beside lib.rs.
fn rooms() -> BTreeSet<String> {
    files("src", &["rs"]).iter().filter_map(|f| module_of(f).into_iter().next()).collect()
}

#[test]
fn imports_point_downwards() {
    let rooms = rooms();
    let mut uses: BTreeMap<(usize, &str), BTreeSet<&str>> = BTreeMap::new();
    let mut wrong = Vec::new();
    let imports = imports();
    for import in &imports {
        let [from, to] = [&import.from, &import.to].map(|m| m.first().map_or("", String::as_str));
        // what is no room, lib.rs gives another name
        if from == to || !rooms.contains(to) {
            continue;
        }
        uses.entry((layer(from), from)).or_default().insert(to);
        if layer(to) >= layer(from) {
            let file = import.file.strip_prefix(root()).unwrap().display();
            let name = import.to.join("::");
            wrong.push(format!("{file}: `{from}` uses `{to}`, which does not stand below it: crate::{name}"));
        }
    }
    for ((_, room), used) in uses.iter().rev() {
        println!("{room:12} uses {}", used.iter().copied().collect::<Vec<_>>().join(", "));
    }
    assert!(uses.len() > LAYERS.len(), "hardly any import was found: {uses:?}");
    assert!(wrong.is_empty(), "imports that do not point downwards:\n{}", wrong.join("\n"));
}

#[test]
fn every_room_has_a_layer() {
    let layers: BTreeSet<String> = LAYERS.iter().flat_map(|l| l.iter().map(|r| r.to_string())).collect();
    assert_eq!(layers.len(), LAYERS.iter().map(|l| l.len()).sum::<usize>(), "a room stands in LAYERS twice");
    assert_eq!(layers, rooms(), "LAYERS (left) are not the rooms of src/ (right)");
}

#[test]
fn the_drawing_shows_the_layers() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let section = text.split("\n## Layers\n").nth(1).expect("ARCHITECTURE.md has a section \"Layers\"");
    let section = section.split("\n## ").next().unwrap_or_default();
    let drawn: Vec<Vec<&str>> =
        section.lines().filter_map(|l| Some(l.strip_prefix("    ")?.split_whitespace().collect())).collect();
    let layers: Vec<Vec<&str>> = LAYERS.iter().rev().map(|l| l.to_vec()).collect();
    assert_eq!(drawn, layers, "the drawing in ARCHITECTURE.md (left) is not LAYERS in tests/architecture.rs (right)");
}

/// Folders within folders count as folders of their own. What holds another (a room and its folders) is one thing seen from outside; so circles are looked
/// for among folders of which neither holds the other.
#[test]
fn folders_have_no_circles() {
    let folders: BTreeSet<Vec<String>> = files("src", &["rs"])
        .iter()
        .map(|f| module_of(f))
        .flat_map(|m| (1..m.len()).map(move |n| m[..n].to_vec()))
        .collect();
    let folder_of = |module: &[String]| -> Vec<String> {
        let holds = |n: &usize| folders.contains(&module[..*n]);
        module[..(1..=module.len()).rev().find(holds).unwrap_or(0)].to_vec()
    };
    let mut edges: BTreeMap<Vec<String>, BTreeMap<Vec<String>, String>> = BTreeMap::new();
    for import in imports() {
        let [from, to] = [folder_of(&import.from), folder_of(&import.to)];
        let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
        if common < from.len() && common < to.len() {
            let file = import.file.strip_prefix(root()).unwrap().display();
            let place = format!("{file}: crate::{}", import.to.join("::"));
            edges.entry(from[..=common].to_vec()).or_default().entry(to[..=common].to_vec()).or_insert(place);
        }
    }
    // what uses nothing that is left cannot be in a circle
    let mut left: BTreeSet<&Vec<String>> = edges.keys().collect();
    loop {
        let ends: Vec<_> = left.iter().copied().filter(|f| !edges[*f].keys().any(|to| left.contains(to))).collect();
        if ends.is_empty() {
            break;
        }
        ends.into_iter().for_each(|f| {
            left.remove(f);
        });
    }
    let mut circles = String::new();
    for from in &left {
        for (to, place) in edges[*from].iter().filter(|(to, _)| left.contains(to)) {
            circles += &format!("src/{} uses src/{} ({place})\n", from.join("/"), to.join("/"));
        }
    }
    assert!(circles.is_empty(), "folders in circles, or above one:\n{circles}");
}

/// Prints all circles, which `scripts/house.py` counts.
#[test]
fn circles_of_files_are_small() {
    // lib.rs re-exports, main.rs is another crate
    let files = files("src", &["rs"]).into_iter().filter(|f| !f.ends_with("src/main.rs"));
    let mut all = circles::Crate::default();
    let mut names = BTreeMap::new();
    for file in files {
        let module = module_of(&file);
        all.add(&module, &std::fs::read_to_string(&file).unwrap()).unwrap();
        names.insert(module, file.strip_prefix(root()).unwrap().display().to_string());
    }
    let (mut wrong, circles) = (String::new(), all.circles());
    let large = circles.iter().filter(|c| c.files.len() > MAX_CIRCLE).count();
    println!("circles of files: {}, of more than {MAX_CIRCLE}: {large}", circles.len());
    for circle in circles {
        let files: Vec<&str> = circle.files.iter().map(|f| names[f].as_str()).collect();
        println!("circle of {} files: {}", files.len(), files.join(" "));
        if files.len() > MAX_CIRCLE {
            wrong += &format!("\n{} files:\n", files.len());
            circle.ties.iter().for_each(|(from, to, names)| wrong += &format!("  {from} uses {to} ({names})\n"));
        }
    }
    assert!(wrong.is_empty(), "circles of more than {MAX_CIRCLE} files:\n{wrong}");
}

#[test]
fn no_folder_holds_too_much() {
    let mut lines: BTreeMap<PathBuf, usize> = BTreeMap::new();
    let shaders = ["glsl", "vert", "frag", "rchit", "rahit", "rint", "rmiss"];
    for file in [files("src", &["rs"]), files("shaders", &shaders), files("tests", &["rs", "glsl"])].concat() {
        let folder = file.parent().unwrap().strip_prefix(root()).unwrap().to_owned();
        *lines.entry(folder).or_default() += std::fs::read_to_string(&file).unwrap().lines().count();
    }
    let all: usize = lines.values().sum();
    for (folder, &n) in &lines {
        let share = n as f64 / all as f64;
        assert!(share < MAX_SHARE, "{} holds {:.1} % of all lines: divide it", folder.display(), 100.0 * share);
    }
}

#[test]
fn there_are_few_macros() {
    let mut declared = Vec::new();
    let folders = ["src", "tests", "benches", "examples"].map(|folder| files(folder, &["rs"])).concat();
    for file in folders.into_iter().chain([root().join("build.rs")]) {
        let text = std::fs::read_to_string(&file).unwrap();
        let names = text.lines().filter_map(|line| line.trim_start().strip_prefix("macro_rules! "));
        declared.extend(names.map(|name| format!("{}: {name}", file.strip_prefix(root()).unwrap().display())));
    }
    assert!(declared.iter().any(|d| d.contains("settings")), "hardly any macro was found: {declared:?}");
    assert!(declared.len() <= MAX_MACROS, "{} macros:\n{}", declared.len(), declared.join("\n"));
}

#[test]
fn the_voice_is_held() {
    let mut lapses = Vec::new();
    for file in files("src", &["rs"]) {
        voice::check(file.strip_prefix(root()).unwrap(), &std::fs::read_to_string(&file).unwrap(), &mut lapses);
    }
    assert!(lapses.is_empty(), "{} lapses:\n{}", lapses.len(), lapses.join("\n"));
}

#[test]
fn imports_are_found() {
    let text = "
        //! Documentation may name crate::a.
        use crate::{b::c, d::{self, E}};
        /// Or [`crate::f`].
        fn g() { crate::h::i(super::super::j::K); println!(\"{}\", crate::l::m()); }
        #[cfg(test)]
        mod tests { use crate::n; }
    ";
    let found = imports_of(&root().join("src/x/y.rs"), text);
    let found: Vec<String> = found.into_iter().map(|i| i.to.join("::")).collect();
    assert_eq!(found, ["b::c", "d::self", "d::E", "h::i", "j::K", "l::m"]);
}
