//! The page: its frame, its style, and what every section is made of.

use std::fmt::{self, Display, Write};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use messages::Size;
use messages::record::Colours;

/// Text of a recording as it stands in a page: whatever it holds, it stays text.
pub(super) struct Escaped<T>(T);

/// Makes text of anything safe, between tags and in quoted attributes.
pub(super) fn escape<T: Display>(text: T) -> Escaped<T> {
    Escaped(text)
}

impl<T: Display> Display for Escaped<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(Escaping(f), "{}", self.0)
    }
}

/// Passes text on with what means something in HTML written out.
struct Escaping<'a, 'b>(&'a mut fmt::Formatter<'b>);

impl Write for Escaping<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|c| match c {
            '&' => self.0.write_str("&amp;"),
            '<' => self.0.write_str("&lt;"),
            '>' => self.0.write_str("&gt;"),
            '"' => self.0.write_str("&quot;"),
            '\'' => self.0.write_str("&#39;"),
            // No page may hold them.
            c if c.is_control() && !matches!(c, '\n' | '\t') => self.0.write_char('\u{fffd}'),
            c => self.0.write_char(c),
        })
    }
}

const STYLE: &str = include_str!("style.css");

/// The page up to its first section. Its policy lets nothing in from outside, should ever something ask for it.
pub(super) fn begin(out: &mut String, title: &str) -> fmt::Result {
    write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" \
         content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{} · tricurve</title>\n<style>\n{STYLE}",
        escape(title)
    )?;
    let (colours, circle) = (Colours::new(), Colours::circle());
    let stops = |colours: &Colours| -> Vec<String> {
        let stop = |i: u8| {
            let [r, g, b] = colours.of(f32::from(i) / 16.0);
            format!("#{r:02x}{g:02x}{b:02x}")
        };
        (0..=16).map(stop).collect()
    };
    writeln!(
        out,
        ".ramp{{background:linear-gradient(90deg,{})}}",
        stops(&colours).join(",")
    )?;
    // An orientation of 0 points to the right, a quarter turn down: clockwise from three o'clock.
    writeln!(
        out,
        ".wheel{{background:conic-gradient(from 90deg,{})}}",
        stops(&circle).join(",")
    )?;
    out.write_str("</style>\n</head>\n<body>\n<main>\n")
}

/// The end of the page.
pub(super) fn end(out: &mut String) -> fmt::Result {
    writeln!(
        out,
        "</main>\n<footer>Made by tricurve {} from the recording alone; the same recording gives the same page.</footer>\n\
         </body>\n</html>",
        env!("CARGO_PKG_VERSION")
    )
}

/// What a picture shows.
pub(super) struct Shown<'a> {
    /// Classes of the picture.
    pub(super) class: &'a str,
    /// What to say to those who cannot see it.
    pub(super) alt: &'a str,
    /// What stands below it, as HTML.
    pub(super) caption: &'a str,
}

/// A picture that a click enlarges.
pub(super) fn picture(out: &mut String, png: &[u8], size: Size, shown: &Shown<'_>) -> fmt::Result {
    let Shown {
        class,
        alt,
        caption,
    } = shown;
    let Size { width, height } = size;
    write!(
        out,
        "<figure><label class=\"zoom\"><input type=\"checkbox\" aria-label=\"enlarge: {0}\">\
         <img class=\"{class}\" width=\"{width}\" height=\"{height}\" alt=\"{0}\" src=\"",
        escape(alt)
    )?;
    data_uri(out, png);
    writeln!(
        out,
        "\"></label><figcaption>{caption}</figcaption></figure>"
    )
}

/// A PNG as an address that holds it whole.
pub(super) fn data_uri(out: &mut String, png: &[u8]) {
    out.push_str("data:image/png;base64,");
    STANDARD.encode_string(png, out);
}

/// In place of what cannot be shown: why.
pub(super) fn missing(out: &mut String, why: impl Display) -> fmt::Result {
    let why = why.to_string();
    let mut letters = why.chars();
    // Errors begin in lower case, sentences do not.
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    let sentence: String = first.chain(letters).collect();
    writeln!(out, "<p class=\"missing\">{}.</p>", escape(sentence))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_a_name_holds_it_stays_text() {
        assert_eq!(
            escape("<b>x</b> & \"y\" 'z'").to_string(),
            "&lt;b&gt;x&lt;/b&gt; &amp; &quot;y&quot; &#39;z&#39;"
        );
        assert_eq!(
            escape("a\u{0}b\u{1b}[c\n").to_string(),
            "a\u{fffd}b\u{fffd}[c\n"
        );
        assert_eq!(escape("σ² ∇²G").to_string(), "σ² ∇²G");
        assert_eq!(escape(format_args!("{}", "<")).to_string(), "&lt;");
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
