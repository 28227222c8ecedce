//! Making tables allocates nothing once the tabulator exists.
#![expect(
    unsafe_code,
    reason = "an allocator that counts is unsafe by its trait"
)]

mod snakes;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use hough::{Settings, Tabulator, Weight};
use messages::{Owned, Size, Tables};
use snakes::{message, wander};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_frame_allocates_not_even_the_first_or_the_largest() {
    let size = Size::new(120, 80);
    let frames = [(10, 50), (4800, 3), (1, 9000)]
        .map(|(curves, count)| message(&wander(size, curves, count, 5), size));
    let mut tables = Owned::<Tables>::new(size);
    for weight in [
        Weight::Unity,
        Weight::Magnitude,
        Weight::Combined,
        Weight::Curvature,
    ] {
        let mut tabulator = Tabulator::new(
            &Settings {
                weight,
                constant: 1.0,
                ..Settings::default()
            },
            size,
        );
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        for curves in &frames {
            tables.fill(|room| tabulator.process(curves.view(), size, room));
        }
        assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before);
    }
}
