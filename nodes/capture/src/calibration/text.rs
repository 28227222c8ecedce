//! From the bytes of a calibration file to what it says: YAML of several dialects, JSON, OpenCV's XML, and the plain text
//! that ROS's `camera_calibration` writes beside its YAML.
//!
//! YAML is tidied before it is parsed, since tools and people write what resembles it: OpenCV's directive and tags, lists
//! without commas, keys without a blank after the colon, lines that `ros2 topic echo` puts between messages.

use std::path::Path;

use serde_saphyr::options::NonFiniteFloatPolicy;

use super::node::Node;
use super::{Why, foreign};
use crate::error::SourceError;

/// Reads the text of a file.
///
/// # Errors
/// A file that cannot be read, or that holds no text; what it is then, and what to write instead.
pub(crate) fn read(path: &Path) -> Result<String, SourceError> {
    let bytes = std::fs::read(path).map_err(SourceError::io(path))?;
    decode(&bytes).map_err(|why| SourceError::CameraInfo {
        path: path.to_owned(),
        why,
    })
}

/// How files begin that hold no text, and what they are.
const BINARY: [(&[u8], &str); 7] = [
    (b"PK\x03\x04", "a NumPy archive (npz) or another zip file"),
    (b"\x93NUMPY", "a NumPy array (npy)"),
    (b"\x80\x02", "a Python pickle"),
    (b"\x80\x03", "a Python pickle"),
    (b"\x80\x04", "a Python pickle"),
    (b"\x80\x05", "a Python pickle"),
    (b"MATLAB 5.0", "a MATLAB file"),
];

fn decode(bytes: &[u8]) -> Result<String, Why> {
    let instead = "write its matrices as text, with cv2.FileStorage(\"cameras.yaml\", cv2.FILE_STORAGE_WRITE)";
    if bytes.starts_with(b"\x1f\x8b") {
        return Err("it is compressed (gzip): unpack it, with `gunzip FILE.gz`".to_owned());
    }
    if let Some((_, what)) = BINARY.iter().find(|(begin, _)| bytes.starts_with(begin)) {
        return Err(format!("it is {what}; {instead}"));
    }
    // What a shell on Windows makes of redirected output.
    let wide = |of: fn([u8; 2]) -> u16| {
        let (units, _) = bytes[2..].as_chunks::<2>();
        let units: Vec<u16> = units.iter().map(|unit| of(*unit)).collect();
        String::from_utf16(&units).ok()
    };
    let text = match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => std::str::from_utf8(bytes).ok().map(str::to_owned),
    };
    text.filter(|text| !text.contains('\0'))
        .ok_or_else(|| format!("it is no text file; {instead}"))
}

/// What a file says, document by document; there is at least one.
///
/// # Errors
/// What is no such text, with the line.
pub(crate) fn documents(text: &str) -> Result<Vec<Node>, Why> {
    let text = text.trim_start_matches('\u{feff}');
    let found = match text.trim_start().chars().next() {
        None => return Err("it is empty".to_owned()),
        Some('<') => vec![xml(text)?],
        Some('{') => match serde_json::from_str(text) {
            Ok(node) => vec![node],
            // OpenCV writes numbers like `0.` into its JSON, which YAML knows.
            Err(_) => yaml(text)?,
        },
        Some('%') if text.trim_start().starts_with("%time") => return Err(csv()),
        _ if is_plain(text) => vec![plain(text)],
        _ => yaml(text).map_err(|why| foreign::of_text(text).unwrap_or(why))?,
    };
    let found: Vec<Node> = found
        .into_iter()
        .filter(|node| *node != Node::Nothing)
        .collect();
    match found.iter().find(|node| !matches!(node, Node::Map(_))) {
        _ if found.is_empty() => Err("it says nothing".to_owned()),
        Some(Node::Text(text)) if text.matches(',').count() > 20 => Err(csv()),
        Some(_) => Err(foreign::of_text(text).unwrap_or_else(|| "it has no keys with values, as `camera_matrix: …`; read are YAML, JSON, OpenCV's XML and what ROS's tools print".to_owned())),
        None => Ok(found),
    }
}

fn csv() -> Why {
    "it is a row of comma-separated values, whose names are lost; echo the message without --csv or -p: `ros2 topic echo --once TOPIC > FILE`"
        .to_owned()
}

/// Lines that are no part of a message, where its output was kept.
const BETWEEN: [&str; 6] = [
    "A message was lost",
    "\ttotal count",
    "WARNING: topic",
    "WARNING: no messages",
    "[INFO]",
    "[WARN]",
];

fn yaml(text: &str) -> Result<Vec<Node>, Why> {
    // Each document with the number of lines before it.
    let mut parts = vec![(0, String::new())];
    for (before, line) in text.lines().enumerate() {
        let bare = line.trim_end();
        let is_noise = BETWEEN.iter().any(|begin| bare.starts_with(begin));
        let ends = bare == "---" || bare == "..." || (is_noise && bare.ends_with("---"));
        let begins = line.strip_prefix("--- ");
        if ends || begins.is_some() {
            parts.push((before, String::new()));
        }
        if let Some((_, part)) = parts.last_mut() {
            let kept = match begins {
                Some(rest) => rest,
                None if ends || is_noise || line.starts_with('%') => "",
                None => line,
            };
            part.push_str(kept);
            part.push('\n');
        }
    }
    parts.retain(|(_, part)| !part.trim().is_empty());
    let count = parts.len();
    let mut found = Vec::new();
    for (at, (before, part)) in parts.into_iter().enumerate() {
        match one(&part) {
            Ok(node) => found.push(node),
            // A message may have been under way when the echo was stopped.
            Err(_) if at > 0 && at + 1 == count => {}
            Err(line) => return Err(unreadable(text, before, line)),
        }
    }
    Ok(found)
}

/// The document, or the number of the line at which it cannot be read, where that is known.
fn one(part: &str) -> Result<Node, Option<u64>> {
    let tidy = tidied(part);
    // That a number is none is said where it is looked at, with its key.
    let options = serde_saphyr::options! {
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
    };
    let parsed = serde_saphyr::from_str_with_options(&tidy, options);
    parsed.map_err(|error: serde_saphyr::Error| error.location().map(|at| at.line()))
}

fn unreadable(text: &str, before: usize, line: Option<u64>) -> Why {
    if text.contains("!!python/") {
        return "it holds objects as Python dumps them (!!python/…); write lists: numpy arrays as array.tolist()".to_owned();
    }
    let last = text.lines().count().max(1);
    let number = (before + line.unwrap_or(1) as usize).clamp(1, last);
    let shown: String = text
        .lines()
        .nth(number - 1)
        .unwrap_or_default()
        .trim()
        .into();
    let shown: String = match shown.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &shown[..end]),
        None => shown,
    };
    format!(
        "its line {number} ({shown}) is no YAML: is there a bracket or quote that is not closed, an indent that is off, or a key that stands there twice, in this line or before? Read are YAML, JSON, OpenCV's XML and what ROS's tools print"
    )
}

/// YAML as a parser takes it, line by line as before.
fn tidied(part: &str) -> String {
    let mut tidy = String::with_capacity(part.len() + 64);
    let mut depth = 0_usize;
    let mut quote = None;
    // The end of what came last inside brackets.
    let mut last = ' ';
    for line in part.lines() {
        let line = match depth {
            0 => spaced(line),
            _ => line.to_owned(),
        };
        let mut chars = line.char_indices().peekable();
        while let Some((at, c)) = chars.next() {
            match (quote, c) {
                (Some(open), _) => {
                    if c == open {
                        quote = None;
                    }
                    tidy.push(c);
                    last = c;
                    continue;
                }
                // A comment reaches to the end of the line.
                (None, '#') if at == 0 || line[..at].ends_with([' ', '\t']) => break,
                (None, '"' | '\'') if is_opening(&line[..at]) => quote = Some(c),
                (None, '!') if is_opening(&line[..at]) => {
                    // A tag says of what kind a value is, and its shape says so too.
                    while chars.next_if(|(_, c)| !c.is_whitespace()).is_some() {}
                    continue;
                }
                (None, '[' | '{') => {
                    if depth > 0 && c == '[' && is_value_end(last) {
                        tidy.push(',');
                    }
                    depth += 1;
                }
                (None, ']' | '}') => depth = depth.saturating_sub(1),
                // OpenCV leaves out the blank in its short maps: { x:1, y:2 }.
                (None, ':') if depth > 0 && is_key_end(last) => tidy.push(c),
                (None, ';') if depth > 0 => {
                    tidy.push(',');
                    last = ',';
                    continue;
                }
                (None, _) if depth > 0 && is_number_start(c) && is_value_end(last) => {
                    let is_apart = at == 0 || line[..at].ends_with([' ', '\t']);
                    if is_apart {
                        tidy.push(',');
                    }
                }
                (None, _) => {}
            }
            match (quote, c) {
                (None, ':') if depth > 0 && is_key_end(last) => tidy.push(' '),
                _ => tidy.push(c),
            }
            if !c.is_whitespace() {
                last = c;
            }
        }
        tidy.push('\n');
    }
    tidy
}

/// Whether a value can begin after this part of a line.
fn is_opening(before: &str) -> bool {
    let before = before.trim_end();
    before.is_empty() || before.ends_with([':', '-', '[', '{', ','])
}

fn is_number_start(c: char) -> bool {
    c.is_ascii_digit() || matches!(c, '-' | '+' | '.')
}

/// Whether a number or a list ends with it.
fn is_value_end(c: char) -> bool {
    c.is_ascii_digit() || matches!(c, '.' | ']')
}

/// Whether a key without quotes ends with it.
fn is_key_end(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// A line whose key has a colon and a blank behind it, and no tabs before it.
fn spaced(line: &str) -> String {
    let body = line.trim_start();
    let indent = line[..line.len() - body.len()].replace('\t', "    ");
    let is_key = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '-');
    let end = body.find(|c| !is_key(c)).unwrap_or(body.len());
    let (key, rest) = body.split_at(end);
    let starts_key = key.starts_with(|c: char| c.is_alphabetic() || c == '_');
    let value = |rest: &str| {
        let rest = rest.trim_start();
        rest.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '.' | '[' | '!' | '"'))
    };
    if starts_key && rest.starts_with(':') && value(&rest[1..]) && !rest.starts_with(": ") {
        return format!("{indent}{key}: {}", rest[1..].trim_start());
    }
    // As Python prints it: D = [0.1, …].
    if let Some(list) = rest.trim_start().strip_prefix('=')
        && starts_key
        && value(list)
    {
        return format!("{indent}{key}: {}", list.trim_start());
    }
    format!("{indent}{body}")
}

fn xml(text: &str) -> Result<Node, Why> {
    let options = roxmltree::ParsingOptions {
        allow_dtd: true,
        ..roxmltree::ParsingOptions::default()
    };
    let tree = roxmltree::Document::parse_with_options(text, options).map_err(|error| {
        format!(
            "it is no whole XML file: a tag is not closed at line {} or before",
            error.pos().row
        )
    })?;
    let root = tree.root_element();
    match root.tag_name().name() {
        "opencv_storage" => Ok(element(root)),
        other => Err(format!(
            "it is XML of <{other}>; read is OpenCV's, of <opencv_storage>, as cv2.FileStorage writes it"
        )),
    }
}

/// An element of OpenCV's XML: of elements named `_` it is a list.
fn element(of: roxmltree::Node<'_, '_>) -> Node {
    let children: Vec<_> = of.children().filter(roxmltree::Node::is_element).collect();
    let is_list = |child: &roxmltree::Node<'_, '_>| child.tag_name().name() == "_";
    match children.as_slice() {
        [] => value(of.text().unwrap_or_default()),
        all if all.iter().all(is_list) => Node::List(all.iter().map(|c| element(*c)).collect()),
        all => {
            let entry = |child: &roxmltree::Node<'_, '_>| {
                (child.tag_name().name().to_owned(), element(*child))
            };
            Node::Map(all.iter().map(entry).collect())
        }
    }
}

/// A number, a list of them, or a text.
fn value(text: &str) -> Node {
    let words: Vec<&str> = text.split_whitespace().collect();
    let numbers: Option<Vec<Node>> = words
        .iter()
        .map(|word| word.parse().ok().map(Node::Number))
        .collect();
    match numbers {
        Some(mut numbers) if numbers.len() == 1 => numbers.swap_remove(0),
        Some(numbers) if numbers.len() > 1 => Node::List(numbers),
        _ => Node::Text(text.trim().trim_matches('"').to_owned()),
    }
}

/// Titles of the plain text's parts, and the keys of the YAML beside it.
const PARTS: [(&str, &str); 6] = [
    ("width", "image_width"),
    ("height", "image_height"),
    ("camera matrix", "camera_matrix"),
    ("distortion", "distortion_coefficients"),
    ("rectification", "rectification_matrix"),
    ("projection", "projection_matrix"),
];

fn is_plain(text: &str) -> bool {
    let has = |title: &str| text.lines().any(|line| line.trim() == title);
    has("[image]") && has("camera matrix")
}

/// The plain text of one camera: titles, and numbers below them.
fn plain(text: &str) -> Node {
    let mut entries: Vec<(String, Node)> = Vec::new();
    for line in text.lines().map(str::trim) {
        if let Some((_, key)) = PARTS.iter().find(|(title, _)| *title == line) {
            entries.push(((*key).to_owned(), Node::List(Vec::new())));
        } else if let Some(name) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            if name != "image" {
                entries.push(("camera_name".to_owned(), Node::Text(name.to_owned())));
            }
        } else if let Some((_, Node::List(list))) = entries.last_mut()
            && !line.starts_with('#')
        {
            let words = line.split_whitespace();
            list.extend(words.map(|word| Node::Text(word.to_owned())));
        }
    }
    for (key, node) in &mut entries {
        if let (true, Node::List(list)) = (key.starts_with("image_"), &*node) {
            let only = list.first().cloned();
            *node = only.unwrap_or(Node::Nothing);
        }
    }
    Node::Map(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str, key: &str) -> Vec<f64> {
        let found = documents(text).unwrap_or_default();
        let entry = found.first().and_then(|node| node.get(key));
        entry
            .and_then(|node| node.numbers().ok())
            .unwrap_or_default()
    }

    #[test]
    fn lists_without_commas_are_lists() {
        for text in [
            "K: [1 2 3 4]\n",
            "K: [[1. 2.]\n    [3. 4.]]\n",
            "K: [[1 2][3 4]]\n",
            "K: [1 2; 3 4]\n",
            "K: [1, 2 3,4] # and a comment\n",
            "K:[1,2,3,4]\n",
            "K = [1, 2, 3, 4]\n",
            "K: 1 2 3 4\n",
            "K: !!opencv-matrix\n  rows: 2\n  cols: 2\n  dt: f\n  data: [ 1., 2.,\n     3., 4. ]\n",
            "{\"K\": {\"type_id\": \"opencv-matrix\", \"rows\": 2, \"cols\": 2, \"dt\": \"d\", \"data\": [1., 2., 3., 4.]}}",
            "K:\n- [1, 2]\n- [3, 4.0e0]\n",
        ] {
            assert_eq!(numbers(text, "K"), [1.0, 2.0, 3.0, 4.0], "{text}");
        }
        assert_eq!(
            numbers("K: [-1 -2.5e-3 +3 .5]", "K"),
            [-1.0, -2.5e-3, 3.0, 0.5]
        );
        assert_eq!(numbers("a: \"[1 2\"\nK: [1 2]\n", "K"), [1.0, 2.0]);
        assert_eq!(numbers("K: { x:1., y:-2., z: 3 }\n", "K"), [1.0, -2.0, 3.0]);
        let tag = "K: !<tag:yaml.org,2002:opencv-matrix>\n  rows: 1\n  cols: 2\n  data: [1, 2]\n";
        assert_eq!(numbers(tag, "K"), [1.0, 2.0]);
    }

    #[test]
    fn opencv_xml_is_read_with_its_lists() {
        let text = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<K1 type_id=\"opencv-matrix\">\n  <rows>1</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    7.5e+02 0. 3.</data></K1>\n<image_size>\n  640 480</image_size>\n<model>\"plumb_bob\"</model>\n<cameras><_><f>1.</f></_><_><f>2.</f></_></cameras>\n</opencv_storage>\n";
        assert_eq!(numbers(text, "K1"), [750.0, 0.0, 3.0]);
        assert_eq!(numbers(text, "image_size"), [640.0, 480.0]);
        let found = documents(text).unwrap_or_default();
        assert_eq!(
            found[0].get("model").and_then(Node::text),
            Some("plumb_bob")
        );
        let Some(Node::List(cameras)) = found[0].get("cameras") else {
            panic!("{found:?}");
        };
        assert_eq!(cameras[1].get("f").and_then(Node::number), Some(2.0));
    }

    #[test]
    fn messages_that_were_echoed_are_documents_and_the_last_may_be_cut_off() {
        let message = "header:\n  stamp:\n    sec: 1\n  frame_id: a\nk:\n- 1.0\n- 2.0\n";
        let lost = "A message was lost!!!\n\ttotal count change:1\n\ttotal count: 1---\n";
        let text = format!("{message}---\n{lost}{message}---\n{message}---\nheader:\n  stamp: [\n");
        let found = documents(&text).unwrap_or_default();
        assert_eq!(found.len(), 3);
        assert!(found.iter().all(|node| node == &found[0]));
        assert_eq!(
            documents("# nothing\n---\n"),
            Err("it says nothing".to_owned())
        );
    }

    #[test]
    fn what_is_no_such_text_says_what_it_is() {
        let why = documents("a: 1\nb: [1, 2\nc: 3\n")
            .err()
            .unwrap_or_default();
        assert!(why.contains("is no YAML") && why.contains("line "), "{why}");
        let why = documents("<document><chunk/></document>")
            .err()
            .unwrap_or_default();
        assert!(
            why.contains("<document>") && why.contains("<opencv_storage>"),
            "{why}"
        );
        let why = documents("%time,field.header.seq\n1,2\n")
            .err()
            .unwrap_or_default();
        assert!(why.contains("comma-separated"), "{why}");
        let why = documents("just a sentence\n").err().unwrap_or_default();
        assert!(why.contains("no keys"), "{why}");
        for (bytes, what) in [
            (&b"PK\x03\x04abc"[..], "npz"),
            (b"\x93NUMPY\x01", "npy"),
            (b"\x80\x04\x95", "pickle"),
            (b"MATLAB 5.0 MAT-file", "MATLAB"),
            (b"\xa9\xa8\x00", "no text"),
        ] {
            let why = decode(bytes).err().unwrap_or_default();
            assert!(why.contains(what) && why.contains("FileStorage"), "{why}");
        }
        assert_eq!(decode(b"\xff\xfea\0:\0").as_deref(), Ok("a:"));
    }

    #[test]
    fn the_plain_text_of_camera_calibration_is_read() {
        let text = "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n[narrow_stereo/left]\n\ncamera matrix\n1.000000 0.000000 3.000000\n0.000000 2.000000 4.000000\n0.000000 0.000000 1.000000\n\ndistortion\n0.100000 -0.200000 0.001000 0.000000 0.000000\n\nrectification\n1 0 0\n0 1 0\n0 0 1\n\nprojection\n1 0 3 0\n0 2 4 0\n0 0 1 0\n";
        let found = documents(text).unwrap_or_default();
        assert_eq!(found[0].get("image_width").and_then(Node::count), Some(640));
        assert_eq!(numbers(text, "distortion_coefficients").len(), 5);
        assert_eq!(numbers(text, "projection_matrix").len(), 12);
        let name = found[0].get("camera_name").and_then(Node::text);
        assert_eq!(name, Some("narrow_stereo/left"));
    }
}
