//! Tracking allocates nothing once the tracker exists.
#![expect(
    unsafe_code,
    reason = "an allocator that counts is unsafe by its trait"
)]

mod contours;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use contours::{of, waves};
use messages::{Curves, EdgesView, Owned, Size};
use track::{Settings, Tracker};

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
    let size = Size::new(160, 120);
    let frames = [30.0, 12.0, 4.0, 30.0].map(|wavelength| of(size, waves(wavelength)));
    let mut tracker = Tracker::new(
        &Settings {
            min_points: 2,
            ..Settings::default()
        },
        size,
    );
    let mut curves = Owned::<Curves>::new(size);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    for edges in &frames {
        curves.fill(|room| tracker.process(EdgesView { edges }, size, room));
        assert!(!curves.view().curves.is_empty());
    }
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before);
}
