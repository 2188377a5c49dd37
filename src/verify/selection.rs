//! Which frames of a manifest are looked at.

use std::collections::BTreeMap;

use super::manifest::{Frame, Manifest};
use crate::error::{Error, Result};

/// Which frames of a manifest are looked at.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Parts of names; empty: all frames.
    pub filters: Vec<String>,
    /// A part of these frames.
    pub shard: Option<Shard>,
}

/// One of several parts of the frames, for machines that share the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 1.
    pub index: usize,
    pub count: usize,
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |s: &str| s.trim().parse::<usize>().ok();
        let parts = text.split_once('/').and_then(|(i, n)| Some(Self { index: number(i)?, count: number(n)? }));
        parts
            .filter(|s| s.index >= 1 && s.index <= s.count)
            .ok_or_else(|| "expected I/N with I from 1 to N, like 1/3".to_owned())
    }
}

impl Selection {
    /// The frames, in an order in which those of a scene follow one another.
    ///
    /// # Errors
    /// [`Error::Usage`] if filters leave none: a check of nothing would always hold.
    pub fn frames<'m>(&self, manifest: &'m Manifest) -> Result<Vec<&'m Frame>> {
        let is_named =
            |f: &&Frame| self.filters.is_empty() || self.filters.iter().any(|part| f.name.contains(part.as_str()));
        let mut frames: Vec<&Frame> = manifest.frames.iter().filter(is_named).collect();
        if frames.is_empty() {
            return Err(Error::Usage(format!(
                "--filter {}: no frame has such a name",
                self.filters.join(" --filter ")
            )));
        }
        let mut first: BTreeMap<&str, usize> = BTreeMap::new();
        for (k, frame) in manifest.frames.iter().enumerate() {
            first.entry(&frame.scene).or_insert(k);
        }
        frames.sort_by_key(|f| (first.get(f.scene.as_str()), f.line));
        if let Some(shard) = self.shard {
            // neighbours cost alike: deal them out in turn
            frames = frames.into_iter().skip(shard.index - 1).step_by(shard.count).collect();
        }
        Ok(frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards() {
        assert_eq!("2/3".parse(), Ok(Shard { index: 2, count: 3 }));
        for bad in ["", "0/3", "4/3", "1", "a/b", "1/0", "-1/2"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
