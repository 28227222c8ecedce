//! Solids as triangle meshes: every shape of the rendered scenes is made of a few kinds of patches.
//!
//! Lengths are millimetres, as in a workshop drawing. A patch is smooth inside and has a crease where it ends.

use std::f32::consts::TAU;

use parry3d::math::{Pose, Vec2, Vec3};

/// A vertex: where it is, the surface's normal there, and the place its paint is looked up at, which stays with the
/// material when the part is folded or moved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) position: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) place: Vec3,
}

/// A part of one material, in coordinates of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    pub(crate) corners: Vec<Corner>,
    /// Three corners each, and the patch they belong to.
    pub(crate) triangles: Vec<([u32; 3], u32)>,
    pub(crate) patches: u32,
}

impl Part {
    /// A grid of `columns` by `rows` facets over the unit square; `at` gives position and normal.
    pub(crate) fn patch(
        mut self,
        columns: u32,
        rows: u32,
        at: impl Fn(f32, f32) -> (Vec3, Vec3),
    ) -> Self {
        let first = self.corners.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let (position, normal) =
                    at(column as f32 / columns as f32, row as f32 / rows as f32);
                self.corners.push(Corner {
                    position,
                    normal: normal.normalize_or(Vec3::Z),
                    place: position,
                });
            }
        }
        let stride = columns + 1;
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * stride + column;
                let (b, c, d) = (a + 1, a + stride, a + stride + 1);
                self.triangles.push(([a, b, d], self.patches));
                self.triangles.push(([a, d, c], self.patches));
            }
        }
        self.patches += 1;
        self
    }

    /// A patch whose normals come from the slopes of `at`, which must not vanish; they point to the side from which
    /// u turns counter-clockwise into v.
    pub(crate) fn curved(self, columns: u32, rows: u32, at: impl Fn(f32, f32) -> Vec3) -> Self {
        const STEP: f32 = 1e-3;
        self.patch(columns, rows, |u, v| {
            let along_u = at(u + STEP, v) - at(u - STEP, v);
            let along_v = at(u, v + STEP) - at(u, v - STEP);
            (at(u, v), along_u.cross(along_v))
        })
    }

    /// Turns a smooth profile, (radius, height) over 0..=1 with rising height, about the z axis.
    pub(crate) fn turned(self, facets: u32, steps: u32, profile: impl Fn(f32) -> Vec2) -> Self {
        const STEP: f32 = 1e-3;
        self.patch(facets, steps, |u, v| {
            let (sin, cos) = (u * TAU).sin_cos();
            let (low, high) = ((v - STEP).max(0.0), (v + STEP).min(1.0));
            let slope = profile(high) - profile(low);
            let Vec2 {
                x: radius,
                y: height,
            } = profile(v);
            (
                Vec3::new(radius * cos, radius * sin, height),
                Vec3::new(slope.y * cos, slope.y * sin, -slope.x),
            )
        })
    }

    /// Turns a broken line of (radius, height) about the z axis; each piece is a patch, so the rings are sharp.
    pub(crate) fn turned_sharp(self, facets: u32, line: &[[f32; 2]]) -> Self {
        line.windows(2).fold(self, |part, ends| {
            let [a, b] = [Vec2::from(ends[0]), Vec2::from(ends[1])];
            let width = TAU * a.x.max(b.x) / facets as f32;
            // Long thin facets would have large boxes, slow to search.
            let steps = (a.distance(b) / (6.0 * width)).ceil().max(1.0);
            part.turned(facets, steps as u32, |v| a.lerp(b, v))
        })
    }

    /// A ball around the origin.
    pub(crate) fn ball(radius: f32) -> Self {
        Self::default().patch(64, 32, |u, v| {
            let ((sin, cos), (sin_v, cos_v)) = ((u * TAU).sin_cos(), (v * TAU / 2.0).sin_cos());
            let normal = Vec3::new(cos * sin_v, sin * sin_v, -cos_v);
            (normal * radius, normal)
        })
    }

    /// A plate from z = 0 to `thickness` with an outline, given counter-clockwise, and one hole in it that is seen
    /// whole from its centre.
    pub(crate) fn plate(mut self, outline: &[Vec2], hole: &Hole, thickness: f32) -> Self {
        let inner: Vec<Vec2> = outline.iter().map(|&p| hole.towards(p)).collect();
        let steps = outline.len() as u32;
        let at = |ring: &[Vec2], u: f32, z: f32| {
            let index = (u * steps as f32).round() as usize % ring.len();
            ring[index].extend(z)
        };
        for (z, normal) in [(0.0, Vec3::NEG_Z), (thickness, Vec3::Z)] {
            // Several rings: long thin facets would have large boxes, slow to search.
            self = self.patch(steps, 4, |u, v| {
                (at(outline, u, z).lerp(at(&inner, u, z), v), normal)
            });
        }
        self = self.wall(outline, thickness, 1.0);
        if hole.is_open() {
            self.wall(&inner, thickness, -1.0)
        } else {
            self
        }
    }

    /// The wall over a closed outline: smooth along gentle turns, creased at sharp ones.
    fn wall(mut self, outline: &[Vec2], thickness: f32, side: f32) -> Self {
        let count = outline.len();
        let outward = |i: usize| {
            let along = outline[(i + 1) % count] - outline[i % count];
            Vec2::new(along.y, -along.x).normalize_or_zero() * side
        };
        let is_gentle = |a: Vec2, b: Vec2| a.dot(b) > 0.8;
        for i in 0..count {
            let [before, own, after] = [i + count - 1, i, i + 1].map(outward);
            let shared = |other: Vec2| {
                if is_gentle(own, other) {
                    own + other
                } else {
                    own
                }
            };
            let ends = [
                (outline[i], shared(before)),
                (outline[(i + 1) % count], shared(after)),
            ];
            self = self.patch(1, 1, |u, v| {
                let (point, normal) = ends[usize::from(u > 0.5)];
                (point.extend(v * thickness), normal.extend(0.0))
            });
            if i > 0 && is_gentle(before, own) {
                // No crease: the same patch goes on.
                self.patches -= 1;
                let patch = self.patches - 1;
                self.triangles
                    .iter_mut()
                    .rev()
                    .take(2)
                    .for_each(|triangle| triangle.1 = patch);
            }
        }
        self
    }

    /// Folds the sheet beyond the line y = `at` by `angle`: up about a radius above it, or down about a negative one
    /// below it.
    pub(crate) fn folded(mut self, at: f32, radius: f32, angle: f32) -> Self {
        for corner in &mut self.corners {
            let Vec3 { x, y, z } = corner.position;
            let turn = radius.signum() * ((y - at) / radius.abs()).clamp(0.0, angle);
            let beyond = y - at - radius * turn;
            let (sin, cos) = turn.sin_cos();
            corner.position = Vec3::new(
                x,
                at + (radius - z) * sin + beyond * cos,
                radius - (radius - z) * cos + beyond * sin,
            );
            let normal = corner.normal;
            corner.normal.y = normal.y * cos - normal.z * sin;
            corner.normal.z = normal.y * sin + normal.z * cos;
        }
        self
    }

    /// The same part elsewhere; its paint goes with it.
    pub(crate) fn placed(mut self, pose: &Pose) -> Self {
        for corner in &mut self.corners {
            corner.position = pose.transform_point(corner.position);
            corner.normal = pose.transform_vector(corner.normal);
        }
        self
    }

    /// This part and another of the same material.
    pub(crate) fn and(mut self, other: Self) -> Self {
        let first = self.corners.len() as u32;
        self.corners.extend(other.corners);
        let moved =
            |(corners, patch): ([u32; 3], u32)| (corners.map(|c| c + first), patch + self.patches);
        self.triangles
            .extend(other.triangles.into_iter().map(moved));
        self.patches += other.patches;
        self
    }
}

/// A hole through a plate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hole {
    pub(crate) centre: Vec2,
    /// Half the distance between the centres of a slot's ends; zero along both for a round hole.
    pub(crate) half: Vec2,
    pub(crate) radius: f32,
}

impl Hole {
    /// No hole: the plate's facets meet in this point.
    pub(crate) fn none(x: f32, y: f32) -> Self {
        Self::round(x, y, 0.0)
    }

    pub(crate) fn round(x: f32, y: f32, radius: f32) -> Self {
        Self {
            centre: Vec2::new(x, y),
            half: Vec2::ZERO,
            radius,
        }
    }

    /// A slot along x.
    pub(crate) fn slot(x: f32, y: f32, half: f32, radius: f32) -> Self {
        Self {
            centre: Vec2::new(x, y),
            half: Vec2::new(half, 0.0),
            radius,
        }
    }

    fn is_open(&self) -> bool {
        self.radius > 0.0
    }

    /// The point of the hole's rim in the direction of `p`.
    fn towards(&self, p: Vec2) -> Vec2 {
        let direction = (p - self.centre).normalize_or_zero();
        let (half, radius) = (self.half.x, self.radius);
        let (along, across) = (direction.x.abs(), direction.y.abs());
        let reach = if across > 0.0 && radius * along <= half * across {
            radius / across
        } else {
            half * along
                + (radius * radius - half * half * across * across)
                    .max(0.0)
                    .sqrt()
        };
        self.centre + direction * reach
    }
}

/// A rectangle's outline, counter-clockwise, its corners rounded from the lower left on, in steps of about `step`.
pub(crate) fn rectangle(low: [f32; 2], high: [f32; 2], radii: [f32; 4], step: f32) -> Vec<Vec2> {
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]].map(Vec2::from);
    let mut outline: Vec<Vec2> = Vec::new();
    for (i, (&corner, radius)) in corners.iter().zip(radii).enumerate() {
        let into = (corner - corners[(i + 3) % 4]).normalize();
        let out = (corners[(i + 1) % 4] - corner).normalize();
        let centre = corner + (out - into) * radius;
        let pieces = if radius > 0.0 { 12 } else { 0 };
        for piece in 0..=pieces {
            let (sin, cos) = (piece as f32 / pieces.max(1) as f32 * TAU / 4.0).sin_cos();
            let next = centre + (into * sin - out * cos) * radius;
            if let Some(&last) = outline.last().filter(|_| piece == 0) {
                fill(&mut outline, last, next, step);
            }
            outline.push(next);
        }
    }
    let (last, first) = (outline[outline.len() - 1], outline[0]);
    fill(&mut outline, last, first, step);
    outline
}

/// The points strictly between two, about a step apart.
fn fill(outline: &mut Vec<Vec2>, from: Vec2, to: Vec2, step: f32) {
    let pieces = (from.distance(to) / step).ceil().max(1.0) as u32;
    outline.extend((1..pieces).map(|piece| from.lerp(to, piece as f32 / pieces as f32)));
}

/// A regular outline of `count` points, counter-clockwise: a hexagon, or a circle.
pub(crate) fn regular(count: u32, radius: f32) -> Vec<Vec2> {
    let point = |i: u32| {
        let (sin, cos) = (i as f32 / count as f32 * TAU).sin_cos();
        Vec2::new(cos, sin) * radius
    };
    (0..count).map(point).collect()
}
