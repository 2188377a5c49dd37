//! The nodes of a scene's file: names, and which instances, cameras and lights are below each.
//!
//! What is below a node follows one another in the lists of the scene, so a node has ranges of
//! their indices, and an instance needs no entry. A node that is nothing but its own instance, and
//! one that has nothing below it, is left out: a file without groups has no nodes here.

use std::collections::HashMap;
use std::ops::Range;

/// A node that has something below it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneNode {
    /// Name; may be empty.
    pub name: Box<str>,
    /// Index of the node above it.
    pub(super) parent: Option<u32>,
    /// Index of the next node that is not below it.
    pub(super) end: u32,
    /// The first of its instances, cameras and lights.
    pub(super) start: [u32; 3],
    /// The index after the last of each.
    pub(super) stop: [u32; 3],
}

impl SceneNode {
    /// Index of the node above it; `None` at the top.
    pub fn parent(&self) -> Option<usize> {
        self.parent.map(|parent| parent as usize)
    }

    /// Index of the next node that is not below it: those in between are.
    pub fn end(&self) -> usize {
        self.end as usize
    }

    /// Indices of instances, cameras and lights of this node and of all below it.
    pub fn items(&self) -> [Range<usize>; 3] {
        std::array::from_fn(|kind| self.start[kind] as usize..self.stop[kind] as usize)
    }

    /// Indices of instances of this node and of all below it.
    pub fn instances(&self) -> Range<usize> {
        let [instances, ..] = self.items();
        instances
    }

    /// Number of instances, cameras and lights.
    pub(super) fn count(&self) -> u32 {
        (0..3).map(|kind| self.stop[kind] - self.start[kind]).sum()
    }
}

/// The nodes of a scene, each before those that are below it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeTree {
    pub(super) nodes: Vec<SceneNode>,
}

impl std::ops::Deref for NodeTree {
    type Target = [SceneNode];

    fn deref(&self) -> &[SceneNode] {
        &self.nodes
    }
}

impl NodeTree {
    /// Indices of the topmost nodes that tell parts of a scene of so many instances apart: where
    /// one node has everything, those below it.
    pub fn top(&self, instances: usize) -> Vec<usize> {
        let (mut first, mut end, mut above) = (0, self.len(), None);
        loop {
            let next = |k: &usize| Some(self[*k].end()).filter(|next| *next < end);
            let level = std::iter::successors((first < end).then_some(first), next);
            let level: Vec<usize> = level.filter(|k| !self[*k].instances().is_empty()).collect();
            match level[..] {
                [only] if self[only].instances() == (0..instances) => {
                    (first, end, above) = (only + 1, self[only].end(), Some(only));
                }
                [] => return above.into_iter().collect(),
                _ => return level,
            }
        }
    }

    /// Indices of the nodes that an instance is below, from the top down.
    pub fn above(&self, instance: usize) -> Vec<usize> {
        let (mut found, mut k, mut end) = (Vec::new(), 0, self.len());
        while k < end {
            if self[k].instances().contains(&instance) {
                found.push(k);
                (k, end) = (k + 1, self[k].end());
            } else {
                k = self[k].end();
            }
        }
        found
    }

    /// Numbers the instances that are kept anew, and drops nodes that have nothing any more.
    pub(super) fn keep_instances(&mut self, keep: &[bool]) {
        if self.is_empty() {
            return;
        }
        let mut before = vec![0u32];
        before.extend(keep.iter().scan(0, |count, keep| {
            *count += u32::from(*keep);
            Some(*count)
        }));
        for node in &mut self.nodes {
            node.start[0] = before[node.start[0] as usize];
            node.stop[0] = before[node.stop[0] as usize];
        }
        let is_kept: Vec<bool> = self.iter().map(|node| node.count() > 0).collect();
        self.retain(&is_kept);
    }

    /// Drops nodes; what is below them comes to those above.
    pub(super) fn retain(&mut self, keep: &[bool]) {
        let mut number = vec![0u32];
        number.extend(keep.iter().scan(0, |count, keep| {
            *count += u32::from(*keep);
            Some(*count)
        }));

        // parents come first: those of nodes that are dropped are known by then
        let mut parents: Vec<Option<u32>> = Vec::with_capacity(keep.len());
        for (k, node) in self.nodes.iter().enumerate() {
            let parent =
                node.parent.and_then(|p| if keep[p as usize] { Some(number[p as usize]) } else { parents[p as usize] });
            debug_assert!(node.parent.is_none_or(|p| (p as usize) < k));
            parents.push(parent);
        }
        for (node, parent) in self.nodes.iter_mut().zip(parents) {
            (node.parent, node.end) = (parent, number[node.end as usize]);
        }
        let mut each = keep.iter();
        self.nodes.retain(|_| each.next().copied().unwrap_or(true));
        self.nodes.shrink_to_fit();
    }
}

/// The instances that each text names, as indices in ascending order: those of this name and those
/// below nodes of this name or, where nothing is called that, the one of this number or those of
/// numbers `A..B`, from A up to B without B.
pub fn find_instances<'a>(
    names: impl ExactSizeIterator<Item = &'a str>,
    nodes: &NodeTree,
    texts: &[String],
) -> Vec<Vec<Range<usize>>> {
    let mut found = vec![Vec::new(); texts.len()];
    if texts.is_empty() {
        return found;
    }

    // by name
    let count = names.len();
    let mut numbers: HashMap<&str, Vec<usize>> = HashMap::new();
    texts.iter().enumerate().for_each(|(k, text)| numbers.entry(text).or_default().push(k));
    let instances = names.enumerate().map(|(k, name)| (name, k..k + 1));
    let below = nodes.iter().map(|node| (&*node.name, node.instances()));
    for (name, range) in instances.chain(below).filter(|(name, range)| !name.is_empty() && !range.is_empty()) {
        numbers.get(name).into_iter().flatten().for_each(|k| found[*k].push(range.clone()));
    }

    // by number
    for (found, text) in found.iter_mut().zip(texts).filter(|(found, _)| found.is_empty()) {
        let range = match text.split_once("..") {
            Some((first, end)) => first.parse().ok().zip(end.parse().ok()).map(|(first, end)| first..end),
            None => text.parse().ok().map(|k: usize| k..k.saturating_add(1)),
        };
        found.extend(range.filter(|range| range.start < range.end && range.end <= count));
    }
    found.into_iter().map(merged).collect()
}

/// Ranges in ascending order, of which none touches another.
pub fn merged(mut ranges: Vec<Range<usize>>) -> Vec<Range<usize>> {
    ranges.sort_unstable_by_key(|range| range.start);
    let mut out: Vec<Range<usize>> = Vec::with_capacity(ranges.len());
    for range in ranges {
        match out.last_mut() {
            Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
            _ => out.push(range),
        }
    }
    out
}
