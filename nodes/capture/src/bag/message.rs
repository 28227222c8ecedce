//! The messages that matter: images, what cameras are like, and where something was.

use std::borrow::Cow;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use glam::{DQuat, DVec3};
use messages::Size;
use serde_json::Value;

use super::storage::{Coding, Topic};
use super::wire::{Field, Why, Wire, fields, nanos_of};
use crate::calibration::ros::CameraInfo;

/// The types of messages that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Image,
    CompressedImage,
    /// The same of Foxglove, with its own order of fields.
    FoxgloveImage,
    FoxgloveCompressed,
    CameraInfo,
    FoxgloveCalibration,
    Odometry,
    Pose,
    Point,
    Transform,
    Transforms,
    Joints,
    Double,
    Float,
    FoxglovePose,
    FoxgloveTransform,
    FoxgloveTransforms,
}

use Kind as K;

/// Names of types. `sensor_msgs/msg/Image` is `sensor_msgs/Image` here.
const KINDS: [(&str, Kind); 23] = [
    ("sensor_msgs/Image", K::Image),
    ("sensor_msgs/CompressedImage", K::CompressedImage),
    ("foxglove.RawImage", K::FoxgloveImage),
    ("foxglove_msgs/RawImage", K::FoxgloveImage),
    ("foxglove.CompressedImage", K::FoxgloveCompressed),
    ("foxglove_msgs/CompressedImage", K::FoxgloveCompressed),
    ("sensor_msgs/CameraInfo", K::CameraInfo),
    ("foxglove.CameraCalibration", K::FoxgloveCalibration),
    ("foxglove_msgs/CameraCalibration", K::FoxgloveCalibration),
    ("nav_msgs/Odometry", K::Odometry),
    ("geometry_msgs/PoseStamped", K::Pose),
    ("geometry_msgs/PoseWithCovarianceStamped", K::Pose),
    ("geometry_msgs/PointStamped", K::Point),
    ("geometry_msgs/Vector3Stamped", K::Point),
    ("geometry_msgs/TransformStamped", K::Transform),
    ("tf2_msgs/TFMessage", K::Transforms),
    ("tf/tfMessage", K::Transforms),
    ("sensor_msgs/JointState", K::Joints),
    ("std_msgs/Float64", K::Double),
    ("std_msgs/Float32", K::Float),
    ("foxglove.PoseInFrame", K::FoxglovePose),
    ("foxglove.FrameTransform", K::FoxgloveTransform),
    ("foxglove.FrameTransforms", K::FoxgloveTransforms),
];

impl Kind {
    /// The kind of a topic's messages, when they are read.
    pub(super) fn of(topic: &Topic) -> Option<Self> {
        let &(_, kind) = KINDS.iter().find(|(name, _)| *name == topic.schema)?;
        let is_ros = !topic.schema.starts_with("foxglove.");
        let is_read = match topic.coding {
            Coding::Cdr => is_ros,
            Coding::Ros1 => is_ros && !topic.schema.starts_with("foxglove_msgs"),
            Coding::Protobuf | Coding::Json => !is_ros,
            Coding::Other => false,
        };
        is_read.then_some(kind)
    }

    pub(super) fn is_image(self) -> bool {
        self.is_compressed() || matches!(self, K::Image | K::FoxgloveImage)
    }

    pub(super) fn is_compressed(self) -> bool {
        matches!(self, K::CompressedImage | K::FoxgloveCompressed)
    }

    pub(super) fn is_info(self) -> bool {
        matches!(self, K::CameraInfo | K::FoxgloveCalibration)
    }

    pub(super) fn is_transforms(self) -> bool {
        matches!(
            self,
            K::Transform | K::Transforms | K::FoxgloveTransform | K::FoxgloveTransforms
        )
    }

    /// Whether it says where something is.
    pub(super) fn is_place(self) -> bool {
        !self.is_image() && !self.is_info()
    }
}

fn wire<'a>(coding: Coding, bytes: &'a [u8]) -> Result<Wire<'a>, Why> {
    match coding {
        Coding::Ros1 => Ok(Wire::ros1(bytes)),
        _ => Wire::cdr(bytes),
    }
}

fn parsed(bytes: &[u8]) -> Result<Value, Why> {
    serde_json::from_slice(bytes).map_err(|error| format!("it is no JSON ({error})"))
}

/// How a picture that is not compressed lies in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Raw {
    pub(super) size: Size,
    pub(super) encoding: String,
    pub(super) is_big: bool,
    /// Bytes from one row to the next.
    pub(super) step: usize,
}

/// A picture, as far as it is here.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Image<'a> {
    /// When it was taken, in nanoseconds.
    pub(super) stamp: u64,
    pub(super) frame: String,
    /// `None` of one that is compressed.
    pub(super) raw: Option<Raw>,
    /// How many bytes the picture has, here or not.
    pub(super) length: usize,
    pub(super) data: Cow<'a, [u8]>,
}

/// Reads an image, of which the picture itself may be cut off.
pub(super) fn image<'a>(kind: Kind, coding: Coding, bytes: &'a [u8]) -> Result<Image<'a>, Why> {
    let is_raw = !kind.is_compressed();
    match coding {
        Coding::Protobuf => protobuf_image(is_raw, bytes),
        Coding::Json => json_image(is_raw, bytes),
        _ => ros_image(kind, wire(coding, bytes)?),
    }
}

fn ros_image(kind: Kind, mut wire: Wire<'_>) -> Result<Image<'_>, Why> {
    let (stamp, frame) = match kind {
        K::FoxgloveImage | K::FoxgloveCompressed => (wire.time()?, wire.string()?),
        _ => wire.header()?,
    };
    let raw = match kind {
        K::Image => {
            let (height, width) = (wire.u32()?, wire.u32()?);
            let encoding = wire.string()?;
            let is_big = wire.u8()? != 0;
            Some((width, height, encoding, is_big, wire.u32()?))
        }
        K::FoxgloveImage => {
            let (width, height) = (wire.u32()?, wire.u32()?);
            Some((width, height, wire.string()?, false, wire.u32()?))
        }
        K::CompressedImage => {
            wire.string()?;
            None
        }
        _ => None,
    };
    let (length, data) = wire.bytes()?;
    Ok(Image {
        stamp,
        frame,
        raw: raw.map(|(width, height, encoding, is_big, step)| Raw {
            size: Size::new(width, height),
            encoding,
            is_big,
            step: step as usize,
        }),
        length,
        data: Cow::Borrowed(data),
    })
}

fn protobuf_image(is_raw: bool, bytes: &[u8]) -> Result<Image<'_>, Why> {
    let (mut image, mut raw) = (Image::default(), Raw::default());
    fields(bytes, |number, field| {
        match (is_raw, number, field) {
            (_, 1, Field::Bytes(_, time)) => image.stamp = protobuf_time(time)?,
            (true, 2, Field::Number(width)) => raw.size.width = width as u32,
            (true, 3, Field::Number(height)) => raw.size.height = height as u32,
            (true, 4, Field::Bytes(_, text)) => raw.encoding = lossy(text),
            (true, 5, Field::Number(step)) => raw.step = step as usize,
            (true, 7, Field::Bytes(_, text)) | (false, 4, Field::Bytes(_, text)) => {
                image.frame = lossy(text);
            }
            (true, 6, Field::Bytes(length, data)) | (false, 2, Field::Bytes(length, data)) => {
                image.length = length;
                image.data = Cow::Borrowed(data);
            }
            _ => {}
        }
        Ok(())
    })?;
    image.raw = is_raw.then_some(raw);
    Ok(image)
}

fn json_image(is_raw: bool, bytes: &[u8]) -> Result<Image<'static>, Why> {
    let value = parsed(bytes)?;
    let text = |key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default();
    let number = |key: &str| value.get(key).and_then(Value::as_u64).unwrap_or_default();
    let data = BASE64_STANDARD
        .decode(text("data"))
        .map_err(|_| "its data is no base64".to_owned())?;
    Ok(Image {
        stamp: value.get("timestamp").map_or(0, json_time),
        frame: text("frame_id").to_owned(),
        raw: is_raw.then(|| Raw {
            size: Size::new(number("width") as u32, number("height") as u32),
            encoding: text("encoding").to_owned(),
            is_big: false,
            step: number("step") as usize,
        }),
        length: data.len(),
        data: Cow::Owned(data),
    })
}

fn lossy(text: &[u8]) -> String {
    String::from_utf8_lossy(text).into_owned()
}

fn protobuf_time(bytes: &[u8]) -> Result<u64, Why> {
    let (mut seconds, mut nanos) = (0, 0);
    fields(bytes, |number, field| {
        match (number, field) {
            (1, Field::Number(value)) => seconds = value as i64,
            (2, Field::Number(value)) => nanos = value,
            _ => {}
        }
        Ok(())
    })?;
    Ok(nanos_of(seconds, nanos))
}

fn json_time(value: &Value) -> u64 {
    let of = |names: [&str; 2]| names.iter().find_map(|name| value.get(name)?.as_i64());
    let (seconds, nanos) = (of(["sec", "seconds"]), of(["nsec", "nanos"]));
    nanos_of(
        seconds.unwrap_or_default(),
        nanos.unwrap_or_default().max(0) as u64,
    )
}

/// What a camera is like.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Info {
    pub(super) frame: String,
    /// The size of its images, as they are sent.
    pub(super) size: Size,
    pub(super) model: String,
    pub(super) d: Vec<f64>,
    pub(super) k: [f64; 9],
    pub(super) r: [f64; 9],
    pub(super) p: [f64; 12],
}

impl Info {
    pub(super) fn of(kind: Kind, coding: Coding, bytes: &[u8]) -> Result<Self, Why> {
        match coding {
            Coding::Protobuf => Self::of_protobuf(bytes),
            Coding::Json => Self::of_json(&parsed(bytes)?),
            _ => Self::of_ros(kind, wire(coding, bytes)?),
        }
    }

    fn of_ros(kind: Kind, mut wire: Wire<'_>) -> Result<Self, Why> {
        let is_foxglove = kind == K::FoxgloveCalibration;
        let frame = match is_foxglove {
            true => {
                wire.time()?;
                wire.string()?
            }
            false => wire.header()?.1,
        };
        let (a, b) = (wire.u32()?, wire.u32()?);
        let (width, height) = if is_foxglove { (a, b) } else { (b, a) };
        let model = wire.string()?;
        let d = wire.list(Wire::f64)?;
        let info = Self {
            frame,
            size: Size::new(width, height),
            model,
            d,
            k: wire.f64s()?,
            r: wire.f64s()?,
            p: wire.f64s()?,
        };
        if is_foxglove {
            return Ok(info);
        }
        let [binning_x, binning_y] = [wire.u32()?, wire.u32()?];
        let [x, y, height, width] = [wire.u32()?, wire.u32()?, wire.u32()?, wire.u32()?];
        Ok(info.cut([x, y], [width, height], [binning_x, binning_y]))
    }

    /// For images of which only a part of the sensor is sent, or pixels put together: K and P are of all of it.
    fn cut(mut self, corner: [u32; 2], part: [u32; 2], binning: [u32; 2]) -> Self {
        let is_part = part.iter().all(|&side| side > 0);
        let mut size = [self.size.width, self.size.height];
        for axis in 0..2 {
            let (row, shift) = (axis * 3, axis * 4);
            if is_part {
                size[axis] = part[axis];
                self.k[row + 2] -= f64::from(corner[axis]);
                self.p[shift + 2] -= f64::from(corner[axis]);
            }
            let binned = binning[axis].max(1);
            if binned > 1 {
                size[axis] /= binned;
                let by = 1.0 / f64::from(binned);
                self.k[row..row + 3]
                    .iter_mut()
                    .for_each(|value| *value *= by);
                self.p[shift..shift + 4]
                    .iter_mut()
                    .for_each(|value| *value *= by);
            }
        }
        self.size = Size::new(size[0], size[1]);
        self
    }

    fn of_protobuf(bytes: &[u8]) -> Result<Self, Why> {
        let mut info = Self::default();
        let (mut k, mut r, mut p) = (Vec::new(), Vec::new(), Vec::new());
        fields(bytes, |number, field| {
            let list = match (number, field) {
                (2, Field::Number(width)) => {
                    info.size.width = width as u32;
                    return Ok(());
                }
                (3, Field::Number(height)) => {
                    info.size.height = height as u32;
                    return Ok(());
                }
                (4, Field::Bytes(_, text)) => {
                    info.model = lossy(text);
                    return Ok(());
                }
                (9, Field::Bytes(_, text)) => {
                    info.frame = lossy(text);
                    return Ok(());
                }
                (5, _) => &mut info.d,
                (6, _) => &mut k,
                (7, _) => &mut r,
                (8, _) => &mut p,
                _ => return Ok(()),
            };
            match field {
                Field::Double(value) => list.push(value),
                Field::Bytes(_, packed) => {
                    let (doubles, _) = packed.as_chunks();
                    list.extend(doubles.iter().map(|&bytes| f64::from_le_bytes(bytes)));
                }
                Field::Number(_) => {}
            }
            Ok(())
        })?;
        info.with([("K", &k), ("R", &r), ("P", &p)])
    }

    fn of_json(value: &Value) -> Result<Self, Why> {
        let numbers = |key: &str| -> Vec<f64> {
            let list = value.get(key).and_then(Value::as_array);
            list.into_iter()
                .flatten()
                .filter_map(Value::as_f64)
                .collect()
        };
        let side = |key: &str| value.get(key).and_then(Value::as_u64).unwrap_or_default() as u32;
        let text = |key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default();
        let info = Self {
            frame: text("frame_id").to_owned(),
            size: Size::new(side("width"), side("height")),
            model: text("distortion_model").to_owned(),
            d: numbers("D"),
            ..Self::default()
        };
        info.with([
            ("K", &numbers("K")),
            ("R", &numbers("R")),
            ("P", &numbers("P")),
        ])
    }

    fn with(mut self, matrices: [(&str, &[f64]); 3]) -> Result<Self, Why> {
        let rooms: [&mut [f64]; 3] = [&mut self.k, &mut self.r, &mut self.p];
        for ((name, given), room) in matrices.into_iter().zip(rooms) {
            if given.len() == room.len() {
                room.copy_from_slice(given);
            } else if !given.is_empty() {
                return Err(format!(
                    "its {name} holds {} numbers, and {} are expected",
                    given.len(),
                    room.len()
                ));
            }
        }
        Ok(self)
    }

    /// Whether anybody calibrated the camera: drivers send zeros otherwise.
    pub(super) fn is_known(&self) -> bool {
        self.k[0] > 0.0 || self.p[0] > 0.0
    }

    /// Whether it is of images that nothing is left to be done to.
    pub(super) fn is_straight(&self) -> bool {
        const IDENTITY: [f64; 9] = [1., 0., 0., 0., 1., 0., 0., 0., 1.];
        let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs().max(1.0);
        let is_turned =
            self.r != [0.0; 9] && self.r.iter().zip(&IDENTITY).any(|(&a, &b)| !is_near(a, b));
        let places = [(0, 0), (2, 2), (4, 5), (5, 6)];
        // Some drivers tell P alone.
        let is_moved =
            self.k[0] > 0.0 && places.iter().any(|&(k, p)| !is_near(self.k[k], self.p[p]));
        self.d.iter().all(|&value| value == 0.0) && !is_turned && !is_moved
    }

    /// As calibrations are read.
    pub(super) fn as_message(&self, name: &str) -> CameraInfo {
        // A camera that nobody turned is not turned.
        let r = match self.r == [0.0; 9] {
            true => [1., 0., 0., 0., 1., 0., 0., 0., 1.],
            false => self.r,
        };
        CameraInfo {
            name: Some(name.to_owned()),
            size: Some(self.size),
            distortion_model: Some(self.model.clone()).filter(|model| !model.is_empty()),
            d: self.d.clone(),
            k: self.k,
            r,
            p: self.p,
        }
    }
}

/// What a message says of where something is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Placed {
    /// When, in nanoseconds; `None` where the message has no time of its own.
    pub(super) stamp: Option<u64>,
    /// What is there: a frame or a joint.
    pub(super) what: String,
    /// In which frame.
    pub(super) within: String,
    pub(super) place: DVec3,
    pub(super) turn: DQuat,
    /// Whether only the first coordinate is said.
    pub(super) is_scalar: bool,
}

impl Placed {
    /// Reads all places that a message tells.
    pub(super) fn of(kind: Kind, coding: Coding, bytes: &[u8]) -> Result<Vec<Self>, Why> {
        match coding {
            Coding::Json => json_places(kind, &parsed(bytes)?),
            Coding::Protobuf => protobuf_places(kind, bytes),
            _ => ros_places(kind, wire(coding, bytes)?),
        }
    }

    fn at(stamp: u64, what: String, within: String, place: DVec3, turn: DQuat) -> Self {
        // A rotation of zeros is one that nobody set.
        let turn = match turn.length_squared() > 0.0 {
            true => turn.normalize(),
            false => DQuat::IDENTITY,
        };
        Self {
            stamp: Some(stamp),
            what,
            within,
            place,
            turn,
            is_scalar: false,
        }
    }

    fn number(stamp: Option<u64>, what: String, value: f64) -> Self {
        Self {
            stamp,
            what,
            within: String::new(),
            place: DVec3::new(value, 0.0, 0.0),
            turn: DQuat::IDENTITY,
            is_scalar: true,
        }
    }
}

fn ros_places(kind: Kind, mut wire: Wire<'_>) -> Result<Vec<Placed>, Why> {
    fn vector(wire: &mut Wire<'_>) -> Result<DVec3, Why> {
        wire.f64s().map(DVec3::from_array)
    }
    fn pose(wire: &mut Wire<'_>) -> Result<(DVec3, DQuat), Why> {
        Ok((vector(wire)?, DQuat::from_array(wire.f64s()?)))
    }
    fn transform(wire: &mut Wire<'_>) -> Result<Placed, Why> {
        let (stamp, within) = wire.header()?;
        let what = wire.string()?;
        let (place, turn) = pose(wire)?;
        Ok(Placed::at(stamp, what, within, place, turn))
    }
    Ok(match kind {
        K::Odometry => {
            let (stamp, within) = wire.header()?;
            let what = wire.string()?;
            let (place, turn) = pose(&mut wire)?;
            vec![Placed::at(stamp, what, within, place, turn)]
        }
        K::Pose => {
            let (stamp, within) = wire.header()?;
            let (place, turn) = pose(&mut wire)?;
            vec![Placed::at(stamp, String::new(), within, place, turn)]
        }
        K::Point => {
            let (stamp, within) = wire.header()?;
            let place = vector(&mut wire)?;
            vec![Placed::at(
                stamp,
                String::new(),
                within,
                place,
                DQuat::IDENTITY,
            )]
        }
        K::Transform => vec![transform(&mut wire)?],
        K::Transforms => wire.list(transform)?,
        K::Joints => {
            let (stamp, _) = wire.header()?;
            let names = wire.list(Wire::string)?;
            let values = wire.list(Wire::f64)?;
            let joints = names.into_iter().zip(values);
            joints
                .map(|(name, value)| Placed::number(Some(stamp), name, value))
                .collect()
        }
        K::Double => vec![Placed::number(None, String::new(), wire.f64()?)],
        K::Float => vec![Placed::number(None, String::new(), wire.f32()?.into())],
        _ => Vec::new(),
    })
}

fn protobuf_places(kind: Kind, bytes: &[u8]) -> Result<Vec<Placed>, Why> {
    fn numbers<const N: usize>(bytes: &[u8]) -> Result<[f64; N], Why> {
        let mut numbers = [0.0; N];
        fields(bytes, |number, field| {
            let room = (number as usize).checked_sub(1);
            let room = room.and_then(|place| numbers.get_mut(place));
            if let (Field::Double(value), Some(room)) = (field, room) {
                *room = value;
            }
            Ok(())
        })?;
        Ok(numbers)
    }
    /// The numbers of stamp, frames, place and turn in a message, and whether place and turn lie in one of their own.
    fn one(bytes: &[u8], is_pose: bool) -> Result<Placed, Why> {
        let (mut stamp, mut within, mut what) = (0, String::new(), String::new());
        let (mut place, mut turn) = ([0.0; 3], [0.0; 4]);
        fields(bytes, |number, field| {
            let Field::Bytes(_, bytes) = field else {
                return Ok(());
            };
            match (is_pose, number) {
                (_, 1) => stamp = protobuf_time(bytes)?,
                (_, 2) => within = lossy(bytes),
                (true, 3) => fields(bytes, |number, field| {
                    match (number, field) {
                        (1, Field::Bytes(_, bytes)) => place = numbers(bytes)?,
                        (2, Field::Bytes(_, bytes)) => turn = numbers(bytes)?,
                        _ => {}
                    }
                    Ok(())
                })?,
                (false, 3) => what = lossy(bytes),
                (false, 4) => place = numbers(bytes)?,
                (false, 5) => turn = numbers(bytes)?,
                _ => {}
            }
            Ok(())
        })?;
        let (place, turn) = (DVec3::from_array(place), DQuat::from_array(turn));
        Ok(Placed::at(stamp, what, within, place, turn))
    }
    if kind != K::FoxgloveTransforms {
        return Ok(vec![one(bytes, kind == K::FoxglovePose)?]);
    }
    let mut places = Vec::new();
    fields(bytes, |number, field| {
        if let (1, Field::Bytes(_, bytes)) = (number, field) {
            places.push(one(bytes, false)?);
        }
        Ok(())
    })?;
    Ok(places)
}

fn json_places(kind: Kind, value: &Value) -> Result<Vec<Placed>, Why> {
    let one = |value: &Value| {
        let text = |key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default();
        let number = |of: Option<&Value>, key: &str| of.and_then(|of| of.get(key)?.as_f64());
        let pose = value.get("pose").unwrap_or(value);
        let place = pose.get("position").or(pose.get("translation"));
        let turn = pose.get("orientation").or(pose.get("rotation"));
        let at = |key: &str| number(place, key).unwrap_or_default();
        let turned = |key: &str| number(turn, key).unwrap_or_default();
        let within = match text("frame_id") {
            "" => text("parent_frame_id"),
            frame => frame,
        };
        Placed::at(
            value.get("timestamp").map_or(0, json_time),
            text("child_frame_id").to_owned(),
            within.to_owned(),
            DVec3::new(at("x"), at("y"), at("z")),
            DQuat::from_xyzw(turned("x"), turned("y"), turned("z"), turned("w")),
        )
    };
    Ok(match (kind, value.get("transforms")) {
        (K::FoxgloveTransforms, Some(list)) => {
            list.as_array().into_iter().flatten().map(one).collect()
        }
        _ => vec![one(value)],
    })
}
