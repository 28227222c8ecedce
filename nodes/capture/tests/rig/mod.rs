//! A rig of three cameras whose lenses distort and that are tilted: the oracle of rectification, by itself.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test file uses its part; tests may panic"
)]

use std::fmt::Write as _;

use glam::{DMat2, DMat3, DVec2, DVec3};
use image::GrayImage;
use messages::Size;

/// Of every image.
pub const SIZE: Size = Size::new(512, 480);
/// Metres between neighbouring cameras.
pub const STEP: f64 = 0.06;
/// A lens as the textbooks write it, by itself: the oracle.
#[derive(Clone, Copy, PartialEq)]
pub enum Lens {
    Polynomial([f64; 8]),
    Fisheye([f64; 4]),
}

/// A camera of the rig.
#[derive(Clone, Copy)]
pub struct Camera {
    pub focal: [f64; 2],
    pub centre: [f64; 2],
    pub lens: Lens,
    /// Turns the rig's directions (x along the cameras, z forward) into the camera's.
    pub turn: DMat3,
    pub place: DVec3,
}

impl Camera {
    /// Where a point of the rig's frame is seen.
    pub fn sees(&self, point: DVec3) -> DVec2 {
        let at = self.turn * (point - self.place);
        let (x, y) = (at.x / at.z, at.y / at.z);
        let seen = match self.lens {
            Lens::Polynomial([k1, k2, p1, p2, k3, k4, k5, k6]) => {
                let r = x.hypot(y);
                let stretch = (1.0 + k1 * r.powi(2) + k2 * r.powi(4) + k3 * r.powi(6))
                    / (1.0 + k4 * r.powi(2) + k5 * r.powi(4) + k6 * r.powi(6));
                let sideways = 2.0 * p1 * x * y + p2 * (3.0 * x * x + y * y);
                let down = p1 * (x * x + 3.0 * y * y) + 2.0 * p2 * x * y;
                DVec2::new(x * stretch + sideways, y * stretch + down)
            }
            Lens::Fisheye([k1, k2, k3, k4]) => {
                let angle = x.hypot(y).atan2(1.0);
                let bent = angle
                    + k1 * angle.powi(3)
                    + k2 * angle.powi(5)
                    + k3 * angle.powi(7)
                    + k4 * angle.powi(9);
                let around = y.atan2(x);
                DVec2::new(around.cos(), around.sin()) * bent
            }
        };
        DVec2::from(self.focal) * seen + DVec2::from(self.centre)
    }

    /// Its rotation and translation from the first camera's frame.
    pub fn from(&self, first: &Self) -> (DMat3, DVec3) {
        let turn = self.turn * first.turn.transpose();
        (turn, self.turn * (first.place - self.place))
    }
}

/// The ray that a camera sees at a place of its image, in the rig's frame: Newton's method on where it sees rays.
fn ray_at(camera: &Camera, place: DVec2) -> DVec3 {
    let centre = DVec2::from(camera.centre);
    let ray = |at: DVec2| camera.turn.transpose() * at.extend(1.0);
    let sees = |at: DVec2| camera.sees(camera.place + ray(at));
    let mut at = (place - centre) / DVec2::from(camera.focal);
    for _ in 0..8 {
        let (here, by) = (sees(at), 1e-6);
        let slope = DMat2::from_cols(
            (sees(at + DVec2::X * by) - here) / by,
            (sees(at + DVec2::Y * by) - here) / by,
        );
        at += slope.inverse() * (place - here);
    }
    ray(at)
}

/// A camera that takes pictures.
pub struct Eye {
    pub camera: Camera,
    /// Through the corners of pixels; between them they change evenly.
    rays: Vec<DVec3>,
}

impl Eye {
    pub fn new(camera: Camera) -> Self {
        let across = SIZE.width as usize + 1;
        let corner = |i: usize| {
            let place = [(i % across) as f64, (i / across) as f64];
            ray_at(&camera, DVec2::from(place) - 0.5)
        };
        let count = across * (SIZE.height as usize + 1);
        Self {
            camera,
            rays: (0..count).map(corner).collect(),
        }
    }

    /// What it sees of a world that has this gray level on a ray from a place: sixteen rays a pixel.
    pub fn picture(&self, level: impl Fn(DVec3, DVec3) -> f64) -> GrayImage {
        let across = SIZE.width as usize + 1;
        let rays = &self.rays;
        GrayImage::from_fn(SIZE.width, SIZE.height, |x, y| {
            let at = y as usize * across + x as usize;
            let mut sum = 0.0;
            for sample in 0..16 {
                let right = (f64::from(sample % 4) + 0.5) / 4.0;
                let down = (f64::from(sample / 4) + 0.5) / 4.0;
                let upper = rays[at].lerp(rays[at + 1], right);
                let lower = rays[at + across].lerp(rays[at + across + 1], right);
                sum += level(self.camera.place, upper.lerp(lower, down));
            }
            image::Luma([(sum / 16.0).round() as u8])
        })
    }
}

/// A chessboard held somewhere before the rig.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    /// Inner corners along its rows and columns, and the side of its squares in metres.
    pub corners: [u32; 2],
    pub square: f64,
    /// Turns its directions (x along its rows, y down) into the rig's.
    pub turn: DMat3,
    /// The middle of its corners.
    pub middle: DVec3,
}

impl Held {
    /// The gray level on a ray from a place.
    pub fn level(&self, place: DVec3, ray: DVec3) -> f64 {
        let normal = self.turn.z_axis;
        let far = (self.middle - place).dot(normal) / ray.dot(normal);
        let at = self.turn.transpose() * (place + ray * far - self.middle) / self.square;
        let half = self.corners.map(|count| (f64::from(count) - 1.0) / 2.0);
        let (u, v) = (at.x + half[0] + 1.0, at.y + half[1] + 1.0);
        let [columns, rows] = self.corners.map(|count| f64::from(count) + 1.0);
        let is_near = |at: f64, count: f64| at > -0.6 && at < count + 0.6;
        let is_on = |at: f64, count: f64| at >= 0.0 && at < count;
        match (u.floor() + v.floor()).rem_euclid(2.0) as u8 {
            _ if far <= 0.0 || !is_near(u, columns) || !is_near(v, rows) => 90.0,
            _ if !is_on(u, columns) || !is_on(v, rows) => 225.0,
            0 => 25.0,
            _ => 225.0,
        }
    }
}

/// A board as people hold it: to all sides, tilted, nearer and farther.
pub fn held(corners: [u32; 2], square: f64, count: usize) -> Vec<Held> {
    let part = |i: usize, way: f64| (i as f64 * way).rem_euclid(1.0) * 2.0 - 1.0;
    let one = |i: usize| {
        // Even over the picture: multiples of what no fraction comes near.
        let (across, down) = (part(i, 0.754_877_666), part(i, 0.569_840_290));
        let far = 0.62 + 0.14 * part(i, 0.618_033_989);
        let tilt = 0.6 * part(i, 0.414_213_562);
        let nod = 0.6 * part(i, 0.236_067_977);
        let roll = 0.25 * part(i, 0.302_775_638);
        Held {
            corners,
            square,
            turn: DMat3::from_rotation_y(tilt)
                * DMat3::from_rotation_x(nod)
                * DMat3::from_rotation_z(roll),
            middle: DVec3::new(STEP + 0.14 * across, 0.13 * down, far),
        }
    };
    (0..count).map(one).collect()
}

pub const BOB: Lens = Lens::Polynomial([-0.22, 0.08, 0.001, -0.0008, 0.01, 0.0, 0.0, 0.0]);
pub const RADTAN: Lens = Lens::Polynomial([-0.18, 0.05, -0.0007, 0.0012, 0.0, 0.0, 0.0, 0.0]);
pub const RATIONAL: Lens = Lens::Polynomial([0.3, -0.05, 0.0008, 0.0005, 0.01, 0.52, -0.04, 0.01]);
pub const FISHEYE: Lens = Lens::Fisheye([-0.02, 0.01, -0.003, 0.0008]);

/// Three cameras, each tilted by three degrees about another axis.
pub fn rig(lenses: [Lens; 3]) -> [Camera; 3] {
    let tilt = 3f64.to_radians();
    let turns = [
        DMat3::from_rotation_z(tilt),
        DMat3::from_rotation_x(-tilt),
        DMat3::from_axis_angle(DVec3::new(0.5, 1.0, 0.5).normalize(), tilt),
    ];
    let camera = |view: usize| Camera {
        focal: [[601.0, 603.5], [596.0, 597.0], [605.5, 604.0]][view],
        centre: [[258.0, 236.5], [251.0, 243.0], [255.0, 239.0]][view],
        lens: lenses[view],
        turn: turns[view],
        place: DVec3::X * STEP * view as f64,
    };
    [camera(0), camera(1), camera(2)]
}

/// The axes (rows: right, down, forward) of parallel views of the rig: x along the cameras, z the mean of theirs.
pub fn axes(rig: &[Camera]) -> DMat3 {
    let mean: DVec3 = rig.iter().map(|c| c.turn.transpose() * DVec3::Z).sum();
    let z = (mean - DVec3::X * mean.x).normalize();
    DMat3::from_cols(DVec3::X, z.cross(DVec3::X), z).transpose()
}

/// Numbers as YAML and JSON write them.
pub fn list(values: impl IntoIterator<Item = f64>) -> String {
    let values: Vec<String> = values.into_iter().map(|v| format!("{v:?}")).collect();
    format!("[{}]", values.join(", "))
}

/// The rig as Kalibr writes it down.
pub fn kalibr(rig: &[Camera]) -> String {
    let mut text = String::new();
    for (view, camera) in rig.iter().enumerate() {
        let (model, coefficients) = match camera.lens {
            Lens::Polynomial(k) => ("radtan", k[..4].to_vec()),
            Lens::Fisheye(k) => ("equidistant", k.to_vec()),
        };
        writeln!(text, "cam{view}:\n  camera_model: pinhole").unwrap();
        if view > 0 {
            let (turn, shift) = camera.from(&rig[view - 1]);
            writeln!(text, "  T_cn_cnm1:").unwrap();
            for row in 0..3 {
                let row = turn.row(row).to_array().into_iter().chain([shift[row]]);
                writeln!(text, "  - {}", list(row)).unwrap();
            }
            writeln!(text, "  - [0.0, 0.0, 0.0, 1.0]").unwrap();
        }
        writeln!(
                text,
                "  distortion_coeffs: {}\n  distortion_model: {model}\n  intrinsics: {}\n  resolution: [512, 480]\n  rostopic: /cam{view}/image_raw",
                list(coefficients),
                list(camera.focal.into_iter().chain(camera.centre))
            )
            .unwrap();
    }
    text
}
