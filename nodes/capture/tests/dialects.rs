//! One rig in everything that tools and people write down calibrations in: the same views come out of all.
#![expect(clippy::unwrap_used, reason = "tests")]

mod rig;

use std::fmt::Write as _;
use std::fs;

use capture::{LensModel, Settings, Source};
use glam::{DMat3, DQuat, DVec3};
use image::GrayImage;
use messages::{Calibration, Image, Owned};
use rig::{BOB, Camera, FISHEYE, Lens, SIZE, STEP, kalibr, list, rig};
use tempfile::TempDir;

struct Bench {
    folder: TempDir,
    rig: [Camera; 3],
}

impl Bench {
    fn new(lens: Lens) -> Self {
        let folder = TempDir::new().unwrap();
        fs::create_dir(folder.path().join("scene")).unwrap();
        for view in 0..3_u32 {
            // What is in it does not matter, only where each pixel goes.
            let gray = |x: u32, y: u32| {
                128.0
                    + 60.0 * (f64::from(x * (view + 1)) * 0.05).sin()
                    + 60.0 * (f64::from(y) * 0.07).cos()
            };
            let image = GrayImage::from_fn(SIZE.width, SIZE.height, |x, y| {
                image::Luma([gray(x, y) as u8])
            });
            image
                .save(folder.path().join(format!("scene/{view}.png")))
                .unwrap();
        }
        Self {
            folder,
            rig: rig([lens; 3]),
        }
    }

    fn settings(&self, files: &[String]) -> Settings {
        let write = |(n, text): (usize, &String)| {
            let path = self.folder.path().join(format!("calibration{n}"));
            fs::write(&path, text).unwrap();
            path.to_str().unwrap().to_owned()
        };
        let paths: Vec<String> = files.iter().enumerate().map(write).collect();
        Settings {
            source: self.folder.path().join("scene").display().to_string(),
            calibration: Some(paths.join(",")),
            ..Settings::default()
        }
    }

    fn open(&self, files: &[String]) -> Source {
        Source::open(&self.settings(files)).unwrap()
    }

    /// What is wrong with the files, without their names.
    fn refusal(&self, files: &[String]) -> String {
        let sentence = Source::open(&self.settings(files)).unwrap_err().to_string();
        let (_, why) = sentence.split_once(" gives no calibration: ").unwrap();
        why.to_owned()
    }
}

/// The rectified views and what is known of them.
fn taken(mut source: Source) -> (Calibration, Vec<u8>) {
    let mut all = Vec::new();
    for view in 0..3 {
        let mut image = Owned::<Image>::new(SIZE);
        image.fill(|room| source.read(0, view, room)).unwrap();
        all.extend_from_slice(image.view().pixels);
    }
    (source.calibration().unwrap(), all)
}

fn assert_same(name: &str, source: Source, expected: &(Calibration, Vec<u8>)) {
    let (camera, pixels) = taken(source);
    let off = (camera.focal_px - expected.0.focal_px).abs()
        + (camera.cx - expected.0.cx).abs()
        + (camera.cy - expected.0.cy).abs()
        + (camera.baseline_m - expected.0.baseline_m).abs();
    assert!(off < 1e-4, "{name}: {camera:?} is not {:?}", expected.0);
    // Rounding may move a place by a 256th of a pixel.
    let pairs = pixels.iter().zip(&expected.1);
    let most = pairs.map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(most <= 1, "{name}: {most} gray levels off");
}

fn k_of(camera: &Camera) -> [f64; 9] {
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
    [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
}

fn d_of(camera: &Camera) -> Vec<f64> {
    match camera.lens {
        Lens::Polynomial(k) => k[..5].to_vec(),
        Lens::Fisheye(k) => k.to_vec(),
    }
}

fn rows(matrix: DMat3) -> [f64; 9] {
    matrix.transpose().to_cols_array()
}

/// Numbers with blanks between.
fn blanks(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    values.join(" ")
}

fn yaml_matrix(name: &str, rows: usize, values: &[f64], dt: &str) -> String {
    let columns = values.len() / rows;
    format!(
        "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: {dt}\n   data: {}\n",
        list(values.iter().copied())
    )
}

fn xml_matrix(name: &str, rows: usize, values: &[f64]) -> String {
    let columns = values.len() / rows;
    format!(
        "<{name} type_id=\"opencv-matrix\">\n  <rows>{rows}</rows>\n  <cols>{columns}</cols>\n  <dt>d</dt>\n  <data>\n    {}</data></{name}>\n",
        blanks(values)
    )
}

fn json_matrix(name: &str, rows: usize, values: &[f64]) -> String {
    let columns = values.len() / rows;
    format!(
        "\"{name}\": {{\n \"type_id\": \"opencv-matrix\", \"rows\": {rows}, \"cols\": {columns}, \"dt\": \"d\",\n \"data\": {}\n}}",
        list(values.iter().copied())
    )
}

/// OpenCV's numbered matrices, from `base` on: name, rows, numbers.
fn numbered(cameras: &[Camera], base: usize, names: [&str; 2]) -> Vec<(String, usize, Vec<f64>)> {
    let mut all = Vec::new();
    for (view, camera) in cameras.iter().enumerate() {
        let number = view + base;
        all.push((format!("{}{number}", names[0]), 3, k_of(camera).to_vec()));
        all.push((format!("{}{number}", names[1]), 1, d_of(camera)));
        if view > 0 {
            let (turn, shift) = camera.from(&cameras[0]);
            all.push((format!("R{base}{number}"), 3, rows(turn).to_vec()));
            all.push((format!("T{base}{number}"), 3, shift.to_array().to_vec()));
        }
    }
    all
}

/// A pose as 16 numbers by rows.
fn four(turn: DMat3, shift: DVec3) -> Vec<f64> {
    let mut all = Vec::new();
    for row in 0..3 {
        all.extend(turn.row(row).to_array());
        all.push(shift[row]);
    }
    all.extend([0.0, 0.0, 0.0, 1.0]);
    all
}

/// Where a camera stands in a frame of its rig's body, which is turned and elsewhere.
fn in_body(camera: &Camera) -> (DMat3, DVec3) {
    let body = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_z(-1.1);
    let place = DVec3::new(0.4, -0.2, 0.9);
    (body * camera.turn.transpose(), body * camera.place + place)
}

#[test]
fn a_rig_is_the_same_in_every_dialect() {
    let bench = Bench::new(BOB);
    let yaml = |all: &[(String, usize, Vec<f64>)], dt: &str| {
        let all = all
            .iter()
            .map(|(name, rows, values)| yaml_matrix(name, *rows, values, dt));
        format!("%YAML:1.0\n---\n{}", all.collect::<String>())
    };
    let whole = numbered(&bench.rig, 1, ["K", "D"]);
    let expected = taken(bench.open(&[yaml(&whole, "d")]));
    assert!((expected.0.baseline_m - STEP).abs() < 1e-9);
    let mut files: Vec<(&str, Vec<String>)> = Vec::new();
    for dt in ["f", "\"1d\"", "u"] {
        files.push(("another type", vec![yaml(&whole, dt)]));
    }
    files.push((
        "from 0",
        vec![yaml(
            &numbered(&bench.rig, 0, ["camera_matrix_", "dist_coeffs_"]),
            "d",
        )],
    ));
    files.push((
        "other names",
        vec![yaml(
            &numbered(&bench.rig, 1, ["cameraMatrix", "distCoeffs"]),
            "d",
        )],
    ));
    let (intrinsic, extrinsic): (Vec<_>, Vec<_>) = whole
        .iter()
        .cloned()
        .partition(|(name, ..)| name.starts_with(['K', 'D']));
    files.push((
        "two files",
        vec![yaml(&intrinsic, "d"), yaml(&extrinsic, "d")],
    ));
    let xml: String = whole
        .iter()
        .map(|(name, rows, values)| xml_matrix(name, *rows, values))
        .collect();
    files.push(("XML", vec![format!("<?xml version=\"1.0\"?>\n<opencv_storage>\n{xml}<image_size>\n  512 480</image_size>\n</opencv_storage>\n")]));
    let json: Vec<String> = whole
        .iter()
        .map(|(name, rows, values)| json_matrix(name, *rows, values))
        .collect();
    files.push(("JSON", vec![format!("{{\n{}\n}}", json.join(",\n"))]));
    // As it was written for years: numbers without a digit after the point.
    files.push((
        "old JSON",
        vec![format!("{{\n{}\n}}", json.join(",\n").replace(".0,", ".,"))],
    ));
    let plain: String = whole
        .iter()
        .map(|(name, _, values)| format!("{name}: [{}]\n", blanks(values)))
        .collect();
    files.push(("no commas", vec![plain]));

    // A map a camera, in any order.
    let name = |view: usize| ["left", "centre", "right"][view];
    let map = |view: usize, indent: &str, pose: &str| {
        let camera = &bench.rig[view];
        let (turn, shift) = camera.from(&bench.rig[0]);
        let pose = match pose {
            "R" => format!(
                "R: {}\n{indent}T: {}",
                list(rows(turn)),
                list(shift.to_array())
            ),
            "rvec" => {
                let vector = DQuat::from_mat3(&turn).to_scaled_axis();
                format!(
                    "rvec: {}\n{indent}tvec: {}",
                    list(vector.to_array()),
                    list(shift.to_array())
                )
            }
            "pose" => {
                let back = turn.transpose();
                format!(
                    "camera_pose_matrix: !!opencv-matrix\n{indent}   rows: 4\n{indent}   cols: 4\n{indent}   dt: d\n{indent}   data: {}",
                    list(four(back, -(back * shift)))
                )
            }
            "named" => {
                let (turn, place) = in_body(camera);
                let q = DQuat::from_mat3(&turn);
                format!(
                    "pose:\n{indent}  position: {{x: {:?}, y: {:?}, z: {:?}}}\n{indent}  orientation: {{x: {:?}, y: {:?}, z: {:?}, w: {:?}}}",
                    place.x, place.y, place.z, q.x, q.y, q.z, q.w
                )
            }
            _ => format!("extrinsics: {}", list(four(turn, shift))),
        };
        format!(
            "camera_matrix: {}\n{indent}distortion_vector: {}\n{indent}distortion_type: 0\n{indent}img_width: 512\n{indent}img_height: 480\n{indent}{pose}\n",
            list(k_of(camera)),
            list(d_of(camera))
        )
    };
    for pose in ["R", "rvec", "pose", "named", "extrinsics"] {
        let maps = |order: [usize; 3]| {
            order
                .map(|view| format!("{}:\n  {}", name(view), map(view, "  ", pose)))
                .concat()
        };
        files.push((pose, vec![maps([0, 1, 2])]));
        files.push((pose, vec![maps([1, 0, 2])]));
        let listed = [0, 1, 2]
            .map(|view| format!("- name: cam{view}\n  {}", map(view, "  ", pose)))
            .concat();
        files.push((pose, vec![format!("cameras:\n{listed}")]));
        let numbered = [2, 1, 0]
            .map(|view| format!("cam{}:\n  {}", [1, 2, 10][view], map(view, "  ", pose)))
            .concat();
        files.push(("numbered, in another order", vec![numbered]));
        let group = [0, 1, 2]
            .map(|view| format!("camera_{view}:\n   {}", map(view, "   ", pose)))
            .concat();
        files.push((pose, vec![format!("%YAML:1.0\n---\nnb_camera: 3\n{group}")]));
        files.push((pose, (0..3).map(|view| map(view, "", pose)).collect()));
    }

    // Stacked.
    let all = |of: &dyn Fn(&Camera) -> Vec<f64>| list(bench.rig.iter().flat_map(of));
    let stack = |name: &str, sizes: &str, data: String| {
        format!("{name}: !!opencv-nd-matrix\n   sizes: [ {sizes} ]\n   dt: d\n   data: {data}\n")
    };
    files.push(("stacked", vec![[
        "%YAML:1.0\n---\n".to_owned(),
        stack("Ks", "3, 3, 3", all(&|camera| k_of(camera).to_vec())),
        stack("distortions", "3, 1, 5", all(&d_of)),
        stack("rvecs", "3, 3", all(&|camera| DQuat::from_mat3(&camera.from(&bench.rig[0]).0).to_scaled_axis().to_array().to_vec())),
        stack("Ts", "3, 3", all(&|camera| camera.from(&bench.rig[0]).1.to_array().to_vec())),
        "is_fisheye: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: i\n   data: [ 0, 0, 0 ]\n".to_owned(),
        "cam_ids: \"0,1,2\"\n".to_owned(),
    ].concat()]));

    // Calibrated one by one, and posed afterwards.
    let one_by_one = |camera: &Camera| {
        let (turn, place) = in_body(camera);
        let matrix = |name: &str, rows: usize, values: &[f64]| {
            format!(
                "{name}:\n   rows: {rows}\n   cols: {}\n   data: {}\n",
                values.len() / rows,
                list(values.iter().copied())
            )
        };
        let k = k_of(camera);
        let p = [
            k[0], 0.0, k[2], 0.0, 0.0, k[0], k[5], 0.0, 0.0, 0.0, 1.0, 0.0,
        ];
        [
            "%YAML:1.0\n---\ncamera_name: \"12_0\"\nimage_width: 512\nimage_height: 480\n"
                .to_owned(),
            matrix("camera_matrix", 3, &k),
            matrix("distortion_coefficients", 1, &d_of(camera)),
            "distortion_model: plumb_bob\n".to_owned(),
            matrix("rectification_matrix", 3, &rows(DMat3::IDENTITY)),
            matrix("projection_matrix", 3, &p),
            matrix("local_transform", 3, &four(turn, place)[..12]),
        ]
        .concat()
    };
    files.push(("one by one", bench.rig.iter().map(one_by_one).collect()));

    // A file a camera, in the frame of a body; and a chain that says the same of an inertial unit.
    let sensor = |camera: &Camera| {
        let (turn, place) = in_body(camera);
        let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
        format!(
            "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: {}\nrate_hz: 20\nresolution: [512, 480]\ncamera_model: pinhole\nintrinsics: [{fx:?}, {fy:?}, {cx:?}, {cy:?}] #fu, fv, cu, cv\ndistortion_model: radial-tangential\ndistortion_coefficients: {}\n",
            list(four(turn, place)),
            list(d_of(camera))
        )
    };
    files.push(("sensor", bench.rig.iter().map(sensor).collect()));
    let mut chain = String::new();
    for (view, camera) in bench.rig.iter().enumerate() {
        let (turn, place) = in_body(camera);
        let back = turn.transpose();
        let to_camera = four(back, -(back * place));
        let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
        writeln!(chain, "cam{view}:\n  T_cam_imu:").unwrap();
        for row in to_camera.chunks(4) {
            writeln!(chain, "  - {}", list(row.iter().copied())).unwrap();
        }
        writeln!(chain, "  camera_model: pinhole\n  intrinsics: [{fx:?}, {fy:?}, {cx:?}, {cy:?}]\n  distortion_model: radtan\n  distortion_coeffs: {}\n  resolution: [512, 480]", list(d_of(camera))).unwrap();
    }
    files.push(("chain", vec![chain]));
    for (name, files) in &files {
        let settings = bench.settings(files);
        let source =
            Source::open(&settings).unwrap_or_else(|why| panic!("{name}: {why}\n{}", files[0]));
        assert!(
            source.warnings().is_empty(),
            "{name}: {:?}",
            source.warnings()
        );
        assert!(
            source.notices()[1].contains("plumb_bob (k1, k2, p1, p2, k3)"),
            "{name}: {:?}",
            source.notices()
        );
        assert_same(name, source, &expected);
    }
}

/// The messages of the rig's cameras, rectified to its own axes, and how ROS 2 prints them.
fn echoed(bench: &Bench) -> [String; 3] {
    [0, 1, 2].map(|view: usize| {
        let camera = &bench.rig[view];
        let model = match camera.lens {
            Lens::Polynomial(_) => "plumb_bob",
            Lens::Fisheye(_) => "equidistant",
        };
        let shift = -640.0 * STEP * view as f64;
        let p = [640.0, 0.0, 255.0, shift, 0.0, 640.0, 239.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let block = |values: &[f64]| values.iter().map(|value| format!("- {value:?}\n")).collect::<String>();
        format!(
            "header:\n  stamp:\n    sec: 17\n    nanosec: {view}\n  frame_id: cam{view}_optical\nheight: 480\nwidth: 512\ndistortion_model: {model}\nd:\n{}k:\n{}r:\n{}p:\n{}binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: false\n---\n",
            block(&d_of(camera)), block(&k_of(camera)), block(&rows(camera.turn.transpose())), block(&p)
        )
    })
}

#[test]
fn messages_of_ros_are_the_same_in_every_spelling() {
    let bench = Bench::new(BOB);
    let files = echoed(&bench);
    let expected = taken(bench.open(&files));
    assert!(
        (expected.0.focal_px - 640.0).abs() < 1e-9 && (expected.0.baseline_m - STEP).abs() < 1e-9
    );
    let each =
        |change: &dyn Fn(&str) -> String| files.iter().map(|text| change(text)).collect::<Vec<_>>();
    let part = |text: &str, key: &str| -> Vec<f64> {
        let (_, after) = text.split_once(&format!("\n{key}:\n")).unwrap();
        let lines = after.lines().map_while(|line| line.strip_prefix("- "));
        lines.map(|line| line.parse().unwrap()).collect()
    };
    let ros_1 = |text: &str| {
        let mut out = "header: \n  seq: 3\n  stamp: \n    secs: 1\n    nsecs: 2\n  frame_id: \"x\"\nheight: 480\nwidth: 512\ndistortion_model: \"plumb_bob\"\n".to_owned();
        for key in ["d", "k", "r", "p"] {
            writeln!(out, "{}: {}", key.to_uppercase(), list(part(text, key))).unwrap();
        }
        out + "binning_x: 0\nbinning_y: 0\nroi: \n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: False\n---\n"
    };
    let written = |text: &str, tag: &str| {
        let mut out =
            "image_width: 512\nimage_height: 480\ncamera_name: narrow\ncamera_model: plumb_bob\n"
                .to_owned();
        for (key, name, rows) in [
            ("k", "camera_matrix", 3),
            ("d", "distortion_coefficients", 1),
            ("r", "rectification_matrix", 3),
            ("p", "projection_matrix", 3),
        ] {
            let values = part(text, key);
            writeln!(
                out,
                "{name}:{tag}\n  rows: {rows}\n  cols: {}\n  data: {}",
                values.len() / rows,
                list(values)
            )
            .unwrap();
        }
        out
    };
    let flow = |text: &str| {
        let lists = ["d", "k", "r", "p"].map(|key| format!("{key}: {}", list(part(text, key))));
        format!(
            "{{header: {{stamp: {{sec: 1, nanosec: 2}}, frame_id: c}}, height: 480, width: 512, distortion_model: plumb_bob, {},\n  binning_x: 0, binning_y: 0, roi: {{x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}}}}\n---\n",
            lists.join(", ")
        )
    };
    let plain = |text: &str| {
        let block = |key: &str, columns: usize| {
            let values = part(text, key);
            let lines = values.chunks(columns).map(|row| blanks(row) + "\n");
            lines.collect::<String>()
        };
        format!(
            "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n512\n\nheight\n480\n\n[narrow]\n\ncamera matrix\n{}\ndistortion\n{}\nrectification\n{}\nprojection\n{}\n",
            block("k", 3),
            block("d", 5),
            block("r", 3),
            block("p", 4)
        )
    };
    let whole = files.concat();
    let spellings: Vec<(&str, Vec<String>)> = vec![
        ("ROS 1", each(&ros_1)),
        ("written", each(&|text| written(text, ""))),
        (
            "tagged",
            each(&|text| format!("%YAML:1.0\n---\n{}", written(text, " !!opencv-matrix"))),
        ),
        ("flow", each(&flow)),
        ("plain", each(&plain)),
        (
            "without commas",
            each(&|text| ros_1(text).replace(", ", " ")),
        ),
        ("one file", vec![whole.clone()]),
        (
            "one file, again and again, cut off",
            vec![format!(
                "{whole}{}{}",
                whole.replace("sec: 17", "sec: 18"),
                &whole[..120]
            )],
        ),
    ];
    for (name, files) in &spellings {
        let source =
            Source::open(&bench.settings(files)).unwrap_or_else(|why| panic!("{name}: {why}"));
        assert!(
            source.notices()[1].contains("plumb_bob"),
            "{:?}",
            source.notices()
        );
        assert_same(name, source, &expected);
    }
}

#[test]
fn four_coefficients_without_a_model_are_refused_and_as_said_they_are_the_fisheyes() {
    let bench = Bench::new(FISHEYE);
    let expected = taken(bench.open(&[kalibr(&bench.rig)]));
    let storage = |before: &str| {
        let all = numbered(&bench.rig, 1, ["K", "D"]).into_iter();
        let all = all.map(|(name, rows, values)| match name.starts_with('D') {
            true => yaml_matrix(&name, 4, &values, "d"),
            false => yaml_matrix(&name, rows, &values, "d"),
        });
        format!("%YAML:1.0\n---\n{before}{}", all.collect::<String>())
    };
    let why = bench.refusal(&[storage("")]);
    assert!(
        why.starts_with(
            "camera 1 has four distortion coefficients (-0.02, 0.01, -0.003, 0.0008) and no model"
        ) && why.contains("k1, k2, p1, p2 of plumb_bob")
            && why.contains("k1 to k4 of a fisheye")
            && why.contains("capture.lens=fisheye"),
        "{why}"
    );
    for before in [
        "distortion_model: equidistant\n",
        "distortion_model: \"fisheye\"\n",
        "camera_model: fisheye\n",
        "camera_model: KANNALA_BRANDT\n",
        "fisheye_model: 1\n",
        "is_fisheye: true\n",
    ] {
        let source = bench.open(&[storage(before)]);
        assert!(
            source.notices()[1].contains("is equidistant (fisheye, k1 to k4), as"),
            "{:?}",
            source.notices()
        );
        assert_same(before, source, &expected);
    }
    let told = |lens| Settings {
        lens: Some(lens),
        ..bench.settings(&[storage("")])
    };
    let source = Source::open(&told(LensModel::Equidistant)).unwrap();
    assert!(
        source.notices()[1].contains("as capture.lens says"),
        "{:?}",
        source.notices()
    );
    assert_same("capture.lens", source, &expected);
    // What is told counts, and is another picture.
    let (_, other) = taken(Source::open(&told(LensModel::PlumbBob)).unwrap());
    assert_ne!(other, expected.1);
    let said = bench.open(&[storage("fisheye_model: 0\n")]);
    assert!(
        said.notices()[1].contains("plumb_bob"),
        "{:?}",
        said.notices()
    );
    // Messages say it themselves; where they do not, they are asked too.
    let messages = echoed(&bench);
    assert!(bench.open(&messages).notices()[1].contains("equidistant"));
    let unsaid =
        messages.map(|text| text.replace("distortion_model: equidistant", "distortion_model: ''"));
    assert!(
        bench
            .refusal(&unsaid)
            .contains("four distortion coefficients")
    );
    // Nothing to say where there is nothing.
    let settings = Settings {
        calibration: None,
        ..told(LensModel::PlumbBob)
    };
    let sentence = Source::open(&settings).unwrap_err().to_string();
    assert!(
        sentence.starts_with("capture.lens says what the coefficients in capture.calibration are"),
        "{sentence}"
    );
}

#[test]
fn longer_lists_of_coefficients_are_lenses_with_prisms_and_tilted_sensors() {
    let bench = Bench::new(BOB);
    let with = |more: &[f64]| {
        let all = numbered(&bench.rig, 1, ["K", "D"]).into_iter();
        let all = all.map(|(name, rows, mut values)| {
            if name.starts_with('D') {
                values.extend(more);
            }
            yaml_matrix(&name, rows, &values, "d")
        });
        vec![format!("%YAML:1.0\n---\n{}", all.collect::<String>())]
    };
    let expected = taken(bench.open(&with(&[])));
    // Zeros are nothing.
    assert_same("14 with zeros", bench.open(&with(&[0.0; 9])), &expected);
    for more in [
        &[0.0, 0.0, 0.0, 0.004, 0.0, -0.003, 0.0][..],
        &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, -0.01],
    ] {
        let source = bench.open(&with(more));
        assert!(
            source.notices()[1].contains("thin prism and tilt"),
            "{:?}",
            source.notices()
        );
        assert_ne!(taken(source).1, expected.1);
    }
    let why = bench.refusal(&with(&[0.1]));
    assert!(
        why.contains("has 6 distortion coefficients and no model; read are 5"),
        "{why}"
    );
}

#[test]
fn files_whose_lengths_are_no_metres_are_refused_until_the_baseline_is_said() {
    let bench = Bench::new(BOB);
    let with_t = |scale: f64| {
        let all = numbered(&bench.rig, 1, ["K", "D"]).into_iter();
        let all = all.map(|(name, rows, mut values)| {
            if name.starts_with('T') {
                values.iter_mut().for_each(|value| *value *= scale);
            }
            yaml_matrix(&name, rows, &values, "d")
        });
        vec![format!("%YAML:1.0\n---\n{}", all.collect::<String>())]
    };
    let why = bench.refusal(&with_t(1000.0));
    assert!(
        why.starts_with("it puts neighbouring cameras 60 m apart")
            && why.contains("that is 0.06 m, divide them by 1000"),
        "{why}"
    );
    let why = bench.refusal(&with_t(1e-3));
    assert!(
        why.starts_with("it puts neighbouring cameras 0.06 mm apart"),
        "{why}"
    );
    // Centimetres are asked for.
    let source = bench.open(&with_t(100.0));
    assert!(
        source.warnings()[0].contains("6 m apart"),
        "{:?}",
        source.warnings()
    );
    let settings = Settings {
        baseline: Some(STEP),
        ..bench.settings(&with_t(1000.0))
    };
    assert_eq!(
        Source::open(&settings)
            .unwrap()
            .calibration()
            .unwrap()
            .baseline_m,
        STEP
    );
    let messages = echoed(&bench);
    let in_p = |of: [&str; 2]| {
        let change = |text: &String| text.replace("- -38.4\n", of[0]).replace("- -76.8\n", of[1]);
        messages.iter().map(change).collect::<Vec<_>>()
    };
    let why = bench.refusal(&in_p(["- -38400.0\n", "- -76800.0\n"]));
    assert!(
        why.contains("60 m apart") && why.contains("millimetres"),
        "{why}"
    );
    let why = bench.refusal(&in_p(["- -0.06\n", "- -0.12\n"]));
    assert!(
        why.contains("P[3] is −f·b") && why.contains("write -38.4 there"),
        "{why}"
    );
    let why = bench.refusal(&messages.each_ref().map(|text| {
        text.replace("- 601.0\n", "- 6.01\n")
            .replace("- 596.0\n", "- 5.96\n")
            .replace("- 605.5\n", "- 6.05\n")
    }));
    assert!(
        why.contains("which pictures of 512x480 pixels cannot have"),
        "{why}"
    );
    let why = bench.refusal(&messages.each_ref().map(|text| {
        let (before, after) = text.split_once("\nk:\n").unwrap();
        let (_, rest) = after.split_once("r:\n").unwrap();
        format!("{before}\nk:\n{}r:\n{rest}", "- 0.0\n".repeat(9))
    }));
    assert!(
        why.contains("was not calibrated when it was written"),
        "{why}"
    );
}

#[test]
fn what_is_no_calibration_says_what_it_is_and_how_to_get_one() {
    let bench = Bench::new(BOB);
    for (text, parts) in [
        (
            "Camera.fx: 600.0\nCamera.fy: 600.0\n",
            &["holds Camera.fx, Camera.fy", "read are ROS"][..],
        ),
        (
            "K1: !!python/object/apply:numpy.core.multiarray._reconstruct\n  args: [",
            &["as Python dumps them", "tolist"],
        ),
        (
            "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nT: [-0.06, 0, 0]\n",
            &[
                "holds no camera matrix",
                "give the file that holds them too",
            ],
        ),
        (
            "<?xml version=\"1.0\"?>\n<document/>",
            &["XML of <document>", "cv2.FileStorage"],
        ),
        (
            "%time,field.header.seq,field.height\n1,2,3\n",
            &["comma-separated", "ros2 topic echo --once"],
        ),
        ("", &["it is empty"]),
    ] {
        let why = bench.refusal(&[text.to_owned()]);
        for part in parts {
            assert!(why.contains(part), "{why}");
        }
        // No line of a parser, and no advice of its own.
        assert!(
            !why.contains('\n') && !why.contains("-->") && !why.contains("serde"),
            "{why}"
        );
    }
    let path = bench.folder.path().join("calibration0");
    let settings = bench.settings(&[String::new()]);
    fs::write(&path, b"PK\x03\x04\x14\0npz").unwrap();
    let sentence = Source::open(&settings).unwrap_err().to_string();
    assert!(
        sentence.contains("NumPy archive") && sentence.contains("FileStorage"),
        "{sentence}"
    );
}

#[test]
fn what_depthai_keeps_of_its_sockets_is_the_rig_in_centimetres() {
    let bench = Bench::new(BOB);
    let whole = numbered(&bench.rig, 1, ["K", "D"]);
    let whole = whole
        .iter()
        .map(|(name, rows, values)| yaml_matrix(name, *rows, values, "d"));
    let expected = taken(bench.open(&[format!("%YAML:1.0\n---\n{}", whole.collect::<String>())]));
    // In sockets 1, 0 and 2 from left to right, each with the place of the next in its frame.
    let sockets = [1, 0, 2];
    let entry = |view: usize| {
        let camera = &bench.rig[view];
        let extrinsics = match bench.rig.get(view + 1) {
            Some(next) => {
                let (turn, shift) = next.from(camera);
                let cm = shift * 100.0;
                format!(
                    "\"rotationMatrix\": {}, \"translation\": {{\"x\": {:?}, \"y\": {:?}, \"z\": {:?}}}, \"toCameraSocket\": {}",
                    list(rows(turn)), cm.x, cm.y, cm.z, sockets[view + 1]
                )
            }
            None => "\"rotationMatrix\": [], \"translation\": {\"x\": 0, \"y\": 0, \"z\": 0}, \"toCameraSocket\": -1".to_owned(),
        };
        let d = d_of(camera).into_iter().chain([0.0; 9]);
        format!(
            "[{}, {{\"cameraType\": 0, \"distortionCoeff\": {}, \"extrinsics\": {{{extrinsics}}}, \"height\": {}, \"width\": {}, \"intrinsicMatrix\": {}}}]",
            sockets[view],
            list(d),
            SIZE.height,
            SIZE.width,
            list(k_of(camera))
        )
    };
    let json = |views: &[usize]| {
        let cameras: Vec<String> = views.iter().map(|&view| entry(view)).collect();
        format!(
            "{{\"boardName\": \"OAK\", \"cameraData\": [{}]}}",
            cameras.join(", ")
        )
    };
    assert_same("DepthAI", bench.open(&[json(&[1, 0, 2])]), &expected);
    let two = bench.refusal(&[json(&[1, 2])]);
    assert!(
        two.starts_with("it describes 2 cameras (socket 0, socket 2), and there are 3 views"),
        "{two}"
    );
    let broken = bench.refusal(&[json(&[0, 2])]);
    assert!(
        broken.contains("it says that by socket 0, which is not there"),
        "{broken}"
    );
}

/// KITTI's projection of a camera so far to the right of the first, as a line of numbers.
fn projection(metres: f64) -> String {
    let f = 0.9 * f64::from(SIZE.width);
    let [cx, cy] = [SIZE.width, SIZE.height].map(|side| (f64::from(side) - 1.0) / 2.0);
    blanks(&[f, 0.0, cx, -f * metres, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0])
}

#[test]
fn kittis_files_are_read_before_and_after_rectification() {
    let bench = Bench::new(BOB);
    let size = blanks(&[SIZE.width.into(), SIZE.height.into()]);
    let mut before = "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.95e-02\n".to_owned();
    let mut after = String::new();
    for (view, camera) in bench.rig.iter().enumerate() {
        let turn = blanks(&rows(DMat3::IDENTITY));
        let p = projection(STEP * view as f64);
        for (key, value) in [
            ("S", &size),
            ("K", &blanks(&k_of(camera))),
            ("D", &blanks(&d_of(camera))),
            ("R", &turn),
            ("R_rect", &turn),
            ("S_rect", &size),
            ("P_rect", &p),
        ] {
            writeln!(before, "{key}_{view:02}: {value}").unwrap();
        }
        writeln!(after, "P{view}: {p}").unwrap();
    }
    after.push_str("Tr: 4.2e-04 -9.9e-01 -8.0e-03 -1.1e-02 -7.2e-03 8.0e-03 -9.9e-01 -5.4e-02 9.9e-01 4.8e-04 -7.2e-03 -2.9e-01\n");
    let raw = bench
        .open(std::slice::from_ref(&before))
        .calibration()
        .unwrap();
    assert!((raw.baseline_m - STEP).abs() < 1e-9, "{raw:?}");
    let rectified = |text: &str| {
        let settings = bench.settings(&[text.to_owned()]);
        let settings = Settings {
            camera_info: settings.calibration.clone(),
            calibration: None,
            ..settings
        };
        Source::open(&settings)
    };
    for text in [&after, &before] {
        let known = rectified(text).unwrap().calibration().unwrap();
        assert!(
            known.calibrated && (known.baseline_m - STEP).abs() < 1e-9,
            "{known:?}"
        );
        assert_eq!(known.focal_px, 0.9 * f64::from(SIZE.width));
    }
    let why = bench.refusal(std::slice::from_ref(&after));
    assert!(why.contains("set capture.camera_info to it"), "{why}");
    let four = format!("{after}P3: {}\n", projection(3.0 * STEP));
    let why = rectified(&four).unwrap_err().to_string();
    assert!(
        why.contains("it describes 4 cameras, and there are 3 views"),
        "{why}"
    );
}

#[test]
fn files_that_cannot_be_a_rig_say_what_they_are_and_what_to_set_instead() {
    let bench = Bench::new(BOB);
    for (text, said) in [
        (
            "cam0=[500 0 160; 0 500 120; 0 0 1]\ncam1=[500 0 160; 0 500 120; 0 0 1]\ndoffs=0\nbaseline=50.0\nwidth=320\n",
            "set capture.focal=500, capture.cx=160, capture.cy=120 and, where its baseline is that of neighbouring views, capture.baseline=0.05",
        ),
        (
            "%YAML:1.0\n\nCamera.fx: 500\nCamera.fy: 500\nCamera.cx: 160\nCamera.cy: 120\nCamera.bf: 25.0\n",
            "of rectified images set capture.focal=500, capture.cx=160, capture.cy=120, and capture.baseline=0.05",
        ),
        (
            "[LEFT_CAM_2K]\nfx=1397.8\nfy=1397.8\ncx=1100\n\n[STEREO]\nBaseline=119.9\n",
            "it is the calibration of a ZED, which has two cameras",
        ),
        (
            "Calibration results\n===\nCamera-system parameters:\n\tcam0 (/cam0/image_raw):\n\t type: <class 'x'>\n",
            "it is Kalibr's report; give the camchain",
        ),
        (
            "# Camera list with one line of data per camera:\n1 SIMPLE_RADIAL 320 240 500 160 120 0.01\n",
            "it is COLMAP's list of cameras",
        ),
        (
            "[{\"cameras\": [{\"image_prefix\": \"left/\"}]}]",
            "it is COLMAP's description of a rig",
        ),
        (
            "% of MATLAB\nfc = [ 500.0 ; 500.0 ];\ncc = [ 160 ; 120 ];\n",
            "it is a script of MATLAB's toolbox",
        ),
    ] {
        let why = bench.refusal(&[text.to_owned()]);
        assert!(why.contains(said), "{why}");
    }
    let packed = bench.folder.path().join("packed.yaml.gz");
    fs::write(&packed, b"\x1f\x8b\x08\x00rest").unwrap();
    let settings = Settings {
        calibration: Some(packed.display().to_string()),
        ..bench.settings(&[])
    };
    let why = Source::open(&settings).unwrap_err().to_string();
    assert!(why.contains("unpack it, with `gunzip"), "{why}");
}
