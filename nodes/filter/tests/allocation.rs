//! In steady state the filter asks for no memory.
#![expect(
    unsafe_code,
    reason = "an allocator that counts can only be made with it"
)]

mod pictures;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use filter::{Filter, Settings};
use messages::{Edges, ImageView, Owned, Size};
use pictures::texture;

/// The system's allocator, counted.
struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps to the contract, which is the same.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps to the contract, which is the same.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn once_a_size_is_known_its_views_cost_no_allocation() {
    let max = Size::new(160, 120);
    for settings in [
        Settings::default(),
        Settings::thesis(),
        Settings {
            smoothing: None,
            ..Settings::default()
        },
    ] {
        let mut filter = Filter::new(&settings, max);
        let mut room = Owned::<Edges>::new(max);
        let views: Vec<_> = [
            (max, 1),
            (Size::new(97, 64), 2),
            (max, 3),
            (Size::new(40, 120), 4),
        ]
        .map(|(size, seed)| (size, texture(size, seed)))
        .into();
        let mut run = || {
            let mut found = 0;
            for (size, pixels) in &views {
                filter.begin(ImageView { pixels }, *size);
                for channel in 0..filter.channels() {
                    room.fill(|room| filter.edges(channel, room));
                    found += room.view().edges.len();
                }
            }
            found
        };
        let first = run();
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        let second = run();
        let after = ALLOCATIONS.load(Ordering::Relaxed);
        assert!(first > 1000);
        assert_eq!(second, first);
        assert_eq!(after - before, 0, "{settings:?}");
    }
}
