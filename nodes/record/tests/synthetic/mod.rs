//! Scans made up of discs: every contour is a circle that stands further left from view to view.
#![allow(dead_code, reason = "not every test needs all of it")]

use std::f32::consts::{PI, TAU};

use messages::{
    AnyView, Calibration, Curve, Curves, Disparity, Edge, Edges, Entry, Header, Image, Kind, Match,
    MatchPoint, Matches, Owned, Point, Points, Reason, Rejected, Rig, Size, Table, Tables, Topic,
};
use record::{Batch, Encoder, Metadata, Settings};

/// When the first scan is taken.
pub(crate) const START: u64 = 1_700_000_000_000_000_000;
/// From scan to scan.
pub(crate) const STEP: u64 = 33_333_333;

/// Three views, two channels, calibrated.
pub(crate) fn rig(size: Size) -> Rig {
    let camera = Calibration {
        focal_px: 600.0,
        cx: 30.0,
        cy: 20.0,
        baseline_m: 0.05,
        calibrated: true,
    };
    Rig {
        calibration: Some(camera),
        ..Rig::of_views(3, &[8.0, 1.5], size)
    }
}

/// A disc before the background.
struct Disc {
    x: f32,
    y: f32,
    radius: f32,
    disparity: f32,
    gray: u8,
}

/// All messages of a scan.
pub(crate) struct Scan {
    rig: Rig,
    images: Vec<Owned<Image>>,
    edges: Vec<Owned<Edges>>,
    curves: Vec<Owned<Curves>>,
    tables: Vec<Owned<Tables>>,
    matches: Vec<Owned<Matches>>,
    disparity: Owned<Disparity>,
    points: Owned<Points>,
}

impl Scan {
    /// The scan of this number with so many discs. The same number gives the same bytes.
    pub(crate) fn new(rig: &Rig, sequence: u64, discs: usize) -> Self {
        Self::taken_at(rig, START + sequence * STEP, sequence, discs)
    }

    /// The same, taken at another time.
    pub(crate) fn taken_at(rig: &Rig, nanos: u64, sequence: u64, discs: usize) -> Self {
        let size = rig.size;
        let mut state = sequence.wrapping_mul(977).wrapping_add(1);
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut disc = || {
            let radius = 2.0 + random() * size.height as f32 * 0.1;
            Disc {
                radius,
                x: radius + 12.0 + random() * (size.width as f32 - 2.0 * radius - 14.0).max(0.0),
                y: radius + 1.0 + random() * (size.height as f32 - 2.0 * radius - 2.0).max(0.0),
                disparity: 1.0 + 4.0 * random(),
                gray: (80.0 + 170.0 * random()) as u8,
            }
        };
        let discs: Vec<Disc> = (0..discs).map(|_| disc()).collect();

        let head = |view: u32, channel: u32| Header {
            view,
            channel,
            position_m: rig
                .views
                .get(view as usize)
                .map_or(0.0, |v| v.position_steps * 0.05),
            elapsed_nanos: 1_000_000 + sequence,
            ..Header::new(sequence, nanos, size)
        };
        let mut scan = Self {
            rig: rig.clone(),
            images: Vec::new(),
            edges: Vec::new(),
            curves: Vec::new(),
            tables: Vec::new(),
            matches: Vec::new(),
            disparity: Owned::new(size),
            points: Owned::new(size),
        };
        let none = messages::NONE;
        for view in 0..rig.views.len() as u32 {
            scan.images.push(owned(
                head(view, none),
                |room: &mut messages::ImageRoom<'_>| {
                    let pixels = room.pixels.grow(size.pixels());
                    draw(pixels, size, &discs, view);
                },
            ));
            for channel in 0..rig.channels.len() as u32 {
                let rings: Vec<Vec<Edge>> =
                    discs.iter().map(|disc| ring(disc, view, channel)).collect();
                scan.edges.push(owned(
                    head(view, channel),
                    |room: &mut messages::EdgesRoom<'_>| {
                        let mut all = rings.concat();
                        all.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
                        room.edges.extend_from_slice(&all);
                    },
                ));
                let curves: Owned<Curves> = owned(
                    head(view, channel),
                    |room: &mut messages::CurvesRoom<'_>| {
                        for (ring, disc) in rings.iter().zip(&discs) {
                            room.curves.push(Curve {
                                label: room.curves.len() as u32,
                                first: room.points.len() as u32,
                                count: ring.len() as u32,
                                parent: none,
                                x: disc.x - disc.disparity * view as f32,
                                y: disc.y,
                                magnitude: 40.0,
                                length: TAU * disc.radius,
                            });
                            room.points.extend_from_slice(ring);
                        }
                    },
                );
                scan.tables.push(owned(
                    head(view, channel),
                    |room: &mut messages::TablesRoom<'_>| {
                        tables(curves.view(), size, room);
                    },
                ));
                scan.curves.push(curves);
            }
        }
        let reference = scan.curves[..rig.channels.len()].to_vec();
        for (channel, curves) in reference.iter().enumerate() {
            let curves = curves.view();
            let head = head(none, channel as u32);
            scan.matches
                .push(owned(head, |room: &mut messages::MatchesRoom<'_>| {
                    // One in four is not matched.
                    for curve in curves.curves.iter().filter(|c| c.label % 4 == 3) {
                        room.rejected.push(Rejected {
                            curve: curve.label,
                            reason: Reason::ALL[curve.label as usize % 13].code(),
                        });
                    }
                    let found = discs
                        .iter()
                        .zip(curves.curves)
                        .filter(|(_, c)| c.label % 4 != 3);
                    for (disc, curve) in found {
                        room.matches.push(Match {
                            curves: [curve.label; 3],
                            first: room.points.len() as u32,
                            count: curve.count,
                            score: 0.9,
                            residual: 0.1,
                            disparity: disc.disparity,
                            support: 1.0,
                        });
                        for (point, edge) in curve.range().zip(curve.points(curves.points)) {
                            room.points.push(MatchPoint {
                                x: edge.x,
                                y: edge.y,
                                disparity: disc.disparity,
                                score: 0.5 + 0.5 * random(),
                                point: point as u32,
                                filled: 0,
                            });
                        }
                    }
                }));
        }
        let finest = scan
            .matches
            .last()
            .map_or(&[][..], |matches| matches.view().points)
            .to_vec();
        let place = |p: &MatchPoint| {
            let (x, y) = (p.x.round() as usize, p.y.round() as usize);
            (x < size.width as usize && y < size.height as usize)
                .then_some(y * size.width as usize + x)
        };
        scan.disparity = owned(
            head(none, none),
            |room: &mut messages::DisparityRoom<'_>| {
                let picture = room.disparity.grow(size.pixels());
                picture.fill(f32::NAN);
                for point in &finest {
                    if let Some(place) = place(point) {
                        picture[place] = point.disparity;
                    }
                }
            },
        );
        let camera = rig.calibration(size);
        scan.points = owned(head(none, none), |room: &mut messages::PointsRoom<'_>| {
            for p in &finest {
                let at = camera.point_m(p.x.into(), p.y.into(), p.disparity.into());
                let [x, y, z] = at.map(|metres| metres as f32);
                room.points.push(Point {
                    x,
                    y,
                    z,
                    u: p.x,
                    v: p.y,
                    disparity: p.disparity,
                    score: p.score,
                    curve: p.point / 100,
                    channel: rig.channels.len() as u32 - 1,
                });
            }
        });
        scan
    }

    /// Its messages, in the order of the topics.
    pub(crate) fn messages(&self) -> Vec<(Header, AnyView<'_>)> {
        let channels = self.rig.channels.len();
        let at = |topic: &Topic| topic.view as usize * channels + topic.channel as usize;
        let mut topics = Topic::all(&self.rig);
        topics.retain(|topic| !matches!(topic.kind, Kind::Raw | Kind::Truth | Kind::Evaluation));
        let topics = topics.into_iter();
        topics
            .map(|topic| match topic.kind {
                Kind::Image => both(&self.images[topic.view as usize]),
                Kind::Edges => both(&self.edges[at(&topic)]),
                Kind::Curves => both(&self.curves[at(&topic)]),
                Kind::Tables => both(&self.tables[at(&topic)]),
                Kind::Matches => both(&self.matches[topic.channel as usize]),
                Kind::Disparity => both(&self.disparity),
                Kind::Points => both(&self.points),
                other => unreachable!("{other:?} was left out"),
            })
            .collect()
    }

    /// Its points in space.
    pub(crate) fn points(&self) -> &[Point] {
        self.points.view().points
    }

    /// Its disparity picture.
    pub(crate) fn disparity(&self) -> &[f32] {
        self.disparity.view().disparity
    }

    /// Its image of the first view.
    pub(crate) fn image(&self) -> &[u8] {
        self.images[0].view().pixels
    }
}

fn both<M: messages::Message>(message: &Owned<M>) -> (Header, AnyView<'_>) {
    (message.header, message.view().into())
}

fn owned<M: messages::Message>(header: Header, fill: impl FnOnce(&mut M::Room<'_>)) -> Owned<M> {
    let mut message = Owned::new(header.size());
    message.fill(fill);
    message.header = Header {
        lens: message.header.lens,
        ..header
    };
    message
}

fn draw(pixels: &mut [u8], size: Size, discs: &[Disc], view: u32) {
    for (i, pixel) in pixels.iter_mut().enumerate() {
        let (x, y) = (i as u32 % size.width, i as u32 / size.width);
        *pixel = 30 + ((x * 7919 + y * 104_729 + x * y * 31) % 13) as u8;
    }
    for disc in discs {
        let x0 = disc.x - disc.disparity * view as f32;
        let rows = (disc.y - disc.radius).max(0.0) as u32..=(disc.y + disc.radius) as u32;
        for y in rows.filter(|y| *y < size.height) {
            let columns = (x0 - disc.radius).max(0.0) as u32..=(x0 + disc.radius) as u32;
            for x in columns.filter(|x| *x < size.width) {
                if (x as f32 - x0).hypot(y as f32 - disc.y) <= disc.radius {
                    pixels[(y * size.width + x) as usize] = disc.gray;
                }
            }
        }
    }
}

/// A disc's contour, a point a pixel, each pixel once.
fn ring(disc: &Disc, view: u32, channel: u32) -> Vec<Edge> {
    let count = (TAU * disc.radius) as u32 / (1 + channel % 2);
    let point = |i: u32| {
        let angle = i as f32 * TAU / count as f32;
        Edge {
            x: disc.x - disc.disparity * view as f32 + disc.radius * angle.cos(),
            y: disc.y + disc.radius * angle.sin(),
            magnitude: 40.0 + 10.0 * (angle * 3.0).sin(),
            orientation: (angle + PI).rem_euclid(TAU) - PI,
            profile: [30, 31, 32, 33, disc.gray, disc.gray, disc.gray, disc.gray],
        }
    };
    (0..count.max(1)).map(point).collect()
}

fn tables(curves: messages::CurvesView<'_>, size: Size, room: &mut messages::TablesRoom<'_>) {
    for curve in curves.curves {
        let points = curve.points(curves.points);
        room.tables.push(Table {
            curve: curve.label,
            first: curve.first,
            count: curve.count,
            x: curve.x,
            y: curve.y,
            weight: points.len() as f32,
        });
        let mut entries: Vec<Entry> = curve
            .range()
            .zip(points)
            .map(|(point, edge)| Entry {
                orientation: edge.orientation,
                rx: curve.x - edge.x,
                ry: curve.y - edge.y,
                weight: 1.0,
                point: point as u32,
            })
            .collect();
        entries.sort_by(|a, b| a.orientation.total_cmp(&b.orientation));
        room.entries.extend_from_slice(&entries);
    }
    let mut order: Vec<u32> = (0..curves.points.len() as u32).collect();
    let key = |p: &u32| curves.points[*p as usize];
    order.sort_by(|a, b| {
        key(a)
            .y
            .floor()
            .total_cmp(&key(b).y.floor())
            .then(key(a).x.total_cmp(&key(b).x))
    });
    for row in 0..=size.height {
        let before = order
            .iter()
            .filter(|p| key(p).y.floor() < row as f32)
            .count();
        room.rows.push(before as u32);
    }
    room.order.extend_from_slice(&order);
}

/// What a recording of this rig says about itself.
pub(crate) fn metadata(rig: &Rig) -> Metadata {
    Metadata {
        version: "0.1.0".to_owned(),
        graph: "graph LR\n  capture --> filter".to_owned(),
        configuration: serde_json::json!({ "filter": { "channels": [8.0, 1.5] } }),
        rig: rig.clone(),
        reference: 0,
        source: "discs".to_owned(),
        scans: vec!["discs".to_owned()],
    }
}

/// A scan's batch.
pub(crate) fn batch(encoder: &mut Encoder, scan: &Scan) -> Batch {
    let mut batch = Batch::default();
    encoder.encode(&scan.messages(), &mut batch);
    batch
}

/// An encoder for the rig.
pub(crate) fn encoder(rig: &Rig, settings: &Settings) -> Encoder {
    // There is no truth to compare with.
    let is_made = |kind: &Kind| !matches!(kind, Kind::Raw | Kind::Truth | Kind::Evaluation);
    let made: Vec<Kind> = Kind::all().filter(is_made).collect();
    record::encoder(rig, 0, &made, false, settings)
}
