//! Two recordings of one scan in a picture.

use image::ExtendedColorType;
use messages::record::{Colours, Span};
use messages::{Kind, Owned, Point, Points, Size, Topic};

use super::Cells;
use crate::export::pictures::Picture;
use crate::{ExportError, Recording};

/// Pixels between pictures side by side.
const GAP: usize = 4;

/// What points of both are painted in, in the picture of what differs.
const IN_BOTH: [u8; 3] = [90, 90, 90];
const MOVED: [u8; 3] = [255, 210, 0];
const ONLY_A: [u8; 3] = [255, 60, 50];
const ONLY_B: [u8; 3] = [70, 150, 255];

/// A picture of a scan in both, by its number in each, side by side, the disparities in one range of colours; right of them what differs: gray what
/// is in both, yellow what moved, red what only the first has and blue what only the second has.
///
/// # Errors
/// When one cannot be read, or the picture not written.
pub fn side_by_side(
    [a, b]: [&mut Recording; 2],
    scans: [u64; 2],
    within: f32,
    path: &std::path::Path,
) -> Result<(), ExportError> {
    let topic =
        |recording: &Recording| Topic::of(&recording.metadata().rig, Kind::Points).swap_remove(0);
    let (topic_a, topic_b) = (topic(a), topic(b));
    let of_a: Owned<Points> = a.read(scans[0], &topic_a)?;
    let of_b: Owned<Points> = b.read(scans[1], &topic_b)?;
    let size = of_a.header.size();
    let [of_a, of_b] = [of_a.view().points, of_b.view().points];
    let span = Span::of(of_a.iter().chain(of_b).map(|point| point.disparity)).map(Span::rounded);
    let colours = Colours::new();
    let (width, height) = (size.width as usize, size.height as usize);
    let whole = Size::new((3 * width + 2 * GAP) as u32, height as u32);
    let mut bytes = vec![24u8; 3 * whole.pixels()];
    // So many pixels around a point are painted.
    let mut paint = |panel: usize, point: &Point, reach: isize, colour: [u8; 3]| {
        let (x, y) = (point.u.round() as isize, point.v.round() as isize);
        for (x, y) in
            (y - reach..=y + reach).flat_map(|y| (x - reach..=x + reach).map(move |x| (x, y)))
        {
            if (0..width as isize).contains(&x) && (0..height as isize).contains(&y) {
                let column = panel * (width + GAP) + x as usize;
                let at = 3 * (y as usize * whole.width as usize + column);
                bytes[at..at + 3].copy_from_slice(&colour);
            }
        }
    };
    let mut differing = Vec::new();
    let [mut cells_a, mut cells_b] = [Cells::default(), Cells::default()];
    cells_a.fill(size, of_a);
    cells_b.fill(size, of_b);
    for (panel, own, cells, others, alone) in [
        (0, of_a, &cells_b, of_b, ONLY_A),
        (1, of_b, &cells_a, of_a, ONLY_B),
    ] {
        for point in own {
            let share = span.map_or(0.5, |span| span.share(point.disparity));
            paint(panel, point, 0, colours.of(share));
            match cells.nearest(others, point) {
                Some(other) if (other.disparity - point.disparity).abs() <= within => {
                    paint(2, point, 0, IN_BOTH);
                }
                Some(_) => differing.push((point, MOVED)),
                None => differing.push((point, alone)),
            }
        }
    }
    // Few among many are to be seen.
    for (point, colour) in differing {
        paint(2, point, 1, colour);
    }
    let picture = Picture {
        size: whole,
        colours: ExtendedColorType::Rgb8,
        bytes,
    };
    picture.save(path)
}
