//! Calibration: a ROS `camera_info` file, single settings, and what is assumed without them.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::{Path, PathBuf};

use capture::{Settings, Source};
use image::GrayImage;
use messages::Calibration;
use tempfile::TempDir;

/// A right camera's file as `camera_calibration` writes it.
const RIGHT: &str = "\
image_width: 64
image_height: 48
camera_name: narrow_stereo/right
camera_matrix:
  rows: 3
  cols: 3
  data: [500., 0., 31., 0., 500., 23., 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0, 0, 0, 0, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [400., 0., 30.5, -48., 0., 400., 22.25, 0., 0., 0., 1., 0.]
";

/// A scene of three gray images, 64x48, and a calibration file beside it.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        fs::create_dir(folder.path().join("scene")).unwrap();
        for view in 0..3 {
            let image = GrayImage::from_fn(64, 48, |x, y| image::Luma([(x * 3 + y + view) as u8]));
            image
                .save(folder.path().join(format!("scene/{view}.png")))
                .unwrap();
        }
        Self { folder }
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("camera.yaml")
    }

    fn settings(&self) -> Settings {
        let scene = self.folder.path().join("scene");
        Settings {
            source: scene.to_str().unwrap().to_owned(),
            ..Settings::default()
        }
    }

    fn with_yaml(&self, yaml: &str) -> Settings {
        fs::write(self.file(), yaml).unwrap();
        Settings {
            camera_info: Some(self.file().to_str().unwrap().to_owned()),
            ..self.settings()
        }
    }

    /// What is wrong with the file, without its name.
    fn refusal(&self, yaml: &str) -> String {
        let sentence = Source::open(&self.with_yaml(yaml)).unwrap_err().to_string();
        let prefix = format!("{} gives no calibration: ", self.file().display());
        sentence
            .strip_prefix(&prefix)
            .unwrap_or(&sentence)
            .to_owned()
    }
}

#[test]
fn a_right_cameras_file_gives_focal_length_centre_and_baseline() {
    let bench = Bench::new();
    let source = Source::open(&bench.with_yaml(RIGHT)).unwrap();
    let expected = Calibration {
        focal_px: 400.0,
        cx: 30.5,
        cy: 22.25,
        baseline_m: 0.12,
        calibrated: true,
    };
    assert_eq!(source.calibration(), Some(expected));
    assert!(source.warnings().is_empty());
    assert_eq!(
        source.notices(),
        [
            "of camera_info are taken: focal length 400 px, principal point 30.5, 22.25",
            "baseline 0.12 m from view to view, 0.24 m from the first to the last of 3"
        ]
    );
}

#[test]
fn a_projection_in_millimetres_or_without_its_focal_length_is_refused_until_the_baseline_is_said() {
    let bench = Bench::new();
    let of = |shift: &str| RIGHT.replace("-48.", shift);
    let millimetres = bench.refusal(&of("-48000."));
    assert!(
        millimetres.starts_with("it puts neighbouring cameras 120 m apart")
            && millimetres.contains("if these are millimetres, that is 0.12 m, divide"),
        "{millimetres}"
    );
    let bare = bench.refusal(&of("-0.12"));
    assert!(
        bare.starts_with(
            "P[3] is -0.12 and f 400 px, which puts neighbouring cameras 0.3 mm apart"
        ) && bare.contains("write -48 there"),
        "{bare}"
    );
    for shift in ["-48000.", "-0.12"] {
        let settings = Settings {
            baseline: Some(0.12),
            ..bench.with_yaml(&of(shift))
        };
        let source = Source::open(&settings).unwrap();
        assert_eq!(source.calibration().unwrap().baseline_m, 0.12);
        // That the file says otherwise is not left unsaid.
        let said = source.warnings().join("; ");
        assert!(said.contains("counts before the"), "{said}");
    }
    // Less far off it is asked.
    let source = Source::open(&bench.with_yaml(&of("-2400."))).unwrap();
    let said = source.warnings().join("; ");
    assert!(said.contains("6 m apart"), "{said}");
    // A camera on the other side, or a driver with another sign.
    let source = Source::open(&bench.with_yaml(&of("48."))).unwrap();
    assert_eq!(source.calibration().unwrap().baseline_m, 0.12);
    assert!(source.notices()[0].contains("P[3] of camera_info is positive (48)"));
}

#[test]
fn settings_that_are_no_lengths_in_metres_and_no_pixels_are_questioned() {
    let bench = Bench::new();
    let said = |baseline: f64, focal: f64| {
        let settings = Settings {
            baseline: Some(baseline),
            focal: Some(focal),
            ..bench.settings()
        };
        Source::open(&settings)
            .map(|source| (source.notices().to_vec(), source.warnings().join("; ")))
            .map_err(|error| (error.is_wrong_use(), error.to_string()))
    };
    let (notices, warnings) = said(0.05, 64.0).unwrap();
    assert_eq!(
        notices,
        [
            "the principal point is not said: the middle of the picture is taken, 31.5, 23.5; set capture.cx and capture.cy",
            "baseline 0.05 m from view to view, 0.1 m from the first to the last of 3"
        ]
    );
    assert_eq!(warnings, "");
    let (_, warnings) = said(60.0, 64.0).unwrap();
    assert!(warnings.contains("millimetres set 0.06"), "{warnings}");
    let (_, warnings) = said(0.00009, 64.0).unwrap();
    assert!(warnings.contains("baseline is 0.09 mm"), "{warnings}");
    let (is_wrong_use, why) = said(0.05, 3.6).unwrap_err();
    assert!(
        is_wrong_use && why.contains("is it in millimetres?"),
        "{why}"
    );
    let settings = Settings {
        cx: Some(64.0),
        cy: Some(48.0),
        focal: Some(64.0),
        baseline: Some(0.1),
        ..bench.settings()
    };
    let source = Source::open(&settings).unwrap();
    let said = source.warnings().join("; ");
    assert!(said.contains("far from 31.5, 23.5"), "{said}");
}

#[test]
fn the_distance_of_the_outer_views_is_recognised_beside_that_of_a_file() {
    let bench = Bench::new();
    let settings = Settings {
        baseline: Some(0.24),
        ..bench.with_yaml(RIGHT)
    };
    let source = Source::open(&settings).unwrap();
    assert_eq!(
        source.warnings(),
        [
            "capture.baseline, 0.24 m from view to view, counts before the 0.12 m of the files: what is set is that from the first to the last; leave it away"
        ]
    );
}

/// What `ros2 topic echo` prints of the camera_info of a camera that stands so far to the right of the first.
fn echoed(x: f64, view: usize) -> String {
    format!(
        "header:\n  stamp:\n    sec: {view}\n    nanosec: 0\n  frame_id: cam{view}\nheight: 48\nwidth: 64\ndistortion_model: plumb_bob\nd: []\nk:\n- 400.0\n- 0.0\n- 30.5\n- 0.0\n- 400.0\n- 22.25\n- 0.0\n- 0.0\n- 1.0\nr: [1, 0, 0, 0, 1, 0, 0, 0, 1]\np: [400.0, 0.0, 30.5, {}, 0.0, 400.0, 22.25, 0.0, 0.0, 0.0, 1.0, 0.0]\nbinning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: false\n---\n",
        -400.0 * x
    )
}

#[test]
fn messages_of_all_views_give_the_step_between_neighbours() {
    let bench = Bench::new();
    let of = |places: [f64; 3]| {
        let all: String = (0..3).map(|view| echoed(places[view], view)).collect();
        // Echoed twice, with other stamps, and cut off.
        let again = all.replace("nanosec: 0", "nanosec: 7");
        format!("{all}{again}header:\n  stamp:\n    se")
    };
    let source = Source::open(&bench.with_yaml(&of([0.0, 0.05, 0.1]))).unwrap();
    let camera = source.calibration().unwrap();
    assert!(camera.calibrated && (camera.baseline_m - 0.05).abs() < 1e-12);
    assert!(source.notices()[1].starts_with("baseline 0.05 m from view to view, 0.1 m from"));
    // As of a simulator that gives all cameras one.
    let why = bench.refusal(&of([0.05, 0.05, 0.05]));
    assert!(why.contains("from left to right it must fall"), "{why}");
    let why = bench.refusal(&of([0.0, 0.05, 0.15]));
    assert!(why.contains("unequal steps"), "{why}");
    let why = bench.refusal(&(echoed(0.0, 0) + &echoed(0.05, 1)));
    assert!(
        why.contains("describes 2 cameras, and there are 3 views"),
        "{why}"
    );
}

#[test]
fn a_message_is_read_in_every_spelling_and_what_was_left_out_of_it_is_named() {
    let bench = Bench::new();
    let one = echoed(0.05, 1);
    let capital = ["d", "k", "r", "p"].iter().fold(one.clone(), |text, key| {
        text.replace(&format!("\n{key}:"), &format!("\n{}:", key.to_uppercase()))
    });
    for text in [
        one.clone(),
        capital,
        format!("\u{feff}{}", one.replace('\n', "\r\n")),
        one.replace("---\n", "...\n"),
    ] {
        let source = Source::open(&bench.with_yaml(&text)).unwrap();
        let camera = source.calibration().unwrap();
        assert_eq!(
            (camera.focal_px, camera.cx, camera.baseline_m),
            (400.0, 30.5, 0.05)
        );
    }
    let cut = "p: [400.0, 0.0, 30.5, -20, 0.0, 400.0,";
    for (text, cure) in [
        (one.replace(cut, "p: [400.0, 0.0, '...',"), "--full-length"),
        (
            one.replace("d: []", "d: '<sequence type: double, length: 5>'"),
            "without --no-arr",
        ),
        (one.replace("30.5", ".nan"), "NaN, which is no number"),
        (
            one.replace("0.0, 400.0, 22.25, 0.0,", "0.0, 400.0, 22.25, -30.0,"),
            "above each other",
        ),
    ] {
        let why = bench.refusal(&text);
        assert!(why.contains(cure), "{why}");
    }
    // A picture of every second pixel of the sensor's.
    let binned = one
        .replace("height: 48\nwidth: 64", "height: 96\nwidth: 128")
        .replace("binning_x: 0\nbinning_y: 0", "binning_x: 2\nbinning_y: 2");
    let source = Source::open(&bench.with_yaml(&binned)).unwrap();
    let halved = source.calibration().unwrap();
    assert_eq!((halved.focal_px, halved.baseline_m), (200.0, 0.05));
    // A part of it: 8 columns and 4 rows from its corner.
    let part = one
        .replace("height: 48\nwidth: 64", "height: 96\nwidth: 128")
        .replace(
            "x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0",
            "x_offset: 8\n  y_offset: 4\n  height: 48\n  width: 64",
        );
    let camera = Source::open(&bench.with_yaml(&part))
        .unwrap()
        .calibration()
        .unwrap();
    assert_eq!(
        (camera.focal_px, camera.cx, camera.cy),
        (400.0, 22.5, 18.25)
    );
}

#[test]
fn a_left_cameras_file_leaves_the_baseline_open() {
    let bench = Bench::new();
    let left = RIGHT.replace("-48.", "0.");
    let source = Source::open(&bench.with_yaml(&left)).unwrap();
    let camera = source.calibration().unwrap();
    assert!(!camera.calibrated);
    assert_eq!(camera.focal_px, 400.0);
    assert_eq!(
        source.warnings(),
        [
            "depths are in arbitrary units: the baseline is unknown, 0.1 m are assumed; set capture.baseline"
        ]
    );
    let settings = Settings {
        baseline: Some(0.25),
        ..bench.with_yaml(&left)
    };
    let source = Source::open(&settings).unwrap();
    let camera = source.calibration().unwrap();
    assert!(camera.calibrated && source.warnings().is_empty());
    assert_eq!(camera.baseline_m, 0.25);
}

#[test]
fn single_settings_count_before_the_file_and_the_source() {
    let bench = Bench::new();
    let settings = Settings {
        focal: Some(390.0),
        cx: Some(1.0),
        cy: Some(2.0),
        ..bench.with_yaml(RIGHT)
    };
    let expected = Calibration {
        focal_px: 390.0,
        cx: 1.0,
        cy: 2.0,
        baseline_m: 0.12,
        calibrated: true,
    };
    assert_eq!(
        Source::open(&settings).unwrap().calibration(),
        Some(expected)
    );
    let settings = Settings {
        baseline: Some(0.5),
        ..Settings::default()
    };
    let camera = Source::open(&settings).unwrap().calibration().unwrap();
    assert_eq!((camera.baseline_m, camera.focal_px), (0.5, 700.0));
}

#[test]
fn without_a_calibration_there_is_none_and_a_warning() {
    let source = Source::open(&Bench::new().settings()).unwrap();
    assert_eq!(source.calibration(), None);
    assert_eq!(
        source.warnings(),
        [
            "depths are in arbitrary units: no calibration, 64 px and 0.1 m are assumed; set capture.focal and capture.baseline, \
             capture.camera_info or capture.calibration"
        ]
    );
}

#[test]
fn a_baseline_alone_does_not_calibrate() {
    let bench = Bench::new();
    let settings = Settings {
        baseline: Some(0.2),
        ..bench.settings()
    };
    let source = Source::open(&settings).unwrap();
    let expected = Calibration {
        focal_px: 64.0,
        cx: 31.5,
        cy: 23.5,
        baseline_m: 0.2,
        calibrated: false,
    };
    assert_eq!(source.calibration(), Some(expected));
    assert_eq!(
        source.warnings(),
        [
            "depths are in arbitrary units: the focal length is unknown, 64 px are assumed; set capture.focal"
        ]
    );
}

#[test]
fn a_lens_that_distorts_is_told() {
    let bench = Bench::new();
    let yaml = RIGHT.replace("[0, 0, 0, 0, 0]", "[-0.3, 0.1, 0, 0, 0]");
    let source = Source::open(&bench.with_yaml(&yaml)).unwrap();
    assert_eq!(
        source.warnings(),
        [
            "the camera_info is of a lens that distorts: the images must be rectified, as image_rect topics are"
        ]
    );
}

#[test]
fn a_calibration_for_another_resolution_is_refused() {
    let bench = Bench::new();
    assert_eq!(
        bench.refusal(&RIGHT.replace("image_width: 64", "image_width: 1280")),
        "camera narrow_stereo/right is for images of 1280x48 pixels, and these are 64x48"
    );
}

#[test]
fn missing_keys_and_wrong_counts_are_named() {
    let bench = Bench::new();
    for key in [
        "image_width",
        "image_height",
        "camera_matrix",
        "projection_matrix",
    ] {
        let renamed = RIGHT.replace(key, "something_else");
        assert_eq!(
            bench.refusal(&renamed),
            format!("the key {key} of a ROS camera_info file is missing")
        );
    }
    assert_eq!(
        bench.refusal(&RIGHT.replace("-48., ", "")),
        "projection_matrix is of 3 rows and 4 columns and holds 11 numbers"
    );
}

#[test]
fn a_calibration_of_images_as_they_were_taken_is_sent_to_its_setting() {
    let bench = Bench::new();
    let why = bench.refusal("K1: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nD1: [0, 0, 0, 0, 0]\n");
    assert_eq!(
        why,
        "it is no ROS camera_info: it holds K1, D1; what other tools find out about the cameras of images as they were taken is capture.calibration"
    );
}

#[test]
fn impossible_focal_lengths_are_refused() {
    let bench = Bench::new();
    assert_eq!(
        bench.refusal(&RIGHT.replace("[400., 0., 30.5", "[0., 0., 30.5")),
        "the focal length of camera narrow_stereo/right must be positive, not 0"
    );
    assert_eq!(
        bench.refusal(&RIGHT.replace("0., 400., 22.25", "0., 410., 22.25")),
        "the focal lengths of camera narrow_stereo/right differ, 400 and 410, and pixels must be square"
    );
}

#[test]
fn a_file_that_is_no_yaml_or_not_there_is_refused() {
    let bench = Bench::new();
    let refusal = bench.refusal("image_width: [64\nimage_height: 48\n");
    assert!(
        refusal.starts_with("its line 2 (image_height: 48) is no YAML: is there a bracket"),
        "{refusal}"
    );
    assert!(!refusal.contains('\n'), "{refusal}");
    let settings = Settings {
        camera_info: Some("nowhere/camera.yaml".to_owned()),
        ..bench.settings()
    };
    let sentence = Source::open(&settings).unwrap_err().to_string();
    assert!(
        sentence.starts_with(&format!(
            "{} cannot be read: ",
            Path::new("nowhere/camera.yaml").display()
        )),
        "{sentence}"
    );
}
