//! The layout that shows a run or a recording in a viewer, and the check that it has all that the layout names.
//!
//! ```text
//! layout.json ─► its views and channels ─► what is there ─► what to look at ─► the viewer's own names
//! ```

mod check;
mod focus;
mod rerun;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use clap::ValueEnum;
use messages::record::{Codec, WHOLE};
use messages::{Kind, Rail, Rig, Size, Topic as DataTopic};
use serde_json::{Value, json};

use check::check;
pub(crate) use check::{Checked, There};
pub(crate) use focus::Focus;

/// The layout of a default run, as Foxglove imports it.
const DEFAULT: &str = include_str!("layout.json");

/// What it shows of the finest channel: where fields are named behind a dot, a name with a dot of its own stands in quotes.
const FINEST: &str = r#"\"matches/0.8\""#;

/// The layout, as Foxglove imports it: of a run whose messages are written so, or of a default one.
pub(crate) fn layout(codec: Option<&Codec>) -> String {
    let matches = codec.and_then(|codec| DataTopic::of(codec.rig(), Kind::Matches).pop());
    let layout = match matches {
        Some(topic) if topic.name.contains('.') => {
            DEFAULT.replace(FINEST, &format!("\\\"{}\\\"", topic.name))
        }
        Some(topic) => DEFAULT.replace(FINEST, &topic.name),
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
    // The image has the largest one's place.
    let panels = layout.get_mut("configById")?.as_object_mut()?;
    panels.remove("Image!right");
    let mut image = panels.remove("Image!centre")?;
    image["foxglovePanelTitle"] = json!(Rail::VIEW);
    panels.insert("Image!left".to_owned(), image);
    // Few rails have a truth: the time to fuse points is told in place of the time to judge them.
    let latency = panels.get_mut("Plot!latency")?;
    let judging = latency.get_mut("paths")?.as_array_mut()?.last_mut()?;
    judging["value"] = json!("statistics.milliseconds.map");
    judging["label"] = json!("map");
    let states = panels.get_mut("StateTransitions!nodes")?;
    let paths = states.get_mut("paths")?.as_array_mut()?;
    let judging = paths.iter_mut().find(|path| path["label"] == "evaluate")?;
    judging["value"] = json!("health.nodes.map.state");
    judging["label"] = json!("map");
    let space = panels.get_mut("3D!space")?;
    let topics = space.get_mut("topics")?.as_object_mut()?;
    topics
        .retain(|name, _| !name.starts_with("camera/left/") && !name.starts_with("camera/right/"));
    let settled = Kind::Map.name();
    for topic in [WHOLE, settled, Kind::Growing.name()] {
        // What is settled comes once, and is to be seen as long as anybody looks.
        let seconds = if topic == settled { 1_000_000 } else { 0 };
        let shown = json!({
            "visible": true, "colorField": "disparity", "colorMode": "colormap", "colorMap": "turbo", "pointSize": 2,
            "decayTime": seconds,
        });
        topics.insert(topic.to_owned(), shown);
    }
    // The same once more, by how well distances are known.
    let mut deviation = space.clone();
    deviation["foxglovePanelTitle"] = json!("map by its standard deviation");
    let topics = deviation.get_mut("topics")?.as_object_mut()?;
    topics.retain(|name, _| name != Kind::Points.name());
    for shown in topics
        .values_mut()
        .filter(|shown| shown.get("colorField").is_some())
    {
        shown["colorField"] = json!("sigma");
    }
    panels.insert("3D!deviation".to_owned(), deviation);
    let tabs = json!({ "activeTabIdx": 0, "tabs": [
        { "title": "points in space", "layout": "3D!space" },
        { "title": "standard deviation", "layout": "3D!deviation" },
    ] });
    panels.insert("Tab!space".to_owned(), tabs);
    let text = serde_json::to_string(layout.get("layout")?).ok()?;
    layout["layout"] = serde_json::from_str(&text.replace("3D!space", "Tab!space")).ok()?;
    keep(&mut layout, |_| true);
    serde_json::to_string_pretty(&layout).ok()
}

/// Who reads the layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Viewer {
    /// Foxglove, in the browser or on the desktop
    #[default]
    Foxglove,
    /// Lichtblick, which took Foxglove's open part further
    Lichtblick,
    /// Rerun, whose layout is a script in Python
    Rerun,
}

/// The panels that layouts have, as Foxglove calls them and as Lichtblick does.
const PANELS: [(&str, &str); 9] = [
    ("3D", "3D"),
    ("Image", "Image"),
    ("Log", "RosOut"),
    ("Parameters", "Parameters"),
    ("Plot", "Plot"),
    ("RawMessages", "RawMessages"),
    ("StateTransitions", "StateTransitions"),
    ("Tab", "Tab"),
    ("Table", "Table"),
];

/// The key of a panel's title, likewise.
const TITLE: (&str, &str) = ("foxglovePanelTitle", "lichtblickPanelTitle");

/// Panels of what only a running graph tells, or tells well.
const OF_GRAPHS: [&str; 2] = ["Parameters!", "Plot!speed"];

fn is_of_graphs(panel: &str) -> bool {
    OF_GRAPHS.iter().any(|name| panel.starts_with(name))
}

/// Panels whose topics a recording has where it was asked for them.
const ASKED_FOR: [&str; 2] = ["Image!error", "Image!confidence"];

/// Panels of what changes from scan to scan, and …
const OF_SCANS: [&str; 2] = ["Plot!found", "Plot!latency"];
/// … of a single scan, the first of which is worth its place beside those too.
const OF_A_SCAN: [&str; 2] = ["Plot!disparities", "Plot!surest"];
/// Fewer scans make no curve.
const FEW: usize = 5;

/// Whether there is room for a panel beside the others: of so many scans, of a graph without end.
fn has_room(panel: &str, scans: Option<usize>) -> bool {
    match scans {
        None => !OF_A_SCAN.contains(&panel),
        Some(scans) if scans < FEW => !OF_SCANS.contains(&panel),
        Some(_) => panel != OF_A_SCAN[1],
    }
}

impl Viewer {
    /// Its own one of the two names of a thing.
    fn own(self, (foxglove, lichtblick): (&'static str, &'static str)) -> &'static str {
        match self {
            Self::Foxglove | Self::Rerun => foxglove,
            Self::Lichtblick => lichtblick,
        }
    }

    /// Whether it has panels of this type.
    fn has(self, panel: &str) -> bool {
        PANELS.iter().any(|names| self.own(*names) == panel)
    }

    /// A layout as it reads it, made from the one that Foxglove reads.
    fn named(self, layout: &str) -> String {
        let titled = layout.replace(
            &format!("\"{}\"", TITLE.0),
            &format!("\"{}\"", self.own(TITLE)),
        );
        PANELS.iter().fold(titled, |layout, names| {
            let own = self.own(*names);
            layout.replace(&format!("\"{}!", names.0), &format!("\"{own}!"))
        })
    }
}

/// What a layout is made of, besides what is there.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wanted<'a> {
    /// How messages are written.
    pub(crate) codec: Option<&'a Codec>,
    /// Of a recording, what it has: panels that stay empty are left out.
    pub(crate) recording: Option<&'a There>,
    /// Where to look.
    pub(crate) focus: Option<&'a Focus>,
    /// The file that a script opens.
    pub(crate) file: Option<&'a Path>,
    pub(crate) viewer: Viewer,
}

impl Wanted<'_> {
    /// The layout, to be imported by the viewer.
    pub(crate) fn layout(&self) -> String {
        if self.viewer == Viewer::Rerun {
            let default = Codec::new(Rig::of_views(3, &[], Size::default()), 0);
            return rerun::script(self.codec.unwrap_or(&default), self.focus, self.file);
        }
        let text = layout(self.codec);
        let made = serde_json::from_str(&text).ok().and_then(|mut layout| {
            let scans = self.recording.map(|there| there.scans);
            keep(&mut layout, |panel| has_room(panel, scans));
            if let Some(there) = self.recording {
                fit(&mut layout, there);
            }
            if let Some(focus) = self.focus {
                focus.apply(&mut layout);
            }
            serde_json::to_string_pretty(&layout).ok()
        });
        self.viewer.named(&made.unwrap_or(text)) + "\n"
    }
}

/// Whether all is there that this layout, or without one the viewer's own, shows.
pub(crate) fn checked(
    own: Option<&str>,
    codec: &Codec,
    there: &There,
    viewer: Viewer,
) -> Result<Checked, String> {
    match own {
        None if viewer == Viewer::Rerun => Ok(check::topics(&rerun::topics(codec), there)),
        Some(_) if viewer == Viewer::Rerun => Err(
            "a script for Rerun cannot be checked, only layouts of Foxglove and Lichtblick"
                .to_owned(),
        ),
        Some(layout) => check(layout, there, viewer),
        None => {
            let wanted = Wanted {
                codec: Some(codec),
                viewer,
                ..Wanted::default()
            };
            check(&wanted.layout(), there, viewer)
        }
    }
}

/// Takes out what a recording does not have, and panels that nothing is left of.
fn fit(layout: &mut Value, there: &There) {
    let Some(panels) = layout.get_mut("configById").and_then(Value::as_object_mut) else {
        return;
    };
    for (panel, config) in panels.iter_mut() {
        let missing = |name: &str, field: &str| !check::is_there(panel, (name, field), there);
        if let Some(paths) = config.get_mut("paths").and_then(Value::as_array_mut) {
            paths.retain(|path| {
                let path = path
                    .get("value")
                    .and_then(Value::as_str)
                    .unwrap_or_default();
                let (name, field) = check::parted(path);
                !missing(name, field)
            });
        }
        if let Some(topics) = config.get_mut("topics").and_then(Value::as_object_mut) {
            topics.retain(|name, _| !missing(name, ""));
        }
    }
    let shown: BTreeSet<String> = check::references_of(panels)
        .into_iter()
        .filter(|reference| check::find(reference, there).is_ok())
        .map(|reference| reference.panel)
        .collect();
    keep(layout, |panel| {
        panel.starts_with("Tab!") || shown.contains(panel) && !is_of_graphs(panel)
    });
}

/// Keeps some of the panels, and those of the others that hold them: of tabs those that show something, and one alone takes
/// their place.
fn keep(layout: &mut Value, is_kept: impl Fn(&str) -> bool) {
    let Some(panels) = layout.get_mut("configById").and_then(Value::as_object_mut) else {
        return;
    };
    panels.retain(|panel, _| is_kept(panel));
    let left: BTreeSet<String> = panels.keys().cloned().collect();
    let mut alone = BTreeMap::new();
    for (panel, config) in panels.iter_mut() {
        let Some(tabs) = config.get_mut("tabs").and_then(Value::as_array_mut) else {
            continue;
        };
        tabs.retain_mut(|tab| {
            let tree = tab.get_mut("layout").map(Value::take);
            let tree = tree.and_then(|tree| pruned(tree, &left));
            let is_left = tree.is_some();
            tab["layout"] = tree.unwrap_or_default();
            is_left
        });
        if let [] | [_] = &tabs[..] {
            let only = tabs.pop().map(|mut tab| tab["layout"].take());
            alone.insert(panel.clone(), only);
        }
    }
    panels.retain(|panel, _| !alone.contains_key(panel));
    let left: BTreeSet<String> = panels.keys().cloned().collect();
    if let Some(tree) = layout.get_mut("layout") {
        let replaced = replaced(tree.take(), &alone);
        *tree = pruned(replaced, &left).unwrap_or_default();
    }
    // Panels that have no place any more.
    let text = layout
        .get("layout")
        .map(Value::to_string)
        .unwrap_or_default();
    if let Some(panels) = layout.get_mut("configById").and_then(Value::as_object_mut) {
        let tabs: String = panels
            .values()
            .filter_map(|config| config.get("tabs"))
            .map(Value::to_string)
            .collect();
        let has_place = |panel: &String| {
            let quoted = format!("\"{panel}\"");
            text.contains(&quoted) || tabs.contains(&quoted)
        };
        panels.retain(|panel, _| has_place(panel));
    }
}

/// The tree with what stands alone in its tabs in place of them.
fn replaced(mut tree: Value, alone: &BTreeMap<String, Option<Value>>) -> Value {
    match &tree {
        Value::String(panel) => match alone.get(panel) {
            Some(only) => only.clone().unwrap_or_default(),
            None => tree,
        },
        _ => {
            for side in ["first", "second"] {
                if let Some(part) = tree.get_mut(side) {
                    *part = replaced(part.take(), alone);
                }
            }
            tree
        }
    }
}

/// The tree of a layout's panels with those only that are left: what stood beside one that is gone takes its place.
fn pruned(mut tree: Value, left: &BTreeSet<String>) -> Option<Value> {
    if let Value::String(panel) = &tree {
        return left.contains(panel).then_some(tree);
    }
    let [first, second] = ["first", "second"].map(|side| pruned(tree.get_mut(side)?.take(), left));
    match (first, second) {
        (Some(first), Some(second)) => {
            tree["first"] = first;
            tree["second"] = second;
            Some(tree)
        }
        (one, other) => one.or(other),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use messages::record::Shown;

    /// What a default run has, as far as schemas tell.
    fn default_run() -> There {
        run_of(&[2.2, 0.8]).0
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
        let codec = Codec::new(Rig::of_views(7, &[2.2, 0.8], Size::new(64, 48)), 4);
        let there = There::promised(&codec, codec.channels(Shown::ALL));
        let layout = layout(Some(&codec));
        assert_eq!(
            check(&layout, &there, Viewer::Foxglove).unwrap().missing,
            [""; 0]
        );
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
        let checked = check(&layout, &there, Viewer::Foxglove).unwrap();
        assert_eq!(checked.missing, Vec::<String>::new());
        assert!(layout.contains("camera/moving/annotations"), "{layout}");
        assert!(layout.contains("map/growing"), "{layout}");
        let value: Value = serde_json::from_str(&layout).unwrap();
        for panel in value["configById"].as_object().unwrap().keys() {
            let named = layout.matches(&format!("\"{panel}\"")).count();
            assert_eq!(named, 2, "{panel} has a place");
        }
    }

    #[test]
    fn a_run_with_other_channels_has_all_that_its_own_layout_names() {
        let (there, codec) = run_of(&[30.0, 20.5]);
        assert_eq!(
            check(DEFAULT, &there, Viewer::Foxglove)
                .unwrap()
                .missing
                .len(),
            1
        );
        let layout = layout(Some(&codec));
        assert!(layout.contains(r#""\"matches/20.5\".matches""#), "{layout}");
        assert_eq!(
            check(&layout, &there, Viewer::Foxglove).unwrap().missing,
            Vec::<String>::new()
        );
    }

    #[test]
    fn a_default_run_has_all_that_the_layout_names() {
        let checked = check(DEFAULT, &default_run(), Viewer::Foxglove).unwrap();
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
                "curve[:].bad_one",
                "curves[:].bad_one",
                "evaluation.curves[:].bad_one",
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
            let missing = check(&layout, &default_run(), Viewer::Foxglove)
                .unwrap()
                .missing;
            assert_eq!(missing.len(), 1, "{missing:?}");
            assert!(missing[0].contains(expected), "{missing:?}");
        }
    }

    #[test]
    fn every_viewer_has_all_panels_of_its_own_layout_and_not_those_of_the_others() {
        for viewer in &[Viewer::Foxglove, Viewer::Lichtblick] {
            let wanted = Wanted {
                viewer: *viewer,
                ..Wanted::default()
            };
            let layout = wanted.layout();
            let missing = check(&layout, &default_run(), *viewer).unwrap().missing;
            assert_eq!(missing, Vec::<String>::new(), "{viewer:?}");
        }
        let missing = check(DEFAULT, &default_run(), Viewer::Lichtblick).unwrap();
        let [sentence] = &missing.missing[..] else {
            panic!("{missing:?}");
        };
        assert!(
            sentence.contains("Log!log") && sentence.contains("Lichtblick"),
            "{sentence}"
        );
    }

    #[test]
    fn the_script_for_rerun_names_what_is_there_and_has_no_place_left_open() {
        let rail = Rig::of_rail(Rail::default(), &[4.0, 1.5], Size::new(64, 48));
        for codec in [run_of(&[4.0]).1, Codec::new(rail, 0)] {
            let there = There::promised(&codec, codec.channels(Shown::ALL));
            let made = checked(None, &codec, &there, Viewer::Rerun).unwrap();
            assert_eq!(made.missing, Vec::<String>::new());
            let wanted = Wanted {
                codec: Some(&codec),
                file: Some(Path::new("a \"b\" {{c}} é.mcap")),
                viewer: Viewer::Rerun,
                ..Wanted::default()
            };
            let script = wanted.layout();
            let recording = r#"RECORDING = "a \"b\" {{c}} é.mcap""#;
            assert!(script.contains(recording), "{script}");
            assert!(!script.contains('@'), "{script}");
        }
        let nothing = checked(None, &run_of(&[4.0]).1, &There::default(), Viewer::Rerun).unwrap();
        assert!(nothing.missing.len() > 6, "{nothing:?}");
    }

    #[test]
    fn a_panel_that_shows_nothing_is_named() {
        let layout = DEFAULT.replace("\"topicToRender\": \"log\"", "\"topicToRender\": null");
        let missing = check(&layout, &default_run(), Viewer::Foxglove)
            .unwrap()
            .missing;
        assert_eq!(missing, ["Log!log shows nothing"]);
    }

    #[test]
    fn of_a_recording_without_truth_and_health_the_layout_has_no_panel_that_stays_empty() {
        let mut there = default_run();
        for topic in ["evaluation", "health"] {
            there.topics.remove(topic);
        }
        let wanted = Wanted {
            recording: Some(&there),
            ..Wanted::default()
        };
        let layout = wanted.layout();
        let checked = check(&layout, &there, Viewer::Foxglove).unwrap();
        assert_eq!(checked.missing, Vec::<String>::new());
        let value: Value = serde_json::from_str(&layout).unwrap();
        let panels = value["configById"].as_object().unwrap();
        for gone in [
            "Plot!accuracy",
            "Plot!speed",
            "StateTransitions!nodes",
            "Parameters!set",
        ] {
            assert!(
                !panels.contains_key(gone) && !layout.contains(gone),
                "{gone}"
            );
        }
        for panel in panels.keys() {
            assert_eq!(
                layout.matches(&format!("\"{panel}\"")).count(),
                2,
                "{panel}"
            );
        }
    }

    #[test]
    fn a_source_without_truth_lacks_nothing_else() {
        let mut there = default_run();
        there.topics.remove("evaluation");
        let checked = check(DEFAULT, &there, Viewer::Foxglove).unwrap();
        assert_eq!(checked.missing, Vec::<String>::new());
        assert_eq!(checked.without_truth.len(), 3);
    }

    #[test]
    fn a_topic_without_messages_is_missing_where_messages_are_needed() {
        let mut there = default_run();
        there.needs_messages = true;
        assert!(
            check(DEFAULT, &there, Viewer::Foxglove)
                .unwrap()
                .missing
                .len()
                > 30
        );
    }
}
