//! Folders of a rail's frames: what their images and their positions say of how the camera moved.
#![expect(clippy::unwrap_used, reason = "tests")]

mod texture;

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use capture::{Mode, Settings, Source, Views};
use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use messages::{Size, Sway};
use tempfile::TempDir;
use texture::wave;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 200;

/// Pixels by which a row moves to the left for a step to the right: the ground is nearer further down.
fn disparity(row: f64) -> f64 {
    5.0 + row / 100.0
}

/// What a camera sees from a place along the rail, in steps, and how many rows lower.
fn seen(place: f64, lower: f64) -> GrayImage {
    GrayImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let row = f64::from(y) - lower;
        Luma([wave(f64::from(x) + place * disparity(row), row)])
    })
}

/// A folder of frames that is gone after the test.
struct Frames(TempDir);

impl Frames {
    fn of(frames: impl IntoIterator<Item = GrayImage>) -> Self {
        let folder = Self(TempDir::new().unwrap());
        for (frame, image) in frames.into_iter().enumerate() {
            image.save(folder.file(&format!("{frame:03}.png"))).unwrap();
        }
        folder
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn settings(&self) -> Settings {
        Settings {
            source: self.0.path().display().to_string(),
            mode: Mode::Rail,
            ..Settings::default()
        }
    }

    /// The settings with a file of these positions, in metres.
    fn encoded(&self, positions_m: &[f64]) -> Settings {
        let mut text = "position_m\n".to_owned();
        for position in positions_m {
            writeln!(text, "{position:.9}").unwrap();
        }
        let path = self.file("encoder.csv");
        fs::write(&path, text).unwrap();
        Settings {
            positions: Some(path.display().to_string()),
            ..self.settings()
        }
    }
}

fn baseline_m(source: &Source) -> f64 {
    source.calibration().unwrap().baseline_m
}

#[test]
fn a_camera_that_moves_to_the_left_has_its_drift_to_the_right() {
    for (to_the_right, way) in [(1.0, "right"), (-1.0, "left")] {
        let step = |frame: i32| seen(to_the_right * f64::from(frame), 0.3 * f64::from(frame));
        let frames = Frames::of((0..12).map(step));
        let settings = Settings {
            stride: Some(2),
            ..frames.settings()
        };
        let source = Source::open(&settings).unwrap();
        let rail = source.rail().unwrap();
        // It sinks as the camera goes, 0.6 rows over a baseline of two frames.
        assert!(
            (rail.drift_px - to_the_right * 0.6).abs() < 0.05,
            "{way}: {rail:?}"
        );
        let steps = source.position_m(11).unwrap() - source.position_m(0).unwrap();
        assert_eq!(steps.signum(), to_the_right, "{way}");
        let (least, most) = source.disparities().unwrap();
        assert!(
            (9.5..11.0).contains(&least) && (12.0..14.5).contains(&most),
            "{least} {most}"
        );
        let said = source.notices().join("; ");
        assert!(
            said.contains(&format!("equal steps to the {way}")),
            "{said}"
        );
        // Who knows what was found need not look again.
        let settled = Settings {
            drift: Some(rail.drift_px),
            ..settings
        };
        let again =
            Source::open_at(&settled, source.places().unwrap(), source.sways().unwrap()).unwrap();
        assert_eq!(again.rail(), Some(rail));
        for frame in 0..12 {
            assert_eq!(again.position_m(frame), source.position_m(frame));
        }
    }
}

#[test]
fn an_encoder_that_trembles_while_the_camera_rests_is_no_motion() {
    let rests = |frame: usize| frame % 5 > 1;
    let mut place = 0.0;
    let positions: Vec<f64> = (0..20)
        .map(|frame| {
            place += if rests(frame) { 0.0 } else { 0.01 };
            place + [1e-6, -1e-6][frame % 2]
        })
        .collect();
    let frames = Frames::of(positions.iter().map(|place| seen(place / 0.01, 0.0)));
    let settings = Settings {
        stride: Some(1),
        ..frames.encoded(&positions)
    };
    let source = Source::open(&settings).unwrap();
    assert!(
        (baseline_m(&source) - 0.01).abs() < 1e-5,
        "{}",
        baseline_m(&source)
    );
    let said = source.notices().join("; ");
    assert!(!said.contains("turns back"), "{said}");
}

#[test]
fn a_baseline_beside_positions_in_metres_is_told_to_say_nothing() {
    let frames = Frames::of((0..4).map(|frame| seen(f64::from(frame), 0.0)));
    let settings = Settings {
        baseline: Some(0.5),
        ..frames.encoded(&[0.0, 0.01, 0.02, 0.03])
    };
    let source = Source::open(&settings).unwrap();
    assert!((baseline_m(&source) - 0.01).abs() < 1e-9);
    let warned = source.warnings().join("; ");
    assert!(
        warned.contains(
            "positions are in metres, so baseline, set to 0.5 m, says nothing; leave it away"
        ),
        "{warned}"
    );
}

#[test]
fn positions_that_count_the_other_way_are_told() {
    let frames = Frames::of((0..8).map(|frame| seen(f64::from(frame), 0.0)));
    let positions: Vec<f64> = (0..8).map(|frame| 0.01 * f64::from(frame)).collect();
    let told = |positions: &[f64]| {
        Source::open(&frames.encoded(positions))
            .unwrap()
            .warnings()
            .join("; ")
    };
    assert!(
        !told(&positions).contains("with the camera"),
        "{}",
        told(&positions)
    );
    let other: Vec<f64> = positions.iter().map(|place| -place).collect();
    assert!(
        told(&other).contains("as where positions count the other way: change their sign"),
        "{}",
        told(&other)
    );
}

#[test]
fn a_camera_that_stands_still_is_told() {
    let trembling = |frame: i32| seen(0.01 * f64::from(frame % 2), 0.0);
    let frames = Frames::of((0..8).map(trembling));
    let positions: Vec<f64> = (0..8).map(|frame| 0.01 * f64::from(frame)).collect();
    let source = Source::open(&frames.encoded(&positions)).unwrap();
    let warned = source.warnings().join("; ");
    assert!(
        warned.contains("hardly anything moves between the frames of a triple"),
        "{warned}"
    );
}

#[test]
fn frames_that_show_nothing_are_not_matched_far_apart() {
    let plain = || GrayImage::from_pixel(WIDTH, HEIGHT, Luma([90]));
    let frames = Frames::of((0..24).map(|_| plain()));
    let positions: Vec<f64> = (0..24).map(|frame| 0.01 * f64::from(frame)).collect();
    let source = Source::open(&frames.encoded(&positions)).unwrap();
    assert_eq!(source.rail().unwrap().stride, 1);
    let warned = source.warnings().join("; ");
    assert!(
        warned.contains("could not be seen, so stride is a guess"),
        "{warned}"
    );
}

#[test]
fn a_camera_that_stops_for_every_second_frame_is_seen_to_move() {
    let places: Vec<f64> = (0..22).map(|frame| f64::from(frame / 2)).collect();
    let frames = Frames::of(places.iter().map(|&place| seen(place, 0.0)));
    let positions: Vec<f64> = places.iter().map(|place| 0.01 * place).collect();
    let source = Source::open(&frames.encoded(&positions)).unwrap();
    let (least, most) = source.disparities().unwrap();
    assert!(
        (4.5..5.5).contains(&least) && (6.5..7.5).contains(&most),
        "{least} {most}"
    );
    assert!(
        source
            .warnings()
            .iter()
            .all(|warning| !warning.contains("stride"))
    );
}

#[test]
fn the_truth_of_one_step_is_that_of_as_many_as_a_baseline_has() {
    let frames = Frames::of((0..7).map(|frame| seen(f64::from(frame), 0.0)));
    let truth = ImageBuffer::from_pixel(WIDTH, HEIGHT, Luma([256 * 3 + 64u16]));
    fs::create_dir(frames.file("truth")).unwrap();
    DynamicImage::ImageLuma16(truth)
        .save(frames.file("truth/of4.png"))
        .unwrap();
    let views: Vec<String> = (0..7)
        .map(|view| format!(r#"{{"file": "{view:03}.png", "position_steps": {view}}}"#))
        .collect();
    let described = format!(
        r#"{{"views": [{}], "ground_truth": [{{"file": "truth/of4.png", "view": 4}}]}}"#,
        views.join(", ")
    );
    fs::write(frames.file("scene.json"), described).unwrap();
    for (views, frame, stride, expected) in [
        (vec![0, 2, 4, 6], 2, 1, 6.5),
        ((0..7).collect(), 4, 1, 3.25),
        ((0..7).collect(), 4, 3, 9.75),
    ] {
        let settings = Settings {
            views: Views::These(views),
            stride: Some(stride),
            ..frames.settings()
        };
        let source = Source::open(&settings).unwrap();
        let truth = source.truth(frame, 0).unwrap().unwrap();
        assert_eq!(truth.disparity[0], expected);
    }
}

/// What a camera sees that is off by this: turned and scaled about the middle of the picture, and moved.
fn swayed(place: f64, sway: &Sway, gain: f64) -> GrayImage {
    let size = Size::new(WIDTH, HEIGHT);
    GrayImage::from_fn(WIDTH, HEIGHT, |x, y| {
        // Where what is seen here belongs, by a few rounds.
        let (x, y) = (f64::from(x), f64::from(y));
        let mut at = [x, y];
        for _ in 0..4 {
            let [right, down] = sway.off(size, at[0], at[1]);
            at = [x - right, y - down];
        }
        let level = wave(at[0] + place * disparity(at[1]), at[1]);
        Luma([(f64::from(level) * gain).round().min(255.0) as u8])
    })
}

/// A sway of every frame that looks random and never changes.
fn sways(frames: usize, px: f64) -> Vec<Sway> {
    let mut state = 9u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) * 2.0 - 1.0
    };
    let mut sway = || Sway {
        right_px: px * random(),
        down_px: px * random(),
        turn: px * 0.002 * random(),
        scale: px * 0.002 * random(),
    };
    (0..frames).map(|_| sway()).collect()
}

/// Values without what grows evenly, which no image tells from places and drift.
fn without_trend(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let (middle, mean) = ((n - 1.0) / 2.0, values.iter().sum::<f64>() / n);
    let from_middle = |index: usize| index as f64 - middle;
    let (mut product, mut spread) = (0.0, 0.0);
    for (index, value) in values.iter().enumerate() {
        product += from_middle(index) * (value - mean);
        spread += from_middle(index) * from_middle(index);
    }
    let slope = product / spread;
    let rest = values.iter().enumerate();
    rest.map(|(index, value)| value - mean - slope * from_middle(index))
        .collect()
}

/// One number of a sway.
type Part = fn(&Sway) -> f64;

#[test]
fn by_how_much_each_frame_is_off_is_found_to_a_twentieth_of_a_pixel_though_the_exposure_flickers() {
    let truth = sways(24, 0.7);
    for (stride, flicker) in [(1, 0.0), (2, 0.2)] {
        let frames = Frames::of(truth.iter().enumerate().map(|(frame, sway)| {
            let gain = [1.0, 1.0 - flicker, 1.0 + flicker][frame % 3];
            swayed(frame as f64, sway, 0.8 * gain)
        }));
        let positions: Vec<f64> = (0..24).map(|frame| 0.01 * f64::from(frame)).collect();
        let settings = Settings {
            stride: Some(stride),
            ..frames.encoded(&positions)
        };
        let source = Source::open(&settings).unwrap();
        let found = source.sways().unwrap();
        let said = source.notices().join("; ");
        assert!(said.contains("the rail sways by 0."), "{said}");
        // What a turn moves at the edge of the picture, in pixels.
        let parts: [(&str, f64, Part); 4] = [
            ("right", 1.0, |sway| sway.right_px),
            ("down", 1.0, |sway| sway.down_px),
            ("turn", 100.0, |sway| sway.turn),
            ("scale", 100.0, |sway| sway.scale),
        ];
        for (what, px, part) in parts {
            let of = |all: &[Sway]| without_trend(&all.iter().map(part).collect::<Vec<_>>());
            for (frame, (found, truth)) in of(found).iter().zip(of(&truth)).enumerate() {
                let off = (found - truth) * px;
                assert!(
                    off.abs() < 0.05,
                    "stride {stride}: {what} of frame {frame} by {off} px"
                );
            }
        }
        // Who knows it need not look again.
        let again = Source::open_at(&settings, &[], found).unwrap();
        assert_eq!(again.sways(), Some(found));
        let off = Settings {
            sway: Some(false),
            ..settings
        };
        let off = Source::open(&off).unwrap();
        assert!((0..24).all(|scan| off.sway(scan).is_none()));
    }
}

#[test]
fn a_steady_rail_sways_by_nothing_at_all() {
    let truth = sways(16, 0.03);
    let frames = truth.iter().enumerate();
    let frames = Frames::of(frames.map(|(frame, sway)| swayed(frame as f64, sway, 1.0)));
    let source = Source::open(&frames.settings()).unwrap();
    assert_eq!(source.sways(), Some(&[Sway::NONE; 16][..]));
    let said = source.notices().join("; ");
    assert!(!said.contains("sways"), "{said}");
}

#[test]
fn sway_is_refused_where_no_frames_can_be_looked_at_beforehand() {
    let frames = Frames::of((0..4).map(|frame| seen(f64::from(frame), 0.0)));
    let rig = Settings {
        mode: Mode::Rig,
        sway: Some(true),
        ..frames.settings()
    };
    let error = Source::open(&rig).unwrap_err();
    assert!(error.is_wrong_use());
    assert!(
        error.to_string().contains("leave it away of a rig"),
        "{error}"
    );
}
