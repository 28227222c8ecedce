//! Folders of images: what is taken from them, and what is refused, each with its sentence.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::{Path, PathBuf};

use capture::{Settings, Source, SourceError, Views};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::pnm::{PnmEncoder, PnmSubtype, SampleEncoding};
use image::{DynamicImage, ExtendedColorType, GrayImage, ImageBuffer, ImageEncoder, Luma, Rgb};
use messages::{Image, Owned, Size};
use tempfile::TempDir;

/// A folder that is gone after the test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    /// A folder of this many views, `view0.png` on.
    fn of_views(count: u32) -> Self {
        let folder = Self::new();
        for view in 0..count {
            picture(view)
                .save(folder.file(&format!("view{view}.png")))
                .unwrap();
        }
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// The path of a file in it, whose folders are made.
    fn file(&self, name: &str) -> PathBuf {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn settings(&self) -> Settings {
        Settings {
            source: self.path().to_str().unwrap().to_owned(),
            ..Settings::default()
        }
    }

    fn open(&self) -> Result<Source, SourceError> {
        Source::open(&self.settings())
    }

    fn open_views(&self, views: &[u32]) -> Result<Source, SourceError> {
        Source::open(&Settings {
            views: Views::These(views.to_vec()),
            ..self.settings()
        })
    }

    /// The sentence that says why it cannot be opened, with `~` for the folder.
    fn refusal(&self) -> String {
        self.told(&self.open().unwrap_err())
    }

    fn told(&self, error: &SourceError) -> String {
        error
            .to_string()
            .replace(self.path().to_str().unwrap(), "~")
    }
}

const SIZE: (u32, u32) = (40, 36);

/// A picture of its own for every view.
fn picture(view: u32) -> GrayImage {
    GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        Luma([(x * 5 + y * 2 + view * 11) as u8])
    })
}

fn read(source: &mut Source, scan: u64, view: usize) -> Result<(Size, Vec<u8>), SourceError> {
    let mut image = Owned::<Image>::new(source.size());
    let size = image.fill(|room| source.read(scan, view, room))?;
    Ok((size, image.view().pixels.to_vec()))
}

fn names(source: &Source, scan: u64) -> Vec<String> {
    source
        .views(scan)
        .into_iter()
        .map(|view| view.name)
        .collect()
}

#[test]
fn three_images_are_left_centre_and_right_in_natural_order() {
    let folder = Folder::new();
    for (view, name) in ["img9.png", "img10.png", "img11.png"]
        .into_iter()
        .enumerate()
    {
        picture(view as u32).save(folder.file(name)).unwrap();
    }
    let mut source = folder.open().unwrap();
    assert_eq!(names(&source, 0), ["img9.png", "img10.png", "img11.png"]);
    assert_eq!(
        (source.scans(), source.size(), source.notices().len()),
        (1, Size::new(40, 36), 0)
    );
    for view in 0..3 {
        let (size, pixels) = read(&mut source, 0, view).unwrap();
        assert_eq!(size, Size::new(40, 36));
        assert_eq!(pixels, picture(view as u32).into_raw());
    }
    assert_eq!(source.truth(0, 0).unwrap(), None);
}

#[test]
fn of_more_images_the_first_three_are_taken_and_that_is_said() {
    let folder = Folder::of_views(12);
    let source = folder.open().unwrap();
    assert_eq!(names(&source, 0), ["view0.png", "view1.png", "view2.png"]);
    assert_eq!(
        source.notices(),
        [
            "views 0,1,2 are taken, the first three of more; choose others with --views; if they are frames of one camera that \
             moves, --layout rail"
        ]
    );
    let source = folder.open_views(&[2, 6, 10]).unwrap();
    assert_eq!(names(&source, 0), ["view2.png", "view6.png", "view10.png"]);
    assert!(source.notices().is_empty());
}

#[test]
fn scans_repeat_the_scene_as_often_as_asked() {
    let folder = Folder::of_views(3);
    let mut source = Source::open(&Settings {
        scans: Some(7),
        ..folder.settings()
    })
    .unwrap();
    assert_eq!(source.scans(), 7);
    assert_eq!(
        read(&mut source, 6, 2).unwrap(),
        read(&mut source, 0, 2).unwrap()
    );
}

#[test]
fn every_format_gives_the_same_gray_levels() {
    for format in ["png", "pgm", "PPM", "tif", "tiff", "pnm"] {
        let folder = Folder::new();
        for view in 0..3 {
            let path = folder.file(&format!("{view}.{format}"));
            match format {
                "PPM" => DynamicImage::from(picture(view))
                    .into_rgb8()
                    .save(path)
                    .unwrap(),
                "pnm" => {
                    // Plain text, with comments allowed.
                    let kind = PnmSubtype::Graymap(SampleEncoding::Ascii);
                    let file = fs::File::create(path).unwrap();
                    let encoder = PnmEncoder::new(file).with_subtype(kind);
                    encoder
                        .write_image(&picture(view), SIZE.0, SIZE.1, ExtendedColorType::L8)
                        .unwrap();
                }
                _ => picture(view).save(path).unwrap(),
            }
        }
        let mut source = folder.open().unwrap();
        for view in 0..3 {
            assert_eq!(
                read(&mut source, 0, view).unwrap().1,
                picture(view as u32).into_raw(),
                "{format}"
            );
        }
    }
}

#[test]
fn a_jpeg_comes_out_as_nearly_what_went_in() {
    let folder = Folder::new();
    let smooth = GrayImage::from_fn(64, 64, |x, y| Luma([(2 * x + y) as u8]));
    for name in ["a.jpg", "b.jpeg", "c.JPG"] {
        let file = fs::File::create(folder.file(name)).unwrap();
        JpegEncoder::new_with_quality(file, 95)
            .encode_image(&smooth)
            .unwrap();
    }
    let (size, pixels) = read(&mut folder.open().unwrap(), 0, 1).unwrap();
    assert_eq!(size, Size::new(64, 64));
    assert!(
        pixels
            .iter()
            .zip(smooth.as_raw())
            .all(|(a, b)| a.abs_diff(*b) < 8)
    );
}

#[test]
fn sixteen_bit_is_scaled_to_eight_and_that_is_said_once() {
    for format in ["png", "tiff", "pgm"] {
        let folder = Folder::new();
        for view in 0..3 {
            let deep = ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| {
                Luma([picture(view).get_pixel(x, y)[0] as u16 * 257])
            });
            DynamicImage::ImageLuma16(deep)
                .save(folder.file(&format!("{view}.{format}")))
                .unwrap();
        }
        let mut source = folder.open().unwrap();
        assert_eq!(source.notices(), ["16-bit images are scaled to 8 bit"]);
        assert_eq!(
            read(&mut source, 0, 2).unwrap().1,
            picture(2).into_raw(),
            "{format}"
        );
    }
}

#[test]
fn colour_is_converted_to_gray_and_that_is_said_once() {
    let folder = Folder::new();
    for (view, name) in ["0.png", "1.tif", "2.png"].into_iter().enumerate() {
        let colour =
            ImageBuffer::from_pixel(SIZE.0, SIZE.1, Rgb([200_u16 * 257, 100 * 257, 40 * 257]));
        match view {
            0 => DynamicImage::ImageRgb16(colour)
                .into_rgba8()
                .save(folder.file(name))
                .unwrap(),
            _ => DynamicImage::ImageRgb16(colour)
                .save(folder.file(name))
                .unwrap(),
        }
    }
    let mut source = folder.open().unwrap();
    assert_eq!(
        source.notices(),
        [
            "colour images are converted to gray",
            "16-bit images are scaled to 8 bit"
        ]
    );
    // ITU-R BT.709: 0.2126, 0.7152, 0.0722.
    let expected = 0.2126 * 200.0 + 0.7152 * 100.0 + 0.0722 * 40.0;
    for view in 0..3 {
        let (_, pixels) = read(&mut source, 0, view).unwrap();
        assert!(
            pixels
                .iter()
                .all(|&gray| (f64::from(gray) - expected).abs() <= 1.0),
            "{}",
            pixels[0]
        );
    }
}

#[test]
fn a_photo_is_turned_the_way_its_camera_says() {
    // An EXIF segment with one entry: orientation 6, to be turned a quarter to the right.
    let exif =
        b"\xff\xe1\x00\x22Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let folder = Folder::new();
    for view in 0..3 {
        let mut bytes = Vec::new();
        let wide = GrayImage::from_fn(64, 40, |x, _| Luma([if x < 32 { 40 } else { 200 }]));
        JpegEncoder::new_with_quality(&mut bytes, 95)
            .encode_image(&wide)
            .unwrap();
        bytes.splice(2..2, exif.iter().copied());
        fs::write(folder.file(&format!("{view}.jpg")), bytes).unwrap();
    }
    let (size, pixels) = read(&mut folder.open().unwrap(), 0, 0).unwrap();
    assert_eq!(size, Size::new(40, 64));
    assert!(
        pixels[..40 * 30].iter().all(|&gray| gray < 60),
        "what was left is up"
    );
    assert!(
        pixels[40 * 34..].iter().all(|&gray| gray > 180),
        "what was right is down"
    );
}

#[test]
fn other_files_are_ignored_and_counted() {
    let folder = Folder::of_views(3);
    for name in ["notes.txt", "view.gif", ".hidden"] {
        fs::write(folder.file(name), "x").unwrap();
    }
    assert_eq!(
        folder.open().unwrap().notices(),
        ["2 files of other types are ignored"]
    );
}

#[test]
fn folders_of_scenes_are_one_scan_each_and_may_differ_in_size() {
    let folder = Folder::new();
    for (scene, side) in [("scene10", 48), ("scene2", 33)] {
        for view in 0..3 {
            let image = GrayImage::from_pixel(side, side + 1, Luma([side as u8 + view]));
            image
                .save(folder.file(&format!("{scene}/{view}.png")))
                .unwrap();
        }
    }
    fs::create_dir(folder.file("empty")).unwrap();
    fs::write(folder.file("README.md"), "scenes").unwrap();
    let mut source = folder.open().unwrap();
    assert_eq!((source.scans(), source.size()), (2, Size::new(48, 49)));
    assert_eq!(
        [0, 1, 2].map(|scan| source.name(scan)),
        ["scene2", "scene10", "scene2"]
    );
    assert_eq!(
        (source.size_of(0), source.size_of(1)),
        (Size::new(33, 34), Size::new(48, 49))
    );
    assert_eq!(source.notices(), ["one file of another type is ignored"]);
    for (scan, side) in [(0, 33), (1, 48), (2, 33)] {
        let (size, pixels) = read(&mut source, scan, 2).unwrap();
        assert_eq!(size, Size::new(side, side + 1));
        assert_eq!(pixels, vec![side as u8 + 2; size.pixels()]);
    }
}

mod descriptions {
    use super::*;

    /// Seven views, truth for 1 and 5, triples as in the field's data sets.
    const SCENE: &str = r#"{
        "scene": "made up", "views": [
            {"file": "view0.png", "position_steps": 0}, {"file": "view1.png", "position_steps": 1},
            {"file": "view2.png", "position_steps": 2}, {"file": "view3.png", "position_steps": 3},
            {"file": "view4.png", "position_steps": 4}, {"file": "view5.png", "position_steps": 6},
            {"file": "view6.png", "position_steps": 8}],
        "ground_truth": [{"file": "truth/gt1.png", "view": 1}],
        "triples": [{"views": [1, 2, 3], "gt": 2}, {"views": [2, 4, 5]}]
    }"#;

    fn scene(json: &str) -> Folder {
        let folder = Folder::of_views(7);
        fs::write(folder.file("scene.json"), json).unwrap();
        let truth = ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| {
            Luma([if x == 0 {
                0
            } else {
                256 * 3 + 64 * (y % 3) as u16
            }])
        });
        DynamicImage::ImageLuma16(truth)
            .save(folder.file("truth/gt1.png"))
            .unwrap();
        folder
    }

    #[test]
    fn the_first_triple_is_taken_and_that_is_said() {
        let source = scene(SCENE).open().unwrap();
        assert_eq!(names(&source, 0), ["view1.png", "view2.png", "view3.png"]);
        assert_eq!(
            source.notices(),
            [
                "views 1,2,3 are taken, the first triple that scene.json lists; choose others with --views"
            ]
        );
    }

    #[test]
    fn the_truth_of_one_step_is_that_of_as_many_as_the_views_are_apart() {
        let folder = scene(SCENE);
        let source = folder.open().unwrap();
        let truth = source.truth(0, 0).unwrap().unwrap();
        assert_eq!(truth.size, Size::new(40, 36));
        assert!(truth.disparity[0].is_nan() && !truth.visible[0]);
        assert_eq!(truth.disparity[40 + 7], 3.25);
        assert!(truth.visible[40 + 7]);
        assert!(
            !truth.visible[40 + 6],
            "two steps on it is at column -0.5, which is out of the picture"
        );
        assert_eq!(source.truth(0, 1).unwrap(), None);

        let wide = Folder::of_views(7);
        fs::write(
            wide.file("scene.json"),
            SCENE.replace("\"position_steps\": 6", "\"position_steps\": 5"),
        )
        .unwrap();
        fs::copy(folder.file("truth/gt1.png"), wide.file("truth/gt1.png")).unwrap();
        let source = wide.open_views(&[1, 3, 5]).unwrap();
        assert_eq!(source.views(0)[2].position_steps, 5.0);
        assert_eq!(source.truth(0, 0).unwrap().unwrap().disparity[40 + 7], 6.5);
    }

    #[test]
    fn views_may_be_far_apart_when_they_are_evenly_so() {
        let folder = scene(SCENE);
        let source = folder.open_views(&[2, 4, 5, 6]).unwrap();
        assert_eq!(source.view_count(), 4);
        let error = folder.open_views(&[3, 4, 5]).unwrap_err();
        assert_eq!(
            folder.told(&error),
            "views 3,4,5 of ~ stand 3,4,6 steps along the rail, and their distances must be equal; choose others"
        );
    }

    #[test]
    fn malformed_descriptions_are_refused_with_the_place() {
        let refusal = |json: &str| scene(json).refusal();
        let prefix = "~/scene.json does not describe a scene: ";
        assert_eq!(
            refusal("{\"views\": ["),
            format!("{prefix}EOF while parsing a list at line 1 column 11")
        );
        assert_eq!(
            refusal("{}"),
            format!("{prefix}missing field `views` at line 1 column 2")
        );
        assert_eq!(
            refusal(&SCENE.replace("[1, 2, 3]", "[1, 2, 7]")),
            format!("{prefix}a triple names view 7, and there are only 7 views")
        );
        assert_eq!(
            refusal(&SCENE.replace("\"position_steps\": 4", "\"position_steps\": 3")),
            format!(
                "{prefix}view 4 stands at 3 and the view before it at 3, but views go from left to right"
            )
        );
    }

    #[test]
    fn files_outside_the_folder_are_refused() {
        for outside in ["../view3.png", "/etc/view3.png", "a/../../view3.png", ""] {
            assert_eq!(
                scene(&SCENE.replace("view3.png", outside)).refusal(),
                format!(
                    "~/scene.json does not describe a scene: it names {outside:?}, and files must lie in its own folder"
                )
            );
        }
    }

    #[test]
    fn a_named_file_that_is_missing_is_refused() {
        assert_eq!(
            scene(&SCENE.replace("view2.png", "view22.png")).refusal(),
            "~/view22.png cannot be read: No such file or directory (os error 2)"
        );
    }

    #[test]
    fn a_truth_of_the_wrong_kind_is_refused() {
        let folder = scene(SCENE);
        let told = || folder.told(&folder.open().unwrap().truth(0, 0).unwrap_err());
        picture(0).save(folder.file("truth/gt1.png")).unwrap();
        assert_eq!(
            told(),
            "~/truth/gt1.png is no ground truth: it must be 16-bit gray, 256 times the disparity per step"
        );
        let small = ImageBuffer::from_pixel(33, 33, Luma([256_u16]));
        DynamicImage::ImageLuma16(small)
            .save(folder.file("truth/gt1.png"))
            .unwrap();
        assert_eq!(
            told(),
            "~/truth/gt1.png is no ground truth: it is 33x33 pixels and its view is 40x36"
        );
    }
}

#[test]
fn a_folder_without_images_is_refused() {
    let folder = Folder::new();
    let expected = "expected are PNG, JPEG, PGM, PPM, TIFF, BMP or WebP files, or folders of them";
    assert_eq!(folder.refusal(), format!("~ holds no images; {expected}"));
    fs::write(folder.file("a.txt"), "x").unwrap();
    assert_eq!(
        folder.refusal(),
        format!("~ holds no images, only one other file (.txt); {expected}")
    );
    fs::write(folder.file("inside/b.txt"), "x").unwrap();
    assert_eq!(
        folder.refusal(),
        format!("~ holds no images, only 2 other files (.txt); {expected}")
    );
}

#[test]
fn fewer_than_three_views_are_refused() {
    assert_eq!(
        Folder::of_views(2).refusal(),
        "~ holds 2 of the at least three views that a scene needs"
    );
    let folder = Folder::of_views(5);
    assert_eq!(
        folder.told(&folder.open_views(&[0, 4]).unwrap_err()),
        "three views are needed, left to right, and views chooses 2: 0,4"
    );
    assert_eq!(
        folder.told(&folder.open_views(&[1, 3, 5]).unwrap_err()),
        "there is no view 5 in ~, whose views are 0 to 4"
    );
    assert_eq!(
        folder.told(&folder.open_views(&[0, 1, 4]).unwrap_err()),
        "views 0,1,4 of ~ stand 0,1,4 steps along the rail, and their distances must be equal; choose others"
    );
}

#[test]
fn a_folder_that_is_not_there_or_a_file_is_refused() {
    let folder = Folder::of_views(3);
    let sentence = |source: &Path| {
        let settings = Settings {
            source: source.to_str().unwrap().to_owned(),
            ..Settings::default()
        };
        folder.told(&Source::open(&settings).unwrap_err())
    };
    assert_eq!(
        sentence(&folder.path().join("nowhere")),
        "there is no folder ~/nowhere; a source is a folder or one of the rendered scenes, like scene:all"
    );
    assert_eq!(
        sentence(Path::new("screwdiver")),
        "there is no folder screwdiver; a source is a folder or one of the rendered scenes, like scene:screwdriver"
    );
    assert_eq!(
        sentence(&folder.path().join("view0.png")),
        "~/view0.png is a file; give the folder that holds the images of the scene"
    );
}

#[cfg(unix)]
#[test]
fn a_folder_that_may_not_be_read_is_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::of_views(3);
    let may = |mode| fs::set_permissions(folder.path(), fs::Permissions::from_mode(mode)).unwrap();
    may(0o000);
    let is_root = fs::read_dir(folder.path()).is_ok();
    let refusal = folder.open().map_err(|error| folder.told(&error));
    may(0o700);
    if is_root {
        assert!(refusal.is_ok(), "the superuser reads everything");
    } else {
        assert_eq!(
            refusal.unwrap_err(),
            "~ cannot be read: Permission denied (os error 13)"
        );
    }
}

#[test]
fn views_of_different_size_are_refused() {
    let folder = Folder::of_views(3);
    GrayImage::new(41, 36)
        .save(folder.file("view2.png"))
        .unwrap();
    assert_eq!(
        folder.refusal(),
        "~/view2.png is 41x36 pixels and ~/view0.png is 40x36; the views of one scene must be of one size"
    );
}

#[test]
fn images_too_small_or_too_large_are_refused_by_their_heads() {
    let folder = Folder::of_views(3);
    GrayImage::new(31, 100)
        .save(folder.file("view1.png"))
        .unwrap();
    assert_eq!(
        folder.refusal(),
        "~/view1.png is 31x100 pixels; at least 32x32 are needed"
    );
    // Only the head is there: nothing is decoded.
    fs::write(folder.file("view1.png"), "").unwrap();
    fs::rename(folder.file("view1.png"), folder.file("view1.pgm")).unwrap();
    fs::write(folder.file("view1.pgm"), "P5\n10000 6401\n255\n").unwrap();
    assert_eq!(
        folder.refusal(),
        "~/view1.pgm is 10000x6401 pixels, more than 64 megapixels; scale it down"
    );
}

#[test]
fn what_is_no_image_is_refused() {
    let folder = Folder::of_views(3);
    fs::write(folder.file("view1.png"), "this is text").unwrap();
    let refusal = folder.refusal();
    assert!(
        refusal.starts_with("~/view1.png cannot be read as an image: "),
        "{refusal}"
    );
    assert!(
        refusal.ends_with("; replace the file or leave it out"),
        "{refusal}"
    );
    fs::write(folder.file("view1.png"), "").unwrap();
    assert!(
        folder
            .refusal()
            .starts_with("~/view1.png cannot be read as an image: ")
    );
}

#[test]
fn a_truncated_image_is_refused_at_the_start_whatever_its_format() {
    for format in ["png", "jpg", "pgm", "ppm", "tif"] {
        let folder = Folder::new();
        for view in 0..3 {
            let path = folder.file(&format!("{view}.{format}"));
            let image = DynamicImage::from(picture(view));
            match format {
                "ppm" => image.into_rgb8().save(&path).unwrap(),
                _ => image.save(&path).unwrap(),
            }
            if view == 1 {
                let bytes = fs::read(&path).unwrap();
                fs::write(&path, &bytes[..bytes.len() * 9 / 10]).unwrap();
            }
        }
        let refusal = folder.refusal();
        assert!(
            refusal.starts_with(&format!("~/1.{format} cannot be read as an image: ")),
            "{refusal}"
        );
    }
}

#[test]
fn in_a_later_scan_a_truncated_image_is_named_with_its_scan() {
    let folder = Folder::new();
    for scene in ["a", "b"] {
        for view in 0..3 {
            picture(view)
                .save(folder.file(&format!("{scene}/{view}.png")))
                .unwrap();
        }
    }
    let bytes = fs::read(folder.file("b/1.png")).unwrap();
    fs::write(folder.file("b/1.png"), &bytes[..bytes.len() / 2]).unwrap();
    let mut source = folder.open().unwrap();
    assert!(read(&mut source, 1, 0).is_ok());
    let told = folder.told(&read(&mut source, 1, 1).unwrap_err());
    assert!(
        told.starts_with("~/b/1.png cannot be read as an image in scan 1: "),
        "{told}"
    );
    assert!(
        read(&mut source, 0, 1).is_ok(),
        "the first scan is still there"
    );
}

#[test]
fn an_image_that_changes_its_size_during_the_run_is_refused() {
    let folder = Folder::new();
    for scene in ["a", "b"] {
        for view in 0..3 {
            picture(view)
                .save(folder.file(&format!("{scene}/{view}.png")))
                .unwrap();
        }
    }
    let mut source = folder.open().unwrap();
    GrayImage::new(64, 64).save(folder.file("b/2.png")).unwrap();
    assert_eq!(
        folder.told(&read(&mut source, 1, 2).unwrap_err()),
        "~/b/2.png was 40x36 pixels at the start and is 64x64 in scan 1; leave the files alone during a run"
    );
}

#[test]
fn scenes_of_different_numbers_of_views_are_refused() {
    let folder = Folder::new();
    for (scene, views) in [("a", 3), ("b", 3)] {
        for view in 0..views {
            picture(view)
                .save(folder.file(&format!("{scene}/{view}.png")))
                .unwrap();
        }
    }
    let four = r#"{"views": [{"file": "0.png"}, {"file": "1.png"}, {"file": "2.png"}, {"file": "3.png"}],
        "triples": [{"views": [0, 1, 2, 3]}]}"#;
    fs::write(folder.file("b/scene.json"), four).unwrap();
    picture(3).save(folder.file("b/3.png")).unwrap();
    assert_eq!(
        folder.refusal(),
        "~/b has 4 views and the scenes before it have 3; choose as many of each with views"
    );
}

/// The open data set of real scenes is no part of the project; where it lies beside it, it is read.
#[test]
fn a_real_scene_opens_with_its_names_size_and_truth() {
    let art = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/scenes/Art");
    if !art.is_dir() {
        eprintln!("skipped: there is no {}", art.display());
        return;
    }
    let settings = Settings {
        source: art.to_str().unwrap().to_owned(),
        views: Views::These(vec![1, 3, 5]),
        scans: Some(5),
        ..Settings::default()
    };
    let mut source = Source::open(&settings).unwrap();
    assert_eq!(
        (source.scans(), source.size(), source.name(4)),
        (5, Size::new(695, 555), "Art".to_owned())
    );
    assert_eq!(names(&source, 0), ["view1.png", "view3.png", "view5.png"]);
    let (left, centre) = (
        read(&mut source, 0, 0).unwrap().1,
        read(&mut source, 0, 1).unwrap().1,
    );
    let truth = source.truth(0, 0).unwrap().unwrap();
    assert_eq!(source.truth(0, 1).unwrap(), None);
    assert!(source.truth(0, 2).unwrap().is_some());
    // The truth, two steps of it, carries the left view onto the centre one.
    let mut differences: Vec<u8> = (0..truth.disparity.len())
        .filter(|&i| truth.visible[i])
        .map(|i| left[i].abs_diff(centre[(i as f32 - truth.disparity[i]).round() as usize]))
        .collect();
    differences.sort_unstable();
    assert!(differences.len() > left.len() / 2);
    assert!(
        differences[differences.len() / 2] <= 3,
        "{}",
        differences[differences.len() / 2]
    );
}

/// The layouts in which Middlebury hands out its sets.
mod middlebury {
    use super::*;

    fn gray(folder: &Folder, name: &str, size: (u32, u32), value: u8) {
        let truth = GrayImage::from_fn(size.0, size.1, |x, _| {
            Luma([if x == 0 { 0 } else { value }])
        });
        truth.save(folder.file(name)).unwrap();
    }

    /// The disparity, per step of the chosen views, that the left one's truth says; the first column is unknown.
    fn left(folder: &Folder, views: &[u32]) -> f32 {
        let source = folder.open_views(views).unwrap();
        assert!(source.knows_truth(0) && !source.knows_truth(1));
        let truth = source.truth(0, 0).unwrap().unwrap();
        assert!(truth.disparity[0].is_nan());
        truth.disparity[5]
    }

    #[test]
    fn the_truth_of_2001_is_eight_times_the_disparity_of_four_steps() {
        let folder = Folder::new();
        for view in 0..9 {
            picture(view)
                .save(folder.file(&format!("im{view}.ppm")))
                .unwrap();
        }
        gray(&folder, "disp2.pgm", SIZE, 96);
        gray(&folder, "disp6.pgm", SIZE, 96);
        assert_eq!(left(&folder, &[2, 3, 4]), 3.0);
        assert_eq!(left(&folder, &[2, 4, 6]), 6.0);
    }

    #[test]
    fn the_truth_of_2003_is_told_by_the_size() {
        let folder = Folder::new();
        let size = (450, 40);
        for view in 0..9 {
            gray(&folder, &format!("im{view}.png"), size, 90 + view as u8);
        }
        gray(&folder, "disp2.png", size, 64);
        assert_eq!(left(&folder, &[2, 3, 4]), 4.0);
    }

    #[test]
    fn tsukuba_has_names_of_its_own_and_truth_in_its_middle() {
        let folder = Folder::new();
        for column in 1..6 {
            let name = format!("scene1.row3.col{column}.ppm");
            picture(column).save(folder.file(&name)).unwrap();
        }
        gray(&folder, "truedisp.row3.col3.pgm", SIZE, 160);
        let source = folder.open_views(&[1, 2, 3]).unwrap();
        let known: Vec<bool> = (0..3).map(|view| source.knows_truth(view)).collect();
        assert_eq!(known, [false, true, false]);
        assert_eq!(source.truth(0, 1).unwrap().unwrap().disparity[5], 10.0);
    }

    #[test]
    fn the_sets_of_2005_and_2006_lie_in_one_folder_or_by_light_and_exposure() {
        for (inside, width, step) in [
            ("", 40, 10.0),
            ("Illum1/Exp1/", 620, 15.0),
            ("", 1000, 30.0),
        ] {
            let folder = Folder::new();
            for view in 0..7 {
                let name = format!("{inside}view{view}.png");
                gray(&folder, &name, (width, 32), 90 + view);
            }
            gray(&folder, "disp1.png", (width, 32), 120);
            gray(&folder, "disp5.png", (width, 32), 120);
            assert_eq!(left(&folder, &[1, 2, 3]), step);
            assert_eq!(
                folder.open_views(&[0, 1, 2]).unwrap().truth(0, 0).unwrap(),
                None
            );
        }
    }

    /// A gray float map whose rows are numbered from the top.
    fn float_map(size: (u32, u32), scale: &str) -> Vec<u8> {
        let mut bytes = format!("Pf\n{} {}\n{scale}\n", size.0, size.1).into_bytes();
        for row in (0..size.1).rev() {
            for column in 0..size.0 {
                let value = if column == 0 {
                    f32::INFINITY
                } else {
                    row as f32 + 0.25
                };
                bytes.extend(match scale.starts_with('-') {
                    true => value.to_le_bytes(),
                    false => value.to_be_bytes(),
                });
            }
        }
        bytes
    }

    #[test]
    fn float_maps_are_read_whatever_their_byte_order_and_from_bottom_to_top() {
        for scale in ["-1.0", "1"] {
            let folder = Folder::new();
            for view in 0..3 {
                picture(view)
                    .save(folder.file(&format!("im{view}.png")))
                    .unwrap();
            }
            fs::write(folder.file("disp0.pfm"), float_map(SIZE, scale)).unwrap();
            fs::write(folder.file("calib.txt"), "baseline=193.001\n").unwrap();
            let truth = folder.open().unwrap().truth(0, 0).unwrap().unwrap();
            assert!(truth.disparity[0].is_nan());
            assert_eq!(truth.disparity[1], 0.25);
            assert_eq!(truth.disparity[40 * 7 + 1], 7.25);
            fs::write(folder.file("disp0.pfm"), &float_map(SIZE, scale)[..400]).unwrap();
            let told = folder.told(&folder.open().unwrap().truth(0, 0).unwrap_err());
            assert_eq!(
                told,
                "~/disp0.pfm is no ground truth: it must be a gray portable float map (Pf)"
            );
        }
    }

    #[test]
    fn two_views_as_those_of_2014_are_too_few() {
        let folder = Folder::new();
        for view in 0..2 {
            picture(view)
                .save(folder.file(&format!("im{view}.png")))
                .unwrap();
        }
        fs::write(folder.file("disp0.pfm"), float_map(SIZE, "-1.0")).unwrap();
        let told = folder.refusal();
        assert!(told.contains("2") && told.contains("three"), "{told}");
    }
}

#[test]
fn a_pipe_called_like_a_description_is_refused_and_not_waited_for() {
    for name in ["scene.json", "metadata.yaml"] {
        let folder = Folder::of_views(3);
        let pipe = folder.file(name);
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        match (name, folder.open()) {
            ("scene.json", opened) => {
                let why = opened.err().unwrap().to_string();
                assert!(
                    why.contains("scene.json") && why.contains("no plain file"),
                    "{why}"
                );
            }
            (_, opened) => assert_eq!(opened.unwrap().scans(), 1),
        }
    }
}
