//! Frames that another program publishes on the bus.

use messages::bus::{FramesIn, Run};

use super::feed::{Camera, Next, Open};
use super::gray::{Layout, Picture};

/// What hears the frames of a view.
pub(crate) fn opener(run: Run, view: usize) -> Open {
    Box::new(move || {
        let heard = FramesIn::listen(&run, view).map_err(|error| error.to_string())?;
        Ok(Box::new(Heard {
            heard,
            next: None,
            lost: 0,
        }))
    })
}

struct Heard {
    heard: FramesIn,
    /// The number of the frame that should come next.
    next: Option<u64>,
    lost: u64,
}

impl Camera for Heard {
    fn next(&mut self, take: &mut dyn FnMut(Picture<'_>)) -> Result<Next, String> {
        let frame = self.heard.wait().map_err(|error| error.to_string())?;
        let Some(frame) = frame else {
            return Ok(Next::Nothing);
        };
        let (header, pixels) = (frame.header(), frame.pixels());
        // A number below what was expected is a program that has just begun.
        let expected = self.next.filter(|&next| next <= header.sequence);
        self.lost += expected.map_or(0, |expected| header.sequence - expected);
        self.next = Some(header.sequence + 1);
        take(Picture {
            nanos: header.capture_nanos,
            position_m: header.position_m,
            size: header.size(),
            layout: Layout::Gray,
            stride: header.width as usize,
            bytes: pixels,
        });
        Ok(Next::Came)
    }

    fn lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }
}
