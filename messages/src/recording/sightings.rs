//! Where in a part the messages of every scan lie: by its index where this program wrote it, else as reading it showed.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};

use mcap::McapError;
use mcap::records::{ChunkIndex, Record, op};

use super::file::{Chunk, Contents, Group, first_sequence, record_in};
use super::layout::parse;
use super::metadata::ScanOrder;
use super::part::Part;
use super::scans::{Block, Place, Sighting, is_repeated};

/// A chunk that cannot be read: its place and length, and what is wrong.
pub(super) type Unreadable = (u64, u64, McapError);

/// All that is seen in a part, which is the one of this number.
pub(super) fn sightings(number: usize, part: &mut Part) -> Vec<Result<Sighting, Unreadable>> {
    let place = |block, channels, is_shared| Place {
        part: number,
        block,
        channels,
        is_shared,
    };
    let Part {
        file,
        contents,
        looked,
        ..
    } = part;
    if let Some(order) = looked.is_none().then(|| order(file, contents)).flatten() {
        let mut order = order.into_iter();
        let (mut latest, mut scan) = (None, 0);
        let sighting = |(chunk, index): (usize, &ChunkIndex)| {
            let nanos = index.message_start_time;
            if latest != Some(nanos) {
                latest = Some(nanos);
                scan = order.next().unwrap_or_default();
            }
            Ok(Sighting {
                sequence: scan,
                nanos,
                place: place(Block::Chunk(chunk), None, false),
            })
        };
        return contents.chunks.iter().enumerate().map(sighting).collect();
    }
    let mut seen = Vec::new();
    let mut looked = looked.take().map(Vec::into_iter);
    for (chunk, index) in contents.chunks.iter().enumerate() {
        let groups = match &mut looked {
            Some(looked) => looked.next().unwrap_or(Ok(Vec::new())),
            None => groups(file, contents, index),
        };
        match groups {
            Ok(groups) => {
                let is_shared = groups.len() > 1;
                seen.extend(groups.into_iter().map(|group| {
                    let channels = group.channels.into_boxed_slice();
                    Ok(Sighting {
                        sequence: group.sequence.into(),
                        nanos: group.nanos,
                        place: place(Block::Chunk(chunk), Some(channels), is_shared),
                    })
                }));
            }
            Err(error) => seen.push(Err((index.chunk_start_offset, index.chunk_length, error))),
        }
    }
    seen.extend(contents.runs.iter().enumerate().map(|(run, held)| {
        Ok(Sighting {
            sequence: held.group.sequence.into(),
            nanos: held.group.nanos,
            place: place(Block::Run(run), None, false),
        })
    }));
    seen
}

/// The scans of a finished part in the order of its chunks, each as often as the time changes from chunk to chunk.
fn order(file: &mut File, contents: &Contents) -> Option<Vec<u64>> {
    let mut records = contents.metadata.iter().map(|(_, record)| record);
    let record = records.rfind(|record| record.name == ScanOrder::NAME)?;
    let one_time = |index: &ChunkIndex| index.message_start_time == index.message_end_time;
    let chunks = &contents.chunks;
    if !contents.is_finished || !chunks.iter().all(one_time) {
        return None;
    }
    let time = |chunk: usize| chunks.get(chunk).map(|index| index.message_start_time);
    let begins = |chunk: &usize| *chunk == 0 || time(*chunk) != time(*chunk - 1);
    let firsts: Vec<usize> = (0..chunks.len()).filter(begins).collect();
    let order = ScanOrder::from_record(record, firsts.len())?;
    if !has_each_topic_once(contents, &begins) {
        return None;
    }
    // The file may have been put into another order since: it is as it was where each stretch of time begins and ends.
    let is_end = |place: &usize| {
        let at = |place: usize| firsts.get(place).and_then(|chunk| time(*chunk));
        let descends = |place: usize| at(place) > at(place + 1);
        *place == 0 || place + 1 == firsts.len() || descends(*place) || descends(*place - 1)
    };
    let is_so = |place: usize| {
        let first = first_sequence(file, &chunks[firsts[place]]);
        first.is_ok_and(|first| first.map(u64::from) == Some(order[place]))
    };
    let all_so = (0..firsts.len()).filter(is_end).all(is_so);
    all_so.then_some(order)
}

/// Whether no scan has a topic in two chunks of which it has one message: others may have packed several scans into one
/// chunk and dated it by the first.
fn has_each_topic_once(contents: &Contents, begins: &impl Fn(&usize) -> bool) -> bool {
    // These are written once more when a recording ends.
    let may_repeat =
        |topic: &str| is_repeated(topic) || topic == "health" || topic == "synchronisation";
    let mut latest: Vec<Option<usize>> = vec![None; usize::from(u16::MAX) + 1];
    let repeated: Vec<u16> = contents
        .channels
        .values()
        .filter(|channel| may_repeat(&channel.topic))
        .map(|channel| channel.id)
        .collect();
    let mut scan = 0;
    for (chunk, index) in contents.chunks.iter().enumerate() {
        scan += usize::from(begins(&chunk));
        for id in index.message_index_offsets.keys() {
            let seen = &mut latest[usize::from(*id)];
            if *seen == Some(scan) && !repeated.contains(id) {
                return false;
            }
            *seen = Some(scan);
        }
    }
    true
}

/// What a chunk of ours holds: one scan, which its first message tells, unless others packed it anew.
fn groups(
    file: &mut File,
    contents: &Contents,
    index: &ChunkIndex,
) -> Result<Vec<Group>, McapError> {
    let is_of_one_time = index.message_start_time == index.message_end_time;
    if is_of_one_time && may_be_one_scan(file, contents, index)? {
        let group = |sequence| Group {
            sequence,
            nanos: index.message_start_time,
            channels: index.message_index_offsets.keys().copied().collect(),
        };
        return Ok(first_sequence(file, index)?
            .map(group)
            .into_iter()
            .collect());
    }
    Ok(Chunk::load(file, index, &mut Vec::new())?.groups())
}

/// Whether a chunk has no messages of other times, and no two of a topic of which a scan has one, as its message indexes
/// say.
fn may_be_one_scan(
    file: &mut File,
    contents: &Contents,
    index: &ChunkIndex,
) -> Result<bool, McapError> {
    let nanos = index.message_start_time;
    let start = index.chunk_start_offset.saturating_add(index.chunk_length);
    file.seek(SeekFrom::Start(start))?;
    let mut bytes = Vec::new();
    file.take(index.message_index_length)
        .read_to_end(&mut bytes)?;
    let mut next = 0;
    while let Some((opcode, body)) = record_in(&bytes, next) {
        next = body.end;
        if opcode != op::MESSAGE_INDEX {
            continue;
        }
        let Record::MessageIndex(index) = parse(opcode, &bytes[body])? else {
            continue;
        };
        let channel = contents.channels.get(&index.channel_id);
        let may_repeat = channel.is_some_and(|channel| is_repeated(&channel.topic));
        let is_of_time = |entry: &mcap::records::MessageIndexEntry| entry.log_time == nanos;
        if index.records.len() > 1 && !may_repeat || !index.records.iter().all(is_of_time) {
            return Ok(false);
        }
    }
    Ok(true)
}
