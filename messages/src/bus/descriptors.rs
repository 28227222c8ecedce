//! How many files a process of a run has open: so that too low a limit is known before the start.
//!
//! Each of iceoryx2's services, ports and connections is some, for as long as it is used. What is reckoned here was
//! counted in `/proc/PID/fd` of runs with 3 to 32 views and 3 and 4 channels, and is a few too many at most.

use super::Run;
use super::ports::GUESTS;
use crate::payload::Kind;
use crate::topic::Topic;

/// A process of a node without any port: standard streams, locks, its end of the bus, a second one for the thread that
/// takes the launcher's commands, a file to read or write.
const PROCESS: u64 = 24;
/// A service: its description, what is known of its ports, and the mark that this process uses it.
const SERVICE: u64 = 3;
/// A publisher: its shared memory.
const PUBLISHER: u64 = 1;
/// What a publisher and a subscriber have between them, on either side.
const CONNECTION: u64 = 1;
/// What a subscriber has of each publisher: that one's shared memory, and the connection.
const SUBSCRIPTION: u64 = PUBLISHER + CONNECTION;
/// An inbox, or a bell of one: its service, the socket, and who rang.
const BELL: u64 = SERVICE + 2;

/// Open files of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpenFiles {
    /// Without these it cannot work.
    pub needed: u64,
    /// With these there is room for all guests, and for what the dead leave until it is cleaned up.
    pub wanted: u64,
}

impl Run {
    /// How many files the process of this node has open.
    pub fn open_files(&self, name: &str) -> OpenFiles {
        let Some(node) = self.nodes.iter().find(|node| node.name == name) else {
            return self.open_files_of_guest();
        };
        let topics = |kind: Kind| Topic::of(&self.rig, kind).len() as u64;
        let services = |kind: Kind| topics(kind) * self.shards_of(kind).count().max(1) as u64;
        let taken: u64 = self.taken_by(name).into_iter().map(services).sum();
        let made: u64 = node.makes.iter().copied().map(topics).sum();
        let takers = |kind: &Kind| self.takers(*kind).count() as u64;
        let sent: u64 = node.makes.iter().map(|k| topics(*k) * takers(k)).sum();
        let nodes = self.nodes.len() as u64;
        let hears_reports = u64::from(!node.takes.is_empty() && node.makes.is_empty());
        let is_at_door = u64::from(node.makes.contains(&Kind::Image));
        let finishers = self.nodes.iter().filter(|node| node.finishes).count() as u64;
        let rung = self.nodes.iter();
        let rung = rung.filter(|taker| node.makes.iter().any(|kind| taker.takes.contains(kind)));
        // Its own inbox with the bell by which its threads ring it, those of its takers, and that of the door.
        let bells = 2 + rung.count() as u64 + u64::from(node.finishes);
        let needed = PROCESS
            + taken * (SERVICE + SUBSCRIPTION)
            + made * (SERVICE + PUBLISHER)
            + sent * CONNECTION
            + (SERVICE + PUBLISHER + CONNECTION)
            + hears_reports * (SERVICE + nodes * SUBSCRIPTION)
            + u64::from(node.finishes) * (SERVICE + PUBLISHER + CONNECTION)
            + is_at_door * (SERVICE + finishers * SUBSCRIPTION)
            + bells * BELL;
        // A neighbour that died is connected to until it is known that it did.
        let of_the_dead = (taken + nodes) * SUBSCRIPTION + sent * CONNECTION;
        let of_guests = (made + 1) * GUESTS as u64 * CONNECTION;
        OpenFiles {
            needed,
            wanted: needed + of_the_dead + of_guests,
        }
    }

    /// How many files a guest that listens to everything has open.
    pub fn open_files_of_guest(&self) -> OpenFiles {
        let services = |kind| Topic::of(&self.rig, kind).len() * self.shards_of(kind).count();
        let topics: u64 = self.kinds().into_iter().map(services).sum::<usize>() as u64;
        let reports = SERVICE + self.nodes.len() as u64 * SUBSCRIPTION;
        let needed = PROCESS + reports + topics * (SERVICE + SUBSCRIPTION);
        OpenFiles {
            needed,
            wanted: needed + topics * SUBSCRIPTION,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::NodePlan;
    use crate::ledger::Shard;
    use crate::{Delivery, Rig, Size, Stage};

    /// A graph as it is built in, of so many views.
    fn run(views: usize, channels: &[f32]) -> Run {
        let node = |name: &str, takes: &[Kind], makes: Vec<Kind>, finishes| NodePlan {
            name: name.to_owned(),
            shard: Shard::ALL,
            takes: takes.to_vec(),
            makes,
            finishes,
        };
        let stage = |name, stage: Stage, finishes| {
            let makes = stage
                .makes()
                .filter(|kind| !matches!(kind, Kind::Raw | Kind::Truth));
            node(name, &stage.takes(), makes.collect(), finishes)
        };
        let recorded: Vec<Kind> = Stage::own()
            .into_iter()
            .flat_map(Stage::makes)
            .filter(|kind| !matches!(kind, Kind::Raw | Kind::Truth))
            .collect();
        Run {
            root: "/run".into(),
            prefix: "tricurve_".to_owned(),
            rig: Rig::of_views(views, channels, Size::new(160, 120)),
            delivery: Delivery::Lossless,
            cameras: false,
            in_flight: 8,
            nodes: vec![
                stage("capture", Stage::CAPTURE, false),
                stage("filter", Stage::FILTER, false),
                stage("track", Stage::TRACK, false),
                stage("hough", Stage::HOUGH, false),
                stage("match", Stage::MATCH, true),
                node("record", &recorded, Vec::new(), true),
            ],
        }
    }

    #[test]
    fn what_is_reckoned_is_what_was_counted_and_a_little_more() {
        let counted = [
            (3, 3, [63, 107, 151, 137, 158, 238]),
            (3, 4, [63, 125, 187, 170, 193, 288]),
            (6, 3, [81, 176, 259, 236, 248, 388]),
            (6, 4, [81, 212, 331, 302, 313, 483]),
        ];
        for (views, channels, counted) in counted {
            let run = run(views, &[30.0, 20.0, 10.0, 4.0][..channels]);
            for (node, counted) in run.nodes.iter().zip(counted) {
                let OpenFiles { needed, wanted } = run.open_files(&node.name);
                let what = format!("{} of {views} views: {counted} counted", node.name);
                assert!(
                    (counted..counted + 40).contains(&needed),
                    "{what}, {needed}"
                );
                assert!(wanted > needed, "{what}, {wanted}");
            }
        }
    }
}
