//! What can be set while a graph runs: the settings of the stages that compute, with their ranges.

use std::collections::BTreeMap;

use messages::bus::Parameter;
use messages::change::Change;
use messages::settings::nearest;
use serde_json::{Number, Value};

use crate::graph::{GRAPH, check_tables, checked, known_key};
use crate::registry::{self, NodeType, nodes};

/// How a value is written that the node finds by itself.
const AUTOMATIC: &str = "automatic";

/// The parameters of a graph, as they are now.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parameters {
    /// Each node's settings.
    tables: BTreeMap<&'static str, Value>,
}

impl Parameters {
    /// Of a graph's configuration, with what was changed since.
    pub(crate) fn new(configuration: &Value, changes: &[Change]) -> Self {
        let table = |node: &NodeType| {
            let mut table = configuration.get(node.name)?.clone();
            Change::apply(changes, node.name, &mut table);
            Some((node.name, table))
        };
        let tunable = nodes().iter().filter(|node| node.fixed.is_some());
        Self {
            tables: tunable.filter_map(table).collect(),
        }
    }

    /// All of them, in the order of the pipe.
    pub(crate) fn list(&self) -> Vec<Parameter> {
        let mut list = Vec::new();
        for node in nodes() {
            let Some(table) = self.tables.get(node.name) else {
                continue;
            };
            for key in node.keys.iter().filter(|key| node.is_tunable(key.name)) {
                list.push(Parameter {
                    name: format!("{}.{}", node.name, key.name),
                    value: table.get(key.name).cloned().unwrap_or_default(),
                    about: key.about.trim().to_owned(),
                    range: key.range,
                });
            }
        }
        list
    }

    /// What changes when these are set, by name: all of them or none. From which scan on is for the caller to say.
    ///
    /// # Errors
    /// The first that cannot be set so, and what could.
    pub(crate) fn changes(&self, values: &BTreeMap<String, Value>) -> Result<Vec<Change>, String> {
        let mut tables = self.tables.clone();
        let mut changes = Vec::new();
        for (name, value) in values {
            let (node, key) = name
                .split_once('.')
                .ok_or_else(|| format!("a parameter is called node.key, not {name:?}"))?;
            let of_node = self.known(node)?;
            let Some(of_node) = of_node.filter(|known| known.fixed.is_some()) else {
                return Err(format!("{name} cannot be changed while the graph runs"));
            };
            known_key(node, key, of_node.keys)?;
            if !of_node.is_tunable(key) {
                return Err(format!(
                    "{name} cannot be changed while the graph runs: what is sent, or sent again when a node dies, depends on it"
                ));
            }
            let Some(Value::Object(table)) = tables.get_mut(node) else {
                return Err(format!("the graph has no {node}"));
            };
            let is_whole = of_node.keys.iter().any(|k| k.name == key && k.is_whole());
            let value = match value {
                Value::String(text) if text == AUTOMATIC => Value::Null,
                Value::Number(number) if is_whole => whole(number),
                other => other.clone(),
            };
            let was = table.insert(key.to_owned(), value.clone());
            let was = was.unwrap_or_default();
            checked(of_node, &tables[node])?;
            if is_same(&was, &value) {
                continue;
            }
            changes.push(Change {
                from: 0,
                node: node.to_owned(),
                key: key.to_owned(),
                value,
                was,
            });
        }
        if let (Some(hough), Some(matcher)) = (tables.get("hough"), tables.get("match")) {
            check_tables(hough, matcher)?;
        }
        Ok(changes)
    }

    /// The kind of node of this name, when it has anything to set while the graph runs.
    fn known(&self, name: &str) -> Result<Option<&'static NodeType>, String> {
        let known = registry::find(name);
        if known.is_some() || name == GRAPH {
            return Ok(known);
        }
        let names = || self.tables.keys().copied();
        Err(match nearest(name, names()) {
            Some(near) => format!("there is no node {name}; do you mean {near}?"),
            None => {
                let names: Vec<&str> = names().collect();
                let names = names.join(", ");
                format!("there is no node {name}; parameters are those of {names}")
            }
        })
    }

    /// Notes what was changed.
    pub(crate) fn apply(&mut self, changes: &[Change]) {
        for (node, table) in &mut self.tables {
            Change::apply(changes, node, table);
        }
    }
}

/// A number for a key that takes whole ones: many viewers know no other than 20.0.
fn whole(number: &Number) -> Value {
    match number.as_f64() {
        Some(float) if number.is_f64() && float.fract() == 0.0 && float >= 0.0 => {
            (float as u64).into()
        }
        _ => number.clone().into(),
    }
}

/// Whether two values mean the same: 1 is 1.0.
pub(crate) fn is_same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => one.as_f64() == other.as_f64(),
        _ => one == other,
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::graph::{Graph, Overrides};
    use crate::profile::Profile;
    use serde_json::json;

    fn parameters() -> Parameters {
        let graph = Graph::load(None, Profile::Default, &Overrides::default()).unwrap();
        Parameters::new(&graph.configuration(), &[])
    }

    fn set(name: &str, value: Value) -> Result<Vec<Change>, String> {
        parameters().changes(&BTreeMap::from([(name.to_owned(), value)]))
    }

    #[test]
    fn a_value_is_checked_against_its_range_and_its_type() {
        let changes = set("match.curves.score", json!(0.6)).unwrap();
        assert_eq!(changes[0].key, "curves.score");
        let error = set("match.curves.score", json!(7)).unwrap_err();
        assert!(error.contains("must lie between"), "{error}");
        let error = set("match.curves.score", json!("high")).unwrap_err();
        assert!(error.contains("match.curves.score"), "{error}");
        let error = set("match.curves.scor", json!(0.5)).unwrap_err();
        assert!(error.contains("match.curves.score"), "{error}");
    }

    #[test]
    fn a_matcher_that_reads_r_tables_is_not_set_without_them() {
        let curve = json!("curve");
        let error = set("match.assignment", curve.clone()).unwrap_err();
        assert!(error.ends_with("set hough.tables = true too"), "{error}");
        let both = [("match.assignment", curve), ("hough.tables", json!(true))];
        let both = both.map(|(name, value)| (name.to_owned(), value));
        assert_eq!(
            parameters().changes(&BTreeMap::from(both)).unwrap().len(),
            2
        );
    }

    #[test]
    fn a_refusal_says_what_is_expected_and_what_came() {
        let low = set("track.low", json!("abc")).unwrap_err();
        assert_eq!(
            low,
            "track.low is a number from 0 to 255, or automatic, not \"abc\""
        );
        let gap = set("match.gap", json!(2.5)).unwrap_err();
        assert_eq!(gap, "match.gap is a whole number from 0 to 64, not 2.5");
        let node = set("xyz.low", json!(1)).unwrap_err();
        assert!(
            node.ends_with("those of evaluate, filter, hough, map, match, track"),
            "{node}"
        );
    }

    #[test]
    fn a_whole_number_may_come_as_a_float_as_viewers_write_it() {
        let changes = set("track.min_points", json!(20.0)).unwrap();
        assert_eq!(changes[0].value, json!(20));
        let list = parameters().list();
        let was = list.iter().find(|p| p.name == "track.min_points").unwrap();
        let as_float = json!(was.value.as_f64().unwrap());
        assert_eq!(set("track.min_points", as_float), Ok(vec![]));
    }

    #[test]
    fn what_the_topics_depend_on_cannot_be_changed() {
        for name in [
            "filter.channels",
            "capture.rate",
            "record.file",
            "match.reference",
        ] {
            let error = set(name, json!(1)).unwrap_err();
            assert!(error.contains("cannot be changed"), "{name}: {error}");
        }
        let names: Vec<String> = parameters().list().into_iter().map(|p| p.name).collect();
        assert!(
            names.contains(&"match.curves.score".to_owned()),
            "{names:?}"
        );
        assert!(!names.iter().any(|name| name.starts_with("record.")));
    }

    #[test]
    fn what_is_so_already_is_no_change() {
        let score = parameters();
        let score = score
            .list()
            .into_iter()
            .find(|p| p.name == "match.curves.score");
        assert_eq!(set("match.curves.score", score.unwrap().value), Ok(vec![]));
    }

    #[test]
    fn automatic_takes_a_value_back() {
        let mut parameters = parameters();
        let high = |value| BTreeMap::from([("track.high".to_owned(), value)]);
        let by_hand = parameters.changes(&high(json!(4.0))).unwrap();
        parameters.apply(&by_hand);
        let back = parameters.changes(&high(json!("automatic"))).unwrap();
        assert_eq!(back[0].value, Value::Null);
        assert_eq!(back[0].was, json!(4.0));
    }
}
