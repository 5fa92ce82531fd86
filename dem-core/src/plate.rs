//! A plate: a wall of finite extent and no thickness, a segment in 2D and a rectangle in 3D.
//!
//! A plate is solid from both sides. Its contact with a grain is at the point of the plate nearest
//! to the centre of the grain: on a face, on an edge or at a corner. A plate is convex, so this
//! point is unique, and the normal from it to the centre is a continuous function of the centre
//! wherever the centre is not on the plate: it turns as a grain moves off a face, and never jumps.

use crate::dim::{Dim, Vect};

/// Halvings of the interval in which a grain is nearest to a plate: as many as f64 resolves.
const HALVINGS: usize = 60;

/// A plate, relative to its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plate<D: Dim> {
    normal: D::Vector,
    /// Unit vectors along the sides, and half the lengths of the sides (m); in 2D the second side
    /// is zero.
    sides: [D::Vector; 2],
    half: [f64; 2],
}

impl<D: Dim> Plate<D> {
    /// A plate with this unit normal and sides of these lengths (m), in 2D one. `side` is the
    /// direction of the first side, of any length and not parallel to the normal; its part along
    /// the normal is dropped. Without it, as in 2D, the side is the first tangent of the normal.
    /// The second side is perpendicular to both.
    pub fn new(normal: D::Vector, side: Option<D::Vector>, lengths: &[f64]) -> Self {
        let first = side.map_or_else(
            || D::tangent(&D::frame(normal)),
            |side| {
                let side = side - normal * normal.dot(&side);
                side * (1.0 / side.norm())
            },
        );
        let half = |k: usize| 0.5 * lengths.get(k).copied().unwrap_or(0.0);
        if D::N == 2 {
            return Self { normal, sides: [first, D::Vector::zero()], half: [half(0), 0.0] };
        }
        let second = D::velocity(D::Spin::from_slice(normal.as_slice()), first);
        Self { normal, sides: [first, second], half: [half(0), half(1)] }
    }

    /// Unit normal; a grain may be on either side.
    pub fn normal(&self) -> D::Vector {
        self.normal
    }

    /// Unit vectors along the sides; in 2D the second is zero.
    pub fn sides(&self) -> [D::Vector; 2] {
        self.sides
    }

    /// Lengths of the sides (m); in 2D the second is zero.
    pub fn lengths(&self) -> [f64; 2] {
        self.half.map(|half| 2.0 * half)
    }

    /// How far the plate reaches from its middle along a unit vector (m).
    pub fn reach(&self, along: D::Vector) -> f64 {
        self.half[0] * along.dot(&self.sides[0]).abs() + self.half[1] * along.dot(&self.sides[1]).abs()
    }

    /// The parts of `offset` (m) along the sides, as far as they are beyond the ends of the sides:
    /// both zero over a face.
    pub fn beyond(&self, offset: D::Vector) -> [f64; 2] {
        [0, 1].map(|k| {
            let along = offset.dot(&self.sides[k]);
            along - along.clamp(-self.half[k], self.half[k])
        })
    }

    /// Gap (m) and unit normal towards the grain, for a grain at `offset` from the middle.
    pub(crate) fn gap(&self, offset: D::Vector, radius: f64) -> (f64, D::Vector) {
        let (height, beyond) = (offset.dot(&self.normal), self.beyond(offset));
        let apart = self.normal * height + self.sides[0] * beyond[0] + self.sides[1] * beyond[1];
        let distance = apart.norm();
        if beyond == [0.0; 2] || distance == 0.0 {
            let normal = if height < 0.0 { -self.normal } else { self.normal };
            return (height.abs() - radius, normal);
        }
        (distance - radius, apart * (1.0 / distance))
    }

    /// Smallest gap (m) of a grain that moves from `offset` along the straight displacement `way`
    /// (m).
    pub(crate) fn smallest_gap(&self, offset: D::Vector, way: D::Vector, radius: f64) -> f64 {
        // along a line the distance to a convex body is a convex function, and falls where the way
        // is against the normal
        let (mut before, mut after) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + after);
            let falls = self.gap(offset + way * middle, radius).1.dot(&way) < 0.0;
            if falls { before = middle } else { after = middle }
        }
        self.gap(offset + way * before, radius).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dim::{D2, D3};
    use proptest::prelude::*;

    fn vector<D: Dim>(numbers: &[f64]) -> D::Vector {
        D::Vector::from_slice(&numbers[..D::N])
    }

    /// A plate from any numbers; none where they define no normal or no side.
    fn plate<D: Dim>(n: &[f64], side: &[f64], lengths: &[f64]) -> Option<Plate<D>> {
        let normal = vector::<D>(n);
        let normal = (normal.norm() > 0.1).then(|| normal * (1.0 / normal.norm()))?;
        let side = vector::<D>(side);
        let plain = (side - normal * normal.dot(&side)).norm() > 0.1;
        (D::N == 2 || plain).then(|| Plate::new(normal, (D::N > 2).then_some(side), lengths))
    }

    /// The gap is the distance to the nearest of many points of the plate, and grows along the
    /// normal as fast as the grain moves.
    fn gap_is_a_distance<D: Dim>(plate: &Plate<D>, offset: D::Vector) {
        let (gap, normal) = plate.gap(offset, 0.25);
        let grid = |k: usize| (-60..=60).map(move |m| f64::from(m) / 60.0 * plate.half[k]);
        let points = grid(0).flat_map(|a| grid(1).map(move |b| plate.sides[0] * a + plate.sides[1] * b));
        let nearest = points.map(|point| (offset - point).norm()).fold(f64::INFINITY, f64::min);
        let coarse = (plate.half[0] + plate.half[1]) / 60.0;
        assert!(gap + 0.25 <= nearest + 1e-12 && nearest <= gap + 0.25 + coarse, "{gap} and {nearest}");
        assert!((normal.norm() - 1.0).abs() < 1e-14);
        let further = plate.gap(offset + normal * 0.5, 0.25);
        assert!((further.0 - gap - 0.5).abs() < 1e-12 && (further.1 - normal).norm() < 1e-12);
    }

    /// The smallest gap along a way is that of many points of it.
    fn smallest_is_smallest<D: Dim>(plate: &Plate<D>, offset: D::Vector, way: D::Vector) {
        let found = plate.smallest_gap(offset, way, 0.25);
        let on_the_way = |k: i32| plate.gap(offset + way * (f64::from(k) / 200.0), 0.25).0;
        let least = (0..=200).map(on_the_way).fold(f64::INFINITY, f64::min);
        assert!(found <= least + 1e-12 && least <= found + way.norm() / 200.0, "{found} and {least}");
    }

    fn holds<D: Dim>(n: &[f64], side: &[f64], lengths: &[f64], x: &[f64], way: &[f64]) {
        let Some(plate) = plate::<D>(n, side, lengths) else { return };
        let axes = [plate.normal, plate.sides[0], plate.sides[1]];
        for (k, a) in axes.iter().take(D::N).enumerate() {
            for (m, b) in axes.iter().take(D::N).enumerate() {
                assert!((a.dot(b) - f64::from(u8::from(k == m))).abs() < 1e-14);
            }
        }
        gap_is_a_distance(&plate, vector::<D>(x));
        smallest_is_smallest(&plate, vector::<D>(x), vector::<D>(way));
    }

    proptest! {
        #[test]
        fn the_gap_is_the_distance_of_the_nearest_point(
            n in prop::array::uniform3(-1.0..1.0), side in prop::array::uniform3(-1.0..1.0),
            lengths in prop::array::uniform2(0.01..3.0),
            x in prop::array::uniform3(-3.0..3.0), way in prop::array::uniform3(-6.0..6.0),
        ) {
            holds::<D2>(&n, &side, &lengths, &x, &way);
            holds::<D3>(&n, &side, &lengths, &x, &way);
        }
    }

    /// Around the end of a segment, from one face to the other, the normal turns by no more than
    /// the grain does.
    #[test]
    fn the_normal_turns_around_an_end_without_a_jump() {
        let plate = Plate::<D2>::new([0.0, 1.0].into(), None, &[2.0]);
        // on the line at the distance 1 of the segment: along a face, half a circle, back
        let at = |s: f64| -> [f64; 2] {
            let turn = (s - 1.0).clamp(0.0, std::f64::consts::PI);
            let along = if s < 1.0 { s } else { 1.0 - (s - 1.0 - turn) };
            [along + turn.sin(), turn.cos()]
        };
        let steps = 4000;
        let way = (2.0 + std::f64::consts::PI) / f64::from(steps);
        let mut last = plate.gap(at(0.0).into(), 0.4);
        for k in 0..=steps {
            let (gap, normal) = plate.gap(at(f64::from(k) * way).into(), 0.4);
            assert!((gap - 0.6).abs() < 1e-12, "{gap} at {k}");
            assert!((normal - last.1).norm() <= way * (1.0 + 1e-6), "jump at {k}");
            last = (gap, normal);
        }
        assert!(last.1[0].abs() < 1e-12 && last.1[1] == -1.0, "{:?}", last.1);
    }

    #[test]
    fn a_way_through_a_plate_is_seen_and_one_past_it_is_not() {
        let plate = Plate::<D2>::new([0.0, 1.0].into(), None, &[2.0]);
        let through = plate.smallest_gap([0.3, 5.0].into(), [0.1, -9.0].into(), 0.25);
        assert!((through + 0.25).abs() < 1e-12, "{through}");
        let past = plate.smallest_gap([1.5, 5.0].into(), [0.0, -9.0].into(), 0.25);
        assert!((past - 0.25).abs() < 1e-12, "{past}");
    }
}
