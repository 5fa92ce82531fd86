//! Contact problems in FCLIB's format (HDF5), the exchange format of the field: `dem-run export`
//! and `dem-run solve`.
//!
//! C contacts of S rows, N unknowns of bodies; every scalar is a dataset of one value, integers are
//! 32 bits wide.
//!
//! ```text
//! /fclib_local/
//!     spacedim             S: 2 (n, t), 3 (n, t1, t2); with mu_r 3 (n, t, m) or
//!                          5 (n, t1, t2, m1, m2); with mu_t also 6 (…, twist), which other
//!                          programs do not support
//!     W/                   m, n, nzmax, nz, p, i, x: the matrix, C·S × C·S
//!         nz = −1          by columns: p[n + 1] where each starts, i[nzmax] rows, x[nzmax] values
//!         nz = −2          by rows: p[m + 1] where each starts, i[nzmax] columns, x[nzmax] values
//!         nz ≥ 0           nz triplets: i[nz] rows, p[nz] columns, x[nz] values
//!     vectors/             q [C·S]; mu [C]; mu_r [C] with rolling rows; mu_t [C] with a twist row
//!     info/                title, description, math_info: text
//! /fclib_global/           or this, read but not written: M v = H r + f, u = Hᵀ v + w over
//!                          the velocities v of the bodies
//! /fclib_global_rolling/   the same, with mu_r
//!     spacedim, info/      as above
//!     M/, H/               N × N and N × C·S, stored as W is
//!     vectors/             f [N]; w [C·S]; mu [C]; mu_r [C] with rolling rows
//! /guesses/                number_of_guesses; 1, 2, …: u, r [C·S]
//! /solution/               u, r [C·S]
//! /cohesive_dem/           our extension, ignored by other programs
//!     associated           i32 [C]: 1 if the flow of a contact is normal to its cone
//!     shift                [C]: r minus the reaction, in the normal row (N s)
//!     applied              norm of the applied impulses (N s), one scale of the residual
//! ```
//!
//! In FCLIB, and so in a file without `/cohesive_dem`, all contacts follow Coulomb's law in the
//! form of the bipotential. For r, q and mu_r of cohesive bonds see docs/theory/fclib.md.

mod error;
mod reader;
mod source;
mod writer;

pub use error::FclibError;

use dem_core::problem::assembled::Assembled;

/// The content of an FCLIB file.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Title on one line.
    pub title: String,
    /// Description and origin.
    pub description: String,
    /// Known mathematical properties.
    pub math_info: String,
    /// The assembled problem. Its reactions are the first guess of the file, or zero.
    pub assembled: Assembled,
    /// Reactions r̂ (N s) of a solution, if known.
    pub solution: Option<Vec<f64>>,
    /// Messages about changes made in reading.
    pub warnings: Vec<String>,
}
