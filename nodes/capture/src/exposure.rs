//! Whether pictures are exposed so that contours can be seen in them.
//!
//! ```text
//! pictures of a view ─► a sample of each ─► the first that is wrong: one sentence
//! ```
//!
//! Where a picture is cut off at white or drowns in black there is nothing to match, and nothing else says so.

use std::fmt;

/// The share of white pixels from which a view counts as saturated. A sheet of paper may fill a seventh of a good picture.
const MOST_WHITE: f32 = 0.2;

/// Pixels below this gray level are black …
const BLACK: u8 = 16;

/// … and a view of which this share is black shows next to nothing. A small bright part before a black ground is no fault.
const MOST_BLACK: f32 = 0.98;

/// Pixels that are looked at, about: a share is then right within 0.5 %, and 512x480 pixels cost 10 µs.
const SAMPLE: usize = 10_000;

/// What is wrong with a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// So great a share of it is white.
    Saturated(f32),
    /// So great a share of it is black.
    Dark(f32),
}

impl Fault {
    /// What is wrong with a picture of these gray levels, if anything is.
    fn of(pixels: &[u8]) -> Option<Self> {
        // An odd step meets all columns of a picture whose width is even.
        let step = (pixels.len() / SAMPLE).max(1) | 1;
        let (mut count, mut white, mut black) = (0, 0, 0);
        for &pixel in pixels.iter().step_by(step) {
            count += 1;
            white += u32::from(pixel == u8::MAX);
            black += u32::from(pixel < BLACK);
        }
        let share = |some: u32| some as f32 / count.max(1) as f32;
        if share(white) >= MOST_WHITE {
            Some(Self::Saturated(share(white)))
        } else if share(black) >= MOST_BLACK {
            Some(Self::Dark(share(black)))
        } else {
            None
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Saturated(share) => write!(
                f,
                "is saturated: {:.0} % of its pixels are at 255; lower its exposure or gain",
                100.0 * share
            ),
            Self::Dark(share) => write!(
                f,
                "is nearly black: {:.0} % of its pixels are below {BLACK} of 255; raise its exposure or gain, or, where 16 bits \
                 hold fewer, set capture.bits",
                100.0 * share
            ),
        }
    }
}

/// Looks at every picture of a run and speaks once a view.
#[derive(Clone, Debug)]
pub(crate) struct Exposure {
    patience: u32,
    views: Vec<Watched>,
}

#[derive(Clone, Debug)]
struct Watched {
    name: String,
    in_a_row: u32,
    is_told: bool,
}

impl Exposure {
    /// For views of these names, of which so many pictures in a row must be wrong.
    pub(crate) fn new(names: impl Iterator<Item = String>, patience: u32) -> Self {
        let watched = |name| Watched {
            name,
            in_a_row: 0,
            is_told: false,
        };
        Self {
            patience,
            views: names.map(watched).collect(),
        }
    }

    /// Looks at the next picture of a view: what is to be said of it, once.
    pub(crate) fn look(&mut self, view: usize, pixels: &[u8]) -> Option<String> {
        let watched = self
            .views
            .get_mut(view)
            .filter(|watched| !watched.is_told)?;
        let Some(fault) = Fault::of(pixels) else {
            watched.in_a_row = 0;
            return None;
        };
        watched.in_a_row += 1;
        watched.is_told = watched.in_a_row >= self.patience;
        watched.is_told.then(|| format!("{} {fault}", watched.name))
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    /// A picture of which this share, in a block, has one gray level, and the rest has all from 30 to 229.
    fn picture(share: f32, level: u8) -> Vec<u8> {
        const PIXELS: usize = 320 * 240;
        let block = (share * PIXELS as f32) as usize;
        let rest = (block..PIXELS).map(|i| 30 + (i * 7 % 200) as u8);
        std::iter::repeat_n(level, block).chain(rest).collect()
    }

    fn watch(patience: u32) -> Exposure {
        Exposure::new(["left", "centre"].into_iter().map(str::to_owned), patience)
    }

    #[test]
    fn a_view_that_is_cut_off_at_white_is_told_of_with_its_share_and_what_to_do() {
        assert_eq!(
            watch(1).look(1, &picture(0.31, 255)).unwrap(),
            "centre is saturated: 31 % of its pixels are at 255; lower its exposure or gain"
        );
    }

    #[test]
    fn a_view_that_is_nearly_black_is_told_of_with_its_share_and_what_to_do() {
        let said = watch(1).look(0, &picture(0.99, 15)).unwrap();
        assert!(
            said.starts_with("left is nearly black: 99 % of its pixels are below 16 of 255; raise"),
            "{said}"
        );
    }

    #[test]
    fn white_paper_and_black_ground_are_no_faults() {
        for (share, level) in [(0.15, 255), (0.9, 254), (0.95, 0), (1.0, 16), (0.0, 0)] {
            assert_eq!(
                watch(1).look(0, &picture(share, level)),
                None,
                "{share} at {level}"
            );
        }
        assert_eq!(watch(1).look(0, &[]), None);
    }

    #[test]
    fn every_view_is_told_of_once() {
        let mut watch = watch(1);
        let white = picture(0.5, 255);
        assert!(watch.look(0, &white).is_some());
        assert!(watch.look(1, &white).is_some());
        assert!((0..10).all(|scan| watch.look(scan % 2, &white).is_none()));
    }

    #[test]
    fn a_camera_that_finds_its_exposure_is_given_time() {
        let mut watch = watch(3);
        let (white, good) = (picture(0.5, 255), picture(0.0, 0));
        let looks = [&white, &white, &good, &white, &white, &white, &white];
        let told: Vec<bool> = looks
            .into_iter()
            .map(|picture| watch.look(0, picture).is_some())
            .collect();
        assert_eq!(told, [false, false, false, false, false, true, false]);
    }
}
