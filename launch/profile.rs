//! Profiles: settings known by a name, each a measured place between coverage, errors and time.

use clap::ValueEnum;
use serde_json::Value;

/// Settings by name. The thesis's own are its literal constants, and stand with each node; the others differ from the
/// defaults in few, which [`CHANGES`] lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Profile {
    /// Half the time: one channel, strong edges only
    Fast,
    /// What scores best on real scenes for its time
    #[default]
    Default,
    /// Nearly twice the time: two channels more, for the finest texture
    Fine,
    /// Every literal constant of the thesis
    Thesis,
}

/// What a profile changes of a node's defaults: the profile, the node, the key, the value as JSON.
const CHANGES: &[(Profile, &str, &str, &str)] = &[
    (Profile::Fast, "filter", "channels", "[1.0]"),
    (Profile::Fast, "filter", "floor", "2.0"),
    // Fewer edges bear witness, so that the same score means a little less.
    (Profile::Fast, "match", "score_least", "0.99"),
    (Profile::Fine, "filter", "channels", "[4.0, 2.0, 1.0, 0.6]"),
    (Profile::Fine, "match", "score_least", "0.989"),
];

impl Profile {
    /// As it is given.
    pub(crate) fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// A node's defaults as this profile has them.
    pub(crate) fn changed(self, node: &str, mut settings: Value) -> Value {
        for &(profile, of, key, value) in CHANGES {
            if (profile, of) == (self, node) {
                // What is no JSON would be refused by the node's own check, which a test asks in every profile.
                settings[key] = serde_json::from_str(value).unwrap_or_default();
            }
        }
        settings
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::registry::nodes;

    #[test]
    fn what_a_profile_changes_is_a_setting_of_that_node_and_not_its_default() {
        for &(profile, node, key, _) in CHANGES {
            let node = nodes().iter().find(|known| known.name == node).unwrap();
            let of = |profile| (node.settings)(profile)[key].clone();
            let is_known = node.keys.iter().any(|known| known.name == key);
            assert!(is_known, "{} has no {key}", node.name);
            assert_ne!(of(profile), of(Profile::Default), "{}.{key}", node.name);
        }
    }
}
