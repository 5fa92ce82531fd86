//! Walls: rigid shapes that are fixed, or driven along one direction.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::function::{Function, Ramp};
use super::validate::report::Report;

/// Largest cosine of the angle between two vectors that counts as a right angle: decimal directions
/// are not exact.
pub(crate) const PERPENDICULAR: f64 = 1e-6;

/// A rigid wall. It is fixed, or driven by one of `velocity`, `force`, `force_rate` and `stress`
/// along one direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Shape and place.
    pub shape: Shape,
    /// Friction with grains instead of `materials.friction.grain_wall`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Drive: velocity along the direction, a function of time (m/s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Function>,
    /// Drive: force along the direction, a function of time (N). The wall needs a mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<Function>,
    /// Drive: force along the direction, growing from zero at this rate (N/s). The wall needs a
    /// mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_rate: Option<f64>,
    /// Drive of a plane or a plate along its normal: stress, a function of time (Pa). The force in
    /// each step is the stress times the present section of the sample across the wall, of a plate
    /// the part of it that the plate covers. The wall needs a mass, its normal (and the sides of a
    /// plate) are parallel to axes, and it touches the sample at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stress: Option<Function>,
    /// Prescribed velocity across a drive by a force or a stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slide: Option<Slide>,
    /// Grains whose surface is within this distance of the wall at the start (m) move with the
    /// wall, without turning, and the forces on them count as forces on the wall: a glued platen.
    /// Not for a wall that is driven by a force or a stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grip: Option<f64>,
    /// Mass of a wall that is driven by a force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<WallMass>,
    /// Direction of the drive, of any length. Default for a plane or a plate: its normal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Vec<f64>>,
}

/// Prescribed velocity of a wall across its drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slide {
    /// Direction, of any length, perpendicular to that of the drive.
    pub direction: Vec<f64>,
    /// Velocity along it, a function of time (m/s).
    pub velocity: Function,
}

/// The shape of a wall.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// An infinite plane (a line in 2D).
    Plane(Plane),
    /// 2D: a disk, or a ring around the grains.
    Circle(Circle),
    /// 3D: a sphere, or a hollow sphere around the grains.
    Sphere(Sphere),
    /// 3D: an infinite cylinder, or a hollow one around the grains.
    Cylinder(Cylinder),
    /// A segment in 2D, a rectangle in 3D; solid from both sides.
    Plate(Plate),
}

/// A plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// Normal, of any length, pointing to the side where the grains are.
    pub normal: Vec<f64>,
    /// Position of the plane.
    pub place: Place,
}

/// Position of a plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// Seated against the sample: moved along its normal until it touches the first grain.
    Seated,
    /// Through this point: one number for each dimension (m).
    At(Vec<f64>),
}

/// A circular wall (2D).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    /// Centre `[x, y]` (m).
    pub center: Vec<f64>,
    /// Radius (m).
    pub radius: f64,
    /// Whether the grains are inside the wall, as in a drum.
    #[serde(default)]
    pub inside: bool,
    /// Seated against the sample: moved from `center` in this direction, of any length, until it
    /// touches the first grain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seated: Option<Vec<f64>>,
}

/// A spherical wall (3D).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Centre `[x, y, z]` (m).
    pub center: Vec<f64>,
    /// Radius (m).
    pub radius: f64,
    /// Whether the grains are inside the sphere.
    #[serde(default)]
    pub inside: bool,
    /// Seated against the sample: moved from `center` in this direction, of any length, until it
    /// touches the first grain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seated: Option<Vec<f64>>,
}

/// An infinite cylindrical wall (3D).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    /// A point on the axis, `[x, y, z]` (m).
    pub center: Vec<f64>,
    /// Direction of the axis, of any length.
    pub axis: Vec<f64>,
    /// Radius (m).
    pub radius: f64,
    /// Whether the grains are inside the wall, as in a drum.
    #[serde(default)]
    pub inside: bool,
}

/// A plate: a segment (2D) or a rectangle (3D). It is solid from both sides and at its edges: a
/// grain touches the point of the plate that is nearest to the centre of the grain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plate {
    /// Normal, of any length: the direction in which the plate is seated and, by default, driven.
    pub normal: Vec<f64>,
    /// Its middle (m).
    pub center: Vec<f64>,
    /// Lengths of its sides (m): one in 2D, two in 3D.
    pub size: Vec<f64>,
    /// 3D: direction of its first side, of any length, perpendicular to the normal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<Vec<f64>>,
    /// Seated against the sample: moved from `center` along its normal until it touches the first
    /// grain.
    #[serde(default)]
    pub seated: bool,
}

/// The mass of a wall that is driven by a force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallMass {
    /// The mass of all grains together.
    Sample,
    /// This mass (kg).
    Kg(f64),
}

/// How a wall moves.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// Not at all.
    Fixed,
    /// At this velocity along its direction (m/s).
    Velocity(Function),
    /// Under this force along its direction (N).
    Force(Function),
    /// Under this stress along its normal (Pa).
    Stress(Function),
}

impl Shape {
    /// What it is called, in a scene and in words.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Plane(_) => "plane",
            Self::Circle(_) => "circle",
            Self::Sphere(_) => "sphere",
            Self::Cylinder(_) => "cylinder",
            Self::Plate(_) => "plate",
        }
    }

    /// The dimension that it belongs to; none if it has a meaning in both.
    fn dimension(&self) -> Option<usize> {
        match self {
            Self::Plane(_) | Self::Plate(_) => None,
            Self::Circle(_) => Some(2),
            Self::Sphere(_) | Self::Cylinder(_) => Some(3),
        }
    }

    /// Reports its wrong values.
    pub(crate) fn check(&self, report: &mut Report, path: &str) {
        let (name, path) = (self.name(), format!("{path}.{}", self.name()));
        if self.dimension().is_some_and(|dimension| dimension != report.dimension) {
            let allowed =
                if report.dimension == 3 { "plane, plate, sphere or cylinder" } else { "plane, plate or circle" };
            report.wrong(&path, format!("a {name} in {} dimensions", report.dimension), allowed);
            return;
        }
        let round = |report: &mut Report, center: &[f64], radius: f64| {
            report.vector(&format!("{path}.center"), center);
            report.positive(format!("{path}.radius"), radius, "m");
        };
        let seated = |report: &mut Report, direction: &Option<Vec<f64>>, inside: bool| match direction {
            Some(_) if inside => {
                report.wrong(format!("{path}.seated"), "a direction", "nothing: the grains are inside")
            }
            Some(direction) => report.direction(&format!("{path}.seated"), direction),
            None => {}
        };
        match self {
            Self::Plane(plane) => {
                report.direction(&format!("{path}.normal"), &plane.normal);
                if let Place::At(point) = &plane.place {
                    report.vector(&format!("{path}.place.at"), point);
                }
            }
            Self::Circle(circle) => {
                round(report, &circle.center, circle.radius);
                seated(report, &circle.seated, circle.inside);
            }
            Self::Sphere(sphere) => {
                round(report, &sphere.center, sphere.radius);
                seated(report, &sphere.seated, sphere.inside);
            }
            Self::Cylinder(cylinder) => {
                report.direction(&format!("{path}.axis"), &cylinder.axis);
                round(report, &cylinder.center, cylinder.radius);
            }
            Self::Plate(plate) => plate.check(report, &path),
        }
    }

    /// The direction in which a round wall is moved from its centre until it touches the sample,
    /// and its radius (m).
    #[must_use]
    pub fn seat(&self) -> Option<(&[f64], f64)> {
        match self {
            Self::Circle(Circle { seated: Some(direction), radius, .. })
            | Self::Sphere(Sphere { seated: Some(direction), radius, .. }) => Some((direction, *radius)),
            _ => None,
        }
    }
}

impl Plate {
    fn check(&self, report: &mut Report, path: &str) {
        let before = report.problems.len();
        report.direction(&format!("{path}.normal"), &self.normal);
        report.vector(&format!("{path}.center"), &self.center);
        if self.size.len() + 1 == report.dimension {
            for (k, length) in self.size.iter().enumerate() {
                report.positive(format!("{path}.size.{k}"), *length, "m");
            }
        } else {
            let allowed =
                if report.dimension == 2 { "an array of one length (m)" } else { "an array of two lengths (m)" };
            report.wrong(format!("{path}.size"), format!("an array of {}", self.size.len()), allowed);
        }
        let place = format!("{path}.side");
        match &self.side {
            Some(side) if report.dimension == 2 => {
                report.wrong(place, format!("{side:?}"), "nothing: in 2 dimensions the normal determines it");
            }
            None if report.dimension == 3 => {
                report.wrong(place, "nothing", "a vector perpendicular to the normal: the direction of the first side");
            }
            Some(side) => {
                report.direction(&place, side);
                if report.problems.len() == before && cosine(side, &self.normal).abs() > PERPENDICULAR {
                    let allowed = format!("a vector perpendicular to the normal, {:?}", self.normal);
                    report.wrong(place, format!("{side:?}"), allowed);
                }
            }
            None => {}
        }
    }
}

/// Cosine of the angle between two vectors of one dimension.
pub(crate) fn cosine(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &[f64]| v.iter().fold(0.0_f64, |length, x| length.hypot(*x));
    a.iter().zip(b).map(|(x, y)| (x / norm(a)) * (y / norm(b))).sum()
}

impl Wall {
    /// How the wall moves: `force_rate` is a ramp from zero at t = 0.
    #[must_use]
    pub fn drive(&self) -> Drive {
        match (&self.velocity, &self.force, self.force_rate, &self.stress) {
            (Some(velocity), ..) => Drive::Velocity(velocity.clone()),
            (None, Some(force), ..) => Drive::Force(force.clone()),
            (None, None, Some(rate), _) => Drive::Force(Function::Ramp(Ramp { rate, start: 0.0 })),
            (None, None, None, Some(stress)) => Drive::Stress(stress.clone()),
            (None, None, None, None) => Drive::Fixed,
        }
    }

    /// The direction of the drive, not normalised: the one given, or else the normal of a plane or
    /// a plate.
    #[must_use]
    pub fn drive_direction(&self) -> Option<&[f64]> {
        match (&self.direction, &self.shape) {
            (Some(direction), _) => Some(direction),
            (None, Shape::Plane(Plane { normal, .. }) | Shape::Plate(Plate { normal, .. })) => Some(normal),
            (None, _) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane() -> Wall {
        Wall {
            shape: Shape::Plane(Plane { normal: vec![0.0, -1.0], place: Place::Seated }),
            friction: None,
            velocity: None,
            force: None,
            force_rate: None,
            stress: None,
            slide: None,
            grip: None,
            mass: None,
            direction: None,
        }
    }

    #[test]
    fn a_force_rate_is_a_ramp_from_zero() {
        let Drive::Force(force) = (Wall { force_rate: Some(200.0), ..plane() }).drive() else { panic!("no force") };
        assert_eq!((force.at(0.0), force.at(0.5)), (0.0, 100.0));
        assert_eq!(plane().drive(), Drive::Fixed);
    }

    #[test]
    fn a_plane_moves_along_its_normal_unless_told_otherwise() {
        assert_eq!(plane().drive_direction(), Some(&[0.0, -1.0][..]));
        let tilted = Wall { direction: Some(vec![1.0, 0.0]), ..plane() };
        assert_eq!(tilted.drive_direction(), Some(&[1.0, 0.0][..]));
        let circle = Shape::Circle(Circle { center: vec![0.0, 0.0], radius: 1.0, inside: false, seated: None });
        assert_eq!(Wall { shape: circle, ..plane() }.drive_direction(), None);
    }
}
