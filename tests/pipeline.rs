//! The library: the chain in one process computes what the graph computes, and allocates nothing once it runs.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fs;
use std::path::Path;
use std::process::Command;

use harness::World;
use tricurve::{Calibration, Pipeline, PipelineError, Rig, Settings, Size};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

#[expect(
    unsafe_code,
    reason = "an allocator that counts is the only proof that nothing is allocated"
)]
// SAFETY: everything is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the memory came from `System` with this layout.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// The images of a folder, in the order of their names.
fn images(folder: &Path) -> Vec<image::GrayImage> {
    let entries = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|ending| ending == "pgm"))
        .collect();
    paths.sort();
    let open = |path| image::open(path).unwrap().into_luma8();
    paths.iter().map(open).collect()
}

#[test]
fn the_chain_in_one_process_finds_what_the_graph_finds() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    for profile in ["default", "thesis"] {
        let recording = format!("{profile}.mcap");
        let run = [
            "run",
            "--source",
            &source,
            "--scans",
            "1",
            "--profile",
            profile,
            "--record",
            &recording,
            "--set",
            "capture.focal=500",
            "--set",
            "capture.baseline=0.05",
        ];
        world.run(&run).done();
        world
            .run(&["export", &recording, "--csv", "points.csv"])
            .done();
        let expected = fs::read_to_string(world.path("points.csv")).unwrap();
        let expected: Vec<[f32; 4]> = expected
            .lines()
            .skip(1)
            .map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                [4, 5, 6, 7].map(|cell| cells[cell].parse().unwrap())
            })
            .collect();

        let settings = match profile {
            "thesis" => Settings::thesis(),
            _ => Settings::default(),
        };
        let views = images(&scene);
        let (width, height) = views[0].dimensions();
        let size = Size::new(width, height);
        let mut rig = Rig::of_views(views.len(), &settings.filter.channels, size);
        rig.calibration = Some(Calibration {
            focal_px: 500.0,
            baseline_m: 0.05,
            calibrated: true,
            ..Calibration::assumed(size)
        });
        let mut pipeline = Pipeline::new(&settings, &rig).unwrap();
        for round in 0..2 {
            let found = pipeline.process(&views).unwrap();
            let own: Vec<[f32; 4]> = found
                .points()
                .iter()
                .map(|point| [point.u, point.v, point.disparity, point.score])
                .collect();
            assert!(profile == "thesis" || own.len() > 100, "{}", own.len());
            assert!(
                own == expected,
                "{profile}, round {round}: {} {}",
                own.len(),
                expected.len()
            );
        }
    }
}

#[test]
fn once_it_runs_it_allocates_nothing() {
    let world = World::new();
    let views = images(&world.small_scene("scene"));
    let (width, height) = views[0].dimensions();
    let settings = Settings::default();
    let rig = Rig::of_views(3, &settings.filter.channels, Size::new(width, height));
    let mut pipeline = Pipeline::new(&settings, &rig).unwrap();
    let mut points = 0;
    for _ in 0..2 {
        points = pipeline.process(&views).unwrap().points().len();
    }
    let before = ALLOCATIONS.with(Cell::get);
    assert_eq!(pipeline.process(&views).unwrap().points().len(), points);
    assert_eq!(ALLOCATIONS.with(Cell::get) - before, 0);
}

#[test]
fn what_cannot_be_matched_is_refused_in_a_sentence() {
    let settings = Settings::default();
    let size = Size::new(64, 48);
    let rig = |views| Rig::of_views(views, &settings.filter.channels, size);
    let refused =
        |settings: &Settings, rig: &Rig| Pipeline::new(settings, rig).unwrap_err().to_string();
    assert_eq!(
        refused(&settings, &rig(2)),
        "expected three or more views at equal steps, the rig has 2: give it the views between or beside them"
    );
    let mut other = settings.clone();
    other.filter.channels = vec![2.0];
    assert!(
        refused(&other, &rig(3))
            .starts_with("expected the filter's channels, [2.0], the rig has [2.2")
    );
    let mut wrong = settings.clone();
    wrong.matching.score_least = 2.0;
    assert!(refused(&wrong, &rig(3)).starts_with("match.score_least"));
    let mut pipeline = Pipeline::new(&settings, &rig(3)).unwrap();
    let image = vec![0u8; size.pixels()];
    assert_eq!(
        pipeline.process(&[image.as_slice(), &image]).unwrap_err(),
        PipelineError::Images {
            expected: 3,
            found: 2
        }
    );
    let refused = pipeline
        .process(&[image.as_slice(), &image[1..], &image])
        .unwrap_err();
    assert_eq!(
        refused.to_string(),
        "expected 3072 gray levels in image 1, row by row as in 64x48, not 3071"
    );
    // What has no edges has no points, and that is no error.
    assert_eq!(
        pipeline
            .process(&[image.as_slice(), &image, &image])
            .unwrap()
            .points(),
        []
    );
}

#[test]
fn the_library_alone_pulls_neither_bus_nor_recordings_nor_command_line() {
    let tree = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--package",
            "tricurve",
            "--no-default-features",
        ])
        .args(["--edges", "normal", "--prefix", "none"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let tree = String::from_utf8(tree.stdout).unwrap();
    assert!(
        tree.contains("matching ") && tree.contains("rustfft "),
        "{tree}"
    );
    for heavy in ["iceoryx2", "mcap", "clap", "prost", "foxglove", "image"] {
        assert!(
            !tree
                .lines()
                .any(|line| line.split(' ').next() == Some(heavy)),
            "{heavy}"
        );
    }
}
