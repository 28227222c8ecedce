//! All settings of a recording, and which of them are not what they would be by themselves.

use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};
use messages::change::{Change, shown};
use serde_json::{Map, Value};

use super::page::{count, counted, missing, table};
use super::run::place_in_pipe;

/// What the program knows of settings; a recording holds only their values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// The profiles: each a name and its settings, by node and key.
    pub profiles: Vec<(String, Value)>,
    /// What a key means, by node and key.
    pub meanings: BTreeMap<(String, String), String>,
}

/// Keys in which every run differs from every other, that the head of the page says in words, or that follow from others.
const SAID_ELSEWHERE: [(&str, &str); 7] = [
    ("capture", "source"),
    ("capture", "start"),
    ("capture", "truth"),
    ("evaluate", "view"),
    ("hough", "tables"),
    ("record", "file"),
    ("record", "overwrite"),
];

/// The profile that a run has when it asks for none.
const DEFAULT: &str = "default";

/// Under this key a configuration says which of its settings were found out from the source, each as `node.key`.
pub const MEASURED: &str = "measured";

/// One setting.
struct Setting<'a> {
    node: &'a str,
    key: &'a str,
    value: &'a Value,
    /// What it is in the profile, when that is known.
    usual: Option<&'a Value>,
    /// Whether nobody set it: it was found out from the source.
    is_measured: bool,
}

impl Setting<'_> {
    fn is_other(&self) -> bool {
        self.usual.is_some_and(|usual| !is_equal(usual, self.value))
    }

    /// Whether it is worth telling that it is another: not what the page says in words anyway.
    fn is_told(&self) -> bool {
        self.is_other() && !SAID_ELSEWHERE.contains(&(self.node, self.key))
    }

    /// What it is in these settings of all nodes.
    fn within<'b>(&self, nodes: &'b Value) -> Option<&'b Value> {
        nodes.get(self.node)?.get(self.key)
    }

    /// What it means, when that is known.
    fn meaning<'b>(&self, known: &'b Known) -> &'b str {
        let key = (self.node.to_owned(), self.key.to_owned());
        known.meanings.get(&key).map_or("", |about| about.trim())
    }
}

/// The settings of a recording beside those of the profile they are nearest to.
pub(super) struct Compared<'a> {
    profile: Option<&'a str>,
    settings: Vec<Setting<'a>>,
}

impl<'a> Compared<'a> {
    pub(super) fn new(configuration: &'a Value, known: &'a Known) -> Self {
        let measured = configuration.get(MEASURED).and_then(Value::as_array);
        let measured: BTreeSet<&str> = measured
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        let with = |profile: Option<&'a Value>| -> Vec<Setting<'a>> {
            let nodes = configuration.as_object().into_iter().flatten();
            let mut nodes: Vec<_> = nodes.collect();
            nodes.sort_by_key(|(node, _)| place_in_pipe(node));
            let keys = nodes.into_iter().flat_map(|(node, table)| {
                let keys = table.as_object().into_iter().flatten();
                keys.map(move |(key, value)| (node, key, value))
            });
            keys.map(|(node, key, value)| Setting {
                node,
                key,
                value,
                usual: profile.and_then(|nodes| nodes.get(node)?.get(key)),
                is_measured: measured.contains(&*format!("{node}.{key}")),
            })
            .collect()
        };
        let profiles = known.profiles.iter();
        let compared = profiles.map(|(name, nodes)| Self {
            profile: Some(name),
            settings: with(Some(nodes)),
        });
        let others = |one: &Self| one.settings.iter().filter(|s| s.is_other()).count();
        // Of profiles that are as near, the one that is chosen where nobody chooses.
        let distance = |one: &Self| (others(one), one.profile != Some("default"));
        compared.min_by_key(distance).unwrap_or_else(|| Self {
            profile: None,
            settings: with(None),
        })
    }

    /// What was set by hand, and what was found out from the source.
    fn others(&self) -> (Vec<&Setting<'a>>, Vec<&Setting<'a>>) {
        let settings = self.settings.iter();
        let others = settings.filter(|setting| setting.is_told());
        others.partition(|setting| !setting.is_measured)
    }

    /// What was set: what differs from the profile with what it would be, what was changed meanwhile, and the rest folded.
    pub(super) fn section(&self, meanwhile: &[Change], graph: &str, known: &'a Known) -> Markup {
        let defaults = known.profiles.iter().find(|(name, _)| name == DEFAULT);
        let defaults = defaults.map(|(_, nodes)| nodes);
        let (others, measured) = self.others();
        // A profile's own settings were not set by hand, but they are not the default either.
        let of_profile: Vec<&Setting<'a>> = match self.profile {
            None | Some(DEFAULT) => Vec::new(),
            Some(_) => {
                let own = self.settings.iter().filter(|own| !own.is_other());
                let is_other = |own: &&Setting<'a>| {
                    let usual = defaults.and_then(|nodes| own.within(nodes));
                    usual.is_some_and(|usual| !is_equal(usual, own.value))
                };
                own.filter(is_other).collect()
            }
        };
        html! {
            section #settings {
                h2 { "What was set" }
                @match self.profile {
                    Some(profile) => {
                        p {
                            "Made with the profile " (profile)
                            @match others.len() as u64 {
                                0 => { ", nothing set otherwise." }
                                number => { ", but for " (counted(number, "setting", "settings")) ":" }
                            }
                        }
                        @if !others.is_empty() { (beside(&others, profile, defaults, known)) }
                        @if !measured.is_empty() {
                            p { "Found out from the source, and not set:" }
                            (beside(&measured, profile, defaults, known))
                        }
                        @if !of_profile.is_empty() {
                            details {
                                summary {
                                    (counted(of_profile.len() as u64, "setting", "settings"))
                                    " " span { "that the profile " (profile) " has otherwise than the default" }
                                }
                                (beside(&of_profile, profile, defaults, known))
                            }
                        }
                    }
                    None if self.settings.is_empty() => {}
                    None => { p { "What is usual is not known here." } }
                }
                (changes(meanwhile))
                (self.all(known))
                @if !graph.trim().is_empty() {
                    details {
                        summary { "the whole graph " span { "as the recording holds it" } }
                        pre tabindex="0" { (graph) }
                    }
                }
            }
            "\n"
        }
    }

    /// All settings, folded, a table a node.
    fn all(&self, known: &Known) -> Markup {
        if self.settings.is_empty() {
            return missing("The recording holds no settings");
        }
        let columns = [
            ("setting", false),
            ("value", false),
            ("usual", false),
            ("meaning", false),
        ];
        let rows = |node: &[Setting<'_>]| {
            html! {
                @for setting in node {
                    tr.other[setting.is_other()] {
                        td.mono { (setting.key) }
                        td.mono { (shown(setting.value)) }
                        td.mono {
                            @match setting.usual {
                                Some(usual) if setting.is_other() => { (shown(usual)) }
                                Some(_) => { "same" }
                                None => { "not known" }
                            }
                        }
                        td.meaning { (setting.meaning(known)) }
                    }
                    "\n"
                }
            }
        };
        html! {
            details {
                summary {
                    "all " (counted(self.settings.len() as u64, "setting", "settings"))
                    " " span { "node by node" }
                }
                @for node in self.settings.chunk_by(|one, other| one.node == other.node) {
                    @let others = node.iter().filter(|setting| setting.is_told() && !setting.is_measured).count();
                    details {
                        summary {
                            (node.first().map_or("", |setting| setting.node)) " "
                            span {
                                (counted(node.len() as u64, "setting", "settings"))
                                @if others > 0 { ", " (others) " set otherwise" }
                            }
                        }
                        (table(&columns, &rows(node)))
                    }
                }
            }
        }
    }
}

/// Settings that are not what they would be by themselves, beside what they would be.
fn beside(
    settings: &[&Setting<'_>],
    profile: &str,
    defaults: Option<&Value>,
    known: &Known,
) -> Markup {
    let in_profile = format!("profile {profile}");
    let mut columns = vec![("setting", false), ("value", false)];
    if profile != DEFAULT {
        columns.push((&in_profile, false));
    }
    columns.extend([("default", false), ("meaning", false)]);
    let rows = html! {
        @for setting in settings {
            tr {
                td.mono { (setting.node) "." (setting.key) }
                td.mono { b { (shown(setting.value)) } }
                @if profile != DEFAULT { td.mono { (setting.usual.map_or_else(String::new, shown)) } }
                td.mono {
                    (defaults.and_then(|nodes| setting.within(nodes)).map_or_else(String::new, shown))
                }
                td.meaning { (setting.meaning(known)) }
            }
            "\n"
        }
    };
    table(&columns, &rows)
}

/// The settings of a recording in lines of text: which of them differ from the profile that they are nearest to, or all.
pub fn settings_in_lines(configuration: &Value, known: &Known, all: bool) -> Vec<String> {
    let compared = Compared::new(configuration, known);
    let settings = compared.settings.iter();
    let line = |setting: &Setting<'_>| {
        let (node, key, value) = (setting.node, setting.key, shown(setting.value));
        let usual = setting.usual.filter(|_| all && setting.is_other());
        let usual = usual.map_or_else(String::new, |usual| format!("  (usually {})", shown(usual)));
        format!("{node}.{key} = {value}{usual}")
    };
    let Some(profile) = compared.profile.filter(|_| !all) else {
        return settings.map(line).collect();
    };
    let (others, measured) = compared.others();
    let others: Vec<_> = others.into_iter().map(line).collect();
    let measured: Vec<_> = measured.into_iter().map(line).collect();
    let but_for = match others.is_empty() {
        true => ", nothing set otherwise",
        false => ", but for",
    };
    let head = format!("profile {profile}{but_for}");
    let found = (!measured.is_empty()).then(|| "found out from the source:".to_owned());
    std::iter::once(head)
        .chain(others)
        .chain(found)
        .chain(measured)
        .collect()
}

/// How many settings were changed while it was recorded, in a line.
pub(super) fn changed(changes: &[Change]) -> Markup {
    let times = match changes.len() {
        0 => return html! {},
        1 => "once".to_owned(),
        times => format!("{} times", count(times as u64)),
    };
    html! {
        p {
            "Settings were changed " (times) " while it was recorded: "
            a href="#settings" { "which, and from which scan on" } "."
        }
    }
}

/// The settings that were changed while it was recorded.
fn changes(changes: &[Change]) -> Markup {
    if changes.is_empty() {
        return html! {};
    }
    let columns = [
        ("from scan", true),
        ("setting", false),
        ("value", false),
        ("before", false),
    ];
    let rows = html! {
        @for change in changes {
            tr {
                td.n { (count(change.from)) }
                td.mono { (change.node) "." (change.key) }
                td.mono { b { (shown(&change.value)) } }
                td.mono { (shown(&change.was)) }
            }
            "\n"
        }
    };
    html! {
        h3 { "Changed while it was recorded" }
        (table(&columns, &rows))
        h3 { "As they were when it began" }
    }
}

/// Whether two values are the same setting: 1 is 1.0, and what is not given is null.
fn is_equal(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => one.as_f64() == other.as_f64(),
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len()
                && one
                    .iter()
                    .zip(other)
                    .all(|(one, other)| is_equal(one, other))
        }
        (Value::Object(one), Value::Object(other)) => {
            let is_in = |(key, value): (&String, &Value), map: &Map<String, Value>| {
                map.get(key).is_some_and(|other| is_equal(value, other))
            };
            one.len() == other.len() && one.iter().all(|pair| is_in(pair, other))
        }
        _ => one == other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_was_found_out_from_the_source_does_not_stand_among_what_was_set() {
        let default = json!({"capture": {"stride": null, "rate": 10.0}});
        let known = Known {
            profiles: vec![(DEFAULT.to_owned(), default)],
            ..Known::default()
        };
        let capture = json!({"stride": 2, "rate": 30.0});
        let found = json!({"capture": capture, MEASURED: ["capture.stride"]});
        assert_eq!(
            settings_in_lines(&found, &known, false),
            [
                "profile default, but for",
                "capture.rate = 30.0",
                "found out from the source:",
                "capture.stride = 2"
            ]
        );
        let compared = Compared::new(&found, &known);
        let section = compared.section(&[], "", &known).into_string();
        let (set, measured) = section
            .split_once("Found out from the source")
            .unwrap_or_default();
        assert!(
            set.contains("but for 1 setting:") && set.contains("capture.rate"),
            "{set}"
        );
        assert!(
            !set.contains("capture.stride") && measured.contains("capture.stride"),
            "{measured}"
        );
    }

    #[test]
    fn the_nearest_profile_is_found_and_what_differs_from_it_told() {
        let known = Known {
            profiles: vec![
                (
                    "default".to_owned(),
                    json!({"track": {"low": null, "high": null, "points": 5}}),
                ),
                (
                    "thesis".to_owned(),
                    json!({"track": {"low": 32.0, "high": 64.0, "points": 32}}),
                ),
            ],
            meanings: BTreeMap::from([(
                ("track".to_owned(), "low".to_owned()),
                "a <low> one".to_owned(),
            )]),
        };
        let configuration =
            json!({"track": {"low": 32, "high": 50.0, "points": 32}, "new": {"<x>": "&"}});
        let compared = Compared::new(&configuration, &known);
        assert_eq!(compared.profile, Some("thesis"));
        let section = compared.section(&[], "", &known).into_string();
        let (first, rest) = section.split_once("<details>").unwrap_or_default();
        assert!(
            first.contains("profile thesis, but for 1 setting:"),
            "{first}"
        );
        // Value, what the profile has, and the default stand beside each other.
        let cells: String = ["<b>50.0</b>", "64.0", "automatic"]
            .map(|cell| format!("<td class=\"mono\">{cell}</td>"))
            .concat();
        assert!(first.contains(&cells), "{first}");
        assert_eq!(first.matches("<tr>").count(), 2, "its head and one row");
        assert!(rest.starts_with("<summary>2 settings "), "{rest}");
        assert_eq!(rest.matches("<tr class=\"other\">").count(), 1);
        assert!(
            rest.contains("a &lt;low&gt; one") && rest.contains("&lt;x&gt;"),
            "{rest}"
        );
    }
}
