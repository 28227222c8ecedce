//! Whether views can be stereo at all, and by how much their rows are off: a look that costs a fraction of a second.
//!
//! ```text
//! views ─► halved to some hundred pixels ─► corners ─► each sought in the next view, coarsely: like, and like nothing else
//!                                                        └─► placed between pixels ─► rows, disparities ─► findings
//! ```
//!
//! What [`alignment`](crate::alignment) measures thoroughly of points on curves is measured here of so few points that a run
//! can afford it before its first scan. A finding is something that nothing else explains: where little is seen, because
//! there is little to see or noise covers it, nothing is found.

use messages::Size;
use serde::Serialize;

use crate::alignment::{Followed, Ready, quantile, rows};

/// The longest side of what is looked at, in pixels: what is larger is halved.
const LONGEST: u32 = 1000;
/// Corners that are sought in a view, about.
const CORNERS: f64 = 240.0;
/// So many times as many are sought where those do not tell.
const EVERYWHERE: f64 = 6.0;
/// Pairs of views that get as many; of more views each pair gets fewer.
const PAIRS: usize = 3;
/// The least correlation of what is taken for the same on the coarsest level …
const LIKE: f64 = 0.8;
/// … and what it may leave unexplained of what the next best place leaves: where patterns repeat nothing is said.
const UNIQUE: f64 = 0.7;
/// Corners from which on anything is said of two views.
const ENOUGH: usize = 30;
/// Rows of the coarsest level by which neighbours may differ to agree.
const NEAR_ROWS: f64 = 1.5;
/// The least correlation of a place that is as like as the best one to be taken for a repetition of it.
const REPEATED: f64 = 0.9;
/// Points that two views must have in common at least to show the same.
const COMMON: usize = 10;
/// Where so small a share of the corners that were sought is found, of at least so many, two views show nothing in common.
const STRANGE: f64 = 0.15;
const SOUGHT: usize = 60;
/// Rows and columns from which on views are said to show nothing in common.
const LEAST_SIDE: u32 = 96;
/// Gray levels between nearly the darkest and nearly the brightest pixel of a view of which nothing can be seen.
const FLAT: u8 = 2;
/// Pixels up to which nothing has moved.
const STILL_PX: f64 = 0.4;
/// Pixels that nearly all points must have moved by for their direction to be sure.
const MOVED_PX: f64 = 0.75;
/// Rows from which on they are said to be off.
pub const SAID_PX: f64 = 0.3;
/// Root mean square of what rows must be off besides, so that it is not only the borders of a picture.
const ALL_OVER_PX: f64 = 0.2;
/// Rows from which on views cannot be matched.
pub const REFUSED_PX: f64 = 1.0;
/// Standard errors by which rows must be off to be believed.
const SURE: f64 = 3.0;

/// What was measured from one view to another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Between {
    /// The two views, counted from 0 as they were given.
    pub views: [usize; 2],
    /// Corners that were sought, without those of patterns that repeat.
    pub sought: usize,
    /// Those that were found, in rows that agree with the others'.
    pub found: usize,
    /// Those that were placed between pixels.
    pub placed: usize,
    /// Disparities below which a tenth, half and nine tenths of them lie, in pixels: positive where the second view is
    /// farther to the right.
    pub disparities_px: Option<[f64; 3]>,
    /// By how much rows are off, where enough points tell.
    pub rows: Option<Rows>,
}

/// By how much rows of two views are off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rows {
    /// Nearly the most that the rows of the picture are off (95th percentile), in pixels.
    pub off_px: f64,
    /// The root mean square.
    pub rms_px: f64,
    /// Rows by which the middle of the second view is lower.
    pub offset_px: f64,
    /// By how much it is turned, in degrees.
    pub turn_degrees: f64,
    /// By how much it is larger, in hundredths.
    pub scale_percent: f64,
    /// One standard error of all that, in pixels.
    pub unsure_px: f64,
}

/// What makes views no stereo, or less than they could be.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Finding {
    /// A view of one gray level.
    Constant {
        /// The view.
        view: usize,
    },
    /// Views that are the same to the byte.
    Identical {
        /// The views.
        views: Vec<usize>,
    },
    /// A view that shows something else than all the others.
    Odd {
        /// The view.
        view: usize,
    },
    /// Two neighbours that show nothing in common.
    Apart {
        /// The views.
        views: [usize; 2],
    },
    /// Two neighbours between which nothing moves.
    Still {
        /// The views.
        views: [usize; 2],
        /// The most that anything moves, in pixels.
        most_px: f64,
    },
    /// Views that do not go from left to right.
    Order {
        /// How they go from left to right.
        order: Vec<usize>,
    },
    /// Rows that are off.
    Rows {
        /// The views.
        views: [usize; 2],
        /// By how much.
        rows: Rows,
    },
}

/// What a look at the views of one scan tells.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Look {
    /// Between neighbours, and those that were looked at besides.
    pub pairs: Vec<Between>,
    /// What was found, the worst first.
    pub findings: Vec<Finding>,
}

impl Finding {
    /// Whether nothing right can come of such views.
    pub fn is_grave(&self) -> bool {
        match self {
            Self::Rows { rows, .. } => rows.off_px > REFUSED_PX,
            _ => true,
        }
    }

    /// Whether it is of rows that are off.
    pub fn is_of_rows(&self) -> bool {
        matches!(self, Self::Rows { .. })
    }

    /// What is wrong, of views with these names.
    pub fn says(&self, names: &[String]) -> String {
        let name = |view: usize| names.get(view).map_or("?", String::as_str);
        let list = |views: &[usize]| {
            let names: Vec<&str> = views.iter().map(|&view| name(view)).collect();
            names.join(", ")
        };
        match self {
            Self::Constant { view } => {
                format!("{} is of one gray level: it shows nothing", name(*view))
            }
            Self::Identical { views } => format!(
                "{} are one and the same image to the byte: give what different cameras took at one time",
                list(views)
            ),
            Self::Odd { view } => format!(
                "{} shows something else than the other views: is it of another place or time?",
                name(*view)
            ),
            Self::Apart { views: [a, b] } => format!(
                "{} and {} show nothing in common: views of one scene, taken at one time, are needed, turned by less than some degrees",
                name(*a),
                name(*b)
            ),
            Self::Still {
                views: [a, b],
                most_px,
            } => format!(
                "nothing moves between {} and {} (at most {most_px:.1} px): the camera stood still, or one image was given twice",
                name(*a),
                name(*b)
            ),
            Self::Order { order } => {
                let is_reversed = order.windows(2).all(|pair| pair[0] > pair[1]);
                let what = match is_reversed {
                    true => "the views go from right to left",
                    false => "the views are not in order from left to right",
                };
                format!("{what}: from left to right they are {}", list(order))
            }
            Self::Rows {
                views: [a, b],
                rows,
            } => {
                let Rows {
                    off_px,
                    offset_px,
                    turn_degrees,
                    scale_percent,
                    ..
                } = rows;
                format!(
                    "rows of {} and {} are off by {off_px:.1} px (shifted {offset_px:+.2} px, turned {turn_degrees:+.2}°, scaled {scale_percent:+.2} %)",
                    name(*a),
                    name(*b)
                )
            }
        }
    }
}

/// By how many columns and rows a point (column, row) of a view lies off on purpose, which is made good later.
pub type Off<'a> = dyn Fn(usize, [f64; 2]) -> [f64; 2] + Sync + 'a;

/// Looks at the views of a scan, which are all of one size, left to right.
///
/// # Panics
/// When a view has not as many pixels as the size says.
pub fn look(views: &[&[u8]], size: Size) -> Look {
    look_but(views, size, &|_, _| [0.0; 2])
}

/// Looks at views of which it is known by how much each is off.
///
/// # Panics
/// As [`look`].
pub fn look_but(views: &[&[u8]], size: Size, off: &Off<'_>) -> Look {
    let mut findings: Vec<Finding> = (0..views.len())
        .filter(|&view| is_flat(views[view]))
        .map(|view| Finding::Constant { view })
        .collect();
    findings.extend(identical(views, &findings));
    if !findings.is_empty() {
        let pairs = Vec::new();
        return Look { pairs, findings };
    }
    let sight = Sight::new(views, size, off);
    let look = sight.look(false);
    // What recurs in its own view is like many places of another one, mostly wrong ones.
    match look.findings.is_empty() {
        true => look,
        false => sight.look(true),
    }
}

/// By how much rows are off.
fn worst(finding: &Finding) -> f64 {
    match finding {
        Finding::Rows { rows, .. } => rows.off_px,
        _ => 0.0,
    }
}

/// Whether a view is of one gray level.
fn is_flat(pixels: &[u8]) -> bool {
    let mut counts = [0usize; 256];
    pixels
        .iter()
        .for_each(|&pixel| counts[usize::from(pixel)] += 1);
    let few = pixels.len() / 200;
    let is_passed = |passed: &mut usize, level: usize| {
        *passed += counts[level];
        Some((level, *passed > few))
    };
    let mut darker = (0..256).scan(0, is_passed);
    let mut brighter = (0..256).rev().scan(0, is_passed);
    let darkest = darker.find(|(_, is_enough)| *is_enough);
    let brightest = brighter.find(|(_, is_enough)| *is_enough);
    match (darkest, brightest) {
        (Some((darkest, _)), Some((brightest, _))) => brightest - darkest <= usize::from(FLAT),
        _ => true,
    }
}

/// Views that are the same to the byte, of those that show anything.
fn identical(views: &[&[u8]], flat: &[Finding]) -> Vec<Finding> {
    let is_flat = |view: usize| flat.contains(&Finding::Constant { view });
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for view in (0..views.len()).filter(|&view| !is_flat(view)) {
        match groups
            .iter_mut()
            .find(|group| views[group[0]] == views[view])
        {
            Some(group) => group.push(view),
            None => groups.push(vec![view]),
        }
    }
    let alike = groups.into_iter().filter(|group| group.len() > 1);
    alike.map(|views| Finding::Identical { views }).collect()
}

/// Views made ready.
struct Sight<'a> {
    off: &'a Off<'a>,
    ready: Vec<Ready>,
    size: Size,
    /// Pixels of the image to one of these.
    scale: f64,
    corners: f64,
}

impl<'a> Sight<'a> {
    fn new(views: &[&[u8]], size: Size, off: &'a Off<'a>) -> Self {
        let mut halvings = 0;
        while (size.width >> halvings).max(size.height >> halvings) > LONGEST {
            halvings += 1;
        }
        let made = on_all_cores(views, |pixels| {
            let (mut pixels, mut size) = (pixels.to_vec(), size);
            for _ in 0..halvings {
                (pixels, size) = halved(&pixels, size);
            }
            (Ready::new(&pixels, size), size)
        });
        let pairs = views.len().saturating_sub(1).max(1);
        Self {
            off,
            size: made.first().map_or(size, |(_, size)| *size),
            ready: made.into_iter().map(|(ready, _)| ready).collect(),
            scale: f64::from(1u32 << halvings),
            corners: CORNERS * (PAIRS as f64 / pairs as f64).min(1.0),
        }
    }

    /// Looks at all; strictly, without what recurs in its own view.
    fn look(&self, strictly: bool) -> Look {
        let count = self.ready.len();
        let mut pairs = self.between((1..count).map(|view| [view - 1, view]), strictly);
        let is_apart = |between: &Between| between.in_common() == Some(false);
        // Whether a view is the odd one its neighbours tell.
        let around: Vec<[usize; 2]> = (1..count.saturating_sub(1))
            .filter(|&view| is_apart(&pairs[view - 1]) || is_apart(&pairs[view]))
            .map(|view| [view - 1, view + 1])
            .collect();
        pairs.extend(self.between(around.into_iter(), strictly));
        // What is a strip of few rows or columns is found in too few places to say that.
        let is_strip = self.size.width.min(self.size.height) < LEAST_SIDE;
        let mut findings = match is_strip {
            true => Vec::new(),
            false => strangers(&pairs, count),
        };
        let neighbours = || {
            pairs
                .iter()
                .filter(|pair| pair.views[1] == pair.views[0] + 1)
        };
        findings.extend(neighbours().filter_map(Between::still));
        findings.extend(order(&pairs, count));
        let mut off: Vec<Finding> = neighbours().filter_map(Between::rows_off).collect();
        off.sort_by(|a, b| worst(b).total_cmp(&worst(a)));
        findings.extend(off);
        Look { pairs, findings }
    }

    fn between(&self, pairs: impl Iterator<Item = [usize; 2]>, strictly: bool) -> Vec<Between> {
        let pairs: Vec<[usize; 2]> = pairs.collect();
        on_all_cores(&pairs, |&views| self.pair(views, strictly))
    }

    fn pair(&self, views: [usize; 2], strictly: bool) -> Between {
        let found = self.pair_of(views, strictly, self.corners);
        // Where there is little to see it is sought everywhere; what that does not tell either stays as it was found.
        let is_told = found.rows.is_some();
        let more = (!is_told).then(|| self.pair_of(views, strictly, EVERYWHERE * self.corners));
        more.filter(|more| more.rows.is_some()).unwrap_or(found)
    }

    fn pair_of(&self, views: [usize; 2], strictly: bool, corners: f64) -> Between {
        let [from, to] = views.map(|view| &self.ready[view]);
        let cell = (self.size.pixels() as f64 / corners).sqrt().max(12.0);
        let mut corners = from.corners(cell as usize);
        let all = corners.len();
        if strictly {
            let recurs = |&at: &[f64; 2]| {
                let itself = from.roughly(from, at);
                itself.is_some_and(|itself| itself.second > REPEATED)
            };
            corners.retain(|at| !recurs(at));
        }
        // Each that recurs discredits another.
        let recurring = 2 * (all - corners.len());
        let mut repeated = 0;
        let mut seen = Vec::new();
        for &at in &corners {
            let Some(there) = from.roughly(to, at).filter(|there| there.like > LIKE) else {
                continue;
            };
            match 1.0 - there.like < UNIQUE * (1.0 - there.second) {
                true => seen.push((at, there.by)),
                false => repeated += usize::from(there.second > REPEATED),
            }
        }
        let middle = [self.size.width, self.size.height].map(|side| (f64::from(side) - 1.0) / 2.0);
        let seen = agreeing(&seen, middle);
        let mut disparities = Vec::new();
        let mut followed = Vec::new();
        for &(at, by) in &seen {
            let Some([right, down]) = from.placed(to, at, by) else {
                continue;
            };
            let whole = at.map(|v| v * self.scale);
            let moved = [right, down].map(|v| v * self.scale);
            let there = [whole[0] + moved[0], whole[1] + moved[1]];
            let (own, other) = ((self.off)(views[0], whole), (self.off)(views[1], there));
            disparities.push(-(moved[0] - (other[0] - own[0])));
            followed.push(Followed {
                from_middle: [0, 1].map(|axis| (at[axis] - middle[axis]) * self.scale),
                rows: moved[1] - (other[1] - own[1]),
            });
        }
        let quantiles = [0.1, 0.5, 0.9].map(|part| quantile(&disparities, part));
        Between {
            views,
            sought: all.saturating_sub(repeated + recurring),
            found: seen.len(),
            placed: followed.len(),
            disparities_px: (followed.len() >= ENOUGH).then_some(quantiles),
            rows: Rows::of(&followed),
        }
    }
}

/// Of points and the columns and rows by which each lies further, those whose rows follow a common trend.
fn agreeing(seen: &[([f64; 2], [i32; 2])], middle: [f64; 2]) -> Vec<([f64; 2], [i32; 2])> {
    let followed: Vec<Followed> = seen
        .iter()
        .map(|(at, by)| Followed {
            from_middle: [0, 1].map(|axis| at[axis] - middle[axis]),
            rows: f64::from(by[1]),
        })
        .collect();
    let trend = rows(&followed);
    let agrees = |followed: &Followed| {
        let [column, row] = followed.from_middle;
        trend.is_some_and(|trend| {
            let expected = trend.offset_px + trend.per_column * column + trend.per_row * row;
            (followed.rows - expected).abs() <= NEAR_ROWS
        })
    };
    let pairs = seen.iter().zip(&followed);
    pairs
        .filter(|(_, followed)| agrees(followed))
        .map(|(seen, _)| *seen)
        .collect()
}

impl Rows {
    fn of(followed: &[Followed]) -> Option<Self> {
        if followed.len() < ENOUGH {
            return None;
        }
        let found = rows(followed)?;
        let trend = |point: &Followed| {
            let [column, row] = point.from_middle;
            found.offset_px + found.per_column * column + found.per_row * row
        };
        let off: Vec<f64> = followed.iter().map(|point| trend(point).abs()).collect();
        let mean_square = off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64;
        let rest: Vec<f64> = followed
            .iter()
            .map(|point| (point.rows - trend(point)).abs())
            .collect();
        // Three unknowns, at the picture's border: twice the error of a mean.
        let unsure_px = 2.0 * 1.4826 * quantile(&rest, 0.5) / (found.points as f64).sqrt();
        Some(Self {
            // What no trend explains counts too: lenses that distort bend rows.
            off_px: quantile(&off, 0.95).max(found.median_px),
            rms_px: mean_square.sqrt().max(found.median_px),
            offset_px: found.offset_px,
            turn_degrees: found.per_column.to_degrees(),
            scale_percent: found.per_row * 100.0,
            unsure_px,
        })
    }
}

impl Between {
    /// Whether both views show the same; `None` where that cannot be told.
    pub fn in_common(&self) -> Option<bool> {
        if self.placed >= COMMON || self.found >= ENOUGH {
            return Some(true);
        }
        let is_strange = self.found.max(self.placed) as f64 <= STRANGE * self.sought as f64;
        (self.sought >= SOUGHT && is_strange).then_some(false)
    }

    fn still(&self) -> Option<Finding> {
        let [least, _, most] = self.disparities_px?;
        let most_px = least.abs().max(most.abs());
        let rows = self.rows.map_or(0.0, |rows| rows.off_px);
        (most_px.max(rows) < STILL_PX).then_some(Finding::Still {
            views: self.views,
            most_px,
        })
    }

    /// How far the second view is to the right, as its points say; `None` where they do not agree on the side.
    fn moved(&self) -> Option<f64> {
        let [least, middle, most] = self.disparities_px?;
        (least > MOVED_PX || most < -MOVED_PX).then_some(middle)
    }

    fn rows_off(&self) -> Option<Finding> {
        let rows = self.rows?;
        let is_sure = rows.off_px > SAID_PX + SURE * rows.unsure_px && rows.rms_px > ALL_OVER_PX;
        is_sure.then_some(Finding::Rows {
            views: self.views,
            rows,
        })
    }
}

/// Views that show something else than their neighbours.
fn strangers(pairs: &[Between], count: usize) -> Vec<Finding> {
    let between = |a: usize, b: usize| {
        let pair = pairs.iter().find(|pair| pair.views == [a, b])?;
        pair.in_common()
    };
    let apart: Vec<usize> = (1..count)
        .filter(|&view| between(view - 1, view) == Some(false))
        .collect();
    let mut found = Vec::new();
    let mut view = 0;
    while view < apart.len() {
        let second = apart[view];
        let is_inner = second + 1 < count && between(second - 1, second + 1) == Some(true);
        let is_first = second == 1 && count > 2 && between(1, 2) == Some(true);
        let is_last =
            second + 1 == count && count > 2 && between(second - 2, second - 1) == Some(true);
        found.push(match () {
            () if is_inner => Finding::Odd { view: second },
            () if is_first => Finding::Odd { view: 0 },
            () if is_last => Finding::Odd { view: second },
            () => Finding::Apart {
                views: [second - 1, second],
            },
        });
        // What makes a view odd parts it from the next one too.
        view += 1 + usize::from(is_inner && apart.get(view + 1) == Some(&(second + 1)));
    }
    found
}

/// How views go from left to right, where they do otherwise than they were given.
fn order(pairs: &[Between], count: usize) -> Option<Finding> {
    let mut places = vec![0.0];
    for view in 1..count {
        let pair = pairs.iter().find(|pair| pair.views == [view - 1, view])?;
        places.push(places[view - 1] + pair.moved()?);
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| places[a].total_cmp(&places[b]));
    (!order.is_sorted()).then_some(Finding::Order { order })
}

/// Half as wide and high: the mean of every four pixels.
fn halved(pixels: &[u8], size: Size) -> (Vec<u8>, Size) {
    let width = size.width as usize;
    let half = Size::new(size.width / 2, size.height / 2);
    let mut out = Vec::with_capacity(half.pixels());
    for rows in pixels.chunks_exact(2 * width) {
        let (above, below) = rows.split_at(width);
        let pairs = above
            .as_chunks::<2>()
            .0
            .iter()
            .zip(below.as_chunks::<2>().0);
        out.extend(pairs.map(|([a, b], [c, d])| {
            let sum = [a, b, c, d].map(|&v| u16::from(v)).iter().sum::<u16>();
            ((sum + 2) / 4) as u8
        }));
    }
    (out, half)
}

/// Does something with each, on all cores; results come in order.
fn on_all_cores<T: Sync, R: Send>(all: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let part = all.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let workers: Vec<_> = all
            .chunks(part)
            .map(|part| scope.spawn(|| part.iter().map(&work).collect::<Vec<R>>()))
            .collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined
            .flat_map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}
