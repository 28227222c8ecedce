//! The sending side: results are written in place in shared memory.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::rc::Rc;
use std::time::Instant;

use super::ports::{self, Audience, Bell, DataPublisher, LoanedSample, Ports};
use super::{Book, BusError, NodePlan, Run};
use crate::header::{Header, Size};
use crate::message::{Message, SECTIONS};
use crate::other::OtherView;
use crate::payload::Kind;
use crate::topic::Topic;

struct Output {
    topic: Topic,
    publisher: DataPublisher,
    audience: Audience,
    /// Whether the run's ledger asks for it.
    is_owed: bool,
    takers: Vec<Rc<Bell>>,
}

/// Names a message that is lost on its way, as `TOPIC:SCAN`: so that it can be tried whether that is noticed.
const LOSE: &str = "TRICURVE_LOSE";

/// Publishers of several topics.
pub struct Outputs {
    all: Vec<Output>,
    lost: Option<(String, u64)>,
    room: Size,
    book: Rc<RefCell<Book>>,
}

impl std::fmt::Debug for Outputs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let topics = self.all.iter().map(|output| &output.topic.name);
        f.debug_list().entries(topics).finish()
    }
}

impl Outputs {
    pub(super) fn new(
        run: &Run,
        ports: &Ports,
        kinds: &[Kind],
        owed: impl Fn(Kind) -> bool,
        book: Rc<RefCell<Book>>,
    ) -> Result<Self, BusError> {
        let topics = kinds.iter().flat_map(|&kind| Topic::of(&run.rig, kind));
        let takes_any = |node: &&NodePlan| kinds.iter().any(|kind| node.takes.contains(kind));
        let takers: Vec<&NodePlan> = run.nodes.iter().filter(takes_any).collect();
        let bells = ports.bells(takers.iter().copied())?;
        let bells: Vec<Rc<Bell>> = bells.into_iter().map(Rc::new).collect();
        let output = |topic: Topic| {
            let is_owed = owed(topic.kind);
            if is_owed {
                book.borrow_mut().send_out(&topic.name);
            }
            let takes = takers.iter().map(|node| node.takes.contains(&topic.kind));
            let rung = bells.iter().zip(takes).filter(|(_, takes)| *takes);
            let (publisher, audience) = ports.publisher(&topic)?;
            Ok(Output {
                publisher,
                audience,
                is_owed,
                takers: rung.map(|(bell, _)| Rc::clone(bell)).collect(),
                topic,
            })
        };
        let all = topics.map(output).collect::<Result<_, BusError>>()?;
        let lost = std::env::var(LOSE).ok().and_then(|message| {
            let (topic, scan) = message.rsplit_once(':')?;
            Some((topic.to_owned(), scan.parse().ok()?))
        });
        Ok(Self {
            all,
            lost,
            room: run.rig.size,
            book,
        })
    }

    fn output(&self, topic: &Topic) -> Option<&Output> {
        self.all.iter().find(|output| output.topic == *topic)
    }

    /// Whether every scan's message of this topic is to be published: the run's ledger counts it.
    pub fn is_owed(&self, topic: &Topic) -> bool {
        self.output(topic).is_some_and(|output| output.is_owed)
    }

    /// Whether the message of this topic is to be published now: it is owed, or a guest listens.
    pub fn is_wanted(&self, topic: &Topic) -> bool {
        let is_wanted = |output: &Output| output.is_owed || output.audience.is_there();
        self.output(topic).is_some_and(is_wanted)
    }

    /// Shared memory for the message of this view and channel, to be written in place and then
    /// [published](Self::publish).
    ///
    /// # Errors
    /// When there is no such topic or no shared memory to loan.
    pub fn loan<M: Message>(&self, view: u32, channel: u32) -> Result<Loan<M>, BusError> {
        let (sample, output) = self.loan_of(M::KIND, view, channel)?;
        Ok(Loan {
            sample,
            output,
            room: self.room,
            kind: PhantomData,
        })
    }

    fn loan_of(
        &self,
        kind: Kind,
        view: u32,
        channel: u32,
    ) -> Result<(LoanedSample, usize), BusError> {
        let key = (kind, view, channel);
        let is = |o: &Output| (o.topic.kind, o.topic.view, o.topic.channel) == key;
        let output = self.all.iter().position(is);
        let output = output.ok_or_else(|| BusError::port("find a topic to publish", key))?;
        let words = kind.definition().words(self.room);
        let sample = ports::loan(&self.all[output].publisher, words)?;
        Ok((sample, output))
    }

    /// Sends what was written to all who take it.
    ///
    /// `cause` is the head of the message it was made from; what applies to both is taken over. `filled` says how much
    /// of the room was filled; what found no room is counted as dropped.
    ///
    /// # Errors
    /// When the message cannot be sent.
    pub fn publish<M: Message>(
        &self,
        loan: Loan<M>,
        cause: &Header,
        filled: Filled,
    ) -> Result<(), BusError> {
        self.publish_sample(loan.sample, loan.output, cause, filled)
    }

    /// Publishes a message of others that is known by its memory alone, under its header's view and channel.
    ///
    /// # Errors
    /// As [`loan`](Self::loan) and [`publish`](Self::publish).
    pub fn send_other(&self, header: &Header, message: OtherView<'_>) -> Result<(), BusError> {
        let (mut sample, output) = self.loan_of(message.kind(), header.view, header.channel)?;
        let words = sample.payload_mut();
        let filled = Filled::of_other(message, self.room, words);
        let filled =
            filled.ok_or_else(|| BusError::port("fit a message into words", header.lens))?;
        self.publish_sample(sample, output, header, filled)
    }

    fn publish_sample(
        &self,
        sample: LoanedSample,
        output: usize,
        cause: &Header,
        filled: Filled,
    ) -> Result<(), BusError> {
        let output = &self.all[output];
        let now = Instant::now();
        let since = self.book.borrow_mut().mark.replace(now);
        let elapsed = since.map(|mark| now - mark).unwrap_or_default();
        let header = Header {
            view: output.topic.view,
            channel: output.topic.channel,
            lens: filled.lens,
            elapsed_nanos: elapsed.as_nanos() as u64,
            ..*cause
        };
        let is_lost =
            |(topic, scan): &(String, u64)| *topic == output.topic.name && *scan == cause.sequence;
        if !self.lost.as_ref().is_some_and(is_lost) {
            ports::send(sample, &header)?;
        }
        output.takers.iter().for_each(|bell| bell.ring());
        let mut book = self.book.borrow_mut();
        book.bytes += filled.bytes;
        if !output.is_owed {
            return Ok(());
        }
        book.published(&output.topic.name, cause.sequence);
        book.meter.add(cause.sequence, elapsed);
        if filled.refused > 0 {
            let dropped = &mut book.tally(&output.topic.name).dropped;
            let cause = "elements beyond the worst case".to_owned();
            *dropped.entry(cause).or_default() += filled.refused as u64;
        }
        Ok(())
    }

    /// Lets `fill` write the message of this view and channel in place, then publishes it.
    ///
    /// # Errors
    /// As [`loan`](Self::loan) and [`publish`](Self::publish).
    pub fn send<M: Message>(
        &self,
        cause: &Header,
        view: u32,
        channel: u32,
        fill: impl FnOnce(&mut M::Room<'_>),
    ) -> Result<(), BusError> {
        let mut loan = self.loan::<M>(view, channel)?;
        let filled = {
            let mut room = loan.room()?;
            fill(&mut room);
            Filled::of::<M>(&room)
        };
        self.publish(loan, cause, filled)
    }
}

/// How much of a room was filled.
#[derive(Clone, Copy, Debug)]
pub struct Filled {
    lens: [u32; SECTIONS],
    refused: usize,
    /// The bytes of what was filled in.
    bytes: u64,
}

impl Filled {
    /// How much of this room was filled.
    pub fn of<M: Message>(room: &M::Room<'_>) -> Self {
        let lens = M::lens(room);
        let sections = lens.iter().zip(M::element_bytes());
        let bytes = sections.map(|(len, bytes)| u64::from(*len) * bytes as u64);
        Self {
            lens,
            refused: M::refused(room),
            bytes: bytes.sum(),
        }
    }

    /// Copies a message of others to where its sections belong in a payload laid out for images up to `size`; `None` where one
    /// finds no room.
    fn of_other(message: OtherView<'_>, size: Size, words: &mut [u64]) -> Option<Self> {
        let payload: &mut [u8] = bytemuck::cast_slice_mut(words);
        let offsets = message.definition().offsets(size);
        let sections = message.memory();
        for (bounds, section) in offsets.windows(2).zip(&sections) {
            let slots = payload.get_mut(bounds[0]..bounds[1])?;
            slots.get_mut(..section.len())?.copy_from_slice(section);
        }
        Some(Self {
            lens: message.lens(),
            refused: 0,
            bytes: sections.iter().map(|section| section.len() as u64).sum(),
        })
    }
}

/// Shared memory on loan for one message.
pub struct Loan<M> {
    sample: LoanedSample,
    output: usize,
    room: Size,
    kind: PhantomData<M>,
}

impl<M> std::fmt::Debug for Loan<M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Loan")
            .field("room", &self.room)
            .finish_non_exhaustive()
    }
}

impl<M: Message> Loan<M> {
    /// The room to fill, empty.
    ///
    /// # Errors
    /// When the memory is smaller than the room, which the bus prevents.
    pub fn room(&mut self) -> Result<M::Room<'_>, BusError> {
        let words = self.sample.payload_mut();
        let have = words.len();
        M::room(words, self.room).ok_or_else(|| BusError::port("fit a message into words", have))
    }

    /// What was filled in, as its readers will see it.
    pub fn view(&mut self, filled: &Filled) -> Option<M::View<'_>> {
        M::view(self.sample.payload_mut(), self.room, filled.lens)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Curve, Curves, Edge, Owned};

    #[test]
    fn a_message_weighs_what_its_sections_hold_and_not_the_room_they_had() {
        let mut curves = Owned::<Curves>::new(Size::new(33, 17));
        let filled = curves.fill(|room| {
            room.curves.push(Curve::default());
            room.points.extend_from_slice(&[Edge::default(); 3]);
            Filled::of::<Curves>(room)
        });
        let sections = curves.view().sections(0);
        let bytes: usize = sections.iter().map(|section| section.bytes).sum();
        assert!(bytes > 0);
        assert_eq!(filled.bytes, bytes as u64);
    }
}
