//! Keys on a terminal, taken one by one without Enter; everywhere else there are none.

use std::io::{IsTerminal as _, Read as _};

use messages::bus::Play;
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcsetattr};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Key {
    /// Play otherwise.
    Play(Play),
    /// Back by one scan; who computes cannot.
    Back,
    /// Come to an end.
    End,
}

/// What the keys do, for the user.
pub(crate) const HELP: &str = "space: pause, \u{2192}: one scan, \u{2191} \u{2193}: rate, q: end";

/// The terminal as it was, to which it returns when this is dropped.
#[derive(Debug)]
pub(crate) struct Keys {
    before: Termios,
}

impl Keys {
    /// Calls `press` for each key from now on; `None` when there is no terminal to press keys at.
    pub(crate) fn listen(mut press: impl FnMut(Key) + Send + 'static) -> Option<Self> {
        let input = std::io::stdin();
        if !input.is_terminal() || !std::io::stderr().is_terminal() {
            return None;
        }
        let before = tcgetattr(&input).ok()?;
        let mut by_key = before.clone();
        by_key.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
        tcsetattr(&input, OptionalActions::Now, &by_key).ok()?;
        let listen = move || {
            let mut reader = KeyReader::default();
            for byte in std::io::stdin().lock().bytes().map_while(Result::ok) {
                if let Some(key) = reader.take(byte) {
                    press(key);
                }
            }
        };
        std::thread::Builder::new()
            .name("keys".to_owned())
            .spawn(listen)
            .ok()?;
        Some(Self { before })
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        tcsetattr(std::io::stdin(), OptionalActions::Now, &self.before).unwrap_or_default();
    }
}

/// Makes keys of what a terminal sends: arrows come as three bytes.
#[derive(Debug, Default)]
struct KeyReader {
    before: [u8; 2],
}

impl KeyReader {
    fn take(&mut self, byte: u8) -> Option<Key> {
        let escaped = matches!(self.before, [0x1b, b'[' | b'O']);
        self.before = [self.before[1], byte];
        match (escaped, byte) {
            (true, b'A') => Some(Key::Play(Play::Faster)),
            (true, b'B') => Some(Key::Play(Play::Slower)),
            (true, b'C') => Some(Key::Play(Play::Step)),
            (true, b'D') => Some(Key::Back),
            (false, b' ') => Some(Key::Play(Play::Pause)),
            (false, b'q' | b'Q') => Some(Key::End),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_are_told_from_letters() {
        let mut reader = KeyReader::default();
        let keys: Vec<Key> = b" \x1b[A\x1b[B\x1bOC\x1b[DAq"
            .iter()
            .filter_map(|byte| reader.take(*byte))
            .collect();
        let play = [Play::Pause, Play::Faster, Play::Slower, Play::Step].map(Key::Play);
        assert_eq!(keys[..4], play);
        assert_eq!(keys[4..], [Key::Back, Key::End]);
    }
}
