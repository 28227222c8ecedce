//! Once the largest scan has been seen, matching allocates nothing.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use matching::{Assignment, ChannelView, Matcher, Method, Settings};
use messages::{Calibration, Disparity, Matches, Message, Points, Size};

#[path = "synthetic/scene.rs"]
#[expect(dead_code, reason = "shared with the other tests")]
mod scene;

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

#[test]
fn matching_the_second_scan_allocates_nothing() {
    let size = Size::new(400, 300);
    let mut scene = scene::Scene::default();
    for number in 0..40 {
        let curve = scene::wavy(
            70.0 + 40.0 * (number % 8) as f32,
            10 + 55 * (number / 8),
            45,
            number as u32,
        );
        scene.add(&curve, |_| 4.0 + 0.4 * number as f32);
    }
    let messages = scene.messages(size);
    let views = [0, 1, 2].map(|v| ChannelView {
        curves: messages[v].0.view(),
        tables: messages[v].1.view(),
    });
    let inputs = [views, views];
    for (method, assignment) in [
        (Method::ThreeView, Assignment::Point),
        (Method::ThreeView, Assignment::Curve),
        (Method::TwoView, Assignment::Point),
        (Method::TwoView, Assignment::Curve),
        (Method::Point, Assignment::Point),
    ] {
        let mut matcher = Matcher::new(
            &Settings {
                method,
                assignment,
                ..Settings::default()
            },
            &[4.0, 1.0],
        );
        let mut words = vec![vec![0; Matches::words(size)]; 2];
        let mut rooms: Vec<_> = words
            .iter_mut()
            .map(|words| Matches::room(words, size).unwrap())
            .collect();
        let (mut disparity, mut points) = (
            vec![0; Disparity::words(size)],
            vec![0; Points::words(size)],
        );
        let mut disparity = Disparity::room(&mut disparity, size).unwrap();
        let mut points = Points::room(&mut points, size).unwrap();
        let mut allocations = [0; 3];
        for count in &mut allocations {
            let before = ALLOCATIONS.with(Cell::get);
            matcher.process(
                &inputs,
                size,
                &Calibration::assumed(size),
                &mut rooms,
                &mut disparity,
                &mut points,
            );
            *count = ALLOCATIONS.with(Cell::get) - before;
        }
        assert!(!points.points.is_empty());
        assert!(allocations[0] > 0, "the counter counts");
        assert_eq!(allocations[1..], [0, 0], "{method:?}, {assignment:?}");
    }
}
