//! How far viewers lag behind, as the system knows it: the bytes of each connection that have not arrived yet.

use std::collections::BTreeMap;
use std::fs;
use std::net::SocketAddr;

/// Established, in the kernel's table of connections.
const ESTABLISHED: &str = "01";

/// The connections to a port of this machine, and the bytes on their way that the other side has not taken yet.
///
/// From `/proc/self/net/tcp` and `tcp6` (proc_net_tcp(5)); elsewhere than on Linux nobody ever seems to lag.
pub(crate) fn unsent(port: u16) -> BTreeMap<SocketAddr, u64> {
    let mut viewers = BTreeMap::new();
    for table in ["/proc/self/net/tcp", "/proc/self/net/tcp6"] {
        let text = fs::read_to_string(table).unwrap_or_default();
        viewers.extend(
            text.lines()
                .skip(1)
                .filter_map(|line| connection(line, port)),
        );
    }
    viewers
}

/// A line of the table: `sl local:port remote:port state tx:rx …`, numbers in hexadecimal.
fn connection(line: &str, port: u16) -> Option<(SocketAddr, u64)> {
    let mut fields = line.split_whitespace().skip(1);
    let (local, remote, state, queues) = (
        fields.next()?,
        fields.next()?,
        fields.next()?,
        fields.next()?,
    );
    let (_, local_port) = local.rsplit_once(':')?;
    if state != ESTABLISHED || u16::from_str_radix(local_port, 16).ok()? != port {
        return None;
    }
    let unsent = u64::from_str_radix(queues.split_once(':')?.0, 16).ok()?;
    Some((address(remote)?, unsent))
}

/// An address as the kernel prints it: words in the machine's own order of bytes.
fn address(text: &str) -> Option<SocketAddr> {
    let (ip, port) = text.rsplit_once(':')?;
    let port = u16::from_str_radix(port, 16).ok()?;
    let words: Vec<[u8; 4]> = (0..ip.len() / 8)
        .map(|word| u32::from_str_radix(ip.get(8 * word..8 * word + 8)?, 16).ok())
        .map(|word| word.map(u32::to_ne_bytes))
        .collect::<Option<_>>()?;
    match words.as_slice() {
        [word] => Some((*word, port).into()),
        [_, _, _, _] => {
            let bytes: [u8; 16] = words.concat().try_into().ok()?;
            Some((bytes, port).into())
        }
        _ => None,
    }
}

/// What is known of one viewer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Viewer {
    /// Scans it was to get.
    pub(crate) offered: u64,
    /// Of these, those it did not get whole, because it had not taken earlier ones.
    pub(crate) missed: u64,
    /// How many in a row it lags behind.
    lag: u32,
}

/// All viewers, from scan to scan.
#[derive(Debug, Default)]
pub(crate) struct Viewers {
    known: BTreeMap<SocketAddr, Viewer>,
    /// Of viewers that have gone.
    gone: Viewer,
}

impl Viewers {
    /// Takes in how the connections stand before a scan goes out, and says whether to send it: not when every viewer still
    /// has `backlog` scans before it.
    pub(crate) fn admit(&mut self, unsent: &BTreeMap<SocketAddr, u64>, backlog: u32) -> bool {
        let gone: Vec<SocketAddr> = self
            .known
            .keys()
            .filter(|viewer| !unsent.contains_key(viewer))
            .copied()
            .collect();
        for viewer in gone {
            if let Some(last) = self.known.remove(&viewer) {
                self.gone.offered += last.offered;
                self.gone.missed += last.missed;
            }
        }
        let mut is_wanted = false;
        for (address, bytes) in unsent {
            let viewer = self.known.entry(*address).or_default();
            viewer.offered += 1;
            viewer.lag = match *bytes {
                0 => 0,
                _ => viewer.lag.saturating_add(1),
            };
            match viewer.lag < backlog {
                true => is_wanted = true,
                false => viewer.missed += 1,
            }
        }
        is_wanted
    }

    /// Notes scans that no viewer gets, because there was no time to make them for them.
    pub(crate) fn leave_out(&mut self, unsent: &BTreeMap<SocketAddr, u64>, scans: u64) {
        for address in unsent.keys() {
            let viewer = self.known.entry(*address).or_default();
            viewer.offered += scans;
            viewer.missed += scans;
        }
    }

    /// Scans that viewers were to get and did not get whole, of those they were to get.
    pub(crate) fn missed(&self) -> (u64, u64) {
        let all = self.known.values().chain([&self.gone]);
        all.fold((0, 0), |(missed, offered), viewer| {
            (missed + viewer.missed, offered + viewer.offered)
        })
    }

    /// The viewers that miss scans at the moment.
    pub(crate) fn slow(&self, backlog: u32) -> impl Iterator<Item = SocketAddr> + '_ {
        let slow = move |(_, viewer): &(&SocketAddr, &Viewer)| viewer.lag >= backlog;
        self.known.iter().filter(slow).map(|(address, _)| *address)
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn the_kernels_table_is_read() {
        let line = "   3: 0100007F:223D 0200007F:C001 01 00001A2B:00000000 01:00000014 00000000  0";
        let (address, unsent) = connection(line, 8765).unwrap();
        assert_eq!((address.port(), unsent), (0xC001, 0x1A2B));
        if cfg!(target_endian = "little") {
            assert_eq!(address.ip().to_string(), "127.0.0.2");
        }
        assert_eq!(connection(line, 8766), None);
        assert_eq!(connection(&line.replace(" 01 ", " 0A "), 8765), None);
        assert_eq!(connection("  sl  local_address rem_address", 8765), None);
    }

    #[test]
    fn a_connection_that_nobody_reads_fills_up_and_is_seen() {
        use std::io::Write as _;
        use std::net::{TcpListener, TcpStream};
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let viewer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (mut server, address) = listener.accept().unwrap();
        assert_eq!(unsent(port).get(&address), Some(&0));
        server.set_nonblocking(true).unwrap();
        while server.write(&[0; 65536]).is_ok() {}
        assert!(unsent(port)[&address] > 0);
        drop(viewer);
    }

    #[test]
    fn a_scan_goes_out_while_one_viewer_keeps_up_and_who_does_not_is_counted() {
        let [fast, slow]: [SocketAddr; 2] =
            ["127.0.0.1:1", "127.0.0.1:2"].map(|a| a.parse().unwrap());
        let mut viewers = Viewers::default();
        let both = BTreeMap::from([(fast, 0), (slow, 9)]);
        for _ in 0..5 {
            assert!(viewers.admit(&both, 2));
        }
        assert_eq!(viewers.missed(), (4, 10));
        assert_eq!(viewers.slow(2).collect::<Vec<_>>(), [slow]);
        let alone = BTreeMap::from([(slow, 9)]);
        assert!(!viewers.admit(&alone, 2));
        assert_eq!(viewers.missed(), (5, 11));
        assert!(viewers.admit(&BTreeMap::from([(slow, 0)]), 2));
        assert!(!viewers.admit(&BTreeMap::new(), 2));
        viewers.leave_out(&both, 1);
        assert_eq!(viewers.missed(), (7, 14));
    }
}
