//! From where a sample is seen: straight along an axis, or in perspective from above and to the side.

use super::{Box2, Colour, EMPTY};

/// How the sample is seen.
pub(super) enum Eye {
    /// From far away, onto two axes: in space along y, or against x.
    Along([usize; 2]),
    /// From a place.
    At(Place),
}

/// A place from where spheres are seen in perspective.
pub(super) struct Place {
    /// The middle of the sample, which it looks at, and half the sides of the box around it, m.
    focus: [f64; 3],
    half: [f64; 3],
    /// Unit vectors to the right, up, and away from the eye.
    right: [f64; 3],
    up: [f64; 3],
    ahead: [f64; 3],
    /// Half the diagonal of the box, m.
    reach: f64,
}

/// How far the eye is, in halves of the diagonal: near enough to show depth, far enough for spheres to look round.
const FAR: f64 = 5.0;
/// Angles to the side and above (rad).
const ASIDE: f64 = 0.45;
const ABOVE: f64 = 0.3;
/// Share of white over what is farthest.
const HAZE: f64 = 0.6;
/// How much larger than the sample planes are drawn.
const BEYOND: f64 = 1.15;

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn three(point: &[f64]) -> [f64; 3] {
    [point[0], point[1], point[2]]
}

impl Place {
    /// The place for a sample with these corners (m): z points up, y into the sheet.
    pub fn of([low, high]: [[f64; 3]; 2]) -> Self {
        let focus = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
        let half = [0, 1, 2].map(|k| 0.5 * (high[k] - low[k]));
        let ahead = [-ASIDE.sin() * ABOVE.cos(), ASIDE.cos() * ABOVE.cos(), -ABOVE.sin()];
        let right = [ASIDE.cos(), ASIDE.sin(), 0.0];
        Self { focus, half, right, up: cross(right, ahead), ahead, reach: dot(half, half).sqrt() }
    }

    fn depth(&self, point: [f64; 3]) -> f64 {
        dot(minus(point, self.focus), self.ahead)
    }

    /// How much larger a thing looks at this depth than in the middle of the sample.
    fn magnified(&self, depth: f64) -> f64 {
        let far = FAR * self.reach;
        // what comes close to the eye grows no further
        far / (far + depth).max(0.2 * far)
    }

    fn flat(&self, point: [f64; 3]) -> [f64; 2] {
        let (off, larger) = (minus(point, self.focus), self.magnified(self.depth(point)));
        [dot(off, self.right) * larger, dot(off, self.up) * larger]
    }

    /// The corners of a plane through `point`, m, as large as the sample, and whether the sample is in front of it.
    pub fn plane(&self, point: &[f64], normal: [f64; 3]) -> ([[f64; 3]; 4], bool) {
        let height = dot(minus(three(point), self.focus), normal);
        let middle = [0, 1, 2].map(|k| self.focus[k] + height * normal[k]);
        let least = (0..3).min_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs())).unwrap_or(0);
        let mut axis = [0.0; 3];
        axis[least] = 1.0;
        let across = cross(normal, axis);
        let length = dot(across, across).sqrt();
        let s = across.map(|x| x / length);
        let t = cross(normal, s);
        let size = |t: [f64; 3]| BEYOND * (0..3).map(|k| (t[k] * self.half[k]).abs()).sum::<f64>();
        let (along_s, along_t) = (size(s), size(t));
        let corner = |a: f64, b: f64| [0, 1, 2].map(|k| middle[k] + a * along_s * s[k] + b * along_t * t[k]);
        let eye = [0, 1, 2].map(|k| self.focus[k] - FAR * self.reach * self.ahead[k]);
        let behind = dot(minus(eye, middle), normal) > 0.0;
        ([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], behind)
    }
}

impl Eye {
    /// Where a point is in the picture, m; in perspective m in the middle of the sample.
    pub fn flat(&self, point: &[f64]) -> [f64; 2] {
        match self {
            Self::Along(axes) => axes.map(|axis| point[axis]),
            Self::At(place) => place.flat(three(point)),
        }
    }

    /// How far a point of space is from the eye, m, from where it does not matter. To the right, up and to the eye are
    /// right-handed: it looks along y, or against x.
    pub fn depth(&self, point: &[f64]) -> f64 {
        match self {
            Self::Along([0, _]) => point[1],
            Self::Along(_) => -point[0],
            Self::At(place) => place.depth(three(point)),
        }
    }

    /// How much larger a thing looks than it is.
    pub fn magnified(&self, point: &[f64]) -> f64 {
        match self {
            Self::Along(_) => 1.0,
            Self::At(place) => place.magnified(place.depth(three(point))),
        }
    }

    /// The place, if it sees in perspective.
    pub fn place(&self) -> Option<&Place> {
        match self {
            Self::Along(_) => None,
            Self::At(place) => Some(place),
        }
    }
}

/// The box around some points of space, m.
pub(super) fn corners<'a>(points: impl Iterator<Item = &'a [f64]>) -> [[f64; 3]; 2] {
    let mut found = [[EMPTY[0][0]; 3], [EMPTY[1][0]; 3]];
    for point in points {
        for k in 0..3 {
            found[0][k] = found[0][k].min(point[k]);
            found[1][k] = found[1][k].max(point[k]);
        }
    }
    found
}

impl Place {
    /// A colour as it looks from here at a point: the paler the farther.
    pub fn hazy(&self, colour: &str, point: &[f64]) -> Colour {
        let part = 0.5 * (1.0 + (self.depth(three(point)) / self.reach).clamp(-1.0, 1.0));
        mixed(colour, HAZE * part)
    }

    /// The box in the picture around the corners of a plane, m.
    pub fn shows(&self, corners: &[[f64; 3]; 4]) -> Box2 {
        let flat = corners.map(|corner| self.flat(corner));
        let bound = |k: usize, pick: fn(f64, f64) -> f64| flat.iter().map(|x| x[k]).reduce(pick).unwrap_or(0.0);
        [[bound(0, f64::min), bound(1, f64::min)], [bound(0, f64::max), bound(1, f64::max)]]
    }
}

/// A colour with this share of white in it.
pub(super) fn mixed(colour: &str, white: f64) -> Colour {
    let part = |k: usize| colour.get(k..k + 2).and_then(|digits| u8::from_str_radix(digits, 16).ok()).unwrap_or(0);
    let mix = |k: usize| (f64::from(part(k)) * (1.0 - white) + 255.0 * white).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(1), mix(3), mix(5)).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place() -> Place {
        Place::of([[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]])
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
            assert!(dot(a, b).abs() < 1e-15, "{}", dot(a, b));
        }
        assert!([right, up, ahead].iter().all(|a| (dot(*a, *a) - 1.0).abs() < 1e-15));
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
    fn a_floor_is_behind_the_sample_and_a_lid_before_it() {
        let (floor, behind) = place().plane(&[5.0, 5.0, -3.0], [0.0, 0.0, 1.0]);
        assert!(behind && floor.iter().all(|corner| corner[2] == -3.0));
        assert!(!place().plane(&[0.0, 0.0, 3.0], [0.0, 0.0, -1.0]).1);
    }

    #[test]
    fn white_is_mixed_in() {
        assert_eq!(mixed("#102030", 0.0), "#102030");
        assert_eq!(mixed("#102030", 1.0), "#ffffff");
    }
}
