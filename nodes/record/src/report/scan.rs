//! A scan on the page: its views, the thesis's figures channel by channel, its points in space, what is spread how.

use std::fmt::{self, Write};

use messages::record::{Recorded, Span, Statistics};
use messages::{
    Calibration, Curves, CurvesView, Disparity, Edges, Image, Kind, Match, Matches, NONE, Owned,
    Points, Size, Topic,
};

use super::Fault;
use super::figures::{Sheet, class};
use super::page::{Shown, count, counted, escape, missing, picture};
use super::plot::{Series, brief, histogram};
use super::space::{self, Eye};
use crate::info::date;
use crate::{ReadError, Recording, Scan};

/// So many matches are listed, the longest first.
const MOST_LISTED: usize = 25;

/// What is read of a scan before it is drawn: all figures share the colours of its disparities.
struct Drawn<'a> {
    recording: &'a Recording,
    scan: Scan,
    sheet: Sheet,
    camera: Calibration,
    matches: Vec<Result<Owned<Matches>, ReadError>>,
    picture: Result<Owned<Disparity>, ReadError>,
    points: Result<Owned<Points>, ReadError>,
    span: Option<Span>,
}

/// Writes the section of a scan, and gives how many bytes of it could not be read.
pub(super) fn section(
    out: &mut String,
    recording: &mut Recording,
    sequence: u64,
    title: &str,
) -> Result<u64, Fault> {
    write!(
        out,
        "<section id=\"scan-{sequence}\"><h2>{}</h2>",
        escape(title)
    )?;
    let (scan, unreadable) = match recording.salvage(sequence) {
        Ok(read) => read,
        Err(error) => {
            missing(out, error)?;
            out.push_str("</section>\n");
            return Ok(0);
        }
    };
    if unreadable > 0 {
        let bytes = count(unreadable);
        missing(
            out,
            format!("{bytes} bytes of this scan are damaged; what could be read is shown"),
        )?;
    }
    let mut drawn = Drawn::new(recording, scan);
    drawn.facts(out)?;
    drawn.views(out)?;
    let channels = drawn.recording.metadata().rig.channels.clone();
    let mut lengths = Vec::new();
    for (channel, variance) in channels.iter().enumerate() {
        lengths.push(drawn.channel(out, channel, *variance)?);
    }
    drawn.space(out)?;
    drawn.distributions(out, &channels, lengths)?;
    out.push_str("</section>\n");
    let scan = std::mem::take(&mut drawn.scan);
    drop(drawn);
    recording.reuse(scan);
    Ok(unreadable)
}

impl<'a> Drawn<'a> {
    fn new(recording: &'a Recording, scan: Scan) -> Self {
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
    fn facts(&self, out: &mut String) -> fmt::Result {
        let Size { width, height } = self.sheet.full;
        write!(
            out,
            "<p>{}; {width} × {height} px",
            escape(date(self.scan.nanos))
        )?;
        let statistics = self.scan.message("statistics");
        let statistics =
            statistics.and_then(|json| serde_json::from_slice::<Statistics>(json).ok());
        if let Some(of_scan) = statistics {
            // What was not recorded was not counted.
            let counts = [
                (of_scan.edges, "zero-crossings"),
                (of_scan.curves, "curves"),
                (of_scan.matches, "matched"),
                (of_scan.points, "points in space"),
            ];
            for (number, name) in counts.into_iter().filter(|(number, _)| *number > 0) {
                write!(out, "; {} {name}", count(number))?;
            }
            let known = of_scan.known * 100.0;
            write!(out, "; disparity known at {known:.1} % of all pixels")?;
        }
        out.push_str(".</p>");
        if self.sheet.step > 1 {
            let step = self.sheet.step;
            write!(
                out,
                "<p>Figures are drawn at 1:{step}, so that the page stays small.</p>"
            )?;
        }
        Ok(())
    }

    /// What the cameras saw.
    fn views(&self, out: &mut String) -> Result<(), Fault> {
        out.push_str("<h3>Views</h3><div class=\"grid three\">");
        let rig = &self.recording.metadata().rig;
        for (view, topic) in Topic::of(rig, Kind::Image).iter().enumerate() {
            let image: Owned<Image> = match self.decode(topic) {
                Ok(image) => image,
                Err(error) => {
                    missing(out, error)?;
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
            picture(
                out,
                &sheet.original(image.view().pixels)?,
                sheet.size(),
                &Shown {
                    class: class(sheet, false),
                    alt: &format!("Original, view {name}"),
                    caption: &format!("<b>Original</b>, view {}{told}", escape(name)),
                },
            )?;
        }
        out.push_str("</div>\n");
        Ok(())
    }

    /// The four figures of a channel and its matches; gives the lengths of its curves.
    fn channel(&self, out: &mut String, channel: usize, variance: f32) -> Result<Vec<f64>, Fault> {
        let (sheet, view) = (self.sheet, self.reference());
        let of_channel = format!("view {view}, channel σ² = {variance}");
        writeln!(
            out,
            "<h3>Channel σ² = {variance}, view {}</h3><div class=\"grid\">",
            escape(view)
        )?;
        let edges = self.of_reference(Kind::Edges, channel);
        match edges.map(|topic| self.decode::<Edges>(&topic)) {
            Some(Ok(edges)) => {
                let edges = edges.view().edges;
                let number = counted(edges.len() as u64, "zero-crossing", "zero-crossings");
                picture(
                    out,
                    &sheet.zero_crossings(edges)?,
                    sheet.size(),
                    &Shown {
                        class: class(sheet, true),
                        alt: &format!("Zero-crossings, {of_channel}: {number}"),
                        caption: &format!(
                            "<b>Zero-crossings</b> of ∇²G: {}",
                            count(edges.len() as u64)
                        ),
                    },
                )?;
                picture(
                    out,
                    &sheet.orientation(edges)?,
                    sheet.size(),
                    &Shown {
                        class: class(sheet, false),
                        alt: &format!("Orientation of each zero-crossing as a hue, {of_channel}"),
                        caption: "<span class=\"wheel\"></span><b>Orientation</b> of the gradient: a hue points from dark to \
                                  bright as it does on the wheel",
                    },
                )?;
            }
            Some(Err(error)) => missing(out, error)?,
            None => {}
        }
        let mut lengths = Vec::new();
        let curves = self.of_reference(Kind::Curves, channel);
        match curves.map(|topic| self.decode::<Curves>(&topic)) {
            Some(Ok(curves)) => {
                let view: CurvesView<'_> = curves.view();
                lengths.extend(view.curves.iter().map(|curve| f64::from(curve.length)));
                let number = counted(view.curves.len() as u64, "curve", "curves");
                picture(
                    out,
                    &sheet.segments(view)?,
                    sheet.size(),
                    &Shown {
                        class: class(sheet, false),
                        alt: &format!(
                            "Curve segments with centroids crossed, {of_channel}: {number}"
                        ),
                        caption: &format!("<b>Curve segments</b>: {number}, centroids crossed"),
                    },
                )?;
            }
            Some(Err(error)) => missing(out, error)?,
            None => {}
        }
        match self.matches.get(channel) {
            Some(Ok(matches)) => {
                let found = matches.view();
                let number = counted(found.matches.len() as u64, "match", "matches");
                let points = counted(found.points.len() as u64, "point", "points");
                let mut caption =
                    format!("<b>Disparity</b> along the matched curves: {number}, {points}");
                self.legend(&mut caption)?;
                picture(
                    out,
                    &sheet.match_disparities(found.points, self.span)?,
                    sheet.size(),
                    &Shown {
                        class: class(sheet, false),
                        alt: &format!(
                            "Disparity along the matched curves, {of_channel}: {number}, {points}"
                        ),
                        caption: &caption,
                    },
                )?;
                out.push_str("</div>\n");
                self.list(out, found.matches)?;
            }
            Some(Err(error)) => {
                missing(out, error)?;
                out.push_str("</div>\n");
            }
            None => out.push_str("</div>\n"),
        }
        Ok(lengths)
    }

    /// What the colours of disparities mean, in pixels and in depth.
    fn legend(&self, out: &mut String) -> fmt::Result {
        let Some(span) = self.span else { return Ok(()) };
        let (least, most) = span.ends();
        let middle = (least + most) / 2.0;
        out.push_str("<span class=\"ramp\"></span><span class=\"scale\">");
        for disparity in [least, middle, most] {
            write!(out, "<span>{} px</span>", brief(f64::from(disparity)))?;
        }
        out.push_str("</span><span class=\"scale\">");
        for disparity in [least, middle, most] {
            write!(out, "<span>{}</span>", self.depth(disparity))?;
        }
        out.write_str("</span>")
    }

    /// The depth of a disparity in words.
    fn depth(&self, disparity: f32) -> String {
        let depth = self.camera.depth_m(f64::from(disparity));
        match depth.is_finite() && depth > 0.0 {
            true => format!("{} {}", brief(depth), self.unit()),
            false => "∞".to_owned(),
        }
    }

    /// What depths are measured in: without a calibration nobody knows.
    fn unit(&self) -> &'static str {
        match self.camera.calibrated {
            true => "m",
            false => "units",
        }
    }

    /// The longest matches.
    fn list(&self, out: &mut String, matches: &[Match]) -> fmt::Result {
        if matches.is_empty() {
            return Ok(());
        }
        let mut longest: Vec<&Match> = matches.iter().collect();
        longest.sort_by_key(|found| (std::cmp::Reverse(found.count), found.curves));
        let more = longest.len().saturating_sub(MOST_LISTED) as u64;
        longest.truncate(MOST_LISTED);
        let listed = match more {
            0 => "all, the longest first".to_owned(),
            _ => format!("the longest {MOST_LISTED}, and {} more", count(more)),
        };
        write!(
            out,
            "<details><summary>{} <span>{listed}</span></summary><div class=\"wide\"><table><thead><tr>",
            counted(matches.len() as u64, "match", "matches")
        )?;
        let (rig, reference) = (
            &self.recording.metadata().rig,
            self.recording.codec().reference(),
        );
        for view in rig.named(reference) {
            let name = rig.views.get(view).map_or("", |view| view.name.as_str());
            write!(out, "<th class=\"n\">curve {}</th>", escape(name))?;
        }
        writeln!(
            out,
            "<th class=\"n\">points</th><th class=\"n\">score</th><th class=\"n\">residual, px</th>\
             <th class=\"n\">mean disparity, px</th><th class=\"n\">depth</th><th class=\"n\">support</th></tr></thead><tbody>"
        )?;
        for found in longest {
            out.push_str("<tr>");
            for label in found.curves {
                match label {
                    NONE => out.push_str("<td class=\"n\">–</td>"),
                    label => write!(out, "<td class=\"n\">{label}</td>")?,
                }
            }
            writeln!(
                out,
                "<td class=\"n\">{}</td><td class=\"n\">{:.2}</td><td class=\"n\">{:.2}</td><td class=\"n\">{:.2}</td>\
                 <td class=\"n\">{}</td><td class=\"n\">{:.2}</td></tr>",
                found.count,
                found.score,
                found.residual,
                found.disparity,
                self.depth(found.disparity),
                found.support
            )?;
        }
        out.push_str("</tbody></table>");
        if more > 0 {
            write!(out, "<p class=\"meaning\">and {} more</p>", count(more))?;
        }
        out.write_str("</div></details>\n")
    }

    /// The final disparity picture, and the points from three sides.
    fn space(&self, out: &mut String) -> Result<(), Fault> {
        out.push_str("<h3>Depth</h3><div class=\"grid two\">");
        match &self.picture {
            Ok(found) => {
                let sheet = Sheet::of(found.header.size());
                let mut caption =
                    "<b>Disparity picture</b>: the channels together, unknown black".to_owned();
                self.legend(&mut caption)?;
                picture(
                    out,
                    &sheet.disparity_picture(found.view().disparity, self.span)?,
                    sheet.size(),
                    &Shown {
                        class: class(sheet, false),
                        alt: &format!("Disparity picture, view {}", self.reference()),
                        caption: &caption,
                    },
                )?;
            }
            Err(error) => missing(out, error)?,
        }
        let points = match &self.points {
            Ok(points) => points.view().points,
            Err(error) => {
                missing(out, error)?;
                out.push_str("</div>\n");
                return Ok(());
            }
        };
        let Some(span) = self.span else {
            missing(out, "There are no points in space")?;
            out.push_str("</div>\n");
            return Ok(());
        };
        let eyes = [
            (
                "from above on the left",
                "in perspective",
                Eye::above_left(),
            ),
            (
                "from the right",
                "true to scale; the camera is on the left and looks right",
                Eye::side(),
            ),
            (
                "from above",
                "true to scale; the camera is below and looks up",
                Eye::above(),
            ),
        ];
        space::views(out, points, span, self.unit(), &eyes)?;
        out.push_str("</div>\n");
        let frame = format!(
            "x to the right, y down, z forward from the camera of view {}",
            escape(self.reference())
        );
        match self.camera.calibrated {
            true => write!(out, "<p>In metres: {frame}.</p>")?,
            false => write!(
                out,
                "<p>The cameras are not calibrated, so that units are metres up to one unknown factor: {frame}.</p>"
            )?,
        }
        Ok(())
    }

    /// How disparities, scores, lengths and residuals are spread.
    fn distributions(
        &self,
        out: &mut String,
        channels: &[f32],
        lengths: Vec<Vec<f64>>,
    ) -> fmt::Result {
        out.push_str("<h3>Distributions</h3><div class=\"grid\">");
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
        histogram(
            out,
            "Disparity of matched points",
            "px",
            &points(|point| point.disparity),
        )?;
        histogram(
            out,
            "Score of matched points",
            "",
            &points(|point| point.score),
        )?;
        let lengths = lengths.into_iter().enumerate();
        let lengths: Vec<Series> = lengths
            .map(|(channel, values)| Series {
                name: name(channel),
                values,
            })
            .collect();
        histogram(out, "Length of curves", "px", &lengths)?;
        let residuals = of_matches(&|matches| {
            let found = matches.view().matches.iter();
            found.map(|found| f64::from(found.residual)).collect()
        });
        histogram(out, "Residual of matches", "px", &residuals)?;
        out.write_str("</div>\n")
    }
}
