//! Directions along and across the drive of a wall, and the size of the sample along them.

use std::f64::consts::{FRAC_PI_4, PI};

use dem_history::{History, Series, Wall, WallKind};
use dem_scene::{Sample, Scene, Section};
use nalgebra::Vector3;

use crate::chains::stress::thickness;
use crate::extent::{box_around, ends_along, range};
use crate::output::Result;

/// Component of a unit vector along another from which they count as parallel.
const PARALLEL: f64 = 1.0 - 1e-9;

/// Unit vectors along a drive and perpendicular to it; coordinate axes if the drive is along one.
pub(super) struct Axes {
    pub along: Vector3<f64>,
    pub across: Vec<Vector3<f64>>,
}

impl Axes {
    pub fn of(drive: &[f64; 3], dimension: usize) -> Self {
        let along = Vector3::from(*drive).normalize();
        let mut nearest: Vec<usize> = (0..dimension).collect();
        nearest.sort_by(|a, b| along[*a].abs().total_cmp(&along[*b].abs()));
        let mut chosen = nearest[..dimension - 1].to_vec();
        chosen.sort_unstable();
        let mut across: Vec<Vector3<f64>> = vec![];
        for axis in chosen {
            let mut unit = Vector3::zeros();
            unit[axis] = 1.0;
            for other in std::iter::once(&along).chain(&across) {
                unit -= other * other.dot(&unit);
            }
            across.push(unit.normalize());
        }
        Self { along, across }
    }

    fn is_coordinate_axis(&self) -> bool {
        self.along.iter().filter(|x| **x != 0.0).count() == 1
    }
}

/// u·T u of a tensor of all steps; `None` if the series is not one of such tensors.
pub(super) fn projected(series: &Series, dimension: usize, u: &Vector3<f64>) -> Option<Vec<f64>> {
    if series.shape != [dimension, dimension] {
        return None;
    }
    let of =
        |tensor: &[f64]| tensor.iter().enumerate().map(|(k, t)| u[k / dimension] * u[k % dimension] * t).sum::<f64>();
    Some(series.value.chunks(dimension * dimension).map(of).collect())
}

/// The grains at the first frame.
pub(super) struct FirstFrame {
    pub dimension: usize,
    pub radius: Vec<f64>,
    pub position: Vec<f64>,
}

impl FirstFrame {
    pub fn read(history: &History) -> Result<Self> {
        let (radius, position) = (history.grains()?.radius, history.grain_state(0)?.position);
        Ok(Self { dimension: history.dimension(), radius, position })
    }

    /// How far the grains reach along a unit vector, m.
    pub fn ends(&self, u: &Vector3<f64>) -> [f64; 2] {
        ends_along(&self.radius, &self.position, self.dimension, |x| place_along(x, u))
    }

    /// Distance of their outermost centres along a unit vector, m: zero for a layer across it.
    pub fn spread(&self, u: &Vector3<f64>) -> f64 {
        let [low, high] = range(self.position.chunks(self.dimension).map(|x| place_along(x, u)));
        high - low
    }
}

/// Component of a position along a unit vector, m.
pub(super) fn place_along(x: &[f64], u: &Vector3<f64>) -> f64 {
    x.iter().zip(u).map(|(x, u)| x * u).sum()
}

/// The sample at the first frame.
pub(super) struct Size {
    /// Its ends along the drive, m.
    pub ends: [f64; 2],
    /// Its section across the drive, m²: in 2D its width times the thickness; inside a cylinder
    /// along the drive πR², of a packing in a cylinder the ellipse in its box, else that box.
    pub area: f64,
    /// Volume of the box along the coordinate axes over that of the height times the section (–):
    /// the stress of a history is over this box.
    pub box_share: f64,
    /// Extents of that box, m.
    pub extents: Vec<f64>,
}

impl Size {
    pub fn of(history: &History, first: &FirstFrame, scene: &str, axes: &Axes) -> Result<Self> {
        let d = first.dimension;
        let length = |[low, high]: [f64; 2]| high - low;
        let extents: Vec<f64> = box_around(&first.radius, &first.position, d).into_iter().map(length).collect();
        let ends = first.ends(&axes.along);
        let sides = axes.across.iter().map(|u| length(first.ends(u)));
        let product: f64 = sides.product();
        let section = round_section(history, scene, axes, product)?;
        let box_share = match section {
            None if axes.is_coordinate_axis() => 1.0,
            section => extents.iter().product::<f64>() / (length(ends) * section.unwrap_or(product)),
        };
        let area = section.unwrap_or(product);
        Ok(Self { ends, area: if d == 2 { area * thickness(history)? } else { area }, box_share, extents })
    }
}

/// The section of a round sample (m²): inside a cylinder along the drive, or of a packing in one.
fn round_section(history: &History, scene: &str, axes: &Axes, product: f64) -> Result<Option<f64>> {
    if history.dimension() < 3 {
        return Ok(None);
    }
    let around = |wall: &Wall| {
        let parallel = Vector3::from(wall.normal).dot(&axes.along).abs() > PARALLEL;
        (wall.kind == WallKind::Cylinder && wall.radius < 0.0 && parallel).then_some(PI * wall.radius * wall.radius)
    };
    if let Some(area) = history.walls()?.iter().find_map(around) {
        return Ok(Some(area));
    }
    let scene = serde_json::from_str::<Scene>(scene).ok();
    let round = scene.is_some_and(|scene| {
        matches!(scene.sample, Sample::Random(sample) if sample.section == Section::Circle && sample.cut.is_none())
    });
    Ok((round && axes.along[2].abs() > PARALLEL).then_some(FRAC_PI_4 * product))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_those_of_the_coordinates_along_one_and_orthonormal_else() {
        let aligned = Axes::of(&[0.0, 0.0, -2.0], 3);
        assert_eq!(aligned.along, -Vector3::z());
        assert_eq!(aligned.across, [Vector3::x(), Vector3::y()]);
        assert_eq!(Axes::of(&[0.0, -1.0, 0.0], 2).across, [Vector3::x()]);
        let oblique = Axes::of(&[1.0, 2.0, 3.0], 3);
        let all = [oblique.along, oblique.across[0], oblique.across[1]];
        for (i, a) in all.iter().enumerate() {
            for (k, b) in all.iter().enumerate() {
                assert!((a.dot(b) - f64::from(u8::from(i == k))).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn a_tensor_is_projected_on_a_direction() {
        // 5 along (3, 4)/5, zero across
        let uniaxial = [0.36 * 5.0, 0.48 * 5.0, 0.48 * 5.0, 0.64 * 5.0];
        let series = Series { shape: vec![2, 2], value: uniaxial.repeat(2), ..Series::default() };
        let axes = Axes::of(&[3.0, 4.0, 0.0], 2);
        let along = projected(&series, 2, &axes.along).unwrap();
        assert!(along.len() == 2 && (along[0] - 5.0).abs() < 1e-14);
        assert!(projected(&series, 2, &axes.across[0]).unwrap()[0].abs() < 1e-14);
        assert!(projected(&series, 3, &axes.along).is_none());
    }
}
