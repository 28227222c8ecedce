//! The program `tricurve`; what it does is in [`tricurve`].

use std::process::ExitCode;

fn main() -> ExitCode {
    tricurve::App::new().main()
}
