//! Agreement of two reference views: what stands in for the truth where none is known.
//!
//! A triple is matched twice, with the results in two of its views. A point seen in both has the same disparity in both,
//! unless one of them is wrong. A mistake that both make alike is not found.

use matching::{Reference, Settings};
use messages::{Point, Size};

/// The same settings with another reference view, next to theirs.
pub(super) fn elsewhere(settings: &Settings, views: usize) -> Settings {
    Settings {
        reference: Reference::View(match settings.reference.index(views) {
            0 => 1,
            view => view as u32 - 1,
        }),
        ..settings.clone()
    }
}

/// Steps to the right from the reference view to the other one.
pub(super) fn steps(settings: &Settings, views: usize) -> f32 {
    match settings.reference.index(views) {
        0 => 1.0,
        _ => -1.0,
    }
}

/// Share of the points that have others at their place in the other view, all of which differ by over a pixel of
/// disparity. `steps` says how many steps to the right that view stands.
pub(super) fn disagreement(points: &[Point], others: &[Point], steps: f32, size: Size) -> f64 {
    let (width, height) = (i64::from(size.width), i64::from(size.height));
    let place = |x: i64, y: i64| {
        let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
        is_inside.then_some((y * width + x) as usize)
    };
    // Points by pixel: where each pixel's begin, as in a table of contents.
    let pixel = |p: &Point| place(p.u.round() as i64, p.v.round() as i64);
    let mut starts = vec![0usize; size.pixels() + 1];
    for place in others.iter().filter_map(pixel) {
        starts[place + 1] += 1;
    }
    for at in 1..starts.len() {
        starts[at] += starts[at - 1];
    }
    let mut next = starts.clone();
    let mut disparities = vec![0f32; starts.last().copied().unwrap_or_default()];
    for other in others {
        if let Some(place) = pixel(other) {
            disparities[next[place]] = other.disparity;
            next[place] += 1;
        }
    }
    let (mut met, mut contradicted) = (0u64, 0u64);
    for point in points {
        let (x, y) = (
            (point.u - steps * point.disparity).round() as i64,
            point.v.round() as i64,
        );
        let mut least = f32::INFINITY;
        for row in y - 1..=y + 1 {
            for column in x - 1..=x + 1 {
                if let Some(place) = place(column, row) {
                    let there = &disparities[starts[place]..starts[place + 1]];
                    let nearest = there.iter().map(|d| (d - point.disparity).abs());
                    least = nearest.fold(least, f32::min);
                }
            }
        }
        met += u64::from(least.is_finite());
        contradicted += u64::from(least.is_finite() && least > 1.0);
    }
    contradicted as f64 / met.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(u: f32, disparity: f32) -> Point {
        Point {
            u,
            v: 3.0,
            disparity,
            ..Point::default()
        }
    }

    #[test]
    fn a_point_is_contradicted_where_all_it_meets_in_the_other_view_differ() {
        let size = Size::new(40, 8);
        // The other view stands one step to the right: everything lies its disparity further left there.
        let others = [at(10.0, 5.0), at(21.0, 9.0), at(21.4, 4.1)];
        let share = |points: &[Point]| disagreement(points, &others, 1.0, size);
        assert_eq!(share(&[at(15.0, 5.2)]), 0.0);
        assert_eq!(share(&[at(13.0, 3.0)]), 1.0);
        assert_eq!(share(&[at(25.0, 4.0)]), 0.0, "one of two agrees");
        assert_eq!(share(&[at(38.0, 4.0)]), 0.0, "nothing is there");
        assert_eq!(share(&[at(15.0, 5.2), at(13.0, 3.0)]), 0.5);
    }
}
