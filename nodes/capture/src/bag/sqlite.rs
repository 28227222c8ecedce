//! The database files that rosbag2 wrote before it wrote MCAP.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;

use rusqlite::blob::Blob;
use rusqlite::{Connection, OpenFlags};

use super::storage::{At, Coding, HEAD, Looked, Topics, Visit, Want};
use super::wire::Why;

/// What every database file begins with.
pub(super) const MAGIC: [u8; 16] = *b"SQLite format 3\0";

/// One database file.
#[derive(Debug)]
pub(super) struct Sqlite {
    connection: Connection,
}

impl Sqlite {
    /// Opens a file for reading.
    pub(super) fn open(path: &Path) -> Result<Self, Why> {
        let open = |name: &str| {
            let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
                | OpenFlags::SQLITE_OPEN_NO_MUTEX
                | OpenFlags::SQLITE_OPEN_URI;
            let connection = Connection::open_with_flags(name, flags)?;
            // The index of a file that was cut off says more pages than there are; those there are can be read.
            connection.pragma_update(None, "writable_schema", "ON")?;
            connection.query_row("SELECT count(*) FROM sqlite_master", [], |_| Ok(()))?;
            Ok(connection)
        };
        let plain = format!("file:{}", escaped(path));
        // In a folder that cannot be written the files that go with a journal cannot be made.
        let opened = open(&plain).or_else(|first: rusqlite::Error| {
            open(&format!("{plain}?immutable=1")).map_err(|_| first)
        });
        opened
            .map(|connection| Self { connection })
            .map_err(|error| format!("its database cannot be opened ({error})"))
    }

    /// Goes through all messages once.
    pub(super) fn visit(
        &mut self,
        number: usize,
        topics: &mut Topics,
        visit: &mut dyn Visit,
        looked: &mut Looked,
    ) -> Result<(), Why> {
        let known = self.topics(topics, visit).map_err(|error| {
            format!("its database holds no topics of a rosbag2 recording ({error})")
        })?;
        if let Err(error) = self.messages(number, &known, topics, visit, looked) {
            looked.damage(format!("its database is damaged ({error})"));
        }
        Ok(())
    }

    fn topics(
        &self,
        topics: &mut Topics,
        visit: &mut dyn Visit,
    ) -> rusqlite::Result<HashMap<i64, (usize, Want)>> {
        let mut statement = self
            .connection
            .prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
        let mut rows = statement.query([])?;
        let mut known = HashMap::new();
        while let Some(row) = rows.next()? {
            let (name, schema, coding): (String, String, String) =
                (row.get(1)?, row.get(2)?, row.get(3)?);
            let topic = topics.add(&name, &schema, Coding::of(&coding));
            known.insert(row.get(0)?, (topic, visit.wants(topic, topics.get(topic))));
        }
        Ok(known)
    }

    fn messages(
        &self,
        number: usize,
        known: &HashMap<i64, (usize, Want)>,
        topics: &mut Topics,
        visit: &mut dyn Visit,
        looked: &mut Looked,
    ) -> rusqlite::Result<()> {
        // In the order they lie: of a damaged file what comes before the damage is read.
        let mut statement = self
            .connection
            .prepare("SELECT id, topic_id, timestamp FROM messages ORDER BY id")?;
        let mut rows = statement.query([])?;
        let (mut blob, mut bytes): (Option<Blob<'_>>, _) = (None, Vec::new());
        while let Some(row) = rows.next()? {
            let (id, topic, log_time): (i64, i64, i64) = (row.get(0)?, row.get(1)?, row.get(2)?);
            let Some(&(topic, want)) = known.get(&topic) else {
                looked.messages += 1;
                looked.unnamed += 1;
                continue;
            };
            if want != Want::Nothing {
                match &mut blob {
                    Some(blob) => blob.reopen(id)?,
                    None => {
                        let (schema, table) = ("main", "messages");
                        blob = Some(self.connection.blob_open(schema, table, "data", id, true)?);
                    }
                }
                let Some(blob) = &mut blob else { continue };
                let length = blob.len();
                let wanted = match want {
                    Want::Whole => length,
                    _ => length.min(HEAD),
                };
                bytes.resize(wanted, 0);
                blob.read_at_exact(&mut bytes, 0)?;
                let at = At {
                    file: number,
                    chunk: 0,
                    start: id as u64,
                    length: length as u64,
                };
                visit.message(topic, log_time.max(0) as u64, at, &bytes);
            }
            looked.messages += 1;
            topics.count(topic);
        }
        Ok(())
    }

    /// The bytes of a message.
    pub(super) fn read(&mut self, at: &At) -> Result<Vec<u8>, Why> {
        let read = || -> rusqlite::Result<Vec<u8>> {
            let id = at.start as i64;
            let mut blob = self
                .connection
                .blob_open("main", "messages", "data", id, true)?;
            let mut bytes = Vec::with_capacity(blob.len());
            blob.read_to_end(&mut bytes)
                .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
            Ok(bytes)
        };
        read().map_err(|error| error.to_string())
    }
}

/// A path as a part of a URI.
fn escaped(path: &Path) -> String {
    let mut text = String::new();
    for byte in path.to_string_lossy().bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'_' | b'-' => {
                text.push(char::from(byte));
            }
            _ => write!(text, "%{byte:02x}").unwrap_or_default(),
        }
    }
    text
}
