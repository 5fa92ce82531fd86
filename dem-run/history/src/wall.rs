//! The constant properties of the walls, and the datasets of `/walls` that hold them.

use std::slice::from_mut;

use super::codes::codes;

/// The constant properties of a wall. In 2D the third components are zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Its name in the scene.
    pub name: String,
    /// Its shape.
    pub kind: WallKind,
    /// Plane: unit normal towards the grains; plate: unit normal; cylinder: unit axis; else zero.
    pub normal: [f64; 3],
    /// Radius, m: 0 for a plane and a plate, negative where the grains are inside.
    pub radius: f64,
    /// Plate: unit vector along its first side; in 3D the second is normal × side. Else zero.
    pub side: [f64; 3],
    /// Plate: length of its first side, m. Else zero.
    pub length: f64,
    /// Plate in 3D: length of its second side, m. Else zero.
    pub width: f64,
    /// Its drive.
    pub drive: WallDrive,
    /// Unit direction of the drive; zero for fixed walls.
    pub direction: [f64; 3],
}

codes! {
    /// The shape of a wall.
    WallKind, WallKindCode(u8, U1, signed = false),
    /// A half-space bounded by a plane (a line in 2D).
    Plane = 0 "PLANE",
    /// A circle in 2D.
    Circle = 1 "CIRCLE",
    /// An endless cylinder in 3D.
    Cylinder = 2 "CYLINDER",
    /// A sphere in 3D.
    Sphere = 3 "SPHERE",
    /// A segment in 2D, a rectangle in 3D.
    Plate = 4 "PLATE"
}

impl WallKind {
    /// Whether `/walls/normal` has a unit vector for it: the normal of a plane or a plate, the axis
    /// of a cylinder.
    pub fn has_normal(self) -> bool {
        match self {
            Self::Plane | Self::Cylinder | Self::Plate => true,
            Self::Circle | Self::Sphere => false,
        }
    }
}

codes! {
    /// What drives a wall.
    WallDrive, WallDriveCode(u8, U1, signed = false),
    /// Nothing: the wall is fixed.
    Fixed = 0 "FIXED",
    /// Its velocity is prescribed.
    Velocity = 1 "VELOCITY",
    /// The force along one direction is prescribed.
    Force = 2 "FORCE"
}

impl Default for Wall {
    /// A fixed plane without a name or a normal.
    fn default() -> Self {
        let zero = [0.0; 3];
        Self {
            name: String::new(),
            kind: WallKind::Plane,
            normal: zero,
            radius: 0.0,
            side: zero,
            length: 0.0,
            width: 0.0,
            drive: WallDrive::Fixed,
            direction: zero,
        }
    }
}

impl Wall {
    /// A wall whose columns are still zero.
    pub(super) fn unmeasured(name: String, kind: WallKind, drive: WallDrive) -> Self {
        Self { name, kind, drive, ..Self::default() }
    }
}

/// A constant quantity of the walls: a dataset of `/walls`, one row for each wall.
pub struct WallColumn {
    /// The name of the dataset.
    pub name: &'static str,
    /// Its unit; empty for plain numbers.
    pub unit: &'static str,
    /// Whether a row is a vector of D numbers; else it is one number.
    pub vector: bool,
    /// Whether every history with walls has it. Else it is absent, which means zero, from those
    /// without a wall that has it and from those older than it.
    pub always: bool,
    /// Where a wall holds it: D numbers and zeros up to three, or one number.
    field: fn(&mut Wall) -> &mut [f64],
}

impl WallColumn {
    /// All of them.
    pub const ALL: &[Self] = &[
        Self { name: "normal", unit: "", vector: true, always: true, field: |wall| &mut wall.normal },
        Self { name: "direction", unit: "", vector: true, always: true, field: |wall| &mut wall.direction },
        Self { name: "radius", unit: "m", vector: false, always: true, field: |wall| from_mut(&mut wall.radius) },
        Self { name: "side", unit: "", vector: true, always: false, field: |wall| &mut wall.side },
        Self { name: "length", unit: "m", vector: false, always: false, field: |wall| from_mut(&mut wall.length) },
        Self { name: "width", unit: "m", vector: false, always: false, field: |wall| from_mut(&mut wall.width) },
    ];

    /// The shape of one row.
    pub fn row(&self, dimension: usize) -> Vec<usize> {
        if self.vector { vec![dimension] } else { vec![] }
    }

    /// The rows of these walls, one after the other.
    pub(super) fn values(&self, walls: &[Wall], dimension: usize) -> Vec<f64> {
        let row = |wall: &Wall| (self.field)(&mut wall.clone())[..self.width(dimension)].to_vec();
        walls.iter().flat_map(row).collect()
    }

    /// Sets the rows of these walls.
    pub(super) fn set(&self, walls: &mut [Wall], dimension: usize, values: &[f64]) {
        let width = self.width(dimension);
        for (wall, row) in walls.iter_mut().zip(values.chunks_exact(width)) {
            (self.field)(wall)[..width].copy_from_slice(row);
        }
    }

    /// Numbers of a row.
    pub(super) fn width(&self, dimension: usize) -> usize {
        self.row(dimension).iter().product()
    }
}
