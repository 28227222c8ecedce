//! Draws the curves of a picture, each in a colour of its own, to be looked at.
//!
//! ```text
//! cargo run --release -p track --no-default-features --example draw -- view1.png curves.png [channel [zoom]]
//! ```
#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a tool for people"
)]

use filter::Filter;
use image::{Rgb, RgbImage};
use messages::{Curves, Edges, Owned, Size};
use track::Tracker;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let picture = image::open(&arguments[0]).unwrap().to_luma8();
    let number = |i: usize| arguments.get(i).map(|text| text.parse::<f32>().unwrap());
    let variance = number(2).unwrap_or(1.5);
    let zoom = number(3).unwrap_or(2.0);
    let size = Size::new(picture.width(), picture.height());

    let settings = filter::Settings {
        channels: vec![variance],
        ..filter::Settings::default()
    };
    let mut filter = Filter::new(&settings, size);
    filter.begin(
        messages::ImageView {
            pixels: picture.as_raw(),
        },
        size,
    );
    let mut edges = Owned::<Edges>::new(size);
    edges.fill(|room| filter.edges(0, room));

    let mut tracker = Tracker::new(&track::Settings::default(), size);
    let mut curves = Owned::<Curves>::new(size);
    let tracked = curves.fill(|room| tracker.process(edges.view(), size, room));
    let view = curves.view();
    let of = edges.view().edges.len();
    println!(
        "{tracked:?}: {} curves, {} of {of} edges",
        view.curves.len(),
        view.points.len()
    );

    let canvas = |len: u32| (len as f32 * zoom) as u32;
    let mut out = RgbImage::from_fn(canvas(size.width), canvas(size.height), |x, y| {
        let at = |place: u32, len: u32| ((place as f32 / zoom) as u32).min(len - 1);
        let gray = picture.get_pixel(at(x, size.width), at(y, size.height)).0[0];
        Rgb([gray / 2 + 96; 3])
    });
    let mut dot = |x: f32, y: f32, colour| {
        let (x, y) = (((x + 0.5) * zoom) as u32, ((y + 0.5) * zoom) as u32);
        if x < out.width() && y < out.height() {
            out.put_pixel(x, y, colour);
        }
    };
    for edge in edges.view().edges {
        dot(edge.x, edge.y, Rgb([255; 3]));
    }
    for curve in view.curves {
        // Neighbouring labels far apart on the colour wheel.
        let hue = curve.label as f32 * 2.4;
        let part = |shift: f32| (110.0 + 110.0 * (hue + shift).sin()) as u8;
        let colour = Rgb([part(0.0), part(2.1), part(4.2)]);
        for pair in curve.points(view.points).windows(2) {
            for step in 0..=8 {
                let t = step as f32 / 8.0;
                dot(
                    pair[0].x + t * (pair[1].x - pair[0].x),
                    pair[0].y + t * (pair[1].y - pair[0].y),
                    colour,
                );
            }
        }
    }
    out.save(&arguments[1]).unwrap();
}
