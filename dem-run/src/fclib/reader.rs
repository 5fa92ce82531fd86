//! Reading a problem, local or global. C contacts of S rows, N unknowns of bodies.

use std::path::Path;

use dem_core::problem::assembled::{Assembled, AssemblyError, BlockMatrix, ContactRows, Parts, ROUNDING};
use dem_core::problem::global::Global;

use super::source::{Entry, Source};
use super::{FclibError, Problem};

/// The possible groups of a problem, and whether the problem is global (with the velocities of
/// bodies as unknowns).
const GROUPS: [(&str, bool); 3] = [("fclib_local", false), ("fclib_global", true), ("fclib_global_rolling", true)];
/// Largest accepted change of an entry to make W symmetric, over the largest entry (–).
const MOST_ASYMMETRY: f64 = 1e-3;

impl Problem {
    /// Reads an FCLIB problem with any storage of its matrices. A global problem is reduced to a
    /// local one.
    ///
    /// # Errors
    /// [`FclibError`] with the name of the missing or wrong dataset.
    pub fn read(path: &Path) -> Result<Self, FclibError> {
        hdf5::silence_errors(true);
        let source = Source::open(path)?;
        let Some((group, global)) = GROUPS.into_iter().find(|(group, _)| source.has(group)) else {
            return Err(source.foreign(match source.has("h5md") {
                true => "it is a history: `dem-run export` takes a problem out of it",
                false => "it has no group /fclib_local, /fclib_global or /fclib_global_rolling",
            }));
        };
        let mut reader = Reader { source, group, warnings: Vec::new() };
        let assembled = reader.assembled(global)?;
        let Reader { source, warnings, .. } = reader;
        let rows = assembled.r.len();
        let reactions = |group: &str| match source.has(group) {
            true => source.finite(&format!("{group}/r"), rows).map(Some),
            false => Ok(None),
        };
        let (guess, solution) = (reactions("guesses/1")?, reactions("solution")?);
        let info = |name: &str| source.text(&format!("{group}/info/{name}"));
        let (title, description, math_info) = (info("title"), info("description"), info("math_info"));
        let mut problem = Self { title, description, math_info, assembled, solution, warnings };
        if let Some(guess) = guess {
            problem.assembled.r = guess;
        }
        Ok(problem)
    }
}

/// An open file, the group of its problem, and messages about changes made in reading.
struct Reader {
    source: Source,
    group: &'static str,
    warnings: Vec<String>,
}

impl Reader {
    fn at(&self, name: &str) -> String {
        format!("{}/{name}", self.group)
    }

    fn assembled(&mut self, global: bool) -> Result<Assembled, FclibError> {
        for name in ["V", "R", "G"] {
            if self.source.has(&self.at(name)) {
                let why = "equality constraints are not read; eliminate them from the problem";
                return Err(self.source.wrong(&self.at(name), why));
            }
        }
        let rows = self.rows()?;
        let (matrix, q) = if global { self.condensed(rows.count())? } else { self.local(rows.count())? };
        let matrix = self.symmetric(matrix)?;
        let parts = self.parts(rows, matrix, q)?;
        Assembled::new(parts).map_err(|error| {
            let place = match &error {
                AssemblyError::Length { array, .. } | AssemblyError::Value { array, .. } => match *array {
                    "shift" | "applied" | "associated" => format!("cohesive_dem/{array}"),
                    "mu" | "mu_r" | "mu_t" => self.at(&format!("vectors/{array}")),
                    "q" => self.at(if global { "vectors" } else { "vectors/q" }),
                    _ => self.at(if global { "H" } else { "W/x" }),
                },
                AssemblyError::Asymmetric { .. } => self.at("W"),
            };
            self.source.wrong(&place, error.to_string())
        })
    }

    /// The rows of each contact.
    fn rows(&self) -> Result<ContactRows, FclibError> {
        let (spacedim, mu_r) = (self.at("spacedim"), self.at("vectors/mu_r"));
        let dimension = self.source.integer(&spacedim)?;
        let rolling = self.source.has(&mu_r);
        if !rolling && (self.group == "fclib_global_rolling" || [5, 6].contains(&dimension)) {
            return Err(self.source.wrong(&mu_r, format!("it is missing, but spacedim is {dimension}")));
        }
        match (dimension, rolling) {
            (2, false) => Ok(ContactRows { tangents: 1, moments: 0 }),
            (3, false) => Ok(ContactRows { tangents: 2, moments: 0 }),
            (3, true) => Ok(ContactRows { tangents: 1, moments: 1 }),
            (5, true) => Ok(ContactRows { tangents: 2, moments: 2 }),
            (6, true) => Ok(ContactRows { tangents: 2, moments: 3 }),
            _ => {
                let allowed = if rolling { "3, 5 or 6, as there is a mu_r" } else { "2 or 3, or with mu_r 3, 5 or 6" };
                Err(self.source.wrong(&spacedim, format!("it is {dimension}, it must be {allowed}")))
            }
        }
    }

    /// W, in C × C blocks of `size` × `size`, and q (C·S) of a local problem.
    fn local(&self, size: usize) -> Result<(BlockMatrix, Vec<f64>), FclibError> {
        let place = self.at("W");
        let total = self.multiple(&format!("{place}/m"), self.source.order(&place)?, size)?;
        // q is read before the matrix, so that a forged m cannot allocate memory
        let q = self.source.finite(&self.at("vectors/q"), total)?;
        let entries = self.source.entries(&place, total, total)?;
        Ok((BlockMatrix::from_entries(total / size, size, &entries), q))
    }

    /// W and q of a global problem, from M (N × N), H (N × C·S), f (N) and w (C·S).
    fn condensed(&mut self, size: usize) -> Result<(BlockMatrix, Vec<f64>), FclibError> {
        let (m, h) = (self.at("M"), self.at("H"));
        let unknowns = self.source.order(&m)?;
        let (rows, columns) = self.source.shape(&h)?;
        if rows != unknowns {
            let why = format!("it is {rows}, but M has {unknowns} rows");
            return Err(self.source.wrong(&format!("{h}/m"), why));
        }
        let total = self.multiple(&format!("{h}/n"), columns, size)?;
        // vectors are read before matrices, so that forged sizes cannot allocate memory
        let impulses = self.source.finite(&self.at("vectors/f"), unknowns)?;
        let given = self.source.finite(&self.at("vectors/w"), total)?;
        let (mass, directions) = (self.finite_entries(&m, unknowns, unknowns)?, self.finite_entries(&h, rows, total)?);
        let global = Global { size, mass: &mass, directions: &directions, impulses: &impulses, given: &given };
        let condensed = global.condensed().map_err(|error| self.source.wrong(self.group, error.to_string()))?;
        if condensed.asymmetry > ROUNDING {
            self.warnings.push(format!(
                "M was made symmetric: entries changed by up to {:.1e} of the root of the product of their diagonal entries",
                condensed.asymmetry
            ));
        }
        Ok((condensed.matrix, condensed.q))
    }

    fn finite_entries(&self, matrix: &str, m: usize, n: usize) -> Result<Vec<Entry>, FclibError> {
        let entries = self.source.entries(matrix, m, n)?;
        match entries.iter().position(|(_, _, x)| !x.is_finite()) {
            None => Ok(entries),
            Some(at) => {
                let why = format!("it is {} at index {at}, it must be finite", entries[at].2);
                Err(self.source.wrong(&format!("{matrix}/x"), why))
            }
        }
    }

    /// Returns W if symmetric up to round-off. If W is nearly symmetric, it is symmetrised, with a
    /// warning.
    fn symmetric(&mut self, matrix: BlockMatrix) -> Result<BlockMatrix, FclibError> {
        let Some(worst) = matrix.asymmetry().filter(|worst| worst.relative > ROUNDING) else { return Ok(matrix) };
        let (relative, row, column) = (worst.relative, worst.row, worst.column);
        if relative > MOST_ASYMMETRY {
            let why = format!(
                "W is not symmetric: {:e} in row {row} and column {column}, {:e} in the place opposite; their mean differs by \
                 {relative:.1e} of the largest entry; at most {MOST_ASYMMETRY:e} is corrected",
                worst.entry, worst.mirrored
            );
            return Err(self.source.wrong(&self.at("W"), why));
        }
        self.warnings.push(format!(
            "W was made symmetric: entries changed by up to {relative:.1e} of the largest; residuals are those of the \
             symmetric W"
        ));
        Ok(matrix.symmetrised())
    }

    fn parts(&self, rows: ContactRows, matrix: BlockMatrix, q: Vec<f64>) -> Result<Parts, FclibError> {
        let contacts = matrix.contacts();
        let ours = self.source.has("cohesive_dem");
        let zero = || Ok(vec![0.0; contacts]);
        let vector = |place: &str| self.source.finite(place, contacts);
        let coefficients = |name: &str| vector(&self.at(&format!("vectors/{name}")));
        Ok(Parts {
            mu: coefficients("mu")?,
            nu: if rows.moments > 0 { coefficients("mu_r")? } else { zero()? },
            xi: if rows.moments > rows.tangents { coefficients("mu_t")? } else { zero()? },
            associated: match ours {
                true => self.source.indices("cohesive_dem/associated", contacts, 2)?,
                false => vec![0; contacts],
            }
            .into_iter()
            .map(|flag| flag == 1)
            .collect(),
            shift: if ours { vector("cohesive_dem/shift")? } else { zero()? },
            applied: if ours { self.source.finite("cohesive_dem/applied", 1)?[0] } else { 0.0 },
            rows,
            matrix,
            q,
        })
    }

    /// Returns `found`, the number of rows of all contacts, if it is a positive multiple of `size`.
    fn multiple(&self, place: &str, found: usize, size: usize) -> Result<usize, FclibError> {
        if found == 0 || !found.is_multiple_of(size) {
            let why = format!("it is {found}, it must be a multiple of {size} above zero: {size} rows a contact");
            return Err(self.source.wrong(place, why));
        }
        Ok(found)
    }
}
