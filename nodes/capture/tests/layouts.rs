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

#[test]
fn two_folders_of_one_camera_are_named_and_never_times() {
    let sides = ["left", "centre", "right"];
    let with = |ends: [&str; 2]| -> Vec<String> {
        let both = |side: &&str| ends.map(|end| end.replace('*', side));
        sides.iter().flat_map(both).collect()
    };
    for (folders, twins) in [
        (with(["*", "*_color"]), "left and left_color"),
        (with(["*_gray", "*_color"]), "left_color and left_gray"),
        (with(["*", "*_raw"]), "left and left_raw"),
        (with(["*1", "*2"]), "centre1 and centre2"),
        (
            with(["session0_*", "session1_*"]),
            "session0_left and session1_left",
        ),
        (with(["*_scan1", "*_scan2"]), "left_scan1 and left_scan2"),
        (
            ["L", "L_raw", "C", "C_raw", "R", "R_raw"]
                .map(str::to_owned)
                .to_vec(),
            "L and L_raw",
        ),
        (
            ["cam0", "cam0_raw", "cam1", "cam1_raw", "cam2", "cam2_raw"]
                .map(str::to_owned)
                .to_vec(),
            "cam0 and cam0_raw",
        ),
        (
            ["Left", "left", "centre", "right"]
                .map(str::to_owned)
                .to_vec(),
            "Left and left",
        ),
        (
            ["front_left", "front_right", "rear_left", "rear_right"]
                .map(str::to_owned)
                .to_vec(),
            "front_left and rear_left",
        ),
    ] {
        let folders: Vec<&str> = folders.iter().map(String::as_str).collect();
        for count in [3, 5, 12] {
            let times: Vec<String> = (0..count).map(|time| time.to_string()).collect();
            let times: Vec<&str> = times.iter().map(String::as_str).collect();
            let names = grid(&times, &folders, |time, camera| {
                format!("{camera}/{time}.png")
            });
            let told = Folder::with(&names).refusal();
            let is_named = told.starts_with(&format!(
                "~ holds two folders of one camera, {twins}: give a folder that holds one set"
            ));
            let is_open = told.starts_with("~ can be read as 6 cameras at");
            assert!(
                is_named || (is_open && twins.contains("scan")),
                "{folders:?}: {told}"
            );
        }
    }
    // Chosen by place they go from left to right.
    let folders = with(["*", "*_color"]);
    let folders: Vec<&str> = folders.iter().map(String::as_str).collect();
    let names = grid(&["0", "1", "2"], &folders, |time, camera| {
        format!("{camera}/{time}.png")
    });
    let folder = Folder::with(&names);
    let chosen = Settings {
        views: Views::These(vec![0, 2, 4]),
        ..folder.settings()
    };
    assert_eq!(
        files(&Source::open(&chosen).unwrap())[1],
        sides.map(|side| format!("{side}/1.png"))
    );
    // One camera's own folders are no times either.
    let names = grid(&["0", "1", "2"], &["left", "left_color"], |time, camera| {
        format!("{camera}/{time}.png")
    });
    let told = Folder::with(&names).refusal();
    assert!(told.contains("2 of the at least three cameras"), "{told}");
}

#[test]
fn two_images_of_one_camera_are_named_where_folders_are_times_or_all_lie_in_one() {
    let names = [
        "left",
        "left_color",
        "centre",
        "centre_color",
        "right",
        "right_color",
    ];
    for name in ["*.png", "scan_0/*.png", "*_00.png"] {
        let mut all: Vec<String> = names.iter().map(|own| name.replace('*', own)).collect();
        if name != "*.png" {
            all.extend(all.clone().iter().map(|own| own.replace('0', "1")));
        }
        let told = Folder::with(&all).refusal();
        assert!(
            told.contains(" two images of one camera, left"),
            "{name}: {told}"
        );
    }
    // A half step has the number of a camera, and is no other one.
    let names = ["view1.png", "view1_5.png", "view2.png"];
    assert_eq!(files(&Folder::with(&names).open()), [names]);
}

#[test]
fn folders_that_have_a_side_in_common_may_be_times() {
    let times = [
        "center_stage_1",
        "center_stage_2",
        "center_stage_3",
        "center_stage_4",
    ];
    for views in [["left", "centre", "right"], ["0", "1", "2"]] {
        let names = grid(&times, &views, |time, camera| {
            format!("{time}/{camera}.png")
        });
        let source = Folder::with(&names).open();
        assert_eq!(source.layout(), Some(Layout::Times), "{views:?}");
        assert_eq!(source.scans(), 4);
    }
}

#[test]
fn frames_of_one_cameras_kind_are_no_views_of_a_scene() {
    for names in [
        &["rgb/*.png", "depth/*.png"][..],
        &["rgb/*.png"],
        &["color/*.png", "depth/*.png"],
        &["image_raw/*.png"],
        &["infra1/*.png"],
        &["depth/*.png"],
        &["rgb/data/*.png"],
        &["rgb_*.png", "depth_*.png"],
    ] {
        for times in [&["0", "1", "2"][..], &["7", "8", "9", "10", "11"]] {
            let all = grid(times, names, |time, name| name.replace('*', time));
            let folder = Folder::with(&all);
            let told = folder.refusal();
            assert!(
                told.contains("can be read as the images of one camera (")
                    && told
                        .contains("and as the views of one scene: say which with --layout views"),
                "{names:?}: {told}"
            );
        }
    }
    let inside = Folder::with(&["rgb/0.png", "rgb/1.png", "rgb/2.png"]);
    assert_eq!(inside.said(Layout::Views).unwrap().scans(), 1);
    // Two kinds are no two times.
    let names = grid(&["0", "1", "2"], &["rgb", "ir"], |time, kind| {
        format!("{kind}/{time}.png")
    });
    let told = Folder::with(&names).refusal();
    assert!(told.contains("2 of the at least three cameras"), "{told}");
    let names = grid(
        &["0", "1"],
        &["rgb", "ir", "gray", "thermal"],
        |time, kind| format!("{kind}/{time}.png"),
    );
    let told = Folder::with(&names).refusal();
    assert!(
        told.contains("say which with --layout cameras or --layout times"),
        "{told}"
    );
    // What is called after views is such, and so is what is called after nothing.
    for names in [
        ["rgb/left.png", "rgb/centre.png", "rgb/right.png"],
        ["color/view0.png", "color/view1.png", "color/view2.png"],
        ["images/0.png", "images/1.png", "images/2.png"],
        ["frames/0.png", "frames/1.png", "frames/2.png"],
        [
            "color_wheel/0.png",
            "color_wheel/1.png",
            "color_wheel/2.png",
        ],
        ["gray_0.png", "gray_1.png", "gray_2.png"],
    ] {
        let source = Folder::with(&names).open();
        assert_eq!(source.layout(), Some(Layout::Views), "{names:?}");
        assert_eq!(files(&source), [names]);
    }
}

#[test]
fn images_deeper_than_those_that_are_taken_are_counted() {
    let cameras = ["left", "centre", "right"];
    let rig = grid(&["1", "2"], &cameras, |time, camera| {
        format!("{camera}/{time}.png")
    });
    for (more, count) in [
        (
            grid(&["1", "2"], &cameras, |time, camera| {
                format!("run2/{camera}/{time}.png")
            }),
            6,
        ),
        (
            vec!["left/old/1.png".to_owned(), "left/old/2.png".to_owned()],
            2,
        ),
        (vec!["centre/a/b/c/1.png".to_owned()], 1),
    ] {
        let source = Folder::with(&[rig.clone(), more.clone()].concat()).open();
        assert_eq!(source.layout(), Some(Layout::Cameras), "{more:?}");
        assert_eq!(source.scans(), 2);
        let (images, lie) = match count {
            1 => ("image", "lies"),
            _ => ("images", "lie"),
        };
        let said = format!("{count} {images} that {lie} elsewhere in ");
        let warnings = source.warnings();
        assert!(
            warnings.iter().any(|warning| warning.starts_with(&said)),
            "{more:?}: {warnings:?}"
        );
    }
    // Beside a folder that holds all that is read, too.
    let views = cameras
        .map(|camera| format!("images/{camera}.png"))
        .to_vec();
    let deeper = grid(&["1", "2"], &cameras, |time, camera| {
        format!("run2/{camera}/{time}.png")
    });
    let source = Folder::with(&[views, deeper].concat()).open();
    let said = "6 images that lie elsewhere in ";
    let warnings = source.warnings();
    assert!(
        warnings.iter().any(|warning| warning.starts_with(said)),
        "{warnings:?}"
    );
}

#[test]
fn times_of_which_a_few_are_the_same_by_chance_go_together_by_the_nearest() {
    let at = |camera: usize, time: usize| 50 * time + if time > 0 { camera } else { 0 };
    type Name = fn(usize, usize) -> String;
    let cases: [Name; 8] = [
        |camera, at| format!("cam{camera}/{at}.png"),
        |camera, at| format!("cam{camera}/{}.png", 1_700_000_000_000 + at),
        |camera, at| format!("cam{camera}/0.{:06}.png", 1000 * at),
        |camera, at| format!("cam{camera}/shot_{camera}_{at}.png"),
        |camera, at| format!("cam{camera}_{at}.png"),
        |camera, at| format!("{at}_cam{camera}.png"),
        |camera, at| format!("cam{camera}_{}.png", 1_700_000_000_000 + at),
        |camera, at| format!("cam{camera}_0.{:06}.png", 1000 * at),
    ];
    for (number, name) in cases.into_iter().enumerate() {
        for count in [3, 6] {
            let all = (0..count).flat_map(|time| (0..3).map(move |camera| (camera, time)));
            let names: Vec<String> = all
                .map(|(camera, time)| name(camera, at(camera, time)))
                .collect();
            let source = Folder::with(&names).open();
            assert_eq!(
                source.scans(),
                count as u64,
                "case {number}: {:?}",
                source.warnings()
            );
            assert_eq!(
                files(&source)[2],
                [0, 1, 2].map(|camera| name(camera, at(camera, 2))),
                "case {number}"
            );
            assert!(
                source.notices().contains(
                    &"images are put together by the times they are called after".to_owned()
                ),
                "case {number}"
            );
        }
    }
    // Half of them are the same: the others are near, too.
    let at = |camera: usize, time: usize| 50 * time + if time % 3 == 2 { camera } else { 0 };
    let all = (0..9).flat_map(|time| (0..3).map(move |camera| (camera, time)));
    let names: Vec<String> = all
        .map(|(camera, time)| format!("cam{camera}/{}.png", at(camera, time)))
        .collect();
    assert_eq!(Folder::with(&names).open().scans(), 9);
    // Frames that are counted one by one, of which some are missing, go by their names.
    let mut names = grid(
        &["1", "2", "3", "4", "5"],
        &["cam0", "cam1", "cam2"],
        |time, camera| format!("{camera}/{time}.png"),
    );
    names.retain(|name| name != "cam0/2.png" && name != "cam1/4.png");
    let source = Folder::with(&names).open();
    assert_eq!(source.scans(), 3);
    assert_eq!(
        files(&source)[1],
        ["cam0/3.png", "cam1/3.png", "cam2/3.png"]
    );
}

#[test]
fn a_side_in_what_all_names_have_is_none_of_the_cameras() {
    for names in [
        [
            "right_arm_left.png",
            "right_arm_center.png",
            "right_arm_right.png",
        ],
        ["left_left.png", "left_mid.png", "left_right.png"],
    ] {
        assert_eq!(files(&Folder::with(&names).open()), [names]);
    }
    let names = grid(
        &["1", "2", "3"],
        &["left_arm_left", "left_arm_center", "left_arm_right"],
        |time, camera| format!("{camera}/{time}.png"),
    );
    let source = Folder::with(&names).open();
    assert_eq!(source.layout(), Some(Layout::Cameras));
    assert_eq!(
        files(&source)[0],
        [
            "left_arm_left/1.png",
            "left_arm_center/1.png",
            "left_arm_right/1.png"
        ]
    );
    assert_eq!(
        source
            .views(0)
            .into_iter()
            .map(|view| view.name)
            .collect::<Vec<_>>(),
        files(&source)[0],
        "files of one name are named with their folder"
    );
}

#[test]
fn accents_are_the_same_in_whichever_way_a_system_writes_them() {
    // As one sign, and as a letter with a mark.
    let (composed, marked) = (
        ["v\u{e4}nster", "mitten", "h\u{f6}ger"],
        ["va\u{308}nster", "mitten", "ho\u{308}ger"],
    );
    for cameras in [composed, marked] {
        let names = cameras.map(|camera| format!("{camera}.png"));
        let source = Folder::with(&names).open();
        assert_eq!(source.views(0)[0].name, names[0]);
        let names = grid(&["sk\u{e5}l", "a"], &cameras, |time, camera| {
            let time = match camera {
                "mitten" => time.replace('\u{e5}', "a\u{30a}"),
                _ => time.to_owned(),
            };
            format!("{camera}/{time}.png")
        });
        let source = Folder::with(&names).open();
        assert_eq!(source.layout(), Some(Layout::Cameras));
        assert_eq!(source.scans(), 2, "{:?}", source.warnings());
    }
}

#[test]
fn animations_and_pnm_files_of_several_pictures_say_that_the_first_is_taken() {
    let pixels = vec![7; (SIZE.0 * SIZE.1) as usize];
    let pgm = [
        format!("P5\n# a camera's\n{} {}\n255\n", SIZE.0, SIZE.1).as_bytes(),
        &pixels,
    ]
    .concat();
    let deep = [
        format!("P5 {} {} 4095\n", SIZE.0, SIZE.1).as_bytes(),
        &pixels,
        &pixels,
    ]
    .concat();
    let pam = format!(
        "P7\nWIDTH {}\nHEIGHT {}\nDEPTH 1\nMAXVAL 255\nTUPLTYPE GRAYSCALE\nENDHDR\n",
        SIZE.0, SIZE.1
    );
    let pam = [pam.as_bytes(), &pixels].concat();
    let apng = |frames: u32| {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, SIZE.0, SIZE.1);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_animated(frames, 0).unwrap();
        let mut writer = encoder.write_header().unwrap();
        (0..frames).for_each(|_| writer.write_image_data(&pixels).unwrap());
        writer.finish().unwrap();
        file
    };
    for (ending, one, several) in [
        ("pgm", pgm.clone(), [pgm.clone(), pgm.clone()].concat()),
        ("pgm", deep.clone(), [&deep[..], b"\n", &deep[..]].concat()),
        ("pnm", pam.clone(), [pam.clone(), pam].concat()),
        ("png", apng(1), apng(2)),
    ] {
        for (bytes, is_several) in [(one, false), (several, true)] {
            let folder = Folder(TempDir::new().unwrap());
            for side in ["left", "centre", "right"] {
                fs::write(folder.path().join(format!("{side}.{ending}")), &bytes).unwrap();
            }
            let said = format!(
                "left.{ending} holds several pictures, of which the first is taken: save each in a file of its own"
            );
            let source = folder.open();
            assert_eq!(source.warnings().contains(&said), is_several, "{said}");
        }
    }
}
