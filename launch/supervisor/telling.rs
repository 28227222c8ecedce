//! What is said: to the user at once, and to all who record it, from the first line on.

use messages::bus::{Command, Level, Log};

use super::{Supervisor, Watcher};
use crate::Outcome;

impl<W: Watcher> Supervisor<'_, W> {
    /// Says something; what repeats is counted.
    pub(super) fn say(&mut self, level: Level, node: &str, text: impl Into<String>) {
        let (node, text) = (node.to_owned(), text.into());
        if let Some(line) = self.said.say(Log { level, node, text }) {
            self.tell(&line);
        }
    }

    /// Says why the run ends badly; what was first to go wrong counts.
    pub(super) fn fail(&mut self, outcome: Outcome, text: &str) {
        if self.trouble.is_none() {
            self.trouble = Some(outcome);
            self.say(Level::Error, "launch", text);
        }
    }

    /// Says how often that was said that repeated.
    pub(super) fn say_totals(&mut self) {
        for line in self.said.totals() {
            self.tell(&line);
        }
    }

    fn tell(&mut self, Log { level, node, text }: &Log) {
        self.watcher.say(*level, node, text);
        self.hand_over();
    }

    /// A node records what is said: it gets what the one before it did not write.
    pub(super) fn listens(&mut self, place: usize) {
        self.nodes[place].listens = Some(self.said.unwritten());
        self.hand_over();
    }

    fn hand_over(&mut self) {
        let len = self.said.len();
        for node in &mut self.nodes {
            while let Some(next) = node.listens.filter(|next| *next < len) {
                let (from, lines) = self.said.from(next);
                node.listens = Some(from + lines.len() as u64);
                node.tell(&Command::Said { from, lines });
            }
        }
    }
}
