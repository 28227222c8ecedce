//! The program `tricurve`; what it does is in [`launch`].

use std::process::ExitCode;

fn main() -> ExitCode {
    launch::main()
}
