//! Where the search begins: each camera by itself from a guess of its focal length, then how they stand to each other.

use glam::{DVec2, DVec3};
use messages::Size;

use super::Model;
use super::board::{Board, Sighting};
use super::solve::{Estimate, INTRINSIC, Pose, Seen, Task, board_from, camera};

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

/// The part of the sightings that any focal length explains which the best must explain too.
const EXPLAINED: f64 = 0.8;

/// What one camera by itself saw.
pub(crate) struct Alone {
    pub(crate) numbers: [f64; INTRINSIC],
    /// Where the board was held in its frame, for each sighting; `None` for one that nothing explains.
    pub(crate) places: Vec<Option<Pose>>,
}

/// Works out one camera by itself; `None` where no focal length explains so many sightings.
pub(crate) fn alone(
    model: Model,
    size: Size,
    board: &Board,
    sightings: &[&Sighting],
    least: usize,
) -> Option<Alone> {
    let mut tried: Vec<(f64, Vec<bool>, Estimate)> = Vec::new();
    for focal in FOCALS {
        let (from, is_explained) =
            guess(model, size, focal * f64::from(size.width), board, sightings);
        if from.boards.len() < least {
            continue;
        }
        let seen = seen(board, sightings, &is_explained);
        let found = task(model, &size, &seen, 1).solve(task(model, &size, &seen, 0).solve(from));
        let cost = task(model, &size, &seen, 1).cost(&found) / seen.len() as f64;
        if cost.is_finite() {
            tried.push((cost, is_explained, found));
        }
    }
    let count = |explained: &[bool]| explained.iter().filter(|&&is| is).count() as f64;
    let most = tried
        .iter()
        .map(|(_, explained, _)| count(explained))
        .fold(0.0, f64::max);
    tried.retain(|(_, explained, _)| count(explained) >= EXPLAINED * most);
    let (_, is_explained, best) = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let seen = seen(board, sightings, &is_explained);
    let best = task(model, &size, &seen, 3).solve(task(model, &size, &seen, 2).solve(best));
    let mut places = best.boards.into_iter();
    let places = is_explained
        .iter()
        .map(|&is| if is { places.next() } else { None });
    Some(Alone {
        numbers: best.intrinsics[0],
        places: places.collect(),
    })
}

fn task<'a>(model: Model, size: &'a Size, seen: &'a [Seen], round: usize) -> Task<'a> {
    Task {
        model,
        sizes: std::slice::from_ref(size),
        seen,
        free: ROUNDS[round],
    }
}

/// The corners of the sightings that count.
fn seen(board: &Board, sightings: &[&Sighting], counts: &[bool]) -> Vec<Seen> {
    let counting = sightings.iter().zip(counts).filter(|(_, counts)| **counts);
    let each = counting.enumerate().flat_map(|(shot, (sighting, _))| {
        sighting.corners.iter().map(move |(&corner, &at)| Seen {
            camera: 0,
            shot,
            point: board.place(corner),
            at,
        })
    });
    each.collect()
}

/// A camera of this focal length without a lens's faults, its axis through the middle of the image; where the board was in
/// those sightings that it explains, and which these are.
fn guess(
    model: Model,
    size: Size,
    focal: f64,
    board: &Board,
    sightings: &[&Sighting],
) -> (Estimate, Vec<bool>) {
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
    let numbers = [focal, focal, middle.x, middle.y, 0.0, 0.0, 0.0, 0.0];
    let camera = camera(model, size, &numbers);
    let place = |sighting: &&Sighting| {
        let points = sighting.corners.iter();
        let points: Vec<(DVec3, DVec2)> = points
            .filter_map(|(&corner, &at)| Some((board.place(corner), direction(at)?)))
            .collect();
        let place = board_from(&points)?;
        let mut corners = sighting.corners.keys();
        let is_seen = corners.all(|&corner| camera.place(place.of(board.place(corner))).is_some());
        is_seen.then_some(place)
    };
    let boards: Vec<Option<Pose>> = sightings.iter().map(place).collect();
    let is_explained = boards.iter().map(Option::is_some).collect();
    let estimate = Estimate {
        intrinsics: vec![numbers],
        mounts: vec![Pose::NONE],
        boards: boards.into_iter().flatten().collect(),
    };
    (estimate, is_explained)
}

/// Where cameras stand in the frame of the first: along the strongest of what they saw together.
///
/// # Errors
/// The cameras that saw the board together with none of those before them, and the first not with those.
pub(crate) fn mounts(places: &[Vec<Option<Pose>>]) -> Result<Vec<Pose>, Vec<usize>> {
    let mut mounts = vec![None; places.len()];
    mounts[0] = Some(Pose::NONE);
    while mounts.iter().any(Option::is_none) {
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
            let missing = (0..mounts.len()).filter(|&camera| mounts[camera].is_none());
            return Err(missing.collect());
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
