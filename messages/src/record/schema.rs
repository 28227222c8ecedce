//! What the recording says about its messages: protobuf descriptors and JSON schemas, embedded in every file.

use foxglove::Encode;
use foxglove::messages::{
    CameraCalibration, FrameTransforms, ImageAnnotations, Log, PointCloud, RawImage,
};
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use serde_json::json;

use super::{comments, plain};
use crate::elements::{Curve, Match, Rejected, Table};
use crate::message::{Definition, Message as _};
use crate::payload::{Evaluation, Kind};
use crate::row::{Row as _, RowType};
use crate::topic::Stage;

/// What a file says about a kind of message.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Schema {
    /// Its name, as `foxglove.RawImage`.
    pub name: String,
    /// `protobuf` or `jsonschema`.
    pub encoding: &'static str,
    /// A serialized `FileDescriptorSet`, or a JSON schema.
    pub data: Vec<u8>,
}

impl Schema {
    /// How messages of this schema are encoded: `protobuf` or `json`.
    pub fn message_encoding(&self) -> &'static str {
        if self.encoding == "protobuf" {
            "protobuf"
        } else {
            "json"
        }
    }

    /// The schema of a kind of data.
    pub fn of(kind: Kind) -> Self {
        match kind {
            Kind::Image | Kind::Raw | Kind::Truth | Kind::Disparity => Self::image(),
            Kind::Points | Kind::Map | Kind::Growing => Self::cloud(),
            Kind::Edges => Self::own("Edges"),
            Kind::Curves => Self::own("Curves"),
            Kind::Tables => Self::own("Tables"),
            Kind::Matches => Self::own("Matches"),
            Kind::Evaluation => Self::own("Evaluation"),
            Kind::Other(other) => Self::of_others(other.definition()),
        }
    }

    /// `foxglove.RawImage`.
    pub fn image() -> Self {
        Self::foxglove::<RawImage>()
    }

    /// `foxglove.CameraCalibration`.
    pub fn calibration() -> Self {
        Self::foxglove::<CameraCalibration>()
    }

    /// `foxglove.FrameTransforms`.
    pub fn transforms() -> Self {
        Self::foxglove::<FrameTransforms>()
    }

    /// `foxglove.ImageAnnotations`.
    pub fn annotations() -> Self {
        Self::foxglove::<ImageAnnotations>()
    }

    /// `foxglove.Log`.
    pub fn log() -> Self {
        Self::foxglove::<Log>()
    }

    /// Our own `tricurve.Digests`.
    pub fn digests() -> Self {
        Self::own("Digests")
    }

    /// The JSON schema of [`Statistics`](super::Statistics).
    pub fn statistics() -> Self {
        let number = || json!({ "type": "number" });
        let count = || json!({ "type": "integer" });
        let counts = [
            "edges",
            "curves",
            "curve_points",
            "matches",
            "match_points",
            "points",
            "settled",
            "growing",
            "bytes",
        ];
        let mut properties = serde_json::Map::new();
        properties.insert("scan".to_owned(), count());
        properties.extend(counts.map(|name| (name.to_owned(), count())));
        properties.insert("known".to_owned(), number());
        properties.insert("matched".to_owned(), number());
        properties.insert("disparity".to_owned(), number());
        properties.insert("contrast_least".to_owned(), number());
        properties.insert("contrast_most".to_owned(), number());
        let many = |items| json!({ "type": "array", "items": items });
        properties.insert(
            "histogram".to_owned(),
            json!({ "type": "object", "properties": {
                "disparity": many(number()), "points": many(count()),
            } }),
        );
        let stages = Stage::own().into_iter();
        let stages = stages.map(|stage| (stage.name().to_owned(), number()));
        properties.insert(
            "milliseconds".to_owned(),
            json!({ "type": "object", "properties": serde_json::Map::from_iter(stages) }),
        );
        Self::json("tricurve.Statistics", &properties.into())
    }

    /// The JSON schema of [`Health`](crate::health::Health).
    pub fn health() -> Self {
        let (number, count) = (json!({ "type": "number" }), json!({ "type": "integer" }));
        let node = json!({ "type": "object", "properties": {
            "state": { "type": "string" }, "restarts": count, "p50": number, "p99": number,
        } });
        let properties = json!({
            "admitted": count, "done": count, "under_way": count, "dropped": count,
            "triples_per_second": number,
            "nodes": { "type": "object", "additionalProperties": node },
        });
        Self::json("tricurve.Health", &properties)
    }

    /// The JSON schema of [`Synchronisation`](crate::synchronisation::Synchronisation).
    pub fn synchronisation() -> Self {
        let (number, count) = (json!({ "type": "number" }), json!({ "type": "integer" }));
        let text = json!({ "type": "string" });
        let many = |items: &serde_json::Value| json!({ "type": "array", "items": items });
        let camera = json!({ "type": "object", "properties": {
            "name": text, "received": count, "matched": count, "late": count,
            "dropped": { "type": "object", "additionalProperties": count },
            "waiting": count, "lost": count, "returns": count,
            "offsets": many(&count), "median_ms": number,
        } });
        let properties = json!({
            "scans": count, "tolerance_ms": number, "tolerance_for_99_ms": number,
            "bounds_ms": many(&number), "reference": text, "cameras": many(&camera), "why": text,
        });
        Self::json("tricurve.Synchronisation", &properties)
    }

    /// The JSON schema of [`Ledger`](crate::ledger::Ledger).
    pub fn ledger() -> Self {
        let count = json!({ "type": "integer" });
        let by_cause = json!({ "type": "object", "additionalProperties": count });
        let account = json!({ "type": "object", "properties": {
            "received": count,
            "published": count,
            "duplicates": count,
            "dropped": by_cause,
            "missing": { "type": "array", "items": count },
        } });
        let topics = json!({ "type": "object", "additionalProperties": account });
        let properties = json!({
            "admitted": count,
            "done": count,
            "refused": by_cause,
            "nodes": { "type": "object", "additionalProperties": topics },
        });
        Self::json("tricurve.Ledger", &properties)
    }

    fn json(name: &str, properties: &serde_json::Value) -> Self {
        let schema = json!({ "title": name, "type": "object", "properties": properties });
        Self {
            name: name.to_owned(),
            encoding: "jsonschema",
            data: schema.to_string().into_bytes(),
        }
    }

    fn protobuf(name: String, file: Vec<FileDescriptorProto>) -> Self {
        Self {
            name,
            encoding: "protobuf",
            data: FileDescriptorSet { file }.encode_to_vec(),
        }
    }

    #[expect(clippy::expect_used, reason = "compiled in, and tested")]
    fn foxglove<M: Encode>() -> Self {
        let schema = M::get_schema().expect("foxglove's messages have schemas");
        Self {
            name: schema.name,
            encoding: "protobuf",
            data: schema.data.into_owned(),
        }
    }

    #[expect(clippy::expect_used, reason = "compiled in, and tested")]
    fn foxglove_files<M: Encode>() -> Vec<FileDescriptorProto> {
        let data = Self::foxglove::<M>().data;
        FileDescriptorSet::decode(&*data)
            .expect("foxglove's descriptors are protobuf")
            .file
    }

    /// `foxglove.PointCloud`, which knows nothing of the image its points were found in: two more fields, that
    /// viewers pass over, say how large it was.
    fn cloud() -> Self {
        let mut files = Self::foxglove_files::<PointCloud>();
        let messages = files.iter_mut().flat_map(|file| &mut file.message_type);
        for cloud in messages.filter(|message| message.name() == "PointCloud") {
            cloud
                .field
                .push(field("image_width", CLOUD_WIDTH as i32, Type::Fixed32));
            cloud
                .field
                .push(field("image_height", CLOUD_HEIGHT as i32, Type::Fixed32));
        }
        Self::protobuf("foxglove.PointCloud".to_owned(), files)
    }

    /// One of our own messages.
    fn own(name: &str) -> Self {
        const SHARED: [&str; 2] = [
            "google/protobuf/timestamp.proto",
            "foxglove/PackedElementField.proto",
        ];
        let foxglove = Self::foxglove_files::<PointCloud>();
        let shared = |wanted: &&str| foxglove.iter().find(|file| file.name() == *wanted).cloned();
        let mut files: Vec<_> = SHARED.iter().filter_map(shared).collect();

        let packed = |name, number| of_type(field(name, number, Type::Message), ".tricurve.Packed");
        let many = |name, number, of: &str| {
            repeated(of_type(
                field(name, number, Type::Message),
                &format!(".tricurve.{of}"),
            ))
        };
        let with_head = |name, sections: &[FieldDescriptorProto]| {
            message(name, [plain::head(), sections.to_vec()].concat())
        };
        let mut own = FileDescriptorProto {
            name: Some("tricurve.proto".to_owned()),
            package: Some("tricurve".to_owned()),
            dependency: SHARED.map(str::to_owned).to_vec(),
            syntax: Some("proto3".to_owned()),
            message_type: vec![
                message(
                    "Packed",
                    vec![
                        repeated(of_type(
                            field("fields", 1, Type::Message),
                            ".foxglove.PackedElementField",
                        )),
                        field("stride", 2, Type::Fixed32),
                        field("data", 3, Type::Bytes),
                    ],
                ),
                with_head(
                    "Edges",
                    &[
                        repeated(field("counts", 5, Type::Uint32)),
                        repeated(field("gaps", 6, Type::Uint32)),
                        field("parts", 7, Type::Bytes),
                        field("magnitudes", 8, Type::Bytes),
                        field("orientations", 9, Type::Bytes),
                        field("profiles", 10, Type::Bytes),
                        packed("edges", 11),
                    ],
                ),
                plain::row(&RowType::of::<Curve>()),
                with_head(
                    "Curves",
                    &[
                        many("curves", 5, Curve::NAME),
                        packed("points", 6),
                        repeated(field("edges", 7, Type::Fixed32)),
                        repeated(field("counts", 8, Type::Uint32)),
                        repeated(field("parents", 9, Type::Uint32)),
                        repeated(field("x", 10, Type::Float)),
                        repeated(field("y", 11, Type::Float)),
                        repeated(field("magnitude", 12, Type::Float)),
                        repeated(field("length", 13, Type::Float)),
                        repeated(field("starts", 14, Type::Sint32)),
                        field("steps", 15, Type::Bytes),
                    ],
                ),
                plain::row(&RowType::of::<Table>()),
                with_head(
                    "Tables",
                    &[
                        many("tables", 5, Table::NAME),
                        packed("entries", 6),
                        repeated(field("rows", 7, Type::Fixed32)),
                        repeated(field("order", 8, Type::Fixed32)),
                        repeated(field("points", 9, Type::Fixed32)),
                        repeated(field("weights", 10, Type::Float)),
                        field("tables_follow", 11, Type::Bool),
                        field("rows_follow", 12, Type::Bool),
                    ],
                ),
                plain::row(&RowType::of::<Match>()),
                plain::row(&RowType::of::<Rejected>()),
                with_head(
                    "Matches",
                    &[
                        many("matches", 5, Match::NAME),
                        packed("points", 6),
                        many("rejected", 7, Rejected::NAME),
                        repeated(field("gaps", 8, Type::Uint32)),
                        repeated(field("disparities", 9, Type::Float)),
                        repeated(field("scores", 10, Type::Float)),
                    ],
                ),
                // A topic, or a table of settings, and the first 16 bytes of BLAKE3 of what it says.
                message(
                    "Digest",
                    vec![
                        field("name", 1, Type::String),
                        field("digest", 2, Type::Bytes),
                    ],
                ),
                message(
                    "Digests",
                    vec![
                        of_type(
                            field("timestamp", 1, Type::Message),
                            ".google.protobuf.Timestamp",
                        ),
                        field("algorithm", 2, Type::String),
                        many("messages", 3, "Digest"),
                        many("settings", 4, "Digest"),
                    ],
                ),
            ],
            ..FileDescriptorProto::default()
        };
        let evaluation = plain::descriptors(Evaluation::DEFINITION, "tricurve");
        own.message_type.extend(evaluation);
        own.source_code_info = Some(comments::of(&own));
        files.push(own);
        Self::protobuf(format!("tricurve.{name}"), files)
    }

    /// The schema of a message of others, which its definition gives.
    fn of_others(definition: &Definition) -> Self {
        const SHARED: &str = "google/protobuf/timestamp.proto";
        let mut files = Self::foxglove_files::<PointCloud>();
        files.retain(|file| file.name() == SHARED);
        files.push(plain::file(definition, vec![SHARED.to_owned()]));
        let name = format!("{}.{}", plain::package(definition), definition.schema);
        Self::protobuf(name, files)
    }
}

/// Fields of `foxglove.PointCloud` that are ours, far from any that may still come.
pub(super) const CLOUD_WIDTH: u32 = 1000;
pub(super) const CLOUD_HEIGHT: u32 = 1001;

pub(super) fn field(name: &str, number: i32, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        ..FieldDescriptorProto::default()
    }
}

pub(super) fn of_type(field: FieldDescriptorProto, name: &str) -> FieldDescriptorProto {
    FieldDescriptorProto {
        type_name: Some(name.to_owned()),
        ..field
    }
}

pub(super) fn repeated(field: FieldDescriptorProto) -> FieldDescriptorProto {
    FieldDescriptorProto {
        label: Some(Label::Repeated.into()),
        ..field
    }
}

pub(super) fn message(name: &str, field: Vec<FieldDescriptorProto>) -> DescriptorProto {
    DescriptorProto {
        name: Some(name.to_owned()),
        field,
        ..DescriptorProto::default()
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::collections::BTreeSet;

    fn all() -> Vec<Schema> {
        let others = [
            Schema::calibration(),
            Schema::transforms(),
            Schema::annotations(),
            Schema::log(),
            Schema::digests(),
        ];
        Kind::all().map(Schema::of).chain(others).collect()
    }

    #[test]
    fn every_descriptor_holds_its_message_and_all_it_depends_on() {
        for schema in all() {
            let set = FileDescriptorSet::decode(&*schema.data).unwrap();
            let files: BTreeSet<_> = set.file.iter().map(|f| f.name().to_owned()).collect();
            assert_eq!(files.len(), set.file.len(), "{}", schema.name);
            let mut types = BTreeSet::new();
            let mut used = BTreeSet::new();
            for file in &set.file {
                assert!(
                    file.dependency.iter().all(|d| files.contains(d)),
                    "{}",
                    schema.name
                );
                let enums = file.message_type.iter().flat_map(|m| {
                    m.enum_type
                        .iter()
                        .map(move |e| format!("{}.{}", m.name(), e.name()))
                });
                let names = file.message_type.iter().map(|m| m.name().to_owned());
                let outer = file.enum_type.iter().map(|e| e.name().to_owned());
                types.extend(
                    names
                        .chain(enums)
                        .chain(outer)
                        .map(|n| format!(".{}.{n}", file.package())),
                );
                let fields = file.message_type.iter().flat_map(|m| &m.field);
                used.extend(fields.filter_map(|f| f.type_name.clone()));
            }
            assert!(
                types.contains(&format!(".{}", schema.name)),
                "{} in {types:?}",
                schema.name
            );
            assert!(
                used.is_subset(&types),
                "{}: {used:?} in {types:?}",
                schema.name
            );
        }
    }

    #[test]
    fn json_schemas_are_objects_with_properties() {
        for schema in [
            Schema::statistics(),
            Schema::ledger(),
            Schema::synchronisation(),
        ] {
            let value: serde_json::Value = serde_json::from_slice(&schema.data).unwrap();
            assert_eq!(value["type"], "object");
            assert!(value["properties"].is_object());
            assert_eq!(schema.message_encoding(), "json");
        }
    }
}
