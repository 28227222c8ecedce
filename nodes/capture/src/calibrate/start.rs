//! Where the search begins: each camera by itself from a guess of its focal length, then how they stand to each other.

use glam::{DVec2, DVec3};
use messages::Size;

use super::Model;
use super::board::{Board, Sighting};
use super::solve::{Estimate, INTRINSIC, Pose, Seen, Task, board_from};

/// Focal lengths that are tried first, in widths of the image: from 120° to 15° of view.
const FOCALS: [f64; 7] = [0.3, 0.45, 0.65, 0.95, 1.4, 2.2, 3.6];
/// Which numbers may change, one round after the other: what is least sure comes last.
const ROUNDS: [[bool; INTRINSIC]; 4] = {
    const Y: bool = true;
    const N: bool = false;
    [
        [Y, Y, N, N, N, N, N, N],
        [Y, Y, N, N, Y, N, N, N],
        [Y, Y, Y, Y, Y, Y, N, N],
        [Y; INTRINSIC],
    ]
};

/// One camera by itself: its numbers, and where the board was held in its frame, for each sighting.
///
/// `None` where no focal length explains what was seen.
pub(crate) fn alone(
    model: Model,
    size: Size,
    board: &Board,
    sightings: &[&Sighting],
) -> Option<([f64; INTRINSIC], Vec<Pose>)> {
    let seen: Vec<Seen> = sightings
        .iter()
        .enumerate()
        .flat_map(|(shot, sighting)| {
            sighting.corners.iter().map(move |(&corner, &at)| Seen {
                camera: 0,
                shot,
                point: board.place(corner),
                at,
            })
        })
        .collect();
    let task = |round: usize| Task {
        model,
        sizes: std::slice::from_ref(&size),
        seen: &seen,
        free: ROUNDS[round],
    };
    let tried = FOCALS.iter().filter_map(|&focal| {
        let from = guess(model, size, focal * f64::from(size.width), board, sightings)?;
        let found = task(1).solve(task(0).solve(from));
        let cost = task(1).cost(&found);
        cost.is_finite().then_some((cost, found))
    });
    let (_, best) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let best = task(3).solve(task(2).solve(best));
    Some((best.intrinsics[0], best.boards))
}

/// A camera of this focal length without a lens's faults, its axis through the middle of the image.
fn guess(
    model: Model,
    size: Size,
    focal: f64,
    board: &Board,
    sightings: &[&Sighting],
) -> Option<Estimate> {
    let middle = DVec2::new(f64::from(size.width), f64::from(size.height)) / 2.0 - 0.5;
    let direction = |at: DVec2| {
        let off = (at - middle) / focal;
        match model {
            Model::Radtan => Some(off),
            // Seen at its angle from the axis, and a plane shows less than 90° of that.
            Model::Equidistant => {
                let angle = off.length();
                let tangent = (angle < 1.4).then(|| angle.tan())?;
                Some(off * (tangent / angle.max(1e-9)))
            }
        }
    };
    let place = |sighting: &&Sighting| {
        let points = sighting.corners.iter();
        let points: Vec<(DVec3, DVec2)> = points
            .filter_map(|(&corner, &at)| Some((board.place(corner), direction(at)?)))
            .collect();
        board_from(&points)
    };
    let boards: Option<Vec<Pose>> = sightings.iter().map(place).collect();
    Some(Estimate {
        intrinsics: vec![[focal, focal, middle.x, middle.y, 0.0, 0.0, 0.0, 0.0]],
        mounts: vec![Pose::NONE],
        boards: boards?,
    })
}

/// Where cameras stand in the frame of the first: along the strongest of what they saw together.
///
/// # Errors
/// The camera that saw the board together with no other.
pub(crate) fn mounts(places: &[Vec<Option<Pose>>]) -> Result<Vec<Pose>, usize> {
    let mut mounts = vec![None; places.len()];
    mounts[0] = Some(Pose::NONE);
    while let Some(missing) = mounts.iter().position(Option::is_none) {
        let together = |a: usize, b: usize| -> Vec<Pose> {
            let both = places[a].iter().zip(&places[b]);
            both.filter_map(|(a, b)| Some(b.as_ref()?.after(a.as_ref()?.inverse())))
                .collect()
        };
        let known = (0..places.len()).filter(|&camera| mounts[camera].is_some());
        let pairs = known.flat_map(|a| (0..places.len()).map(move |b| (a, b)));
        let steps = pairs
            .filter(|&(_, b)| mounts[b].is_none())
            .map(|(a, b)| (a, b, together(a, b)));
        let strongest = steps.max_by_key(|(a, b, steps)| (steps.len(), usize::MAX - a - b));
        let Some((a, b, steps)) = strongest.filter(|(_, _, steps)| !steps.is_empty()) else {
            return Err(missing);
        };
        mounts[b] = mounts[a].map(|mount| middle(&steps).after(mount));
    }
    Ok(mounts.into_iter().flatten().collect())
}

/// The pose that is nearest to all others: some may be wrong.
fn middle(poses: &[Pose]) -> Pose {
    let apart = |a: &Pose, b: &Pose| {
        let far = a.shift.length().max(b.shift.length()).max(1e-9);
        a.turn.angle_between(b.turn).min(0.5) + ((a.shift - b.shift).length() / far).min(0.5)
    };
    let sum = |pose: &Pose| poses.iter().map(|other| apart(pose, other)).sum::<f64>();
    let nearest = poses.iter().min_by(|a, b| sum(a).total_cmp(&sum(b)));
    nearest.copied().unwrap_or(Pose::NONE)
}
