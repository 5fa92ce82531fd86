//! The history of a run: one HDF5 file. This crate is the only place that knows its layout.
//!
//! D = dimension, N grains, W walls, B bonds, T frames, M rows of contacts in all frames, S
//! observed steps, E ruptures. SI units; every dimensional dataset has an attribute `unit`. Groups
//! and datasets that a scene does not need are absent: without walls there is no `/walls`; without
//! bonds there is no `/bonds`, `/events`, `moment` or `bond`.
//!
//! ```text
//! /h5md                    attribute version [1,1]; author{name}, creator{name, version}: as H5MD
//!                          has them
//! /commit                  u64: frames that are complete; readers trust no row beyond it
//! /commit_rows/            contacts, events, steps: u64[T], rows complete at each frame
//! /checkpoint/             the state from which the run continues, in two slots written in turn:
//!     index u64[2,4]       of each slot: step + 1 (0: empty), number of reals, of counts, checksum
//!     reals_0, counts_0, reals_1, counts_1  f64, u64: the numbers of the state (`dem_core::saved`)
//! /particles/grains/       box{dimension, boundary}
//!     position, velocity   {step, time, value[T,N,D]}: m, m/s
//!     angular_velocity     {step, time, value[T,N] in 2D, [T,N,3] in 3D}: rad/s, if rotation
//!     angle                {step, time, value[T,N]}: rad, 2D only, if rotation
//!     orientation          {step, time, value[T,N,4]}: quaternions w x y z, 3D only, if rotation
//!     id, radius, mass, inertia [N]
//!     material u8[N]       place in /materials/name, if there are several materials
//! /materials/name [K]      if there are several; `base` comes first
//! /walls/                  name, kind [W]       enum PLANE, CIRCLE, CYLINDER, SPHERE, PLATE
//!     drive [W]            enum FIXED, VELOCITY, FORCE
//!     normal [W,D]         plane: unit normal towards the grains; plate: unit normal; cylinder:
//!                          unit axis; else 0
//!     radius [W]           m; 0 for planes and plates, negative where the grains are inside
//!     side [W,D]           plate: unit vector along its first side, the second is normal × side;
//!                          else 0. `side`, `length`, `width` only if there are plates
//!     length, width [W]    plate: m, of its first and second side; in 2D there is no `width`
//!     direction [W,D]      unit direction of the drive; 0 for fixed walls
//!     position, velocity   {step, time, value[T,W,D]}: m, m/s; a point of a plane, the middle of a
//!                          plate, else the centre
//!     force                {step, time, value[T,W,D]}: N, of the grains on the wall
//! /contacts/               step, time [T]; start u64[T], count u32[T]: rows of each frame
//!     pair i32[M,2]        grains i, j; j < 0 is wall −1−j. The normal points from j to i
//!     point, normal [M,D]; tangent [M,D] in 3D only (in 2D it is (−n_y, n_x))
//!     reaction [M,D]       N, of j on i, rows n, t (2D) or n, t1, t2 (3D; t2 = n × t1);
//!                          [M,1] with neither friction nor bonds
//!     moment               N m, if bonds: [M] (2D), [M,2] (3D, along t1 and t2), [M,3] (and n,
//!                          where bonds resist twist)
//!     gap [M], status [M]  m; enum OPEN, STICK, SLIP, BONDED
//!     bond i32[M]          −1 for none; if bonds
//! /bonds/                  pair i32[B,2]; rest_gap (m), strength (N), friction,
//!                          mean_diameter (m) [B]; rolling [B] if it differs from friction;
//!                          twist [B] if it may differ by pair of materials
//!     status               {step, time, value[T,B]}: enum INTACT, TENSION, SHEAR, ROLLING, TWIST
//!     formed i64[1]        if a stage forms the bonds: the step after which, −1 until then. B is 0
//!                          until then; in frames up to this step there are no bonds, and `status`
//!                          is INTACT
//! /events/rupture          compound [E]: step i64; time, x, y, z, rn, rt, m, twist, energy f64;
//!                          round, bond, i, j i32; mode i32 enum TENSION, SHEAR, ROLLING, TWIST;
//!                          pad i32 (0)
//! /observables/            step i64[S], time [S], shared by all (hard links, as H5MD allows)
//!     NAME                 {step, time, value[S,…]}, f64
//!     solver_route         the same, enum EXTRAPOLATION, ACTIVE_SET, INTERIOR_POINT, SWEEPS
//! /ending                  enum OPEN until the run ends, then TIME, WALL_TRAVEL, BROKEN_FRACTION,
//!                          LOAD_DROP, STAGES, NO_BREAK, NO_EQUILIBRIUM, INTERRUPTED or
//!                          NO_CONVERGENCE
//! /parameters/             scene (the JSON as run), earlier_scenes (those before it, where
//!                          `resume --force` changed it); attributes schema_version, seed, version,
//!                          git_revision, build, host, start; solid_fraction, if packed
//! /grain, axis, wall, …    names of the axes of datasets, without values (`dimensions.rs`)
//! ```
//!
//! **Writing.** All objects are created first; then the file switches to HDF5's single-writer mode.
//! So other programs can read it during the run and after a kill, with
//! `h5py.File(p, "r", swmr=True)`. Each frame writes its data, flushes, then writes `/commit` and
//! flushes that. A finished file opens with plain `h5py.File(p)`.
//!
//! **Precision.** With `output.precision` single the values of /particles, /walls and /contacts are
//! f32; without `output.reactions` /contacts has no `tangent`, `reaction` and `moment`. Constants,
//! observables and events are f64.
//!
//! **Size of chunks.** About 16 frames × 500 values: both one frame and the history of one grain
//! are quick to read. Files are not compressed during the run, since compression would cost more
//! than the run (`dem-post pack` compresses afterwards).

mod background;
mod checkpoint;
mod codes;
mod copy;
mod create;
mod dimensions;
mod ending;
mod error;
mod lock;
mod model;
mod observed;
mod reader;
mod rupture;
mod schema;
pub mod sound;
mod source;
pub mod sweep;
mod table;
#[cfg(test)]
mod tests;
mod texts;
mod visit;
mod wall;
mod writer;

pub use background::{Background, Batch};
pub use checkpoint::Checkpoint;
pub use codes::{BondStatus, ContactStatus, RuptureMode, SolverRoute};
pub use copy::{CopyAs, copy};
pub use ending::Ending;
pub use error::{HistoryError, Result, reason};
pub use lock::refuse_busy;
pub use model::{
    Bonds, ContactRows, Frame, GrainState, Grains, Layout, NOT_FORMED, Observable, Parameters, RowCounts, Rupture,
    ValueKind, WallState,
};
pub use observed::Series;
pub use reader::History;
pub use schema::{FALSE_ACCELERATION, LOAD_ERROR, ROUTE};
pub use wall::{Wall, WallColumn, WallDrive, WallKind};
pub use writer::Writer;

/// Version of the layout. It increases with every change that an older reader would misread. 2:
/// bonds also break in twist. 3: a rupture stores its twisting moment apart from the bending
/// moment. 4: the load error is that of the solver alone (NaN where no solve reports one), and the
/// false acceleration is separate; observables may be enumerations. 5: walls may be plates.
pub const SCHEMA_VERSION: u32 = 5;
