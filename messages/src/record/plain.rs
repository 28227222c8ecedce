//! The plain encoding: a message as its definition says, every row a message, every section a list of them.
//!
//! Field 1 is the time, 2 the frame, 3 and 4 the image's size; the first section is field 5, and so on. The n-th member of a
//! row is its field n. Numbers that are no rows are lists of numbers. Messages of others are encoded so, and of ours those
//! that are small.

use prost_types::field_descriptor_proto::Type;
use prost_types::source_code_info::Location;
use prost_types::{DescriptorProto, FileDescriptorProto, SourceCodeInfo};

use super::codec::{DecodeError, read_own};
use super::schema::{field, message, of_type, repeated};
use super::wire::{Fields, Fill};
use crate::header::Size;
use crate::message::{Definition, Message, SECTIONS};
use crate::other::OtherView;
use crate::row::{Number, RowType};

/// The field of the first section.
const FIRST: u32 = 5;

/// Appends the sections of a message, given as their memory.
pub(super) fn write<'a>(
    definition: &Definition,
    sections: impl IntoIterator<Item = &'a [u8]>,
    out: &mut Vec<u8>,
) {
    for ((number, section), rows) in (FIRST..).zip(definition.sections).zip(sections) {
        match section.row.columns {
            [] if rows.is_empty() => {}
            [] => Fill(out).bytes(number, rows),
            _ => write_rows(number, section.row.bytes, rows, out),
        }
    }
}

/// Appends rows as messages: word n of a row is field n + 1.
pub(super) fn write_rows(field: u32, bytes: usize, rows: &[u8], out: &mut Vec<u8>) {
    const WORD: usize = 1 + size_of::<u32>();
    // All are of one length: the frame is made once, and filled in for every row.
    let mut frame = Vec::new();
    let words = bytes / size_of::<u32>();
    Fill(&mut frame).open(field, words * WORD);
    let start = frame.len();
    for number in 1..=words as u32 {
        Fill(&mut frame).fixed32(number, 0);
    }
    out.reserve(rows.len() / bytes * frame.len());
    for row in rows.chunks_exact(bytes) {
        let words = row.as_chunks::<4>().0;
        for (slot, word) in frame[start..].chunks_exact_mut(WORD).zip(words) {
            slot[1..].copy_from_slice(word);
        }
        out.extend_from_slice(&frame);
    }
}

/// Reads a row that is a message into its memory, which is as many words as it has members.
pub(super) fn read_row(bytes: &[u8], row: &mut [u8]) -> Result<(), DecodeError> {
    let words = row.as_chunks_mut::<4>().0;
    for field in Fields::new(bytes) {
        let (number, value) = field?;
        if let Some(word) = words.get_mut(number as usize - 1) {
            *word = value.fixed32()?.to_le_bytes();
        }
    }
    Ok(())
}

/// Reads a message of an image of at most this size: hands out row by row the section's number and the row's memory.
fn read(
    definition: &Definition,
    bytes: &[u8],
    most: Size,
    mut push: impl FnMut(usize, &[u8]) -> Result<(), DecodeError>,
) -> Result<Size, DecodeError> {
    let mut row = Vec::new();
    read_own(bytes, most, |number, value| {
        let index = number.wrapping_sub(FIRST) as usize;
        let Some(section) = definition.sections.get(index) else {
            return Ok(());
        };
        let bytes = value.bytes()?;
        if !section.row.columns.is_empty() {
            row.clear();
            row.resize(section.row.bytes, 0);
            read_row(bytes, &mut row)?;
            return push(index, &row);
        }
        if !bytes.len().is_multiple_of(section.row.bytes) {
            return Err(DecodeError::Layout("length"));
        }
        let mut numbers = bytes.chunks_exact(section.row.bytes);
        numbers.try_for_each(|number| push(index, number))
    })
}

/// Reads a message into its room.
pub(super) fn read_into<M: Message>(
    bytes: &[u8],
    most: Size,
    room: &mut M::Room<'_>,
) -> Result<Size, DecodeError> {
    M::clear(room);
    read(M::DEFINITION, bytes, most, |section, row| {
        M::push(room, section, row);
        match M::refused(room) {
            0 => Ok(()),
            _ => Err(DecodeError::TooMany),
        }
    })
}

/// A message of others as it was recorded.
#[derive(Clone, Debug)]
pub struct OtherOwned {
    definition: &'static Definition,
    sections: [Vec<u8>; SECTIONS],
}

impl OtherOwned {
    /// Reads a message of this kind, and gives the size of its image, which is at most `most`.
    pub(super) fn read(
        definition: &'static Definition,
        bytes: &[u8],
        most: Size,
    ) -> Result<(Self, Size), DecodeError> {
        let mut sections: [Vec<u8>; SECTIONS] = Default::default();
        let capacities = definition.capacities(most);
        let element_bytes = definition.element_bytes();
        let size = read(definition, bytes, most, |index, row| {
            let memory = &mut sections[index];
            memory.extend_from_slice(row);
            match memory.len() <= capacities[index] * element_bytes[index] {
                true => Ok(()),
                false => Err(DecodeError::TooMany),
            }
        })?;
        let owned = Self {
            definition,
            sections,
        };
        Ok((owned, size))
    }

    /// The message.
    pub fn view(&self) -> OtherView<'_> {
        let memory = self.sections.each_ref().map(Vec::as_slice);
        OtherView::new(self.definition, &memory)
    }
}

/// The protobuf messages of a kind of message, those of its rows first; `package` is where they stand.
pub(super) fn descriptors(definition: &Definition, package: &str) -> Vec<DescriptorProto> {
    let mut messages: Vec<DescriptorProto> = Vec::new();
    let mut fields = head();
    for (number, section) in (FIRST as i32..).zip(definition.sections) {
        let is_known = |message: &DescriptorProto| message.name() == section.row.name;
        let is_row = !section.row.columns.is_empty();
        if is_row && !messages.iter().any(is_known) {
            messages.push(row(&section.row));
        }
        fields.push(repeated(match is_row {
            true => of_type(
                field(section.name, number, Type::Message),
                &format!(".{package}.{}", section.row.name),
            ),
            false if section.row.name == "Float32" => field(section.name, number, Type::Float),
            false => field(section.name, number, Type::Fixed32),
        }));
    }
    messages.push(message(definition.schema, fields));
    messages
}

/// The fields that all our own messages begin with.
pub(super) fn head() -> Vec<prost_types::FieldDescriptorProto> {
    vec![
        of_type(
            field("timestamp", 1, Type::Message),
            ".google.protobuf.Timestamp",
        ),
        field("frame_id", 2, Type::String),
        field("image_width", 3, Type::Fixed32),
        field("image_height", 4, Type::Fixed32),
    ]
}

/// The message that a row is, member by member.
pub(super) fn row(row: &RowType) -> DescriptorProto {
    let kind = |number| match number {
        Number::Float32 => Type::Float,
        Number::Uint32 | Number::Uint8 => Type::Fixed32,
    };
    let columns = row.columns.iter().zip(1..);
    let fields = columns.map(|(c, number)| field(c.name, number, kind(c.number)));
    message(row.name, fields.collect())
}

/// The file that describes a message of others in its own words.
pub(super) fn file(definition: &Definition, dependency: Vec<String>) -> FileDescriptorProto {
    let package = package(definition);
    let mut file = FileDescriptorProto {
        name: Some(format!("{}.proto", package.replace('.', "/"))),
        dependency,
        syntax: Some("proto3".to_owned()),
        message_type: descriptors(definition, &package),
        package: Some(package),
        ..FileDescriptorProto::default()
    };
    file.source_code_info = Some(SourceCodeInfo {
        location: comments(definition, &file),
    });
    file
}

/// The package of a message of others: its node's.
pub(super) fn package(definition: &Definition) -> String {
    format!("tricurve.{}", definition.stage)
}

/// What the definition says of each message and field, where protobuf keeps it.
fn comments(definition: &Definition, file: &FileDescriptorProto) -> Vec<Location> {
    // Messages are field 4 of a file, fields field 2 of a message.
    const MESSAGE: i32 = 4;
    const FIELD: i32 = 2;
    let mut locations = Vec::new();
    let mut comment = |path: Vec<i32>, text: &str| {
        locations.push(Location {
            path,
            span: vec![0, 0, 0],
            leading_comments: Some(format!(" {}\n", text.trim())),
            ..Location::default()
        });
    };
    for (at, message) in (0..).zip(&file.message_type) {
        let of_row = |section: &&crate::message::SectionType| section.row.name == message.name();
        let row = definition.sections.iter().find(of_row).map(|of| of.row);
        comment(
            vec![MESSAGE, at],
            row.map_or(definition.about, |row| row.about),
        );
        for (index, field) in (0..).zip(&message.field) {
            let column = row.and_then(|row| row.columns.iter().find(|c| c.name == field.name()));
            let section = || definition.sections.iter().find(|s| s.name == field.name());
            let about = match row {
                Some(_) => column.map(|column| column.about),
                None => section().map(|section| section.about),
            };
            if let Some(about) = about {
                comment(vec![MESSAGE, at, FIELD, index], about);
            }
        }
    }
    locations
}
