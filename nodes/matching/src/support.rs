//! What neighbours say: uniqueness in the other views, support in the reference view.

use messages::NONE;

use crate::along::Choice;

/// Uniqueness and support, with their memory.
#[derive(Debug, Default)]
pub(crate) struct Support {
    claims: Vec<(f32, u32)>,
}

impl Support {
    /// Of several points that land on one spot of another view, keeps the best.
    pub(crate) fn keep_unique(&mut self, spots: usize, which: usize, choices: &mut [Choice], worth: impl Fn(&Choice) -> f32) {
        self.claims.clear();
        self.claims.resize(spots, (f32::INFINITY, NONE));
        for (point, choice) in (0..).zip(choices.iter()) {
            if choice.is_seen() {
                let claim = &mut self.claims[choice.spots[which] as usize];
                let worth = worth(choice);
                if worth < claim.0 {
                    *claim = (worth, point);
                }
            }
        }
        for point in 0..choices.len() {
            let choice = &choices[point];
            if !choice.is_seen() {
                continue;
            }
            let winner = self.claims[choice.spots[which] as usize].1 as usize;
            // A branch repeats points of the curve it leaves: the same disparity is no contradiction.
            if winner != point && (choices[winner].disparity - choice.disparity).abs() > 0.5 {
                choices[point] = Choice::NOTHING;
            }
        }
    }
}
