//! `skylit man`: manual pages, a file for each command, for those who package skylit; and the same
//! as Markdown, which is docs/reference/commands.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, Command, ValueHint};
use clap_mangen::Man;

use super::{help, reference};
use crate::error::{Error, Result};
use crate::files;
use crate::settings::choices;

choices! {
    /// Formats of manual pages.
    pub enum PageFormat {
        /// Pages of `man`: skylit.1, skylit-render.1 and so on
        Man = "man",
        /// Markdown: skylit.md, render.md and so on
        Markdown = "markdown",
    }
}

/// `skylit man`.
#[derive(Clone, Debug, Args)]
pub struct ManArgs {
    /// Folder to write the pages into
    #[arg(value_hint = ValueHint::DirPath)]
    pub folder: PathBuf,
    /// Format of the pages
    #[arg(long, value_enum, default_value = "man")]
    pub format: PageFormat,
}

/// Writes the pages.
pub fn run(args: &ManArgs) -> Result<()> {
    std::fs::create_dir_all(&args.folder).map_err(|e| Error::write(&args.folder, &e))?;
    if args.format == PageFormat::Markdown {
        return reference::pages(help::complete_definition(), help::definition()).iter().try_for_each(|page| {
            files::write_atomically(&args.folder.join(&page.file), |file| file.write_all(page.text.as_bytes()))
        });
    }
    let mut definition = help::complete_definition().disable_help_subcommand(true);
    definition.build();
    write(&definition, &args.folder)
}

fn write(command: &Command, folder: &Path) -> Result<()> {
    let page = Man::new(command.clone()).manual("skylit").source(concat!("skylit ", env!("CARGO_PKG_VERSION")));
    let path = folder.join(page.get_filename());
    let mut text = Vec::new();
    render(&page, command, &mut text).map_err(|e| Error::write(&path, &e))?;
    files::write_atomically(&path, |file| std::io::Write::write_all(file, &text))?;
    command.get_subcommands().filter(|c| !c.is_hide_set()).try_for_each(|c| write(c, folder))
}

fn render(page: &Man, command: &Command, out: &mut Vec<u8>) -> std::io::Result<()> {
    page.render_title(out)?;
    page.render_name_section(out)?;
    // the usage line: with all options in it, nobody would read it
    let usage = command.clone().render_usage().to_string();
    section(out, "SYNOPSIS", usage.trim_start_matches("Usage: ").trim());
    page.render_description_section(out)?;
    let examples = command.get_before_help().map(ToString::to_string);
    section(out, "EXAMPLES", examples.unwrap_or_default().trim_start_matches("Examples:"));
    page.render_options_section(out)?;
    if command.get_subcommands().any(|c| !c.is_hide_set()) {
        page.render_subcommands_section(out)?;
    }
    let notes = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    match notes.strip_prefix("Exit codes:") {
        Some(codes) => section(out, "EXIT STATUS", codes),
        None => section(out, "NOTES", &notes),
    }
    Ok(())
}

/// A section of lines as they are; none if there are none.
fn section(out: &mut Vec<u8>, title: &str, text: &str) {
    let text = text.trim_matches('\n');
    if text.is_empty() {
        return;
    }
    out.extend(format!(".SH {title}\n.nf\n").bytes());
    for line in text.lines() {
        // a line that begins with a dot or an apostrophe would be a request
        let line = line.replace('\\', "\\e").replace('-', "\\-");
        out.extend(format!("\\&{line}\n").bytes());
    }
    out.extend(b".fi\n");
}
