//! Publishes pictures of its own to a graph that waits for them, as a program of yours would publish its camera's:
//!
//! ```sh
//! tricurve run --source camera:bus --set capture.width=320 --set capture.height=240 --delivery live   # says its FOLDER
//! cargo run --example publish -- FOLDER
//! ```
//!
//! The program needs the crate `messages` only. What it writes lies in shared memory already; capture puts frames of the
//! views together by their times. A run with `--set capture.mode=rail --set capture.baseline=0.01` gets the frames of
//! one camera that moves, each with the place where it was taken.

use std::error::Error;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use messages::bus::FramesOut;

/// Pixels between neighbouring views.
const DISPARITY: usize = 6;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1);
    let folder = folder.ok_or("expected the folder that the run says it waits in")?;
    let folder = Path::new(&folder);
    let views = FramesOut::views(folder)?;
    let join = |view: &String| FramesOut::join(folder, view);
    let mut cameras = views.iter().map(join).collect::<Result<Vec<_>, _>>()?;
    if views == ["moving"] {
        return along_a_rail(folder, cameras.remove(0));
    }
    // Until the run is over and its folder gone.
    while folder.exists() {
        let nanos = SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos() as u64;
        for (view, camera) in cameras.iter_mut().enumerate() {
            let width = camera.size().width as usize;
            camera.send(nanos, |pixels| {
                for (index, pixel) in pixels.iter_mut().enumerate() {
                    *pixel = texture(index % width + DISPARITY * view, index / width);
                }
            })?;
        }
        std::thread::sleep(Duration::from_millis(33));
    }
    Ok(())
}

/// Ten millimetres to the right from frame to frame.
fn along_a_rail(folder: &Path, mut camera: FramesOut) -> Result<(), Box<dyn Error>> {
    let width = camera.size().width as usize;
    for frame in (0..).take_while(|_| folder.exists()) {
        let nanos = SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos() as u64;
        camera.send_at(nanos, 0.01 * frame as f64, |pixels| {
            for (index, pixel) in pixels.iter_mut().enumerate() {
                *pixel = texture(index % width + DISPARITY * frame, index / width);
            }
        })?;
        std::thread::sleep(Duration::from_millis(33));
    }
    Ok(())
}

/// Blotches of a dozen pixels, of random gray.
fn texture(x: usize, y: usize) -> u8 {
    let wave = |x: usize, y: usize| ((x as f64 * 0.31).sin() + (y as f64 * 0.23).cos()) * 40.0;
    let blotch = (x / 12).wrapping_mul(7919) ^ (y / 12).wrapping_mul(104_729);
    (128.0 + wave(x, y) + (blotch % 64) as f64 - 32.0) as u8
}
