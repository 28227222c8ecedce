//! The reader of graph files: whatever the text is, it says what is wrong or gives a graph that prints and reads back.
//!
//! `cargo +nightly fuzz run --fuzz-dir launch/fuzz graph`
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(whole) = tricurve::whole_graph(text) {
        assert_eq!(tricurve::whole_graph(&whole).as_ref(), Ok(&whole));
    }
});
