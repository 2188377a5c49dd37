//! Numbers for what is at positions.

use std::collections::HashMap;

use super::parse::NONE;

/// Longest chain. Few keys share a position as a rule; a file in which many do must not cost their
/// square.
const MAX_CHAIN: usize = 8;

/// Numbers the distinct keys at each position in the order in which they come, from 0. Those of a
/// position form a chain, or are in a map where a chain would be long. The chains' heads are kept
/// when it is cleared: a file of many small meshes must not reset them all.
pub(super) struct PositionKeys {
    /// For each position the round that used it last, and its newest key then.
    heads: Vec<(u32, u32)>,
    round: u32,
    /// Keys with the one before at the same position.
    chain: Vec<([u32; 2], u32)>,
    crowded: HashMap<(u32, [u32; 2]), u32>,
}

impl PositionKeys {
    /// No key at any of so many positions.
    pub(super) fn new(positions: usize) -> Self {
        Self { heads: vec![(0, NONE); positions], round: 0, chain: Vec::new(), crowded: HashMap::new() }
    }

    /// Forgets all keys.
    pub(super) fn clear(&mut self) {
        self.round += 1;
        self.chain.clear();
        self.crowded.clear();
    }

    /// The number of a key at a position.
    pub(super) fn index(&mut self, position: u32, key: [u32; 2]) -> u32 {
        let head = &mut self.heads[position as usize];
        if head.0 != self.round {
            *head = (self.round, NONE);
        }
        let (mut at, mut length) = (head.1, 0);
        while at != NONE {
            let (other, before) = self.chain[at as usize];
            if other == key {
                return at;
            }
            (at, length) = (before, length + 1);
        }
        let new = self.chain.len() as u32;
        if length < MAX_CHAIN {
            self.chain.push((key, head.1));
            head.1 = new;
            return new;
        }
        let index = *self.crowded.entry((position, key)).or_insert(new);
        if index == new {
            // it is in no chain, and counts all the same
            self.chain.push((key, NONE));
        }
        index
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_numbered_in_their_order() {
        let mut keys = PositionKeys::new(2);
        for _ in 0..2 {
            keys.clear();
            for twice in 0..2 {
                for i in 0..1000 {
                    assert_eq!(keys.index(0, [i, 0]), 2 * i, "{twice}");
                    assert_eq!(keys.index(1, [0, i]), 2 * i + 1, "{twice}");
                }
            }
        }
    }
}
