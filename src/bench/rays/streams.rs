//! Streams: sets of rays, and what is asked of them.

use crate::integrators::ray_sets::RaySet;
use crate::integrators::rays::Mode;

/// A stream: a set of rays and what is asked of them.
pub struct StreamKind {
    /// On the command line and in tables.
    pub name: &'static str,
    pub set: RaySet,
    pub mode: Mode,
}

pub const STREAMS: [StreamKind; 5] = [
    StreamKind { name: "primary", set: RaySet::Primary, mode: Mode::Closest },
    StreamKind { name: "ao-any", set: RaySet::Occlusion, mode: Mode::Any },
    StreamKind { name: "ao-closest", set: RaySet::Occlusion, mode: Mode::Closest },
    StreamKind { name: "shuffled-any", set: RaySet::Shuffled, mode: Mode::Any },
    StreamKind { name: "shadow-any", set: RaySet::Shadow, mode: Mode::Any },
];
