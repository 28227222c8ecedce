//! The recording's encodings, seen from outside: nothing is lost, others can read it, damage is told.
#![cfg(feature = "record")]
#![expect(clippy::unwrap_used, reason = "tests")]

use bytemuck::{Pod, Zeroable};
use foxglove::Decode as _;
use foxglove::messages as fg;
use messages::SECTIONS;
use messages::profile::Steady;
use messages::record::{
    Beside, Codec, DecodeError, Level, Pictured, Recorded, Said, Schema, Seen, Shown, Span, Views,
};
use messages::{
    AnyView, Calibration, Curve, Curves, CurvesRoom, Disparity, Edge, Edges, Entry, Evaluation,
    Growing, Header, Image, Kind, List, Map, Match, MatchPoint, Matches, MatchesRoom, NONE, Owned,
    Points, Rail, Raw, Reason, Rejected, Rig, Size, Sway, Table, Tables, TablesRoom, Topic, Truth,
};

/// Numbers that look random and never change.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        self.0 ^ self.0 >> 29
    }

    fn below(&mut self, most: usize) -> usize {
        (self.bits() % most.max(1) as u64) as usize
    }

    /// Appends elements of random bits, NaNs of every sort among them.
    fn fill<T: Pod>(&mut self, list: &mut List<'_, T>, count: usize) {
        for byte in bytemuck::cast_slice_mut::<T, u8>(list.grow(count)) {
            *byte = self.bits() as u8;
        }
    }
}

fn rig() -> Rig {
    Rig::of_views(3, &[30.0, 1.5], Size::new(40, 30))
}

fn codec() -> Codec {
    Codec::new(rig(), 1)
}

/// A kind that can be filled at random and compared byte by byte.
trait Sample: Recorded {
    fn fill(random: &mut Random, lens: [usize; SECTIONS], room: &mut Self::Room<'_>);
    fn bytes(view: Self::View<'_>) -> Vec<u8>;
}

macro_rules! sample {
    ($($kind:ident { $($section:ident)+ } $sound:expr;)+) => {$(
        impl Sample for $kind {
            fn fill(random: &mut Random, lens: [usize; SECTIONS], room: &mut Self::Room<'_>) {
                let mut lens = lens.into_iter();
                $(random.fill(&mut room.$section, lens.next().unwrap());)+
                let sound: fn(&mut Self::Room<'_>) = $sound;
                sound(room);
            }

            fn bytes(view: Self::View<'_>) -> Vec<u8> {
                [$(bytemuck::cast_slice::<_, u8>(view.$section),)+].concat()
            }
        }
    )+};
}

sample! {
    Image { pixels } |_| {};
    Raw { pixels } |_| {};
    Edges { edges } |_| {};
    Curves { curves points } |room| {
        let points = room.points.len() as u32;
        room.curves.iter_mut().for_each(|c| (c.first, c.count) = (points / 2, points / 3));
    };
    Tables { tables entries rows order } |room| {
        let entries = room.entries.len() as u32;
        room.tables.iter_mut().for_each(|t| (t.first, t.count) = (entries / 2, entries / 3));
        let order = room.order.len() as u32;
        room.rows.iter_mut().for_each(|row| *row %= order + 1);
        room.rows.sort();
    };
    Matches { matches points rejected } |room| {
        let points = room.points.len() as u32;
        room.matches.iter_mut().for_each(|m| (m.first, m.count) = (points / 2, points / 3));
    };
    Disparity { disparity } |_| {};
    Points { points } |_| {};
    Map { points } |_| {};
    Growing { points } |_| {};
    Truth { disparity } |_| {};
    Evaluation { scores curve } |_| {};
}

/// A message of this topic: `share` says how full it is.
fn sample<M: Sample>(random: &mut Random, topic: &Topic, size: Size, full: bool) -> Owned<M> {
    let rig = rig();
    let mut message = Owned::<M>::new(rig.size);
    let mut lens = M::capacities(size);
    if !full
        && !matches!(
            M::KIND,
            Kind::Image | Kind::Raw | Kind::Truth | Kind::Disparity
        )
    {
        lens = lens.map(|most| random.below(most + 1));
    }
    message.fill(|room| M::fill(random, lens, room));
    let lens = message.header.lens;
    message.header = Header {
        view: topic.view,
        channel: topic.channel,
        position_m: rig
            .views
            .get(topic.view as usize)
            .map_or(0.0, |view| view.position_steps * 0.1),
        lens,
        ..Header::new(random.bits() >> 33, random.bits() >> 1, size)
    };
    message
}

fn encoded<M: Sample>(topic: &Topic, message: &Owned<M>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (header, view) = (&message.header, message.view().into());
    codec().encode(topic, header, view, Beside::default(), &mut bytes);
    bytes
}

/// A message that has none beside it.
fn alone<'a>(_: Kind) -> Option<Said<'a>> {
    None
}

fn assert_round_trip<M: Sample>(random: &mut Random, topic: &Topic, size: Size, full: bool) {
    let message = sample::<M>(random, topic, size, full);
    let header = message.header;
    let bytes = encoded(topic, &message);
    let back = codec()
        .decode::<M>(topic, header.sequence, header.capture_nanos, &bytes, &alone)
        .unwrap();
    assert_eq!(back.header, header, "{}", topic.name);
    assert!(
        M::bytes(back.view()) == M::bytes(message.view()),
        "{}",
        topic.name
    );
    let mut again = Vec::new();
    codec().encode(
        topic,
        &back.header,
        back.view().into(),
        Beside::default(),
        &mut again,
    );
    assert!(again == bytes, "{}", topic.name);
}

/// The topics of a rig, and those that only a rail has.
fn topics() -> Vec<Topic> {
    let rail = Rig::of_rail(Rail::default(), &rig().channels, rig().size);
    let map = [Kind::Map, Kind::Growing].map(|kind| Topic::of(&rail, kind));
    Topic::all(&rig())
        .into_iter()
        .chain(map.into_iter().flatten())
        .collect()
}

/// Does something for every topic with its kind.
macro_rules! for_every_topic {
    ($topic:ident, $kind:ident => $do:expr) => {
        for $topic in &topics() {
            macro_rules! with {
                ($each:ident) => {{
                    type $kind = messages::$each;
                    $do
                }};
            }
            messages::of_kind!($topic.kind, with, other => panic!("{other:?} was not registered"));
        }
    };
}

#[test]
fn every_kind_comes_back_byte_for_byte() {
    let mut random = Random(1);
    for_every_topic!(topic, M => {
        for size in [Size::new(40, 30), Size::new(1, 1), Size::new(40, 1), Size::new(7, 13)] {
            assert_round_trip::<M>(&mut random, topic, size, false);
            assert_round_trip::<M>(&mut random, topic, size, true);
        }
        // No image, no elements.
        assert_round_trip::<M>(&mut random, topic, Size::new(0, 0), false);
    });
}

#[test]
fn encoding_appends_and_leaves_what_is_there() {
    let topic = &Topic::of(&rig(), Kind::Curves)[0];
    let message = sample::<Curves>(&mut Random(2), topic, rig().size, false);
    let alone = encoded(topic, &message);
    let mut bytes = b"before".to_vec();
    codec().encode(
        topic,
        &message.header,
        message.view().into(),
        Beside::default(),
        &mut bytes,
    );
    assert_eq!(bytes, [b"before", &*alone].concat());
}

#[test]
fn a_message_made_before_is_reused_whatever_it_held() {
    let mut random = Random(3);
    for_every_topic!(topic, M => {
        let mut reused = Owned::<M>::new(rig().size);
        for full in [true, false] {
            let message = sample::<M>(&mut random, topic, Size::new(9, 8), full);
            codec().decode_into(topic, 0, 0, &encoded(topic, &message), &alone, &mut reused).unwrap();
            assert!(M::bytes(reused.view()) == M::bytes(message.view()), "{}", topic.name);
        }
    });
}

/// Messages of a scan that say the same again: an image, edges whose gray levels are those of the image, curves made of
/// them, the R-tables of those, and matches of their points.
#[derive(Clone)]
struct Related {
    image: Owned<Image>,
    edges: Owned<Edges>,
    curves: Owned<Curves>,
    tables: Owned<Tables>,
    matches: Owned<Matches>,
}

/// Edges as the filter makes them: in raster order, one a pixel at most, in whole steps.
fn lattice(random: &mut Random, size: Size, image: &[u8]) -> Vec<Edge> {
    let mut edges = Vec::new();
    for pixel in 0..size.pixels() as u32 {
        if random.below(10) < 4 {
            continue;
        }
        let part = random.below(256) as f32 / 256.0;
        let (dx, dy) = match random.below(2) {
            0 => (part, 0.0),
            _ => (0.0, part.max(1.0 / 256.0)),
        };
        let extremes = [-32_767, 0, 32_768];
        edges.push(Edge {
            x: (pixel % size.width) as f32 + dx,
            y: (pixel / size.width) as f32 + dy,
            magnitude: random.below(65_536) as f32 / 256.0,
            orientation: Edge::orientation_of(match random.below(4) {
                3 => random.below(65_535) as i32 - 32_766,
                which => extremes[which],
            }),
            profile: [0; 8],
        });
    }
    let mut steady = Steady::new(size);
    steady.take(image, size);
    steady.fill(&mut edges);
    edges
}

fn related(random: &mut Random, size: Size) -> Related {
    let header = Header {
        view: 0,
        channel: 0,
        ..Header::new(7, NANOS, size)
    };
    let mut image = Owned::<Image>::new(rig().size);
    image.fill(|room| random.fill(&mut room.pixels, size.pixels()));
    let all = lattice(random, size, image.view().pixels);
    let mut edges = Owned::<Edges>::new(rig().size);
    edges.fill(|room| room.edges.extend_from_slice(&all));
    let mut curves = Owned::<Curves>::new(rig().size);
    curves.fill(|room| {
        let mut next = 0;
        while next < all.len() {
            let count = (1 + random.below(9)).min(all.len() - next);
            // Now and then one belongs to two curves, and none is in the order of the list. No step is too long.
            let from = next.saturating_sub(usize::from(random.below(10) < 3));
            let near = |i: &usize| (0.0..7.0).contains(&(all[*i].x - all[from].x));
            let points: Vec<usize> = (from..from + count).take_while(near).collect();
            room.curves.push(Curve {
                label: room.curves.len() as u32,
                first: room.points.len() as u32,
                count: points.len() as u32,
                parent: if next % 3 == 0 { NONE } else { next as u32 },
                x: all[next].x,
                y: all[next].y + 0.3,
                magnitude: -0.0,
                length: f32::NAN,
            });
            points.iter().rev().for_each(|&i| room.points.push(all[i]));
            next = from + points.len();
        }
    });
    let mut tables = Owned::<Tables>::new(rig().size);
    tables.fill(|room| {
        let curves = curves.view();
        for curve in curves.curves {
            room.tables.push(Table {
                curve: curve.label,
                first: room.entries.len() as u32,
                count: curve.count,
                x: curve.x,
                y: curve.y,
                weight: curve.count as f32,
            });
            let mut points: Vec<usize> = curve.range().collect();
            points.sort_by(|&a, &b| {
                curves.points[a]
                    .orientation
                    .total_cmp(&curves.points[b].orientation)
            });
            for point in points {
                let p = curves.points[point];
                room.entries.push(Entry {
                    orientation: p.orientation,
                    rx: curve.x - p.x,
                    ry: curve.y - p.y,
                    weight: 1.0,
                    point: point as u32,
                });
            }
        }
        let mut order: Vec<u32> = (0..curves.points.len() as u32).collect();
        let key = |i: u32| {
            (
                curves.points[i as usize].y.floor(),
                curves.points[i as usize].x,
                i,
            )
        };
        order.sort_by(|&a, &b| key(a).partial_cmp(&key(b)).unwrap());
        for row in 0..=size.height {
            room.rows
                .push(order.iter().filter(|&&i| key(i).0 < row as f32).count() as u32);
        }
        room.order.extend_from_slice(&order);
    });
    let mut matches = Owned::<Matches>::new(rig().size);
    matches.fill(|room| {
        for (point, of) in (0..).zip(curves.view().points) {
            if random.below(3) > 0 {
                room.points.push(MatchPoint {
                    x: of.x,
                    y: of.y,
                    disparity: f32::from_bits(random.bits() as u32),
                    score: f32::from_bits(random.bits() as u32),
                    point,
                    filled: random.below(2) as u32,
                });
            }
        }
    });
    for (own, view, channel) in [
        (&mut image.header, 0, NONE),
        (&mut edges.header, 0, 0),
        (&mut curves.header, 0, 0),
        (&mut tables.header, 0, 0),
        (&mut matches.header, NONE, 0),
    ] {
        *own = Header {
            lens: own.lens,
            view,
            channel,
            ..header
        };
    }
    Related {
        image,
        edges,
        curves,
        tables,
        matches,
    }
}

/// The messages as encoded, each beside the others.
type Encoded = [Vec<u8>; 5];

const RELATED: [Kind; 5] = [
    Kind::Image,
    Kind::Edges,
    Kind::Curves,
    Kind::Tables,
    Kind::Matches,
];

fn topic_of(kind: Kind) -> Topic {
    Topic::of(&rig(), kind).swap_remove(0)
}

/// Encodes the messages beside each other, those without a `false`.
fn through(related: &Related, with_image: bool) -> Encoded {
    let image = with_image.then(|| related.image.view());
    let beside = Beside {
        image,
        edges: Some(related.edges.view()),
        curves: Some(related.curves.view()),
    };
    let all: [(&Header, AnyView<'_>); 5] = [
        (&related.image.header, related.image.view().into()),
        (&related.edges.header, related.edges.view().into()),
        (&related.curves.header, related.curves.view().into()),
        (&related.tables.header, related.tables.view().into()),
        (&related.matches.header, related.matches.view().into()),
    ];
    let mut codec = codec();
    let mut bytes = Encoded::default();
    for ((out, (header, view)), kind) in bytes.iter_mut().zip(all).zip(RELATED) {
        codec.encode(&topic_of(kind), header, view, beside, out);
    }
    bytes
}

/// The messages that are there.
fn among<'a>(bytes: &'a Encoded, without: &[Kind]) -> impl Fn(Kind) -> Option<Said<'a>> {
    let without = without.to_vec();
    move |kind| {
        let at = RELATED.iter().position(|known| *known == kind)?;
        (!without.contains(&kind)).then(|| Said::Recorded(&bytes[at]))
    }
}

fn read<M: Recorded>(bytes: &Encoded, without: &[Kind]) -> Result<Owned<M>, DecodeError> {
    let at = RELATED.iter().position(|kind| *kind == M::KIND).unwrap();
    let others = among(bytes, without);
    codec().decode::<M>(&topic_of(M::KIND), 7, NANOS, &bytes[at], &others)
}

#[track_caller]
fn assert_same<M: Sample>(read: Result<Owned<M>, DecodeError>, made: &Owned<M>, what: &str) {
    let read = read.unwrap();
    assert_eq!(read.header.lens, made.header.lens, "{what}");
    assert!(M::bytes(read.view()) == M::bytes(made.view()), "{what}");
}

/// Everything comes back as it was made; gives the bytes each message takes.
#[track_caller]
fn assert_lossless(related: &Related, with_image: bool, what: &str) -> [usize; 5] {
    let bytes = through(related, with_image);
    assert_same(read::<Image>(&bytes, &[]), &related.image, what);
    assert_same(read::<Edges>(&bytes, &[]), &related.edges, what);
    assert_same(read::<Curves>(&bytes, &[]), &related.curves, what);
    assert_same(read::<Tables>(&bytes, &[]), &related.tables, what);
    assert_same(read::<Matches>(&bytes, &[]), &related.matches, what);
    // Curves that were read before do as well as recorded ones.
    let before = |kind| (kind == Kind::Curves).then(|| Said::Curves(related.curves.view()));
    let tables = codec().decode(&topic_of(Kind::Tables), 7, NANOS, &bytes[3], &before);
    assert_same(tables, &related.tables, what);
    let matches = codec().decode(&topic_of(Kind::Matches), 7, NANOS, &bytes[4], &before);
    assert_same(matches, &related.matches, what);
    bytes.map(|bytes| bytes.len())
}

#[test]
fn what_another_message_says_is_not_said_again_and_comes_back_byte_for_byte() {
    let mut random = Random(9);
    for size in [
        Size::new(40, 30),
        Size::new(13, 7),
        Size::new(1, 1),
        Size::new(0, 0),
    ] {
        let related = related(&mut random, size);
        let [_, edges, curves, tables, matches] =
            assert_lossless(&related, true, &size.to_string());
        let many = related.edges.view().edges.len();
        assert!(
            edges < 80 + size.height as usize + 6 * many,
            "{size}: {edges} of {many}"
        );
        let of_curves = related.curves.view();
        let (records, points) = (of_curves.curves.len(), of_curves.points.len());
        assert!(curves < 100 + 24 * records + points, "{size}: {curves}");
        assert!(tables < 60, "{size}: {tables}");
        let points = related.matches.view().points.len();
        assert!(matches < 80 + 9 * points, "{size}: {matches}");
        // Without the image the gray levels stand in the edges, and nothing else is longer.
        let [_, with_profiles, rest @ ..] = assert_lossless(&related, false, &size.to_string());
        let head = with_profiles - edges - 8 * many;
        assert!((2..=4).contains(&head), "{size}: {head}");
        assert_eq!(rest, [curves, tables, matches]);
    }
}

#[test]
fn every_edge_that_the_filter_can_make_takes_six_bytes_and_any_other_comes_back_too() {
    let mut random = Random(14);
    let size = Size::new(40, 30);
    let topic = &topic_of(Kind::Edges);
    let round_trip = |edges: &[Edge], what: &str| {
        let mut message = Owned::<Edges>::new(size);
        message.header = Header::new(7, NANOS, size);
        message.fill(|room| room.edges.extend_from_slice(edges));
        let bytes = encoded(topic, &message);
        let back = codec().decode::<Edges>(topic, 7, NANOS, &bytes, &alone);
        assert_same(back, &message, what);
        bytes.len()
    };
    let good = lattice(&mut random, size, &[7; 40 * 30]);
    let short = round_trip(&good, "as the filter makes them");
    assert!(short < 14 * good.len() + 120, "{short} of {}", good.len());
    type Change = fn(&mut Edge);
    let changes: [(&str, Change); 14] = [
        ("a place between two steps", |e| e.x += 1.0 / 1024.0),
        ("a row between two steps", |e| e.y = 3.0 + 1.0 / 512.0),
        ("a cut of both", |e| (e.x, e.y) = (3.5, 3.5)),
        ("a place outside", |e| e.x = 40.0),
        ("a negative place", |e| e.x = -1.0),
        ("nothing below zero", |e| e.x = -0.0),
        ("a place that is none", |e| e.y = f32::NAN),
        ("a row outside", |e| e.y = 1e20),
        ("a large magnitude", |e| e.magnitude = 256.0),
        ("a negative magnitude", |e| e.magnitude = -1.0),
        ("a fine magnitude", |e| e.magnitude = 1.0 / 512.0),
        ("an orientation beyond", |e| e.orientation = 4.0),
        ("minus pi", |e| e.orientation = -std::f32::consts::PI),
        ("a fine orientation", |e| e.orientation = 1e-6),
    ];
    for (what, change) in changes {
        let mut edges = good.clone();
        let at = random.below(edges.len());
        change(&mut edges[at]);
        assert!(round_trip(&edges, what) > short, "{what}");
    }
    let mut swapped = good.clone();
    swapped.swap(3, 4);
    assert!(round_trip(&swapped, "another order") > short);
    let mut doubled = good.clone();
    doubled.insert(4, good[3]);
    assert!(round_trip(&doubled, "two of one pixel") > short);
}

#[test]
fn edges_recorded_as_a_cloud_of_points_are_read() {
    let mut random = Random(15);
    let topic = &topic_of(Kind::Edges);
    let message = sample::<Edges>(&mut random, topic, Size::new(9, 8), true);
    let mut fields: Vec<_> = ["x", "y", "z", "magnitude", "orientation"]
        .into_iter()
        .zip([0, 4, 8, 8, 12])
        .map(|(name, offset)| (name.to_owned(), offset, 7))
        .collect();
    fields.extend((0..8).map(|i| (format!("profile_{i}"), 16 + i, 1)));
    let cloud = fg::PointCloud {
        pose: Some(fg::Pose::default()),
        frame_id: "left_pixels".to_owned(),
        point_stride: 24,
        fields: fields
            .into_iter()
            .map(|(name, offset, r#type)| fg::PackedElementField {
                name,
                offset,
                r#type,
            })
            .collect(),
        data: bytemuck::cast_slice(message.view().edges).to_vec().into(),
        ..fg::PointCloud::default()
    };
    let mut bytes = Vec::new();
    foxglove::Encode::encode(&cloud, &mut bytes).unwrap();
    // Two fields of ours: the image's width and height.
    for (field, value) in [(1000u32, 9u32), (1001, 8)] {
        let key = field << 3 | 5;
        bytes.extend([key as u8 | 0x80, (key >> 7) as u8]);
        bytes.extend(value.to_le_bytes());
    }
    let back = codec().decode::<Edges>(topic, 7, NANOS, &bytes, &alone);
    assert_eq!(back.as_ref().unwrap().header.size(), Size::new(9, 8));
    assert_same(back, &message, "a cloud");
}

#[test]
fn what_differs_by_one_bit_from_what_another_message_says_is_said_in_full() {
    let mut random = Random(10);
    let as_made = related(&mut random, Size::new(20, 10));
    let short = assert_lossless(&as_made, true, "as made");
    let [.., curves, tables, matches] = [0, 1, 2, 3, 4];
    let check = |related: &Related, which: usize, what: &str| {
        let long = assert_lossless(related, true, what);
        assert!(long[which] > short[which], "{what}: {long:?}, {short:?}");
        long
    };

    let mut other = as_made.clone();
    other.edges = edited(&as_made.edges, |room| room.edges[3].profile[5] ^= 1);
    check(&other, 1, "a gray level that is not the image's");

    let of_curves = |edit: &dyn Fn(&mut CurvesRoom<'_>)| Related {
        curves: edited(&as_made.curves, |room| edit(room)),
        ..as_made.clone()
    };
    check(
        &of_curves(&|room| room.points[3].magnitude = -0.0),
        curves,
        "a point that is no edge",
    );
    check(
        &of_curves(&|room| room.curves[1].label = 7),
        curves,
        "another label",
    );
    check(
        &of_curves(&|room| room.curves[1].count -= 1),
        curves,
        "a gap",
    );
    let of_many = as_made.curves.view();
    let of_many = of_many.curves.iter().find(|c| c.count > 1).unwrap();
    let (first, last) = (
        of_many.first as usize,
        as_made.curves.view().points.len() - 1,
    );
    check(
        &of_curves(&|room| room.points.swap(first, last)),
        curves,
        "a step too far",
    );

    let of_entry = |change: &dyn Fn(&mut Entry)| Related {
        tables: edited(&as_made.tables, |room| change(&mut room.entries[5])),
        ..as_made.clone()
    };
    for other in [
        of_entry(&|e| e.rx += 1e-3),
        of_entry(&|e| e.orientation = f32::NAN),
        of_entry(&|e| e.point = 0),
    ] {
        check(&other, tables, "an entry of its own");
    }
    let weighed = Related {
        tables: edited(&as_made.tables, |room| {
            room.entries[0].weight = 0.25;
            let first = room.tables[0].count as usize;
            room.tables[0].weight = room.entries[..first].iter().map(|e| e.weight).sum();
        }),
        ..as_made.clone()
    };
    let entries = as_made.tables.view().entries.len();
    let long = check(&weighed, tables, "a weight");
    assert_eq!(long[tables] - short[tables], 4 * entries + 3);

    let of_tables = |edit: &dyn Fn(&mut TablesRoom<'_>)| Related {
        tables: edited(&as_made.tables, |room| edit(room)),
        ..as_made.clone()
    };
    check(
        &of_tables(&|room| room.order.swap(0, 1)),
        tables,
        "another order",
    );
    check(
        &of_tables(&|room| room.tables[0].weight = -1.0),
        tables,
        "another sum",
    );
    check(
        &of_tables(&|room| room.rows.truncate(4)),
        tables,
        "fewer rows",
    );
    let wide = as_made
        .tables
        .view()
        .tables
        .iter()
        .position(|t| t.count > 1)
        .unwrap();
    check(
        &of_tables(&|room| {
            room.tables[wide].first += 1;
            room.tables[wide].count -= 1;
        }),
        tables,
        "a table that leaves an entry out",
    );
    check(
        &of_tables(&|room| room.tables.truncate(3)),
        tables,
        "curves without tables",
    );

    let of_matches = |edit: &dyn Fn(&mut MatchesRoom<'_>)| Related {
        matches: edited(&as_made.matches, |room| edit(room)),
        ..as_made.clone()
    };
    check(
        &of_matches(&|room| room.points[9].x += 1.0),
        matches,
        "a place of its own",
    );
    check(
        &of_matches(&|room| room.points[9].filled = 2),
        matches,
        "filled otherwise",
    );
    check(
        &of_matches(&|room| room.points.swap(1, 2)),
        matches,
        "points in another order",
    );
    check(
        &of_matches(&|room| room.points[9].point = NONE),
        matches,
        "no point of a curve",
    );
}

/// A message that differs a little from this one.
fn edited<M: Sample>(message: &Owned<M>, edit: impl FnOnce(&mut M::Room<'_>)) -> Owned<M> {
    let mut edited = Owned::new(rig().size);
    edited.fill(|room| {
        M::copy(message.view(), room);
        edit(room);
    });
    edited.header = Header {
        lens: edited.header.lens,
        ..message.header
    };
    edited
}

#[test]
fn matches_recorded_before_there_were_reasons_read_as_none_rejected() {
    let topic = &Topic::of(&rig(), Kind::Matches)[0];
    let new = sample::<Matches>(&mut Random(12), topic, Size::new(9, 8), true);
    assert!(!new.view().rejected.is_empty());
    let mut old = edited(&new, |room| room.rejected.clear());
    old.header.lens[2] = 0;
    let (new_bytes, old_bytes) = (encoded(topic, &new), encoded(topic, &old));
    // What is new comes last: whoever knows it not reads the rest as ever.
    assert!(new_bytes.starts_with(&old_bytes) && new_bytes.len() > old_bytes.len());
    let read = codec().decode::<Matches>(topic, 0, 0, &old_bytes, &alone);
    let read = read.unwrap();
    assert!(read.view().rejected.is_empty());
    assert_eq!(read.view().difference(&old.view()), None);
    let difference = new.view().difference(&old.view()).unwrap();
    assert_eq!((difference.section, difference.element), ("rejected", 0));
}

#[test]
fn references_into_damaged_or_missing_messages_are_told() {
    let mut random = Random(11);
    let bytes = through(&related(&mut random, Size::new(12, 9)), true);
    let errors = |bytes: &Encoded, without: &[Kind]| {
        [
            read::<Edges>(bytes, without).err(),
            read::<Curves>(bytes, without).err(),
            read::<Tables>(bytes, without).err(),
            read::<Matches>(bytes, without).err(),
        ]
    };
    let alone = |kind| Some(DecodeError::Alone(kind));
    assert_eq!(errors(&bytes, &[]), [const { None }; 4]);
    // Tables and matches need places alone, and these do not follow from an image.
    let no_image = [alone(Kind::Image), alone(Kind::Image), None, None];
    assert_eq!(errors(&bytes, &[Kind::Image]), no_image);
    let no_edges = [
        None,
        alone(Kind::Edges),
        alone(Kind::Edges),
        alone(Kind::Edges),
    ];
    assert_eq!(errors(&bytes, &[Kind::Edges]), no_edges);
    let no_curves = [None, None, alone(Kind::Curves), alone(Kind::Curves)];
    assert_eq!(errors(&bytes, &[Kind::Curves]), no_curves);
    let mut small = bytes.clone();
    let [image, ..] = through(&related(&mut random, Size::new(11, 9)), true);
    small[0] = image;
    assert_eq!(
        errors(&small, &[])[0],
        Some(DecodeError::Layout("image size"))
    );
    for _ in 0..3000 {
        let mut bad = bytes.clone();
        for _ in 0..=random.below(3) {
            let which = &mut bad[random.below(5)];
            // The head is where it hurts most, and what is cut or longer says so.
            match random.below(6) {
                0 => which.truncate(random.below(which.len() + 1)),
                1 => which.extend((0..random.below(9)).map(|_| random.bits() as u8)),
                2 if !which.is_empty() => {
                    let at = random.below(which.len().min(60));
                    which[at] = random.bits() as u8;
                }
                _ if !which.is_empty() => {
                    let at = random.below(which.len());
                    which[at] ^= 1 << random.below(8);
                }
                _ => {}
            }
        }
        // Whatever comes of it, it comes without a panic, and what is read is sound.
        if let Ok(tables) = read::<Tables>(&bad, &[]) {
            assert!(Tables::is_sound(tables.view()));
        }
        errors(&bad, &[]);
    }
}

#[test]
fn counts_that_lie_are_told_and_take_no_memory() {
    let bytes = through(&related(&mut Random(13), Size::new(12, 9)), true);
    // A field of packed varints that says the largest number there is, over and over.
    let bomb = |field: u8| {
        let mut packed: Vec<u8> = Vec::new();
        for _ in 0..50 {
            packed.extend([0xff; 9]);
            packed.push(1);
        }
        let mut bytes = vec![
            field << 3 | 2,
            packed.len() as u8 | 0x80,
            (packed.len() >> 7) as u8,
        ];
        bytes.extend(packed);
        bytes
    };
    // The last of several fields of a number counts: counts, gaps; counts, parents, starts; gaps.
    let told = |which: usize, field: u8| {
        let mut bad = bytes.clone();
        bad[which].extend(bomb(field));
        let errors = [
            read::<Edges>(&bad, &[]).err(),
            read::<Curves>(&bad, &[]).err(),
            read::<Tables>(&bad, &[]).err(),
            read::<Matches>(&bad, &[]).err(),
        ];
        assert!(errors[which - 1].is_some(), "{which}, {field}");
        assert!(
            !errors.contains(&Some(DecodeError::Malformed)),
            "{errors:?}"
        );
    };
    [5, 6].into_iter().for_each(|field| told(1, field));
    [8, 9, 14].into_iter().for_each(|field| told(2, field));
    told(4, 8);
}

/// Whatever the bytes, decoding gives a message or an error; it never panics or takes more room than the rig's.
fn decode_anything(topic: &Topic, bytes: &[u8]) {
    for_every_topic!(each, M => {
        if each == topic
            && let Ok(message) = codec().decode::<M>(topic, 0, 0, bytes, &alone)
        {
            // What decodes encodes.
            encoded(topic, &message);
        }
    });
}

#[test]
fn arbitrary_and_damaged_bytes_are_told_and_never_panic() {
    let mut random = Random(4);
    for_every_topic!(topic, M => {
        for _ in 0..40 {
            let len = random.below(200);
            let noise: Vec<u8> = (0..len).map(|_| random.bits() as u8).collect();
            decode_anything(topic, &noise);
        }
        let message = sample::<M>(&mut random, topic, Size::new(6, 5), false);
        let good = encoded(topic, &message);
        for _ in 0..200 {
            let mut bad = good.clone();
            match random.below(4) {
                0 => bad.truncate(random.below(bad.len())),
                1 => bad.extend((0..random.below(20)).map(|_| random.bits() as u8)),
                // The head is where it hurts most.
                2 => {
                    let at = random.below(bad.len().min(120));
                    bad[at] = random.bits() as u8;
                }
                _ => {
                    for _ in 0..5 {
                        let at = random.below(bad.len());
                        bad[at] ^= 1 << random.below(8);
                    }
                }
            }
            decode_anything(topic, &bad);
        }
    });
}

#[test]
fn no_damaged_message_shows_more_than_its_lists_hold() {
    let mut curves = Owned::<Curves>::new(rig().size);
    curves.header = Header::new(0, 0, rig().size);
    curves.fill(|room: &mut CurvesRoom<'_>| {
        room.curves.push(Curve {
            first: 3,
            count: u32::MAX,
            ..Curve::default()
        });
        room.points.push(Edge::default());
    });
    let topic = &Topic::of(&rig(), Kind::Curves)[0];
    let bytes = {
        let mut bytes = Vec::new();
        codec().encode(
            topic,
            &curves.header,
            curves.view().into(),
            Beside::default(),
            &mut bytes,
        );
        bytes
    };
    let read = codec().decode::<Curves>(topic, 0, 0, &bytes, &alone);
    assert_eq!(read.err(), Some(DecodeError::Unsound));
}

#[test]
fn damage_is_told_by_name() {
    let topic = &Topic::of(&rig(), Kind::Image)[0];
    let image = sample::<Image>(&mut Random(5), topic, Size::new(40, 30), true);
    let bytes = encoded(topic, &image);
    let decode =
        |codec: &Codec, bytes: &[u8]| codec.decode::<Image>(topic, 0, 0, bytes, &alone).err();
    let small = Codec::new(
        Rig {
            size: Size::new(39, 30),
            ..rig()
        },
        0,
    );
    assert_eq!(
        decode(&small, &bytes),
        Some(DecodeError::Size(Size::new(40, 30), Size::new(39, 30)))
    );
    assert_eq!(
        decode(&codec(), &bytes[..bytes.len() - 1]),
        Some(DecodeError::Malformed)
    );
    assert_eq!(
        decode(&codec(), &[]),
        Some(DecodeError::Layout("pixel encoding"))
    );

    let topic = &Topic::of(&rig(), Kind::Edges)[0];
    let points = &Topic::of(&rig(), Kind::Points)[0];
    let cloud = encoded(
        points,
        &sample::<Points>(&mut Random(6), points, Size::new(4, 4), true),
    );
    let read = codec().decode::<Edges>(topic, 0, 0, &cloud, &alone);
    assert_eq!(read.err(), Some(DecodeError::Layout("columns")));
    let full = encoded(
        points,
        &sample::<Points>(&mut Random(7), points, Size::new(40, 30), true),
    );
    let read = small.decode::<Points>(points, 0, 0, &full, &alone);
    assert!(matches!(
        read.err(),
        Some(DecodeError::Size(..) | DecodeError::TooMany)
    ));
    assert_eq!(
        codec().decode::<Points>(topic, 0, 0, &full, &alone).err(),
        Some(DecodeError::Layout("kind"))
    );
}

const NANOS: u64 = 1_700_000_000_123_456_789;
const STAMP: Option<(u32, u32)> = Some((1_700_000_000, 123_456_789));

fn stamp(of: Option<fg::Timestamp>) -> Option<(u32, u32)> {
    of.map(|t| (t.sec(), t.nsec()))
}

#[test]
fn foxglove_reads_images_and_clouds() {
    let mut random = Random(8);
    let size = Size::new(5, 4);
    let topic = &Topic::of(&rig(), Kind::Image)[2];
    let mut message = sample::<Image>(&mut random, topic, size, true);
    message.header.capture_nanos = NANOS;
    let image = fg::RawImage::decode(&*encoded(topic, &message)).unwrap();
    assert_eq!(
        (image.width, image.height, image.step, &*image.encoding),
        (5, 4, 5, "mono8")
    );
    assert_eq!(
        (stamp(image.timestamp), &*image.frame_id),
        (STAMP, "right_optical")
    );
    assert_eq!(image.data, message.view().pixels);

    let topic = &Topic::of(&rig(), Kind::Points)[0];
    let message = sample::<Points>(&mut random, topic, size, true);
    let cloud = fg::PointCloud::decode(&*encoded(topic, &message)).unwrap();
    assert_eq!(
        (cloud.point_stride, &*cloud.frame_id, cloud.fields.len()),
        (36, "centre_optical", 9)
    );
    assert_eq!(cloud.pose.unwrap().orientation.unwrap().w, 1.0);

    let topic = &Topic::of(&rig(), Kind::Disparity)[0];
    let message = sample::<Disparity>(&mut random, topic, size, true);
    let image = fg::RawImage::decode(&*encoded(topic, &message)).unwrap();
    assert_eq!(
        (image.step, &*image.encoding, &*image.frame_id),
        (20, "32FC1", "centre_optical")
    );
}

#[test]
fn foxglove_reads_calibration_frames_and_log() {
    let camera = Calibration {
        focal_px: 500.0,
        cx: 20.0,
        cy: 15.0,
        baseline_m: 0.2,
        calibrated: true,
    };
    let codec = Codec::new(
        Rig {
            calibration: Some(camera),
            ..rig()
        },
        0,
    );
    let size = Size::new(40, 30);

    let mut bytes = Vec::new();
    codec.calibration(2, NANOS, size, 0.0, &mut bytes);
    let read = fg::CameraCalibration::decode(&*bytes).unwrap();
    assert_eq!(
        (read.width, read.height, &*read.frame_id),
        (40, 30, "right_optical")
    );
    assert_eq!(
        (stamp(read.timestamp), &*read.distortion_model),
        (STAMP, "plumb_bob")
    );
    assert_eq!(read.k, [500.0, 0.0, 20.0, 0.0, 500.0, 15.0, 0.0, 0.0, 1.0]);
    assert_eq!(read.r, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(
        read.p,
        [
            500.0, 0.0, 20.0, -200.0, 0.0, 500.0, 15.0, 0.0, 0.0, 0.0, 1.0, 0.0
        ]
    );
    // A point that the first view sees at (u, v) falls d·2 to the left here: P says the same.
    let [x, _, z] = camera.point_m(30.0, 20.0, 10.0);
    let u = (read.p[0] * x + read.p[2] * z + read.p[3]) / z;
    assert!((u - (30.0 - 2.0 * 10.0)).abs() < 1e-9);

    bytes.clear();
    codec.transforms(NANOS, size, 0.0, &Sway::NONE, &mut bytes);
    let read = fg::FrameTransforms::decode(&*bytes).unwrap().transforms;
    let names: Vec<_> = read
        .iter()
        .map(|t| (&*t.parent_frame_id, &*t.child_frame_id))
        .collect();
    let expected = ["left_optical", "centre_optical", "right_optical"].map(|child| ("rig", child));
    assert_eq!(names, [&[("world", "rig")], &expected[..]].concat());
    assert!(read.iter().all(|t| stamp(t.timestamp) == STAMP));
    let right = read[3].clone();
    assert_eq!(right.translation.unwrap().y, -0.4);
    // Forward in the optical frame is forward, x, in the rig's; right is −y; down is −z.
    let q = right.rotation.unwrap();
    let turned = |v: [f64; 3]| rotate([q.x, q.y, q.z, q.w], v);
    assert_eq!(turned([0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]);
    assert_eq!(turned([1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
    assert_eq!(turned([0.0, 1.0, 0.0]), [0.0, 0.0, -1.0]);

    bytes.clear();
    codec.log(NANOS, Level::Warning, "track", "few curves", &mut bytes);
    let read = fg::Log::decode(&*bytes).unwrap();
    assert_eq!(
        (stamp(read.timestamp), read.level),
        (STAMP, fg::log::Level::Warning as i32)
    );
    assert_eq!((&*read.message, &*read.name), ("few curves", "track"));
}

/// v turned by a unit quaternion.
fn rotate([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let t = cross([x, y, z], v).map(|c| 2.0 * c);
    let u = cross([x, y, z], t);
    std::array::from_fn(|i| v[i] + w * t[i] + u[i])
}

#[test]
fn foxglove_reads_curves_drawn_over_the_image_and_the_picture() {
    let codec = codec();
    let mut views = Views::default();
    let header = Header {
        view: 0,
        ..Header::new(0, NANOS, Size::new(3, 1))
    };
    let at = |x: f32, y: f32| Edge {
        x,
        y,
        ..Edge::zeroed()
    };
    let points = [
        at(1.0, 2.0),
        at(2.0, 3.0),
        at(3.0, 4.0),
        at(8.0, 1.0),
        at(9.0, 1.5),
    ];
    let curves = [
        Curve {
            label: 0,
            first: 0,
            count: 3,
            ..Curve::default()
        },
        Curve {
            label: 1,
            first: 3,
            count: 2,
            x: 8.5,
            y: 1.5,
            ..Curve::default()
        },
    ];
    let view = messages::CurvesView {
        curves: &curves,
        points: &points,
    };
    let found = [Match {
        curves: [1, 5, 7],
        disparity: 2.0,
        ..Match::default()
    }];
    let matches = messages::MatchesView {
        matches: &found,
        points: &[],
        rejected: &[],
    };
    let disparity = [1.0, f32::NAN, 2.0];
    let span = Span::of(disparity.into_iter());

    let mut bytes = Vec::new();
    views.annotations(
        &codec,
        &header,
        view,
        span.map(|span| (matches, span)),
        &mut bytes,
    );
    let read = annotations(&bytes);
    let [one, two, rims, dots] = &read.points[..] else {
        panic!("{}", read.points.len());
    };
    for strip in [one, two] {
        assert_eq!(strip.r#type, fg::points_annotation::Type::LineStrip as i32);
    }
    // Foxglove counts from the corner of the first pixel, not from its centre.
    let first: Vec<_> = one.points.iter().map(|p| (p.x, p.y)).collect();
    assert_eq!(first, [(1.5, 2.5), (3.5, 4.5)]);
    // The centroid of the one that is matched is marked in its colour.
    for marks in [rims, dots] {
        assert_eq!(marks.r#type, fg::points_annotation::Type::Points as i32);
        let at: Vec<_> = marks.points.iter().map(|p| (p.x, p.y)).collect();
        assert_eq!(at, [(9.0, 2.0)]);
    }
    assert_eq!(dots.outline_colors, [two.outline_color.unwrap()]);
    assert!(rims.thickness > dots.thickness);
    let colour = |i: usize| read.points[i].outline_color.unwrap();
    assert!(colour(0).a < 1.0 && colour(1).a == 1.0);

    bytes.clear();
    views.picture(
        &codec,
        &header,
        Pictured::Disparity,
        &Seen {
            disparity: Some(&disparity),
            span,
            ..Seen::default()
        },
        &mut bytes,
    );
    let read = fg::RawImage::decode(&*bytes).unwrap();
    assert_eq!(
        (&*read.encoding, read.step, read.data.len()),
        ("rgb8", 9, 9)
    );
    assert_eq!(read.data[3..6], [0, 0, 0]);
    // The nearest curve and the nearest pixel have one colour.
    assert_eq!(read.data[6], (colour(1).r * 255.0).round() as u8);
}

/// A message of annotations, every one of which has the image's time and can be seen.
fn annotations(bytes: &[u8]) -> fg::ImageAnnotations {
    let read = fg::ImageAnnotations::decode(bytes).unwrap();
    assert_eq!(stamp(read.timestamp), STAMP);
    for points in &read.points {
        assert_eq!(stamp(points.timestamp), STAMP);
        assert!(points.thickness > 0.0 && points.outline_color.is_some());
    }
    for text in &read.texts {
        assert_eq!(stamp(text.timestamp), STAMP);
        assert!(text.font_size > 0.0 && !text.text.is_empty());
        assert!(text.position.is_some() && text.text_color.unwrap().a > 0.0);
        assert!(text.background_color.is_some());
    }
    assert!(read.circles.is_empty());
    read
}

/// A row of upright curves of these lengths, 24 columns apart.
fn fence(lengths: &[u32]) -> (Vec<Curve>, Vec<Edge>) {
    let (mut curves, mut points) = (Vec::new(), Vec::new());
    for (label, &length) in (0u16..).zip(lengths) {
        let x = f32::from(label) * 24.0 + 100.0;
        let top = 200.0 - length as f32 / 2.0;
        curves.push(Curve {
            label: label.into(),
            first: points.len() as u32,
            count: length,
            x,
            y: 200.0,
            length: length as f32,
            ..Curve::default()
        });
        points.extend((0..length).map(|row| Edge {
            x,
            y: top + row as f32,
            ..Edge::zeroed()
        }));
    }
    (curves, points)
}

fn texts(read: &fg::ImageAnnotations) -> Vec<&str> {
    read.texts.iter().map(|text| &*text.text).collect()
}

#[test]
fn the_longest_matched_curves_are_labelled_where_no_label_covers_another() {
    // Labels are wider than the curves are apart: not all of them have room.
    let lengths = [90, 100, 95, 90, 110, 70, 20, 300, 7];
    let (curves, points) = fence(&lengths);
    let curves = messages::CurvesView {
        curves: &curves,
        points: &points,
    };
    let found: Vec<Match> = (0..lengths.len() as u32)
        .map(|label| Match {
            curves: [label, 100 + label, NONE],
            disparity: 3.0 + label as f32,
            score: 0.9 + 0.01 * label as f32,
            ..Match::default()
        })
        .collect();
    let matches = messages::MatchesView {
        matches: &found,
        points: &[],
        rejected: &[],
    };
    let span = Span::of(found.iter().map(|found| found.disparity));
    let header = Header {
        view: 0,
        ..Header::new(0, NANOS, Size::new(640, 480))
    };
    let mut bytes = Vec::new();
    Views::default().annotations(
        &codec(),
        &header,
        curves,
        span.map(|span| (matches, span)),
        &mut bytes,
    );
    let drawn = annotations(&bytes);
    assert_eq!(
        texts(&drawn),
        ["11.0 px", "9.0 px", "7.0 px", "5.0 px", "3.0 px"]
    );
    let mut labels = Vec::new();
    let matches = (matches, span.unwrap());
    Views::default().labels(&codec(), &header, curves, matches, &mut labels);
    let read = annotations(&labels);
    assert!(read.points.is_empty(), "labels alone");
    // They are numbered as in the reference view, the centre: the longest first, then those that have room to the right
    // or to the left; 20 and 7 points are shorter than a label.
    assert_eq!(
        texts(&read),
        ["107 0.970 10.0", "104 0.940 7.0", "100 0.900 3.0"]
    );
    let boxes: Vec<[f64; 4]> = read
        .texts
        .iter()
        .map(|text| {
            let (at, height) = (text.position.unwrap(), text.font_size);
            let width = 0.6 * height * text.text.len() as f64;
            [at.x, at.x + width, at.y - height, at.y]
        })
        .collect();
    for (i, [left, right, top, bottom]) in boxes.iter().enumerate() {
        assert!(*left >= 0.0 && *right <= 640.0 && *top >= 0.0 && *bottom <= 480.0);
        let overlaps =
            |b: &[f64; 4]| b[0] < *right && *left < b[1] && b[2] < *bottom && *top < b[3];
        assert!(!boxes[i + 1..].iter().any(overlaps));
    }
    // A legend's line stands on its colour, a label is of it.
    let paper = |text: &fg::TextAnnotation| text.background_color.unwrap();
    let colour = |text: &fg::TextAnnotation| text.text_color.unwrap();
    assert_eq!(
        paper(&drawn.texts[0]),
        drawn.points[8].outline_color.unwrap()
    );
    assert_eq!(
        paper(&drawn.texts[4]),
        drawn.points[0].outline_color.unwrap()
    );
    assert_eq!(
        colour(&read.texts[0]),
        drawn.points[7].outline_color.unwrap()
    );
    // The second time nothing is left of the first.
    let mut views = Views::default();
    for _ in 0..2 {
        let mut again = Vec::new();
        views.annotations(&codec(), &header, curves, Some(matches), &mut again);
        assert!(again == bytes);
        again.clear();
        views.labels(&codec(), &header, curves, matches, &mut again);
        assert!(again == labels);
    }
}

#[test]
fn labels_stay_few_and_a_calibrated_cameras_legend_says_metres() {
    let (curves, points): (Vec<Curve>, Vec<Vec<Edge>>) = (0..60u32)
        .map(|label| {
            let [x, y] = [
                60.0 + 200.0 * (label % 9) as f32,
                40.0 + 60.0 * (label / 9) as f32,
            ];
            let curve = Curve {
                label,
                first: label,
                count: 1,
                x,
                y,
                length: 400.0,
                ..Curve::default()
            };
            (
                curve,
                vec![Edge {
                    x,
                    y,
                    ..Edge::zeroed()
                }],
            )
        })
        .unzip();
    let points = points.concat();
    let curves = messages::CurvesView {
        curves: &curves,
        points: &points,
    };
    let found: Vec<Match> = (0..60)
        .map(|label| Match {
            curves: [label, label, NONE],
            disparity: 10.0 + label as f32,
            score: 0.9,
            ..Match::default()
        })
        .collect();
    let matches = messages::MatchesView {
        matches: &found,
        points: &[],
        rejected: &[],
    };
    let span = Span::of(found.iter().map(|found| found.disparity)).unwrap();
    let header = Header {
        view: 0,
        ..Header::new(0, NANOS, Size::new(1920, 480))
    };
    let mut rig = codec().rig().clone();
    rig.calibration = Some(messages::Calibration {
        focal_px: 700.0,
        baseline_m: 0.06,
        calibrated: true,
        ..messages::Calibration::assumed(header.size())
    });
    let codec = messages::record::Codec::new(rig, codec().reference());
    let (mut labels, mut drawn) = (Vec::new(), Vec::new());
    let mut views = Views::default();
    views.labels(&codec, &header, curves, (matches, span), &mut labels);
    assert_eq!(texts(&annotations(&labels)).len(), 24);
    views.annotations(&codec, &header, curves, Some((matches, span)), &mut drawn);
    let drawn = annotations(&drawn);
    let legend = texts(&drawn);
    assert_eq!((legend.len(), legend[4]), (5, "10.0 px, 4.20 m"));
}

#[test]
fn rejected_curves_are_drawn_and_labelled_by_their_reason() {
    let (curves, points) = fence(&[60, 80, 100, 300, 10, 12]);
    let curves = messages::CurvesView {
        curves: &curves,
        points: &points,
    };
    let rejected = [
        (0, Reason::NoPartner.code()),
        (2, 4711),
        (3, Reason::ThirdView.code()),
        (4, Reason::NoPartner.code()),
        (99, Reason::Short.code()),
    ]
    .map(|(curve, reason)| Rejected { curve, reason });
    let found = [Match {
        curves: [1, 1, 5],
        ..Match::default()
    }];
    let matches = messages::MatchesView {
        matches: &found,
        points: &[],
        rejected: &rejected,
    };
    let mut views = Views::default();
    let mut draw = |view: u32| {
        let header = Header {
            view,
            ..Header::new(0, NANOS, Size::new(640, 480))
        };
        let mut bytes = Vec::new();
        views.rejected(&codec(), &header, curves, matches, &mut bytes);
        annotations(&bytes)
    };
    // The reference view is the centre.
    let read = draw(1);
    let said = texts(&read);
    let (legend, labels) = said.split_at(3);
    assert_eq!(
        legend,
        ["1 another reason", "2 no partner", "1 third view disagrees"]
    );
    assert_eq!(labels, ["3 third view disagrees", "2 another reason"]);
    let columns = |read: &fg::ImageAnnotations| -> Vec<f64> {
        read.points.iter().map(|strip| strip.points[0].x).collect()
    };
    assert_eq!(columns(&read), [100.5, 148.5, 172.5, 196.5]);
    let colours: Vec<_> = read.points.iter().map(|p| p.outline_color).collect();
    assert_eq!(colours[0], colours[3]);
    assert!(colours[0] != colours[1] && colours[1] != colours[2]);
    assert_eq!(read.texts[1].background_color, colours[0]);
    // In another view those that no match names.
    let read = draw(2);
    assert_eq!(texts(&read)[0], "5 in no match");
    assert_eq!(columns(&read), [100.5, 124.5, 148.5, 172.5, 196.5]);
}

#[test]
fn channels_have_names_of_their_own_and_all_data_topics_are_there() {
    let channels = codec().channels(Shown::RECORDED);
    let mut names: Vec<_> = channels.iter().map(|c| &c.name).collect();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), channels.len());
    assert!(
        Topic::all(&rig())
            .iter()
            .all(|topic| names.contains(&&topic.name))
    );
    let none_of = |shown: Shown, what: &str| {
        let channels = codec().channels(shown);
        channels.iter().all(|channel| !channel.name.ends_with(what))
    };
    let views = Shown {
        views: true,
        ..Shown::default()
    };
    let rejected = Shown {
        rejected: true,
        ..Shown::default()
    };
    for what in ["annotations", "rejected", "disparity/picture"] {
        assert!(none_of(Shown::default(), what) && !none_of(Shown::ALL, what));
    }
    assert!(none_of(views, "rejected") && !none_of(views, "annotations"));
    assert!(none_of(rejected, "annotations") && !none_of(rejected, "rejected"));
}

#[test]
fn the_readme_lists_every_topic_with_its_schema() {
    let readme = include_str!("../README.md");
    for &kind in Kind::OWN {
        let (pattern, schema) = (Topic::pattern(kind), Schema::of(kind).name);
        let row = format!("| `{pattern}` |");
        let line = readme.lines().find(|line| line.starts_with(&row));
        let line = line.unwrap_or_else(|| panic!("README.md has no {row}"));
        assert!(line.contains(&schema), "{schema} in {line}");
    }
}

#[test]
fn any_view_knows_its_kind() {
    let points = Owned::<Points>::new(Size::new(2, 2));
    assert_eq!(AnyView::from(points.view()).kind(), Kind::Points);
}

#[test]
fn where_a_camera_stood_along_its_rail_is_read_from_the_transforms() {
    let rail = Rig::of_rail(Rail::default(), &[1.5], Size::new(40, 30));
    let codec = Codec::new(rail, 0);
    for position in [0.0, -1.25, 0.1 + 0.2, 1e9] {
        let mut bytes = Vec::new();
        codec.transforms(NANOS, Size::new(40, 30), position, &Sway::NONE, &mut bytes);
        assert_eq!(codec.position_in(&bytes), Some(position));
        assert!(codec.position_in(&bytes[..bytes.len() / 3]).is_none());
    }
}

#[test]
fn by_how_much_a_frame_is_off_is_read_from_the_transforms_and_a_steady_one_leaves_no_trace() {
    let size = Size::new(40, 30);
    let codec = Codec::new(Rig::of_rail(Rail::default(), &[1.5], size), 0);
    let of = |sway: &Sway| {
        let mut bytes = Vec::new();
        codec.transforms(NANOS, size, 0.25, sway, &mut bytes);
        bytes
    };
    let sway = Sway {
        right_px: 0.1 + 0.2,
        down_px: -1e-9,
        turn: 0.001,
        scale: -0.0,
    };
    let (swaying, steady) = (of(&sway), of(&Sway::NONE));
    assert_eq!(codec.sway_in(&swaying), sway);
    assert_eq!(codec.position_in(&swaying), Some(0.25));
    assert_eq!(codec.sway_in(&steady), Sway::NONE);
    // What is said of the sway stands behind what readers of transforms know.
    assert!(swaying.starts_with(&steady) && swaying.len() > steady.len());
}
