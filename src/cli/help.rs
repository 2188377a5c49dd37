//! The command line as a whole, and its three helps: `-h` has what most people use, `--help` all
//! but what is for research, `--help-all` everything. Which help lists an option is said where the
//! option is declared: settings by their [`crate::settings::Level`], others by `hide_short_help`
//! and `hide_long_help`.
//!
//! An option's documentation begins with a paragraph of at most 100 characters, which
//! all helps have. What follows is in `--help-all`, on manual pages and in docs/reference/commands.

use std::ffi::OsString;

use clap::builder::Resettable;
use clap::{Arg, ArgAction, Command, CommandFactory};

use super::Cli;

/// Examples come first: people look for one that is close to what they want.
const TEMPLATE: &str = "{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}{all-args}{after-help}";
/// The option that lists everything.
const HELP_ALL: &str = "--help-all";
/// Most characters of the paragraph that describes an option or a command in lists.
#[cfg(test)]
const MAX_SENTENCE: usize = 100;

/// The definition of the command line.
pub fn definition() -> Command {
    fn shorten(command: Command) -> Command {
        // without a long help, `--help` shows the short one
        command.mut_args(|a| a.long_help(Resettable::Reset)).mut_subcommands(shorten)
    }
    shorten(detailed_definition())
}

/// The definition with all paragraphs of each option.
fn detailed_definition() -> Command {
    let with_alias = |command: Command| command.mut_arg("gltf_scene", |a| a.visible_alias("scene"));
    // `compare` has a file after --scene
    let commands = ["render", "view", "info", "export", "bvh"];
    let has_alias =
        |c: &Command| commands.contains(&c.get_name()) && c.get_arguments().any(|a| a.get_id() == "gltf_scene");
    arrange(Cli::command().mut_subcommands(|c| if has_alias(&c) { with_alias(c) } else { c }))
}

fn arrange(command: Command) -> Command {
    let has_more = command.get_arguments().any(|a| a.is_hide_long_help_set() || a.get_long_help().is_some());
    let command = command.help_template(TEMPLATE).mut_subcommands(arrange);
    if has_more { command.arg(help_all_flag()) } else { command }
}

/// It is there to be listed and completed: [`all`] acts on it before anything is parsed.
fn help_all_flag() -> Arg {
    Arg::new("help_all")
        .long("help-all")
        .action(ArgAction::SetTrue)
        .help_heading(Resettable::Reset)
        .help("Print help with all options, also those for research")
}

/// The definition with no option hidden from help, but for those that are hidden from everyone.
pub fn complete_definition() -> Command {
    fn show(command: Command) -> Command {
        command.mut_args(|a| a.hide_short_help(false).hide_long_help(false)).mut_subcommands(show)
    }
    show(detailed_definition())
}

/// The text of `--help-all` of the command that the arguments name, if they have this option.
pub fn all(arguments: &[OsString]) -> Option<String> {
    let options = || arguments.iter().skip(1).take_while(|a| *a != "--");
    if !options().any(|a| a == HELP_ALL) {
        return None;
    }
    let mut command = complete_definition();
    command.build();
    let mut at = &mut command;
    for word in options().filter_map(|w| w.to_str()) {
        if at.find_subcommand(word).is_some() {
            at = at.find_subcommand_mut(word)?;
        }
    }
    Some(at.render_long_help().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn help(line: &str, long: bool) -> String {
        let mut command = definition();
        command.build();
        let command = line.split(' ').fold(&mut command, |at, word| at.find_subcommand_mut(word).unwrap());
        if long { command.render_long_help().to_string() } else { command.render_help().to_string() }
    }

    #[test]
    fn three_helps() {
        let everything = all(&["skylit", "render", HELP_ALL].map(OsString::from)).unwrap();
        let (short, long) = (help("render", false), help("render", true));
        for (option, is_short, is_long) in
            [("--spp", true, true), ("--pixel-filter", false, true), ("--rr-depth", false, false)]
        {
            let option = format!("{option} ");
            assert_eq!(
                [short.contains(&option), long.contains(&option), everything.contains(&option)],
                [is_short, is_long, true],
                "{option}"
            );
        }
        assert!(short.find("Examples:") < short.find("Options:") && short.contains(HELP_ALL));
        // reasons are in the complete help alone
        let reason = "imply it.";
        assert_eq!([&long, &everything].map(|help| help.contains(reason)), [false, true]);
        // an option of another command, or of none
        assert_eq!(all(&["skylit", "render", "--", HELP_ALL].map(OsString::from)), None);
        assert!(all(&["skylit", HELP_ALL].map(OsString::from)).unwrap().contains("Commands:"));
    }

    /// Every option is documented, in a sentence that is read at a glance, and every command shows
    /// an example.
    #[test]
    fn every_option_has_help() {
        fn check(command: &Command) {
            let name = command.get_name();
            let is_sentence = |help: &str| (1..=MAX_SENTENCE).contains(&help.chars().count());
            for arg in command.get_arguments() {
                let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(is_sentence(&help), "{name} {}: {} characters: {help}", arg.get_id(), help.chars().count());
            }
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            assert!(is_sentence(&about) || name == "skylit", "{name}: {about}");
            let is_group = command.get_subcommands().next().is_some() && name != "skylit" && name != "compare";
            let is_hidden = command.is_hide_set();
            assert!(is_group || is_hidden || command.get_before_help().is_some(), "{name} has no example");
            command.get_subcommands().for_each(check);
        }
        check(&definition());
    }
}
