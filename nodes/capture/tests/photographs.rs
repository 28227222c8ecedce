//! What the thesis's photographs promise: its objects, whole in every view and about 32 pixels apart, in soft light, with
//! their true contours.
#![expect(clippy::unwrap_used, reason = "tests")]

use capture::{Mode, Settings, Source};
use messages::{Contour, ContourKind, Image, Owned, Size};

const OBJECTS: [&str; 3] = [
    "scene:thesis-tab",
    "scene:thesis-jack",
    "scene:thesis-screwdriver",
];
const SIZE: Size = Size::new(512, 480);
const WIDTH: usize = SIZE.width as usize;

fn open(source: &str, change: impl FnOnce(&mut Settings)) -> Source {
    let mut settings = Settings {
        source: source.to_owned(),
        ..Settings::default()
    };
    change(&mut settings);
    Source::open(&settings).unwrap()
}

fn read(source: &mut Source, view: usize) -> Vec<u8> {
    let mut image = Owned::<Image>::new(SIZE);
    image.fill(|room| source.read(0, view, room)).unwrap();
    image.view().pixels.to_vec()
}

/// The magnitude of Sobel's gradient.
fn gradient(picture: &[u8], x: usize, y: usize) -> f32 {
    let at = |dx: usize, dy: usize| f32::from(picture[(y + dy - 1) * WIDTH + x + dx - 1]);
    let across = |y: usize| at(2, y) - at(0, y);
    let down = |x: usize| at(x, 2) - at(x, 0);
    let gx = across(0) + 2.0 * across(1) + across(2);
    let gy = down(0) + 2.0 * down(1) + down(2);
    gx.hypot(gy)
}

fn shapes(contours: &[Contour]) -> impl Iterator<Item = &Contour> {
    let is_shape = |kind| matches!(kind, ContourKind::Silhouette | ContourKind::Crease);
    contours
        .iter()
        .filter(move |contour| is_shape(contour.kind))
}

#[test]
fn each_object_is_whole_in_all_three_views_and_lies_about_32_pixels() {
    for object in OBJECTS {
        let source = open(object, |_| ());
        assert_eq!((source.view_count(), source.size()), (3, SIZE));
        for view in 0..3 {
            let contours = source.contours(0, view).unwrap();
            let mut disparities = Vec::new();
            for point in shapes(&contours).flat_map(|contour| &contour.points) {
                let is_inside = point.x > 8.0
                    && point.x < (SIZE.width - 9) as f32
                    && point.y > 8.0
                    && point.y < (SIZE.height - 9) as f32;
                assert!(is_inside, "{object} view {view}: {point:?}");
                disparities.push(point.disparity);
            }
            disparities.sort_by(f32::total_cmp);
            let median = disparities[disparities.len() / 2];
            assert!((median - 32.0).abs() < 2.0, "{object}: {median}");
            let (least, most) = (disparities[0], disparities[disparities.len() - 1]);
            assert!(least > 26.0 && most < 38.0, "{object}: {least} to {most}");
        }
    }
}

#[test]
fn no_few_pixels_decide_what_the_thesiss_thresholds_are_of() {
    for object in OBJECTS {
        let mut source = open(object, |_| ());
        for view in 0..3 {
            let picture = read(&mut source, view);
            assert!(picture.iter().all(|&gray| gray > 4 && gray < 230));
            let places = (1..479).flat_map(|y| (1..WIDTH - 1).map(move |x| (x, y)));
            let mut gradients: Vec<f32> = places.map(|(x, y)| gradient(&picture, x, y)).collect();
            gradients.sort_by(|a, b| b.total_cmp(a));
            // HIGH is 64 of 255 of the largest: hundreds of pixels exceed twice that.
            let hundreds = gradients[500] / gradients[0];
            assert!(hundreds > 128.0 / 255.0, "{object} view {view}: {hundreds}");
        }
    }
}

#[test]
fn where_a_contour_has_contrast_the_picture_has_a_gradient() {
    for object in OBJECTS {
        let mut source = open(object, |_| ());
        let picture = read(&mut source, 0);
        let contours = source.contours(0, 0).unwrap();
        let points = contours.iter().flat_map(|contour| &contour.points);
        let (mut strong, mut shown) = (0, 0);
        for point in points.filter(|point| point.contrast > 30.0) {
            let (x, y) = (point.x.round() as usize, point.y.round() as usize);
            let near = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)));
            let most = near
                .map(|(x, y)| gradient(&picture, x, y))
                .fold(0.0, f32::max);
            strong += 1;
            // A step of this contrast, blurred; beside another contour it may be less.
            shown += usize::from(most > point.contrast);
        }
        assert!(strong > 700, "{object}: {strong}");
        assert!(shown * 100 > strong * 97, "{object}: {shown} of {strong}");
    }
}

#[test]
fn contours_of_all_kinds_are_seen_by_all_three_views_nearly_everywhere() {
    let mut kinds = Vec::new();
    for object in OBJECTS {
        let source = open(object, |_| ());
        let contours = source.contours(0, 1).unwrap();
        kinds.extend(contours.iter().map(|contour| contour.kind));
        let points: Vec<_> = contours
            .iter()
            .flat_map(|contour| &contour.points)
            .collect();
        let all = points.iter().filter(|point| point.seen == 0b111).count();
        assert!(all * 100 > points.len() * 95, "{object}: {all}");
        assert!(points.iter().all(|point| point.seen >> 1 & 1 == 1));
        for contour in &contours {
            for two in contour.points.windows(2) {
                let away = (two[1].x - two[0].x).hypot(two[1].y - two[0].y);
                assert!(away <= 2.0_f32.sqrt() + 1e-3, "{object}: {away}");
            }
        }
    }
    for kind in ContourKind::ALL {
        assert!(kinds.contains(&kind), "{kind:?}");
    }
}

#[test]
fn cameras_out_of_line_show_the_same_pictures_a_row_lower_and_a_row_higher() {
    let names = ["scene:thesis-tab", "scene:thesis-tab-misaligned"];
    let [mut level, mut out] = names.map(|name| open(name, |settings| settings.noise = 0.0));
    for (view, lower) in [(0, 0), (1, 1), (2, -1)] {
        let (level_picture, out_picture) = (read(&mut level, view), read(&mut out, view));
        let truths = [&level, &out].map(|source| source.truth(0, view).unwrap().unwrap());
        // Away from the borders, where the blur repeats the last row.
        for y in 10..470_usize {
            let there = y.saturating_add_signed(lower);
            let row = |y: usize| y * WIDTH..(y + 1) * WIDTH;
            assert!(
                level_picture[row(y)] == out_picture[row(there)],
                "view {view}, row {y}"
            );
            assert_eq!(truths[0].disparity[row(y)], truths[1].disparity[row(there)]);
            assert_eq!(truths[0].visible[row(y)], truths[1].visible[row(there)]);
        }
    }
    let points = |source: &Source| -> usize {
        let contours = source.contours(0, 0).unwrap();
        let points = contours.iter().flat_map(|contour| &contour.points);
        points.filter(|point| point.seen == 0b111).count()
    };
    assert_eq!(points(&level), points(&out), "who sees what is the same");
}

#[test]
fn the_three_take_turns_and_only_they_know_their_contours() {
    for (name, behind) in [
        ("scene:thesis", ""),
        ("scene:thesis-misaligned", "-misaligned"),
    ] {
        let source = open(name, |_| ());
        let names: Vec<String> = (0..4).map(|scan| source.name(scan)).collect();
        let expected = ["tab", "jack", "screwdriver", "tab"];
        assert_eq!(names, expected.map(|name| format!("thesis-{name}{behind}")));
        assert_eq!(source.scans(), 30);
        let camera = source.calibration().unwrap();
        assert!(camera.calibrated);
        let at_32_px = camera.focal_px * camera.baseline_m / 32.0;
        assert!((at_32_px - 0.465).abs() < 1e-3, "{at_32_px} m");
    }
    assert!(open("scene:tab", |_| ()).contours(0, 0).is_none());
}

#[test]
fn one_camera_passes_along_the_three_positions() {
    let source = open("scene:thesis-tab", |settings| settings.mode = Mode::Rail);
    assert_eq!(source.views(0).len(), 3);
    assert!(source.contours(0, 0).is_none());
}
