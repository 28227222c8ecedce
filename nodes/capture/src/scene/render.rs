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
/// Focal length in pixels of a camera that is given none.
pub(crate) const FOCAL: f32 = 700.0;
/// Column and row of the principal point.
pub(crate) const CENTRE: [f32; 2] = [255.5, 239.5];
/// Millimetres between neighbouring positions of a camera that is given none.
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
    /// Focal length in pixels.
    focal: f32,
    /// Millimetres between neighbouring positions.
    step: f32,
    /// Rows by which each position's picture lies lower than it should.
    rows_lower: [f32; 3],
    /// Standard deviation of the blur of lens and sensor, in pixels, beside that of a pixel's own width.
    blur: f32,
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
            focal: FOCAL,
            step: STEP,
            rows_lower: [0.0; 3],
            blur: 0.0,
        }
    }

    /// The same camera with so many pixels of focal length, steps of so many millimetres and a blur of so many pixels.
    pub(crate) fn with(self, focal: f32, step: f32, blur: f32) -> Self {
        Self {
            focal,
            step,
            blur,
            ..self
        }
    }

    /// The same camera whose pictures lie so many rows lower than they should.
    pub(crate) fn out_of_line(self, rows_lower: [f32; 3]) -> Self {
        Self { rows_lower, ..self }
    }

    fn eye(&self, position: f32) -> Vec3 {
        self.middle + Vec3::X * (position - MIDDLE) * self.step
    }

    /// Column and row of the principal point.
    fn centre(&self, position: f32) -> [f32; 2] {
        let lower = self.rows_lower.get(position as usize);
        [CENTRE[0], CENTRE[1] + lower.copied().unwrap_or_default()]
    }

    /// The ray through a place of the picture; one unit of it is one millimetre of depth.
    fn ray(&self, position: f32, x: f32, y: f32) -> Ray {
        let centre = self.centre(position);
        let right = (x - centre[0]) / self.focal;
        let down = (y - centre[1]) / self.focal;
        Ray::new(
            self.eye(position),
            self.forward + Vec3::X * right + self.down * down,
        )
    }

    /// The place of the picture where a point is seen.
    fn project(&self, position: f32, point: Vec3) -> Vec2 {
        let from = point - self.eye(position);
        let depth = from.dot(self.forward);
        Vec2::new(from.x, from.dot(self.down)) * (self.focal / depth)
            + Vec2::from(self.centre(position))
    }
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Along the optical axis, in millimetres.
    pub(super) depth: f32,
    point: Vec3,
    pub(super) normal: Vec3,
    place: Vec3,
    /// 0 is the table.
    pub(super) surface: u32,
    paint: Paint,
}

/// Light on the table: what reaches it past the solids, on a square grid.
#[derive(Clone, Debug, Default)]
struct Light {
    /// Cells along each side of the grid.
    cells: usize,
    /// Shares of the lamp and of the sky.
    shares: Vec<[f32; 2]>,
}

impl Light {
    const CELLS: usize = 144;
    /// Cells where a penumbra is to be smooth: about one a pixel.
    const FINE_CELLS: usize = 720;
    /// The grid reaches this many millimetres to each side of the origin.
    const REACH: f32 = 180.0;

    /// Cells in a millimetre.
    fn per_mm(cells: usize) -> f32 {
        (cells - 1) as f32 / (2.0 * Self::REACH)
    }

    /// A place of a grid, just above the table.
    fn place(cells: usize, i: usize) -> Vec3 {
        let (column, row) = ((i % cells) as f32, (i / cells) as f32);
        let per_mm = Self::per_mm(cells);
        Vec3::new(
            column / per_mm - Self::REACH,
            row / per_mm - Self::REACH,
            1e-3,
        )
    }

    /// The light where it is known, and around that, two cells far, the mean of what is beside: what lies under a solid
    /// must not darken the table next to it.
    fn grown(cells: usize, mut shares: Vec<Option<[f32; 2]>>) -> Self {
        for _ in 0..2 {
            let known = shares.clone();
            for (i, share) in shares
                .iter_mut()
                .enumerate()
                .filter(|(_, share)| share.is_none())
            {
                let (column, row) = (i % cells, i / cells);
                let rows = row.saturating_sub(1)..(row + 2).min(cells);
                let columns = column.saturating_sub(1)..(column + 2).min(cells);
                let beside =
                    rows.flat_map(|row| known[row * cells..][columns.clone()].iter().flatten());
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
            cells,
            shares: softened(&softened(&shares, 1), cells),
        }
    }

    /// The shares at a point of the table; beyond the grid nothing is in the way.
    fn at(&self, point: Vec3) -> [f32; 2] {
        let per_mm = Self::per_mm(self.cells);
        let (x, y) = (
            (point.x + Self::REACH) * per_mm,
            (point.y + Self::REACH) * per_mm,
        );
        let last = (self.cells - 1) as f32;
        if !(0.0..last).contains(&x) || !(0.0..last).contains(&y) {
            return [1.0; 2];
        }
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x.fract(), y.fract());
        let cell = |i: usize, j: usize| self.shares[(row + j) * self.cells + column + i];
        [0, 1].map(|k| {
            let along = |j| cell(0, j)[k] + (cell(1, j)[k] - cell(0, j)[k]) * fx;
            along(0) + (along(1) - along(0)) * fy
        })
    }
}

/// The lamp: a disc, as seen from everywhere.
#[derive(Clone, Debug)]
struct Lamp {
    towards: Vec3,
    /// Half its width, as the sine of an angle.
    radius: f32,
    /// Towards points of the disc, spread evenly.
    directions: Vec<Vec3>,
    /// Whether solids are lit by the whole disc, and not by its middle alone.
    is_soft: bool,
}

impl Lamp {
    fn new(towards: Vec3, radius: f32, count: u32, is_soft: bool) -> Self {
        let towards = towards.normalize();
        Self {
            towards,
            radius,
            directions: directions(count, radius, towards),
            is_soft,
        }
    }
}

/// What of the lamp's light a surface gets.
#[derive(Clone, Copy, Debug)]
struct Direct {
    /// How much it faces what it sees of the lamp: the cosine, on the average.
    facing: f32,
    /// Share of the lamp that is seen from there.
    share: f32,
    /// Share of what it faces of the lamp that something hides.
    hidden: f32,
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
    lamp: Lamp,
    light: Light,
}

impl Scene {
    /// Where the lamp is.
    const LAMP: Vec3 = Vec3::new(-0.52, -0.30, 0.80);
    /// The sky's share of the light, beside [`FULL`](Self::FULL) of the lamp's.
    const SKY: f32 = 0.42;
    const FULL: f32 = 0.86;

    pub(crate) fn new(camera: Camera, table: Paint) -> Self {
        Self {
            camera,
            table,
            solids: Vec::new(),
            surfaces: 1,
            lamp: Lamp::new(Self::LAMP, 0.10, 20, false),
            light: Light::default(),
        }
    }

    /// The same scene in the light of a wide lamp: shadows have soft borders, on solids too.
    pub(crate) fn in_soft_light(self, towards: Vec3, radius: f32) -> Self {
        Self {
            lamp: Lamp::new(towards, radius, 64, true),
            ..self
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
        // Few directions leave rays on the table that its own grain must cover.
        let count = if self.lamp.is_soft { 96 } else { 16 };
        let sky = directions(count, 0.95, Vec3::Z);
        let shares = (0..Light::CELLS * Light::CELLS).map(|i| {
            let point = Light::place(Light::CELLS, i);
            // Under a solid there is no table to be seen.
            (!self.is_inside(point)).then(|| {
                [
                    self.free(point, &self.lamp.directions),
                    self.free(point, &sky),
                ]
            })
        });
        let shares: Vec<Option<[f32; 2]>> = shares.collect();
        self.light = match self.lamp.is_soft {
            true => self.refined(shares),
            false => Light::grown(Light::CELLS, shares),
        };
        self
    }

    /// The share of these directions from a point in which nothing is in the way.
    fn free(&self, point: Vec3, all: &[Vec3]) -> f32 {
        let is_free = |&&direction: &&Vec3| !self.is_hidden(&Ray::new(point, direction), f32::MAX);
        all.iter().filter(is_free).count() as f32 / all.len() as f32
    }

    /// The light on a finer grid: the lamp's is looked at again where cells of the coarse one differ.
    fn refined(&self, coarse: Vec<Option<[f32; 2]>>) -> Light {
        let (cells, ratio) = (
            Light::FINE_CELLS,
            Light::per_mm(Light::CELLS) / Light::per_mm(Light::FINE_CELLS),
        );
        let smooth = Light::grown(Light::CELLS, coarse.clone());
        let share = |i: usize| {
            let point = Light::place(cells, i);
            let [column, row] = [i % cells, i / cells].map(|cell| (cell as f32 * ratio) as usize);
            // A cell more on every side: what is thin may fall between four.
            let near = (row.saturating_sub(1)..(row + 3).min(Light::CELLS)).flat_map(|row| {
                let columns = column.saturating_sub(1)..(column + 3).min(Light::CELLS);
                &coarse[row * Light::CELLS..][columns]
            });
            let mut lamps = near.map(|share| share.map(|[lamp, _]| lamp));
            let first = lamps.next().flatten();
            let lamp = match first.filter(|_| lamps.all(|lamp| lamp == first)) {
                Some(lamp) => lamp,
                None if self.is_inside(point) => return None,
                None => self.free(point, &self.lamp.directions),
            };
            Some([lamp, smooth.at(point)[1]])
        };
        Light::grown(cells, (0..cells * cells).map(share).collect())
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

    /// What of the lamp's light a place of a solid gets.
    fn direct(&self, hit: &Hit) -> Direct {
        let Lamp {
            towards,
            radius,
            directions,
            is_soft,
        } = &self.lamp;
        let start = hit.point + hit.normal * 0.05;
        let sees = |direction: Vec3| !self.is_hidden(&Ray::new(start, direction), f32::MAX);
        let facing = hit.normal.dot(*towards);
        if !is_soft {
            // What is turned away gets nothing, and is no shadow.
            let share = if facing > 0.0 && !sees(*towards) {
                0.0
            } else {
                1.0
            };
            return Direct {
                facing: facing.max(0.0),
                share,
                hidden: 1.0 - share,
            };
        }
        let (mut sum, mut faced, mut seen) = (0.0, 0, 0);
        if facing > -radius {
            for &direction in directions {
                let facing = hit.normal.dot(direction);
                if facing > 0.0 {
                    faced += 1;
                    if sees(direction) {
                        sum += facing;
                        seen += 1;
                    }
                }
            }
        }
        Direct {
            facing: sum / seen.max(1) as f32,
            share: seen as f32 / directions.len() as f32,
            hidden: match faced {
                0 => 0.0,
                _ => 1.0 - seen as f32 / faced as f32,
            },
        }
    }

    /// The gray level, 0 to 255, of a place of a surface, and the share of the lamp that reaches it. Nothing here
    /// depends on the view.
    pub(super) fn gray(&self, hit: &Hit) -> (f32, f32) {
        let lamp = self.lamp.towards;
        let towards = (self.camera.middle - hit.point).normalize();
        let Finish { albedo, sheen, .. } = self.finish(hit);
        let (direct, sky) = if hit.surface == 0 {
            let [share, sky] = self.light.at(hit.point);
            let direct = Direct {
                facing: hit.normal.dot(lamp).max(0.0),
                share,
                hidden: 1.0 - share,
            };
            (direct, sky)
        } else {
            // Near the table little sky is left.
            let height = 1.0 - 0.45 * (-hit.point.z / 9.0).exp();
            (self.direct(hit), (0.62 + 0.38 * hit.normal.z) * height)
        };
        // The sheen is that of an eye at rest in the middle, painted on.
        let half = (lamp + towards).normalize();
        let gleam = sheen * hit.normal.dot(half).max(0.0).powi(18) * direct.share;
        let lit = Self::SKY * sky + Self::FULL * direct.facing * direct.share;
        let gray = 255.0 * (albedo * lit + 0.35 * gleam);
        (gray, direct.share)
    }

    /// What a place of a picture shows.
    pub(super) fn seen(&self, position: f32, x: f32, y: f32, cover: &Cover) -> Hit {
        self.hit(&self.camera.ray(position, x, y), cover.at(x, y))
    }

    /// How a place of a surface answers to light.
    pub(super) fn finish(&self, hit: &Hit) -> Finish {
        let towards = (self.camera.middle - hit.point).normalize();
        let detail = self.camera.focal / hit.depth * hit.normal.dot(towards).max(0.15);
        (hit.paint)(hit.place, detail)
    }

    /// Whether a shadow falls on a place of a surface: at least half of what it faces of the lamp is hidden. What is
    /// turned away is in none.
    pub(super) fn is_in_shadow(&self, hit: &Hit) -> bool {
        let hidden = match hit.surface {
            0 => 1.0 - self.light.at(hit.point)[0],
            _ => self.direct(hit).hidden,
        };
        hidden >= 0.5
    }

    /// Which solid a surface is of, counted from 1; 0 is the table.
    pub(super) fn solid_of(&self, surface: u32) -> u32 {
        let before = self.solids.iter().filter(|s| s.first_surface <= surface);
        before.count() as u32
    }

    /// Where a picture taken elsewhere shows what this one shows at a place and depth.
    pub(super) fn moved(&self, from: f32, to: f32, x: f32, y: f32, depth: f32) -> Vec2 {
        let point = self.camera.ray(from, x, y).point_at(depth);
        self.camera.project(to, point)
    }

    /// The disparity of a depth, between neighbours of these positions.
    pub(super) fn disparity(&self, positions: &[f32], depth: f32) -> f32 {
        self.camera.focal * self.camera.step * (positions[1] - positions[0]) / depth
    }

    /// Which parts of a picture a solid may be in.
    pub(super) fn cover(&self, position: f32) -> Cover {
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
            let hit = self.seen(position, x, y, &cover);
            let (gray, lamp) = self.gray(&hit);
            Look {
                gray,
                depth: hit.depth,
                surface: hit.surface,
                lamp,
            }
        };
        let centres = in_bands(|x, y| look(x as f32, y as f32));
        let clean = in_bands(|x, y| {
            let own = &centres[y * width + x];
            let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
            let mut rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
            let is_plain = rows.all(|row| {
                let near = &centres[row * width + left..=row * width + right];
                near.iter().all(|near| own.is_like(near))
            });
            if is_plain {
                own.gray
            } else {
                let samples = SAMPLES
                    .iter()
                    .map(|&[dx, dy]| look(x as f32 + dx, y as f32 + dy).gray);
                samples.sum::<f32>() / SAMPLES.len() as f32
            }
        });
        let taken = match self.camera.blur > 0.0 {
            true => blurred(&clean, self.camera.blur),
            false => clean,
        };
        let levels = taken
            .into_iter()
            .map(|gray| (gray.clamp(0.0, 255.0) * 256.0).round() as u16);
        levels.collect()
    }

    /// The truth of view `view` of these positions: for the points that the middles of its pixels see, the disparity
    /// to the next view, and whether no solid hides them from the others.
    pub(crate) fn truth(&self, positions: &[f32], view: usize) -> Truth {
        let (width, height) = (SIZE.width as f32, SIZE.height as f32);
        let cover = self.cover(positions[view]);
        let seen = in_bands(|x, y| {
            let Hit { depth, point, .. } = self.seen(positions[view], x as f32, y as f32, &cover);
            let sees = |&position: &f32| {
                let there = self.camera.project(position, point);
                let eye = self.camera.eye(position);
                let is_inside = there.x > -0.5
                    && there.x < width - 0.5
                    && there.y > -0.5
                    && there.y < height - 0.5;
                // Up to a little before the point itself.
                let towards = Ray::new(eye, (point - eye) / depth);
                is_inside && !self.is_hidden(&towards, depth * (1.0 - 3e-4))
            };
            let others = positions
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != view);
            let disparity = self.disparity(positions, depth);
            (disparity, others.map(|(_, position)| position).all(sees))
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
pub(super) fn in_bands<T: Send>(make: impl Fn(usize, usize) -> T + Sync) -> Vec<T> {
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

/// A picture seen through a lens that blurs: a Gaussian of this deviation in pixels. Beyond its sides it goes on as its
/// last row and column.
fn blurred(picture: &[f32], deviation: f32) -> Vec<f32> {
    let reach = (4.0 * deviation).ceil() as isize;
    let weights = (-reach..=reach).map(|away| (-0.5 * (away as f32 / deviation).powi(2)).exp());
    let weights: Vec<f32> = weights.collect();
    let whole: f32 = weights.iter().sum();
    let (width, height) = (SIZE.width as usize, SIZE.height as usize);
    let near = |at: usize, count: usize| {
        let place = move |away: isize| at.saturating_add_signed(away).min(count - 1);
        (-reach..=reach).map(place).zip(&weights)
    };
    let across = in_bands(|x, y| {
        let sum: f32 = near(x, width)
            .map(|(x, weight)| picture[y * width + x] * weight)
            .sum();
        sum / whole
    });
    in_bands(|x, y| {
        let sum: f32 = near(y, height)
            .map(|(y, weight)| across[y * width + x] * weight)
            .sum();
        sum / whole
    })
}

/// The tiles of a picture that a solid may be in: most of it shows the table, and need not be searched.
#[derive(Clone, Debug)]
pub(super) struct Cover {
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
    /// Share of the lamp that reaches it.
    lamp: f32,
}

impl Look {
    /// Whether no sharp border runs between this place and the next: neither of a surface, nor of a shadow, nor of depth.
    fn is_like(&self, other: &Self) -> bool {
        const STEP: f32 = 3.0;
        /// Of the lamp: what is between is a penumbra, which is sampled finely enough as it is.
        const MUCH: f32 = 0.25;
        self.surface == other.surface
            && (self.surface == 0
                || (self.lamp - other.lamp).abs() < MUCH && (self.depth - other.depth).abs() < STEP)
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
