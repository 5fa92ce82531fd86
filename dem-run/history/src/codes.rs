//! The enumerations that a history stores, each a real HDF5 enum datatype.
//!
//! A file may hold any byte as the value of an enum. So values are read as raw codes (`…Code`,
//! transparent over the integer, with the HDF5 enum as datatype) and then checked against the
//! variants.

use hdf5::H5Type;

/// A Rust enum and its raw code in the file.
pub(super) trait Coded: Copy {
    /// The stored integer, of HDF5 enum type.
    type Code: H5Type + Copy;
    /// The raw code of this value.
    fn code(self) -> Self::Code;
    /// The value of a raw code, `None` if no variant has it.
    fn from_code(code: Self::Code) -> Option<Self>;
}

macro_rules! codes {
    ($(#[$doc:meta])* $name:ident, $code:ident($raw:ty, $size:ident, signed = $signed:literal),
     $($(#[$vdoc:meta])* $variant:ident = $value:literal $label:literal),+) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $name { $($(#[$vdoc])* $variant),+ }

        impl $name {
            /// Every variant, in the order of their codes.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// The name that the file and the tables use, as in `TENSION`.
            pub fn label(self) -> &'static str {
                match self { $(Self::$variant => $label),+ }
            }
        }

        #[doc = concat!("The stored form of [`", stringify!($name), "`].")]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(transparent)]
        pub(super) struct $code(pub(super) $raw);

        // Sound: the type is transparent over the integer that is the enum's base type.
        unsafe impl hdf5::H5Type for $code {
            fn type_descriptor() -> hdf5::types::TypeDescriptor {
                hdf5::types::TypeDescriptor::Enum(hdf5::types::EnumType {
                    size: hdf5::types::IntSize::$size,
                    signed: $signed,
                    members: vec![$(hdf5::types::EnumMember { name: $label.into(), value: $value }),+],
                })
            }
        }

        impl $crate::codes::Coded for $name {
            type Code = $code;
            fn code(self) -> $code {
                match self { $(Self::$variant => $code($value)),+ }
            }
            fn from_code(code: $code) -> Option<Self> {
                match code.0 { $($value => Some(Self::$variant),)+ _ => None }
            }
        }
    };
}

pub(super) use codes;

codes! {
    /// Status of a contact in the last solve.
    ContactStatus, ContactCode(u8, U1, signed = false),
    /// It carries no reaction.
    Open = 0 "OPEN",
    /// It touches without sliding.
    Stick = 1 "STICK",
    /// It slides at the limit of friction.
    Slip = 2 "SLIP",
    /// An intact bond.
    Bonded = 3 "BONDED"
}

codes! {
    /// Whether a bond holds, and if not, how it broke.
    BondStatus, BondCode(u8, U1, signed = false),
    /// It holds.
    Intact = 0 "INTACT",
    /// It broke in tension.
    Tension = 1 "TENSION",
    /// It broke in shear.
    Shear = 2 "SHEAR",
    /// It broke by its rolling moment.
    Rolling = 3 "ROLLING",
    /// It broke by its twisting moment.
    Twist = 4 "TWIST"
}

impl BondStatus {
    /// How the bond broke; none if it holds.
    pub fn mode(self) -> Option<RuptureMode> {
        match self {
            Self::Intact => None,
            Self::Tension => Some(RuptureMode::Tension),
            Self::Shear => Some(RuptureMode::Shear),
            Self::Rolling => Some(RuptureMode::Rolling),
            Self::Twist => Some(RuptureMode::Twist),
        }
    }
}

codes! {
    /// How a bond broke.
    RuptureMode, ModeCode(i32, U4, signed = true),
    /// The normal force reached the cohesion.
    Tension = 1 "TENSION",
    /// The tangential force reached its limit.
    Shear = 2 "SHEAR",
    /// The rolling moment reached its limit.
    Rolling = 3 "ROLLING",
    /// The twisting moment reached its limit.
    Twist = 4 "TWIST"
}

codes! {
    /// The method that solved a step; for several solves, the last in this order.
    SolverRoute, RouteCode(u8, U1, signed = false),
    /// The reactions were extrapolated from the steps before, and a check accepted them.
    Extrapolation = 0 "EXTRAPOLATION",
    /// Newton from the active set of the last step.
    ActiveSet = 1 "ACTIVE_SET",
    /// The interior-point method.
    InteriorPoint = 2 "INTERIOR_POINT",
    /// Sweeps of Gauss–Seidel.
    Sweeps = 3 "SWEEPS"
}

impl SolverRoute {
    /// Its code in the values of an observable.
    pub fn number(self) -> f64 {
        f64::from(self.code().0)
    }

    /// The route with this code; `None` for an invalid code.
    pub fn of_number(number: f64) -> Option<Self> {
        Self::ALL.iter().copied().find(|route| route.number() == number)
    }
}

impl From<RuptureMode> for BondStatus {
    fn from(mode: RuptureMode) -> Self {
        match mode {
            RuptureMode::Tension => Self::Tension,
            RuptureMode::Shear => Self::Shear,
            RuptureMode::Rolling => Self::Rolling,
            RuptureMode::Twist => Self::Twist,
        }
    }
}
