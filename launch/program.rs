//! The program: how it ends, and how it starts.

use std::process::ExitCode;

use clap::Parser as _;

use crate::{cli, commands, graph, profile};

/// How a command ended; the one table of exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Outcome {
    /// Everything was done.
    Done,
    /// It failed.
    Failed,
    /// The command line or the graph file is wrong.
    Usage,
    /// It finished, but data was lost.
    Lost,
    /// A node could not be part of the bus: what its launcher alone is told. Another process may fare better.
    OffBus,
    /// Of two recordings the second is better than the first.
    Better,
    /// Of two recordings the second is worse than the first.
    Worse,
    /// Two recordings differ, and nothing says which is better.
    Different,
    /// It was aborted by a second signal.
    Aborted,
}

impl Outcome {
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::Usage => 2,
            Self::Lost => 3,
            Self::OffBus => 4,
            Self::Better => 10,
            Self::Worse => 11,
            Self::Different => 12,
            Self::Aborted => 130,
        }
    }
}

/// A failure in one sentence, and how the process ends for it.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) outcome: Outcome,
    pub(crate) text: String,
}

impl Failure {
    pub(crate) fn failed(text: impl ToString) -> Self {
        Self {
            outcome: Outcome::Failed,
            text: text.to_string(),
        }
    }

    pub(crate) fn usage(text: impl ToString) -> Self {
        Self {
            outcome: Outcome::Usage,
            text: text.to_string(),
        }
    }
}

/// How a program ends whose own nodes cannot be had.
pub(crate) fn refused(why: &str) -> ExitCode {
    crate::say!("tricurve: {why}");
    ExitCode::from(Outcome::Failed.code())
}

/// Reads the command line and does what it says.
pub(crate) fn main() -> ExitCode {
    let outcome = match cli::Cli::try_parse() {
        Ok(cli) => commands::run(cli).unwrap_or_else(|failure| {
            crate::say!("tricurve: {}", failure.text);
            failure.outcome
        }),
        Err(error) => {
            let outcome = if error.use_stderr() {
                Outcome::Usage
            } else {
                Outcome::Done
            };
            match error.print() {
                Ok(()) => outcome,
                Err(_) => Outcome::Failed,
            }
        }
    };
    ExitCode::from(outcome.code())
}

/// Reads a graph file's text and prints the graph it gives, as a graph file with every key; for the fuzzer.
///
/// # Errors
/// When it is no graph file: in a sentence.
pub fn whole_graph(text: &str) -> Result<String, String> {
    let overrides = graph::Overrides::default();
    let graph = graph::Graph::parse(text, profile::Profile::Default, &overrides)?;
    Ok(graph.to_toml())
}
