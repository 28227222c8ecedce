//! Whether shared memory has room for all scans under way: said before the start, with what helps.

use messages::bus::Run;
use messages::settings::Settings as _;
use messages::words::counted;
use serde_json::Value;

use crate::Failure;
use crate::graph::Graph;
use crate::rundir::{self, SHARED_MEMORY};

/// How much of the worst case, every pixel a zero-crossing of a long curve, a scan can need: white noise, which no
/// picture exceeds, has a zero-crossing at less than a third of its pixels in the finest channel allowed.
const DENSEST: f64 = 1.0 / 3.0;

/// Scans that are under way when nobody says how many: with one before each stage that works and one in it.
const BY_ITSELF: usize = 8;

/// How many scans may be under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InFlight {
    /// So many.
    Set(usize),
    /// As many as there is room for, up to [`BY_ITSELF`].
    Fitting,
}

impl InFlight {
    /// What the settings of the node say that lets scans in; one that has no such setting works through one at a time.
    pub(crate) fn of(source: &Value) -> Self {
        match source.get("in_flight") {
            Some(Value::Null) => Self::Fitting,
            said => Self::Set(said.and_then(Value::as_u64).unwrap_or(1) as usize),
        }
    }

    /// The most that it may come to.
    pub(crate) fn most(self) -> usize {
        match self {
            Self::Set(set) => set,
            Self::Fitting => BY_ITSELF,
        }
    }
}

/// Says before the start when shared memory could run full: the kernel would kill a node in the middle of its work. Lets in
/// fewer scans at a time where nobody said how many, and then says so.
///
/// # Errors
/// When it has too little room.
pub(crate) fn fit(
    run: &mut Run,
    graph: &Graph,
    in_flight: InFlight,
) -> Result<Option<String>, Failure> {
    let free = rundir::free_bytes()
        .map_err(|e| Failure::failed(format!("cannot look at {SHARED_MEMORY}: {e}")))?;
    let reach = run.rig.reach();
    let scans = run.in_flight as u64 + reach;
    let scan = run.worst_case_bytes() / scans.max(1);
    let scan = (scan as f64 * DENSEST).ceil() as u64;
    let need = scan * scans;
    if free >= need {
        return Ok(None);
    }
    let room = free / scan.max(1);
    let [need_mb, free_mb] = [need as f64 / 1e6, free as f64 / 1e6];
    let depended_on = match reach {
        0 => String::new(),
        _ => format!(" and {reach} before them that they depend on"),
    };
    let fits = room.saturating_sub(reach) as usize;
    if in_flight == InFlight::Fitting && fits >= 1 {
        let why = format!(
            "{} at a time, where {} would be quicker: {SHARED_MEMORY} has {:.0} MB free, and {} of {} under way{depended_on} \
             can need {:.0} MB (in a container: --shm-size={}m)",
            counted(fits as u64, "scan"),
            run.in_flight,
            free_mb.floor(),
            counted(run.in_flight as u64, "scan"),
            run.rig.size,
            need_mb.ceil(),
            (need >> 20) + 1,
        );
        run.in_flight = fits;
        return Ok(Some(why));
    }
    let less = Less {
        source: graph.source_name(),
        in_flight: run.in_flight as u64,
        room,
        reach,
    };
    let map = serde_json::from_value(graph.settings_of("map").clone());
    let map = map.ok().filter(|_| graph.has("map"));
    Err(Failure::failed(format!(
        "{} of {} under way{depended_on} can need {:.0} MB of shared memory, {SHARED_MEMORY} has {:.0} MB free: make it larger \
         (in a container: --shm-size={}m){}",
        counted(run.in_flight as u64, "scan"),
        run.rig.size,
        need_mb.ceil(),
        free_mb.floor(),
        (need >> 20) + 1,
        less.advice(map),
    )))
}

/// What there is room for, and what is asked for.
#[derive(Clone, Copy, Debug)]
struct Less<'a> {
    /// The node that lets scans in.
    source: &'a str,
    in_flight: u64,
    /// Scans that there is room for.
    room: u64,
    /// Scans before a scan that it depends on.
    reach: u64,
}

impl Less<'_> {
    /// What else helps; each with what it takes besides.
    fn advice(&self, map: Option<map::Settings>) -> String {
        if let Some(fewer) = self.fewer(self.reach) {
            return format!(", or {}", fewer.trim_start());
        }
        let Some(map) = map else {
            return ", or take smaller pictures, or fewer channels or views".to_owned();
        };
        let without = self.reach - map.reach();
        let windows = (2..=map.window).rev();
        let shorter = windows.map(|window| {
            let map = map::Settings {
                window,
                apart: 0.0,
                ..map.clone()
            };
            (map.check().is_ok(), window, without + map.reach())
        });
        let mut fitting = shorter.filter_map(|(is_sound, window, reach)| {
            let fewer = self.fewer(reach).filter(|_| is_sound)?;
            let window = match window == map.window {
                true => String::new(),
                false => format!(" --set map.window={window}"),
            };
            Some(format!(", or --set map.apart=0{window}{fewer}"))
        });
        fitting.next().unwrap_or_else(|| match self.fewer(without) {
            Some(fewer) if fewer.is_empty() => ", or leave [map] away in a graph file".to_owned(),
            Some(fewer) => format!(", or leave [map] away in a graph file and{fewer}"),
            None => ", or take smaller pictures or fewer channels".to_owned(),
        })
    }

    /// How many may be under way when each depends on so many before it, said when it is fewer; `None` when not one may.
    fn fewer(&self, reach: u64) -> Option<String> {
        match self.room.checked_sub(reach) {
            None | Some(0) => None,
            Some(fits) if fits >= self.in_flight => Some(String::new()),
            Some(fits) => Some(format!(" --set {}.in_flight={fits}", self.source)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advice(room: u64, map: bool) -> String {
        let map = map.then(map::Settings::default);
        let reach = map.as_ref().map_or(0, |map| 20 + map.reach());
        let less = Less {
            source: "replay",
            in_flight: 8,
            room,
            reach,
        };
        less.advice(map)
    }

    #[test]
    fn what_is_advised_fits() {
        let map = map::Settings::default();
        let without_apart = map::Settings {
            apart: 0.0,
            ..map.clone()
        };
        let (all, most) = (20 + map.reach(), 20 + without_apart.reach());
        let cases = [
            (3, false, ", or --set replay.in_flight=3".to_owned()),
            (
                0,
                false,
                ", or take smaller pictures, or fewer channels or views".to_owned(),
            ),
            (all + 2, true, ", or --set replay.in_flight=2".to_owned()),
            (all, true, ", or --set map.apart=0".to_owned()),
            (
                most + 5,
                true,
                ", or --set map.apart=0 --set replay.in_flight=5".to_owned(),
            ),
            (
                most,
                true,
                format!(
                    ", or --set map.apart=0 --set map.window={} --set replay.in_flight=1",
                    map.window - 1
                ),
            ),
            (
                21,
                true,
                ", or leave [map] away in a graph file and --set replay.in_flight=1".to_owned(),
            ),
            (
                20,
                true,
                ", or take smaller pictures or fewer channels".to_owned(),
            ),
        ];
        for (room, has_map, expected) in cases {
            assert_eq!(advice(room, has_map), expected, "{room}");
        }
    }
}
