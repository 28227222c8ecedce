//! `tricurve validate`: whether a graph file is right, and what it amounts to.

use crate::cli::GraphFile;
use crate::graph::{Graph, Overrides};
use crate::{Failure, Outcome};

pub(crate) fn run(args: &GraphFile) -> Result<Outcome, Failure> {
    let graph = Graph::load(
        args.graph.as_deref(),
        args.profile,
        &Overrides::parse(&args.set)?,
    )?;
    if graph.has("filter") {
        graph.channels()?;
    }
    super::print(&graph.to_toml())?;
    Ok(Outcome::Done)
}
