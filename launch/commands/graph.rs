//! `tricurve graph`: the graph as a Mermaid diagram.

use crate::cli::GraphFile;
use crate::graph::{Graph, Overrides};
use crate::{Failure, Outcome};

pub(crate) fn run(args: &GraphFile) -> Result<Outcome, Failure> {
    let graph = Graph::load(
        args.graph.as_deref(),
        args.profile,
        &Overrides::parse(&args.set)?,
    )?;
    super::print(&graph.to_mermaid())?;
    Ok(Outcome::Done)
}
