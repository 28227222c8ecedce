//! Least squares over all that was seen: cameras, where they stand, and where the board was held.
//!
//! Levenberg and Marquardt's method on the distances between where corners are seen and where they ought to be. Each place
//! of the board is tied to its own sightings only, so places are eliminated from the normal equations one by one (Schur's
//! complement) and what remains is as small as the rig; after Triggs et al., *Bundle adjustment: a modern synthesis* (2000).

use glam::{DMat3, DQuat, DVec2, DVec3};
use messages::Size;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::Model;
use crate::calibration::{Camera, Lens};

/// Numbers that describe a camera: focal lengths along columns and rows, column and row of the principal point, four
/// coefficients of its lens.
pub(crate) const INTRINSIC: usize = 8;
/// Numbers that a pose may change by: three of its rotation, three of its translation.
const POSE: usize = 6;
/// Rounds of the method, at most.
const MOST_ROUNDS: usize = 100;

/// A change of frames: turned, then shifted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub(crate) turn: DQuat,
    pub(crate) shift: DVec3,
}

impl Pose {
    pub(crate) const NONE: Self = Self {
        turn: DQuat::IDENTITY,
        shift: DVec3::ZERO,
    };

    pub(crate) fn of(self, point: DVec3) -> DVec3 {
        self.turn * point + self.shift
    }

    /// First the other, then this.
    pub(crate) fn after(self, other: Self) -> Self {
        Self {
            turn: (self.turn * other.turn).normalize(),
            shift: self.of(other.shift),
        }
    }

    pub(crate) fn inverse(self) -> Self {
        let turn = self.turn.inverse();
        Self {
            turn,
            shift: -(turn * self.shift),
        }
    }

    /// Changed by a small rotation, seen from where it leads to, and translation.
    fn changed(self, by: &[f64]) -> Self {
        let turn = DQuat::from_scaled_axis(DVec3::new(by[0], by[1], by[2]));
        Self {
            turn: (turn * self.turn).normalize(),
            shift: self.shift + DVec3::new(by[3], by[4], by[5]),
        }
    }
}

/// What is looked for.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    pub(crate) intrinsics: Vec<[f64; INTRINSIC]>,
    /// From the first camera's frame to each one's.
    pub(crate) mounts: Vec<Pose>,
    /// From the board's frame to the first camera's, of each shot.
    pub(crate) boards: Vec<Pose>,
}

/// A corner that a camera saw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub(crate) camera: usize,
    pub(crate) shot: usize,
    /// On the board, in metres.
    pub(crate) point: DVec3,
    /// In the image, in pixels.
    pub(crate) at: DVec2,
}

/// The task.
#[derive(Clone, Debug)]
pub(crate) struct Task<'a> {
    pub(crate) model: Model,
    pub(crate) sizes: &'a [Size],
    pub(crate) seen: &'a [Seen],
    /// Which of the numbers that describe a camera may change.
    pub(crate) free: [bool; INTRINSIC],
}

/// How sure the numbers that describe the cameras are, as standard deviations.
pub(crate) type Sure = Vec<[f64; INTRINSIC]>;

/// Of one corner, how its place in the image changes.
struct Derivatives {
    seen: DVec2,
    /// By row: with the camera's numbers, its mount and the board's place.
    intrinsic: [[f64; INTRINSIC]; 2],
    mount: [[f64; POSE]; 2],
    board: [[f64; POSE]; 2],
}

/// A camera, and the same with each coefficient of its lens a little more and a little less.
struct Varied {
    camera: Camera,
    around: [[Camera; 2]; 4],
}

const A_LITTLE: f64 = 1e-5;

/// The camera that these numbers describe.
pub(crate) fn camera(model: Model, size: Size, numbers: &[f64; INTRINSIC]) -> Camera {
    let [fx, fy, cx, cy, a, b, c, d] = *numbers;
    let lens = match model {
        Model::Radtan => Lens::Rational {
            radial: [a, b, 0.0, 0.0, 0.0, 0.0],
            tangential: [c, d],
        },
        Model::Equidistant => Lens::Equidistant([a, b, c, d]),
    };
    Camera::new(Some(size), [fx, fy], [cx, cy], lens)
}

impl Varied {
    fn new(model: Model, size: Size, numbers: &[f64; INTRINSIC]) -> Self {
        let of = |index: usize, by: f64| {
            let mut varied = *numbers;
            varied[4 + index] += by;
            camera(model, size, &varied)
        };
        Self {
            camera: camera(model, size, numbers),
            around: [0, 1, 2, 3].map(|index| [of(index, A_LITTLE), of(index, -A_LITTLE)]),
        }
    }

    fn derivatives(&self, mount: Pose, board: Pose, point: DVec3) -> Option<Derivatives> {
        let turned = board.turn * point;
        let mounted = mount.turn * (turned + board.shift);
        let ray = mounted + mount.shift;
        let seen = self.camera.place(ray)?;
        let step = 1e-6 * ray.length();
        let mut by_ray = [DVec3::ZERO; 2];
        for (axis, way) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            let ahead = self.camera.place(ray + way * step)?;
            let behind = self.camera.place(ray - way * step)?;
            let slope = (ahead - behind) / (2.0 * step);
            by_ray[0][axis] = slope.x;
            by_ray[1][axis] = slope.y;
        }
        let mut intrinsic = [[0.0; INTRINSIC]; 2];
        for axis in 0..2 {
            let centre = self.camera.centre[axis];
            intrinsic[axis][axis] = (seen[axis] - centre) / self.camera.focal[axis];
            intrinsic[axis][2 + axis] = 1.0;
        }
        for (index, [more, less]) in self.around.iter().enumerate() {
            let slope = (more.place(ray)? - less.place(ray)?) / (2.0 * A_LITTLE);
            intrinsic[0][4 + index] = slope.x;
            intrinsic[1][4 + index] = slope.y;
        }
        let row = |around: DVec3, along: DVec3| {
            let turn = around.cross(along);
            [turn.x, turn.y, turn.z, along.x, along.y, along.z]
        };
        let back = mount.turn.inverse();
        Some(Derivatives {
            seen,
            intrinsic,
            mount: by_ray.map(|along| row(mounted, along)),
            board: by_ray.map(|along| row(turned, back * along)),
        })
    }
}

/// The normal equations, places of the board apart.
struct Normal {
    rig: DMatrix<f64>,
    rig_side: DVector<f64>,
    /// Of each shot.
    boards: Vec<Block>,
}

struct Block {
    own: SMatrix<f64, POSE, POSE>,
    side: SVector<f64, POSE>,
    /// With the rig's numbers.
    shared: DMatrix<f64>,
}

impl Task<'_> {
    /// Numbers of the rig that may change: of each camera the free ones, and its mount unless it is the first.
    fn layout(&self, cameras: usize) -> (Vec<usize>, usize) {
        let free = self.free.iter().filter(|&&free| free).count();
        let mut starts = Vec::with_capacity(cameras);
        let mut next = 0;
        for camera in 0..cameras {
            starts.push(next);
            next += free + if camera == 0 { 0 } else { POSE };
        }
        (starts, next)
    }

    fn cameras(&self, estimate: &Estimate) -> Vec<Camera> {
        let each = estimate.intrinsics.iter().zip(self.sizes);
        each.map(|(numbers, size)| camera(self.model, *size, numbers))
            .collect()
    }

    /// By how much each corner is seen elsewhere than it ought to be, in pixels; `None` where it could not be seen at all.
    pub(crate) fn misses(&self, estimate: &Estimate) -> Vec<Option<DVec2>> {
        let cameras = self.cameras(estimate);
        let miss = |seen: &Seen| {
            let at = estimate.boards[seen.shot].of(seen.point);
            let ray = estimate.mounts[seen.camera].of(at);
            Some(cameras[seen.camera].place(ray)? - seen.at)
        };
        self.seen.iter().map(miss).collect()
    }

    /// The sum of squares, in square pixels; infinite where a corner could not be seen at all.
    pub(crate) fn cost(&self, estimate: &Estimate) -> f64 {
        let misses = self.misses(estimate).into_iter();
        misses
            .map(|miss| miss.map_or(f64::INFINITY, DVec2::length_squared))
            .sum()
    }

    fn normal(&self, estimate: &Estimate) -> Option<Normal> {
        let cameras = estimate.intrinsics.len();
        let (starts, count) = self.layout(cameras);
        let each = estimate.intrinsics.iter().zip(self.sizes);
        let varied: Vec<Varied> = each
            .map(|(numbers, size)| Varied::new(self.model, *size, numbers))
            .collect();
        let block = || Block {
            own: SMatrix::zeros(),
            side: SVector::zeros(),
            shared: DMatrix::zeros(POSE, count),
        };
        let mut normal = Normal {
            rig: DMatrix::zeros(count, count),
            rig_side: DVector::zeros(count),
            boards: estimate.boards.iter().map(|_| block()).collect(),
        };
        let mut row: Vec<f64> = Vec::with_capacity(INTRINSIC + POSE);
        for seen in self.seen {
            let mount = estimate.mounts[seen.camera];
            let board = estimate.boards[seen.shot];
            let all = varied[seen.camera].derivatives(mount, board, seen.point)?;
            let start = starts[seen.camera];
            let place = &mut normal.boards[seen.shot];
            for axis in 0..2 {
                let miss = all.seen[axis] - seen.at[axis];
                row.clear();
                let numbers = all.intrinsic[axis].iter().zip(self.free);
                row.extend(numbers.filter(|(_, free)| *free).map(|(slope, _)| slope));
                if seen.camera > 0 {
                    row.extend(all.mount[axis]);
                }
                let own = SVector::<f64, POSE>::from(all.board[axis]);
                place.own += own * own.transpose();
                place.side -= own * miss;
                for (i, a) in row.iter().enumerate() {
                    for (j, b) in row.iter().enumerate() {
                        normal.rig[(start + i, start + j)] += a * b;
                    }
                    normal.rig_side[start + i] -= a * miss;
                    for (j, b) in all.board[axis].iter().enumerate() {
                        place.shared[(j, start + i)] += a * b;
                    }
                }
            }
        }
        Some(normal)
    }

    /// The best estimate near this one.
    pub(crate) fn solve(&self, from: Estimate) -> Estimate {
        let mut best = from;
        let mut cost = self.cost(&best);
        let mut damping = 1e-3;
        for _ in 0..MOST_ROUNDS {
            let Some(normal) = self.normal(&best) else {
                break;
            };
            let before = cost;
            while damping < 1e12 {
                let tried = normal.step(damping).map(|step| self.changed(&best, &step));
                let now = tried.as_ref().map_or(f64::INFINITY, |t| self.cost(t));
                if let Some(tried) = tried.filter(|_| now < cost) {
                    (best, cost) = (tried, now);
                    damping = (damping / 10.0_f64).max(1e-12);
                    break;
                }
                damping *= 10.0;
            }
            // Nothing better was found, or nothing that matters.
            if before - cost <= 1e-9 * before {
                break;
            }
        }
        best
    }

    fn changed(&self, estimate: &Estimate, (rig, boards): &Step) -> Estimate {
        let (starts, _) = self.layout(estimate.intrinsics.len());
        let mut changed = estimate.clone();
        for (camera, &start) in starts.iter().enumerate() {
            let mut next = start;
            let numbers = changed.intrinsics[camera].iter_mut().zip(self.free);
            for (number, _) in numbers.filter(|(_, free)| *free) {
                *number += rig[next];
                next += 1;
            }
            if camera > 0 {
                changed.mounts[camera] =
                    changed.mounts[camera].changed(&rig.as_slice()[next..next + POSE]);
            }
        }
        for (board, by) in changed.boards.iter_mut().zip(boards) {
            *board = board.changed(by.as_slice());
        }
        changed
    }

    /// How sure the cameras' numbers are, by the curvature of the sum of squares and what remains of it; numbers that may
    /// not change are sure. `None` where something is not determined.
    pub(crate) fn sure(&self, estimate: &Estimate) -> Option<Sure> {
        let normal = self.normal(estimate)?;
        let (starts, count) = self.layout(estimate.intrinsics.len());
        let places = normal.boards.iter().filter(|board| board.is_seen()).count();
        let freedom = (2 * self.seen.len()).checked_sub(count + POSE * places)?;
        let variance = self.cost(estimate) / freedom.max(1) as f64;
        let covariance = normal.reduced(0.0)?.0.try_inverse()?;
        let each = starts.iter().map(|&start| {
            let mut sure = [0.0; INTRINSIC];
            let numbers = sure.iter_mut().zip(self.free).filter(|(_, free)| *free);
            for ((sure, _), at) in numbers.zip(start..) {
                *sure = (variance * covariance[(at, at)].max(0.0)).sqrt();
            }
            sure
        });
        Some(each.collect())
    }
}

/// By how much the rig's numbers and each place of the board are to change.
type Step = (DVector<f64>, Vec<SVector<f64, POSE>>);

impl Normal {
    /// What remains for the rig's numbers when the places of the board are eliminated.
    fn reduced(&self, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let mut left = damped(&self.rig, damping);
        let mut right = self.rig_side.clone();
        for block in &self.boards {
            let inverse = block.inverse(damping)?;
            let through = block.shared.transpose() * inverse;
            left -= &through * &block.shared;
            right -= through * block.side;
        }
        Some((left, right))
    }

    fn step(&self, damping: f64) -> Option<Step> {
        let (left, right) = self.reduced(damping)?;
        let rig = left.cholesky()?.solve(&right);
        let boards: Option<Vec<_>> = self
            .boards
            .iter()
            .map(|block| {
                let side = block.side - &block.shared * &rig;
                Some(block.inverse(damping)? * side)
            })
            .collect();
        Some((rig, boards?))
    }
}

impl Block {
    /// The inverse of its own part; nothing where the board was not seen, whose place then stays.
    fn inverse(&self, damping: f64) -> Option<SMatrix<f64, POSE, POSE>> {
        if !self.is_seen() {
            return Some(SMatrix::zeros());
        }
        let mut own = self.own;
        for i in 0..POSE {
            own[(i, i)] *= 1.0 + damping;
        }
        own.try_inverse()
    }

    fn is_seen(&self) -> bool {
        self.own.trace() > 0.0
    }
}

fn damped(matrix: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut matrix = matrix.clone();
    for i in 0..matrix.nrows() {
        matrix[(i, i)] *= 1.0 + damping;
    }
    matrix
}

/// The place of a board whose corners, in metres, are seen in these directions (x/z, y/z): by the homography between
/// them (Zhang 2000).
pub(crate) fn board_from(points: &[(DVec3, DVec2)]) -> Option<Pose> {
    if points.len() < 4 {
        return None;
    }
    let count = points.len() as f64;
    let middle = points.iter().map(|(point, _)| *point).sum::<DVec3>() / count;
    let spread = points
        .iter()
        .map(|(p, _)| (*p - middle).length())
        .sum::<f64>()
        / count;
    let mut squares = SMatrix::<f64, 9, 9>::zeros();
    for (point, seen) in points {
        let on = (*point - middle) / spread;
        let (x, y) = (on.x, on.y);
        let rows = [
            [x, y, 1.0, 0.0, 0.0, 0.0, -seen.x * x, -seen.x * y, -seen.x],
            [0.0, 0.0, 0.0, x, y, 1.0, -seen.y * x, -seen.y * y, -seen.y],
        ];
        for row in rows {
            let row = SVector::<f64, 9>::from(row);
            squares += row * row.transpose();
        }
    }
    let eigen = squares.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let h = eigen.eigenvectors.column(least);
    let column = |i: usize| DVec3::new(h[i], h[3 + i], h[6 + i]);
    let scale = (column(0).length() + column(1).length()) / 2.0;
    // Before the camera, not behind it.
    let scale = scale.copysign(column(2).z);
    let (x, y) = (column(0) / scale, column(1) / scale);
    let turn = nearest_rotation(DMat3::from_cols(x, y, x.cross(y)))?;
    // The columns belong to a board in units of its spread around its middle.
    let shift = column(2) / scale * spread - turn * middle;
    (shift.is_finite() && turn.is_finite()).then_some(Pose { turn, shift })
}

fn nearest_rotation(matrix: DMat3) -> Option<DQuat> {
    let own = nalgebra::Matrix3::from_column_slice(&matrix.to_cols_array());
    if own.iter().any(|number| !number.is_finite()) {
        return None;
    }
    let parts = own.svd(true, true);
    let rotation = parts.u? * parts.v_t?;
    let rotation = DMat3::from_cols_slice(rotation.as_slice());
    (rotation.determinant() > 0.0).then(|| DQuat::from_mat3(&rotation).normalize())
}
