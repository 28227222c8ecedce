//! A recording as one page.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::collections::BTreeSet;

use harness::World;
use scraper::{ElementRef, Html, Selector};

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

/// A page as a browser reads it, and it finds nothing wrong with it.
fn parsed(page: &str) -> Html {
    let html = Html::parse_document(page);
    assert!(html.errors.is_empty(), "{:?}", html.errors);
    html
}

/// What a selector of CSS finds, in the order of the page.
fn all<'a>(html: &'a Html, selector: &str) -> Vec<ElementRef<'a>> {
    html.select(&Selector::parse(selector).unwrap()).collect()
}

fn text(element: ElementRef<'_>) -> String {
    element.text().collect()
}

/// The sections of a page in their order, by their ids.
fn sections(html: &Html) -> Vec<&str> {
    let sections = all(html, "section").into_iter();
    sections
        .map(|section| section.attr("id").unwrap())
        .collect()
}

#[test]
fn every_section_is_reached_from_the_navigation_in_the_order_of_the_page() {
    let world = World::recorded("2");
    let html = parsed(&page(&world, &["--scans", "0.."]));
    let links = all(&html, "nav a").into_iter();
    let links: Vec<&str> = links
        .map(|link| link.attr("href").unwrap().strip_prefix('#').unwrap())
        .collect();
    assert_eq!(links, sections(&html));
    let ids: Vec<&str> = all(&html, "[id]")
        .iter()
        .map(|element| element.attr("id").unwrap())
        .collect();
    assert_eq!(BTreeSet::from_iter(&ids).len(), ids.len(), "{ids:?}");
}

#[test]
fn every_picture_is_embedded_once_and_opened_by_a_button_of_its_own() {
    // The same still scene twice: what is the same is not embedded again.
    let world = World::recorded("2");
    let html = parsed(&page(&world, &["--scans", "0.."]));
    let pictures = all(&html, "img[src^='data:'], image[href^='data:']");
    let held: BTreeSet<&str> = pictures
        .iter()
        .map(|picture| picture.attr("src").or(picture.attr("href")).unwrap())
        .collect();
    assert!(held.len() > 10 && held.len() == pictures.len());
    let opened: BTreeSet<&str> = all(&html, "button[popovertarget]")
        .iter()
        .map(|button| button.attr("popovertarget").unwrap())
        .collect();
    for picture in pictures {
        let figure = picture
            .ancestors()
            .filter_map(ElementRef::wrap)
            .find(|element| element.value().name() == "figure")
            .unwrap();
        assert!(figure.attr("popover").is_some());
        assert!(opened.contains(figure.attr("id").unwrap()));
    }
    let again = all(&html, "#scan-1 figure.same a");
    assert!(!again.is_empty());
    for link in again {
        let first = format!("#scan-0 {}", link.attr("href").unwrap());
        assert_eq!(all(&html, &first).len(), 1, "{first}");
    }
}

#[test]
fn every_axis_of_every_plot_has_its_name_and_its_unit() {
    let world = World::recorded("2");
    let html = parsed(&page(&world, &[]));
    let axis = Selector::parse("text.axis").unwrap();
    let (plots, spaces) = (all(&html, ".plot svg"), all(&html, "svg.space"));
    assert!(plots.len() > 8 && spaces.len() == 3);
    for drawing in plots.iter().chain(&spaces) {
        let names: Vec<String> = drawing.select(&axis).map(text).collect();
        assert!(names.len() >= 2, "{names:?}");
        for name in names {
            let (what, unit) = name.split_once(" (").unwrap();
            assert!(
                !what.is_empty() && unit.len() > 1 && unit.ends_with(')'),
                "{name}"
            );
        }
    }
}

#[test]
fn what_was_set_stands_apart_from_what_was_measured_and_beside_what_it_would_be() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "1", "--record", "x.mcap",
    ];
    let set = ["--set", "track.min_points=7"];
    world.run(&[&run[..], &set].concat()).done();
    let html = parsed(&page(&world, &[]));
    let titles: Vec<String> = all(&html, "#measured h2, #settings h2")
        .into_iter()
        .map(text)
        .collect();
    assert_eq!(titles, ["What was measured", "What was set"]);
    let rows: Vec<String> = all(&html, "#settings > .wide tbody tr")
        .into_iter()
        .map(|row| row.child_elements().map(text).collect::<Vec<_>>().join("|"))
        .collect();
    let row = rows
        .iter()
        .find(|row| row.starts_with("track.min_points|7|"));
    let default = row.unwrap().split('|').nth(2).unwrap();
    assert!(
        default.parse::<u32>().is_ok_and(|points| points != 7),
        "{rows:?}"
    );
    // Nothing else was set, and all that was not is folded.
    assert!(rows.len() < 4, "{rows:?}");
    assert!(!all(&html, "#settings > details table").is_empty());
    assert!(!text(all(&html, "#measured")[0]).contains("track.min_points"));
}

#[test]
fn of_a_rail_the_map_comes_first_and_says_what_its_colours_are() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..8);
    let source = rail.to_string_lossy();
    let run = [
        "run", "--source", &source, "--layout", "rail", "--record", "x.mcap",
    ];
    world.run(&run).done();
    let html = parsed(&page(&world, &[]));
    assert_eq!(sections(&html)[..3], ["map", "measured", "settings"]);
    assert_eq!(
        all(&html, "#map .ramp").len(),
        all(&html, "#map svg.space").len()
    );
    let scale: String = all(&html, "#map .scale").into_iter().map(text).collect();
    assert!(scale.contains(" px"), "{scale}");
}

#[test]
fn errors_are_shown_in_pixels_where_the_truth_is_known_and_confidence_everywhere() {
    let world = World::new();
    let run = [
        "run",
        "--source",
        "scene:tab",
        "--scans",
        "1",
        "--record",
        "x.mcap",
    ];
    world.run(&run).done();
    let pictures = |page: &str| {
        let html = parsed(page);
        ["Error of each point", "Confidence of each point"].map(|name| {
            let found = all(&html, &format!("img[alt^='{name}']"));
            let figure = found.first().and_then(|image| {
                let mut parents = image.ancestors().filter_map(ElementRef::wrap);
                parents.find(|element| element.value().name() == "figure")
            });
            figure.map(text)
        })
    };
    let [error, confidence] = pictures(&page(&world, &[])).map(Option::unwrap);
    assert!(error.contains("0 px0.5 px1 px1.5 px≥ 2 px"), "{error}");
    assert!(confidence.contains("≥ 10 %"), "{confidence}");
    let without = [
        "filter",
        "x.mcap",
        "--topics",
        "points,statistics",
        "-o",
        "f.mcap",
    ];
    world.run(&without).done();
    world.run(&["report", "f.mcap", "-o", "f.html"]).done();
    let page = std::fs::read_to_string(world.path("f.html")).unwrap();
    let [error, confidence] = pictures(&page);
    assert!(error.is_none() && confidence.is_some());
}

#[test]
fn a_recording_of_nothing_is_a_page_that_says_so() {
    let world = World::recorded("1");
    let bytes = std::fs::read(world.path("x.mcap")).unwrap();
    // A run that died before its first scan.
    std::fs::write(world.path("e.mcap"), &bytes[..20_000]).unwrap();
    let ran = world.run(&["report", "e.mcap", "-o", "e.html"]);
    assert_eq!(ran.code, Some(0), "{ran:?}");
    let page = std::fs::read_to_string(world.path("e.html")).unwrap();
    let html = parsed(&page);
    assert_eq!(sections(&html), ["measured", "settings", "run", "ledger"]);
    assert!(page.contains("none: there is no scan"), "{page}");
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
    assert!(ran.err.contains("r.html exists"), "{}", ran.err);
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
