//! Recording on a disk that has hardly any room, and running in little shared memory.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::fs;
use std::process::Command;

use harness::{Ran, World};
use messages::recording::Recording;

/// Runs a graph that records on a small disk of its own, in a mount namespace; the recording is kept beside. Nothing
/// where the system lets nobody make such a disk.
fn on_a_small_disk(world: &World, megabytes: u32, arguments: &[&str]) -> Option<Ran> {
    fs::create_dir_all(world.path("small")).unwrap();
    with_little_room(world, "small", megabytes, arguments)
}

/// Runs with a small disk of its own in this place, and keeps what is on it in the end.
fn with_little_room(world: &World, place: &str, megabytes: u32, arguments: &[&str]) -> Option<Ran> {
    let script = format!(
        "mount -t tmpfs -o size={megabytes}m tmpfs {place} || exit 77\n\
         \"$@\"; code=$?\n\
         cp small/* . 2>/dev/null; exit $code"
    );
    let run = world.tricurve(arguments);
    let mut command = Command::new("unshare");
    command
        .args(["-rm", "sh", "-c", &script, "sh"])
        .arg(run.get_program());
    command.args(run.get_args()).current_dir(world.path(""));
    command.envs(
        run.get_envs()
            .filter_map(|(key, value)| Some((key, value?))),
    );
    let output = command.output().ok()?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.code() == Some(77) || said.starts_with("unshare:") {
        eprintln!("skipped: no disk of one's own can be made here: {said}");
        return None;
    }
    Some(Ran::new(output))
}

#[test]
fn a_disk_that_is_nearly_full_ends_the_recording_and_not_the_graph() {
    let world = World::new();
    let run = [
        "run",
        "--scans",
        "24",
        "--record",
        "small/x.mcap",
        "--set",
        "record.leave_free=40000000",
    ];
    let Some(ran) = on_a_small_disk(&world, 120, &run) else {
        return;
    };
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert!(
        ran.out.contains("24 scans in"),
        "the graph went on: {ran:?}"
    );
    for told in [
        "the disk is nearly full",
        "record.leave_free keeps 40 MB",
        "the graph goes on, and nothing more is recorded",
    ] {
        assert!(ran.err.contains(told), "{told}: {}", ran.err);
    }
    let mut recording = Recording::open(&world.path("x.mcap")).unwrap();
    assert!(
        recording.is_complete(),
        "it has its end: {:?}",
        recording.notes()
    );
    let scans = recording.scans().len() as u64;
    assert!((2..24).contains(&scans), "{scans}");
    assert!(recording.scans().eq(0..scans));
    for scan in 0..scans {
        recording.scan(scan).unwrap();
    }
    let missing = format!(
        "record dropped {} of scans: the disk has no more room",
        24 - scans
    );
    assert!(ran.err.contains(&missing), "{missing}: {}", ran.err);
    assert!(fs::metadata(world.path("x.mcap")).unwrap().len() < 80 << 20);
    // A recording that does not know how its run ended does not pass for a whole one.
    let checked = world.run(&["info", "x.mcap", "--check"]);
    assert_eq!(checked.code, Some(3), "{checked:?}");
}

#[test]
fn without_room_to_begin_with_nothing_is_begun() {
    let world = World::new();
    let run = [
        "run",
        "--scans",
        "2",
        "--record",
        "x.mcap",
        "--set",
        "record.leave_free=1000000000000000",
    ];
    let ran = world.run(&run);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(
        ran.err.contains("make room or record elsewhere"),
        "{}",
        ran.err
    );
    assert!(!world.path("x.mcap").exists());
}

#[test]
fn in_little_shared_memory_fewer_scans_are_let_in_at_a_time_and_none_is_lost() {
    let world = World::new();
    let run = |megabytes: u32, more: &[&str]| {
        let run = ["run", "--scans", "6", "--record", "x.mcap", "--force"];
        with_little_room(&world, "/dev/shm", megabytes, &[&run, more].concat())
    };
    let Some(ran) = run(170, &[]) else {
        return;
    };
    assert_eq!(ran.code, Some(0), "{ran:?}");
    let told = "capture: 2 scans at a time, where 8 would be quicker: /dev/shm has";
    assert!(ran.err.contains(told), "{}", ran.err);
    let recording = Recording::open(&world.path("x.mcap")).unwrap();
    assert_eq!(recording.whole_scans().len(), 6);
    // Who says how many is not given fewer, and one that does not fit is no run.
    for (megabytes, more) in [(170, &["--set", "capture.in_flight=8"][..]), (40, &[][..])] {
        let Some(ran) = run(megabytes, more) else {
            return;
        };
        assert_eq!(ran.code, Some(1), "{ran:?}");
        let told = "under way can need 607 MB of shared memory, /dev/shm has";
        assert!(ran.err.contains(told), "{}", ran.err);
    }
}
