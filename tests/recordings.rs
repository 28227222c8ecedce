//! Recordings made from recordings: recovered, split, merged, filtered, checked.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::path::Path;

use harness::{World, signal, wait_until};

/// A world with a recording of so many scans of a small scene.
#[track_caller]
fn verifies(world: &World, name: &str, scans: u64) {
    verifies_but(world, name, scans, 0);
}

/// So many whole scans are verified; where others are not whole, that is told by the exit code.
#[track_caller]
fn verifies_but(world: &World, name: &str, scans: u64, others: u64) {
    let ran = world.run(&["replay", name, "--verify", "--json"]);
    assert_eq!(ran.code, Some(if others == 0 { 0 } else { 3 }), "{ran:?}");
    let verified = &ran.json()["verified"];
    assert_eq!(
        (&verified["equal"], &verified["scans"]),
        (&true.into(), &scans.into())
    );
}

#[test]
fn what_is_recovered_of_a_truncated_recording_verifies_wherever_it_was_cut() {
    let world = World::recorded("4");
    let bytes = std::fs::read(world.path("x.mcap")).unwrap();
    let mut whole_seen = Vec::new();
    for cut in (1..=20).map(|k| bytes.len() * k / 20 - 13 * k) {
        std::fs::write(world.path("cut.mcap"), &bytes[..cut]).unwrap();
        let ran = world.run(&["recover", "cut.mcap", "-o", "y.mcap", "--force", "--json"]);
        if ran.code == Some(1) {
            assert!(
                ran.err.contains("no scan is left") || ran.err.contains("is empty"),
                "{ran:?}"
            );
            continue;
        }
        assert_eq!(ran.code, Some(3), "cut at {cut}: {ran:?}");
        let report = ran.json();
        let whole = report["whole"].as_u64().unwrap();
        assert!(report["unreadable_bytes"].as_u64() > Some(0), "{report}");
        if whole > 0 {
            let scans = report["scans"].as_u64().unwrap();
            verifies_but(&world, "y.mcap", whole, scans - whole);
        }
        whole_seen.push(whole);
        assert_eq!(
            std::fs::read(world.path("cut.mcap")).unwrap().len(),
            cut,
            "the input is only read"
        );
    }
    assert!(
        whole_seen.is_sorted() && whole_seen.last() >= Some(&3),
        "{whole_seen:?}"
    );
}

#[test]
fn a_damaged_chunk_costs_its_scan_and_no_other() {
    // A scan is of several chunks, of which one is damaged.
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "5", "--record", "x.mcap",
    ];
    let small = ["--set", "record.chunk_bytes=65536"];
    world.run(&[&run[..], &small].concat()).done();
    let mut bytes = std::fs::read(world.path("x.mcap")).unwrap();
    let middle = bytes.len() / 2;
    for byte in &mut bytes[middle..middle + 64] {
        *byte ^= 0x5a;
    }
    std::fs::write(world.path("bad.mcap"), &bytes).unwrap();
    let check = world.run(&["info", "bad.mcap", "--check"]);
    assert_eq!(check.code, Some(3), "{check:?}");
    assert!(check.err.contains("bytes are damaged"), "{check:?}");
    let ran = world.run(&["recover", "bad.mcap", "-o", "y.mcap", "--json"]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert_eq!(ran.json()["whole"], 4, "{ran:?}");
    verifies_but(&world, "y.mcap", 4, 1);
    let check = world.run(&["info", "y.mcap", "--check"]);
    assert_eq!(check.code, Some(3), "{check:?}");
}

#[test]
fn a_whole_recording_is_recovered_as_it_is() {
    let world = World::recorded("3");
    world.run(&["recover", "x.mcap", "-o", "y.mcap"]).done();
    verifies(&world, "y.mcap", 3);
    world.run(&["info", "y.mcap", "--check"]).done();
    let [one, other] =
        ["x.mcap", "y.mcap"].map(|name| world.run(&["export", name, "--csv", "-"]).done().out);
    assert!(one.len() > 1000 && one == other);
}

#[test]
fn parts_are_read_as_one_and_merge_into_one() {
    let world = World::recorded("6");
    world
        .run(&["split", "x.mcap", "--scans", "2", "-o", "s.mcap"])
        .done();
    for part in ["s.mcap", "s.1.mcap", "s.2.mcap"] {
        assert!(world.path(part).exists(), "{part}");
    }
    verifies(&world, "s.mcap", 6);
    world.run(&["info", "s.mcap", "--check"]).done();
    world.run(&["recover", "s.mcap", "-o", "one.mcap"]).done();
    verifies(&world, "one.mcap", 6);

    world
        .run(&["merge", "x.mcap", "s.mcap", "-o", "both.mcap"])
        .done();
    verifies(&world, "both.mcap", 12);
    let info = world.run(&["info", "both.mcap", "--json"]).done().json();
    assert_eq!(info["scans"]["missing"], serde_json::json!([]), "{info}");

    std::fs::remove_file(world.path("s.1.mcap")).unwrap();
    let check = world.run(&["info", "s.mcap", "--check"]);
    assert_eq!(check.code, Some(3), "{check:?}");
    assert!(check.err.contains("s.1.mcap is missing"), "{}", check.err);
}

#[test]
fn a_filter_keeps_what_is_wanted_and_what_puts_it_in_its_place() {
    let world = World::recorded("4");
    let arguments = [
        "filter",
        "x.mcap",
        "--topics",
        "points,edges/left/*",
        "--scans",
        "1..3",
        "-o",
        "f.mcap",
        "--json",
    ];
    let report = world.run(&arguments).done().json();
    let topics: Vec<&String> = report["messages"].as_object().unwrap().keys().collect();
    assert_eq!(
        topics,
        [
            "camera/centre/calibration",
            "camera/left/calibration",
            "camera/right/calibration",
            "edges/left/0.8",
            "edges/left/2.2",
            "points",
            "tf",
        ]
    );
    assert!(
        report["messages"]
            .as_object()
            .unwrap()
            .values()
            .all(|count| count == 2)
    );
    let ran = world.run(&["filter", "x.mcap", "--scans", "9..", "-o", "none.mcap"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(!world.path("none.mcap").exists());
}

#[test]
fn what_a_filter_leaves_refers_to_nothing_that_it_left_out() {
    let world = World::recorded("3");
    let topics = "curves/*,tables/*,matches/*,disparity,points";
    let filter = [
        "filter", "x.mcap", "--topics", topics, "-o", "f.mcap", "--json",
    ];
    world.run(&filter).done();
    let ran = world.run(&["replay", "f.mcap", "--from", "hough", "--verify", "--json"]);
    let verified = &ran.done().json()["verified"];
    assert_eq!(verified["equal"], true, "{verified}");
    assert_eq!(verified["topics"].as_object().unwrap().len(), 10);
    let ran = world.run(&["replay", "f.mcap", "--from", "track"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    let told = "needs edges/left/2.2 and 5 more, which the recording does not hold; it can be replayed from hough, match";
    assert!(ran.err.contains(told), "{}", ran.err);
    let ran = world.run(&["filter", "x.mcap", "--topics", "curve", "-o", "g.mcap"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("no topic of the recording is like curve"),
        "{}",
        ran.err
    );
}

/// Rewrites a recording as other programs may: without chunks, under a prefix, with or without its metadata.
fn rewrite_plainly(from: &Path, to: &Path, keeps_metadata: bool) {
    let bytes = std::fs::read(from).unwrap();
    let options = mcap::WriteOptions::new().use_chunks(false);
    let mut writer = options.create(std::fs::File::create(to).unwrap()).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    for index in summary.metadata_indexes.iter().filter(|_| keeps_metadata) {
        let metadata = mcap::read::metadata(&bytes, index).unwrap();
        writer.write_metadata(&metadata).unwrap();
    }
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data);
        let topic = format!("/tricurve/{}", message.channel.topic);
        let encoding = &message.channel.message_encoding;
        let none = std::collections::BTreeMap::new();
        let channel_id = writer.add_channel(schema.unwrap(), &topic, encoding, &none);
        let header = mcap::records::MessageHeader {
            channel_id: channel_id.unwrap(),
            sequence: message.sequence,
            log_time: message.log_time,
            publish_time: message.publish_time,
        };
        writer
            .write_to_known_channel(&header, &message.data)
            .unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn what_others_rewrote_is_treated_like_the_original() {
    let world = World::recorded("4");
    rewrite_plainly(&world.path("x.mcap"), &world.path("plain.mcap"), true);
    verifies(&world, "plain.mcap", 4);
    let info = world
        .run(&["info", "plain.mcap", "--check", "--json"])
        .done()
        .json();
    assert_eq!(
        (&info["complete"], &info["scans"]["whole"]),
        (&true.into(), &4.into())
    );
    assert!(
        info["remarks"][0]
            .as_str()
            .unwrap()
            .contains("named /tricurve/"),
        "{info}"
    );
    let [one, other] =
        ["x.mcap", "plain.mcap"].map(|name| world.run(&["export", name, "--csv", "-"]).done().out);
    assert!(one.len() > 1000 && one == other);
    world
        .run(&["merge", "plain.mcap", "x.mcap", "-o", "both.mcap"])
        .done();
    verifies(&world, "both.mcap", 8);
    world
        .run(&["recover", "plain.mcap", "-o", "again.mcap"])
        .done();
    verifies(&world, "again.mcap", 4);
}

#[test]
fn without_its_metadata_a_recording_says_what_is_missing_and_takes_it_from_the_command_line() {
    let world = World::recorded("3");
    rewrite_plainly(&world.path("x.mcap"), &world.path("bare.mcap"), false);
    let [one, other] =
        ["x.mcap", "bare.mcap"].map(|name| world.run(&["export", name, "--csv", "-"]).done().out);
    assert!(one.len() > 1000 && one == other);
    let ran = world.run(&["replay", "bare.mcap", "--verify"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(
        ran.err.contains("give them with --profile default"),
        "{ran:?}"
    );
    let given = [
        "replay",
        "bare.mcap",
        "--verify",
        "--profile",
        "default",
        "--json",
    ];
    assert_eq!(world.run(&given).done().json()["verified"]["equal"], true);
    let other = [&given[..], &["--set", "match.nothing=0.3"]].concat();
    let ran = world.run(&other);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    let ran = world.run(&["replay", "x.mcap", "--verify", "--profile", "default"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("says the settings it was recorded with"),
        "{ran:?}"
    );
}

#[test]
fn whatever_scans_are_missing_from_what_is_written_it_is_not_done() {
    let world = World::recorded("6");
    world
        .run(&["split", "x.mcap", "--scans", "2", "-o", "s.mcap"])
        .done();
    std::fs::remove_file(world.path("s.1.mcap")).unwrap();
    for command in [
        ["merge", "s.mcap", "x.mcap", "-o", "y.mcap", "--force"].as_slice(),
        &["recover", "s.mcap", "-o", "y.mcap", "--force"],
        &["split", "s.mcap", "--scans", "1", "-o", "y.mcap", "--force"],
        &[
            "filter", "s.mcap", "--topics", "points", "-o", "y.mcap", "--force",
        ],
        &["export", "s.mcap", "--csv", "y.csv"],
        &["replay", "s.mcap", "--verify"],
    ] {
        let ran = world.run(command);
        assert_eq!(ran.code, Some(3), "{ran:?}");
        assert!(
            (ran.err + &ran.out).contains("s.1.mcap is missing"),
            "{command:?}"
        );
    }
}

#[test]
fn a_check_says_what_it_checked() {
    let world = World::recorded("2");
    let ran = world.run(&["info", "x.mcap", "--check"]).done();
    for told in [
        "messages of 2 scans were read",
        "checksums of their",
        "its ledger balances",
    ] {
        assert!(ran.out.contains(told), "{told}: {ran:?}");
    }
    let checked = world
        .run(&["info", "x.mcap", "--check", "--json"])
        .done()
        .json();
    assert_eq!(checked["check"]["failures"], serde_json::json!([]));
    assert!(
        checked["check"]["checked"].as_array().unwrap().len() > 4,
        "{checked}"
    );
}

#[test]
fn nothing_is_overwritten_that_is_read_or_not_to_be() {
    let world = World::recorded("2");
    let before = std::fs::read(world.path("x.mcap")).unwrap();
    let ran = world.run(&["recover", "x.mcap", "-o", "x.mcap", "--force"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    let ran = world.run(&["export", "x.mcap", "--csv", "x.mcap"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    std::fs::write(world.path("y.mcap"), "mine").unwrap();
    let ran = world.run(&["recover", "x.mcap", "-o", "y.mcap"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert_eq!(std::fs::read(world.path("x.mcap")).unwrap(), before);
    assert_eq!(std::fs::read(world.path("y.mcap")).unwrap(), b"mine");
}

#[test]
fn what_is_no_recording_is_told_in_a_sentence() {
    let world = World::new();
    std::fs::write(world.path("text.mcap"), "just text, and no recording").unwrap();
    for command in [
        ["info", "text.mcap"].as_slice(),
        &["replay", "text.mcap"],
        &["recover", "text.mcap", "-o", "y.mcap"],
        &["export", "text.mcap", "--csv", "y.csv"],
    ] {
        let ran = world.run(command);
        assert_eq!(ran.code, Some(1), "{ran:?}");
        assert_eq!(
            ran.err,
            "tricurve: text.mcap is not an MCAP file\n".replace(
                "text.mcap",
                if command[0] == "replay" {
                    world.path("text.mcap").to_str().unwrap().to_owned().leak()
                } else {
                    "text.mcap"
                }
            ),
            "{command:?}"
        );
    }
}

#[test]
fn a_recorder_killed_over_and_over_leaves_every_scan_once() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let child = world.start(&[
        "run", "--source", &source, "--scans", "500", "--record", "x.mcap", "--json",
    ]);
    let recorder = || {
        let nodes = world.nodes();
        nodes
            .iter()
            .find(|(name, _)| name == "record")
            .map(|(_, pid)| *pid)
    };
    for kill in 0..20u32 {
        // Once it has begun a part of its own.
        let part = match kill {
            0 => world.path("x.mcap"),
            n => world.path(&format!("x.{n}.mcap")),
        };
        wait_until("the recorder records", || {
            harness::bytes_of(&part) > 100_000
        });
        if let Some(pid) = recorder() {
            signal(pid, "KILL");
        }
    }
    let ran = harness::Ran::new(child.wait_with_output().unwrap()).done();
    let report = ran.json();
    assert_eq!(report["ledger"]["done"], 500, "{ran:?}");
    let info = world
        .run(&["info", "x.mcap", "--check", "--json"])
        .done()
        .json();
    assert_eq!(info["scans"]["whole"], 500, "{info}");
    assert!(info["parts"].as_array().unwrap().len() > 15, "{info}");
    verifies(&world, "x.mcap", 500);
}
