//! Disparities of three photographs, with the library alone: `cargo run --example points -- left.png centre.png right.png`

use tricurve::{Pipeline, Rig, Settings, Size};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let open = |path| image::open(path).map(image::DynamicImage::into_luma8);
    let views: Vec<image::GrayImage> = std::env::args()
        .skip(1)
        .map(open)
        .collect::<Result<_, _>>()?;
    let (width, height) = views
        .first()
        .ok_or("give three images, from left to right")?
        .dimensions();

    let settings = Settings::default();
    let rig = Rig::of_views(
        views.len(),
        &settings.filter.channels,
        Size::new(width, height),
    );
    let mut pipeline = Pipeline::new(&settings, &rig)?;
    for point in pipeline.process(&views)?.points() {
        println!(
            "{:.2} {:.2} {:.3} {:.3}",
            point.u, point.v, point.disparity, point.score
        );
    }
    Ok(())
}
