//! Bags as other programs write them, made in memory: a writer of CDR of our own, MCAP files and databases.
#![allow(dead_code, reason = "each test uses its part")]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::{Compression, WriteOptions};

/// Writes numbers as CDR does.
pub(crate) struct Cdr {
    bytes: Vec<u8>,
    is_big: bool,
}

impl Cdr {
    pub(crate) fn new(is_big: bool) -> Self {
        Self {
            bytes: vec![0, u8::from(!is_big), 0, 0],
            is_big,
        }
    }

    fn number<const N: usize>(mut self, little: [u8; N]) -> Self {
        while !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        match self.is_big {
            true => self.bytes.extend(little.iter().rev()),
            false => self.bytes.extend(little),
        }
        self
    }

    pub(crate) fn u8(self, value: u8) -> Self {
        self.number([value])
    }

    pub(crate) fn u32(self, value: u32) -> Self {
        self.number(value.to_le_bytes())
    }

    pub(crate) fn f64s(self, values: &[f64]) -> Self {
        let put = |cdr: Self, value: &f64| cdr.number(value.to_le_bytes());
        values.iter().fold(self, put)
    }

    pub(crate) fn text(self, text: &str) -> Self {
        let mut cdr = self.u32(text.len() as u32 + 1);
        cdr.bytes.extend(text.as_bytes());
        cdr.bytes.push(0);
        cdr
    }

    pub(crate) fn data(self, data: &[u8]) -> Self {
        let mut cdr = self.u32(data.len() as u32);
        cdr.bytes.extend(data);
        cdr
    }

    pub(crate) fn header(self, nanos: u64, frame: &str) -> Self {
        let (seconds, rest) = (nanos / 1_000_000_000, nanos % 1_000_000_000);
        self.u32(seconds as u32).u32(rest as u32).text(frame)
    }

    pub(crate) fn done(self) -> Vec<u8> {
        self.bytes
    }
}

/// A message and where and when it was recorded.
#[derive(Clone, Debug)]
pub(crate) struct Written {
    pub(crate) topic: String,
    pub(crate) schema: &'static str,
    pub(crate) coding: &'static str,
    pub(crate) log: u64,
    pub(crate) bytes: Vec<u8>,
}

pub(crate) fn written(topic: &str, schema: &'static str, log: u64, bytes: Vec<u8>) -> Written {
    Written {
        topic: topic.to_owned(),
        schema,
        coding: "cdr",
        log,
        bytes,
    }
}

/// How the pixels of an image lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pixels<'a> {
    pub(crate) encoding: &'a str,
    pub(crate) size: (u32, u32),
    pub(crate) step: u32,
    pub(crate) is_big: bool,
    pub(crate) data: &'a [u8],
}

pub(crate) fn image(topic: &str, nanos: u64, pixels: Pixels<'_>) -> Written {
    let bytes = Cdr::new(false)
        .header(nanos, &format!("{topic}_frame"))
        .u32(pixels.size.1)
        .u32(pixels.size.0)
        .text(pixels.encoding)
        .u8(pixels.is_big.into())
        .u32(pixels.step)
        .data(pixels.data);
    written(
        topic,
        "sensor_msgs/msg/Image",
        nanos + 3_000_000,
        bytes.done(),
    )
}

pub(crate) fn compressed(topic: &str, nanos: u64, data: &[u8]) -> Written {
    let bytes = Cdr::new(true)
        .header(nanos, "camera")
        .text("jpeg")
        .data(data)
        .done();
    written(
        topic,
        "sensor_msgs/msg/CompressedImage",
        nanos + 3_000_000,
        bytes,
    )
}

/// What a camera is like: focal length and centre of K and P, distortion, fourth number of P.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera<'a> {
    pub(crate) size: (u32, u32),
    pub(crate) k: [f64; 3],
    pub(crate) d: &'a [f64],
    pub(crate) p: [f64; 4],
}

pub(crate) fn camera_info(topic: &str, nanos: u64, camera: Camera<'_>) -> Written {
    let [f, cx, cy] = camera.k;
    let [pf, pcx, pcy, shift] = camera.p;
    let bytes = Cdr::new(false)
        .header(nanos, "camera")
        .u32(camera.size.1)
        .u32(camera.size.0)
        .text("plumb_bob")
        .u32(camera.d.len() as u32)
        .f64s(camera.d)
        .f64s(&[f, 0., cx, 0., f, cy, 0., 0., 1.])
        .f64s(&[1., 0., 0., 0., 1., 0., 0., 0., 1.])
        .f64s(&[pf, 0., pcx, shift, 0., pf, pcy, 0., 0., 0., 1., 0.]);
    let bytes = (0..6).fold(bytes, |cdr, _| cdr.u32(0)).u8(0).done();
    written(topic, "sensor_msgs/msg/CameraInfo", nanos, bytes)
}

pub(crate) fn odometry(topic: &str, nanos: u64, place: [f64; 3]) -> Written {
    let bytes = Cdr::new(false)
        .header(nanos, "odom")
        .text("base_link")
        .f64s(&place)
        .f64s(&[0.0, 0.0, 0.0, 1.0])
        .f64s(&[0.0; 36 + 6 + 36])
        .done();
    written(topic, "nav_msgs/msg/Odometry", nanos + 1_000_000, bytes)
}

pub(crate) fn pose(topic: &str, nanos: u64, place: [f64; 3]) -> Written {
    let bytes = Cdr::new(true)
        .header(nanos, "odom")
        .f64s(&place)
        .f64s(&[0.0, 0.0, 0.0, 1.0])
        .done();
    written(topic, "geometry_msgs/msg/PoseStamped", nanos, bytes)
}

/// Transforms: parent, child, place.
pub(crate) fn transforms(topic: &str, nanos: u64, all: &[(&str, &str, [f64; 3])]) -> Written {
    let start = Cdr::new(false).u32(all.len() as u32);
    let put = |cdr: Cdr, (parent, child, place): &(&str, &str, [f64; 3])| {
        cdr.header(nanos, parent)
            .text(child)
            .f64s(place)
            .f64s(&[0.0, 0.0, 0.0, 1.0])
    };
    let bytes = all.iter().fold(start, put).done();
    written(topic, "tf2_msgs/msg/TFMessage", nanos, bytes)
}

pub(crate) fn joints(topic: &str, nanos: u64, all: &[(&str, f64)]) -> Written {
    let cdr = Cdr::new(false).header(nanos, "").u32(all.len() as u32);
    let cdr = all.iter().fold(cdr, |cdr, (name, _)| cdr.text(name));
    let values: Vec<f64> = all.iter().map(|(_, value)| *value).collect();
    let bytes = cdr.u32(all.len() as u32).f64s(&values).u32(0).u32(0).done();
    written(topic, "sensor_msgs/msg/JointState", nanos, bytes)
}

pub(crate) fn number(topic: &str, log: u64, value: f64) -> Written {
    let bytes = Cdr::new(false).f64s(&[value]).done();
    written(topic, "std_msgs/msg/Float64", log, bytes)
}

/// Writes an MCAP file as rosbag2 does.
pub(crate) fn mcap(path: &Path, all: &[Written]) {
    mcap_with(path, all, WriteOptions::new().compression(None));
}

pub(crate) fn packed(compression: Compression) -> WriteOptions {
    WriteOptions::new().compression(Some(compression))
}

/// Writes an MCAP file with these options.
pub(crate) fn mcap_with(path: &Path, all: &[Written], options: WriteOptions) {
    let file = BufWriter::new(File::create(path).unwrap());
    let mut writer = options
        .profile("ros2")
        .library("a test")
        .create(file)
        .unwrap();
    let mut channels = BTreeMap::new();
    for (number, one) in all.iter().enumerate() {
        let key = (one.topic.clone(), one.schema);
        let channel = *channels.entry(key).or_insert_with(|| {
            let schema = writer.add_schema(one.schema, "ros2msg", b"").unwrap();
            let empty = BTreeMap::new();
            writer
                .add_channel(schema, &one.topic, one.coding, &empty)
                .unwrap()
        });
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: number as u32,
            log_time: one.log,
            publish_time: one.log,
        };
        writer.write_to_known_channel(&header, &one.bytes).unwrap();
    }
    writer.finish().unwrap();
}

/// Writes what rosbag2 says of the files.
pub(crate) fn metadata(folder: &Path, files: &[&str], storage: &str, all: &[Written]) {
    let mut counts: BTreeMap<&str, (u64, &str)> = BTreeMap::new();
    for one in all {
        counts.entry(&one.topic).or_insert((0, one.schema)).0 += 1;
    }
    let files: String = files.iter().map(|file| format!("    - {file}\n")).collect();
    let topics: String = counts
        .iter()
        .map(|(name, (count, schema))| {
            format!(
                "    - topic_metadata:\n        name: {name}\n        type: {schema}\n        \
                 serialization_format: cdr\n        offered_qos_profiles: \"\"\n      message_count: {count}\n"
            )
        })
        .collect();
    let text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: {storage}\n  \
         relative_file_paths:\n{files}  duration:\n    nanoseconds: 1\n  starting_time:\n    \
         nanoseconds_since_epoch: 1\n  message_count: {}\n  topics_with_message_count:\n{topics}  \
         compression_format: \"\"\n  compression_mode: \"\"\n",
        all.len()
    );
    std::fs::write(folder.join("metadata.yaml"), text).unwrap();
}
