//! Edges against what is known of the picture, and against a slow and obvious twin.
#![expect(clippy::unwrap_used, reason = "tests")]

mod pictures;

use std::f64::consts::{PI, SQRT_2, TAU};

use filter::{Filter, Interpolation, NEARLY_HORIZONTAL, Scaling, Settings};
use messages::settings::Settings as _;
use messages::{Edge, Edges, EdgesRoom, ImageView, List, Owned, Size};
use pictures::{mirrored, noise, taken, texture};

/// The edges of every channel.
fn edges(settings: &Settings, pixels: &[u8], size: Size) -> Vec<Vec<Edge>> {
    let mut filter = Filter::new(settings, size);
    let mut room = Owned::<Edges>::new(size);
    filter.begin(ImageView { pixels }, size);
    let mut of = |channel| {
        room.fill(|room| filter.edges(channel, room));
        room.view().edges.to_vec()
    };
    (0..settings.channels.len()).map(&mut of).collect()
}

fn one_channel(variance: f32) -> Settings {
    Settings {
        channels: vec![variance],
        smoothing: None,
        ..Settings::default()
    }
}

fn degrees_between(a: f64, b: f64) -> f64 {
    ((a - b + PI).rem_euclid(TAU) - PI).abs().to_degrees()
}

#[test]
fn the_defaults_and_those_of_the_thesis_are_in_range() {
    assert_eq!(Settings::default().check(), Ok(()));
    assert_eq!(Settings::thesis().check(), Ok(()));
    assert!(
        Settings {
            channels: vec![0.1],
            ..Settings::default()
        }
        .check()
        .is_err()
    );
}

/// How far off an edge may be placed in a channel, given that gray levels are whole numbers.
fn tolerance(settings: &Settings, variance: f32) -> f32 {
    match settings.interpolation {
        // t(1 − t)(1 − 2t)/2 has its largest value 0.048.
        Interpolation::Linear => 0.008 + 0.048 / variance,
        Interpolation::Cubic => 0.008 + 0.012 / variance,
    }
}

#[test]
fn an_edge_is_found_in_every_row_or_column_where_it_is_and_points_from_dark_to_bright() {
    let size = Size::new(48, 48);
    let both = [Interpolation::Linear, Interpolation::Cubic];
    for (part, interpolation) in (0..10).flat_map(|part| both.map(|way| (part, way))) {
        let place = 23.0 + part as f32 / 10.0;
        let settings = Settings {
            channels: vec![30.0, 8.0, 4.0, 2.0, 1.5, 1.0],
            interpolation,
            ..Settings::default()
        };
        for (dark_first, upright) in [(true, true), (false, true), (true, false), (false, false)] {
            let sign = if dark_first { 1.0 } else { -1.0 };
            let brightness = |p: f64| 125.0 + 100.0 * sign * (1.2 * (p - f64::from(place))).tanh();
            let pixels = taken(size, |x, y| brightness(if upright { x } else { y }));
            let direction =
                if upright { 0.0 } else { PI / 2.0 } + if dark_first { 0.0 } else { PI };
            for (edges, &variance) in edges(&settings, &pixels, size)
                .iter()
                .zip(&settings.channels)
            {
                assert_eq!(edges.len(), 48);
                for (i, edge) in edges.iter().enumerate() {
                    let (across, along) = if upright {
                        (edge.x, edge.y)
                    } else {
                        (edge.y, edge.x)
                    };
                    assert_eq!(along, i as f32);
                    let off = (across - place).abs();
                    assert!(
                        off < tolerance(&settings, variance),
                        "σ² = {variance}: {edge:?}, not {place}"
                    );
                    assert!(
                        degrees_between(edge.orientation.into(), direction) < 0.05,
                        "{edge:?}"
                    );
                    assert!(edge.is_in_row() || !upright);
                }
            }
        }
    }
}

#[test]
fn an_edge_of_any_direction_lies_on_the_line_and_points_across_it() {
    let size = Size::new(72, 72);
    for step in 0..40 {
        let direction = f64::from(step) * TAU / 40.0 + 0.01;
        let (nx, ny) = (direction.cos(), direction.sin());
        let distance = |x: f64, y: f64| (x - 35.3) * nx + (y - 36.1) * ny;
        let pixels = taken(size, |x, y| if distance(x, y) < 0.0 { 60.0 } else { 180.0 });
        for edges in edges(
            &Settings {
                channels: vec![8.0, 2.0],
                smoothing: None,
                ..Settings::default()
            },
            &pixels,
            size,
        ) {
            // Far from the corners, where the line meets its own reflection.
            let inner = |e: &&Edge| (f64::from(e.x) - 35.5).hypot(f64::from(e.y) - 35.5) < 20.0;
            let inner: Vec<_> = edges.iter().filter(inner).collect();
            assert!(inner.len() >= 20, "{} edges at {direction}", inner.len());
            for edge in inner {
                let off = distance(edge.x.into(), edge.y.into());
                assert!(off.abs() < 0.06, "{edge:?} lies {off} off");
                let turned = degrees_between(edge.orientation.into(), direction);
                assert!(turned < 1.5, "{edge:?} is turned by {turned} degrees");
            }
        }
    }
}

#[test]
fn the_contour_of_a_blob_is_the_circle_that_theory_says() {
    let (size, variance) = (Size::new(80, 80), 18.0);
    let (cx, cy) = (40.3, 38.8);
    let pixels = taken(size, |x, y| {
        20.0 + 220.0 * (-((x - cx).powi(2) + (y - cy).powi(2)) / (2.0 * variance)).exp()
    });
    for channel in [4.0, 10.0] {
        // G of one variance after another is G of their sum, and ∇²G is zero at r = √2 σ.
        let radius = SQRT_2 * (variance + f64::from(channel)).sqrt();
        let edges = &edges(
            &Settings {
                floor: 2.0,
                ..one_channel(channel)
            },
            &pixels,
            size,
        )[0];
        assert!(edges.len() > 30);
        for edge in edges {
            let (dx, dy) = (f64::from(edge.x) - cx, f64::from(edge.y) - cy);
            assert!(
                (dx.hypot(dy) - radius).abs() < 0.05,
                "{edge:?} at {} not {radius}",
                dx.hypot(dy)
            );
            assert!(
                degrees_between(edge.orientation.into(), (-dy).atan2(-dx)) < 1.0,
                "{edge:?}"
            );
        }
    }
}

#[test]
fn magnitudes_are_gray_levels_per_pixel() {
    let size = Size::new(64, 64);
    let pixels = taken(size, |x, y| {
        20.0 + 0.9 * x
            + 1.2 * y
            + if (x - 31.5).hypot(y - 31.5) < 12.0 {
                0.0
            } else {
                8.0
            }
    });
    // A ramp of slope 1.5, and a circle on it so that there is something to find.
    let rim = |e: &&Edge| (f64::from(e.x) - 31.5).hypot(f64::from(e.y) - 31.5) > 20.0;
    let ramp: Vec<u8> = taken(size, |x, y| 20.0 + 0.9 * x + 1.2 * y);
    let settings = Settings {
        floor: 0.0,
        smoothing: Some(1.5),
        ..one_channel(8.0)
    };
    let all = [
        edges(&settings, &pixels, size),
        edges(&settings, &ramp, size),
    ]
    .concat()
    .concat();
    let inner: Vec<_> = all
        .iter()
        .filter(rim)
        .filter(|e| e.x > 6.0 && e.x < 57.0 && e.y > 6.0 && e.y < 57.0)
        .collect();
    assert!(!inner.is_empty());
    for edge in inner {
        assert!((edge.magnitude - 1.5).abs() < 0.1, "{edge:?}");
    }
}

#[test]
fn a_constant_image_has_no_edges_in_any_profile() {
    let size = Size::new(48, 33);
    for settings in [
        Settings::default(),
        Settings::thesis(),
        Settings {
            floor: 0.0,
            ..Settings::default()
        },
    ] {
        for level in [0, 90, 255] {
            let all = edges(&settings, &vec![level; size.pixels()], size);
            assert_eq!(all.concat(), [], "level {level}");
        }
    }
}

#[test]
fn the_border_of_a_bright_image_is_no_edge() {
    let size = Size::new(70, 50);
    let pixels = taken(size, |x, y| {
        if (x - 35.0).hypot(y - 25.0) < 10.0 {
            60.0
        } else {
            250.0
        }
    });
    for edges in edges(
        &Settings {
            floor: 0.0,
            ..Settings::thesis()
        },
        &pixels,
        size,
    ) {
        let strong = edges.iter().filter(|e| e.magnitude > 2.0);
        for edge in strong {
            let from_centre = (edge.x - 35.0).hypot(edge.y - 25.0);
            assert!(from_centre < 16.0, "{edge:?}");
        }
    }
}

#[test]
fn profiles_are_the_gray_levels_on_either_side_and_repeat_the_border() {
    let size = Size::new(40, 36);
    let pixels = taken(size, |x, _| if x < 18.2 { 50.0 } else { 150.0 });
    for edge in &edges(&one_channel(1.5), &pixels, size)[0] {
        assert_eq!(edge.profile[..3], [50; 3]);
        assert_eq!(edge.profile[5..], [150; 3]);
    }
    let near_border = taken(size, |x, _| if x < 2.5 { 50.0 } else { 150.0 });
    for edge in &edges(&one_channel(1.5), &near_border, size)[0] {
        assert_eq!((edge.profile[0], edge.profile[7]), (50, 150), "{edge:?}");
    }
}

#[test]
fn profiles_are_interpolated_between_pixels() {
    let size = Size::new(64, 32);
    // A ramp with a step: beside the step every sample's place can be read from its value.
    let pixels: Vec<u8> = (0..size.pixels())
        .map(|i| (i % 64 * 2 + if i % 64 < 30 { 0 } else { 60 }) as u8)
        .collect();
    let edges = &edges(&one_channel(1.5), &pixels, size)[0];
    let edge = edges
        .iter()
        .find(|e| (e.x - 29.5).abs() < 0.5 && e.y == 10.0)
        .unwrap();
    for (&sample, offset) in edge.profile.iter().zip(Edge::PROFILE_OFFSETS) {
        let step = if offset < 0.0 { 0.0 } else { 60.0 };
        let expected = 2.0 * (edge.x + offset) + step;
        assert!(
            (f32::from(sample) - expected).abs() < 0.6,
            "{sample} at {offset}, not {expected}"
        );
    }
}

#[test]
fn the_scaling_of_the_thesis_makes_the_largest_gradient_255() {
    let size = Size::new(90, 60);
    let pixels = texture(size, 3);
    let literal = Settings {
        scaling: Scaling::Picture,
        floor: 0.0,
        ..Settings::thesis()
    };
    let absolute = Settings {
        scaling: Scaling::Absolute,
        ..literal.clone()
    };
    let sobel = (0..size.pixels()).map(|i| {
        let (gx, gy) = sobel(&pixels, size, (i % 90) as isize, (i / 90) as isize);
        gx.hypot(gy)
    });
    let largest = sobel.fold(0.0, f64::max);
    for (literal, absolute) in edges(&literal, &pixels, size)
        .into_iter()
        .zip(edges(&absolute, &pixels, size))
    {
        assert_eq!(literal.len(), absolute.len());
        for (literal, absolute) in literal.iter().zip(&absolute) {
            let expected = f64::from(absolute.magnitude) * 255.0 / largest;
            // Both are rounded to steps.
            let steps = (0.5 + 0.5 * 255.0 / largest) / f64::from(Edge::MAGNITUDE_STEPS);
            assert!(
                (f64::from(literal.magnitude) - expected).abs() < 1e-3 * expected + steps,
                "{literal:?}"
            );
            assert!(literal.magnitude <= 255.1);
        }
    }
}

#[test]
fn the_floor_drops_the_weak_edges_and_nothing_else() {
    let size = Size::new(80, 64);
    let pixels = texture(size, 8);
    let all = &edges(
        &Settings {
            floor: 0.0,
            ..one_channel(2.0)
        },
        &pixels,
        size,
    )[0];
    let strong = &edges(
        &Settings {
            floor: 9.0,
            ..one_channel(2.0)
        },
        &pixels,
        size,
    )[0];
    let expected: Vec<Edge> = all.iter().filter(|e| e.magnitude > 9.0).copied().collect();
    assert!(!expected.is_empty() && expected.len() < all.len());
    assert_eq!(strong, &expected);
}

#[test]
fn edges_come_in_raster_order_and_at_most_one_a_pixel() {
    for (width, height, seed) in [(32, 32, 1), (101, 37, 2), (64, 61, 3), (131, 67, 4)] {
        let size = Size::new(width, height);
        for pixels in [noise(size, seed), texture(size, seed)] {
            let settings = Settings {
                channels: vec![8.0, 2.0, 0.5],
                floor: 0.0,
                ..Settings::default()
            };
            for edges in edges(&settings, &pixels, size) {
                assert!(edges.len() > 20);
                let pixel = |e: &Edge| (e.y.floor() as u32, e.x.floor() as u32);
                assert!(
                    edges
                        .windows(2)
                        .all(|pair| pixel(&pair[0]) < pixel(&pair[1])),
                    "{size}"
                );
                assert!(edges.iter().all(|e| e.x >= 0.0 && e.y >= 0.0));
                assert!(
                    edges
                        .iter()
                        .all(|e| e.x <= (width - 1) as f32 && e.y <= (height - 1) as f32)
                );
                assert!(edges.iter().all(|e| e.orientation > -std::f32::consts::PI));
            }
        }
    }
}

#[test]
fn the_points_of_a_contour_are_a_dense_chain_and_hardly_one_is_doubled() {
    let size = Size::new(120, 120);
    let (mut all, mut close, mut wide) = (0, 0, 0);
    for (seed, radius) in [20.0, 23.1, 27.5, 33.3, 38.2, 41.7].into_iter().enumerate() {
        let (cx, cy) = (60.0 + 0.23 * seed as f64, 59.0 + 0.31 * seed as f64);
        let pixels = taken(size, |x, y| {
            if (x - cx).hypot(y - cy) < radius {
                180.0
            } else {
                60.0
            }
        });
        for edges in edges(
            &Settings {
                floor: 4.0,
                ..Settings::default()
            },
            &pixels,
            size,
        ) {
            let mut chain: Vec<(f64, &Edge)> = edges
                .iter()
                .map(|e| ((f64::from(e.y) - cy).atan2(f64::from(e.x) - cx), e))
                .collect();
            chain.sort_by(|a, b| a.0.total_cmp(&b.0));
            for i in 0..chain.len() {
                let (a, b) = (chain[i].1, chain[(i + 1) % chain.len()].1);
                let gap = (a.x - b.x).hypot(a.y - b.y);
                assert!(gap < 2.7, "{gap} between {a:?} and {b:?}");
                all += 1;
                // Where a contour becomes nearly horizontal, a cut of each kind may be taken for the one to list.
                close += usize::from(gap < 0.45);
                wide += usize::from(gap > 2.0);
            }
        }
    }
    assert!(
        all > 2000 && close * 100 < all && wide * 50 < all,
        "of {all} steps {close} are short, {wide} are wide"
    );
}

#[test]
fn the_same_image_gives_the_same_bits() {
    let size = Size::new(96, 71);
    let pixels = texture(size, 21);
    let bits = || {
        let all = edges(&Settings::default(), &pixels, size).concat();
        all.iter()
            .flat_map(|e| [e.x, e.y, e.magnitude, e.orientation].map(f32::to_bits))
            .collect::<Vec<_>>()
    };
    assert!(bits().len() > 100);
    assert_eq!(bits(), bits());
}

#[test]
fn a_room_too_small_takes_the_first_edges_and_counts_the_rest() {
    let size = Size::new(64, 48);
    let pixels = texture(size, 2);
    let settings = Settings {
        floor: 0.0,
        ..one_channel(2.0)
    };
    let all = &edges(&settings, &pixels, size)[0];
    let mut slots = vec![Edge::default(); 50];
    let mut room = EdgesRoom {
        edges: List::new(&mut slots),
    };
    let mut filter = Filter::new(&settings, size);
    filter.begin(ImageView { pixels: &pixels }, size);
    filter.edges(0, &mut room);
    assert_eq!(&*room.edges, &all[..50]);
    assert_eq!(room.edges.refused(), all.len() - 50);
}

/// Sobel's operator over 8, in a mirrored image.
fn sobel(pixels: &[u8], size: Size, x: isize, y: isize) -> (f64, f64) {
    let (width, height) = (size.width as isize, size.height as isize);
    let at = |dx, dy| {
        f64::from(pixels[mirrored(y + dy, height) * size.width as usize + mirrored(x + dx, width)])
    };
    let gx = at(1, -1) - at(-1, -1) + 2.0 * (at(1, 0) - at(-1, 0)) + at(1, 1) - at(-1, 1);
    let gy = at(-1, 1) - at(-1, -1) + 2.0 * (at(0, 1) - at(0, -1)) + at(1, 1) - at(1, -1);
    (gx / 8.0, gy / 8.0)
}

/// Where the cubic through values at −1, 0, 1 and 2 is zero between 0 and 1.
fn zero_of_cubic(values: [f64; 4]) -> f64 {
    let cubic = |t: f64| -> f64 {
        let basis = |i: usize| {
            (0..4)
                .filter(|&j| j != i)
                .map(|j| (t + 1.0 - j as f64) / (i as f64 - j as f64))
                .product::<f64>()
        };
        (0..4).map(|i| values[i] * basis(i)).sum()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        if (cubic(middle) < 0.0) == (values[1] < 0.0) {
            low = middle
        } else {
            high = middle
        }
    }
    low
}

/// The cuts of the grid as the rule for them says, pixel by pixel; Sobel's operator on the image as it is.
fn obvious_edges(
    filtered: &[f32],
    interpolation: Interpolation,
    pixels: &[u8],
    size: Size,
) -> Vec<(f64, f64, f64, f64)> {
    let (width, height) = (size.width as isize, size.height as isize);
    let f = |x: isize, y: isize| {
        f64::from(filtered[mirrored(y, height) * size.width as usize + mirrored(x, width)])
    };
    let negative = |x, y| f(x, y) < 0.0;
    let slope = f64::from(NEARLY_HORIZONTAL);
    let row_is_cut = |x, y| {
        let along = (f(x + 1, y) - f(x, y)).abs();
        negative(x, y) != negative(x + 1, y) && along > 1e-4
    };
    let lists_row = |x: isize, y: isize| {
        let along = (f(x + 1, y) - f(x, y)).abs();
        let down = |x| (f(x, y + 1) - f(x, y - 1)) / 2.0;
        row_is_cut(x, y) && ((down(x) + down(x + 1)) / 2.0).abs() <= slope * along
    };
    let lists_column = |x: isize, y: isize| {
        let down = (f(x, y + 1) - f(x, y)).abs();
        let along = |y| (f(x + 1, y) - f(x - 1, y)) / 2.0;
        let along = ((along(y) + along(y + 1)) / 2.0).abs();
        if negative(x, y) == negative(x, y + 1) || down <= 1e-4 {
            return false;
        }
        let near = if f(x, y).abs() < f(x, y + 1).abs() {
            y
        } else {
            y + 1
        };
        let nearest_of_row = |beside: isize| {
            negative(beside, near) != negative(x, near) && f(x, near).abs() <= f(beside, near).abs()
        };
        !(down <= slope * along && (nearest_of_row(x - 1) || nearest_of_row(x + 1)))
    };
    let mut edges = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (dx, dy) = match (lists_row(x, y), lists_column(x, y)) {
                (true, _) => (1, 0),
                (false, true) => (0, 1),
                (false, false) => continue,
            };
            let t = match interpolation {
                Interpolation::Linear => f(x, y) / (f(x, y) - f(x + dx, y + dy)),
                Interpolation::Cubic => {
                    zero_of_cubic([-1, 0, 1, 2].map(|k| f(x + k * dx, y + k * dy)))
                }
            };
            let (a, b) = (
                sobel(pixels, size, x, y),
                sobel(pixels, size, x + dx, y + dy),
            );
            let (gx, gy) = (a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1));
            if gx.hypot(gy) > 0.0 {
                edges.push((
                    x as f64 + t * dx as f64,
                    y as f64 + t * dy as f64,
                    gx.hypot(gy),
                    gy.atan2(gx),
                ));
            }
        }
    }
    edges
}

/// The edges of pictures of all kinds in all kinds of channels, beside those of the obvious search.
fn beside_the_obvious(interpolation: Interpolation) -> Vec<(Edge, (f64, f64, f64, f64))> {
    let settings = Settings {
        channels: vec![10.0, 3.0, 1.0],
        interpolation,
        smoothing: Some(0.0),
        scaling: Scaling::Absolute,
        floor: 0.0,
    };
    let sizes = [(32, 32), (47, 39), (83, 64), (129, 33), (64, 97)];
    let mut pairs = Vec::new();
    for (seed, (width, height)) in (0..).zip(sizes) {
        let size = Size::new(width, height);
        for pixels in [noise(size, seed), texture(size, seed + 50)] {
            let mut filter = Filter::new(&settings, size);
            filter.begin(ImageView { pixels: &pixels }, size);
            for (channel, found) in edges(&settings, &pixels, size).into_iter().enumerate() {
                let filtered: Vec<f32> = filter.filtered(channel).flatten().copied().collect();
                let expected = obvious_edges(&filtered, interpolation, &pixels, size);
                assert_eq!(found.len(), expected.len(), "{size}, channel {channel}");
                pairs.extend(found.into_iter().zip(expected));
            }
        }
    }
    pairs
}

/// A step of an edge's place, in pixels.
const PLACE: f64 = 1.0 / Edge::PIXEL_STEPS as f64;

#[test]
fn edges_are_whole_numbers_of_steps_and_only_those_of_rows_lie_in_rows() {
    let is_whole = |value: f32, steps: u32| (value * steps as f32).fract() == 0.0;
    let mut of_rows = 0;
    let all = [Interpolation::Linear, Interpolation::Cubic].map(beside_the_obvious);
    for (edge, (x, y, ..)) in all.iter().flatten() {
        assert!(is_whole(edge.x, Edge::PIXEL_STEPS) && is_whole(edge.y, Edge::PIXEL_STEPS));
        assert!(is_whole(edge.magnitude, Edge::MAGNITUDE_STEPS) && edge.magnitude > 0.0);
        let steps = Edge::orientation_steps(edge.orientation);
        assert_eq!(
            edge.orientation.to_bits(),
            Edge::orientation_of(steps).to_bits()
        );
        // Where the obvious search finds it between two rows, it lies there.
        assert!(edge.is_in_row() || edge.x.fract() == 0.0, "{edge:?}");
        if x.fract() != 0.0 || y.fract() != 0.0 {
            assert_eq!(
                edge.is_in_row(),
                y.fract() == 0.0,
                "{edge:?}, at ({x}, {y})"
            );
        }
        of_rows += usize::from(edge.is_in_row());
    }
    let len = all.iter().map(Vec::len).sum::<usize>();
    assert!(
        of_rows > len / 10 && of_rows < len * 9 / 10,
        "{of_rows} of {len}"
    );
}

#[test]
fn on_any_image_the_edges_are_those_of_the_obvious_search() {
    for (edge, (x, y, magnitude, orientation)) in beside_the_obvious(Interpolation::Linear) {
        // To half a step, and to a whole one at the ends of a pixel.
        let off = (f64::from(edge.x) - x).hypot(f64::from(edge.y) - y);
        let is_at_end = [x, y]
            .iter()
            .any(|place| (place - place.round()).abs() < PLACE);
        let most = if is_at_end { PLACE } else { PLACE / 2.0 };
        assert!(off < most + 1e-4, "{edge:?}, not at ({x}, {y})");
        let error = (f64::from(edge.magnitude) - magnitude).abs();
        let step = 1.0 / f64::from(Edge::MAGNITUDE_STEPS);
        assert!(error < 1e-3 * magnitude + step, "{edge:?}, not {magnitude}");
        // Where the gradient all but vanishes, its direction is anybody's.
        let turned = degrees_between(edge.orientation.into(), orientation);
        assert!(
            turned < 0.05 || magnitude < 0.05,
            "{edge:?}, not {orientation}"
        );
    }
}

#[test]
fn with_curvature_edges_lie_where_the_cubic_is_zero_unless_that_is_far_from_the_lines_zero() {
    let lines = beside_the_obvious(Interpolation::Linear);
    let cubics = beside_the_obvious(Interpolation::Cubic);
    let mut errors = Vec::new();
    for ((line, _), (edge, (x, y, ..))) in lines.into_iter().zip(cubics) {
        assert!(
            f64::from((edge.x - line.x).hypot(edge.y - line.y)) < 0.1001 + PLACE,
            "{edge:?}, {line:?}"
        );
        if (x - f64::from(line.x)).hypot(y - f64::from(line.y)) < 0.1 {
            errors.push((f64::from(edge.x) - x).hypot(f64::from(edge.y) - y));
        }
    }
    // One step of Newton's method stops a little short of it.
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!(
        errors.len() > 20_000 && mean < 0.001 + PLACE / 4.0,
        "{mean} of {}",
        errors.len()
    );
}
