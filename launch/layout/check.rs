//! Whether a recording or a running graph has all that a layout names.

use std::collections::{BTreeMap, BTreeSet};

use messages::record::{Channel, Codec};
use prost::Message as _;
use prost_types::field_descriptor_proto::Label;
use prost_types::{DescriptorProto, FileDescriptorSet};
use serde::Serialize;
use serde_json::{Map, Value};

use super::{ASKED_FOR, Viewer, is_of_graphs};

/// The topic that only sources with a truth have, and the node that makes it.
const NEED_TRUTH: &str = "evaluation";
const NEEDS_TRUTH: &str = "nodes.evaluate.";

/// What a panel names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Reference {
    /// The panel, as `Plot!speed`.
    pub(crate) panel: String,
    /// A topic, or a frame.
    pub(crate) name: String,
    /// What of the topic's messages, as `scores[0].coverage`; empty for all.
    pub(crate) field: String,
    /// Whether it is a frame of the 3D panel and no topic.
    pub(crate) is_frame: bool,
}

/// A topic, as the check needs to know it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topic {
    pub(crate) schema: String,
    pub(crate) encoding: String,
    pub(crate) data: Vec<u8>,
    /// One of its messages, where there are some.
    pub(crate) message: Option<Vec<u8>>,
}

/// What is there to show.
#[derive(Clone, Debug, Default)]
pub(crate) struct There {
    pub(crate) topics: BTreeMap<String, Topic>,
    pub(crate) frames: BTreeSet<String>,
    /// Whether topics without messages count as missing.
    pub(crate) needs_messages: bool,
    /// How many scans there are, where they have an end.
    pub(crate) scans: usize,
}

impl There {
    /// What a graph with these channels will have, as far as their schemas tell.
    pub(crate) fn promised(codec: &Codec, channels: Vec<Channel>) -> Self {
        let topic = |channel: Channel| {
            let topic = Topic {
                schema: channel.schema.name,
                encoding: channel.schema.encoding.to_owned(),
                data: channel.schema.data,
                message: None,
            };
            (channel.name, topic)
        };
        Self {
            topics: channels.into_iter().map(topic).collect(),
            frames: codec.frames().map(str::to_owned).collect(),
            needs_messages: false,
            scans: usize::MAX,
        }
    }
}

/// What came of the check.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Checked {
    /// How many panels the layout has.
    pub(crate) panels: usize,
    /// How many topics, fields and frames they name.
    pub(crate) references: usize,
    /// What is not there, a sentence each.
    pub(crate) missing: Vec<String>,
    /// What is not there because the source knows no truth.
    pub(crate) without_truth: Vec<String>,
}

/// Everything that panels name.
pub(super) fn references_of(panels: &Map<String, Value>) -> Vec<Reference> {
    let mut references = Vec::new();
    for (panel, config) in panels {
        let mut add = |name: &str, field: &str, is_frame| {
            references.push(Reference {
                panel: panel.clone(),
                name: name.to_owned(),
                field: field.to_owned(),
                is_frame,
            });
        };
        let text = |at: &str| config.pointer(at).and_then(Value::as_str);
        for at in [
            "/imageMode/imageTopic",
            "/imageMode/calibrationTopic",
            "/topicToRender",
        ] {
            if let Some(topic) = text(at) {
                add(topic, "", false);
            }
        }
        let keys = |at: &str| {
            let table = config.pointer(at).and_then(Value::as_object);
            table.into_iter().flatten()
        };
        for (topic, _) in keys("/imageMode/annotations") {
            add(topic, "", false);
        }
        for (topic, settings) in keys("/topics") {
            add(topic, "", false);
            if let Some(field) = settings.get("colorField").and_then(Value::as_str) {
                add(topic, &format!("fields.{field}"), false);
            }
        }
        if let Some(frame) = text("/followTf") {
            add(frame, "", true);
        }
        let paths = config.get("paths").and_then(Value::as_array);
        let paths = paths.into_iter().flatten();
        let paths = paths.filter_map(|path| path.get("value").and_then(Value::as_str));
        for path in paths
            .chain(text("/topicPath"))
            .chain(text("/xAxisPath/value"))
        {
            let (topic, field) = parted(path);
            add(topic, field, false);
        }
    }
    references
}

/// A path's topic and what of it.
pub(super) fn parted(path: &str) -> (&str, &str) {
    let quoted = path.strip_prefix('"').and_then(|rest| rest.split_once('"'));
    match quoted {
        Some((topic, field)) => (topic, field.trim_start_matches('.')),
        None => path.split_once('.').unwrap_or((path, "")),
    }
}

/// Whether a topic has what a panel shows of it.
pub(super) fn is_there(panel: &str, (name, field): (&str, &str), there: &There) -> bool {
    let reference = Reference {
        panel: panel.to_owned(),
        name: name.to_owned(),
        field: field.to_owned(),
        is_frame: false,
    };
    find(&reference, there).is_ok()
}

/// Whether all of these topics are there.
pub(super) fn topics(names: &[String], there: &There) -> Checked {
    let missing = names.iter().filter_map(|name| {
        let reference = Reference {
            panel: "the script".to_owned(),
            name: name.clone(),
            field: String::new(),
            is_frame: false,
        };
        let what = find(&reference, there).err()?;
        Some(format!("the script shows {what}"))
    });
    Checked {
        panels: 1,
        references: names.len(),
        missing: missing.collect(),
        ..Checked::default()
    }
}

/// Whether all that a viewer's layout names is there, and the viewer has all its panels.
pub(super) fn check(layout: &str, there: &There, viewer: Viewer) -> Result<Checked, String> {
    let layout: Value = serde_json::from_str(layout).map_err(|e| format!("the layout: {e}"))?;
    let panels = layout.get("configById").and_then(Value::as_object);
    let panels = panels.ok_or("the layout has no panels")?;
    let references = references_of(panels);
    let mut checked = Checked {
        panels: panels.len(),
        references: references.len(),
        ..Checked::default()
    };
    let showing: BTreeSet<&str> = references.iter().map(|r| r.panel.as_str()).collect();
    let mut placed = BTreeSet::new();
    place(layout.get("layout").unwrap_or(&Value::Null), &mut placed);
    let tabs_of = |config: &Value| config.get("tabs").and_then(Value::as_array).cloned();
    for tab in panels.values().filter_map(tabs_of).flatten() {
        place(tab.get("layout").unwrap_or(&Value::Null), &mut placed);
    }
    let configured = panels.keys().map(String::as_str);
    let named: BTreeSet<&str> = configured
        .chain(placed.iter().map(String::as_str))
        .collect();
    for panel in named {
        let kind = panel.split('!').next().unwrap_or_default();
        let is_filled = match panels.get(panel) {
            // What it holds are panels of their own.
            Some(config) if kind == "Tab" => tabs_of(config).is_some_and(|tabs| !tabs.is_empty()),
            Some(_) => showing.contains(panel) || is_of_graphs(panel),
            None => false,
        };
        if !viewer.has(kind) {
            let sentence = format!("{panel} is a panel that {viewer:?} does not have");
            checked.missing.push(sentence);
        } else if !is_filled {
            checked.missing.push(format!("{panel} shows nothing"));
        }
    }
    for reference in &references {
        let Err(what) = find(reference, there) else {
            continue;
        };
        if ASKED_FOR.contains(&reference.panel.as_str()) {
            continue;
        }
        let sentence = format!("{} shows {what}", reference.panel);
        let is_truth = !there.topics.contains_key(NEED_TRUTH)
            && (reference.name == NEED_TRUTH || reference.field.contains(NEEDS_TRUTH));
        match is_truth {
            true => checked.without_truth.push(sentence),
            false => checked.missing.push(sentence),
        }
    }
    Ok(checked)
}

/// Notes the panels of a tree: a panel's name, or two trees side by side.
fn place(tree: &Value, placed: &mut BTreeSet<String>) {
    match tree {
        Value::String(panel) => {
            placed.insert(panel.clone());
        }
        Value::Object(halves) => {
            for half in ["first", "second"]
                .iter()
                .filter_map(|half| halves.get(*half))
            {
                place(half, placed);
            }
        }
        _ => {}
    }
}

/// Whether one thing is there; says what is not.
pub(super) fn find(reference: &Reference, there: &There) -> Result<(), String> {
    let Reference {
        name,
        field,
        is_frame,
        ..
    } = reference;
    if *is_frame {
        let is_there = there.frames.contains(name);
        return is_there
            .then_some(())
            .ok_or_else(|| format!("the frame {name}, which no transform names"));
    }
    let topic = there
        .topics
        .get(name)
        .ok_or_else(|| format!("the topic {name}, which is not there"))?;
    if there.needs_messages && topic.message.is_none() {
        return Err(format!("the topic {name}, which has no message"));
    }
    let is_there = match (field.is_empty(), topic.encoding.as_str()) {
        (true, _) => true,
        (false, "protobuf") if field.starts_with("fields.") => has_cloud_field(topic, field),
        (false, "protobuf") => has_field(topic, field),
        (false, _) => has_key(topic, field),
    };
    is_there
        .then_some(())
        .ok_or_else(|| format!("{name}.{field}, and {} has no such field", topic.schema))
}

/// The names of a path's fields, without their indices.
fn names(path: &str) -> impl Iterator<Item = (&str, bool)> {
    path.split('.').map(|name| {
        let (name, index) = name.split_once('[').unwrap_or((name, ""));
        (name, !index.is_empty())
    })
}

/// Whether a protobuf schema has the field at this path.
fn has_field(topic: &Topic, path: &str) -> bool {
    let Ok(files) = FileDescriptorSet::decode(topic.data.as_slice()) else {
        return false;
    };
    let mut all: BTreeMap<String, &DescriptorProto> = BTreeMap::new();
    for file in &files.file {
        for message in &file.message_type {
            collect(&format!(".{}", file.package()), message, &mut all);
        }
    }
    let mut at = format!(".{}", topic.schema);
    for (name, is_indexed) in names(path) {
        let field = all.get(&at).and_then(|message| {
            let mut fields = message.field.iter();
            fields.find(|field| field.name() == name)
        });
        let Some(field) = field else { return false };
        if is_indexed && field.label() != Label::Repeated {
            return false;
        }
        at = field.type_name().to_owned();
    }
    true
}

/// Notes a message type and those within it by their full names.
fn collect<'a>(
    package: &str,
    message: &'a DescriptorProto,
    all: &mut BTreeMap<String, &'a DescriptorProto>,
) {
    let name = format!("{package}.{}", message.name());
    for nested in &message.nested_type {
        collect(&name, nested, all);
    }
    all.insert(name, message);
}

/// Whether the points of a cloud have this field, where there is a cloud to look at.
fn has_cloud_field(topic: &Topic, path: &str) -> bool {
    use foxglove::messages::PointCloud;
    let Some(message) = &topic.message else {
        return topic.schema == "foxglove.PointCloud";
    };
    let name = path.trim_start_matches("fields.");
    PointCloud::decode(message.as_slice())
        .is_ok_and(|cloud| cloud.fields.iter().any(|field| field.name == name))
}

/// Whether a JSON message, or without one its schema, has the key at this path.
fn has_key(topic: &Topic, path: &str) -> bool {
    if let Some(message) = &topic.message {
        let message: Value = serde_json::from_slice(message).unwrap_or_default();
        let mut at = Some(&message);
        for (name, is_indexed) in names(path) {
            at = at.and_then(|value| value.get(name));
            if is_indexed {
                at = at.and_then(|value| value.get(0));
            }
        }
        return at.is_some();
    }
    let schema: Value = serde_json::from_slice(&topic.data).unwrap_or_default();
    let mut at = Some(&schema);
    for (name, _) in names(path) {
        at = at.and_then(|value| {
            let named = value.get("properties").and_then(|p| p.get(name));
            named.or_else(|| value.get("additionalProperties"))
        });
    }
    at.is_some()
}
