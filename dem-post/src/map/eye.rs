//! The viewpoint: parallel to an axis, or in perspective from above and from the side.

use nalgebra::Vector3;
use serde::Serialize;

use super::boxes::{Box2, EMPTY, around, union};
use super::scale::{Colour, mixed};

/// A projection of the sample.
pub(super) enum Eye {
    /// Parallel projection onto two axes: in 3D along y, or against x.
    Along([usize; 2]),
    /// Perspective from a viewpoint.
    At(Place),
}

/// A viewpoint as numbers; lengths in m.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Perspective {
    /// The point at which the eye looks.
    pub focus: [f64; 3],
    /// Unit vectors to the right, up, and away from the eye.
    pub right: [f64; 3],
    /// See `right`.
    pub up: [f64; 3],
    /// See `right`.
    pub ahead: [f64; 3],
    /// Distance of the eye from the focus.
    pub far: f64,
    /// Half the diagonal of the sample.
    pub half: f64,
}

/// A viewpoint from which spheres are seen in perspective.
pub(super) struct Place {
    /// The middle of the sample, at which the eye looks, and half the sides of the box around the
    /// centres, at least a radius, m.
    focus: Vector3<f64>,
    half: Vector3<f64>,
    /// Unit vectors to the right, up, and away from the eye.
    right: Vector3<f64>,
    up: Vector3<f64>,
    ahead: Vector3<f64>,
}

/// Distance of the eye, in halves of the diagonal of the box: near enough to show depth, far enough
/// for spheres to look round.
const FAR: f64 = 5.0;
/// Angles to the side and above (rad).
const ASIDE: f64 = 0.45;
const ABOVE: f64 = 0.3;
/// Share of white in the colours of the farthest grains.
const HAZE: f64 = 0.6;
/// Share of white on a polygon that is parallel to the light.
const SHADE: f64 = 0.6;
/// Size of a drawn plane relative to the sample.
const BEYOND: f64 = 1.15;

impl Place {
    /// The viewpoint for a sample with these centres and this greatest radius (m): z points up, y
    /// into the sheet.
    pub fn of<'a>(centres: impl Iterator<Item = &'a [f64]> + Clone, radius: f64) -> Self {
        let corner = |pick: fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>| {
            centres.clone().map(Vector3::from_column_slice).reduce(|a, b| pick(&a, &b)).unwrap_or_default()
        };
        let (low, high) = (corner(Vector3::inf), corner(Vector3::sup));
        let ahead = Vector3::new(-ASIDE.sin() * ABOVE.cos(), ASIDE.cos() * ABOVE.cos(), -ABOVE.sin());
        let right = Vector3::new(ASIDE.cos(), ASIDE.sin(), 0.0);
        let half = (0.5 * (high - low)).sup(&Vector3::repeat(radius));
        Self { focus: 0.5 * (low + high), half, right, up: right.cross(&ahead), ahead }
    }

    /// The viewpoint as numbers.
    pub fn as_seen(&self) -> Perspective {
        let half = self.half.norm();
        let [focus, right, up, ahead] = [self.focus, self.right, self.up, self.ahead].map(Into::into);
        Perspective { focus, right, up, ahead, far: FAR * half, half }
    }

    fn depth(&self, point: &[f64]) -> f64 {
        (Vector3::from_column_slice(&point[..3]) - self.focus).dot(&self.ahead)
    }

    /// Magnification at this depth, relative to the middle of the sample.
    fn magnified(&self, depth: f64) -> f64 {
        let far = FAR * self.half.norm();
        // points close to the eye are not magnified further
        far / (far + depth).max(0.2 * far)
    }

    /// Position of a point in the picture, m.
    pub fn flat(&self, point: &[f64]) -> [f64; 2] {
        let off = Vector3::from_column_slice(&point[..3]) - self.focus;
        [self.right, self.up].map(|axis| off.dot(&axis) * self.magnified(self.depth(point)))
    }

    /// The corners of a plane through `point`, m, as large as the sample, and whether the sample is
    /// in front of it.
    pub fn plane(&self, point: &[f64], normal: [f64; 3]) -> ([[f64; 3]; 4], bool) {
        let normal = Vector3::from(normal);
        let middle = self.focus + (Vector3::from_column_slice(point) - self.focus).dot(&normal) * normal;
        let s = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
        let t = normal.cross(&s);
        let [along_s, along_t] = [s, t].map(|t| BEYOND * t.abs().dot(&self.half) * t);
        let eye = self.focus - FAR * self.half.norm() * self.ahead;
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let corners = corners.map(|[a, b]| (middle + a * along_s + b * along_t).into());
        (corners, (eye - middle).dot(&normal) > 0.0)
    }

    /// Whether a plate through `point`, m, is behind the middle of the sample: both the middle and
    /// the eye are on the same side of it.
    pub fn is_behind(&self, point: &[f64], normal: [f64; 3]) -> bool {
        let (point, normal) = (Vector3::from_column_slice(point), Vector3::from(normal));
        let height = |x: Vector3<f64>| (x - point).dot(&normal);
        height(self.focus) * height(self.focus - FAR * self.half.norm() * self.ahead) > 0.0
    }

    /// The box in the picture around some points, m.
    pub fn shows(&self, points: &[[f64; 3]]) -> Box2 {
        points.iter().fold(EMPTY, |found, point| union(found, around(self.flat(point), 0.0)))
    }

    /// The shaded colour of a flat polygon: the less the polygon faces the light, the paler. The
    /// light comes from above and the left.
    pub fn lit(&self, colour: &str, corners: &[[f64; 3]]) -> Colour {
        let [a, b, c] = [0, 1, 2].map(|k| corners.get(k).map_or_else(Vector3::default, |x| Vector3::from(*x)));
        let facing = (b - a).cross(&(c - a)).try_normalize(0.0).map_or(1.0, |normal| normal.dot(&self.light()).abs());
        mixed(colour, SHADE * (1.0 - facing))
    }

    /// Unit vector towards the light.
    fn light(&self) -> Vector3<f64> {
        (self.up - self.right - 1.5 * self.ahead).normalize()
    }

    /// The colour of a point seen from here: the farther, the paler.
    pub fn hazy(&self, colour: &str, point: &[f64]) -> Colour {
        let part = 0.5 * (1.0 + (self.depth(point) / self.half.norm()).clamp(-1.0, 1.0));
        mixed(colour, HAZE * part)
    }
}

impl Eye {
    /// Position of a point in the picture, m; in perspective, to scale at the middle of the sample.
    pub fn flat(&self, point: &[f64]) -> [f64; 2] {
        match self {
            Self::Along(axes) => axes.map(|axis| point[axis]),
            Self::At(place) => place.flat(point),
        }
    }

    /// Depth of a point in 3D, m, up to a constant. The axes right, up and towards the eye are
    /// right-handed: the eye looks along y, or against x.
    pub fn depth(&self, point: &[f64]) -> f64 {
        match self {
            Self::Along([0, _]) => point[1],
            Self::Along(_) => -point[0],
            Self::At(place) => place.depth(point),
        }
    }

    /// Magnification.
    pub fn magnified(&self, point: &[f64]) -> f64 {
        match self {
            Self::Along(_) => 1.0,
            Self::At(place) => place.magnified(place.depth(point)),
        }
    }

    /// The viewpoint of a perspective.
    pub fn place(&self) -> Option<&Place> {
        match self {
            Self::Along(_) => None,
            Self::At(place) => Some(place),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place() -> Place {
        Place::of([[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]].iter().map(<[f64; 3]>::as_slice), 0.5)
    }

    #[test]
    fn the_middle_of_the_sample_is_the_middle_of_the_picture_and_true_to_scale() {
        let eye = Eye::At(place());
        assert_eq!(eye.flat(&[0.0; 3]), [0.0; 2]);
        assert_eq!(eye.magnified(&[0.0; 3]), 1.0);
    }

    #[test]
    fn right_up_and_ahead_are_orthonormal() {
        let Place { right, up, ahead, .. } = place();
        for (a, b) in [(right, up), (up, ahead), (ahead, right)] {
            assert!(a.dot(&b).abs() < 1e-15, "{}", a.dot(&b));
        }
        assert!([right, up, ahead].iter().all(|a| (a.dot(a) - 1.0).abs() < 1e-15));
        assert!(up[2] > 0.9);
    }

    #[test]
    fn what_is_nearer_looks_larger_and_darker() {
        let eye = Eye::At(place());
        let (near, far) = ([0.0, -2.0, 0.0], [0.0, 2.0, 0.0]);
        assert!(eye.depth(&near) < eye.depth(&far));
        assert!(eye.magnified(&near) > 1.0 && eye.magnified(&far) < 1.0);
        assert!(place().hazy("#000000", &near) < place().hazy("#000000", &far));
    }

    #[test]
    fn what_faces_the_light_keeps_its_colour() {
        let place = place();
        let light = place.light();
        let s = light.cross(&place.up).normalize();
        let seen = |a: Vector3<f64>, b: Vector3<f64>| place.lit("#000000", &[[0.0; 3], a.into(), b.into()]);
        assert_eq!(seen(s, light.cross(&s)), "#000000");
        assert_eq!(seen(s, light), mixed("#000000", SHADE));
    }

    #[test]
    fn a_floor_is_behind_the_sample_and_a_lid_before_it() {
        let (floor, behind) = place().plane(&[5.0, 5.0, -3.0], [0.0, 0.0, 1.0]);
        assert!(behind && floor.iter().all(|corner| corner[2] == -3.0));
        assert!(!place().plane(&[0.0, 0.0, 3.0], [0.0, 0.0, -1.0]).1);
    }
}
