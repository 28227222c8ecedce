//! The figures as lines of text: the same on a terminal as anywhere else.

use std::collections::BTreeMap;

use super::figures::{Figures, NodeFigures};

/// What a line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The graph as a whole.
    Graph,
    /// The columns' names.
    Columns,
    /// The node with this index; and whether something is wrong with it.
    Node(usize, bool),
    /// Something that is wrong, in words.
    Trouble,
}

/// The lines of a graph.
pub(super) fn lines(figures: &Figures) -> Vec<(Kind, String)> {
    let graph = graph(figures).map(|line| (Kind::Graph, line));
    let mut lines = Vec::from(graph);
    lines.push((Kind::Columns, columns()));
    for (index, node) in figures.nodes.iter().enumerate() {
        let is_well = matches!(node.state.as_str(), "running" | "finished") && node.drops == 0;
        lines.push((Kind::Node(index, !is_well), row(node)));
    }
    let door = causes("at the door", &figures.scans_dropped_by_cause);
    let nodes = figures.nodes.iter();
    let nodes = nodes.flat_map(|node| causes(&format!("by {}", node.node), &node.drops_by_cause));
    lines.extend(
        door.into_iter()
            .chain(nodes)
            .map(|line| (Kind::Trouble, line)),
    );
    if figures.ended {
        lines.push((Kind::Trouble, "the graph has ended".to_owned()));
    } else if figures.launcher_silent {
        lines.push((Kind::Trouble, "the launcher does not answer".to_owned()));
    }
    lines
}

fn graph(figures: &Figures) -> [String; 2] {
    let Figures {
        run,
        scans_done,
        scans_total,
        scans_under_way,
        scans_dropped,
        triples_per_second,
        recorder_lag_scans,
        paused,
        ..
    } = figures;
    let total = scans_total.map_or(String::new(), |total| format!("/{total}"));
    let behind = recorder_lag_scans.map_or(String::new(), |lag| format!(", recorder {lag} behind"));
    let paused = if *paused { ", paused" } else { "" };
    [
        format!("{run}: {scans_done}{total} scans, {triples_per_second:.1} triples/s{paused}"),
        format!("{scans_under_way} under way, {scans_dropped} dropped{behind}"),
    ]
}

fn columns() -> String {
    format!(
        "{:<8} {:<8} {:>8} {:>5} {:>5} {:>6} {:>6} {:>5} {:>6} {:>6} {:>5}",
        "node",
        "state",
        "restarts",
        "CPU %",
        "MB",
        "Hz",
        "MB/s",
        "queue",
        "p50 ms",
        "p99 ms",
        "drops"
    )
}

fn row(figures: &NodeFigures) -> String {
    let NodeFigures {
        node,
        state,
        restarts,
        cpu_percent,
        memory_megabytes,
        hz,
        megabytes_per_second,
        queue_scans,
        p50_ms,
        p99_ms,
        drops,
        ..
    } = figures;
    let queue = queue_scans.map_or("-".to_owned(), |scans| scans.to_string());
    format!(
        "{node:<8} {state:<8} {restarts:>8} {:>5} {:>5} {:>6} {:>6} {queue:>5} {:>6} {:>6} {drops:>5}",
        number(*cpu_percent),
        number(*memory_megabytes),
        number(*hz),
        number(*megabytes_per_second),
        number(*p50_ms),
        number(*p99_ms),
    )
}

/// A number in at most five places as long as it is below a million.
fn number(value: Option<f64>) -> String {
    match value {
        None => "-".to_owned(),
        Some(value) if value < 999.95 => format!("{value:.1}"),
        Some(value) => format!("{value:.0}"),
    }
}

/// What was lost, a line each cause.
fn causes(whose: &str, causes: &BTreeMap<String, u64>) -> Vec<String> {
    let line = |(cause, count): (&String, &u64)| format!("{count} dropped {whose}: {cause}");
    causes.iter().map(line).collect()
}

/// The graphs, one below the other.
pub(super) fn text(graphs: &[Figures]) -> String {
    let blocks = graphs.iter().map(|figures| {
        let lines = lines(figures);
        lines.into_iter().map(|(_, line)| line + "\n").collect()
    });
    blocks.collect::<Vec<String>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_fits_a_terminal_of_eighty_columns_and_columns_stay_below_their_names() {
        let node = |scale: f64| NodeFigures {
            node: "evaluate".to_owned(),
            state: "starting".to_owned(),
            restarts: 12,
            cpu_percent: Some(1.99 * scale),
            memory_megabytes: Some(23.4 * scale),
            hz: Some(0.5 * scale),
            megabytes_per_second: None,
            queue_scans: Some(64),
            p50_ms: Some(12.3 * scale),
            p99_ms: Some(99.9 * scale),
            drops: 7,
            drops_by_cause: BTreeMap::from([("no room".to_owned(), 7)]),
        };
        let figures = Figures {
            nodes: [1.0, 100.0, 1000.0].map(node).to_vec(),
            ..Figures::default()
        };
        let width = columns().len();
        assert!(width <= 80, "{width}");
        for (kind, line) in lines(&figures) {
            if matches!(kind, Kind::Node(..)) {
                assert_eq!((kind, line.len()), (kind, width), "{line}");
            }
        }
        let text = text(&[figures]);
        assert!(text.contains("7 dropped by evaluate: no room"), "{text}");
    }
}
