//! Exports: what stands in them is what was recorded, and no half file is left behind.
#![expect(clippy::unwrap_used, reason = "tests")]

mod synthetic;

use std::fs;
use std::path::{Path, PathBuf};

use messages::{Rig, Size};
use record::{CSV_HEADER, Export, ExportError, Exported, Recording, Settings, Writer, export};
use synthetic::{Scan, metadata};

const SIZE: Size = Size::new(64, 48);

/// A recording of so many scans in a folder of its own.
fn recorded(rig: &Rig, scans: u64) -> (tempfile::TempDir, Recording) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("discs.mcap");
    let settings = Settings::default();
    let mut encoder = synthetic::encoder(rig, &settings);
    let mut writer = Writer::create(&path, false, &metadata(rig), &encoder, &settings).unwrap();
    for sequence in 0..scans {
        let scan = Scan::new(rig, sequence, 6);
        writer
            .write(&synthetic::batch(&mut encoder, &scan))
            .unwrap();
    }
    writer.finish(None).unwrap();
    (folder, Recording::open(&path).unwrap())
}

fn names(folder: &Path) -> Vec<String> {
    let all = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = all
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn csv_has_a_line_a_point_with_numbers_that_come_back_exactly() {
    let rig = synthetic::rig(SIZE);
    let (folder, mut recording) = recorded(&rig, 3);
    let path = folder.path().join("points.csv");
    let wanted = Export {
        csv: Some(path.clone()),
        ..Export::default()
    };
    let written = export(&mut recording, &wanted).unwrap();
    assert_eq!(written.len(), 1);
    let points = (0..3).map(|sequence| Scan::new(&rig, sequence, 6).points().len());
    let points = Some(points.sum::<usize>());
    assert_eq!(
        written[0],
        Exported {
            path: path.clone(),
            points
        }
    );
    let text = fs::read_to_string(&path).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("scan,view,channel,curve,x,y,disparity,score,depth")
    );
    assert_eq!(
        CSV_HEADER,
        "scan,view,channel,curve,x,y,disparity,score,depth"
    );
    for sequence in 0..3 {
        for point in Scan::new(&rig, sequence, 6).points() {
            let cells: Vec<_> = lines.next().unwrap().split(',').collect();
            assert_eq!(
                cells[..4],
                [
                    &*sequence.to_string(),
                    "left",
                    "1.5",
                    &*point.curve.to_string()
                ]
            );
            let numbers: Vec<f32> = cells[4..]
                .iter()
                .map(|cell| cell.parse().unwrap())
                .collect();
            assert_eq!(
                numbers,
                [point.u, point.v, point.disparity, point.score, point.z]
            );
        }
    }
    assert_eq!(lines.next(), None);

    let wanted = Export {
        scan: Some(1),
        ..wanted
    };
    export(&mut recording, &wanted).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.lines().skip(1).all(|line| line.starts_with("1,")));
    assert_eq!(
        text.lines().count(),
        1 + Scan::new(&rig, 1, 6).points().len()
    );
}

#[test]
fn pfm_holds_the_disparity_picture_from_the_bottom_up_with_infinity_where_unknown() {
    let rig = synthetic::rig(SIZE);
    let (folder, mut recording) = recorded(&rig, 2);
    let path = folder.path().join("disparity.pfm");
    let wanted = Export {
        scan: Some(1),
        pfm: Some(path.clone()),
        ..Export::default()
    };
    export(&mut recording, &wanted).unwrap();
    let bytes = fs::read(&path).unwrap();
    let header = b"Pf\n64 48\n-1\n";
    assert!(bytes.starts_with(header));
    let values: Vec<f32> = bytes[header.len()..]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    assert_eq!(values.len(), SIZE.pixels());
    let scan = Scan::new(&rig, 1, 6);
    let mut known = 0;
    for (i, expected) in scan.disparity().iter().enumerate() {
        let (x, y) = (i % 64, i / 64);
        let value = values[(47 - y) * 64 + x];
        assert!(value == *expected || (expected.is_nan() && value == f32::INFINITY));
        known += usize::from(expected.is_finite());
    }
    assert!(known > 50);
}

#[test]
fn ply_holds_the_points_in_metres_with_gray_levels_and_says_whether_it_is_calibrated() {
    let calibrated = synthetic::rig(SIZE);
    let guessed = Rig {
        calibration: None,
        ..calibrated.clone()
    };
    for (rig, said) in [
        (calibrated, "comment calibrated: metres"),
        (guessed, "comment not calibrated"),
    ] {
        let (folder, mut recording) = recorded(&rig, 1);
        let path = folder.path().join("points.ply");
        let wanted = Export {
            ply: Some(path.clone()),
            ..Export::default()
        };
        export(&mut recording, &wanted).unwrap();
        let bytes = fs::read(&path).unwrap();
        let end = b"end_header\n";
        let at = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = std::str::from_utf8(&bytes[..at]).unwrap();
        assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
        assert!(header.contains(said), "{header}");
        let scan = Scan::new(&rig, 0, 6);
        assert!(header.contains(&format!("element vertex {}\n", scan.points().len())));
        let rows: Vec<&[u8]> = bytes[at..].chunks(5 * 4 + 3).collect();
        assert_eq!(rows.len(), scan.points().len());
        for (row, point) in rows.iter().zip(scan.points()) {
            let floats: Vec<f32> = row[..20]
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
            assert_eq!(
                floats,
                [point.x, point.y, point.z, point.disparity, point.score]
            );
            let gray = scan.image()[point.v.round() as usize * 64 + point.u.round() as usize];
            assert_eq!(row[20..], [gray; 3]);
        }
    }
}

#[test]
fn png_gives_the_four_pictures_of_every_view_and_channel_in_names_that_sort() {
    let rig = synthetic::rig(SIZE);
    let (folder, mut recording) = recorded(&rig, 2);
    let png = folder.path().join("made/of/pictures");
    let wanted = Export {
        scan: Some(1),
        png: Some(png.clone()),
        ..Export::default()
    };
    let written = export(&mut recording, &wanted).unwrap();
    let mut expected = Vec::new();
    for (view, name) in ["0-left", "1-centre", "2-right"].into_iter().enumerate() {
        expected.push(format!("000001-{name}-0-original.png"));
        for channel in ["1-8", "2-1.5"] {
            for step in ["1-zero-crossings", "2-orientation", "3-curves"] {
                expected.push(format!("000001-{name}-{channel}-{step}.png"));
            }
            if view == 0 {
                expected.push(format!("000001-{name}-{channel}-4-disparity.png"));
            }
        }
    }
    assert_eq!(names(&png), expected);
    let written: Vec<PathBuf> = written.into_iter().map(|file| file.path).collect();
    assert_eq!(
        written,
        expected
            .iter()
            .map(|name| png.join(name))
            .collect::<Vec<PathBuf>>()
    );
    let open = |name: &str| image::open(png.join(name)).unwrap();
    assert_eq!(
        open(&expected[0]).into_luma8().as_raw(),
        Scan::new(&rig, 1, 6).image()
    );
    // Every zero-crossing has an orientation, and nothing else has.
    let zero = open("000001-0-left-1-8-1-zero-crossings.png").into_luma8();
    let turned = open("000001-0-left-1-8-2-orientation.png").into_luma8();
    assert!(
        zero.pixels()
            .zip(turned.pixels())
            .all(|(z, o)| (z.0 == [0]) == (o.0 != [0]))
    );
    assert!(zero.pixels().any(|pixel| pixel.0 == [0]));
    let curves = open("000001-0-left-1-8-3-curves.png").into_rgb8();
    let colours: std::collections::BTreeSet<_> = curves.pixels().map(|p| p.0).collect();
    assert!(colours.len() >= 6, "{colours:?}");
}

#[test]
fn the_thesis_s_figures_are_numbered_object_by_object_and_the_same_every_time() {
    let rig = synthetic::rig(SIZE);
    let (folder, mut recording) = recorded(&rig, 2);
    let mut made = Vec::new();
    for name in ["one", "two"] {
        let thesis = folder.path().join(name);
        let wanted = Export {
            thesis: Some(thesis.clone()),
            ..Export::default()
        };
        let written = export(&mut recording, &wanted).unwrap();
        let bytes = |path: &PathBuf| std::fs::read(path).unwrap();
        let files: Vec<PathBuf> = written.into_iter().map(|file| file.path).collect();
        made.push(files.iter().map(bytes).collect::<Vec<_>>());
        let mut expected = vec!["contact-sheet.png".to_owned()];
        let objects = ["discs", "scan-1"];
        let mut number = 1;
        for object in objects {
            expected.push(format!("B.{number:02}-{object}-original.png"));
            number += 1;
            for channel in ["8", "1.5"] {
                for step in ["zero-crossings", "orientation", "segments", "disparity"] {
                    expected.push(format!("B.{number:02}-{object}-{channel}-{step}.png"));
                    number += 1;
                }
            }
        }
        expected.sort();
        assert_eq!(names(&thesis), expected);
    }
    assert_eq!(made[0], made[1]);
    let open = |name: String| image::open(folder.path().join("one").join(name)).unwrap();
    let object = "discs";
    // Three views side by side, and of orientations two rows.
    let strip = open(format!("B.01-{object}-original.png"));
    assert_eq!(
        (strip.width(), strip.height()),
        (3 * SIZE.width + 16, SIZE.height)
    );
    let turned = open(format!("B.03-{object}-8-orientation.png")).into_rgb8();
    assert_eq!(turned.height(), 2 * SIZE.height + 8);
    // A zero-crossing has both.
    let row = |y: u32| {
        (0..SIZE.width)
            .map(|x| turned.get_pixel(x, y).0 != [0; 3])
            .collect::<Vec<_>>()
    };
    assert!((0..SIZE.height).all(|y| row(y) == row(SIZE.height + 8 + y)));
    assert!((0..SIZE.height).any(|y| row(y).contains(&true)));
}

#[test]
fn one_file_of_several_scans_asks_which_and_leaves_nothing() {
    let (folder, mut recording) = recorded(&synthetic::rig(SIZE), 2);
    let pfm = folder.path().join("disparity.pfm");
    let wanted = Export {
        pfm: Some(pfm),
        ..Export::default()
    };
    let error = export(&mut recording, &wanted).unwrap_err().to_string();
    assert!(
        error.contains("0 to 1") && error.contains("--scan"),
        "{error}"
    );
    let wanted = Export {
        scan: Some(9),
        ..wanted
    };
    let error = export(&mut recording, &wanted).unwrap_err().to_string();
    assert!(error.contains("there is no scan 9"), "{error}");
    assert_eq!(names(folder.path()), ["discs.mcap"]);
}

#[test]
fn an_export_that_fails_leaves_the_old_file_and_no_half_one() {
    let (folder, mut recording) = recorded(&synthetic::rig(SIZE), 2);
    let csv = folder.path().join("points.csv");
    fs::write(&csv, "old").unwrap();
    // The recording is damaged where the points of its second scan are.
    let path = recording.path().to_owned();
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2 + bytes.len() / 8;
    bytes[middle..middle + 2000].fill(0);
    fs::write(&path, bytes).unwrap();
    let wanted = Export {
        csv: Some(csv.clone()),
        ..Export::default()
    };
    let error = export(&mut recording, &wanted).unwrap_err();
    assert!(matches!(error, ExportError::Read(_)), "{error}");
    assert_eq!(fs::read_to_string(&csv).unwrap(), "old");
    assert_eq!(names(folder.path()), ["discs.mcap", "points.csv"]);

    let nowhere = Export {
        scan: Some(0),
        csv: Some(folder.path().join("no/points.csv")),
        ..Export::default()
    };
    let error = export(&mut recording, &nowhere).unwrap_err().to_string();
    assert!(
        error.contains("cannot write") && error.contains("no/points.csv"),
        "{error}"
    );
    // A folder stands where the file should be.
    fs::create_dir(folder.path().join("taken")).unwrap();
    let taken = Export {
        scan: Some(0),
        csv: Some(folder.path().join("taken")),
        ..Export::default()
    };
    assert!(export(&mut recording, &taken).is_err());
    assert_eq!(names(folder.path()), ["discs.mcap", "points.csv", "taken"]);
}

#[test]
fn a_recording_without_a_whole_scan_is_told() {
    let (_folder, mut recording) = recorded(&synthetic::rig(SIZE), 0);
    assert!(recording.is_complete());
    let error = export(&mut recording, &Export::default()).unwrap_err();
    assert!(matches!(error, ExportError::NoScan));
}
