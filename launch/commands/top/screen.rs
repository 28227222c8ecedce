//! The figures on a terminal, again and again, and keys.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use ratatui::{DefaultTerminal, Frame};
use rustix::process::{Signal, getpid, kill_process};

use super::figures::{Figures, Watch};
use super::text::{Kind, lines};
use crate::Failure;
use crate::running::Running;

/// How often keys and reports are looked for.
const TURN: Duration = Duration::from_millis(50);
/// How often graphs that have begun meanwhile are looked for.
const SEARCH_EVERY: Duration = Duration::from_secs(1);

/// What the keys do, for the user.
const HELP: &str = "\u{2190} \u{2192} graph   \u{2191} \u{2193} node   r restart the node   q end";

/// The terminal as this program uses it; it becomes what it was when this is dropped.
struct Screen(DefaultTerminal);

impl Screen {
    /// Takes the terminal over; a panic gives it back, too.
    fn enter() -> Result<Self, Failure> {
        ratatui::try_init()
            .map(Self)
            .map_err(|e| Failure::failed(format!("cannot use the terminal: {e}")))
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // A terminal that is gone needs no restoring.
        ratatui::try_restore().unwrap_or_default();
    }
}

/// Shows the figures until a key or a signal ends it, or the last graph has ended; gives the graphs that have.
pub(super) fn show(
    watches: Vec<Watch>,
    is_all: bool,
    every: Duration,
    end: &AtomicBool,
) -> Result<Vec<String>, Failure> {
    let mut screen = Screen::enter()?;
    let mut top = Top::new(watches);
    let (mut next_look, mut next_search) = (Instant::now() + every, Instant::now());
    let failed = |e| Failure::failed(format!("cannot use the terminal: {e}"));
    while !end.load(Ordering::Relaxed) {
        screen.0.draw(|frame| top.draw(frame)).map_err(failed)?;
        if event::poll(TURN).map_err(failed)? {
            match event::read().map_err(failed)? {
                Event::Key(key) if key.kind == KeyEventKind::Press => match top.press(key) {
                    Wish::End => break,
                    Wish::Suspend => {
                        drop(screen);
                        kill_process(getpid(), Signal::STOP).map_err(Failure::failed)?;
                        screen = Screen::enter()?;
                    }
                    Wish::Nothing => {}
                },
                _ => {}
            }
        }
        top.hear()?;
        let now = Instant::now();
        if is_all && now >= next_search {
            next_search = now + SEARCH_EVERY;
            top.search();
        }
        if now >= next_look || top.is_new {
            next_look = now + every;
            top.look();
        }
        if top.watches.is_empty() {
            break;
        }
    }
    Ok(top.ended)
}

/// What a key asks for.
#[derive(Debug, PartialEq, Eq)]
enum Wish {
    Nothing,
    End,
    Suspend,
}

/// What is seen.
#[derive(Default)]
struct Top {
    watches: Vec<Watch>,
    /// Of the last interval, one for each that is watched.
    figures: Vec<Figures>,
    /// Names of graphs that have ended.
    ended: Vec<String>,
    /// Graphs that have been seen, whether they could be watched or not.
    seen: BTreeSet<String>,
    graph: usize,
    node: usize,
    /// The node that is to be restarted, once that is confirmed.
    asked: Option<(usize, String)>,
    note: String,
    /// Whether nothing has been looked at so far.
    is_new: bool,
}

impl Top {
    fn new(watches: Vec<Watch>) -> Self {
        Self {
            seen: watches.iter().map(|watch| watch.running.name()).collect(),
            watches,
            is_new: true,
            ..Self::default()
        }
    }

    /// Hears all graphs, and lets those go that have ended.
    fn hear(&mut self) -> Result<(), Failure> {
        for place in (0..self.watches.len()).rev() {
            if self.watches[place].is_alive() {
                self.watches[place].hear()?;
                continue;
            }
            let name = self.watches[place].running.name();
            // All its nodes may have been started again, with new ways to hear them.
            if let Ok(watch) = Running::choose(Some(&name)).and_then(Watch::start) {
                self.watches[place] = watch;
                continue;
            }
            self.watches.remove(place);
            if place < self.figures.len() {
                self.figures.remove(place);
            }
            if place < self.graph || self.graph >= self.watches.len() {
                self.graph = self.graph.saturating_sub(1);
            }
            self.asked = None;
            self.note = format!("the graph {name} has ended");
            self.ended.push(name);
        }
        Ok(())
    }

    /// Watches graphs that have begun meanwhile. One that cannot be watched keeps nobody from watching the others.
    fn search(&mut self) {
        // When there are none the last one has just ended, which is seen elsewhere.
        for running in Running::all(None).unwrap_or_default() {
            if self.seen.insert(running.name()) {
                match Watch::start(running) {
                    Ok(mut watch) => {
                        self.figures.push(watch.look());
                        self.watches.push(watch);
                    }
                    Err(failure) => self.note = failure.text,
                }
            }
        }
    }

    fn look(&mut self) {
        self.is_new = false;
        self.figures = self.watches.iter_mut().map(Watch::look).collect();
    }

    fn press(&mut self, key: KeyEvent) -> Wish {
        let asked = self.asked.take();
        // Whoever presses a key has read it.
        self.note.clear();
        let nodes = self.figures.get(self.graph).map_or(0, |f| f.nodes.len());
        let graphs = self.figures.len();
        let with_control = key.modifiers.contains(KeyModifiers::CONTROL);
        match (key.code, with_control) {
            (KeyCode::Char('c'), true) => return Wish::End,
            (KeyCode::Char('z'), true) => return Wish::Suspend,
            (_, true) => {}
            (KeyCode::Char('y' | 'Y'), _) => {
                if let Some((graph, node)) = asked {
                    self.note = self.restart(graph, &node);
                }
            }
            // A question is answered with no first.
            (KeyCode::Esc, _) if asked.is_some() => {}
            (KeyCode::Char('q' | 'Q') | KeyCode::Esc, _) => return Wish::End,
            (KeyCode::Tab | KeyCode::Right, _) if graphs > 0 => {
                self.graph = (self.graph + 1) % graphs;
            }
            (KeyCode::BackTab | KeyCode::Left, _) if graphs > 0 => {
                self.graph = (self.graph + graphs - 1) % graphs;
            }
            (KeyCode::Down, _) if nodes > 0 => self.node = (self.node.min(nodes - 1) + 1) % nodes,
            (KeyCode::Up, _) if nodes > 0 => self.node = (self.node.min(nodes) + nodes - 1) % nodes,
            (KeyCode::Char('r'), _) => {
                let figures = self.figures.get(self.graph);
                if let Some(node) = figures.and_then(|f| f.nodes.get(self.node)) {
                    let (node, run) = (node.node.clone(), &self.figures[self.graph].run);
                    self.note = format!("restart {node} of {run}? y: yes, any other key: no");
                    self.asked = Some((self.graph, node));
                }
            }
            _ => {}
        }
        let nodes = self.figures.get(self.graph).map_or(0, |f| f.nodes.len());
        self.node = self.node.min(nodes.saturating_sub(1));
        Wish::Nothing
    }

    /// Restarts a node, and says so.
    fn restart(&self, graph: usize, node: &str) -> String {
        let watch = self.watches.get(graph);
        let processes = watch.map(|watch| watch.running.processes());
        let mut processes = processes.iter().flatten();
        let ended = match processes.find(|process| process.node == node) {
            Some(process) => super::super::node::end(process),
            None => Err(Failure::failed(format!("{node} has no process now"))),
        };
        match ended {
            Ok(()) => format!("{node} ends and is started again"),
            Err(failure) => failure.text,
        }
    }

    /// Draws it: as much above as needed goes out of sight, so that the chosen graph is seen.
    fn draw(&self, frame: &mut Frame<'_>) {
        let note_height = Constraint::Length(u16::from(!self.note.is_empty()));
        let heights = [Constraint::Min(0), note_height, Constraint::Length(1)];
        let [table, note, foot] = Layout::vertical(heights).areas(frame.area());
        let mut rows: Vec<Line<'_>> = Vec::new();
        let (mut first, mut end) = (0, 0);
        for (place, figures) in self.figures.iter().enumerate() {
            let is_chosen = place == self.graph;
            if is_chosen {
                first = rows.len();
            }
            for (kind, line) in lines(figures) {
                rows.push(Line::from(Span::styled(line, self.style(kind, is_chosen))));
            }
            if is_chosen {
                end = rows.len();
            }
            rows.push(Line::default());
        }
        let height = table.height as usize;
        let above = end.saturating_sub(height).min(first);
        let rows: Vec<Line<'_>> = rows.into_iter().skip(above).collect();
        frame.render_widget(Paragraph::new(rows), table);
        let dim = Style::new().add_modifier(Modifier::DIM);
        frame.render_widget(Paragraph::new(self.note.as_str()), note);
        frame.render_widget(Paragraph::new(HELP).style(dim), foot);
    }

    fn style(&self, kind: Kind, is_chosen: bool) -> Style {
        let style = Style::new();
        match kind {
            Kind::Graph if is_chosen && self.figures.len() > 1 => {
                style.add_modifier(Modifier::BOLD | Modifier::REVERSED)
            }
            Kind::Graph => style.add_modifier(Modifier::BOLD),
            Kind::Columns => style.add_modifier(Modifier::DIM),
            Kind::Node(index, is_ill) => {
                let style = match is_ill {
                    true => style.fg(Color::Red),
                    false => style,
                };
                match is_chosen && index == self.node {
                    true => style.add_modifier(Modifier::REVERSED),
                    false => style,
                }
            }
            Kind::Trouble => style.fg(Color::Red),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::figures::NodeFigures;
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn top(graphs: usize) -> Top {
        let node = |name: &str| NodeFigures {
            node: name.to_owned(),
            state: "running".to_owned(),
            ..NodeFigures::default()
        };
        let figures = |graph: usize| Figures {
            run: format!("run{graph}"),
            nodes: ["capture", "filter", "track"].map(node).to_vec(),
            ..Figures::default()
        };
        Top {
            figures: (0..graphs).map(figures).collect(),
            ..Top::default()
        }
    }

    fn screen(top: &Top, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(80, height)).unwrap();
        terminal.draw(|frame| top.draw(frame)).unwrap();
        terminal.backend().to_string()
    }

    fn press(top: &mut Top, keys: &[KeyCode]) {
        for key in keys {
            assert_eq!(top.press(KeyEvent::from(*key)), Wish::Nothing);
        }
    }

    #[test]
    fn the_chosen_graph_is_in_sight_however_low_the_terminal() {
        let mut top = top(3);
        assert!(screen(&top, 9).contains("run0: 0 scans"));
        press(&mut top, &[KeyCode::Right, KeyCode::Tab]);
        let seen = screen(&top, 9);
        assert!(seen.contains("run2: 0 scans"), "{seen}");
        assert!(!seen.contains("run0"), "{seen}");
        press(&mut top, &[KeyCode::Right]);
        assert!(screen(&top, 9).contains("run0: 0 scans"));
        // Whatever the size, nothing fails.
        for height in 1..4 {
            screen(&top, height);
        }
    }

    #[test]
    fn a_node_is_restarted_only_when_that_is_confirmed() {
        let mut top = top(2);
        press(&mut top, &[KeyCode::Left, KeyCode::Up, KeyCode::Char('r')]);
        assert_eq!(top.asked, Some((1, "track".to_owned())));
        let seen = screen(&top, 20);
        assert!(seen.contains("restart track of run1? y: yes"), "{seen}");
        assert!(seen.contains("q end"), "the keys stay in sight: {seen}");
        press(&mut top, &[KeyCode::Esc]);
        assert_eq!(top.asked, None);
        press(&mut top, &[KeyCode::Char('y')]);
        assert_eq!(top.note, "", "nothing was asked");
        press(&mut top, &[KeyCode::Char('r'), KeyCode::Char('y')]);
        assert_eq!(top.note, "track has no process now");
        assert_eq!(top.press(KeyEvent::from(KeyCode::Esc)), Wish::End);
    }
}
