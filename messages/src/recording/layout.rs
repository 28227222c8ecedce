//! How MCAP lays out its records, as far as lengths go: <https://mcap.dev/spec>.
//!
//! A damaged length may say that four gigabytes follow, and the parser takes memory for what a length says before it
//! looks. So every record's lengths are compared first with the bytes that are there.

use mcap::records::{Record, op};
use mcap::{McapError, parse_record};

/// A field, by what it takes to pass over it.
#[derive(Clone, Copy)]
enum Field {
    /// So many bytes.
    Fixed(usize),
    /// A length in 32 bits, and as many bytes.
    Long,
    /// A length in 32 bits, and in as many bytes texts, each with its own length.
    Texts,
}

use Field::{Fixed, Long, Texts};

/// The fields of a record as far as its last length.
fn fields(opcode: u8) -> &'static [Field] {
    match opcode {
        op::HEADER => &[Long, Long],
        op::SCHEMA => &[Fixed(2), Long, Long, Long],
        op::CHANNEL => &[Fixed(2 + 2), Long, Long, Texts],
        op::CHUNK => &[Fixed(8 + 8 + 8 + 4), Long],
        op::MESSAGE_INDEX => &[Fixed(2), Long],
        op::CHUNK_INDEX => &[Fixed(8 + 8 + 8 + 8), Long, Fixed(8), Long],
        op::ATTACHMENT => &[Fixed(8 + 8), Long, Long],
        op::ATTACHMENT_INDEX => &[Fixed(8 + 8 + 8 + 8 + 8), Long, Long],
        op::STATISTICS => &[Fixed(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8), Long],
        op::METADATA => &[Long, Texts],
        op::METADATA_INDEX => &[Fixed(8 + 8), Long],
        _ => &[],
    }
}

/// Passes over a length and what follows it.
fn long<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = rest.split_off(..4)?;
    let length = u32::from_le_bytes(length.try_into().ok()?);
    rest.split_off(..length as usize)
}

/// Whether all that a record's lengths announce is there.
pub(super) fn is_whole(opcode: u8, body: &[u8]) -> bool {
    let mut rest = body;
    let mut pass = |field: &Field| match field {
        Fixed(bytes) => rest.split_off(..*bytes).map(drop),
        Long => long(&mut rest).map(drop),
        Texts => {
            let mut texts = long(&mut rest)?;
            while !texts.is_empty() {
                long(&mut texts)?;
            }
            Some(())
        }
    };
    fields(opcode).iter().all(|field| pass(field).is_some())
}

/// Parses a record whose lengths hold.
pub(super) fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, McapError> {
    match is_whole(opcode, body) {
        true => parse_record(opcode, body),
        false => Err(McapError::UnexpectedEof),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::collections::BTreeMap;
    use std::io::Cursor;

    /// Every record of a file with everything in it.
    fn records() -> Vec<(u8, Vec<u8>)> {
        let mut file = Cursor::new(Vec::new());
        let options = mcap::WriteOptions::new().compression(None).profile("p");
        let mut writer = options.create(&mut file).unwrap();
        let schema = writer.add_schema("s", "jsonschema", b"{}").unwrap();
        let notes = BTreeMap::from([("a".to_owned(), "b".to_owned())]);
        let channel = writer.add_channel(schema, "t", "json", &notes).unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 1,
            log_time: 1,
            publish_time: 1,
        };
        writer.write_to_known_channel(&header, b"{}").unwrap();
        writer.flush().unwrap();
        writer
            .attach(&mcap::Attachment {
                log_time: 1,
                create_time: 1,
                name: "a".to_owned(),
                media_type: "m".to_owned(),
                data: b"d".to_vec().into(),
            })
            .unwrap();
        let metadata = mcap::records::Metadata {
            name: "n".to_owned(),
            metadata: notes,
        };
        writer.write_metadata(&metadata).unwrap();
        writer.finish().unwrap();
        drop(writer);
        let bytes = file.into_inner();
        let mut rest = &bytes[mcap::MAGIC.len()..bytes.len() - mcap::MAGIC.len()];
        let mut records = Vec::new();
        while let Some((&opcode, after)) = rest.split_first() {
            let (length, after) = after.split_at(8);
            let length = u64::from_le_bytes(length.try_into().unwrap());
            let (body, after) = after.split_at(length as usize);
            records.push((opcode, body.to_vec()));
            rest = after;
        }
        records
    }

    #[test]
    fn every_record_as_written_is_whole_and_none_with_a_length_too_great() {
        let records = records();
        for opcode in op::HEADER..=op::DATA_END {
            // Messages stand in the chunk.
            let is_there = records.iter().any(|(other, _)| *other == opcode);
            assert_eq!(is_there, opcode != op::MESSAGE, "{opcode:#x}");
        }
        for (opcode, body) in &records {
            assert!(is_whole(*opcode, body), "{opcode:#x}");
            for at in 0..body.len().saturating_sub(3) {
                let mut damaged = body.clone();
                damaged[at..at + 4].fill(0xff);
                // What is said to be whole has no length that the parser would believe in vain.
                if is_whole(*opcode, &damaged) {
                    drop(parse_record(*opcode, &damaged));
                }
            }
        }
        let (_, metadata) = records.iter().find(|(o, _)| *o == op::METADATA).unwrap();
        let mut damaged = metadata.clone();
        damaged[3] = 0x60;
        assert!(!is_whole(op::METADATA, &damaged));
    }
}
