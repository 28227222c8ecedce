//! The neighbour rule: which zero-crossing comes next along the contour.
//!
//! Every zero-crossing has a direction of travel: a quarter turn from its gradient, so that the bright side stays on
//! the same hand. Two are neighbours when they are within [`REACH`] of each other, their orientations agree, and the
//! way from one to the other goes along their common direction of travel. Of its neighbours ahead and of those behind
//! a zero-crossing prefers the nearest, ways across counting double; two that prefer each other are linked. What then
//! still is an end looks once more, among ends only. Links are thus paths and rings without branches; where a
//! preference is not returned, curves branch or merge.

use std::ops::Range;

use messages::NONE;

/// Zero-crossings further apart than this many pixels are no neighbours. A contour crosses each cell between four
/// pixels once; where a pixel had two crossings and kept one, successive crossings span two cells: √(2² + 1²).
pub(crate) const REACH: f32 = 2.2361;

/// A neighbour may lie this far across the direction of travel, as a share of its way along …
const SLOPE: f32 = 2.0;

/// … plus this many pixels, as well as crossings are placed.
const SLACK: f32 = 0.25;

/// A zero-crossing as the neighbour rule sees it.
#[derive(Clone, Copy, Debug)]
struct Node {
    x: f32,
    y: f32,
    /// Cosine of the orientation.
    cos: f32,
    /// Sine of the orientation.
    sin: f32,
}

/// Ahead and behind, the two ways along a contour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    Ahead,
    Behind,
}

impl Way {
    pub(crate) const BOTH: [Self; 2] = [Self::Ahead, Self::Behind];

    const fn back(self) -> Self {
        match self {
            Self::Ahead => Self::Behind,
            Self::Behind => Self::Ahead,
        }
    }
}

/// A neighbour and what going there costs.
#[derive(Clone, Copy, Debug)]
struct Choice {
    node: u32,
    cost: f32,
}

impl Choice {
    const NOBODY: Self = Self {
        node: NONE,
        cost: f32::INFINITY,
    };

    /// Takes a cheaper offer; of equal ones the first.
    fn offer(&mut self, node: u32, cost: f32) {
        if cost < self.cost {
            *self = Self { node, cost };
        }
    }
}

/// The zero-crossings of a frame and their links.
#[derive(Debug)]
pub(crate) struct Links {
    /// In raster order.
    nodes: Vec<Node>,
    /// Where each row's nodes start, and where the last ends.
    rows: Vec<u32>,
    /// Per node its preferred neighbours, ahead and behind.
    preferred: Vec<[Choice; 2]>,
    /// The same, among ends only.
    preferred_ends: Vec<[Choice; 2]>,
    /// Per node the neighbours it is linked to, ahead and behind, or [`NONE`].
    linked: Vec<[u32; 2]>,
}

impl Links {
    pub(crate) fn new(max: messages::Size) -> Self {
        let pixels = max.pixels();
        Self {
            nodes: Vec::with_capacity(pixels),
            rows: Vec::with_capacity(max.height as usize + 1),
            preferred: Vec::with_capacity(pixels),
            preferred_ends: Vec::with_capacity(pixels),
            linked: Vec::with_capacity(pixels),
        }
    }

    /// Forgets the last frame.
    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.rows.clear();
        self.rows.push(0);
    }

    /// The number of zero-crossings.
    pub(crate) fn len(&self) -> u32 {
        self.nodes.len() as u32
    }

    /// Adds a zero-crossing; they come in raster order.
    pub(crate) fn add(&mut self, x: f32, y: f32, orientation: f32) {
        self.end_rows_before(y as usize);
        let (sin, cos) = orientation.sin_cos();
        self.nodes.push(Node { x, y, cos, sin });
    }

    fn end_rows_before(&mut self, row: usize) {
        while self.rows.len() <= row {
            self.rows.push(self.len());
        }
    }

    /// Links all zero-crossings of an image of this height whose orientations differ by less than the angle of this
    /// cosine.
    pub(crate) fn link(&mut self, height: u32, cos_tolerance: f32) {
        self.end_rows_before(height as usize);
        for choices in [&mut self.preferred, &mut self.preferred_ends] {
            choices.clear();
            choices.resize(self.nodes.len(), [Choice::NOBODY; 2]);
        }
        self.linked.clear();
        self.linked.resize(self.nodes.len(), [NONE; 2]);

        let nodes = &self.nodes;
        let preferred = &mut self.preferred;
        meet(nodes, &self.rows, |i, j| {
            if let Some((way, cost)) =
                neighbours(&nodes[i as usize], &nodes[j as usize], cos_tolerance)
            {
                preferred[i as usize][way as usize].offer(j, cost);
                preferred[j as usize][way.back() as usize].offer(i, cost);
            }
        });
        tie(&self.preferred, &mut self.linked);

        let (linked, preferred) = (&self.linked, &mut self.preferred_ends);
        meet(nodes, &self.rows, |i, j| {
            let (a, b) = (linked[i as usize], linked[j as usize]);
            let open = |way: Way| a[way as usize] == NONE && b[way.back() as usize] == NONE;
            if !open(Way::Ahead) && !open(Way::Behind) {
                return;
            }
            match neighbours(&nodes[i as usize], &nodes[j as usize], cos_tolerance) {
                Some((way, cost)) if open(way) => {
                    preferred[i as usize][way as usize].offer(j, cost);
                    preferred[j as usize][way.back() as usize].offer(i, cost);
                }
                _ => {}
            }
        });
        tie(&self.preferred_ends, &mut self.linked);
    }

    /// The neighbour a node prefers, linked or not, or [`NONE`].
    pub(crate) fn preferred(&self, node: u32, way: Way) -> u32 {
        self.preferred[node as usize][way as usize].node
    }

    /// The neighbour a node is linked to, or [`NONE`].
    pub(crate) fn linked(&self, node: u32, way: Way) -> u32 {
        self.linked[node as usize][way as usize]
    }
}

/// Links the nodes that prefer each other.
fn tie(preferred: &[[Choice; 2]], linked: &mut [[u32; 2]]) {
    for (node, choices) in (0u32..).zip(preferred) {
        let ahead = choices[Way::Ahead as usize].node;
        if ahead != NONE && preferred[ahead as usize][Way::Behind as usize].node == node {
            linked[node as usize][Way::Ahead as usize] = ahead;
            linked[ahead as usize][Way::Behind as usize] = node;
        }
    }
}

/// Calls `pair` once for any two nodes that may be within reach: in one row, or one or two rows apart. In raster order
/// of the first, then the second, which is the lower one or the right one.
fn meet(nodes: &[Node], rows: &[u32], mut pair: impl FnMut(u32, u32)) {
    let row = |y: usize| match rows.get(y..y + 2) {
        Some(ends) => ends[0] as usize..ends[1] as usize,
        None => 0..0,
    };
    for y in 0..rows.len() {
        let (here, mut below, mut far_below) = (row(y), row(y + 1), row(y + 2));
        for i in here.clone() {
            let x = nodes[i].x;
            let mut side = |window: Range<usize>| {
                for j in window {
                    if nodes[j].x > x + REACH {
                        break;
                    }
                    pair(i as u32, j as u32);
                }
            };
            side(i + 1..here.end);
            for window in [&mut below, &mut far_below] {
                while window.start < window.end && nodes[window.start].x < x - REACH {
                    window.start += 1;
                }
                side(window.clone());
            }
        }
    }
}

/// Whether b is a neighbour of a; if so, which way it lies and what it costs, the same seen from either.
fn neighbours(a: &Node, b: &Node, cos_tolerance: f32) -> Option<(Way, f32)> {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let distance2 = dx * dx + dy * dy;
    let cos = a.cos * b.cos + a.sin * b.sin;
    if distance2 > REACH * REACH || cos < cos_tolerance {
        return None;
    }
    // The common direction of travel, not of unit length: the sum of both gradients, a quarter turn on.
    let (tx, ty) = (-(a.sin + b.sin), a.cos + b.cos);
    let norm2 = tx * tx + ty * ty;
    if norm2 == 0.0 {
        return None;
    }
    let along = (dx * tx + dy * ty) / norm2.sqrt();
    let across2 = distance2 - along * along;
    let allowed = SLOPE * along.abs() + SLACK;
    if across2 > allowed * allowed {
        return None;
    }
    let way = if along > 0.0 { Way::Ahead } else { Way::Behind };
    Some((way, distance2 + across2.max(0.0)))
}
