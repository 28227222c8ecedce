//! The command line.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

use capture::calibrate::Model;
use capture::{Layout, Views};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use messages::{Delivery, Reference, Stage};

use crate::layout::Viewer;
use crate::profile::Profile;

/// Depth from one camera moved along a rail, or from three or more in a row, by matching curves.
#[derive(Debug, Parser)]
#[command(name = "tricurve", version, propagate_version = true, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 failed, 2 wrong use, 3 finished but data was lost, 10 to 12 what a comparison says (better, worse,
different), 130 aborted by a second signal.";

/// The hidden command by which this program becomes a node of a run.
pub(crate) const BE_NODE: &str = "_node";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a graph: scans go in, matches, disparities and points come out, everything is recorded
    Run(Run),
    /// Show a running graph or a recording in Foxglove, live
    View(View),
    /// Record a graph that runs already, without slowing it
    Record(Record),
    /// Play a recording: from any stage on it is computed anew, recorded or compared with what was recorded
    Replay(Replay),
    /// Show what a recording holds
    Info(Info),
    /// Compute what a proof (record.keep = proof) does not hold, check it against its digests, and write a full recording
    Rehydrate(Rehydrate),
    /// Write what is readable of a truncated or damaged recording as a whole one
    Recover(Recover),
    /// Write several recordings of one rig as one
    Merge(Merge),
    /// Write a recording in several parts, which every command reads as one
    Split(SplitArgs),
    /// Write some topics or scans of a recording
    Filter(Filter),
    /// Write a recording's results as CSV, PFM, PLY and pictures
    Export(Export),
    /// Compare results with the truth of scenes: coverage, errors, mismatches
    Evaluate(Evaluate),
    /// Sweep settings over scenes: which of them cover most at which error
    Tune(Tune),
    /// Find out what cameras are like and where they stand, from images of a chessboard or ChArUco board
    Calibrate(Calibrate),
    /// Measure from the images alone whether rows are aligned and steps equal: will matching work?
    CheckGeometry(CheckGeometry),
    /// Write a recording as one HTML page: figures, points in space, how the run went
    Report(Report),
    /// Compare two recordings of the same scans: did other settings make it better? Exit code 0 the same, 10 better,
    /// 11 worse, 12 neither
    Compare(Compare),
    /// Show how the graphs that run are doing, as they go: rates, load, queues, latencies, losses
    Top(Top),
    /// Measure what recording and viewing cost the graph, or what several instances of its stages bring
    Bench(Bench),
    /// List, measure or print the topics of a graph that runs
    Topic(TopicArgs),
    /// List the nodes of a graph that runs, or restart one
    Node(NodeArgs),
    /// List the parameters of a graph that runs, or set them otherwise: from the next scan on
    Param(ParamArgs),
    /// Check a graph file, and print the configuration it amounts to
    Validate(GraphFile),
    /// Print a graph as a Mermaid diagram
    Graph(GraphFile),
    /// Remove what dead runs left in shared memory
    Clean,
    /// Write a manual page for each command
    Man {
        /// The folder to write them to
        folder: PathBuf,
    },
    /// Print the completions for a shell
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
    /// Be one node of a run
    #[command(name = BE_NODE, hide = true)]
    BeNode(Node),
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum DeliveryArg {
    /// A scan that finds the door closed waits
    Lossless,
    /// A scan that finds the door closed is dropped whole, and counted
    Live,
}

impl From<DeliveryArg> for Delivery {
    fn from(delivery: DeliveryArg) -> Self {
        match delivery {
            DeliveryArg::Lossless => Self::Lossless,
            DeliveryArg::Live => Self::Live,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// The graph file; without one, the built-in graph
    pub(crate) graph: Option<PathBuf>,
    /// scene:tab, scene:jack, scene:screwdriver, scene:fence, scene:all, scene:thesis, a folder of images, a folder of such
    /// folders, a bag (bag:PATH: a rosbag2 folder, .mcap or .db3), or cameras: camera:gstreamer, camera:v4l, camera:bus
    #[arg(long, value_name = "SPEC")]
    pub(crate) source: Option<String>,
    /// Which of the source's views, left to right: at least three at equal steps, or all
    #[arg(long, value_name = "1,3,5")]
    pub(crate) views: Option<Views>,
    /// How the images lie in the folder, where their names leave it open: views, times, cameras, flat, columns:3, rows:3, rail
    #[arg(long, value_name = "LAYOUT")]
    pub(crate) layout: Option<Layout>,
    /// Of a bag: the topic of each view; without it, they are found by their names
    #[arg(long, value_delimiter = ',', value_name = "left=/…,centre=/…,right=/…")]
    pub(crate) topics: Vec<String>,
    /// Of a bag along a rail: the topic that says where the camera was, and which thing of several it tells of
    #[arg(long, value_name = "/TOPIC[:WHAT]")]
    pub(crate) position: Option<String>,
    /// How many scans; a source with fewer is repeated
    #[arg(long, value_name = "N")]
    pub(crate) scans: Option<u64>,
    /// Where to record; without it, a file named by the time in recordings/
    #[arg(long, value_name = "FILE", conflicts_with = "no_record")]
    pub(crate) record: Option<PathBuf>,
    /// Record nothing
    #[arg(long)]
    pub(crate) no_record: bool,
    /// Overwrite a recording that is there already
    #[arg(long)]
    pub(crate) force: bool,
    /// Run although a look at the first scans says that they are no stereo: rows off by over 1 px, views in another order,
    /// identical or of one gray level
    #[arg(long)]
    pub(crate) force_unrectified: bool,
    /// A new part of the recording after so many megabytes
    #[arg(long, value_name = "MB", conflicts_with = "no_record")]
    pub(crate) max_size: Option<u64>,
    /// A new part of the recording after so many seconds of recorded time
    #[arg(long, value_name = "S", conflicts_with = "no_record")]
    pub(crate) max_duration: Option<f64>,
    /// One camera that moves along a rail: the images are its frames, in order (short for --set capture.mode=rail)
    #[arg(long)]
    pub(crate) rail: bool,
    /// What happens to a scan that finds the door closed
    #[arg(long, value_enum)]
    pub(crate) delivery: Option<DeliveryArg>,
    /// Show it in Foxglove while it runs, as `tricurve view` does
    #[arg(long)]
    pub(crate) view: bool,
    /// Which settings to start from
    #[arg(long, value_enum, default_value = "default")]
    pub(crate) profile: Profile,
    /// Set one key of one node
    #[arg(long = "set", value_name = "NODE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Calibrate {
    /// The images: of one camera; or of several, a folder a camera, a folder a time, or by name in one folder
    pub(crate) folder: PathBuf,
    /// Inner corners along the board's rows and columns; of a ChArUco board its squares
    #[arg(long, value_name = "9x6", value_parser = board)]
    pub(crate) board: [u32; 2],
    /// Side of a square in metres
    #[arg(long, value_name = "METRES")]
    pub(crate) square: f64,
    /// Side of a ChArUco board's markers in metres
    #[arg(long, value_name = "METRES", requires = "dictionary")]
    pub(crate) marker: Option<f64>,
    /// A ChArUco board's dictionary by OpenCV's name, as DICT_4X4_50
    #[arg(long, value_name = "NAME", requires = "marker")]
    pub(crate) dictionary: Option<String>,
    /// How the images lie in FOLDER, where their names leave it open: cameras, times, flat, columns:2, rows:2, rail (one camera)
    #[arg(long, alias = "folders", value_name = "LAYOUT")]
    pub(crate) layout: Option<Layout>,
    /// What the lenses do
    #[arg(long, value_enum, default_value = "radtan")]
    pub(crate) model: LensModel,
    /// Where to write the cameras, as Kalibr does, for capture.calibration
    #[arg(short, long, value_name = "FILE", default_value = "camchain.yaml")]
    pub(crate) output: PathBuf,
    /// Where to draw every corner and by how much it misses, as SVG
    #[arg(long, value_name = "FILE.svg", value_parser = svg)]
    pub(crate) picture: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum LensModel {
    /// Radial and tangential distortion, k1, k2, p1, p2: plumb_bob
    #[default]
    #[value(alias = "plumb_bob")]
    Radtan,
    /// A fisheye, k1 to k4
    #[value(alias = "fisheye")]
    Equidistant,
}

impl From<LensModel> for Model {
    fn from(model: LensModel) -> Self {
        match model {
            LensModel::Radtan => Self::Radtan,
            LensModel::Equidistant => Self::Equidistant,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct CheckGeometry {
    /// scene:tab, scene:jack, scene:screwdriver, scene:fence, scene:all, scene:thesis, a folder of images, a folder of such
    /// folders, or a bag: a rosbag2 folder, .mcap or .db3
    #[arg(value_name = "SOURCE")]
    pub(crate) source: String,
    /// Which of the source's views, left to right: at least three at equal steps, or all
    #[arg(long, value_name = "1,3,5")]
    pub(crate) views: Option<Views>,
    /// How the images lie in the folder, where their names leave it open: views, times, cameras, flat, columns:3, rows:3, rail
    #[arg(long, value_name = "LAYOUT")]
    pub(crate) layout: Option<Layout>,
    /// Which settings to start from
    #[arg(long, value_enum, default_value = "default")]
    pub(crate) profile: Profile,
    /// Set one key of one node
    #[arg(long = "set", value_name = "NODE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Of a rig: where to write what is left to correct in each view, as Kalibr does, for capture.calibration
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Replace a file that exists
    #[arg(long, requires = "output")]
    pub(crate) force: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct View {
    /// The recording to play; without one, the graph that runs
    pub(crate) file: Option<PathBuf>,
    /// Which run, by its name or the beginning of it; not needed when only one is alive
    #[arg(long, value_name = "NAME", conflicts_with = "file")]
    pub(crate) run: Option<String>,
    /// The port that viewers connect to; 0 for any that is free
    #[arg(long, default_value_t = 8765)]
    pub(crate) port: u16,
    /// The address to listen at; any but the loopback lets everybody on the network in, without a password
    #[arg(long, default_value = "127.0.0.1", value_parser = host)]
    pub(crate) host: IpAddr,
    /// A web page that may look besides those of this machine and of the public viewers; may be given again
    #[arg(long, value_name = "https://HOST:PORT")]
    pub(crate) origin: Vec<String>,
    /// Begin paused, at the first scan
    #[arg(long, requires = "file")]
    pub(crate) start_paused: bool,
    /// Open Foxglove in the browser
    #[arg(long)]
    pub(crate) open: bool,
    /// Print the layout, to be imported by the viewer, and end: of a recording it looks at its points and shows what it has
    #[arg(long, conflicts_with_all = ["open", "check"])]
    pub(crate) layout: bool,
    /// With --layout and --check: whose layout
    #[arg(
        long = "for",
        value_enum,
        default_value = "foxglove",
        value_name = "VIEWER"
    )]
    pub(crate) viewer: Viewer,
    /// Check that the recording, or the graph that runs, has all that the layout shows, and end; `--check=FILE` checks a layout
    /// of yours
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true)]
    pub(crate) check: Option<Option<PathBuf>>,
    /// With --check, print the result as JSON
    #[arg(long, requires = "check")]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Record {
    /// The recording to write
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Which run, by its name or the beginning of it; not needed when only one is alive
    #[arg(long, value_name = "NAME")]
    pub(crate) run: Option<String>,
    /// Only these topics, with * for anything; transforms and calibrations are recorded in any case
    #[arg(long, value_delimiter = ',', value_name = "points,edges/*")]
    pub(crate) topics: Vec<String>,
    /// Only topics in which this regular expression is found
    #[arg(long, value_name = "REGEX")]
    pub(crate) regex: Option<String>,
    /// A new part after so many megabytes
    #[arg(long, value_name = "MB")]
    pub(crate) max_size: Option<u64>,
    /// A new part after so many seconds of recorded time
    #[arg(long, value_name = "S")]
    pub(crate) max_duration: Option<f64>,
    /// End after so many scans
    #[arg(long, value_name = "N", conflicts_with = "snapshot")]
    pub(crate) scans: Option<u64>,
    /// Keep the last seconds in memory; Enter or SIGUSR1 writes them
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["max_size", "max_duration"])]
    pub(crate) snapshot: Option<f64>,
    /// Overwrite a recording that is there already
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Takes the name of a stage.
fn stage() -> impl TypedValueParser<Value = Stage> {
    let names = Stage::all().into_iter().map(Stage::name);
    PossibleValuesParser::new(names)
        .try_map(|name| Stage::named(&name).ok_or_else(|| format!("there is no stage {name}")))
}

/// A range of scans.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scans {
    pub(crate) first: u64,
    pub(crate) end: Option<u64>,
}

impl std::str::FromStr for Scans {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("expected A..B, A.. or ..B with A before B, not {text:?}");
        let (first, end) = text.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| match text.trim() {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| wrong()),
        };
        let scans = Self {
            first: number(first)?.unwrap_or(0),
            end: number(end)?,
        };
        match scans.end.is_some_and(|end| end <= scans.first) {
            true => Err(wrong()),
            false => Ok(scans),
        }
    }
}

#[derive(Clone, Debug, Args)]
pub(crate) struct Replay {
    /// The recording; its further parts are found by their names
    pub(crate) file: PathBuf,
    /// The first stage that computes anew, with all that take from it; what was recorded of the others is played
    #[arg(long, value_parser = stage(), default_value = "capture", value_name = "STAGE")]
    pub(crate) from: Stage,
    /// The last stage that computes, beside those it takes from; by default all compute
    #[arg(long, value_parser = stage(), value_name = "STAGE")]
    pub(crate) to: Option<Stage>,
    /// Play in the recording's own time, this many times as fast; without it, as fast as the graph goes
    #[arg(long, value_name = "R", conflicts_with = "lockstep", value_parser = rate)]
    pub(crate) rate: Option<f64>,
    /// Play as fast as the graph goes, the default
    #[arg(long)]
    pub(crate) lockstep: bool,
    /// Begin again at the end; scans go on being numbered
    #[arg(long = "loop", conflicts_with = "verify")]
    pub(crate) repeat: bool,
    /// Leave out so many seconds at the beginning
    #[arg(long, value_name = "S", conflicts_with = "scans", value_parser = offset)]
    pub(crate) start_offset: Option<f64>,
    /// Play only so many seconds
    #[arg(long, value_name = "S", conflicts_with = "scans", value_parser = offset)]
    pub(crate) duration: Option<f64>,
    /// Play only the scans from A on, before B
    #[arg(long, value_name = "A..B")]
    pub(crate) scans: Option<Scans>,
    /// Which of the topics computed anew are recorded, by the first part of their names
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "edges,curves",
        requires = "record"
    )]
    pub(crate) topics: Option<Vec<String>>,
    /// Begin with a pause
    #[arg(long)]
    pub(crate) start_paused: bool,
    /// Set one key of one node, other than it was
    #[arg(long = "set", value_name = "NODE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Record what is computed anew
    #[arg(long, value_name = "FILE", conflicts_with = "no_record")]
    pub(crate) record: Option<PathBuf>,
    /// Record nothing, the default
    #[arg(long)]
    pub(crate) no_record: bool,
    /// Overwrite a recording that is there already
    #[arg(long)]
    pub(crate) force: bool,
    /// Show it in Foxglove while it plays: pause, rate and place as the viewer says
    #[arg(long)]
    pub(crate) view: bool,
    /// Compare what is computed with what was recorded, byte for byte
    #[arg(long)]
    pub(crate) verify: bool,
    /// Say whether it got better: compare what comes out with what was recorded, as `tricurve compare` does; exit code 10
    /// better, 11 worse
    #[arg(long, conflicts_with_all = ["verify", "repeat", "topics"])]
    pub(crate) compare: bool,
    /// The graph file it was recorded with, where the recording does not say its settings any more
    #[arg(long, value_name = "FILE")]
    pub(crate) graph: Option<PathBuf>,
    /// The profile it was recorded with, where the recording does not say its settings any more
    #[arg(long, value_enum)]
    pub(crate) profile: Option<Profile>,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl Replay {
    /// As it is when nothing is said but what is played.
    pub(crate) fn of(file: PathBuf, scans: Option<Scans>) -> Self {
        Self {
            file,
            scans,
            from: Stage::CAPTURE,
            to: None,
            rate: None,
            lockstep: false,
            repeat: false,
            start_offset: None,
            duration: None,
            topics: None,
            start_paused: false,
            set: Vec::new(),
            record: None,
            no_record: false,
            force: false,
            view: false,
            verify: false,
            compare: false,
            graph: None,
            profile: None,
            json: false,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Rehydrate {
    /// The proof; its further parts are found by their names
    pub(crate) file: PathBuf,
    /// Only the scans from A on, before B
    #[arg(long, value_name = "A..B")]
    pub(crate) scans: Option<Scans>,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
pub(crate) struct Info {
    /// The recording; its further parts are found by their names
    pub(crate) file: PathBuf,
    /// Read all of it, and exit with 3 unless it is complete and undamaged, every scan is whole, cameras are known and the
    /// ledger balances
    #[arg(long)]
    pub(crate) check: bool,
    /// Print all its settings, not only those that differ from the profile they are nearest to
    #[arg(long)]
    pub(crate) settings: bool,
    /// Print it as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Where a recording made from others goes.
#[derive(Debug, Args)]
pub(crate) struct Output {
    /// The recording to write
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Overwrite a recording that is there already
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Recover {
    /// The recording; its further parts are found by their names
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// The recordings, in order; the scans of each are numbered on from those before
    #[arg(required = true, num_args = 2..)]
    pub(crate) files: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
#[command(
    override_usage = "tricurve split [OPTIONS] <FILE> --output <FILE>\n       <--size <MB>|--duration <S>|--scans <N>>"
)]
#[command(group = clap::ArgGroup::new("when").required(true).multiple(true).args(["size", "duration", "scans"]))]
pub(crate) struct SplitArgs {
    /// The recording; its further parts are found by their names
    pub(crate) file: PathBuf,
    /// A new part after so many megabytes of messages
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) size: Option<u64>,
    /// A new part after so many seconds of recorded time
    #[arg(long, value_name = "S")]
    pub(crate) duration: Option<f64>,
    /// A new part after so many scans
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) scans: Option<u64>,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
#[command(
    override_usage = "tricurve filter [OPTIONS] <FILE> --output <FILE>\n       <--topics <points,edges/*>|--scans <A..B>>"
)]
#[command(group = clap::ArgGroup::new("what").required(true).multiple(true).args(["topics", "scans"]))]
pub(crate) struct Filter {
    /// The recording; its further parts are found by their names
    pub(crate) file: PathBuf,
    /// Only these topics, with * for anything; transforms and calibrations stay
    #[arg(long, value_delimiter = ',', value_name = "points,edges/*")]
    pub(crate) topics: Vec<String>,
    /// Only the scans from A on, before B
    #[arg(long, value_name = "A..B")]
    pub(crate) scans: Option<Scans>,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// The recording; its further parts are found by their names
    pub(crate) file: PathBuf,
    /// Only this scan
    #[arg(long, value_name = "N")]
    pub(crate) scan: Option<u64>,
    /// The points as CSV; like every file written here, it replaces one of the same name: scan,view,channel,curve,x,y,disparity,score,depth
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// The disparity picture of one scan as PFM
    #[arg(long, value_name = "FILE")]
    pub(crate) pfm: Option<PathBuf>,
    /// The points of one scan as PLY, in metres
    #[arg(long, value_name = "FILE")]
    pub(crate) ply: Option<PathBuf>,
    /// The map of a rail, all scans together, as PLY, in metres
    #[arg(long, value_name = "FILE")]
    pub(crate) map: Option<PathBuf>,
    /// Pictures of every view and channel: zero-crossings, orientation, curves, disparity
    #[arg(long, value_name = "FOLDER")]
    pub(crate) png: Option<PathBuf>,
    /// The thesis's figures of each object, B.1 to B.39 where there are three, and a contact sheet of them
    #[arg(long, value_name = "FOLDER")]
    pub(crate) thesis: Option<PathBuf>,
}

/// Pixels of disparity beyond which a point has moved, unless it is said otherwise.
pub(crate) const WITHIN: f32 = 0.5;

#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The recording to compare with
    pub(crate) a: PathBuf,
    /// The other one: is it better?
    pub(crate) b: PathBuf,
    /// Pixels of disparity beyond which a point has moved
    #[arg(long, value_name = "PIXELS", default_value_t = WITHIN)]
    pub(crate) within: f32,
    /// A picture of both and of what differs, side by side
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,
    /// The scan that the picture shows; without it, the first that both have
    #[arg(long, value_name = "N", requires = "png")]
    pub(crate) scan: Option<u64>,
    /// Print it as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// The rivals of the method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArg {
    /// Zero-crossings one by one, in two views
    Point,
    /// Curves in two views
    TwoView,
}

impl From<MethodArg> for matching::Method {
    fn from(method: MethodArg) -> Self {
        match method {
            MethodArg::Point => Self::Point,
            MethodArg::TwoView => Self::TwoView,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Evaluate {
    /// scene:all, scene:thesis, folders of scenes with their truth (scene.json, or as Middlebury hands them out), or folders of such
    #[arg(required = true, value_name = "SPEC")]
    pub(crate) sources: Vec<String>,
    /// Which of each scene's views, left to right: at least three at equal steps, or all
    #[arg(long, value_name = "1,3,5")]
    pub(crate) views: Option<Views>,
    /// How the images lie in the folder, where their names leave it open: views, times, cameras, flat, columns:3, rows:3, rail
    #[arg(long, value_name = "LAYOUT")]
    pub(crate) layout: Option<Layout>,
    /// Which of them results refer to: left, centre, right, or its number among them, counted from 0
    #[arg(long, value_name = "VIEW")]
    pub(crate) reference: Option<Reference>,
    /// Which rival methods are evaluated too
    #[arg(long, value_enum, value_delimiter = ',', value_name = "point,two-view")]
    pub(crate) against: Vec<MethodArg>,
    /// Which settings to start from
    #[arg(long, value_enum, default_value = "default")]
    pub(crate) profile: Profile,
    /// Set one key of one node
    #[arg(long = "set", value_name = "NODE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Tune {
    /// scene:all, folders of scenes, or folders of such
    #[arg(required = true, value_name = "SPEC")]
    pub(crate) sources: Vec<String>,
    /// Errors are those against the truth; without it, contradictions between two reference views
    #[arg(long)]
    pub(crate) truth: bool,
    /// A setting and the values to try it with; several are combined
    #[arg(long, value_name = "NODE.KEY=A,B,C")]
    pub(crate) sweep: Vec<String>,
    /// Which of each scene's views, left to right: at least three at equal steps, or all
    #[arg(long, value_name = "1,3,5")]
    pub(crate) views: Option<Views>,
    /// How the images lie in the folder, where their names leave it open: views, times, cameras, flat, columns:3, rows:3, rail
    #[arg(long, value_name = "LAYOUT")]
    pub(crate) layout: Option<Layout>,
    /// Which of them results refer to: left, centre, right, or its number among them, counted from 0
    #[arg(long, value_name = "VIEW")]
    pub(crate) reference: Option<Reference>,
    /// Which settings to start from
    #[arg(long, value_enum, default_value = "default")]
    pub(crate) profile: Profile,
    /// Set one key of one node
    #[arg(long = "set", value_name = "NODE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Draw the sweep: a cell a combination, the first two settings across and down
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) picture: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Report {
    /// The recording; its further parts are found by their names
    pub(crate) file: PathBuf,
    /// The page to write
    #[arg(
        short,
        long,
        value_name = "FILE.html",
        required_unless_present = "thesis"
    )]
    pub(crate) output: Option<PathBuf>,
    /// A page of the thesis's figures of each object, B.1 to B.39 where there are three
    #[arg(long, value_name = "FILE.html")]
    pub(crate) thesis: Option<PathBuf>,
    /// The figures of the scans from A on, before B; without it, of the first of each scene, at most four
    #[arg(long, value_name = "A..B")]
    pub(crate) scans: Option<Scans>,
    /// Overwrite a page that is there already
    #[arg(long)]
    pub(crate) force: bool,
}

/// What the figures of `top` are.
const TOP_FIGURES: &str = "\
Keys: arrows or Tab choose a graph and a node, r and then y restart the node, q, Esc or Ctrl-C end.

Of each graph, by its key in JSON:
  run                     its name
  seconds                 the interval
  scans_done, scans_total, scans_under_way
                          scans; in all, where the source knows how many
  scans_dropped, scans_dropped_by_cause
                          scans turned away at the door
  triples_per_second      scans done a second, in the interval
  recorder_lag_scans      scans let in that its recorder has not written; null without one
  paused, launcher_silent, ended
                          true or false
  nodes                   along the pipe:
    node                  its name
    state                 starting, running, stopped, finished, failed or gone
    restarts              how often its process was started again
    cpu_percent           of one core, in the interval
    memory_megabytes      memory of its own, without what is shared
    hz                    how often each of its topics was published a second, between two reports
    megabytes_per_second  what its messages held, between two reports
    queue_scans           scans of which it has received something and is not done with
    p50_ms, p99_ms        milliseconds it worked on a scan, since its process began
    drops, drops_by_cause messages or elements it lost, since its process began
What does not apply or is not known yet is null.

A megabyte is a million bytes. Nothing is subscribed to: nodes report once a second in any case.";

#[derive(Debug, Args)]
#[command(after_long_help = TOP_FIGURES)]
pub(crate) struct Top {
    /// Which run, by its name or the beginning of it; without it, all that are alive
    #[arg(long, value_name = "NAME")]
    pub(crate) run: Option<String>,
    /// Print one table after one interval, as it is done where the output is no terminal
    #[arg(long)]
    pub(crate) once: bool,
    /// Print it as JSON, once
    #[arg(long)]
    pub(crate) json: bool,
    /// The interval
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = seconds)]
    pub(crate) every: f64,
}

#[derive(Debug, Args)]
pub(crate) struct Bench {
    /// Compare the graph without observers, with the recorder, with a viewer that takes everything, and with both
    #[arg(long, required_unless_present = "instances")]
    pub(crate) observers: bool,
    /// Compare one, two, … instances of every stage, and say what the times of the stages predict for more cores
    #[arg(long, conflicts_with = "observers")]
    pub(crate) instances: bool,
    /// What the graph looks at: as in `run`
    #[arg(long, value_name = "SPEC", default_value = "scene:all")]
    pub(crate) source: String,
    /// How many scans are measured each time, after others that fill the graph; without it, 20 and for 4 seconds at least
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) scans: Option<u64>,
    /// How often each is measured, in turn: a machine that is slower for a while is slower for all
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) rounds: u32,
    /// Which settings to start from
    #[arg(long, value_enum, default_value = "default")]
    pub(crate) profile: Profile,
    /// Set one key of one node
    #[arg(long = "set", value_name = "NODE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Which graph is asked, and how its answer is printed.
#[derive(Debug, Args)]
pub(crate) struct Asked {
    /// Which run, by its name or the beginning of it; not needed when only one is alive
    #[arg(long, value_name = "NAME", global = true)]
    pub(crate) run: Option<String>,
    /// Print the result as JSON
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct TopicArgs {
    #[command(subcommand)]
    pub(crate) command: TopicCommand,
    #[command(flatten)]
    pub(crate) asked: Asked,
}

#[derive(Debug, Subcommand)]
pub(crate) enum TopicCommand {
    /// All topics, who makes and who takes them
    List,
    /// What is known of a topic
    Info {
        /// Its name
        topic: String,
    },
    /// How often and how regularly its messages come
    Hz {
        /// Its name
        topic: String,
        /// How long to listen
        #[arg(long, value_name = "S", default_value_t = 3.0, value_parser = seconds)]
        seconds: f64,
    },
    /// Its messages as text, as they come
    Echo {
        /// Its name
        topic: String,
        /// How many; without it, until the run ends
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
        count: Option<u64>,
        /// How many elements of each section are shown
        #[arg(long, value_name = "N", default_value_t = 3)]
        elements: usize,
    },
}

/// A number in a range.
fn number(text: &str, least: f64, most: f64) -> Result<f64, String> {
    let within = |number: &f64| (least..=most).contains(number);
    let number = text.trim().parse::<f64>().ok().filter(within);
    number.ok_or_else(|| format!("expected a number from {least} to {most}"))
}

/// A file that is called what it will be.
fn svg(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    match ending.is_some_and(|ending| ending == "svg") || text == "-" {
        true => Ok(path),
        false => Err("the picture is an SVG file: give a name that ends in .svg".to_owned()),
    }
}

/// Reads `9x6`.
fn board(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X', '×']);
    let sides = sides.and_then(|(a, b)| Some([a.trim().parse().ok()?, b.trim().parse().ok()?]));
    sides.ok_or_else(|| "expected are two counts, as 9x6".to_owned())
}

/// An address of this machine.
fn host(text: &str) -> Result<IpAddr, String> {
    match text {
        "localhost" => Ok(Ipv4Addr::LOCALHOST.into()),
        address => address
            .parse()
            .map_err(|_| "expected an address, as 127.0.0.1, or localhost".to_owned()),
    }
}

/// Seconds that can be waited for.
fn seconds(text: &str) -> Result<f64, String> {
    number(text, 0.1, 86_400.0)
}

/// How many times as fast.
fn rate(text: &str) -> Result<f64, String> {
    number(text, 0.001, 1000.0)
}

/// Seconds of recorded time.
fn offset(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1e9)
}

#[derive(Debug, Args)]
pub(crate) struct ParamArgs {
    #[command(subcommand)]
    pub(crate) command: ParamCommand,
    #[command(flatten)]
    pub(crate) asked: Asked,
}

#[derive(Debug, Subcommand)]
pub(crate) enum ParamCommand {
    /// All parameters: value, range, meaning
    List,
    /// The value of one
    Get {
        /// As match.curves.score
        name: String,
    },
    /// Set some, all or none of them; it is told from which scan on they hold
    Set {
        /// As match.curves.score=0.6, or track.high=automatic
        #[arg(required = true, value_name = "NODE.KEY=VALUE")]
        values: Vec<String>,
    },
}

#[derive(Debug, Args)]
pub(crate) struct NodeArgs {
    #[command(subcommand)]
    pub(crate) command: NodeCommand,
    #[command(flatten)]
    pub(crate) asked: Asked,
}

#[derive(Debug, Subcommand)]
pub(crate) enum NodeCommand {
    /// All nodes: process, restarts, state, CPU, memory
    List,
    /// End a node's process; it is started again and what was under way is sent once more
    Restart {
        /// Its name
        node: String,
    },
}

#[derive(Debug, Args)]
pub(crate) struct GraphFile {
    /// The graph file; without one, the built-in graph
    pub(crate) graph: Option<PathBuf>,
    /// Which settings to start from
    #[arg(long, value_enum, default_value = "default")]
    pub(crate) profile: Profile,
    /// Set one key of one node
    #[arg(long = "set", value_name = "NODE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
}

#[derive(Debug, Args)]
pub(crate) struct Node {
    /// Which
    pub(crate) name: String,
    /// Folder of the run
    #[arg(long)]
    pub(crate) run: PathBuf,
    /// How many times it was started before
    #[arg(long, default_value_t = 0)]
    pub(crate) life: u32,
    /// How far the scans have come, as JSON
    #[arg(long)]
    pub(crate) resume: Option<String>,
}
