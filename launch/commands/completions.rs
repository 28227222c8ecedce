//! `tricurve completions`: the completions for a shell.

use clap::CommandFactory as _;

use crate::cli::Cli;
use crate::{Failure, Outcome};

pub(crate) fn run(shell: clap_complete::Shell) -> Result<Outcome, Failure> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "tricurve", &mut text);
    super::print(&String::from_utf8_lossy(&text))?;
    Ok(Outcome::Done)
}
