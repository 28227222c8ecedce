//! iceoryx2's services as this project uses them: every quality of service in one place.
#![allow(
    unsafe_code,
    reason = "writing results in place means to take loaned shared memory as it is"
)]

use std::rc::Rc;
use std::time::{Duration, Instant};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::{BusError, NodePlan, Run};
use crate::header::{Header, Size};
use crate::ledger::Shard;
use crate::message::ALIGNMENT;
use crate::topic::Topic;

/// The header as it stands before every payload in shared memory.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[type_name("tricurve.Header.2")]
pub(super) struct Head(pub(super) Words);

/// A [`Header`] as words, which iceoryx2 knows to be plain.
type Words = [u64; size_of::<Header>() / 8];

impl Head {
    fn of(header: &Header) -> Self {
        Self(bytemuck::cast(*header))
    }

    pub(super) fn header(self) -> Header {
        bytemuck::cast(self.0)
    }
}

pub(super) type DataPublisher = Publisher<ipc::Service, [u64], Head>;
pub(super) type DataSubscriber = Subscriber<ipc::Service, [u64], Head>;
pub(super) type DataSample = Sample<ipc::Service, [u64], Head>;
pub(super) type TextSubscriber = Subscriber<ipc::Service, [u8], Head>;
pub(super) type LoanedSample = SampleMut<ipc::Service, [u64], Head>;
pub(super) type FramesPublisher = Publisher<ipc::Service, [u8], Head>;
pub(super) type FramesSubscriber = Subscriber<ipc::Service, [u8], Head>;
pub(super) type FrameSample = Sample<ipc::Service, [u8], Head>;
type TextPublisher = Publisher<ipc::Service, [u8], Head>;
type DataService = PortFactory<ipc::Service, [u64], Head>;

/// Ports that viewers and further recorders may add to a running graph, per topic; address space only, until used.
pub(super) const GUESTS: usize = 6;
/// Ports that a dead process may leave until it is cleaned up after.
const DEAD: usize = 1;
/// The longest report or log line, in bytes.
const REPORT_BYTES: usize = 256 * 1024;
/// Reports a slow reader may lag behind.
const REPORTS: usize = 256;
/// Frames from outside that wait to be taken in.
const FRAMES: usize = 8;

/// Makes the ports of one process in one run.
pub(super) struct Ports {
    node: Node<ipc::Service>,
    run: Run,
    /// The scans that it makes messages of.
    shard: Shard,
    /// Whether it takes what is there and makes nothing.
    is_guest: bool,
}

/// Joins the run's own corner of shared memory, cleaning up after dead processes of the same run.
fn node(run: &Run, name: &str) -> Result<Node<ipc::Service>, BusError> {
    let what = || format!("join the run in {}", run.root.display());
    set_log_level(LogLevel::Fatal);
    let mut config = Config::default();
    let root = run.root.to_string_lossy();
    let root = Path::new(root.as_bytes()).map_err(|e| BusError::port(what(), e))?;
    config.global.set_root_path(&root);
    config.global.prefix =
        FileName::new(run.prefix.as_bytes()).map_err(|e| BusError::port(what(), e))?;
    NodeBuilder::new()
        .name(&NodeName::new(name).map_err(|e| BusError::port(what(), e))?)
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .map_err(|e| BusError::port(what(), e))
}

fn service_name(name: &str) -> Result<ServiceName, BusError> {
    ServiceName::new(name).map_err(|e| BusError::port(format!("name a service {name}"), e))
}

fn alignment() -> Result<Alignment, BusError> {
    Alignment::new(ALIGNMENT).ok_or_else(|| BusError::port("align payloads to", ALIGNMENT))
}

/// How long a guest waits for what the nodes of a graph that is just beginning have not made yet.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often it looks.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The builder of a service of a stream of plain data.
macro_rules! builder {
    ($node:expr, $name:expr, $element:ty, publishers $publishers:expr, subscribers $subscribers:expr,
     buffer $buffer:expr, overflow $overflow:expr) => {
        $node
            .service_builder(&service_name($name)?)
            .publish_subscribe::<[$element]>()
            .user_header::<Head>()
            .payload_alignment(alignment()?)
            .enable_safe_overflow($overflow)
            .subscriber_max_buffer_size($buffer)
            .subscriber_max_borrowed_samples($buffer)
            .history_size(0)
            .max_publishers($publishers + DEAD)
            .max_subscribers($subscribers + GUESTS + DEAD)
            .max_nodes(64)
    };
}

/// Opens the service of a stream of plain data; makes it if it is not there.
macro_rules! service {
    ($node:expr, $name:expr, $($kind:tt)*) => {
        builder!($node, $name, $($kind)*)
            .open_or_create()
            .map_err(|e| BusError::port(format!("open the service {}", $name), e))
    };
}

/// Opens the service of a stream of plain data that others make. A guest that made it would hear nothing for ever.
macro_rules! existing {
    ($node:expr, $name:expr, $($kind:tt)*) => {{
        let until = Instant::now() + PATIENCE;
        loop {
            match builder!($node, $name, $($kind)*).open() {
                Err(_) if Instant::now() < until => std::thread::sleep(LOOK_EVERY),
                opened => {
                    break opened
                        .map_err(|e| BusError::port(format!("open the service {}", $name), e));
                }
            }
        }
    }};
}

/// Why a subscriber could not be made.
fn not_subscribed(what: impl Into<String>, error: SubscriberCreateError) -> BusError {
    match error {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => BusError::Full(GUESTS),
        error => BusError::port(what, error),
    }
}

impl Ports {
    pub(super) fn new(run: &Run, name: &str) -> Result<Self, BusError> {
        let plan = run.nodes.iter().find(|node| node.name == name);
        Ok(Self {
            node: node(run, name)?,
            run: run.clone(),
            shard: plan.map_or(Shard::ALL, |plan| plan.shard),
            is_guest: false,
        })
    }

    /// Those of a guest, who listens to what is there.
    pub(super) fn of_guest(run: &Run, name: &str) -> Result<Self, BusError> {
        Ok(Self {
            is_guest: true,
            ..Self::new(run, name)?
        })
    }

    /// The service of a topic's messages of these scans: each instance of its maker has one of its own, so that its messages
    /// are in order, and a taker can go on with the oldest of all.
    fn data_service(&self, topic: &Topic, shard: Shard) -> Result<DataService, BusError> {
        let takers = self.run.takers(topic.kind).count();
        let name = match shard.is_all() {
            true => topic.name.clone(),
            false => format!("{}@{}/{}", topic.name, shard.index, shard.of),
        };
        match self.is_guest {
            true => existing!(self.node, &name, u64, publishers 1, subscribers takers,
                              buffer self.run.buffer(), overflow false),
            false => service!(self.node, &name, u64, publishers 1, subscribers takers,
                              buffer self.run.buffer(), overflow false),
        }
    }

    pub(super) fn publisher(&self, topic: &Topic) -> Result<(DataPublisher, Audience), BusError> {
        let service = self.data_service(topic, self.shard)?;
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(topic.kind.definition().words(self.run.rig.size))
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| BusError::port(format!("publish {}", topic.name), e))?;
        Ok((publisher, Audience(service)))
    }

    pub(super) fn subscriber(
        &self,
        topic: &Topic,
        shard: Shard,
    ) -> Result<DataSubscriber, BusError> {
        self.data_service(topic, shard)?
            .subscriber_builder()
            .create()
            .map_err(|e| not_subscribed(format!("subscribe to {}", topic.name), e))
    }

    fn finishers(&self) -> usize {
        self.run.nodes.iter().filter(|n| n.finishes).count()
    }

    pub(super) fn done_out(&self) -> Result<DataPublisher, BusError> {
        service!(self.node, "done", u64, publishers self.finishers(), subscribers 1,
                 buffer 2 * self.run.buffer(), overflow false)?
        .publisher_builder()
        .initial_max_slice_len(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(|e| BusError::port("publish done", e))
    }

    pub(super) fn done_in(&self) -> Result<DataSubscriber, BusError> {
        service!(self.node, "done", u64, publishers self.finishers(), subscribers 1,
                 buffer 2 * self.run.buffer(), overflow false)?
        .subscriber_builder()
        .create()
        .map_err(|e| BusError::port("hear done", e))
    }

    pub(super) fn reports_out(&self) -> Result<Reports, BusError> {
        let publisher = service!(self.node, "reports", u8, publishers self.run.nodes.len(),
                                 subscribers 2, buffer REPORTS, overflow true)?
        .publisher_builder()
        .initial_max_slice_len(REPORT_BYTES)
        .create()
        .map_err(|e| BusError::port("publish reports", e))?;
        Ok(Reports { publisher })
    }

    pub(super) fn reports_in(&self) -> Result<TextSubscriber, BusError> {
        let service = match self.is_guest {
            true => existing!(self.node, "reports", u8, publishers self.run.nodes.len(),
                              subscribers 2, buffer REPORTS, overflow true)?,
            false => service!(self.node, "reports", u8, publishers self.run.nodes.len(),
                              subscribers 2, buffer REPORTS, overflow true)?,
        };
        service
            .subscriber_builder()
            .create()
            .map_err(|e| not_subscribed("hear reports", e))
    }

    /// Where a program from outside publishes the frames of a view; one program only.
    pub(super) fn frames_out(&self, view: &str, size: Size) -> Result<FramesPublisher, BusError> {
        let name = format!("frames/{view}");
        let service = service!(self.node, &name, u8, publishers 1, subscribers 1, buffer FRAMES, overflow true)?;
        let is_taken = || service.dynamic_config().number_of_publishers() > 0;
        // One that died is cleaned up after by whoever comes first, which takes a moment.
        let until = Instant::now() + Duration::from_secs(1);
        while is_taken() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(50));
        }
        if is_taken() {
            let taken = "another program publishes this view already";
            return Err(BusError::port(format!("publish {name}"), taken));
        }
        service
            .publisher_builder()
            .initial_max_slice_len(size.pixels())
            .max_loaned_samples(1)
            .create()
            .map_err(|e| BusError::port(format!("publish {name}"), e))
    }

    pub(super) fn frames_in(&self, view: &str) -> Result<FramesSubscriber, BusError> {
        let name = format!("frames/{view}");
        service!(self.node, &name, u8, publishers 1, subscribers 1, buffer FRAMES, overflow true)?
            .subscriber_builder()
            .create()
            .map_err(|e| BusError::port(format!("hear {name}"), e))
    }

    pub(super) fn inbox(&self, name: &str) -> Result<Listener<ipc::Service>, BusError> {
        inbox_service(&self.node, name)?
            .listener_builder()
            .create()
            .map_err(|e| BusError::port(format!("make the inbox of {name}"), e))
    }

    /// The bells of these nodes' inboxes.
    pub(super) fn bells<'a>(
        &self,
        nodes: impl Iterator<Item = &'a NodePlan>,
    ) -> Result<Vec<Bell>, BusError> {
        nodes.map(|node| self.bell(&node.name)).collect()
    }

    /// The bell of the inbox of this name.
    pub(super) fn bell(&self, name: &str) -> Result<Bell, BusError> {
        Ok(Bell {
            notifier: bell(&self.node, name)?,
            _node: None,
        })
    }
}

/// Who listens to a topic at the moment.
pub(super) struct Audience(DataService);

impl Audience {
    pub(super) fn is_there(&self) -> bool {
        self.0.dynamic_config().number_of_subscribers() > 0
    }
}

type Inbox = iceoryx2::service::port_factory::event::PortFactory<ipc::Service>;

fn inbox_service(node: &Node<ipc::Service>, name: &str) -> Result<Inbox, BusError> {
    node.service_builder(&service_name(&format!("inbox/{name}"))?)
        .event()
        .max_listeners(1 + DEAD)
        .max_notifiers(64)
        .max_nodes(64)
        .open_or_create()
        .map_err(|e| BusError::port(format!("open the inbox of {name}"), e))
}

fn bell(node: &Node<ipc::Service>, name: &str) -> Result<Notifier<ipc::Service>, BusError> {
    inbox_service(node, name)?
        .notifier_builder()
        .create()
        .map_err(|e| BusError::port(format!("ring {name}"), e))
}

/// The bell of a node's inbox.
pub struct Bell {
    notifier: Notifier<ipc::Service>,
    /// Kept alive where the bell has a node of its own.
    _node: Option<Node<ipc::Service>>,
}

impl std::fmt::Debug for Bell {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bell").finish_non_exhaustive()
    }
}

impl Bell {
    pub(super) fn new(run: &Run, name: &str) -> Result<Self, BusError> {
        let node = node(run, &format!("{name}.bell"))?;
        Ok(Self {
            notifier: bell(&node, name)?,
            _node: Some(node),
        })
    }

    /// Wakes the node. A node that is dead or not there yet needs no waking: it looks when it comes.
    pub fn ring(&self) {
        self.notifier.notify().unwrap_or_default();
    }
}

/// What is shorter is not waited for at all.
const LEAST_WAIT: Duration = Duration::from_micros(10);

/// Waits until the inbox is rung or the time is over, and empties it.
pub(super) fn wait(inbox: &Listener<ipc::Service>, timeout: Duration) -> Result<(), BusError> {
    use iceoryx2::port::listener::ListenerWaitError;
    // The socket below counts whole microseconds, and none at all is for ever to it.
    let heard = match timeout < LEAST_WAIT {
        true => inbox.try_wait(|_| {}),
        false => inbox.timed_wait(|_| {}, timeout),
    };
    match heard {
        Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
        Err(cause) => Err(BusError::port("wait at the inbox", cause)),
    }
}

/// Connects a subscriber to publishers that came after it.
pub(super) fn connect(subscriber: &DataSubscriber) -> Result<(), BusError> {
    subscriber
        .update_connections()
        .map_err(|e| BusError::port("connect a subscriber", e))
}

/// Takes shared memory on loan, whatever lies in it.
pub(super) fn loan(publisher: &DataPublisher, words: usize) -> Result<LoanedSample, BusError> {
    let loan = publisher
        .loan_slice_uninit(words)
        .map_err(|e| BusError::port("loan shared memory", e))?;
    // SAFETY: every bit pattern is a u64, and the memory is mapped: zero pages of a new segment or an older message.
    Ok(unsafe { loan.assume_init() })
}

/// Sends a loaned message to all who are there.
pub(super) fn send(mut sample: LoanedSample, header: &Header) -> Result<(), BusError> {
    *sample.user_header_mut() = Head::of(header);
    sample.send().map_err(|e| BusError::port("send", e))?;
    Ok(())
}

/// Sends a few words.
pub(super) fn send_words(
    publisher: &DataPublisher,
    header: &Header,
    words: &[u64],
) -> Result<(), BusError> {
    let mut sample = loan(publisher, words.len())?;
    sample.payload_mut().copy_from_slice(words);
    send(sample, header)
}

/// Sends a frame that is written in place.
pub(super) fn frame(
    publisher: &FramesPublisher,
    header: &Header,
    fill: impl FnOnce(&mut [u8]),
) -> Result<(), BusError> {
    let loan = publisher
        .loan_slice_uninit(header.size().pixels())
        .map_err(|e| BusError::port("loan shared memory", e))?;
    // SAFETY: every bit pattern is a u8, and the memory is mapped: zero pages of a new segment or an older frame.
    let mut sample = unsafe { loan.assume_init() };
    fill(sample.payload_mut());
    *sample.user_header_mut() = Head::of(header);
    sample
        .send()
        .map_err(|e| BusError::port("send a frame", e))?;
    Ok(())
}

/// The next message.
pub(super) fn receive(subscriber: &DataSubscriber) -> Result<Option<DataSample>, BusError> {
    subscriber
        .receive()
        .map_err(|e| BusError::port("receive", e))
}

/// The next message of a stream of single words.
pub(super) fn receive_word(
    subscriber: &Rc<DataSubscriber>,
) -> Result<Option<(Header, u64)>, BusError> {
    let sample = receive(subscriber)?;
    Ok(sample.map(|s| {
        (
            s.user_header().header(),
            s.payload().first().copied().unwrap_or_default(),
        )
    }))
}

/// The next report, as text.
pub(super) fn receive_text(subscriber: &TextSubscriber) -> Result<Option<String>, BusError> {
    let sample = subscriber
        .receive()
        .map_err(|e| BusError::port("receive", e))?;
    Ok(sample.map(|s| String::from_utf8_lossy(s.payload()).into_owned()))
}

/// Where a node publishes what it has to report.
pub(super) struct Reports {
    publisher: TextPublisher,
}

impl Reports {
    /// Publishes a report as JSON. What cannot be sent is lost here only: the launcher gets it on its own way too.
    pub(super) fn send(&self, report: &impl serde::Serialize) {
        let Ok(text) = serde_json::to_vec(report) else {
            return;
        };
        if text.len() > REPORT_BYTES {
            return;
        }
        if let Ok(loan) = self.publisher.loan_slice_uninit(text.len()) {
            loan.write_from_slice(&text).send().unwrap_or_default();
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::{Delivery, Rig, Size};

    #[test]
    fn a_wait_ends_however_short_it_is() {
        let (say, heard) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let folder = tempfile::tempdir().unwrap();
            let run = Run {
                root: folder.path().to_owned(),
                prefix: format!("tricurve_test_{:x}-", std::process::id()),
                rig: Rig::of_views(3, &[1.0], Size::new(64, 48)),
                delivery: Delivery::Live,
                cameras: false,
                in_flight: 1,
                nodes: Vec::new(),
            };
            let inbox = Ports::new(&run, "node").unwrap().inbox("node").unwrap();
            for nanos in [0, 1, 999, 1_000, 9_999, 10_000, 1_000_000] {
                wait(&inbox, Duration::from_nanos(nanos)).unwrap();
                say.send(nanos).unwrap();
            }
        });
        let long = Duration::from_secs(20);
        for nanos in [0, 1, 999, 1_000, 9_999, 10_000, 1_000_000] {
            assert_eq!(heard.recv_timeout(long), Ok(nanos));
        }
    }
}
