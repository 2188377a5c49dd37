//! Numbers of things in words.

/// `1 frame`, `2 frames`.
pub fn plural(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}
