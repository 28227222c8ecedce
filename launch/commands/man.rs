//! `tricurve man`: manual pages, from the same table as `--help`.

use std::path::Path;

use clap::CommandFactory as _;

use crate::cli::Cli;
use crate::{Failure, Outcome};

pub(crate) fn run(folder: &Path) -> Result<Outcome, Failure> {
    let cannot = |cause| Failure::failed(format!("{}: {cause}", folder.display()));
    std::fs::create_dir_all(folder).map_err(cannot)?;
    clap_mangen::generate_to(Cli::command(), folder).map_err(cannot)?;
    super::print(&format!(
        "{folder}\n  look at it: man {folder}/tricurve.1\n",
        folder = folder.display()
    ))?;
    Ok(Outcome::Done)
}
