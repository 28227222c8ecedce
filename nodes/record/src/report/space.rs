//! Points in space as a picture: projected, the nearer over the farther, in a box with a scale.
//!
//! ```text
//! points in metres ─► Eye turns them ─► Stage fits their box on the canvas ─► PNG of dots, SVG of the box
//! ```

use maud::{Markup, html};
use messages::record::Span;
use messages::{Point, Size};
use png::EncodingError;

use super::Fault;
use super::figures::{shade, shades};
use super::page::{Album, At, Png, count, missing};
use super::plot::{decimals, ticks};
use crate::compact::{Pixels, encode};

/// The size of a picture of points.
pub(super) const CANVAS: Size = Size::new(960, 720);

/// Room for numbers and names beside the box, and above and below it, in pixels.
const MARGIN: [f64; 2] = [186.0, 104.0];

/// A box is no thinner than this share of its longest side: there has to be room for its scale.
const THINNEST: f64 = 0.16;

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn cross(a: Vector, b: Vector) -> Vector {
    let part = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
    [part(1, 2), part(2, 0), part(0, 1)]
}

fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|part| part / length)
}

/// From where points are looked at: the directions of its picture in the optical frame (x right, y down, z forward).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Eye {
    right: Vector,
    down: Vector,
    forward: Vector,
    /// Whether what is farther is smaller.
    is_perspective: bool,
}

impl Eye {
    /// From above on the left, before the scene.
    pub(super) fn above_left() -> Self {
        let forward = unit([0.5, 0.42, 0.76]);
        let right = unit(cross([0.0, 1.0, 0.0], forward));
        Self {
            right,
            down: cross(forward, right),
            forward,
            is_perspective: true,
        }
    }

    /// From the right: depth runs to the right, heights are true.
    pub(super) fn side() -> Self {
        Self {
            right: [0.0, 0.0, 1.0],
            down: [0.0, 1.0, 0.0],
            forward: [-1.0, 0.0, 0.0],
            is_perspective: false,
        }
    }

    /// From where the camera is, but without perspective.
    pub(super) fn front() -> Self {
        Self {
            right: [1.0, 0.0, 0.0],
            down: [0.0, 1.0, 0.0],
            forward: [0.0, 0.0, 1.0],
            is_perspective: false,
        }
    }

    /// From above, as a map: depth runs up.
    pub(super) fn above() -> Self {
        Self {
            right: [1.0, 0.0, 0.0],
            down: [0.0, 0.0, -1.0],
            forward: [0.0, 1.0, 0.0],
            is_perspective: false,
        }
    }
}

/// The points from several sides, each with its name and how it is drawn; `legend` says what the colours mean.
pub(super) fn views(
    album: &mut Album,
    points: &[Point],
    span: Span,
    unit: &str,
    legend: &Markup,
    eyes: &[(&str, &str, Eye)],
) -> Result<Markup, Fault> {
    let Some(bounds) = Bounds::of(points) else {
        return Ok(missing("There are no points in space"));
    };
    let mut figures = Vec::new();
    for (from, how, eye) in eyes {
        let stage = Stage::new(*eye, bounds);
        let strays = stage.strays(points) as u64;
        let shown = count(points.len() as u64 - strays);
        let alt = format!("{shown} points in space {from}, coloured by disparity");
        let dots = stage.dots(points, span)?;
        let drawn = || stage.drawn(&dots, unit, &alt);
        let caption = html! {
            b { "Points " (from) } ", " (how) ": " (shown)
            @if strays > 0 { "; " (count(strays)) " outlying points left out" }
            (legend)
        };
        figures.push(album.drawing(&dots, CANVAS, &alt, drawn, &caption));
    }
    Ok(html! { div.spaces { @for figure in &figures { (figure) } } })
}

/// The box that holds all points but strays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    least: Vector,
    most: Vector,
}

impl Bounds {
    /// Of these points: along each axis all but the outermost hundredth at either end. `None` when there are none.
    pub(super) fn of(points: &[Point]) -> Option<Self> {
        let along = |axis: usize| {
            let values = points.iter().map(|point| place(point)[axis]);
            let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
            values.sort_by(f64::total_cmp);
            let last = values.len().checked_sub(1)?;
            let stray = values.len() / 100;
            Some((values[stray], values[last - stray]))
        };
        let [x, y, z] = [along(0)?, along(1)?, along(2)?];
        let longest = [x, y, z].map(|(least, most)| most - least);
        let longest = longest.into_iter().fold(0.0, f64::max).max(1e-6);
        // Nothing touches the walls.
        let pad = |(least, most): (f64, f64)| {
            let room = ((most - least) * 0.04).max((THINNEST * longest - (most - least)) / 2.0);
            (least - room, most + room)
        };
        let [x, y, z] = [x, y, z].map(pad);
        Some(Self {
            least: [x.0, y.0, z.0],
            most: [x.1, y.1, z.1],
        })
    }

    /// Whether a place lies in it.
    fn holds(&self, place: Vector) -> bool {
        (0..3).all(|axis| (self.least[axis]..=self.most[axis]).contains(&place[axis]))
    }

    fn side(&self, axis: usize, is_most: bool) -> f64 {
        [self.least, self.most][usize::from(is_most)][axis]
    }

    fn corners(&self) -> impl Iterator<Item = Vector> + '_ {
        (0..8u8).map(|bits| std::array::from_fn(|axis| self.side(axis, bits >> axis & 1 == 1)))
    }

    fn middle(&self) -> Vector {
        std::array::from_fn(|axis| (self.least[axis] + self.most[axis]) / 2.0)
    }
}

fn place(point: &Point) -> Vector {
    [point.x, point.y, point.z].map(f64::from)
}

/// A box before an eye, fitted on the canvas.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage {
    eye: Eye,
    bounds: Bounds,
    /// From the eye to the middle of the box, for perspective.
    distance: f64,
    scale: f64,
    shift: [f64; 2],
}

impl Stage {
    /// As large as the canvas lets it be.
    pub(super) fn new(eye: Eye, bounds: Bounds) -> Self {
        let extent: Vector = std::array::from_fn(|axis| bounds.most[axis] - bounds.least[axis]);
        let mut stage = Self {
            eye,
            bounds,
            // Far enough that the box is not distorted, near enough that depth shows.
            distance: 2.2 * dot(extent, extent).sqrt(),
            scale: 1.0,
            shift: [0.0; 2],
        };
        let corners: Vec<_> = bounds
            .corners()
            .map(|corner| stage.project(corner))
            .collect();
        let ends = |axis: usize| {
            let values = corners.iter().map(move |(at, _)| at[axis]);
            values.fold(
                (f64::INFINITY, f64::NEG_INFINITY),
                |(least, most), value| (least.min(value), most.max(value)),
            )
        };
        let canvas = [CANVAS.width, CANVAS.height].map(f64::from);
        let [x, y] = [ends(0), ends(1)];
        let fit = |axis: usize, (least, most): (f64, f64)| {
            (canvas[axis] - 2.0 * MARGIN[axis]) / (most - least)
        };
        stage.scale = fit(0, x).min(fit(1, y));
        let shift =
            |(least, most): (f64, f64), side: f64| side / 2.0 - (least + most) / 2.0 * stage.scale;
        stage.shift = [shift(x, canvas[0]), shift(y, canvas[1])];
        stage
    }

    /// Where a place falls on the canvas, and how far it is from the eye.
    pub(super) fn project(&self, place: Vector) -> ([f64; 2], f64) {
        let middle = self.bounds.middle();
        let from: Vector = std::array::from_fn(|axis| place[axis] - middle[axis]);
        let depth = dot(from, self.eye.forward) + self.distance;
        let near = match self.eye.is_perspective {
            true => self.distance / depth,
            false => 1.0,
        };
        let along = [self.eye.right, self.eye.down].map(|side| dot(from, side) * near);
        (
            std::array::from_fn(|axis| along[axis] * self.scale + self.shift[axis]),
            depth,
        )
    }

    /// The points as dots in the colours of their disparities, nothing where there is none.
    pub(super) fn dots(&self, points: &[Point], span: Span) -> Result<Vec<u8>, EncodingError> {
        let mut bytes = vec![0; CANVAS.pixels()];
        let mut nearest = vec![f64::INFINITY; CANVAS.pixels()];
        // Few points are drawn larger, so that they are seen.
        let size = match points.len() {
            0..=4000 => 4,
            4001..=25_000 => 3,
            _ => 2,
        };
        for point in points
            .iter()
            .filter(|point| self.bounds.holds(place(point)))
        {
            let (at, depth) = self.project(place(point));
            let start = at.map(|at| (at - f64::from(size) / 2.0).round() as i64);
            for step in 0..i64::from(size * size) {
                let (x, y) = (
                    start[0] + step % i64::from(size),
                    start[1] + step / i64::from(size),
                );
                let inside = (0..i64::from(CANVAS.width)).contains(&x)
                    && (0..i64::from(CANVAS.height)).contains(&y);
                let pixel = (y * i64::from(CANVAS.width) + x) as usize;
                if inside && depth < nearest[pixel] {
                    nearest[pixel] = depth;
                    bytes[pixel] = shade(span, point.disparity);
                }
            }
        }
        encode(CANVAS, &bytes, Pixels::Of(&shades(), true))
    }

    /// How many points lie outside the box, where they are not drawn.
    pub(super) fn strays(&self, points: &[Point]) -> usize {
        let is_stray = |point: &&Point| !self.bounds.holds(place(point));
        points.iter().filter(is_stray).count()
    }

    /// The picture: the box's far walls, the dots before them, and the scale around.
    pub(super) fn drawn(&self, dots: &[u8], unit: &str, alt: &str) -> Markup {
        let Size { width, height } = CANVAS;
        let all: [Vec<f64>; 3] = std::array::from_fn(|axis| self.ticks(axis));
        html! {
            svg.space viewBox={ "0 0 " (width) " " (height) } role="img" aria-label=(alt) {
                (self.walls(&all))
                image width=(width) height=(height) href=(Png(dots)) {}
                @for (axis, ticks) in all.iter().enumerate() { (self.numbers(axis, ticks, unit)) }
            }
        }
    }

    fn ticks(&self, axis: usize) -> Vec<f64> {
        let (least, most) = (self.bounds.least[axis], self.bounds.most[axis]);
        // As many as have room for their numbers along the axis as it is drawn.
        let mut ends = [self.bounds.middle(); 2];
        (ends[0][axis], ends[1][axis]) = (least, most);
        let [(a, _), (b, _)] = ends.map(|end| self.project(end));
        let room = (a[0] - b[0]).hypot(a[1] - b[1]);
        let fits = (room / 95.0) as usize;
        // A scale has two numbers at least, and be they close to each other.
        (fits..=20)
            .map(|at_most| ticks(least, most, at_most))
            .find(|ticks| ticks.len() >= 2)
            .unwrap_or_default()
    }

    /// The lines of the scale on the walls that no point can hide behind.
    fn walls(&self, all: &[Vec<f64>; 3]) -> Markup {
        let mut lines = Vec::new();
        for wall in 0..3 {
            let towards = self.eye.forward[wall];
            if towards.abs() < 0.05 {
                continue;
            }
            let at = self.bounds.side(wall, towards > 0.0);
            for (across, along) in [
                ((wall + 1) % 3, (wall + 2) % 3),
                ((wall + 2) % 3, (wall + 1) % 3),
            ] {
                let sides = [false, true].map(|is_most| self.bounds.side(across, is_most));
                for tick in all[across].iter().chain(&sides) {
                    let end = |is_most| {
                        let mut end = [0.0; 3];
                        end[wall] = at;
                        end[across] = *tick;
                        end[along] = self.bounds.side(along, is_most);
                        self.project(end).0
                    };
                    lines.push((end(false), end(true)));
                }
            }
        }
        html! {
            @for ([x1, y1], [x2, y2]) in lines {
                line.rule x1=(At(x1)) y1=(At(y1)) x2=(At(x2)) y2=(At(y2)) {}
            }
        }
    }

    /// The numbers along one axis, at the edge of the box where they are not in the way, and the axis's name.
    fn numbers(&self, axis: usize, ticks: &[f64], unit: &str) -> Markup {
        // Looked at along its axis a scale is one point.
        if self.eye.forward[axis].abs() > 0.99 {
            return html! {};
        }
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let on_edge = |sides: (bool, bool), value: f64| {
            let mut place = [value; 3];
            place[b] = self.bounds.side(b, sides.0);
            place[c] = self.bounds.side(c, sides.1);
            self.project(place).0
        };
        let half = self.bounds.middle()[axis];
        // Heights stand at the left, the others below.
        let rank = |sides: &(bool, bool)| {
            let [x, y] = on_edge(*sides, half);
            match axis {
                1 => x - y * 0.01,
                _ => -y + x * 0.01,
            }
        };
        let edges = [(false, false), (false, true), (true, false), (true, true)];
        let best = edges
            .into_iter()
            .min_by(|one, other| rank(one).total_cmp(&rank(other)));
        let Some(edge) = best else {
            return html! {};
        };
        let (middle, _) = self.project(self.bounds.middle());
        let at = on_edge(edge, half);
        // Straight off the edge, away from the middle of the box.
        let ends = [self.bounds.least[axis], self.bounds.most[axis]].map(|end| on_edge(edge, end));
        let run = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
        let length = run[0].hypot(run[1]).max(1e-9);
        let mut off = [-run[1] / length, run[0] / length];
        if off[0] * (at[0] - middle[0]) + off[1] * (at[1] - middle[1]) < 0.0 {
            off = off.map(|part| -part);
        }
        let anchor = match off[0] {
            x if x > 0.4 => "start",
            x if x < -0.4 => "end",
            _ => "middle",
        };
        let text = |at: [f64; 2], by: f64, class: Option<&str>, text: &str| {
            let (x, y) = (at[0] + off[0] * by, at[1] + off[1] * by + 10.0);
            html! { text class=[class] x=(At(x)) y=(At(y)) text-anchor=(anchor) { (text) } }
        };
        let places = decimals(ticks);
        let name = format!("{} ({unit})", ["x", "y", "z"][axis]);
        // Beside upright scales the name stands between two numbers, or as far from a single one as the scale goes.
        let (by, between) = match (anchor, ticks) {
            ("middle", _) => (74.0, half),
            (_, [first, second, ..]) => (26.0, (first + second) / 2.0),
            (_, [only]) if *only < half => (26.0, self.bounds.most[axis]),
            (_, [_]) => (26.0, self.bounds.least[axis]),
            (_, []) => (26.0, half),
        };
        html! {
            @for tick in ticks { (text(on_edge(edge, *tick), 24.0, None, &format!("{tick:.places$}"))) }
            (text(on_edge(edge, between), by, Some("axis"), &name))
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn cloud() -> Vec<Point> {
        let corner = |bits: u8| Point {
            x: f32::from(bits & 1) * 2.0 - 1.0,
            y: f32::from(bits >> 1 & 1) - 0.5,
            z: f32::from(bits >> 2 & 1) * 3.0 + 1.0,
            disparity: 10.0,
            ..Point::default()
        };
        (0..8).map(corner).collect()
    }

    fn stage(eye: Eye) -> Stage {
        Stage::new(eye, Bounds::of(&cloud()).unwrap())
    }

    #[test]
    fn every_eye_looks_along_a_right_handed_frame() {
        for eye in [Eye::above_left(), Eye::side(), Eye::above(), Eye::front()] {
            let forward = cross(eye.right, eye.down);
            for (one, other) in forward.into_iter().zip(eye.forward) {
                assert!((one - other).abs() < 1e-12, "{eye:?}");
            }
            assert!((dot(eye.down, eye.down) - 1.0).abs() < 1e-12, "{eye:?}");
        }
    }

    #[test]
    fn the_whole_box_is_on_the_canvas_and_fills_it_one_way() {
        for eye in [Eye::above_left(), Eye::side(), Eye::above()] {
            let stage = stage(eye);
            let corners: Vec<_> = stage.bounds.corners().map(|c| stage.project(c).0).collect();
            let touches = |axis: usize, side: u32| {
                let least = corners
                    .iter()
                    .map(|c| c[axis])
                    .fold(f64::INFINITY, f64::min);
                let most = corners.iter().map(|c| c[axis]).fold(0.0, f64::max);
                let margin = MARGIN[axis];
                assert!(least > margin - 1e-6 && most < f64::from(side) - margin + 1e-6);
                (least - margin).abs() < 1e-6
            };
            assert!(
                touches(0, CANVAS.width) | touches(1, CANVAS.height),
                "{eye:?}"
            );
        }
    }

    #[test]
    fn every_scale_has_two_numbers_however_little_room_there_is() {
        // No two multiples of five lie between the ends of its depth.
        let mut points = cloud();
        for point in &mut points {
            point.x *= 10.0;
            point.z += 10.4;
        }
        for eye in [Eye::side(), Eye::above(), Eye::front()] {
            let stage = Stage::new(eye, Bounds::of(&points).unwrap());
            for axis in 0..3 {
                assert!(stage.ticks(axis).len() >= 2, "{eye:?}, {axis}");
            }
        }
    }

    #[test]
    fn the_scale_is_true_from_the_side_and_from_above() {
        for (eye, axes) in [(Eye::side(), [2, 1]), (Eye::above(), [0, 2])] {
            let stage = stage(eye);
            let step = |axis: usize| {
                let mut to = [0.0, 0.0, 2.0];
                let (from, _) = stage.project(to);
                to[axis] += 1.0;
                let (to, _) = stage.project(to);
                (to[0] - from[0]).hypot(to[1] - from[1])
            };
            for axis in axes {
                assert!((step(axis) - stage.scale).abs() < 1e-9, "{eye:?}");
            }
        }
    }

    #[test]
    fn from_the_side_depth_runs_right_and_from_above_it_runs_up() {
        let (near, far) = ([0.0, 0.0, 1.0], [0.0, 0.0, 4.0]);
        let side = stage(Eye::side());
        assert!(side.project(far).0[0] > side.project(near).0[0]);
        let above = stage(Eye::above());
        assert!(above.project(far).0[1] < above.project(near).0[1]);
        let left = stage(Eye::above_left());
        assert!(left.project(far).1 > left.project(near).1);
        // What is lower is lower in the picture.
        assert!(left.project([0.0, 0.5, 2.0]).0[1] > left.project([0.0, -0.5, 2.0]).0[1]);
    }

    #[test]
    fn of_two_points_in_line_the_nearer_is_seen() {
        let stage = stage(Eye::above());
        let span = Span::of([5.0, 10.0].into_iter()).unwrap();
        let at = |y: f32, disparity: f32| Point {
            y,
            z: 2.0,
            disparity,
            ..Point::default()
        };
        let [x, y] = stage.project([0.0, 0.0, 2.0]).0.map(|at| at.round() as u32);
        for points in [
            [at(-0.4, 10.0), at(0.4, 5.0)],
            [at(0.4, 5.0), at(-0.4, 10.0)],
        ] {
            let png = stage.dots(&points, span).unwrap();
            let picture = image::load_from_memory(&png).unwrap().into_rgba8();
            let [r, g, b, alpha] = picture.get_pixel(x, y).0;
            assert_eq!(([r, g, b], alpha), (shades()[255], 255));
            assert_eq!(picture.get_pixel(0, 0).0[3], 0);
        }
    }

    #[test]
    fn a_stray_point_does_not_shrink_all_others() {
        let mut points: Vec<Point> = (0..50).flat_map(|_| cloud()).collect();
        let before = Bounds::of(&points).unwrap();
        points.push(Point {
            z: 5000.0,
            ..Point::default()
        });
        points.push(Point {
            z: f32::INFINITY,
            ..Point::default()
        });
        assert_eq!(Bounds::of(&points), Some(before));
        assert_eq!(stage(Eye::side()).strays(&points), 2);
        assert_eq!(Bounds::of(&[]), None);
    }
}
