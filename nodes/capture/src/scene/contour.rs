//! The true contours of a rendered view: where what is seen changes, exactly, from the scene and not from its picture.
//!
//! ```text
//! what each pixel's middle sees ─► neighbours that differ ─► bisected ─► crossings ─► chained through the cells ─► contours
//!                                                  crossings of the other views ─► who sees each point ─┘
//! ```
//!
//! Between two middles the place of a change is halved until it is known to a thousandth of a pixel. Four middles make a
//! cell; the crossings on its sides that are of one contour are joined, so that a contour is a chain of crossings and ends
//! where another covers it.

use std::collections::VecDeque;

use parry3d::math::Vec3;

use messages::{Contour, ContourKind, ContourPoint};

use super::render::{Cover, SIZE, Scene, in_bands};

/// Depths, in millimetres, that differ by more are of two things, one behind the other.
const JUMP: f32 = 0.3;
/// Neighbours of one surface whose depths differ by more are looked at for such a jump.
const STEEP: f32 = 0.8;
/// Surfaces that meet at less than this angle, as its cosine, have no crease.
const NO_CREASE: f32 = 0.9986;
/// Halvings of the way between two middles.
const HALVINGS: u32 = 10;
/// Changes between two middles that are looked at, at most.
const MOST_CHANGES: usize = 3;
/// How far, in pixels and in millimetres of depth, another view's crossing may be from where a point is expected there.
const NEAR: f32 = 0.75;
const NEAR_MM: f32 = 4.0;
/// How far to each side of a contour its contrast is measured, in pixels.
const BESIDE: f32 = 2.5;

/// What is seen at a place of a picture.
#[derive(Clone, Copy, Debug)]
struct Sample {
    surface: u32,
    mark: u8,
    /// Whether it lies in the shadow of something.
    is_shaded: bool,
    depth: f32,
    normal: Vec3,
}

impl Sample {
    /// Whether both are of one surface, paint and light.
    fn is_like(&self, other: &Self) -> bool {
        self.surface == other.surface
            && self.mark == other.mark
            && self.is_shaded == other.is_shaded
    }

    /// What changes between two places that are next to each other.
    fn change(&self, other: &Self) -> Option<ContourKind> {
        let is_other = self.surface != other.surface;
        if (self.depth - other.depth).abs() > JUMP {
            Some(ContourKind::Silhouette)
        } else if is_other && self.normal.dot(other.normal) < NO_CREASE {
            Some(ContourKind::Crease)
        } else if self.mark != other.mark {
            Some(ContourKind::Mark)
        } else if self.is_shaded != other.is_shaded {
            Some(ContourKind::Shadow)
        } else {
            None
        }
    }
}

/// Where a contour crosses the way between two middles.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    x: f32,
    y: f32,
    kind: ContourKind,
    /// What is seen on either side, the nearer first.
    sides: [Sample; 2],
    /// The solid of the nearer side; 0 is the table.
    solid: u32,
}

impl Crossing {
    /// Depth of the nearer side, in millimetres.
    fn depth(&self) -> f32 {
        self.sides[0].depth
    }

    /// How surely both are of one contour, the surest first; `None` when they are not.
    fn kinship(&self, other: &Self) -> Option<u8> {
        if self.kind != other.kind || self.solid != other.solid {
            return None;
        }
        let is_same = |side: usize| self.sides[side].surface == other.sides[side].surface;
        Some(match (is_same(0), is_same(1)) {
            (true, true) => 0,
            (true, false) => 1,
            _ => 2,
        })
    }

    /// Whether another view's crossing shows the same edge: a fold that is seen from the side there is a silhouette.
    fn is_edge_of(&self, other: &Self) -> bool {
        use ContourKind::{Crease, Silhouette};
        let is_shape = |kind| matches!(kind, Silhouette | Crease);
        let is_kind = self.kind == other.kind || is_shape(self.kind) && is_shape(other.kind);
        is_kind && self.solid == other.solid && (self.depth() - other.depth()).abs() < NEAR_MM
    }
}

/// The crossings of a view.
#[derive(Debug)]
struct View {
    crossings: Vec<Crossing>,
    /// Per pixel the crossing on the way to the right and that on the way down, from its middle.
    ways: Vec<[Option<u32>; 2]>,
}

const WIDTH: usize = SIZE.width as usize;
const HEIGHT: usize = SIZE.height as usize;

impl View {
    fn of(scene: &Scene, position: f32) -> Self {
        let cover = scene.cover(position);
        let see = |x: f32, y: f32| sample(scene, position, &cover, (x, y));
        let middles = in_bands(|x, y| see(x as f32, y as f32));
        let found = in_bands(|x, y| {
            let own = &middles[y * WIDTH + x];
            [(1, 0), (0, 1)].map(|(right, down)| {
                let there = (x + right < WIDTH && y + down < HEIGHT)
                    .then(|| &middles[(y + down) * WIDTH + x + right])?;
                let along = |t: f32| (x as f32 + t * right as f32, y as f32 + t * down as f32);
                let (at, [a, b], kind) = bisected(own, there, |t| {
                    let (x, y) = along(t);
                    see(x, y)
                })?;
                let (x, y) = along(at);
                Some(crossing(scene, [x, y], kind, a, b))
            })
        });
        let mut crossings = Vec::new();
        let ways = found.into_iter().map(|pair| {
            pair.map(|found| {
                found.map(|found| {
                    crossings.push(found);
                    crossings.len() as u32 - 1
                })
            })
        });
        let ways = ways.collect();
        Self { crossings, ways }
    }

    /// Per crossing those next to it on its contour, in up to two cells.
    fn links(&self) -> Vec<[Option<u32>; 2]> {
        let mut links = vec![[None; 2]; self.crossings.len()];
        for y in 0..HEIGHT - 1 {
            for x in 0..WIDTH - 1 {
                let i = y * WIDTH + x;
                let sides = [
                    self.ways[i][0],
                    self.ways[i][1],
                    self.ways[i + 1][1],
                    self.ways[i + WIDTH][0],
                ];
                let sides: Vec<u32> = sides.into_iter().flatten().collect();
                let mut pairs: Vec<(u8, f32, u32, u32)> = Vec::new();
                for (at, &one) in sides.iter().enumerate() {
                    for &other in &sides[at + 1..] {
                        let [a, b] = [one, other].map(|i| &self.crossings[i as usize]);
                        let away = (a.x - b.x).hypot(a.y - b.y);
                        pairs.extend(a.kinship(b).map(|kinship| (kinship, away, one, other)));
                    }
                }
                pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
                let mut joined: Vec<u32> = Vec::new();
                for (_, _, one, other) in pairs {
                    if joined.contains(&one) || joined.contains(&other) {
                        continue;
                    }
                    joined.extend([one, other]);
                    for (from, to) in [(one, other), (other, one)] {
                        let ends: &mut [Option<u32>; 2] = &mut links[from as usize];
                        let free = usize::from(ends[0].is_some());
                        ends[free] = Some(to);
                    }
                }
            }
        }
        links
    }

    /// The crossings in the order of their contours; a closed contour ends with the crossing it starts with.
    fn chains(&self) -> Vec<Vec<u32>> {
        let links = self.links();
        let mut is_taken = vec![false; self.crossings.len()];
        let mut chains = Vec::new();
        for start in 0..self.crossings.len() as u32 {
            if is_taken[start as usize] {
                continue;
            }
            is_taken[start as usize] = true;
            let mut chain = VecDeque::from([start]);
            for (side, &first) in links[start as usize].iter().enumerate() {
                let (mut last, mut next) = (start, first);
                while let Some(at) = next {
                    if at == start && side == 0 {
                        // Round it is the same crossing again.
                        chain.push_back(start);
                    }
                    if std::mem::replace(&mut is_taken[at as usize], true) {
                        break;
                    }
                    match side {
                        0 => chain.push_back(at),
                        _ => chain.push_front(at),
                    }
                    let [one, other] = links[at as usize];
                    (last, next) = (at, if one == Some(last) { other } else { one });
                }
            }
            // By itself it is no contour: a ray has slipped through between two facets.
            if chain.len() > 1 {
                chains.push(chain.into());
            }
        }
        chains
    }

    /// Whether it shows, where it is expected, the edge that a crossing of another view shows.
    fn shows(&self, edge: &Crossing, x: f32, y: f32) -> bool {
        let range = |at: f32, count: usize| {
            let (low, high) = ((at - NEAR).floor() - 1.0, (at + NEAR).ceil());
            low.max(0.0) as usize..(high.max(-1.0) as isize + 1).clamp(0, count as isize) as usize
        };
        range(y, HEIGHT).any(|row| {
            range(x, WIDTH).any(|column| {
                let near = self.ways[row * WIDTH + column].into_iter().flatten();
                near.map(|i| &self.crossings[i as usize])
                    .any(|there| edge.is_edge_of(there) && (there.x - x).hypot(there.y - y) < NEAR)
            })
        })
    }
}

fn sample(scene: &Scene, position: f32, cover: &Cover, (x, y): (f32, f32)) -> Sample {
    let hit = scene.seen(position, x, y, cover);
    Sample {
        surface: hit.surface,
        mark: scene.finish(&hit).mark,
        is_shaded: scene.is_in_shadow(&hit),
        depth: hit.depth,
        normal: hit.normal,
    }
}

/// The first change on the way between two middles: where, what is seen on either side, and what changes.
fn bisected(
    from: &Sample,
    to: &Sample,
    see: impl Fn(f32) -> Sample,
) -> Option<(f32, [Sample; 2], ContourKind)> {
    let (mut start, mut own) = (0.0, *from);
    for _ in 0..MOST_CHANGES {
        let is_steep = (own.depth - to.depth).abs() > STEEP;
        let is_like = own.is_like(to);
        if is_like && !is_steep {
            return None;
        }
        let ([mut low, mut high], [mut a, mut b]) = ([start, 1.0], [own, *to]);
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            let seen = see(middle);
            // Of one surface the side is looked at on which depth changes more.
            let is_before = match is_like {
                true => (a.depth - seen.depth).abs() < (seen.depth - b.depth).abs(),
                false => own.is_like(&seen),
            };
            match is_before {
                true => (low, a) = (middle, seen),
                false => (high, b) = (middle, seen),
            }
        }
        if let Some(kind) = a.change(&b) {
            return Some(((low + high) / 2.0, [a, b], kind));
        }
        (start, own) = (high, b);
    }
    None
}

fn crossing(scene: &Scene, [x, y]: [f32; 2], kind: ContourKind, a: Sample, b: Sample) -> Crossing {
    // Of two that touch the solid is the nearer: the table ends nowhere.
    let is_first = match kind {
        ContourKind::Silhouette => a.depth < b.depth,
        _ => a.surface > b.surface,
    };
    let sides = if is_first { [a, b] } else { [b, a] };
    Crossing {
        x,
        y,
        kind,
        sides,
        solid: scene.solid_of(sides[0].surface),
    }
}

/// A view whose contours are asked for.
struct Asked<'a> {
    scene: &'a Scene,
    position: f32,
    cover: Cover,
}

impl Asked<'_> {
    /// The gray level, without noise and blur, beside a contour: as far from it as [`BESIDE`], or as what lies on that
    /// side reaches.
    fn gray_beside(&self, crossing: &Crossing, [dx, dy]: [f32; 2]) -> f32 {
        const STEPS: u32 = 5;
        let place = |step: u32| {
            let away = BESIDE * step.max(1) as f32 / STEPS as f32;
            (crossing.x + dx * away, crossing.y + dy * away)
        };
        let first = sample(self.scene, self.position, &self.cover, place(0));
        let mut last = place(0);
        for step in 1..=STEPS {
            let (x, y) = place(step);
            if !sample(self.scene, self.position, &self.cover, (x, y)).is_like(&first) {
                break;
            }
            last = (x, y);
        }
        let hit = self.scene.seen(self.position, last.0, last.1, &self.cover);
        self.scene.gray(&hit).0
    }
}

/// The contours of view `view` of these positions.
pub(super) fn contours(scene: &Scene, positions: &[f32], view: usize) -> Vec<Contour> {
    let views: Vec<View> = positions.iter().map(|&p| View::of(scene, p)).collect();
    let (own, position) = (&views[view], positions[view]);
    let asked = Asked {
        scene,
        position,
        cover: scene.cover(position),
    };
    let point = |chain: &[u32], at: usize| {
        let crossing = &own.crossings[chain[at] as usize];
        let mut seen = 0;
        for (other, (there, &to)) in views.iter().zip(positions).enumerate() {
            let place = scene.moved(position, to, crossing.x, crossing.y, crossing.depth());
            let is_seen = other == view || there.shows(crossing, place.x, place.y);
            seen |= u32::from(is_seen) << other;
        }
        // The direction is that from the second crossing before to the second after, round a closed contour.
        let last = chain.len() - 1;
        let end = |steps: isize| {
            let at = at as isize + steps;
            let at = match chain[0] == chain[last] {
                true => at.rem_euclid(last as isize),
                false => at.clamp(0, last as isize),
            };
            &own.crossings[chain[at as usize] as usize]
        };
        let (before, after) = (end(-2), end(2));
        let (dx, dy) = (after.x - before.x, after.y - before.y);
        let length = dx.hypot(dy).max(f32::MIN_POSITIVE);
        let gray =
            |side: f32| asked.gray_beside(crossing, [-dy / length * side, dx / length * side]);
        ContourPoint {
            x: crossing.x,
            y: crossing.y,
            disparity: scene.disparity(positions, crossing.depth()),
            contrast: (gray(1.0) - gray(-1.0)).abs(),
            seen,
        }
    };
    in_shares(&own.chains(), |chain| Contour {
        kind: own.crossings[chain[0] as usize].kind,
        points: (0..chain.len()).map(|at| point(chain, at)).collect(),
    })
}

/// Does something with each item, on all cores; results come in the order of the items.
fn in_shares<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    const SHARES: usize = 8;
    let share = items.len().div_ceil(SHARES).max(1);
    let work = |items: &[T]| items.iter().map(&work).collect::<Vec<R>>();
    std::thread::scope(|scope| {
        let workers: Vec<_> = items
            .chunks(share)
            .map(|items| scope.spawn(|| work(items)))
            .collect();
        let joined = |worker: std::thread::ScopedJoinHandle<'_, Vec<R>>| {
            worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().flat_map(joined).collect()
    })
}

#[cfg(test)]
mod tests;
