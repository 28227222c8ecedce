//! The run's folder: private to the user, locked while its launcher lives, swept when everybody is gone.
//!
//! What lies in a folder for temporary files is aged: systemd-tmpfiles removes what is old, and spares only what is locked
//! as a folder, with all that is in it. So the launcher locks the folder itself, keeps what is in it young for agers that
//! know no locks, and makes it [anew](tend) when it is gone all the same, as at a logout.

mod tend;

use std::collections::BTreeSet;
use std::fs::{self, DirBuilder, File, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use rustix::fs::{FlockOperation, flock};

pub(crate) use tend::Befell;

/// Where POSIX shared memory lives.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Held, shared, by every node while it lives.
const NODES: &str = "nodes.lock";
/// Says what the names of what the nodes share begin with.
const BUS: &str = "bus";

/// What the names of all runs' shared memory begin with.
const PREFIXES: &str = "tricurve_";
/// In shared memory, behind the run's prefix: locked by launcher and nodes while they live, so that what a run left is
/// known even when its folder is gone.
const ALIVE: &str = "alive";

/// How often a run may begin again before names are used once more: one digit.
const MOST_BEGINNINGS: u64 = 35;
/// The greatest number of a process that the kernel gives.
const LARGEST_PID: u32 = 1 << 22;
/// The longest path of a socket, less what iceoryx2 puts behind folder and prefix: a slash, 30 digits and `.event`.
const MOST_PATH: usize = 107 - 37;
/// A folder that is being made gets its name at once; one that has none after this long never will.
const LONGEST_BIRTH: Duration = Duration::from_secs(60);

/// A run's folder, locked.
#[derive(Debug)]
pub(crate) struct RunDir {
    path: PathBuf,
    prefix: String,
    /// How often its nodes began again with nothing of what they shared before.
    beginning: u64,
    lock: File,
    /// The folder of all runs, which is not to be removed either.
    _home: File,
    alive: File,
    known: tend::Known,
    next_touch: Instant,
}

/// The folder of all runs in the session's own folder.
fn in_session(session: &Path) -> PathBuf {
    session.join("tricurve")
}

/// The session's folder, as the system makes one for each user who is logged in, and removes it at the logout.
fn system_session() -> PathBuf {
    let uid = rustix::process::getuid().as_raw();
    PathBuf::from(format!("/run/user/{uid}"))
}

/// The folder of all runs among temporary files.
fn in_temporary() -> PathBuf {
    let uid = rustix::process::getuid().as_raw();
    std::env::temp_dir().join(format!("tricurve-{uid}"))
}

/// Whether paths in this folder are short enough for sockets, and ASCII.
fn fits(home: &Path) -> bool {
    let longest = run_name(LARGEST_PID, now_seconds());
    let path = home.as_os_str().len() + 1 + longest.len();
    let prefix = bus_prefix(&prefix_of(&longest), MOST_BEGINNINGS);
    home.to_str().is_some_and(str::is_ascii) && path + prefix.len() <= MOST_PATH
}

/// The folder of all runs of this user: in the session's own if there is one still, and it leaves room for the names of
/// sockets.
fn home() -> io::Result<PathBuf> {
    let session = std::env::var_os("XDG_RUNTIME_DIR").filter(|dir| !dir.is_empty());
    let session = session.map(|dir| in_session(Path::new(&dir)));
    // What is there is to be right; only what cannot be there, as after a logout, is done without.
    let can_be = |home: &PathBuf| match make_home(home) {
        Ok(()) => true,
        Err(_) => home.exists(),
    };
    let home = session
        .filter(|home| fits(home) && can_be(home))
        .unwrap_or_else(in_temporary);
    if !fits(&home) {
        let text = format!(
            "the path {} is too long for sockets, or not ASCII: set TMPDIR to a short one",
            home.display()
        );
        return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
    }
    make_home(&home)?;
    Ok(home)
}

/// All folders in which runs of this user can be: a run outlives the session in which it was started, and is then looked
/// for from another one, or from none. Who has set a folder of his own means that one.
fn homes() -> io::Result<Vec<PathBuf>> {
    let own = home()?;
    let system = in_session(&system_session());
    let temporary = in_temporary();
    let mut homes = vec![own];
    if [&system, &temporary].contains(&&homes[0]) {
        let is_other = |home: &PathBuf| *home != homes[0] && is_private(home).is_ok();
        homes.extend(
            [system, temporary]
                .into_iter()
                .filter(is_other)
                .collect::<Vec<_>>(),
        );
    }
    Ok(homes)
}

/// Makes the folder of all runs, or takes the one that is there when nobody else can enter.
fn make_home(home: &Path) -> io::Result<()> {
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(home)
        .map_err(|e| io::Error::new(e.kind(), format!("{}: {e}", home.display())))?;
    is_private(home)
}

/// Whether a folder is the user's own. What others may only read is closed to them: a program of this user's that found it
/// gone made it anew like that. Where others could write, nobody knows what they left.
fn is_private(home: &Path) -> io::Result<()> {
    let meta = fs::symlink_metadata(home)?;
    let is_own = meta.is_dir() && meta.uid() == rustix::process::getuid().as_raw();
    if !is_own || meta.mode() & 0o022 != 0 {
        let text = format!(
            "{} must be a folder of yours that nobody else can enter: remove it, or set TMPDIR to another place",
            home.display()
        );
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, text));
    }
    if meta.mode() & 0o777 != 0o700 {
        fs::set_permissions(home, Permissions::from_mode(0o700))?;
    }
    Ok(())
}

/// A folder, locked as long as it is held.
fn locked_folder(path: &Path, how: FlockOperation) -> io::Result<File> {
    let folder = File::open(path)?;
    flock(&folder, how)?;
    Ok(folder)
}

/// Makes the file in shared memory that says whether a run is alive, held before it gets the name by which others find it:
/// they would take it for a dead run's.
fn make_alive(prefix: &str) -> io::Result<File> {
    let shared = Path::new(SHARED_MEMORY);
    let (unnamed, named) = (
        shared.join(format!(".{prefix}{ALIVE}")),
        shared.join(format!("{prefix}{ALIVE}")),
    );
    let alive = File::create(&unnamed)
        .map_err(|e| io::Error::new(e.kind(), format!("{}: {e}", unnamed.display())))?;
    flock(&alive, FlockOperation::NonBlockingLockShared)?;
    fs::rename(&unnamed, &named)?;
    Ok(alive)
}

impl RunDir {
    /// Makes a new run's folder.
    pub(crate) fn create() -> io::Result<Self> {
        let home = home()?;
        let name = run_name(std::process::id(), now_seconds());
        let prefix = prefix_of(&name);
        let path = home.join(&name);
        let alive = make_alive(&prefix)?;
        // Complete before it gets the name by which others find it.
        let unnamed = home.join(format!(".{name}"));
        DirBuilder::new().mode(0o700).create(&unnamed)?;
        let lock = locked_folder(&unnamed, FlockOperation::NonBlockingLockExclusive)?;
        File::create(unnamed.join(NODES))?;
        fs::write(unnamed.join(BUS), &prefix)?;
        fs::rename(&unnamed, &path)?;
        Ok(Self {
            path,
            prefix,
            beginning: 0,
            lock,
            _home: locked_folder(&home, FlockOperation::NonBlockingLockShared)?,
            alive,
            known: tend::Known::default(),
            next_touch: Instant::now() + tend::TOUCH_EVERY,
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// What the names of what the nodes share begin with.
    pub(crate) fn bus_prefix(&self) -> String {
        bus_prefix(&self.prefix, self.beginning)
    }

    /// Lets the nodes, which are all dead, begin again with nothing of what they shared before: with names of their own,
    /// so that a guest who is still there, and lets go of what it holds, takes nothing of theirs away.
    pub(crate) fn begin_again(&mut self) -> io::Result<()> {
        sweep_shared_memory(&self.prefix, Some(ALIVE))?;
        let shared = bus_prefix(&self.prefix, self.beginning);
        self.beginning = self.beginning % MOST_BEGINNINGS + 1;
        self.known.forget_services();
        for entry in fs::read_dir(&self.path)?.flatten() {
            let name = entry.file_name();
            let is_folder = name == tend::SERVICES || name == tend::MEMBERS;
            match (
                is_folder,
                name.as_encoded_bytes().starts_with(shared.as_bytes()),
            ) {
                (true, _) => self.take_away(&entry.path())?,
                // A guest removes its own, too.
                (_, true) => match fs::remove_file(entry.path()) {
                    Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                    _ => {}
                },
                _ => {}
            }
        }
        self.write(BUS, self.bus_prefix().as_bytes())
    }

    /// Removes a folder in which a guest, who comes or goes just now, may write meanwhile: where it is taken from it is not
    /// found any more, and what is still written into it goes with the run's folder.
    fn take_away(&self, folder: &Path) -> io::Result<()> {
        let unnamed = format!(".{}-{}", name_of(folder), self.beginning);
        let unnamed = self.path.join(unnamed);
        fs::rename(folder, &unnamed)?;
        fs::remove_dir_all(unnamed).or(Ok(()))
    }

    /// Writes a file of the folder: whole, or not at all.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let unnamed = self.path.join(format!(".{name}"));
        fs::write(&unnamed, bytes)?;
        fs::rename(unnamed, self.path.join(name))
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
    format!("{}{}", beginning_of(pid), digits(seconds))
}

/// What the names of this launcher's runs begin with.
pub(crate) fn beginning_of(pid: u32) -> String {
    format!("{}-", digits(u64::from(pid)))
}

fn now_seconds() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.unwrap_or_default().as_secs()
}

/// A number in as few characters as names may have: to the base of 36.
fn digits(mut number: u64) -> String {
    let mut digits = Vec::new();
    loop {
        digits.extend(char::from_digit((number % 36) as u32, 36));
        number /= 36;
        if number == 0 {
            return digits.into_iter().rev().collect();
        }
    }
}

/// Whether a folder is called as runs are.
fn is_run_name(name: &str) -> bool {
    let is_number = |part: &str| !part.is_empty() && part.chars().all(|c| c.is_digit(36));
    name.split_once('-')
        .is_some_and(|(pid, seconds)| is_number(pid) && is_number(seconds))
}

/// What the names of a run's shared memory begin with.
fn prefix_of(name: &str) -> String {
    format!("{PREFIXES}{name}_")
}

/// What those begin with that its nodes share since they began again so often.
fn bus_prefix(prefix: &str, beginning: u64) -> String {
    match beginning {
        0 => prefix.to_owned(),
        again => format!("{prefix}{}_", digits(again)),
    }
}

/// A run's name, which is that of its folder.
pub(crate) fn name_of(run: &Path) -> String {
    let name = run.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
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
        let prefix = prefix_of(&name_of(path));
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
    let mut runs = Vec::new();
    for home in homes()? {
        let entries = fs::read_dir(home)?.flatten().map(|entry| entry.path());
        runs.extend(entries.filter(|run| is_alive(run)));
    }
    runs.sort();
    Ok(runs)
}

/// Whether a run's launcher is alive.
pub(crate) fn is_alive(run: &Path) -> bool {
    is_run_name(&name_of(run))
        && File::open(run)
            .is_ok_and(|folder| flock(&folder, FlockOperation::NonBlockingLockShared).is_err())
}

/// Whether a run's launcher is alive and its nodes are still those of which a guest knows by this prefix.
pub(crate) fn goes_on(run: &Path, bus_prefix: &str) -> bool {
    // Without the file nobody knows: it is being made anew.
    is_alive(run) && fs::read_to_string(run.join(BUS)).map_or(true, |bus| bus == bus_prefix)
}

/// Whether neither the launcher nor any node of a run is alive.
fn is_abandoned(run: &Path) -> bool {
    let free = |path: &Path| match File::open(path) {
        Ok(file) => flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok(),
        Err(error) => error.kind() == io::ErrorKind::NotFound,
    };
    run.is_dir() && free(run) && free(&run.join(NODES))
}

/// Removes a run's folder and shared memory; gives back the bytes of shared memory set free.
fn sweep(run: &Path) -> io::Result<u64> {
    let bytes = sweep_shared_memory(&prefix_of(&name_of(run)), None)?;
    match fs::remove_dir_all(run) {
        // Somebody else swept at the same time.
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(bytes),
    }
}

/// Removes the shared memory of this prefix but for what is to stay, what says whether its run is alive last.
fn sweep_shared_memory(prefix: &str, but: Option<&str>) -> io::Result<u64> {
    let mut bytes = 0;
    let alive = format!("{prefix}{ALIVE}");
    for entry in fs::read_dir(SHARED_MEMORY)?.flatten() {
        let name = entry.file_name();
        if name.to_string_lossy().starts_with(prefix) && *name != *alive {
            bytes += entry.metadata().map_or(0, |meta| meta.blocks() * 512);
            fs::remove_file(entry.path()).unwrap_or_default();
        }
    }
    if but != Some(ALIVE) {
        fs::remove_file(Path::new(SHARED_MEMORY).join(alive)).unwrap_or_default();
    }
    Ok(bytes)
}

/// Sweeps up after all dead runs; gives back how many there were and how many bytes they held.
pub(crate) fn clean() -> io::Result<(usize, u64)> {
    let (mut runs, mut bytes) = (BTreeSet::new(), 0);
    // Shared memory first, also of runs whose folder went before it, as at a logout, or lies in another session's. A
    // node that is just ending lets go of its run's folder before it does of the shared memory: what is dead here
    // is dead below, never the other way round, which would leave a folder that nothing belongs to.
    for prefix in dead_prefixes()? {
        bytes += sweep_shared_memory(&prefix, None)?;
        runs.insert(prefix);
    }
    for home in homes()? {
        for entry in fs::read_dir(home)?.flatten() {
            let run = entry.path();
            if is_or_was_to_be_a_run(&run) && is_abandoned(&run) {
                bytes += sweep(&run)?;
                runs.insert(prefix_of(name_of(&run).trim_start_matches('.')));
            }
        }
    }
    Ok((runs.len(), bytes))
}

/// Whether a folder is a run's, or one of which somebody died who made it.
fn is_or_was_to_be_a_run(run: &Path) -> bool {
    let name = name_of(run);
    let is_old = || {
        let made = fs::metadata(run).and_then(|meta| meta.modified());
        made.is_ok_and(|made| made.elapsed().is_ok_and(|age| age > LONGEST_BIRTH))
    };
    match name.strip_prefix('.') {
        Some(name) => is_run_name(name) && is_old(),
        None => is_run_name(&name),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_usual_folder_for_temporary_files_of_a_users_own_leaves_room_for_the_names_of_sockets() {
        assert!(fits(Path::new("/tmp/tmp.XXXXXXXXXX/tricurve-1000")));
        assert!(!fits(Path::new(
            "/tmp/a folder of temporary files/tricurve-1000"
        )));
        assert!(!fits(Path::new("/tmp/für uns")));
    }

    #[test]
    fn runs_are_told_from_other_folders_by_their_names() {
        for name in [run_name(1, 0), run_name(LARGEST_PID, now_seconds())] {
            assert!(is_run_name(&name), "{name}");
        }
        for name in ["", "-", "kept", ".1-2", "1-", "1_2", "1-2_"] {
            assert!(!is_run_name(name), "{name}");
        }
        assert_eq!(run_name(LARGEST_PID, 36 * 36 - 1), "2hwcg-zz");
    }
}
