//! A recording as one page.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use harness::World;

/// The page of a recording of a small scene.
fn page(world: &World, arguments: &[&str]) -> String {
    let all = [&["report", "x.mcap", "-o", "r.html"], arguments].concat();
    world.run(&all).done();
    std::fs::read_to_string(world.path("r.html")).unwrap()
}

/// The address of everything a page asks for.
fn addresses(page: &str) -> Vec<&str> {
    let of = |attribute: &'static str| {
        page.split(attribute)
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
    };
    [" src=\"", " href=\"", "url("]
        .into_iter()
        .flat_map(of)
        .collect()
}

#[test]
fn a_page_holds_every_figure_and_asks_for_nothing_from_outside() {
    let world = World::recorded("3");
    let page = page(&world, &[]);
    for view in ["left", "centre", "right"] {
        assert!(
            page.contains(&format!("alt=\"Original, view {view}\"")),
            "{view}"
        );
    }
    for channel in ["2.2", "0.8"] {
        for figure in [
            "Zero-crossings",
            "Orientation",
            "Curve segments",
            "Disparity along",
        ] {
            let of_channel = format!("view left, channel σ² = {channel}");
            let is_it = |alt: &str| {
                let alt = alt.split('"').next().unwrap();
                alt.starts_with(figure) && alt.contains(&of_channel)
            };
            let count = page
                .split(" alt=\"")
                .skip(1)
                .filter(|alt| is_it(alt))
                .count();
            assert_eq!(count, 1, "{figure}, {of_channel}");
        }
    }
    for told in [
        "Points from above on the left",
        "Points from the right",
        "Disparity picture",
        "Histogram: Residual of matches",
        "filter, track, hough, match over the scans",
        "<h2>Ledger</h2>",
        "3 admitted, 3 done",
        "profile default",
        "scan 0 of 3; --scans A..B shows others",
        "not calibrated",
    ] {
        assert!(page.contains(told), "{told}");
    }
    for address in addresses(&page) {
        let is_inside = address.starts_with("data:image/png;base64,") || address.starts_with('#');
        assert!(is_inside, "{address}");
    }
    for outside in ["http://", "https://", "<script", "@import", "NaN"] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(page.ends_with("</html>\n") && page.len() < 15_000_000);
}

#[test]
fn the_thesis_s_figures_are_a_page_of_their_own() {
    let world = World::recorded("1");
    let path = world.path("figures.html");
    world
        .run(&["report", "x.mcap", "--thesis", &path.to_string_lossy()])
        .done();
    let page = std::fs::read_to_string(&path).unwrap();
    // Nine figures of the one object.
    for number in 1..=9 {
        assert_eq!(
            page.matches(&format!("<b>B.{number} ")).count(),
            1,
            "B.{number}"
        );
    }
    assert!(!page.contains("<b>B.10 "), "there is one object");
    for address in addresses(&page) {
        let is_inside = address.starts_with("data:image/png;base64,") || address.starts_with('#');
        assert!(is_inside, "{address}");
    }
    let again = world.run(&["report", "x.mcap", "--thesis", &path.to_string_lossy()]);
    assert_eq!(again.code, Some(2), "{again:?}");
    assert!(again.err.contains("--force overwrites it"), "{again:?}");
}

#[test]
fn the_same_recording_gives_the_same_bytes() {
    let world = World::recorded("2");
    let [one, other] = ["", "--force"].map(|force| {
        let arguments = [force];
        page(&world, if force.is_empty() { &[] } else { &arguments })
    });
    assert!(one.len() > 50_000 && one == other);
}

#[test]
fn the_scans_that_are_asked_for_are_shown() {
    let world = World::recorded("4");
    let page = page(&world, &["--scans", "1..3"]);
    let shown = |scan: u32| page.contains(&format!("<section id=\"scan-{scan}\">"));
    assert_eq!([0, 1, 2, 3].map(shown), [false, true, true, false]);
    assert!(page.contains("scans 1, 2 of 4"));
    let ran = world.run(&["report", "x.mcap", "-o", "none.html", "--scans", "9.."]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(ran.err.contains("it holds 0 to 3"), "{}", ran.err);
    assert!(!world.path("none.html").exists());
}

#[test]
fn names_are_text_whatever_they_hold() {
    let world = World::new();
    let source = world.small_scene("<b>&x");
    let source = source.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "1", "--record", "x.mcap",
    ];
    world.run(&run).done();
    let page = page(&world, &[]);
    assert!(page.contains("Scan 0: &lt;b&gt;&amp;x"), "its heading");
    assert!(!page.contains("<b>&x") && !page.contains("<b>&amp;x"));
}

#[test]
fn a_page_overwrites_nothing_unless_it_is_told_to_and_never_its_recording() {
    let world = World::recorded("1");
    std::fs::write(world.path("r.html"), "mine").unwrap();
    let ran = world.run(&["report", "x.mcap", "-o", "r.html"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(ran.err.contains("r.html is there already"), "{}", ran.err);
    assert_eq!(std::fs::read(world.path("r.html")).unwrap(), b"mine");
    let before = std::fs::read(world.path("x.mcap")).unwrap();
    let ran = world.run(&["report", "x.mcap", "-o", "x.mcap", "--force"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert_eq!(std::fs::read(world.path("x.mcap")).unwrap(), before);
    let page = page(&world, &["--force"]);
    assert!(page.starts_with("<!DOCTYPE html>"));
    let out = world.run(&["report", "x.mcap", "-o", "-"]).done().out;
    assert_eq!(out, page);
}

#[test]
fn what_a_recording_does_not_hold_is_said() {
    let world = World::recorded("2");
    let topics = "camera/*/image,edges/left/*";
    world
        .run(&["filter", "x.mcap", "--topics", topics, "-o", "f.mcap"])
        .done();
    world.run(&["report", "f.mcap", "-o", "f.html"]).done();
    let page = std::fs::read_to_string(world.path("f.html")).unwrap();
    for told in [
        "Scan 0 has no curves/left/2.2.",
        "Scan 0 has no matches/0.8.",
        "Scan 0 has no disparity.",
        "Scan 0 has no points.",
        "holds no statistics",
        "alt=\"Zero-crossings, view left",
    ] {
        assert!(page.contains(told), "{told}");
    }
    for command in [
        ["report", "none.mcap", "-o", "n.html"],
        ["report", "f.html", "-o", "n.html"],
    ] {
        let ran = world.run(&command);
        assert_eq!(ran.code, Some(1), "{ran:?}");
        assert!(!world.path("n.html").exists());
    }
}

#[test]
fn a_damaged_scan_is_shown_as_far_as_it_can_be_read() {
    let world = World::recorded("2");
    let mut bytes = std::fs::read(world.path("x.mcap")).unwrap();
    // Within the first chunk of messages.
    let place = 100_000;
    for byte in &mut bytes[place..place + 64] {
        *byte ^= 0x5a;
    }
    std::fs::write(world.path("bad.mcap"), &bytes).unwrap();
    let ran = world.run(&["report", "bad.mcap", "-o", "b.html", "--scans", "0.."]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert!(ran.err.contains("are damaged"), "{}", ran.err);
    let page = std::fs::read_to_string(world.path("b.html")).unwrap();
    assert!(page.contains("bytes of this scan are damaged"));
    assert!(page.contains("<section id=\"scan-1\">") && page.ends_with("</html>\n"));
}
