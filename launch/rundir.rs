//! The run's folder: private to the user, locked while its launcher lives, swept when everybody is gone.

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

/// A run's folder, locked.
#[derive(Debug)]
pub(crate) struct RunDir {
    path: PathBuf,
    prefix: String,
    _lock: File,
}

/// The folder of all runs of this user.
fn home() -> io::Result<PathBuf> {
    let uid = rustix::process::getuid().as_raw();
    let home = match std::env::var_os("XDG_RUNTIME_DIR").filter(|dir| !dir.is_empty()) {
        Some(dir) => PathBuf::from(dir).join("tricurve"),
        None => std::env::temp_dir().join(format!("tricurve-{uid}")),
    };
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(&home)?;
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
        let pid = std::process::id();
        let now = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        let name = format!("{pid}-{:x}", now.as_micros());
        let path = home.join(&name);
        // iceoryx2 takes no longer root paths.
        if path.as_os_str().len() > 90 {
            let text = format!(
                "the path {} is too long for shared memory's names",
                path.display()
            );
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        }
        DirBuilder::new().mode(0o700).create(&path)?;
        let lock = File::create(path.join(LAUNCHER))?;
        flock(&lock, FlockOperation::NonBlockingLockExclusive)?;
        File::create(path.join(NODES))?;
        let prefix = format!("tricurve_{name}_");
        fs::write(path.join(PREFIX), &prefix)?;
        Ok(Self {
            path,
            prefix,
            _lock: lock,
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

/// A node's share of its run's folder.
#[derive(Debug)]
pub(crate) struct Share {
    path: PathBuf,
    lock: Option<File>,
}

impl Share {
    /// Enters the run's folder.
    pub(crate) fn enter(path: &Path) -> io::Result<Self> {
        let lock = File::open(path.join(NODES))?;
        flock(&lock, FlockOperation::NonBlockingLockShared)?;
        Ok(Self {
            path: path.to_owned(),
            lock: Some(lock),
        })
    }
}

impl Drop for Share {
    /// Leaves the folder; the last one out removes what is left of a run whose launcher is dead.
    fn drop(&mut self) {
        self.lock = None;
        if is_abandoned(&self.path) {
            sweep(&self.path).unwrap_or_default();
        }
    }
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
    let mut bytes = 0;
    let prefix = fs::read_to_string(run.join(PREFIX)).unwrap_or_default();
    if prefix.starts_with("tricurve_") {
        for entry in fs::read_dir(SHARED_MEMORY)?.flatten() {
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                bytes += entry.metadata().map_or(0, |meta| meta.blocks() * 512);
                fs::remove_file(entry.path()).unwrap_or_default();
            }
        }
    }
    fs::remove_dir_all(run)?;
    Ok(bytes)
}

/// Sweeps up after all dead runs; gives back how many there were and how many bytes they held.
pub(crate) fn clean() -> io::Result<(usize, u64)> {
    let (mut runs, mut bytes) = (0, 0);
    for entry in fs::read_dir(home()?)?.flatten() {
        if entry.path().join(LAUNCHER).exists() && is_abandoned(&entry.path()) {
            bytes += sweep(&entry.path())?;
            runs += 1;
        }
    }
    Ok((runs, bytes))
}

/// Free bytes of shared memory.
pub(crate) fn free_bytes() -> io::Result<u64> {
    let stat = rustix::fs::statvfs(SHARED_MEMORY)?;
    Ok(stat.f_bavail * stat.f_frsize)
}
