//! Cameras through Video4Linux: the few requests of the kernel that reading frames takes.
//!
//! ```text
//! open ─► capability, formats ─► format ─► buffers, mapped ─► on ─► (wait ─► take ─► give back)* ─► off
//! ```
#![allow(
    unsafe_code,
    reason = "the kernel is asked by the address of a structure, and shares its buffers as memory"
)]

use std::ffi::c_void;
use std::fs::{File, OpenOptions};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::sync::OnceLock;

use messages::Size;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::io::Errno;
use rustix::ioctl::{Opcode, Setter, Updater, ioctl, opcode};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::time::{ClockId, clock_gettime};

use super::feed::{Camera, Next};
use super::gray::{Layout, Picture};

/// The formats that are read, the ones that cost least first: the kernel's four letters, and how pixels lie.
const FORMATS: [([u8; 4], Layout); 8] = [
    (*b"GREY", Layout::Gray),
    (*b"Y10 ", Layout::Deep(10)),
    (*b"Y12 ", Layout::Deep(12)),
    (*b"Y16 ", Layout::Deep(16)),
    (*b"YUYV", Layout::Yuyv),
    (*b"UYVY", Layout::Uyvy),
    (*b"RGB3", Layout::Rgb),
    (*b"BGR3", Layout::Bgr),
];

/// Frames the camera may write while one is read.
const BUFFERS: u32 = 4;
/// How long to wait for a frame before it is looked whether anybody still wants one.
const MOMENT: Timespec = Timespec {
    tv_sec: 0,
    tv_nsec: 100_000_000,
};

/// Video that is taken in, in buffers that the kernel shares.
const CAPTURE: u32 = 1;
const SHARED: u32 = 1;
const CAN_CAPTURE: u32 = 1;
const CAN_STREAM: u32 = 0x0400_0000;
const HAS_DEVICE_CAPABILITIES: u32 = 0x8000_0000;
const IS_DAMAGED: u32 = 0x40;
const CLOCK: u32 = 0xe000;
const CLOCK_IS_MONOTONIC: u32 = 0x2000;

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct Capability {
    driver: [u8; 16],
    card: [[u8; 16]; 2],
    bus: [[u8; 16]; 2],
    version: u32,
    all: u32,
    device: u32,
    reserved: [u32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct Offer {
    index: u32,
    kind: u32,
    flags: u32,
    description: [[u8; 16]; 2],
    letters: [u8; 4],
    code: u32,
    reserved: [u32; 3],
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Format {
    kind: u32,
    // The rest holds addresses in other uses, and lies where they may.
    gap: u32,
    width: u32,
    height: u32,
    letters: [u8; 4],
    field: u32,
    stride: u32,
    bytes: u32,
    rest: [u32; 44],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct Wanted {
    count: u32,
    kind: u32,
    memory: u32,
    capabilities: u32,
    flags: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct Buffer {
    index: u32,
    kind: u32,
    used: u32,
    flags: u32,
    field: u32,
    gap: u32,
    seconds: i64,
    microseconds: i64,
    timecode: [u32; 4],
    sequence: u32,
    memory: u32,
    /// Where it is to be mapped from, in the lower half.
    place: u64,
    length: u32,
    reserved: [u32; 3],
}

const QUERY_CAPABILITY: Opcode = opcode::read::<Capability>(b'V', 0);
const NEXT_FORMAT: Opcode = opcode::read_write::<Offer>(b'V', 2);
const GET_FORMAT: Opcode = opcode::read_write::<Format>(b'V', 4);
const SET_FORMAT: Opcode = opcode::read_write::<Format>(b'V', 5);
const REQUEST_BUFFERS: Opcode = opcode::read_write::<Wanted>(b'V', 8);
const QUERY_BUFFER: Opcode = opcode::read_write::<Buffer>(b'V', 9);
const GIVE_BUFFER: Opcode = opcode::read_write::<Buffer>(b'V', 15);
const TAKE_BUFFER: Opcode = opcode::read_write::<Buffer>(b'V', 17);
const ON: Opcode = opcode::write::<u32>(b'V', 18);
const OFF: Opcode = opcode::write::<u32>(b'V', 19);

/// Asks the kernel: it reads the structure and writes into it.
fn ask<const WHAT: Opcode, T>(device: BorrowedFd<'_>, value: &mut T) -> Result<(), Errno> {
    // SAFETY: each request is made with the structure it is defined for, whose size is part of its number (tested), and
    // of which every bit pattern is valid.
    unsafe { ioctl(device, Updater::<WHAT, T>::new(value)) }
}

/// Switches the stream on or off.
fn switch<const WHAT: Opcode>(device: BorrowedFd<'_>) -> Result<(), Errno> {
    // SAFETY: both requests take the kind of stream as a number.
    unsafe { ioctl(device, Setter::<WHAT, u32>::new(CAPTURE)) }
}

/// A buffer that the kernel shares.
struct Mapped {
    start: *mut c_void,
    length: usize,
}

impl Mapped {
    fn new(device: BorrowedFd<'_>, buffer: &Buffer) -> Result<Self, Errno> {
        let (length, place) = (buffer.length as usize, buffer.place & 0xffff_ffff);
        let flags = MapFlags::SHARED;
        // SAFETY: a new mapping, at an address that the kernel chooses.
        let start = unsafe {
            mmap(
                std::ptr::null_mut(),
                length,
                ProtFlags::READ,
                flags,
                device,
                place,
            )
        }?;
        Ok(Self { start, length })
    }

    fn bytes(&self) -> &[u8] {
        // SAFETY: so many bytes are mapped as long as this lives, and the camera writes none of them between taking the
        // buffer from it and giving it back, which is when they are read.
        unsafe { std::slice::from_raw_parts(self.start.cast::<u8>(), self.length) }
    }
}

impl Drop for Mapped {
    fn drop(&mut self) {
        // SAFETY: it was mapped with this length, and nothing refers to it any more.
        unsafe { munmap(self.start, self.length) }.unwrap_or_default();
    }
}

/// Opens a device; its frames have the size that it is set to, or this one.
///
/// # Errors
/// What the kernel says, or what the device sends that is not read.
pub(crate) fn open(device: &str, size: Option<Size>) -> Result<Box<dyn Camera>, String> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(OFlags::NONBLOCK.bits() as i32)
        .open(device)
        .map_err(|error| format!("it cannot be opened: {error}"))?;
    let fd = file.as_fd();
    let cannot = |what: &'static str| move |error: Errno| format!("it cannot {what}: {error}");
    let mut capability = Capability::default();
    ask::<QUERY_CAPABILITY, _>(fd, &mut capability)
        .map_err(|error| format!("it is no video device: {error}"))?;
    let can = match capability.all & HAS_DEVICE_CAPABILITIES {
        0 => capability.all,
        _ => capability.device,
    };
    if can & CAN_CAPTURE == 0 || can & CAN_STREAM == 0 {
        return Err("it is no camera: it takes no video in, or does not stream it".to_owned());
    }
    let (letters, layout) = choose(&offers(fd))?;
    let mut format = Format {
        kind: CAPTURE,
        gap: 0,
        width: 0,
        height: 0,
        letters: [0; 4],
        field: 0,
        stride: 0,
        bytes: 0,
        rest: [0; 44],
    };
    ask::<GET_FORMAT, _>(fd, &mut format).map_err(cannot("say its format"))?;
    format.letters = letters;
    (format.stride, format.bytes) = (0, 0);
    if let Some(size) = size {
        (format.width, format.height) = (size.width, size.height);
    }
    ask::<SET_FORMAT, _>(fd, &mut format).map_err(cannot("be set to its format"))?;
    let given = Size::new(format.width, format.height);
    if format.letters != letters || size.is_some_and(|size| size != given) {
        let (text, wanted) = (in_words(format.letters), size.unwrap_or(given));
        return Err(format!(
            "it was asked for {wanted} and gives {given}, {text}"
        ));
    }
    let mut wanted = Wanted {
        count: BUFFERS,
        kind: CAPTURE,
        memory: SHARED,
        ..Wanted::default()
    };
    ask::<REQUEST_BUFFERS, _>(fd, &mut wanted).map_err(cannot("share its buffers"))?;
    let mut buffers = Vec::new();
    for index in 0..wanted.count {
        let mut buffer = empty(index);
        ask::<QUERY_BUFFER, _>(fd, &mut buffer).map_err(cannot("share its buffers"))?;
        buffers.push(Mapped::new(fd, &buffer).map_err(cannot("share its buffers"))?);
        ask::<GIVE_BUFFER, _>(fd, &mut buffer).map_err(cannot("take its buffers"))?;
    }
    switch::<ON>(fd).map_err(cannot("begin"))?;
    Ok(Box::new(Device {
        buffers,
        size: given,
        layout,
        stride: format.stride as usize,
        last: None,
        lost: 0,
        file,
    }))
}

fn empty(index: u32) -> Buffer {
    Buffer {
        index,
        kind: CAPTURE,
        memory: SHARED,
        ..Buffer::default()
    }
}

/// The formats that a device offers.
fn offers(device: BorrowedFd<'_>) -> Vec<[u8; 4]> {
    let offer = |index| {
        let mut offer = Offer {
            index,
            kind: CAPTURE,
            ..Offer::default()
        };
        let asked = ask::<NEXT_FORMAT, _>(device, &mut offer);
        asked.is_ok().then_some(offer.letters)
    };
    (0..64).map_while(offer).collect()
}

/// The format to be read among those that are offered.
fn choose(offers: &[[u8; 4]]) -> Result<([u8; 4], Layout), String> {
    let read = FORMATS
        .into_iter()
        .find(|(letters, _)| offers.contains(letters));
    read.ok_or_else(|| {
        let texts = |all: &mut dyn Iterator<Item = [u8; 4]>| {
            let all: Vec<String> = all.map(in_words).collect();
            all.join(", ")
        };
        let offered = texts(&mut offers.iter().copied());
        let known = texts(&mut FORMATS.into_iter().map(|(letters, _)| letters));
        format!("it offers {offered}, and {known} are read; others are by way of camera:gstreamer")
    })
}

fn in_words(letters: [u8; 4]) -> String {
    String::from_utf8_lossy(&letters).trim().to_owned()
}

struct Device {
    buffers: Vec<Mapped>,
    size: Size,
    layout: Layout,
    stride: usize,
    /// The number of its last frame.
    last: Option<u32>,
    lost: u64,
    file: File,
}

impl Drop for Device {
    fn drop(&mut self) {
        // A device that is gone is off.
        switch::<OFF>(self.file.as_fd()).unwrap_or_default();
    }
}

impl Camera for Device {
    fn next(&mut self, take: &mut dyn FnMut(Picture<'_>)) -> Result<Next, String> {
        let fd = self.file.as_fd();
        let gone = |error: Errno| format!("it gives no frame: {error}");
        let mut waiting = [PollFd::new(&fd, PollFlags::IN)];
        match poll(&mut waiting, Some(&MOMENT)) {
            Ok(0) | Err(Errno::INTR) => return Ok(Next::Nothing),
            Ok(_) => {}
            Err(error) => return Err(gone(error)),
        }
        let mut buffer = empty(0);
        match ask::<TAKE_BUFFER, _>(fd, &mut buffer) {
            Ok(()) => {}
            Err(Errno::AGAIN) => return Ok(Next::Nothing),
            Err(error) => return Err(gone(error)),
        }
        let expected = self.last.map(|last| last.wrapping_add(1));
        let skipped = expected.map_or(0, |expected| buffer.sequence.wrapping_sub(expected));
        // One that counts from the beginning again has lost nothing that is known.
        self.lost += u64::from(skipped).min(1 << 20) * u64::from(skipped < 1 << 20);
        self.last = Some(buffer.sequence);
        let is_damaged = buffer.flags & IS_DAMAGED != 0;
        self.lost += u64::from(is_damaged);
        if let Some(mapped) = self.buffers.get(buffer.index as usize)
            && !is_damaged
        {
            let used = (buffer.used as usize).min(mapped.length);
            take(Picture {
                nanos: nanos_of(&buffer),
                position_m: f64::NAN,
                size: self.size,
                layout: self.layout,
                stride: self.stride,
                bytes: &mapped.bytes()[..used],
            });
        }
        ask::<GIVE_BUFFER, _>(fd, &mut buffer).map_err(gone)?;
        Ok(Next::Came)
    }

    fn lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }

    fn notice(&self) -> Option<String> {
        self.layout.notice()
    }
}

fn now(clock: ClockId) -> i64 {
    let now = clock_gettime(clock);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// When a frame was taken, in nanoseconds since 1970: the kernel's monotonic clock, set once for all cameras.
fn nanos_of(buffer: &Buffer) -> u64 {
    static OFFSET: OnceLock<i64> = OnceLock::new();
    let offset = OFFSET.get_or_init(|| now(ClockId::Realtime) - now(ClockId::Monotonic));
    let monotonic = match buffer.flags & CLOCK {
        CLOCK_IS_MONOTONIC => buffer.seconds * 1_000_000_000 + buffer.microseconds * 1000,
        _ => now(ClockId::Monotonic),
    };
    (monotonic + offset).max(0) as u64
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::{Settings, Source};

    #[test]
    fn requests_have_the_numbers_that_the_kernel_knows_them_by() {
        // As in the kernel's own headers; the size of each structure is part of its number.
        let numbers = [
            (QUERY_CAPABILITY, 0x8068_5600u32),
            (NEXT_FORMAT, 0xc040_5602),
            (GET_FORMAT, 0xc0d0_5604),
            (SET_FORMAT, 0xc0d0_5605),
            (REQUEST_BUFFERS, 0xc014_5608),
            (QUERY_BUFFER, 0xc058_5609),
            (GIVE_BUFFER, 0xc058_560f),
            (TAKE_BUFFER, 0xc058_5611),
            (ON, 0x4004_5612),
            (OFF, 0x4004_5613),
        ];
        for (ours, kernels) in numbers {
            assert_eq!(ours, kernels);
        }
        assert_eq!(std::mem::offset_of!(Buffer, seconds), 24);
        assert_eq!(std::mem::offset_of!(Buffer, place), 64);
        assert_eq!(std::mem::offset_of!(Format, width), 8);
    }

    #[test]
    fn the_format_that_costs_least_is_chosen_and_others_are_named() {
        let chosen = choose(&[*b"MJPG", *b"YUYV", *b"Y16 "]).unwrap();
        assert_eq!(chosen, (*b"Y16 ", Layout::Deep(16)));
        let refused = choose(&[*b"MJPG"]).unwrap_err();
        assert!(
            refused.starts_with("it offers MJPG, and GREY, Y10, "),
            "{refused}"
        );
    }

    #[test]
    fn a_device_that_is_missing_or_none_is_said_in_one_sentence() {
        for (device, words) in [
            (
                "/dev/video99",
                "it cannot be opened: No such file or directory",
            ),
            ("/dev/null", "it is no video device"),
        ] {
            let settings = Settings {
                source: "camera:v4l".to_owned(),
                cameras: vec![device.to_owned(); 3],
                ..Settings::default()
            };
            let error = Source::open(&settings).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("the camera left ({device}): ")),
                "{error}"
            );
            assert!(error.contains(words), "{error}");
        }
    }
}
