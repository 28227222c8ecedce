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
        ["depths are in arbitrary units: the baseline is unknown, 0.1 m are assumed; set baseline"]
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
            "depths are in arbitrary units: no calibration, 64 px and 0.1 m are assumed; set focal and baseline, \
          camera_info or calibration"
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
            "depths are in arbitrary units: the focal length is unknown, 64 px are assumed; set focal"
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
        "it is for images of 1280x48 pixels, and these are 64x48"
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
        "projection_matrix must hold 12 numbers, and holds 11"
    );
}

#[test]
fn impossible_focal_lengths_are_refused() {
    let bench = Bench::new();
    assert_eq!(
        bench.refusal(&RIGHT.replace("[400., 0., 30.5", "[0., 0., 30.5")),
        "its focal length must be positive, not 0"
    );
    assert_eq!(
        bench.refusal(&RIGHT.replace("0., 400., 22.25", "0., 410., 22.25")),
        "its focal lengths differ, 400 and 410, and pixels must be square"
    );
}

#[test]
fn a_file_that_is_no_yaml_or_not_there_is_refused() {
    let bench = Bench::new();
    let refusal = bench.refusal("image_width: [64\nimage_height: 48\n");
    assert!(
        refusal.starts_with("it is no camera_info YAML ("),
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
