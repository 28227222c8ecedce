//! Views for people, derived from the data: colours, and what it takes to draw curves.

use super::annotations::Labels;
use crate::elements::Edge;

/// Colours of disparities: blue is far, red near. They are Turbo's (A. Mikhailov, "Turbo, an improved rainbow colormap for
/// visualization", 2019), which viewers of point clouds have, so that one disparity has one colour in every picture.
#[derive(Clone, Debug)]
pub struct Colours {
    steps: [[u8; 3]; 256],
}

impl Default for Colours {
    fn default() -> Self {
        Self::new()
    }
}

impl Colours {
    /// What no disparity has in a picture.
    pub const UNKNOWN: [u8; 3] = [0, 0, 0];

    /// The part of Turbo that is used: its ends are too dark to be seen on black.
    const USED: [f32; 2] = [0.07, 0.93];

    /// The used part of Turbo, in even steps.
    pub fn new() -> Self {
        let [least, most] = Self::USED;
        let step = |i: usize| turbo(least + (most - least) * i as f32 / 255.0);
        Self {
            steps: std::array::from_fn(step),
        }
    }

    /// The ends of a range that all of Turbo is spread over where its used part is spread over this one.
    pub fn whole_range([least, most]: [f32; 2]) -> [f32; 2] {
        let [first, last] = Self::USED;
        let unit = (most - least) / (last - first);
        [least - first * unit, most + (1.0 - last) * unit]
    }

    /// Once round the circle of hues at one lightness and one chroma: for directions, where the last step is next to the
    /// first and none stands out.
    pub fn circle() -> Self {
        // The greatest chroma that the display shows of every hue is 0.127, and it is at this lightness.
        let step = |i: usize| shown(0.75, 0.126, i as f64 / 256.0 * std::f64::consts::TAU);
        Self {
            steps: std::array::from_fn(|i| step(i).unwrap_or_default()),
        }
    }

    /// The colour of a share of the range, 0 far to 1 near.
    pub fn of(&self, share: f32) -> [u8; 3] {
        self.steps[(share * 255.0) as usize & 255]
    }
}

/// A colour of Turbo, from the polynomials of R. Du for it (2019).
fn turbo(share: f32) -> [u8; 3] {
    const RED: [f32; 6] = [
        0.135_721_38,
        4.615_392_6,
        -42.660_324,
        132.131_09,
        -152.942_4,
        59.286_38,
    ];
    const GREEN: [f32; 6] = [
        0.091_402_61,
        2.194_188_4,
        4.842_966_6,
        -14.185_033,
        4.277_298_6,
        2.829_566,
    ];
    const BLUE: [f32; 6] = [
        0.106_673_3,
        12.641_946,
        -60.582_05,
        110.362_77,
        -89.903_11,
        27.348_25,
    ];
    let level = |terms: [f32; 6]| {
        let value = terms.iter().rev().fold(0.0, |sum, term| sum * share + term);
        (255.0 * value.clamp(0.0, 1.0)).round() as u8
    };
    [RED, GREEN, BLUE].map(level)
}

/// A colour, when the display shows it.
fn shown(lightness: f64, chroma: f64, hue: f64) -> Option<[u8; 3]> {
    let rgb = srgb_from_oklab(lightness, chroma * hue.cos(), chroma * hue.sin());
    let is_shown = rgb.iter().all(|c| (0.0..=1.0).contains(c));
    is_shown.then(|| rgb.map(|c| (c * 255.0).round() as u8))
}

fn srgb_from_oklab(l: f64, a: f64, b: f64) -> [f64; 3] {
    let lms = [
        l + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
        l - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
        l - 0.089_484_177_5 * a - 1.291_485_548_0 * b,
    ]
    .map(|c| c.powi(3));
    [
        [4.076_741_662_1, -3.307_711_591_3, 0.230_969_929_2],
        [-1.268_438_004_6, 2.609_757_401_1, -0.341_319_396_5],
        [-0.004_196_086_3, -0.703_418_614_7, 1.707_614_701_0],
    ]
    .map(|row| {
        let linear: f64 = row.iter().zip(lms).map(|(m, c)| m * c).sum();
        if linear <= 0.003_130_8 {
            12.92 * linear
        } else {
            1.055 * linear.powf(1.0 / 2.4) - 0.055
        }
    })
}

/// The disparities that take the whole range of colours: all but the outermost hundredth at either end, and none that is
/// farther beyond the middle eight tenths than a quarter of their width, so that neither stray ones nor one near object
/// decide every colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    least: f32,
    most: f32,
}

impl Span {
    /// The span of these disparities, or of what else is shown in colours; unknown ones are passed over. `None` when there
    /// are none.
    pub fn of(disparities: impl Iterator<Item = f32> + Clone) -> Option<Self> {
        let known = disparities.filter(|d| d.is_finite());
        let (least, most) = known
            .clone()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(least, most), d| {
                (least.min(d), most.max(d))
            });
        if least > most {
            return None;
        }
        // Strays may stretch the first steps until all others share one: within what is left of them steps are fine.
        let full = Self { least, most };
        let within = full.without(0.01, &full.counts(known.clone()));
        let counts = within.counts(known);
        let (outer, middle) = (within.without(0.01, &counts), within.without(0.1, &counts));
        let beyond = 0.25 * (middle.most - middle.least);
        Some(Self {
            least: outer.least.max(middle.least - beyond),
            most: outer.most.min(middle.most + beyond),
        })
    }

    /// How many values lie in each of its steps; those beyond count in the outermost.
    fn counts(self, values: impl Iterator<Item = f32>) -> [u32; 256] {
        let mut counts = [0; 256];
        values.for_each(|value| counts[(self.share(value) * 255.0) as usize & 255] += 1);
        counts
    }

    /// The part of the span that is left without this share of the values at either end.
    fn without(self, share: f32, counts: &[u32; 256]) -> Self {
        let outermost = (counts.iter().sum::<u32>() as f32 * share) as u32;
        let mut steps = counts.iter().enumerate();
        let low = beyond(&mut steps, outermost);
        let mut steps = counts.iter().enumerate().rev();
        let high = beyond(&mut steps, outermost);
        let value = |step: usize| self.least + (self.most - self.least) * step as f32 / 255.0;
        Self {
            least: value(low),
            most: value((high + 1).min(255)),
        }
    }

    /// The least span with round ends that holds this one: scans of one scene have the same colours, though each has its
    /// own disparities, and their legends are easy to read.
    pub fn rounded(self) -> Self {
        let width = self.most - self.least;
        if width <= 0.0 {
            return self;
        }
        // A tenth of the span, rounded to 1, 2 or 5 times a power of ten.
        let step =
            [1.0, 2.0, 5.0, 10.0].map(|step| step * 10f32.powf((width / 10.0).log10().floor()));
        let step = step
            .into_iter()
            .find(|step| *step >= width / 10.0)
            .unwrap_or(width);
        Self {
            least: (self.least / step).floor() * step,
            most: (self.most / step).ceil() * step,
        }
    }

    /// The least disparity of the span and the greatest.
    pub fn ends(self) -> (f32, f32) {
        (self.least, self.most)
    }

    /// Where a disparity lies in the span, 0 to 1.
    pub fn share(self, disparity: f32) -> f32 {
        let width = self.most - self.least;
        if width > 0.0 {
            ((disparity - self.least) / width).clamp(0.0, 1.0)
        } else {
            0.5
        }
    }
}

/// The first step with which more than `outermost` have been met.
fn beyond<'a>(steps: &mut impl Iterator<Item = (usize, &'a u32)>, outermost: u32) -> usize {
    let mut met = 0;
    steps
        .find(|(_, count)| {
            met += **count;
            met > outermost
        })
        .map_or(0, |(step, _)| step)
}

/// Paints a disparity picture, three bytes a pixel.
pub fn paint(colours: &Colours, span: Option<Span>, disparities: &[f32], out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + 3 * disparities.len(), 0);
    let Some(span) = span else { return };
    for (pixel, d) in out[start..].chunks_exact_mut(3).zip(disparities) {
        if d.is_finite() {
            pixel.copy_from_slice(&colours.of(span.share(*d)));
        }
    }
}

/// Draws the views; keeps what it needs from scan to scan.
#[derive(Debug, Default)]
pub struct Views {
    pub(super) colours: Colours,
    pub(super) strip: Vec<[f32; 2]>,
    /// Of every curve what is drawn of it: its match, or why it has none.
    pub(super) of_curve: Vec<u32>,
    /// Curves to be labelled.
    pub(super) longest: Vec<u32>,
    pub(super) labels: Labels,
}

/// How far a drawn curve may lie off the true one, in pixels.
const TOLERANCE: f32 = 0.35;

/// The fewest of a curve's points, in order, that draw it to within [`TOLERANCE`]: a point is left out as long as one
/// straight line goes past it and all others left out.
pub(super) fn straighten(points: &[Edge], strip: &mut Vec<[f32; 2]>) {
    strip.clear();
    let mut rest = points.iter().map(|edge| [edge.x, edge.y]);
    let Some(mut anchor) = rest.next() else {
        return;
    };
    strip.push(anchor);
    let mut last = anchor;
    let mut sleeve = Sleeve::default();
    for point in rest {
        if !sleeve.admits(sub(point, anchor)) {
            strip.push(last);
            anchor = last;
            sleeve = Sleeve::default();
            sleeve.admits(sub(point, anchor));
        }
        last = point;
    }
    strip.push(last);
}

fn sub(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross(a: [f32; 2], b: [f32; 2]) -> f32 {
    a[0] * b[1] - a[1] * b[0]
}

/// The directions that pass all points admitted so far within the tolerance.
#[derive(Default)]
struct Sleeve {
    /// The outermost directions, when there is a limit.
    sides: Option<[[f32; 2]; 2]>,
    reach: f32,
}

impl Sleeve {
    /// Whether a line to this point passes all before it; if so the sleeve is narrowed to pass it too.
    fn admits(&mut self, to: [f32; 2]) -> bool {
        let square = to[0] * to[0] + to[1] * to[1];
        // A curve that turns back needs a corner.
        if square < self.reach {
            return false;
        }
        let turned_back =
            |[a, b]: [[f32; 2]; 2]| (a[0] + b[0]) * to[0] + (a[1] + b[1]) * to[1] < 0.0;
        if self
            .sides
            .is_some_and(|[a, b]| cross(a, to) < 0.0 || cross(b, to) > 0.0 || turned_back([a, b]))
        {
            return false;
        }
        self.reach = square;
        // The tangents to the circle of the tolerance around the point.
        let along = square - TOLERANCE * TOLERANCE;
        if along > 0.0 {
            let (along, across) = (along.sqrt(), TOLERANCE);
            let a = [
                to[0] * along + to[1] * across,
                to[1] * along - to[0] * across,
            ];
            let b = [
                to[0] * along - to[1] * across,
                to[1] * along + to[0] * across,
            ];
            let sides = self.sides.get_or_insert([a, b]);
            if cross(sides[0], a) > 0.0 {
                sides[0] = a;
            }
            if cross(sides[1], b) < 0.0 {
                sides[1] = b;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The distance of a point to a strip, the slow way.
    fn distance(p: [f32; 2], strip: &[[f32; 2]]) -> f32 {
        let to_segment = |a: [f32; 2], b: [f32; 2]| {
            let (along, to) = (sub(b, a), sub(p, a));
            let square = along[0] * along[0] + along[1] * along[1];
            let t = if square > 0.0 {
                (along[0] * to[0] + along[1] * to[1]) / square
            } else {
                0.0
            };
            let t = t.clamp(0.0, 1.0);
            let off = sub(to, [along[0] * t, along[1] * t]);
            off[0].hypot(off[1])
        };
        let nearest = strip.windows(2).map(|s| to_segment(s[0], s[1]));
        nearest
            .chain(strip.first().map(|&a| to_segment(a, a)))
            .fold(f32::INFINITY, f32::min)
    }

    /// Curves that run straight, bend, turn back and stand still.
    fn curves() -> Vec<Vec<Edge>> {
        let mut state = 1u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut curve = |wobble: f32| {
            let (mut x, mut y, mut angle) = (100.0, 100.0, random() * 6.3);
            let mut point = || {
                angle += (random() - 0.5) * wobble;
                x += angle.cos() * random() * 2.0;
                y += angle.sin() * random() * 2.0;
                Edge {
                    x,
                    y,
                    ..Edge::default()
                }
            };
            (0..200).map(|_| point()).collect()
        };
        (0..200).map(|i| curve(i as f32 / 30.0)).collect()
    }

    #[test]
    fn a_drawn_curve_passes_all_its_points() {
        let mut strip = Vec::new();
        for points in curves() {
            straighten(&points, &mut strip);
            for edge in &points {
                let off = distance([edge.x, edge.y], &strip);
                assert!(off <= TOLERANCE + 1e-3, "{off}");
            }
        }
    }

    #[test]
    fn a_straight_curve_is_drawn_with_two_points() {
        let edges: Vec<_> = (0..99u8)
            .map(|i| Edge {
                x: f32::from(i) / 3.0,
                y: f32::from(i),
                ..Edge::default()
            })
            .collect();
        let mut strip = Vec::new();
        straighten(&edges, &mut strip);
        assert_eq!(strip, [[0.0, 0.0], [98.0 / 3.0, 98.0]]);
        straighten(&[], &mut strip);
        assert!(strip.is_empty());
        straighten(&edges[..1], &mut strip);
        assert_eq!(strip.len(), 2);
    }

    #[test]
    fn colours_go_in_small_steps_from_blue_over_green_to_red_and_none_is_too_dark_to_be_seen() {
        let Colours { steps } = Colours::new();
        let apart = |a: [u8; 3], b: [u8; 3]| -> u32 {
            a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b))).sum()
        };
        assert!(
            steps
                .windows(2)
                .all(|pair| (1..16).contains(&apart(pair[0], pair[1])))
        );
        let strongest = |rgb: [u8; 3]| (0..3).max_by_key(|&part| rgb[part]);
        assert_eq!(
            [0, 128, 255].map(|step| strongest(steps[step])),
            [Some(2), Some(1), Some(0)]
        );
        assert!(
            steps.iter().all(|rgb| rgb.iter().max() >= Some(&150)),
            "{steps:?}"
        );
    }

    #[test]
    fn a_viewer_that_spreads_all_of_turbo_over_the_whole_range_shows_the_same_colours() {
        let [least, most] = Colours::whole_range([10.0, 30.0]);
        for disparity in [10.0, 17.0, 30.0] {
            let viewers = turbo((disparity - least) / (most - least));
            let ours = Colours::new().of((disparity - 10.0) / 20.0);
            let off = viewers.iter().zip(ours).map(|(a, b)| a.abs_diff(b)).max();
            assert!(off <= Some(3), "{disparity}: {viewers:?} {ours:?}");
        }
    }

    #[test]
    fn spans_of_scans_that_differ_a_little_have_the_same_round_ends() {
        let rounded = |least: f32, most: f32| Span { least, most }.rounded().ends();
        assert_eq!(rounded(12.3, 28.9), (12.0, 30.0));
        assert_eq!(rounded(12.9, 28.1), (12.0, 30.0));
        assert_eq!(rounded(-1.26, 2.4), (-1.5, 2.5));
        assert_eq!(rounded(7.0, 7.0), (7.0, 7.0));
    }

    #[test]
    fn the_circle_of_colours_has_no_seam() {
        let Colours { steps } = Colours::circle();
        let apart = |a: [u8; 3], b: [u8; 3]| -> u32 {
            a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b))).sum()
        };
        let step = |i: usize| apart(steps[i], steps[(i + 1) % 256]);
        assert!((0..256).all(|i| (1..20).contains(&step(i))));
        assert!(apart(steps[0], steps[128]) > 100);
    }

    #[test]
    fn a_stray_disparity_does_not_decide_the_colours() {
        let mut disparities: Vec<f32> = (0..1000).map(|i| 10.0 + i as f32 / 100.0).collect();
        disparities.extend([500.0, f32::NAN, f32::INFINITY]);
        let span = Span::of(disparities.iter().copied());
        assert!(
            span.is_some_and(|s| s.least < 11.0 && s.most < 25.0),
            "{span:?}"
        );
        // Nor does one near object of a few points in a hundred, …
        let near = (0..30).map(|_| 90.0);
        let span = Span::of((0..970).map(|i| 10.0 + i as f32 / 97.0).chain(near));
        assert!(span.is_some_and(|s| s.most < 24.0), "{span:?}");
        // … but one of many.
        let near = (0..300).map(|_| 90.0);
        let span = Span::of((0..700).map(|i| 10.0 + i as f32 / 70.0).chain(near));
        assert!(span.is_some_and(|s| s.most > 80.0), "{span:?}");
        assert_eq!(Span::of([f32::NAN].into_iter()), None);
        assert_eq!(
            Span::of([7.0; 4].into_iter()).map(|s| s.share(7.0)),
            Some(0.5)
        );
    }

    #[test]
    fn unknown_pixels_are_black() {
        let mut out = vec![9];
        paint(
            &Colours::new(),
            Span::of([1.0, 2.0].into_iter()),
            &[1.0, f32::NAN, 2.0],
            &mut out,
        );
        assert_eq!(out.len(), 10);
        assert_eq!(out[4..7], [0, 0, 0]);
        assert_ne!(out[1..4], [0, 0, 0]);
        paint(&Colours::new(), None, &[f32::NAN; 2], &mut out);
        assert_eq!(out[10..], [0; 6]);
    }
}
