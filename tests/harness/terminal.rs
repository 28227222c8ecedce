//! Commands at a terminal: what they show, and what keys do.

use std::fs::File;
use std::io::Read as _;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex};

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, Winsize, tcgetattr, tcsetwinsize};

use super::{World, wait_until};

/// A command at a terminal of its own.
pub(crate) struct AtTerminal {
    pub(crate) program: Child,
    pub(crate) keys: File,
    terminal: File,
    seen: Arc<Mutex<Vec<u8>>>,
}

impl AtTerminal {
    pub(crate) fn start(world: &World, arguments: &[&str]) -> Self {
        let keys = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&keys).unwrap();
        unlockpt(&keys).unwrap();
        let name = ptsname(&keys, Vec::new()).unwrap();
        let flags = OFlags::RDWR | OFlags::NOCTTY;
        let terminal = rustix::fs::open(name.as_c_str(), flags, Mode::empty()).unwrap();
        let terminal = File::from(terminal);
        let size = Winsize {
            ws_row: 24,
            ws_col: 100,
            ws_xpixel: 0,
            ws_ypixel: 0,
        };
        tcsetwinsize(&terminal, size).unwrap();
        let keys = File::from(keys);
        let seen = Arc::new(Mutex::new(Vec::new()));
        let (mut screen, written) = (keys.try_clone().unwrap(), Arc::clone(&seen));
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(len @ 1..) = screen.read(&mut bytes) {
                written.lock().unwrap().extend_from_slice(&bytes[..len]);
            }
        });
        let stdio = || Stdio::from(terminal.try_clone().unwrap());
        let mut program = world.tricurve(arguments);
        program.stdin(stdio()).stdout(stdio()).stderr(stdio());
        Self {
            program: program.process_group(0).spawn().unwrap(),
            keys,
            terminal,
            seen,
        }
    }

    pub(crate) fn has_shown(&self, text: &str) -> bool {
        String::from_utf8_lossy(&self.seen.lock().unwrap()).contains(text)
    }

    pub(crate) fn takes_keys_raw(&self) -> bool {
        let modes = tcgetattr(&self.terminal).unwrap().local_modes;
        !modes.contains(LocalModes::ICANON)
    }

    /// Waits until it has ended and takes no keys any more.
    #[track_caller]
    pub(crate) fn ends(&mut self) {
        assert_eq!(self.program.wait().unwrap().code(), Some(0));
        assert!(!self.takes_keys_raw());
    }

    /// The same, of what has taken the whole screen: it gives that back too.
    #[track_caller]
    pub(crate) fn ends_well(mut self) {
        self.ends();
        wait_until("the screen is as it was", || self.has_shown("\x1b[?1049l"));
        wait_until("the cursor is there again", || self.has_shown("\x1b[?25h"));
    }
}
