//! What holds for every source, whatever its kind: the loop on a bus that follows a script, in a time that is made up.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use super::*;

const MS: u64 = 1_000_000;
/// When the first scan was taken.
const START: u64 = 1_700_000_000_000_000_000;
/// From one scan to the next.
const APART: Duration = Duration::from_millis(100);
/// Scans of a source.
const SCANS: u64 = 20;
/// Scans under way at most.
const WIDTH: usize = 4;
/// When a script ends that nothing ended before.
const LIMIT: Duration = Duration::from_secs(60);
/// How long the pipe works on a scan.
const WORK: Duration = Duration::from_millis(30);

/// What is seen of a run from outside.
#[derive(Clone, Debug, PartialEq)]
enum Told {
    Sent { sequence: u64, tick: u64 },
    Refused(String, u64),
    Held(u64),
    Playing(Playing),
    Said(String),
    Finished(Option<String>),
}

/// All that a source sees of the bus: what time it is, and where to send.
#[derive(Default)]
struct Desk {
    now: Cell<Duration>,
    told: RefCell<Vec<(Duration, Told)>>,
}

impl Desk {
    fn tell(&self, told: Told) {
        self.told.borrow_mut().push((self.now.get(), told));
    }
}

/// What comes of itself.
#[derive(Clone, Debug)]
enum News {
    Asked(Request),
    Done(u64),
    /// The inbox is rung.
    Ring,
}

/// A bus on which all happens at its time.
struct Script {
    began: Instant,
    desk: Desk,
    door: Door,
    coming: BTreeMap<(Duration, usize), News>,
    asked: Vec<Request>,
    done: Vec<u64>,
    /// How long a scan is under way; without that for ever.
    work: Option<Duration>,
    /// What was told when it was last looked at.
    seen: usize,
    scheduled: usize,
}

impl Script {
    fn new(work: Option<Duration>, asked: &[(u64, Request)]) -> Self {
        let mut script = Self {
            began: Instant::now(),
            desk: Desk::default(),
            door: Door::new(WIDTH),
            coming: BTreeMap::new(),
            asked: Vec::new(),
            done: Vec::new(),
            work,
            seen: 0,
            scheduled: 0,
        };
        for (millis, request) in asked {
            let at = Duration::from_millis(*millis);
            script.schedule(at, News::Asked(request.clone()));
        }
        for scan in 1..=2 * SCANS {
            script.schedule(APART * scan as u32, News::Ring);
        }
        script.schedule(LIMIT, News::Asked(Request::Stop(None)));
        script
    }

    fn schedule(&mut self, at: Duration, news: News) {
        self.scheduled += 1;
        self.coming.insert((at, self.scheduled), news);
    }

    /// What follows from what was told since.
    fn follow(&mut self) {
        let told: Vec<_> = self.desk.told.borrow()[self.seen..].to_vec();
        self.seen += told.len();
        for (at, told) in told {
            match (told, self.work) {
                (Told::Sent { sequence, .. }, Some(work)) => {
                    self.schedule(at + work, News::Done(sequence));
                }
                (Told::Finished(_), _) => {
                    let stop = News::Asked(Request::Stop(None));
                    self.schedule(at + Duration::from_secs(2), stop);
                }
                _ => {}
            }
        }
    }

    /// Takes in what has come by now.
    fn take_in(&mut self) -> bool {
        let mut any = false;
        while let Some(entry) = self.coming.first_entry() {
            if entry.key().0 > self.desk.now.get() {
                break;
            }
            any = true;
            match entry.remove() {
                News::Asked(request) => self.asked.push(request),
                News::Done(sequence) => self.done.push(sequence),
                News::Ring => {}
            }
        }
        any
    }
}

impl Line for Script {
    type Bus = Desk;

    fn bus(&self) -> &Desk {
        &self.desk
    }

    fn door(&self) -> &Door {
        &self.door
    }

    fn now(&self) -> Instant {
        self.began + self.desk.now.get()
    }

    fn ready(&mut self) -> Result<(), BusError> {
        Ok(())
    }

    fn request(&mut self, timeout: Duration) -> Result<Option<Request>, BusError> {
        self.follow();
        let any = self.take_in();
        if !any && self.asked.is_empty() && !timeout.is_zero() {
            let until = self.desk.now.get() + timeout;
            let next = self.coming.keys().next().map_or(until, |(at, _)| *at);
            self.desk.now.set(until.min(next));
            self.take_in();
        }
        Ok((!self.asked.is_empty()).then(|| self.asked.remove(0)))
    }

    fn hear_done(&mut self) -> Result<(), BusError> {
        for sequence in self.done.drain(..) {
            self.door.done(sequence);
        }
        Ok(())
    }

    fn admit(&mut self) -> UnderWay {
        self.door.admit()
    }

    fn refuse(&mut self, cause: &str, count: u64) {
        self.door.refuse(cause, count);
        self.desk.tell(Told::Refused(cause.to_owned(), count));
    }

    fn seek(&mut self, tick: u64) {
        self.door.seek(tick);
    }

    fn held(&self) {
        self.desk.tell(Told::Held(self.door.admitted()));
    }

    fn playing(&self, playing: Playing) {
        self.desk.tell(Told::Playing(playing));
    }

    fn log(&self, _: Level, text: String) {
        self.desk.tell(Told::Said(text));
    }

    fn finish(&self, failed: Option<&str>) {
        self.desk.tell(Told::Finished(failed.map(str::to_owned)));
    }
}

/// The kinds of source that there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// Images that are read as fast as they are done with.
    Files,
    /// Images that come as a camera would send them.
    LiveFiles,
    /// A recording in lockstep.
    Recording,
    /// A recording in its own time.
    RecordingInTime,
    /// Films: frames that come when they are decoded, and wait.
    Films,
    /// Cameras, which do not.
    Cameras,
}

const WAYS: [Way; 6] = [
    Way::Files,
    Way::LiveFiles,
    Way::Recording,
    Way::RecordingInTime,
    Way::Films,
    Way::Cameras,
];

impl Way {
    fn is_live(self) -> bool {
        matches!(self, Self::LiveFiles | Self::Cameras)
    }

    fn is_recording(self) -> bool {
        matches!(self, Self::Recording | Self::RecordingInTime)
    }

    /// Whether scans come when they come.
    fn comes(self) -> bool {
        matches!(self, Self::Films | Self::Cameras)
    }

    fn drive(self) -> Drive {
        let is_in_time = matches!(self, Self::LiveFiles | Self::RecordingInTime);
        Drive {
            scans: Some(SCANS),
            delivery: match self.is_live() {
                true => Delivery::Live,
                false => Delivery::Lossless,
            },
            rate: is_in_time.then_some(1.0),
            span: self
                .is_recording()
                .then_some((START, START + (SCANS - 1) * 100 * MS)),
            ..Drive::default()
        }
    }
}

/// A source of any kind.
struct Fake {
    way: Way,
    /// What cannot be read, and whether all after it cannot either.
    bad: Option<(u64, bool)>,
    /// How many scans there are, which nobody was told before.
    end: Option<u64>,
    /// By how much the scans from the tenth on were taken later.
    jump: u64,
    passed: u64,
    came_out: u64,
    finished: u64,
    /// Whether it was at rest when it looked last, and how often it was not.
    rests: bool,
    active: u64,
}

impl Fake {
    fn new(way: Way) -> Self {
        Self {
            way,
            bad: None,
            end: None,
            jump: 0,
            passed: 0,
            came_out: 0,
            finished: 0,
            rests: false,
            active: 0,
        }
    }
}

impl Driven<Desk> for Fake {
    type Scan = u64;
    type Error = BusError;

    fn nanos(&self, tick: u64) -> Option<u64> {
        let late = if tick >= 10 { self.jump } else { 0 };
        (!self.way.comes()).then(|| START + tick * 100 * MS + late)
    }

    fn ahead(&mut self, desk: &Desk, door: &Door) -> Result<Ahead, BusError> {
        let came = (desk.now.get().as_millis() / APART.as_millis()) as u64;
        let tick = door.next_tick();
        Ok(match self.bad {
            _ if self.way.comes() && came <= tick => Ahead::Nothing,
            Some((bad, true)) if self.way.comes() && bad == tick => {
                Ahead::Failed("it is broken".to_owned())
            }
            _ if self.end == Some(tick) => Ahead::End,
            _ => Ahead::Scan,
        })
    }

    fn read_scan(&mut self, _: &Desk, tick: u64) -> Result<Read<u64>, BusError> {
        Ok(match self.bad {
            Some((bad, false)) if bad == tick => Read::LeftOut("it is bad"),
            Some((bad, true)) if bad == tick => Read::Failed("it is broken".to_owned()),
            _ => Read::Scan(tick),
        })
    }

    fn read_again(&mut self, _: &Desk, tick: u64) -> Result<u64, BusError> {
        Ok(tick)
    }

    fn send_scan(
        &mut self,
        desk: &Desk,
        under_way: UnderWay,
        done_below: u64,
        scan: u64,
    ) -> Result<(), BusError> {
        let UnderWay { sequence, tick } = under_way;
        assert_eq!(tick, scan, "what is sent is what was read");
        assert!(done_below <= sequence, "{done_below} of {sequence}");
        desk.tell(Told::Sent { sequence, tick });
        Ok(())
    }

    fn pass_by(&mut self) -> Result<(), BusError> {
        self.passed += 1;
        Ok(())
    }

    fn came_out(&mut self, door: &Door) {
        self.came_out = door.done_count();
    }

    fn look(&mut self, _: &Desk, rests: bool) {
        self.rests = rests;
        self.active += u64::from(!rests);
    }

    fn finish(&mut self, _: &Desk) {
        self.finished += 1;
    }

    fn at_or_after(&self, nanos: u64) -> u64 {
        (0..SCANS - 1)
            .find(|&tick| self.nanos(tick).is_some_and(|taken| taken >= nanos))
            .unwrap_or(SCANS - 1)
    }
}

/// What came of a run.
struct Ran {
    way: Way,
    told: Vec<(Duration, Told)>,
    door: Door,
    source: Fake,
    now: Duration,
}

/// Runs a source to where it is told to stop.
#[track_caller]
fn run(drive: Drive, mut source: Fake, mut script: Script) -> Ran {
    let ended = drive.run_at(&mut script, &mut source);
    assert!(ended.is_ok(), "{ended:?}");
    Ran {
        way: source.way,
        told: script.desk.told.take(),
        door: script.door,
        source,
        now: script.desk.now.get(),
    }
}

/// A run in which this is asked, each at its millisecond.
fn asked(way: Way, asked: &[(u64, Request)]) -> Ran {
    run(way.drive(), Fake::new(way), Script::new(Some(WORK), asked))
}

impl Ran {
    /// Numbers and ticks of what was sent from this millisecond on and before that one.
    fn sent(&self, from: u64, until: u64) -> Vec<(u64, u64)> {
        let is_in = |at: &Duration| (from..until).contains(&(at.as_millis() as u64));
        let mut sent = Vec::new();
        for (_, told) in self.told.iter().filter(|(at, _)| is_in(at)) {
            if let Told::Sent { sequence, tick } = told {
                sent.push((*sequence, *tick));
            }
        }
        sent
    }

    fn all_sent(&self) -> Vec<(u64, u64)> {
        self.sent(0, u64::MAX)
    }

    fn refused(&self) -> u64 {
        self.door.refused().values().sum()
    }

    fn playing(&self) -> Vec<Playing> {
        let playing = |(_, told): &(Duration, Told)| match told {
            Told::Playing(playing) => Some(*playing),
            _ => None,
        };
        self.told.iter().filter_map(playing).collect()
    }

    fn finished(&self) -> Vec<(Duration, Option<String>)> {
        let finished = |(at, told): &(Duration, Told)| match told {
            Told::Finished(why) => Some((*at, why.clone())),
            _ => None,
        };
        self.told.iter().filter_map(finished).collect()
    }

    fn said(&self) -> Vec<&str> {
        let said = self.told.iter().filter_map(|(_, told)| match told {
            Told::Said(text) => Some(text.as_str()),
            _ => None,
        });
        said.collect()
    }

    /// Every scan of the source went in or was turned away, once and in order, and the run finished once, when all was done.
    #[track_caller]
    fn adds_up(&self) {
        let sent = self.all_sent();
        let numbers: Vec<u64> = sent.iter().map(|(sequence, _)| *sequence).collect();
        let expected: Vec<u64> = (0..numbers.len() as u64).collect();
        assert_eq!(numbers, expected, "{:?}", self.way);
        assert!(
            sent.is_sorted_by(|a, b| a.1 < b.1),
            "{:?}: {sent:?}",
            self.way
        );
        let all = sent.len() as u64 + self.refused();
        assert_eq!(all, self.door.next_tick(), "{:?}", self.way);
        self.is_finished(None);
    }

    #[track_caller]
    fn is_finished(&self, why: Option<&str>) {
        let finished = self.finished();
        assert_eq!(finished.len(), 1, "{:?}: {finished:?}", self.way);
        assert_eq!(finished[0].1.as_deref(), why, "{:?}", self.way);
        assert!(self.door.is_idle(), "{:?}", self.way);
        assert_eq!(self.source.finished, 1, "{:?}", self.way);
        assert_eq!(self.source.came_out, self.door.done_count());
    }
}

const HOLD: Request = Request::Hold;
const GO: Request = Request::Go;
const DRAIN: Request = Request::Drain;

fn play(play: Play) -> Request {
    Request::Play(play)
}

#[test]
fn every_scan_goes_in_once_and_in_order_and_the_run_finishes_when_the_last_is_done() {
    for way in WAYS {
        let ran = asked(way, &[]);
        ran.adds_up();
        assert_eq!((ran.door.admitted(), ran.refused()), (SCANS, 0), "{way:?}");
        let last = ran
            .told
            .iter()
            .rposition(|(_, told)| matches!(told, Told::Sent { .. }));
        let last = ran.told[last.unwrap_or_default()].0;
        assert_eq!(ran.finished()[0].0, last + WORK, "{way:?}");
    }
}

#[test]
fn scans_that_have_a_time_go_in_at_their_time_and_others_when_the_door_is_open() {
    for way in WAYS {
        let ran = asked(way, &[]);
        let in_a_second = ran.sent(0, 1000).len() as u64;
        let expected = match way {
            Way::Files | Way::Recording => SCANS,
            Way::LiveFiles | Way::RecordingInTime => 10,
            Way::Films | Way::Cameras => 9,
        };
        assert_eq!(in_a_second, expected, "{way:?}");
    }
}

#[test]
fn no_more_scans_are_under_way_than_the_door_is_wide_and_only_live_ones_are_turned_away() {
    for way in WAYS {
        let ran = run(way.drive(), Fake::new(way), Script::new(None, &[]));
        assert_eq!(ran.all_sent(), [(0, 0), (1, 1), (2, 2), (3, 3)], "{way:?}");
        let turned_away = if way.is_live() { SCANS - 4 } else { 0 };
        assert_eq!(ran.refused(), turned_away, "{way:?}");
        assert_eq!(ran.source.passed, turned_away, "{way:?}");
        let causes: Vec<&String> = ran.door.refused().keys().collect();
        assert!(causes.iter().all(|cause| *cause == CLOSED), "{causes:?}");
        // Nobody says that scans are done, so nothing is finished.
        assert_eq!((ran.finished(), ran.now), (Vec::new(), LIMIT), "{way:?}");
    }
}

#[test]
fn a_hold_is_answered_with_how_many_went_in_and_none_goes_in_until_it_ends() {
    for way in WAYS {
        let ran = asked(way, &[(45, HOLD), (1045, GO)]);
        let before = ran.sent(0, 45).len() as u64;
        let held = |(_, told): &(Duration, Told)| matches!(told, Told::Held(_));
        let held: Vec<_> = ran.told.iter().filter(|told| held(told)).collect();
        let expected = (Duration::from_millis(45), Told::Held(before));
        assert_eq!(held, [&expected], "{way:?}");
        assert_eq!(ran.sent(45, 1045), [], "{way:?}");
        // What came meanwhile waited for the end of it.
        let late = ran.sent(1045, 1046).len();
        assert!(late > 0, "{way:?}");
        ran.adds_up();
        if !way.is_live() {
            assert_eq!(ran.refused(), 0, "{way:?}");
        }
    }
}

#[test]
fn whoever_drains_gets_no_further_scan_and_is_finished_when_the_last_is_done() {
    for way in WAYS {
        let ran = asked(way, &[(250, DRAIN)]);
        assert_eq!(ran.sent(250, u64::MAX), [], "{way:?}");
        ran.is_finished(None);
        // At once, if nothing was under way any more.
        assert!(ran.finished()[0].0 <= Duration::from_millis(280), "{way:?}");
    }
    // Although the door is open and scans are there.
    let ran = asked(Way::Files, &[(0, DRAIN)]);
    assert_eq!(ran.all_sent(), []);
    ran.is_finished(None);
}

#[test]
fn a_stop_ends_the_loop_whatever_is_under_way() {
    for way in WAYS {
        let ran = asked(way, &[(110, Request::Stop(None))]);
        assert_eq!(ran.now, Duration::from_millis(110), "{way:?}");
        assert_eq!(ran.finished(), [], "{way:?}");
    }
}

#[test]
fn in_a_pause_no_scan_goes_in_and_only_cameras_go_on() {
    for way in WAYS {
        let (stop, resume) = (play(Play::Stop), play(Play::Resume));
        let ran = asked(way, &[(45, stop.clone()), (50, stop), (1045, resume)]);
        assert_eq!(ran.sent(45, 1045), [], "{way:?}");
        ran.adds_up();
        let is_paused: Vec<bool> = ran.playing().iter().map(|p| p.is_paused).collect();
        assert_eq!(is_paused, [false, true, true, false], "{way:?}");
        let went_by = if way == Way::Cameras { 10 } else { 0 };
        assert_eq!(ran.refused(), went_by, "{way:?}");
        let why = ran.door.refused().keys().next();
        assert_eq!(why.map(String::as_str), (went_by > 0).then_some(PAUSED));
        // What has a time of its own goes on from where it was: the second since did not pass.
        if matches!(way, Way::LiveFiles | Way::RecordingInTime) {
            assert_eq!(ran.sent(1045, 1245).len(), 2, "{way:?}");
        }
    }
}

#[test]
fn a_pause_is_the_same_as_a_stop_or_a_resume_whichever_it_is_time_for() {
    for way in WAYS {
        let ran = asked(way, &[(45, play(Play::Pause)), (1045, play(Play::Pause))]);
        assert_eq!(ran.sent(45, 1045), [], "{way:?}");
        let is_paused: Vec<bool> = ran.playing().iter().map(|p| p.is_paused).collect();
        assert_eq!(is_paused, [false, true, false], "{way:?}");
        ran.adds_up();
    }
}

#[test]
fn a_step_lets_one_scan_in_and_pauses() {
    for way in WAYS {
        let step = || play(Play::Step);
        let resume = play(Play::Resume);
        let ran = asked(
            way,
            &[(45, step()), (1045, step()), (1046, step()), (3045, resume)],
        );
        assert_eq!(ran.sent(45, 1045).len(), 1, "{way:?}");
        assert_eq!(ran.sent(1045, 3045).len(), 2, "{way:?}");
        assert!(ran.playing()[1..4].iter().all(|p| p.is_paused), "{way:?}");
        ran.adds_up();
    }
}

#[test]
fn a_scan_that_cannot_be_read_is_left_out_and_uses_up_no_step() {
    for way in WAYS {
        let step = [(0, play(Play::Step)), (2000, play(Play::Resume))];
        let source = Fake {
            bad: Some((0, false)),
            ..Fake::new(way)
        };
        let ran = run(way.drive(), source, Script::new(Some(WORK), &step));
        let first = ran.sent(0, 2000);
        assert_eq!(first.len(), 1, "{way:?}");
        assert!(first[0].1 > 0, "{way:?}");
        assert_eq!(ran.door.refused().get("it is bad"), Some(&1), "{way:?}");
        ran.adds_up();
    }
}

#[test]
fn a_source_that_fails_says_why_when_what_went_in_is_done() {
    for way in WAYS {
        let source = Fake {
            bad: Some((7, true)),
            ..Fake::new(way)
        };
        let ran = run(way.drive(), source, Script::new(Some(WORK), &[]));
        let ticks: Vec<u64> = ran.all_sent().iter().map(|(_, tick)| *tick).collect();
        assert_eq!(ticks, [0, 1, 2, 3, 4, 5, 6], "{way:?}");
        ran.is_finished(Some("it is broken"));
    }
}

#[test]
fn what_is_under_way_is_sent_once_more_in_order_whenever_that_is_asked() {
    for way in WAYS {
        for pause in [None, Some(HOLD), Some(play(Play::Stop))] {
            let mut asked: Vec<(u64, Request)> =
                pause.map(|pause| (4000, pause)).into_iter().collect();
            asked.push((5000, Request::Resend));
            let ran = run(way.drive(), Fake::new(way), Script::new(None, &asked));
            let four = [(0, 0), (1, 1), (2, 2), (3, 3)];
            assert_eq!(ran.sent(0, 5000), four, "{way:?}");
            assert_eq!(ran.sent(5000, u64::MAX), four, "{way:?}");
        }
    }
}

#[test]
fn a_successor_sends_what_was_under_way_and_goes_on_behind_it() {
    for way in WAYS {
        let mut script = Script::new(Some(WORK), &[(0, Request::Resend)]);
        let under_way = [(5, 6), (7, 8)].map(|(sequence, tick)| UnderWay { sequence, tick });
        let refused = [("the door was closed".to_owned(), 1)].into();
        script.door = Door::resume(WIDTH, [], under_way, 8, 9, refused);
        script.desk.now.set(Duration::from_secs(1));
        let ran = run(way.drive(), Fake::new(way), script);
        let sent = ran.all_sent();
        assert_eq!(sent[..3], [(5, 6), (7, 8), (8, 9)], "{way:?}");
        assert_eq!(ran.door.admitted() + ran.refused(), SCANS, "{way:?}");
        ran.is_finished(None);
    }
}

#[test]
fn a_source_without_a_known_number_of_scans_ends_when_it_says_so() {
    for ends_well in [true, false] {
        let drive = Drive {
            scans: None,
            ..Way::Films.drive()
        };
        let source = Fake {
            bad: (!ends_well).then_some((12, true)),
            end: Some(12),
            ..Fake::new(Way::Films)
        };
        let ran = run(drive, source, Script::new(Some(WORK), &[]));
        assert_eq!(ran.all_sent().len(), 12);
        ran.is_finished((!ends_well).then_some("it is broken"));
        assert!(ran.source.rests);
    }
}

#[test]
fn a_source_rests_while_it_is_held_or_paused_and_when_it_is_over() {
    for way in WAYS {
        for request in [HOLD, play(Play::Stop), DRAIN] {
            let ran = asked(way, &[(0, request)]);
            assert_eq!((ran.source.active, ran.source.rests), (0, true), "{way:?}");
        }
        let ran = asked(way, &[]);
        assert!(ran.source.active > 0 && ran.source.rests, "{way:?}");
    }
}

#[test]
fn only_a_recording_is_played_at_a_rate_and_sought_in_and_every_request_is_answered_once() {
    let seek = Play::Seek(START + 1500 * MS);
    for way in WAYS {
        let asked_for = [(0, play(Play::Rate(4.0))), (145, play(seek))];
        let ran = asked(way, &asked_for);
        let playing = ran.playing();
        assert_eq!(playing.len(), 3, "{way:?}");
        assert_eq!(playing[0].is_recording, way.is_recording(), "{way:?}");
        let last = playing[2];
        if way.is_recording() {
            // At four times the rate a scan goes in every 25 ms: six of them before the seek.
            assert_eq!(ran.sent(0, 145).len(), 6, "{way:?}");
            assert_eq!(ran.sent(145, 146), [(6, 15)], "{way:?}");
            assert_eq!((last.rate, last.sought_from), (Some(4.0), Some(6)));
            assert_eq!(last.next_nanos, Some(START + 1500 * MS));
            assert_eq!(ran.all_sent().len(), 11, "{way:?}");
            ran.is_finished(None);
        } else {
            assert_eq!(last, Playing::default(), "{way:?}");
            ran.adds_up();
            assert_eq!(ran.refused(), 0, "{way:?}");
        }
    }
}

#[test]
fn what_repeats_begins_again_says_so_and_ends_when_it_is_told_to() {
    for way in [Way::Recording, Way::RecordingInTime] {
        let drive = Drive {
            repeats: true,
            ..way.drive()
        };
        let drain = [(4500, DRAIN)];
        let ran = run(drive, Fake::new(way), Script::new(Some(WORK), &drain));
        ran.adds_up();
        assert!(ran.all_sent().len() as u64 > 2 * SCANS, "{way:?}");
        let begins = "begins again: scans are numbered on from";
        assert_eq!(
            ran.said()[..2],
            [20, 40].map(|from| format!("{begins} {from}"))
        );
    }
}

#[test]
fn a_jump_of_the_time_is_not_waited_for_and_said_where_time_matters() {
    for way in WAYS {
        let source = Fake {
            jump: 10_000 * 1000 * MS,
            ..Fake::new(way)
        };
        let ran = run(way.drive(), source, Script::new(Some(WORK), &[]));
        ran.adds_up();
        assert_eq!(ran.all_sent().len() as u64, SCANS, "{way:?}");
        let is_in_time = way.drive().rate.is_some();
        let said = "recorded time jumps by 10000 s here, which is not waited for";
        let expected: &[&str] = if is_in_time { &[said] } else { &[] };
        assert_eq!(ran.said(), expected, "{way:?}");
    }
}

#[test]
fn what_begins_with_a_pause_waits_to_be_played() {
    for way in WAYS {
        let drive = Drive {
            is_paused: true,
            ..way.drive()
        };
        let resume = [(2000, play(Play::Resume))];
        let ran = run(drive, Fake::new(way), Script::new(Some(WORK), &resume));
        assert!(ran.playing()[0].is_paused, "{way:?}");
        assert_eq!(ran.sent(0, 2000), [], "{way:?}");
        ran.adds_up();
    }
}
