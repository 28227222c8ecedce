//! What neighbours say: uniqueness in the other views, support in the reference view.

use messages::{NONE, Reason};

use crate::choice::Choice;

/// Uniqueness and support, with their memory.
#[derive(Debug, Default)]
pub(crate) struct Support {
    claims: Vec<(f32, u32)>,
}

impl Support {
    /// Of several points that land on one spot of another view, keeps the best.
    pub(crate) fn keep_unique(
        &mut self,
        spots: usize,
        which: usize,
        choices: &mut [Choice],
        lost: &mut [Reason],
        worth: impl Fn(&Choice) -> f32,
    ) {
        self.claims.clear();
        self.claims.resize(spots, (f32::INFINITY, NONE));
        for (point, choice) in (0..).zip(choices.iter()) {
            if choice.spots[which] != NONE {
                let claim = &mut self.claims[choice.spots[which] as usize];
                let worth = worth(choice);
                if worth < claim.0 {
                    *claim = (worth, point);
                }
            }
        }
        for point in 0..choices.len() {
            let choice = &choices[point];
            if choice.spots[which] == NONE {
                continue;
            }
            let winner = self.claims[choice.spots[which] as usize].1 as usize;
            // A branch repeats points of the curve it leaves: the same disparity is no contradiction.
            if winner != point && (choices[winner].disparity - choice.disparity).abs() > 0.5 {
                choices[point] = Choice::NOTHING;
                lost[point] = Reason::NotUnique;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_several_points_on_one_place_of_another_view_the_best_stays() {
        let choice = |disparity: f32, cost: f32, spot: u32| Choice {
            disparity,
            cost,
            spots: [spot, 9],
            ..Choice::NOTHING
        };
        let mut choices = [
            choice(5.0, 0.5, 3),
            choice(9.0, 0.2, 3),
            Choice::NOTHING,
            choice(7.0, 0.9, 4),
            choice(9.1, 0.3, 3),
        ];
        let mut lost = [Reason::Flat; 5];
        Support::default().keep_unique(10, 0, &mut choices, &mut lost, |choice| choice.cost);
        let flat = Reason::Flat;
        assert_eq!(lost, [Reason::NotUnique, flat, flat, flat, flat]);
        let kept: Vec<f32> = choices
            .iter()
            .filter(|choice| choice.is_some())
            .map(|choice| choice.disparity)
            .collect();
        // The last one is the winner's double, as where a curve branches.
        assert_eq!(kept, [9.0, 7.0, 9.1]);
    }
}
