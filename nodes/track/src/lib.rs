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
pub use threshold::{HIGH_OVER_LOW, Histogram, LEAST_LOW, MOST_LOW, Thresholds};

use link::{Links, Way};
use messages::{Curve, CurvesRoom, Edge, EdgesView, NONE, Size};

/// The version of the algorithm: one more whenever the same input and settings give other curves.
pub const VERSION: u32 = 1;

/// What there is to say about a frame besides its curves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tracked {
    /// The thresholds it was tracked with.
    pub thresholds: Thresholds,
    /// Edges that were passed over: not a number, outside the image, or not in raster order with one a pixel at most.
    pub skipped: usize,
}

/// Every how many edges one is looked at for the automatic thresholds.
const SAMPLE: usize = 8;

/// Where a node of the links comes from and where it goes.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Its index among the edges.
    edge: u32,
    /// Its chain, or [`NONE`] as yet.
    chain: u32,
    /// Whether it reaches HIGH.
    strong: bool,
}

/// A chain of links.
#[derive(Clone, Copy, Debug)]
struct Chain {
    /// Where its nodes start in the list of all chains' nodes.
    start: u32,
    /// Where they end.
    end: u32,
    /// Another chain of its group, or itself; chains that touch are one group.
    group: u32,
    /// Whether a point of it (for a group's head: of the group) reaches HIGH.
    strong: bool,
    /// The label of its curve, or [`NONE`].
    label: u32,
    /// The nodes of other chains that its two ends would rather go on to, or [`NONE`]: before its start, after its end.
    touches: [u32; 2],
}

/// Turns edges into curves; keeps the scratch memory from frame to frame.
#[derive(Debug)]
pub struct Tracker {
    settings: Settings,
    links: Links,
    /// Per node of the links.
    places: Vec<Place>,
    chains: Vec<Chain>,
    /// The nodes of all chains, each in order along its chain.
    chained: Vec<u32>,
}

impl Tracker {
    /// A tracker for images up to `max`; memory is taken into use as frames need it.
    pub fn new(settings: &Settings, max: Size) -> Self {
        let pixels = max.pixels();
        Self {
            settings: settings.clone(),
            links: Links::new(max),
            places: Vec::with_capacity(pixels),
            chains: Vec::with_capacity(pixels),
            chained: Vec::with_capacity(pixels),
        }
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
        for edge in edges
            .edges
            .iter()
            .step_by(SAMPLE)
            .filter(|edge| is_sound(edge, size))
        {
            magnitudes.add(edge.magnitude);
        }
        let thresholds = Thresholds::new(&self.settings, &magnitudes);
        let skipped = self.take(edges.edges, size, thresholds);
        let tolerance = self.settings.tolerance_degrees.to_radians();
        self.links.link(tolerance.cos());
        self.find_chains();
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
    fn take(&mut self, edges: &[Edge], size: Size, thresholds: Thresholds) -> usize {
        self.links.clear();
        self.places.clear();
        // The first pixel in raster order that the next edge can have.
        let (mut skipped, mut row, mut next_column) = (0, 0, 0);
        for (i, edge) in (0u32..).zip(edges) {
            let (x, y) = (edge.x as u32, edge.y as u32);
            if !is_sound(edge, size) || y < row || (y == row && x < next_column) {
                skipped += 1;
                continue;
            }
            (row, next_column) = (y, x + 1);
            if edge.magnitude >= thresholds.low {
                self.links.add(edge, y);
                self.places.push(Place {
                    edge: i,
                    chain: NONE,
                    strong: edge.magnitude >= thresholds.high,
                });
            }
        }
        skipped
    }

    /// Cuts the links into chains, in raster order of their topmost points; a ring starts at its topmost point.
    fn find_chains(&mut self) {
        self.chains.clear();
        self.chained.clear();
        for topmost in 0..self.links.len() {
            if self.places[topmost as usize].chain != NONE {
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
            let chain = self.chains.len() as u32;
            let start = self.chained.len() as u32;
            let (mut node, mut strong) = (first, false);
            while node != NONE && self.places[node as usize].chain == NONE {
                let place = &mut self.places[node as usize];
                place.chain = chain;
                strong |= place.strong;
                self.chained.push(node);
                node = self.links.linked(node, Way::Ahead);
            }
            let end = self.chained.len() as u32;
            self.chains.push(Chain {
                start,
                end,
                group: chain,
                strong,
                label: NONE,
                touches: [NONE; 2],
            });
        }
    }

    fn nodes_of(&self, chain: &Chain) -> &[u32] {
        &self.chained[chain.start as usize..chain.end as usize]
    }

    /// Finds where chains touch and puts those into one group, which is strong if one of them is.
    fn group_chains(&mut self) {
        for chain in 0..self.chains.len() {
            let nodes = self.nodes_of(&self.chains[chain]);
            let ends = [
                (nodes[0], Way::Behind),
                (nodes[nodes.len() - 1], Way::Ahead),
            ];
            for (side, (end, way)) in ends.into_iter().enumerate() {
                let node = self.links.preferred(end, way);
                if node == NONE || self.links.linked(end, way) != NONE {
                    continue;
                }
                let other = self.places[node as usize].chain;
                if other as usize != chain {
                    self.chains[chain].touches[side] = node;
                    self.join_groups(chain as u32, other);
                }
            }
        }
    }

    fn join_groups(&mut self, a: u32, b: u32) {
        let (a, b) = (self.head_of_group(a), self.head_of_group(b));
        let (head, member) = (a.min(b), a.max(b));
        self.chains[head as usize].strong |= self.chains[member as usize].strong;
        self.chains[member as usize].group = head;
    }

    fn head_of_group(&mut self, mut chain: u32) -> u32 {
        while self.chains[chain as usize].group != chain {
            let above = self.chains[chain as usize].group;
            self.chains[chain as usize].group = self.chains[above as usize].group;
            chain = above;
        }
        chain
    }

    /// Gives labels to the chains that stay: long enough, in a group that is strong.
    fn number_chains(&mut self) {
        let mut labels = 0;
        for chain in 0..self.chains.len() as u32 {
            let head = self.head_of_group(chain);
            let Chain { start, end, .. } = self.chains[chain as usize];
            let is_long = (end - start) as usize >= self.settings.min_points;
            if is_long && self.chains[head as usize].strong {
                self.chains[chain as usize].label = labels;
                labels += 1;
            }
        }
    }

    /// Writes a chain's curve: its points and, at one end, a copy of the point where it touches its parent.
    fn publish(&self, chain: &Chain, edges: &[Edge], room: &mut CurvesRoom<'_>) {
        let edge = |node: u32| edges[self.places[node as usize].edge as usize];
        let label_of = |node: u32| match node {
            NONE => NONE,
            node => self.chains[self.places[node as usize].chain as usize].label,
        };
        let parents = chain.touches.map(label_of);
        let before = parents[0] != NONE;
        let after = !before && parents[1] != NONE;

        let nodes = self.nodes_of(chain);
        let first = room.points.len();
        let slots = room.points.grow(nodes.len() + usize::from(before || after));
        let count = slots.len();
        if count == 0 {
            return;
        }
        let (shared, own) = slots.split_at_mut(usize::from(before));
        for (slot, &node) in own.iter_mut().zip(nodes) {
            *slot = edge(node);
        }
        if let [slot] = shared {
            *slot = edge(chain.touches[0]);
        }
        if let (true, Some(slot)) = (after, own.get_mut(nodes.len())) {
            *slot = edge(chain.touches[1]);
        }
        let mut curve = Curve {
            label: chain.label,
            first: first as u32,
            count: count as u32,
            parent: if before { parents[0] } else { parents[1] },
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
        let (dx, dy) = (pair[1].x - pair[0].x, pair[1].y - pair[0].y);
        length += f64::from(dx * dx + dy * dy).sqrt();
    }
    let count = points.len() as f64;
    curve.x = (x / count) as f32;
    curve.y = (y / count) as f32;
    curve.magnitude = (magnitude / count) as f32;
    curve.length = length as f32;
}

/// Whether an edge lies inside the image and is made of numbers. All is looked at before anything is decided: damage is
/// rare, and one branch is less than seven.
fn is_sound(edge: &Edge, size: Size) -> bool {
    let inside = |place: f32, len: u32| (place >= 0.0) & (place <= len as f32 - 1.0);
    inside(edge.x, size.width)
        & inside(edge.y, size.height)
        & (edge.orientation.abs() <= std::f32::consts::PI)
        & (edge.magnitude >= 0.0)
        & (edge.magnitude < f32::INFINITY)
}
