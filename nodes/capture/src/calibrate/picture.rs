//! What was seen and how well it fits, to look at: a panel a camera, every corner with its miss drawn out.

use std::fmt::Write as _;

use super::{CELLS, Calibrated, Found};

/// Width of a panel.
const PANEL: f64 = 460.0;
const GAP: f64 = 24.0;
/// Room above a panel for its name and figures.
const HEAD: f64 = 44.0;
/// Room below all for the legend.
const FOOT: f64 = 70.0;
/// How long the 95th percentile of all misses is drawn.
const DRAWN: f64 = 16.0;

impl Calibrated {
    /// The corners of every camera and by how much they miss, as an SVG picture.
    pub fn to_svg(&self) -> String {
        let heights = self.cameras.iter().map(height);
        let tallest = heights.fold(0.0, f64::max);
        let width = GAP + (PANEL + GAP) * self.cameras.len() as f64;
        let whole = HEAD + tallest + FOOT;
        let p95 = self.cameras.iter().map(|camera| camera.p95_px);
        let p95 = p95.fold(0.0, f64::max).max(1e-6);
        // A round number of times.
        let times = DRAWN / p95;
        let power = 10f64.powf(times.log10().floor());
        let round = [5.0, 2.0, 1.0].map(|digit| digit * power);
        let times = round
            .into_iter()
            .find(|round| *round <= times)
            .unwrap_or(power);
        let mut svg = String::new();
        writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {whole}\" width=\"{width}\" height=\"{whole}\" font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>"
        )
        .unwrap_or_default();
        for (number, camera) in self.cameras.iter().enumerate() {
            let left = GAP + (PANEL + GAP) * number as f64;
            panel(&mut svg, camera, left, times);
        }
        let legend = [
            "a dot: a corner of the board".to_owned(),
            format!(
                "its line: from where it is seen to where it ought to be, {times} times as long"
            ),
            "shaded: no corner was seen there".to_owned(),
        ];
        for (number, text) in legend.into_iter().enumerate() {
            let y = HEAD + tallest + 22.0 + 18.0 * number as f64;
            writeln!(
                svg,
                "<text x=\"{GAP}\" y=\"{y}\" fill=\"#333\">{text}</text>"
            )
            .unwrap_or_default();
        }
        svg.push_str("</svg>\n");
        svg
    }
}

fn height(camera: &Found) -> f64 {
    PANEL * f64::from(camera.size.height) / f64::from(camera.size.width)
}

fn panel(svg: &mut String, camera: &Found, left: f64, times: f64) {
    let scale = PANEL / f64::from(camera.size.width);
    let height = height(camera);
    let name = camera
        .name
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;");
    let mut line = |text: String| writeln!(svg, "{text}").unwrap_or_default();
    line(format!(
        "<text x=\"{left}\" y=\"18\" font-weight=\"bold\">{name}</text>\n<text x=\"{left}\" y=\"36\" fill=\"#333\">{} corners of {} images, rms {:.3} px, p95 {:.3} px</text>",
        camera.corners[0], camera.used[0], camera.rms_px, camera.p95_px
    ));
    line(format!(
        "<g transform=\"translate({left} {HEAD})\"><clipPath id=\"c{left}\"><rect width=\"{PANEL}\" height=\"{height}\"/></clipPath><g clip-path=\"url(#c{left})\"><rect width=\"{PANEL}\" height=\"{height}\" fill=\"#f7f7f4\"/>"
    ));
    let [columns, rows] = CELLS;
    let (across, down) = (PANEL / f64::from(columns), height / f64::from(rows));
    for cell in camera.empty_cells() {
        let (column, row) = (cell % columns, cell / columns);
        let (x, y) = (f64::from(column) * across, f64::from(row) * down);
        line(format!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{across:.1}\" height=\"{down:.1}\" fill=\"#e3d9c6\"/>"
        ));
    }
    for [at, miss] in &camera.misses {
        let from = (*at + 0.5) * scale;
        let to = from + *miss * times;
        line(format!(
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"#c0392b\"/><circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"1.3\" fill=\"#1f4e79\"/>",
            from.x, from.y, to.x, to.y, from.x, from.y
        ));
    }
    line(format!(
        "</g><rect width=\"{PANEL}\" height=\"{height}\" fill=\"none\" stroke=\"#888\"/></g>"
    ));
}
