//! State that the viewer knows the next time: its window, how it looks, environments that were
//! used, and the hints that are no longer needed. It is a file of the cache folder.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::recent;
use crate::files;

/// Number of environments that are remembered.
const MOST: usize = 8;

/// Something that is explained over the image until it has been done once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hint {
    Orbit,
    Zoom,
    Technique,
}

impl Hint {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 3] = [Self::Orbit, Self::Zoom, Self::Technique];

    /// Input, and its effect.
    pub fn text(self) -> [&'static str; 2] {
        match self {
            Self::Orbit => ["Drag", "orbit"],
            Self::Zoom => ["Wheel", "come closer to what is under the pointer"],
            Self::Technique => ["1 to 5", "ambient occlusion or, with 4, path tracing"],
        }
    }
}

/// State that is kept from one time to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Remembered {
    /// Width and height of the window where it is not maximized, points.
    pub window: Option<[u32; 2]>,
    pub is_maximized: bool,
    /// Size of the text: 1 is the display's.
    pub zoom: Option<f32>,
    /// The theme; `None`: as the system.
    pub is_dark: Option<bool>,
    pub hides_panel: bool,
    /// Files of environments, the last one first.
    pub environments: Vec<String>,
    /// Hints that are not shown any more, a bit each.
    hints_done: u8,
}

fn path() -> Option<PathBuf> {
    files::cache_folder().map(|folder| folder.join("viewer.json"))
}

impl Remembered {
    /// Reads it; the default if the file cannot be read.
    pub fn load() -> Self {
        let bytes = path().and_then(|path| std::fs::read(path).ok());
        let read: Self = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        let is_size = |[width, height]: &[u32; 2]| (200..=16_384).contains(width) && (200..=16_384).contains(height);
        Self { window: read.window.filter(is_size), zoom: read.zoom.filter(|z| (0.5..=4.0).contains(z)), ..read }
    }

    /// Saves it. A failure only forgets.
    pub fn save(&self) {
        path().into_iter().for_each(|path| recent::remember(&path, self));
    }

    /// Returns true if a hint is still to be shown.
    pub fn needs(&self, hint: Hint) -> bool {
        self.hints_done & 1 << hint as u8 == 0
    }

    /// Notes that a hint is not needed any more.
    pub fn learn(&mut self, hint: Hint) {
        self.hints_done |= 1 << hint as u8;
    }

    /// Puts an environment first.
    pub fn use_environment(&mut self, file: &str) {
        let file = std::fs::canonicalize(file).map_or_else(|_| file.to_owned(), |p| p.to_string_lossy().into_owned());
        self.environments.retain(|e| *e != file);
        self.environments.insert(0, file);
        self.environments.truncate(MOST);
    }
}
