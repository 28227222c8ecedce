//! How many files this process and its children may have open: said before the start when they are too few.

use messages::bus::{OpenFiles, Run};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::Failure;

/// What the launcher has open beside its nodes' standard streams: its own, locks, who asks it something.
const LAUNCHER: u64 = 64;
/// A node's standard streams, while it is started.
const NODE: u64 = 6;

/// Lets all processes of a run have the files open that they need.
///
/// # Errors
/// When the system does not let them.
pub(crate) fn allow(run: &Run) -> Result<(), Failure> {
    let launcher = LAUNCHER + NODE * run.nodes.len() as u64;
    let launcher = OpenFiles {
        needed: launcher,
        wanted: launcher,
    };
    let nodes = run.nodes.iter();
    let nodes = nodes.map(|node| (node.name.as_str(), run.open_files(&node.name)));
    let all: Vec<_> = nodes.chain([("the launcher", launcher)]).collect();
    let wanted = all.iter().map(|(_, files)| files.wanted).max();
    let may = raise(wanted.unwrap_or_default());
    let most = all.into_iter().max_by_key(|(_, files)| files.needed);
    match most {
        Some((name, files)) if files.needed > may => Err(too_few(name, files.needed, may)),
        _ => Ok(()),
    }
}

/// Lets this process listen to everything in a run as a guest; where it may not it finds out what it cannot.
pub(crate) fn allow_guest(run: &Run) {
    raise(run.open_files_of_guest().wanted);
}

/// Raises the soft limit as far as it is wanted and allowed; gives what it is then.
fn raise(wanted: u64) -> u64 {
    let limit = getrlimit(Resource::Nofile);
    // No limit is a limit that is never reached.
    let soft = limit.current.unwrap_or(u64::MAX);
    let raised = wanted.min(limit.maximum.unwrap_or(u64::MAX));
    if soft >= raised {
        return soft;
    }
    let limit = Rlimit {
        current: Some(raised),
        ..limit
    };
    match setrlimit(Resource::Nofile, limit) {
        Ok(()) => raised,
        Err(_) => soft,
    }
}

fn too_few(who: &str, needed: u64, may: u64) -> Failure {
    Failure::failed(format!(
        "{who} needs up to {needed} open files, and a process may have {may} here: allow more before the start \
         (`ulimit -n {needed}`; where that is refused, the hard limit is to be raised: nofile in \
         /etc/security/limits.conf, LimitNOFILE= of a service, --ulimit nofile={needed} of a container), or take fewer \
         views or channels"
    ))
}
