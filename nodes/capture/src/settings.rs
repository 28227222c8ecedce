//! Settings of the capture node.

use messages::Kind;
use serde::{Deserialize, Serialize};

use crate::layout::Layout;

/// What a scan is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Several views taken at once.
    #[default]
    Rig,
    /// A frame of one camera that moves along a rail: triples are frames that follow each other.
    Rail,
}

/// What a lens does, by the names that ROS has for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LensModel {
    /// Radial and tangential distortion, k1, k2, p1, p2 and k3.
    #[serde(alias = "radtan")]
    PlumbBob,
    /// The same with k4, k5 and k6, and where there are more, thin prism s1 to s4 and tilt τx and τy.
    RationalPolynomial,
    /// A fisheye, k1 to k4.
    #[serde(alias = "fisheye")]
    Equidistant,
    /// Nothing.
    None,
}

const EXPECTED_VIEWS: &str = "all, or numbers counted from 0 with commas between, as in 1,3,5";

/// Which of a scene's views are taken: a list of numbers, which may be empty, or `"all"`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Views {
    /// All there are.
    All,
    /// These, left to right, counted from 0; of none a sensible choice is made.
    #[serde(untagged)]
    These(Vec<u32>),
}

impl std::str::FromStr for Views {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self::All);
        }
        let numbers = text.split(',').map(|number| number.trim().parse());
        let numbers = numbers.collect::<Result<_, _>>();
        numbers
            .map(Self::These)
            .map_err(|_| format!("{text:?} is no list of views, expected {EXPECTED_VIEWS}"))
    }
}

impl<'de> Deserialize<'de> for Views {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Said {
            These(Vec<u32>),
            One(u32),
            Text(String),
            Other(serde::de::IgnoredAny),
        }
        match Said::deserialize(deserializer)? {
            Said::These(views) => Ok(Self::These(views)),
            Said::One(view) => Ok(Self::These(vec![view])),
            Said::Text(text) => text.parse().map_err(serde::de::Error::custom),
            Said::Other(_) => Err(serde::de::Error::custom(format!(
                "this is no list of views, expected {EXPECTED_VIEWS}"
            ))),
        }
    }
}

messages::settings! {
    /// Where scans come from and how many of them there are.
    pub struct Settings {
        /// `scene:tab`, `scene:jack`, `scene:screwdriver`, `scene:fence` (rendered), `scene:all` (the four in turn),
        /// `scene:thesis` (the thesis's photographs: `thesis-tab`, `thesis-jack` and `thesis-screwdriver` in turn, and
        /// `thesis-misaligned` with cameras a row out of line), or the path of a folder: of one scene's images, or of those of
        /// several cameras and times; or `bag:` and the path of a bag (a rosbag2 folder, an `.mcap` or a `.db3` file); or
        /// cameras: `camera:gstreamer`, `camera:v4l`, or `camera:bus`, which other programs publish.
        pub source: String = "scene:all".to_owned();
        /// Which of a scene's views to take, left to right, counted from 0; at least three at equal steps, or all. Empty:
        /// all of exactly three, else the first triple that `scene.json` lists, else the first three.
        pub views: Views = Views::These(Vec::new());
        /// What a scan is: rig (several views taken at once) or rail (a frame of one camera that moves; the views of a
        /// scene, in order, are its frames).
        pub mode: Mode = Mode::Rig;
        /// How the images of a folder lie, where their names leave it open: views (one scene's), times (a folder a time),
        /// cameras (a folder a camera), flat (both in every name), columns:3 or rows:3 (several views in a picture), rail.
        pub layout: Option<Layout> = None;
        /// Rail: frames from one member of a triple to the next; by default as many as keep nearly all disparities below
        /// a thirty-second of the image's width, and at most a quarter of the frames.
        pub stride: Option<u64> = None, in 1..=32;
        /// Rail: path of a file that says where each frame was taken, a line each; its first line names the column:
        /// position_m, position_mm, position_um or position_steps.
        pub positions: Option<String> = None;
        /// Rail: rows by which the picture lies lower a baseline further to the right, which is made good; by default it
        /// is measured.
        pub drift: Option<f64> = None, in -16.0..=16.0;
        /// Rail: whether by how much each frame is off beside an even motion (to the right, down, turned, scaled) is measured
        /// and made good in the places of its curves' points, images stay as they are; by default in files, of as many
        /// frames as places are estimated of. true: of any number; of a rig and of live cameras it cannot be.
        pub sway: Option<bool> = None;
        /// Rail: how fast a camera moves along it, in metres a second, to the right, where frames come with a time and not
        /// with a position.
        pub speed: Option<f64> = None, in -1000.0..=1000.0;
        /// What each view is seen by, left to right, where the source is cameras: for `camera:gstreamer` a pipeline
        /// each, for `camera:v4l` a device each; for `camera:bus` any text, and without it there are three views. Along a
        /// rail there is one.
        pub cameras: Vec<String> = Vec::new();
        /// Of a bag: the topic of each view, left to right, as in left=/left/image_rect,centre=/centre/image_rect; without
        /// sides or numbers in this order. By default they are found by their names.
        pub topics: Vec<String> = Vec::new();
        /// Of a bag along a rail: the topic that says where the camera was (Odometry, poses, transforms, JointState,
        /// Float64), in metres; of one that tells of several things which, as in /tf:camera, /tf:world>camera or
        /// /joint_states:slide.
        pub position_topic: Option<String> = None;
        /// How far in time, in milliseconds, a camera's frame, or a topic's image, may be from the reference camera's to be
        /// of its scan. Half the interval of 30 Hz: cameras that run freely at this rate always have a frame so near.
        pub tolerance: f64 = 17.0, in 0.0..=60000.0;
        /// Columns of the frames of `camera:bus`, which must be known before they come; `camera:v4l` is set to them.
        pub width: Option<u32> = None, in 32..=65535;
        /// Rows of them.
        pub height: Option<u32> = None, in 32..=65535;
        /// How many scans; a source with fewer begins again. By default a folder is read once and a rendered scene
        /// gives 30 scans: one or two seconds of work, enough for steady figures.
        pub scans: Option<u64> = None, in 1..=1e15;
        /// How many scans may be under way at once. By itself eight, which keep every stage of the chain busy with one scan
        /// waiting before each, or as many as shared memory has room for.
        pub in_flight: Option<usize> = None, in 1..=30;
        /// Scans a second, in Hz, by which a source without times of its own is dated: scan n is taken n / rate after
        /// the start. It does not slow the source down.
        pub rate: f64 = 10.0, in 0.001..=1000000.0;
        /// When the first scan was taken, in nanoseconds since 1970; by default now. The results of two runs with the same
        /// start are equal to the byte; their health, ledger and measured times are their own.
        pub start: Option<u64> = None;
        /// Distance from each chosen view to the next, not from the first to the last, in metres; on a rail between positions
        /// a step apart. Overrides what the source knows.
        pub baseline: Option<f64> = None, in 0.000001..=10000.0;
        /// Focal length, in pixels; overrides what the source knows.
        pub focal: Option<f64> = None, in 1.0..=1000000.0;
        /// Column of the principal point, in pixels; overrides what the source knows. The middle of the picture, where
        /// nobody says it.
        pub cx: Option<f64> = None, in -100000.0..=100000.0;
        /// Row of the principal point, in pixels; overrides what the source knows. The middle of the picture, where nobody
        /// says it.
        pub cy: Option<f64> = None, in -100000.0..=100000.0;
        /// Path of a ROS `camera_info` of the rectified images, as `camera_calibration` writes it or as it is echoed; that of
        /// the camera next to the first, the central one, also holds the baseline. The right one's would be of two steps.
        /// Or those of all views, left to right, separated by commas.
        pub camera_info: Option<String> = None;
        /// Path of the calibration of the cameras that took the images: a Kalibr camchain, an OpenCV FileStorage (YAML, XML,
        /// JSON), a file with a map a camera, or ROS `camera_info`, one a chosen view from left to right, separated by
        /// commas. Views are then rectified.
        pub calibration: Option<String> = None;
        /// The model that the lenses' coefficients in `calibration` are of: plumb_bob, rational_polynomial, equidistant (or
        /// fisheye) or none; where the file does not say it and their number leaves it open, it must be said. Counts before
        /// what the file says.
        pub lens: Option<LensModel> = None;
        /// Bits in use of images that are filed in 16 and hold what a camera of 10, 12 or 14 bit gives, by which they are
        /// scaled to 8; by default found out once, from the first scan's images and some of the others.
        pub bits: Option<u32> = None, in 8..=16;
        /// Whether views are rectified where `calibration` is set; false shows them as they were taken.
        pub rectify: bool = true;
        /// Whether images are published as they were taken too, beside the rectified ones, as `camera/…/image_raw`.
        pub raw: bool = false;
        /// The chosen view whose true disparities are published, counted from 0, where the source knows them; set to the
        /// reference view where results are evaluated.
        pub truth: Option<usize> = None, in 0..=1000000;
        /// Standard deviation of the sensor noise of rendered scenes, in gray levels. One level is what a machine
        /// vision camera shows at moderate gain.
        pub noise: f32 = 1.0, in 0.0..=32.0;
        /// Seed of that noise.
        pub seed: u64 = 1;
    }
}

impl Settings {
    /// The thesis's triples: left, central and right view, 512x480, 8 bit.
    pub fn thesis() -> Self {
        Self {
            views: Views::These(vec![0, 1, 2]),
            ..Self::default()
        }
    }

    /// The kinds of message that are published.
    pub fn makes(&self) -> Vec<Kind> {
        let raw = self.raw.then_some(Kind::Raw);
        let truth = self.truth.map(|_| Kind::Truth);
        [Kind::Image].into_iter().chain(raw).chain(truth).collect()
    }

    /// When a scan is taken, in nanoseconds since 1970, in a run that starts at `start`.
    pub fn nanos(&self, start: u64, scan: u64) -> u64 {
        // Whole seconds are counted apart, so that late scans are dated as exactly as early ones.
        let seconds = scan as f64 / self.rate;
        let whole = seconds.floor();
        let rest = (seconds - whole) * 1e9;
        start
            .saturating_add((whole as u64).saturating_mul(1_000_000_000))
            .saturating_add(rest.round() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::settings::Settings as _;

    #[test]
    fn defaults_and_the_thesis_are_in_range() {
        assert_eq!(Settings::default().check(), Ok(()));
        assert_eq!(Settings::thesis().check(), Ok(()));
    }

    #[test]
    fn scans_are_dated_by_the_rate_without_drift() {
        let settings = Settings {
            rate: 30.0,
            ..Settings::default()
        };
        assert_eq!(settings.nanos(1_000, 0), 1_000);
        assert_eq!(settings.nanos(1_000, 1), 33_333_333 + 1_000);
        // After a year at 30 Hz it is still a year.
        assert_eq!(
            settings.nanos(7, 365 * 86_400 * 30),
            365 * 86_400 * 1_000_000_000 + 7
        );
        let slow = Settings {
            rate: 0.5,
            ..Settings::default()
        };
        assert_eq!(slow.nanos(0, 3), 6_000_000_000);
    }
}
