//! The neighbour rule: which zero-crossing comes next along the contour.
//!
//! Every zero-crossing has a direction of travel: a quarter turn from its gradient, so that the bright side stays on
//! the same hand. Two zero-crossings are neighbours when they lie within [`REACH`] of each other, their orientations
//! agree, and the way from one to the other follows their common direction of travel. Of its neighbours ahead and
//! behind each zero-crossing prefers the nearest along the straightest way; two that prefer each other are linked.
//! Links are thus paths and rings without branches; where a preference is not returned, curves branch or merge.

use messages::NONE;

/// Zero-crossings further apart than this many pixels are no neighbours. Crossings of one contour with the pixel
/// grid are at most 1.5 pixels apart, and a little more where a pixel has two crossings and keeps one.
pub(crate) const REACH: f32 = 2.0;

/// How much more a pixel across the direction of travel costs than one along it.
const ACROSS: f32 = 1.0;

/// A neighbour may lie this far across, as a share of its way along …
const SLOPE: f32 = 1.2;

/// … plus this many pixels, which is how well crossings are placed.
const SLACK: f32 = 0.25;

/// A zero-crossing as the neighbour rule sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Column.
    pub(crate) x: f32,
    /// Row.
    pub(crate) y: f32,
    /// Cosine of the orientation.
    pub(crate) cos: f32,
    /// Sine of the orientation.
    pub(crate) sin: f32,
    /// Its cell of the map.
    pub(crate) cell: u32,
    /// Index among the edges of the message.
    pub(crate) edge: u32,
}

/// A neighbour and what going there costs.
#[derive(Clone, Copy, Debug)]
struct Choice {
    node: u32,
    cost: f32,
}

impl Choice {
    const NOBODY: Self = Self { node: NONE, cost: f32::INFINITY };

    fn offer(&mut self, node: u32, cost: f32) {
        if cost < self.cost {
            *self = Self { node, cost };
        }
    }
}

/// Ahead and behind, the two ways along a contour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    Ahead,
    Behind,
}

impl Way {
    pub(crate) const BOTH: [Self; 2] = [Self::Ahead, Self::Behind];

    pub(crate) fn back(self) -> Self {
        match self {
            Self::Ahead => Self::Behind,
            Self::Behind => Self::Ahead,
        }
    }
}

/// The zero-crossings of a frame, the map that finds them by pixel, and their links.
#[derive(Debug)]
pub(crate) struct Links {
    pub(crate) nodes: Vec<Node>,
    /// Per cell one more than the node there, or 0; all 0 between frames.
    map: Vec<u32>,
    stride: usize,
    /// Per node its preferred neighbours, ahead and behind.
    preferred: Vec<[Choice; 2]>,
    /// Per node its linked neighbours, ahead and behind.
    linked: Vec<[u32; 2]>,
}

/// Cells beside the last column, and rows below the last, that stay empty so that no search leaves the map.
const MARGIN: usize = 2;

fn cells(size: messages::Size) -> usize {
    (size.width as usize + MARGIN) * (size.height as usize + MARGIN) + 2 * MARGIN
}

impl Links {
    pub(crate) fn new(max: messages::Size) -> Self {
        let pixels = max.pixels();
        Self {
            nodes: Vec::with_capacity(pixels),
            map: vec![0; cells(max)],
            stride: 0,
            preferred: Vec::with_capacity(pixels),
            linked: Vec::with_capacity(pixels),
        }
    }

    /// Forgets the last frame.
    pub(crate) fn clear(&mut self, size: messages::Size) {
        for node in &self.nodes {
            self.map[node.cell as usize] = 0;
        }
        self.nodes.clear();
        self.preferred.clear();
        self.linked.clear();
        self.stride = size.width as usize + MARGIN;
        if self.map.len() < cells(size) {
            self.map.resize(cells(size), 0);
        }
    }

    /// Adds a zero-crossing inside the image; false when its pixel has one already.
    pub(crate) fn add(&mut self, x: f32, y: f32, orientation: f32, edge: u32) -> bool {
        let cell = y as usize * self.stride + x as usize + MARGIN;
        if self.map[cell] != 0 {
            return false;
        }
        let (sin, cos) = orientation.sin_cos();
        self.nodes.push(Node { x, y, cos, sin, cell: cell as u32, edge });
        self.map[cell] = self.nodes.len() as u32;
        true
    }

    /// Links all zero-crossings whose orientations differ by less than the angle of this cosine.
    pub(crate) fn link(&mut self, cos_tolerance: f32) {
        self.preferred.resize(self.nodes.len(), [Choice::NOBODY; 2]);
        self.linked.resize(self.nodes.len(), [NONE; 2]);
        self.prefer(cos_tolerance);
        for node in 0..self.nodes.len() as u32 {
            let ahead = self.preferred(node, Way::Ahead);
            if ahead != NONE && self.preferred(ahead, Way::Behind) == node {
                self.tie(node, ahead);
            }
        }
        // Ends whose preference was not returned look once more, among ends only.
        for node in 0..self.nodes.len() as u32 {
            if self.linked(node, Way::Ahead) == NONE {
                let ahead = self.nearest_end(node, Way::Ahead, cos_tolerance);
                if ahead != NONE && self.nearest_end(ahead, Way::Behind, cos_tolerance) == node {
                    self.tie(node, ahead);
                }
            }
        }
    }

    /// The neighbour a node prefers, linked or not, or [`NONE`].
    pub(crate) fn preferred(&self, node: u32, way: Way) -> u32 {
        self.preferred[node as usize][way as usize].node
    }

    /// The neighbour a node is linked to, or [`NONE`].
    pub(crate) fn linked(&self, node: u32, way: Way) -> u32 {
        self.linked[node as usize][way as usize]
    }

    fn tie(&mut self, behind: u32, ahead: u32) {
        self.linked[behind as usize][Way::Ahead as usize] = ahead;
        self.linked[ahead as usize][Way::Behind as usize] = behind;
    }

    /// Finds every node's preferred neighbours; each pair is met once, from its upper left node.
    fn prefer(&mut self, cos_tolerance: f32) {
        for (i, a) in (0u32..).zip(&self.nodes) {
            let cell = a.cell as usize;
            let right = &self.map[cell + 1..][..2];
            let below = &self.map[cell + self.stride - 2..][..5];
            let far_below = &self.map[cell + 2 * self.stride - 2..][..5];
            for &entry in right.iter().chain(below).chain(far_below) {
                if entry == 0 {
                    continue;
                }
                let j = entry - 1;
                let Some((way, cost)) = neighbours(a, &self.nodes[j as usize], cos_tolerance) else {
                    continue;
                };
                self.preferred[i as usize][way as usize].offer(j, cost);
                self.preferred[j as usize][way.back() as usize].offer(i, cost);
            }
        }
    }

    /// The cheapest neighbour of a node that is an end itself, on the side where it is one.
    fn nearest_end(&self, node: u32, way: Way, cos_tolerance: f32) -> u32 {
        let a = &self.nodes[node as usize];
        let cell = a.cell as usize;
        let mut best = Choice::NOBODY;
        for row in 0..5 {
            // Rows above the first wrap to cells that do not exist.
            let Some(start) = (cell + row * self.stride).checked_sub(2 * self.stride + 2) else {
                continue;
            };
            for &entry in &self.map[start..][..5] {
                if entry == 0 || entry - 1 == node || self.linked(entry - 1, way.back()) != NONE {
                    continue;
                }
                match neighbours(a, &self.nodes[entry as usize - 1], cos_tolerance) {
                    Some((found, cost)) if found == way => best.offer(entry - 1, cost),
                    _ => {}
                }
            }
        }
        best.node
    }
}

/// Whether b is a neighbour of a, which way it lies from a, and the cost, the same from either.
fn neighbours(a: &Node, b: &Node, cos_tolerance: f32) -> Option<(Way, f32)> {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let distance2 = dx * dx + dy * dy;
    if distance2 > REACH * REACH || a.cos * b.cos + a.sin * b.sin < cos_tolerance {
        return None;
    }
    // The common direction of travel: the sum of both gradients, a quarter turn on.
    let (tx, ty) = (-(a.sin + b.sin), a.cos + b.cos);
    let norm2 = tx * tx + ty * ty;
    if norm2 == 0.0 {
        return None;
    }
    let along = (dx * tx + dy * ty) / norm2.sqrt();
    let across2 = (distance2 - along * along).max(0.0);
    let allowed = SLOPE * along.abs() + SLACK;
    if across2 > allowed * allowed {
        return None;
    }
    let way = if along > 0.0 { Way::Ahead } else { Way::Behind };
    Some((way, distance2 + ACROSS * across2))
}
