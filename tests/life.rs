//! A long life: nodes killed while the graph starts, a run's folder that is removed, too few open files; and that whatever
//! was said meanwhile is in the recording.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::fs::{self, File, TryLockError};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use foxglove::messages::Log;
use harness::{Ran, World, bytes_of, signal, wait, wait_until};
use prost::Message as _;

/// Starts a graph that records until it is told to stop, and waits until scans are done.
fn recorded_graph(world: &World) -> Child {
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "1000000", "--record", "x.mcap", "--json",
    ];
    let child = world.start(&run);
    wait_until("scans are recorded", || {
        bytes_of(&world.path("x.mcap")) > 2_000_000
    });
    child
}

/// Ends a graph, whose recording must then hold every scan that was let in, and verify.
#[track_caller]
fn ends_whole(world: &World, graph: Child) -> Ran {
    signal(graph.id(), "INT");
    let ran = Ran::new(graph.wait_with_output().unwrap()).done();
    let done = ran.json()["ledger"]["done"].as_u64().unwrap();
    assert_eq!(ran.json()["balanced"], true, "{ran:?}");
    holds(world, done);
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
    ran
}

#[track_caller]
fn holds(world: &World, scans: u64) {
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert_eq!(info["complete"], true, "{info}");
    assert_eq!(info["scans"]["whole"], scans, "{info}");
    assert_eq!(info["scans"]["total"], scans, "{info}");
}

/// The folder of the one run of this world.
fn folder_of_run(world: &World) -> PathBuf {
    let runs = fs::read_dir(world.runtime().join("tricurve")).unwrap();
    let mut runs = runs.map(|entry| entry.unwrap().path());
    runs.next().unwrap()
}

/// What is in the topic `log`: who said it, and what.
fn log(world: &World, name: &str) -> Vec<(String, String)> {
    let file = fs::read(world.path(name)).unwrap();
    let messages = mcap::MessageStream::new(&file).unwrap();
    let lines = messages.map(|message| message.unwrap());
    let lines = lines.filter(|message| message.channel.topic == "log");
    let line = |message: mcap::Message<'_>| Log::decode(&*message.data).unwrap();
    lines.map(line).map(|log| (log.name, log.message)).collect()
}

#[track_caller]
fn was_said(log: &[(String, String)], node: &str, text: &str) -> usize {
    let is_it = |(who, what): &&(String, String)| who == node && what.contains(text);
    let said = log.iter().filter(is_it).count();
    assert!(said > 0, "{node} {text:?} in {log:?}");
    said
}

/// Kills this node when it and so many others have been there for so long, and looks at what comes of it.
fn kill_at_start(node: usize, nodes: usize, after: Duration) {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let graph = world.start(&[
        "run", "--source", &source, "--scans", "3", "--record", "x.mcap", "--json",
    ]);
    let mut found = Vec::new();
    wait_until("the nodes are started", || {
        found = world.nodes();
        found.len() >= nodes
    });
    std::thread::sleep(after);
    let (name, pid) = &found[node % found.len()];
    signal(*pid, "KILL");
    let ran = Ran::new(graph.wait_with_output().unwrap()).done();
    let case = format!("{name} after {after:?}: {ran:?}");
    assert_eq!(ran.json()["balanced"], true, "{case}");
    assert!(
        !world.path("x.1.mcap").exists() || ran.err.contains("record was killed"),
        "{case}"
    );
    holds(&world, 3);
    let verified = world.run(&["replay", "x.mcap", "--verify", "--json"]);
    assert_eq!(verified.code, Some(0), "{case}: {verified:?}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_node_that_is_killed_as_soon_as_it_is_there_is_started_again() {
    for node in 0..2 {
        kill_at_start(node, node + 1, Duration::ZERO);
    }
}

#[test]
fn a_node_that_is_killed_while_the_graph_starts_is_started_again() {
    for (node, millis) in [(0, 0), (5, 20), (2, 50), (4, 90), (1, 140), (3, 200)] {
        kill_at_start(node, 6, Duration::from_millis(millis));
    }
}

#[test]
fn a_graph_whose_nodes_are_all_killed_while_it_starts_is_started_again() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let graph = world.start(&[
        "run", "--source", &source, "--scans", "3", "--record", "x.mcap", "--json",
    ]);
    wait_until("the nodes are started", || world.nodes().len() == 6);
    for (_, pid) in world.nodes() {
        signal(pid, "KILL");
    }
    Ran::new(graph.wait_with_output().unwrap()).done();
    holds(&world, 3);
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_runs_folders_are_locked_as_folders_which_agers_of_temporary_files_spare() {
    let world = World::new();
    let graph = recorded_graph(&world);
    let run = folder_of_run(&world);
    let is_locked = |folder: &PathBuf| {
        let folder = File::open(folder).unwrap();
        matches!(folder.try_lock(), Err(TryLockError::WouldBlock))
    };
    let folders = [
        run.parent().unwrap().to_owned(),
        run.clone(),
        run.join("nodes"),
        run.join("services"),
    ];
    wait_until("all are locked", || folders.iter().all(is_locked));
    // Of one that locks only to share, too.
    let shared = File::open(&run).unwrap().try_lock_shared();
    assert!(matches!(shared, Err(TryLockError::WouldBlock)));
    ends_whole(&world, graph);
}

/// Removes something of a run's folder while the graph runs.
fn remove(what: &str, world: &World) {
    let runs = world.runtime().join("tricurve");
    match what {
        "the folder" => fs::remove_dir_all(runs).unwrap(),
        "the session" => fs::remove_dir_all(world.runtime()).unwrap(),
        "files" => {
            let find = Command::new("find")
                .arg(runs)
                .args(["-type", "f", "-delete"])
                .status();
            assert!(find.unwrap().success());
        }
        "shared memory" => {
            let name = folder_of_run(world);
            let name = name.file_name().unwrap().to_str().unwrap();
            for entry in fs::read_dir("/dev/shm").unwrap().flatten() {
                if entry.file_name().to_str().unwrap().contains(name) {
                    fs::remove_file(entry.path()).unwrap();
                }
            }
        }
        other => panic!("{other}"),
    }
}

#[test]
fn a_graph_whose_folder_is_removed_is_found_again_and_its_nodes_are_restarted() {
    for what in ["the folder", "files", "the session"] {
        let world = World::new();
        let graph = recorded_graph(&world);
        remove(what, &world);
        wait_until("it is there again", || {
            world.run(&["node", "list"]).code == Some(0)
        });
        let home = fs::metadata(world.runtime().join("tricurve")).unwrap();
        assert_eq!(home.mode() & 0o777, 0o700, "{what}");
        // Who comes later finds it as before.
        let topics = world.run(&["topic", "echo", "points", "--count", "1"]);
        assert_eq!(topics.code, Some(0), "{what}: {topics:?}");
        // The launcher's own place in it comes back a moment after the folder.
        wait_until("the launcher answers", || {
            let set = world.run(&["param", "set", "match.curves.score=0.61"]);
            set.code == Some(0)
        });
        // A node that dies is restarted, though nobody could clean up after it.
        let (_, pid) = world
            .nodes()
            .into_iter()
            .find(|(name, _)| name == "match")
            .unwrap();
        signal(pid, "KILL");
        let restarted = || {
            let nodes = world.run(&["node", "list", "--json"]);
            nodes.code == Some(0) && nodes.json()[4]["restarts"] == 1
        };
        wait_until("match is there again", restarted);
        world
            .run(&["topic", "echo", "points", "--count", "1"])
            .done();
        let ran = ends_whole(&world, graph);
        assert!(
            ran.err.contains("was removed while the graph runs"),
            "{what}: {ran:?}"
        );
    }
}

#[test]
fn a_graph_whose_shared_memory_is_removed_says_so_and_begins_again_when_a_node_is_restarted() {
    let world = World::new();
    let graph = recorded_graph(&world);
    remove("shared memory", &world);
    let said = || {
        log_of_launcher(&world)
            .iter()
            .any(|line| line.contains("nobody can join it until"))
    };
    wait_until("it is said", said);
    world.run(&["node", "restart", "hough"]).done();
    let mut last = None;
    let listens = || {
        let ran = world.run(&["topic", "echo", "points", "--count", "1"]);
        let is_heard = ran.code == Some(0);
        last = Some(ran);
        is_heard
    };
    let joined = wait(listens);
    assert!(
        joined,
        "nobody can join: {last:?}; {:#?}",
        log_of_launcher(&world)
    );
    ends_whole(&world, graph);
}

/// What was said so far in the one run of this world.
fn log_of_launcher(world: &World) -> Vec<String> {
    let ask = messages::bus::Ask::Said { from: 0 };
    match messages::bus::ask(&folder_of_run(world), &ask) {
        Ok(messages::bus::Answer::Said { lines, .. }) => {
            lines.into_iter().map(|l| l.text).collect()
        }
        answer => panic!("{answer:?}"),
    }
}

/// The program, with a limit of open files.
fn limited(world: &World, limit: &str, arguments: &[&str]) -> Ran {
    let tricurve = world.tricurve(arguments);
    let mut command = Command::new("bash");
    command.args(["-c", &format!("ulimit {limit}; exec \"$0\" \"$@\"")]);
    command.arg(tricurve.get_program()).args(arguments);
    command.current_dir(tricurve.get_current_dir().unwrap());
    for (key, value) in tricurve.get_envs() {
        command.env(key, value.unwrap());
    }
    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    Ran::new(command.output().unwrap())
}

#[test]
fn too_few_open_files_are_said_before_the_start_and_a_soft_limit_is_raised() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "2", "--record", "x.mcap", "--json",
    ];
    let ran = limited(&world, "-n 64", &run);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    for part in ["open files", "may have 64 here", "`ulimit -n "] {
        assert!(ran.err.contains(part), "{part}: {ran:?}");
    }
    assert!(!world.path("x.mcap").exists(), "nothing is begun");
    limited(&world, "-Sn 64", &run).done();
    holds(&world, 2);
    // What is said to be enough is enough.
    let enough = ran.err.split_once("`ulimit -n ").unwrap().1;
    let enough = enough.split_once([';', '`']).unwrap().0;
    let again = [&run[..], &["--force"]].concat();
    limited(&world, &format!("-n {enough}"), &again).done();
}

#[test]
fn what_is_said_is_recorded_whoever_says_it_and_whenever() {
    let world = World::new();
    let graph = recorded_graph(&world);
    world
        .run(&["param", "set", "match.curves.score=0.61"])
        .done();
    let beside = world.run(&["record", "--output", "b.mcap", "--scans", "2"]);
    assert_eq!(beside.code, Some(0), "{beside:?}");
    let (_, pid) = world
        .nodes()
        .into_iter()
        .find(|(name, _)| name == "record")
        .unwrap();
    signal(pid, "KILL");
    wait_until("the recorder is there again", || {
        bytes_of(&world.path("x.1.mcap")) > 100_000
    });
    ends_whole(&world, graph);
    let early = ("capture", "depths are in arbitrary units");
    let change = ("match", "match.curves.score is 0.61");
    let mut all = log(&world, "x.mcap");
    assert_eq!(was_said(&all, early.0, early.1), 1);
    all.extend(log(&world, "x.1.mcap"));
    // Once in all parts together.
    for (node, text) in [
        early,
        change,
        ("launch", "record was killed"),
        ("launch", "stopping"),
    ] {
        assert_eq!(was_said(&all, node, text), 1, "{text}");
    }
    // Who records beside the graph gets what was said before it came.
    let beside = log(&world, "b.mcap");
    for (node, text) in [early, change] {
        assert_eq!(was_said(&beside, node, text), 1, "{text}");
    }
}

#[test]
fn cameras_that_stay_silent_are_no_cameras_of_which_scans_come_again() {
    let world = World::new();
    let run = [
        "run",
        "--delivery",
        "live",
        "--source",
        "camera:bus",
        "--set",
        "capture.width=64",
        "--set",
        "capture.height=48",
        "--record",
        "x.mcap",
        "--json",
    ];
    let graph = world.start(&run);
    world.waiting_run();
    let says = || {
        log_of_launcher(&world)
            .iter()
            .any(|line| line.contains("no scan for"))
    };
    wait_until("it is said that nothing comes", says);
    signal(graph.id(), "INT");
    let ran = Ran::new(graph.wait_with_output().unwrap()).done();
    assert!(!ran.err.contains("come again"), "{ran:?}");
    // Why there are no scans is in the recording, which has none.
    was_said(&log(&world, "x.mcap"), "capture", "no scan for");
}
