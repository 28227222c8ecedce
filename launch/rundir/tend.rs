//! Keeps a run's folder: keeps it young, and makes it anew when somebody removed it while the graph runs.
//!
//! The graph itself goes on without it: what its nodes share they hold open. But who comes later finds nothing, neither a
//! command nor a node that takes a dead one's place. So the launcher knows what lies in the folder, and looks.

use std::collections::BTreeMap;
use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use messages::bus::socket_of;
use rustix::fs::{AtFlags, CWD, FlockOperation, Timespec, Timestamps, UTIME_NOW, utimensat};

use super::{
    ALIVE, RunDir, SHARED_MEMORY, fits, in_temporary, locked_folder, make_alive, make_home, name_of,
};

/// The folder in which iceoryx2 describes the services that there are.
pub(super) const SERVICES: &str = "services";
/// The folder in which it says who takes part.
pub(super) const MEMBERS: &str = "nodes";

/// How often what is in the folder is made young: agers remove nothing that was changed within days.
pub(super) const TOUCH_EVERY: Duration = Duration::from_secs(3600);

/// What befell the folder while the graph ran.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Befell {
    /// What was removed.
    pub(crate) what: &'static str,
    /// Where the folder is now, when it could not be made anew where it was.
    pub(crate) moved_to: Option<PathBuf>,
    /// Whether the names of shared memory are gone: then nobody can join.
    pub(crate) is_closed: bool,
}

/// What lies in the folder, as it was seen last.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// By path in the folder: mode and bytes.
    files: BTreeMap<PathBuf, (u32, Vec<u8>)>,
    /// When the folder and that of the services were changed last.
    changed: [Option<SystemTime>; 2],
    /// Folders in it, locked too.
    folders: BTreeMap<PathBuf, File>,
    has_socket: bool,
}

impl Known {
    pub(super) fn forget_services(&mut self) {
        self.files.retain(|path, _| !path.starts_with(SERVICES));
        self.folders.clear();
        self.changed = [None; 2];
    }

    /// Learns what lies in the folder, where that has changed.
    fn learn(&mut self, root: &Path) -> io::Result<()> {
        let changed = |path: &Path| fs::metadata(path).and_then(|meta| meta.modified()).ok();
        let folders = [root.to_owned(), root.join(SERVICES)];
        let now = [changed(&folders[0]), changed(&folders[1])];
        if now == self.changed {
            return Ok(());
        }
        let (mut files, mut is_all) = (BTreeMap::new(), true);
        for folder in folders.iter().filter(|folder| folder.is_dir()) {
            for entry in fs::read_dir(folder)?.flatten() {
                let path = entry.path();
                let (Ok(name), Ok(meta)) = (path.strip_prefix(root), entry.metadata()) else {
                    continue;
                };
                let (name, is_named) = (name.to_owned(), !is_hidden(&path));
                if meta.is_dir() {
                    self.lock(&path, name);
                } else if meta.is_file() && is_named {
                    // One that may not be read yet is still being written.
                    match fs::read(&path) {
                        Ok(bytes) if meta.mode() & 0o400 != 0 => {
                            files.insert(name, (meta.mode() & 0o777, bytes));
                        }
                        _ => is_all = false,
                    }
                }
            }
        }
        self.has_socket |= socket_of(root).exists();
        self.files = files;
        if is_all {
            self.changed = now;
        }
        Ok(())
    }

    fn lock(&mut self, path: &Path, name: PathBuf) {
        if !self.folders.contains_key(&name)
            && let Ok(folder) = locked_folder(path, FlockOperation::NonBlockingLockShared)
        {
            self.folders.insert(name, folder);
        }
    }

    /// Whether something is gone that nobody but an ager removes.
    fn is_missed(&self, root: &Path) -> bool {
        let mut own = self.files.keys();
        let is_own = |path: &Path| path.parent() == Some(Path::new(""));
        own.any(|path| is_own(path) && !root.join(path).exists())
            || self.has_socket && !socket_of(root).exists()
    }

    /// Writes again what is gone.
    fn restore(&self, root: &Path) -> io::Result<()> {
        let mut folders = DirBuilder::new();
        folders.recursive(true).mode(0o700);
        for (path, (mode, bytes)) in &self.files {
            let path = root.join(path);
            if path.exists() {
                continue;
            }
            if let Some(folder) = path.parent() {
                folders.create(folder)?;
            }
            // Nobody finds half of it.
            let unnamed = path.with_extension("new");
            let mut options = OpenOptions::new();
            let file = options.write(true).create(true).truncate(true).mode(0o600);
            io::Write::write_all(&mut file.open(&unnamed)?, bytes)?;
            fs::set_permissions(&unnamed, Permissions::from_mode(*mode))?;
            fs::rename(&unnamed, &path)?;
        }
        Ok(())
    }
}

impl RunDir {
    /// Looks after the folder; says what befell it since it was looked after last, when it had to be made anew.
    ///
    /// # Errors
    /// When it is gone and cannot be made anew.
    pub(crate) fn tend(&mut self) -> io::Result<Option<Befell>> {
        let is_closed = !is_at(&self.alive, &self.alive_path());
        if is_closed {
            self.alive = make_alive(&self.prefix)?;
        }
        let is_gone = !is_at(&self.lock, &self.path);
        if !is_gone && !self.known.is_missed(&self.path) {
            self.known.learn(&self.path)?;
            self.keep_young();
            let what = "its shared memory";
            return Ok(is_closed.then_some(Befell {
                what,
                moved_to: None,
                is_closed,
            }));
        }
        let before = self.path.clone();
        if is_gone {
            self.make_anew()?;
        }
        self.known.restore(&self.path)?;
        self.known.has_socket = false;
        self.known.folders.clear();
        self.known.changed = [None; 2];
        Ok(Some(Befell {
            what: match (is_gone, is_closed) {
                (true, true) => "its folder, and its shared memory",
                (true, false) => "its folder",
                (false, true) => "what was in its folder, and its shared memory",
                (false, false) => "what was in its folder",
            },
            moved_to: (self.path != before).then(|| self.path.clone()),
            is_closed,
        }))
    }

    fn alive_path(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{}{ALIVE}", self.prefix))
    }

    /// Makes the folder anew: where it was, or where temporary files are when the session's folder is gone for good.
    fn make_anew(&mut self) -> io::Result<()> {
        let name = name_of(&self.path);
        let make = |home: &Path| -> io::Result<_> {
            make_home(home)?;
            let path = home.join(&name);
            let made = DirBuilder::new().mode(0o700).create(&path);
            match made {
                // A node that found it gone was faster, and left it open to others.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    fs::set_permissions(&path, Permissions::from_mode(0o700))?;
                }
                made => made?,
            }
            let lock = locked_folder(&path, FlockOperation::NonBlockingLockExclusive)?;
            let home = locked_folder(home, FlockOperation::NonBlockingLockShared)?;
            Ok((path, lock, home))
        };
        let home = self.path.parent().unwrap_or(Path::new("/")).to_owned();
        let other = in_temporary();
        let made = make(&home).or_else(|error| match other != home && fits(&other) {
            true => make(&other),
            false => Err(error),
        });
        (self.path, self.lock, self._home) = made?;
        Ok(())
    }

    /// Makes all that is in the folder young, now and then.
    fn keep_young(&mut self) {
        if Instant::now() < self.next_touch {
            return;
        }
        self.next_touch = Instant::now() + TOUCH_EVERY;
        if let Some(home) = self.path.parent() {
            touch(home);
        }
        touch_all(&self.path);
    }
}

fn is_hidden(path: &Path) -> bool {
    name_of(path).starts_with('.')
}

/// Whether what is held is still what is found at this path.
fn is_at(held: &File, path: &Path) -> bool {
    let (held, found) = (held.metadata(), fs::symlink_metadata(path));
    match (held, found) {
        (Ok(held), Ok(found)) => (held.dev(), held.ino()) == (found.dev(), found.ino()),
        _ => false,
    }
}

/// Makes a file young; that it cannot be made so is no harm yet.
fn touch(path: &Path) {
    let now = Timespec {
        tv_sec: 0,
        tv_nsec: UTIME_NOW,
    };
    let times = Timestamps {
        last_access: now,
        last_modification: now,
    };
    utimensat(CWD, path, &times, AtFlags::SYMLINK_NOFOLLOW).unwrap_or_default();
}

fn touch_all(path: &Path) {
    touch(path);
    for entry in fs::read_dir(path).into_iter().flatten().flatten() {
        match entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            true => touch_all(&entry.path()),
            false => touch(&entry.path()),
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn what_an_ager_removed_is_written_again_with_its_mode_and_what_is_there_stays() {
        let root = std::env::temp_dir().join(format!("tricurve-tend-{}", std::process::id()));
        fs::create_dir_all(root.join(SERVICES)).unwrap();
        let (orders, service) = (
            root.join("orders.json"),
            root.join(SERVICES).join("a.service"),
        );
        fs::write(&orders, "orders").unwrap();
        fs::write(&service, "service").unwrap();
        fs::set_permissions(&service, Permissions::from_mode(0o400)).unwrap();
        let mut known = Known::default();
        known.learn(&root).unwrap();
        assert!(!known.is_missed(&root));
        // A service that nobody uses any more goes by itself.
        fs::remove_file(&service).unwrap();
        assert!(!known.is_missed(&root));
        fs::remove_dir_all(&root).unwrap();
        assert!(known.is_missed(&root));
        fs::create_dir(&root).unwrap();
        fs::write(&orders, "newer").unwrap();
        known.restore(&root).unwrap();
        assert_eq!(fs::read_to_string(&orders).unwrap(), "newer");
        assert_eq!(fs::read_to_string(&service).unwrap(), "service");
        assert_eq!(fs::metadata(&service).unwrap().mode() & 0o777, 0o400);
        fs::remove_dir_all(&root).unwrap();
    }
}
