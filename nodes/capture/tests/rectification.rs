//! Rectification of a rig whose lenses distort and whose cameras are tilted, from the files of three tools.
#![expect(clippy::unwrap_used, reason = "tests")]

mod rig;

use std::fmt::Write as _;
use std::fs;

use capture::{Mode, Settings, Source};
use glam::{DMat3, DVec2, DVec3};
use image::GrayImage;
use messages::{Image, Owned, Raw};
use rig::{BOB, Camera, FISHEYE, Lens, RADTAN, RATIONAL, SIZE, STEP, axes, kalibr, list, rig};
use tempfile::TempDir;

/// Standard deviation of a dot, in pixels.
const DOT: f64 = 2.0;

/// Points in the rig's frame: a grid seen by the middle camera, at depths from 0.8 to 1.5 metres.
fn points() -> Vec<DVec3> {
    let mut points = Vec::new();
    for row in -5..=5_i32 {
        for column in -5..=5_i32 {
            let depth = 0.8 + 0.175 * f64::from((row * 3 + column * 7).rem_euclid(5));
            let aside = DVec3::new(f64::from(column) * 0.07, f64::from(row) * 0.065, 1.0);
            points.push(aside * depth + DVec3::X * STEP);
        }
    }
    points
}

/// What a camera sees of the points: a soft dot each.
fn picture(camera: &Camera) -> GrayImage {
    let mut gray = vec![40.0; SIZE.pixels()];
    for point in points() {
        let at = camera.sees(point);
        let reach = (6.0 * DOT) as i64;
        for y in at.y as i64 - reach..=at.y as i64 + reach {
            for x in at.x as i64 - reach..=at.x as i64 + reach {
                if x >= 0 && y >= 0 && x < i64::from(SIZE.width) && y < i64::from(SIZE.height) {
                    let off = DVec2::new(x as f64, y as f64) - at;
                    let bright = 190.0 * (-off.length_squared() / (2.0 * DOT * DOT)).exp();
                    gray[y as usize * SIZE.width as usize + x as usize] += bright;
                }
            }
        }
    }
    let gray: Vec<u8> = gray.into_iter().map(|v: f64| v.round() as u8).collect();
    GrayImage::from_raw(SIZE.width, SIZE.height, gray).unwrap()
}

fn rows(matrix: DMat3) -> [f64; 9] {
    matrix.transpose().to_cols_array()
}

fn camera_matrix(camera: &Camera) -> [f64; 9] {
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
    [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
}

/// A scene of three views on disk, and calibration files beside it.
struct Bench {
    folder: TempDir,
    rig: [Camera; 3],
}

impl Bench {
    fn new(lenses: [Lens; 3]) -> Self {
        let bench = Self {
            folder: TempDir::new().unwrap(),
            rig: rig(lenses),
        };
        fs::create_dir(bench.folder.path().join("scene")).unwrap();
        for (view, camera) in bench.rig.iter().enumerate() {
            let path = bench.folder.path().join(format!("scene/{view}.png"));
            picture(camera).save(path).unwrap();
        }
        bench
    }

    fn write(&self, name: &str, text: &str) -> String {
        let path = self.folder.path().join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }

    fn kalibr(&self) -> String {
        kalibr(&self.rig)
    }

    fn opencv(&self) -> String {
        let mut text = "%YAML:1.0\n---\nimage_width: 512\nimage_height: 480\n".to_owned();
        let mut put = |name: String, rows: usize, values: &[f64]| {
            let columns = values.len() / rows;
            writeln!(
                text,
                "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {}",
                list(values.iter().copied())
            )
            .unwrap();
        };
        for (view, camera) in self.rig.iter().enumerate() {
            let number = view + 1;
            put(format!("K{number}"), 3, &camera_matrix(camera));
            let Lens::Polynomial(k) = camera.lens else {
                panic!("one model a file");
            };
            put(format!("D{number}"), 1, &k);
            if view > 0 {
                let (turn, shift) = camera.from(&self.rig[0]);
                put(format!("R1{number}"), 3, &rows(turn));
                put(format!("T1{number}"), 3, &shift.to_array());
            }
        }
        text
    }

    /// A file a camera, rectified to the rig's own axes.
    fn ros(&self) -> Vec<String> {
        let file = |(view, camera): (usize, &Camera)| {
            let (model, coefficients) = match camera.lens {
                Lens::Polynomial(k) if k[5..] == [0.0; 3] => ("plumb_bob", k[..5].to_vec()),
                Lens::Polynomial(k) => ("rational_polynomial", k.to_vec()),
                Lens::Fisheye(k) => ("equidistant", k.to_vec()),
            };
            let f = 640.0;
            let shift = -f * STEP * view as f64;
            let projection = [f, 0., 255., shift, 0., f, 239., 0., 0., 0., 1., 0.];
            format!(
                "image_width: 512\nimage_height: 480\ncamera_name: cam{view}\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: {}\ndistortion_model: {model}\ndistortion_coefficients:\n  rows: 1\n  cols: {}\n  data: {}\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: {}\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: {}\n",
                list(camera_matrix(camera)),
                coefficients.len(),
                list(coefficients.iter().copied()),
                list(rows(camera.turn.transpose())),
                list(projection)
            )
        };
        self.rig.iter().enumerate().map(file).collect()
    }

    fn settings(&self, files: &[String]) -> Settings {
        let paths = files.iter().enumerate();
        let paths = paths.map(|(n, text)| self.write(&format!("calibration{n}.yaml"), text));
        let paths: Vec<String> = paths.collect();
        Settings {
            source: self
                .folder
                .path()
                .join("scene")
                .to_str()
                .unwrap()
                .to_owned(),
            calibration: Some(paths.join(",")),
            ..Settings::default()
        }
    }

    fn open(&self, files: &[String]) -> Source {
        Source::open(&self.settings(files)).unwrap()
    }

    /// What is wrong with the files, without their names.
    fn refusal(&self, files: &[String]) -> String {
        let settings = self.settings(files);
        let sentence = Source::open(&settings).unwrap_err().to_string();
        let (_, why) = sentence.split_once(" gives no calibration: ").unwrap();
        why.to_owned()
    }
}

/// Where a dot is that is expected here: the centroid of what is brighter than the background, found twice.
fn dot(image: &[u8], expected: DVec2) -> Option<DVec2> {
    let reach = 7;
    let mut at = expected;
    for _ in 0..4 {
        let (column, row) = (at.x.round() as i64, at.y.round() as i64);
        let (mut sum, mut total) = (DVec2::ZERO, 0.0);
        for y in row - reach..=row + reach {
            for x in column - reach..=column + reach {
                if x < 0 || y < 0 || x >= i64::from(SIZE.width) || y >= i64::from(SIZE.height) {
                    return None;
                }
                let value = image[y as usize * SIZE.width as usize + x as usize];
                let bright = (f64::from(value) - 42.0).max(0.0);
                sum += DVec2::new(x as f64, y as f64) * bright;
                total += bright;
            }
        }
        if total < 500.0 {
            return None;
        }
        at = sum / total;
    }
    Some(at)
}

/// The figures of a rectified rig.
struct Figures {
    dots: usize,
    /// Pixels between the rows of a dot in two neighbouring views, 95th percentile.
    vertical: f64,
    /// Error of the depth from the outer views, as a part of it, the largest.
    depth: f64,
    /// Pixels between a dot and where it should be, the largest.
    off: f64,
}

fn measured(bench: &Bench, source: &mut Source) -> Figures {
    let camera = source.calibration().unwrap();
    assert!(camera.calibrated && (camera.baseline_m - STEP).abs() < 1e-9);
    let mut images = Vec::new();
    for view in 0..3 {
        let mut image = Owned::<Image>::new(SIZE);
        image.fill(|room| source.read(0, view, room)).unwrap();
        images.push(image);
    }
    // The axes that are to be expected: x along the cameras, z the mean of theirs. ROS files say them themselves.
    let is_ros = camera.focal_px == 640.0;
    let axes = match is_ros {
        true => DMat3::IDENTITY,
        false => axes(&bench.rig),
    };
    let (mut dots, mut vertical) = (0, Vec::new());
    let (mut depth, mut off) = (0f64, 0f64);
    for point in points() {
        let own = |view: usize| axes * (point - bench.rig[view].place);
        let found: Option<Vec<DVec2>> = (0..3)
            .map(|view| {
                let at = own(view);
                let middle = DVec2::new(camera.cx, camera.cy);
                let expected = middle + at.truncate() / at.z * camera.focal_px;
                let found = dot(images[view].view().pixels, expected)?;
                off = off.max((found - expected).length());
                Some(found)
            })
            .collect();
        let Some(found) = found else { continue };
        dots += 1;
        vertical.extend(found.windows(2).map(|pair| (pair[1].y - pair[0].y).abs()));
        let disparity = (found[0].x - found[2].x) / 2.0;
        let [_, _, seen] = camera.point_m(found[0].x, found[0].y, disparity);
        depth = depth.max((seen / own(0).z - 1.0).abs());
    }
    vertical.sort_by(f64::total_cmp);
    Figures {
        dots,
        vertical: vertical[vertical.len() * 95 / 100],
        depth,
        off,
    }
}

/// Opens the files and proves that dots lie in one row of all views, and where they should.
fn prove(bench: &Bench, files: &[String]) {
    let mut source = bench.open(files);
    assert!(source.warnings().is_empty(), "{:?}", source.warnings());
    let figures = measured(bench, &mut source);
    assert!(figures.dots > 80, "{} dots", figures.dots);
    assert!(figures.vertical < 0.1, "{} px", figures.vertical);
    assert!(figures.depth < 0.005, "{}", figures.depth);
    assert!(figures.off < 0.1, "{} px", figures.off);
}

#[test]
fn a_tilted_rig_is_rectified_by_a_kalibr_camchain() {
    let bench = Bench::new([RADTAN, FISHEYE, RADTAN]);
    prove(&bench, &[bench.kalibr()]);
}

#[test]
fn a_tilted_rig_is_rectified_by_an_opencv_file() {
    let bench = Bench::new([BOB, RATIONAL, RADTAN]);
    prove(&bench, &[bench.opencv()]);
    // As OpenCV 5 opens its files.
    prove(&bench, &[bench.opencv().replace("%YAML:1.0", "%YAML 1.2")]);
}

#[test]
fn a_tilted_rig_is_rectified_by_ros_files_as_they_say() {
    let bench = Bench::new([BOB, FISHEYE, RATIONAL]);
    let mut source = bench.open(&bench.ros());
    let figures = measured(&bench, &mut source);
    assert!(
        figures.dots > 80 && figures.vertical < 0.1,
        "{}",
        figures.vertical
    );
    assert!(
        figures.depth < 0.005 && figures.off < 0.1,
        "{}",
        figures.off
    );
}

#[test]
fn without_rectification_the_same_rows_are_far_apart() {
    let bench = Bench::new([RADTAN, FISHEYE, RADTAN]);
    let settings = Settings {
        rectify: false,
        ..bench.settings(&[bench.kalibr()])
    };
    let mut source = Source::open(&settings).unwrap();
    let mut image = Owned::<Image>::new(SIZE);
    image.fill(|room| source.read(0, 1, room)).unwrap();
    assert_eq!(image.view().pixels, picture(&bench.rig[1]).as_raw());
    let [a, b] = [0, 1].map(|view| bench.rig[view].sees(points()[60]));
    assert!((a.y - b.y).abs() > 20.0, "{a} {b}");
}

#[test]
fn one_camera_along_a_rail_is_rectified_by_its_own_calibration() {
    for lens in [RADTAN, FISHEYE, RATIONAL] {
        let mut bench = Bench::new([lens; 3]);
        let frames: Vec<Camera> = (0..5)
            .map(|frame| Camera {
                turn: DMat3::IDENTITY,
                place: DVec3::X * STEP * (f64::from(frame) - 1.0),
                ..bench.rig[0]
            })
            .collect();
        fs::create_dir(bench.folder.path().join("rail")).unwrap();
        for (frame, camera) in frames.iter().enumerate() {
            let path = bench.folder.path().join(format!("rail/{frame}.png"));
            picture(camera).save(path).unwrap();
        }
        let millimetres = (0..5).map(|frame| format!("{}\n", f64::from(frame) * STEP * 1e3));
        let positions: String = std::iter::once("position_mm\n".to_owned())
            .chain(millimetres)
            .collect();
        bench.rig[0] = frames[0];
        let (kalibr, ros) = (kalibr(&bench.rig[..1]), bench.ros().swap_remove(0));
        // A file of one camera may have a projection of pixels that are not square.
        let ros = ros.replace("[640.0, 0.0, 255.0", "[633.0, 0.0, 255.0");
        let is_known_to_kalibr = lens != RATIONAL;
        let files = [ros]
            .into_iter()
            .chain(is_known_to_kalibr.then_some(kalibr));
        for file in files {
            let settings = Settings {
                source: bench.folder.path().join("rail").display().to_string(),
                mode: Mode::Rail,
                positions: Some(bench.write("positions.csv", &positions)),
                stride: Some(1),
                drift: Some(0.0),
                raw: true,
                ..bench.settings(&[file])
            };
            let mut source = Source::open(&settings).unwrap();
            assert!(source.warnings().is_empty(), "{:?}", source.warnings());
            let calibration = source.calibration().unwrap();
            assert!((calibration.baseline_m - STEP).abs() < 1e-9);
            let middle = DVec2::new(calibration.cx, calibration.cy);
            let mut dots = 0;
            for (frame, camera) in (0..).zip(&frames) {
                let (mut image, mut raw) = (Owned::<Image>::new(SIZE), Owned::<Raw>::new(SIZE));
                image.fill(|room| source.read(frame, 0, room)).unwrap();
                raw.fill(|room| source.read_raw(frame, 0, room)).unwrap();
                assert_eq!(raw.view().pixels, picture(camera).as_raw());
                let place = |point: DVec3| {
                    let own = point - camera.place;
                    middle + own.truncate() / own.z * calibration.focal_px
                };
                let expected: Vec<DVec2> = points().into_iter().map(place).collect();
                // From the side some dots lie on others.
                let is_alone = |at: &&DVec2| {
                    let near = expected.iter().filter(|other| at.distance(**other) < 24.0);
                    near.count() == 1
                };
                for &expected in expected.iter().filter(is_alone) {
                    if let Some(found) = dot(image.view().pixels, expected) {
                        let off = (found - expected).length();
                        assert!(off < 0.1, "{off} px at {expected}");
                        dots += 1;
                    }
                }
            }
            assert!(dots > 300, "{dots} dots");
        }
    }
}

#[test]
fn raw_images_are_asked_for_only_beside_rectified_ones() {
    let bench = Bench::new([RADTAN; 3]);
    let asked = Settings {
        raw: true,
        ..bench.settings(&[bench.kalibr()])
    };
    assert!(Source::open(&asked).is_ok());
    let unrectified = [
        Settings {
            calibration: None,
            ..asked.clone()
        },
        Settings {
            rectify: false,
            ..asked.clone()
        },
        Settings {
            source: "scene:tab".to_owned(),
            calibration: None,
            ..asked
        },
    ];
    for settings in unrectified {
        let sentence = Source::open(&settings).unwrap_err().to_string();
        assert!(sentence.starts_with("capture.raw is set and images are not rectified"));
    }
}

#[test]
fn a_wrong_number_of_cameras_is_refused() {
    let bench = Bench::new([RADTAN, FISHEYE, RADTAN]);
    let whole = bench.kalibr();
    let two = whole.split("cam2:").next().unwrap();
    assert_eq!(
        bench.refusal(&[two.to_owned()]),
        "it describes 2 cameras (cam0, cam1), and there are 3 views; it must describe one camera a view, left to right (capture.views, or --views, says which)"
    );
    let [one, ..] = &*bench.ros() else { panic!() };
    assert_eq!(
        bench.refusal(std::slice::from_ref(one)),
        "it describes one camera (camera cam0), and there are 3 views: of images as they were taken give a camera_info a view, left to right, separated by commas; of images that are rectified already set capture.camera_info instead"
    );
    assert_eq!(
        bench.refusal(&[whole.clone(), whole]),
        "a Kalibr camchain holds all cameras; give one file"
    );
}

#[test]
fn a_calibration_for_another_resolution_is_refused() {
    let bench = Bench::new([BOB, RATIONAL, RADTAN]);
    let other = bench
        .opencv()
        .replace("image_width: 512", "image_width: 1024");
    assert_eq!(
        bench.refusal(&[other]),
        "camera 1 is calibrated for images of 1024x480 pixels, and these are 512x480"
    );
    // A file that does not say its size is given away by its principal point.
    let other = bench.opencv().replace("image_width", "other_width");
    assert!(Source::open(&bench.settings(std::slice::from_ref(&other))).is_ok());
    let scenes = bench.folder.path().join("scenes");
    for (scene, more) in [("one", 0), ("two", 8)] {
        fs::create_dir_all(scenes.join(scene)).unwrap();
        for view in 0..3 {
            let image = GrayImage::new(SIZE.width + more, SIZE.height);
            image
                .save(scenes.join(format!("{scene}/{view}.png")))
                .unwrap();
        }
    }
    let of_two_sizes = Settings {
        source: scenes.display().to_string(),
        ..bench.settings(std::slice::from_ref(&other))
    };
    let refused = Source::open(&of_two_sizes).unwrap_err().to_string();
    assert!(
        refused.contains("one calibration is for images of one size, and there are scans of 512x480 and of 520x480 pixels"),
        "{refused}"
    );
    let other = other.replace("258.0", "516.0");
    assert_eq!(
        bench.refusal(&[other]),
        "camera 1 has its principal point at 516.0, 236.5, far from the middle of images of 512x480 pixels: is it calibrated for another resolution?"
    );
}

#[test]
fn unknown_models_and_wrong_counts_of_coefficients_are_named() {
    let bench = Bench::new([RADTAN, FISHEYE, RADTAN]);
    let other = bench.kalibr().replace("radtan", "fov");
    assert_eq!(
        bench.refusal(&[other]),
        "cam0 has the distortion model \"fov\"; known are plumb_bob (radtan), rational_polynomial, equidistant (fisheye) and none: calibrate with one of these, or say with capture.lens which of them it is"
    );
    let other = bench.kalibr().replace("equidistant", "rational_polynomial");
    assert_eq!(
        bench.refusal(&[other]),
        "cam1 has 4 distortion coefficients, and the model rational_polynomial takes 5 or 8 or 12 or 14"
    );
    let other = bench.kalibr().replace("pinhole", "omni");
    assert_eq!(
        bench.refusal(&[other]),
        "the camera_model of cam0 is \"omni\", and only pinhole and fisheye can be rectified"
    );
    let other = bench.kalibr().replace("T_cn_cnm1", "T_cam_imu");
    assert_eq!(
        bench.refusal(&[other]),
        "T_cn_cnm1 of cam1 is missing: where it stands is not known"
    );
}

#[test]
fn files_of_no_tool_and_of_several_are_refused() {
    let bench = Bench::new([BOB, RATIONAL, RADTAN]);
    let why = bench.refusal(&["a: 1\nb: 2\n".to_owned()]);
    assert!(
        why.starts_with(
            "it describes no camera that is known here: it holds a, b; read are ROS camera_info"
        ),
        "{why}"
    );
    let why = bench.refusal(&["a: [1\n".to_owned()]);
    assert!(why.starts_with("its line 1 (a: [1) is no YAML"), "{why}");
    assert_eq!(
        bench.refusal(&[bench.opencv(), bench.ros()[0].clone()]),
        "files of different tools cannot be mixed"
    );
    let mut settings = bench.settings(&[bench.opencv()]);
    settings.camera_info = Some("camera.yaml".to_owned());
    let sentence = Source::open(&settings).unwrap_err().to_string();
    assert!(sentence.ends_with("set one of the two"), "{sentence}");
    let rendered = Settings {
        source: "scene:tab".to_owned(),
        camera_info: None,
        ..settings
    };
    let sentence = Source::open(&rendered).unwrap_err().to_string();
    assert!(sentence.ends_with("leave calibration away"), "{sentence}");
}

#[test]
fn cameras_that_do_not_stand_in_a_row_at_equal_steps_are_refused() {
    let mut bench = Bench::new([BOB, RATIONAL, RADTAN]);
    bench.rig[1].place.x = 0.085;
    assert_eq!(
        bench.refusal(&[bench.opencv()]),
        "its cameras stand at 0.0, 85.0, 120.0 mm along their line, and their steps must be equal"
    );
    bench.rig[1].place.x = -0.06;
    let why = bench.refusal(&[bench.opencv()]);
    assert!(
        why.contains("views go from left to right: list them in that order"),
        "{why}"
    );
    bench.rig = rig([BOB, RATIONAL, RADTAN]);
    for (view, camera) in bench.rig.iter_mut().enumerate() {
        camera.place = DVec3::Y * STEP * view as f64;
    }
    assert_eq!(
        bench.refusal(&[bench.opencv()]),
        "its cameras do not stand in a row beside each other"
    );
    for camera in &mut bench.rig {
        camera.place = DVec3::ZERO;
    }
    assert_eq!(
        bench.refusal(&[bench.opencv()]),
        "its cameras all stand at one place"
    );
    let apart: Vec<String> = bench
        .ros()
        .iter()
        .map(|f| f.replace("-38.4", "0.0").replace("-76.8", "0.0"))
        .collect();
    assert!(
        bench
            .refusal(&apart)
            .starts_with("its projections hold no distances")
    );
    let mut other = bench.ros();
    other[2] = other[2]
        .replace("[640.0", "[600.0")
        .replace("0.0, 640.0", "0.0, 600.0");
    let why = bench.refusal(&other);
    assert!(why.ends_with("they must be of one rectification"), "{why}");
}

#[test]
fn small_departures_from_a_row_are_told_with_their_size() {
    let mut bench = Bench::new([BOB, RATIONAL, RADTAN]);
    bench.rig[1].place += DVec3::new(0.001, 0.0012, 0.0);
    let source = bench.open(&[bench.opencv()]);
    assert!(
        source.notices()[2]
            .contains("steps of 60.00 mm, equal within 1.67 %, centres within 0.80 mm"),
        "{:?}",
        source.notices()
    );
    let [unequal, off] = source.warnings() else {
        panic!("{:?}", source.warnings());
    };
    assert!(
        unequal.contains("by up to 1.7 %") && unequal.contains("misses by 0.8 px"),
        "{unequal}"
    );
    assert!(off.contains("up to 0.80 mm off their line"), "{off}");
}
