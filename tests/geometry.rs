//! Images as tilted cameras with lenses that distort take them: rectified, matched, measured; and what
//! `check-geometry` says of them.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;
#[path = "../nodes/capture/tests/rig/mod.rs"]
mod rig;

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use harness::{Ran, World};
use image::GrayImage;
use messages::bus::FramesOut;
use messages::recording::Recording;
use messages::{Image, Kind, Raw, Topic};
use rig::{Camera, Eye, FISHEYE, RADTAN, axes, held, kalibr, rig};
use serde_json::Value;

/// A wall that slants, and two boards before it, all painted.
struct Board {
    /// A point of it, in metres in the rig's frame, and its two directions.
    middle: DVec3,
    along: DVec3,
    down: DVec3,
    /// Half its width and height, in metres.
    half: [f64; 2],
}

fn boards() -> [Board; 3] {
    let board = |middle: [f64; 3], along: [f64; 3], down: [f64; 3], half| Board {
        middle: DVec3::from(middle),
        along: DVec3::from(along).normalize(),
        down: DVec3::from(down).normalize(),
        half,
    };
    [
        board(
            [0.06, 0.0, 1.5],
            [1.0, 0.0, 0.25],
            [0.0, 1.0, -0.1],
            [9.0, 9.0],
        ),
        board(
            [-0.12, -0.1, 1.05],
            [1.0, 0.1, -0.2],
            [0.1, -1.0, 0.0],
            [0.17, 0.13],
        ),
        board(
            [0.22, 0.12, 0.9],
            [1.0, -0.3, 0.0],
            [0.3, 1.0, 0.15],
            [0.12, 0.15],
        ),
    ]
}

/// The nearest board on a ray from a place: how many times the ray, and the gray level there.
fn seen(place: DVec3, ray: DVec3) -> Option<(f64, f64)> {
    let mut nearest = None;
    for (number, board) in boards().iter().enumerate() {
        let normal = board.along.cross(board.down);
        let far = (board.middle - place).dot(normal) / ray.dot(normal);
        let at = place + ray * far - board.middle;
        let (u, v) = (at.dot(board.along), at.dot(board.down));
        let is_on = far > 0.0 && u.abs() <= board.half[0] && v.abs() <= board.half[1];
        if is_on && nearest.is_none_or(|(other, _)| far < other) {
            nearest = Some((far, paint(number as i64, u, v)));
        }
    }
    nearest
}

/// Tiles of many grays with a disc on each.
fn paint(board: i64, u: f64, v: f64) -> f64 {
    const TILE: f64 = 0.036;
    let (column, row) = ((u / TILE).floor() as i64, (v / TILE).floor() as i64);
    let gray = |salt: i64| {
        let mut hash = (column * 7919 + row * 104_729 + board * 1_299_709 + salt) as u64;
        hash = (hash ^ (hash >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        30.0 + ((hash ^ (hash >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 56) as f64 * 0.75
    };
    let middle = [(column as f64 + 0.5) * TILE, (row as f64 + 0.5) * TILE];
    match (u - middle[0]).hypot(v - middle[1]) < 0.3 * TILE {
        true => gray(1),
        false => gray(0),
    }
}

/// What a camera sees.
fn picture(camera: &Camera) -> GrayImage {
    Eye::new(*camera).picture(|place, ray| seen(place, ray).unwrap().1)
}

/// Writes what these cameras see, and gives the folder.
fn scene(world: &World, name: &str, cameras: &[Camera]) -> PathBuf {
    let folder = world.path(name);
    fs::create_dir_all(&folder).unwrap();
    std::thread::scope(|scope| {
        for (view, camera) in cameras.iter().enumerate() {
            let path = folder.join(format!("view{view}.png"));
            scope.spawn(move || picture(camera).save(path).unwrap());
        }
    });
    folder
}

/// A rig that is tilted and distorts: its cameras, the folder of what they see, and the setting that says how they do.
fn distorted(world: &World) -> ([Camera; 3], PathBuf, String) {
    let cameras = rig([RADTAN, FISHEYE, RADTAN]);
    let folder = scene(world, "scene", &cameras);
    let calibration = world.path("camchain.yaml");
    fs::write(&calibration, kalibr(&cameras)).unwrap();
    let set = format!("capture.calibration={}", calibration.display());
    (cameras, folder, set)
}

fn check(world: &World, folder: &Path, set: &[&str]) -> (Option<i32>, Value) {
    let source = folder.to_string_lossy();
    let mut arguments = vec!["check-geometry", &source, "--json"];
    for set in set {
        arguments.extend(["--set", set]);
    }
    let ran = world.run(&arguments);
    (ran.code, ran.json())
}

/// A camera without distortion that looks straight ahead, 50 mm from the last.
fn straight(view: usize) -> Camera {
    Camera {
        focal: [640.0; 2],
        centre: [255.5, 239.5],
        lens: rig::Lens::Polynomial([0.0; 8]),
        turn: glam::DMat3::IDENTITY,
        place: DVec3::X * 0.05 * view as f64,
    }
}

#[test]
fn a_tilted_rig_that_distorts_gives_depths_within_half_a_percent() {
    let world = World::new();
    let (cameras, folder, set) = distorted(&world);
    let (code, raw) = check(&world, &folder, &[]);
    assert_eq!(code, Some(1), "{raw}");
    let (code, mended) = check(&world, &folder, &[&set]);
    assert_eq!(
        (code, &mended["verdict"]),
        (Some(0), &Value::from("works")),
        "{mended}"
    );
    for pair in mended["pairs"].as_array().unwrap() {
        assert!(pair["p95_px"].as_f64().unwrap() < 0.1, "{mended}");
        assert!(pair["points"].as_u64().unwrap() > 200, "{mended}");
    }
    let source = folder.to_string_lossy();
    let run = [
        "run", "--source", &source, "--set", &set, "--scans", "1", "--record", "x.mcap",
    ];
    world.run(&run).done();
    world
        .run(&["export", "x.mcap", "--csv", "points.csv"])
        .done();
    let recording = Recording::open(&world.path("x.mcap")).unwrap();
    let camera = recording.metadata().rig.calibration.unwrap();
    assert!(camera.calibrated);
    let axes = axes(&cameras).transpose();
    let depth_at = |x: f64, y: f64| {
        let ray = DVec3::new(
            (x - camera.cx) / camera.focal_px,
            (y - camera.cy) / camera.focal_px,
            1.0,
        );
        seen(cameras[0].place, axes * ray).unwrap().0
    };
    let text = fs::read_to_string(world.path("points.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let (x, y, depth) = (column("x"), column("y"), column("depth"));
    let mut errors = Vec::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |at: usize| cells[at].parse::<f64>().unwrap();
        // An outline may lie a pixel off the board it belongs to.
        let around = [-1.0, 0.0, 1.0]
            .into_iter()
            .flat_map(|dy| [-1.0, 0.0, 1.0].map(|dx| (dx, dy)));
        let off = around.map(|(dx, dy)| {
            let truth = depth_at(number(x) + dx, number(y) + dy);
            number(depth) / truth - 1.0
        });
        errors.push(off.min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap());
    }
    assert!(errors.len() > 5_000, "{} points", errors.len());
    errors.sort_by(f64::total_cmp);
    let bias = errors[errors.len() / 2];
    let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let part = |part: usize| sizes[sizes.len() * part / 100];
    let figures = format!(
        "{} points, bias {bias:.5}, median {:.5}, p90 {:.5}, p95 {:.5}; rows raw {}, rectified {}",
        sizes.len(),
        part(50),
        part(90),
        part(95),
        raw["pairs"],
        mended["pairs"]
    );
    assert!(
        bias.abs() < 0.001 && part(50) < 0.001 && part(95) < 0.005,
        "{figures}"
    );
}

#[test]
fn frames_of_live_cameras_are_rectified_as_files_are_and_kept_raw_when_asked_for() {
    let world = World::new();
    let (_, folder, set) = distorted(&world);
    let set = ["--set", &set, "--set", "capture.raw=true"];
    let source = folder.to_string_lossy();
    let files = [
        "run",
        "--source",
        &source,
        "--scans",
        "1",
        "--record",
        "files.mcap",
    ];
    world.run(&[&files[..], &set].concat()).done();
    let live = [
        "run",
        "--source",
        "camera:bus",
        "--scans",
        "2",
        "--record",
        "live.mcap",
    ];
    let size = ["--set", "capture.width=512", "--set", "capture.height=480"];
    let run = world.start(&[&live[..], &size, &set].concat());
    let waiting = world.waiting_run();
    let mut views =
        ["left", "centre", "right"].map(|name| FramesOut::join(&waiting, name).unwrap());
    let pictures = [0, 1, 2].map(|view| {
        let path = folder.join(format!("view{view}.png"));
        image::open(path).unwrap().into_luma8().into_raw()
    });
    for frame in 1u64.. {
        for (view, picture) in views.iter_mut().zip(&pictures) {
            let sent = view.send(frame * 33_000_000, |pixels| pixels.copy_from_slice(picture));
            sent.unwrap();
        }
        std::thread::sleep(std::time::Duration::from_millis(33));
        if !waiting.exists() {
            break;
        }
    }
    Ran::new(run.wait_with_output().unwrap()).done();
    let images = |file: &str| {
        let mut recording = Recording::open(&world.path(file)).unwrap();
        let rig = recording.metadata().rig.clone();
        let topics = Topic::of(&rig, Kind::Image);
        let read = |topic| {
            recording
                .read::<Image>(0, topic)
                .unwrap()
                .view()
                .pixels
                .to_vec()
        };
        let images: Vec<Vec<u8>> = topics.iter().map(read).collect();
        let taken: Vec<Vec<u8>> = Topic::of(&rig, Kind::Raw)
            .iter()
            .map(|topic| {
                let raw = recording.read::<Raw>(0, topic).unwrap();
                raw.view().pixels.to_vec()
            })
            .collect();
        assert!(taken == pictures, "as the cameras took them");
        (images, rig.calibration)
    };
    let (live, files) = (images("live.mcap"), images("files.mcap"));
    assert_eq!(live.1, files.1);
    assert!(live.0 == files.0, "the same to the byte");
    assert!(live.0[0] != pictures[0], "and not as the cameras took them");
    // What is rectified was recorded, and is played; the raw images beside it are only looked at.
    for file in ["files.mcap", "live.mcap"] {
        world.run(&["replay", file, "--verify"]).done();
    }
}

#[test]
fn what_was_turned_and_moved_on_purpose_is_measured() {
    let world = World::new();
    let mut cameras = [straight(0), straight(1), straight(2)];
    // The left one sees all half a pixel lower; the right one is turned by a fifth of a degree.
    cameras[0].centre[1] += 0.5;
    cameras[2].turn = glam::DMat3::from_rotation_z(0.2f64.to_radians());
    let (code, report) = check(&world, &scene(&world, "scene", &cameras), &[]);
    assert_eq!(
        (code, &report["verdict"]),
        (Some(0), &Value::from("covers-less")),
        "{report}"
    );
    let figure = |pair: usize, key: &str| report["pairs"][pair][key].as_f64().unwrap();
    assert!((figure(0, "offset_px") + 0.5).abs() < 0.02, "{report}");
    assert!(figure(0, "turn_degrees").abs() < 0.01, "{report}");
    assert!((figure(1, "turn_degrees") - 0.2).abs() < 0.01, "{report}");
    // A turned camera sees points by their disparity, here of 21 pixels, further to the left, and so further up.
    assert!(
        (figure(1, "offset_px") + 21.0 * 0.2f64.to_radians()).abs() < 0.02,
        "{report}"
    );
    assert!(
        (report["steps"][0]["ratio"].as_f64().unwrap() - 1.0).abs() < 0.005,
        "{report}"
    );
}

#[test]
fn parallel_views_are_told_to_work_and_unequal_steps_are_not() {
    let world = World::new();
    let mut cameras = [straight(0), straight(1), straight(2)];
    let (code, report) = check(&world, &scene(&world, "equal", &cameras), &[]);
    assert_eq!(
        (code, &report["verdict"]),
        (Some(0), &Value::from("works")),
        "{report}"
    );
    cameras[2].place.x = 0.106;
    let (code, report) = check(&world, &scene(&world, "unequal", &cameras), &[]);
    assert_eq!(
        (code, &report["verdict"]),
        (Some(1), &Value::from("rectify-first")),
        "{report}"
    );
    let ratio = report["steps"][0]["ratio"].as_f64().unwrap();
    assert!((ratio - 50.0 / 56.0).abs() < 0.005, "{report}");
    let rail = ["check-geometry", "scene:tab", "--set", "capture.mode=rail"];
    for arguments in [&rail[..2], &rail] {
        let rendered = world.run(arguments).done();
        assert!(
            rendered
                .out
                .contains("matching will work: rows are aligned within"),
            "{rendered:?}"
        );
    }
}

/// A folder of these pictures.
fn pictures(world: &World, name: &str, pictures: &[&GrayImage]) -> PathBuf {
    let folder = world.path(name);
    fs::create_dir_all(&folder).unwrap();
    for (view, picture) in pictures.iter().enumerate() {
        picture
            .save(folder.join(format!("view{view}.png")))
            .unwrap();
    }
    folder
}

/// A run of one scan that records nothing.
fn run_once(world: &World, folder: &Path, more: &[&str]) -> Ran {
    let source = folder.to_string_lossy();
    let run = ["run", "--source", &source, "--scans", "1", "--no-record"];
    world.run(&[&run[..], more].concat())
}

/// What a run says of how its views stand.
const OF_VIEWS: [&str; 7] = [
    "rows of",
    "one gray level",
    "one and the same image",
    "something else than",
    "nothing in common",
    "nothing moves",
    "from left to right they are",
];

#[test]
fn what_cannot_be_stereo_is_told_by_a_verdict_of_its_own_and_by_a_run() {
    let world = World::new();
    let [left, centre, right] = [0, 1, 2].map(|view| picture(&straight(view)));
    let gray = GrayImage::from_pixel(512, 480, image::Luma([90]));
    // Another place: the same boards seen from behind a mirror and upside down.
    let mut other = centre.clone();
    image::imageops::flip_vertical_in_place(&mut other);
    let mut again = left.clone();
    again.pixels_mut().step_by(7).for_each(|gray| gray[0] ^= 1);
    for (name, views, verdict, says, is_refused) in [
        (
            "reversed",
            [&right, &centre, &left],
            "reversed",
            "they are view2.png, view1.png, view0.png",
            true,
        ),
        (
            "swapped",
            [&left, &right, &centre],
            "out-of-order",
            "they are view0.png, view2.png, view1.png",
            true,
        ),
        (
            "identical",
            [&centre, &centre, &centre],
            "identical",
            "view0.png, view1.png, view2.png are one and the same",
            true,
        ),
        (
            "twice",
            [&left, &centre, &centre],
            "identical",
            "view1.png, view2.png are one and the same",
            true,
        ),
        (
            "gray",
            [&left, &gray, &right],
            "constant",
            "view1.png is of one gray level",
            true,
        ),
        (
            "odd",
            [&left, &centre, &other],
            "odd-view",
            "view2.png shows something else",
            false,
        ),
        (
            "still",
            [&left, &again, &right],
            "no-step",
            "nothing moves between view0.png and view1.png",
            false,
        ),
    ] {
        let folder = pictures(&world, name, &views);
        let (code, report) = check(&world, &folder, &[]);
        assert_eq!(
            (code, &report["verdict"]),
            (Some(1), &Value::from(verdict)),
            "{report}"
        );
        assert!(report["says"].as_str().unwrap().contains(says), "{report}");
        let ran = run_once(&world, &folder, &[]);
        assert_eq!(ran.code == Some(1), is_refused, "{name}: {ran:?}");
        assert!(ran.err.contains(says), "{name}: {ran:?}");
        if is_refused {
            assert!(
                ran.err.contains("--force-unrectified runs nevertheless"),
                "{ran:?}"
            );
        }
    }
    let folder = pictures(&world, "right", &[&left, &centre, &right]);
    let ran = run_once(&world, &folder, &[]).done();
    assert!(
        !OF_VIEWS.iter().any(|said| ran.err.contains(said)),
        "{ran:?}"
    );
}

#[test]
fn a_run_refuses_rows_that_are_off_and_goes_on_with_what_check_geometry_writes() {
    let world = World::new();
    let views = || [straight(0), straight(1), straight(2)];
    let mut cameras = views();
    cameras[1].centre[1] += 2.0;
    cameras[2].turn = glam::DMat3::from_rotation_z(0.4f64.to_radians());
    let folder = scene(&world, "off", &cameras);
    let source = folder.to_string_lossy();
    let ran = run_once(&world, &folder, &[]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    for said in [
        "rows of view1.png and view2.png are off by",
        "-o residual.yaml, and then --set capture.calibration=residual.yaml",
        "--force-unrectified runs nevertheless",
    ] {
        assert!(ran.err.contains(said), "{said}: {ran:?}");
    }
    let forced = run_once(&world, &folder, &["--force-unrectified"]).done();
    assert!(
        forced.err.contains("capture: warning: rows of"),
        "{forced:?}"
    );
    let written = world.run(&["check-geometry", &source, "-o", "residual.yaml"]);
    assert_eq!(written.code, Some(1), "{written:?}");
    let set = ["--set", "capture.calibration=residual.yaml"];
    let mended = run_once(&world, &folder, &set).done();
    assert!(
        !OF_VIEWS.iter().any(|said| mended.err.contains(said)),
        "{mended:?}"
    );
    // Nobody said how far apart the views were taken: what aligns them does not either.
    assert!(
        mended.err.contains("depths are in arbitrary units"),
        "{mended:?}"
    );
    let known = [
        "--set",
        "capture.focal=700",
        "--set",
        "capture.baseline=0.2",
    ];
    let check = ["check-geometry", &source, "-o", "scale.yaml"];
    world.run(&[&check[..], &known].concat());
    let to_scale = run_once(
        &world,
        &folder,
        &["--set", "capture.calibration=scale.yaml"],
    )
    .done();
    assert!(!to_scale.err.contains("arbitrary"), "{to_scale:?}");
    // Half a row is said, and matched.
    let mut cameras = views();
    cameras[1].centre[1] += 0.5;
    let ran = run_once(&world, &scene(&world, "half", &cameras), &[]).done();
    assert!(
        ran.err.contains("capture: warning: rows of") && ran.err.contains("off by 0.5 px"),
        "{ran:?}"
    );
}

#[test]
fn one_scan_of_many_that_is_no_stereo_is_told_by_its_name_and_runs() {
    let world = World::new();
    let views = [0, 1, 2].map(|view| picture(&straight(view)));
    let [left, centre, right] = views.each_ref();
    for (scan, views) in [
        [left, centre, right],
        [left, centre, right],
        [left, left, left],
    ]
    .iter()
    .enumerate()
    {
        pictures(&world, &format!("many/scan{scan}"), views);
    }
    let source = world.path("many");
    let source = source.to_string_lossy();
    let ran = world
        .run(&["run", "--source", &source, "--no-record"])
        .done();
    let said = "capture: warning: scan2: view0.png, view1.png, view2.png are one and the same";
    assert!(ran.err.contains(said), "{ran:?}");
}

#[test]
fn frames_of_a_rail_that_lie_shifted_are_told() {
    let world = World::new();
    let mut cameras = [0, 1, 2, 3, 4].map(straight);
    // A thousandth of a radian is 0.64 px everywhere.
    cameras[3].turn = glam::DMat3::from_rotation_y(0.002);
    let folder = scene(&world, "shaken", &cameras);
    let rail = ["capture.mode=rail", "capture.stride=1", "capture.drift=0"];
    let as_they_are = [&rail[..], &["capture.sway=false"]].concat();
    let (code, report) = check(&world, &folder, &as_they_are);
    assert_eq!(code, Some(1), "{report}");
    let around = |frame: &str| {
        let steps = report["steps"].as_array().unwrap();
        let inner = steps.iter().find(|inner| inner["around"] == frame);
        inner.unwrap()["shift_px"].as_f64().unwrap().abs()
    };
    assert!(
        around("1") < 0.1 && (around("3") - 2.56).abs() < 0.3,
        "{report}"
    );
    // By itself it is found out and made good.
    let (code, report) = check(&world, &folder, &rail);
    assert_eq!(code, Some(0), "{report}");
}

#[test]
fn what_is_left_to_correct_on_a_rig_is_written_as_a_calibration_and_then_nothing_is_left() {
    let world = World::new();
    let mut cameras = [straight(0), straight(1), straight(2)];
    cameras[0].centre[1] += 0.5;
    cameras[1].centre[0] -= 0.3;
    cameras[2].turn = glam::DMat3::from_rotation_z(0.1f64.to_radians());
    let folder = scene(&world, "scene", &cameras);
    let source = folder.to_string_lossy();
    let file = world.path("left.yaml");
    let output = file.to_string_lossy();
    let write = ["check-geometry", &source, "--json", "-o", &output];
    let report = world.run(&write).done().json();
    let left =
        |report: &Value, view: usize, key: &str| report["residual"][view][key].as_f64().unwrap();
    let turned = left(&report, 2, "turn_degrees") - left(&report, 1, "turn_degrees");
    assert!((turned - 0.1).abs() < 0.01, "{report}");
    let lower = left(&report, 0, "down_px") - left(&report, 1, "down_px");
    assert!((lower - 0.5).abs() < 0.03, "{report}");
    // What is there is not lost by mistake.
    let text = fs::read_to_string(&file).unwrap();
    let ran = world.run(&write);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("exists; give another name, or --force"),
        "{ran:?}"
    );
    let forced = [&write[..], &["--force"]].concat();
    world.run(&forced).done();
    assert_eq!(fs::read_to_string(&file).unwrap(), text);
    let set = format!("capture.calibration={output}");
    let (code, report) = check(&world, &folder, &[&set]);
    assert_eq!(
        (code, &report["verdict"]),
        (Some(0), &Value::from("works")),
        "{report}"
    );
    for view in 0..3 {
        for key in ["right_px", "down_px", "turn_degrees"] {
            assert!(left(&report, view, key).abs() < 0.03, "{key}: {report}");
        }
    }
    let refused = [&write[..], &["--force", "--set", &set]].concat();
    for (set, said) in [
        (refused, "leave capture.calibration away"),
        (
            [&write[..], &["--force", "--set", "capture.mode=rail"]].concat(),
            "--output is of a rig",
        ),
    ] {
        let ran = world.run(&set);
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(
            ran.err.contains(said) && ran.err.lines().count() == 1,
            "{ran:?}"
        );
    }
}

/// Pictures of a board that was held before the cameras: a folder a camera.
fn board_pictures(world: &World, cameras: &[Camera], count: usize) -> PathBuf {
    let folder = world.path("board");
    std::thread::scope(|scope| {
        for (camera, name) in cameras.iter().zip(["left", "centre", "right"]) {
            let folder = folder.join(name);
            scope.spawn(move || {
                fs::create_dir_all(&folder).unwrap();
                let eye = Eye::new(*camera);
                for (number, board) in held([9, 6], 0.03, count).iter().enumerate() {
                    let picture = eye.picture(|place, ray| board.level(place, ray));
                    picture
                        .save(folder.join(format!("{number:02}.png")))
                        .unwrap();
                }
            });
        }
    });
    folder
}

#[test]
fn cameras_that_were_calibrated_by_a_board_are_rectified_to_rows_that_match() {
    let world = World::new();
    let cameras = rig([RADTAN; 3]);
    let folder = board_pictures(&world, &cameras, 16);
    let board = folder.to_string_lossy();
    let calibrate = ["calibrate", &board, "--board", "9x6", "--square", "0.03"];
    let ran = world.run(&[&calibrate[..], &["--picture", "board.svg"]].concat());
    let ran = ran.done();
    for said in [
        "left",
        "centre, right",
        "steps of ",
        "camchain.yaml: tricurve run",
    ] {
        assert!(ran.out.contains(said), "{said}: {}", ran.out);
    }
    assert!(
        ran.err
            .contains("3 cameras, a folder a camera (left, centre, right), 48 images at 16 times")
    );
    let svg = fs::read_to_string(world.path("board.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    assert_eq!(svg.matches("<clipPath").count(), 3);
    // What is there is not replaced unasked.
    let again = world.run(&calibrate);
    assert_eq!(again.code, Some(2));
    assert!(
        again
            .err
            .contains("camchain.yaml exists; give another name, or --force")
    );
    // The rig is the same that looks at the scene.
    let scene = scene(&world, "scene", &cameras);
    let (code, mended) = check(&world, &scene, &["capture.calibration=camchain.yaml"]);
    assert_eq!(
        (code, &mended["verdict"]),
        (Some(0), &Value::from("works")),
        "{mended}"
    );
    for pair in mended["pairs"].as_array().unwrap() {
        assert!(pair["p95_px"].as_f64().unwrap() < 0.15, "{mended}");
    }
}

#[test]
fn what_no_board_can_be_found_in_is_refused_in_a_sentence() {
    let world = World::new();
    let camera = straight(0);
    let folder = world.path("walls");
    fs::create_dir_all(&folder).unwrap();
    for number in 0..3 {
        picture(&camera)
            .save(folder.join(format!("{number}.png")))
            .unwrap();
    }
    let empty = world.path("empty");
    fs::create_dir_all(&empty).unwrap();
    let calibrate = |folder: &Path, more: &[&str]| {
        let folder = folder.to_string_lossy();
        world.run(&[&["calibrate", &folder, "--square", "0.03"][..], more].concat())
    };
    let cases = [
        (
            calibrate(&folder, &["--board", "9x6"]),
            1,
            "is to be used in 0 of 3 images of camera (in ",
        ),
        (
            calibrate(&folder, &["--board", "9"]),
            2,
            "expected are two counts, as 9x6",
        ),
        (
            calibrate(&folder, &["--board", "2x2"]),
            2,
            "expected are 3 to 100 each way",
        ),
        (
            calibrate(&folder, &["--board", "9x6", "--marker", "0.02"]),
            2,
            "--dictionary",
        ),
        (calibrate(&empty, &["--board", "9x6"]), 1, "holds no images"),
        (
            calibrate(&world.path("nowhere"), &["--board", "9x6"]),
            2,
            "there is no folder",
        ),
    ];
    for (ran, code, says) in cases {
        assert_eq!(ran.code, Some(code), "{says}: {ran:?}");
        assert!(ran.err.contains(says), "{says}: {}", ran.err);
    }
    // Nothing that was not found out is written.
    assert!(!world.path("camchain.yaml").exists());
}
