//! Which objects are left out, as settings say it: `--hide` and `--only` by names and ranges of
//! numbers, in as few texts as the nodes of the scene allow.

use std::ops::Range;
use std::sync::Arc;

use crate::scene::nodes::{find_instances, merged};
use crate::scene::{NodeTree, SceneSettings};
use crate::viewer::request::ObjectSummary;

/// Objects and nodes of a scene, by which settings name them.
#[derive(Clone, Copy)]
pub struct NamedObjects<'a> {
    /// The objects, by index.
    pub objects: &'a [ObjectSummary],
    /// The nodes that they are below.
    pub nodes: &'a NodeTree,
}

/// The objects that settings leave out.
pub struct HiddenObjects {
    /// Objects that are left out, and those that alone are not.
    by: [Vec<String>; 2],
    /// The result ([`NamedObjects::hidden_before`]).
    pub before: Arc<Vec<u32>>,
}

impl HiddenObjects {
    /// The result for these settings.
    pub fn new(settings: &SceneSettings, before: Arc<Vec<u32>>) -> Self {
        Self { by: [settings.hide.clone(), settings.only.clone()], before }
    }

    /// Returns true if it is that of these settings.
    pub fn is_by(&self, settings: &SceneSettings) -> bool {
        let [hide, only] = &self.by;
        (hide, only) == (&settings.hide, &settings.only)
    }
}

/// A selected range of objects is left out, or not any more: `settings` are changed so that they
/// say so. What else they leave out stays left out.
pub fn set_hidden(settings: &mut SceneSettings, scene: NamedObjects, range: &Range<usize>, hides: bool) {
    if hides && settings.only.is_empty() {
        scene.add(&mut settings.hide, range);
    } else if hides {
        // the last that is shown alone is hidden besides
        let mut rest = settings.only.clone();
        scene.take_out(&mut rest, range);
        if rest.is_empty() {
            scene.add(&mut settings.hide, range);
        } else {
            settings.only = rest;
        }
    } else {
        scene.take_out(&mut settings.hide, range);
        if !settings.only.is_empty() {
            scene.add(&mut settings.only, range);
        }
    }
}

impl NamedObjects<'_> {
    /// The objects that each text names, as ascending ranges.
    pub fn find(&self, texts: &[String]) -> Vec<Vec<Range<usize>>> {
        find_instances(self.objects.iter().map(|o| o.name.as_str()), self.nodes, texts)
    }

    /// Number of objects before each that settings leave out, and of all, last: object `k` is left
    /// out where that grows from `k` to `k + 1`.
    pub fn hidden_before(&self, settings: &SceneSettings) -> Vec<u32> {
        let mut is_hidden = vec![!settings.only.is_empty(); self.objects.len()];
        for (texts, hides) in [(&settings.only, false), (&settings.hide, true)] {
            for range in self.find(texts).into_iter().flatten() {
                let end = range.end.min(is_hidden.len());
                is_hidden[range.start.min(end)..end].fill(hides);
            }
        }
        let mut before = vec![0];
        before.extend(is_hidden.into_iter().scan(0, |count, is_hidden| {
            *count += u32::from(is_hidden);
            Some(*count)
        }));
        before
    }

    /// How settings name a range of objects: by the name of the object or of a node that has these
    /// objects and no others, or else by their numbers.
    pub fn text(&self, range: &Range<usize>) -> String {
        let object = self.objects.get(range.start).filter(|_| range.len() == 1).map(|o| o.name.as_str());
        let nodes = self.nodes.iter().filter(|node| node.instances() == *range).map(|node| &*node.name);
        let names: Vec<String> = object.into_iter().chain(nodes).filter(|n| is_plain(n)).map(str::to_owned).collect();
        let found = self.find(&names);
        let is_good = |found: &Vec<Range<usize>>| found[..] == [range.clone()];
        if let Some(k) = found.iter().position(is_good) {
            names[k].clone()
        } else if range.len() == 1 {
            range.start.to_string()
        } else {
            format!("{}..{}", range.start, range.end)
        }
    }

    /// Adds a range to texts, in place of those that name a part of it.
    fn add(&self, texts: &mut Vec<String>, range: &Range<usize>) {
        let found = self.find(texts);
        let all = merged(found.iter().flatten().cloned().collect());
        if all.iter().any(|r| contains(r, range)) {
            return;
        }
        let mut found = found.into_iter();
        texts.retain(|_| !found.next().is_some_and(|ranges| ranges.iter().all(|r| contains(range, r))));
        texts.push(self.text(range));
    }

    /// Takes a range out of what texts name.
    fn take_out(&self, texts: &mut Vec<String>, range: &Range<usize>) {
        let found = self.find(texts);
        let old = std::mem::take(texts);
        for (text, ranges) in old.into_iter().zip(found) {
            let parts = |r: &Range<usize>| [r.start..r.end.min(range.start), r.start.max(range.end)..r.end];
            let rest: Vec<Range<usize>> = ranges.iter().flat_map(parts).filter(|r| !r.is_empty()).collect();
            let rest = if rest == ranges { vec![text] } else { rest.iter().map(|r| self.text(r)).collect() };
            for text in rest {
                if !texts.contains(&text) {
                    texts.push(text);
                }
            }
        }
    }
}

/// Whether a name can be written as a value of an option and of a file of settings.
pub fn is_plain(name: &str) -> bool {
    let is_word = !name.is_empty() && !name.contains('=') && !name.starts_with('-') && name.parse::<usize>().is_err();
    is_word && name.split(' ').all(|word| !word.is_empty() && !word.contains(char::is_whitespace))
}

fn contains(outer: &Range<usize>, inner: &Range<usize>) -> bool {
    outer.start <= inner.start && inner.end <= outer.end
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load;

    /// A scene of the nodes `car` (`wheel`, `wheel`, `door`) and `house` (`door`, `roof`).
    fn street() -> (Vec<ObjectSummary>, NodeTree) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("street.obj");
        let face = |name: &str| format!("{name}\nf 1 2 3\nusemtl {}\n", name.len());
        let runs = ["o car\ng wheel", "g tyre\nf 1 2 3\ng wheel", "g door", "o house\ng door", "g roof"].map(face);
        std::fs::write(&path, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", runs.concat())).unwrap();
        let scene = load::load(&path.to_string_lossy()).unwrap();
        let object = |i: &crate::scene::Instance| ObjectSummary { name: i.name.clone(), ..Default::default() };
        (scene.instances.iter().map(object).collect(), scene.nodes)
    }

    #[test]
    fn settings_name_what_is_left_out() {
        let (objects, nodes) = street();
        let scene = NamedObjects { objects: &objects, nodes: &nodes };
        let found = format!("{:?}", scene.find(&["car".into(), "wheel".into()]));
        assert_eq!(found, "[[0..4], [0..1, 2..3]]");
        let mut settings = SceneSettings::default();
        let mut change = |range: Range<usize>, hides: bool| {
            set_hidden(&mut settings, scene, &range, hides);
            let before = scene.hidden_before(&settings);
            assert!(range.clone().all(|k| (before[k + 1] > before[k]) == hides), "{range:?}: {settings:?}");
            (settings.hide.clone(), settings.only.clone())
        };
        let none = Vec::<String>::new;

        // names that are of several things are not used; a node takes the place of its parts
        assert_eq!(change(2..3, true).0, ["2"]);
        assert_eq!(change(4..5, true).0, ["2", "4"]);
        assert_eq!(change(0..4, true).0, ["4", "car"]);
        assert_eq!(change(1..2, true).0, ["4", "car"], "it is already");
        assert_eq!(change(1..2, false).0, ["4", "0", "2..4"]);
        assert_eq!(change(0..6, false), (none(), none()));

        // alone, and again besides
        settings.only = vec!["house".into()];
        assert_eq!(scene.hidden_before(&settings), [0, 1, 2, 3, 4, 4, 4]);
        set_hidden(&mut settings, scene, &(1..2), false);
        assert_eq!(settings.only, ["house", "tyre"]);
        set_hidden(&mut settings, scene, &(4..5), true);
        assert_eq!(settings.only, ["roof", "tyre"]);
        set_hidden(&mut settings, scene, &(0..6), true);
        assert_eq!(
            (&settings.only[..], &settings.hide[..]),
            (&["roof".into(), "tyre".into()][..], &["0..6".into()][..])
        );
    }
}
