//! What stands in a proof for the messages that are not in it: their digests.
//!
//! ```text
//! every message of a scan, and the settings it was made with ─► Digest ─► Digests, a message a scan
//! ```
//!
//! A digest is of what a message says, not of how it is encoded: image size, place of the camera and the payload, as the
//! stages hand it on. So it is the same of a message that is computed anew, read back, or encoded otherwise.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::Value as Json;

use super::DecodeError;
use super::wire::{Fields, Fill};
use crate::change::Change;
use crate::header::Header;
use crate::payload::AnyView;
use crate::rig::Rig;
use crate::topic::Stage;

/// The topic of the digests.
pub const DIGESTS: &str = "digests";

/// What the digests are: the first 128 bits of BLAKE3.
const ALGORITHM: &str = "blake3-128";

/// What stands for a message or for settings: whoever changes them changes it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest([u8; 16]);

impl Digest {
    /// Of a message: image size, camera position, sway, and of each section its length and its memory.
    pub fn of(header: &Header, view: &AnyView<'_>) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&header.width.to_le_bytes());
        hasher.update(&header.height.to_le_bytes());
        hasher.update(&header.position_m.to_bits().to_le_bytes());
        hasher.update(bytemuck::bytes_of(&header.sway));
        for section in view.memory() {
            hasher.update(&(section.len() as u64).to_le_bytes());
            hasher.update(section);
        }
        Self::end(&hasher)
    }

    /// Of a table of settings. Numbers count to nine digits, since not every reader of JSON knows the last one.
    pub fn of_settings(table: &Json) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(plain(table).as_bytes());
        Self::end(&hasher)
    }

    fn end(hasher: &blake3::Hasher) -> Self {
        let mut digest = [0; 16];
        hasher.finalize_xof().fill(&mut digest);
        Self(digest)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// A table as text, always the same of the same settings.
fn plain(value: &Json) -> String {
    let list = |parts: Vec<String>| parts.join(",");
    match value {
        Json::Number(number) if number.is_f64() => {
            format!("{:.8e}", number.as_f64().unwrap_or_default())
        }
        Json::Array(values) => format!("[{}]", list(values.iter().map(plain).collect())),
        Json::Object(table) => {
            let sorted: BTreeMap<&String, &Json> = table.iter().collect();
            let pair = |(key, value): (&String, &Json)| format!("{key:?}:{}", plain(value));
            let pairs = sorted.iter().map(|(key, value)| pair((key, value)));
            format!("{{{}}}", list(pairs.collect()))
        }
        other => other.to_string(),
    }
}

/// The name under which the rig stands among the settings.
const RIG: &str = "rig";
/// The table of the configuration that says the version of each stage's algorithm.
pub const VERSIONS: &str = "versions";

/// The digests of a scan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Digests {
    /// Of each of its data messages, by topic.
    pub messages: BTreeMap<String, Digest>,
    /// Of what it was made with: the settings of each stage that computes as they held for this scan, their versions, and
    /// the rig, by name.
    pub settings: BTreeMap<String, Digest>,
}

impl Digests {
    /// Of what a scan is made with.
    pub fn of_settings(
        configuration: &Json,
        rig: &Rig,
        changes: &[Change],
        scan: u64,
    ) -> BTreeMap<String, Digest> {
        let held = || changes.iter().filter(|change| change.from <= scan);
        let stages = Stage::computing().into_iter().map(Stage::name);
        let of_table = |name: &str| {
            let mut table = configuration.get(name)?.clone();
            Change::apply(held(), name, &mut table);
            Some((name.to_owned(), Digest::of_settings(&table)))
        };
        // Plain data: nothing in it can fail to serialize.
        let rig = serde_json::to_value(rig).unwrap_or_default();
        stages
            .chain([VERSIONS])
            .filter_map(of_table)
            .chain([(RIG.to_owned(), Digest::of_settings(&rig))])
            .collect()
    }

    /// The first name under which these settings are not those that the scan was made with.
    pub fn changed<'a>(&'a self, now: &'a BTreeMap<String, Digest>) -> Option<&'a str> {
        let names = self.settings.keys().chain(now.keys());
        let mut names = names.filter(|name| self.settings.get(*name) != now.get(*name));
        names.next().map(String::as_str)
    }

    /// Appends them as a message, as its schema describes it.
    pub fn encode(&self, nanos: u64, out: &mut Vec<u8>) {
        let mut fill = Fill(out);
        fill.timestamp(1, nanos);
        fill.text(2, ALGORITHM);
        for (field, digests) in [(3, &self.messages), (4, &self.settings)] {
            for (name, Digest(digest)) in digests {
                fill.message(field, |pair| {
                    pair.text(1, name);
                    pair.bytes(2, digest);
                });
            }
        }
    }

    /// Back from the message.
    ///
    /// # Errors
    /// When the bytes are not what [`encode`](Self::encode) makes.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let mut digests = Self::default();
        let mut algorithm = &[][..];
        for field in Fields::new(bytes) {
            let (of, pair) = match field? {
                (2, value) => {
                    algorithm = value.bytes()?;
                    continue;
                }
                (3, value) => (&mut digests.messages, value.bytes()?),
                (4, value) => (&mut digests.settings, value.bytes()?),
                _ => continue,
            };
            let (mut name, mut digest) = (&[][..], &[][..]);
            for field in Fields::new(pair) {
                match field? {
                    (1, value) => name = value.bytes()?,
                    (2, value) => digest = value.bytes()?,
                    _ => {}
                }
            }
            let name = String::from_utf8(name.to_vec()).map_err(|_| DecodeError::Malformed)?;
            let digest = digest
                .try_into()
                .map_err(|_| DecodeError::Layout("length of a digest"))?;
            of.insert(name, Digest(digest));
        }
        match algorithm == ALGORITHM.as_bytes() {
            true => Ok(digests),
            false => Err(DecodeError::Layout("digests' algorithm")),
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::{Edge, Edges, Owned, Size};
    use serde_json::json;

    fn edges(x: f32) -> Owned<Edges> {
        let mut edges = Owned::<Edges>::new(Size::new(8, 4));
        let edge = Edge {
            x,
            ..Edge::default()
        };
        edges.fill(|room| room.edges.push(edge));
        edges
    }

    fn digest(edges: &Owned<Edges>) -> Digest {
        Digest::of(&edges.header, &edges.view().into())
    }

    #[test]
    fn a_digest_tells_what_a_message_says_and_not_which_scan_it_is_of() {
        let (one, mut other) = (edges(1.5), edges(1.5));
        other.header.sequence = 7;
        other.header.elapsed_nanos = 9;
        assert_eq!(digest(&one), digest(&other));
        other.header.position_m = 1e-9;
        assert!(digest(&one) != digest(&other));
        assert!(digest(&one) != digest(&edges(1.500_000_1)));
    }

    #[test]
    fn digests_come_back_and_a_damaged_message_is_told() {
        let mut digests = Digests::default();
        digests
            .messages
            .insert("edges/left/4".to_owned(), digest(&edges(2.0)));
        let configuration = json!({ "filter": { "floor": 0.4 }, "track": {} });
        let rig = Rig::of_views(3, &[4.0], Size::new(8, 4));
        digests.settings = Digests::of_settings(&configuration, &rig, &[], 0);
        let mut out = Vec::new();
        digests.encode(1_500_000_000, &mut out);
        assert_eq!(Digests::decode(&out).unwrap(), digests);
        for cut in 1..out.len() {
            assert!(Digests::decode(&out[..cut]).ok().as_ref() != Some(&digests));
        }
    }

    #[test]
    fn settings_that_were_changed_are_named_from_the_scan_on_from_which_they_hold() {
        let configuration = json!({ "filter": { "floor": 0.4 }, "match": { "gap": 10 } });
        let rig = Rig::of_views(3, &[4.0], Size::new(8, 4));
        let change = Change {
            from: 5,
            node: "match".to_owned(),
            key: "gap".to_owned(),
            value: json!(6),
            was: json!(10),
        };
        let of = |scan| Digests {
            settings: Digests::of_settings(
                &configuration,
                &rig,
                std::slice::from_ref(&change),
                scan,
            ),
            ..Digests::default()
        };
        let now = Digests::of_settings(&configuration, &rig, &[], 0);
        assert_eq!(of(4).changed(&now), None);
        assert_eq!(of(5).changed(&now), Some("match"));
        let other = Rig::of_views(3, &[2.0], Size::new(8, 4));
        let now = Digests::of_settings(&configuration, &other, &[], 0);
        assert_eq!(of(4).changed(&now), Some("rig"));
    }
}
