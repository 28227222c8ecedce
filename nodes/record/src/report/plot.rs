//! Plots as SVG in the page: histograms, and lines over the scans.

use std::fmt::{self, Display};

use maud::{Markup, html};

use super::page::{At, Figure, count, missing, numbers};

const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 230.0;
/// Room left of the plot, for numbers; and right, above and below it, for the names of the axes.
const SIDES: [f64; 4] = [56.0, 12.0, 26.0, 42.0];
const BINS: usize = 40;
/// How many colours there are for series.
const COLOURS: usize = 8;

/// Values that belong together.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Series {
    /// What they are of.
    pub(super) name: String,
    /// In their order.
    pub(super) values: Vec<f64>,
}

/// What an axis measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Quantity<'a> {
    /// What it is called.
    pub(super) name: &'a str,
    /// What it is measured in.
    pub(super) unit: Unit<'a>,
}

/// What a quantity is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit<'a> {
    /// In this unit: `px`, `m`, `ms`, `%`.
    In(&'a str),
    /// It is counted.
    Count,
    /// A share, 0 to 1.
    Share,
}

impl<'a> Quantity<'a> {
    /// A quantity in a unit.
    pub(super) const fn of(name: &'a str, unit: &'a str) -> Self {
        Self {
            name,
            unit: Unit::In(unit),
        }
    }

    /// A number of things.
    pub(super) const fn counted(name: &'a str) -> Self {
        Self {
            name,
            unit: Unit::Count,
        }
    }

    /// What stands behind its numbers, or nothing.
    fn beside(self) -> &'a str {
        match self.unit {
            Unit::In(unit) => unit,
            Unit::Count | Unit::Share => "",
        }
    }
}

impl Display for Quantity<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.unit {
            Unit::In(unit) => unit,
            Unit::Count => "count",
            Unit::Share => "0 to 1",
        };
        write!(f, "{} ({unit})", self.name)
    }
}

/// Round numbers between two ends, at most so many but two at least where two lie there.
pub(super) fn ticks(least: f64, most: f64, at_most: usize) -> Vec<f64> {
    let width = most - least;
    if !width.is_finite() || width <= 0.0 {
        return Vec::new();
    }
    let rough = width / at_most.clamp(2, 20) as f64;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|step| *step >= rough * 0.999)
        .unwrap_or(power * 10.0);
    let first = (least / step).ceil() as i64;
    let last = (most / step + 1e-9).floor() as i64;
    (first..=last).map(|n| n as f64 * step).collect()
}

/// How many places behind the point these ticks need.
pub(super) fn decimals(ticks: &[f64]) -> usize {
    match ticks {
        [first, second, ..] => (-(second - first).log10() - 1e-9).ceil().clamp(0.0, 6.0) as usize,
        _ => 1,
    }
}

/// A whole number with its thousands apart.
fn whole(value: f64) -> String {
    let sign = if value <= -0.5 { "-" } else { "" };
    format!("{sign}{}", count(value.abs().round() as u64))
}

/// A number beside an axis.
fn label(value: f64, places: usize) -> String {
    let (value, unit) = match value.abs() {
        large if large >= 1e9 => (value / 1e9, "G"),
        large if large >= 1e6 => (value / 1e6, "M"),
        large if large >= 1e3 && places == 0 => return whole(value),
        _ => return format!("{value:.places$}"),
    };
    // What is divided may have places that it had not.
    let text = format!("{value:.1}");
    format!("{} {unit}", text.trim_end_matches(".0"))
}

/// A number of a caption: three digits are enough.
pub(super) fn brief(value: f64) -> String {
    // As much as is rounded up to the next power of ten has a place less behind the point.
    match value.abs() {
        large if large >= 999.5 => whole(value),
        large if large >= 99.95 => format!("{value:.0}"),
        large if large >= 9.995 => format!("{value:.1}"),
        large if large >= 0.9995 || large == 0.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// Numbers of a caption, of the same kind: counts have no places behind the point.
fn briefly(values: &[f64]) -> fn(f64) -> String {
    match values.iter().all(|value| value.fract() == 0.0) {
        true => whole,
        false => brief,
    }
}

/// The value below which a share of sorted values lies.
pub(super) fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    sorted.get((last as f64 * share).round() as usize).copied()
}

/// The value in the middle, as a caption has it.
pub(super) fn median(values: &[f64]) -> Option<String> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    quantile(&sorted, 0.5).map(briefly(values))
}

/// Maps values onto the plot.
struct Axes<'a> {
    x: (f64, f64),
    y: (f64, f64),
    /// What they measure.
    across: Quantity<'a>,
    up: Quantity<'a>,
}

impl Axes<'_> {
    fn x(&self, value: f64) -> f64 {
        let [left, right, ..] = SIDES;
        left + (value - self.x.0) / (self.x.1 - self.x.0) * (WIDTH - left - right)
    }

    fn y(&self, value: f64) -> f64 {
        let [.., top, bottom] = SIDES;
        HEIGHT - bottom - (value - self.y.0) / (self.y.1 - self.y.0) * (HEIGHT - top - bottom)
    }

    /// The lines and numbers, and what they measure.
    fn drawn(&self, x_ticks: &[f64]) -> Markup {
        let [left, right, top, bottom] = SIDES;
        let (end, base) = (WIDTH - right, HEIGHT - bottom);
        let y_ticks = ticks(self.y.0, self.y.1, 4);
        let (x_places, y_places) = (decimals(x_ticks), decimals(&y_ticks));
        html! {
            @for tick in &y_ticks {
                @let y = self.y(*tick);
                line class=(if *tick == 0.0 { "base" } else { "rule" })
                    x1=(left) x2=(end) y1=(At(y)) y2=(At(y)) {}
                text x=(left - 6.0) y=(At(y + 4.0)) text-anchor="end" { (label(*tick, y_places)) }
            }
            @for tick in x_ticks {
                text x=(At(self.x(*tick))) y=(base + 16.0) text-anchor="middle" { (label(*tick, x_places)) }
            }
            text.axis x="2" y=(top - 12.0) { (self.up) }
            text.axis x=(end) y=(base + 34.0) text-anchor="end" { (self.across) }
        }
    }
}

/// A plot: its title, what is drawn, what its colours are when there are several, and what there is to say.
fn plot(title: &str, alt: &str, drawn: &Markup, series: &[Series], caption: &str) -> Markup {
    html! {
        figure.plot {
            h4 { (title) }
            svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(alt) { (drawn) }
            @if series.len() > 1 {
                ul.keys {
                    @for (number, one) in series.iter().enumerate() {
                        li { i class=(colour(number)) {} (one.name) }
                    }
                }
            }
            figcaption { (caption) }
        }
        "\n"
    }
}

/// The class of a series's colour.
fn colour(number: usize) -> String {
    format!("s{}", number % COLOURS)
}

/// How far beyond the hundredth that is greatest a plot may go on for its sake, in widths of the rest.
const LONGEST_TAIL: f64 = 0.5;

/// How often which values occur, the series one upon the other. The greatest hundredth is told in words where it reaches
/// so far that it would squeeze all others into a few bars.
pub(super) fn histogram(
    title: &str,
    across: Quantity<'_>,
    what: &str,
    series: &[Series],
) -> Markup {
    let mut sorted: Vec<f64> = series
        .iter()
        .flat_map(|one| one.values.iter().copied())
        .collect();
    sorted.retain(|value| value.is_finite());
    sorted.sort_by(f64::total_cmp);
    let ends = (
        sorted.first().copied(),
        quantile(&sorted, 0.99),
        quantile(&sorted, 0.5),
        sorted.last().copied(),
    );
    let (Some(least), Some(most), Some(median), Some(greatest)) = ends else {
        return html! { figure.plot { h4 { (title) } (missing("There is none")) } };
    };
    // From zero, where that costs little room.
    let least = if least >= 0.0 && least < most / 2.0 {
        0.0
    } else {
        least
    };
    let is_short = greatest - most <= LONGEST_TAIL * (most - least);
    let most = if is_short { greatest } else { most };
    let most = if most > least { most } else { least + 1.0 };
    let mut bins = vec![[0u64; BINS]; series.len()];
    let mut beyond = 0;
    for (one, bins) in series.iter().zip(&mut bins) {
        for value in one.values.iter().filter(|value| value.is_finite()) {
            let bin = ((value - least) / (most - least) * BINS as f64) as usize;
            match *value > most {
                true => beyond += 1,
                false => bins[bin.min(BINS - 1)] += 1,
            }
        }
    }
    let height = |bin: usize| bins.iter().map(|bins| bins[bin]).sum::<u64>();
    let highest = (0..BINS).map(height).max().unwrap_or_default().max(1);
    let axes = Axes {
        x: (least, most),
        y: (0.0, highest as f64 * 1.04),
        across,
        up: Quantity::counted(what),
    };
    let beside = spaced(across);
    let mut caption = format!(
        "{} values, median {}{beside}",
        count(sorted.len() as u64),
        brief(median)
    );
    let alt = format!("Histogram: {title}; {caption}");
    if beyond > 0 {
        let (beyond, most) = (count(beyond), brief(most));
        caption += &format!("; {beyond} beyond {most}{beside} are not shown");
    }
    let wide = (axes.x(most) - axes.x(least)) / BINS as f64;
    let drawn = html! {
        (axes.drawn(&ticks(least, most, 6)))
        @for bin in 0..BINS {
            @for (number, own) in bins.iter().enumerate().filter(|(_, own)| own[bin] > 0) {
                @let below: u64 = bins[..number].iter().map(|bins| bins[bin]).sum();
                @let (bottom, top) = (axes.y(below as f64), axes.y((below + own[bin]) as f64));
                rect class=(colour(number)) x=(At(axes.x(least) + wide * bin as f64 + 0.4)) y=(At(top))
                    width=(At(wide - 0.8)) height=(At(bottom - top)) {}
            }
        }
    };
    plot(title, &alt, &drawn, series, &caption)
}

/// A quantity's unit behind a number.
fn spaced(quantity: Quantity<'_>) -> String {
    match quantity.beside() {
        "" => String::new(),
        unit => format!(" {unit}"),
    }
}

/// Values over the scans, from zero up.
pub(super) fn lines(title: &str, up: Quantity<'_>, scans: &[u64], series: &[Series]) -> Markup {
    let all = series.iter().flat_map(|one| one.values.iter().copied());
    let highest = all.filter(|value| value.is_finite()).fold(0.0, f64::max);
    let (first, last) = match scans {
        [] => return html! {},
        [first, .., last] => (*first as f64, *last as f64),
        // Of a single scan there is no line to draw.
        [_] => return of_one(title, up, series),
    };
    let axes = Axes {
        x: (first, last),
        y: (0.0, if highest > 0.0 { highest * 1.06 } else { 1.0 }),
        across: Quantity {
            name: "scan",
            unit: Unit::In("number"),
        },
        up,
    };
    let caption = match series {
        [one] => summary(&one.values, up),
        _ => {
            let each = series.iter().map(|one| {
                let median = median(&one.values).unwrap_or_default();
                format!("{} {median}{}", one.name, spaced(up))
            });
            format!("medians: {}", each.collect::<Vec<_>>().join(", "))
        }
    };
    let mut x_ticks = ticks(first, last, 6);
    x_ticks.retain(|tick| tick.fract() == 0.0);
    let drawn = html! {
        (axes.drawn(&x_ticks))
        @for (number, one) in series.iter().enumerate() {
            @let places = || scans.iter().zip(&one.values).map(|(x, y)| (axes.x(*x as f64), axes.y(*y)));
            polyline class=(colour(number)) points=(strip(places())) {}
            // Of few scans each is marked.
            @if scans.len() <= 40 {
                @for (x, y) in places() {
                    circle class=(colour(number)) cx=(At(x)) cy=(At(y)) r="2.6" {}
                }
            }
        }
    };
    let alt = format!("{title} over the scans: {caption}");
    plot(title, &alt, &drawn, series, &caption)
}

/// The places that a line goes through.
fn strip(places: impl Iterator<Item = (f64, f64)>) -> String {
    let place = |(x, y)| format!("{},{}", At(x), At(y));
    places.map(place).collect::<Vec<_>>().join(" ")
}

/// The numbers of a single scan.
fn of_one(title: &str, up: Quantity<'_>, series: &[Series]) -> Markup {
    let of = |one: &Series| Figure {
        name: match series.len() {
            1 => title.to_owned(),
            _ => one.name.clone(),
        },
        value: median(&one.values).unwrap_or_default(),
        unit: up.beside().to_owned(),
    };
    let figures: Vec<Figure> = series.iter().map(of).collect();
    html! { div.plot { (numbers(&figures)) } }
}

fn summary(values: &[f64], of: Quantity<'_>) -> String {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let brief = briefly(values);
    let at = |share| brief(quantile(&sorted, share).unwrap_or_default());
    let unit = spaced(of);
    format!("median {}{unit}, {} to {}{unit}", at(0.5), at(0.0), at(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(
            ticks(0.93, 1.31, 4),
            [1.0, 1.1, 1.2, 1.3].map(|t: f64| (t * 10.0).round() * 0.1)
        );
        assert!(ticks(3.0, 3.0, 5).is_empty());
        assert!(ticks(0.0, f64::INFINITY, 5).is_empty());
        assert_eq!(decimals(&ticks(0.0, 1.0, 5)), 1);
        assert_eq!(decimals(&ticks(0.0, 1000.0, 5)), 0);
        assert_eq!(
            [0.0, 15_000.0, 2e6].map(|value| label(value, 0)),
            ["0", "15\u{202f}000", "2 M"]
        );
    }

    #[test]
    fn numbers_of_captions_have_three_digits_and_thousands_apart() {
        let numbers = [0.0, 0.0456, 0.9999, 9.999, 15.04, 99.96, -1234.4];
        assert_eq!(
            numbers.map(brief),
            [
                "0.00",
                "0.046",
                "1.00",
                "10.0",
                "15.0",
                "100",
                "-1\u{202f}234"
            ]
        );
    }

    #[test]
    fn a_histogram_counts_every_value_once() {
        let series = |values: &[f64]| Series {
            name: "<one>".to_owned(),
            values: values.to_vec(),
        };
        let mut values: Vec<f64> = (0..1000).map(f64::from).collect();
        values.push(1e6);
        let length = Quantity::of("length", "px");
        let both = [series(&values), series(&[f64::NAN])];
        let svg = histogram("Length", length, "curves", &both).into_string();
        assert!(
            svg.contains("1\u{202f}001 values, median 500 px; 10 beyond 990 px"),
            "{svg}"
        );
        assert!(svg.contains("&lt;one&gt;") && !svg.contains("NaN"), "{svg}");
        for axis in ["length (px)", "curves (count)"] {
            assert!(svg.contains(axis), "{svg}");
        }
        let none = histogram("Length", length, "curves", &[]).into_string();
        assert!(none.contains("There is none."), "{none}");
    }

    #[test]
    fn scans_make_lines_and_a_single_one_a_number() {
        let series = |values: &[f64]| Series {
            name: "edges".to_owned(),
            values: values.to_vec(),
        };
        let time = Quantity::of("time", "ms");
        let one = lines("edges", time, &[7], &[series(&[5.5])]).into_string();
        assert!(
            one.contains("5.50 <span>ms</span>") && !one.contains("<svg"),
            "{one}"
        );
        let two = lines("edges", time, &[7, 9], &[series(&[5.0, 6.0])]).into_string();
        for axis in ["time (ms)", "scan (number)"] {
            assert!(two.contains(axis), "{two}");
        }
        assert_eq!(two.matches("<circle").count(), 2, "{two}");
        assert!(
            two.contains(">7</text>") && two.contains(">9</text>"),
            "{two}"
        );
        assert!(!two.contains("NaN") && !two.contains("inf"), "{two}");
    }
}
