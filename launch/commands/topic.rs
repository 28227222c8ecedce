//! `tricurve topic`: the topics that nodes of a running graph send each other. What recorders and viewers make of them for
//! themselves is on no bus: see [`Content`].

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use messages::bus::{Hearer, LOOK_EVERY, Received};
use messages::record::{Channel, Codec, Content, Schema, Shown};
use messages::{Section, Topic};
use serde::Serialize;

use crate::cli::{TopicArgs, TopicCommand};
use crate::node::Orders;
use crate::running::Running;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &TopicArgs) -> Result<Outcome, Failure> {
    let running = Running::choose(args.asked.run.as_deref())?;
    match &args.command {
        TopicCommand::List => list(&running, args.asked.json),
        TopicCommand::Info { topic } => info(&running, topic, args.asked.json),
        TopicCommand::Hz { topic, seconds } => hz(&running, topic, *seconds, args.asked.json),
        TopicCommand::Echo {
            topic,
            count,
            elements,
        } => echo(&running, topic, *count, *elements, args.asked.json),
    }
    .map(|()| Outcome::Done)
}

/// What is known of a topic without listening.
#[derive(Debug, Serialize)]
struct Known {
    topic: String,
    /// What its messages are called in a recording.
    schema: String,
    maker: Option<String>,
    takers: Vec<String>,
}

impl Known {
    fn of(running: &Running, topic: &Topic) -> Self {
        let nodes = || running.orders.run.nodes.iter();
        let maker = nodes().find(|node| node.makes.contains(&topic.kind));
        let takers = nodes().filter(|node| node.takes.contains(&topic.kind));
        Self {
            topic: topic.name.clone(),
            schema: Schema::of(topic.kind).name,
            maker: maker.map(|node| node.name.clone()),
            takers: takers.map(|node| node.name.clone()).collect(),
        }
    }
}

/// The topics that are made, in the order of the pipe.
fn topics(running: &Running) -> Vec<Topic> {
    let run = &running.orders.run;
    let kinds = run.kinds().into_iter();
    kinds.flat_map(|kind| Topic::of(&run.rig, kind)).collect()
}

/// The topic that is meant.
fn find(running: &Running, name: &str) -> Result<Topic, Failure> {
    let topics = topics(running);
    let found = topics.iter().find(|topic| topic.name == name);
    found.cloned().ok_or_else(|| {
        if is_derived(running, name) {
            return Failure::usage(format!(
                "{name} is made only where a graph is recorded or viewed, and nodes do not send it: look at it with \
                 `tricurve view` or `tricurve record`"
            ));
        }
        let names = || topics.iter().map(|topic| topic.name.as_str());
        Failure::usage(match messages::settings::nearest(name, names()) {
            Some(near) => format!("the run has no topic {name}; do you mean {near}?"),
            None => format!(
                "the run has no topic {name}; it has {}",
                names().collect::<Vec<_>>().join(", ")
            ),
        })
    })
}

/// Whether recordings and viewers have this topic, made of what nodes send.
fn is_derived(running: &Running, name: &str) -> bool {
    let Orders {
        run, configuration, ..
    } = &running.orders;
    let reference = bridge::node::reference_of(run, configuration);
    let codec = Codec::new(run.rig.clone(), reference);
    let channels = codec.channels_of(Shown::ALL, &run.kinds());
    let is_it = |channel: &Channel| channel.name == name;
    channels
        .iter()
        .any(|channel| is_it(channel) && !matches!(channel.content, Content::Data(_)))
}

fn listen(running: &Running, topic: &Topic) -> Result<Hearer, Failure> {
    let name = format!("topic.{}", std::process::id());
    let topics = std::slice::from_ref(topic);
    Hearer::join(&running.orders.run, &name, topics).map_err(|error| running.cannot_join(&error))
}

fn list(running: &Running, json: bool) -> Result<(), Failure> {
    let topics = topics(running);
    let known: Vec<Known> = topics.iter().map(|t| Known::of(running, t)).collect();
    if json {
        return super::print_json(&known);
    }
    let titles = ["topic", "schema", "made by", "taken by"].map(str::to_owned);
    let row = |known: Known| {
        let maker = known.maker.unwrap_or_default();
        [known.topic, known.schema, maker, known.takers.join(", ")]
    };
    let rows = std::iter::once(titles).chain(known.into_iter().map(row));
    super::print(&super::aligned(&rows.collect::<Vec<_>>()))
}

fn info(running: &Running, name: &str, json: bool) -> Result<(), Failure> {
    let topic = find(running, name)?;
    let known = Known::of(running, &topic);
    if json {
        return super::print_json(&known);
    }
    let rig = &running.orders.run.rig;
    let mut text = format!("{}\n  schema    {}\n", known.topic, known.schema);
    let view = rig.views.get(topic.view as usize).map(|view| &view.name);
    let channel = rig.channels.get(topic.channel as usize);
    let lines = [
        ("view", view.cloned()),
        ("channel", channel.map(|variance| format!("σ² {variance}"))),
        ("made by", known.maker),
        ("taken by", Some(known.takers.join(", "))),
        ("images to", Some(rig.size.to_string())),
    ];
    for (name, value) in lines {
        if let Some(value) = value {
            writeln!(text, "  {name:<9} {value}").unwrap_or_default();
        }
    }
    super::print(&text)
}

/// How a topic comes.
#[derive(Debug, Default, Serialize)]
struct Rate {
    topic: String,
    messages: u64,
    seconds: f64,
    hz: Option<f64>,
    /// Between messages, in milliseconds.
    least_ms: Option<f64>,
    median_ms: Option<f64>,
    most_ms: Option<f64>,
    megabytes_per_second: f64,
    /// Scans that were published and did not reach this listener.
    missed: u64,
}

fn hz(running: &Running, name: &str, seconds: f64, json: bool) -> Result<(), Failure> {
    let topic = find(running, name)?;
    let mut listener = listen(running, &topic)?;
    let (mut times, mut bytes) = (Vec::new(), 0usize);
    let (mut first, mut last) = (None, 0);
    let began = Instant::now();
    hear(
        running,
        &mut listener,
        Duration::from_secs_f64(seconds),
        |message| {
            times.push(Instant::now());
            bytes += size(&message.any_view().map_err(Failure::failed)?.sections(0));
            let sequence = message.header().sequence;
            first.get_or_insert(sequence);
            last = last.max(sequence);
            Ok(true)
        },
    )?;
    let elapsed = began.elapsed().as_secs_f64();
    let mut gaps: Vec<f64> = times
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).as_secs_f64() * 1e3)
        .collect();
    gaps.sort_by(f64::total_cmp);
    let span = times
        .last()
        .zip(times.first())
        .map(|(b, a)| (*b - *a).as_secs_f64());
    let count = times.len() as u64;
    let rate = Rate {
        topic: topic.name,
        messages: count,
        seconds: elapsed,
        hz: span
            .filter(|span| *span > 0.0)
            .map(|span| (count - 1) as f64 / span),
        least_ms: gaps.first().copied(),
        median_ms: gaps.get(gaps.len() / 2).copied(),
        most_ms: gaps.last().copied(),
        megabytes_per_second: bytes as f64 / 1e6 / elapsed,
        missed: first.map_or(0, |first| (last - first + 1).saturating_sub(count)),
    };
    if json {
        return super::print_json(&rate);
    }
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.1}"));
    super::print(&format!(
        "{}: {} Hz, {} messages in {:.1} s; between them {} to {} ms, median {}; {:.1} MB/s; {} missed\n",
        rate.topic,
        number(rate.hz),
        rate.messages,
        rate.seconds,
        number(rate.least_ms),
        number(rate.most_ms),
        number(rate.median_ms),
        rate.megabytes_per_second,
        rate.missed,
    ))
}

/// A message as text.
#[derive(Debug, Serialize)]
struct Echo {
    topic: String,
    scan: u64,
    nanos: u64,
    size: String,
    sections: Vec<EchoSection>,
}

#[derive(Debug, Serialize)]
struct EchoSection {
    name: &'static str,
    len: usize,
    first: Vec<String>,
}

fn echo(
    running: &Running,
    name: &str,
    count: Option<u64>,
    elements: usize,
    json: bool,
) -> Result<(), Failure> {
    let topic = find(running, name)?;
    let mut listener = listen(running, &topic)?;
    let mut rest = count.unwrap_or(u64::MAX);
    hear(running, &mut listener, Duration::MAX, |message| {
        let header = message.header();
        let sections = message
            .any_view()
            .map_err(Failure::failed)?
            .sections(elements);
        let echo = Echo {
            topic: topic.name.clone(),
            scan: header.sequence,
            nanos: header.capture_nanos,
            size: header.size().to_string(),
            sections: sections
                .into_iter()
                .map(
                    |Section {
                         name, len, first, ..
                     }| EchoSection { name, len, first },
                )
                .collect(),
        };
        let text = match json {
            true => serde_json::to_string(&echo).map_err(Failure::failed)? + "\n",
            false => text(&echo),
        };
        rest -= 1;
        Ok(super::print_on(&text)? && rest > 0)
    })
}

fn text(echo: &Echo) -> String {
    let Echo {
        topic,
        scan,
        nanos,
        size,
        sections,
    } = echo;
    let mut text = format!("{topic}: scan {scan} at {nanos} ns, image {size}\n");
    for EchoSection { name, len, first } in sections {
        writeln!(text, "  {name}: {len}").unwrap_or_default();
        for element in first {
            writeln!(text, "    {element}").unwrap_or_default();
        }
        if !first.is_empty() && first.len() < *len {
            writeln!(text, "    …").unwrap_or_default();
        }
    }
    text
}

fn size(sections: &[Section]) -> usize {
    sections.iter().map(|section| section.bytes).sum()
}

/// Hears messages until `take` has had enough, the time is over or the run ends.
fn hear(
    running: &Running,
    listener: &mut Hearer,
    time: Duration,
    mut take: impl FnMut(Received) -> Result<bool, Failure>,
) -> Result<(), Failure> {
    let began = Instant::now();
    while began.elapsed() < time && running.goes_on() {
        while let Some(message) = listener.message_now().map_err(Failure::failed)? {
            if !take(message)? {
                return Ok(());
            }
        }
        std::thread::sleep(LOOK_EVERY);
    }
    Ok(())
}
