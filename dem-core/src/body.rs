//! Bodies: grains (rigid disks or spheres) and rigid walls, with the drives of walls and the loads
//! on grains.

use crate::dim::{Dim, Vect};
use crate::plate::Plate;
use std::sync::Arc;

/// A prescribed function of time (s).
pub type Schedule = Arc<dyn Fn(f64) -> f64 + Send + Sync>;

/// Rigid disks (2D) or spheres (3D), one entry per grain in every list.
#[derive(Clone, Debug)]
pub struct Grains<D: Dim> {
    /// Centres (m).
    pub position: Vec<D::Vector>,
    /// Velocities of the centres (m/s).
    pub velocity: Vec<D::Vector>,
    /// Angular velocities (rad/s).
    pub spin: Vec<D::Spin>,
    /// Angle (2D, rad) or unit quaternion w, x, y, z (3D).
    pub orientation: Vec<D::Orientation>,
    /// Radii (m).
    pub radius: Vec<f64>,
    /// Masses (kg).
    pub mass: Vec<f64>,
    /// Moments of inertia about the centre (kg m²).
    pub inertia: Vec<f64>,
    /// Whether the grain is held fixed.
    pub fixed: Vec<bool>,
    /// Material of the grain, a place in the lists of
    /// [`MaterialFriction`](crate::world::MaterialFriction); empty if there is one material.
    pub material: Vec<u8>,
}

/// One grain, as it is added to [`Grains`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain<D: Dim> {
    /// Centre (m).
    pub position: D::Vector,
    /// Velocity of the centre (m/s).
    pub velocity: D::Vector,
    /// Angular velocity (rad/s).
    pub spin: D::Spin,
    /// Radius (m).
    pub radius: f64,
    /// Mass (kg).
    pub mass: f64,
    /// Moment of inertia about the centre (kg m²).
    pub inertia: f64,
    /// Whether the grain is held fixed.
    pub fixed: bool,
}

impl<D: Dim> Grain<D> {
    /// A homogeneous grain at rest; `surface_density` is the density (kg/m³) times the thickness
    /// (m) in 2D, the density in 3D.
    pub fn at_rest(position: D::Vector, radius: f64, surface_density: f64) -> Self {
        let mass = surface_density * D::volume(radius);
        Self {
            position,
            velocity: D::Vector::zero(),
            spin: D::Spin::zero(),
            radius,
            mass,
            inertia: D::INERTIA_FACTOR * mass * radius * radius,
            fixed: false,
        }
    }
}

impl<D: Dim> FromIterator<Grain<D>> for Grains<D> {
    fn from_iter<I: IntoIterator<Item = Grain<D>>>(list: I) -> Self {
        let mut grains = Self {
            position: Vec::new(),
            velocity: Vec::new(),
            spin: Vec::new(),
            orientation: Vec::new(),
            radius: Vec::new(),
            mass: Vec::new(),
            inertia: Vec::new(),
            fixed: Vec::new(),
            material: Vec::new(),
        };
        list.into_iter().for_each(|grain| grains.push(grain));
        grains
    }
}

impl<D: Dim> Grains<D> {
    /// Number of grains.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there is no grain.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Add a grain.
    pub fn push(&mut self, grain: Grain<D>) {
        self.position.push(grain.position);
        self.velocity.push(grain.velocity);
        self.spin.push(grain.spin);
        self.orientation.push(D::unturned());
        self.radius.push(grain.radius);
        self.mass.push(grain.mass);
        self.inertia.push(grain.inertia);
        self.fixed.push(grain.fixed);
    }

    /// Material of grain `k`: 0 if the materials are not listed.
    pub fn material_of(&self, k: usize) -> usize {
        self.material.get(k).copied().map_or(0, usize::from)
    }

    /// Inverse mass (1/kg) and inverse inertia (1/(kg m²)) of grain `k`, both zero for a fixed
    /// grain.
    pub fn inverse(&self, k: usize) -> (f64, f64) {
        if self.fixed[k] { (0.0, 0.0) } else { (1.0 / self.mass[k], 1.0 / self.inertia[k]) }
    }

    /// Lowest and highest corner of the box around all grains (m).
    pub fn bounds(&self) -> (D::Vector, D::Vector) {
        self.bounds_at(&self.position)
    }

    /// The same box for grains at these positions (m).
    pub(crate) fn bounds_at(&self, places: &[D::Vector]) -> (D::Vector, D::Vector) {
        let mut low = D::Vector::zero();
        let mut high = D::Vector::zero();
        for axis in 0..D::N {
            low[axis] = f64::INFINITY;
            high[axis] = f64::NEG_INFINITY;
            for (x, r) in places.iter().zip(&self.radius) {
                low[axis] = low[axis].min(x[axis] - r);
                high[axis] = high[axis].max(x[axis] + r);
            }
        }
        (low, high)
    }
}

/// The surface of a wall, relative to the wall's position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape<D: Dim> {
    /// A plane through the position; the grains are on the side of the unit normal.
    Plane {
        /// Unit normal, from the wall to the grains.
        normal: D::Vector,
    },
    /// A circle (2D), a sphere (3D), or a cylinder (3D with an axis) around the position.
    Round {
        /// Radius (m).
        radius: f64,
        /// Whether the grains are inside.
        inside: bool,
        /// Unit axis of a cylinder.
        axis: Option<D::Vector>,
    },
    /// A segment (2D) or a rectangle (3D) with its middle at the position; grains are on either
    /// side.
    Plate(Plate<D>),
}

impl<D: Dim> Shape<D> {
    /// Gap (m, negative for an overlap) and unit normal towards the grain, for a grain at `offset`
    /// from the wall's position. Both are those of the point of the wall nearest to the centre of
    /// the grain, also where that centre is beyond the wall.
    pub fn gap(&self, offset: D::Vector, radius: f64) -> (f64, D::Vector) {
        match *self {
            Self::Plane { normal } => (offset.dot(&normal) - radius, normal),
            Self::Round { radius: wall, inside, axis } => {
                let offset = across::<D>(offset, axis);
                let distance = offset.norm();
                let outward = direction::<D>(offset, distance);
                if inside { (wall - distance - radius, -outward) } else { (distance - wall - radius, outward) }
            }
            Self::Plate(ref plate) => plate.gap(offset, radius),
        }
    }

    /// The length (m) to which tolerances at this wall are relative: its smallest radius of
    /// curvature, infinite for a plane. At a plate, too, they are relative to the grain alone: the
    /// sharp edges of a plate have no length.
    pub fn size(&self) -> f64 {
        match *self {
            Self::Plane { .. } | Self::Plate(_) => f64::INFINITY,
            Self::Round { radius, .. } => radius,
        }
    }

    /// The normal of a wall that has the same everywhere.
    pub fn flat_normal(&self) -> Option<D::Vector> {
        match *self {
            Self::Plane { normal } => Some(normal),
            Self::Round { .. } | Self::Plate(_) => None,
        }
    }

    /// How far a displacement by this unit vector moves the surface across itself (–): zero for a
    /// direction along a plane or along the axis of a cylinder. A plate that moves along itself
    /// moves its edges.
    pub fn moves_across(&self, direction: D::Vector) -> f64 {
        match *self {
            Self::Plane { normal } => direction.dot(&normal).abs(),
            Self::Round { axis, .. } => across::<D>(direction, axis).norm(),
            Self::Plate(_) => direction.norm(),
        }
    }

    /// Whether the wall is around the grains.
    pub fn encloses(&self) -> bool {
        match *self {
            Self::Plane { .. } | Self::Plate(_) => false,
            Self::Round { inside, .. } => inside,
        }
    }

    /// The component of a vector perpendicular to the axis of a round wall around the grains; none
    /// for other walls.
    pub(crate) fn around(&self, x: D::Vector) -> Option<D::Vector> {
        match *self {
            Self::Round { inside: true, axis, .. } => Some(across::<D>(x, axis)),
            _ => None,
        }
    }

    /// Smallest gap (m) of a grain that moves from `offset` along the straight displacement `way`
    /// (m).
    pub(crate) fn smallest_gap(&self, offset: D::Vector, way: D::Vector, radius: f64) -> f64 {
        let end = || self.gap(offset + way, radius).0.min(self.gap(offset, radius).0);
        match *self {
            // along a line the gap to a plane or to an enclosing wall is smallest at an end
            Self::Plane { .. } | Self::Round { inside: true, .. } => end(),
            Self::Plate(ref plate) => plate.smallest_gap(offset, way, radius),
            Self::Round { inside: false, axis, .. } => {
                let (x, w) = (across::<D>(offset, axis), across::<D>(way, axis));
                let nearest = -x.dot(&w) / w.dot(&w);
                if 0.0 < nearest && nearest < 1.0 { self.gap(offset + way * nearest, radius).0 } else { end() }
            }
        }
    }
}

/// Vector (m) from the centre at `j` to the centre at `i`. A periodic cell would change this
/// function alone.
#[inline]
pub(crate) fn separation<D: Dim>(i: D::Vector, j: D::Vector) -> D::Vector {
    i - j
}

/// The component of a vector perpendicular to the axis of a cylinder; the vector itself without an
/// axis.
fn across<D: Dim>(x: D::Vector, axis: Option<D::Vector>) -> D::Vector {
    axis.map_or(x, |a| x - a * a.dot(&x))
}

/// The unit vector along `offset`, whose norm is `distance`. Coinciding centres have no normal: the
/// first axis is returned.
pub(crate) fn direction<D: Dim>(offset: D::Vector, distance: f64) -> D::Vector {
    if distance > 0.0 {
        return offset * (1.0 / distance);
    }
    let mut first = D::Vector::zero();
    first[0] = 1.0;
    first
}

/// How a wall moves.
#[derive(Clone)]
pub enum Drive<D: Dim> {
    /// The wall does not move.
    Fixed,
    /// A prescribed speed (m/s) along a unit direction.
    Velocity {
        /// Unit direction.
        direction: D::Vector,
        /// Speed (m/s) over time (s).
        speed: Schedule,
    },
    /// A prescribed force (N) along a unit direction; the wall has a mass and this one degree of
    /// freedom.
    Force {
        /// Unit direction.
        direction: D::Vector,
        /// Mass of the wall (kg).
        mass: f64,
        /// Force (N) over time (s).
        force: Schedule,
    },
}

/// A prescribed velocity of a wall across the direction of its drive.
#[derive(Clone)]
pub struct Slide<D: Dim> {
    /// Unit direction, perpendicular to that of the drive.
    pub direction: D::Vector,
    /// Speed (m/s) over time (s).
    pub speed: Schedule,
}

/// A rigid wall.
#[derive(Clone)]
pub struct Wall<D: Dim> {
    /// Surface.
    pub shape: Shape<D>,
    /// A point of the plane, the middle of a plate, or the centre (m).
    pub position: D::Vector,
    /// Velocity (m/s).
    pub velocity: D::Vector,
    /// How it moves.
    pub drive: Drive<D>,
    /// Whether the value of its force drive is a stress (Pa) on the present section of the sample.
    /// The wall is then a plane whose normal is parallel to an axis, or a plate whose sides are
    /// parallel to axes too.
    pub per_area: bool,
    /// That section in the last step (m²).
    pub section: f64,
    /// Motion of a force-driven wall across its drive, if prescribed.
    pub slide: Option<Slide<D>>,
    /// Grains within this distance of the surface at time zero (m) move with the wall, without
    /// turning, and the forces on them act on the wall. A wall that a force drives holds no grains.
    pub grip: Option<f64>,
    /// Friction coefficient with grains (–).
    pub friction: f64,
    /// Force of the grains on the wall in the last step (N), after all ruptures in it; the mean
    /// over its parts.
    pub reaction: D::Vector,
    /// The same before the first rupture in the step (N): the equilibrium whose bonds reached their
    /// limit. Equals `reaction` where no solve followed a rupture, in a step that is not in parts.
    pub reaction_at_limit: D::Vector,
    /// Force prescribed in the last step (N), the mean over its parts; zero for a wall without a
    /// force drive.
    pub applied: f64,
}

impl<D: Dim> Wall<D> {
    /// A fixed wall.
    pub fn fixed(shape: Shape<D>, position: D::Vector, friction: f64) -> Self {
        let zero = D::Vector::zero();
        Self {
            shape,
            position,
            velocity: zero,
            drive: Drive::Fixed,
            per_area: false,
            section: 0.0,
            slide: None,
            grip: None,
            friction,
            reaction: zero,
            reaction_at_limit: zero,
            applied: 0.0,
        }
    }

    /// Prescribed force (N) at a time (s); zero for a wall without a force drive.
    pub fn applied_force(&self, time: f64) -> f64 {
        match &self.drive {
            Drive::Force { force, .. } if self.per_area => force(time) * self.section,
            Drive::Force { force, .. } => force(time),
            Drive::Fixed | Drive::Velocity { .. } => 0.0,
        }
    }

    /// Prescribed velocity (m/s) across the drive at a time (s).
    pub fn slide_velocity(&self, time: f64) -> Option<D::Vector> {
        self.slide.as_ref().map(|slide| slide.direction * (slide.speed)(time))
    }

    /// The part of a velocity of this wall (m/s) that is not prescribed: along the drive, where the
    /// motion across it is prescribed, else all of it.
    pub(crate) fn driven_part(&self, velocity: D::Vector) -> D::Vector {
        match (&self.slide, self.free_direction()) {
            (Some(_), Some((direction, _))) => direction * direction.dot(&velocity),
            _ => velocity,
        }
    }

    /// Direction and mass (kg) of the degree of freedom of a force-driven wall.
    pub fn free_direction(&self) -> Option<(D::Vector, f64)> {
        match self.drive {
            Drive::Force { direction, mass, .. } => Some((direction, mass)),
            _ => None,
        }
    }
}

/// A prescribed force and torque on one grain, both scaled by one function of time.
#[derive(Clone)]
pub struct Load<D: Dim> {
    /// Index of the grain.
    pub grain: usize,
    /// Force (N).
    pub force: D::Vector,
    /// Torque (N m).
    pub torque: D::Spin,
    /// Factor (–) over time (s).
    pub factor: Schedule,
}
