//! What can be set while a graph runs: the settings of the stages that compute, with their ranges.

use std::collections::BTreeMap;

use messages::bus::Parameter;
use messages::change::Change;
use serde_json::Value;

use crate::graph::{checked, known_key, known_node};
use crate::registry::{NODES, NodeType};

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
        let tunable = NODES.iter().filter(|node| node.fixed.is_some());
        Self {
            tables: tunable.filter_map(table).collect(),
        }
    }

    /// All of them, in the order of the pipe.
    pub(crate) fn list(&self) -> Vec<Parameter> {
        let mut list = Vec::new();
        for node in NODES {
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
            known_node(node)?;
            let of_node = NODES.iter().find(|known| known.name == node);
            let Some(of_node) = of_node.filter(|known| known.fixed.is_some()) else {
                return Err(format!("{name} cannot be changed while the graph runs"));
            };
            known_key(node, key, of_node.keys)?;
            if !of_node.is_tunable(key) {
                return Err(format!(
                    "{name} cannot be changed while the graph runs: topics and what refers to them depend on it"
                ));
            }
            let Some(Value::Object(table)) = tables.get_mut(node) else {
                return Err(format!("the graph has no {node}"));
            };
            let value = match value {
                Value::String(text) if text == AUTOMATIC => Value::Null,
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
        Ok(changes)
    }

    /// Notes what was changed.
    pub(crate) fn apply(&mut self, changes: &[Change]) {
        for (node, table) in &mut self.tables {
            Change::apply(changes, node, table);
        }
    }
}

/// Whether two values mean the same: 1 is 1.0.
fn is_same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => one.as_f64() == other.as_f64(),
        _ => one == other,
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::cli::Profile;
    use crate::graph::{Graph, Overrides};
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
        let changes = set("match.score", json!(0.6)).unwrap();
        assert_eq!(changes[0].key, "score");
        let error = set("match.score", json!(7)).unwrap_err();
        assert!(error.contains("must lie between"), "{error}");
        let error = set("match.score", json!("high")).unwrap_err();
        assert!(error.contains("match.score"), "{error}");
        let error = set("match.scor", json!(0.5)).unwrap_err();
        assert!(error.contains("match.score"), "{error}");
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
        assert!(names.contains(&"match.score".to_owned()), "{names:?}");
        assert!(!names.iter().any(|name| name.starts_with("record.")));
    }

    #[test]
    fn what_is_so_already_is_no_change() {
        let score = parameters();
        let score = score.list().into_iter().find(|p| p.name == "match.score");
        assert_eq!(set("match.score", score.unwrap().value), Ok(vec![]));
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
