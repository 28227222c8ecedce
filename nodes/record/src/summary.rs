//! What follows a file's last chunk: the index that viewers want.

use std::collections::BTreeMap;
use std::io::{self, Cursor};

use binrw::{BinWrite, Endian};
use mcap::MAGIC;
use mcap::records::{self, op};

use messages::recording::FileSchema;

/// Everything a file's index says.
#[derive(Debug, Default)]
pub(crate) struct Summary {
    pub(crate) schemas: BTreeMap<u16, FileSchema>,
    pub(crate) channels: BTreeMap<u16, records::Channel>,
    pub(crate) counts: BTreeMap<u16, u64>,
    pub(crate) metadata: Vec<records::MetadataIndex>,
    pub(crate) attachments: Vec<records::AttachmentIndex>,
    pub(crate) chunks: Chunks,
}

/// The chunks of a file, as its index says them.
#[derive(Debug, Default)]
pub(crate) struct Chunks {
    count: u32,
    /// Their indexes, as the records they will be.
    indexes: Vec<u8>,
    first_and_last: Option<(u64, u64)>,
}

impl Chunks {
    /// Adds a chunk.
    pub(crate) fn add(&mut self, chunk: &records::ChunkIndex) -> io::Result<()> {
        self.count += 1;
        let (first, last) = (chunk.message_start_time, chunk.message_end_time);
        self.first_and_last = Some(match self.first_and_last {
            Some((start, end)) => (start.min(first), end.max(last)),
            None => (first, last),
        });
        record(&mut self.indexes, op::CHUNK_INDEX, chunk)
    }
}

impl Summary {
    /// The bytes that finish a file whose data end at `end`.
    pub(crate) fn ending(&self, end: u64) -> io::Result<Vec<u8>> {
        let mut out = Vec::new();
        // Zero says that nobody knows the sum of all data: every chunk has its own.
        record(
            &mut out,
            op::DATA_END,
            &records::DataEnd {
                data_section_crc: 0,
            },
        )?;

        let summary = out.len();
        let here = |out: &Vec<u8>| end + out.len() as u64;
        let summary_start = here(&out);
        let mut groups = Vec::new();
        let mut group = |out: &Vec<u8>, group_opcode, group_start: u64| {
            let group_length = here(out) - group_start;
            if group_length > 0 {
                groups.push(records::SummaryOffset {
                    group_opcode,
                    group_start,
                    group_length,
                });
            }
        };

        let start = here(&out);
        for (id, schema) in &self.schemas {
            schema_record(&mut out, *id, schema)?;
        }
        group(&out, op::SCHEMA, start);

        let start = here(&out);
        for channel in self.channels.values() {
            record(&mut out, op::CHANNEL, channel)?;
        }
        group(&out, op::CHANNEL, start);

        let start = here(&out);
        let (message_start_time, message_end_time) = self.chunks.first_and_last.unwrap_or_default();
        let statistics = records::Statistics {
            message_count: self.counts.values().sum(),
            schema_count: self.schemas.len() as u16,
            channel_count: self.channels.len() as u32,
            attachment_count: self.attachments.len() as u32,
            metadata_count: self.metadata.len() as u32,
            chunk_count: self.chunks.count,
            message_start_time,
            message_end_time,
            channel_message_counts: self.counts.clone(),
        };
        record(&mut out, op::STATISTICS, &statistics)?;
        group(&out, op::STATISTICS, start);

        let start = here(&out);
        out.extend_from_slice(&self.chunks.indexes);
        group(&out, op::CHUNK_INDEX, start);

        let start = here(&out);
        for index in &self.attachments {
            record(&mut out, op::ATTACHMENT_INDEX, index)?;
        }
        group(&out, op::ATTACHMENT_INDEX, start);

        let start = here(&out);
        for index in &self.metadata {
            record(&mut out, op::METADATA_INDEX, index)?;
        }
        group(&out, op::METADATA_INDEX, start);

        let summary_offset_start = here(&out);
        for offset in &groups {
            record(&mut out, op::SUMMARY_OFFSET, offset)?;
        }
        // The sum covers the footer up to itself.
        let footer = records::Footer {
            summary_start,
            summary_offset_start,
            summary_crc: 0,
        };
        record(&mut out, op::FOOTER, &footer)?;
        out.truncate(out.len() - size_of::<u32>());
        let crc = crc32fast::hash(&out[summary..]);
        out.extend_from_slice(&crc.to_le_bytes());
        out.extend_from_slice(MAGIC);
        Ok(out)
    }
}

/// Appends a plain value as MCAP writes it.
pub(crate) fn write<R>(out: &mut Vec<u8>, value: &R) -> io::Result<()>
where
    R: for<'a> BinWrite<Args<'a> = ()>,
{
    let mut end = Cursor::new(out);
    end.set_position(end.get_ref().len() as u64);
    value
        .write_options(&mut end, Endian::Little, ())
        .map_err(io::Error::other)
}

/// Appends a record.
pub(crate) fn record<R>(out: &mut Vec<u8>, opcode: u8, value: &R) -> io::Result<()>
where
    R: for<'a> BinWrite<Args<'a> = ()>,
{
    let mut body = Vec::new();
    write(&mut body, value)?;
    raw_record(out, opcode, &body);
    Ok(())
}

/// Appends a schema's record.
pub(crate) fn schema_record(out: &mut Vec<u8>, id: u16, schema: &FileSchema) -> io::Result<()> {
    let mut body = Vec::new();
    let (name, encoding) = (schema.name.clone(), schema.encoding.clone());
    write(&mut body, &records::SchemaHeader { id, name, encoding })?;
    body.extend_from_slice(&(schema.data.len() as u32).to_le_bytes());
    body.extend_from_slice(&schema.data);
    raw_record(out, op::SCHEMA, &body);
    Ok(())
}

/// Appends a record whose body is made already.
pub(crate) fn raw_record(out: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    out.push(opcode);
    out.extend_from_slice(&(body.len() as u64).to_le_bytes());
    out.extend_from_slice(body);
}
