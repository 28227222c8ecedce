//! Writes what the rendered scenes show, for people to look at.
//!
//! `cargo run --release -p capture --example render -- FOLDER [NOISE [SOURCE]]` writes per scene and position the picture, the
//! true disparity (bright is near) and, in black, what not all three views see; and of the thesis's photographs the true
//! contours, a line a point.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use capture::{Settings, Source};
use image::ColorType;
use messages::{Contour, Image, Owned};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments
        .next()
        .ok_or("which folder shall the pictures go to?")?;
    let noise = arguments.next().map_or(Ok(1.0), |noise| noise.parse())?;
    let mut settings = Settings {
        noise,
        ..Settings::default()
    };
    if let Some(source) = arguments.next() {
        settings.source = source;
    }
    let mut source = Source::open(&settings)?;
    let size = source.size();
    let save = |name: String, pixels: &[u8]| {
        image::save_buffer(
            Path::new(&folder).join(name),
            pixels,
            size.width,
            size.height,
            ColorType::L8,
        )
    };
    let mut image = Owned::<Image>::new(size);
    for scan in 0..source.scenes() {
        let (mut least, mut most) = (f32::MAX, f32::MIN);
        let start = Instant::now();
        for view in 0..source.view_count() {
            image.fill(|room| source.read(scan, view, room))?;
            save(
                format!("{}{view}.png", source.name(scan)),
                image.view().pixels,
            )?;
        }
        let elapsed = start.elapsed();
        for view in 0..source.view_count() {
            let Some(truth) = source.truth(scan, view)? else {
                continue;
            };
            for &disparity in &truth.disparity {
                (least, most) = (least.min(disparity), most.max(disparity));
            }
            let bright: Vec<u8> = truth.disparity.iter().map(|d| (d * 6.0) as u8).collect();
            save(
                format!("{}{view}_disparity.png", source.name(scan)),
                &bright,
            )?;
            let visible: Vec<u8> = truth
                .visible
                .iter()
                .map(|&v| if v { 255 } else { 0 })
                .collect();
            save(format!("{}{view}_visible.png", source.name(scan)), &visible)?;
            if let Some(contours) = source.contours(scan, view) {
                let name = format!("{}{view}_contours.csv", source.name(scan));
                std::fs::write(Path::new(&folder).join(name), table(&contours))?;
            }
        }
        let name = source.name(scan);
        eprintln!(
            "{name}: {elapsed:.0?} for {} views, disparities {least:.1} to {most:.1}",
            source.view_count()
        );
    }
    Ok(())
}

/// Contours as comma-separated values.
fn table(contours: &[Contour]) -> String {
    let mut text = "contour,kind,x,y,disparity,contrast,seen\n".to_owned();
    for (number, contour) in contours.iter().enumerate() {
        for point in &contour.points {
            let (kind, seen) = (contour.kind, point.seen);
            let (x, y, disparity, contrast) = (point.x, point.y, point.disparity, point.contrast);
            writeln!(
                text,
                "{number},{kind:?},{x:.3},{y:.3},{disparity:.3},{contrast:.1},{seen}"
            )
            .unwrap_or_default();
        }
    }
    text
}
