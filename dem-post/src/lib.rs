//! Analyses of histories: cracks and fragments, force chains, stress and strain.
//!
//! Each analysis has a module with a function that reads a [`dem_run::history::History`] and returns a report, and a
//! function that writes the report as CSV, SVG and PNG. Reports know nothing of files or drawings.

pub mod chains;
pub mod cli;
pub mod collapse;
pub mod cracks;
pub mod fragments;
pub mod info;
pub mod map;
pub mod moments;
pub mod output;
pub mod stress_strain;

use dem_run::{plot, row};
