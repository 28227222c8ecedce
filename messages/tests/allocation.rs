//! Drawing over an image allocates nothing once the drawer knows how much there is.
#![cfg(feature = "record")]
#![expect(
    unsafe_code,
    reason = "an allocator that counts is unsafe by its trait"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use messages::record::{Codec, Span, Views};
use messages::{
    Curve, CurvesView, Edge, Header, Match, MatchesView, NONE, Reason, Rejected, Rig, Size,
};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
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
fn a_scan_is_drawn_without_an_allocation_for_any_of_its_curves() {
    let size = Size::new(640, 480);
    let (mut curves, mut points) = (Vec::new(), Vec::new());
    for label in 0..600u16 {
        let (x, y) = (f32::from(label % 30) * 20.0, f32::from(label / 30) * 22.0);
        let count = 4 + u32::from(label % 90);
        curves.push(Curve {
            label: label.into(),
            first: points.len() as u32,
            count,
            x,
            y,
            length: count as f32,
            ..Curve::default()
        });
        points.extend((0..count).map(|i| Edge {
            x: x + (i as f32).sin() * 9.0,
            y: y + i as f32,
            ..Edge::default()
        }));
    }
    let curves = CurvesView {
        curves: &curves,
        points: &points,
    };
    let found: Vec<Match> = (0..600)
        .step_by(2)
        .map(|label| Match {
            curves: [label, label, NONE],
            disparity: 3.0 + label as f32 / 100.0,
            score: 0.9,
            ..Match::default()
        })
        .collect();
    let rejected: Vec<Rejected> = (1..600)
        .step_by(2)
        .map(|curve| Rejected {
            curve,
            reason: Reason::ALL[curve as usize % 13].code(),
        })
        .collect();
    let matches = MatchesView {
        matches: &found,
        points: &[],
        rejected: &rejected,
    };
    let span = Span::of(found.iter().map(|found| found.disparity));
    let codec = Codec::new(Rig::of_views(3, &[1.0], size), 0);
    let (mut views, mut bytes) = (Views::default(), Vec::new());
    let mut allocations = [0; 3];
    for count in &mut allocations {
        let before = ALLOCATIONS.with(Cell::get);
        bytes.clear();
        for view in 0..3 {
            let header = Header {
                view,
                ..Header::new(0, 1_700_000_000_123_456_789, size)
            };
            let drawn = span.map(|span| (matches, span));
            views.annotations(&codec, &header, curves, drawn, &mut bytes);
            views.rejected(&codec, &header, curves, matches, &mut bytes);
        }
        *count = ALLOCATIONS.with(Cell::get) - before;
    }
    assert!(bytes.len() > 600_000);
    assert!(allocations[0] > 0, "the counter counts");
    assert_eq!(allocations[1..], [0, 0]);
}
