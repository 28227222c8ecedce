//! Raster tracking: zero-crossings become curves.
//!
//! ```text
//! edges ─► thresholds (from the frame itself) ─► links between neighbours ─► curves, hysteresis ─► curves
//! ```
//!
//! The frame is gone through row by row, as a TV raster. Zero-crossings above LOW are linked to their neighbours
//! along the contour; curves are the chains of links, numbered in raster order of their topmost points. A curve
//! stays when some point of it, or of a curve it touches, exceeds HIGH (hysteresis), and when it is long enough. Of
//! several ways on from a point the best continues the curve; the others are curves of their own that begin (or,
//! merging, end) with a copy of the shared point and name their parent. Points are in order along the curve, the
//! bright side always on the same hand.

mod link;
#[cfg(feature = "node")]
pub mod node;
mod settings;
mod threshold;

pub use settings::Settings;
pub use threshold::{HIGH_OVER_LOW, Histogram, MOST_STEP, Thresholds};

use link::{Links, Way};
use messages::{Curve, CurvesRoom, Edge, EdgesView, NONE, Size};

/// What there is to say about a frame besides its curves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tracked {
    /// The thresholds it was tracked with.
    pub thresholds: Thresholds,
    /// Edges that were passed over: not a number, outside the image, or not in raster order with one a pixel at most.
    pub skipped: usize,
}

/// The finest of the usual channels, in square pixels: taken for granted until [`Tracker::set_variance`] says else.
pub const FINE_VARIANCE: f32 = 1.5;

/// A chain of links.
#[derive(Clone, Copy, Debug)]
struct Chain {
    first: u32,
    count: u32,
    /// Another chain of the same group, or itself; chains that touch are one group.
    group: u32,
    /// Whether a point of it (for a group's head: of the group) exceeds HIGH.
    strong: bool,
    label: u32,
}

/// Turns edges into curves; keeps the scratch memory from frame to frame.
#[derive(Debug)]
pub struct Tracker {
    settings: Settings,
    variance: f32,
    links: Links,
    /// Per node of the links its index among the edges.
    edge_of: Vec<u32>,
    /// Per node its chain, or [`NONE`].
    chain_of: Vec<u32>,
    chains: Vec<Chain>,
}

impl Tracker {
    /// A tracker for images up to `max`; memory is taken into use as frames need it.
    pub fn new(settings: &Settings, max: Size) -> Self {
        let pixels = max.pixels();
        Self {
            settings: settings.clone(),
            variance: FINE_VARIANCE,
            links: Links::new(max),
            edge_of: Vec::with_capacity(pixels),
            chain_of: Vec::with_capacity(pixels),
            chains: Vec::with_capacity(pixels),
        }
    }

    /// Says which channel the next edges are of, by its σ² in square pixels: the automatic thresholds depend on it.
    pub fn set_variance(&mut self, variance: f32) {
        self.variance = variance;
    }

    /// Tracks the edges of an image of this size; the room is filled anew.
    pub fn process(
        &mut self,
        edges: EdgesView<'_>,
        size: Size,
        room: &mut CurvesRoom<'_>,
    ) -> Tracked {
        room.curves.clear();
        room.points.clear();
        let mut magnitudes = Histogram::new();
        for edge in edges.edges.iter().filter(|edge| is_sound(edge, size)) {
            magnitudes.add(edge.magnitude);
        }
        let thresholds = Thresholds::new(&self.settings, &magnitudes, self.variance);
        let skipped = self.take(edges.edges, size, thresholds.low);
        self.links.link(
            size.height,
            self.settings.tolerance_degrees.to_radians().cos(),
        );
        self.find_chains(edges.edges, thresholds.high);
        self.group_chains();
        self.number_chains();
        for chain in &self.chains {
            if chain.label != NONE {
                self.publish(chain, edges.edges, room);
            }
        }
        Tracked {
            thresholds,
            skipped,
        }
    }

    /// Takes the edges that reach LOW; gives the number of those passed over.
    fn take(&mut self, edges: &[Edge], size: Size, low: f32) -> usize {
        self.links.clear();
        self.edge_of.clear();
        let (mut skipped, mut next_pixel) = (0, 0);
        for (i, edge) in (0u32..).zip(edges) {
            let pixel = edge.y as usize * size.width as usize + edge.x as usize;
            if !is_sound(edge, size) || pixel < next_pixel {
                skipped += 1;
                continue;
            }
            next_pixel = pixel + 1;
            if edge.magnitude >= low {
                self.links.add(edge.x, edge.y, edge.orientation);
                self.edge_of.push(i);
            }
        }
        skipped
    }

    /// Cuts the links into chains, in raster order of their topmost points; a ring starts at its topmost point.
    fn find_chains(&mut self, edges: &[Edge], high: f32) {
        self.chains.clear();
        self.chain_of.clear();
        self.chain_of.resize(self.links.len() as usize, NONE);
        for topmost in 0..self.links.len() {
            if self.chain_of[topmost as usize] != NONE {
                continue;
            }
            let mut first = topmost;
            loop {
                let behind = self.links.linked(first, Way::Behind);
                if behind == NONE {
                    break;
                }
                first = behind;
                if first == topmost {
                    break;
                }
            }
            let label = self.chains.len() as u32;
            let (mut node, mut count, mut strong) = (first, 0, false);
            while node != NONE && self.chain_of[node as usize] == NONE {
                self.chain_of[node as usize] = label;
                strong |= edges[self.edge_of[node as usize] as usize].magnitude >= high;
                count += 1;
                node = self.links.linked(node, Way::Ahead);
            }
            self.chains.push(Chain {
                first,
                count,
                group: label,
                strong,
                label: NONE,
            });
        }
    }

    /// The node of another chain that a chain's end touches on this way, if any.
    fn touched(&self, end: u32, way: Way) -> Option<u32> {
        let node = self.links.preferred(end, way);
        let free = self.links.linked(end, way) == NONE;
        (free && node != NONE && self.chain_of[node as usize] != self.chain_of[end as usize])
            .then_some(node)
    }

    /// Puts chains that touch into one group, which is strong if one of them is.
    fn group_chains(&mut self) {
        for node in 0..self.links.len() {
            for way in Way::BOTH {
                if let Some(other) = self.touched(node, way) {
                    let a = self.head_of_group(self.chain_of[node as usize]);
                    let b = self.head_of_group(self.chain_of[other as usize]);
                    let (head, member) = (a.min(b), a.max(b));
                    self.chains[head as usize].strong |= self.chains[member as usize].strong;
                    self.chains[member as usize].group = head;
                }
            }
        }
    }

    fn head_of_group(&mut self, mut chain: u32) -> u32 {
        while self.chains[chain as usize].group != chain {
            let above = self.chains[chain as usize].group;
            self.chains[chain as usize].group = self.chains[above as usize].group;
            chain = above;
        }
        chain
    }

    /// Gives labels to the chains that stay.
    fn number_chains(&mut self) {
        let mut labels = 0;
        for chain in 0..self.chains.len() as u32 {
            let head = self.head_of_group(chain);
            let long = self.chains[chain as usize].count as usize >= self.settings.min_points;
            if long && self.chains[head as usize].strong {
                self.chains[chain as usize].label = labels;
                labels += 1;
            }
        }
    }

    fn publish(&self, chain: &Chain, edges: &[Edge], room: &mut CurvesRoom<'_>) {
        let edge = |node: u32| edges[self.edge_of[node as usize] as usize];
        let kept = |&node: &u32| self.chains[self.chain_of[node as usize] as usize].label != NONE;
        let mut last = chain.first;
        for _ in 1..chain.count {
            last = self.links.linked(last, Way::Ahead);
        }
        let before = self.touched(chain.first, Way::Behind).filter(kept);
        let after = if before.is_none() {
            self.touched(last, Way::Ahead).filter(kept)
        } else {
            None
        };
        let parent = before.or(after).map_or(NONE, |node| {
            self.chains[self.chain_of[node as usize] as usize].label
        });

        let first = room.points.len();
        let (mut node, own) = (chain.first, chain.count as usize);
        let (ahead_of_own, behind_own) =
            (usize::from(before.is_some()), usize::from(after.is_some()));
        let slots = room.points.grow(ahead_of_own + own + behind_own);
        for (i, slot) in slots.iter_mut().enumerate() {
            *slot = match (before, after) {
                (Some(shared), _) if i == 0 => edge(shared),
                (_, Some(shared)) if i == own => edge(shared),
                _ => {
                    let current = node;
                    node = self.links.linked(node, Way::Ahead);
                    edge(current)
                }
            };
        }
        if slots.is_empty() {
            return;
        }
        let mut curve = Curve {
            label: chain.label,
            first: first as u32,
            count: slots.len() as u32,
            parent,
            ..Curve::default()
        };
        summarize(&mut curve, slots);
        let curves = room.curves.len();
        room.curves.push(curve);
        if room.curves.len() == curves {
            room.points.truncate(first);
        }
    }
}

/// Fills in what is common to a curve's points.
fn summarize(curve: &mut Curve, points: &[Edge]) {
    let (mut x, mut y, mut magnitude, mut length) = (0.0, 0.0, 0.0, 0.0);
    for point in points {
        x += f64::from(point.x);
        y += f64::from(point.y);
        magnitude += f64::from(point.magnitude);
    }
    for pair in points.windows(2) {
        length += (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y);
    }
    let count = points.len() as f64;
    curve.x = (x / count) as f32;
    curve.y = (y / count) as f32;
    curve.magnitude = (magnitude / count) as f32;
    curve.length = length;
}

/// Whether an edge lies inside the image and is made of numbers.
fn is_sound(edge: &Edge, size: Size) -> bool {
    let inside = |place: f32, len: u32| place >= 0.0 && place <= len as f32 - 1.0;
    inside(edge.x, size.width)
        && inside(edge.y, size.height)
        && edge.orientation.is_finite()
        && (0.0..f32::INFINITY).contains(&edge.magnitude)
}
