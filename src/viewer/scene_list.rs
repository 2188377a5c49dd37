//! The list of the section *Scene*: a tree of the nodes of the file, or objects by their meshes in
//! a scene without nodes. Its lines are made when folds, the search or the scene change.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use crate::scene::NodeTree;
use crate::viewer::request::{ObjectSummary, SceneSummary};

/// A part of the scene that is selected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// An instance, an index.
    Object(usize),
    /// A node with all that is below it, an index.
    Node(usize),
}

impl Selection {
    /// The objects that are selected, in a scene of these nodes.
    pub fn objects(self, nodes: &NodeTree) -> Range<usize> {
        match self {
            Self::Object(k) => k..k + 1,
            Self::Node(k) => nodes.get(k).map_or(0..0, |node| node.instances()),
        }
    }
}

/// Content of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowKind {
    /// A mesh that several objects have, and their number.
    Mesh(usize, usize),
    /// A node.
    Node(usize),
    /// An object.
    Object(usize),
    /// A camera.
    Camera(usize),
    /// A light.
    Light(usize),
}

/// A line of the list. What it is about is given by its index in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// Content.
    pub kind: RowKind,
    /// Number of lines that it is below.
    pub level: u32,
    /// Index of the node that it is directly below.
    pub node: Option<usize>,
    /// The lines after it list everything below it.
    pub is_open: bool,
}

/// The list, with what is unfolded.
#[derive(Debug, Default)]
pub struct SceneList {
    /// Text that names are searched for.
    search: String,
    /// Indices of nodes that are unfolded, or of meshes in a scene without nodes.
    open: BTreeSet<usize>,
    /// The lines; `None` where they are to be made anew.
    rows: Option<Arc<Vec<Row>>>,
    /// A line that is to be scrolled to.
    wanted: Option<Selection>,
    /// How far the list is scrolled, points.
    pub offset: f32,
}

impl SceneList {
    /// Takes another scene over, or other nodes of the same one.
    pub fn renew(&mut self, scene: &SceneSummary, before: Option<&SceneSummary>) {
        self.rows = None;
        if before.is_none_or(|b| b.source != scene.source || b.nodes != scene.nodes) {
            *self = Self::default();
            // down to where there are several
            let top = scene.nodes.top(scene.counts[0]);
            let has_all = |k: &usize| scene.nodes[*k].instances() == (0..scene.counts[0]);
            let mut above = top.first().and_then(|k| if has_all(k) { Some(*k) } else { scene.nodes[*k].parent() });
            while let Some(k) = above {
                self.open.insert(k);
                above = scene.nodes[k].parent();
            }
        }
    }

    /// Text that names are searched for.
    pub fn search(&self) -> &str {
        &self.search
    }

    /// Searches for another text.
    pub fn set_search(&mut self, text: String) {
        if text != self.search {
            (self.search, self.rows) = (text, None);
        }
    }

    /// Folds or unfolds a node, or a mesh.
    pub fn fold(&mut self, k: usize, is_open: bool) {
        if is_open {
            self.open.insert(k);
        } else {
            self.open.remove(&k);
        }
        self.rows = None;
    }

    /// Unfolds what an object is below, and scrolls to it.
    pub fn reveal(&mut self, scene: &SceneSummary, object: usize) {
        if scene.nodes.is_empty() {
            self.open.extend(scene.objects.get(object).map(|o| o.mesh.0));
        } else {
            self.open.extend(scene.nodes.above(object));
        }
        (self.wanted, self.rows) = (Some(Selection::Object(object)), None);
    }

    /// The lines of a scene.
    pub fn rows(&mut self, scene: &SceneSummary) -> Arc<Vec<Row>> {
        let search = self.search.trim().to_lowercase();
        let open = &self.open;
        let make = || Arc::new(rows(scene, &search, open));
        self.rows.get_or_insert_with(make).clone()
    }

    /// Index of the line that is to be scrolled to, once. A search that does not find it ends.
    pub fn take_wanted(&mut self, scene: &SceneSummary) -> Option<usize> {
        let kind = match self.wanted.take()? {
            Selection::Object(k) => RowKind::Object(k),
            Selection::Node(k) => RowKind::Node(k),
        };
        let find = |rows: &[Row]| rows.iter().position(|row| row.kind == kind);
        find(&self.rows(scene)).or_else(|| {
            self.set_search(String::new());
            find(&self.rows(scene))
        })
    }
}

/// Lines of a scene; `search` is in small letters and may be empty.
fn rows(scene: &SceneSummary, search: &str, open: &BTreeSet<usize>) -> Vec<Row> {
    if !scene.nodes.is_empty() {
        let found = (!search.is_empty()).then(|| Found::search(scene, search));
        return tree(scene, found.as_ref(), open);
    }
    if search.is_empty() {
        return by_meshes(&scene.objects, open);
    }
    let is_found = |(_, o): &(usize, &ObjectSummary)| has(&o.name, search) || has(&o.mesh.1, search);
    let found = scene.objects.iter().enumerate().filter(is_found);
    found.map(|(k, _)| Row { kind: RowKind::Object(k), level: 0, node: None, is_open: false }).collect()
}

fn has(text: &str, search: &str) -> bool {
    text.to_lowercase().contains(search)
}

/// Objects below their meshes, in the order in which the file first has them. Meshes of one object
/// are that object.
fn by_meshes(objects: &[ObjectSummary], open: &BTreeSet<usize>) -> Vec<Row> {
    let mut of_mesh: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (k, object) in objects.iter().enumerate() {
        of_mesh.entry(object.mesh.0).or_default().push(k);
    }
    let object = |k: usize, level| Row { kind: RowKind::Object(k), level, node: None, is_open: false };
    let mut rows = Vec::new();
    for (k, o) in objects.iter().enumerate() {
        let all = &of_mesh[&o.mesh.0];
        match all[..] {
            [_] => rows.push(object(k, 0)),
            [first, ..] if first == k => {
                let is_open = open.contains(&o.mesh.0);
                rows.push(Row { kind: RowKind::Mesh(o.mesh.0, all.len()), level: 0, node: None, is_open });
                rows.extend(all.iter().filter(|_| is_open).map(|k| object(*k, 1)));
            }
            _ => {}
        }
    }
    rows
}

/// Hits of a search.
struct Found {
    /// Whether the name of each node is one.
    nodes: Vec<bool>,
    /// Whether there is one below each node.
    above: Vec<bool>,
    /// Whether the names of objects, cameras and lights are one.
    items: [Vec<bool>; 3],
}

impl Found {
    fn search(scene: &SceneSummary, search: &str) -> Self {
        let items = [
            scene.objects.iter().map(|o| has(&o.name, search) || has(&o.mesh.1, search)).collect(),
            scene.cameras.iter().map(|camera| has(&camera.name, search)).collect(),
            scene.lights.iter().map(|name| has(name, search)).collect::<Vec<bool>>(),
        ];
        let nodes: Vec<bool> = scene.nodes.iter().map(|node| has(&node.name, search)).collect();

        // from the bottom up
        let before = |hits: &Vec<bool>| -> Vec<u32> {
            let mut before = vec![0];
            before.extend(hits.iter().scan(0, |count, hit| {
                *count += u32::from(*hit);
                Some(*count)
            }));
            before
        };
        let before = items.each_ref().map(before);
        let hits_below = |(before, range): (&Vec<u32>, Range<usize>)| {
            let last = before.len() - 1;
            before[range.end.min(last)] > before[range.start.min(last)]
        };
        let mut above: Vec<bool> = scene.nodes.iter().map(|n| before.iter().zip(n.items()).any(hits_below)).collect();
        for k in (0..nodes.len()).rev() {
            if let Some(parent) = scene.nodes[k].parent() {
                above[parent] |= nodes[k] || above[k];
            }
        }
        Self { nodes, above, items }
    }
}

/// Nodes, with what is below those that are unfolded. In a search nodes above hits are.
fn tree(scene: &SceneSummary, found: Option<&Found>, open: &BTreeSet<usize>) -> Vec<Row> {
    let nodes = &scene.nodes;
    let mut lines = Lines { rows: Vec::new(), at: [0; 3], found, hits_above: 0 };
    let counts = [scene.objects.len(), scene.cameras.len(), scene.lights.len()];
    let (mut k, mut stack) = (0, Vec::new());
    loop {
        // what comes after the last node below each that ends here
        while let Some(&top) = stack.last().filter(|top: &&usize| nodes[**top].end() == k) {
            lines.add(nodes[top].items().map(|range| range.end), counts, &stack);
            lines.hits_above -= usize::from(found.is_some_and(|found| found.nodes[top]));
            stack.pop();
        }
        let Some(node) = nodes.get(k) else { break };
        lines.add(node.items().map(|range| range.start), counts, &stack);

        // all of it, if something above it is a hit
        let is_above_hits = found.is_some_and(|found| found.above[k]);
        let is_shown = lines.hits_above > 0 || found.is_none_or(|found| found.nodes[k] || found.above[k]);
        let is_open = is_shown && (is_above_hits || open.contains(&k));
        if is_shown {
            let (level, node) = (stack.len() as u32, stack.last().copied());
            lines.rows.push(Row { kind: RowKind::Node(k), level, node, is_open });
        }
        if is_open {
            lines.hits_above += usize::from(found.is_some_and(|found| found.nodes[k]));
            stack.push(k);
            k += 1;
        } else {
            lines.at = node.items().map(|range| range.end);
            k = node.end();
        }
    }
    lines.add(counts, counts, &[]);
    lines.rows
}

/// Lines in the making.
struct Lines<'a> {
    rows: Vec<Row>,
    /// The next object, camera and light.
    at: [usize; 3],
    found: Option<&'a Found>,
    /// Number of nodes above what comes next whose names are hits.
    hits_above: usize,
}

impl Lines<'_> {
    /// Lists objects, cameras and lights up to these, which are below the nodes of `stack`.
    fn add(&mut self, end: [usize; 3], counts: [usize; 3], stack: &[usize]) {
        let (level, node) = (stack.len() as u32, stack.last().copied());
        let kinds = [RowKind::Object, RowKind::Camera, RowKind::Light];
        for (kind, make) in kinds.into_iter().enumerate() {
            for k in self.at[kind]..end[kind].min(counts[kind]) {
                if self.hits_above > 0 || self.found.is_none_or(|found| found.items[kind][k]) {
                    self.rows.push(Row { kind: make(k), level, node, is_open: false });
                }
            }
            self.at[kind] = end[kind];
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;
    use crate::scene::load;

    /// A summary of an .obj of these statements, each of which is followed by a triangle.
    fn summary(statements: &[&str]) -> SceneSummary {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        let runs: String = statements.iter().map(|s| format!("{s}\nf 1 2 3\n")).collect();
        std::fs::write(&path, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{runs}")).unwrap();
        let scene = load::load(&path.to_string_lossy()).unwrap();
        let object = |i: &crate::scene::Instance| ObjectSummary {
            name: i.name.clone(),
            mesh: (i.mesh, i.name.as_str().into()),
            ..Default::default()
        };
        SceneSummary {
            objects: Arc::new(scene.instances.iter().map(object).collect()),
            counts: [scene.instances.len(), scene.meshes.len(), 1, 0],
            nodes: Arc::new(scene.nodes),
            ..Default::default()
        }
    }

    /// Lines as text, with a dot a level.
    fn shown(list: &mut SceneList, scene: &SceneSummary) -> Vec<String> {
        let name = |row: &Row| match row.kind {
            RowKind::Node(k) => format!("{}{}", if row.is_open { "-" } else { "+" }, scene.nodes[k].name),
            RowKind::Object(k) => scene.objects[k].name.clone(),
            other => format!("{other:?}"),
        };
        let rows = list.rows(scene);
        rows.iter().map(|row| ".".repeat(row.level as usize) + &name(row)).collect()
    }

    #[test]
    fn nodes_are_folded_and_searched() {
        let scene = summary(&["o lone", "o car\ng wheel", "g door", "usemtl glass", "o house\ng door", "g roof"]);
        let mut list = SceneList::default();
        list.renew(&scene, None);
        assert_eq!(shown(&mut list, &scene), ["lone", "+car", "+house"]);
        list.fold(0, true);
        assert_eq!(shown(&mut list, &scene), ["lone", "-car", ".wheel", ".+door", "+house"]);
        list.fold(1, true);
        assert_eq!(shown(&mut list, &scene)[3..6], [".-door", "..door", "..door"]);

        // hits with what they are below; what is below a hit is folded as it was
        list.fold(1, false);
        list.set_search("OO".into());
        assert_eq!(shown(&mut list, &scene), ["-car", ".-door", "..door", "..door", "-house", ".door", ".roof"]);
        list.set_search("hous".into());
        assert_eq!(shown(&mut list, &scene), ["+house"]);
        list.fold(2, true);
        assert_eq!(shown(&mut list, &scene), ["-house", ".door", ".roof"]);
        list.set_search("nothing".into());
        assert!(shown(&mut list, &scene).is_empty());

        // what is selected in the image ends a search without it
        list.reveal(&scene, 2);
        assert_eq!(list.take_wanted(&scene), Some(4));
        assert_eq!((shown(&mut list, &scene)[4].as_str(), list.search()), ("..door", ""));
        assert_eq!(list.take_wanted(&scene), None, "once");

        // the same file again is unfolded as it was, another one is not
        list.renew(&scene, Some(&scene.clone()));
        assert!(shown(&mut list, &scene).contains(&".-door".to_owned()));
        let other = SceneSummary { source: "other".into(), ..scene.clone() };
        list.renew(&other, Some(&scene));
        assert_eq!(shown(&mut list, &scene), ["lone", "+car", "+house"]);
    }

    #[test]
    fn one_node_above_all_is_unfolded() {
        let scene = summary(&["o all\ng a", "g b", "usemtl c"]);
        let mut list = SceneList::default();
        list.renew(&scene, None);
        assert_eq!(shown(&mut list, &scene), ["-all", ".a", ".+b"]);
    }

    #[test]
    fn many_nodes_are_listed_quickly() {
        let statements: Vec<String> = (0..50_000).map(|k| format!("o node {k}\ng a{k}\nf 1 2 3\ng b{k}")).collect();
        let statements: Vec<&str> = statements.iter().map(String::as_str).collect();
        let scene = summary(&statements);
        assert_eq!((scene.nodes.len(), scene.objects.len()), (50_000, 100_000));
        let mut list = SceneList::default();
        list.renew(&scene, None);
        let start = Instant::now();
        for k in 0..20 {
            list.fold(k, true);
            assert_eq!(list.rows(&scene).len(), 50_000 + 2 * (k + 1));
        }
        list.set_search("node 4999".into());
        assert_eq!(list.rows(&scene).len(), 11);
        // a hundredth of that where the machine has nothing else to do
        assert!(start.elapsed().as_secs_f64() < 20.0, "{:?}", start.elapsed());
    }
}
