//! The run's folder: private to the user, locked while its launcher lives, swept when everybody is gone.

use std::collections::BTreeSet;
use std::fs::{self, DirBuilder, File};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use rustix::fs::{FlockOperation, flock};

/// Where POSIX shared memory lives.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Held by the launcher while it lives.
const LAUNCHER: &str = "launcher.lock";
/// Held, shared, by every node while it lives.
const NODES: &str = "nodes.lock";
/// What the run's shared memory is called.
const PREFIX: &str = "prefix";

/// What the names of all runs' shared memory begin with.
const PREFIXES: &str = "tricurve_";
/// In shared memory, behind the run's prefix: locked by launcher and nodes while they live, so that what a run left is
/// known even when its folder is gone.
const ALIVE: &str = "alive";

/// The longest path of a socket, less what iceoryx2 puts behind folder and prefix: a slash, 30 digits and `.event`.
const MOST_PATH: usize = 107 - 37;

/// A run's folder, locked.
#[derive(Debug)]
pub(crate) struct RunDir {
    path: PathBuf,
    prefix: String,
    _lock: File,
    _alive: File,
}

/// The folder of all runs of this user: in the session's own if that leaves room for the names of sockets.
fn home() -> io::Result<PathBuf> {
    let uid = rustix::process::getuid().as_raw();
    let session = std::env::var_os("XDG_RUNTIME_DIR").filter(|dir| !dir.is_empty());
    let session = session.map(|dir| PathBuf::from(dir).join("tricurve"));
    let fits = |home: &PathBuf| {
        let longest = run_name(u32::MAX, u64::from(u32::MAX));
        let path = home.as_os_str().len() + 1 + longest.len();
        home.to_str().is_some_and(str::is_ascii) && path + prefix_of(&longest).len() <= MOST_PATH
    };
    let home = session
        .filter(fits)
        .unwrap_or_else(|| std::env::temp_dir().join(format!("tricurve-{uid}")));
    if !fits(&home) {
        let text = format!(
            "the path {} is too long for sockets, or not ASCII: set TMPDIR to a short one",
            home.display()
        );
        return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
    }
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(&home)
        .map_err(|e| io::Error::new(e.kind(), format!("{}: {e}", home.display())))?;
    let meta = fs::symlink_metadata(&home)?;
    if !meta.is_dir() || meta.uid() != uid || meta.mode() & 0o077 != 0 {
        let text = format!(
            "{} must be a folder of yours that nobody else can enter",
            home.display()
        );
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, text));
    }
    Ok(home)
}

impl RunDir {
    /// Makes a new run's folder.
    pub(crate) fn create() -> io::Result<Self> {
        let home = home()?;
        let now = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        let name = run_name(std::process::id(), now.as_secs());
        let prefix = prefix_of(&name);
        let path = home.join(&name);
        // Held before it gets the name by which others find it: they would take it for a dead run's.
        let shared = Path::new(SHARED_MEMORY);
        let (unnamed, named) = (
            shared.join(format!(".{prefix}{ALIVE}")),
            shared.join(format!("{prefix}{ALIVE}")),
        );
        let alive = File::create(&unnamed)
            .map_err(|e| io::Error::new(e.kind(), format!("{}: {e}", unnamed.display())))?;
        flock(&alive, FlockOperation::NonBlockingLockShared)?;
        fs::rename(&unnamed, &named)?;
        // Complete before it gets the name by which others find it.
        let unnamed = home.join(format!(".{name}"));
        DirBuilder::new().mode(0o700).create(&unnamed)?;
        let lock = File::create(unnamed.join(LAUNCHER))?;
        flock(&lock, FlockOperation::NonBlockingLockExclusive)?;
        File::create(unnamed.join(NODES))?;
        fs::write(unnamed.join(PREFIX), &prefix)?;
        fs::rename(&unnamed, &path)?;
        Ok(Self {
            path,
            prefix,
            _lock: lock,
            _alive: alive,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn prefix(&self) -> &str {
        &self.prefix
    }
}

impl Drop for RunDir {
    fn drop(&mut self) {
        // Best effort: what cannot be removed now is removed by the next run or by `tricurve clean`.
        sweep(&self.path).unwrap_or_default();
    }
}

/// The name of a run: short, since it stands twice in the name of every socket.
fn run_name(pid: u32, seconds: u64) -> String {
    format!("{pid:x}-{seconds:x}")
}

fn prefix_of(name: &str) -> String {
    format!("{PREFIXES}{name}_")
}

/// A node's share of its run's folder.
#[derive(Debug)]
pub(crate) struct Share {
    path: PathBuf,
    lock: Option<File>,
    alive: Option<File>,
}

impl Share {
    /// Enters the run's folder.
    pub(crate) fn enter(path: &Path) -> io::Result<Self> {
        let lock = File::open(path.join(NODES))?;
        flock(&lock, FlockOperation::NonBlockingLockShared)?;
        let prefix = fs::read_to_string(path.join(PREFIX))?;
        let alive = File::open(Path::new(SHARED_MEMORY).join(format!("{prefix}{ALIVE}")))?;
        flock(&alive, FlockOperation::NonBlockingLockShared)?;
        Ok(Self {
            path: path.to_owned(),
            lock: Some(lock),
            alive: Some(alive),
        })
    }
}

impl Drop for Share {
    /// Leaves the folder; the last one out removes what is left of a run whose launcher is dead.
    fn drop(&mut self) {
        self.lock = None;
        self.alive = None;
        if is_abandoned(&self.path) {
            sweep(&self.path).unwrap_or_default();
        }
    }
}

/// The folders of this user's runs that are alive, by name.
pub(crate) fn alive() -> io::Result<Vec<PathBuf>> {
    let runs = fs::read_dir(home()?)?.flatten().map(|entry| entry.path());
    let mut runs: Vec<PathBuf> = runs.filter(|run| is_alive(run)).collect();
    runs.sort();
    Ok(runs)
}

/// Whether a run's launcher is alive.
pub(crate) fn is_alive(run: &Path) -> bool {
    let is_named = run
        .file_name()
        .is_some_and(|name| !name.as_encoded_bytes().starts_with(b"."));
    is_named
        && File::open(run.join(LAUNCHER))
            .is_ok_and(|lock| flock(&lock, FlockOperation::NonBlockingLockShared).is_err())
}

/// Whether neither the launcher nor any node of a run is alive.
fn is_abandoned(run: &Path) -> bool {
    let free = |name: &str| {
        File::open(run.join(name))
            .is_ok_and(|f| flock(&f, FlockOperation::NonBlockingLockExclusive).is_ok())
    };
    free(LAUNCHER) && free(NODES)
}

/// Removes a run's folder and shared memory; gives back the bytes of shared memory set free.
fn sweep(run: &Path) -> io::Result<u64> {
    let prefix = fs::read_to_string(run.join(PREFIX)).unwrap_or_default();
    let bytes = match prefix.starts_with(PREFIXES) {
        true => sweep_shared_memory(&prefix)?,
        false => 0,
    };
    match fs::remove_dir_all(run) {
        // Somebody else swept at the same time.
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(bytes),
    }
}

/// Removes the shared memory of this prefix, what says whether its run is alive last.
fn sweep_shared_memory(prefix: &str) -> io::Result<u64> {
    let mut bytes = 0;
    let alive = format!("{prefix}{ALIVE}");
    for entry in fs::read_dir(SHARED_MEMORY)?.flatten() {
        let name = entry.file_name();
        if name.to_string_lossy().starts_with(prefix) && *name != *alive {
            bytes += entry.metadata().map_or(0, |meta| meta.blocks() * 512);
            fs::remove_file(entry.path()).unwrap_or_default();
        }
    }
    fs::remove_file(Path::new(SHARED_MEMORY).join(alive)).unwrap_or_default();
    Ok(bytes)
}

/// Sweeps up after all dead runs; gives back how many there were and how many bytes they held.
pub(crate) fn clean() -> io::Result<(usize, u64)> {
    let (mut runs, mut bytes) = (BTreeSet::new(), 0);
    // Shared memory first, also of runs whose folder went before it, as at a logout, or lies in another session's. A
    // node that is just ending lets go of its run's folder before it does of the shared memory: what is dead here
    // is dead below, never the other way round, which would leave a folder that nothing belongs to.
    for prefix in dead_prefixes()? {
        bytes += sweep_shared_memory(&prefix)?;
        runs.insert(prefix);
    }
    for entry in fs::read_dir(home()?)?.flatten() {
        if entry.path().join(LAUNCHER).exists() && is_abandoned(&entry.path()) {
            bytes += sweep(&entry.path())?;
            runs.insert(prefix_of(&entry.file_name().to_string_lossy()));
        }
    }
    Ok((runs.len(), bytes))
}

/// The prefixes of this user's shared memory that no process holds any more.
fn dead_prefixes() -> io::Result<BTreeSet<String>> {
    let uid = rustix::process::getuid().as_raw();
    let mut prefixes = BTreeSet::new();
    for entry in fs::read_dir(SHARED_MEMORY)?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_own = entry.metadata().is_ok_and(|meta| meta.uid() == uid);
        let run = name
            .strip_prefix(PREFIXES)
            .and_then(|rest| rest.split_once('_'));
        if let Some((run, _)) = run.filter(|_| is_own) {
            prefixes.insert(prefix_of(run));
        }
    }
    let is_dead = |prefix: &String| match File::open(
        Path::new(SHARED_MEMORY).join(format!("{prefix}{ALIVE}")),
    ) {
        Ok(alive) => flock(&alive, FlockOperation::NonBlockingLockExclusive).is_ok(),
        Err(error) => error.kind() == io::ErrorKind::NotFound,
    };
    prefixes.retain(is_dead);
    Ok(prefixes)
}

/// Free bytes of shared memory.
pub(crate) fn free_bytes() -> io::Result<u64> {
    let stat = rustix::fs::statvfs(SHARED_MEMORY)?;
    Ok(stat.f_bavail * stat.f_frsize)
}
