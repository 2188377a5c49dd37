//! Files of defaults on the command line: `--no-config`, and what is said of what was taken from
//! them.

use clap::Args;

use crate::error::Result;
use crate::renderer::defaults::{self, DefaultsFile, DefaultsReport};
use crate::scene::load::Confine;
use crate::terminal::console::Console;

/// Whether defaults are read.
#[derive(Clone, Copy, Debug, Args)]
pub struct ConfigArgs {
    /// Read no defaults from skylit.toml, neither beside the scene nor in the configuration folder
    ///
    /// docs/reference/settings.md says which keys these files have.
    #[arg(long, hide_short_help = true)]
    pub no_config: bool,
}

impl ConfigArgs {
    /// The files of defaults for a scene; `confine`: where the files lie that the one beside it may
    /// name.
    ///
    /// # Errors
    /// Those of [`defaults::find`].
    pub fn files(self, scene: Option<&str>, confine: Confine) -> Result<Vec<DefaultsFile>> {
        if self.no_config { Ok(Vec::new()) } else { defaults::find(scene, confine) }
    }
}

/// Says on stderr what was taken from which file.
pub fn report(console: Console, reports: &[DefaultsReport]) {
    reports.iter().filter_map(DefaultsReport::line).for_each(|line| console.note(&line));
}
