//! `skylit scenes`: the built-in scenes.

use super::args::ScenesArgs;
use crate::error::Result;
use crate::scene::builtin;
use crate::terminal::console;

/// Lists the built-in scenes.
pub fn run(args: &ScenesArgs) -> Result<()> {
    let scenes = builtin::names();
    if args.json {
        let list: Vec<_> = scenes
            .iter()
            .map(|s| serde_json::json!({ "name": format!("builtin:{}", s.name), "description": s.description }))
            .collect();
        return console::json(&list);
    }
    let width = scenes.iter().map(|s| s.name.len()).max().unwrap_or(0) + "builtin:".len();
    let line = |s: &builtin::BuiltinInfo| format!("{:width$}  {}\n", format!("builtin:{}", s.name), s.description);
    console::print(&scenes.iter().map(line).collect::<String>())
}
