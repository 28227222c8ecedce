//! Numbers in sentences.

use std::fmt::Display;

/// A number of things, as in `1 image`, `2 images`.
pub fn counted<N: Display + PartialEq + From<u8>>(count: N, what: &str) -> String {
    let ending = if count == N::from(1) { "" } else { "s" };
    format!("{count} {what}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_thing_is_no_things() {
        assert_eq!(counted(1u64, "scan"), "1 scan");
        assert_eq!(counted(0usize, "scan"), "0 scans");
        assert_eq!(counted(2u64, "time"), "2 times");
    }
}
