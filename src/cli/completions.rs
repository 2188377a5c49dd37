//! `skylit completions`: scripts by which shells complete commands, options, values and names of
//! built-in scenes.

use clap::builder::PossibleValuesParser;
use clap::{Args, Command, ValueHint};
use clap_complete::Shell;

use super::help;
use crate::error::Result;
use crate::scene::builtin;
use crate::terminal::console;

const EXAMPLES: &str = "\
Examples:
  source <(skylit completions bash)                          # for this shell; in ~/.bashrc for every one
  skylit completions zsh > ~/.zfunc/_skylit                  # a folder of fpath
  skylit completions fish > ~/.config/fish/completions/skylit.fish";

/// `skylit completions`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct CompletionsArgs {
    /// Shell that the script is for
    pub shell: Shell,
}

/// Prints the script.
pub fn run(args: &CompletionsArgs) -> Result<()> {
    console::print(&script(args.shell))
}

/// Arguments that name scenes, by their ids.
const SCENES: [&str; 4] = ["scene", "scenes", "files", "mesh"];
/// Commands that take a scene, for fish.
const SCENE_COMMANDS: &str = "render view export rays compare bench";
/// Stands for the values of such an argument where the shell gets a function in place of a list.
const PLACEHOLDER: &str = "SCENES";

/// Bash splits words at colons: they are joined again for the function that clap has written, and
/// what stands before the colon is not repeated.
const BASH_COLONS: &str = r#"
_skylit_colons() {
    local words=() word= previous= index= cword=0 joined=
    for ((index = 0; index < ${#COMP_WORDS[@]}; index++)); do
        word=${COMP_WORDS[index]}
        if [[ ${#words[@]} -gt 0 && ( $word == : || $previous == : ) ]]; then
            words[${#words[@]}-1]+=$word joined=1
        else
            words+=("$word")
        fi
        previous=$word
        if [[ $index -eq $COMP_CWORD ]]; then cword=$(( ${#words[@]} - 1 )); fi
    done
    local COMP_WORDS=("${words[@]}") COMP_CWORD=$cword
    local current=${words[cword]}
    _skylit "$1" "$current" "${words[cword > 0 ? cword - 1 : 0]}"
    if [[ $joined && $current == *:* ]]; then
        COMPREPLY=("${COMPREPLY[@]#"${current%"${current##*:}"}"}")
    fi
}

if [[ "${BASH_VERSINFO[0]}" -eq 4 && "${BASH_VERSINFO[1]}" -ge 4 || "${BASH_VERSINFO[0]}" -gt 4 ]]; then
    complete -F _skylit_colons -o nosort -o bashdefault -o default skylit
else
    complete -F _skylit_colons -o bashdefault -o default skylit
fi
"#;

fn script(shell: Shell) -> String {
    // clap wants values that live as long as the program, which ends here
    let names: Vec<&'static str> = builtin::names().iter().map(|s| &*format!("builtin:{}", s.name).leak()).collect();
    let (values, rest) = match shell {
        Shell::Bash => (Some(names.clone()), BASH_COLONS.to_owned()),
        Shell::Zsh => (Some(vec![PLACEHOLDER]), String::new()),
        Shell::Fish => {
            let of_scenes = format!(
                "complete -c skylit -n \"__fish_skylit_using_subcommand {SCENE_COMMANDS}\" -a '{}'\n",
                names.join(" ")
            );
            (None, of_scenes)
        }
        _ => (None, String::new()),
    };
    let mut definition = help::definition();
    if let Some(values) = values {
        definition = with_scenes(definition, &values);
    }
    let mut out = Vec::new();
    clap_complete::generate(shell, &mut definition, "skylit", &mut out);
    let text = String::from_utf8_lossy(&out).into_owned();
    match shell {
        Shell::Zsh => with_zsh_function(&text, &names),
        _ => text + &rest,
    }
}

/// The definition with these values of arguments that name scenes.
fn with_scenes(command: Command, values: &[&'static str]) -> Command {
    let command = command.mut_args(|arg| {
        if SCENES.contains(&arg.get_id().as_str()) {
            // with a hint of files bash would take the list for one value
            arg.value_hint(ValueHint::Unknown).value_parser(PossibleValuesParser::new(values.to_vec()))
        } else {
            arg
        }
    });
    command.mut_subcommands(|c| with_scenes(c, values))
}

/// Has zsh complete scenes from files and built-in ones.
fn with_zsh_function(script: &str, names: &[&str]) -> String {
    let function = format!(
        "#compdef skylit\n\n_skylit_scenes() {{\n    local -a scenes\n    scenes=({})\n    _alternative 'files:scene file:_files' 'scenes:built-in scene:compadd -a scenes'\n}}\n",
        names.join(" ")
    );
    script.replacen("#compdef skylit\n", &function, 1).replace(&format!("({PLACEHOLDER})"), "_skylit_scenes")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_know_values_and_scenes() {
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let script = script(shell);
            for word in ["builtin:atrium", "filter-radius", "ao-vs-path", "ray-cone", "help-all"] {
                assert!(script.contains(word), "{shell}: {word}");
            }
            assert!(!script.contains(PLACEHOLDER), "{shell}");
        }
    }

    #[test]
    fn commands_with_scenes_exist() {
        let definition = help::definition();
        for name in SCENE_COMMANDS.split(' ') {
            assert!(
                definition.find_subcommand(name).is_some()
                    || !cfg!(all(feature = "viewer", feature = "bench", feature = "compare")),
                "{name}"
            );
        }
    }
}
