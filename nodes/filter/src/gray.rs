//! The view as taken, and the same steadied for the gray levels beside its edges.

use messages::Size;
use messages::profile::Steady;

use crate::smooth::TOGETHER;

/// The view, its only copy here, and the same steadied for profiles.
#[derive(Debug)]
pub(crate) struct Gray {
    size: Size,
    /// Row by row without gaps, and a few pixels behind the last row for those who look at several at a time.
    raw: Vec<u8>,
    steady: Steady,
}

impl Gray {
    /// Room for views up to `max`.
    pub(crate) fn new(max: Size) -> Self {
        Self {
            size: Size::default(),
            raw: Vec::with_capacity(max.pixels() + TOGETHER),
            steady: Steady::new(max),
        }
    }

    /// Takes a view.
    pub(crate) fn read(&mut self, pixels: &[u8], size: Size) {
        self.size = size;
        self.raw.clear();
        self.raw.extend_from_slice(pixels);
        self.raw.resize(pixels.len() + TOGETHER, 0);
    }

    /// Steadies the view.
    pub(crate) fn steady(&mut self) {
        self.steady.take(&self.raw, self.size);
    }

    /// The view, row by row without gaps, and behind it [`TOGETHER`] more pixels that mean nothing.
    pub(crate) fn pixels(&self) -> &[u8] {
        &self.raw
    }

    /// The steadied rows from `y` on, as [`Steady::from`] gives them.
    pub(crate) fn steady_from(&self, y: usize) -> (&[u8], usize) {
        self.steady.from(y)
    }
}
