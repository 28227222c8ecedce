//! Reading a view that has been read before allocates nothing.
#![expect(clippy::unwrap_used, reason = "tests")]

mod rig;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use capture::{Settings, Source};
use image::{GrayImage, Luma};
use messages::{Image, Owned};

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

/// Allocations while all views of a scan are read.
fn allocations(source: &mut Source, image: &mut Owned<Image>, scan: u64) -> usize {
    let before = ALLOCATIONS.get();
    for view in 0..3 {
        image.fill(|room| source.read(scan, view, room)).unwrap();
    }
    ALLOCATIONS.get() - before
}

#[test]
fn a_rendered_view_is_made_once() {
    let mut source = Source::open(&Settings {
        source: "scene:jack".to_owned(),
        ..Settings::default()
    })
    .unwrap();
    let mut image = Owned::new(source.size());
    assert!(allocations(&mut source, &mut image, 0) > 0);
    assert_eq!(allocations(&mut source, &mut image, 1), 0);
}

#[test]
fn an_image_is_decoded_once() {
    let folder = tempfile::tempdir().unwrap();
    for scene in 0..2 {
        let folder = folder.path().join(scene.to_string());
        std::fs::create_dir(&folder).unwrap();
        for view in 0..3 {
            GrayImage::from_pixel(64, 48, Luma([view]))
                .save(folder.join(format!("{view}.png")))
                .unwrap();
        }
    }
    let source = folder.path().to_str().unwrap().to_owned();
    let mut source = Source::open(&Settings {
        source,
        ..Settings::default()
    })
    .unwrap();
    let mut image = Owned::new(source.size());
    assert!(allocations(&mut source, &mut image, 1) > 0);
    assert_eq!(
        allocations(&mut source, &mut image, 0),
        0,
        "read when the source was opened"
    );
    assert_eq!(allocations(&mut source, &mut image, 3), 0);
}

#[test]
fn a_rectified_view_is_made_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene");
    std::fs::create_dir(&scene).unwrap();
    for view in 0..3 {
        GrayImage::from_pixel(rig::SIZE.width, rig::SIZE.height, Luma([view]))
            .save(scene.join(format!("{view}.png")))
            .unwrap();
    }
    let chain = folder.path().join("camchain.yaml");
    let cameras = rig::rig([rig::RADTAN, rig::FISHEYE, rig::RADTAN]);
    std::fs::write(&chain, rig::kalibr(&cameras)).unwrap();
    let mut source = Source::open(&Settings {
        source: scene.to_str().unwrap().to_owned(),
        calibration: Some(chain.to_str().unwrap().to_owned()),
        ..Settings::default()
    })
    .unwrap();
    let mut image = Owned::new(source.size());
    assert_eq!(allocations(&mut source, &mut image, 0), 0);
    assert_eq!(image.view().pixels, [2; rig::SIZE.pixels()]);
}
