//! ∇²G against its definition.

mod pictures;

use filter::{Filter, Settings};
use messages::{ImageView, Size};
use pictures::{mirrored, noise};

fn with_channels(channels: &[f32]) -> Settings {
    Settings {
        channels: channels.to_vec(),
        ..Settings::default()
    }
}

fn filtered(settings: &Settings, pixels: &[u8], size: Size) -> Vec<Vec<f32>> {
    let mut filter = Filter::new(settings, size);
    filter.begin(ImageView { pixels }, size);
    (0..filter.channels())
        .map(|channel| filter.filtered(channel).flatten().copied().collect())
        .collect()
}

/// ∇²G ∗ image in the plane, pixel by pixel, the image continued by its reflection.
fn convolved(pixels: &[u8], size: Size, variance: f64) -> Vec<f64> {
    let reach = (6.5 * variance.sqrt()).ceil() as isize;
    let kernel = |dx: isize, dy: isize| {
        let r2 = (dx * dx + dy * dy) as f64;
        (r2 - 2.0 * variance) / variance.powi(2) * (-r2 / (2.0 * variance)).exp()
            / (std::f64::consts::TAU * variance)
    };
    let (width, height) = (size.width as isize, size.height as isize);
    let pixel = |x: isize, y: isize| {
        f64::from(pixels[mirrored(y, height) * size.width as usize + mirrored(x, width)])
    };
    let at = |x: isize, y: isize| {
        let row = |dy: isize| {
            (-reach..=reach)
                .map(move |dx| kernel(dx, dy) * pixel(x + dx, y + dy))
                .sum::<f64>()
        };
        (-reach..=reach).map(row).sum()
    };
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| at(x, y))
        .collect()
}

fn largest_difference(fast: &[f32], slow: &[f64]) -> f64 {
    let scale = slow.iter().map(|v| v.abs()).fold(0.0, f64::max);
    fast.iter()
        .zip(slow)
        .map(|(&f, s)| (f64::from(f) - s).abs())
        .fold(0.0, f64::max)
        / scale
}

#[test]
fn the_transform_convolves_as_the_definition_does_at_every_pixel_and_up_to_the_border() {
    // The smallest size, odd ones, primes, and margins wider than the image.
    for (width, height, variance) in [
        (32, 32, 4.0),
        (45, 33, 8.0),
        (37, 53, 4.0),
        (32, 41, 30.0),
        (64, 48, 2.5),
    ] {
        let size = Size::new(width, height);
        let pixels = noise(size, u64::from(width * height));
        let fast = &filtered(&with_channels(&[variance]), &pixels, size)[0];
        let error = largest_difference(fast, &convolved(&pixels, size, f64::from(variance)));
        // Beyond σ² = 2.5 the sampled kernel is the band-limited one to within 10⁻⁴ of its largest value.
        assert!(error < 2e-4, "{width}x{height}, σ² = {variance}: {error}");
    }
}

#[test]
fn a_fine_channel_is_the_definition_too_but_for_what_sampling_folds() {
    let size = Size::new(40, 40);
    let pixels = noise(size, 5);
    let fast = &filtered(&with_channels(&[1.5]), &pixels, size)[0];
    let error = largest_difference(fast, &convolved(&pixels, size, 1.5));
    assert!(error < 2e-2, "{error}");
}

#[test]
fn every_channel_is_what_it_would_be_alone() {
    let size = Size::new(96, 64);
    let pixels = noise(size, 11);
    // Together the transform is that of the widest margin, so only nearly the same.
    for (channel, together) in
        [30.0, 8.0, 1.5]
            .into_iter()
            .zip(filtered(&with_channels(&[30.0, 8.0, 1.5]), &pixels, size))
    {
        let alone: Vec<f64> = filtered(&with_channels(&[channel]), &pixels, size)[0]
            .iter()
            .map(|&v| v.into())
            .collect();
        let error = largest_difference(&together, &alone);
        assert!(error < 5e-4, "σ² = {channel}: {error}");
    }
}

#[test]
fn a_constant_image_filters_to_exactly_nothing() {
    for level in [0, 1, 127, 200, 255] {
        let size = Size::new(50, 34);
        let all = filtered(
            &with_channels(&[30.0, 4.0, 1.0]),
            &vec![level; size.pixels()],
            size,
        );
        assert!(all.iter().flatten().all(|&v| v == 0.0), "level {level}");
    }
}

#[test]
fn a_filter_that_saw_other_sizes_gives_the_same_bits_as_a_fresh_one() {
    let sizes = [
        Size::new(64, 40),
        Size::new(33, 57),
        Size::new(80, 32),
        Size::new(64, 40),
        Size::new(33, 57),
    ];
    let settings = Settings::default();
    let mut seasoned = Filter::new(&settings, Size::new(80, 57));
    for (seed, size) in sizes.into_iter().enumerate() {
        let pixels = noise(size, seed as u64);
        seasoned.begin(ImageView { pixels: &pixels }, size);
        for (channel, fresh) in filtered(&settings, &pixels, size).into_iter().enumerate() {
            let bits: Vec<u32> = seasoned
                .filtered(channel)
                .flatten()
                .map(|v| v.to_bits())
                .collect();
            assert_eq!(
                bits,
                fresh.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
                "{size}, channel {channel}"
            );
        }
    }
}
