//! How images lie in folders: every way in which recorders and people lay them is read as what it is, or refused.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::Path;

use capture::{Layout, Mode, Settings, Source, SourceError, Views};
use image::{GrayImage, Luma};
use messages::{Image, Owned, Size};
use tempfile::TempDir;

const SIZE: (u32, u32) = (40, 36);

/// A folder that is gone after the test.
struct Folder(TempDir);

impl Folder {
    /// A folder with an image for each of these names; what each is of is told by its gray level.
    fn with<S: AsRef<str>>(names: &[S]) -> Self {
        let folder = Self(TempDir::new().unwrap());
        for (number, name) in names.iter().enumerate() {
            let image = GrayImage::from_pixel(SIZE.0, SIZE.1, Luma([number as u8]));
            folder.put(name.as_ref(), &image);
        }
        folder
    }

    fn put(&self, name: &str, image: &GrayImage) {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        image.save(path).unwrap();
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn settings(&self) -> Settings {
        Settings {
            source: self.path().to_str().unwrap().to_owned(),
            ..Settings::default()
        }
    }

    fn open(&self) -> Source {
        Source::open(&self.settings()).unwrap()
    }

    fn said(&self, layout: Layout) -> Result<Source, SourceError> {
        let mode = match layout {
            Layout::Rail => Mode::Rail,
            _ => Mode::Rig,
        };
        Source::open(&Settings {
            layout: Some(layout),
            mode,
            ..self.settings()
        })
    }

    /// The sentence that says why it cannot be opened, with `~` for the folder.
    fn refusal(&self) -> String {
        self.told(&Source::open(&self.settings()).unwrap_err())
    }

    fn told(&self, error: &SourceError) -> String {
        error
            .to_string()
            .replace(self.path().to_str().unwrap(), "~")
    }
}

/// Names made of times and cameras, time by time.
fn grid(times: &[&str], cameras: &[&str], name: impl Fn(&str, &str) -> String) -> Vec<String> {
    let each = times.iter();
    each.flat_map(|time| {
        cameras
            .iter()
            .map(|camera| name(time, camera))
            .collect::<Vec<_>>()
    })
    .collect()
}

fn files(source: &Source) -> Vec<Vec<String>> {
    (0..source.scenes())
        .map(|scan| source.files(scan))
        .collect()
}

/// The gray levels of a scan's views.
fn levels(source: &mut Source, scan: u64) -> Vec<u8> {
    (0..source.view_count())
        .map(|view| {
            let mut image = Owned::<Image>::new(source.size());
            image.fill(|room| source.read(scan, view, room)).unwrap();
            image.view().pixels[0]
        })
        .collect()
}

#[test]
fn a_folder_a_camera_is_a_scan_a_time() {
    for (cameras, inside, times) in [
        (["cam0", "cam1", "cam2"], "", ["000000", "000001", "000002"]),
        (
            ["cam0", "cam1", "cam2"],
            "data/",
            [
                "1403636579763555584",
                "1403636579813555456",
                "1403636579863555584",
            ],
        ),
        (
            ["image_00", "image_01", "image_02"],
            "data/",
            ["0000000000", "0000000001", "0000000002"],
        ),
        (
            ["left", "centre", "right"],
            "",
            ["frame_9", "frame_10", "frame_11"],
        ),
        (["gauche", "centre", "droite"], "", ["a", "b", "c"]),
        (["L", "C", "R"], "images/", ["1", "2", "3"]),
    ] {
        let folder = Folder::with(&grid(&times, &cameras, |time, camera| {
            format!("{camera}/{inside}{time}.png")
        }));
        let mut source = folder.open();
        assert_eq!(source.layout(), Some(Layout::Cameras), "{cameras:?}");
        assert_eq!((source.scans(), source.view_count()), (3, 3), "{cameras:?}");
        for scan in 0..3u8 {
            let first = 3 * scan;
            assert_eq!(
                levels(&mut source, scan.into()),
                [first, first + 1, first + 2],
                "{cameras:?}"
            );
        }
        assert!(
            source
                .warnings()
                .iter()
                .all(|warning| warning.contains("arbitrary"))
        );
    }
}

#[test]
fn a_folder_around_everything_is_looked_into() {
    let names = grid(&["1", "2"], &["cam0", "cam1", "cam2"], |time, camera| {
        format!("mav0/{camera}/data/{time}.png")
    });
    let folder = Folder::with(&names);
    assert_eq!(
        files(&folder.open())[1],
        [
            "mav0/cam0/data/2.png",
            "mav0/cam1/data/2.png",
            "mav0/cam2/data/2.png"
        ]
    );
    let folder = Folder::with(&[
        "run/images/left.png",
        "run/images/mid.png",
        "run/images/right.png",
    ]);
    assert_eq!(folder.open().layout(), Some(Layout::Views));
}

#[test]
fn cameras_may_put_their_own_word_before_the_number_they_share() {
    let names = grid(&["7", "8", "10"], &["l", "c", "r"], |time, camera| {
        format!("{camera}/{camera}_{time}.png")
    });
    let source = Folder::with(&names);
    let source = source.open();
    assert_eq!(source.layout(), Some(Layout::Cameras));
    assert_eq!(
        files(&source)[2],
        ["l/l_10.png", "c/c_10.png", "r/r_10.png"]
    );
}

#[test]
fn cameras_and_times_in_every_name_of_one_folder_are_told_apart() {
    type Name = fn(&str, &str) -> String;
    let cases: [([&str; 3], Name); 6] = [
        (["left", "centre", "right"], |time, camera| {
            format!("{camera}_{time}.png")
        }),
        (["L", "C", "R"], |time, camera| {
            format!("{time}-{camera}.png")
        }),
        (["0", "1", "2"], |time, camera| {
            format!("cam{camera}_{time}.png")
        }),
        (["0", "1", "2"], |time, camera| {
            format!("scene{time}_view{camera}.png")
        }),
        (["links", "Mitte", "RECHTS"], |time, camera| {
            format!("IMG{time}{camera}.png")
        }),
        (["a", "b", "c"], |time, camera| {
            format!("{camera}{time}.png")
        }),
    ];
    for (number, (cameras, name)) in cases.into_iter().enumerate() {
        let folder = Folder::with(&grid(&["008", "009", "010", "011"], &cameras, name));
        let mut source = folder.open();
        assert_eq!(source.layout(), Some(Layout::Flat), "case {number}");
        assert_eq!(source.scans(), 4, "case {number}");
        assert_eq!(levels(&mut source, 2), [6, 7, 8], "case {number}");
    }
}

#[test]
fn a_folder_a_time_is_a_scan_each_in_natural_order() {
    let names = grid(
        &["scan10", "Scan9", "scan11"],
        &["L", "M", "R"],
        |time, camera| format!("{time}/{camera}.png"),
    );
    let source = Folder::with(&names).open();
    assert_eq!(source.layout(), Some(Layout::Times));
    let names: Vec<String> = (0..3).map(|scan| source.name(scan)).collect();
    assert_eq!(names, ["Scan9", "scan10", "scan11"]);
    assert_eq!(
        files(&source)[0],
        ["Scan9/L.png", "Scan9/M.png", "Scan9/R.png"]
    );
}

#[test]
fn times_that_lack_a_camera_are_left_out_and_that_is_said() {
    let mut names = grid(
        &["1", "2", "3", "4"],
        &["cam0", "cam1", "cam2"],
        |time, camera| format!("{camera}/{time}.png"),
    );
    names.retain(|name| name != "cam1/2.png" && name != "cam2/4.png");
    let source = Folder::with(&names).open();
    assert_eq!(source.scans(), 2);
    assert_eq!(
        files(&source)[1],
        ["cam0/3.png", "cam1/3.png", "cam2/3.png"]
    );
    assert!(
        source.warnings().contains(
            &"2 times of 4 are left out, for not all cameras took an image: 2 lacks cam1's for one"
                .to_owned()
        ),
        "{:?}",
        source.warnings()
    );
    let mut names = grid(
        &["scan1", "scan2", "scan3"],
        &["left", "centre", "right"],
        |time, camera| format!("{time}/{camera}.png"),
    );
    names.retain(|name| name != "scan2/centre.png");
    let source = Folder::with(&names).open();
    assert_eq!(source.scans(), 2);
    let lacks = "1 time of 3 is left out, for not all cameras took an image: scan2 lacks centre's";
    assert!(
        source.warnings().contains(&lacks.to_owned()),
        "{:?}",
        source.warnings()
    );
}

#[test]
fn cameras_that_have_no_time_in_common_are_refused_and_those_called_after_it_go_together() {
    let names = ["left/1.png", "left/2.png", "centre/3.png", "right/4.png"];
    assert_eq!(
        Folder::with(&names).refusal(),
        "~ holds images of left, centre, right, but no time at which all of them took one: at 1 centre did not; images of one time have a name or number in common"
    );
    let stamp = |time: u64, camera: u64| 1_700_000_000_000_u64 + 50 * time + 3 * camera;
    let names: Vec<String> = (0..5)
        .flat_map(|time| (0..3).map(move |camera| (time, camera)))
        .filter(|taken| *taken != (2, 0))
        .map(|(time, camera)| format!("cam{camera}/{}.png", stamp(time, camera)))
        .collect();
    let source = Folder::with(&names).open();
    assert_eq!(source.scans(), 4);
    assert_eq!(files(&source)[2][0], format!("cam0/{}.png", stamp(3, 0)));
    assert!(
        source
            .notices()
            .contains(&"images are put together by the times they are called after".to_owned())
    );
}

#[test]
fn what_stays_open_is_refused_with_both_readings_and_can_be_said() {
    let names = grid(&["a", "b", "c"], &["0", "1", "2"], |time, camera| {
        format!("{time}/{camera}.png")
    });
    let folder = Folder::with(&names);
    assert_eq!(
        folder.refusal(),
        "~ can be read as 3 cameras at 3 times, a folder a camera, and as 3 times of 3 cameras, a folder a time: say which with --layout cameras or --layout times"
    );
    let first = |layout| files(&folder.said(layout).unwrap()).swap_remove(0);
    assert_eq!(first(Layout::Cameras), ["a/0.png", "b/0.png", "c/0.png"]);
    assert_eq!(first(Layout::Times), ["a/0.png", "a/1.png", "a/2.png"]);
    let names = grid(&["1", "2", "3"], &["4", "5", "6"], |time, camera| {
        format!("{time}_{camera}.png")
    });
    let folder = Folder::with(&names);
    assert!(folder.refusal().starts_with(
        "~ can be read as 3 cameras at 3 times, and as 3 cameras at 3 times: say which"
    ));
    assert_eq!(folder.said(Layout::Views).unwrap().scans(), 1);
}

#[test]
fn a_layout_that_a_folder_does_not_have_is_refused() {
    let folder = Folder::with(&["0.png", "1.png", "2.png"]);
    assert_eq!(
        folder.told(&folder.said(Layout::Cameras).unwrap_err()),
        "~ cannot be read as a folder a camera (cameras): it holds no folders with images"
    );
    assert_eq!(
        folder.told(&folder.said(Layout::Flat).unwrap_err()),
        "~ cannot be read as cameras and times by name (flat): its names are no words or numbers of cameras that go with the same times, as in left_000, right_000"
    );
    assert_eq!(
        folder.told(&folder.said(Layout::Columns(3)).unwrap_err()),
        "~/0.png is 40x36 pixels, which cannot be cut into 3 equal parts: say how many views it shows with --layout columns:N or rows:N"
    );
    let settings = Settings {
        layout: Some(Layout::Rail),
        ..folder.settings()
    };
    assert!(
        Source::open(&settings)
            .unwrap_err()
            .to_string()
            .contains("set capture.mode to rail")
    );
}

#[test]
fn two_cameras_are_too_few_and_they_are_named() {
    let names = grid(&["1", "2", "3", "4"], &["left", "right"], |time, camera| {
        format!("{camera}_{time}.png")
    });
    assert_eq!(
        Folder::with(&names).refusal(),
        "~ holds 2 of the at least three cameras that a scan needs: read as cameras and times by name (flat), left, right at 4 times; --layout says another"
    );
}

#[test]
fn the_order_of_views_is_natural_and_from_left_to_right_whatever_the_language() {
    for names in [
        ["L.png", "C.png", "R.png"],
        ["scan7_l.png", "scan7_c.png", "scan7_r.png"],
        ["gauche.png", "centre.png", "droite.png"],
        ["IMG_1.PNG", "img_2.png", "IMG_3.PNG"],
        ["-1.5.png", "0.png", "1.5.png"],
        ["x-10.png", "x0.png", "x10.png"],
        ["pos0.5.png", "pos0.75.png", "pos1.png"],
        ["izq.png", "medio.png", "derecha.png"],
    ] {
        let folder = Folder::with(&names);
        assert_eq!(files(&folder.open()), [names], "{names:?}");
    }
    let five = [
        "left2.png",
        "left1.png",
        "centre.png",
        "right1.png",
        "right2.png",
    ];
    let folder = Folder::with(&five);
    let all = Settings {
        views: Views::All,
        ..folder.settings()
    };
    assert_eq!(files(&Source::open(&all).unwrap()), [five]);
}

#[test]
fn an_image_without_a_side_beside_left_and_right_is_refused_unless_places_are_said() {
    let folder = Folder::with(&["left.png", "right.png", "depth.png"]);
    assert_eq!(
        folder.refusal(),
        "~ holds images that are called left and right, and depth.png, which says no side: name it, move it away, or choose by place among the names in order with --views 0,1,2"
    );
    let settings = Settings {
        views: Views::These(vec![0, 1, 2]),
        ..folder.settings()
    };
    assert_eq!(
        files(&Source::open(&settings).unwrap()),
        [["depth.png", "left.png", "right.png"]]
    );
}

/// A picture of three views side by side, or above each other, each shifted by a few pixels.
fn panels(count: u32, is_row: bool, seed: u32) -> GrayImage {
    let (width, height) = (120, 100);
    let blob = |x: u32, y: u32| {
        let cell = (x / 5).wrapping_mul(73_856_093) ^ (y / 5).wrapping_mul(19_349_663) ^ seed;
        (cell.wrapping_mul(2_654_435_761) >> 24) as u8
    };
    let size = match is_row {
        true => (width, height * count),
        false => (width * count, height),
    };
    GrayImage::from_fn(size.0, size.1, |x, y| {
        let (index, x, y) = match is_row {
            true => (y / height, x, y % height),
            false => (x / width, x % width, y),
        };
        Luma([blob(x + 4 * index, y)])
    })
}

#[test]
fn several_views_in_one_picture_are_found_by_what_they_show() {
    for (count, is_row) in [(3, false), (4, false), (3, true)] {
        let folder = Folder(TempDir::new().unwrap());
        for time in 0..4 {
            folder.put(&format!("{time:03}.png"), &panels(count, is_row, 7 * time));
        }
        let source = folder.open();
        let expected = match is_row {
            true => Layout::Rows(count),
            false => Layout::Columns(count),
        };
        assert_eq!(source.layout(), Some(expected));
        assert_eq!((source.scans(), source.size()), (4, Size::new(120, 100)));
        let kind = if is_row { "row" } else { "column" };
        assert_eq!(source.files(1)[2], format!("001.png, {kind} 3 of {count}"));
    }
    // Two are too few, and three wide pictures that show each something else are three views.
    let folder = Folder(TempDir::new().unwrap());
    for time in 0..4 {
        folder.put(&format!("{time:03}.png"), &panels(2, false, 7 * time));
    }
    assert!(
        folder
            .refusal()
            .contains("2 views side by side in a picture (columns:2)"),
        "{}",
        folder.refusal()
    );
    let folder = Folder(TempDir::new().unwrap());
    for view in 0..3 {
        let wide = GrayImage::from_fn(400, 100, |x, y| {
            let cell =
                ((x + 3 * view) / 5).wrapping_mul(73_856_093) ^ (y / 5).wrapping_mul(19_349_663);
            Luma([(cell.wrapping_mul(2_654_435_761) >> 24) as u8])
        });
        folder.put(&format!("{view}.png"), &wide);
    }
    assert_eq!(folder.open().layout(), Some(Layout::Views));
}

#[test]
fn a_part_of_a_picture_is_read_as_a_view_of_its_own() {
    let folder = Folder(TempDir::new().unwrap());
    let picture = GrayImage::from_fn(120, 36, |x, _| Luma([(x / 40) as u8 * 50]));
    folder.put("one.png", &picture);
    let mut source = folder.said(Layout::Columns(3)).unwrap();
    assert_eq!(levels(&mut source, 0), [0, 50, 100]);
    let tall = GrayImage::from_fn(40, 108, |_, y| Luma([(y / 36) as u8 * 50]));
    let folder = Folder(TempDir::new().unwrap());
    folder.put("one.png", &tall);
    let mut source = folder.said(Layout::Rows(3)).unwrap();
    assert_eq!(levels(&mut source, 0), [0, 50, 100]);
}

#[test]
fn frames_of_a_rail_are_no_rig_and_a_rig_is_no_rail() {
    let names = grid(
        &["1", "2", "3", "4"],
        &["left", "centre", "right"],
        |time, camera| format!("{camera}_{time}.png"),
    );
    let folder = Folder::with(&names);
    let rail = Settings {
        mode: Mode::Rail,
        ..folder.settings()
    };
    let told = folder.told(&Source::open(&rail).unwrap_err());
    assert_eq!(
        told,
        "a rail passes one scene, and ~ is read as cameras and times by name (flat), left, centre, right at 4 times: give the folder of one camera, or say --layout rail where all are its frames"
    );
}

#[test]
fn images_beside_those_that_are_taken_are_counted() {
    let mut names = grid(
        &["1", "2", "3"],
        &["cam0", "cam1", "cam2"],
        |time, camera| format!("{camera}/{time}.png"),
    );
    names.push("overview.png".to_owned());
    let folder = Folder::with(&names);
    let source = folder.open();
    assert_eq!(source.layout(), Some(Layout::Cameras));
    assert!(
        source
            .warnings()
            .iter()
            .any(|warning| warning.starts_with("1 image that lies elsewhere in ")),
        "{:?}",
        source.warnings()
    );
}

#[test]
fn what_all_images_of_a_camera_have_in_their_names_is_no_part_of_the_time() {
    let mut names = grid(
        &["130750", "130751", "130752", "130753"],
        &["L", "C", "R"],
        |time, camera| format!("{camera}_view/fl09_{camera}_20240407_{time}.206341_rgb.png"),
    );
    names.retain(|name| !name.contains("L_20240407_130751"));
    let source = Folder::with(&names).open();
    assert_eq!(source.layout(), Some(Layout::Cameras));
    assert_eq!(source.scans(), 3);
    assert_eq!(
        files(&source)[1],
        ["L", "C", "R"]
            .map(|camera| format!("{camera}_view/fl09_{camera}_20240407_130752.206341_rgb.png"))
    );
    let names = grid(
        &["0", "1", "2"],
        &["left", "centre", "right"],
        |time, camera| format!("P000/image_{camera}/00000{time}_{camera}.png"),
    );
    let source = Folder::with(&names).open();
    assert_eq!(source.scans(), 3);
    assert!(
        source
            .warnings()
            .iter()
            .all(|warning| warning.contains("arbitrary"))
    );
    // Where folders say nothing the sides in the names of what they hold do.
    let names = grid(
        &["1", "2", "3"],
        &["left", "centre", "right"],
        |time, camera| format!("{}/image_{time}_{camera}.png", camera.len()),
    );
    assert_eq!(Folder::with(&names).open().layout(), Some(Layout::Cameras));
}

#[test]
fn dates_in_names_are_times_that_are_put_together_by_the_nearest() {
    let names = grid(
        &["0", "1", "2", "3", "4"],
        &["0", "1", "2"],
        |time, camera| format!("{camera}/shot_2024-04-07_23-59-5{time}.{camera}15.png"),
    );
    let mut left_out = names;
    left_out.retain(|name| !name.starts_with("1/shot_2024-04-07_23-59-52"));
    let source = Folder::with(&left_out).open();
    assert_eq!(source.layout(), Some(Layout::Cameras));
    assert_eq!(source.scans(), 4);
    assert_eq!(
        files(&source)[2],
        ["0", "1", "2"].map(|camera| format!("{camera}/shot_2024-04-07_23-59-53.{camera}15.png"))
    );
    // In one folder too: here the frames of one camera would be taken for the views of a scene.
    let names = grid(
        &["100", "200", "300"],
        &["left", "centre", "right"],
        |time, camera| {
            format!(
                "{camera}_1623412341{}.png",
                time.parse::<usize>().unwrap() + camera.len()
            )
        },
    );
    let source = Folder::with(&names).open();
    assert_eq!(source.layout(), Some(Layout::Flat));
    assert_eq!(
        files(&source)[1],
        [
            "left_1623412341204.png",
            "centre_1623412341206.png",
            "right_1623412341205.png"
        ]
    );
    // Two cameras may share their stamps, and a third have others.
    let names = grid(
        &["000", "033", "066"],
        &["Infrared 1", "Infrared 2", "Color"],
        |time, camera| {
            let late = if camera == "Color" { "4.5" } else { "0.25" };
            format!("out_{camera}_1556123456{}{late}.png", &time[..2])
        },
    );
    let source = Folder::with(&names).open();
    assert_eq!((source.layout(), source.scans()), (Some(Layout::Flat), 3));
    let names = grid(
        &["1", "2", "3"],
        &["22543210", "22543211", "22543215"],
        |time, camera| {
            let late = 120 + camera.len();
            format!("Basler_acA1920__{camera}__20210511_12000{time}{late}_000{time}.png")
        },
    );
    let source = Folder::with(&names).open();
    assert_eq!((source.layout(), source.scans()), (Some(Layout::Flat), 3));
}

#[test]
fn what_is_called_depth_or_mask_beside_views_is_left_out_and_that_is_said() {
    let views = grid(&["0", "1"], &["left", "centre", "right"], |time, camera| {
        format!("{camera}_{time}.png")
    });
    for made in [
        grid(&["0", "1"], &["left", "centre"], |time, camera| {
            format!("{camera}_{time}_depth.png")
        }),
        vec!["disparity/0.png".to_owned(), "disparity/1.png".to_owned()],
        vec!["masks/left_0.png".to_owned(); 9],
    ] {
        let folder = Folder::with(&[views.clone(), made.clone()].concat());
        let source = folder.open();
        assert_eq!(source.scans(), 2, "{made:?}");
        assert_eq!(
            files(&source)[0],
            ["left_0.png", "centre_0.png", "right_0.png"]
        );
        let said = "left out for their names, which say that they were made of images: ";
        let notices = source.notices();
        assert!(
            notices.iter().any(|notice| notice.starts_with(said)),
            "{notices:?}"
        );
    }
    let names = grid(
        &["0", "1", "2"],
        &["cam0", "cam1", "cam2", "depth"],
        |time, camera| format!("{camera}/{time}.png"),
    );
    assert_eq!(Folder::with(&names).open().layout(), Some(Layout::Cameras));
    let names = [
        "view0.png",
        "view1.png",
        "view2.png",
        "view0.jpg",
        "view1.jpg",
        "view2.jpg",
    ];
    let source = Folder::with(&names).open();
    assert_eq!(files(&source), [["view0.png", "view1.png", "view2.png"]]);
}

#[test]
fn images_deep_in_several_folders_are_told_of_and_what_systems_leave_is_none() {
    let names = grid(
        &["monday", "tuesday"],
        &["cam0", "cam1", "cam2"],
        |time, camera| format!("{time}/{camera}/1.png"),
    );
    let folder = Folder::with(&names);
    assert_eq!(
        folder.refusal(),
        "~ holds images only in folders of several folders (monday/cam0, tuesday/cam0): give the one whose folders or images are those of one recording"
    );
    let mut names = grid(&["0", "1"], &["cam0", "cam1", "cam2"], |time, camera| {
        format!("mav0/{camera}/data/{time}.png")
    });
    names.extend(["__MACOSX/mav0/cam0/data/0.png", "mav0/@eaDir/x/0.png"].map(str::to_owned));
    let folder = Folder::with(&names);
    fs::create_dir(folder.path().join("mav0/imu0")).unwrap();
    assert_eq!(folder.open().scans(), 2);
    let views = ["left.png", "centre.png", "right.png"]
        .map(str::to_owned)
        .to_vec();
    let calibration = (0..5).map(|shot| format!("calib/left{shot}.png")).collect();
    let source = Folder::with(&[views, calibration].concat()).open();
    assert_eq!(source.layout(), Some(Layout::Views));
    let warnings = source.warnings();
    let said = "5 images that lie elsewhere";
    assert!(
        warnings.iter().any(|warning| warning.starts_with(said)),
        "{warnings:?}"
    );
}

#[test]
fn cameras_of_which_some_say_their_side_are_refused_and_one_in_colour_is_between() {
    let names = |third: &'static str| {
        grid(
            &["0", "1", "2", "3"],
            &["left", third, "right"],
            |time, camera| format!("{camera}/{time}.png"),
        )
    };
    let told = Folder::with(&names("top")).refusal();
    assert!(
        told.starts_with("~ holds images that are called left and right, and top,"),
        "{told}"
    );
    let source = Folder::with(&names("color")).open();
    assert_eq!(
        files(&source)[0],
        ["left/0.png", "color/0.png", "right/0.png"]
    );
    let source = Folder::with(&["left_0.png", "right_0.png", "rgb_0.png"]).open();
    assert_eq!(files(&source), [["left_0.png", "rgb_0.png", "right_0.png"]]);
}

#[test]
fn four_places_in_words_are_views_and_cameras_may_be_lettered() {
    let places = [
        "left_outer.png",
        "left_inner.png",
        "right_inner.png",
        "right_outer.png",
    ];
    let folder = Folder::with(&places);
    let all = Settings {
        views: Views::All,
        ..folder.settings()
    };
    assert_eq!(files(&Source::open(&all).unwrap()), [places]);
    let names = grid(
        &["0", "1", "2"],
        &["CamA", "CamB", "CamC"],
        |time, camera| format!("{camera}/{time}.png"),
    );
    assert_eq!(Folder::with(&names).open().layout(), Some(Layout::Cameras));
    for names in [
        ["левая.png", "центр.png", "правая.png"],
        ["左カメラ.png", "中央カメラ.png", "右カメラ.png"],
        ["左相机.png", "中相机.png", "右相机.png"],
        ["왼쪽.png", "중앙.png", "오른쪽.png"],
    ] {
        assert_eq!(files(&Folder::with(&names).open()), [names]);
    }
}

#[test]
fn files_that_are_not_read_are_named_by_their_endings() {
    let folder = Folder(TempDir::new().unwrap());
    for name in ["IMG_1.HEIC", "IMG_2.HEIC", "IMG_1.MOV"] {
        fs::write(folder.path().join(name), "x").unwrap();
    }
    let told = folder.refusal();
    assert!(
        told.contains("only 3 other files (.HEIC, .MOV); expected are PNG"),
        "{told}"
    );
}

#[test]
fn pictures_of_which_one_is_turned_by_a_quarter_are_told_to_be() {
    let folder = Folder::with(&["0.png", "2.png"]);
    folder.put("1.png", &GrayImage::new(SIZE.1, SIZE.0));
    let told = folder.refusal();
    assert!(told.contains("is one turned by 90°"), "{told}");
}

#[test]
fn a_file_of_several_pictures_says_that_the_first_is_taken() {
    let folder = Folder(TempDir::new().unwrap());
    for name in ["left.tif", "centre.tif", "right.tif"] {
        let file = fs::File::create(folder.path().join(name)).unwrap();
        let mut encoder = tiff::encoder::TiffEncoder::new(file).unwrap();
        for page in 0..2u8 {
            let pixels = vec![page; (SIZE.0 * SIZE.1) as usize];
            encoder
                .write_image::<tiff::encoder::colortype::Gray8>(SIZE.0, SIZE.1, &pixels)
                .unwrap();
        }
    }
    let source = folder.open();
    let said = "left.tif holds several pictures, of which the first is taken: save each in a file of its own";
    assert!(
        source.warnings().contains(&said.to_owned()),
        "{:?}",
        source.warnings()
    );
}

#[test]
fn every_layout_is_written_as_it_is_said() {
    for text in [
        "views",
        "times",
        "cameras",
        "flat",
        "columns:3",
        "rows:2",
        "rail",
    ] {
        let layout: Layout = text.parse().unwrap();
        assert_eq!(layout.to_string(), text);
        assert_eq!(serde_json::to_value(layout).unwrap(), text);
    }
    for wrong in [
        "columns",
        "columns:1",
        "rows:0",
        "folders",
        "columns:x",
        "columns:99",
    ] {
        let told = wrong.parse::<Layout>().unwrap_err();
        assert!(
            told.contains("expected views, times, cameras, flat, columns:3, rows:3 or rail"),
            "{told}"
        );
    }
}
