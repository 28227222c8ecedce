//! What is swept: `node.key=1,2,3`.

use serde_json::Value;

use crate::Failure;

/// A setting and the values it is tried with.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) node: String,
    pub(super) key: String,
    values: Vec<Value>,
}

/// The nodes whose settings change results of the same images.
const SWEPT: [&str; 4] = ["filter", "track", "hough", "match"];

/// More are hardly meant.
const MOST: usize = 1000;

impl Axis {
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let parts = text
            .split_once('=')
            .and_then(|(place, values)| Some((place.split_once('.')?, values)));
        let Some(((node, key), values)) = parts.filter(|(_, values)| !values.is_empty()) else {
            return Err(format!("--sweep expects node.key=1,2,3, not {text:?}"));
        };
        let (node, key) = (node.trim(), key.trim());
        if !SWEPT.contains(&node) || (node, key) == ("match", "reference") {
            let swept = SWEPT.join(", ");
            return Err(format!(
                "{node}.{key} cannot be swept, only settings of {swept} on the same views: use --set, once for each value"
            ));
        }
        // Lists, as of channels, have commas of their own.
        let parsed = serde_json::from_str(&format!("[{values}]"));
        let plain = || values.split(',').map(|value| Value::from(value.trim()));
        Ok(Self {
            node: node.to_owned(),
            key: key.to_owned(),
            values: parsed.unwrap_or_else(|_| plain().collect()),
        })
    }

    pub(super) fn name(&self) -> String {
        format!("{}.{}", self.node, self.key)
    }

    pub(super) fn values(&self) -> &[Value] {
        &self.values
    }
}

/// Every combination of the axes' values.
pub(super) fn combinations(axes: &[Axis]) -> Result<Vec<Vec<Value>>, Failure> {
    let count = axes
        .iter()
        .try_fold(1usize, |count, axis| count.checked_mul(axis.values.len()));
    if count.is_none_or(|count| count > MOST) {
        return Err(Failure::usage(format!(
            "the sweep has more than {MOST} combinations: sweep fewer values at once"
        )));
    }
    let mut all = vec![Vec::new()];
    for axis in axes {
        let with = |value: &Value| {
            let longer =
                |values: &Vec<Value>| [values.as_slice(), std::slice::from_ref(value)].concat();
            all.iter().map(longer).collect::<Vec<_>>()
        };
        all = axis.values.iter().flat_map(with).collect();
    }
    // What differs in the last stages only stands together, so that the first ones are done once.
    all.sort_by_key(|values| {
        let early = |(axis, value): (&Axis, &Value)| {
            let is_early = axis.node != "match";
            if is_early {
                value.to_string()
            } else {
                String::new()
            }
        };
        axes.iter().zip(values).map(early).collect::<Vec<_>>()
    });
    Ok(all)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn an_axis_is_a_key_and_its_values_lists_among_them() {
        let axis = Axis::parse("match.gap=6,10").unwrap();
        assert_eq!(
            (axis.name(), axis.values.len()),
            ("match.gap".to_owned(), 2)
        );
        let axis = Axis::parse("filter.channels=[4,2],[2]").unwrap();
        assert_eq!(axis.values[0], serde_json::json!([4, 2]));
        let axis = Axis::parse("match.assignment=point,curve").unwrap();
        assert_eq!(axis.values, ["point", "curve"]);
        let elsewhere = ["match.reference=left", "capture.focal=1"];
        for wrong in ["match.gap", "gap=1", "match.gap="]
            .into_iter()
            .chain(elsewhere)
        {
            assert!(Axis::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn all_combinations_come_those_of_the_same_early_stages_together() {
        let axes = ["match.gap=1,2", "track.least=3,4"].map(|text| Axis::parse(text).unwrap());
        let all = combinations(&axes).unwrap();
        let texts: Vec<String> = all.iter().map(|v| format!("{}{}", v[0], v[1])).collect();
        assert_eq!(texts, ["13", "23", "14", "24"]);
        let many = Axis::parse(&format!("match.gap={}1", "1,".repeat(1000))).unwrap();
        assert!(combinations(&[many]).is_err());
    }
}
