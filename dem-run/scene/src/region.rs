//! Regions of space: where a material is, and where no bond forms.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A region of space, with its border.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// All points on one side of a line (2D) or a plane (3D).
    HalfSpace(HalfSpace),
    /// A box with its sides along the axes; a side of length zero makes it a line or a plate.
    Box(Cuboid),
    /// A disk (2D) or a ball (3D).
    Ball(Ball),
}

/// All points on one side of a line (2D) or a plane (3D).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSpace {
    /// A point of the border: one number for each dimension (m).
    pub point: Vec<f64>,
    /// A vector across the border, of any length, that points into the region.
    pub normal: Vec<f64>,
}

/// A box with its sides along the axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Lowest corner: one number for each dimension (m).
    pub from: Vec<f64>,
    /// Highest corner (m).
    pub to: Vec<f64>,
}

/// A disk (2D) or a ball (3D).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ball {
    /// Centre: one number for each dimension (m).
    pub center: Vec<f64>,
    /// Radius (m).
    pub radius: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

impl Region {
    /// Whether a point (m) is in the region or on its border.
    #[must_use]
    pub fn holds(&self, x: &[f64]) -> bool {
        self.meets(x, x)
    }

    /// Whether the segment from `a` to `b` (m) has a point in the region or on its border.
    #[must_use]
    pub fn meets(&self, a: &[f64], b: &[f64]) -> bool {
        match self {
            Self::HalfSpace(half) => [a, b].iter().any(|x| dot(&minus(x, &half.point), &half.normal) >= 0.0),
            Self::Ball(ball) => {
                let (way, from) = (minus(b, a), minus(&ball.center, a));
                let along = dot(&way, &way);
                // the point of the segment that is nearest to the centre
                let share = if along > 0.0 { (dot(&from, &way) / along).clamp(0.0, 1.0) } else { 0.0 };
                let apart: Vec<f64> = from.iter().zip(&way).map(|(from, way)| from - share * way).collect();
                dot(&apart, &apart) <= ball.radius * ball.radius
            }
            Self::Box(cuboid) => {
                // the part of the segment between the two sides of each axis
                let (mut first, mut last) = (0.0_f64, 1.0_f64);
                for axis in 0..a.len() {
                    let (low, high, way) = (cuboid.from[axis] - a[axis], cuboid.to[axis] - a[axis], b[axis] - a[axis]);
                    if way == 0.0 {
                        if low > 0.0 || high < 0.0 {
                            return false;
                        }
                        continue;
                    }
                    let (enter, leave) = (low / way, high / way);
                    first = first.max(enter.min(leave));
                    last = last.min(enter.max(leave));
                }
                first <= last
            }
        }
    }

    /// Name in a scene.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::HalfSpace(_) => "half_space",
            Self::Box(_) => "box",
            Self::Ball(_) => "ball",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regions() -> [Region; 3] {
        [
            Region::HalfSpace(HalfSpace { point: vec![1.0, 0.0], normal: vec![2.0, 0.0] }),
            Region::Box(Cuboid { from: vec![1.0, -1.0], to: vec![2.0, 1.0] }),
            Region::Ball(Ball { center: vec![2.0, 0.0], radius: 1.0 }),
        ]
    }

    #[test]
    fn a_region_holds_its_points_and_its_border() {
        for region in regions() {
            assert!(region.holds(&[1.5, 0.0]) && region.holds(&[1.0, 0.0]), "{region:?}");
            assert!(!region.holds(&[0.999, 0.0]), "{region:?}");
        }
        let [_, cuboid, ball] = regions();
        assert!(cuboid.holds(&[2.0, 1.0]) && !cuboid.holds(&[2.0, 1.001]) && !cuboid.holds(&[2.001, 0.0]));
        assert!(ball.holds(&[2.0, -1.0]) && !ball.holds(&[1.2, 0.7]));
    }

    #[test]
    fn a_segment_meets_what_it_passes_through() {
        let [half, cuboid, ball] = regions();
        // both ends are outside of the box and the ball, the middle is inside
        for region in [&cuboid, &ball] {
            assert!(region.meets(&[0.0, 0.0], &[4.0, 0.0]) && region.meets(&[4.0, 0.0], &[0.0, 0.0]));
            assert!(!region.meets(&[0.0, 0.0], &[0.9, 0.0]) && !region.meets(&[0.0, 3.0], &[4.0, 3.0]));
        }
        assert!(half.meets(&[0.0, 0.0], &[1.0, 5.0]) && !half.meets(&[0.0, 0.0], &[0.5, 5.0]));
        // across a corner, and past it
        assert!(cuboid.meets(&[0.5, 0.6], &[1.5, 1.3]) && !cuboid.meets(&[0.5, 0.8], &[1.5, 1.5]));
        // a box without width is a cut
        let cut = Region::Box(Cuboid { from: vec![0.5, -1.0], to: vec![0.5, 1.0] });
        assert!(cut.meets(&[0.0, 0.0], &[1.0, 0.1]) && !cut.meets(&[0.0, 0.0], &[0.4, 0.0]));
        assert!(!cut.meets(&[0.0, 2.0], &[1.0, 2.0]));
    }
}
