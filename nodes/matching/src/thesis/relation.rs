//! Relational consistency: matched curves that lie together and agree support each other, those that disagree weaken
//! each other.
//!
//! Relaxation labelling (Rosenfeld): a match's certainty grows or shrinks with the mean agreement of its neighbours,
//! weighed by their own certainty, for a few rounds.

/// A node of the graph: a matched curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Column of its centroid.
    pub(crate) x: f32,
    /// Row of its centroid.
    pub(crate) y: f32,
    /// Its disparity.
    pub(crate) disparity: f32,
    /// How sure it is, 0 to 1.
    pub(crate) certainty: f32,
    /// Share of its neighbours that agree, 0 to 1.
    pub(crate) support: f32,
}

/// What neighbours are and how they act.
#[derive(Clone, Debug)]
pub(crate) struct Relation {
    /// Pixels between neighbouring centroids.
    pub(crate) radius: f32,
    /// Pixels of disparity within which neighbours agree, at no distance.
    pub(crate) within: f32,
    /// Pixels of disparity more for each pixel of distance.
    pub(crate) slope: f32,
    /// How strongly a round changes certainties.
    pub(crate) strength: f32,
    /// Rounds.
    pub(crate) rounds: usize,
}

/// Relaxes the certainties of all nodes; `before` is working memory.
pub(crate) fn relax(nodes: &mut [Node], relation: &Relation, before: &mut Vec<Node>) {
    for _ in 0..relation.rounds {
        before.clear();
        before.extend_from_slice(nodes);
        before.sort_unstable_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
        for node in nodes.iter_mut() {
            let start = before.partition_point(|near| near.y < node.y - relation.radius);
            let (mut agreement, mut weights, mut agree, mut all) = (0.0, 0.0, 0.0, 0.0);
            for near in before[start..]
                .iter()
                .take_while(|near| near.y <= node.y + relation.radius)
            {
                let distance = (near.x - node.x).hypot(near.y - node.y);
                if distance > relation.radius {
                    continue;
                }
                let allowed = relation.within + relation.slope * distance;
                let agrees = (near.disparity - node.disparity).abs() <= allowed;
                let weight = near.certainty * (1.0 - distance / (relation.radius + 1.0));
                agreement += if agrees { weight } else { -weight };
                weights += weight;
                agree += f32::from(u8::from(agrees));
                all += 1.0;
            }
            // The node is its own neighbour in `before`: take it out again.
            agreement -= node.certainty;
            weights -= node.certainty;
            (agree, all) = (agree - 1.0, all - 1.0);
            node.support = if all > 0.0 { agree / all } else { 1.0 };
            if weights > 1e-6 {
                let change = 1.0 + relation.strength * agreement / weights;
                node.certainty = (node.certainty * change).clamp(0.0, 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RELATION: Relation = Relation {
        radius: 50.0,
        within: 1.0,
        slope: 0.0,
        strength: 0.3,
        rounds: 4,
    };

    fn nodes(disparities: &[f32]) -> Vec<Node> {
        let node = |(i, &disparity): (usize, &f32)| Node {
            x: 10.0 * i as f32,
            y: 5.0,
            disparity,
            certainty: 0.6,
            support: 0.0,
        };
        disparities.iter().enumerate().map(node).collect()
    }

    #[test]
    fn one_that_disagrees_with_its_neighbours_is_weakened_and_they_hold() {
        let mut all = nodes(&[8.0, 8.2, 20.0, 8.1, 8.3]);
        relax(&mut all, &RELATION, &mut Vec::new());
        assert!(
            all[2].certainty < 0.4 && all[2].support == 0.0,
            "{:?}",
            all[2]
        );
        assert!(
            [0, 1, 3, 4]
                .iter()
                .all(|&i| all[i].certainty > 0.6 && all[i].support > 0.7)
        );
    }

    #[test]
    fn two_surfaces_side_by_side_both_hold() {
        let mut all = nodes(&[8.0, 8.2, 8.1, 20.0, 20.3, 20.1]);
        all[3..].iter_mut().for_each(|node| node.x += 60.0);
        relax(&mut all, &RELATION, &mut Vec::new());
        assert!(
            all.iter()
                .all(|node| node.certainty > 0.6 && node.support == 1.0)
        );
    }

    #[test]
    fn one_without_neighbours_stays_as_it_is() {
        let mut all = nodes(&[8.0]);
        relax(&mut all, &RELATION, &mut Vec::new());
        assert_eq!(all[0].certainty, 0.6);
    }
}
