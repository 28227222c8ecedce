//! A scan on the page: its views, what came of it, its points in space, the thesis's figures channel by channel, what is
//! spread how.

use maud::{Markup, html};
use messages::record::{Pictured, Recorded, Seen, Span, Statistics};
use messages::{
    Calibration, Curves, CurvesView, Disparity, Edges, Image, Kind, Match, Matches, NONE, Owned,
    Points, Size, Topic, Truth,
};

use super::Fault;
use super::figures::{Look, Sheet, class};
use super::legend;
use super::page::{Album, Shown, count, counted, missing, table};
use super::plot::{Quantity, Series, Unit, brief, histogram};
use super::space::{self, Eye};
use crate::info::date;
use crate::{ReadError, Recording, Scan};

/// So many matches are listed, the longest first.
const MOST_LISTED: usize = 25;

/// What is read of a scan before it is drawn: all figures share the colours of its disparities.
struct Drawn<'a> {
    recording: &'a Recording,
    album: &'a mut Album,
    scan: Scan,
    sheet: Sheet,
    camera: Calibration,
    matches: Vec<Result<Owned<Matches>, ReadError>>,
    picture: Result<Owned<Disparity>, ReadError>,
    points: Result<Owned<Points>, ReadError>,
    span: Option<Span>,
}

/// The section of a scan, and how many bytes of it could not be read.
pub(super) fn section(
    album: &mut Album,
    recording: &mut Recording,
    sequence: u64,
    title: &str,
) -> Result<(Markup, u64), Fault> {
    let (scan, unreadable) = match recording.salvage(sequence) {
        Ok(read) => read,
        Err(error) => return Ok((framed(sequence, title, &missing(error)), 0)),
    };
    let mut drawn = Drawn::new(recording, album, scan);
    let channels = drawn.recording.metadata().rig.channels.clone();
    let (facts, views) = (drawn.facts(), drawn.views()?);
    let (results, space) = (drawn.results()?, drawn.space()?);
    let (mut figures, mut lengths) = (Vec::new(), Vec::new());
    for (channel, variance) in channels.iter().enumerate() {
        let (drawn, of_channel) = drawn.channel(channel, *variance)?;
        figures.push(drawn);
        lengths.push(of_channel);
    }
    let all = html! {
        @if unreadable > 0 {
            (missing(format_args!(
                "{} bytes of this scan are damaged; what could be read is shown",
                count(unreadable)
            )))
        }
        (facts)
        // One view and what came of it fit in a row.
        @if views.len() == 1 {
            (group("View and results", &[views, results].concat()))
        } @else {
            (group("Views", &views))
            (group("Results", &results))
        }
        (space)
        @for figures in &figures { (figures) }
        (drawn.distributions(&channels, lengths))
    };
    let scan = std::mem::take(&mut drawn.scan);
    drop(drawn);
    recording.reuse(scan);
    Ok((framed(sequence, title, &all), unreadable))
}

fn framed(sequence: u64, title: &str, all: &Markup) -> Markup {
    html! { section id={ "scan-" (sequence) } { h2 { (title) } (all) } "\n" }
}

impl<'a> Drawn<'a> {
    fn new(recording: &'a Recording, album: &'a mut Album, scan: Scan) -> Self {
        let (codec, rig) = (recording.codec(), &recording.metadata().rig);
        let matches = Topic::of(rig, Kind::Matches);
        let matches: Vec<_> = matches
            .iter()
            .map(|topic| scan.decode::<Matches>(codec, topic))
            .collect();
        let one = |kind| Topic::of(rig, kind).swap_remove(0);
        let picture = scan.decode::<Disparity>(codec, &one(Kind::Disparity));
        let points = scan.decode::<Points>(codec, &one(Kind::Points));
        let image = &Topic::of(rig, Kind::Image)[codec.reference()];
        let image = scan.decode::<Image>(codec, image);
        // Whatever is there knows the size of the scan's images.
        let sizes = [
            image.as_ref().ok().map(|m| m.header.size()),
            picture.as_ref().ok().map(|m| m.header.size()),
            points.as_ref().ok().map(|m| m.header.size()),
        ];
        let size: Size = sizes.into_iter().flatten().next().unwrap_or(rig.size);
        let matched = matches.iter().flatten().flat_map(|m| m.view().points);
        let matched = matched.map(|point| point.disparity);
        let pictured = picture.iter().flat_map(|m| m.view().disparity).copied();
        let placed = points.iter().flat_map(|m| m.view().points);
        let placed = placed.map(|point| point.disparity);
        let span = Span::of(matched.chain(pictured).chain(placed)).map(Span::rounded);
        Self {
            recording,
            album,
            sheet: Sheet::of(size),
            camera: rig.calibration(size),
            scan,
            matches,
            picture,
            points,
            span,
        }
    }

    fn decode<M: Recorded>(&self, topic: &Topic) -> Result<Owned<M>, ReadError> {
        self.scan.decode(self.recording.codec(), topic)
    }

    /// The topic of a kind in the reference view and a channel.
    fn of_reference(&self, kind: Kind, channel: usize) -> Option<Topic> {
        let reference = self.recording.codec().reference();
        let topics = Topic::of(&self.recording.metadata().rig, kind).into_iter();
        let mut of_view = topics.filter(|topic| topic.view == reference as u32);
        of_view.nth(channel)
    }

    fn reference(&self) -> &str {
        let metadata = self.recording.metadata();
        &metadata.rig.views[metadata.reference].name
    }

    /// When it was taken, and how much there is of it.
    fn facts(&self) -> Markup {
        let Size { width, height } = self.sheet.full;
        let statistics = self.scan.message("statistics");
        let statistics =
            statistics.and_then(|json| serde_json::from_slice::<Statistics>(json).ok());
        html! {
            p {
                (date(self.scan.nanos)) "; " (width) " × " (height) " px"
                @if let Some(of_scan) = statistics {
                    // What was not recorded was not counted.
                    @let counts = [
                        (of_scan.edges, "zero-crossings"),
                        (of_scan.curves, "curves"),
                        (of_scan.matches, "matched"),
                        (of_scan.points, "points in space"),
                    ];
                    @for (number, name) in counts.into_iter().filter(|(number, _)| *number > 0) {
                        "; " (count(number)) " " (name)
                    }
                    "; disparity known at " (brief(of_scan.known * 100.0)) " % of all pixels"
                }
                "."
            }
            @if self.sheet.step > 1 {
                p { "Figures are drawn at 1:" (self.sheet.step) ", so that the page stays small." }
            }
        }
    }

    /// What the cameras saw.
    fn views(&mut self) -> Result<Vec<Markup>, Fault> {
        let rig = &self.recording.metadata().rig;
        let mut figures = Vec::new();
        for (view, topic) in Topic::of(rig, Kind::Image).iter().enumerate() {
            let image: Owned<Image> = match self.decode(topic) {
                Ok(image) => image,
                Err(error) => {
                    figures.push(missing(error));
                    continue;
                }
            };
            let name = &rig.views[view].name;
            let is_reference = view == self.recording.codec().reference();
            let sheet = Sheet::of(image.header.size());
            let told = match is_reference {
                true => ", the reference, to which figures and points belong",
                false => "",
            };
            let shown = Shown {
                class: class(sheet, Look::Photograph),
                alt: &format!("Original, view {name}"),
                caption: html! { b { "Original" } ", view " (name) (told) },
            };
            let png = sheet.original(image.view().pixels)?;
            figures.push(self.album.picture(&png, sheet.size(), shown));
        }
        Ok(figures)
    }

    /// The four figures of a channel and its matches; and the lengths of its curves.
    fn channel(&mut self, channel: usize, variance: f32) -> Result<(Markup, Vec<f64>), Fault> {
        let (sheet, view) = (self.sheet, self.reference().to_owned());
        let of_channel = format!("view {view}, channel σ² = {variance}");
        let mut figures = Vec::new();
        let edges = self.of_reference(Kind::Edges, channel);
        match edges.map(|topic| self.decode::<Edges>(&topic)) {
            Some(Ok(edges)) => {
                let edges = edges.view().edges;
                let number = edges.len() as u64;
                let shown = Shown {
                    class: class(sheet, Look::Ink),
                    alt: &format!(
                        "Zero-crossings, {of_channel}: {}",
                        counted(number, "zero-crossing", "zero-crossings")
                    ),
                    caption: html! { b { "Zero-crossings" } " of ∇²G: " (count(number)) },
                };
                let png = sheet.zero_crossings(edges)?;
                figures.push(self.album.picture(&png, sheet.size(), shown));
                let shown = Shown {
                    class: class(sheet, Look::Sparse),
                    alt: &format!("Orientation of each zero-crossing as a hue, {of_channel}"),
                    caption: html! {
                        span.wheel {} b { "Orientation" }
                        " of the gradient: a hue points from dark to bright as it does on the wheel"
                    },
                };
                let png = sheet.orientation(edges)?;
                figures.push(self.album.picture(&png, sheet.size(), shown));
            }
            Some(Err(error)) => figures.push(missing(error)),
            None => {}
        }
        let mut lengths = Vec::new();
        let curves = self.of_reference(Kind::Curves, channel);
        match curves.map(|topic| self.decode::<Curves>(&topic)) {
            Some(Ok(curves)) => {
                let view: CurvesView<'_> = curves.view();
                lengths.extend(view.curves.iter().map(|curve| f64::from(curve.length)));
                let number = counted(view.curves.len() as u64, "curve", "curves");
                let shown = Shown {
                    class: class(sheet, Look::Sparse),
                    alt: &format!("Curve segments with centroids crossed, {of_channel}: {number}"),
                    caption: html! { b { "Curve segments" } ": " (number) ", centroids crossed" },
                };
                let png = sheet.segments(view)?;
                figures.push(self.album.picture(&png, sheet.size(), shown));
            }
            Some(Err(error)) => figures.push(missing(error)),
            None => {}
        }
        let mut list = html! {};
        match self.matches.get(channel) {
            Some(Ok(matches)) => {
                let found = matches.view();
                let number = counted(found.matches.len() as u64, "match", "matches");
                let points = counted(found.points.len() as u64, "point", "points");
                let shown = Shown {
                    class: class(sheet, Look::Sparse),
                    alt: &format!(
                        "Disparity along the matched curves, {of_channel}: {number}, {points}"
                    ),
                    caption: html! {
                        b { "Disparity" } " along the matched curves: " (number) ", " (points)
                        (self.legend())
                    },
                };
                let png = sheet.match_disparities(found.points, self.span)?;
                figures.push(self.album.picture(&png, sheet.size(), shown));
                list = self.list(found.matches);
            }
            Some(Err(error)) => figures.push(missing(error)),
            None => {}
        }
        let title = format!("Channel σ² = {variance}, view {view}");
        Ok((html! { (group(&title, &figures)) (list) }, lengths))
    }

    /// What the colours of disparities mean, in pixels and in depth.
    fn legend(&self) -> Markup {
        html! { @if let Some(span) = self.span { (legend::disparities(span, &self.camera)) } }
    }

    /// The longest matches.
    fn list(&self, matches: &[Match]) -> Markup {
        if matches.is_empty() {
            return html! {};
        }
        let mut longest: Vec<&Match> = matches.iter().collect();
        longest.sort_by_key(|found| (std::cmp::Reverse(found.count), found.curves));
        let more = longest.len().saturating_sub(MOST_LISTED) as u64;
        longest.truncate(MOST_LISTED);
        let listed = match more {
            0 => "all, the longest first".to_owned(),
            _ => format!("the longest {MOST_LISTED}, and {} more", count(more)),
        };
        let rig = &self.recording.metadata().rig;
        let named = rig.named(self.recording.codec().reference());
        let curves = named.map(|view| {
            let name = rig.views.get(view).map_or("", |view| view.name.as_str());
            format!("curve {name}")
        });
        let columns: Vec<(&str, bool)> = curves
            .iter()
            .map(String::as_str)
            .chain([
                "points",
                "score",
                "residual, px",
                "mean disparity, px",
                "depth",
                "support",
            ])
            .map(|name| (name, true))
            .collect();
        let rows = html! {
            @for found in longest {
                tr {
                    @for label in found.curves {
                        td.n { @if label == NONE { "–" } @else { (label) } }
                    }
                    td.n { (count(found.count.into())) }
                    td.n { (format_args!("{:.2}", found.score)) }
                    td.n { (format_args!("{:.2}", found.residual)) }
                    td.n { (format_args!("{:.2}", found.disparity)) }
                    td.n { (legend::depth(found.disparity, &self.camera)) }
                    td.n { (format_args!("{:.2}", found.support)) }
                }
                "\n"
            }
        };
        html! {
            details {
                summary { (counted(matches.len() as u64, "match", "matches")) " " span { (listed) } }
                (table(&columns, &rows))
            }
        }
    }

    /// What came of it: the disparity picture, how far its points are from the truth, and how sure they are.
    fn results(&mut self) -> Result<Vec<Markup>, Fault> {
        let mut figures = Vec::new();
        match &self.picture {
            Ok(found) => {
                let sheet = Sheet::of(found.header.size());
                let shown = Shown {
                    class: class(sheet, Look::Sparse),
                    alt: &format!("Disparity picture, view {}", self.reference()),
                    caption: html! {
                        b { "Disparity picture" } ": the channels together, unknown black"
                        (self.legend())
                    },
                };
                let png = sheet.disparity_picture(found.view().disparity, self.span)?;
                figures.push(self.album.picture(&png, sheet.size(), shown));
            }
            Err(error) => figures.push(missing(error)),
        }
        let Ok(points) = &self.points else {
            return Ok(figures);
        };
        let (points, sheet) = (points.view(), Sheet::of(points.header.size()));
        let seen = Seen {
            points: Some(points),
            ..Seen::default()
        };
        let truth = Topic::of(&self.recording.metadata().rig, Kind::Truth).pop();
        // Only some sources know a truth.
        let truth = truth.filter(|topic| self.recording.channels().contains_key(&*topic.name));
        match truth.map(|topic| self.decode::<Truth>(&topic)) {
            Some(Ok(truth)) => {
                let seen = Seen {
                    truth: Some(truth.view().disparity),
                    ..seen
                };
                let shown = Shown {
                    class: class(sheet, Look::Sparse),
                    alt: &format!("Error of each point, view {}", self.reference()),
                    caption: html! {
                        b { "Error" } " of each point: how far its disparity is from the truth, gray where that is not known"
                        (legend::of(Pictured::Error))
                    },
                };
                let png = sheet.painted(Pictured::Error, &seen)?;
                figures.push(self.album.picture(&png, sheet.size(), shown));
            }
            Some(Err(error)) => figures.push(missing(error)),
            None => {}
        }
        let shown = Shown {
            class: class(sheet, Look::Sparse),
            alt: &format!("Confidence of each point, view {}", self.reference()),
            caption: html! {
                b { "Confidence" } " of each point, by its score: the colour tells the chance that it is wrong by over a pixel"
                (legend::of(Pictured::Confidence))
            },
        };
        let png = sheet.painted(Pictured::Confidence, &seen)?;
        figures.push(self.album.picture(&png, sheet.size(), shown));
        Ok(figures)
    }

    /// The points from three sides.
    fn space(&mut self) -> Result<Markup, Fault> {
        let legend = self.legend();
        let points = match (&self.points, self.span) {
            (Ok(points), Some(span)) => {
                let (points, unit) = (points.view().points, legend::unit(&self.camera));
                space::views(self.album, points, span, unit, &legend, &eyes())?
            }
            (Ok(_), None) => missing("There are no points in space"),
            (Err(error), _) => missing(error),
        };
        let axes = format!(
            "x to the right, y down, z forward from the camera of view {}.",
            self.reference()
        );
        Ok(html! {
            h3 { "Points in space" }
            p {
                @if self.camera.calibrated { "In metres: " }
                @else { "Not calibrated: depths are right up to one factor, shapes only with the right focal length. " }
                (axes)
            }
            (points)
        })
    }

    /// How disparities, scores, depths, lengths and residuals are spread.
    fn distributions(&self, channels: &[f32], lengths: Vec<Vec<f64>>) -> Markup {
        let name = |channel: usize| format!("σ² {}", channels[channel]);
        let of_matches = |of: &dyn Fn(&Owned<Matches>) -> Vec<f64>| -> Vec<Series> {
            let readable = self.matches.iter().enumerate();
            let readable =
                readable.filter_map(|(channel, read)| Some((channel, read.as_ref().ok()?)));
            readable
                .map(|(channel, matches)| Series {
                    name: name(channel),
                    values: of(matches),
                })
                .collect()
        };
        let points = |of: fn(&messages::MatchPoint) -> f32| {
            of_matches(&|matches| {
                let values = matches.view().points.iter().map(of);
                values.map(f64::from).collect()
            })
        };
        let lengths = lengths.into_iter().enumerate();
        let lengths: Vec<Series> = lengths
            .map(|(channel, values)| Series {
                name: name(channel),
                values,
            })
            .collect();
        let residuals = of_matches(&|matches| {
            let found = matches.view().matches.iter();
            found.map(|found| f64::from(found.residual)).collect()
        });
        let placed = of_matches(&|matches| {
            let found = matches.view().matches.iter();
            found.map(|found| f64::from(found.count)).collect()
        });
        let in_space = self.points.iter().flat_map(|read| read.view().points);
        let depths = Series {
            name: "result".to_owned(),
            values: in_space.map(|point| f64::from(point.z)).collect(),
        };
        let px = |name| Quantity::of(name, "px");
        let depth = Quantity::of("depth", legend::unit(&self.camera));
        let score = Quantity {
            name: "score",
            unit: Unit::Share,
        };
        let (disparities, scores) = (points(|point| point.disparity), points(|point| point.score));
        let number = Quantity::counted("points");
        html! {
            h3 { "Distributions" }
            div.plots {
                (histogram("Disparity of matched points", px("disparity"), "points", &disparities))
                (histogram("Depth of points in space", depth, "points", &[depths]))
                (histogram("Score of matched points", score, "points", &scores))
                (histogram("Length of curves", px("length"), "curves", &lengths))
                (histogram("Points of a match", number, "matches", &placed))
                (histogram("Residual of matches", px("residual"), "matches", &residuals))
            }
        }
    }
}

/// From where the points of a scan are seen.
fn eyes() -> [(&'static str, &'static str, Eye); 3] {
    [
        (
            "from above on the left",
            "in perspective",
            Eye::above_left(),
        ),
        (
            "from the right",
            "one scale for both axes; the camera is on the left and looks right",
            Eye::side(),
        ),
        (
            "from above",
            "one scale for both axes; the camera is below and looks up",
            Eye::above(),
        ),
    ]
}

/// Pictures that belong together.
fn group(title: &str, figures: &[Markup]) -> Markup {
    html! {
        h3 { (title) }
        div.pictures { @for figure in figures { (figure) } }
    }
}
