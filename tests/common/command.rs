//! The program from outside: what it says when it fails, and whether there is a device for it.

use std::process::{Command, Output};

/// Is there a device? There must be where tracers are expected.
pub fn device() -> bool {
    let there = Command::new(env!("CARGO_BIN_EXE_skylit")).arg("doctor").output().unwrap().status.success();
    assert!(there || std::env::var_os("SKYLIT_EXPECT_TRACERS").is_none(), "no usable Vulkan device");
    if !there {
        println!("skipped: no usable Vulkan device");
    }
    there
}

pub fn stderr(out: &Output) -> String {
    String::from_utf8_lossy(&out.stderr).into_owned()
}

/// It failed with this code, and its last line is an error that says all of these.
pub fn fails(out: &Output, code: i32, says: &[&str]) {
    let text = stderr(out);
    assert_eq!(out.status.code(), Some(code), "{text}");
    let last = text.lines().last().unwrap();
    assert!(last.starts_with("skylit: error: ") && says.iter().all(|s| last.contains(s)), "{text}");
}
