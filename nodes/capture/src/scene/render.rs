//! Ray casting: pictures, exact disparities and visibility of a scene.

use parry3d::math::{Pose, Vec2, Vec3};
use parry3d::query::{Ray, RayCast, details::local_ray_intersection_with_triangle};
use parry3d::shape::TriMesh;

use messages::Size;

use super::paint::{Finish, Paint};
use super::solid::{Corner, Part};
use crate::truth::Truth;

/// Size of every rendered picture.
pub(crate) const SIZE: Size = Size::new(512, 480);
/// Focal length in pixels.
pub(crate) const FOCAL: f32 = 700.0;
/// Column and row of the principal point.
pub(crate) const CENTRE: [f32; 2] = [255.5, 239.5];
/// Millimetres between neighbouring camera positions.
pub(crate) const STEP: f32 = 10.0;
/// The position straight before the scene, of which the cameras left and right see as much.
const MIDDLE: f32 = 1.0;

/// The camera on its rail above the table; the table is the plane z = 0, and y runs away from the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    down: Vec3,
    forward: Vec3,
    /// Where it stands at [`MIDDLE`].
    middle: Vec3,
}

impl Camera {
    /// Looks down at the origin from so many millimetres, by so many degrees below the horizon.
    pub(crate) fn above(distance: f32, degrees: f32) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let forward = Vec3::new(0.0, cos, -sin);
        Self {
            down: Vec3::new(0.0, -sin, -cos),
            forward,
            middle: forward * -distance,
        }
    }

    fn eye(&self, position: f32) -> Vec3 {
        self.middle + Vec3::X * (position - MIDDLE) * STEP
    }

    /// The ray through a place of the picture; one unit of it is one millimetre of depth.
    fn ray(&self, position: f32, x: f32, y: f32) -> Ray {
        let right = (x - CENTRE[0]) / FOCAL;
        let down = (y - CENTRE[1]) / FOCAL;
        Ray::new(
            self.eye(position),
            self.forward + Vec3::X * right + self.down * down,
        )
    }

    /// The place of the picture where a point is seen.
    fn project(&self, position: f32, point: Vec3) -> Vec2 {
        let from = point - self.eye(position);
        let depth = from.dot(self.forward);
        Vec2::new(from.x, from.dot(self.down)) * (FOCAL / depth) + Vec2::from(CENTRE)
    }
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
struct Hit {
    /// Along the optical axis, in millimetres.
    depth: f32,
    point: Vec3,
    normal: Vec3,
    place: Vec3,
    /// 0 is the table.
    surface: u32,
    paint: Paint,
}

/// Light on the table: what reaches it past the solids, on a square grid.
#[derive(Clone, Debug, Default)]
struct Light {
    /// Shares of the lamp and of the sky.
    shares: Vec<[f32; 2]>,
}

impl Light {
    const CELLS: usize = 144;
    /// The grid reaches this many millimetres to each side of the origin.
    const REACH: f32 = 180.0;
    const PER_MM: f32 = (Self::CELLS - 1) as f32 / (2.0 * Self::REACH);

    /// The places of the grid, just above the table.
    fn places() -> impl Iterator<Item = Vec3> {
        (0..Self::CELLS * Self::CELLS).map(|i| {
            let (column, row) = ((i % Self::CELLS) as f32, (i / Self::CELLS) as f32);
            Vec3::new(
                column / Self::PER_MM - Self::REACH,
                row / Self::PER_MM - Self::REACH,
                1e-3,
            )
        })
    }

    /// The light where it is known, and around that, two cells far, the mean of what is beside: what lies under a solid
    /// must not darken the table next to it.
    fn grown(mut shares: Vec<Option<[f32; 2]>>) -> Self {
        for _ in 0..2 {
            let known = shares.clone();
            for (i, share) in shares
                .iter_mut()
                .enumerate()
                .filter(|(_, share)| share.is_none())
            {
                let (column, row) = (i % Self::CELLS, i / Self::CELLS);
                let rows = row.saturating_sub(1)..(row + 2).min(Self::CELLS);
                let columns = column.saturating_sub(1)..(column + 2).min(Self::CELLS);
                let beside = rows
                    .flat_map(|row| known[row * Self::CELLS..][columns.clone()].iter().flatten());
                let (count, sum) = beside.fold((0.0, [0.0; 2]), |(count, sum), share| {
                    (count + 1.0, [sum[0] + share[0], sum[1] + share[1]])
                });
                *share = (count > 0.0).then(|| sum.map(|sum| sum / count));
            }
        }
        let shares: Vec<[f32; 2]> = shares.into_iter().map(Option::unwrap_or_default).collect();
        // Weights 1 2 1 along rows and columns take the stairs out of slanting shadows.
        let softened = |shares: &[[f32; 2]], stride: usize| -> Vec<[f32; 2]> {
            let beside = |i: usize| {
                [
                    shares[i.saturating_sub(stride)],
                    shares[(i + stride).min(shares.len() - 1)],
                ]
            };
            let mean = |i: usize| {
                [0, 1].map(|k| (2.0 * shares[i][k] + beside(i)[0][k] + beside(i)[1][k]) / 4.0)
            };
            (0..shares.len()).map(mean).collect()
        };
        Self {
            shares: softened(&softened(&shares, 1), Self::CELLS),
        }
    }

    /// The shares at a point of the table; beyond the grid nothing is in the way.
    fn at(&self, point: Vec3) -> [f32; 2] {
        let (x, y) = (
            (point.x + Self::REACH) * Self::PER_MM,
            (point.y + Self::REACH) * Self::PER_MM,
        );
        let last = (Self::CELLS - 1) as f32;
        if !(0.0..last).contains(&x) || !(0.0..last).contains(&y) {
            return [1.0; 2];
        }
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x.fract(), y.fract());
        let cell = |i: usize, j: usize| self.shares[(row + j) * Self::CELLS + column + i];
        [0, 1].map(|k| {
            let along = |j| cell(0, j)[k] + (cell(1, j)[k] - cell(0, j)[k]) * fx;
            along(0) + (along(1) - along(0)) * fy
        })
    }
}

/// A part in its place. Rays are cast in the part's own coordinates, along whose axes its facets' boxes are tight.
#[derive(Debug)]
struct Solid {
    part: Part,
    pose: Pose,
    mesh: TriMesh,
    paint: Paint,
    /// Number of its first patch among the surfaces of the scene.
    first_surface: u32,
}

/// Solids on a table, lit.
#[derive(Debug)]
pub(crate) struct Scene {
    camera: Camera,
    table: Paint,
    solids: Vec<Solid>,
    /// Surfaces so far; the first is the table.
    surfaces: u32,
    light: Light,
}

impl Scene {
    /// Where the lamp is, a unit away.
    const LAMP: Vec3 = Vec3::new(-0.52, -0.30, 0.80);

    pub(crate) fn new(camera: Camera, table: Paint) -> Self {
        Self {
            camera,
            table,
            solids: Vec::new(),
            surfaces: 1,
            light: Light::default(),
        }
    }

    pub(crate) fn with(mut self, part: Part, pose: Pose, paint: Paint) -> Self {
        let places = part.corners.iter().map(|corner| corner.position).collect();
        let facets = part.triangles.iter().map(|(corners, _)| *corners).collect();
        let first_surface = self.surfaces;
        self.surfaces += part.patches;
        // A part without facets has no mesh, and nothing to be seen of it.
        if let Ok(mesh) = TriMesh::new(places, facets) {
            self.solids.push(Solid {
                part,
                pose,
                mesh,
                paint,
                first_surface,
            });
        }
        self
    }

    /// Closes the scene and works out the shadows on the table.
    pub(crate) fn lit(mut self) -> Self {
        let lamp = directions(20, 0.10, Self::LAMP.normalize());
        let sky = directions(16, 0.95, Vec3::Z);
        let free = |point: Vec3, all: &[Vec3]| {
            let is_free =
                |&&direction: &&Vec3| !self.is_hidden(&Ray::new(point, direction), f32::MAX);
            all.iter().filter(is_free).count() as f32 / all.len() as f32
        };
        let shares = Light::places().map(|point| {
            // Under a solid there is no table to be seen.
            (!self.is_inside(point)).then(|| [free(point, &lamp), free(point, &sky)])
        });
        self.light = Light::grown(shares.collect());
        self
    }

    /// Whether a place lies inside a solid: straight up, its surface is then met from within.
    fn is_inside(&self, point: Vec3) -> bool {
        let above = self.first_facet(&Ray::new(point, Vec3::Z), f32::MAX);
        above.is_some_and(|(solid, facet, _)| {
            let corners = solid.part.triangles[facet]
                .0
                .map(|corner| solid.part.corners[corner as usize]);
            let normal: Vec3 = corners.iter().map(|corner| corner.normal).sum();
            solid.pose.transform_vector(normal).z > 0.0
        })
    }

    /// The first facet on the ray before `until`, and where.
    fn first_facet(&self, ray: &Ray, until: f32) -> Option<(&Solid, usize, f32)> {
        let mut first = None;
        let mut until = until;
        for solid in &self.solids {
            let (mesh, ray) = (&solid.mesh, ray.inverse_transform_by(&solid.pose));
            let hit = mesh.bvh().cast_ray(&ray, until, |facet, until| {
                mesh.triangle(facet).cast_local_ray(&ray, until, false)
            });
            if let Some((facet, depth)) = hit.filter(|(_, depth)| *depth < until) {
                until = depth;
                first = Some((solid, facet as usize, depth));
            }
        }
        first
    }

    /// Whether a solid lies on the ray before `until`.
    fn is_hidden(&self, ray: &Ray, until: f32) -> bool {
        self.solids.iter().any(|Solid { mesh, pose, .. }| {
            let ray = ray.inverse_transform_by(pose);
            // Any hit will do: with a cost of nothing it ends the search.
            let any = |facet, _| {
                mesh.triangle(facet)
                    .cast_local_ray(&ray, until, false)
                    .map(|_| 0.0)
            };
            mesh.bvh().cast_ray(&ray, until, any).is_some()
        })
    }

    /// What a ray meets first; solids are only looked for where there may be one.
    fn hit(&self, ray: &Ray, solids: bool) -> Hit {
        // Every camera looks down, so every ray meets the table.
        let table = -ray.origin.z / ray.dir.z;
        let first = if solids {
            self.first_facet(ray, table)
        } else {
            None
        };
        let solid = first.and_then(|(solid, facet, depth)| {
            let (corners, patch) = solid.part.triangles[facet];
            let corners = corners.map(|corner| solid.part.corners[corner as usize]);
            let [a, b, c] = corners.map(|corner| corner.position);
            let local = ray.inverse_transform_by(&solid.pose);
            let (_, weights) = local_ray_intersection_with_triangle(a, b, c, &local)?;
            let mixed = |of: fn(&Corner) -> Vec3| {
                of(&corners[0]) * weights.x
                    + of(&corners[1]) * weights.y
                    + of(&corners[2]) * weights.z
            };
            Some(Hit {
                depth,
                point: ray.point_at(depth),
                normal: solid
                    .pose
                    .transform_vector(mixed(|c| c.normal))
                    .normalize_or(Vec3::Z),
                place: mixed(|c| c.place),
                surface: solid.first_surface + patch,
                paint: solid.paint,
            })
        });
        solid.unwrap_or_else(|| {
            let point = ray.point_at(table);
            Hit {
                depth: table,
                point,
                normal: Vec3::Z,
                place: point,
                surface: 0,
                paint: self.table,
            }
        })
    }

    /// The gray level, 0 to 255, of a place of a surface, and whether the lamp reaches it. Nothing here depends on the
    /// view.
    fn gray(&self, hit: &Hit) -> (f32, bool) {
        let lamp = Self::LAMP.normalize();
        let towards = (self.camera.middle - hit.point).normalize();
        let detail = FOCAL / hit.depth * hit.normal.dot(towards).max(0.15);
        let Finish { albedo, sheen } = (hit.paint)(hit.place, detail);
        let facing = hit.normal.dot(lamp).max(0.0);
        let [direct, sky] = if hit.surface == 0 {
            self.light.at(hit.point)
        } else {
            let start = hit.point + hit.normal * 0.05;
            let hidden = facing > 0.0 && self.is_hidden(&Ray::new(start, lamp), f32::MAX);
            // Near the table little sky is left.
            let height = 1.0 - 0.45 * (-hit.point.z / 9.0).exp();
            [
                if hidden { 0.0 } else { 1.0 },
                (0.62 + 0.38 * hit.normal.z) * height,
            ]
        };
        // The sheen is that of an eye at rest in the middle, painted on.
        let half = (lamp + towards).normalize();
        let gleam = sheen * hit.normal.dot(half).max(0.0).powi(18) * direct;
        let gray = 255.0 * (albedo * (0.42 * sky + 0.86 * facing * direct) + 0.35 * gleam);
        (gray, direct > 0.0)
    }

    /// Which parts of a picture a solid may be in.
    fn cover(&self, position: f32) -> Cover {
        let mut cover = Cover {
            tiles: vec![false; Cover::COLUMNS * Cover::ROWS],
        };
        for Solid { part, pose, .. } in &self.solids {
            let project = |corner: &Corner| {
                self.camera
                    .project(position, pose.transform_point(corner.position))
            };
            let seen: Vec<Vec2> = part.corners.iter().map(project).collect();
            for (corners, _) in &part.triangles {
                let [a, b, c] = corners.map(|corner| seen[corner as usize]);
                cover.mark(a.min(b).min(c), a.max(b).max(c));
            }
        }
        cover
    }

    /// The picture from a position, in 256ths of a gray level.
    pub(crate) fn picture(&self, position: f32) -> Vec<u16> {
        let (width, height) = (SIZE.width as usize, SIZE.height as usize);
        let cover = self.cover(position);
        let look = |x: f32, y: f32| {
            let hit = self.hit(&self.camera.ray(position, x, y), cover.at(x, y));
            let (gray, lit) = self.gray(&hit);
            Look {
                gray,
                depth: hit.depth,
                surface: hit.surface,
                lit,
            }
        };
        let centres = in_bands(|x, y| look(x as f32, y as f32));
        in_bands(|x, y| {
            let own = &centres[y * width + x];
            let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
            let mut rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
            let is_plain = rows.all(|row| {
                let near = &centres[row * width + left..=row * width + right];
                near.iter().all(|near| own.is_like(near))
            });
            let gray = if is_plain {
                own.gray
            } else {
                let samples = SAMPLES
                    .iter()
                    .map(|&[dx, dy]| look(x as f32 + dx, y as f32 + dy).gray);
                samples.sum::<f32>() / SAMPLES.len() as f32
            };
            (gray.clamp(0.0, 255.0) * 256.0).round() as u16
        })
    }

    /// The truth of view `view` of these positions: for the points that the middles of its pixels see, the disparity
    /// to the next view, and whether no solid hides them from the others.
    pub(crate) fn truth(&self, positions: &[f32], view: usize) -> Truth {
        let width = SIZE.width as f32;
        let cover = self.cover(positions[view]);
        let base = FOCAL * STEP * (positions[1] - positions[0]);
        let seen = in_bands(|x, y| {
            let (x, y) = (x as f32, y as f32);
            let ray = self.camera.ray(positions[view], x, y);
            let Hit { depth, point, .. } = self.hit(&ray, cover.at(x, y));
            let sees = |&position: &f32| {
                let there = self.camera.project(position, point);
                let eye = self.camera.eye(position);
                let is_inside = there.x > -0.5 && there.x < width - 0.5;
                // Up to a little before the point itself.
                let towards = Ray::new(eye, (point - eye) / depth);
                is_inside && !self.is_hidden(&towards, depth * (1.0 - 3e-4))
            };
            let others = positions
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != view);
            (base / depth, others.map(|(_, position)| position).all(sees))
        });
        let (disparity, visible) = seen.into_iter().unzip();
        Truth {
            size: SIZE,
            disparity,
            visible,
        }
    }
}

/// Makes a picture of anything, pixel by pixel, in bands that the machine's cores share.
fn in_bands<T: Send>(make: impl Fn(usize, usize) -> T + Sync) -> Vec<T> {
    const BANDS: usize = 8;
    let (width, height) = (SIZE.width as usize, SIZE.height as usize);
    let band = |band: usize| {
        let rows = height * band / BANDS..height * (band + 1) / BANDS;
        let pixels = rows.flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels.map(|(x, y)| make(x, y)).collect::<Vec<T>>()
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..BANDS).map(|n| scope.spawn(move || band(n))).collect();
        let joined = |worker: std::thread::ScopedJoinHandle<'_, Vec<T>>| {
            worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().flat_map(joined).collect()
    })
}

/// The tiles of a picture that a solid may be in: most of it shows the table, and need not be searched.
#[derive(Clone, Debug)]
struct Cover {
    tiles: Vec<bool>,
}

impl Cover {
    const TILE: f32 = 8.0;
    const COLUMNS: usize = SIZE.width as usize / 8;
    const ROWS: usize = SIZE.height as usize / 8;

    /// Marks the tiles that a box touches, with half a pixel and a little around it.
    fn mark(&mut self, low: Vec2, high: Vec2) {
        let tile =
            |value: f32, count: usize| (value / Self::TILE).clamp(0.0, (count - 1) as f32) as usize;
        let columns = tile(low.x - 1.0, Self::COLUMNS)..=tile(high.x + 1.0, Self::COLUMNS);
        for row in tile(low.y - 1.0, Self::ROWS)..=tile(high.y + 1.0, Self::ROWS) {
            self.tiles[row * Self::COLUMNS..][columns.clone()].fill(true);
        }
    }

    fn at(&self, x: f32, y: f32) -> bool {
        let tile = |value: f32, count: usize| ((value / Self::TILE) as usize).min(count - 1);
        self.tiles[tile(y, Self::ROWS) * Self::COLUMNS + tile(x, Self::COLUMNS)]
    }
}

/// What is seen at one place of a picture.
#[derive(Clone, Copy, Debug)]
struct Look {
    gray: f32,
    depth: f32,
    surface: u32,
    lit: bool,
}

impl Look {
    /// Whether no border runs between this place and the next: neither of a surface, nor of a shadow, nor of depth.
    fn is_like(&self, other: &Self) -> bool {
        const STEP: f32 = 3.0;
        self.surface == other.surface
            && (self.surface == 0
                || self.lit == other.lit && (self.depth - other.depth).abs() < STEP)
    }
}

/// Sixteen places in a pixel, all in different columns and rows, so that an edge in any direction moves the mean in
/// small steps.
const SAMPLES: [[f32; 2]; 16] = {
    // The rows of sixteen rooks that do not threaten each other, spread evenly.
    const ROWS: [u8; 16] = [5, 11, 1, 14, 8, 3, 12, 6, 0, 10, 15, 4, 9, 2, 13, 7];
    let mut samples = [[0.0; 2]; 16];
    let mut i = 0;
    while i < 16 {
        samples[i] = [
            (i as f32 + 0.5) / 16.0 - 0.5,
            (ROWS[i] as f32 + 0.5) / 16.0 - 0.5,
        ];
        i += 1;
    }
    samples
};

/// Directions spread evenly over a disc of this radius around an axis (the sunflower's spiral).
fn directions(count: u32, radius: f32, axis: Vec3) -> Vec<Vec3> {
    let (right, up) = axis.any_orthonormal_pair();
    let direction = |i: u32| {
        let reach = radius * ((i as f32 + 0.5) / count as f32).sqrt();
        let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
        let along = (1.0 - reach * reach).sqrt();
        axis * along + (right * cos + up * sin) * reach
    };
    (0..count).map(direction).collect()
}
