//! The settings of a replay: those that the recording says, or those that are given where it says none.

use messages::recording::Recording;

use crate::Failure;
use crate::cli::Replay as Args;
use crate::graph::{Graph, Overrides};
use crate::profile::Profile;

/// Sees to it that the recording has settings, and gives the keys that are still to be set otherwise.
pub(super) fn settings(args: &Args, source: &mut Recording) -> Result<Vec<String>, Failure> {
    let is_given = args.graph.is_some() || args.profile.is_some();
    let path = args.file.display();
    match (source.metadata().knows_settings(), is_given) {
        (true, false) => Ok(args.set.clone()),
        (true, true) => Err(Failure::usage(format!(
            "{path} says the settings it was recorded with: --set changes them, --graph and --profile are for recordings \
             that do not say them any more"
        ))),
        (false, false) => Err(Failure::failed(format!(
            "{path} does not say with which settings it was recorded, since its metadata were left out when another \
             program rewrote it: give them with --profile default (or thesis) where it was recorded with the built-in \
             graph, with --graph FILE where with another, and with --set what was set besides"
        ))),
        (false, true) => {
            let overrides = Overrides::parse(&args.set)?;
            let profile = args.profile.unwrap_or(Profile::Default);
            let graph = Graph::load(args.graph.as_deref(), profile, &overrides)?;
            source.suppose(graph.configuration());
            let is_of_capture = |line: &String| line.trim_start().starts_with("capture.");
            let set = args.set.iter().filter(|line| !is_of_capture(line));
            Ok(set.cloned().collect())
        }
    }
}
