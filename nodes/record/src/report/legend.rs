//! What the colours of pictures mean.

use maud::{Markup, html};
use messages::Calibration;
use messages::record::{Pictured, Span};

use super::plot::brief;

/// What the colours of disparities mean, in pixels and in depth.
pub(super) fn disparities(span: Span, camera: &Calibration) -> Markup {
    let (least, most) = span.ends();
    let places = [least, (least + most) / 2.0, most];
    ramp(&[
        places.map(|disparity| format!("{} px", brief(disparity.into()))),
        places.map(|disparity| depth(disparity, camera)),
    ])
}

/// What the colours of errors or of confidence mean, as viewers are told; the last stands for all that is more.
pub(super) fn of(pictured: Pictured) -> Markup {
    ramp(&[[0.0, 0.25, 0.5, 0.75, 1.0].map(|share| {
        let more = if share < 1.0 { "" } else { "≥ " };
        format!("{more}{}", pictured.meaning(share))
    })])
}

/// All colours in a row, and below them what some of them mean.
fn ramp<const N: usize>(rows: &[[String; N]]) -> Markup {
    html! {
        span.ramp {}
        @for row in rows {
            span.scale { @for meaning in row { span { (meaning) } } }
        }
    }
}

/// The depth of a disparity in words.
pub(super) fn depth(disparity: f32, camera: &Calibration) -> String {
    let depth = camera.depth_m(f64::from(disparity));
    match depth.is_finite() && depth > 0.0 {
        true => format!("{} {}", brief(depth), unit(camera)),
        false => "∞".to_owned(),
    }
}

/// What depths are measured in: without a calibration nobody knows.
pub(super) fn unit(camera: &Calibration) -> &'static str {
    match camera.calibrated {
        true => "m",
        false => "units",
    }
}
