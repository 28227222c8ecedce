//! The reader of recordings: whatever the file holds, it says what is wrong or gives the scans that can be read.
//!
//! `cargo +nightly fuzz run --fuzz-dir messages/fuzz recording`; a short recording in `messages/fuzz/corpus/recording/`
//! helps it along.
#![no_main]

use std::io::Write;

use libfuzzer_sys::fuzz_target;
use messages::recording::Recording;

fuzz_target!(|data: &[u8]| {
    let Ok(mut file) = tempfile::Builder::new().suffix(".mcap").tempfile() else {
        return;
    };
    if file.write_all(data).is_err() {
        return;
    }
    let Ok(mut recording) = Recording::open(file.path()) else {
        return;
    };
    drop(recording.attachments());
    for scan in recording.scans().take(64).collect::<Vec<_>>() {
        drop(recording.salvage(scan));
    }
});
