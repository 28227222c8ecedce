//! The receiving side: messages one by one, or scan by scan.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use super::ports::{self, DataSample, DataSubscriber, Ports};
use super::{Book, BusError, Run};
use crate::header::{Header, Size};
use crate::ledger::Shard;
use crate::message::Message;
use crate::payload::{AnyView, Kind};
use crate::topic::Topic;

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

/// What one instance of a topic's maker sends.
struct Input {
    topic: Rc<Topic>,
    subscriber: Rc<DataSubscriber>,
    head: Option<DataSample>,
}

/// Subscribers of several topics, read together.
pub struct Inputs {
    all: Vec<Input>,
    /// The scans that are taken: the others are another instance's.
    shard: Shard,
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
        let shard = book.borrow().shard;
        let mut all = Vec::new();
        for topic in topics {
            book.borrow_mut().take_in(&topic.name);
            let topic = Rc::new(topic);
            for makers in run.shards_of(topic.kind).filter(|own| own.meets(&shard)) {
                all.push(Input {
                    subscriber: Rc::new(ports.subscriber(&topic, makers)?),
                    topic: Rc::clone(&topic),
                    head: None,
                });
            }
        }
        Ok(Self {
            all,
            shard,
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
            while input.head.is_none() {
                let Some(sample) = ports::receive(&input.subscriber)? else {
                    break;
                };
                let sequence = sample.user_header().header().sequence;
                input.head = self.shard.owns(sequence).then_some(sample);
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
    /// Of each scan a place for the message of every one of these.
    topics: Vec<Rc<Topic>>,
    pending: BTreeMap<u64, Vec<Option<Received>>>,
    order: Option<Order>,
}

/// Scans in the order of their numbers, where several instances make what they are joined of.
#[derive(Debug)]
struct Order {
    /// The place of the scan that comes next, among those that are taken.
    next: u64,
    /// Whole ones that wait for it.
    early: BTreeMap<u64, Joined>,
    /// The scans below this one are done.
    done_below: u64,
    /// Scans that may be under way.
    room: usize,
}

impl Joins {
    pub(super) fn new(inputs: Inputs) -> Self {
        let mut topics: Vec<Rc<Topic>> = Vec::new();
        for input in &inputs.all {
            if !topics.contains(&input.topic) {
                topics.push(Rc::clone(&input.topic));
            }
        }
        Self {
            inputs,
            topics,
            pending: BTreeMap::new(),
            order: None,
        }
    }

    /// Hands scans over in order, from this one on; those that come once more as they come. So many may be under way.
    pub(super) fn in_order(inputs: Inputs, first: u64, in_flight: usize) -> Self {
        let order = Order {
            next: inputs.shard.below(first),
            early: BTreeMap::new(),
            done_below: 0,
            room: in_flight,
        };
        Self {
            order: Some(order),
            ..Self::new(inputs)
        }
    }

    /// Takes in what has come, until a scan is whole whose turn it is.
    pub(super) fn receive(&mut self) -> Result<Option<Joined>, BusError> {
        loop {
            if let Some(joined) = self.order.as_mut().and_then(Order::turn) {
                return Ok(Some(joined));
            }
            let joined = self.whole()?;
            let shard = self.inputs.shard;
            let Some(order) = &mut self.order else {
                return Ok(joined);
            };
            let Some(joined) = joined else {
                // All that was sent has been read: what is done and is not here was lost on the way, to this listener alone.
                let done = shard.below(order.done_below);
                order.skip(|first, _| first <= done);
                return Ok(order.turn());
            };
            order.done_below = order.done_below.max(joined.header().done_below);
            let place = shard.below(joined.sequence);
            if place < order.next {
                return Ok(Some(joined));
            }
            order.early.insert(place, joined);
            // More are not let in while one is under way that would come before them: it was lost.
            order.skip(|_, order| order.early.len() >= order.room);
        }
    }

    /// Takes in what has come, until a scan is whole.
    fn whole(&mut self) -> Result<Option<Joined>, BusError> {
        while let Some(message) = self.inputs.receive()? {
            let header = message.header();
            // What a resend doubled and is done by now never becomes whole: let its memory go.
            self.pending = self.pending.split_off(&header.done_below);
            let mut topics = self.topics.iter();
            let Some(place) = topics.position(|topic| *topic == message.topic) else {
                continue;
            };
            let len = self.topics.len();
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

impl Order {
    /// The scan whose turn it is, if it is here.
    fn turn(&mut self) -> Option<Joined> {
        let joined = self.early.remove(&self.next)?;
        self.next += 1;
        Some(joined)
    }

    /// Goes on with the first scan that is here, at its place, where nobody can come before it.
    fn skip(&mut self, is_next: impl Fn(u64, &Self) -> bool) {
        if let Some((&first, _)) = self.early.first_key_value()
            && is_next(first, self)
        {
            self.next = first;
        }
    }
}
