//! The sending side: results are written in place in shared memory.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::ports::{self, Bell, DataPublisher, Ports};
use super::{Book, BusError, Run};
use crate::header::{Header, Size};
use crate::payload::Message;
use crate::topic::{Kind, Topic};

struct Output {
    topic: Topic,
    publisher: DataPublisher,
    takers: Vec<Bell>,
}

/// Publishers of several topics.
pub struct Outputs {
    all: Vec<Output>,
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
        book: Rc<RefCell<Book>>,
    ) -> Result<Self, BusError> {
        let topics = kinds.iter().flat_map(|&kind| Topic::of(&run.rig, kind));
        let output = |topic: Topic| {
            let mut book = book.borrow_mut();
            book.tally(&topic.name).published.get_or_insert_default();
            book.meter.expect_one_more();
            Ok(Output {
                publisher: ports.publisher(&topic)?,
                takers: ports.bells(run.takers(topic.kind))?,
                topic,
            })
        };
        let all = topics.map(output).collect::<Result<_, BusError>>()?;
        Ok(Self {
            all,
            room: run.rig.size,
            book,
        })
    }

    /// Lets `fill` write the message of this view and channel in place, then sends it to all who take it.
    ///
    /// `cause` is the head of the message it was made from; what applies to both is taken over. What `fill` has no
    /// room for is counted as dropped.
    ///
    /// # Errors
    /// When there is no such topic or no shared memory to loan.
    pub fn send<M: Message>(
        &self,
        cause: &Header,
        view: u32,
        channel: u32,
        fill: impl FnOnce(&mut M::Room<'_>),
    ) -> Result<(), BusError> {
        let is =
            |o: &&Output| (o.topic.kind, o.topic.view, o.topic.channel) == (M::KIND, view, channel);
        let output =
            self.all.iter().find(is).ok_or_else(|| {
                BusError::port("find a topic to publish", (M::KIND, view, channel))
            })?;
        let mut refused = 0;
        let mut elapsed = Duration::ZERO;
        ports::send_in_place(&output.publisher, M::words(self.room), |payload| {
            let mut header = Header {
                view,
                channel,
                lens: [0; 4],
                ..*cause
            };
            if let Some(mut room) = M::room(payload, self.room) {
                fill(&mut room);
                header.lens = M::lens(&room);
                refused = M::refused(&room);
            }
            let now = Instant::now();
            let since = self.book.borrow_mut().mark.replace(now);
            elapsed = since.map(|mark| now - mark).unwrap_or_default();
            header.elapsed_nanos = elapsed.as_nanos() as u64;
            header
        })?;
        output.takers.iter().for_each(Bell::ring);
        let mut book = self.book.borrow_mut();
        book.published(&output.topic.name, cause.sequence);
        book.meter.add(cause.sequence, elapsed);
        if refused > 0 {
            let dropped = &mut book.tally(&output.topic.name).dropped;
            *dropped
                .entry("elements beyond the worst case".to_owned())
                .or_default() += refused as u64;
        }
        Ok(())
    }
}
