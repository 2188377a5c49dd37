//! Kinds of files that the viewer opens.

/// The kind of a file that is opened or dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A scene, or what only a loader can tell.
    Scene,
    /// An image, or a folder with the faces of a cube: light from all around.
    Environment,
    /// Settings as the viewer saves them.
    Settings,
}

impl FileKind {
    /// The kind of a file by its name.
    pub fn from_path(path: &str) -> Self {
        let extension = std::path::Path::new(path).extension().unwrap_or_default().to_ascii_lowercase();
        match extension.to_str() {
            _ if path.starts_with("builtin:") => Self::Scene,
            Some("hdr" | "rgbe" | "pic" | "exr" | "png" | "jpg" | "jpeg" | "webp" | "tga" | "bmp") => Self::Environment,
            Some("json" | "toml") => Self::Settings,
            Some("") if std::path::Path::new(path).is_dir() => Self::Environment,
            _ => Self::Scene,
        }
    }
}
