//! What curves and matches show of true contours, against a slow obvious twin.

use std::f32::consts::{FRAC_PI_2, TAU};

use evaluate::{Compared, Contours, Settings, Tracked, Truths, merged, near};
use messages::{
    Contour, ContourKind, ContourPoint, Curve, Curves, Edge, Match, MatchPoint, Matches, NONE,
    Owned, Size,
};

const SIZE: Size = Size::new(160, 120);
const VARIANCE: f32 = 10.0;
const SEEN: u32 = 0b111;

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

fn point(x: f32, y: f32, contrast: f32) -> ContourPoint {
    ContourPoint {
        x,
        y,
        disparity: 30.0,
        contrast,
        seen: SEEN,
    }
}

/// A straight contour of whole steps.
fn line(from: [f32; 2], step: [f32; 2], count: usize, contrast: f32) -> Contour {
    let at = |i: usize| {
        point(
            from[0] + step[0] * i as f32,
            from[1] + step[1] * i as f32,
            contrast,
        )
    };
    Contour {
        kind: ContourKind::Silhouette,
        points: (0..count).map(at).collect(),
    }
}

fn ring(centre: [f32; 2], radius: f32, count: usize) -> Contour {
    let at = |i: usize| {
        let (sin, cos) = ((i % count) as f32 / count as f32 * TAU).sin_cos();
        point(centre[0] + radius * cos, centre[1] + radius * sin, 80.0)
    };
    Contour {
        kind: ContourKind::Crease,
        points: (0..=count).map(at).collect(),
    }
}

/// A curve of points, each with the direction across it.
type Drawn = Vec<(f32, f32, f32)>;

fn curves(drawn: &[Drawn]) -> Owned<Curves> {
    let mut curves = Owned::<Curves>::new(SIZE);
    curves.fill(|room| {
        for (label, points) in (0..).zip(drawn) {
            let first = room.points.len() as u32;
            room.points.extend_from_slice(
                &points
                    .iter()
                    .map(|&(x, y, orientation)| Edge {
                        x,
                        y,
                        orientation,
                        ..Edge::default()
                    })
                    .collect::<Vec<_>>(),
            );
            room.curves.push(Curve {
                label,
                first,
                count: points.len() as u32,
                parent: NONE,
                ..Curve::default()
            });
        }
    });
    curves
}

/// A curve that is matched, and the disparities of its points.
type Matched = (usize, Vec<f32>);

fn matches(drawn: &[Drawn], matched: &[Matched]) -> Owned<Matches> {
    let starts: Vec<usize> = drawn
        .iter()
        .scan(0, |start, points| {
            let own = *start;
            *start += points.len();
            Some(own)
        })
        .collect();
    let mut matches = Owned::<Matches>::new(SIZE);
    matches.fill(|room| {
        for (curve, disparities) in matched {
            let first = room.points.len() as u32;
            for (i, &disparity) in disparities.iter().enumerate() {
                let (x, y, _) = drawn[*curve][i];
                room.points.push(MatchPoint {
                    x,
                    y,
                    disparity,
                    point: (starts[*curve] + i) as u32,
                    ..MatchPoint::default()
                });
            }
            room.matches.push(Match {
                curves: [*curve as u32, NONE, NONE],
                first,
                count: disparities.len() as u32,
                ..Match::default()
            });
        }
    });
    matches
}

fn known(contours: &[Contour]) -> Contours {
    Contours::new(&Settings::default(), contours, (3, SIZE), VARIANCE)
}

fn tracked(contours: &[Contour], drawn: &[Drawn]) -> Tracked {
    known(contours).tracked(curves(drawn).view())
}

/// A curve that lies on a level line.
fn level(y: f32, columns: std::ops::Range<u32>) -> Drawn {
    columns.map(|x| (x as f32, y, FRAC_PI_2)).collect()
}

#[test]
fn a_stretch_counts_when_it_is_long_enough_and_has_contrast() {
    let long = line([10.0, 20.0], [1.0, 0.0], 41, 80.0);
    let short = line([10.0, 60.0], [1.0, 0.0], 30, 80.0);
    let weak = line([10.0, 100.0], [1.0, 0.0], 60, 15.0);
    let all = [long.clone(), short, weak];
    let found = tracked(&all, &[]);
    assert!((found.contours - 40.0).abs() < 1e-3, "{found:?}");
    assert_eq!(found.on_curves, 0.0);
    // Without contrast in its middle it is two, too short both.
    let mut broken = long;
    broken.points[20].contrast = 3.0;
    assert_eq!(tracked(&[broken], &[]).contours, 0.0);
}

#[test]
fn a_closed_contour_is_measured_once_round_wherever_it_begins() {
    let round = ring([80.0, 60.0], 30.0, 190);
    let whole = tracked(std::slice::from_ref(&round), &[]).contours;
    assert!((whole - TAU * 30.0).abs() < 0.1, "{whole}");
    // A weak place cuts it once, and not where its list of points begins too.
    for weak in [0, 50, 189] {
        let mut cut = round.clone();
        cut.points[weak].contrast = 0.0;
        if weak == 0 {
            cut.points[190].contrast = 0.0;
        }
        let rest = tracked(&[cut], &[]).contours;
        assert!((rest - whole * 189.0 / 190.0).abs() < 0.1, "{rest}");
    }
}

#[test]
fn of_two_contours_side_by_side_the_stronger_counts_until_they_are_two_sigma_apart() {
    let strong = line([10.0, 50.0], [1.0, 0.0], 61, 80.0);
    for (apart, counted) in [(4.0, 1), (6.0, 1), (6.6, 2), (12.0, 2)] {
        let weak = line([10.0, 50.0 + apart], [1.0, 0.0], 61, 40.0);
        assert_eq!(apart < merged(VARIANCE), counted == 1);
        let length = tracked(&[strong.clone(), weak], &[]).contours;
        assert!((length - 60.0 * counted as f32).abs() < 1e-3, "{length}");
    }
    // One that crosses is not beside it.
    let across = line([40.0, 20.0], [0.0, 1.0], 61, 40.0);
    assert!((tracked(&[strong, across], &[]).contours - 120.0).abs() < 1e-3);
}

#[test]
fn a_contour_lies_on_curves_that_are_near_and_run_along_it() {
    let contour = [line([10.0, 50.0], [1.0, 0.0], 101, 80.0)];
    let reach = near(VARIANCE);
    let on = |drawn: &[Drawn]| tracked(&contour, drawn).on_curves;
    assert!((on(&[level(50.0 + 0.9 * reach, 10..111)]) - 100.0).abs() < 1e-3);
    assert_eq!(on(&[level(50.0 + 1.1 * reach, 10..111)]), 0.0);
    let half = on(&[level(50.0, 10..60)]);
    assert!((half - 50.0).abs() < 2.0 * reach, "{half}");
    // Across it lies nothing of it.
    let across = (30..70).map(|y| (60.0, y as f32, 0.0)).collect();
    assert_eq!(on(&[across]), 0.0);
}

#[test]
fn a_curve_is_seen_by_all_where_four_fifths_of_its_points_are() {
    let seen_of = |hidden: usize, beyond: u32| {
        let mut contour = line([10.0, 50.0], [1.0, 0.0], 101, 80.0);
        for point in &mut contour.points[..hidden] {
            point.seen = 0b011;
        }
        tracked(&[contour], &[level(50.0, 10..111 + beyond)]).seen
    };
    assert_eq!((seen_of(0, 0), seen_of(15, 0), seen_of(25, 0)), (1, 1, 0));
    // What lies beside every contour is none that all see.
    assert_eq!(seen_of(0, 40), 0);
}

#[test]
fn points_are_off_by_what_their_contour_says_and_elsewhere_by_the_truth_around() {
    let mut contours = [
        line([10.0, 30.0], [1.0, 0.0], 61, 80.0),
        line([10.0, 60.0], [1.0, 0.0], 61, 80.0),
    ];
    contours[1].kind = ContourKind::Shadow;
    // The ground has another disparity than the silhouette before it.
    let ground = vec![20.0; SIZE.pixels()];
    let truths = Truths {
        disparity: &ground,
        size: SIZE,
    };
    let drawn = [
        level(30.0, 10..71),
        level(60.0, 10..71),
        level(90.0, 10..71),
    ];
    let off = |by: [f32; 3]| {
        let of = [30.0, 30.0, 20.0];
        let matched: Vec<Matched> = (0..3).map(|i| (i, vec![of[i] + by[i]; 61])).collect();
        let (curves, matches) = (curves(&drawn), matches(&drawn, &matched));
        known(&contours).compared(curves.view(), matches.view(), &truths, 0)
    };
    let right = off([0.1, 0.1, 0.1]);
    let expected = Compared {
        curves: 3,
        seen: 2,
        points: 183,
        firm: 122,
        covered: right.covered,
        ..Compared::default()
    };
    assert_eq!(right, expected);
    assert!((right.covered - 120.0).abs() < 1e-3);
    // On a shadow's border, which is soft, one pixel is forgiven and two are not.
    let soft = off([0.1, 1.5, 0.1]);
    assert_eq!((soft.firm_over_one, soft.over_two, soft.wrong), (0, 0, 0));
    let shadow = off([0.1, 2.5, 0.1]);
    assert_eq!(
        (shadow.firm_over_one, shadow.over_two, shadow.wrong),
        (0, 61, 1)
    );
    assert!((shadow.covered - 60.0).abs() < 1e-3);
    let elsewhere = off([1.5, 0.1, -2.5]);
    assert_eq!((elsewhere.firm_over_one, elsewhere.over_two), (122, 61));
    // The ground's disparity is wrong for what stands before it.
    assert_eq!(off([-10.0, 0.0, 0.0]).wrong, 1);
}

/// Random contours, curves around them, and matches.
fn world(seed: u64) -> (Vec<Contour>, Vec<Drawn>, Vec<Matched>) {
    let mut random = Random(seed);
    let mut contours = Vec::new();
    for number in 0..6 {
        let centre = [40.0 + 80.0 * random.unit(), 40.0 + 40.0 * random.unit()];
        let radius = 8.0 + 26.0 * random.unit();
        let mut contour = ring(centre, radius, (6.0 * radius) as usize);
        contour.kind = ContourKind::ALL[number % 4];
        let slope = random.unit();
        let last = contour.points.len() - 1;
        for (i, point) in contour.points.iter_mut().enumerate() {
            let turn = TAU * i as f32 / last as f32;
            point.contrast = 40.0 + 40.0 * (turn + 6.0 * slope).sin();
            point.disparity = 30.0 + 2.0 * turn.sin() + number as f32;
            point.seen = if turn.cos() > -0.8 { SEEN } else { 0b001 };
        }
        // Half of them are open.
        match random.unit() < 0.5 {
            true => contour.points.truncate(2 * last / 3),
            false => contour.points[last] = contour.points[0],
        }
        contours.push(contour);
    }
    let mut drawn = Vec::new();
    let mut matched = Vec::new();
    for contour in &contours {
        let away = 4.0 * random.unit();
        let middle = contour
            .points
            .iter()
            .fold([0.0; 2], |sum, p| [sum[0] + p.x, sum[1] + p.y]);
        let middle = middle.map(|sum| sum / contour.points.len() as f32);
        let share = 0.3 + 0.7 * random.unit();
        let count = (contour.points.len() as f32 * share) as usize;
        let points: Drawn = contour.points[..count]
            .iter()
            .map(|p| {
                let turned = 0.6 * (random.unit() - 0.5);
                let direction = (p.y - middle[1]).atan2(p.x - middle[0]) + turned;
                (p.x + away * direction.cos(), p.y.round(), direction)
            })
            .collect();
        if random.unit() < 0.8 {
            let off = 3.0 * (random.unit() - 0.5);
            let disparities = (0..count).map(|i| contour.points[i].disparity + off + random.unit());
            matched.push((drawn.len(), disparities.collect()));
        }
        drawn.push(points);
    }
    (contours, drawn, matched)
}

/// Every point of every contour with all that is asked of it, found the slow way.
struct Plain {
    x: f32,
    y: f32,
    normal: f32,
    disparity: f32,
    strength: f32,
    weight: f32,
    kind: ContourKind,
    is_seen: bool,
    has_contrast: bool,
    contour: usize,
}

fn plain(contours: &[Contour]) -> Vec<Plain> {
    let mut all = Vec::new();
    for (number, contour) in contours.iter().enumerate() {
        let is_closed = contour.points[0] == contour.points[contour.points.len() - 1];
        let count = contour.points.len() - usize::from(is_closed);
        // A closed contour goes on at its start.
        let at = |i: isize| match is_closed {
            true => Some(&contour.points[i.rem_euclid(count as isize) as usize]),
            false => usize::try_from(i).ok().and_then(|i| contour.points.get(i)),
        };
        for i in 0..count as isize {
            let own = &contour.points[i as usize];
            let (before, after) = (at(i - 1).unwrap_or(own), at(i + 1).unwrap_or(own));
            let way = |p: &ContourPoint| (p.x - own.x).hypot(p.y - own.y) / 2.0;
            let mut reach = 8;
            while at(i - reach).is_none() || at(i + reach).is_none() {
                reach -= 1;
            }
            let around = (i - reach..=i + reach).filter_map(at).map(|p| p.contrast);
            all.push(Plain {
                x: own.x,
                y: own.y,
                normal: (after.y - before.y).atan2(after.x - before.x) + FRAC_PI_2,
                disparity: own.disparity,
                strength: around.sum::<f32>() / (2 * reach + 1) as f32,
                weight: way(before) + way(after),
                kind: contour.kind,
                is_seen: own.seen == SEEN,
                has_contrast: own.contrast >= 16.0,
                contour: number,
            });
        }
    }
    all
}

/// The angle between two lines, at most a right one.
fn angle(a: f32, b: f32) -> f32 {
    let turned = (a - b).rem_euclid(std::f32::consts::PI);
    turned.min(std::f32::consts::PI - turned)
}

fn is_masked(own: &Plain, all: &[Plain]) -> bool {
    all.iter().any(|other| {
        let (dx, dy) = (other.x - own.x, other.y - own.y);
        let away = dx.hypot(dy);
        // Beside it, and not ahead.
        let is_beside = angle(dy.atan2(dx), own.normal) < TAU / 8.0;
        let across = away * (dy.atan2(dx) - own.normal).cos().abs();
        other.has_contrast
            && other.strength > own.strength
            && angle(other.normal, own.normal) <= TAU / 8.0
            && away <= merged(VARIANCE)
            && is_beside
            && across > 1.0
    })
}

fn counted(contours: &[Contour], all: &[Plain]) -> Vec<bool> {
    let free: Vec<bool> = all
        .iter()
        .map(|p| p.has_contrast && !is_masked(p, all))
        .collect();
    let mut counts = vec![false; all.len()];
    for (number, contour) in contours.iter().enumerate() {
        let own: Vec<usize> = (0..all.len())
            .filter(|&i| all[i].contour == number)
            .collect();
        let is_closed = contour.points[0] == contour.points[contour.points.len() - 1];
        for at in 0..own.len() {
            // As far as it goes on free to both sides, from every point anew.
            let mut reached = std::collections::BTreeSet::new();
            for step in [1, -1_isize] {
                let mut i = at as isize;
                loop {
                    let index = match is_closed {
                        true => Some(i.rem_euclid(own.len() as isize) as usize),
                        false => usize::try_from(i).ok().filter(|&i| i < own.len()),
                    };
                    match index.filter(|&index| free[own[index]]) {
                        Some(index) if i == at as isize || !reached.contains(&index) => {
                            reached.insert(index);
                        }
                        _ => break,
                    }
                    i += step;
                }
            }
            let length: f32 = reached.iter().map(|&i| all[own[i]].weight).sum();
            counts[own[at]] = length >= 32.0;
        }
    }
    counts
}

#[test]
fn every_figure_is_what_its_definition_says() {
    let (mut masked, mut wrong, mut hidden) = (0, 0, 0);
    for seed in 1..9 {
        let (contours, drawn, matched) = world(seed);
        let all = plain(&contours);
        let counts = counted(&contours, &all);
        let shows = |(x, y, direction): (f32, f32, f32), p: &Plain| {
            let away = (x - p.x).hypot(y - p.y);
            let is_near = away <= near(VARIANCE) && angle(direction, p.normal) <= TAU / 8.0;
            (p.has_contrast && is_near).then_some(away)
        };
        let nearest = |place: (f32, f32, f32)| {
            let near = all.iter().filter_map(|p| Some((shows(place, p)?, p)));
            near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, p)| p)
        };
        let sum = |is_meant: &dyn Fn(usize) -> bool| -> f32 {
            let meant = (0..all.len()).filter(|&i| counts[i] && is_meant(i));
            meant.map(|i| all[i].weight).sum()
        };
        let is_on = |i: usize| {
            drawn
                .iter()
                .flatten()
                .any(|&place| shows(place, &all[i]).is_some())
        };
        let is_seen = |points: &Drawn| {
            let on = points
                .iter()
                .filter(|&&place| nearest(place).is_some_and(|p| p.is_seen));
            on.count() as f32 >= 0.8 * points.len() as f32
        };
        let found = tracked(&contours, &drawn);
        let close = |a: f32, b: f32| (a - b).abs() < 0.01;
        assert!(close(found.contours, sum(&|_| true)), "{found:?}");
        assert!(close(found.on_curves, sum(&is_on)), "{found:?}");
        let rest = (0..all.len()).filter(|&i| all[i].has_contrast && !counts[i]);
        let rest = rest.map(|i| all[i].weight).sum();
        assert!(close(found.left_out, rest), "{found:?}");
        for (kind, [length, on]) in ContourKind::ALL.into_iter().zip(found.kinds) {
            assert!(close(length, sum(&|i| all[i].kind == kind)));
            assert!(close(on, sum(&|i| all[i].kind == kind && is_on(i))));
        }
        let seen: Vec<bool> = drawn.iter().map(is_seen).collect();
        assert_eq!(found.curves as usize, drawn.len());
        assert_eq!(
            found.seen as usize,
            seen.iter().filter(|seen| **seen).count()
        );

        let ground = vec![25.0; SIZE.pixels()];
        let truths = Truths {
            disparity: &ground,
            size: SIZE,
        };
        let mut expected = Compared::default();
        let mut covered = vec![false; all.len()];
        for (curve, disparities) in &matched {
            let mut offs = Vec::new();
            for (&place, disparity) in drawn[*curve].iter().zip(disparities) {
                let shown = (0..all.len()).filter(|&i| shows(place, &all[i]).is_some());
                let shown: Vec<(usize, f32)> =
                    shown.map(|i| (i, disparity - all[i].disparity)).collect();
                for (i, off) in &shown {
                    covered[*i] |= off.abs() <= 2.0;
                }
                let best = shown.iter().min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
                let off = best.map_or(disparity - 25.0, |(_, off)| *off);
                let is_shadow = nearest(place).is_some_and(|p| p.kind == ContourKind::Shadow);
                expected.points += 1;
                expected.over_two += u32::from(off.abs() > 2.0);
                expected.firm += u32::from(!is_shadow);
                expected.firm_over_one += u32::from(!is_shadow && off.abs() > 1.0);
                offs.push(off);
            }
            let mean = offs.iter().sum::<f32>() / offs.len() as f32;
            expected.wrong += u32::from(mean.abs() > 2.0);
            expected.curves += 1;
            expected.seen += u32::from(seen[*curve]);
        }
        let (curves, matches) = (curves(&drawn), matches(&drawn, &matched));
        let compared = known(&contours).compared(curves.view(), matches.view(), &truths, 0);
        assert!(close(compared.covered, sum(&|i| covered[i])));
        expected.covered = compared.covered;
        assert_eq!(compared, expected);
        masked += all.iter().filter(|p| is_masked(p, &all)).count();
        wrong += expected.over_two;
        hidden += seen.iter().filter(|seen| !**seen).count();
    }
    assert!(
        masked > 50 && wrong > 50 && hidden > 5,
        "{masked} {wrong} {hidden}"
    );
}
