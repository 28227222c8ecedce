//! Where a camera sees a ray: the pinhole and what its lens does to it.
//!
//! The formulas are those of OpenCV's `projectPoints` and `fisheye::projectPoints`, whose names of coefficients ROS and
//! Kalibr share.

use glam::{DMat3, DVec2, DVec3};
use messages::Size;

use crate::settings::LensModel;

/// How a lens bends rays. The place of a ray (X, Y, Z) is x = X/Z, y = Y/Z before, r² = x² + y².
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Radial and tangential distortion: places move to
    /// x·q + 2·p1·x·y + p2·(r² + 2·x²), y·q + p1·(r² + 2·y²) + 2·p2·x·y with
    /// q = (1 + k1·r² + k2·r⁴ + k3·r⁶) / (1 + k4·r² + k5·r⁴ + k6·r⁶).
    /// `plumb_bob` and `radtan` know only the first five.
    Rational {
        /// k1 to k6.
        radial: [f64; 6],
        /// p1 and p2.
        tangential: [f64; 2],
    },
    /// The same with a thin prism, as of a lens whose elements are off its axis, and with a sensor that is tilted against
    /// it. To the place s1·r² + s2·r⁴ and s3·r² + s4·r⁴ are added; then it is seen on the tilted plane.
    Tilted {
        /// k1 to k6.
        radial: [f64; 6],
        /// p1 and p2.
        tangential: [f64; 2],
        /// s1 to s4.
        prism: [f64; 4],
        /// τx and τy, in radians.
        tilt: [f64; 2],
    },
    /// A fisheye: a ray at angle θ from the axis is seen at θ·(1 + k1·θ² + k2·θ⁴ + k3·θ⁶ + k4·θ⁸) from the middle.
    Equidistant([f64; 4]),
}

/// A model, the names that files have for it, and how many coefficients it may have.
type Known = (LensModel, &'static [&'static str], &'static [usize]);

const MODELS: [Known; 4] = [
    (
        LensModel::PlumbBob,
        &[
            "plumb_bob",
            "radtan",
            "pinhole-radtan",
            "radial-tangential",
            "radial_tangential",
            "brown_conrady",
            "brown-conrady",
            "brown conrady",
        ],
        &[4, 5],
    ),
    (
        LensModel::RationalPolynomial,
        &["rational_polynomial", "rational", "thin_prism", "tilted"],
        &[5, 8, 12, 14],
    ),
    (
        LensModel::Equidistant,
        &[
            "equidistant",
            "equi",
            "pinhole-equi",
            "fisheye",
            "kannala_brandt",
            "kannala_brandt4",
            "kannala brandt4",
            "kannala-brandt",
        ],
        &[4],
    ),
    (LensModel::None, &["none", ""], &[0]),
];

impl LensModel {
    /// The model that files call so.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let name = name.trim().to_ascii_lowercase();
        let known = MODELS.iter().find(|(_, names, _)| names.contains(&&*name));
        known.map(|(model, ..)| *model)
    }

    /// What ROS calls it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::PlumbBob => "plumb_bob",
            Self::RationalPolynomial => "rational_polynomial",
            Self::Equidistant => "equidistant",
            Self::None => "none",
        }
    }

    /// The model that so many coefficients can only be of. Four are plumb_bob's or a fisheye's.
    pub(crate) fn of_count(count: usize) -> Option<Self> {
        match count {
            0 => Some(Self::None),
            5 => Some(Self::PlumbBob),
            8 | 12 | 14 => Some(Self::RationalPolynomial),
            _ => None,
        }
    }
}

impl Lens {
    /// A lens that does nothing.
    pub const NONE: Self = Self::Rational {
        radial: [0.0; 6],
        tangential: [0.0; 2],
    };

    /// The lens of a model and its coefficients in the order of OpenCV, ROS and Kalibr: k1, k2, p1, p2, k3, k4, k5, k6, s1
    /// to s4, τx, τy, or of a fisheye k1 to k4.
    ///
    /// # Errors
    /// A wrong number of coefficients, in a sentence's second half.
    pub(crate) fn of_model(model: LensModel, coefficients: &[f64]) -> Result<Self, String> {
        let counts = MODELS.iter().find(|(known, ..)| *known == model);
        let counts = counts.map_or(&[][..], |(.., counts)| counts);
        let mut given = coefficients;
        // Newer OpenCV pads with zeros for thin prisms and tilted sensors.
        while given.len() > *counts.last().unwrap_or(&0) && given.last() == Some(&0.0) {
            given = &given[..given.len() - 1];
        }
        if !counts.contains(&given.len()) {
            let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
            let cure = match LensModel::of_count(coefficients.len()) {
                Some(other) if other != model => format!(
                    "; so many are of {}: if that is what they are, set capture.lens={}",
                    other.name(),
                    other.name()
                ),
                _ => String::new(),
            };
            return Err(format!(
                "has {} distortion coefficients, and the model {} takes {}{cure}",
                coefficients.len(),
                model.name(),
                counts.join(" or ")
            ));
        }
        let at = |index: usize| given.get(index).copied().unwrap_or_default();
        let radial = [at(0), at(1), at(4), at(5), at(6), at(7)];
        let tangential = [at(2), at(3)];
        let (prism, tilt) = ([at(8), at(9), at(10), at(11)], [at(12), at(13)]);
        let is_straight = prism.iter().chain(&tilt).all(|&value| value == 0.0);
        Ok(match model {
            LensModel::Equidistant => Self::Equidistant([at(0), at(1), at(2), at(3)]),
            _ if is_straight => Self::Rational { radial, tangential },
            _ => Self::Tilted {
                radial,
                tangential,
                prism,
                tilt,
            },
        })
    }

    /// Where a ray at this distance from the axis is seen, and how far that moves with it: of a fisheye the distance is
    /// the angle, else its tangent.
    fn radial(&self, r: f64) -> f64 {
        let r2 = r * r;
        match self {
            Self::Rational { radial, .. } | Self::Tilted { radial, .. } => {
                let [k1, k2, k3, k4, k5, k6] = radial;
                r * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)))
                    / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            }
            Self::Equidistant([k1, k2, k3, k4]) => {
                r * (1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))))
            }
        }
    }

    /// How far from the axis it is looked at: 84°, and of a fisheye 89°. More no plane can show.
    fn farthest(&self) -> f64 {
        match self {
            Self::Rational { .. } | Self::Tilted { .. } => 10.0,
            Self::Equidistant(_) => 1.555,
        }
    }

    /// How far from the axis the model holds: beyond, its polynomial turns back and would show the same place twice.
    fn reach(&self) -> f64 {
        const STEP: f64 = 2e-3;
        let most = self.farthest();
        let mut r = 0.0;
        let mut seen = 0.0;
        while r < most {
            let next = self.radial(r + STEP);
            if next.is_nan() || next <= seen {
                return r;
            }
            seen = next;
            r += STEP;
        }
        most
    }
}

/// One camera: what its sensor and its lens are like.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The size it was calibrated for, where the file says it.
    pub size: Option<Size>,
    /// Focal lengths along columns and rows, in pixels.
    pub focal: [f64; 2],
    /// Column and row of the principal point, in pixels; the middle of the first pixel is at 0.
    pub centre: [f64; 2],
    lens: Lens,
    reach: f64,
    /// Of a tilted sensor: the plane in front of the lens to that of the sensor.
    tilt: Option<DMat3>,
}

/// What maps places on the plane z = 1 to those on a sensor that is turned about its rows and columns.
fn tilted([about_x, about_y]: [f64; 2]) -> DMat3 {
    let turn = DMat3::from_rotation_y(-about_y) * DMat3::from_rotation_x(-about_x);
    let at = |row: usize, column: usize| turn.col(column)[row];
    // Back to where the axis meets the sensor.
    let along = DMat3::from_cols(
        DVec3::new(at(2, 2), 0.0, 0.0),
        DVec3::new(0.0, at(2, 2), 0.0),
        DVec3::new(-at(0, 2), -at(1, 2), 1.0),
    );
    along * turn
}

impl Camera {
    /// A camera with this lens.
    pub fn new(size: Option<Size>, focal: [f64; 2], centre: [f64; 2], lens: Lens) -> Self {
        Self {
            size,
            focal,
            centre,
            lens,
            reach: lens.reach(),
            tilt: match lens {
                Lens::Tilted { tilt, .. } if tilt != [0.0; 2] => Some(tilted(tilt)),
                _ => None,
            },
        }
    }

    /// The lens.
    pub(crate) fn lens(&self) -> &Lens {
        &self.lens
    }

    /// How far from the principal point, in pixels along the rows, the model of its lens turns back, where it does before
    /// it is as far from the axis as anything can be seen.
    pub(crate) fn turns_back_at(&self) -> Option<f64> {
        let is_short = self.reach + 1e-9 < self.lens.farthest();
        is_short.then(|| self.focal[0].min(self.focal[1]) * self.lens.radial(self.reach))
    }

    /// Column and row at which it sees a ray of its own optical frame (x right, y down, z forward); `None` behind it and
    /// beyond what the model of its lens holds for.
    pub fn project(&self, ray: [f64; 3]) -> Option<[f64; 2]> {
        self.place(DVec3::from(ray)).map(|place| place.to_array())
    }

    pub(crate) fn place(&self, ray: DVec3) -> Option<DVec2> {
        if ray.z <= 0.0 {
            return None;
        }
        let ideal = ray.truncate() / ray.z;
        let r2 = ideal.length_squared();
        let is_beyond = || r2 > self.reach * self.reach;
        let seen = match self.lens {
            Lens::Rational { .. } | Lens::Tilted { .. } if is_beyond() => return None,
            Lens::Rational { radial, tangential } => bent(ideal, radial, tangential),
            Lens::Tilted {
                radial,
                tangential,
                prism: [s1, s2, s3, s4],
                ..
            } => {
                let prism = DVec2::new(s1 + s2 * r2, s3 + s4 * r2) * r2;
                let flat = bent(ideal, radial, tangential) + prism;
                match self.tilt {
                    Some(tilt) => {
                        let at = tilt * flat.extend(1.0);
                        at.truncate() / at.z
                    }
                    None => flat,
                }
            }
            Lens::Equidistant(_) => {
                let r = r2.sqrt();
                let angle = r.atan();
                if angle > self.reach {
                    return None;
                }
                match r > 1e-9 {
                    true => ideal * (self.lens.radial(angle) / r),
                    false => ideal,
                }
            }
        };
        Some(DVec2::from(self.focal) * seen + DVec2::from(self.centre))
    }
}

/// Where radial and tangential distortion move a place to.
fn bent(at: DVec2, [k1, k2, k3, k4, k5, k6]: [f64; 6], [p1, p2]: [f64; 2]) -> DVec2 {
    let r2 = at.length_squared();
    let q = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
    let DVec2 { x, y } = at;
    let both = 2.0 * x * y;
    at * q
        + DVec2::new(
            p1 * both + p2 * (r2 + 2.0 * x * x),
            p1 * (r2 + 2.0 * y * y) + p2 * both,
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    // The figures are what cv2.projectPoints and cv2.fisheye.projectPoints give (OpenCV 5.0).
    const BOB: [[f64; 2]; 3] = [
        [528.3664717927686, 93.29963578966692],
        [125.07424307046875, 527.221746138664],
        [332.22028662871855, 481.29538541480855],
    ];
    const RATIONAL: [[f64; 2]; 3] = [
        [528.2671993569882, 93.4170034728534],
        [126.03250960467233, 526.0773443702344],
        [332.29848087494634, 480.79719788648697],
    ];
    const FISHEYE: [[f64; 2]; 3] = [
        [526.8604912768639, 94.29298352153023],
        [128.32360393158626, 522.4072427582975],
        [332.1779245837826, 479.0790846517142],
    ];

    const PRISM: [[f64; 2]; 3] = [
        [528.5414170069882, 93.32507546285339],
        [126.5269808546723, 526.0107421202345],
        [332.55225928898915, 480.7084968289089],
    ];
    const TILTED: [[f64; 2]; 3] = [
        [529.973230049187, 92.53027266945315],
        [126.67120558892, 525.5450908211648],
        [332.65658414759616, 482.62558702943073],
    ];

    /// Looks at three rays with a camera of f 700 and 690, c 320 and 239.
    fn seen(lens: Lens) -> [[f64; 2]; 3] {
        let camera = Camera::new(None, [700.0, 690.0], [320.0, 239.0], lens);
        let rays = [[0.31, -0.22, 1.0], [-0.6, 0.9, 2.0], [0.02, 0.4, 1.1]];
        rays.map(|ray| camera.project(ray).unwrap_or([f64::NAN; 2]))
    }

    fn assert_near(seen: [[f64; 2]; 3], expected: [[f64; 2]; 3]) {
        for (seen, expected) in seen.iter().zip(&expected) {
            for axis in 0..2 {
                let off = (seen[axis] - expected[axis]).abs();
                assert!(off < 1e-6, "{seen:?} is not {expected:?}");
            }
        }
    }

    #[test]
    fn plumb_bob_sees_what_opencv_sees() {
        let lens = Lens::of_model(LensModel::PlumbBob, &[-0.28, 0.09, 0.0011, -0.0007, 0.013]);
        assert_near(seen(lens.unwrap_or(Lens::NONE)), BOB);
    }

    #[test]
    fn the_rational_polynomial_sees_what_opencv_sees() {
        let coefficients = [0.4, -0.1, 0.0008, 0.0004, 0.02, 0.7, -0.05, 0.01];
        let lens = Lens::of_model(LensModel::RationalPolynomial, &coefficients);
        assert_near(seen(lens.unwrap_or(Lens::NONE)), RATIONAL);
    }

    #[test]
    fn thin_prisms_and_tilted_sensors_see_what_opencv_sees() {
        let coefficients = [
            0.4, -0.1, 0.0008, 0.0004, 0.02, 0.7, -0.05, 0.01, 0.003, -0.002, -0.0015, 0.004, 0.02,
            -0.035,
        ];
        for (count, expected) in [(12, PRISM), (14, TILTED)] {
            let lens = Lens::of_model(LensModel::RationalPolynomial, &coefficients[..count]);
            assert_near(seen(lens.unwrap_or(Lens::NONE)), expected);
        }
    }

    #[test]
    fn the_fisheye_sees_what_opencv_sees() {
        let lens = Lens::of_model(LensModel::Equidistant, &[-0.02, 0.011, -0.004, 0.0009]);
        assert_near(seen(lens.unwrap_or(Lens::NONE)), FISHEYE);
    }

    #[test]
    fn beyond_the_turning_point_of_the_polynomial_nothing_is_seen() {
        // r·(1 − 0.3·r²) turns back where 1 = 0.9·r².
        let lens =
            Lens::of_model(LensModel::PlumbBob, &[-0.3, 0.0, 0.0, 0.0]).unwrap_or(Lens::NONE);
        let camera = Camera::new(None, [100.0; 2], [0.0; 2], lens);
        assert!(camera.project([1.04, 0.0, 1.0]).is_some());
        assert!(camera.project([1.07, 0.0, 1.0]).is_none());
        assert!(camera.project([0.0, 0.0, -1.0]).is_none());
    }

    #[test]
    fn zeros_that_opencv_pads_with_are_no_coefficients() {
        let mut padded = vec![0.0; 14];
        padded[..5].copy_from_slice(&[0.1, 0.2, 0.3, 0.4, 0.5]);
        assert_eq!(
            Lens::of_model(LensModel::PlumbBob, &padded),
            Lens::of_model(LensModel::PlumbBob, &padded[..5])
        );
        padded[13] = 0.1;
        assert_eq!(
            Lens::of_model(LensModel::PlumbBob, &padded),
            Err(
                "has 14 distortion coefficients, and the model plumb_bob takes 4 or 5; so many are of rational_polynomial: if that is what they are, set capture.lens=rational_polynomial"
                    .to_owned()
            )
        );
    }
}
