//! The neighbour rule: which zero-crossing comes next along the contour.
//!
//! Every zero-crossing has a direction of travel: a quarter turn from its gradient, so that the bright side stays on
//! the same hand. Two are neighbours when they are within reach of each other, their orientations agree, and the way
//! from one to the other goes along their common direction of travel. Of its neighbours ahead and of those behind a
//! zero-crossing prefers the nearest, a pixel across counting as much again as one along; two that prefer each other
//! are linked. That is done twice: among all within [`REACH`], then among what still is an end, within
//! [`REACH_OF_ENDS`]. Links are thus paths and rings without branches; where a preference is not returned, curves
//! branch or merge.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::ops::Range;

use messages::{Edge, NONE};

/// How far, in pixels, a zero-crossing looks at first: successive ones of a contour are mostly nearer. Less leaves more
/// to the second round, more looks at more in vain.
const REACH: f32 = 1.8;

/// How far, in pixels, an end looks for another: where a contour is flatter than 45° but steep enough to be listed by
/// rows only, its zero-crossings are up to 2.3 apart, and a gap of one is bridged. On real scenes 2.3 breaks more curves,
/// 4.5 gains nothing.
const REACH_OF_ENDS: f32 = 2.9;

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
    Ahead = 0,
    Behind = 1,
}

const AHEAD: usize = Way::Ahead as usize;
const BEHIND: usize = Way::Behind as usize;

/// A neighbour and what going there costs, as one number that is less for a better choice: the cost's bits above (it
/// is not negative, so they sort like it), the node below.
#[derive(Clone, Copy, Debug)]
struct Choice(u64);

impl Choice {
    const NOBODY: Self = Self(((f32::INFINITY.to_bits() as u64) << 32) | NONE as u64);

    /// The node, or [`NONE`].
    const fn node(self) -> u32 {
        self.0 as u32
    }

    /// Takes an offer that is better; one that costs not a number never is.
    fn offer(&mut self, node: usize, cost: f32) {
        self.0 = self.0.min((u64::from(cost.to_bits()) << 32) | node as u64);
    }
}

/// The zero-crossings of a frame and their links.
#[derive(Debug)]
pub(crate) struct Links {
    all: Field,
    /// What is an end after the first round.
    ends: Field,
    /// Per end its node.
    node_of: Vec<u32>,
    /// Per node the neighbours it is linked to, ahead and behind, or [`NONE`].
    linked: Vec<[u32; 2]>,
}

impl Links {
    pub(crate) fn new(max: messages::Size) -> Self {
        Self {
            all: Field::new(max),
            ends: Field::new(max),
            node_of: Vec::with_capacity(max.pixels()),
            linked: Vec::with_capacity(max.pixels()),
        }
    }

    /// Forgets the last frame.
    pub(crate) fn clear(&mut self) {
        self.all.clear();
    }

    /// The number of zero-crossings.
    pub(crate) fn len(&self) -> u32 {
        self.all.nodes.len() as u32
    }

    /// Adds a zero-crossing of a row; they come in raster order.
    pub(crate) fn add(&mut self, edge: &Edge, row: u32) {
        let turned = edge.orientation + FRAC_PI_2;
        let node = Node {
            x: edge.x,
            y: edge.y,
            cos: sine(if turned > PI { turned - TAU } else { turned }),
            sin: sine(edge.orientation),
        };
        self.all.add(node, row);
    }

    /// Links all zero-crossings whose orientations differ by at most the angle of this cosine.
    pub(crate) fn link(&mut self, cos_tolerance: f32) {
        self.linked.clear();
        self.linked.resize(self.all.nodes.len(), [NONE; 2]);
        self.all.prefer(REACH, cos_tolerance, |_, _, _| true);
        self.all.tie(|behind, ahead| {
            self.linked[behind as usize][AHEAD] = ahead;
            self.linked[ahead as usize][BEHIND] = behind;
        });

        self.ends.clear();
        self.node_of.clear();
        for ((i, node), linked) in (0u32..).zip(&self.all.nodes).zip(&self.linked) {
            if linked.contains(&NONE) {
                self.ends.add(*node, node.y as u32);
                self.node_of.push(i);
            }
        }
        let (node_of, linked) = (&self.node_of, &mut self.linked);
        let is_open = |end: usize, way: usize| linked[node_of[end] as usize][way] == NONE;
        self.ends.prefer(REACH_OF_ENDS, cos_tolerance, |i, j, way| {
            is_open(i, way) && is_open(j, 1 - way)
        });
        self.ends.tie(|behind, ahead| {
            let [behind, ahead] = [behind, ahead].map(|end| node_of[end as usize]);
            linked[behind as usize][AHEAD] = ahead;
            linked[ahead as usize][BEHIND] = behind;
        });
    }

    /// The neighbour a node prefers, linked or not, or [`NONE`].
    pub(crate) fn preferred(&self, node: u32, way: Way) -> u32 {
        self.all.preferred[node as usize][way as usize].node()
    }

    /// The neighbour a node is linked to, or [`NONE`].
    pub(crate) fn linked(&self, node: u32, way: Way) -> u32 {
        self.linked[node as usize][way as usize]
    }
}

/// Zero-crossings that choose among each other.
#[derive(Debug)]
struct Field {
    /// In raster order.
    nodes: Vec<Node>,
    /// Where each row's nodes start; the last row has not ended.
    rows: Vec<u32>,
    /// Per node its preferred neighbours, ahead and behind.
    preferred: Vec<[Choice; 2]>,
}

impl Field {
    fn new(max: messages::Size) -> Self {
        Self {
            nodes: Vec::with_capacity(max.pixels()),
            rows: Vec::with_capacity(max.height as usize + 3),
            preferred: Vec::with_capacity(max.pixels()),
        }
    }

    fn clear(&mut self) {
        self.nodes.clear();
        self.rows.clear();
    }

    fn add(&mut self, node: Node, row: u32) {
        while self.rows.len() <= row as usize {
            self.rows.push(self.nodes.len() as u32);
        }
        self.nodes.push(node);
    }

    /// Finds every node's preferred neighbours within reach, of those pairs and ways that are allowed. Each pair is
    /// met once, from its upper (in a row, left) node.
    fn prefer(
        &mut self,
        reach: f32,
        cos_tolerance: f32,
        allowed: impl Fn(usize, usize, usize) -> bool,
    ) {
        // Three empty rows below the last, for the windows to end in.
        self.rows.extend([self.nodes.len() as u32; 3]);
        self.preferred.clear();
        self.preferred.resize(self.nodes.len(), [Choice::NOBODY; 2]);
        for row in self.rows.windows(4) {
            let [start, end, end_below, end_far_below] = [0, 1, 2, 3].map(|k| row[k] as usize);
            let (mut below, mut far_below) = (end, end_below);
            for i in start..end {
                let a = self.nodes[i];
                let mut meet = |window: Range<usize>| {
                    for (j, b) in window.clone().zip(&self.nodes[window]) {
                        if b.x > a.x + reach {
                            break;
                        }
                        let (along, cost) = step(&a, b, reach, cos_tolerance);
                        let way = if along > 0.0 { AHEAD } else { BEHIND };
                        let cost = if allowed(i, j, way) { cost } else { f32::NAN };
                        self.preferred[i][way].offer(j, cost);
                        self.preferred[j][1 - way].offer(i, cost);
                    }
                };
                meet(i + 1..end);
                while below < end_below && self.nodes[below].x < a.x - reach {
                    below += 1;
                }
                meet(below..end_below);
                // Nodes two rows apart are more than a pixel apart, mostly more than the first reach.
                if reach > 2.0 {
                    while far_below < end_far_below && self.nodes[far_below].x < a.x - reach {
                        far_below += 1;
                    }
                    meet(far_below..end_far_below);
                }
            }
        }
    }

    /// Calls `link` with the nodes that prefer each other, the one behind and the one ahead.
    fn tie(&self, mut link: impl FnMut(u32, u32)) {
        for (behind, [choice, _]) in (0u32..).zip(&self.preferred) {
            let ahead = choice.node();
            if ahead != NONE && self.preferred[ahead as usize][BEHIND].node() == behind {
                link(behind, ahead);
            }
        }
    }
}

/// The sine of an angle from −π to π, within 0.0012, a twentieth of a degree: two parabolas, and their squares to mend
/// them.
fn sine(angle: f32) -> f32 {
    let parabola = (4.0 / PI) * angle - (4.0 / (PI * PI)) * angle * angle.abs();
    parabola + 0.225 * (parabola * parabola.abs() - parabola)
}

/// How far b is along the way from a, and what going there costs, the same seen from either and not a number when
/// they are no neighbours. Written without branches, for none of them could be foretold, and without roots: the common
/// direction of travel is left as long as it comes, twice a unit where the orientations are the same.
fn step(a: &Node, b: &Node, reach: f32, cos_tolerance: f32) -> (f32, f32) {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let distance2 = dx * dx + dy * dy;
    let cos = a.cos * b.cos + a.sin * b.sin;
    // The sum of both gradients, a quarter turn on.
    let (tx, ty) = (-(a.sin + b.sin), a.cos + b.cos);
    let along = 0.5 * (dx * tx + dy * ty);
    let across = 0.5 * (dx * ty - dy * tx);
    let near = (distance2 <= reach * reach) & (across.abs() <= SLOPE * along.abs() + SLACK);
    let holds = near & (cos >= cos_tolerance);
    (
        along,
        if holds {
            distance2 + across * across
        } else {
            f32::NAN
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges in random pixels with random orientations, one in `sparseness`, in raster order.
    fn scatter(width: u32, height: u32, sparseness: u64, seed: u64) -> Vec<Edge> {
        let mut state = seed;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut edges = Vec::new();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            if random() % sparseness != 0 {
                continue;
            }
            let fraction = (random() % 1000) as f32 / 1000.0;
            let (dx, dy) = if random() % 2 == 0 {
                (fraction, 0.0)
            } else {
                (0.0, fraction)
            };
            edges.push(Edge {
                x: x as f32 + dx,
                y: y as f32 + dy,
                orientation: (random() % 6283) as f32 / 1000.0 - PI,
                ..Edge::default()
            });
        }
        edges
    }

    /// Each node's linked neighbours, by looking at all pairs, rows apart at most as many as the round looks at.
    fn twin(nodes: &[Node], cos_tolerance: f32) -> Vec<[u32; 2]> {
        let mut linked = vec![[NONE; 2]; nodes.len()];
        for (reach, rows) in [(REACH, 1), (REACH_OF_ENDS, 2)] {
            let best = |i: usize, way: usize| {
                let mut best = (f32::INFINITY, NONE);
                for j in 0..nodes.len() {
                    let apart = (nodes[i].y as i32 - nodes[j].y as i32).abs();
                    if i == j
                        || apart > rows
                        || linked[i][way] != NONE
                        || linked[j][1 - way] != NONE
                    {
                        continue;
                    }
                    // Measured from the upper left one, as the pair is met.
                    let (along, cost) = match i < j {
                        true => step(&nodes[i], &nodes[j], reach, cos_tolerance),
                        false => step(&nodes[j], &nodes[i], reach, cos_tolerance),
                    };
                    let found = if (along > 0.0) == (i < j) {
                        AHEAD
                    } else {
                        BEHIND
                    };
                    if found == way && cost < best.0 {
                        best = (cost, j as u32);
                    }
                }
                best.1
            };
            let preferred: Vec<[u32; 2]> = (0..nodes.len())
                .map(|i| [best(i, AHEAD), best(i, BEHIND)])
                .collect();
            for (i, [ahead, _]) in preferred.iter().enumerate() {
                if *ahead != NONE && preferred[*ahead as usize][BEHIND] == i as u32 {
                    linked[i][AHEAD] = *ahead;
                    linked[*ahead as usize][BEHIND] = i as u32;
                }
            }
        }
        linked
    }

    #[test]
    fn links_are_those_of_a_twin_that_looks_at_all_pairs() {
        let mut linked = 0;
        for (seed, sparseness, degrees) in
            [(1, 1, 90.0f32), (2, 3, 60.0), (3, 3, 180.0), (4, 8, 40.0)]
        {
            let edges = scatter(31, 17, sparseness, seed);
            let cos_tolerance = degrees.to_radians().cos();
            let mut links = Links::new(messages::Size::new(31, 17));
            edges.iter().for_each(|edge| links.add(edge, edge.y as u32));
            links.link(cos_tolerance);
            assert_eq!(
                links.linked,
                twin(&links.all.nodes, cos_tolerance),
                "{sparseness} {degrees}"
            );
            linked += links
                .linked
                .iter()
                .filter(|linked| linked[AHEAD] != NONE)
                .count();
        }
        assert!(linked > 300, "{linked} links put the rule to the test");
    }

    #[test]
    fn sines_and_cosines_are_good_to_a_tenth_of_a_degree() {
        for i in -1000..=1000 {
            let orientation = i as f32 * (PI / 1000.0);
            let mut links = Links::new(messages::Size::new(1, 1));
            links.add(
                &Edge {
                    orientation,
                    ..Edge::default()
                },
                0,
            );
            let Node { sin, cos, .. } = links.all.nodes[0];
            assert!((sin - orientation.sin()).abs() < 0.0012, "{orientation}");
            assert!((cos - orientation.cos()).abs() < 0.0012, "{orientation}");
        }
    }
}
