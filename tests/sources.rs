//! Whatever scans come from, a run is held, paused, stepped, disturbed and ended in the same way: one set of checks for all.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "../nodes/capture/tests/bag/mod.rs"]
mod bag;
mod harness;
#[path = "../nodes/capture/tests/texture/mod.rs"]
mod texture;

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use bag::{Camera, Pixels, camera_info, image, mcap};
use harness::{Ran, World, signal, wait_until};
use messages::bus::{Answer, Ask, Play, State, ask};
use texture::wave;

/// What scans come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Rendered,
    Folder,
    /// Of a folder, at the pace and with the manners of a camera.
    LiveFolder,
    Bag,
    Recording,
    Cameras,
}

/// More scans than a test waits for.
const MANY: &str = "1000000";
/// Scans of the bag and of the recording, which begin again.
const FEW: u64 = 5;

/// Writes a bag of three cameras that see a texture four pixels apart.
fn write_bag(world: &World) {
    let (start, size) = (1_700_000_000_000_000_000, (160, 96));
    let mut all = Vec::new();
    for (view, side) in ["left", "centre", "right"].into_iter().enumerate() {
        let camera = Camera {
            size,
            k: [200.0, 80.0, 48.0],
            d: &[],
            p: [200.0, 80.0, 48.0, -20.0 * view as f64],
        };
        all.push(camera_info(&format!("/{side}/camera_info"), start, camera));
        let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
        let level = |(x, y)| wave(f64::from(x) + 4.0 * view as f64, f64::from(y));
        let data: Vec<u8> = pixels.map(level).collect();
        for scan in 0..FEW {
            let pixels = Pixels {
                encoding: "mono8",
                size,
                step: size.0,
                is_big: false,
                data: &data,
            };
            let nanos = start + scan * 70_000_000 + view as u64 * 1_000_000;
            all.push(image(&format!("/{side}/image_rect"), nanos, pixels));
        }
    }
    all.sort_by_key(|one| one.log);
    mcap(&world.path("bag.mcap"), &all);
}

/// Starts the example that sends frames as a camera does; it is built with the tests.
fn publisher(run: &PathBuf) -> Child {
    let tests = std::env::current_exe().unwrap();
    let folder = tests.parent().unwrap().parent().unwrap();
    let mut command = Command::new(folder.join("examples/publish"));
    command.arg(run).stdout(Stdio::null()).spawn().unwrap()
}

/// A run that is recorded as `y.mcap`.
struct Run {
    source: Source,
    world: World,
    child: Child,
    publisher: Option<Child>,
}

impl Run {
    /// Starts a run of so many scans, or as many as there are.
    fn start(source: Source, scans: &str) -> Self {
        let recorded = ["--record", "y.mcap", "--json"];
        let run = |of: &str, more: &[&str]| {
            let all = ["run", "--source", of, "--scans", scans];
            [&all, more, &recorded].concat().join("\n")
        };
        let (world, arguments) = match source {
            Source::Rendered => (World::new(), run("scene:tab", &[])),
            Source::Folder | Source::LiveFolder => {
                let world = World::new();
                world.small_scene("scene");
                let live: &[&str] = match source {
                    Source::LiveFolder => &["--delivery", "live"],
                    _ => &[],
                };
                (world, run("scene", live))
            }
            Source::Bag => {
                let world = World::new();
                write_bag(&world);
                (world, run("bag:bag.mcap", &[]))
            }
            Source::Recording => {
                let repeats = scans == MANY;
                let world = World::recorded(&FEW.to_string());
                let replay = ["replay", "x.mcap", "--rate", "50"];
                let repeats: &[&str] = if repeats { &["--loop"] } else { &[] };
                (world, [&replay, repeats, &recorded].concat().join("\n"))
            }
            Source::Cameras => {
                let of_size = ["--set", "capture.width=160", "--set", "capture.height=120"];
                let live = ["--delivery", "live"];
                let all = run("camera:bus", &[&of_size[..], &live].concat());
                (World::new(), all)
            }
        };
        let arguments: Vec<&str> = arguments.lines().collect();
        let child = world.start(&arguments);
        let publisher = (source == Source::Cameras).then(|| publisher(&world.waiting_run()));
        Self {
            source,
            world,
            child,
            publisher,
        }
    }

    /// Asks the launcher; without an answer as long as it is not there.
    fn ask(&self, question: &Ask) -> Option<Answer> {
        let runs = fs::read_dir(self.world.runtime().join("tricurve")).ok()?;
        let mut runs = runs.flatten().map(|entry| entry.path());
        ask(&runs.next()?, question).ok()
    }

    fn state(&self) -> State {
        match self.ask(&Ask::State) {
            Some(Answer::State(state)) => *state,
            answer => panic!("{:?}: {answer:?}", self.source),
        }
    }

    /// Waits until so many scans more are done.
    #[track_caller]
    fn goes_on(&self, scans: u64) {
        let done = || match self.ask(&Ask::State) {
            Some(Answer::State(state)) => state.progress.done,
            _ => 0,
        };
        let before = done();
        wait_until("scans are done", || done() >= before + scans);
    }

    /// Plays otherwise; gives what is answered.
    #[track_caller]
    fn play(&self, play: Play) -> String {
        match self.ask(&Ask::Play { play }) {
            Some(Answer::Done { text }) => text,
            answer => panic!("{:?}, {play:?}: {answer:?}", self.source),
        }
    }

    /// Sets a parameter, for which the door is held; gives the first scan for which that holds.
    #[track_caller]
    fn set(&self, score: f64) -> u64 {
        let values = [("match.score_least".to_owned(), score.into())].into();
        match self.ask(&Ask::Set { values }) {
            Some(Answer::Done { text }) => {
                let from = text.strip_prefix("it holds from scan ");
                let from = from.and_then(|text| text.strip_suffix(" on"));
                from.unwrap_or_else(|| panic!("{text}")).parse().unwrap()
            }
            answer => panic!("{:?}: {answer:?}", self.source),
        }
    }

    /// Kills a node, and waits until another one has its place.
    #[track_caller]
    fn kill(&self, name: &str) {
        let restarts = || {
            let nodes = self.state().nodes;
            let node = nodes.into_iter().find(|node| node.name == name).unwrap();
            (node.state == "running").then_some(node.restarts)
        };
        let before = restarts().unwrap();
        let nodes = self.world.nodes();
        let (_, pid) = nodes.iter().find(|(node, _)| node == name).unwrap();
        signal(*pid, "KILL");
        wait_until("it is there again", || restarts() == Some(before + 1));
    }

    /// Waits until all that went in is done; gives how many scans that are.
    #[track_caller]
    fn is_idle(&self) -> u64 {
        let mut admitted = 0;
        wait_until("all that went in is done", || {
            let progress = self.state().progress;
            admitted = progress.admitted;
            progress.done == admitted
        });
        admitted
    }

    /// Waits for its end, in good order: with every scan that went in in the recording, once.
    #[track_caller]
    fn ends_whole(mut self) -> Ran {
        let ran = Ran::new(self.child.wait_with_output().unwrap()).done();
        if let Some(publisher) = &mut self.publisher {
            assert!(publisher.wait().unwrap().success());
        }
        let (world, source) = (&self.world, self.source);
        assert_eq!(ran.json()["balanced"], true, "{source:?}: {ran:?}");
        let done = &ran.json()["ledger"]["done"];
        assert_eq!(done, &ran.json()["ledger"]["admitted"], "{source:?}");
        let info = world.run(&["info", "y.mcap", "--json"]).done().json();
        assert_eq!(info["complete"], true, "{source:?}: {info}");
        assert_eq!(&info["scans"]["total"], done, "{source:?}: {info}");
        assert_eq!(&info["scans"]["whole"], done, "{source:?}: {info}");
        assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
        ran
    }
}

/// Disturbs a run in every way that there is, and ends it.
fn is_disturbed(source: Source) {
    let run = Run::start(source, MANY);
    run.goes_on(3);
    assert_eq!(run.play(Play::Stop), "paused", "{source:?}");
    let admitted = run.is_idle();
    assert_eq!(run.play(Play::Stop), "it was paused already");
    // In a pause none goes in, also when the door is held and let go.
    assert_eq!(run.set(0.61), admitted, "{source:?}");
    assert_eq!(run.set(0.62), admitted, "{source:?}");
    assert_eq!(run.play(Play::Step), "one more scan, then paused");
    let stepped = || run.state().progress.admitted > admitted;
    wait_until("one goes in", stepped);
    assert_eq!(run.is_idle(), admitted + 1, "{source:?}");
    assert_eq!(run.set(0.63), admitted + 1, "{source:?}");
    let playing = run.state().playing.unwrap();
    assert!(playing.is_paused, "{playing:?}");
    assert_eq!(playing.is_recording, source == Source::Recording);
    // A source that dies is as paused as it was.
    run.kill(&run.state().nodes[0].name);
    assert_eq!(run.set(0.635), admitted + 1, "{source:?}");
    assert_eq!(run.play(Play::Resume), "playing", "{source:?}");
    run.goes_on(3);
    // Who dies gets what was under way once more, and a source that dies sends it.
    for node in ["filter", "match", &*run.state().nodes[0].name] {
        run.kill(node);
        run.goes_on(3);
    }
    let admitted = run.state().progress.admitted;
    assert!(run.set(0.64) >= admitted, "{source:?}");
    assert_eq!(run.play(Play::Pause), "paused", "{source:?}");
    assert_eq!(run.play(Play::Pause), "playing", "{source:?}");
    signal(run.child.id(), "INT");
    let ran = run.ends_whole();
    let refused = ran.json()["ledger"]["refused"].clone();
    let refused = refused.as_object().unwrap();
    // Cameras go on in a pause, and files wait for its end.
    let is_cameras = source == Source::Cameras;
    assert_eq!(refused.contains_key("it was paused"), is_cameras, "{ran:?}");
    let is_live = is_cameras || source == Source::LiveFolder;
    assert!(refused.is_empty() || is_live, "{source:?}: {ran:?}");
}

/// Lets a run come to its end by itself.
fn finishes(source: Source) {
    let ran = Run::start(source, &FEW.to_string()).ends_whole();
    let ledger = &ran.json()["ledger"];
    let refused = ledger["refused"].as_object().unwrap().values();
    let refused: u64 = refused.filter_map(serde_json::Value::as_u64).sum();
    let admitted = ledger["admitted"].as_u64().unwrap();
    assert_eq!(admitted + refused, FEW, "{source:?}: {ran:?}");
}

#[test]
fn rendered_scenes_are_disturbed_and_finish() {
    is_disturbed(Source::Rendered);
    finishes(Source::Rendered);
}

#[test]
fn a_folder_is_disturbed_and_finishes() {
    is_disturbed(Source::Folder);
    finishes(Source::Folder);
}

#[test]
fn a_folder_that_plays_a_camera_is_disturbed_and_finishes() {
    is_disturbed(Source::LiveFolder);
    finishes(Source::LiveFolder);
}

#[test]
fn a_bag_is_disturbed_and_finishes() {
    is_disturbed(Source::Bag);
    finishes(Source::Bag);
}

#[test]
fn a_recording_is_disturbed_and_finishes() {
    is_disturbed(Source::Recording);
    finishes(Source::Recording);
}

#[test]
fn cameras_are_disturbed_and_finish() {
    is_disturbed(Source::Cameras);
    finishes(Source::Cameras);
}
