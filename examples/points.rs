//! Disparities of three photographs, with the library alone: `cargo run --example points -- left.png centre.png right.png`

use std::io::Write as _;

use tricurve::{Pipeline, Rig, Settings, Size};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let open = |path| image::open(path).map(image::DynamicImage::into_luma8);
    let views = std::env::args().skip(1).map(open);
    let views: Vec<image::GrayImage> = views.collect::<Result<_, _>>()?;
    let first = views.first().ok_or("give three images, left to right")?;

    let settings = Settings::default();
    let size = Size::new(first.width(), first.height());
    let rig = Rig::of_views(views.len(), &settings.filter.channels, size);
    let mut pipeline = Pipeline::new(&settings, &rig)?;
    let mut out = std::io::stdout().lock();
    for point in pipeline.process(&views)?.points() {
        let tricurve::Point {
            u,
            v,
            disparity,
            score,
            ..
        } = point;
        writeln!(out, "{u:.2} {v:.2} {disparity:.3} {score:.3}")?;
    }
    Ok(())
}
