//! Manifests of drivers and layers, which the Vulkan loader reads: JSON files that name a library.
//! Of one that is broken the loader says that memory has run out.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::error::Error;
use crate::files;

/// Kind of library that a manifest names.
#[derive(Clone, Copy, PartialEq)]
enum ManifestKind {
    Driver,
    Layer,
}

impl ManifestKind {
    fn name(self) -> &'static str {
        match self {
            Self::Driver => "driver",
            Self::Layer => "layer",
        }
    }

    /// Keys of a manifest, of which it has one at least.
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Driver => &["ICD"],
            Self::Layer => &["layer", "layers"],
        }
    }
}

/// Variables that name manifests, or folders of them, in place of the system's or besides.
const VARIABLES: [(&str, ManifestKind); 7] = [
    ("VK_DRIVER_FILES", ManifestKind::Driver),
    ("VK_ICD_FILENAMES", ManifestKind::Driver),
    ("VK_ADD_DRIVER_FILES", ManifestKind::Driver),
    ("VK_LAYER_PATH", ManifestKind::Layer),
    ("VK_ADD_LAYER_PATH", ManifestKind::Layer),
    ("VK_IMPLICIT_LAYER_PATH", ManifestKind::Layer),
    ("VK_ADD_IMPLICIT_LAYER_PATH", ManifestKind::Layer),
];
/// Folders of manifests below each folder of data or configuration.
const FOLDERS: [(&str, ManifestKind); 3] = [
    ("vulkan/icd.d", ManifestKind::Driver),
    ("vulkan/implicit_layer.d", ManifestKind::Layer),
    ("vulkan/explicit_layer.d", ManifestKind::Layer),
];

/// The error for the first manifest of a driver that has a list in the place of an object, which
/// the loader does not survive. To be looked for before the loader is called.
pub(super) fn deadly() -> Option<Error> {
    let is_list = |value: &Value| value.as_array().is_some_and(|all| !all.is_empty());
    first_with(&variable, &|file, kind| {
        let value: Value = serde_json::from_slice(&files::read_regular(file).ok()?).ok()?;
        let is_deadly = kind == ManifestKind::Driver && (is_list(&value) || value.get("ICD").is_some_and(is_list));
        if is_deadly { fault(file, kind) } else { None }
    })
}

/// The error for drivers that variables name and of which none can be used; `None` if no variable
/// names any.
pub(super) fn unusable() -> Option<Error> {
    VARIABLES.iter().filter(|(_, kind)| *kind == ManifestKind::Driver).find_map(|(name, _)| {
        let value = variable(name)?;
        let files = value.to_string_lossy();
        Some(Error::Device(format!(
            "none of the Vulkan drivers that {name} names can be used ({files}): correct or unset the variable"
        )))
    })
}

fn variable(name: &str) -> Option<OsString> {
    std::env::var_os(name).filter(|value| !value.is_empty())
}

/// The error for the first manifest that is broken: where variables name it, then in the folders of
/// the user and the system. `None` if all are as they should be.
pub(super) fn broken() -> Option<Error> {
    first_with(&variable, &fault)
}

/// The error for the first manifest of which `fault` finds something. `variable` gives the
/// variables that are set.
fn first_with(
    variable: &dyn Fn(&str) -> Option<OsString>,
    fault: &dyn Fn(&Path, ManifestKind) -> Option<String>,
) -> Option<Error> {
    let named = VARIABLES.iter().flat_map(|&(name, kind)| {
        let paths = variable(name).map_or_else(Vec::new, |value| std::env::split_paths(&value).collect());
        paths.into_iter().filter(|path| !path.as_os_str().is_empty()).map(move |path| (Some(name), kind, path))
    });
    let installed =
        bases(variable).into_iter().flat_map(|base| FOLDERS.map(|(folder, kind)| (None, kind, base.join(folder))));
    named.chain(installed).find_map(|(name, kind, path)| {
        let is_asked_for = name.is_some();
        let (file, why) =
            manifests(&path, is_asked_for).into_iter().find_map(|file| Some((file.clone(), fault(&file, kind)?)))?;
        let (file, kind) = (file.display(), kind.name());
        Some(Error::Device(match name {
            Some(name) => {
                format!(
                    "{name} names {file}, which is no manifest of a Vulkan {kind}: {why}; correct or unset the variable"
                )
            }
            None => {
                format!("{file} is no manifest of a Vulkan {kind}: {why}; remove the file or install its {kind} again")
            }
        }))
    })
}

/// Folders of the user and of the system with a folder `vulkan`, as the loader finds them.
fn bases(variable: &dyn Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let home = variable("HOME").map(PathBuf::from);
    let of_user =
        |name: &str, below: &str| variable(name).map(PathBuf::from).or_else(|| Some(home.as_ref()?.join(below)));
    let of_system = |name: &str, otherwise: &str| -> Vec<PathBuf> {
        std::env::split_paths(&variable(name).unwrap_or_else(|| otherwise.into())).collect()
    };
    let user = [of_user("XDG_CONFIG_HOME", ".config"), of_user("XDG_DATA_HOME", ".local/share")].into_iter().flatten();
    let system = [
        of_system("XDG_CONFIG_DIRS", "/etc/xdg"),
        vec!["/etc".into()],
        of_system("XDG_DATA_DIRS", "/usr/local/share:/usr/share"),
    ];
    user.chain(system.into_iter().flatten()).collect()
}

/// The manifests that a path names: itself, or those in the folder. A path that is not there names
/// itself if it `is_asked_for`.
fn manifests(path: &Path, is_asked_for: bool) -> Vec<PathBuf> {
    match std::fs::read_dir(path) {
        Ok(entries) => {
            let mut files: Vec<_> =
                entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == "json")).collect();
            files.sort();
            files
        }
        Err(_) if is_asked_for => vec![path.to_owned()],
        Err(_) => Vec::new(),
    }
}

/// Says what is wrong with a manifest; `None` for one that names a library which may be there.
fn fault(file: &Path, kind: ManifestKind) -> Option<String> {
    let text = match files::read_regular(file) {
        Ok(text) => text,
        Err(e) => {
            return Some(match Error::read(file, &e) {
                Error::Input { message, .. } => message,
                other => other.to_string(),
            });
        }
    };
    let value: Value = match serde_json::from_slice(&text) {
        Ok(value) => value,
        Err(e) => return Some(format!("it is not JSON ({e})")),
    };
    let Some(content) = kind.keys().iter().find_map(|key| value.get(key)) else {
        return Some(format!("it has no `{}`", kind.keys()[0]));
    };
    if kind == ManifestKind::Layer {
        return None;
    }
    if content.get("library_path").is_some() && content.get("api_version").is_none() {
        return Some("its `ICD` has no `api_version`".to_owned());
    }
    match content.get("library_path").and_then(Value::as_str).filter(|library| !library.is_empty()) {
        None => Some("its `ICD` has no `library_path`".to_owned()),
        // a name without a folder is searched where the system keeps libraries
        Some(library) if library.contains('/') => {
            let library = file.parent().unwrap_or(Path::new("")).join(library);
            (!library.exists()).then(|| format!("its library {} does not exist", library.display()))
        }
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_manifests_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let good =
            r#"{"file_format_version": "1.0.0", "ICD": {"library_path": "libvulkan_lvp.so", "api_version": "1.3.0"}}"#;
        std::fs::write(at("good.json"), good).unwrap();
        let first_error = |name: &'static str, path: PathBuf| {
            let variable = move |asked: &str| match asked {
                "XDG_DATA_DIRS" | "XDG_CONFIG_DIRS" | "XDG_CONFIG_HOME" | "XDG_DATA_HOME" => {
                    Some("/nonexistent".into())
                }
                _ => (asked == name).then(|| path.clone().into_os_string()),
            };
            first_with(&variable, &fault).map(|e| (e.exit_code(), e.to_string()))
        };
        // the machine's own are as they should be
        assert_eq!(first_error("VK_DRIVER_FILES", at("good.json")), None);
        let broken = [
            ("{\"x", "it is not JSON ("),
            ("", "it is not JSON ("),
            ("[]", "it has no `ICD`"),
            ("{\"ICD\": 3}", "its `ICD` has no `library_path`"),
            ("{\"ICD\": [1]}", "its `ICD` has no `library_path`"),
            ("{\"ICD\": {\"library_path\": \"a.so\"}}", "its `ICD` has no `api_version`"),
            (
                "{\"ICD\": {\"library_path\": \"/no/such.so\", \"api_version\": \"1.3.0\"}}",
                "its library /no/such.so does not exist",
            ),
        ];
        for (text, why) in broken {
            std::fs::write(at("broken.json"), text).unwrap();
            let file = at("broken.json").display().to_string();
            for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_ADD_DRIVER_FILES"] {
                let both = std::env::join_paths([at("good.json"), at("broken.json")]).unwrap();
                for path in [at("broken.json"), dir.path().to_owned(), both.into()] {
                    let (code, error) = first_error(name, path).unwrap();
                    assert!(
                        code == 2 && error.starts_with(&format!("{name} names {file}, which is no manifest")),
                        "{error}"
                    );
                    assert!(error.contains(why) && error.lines().count() == 1, "{error}");
                }
            }
        }
        assert!(first_error("VK_DRIVER_FILES", at("missing.json")).unwrap().1.contains("no such file"));
        assert!(
            first_error("VK_LAYER_PATH", dir.path().to_owned()).unwrap().1.contains("no manifest of a Vulkan layer")
        );
        // one that was installed
        std::fs::create_dir_all(at("data/vulkan/icd.d")).unwrap();
        std::fs::rename(at("broken.json"), at("data/vulkan/icd.d/broken.json")).unwrap();
        let variable = |name: &str| (name == "XDG_DATA_HOME").then(|| at("data").into_os_string());
        let error = first_with(&variable, &fault).unwrap().to_string();
        assert!(error.contains("data/vulkan/icd.d/broken.json is no manifest of a Vulkan driver"), "{error}");
    }
}
