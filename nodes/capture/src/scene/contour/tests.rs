use parry3d::math::{Pose, Vec2};

use super::super::paint::{self, Finish};
use super::super::render::{CENTRE, Camera};
use super::super::solid::{Hole, Part, rectangle};
use super::*;

const FOCAL: f32 = 1200.0;
const STEP: f32 = 12.4;
const DISTANCE: f32 = 500.0;
const DEGREES: f32 = 40.0;
const LAMP: Vec3 = Vec3::new(-0.46, -0.34, 0.82);
const POSITIONS: [f32; 3] = [0.0, 1.0, 2.0];

/// A camera of the tests' own, worked out apart from the renderer's.
struct Pinhole {
    eye: Vec3,
    forward: Vec3,
    down: Vec3,
}

impl Pinhole {
    fn at(position: f32) -> Self {
        let (sin, cos) = DEGREES.to_radians().sin_cos();
        let forward = Vec3::new(0.0, cos, -sin);
        Self {
            eye: Vec3::X * (position - 1.0) * STEP - forward * DISTANCE,
            forward,
            down: Vec3::new(0.0, -sin, -cos),
        }
    }

    /// Along the ray through a place of the picture, a millimetre of depth.
    fn direction(&self, x: f32, y: f32) -> Vec3 {
        let [right, down] = [(x - CENTRE[0]) / FOCAL, (y - CENTRE[1]) / FOCAL];
        self.forward + Vec3::X * right + self.down * down
    }

    /// Where a point is seen, and its disparity.
    fn project(&self, point: Vec3) -> (Vec2, f32) {
        let from = point - self.eye;
        let depth = from.dot(self.forward);
        let place = Vec2::new(from.x, from.dot(self.down)) * (FOCAL / depth);
        (place + Vec2::from(CENTRE), FOCAL * STEP / depth)
    }

    /// The point that is seen at a place with a disparity.
    fn point(&self, point: &ContourPoint) -> Vec3 {
        let depth = FOCAL * STEP / point.disparity;
        self.eye + self.direction(point.x, point.y) * depth
    }
}

fn scene() -> Scene {
    let camera = Camera::above(DISTANCE, DEGREES).with(FOCAL, STEP, 0.0);
    Scene::new(camera, paint::card).in_soft_light(LAMP, 0.05)
}

fn of_kind(contours: &[Contour], kind: ContourKind) -> Vec<&Contour> {
    let chosen = contours.iter().filter(|contour| contour.kind == kind);
    chosen.collect()
}

fn slab(half: [f32; 2], thickness: f32) -> Part {
    let outline = rectangle([-half[0], -half[1]], half, [0.0; 4], 2.0);
    Part::default().plate(&outline, &Hole::none(0.0, 0.0), thickness)
}

#[test]
fn a_balls_silhouette_is_where_rays_touch_it_and_as_near_as_where_they_do() {
    const RADIUS: f32 = 30.0;
    let centre = Vec3::new(8.0, -5.0, 60.0);
    let ball = Pose::translation(centre.x, centre.y, centre.z);
    let scene = scene()
        .with(Part::ball(RADIUS), ball, paint::dull_cast)
        .lit();
    for view in 0..3 {
        let contours = contours(&scene, &POSITIONS, view);
        let silhouettes = of_kind(&contours, ContourKind::Silhouette);
        let [silhouette] = silhouettes[..] else {
            panic!("{} silhouettes", silhouettes.len());
        };
        let camera = Pinhole::at(view as f32);
        let to_centre = centre - camera.eye;
        let touches_at = (to_centre.length_squared() - RADIUS * RADIUS).sqrt();
        for point in &silhouette.points {
            let along = camera.direction(point.x, point.y).normalize();
            let away = (to_centre - along * to_centre.dot(along)).length();
            // The ball's facets are 5.6 degrees wide and high: they lie up to 0.072 mm, a sixth of a pixel, inside it.
            assert!((-0.073..0.003).contains(&(away - RADIUS)), "{away}");
            let touch = camera.eye + along * touches_at;
            let (_, disparity) = camera.project(touch);
            assert!((point.disparity - disparity).abs() < 0.15, "{disparity}");
            assert_eq!(point.seen, 0b111);
        }
        assert_eq!(silhouette.points.first(), silhouette.points.last());
        // As seen, it is nearly a circle.
        let round = 2.0 * std::f32::consts::PI * RADIUS * FOCAL / to_centre.dot(camera.forward);
        let length = silhouette.length();
        assert!((length / round - 1.0).abs() < 0.02, "{length} of {round}");
    }
}

#[test]
fn a_plates_contours_are_its_edges_and_have_their_disparities() {
    const HALF: [f32; 2] = [34.0, 22.0];
    const THICKNESS: f32 = 12.0;
    let pose = Pose::new(Vec3::new(5.0, -8.0, 20.0), Vec3::new(0.2, -0.15, 0.5));
    let scene = scene()
        .with(slab(HALF, THICKNESS), pose, paint::dull_steel)
        .lit();
    let corner = |x: f32, y: f32, z: f32| {
        pose.transform_point(Vec3::new(x * HALF[0], y * HALF[1], z * THICKNESS))
    };
    let mut edges = Vec::new();
    for (a, b) in [(-1.0, 0.0), (-1.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
        edges.push([corner(-1.0, a, b), corner(1.0, a, b)]);
        edges.push([corner(a, -1.0, b), corner(a, 1.0, b)]);
    }
    for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        edges.push([corner(x, y, 0.0), corner(x, y, 1.0)]);
    }
    let camera = Pinhole::at(0.0);
    let mut covered = vec![0; edges.len()];
    let contours = contours(&scene, &POSITIONS, 0);
    let is_shape = |c: &&Contour| matches!(c.kind, ContourKind::Silhouette | ContourKind::Crease);
    let points = contours.iter().filter(is_shape).flat_map(|c| &c.points);
    for point in points {
        // The edge that passes nearest, and there its disparity, which is linear in the picture.
        let passes = edges.iter().enumerate().map(|(i, ends)| {
            let [(a, near), (b, far)] = ends.map(|end| camera.project(end));
            let place = Vec2::new(point.x, point.y);
            let along = ((place - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (
                (place - a.lerp(b, along)).length(),
                near + (far - near) * along,
                i,
            )
        });
        let nearest = passes.min_by(|a, b| a.0.total_cmp(&b.0));
        let (away, disparity, edge) = nearest.unwrap_or_default();
        assert!(away < 0.02, "{away} px from any edge: {point:?}");
        assert!((point.disparity - disparity).abs() < 0.02, "{disparity}");
        covered[edge] += 1;
    }
    // Of twelve edges nine are seen from above.
    assert!(
        covered.iter().filter(|&&count| count > 10).count() >= 9,
        "{covered:?}"
    );
}

#[test]
fn a_mark_ends_where_its_paint_does() {
    fn half_painted(place: Vec3, _: f32) -> Finish {
        Finish {
            albedo: if place.x > 3.0 { 0.6 } else { 0.3 },
            sheen: 0.0,
            mark: u8::from(place.x > 3.0),
        }
    }
    let pose = Pose::new(Vec3::new(5.0, -8.0, 0.0), Vec3::Z * 0.4);
    let scene = scene()
        .with(slab([30.0, 20.0], 5.0), pose, half_painted)
        .lit();
    let contours = contours(&scene, &POSITIONS, 2);
    let camera = Pinhole::at(2.0);
    let marks = of_kind(&contours, ContourKind::Mark);
    let length: f32 = marks.iter().map(|mark| mark.length()).sum();
    for point in marks.iter().flat_map(|mark| &mark.points) {
        let local = pose.inverse().transform_point(camera.point(point));
        assert!((local.x - 3.0).abs() < 0.01, "{local:?}");
        // On the lit top twice the light comes back from one side.
        let least = if local.z > 4.9 { 50.0 } else { 10.0 };
        assert!(point.contrast > least, "{point:?}");
    }
    let ends = [-20.0, 20.0].map(|y| {
        let end = pose.transform_point(Vec3::new(3.0, y, 5.0));
        camera.project(end).0
    });
    let along_top = ends[0].distance(ends[1]);
    // On the top, and the five millimetres down the front.
    assert!(length > along_top && length < along_top + 20.0, "{length}");
}

#[test]
fn a_shadow_ends_where_the_lamps_middle_passes_the_edge_that_throws_it() {
    const HALF: [f32; 2] = [30.0, 24.0];
    const HEIGHT: f32 = 30.0;
    let pose = Pose::translation(0.0, 0.0, HEIGHT);
    let scene = scene().with(slab(HALF, 0.2), pose, paint::dull_steel).lit();
    let contours = contours(&scene, &POSITIONS, 1);
    let camera = Pinhole::at(1.0);
    let shadows = of_kind(&contours, ContourKind::Shadow);
    let points: Vec<_> = shadows.iter().flat_map(|shadow| &shadow.points).collect();
    assert!(points.len() > 150, "{}", points.len());
    for point in points {
        let on_table = camera.point(point);
        let above = on_table + LAMP * (HEIGHT / LAMP.z);
        let outside = [above.x.abs() - HALF[0], above.y.abs() - HALF[1]];
        // Corners throw round shadows: the lamp is wide.
        if outside.iter().all(|&away| away > -4.0) {
            continue;
        }
        let away = outside[0].max(outside[1]);
        assert!(away.abs() < 0.5, "{away} mm: {point:?}");
    }
}

#[test]
fn a_view_shows_what_is_not_hidden_there() {
    // A card stands before a painted strip of the table.
    fn strips(place: Vec3, _: f32) -> Finish {
        let is_strip = (place.x / 9.0).rem_euclid(2.0) < 1.0;
        Finish {
            albedo: if is_strip { 0.6 } else { 0.3 },
            sheen: 0.0,
            mark: u8::from(is_strip),
        }
    }
    let card = Pose::new(Vec3::new(4.0, -20.0, 30.0), Vec3::X * 1.5);
    let camera = Camera::above(DISTANCE, DEGREES).with(FOCAL, STEP, 0.0);
    let scene = Scene::new(camera, strips)
        .in_soft_light(LAMP, 0.05)
        .with(slab([20.0, 30.0], 3.0), card, paint::dull_steel)
        .lit();
    for view in 0..3 {
        let contours = contours(&scene, &POSITIONS, view);
        let own = Pinhole::at(view as f32);
        let (mut hidden, mut all, mut wrong) = (0, 0, 0);
        let marks = of_kind(&contours, ContourKind::Mark);
        for point in marks.iter().flat_map(|mark| &mark.points) {
            let place = own.point(point);
            for other in 0..3 {
                let there = Pinhole::at(other as f32);
                let (at, disparity) = there.project(place);
                let is_inside = at.x > 0.0
                    && at.x < (WIDTH - 1) as f32
                    && at.y > 0.0
                    && at.y < (HEIGHT - 1) as f32;
                // The slow way: what does the other view see in that place?
                let cover = scene.cover(other as f32);
                let seen = scene.seen(other as f32, at.x, at.y, &cover);
                let is_seen = is_inside && FOCAL * STEP / seen.depth < disparity + 0.05;
                all += 1;
                hidden += usize::from(!is_seen);
                wrong += usize::from(is_seen != (point.seen >> other & 1 == 1));
            }
        }
        assert!(hidden > 100, "{hidden}");
        // Where a strip goes behind the card, the last point may be on either side.
        assert!(wrong * 200 < all, "view {view}: {wrong} of {all}");
    }
}

#[test]
fn contours_are_the_same_every_time() {
    let scene = scene()
        .with(
            Part::ball(20.0),
            Pose::translation(0.0, 0.0, 20.0),
            paint::dull_cast,
        )
        .lit();
    let twice = [(); 2].map(|()| contours(&scene, &POSITIONS, 1));
    assert_eq!(twice[0], twice[1]);
}
