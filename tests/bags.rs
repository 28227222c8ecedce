//! Bags as whole runs: recorded, replayed to the same bytes, and never taken for whole when they are not.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "../nodes/capture/tests/bag/mod.rs"]
mod bag;
mod harness;
#[path = "../nodes/capture/tests/texture/mod.rs"]
mod texture;

use std::fs;

use bag::{Camera, Pixels, Written, camera_info, image, mcap, odometry};
use harness::{Ran, World};
use texture::wave;

const START: u64 = 1_700_000_000_000_000_000;
const MS: u64 = 1_000_000;
const SIZE: (u32, u32) = (160, 96);

/// What a camera sees so many steps to the right, and with so much noise.
fn seen(topic: &str, nanos: u64, place: f64) -> Written {
    let pixels = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (f64::from(x), f64::from(y))));
    let level = |(x, y): (f64, f64)| wave(x + place * (4.0 + y / 50.0), y);
    let data: Vec<u8> = pixels.map(level).collect();
    image(
        topic,
        nanos,
        Pixels {
            encoding: "mono8",
            size: SIZE,
            step: SIZE.0,
            is_big: false,
            data: &data,
        },
    )
}

fn rig(scans: u64) -> Vec<Written> {
    let mut all = Vec::new();
    for (view, side) in ["left", "centre", "right"].into_iter().enumerate() {
        let camera = Camera {
            size: SIZE,
            k: [200.0, 80.0, 48.0],
            d: &[],
            p: [200.0, 80.0, 48.0, -20.0 * view as f64],
        };
        all.push(camera_info(&format!("/{side}/camera_info"), START, camera));
        for scan in 0..scans {
            let nanos = START + scan * 70 * MS + view as u64 * MS;
            all.push(seen(&format!("/{side}/image_rect"), nanos, view as f64));
        }
    }
    all.sort_by_key(|one| one.log);
    all
}

/// Runs the program, which ends with this code and says so.
#[track_caller]
fn ended(world: &World, arguments: &[&str], code: i32, said: &str) -> Ran {
    let ran = world.run(arguments);
    assert_eq!(ran.code, Some(code), "{ran:?}");
    assert!(ran.err.contains(said), "{ran:?}");
    ran
}

#[test]
fn a_bag_is_run_recorded_and_replayed_to_the_same_bytes_with_its_own_times() {
    let world = World::new();
    mcap(&world.path("bag.mcap"), &rig(4));
    let run = [
        "run",
        "--source",
        "bag:bag.mcap",
        "--record",
        "x.mcap",
        "--json",
    ];
    let ran = world.run(&run).done();
    let summary = ran.json();
    assert_eq!(summary["scans"], 4);
    assert_eq!(summary["synchronisation"]["scans"], 4);
    world.run(&["replay", "x.mcap", "--verify"]).done();
    // A recording is replayed, not read as a bag.
    let own = ["run", "--source", "x.mcap"];
    ended(&world, &own, 2, "tricurve replay x.mcap");
}

#[test]
fn what_cannot_be_read_of_a_bag_makes_the_exit_code_3() {
    let world = World::new();
    let path = world.path("bag.mcap");
    mcap(&path, &rig(6));
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() * 2 / 3]).unwrap();
    let run = ["run", "--source", "bag.mcap", "--no-record"];
    ended(&world, &run, 3, "data was lost: the bag is damaged");
    // An image that is too short.
    let mut all = rig(6);
    let short = &mut all[4..];
    let one = short
        .iter_mut()
        .find(|one| one.topic == "/left/image_rect")
        .unwrap();
    let pixels = Pixels {
        encoding: "mono8",
        size: SIZE,
        step: SIZE.0,
        is_big: false,
        data: &[0; 99],
    };
    *one = image(&one.topic.clone(), one.log, pixels);
    mcap(&path, &all);
    let told = "1 of 6 images on /left/image_rect cannot be used";
    ended(&world, &run, 3, told);
    // An image that turns out to be damaged in its turn: its scan is left out, and the others come.
    let all = rig(6);
    let options = mcap::WriteOptions::new().compression(None);
    bag::mcap_with(&path, &all, options.chunk_size(Some(9000)));
    let mut file = fs::read(&path).unwrap();
    let is_left = |one: &&Written| one.topic == "/left/image_rect";
    let odd = all.iter().filter(is_left).nth(3).unwrap();
    let of_pixels = &odd.bytes[odd.bytes.len() - 200..];
    let at = file.windows(200).rposition(|window| window == of_pixels);
    file[at.unwrap()] ^= 1;
    fs::write(&path, &file).unwrap();
    let ran = ended(&world, &run, 3, "data was lost: 1 scan could not be read");
    assert!(
        ran.out
            .contains("5 done, 1 dropped at the door (1: an image cannot be read)"),
        "{ran:?}"
    );
}

#[test]
fn a_rail_of_a_bag_is_run_and_replayed_with_places_of_odometry() {
    let world = World::new();
    let frame = |n: u64| seen("/camera/image_rect", START + n * 100 * MS, n as f64 * 0.7);
    let mut all: Vec<Written> = (0..10).map(frame).collect();
    all.extend((0..40).map(|n| {
        odometry(
            "/odom",
            START - 40 * MS + n * 27 * MS,
            [0.0, -0.0003 * n as f64, 0.0],
        )
    }));
    all.sort_by_key(|one| one.log);
    mcap(&world.path("bag.mcap"), &all);
    let run = [
        "run",
        "--source",
        "bag.mcap",
        "--position",
        "/odom",
        "--set",
        "capture.mode=rail",
        "--set",
        "capture.focal=200",
        "--record",
        "x.mcap",
    ];
    let ran = world.run(&run).done();
    assert!(
        ran.err
            .contains("places are those of /odom, base_link within odom"),
        "{}",
        ran.err
    );
    world.run(&["replay", "x.mcap", "--verify"]).done();
}
