//! By how many rows another view's picture lies lower, as far as the votes of a curve tell.

use super::{STEEPEST, Votes, Way, table_of};
use crate::thesis::course::{Course, Fit, Lanes, Vote};

impl Votes {
    /// Takes the votes of a curve for the curve that agrees best with one course, those in the middle of the lane counting
    /// most: how well they agree, and by how many rows more the other view's picture would have to lie lower for them to
    /// agree better.
    pub(crate) fn agreement(&mut self, label: u32, way: &Way<'_>) -> Lowered {
        let Way {
            from,
            steps,
            band,
            ballot,
            ..
        } = *way;
        let Some((table, entries)) = table_of(from, label) else {
            return Lowered::default();
        };
        self.cast(entries, way);
        self.cast
            .sort_unstable_by_key(|cast| (cast.curve, cast.entry));
        let middle = (table.y - from.lower, table.x);
        let mut best = Lowered::default();
        for votes in self.cast.chunk_by(|a, b| a.curve == b.curve) {
            self.own.clear();
            self.own.extend(votes.iter().map(|cast| cast.vote));
            if let Some(course) = self.fullest.lane(&self.own, band, middle, ballot.lanes) {
                let found = Lowered::of(&self.own, &course, ballot.lanes, steps);
                if found.agreement > best.agreement {
                    best = found;
                }
            }
        }
        best
    }
}

/// What a curve's votes say about the rows of another view's picture.
///
/// Where that lies δ rows lower than assumed, a contour is met δ·tan θ to the right of where it should be, θ being its
/// gradient's direction: by that its disparities are less, divided by the steps. What of it a plane takes up cannot be
/// told from a slant of the surface; the rest, regressed on tan θ, tells δ.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lowered {
    /// Votes, those in the middle of the lane counting most.
    pub(crate) agreement: f32,
    /// Sum of tan θ times what disparities are beyond, both beside their planes, …
    pub(crate) both: f32,
    /// … and of its square.
    pub(crate) squares: f32,
}

impl Lowered {
    fn of(votes: &[Vote], course: &Course, lanes: Lanes, steps: f32) -> Self {
        let (mut slants, mut offs) = (Fit::default(), Fit::default());
        let inside = |vote: &&Vote| lanes.hold(vote, course);
        let place = |vote: &Vote| (vote.row - course.row, vote.column - course.column);
        let slant = |vote: &Vote| vote.slant.clamp(-STEEPEST, STEEPEST);
        let mut found = Self::default();
        for vote in votes.iter().filter(inside) {
            let (y, x) = place(vote);
            let off = vote.beyond(course);
            slants.add(vote.weight, y, x, slant(vote));
            offs.add(vote.weight, y, x, off);
            let share = off / (lanes.width / 2.0);
            found.agreement += vote.weight * (1.0 - share * share);
        }
        // Planes that take up all they can, or nothing but the mean where lanes are level.
        let least = if lanes.slope > 0.0 {
            0.1
        } else {
            f32::INFINITY
        };
        let (Some(slants), Some(offs)) = (slants.plane(least), offs.plane(least)) else {
            return found;
        };
        let beside = |plane: (f32, f32, f32), (y, x)| plane.0 + plane.1 * y + plane.2 * x;
        for vote in votes.iter().filter(inside) {
            let slant = slant(vote) - beside(slants, place(vote));
            let off = vote.beyond(course) - beside(offs, place(vote));
            found.both -= vote.weight * slant * off * steps;
            found.squares += vote.weight * slant * slant;
        }
        found
    }
}

impl std::ops::AddAssign for Lowered {
    fn add_assign(&mut self, other: Self) {
        self.agreement += other.agreement;
        self.both += other.both;
        self.squares += other.squares;
    }
}
