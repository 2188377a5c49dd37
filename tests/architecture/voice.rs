//! How the code speaks: names of functions, conditions, beginnings and width of documentation, and
//! functions in phases.

use std::path::Path;

use syn::visit::{self, Visit};
use syn::{ExprMatch, ImplItemFn, ItemFn, Lit, Pat, Signature, TraitItemFn};

/// Names that say neither what a function does nor of what it makes something.
const EMPTY_NAMES: &[&str] = &["of", "one", "go", "from_there"];

/// First words of documentation that leave out the subject of the sentence.
const NO_SUBJECT: &[&str] =
    &["What ", "Those ", "Its ", "Of ", "The same for ", "The same with ", "The same as ", "The same, "];

/// Derives whose documentation is the text of `--help`.
const HELP: &[&str] = &["Args", "Parser", "Subcommand", "ValueEnum"];

/// Columns of comments and documentation.
const MAX_COLUMNS: usize = 100;

/// Functions of more lines are told in phases.
const MAX_LINES_UNDIVIDED: usize = 40;

/// Appends a line for each lapse of a file to `lapses`.
pub fn check(file: &Path, text: &str, lapses: &mut Vec<String>) {
    let mut voice = Voice { lapses: Vec::new() };
    voice.visit_file(&syn::parse_file(text).unwrap_or_else(|e| panic!("{}: {e}", file.display())));
    documentation(text, &mut voice.lapses);
    phases(text, &mut voice.lapses);
    lapses.extend(voice.lapses.into_iter().map(|lapse| format!("{}: {lapse}", file.display())));
}

struct Voice {
    lapses: Vec<String>,
}

impl Voice {
    fn check_name(&mut self, signature: &Signature) {
        let name = signature.ident.to_string();
        if EMPTY_NAMES.contains(&name.as_str()) {
            self.lapses.push(format!("fn {name}: a verb and its object, like `from_path`"));
        }
    }
}

impl<'ast> Visit<'ast> for Voice {
    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        self.check_name(&item.sig);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        self.check_name(&item.sig);
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &'ast TraitItemFn) {
        self.check_name(&item.sig);
        visit::visit_trait_item_fn(self, item);
    }

    fn visit_expr_match(&mut self, item: &'ast ExprMatch) {
        let is_bool = |p: &Pat| matches!(p, Pat::Lit(l) if matches!(l.lit, Lit::Bool(_)));
        if item.arms.len() == 2 && item.arms.iter().any(|a| is_bool(&a.pat) && a.guard.is_none()) {
            self.lapses.push("`match` of a condition with true and false: write `if`".to_owned());
        }
        visit::visit_expr_match(self, item);
    }
}

/// Finds documentation that begins without a subject, and comments that are too wide. Texts of
/// `--help` are no sentences, and each is one line.
fn documentation(text: &str, lapses: &mut Vec<String>) {
    let lines: Vec<&str> = text.lines().collect();
    let mut help_until: Option<String> = None;
    for (k, line) in lines.iter().enumerate() {
        let words = line.trim_start();
        let indent = &line[..line.len() - words.len()];
        if help_until.as_deref().is_some_and(|end| line.starts_with(end)) {
            help_until = None;
        }
        if words.contains("settings! {") || words.contains("choices! {") || is_help(words) {
            help_until = Some(format!("{indent}}}"));
        }
        let is_first = k == 0 || !lines[k - 1].trim_start().starts_with("//");
        let is_text = help_until.is_none() && !is_about(&lines[k..]);
        if let Some(doc) = words.strip_prefix("/// ").or(words.strip_prefix("//! ")).filter(|_| is_first && is_text)
            && NO_SUBJECT.iter().any(|start| doc.starts_with(start))
        {
            lapses.push(format!("line {}: documentation without a subject: {doc}", k + 1));
        }
        let is_table_or_code = ["//! |", "/// |", "//!     ", "///     "].iter().any(|start| words.starts_with(start));
        if words.starts_with("//") && is_text && !is_table_or_code && line.chars().count() > MAX_COLUMNS {
            lapses.push(format!("line {}: a comment of more than {MAX_COLUMNS} columns", k + 1));
        }
    }
}

fn is_help(line: &str) -> bool {
    let is_derive = line.starts_with("#[") && line.contains("derive(");
    is_derive && line.split(|c: char| !c.is_alphanumeric()).any(|word| HELP.contains(&word))
}

/// Is this the documentation of a type whose text is help?
fn is_about(lines: &[&str]) -> bool {
    lines.iter().map(|l| l.trim_start()).take_while(|l| l.starts_with("///") || l.starts_with("#[")).any(is_help)
}

/// Finds functions of many lines without a blank line and a comment. Tests are lists of cases.
fn phases(text: &str, lapses: &mut Vec<String>) {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    for (k, line) in lines.iter().enumerate() {
        let words = line.trim_start();
        let is_function = words.split_once("fn ").is_some_and(|(before, _)| {
            before
                .split_whitespace()
                .all(|w| w.starts_with("pub") || w.starts_with("in") || ["const", "unsafe", "super)"].contains(&w))
        });
        if !is_function || words.starts_with("//") {
            continue;
        }
        let end = format!("{}}}", &line[..line.len() - words.len()]);
        let body: Vec<&str> = lines[k + 1..].iter().map_while(|l| (!l.starts_with(&end)).then_some(*l)).collect();
        let is_divided = body.contains(&"") && body.iter().any(|l| l.trim_start().starts_with("//"));
        if body.len() + 2 > MAX_LINES_UNDIVIDED && !is_divided {
            lapses.push(format!("line {}: {} lines without phases: {words}", k + 1, body.len() + 2));
        }
    }
}

#[test]
fn lapses_are_found() {
    let text = "
//! What it is.

/// Its path.
fn of(a: bool) -> u32 {
    match a {
        true => 1,
        false => 2,
    }
}

/// What help says
#[derive(Args)]
struct Options {
    /// Those of the user
    a: bool,
}

/// The same answer, in a sentence.
fn answer() {}
";
    let mut lapses = Vec::new();
    check(Path::new("a.rs"), text, &mut lapses);
    assert_eq!(lapses.len(), 4, "{lapses:#?}");

    let mut lapses = Vec::new();
    check(Path::new("a.rs"), &format!("// {}\n", "word ".repeat(20)), &mut lapses);
    assert_eq!(lapses.len(), 1, "{lapses:?}");

    let long = |middle: &str| format!("fn f() {{\n{}{middle}{}}}\n", "    g();\n".repeat(30), "    g();\n".repeat(30));
    for (middle, expected) in [("", 1), ("\n", 1), ("    // why\n", 1), ("\n    // why\n", 0)] {
        let mut lapses = Vec::new();
        check(Path::new("a.rs"), &long(middle), &mut lapses);
        assert_eq!(lapses.len(), expected, "{middle:?}: {lapses:?}");
    }
}
