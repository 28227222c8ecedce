//! What the evaluator says, against slow obvious twins.

use evaluate::{Canny, Evaluator, Known, Settings, Truths};
use messages::{Evaluation, MatchPoint, Matches, NONE, Owned, Point, Points, Score, Size};

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

const SIZE: Size = Size {
    width: 47,
    height: 31,
};

/// A picture of blocks and noise, a truth of steps with holes, and points of which some are wrong.
struct World {
    pixels: Vec<u8>,
    truth: Vec<f32>,
    points: Vec<Point>,
}

fn world(seed: u64) -> World {
    let mut random = Random(seed);
    let place = |i: usize| (i % SIZE.width as usize, i / SIZE.width as usize);
    let pixels = (0..SIZE.pixels())
        .map(|i| {
            let (x, y) = place(i);
            let block = if (x / 9 + y / 7) % 2 == 0 {
                50.0
            } else {
                180.0
            };
            (block + 40.0 * random.unit()) as u8
        })
        .collect();
    let truth: Vec<f32> = (0..SIZE.pixels())
        .map(|i| match (place(i), random.unit()) {
            (_, hole) if hole < 0.2 => f32::NAN,
            (_, zero) if zero < 0.25 => 0.0,
            ((x, _), _) if (30..38).contains(&x) => f32::NAN,
            ((x, y), _) if x < 20 => 4.0 + 0.01 * x as f32 + (y / 2 % 3) as f32,
            _ => 9.5,
        })
        .collect();
    let points = (0..400)
        .map(|_| {
            // Some lie on and beyond the sides.
            let (u, v) = (48.0 * random.unit() - 0.6, 32.0 * random.unit() - 0.6);
            // Rows of edges that were found along rows are whole.
            let v = if random.unit() < 0.5 { v.round() } else { v };
            let near = if u < 20.0 { 4.0 } else { 9.5 };
            let wrong = if random.unit() < 0.3 {
                6.0 * random.unit()
            } else {
                0.3 * random.unit()
            };
            Point {
                u,
                v,
                disparity: near + wrong,
                // Few values, so that many are equal.
                score: (8.0 * random.unit()).floor() / 8.0,
                ..Point::default()
            }
        })
        .collect();
    World {
        pixels,
        truth,
        points,
    }
}

fn evaluated(world: &World, matches: &[Owned<Matches>]) -> Owned<Evaluation> {
    let mut points = Owned::<Points>::new(SIZE);
    points.fill(|room| room.points.extend_from_slice(&world.points));
    let mut out = Owned::<Evaluation>::new(SIZE);
    let known = Known {
        pixels: &world.pixels,
        truth: &world.truth,
        size: SIZE,
    };
    let views: Vec<_> = matches.iter().map(Owned::view).collect();
    let mut evaluator = Evaluator::new(&Settings::default());
    // A second scan must not see anything of the first.
    for _ in 0..2 {
        out.fill(|room| evaluator.process(known, points.view(), &views, room));
    }
    out
}

fn at(truth: &[f32], x: i64, y: i64) -> Option<f32> {
    let is_inside =
        (0..i64::from(SIZE.width)).contains(&x) && (0..i64::from(SIZE.height)).contains(&y);
    let value = is_inside.then(|| truth[(y * i64::from(SIZE.width) + x) as usize])?;
    (value > 0.0).then_some(value)
}

/// Column and row of a point, `margin` columns away from the sides.
fn pixel(point: &Point, margin: i64) -> (i64, i64) {
    let within = |place: f32, least: i64, most: u32| {
        (f64::from(place).round_ties_even() as i64).clamp(least, i64::from(most) - 1 - least)
    };
    (
        within(point.u, margin, SIZE.width),
        within(point.v, 0, SIZE.height),
    )
}

fn errors(world: &World, rows: i64) -> Vec<f32> {
    let error = |point: &Point| {
        let (x, y) = pixel(point, 2);
        let mut least = f32::INFINITY;
        for row in y - rows..=y + rows {
            for column in x - 2..=x + 2 {
                if let Some(truth) = at(&world.truth, column, row) {
                    least = least.min((truth - point.disparity).abs());
                }
            }
        }
        least
    };
    world.points.iter().map(error).collect()
}

fn edges(world: &World) -> Vec<bool> {
    let mut edges = Vec::new();
    Canny::new(40.0, 100.0).find(&world.pixels, SIZE, &mut edges);
    let known = world.truth.iter().map(|truth| *truth > 0.0);
    edges
        .iter()
        .zip(known)
        .map(|(edge, known)| *edge && known)
        .collect()
}

fn coverage(world: &World, points: &[Point]) -> f64 {
    let edges = edges(world);
    let near = |i: usize| {
        let (x, y) = (
            (i % SIZE.width as usize) as i64,
            (i / SIZE.width as usize) as i64,
        );
        points.iter().any(|point| {
            let (u, v) = pixel(point, 0);
            (u - x).abs() <= 1 && (v - y).abs() <= 1
        })
    };
    let all = edges.iter().filter(|edge| **edge).count();
    let hit = (0..edges.len()).filter(|&i| edges[i] && near(i)).count();
    hit as f64 / all as f64
}

#[test]
fn every_figure_is_what_its_definition_says() {
    for seed in 1..6 {
        let world = world(seed);
        let evaluation = evaluated(&world, &[]);
        let score: Score = evaluation.view().scores[0];
        let mut known = errors(&world, 0);
        known.retain(|error| error.is_finite());
        assert!(known.len() > 200 && known.len() < world.points.len());
        let over = |most: f32| known.iter().filter(|error| **error > most).count();
        assert_eq!(score.points as usize, known.len());
        assert_eq!(score.over_half as usize, over(0.5));
        assert_eq!(score.over_one as usize, over(1.0));
        assert_eq!(score.over_two as usize, over(2.0));
        assert!(score.over_two > 10);
        let far = |(row, near): (&f32, &f32)| row.is_finite() && *row > 2.0 && *near > 2.0;
        let (row, near) = (errors(&world, 0), errors(&world, 2));
        let mismatches = row.iter().zip(&near).filter(|pair| far(*pair)).count();
        assert_eq!(score.mismatches as usize, mismatches);
        assert!(mismatches > 0 && mismatches < over(2.0));
        for (most, forgiven) in [(1.0, score.forgiven_one), (2.0, score.forgiven_two)] {
            let within = errors(&world, 3);
            let is_forgiven = |i: &usize| {
                let is_level = world.points[*i].v.round() != world.points[*i].v;
                row[*i].is_finite() && row[*i] > most && is_level && within[*i] <= most
            };
            let count = (0..row.len()).filter(is_forgiven).count();
            assert_eq!(forgiven as usize, count);
            assert!(count > 5 && count < over(most));
        }
        let edges = edges(&world).iter().filter(|edge| **edge).count();
        assert_eq!(score.edges as usize, edges);
        assert!((f64::from(score.coverage) - coverage(&world, &world.points)).abs() < 1e-6);
        known.sort_by(f32::total_cmp);
        let middle = known.len() / 2;
        let median = match known.len() % 2 {
            0 => (known[middle - 1] + known[middle]) / 2.0,
            _ => known[middle],
        };
        assert!((score.median - median).abs() < 1e-6);
    }
}

#[test]
fn the_curve_is_of_the_surest_points_equal_ones_in_their_order() {
    let world = world(7);
    let evaluation = evaluated(&world, &[]);
    let mut order: Vec<&Point> = world.points.iter().collect();
    order.sort_by(|a, b| b.score.total_cmp(&a.score));
    for (step, share) in (1..).zip(evaluation.view().curve) {
        let kept: Vec<Point> = order[..world.points.len() * step / 20]
            .iter()
            .map(|point| **point)
            .collect();
        assert!((f64::from(share.coverage) - coverage(&world, &kept)).abs() < 1e-6);
        let some = World {
            points: kept,
            pixels: world.pixels.clone(),
            truth: world.truth.clone(),
        };
        let mut known = errors(&some, 0);
        known.retain(|error| error.is_finite());
        let bad = known.iter().filter(|error| **error > 1.0).count();
        let expected = bad as f32 / known.len().max(1) as f32;
        assert!((share.bad_one - expected).abs() < 1e-6, "step {step}");
        assert_eq!(
            share.score,
            some.points.last().map_or(0.0, |point| point.score)
        );
    }
    assert_eq!(evaluation.view().curve.len(), 20);
}

#[test]
fn each_channel_is_compared_by_itself() {
    let world = world(8);
    let of = |points: &[Point]| {
        let mut matches = Owned::<Matches>::new(SIZE);
        matches.fill(|room| {
            for point in points {
                room.points.push(MatchPoint {
                    x: point.u,
                    y: point.v,
                    disparity: point.disparity,
                    score: point.score,
                    ..MatchPoint::default()
                });
            }
        });
        matches
    };
    let evaluation = evaluated(&world, &[of(&world.points), of(&world.points[..100])]);
    let scores = evaluation.view().scores;
    assert_eq!(scores.len(), 3);
    let like = |channel: u32| Score {
        channel,
        ..scores[0]
    };
    assert_eq!((scores[0].channel, scores[1]), (NONE, like(0)));
    assert!(scores[2].channel == 1 && scores[2].points < scores[1].points);
}

#[test]
fn without_points_or_truth_nothing_is_divided_by_zero() {
    let mut nothing = world(9);
    nothing.points.clear();
    let evaluation = evaluated(&nothing, &[]);
    assert_eq!(
        (
            evaluation.view().scores[0].points,
            evaluation.view().scores[0].median
        ),
        (0, 0.0)
    );
    let mut unknown = world(9);
    unknown.truth.fill(f32::NAN);
    let score = evaluated(&unknown, &[]).view().scores[0];
    assert_eq!((score.edges, score.points, score.coverage), (0, 0, 0.0));
}

#[test]
fn an_edge_is_the_crest_of_its_gradient_and_lasts_as_long_as_it_hangs_together() {
    // A step whose height falls from row to row: strong above, weak below, none at last.
    let size = Size::new(16, 30);
    let height = |y: u32| 60u32.saturating_sub(22 * y / 10) as u8;
    let pixels: Vec<u8> = (0..size.height)
        .flat_map(|y| (0..size.width).map(move |x| if x < 8 { 100 } else { 100 + height(y) }))
        .collect();
    let mut edges = Vec::new();
    let mut canny = Canny::new(40.0, 100.0);
    canny.find(&pixels, size, &mut edges);
    let in_row = |edges: &[bool], y: usize| {
        let row = &edges[16 * y..16 * (y + 1)];
        row.iter().filter(|edge| **edge).count()
    };
    // Sobel's sum over a step of 25 is 100, of 10 is 40.
    assert!((0..22).all(|y| in_row(&edges, y) == 1));
    assert!((24..30).all(|y| in_row(&edges, y) == 0));
    // Without its strong part the weak one is none.
    let weak = 18;
    canny.find(
        &pixels[16 * weak..],
        Size::new(16, 30 - weak as u32),
        &mut edges,
    );
    assert!(edges.iter().all(|edge| !edge));
}

#[test]
fn a_disparity_is_off_by_its_difference_to_the_nearest_truth_that_counts() {
    let world = world(10);
    let truths = Truths {
        disparity: &world.truth,
        size: SIZE,
    };
    let [row, rows] = [0, 3].map(|rows| errors(&world, rows));
    for (i, point) in world.points.iter().enumerate() {
        let is_level = point.v.round() != point.v;
        let error = if is_level { rows[i] } else { row[i] };
        let off = truths.off(point.u, point.v, point.disparity);
        assert_eq!(off.map(f32::abs), error.is_finite().then_some(error));
    }
    // Above a step from 4 to 9, on a level contour three rows away, and on one that is not level.
    let disparity: Vec<f32> = (0..10 * 10)
        .map(|i| if i < 60 { 4.0 } else { 9.0 })
        .collect();
    let truths = Truths {
        disparity: &disparity,
        size: Size::new(10, 10),
    };
    assert_eq!(truths.off(5.0, 3.4, 8.5), Some(-0.5));
    assert_eq!(truths.off(5.0, 3.0, 8.5), Some(4.5));
}
