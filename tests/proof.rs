//! Proofs: recordings that hold digests of what they do not hold, and become full ones again.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::BufWriter;
use std::path::Path;

use harness::{Ran, World, bytes_of, signal, wait_until};
use messages::record::{DIGESTS, Digest, Digests};
use messages::recording::Recording;
use serde_json::{Value, json};

const START: [&str; 2] = ["--set", "capture.start=1700000000000000000"];
const PROOF: [&str; 2] = ["--set", "record.keep=proof"];

/// Runs a graph and records it.
fn run(world: &World, source: &str, file: &str, more: &[&str]) -> Ran {
    let run = ["run", "--source", source, "--record", file];
    world.run(&[&run, &START[..], more].concat()).done()
}

/// A world with a proof of so many scans of a small scene, `p.mcap`.
fn proven(scans: &str) -> World {
    let world = World::new();
    let scene = world.small_scene("scene");
    let more = [&["--scans", scans][..], &PROOF].concat();
    run(&world, &scene.to_string_lossy(), "p.mcap", &more);
    world
}

/// A message as it stands in a file.
#[derive(Debug, PartialEq)]
struct Message {
    schema: String,
    publish_time: u64,
    data: Vec<u8>,
}

/// All messages by topic, scan and time; statistics without what the run took, and nothing that tells of its clock.
fn messages(path: &Path) -> BTreeMap<(String, u32, u64), Message> {
    let mut all = BTreeMap::new();
    let file = fs::read(path).unwrap();
    for message in mcap::MessageStream::new(&file).unwrap() {
        let message = message.unwrap();
        let topic = message.channel.topic.clone();
        if ["ledger", "health", "log"].contains(&&*topic) {
            continue;
        }
        let mut data = message.data.into_owned();
        if topic == "statistics" {
            let text = String::from_utf8(data).unwrap();
            let (before, _) = text.split_once("\"milliseconds\"").unwrap();
            data = before.as_bytes().to_vec();
        }
        let read = Message {
            schema: message.channel.schema.as_ref().unwrap().name.clone(),
            publish_time: message.publish_time,
            data,
        };
        all.insert((topic, message.sequence, message.log_time), read);
    }
    all
}

/// Whether two recordings hold the same messages.
#[track_caller]
fn assert_same(world: &World, one: &str, other: &str) {
    let [one, other] = [one, other].map(|name| messages(&world.path(name)));
    assert!(!one.is_empty() && one.keys().eq(other.keys()));
    for (key, message) in &one {
        assert!(message == &other[key], "{key:?} differs");
    }
}

/// Writes a recording anew, with what `message` makes of every message and `configuration` of its settings.
fn rewritten(
    world: &World,
    name: &str,
    message: &dyn Fn(&str, u32, &mut Vec<u8>),
    configuration: &dyn Fn(&mut Value),
) {
    let bytes = fs::read(world.path("p.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let file = BufWriter::new(fs::File::create(world.path(name)).unwrap());
    let mut out = mcap::Writer::new(file).unwrap();
    for index in &summary.metadata_indexes {
        let mut metadata = mcap::read::metadata(&bytes, index).unwrap();
        if let Some(text) = metadata.metadata.get_mut("configuration") {
            let mut value = serde_json::from_str(text).unwrap();
            configuration(&mut value);
            *text = value.to_string();
        }
        out.write_metadata(&metadata).unwrap();
    }
    for read in mcap::MessageStream::new(&bytes).unwrap() {
        let mut read = read.unwrap();
        let mut data = read.data.into_owned();
        message(&read.channel.topic, read.sequence, &mut data);
        read.data = data.into();
        out.write(&read).unwrap();
    }
    out.finish().unwrap();
}

/// A proof is not rehydrated: all of these are told, and nothing is left that could be taken for a recording.
#[track_caller]
fn assert_refused(world: &World, name: &str, told: &[&str]) {
    let ran = world.run(&["rehydrate", name, "-o", "full.mcap"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    for told in told {
        assert!(ran.err.contains(told), "{told}: {}", ran.err);
    }
    let files = fs::read_dir(world.path("")).unwrap();
    let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    let left: Vec<String> = names.filter(|name| name.contains("full")).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_proof_becomes_the_full_recording_of_the_same_run_message_by_message() {
    let world = proven("4");
    let scene = world.path("scene");
    run(
        &world,
        &scene.to_string_lossy(),
        "x.mcap",
        &["--scans", "4"],
    );
    let ran = world
        .run(&["rehydrate", "p.mcap", "-o", "full.mcap"])
        .done();
    assert!(ran.out.contains("4 scans computed anew"), "{}", ran.out);
    assert_same(&world, "x.mcap", "full.mcap");
    assert!(bytes_of(&world.path("p.mcap")) < bytes_of(&world.path("x.mcap")) / 10);

    let info = |name| world.run(&["info", name, "--json"]).done().json();
    let (full, proof) = (info("full.mcap"), info("p.mcap"));
    assert_eq!(
        (&full["proof"], &proof["proof"]),
        (&json!(false), &json!(true))
    );
    assert_eq!(full["configuration"]["record"]["keep"], "all");
    assert_eq!(full["ledger"], proof["ledger"]);
    for name in ["p.mcap", "full.mcap"] {
        world.run(&["info", name, "--check"]).done();
        world.run(&["replay", name, "--verify"]).done();
    }

    let again = world.run(&["rehydrate", "p.mcap", "-o", "full.mcap"]);
    assert_eq!(again.code, Some(2), "{again:?}");
    let none = world.run(&["rehydrate", "x.mcap", "-o", "y.mcap"]);
    assert_eq!(none.code, Some(2), "{none:?}");
    assert!(none.err.contains("x.mcap is no proof"), "{}", none.err);
}

#[test]
fn a_proof_holds_digests_of_all_topics_and_says_what_they_were_made_with() {
    let world = proven("2");
    let mut proof = Recording::open(&world.path("p.mcap")).unwrap();
    let read = proof.scan(1).unwrap();
    let digests = read.digests().unwrap().unwrap();
    let topics: BTreeSet<&str> = digests.messages.keys().map(String::as_str).collect();
    assert_eq!(topics.len(), 3 + 18 + 4, "{topics:?}");
    assert!(topics.contains("camera/left/image") && topics.contains("edges/right/0.8"));
    let settings: Vec<&str> = digests.settings.keys().map(String::as_str).collect();
    assert_eq!(
        settings,
        ["filter", "hough", "match", "rig", "track", "versions"]
    );
    let held: BTreeSet<&str> = read.messages().map(|(topic, _)| topic).collect();
    assert!(
        held.contains("disparity") && !held.contains("points") && !held.contains("matches/0.8")
    );
    assert_eq!(
        read.faults(proof.codec(), Some(&proof.settings_of(1))),
        [""; 0]
    );
}

#[test]
fn a_verified_proof_says_what_was_compared_by_digest() {
    let world = proven("3");
    let ran = world
        .run(&["replay", "p.mcap", "--verify", "--json"])
        .done();
    let verified = &ran.json()["verified"];
    // Of 22 topics only the disparity picture is there itself.
    assert_eq!(verified["equal"], true, "{verified}");
    assert_eq!(
        (&verified["compared"], &verified["by_digest"]),
        (&json!(66), &json!(63))
    );
    assert_eq!(verified["topics"]["edges/left/0.8"]["by_digest"], 3);
    assert!(verified["topics"]["disparity"]["by_digest"].is_null());
    let ran = world.run(&["replay", "p.mcap", "--verify"]).done();
    let told = "compared by their digests, since the recording is a proof: 63 messages of 21 topics, curves/centre/0.8, ";
    assert!(ran.out.contains(told), "{}", ran.out);

    let other = ["replay", "p.mcap", "--verify", "--set", "track.low=20"];
    let ran = world.run(&other);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    let told = "scan 0: its digest was ";
    assert!(ran.out.contains(told), "{}", ran.out);
}

#[test]
fn a_changed_image_digest_result_or_setting_is_named_and_nothing_is_written() {
    let world = proven("3");
    let as_it_is = |_: &mut Value| {};
    let nothing = |_: &str, _: u32, _: &mut Vec<u8>| {};
    for topic in ["camera/centre/image", "disparity"] {
        let change = |name: &str, scan: u32, data: &mut Vec<u8>| {
            if (name, scan) == (topic, 1) {
                let middle = data.len() / 2;
                data[middle] ^= 1;
            }
        };
        rewritten(&world, "bad.mcap", &change, &as_it_is);
        let told = format!("{topic} of scan 1 is not what its digest says");
        assert_refused(&world, "bad.mcap", &[&told]);
        for command in [
            ["replay", "bad.mcap", "--verify"],
            ["info", "bad.mcap", "--check"],
        ] {
            let ran = world.run(&command);
            assert!(ran.code != Some(0) && ran.err.contains(&told), "{ran:?}");
        }
    }

    let change = |name: &str, scan: u32, data: &mut Vec<u8>| {
        if (name, scan) == (DIGESTS, 2) {
            let mut digests = Digests::decode(data).unwrap();
            let digest = Digest::of_settings(&json!("another one"));
            digests
                .messages
                .insert("curves/left/2.2".to_owned(), digest);
            data.clear();
            digests.encode(1_700_000_000_200_000_000, data);
        }
    };
    rewritten(&world, "bad.mcap", &change, &as_it_is);
    let told = "curves/left/2.2 of scan 2 is not what was recorded: its digest is ";
    assert_refused(&world, "bad.mcap", &[told]);

    for (stage, key, told) in [
        (
            "track",
            "low",
            "the settings of track are not those that scan 0 was made with",
        ),
        (
            "match",
            "gap",
            "the settings of match are not those that scan 0 was made with",
        ),
        ("versions", "filter", "filter was version 7 and is 2 here"),
    ] {
        let change = |configuration: &mut Value| configuration[stage][key] = 7.into();
        rewritten(&world, "bad.mcap", &nothing, &change);
        assert_refused(&world, "bad.mcap", &[told]);
    }
    rewritten(&world, "same.mcap", &nothing, &as_it_is);
    world
        .run(&["rehydrate", "same.mcap", "-o", "full.mcap"])
        .done();
}

#[test]
fn settings_that_were_changed_on_the_way_hold_for_the_scans_they_held_for() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "1000000", "--record", "p.mcap",
    ];
    let child = world.start(&[&run, &PROOF[..]].concat());
    let is_long = |len| bytes_of(&world.path("p.mcap")) > len;
    wait_until("scans are recorded", || is_long(200_000));
    world.run(&["param", "set", "track.low=20"]).done();
    let len = bytes_of(&world.path("p.mcap"));
    wait_until("further scans are recorded", || is_long(len + 300_000));
    signal(child.id(), "INT");
    Ran::new(child.wait_with_output().unwrap()).done();
    let proof = Recording::open(&world.path("p.mcap")).unwrap();
    let from = proof.changes()[0].from;
    assert!(from > 0, "{:?}", proof.changes());
    let scans = format!("{}..{}", from - 1, from + 2);
    let arguments = ["rehydrate", "p.mcap", "--scans", &scans, "-o", "full.mcap"];
    world.run(&arguments).done();
    let ran = world
        .run(&["replay", "full.mcap", "--verify", "--json"])
        .done();
    assert_eq!(ran.json()["verified"]["scans"], 3, "{ran:?}");
}

#[test]
fn along_a_rail_a_proof_is_rehydrated_with_the_frames_that_others_depend_on() {
    let world = World::new();
    let source = world.small_rail("rail", 0..40);
    let source = source.to_string_lossy();
    let rail = ["--set", "capture.mode=rail", "--set", "map.window=4"];
    run(&world, &source, "x.mcap", &rail);
    run(&world, &source, "p.mcap", &[&rail[..], &PROOF].concat());
    world
        .run(&["rehydrate", "p.mcap", "-o", "full.mcap"])
        .done();
    assert_same(&world, "x.mcap", "full.mcap");
    let ran = world
        .run(&["replay", "p.mcap", "--verify", "--json"])
        .done();
    assert_eq!(
        ran.json()["verified"]["topics"]["map/growing"]["by_digest"],
        40
    );

    let [full, proof] = ["x.mcap", "p.mcap"].map(|name| {
        world.run(&["export", name, "--map", "map.ply"]).done();
        fs::read(world.path("map.ply")).unwrap()
    });
    assert!(full.len() > 1000 && full == proof);

    world
        .run(&[
            "rehydrate",
            "p.mcap",
            "--scans",
            "30..33",
            "-o",
            "part.mcap",
        ])
        .done();
    let whole = messages(&world.path("x.mcap"));
    let part = messages(&world.path("part.mcap"));
    let scans: BTreeSet<u32> = part.keys().map(|(_, scan, _)| *scan).collect();
    assert_eq!(scans, BTreeSet::from([30, 31, 32]));
    assert!(part.iter().all(|(key, message)| whole[key] == *message));

    world
        .run(&["filter", "p.mcap", "--scans", "20..40", "-o", "end.mcap"])
        .done();
    let ran = world.run(&["rehydrate", "end.mcap", "-o", "y.mcap"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    let told = "scan 20 depends on 18 frames before it, and not all of them are in the recording: it can be done of --scans 38..40";
    assert!(ran.err.contains(told), "{}", ran.err);
}

#[test]
fn what_is_made_of_a_proof_is_what_is_made_of_a_full_recording() {
    let world = proven("3");
    world.run(&["rehydrate", "p.mcap", "-o", "x.mcap"]).done();
    let exported = |name: &str, what: &[&str]| {
        let folder = format!("from-{name}");
        fs::create_dir_all(world.path(&folder)).unwrap();
        let place = |what: &str| format!("{folder}/{what}");
        let [csv, ply, pfm, png] = ["p.csv", "p.ply", "p.pfm", "png"].map(place);
        let scan = ["--scan", "1", "--ply", &ply, "--pfm", &pfm, "--png", &png];
        world.run(&["export", name, "--csv", &csv]).done();
        world.run(&[&["export", name][..], &scan].concat()).done();
        what.iter()
            .map(|file| fs::read(world.path(&place(file))).unwrap())
            .collect::<Vec<_>>()
    };
    let pictures = {
        exported("x.mcap", &[]);
        fs::read_dir(world.path("from-x.mcap/png")).unwrap()
    };
    let pictures = pictures.map(|file| format!("png/{}", file.unwrap().file_name().display()));
    let mut files = vec!["p.csv".to_owned(), "p.ply".to_owned(), "p.pfm".to_owned()];
    files.extend(pictures);
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    assert!(files.len() > 20);
    let [full, proof] = ["x.mcap", "p.mcap"].map(|name| exported(name, &files));
    for ((file, one), other) in files.iter().zip(&full).zip(&proof) {
        assert!(!one.is_empty() && one == other, "{file}");
    }
    let figures = |name: &str| {
        let page = format!("{name}.html");
        world.run(&["report", name, "-o", &page]).done();
        let page = fs::read_to_string(world.path(&page)).unwrap();
        page.matches("data:image/png").count()
    };
    let [full, proof] = ["x.mcap", "p.mcap"].map(figures);
    assert!(full > 10 && full == proof, "{full}, {proof}");
    world.run(&["view", "p.mcap", "--check"]).done();
}

#[test]
fn parts_of_a_proof_are_rehydrated_as_one_and_a_torn_one_as_far_as_it_goes() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let parts = ["--scans", "6", "--max-duration", "0.15"];
    let more = [&parts[..], &PROOF].concat();
    run(&world, &scene.to_string_lossy(), "p.mcap", &more);
    assert!(world.path("p.1.mcap").exists());
    world
        .run(&["rehydrate", "p.mcap", "-o", "full.mcap", "--force"])
        .done();
    let verified = |name| {
        let ran = world.run(&["replay", name, "--verify", "--json"]).done();
        ran.json()["verified"]["scans"].clone()
    };
    assert_eq!(verified("full.mcap"), 6);

    world.run(&["recover", "p.mcap", "-o", "one.mcap"]).done();
    let bytes = fs::read(world.path("one.mcap")).unwrap();
    fs::write(world.path("torn.mcap"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    let ran = world.run(&["rehydrate", "torn.mcap", "-o", "torn-full.mcap"]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    let scans = verified("torn-full.mcap").as_u64().unwrap();
    assert!((1..6).contains(&scans), "{scans}");
}

#[test]
fn a_rehydration_that_is_killed_or_ended_leaves_nothing_that_passes_for_a_whole_recording() {
    let world = proven("150");
    let child = world.start(&["rehydrate", "p.mcap", "-o", "full.mcap"]);
    let aside = world.path(".full.mcap.part/full.mcap");
    wait_until("scans are written", || bytes_of(&aside) > 1_000_000);
    signal(child.id(), "KILL");
    child.wait_with_output().unwrap();
    assert!(!world.path("full.mcap").exists());

    let child = world.start(&["rehydrate", "p.mcap", "-o", "other.mcap"]);
    let aside = world.path(".other.mcap.part/other.mcap");
    wait_until("scans are written", || bytes_of(&aside) > 1_000_000);
    signal(child.id(), "INT");
    let ran = Ran::new(child.wait_with_output().unwrap());
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(
        ran.err.contains("of 150 scans: nothing is written"),
        "{}",
        ran.err
    );
    assert!(!world.path("other.mcap").exists() && !aside.exists());
    // What the one that was killed left is in nobody's way.
    world
        .run(&["rehydrate", "p.mcap", "-o", "full.mcap"])
        .done();
}

#[test]
fn what_makes_no_sense_together_is_refused_with_the_way_out() {
    let world = World::recorded("2");
    let scene = world.path("scene");
    let scene = scene.to_string_lossy();
    let results =
        "record.without=['matches', 'disparity', 'points', 'map', 'growing', 'evaluation']";
    for (arguments, told) in [
        (
            vec![
                "run",
                "--source",
                &scene,
                PROOF[0],
                PROOF[1],
                "--set",
                "record.without=['image']",
            ],
            "record.keep = proof computes everything from the images, and they are left out",
        ),
        (
            vec!["replay", "x.mcap", "--record", "y.mcap", PROOF[0], PROOF[1]],
            "record.keep = proof computes everything from the images, and they are left out",
        ),
        (
            vec![
                "run",
                "--source",
                &scene,
                "--set",
                "record.keep=results",
                "--set",
                results,
            ],
            "record.keep = results keeps matches, disparities, points, map and evaluation, and there are none of them",
        ),
    ] {
        let ran = world.run(&arguments);
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(ran.err.contains(told), "{}", ran.err);
        assert_eq!(ran.err.lines().count(), 1, "{}", ran.err);
    }
    let more = [&["--scans", "2"][..], &PROOF].concat();
    run(&world, &scene, "p.mcap", &more);
    let ran = world.run(&["merge", "x.mcap", "p.mcap", "-o", "y.mcap"]);
    assert!(
        ran.code == Some(1) && ran.err.contains("rehydrate it first"),
        "{ran:?}"
    );
    let ran = world.run(&["replay", "p.mcap", "--from", "track"]);
    assert!(
        ran.err.contains("it can be replayed from capture, filter"),
        "{ran:?}"
    );
    let twice = ["merge", "p.mcap", "p.mcap", "-o", "two.mcap"];
    world.run(&twice).done();
    world
        .run(&["rehydrate", "two.mcap", "-o", "four.mcap"])
        .done();
}

#[test]
fn what_is_left_out_of_a_proof_is_left_out_of_its_full_recording_and_results_stand_alone() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let scene = scene.to_string_lossy();
    let without = [
        "--scans",
        "2",
        "--set",
        "record.without=['tables', 'curves']",
    ];
    run(&world, &scene, "x.mcap", &without);
    run(&world, &scene, "p.mcap", &[&without[..], &PROOF].concat());
    world
        .run(&["rehydrate", "p.mcap", "-o", "full.mcap"])
        .done();
    assert_same(&world, "x.mcap", "full.mcap");

    let results = ["--scans", "2", "--set", "record.keep=results"];
    run(&world, &scene, "r.mcap", &results);
    let topics: BTreeSet<String> = messages(&world.path("r.mcap"))
        .into_keys()
        .map(|(topic, ..)| topic)
        .collect();
    assert!(topics.contains("points") && topics.contains("disparity/picture"));
    assert!(
        !topics
            .iter()
            .any(|topic| topic.contains("image") || topic.starts_with("edges"))
    );
    let points = [
        "export", "r.mcap", "--scan", "1", "--ply", "r.ply", "--csv", "r.csv",
    ];
    world.run(&points).done();
}
