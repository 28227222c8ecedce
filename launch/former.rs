//! Keys of builds before: who still sets one is told what became of it, and what a recording says of one is carried over.

use std::collections::BTreeMap;

use messages::change::{Change, shown};
use serde_json::{Map, Value, json};

use crate::parameters::is_same;

/// What became of a key.
#[derive(Clone, Copy, Debug)]
enum Became {
    /// These keys have its value now.
    Called(&'static [&'static str]),
    /// It has this value, as JSON, for good: why.
    Fixed(&'static str, &'static str),
}

use Became::{Called, Fixed};

/// Which other value would be of use to nobody.
const NOTHING: &str = "other values changed next to nothing";

/// Every key that there was: its node, its name, and what became of it.
const FORMER: &[(&str, &str, Became)] = &[
    (
        "match",
        "candidates",
        Fixed("8", "more than 3 changed nothing"),
    ),
    ("match", "jump", Fixed("2.0", NOTHING)),
    ("match", "crossing", Fixed("0.2", NOTHING)),
    (
        "match",
        "miss_cost",
        Fixed("0.2", "score_least buys the same"),
    ),
    (
        "match",
        "unseen_cost",
        Fixed("1.0", "less was wrong more often, more covered less"),
    ),
    (
        "match",
        "gray_most",
        Fixed("2.0", "other values changed nothing"),
    ),
    ("match", "better_side", Fixed("4.0", NOTHING)),
    ("match", "cell", Fixed("16.0", NOTHING)),
    ("match", "steady", Fixed("1.0", NOTHING)),
    (
        "match",
        "support_share",
        Fixed("0.7", "score_least asks the neighbours too"),
    ),
    (
        "match",
        "support_within",
        Fixed("1.0", "score_least asks the neighbours too"),
    ),
    ("match", "support_slope", Fixed("0.1", NOTHING)),
    (
        "match",
        "support_least",
        Fixed("4.0", "score_least asks the neighbours too"),
    ),
    (
        "match",
        "support_cell",
        Fixed("8.0", "score_least asks the neighbours too"),
    ),
    (
        "match",
        "fill_in_radius",
        Fixed("0", "more covered less, as often wrong"),
    ),
    (
        "match",
        "initial_disparity",
        Called(&["curves.initial_disparity", "points.initial_disparity"]),
    ),
    ("match", "window_widths", Called(&["curves.window_widths"])),
    ("match", "window_rows", Called(&["curves.window_rows"])),
    ("match", "vote_rows", Called(&["curves.vote_rows"])),
    ("match", "vote_cell", Called(&["curves.vote_cell"])),
    ("match", "slant_most", Called(&["curves.slant_most"])),
    ("match", "score", Called(&["curves.score"])),
    ("match", "loop_residual", Called(&["curves.loop_residual"])),
    (
        "match",
        "relation_radius",
        Called(&["curves.relation_radius"]),
    ),
    (
        "match",
        "relation_strength",
        Called(&["curves.relation_strength"]),
    ),
    (
        "match",
        "relation_rounds",
        Called(&["curves.relation_rounds"]),
    ),
    ("match", "certainty", Called(&["curves.certainty"])),
    ("match", "filling", Called(&["curves.filling"])),
    ("match", "reach_widths", Called(&["points.reach_widths"])),
    ("match", "majority", Called(&["points.majority"])),
    ("match", "matched_share", Called(&["points.matched_share"])),
];

fn of(node: &str, key: &str) -> Option<Became> {
    let mut all = FORMER.iter();
    all.find(|former| (former.0, former.1) == (node, key))
        .map(|former| former.2)
}

/// What is fixed, as the value that it is.
fn value_of(fixed: &str) -> Value {
    serde_json::from_str(fixed).unwrap_or_default()
}

/// What became of a key that there was, in a sentence for whoever sets it.
pub(crate) fn told(node: &str, key: &str) -> Option<String> {
    Some(match of(node, key)? {
        Called(names) => {
            let names = names.iter().map(|name| format!("{node}.{name}"));
            let names: Vec<String> = names.collect();
            format!("{node}.{key} is called {} now", names.join(" and "))
        }
        Fixed(value, why) => {
            format!("{node}.{key} is gone, and is always {value}: {why}")
        }
    })
}

/// What a recording says of a key that is fixed by now, where it says another value.
fn lost(node: &str, key: &str, was: &Value, fixed: &str) -> Option<String> {
    let is_lost = !was.is_null() && !is_same(was, &value_of(fixed));
    is_lost.then(|| {
        format!(
            "{node}.{key} was {} when it was recorded and is always {fixed} here: what this build computes is not what was \
             recorded",
            shown(was)
        )
    })
}

/// A recorded configuration in the keys of this build, and a sentence for each value that cannot be carried over.
pub(crate) fn carried(recorded: &Value) -> (Value, Vec<String>) {
    let mut not_carried = Vec::new();
    let Value::Object(tables) = recorded else {
        return (recorded.clone(), not_carried);
    };
    let table = |(node, table): (&String, &Value)| {
        let Value::Object(keys) = table else {
            return (node.clone(), table.clone());
        };
        let mut now = Map::new();
        for (key, value) in keys {
            match of(node, key) {
                None => {
                    now.insert(key.clone(), value.clone());
                }
                Some(Called(names)) => {
                    for name in names {
                        now.entry(*name).or_insert_with(|| value.clone());
                    }
                }
                Some(Fixed(fixed, _)) => not_carried.extend(lost(node, key, value, fixed)),
            }
        }
        (node.clone(), Value::Object(now))
    };
    let tables: Map<String, Value> = tables.iter().map(table).collect();
    (Value::Object(tables), not_carried)
}

/// A recorded configuration in the keys of this build, and in those of before where a value cannot be carried over.
pub(crate) fn in_keys_of_now(recorded: &Value) -> Value {
    let (mut now, _) = carried(recorded);
    for (node, key, became) in FORMER {
        let Fixed(fixed, _) = became else { continue };
        let was = recorded.get(node).and_then(|table| table.get(key));
        if let (Some(was), Some(Value::Object(table))) = (was, now.get_mut(*node))
            && lost(node, key, was, fixed).is_some()
        {
            table.insert((*key).to_owned(), was.clone());
        }
    }
    now
}

/// Changes that were made while it was recorded, of the keys of this build, and a sentence for each that cannot be carried
/// over.
pub(crate) fn carried_changes(changes: Vec<Change>) -> (Vec<Change>, Vec<String>) {
    let (mut now, mut not_carried) = (Vec::new(), Vec::new());
    for change in changes {
        match of(&change.node, &change.key) {
            None => now.push(change),
            Some(Called(names)) => now.extend(names.iter().map(|name| Change {
                key: (*name).to_owned(),
                ..change.clone()
            })),
            Some(Fixed(fixed, _)) => {
                not_carried.extend(lost(&change.node, &change.key, &change.value, fixed));
            }
        }
    }
    (now, not_carried)
}

/// Settings in which two recordings differ, by `node.key`, without those that differ in nothing but the keys of then and of
/// now; null is what one of them does not say.
pub(crate) fn settled(differing: BTreeMap<String, [Value; 2]>) -> BTreeMap<String, [Value; 2]> {
    let mut settled = BTreeMap::new();
    for (name, values) in differing {
        let became = name
            .split_once('.')
            .and_then(|(node, key)| Some((node, of(node, key)?)));
        let names = match became {
            Some((node, Called(names))) => {
                names.iter().map(|key| format!("{node}.{key}")).collect()
            }
            _ => vec![name.clone()],
        };
        let fixed = match became {
            Some((_, Fixed(fixed, _))) => value_of(fixed),
            _ => Value::Null,
        };
        for name in names {
            let known: &mut [Value; 2] = settled.entry(name).or_default();
            for (known, value) in known.iter_mut().zip(&values) {
                match (known.is_null(), value.is_null()) {
                    (true, false) => known.clone_from(value),
                    (true, true) => known.clone_from(&fixed),
                    _ => {}
                }
            }
        }
    }
    settled.retain(|_, [a, b]| !is_same(a, b));
    settled
}

/// Adds the keys that there were to a node's settings, each with the value that it would have: what a recording of before
/// says is compared with these.
pub(crate) fn with_former(node: &str, mut settings: Value) -> Value {
    if let Value::Object(table) = &mut settings {
        for (_, key, became) in FORMER.iter().filter(|former| former.0 == node) {
            let value = match became {
                Called(names) => names.iter().find_map(|name| table.get(*name).cloned()),
                Fixed(fixed, _) => Some(value_of(fixed)),
            };
            table.insert((*key).to_owned(), value.unwrap_or(json!(null)));
        }
    }
    settings
}

/// Every key that there was, with its node and what became of it, in a sentence.
pub(crate) fn all() -> impl Iterator<Item = (&'static str, &'static str, String)> {
    FORMER
        .iter()
        .filter_map(|(node, key, _)| Some((*node, *key, told(node, key)?)))
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::profile::Profile;
    use crate::registry;

    #[test]
    fn a_key_that_there_was_is_none_by_now_and_leads_to_one_that_is() {
        for (node, key, became) in FORMER {
            let known = registry::find(node).unwrap();
            let is_key = |name: &str| known.keys.iter().any(|key| key.name == name);
            assert!(!is_key(key), "{node}.{key}");
            match became {
                Called(names) => assert!(names.iter().all(|name| is_key(name)), "{node}.{key}"),
                Fixed(value, _) => assert!(!value_of(value).is_null(), "{node}.{key}"),
            }
        }
    }

    #[test]
    fn what_was_recorded_under_other_names_is_carried_over_and_what_cannot_be_is_said() {
        let recorded = json!({
            "match": {"score": 0.6, "initial_disparity": 32.0, "jump": 2, "gray_most": null, "crossing": 0.2, "gap": 6},
            "versions": {"match": 2},
        });
        let (now, not_carried) = carried(&recorded);
        let expected = json!({
            "match": {
                "curves.score": 0.6, "curves.initial_disparity": 32.0, "points.initial_disparity": 32.0, "gap": 6
            },
            "versions": {"match": 2},
        });
        assert_eq!((now, not_carried), (expected, vec![]));
        let (_, not_carried) = carried(&json!({"match": {"jump": 100.0}}));
        assert_eq!(
            not_carried,
            [
                "match.jump was 100.0 when it was recorded and is always 2.0 here: what this build computes is not what was recorded"
            ]
        );
    }

    #[test]
    fn settings_of_then_and_now_are_the_same_unless_a_value_cannot_be_carried_over() {
        let then = json!({"match": {"score": 0.6, "jump": 2.0}, "track": {"gap": 1}});
        let now = json!({"match": {"curves.score": 0.6}, "track": {"gap": 1}});
        assert_eq!(in_keys_of_now(&then), now);
        assert_eq!(in_keys_of_now(&now), now);
        let other = json!({"match": {"score": 0.6, "jump": 9.0}, "track": {"gap": 1}});
        assert_ne!(in_keys_of_now(&other), now);
    }

    #[test]
    fn a_change_of_a_key_that_is_called_otherwise_is_one_of_the_key_of_now() {
        let change = |key: &str, value| Change {
            from: 3,
            node: "match".to_owned(),
            key: key.to_owned(),
            value,
            was: Value::Null,
        };
        let changes = vec![
            change("score", json!(0.7)),
            change("cell", json!(8.0)),
            change("steady", json!(1)),
        ];
        let (now, not_carried) = carried_changes(changes);
        assert_eq!(now, [change("curves.score", json!(0.7))]);
        assert_eq!(not_carried.len(), 1);
        assert!(not_carried[0].starts_with("match.cell was 8.0 "));
    }

    #[test]
    fn recordings_of_then_and_now_differ_in_what_is_set_otherwise_only() {
        let differing = json!({
            "match.score": [0.5, null], "match.curves.score": [null, 0.5],
            "match.majority": [0.5, null], "match.points.majority": [null, 0.6],
            "match.jump": [2.0, null], "match.cell": [8.0, null], "match.gap": [6, 10],
        });
        let settled = settled(serde_json::from_value(differing).unwrap());
        let expected = json!({
            "match.points.majority": [0.5, 0.6], "match.cell": [8.0, 16.0], "match.gap": [6, 10],
        });
        assert_eq!(serde_json::to_value(settled).unwrap(), expected);
    }

    #[test]
    fn a_profile_s_value_of_a_key_that_there_was_is_that_of_the_key_of_now() {
        let matching = registry::find("match").unwrap();
        let thesis = with_former("match", (matching.settings)(Profile::Thesis));
        assert_eq!(thesis["score"], thesis["curves.score"]);
        assert_eq!(thesis["crossing"], json!(0.2));
    }
}
