//! Cameras that are known, from pictures of a board that they took.
#![cfg(feature = "calibrate")]
#![expect(clippy::unwrap_used, reason = "tests")]

mod rig;

use capture::calibrate::{Board, Calibrated, Model, Observed, Shots, Sighting, calibrate};
use rig::{Camera, Eye, FISHEYE, Held, RADTAN, SIZE, held, rig};

const CORNERS: [u32; 2] = [9, 6];
const SQUARE: f64 = 0.03;

/// What the cameras see of boards.
fn pictures(cameras: &[Camera], boards: &[Held]) -> Vec<Vec<Vec<u8>>> {
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
        workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap())
            .collect()
    })
}

/// Names for pictures that are in no folder.
fn shots(cameras: usize, count: usize) -> Shots {
    let shot = |number: usize| capture::calibrate::Shot {
        name: format!("{number:02}"),
        images: vec![Some("x".into()); cameras],
    };
    Shots {
        cameras: (0..cameras).map(|camera| format!("cam{camera}")).collect(),
        shots: (0..count).map(shot).collect(),
        sizes: vec![SIZE; cameras],
    }
}

fn found(board: &Board, pictures: &[Vec<Vec<u8>>]) -> Vec<Vec<Option<Result<Sighting, String>>>> {
    let shot = |shot: &Vec<Vec<u8>>| {
        let each = shot.iter();
        each.map(|picture| Some(board.find(SIZE, picture)))
            .collect()
    };
    pictures.iter().map(shot).collect()
}

fn calibrated(cameras: &[Camera], model: Model, boards: &[Held]) -> Calibrated {
    let board = Board::chessboard(CORNERS, SQUARE).unwrap();
    let pictures = pictures(cameras, boards);
    let shots = shots(cameras.len(), boards.len());
    let found = found(&board, &pictures);
    let observed = Observed {
        shots: &shots,
        found,
    };
    calibrate(&board, model, &observed).unwrap()
}

#[test]
fn a_tilted_rig_is_found_as_it_is() {
    let cameras = rig([RADTAN; 3]);
    let calibrated = calibrated(&cameras, Model::Radtan, &held(CORNERS, SQUARE, 24));
    for found in &calibrated.cameras {
        eprintln!(
            "{} {:?} {} {:?} {:?} {:?} rms {} p95 {}",
            found.name,
            found.used,
            found.corners,
            found.focal,
            found.centre,
            found.lens,
            found.rms_px,
            found.p95_px
        );
    }
    eprintln!(
        "{:?}\n{:?}\n{:?} {:?}",
        calibrated.beside, calibrated.left_out, calibrated.warnings, calibrated.notices
    );
    let _ = FISHEYE;
}
