//! What surfaces look like: albedo fixed to the material, free of detail finer than the cameras can see.
//!
//! Everything here depends on the point of the surface alone, never on who looks, so that all views agree.

use parry3d::math::{Vec2, Vec3};

use std::f32::consts::TAU;

use super::lettering;

/// How a surface answers to light at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish {
    /// Share of the light given back in all directions, 0 to 1.
    pub(crate) albedo: f32,
    /// Strength of the sheen, 0 to 1.
    pub(crate) sheen: f32,
    /// Which of the paints of a part that is marked in several.
    pub(crate) mark: u8,
}

/// Finds the finish at a place of a part, in millimetres, seen at `detail` pixels per millimetre.
pub(crate) type Paint = fn(place: Vec3, detail: f32) -> Finish;

fn matt(albedo: f32) -> Finish {
    Finish {
        albedo: albedo.clamp(0.02, 0.95),
        sheen: 0.0,
        mark: 0,
    }
}

fn metal(albedo: f32, sheen: f32) -> Finish {
    Finish {
        albedo: albedo.clamp(0.02, 0.95),
        sheen,
        mark: 0,
    }
}

/// The bytes in an order without pattern, twice over, so that sums of two need no wrapping.
const MIXED: [u8; 512] = {
    let mut mixed = [0; 512];
    let mut i = 0;
    while i < 256 {
        mixed[i] = i as u8;
        i += 1;
    }
    // Fisher and Yates' shuffle by a linear congruential generator.
    let mut state = 1990_u32;
    while i > 1 {
        i -= 1;
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let other = (state >> 8) as usize % (i + 1);
        let kept = mixed[i];
        mixed[i] = mixed[other];
        mixed[other] = kept;
    }
    while i <= 256 {
        mixed[255 + i] = mixed[i - 1];
        i += 1;
    }
    mixed
};

fn mixed(a: usize, b: i32) -> usize {
    usize::from(MIXED[a + (b & 255) as usize])
}

/// A number of a lattice point, even over 0..1; `of` tells its uses apart.
fn chance(x: i32, y: i32, of: i32) -> f32 {
    let coarse = mixed(mixed(mixed(0, x), y), of);
    (coarse as f32 + mixed(coarse, 7 * of + 3) as f32 / 256.0) / 256.0
}

/// The whole number below, and what is left.
fn split(value: f32) -> (i32, f32) {
    let cut = value as i32;
    let whole = if (cut as f32) > value { cut - 1 } else { cut };
    (whole, value - whole as f32)
}

fn ease(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Gradient noise, within about −1..1, smooth, of wavelength near 1.5 lattice steps (K. Perlin, "Improving noise",
/// 2002).
pub(crate) fn noise(p: Vec3) -> f32 {
    let ((x, fx), (y, fy), (z, fz)) = (split(p.x), split(p.y), split(p.z));
    // The slope at a corner is one of the twelve directions to the edges of a cube, four of them twice.
    let slope = |h: usize, dx: f32, dy: f32, dz: f32| {
        let (a, b) = match h & 12 {
            0 => (dx, dy),
            4 => (dy, dz),
            8 => (dz, dx),
            _ => (dx, dz),
        };
        (if h & 1 == 0 { a } else { -a }) + (if h & 2 == 0 { b } else { -b })
    };
    let (u, v) = (ease(fx), ease(fy));
    let sides = [mixed(0, x), mixed(0, x + 1)];
    let row = |j: i32, k: i32| {
        let (dy, dz) = (fy - j as f32, fz - k as f32);
        let [a, b] = sides.map(|side| mixed(mixed(side, y + j), z + k));
        mix(slope(a, fx, dy, dz), slope(b, fx - 1.0, dy, dz), u)
    };
    let layer = |k: i32| mix(row(0, k), row(1, k), v);
    mix(layer(0), layer(1), ease(fz))
}

/// Gradient noise in the plane, like [`noise`].
fn flat_noise(p: Vec2) -> f32 {
    const SLOPES: [[f32; 2]; 8] = [
        [1.0, 0.4],
        [0.4, 1.0],
        [-0.4, 1.0],
        [-1.0, 0.4],
        [-1.0, -0.4],
        [-0.4, -1.0],
        [0.4, -1.0],
        [1.0, -0.4],
    ];
    let ((x, fx), (y, fy)) = (split(p.x), split(p.y));
    let u = ease(fx);
    let sides = [mixed(0, x), mixed(0, x + 1)];
    let row = |j: i32| {
        let dy = fy - j as f32;
        let [a, b] = sides.map(|side| SLOPES[mixed(side, y + j) & 7]);
        mix(a[0] * fx + a[1] * dy, b[0] * (fx - 1.0) + b[1] * dy, u)
    };
    mix(row(0), row(1), ease(fy))
}

/// 0 below `low`, 1 above `high`, smooth between.
pub(crate) fn smooth(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Layers of noise, each of half the wavelength and 0.6 of the strength of the one before; a layer that would be
/// finer than three pixels fades away.
fn layered(wavelength: f32, count: u32, detail: f32, noise: impl Fn(f32, f32) -> f32) -> f32 {
    let (mut sum, mut strength, mut length) = (0.0, 1.0, wavelength);
    for layer in 0..count {
        let seen = smooth(2.5, 4.5, length * detail);
        if seen == 0.0 {
            break;
        }
        // Lattices are shifted, so that their zeros do not fall together.
        sum += strength * seen * noise(1.5 / length, 17.3 * (layer + 1) as f32);
        strength *= 0.6;
        length *= 0.5;
    }
    sum
}

/// [`layered`] noise in space.
fn layers(place: Vec3, wavelength: f32, count: u32, detail: f32) -> f32 {
    layered(wavelength, count, detail, |scale, shift| {
        noise(place * scale + shift)
    })
}

/// [`layered`] noise in the plane.
fn flat_layers(place: Vec2, wavelength: f32, count: u32, detail: f32) -> f32 {
    layered(wavelength, count, detail, |scale, shift| {
        flat_noise(place * scale + shift)
    })
}

/// The share of a pixel that a line of half width `half` covers when its middle is `distance` away.
fn line(distance: f32, half: f32, detail: f32) -> f32 {
    let edge = |reach: f32| (reach * detail + 0.5).clamp(0.0, 1.0);
    edge(half - distance) - edge(-half - distance)
}

/// The share of a pixel inside a shape whose border is `inside` away.
fn area(inside: f32, detail: f32) -> f32 {
    (inside * detail + 0.5).clamp(0.0, 1.0)
}

/// A bench of planks that run away from the viewer.
pub(crate) fn bench(place: Vec3, detail: f32) -> Finish {
    const WIDTH: f32 = 58.0;
    // Turned a little, so that nothing runs along the rows or straight down the columns.
    let turned = Vec2::from_angle(0.36).rotate(place.truncate());
    let (plank, across) = split(turned.x / WIDTH);
    let own = chance(plank, 5, 9);
    let along = turned.y + 700.0 * own;
    // Year rings: level lines of a slow landscape, dense where it is steep, dark on one side and soft on the other.
    let land = flat_noise(Vec2::new(turned.x / 30.0, along / 260.0))
        + 0.15 * flat_noise(Vec2::new(turned.x / 13.0, along / 70.0));
    let (_, year) = split(land * 6.0 + own * 40.0);
    let ring = smooth(0.15, 0.75, year) * (1.0 - smooth(0.82, 1.0, year));
    // Fibres and pores, longer than wide.
    let fibre = flat_layers(Vec2::new(turned.x, along / 7.0), 4.0, 3, detail);
    let pores = flat_layers(turned, 3.4, 2, detail);
    let tone = 0.50 + 0.10 * (own - 0.5) - 0.11 * ring + 0.10 * fibre + 0.06 * pores;
    let seam = line(across.min(1.0 - across) * WIDTH, 0.5, detail);
    matt(tone * (1.0 - 0.75 * seam))
}

/// A floor of terrazzo: stone chips of many grays in fine cement.
pub(crate) fn terrazzo(place: Vec3, detail: f32) -> Finish {
    let p = place.truncate();
    let cement = 0.60 + 0.05 * flat_layers(p, 14.0, 4, detail);
    let mut tone = cement;
    for (size, of) in [(17.0_f32, 1), (7.0, 2)] {
        let ((column, _), (row, _)) = (split(p.x / size), split(p.y / size));
        for (i, j) in [
            (-1, -1),
            (0, -1),
            (1, -1),
            (-1, 0),
            (0, 0),
            (1, 0),
            (-1, 1),
            (0, 1),
            (1, 1),
        ] {
            let (x, y) = (column + i, row + j);
            let reach = size * (0.12 + 0.34 * chance(x, y, of));
            let jitter = Vec2::new(chance(x, y, of + 10), chance(x, y, of + 20));
            let centre = (Vec2::new(x as f32, y as f32) + 0.2 + 0.6 * jitter) * size;
            let from = p - centre;
            if from.length_squared() > reach * reach {
                continue;
            }
            // A chip is a polygon of five sides, each cut at its own distance.
            let turn = TAU * chance(x, y, of + 30);
            let mut border = reach;
            for side in 0..5 {
                let cut = reach * (0.55 + 0.45 * chance(x, y, of + 40 + side));
                let normal = Vec2::from_angle(turn + TAU / 5.0 * side as f32);
                border = border.min(cut - from.dot(normal));
            }
            let own = chance(x, y, of + 50);
            let stone = 0.30 + 0.48 * own + 0.05 * flat_layers(p + 300.0 * own, 5.0, 2, detail);
            tone += (stone - tone) * area(border, detail);
        }
    }
    matt(tone)
}

/// Brushed steel sheet, lettered.
pub(crate) fn brushed(place: Vec3, detail: f32) -> Finish {
    let brush = layers(Vec3::new(place.x, place.y / 5.0, place.z), 3.2, 3, detail);
    let clouds = layers(place, 14.0, 2, detail);
    let marks = lettering::stamp(place.truncate()).map_or(0.0, |away| line(away, 0.5, detail));
    let tone = 0.72 + 0.11 * brush + 0.07 * clouds;
    metal(tone * (1.0 - 0.72 * marks), 0.4)
}

/// Rough cast zinc.
pub(crate) fn cast(place: Vec3, detail: f32) -> Finish {
    let clouds = layers(place, 7.0, 3, detail);
    let pits = smooth(0.25, 0.55, layers(place + 40.0, 4.0, 2, detail));
    metal(0.46 + 0.12 * clouds - 0.16 * pits, 0.6)
}

/// Ground steel, turned about z.
pub(crate) fn turned(place: Vec3, detail: f32) -> Finish {
    let angle = place.y.atan2(place.x);
    let grind = layers(
        Vec3::new(place.z * 1.3, angle.cos() * 2.0, angle.sin() * 2.0),
        3.5,
        3,
        detail,
    );
    let clouds = layers(place, 8.0, 2, detail);
    metal(0.50 + 0.09 * grind + 0.08 * clouds, 0.6)
}

/// Blackened steel of screws and nuts.
pub(crate) fn black(place: Vec3, detail: f32) -> Finish {
    metal(0.24 + 0.10 * layers(place, 4.0, 3, detail), 0.25)
}

/// A rubber ball, marbled in two tones.
pub(crate) fn rubber(place: Vec3, detail: f32) -> Finish {
    let swirl = layers(place + 9.0 * noise(place / 16.0), 11.0, 3, detail);
    matt(0.20 + 0.42 * smooth(-0.12, 0.12, swirl) + 0.06 * layers(place, 3.5, 2, detail))
}

/// A marbled plastic handle with a printed band.
pub(crate) fn handle(place: Vec3, detail: f32) -> Finish {
    let swirl = layers(
        Vec3::new(place.x, place.y, place.z / 2.0) + 4.0,
        8.0,
        3,
        detail,
    );
    // The print follows the girth; it starts 20 mm from the end.
    let girth = place.y.atan2(place.x) * place.truncate().length();
    let print = lettering::print(Vec2::new(place.z - 20.0, -girth));
    let marks = print.map_or(0.0, |away| line(away, 0.5, detail));
    metal((0.40 + 0.20 * swirl) * (1.0 - marks) + 0.85 * marks, 0.4)
}

/// A block of end-grain hardwood.
pub(crate) fn block(place: Vec3, detail: f32) -> Finish {
    let grain = layers(Vec3::new(place.x / 6.0, place.y, place.z), 5.0, 3, detail);
    matt(0.55 + 0.16 * grain + 0.05 * layers(place, 9.0, 2, detail))
}

/// Cork.
pub(crate) fn cork(place: Vec3, detail: f32) -> Finish {
    let grains = flat_layers(place.truncate(), 9.0, 4, detail);
    let dark = smooth(
        0.25,
        0.45,
        flat_layers(place.truncate() + 70.0, 8.0, 2, detail),
    );
    matt(0.44 + 0.12 * grains - 0.14 * dark)
}

/// A workshop drawing on a sheet of paper that lies on cork.
pub(crate) fn drawing(place: Vec3, detail: f32) -> Finish {
    const HALF: Vec2 = Vec2::new(94.0, 71.0);
    let p = Vec2::from_angle(-0.21).rotate(place.truncate() - Vec2::new(6.0, 10.0));
    let border = (HALF - p.abs()).min_element();
    let sheet = area(border, detail);
    let cork = if sheet < 1.0 {
        cork(place, detail).albedo
    } else {
        0.0
    };
    let mut paper = 0.80 + 0.05 * flat_layers(place.truncate(), 18.0, 4, detail);
    let [heavy, fine] = lettering::drawing(p);
    for (away, half, ink) in [(heavy, 0.45, 0.85), (fine, 0.2, 0.7)] {
        paper *= 1.0 - away.map_or(0.0, |away| ink * line(away, half, detail));
    }
    matt(cork + (paper - cork) * sheet)
}

/// A plastered wall, rough and blotched: no place of it looks like another.
pub(crate) fn plaster(place: Vec3, detail: f32) -> Finish {
    let p = place.truncate();
    let blotches = flat_layers(p, 26.0, 2, detail);
    let grains = flat_layers(p + 130.0, 6.0, 2, detail);
    matt(0.52 + 0.14 * blotches + 0.16 * grains)
}

/// Plain paint: what wears it looks the same all over.
pub(crate) fn painted(_: Vec3, _: f32) -> Finish {
    matt(0.20)
}

/// How far inside the nearest of the stripes a place is that are so wide and recur so often along one axis.
fn stripe(along: f32, period: f32, width: f32) -> f32 {
    let (_, within) = split(along / period);
    width / 2.0 - (within - 0.5).abs() * period
}

/// Bricks in a running bond, each like the other.
pub(crate) fn bricks(place: Vec3, detail: f32) -> Finish {
    const LONG: f32 = 18.0;
    const HIGH: f32 = 9.0;
    const JOINT: f32 = 1.6;
    let (course, _) = split(place.y / HIGH);
    let shift = LONG / 2.0 * (course & 1) as f32;
    let inside =
        stripe(place.x + shift, LONG, LONG - JOINT).min(stripe(place.y, HIGH, HIGH - JOINT));
    matt(0.66 - 0.26 * soft_area(inside, detail))
}

/// Ground of stripes, dark and bright, one like the other.
pub(crate) fn grating(place: Vec3, detail: f32) -> Finish {
    const PERIOD: f32 = 6.0;
    let inside = stripe(place.x, PERIOD, PERIOD / 2.0);
    matt(0.40 + 0.26 * soft_area(inside, detail))
}

/// [`area`], with a border of three pixels instead of one: on flat ground nothing is sampled more finely.
fn soft_area(inside: f32, detail: f32) -> f32 {
    smooth(-1.5, 1.5, inside * detail)
}

/// The ground of the thesis's photographs: card, with so little grain that noise covers it.
pub(crate) fn card(place: Vec3, detail: f32) -> Finish {
    matt(0.64 + 0.012 * flat_layers(place.truncate(), 22.0, 3, detail))
}

/// A mark `inside` whose border a place lies, on a ground.
fn marked(ground: Finish, mark: Finish, inside: f32, detail: f32) -> Finish {
    let share = area(inside, detail);
    Finish {
        albedo: mix(ground.albedo, mark.albedo, share),
        sheen: mix(ground.sheen, mark.sheen, share),
        mark: u8::from(inside > 0.0),
    }
}

/// Sheet metal, dull, with a painted band across the upright.
pub(crate) fn dull_sheet(place: Vec3, detail: f32) -> Finish {
    let band = 7.0 - (place.y - 45.0).abs();
    let metal = metal(0.36 + 0.015 * layers(place, 16.0, 2, detail), 0.06);
    marked(metal, matt(0.72), band, detail)
}

/// Cast metal, dull and even.
pub(crate) fn dull_cast(place: Vec3, detail: f32) -> Finish {
    metal(0.35 + 0.015 * layers(place, 14.0, 2, detail), 0.10)
}

/// A dark handle of one colour with a bright ring.
pub(crate) fn plain_handle(place: Vec3, detail: f32) -> Finish {
    let ring = 4.0 - (place.z - 71.0).abs();
    let plastic = metal(0.24 + 0.01 * layers(place, 14.0, 2, detail), 0.08);
    marked(plastic, matt(0.62), ring, detail)
}

/// Dull steel of one tone.
pub(crate) fn dull_steel(place: Vec3, detail: f32) -> Finish {
    metal(0.33 + 0.01 * layers(place, 14.0, 2, detail), 0.12)
}
