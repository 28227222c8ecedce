//! `tricurve view`: a recording or a running graph for Foxglove and other viewers.

use std::collections::BTreeSet;
use std::fs;
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use bridge::{Live, LiveError, Player, Press, Settings, Viewing};
use crossbeam::channel::bounded;
use messages::bus::Play;
use messages::record::{Codec, Shown};
use messages::recording::Recording;
use messages::settings::Settings as _;
use messages::words::counted;

use super::proof;
use crate::cli::{Replay, View as Args};
use crate::keys::{Key, Keys};
use crate::layout::{self, Checked, Focus, There, Viewer, Wanted};
use crate::node::give_way;
use crate::running::Running;
use crate::{Failure, Outcome, signals};

/// How often it is looked whether the graph is still there.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// How long a graph may take to start before no browser is opened any more.
const MOST_WAITED: Duration = Duration::from_secs(60);

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    if args.layout {
        let recording = args.file.as_deref().map(Recording::open).transpose();
        let mut recording = recording.map_err(Failure::failed)?;
        let seen = recording.as_mut().map(Seen::of).unwrap_or_default();
        let codec = recording.as_ref().map(Recording::codec);
        super::print(&seen.layout(codec, args.viewer))?;
        return Ok(Outcome::Done);
    }
    let settings = Settings {
        host: args.host.to_string(),
        port: args.port.into(),
        origins: args.origin.clone(),
        ..Settings::default()
    };
    settings
        .check()
        .map_err(|error| Failure::usage(format!("bridge.{error}")))?;
    match &args.file {
        Some(file) => recording(args, file, &settings),
        None => running(args, &settings),
    }
}

/// What the keys do, for the user.
const HELP: &str =
    "space: pause or play, \u{2190} \u{2192}: one scan, \u{2191} \u{2193}: rate, q: end";
/// Keys that may wait.
const MOST_KEYS: usize = 64;

fn press_of(key: Key) -> Press {
    match key {
        Key::Play(Play::Step) => Press::Step,
        Key::Back => Press::Back,
        Key::Play(Play::Faster) => Press::Faster,
        Key::Play(Play::Slower) => Press::Slower,
        Key::Play(_) | Key::End => Press::Pause,
    }
}

/// What to set when the port is taken.
const HOW: &str = "--port, as in --port 8766, or --port 0 for any that is free";

fn recording(args: &Args, file: &Path, settings: &Settings) -> Result<Outcome, Failure> {
    let mut recording = Recording::open(file).map_err(Failure::failed)?;
    for note in recording.notes().iter().chain(recording.remarks()) {
        crate::say!("view: {note}");
    }
    if args.check.is_some() {
        // What is not in a proof is computed while it plays: its last scan tells all of it.
        let last: Vec<u64> = recording
            .whole_scans()
            .into_iter()
            .next_back()
            .into_iter()
            .collect();
        let _computed = proof::complete(&mut recording, &last, &[])?;
        let there = there_in(&mut recording)?;
        return checked(args, recording.codec(), &there);
    }
    if recording.is_proof() {
        return computed(args, file);
    }
    let seen = Seen::of(&mut recording);
    let codec = recording.codec().clone();
    let scans = recording.scans().len();
    let path = recording.path().display().to_string();
    let end = signals::flag(&signals::END)?;
    let mut player =
        Player::start(recording, settings, args.start_paused, HOW).map_err(Failure::failed)?;
    let title = format!(
        "{path}: {}, played as the viewer says; Ctrl-C ends",
        counted(scans, "scan")
    );
    tell(args, &title, player.address(), (&codec, &seen), Some(file))?;
    let (press, pressed) = bounded(MOST_KEYS);
    let keys = Keys::listen(move |key| press.try_send(key).unwrap_or_default());
    if keys.is_some() {
        crate::say!("view: {HELP}");
    }
    if player.is_awaited() {
        crate::say!("view: it begins to play when a viewer subscribes");
    }
    while !end.load(Ordering::Relaxed) {
        player.turn().map_err(Failure::failed)?;
        say(&player.remarks());
        for key in pressed.try_iter() {
            match key {
                Key::End => end.store(true, Ordering::Relaxed),
                key => crate::say!("view: {}", player.press(press_of(key))),
            }
        }
    }
    say_missed(player.missed());
    Ok(Outcome::Done)
}

/// Plays a proof: what it does not hold is computed meanwhile.
fn computed(args: &Args, file: &Path) -> Result<Outcome, Failure> {
    crate::say!("view: the recording is a proof: what it does not hold is computed while it plays");
    if args.open {
        open_when_there(SocketAddr::new(args.host, args.port));
    }
    let set = |key: &str, value: String| format!("bridge.{key}={value}");
    super::replay::run(&Replay {
        rate: Some(1.0),
        repeat: true,
        start_paused: args.start_paused,
        view: true,
        set: vec![
            set("host", format!("{:?}", args.host.to_string())),
            set("port", args.port.to_string()),
            set("origins", format!("{:?}", args.origin)),
        ],
        ..Replay::of(file.to_owned(), None)
    })
}

fn running(args: &Args, settings: &Settings) -> Result<Outcome, Failure> {
    let running = Running::choose(args.run.as_deref()).map_err(|failure| Failure {
        text: format!("{}; or name a recording to view", failure.text),
        ..failure
    })?;
    let orders = &running.orders;
    let reference = bridge::node::reference_of(&orders.run, &orders.configuration);
    let codec = Codec::new(orders.run.rig.clone(), reference);
    if args.check.is_some() {
        let channels = codec.channels_of(Shown::ALL, &orders.run.kinds());
        return checked(args, &codec, &There::promised(&codec, channels));
    }
    // A graph waits for nobody who looks at it: neither for memory nor for a processor.
    give_way();
    let end = signals::flag(&signals::END)?;
    let mut viewing = Viewing::start(&Live {
        run: &orders.run,
        reference,
        settings,
        how: HOW,
    })
    .map_err(|error| match error {
        LiveError::Bus(error) => running.cannot_join(&error),
        error => Failure::failed(error),
    })?;
    let title = format!("the running graph {}: Ctrl-C ends the view", running.name());
    let seen = Seen::default();
    tell(args, &title, viewing.address(), (&codec, &seen), None)?;
    let mut next_look = Instant::now();
    while !end.load(Ordering::Relaxed) {
        viewing.wait();
        viewing.turn().map_err(Failure::failed)?;
        say(&viewing.remarks());
        if next_look <= Instant::now() {
            next_look = Instant::now() + LOOK_EVERY;
            if !running.goes_on() {
                crate::say!("view: {}", running.why_over());
                break;
            }
        }
    }
    say_missed(viewing.missed());
    Ok(Outcome::Done)
}

fn say(remarks: &[String]) {
    for remark in remarks {
        crate::say!("view: {remark}");
    }
}

fn say_missed((missed, offered): (u64, u64)) {
    if missed > 0 {
        crate::say!(
            "view: viewers did not get {missed} of {offered} scans: they, or the bridge, were too slow"
        );
    }
}

/// Says where viewers find it, and opens one if that is wanted.
fn tell(
    args: &Args,
    title: &str,
    address: SocketAddr,
    (codec, seen): (&Codec, &Seen),
    file: Option<&Path>,
) -> Result<(), Failure> {
    if !address.ip().is_loopback() {
        crate::say!(
            "view: warning: everybody on the network can see all images and turn all parameters: nobody is asked for a password"
        );
    }
    // Viewers connect to an address, not to all of them.
    let host = match address.ip() {
        ip if ip.is_unspecified() => "localhost".to_owned(),
        ip @ std::net::IpAddr::V6(_) => format!("[{ip}]"),
        ip => ip.to_string(),
    };
    let server = format!("ws://{host}:{}", address.port());
    let foxglove = foxglove_url(&server);
    let is_file = file.is_some();
    let file = file.map_or(String::new(), |file| {
        quoted(&file.display().to_string()) + " "
    });
    let layout = |viewer, how: &str| {
        let written = layout_file(codec, seen, viewer);
        written.map_or_else(
            |_| format!("tricurve view {file}--layout{how} > layout.json"),
            |path| quoted(&path.display().to_string()),
        )
    };
    let script = match layout_file(codec, seen, Viewer::Rerun) {
        Ok(script) => script.display().to_string(),
        Err(_) => "layout.py".to_owned(),
    };
    let rerun = match is_file {
        true => format!("python {}", quoted(&script)),
        false => format!(
            "tricurve record -o now.mcap --scans 100 && python {} now.mcap",
            quoted(&script)
        ),
    };
    let elsewhere = match address.ip().is_loopback() {
        true => String::new(),
        false => from_elsewhere(address),
    };
    let foxgloves = layout(Viewer::Foxglove, "");
    let lichtblicks = layout(Viewer::Lichtblick, " --for lichtblick");
    super::print(&format!(
        "{title}\n  \
         server      {server}\n  \
         Foxglove    {foxglove}\n  \
         Lichtblick  open a connection, Foxglove WebSocket, {server}\n  \
         Rerun       {rerun}   (pip install rerun-sdk)\n  \
         layouts     {foxgloves}\n              {lichtblicks}\n{elsewhere}"
    ))?;
    if args.open {
        open(&foxglove);
    }
    Ok(())
}

/// What viewers on other machines are to do.
fn from_elsewhere(address: SocketAddr) -> String {
    let name = rustix::system::uname();
    let name = name.nodename().to_string_lossy();
    let port = address.port();
    let (host, there) = match address.ip() {
        ip if ip.is_unspecified() => (name.to_string(), "localhost".to_owned()),
        std::net::IpAddr::V6(ip) => (format!("[{ip}]"), format!("[{ip}]")),
        ip => (ip.to_string(), ip.to_string()),
    };
    format!(
        "  elsewhere   ws://{host}:{port} in a desktop viewer. A browser refuses it, since the web viewers'\n              \
         pages are encrypted and this is not: there, `ssh -L {port}:{there}:{port} {name}`,\n              \
         and then the addresses above, with localhost\n"
    )
}

/// Opens the browser when somebody listens at an address.
fn open_when_there(address: SocketAddr) {
    let wait = move || {
        let until = Instant::now() + MOST_WAITED;
        while Instant::now() < until {
            if TcpStream::connect_timeout(&address, LOOK_EVERY).is_ok() {
                return open(&foxglove_url(&format!("ws://{address}")));
            }
            std::thread::sleep(LOOK_EVERY);
        }
    };
    let thread = std::thread::Builder::new().name("open".to_owned());
    if let Err(error) = thread.spawn(wait) {
        crate::say!("view: cannot open a browser: {error}");
    }
}

/// Opens the browser.
fn open(url: &str) {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let opened = Command::new(opener)
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    // It is waited for beside the view, so that nothing of it stays.
    let waited = opened.and_then(|mut child| {
        let wait = move || child.wait().map_or((), drop);
        std::thread::Builder::new()
            .name("open".to_owned())
            .spawn(wait)
    });
    if let Err(error) = waited {
        crate::say!("view: cannot open a browser with {opener}: {error}");
    }
}

/// A word for the shell, as a user would write it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    match word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

fn foxglove_url(server: &str) -> String {
    let escaped = server.replace(':', "%3A").replace('/', "%2F");
    format!("https://app.foxglove.dev/~/view?ds=foxglove-websocket&ds.url={escaped}")
}

/// What of a recording a layout is made for; of a graph nothing.
#[derive(Default)]
struct Seen {
    there: Option<There>,
    focus: Option<Focus>,
    /// The recording.
    file: Option<PathBuf>,
}

impl Seen {
    fn of(recording: &mut Recording) -> Self {
        let focus = Focus::of(recording).unwrap_or_else(|error| {
            crate::say!("view: the layout looks nowhere in particular: {error}");
            None
        });
        let mut there = defined_in(recording);
        // What cannot be read is told where it is shown.
        take_messages(recording, &mut there, MOST_LOOKED_AT).unwrap_or_default();
        Self {
            there: Some(there),
            focus,
            file: std::path::absolute(recording.path()).ok(),
        }
    }

    fn layout(&self, codec: Option<&Codec>, viewer: Viewer) -> String {
        let wanted = Wanted {
            codec,
            recording: self.there.as_ref(),
            focus: self.focus.as_ref(),
            file: self.file.as_deref(),
            viewer,
        };
        wanted.layout()
    }
}

/// The layout as a file to import, written to the user's cache under a name of its own for what it is made for.
fn layout_file(codec: &Codec, seen: &Seen, viewer: Viewer) -> std::io::Result<PathBuf> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let cache = set("XDG_CACHE_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(set("HOME")?).join(".cache")));
    let cache = cache.ok_or(std::io::ErrorKind::NotFound)?;
    let (layout, rig) = (seen.layout(Some(codec), viewer), codec.rig());
    let name = seen.file.as_deref().and_then(Path::file_stem);
    let of = match (name, rig.rail, rig.views.len()) {
        (Some(name), _, _) => format!("-{}", name.display()),
        (None, Some(_), _) => "-rail".to_owned(),
        (None, None, 3) => String::new(),
        (None, None, views) => format!("-{views}-views-{}", codec.reference()),
    };
    let finest = rig.channels.last().copied().unwrap_or_default();
    let by = match viewer {
        Viewer::Foxglove => ".json",
        Viewer::Lichtblick => "-lichtblick.json",
        Viewer::Rerun => "-rerun.py",
    };
    let folder = cache.join("tricurve");
    let path = folder.join(format!("layout{of}-{finest}{by}"));
    if fs::read(&path).is_ok_and(|written| written == layout.as_bytes()) {
        return Ok(path);
    }
    fs::create_dir_all(&folder)?;
    fs::write(&path, layout)?;
    Ok(path)
}

/// The topics of a recording as they are defined, without their messages.
fn defined_in(recording: &Recording) -> There {
    let mut there = There::default();
    for (topic, _, schema) in recording.definitions() {
        let entry = there.topics.entry(topic.to_owned()).or_default();
        if let Some(schema) = schema {
            entry.schema = schema.name.clone();
            entry.encoding = schema.encoding.clone();
            entry.data = schema.data.clone();
        }
    }
    there.frames = recording.codec().frames().map(str::to_owned).collect();
    there.scans = recording.scans().len();
    there
}

/// What a recording has to show, with a message of each topic.
fn there_in(recording: &mut Recording) -> Result<There, Failure> {
    let mut there = There {
        needs_messages: true,
        ..defined_in(recording)
    };
    take_messages(recording, &mut there, usize::MAX)?;
    Ok(there)
}

/// Scans that are looked at for a layout, which is to be there at once.
const MOST_LOOKED_AT: usize = 64;

/// Takes the newest message of each topic, as far as so many scans have one: what is said every second is not said with
/// every scan.
fn take_messages(recording: &mut Recording, there: &mut There, most: usize) -> Result<(), Failure> {
    let mut wanted: BTreeSet<String> = there.topics.keys().cloned().collect();
    let scans: Vec<u64> = recording.scans().rev().take(most).collect();
    for scan in scans {
        if wanted.is_empty() {
            break;
        }
        let scan = recording
            .scan_of(scan, |topic| wanted.contains(topic))
            .map_err(Failure::failed)?;
        for (topic, message) in scan.messages() {
            if wanted.remove(topic)
                && let Some(entry) = there.topics.get_mut(topic)
            {
                entry.message = Some(message.to_vec());
            }
        }
        recording.reuse(scan);
    }
    Ok(())
}

fn checked(args: &Args, codec: &Codec, there: &There) -> Result<Outcome, Failure> {
    let own = args.check.iter().flatten().next();
    let own = own.map(|path| {
        fs::read_to_string(path)
            .map_err(|error| Failure::failed(format!("{}: {error}", path.display())))
    });
    let own = own.transpose()?;
    let checked =
        layout::checked(own.as_deref(), codec, there, args.viewer).map_err(Failure::failed)?;
    let Checked {
        panels,
        references,
        missing,
        without_truth,
    } = &checked;
    if args.json {
        super::print_json(&checked)?;
    } else {
        super::print(&format!(
            "the layout's {panels} panels name {references} topics, fields and frames: {} missing\n",
            missing.len()
        ))?;
        for missing in missing {
            crate::say!("view: {missing}");
        }
        if !without_truth.is_empty() {
            crate::say!(
                "view: the source knows no truth: what the layout has for it stays empty ({})",
                without_truth.join(", ")
            );
        }
    }
    Ok(match missing.is_empty() {
        true => Outcome::Done,
        false => Outcome::Lost,
    })
}
