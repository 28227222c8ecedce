//! Settings that are changed while a graph runs.
//!
//! A change holds from a scan on: every node works on the scans before it with what was set before, and on that scan and
//! all after it with the new value, however often one is sent again. So what comes of a scan depends on its number and the
//! list of changes alone, and a replay that knows the list makes the same bytes.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// One setting of one node, from a scan on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The first scan it holds for.
    pub from: u64,
    /// The node.
    pub node: String,
    /// Which of its settings.
    pub key: String,
    /// What it is from then on; null is what a graph file does not set.
    pub value: Value,
    /// What it was before.
    pub was: Value,
}

impl Change {
    /// Applies the changes of a node to its settings.
    pub fn apply<'a>(changes: impl IntoIterator<Item = &'a Self>, node: &str, to: &mut Value) {
        for change in changes.into_iter().filter(|change| change.node == node) {
            if let Value::Object(table) = to {
                table.insert(change.key.clone(), change.value.clone());
            }
        }
    }
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            from,
            node,
            key,
            value,
            was,
        } = self;
        write!(
            f,
            "{node}.{key} is {} from scan {from} on, was {}",
            shown(value),
            shown(was)
        )
    }
}

/// A value as a user writes it.
pub fn shown(value: &Value) -> String {
    match value {
        Value::Null => "automatic".to_owned(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
