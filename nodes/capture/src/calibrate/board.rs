//! The board that is held before the cameras, and where its corners are in an image.
//!
//! Corners are found and numbered by the crate `calib-targets`; where exactly each lies is found here, as the point on which
//! all gradients around it are perpendicular to the way there (Förstner and Gülch 1987): the found ones are good to a tenth
//! of a pixel, those to a few hundredths.

use std::collections::BTreeMap;

use calib_targets_charuco::{
    CharucoBoardSpec, CharucoDetector, CharucoParams, ChessCorner, GrayImageView,
    resolve_dictionary,
};
use calib_targets_chessboard::{
    ChessboardDetector, ChessboardParams, default_chess_config, detect_corners,
};
use glam::{DMat3, DQuat, DVec2, DVec3};
use messages::Size;

use super::solve::Pose;

/// Most corners that a board may have along a side.
const MOST_CORNERS: u32 = 100;
/// Corners of an image that tell where the board is.
const LEAST_CORNERS: usize = 8;
/// Of them, how many must lie beside the row or column that has most.
const LEAST_BESIDE: usize = 3;
/// Pixels beside a corner that are looked at, at most and at least; in between a part of the distance to the next corner.
const WINDOW: [f64; 2] = [8.0, 2.0];
const WINDOW_PART: f64 = 0.3;
/// Pixels that a corner may move when it is found exactly, before it is another one.
const MOST_MOVE: f64 = 1.5;

/// A flat board of black and white squares.
#[derive(Clone, Debug)]
pub struct Board {
    /// Inner corners along its rows and its columns.
    corners: [u32; 2],
    /// Side of a square, in metres.
    square_m: f64,
    markers: Option<Markers>,
}

/// What is printed in a ChArUco board's white squares.
#[derive(Clone, Debug)]
struct Markers {
    name: String,
    spec: CharucoBoardSpec,
}

/// A corner of the board: its column and row, from 0.
pub(crate) type Corner = [u32; 2];

/// The corners seen in one image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sighting {
    /// Column and row in the image, in pixels; the middle of the first pixel is at 0.
    pub(crate) corners: BTreeMap<Corner, DVec2>,
    /// How many were found, those that are not sharp with them.
    pub(crate) found: usize,
}

impl Sighting {
    /// How many corners are seen.
    pub fn count(&self) -> usize {
        self.corners.len()
    }

    /// Whether it has enough corners, in more than one row and column, to tell where the board is.
    pub(crate) fn tells_a_place(&self) -> bool {
        let most = |along: usize| {
            let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
            let places = self.corners.keys().map(|corner| corner[along]);
            places.for_each(|place| *counts.entry(place).or_default() += 1);
            counts.into_values().max().unwrap_or_default()
        };
        let beside = self.count() - most(0).max(most(1));
        self.count() >= LEAST_CORNERS && beside >= LEAST_BESIDE
    }

    /// The corners: column and row on the board, column and row in the image.
    pub fn corners(&self) -> impl Iterator<Item = ([u32; 2], [f64; 2])> {
        self.corners
            .iter()
            .map(|(&corner, at)| (corner, at.to_array()))
    }
}

impl Board {
    /// A chessboard with so many inner corners along its rows and its columns, of squares of this side in metres.
    ///
    /// # Errors
    /// Counts or lengths out of range, in a sentence.
    pub fn chessboard(corners: [u32; 2], square_m: f64) -> Result<Self, String> {
        let [columns, rows] = corners;
        if columns.min(rows) < 3 || columns.max(rows) > MOST_CORNERS {
            return Err(format!(
                "a board of {columns}x{rows} inner corners cannot be used; expected are 3 to {MOST_CORNERS} each way, counted where four squares meet"
            ));
        }
        if !(square_m > 0.0 && square_m <= 10.0) {
            return Err(format!(
                "a square of {square_m} m cannot be; give its side in metres, as 0.025"
            ));
        }
        Ok(Self {
            corners,
            square_m,
            markers: None,
        })
    }

    /// A ChArUco board of so many squares along its rows and its columns, of this side in metres, with markers of another
    /// side, of a dictionary by OpenCV's name. The first square is black, as OpenCV draws it since 4.6.
    ///
    /// # Errors
    /// Counts, lengths or a dictionary that cannot be, in a sentence.
    pub fn charuco(
        squares: [u32; 2],
        square_m: f64,
        marker_m: f64,
        dictionary: &str,
    ) -> Result<Self, String> {
        let [columns, rows] = squares;
        if columns.min(rows) < 4 {
            return Err(format!(
                "a ChArUco board of {columns}x{rows} squares cannot be used; expected are at least 4 each way, squares and not corners"
            ));
        }
        let plain = Self::chessboard([columns - 1, rows - 1], square_m)?;
        if !(marker_m > 0.0 && marker_m < square_m) {
            return Err(format!(
                "a marker of {marker_m} m does not fit into a square of {square_m} m; give both sides in metres"
            ));
        }
        let known = resolve_dictionary(dictionary).ok_or_else(|| {
            format!(
                "there is no dictionary {dictionary:?}; known are OpenCV's, as DICT_4X4_50, DICT_5X5_250, DICT_6X6_1000 or DICT_APRILTAG_36h11"
            )
        })?;
        let ratio = (marker_m / square_m) as f32;
        let spec = CharucoBoardSpec::new(rows, columns, square_m as f32, ratio, known);
        // Says, among other things, whether the dictionary has enough markers.
        CharucoDetector::new(CharucoParams::for_board(spec)).map_err(|error| {
            format!(
                "a ChArUco board of {columns}x{rows} squares with {dictionary} cannot be: {error}"
            )
        })?;
        Ok(Self {
            markers: Some(Markers {
                name: dictionary.to_owned(),
                spec,
            }),
            ..plain
        })
    }

    /// Where a corner is on the board, in metres: x along its rows, y down, z into it.
    pub(crate) fn place(&self, [column, row]: Corner) -> DVec3 {
        DVec3::new(f64::from(column), f64::from(row), 0.0) * self.square_m
    }

    /// The ways in which a corner may have been numbered where nothing on the board says which way up it is, each as what
    /// the corner would be called then: a plain board looks the same upside down, a square one from all four sides.
    pub(crate) fn ways(&self) -> Vec<fn([u32; 2], Corner) -> Corner> {
        let mut ways: Vec<fn([u32; 2], Corner) -> Corner> = vec![|_, corner| corner];
        if self.markers.is_some() {
            return ways;
        }
        ways.push(|[columns, rows], [u, v]| [columns - 1 - u, rows - 1 - v]);
        if self.corners[0] == self.corners[1] {
            ways.push(|[columns, _], [u, v]| [columns - 1 - v, u]);
            ways.push(|[_, rows], [u, v]| [v, rows - 1 - u]);
        }
        ways
    }

    /// Where the board was held when its corners are numbered another way: the same place, by other names.
    pub(crate) fn renamed(&self, held: Pose, way: fn([u32; 2], Corner) -> Corner) -> Pose {
        let at = |corner| self.place(way(self.corners, corner));
        let origin = at([0, 0]);
        let along = (at([1, 0]) - origin).normalize();
        let down = (at([0, 1]) - origin).normalize();
        let turn = DMat3::from_cols(along, down, along.cross(down));
        let names = Pose {
            turn: DQuat::from_mat3(&turn),
            shift: origin,
        };
        held.after(names.inverse())
    }

    /// A sighting as it is when corners are numbered another way.
    pub(crate) fn renumbered(
        &self,
        sighting: &Sighting,
        way: fn([u32; 2], Corner) -> Corner,
    ) -> Sighting {
        let corners = sighting.corners.iter();
        Sighting {
            corners: corners
                .map(|(&corner, &at)| (way(self.corners, corner), at))
                .collect(),
            found: sighting.found,
        }
    }

    /// The board's corners in an image.
    ///
    /// # Errors
    /// Why there is none to be used, as a few words.
    pub fn find(&self, size: Size, pixels: &[u8]) -> Result<Sighting, String> {
        let found = self.look(size, pixels).or_else(|why| {
            // Of squares that are large or blurred the detector sees more in less detail.
            let (half, fewer) = halved(size, pixels);
            let found = self.look(half, &fewer).map_err(|_| why)?;
            let back = found.into_iter();
            Ok::<_, String>(back.map(|(corner, at)| (corner, at * 2.0 + 0.5)).collect())
        })?;
        let mut corners = BTreeMap::new();
        for (&corner, &at) in &found {
            let window = self.window(&found, corner, at);
            if let Some(exact) = exactly(size, pixels, at, window) {
                corners.insert(corner, exact);
            }
        }
        let (found, all) = (found.len(), self.corners[0] * self.corners[1]);
        let sighting = Sighting { corners, found };
        match sighting.tells_a_place() {
            true => Ok(sighting),
            false => Err(format!(
                "only {} of {all} corners are sharp, or nearly all in one row",
                sighting.count()
            )),
        }
    }

    /// The corners that the detector finds and numbers, with its usual tolerances or others.
    fn look(&self, size: Size, pixels: &[u8]) -> Result<BTreeMap<Corner, DVec2>, String> {
        let image = GrayImageView {
            width: size.width as usize,
            height: size.height as usize,
            data: pixels,
        };
        let seen = detect_corners(&image, &default_chess_config());
        let mut first = None;
        let mut keep =
            |tried: Result<_, String>| tried.map_err(|why| first.get_or_insert(why).clone()).ok();
        let found = match &self.markers {
            None => ChessboardParams::sweep_default()
                .into_iter()
                .find_map(|tolerances| keep(self.plain(tolerances, &seen))),
            Some(markers) => CharucoParams::sweep_for_board(&markers.spec)
                .into_iter()
                .find_map(|tolerances| keep(marked(tolerances, &image, &seen))),
        };
        found.ok_or(first.unwrap_or_default())
    }

    fn plain(
        &self,
        tolerances: ChessboardParams,
        seen: &[ChessCorner],
    ) -> Result<BTreeMap<Corner, DVec2>, String> {
        let detector = ChessboardDetector::new(tolerances)
            .map_err(|error| format!("the detector does not start: {error}"))?;
        let detection = detector.detect(seen).ok_or("no board")?;
        let corners = detection.corners.into_iter();
        let mut grid: BTreeMap<(i32, i32), DVec2> = corners
            .map(|corner| {
                let at = corner.position;
                let at = DVec2::new(f64::from(at.x), f64::from(at.y));
                ((corner.grid.u, corner.grid.v), at)
            })
            .collect();
        if is_mirrored(&grid) {
            grid = grid.into_iter().map(|((u, v), at)| ((-u, v), at)).collect();
        }
        let spans = |grid: &BTreeMap<(i32, i32), DVec2>| {
            (span(grid, |place| place.0), span(grid, |place| place.1))
        };
        let (mut across, mut down) = spans(&grid);
        let [columns, rows] = self.corners;
        // Beyond the board's edge something may look like one more row, here and there.
        loop {
            let is_wide = across.1 >= down.1;
            let (long, short) = (across.1.max(down.1), across.1.min(down.1));
            let is_long = long > columns.max(rows);
            if !is_long && short <= columns.min(rows) {
                break;
            }
            let by_column = is_wide == is_long;
            let spare = match by_column {
                true => sparse_end(&grid, across, down.1, |place| place.0),
                false => sparse_end(&grid, down, across.1, |place| place.1),
            };
            let Some(spare) = spare else { break };
            grid.retain(|place, _| spare != if by_column { place.0 } else { place.1 });
            (across, down) = spans(&grid);
        }
        let is_upright = [across.1, down.1] == self.corners;
        if !is_upright && [down.1, across.1] != self.corners {
            return Err(format!(
                "{}x{} corners are seen, and the board has {columns}x{rows}",
                across.1, down.1
            ));
        }
        let numbered = grid.into_iter().map(|((u, v), at)| {
            let (u, v) = (u.abs_diff(across.0), v.abs_diff(down.0));
            // Turned by a quarter, so that columns still go on to the right of rows.
            let corner = match is_upright {
                true => [u, v],
                false => [v, across.1 - 1 - u],
            };
            (corner, at)
        });
        Ok(numbered.collect())
    }

    /// How many pixels beside a corner belong to it alone.
    fn window(&self, found: &BTreeMap<Corner, DVec2>, [u, v]: Corner, at: DVec2) -> f64 {
        let beside = [
            (u.wrapping_sub(1), v),
            (u + 1, v),
            (u, v.wrapping_sub(1)),
            (u, v + 1),
        ];
        let near = beside.iter().filter_map(|&(u, v)| found.get(&[u, v]));
        let nearest = near
            .map(|other| (*other - at).length())
            .fold(f64::INFINITY, f64::min);
        // Markers have edges of their own.
        let free = self.markers.as_ref().map_or(WINDOW_PART, |markers| {
            f64::from(1.0 - markers.spec.marker_size_rel) / 2.0
        });
        (nearest * free.min(WINDOW_PART)).clamp(WINDOW[1], WINDOW[0])
    }

    /// What to ask a user whose board is not found.
    pub(crate) fn doubt(&self) -> &'static str {
        match self.markers {
            None => {
                "is --board right, counted in inner corners, and is the whole board in the picture?"
            }
            Some(_) => "are --board, counted in squares, --marker and --dictionary right?",
        }
    }

    /// As the user may give it again.
    pub fn describe(&self) -> String {
        let [columns, rows] = self.corners;
        let square = self.square_m * 1e3;
        match &self.markers {
            None => format!("{columns}x{rows} corners, squares of {square:.1} mm"),
            Some(markers) => format!(
                "ChArUco {}x{} squares of {square:.1} mm, {}",
                columns + 1,
                rows + 1,
                markers.name
            ),
        }
    }
}

fn marked(
    tolerances: CharucoParams,
    image: &GrayImageView<'_>,
    seen: &[ChessCorner],
) -> Result<BTreeMap<Corner, DVec2>, String> {
    let detector = CharucoDetector::new(tolerances)
        .map_err(|error| format!("the detector does not start: {error}"))?;
    let detection = detector
        .detect_with_corners(image, seen)
        .map_err(|error| error.to_string())?;
    let across = detector.params().board.cols.saturating_sub(1).max(1);
    let corners = detection.corners.iter().map(|corner| {
        let at = corner.position;
        (
            [corner.id % across, corner.id / across],
            DVec2::new(f64::from(at.x), f64::from(at.y)),
        )
    });
    Ok(corners.collect())
}

/// Whether rows go on to the left of columns: no camera sees a board so, and some numberings have it.
fn is_mirrored(grid: &BTreeMap<(i32, i32), DVec2>) -> bool {
    let (mut along, mut down) = (DVec2::ZERO, DVec2::ZERO);
    for (&(u, v), at) in grid {
        if let Some(next) = grid.get(&(u + 1, v)) {
            along += *next - *at;
        }
        if let Some(next) = grid.get(&(u, v + 1)) {
            down += *next - *at;
        }
    }
    along.perp_dot(down) < 0.0
}

/// The least of what places have along one side, and how many there are from there to the greatest.
fn span(grid: &BTreeMap<(i32, i32), DVec2>, along: impl Fn(&(i32, i32)) -> i32) -> (i32, u32) {
    let least = grid.keys().map(&along).min().unwrap_or_default();
    let most = grid.keys().map(&along).max().unwrap_or_default();
    (least, most.abs_diff(least).saturating_add(1))
}

/// The first or the last of so many rows, whichever holds less, if that is less than half of what a row has.
fn sparse_end(
    grid: &BTreeMap<(i32, i32), DVec2>,
    (least, count): (i32, u32),
    whole: u32,
    along: impl Fn(&(i32, i32)) -> i32,
) -> Option<i32> {
    let ends = [least, least.saturating_add_unsigned(count - 1)];
    let held = |end: &i32| grid.keys().filter(|place| along(place) == *end).count();
    let spare = ends.into_iter().min_by_key(held)?;
    (held(&spare) < whole as usize / 2).then_some(spare)
}

/// The picture at half the size, by means of four pixels.
fn halved(size: Size, pixels: &[u8]) -> (Size, Vec<u8>) {
    let half = Size::new(size.width / 2, size.height / 2);
    let width = size.width as usize;
    let mean = |column: usize, row: usize| {
        let at = 2 * row * width + 2 * column;
        let four = [at, at + 1, at + width, at + width + 1];
        let sum: u32 = four.iter().map(|&at| u32::from(pixels[at])).sum();
        ((sum + 2) / 4) as u8
    };
    let rows = 0..half.height as usize;
    let pixels = rows.flat_map(|row| (0..half.width as usize).map(move |column| (column, row)));
    let pixels = pixels.map(|(column, row)| mean(column, row)).collect();
    (half, pixels)
}

/// Where exactly the corner near a place is; `None` where the image does not say, or says another place.
fn exactly(size: Size, pixels: &[u8], near: DVec2, window: f64) -> Option<DVec2> {
    let (width, height) = (size.width as usize, size.height as usize);
    let level = |at: DVec2| {
        let (column, row) = (at.x.floor(), at.y.floor());
        let (x, y) = (at.x - column, at.y - row);
        let index = row as usize * width + column as usize;
        let of = |offset: usize| f64::from(pixels[index + offset]);
        let (above, below) = (
            of(0) * (1.0 - x) + of(1) * x,
            of(width) * (1.0 - x) + of(width + 1) * x,
        );
        above * (1.0 - y) + below * y
    };
    let reach = window.ceil() as i32;
    let margin = f64::from(reach) + 1.0;
    let mut corner = near;
    for _ in 0..40 {
        let is_inside = corner.cmpge(DVec2::splat(margin)).all()
            && corner.x + margin < width as f64 - 1.0
            && corner.y + margin < height as f64 - 1.0;
        if !is_inside {
            return None;
        }
        // Σ w·g·gᵀ and Σ w·g·gᵀ·d of gradients g at d from the corner.
        let (mut xx, mut xy, mut yy, mut sum) = (0.0, 0.0, 0.0, DVec2::ZERO);
        for row in -reach..=reach {
            for column in -reach..=reach {
                let beside = DVec2::new(f64::from(column), f64::from(row));
                let at = corner + beside;
                let gradient = DVec2::new(
                    level(at + DVec2::X) - level(at - DVec2::X),
                    level(at + DVec2::Y) - level(at - DVec2::Y),
                );
                let near = (-2.0 * beside.length_squared() / (window * window)).exp();
                xx += near * gradient.x * gradient.x;
                xy += near * gradient.x * gradient.y;
                yy += near * gradient.y * gradient.y;
                sum += near * gradient * gradient.dot(beside);
            }
        }
        let determinant = xx * yy - xy * xy;
        // Two directions of edges, or it is no corner.
        if determinant <= 1e-3 * (xx + yy).powi(2) {
            return None;
        }
        let by = DVec2::new(yy * sum.x - xy * sum.y, xx * sum.y - xy * sum.x) / determinant;
        corner += by;
        if (corner - near).length() > MOST_MOVE {
            return None;
        }
        if by.length() < 1e-3 {
            return Some(corner);
        }
    }
    None
}
