//! The page: its frame, its style, and what every section is made of.

use std::collections::HashMap;
use std::fmt::{self, Display};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, Render, html};
use messages::Size;
use messages::record::Colours;

const STYLE: &str = include_str!("style.css");

/// The page up to its first section. Its policy lets nothing in from outside, should ever something ask for it.
pub(super) fn begin(title: &str) -> Markup {
    html! {
        (DOCTYPE)
        (PreEscaped("\n<html lang=\"en\">\n"))
        head {
            meta charset="utf-8";
            meta http-equiv="Content-Security-Policy"
                content="default-src 'none'; img-src data:; style-src 'unsafe-inline'";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            title { (title) " · tricurve" }
            style { (PreEscaped(STYLE)) (PreEscaped(colours())) }
        }
        (PreEscaped("\n<body>\n<main>\n"))
    }
}

/// The colours of pictures, for their legends.
fn colours() -> String {
    let stops = |colours: &Colours| {
        let stop = |i: u8| {
            let [r, g, b] = colours.of(f32::from(i) / 16.0);
            format!("#{r:02x}{g:02x}{b:02x}")
        };
        (0..=16).map(stop).collect::<Vec<_>>().join(",")
    };
    let (ramp, wheel) = (stops(&Colours::new()), stops(&Colours::circle()));
    // An orientation of 0 points to the right, a quarter turn down: clockwise from three o'clock.
    format!(
        ".ramp{{background:linear-gradient(90deg,{ramp})}}\n.wheel{{background:conic-gradient(from 90deg,{wheel})}}\n"
    )
}

/// The end of the page.
pub(super) fn end() -> Markup {
    html! {
        (PreEscaped("</main>\n"))
        footer {
            "Made by tricurve " (env!("CARGO_PKG_VERSION"))
            " from the recording alone; the same recording gives the same page."
        }
        (PreEscaped("\n</body>\n</html>\n"))
    }
}

/// Links to the sections: each its id and what it is called.
pub(super) fn navigation(sections: &[(String, String)]) -> Markup {
    html! {
        nav aria-label="sections" {
            div { @for (id, name) in sections { a href={ "#" (id) } { (name) } } }
        }
    }
}

/// Replaces what no page may hold, whatever names are made of: control characters.
pub(super) fn printable(html: &mut String) {
    let is_lost = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if html.contains(is_lost) {
        *html = html.replace(is_lost, "\u{fffd}");
    }
}

/// What a picture shows.
pub(super) struct Shown<'a> {
    /// Classes of the picture.
    pub(super) class: &'a str,
    /// What to say to those who cannot see it.
    pub(super) alt: &'a str,
    /// What stands below it.
    pub(super) caption: Markup,
}

/// The pictures of a page: each can be enlarged, and stands in it once.
#[derive(Debug, Default)]
pub(super) struct Album {
    /// The numbers of the pictures by what they hold.
    known: HashMap<blake3::Hash, usize>,
}

impl Album {
    /// A picture with what stands below it; of one that the page has already, a link to that.
    pub(super) fn picture(&mut self, png: &[u8], size: Size, shown: Shown<'_>) -> Markup {
        let Shown {
            class,
            alt,
            caption,
        } = shown;
        let Size { width, height } = size;
        let drawn = || html! { img class=[named(class)] width=(width) height=(height) alt=(alt) src=(Png(png)); };
        self.drawing(png, size, alt, drawn, &caption)
    }

    /// Something drawn round a picture with what stands below it; of a picture that the page has already, a link to that.
    ///
    /// A popover needs no script: its button, a click or the Escape key close it. It is shown where it stands as long as
    /// it is closed, so that the page holds the picture once; the cell keeps its place meanwhile.
    pub(super) fn drawing(
        &mut self,
        png: &[u8],
        size: Size,
        alt: &str,
        drawn: impl FnOnce() -> Markup,
        caption: &Markup,
    ) -> Markup {
        let ratio = format!("aspect-ratio:{}/{}", size.width, size.height);
        let next = self.known.len();
        let hash = blake3::hash(png);
        let number = *self.known.entry(hash).or_insert(next);
        let id = format!("picture-{number}");
        if number < next {
            return html! {
                figure.same {
                    p.missing style=(ratio) { a href={ "#" (id) } { "The same picture as before" } }
                    figcaption { (caption) }
                }
                "\n"
            };
        }
        html! {
            div.cell style=(ratio) {
                figure id=(id) popover {
                    div.pan {
                        button type="button" popovertarget=(id) aria-label={ "enlarge: " (alt) } { (drawn()) }
                    }
                    figcaption { (caption) }
                }
            }
            "\n"
        }
    }
}

/// Class names, when there are any.
fn named(class: &str) -> Option<&str> {
    (!class.is_empty()).then_some(class)
}

/// A PNG as an address that holds it whole.
pub(super) struct Png<'a>(pub(super) &'a [u8]);

impl Render for Png<'_> {
    fn render_to(&self, out: &mut String) {
        out.push_str("data:image/png;base64,");
        STANDARD.encode_string(self.0, out);
    }
}

/// A place in a drawing: a tenth of a pixel is fine enough.
pub(super) struct At(pub(super) f64);

impl Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1}", self.0)
    }
}

/// In place of what cannot be shown: why.
pub(super) fn missing(why: impl Display) -> Markup {
    let why = why.to_string();
    let mut letters = why.chars();
    // Errors begin in lower case, sentences do not.
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    let sentence: String = first.chain(letters).collect();
    html! { p.missing { (sentence) "." } "\n" }
}

/// A table that scrolls sideways in itself: each column its name and whether it holds numbers.
pub(super) fn table(columns: &[(&str, bool)], rows: &Markup) -> Markup {
    html! {
        div.wide tabindex="0" role="group" aria-label="table" {
            table {
                thead { tr { @for (name, is_number) in columns { th.n[*is_number] { (name) } } } }
                tbody { (rows) }
            }
        }
    }
}

/// A number and what it is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Figure {
    /// What it is of.
    pub(super) name: String,
    /// The number.
    pub(super) value: String,
    /// Its unit, or nothing.
    pub(super) unit: String,
}

/// Numbers that are to be seen at once.
pub(super) fn numbers(figures: &[Figure]) -> Markup {
    html! {
        dl.numbers {
            @for Figure { name, value, unit } in figures {
                div { dt { (name) } dd { (value) @if !unit.is_empty() { " " span { (unit) } } } }
            }
        }
    }
}

/// A count with its thousands apart.
pub(super) fn count(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A count and what is counted.
pub(super) fn counted(number: u64, one: &str, many: &str) -> String {
    format!("{} {}", count(number), if number == 1 { one } else { many })
}

/// A share as percent, with two places behind the point.
pub(super) fn percent(share: f32) -> String {
    format!("{:.2}", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_a_name_holds_it_stays_text() {
        let text = |name: &str| {
            let mut html = html! { p title=(name) { (name) } }.into_string();
            printable(&mut html);
            html
        };
        assert_eq!(
            text("<b>x</b> & \"y\""),
            "<p title=\"&lt;b&gt;x&lt;/b&gt; &amp; &quot;y&quot;\">&lt;b&gt;x&lt;/b&gt; &amp; &quot;y&quot;</p>"
        );
        let lost = text("a\u{0}b\u{1b}[c\u{85}\n");
        assert!(
            lost.ends_with(">a\u{fffd}b\u{fffd}[c\u{fffd}\n</p>"),
            "{lost}"
        );
        assert!(text("σ² ∇²G").contains(">σ² ∇²G<"));
    }

    #[test]
    fn a_picture_that_the_page_has_already_is_not_embedded_again() {
        let mut album = Album::default();
        let mut add = |png: &[u8]| {
            let shown = Shown {
                class: "",
                alt: "x",
                caption: html! {},
            };
            album.picture(png, Size::new(4, 3), shown).into_string()
        };
        let (one, other, again) = (add(b"one"), add(b"other"), add(b"one"));
        assert!(one.contains("<img") && other.contains("<img"));
        assert!(!again.contains("<img"), "{again}");
        assert!(one.contains("id=\"picture-0\"") && again.contains("href=\"#picture-0\""));
    }

    #[test]
    fn thousands_stand_apart() {
        let texts = [0, 999, 1000, 1_234_567].map(count);
        assert_eq!(
            texts,
            ["0", "999", "1\u{202f}000", "1\u{202f}234\u{202f}567"]
        );
    }
}
