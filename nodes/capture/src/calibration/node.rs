//! What a calibration file says, whatever it is written in: a tree of maps, lists, texts and numbers.

use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use super::Why;

/// A value of a file. Maps keep the order of the file: it may be that of the cameras.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Node {
    Nothing,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

impl Node {
    /// The value of a key, of a map.
    pub(crate) fn get(&self, key: &str) -> Option<&Self> {
        let found = self.entries().iter().find(|(name, _)| name == key);
        found.map(|(_, value)| value)
    }

    /// The first of these keys that is there, and its value.
    pub(crate) fn first<'k>(&self, keys: &[&'k str]) -> Option<(&'k str, &Self)> {
        keys.iter().find_map(|key| Some((*key, self.get(key)?)))
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    /// Keys and values, in the order of the file; none unless it is a map.
    pub(crate) fn entries(&self) -> &[(String, Self)] {
        match self {
            Self::Map(entries) => entries,
            _ => &[],
        }
    }

    pub(crate) fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Text(text) => text.trim().parse().ok(),
            _ => None,
        }
    }

    /// A count of pixels.
    pub(crate) fn count(&self) -> Option<u32> {
        let number = self.number()?;
        let is_whole = number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number);
        is_whole.then_some(number as u32)
    }

    /// Whether it says yes or no, in one way or the other.
    pub(crate) fn truth(&self) -> Option<bool> {
        match self {
            Self::Bool(is) => Some(*is),
            Self::Number(number) => Some(*number != 0.0),
            Self::Text(text) => match text.trim().to_ascii_lowercase().as_str() {
                "true" | "yes" | "1" => Some(true),
                "false" | "no" | "0" => Some(false),
                _ => None,
            },
            _ => None,
        }
    }

    /// All numbers of a list, of a matrix with `data`, of a list of rows, or of a text of numbers.
    ///
    /// # Errors
    /// What is there instead of a number, as the second half of a sentence that begins with the key.
    pub(crate) fn numbers(&self) -> Result<Vec<f64>, Why> {
        let mut numbers = Vec::new();
        match self.get("data") {
            Some(data) => data.collect(&mut numbers)?,
            None => self.collect(&mut numbers)?,
        }
        let side = |key| self.get(key).and_then(Self::count);
        if let (Some(rows), Some(columns)) = (side("rows"), side("cols")) {
            let channels = self.get("dt").and_then(Self::text).map_or(1, channels);
            let expected = u64::from(rows) * u64::from(columns) * channels;
            if expected != numbers.len() as u64 {
                return Err(format!(
                    "is of {rows} rows and {columns} columns and holds {} numbers",
                    numbers.len()
                ));
            }
        }
        Ok(numbers)
    }

    fn collect(&self, numbers: &mut Vec<f64>) -> Result<(), Why> {
        match self {
            Self::Number(number) if number.is_finite() => numbers.push(*number),
            Self::Number(number) => return Err(format!("holds {number}, which is no number")),
            Self::List(list) => {
                for element in list {
                    element.collect(numbers)?;
                }
            }
            Self::Text(text) => {
                let is_between = |c: char| c.is_whitespace() || ",;[]()".contains(c);
                for word in text.split(is_between).filter(|word| !word.is_empty()) {
                    match word.parse::<f64>() {
                        Ok(number) if number.is_finite() => numbers.push(number),
                        _ => return Err(not_a_number(text, word)),
                    }
                }
            }
            // A vector whose parts have names.
            Self::Map(_) => {
                let parts = ["x", "y", "z", "w"].map(|key| self.get(key));
                let parts: Vec<f64> = parts.into_iter().map_while(|p| p?.number()).collect();
                if parts.len() < 3 {
                    return Err("is a map, not a list of numbers".to_owned());
                }
                numbers.extend(parts);
            }
            Self::Nothing => return Err("is empty".to_owned()),
            Self::Bool(is) => return Err(format!("holds {is}, which is no number")),
        }
        Ok(())
    }

    /// The numbers of a key, so many of them, where it is there.
    ///
    /// # Errors
    /// Another number of them, or something else.
    pub(crate) fn numbers_of<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, Why> {
        let Some(entry) = self.get(key) else {
            return Ok(None);
        };
        let found = entry.numbers().map_err(|why| format!("{key} {why}"))?;
        let count = found.len();
        match found.try_into() {
            Ok(numbers) => Ok(Some(numbers)),
            Err(_) => Err(format!("{key} must hold {N} numbers, and holds {count}")),
        }
    }
}

/// What tools write where numbers should be, and how to get the numbers.
fn not_a_number(text: &str, word: &str) -> Why {
    if text.trim() == "..." {
        return "is cut short (...); echo it whole, with `ros2 topic echo --once --full-length TOPIC`"
            .to_owned();
    }
    if text.contains("array type:") || text.contains("sequence type:") {
        return "was left out when it was echoed; echo it without --no-arr".to_owned();
    }
    let is_base64 = |c: char| c.is_ascii_alphanumeric() || "+/=".contains(c);
    if text.contains("$base64$") || (word.len() > 32 && word.chars().all(is_base64)) {
        return "is written in base64; write the file without cv::FileStorage::WRITE_BASE64"
            .to_owned();
    }
    format!("holds {word:?}, which is no number")
}

/// How many numbers an element of OpenCV's type has: `2d` has two.
fn channels(dt: &str) -> u64 {
    let digits = dt.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    digits.parse().unwrap_or(1)
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Any;
        impl<'de> Visitor<'de> for Any {
            type Value = Node;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("anything")
            }
            fn visit_bool<E>(self, value: bool) -> Result<Node, E> {
                Ok(Node::Bool(value))
            }
            fn visit_i64<E>(self, value: i64) -> Result<Node, E> {
                Ok(Node::Number(value as f64))
            }
            fn visit_u64<E>(self, value: u64) -> Result<Node, E> {
                Ok(Node::Number(value as f64))
            }
            fn visit_f64<E>(self, value: f64) -> Result<Node, E> {
                Ok(Node::Number(value))
            }
            fn visit_str<E>(self, value: &str) -> Result<Node, E> {
                Ok(Node::Text(value.to_owned()))
            }
            fn visit_unit<E>(self) -> Result<Node, E> {
                Ok(Node::Nothing)
            }
            fn visit_none<E>(self) -> Result<Node, E> {
                Ok(Node::Nothing)
            }
            fn visit_some<D: Deserializer<'de>>(self, inner: D) -> Result<Node, D::Error> {
                Node::deserialize(inner)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Node, A::Error> {
                let mut list = Vec::new();
                while let Some(element) = seq.next_element()? {
                    list.push(element);
                }
                Ok(Node::List(list))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Node, A::Error> {
                let mut entries = Vec::new();
                // As text, for `y` would be a yes.
                while let Some(entry) = map.next_entry::<String, Node>()? {
                    entries.push(entry);
                }
                Ok(Node::Map(entries))
            }
        }
        deserializer.deserialize_any(Any)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_from_lists_rows_texts_and_matrices() {
        let number = |n: f64| Node::Number(n);
        let rows = Node::List(vec![
            Node::List(vec![number(1.0), number(2.0)]),
            Node::Text("3 4.5e0".to_owned()),
        ]);
        assert_eq!(rows.numbers(), Ok(vec![1.0, 2.0, 3.0, 4.5]));
        let matrix = |dt: &str| {
            Node::Map(vec![
                ("rows".to_owned(), number(2.0)),
                ("cols".to_owned(), number(1.0)),
                ("dt".to_owned(), Node::Text(dt.to_owned())),
                ("data".to_owned(), rows.clone()),
            ])
        };
        assert_eq!(matrix("2d").numbers(), Ok(vec![1.0, 2.0, 3.0, 4.5]));
        assert_eq!(
            matrix("d").numbers(),
            Err("is of 2 rows and 1 columns and holds 4 numbers".to_owned())
        );
    }

    #[test]
    fn what_stands_for_numbers_that_were_left_out_says_how_to_get_them() {
        let said = |text: &str| Node::Text(text.to_owned()).numbers().unwrap_or_default();
        assert!(said("1 2").len() == 2);
        for (text, cure) in [
            ("...", "--full-length"),
            ("<array type: double[9]>", "without --no-arr"),
            ("$base64$ZCA=", "WRITE_BASE64"),
            ("[1, two]", "\"two\", which is no number"),
        ] {
            let list = Node::List(vec![Node::Text(text.to_owned())]);
            let why = list.numbers().err().unwrap_or_default();
            assert!(why.contains(cure), "{why}");
        }
        let why = Node::Number(f64::NAN).numbers();
        assert_eq!(why, Err("holds NaN, which is no number".to_owned()));
    }
}
