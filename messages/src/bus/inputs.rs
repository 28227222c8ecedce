//! The receiving side: messages one by one, or scan by scan.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use super::ports::{self, DataSample, DataSubscriber, Ports};
use super::{Book, BusError, Run};
use crate::header::{Header, Size};
use crate::payload::{AnyView, Message};
use crate::topic::{Kind, Topic};

/// A message as received: its payload lies in shared memory until this is dropped.
#[derive(Debug)]
pub struct Received {
    sample: DataSample,
    topic: Rc<Topic>,
    room: Size,
    is_new: bool,
}

impl Received {
    /// Its head.
    pub fn header(&self) -> Header {
        self.sample.user_header().header()
    }

    /// Its topic.
    pub fn topic(&self) -> &Topic {
        &self.topic
    }

    /// Whether this scan of this topic came for the first time.
    pub fn is_new(&self) -> bool {
        self.is_new
    }

    /// Its payload.
    ///
    /// # Errors
    /// [`BusError::Damaged`] when its lengths do not fit or it is of another kind.
    pub fn view<M: Message>(&self) -> Result<M::View<'_>, BusError> {
        let header = self.header();
        (self.topic.kind == M::KIND)
            .then(|| M::view(self.sample.payload(), self.room, header.lens))
            .flatten()
            .ok_or_else(|| self.damaged())
    }

    /// Its payload, whatever its kind.
    ///
    /// # Errors
    /// [`BusError::Damaged`] when its lengths do not fit.
    pub fn any_view(&self) -> Result<AnyView<'_>, BusError> {
        let lens = self.header().lens;
        let view = AnyView::of(self.topic.kind, self.sample.payload(), self.room, lens);
        view.ok_or_else(|| self.damaged())
    }

    /// The error that says this message is damaged.
    pub fn damaged(&self) -> BusError {
        BusError::Damaged {
            topic: self.topic.name.clone(),
            sequence: self.header().sequence,
        }
    }
}

struct Input {
    topic: Rc<Topic>,
    subscriber: Rc<DataSubscriber>,
    head: Option<DataSample>,
}

/// Subscribers of several topics, read together.
pub struct Inputs {
    all: Vec<Input>,
    room: Size,
    book: Rc<RefCell<Book>>,
}

impl std::fmt::Debug for Inputs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let topics = self.all.iter().map(|input| &input.topic.name);
        f.debug_list().entries(topics).finish()
    }
}

impl Inputs {
    pub(super) fn new(
        run: &Run,
        ports: &Ports,
        topics: impl IntoIterator<Item = Topic>,
        book: Rc<RefCell<Book>>,
    ) -> Result<Self, BusError> {
        let input = |topic: Topic| {
            book.borrow_mut().take_in(&topic.name);
            Ok(Input {
                subscriber: Rc::new(ports.subscriber(&topic)?),
                topic: Rc::new(topic),
                head: None,
            })
        };
        Ok(Self {
            all: topics
                .into_iter()
                .map(input)
                .collect::<Result<_, BusError>>()?,
            room: run.rig.size,
            book,
        })
    }

    pub(super) fn subscribers(&self) -> impl Iterator<Item = Rc<DataSubscriber>> + '_ {
        self.all.iter().map(|input| Rc::clone(&input.subscriber))
    }

    /// The message of the oldest scan among those waiting, if any.
    pub(super) fn receive(&mut self) -> Result<Option<Received>, BusError> {
        for input in &mut self.all {
            if input.head.is_none() {
                input.head = ports::receive(&input.subscriber)?;
            }
        }
        let sequence = |i: &Input| i.head.as_ref().map(|s| s.user_header().header().sequence);
        let oldest = self
            .all
            .iter_mut()
            .filter(|i| i.head.is_some())
            .min_by_key(|i| sequence(i));
        let Some((input, sample)) = oldest.and_then(|i| i.head.take().map(|sample| (i, sample)))
        else {
            return Ok(None);
        };
        let header = sample.user_header().header();
        let is_new = self.book.borrow_mut().received(&input.topic.name, &header);
        Ok(Some(Received {
            sample,
            topic: Rc::clone(&input.topic),
            room: self.room,
            is_new,
        }))
    }
}

/// One whole scan: a message of every topic joined.
#[derive(Debug)]
pub struct Joined {
    /// The scan's number.
    pub sequence: u64,
    messages: Vec<Received>,
}

impl Joined {
    /// Its messages, by kind as they were asked for, then view, then channel.
    pub fn messages(&self) -> &[Received] {
        &self.messages
    }

    /// The message of this kind, view and channel.
    ///
    /// # Errors
    /// When the scan has no such topic.
    pub fn of(&self, kind: Kind, view: u32, channel: u32) -> Result<&Received, BusError> {
        let key = (kind, view, channel);
        let is = |m: &&Received| (m.topic.kind, m.topic.view, m.topic.channel) == key;
        let found = self.messages.iter().find(is);
        found.ok_or_else(|| BusError::port("find a topic of the scan", key))
    }

    /// The heads and payloads of its messages.
    ///
    /// # Errors
    /// [`BusError::Damaged`] when the lengths or indices of one do not fit.
    pub fn views(&self) -> Result<Vec<(Header, AnyView<'_>)>, BusError> {
        let mut views = Vec::with_capacity(self.messages.len());
        for message in &self.messages {
            let view = message.any_view()?;
            if !view.is_sound() {
                return Err(message.damaged());
            }
            views.push((message.header(), view));
        }
        Ok(views)
    }

    /// What the heads of all its messages agree on; what they do not is [`NONE`](crate::NONE) or zero.
    pub fn header(&self) -> Header {
        let heads = self.messages.iter().map(Received::header);
        let done_below = heads.clone().map(|head| head.done_below).max();
        let first = heads.clone().next().unwrap_or_default();
        let stand_together = heads
            .clone()
            .all(|head| head.position_m == first.position_m);
        Header {
            done_below: done_below.unwrap_or_default(),
            position_m: if stand_together {
                first.position_m
            } else {
                0.0
            },
            // Only a rail sways, and there all are of one frame.
            sway: first.sway,
            ..Header::new(self.sequence, first.capture_nanos, first.size())
        }
    }

    /// Whether a scan that was joined before came again.
    pub fn is_again(&self) -> bool {
        self.messages.iter().all(|m| !m.is_new)
    }
}

/// Subscribers of several topics whose messages are handed over scan by scan.
#[derive(Debug)]
pub struct Joins {
    inputs: Inputs,
    pending: BTreeMap<u64, Vec<Option<Received>>>,
}

impl Joins {
    pub(super) fn new(inputs: Inputs) -> Self {
        Self {
            inputs,
            pending: BTreeMap::new(),
        }
    }

    /// Takes in what has come, until a scan is whole.
    pub(super) fn receive(&mut self) -> Result<Option<Joined>, BusError> {
        while let Some(message) = self.inputs.receive()? {
            let header = message.header();
            // What a resend doubled and is done by now never becomes whole: let its memory go.
            self.pending = self.pending.split_off(&header.done_below);
            let topics = self.inputs.all.iter();
            let Some(place) = topics.map(|i| &i.topic).position(|t| *t == message.topic) else {
                continue;
            };
            let len = self.inputs.all.len();
            let slots = self
                .pending
                .entry(header.sequence)
                .or_insert_with(|| std::iter::repeat_with(|| None).take(len).collect());
            slots[place] = Some(message);
            if slots.iter().all(Option::is_some) {
                let slots = self.pending.remove(&header.sequence).unwrap_or_default();
                return Ok(Some(Joined {
                    sequence: header.sequence,
                    messages: slots.into_iter().flatten().collect(),
                }));
            }
        }
        Ok(None)
    }
}
