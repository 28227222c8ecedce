//! Lines for people at a terminal: folded between words where they are longer than it is wide.

use std::borrow::Cow;
use std::io::IsTerminal;
use std::os::fd::AsFd;

/// Narrower terminals are left to fold by themselves.
const LEAST: usize = 20;

/// The text as it is written to this stream: elsewhere than at a terminal just as it is.
pub(crate) fn folded<'a>(text: &'a str, stream: &(impl AsFd + IsTerminal)) -> Cow<'a, str> {
    if !stream.is_terminal() {
        return Cow::Borrowed(text);
    }
    let size = rustix::termios::tcgetwinsize(stream);
    let width = size.map_or(0, |size| size.ws_col.into());
    at(text, width)
}

/// The text in lines of so many letters: what does not fit goes on below, indented by two more than the line.
fn at(text: &str, width: usize) -> Cow<'_, str> {
    let is_long = |line: &str| line.chars().count() > width;
    if width < LEAST || !text.lines().any(is_long) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + text.len() / 16);
    for line in text.split_inclusive('\n') {
        let (line, end) = match line.strip_suffix('\n') {
            Some(line) => (line, "\n"),
            None => (line, ""),
        };
        let spaces = line.len() - line.trim_start_matches(' ').len();
        let below = (spaces + 2).min(width / 2);
        let mut rest = line;
        let mut indent = 0;
        while let Some(cut) = cut(rest, width - indent) {
            out.extend(std::iter::repeat_n(' ', indent));
            out.push_str(rest[..cut].trim_end_matches(' '));
            out.push('\n');
            rest = rest[cut..].trim_start_matches(' ');
            indent = below;
        }
        out.extend(std::iter::repeat_n(' ', indent));
        out.push_str(rest);
        out.push_str(end);
    }
    Cow::Owned(out)
}

/// Where a line is cut that has more letters than there is room for: before its last word that does not fit; `None` where
/// nothing is to be cut, or no word ends.
fn cut(line: &str, room: usize) -> Option<usize> {
    let (end, beyond) = line.char_indices().nth(room)?;
    let text = line.len() - line.trim_start_matches(' ').len();
    let is_between = |at: &usize| *at > text;
    let before = line[..end + beyond.len_utf8()]
        .rfind(' ')
        .filter(is_between);
    // A word that is longer than the terminal is wide, as a path, stays whole.
    before.or_else(|| Some(end + line[end..].find(' ')?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_fit_are_left_as_they_are() {
        let text = "a line\n  another one of thirty letters\n";
        assert!(matches!(at(text, 40), Cow::Borrowed(_)));
        assert!(matches!(at(text, 0), Cow::Borrowed(_)), "no width");
    }

    #[test]
    fn longer_lines_go_on_below_between_words_and_nothing_of_them_is_lost() {
        let text = "  key: the quick brown fox jumps over the lazy dog\nshort\n";
        assert_eq!(
            at(text, 24),
            "  key: the quick brown\n    fox jumps over the\n    lazy dog\nshort\n"
        );
        let words = |text: &str| {
            text.split_whitespace()
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        assert_eq!(words(&at(text, 20)), words(text));
    }

    #[test]
    fn a_word_longer_than_the_terminal_stays_whole() {
        let path = "/a/path/that/is/longer/than/the/terminal.mcap";
        assert_eq!(at(path, 30), path);
        assert_eq!(
            at(&format!("see {path} and more"), 30),
            format!("see\n  {path}\n  and more")
        );
    }

    #[test]
    fn letters_count_and_not_bytes() {
        let text = "µµµµµ µµµµµ µµµµµ µµµµµ";
        assert!(matches!(at(text, 23), Cow::Borrowed(_)));
        assert_eq!(at(text, 22), "µµµµµ µµµµµ µµµµµ\n  µµµµµ");
    }
}
