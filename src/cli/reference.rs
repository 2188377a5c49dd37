//! Pages of the reference in Markdown, one for each command, from the definitions that make the
//! helps.

use std::collections::BTreeMap;

use clap::{Arg, Command};

use crate::renderer::RenderSettings;
use crate::settings::Setting;
use crate::tracer::DeviceSettings;

/// Columns of a page; code and addresses may be longer.
const COLUMNS: usize = 120;

/// The first line of each page.
const NOTE: &str = "<!-- Made by `just reference` from the definitions of the options: edit src, not this file. -->";

/// The page of a command.
pub struct Page {
    /// Name of its file: `bench-rays.md`.
    pub file: String,
    /// Markdown, which ends with a line break.
    pub text: String,
}

/// The pages of all commands; the first is that of the program, with links to the others.
/// `complete` has all options with all they say, `listed` knows which help lists an option.
pub fn pages(complete: Command, listed: Command) -> Vec<Page> {
    let build = |command: Command| {
        let mut command = command.disable_help_subcommand(true);
        command.build();
        command
    };
    let (complete, listed) = (build(complete), build(listed));
    let mut pages = Vec::new();
    add_pages(&complete, &listed, &setting_keys(), &mut pages);
    pages
}

fn add_pages(command: &Command, listed: &Command, keys: &BTreeMap<String, String>, pages: &mut Vec<Page>) {
    pages.push(Page { file: file_name(command), text: page(command, listed, keys) });
    for below in command.get_subcommands().filter(|c| !c.is_hide_set()) {
        add_pages(below, listed.find_subcommand(below.get_name()).unwrap_or(below), keys, pages);
    }
}

/// Keys of settings files, by the name of the option that they stand for.
fn setting_keys() -> BTreeMap<String, String> {
    let (mut settings, mut device) = (RenderSettings::default(), DeviceSettings::default());
    let tables = [
        ("image", settings.image.editable()),
        ("scene", settings.scene.editable()),
        ("camera", settings.camera.editable()),
        ("integrators.ao", settings.integrators.ao.editable()),
        ("integrators.path", settings.integrators.path.editable()),
        ("lighting", settings.lighting.editable()),
        ("picture", settings.picture.editable()),
        ("film", settings.film.editable()),
        ("frames", settings.frames.editable()),
        ("device", device.editable()),
    ];
    let key = |table: &str, s: &Setting| (s.name.replace('_', "-"), format!("{table}.{}", s.name));
    let mut keys: BTreeMap<_, _> = tables.iter().flat_map(|(table, all)| all.iter().map(|s| key(table, s))).collect();
    keys.insert("integrator".into(), "integrator".into());
    keys
}

/// `skylit bench rays` is in bench-rays.md.
fn file_name(command: &Command) -> String {
    let name = command.get_bin_name().unwrap_or_else(|| command.get_name());
    let words: Vec<&str> = name.split(' ').collect();
    format!("{}.md", words[words.len().min(2) - 1..].join("-"))
}

fn page(command: &Command, listed: &Command, keys: &BTreeMap<String, String>) -> String {
    let name = command.get_bin_name().unwrap_or_else(|| command.get_name());
    let mut out = format!("{NOTE}\n\n# {name}\n\n");
    let about = command.get_long_about().or(command.get_about()).map(ToString::to_string).unwrap_or_default();
    about.split("\n\n").for_each(|text| paragraph(&mut out, "", "", &sentence(text)));

    // what is typed
    let usage = command.clone().render_usage().to_string();
    let usage: Vec<&str> = usage.trim_start_matches("Usage:").lines().map(str::trim).collect();
    out += &format!("```text\n{}\n```\n\n", usage.join("\n"));
    let examples = command.get_before_help().map(ToString::to_string).unwrap_or_default();
    let examples: Vec<String> = examples.lines().skip(1).map(example).collect();
    if !examples.is_empty() {
        out += &format!("## Examples\n\n```sh\n{}\n```\n\n", examples.join("\n"));
    }

    // commands below it, each with a page of its own
    let below: Vec<&Command> = command.get_subcommands().filter(|c| !c.is_hide_set()).collect();
    if !below.is_empty() {
        out += "## Commands\n\n";
        for command in &below {
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            paragraph(
                &mut out,
                "- ",
                "  ",
                &format!("[{}]({}): {}", command.get_name(), file_name(command), sentence(&about)),
            );
            out.pop();
        }
        out.push('\n');
    }

    // options by their headings, in the order of the help
    let reads_files = command.get_arguments().any(|a| a.get_id() == "settings_file");
    let none = BTreeMap::new();
    let keys = if reads_files { keys } else { &none };
    let all: Vec<&Arg> = command.get_arguments().filter(|a| !a.is_hide_set()).collect();
    let (positional, options): (Vec<&Arg>, Vec<&Arg>) = all.into_iter().partition(|a| a.is_positional());
    let mut groups: Vec<(&str, Vec<&Arg>)> = vec![("Arguments", positional), ("Options", Vec::new())];
    for option in options {
        let heading = option.get_help_heading().unwrap_or("Options");
        match groups.iter_mut().find(|(name, _)| *name == heading) {
            Some((_, group)) => group.push(option),
            None => groups.push((heading, vec![option])),
        }
    }
    let level = |arg: &Arg| listed.get_arguments().find(|a| a.get_id() == arg.get_id()).map_or("", level_name);
    if groups.iter().flat_map(|(_, args)| args).any(|a| level(a) == "research") {
        paragraph(&mut out, "", "", LEVELS);
    }
    for (heading, args) in groups.iter().filter(|(_, args)| !args.is_empty()) {
        out += &format!("## {heading}\n\n");
        args.iter().for_each(|arg| entry(&mut out, arg, level(arg), keys));
    }

    notes(&mut out, command);
    out.truncate(out.trim_end().len());
    out + "\n"
}

/// How the marks behind options are read.
const LEVELS: &str = "Options marked *common* are listed by `-h`, those marked *more* by `--help`, and those marked \
                      *research* by `--help-all` only.";

fn level_name(arg: &Arg) -> &'static str {
    match (arg.is_hide_short_help_set(), arg.is_hide_long_help_set()) {
        (_, true) => "research",
        (true, false) => "more",
        (false, false) => "common",
    }
}

/// An argument: its name, its help, its values.
fn entry(out: &mut String, arg: &Arg, level: &str, keys: &BTreeMap<String, String>) {
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let mut paragraphs = help.split("\n\n");
    let (first, mut facts) = split_facts(paragraphs.next().unwrap_or_default());

    // the facts that clap knows
    let takes_values = arg.get_action().takes_values();
    if takes_values && !arg.get_default_values().is_empty() && !arg.is_hide_default_value_set() {
        let values: Vec<String> =
            arg.get_default_values().iter().map(|v| format!("`{}`", v.to_string_lossy())).collect();
        facts.push(format!("Default: {}.", values.join(", ")));
    }
    if let Some(names) = arg.get_visible_aliases().filter(|names| !names.is_empty()) {
        facts.push(format!("Also: `--{}`.", names.join("`, `--")));
    }
    if let Some(key) = arg.get_long().and_then(|name| keys.get(name)) {
        facts.push(format!("Settings file: `{key}`."));
    }

    let mark = if arg.is_positional() || level.is_empty() { String::new() } else { format!(" (*{level}*)") };
    let short = arg.get_short().map(|c| format!("-{c}, ")).unwrap_or_default();
    let text = format!("**`{short}{arg}`**{mark}: {} {}", sentence(&first), facts.join(" "));
    paragraph(out, "- ", "  ", &text);
    paragraphs.for_each(|text| paragraph(out, "  ", "  ", &sentence(text)));

    // named values, with their help where they have any
    let values =
        if takes_values && !arg.is_hide_possible_values_set() { arg.get_possible_values() } else { Vec::new() };
    let values: Vec<_> = values.iter().filter(|v| !v.is_hide_set()).collect();
    if values.iter().any(|v| v.get_help().is_some()) {
        for value in values {
            let help = value.get_help().map(|h| format!(": {}", sentence(&h.to_string()))).unwrap_or_default();
            paragraph(out, "  - ", "    ", &format!("`{}`{help}", value.get_name()));
            out.pop();
        }
        out.push('\n');
    } else if !values.is_empty() {
        let names: Vec<String> = values.iter().map(|v| format!("`{}`", v.get_name())).collect();
        paragraph(out, "  ", "  ", &format!("Values: {}.", names.join(", ")));
    }
}

/// Help without what is in brackets at its end, and sentences about that: `[default: 5]`.
fn split_facts(help: &str) -> (String, Vec<String>) {
    let (mut text, mut facts) = (help.trim(), Vec::new());
    while let Some((before, fact)) = text.strip_suffix(']').and_then(|t| t.rsplit_once('[')) {
        let Some((name, value)) = fact.split_once(": ") else { break };
        let fact = match name {
            "env" => format!("Environment: `{value}`."),
            _ => sentence(&format!("{}: {value}", capitalized(name))),
        };
        facts.insert(0, fact);
        text = before.trim_end();
    }
    (text.to_owned(), facts)
}

/// Appends the text that a command has after its options: a table of exit codes, and paragraphs.
fn notes(out: &mut String, command: &Command) {
    let notes = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    for block in notes.split("\n\n").filter(|b| !b.is_empty()) {
        let Some(codes) = block.strip_prefix("Exit codes:\n") else {
            paragraph(out, "", "", &sentence(block));
            continue;
        };

        // a code and its meaning, which may go on below it
        out.push_str("## Exit codes\n\n");
        let mut all: Vec<(String, String)> = Vec::new();
        for line in codes.lines().map(str::trim_end) {
            match (line.trim_start().split_once(' '), all.last_mut()) {
                (Some((code, text)), _) if code.parse::<u8>().is_ok() => all.push((code.into(), text.trim().into())),
                (_, Some((_, text))) => text.extend([" ", line.trim()]),
                _ => {}
            }
        }
        for (code, text) in all {
            paragraph(out, "- ", "  ", &format!("`{code}`: {}", sentence(&text)));
            out.pop();
        }
        out.push('\n');
    }
}

/// A line of examples as a shell takes it: what explains it is a comment.
fn example(line: &str) -> String {
    let line = line.trim();
    match line.split_once("  ") {
        Some((command, text)) if !command.starts_with('#') => {
            format!("{command}  # {}", text.trim().trim_start_matches('#').trim())
        }
        _ => line.to_owned(),
    }
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Help as Markdown that ends with a full stop.
fn sentence(help: &str) -> String {
    let text = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let end = if text.is_empty() || text.ends_with(['.', ':', '!', '?']) { "" } else { "." };
    // every second part is code already
    let parts = text.split('`').enumerate();
    let parts: Vec<String> = parts.map(|(k, part)| if k % 2 == 0 { escaped(part) } else { part.into() }).collect();
    parts.join("`") + end
}

/// Words with what Markdown would take for marks. Options become code, or two hyphens would become
/// a dash; pages become links.
fn escaped(text: &str) -> String {
    let word = |word: &str| {
        let start = word.trim_start_matches(['(', '"']);
        if let Some(page) = start.strip_prefix("docs/").map(|p| p.trim_end_matches([',', '.', ';', ':', ')'])) {
            return word.replacen(&format!("docs/{page}"), &format!("[{page}](../../{page})"), 1);
        }
        if start.starts_with("--") && start.len() > 2 {
            let name = start.trim_end_matches([',', '.', ';', ':', ')', '"']);
            return word.replacen(name, &format!("`{name}`"), 1);
        }
        word.replace('<', "\\<").replace('*', "\\*").replace('~', "\\~")
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Appends a paragraph and an empty line, wrapped, with `first` before its first line and `rest`
/// before the others.
fn paragraph(out: &mut String, first: &str, rest: &str, text: &str) {
    let mut line = first.to_owned();
    let mut is_empty = true;
    for word in words(text) {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > COLUMNS {
            *out += line.trim_end();
            out.push('\n');
            line = rest.to_owned();
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line += &word;
        is_empty = false;
    }
    *out += line.trim_end();
    out.push_str("\n\n");
}

/// The words of a text; code is one, so that no line breaks in it.
fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut is_code = false;
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        match words.last_mut().filter(|_| is_code) {
            Some(last) => last.extend([" ", word]),
            None => words.push(word.to_owned()),
        }
        is_code ^= word.matches('`').count() % 2 == 1;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::help;

    #[test]
    fn help_becomes_markdown() {
        let (text, facts) = split_facts("Samples, for --spp [0 to 9] [default: the scene's, or 16] [env: A_B]");
        assert_eq!(text, "Samples, for --spp [0 to 9]");
        assert_eq!(facts, ["Default: the scene's, or 16.", "Environment: `A_B`."]);
        assert_eq!(sentence("As `a  <b>` (--spp), <N> *"), "As `a <b>` (`--spp`), \\<N> \\*.");
        assert_eq!(sentence("See docs/a/b.md"), "See [a/b.md](../../a/b.md).");
        assert_eq!(example("  skylit a -o b      in colour"), "skylit a -o b  # in colour");
        assert_eq!(example("  skylit a   # why"), "skylit a  # why");
    }

    #[test]
    fn paragraphs_are_wrapped_outside_of_code() {
        let mut out = String::new();
        paragraph(&mut out, "- ", "  ", &format!("{}`two words`, and", "word ".repeat(22)));
        let lines: Vec<&str> = out.lines().collect();
        assert_eq!(lines[1..], ["  `two words`, and", ""]);
        assert!(lines[0].starts_with("- word") && lines[0].len() <= COLUMNS);
    }

    /// Every option of every command is on its page, with the help that lists it.
    #[test]
    fn pages_have_all_options() {
        let pages = pages(help::complete_definition(), help::definition());
        let page = |file: &str| &pages.iter().find(|p| p.file == file).unwrap().text;
        assert!(
            page("skylit.md").contains("[render](render.md)") && page("skylit.md").contains("- `130`: interrupted")
        );
        for (option, mark, key) in [
            ("--spp <SPP>", "common", "image.spp"),
            ("--seed <N>", "more", "image.seed"),
            ("--rr-depth <N>", "research", "integrators.path.rr_depth"),
        ] {
            let start = format!("- **`{option}`** (*{mark}*): ");
            let entry = page("render.md").split("\n- ").find(|e| format!("- {e}").starts_with(&start));
            assert!(entry.is_some_and(|e| e.contains(key)), "{option}");
        }
        assert!(!page("diff.md").contains("Settings file"));
        for page in &pages {
            let is_code = |line: &str| line.starts_with("skylit") || line.contains('`');
            let long: Vec<&str> = page.text.lines().filter(|l| l.chars().count() > COLUMNS && !is_code(l)).collect();
            assert!(long.is_empty(), "{}: {long:?}", page.file);
        }
    }
}
