//! tricurve with one node more: `cargo run -- run graph.toml --record histogram.mcap`

use std::process::ExitCode;

mod histogram;

fn main() -> ExitCode {
    tricurve::App::new().node(histogram::node()).main()
}
