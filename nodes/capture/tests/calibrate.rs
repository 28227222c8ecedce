//! Cameras that are known, from pictures of a board that they took.
#![cfg(feature = "calibrate")]
#![expect(clippy::unwrap_used, reason = "tests")]

mod rig;

use capture::Layout;
use capture::calibrate::{Board, Calibrated, Model, Observed, Shot, Shots, calibrate};
use glam::{DMat3, DVec3};
use rig::{Camera, Eye, FISHEYE, Held, Lens, RADTAN, SIZE, held, rig};

const CORNERS: [u32; 2] = [9, 6];
const SQUARE: f64 = 0.03;

/// Pictures by shot, then camera.
type Pictures = Vec<Vec<Vec<u8>>>;

/// What the cameras see of boards.
fn pictures(cameras: &[Camera], boards: &[Held]) -> Pictures {
    let eyes: Vec<Eye> = cameras.iter().map(|camera| Eye::new(*camera)).collect();
    let shot = |board: &Held| {
        let each = eyes.iter();
        each.map(|eye| eye.picture(|place, ray| board.level(place, ray)).into_raw())
            .collect()
    };
    std::thread::scope(|scope| {
        let halves = boards.chunks(boards.len().div_ceil(2));
        let workers: Vec<_> = halves
            .map(|half| scope.spawn(move || half.iter().map(shot).collect::<Vec<_>>()))
            .collect();
        let joined = workers.into_iter();
        joined.flat_map(|worker| worker.join().unwrap()).collect()
    })
}

/// Names for pictures that are in no folder.
fn shots(pictures: &Pictures) -> Shots {
    let cameras = pictures[0].len();
    let shot = |number: usize| Shot {
        name: format!("{number:02}"),
        images: vec![Some(std::path::PathBuf::from("x").into()); cameras],
    };
    Shots {
        cameras: (0..cameras).map(|camera| format!("cam{camera}")).collect(),
        shots: (0..pictures.len()).map(shot).collect(),
        sizes: vec![SIZE; cameras],
        layout: Layout::Cameras,
        is_by_order: false,
        left_out: Vec::new(),
        ignored: 0,
    }
}

fn calibrated(board: &Board, model: Model, pictures: &Pictures) -> Result<Calibrated, String> {
    let shots = shots(pictures);
    let find = |picture: &Vec<u8>| Some(board.find(SIZE, picture));
    let found = pictures.iter();
    let found = found.map(|shot| shot.iter().map(find).collect()).collect();
    let observed = Observed {
        shots: &shots,
        found,
    };
    calibrate(board, model, &observed)
}

fn board() -> Board {
    Board::chessboard(CORNERS, SQUARE).unwrap()
}

/// Everything that was found is near what it is, by pixels and by its own standard deviations.
fn assert_found(calibrated: &Calibrated, cameras: &[Camera], most_px: f64) {
    assert_eq!(calibrated.cameras.len(), cameras.len());
    for (found, camera) in calibrated.cameras.iter().zip(cameras) {
        let lens = match camera.lens {
            Lens::Polynomial([k1, k2, p1, p2, ..]) => [k1, k2, p1, p2],
            Lens::Fisheye(lens) => lens,
        };
        let pixels = found.focal.iter().chain(&found.centre);
        let pixels = pixels.zip(camera.focal.iter().chain(&camera.centre));
        for (sure, truth) in pixels.clone() {
            let off = (sure.value - truth).abs();
            assert!(off < most_px, "{}: {sure:?}, not {truth}", found.name);
        }
        for (sure, truth) in pixels.chain(found.lens.iter().zip(&lens)) {
            let off = (sure.value - truth).abs();
            assert!(sure.std > 0.0, "{}: {sure:?}", found.name);
            assert!(
                off < 8.0 * sure.std,
                "{}: {sure:?}, not {truth}",
                found.name
            );
        }
        assert!(found.rms_px < 0.1, "{}: {}", found.name, found.rms_px);
    }
    for (beside, pair) in calibrated.beside.iter().zip(cameras.windows(2)) {
        let apart = (pair[1].place - pair[0].place).length();
        assert!((beside.apart_m / apart - 1.0).abs() < 2e-3, "{beside:?}");
        let axes = [0, 1].map(|i| pair[i].turn.transpose() * DVec3::Z);
        let turned = axes[0].angle_between(axes[1]).to_degrees();
        assert!(
            (beside.turned_degrees - turned).abs() < 0.1,
            "{beside:?}, not {turned}"
        );
        let [median, p95] = beside.rows_px.unwrap();
        assert!(median < 0.08 && p95 < 0.25, "{beside:?}");
    }
}

#[test]
fn a_tilted_rig_is_found_as_it_is() {
    let cameras = rig([RADTAN; 3]);
    let pictures = pictures(&cameras, &held(CORNERS, SQUARE, 20));
    let calibrated = calibrated(&board(), Model::Radtan, &pictures).unwrap();
    assert_found(&calibrated, &cameras, 0.6);
    // Boards that are partly outside of a picture cannot be numbered, and are named.
    let outside = calibrated.left_out.iter();
    assert!(
        outside
            .clone()
            .all(|out| out.why.contains("and the board has 9x6"))
    );
    assert!(outside.count() < 10, "{:?}", calibrated.left_out);
    let notice = &calibrated.notices[0];
    assert!(notice.contains("steps of 60.0") || notice.contains("steps of 59.9"));
}

#[test]
fn fisheyes_are_found_as_they_are() {
    // 95° from side to side.
    let mut cameras = rig([FISHEYE; 3]);
    cameras
        .iter_mut()
        .for_each(|camera| camera.focal = camera.focal.map(|f| f * 0.5));
    let near = held(CORNERS, SQUARE, 24).into_iter().map(|mut board| {
        board.middle.z *= 0.5;
        board
    });
    let pictures = pictures(&cameras[..1], &near.collect::<Vec<_>>());
    let found = calibrated(&board(), Model::Equidistant, &pictures).unwrap();
    assert_found(&found, &cameras[..1], 0.6);
    let wrong = calibrated(&board(), Model::Radtan, &pictures);
    let worse = wrong.map_or(f64::INFINITY, |wrong| wrong.cameras[0].rms_px);
    assert!(worse > 1.2 * found.cameras[0].rms_px, "{worse}");
}

#[test]
fn corners_are_where_the_board_has_them() {
    let camera = rig([RADTAN; 3])[0];
    let boards = held(CORNERS, SQUARE, 12);
    let mut far = Vec::new();
    for (board, pictures) in boards.iter().zip(pictures(&[camera], &boards)) {
        let Ok(sighting) = self::board().find(SIZE, &pictures[0]) else {
            continue;
        };
        for ([u, v], at) in sighting.corners() {
            let half = CORNERS.map(|count| (f64::from(count) - 1.0) / 2.0);
            let on = |u: f64, v: f64| {
                let on = DVec3::new(u - half[0], v - half[1], 0.0) * SQUARE;
                camera.sees(board.turn * on + board.middle)
            };
            let (u, v) = (f64::from(u), f64::from(v));
            // The board looks the same upside down.
            let ends = [on(u, v), on(2.0 * half[0] - u, 2.0 * half[1] - v)];
            let off = ends.map(|end| (end - glam::DVec2::from(at)).length());
            far.push(off[0].min(off[1]));
        }
    }
    far.sort_by(f64::total_cmp);
    assert!(far.len() > 400, "{}", far.len());
    let (median, p95) = (far[far.len() / 2], far[far.len() * 95 / 100]);
    assert!(median < 0.06 && p95 < 0.15, "{median} {p95}");
}

#[test]
fn boards_that_look_the_same_from_two_or_four_sides_are_one_to_all_cameras() {
    let cameras = rig([RADTAN; 3]);
    for corners in [[8, 6], [7, 7]] {
        // Held so that what is the upper left corner differs from camera to camera.
        let boards = held(corners, SQUARE, 14)
            .into_iter()
            .map(|mut board| {
                board.turn *= DMat3::from_rotation_z(46f64.to_radians());
                board.middle *= DVec3::new(1.0, 0.6, 1.0);
                board
            })
            .collect::<Vec<_>>();
        let board = Board::chessboard(corners, SQUARE).unwrap();
        let found = calibrated(&board, Model::Radtan, &pictures(&cameras, &boards)).unwrap();
        assert_found(&found, &cameras, 1.0);
        let used: Vec<usize> = found.cameras.iter().map(|c| c.used[0]).collect();
        assert!(used.iter().all(|&used| used >= 8), "{used:?}");
        let strange = found.left_out.iter().find(|out| out.why.contains("miss"));
        assert_eq!(strange, None);
    }
}

#[test]
fn a_picture_that_was_taken_at_another_time_is_left_out_and_named() {
    let cameras = rig([RADTAN; 3]);
    let mut pictures = pictures(&cameras, &held(CORNERS, SQUARE, 16));
    let other = pictures[5][2].clone();
    pictures[11][2] = other;
    let found = calibrated(&board(), Model::Radtan, &pictures).unwrap();
    assert_found(&found, &cameras, 0.8);
    let named: Vec<(&str, &str)> = found
        .left_out
        .iter()
        .filter(|out| out.why.contains("was it taken at the same time"))
        .map(|out| (out.camera.as_str(), out.shot.as_str()))
        .collect();
    assert_eq!(named, [("cam2", "11")]);
}

#[test]
fn boards_that_are_never_tilted_do_not_tell_the_focal_length() {
    let camera = rig([RADTAN; 3])[0];
    let mut boards = held(CORNERS, SQUARE, 8);
    for board in &mut boards {
        board.turn = camera.turn.transpose();
        board.middle.z = 0.62;
    }
    let error = calibrated(&board(), Model::Radtan, &pictures(&[camera], &boards)).unwrap_err();
    assert!(error.contains("tilt the board by 30° and more"), "{error}");
}

#[test]
fn too_few_pictures_of_the_board_are_refused_with_the_reason() {
    let camera = rig([RADTAN; 3])[0];
    let pictures = pictures(&[camera], &held(CORNERS, SQUARE, 3));
    // Another board than the one in the pictures.
    let other = Board::chessboard([7, 6], SQUARE).unwrap();
    let error = calibrated(&other, Model::Radtan, &pictures).unwrap_err();
    assert!(
        error.contains("in 0 of 3 images of cam0 (in ") && error.contains("is --board right"),
        "{error}"
    );
}

#[test]
fn cameras_that_never_saw_the_board_together_are_named() {
    let cameras = rig([RADTAN; 3]);
    let boards = held(CORNERS, SQUARE, 10);
    let mut pictures = pictures(&cameras[..2], &boards);
    let gray = vec![90; pictures[0][0].len()];
    for (number, shot) in pictures.iter_mut().enumerate() {
        shot[number % 2] = gray.clone();
    }
    let error = calibrated(&board(), Model::Radtan, &pictures).unwrap_err();
    assert!(
        error.contains("cam1 never saw the board together with cam0"),
        "{error}"
    );
}

#[test]
fn boards_that_cannot_be_are_refused() {
    let wrong = [
        (
            Board::chessboard([2, 6], 0.03),
            "a board of 2x6 inner corners cannot be used; expected are 3 to 100 each way",
        ),
        (
            Board::chessboard([9, 6], 30.0),
            "a square of 30 m cannot be; give its side in metres",
        ),
        (
            Board::chessboard([9, 6], f64::NAN),
            "a square of NaN m cannot be",
        ),
        (
            Board::charuco([8, 6], 0.03, 0.03, "DICT_4X4_50"),
            "a marker of 0.03 m does not fit into a square of 0.03 m",
        ),
        (
            Board::charuco([8, 6], 0.03, 0.02, "DICT_9X9"),
            "there is no dictionary \"DICT_9X9\"; known are OpenCV's",
        ),
        (
            Board::charuco([20, 20], 0.03, 0.02, "DICT_4X4_50"),
            "board needs 200 markers, dictionary has 50",
        ),
    ];
    for (board, says) in wrong {
        let error = board.unwrap_err();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn the_same_pictures_give_the_same_file_to_the_byte() {
    let cameras = rig([RADTAN; 3]);
    let pictures = pictures(&cameras[..2], &held(CORNERS, SQUARE, 10));
    let once = calibrated(&board(), Model::Radtan, &pictures).unwrap();
    let again = calibrated(&board(), Model::Radtan, &pictures).unwrap();
    assert_eq!(once.to_kalibr(&[]), again.to_kalibr(&[]));
    assert_eq!(once.to_svg(), again.to_svg());
}
