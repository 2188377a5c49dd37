//! Circles of files: files of src/ that use one another, directly or through others.
//!
//! An edge leads from a file to each file that defines an item it names. A name that a module
//! re-exports leads to the file that defines it, so a mod.rs that only declares and re-exports
//! modules is in no circle.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, ForeignItem, Item, ItemMod, ItemUse, Macro, UseTree, Visibility};

/// A module's path from the crate's root, or an item's.
type Names = Vec<String>;

/// One name that a `use` brings into a file.
struct Use {
    /// Module that the `use` stands in.
    module: Names,
    path: Names,
    /// The name that it has here; none of a glob.
    name: Option<String>,
    is_reexport: bool,
}

/// What a source file defines and names, as written.
#[derive(Default)]
struct Source {
    /// Module that is being read: that of the file, or one within it.
    module: Names,
    defined: BTreeSet<String>,
    uses: Vec<Use>,
    /// Paths outside of `use`, each with the module that it stands in.
    paths: BTreeSet<(Names, Names)>,
}

impl Source {
    fn parse(module: &[String], text: &str) -> syn::Result<Source> {
        let mut source = Source { module: module.to_vec(), ..Source::default() };
        source.visit_file(&syn::parse_file(text)?);
        Ok(source)
    }

    fn add_path(&mut self, path: Names) {
        if !path.is_empty() {
            self.paths.insert((self.module.clone(), path));
        }
    }

    fn add_use(&mut self, tree: &UseTree, path: &mut Names, is_reexport: bool) {
        let (name, alias) = match tree {
            UseTree::Path(p) => {
                path.push(p.ident.to_string());
                self.add_use(&p.tree, path, is_reexport);
                path.pop();
                return;
            }
            UseTree::Group(g) => return g.items.iter().for_each(|t| self.add_use(t, path, is_reexport)),
            UseTree::Name(n) => (Some(n.ident.to_string()), n.ident.to_string()),
            UseTree::Rename(r) => (Some(r.ident.to_string()), r.rename.to_string()),
            UseTree::Glob(_) => (None, String::new()),
        };
        // `a::{self}` is `a`
        let is_self = name.as_deref() == Some("self");
        let alias = if is_self && alias == "self" { path.last().cloned().unwrap_or_default() } else { alias };
        let named = name.clone().filter(|_| !is_self);
        let path = path.iter().cloned().chain(named).collect();
        self.uses.push(Use { module: self.module.clone(), path, name: name.map(|_| alias), is_reexport });
    }

    /// Adds the paths in the text that a macro is given, and the items that this text defines.
    fn add_tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut colons, mut last) = (Names::new(), 0, String::new());
        for token in tokens {
            match token {
                TokenTree::Ident(name) => {
                    let name = name.to_string();
                    if ["struct", "enum", "fn", "const", "static", "type", "trait", "mod"].contains(&last.as_str()) {
                        self.defined.insert(name.clone());
                    }
                    // names with two colons between them are one path
                    if colons != 2 {
                        self.add_path(std::mem::take(&mut path));
                    }
                    path.push(name.clone());
                    (colons, last) = (0, name);
                    continue;
                }
                TokenTree::Punct(p) if p.as_char() == ':' => colons += 1,
                TokenTree::Group(g) => {
                    self.add_tokens(g.stream());
                    colons = 0;
                }
                _ => colons = 0,
            }
            last.clear();
        }
        self.add_path(path);
    }
}

/// The name and attributes of an item.
fn name_of(item: &Item) -> (Option<&syn::Ident>, &[Attribute]) {
    match item {
        Item::Const(i) => (Some(&i.ident), &i.attrs),
        Item::Enum(i) => (Some(&i.ident), &i.attrs),
        Item::Fn(i) => (Some(&i.sig.ident), &i.attrs),
        Item::Macro(i) => (i.ident.as_ref(), &i.attrs),
        Item::Mod(i) => (i.content.as_ref().map(|_| &i.ident), &i.attrs),
        Item::Static(i) => (Some(&i.ident), &i.attrs),
        Item::Struct(i) => (Some(&i.ident), &i.attrs),
        Item::Trait(i) => (Some(&i.ident), &i.attrs),
        Item::Type(i) => (Some(&i.ident), &i.attrs),
        Item::Union(i) => (Some(&i.ident), &i.attrs),
        Item::Impl(i) => (None, &i.attrs),
        Item::Use(i) => (None, &i.attrs),
        _ => (None, &[]),
    }
}

impl<'ast> Visit<'ast> for Source {
    fn visit_item(&mut self, item: &'ast Item) {
        let (name, attributes) = name_of(item);
        if !super::is_for_tests(attributes) {
            self.defined.extend(name.map(|n| n.to_string()));
            visit::visit_item(self, item);
        }
    }

    fn visit_foreign_item(&mut self, _: &'ast ForeignItem) {}

    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        self.module.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        let is_reexport = !matches!(item.vis, Visibility::Inherited);
        self.add_use(&item.tree, &mut Names::new(), is_reexport);
    }

    // `pub(in crate::a)` names a module and uses nothing of it
    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.add_path(path.segments.iter().map(|s| s.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast Macro) {
        self.visit_path(&item.path);
        self.add_tokens(item.tokens.clone());
    }

    // documentation names what it likes
    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}

/// The files of a crate by their modules; that of lib.rs is empty.
#[derive(Default)]
pub struct Crate {
    sources: BTreeMap<Names, Source>,
}

/// Which files use which, and the names by which they do.
type Edges = BTreeMap<Names, BTreeMap<Names, BTreeSet<String>>>;

impl Crate {
    pub fn add(&mut self, module: &[String], text: &str) -> syn::Result<()> {
        self.sources.insert(module.to_vec(), Source::parse(module, text)?);
        Ok(())
    }

    /// The path from the crate's root that `path` means in `module` of the file `file`; none where
    /// it is of another crate, or of the file's own items.
    fn absolute(&self, file: &[String], module: &[String], path: &[String]) -> Option<Names> {
        let join = |a: &[String], b: &[String]| Some(a.iter().chain(b).cloned().collect::<Names>());
        let up = path.iter().take_while(|n| *n == "super").count();
        if up > 0 {
            return join(&module[..module.len().saturating_sub(up)], &path[up..]);
        }
        let first = path.first()?;
        match first.as_str() {
            "crate" => return join(&[], &path[1..]),
            "self" => return join(module, &path[1..]),
            _ => {}
        }
        let child = join(module, std::slice::from_ref(first))?;
        if self.sources.contains_key(&child) {
            return join(&child, &path[1..]);
        }
        let is_this = |u: &&Use| u.name.as_ref() == Some(first) && u.path.first() != Some(first);
        let used = self.sources[file].uses.iter().find(is_this)?;
        join(&self.absolute(file, &used.module, &used.path)?, &path[1..])
    }

    /// The file that defines what a path from the crate's root names; none if it names a module.
    fn definition(&self, path: &[String], depth: usize) -> Option<&Names> {
        let length = (0..=path.len()).rev().find(|n| self.sources.contains_key(&path[..*n]))?;
        let (file, source) = self.sources.get_key_value(&path[..length])?;
        let name = path.get(length)?;
        if source.defined.contains(name) || depth == 0 {
            return Some(file);
        }
        for reexport in source.uses.iter().filter(|u| u.is_reexport) {
            let Some(mut target) = self.absolute(file, &reexport.module, &reexport.path) else { continue };
            match &reexport.name {
                Some(n) if n == name => target.extend_from_slice(&path[length + 1..]),
                None => target.extend_from_slice(&path[length..]),
                _ => continue,
            }
            match self.definition(&target, depth - 1) {
                // a glob leads on only to what is there
                Some(found) if reexport.name.is_none() && !self.sources[found].defined.contains(name) => {}
                found => return found,
            }
        }
        Some(file)
    }

    fn edges(&self) -> Edges {
        let mut edges = Edges::new();
        for (file, source) in &self.sources {
            let own = edges.entry(file.clone()).or_default();
            let mut add = |target: Option<&Names>, path: &[String]| {
                if let Some(target) = target.filter(|t| *t != file) {
                    own.entry(target.clone()).or_default().insert(path.join("::"));
                }
            };
            for used in source.uses.iter().filter(|u| !u.is_reexport) {
                let Some(path) = self.absolute(file, &used.module, &used.path) else { continue };
                let glob = self.sources.get_key_value(&path).map(|(f, _)| f).filter(|_| used.name.is_none());
                add(glob.or_else(|| self.definition(&path, 8)), &used.path);
            }
            for (module, path) in &source.paths {
                let Some(target) = self.absolute(file, module, path) else { continue };
                add(self.definition(&target, 8), path);
            }
        }
        edges
    }

    /// All circles of two files or more, the largest first, each with what ties its files.
    pub fn circles(&self) -> Vec<Circle> {
        let edges = self.edges();
        let files: Vec<&Names> = edges.keys().collect();
        let index: BTreeMap<&Names, usize> = files.iter().enumerate().map(|(i, f)| (*f, i)).collect();
        let used: Vec<Vec<usize>> = edges.values().map(|to| to.keys().map(|f| index[f]).collect()).collect();
        let reached: Vec<Vec<bool>> = (0..files.len()).map(|start| reachable(&used, start)).collect();
        let mut circles = Vec::new();
        for (first, reaches) in reached.iter().enumerate() {
            let circle: Vec<usize> = (0..files.len()).filter(|&i| reaches[i] && reached[i][first]).collect();
            // of a file in no circle it is empty; other circles are found by their first file
            if circle.len() > 1 && circle[0] == first {
                let circle: Vec<Names> = circle.into_iter().map(|i| files[i].clone()).collect();
                let ties = circle.iter().flat_map(|from| {
                    let inner = edges[from].iter().filter(|(to, _)| circle.contains(to));
                    let list = |names: &BTreeSet<String>| names.iter().cloned().collect::<Vec<_>>().join(", ");
                    inner.map(move |(to, names)| (from.join("::"), to.join("::"), list(names)))
                });
                circles.push(Circle { ties: ties.collect(), files: circle });
            }
        }
        circles.sort_by_key(|c| std::cmp::Reverse(c.files.len()));
        circles
    }
}

/// Which files `start` uses, directly or through others: itself only if they lead back to it.
fn reachable(used: &[Vec<usize>], start: usize) -> Vec<bool> {
    let (mut found, mut open) = (vec![false; used.len()], vec![start]);
    while let Some(file) = open.pop() {
        for &next in &used[file] {
            if !std::mem::replace(&mut found[next], true) {
                open.push(next);
            }
        }
    }
    found
}

/// Files each of which uses each other one, directly or through others.
pub struct Circle {
    /// Modules of its files.
    pub files: Vec<Names>,
    /// Which module uses which, and the names by which it does.
    pub ties: Vec<(String, String, String)>,
}

#[test]
fn circles_are_found() {
    let circles = |files: &[(&str, &str)]| {
        let mut all = Crate::default();
        for (module, text) in files {
            let module: Names = module.split("::").filter(|n| !n.is_empty()).map(str::to_owned).collect();
            all.add(&module, text).unwrap();
        }
        all.circles().iter().map(|c| c.files.iter().map(|f| f.join("::")).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    // a module that re-exports is in no circle; what it names besides makes one
    let files = [("a::b", "use super::D; struct C;"), ("a::d", "pub struct D;")];
    assert!(circles(&[&[("a", "mod b; mod d; pub use d::D; pub use b::C;")], &files[..]].concat()).is_empty());
    assert!(circles(&[&[("a", "mod b; mod d; pub use d::*;")], &files[..]].concat()).is_empty());
    let dispatcher = [("a", "mod b; mod d; pub use d::D; fn f() { b::g(D) }")];
    assert!(circles(&[&dispatcher[..], &files[..]].concat()).is_empty());
    let helper = [("a", "mod b; pub use b::C; pub struct D; fn f(_: C) {}"), files[0]];
    assert_eq!(circles(&helper), [["a", "a::b"]]);
    // names of a macro's text, of an imported module, and of what a function calls
    let calls = [
        ("a", "fn f() { println!(\"{}\", crate::b::g()); } #[cfg(test)] mod tests { use crate::e::h; }"),
        ("b", "use crate::c; /// See [`crate::a`].\nfn g() { c::h() }"),
        ("c", "use crate::a::{self as other}; fn h() { other::f() }"),
        ("e", "fn h() { crate::a::f() }"),
    ];
    assert_eq!(circles(&calls), [["a", "b", "c"]]);
}
