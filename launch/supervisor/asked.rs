//! What is asked of a running graph from outside, and settings that hold otherwise from the next scan on.
//!
//! ```text
//! set ─► queued ─► Hold to the source ─► Held (so many scans went in) ─► written down ─► Change to all ─► noted by all ─► Go
//! ```
//!
//! Guests compute nothing of a scan, so nobody waits for one to note what was set. Any other node that does not in time is
//! ended: the one that takes its place reads it. To open the door without it could give two of a scan's messages different
//! settings.

use std::collections::BTreeMap;
use std::time::Instant;

use crossbeam::channel::Sender;
use messages::bus::{self, Answer, Ask, Command, Level, NodeState, Play, Playing, State};
use messages::change::Change;

use super::{Node, Supervisor, Watcher};
use crate::{Outcome, snapshot};

/// Changes on their way: no scan is let in until every node has noted them.
pub(super) struct Pending {
    changes: Vec<Change>,
    replies: Vec<Sender<Answer>>,
    /// The nodes that have not noted them yet, once it is known from which scan on they hold.
    waiting: Option<Vec<usize>>,
    /// When those that are waited for were last told.
    told: Instant,
}

/// What the source was told, and who waits for it to have done so.
pub(super) type Told = (Play, Option<Sender<Answer>>);

impl Pending {
    /// The nodes that are waited for: the source until it has said how many scans went in, then all that must note it.
    fn late(&self) -> Vec<usize> {
        self.waiting.clone().unwrap_or_else(|| vec![0])
    }
}

impl<W: Watcher> Supervisor<'_, W> {
    /// Answers what is asked from outside, at once or when it is done.
    pub(super) fn asked(&mut self, ask: Ask, reply: Sender<Answer>) {
        let answer = match ask {
            Ask::State => Some(Answer::State(Box::new(self.state()))),
            Ask::Source if self.playing.is_none() && !self.nodes[0].has_finished => {
                self.curious.push(reply.clone());
                None
            }
            Ask::Source => Some(Answer::State(Box::new(self.state()))),
            Ask::Set { values } => self.set(&values, &reply),
            Ask::Play { play } => self.play(play, &reply),
            Ask::Snapshot if self.playing.is_some_and(|playing| playing.is_paused) => {
                let why = "the graph is paused: no scan comes that could be written".to_owned();
                Some(Answer::Refused { why })
            }
            Ask::Snapshot => snapshot::take(self.duty.dir.path(), &reply).err(),
            Ask::Said { from } => {
                let (from, lines) = self.said.from(from);
                Some(Answer::Said { from, lines })
            }
        };
        if let Some(answer) = answer {
            reply.send(answer).unwrap_or_default();
        }
    }

    /// The source says how it plays.
    pub(super) fn playing(&mut self, playing: Playing) {
        self.watcher.playing(&playing);
        let before = self.playing.replace(playing);
        let state = self.state();
        for reply in self.curious.drain(..) {
            let state = Answer::State(Box::new(state.clone()));
            reply.send(state).unwrap_or_default();
        }
        // It says so once by itself, and then once whenever it is told to play otherwise.
        let Some(before) = before else {
            return;
        };
        if let Some((play, Some(reply))) = self.told.pop_front() {
            let text = done(play, before.is_paused).to_owned();
            reply.send(Answer::Done { text }).unwrap_or_default();
        }
    }

    /// Tells the source to play otherwise.
    pub(super) fn tell_to_play(&mut self, play: Play, reply: Option<Sender<Answer>>) {
        self.told.push_back((play, reply));
        self.nodes[0].tell(&Command::Play { play });
    }

    fn state(&self) -> State {
        let node = |node: &Node| NodeState {
            name: node.name.clone(),
            state: match (node.has_finished, node.has_begun && node.is_connected) {
                (true, _) => "finished",
                (false, true) => "running",
                (false, false) => "starting",
            }
            .to_owned(),
            restarts: node.life,
        };
        State {
            parameters: self.duty.parameters.list(),
            playing: self.playing,
            progress: self.progress.clone(),
            nodes: self.nodes.iter().map(node).collect(),
        }
    }

    /// Plays otherwise; gives the answer when that cannot be.
    fn play(&mut self, play: Play, reply: &Sender<Answer>) -> Option<Answer> {
        let playing = self.playing.unwrap_or_default();
        let why = match play {
            Play::Seek(_) | Play::Rate(_) | Play::Faster | Play::Slower
                if !playing.is_recording =>
            {
                Some("a source that is no recording cannot be sought in nor played at a rate")
            }
            Play::Seek(_) => self.duty.no_seek,
            Play::Rate(rate) if !(rate.is_finite() && rate > 0.0) => {
                Some("a rate is a number above 0")
            }
            _ => None,
        };
        if let Some(why) = why.map(str::to_owned) {
            return Some(Answer::Refused { why });
        }
        self.tell_to_play(play, Some(reply.clone()));
        None
    }

    /// Sets parameters otherwise, from the next scan on; gives the answer when there is nothing to wait for.
    fn set(
        &mut self,
        values: &BTreeMap<String, serde_json::Value>,
        reply: &Sender<Answer>,
    ) -> Option<Answer> {
        let changes = match self.duty.parameters.changes(values) {
            Ok(changes) if changes.is_empty() => {
                let text = "it is so already".to_owned();
                return Some(Answer::Done { text });
            }
            Ok(changes) => changes,
            Err(why) => return Some(Answer::Refused { why }),
        };
        if !self.has_begun || self.nodes[0].has_finished {
            let why = "no scan will come that it could hold for".to_owned();
            return Some(Answer::Refused { why });
        }
        // What is asked next is checked against what this makes of it.
        self.duty.parameters.apply(&changes);
        self.queued.push((changes, reply.clone()));
        self.hold();
        None
    }

    /// Lets no scan in, so that it can be said from which one on what is queued holds.
    fn hold(&mut self) {
        if self.pending.is_some() || self.queued.is_empty() {
            return;
        }
        let (mut changes, mut replies) = (Vec::<Change>::new(), Vec::new());
        for (more, reply) in self.queued.drain(..) {
            for change in more {
                let is_it =
                    |known: &&mut Change| (&known.node, &known.key) == (&change.node, &change.key);
                // What is set twice before any scan comes holds as it was set last.
                match changes.iter_mut().find(is_it) {
                    Some(known) => known.value = change.value,
                    None => changes.push(change),
                }
            }
            replies.push(reply);
        }
        self.pending = Some(Pending {
            changes,
            replies,
            waiting: None,
            told: Instant::now(),
        });
        self.nodes[0].tell(&Command::Hold);
    }

    /// So many scans went in, and none goes until every node has noted what holds from then on.
    pub(super) fn held(&mut self, admitted: u64) {
        self.look_after_folder_now();
        let Some(pending) = self.pending.as_mut().filter(|p| p.waiting.is_none()) else {
            return;
        };
        for change in &mut pending.changes {
            change.from = admitted;
        }
        let changes = std::mem::take(&mut pending.changes);
        let before = self.duty.changes.len();
        self.duty.changes.extend(changes.iter().cloned());
        // A node that starts from now on reads them there.
        let written = bus::write_changes(self.duty.dir.path(), &self.duty.changes);
        let mut waiting = Vec::new();
        for (place, node) in self.nodes.iter_mut().enumerate() {
            if !node.has_finished {
                node.tell(&Command::Change {
                    before,
                    changes: changes.clone(),
                });
                if !self.duty.guests.contains(&node.name) {
                    waiting.push(place);
                }
            }
        }
        pending.waiting = Some(waiting);
        pending.told = Instant::now();
        for change in &changes {
            self.say(Level::Info, &change.node, change.to_string());
        }
        if let Err(error) = written {
            let text = format!("cannot write into the run's folder: {error}");
            self.fail(Outcome::Failed, &text);
        }
    }

    /// Ends the nodes that stand still while the door waits for them to note what was set.
    pub(super) fn end_who_does_not_note(&mut self) {
        let patience = self.duty.patience;
        let is_late = |pending: &&mut Pending| pending.told.elapsed() > patience;
        let Some(pending) = self.pending.as_mut().filter(is_late) else {
            return;
        };
        pending.told = Instant::now();
        for place in pending.late() {
            let text = format!(
                "{} has not noted what was set within {} s: it is ended",
                self.nodes[place].name,
                patience.as_secs_f64()
            );
            self.say(Level::Warn, "launch", text);
            // Its death is heard elsewhere, and one that is dead already cannot be ended.
            self.nodes[place].child.kill().unwrap_or_default();
        }
    }

    /// A node knows all changes, or is no more.
    pub(super) fn noted(&mut self, place: usize) {
        let Some(pending) = &mut self.pending else {
            return;
        };
        if place == 0 && pending.waiting.is_none() && self.nodes[0].has_finished {
            // The source ended before it could say from when on: no scan is left for it to hold for.
            let why = "the source has ended".to_owned();
            for reply in pending.replies.drain(..) {
                reply
                    .send(Answer::Refused { why: why.clone() })
                    .unwrap_or_default();
            }
            self.pending = None;
            return;
        }
        let Some(waiting) = &mut pending.waiting else {
            return;
        };
        waiting.retain(|waiting| *waiting != place);
        if !waiting.is_empty() {
            return;
        }
        let from = self.duty.changes.last().map_or(0, |change| change.from);
        let text = format!("it holds from scan {from} on");
        for reply in pending.replies.drain(..) {
            reply
                .send(Answer::Done { text: text.clone() })
                .unwrap_or_default();
        }
        self.pending = None;
        self.nodes[0].tell(&Command::Go);
        self.hold();
    }
}

/// What was done, in words.
fn done(play: Play, was_paused: bool) -> &'static str {
    match (play, was_paused) {
        (Play::Stop, true) => "it was paused already",
        (Play::Stop, false) | (Play::Pause, false) => "paused",
        (Play::Resume, false) => "it was playing already",
        (Play::Resume, true) | (Play::Pause, true) => "playing",
        (Play::Step, _) => "one more scan, then paused",
        (Play::Faster | Play::Slower | Play::Rate(_), _) => "the rate is set",
        (Play::Seek(_), _) => "it goes on there",
    }
}
