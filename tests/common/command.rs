//! The program from outside: how it is started, what it prints, how it fails, and whether there is a device for it.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// The program with these arguments, ready to run: the one that was built with the tests, or SKYLIT_PROGRAM where they run elsewhere. It reads no defaults of whoever runs the tests.
pub fn skylit(args: &[&str]) -> Command {
    let program = std::env::var_os("SKYLIT_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_skylit").into());
    let mut command = Command::new(program);
    command.args(args).env("XDG_CONFIG_HOME", "/nonexistent").env_remove("RUST_BACKTRACE").stdin(Stdio::null());
    command
}

pub fn run(args: &[&str]) -> Output {
    skylit(args).output().unwrap()
}

/// The record that a run which succeeded printed.
pub fn json(out: &Output) -> Value {
    assert!(out.status.success(), "{}", stderr(out));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// Is there a device? There must be where tracers are expected.
pub fn device() -> bool {
    let there = run(&["doctor"]).status.success();
    assert!(there || std::env::var_os("SKYLIT_EXPECT_TRACERS").is_none(), "no usable Vulkan device");
    if !there {
        println!("skipped: no usable Vulkan device");
    }
    there
}

pub fn stderr(out: &Output) -> String {
    String::from_utf8_lossy(&out.stderr).into_owned()
}

/// It failed with this code, and its last line is its only error and says all of these.
pub fn fails(out: &Output, code: i32, says: &[&str]) {
    let text = stderr(out);
    assert_eq!(out.status.code(), Some(code), "{text}");
    let errors: Vec<_> = text.lines().filter(|l| l.starts_with("skylit: error: ")).collect();
    assert!(errors.len() == 1 && text.lines().last() == errors.first().copied(), "{text}");
    assert!(says.iter().all(|s| errors[0].contains(s)), "{text}");
}

/// A command that must fail with this code and one line that contains `says`; it prints nothing besides, but for the record of `--json`.
pub fn refuses(args: &[&str], code: i32, says: &str) {
    assert_refusal(&run(args), code, says, args);
}

pub fn assert_refusal(out: &Output, code: i32, says: &str, args: &[&str]) {
    fails(out, code, &[says]);
    assert!(out.stdout.is_empty() || args.contains(&"--json"), "{args:?}");
}

/// A file in a temporary folder.
pub fn place(dir: &tempfile::TempDir, name: &str) -> String {
    dir.path().join(name).to_str().unwrap().to_owned()
}

/// How many files a folder has.
pub fn count(folder: &Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}
