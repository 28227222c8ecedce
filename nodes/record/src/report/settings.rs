//! All settings of a recording, and which of them are not what they would be by themselves.

use std::collections::BTreeMap;
use std::fmt::{self, Write};

use messages::change::{Change, shown};
use serde_json::{Map, Value};

use super::page::{count, counted, escape};
use super::place_in_pipe;

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

/// One setting.
struct Setting<'a> {
    node: &'a str,
    key: &'a str,
    value: &'a Value,
    /// What it is in the profile, when that is known.
    usual: Option<&'a Value>,
}

impl Setting<'_> {
    fn is_other(&self) -> bool {
        self.usual.is_some_and(|usual| !is_equal(usual, self.value))
    }

    fn is_said_elsewhere(&self) -> bool {
        SAID_ELSEWHERE.contains(&(self.node, self.key))
    }
}

/// The settings of a recording beside those of the profile they are nearest to.
pub(super) struct Compared<'a> {
    profile: Option<&'a str>,
    settings: Vec<Setting<'a>>,
}

impl<'a> Compared<'a> {
    pub(super) fn new(configuration: &'a Value, known: &'a Known) -> Self {
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
            })
            .collect()
        };
        let profiles = known.profiles.iter();
        let compared = profiles.map(|(name, nodes)| Self {
            profile: Some(name),
            settings: with(Some(nodes)),
        });
        let others = |one: &Self| one.settings.iter().filter(|s| s.is_other()).count();
        compared.min_by_key(others).unwrap_or_else(|| Self {
            profile: None,
            settings: with(None),
        })
    }

    /// What was set otherwise than the profile has it.
    pub(super) fn head(&self, out: &mut String) -> fmt::Result {
        let Some(profile) = self.profile else {
            return Ok(());
        };
        let settings = self.settings.iter();
        let others: Vec<_> = settings
            .filter(|setting| setting.is_other() && !setting.is_said_elsewhere())
            .collect();
        write!(out, "<h4>Settings: profile {}", escape(profile))?;
        match others.is_empty() {
            true => out.write_str(", nothing set otherwise</h4>"),
            false => {
                out.push_str(", but for</h4><ul class=\"chips\">");
                for Setting {
                    node, key, value, ..
                } in others
                {
                    write!(
                        out,
                        "<li>{}.{} = {}</li>",
                        escape(node),
                        escape(key),
                        escape(value)
                    )?;
                }
                out.write_str("</ul>")
            }
        }
    }

    /// All settings, a table a node.
    pub(super) fn tables(&self, out: &mut String, known: &Known) -> fmt::Result {
        if self.settings.is_empty() {
            return super::page::missing(out, "The recording holds no settings");
        }
        match self.profile {
            Some(profile) => write!(
                out,
                "<p>Marked is what differs from the profile {} of this version of tricurve.</p>",
                escape(profile)
            )?,
            None => out.push_str("<p>What is usual is not known here.</p>"),
        }
        for node in self.settings.chunk_by(|one, other| one.node == other.node) {
            let others = node.iter().filter(|setting| setting.is_other()).count() as u64;
            let name = node.first().map_or("", |setting| setting.node);
            let keys = counted(node.len() as u64, "key", "keys");
            let told = match others {
                0 => String::new(),
                _ => format!(", {others} set otherwise"),
            };
            write!(
                out,
                "<details><summary>{} <span>{keys}{told}</span></summary><div class=\"wide\"><table>\
                 <thead><tr><th>key</th><th>value</th><th>usual</th><th>meaning</th></tr></thead><tbody>",
                escape(name)
            )?;
            for setting in node {
                let Setting {
                    node,
                    key,
                    value,
                    usual,
                } = setting;
                let class = if setting.is_other() {
                    " class=\"other\""
                } else {
                    ""
                };
                let usual = match usual {
                    Some(usual) if setting.is_other() => usual.to_string(),
                    Some(_) => "same".to_owned(),
                    None => "not known".to_owned(),
                };
                let meaning = known.meanings.get(&((*node).to_owned(), (*key).to_owned()));
                writeln!(
                    out,
                    "<tr{class}><td class=\"mono\">{}</td><td class=\"mono\">{}</td><td class=\"mono\">{}</td>\
                     <td class=\"meaning\">{}</td></tr>",
                    escape(key),
                    escape(value),
                    escape(usual),
                    escape(meaning.map_or("", |meaning| meaning.trim()))
                )?;
            }
            out.push_str("</tbody></table></div></details>");
        }
        Ok(())
    }
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
    let others = settings.filter(|setting| setting.is_other() && !setting.is_said_elsewhere());
    let others: Vec<_> = others.map(line).collect();
    let but_for = match others.is_empty() {
        true => ", nothing set otherwise",
        false => ", but for",
    };
    let head = format!("profile {profile}{but_for}");
    std::iter::once(head).chain(others).collect()
}

/// How many settings were changed while it was recorded, in a line.
pub(super) fn changed(out: &mut String, changes: &[Change]) -> fmt::Result {
    let times = match changes.len() {
        0 => return Ok(()),
        1 => "once".to_owned(),
        times => format!("{} times", count(times as u64)),
    };
    write!(
        out,
        "<p>Settings were changed {times} while it was recorded: <a href=\"#settings\">which, and from which scan on</a>.</p>"
    )
}

/// The settings that were changed while it was recorded.
pub(super) fn changes(out: &mut String, changes: &[Change]) -> fmt::Result {
    if changes.is_empty() {
        return Ok(());
    }
    out.push_str(
        "<h3>Changed while it was recorded</h3><div class=\"wide\"><table><thead><tr><th class=\"n\">from scan</th>\
         <th>key</th><th>value</th><th>before</th></tr></thead><tbody>",
    );
    for change in changes {
        writeln!(
            out,
            "<tr><td class=\"n\">{}</td><td class=\"mono\">{}.{}</td><td class=\"mono\">{}</td>\
             <td class=\"mono\">{}</td></tr>",
            change.from,
            escape(&change.node),
            escape(&change.key),
            escape(shown(&change.value)),
            escape(shown(&change.was))
        )?;
    }
    out.write_str("</tbody></table></div><h3>As they were when it began</h3>")
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
        let (mut head, mut tables) = (String::new(), String::new());
        compared.head(&mut head).unwrap_or_default();
        compared.tables(&mut tables, &known).unwrap_or_default();
        assert!(head.contains("profile thesis, but for"), "{head}");
        assert!(head.contains("<li>track.high = 50.0</li>"), "{head}");
        assert_eq!(head.matches("<li>").count(), 1);
        assert_eq!(tables.matches("<tr class=\"other\">").count(), 1);
        assert!(
            tables.contains("a &lt;low&gt; one") && tables.contains("&lt;x&gt;"),
            "{tables}"
        );
    }
}
