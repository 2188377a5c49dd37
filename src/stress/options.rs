//! Options of a run.

use std::path::PathBuf;

use serde::Serialize;

use crate::scene::load::GeometryOptions;

/// The amount of rays that are traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    /// Less than a minute on a CPU driver.
    #[default]
    Quick,
    /// Hours: a hundred times the rays, and cases that are left out otherwise.
    Full,
}

impl Effort {
    /// `quick` or `full`.
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Effort::Quick => quick,
            Effort::Full => full,
        }
    }
}

#[derive(Clone, Debug, Default)]
pub struct Options {
    /// A file or `builtin:NAME` that is examined; `None`: the built-in scenes of the suite.
    pub scene: Option<String>,
    pub effort: Effort,
    /// Names of the sections that run; empty: all.
    pub sections: Vec<String>,
    /// Only checks whose name contains one of these texts are made; empty: all.
    pub checks: Vec<String>,
    /// The program, which determinism starts again; `None`: what needs it is not applicable.
    pub program: Option<PathBuf>,
    /// The scene may refer to files below its own folder alone.
    pub confine: bool,
    /// Normals and texture coordinates of the scene.
    pub geometry: GeometryOptions,
}
