//! Curves over their image: those that are matched by disparity, those that are not by reason.

use super::annotations::{Colour, Sheet, opaque};
use super::views::straighten;
use super::{Codec, Span, Views, pictures};
use crate::Reason;
use crate::elements::{Curve, Match};
use crate::header::{Header, NONE};
use crate::payload::{CurvesView, MatchesView};

/// Curves whose partners were not found.
const UNMATCHED: Colour = [0.55, 0.6, 0.65, 0.7];

/// Labels over one image: more would hide it.
const MOST_LABELS: usize = 24;

/// Stands beside the codes of reasons: a reason that a later version gave.
const OTHER: u32 = 0;
/// Stands beside the codes of reasons: no match names the curve, which is not of the reference view.
const UNNAMED: u32 = Reason::ALL.len() as u32 + 1;

impl Views {
    /// Appends a view's curves over its image, a `foxglove.ImageAnnotations`: those that are matched in the colour of
    /// their disparity, with a dot at the centroid, and a legend of the colours in pixels and, of calibrated cameras, in
    /// metres.
    pub fn annotations(
        &mut self,
        codec: &Codec,
        header: &Header,
        curves: CurvesView<'_>,
        matches: Option<(MatchesView<'_>, Span)>,
        out: &mut Vec<u8>,
    ) {
        let Self {
            colours,
            strip,
            of_curve,
            labels,
            ..
        } = self;
        let found = matches.map_or(&[][..], |(matches, _)| matches.matches);
        assign(curves, found, codec.named(header.view as usize), of_curve);
        let colour_at = |share: f32| opaque(colours.of(share));
        let match_of = |index: u32| {
            let (found, (_, span)) = (found.get(index as usize)?, matches?);
            let is_known = found.disparity.is_finite();
            is_known.then(|| (found, colour_at(span.share(found.disparity))))
        };
        let drawn = || curves.curves.iter().zip(of_curve.iter());
        let mut sheet = Sheet::new(header.capture_nanos, out);
        for (curve, index) in drawn() {
            straighten(curve.points(curves.points), strip);
            let colour = match_of(*index).map_or(UNMATCHED, |(_, colour)| colour);
            sheet.strip(strip, colour);
        }
        let Some((_, span)) = matches else {
            return sheet.finish();
        };
        sheet.dots(drawn().filter_map(|(curve, index)| {
            let (_, colour) = match_of(*index)?;
            Some(([curve.x, curve.y], colour))
        }));

        labels.begin(header.size());
        pictures::disparities(codec, span, colours, labels, &mut sheet);
        sheet.finish();
    }

    /// Appends what can be said of a view's matched curves over its image, a `foxglove.ImageAnnotations`: the number of
    /// the match's curve in the reference view, the same in all views, the match's score, and its disparity in pixels.
    /// They stand beside the centroids of curves no shorter than their label, the longest first, at most
    /// two dozen, and none that would cover another.
    pub fn labels(
        &mut self,
        codec: &Codec,
        header: &Header,
        curves: CurvesView<'_>,
        (matches, span): (MatchesView<'_>, Span),
        out: &mut Vec<u8>,
    ) {
        let Self {
            colours,
            of_curve,
            longest,
            labels,
            ..
        } = self;
        let found = matches.matches;
        assign(curves, found, codec.named(header.view as usize), of_curve);
        let match_of = |curve: usize| {
            let found = found.get(*of_curve.get(curve)? as usize)?;
            found.disparity.is_finite().then_some(found)
        };
        let mut sheet = Sheet::new(header.capture_nanos, out);
        labels.begin(header.size());
        // Number, score and disparity have eleven letters at least: shorter curves need not be asked.
        let least = labels.width_of("0 0.000 0.0".len());
        let own = codec.named(codec.reference).unwrap_or_default();
        longest_first(
            curves.curves,
            least,
            |curve| match_of(curve).is_some(),
            longest,
        );
        let mut left = MOST_LABELS;
        for &label in longest.iter() {
            if left == 0 {
                break;
            }
            if let Some(found) = match_of(label as usize) {
                let Match {
                    score, disparity, ..
                } = *found;
                let text = format_args!("{} {score:.3} {disparity:.1}", found.curves[own]);
                let curve = &curves.curves[label as usize];
                let colour = opaque(colours.of(span.share(disparity)));
                left -= usize::from(labels.name(&mut sheet, curve, 1.0, text, colour));
            }
        }
        sheet.finish();
    }

    /// Appends the curves of a view that are not matched over its image, a `foxglove.ImageAnnotations`, in the colour of
    /// their [`Reason`], with a legend that counts them; labels say number and reason where there is room, beside curves
    /// at least half as long, the longest first.
    ///
    /// The matcher looks for the reference view's curves in the others: of theirs those are drawn that no match names. Of
    /// views by which matches do not name curves nothing can be said.
    pub fn rejected(
        &mut self,
        codec: &Codec,
        header: &Header,
        curves: CurvesView<'_>,
        matches: MatchesView<'_>,
        out: &mut Vec<u8>,
    ) {
        let Self {
            strip,
            of_curve,
            longest,
            labels,
            ..
        } = self;
        let is_reference = header.view as usize == codec.reference;
        if is_reference {
            of_curve.clear();
            of_curve.resize(curves.curves.len(), NONE);
            for rejected in matches.rejected {
                if let Some(slot) = of_curve.get_mut(rejected.curve as usize) {
                    *slot = Reason::of(rejected.reason).map_or(OTHER, Reason::code);
                }
            }
        } else {
            let named = codec.named(header.view as usize);
            assign(curves, matches.matches, named, of_curve);
            for slot in of_curve.iter_mut() {
                let is_unnamed = named.is_some() && *slot == NONE;
                *slot = if is_unnamed { UNNAMED } else { NONE };
            }
        }
        let mut sheet = Sheet::new(header.capture_nanos, out);
        let mut counts = [0u32; UNNAMED as usize + 1];
        for (curve, &why) in curves.curves.iter().zip(of_curve.iter()) {
            if let Some(count) = counts.get_mut(why as usize) {
                *count += 1;
                straighten(curve.points(curves.points), strip);
                sheet.strip(strip, colour_of(why));
            }
        }
        labels.begin(header.size());
        for (why, count) in (0..).zip(counts).filter(|&(_, count)| count > 0) {
            let text = format_args!("{count} {}", words_of(why));
            labels.tell(&mut sheet, text, colour_of(why));
        }
        let is_rejected = |curve: usize| of_curve[curve] != NONE;
        longest_first(curves.curves, 0.0, is_rejected, longest);
        for &label in longest.iter() {
            let (why, curve) = (of_curve[label as usize], &curves.curves[label as usize]);
            let text = format_args!("{label} {}", words_of(why));
            labels.name(&mut sheet, curve, 0.5, text, colour_of(why));
        }
        sheet.finish();
    }
}

/// Finds of every curve of a view the index of the match that names it, or [`NONE`]; matches name the curves of three
/// views, of which it is the one `named`.
fn assign(curves: CurvesView<'_>, found: &[Match], named: Option<usize>, of_curve: &mut Vec<u32>) {
    of_curve.clear();
    of_curve.resize(curves.curves.len(), NONE);
    for (index, found) in (0..).zip(found) {
        let label = named.and_then(|named| found.curves.get(named));
        if let Some(slot) = label.and_then(|&label| of_curve.get_mut(label as usize)) {
            *slot = index;
        }
    }
}

/// The indices of the curves that are asked for and of this length at least, the longest first.
fn longest_first(
    curves: &[Curve],
    least: f32,
    is_asked: impl Fn(usize) -> bool,
    longest: &mut Vec<u32>,
) {
    longest.clear();
    let long = (0..).zip(curves).filter(|(_, curve)| curve.length >= least);
    longest.extend(
        long.map(|(index, _)| index)
            .filter(|&index| is_asked(index as usize)),
    );
    let length = |&curve: &u32| curves[curve as usize].length;
    longest.sort_unstable_by(|a, b| length(b).total_cmp(&length(a)).then(a.cmp(b)));
}

fn words_of(why: u32) -> &'static str {
    match why {
        UNNAMED => "in no match",
        code => Reason::of(code).map_or("another reason", Reason::words),
    }
}

/// Few colours, which nobody confuses (M. Okabe and K. Ito, "Color universal design", 2008): one for each step of the
/// matcher, so that no method has two reasons of one colour that are not akin.
fn colour_of(why: u32) -> Colour {
    let rgb = match Reason::of(why) {
        None | Some(Reason::Flat) => [170, 170, 170],
        Some(Reason::NoPartner) => [230, 159, 0],
        Some(Reason::ThirdView | Reason::Loop) => [86, 180, 233],
        Some(Reason::Unlike | Reason::Unsteady | Reason::Votes) => [0, 158, 115],
        Some(Reason::Short) => [240, 228, 66],
        Some(Reason::Ambiguous | Reason::NotUnique) => [0, 114, 178],
        Some(Reason::Neighbours | Reason::Region) => [204, 121, 167],
        Some(Reason::Unsure) => [213, 94, 0],
    };
    opaque(rgb)
}
