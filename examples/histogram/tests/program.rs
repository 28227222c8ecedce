//! The program as its users have it: the node runs, is killed and started again, is recorded, played, compared and set otherwise.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A folder of this test's own, for its files and its runs.
struct World(PathBuf);

impl World {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("histogram{}{name}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o700)).unwrap();
        Self(folder)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_histogram"));
        command
            .args(arguments)
            .env("XDG_RUNTIME_DIR", &self.0)
            .current_dir(&self.0);
        command
    }

    #[track_caller]
    fn ends(&self, arguments: &[&str], code: i32) -> String {
        told(&self.command(arguments).output().unwrap(), code)
    }

    fn starts(&self, arguments: &[&str]) -> Child {
        let mut command = self.command(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    /// How many scans of the graph that runs are done, and how many are under way.
    fn scans(&self) -> Option<(u64, u64)> {
        let top = self.command(&["top", "--once", "--json"]).output().unwrap();
        let text = String::from_utf8_lossy(&top.stdout).into_owned();
        let number = |key: &str| {
            let (_, rest) = text.split_once(&format!("\"{key}\": "))?;
            rest.split(',').next()?.trim().parse().ok()
        };
        Some((number("scans_done")?, number("scans_under_way")?))
    }

    /// The process of the node `histogram` in this world.
    fn node(&self) -> Option<u32> {
        let processes = fs::read_dir("/proc").unwrap().flatten();
        let mut pids = processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        pids.find(|pid: &u32| {
            let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            let mut words = line.split(|byte| *byte == 0).skip(1);
            let is_node = words.next() == Some(b"_node") && words.next() == Some(b"histogram");
            is_node && fs::read_link(format!("/proc/{pid}/cwd")).is_ok_and(|cwd| cwd == self.0)
        })
    }
}

impl Drop for World {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).unwrap_or_default();
    }
}

/// What a process said, which ended with this code.
#[track_caller]
fn told(output: &Output, code: i32) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let said = text(&output.stdout) + &text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    said
}

/// Waits for something, but not for ever.
fn waited<T>(mut there: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + Duration::from_secs(120);
    loop {
        if let Some(found) = there() {
            return found;
        }
        assert!(Instant::now() < deadline, "waited in vain");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn graph() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("graph.toml");
    path.to_string_lossy().into_owned()
}

#[test]
fn a_killed_node_loses_nothing_and_its_messages_are_recorded_played_and_compared() {
    let world = World::new("killed");
    let graph = graph();
    let run = ["run", &graph, "--scans", "16", "--record", "h.mcap"];
    let run = world.starts(&run);
    let mut killed = 0;
    for _ in 0..2 {
        let pid = waited(|| world.node().filter(|pid| *pid != killed));
        // It has done something since it was started: the recording waits for its messages.
        let recorded = || fs::metadata(world.0.join("h.mcap")).map_or(0, |file| file.len());
        let before = recorded();
        waited(|| (recorded() > before).then_some(()));
        let mut kill = Command::new("kill");
        kill.args(["-KILL", &pid.to_string()]);
        assert!(kill.status().unwrap().success(), "the node ended too early");
        killed = pid;
    }
    let said = told(&run.wait_with_output().unwrap(), 0);
    assert!(said.contains("16 admitted = 16 done"), "{said}");

    let info = world.ends(&["info", "h.mcap"], 0);
    assert!(info.contains("16 of 16 whole"), "{info}");
    assert!(info.contains("tricurve.histogram.Histogram"), "{info}");
    let made_by = world.ends(&["info", "h.mcap", "--settings"], 0);
    assert!(made_by.contains("versions.histogram = 1"), "{made_by}");
    let verified = world.ends(&["replay", "h.mcap", "--verify"], 0);
    assert!(verified.contains("histogram/left/0.8"), "{verified}");

    // A side branch has a cut of its own: nothing else is computed.
    let branch = ["replay", "h.mcap", "--from", "histogram", "--verify"];
    let branch = world.ends(&branch, 0);
    assert!(branch.contains("96 messages of 6 topics"), "{branch}");
    let changed = [
        "replay",
        "h.mcap",
        "--from",
        "histogram",
        "--verify",
        "--set",
        "histogram.step=2",
    ];
    let changed = world.ends(&changed, 3);
    let first = "classes[0]: recorded Class { least: 0.0, count: ";
    assert!(changed.contains(first), "{changed}");
    let matching = ["replay", "h.mcap", "--from", "match", "--verify"];
    let matching = world.ends(&matching, 0);
    assert!(!matching.contains("histogram/left"), "{matching}");
}

#[test]
fn a_node_that_nobody_takes_from_lags_behind_and_misses_nothing() {
    let world = World::new("slow");
    let run = ["run", &graph(), "--scans", "40", "--no-record"];
    let run = world.starts(&run);
    let pid = waited(|| world.node());
    let signal = |name: &str| {
        let mut kill = Command::new("kill");
        kill.args([name, &pid.to_string()]);
        assert!(kill.status().unwrap().success());
    };
    waited(|| world.scans().filter(|(done, _)| *done > 0));
    for _ in 0..2 {
        signal("-STOP");
        // The door closes, and what it let in waits: nothing moves any more.
        let mut before = None;
        waited(|| {
            let now = world.scans();
            let stands = now.is_some_and(|(_, under_way)| under_way > 1) && now == before;
            before = now;
            stands.then_some(())
        });
        signal("-CONT");
    }
    let said = told(&run.wait_with_output().unwrap(), 0);
    assert!(said.contains("40 admitted = 40 done"), "{said}");
}

#[test]
fn a_proof_has_its_digests_and_is_rehydrated_to_the_byte() {
    let world = World::new("proof");
    let keep = "record.keep=proof";
    let run = [
        "run",
        &graph(),
        "--scans",
        "4",
        "--record",
        "p.mcap",
        "--set",
        keep,
    ];
    world.ends(&run, 0);
    let proof = world.ends(&["info", "p.mcap"], 0);
    assert!(!proof.contains("tricurve.histogram.Histogram"), "{proof}");
    world.ends(&["rehydrate", "p.mcap", "-o", "f.mcap"], 0);
    let full = world.ends(&["info", "f.mcap"], 0);
    assert!(full.contains("tricurve.histogram.Histogram"), "{full}");
    world.ends(&["replay", "f.mcap", "--verify"], 0);
}

#[test]
fn its_settings_are_checked_listed_and_set_while_it_runs() {
    let world = World::new("set");
    let graph = graph();
    let wrong = ["validate", &graph, "--set", "histogram.step=99"];
    let wrong = world.ends(&wrong, 2);
    let range = "histogram.step must lie between 0.1 and 64, not 99";
    assert!(wrong.contains(range), "{wrong}");
    let valid = world.ends(&["validate", &graph], 0);
    assert!(valid.contains("# Gray levels per pixel from"), "{valid}");
    let drawn = world.ends(&["graph", &graph], 0);
    assert!(drawn.contains("filter -->|edges| histogram"), "{drawn}");

    let mut run = world.starts(&["run", &graph, "--set", "capture.scans=100000"]);
    waited(|| {
        let set = ["param", "set", "histogram.step=2"];
        let set = world.command(&set).output().unwrap();
        set.status.success().then_some(())
    });
    let list = world.ends(&["param", "list"], 0);
    let step = list.lines().find(|line| line.contains("histogram.step"));
    assert!(step.is_some_and(|line| line.contains('2')), "{list}");
    let echo = ["topic", "echo", "histogram/left/0.8", "--count", "1"];
    let echo = world.ends(&echo, 0);
    assert!(echo.contains("classes"), "{echo}");
    let int = Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status();
    assert!(int.unwrap().success());
    run.wait().unwrap();
}
