//! The layout that shows a default run in Foxglove, and the check that a recording or a running graph has all it names.

use std::collections::{BTreeMap, BTreeSet};

use messages::record::{Channel, Codec};
use messages::{Kind, Rail, Topic as DataTopic};
use prost::Message as _;
use prost_types::field_descriptor_proto::Label;
use prost_types::{DescriptorProto, FileDescriptorSet};
use serde::Serialize;
use serde_json::{Value, json};

/// The layout of a default run, as Foxglove imports it.
const DEFAULT: &str = include_str!("layout.json");

/// What it shows of the finest channel.
const FINEST: &str = "\"matches/1\"";

/// The layout, as Foxglove imports it: of a run whose messages are written so, or of a default one.
pub(crate) fn layout(codec: Option<&Codec>) -> String {
    let matches = codec.and_then(|codec| DataTopic::of(codec.rig(), Kind::Matches).pop());
    let layout = match matches {
        // Where fields are named behind a dot, a name with a dot of its own stands in quotes.
        Some(topic) if topic.name.contains('.') => {
            DEFAULT.replace(FINEST, &format!("\"\\\"{}\\\"\"", topic.name))
        }
        Some(topic) => DEFAULT.replace(FINEST, &format!("\"{}\"", topic.name)),
        None => DEFAULT.to_owned(),
    };
    match codec {
        Some(codec) if codec.rig().rail.is_some() => along_a_rail(&layout).unwrap_or(layout),
        Some(codec) => of_views(layout, codec),
        None => layout,
    }
}

/// The layout for a rig whose views are called otherwise: of more than three it shows those whose curves matches name.
fn of_views(layout: String, codec: &Codec) -> String {
    let named = codec.rig().named(codec.reference());
    let names = named.map(|view| codec.rig().views.get(view).map(|view| &view.name));
    let shown = ["left", "centre", "right"].into_iter().zip(names);
    shown.fold(layout, |layout, (shown, name)| match name {
        Some(name) if name != shown => layout
            .replace(&format!("camera/{shown}/"), &format!("camera/{name}/"))
            .replace(
                &format!("\"foxglovePanelTitle\": \"{shown}\""),
                &format!("\"foxglovePanelTitle\": \"view {name}\""),
            ),
        _ => layout,
    })
}

/// The layout for one camera that moves: one image in place of three, and the map, which stays, in space.
fn along_a_rail(layout: &str) -> Option<String> {
    let moving = format!("camera/{}/", Rail::VIEW);
    let mut layout: Value =
        serde_json::from_str(&layout.replace("camera/centre/", &moving)).ok()?;
    *layout.pointer_mut("/layout/first/first")? = json!("Image!centre");
    let panels = layout.get_mut("configById")?.as_object_mut()?;
    panels.retain(|name, _| !["Image!left", "Image!right"].contains(&name.as_str()));
    panels.get_mut("Image!centre")?["foxglovePanelTitle"] = json!(Rail::VIEW);
    let topics = panels.get_mut("3D!space")?.get_mut("topics")?;
    let topics = topics.as_object_mut()?;
    topics
        .retain(|name, _| !name.starts_with("camera/left/") && !name.starts_with("camera/right/"));
    let [settled, growing] = [Kind::Map, Kind::Growing].map(Kind::name);
    // What is settled comes once: it is to be seen as long as anybody looks.
    for (topic, seconds) in [(settled, 1_000_000), (growing, 0)] {
        let shown = json!({
            "visible": true, "colorField": "disparity", "colorMode": "colormap", "colorMap": "turbo", "pointSize": 2,
            "decayTime": seconds,
        });
        topics.insert(topic.to_owned(), shown);
    }
    serde_json::to_string_pretty(&layout).ok()
}

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

/// Everything that the layout's panels name.
pub(crate) fn references(layout: &str) -> Result<Vec<Reference>, String> {
    let layout: Value = serde_json::from_str(layout).map_err(|e| format!("the layout: {e}"))?;
    let panels = layout.get("configById").and_then(Value::as_object);
    let panels = panels.ok_or("the layout has no panels")?;
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
        for path in paths.chain(text("/topicPath")) {
            let quoted = path.strip_prefix('"').and_then(|rest| rest.split_once('"'));
            let (topic, field) = match quoted {
                Some((topic, field)) => (topic, field.trim_start_matches('.')),
                None => path.split_once('.').unwrap_or((path, "")),
            };
            add(topic, field, false);
        }
    }
    Ok(references)
}

/// Whether all that the layout names is there.
pub(crate) fn check(layout: &str, there: &There) -> Result<Checked, String> {
    let references = references(layout)?;
    let panels: BTreeSet<&str> = references.iter().map(|r| r.panel.as_str()).collect();
    let mut checked = Checked {
        panels: panels.len(),
        references: references.len(),
        ..Checked::default()
    };
    for reference in &references {
        let Err(what) = find(reference, there) else {
            continue;
        };
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

/// Whether one thing is there; says what is not.
fn find(reference: &Reference, there: &There) -> Result<(), String> {
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

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use messages::record::Shown;
    use messages::{Rig, Size};

    /// What a default run has, as far as schemas tell.
    fn default_run() -> There {
        run_of(&[4.0, 2.0, 1.0]).0
    }

    /// What a run with these channels has, and how it is written.
    fn run_of(channels: &[f32]) -> (There, Codec) {
        let rig = Rig::of_views(3, channels, Size::new(64, 48));
        let codec = Codec::new(rig, 0);
        let there = There::promised(&codec, codec.channels(Shown::ALL));
        (there, codec)
    }

    #[test]
    fn of_seven_views_those_are_shown_whose_curves_matches_name() {
        let codec = Codec::new(Rig::of_views(7, &[4.0, 2.0, 1.0], Size::new(64, 48)), 4);
        let there = There::promised(&codec, codec.channels(Shown::ALL));
        let layout = layout(Some(&codec));
        assert_eq!(check(&layout, &there).unwrap().missing, [""; 0]);
        for view in 0..7 {
            let is_shown = layout.contains(&format!("camera/{view}/image"));
            assert_eq!(is_shown, (3..=5).contains(&view), "view {view}");
        }
    }

    #[test]
    fn a_rail_has_all_that_its_own_layout_names() {
        let rig = Rig::of_rail(Rail::default(), &[4.0, 1.5], Size::new(64, 48));
        let codec = Codec::new(rig, 0);
        let there = There::promised(&codec, codec.channels(Shown::ALL));
        let layout = layout(Some(&codec));
        let checked = check(&layout, &there).unwrap();
        assert_eq!(checked.missing, Vec::<String>::new());
        assert!(layout.contains("camera/moving/annotations"), "{layout}");
        assert!(layout.contains("map/growing"), "{layout}");
    }

    #[test]
    fn a_run_with_other_channels_has_all_that_its_own_layout_names() {
        let (there, codec) = run_of(&[30.0, 20.5]);
        assert_eq!(check(DEFAULT, &there).unwrap().missing.len(), 1);
        let layout = layout(Some(&codec));
        assert!(layout.contains(r#""\"matches/20.5\"""#), "{layout}");
        assert_eq!(
            check(&layout, &there).unwrap().missing,
            Vec::<String>::new()
        );
    }

    #[test]
    fn a_default_run_has_all_that_the_layout_names() {
        let checked = check(DEFAULT, &default_run()).unwrap();
        assert_eq!(checked.missing, Vec::<String>::new());
        assert!(
            checked.panels >= 12 && checked.references > 35,
            "{checked:?}"
        );
    }

    #[test]
    fn a_topic_a_field_or_a_frame_that_is_not_there_is_named_with_its_panel() {
        for (from, to, expected) in [
            ("health.under_way", "health.undr_way", "health.undr_way"),
            (
                "scores[0].coverage",
                "scores[0].cover",
                "evaluation.scores[0].cover",
            ),
            (
                "scores[0].bad_one",
                "scan[0].bad_one",
                "evaluation.scan[0].bad_one",
            ),
            (
                "\"disparity/picture\"",
                "\"disparity/pictures\"",
                "disparity/pictures",
            ),
            (
                "\"followTf\": \"world\"",
                "\"followTf\": \"map\"",
                "the frame map",
            ),
            (
                "statistics.milliseconds.hough",
                "statistics.milliseconds.hugh",
                "hugh",
            ),
        ] {
            let layout = DEFAULT.replace(from, to);
            assert_ne!(layout, DEFAULT, "{from}");
            let missing = check(&layout, &default_run()).unwrap().missing;
            assert_eq!(missing.len(), 1, "{missing:?}");
            assert!(missing[0].contains(expected), "{missing:?}");
        }
    }

    #[test]
    fn a_source_without_truth_lacks_nothing_else() {
        let mut there = default_run();
        there.topics.remove("evaluation");
        let checked = check(DEFAULT, &there).unwrap();
        assert_eq!(checked.missing, Vec::<String>::new());
        assert_eq!(checked.without_truth.len(), 3);
    }

    #[test]
    fn a_topic_without_messages_is_missing_where_messages_are_needed() {
        let mut there = default_run();
        there.needs_messages = true;
        assert!(check(DEFAULT, &there).unwrap().missing.len() > 30);
    }
}
