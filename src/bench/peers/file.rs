//! The peers file, which describes other renderers, and building them
//! (docs/reference/benchmarks.md).

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::{Component, Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;

use crate::error::{Error, Result};

pub const DEFAULT: &str = "benches/peers.toml";

/// The project's own peers file, and the files that its commands run or compile: a peers file runs
/// commands, so by default only this one is taken.
const OWN: [(&str, &str); 3] = [
    ("peers.toml", include_str!("../../../benches/peers.toml")),
    ("peers/embree.cpp", include_str!("../../../benches/peers/embree.cpp")),
    ("peers/mitsuba_paths.py", include_str!("../../../benches/peers/mitsuba_paths.py")),
];

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PeersFile {
    #[serde(default)]
    peer: Vec<toml::Spanned<PeerSpec>>,
}

/// Which benchmark a peer is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Measures {
    /// `skylit bench rays`
    #[default]
    Rays,
    /// `skylit bench path`
    Paths,
}

/// A peer: a tracer or renderer of another project.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PeerSpec {
    pub name: String,
    /// Benchmark it takes part in.
    #[serde(default)]
    measures: Measures,
    /// Requirements to install, reported if it does not build or start.
    #[serde(default)]
    needs: String,
    /// Files below the folder of the peers file whose change means building again.
    #[serde(default)]
    sources: Vec<PathBuf>,
    /// Command that builds it; nothing to build when empty.
    #[serde(default)]
    build: Vec<String>,
    pub run: Vec<String>,
    pub kernels: Vec<String>,
    /// Kernels that ratios are relative to.
    #[serde(default)]
    pub baselines: Vec<String>,
    /// Kernels whose answers have to agree with ours under `--check`.
    #[serde(default)]
    pub strict: Vec<String>,
    /// Folder of the peers file.
    #[serde(skip)]
    folder: PathBuf,
}

/// The peers of a benchmark, from the requested file (`none`: no peers) or from [`DEFAULT`]; or the
/// reason why there are none.
pub fn choose(requested: Option<&str>, measures: Measures) -> Result<Result<Vec<PeerSpec>, String>> {
    let file = match requested {
        Some("none") => return Ok(Ok(Vec::new())),
        None if !Path::new(DEFAULT).is_file() => {
            return Ok(Err(format!("no peers: {DEFAULT} does not exist (use --peers FILE)")));
        }
        None if !is_own(Path::new(DEFAULT)) => {
            return Ok(Err(format!(
                "no peers: {DEFAULT} here is not the one that this program was built with, and its commands are not run (--peers {DEFAULT} runs them)"
            )));
        }
        file => file.unwrap_or(DEFAULT),
    };
    Ok(Ok(read(Path::new(file))?.into_iter().filter(|p| p.measures == measures).collect()))
}

/// Whether a peers file, and what its commands run, are those that this program was built with.
fn is_own(path: &Path) -> bool {
    let folder = path.parent().unwrap_or(Path::new("."));
    OWN.iter().all(|(name, text)| std::fs::read(folder.join(name)).is_ok_and(|own| own == text.as_bytes()))
}

/// Whether a name can be part of a file's name, and leads nowhere else.
fn is_plain_name(name: &str) -> bool {
    !name.starts_with('.') && !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "._+-".contains(c))
}

/// Reads a peers file.
///
/// # Errors
/// [`Error::Input`], naming the file and the line.
pub fn read(path: &Path) -> Result<Vec<PeerSpec>> {
    let text = crate::files::read_text(path)?;
    let at_line = |offset: usize, message: &str| {
        let line = 1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|&&b| b == b'\n').count();
        Error::input(path, format!("line {line}: {message}"))
    };
    let file: PeersFile = toml::from_str(&text).map_err(|e| at_line(e.span().map_or(0, |s| s.start), e.message()))?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned();
    let mut peers: Vec<PeerSpec> = Vec::new();
    for entry in file.peer {
        let start = entry.span().start;
        let peer = PeerSpec { folder: folder.clone(), ..entry.into_inner() };
        let word = |s: &String| !s.is_empty() && !s.contains(char::is_whitespace);
        let unknown = peer.baselines.iter().chain(&peer.strict).find(|b| !peer.kernels.contains(b));
        let is_below =
            |path: &PathBuf| path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        let problem = if !is_plain_name(&peer.name) {
            Some(format!(
                "`name = {:?}`: a peer's name is one word of letters, digits, `.`, `_`, `+` and `-`",
                peer.name
            ))
        } else if let Some(source) = peer.sources.iter().find(|s| !is_below(s)) {
            Some(format!("peer `{}`: the source {source:?} is not below the folder of this file", peer.name))
        } else if peers.iter().any(|p| p.name == peer.name) {
            Some(format!("there are two peers called `{}`", peer.name))
        } else if peer.run.is_empty() {
            Some(format!("peer `{}`: `run` names no command", peer.name))
        } else if peer.kernels.is_empty() || !peer.kernels.iter().all(word) {
            Some(format!("peer `{}`: `kernels` must list one or more words", peer.name))
        } else {
            unknown.map(|b| format!("peer `{}`: `{b}` is not among its kernels", peer.name))
        };
        if let Some(problem) = problem {
            return Err(at_line(start, &problem));
        }
        peers.push(peer);
    }
    Ok(peers)
}

impl PeerSpec {
    /// Name of one of its kernels in tables.
    pub fn title_of(&self, kernel: &str) -> String {
        format!("{} {kernel}", self.name)
    }

    /// Message that the peer is unavailable, and what it needs.
    pub fn missing(&self, why: &str) -> String {
        let needs = if self.needs.is_empty() { String::new() } else { format!("; it needs {}", self.needs) };
        format!("peer '{}' is missing: {why}{needs}", self.name)
    }

    /// The next command for it, as in the file: the one that builds it, where that is needed.
    pub fn command_line(&self) -> String {
        let words = if self.is_built() { &self.run } else { &self.build };
        words.join(" ").replace(char::is_control, " ")
    }

    /// Is there nothing to build, or did an earlier run build it?
    pub fn is_built(&self) -> bool {
        self.build.is_empty() || self.output().is_ok_and(|out| out.exists())
    }

    /// Builds it unless an earlier run did, and returns the command that runs it.
    ///
    /// # Errors
    /// A sentence that says why it cannot be built.
    pub fn prepare(&self) -> Result<Command, String> {
        let out = self.output()?;
        if !self.build.is_empty() && out.exists() && !crate::files::is_own(&out) {
            return Err(format!("{}: another user's file, which is not run: remove it", out.display()));
        }
        if !self.build.is_empty() && !out.exists() {
            self.build_to(&out)?;
        }
        let mut words = self.run.iter().map(|w| self.expand(w, &out));
        let mut command = Command::new(words.next().unwrap_or_default());
        command.args(words);
        Ok(command)
    }

    /// The file it is built to. Its name changes with all that goes into it.
    fn output(&self) -> Result<PathBuf, String> {
        let mut hash = DefaultHasher::new();
        (&self.build, &self.name).hash(&mut hash);
        for source in &self.sources {
            let path = self.folder.join(source);
            crate::files::read_regular(&path).map_err(|e| format!("{}: {e}", path.display()))?.hash(&mut hash);
        }
        // a folder that others can write to holds no programs of ours
        let cache =
            crate::files::cache_folder().ok_or("there is no folder to build it in: set HOME or XDG_CACHE_HOME")?;
        Ok(cache.join("peers").join(format!("{}-{:016x}", self.name, hash.finish())))
    }

    fn expand(&self, word: &str, out: &Path) -> String {
        word.replace("{dir}", &self.folder.display().to_string()).replace("{out}", &out.display().to_string())
    }

    /// Builds to a temporary file and renames it: interruptions leave no incomplete program.
    fn build_to(&self, out: &Path) -> Result<(), String> {
        let folder = out.parent().unwrap_or(Path::new("."));
        let cannot = |e: std::io::Error| format!("{}: {e}", folder.display());
        std::fs::create_dir_all(folder).map_err(cannot)?;
        let place = tempfile::tempdir_in(folder).map_err(cannot)?;
        let unfinished = place.path().join("built");
        let words: Vec<_> = self.build.iter().map(|w| self.expand(w, &unfinished)).collect();
        let done = Command::new(&words[0])
            .args(&words[1..])
            .stdin(Stdio::null())
            .output()
            .map_err(|e| format!("`{}` does not run ({e})", words[0]))?;
        if !done.status.success() {
            let said = String::from_utf8_lossy(&done.stderr);
            // the line that names the error, which linkers do not call so
            let names = |l: &&str| l.contains("error") || l.contains("cannot find");
            let line = said.lines().find(names).or_else(|| said.lines().next()).unwrap_or("no reason given");
            return Err(format!("building it failed ({})", line.trim()));
        }
        std::fs::rename(&unfinished, out).map_err(cannot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error_of(text: &str) -> String {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("peers.toml");
        std::fs::write(&path, text).unwrap();
        let e = read(&path).unwrap_err();
        assert_eq!(e.exit_code(), 3);
        e.to_string().replace(&path.display().to_string(), "FILE")
    }

    #[test]
    fn our_own_file_is_sound() {
        let peers = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(DEFAULT)).unwrap();
        assert!(peers.iter().any(|p| p.name == "embree" && !p.baselines.is_empty()));
        for source in peers.iter().flat_map(|p| p.sources.iter().map(|s| p.folder.join(s))) {
            assert!(source.is_file(), "{}", source.display());
        }
    }

    /// A file of another folder under the default name runs nothing.
    #[test]
    fn only_our_own_file_is_taken_by_default() {
        let ours = Path::new(env!("CARGO_MANIFEST_DIR")).join(DEFAULT);
        assert!(is_own(&ours));
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("peers")).unwrap();
        let copy = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        OWN.iter().for_each(|(name, text)| copy(name, text));
        let file = folder.path().join("peers.toml");
        assert!(is_own(&file));
        // a script of it, or the file itself, is another
        copy(OWN[2].0, "import os");
        assert!(!is_own(&file));
        copy(OWN[2].0, OWN[2].1);
        copy("peers.toml", "[[peer]]\nname = 'a'\nrun = ['touch', 'x']\nkernels = ['k']\n");
        assert!(!is_own(&file));
        // whatever it runs or compiles is among the files that are compared
        for peer in read(&ours).unwrap() {
            for word in peer.build.iter().chain(&peer.run).filter_map(|w| w.strip_prefix("{dir}/")) {
                assert!(OWN.iter().any(|(name, _)| *name == word), "{word}");
            }
        }
    }

    #[test]
    fn errors_name_the_line() {
        let peer = "[[peer]]\nname = 'a'\nrun = ['a']\nkernels = ['k']\n";
        assert!(error_of(&format!("{peer}build = 3\n")).starts_with("FILE: line 5: "));
        assert!(error_of("\n\n[[peer]\n").starts_with("FILE: line 3: "));
        assert!(error_of(&format!("{peer}\n{peer}")).starts_with("FILE: line 6: there are two peers called `a`"));
        assert!(error_of(&format!("{peer}baselines = ['x']\n")).contains("`x` is not among its kernels"));
        for name in ["../a", "a/b", ".a", "a\u{1b}[31m"] {
            assert!(
                error_of(
                    &format!("[[peer]]\nname = {name:?}\nrun = ['a']\nkernels = ['k']\n").replace("\\u{1b}", "\\u001b")
                )
                .contains("one word")
            );
        }
        assert!(error_of(&format!("{peer}sources = ['../../x']\n")).contains("not below"));
        assert!(error_of("[[peer]]\nname = 'a b'\nrun = ['a']\nkernels = ['k']\n").contains("one word"));
        assert!(error_of("[[peer]]\nname = 'a'\nrun = []\nkernels = ['k']\n").contains("no command"));
        assert!(error_of("[[peer]]\nname = 'a'\nrun = ['a']\n").contains("kernels"));
        assert!(error_of(&format!("{peer}colour = 'red'\n")).contains("colour"));
    }
}
