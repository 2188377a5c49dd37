//! Limits of the system and variables of the environment: each ends with one line and its exit code, or with the right image.

use std::io::Read;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::command::{count, device, fails, json, place, skylit, stderr};
use crate::common::is_full;

/// How long a run may take that has nothing to wait for: without descriptors for caches, or with one thread, the driver compiles for a while.
const PATIENCE: Duration = Duration::from_secs(120);

/// A user that nobody is: limits of processes do not bind the superuser, and count all processes of a user.
const USER: u32 = 64_321;

/// The output of a command that ends in time.
fn in_time(mut command: Command) -> Output {
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("{command:?} takes longer than {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let status = child.wait().unwrap();
    let (mut stdout, mut stderr) = (Vec::new(), Vec::new());
    child.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
    child.stderr.take().unwrap().read_to_end(&mut stderr).unwrap();
    Output { status, stdout, stderr }
}

/// The program as another user who may have so many processes, threads included, with a home of its own.
#[cfg(target_os = "linux")]
fn with_processes(limit: usize, home: &Path, args: &[&str]) -> Command {
    let mut command = Command::new("setpriv");
    command.args(["--reuid", &USER.to_string(), "--clear-groups", "prlimit", &format!("--nproc={limit}")]);
    command.arg(skylit(&[]).get_program()).args(args).current_dir(home);
    command
        .env("HOME", home)
        .env_remove("XDG_CACHE_HOME")
        .env("XDG_CONFIG_HOME", "/nonexistent")
        .env_remove("RUST_BACKTRACE");
    command
}

/// Where the system has no room for threads, fewer do the work; where there is no room for those of a driver, that is an error before it is loaded. A driver that misses one of
/// its threads waits for it forever.
#[cfg(target_os = "linux")]
#[test]
fn gpu_processes_that_run_out() {
    use std::os::unix::fs::PermissionsExt;
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    std::fs::set_permissions(dir.path(), std::fs::Permissions::from_mode(0o777)).unwrap();
    if !with_processes(1000, dir.path(), &["--version"]).output().is_ok_and(|out| out.status.success()) {
        println!("skipped: the program cannot be started as another user here (setpriv, prlimit)");
        return;
    }
    // the first run fills the cache
    let render = ["render", "builtin:plane", "--size", "32x24", "--spp", "1", "-q", "-o", "a.exr"];
    let whole = with_processes(1000, dir.path(), &render).output().unwrap();
    assert!(whole.status.success(), "{}", stderr(&whole));
    let image = std::fs::read(dir.path().join("a.exr")).unwrap();
    let limits: Vec<usize> = if is_full() { (1..=75).collect() } else { vec![1, 8, 10, 12, 20, 50] };
    // as on one with many processors, and as on this machine
    let few: Vec<usize> = limits.iter().copied().filter(|n| is_full() || [10, 20].contains(n)).collect();
    for (threads, limits) in [(Some("32"), &limits), (None, &few)] {
        let mut succeeded = 0;
        for &limit in limits {
            for args in [&["info", "builtin:plane"][..], &render] {
                let _ = std::fs::remove_file(dir.path().join("a.exr"));
                let mut command = with_processes(limit, dir.path(), args);
                if let Some(threads) = threads {
                    command.env("RAYON_NUM_THREADS", threads).env("LP_NUM_THREADS", threads);
                }
                let out = in_time(command);
                if !out.status.success() {
                    fails(&out, 5, &["out of memory: the system has no room for", "raise the limit (`ulimit -u`"]);
                    assert_eq!(stderr(&out).lines().count(), 1, "{limit}: {}", stderr(&out));
                    continue;
                }
                succeeded += 1;
                if args == render {
                    assert!(std::fs::read(dir.path().join("a.exr")).unwrap() == image, "{limit}: another image");
                }
            }
        }
        assert!(succeeded >= limits.iter().filter(|n| **n >= 20).count() * 2, "{threads:?}: {succeeded}");
    }
}

/// Four descriptors are one more than every process has: what needs more says so.
#[cfg(target_os = "linux")]
#[test]
fn gpu_descriptors_that_run_out() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let [exr, other] = ["a.exr", "b.exr"].map(|name| place(&dir, name));
    let render = ["render", "builtin:plane", "--size", "32x24", "--spp", "1", "-q", "-o"];
    assert!(skylit(&[&render[..], &[&exr]].concat()).status().unwrap().success());
    for limit in [4, 5, 8] {
        for args in [&["info", "builtin:plane"][..], &["diff", &exr, &exr], &[&render[..], &[&other]].concat()] {
            let mut command = skylit(&[]);
            let program = command.get_program().to_owned();
            command = Command::new("prlimit");
            command.arg(format!("--nofile={limit}")).arg(program).args(args).env("XDG_CONFIG_HOME", "/nonexistent");
            let out = in_time(command);
            if !out.status.success() {
                let code = out.status.code().unwrap_or_default();
                assert!([2, 3, 4].contains(&code), "{limit} {args:?}: {code}, {}", stderr(&out));
                fails(&out, code, &["too many files are open: raise the limit (`ulimit -n`)"]);
            }
        }
    }
    assert!(std::fs::read(&exr).unwrap() == std::fs::read(&other).unwrap());
}

/// A variable with which the driver would crash, or compute what is wrong, is refused before the driver is loaded.
#[test]
fn variables_of_drivers() {
    let refused = [
        ("LP_NATIVE_VECTOR_WIDTH", "7"),
        ("LP_NATIVE_VECTOR_WIDTH", "1024"),
        ("LP_NATIVE_VECTOR_WIDTH", "-1"),
        ("LP_NO_RAST", "1"),
        ("LP_PERF", "no_depth"),
        ("GALLIUM_NOOP", "true"),
        ("DRAW_USE_LLVM", "0"),
    ];
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    for (name, value) in refused {
        for args in [&["doctor"][..], &["render", "builtin:plane", "--size", "8x8", "--spp", "1", "-o", &exr]] {
            let mut command = skylit(args);
            command.env(name, value);
            fails(&in_time(command), 2, &[&format!("{name}={value} "), "unset it"]);
        }
    }
    assert_eq!(count(dir.path()), 0);
}

/// The loader says of a broken manifest that memory has run out: the error names the file.
#[test]
fn broken_manifests_of_drivers() {
    let dir = tempfile::tempdir().unwrap();
    let file = place(&dir, "garbage.json");
    for text in [
        "{\"x",
        "",
        "[1, 2]",
        "{\"ICD\": [1]}",
        "{\"ICD\": {\"library_path\": \"/no/such.so\", \"api_version\": \"1.3.0\"}}",
    ] {
        std::fs::write(&file, text).unwrap();
        let mut command = skylit(&["doctor"]);
        command.env("VK_DRIVER_FILES", &file).env("VK_ICD_FILENAMES", &file);
        fails(
            &in_time(command),
            2,
            &["VK_DRIVER_FILES names ", "garbage.json, which is no manifest of a Vulkan driver: "],
        );
    }
    // of layers, too
    std::fs::write(&file, "{").unwrap();
    let mut command = skylit(&["doctor"]);
    fails(
        &in_time({
            command.env("VK_LAYER_PATH", dir.path());
            command
        }),
        2,
        &["VK_LAYER_PATH names ", "no manifest of a Vulkan layer"],
    );
}

/// Folders of the user that are relative, or empty, are none: nothing appears in the folder that the program is started in.
#[test]
fn gpu_folders_of_the_user_that_are_relative() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(dir.path().join("here/settings/skylit")).unwrap();
    std::fs::write(dir.path().join("here/settings/skylit/skylit.toml"), "[image]\nsize = [5, 5]\n").unwrap();
    let variables = ["HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"];
    let home = place(&dir, "home");
    for (values, notes) in [(["home", "cache", "settings"], 3), (["", "", ""], 0), ([&home, "./cache", ""], 1)] {
        for quiet in [false, true] {
            let mut command =
                skylit(&["render", "builtin:plane", "--size", "8x8", "--spp", "1", "--json", "-o", "../a.exr"]);
            command.envs(variables.into_iter().zip(values)).current_dir(dir.path().join("here"));
            // a width that the driver's cache is kept apart for
            command.env("LP_NATIVE_VECTOR_WIDTH", "128");
            if quiet {
                command.arg("-q");
            }
            let out = in_time(command);
            let said = stderr(&out);
            assert_eq!(json(&out)["defaults"].as_array().map_or(0, Vec::len), 0);
            let ignored = said.lines().filter(|line| line.ends_with(" is not an absolute path")).count();
            assert_eq!(ignored, if quiet { 0 } else { notes }, "{said}");
            assert_eq!(count(&dir.path().join("here")), 1, "{values:?}");
        }
    }
}
