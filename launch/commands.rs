//! The commands, one file each.

mod bench;
mod calibrate;
mod check_geometry;
mod clean;
mod compare;
mod completions;
mod evaluate;
mod export;
mod graph;
mod info;
mod input;
mod man;
mod node;
mod param;
mod proof;
mod record;
mod rehydrate;
mod replay;
mod report;
mod rewrite;
mod run;
mod top;
mod topic;
mod tune;
mod validate;
mod view;

use crate::cli::{Cli, Command};
use crate::{Failure, Outcome};

/// Does what the command line says.
pub(crate) fn run(cli: Cli) -> Result<Outcome, Failure> {
    match cli.command {
        Command::Run(args) => run::run(&args),
        Command::View(args) => view::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Rehydrate(args) => rehydrate::run(&args),
        Command::Recover(args) => rewrite::recover(&args),
        Command::Merge(args) => rewrite::merge(&args),
        Command::Split(args) => rewrite::split(&args),
        Command::Filter(args) => rewrite::filter(&args),
        Command::Info(args) => info::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Tune(args) => tune::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::CheckGeometry(args) => check_geometry::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Top(args) => top::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Topic(args) => topic::run(&args),
        Command::Node(args) => node::run(&args),
        Command::Param(args) => param::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Graph(args) => graph::run(&args),
        Command::Clean => clean::run(),
        Command::Completions { shell } => completions::run(shell),
        Command::Man { folder } => man::run(&folder),
        Command::BeNode(args) => Ok(crate::node::run(&args)),
    }
}

/// Prints a command's result to standard output; a reader that has had enough is no failure.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    print_on(text).map(drop)
}

/// A table as text: every column as wide as its widest cell, the last one as long as it is.
fn aligned<const COLUMNS: usize>(rows: &[[String; COLUMNS]]) -> String {
    let widest = |column: usize| rows.iter().map(|row| row[column].chars().count()).max();
    let widths: [usize; COLUMNS] = std::array::from_fn(|column| widest(column).unwrap_or(0));
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(widths) {
            line.push_str(cell);
            let blank = width - cell.chars().count() + 2;
            line.extend(std::iter::repeat_n(' ', blank));
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// Prints a part of a command's result to standard output, and says whether anybody still reads.
pub(crate) fn print_on(text: &str) -> Result<bool, Failure> {
    use std::io::Write as _;
    let mut out = std::io::stdout().lock();
    let text = crate::fold::folded(text, &out);
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(Failure::failed(format!(
            "cannot write to standard output: {e}"
        ))),
    }
}

/// Prints a result as JSON.
pub(crate) fn print_json(result: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(result).map_err(Failure::failed)?;
    print(&(text + "\n"))
}
