//! Warnings of a loader, bounded: a file with a million faults of a kind is told of them in a line.

use std::collections::HashMap;

/// Up to so many of a kind are listed each.
const LISTED: usize = 4;

/// Longest warning, in characters: names in files may be of any length.
const MAX_LENGTH: usize = 1000;

/// Warnings with those of one kind summed up: the first, and how many more there are. A kind is a
/// text without what it quotes and counts.
pub(super) fn bounded(warnings: Vec<String>) -> Vec<String> {
    let mut counts: HashMap<String, usize> = HashMap::new();
    for warning in &warnings {
        *counts.entry(kind(warning)).or_default() += 1;
    }
    let mut out = Vec::new();
    for warning in warnings {
        let Some(count) = counts.get_mut(&kind(&warning)) else { continue };
        let shown = shortened(warning);
        match *count {
            0 => {}
            1..=LISTED => out.push(shown),
            more => {
                out.push(format!("{shown} (and {} more of this kind)", more - 1));
                *count = 0;
            }
        }
    }
    out
}

/// The text without digits and what stands in backquotes.
fn kind(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for (i, part) in text.split('`').enumerate() {
        if i % 2 == 0 {
            out.extend(part.chars().filter(|c| !c.is_ascii_digit()));
            out.push('`');
        }
    }
    out
}

fn shortened(text: String) -> String {
    match text.char_indices().nth(MAX_LENGTH) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_said_once() {
        let many = |n: usize| (0..n).map(|i| format!("line {i}: `name {i}` is odd")).collect::<Vec<_>>();
        assert_eq!(bounded(many(LISTED)), many(LISTED));
        let mut warnings = many(1000);
        warnings.insert(1, "another".into());
        assert_eq!(bounded(warnings), ["line 0: `name 0` is odd (and 999 more of this kind)", "another"]);
        let long = bounded(vec!["é".repeat(5000)]);
        assert_eq!(long[0].chars().count(), MAX_LENGTH + 3);
    }
}
