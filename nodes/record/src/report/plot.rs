//! Plots as SVG in the page: histograms, and lines over the scans.

use std::fmt::{self, Write};

use super::page::{count, escape};

const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 200.0;
/// Room left of the plot, for numbers; and right, above and below it.
const SIDES: [f64; 4] = [44.0, 10.0, 8.0, 34.0];
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

/// A number beside an axis.
fn label(value: f64, places: usize) -> String {
    let (value, unit) = match value.abs() {
        large if large >= 1e9 => (value / 1e9, "G"),
        large if large >= 1e6 => (value / 1e6, "M"),
        large if large >= 1e4 => (value / 1e3, "k"),
        _ => return format!("{value:.places$}"),
    };
    // What is divided may have places that it had not.
    let text = format!("{value:.1}");
    format!("{}{unit}", text.trim_end_matches(".0"))
}

/// A number of a caption: three digits are enough.
pub(super) fn brief(value: f64) -> String {
    match value.abs() {
        large if large >= 1000.0 => count(value.round() as u64),
        large if large >= 100.0 => format!("{value:.0}"),
        large if large >= 10.0 => format!("{value:.1}"),
        large if large >= 1.0 || large == 0.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// Numbers of a caption, of the same kind: counts have no places behind the point.
fn briefly(values: &[f64]) -> fn(f64) -> String {
    match values.iter().all(|value| value.fract() == 0.0) {
        true => |value| count(value as u64),
        false => brief,
    }
}

/// The value below which a share of sorted values lies.
pub(super) fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    sorted.get((last as f64 * share).round() as usize).copied()
}

/// Maps values onto the plot.
struct Axes {
    x: (f64, f64),
    y: (f64, f64),
}

impl Axes {
    fn x(&self, value: f64) -> f64 {
        let [left, right, ..] = SIDES;
        left + (value - self.x.0) / (self.x.1 - self.x.0) * (WIDTH - left - right)
    }

    fn y(&self, value: f64) -> f64 {
        let [.., top, bottom] = SIDES;
        HEIGHT - bottom - (value - self.y.0) / (self.y.1 - self.y.0) * (HEIGHT - top - bottom)
    }

    /// The lines and numbers; below stands what x is.
    fn draw(&self, out: &mut String, x_ticks: &[f64], x_name: &str) -> fmt::Result {
        let [left, right, _, bottom] = SIDES;
        let (end, base) = (WIDTH - right, HEIGHT - bottom);
        let y_ticks = ticks(self.y.0, self.y.1, 4);
        let places = decimals(&y_ticks);
        for tick in &y_ticks {
            let y = self.y(*tick);
            let class = if *tick == 0.0 { "base" } else { "rule" };
            write!(
                out,
                "<line class=\"{class}\" x1=\"{left}\" x2=\"{end}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 6.0,
                y + 4.0,
                label(*tick, places)
            )?;
        }
        let places = decimals(x_ticks);
        for tick in x_ticks {
            write!(
                out,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                self.x(*tick),
                base + 14.0,
                label(*tick, places)
            )?;
        }
        write!(
            out,
            "<text x=\"{end}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            base + 29.0,
            escape(x_name)
        )
    }
}

fn begin(out: &mut String, title: &str, alt: &str) -> fmt::Result {
    write!(
        out,
        "<figure class=\"plot\"><h4>{}</h4><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">",
        escape(title),
        escape(alt)
    )
}

/// The end of a plot: what its colours are, when there are several, and what there is to say.
fn end(out: &mut String, series: &[Series], caption: &str) -> fmt::Result {
    out.push_str("</svg>");
    if series.len() > 1 {
        out.push_str("<ul class=\"keys\">");
        for (number, one) in series.iter().enumerate() {
            let colour = number % COLOURS;
            write!(
                out,
                "<li><i class=\"s{colour}\"></i>{}</li>",
                escape(&one.name)
            )?;
        }
        out.push_str("</ul>");
    }
    writeln!(out, "<figcaption>{}</figcaption></figure>", escape(caption))
}

/// How far beyond the hundredth that is greatest a plot may go on for its sake, in widths of the rest.
const LONGEST_TAIL: f64 = 0.5;

/// How often which values occur, the series one upon the other. The greatest hundredth is told in words where it reaches
/// so far that it would squeeze all others into a few bars.
pub(super) fn histogram(
    out: &mut String,
    title: &str,
    unit: &str,
    series: &[Series],
) -> fmt::Result {
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
        return write!(
            out,
            "<figure class=\"plot\"><h4>{}</h4><p class=\"missing\">There is none.</p></figure>",
            escape(title)
        );
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
    };
    let (number, median) = (count(sorted.len() as u64), brief(median));
    let beside = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    let alt = format!("Histogram: {title}; {number} values, median {median}{beside}");
    begin(out, title, &alt)?;
    axes.draw(out, &ticks(least, most, 6), unit)?;
    let wide = (axes.x(most) - axes.x(least)) / BINS as f64;
    for bin in 0..BINS {
        let mut below = 0;
        for (number, bins) in bins.iter().enumerate() {
            let (bottom, top) = (axes.y(below as f64), axes.y((below + bins[bin]) as f64));
            below += bins[bin];
            if bins[bin] > 0 {
                write!(
                    out,
                    "<rect class=\"s{}\" x=\"{:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
                    number % COLOURS,
                    axes.x(least) + wide * bin as f64 + 0.4,
                    wide - 0.8,
                    bottom - top
                )?;
            }
        }
    }
    let mut caption = format!("{number} values, median {median}{beside}");
    if beyond > 0 {
        let (beyond, most) = (count(beyond), brief(most));
        write!(caption, "; {beyond} beyond {most}{beside} are not shown")?;
    }
    end(out, series, &caption)
}

/// Values over the scans, from zero up.
pub(super) fn lines(
    out: &mut String,
    title: &str,
    unit: &str,
    scans: &[u64],
    series: &[Series],
) -> fmt::Result {
    let all = series.iter().flat_map(|one| one.values.iter().copied());
    let highest = all.filter(|value| value.is_finite()).fold(0.0, f64::max);
    let (first, last) = match scans {
        [] => return Ok(()),
        [first, .., last] => (*first as f64, *last as f64),
        // Of a single scan there is no line to draw.
        [_] => return numbers(out, title, unit, series),
    };
    let axes = Axes {
        x: (first, last),
        y: (0.0, if highest > 0.0 { highest * 1.06 } else { 1.0 }),
    };
    let caption = match series {
        [one] => summary(&one.values, unit),
        _ => {
            let each = series.iter().map(|one| {
                let mut sorted = one.values.clone();
                sorted.sort_by(f64::total_cmp);
                let median = quantile(&sorted, 0.5).unwrap_or_default();
                format!("{} {}", one.name, brief(median))
            });
            format!("medians in {unit}: {}", each.collect::<Vec<_>>().join(", "))
        }
    };
    begin(out, title, &format!("{title} over the scans: {caption}"))?;
    let mut x_ticks = ticks(first, last, 6);
    x_ticks.retain(|tick| tick.fract() == 0.0);
    let axis = if unit.is_empty() {
        "scan".to_owned()
    } else {
        format!("{unit}, by scan")
    };
    axes.draw(out, &x_ticks, &axis)?;
    for (number, one) in series.iter().enumerate() {
        let colour = number % COLOURS;
        let places = scans.iter().zip(&one.values);
        let places: Vec<String> = places
            .map(|(scan, value)| format!("{:.1},{:.1}", axes.x(*scan as f64), axes.y(*value)))
            .collect();
        write!(
            out,
            "<polyline class=\"s{colour}\" points=\"{}\"/>",
            places.join(" ")
        )?;
        // Of few scans each is marked.
        if places.len() <= 40 {
            for place in &places {
                let (x, y) = place.split_once(',').unwrap_or_default();
                write!(
                    out,
                    "<circle class=\"s{colour}\" cx=\"{x}\" cy=\"{y}\" r=\"2.6\"/>"
                )?;
            }
        }
    }
    end(out, series, &caption)
}

/// The numbers of a single scan.
fn numbers(out: &mut String, title: &str, unit: &str, series: &[Series]) -> fmt::Result {
    write!(
        out,
        "<figure class=\"plot\"><h4>{}</h4><dl class=\"numbers\">",
        escape(title)
    )?;
    for one in series {
        let name = if series.len() > 1 {
            one.name.as_str()
        } else {
            ""
        };
        let value = one
            .values
            .first()
            .map_or_else(String::new, |value| briefly(&one.values)(*value));
        write!(
            out,
            "<div><dt>{}</dt><dd>{value} <span>{}</span></dd></div>",
            escape(name),
            escape(unit)
        )?;
    }
    out.write_str("</dl></figure>\n")
}

fn summary(values: &[f64], unit: &str) -> String {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let brief = briefly(values);
    let of = |share| brief(quantile(&sorted, share).unwrap_or_default());
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    format!("median {}{unit}, {} to {}", of(0.5), of(0.0), of(1.0))
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
            ["0", "15k", "2M"]
        );
    }

    #[test]
    fn a_histogram_counts_every_value_once() {
        let series = |values: &[f64]| Series {
            name: "<one>".to_owned(),
            values: values.to_vec(),
        };
        let mut svg = String::new();
        let mut values: Vec<f64> = (0..1000).map(f64::from).collect();
        values.push(1e6);
        histogram(
            &mut svg,
            "length",
            "px",
            &[series(&values), series(&[f64::NAN])],
        )
        .unwrap_or_default();
        assert!(
            svg.contains("1\u{202f}001 values, median 500 px; 10 beyond 990 px"),
            "{svg}"
        );
        assert!(svg.contains("&lt;one&gt;") && !svg.contains("NaN"), "{svg}");
        let mut none = String::new();
        histogram(&mut none, "length", "px", &[]).unwrap_or_default();
        assert!(none.contains("There is none."), "{none}");
    }

    #[test]
    fn scans_make_lines_and_a_single_one_a_number() {
        let series = |values: &[f64]| Series {
            name: "edges".to_owned(),
            values: values.to_vec(),
        };
        let (mut one, mut two) = (String::new(), String::new());
        lines(&mut one, "edges", "ms", &[7], &[series(&[5.5])]).unwrap_or_default();
        assert!(
            one.contains("5.50 <span>ms</span>") && !one.contains("<svg"),
            "{one}"
        );
        lines(&mut two, "edges", "ms", &[7, 9], &[series(&[5.0, 6.0])]).unwrap_or_default();
        assert_eq!(two.matches("<circle").count(), 2, "{two}");
        assert!(
            two.contains(">7</text>") && two.contains(">9</text>"),
            "{two}"
        );
        assert!(!two.contains("NaN") && !two.contains("inf"), "{two}");
    }
}
