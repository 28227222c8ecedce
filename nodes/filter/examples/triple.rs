//! Times the filter on three views, for `benches/opencv.py`.
//!
//! ```text
//! triple FILE WIDTH HEIGHT CHANNELS ROUNDS [OUTPUT]
//! ```
//!
//! FILE holds three views of 8 bit gray, one after another without gaps; CHANNELS is σ² by σ², with commas between.
//! For every line on standard input prints the best of ROUNDS: milliseconds for the nine filtered images, and for the
//! nine lists of edges, and how many edges there are. OUTPUT receives the filtered images, view by view and channel by
//! channel, as 32 bit floats.
#![expect(clippy::print_stdout, reason = "an example talks to the terminal")]

use std::error::Error;
use std::io::{BufRead, Write};
use std::time::Instant;

use filter::{Filter, Settings};
use messages::{Edges, ImageView, Owned, Size};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, width, height, channels, rounds, output @ ..] = arguments.as_slice() else {
        return Err("triple FILE WIDTH HEIGHT CHANNELS ROUNDS [OUTPUT]".into());
    };
    let size = Size::new(width.parse()?, height.parse()?);
    let channels = channels
        .split(',')
        .map(str::parse)
        .collect::<Result<_, _>>()?;
    let rounds: usize = rounds.parse()?;
    let pixels = std::fs::read(file)?;
    let views: Vec<&[u8]> = pixels.chunks_exact(size.pixels()).take(3).collect();

    let mut filter = Filter::new(
        &Settings {
            channels,
            ..Settings::default()
        },
        size,
    );
    let mut room = Owned::<Edges>::new(size);
    if let [output] = output {
        let mut file = std::io::BufWriter::new(std::fs::File::create(output)?);
        for view in &views {
            filter.begin(ImageView { pixels: view }, size);
            for channel in 0..filter.channels() {
                for value in filter.filtered(channel).flatten() {
                    file.write_all(&value.to_le_bytes())?;
                }
            }
        }
    }

    for line in std::io::stdin().lock().lines() {
        line?;
        let filtered = best(rounds, || {
            for view in &views {
                filter.begin(ImageView { pixels: view }, size);
                for channel in 0..filter.channels() {
                    std::hint::black_box(filter.filtered(channel).last());
                }
            }
        });
        let mut found = 0;
        let edges = best(rounds, || {
            found = 0;
            for view in &views {
                filter.begin(ImageView { pixels: view }, size);
                for channel in 0..filter.channels() {
                    room.fill(|room| filter.edges(channel, room));
                    found += room.view().edges.len();
                }
            }
        });
        println!("{filtered:.3} {edges:.3} {found}");
    }
    Ok(())
}

/// The shortest of several runs, in milliseconds.
fn best(rounds: usize, mut run: impl FnMut()) -> f64 {
    let mut time = || {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..rounds).map(|_| time()).fold(f64::INFINITY, f64::min)
}
