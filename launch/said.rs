//! What was said in a run, by its nodes and by the launcher: counted where it repeats, numbered, and kept for those who
//! record it, whenever they come.

use std::collections::{BTreeMap, VecDeque};

use messages::bus::{Level, Log};

/// How many lines are kept: no recorder may ever come.
const KEPT: usize = 10_000;
/// How many different lines are told from each other.
const COUNTED: usize = 10_000;
/// How many lines go into one answer: what waits longer is asked for again.
const AT_ONCE: usize = 500;

/// What was said in a run.
#[derive(Debug, Default)]
pub(crate) struct Sayings {
    lines: VecDeque<Log>,
    /// The number of the first line kept.
    first: u64,
    /// Everything before this line is in a recording of the run's own.
    written: u64,
    /// How often each warning and error was said, and which count was told last.
    counts: BTreeMap<(String, String), Count>,
}

/// What is said before the start, when there is nobody yet to hand it to: to the user at once.
#[derive(Debug, Default)]
pub(crate) struct Early(Vec<Log>);

impl Early {
    /// Says something.
    pub(crate) fn say(&mut self, level: Level, node: &str, text: impl Into<String>) {
        let (node, text) = (node.to_owned(), text.into());
        let line = Log { level, node, text };
        crate::say!("{}", in_words(line.level, &line.node, &line.text));
        self.0.push(line);
    }

    /// What was said.
    pub(crate) fn lines(self) -> Vec<Log> {
        self.0
    }
}

/// A line as the user reads it.
pub(crate) fn in_words(level: Level, node: &str, text: &str) -> String {
    match level {
        Level::Info => format!("{node}: {text}"),
        Level::Warn => format!("{node}: warning: {text}"),
        Level::Error => format!("{node}: error: {text}"),
    }
}

#[derive(Clone, Copy, Debug)]
struct Count {
    level: Level,
    said: u64,
    told: u64,
}

impl Sayings {
    /// Takes in a line; gives it back as it is to be told, if it is. A warning that comes again is counted, and told again
    /// when it came ten times, a hundred times and so on.
    pub(crate) fn say(&mut self, log: Log) -> Option<Log> {
        let log = self.counted(log)?;
        self.keep(log.clone());
        Some(log)
    }

    /// Takes in lines that were told already.
    pub(crate) fn take_in(&mut self, told: &[Log]) {
        told.iter().cloned().for_each(|line| self.keep(line));
    }

    fn counted(&mut self, log: Log) -> Option<Log> {
        let key = (log.node.clone(), log.text.clone());
        let has_room = self.counts.len() < COUNTED;
        match (log.level, self.counts.get_mut(&key)) {
            (Level::Info, _) => Some(log),
            (level, None) => {
                let (said, told) = (1, 1);
                if has_room {
                    self.counts.insert(key, Count { level, said, told });
                }
                Some(log)
            }
            (_, Some(count)) => {
                count.said += 1;
                if count.said < 10 * count.told {
                    return None;
                }
                count.told = count.said;
                let text = format!("{} ({} times so far)", log.text, count.said);
                Some(Log { text, ..log })
            }
        }
    }

    /// How often that was said that was said more often than told; at the end of a run.
    pub(crate) fn totals(&mut self) -> Vec<Log> {
        let mut totals = Vec::new();
        for ((node, text), count) in &mut self.counts {
            if count.said > count.told {
                count.told = count.said;
                totals.push(Log {
                    level: count.level,
                    node: node.clone(),
                    text: format!("{text} ({} times in all)", count.said),
                });
            }
        }
        totals.iter().cloned().for_each(|line| self.keep(line));
        totals
    }

    fn keep(&mut self, log: Log) {
        if self.lines.len() >= KEPT {
            self.lines.pop_front();
            self.first += 1;
        }
        self.lines.push_back(log);
    }

    /// The number of the line that comes next.
    pub(crate) fn len(&self) -> u64 {
        self.first + self.lines.len() as u64
    }

    /// The lines from this number on, as many as go into one answer, and the number of the first of them.
    pub(crate) fn from(&self, from: u64) -> (u64, Vec<Log>) {
        let from = from.max(self.first);
        let lines = self.lines.iter().skip((from - self.first) as usize);
        (from, lines.take(AT_ONCE).cloned().collect())
    }

    /// The first line that is in no recording of the run's own.
    pub(crate) fn unwritten(&self) -> u64 {
        self.written
    }

    /// What is before this line is recorded.
    pub(crate) fn written(&mut self, lines: u64) {
        self.written = self.written.max(lines);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(level: Level, text: &str) -> Log {
        Log {
            level,
            node: "capture".to_owned(),
            text: text.to_owned(),
        }
    }

    fn texts(lines: &[Log]) -> Vec<&str> {
        lines.iter().map(|line| line.text.as_str()).collect()
    }

    #[test]
    fn a_warning_that_repeats_is_counted_and_not_repeated() {
        let mut said = Sayings::default();
        let told: Vec<Log> = (0..250)
            .filter_map(|_| said.say(line(Level::Warn, "dark")))
            .collect();
        let shown = ["dark", "dark (10 times so far)", "dark (100 times so far)"];
        assert_eq!(texts(&told), shown);
        assert_eq!(texts(&said.totals()), ["dark (250 times in all)"]);
        assert_eq!(texts(&said.totals()), [""; 0], "it is said once");
        assert_eq!(said.len(), 4);
    }

    #[test]
    fn what_is_said_for_the_user_is_never_held_back() {
        let mut said = Sayings::default();
        for _ in 0..3 {
            assert!(
                said.say(line(Level::Info, "match.curves.score is 0.5"))
                    .is_some()
            );
        }
        assert_eq!(said.totals(), []);
    }

    #[test]
    fn who_comes_later_gets_all_lines_that_are_kept_and_is_told_where_they_begin() {
        let mut said = Sayings::default();
        for number in 0..KEPT + 3 {
            said.say(line(Level::Info, &number.to_string()));
        }
        let (from, lines) = said.from(0);
        assert_eq!((from, lines.len()), (3, AT_ONCE));
        assert_eq!(lines[0].text, "3");
        let (from, lines) = said.from(said.len() - 1);
        assert_eq!((from, texts(&lines)), (said.len() - 1, vec!["10002"]));
        assert_eq!(said.from(said.len()).1, []);
    }
}
