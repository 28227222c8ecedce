//! Messages of others: kinds that a program built upon this one defines for nodes of its own.
//!
//! They are registered once, when the program starts, and from then on are among all kinds: they have topics, are recorded,
//! replayed, compared and shown like ours.

use std::sync::OnceLock;

use crate::header::Size;
use crate::message::{Definition, Difference, SECTIONS, Section};
use crate::payload::Kind;

/// What the process was told.
static REGISTERED: OnceLock<Vec<Other>> = OnceLock::new();

/// A kind of message that is none of ours.
#[derive(Clone, Copy)]
pub struct Other(&'static Definition);

impl Other {
    /// The kind that is defined so.
    pub const fn of(definition: &'static Definition) -> Self {
        Self(definition)
    }

    /// How it is defined.
    pub const fn definition(self) -> &'static Definition {
        self.0
    }

    /// All that were registered.
    pub fn all() -> &'static [Self] {
        REGISTERED.get().map_or(&[], Vec::as_slice)
    }
}

impl std::fmt::Debug for Other {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name)
    }
}

impl PartialEq for Other {
    fn eq(&self, other: &Self) -> bool {
        self.0.name == other.0.name
    }
}

impl Eq for Other {}

impl PartialOrd for Other {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Other {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.name.cmp(other.0.name)
    }
}

impl std::hash::Hash for Other {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        self.0.name.hash(state);
    }
}

/// Why kinds of message cannot be registered.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RegisterError {
    /// A name that is taken would name two topics.
    #[error(
        "the message {0} cannot be registered: there is one of that name already, or its schema's name is taken; give it \
         another name"
    )]
    Taken(String),
    /// A name that cannot be part of a topic's.
    #[error(
        "the message {0:?} cannot be registered: its name and its node's must be words of small letters, digits and _"
    )]
    Name(String),
    /// Rows that a recording cannot hold.
    #[error(
        "the message {0} cannot be registered: it has one to {SECTIONS} sections, each of rows or numbers of 32 bits"
    )]
    Rows(String),
    /// A node that would have to wait for itself.
    #[error("the node {0} cannot take what is made of its own messages")]
    Circle(String),
    /// It was done before.
    #[error("messages can be registered once, before anything else is done")]
    Twice,
}

/// Registers the kinds of message of others, once for the whole process.
///
/// # Errors
/// When a name is taken or is none, when a recording could not hold a message, or when it was done before.
pub fn register(kinds: &[Kind]) -> Result<(), RegisterError> {
    let mut others: Vec<Other> = Vec::new();
    let is_word = |name: &str| {
        let is_of_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        !name.is_empty() && name.chars().all(is_of_word)
    };
    for kind in kinds {
        let Kind::Other(other) = *kind else { continue };
        let definition = other.definition();
        let name = definition.name.to_owned();
        if !is_word(definition.name) || !is_word(definition.stage) {
            return Err(RegisterError::Name(name));
        }
        let own = || Kind::OWN.iter().map(|own| own.definition());
        let mut known = own().chain(others.iter().map(|other| other.definition()));
        let is_like = |known: &Definition| {
            let schema = |of: &Definition| (of.stage == definition.stage, of.schema);
            known.name == definition.name
                || known.name.starts_with(&format!("{name}/"))
                || schema(known) == (true, definition.schema)
        };
        if known.any(is_like) || name == "camera" {
            return Err(RegisterError::Taken(name));
        }
        let rows = definition.sections.iter().map(|section| section.row);
        let is_words = |bytes: usize| bytes.is_multiple_of(4) && bytes > 0;
        let len = definition.sections.len();
        if len == 0 || len > SECTIONS || !rows.into_iter().all(|row| is_words(row.bytes)) {
            return Err(RegisterError::Rows(name));
        }
        others.push(other);
    }
    let from = |stage: &'static str| {
        let all = others.iter().map(|other| other.definition());
        let own = Kind::OWN.iter().map(|own| own.definition());
        let made = own.chain(all).filter(move |of| of.stage == stage);
        made.flat_map(|of| of.from)
            .map(|kind| kind.definition().stage)
    };
    // As often as there are stages, every stage is replaced by those it takes from: whoever is left goes in a circle.
    for start in &others {
        let mut stages = vec![start.definition().stage];
        for _ in 0..=Kind::OWN.len() + others.len() {
            stages = stages.into_iter().flat_map(&from).collect();
            stages.sort_unstable();
            stages.dedup();
        }
        if !stages.is_empty() {
            return Err(RegisterError::Circle(start.definition().stage.to_owned()));
        }
    }
    REGISTERED.set(others).map_err(|_| RegisterError::Twice)
}

/// A message of others as its readers see it who do not know its types: the memory of its sections.
#[derive(Clone, Copy)]
pub struct OtherView<'a> {
    definition: &'static Definition,
    sections: [&'a [u8]; SECTIONS],
}

impl<'a> OtherView<'a> {
    /// A message of this kind whose sections stand in this memory.
    pub fn new(definition: &'static Definition, memory: &[&'a [u8]]) -> Self {
        let mut sections: [&[u8]; SECTIONS] = [&[]; SECTIONS];
        for (slot, memory) in sections.iter_mut().zip(memory) {
            *slot = memory;
        }
        Self {
            definition,
            sections,
        }
    }

    /// Sees sections of these lengths in a payload laid out for images up to `size`; `None` when they exceed it.
    pub(crate) fn of(
        definition: &'static Definition,
        words: &'a [u64],
        size: Size,
        lens: [u32; SECTIONS],
    ) -> Option<Self> {
        let bytes: &[u8] = bytemuck::cast_slice(words);
        let offsets = definition.offsets(size);
        let mut sections: [&[u8]; SECTIONS] = [&[]; SECTIONS];
        let places = offsets.windows(2).zip(lens).zip(definition.element_bytes());
        for (slot, ((bounds, len), element)) in sections.iter_mut().zip(places) {
            let used = (len as usize).checked_mul(element)?;
            *slot = bytes.get(bounds[0]..bounds[1])?.get(..used)?;
        }
        Some(Self {
            definition,
            sections,
        })
    }

    /// Its kind.
    pub const fn kind(&self) -> Kind {
        Kind::Other(Other(self.definition))
    }

    /// How its kind is defined.
    pub const fn definition(&self) -> &'static Definition {
        self.definition
    }

    /// The memory of its sections, in order.
    pub fn memory(&self) -> Vec<&'a [u8]> {
        self.sections[..self.definition.sections.len()].to_vec()
    }

    /// How many rows each section has.
    pub(crate) fn lens(&self) -> [u32; SECTIONS] {
        let mut lens = [0; SECTIONS];
        let bytes = self.definition.element_bytes();
        for ((len, section), bytes) in lens.iter_mut().zip(self.sections).zip(bytes) {
            *len = (section.len() / bytes) as u32;
        }
        lens
    }

    /// Where this differs first from another message, byte for byte.
    pub(crate) fn difference(&self, other: &Self) -> Option<Difference> {
        let pairs = self.sections.iter().zip(other.sections);
        for (section, (one, other)) in self.definition.sections.iter().zip(pairs) {
            if *one == other {
                continue;
            }
            let rows = |memory: &[u8]| memory.len() / section.row.bytes;
            let row = |memory: &'_ [u8], at: usize| {
                let bytes = memory.chunks_exact(section.row.bytes).nth(at);
                bytes.map(|bytes| section.row.text(bytes))
            };
            let chunks = |memory| <[u8]>::chunks_exact(memory, section.row.bytes);
            let element = chunks(one).zip(chunks(other)).position(|(a, b)| a != b);
            let element = element.unwrap_or(rows(one).min(rows(other)));
            return Some(Difference {
                section: section.name,
                element,
                one: row(one, element),
                other: row(other, element),
            });
        }
        None
    }

    /// Its sections, with the first `most` rows of each.
    pub(crate) fn sections(&self, most: usize) -> Vec<Section> {
        let section = |(of, memory): (&crate::message::SectionType, &&[u8])| Section {
            name: of.name,
            len: memory.len() / of.row.bytes,
            bytes: memory.len(),
            first: memory
                .chunks_exact(of.row.bytes)
                .take(most)
                .map(|row| of.row.text(row))
                .collect(),
        };
        let sections = self.definition.sections.iter().zip(&self.sections);
        sections.map(section).collect()
    }
}

impl std::fmt::Debug for OtherView<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct(self.definition.schema)
            .field("sections", &self.sections(usize::MAX))
            .finish()
    }
}

impl PartialEq for OtherView<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.kind() == other.kind() && self.difference(other).is_none()
    }
}
