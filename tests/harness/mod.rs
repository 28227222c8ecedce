//! Runs the program as its users do: as a process, in a world of its own.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "each test file uses its part; tests may panic"
)]

pub(crate) mod terminal;

use std::cell::RefCell;
use std::fs;
use std::ops::Range;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// A world: a folder for files and one for the run's shared memory, nobody else's.
pub(crate) struct World {
    folder: TempDir,
    runtime: TempDir,
    started: RefCell<Vec<u32>>,
}

impl Drop for World {
    /// A test that fails leaves nothing running: nodes die with their launcher.
    fn drop(&mut self) {
        let is_here = |pid: &&u32| {
            let works_in = fs::read_link(format!("/proc/{pid}/cwd"));
            works_in.is_ok_and(|folder| folder == self.folder.path())
        };
        for pid in self.started.borrow().iter().filter(is_here) {
            signal(*pid, "KILL");
        }
    }
}

impl World {
    pub(crate) fn new() -> Self {
        let runtime = tempfile::Builder::new().prefix("tc").tempdir().unwrap();
        fs::set_permissions(runtime.path(), fs::Permissions::from_mode(0o700)).unwrap();
        Self {
            folder: tempfile::tempdir().unwrap(),
            runtime,
            started: RefCell::new(Vec::new()),
        }
    }

    /// A world with the recording `x.mcap` of a small scene.
    pub(crate) fn recorded(scans: &str) -> Self {
        let world = Self::new();
        let scene = world.small_scene("scene");
        let source = scene.to_string_lossy();
        let run = [
            "run", "--source", &source, "--scans", scans, "--record", "x.mcap",
        ];
        world.run(&run).done();
        world
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Where this world's runs have their folders.
    pub(crate) fn runtime(&self) -> &Path {
        self.runtime.path()
    }

    /// The folder of the one graph that runs in this world, when it waits for frames.
    pub(crate) fn waiting_run(&self) -> PathBuf {
        let runs = self.runtime().join("tricurve");
        let mut found = None;
        wait_until("the graph waits for frames", || {
            let entries = fs::read_dir(&runs).into_iter().flatten().flatten();
            found = entries
                .map(|entry| entry.path())
                .find(|path| path.join("kept").exists());
            found.is_some()
        });
        found.unwrap()
    }

    /// The program, about to run in this world.
    pub(crate) fn tricurve(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tricurve"));
        command
            .args(arguments)
            .env("XDG_RUNTIME_DIR", self.runtime.path())
            .current_dir(self.folder.path());
        command
    }

    /// Runs the program to its end.
    pub(crate) fn run(&self, arguments: &[&str]) -> Ran {
        Ran::new(self.tricurve(arguments).output().unwrap())
    }

    /// Starts the program and goes on.
    pub(crate) fn start(&self, arguments: &[&str]) -> Child {
        self.start_with(arguments, Stdio::piped())
    }

    /// Starts the program, which tells what it has to tell into this file, and goes on.
    pub(crate) fn start_telling(&self, arguments: &[&str], file: &str) -> Child {
        let told = fs::File::create(self.path(file)).unwrap();
        self.start_with(arguments, told.into())
    }

    fn start_with(&self, arguments: &[&str], stderr: Stdio) -> Child {
        let mut command = self.tricurve(arguments);
        let child = command.stdout(Stdio::piped()).stderr(stderr).spawn();
        let child = child.unwrap();
        self.started.borrow_mut().push(child.id());
        child
    }

    /// Process ids of the nodes of this world's runs, by name.
    pub(crate) fn nodes(&self) -> Vec<(String, u32)> {
        let runtime = self.runtime.path().to_string_lossy().into_owned();
        let mut nodes = Vec::new();
        for entry in fs::read_dir("/proc").unwrap().flatten() {
            let Ok(pid) = entry.file_name().to_string_lossy().parse::<u32>() else {
                continue;
            };
            let line = fs::read(entry.path().join("cmdline")).unwrap_or_default();
            let words: Vec<String> = line
                .split(|b| *b == 0)
                .map(|w| String::from_utf8_lossy(w).into_owned())
                .collect();
            if words.get(1).is_some_and(|w| w == "_node")
                && words.iter().any(|w| w.starts_with(&runtime))
            {
                nodes.push((words[2].clone(), pid));
            }
        }
        nodes
    }

    /// What this world's runs still hold: folders and shared memory.
    pub(crate) fn leftovers(&self) -> Vec<PathBuf> {
        let runs = fs::read_dir(self.runtime.path().join("tricurve"));
        let runs: Vec<PathBuf> = runs
            .into_iter()
            .flatten()
            .flatten()
            .map(|e| e.path())
            .collect();
        let names: Vec<String> = runs
            .iter()
            .map(|r| r.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        let shared = fs::read_dir("/dev/shm")
            .into_iter()
            .flatten()
            .flatten()
            .map(|e| e.path());
        let shared = shared.filter(|p| {
            names
                .iter()
                .any(|name| p.to_string_lossy().contains(name.as_str()))
        });
        shared.chain(runs.iter().cloned()).collect()
    }

    /// A folder with three small textured views, four pixels of disparity apart.
    pub(crate) fn small_scene(&self, name: &str) -> PathBuf {
        self.small_rail(name, 0..3)
    }

    /// Starts a graph of a small scene that runs until it is told to end, and is recorded nowhere.
    pub(crate) fn endless(&self, more: &[&str]) -> Child {
        let scene = self.small_scene("scene");
        let source = scene.to_string_lossy();
        let run = [
            "run",
            "--source",
            &source,
            "--scans",
            "1000000",
            "--no-record",
        ];
        self.start(&[&run, more].concat())
    }

    /// The same seen from so many places, each a step of 4 px to the right.
    pub(crate) fn small_rail(&self, name: &str, places: Range<u32>) -> PathBuf {
        let folder = self.path(name);
        fs::create_dir_all(&folder).unwrap();
        for view in places {
            let mut image = b"P5\n160 120\n255\n".to_vec();
            for y in 0..120u32 {
                image.extend((0..160u32).map(|x| texture(x + 4 * view, y)));
            }
            fs::write(folder.join(format!("view{view}.pgm")), image).unwrap();
        }
        folder
    }
}

/// Smooth noise: random values every eight pixels, interpolated.
pub(crate) fn texture(x: u32, y: u32) -> u8 {
    let value = |x: u32, y: u32| {
        let mut hash = x.wrapping_mul(0x9E37_79B9) ^ y.wrapping_mul(0x85EB_CA6B);
        hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
        f64::from((hash ^ (hash >> 13)) & 255)
    };
    let (cx, cy, fx, fy) = (x / 8, y / 8, f64::from(x % 8) / 8.0, f64::from(y % 8) / 8.0);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let top = mix(value(cx, cy), value(cx + 1, cy), fx);
    let bottom = mix(value(cx, cy + 1), value(cx + 1, cy + 1), fx);
    mix(top, bottom, fy) as u8
}

/// How a run ended.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Ran {
    pub(crate) fn new(output: Output) -> Self {
        Self {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    #[track_caller]
    pub(crate) fn done(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|e| panic!("{e}: {self:?}"))
    }
}

/// Waits until something holds; fails when it takes unreasonably long.
#[track_caller]
pub(crate) fn wait_until(what: &str, holds: impl FnMut() -> bool) {
    assert!(wait(holds), "waited in vain until {what}");
}

/// Waits until something holds; false, when it does not come.
pub(crate) fn wait(mut holds: impl FnMut() -> bool) -> bool {
    let deadline = Instant::now() + Duration::from_secs(120);
    while !holds() {
        if Instant::now() > deadline {
            return false;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    true
}

/// Whether a process is gone, files closed and locks let go; one that is only waiting to be reaped is.
pub(crate) fn is_gone(pid: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The first thread's state says nothing of the others, which hold files and locks until the last is gone.
    let threads = fs::read_dir(format!("/proc/{pid}/task")).map_or(0, Iterator::count);
    let is_over = stat.contains(") Z ") || stat.contains(") X ");
    stat.is_empty() || is_over && threads <= 1
}

/// Sends a signal to one process.
pub(crate) fn signal(pid: u32, name: &str) {
    let status = Command::new("kill")
        .args([&format!("-{name}"), &pid.to_string()])
        .status()
        .unwrap();
    assert!(status.success() || std::thread::panicking() || is_gone(pid));
}

pub(crate) fn bytes_of(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |meta| meta.len())
}
