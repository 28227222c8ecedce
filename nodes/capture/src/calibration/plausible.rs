//! Whether numbers can be those of cameras: one check for every way in.
//!
//! What a file says is refused where it cannot be, since nobody may have looked at it; what a setting says was typed by who
//! should know, and is asked back. Lengths tell most: files in millimetres, or with P[3] of another meaning, give depths that
//! are wrong by a constant factor and look right.

use messages::Size;

use super::{Camera, Lens, Why};

/// Metres between neighbouring cameras: a stereo endoscope has 4 mm, a mast of a ship 5 m.
const POSSIBLE_M: [f64; 2] = [0.001, 10.0];
/// The same of most rigs: beyond it is asked whether the unit is right.
const USUAL_M: [f64; 2] = [0.002, 2.0];
/// Metres between frames of a triple along a rail: from a fine stage to a vehicle. Beyond it is asked only.
const ALONG_M: [f64; 2] = [1e-4, 10.0];
/// P[3] that may be a baseline in metres, and how near to each other cameras then seem to stand.
const BARE_P3: (f64, f64) = (2.0, 0.005);
/// Focal lengths as a part of the picture's width: below the first it would show 157° and more of a plane, which no
/// rectified picture does; beyond the second less than 3°, which only lenses of half a metre do.
const FOCAL: [f64; 2] = [0.1, 19.0];
/// The same for a fisheye, which may show everything before it in a part of its picture.
const FISHEYE_FOCAL: f64 = 0.03;
/// How far a principal point of rectified pictures may lie from their middle, as a part of their sides, before that is told:
/// cameras that look inward have it off the middle. And before it is refused.
const CENTRE: [f64; 2] = [0.4, 1.0];
/// Tangential coefficients of lenses are some thousandths.
const TANGENTIAL: f64 = 0.02;
/// How many times farther, or nearer, than without it a lens may show the corner of a picture.
const BENT: f64 = 4.0;

/// What speaks against a number.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Doubt {
    /// It cannot be.
    Refused(Why),
    /// It is unusual.
    Told(Why),
}

impl Doubt {
    /// The sentence.
    pub(crate) fn why(self) -> Why {
        match self {
            Self::Refused(why) | Self::Told(why) => why,
        }
    }
}

/// Who says how far apart views are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Said {
    /// `capture.baseline`, of a rig.
    Setting,
    /// The fourth number of a projection, and its focal length.
    Projection { shift: f64, focal_px: f64 },
    /// Translations in a file.
    File,
    /// Positions, speed or baseline along a rail.
    Rail,
}

/// A length as people write it: four digits, in metres.
pub(crate) fn metres(length_m: f64) -> String {
    format!("{} m", rounded(length_m))
}

fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// A length with the unit in which it is neither tiny nor huge.
fn shown(length_m: f64) -> String {
    match length_m.abs() {
        0.0..0.001 => format!("{} mm", rounded(length_m * 1e3)),
        _ => metres(length_m),
    }
}

/// Whether views can be taken so far apart.
pub(crate) fn baseline(step_m: f64, said: Said) -> Option<Doubt> {
    let step = shown(step_m);
    let is_within = |[least, most]: [f64; 2]| (least..=most).contains(&step_m);
    let says = || format!("capture.baseline={}", rounded(step_m));
    let (possible, usual) = match said {
        Said::Rail => (ALONG_M, ALONG_M),
        _ => (POSSIBLE_M, USUAL_M),
    };
    if let Said::Projection { shift, focal_px } = said
        && shift.abs() <= BARE_P3.0
        && step_m < BARE_P3.1
    {
        let why = format!(
            "P[3] is {shift} and f {focal_px} px, which puts neighbouring cameras {step} apart: P[3] is −f·b, in pixels times metres; if {shift} is the baseline itself write {} there, and if the cameras do stand so near set {}",
            rounded(shift * focal_px),
            says()
        );
        return Some(match is_within(possible) {
            true => Doubt::Told(why),
            false => Doubt::Refused(why),
        });
    }
    if is_within(usual) {
        return None;
    }
    let is_long = step_m > usual[1];
    let millimetres = metres(step_m / 1e3);
    let why = match (said, is_long) {
        (Said::Setting, true) => format!(
            "capture.baseline is {step} from view to view: lengths are metres; if these are millimetres set {}",
            rounded(step_m / 1e3)
        ),
        (Said::Setting, false) => format!(
            "capture.baseline is {step} from view to view: lengths are metres; is that what is meant?"
        ),
        (Said::Rail, true) => format!(
            "the camera moves {step} from one frame of a triple to the next: lengths are metres; are these millimetres ({millimetres})? Then name the column of capture.positions position_mm, or divide capture.baseline or capture.speed by 1000"
        ),
        (Said::Rail, false) => format!(
            "the camera moves {step} from one frame of a triple to the next: is the column of capture.positions named by its unit, position_m, position_mm or position_um, and is capture.baseline in metres?"
        ),
        (Said::File | Said::Projection { .. }, true) => format!(
            "it puts neighbouring cameras {step} apart: lengths are metres (and P[3] is −f times metres); if these are millimetres, that is {millimetres}, divide them by 1000, and if the cameras do stand so far apart set {}",
            says()
        ),
        (Said::File | Said::Projection { .. }, false) => format!(
            "it puts neighbouring cameras {step} apart: lengths are metres (and P[3] is −f times metres); write them so, and if the cameras do stand so near set {}",
            says()
        ),
    };
    let is_refused = !is_within(possible) && matches!(said, Said::File | Said::Projection { .. });
    Some(match is_refused {
        true => Doubt::Refused(why),
        false => Doubt::Told(why),
    })
}

/// Whether rectified pictures can have this focal length.
pub(crate) fn focal(focal_px: f64, size: Size, what: &str) -> Option<Doubt> {
    let width = f64::from(size.width);
    let degrees = 2.0 * (width / (2.0 * focal_px)).atan().to_degrees();
    let [least, most] = FOCAL;
    if focal_px < least * width {
        return Some(Doubt::Refused(format!(
            "{what} is {focal_px} px, at which pictures of {} columns would show {degrees:.0}°: is it in millimetres? In pixels it is that divided by the width of a pixel, and mostly one half to three times the width of the picture",
            size.width
        )));
    }
    (focal_px > most * width).then(|| {
        Doubt::Told(format!(
            "{what} is {focal_px} px, at which pictures of {} columns show {degrees:.1}° only: is it in pixels of these pictures?",
            size.width
        ))
    })
}

/// Whether rectified pictures can have this principal point.
pub(crate) fn centre(centre: [f64; 2], size: Size, what: &str) -> Option<Doubt> {
    let sides = [size.width, size.height].map(f64::from);
    let off = [0, 1].map(|axis| ((centre[axis] + 0.5) / sides[axis] - 0.5).abs());
    let off = off[0].max(off[1]);
    let [cx, cy] = centre;
    let [x, y] = sides.map(|side| (side - 1.0) / 2.0);
    let is_unset = centre == [0.0; 2];
    if !is_unset && off <= CENTRE[0] {
        return None;
    }
    let why = format!(
        "{what} is {cx}, {cy}, far from {x}, {y}, the middle of pictures of {size} pixels: is it of pictures of another size, or not filled in?"
    );
    Some(match is_unset || off > CENTRE[1] {
        true => Doubt::Refused(why),
        false => Doubt::Told(why),
    })
}

/// Whether a camera can take pictures of this size so: focal lengths, and what its lens does to their corners.
pub(crate) fn camera(name: &str, camera: &Camera, size: Size) -> Result<(), Why> {
    let sides = [size.width, size.height].map(f64::from);
    let [fx, fy] = camera.focal;
    let least = match camera.lens() {
        Lens::Equidistant(_) => FISHEYE_FOCAL,
        _ => FOCAL[0],
    };
    if fx < least * sides[0] || !(0.4..2.5).contains(&(fy / fx)) {
        return Err(format!(
            "the focal lengths of {name} are {fx} and {fy}, which pictures of {size} pixels cannot have: they are in pixels, nearly equal, and mostly one half to three times the width"
        ));
    }
    let half = sides.map(|side| side / 2.0);
    let doubt = |what: String| {
        format!(
            "the lens of {name} {what}: are its coefficients in the order k1, k2, p1, p2, k3, is the model the right one (capture.lens says another), and are they of this camera matrix?"
        )
    };
    if let Some(reach) = camera.turns_back_at()
        && reach < half[0].min(half[1])
    {
        return Err(doubt(format!(
            "turns back {reach:.0} px from the middle, and would show a part of its pictures of {size} pixels only"
        )));
    }
    let (Lens::Rational { tangential, .. } | Lens::Tilted { tangential, .. }) = camera.lens()
    else {
        return Ok(());
    };
    if tangential.iter().any(|p| p.abs() > TANGENTIAL) {
        return Err(doubt(format!(
            "has tangential coefficients p1 and p2 of {} and {}, and those of lenses are some thousandths",
            tangential[0], tangential[1]
        )));
    }
    // Along the shorter side, whatever the lens does in the corners.
    let tangent = half[0].min(half[1]) / fx.min(fy);
    let seen = camera.project([tangent, 0.0, 1.0]);
    let bent = seen.map(|[x, _]| ((x - camera.centre[0]) / (tangent * fx)).abs());
    match bent {
        Some(bent) if !(1.0 / BENT..=BENT).contains(&bent) => Err(doubt(format!(
            "moves what is half a picture from the middle to {bent:.1} times that"
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::LensModel;

    fn sentence(doubt: Option<Doubt>) -> String {
        match doubt {
            Some(Doubt::Refused(why)) => format!("refused: {why}"),
            Some(Doubt::Told(why)) => why,
            None => String::new(),
        }
    }

    #[test]
    fn baselines_of_rigs_from_endoscopes_to_ships_pass_and_others_are_asked_for_their_unit() {
        for step_m in [0.004, 0.05, 0.12, 1.0, 2.0] {
            for said in [Said::Setting, Said::File, Said::Rail] {
                assert_eq!(baseline(step_m, said), None, "{step_m}");
            }
        }
        let long = sentence(baseline(60.0, Said::File));
        assert!(
            long.starts_with("refused: it puts neighbouring cameras 60 m apart")
                && long.contains("0.06 m")
                && long.contains("set capture.baseline=60"),
            "{long}"
        );
        assert!(sentence(baseline(6.0, Said::File)).starts_with("it puts"));
        let short = sentence(baseline(0.00009, Said::File));
        assert!(
            short.starts_with("refused: ") && short.contains("0.09 mm"),
            "{short}"
        );
        let typed = sentence(baseline(60.0, Said::Setting));
        assert!(
            typed.contains("if these are millimetres set 0.06"),
            "{typed}"
        );
        assert!(sentence(baseline(0.00009, Said::Setting)).contains("0.09 mm"));
        // Stages and vehicles are rails.
        assert_eq!(baseline(5e-4, Said::Rail), None);
        assert_eq!(baseline(8.0, Said::Rail), None);
        assert!(sentence(baseline(60.0, Said::Rail)).contains("position_mm"));
        assert!(sentence(baseline(0.00009, Said::Rail)).contains("position_um"));
    }

    #[test]
    fn a_projection_that_holds_the_baseline_itself_says_what_to_write() {
        let of = |shift: f64, focal_px: f64| {
            let said = Said::Projection { shift, focal_px };
            sentence(baseline(shift.abs() / focal_px, said))
        };
        assert_eq!(of(-38.4, 640.0), "");
        let bare = of(-0.06, 640.0);
        assert!(
            bare.starts_with("refused: P[3] is -0.06") && bare.contains("write -38.4 there"),
            "{bare}"
        );
        // Half a metre and f 400 px would be 1.25 mm.
        assert!(of(-0.5, 400.0).contains("write -200 there"));
        assert!(of(-38_400.0, 640.0).contains("if these are millimetres, that is 0.06 m"));
    }

    #[test]
    fn focal_lengths_in_millimetres_and_principal_points_of_other_pictures_are_told() {
        let size = Size::new(640, 480);
        for f in [200.0, 640.0, 8000.0] {
            assert_eq!(focal(f, size, "f"), None);
        }
        assert!(sentence(focal(8.0, size, "f")).contains("is it in millimetres?"));
        for narrow in [20_000.0, 64_000.0] {
            assert!(
                sentence(focal(narrow, size, "f")).contains("° only"),
                "{narrow}"
            );
        }
        assert_eq!(focal(12_000.0, size, "f"), None, "3°, as of a long lens");
        assert_eq!(centre([319.5, 239.5], size, "c"), None);
        assert_eq!(centre([500.0, 300.0], size, "c"), None);
        assert!(sentence(centre([640.0, 480.0], size, "c")).starts_with("c is 640, 480"));
        assert!(sentence(centre([0.0, 0.0], size, "c")).starts_with("refused"));
        assert!(sentence(centre([1280.0, 960.0], size, "c")).starts_with("refused"));
    }

    #[test]
    fn lenses_whose_numbers_are_no_lens_are_refused() {
        let size = Size::new(640, 480);
        let check = |model, coefficients: &[f64]| {
            let lens = Lens::of_model(model, coefficients).unwrap_or(Lens::NONE);
            let one = Camera::new(None, [500.0; 2], [320.0, 240.0], lens);
            camera("left", &one, size)
        };
        let plain = LensModel::PlumbBob;
        assert_eq!(check(plain, &[-0.3, 0.1, 0.001, -0.002, -0.02]), Ok(()));
        assert_eq!(
            check(LensModel::Equidistant, &[-0.02, 0.01, -0.004, 0.001]),
            Ok(())
        );
        assert_eq!(
            check(
                LensModel::RationalPolynomial,
                &[4.6, 1.3, 1e-4, 1e-5, 0.05, 5.0, 2.9, 0.3]
            ),
            Ok(())
        );
        // The order of others: k1, k2, k3, p1, p2.
        let why = check(plain, &[-0.3, 0.1, -0.05, 0.001, -0.002])
            .err()
            .unwrap_or_default();
        assert!(why.contains("p1 and p2 of -0.05"), "{why}");
        let why = check(plain, &[-40.0, 0.0, 0.0, 0.0, 0.0])
            .err()
            .unwrap_or_default();
        assert!(why.contains("turns back"), "{why}");
        let why = check(plain, &[1200.0, 300.0, 0.0, 0.0, 0.0])
            .err()
            .unwrap_or_default();
        assert!(why.contains("times that"), "{why}");
        let tiny = Camera::new(None, [3.6, 3.6], [320.0, 240.0], Lens::NONE);
        assert!(camera("left", &tiny, size).is_err());
        let garbage = Camera::new(None, [772.0, 1.0], [320.0, 240.0], Lens::NONE);
        assert!(camera("left", &garbage, size).is_err());
    }
}
