//! What can be wrong with a source: each error is one sentence that says what was expected, what came, what to do.

use std::io;
use std::path::{Path, PathBuf};

use messages::Size;
use messages::settings::OutOfRange;

use crate::layout::Layout;
use crate::panels::Part;

/// The least width and height of an image: less holds no curve.
pub const LEAST_SIDE: u32 = 32;

/// The most pixels of an image.
pub const MOST_PIXELS: u64 = 64_000_000;

/// Why a source cannot be opened or a scan cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] OutOfRange),

    /// A scene that is not among the rendered ones.
    #[error(
        "there is no rendered scene {name:?}{}; known are all, tab, jack, screwdriver, fence, thesis (thesis-tab, thesis-jack, thesis-screwdriver) and thesis-misaligned",
        nearest.map_or(String::new(), |known| format!(", did you mean scene:{known}?"))
    )]
    UnknownScene {
        /// What was asked for.
        name: String,
        /// The known name nearest to it.
        nearest: Option<&'static str>,
    },

    /// The folder does not exist.
    #[error(
        "there is no folder {}; a source is a folder or one of the rendered scenes, like scene:{}",
        path.display(),
        nearest.unwrap_or("all")
    )]
    NotFound {
        /// What was asked for.
        path: PathBuf,
        /// The rendered scene nearest to it.
        nearest: Option<&'static str>,
    },

    /// A file where a folder was expected.
    #[error("{} is a file; give the folder that holds the images of the scene", path.display())]
    NotAFolder {
        /// The file.
        path: PathBuf,
    },

    /// The system refuses to open or read it.
    #[error("{} cannot be read: {error}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },

    /// Nothing usable in the folder.
    #[error(
        "{} holds no images{}; expected are PNG, JPEG, PGM, PPM, TIFF, BMP or WebP files, or folders of them",
        path.display(),
        match others { 0 => String::new(), 1 => format!(", only one other file{}", of(endings)), n => format!(", only {n} other files{}", of(endings)) }
    )]
    Empty {
        /// The folder.
        path: PathBuf,
        /// How many files of other types there are.
        others: usize,
        /// Their endings.
        endings: Vec<String>,
    },

    /// Images in folders of several folders.
    #[error(
        "{} holds images only in folders of several folders ({}): give the one whose folders or images are those of one recording",
        path.display(), some(folders)
    )]
    Deep {
        /// The folder.
        path: PathBuf,
        /// Of each folder in it that holds images, one that does.
        folders: Vec<String>,
    },

    /// A layout that a folder does not have.
    #[error("{} cannot be read as {} ({layout}): {why}", path.display(), layout.describe())]
    Layout {
        /// The folder.
        path: PathBuf,
        /// The layout.
        layout: Layout,
        /// Why.
        why: String,
    },

    /// A folder whose names do not say what they are.
    #[error("{} can be read as {first}, and as {second}: say which with {say}", path.display())]
    TwoLayouts {
        /// The folder.
        path: PathBuf,
        /// One reading.
        first: String,
        /// The other one.
        second: String,
        /// How to say it.
        say: &'static str,
    },

    /// Images of which some say their side.
    #[error(
        "{} holds images that are called left and right, and {name}, which says no side: name it, move it away, or choose by place among the names in order with --views 0,1,2",
        path.display()
    )]
    Side {
        /// The folder.
        path: PathBuf,
        /// The image.
        name: String,
    },

    /// Two sets of cameras, or two kinds of images of each.
    #[error(
        "{} holds two {what} of one camera, {} and {}: give a folder that holds one set of cameras, move what is there twice away, or choose by place from left to right with --views 0,2,4",
        path.display(), names[0], names[1]
    )]
    Twins {
        /// The folder.
        path: PathBuf,
        /// What these are: folders or images.
        what: &'static str,
        /// Two names of one camera.
        names: [String; 2],
    },

    /// Fewer than three cameras.
    #[error(
        "{} holds {} of the at least three cameras that a scan needs: read as {} ({layout}), {} at {times} times; --layout says another",
        path.display(), cameras.len(), layout.describe(), some(cameras)
    )]
    TooFewCameras {
        /// The folder.
        path: PathBuf,
        /// How it was read.
        layout: Layout,
        /// The cameras.
        cameras: Vec<String>,
        /// How many times there are.
        times: usize,
    },

    /// Cameras that never took an image at one time.
    #[error(
        "{} holds images of {}, but no time at which all of them took one: at {time} {camera} did not; images of one time have a name or number in common",
        path.display(), some(cameras)
    )]
    NeverTogether {
        /// The folder.
        path: PathBuf,
        /// The cameras.
        cameras: Vec<String>,
        /// The first time.
        time: String,
        /// Who took none.
        camera: String,
    },

    /// A rig where a camera passes a scene.
    #[error(
        "a rail passes one scene, and {} is read as {} ({layout}), {} at {times} times: give the folder of one camera, or say --layout rail where all are its frames",
        path.display(), layout.describe(), some(cameras)
    )]
    RailOfRig {
        /// The folder.
        path: PathBuf,
        /// How it was read.
        layout: Layout,
        /// The cameras.
        cameras: Vec<String>,
        /// How many times there are.
        times: usize,
    },

    /// A picture that cannot be cut evenly.
    #[error(
        "{} is {size} pixels, which cannot be cut into {} equal parts: say how many views it shows with --layout columns:N or rows:N",
        path.display(), part.count
    )]
    Parts {
        /// The file.
        path: PathBuf,
        /// Its size.
        size: Size,
        /// One of the parts.
        part: Part,
    },

    /// A layout that says rail where the mode says rig.
    #[error(
        "capture.layout is rail and capture.mode is rig: set capture.mode to rail too, as --layout rail does"
    )]
    RailLayout,

    /// Fewer than three images.
    #[error("{} holds {found} of the at least three views that a scene needs", path.display())]
    TooFewViews {
        /// The folder.
        path: PathBuf,
        /// How many there are.
        found: usize,
    },

    /// Fewer than three views chosen.
    #[error("three views are needed, left to right, and views chooses {}: {}", chosen.len(), list(chosen))]
    TooFewChosen {
        /// The choice.
        chosen: Vec<u32>,
    },

    /// Views not from left to right, or one twice.
    #[error(
        "views must go from left to right, each at most once, not {}",
        list(chosen)
    )]
    ViewOrder {
        /// The choice.
        chosen: Vec<u32>,
    },

    /// A view that does not exist.
    #[error("there is no view {view} in {scene}, whose views are 0 to {}", count - 1)]
    NoSuchView {
        /// The folder or rendered scene.
        scene: String,
        /// The view asked for.
        view: u32,
        /// How many it has.
        count: usize,
    },

    /// Views at unequal distances.
    #[error(
        "views {} of {scene} stand {} steps along the rail, and their distances must be equal; choose others",
        list(chosen),
        list(positions)
    )]
    UnequalSteps {
        /// The folder or rendered scene.
        scene: String,
        /// The choice.
        chosen: Vec<u32>,
        /// Where they stand, in steps.
        positions: Vec<f64>,
    },

    /// Scenes of different numbers of views in one run.
    #[error(
        "{} has {found} views and the scenes before it have {expected}; choose as many of each with views",
        path.display()
    )]
    ViewCount {
        /// The folder.
        path: PathBuf,
        /// How many views it gives.
        found: usize,
        /// How many the scans before it give.
        expected: usize,
    },

    /// No image, a damaged one, or one that ends early.
    #[error("{} cannot be read as an image{}: {why}; replace the file or leave it out", path.display(), in_scan(*scan))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The scan it was read for, after the start.
        scan: Option<u64>,
        /// What is wrong.
        why: String,
    },

    /// Pixels that are numbers of which none can be taken for white.
    #[error(
        "{} has pixels that are {}; expected are numbers from 0 to 1, to 255 or to what 10, 12, 14 or 16 bit hold: convert it to 8 or 16 bit",
        path.display(),
        match range {
            Some([least, most]) => format!("numbers, nearly all from {least} to {most}"),
            None => "no numbers (NaN)".to_owned(),
        }
    )]
    Numbers {
        /// The file.
        path: PathBuf,
        /// The least and nearly the greatest.
        range: Option<[f32; 2]>,
    },

    /// Too small for a curve.
    #[error("{} is {size} pixels; at least {LEAST_SIDE}x{LEAST_SIDE} are needed", path.display())]
    TooSmall {
        /// The file.
        path: PathBuf,
        /// Its size.
        size: Size,
    },

    /// Too large.
    #[error("{} is {size} pixels, more than {} megapixels; scale it down", path.display(), MOST_PIXELS / 1_000_000)]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        size: Size,
    },

    /// Views of one scene that differ in size.
    #[error(
        "{} is {size} pixels and {} is {expected}; the views of one scene must be of one size{}",
        path.display(),
        first.display(),
        match [size.width, size.height] == [expected.height, expected.width] {
            true => " and one way up: is one turned by 90°, or does it say so of itself (EXIF orientation)?",
            false => "",
        }
    )]
    SizeDiffers {
        /// The file.
        path: PathBuf,
        /// Its size.
        size: Size,
        /// The first view's file.
        first: PathBuf,
        /// The first view's size.
        expected: Size,
    },

    /// An image that is no longer what it was at the start.
    #[error(
        "{} was {expected} pixels at the start and is {size} in scan {scan}; leave the files alone during a run",
        path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// The scan.
        scan: u64,
        /// Its size now.
        size: Size,
        /// Its size at the start.
        expected: Size,
    },

    /// A scene.json that makes no sense.
    #[error("{} does not describe a scene: {why}", path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },

    /// A ground truth that cannot be used.
    #[error("{} is no ground truth: {why}", path.display())]
    GroundTruth {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },

    /// A file of positions that cannot be used.
    #[error("{} does not say where the frames were taken: {why}", path.display())]
    Positions {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },

    /// A rail along which nothing moves.
    #[error("the camera does not move in any of {frames} frames: a triple needs three places")]
    NoMotion {
        /// How many frames there are.
        frames: usize,
    },

    /// Frames of a triple further apart than there are frames.
    #[error(
        "a stride of {stride} needs more than the {frames} frames there are; it can be at most {longest}"
    )]
    Stride {
        /// The stride.
        stride: u64,
        /// The longest that there could be.
        longest: u64,
        /// How many frames there are.
        frames: usize,
    },

    /// A live camera along a rail.
    #[error(
        "nobody says where along the rail a live camera takes its frames: set capture.speed, in metres a second, or publish positions with them (camera:bus, FramesOut::send_at)"
    )]
    NoPositions,

    /// A rail with a camera of which nobody says how far it moves.
    #[error(
        "how far a live camera moves from frame to frame must be known beforehand, in metres: set capture.baseline"
    )]
    NoStep,

    /// A speed where frames have no times of their own.
    #[error(
        "capture.speed is of cameras, whose frames come with times; say where files were taken with capture.positions"
    )]
    SpeedOfFiles,

    /// Sway where no frames of a rail can be looked at beforehand.
    #[error(
        "capture.sway is of one camera along a rail whose frames are files, all of which are looked at beforehand; leave it away of {what}"
    )]
    SwayOf {
        /// What has none.
        what: &'static str,
    },

    /// Raw images are asked for where no others are published.
    #[error(
        "capture.raw is set and images are not rectified: they are published as they were taken; set capture.calibration and leave capture.rectify true, or leave capture.raw away"
    )]
    NothingRectified,

    /// A file of positions for a camera.
    #[error(
        "capture.positions is of files; of a camera set capture.speed, or publish positions with its frames (camera:bus, FramesOut::send_at)"
    )]
    PositionsOfCamera,

    /// Several cameras along a rail.
    #[error("along a rail one camera moves, and capture.cameras names {count}")]
    OneCamera {
        /// How many.
        count: usize,
    },

    /// Several scenes where a camera passes one.
    #[error("a rail passes one scene, and {scene} is {count}; choose one of them")]
    OneScene {
        /// The source.
        scene: String,
        /// How many scenes there are.
        count: usize,
    },

    /// A way to cameras that nobody knows.
    #[error("there is no camera:{way}; cameras are camera:gstreamer, camera:v4l or camera:bus")]
    UnknownWay {
        /// What was asked for.
        way: String,
    },

    /// A way to cameras that this build does not have.
    #[error(
        "this build reads no camera:{feature}; build it with `cargo install --path . --features {feature}`{packages}"
    )]
    NeedsFeature {
        /// The feature.
        feature: &'static str,
        /// What else is needed.
        packages: &'static str,
    },

    /// Cameras, but not which.
    #[error(
        "the source {source_name} needs to know its cameras, left to right: set capture.cameras to {each} for each view"
    )]
    NoCameras {
        /// The source.
        source_name: String,
        /// What is expected of each.
        each: &'static str,
    },

    /// Frames of another program, but not their size.
    #[error(
        "the size of frames that another program publishes must be known beforehand: set capture.width and capture.height"
    )]
    NoSize,

    /// A camera that cannot be opened or sends nothing of use.
    #[error("the camera {name} ({camera}): {why}")]
    Camera {
        /// The view.
        name: String,
        /// Its pipeline or device.
        camera: String,
        /// What is wrong, in its own words.
        why: String,
    },

    /// Frames too small or too large.
    #[error(
        "{what} must be of at least {LEAST_SIDE}x{LEAST_SIDE} pixels and at most {} megapixels, not {size}",
        MOST_PIXELS / 1_000_000
    )]
    CameraSize {
        /// What has the size.
        what: String,
        /// The size.
        size: Size,
    },

    /// A truth asked of cameras.
    #[error("cameras know no true disparities: leave capture.truth out")]
    NoTruth,

    /// Cameras where a source is wanted that can be read again.
    #[error(
        "cameras send each frame once: run them with `tricurve run`, and give here a folder or a rendered scene"
    )]
    SentOnce,

    /// The system gives no thread.
    #[error("cannot start a camera's thread: {0}")]
    Thread(io::Error),

    /// A lens model without coefficients.
    #[error(
        "capture.lens says what the coefficients in capture.calibration are, and that is not set: set it, or leave capture.lens out"
    )]
    LensOfNothing,

    /// A setting that no camera has.
    #[error("{0}")]
    Implausible(String),

    /// A bag that cannot be used.
    #[error("the bag {}: {why}", path.display())]
    Bag {
        /// Its file or folder.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },

    /// A bag of which it is unclear what is meant.
    #[error("the bag {}: {why}; {held}", path.display())]
    BagTopics {
        /// Its file or folder.
        path: PathBuf,
        /// What is unclear.
        why: String,
        /// The topics there are, and how to choose among them.
        held: String,
    },

    /// An image of a bag that cannot be read.
    #[error("the image on {topic} at {:.9} s cannot be read: {why}", *nanos as f64 / 1e9)]
    BagImage {
        /// Its topic.
        topic: String,
        /// Its stamp.
        nanos: u64,
        /// What is wrong.
        why: String,
    },

    /// A recording of tricurve where a bag is wanted.
    #[error("{} is a recording of tricurve: `tricurve replay {}` plays it, `tricurve report` shows what is in it", path.display(), path.display())]
    OwnRecording {
        /// The file.
        path: PathBuf,
    },

    /// A setting of bags for something else.
    #[error("capture.{key} is of bags: the source {source_name} has no topics")]
    OfBags {
        /// The setting.
        key: &'static str,
        /// The source.
        source_name: String,
    },

    /// Places of one camera where several stand still.
    #[error(
        "capture.position_topic says where one camera was along a rail: set capture.mode to rail, or leave it away"
    )]
    PositionOfRig,

    /// Places said twice.
    #[error(
        "capture.position_topic, capture.positions and capture.speed all say where frames were taken: set one of them"
    )]
    PositionsTwice,

    /// A camera_info file that cannot be used.
    #[error("{} gives no calibration: {why}", path.display())]
    CameraInfo {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
}

impl SourceError {
    /// Whether what was asked for is wrong, not what is there.
    pub fn is_wrong_use(&self) -> bool {
        matches!(
            self,
            Self::Setting(_)
                | Self::UnknownScene { .. }
                | Self::TooFewChosen { .. }
                | Self::ViewOrder { .. }
                | Self::NoSuchView { .. }
                | Self::UnequalSteps { .. }
                | Self::Stride { .. }
                | Self::OneScene { .. }
                | Self::NoPositions
                | Self::NoStep
                | Self::SpeedOfFiles
                | Self::SwayOf { .. }
                | Self::NothingRectified
                | Self::Layout { .. }
                | Self::TwoLayouts { .. }
                | Self::Deep { .. }
                | Self::Side { .. }
                | Self::Twins { .. }
                | Self::RailOfRig { .. }
                | Self::RailLayout
                | Self::LensOfNothing
                | Self::Implausible(_)
                | Self::PositionsOfCamera
                | Self::OneCamera { .. }
                | Self::UnknownWay { .. }
                | Self::NeedsFeature { .. }
                | Self::NoCameras { .. }
                | Self::NoSize
                | Self::NoTruth
                | Self::SentOnce
                | Self::BagTopics { .. }
                | Self::OwnRecording { .. }
                | Self::OfBags { .. }
                | Self::PositionOfRig
                | Self::PositionsTwice
        )
    }

    /// Whether it is how images lie in their folder that is not as it should be, or not clear.
    pub fn is_of_layout(&self) -> bool {
        matches!(
            self,
            Self::Layout { .. }
                | Self::TwoLayouts { .. }
                | Self::Deep { .. }
                | Self::Side { .. }
                | Self::Twins { .. }
                | Self::TooFewCameras { .. }
                | Self::NeverTogether { .. }
                | Self::RailOfRig { .. }
        )
    }

    /// Whether it is of one scan only, and those after it can be read.
    pub fn is_of_one_scan(&self) -> bool {
        matches!(self, Self::BagImage { .. })
    }

    pub(crate) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |error| Self::Io { path, error }
    }
}

/// The first few of some names.
fn some(names: &[String]) -> String {
    const SHOWN: usize = 6;
    let shown = names[..names.len().min(SHOWN)].join(", ");
    match names.len() {
        0..=SHOWN => shown,
        _ => format!("{shown}, …"),
    }
}

/// The endings of files, in brackets.
fn of(endings: &[String]) -> String {
    match endings {
        [] => String::new(),
        endings => format!(" ({})", some(endings)),
    }
}

fn list<T: ToString>(values: &[T]) -> String {
    values
        .iter()
        .map(T::to_string)
        .collect::<Vec<_>>()
        .join(",")
}

fn in_scan(scan: Option<u64>) -> String {
    scan.map_or(String::new(), |scan| format!(" in scan {scan}"))
}
